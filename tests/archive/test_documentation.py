"""The page on archives is correct: its code runs unchanged, and its table lists the contents of a file."""

from __future__ import annotations

import re
from pathlib import Path

import h5py
import numpy as np
import pytest
from astropy import units as u

import orbits

from ..problems import belt

PAGE = Path(__file__).parents[2] / "docs" / "archive.md"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> orbits.Trajectory:
    system = belt(3)
    path = tmp_path_factory.mktemp("documentation") / "run.h5"
    return orbits.propagate(system, orbits.Gauss(stages=4), dt=4, duration=100 * u.day, samples=6, archive=path)


def blocks() -> list[str]:
    return re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)


def test_the_code_runs_as_it_stands_and_reads_the_run(run, monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(Path(run.path).parent)
    making, reading, turning, keeping, checking = blocks()
    found: dict[str, object] = {}
    exec(reading, found)
    assert found["names"] == list(run.names)
    assert np.array_equal(found["t"], run.times)
    assert np.array_equal(found["q"], run.q.value)
    assert np.array_equal(found["v"], run.v.value)
    assert np.array_equal(found["gm"], run.system.gm.value)
    expected = '6 of 6 samples of 13 bodies by {"name": "gauss", "parameters": {"stages": 4}}, lengths in AU\n'
    assert capsys.readouterr().out == expected
    exec(checking, found)
    monkeypatch.chdir(tmp_path)
    for code in (making, turning, keeping):
        exec(code, found)
    assert capsys.readouterr().out.endswith("80 steps of 50 ... 50 d, states (81, 3, 3)\n")


def test_the_check_of_the_page_finds_a_flipped_bit(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    data = Path(run.path).read_bytes()
    for place in (run.q.value[0].tobytes(), run.v.value[-1].tobytes()):
        at = data.rindex(place)
        Path("run.h5").write_bytes(data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :])
        with pytest.raises(AssertionError):
            exec(blocks()[-1], {"h5py": h5py})


def test_everything_in_a_file_is_on_the_page_and_the_other_way_round(run):
    text = PAGE.read_text()
    steps = {"/steps", "/steps/t", "/steps/q", "/steps/v", "/steps/chunks"}  # of dense output alone
    table = [line for line in text.splitlines() if line.startswith("| `/")]
    listed = {name for line in table for name in re.findall(r"`(/[\w/]*)`", line)} - {"/"}
    with h5py.File(run.path) as file:
        assert file.attrs["orbits"] == b"1"
        present: set[str] = set()
        file.visit(lambda name: present.add(f"/{name}"))
        present = {name for name in present if not name.startswith("/checkpoints/") or name.count("/") == 2}
        rows = [line for line in text.splitlines() if line.startswith("| `")]
        words = set(re.findall(r"`(\w+)`", "\n".join(rows)))
        for name in ("/", "/system", "/units"):
            assert set(file[name].attrs) <= words
        for name in ("/chunks", "/commits"):
            assert set(file[name].dtype.names) <= words
        for name in ("times", "q", "v", "system/q", "system/gm"):
            assert file[name].attrs["unit"]
    assert present - listed == {"/checkpoints"}
    assert listed - present == {"/system/radii", *steps}
