"""The server of `orbits view`: for this machine alone, one page and its samples, and nothing else."""

from __future__ import annotations

import http.client
import json
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

import orbits
from orbits.cli import app
from orbits.viewing.server import ViewServer
from tests.view import runs


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("served") / "run.h5"
    runs.planets(path).close()
    return path


@pytest.fixture(scope="module")
def server(archive: Path) -> Iterator[ViewServer]:
    made = ViewServer(archive)
    thread = threading.Thread(target=made.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True)
    thread.start()
    yield made
    made.shutdown()
    made.server_close()
    thread.join(10)


def ask(server: ViewServer, path: str, **headers: str) -> http.client.HTTPResponse:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=60)
    connection.putrequest("GET", path, skip_host=True)
    for name, value in {"Host": f"127.0.0.1:{server.port}", **headers}.items():
        connection.putheader(name.replace("_", "-"), value)
    connection.endheaders()
    return connection.getresponse()


def test_it_listens_on_the_loopback_interface_alone(server: ViewServer) -> None:
    assert server.server_address[0] == "127.0.0.1"
    assert ask(server, "/").status == 200


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1", "127.0.0.1:1", "localhost.evil.example:80", ""])
def test_another_host_name_is_refused_so_that_no_site_can_rebind_its_name_to_this_machine(
    server: ViewServer, host: str
) -> None:
    answer = ask(server, "/", Host=host)
    assert answer.status == 403
    assert b"orbits-data" not in answer.read()


def test_the_page_of_another_site_cannot_read_samples(server: ViewServer) -> None:
    for path in ("/more?first=0", "/approaches", "/"):
        answer = ask(server, path, Sec_Fetch_Site="cross-site", Sec_Fetch_Mode="no-cors", Origin="http://evil.example")
        assert answer.status == 403
        assert answer.getheader("Access-Control-Allow-Origin") is None
    assert ask(server, "/", Sec_Fetch_Site="cross-site", Sec_Fetch_Mode="navigate").status == 200  # a link was followed


@pytest.mark.parametrize(
    "path", ["/../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "//etc/passwd", "/run.h5", "/view.css", "/more/.."]
)
def test_no_file_is_served(server: ViewServer, path: str) -> None:
    assert ask(server, path).status == 404


@pytest.mark.parametrize("first", ["", "-1", "x", "1e3", "9" * 30, "²"])
def test_what_is_no_number_of_a_sample_is_refused(server: ViewServer, first: str) -> None:
    from urllib.parse import quote

    assert ask(server, f"/more?first={quote(first)}").status == 400


def test_samples_are_those_from_the_asked_one_on(server: ViewServer) -> None:
    assert json.loads(ask(server, "/more?first=20").read())["times"]["shape"] == [6]
    for first in (26, 999999):  # nothing new yet
        answer = ask(server, f"/more?first={first}")
        assert answer.status == 200
        assert json.loads(answer.read())["times"]["shape"] == [0]


def test_a_page_may_not_be_framed_kept_or_sniffed(server: ViewServer) -> None:
    answer = ask(server, "/")
    assert "frame-ancestors 'none'" in (answer.getheader("Content-Security-Policy") or "")
    assert answer.getheader("Cache-Control") == "no-store"
    assert answer.getheader("X-Content-Type-Options") == "nosniff"


def test_other_methods_are_refused(server: ViewServer) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=60)
    connection.request("POST", "/more?first=0", body=b"x")
    assert connection.getresponse().status == 501


def test_an_archive_that_vanishes_is_said_to_the_page(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    runs.planets(path).close()
    made = ViewServer(path)
    thread = threading.Thread(target=made.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True)
    thread.start()
    try:
        path.unlink()
        answer = ask(made, "/more?first=0")
        assert answer.status == 409
        assert b"does not exist" in answer.read()
    finally:
        made.shutdown()
        made.server_close()


def test_a_run_without_samples_yet_is_waited_for(tmp_path: Path) -> None:
    path = tmp_path / "begun.h5"
    with pytest.raises(RuntimeError, match="at once"):
        runs.planets(path, callback=lambda time, system: (_ for _ in ()).throw(RuntimeError("at once")))
    with orbits.Archive.open(path) as begun:
        had = begun.committed
    made = ViewServer(path)
    try:
        assert ("waits for the first one" in made.page()) == (had == 0)
    finally:
        made.server_close()


def test_a_port_that_is_taken_is_said(archive: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        out = CliRunner().invoke(app, ["view", str(archive), "--port", str(port), "--no-browser"])
    assert out.exit_code == 2
    assert f"port {port} is taken by another program; give another one with --port" in out.output


@pytest.mark.parametrize("port", [-1, 70000])
def test_a_port_that_is_none_is_said(archive: Path, port: int) -> None:
    with pytest.raises(orbits.errors.InputError, match=f"port {port} cannot be used"):
        ViewServer(archive, port=port)


def test_a_file_that_is_no_archive_is_said(tmp_path: Path) -> None:
    out = CliRunner().invoke(app, ["view", str(tmp_path / "missing.h5"), "--no-browser"])
    assert out.exit_code == 2
    assert "does not exist; expected an archive" in out.output


def test_ctrl_c_is_its_end_in_words(archive: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    serve = ViewServer.serve_forever

    def interrupted(server: ViewServer, *given: float, **options: float) -> None:
        threading.Timer(0.05, os.kill, (os.getpid(), signal.SIGINT)).start()
        serve(server, *given, **options)

    monkeypatch.setattr(ViewServer, "serve_forever", interrupted)
    out = CliRunner().invoke(app, ["view", str(archive), "--no-browser"])
    assert out.exit_code == 0
    assert "is shown at http://127.0.0.1:" in out.output
    assert out.stdout.endswith("stopped\n")
    assert out.stderr == ""


@pytest.mark.nightly
def test_ctrl_c_ends_it_cleanly(archive: Path) -> None:
    command = [sys.executable, "-m", "orbits", "view", str(archive), "--no-browser"]
    running = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"}
    )
    assert running.stdout is not None
    assert "is shown at http://127.0.0.1:" in running.stdout.readline()
    running.send_signal(signal.SIGINT)
    out, err = running.communicate(timeout=60)
    assert running.returncode == 0
    assert out == "stopped\n"
    assert err == ""
