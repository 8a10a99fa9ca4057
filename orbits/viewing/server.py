"""The server of `orbits view`: one page and its further samples, for this machine alone.

It listens on the loopback interface, answers three paths, and reads no file but the archive. A request must name this
machine as its host, so that a page of another site cannot reach it under a name of its own (DNS rebinding), and must
not come from another site; there are no headers that would let one read the answers.
"""

from __future__ import annotations

import errno
import json
import threading
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from os import PathLike
from typing import Any
from urllib.parse import parse_qs, urlsplit

from orbits.errors import InputError, OrbitsError
from orbits.propagation import Trajectory
from orbits.viewing.data import LIMIT, ViewData
from orbits.viewing.page import POLICY, page

LOOPBACK = "127.0.0.1"

WAITING = """\
<!DOCTYPE html><html lang="en"><meta charset="utf-8"><meta http-equiv="refresh" content="2"><title>orbits</title>
<body style="font: 16px system-ui, sans-serif; margin: 20vh auto; max-width: 30em; padding: 0 1em; color: #8a93a6;
background: #0b0e14">The run has no samples yet. This page waits for the first one.</body></html>
"""


class ViewServer(ThreadingHTTPServer):
    """Serves the view of the run in an archive, complete or growing, at `url` until `shutdown`.

    path : of the archive; port : 0 for a free one; limit : as in `ViewData`
    Raises InputError for a port that is taken, or may not be used, and what `Trajectory.open` raises.
    """

    daemon_threads = True

    def __init__(self, path: str | PathLike[str], *, port: int = 0, limit: int = LIMIT) -> None:
        self.path, self._limit = path, limit
        self._known: ViewData | None = None
        self._approaches: tuple[int, dict[str, Any] | None] | None = None
        self._busy = threading.Lock()
        Trajectory.open(path).close()
        try:
            super().__init__((LOOPBACK, port), _Handler)
        except (OSError, OverflowError) as error:
            raise InputError(_refused(port, error)) from error

    @property
    def port(self) -> int:
        """The port that it listens on."""
        return int(self.server_address[1])

    @property
    def url(self) -> str:
        """The address of the page."""
        return f"http://{LOOPBACK}:{self.port}/"

    def page(self) -> str:
        """Return the page of the run as it is now. Raises what reading the archive raises."""
        with self._busy, _opened(self.path) as run:
            if not len(run):
                return WAITING
            self._known = ViewData(run, limit=self._limit)
            return page(self._known.header(run), self._known.chunk(run), follow=True)

    def more(self, first: int) -> dict[str, Any]:
        """Return the samples from `first` on. Raises what reading the archive raises."""
        with self._busy, _opened(self.path) as run:
            return self._data(run).chunk(run, first)

    def approaches(self) -> dict[str, Any] | None:
        """Return the closest approaches of a run that is complete or was ended, None for one that grows.

        They are computed once for so many samples.
        """
        with self._busy, _opened(self.path) as run:
            if self._approaches is None or self._approaches[0] != len(run):
                self._approaches = len(run), self._data(run).approaches(run)
            return self._approaches[1]

    def _data(self, run: Trajectory) -> ViewData:
        if self._known is None:
            self._known = ViewData(run, limit=self._limit)
        return self._known


class _opened:  # noqa: N801
    """A run that is open for as long as a request takes."""

    def __init__(self, path: str | PathLike[str]) -> None:
        self._run = Trajectory.open(path)

    def __enter__(self) -> Trajectory:
        return self._run

    def __exit__(self, *exception: object) -> None:
        self._run.close()


class _Handler(BaseHTTPRequestHandler):
    server: ViewServer
    server_version, sys_version = "orbits", ""
    timeout = 30

    def do_GET(self) -> None:
        """Answer "/" with the page, "/more?first=N" and "/approaches" with JSON, everything else with an error."""
        port = self.server.port
        if self.headers.get("Host") not in (f"{LOOPBACK}:{port}", f"localhost:{port}"):
            self._answer(HTTPStatus.FORBIDDEN, "this server answers only to its own address, http://127.0.0.1.\n")
            return
        if self._from_elsewhere():
            self._answer(HTTPStatus.FORBIDDEN, "this server does not answer to other sites.\n")
            return
        asked = urlsplit(self.path)
        try:
            if asked.path == "/":
                self._answer(HTTPStatus.OK, self.server.page(), "text/html; charset=utf-8")
            elif asked.path == "/more":
                self._more(parse_qs(asked.query).get("first", [""])[0])
            elif asked.path == "/approaches":
                self._json(self.server.approaches())
            else:
                self._answer(HTTPStatus.NOT_FOUND, "there is nothing here; the view is at /\n")
        except OrbitsError as error:
            self._answer(HTTPStatus.CONFLICT, f"{error}\n")
        except Exception as error:
            what = f"{type(error).__name__}: {error}; this is a bug in orbits: please report it"
            self._answer(HTTPStatus.INTERNAL_SERVER_ERROR, f"{what}\n")

    def _more(self, first: str) -> None:
        if not (first.isascii() and first.isdigit() and len(first) < 10):
            self._answer(HTTPStatus.BAD_REQUEST, "expected the number of a sample, /more?first=10\n")
            return
        self._json(self.server.more(int(first)))

    def _json(self, found: dict[str, Any] | None) -> None:
        self._answer(HTTPStatus.OK, json.dumps(found, allow_nan=False), "application/json")

    def _from_elsewhere(self) -> bool:
        """Whether the request was made by the page of another site, other than by following a link to the view."""
        site, mode = self.headers.get("Sec-Fetch-Site"), self.headers.get("Sec-Fetch-Mode")
        return site in ("cross-site", "same-site") and not (mode == "navigate" and urlsplit(self.path).path == "/")

    def _answer(self, status: HTTPStatus, text: str, kind: str = "text/plain; charset=utf-8") -> None:
        body = text.encode("utf-8")
        headers = {
            "Content-Type": kind,
            "Content-Length": str(len(body)),
            "Cache-Control": "no-store",
            "Content-Security-Policy": f"{POLICY}; frame-ancestors 'none'",
            "Cross-Origin-Resource-Policy": "same-origin",
            "Referrer-Policy": "no-referrer",
            "X-Content-Type-Options": "nosniff",
        }
        try:
            self.send_response(status)
            for name, value in headers.items():
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(body)
        except ConnectionError:  # the reader closed the page
            self.close_connection = True

    def log_message(self, format: str, *args: Any) -> None:
        """Print nothing: the terminal is for messages to people."""


def _refused(port: int, error: Exception) -> str:
    if isinstance(error, OSError) and error.errno == errno.EADDRINUSE:
        return f"port {port} is taken by another program; give another one with --port, or none for a free one."
    if isinstance(error, OSError) and error.errno == errno.EACCES:
        return f"port {port} is not for this account; give one from 1024 on with --port, or none for a free one."
    return f"port {port} cannot be used ({error}); expected 1024 to 65535, or 0 for a free one."
