"""Nothing of the suite depends on what its process inherits: signals ignored by nohup or a runner, masks, a umask. What
each test would make anew is made once.
"""

import functools
import os
import signal

import typer.testing
from hypothesis import settings

# The same few examples in every run; `make nightly` takes many new ones.
settings.register_profile("few", max_examples=20, deadline=None, derandomize=True, database=None)
settings.register_profile("nightly", max_examples=1000, deadline=None, derandomize=False, print_blob=True)
settings.load_profile("few")

# The commands of the command line are built once, not anew for each of a thousand calls, which took as long as most do.
if hasattr(typer.testing, "_get_command"):
    typer.testing._get_command = functools.cache(typer.testing._get_command)


def pytest_configure() -> None:
    """Give the signals that tests send, here and in the processes they start, their usual handlers.

    A shell starts what it puts into the background with SIGINT ignored, nohup ignores SIGHUP, and both are inherited.
    """
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for name in ("SIGTERM", "SIGHUP", "SIGALRM", "SIGCHLD"):
        if signal.getsignal(getattr(signal, name)) == signal.SIG_IGN:
            signal.signal(getattr(signal, name), signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_SETMASK, [])
    os.umask(0o022)
