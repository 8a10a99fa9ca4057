"""Nothing of the suite depends on what its process inherits: signals ignored by nohup or a runner, masks, a umask."""

import os
import signal


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
