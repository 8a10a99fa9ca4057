"""`orbits view`: serves the view of an archive until Ctrl-C, or writes its page."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path

from orbits.checks import positive_number
from orbits.errors import OrbitsWarning
from orbits.propagation import Trajectory
from orbits.viewing.browser import opened_in_browser
from orbits.viewing.server import ViewServer
from orbits.viewing.view import check_page, view


def write(file: Path, output: Path, *, limit: float) -> Path:
    """Write the page of an archive, and return its path; what is left out is said on standard error.

    Raises what `Trajectory.open` and `orbits.view` raise.
    """
    positive_number(limit, "--limit")
    check_page(output)
    run = Trajectory.open(file)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", OrbitsWarning)
            made = view(run, output, limit=limit)
    finally:
        run.close()
    if made.said:
        print(f"{made.said} --limit {2 * limit:g} shows more.", file=sys.stderr)
    return output


def serve(file: Path, *, port: int, browser: bool, limit: float) -> None:
    """Serve the view of an archive on this machine until Ctrl-C.

    Raises InputError for a port that is taken, and what `Trajectory.open` raises.
    """
    server = ViewServer(file, port=port, limit=int(positive_number(limit, "--limit") * 2**20))
    try:
        print(f"{file} is shown at {server.url}  (this machine alone; Ctrl-C ends it)", flush=True)
        if browser and not opened_in_browser(server.url):
            print("no browser could be opened here; open the address in one", file=sys.stderr)
        server.serve_forever(poll_interval=0.2)
    except KeyboardInterrupt:
        print("stopped")
    finally:
        server.server_close()
