"""The extensions of the site are imported as the site imports them; the site is built while other tests run."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "docs" / "_ext"))

NO_NETWORK = "import socket; socket.socket.connect = None; socket.getaddrinfo = None"
BUILD = f"{NO_NETWORK}; import sys; from sphinx.cmd.build import main; sys.exit(main(sys.argv[1:]))"
BUILDING = pytest.StashKey[tuple[subprocess.Popen[str], tempfile.TemporaryDirectory[str]]]()


def begin_building(config: pytest.Config) -> None:
    """Begin to build the site in a process of its own."""
    out = tempfile.TemporaryDirectory(prefix="orbits-site-")
    command = [sys.executable, "-c", BUILD, "-q", "-E", "-W", "--keep-going", "docs", out.name]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(
        command, cwd=ROOT, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    config.stash[BUILDING] = process, out


def pytest_collection_finish(session: pytest.Session) -> None:
    """Build the site where a test asks for it, on the core that the others leave idle.

    Where workers share the tests no core is idle, and each of them has collected this one: the one that runs it builds.
    """
    wanted = any("site" in getattr(item, "fixturenames", ()) for item in session.items)
    if wanted and not session.config.option.collectonly and not hasattr(session.config, "workerinput"):
        begin_building(session.config)


def pytest_unconfigure(config: pytest.Config) -> None:
    """End the building where nobody has waited for it, and remove what it made."""
    if BUILDING in config.stash:
        process, out = config.stash[BUILDING]
        process.kill()
        process.communicate()
        out.cleanup()


@pytest.fixture(scope="session")
def site(request: pytest.FixtureRequest) -> Path:
    """The folder of the site, built without a network; warnings are errors."""
    if BUILDING not in request.config.stash:
        begin_building(request.config)
    process, out = request.config.stash[BUILDING]
    _, errors = process.communicate(timeout=300)
    assert process.returncode == 0, errors
    return Path(out.name)
