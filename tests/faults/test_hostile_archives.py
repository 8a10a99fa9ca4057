"""Archives made up by somebody who knows the format are refused in words: no bare exception, no hang, no other file.

An archive comes by mail as a table does: opening it must be safe.
"""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest

import orbits
from orbits.archive import Archive
from orbits.errors import ArchiveError, OrbitsError
from orbits.kernels.search.record import LEAST2, MATE, ROW, STATE, STEP, WHEN

from ..coverings import every
from . import hostile, small
from .alarm import at_most

SECONDS = 20.0  # a file takes 50 ms

NAN, INF = float("nan"), float("inf")


def times(values):
    return hostile.array("times", np.asarray(values, dtype=float))


CERTIFICATE = {"format": "orbits-certificate", "version": 1, "problem": "p", "method": "m", "dt": 1, "time_unit": "d"}
FINDING = {"name": "order", "measured": 2, "bound": 1, "unit": "", "holds": True, "declared": True, "needed": True}


def certificate(text):
    """Add a certificate to a run that has none."""

    def change(file):
        hostile.set_text(file, "certificate", text)
        names = json.loads(file.attrs["header_items"])
        hostile.set_text(file, "header_items", json.dumps(sorted({*names, "@certificate"})))
        hostile.reseal(file)

    return change


def one_passage(column, value):
    """Add a passage that says this to the list."""

    def change(array):
        counts = array.parent["passage_counts"]
        rows = array[:]
        rows[0] = 1.0
        rows[0, [ROW, MATE, STEP, WHEN]] = 0.0, 1.0, 2.0, 2.5
        rows[0, column] = value
        array[:] = rows
        counts[0] = 1

    return change


def filled(value):
    def change(dataset):
        dataset[...] = value

    return change


REFUSED = {
    # The step.
    "dt 0": hostile.attribute("@dt", 0.0),
    "dt nan": hostile.attribute("@dt", NAN),
    "dt inf": hostile.attribute("@dt", INF),
    "dt text": hostile.attribute("@dt", "one day"),
    "dt array": hostile.attribute("@dt", np.array([0.5, 0.5])),
    "dt integer": hostile.attribute("@dt", np.int64(1)),
    "dt backwards": hostile.attribute("@dt", -0.5),
    "dt tiny": hostile.attribute("@dt", 5e-324),
    "dt missing": hostile.without("@dt"),
    # The times.
    "times nan": hostile.some("times", 3, NAN),
    "times inf": hostile.some("times", -1, INF),
    "times all nan": hostile.some("times", slice(None), NAN),
    "times descending": times(np.linspace(60, 0, small.SAMPLES)),
    "times equal": times(np.zeros(small.SAMPLES)),
    "times before the start": times(np.linspace(-5, 55, small.SAMPLES)),
    "times too far": hostile.some("times", -1, 1e300),
    "times one too few": times(np.arange(small.SAMPLES - 1.0)),
    "times none": times([]),
    "times square": times(np.zeros((3, 3))),
    "times texts": hostile.array("times", np.array([b"a"] * small.SAMPLES)),
    "times missing": hostile.without("times"),
    "times a bomb": hostile.bomb("times"),
    "times a group": hostile.listed('["system"]'),
    # The method.
    "integrator parameters null": hostile.method(name="stormer-verlet", parameters=None),
    "integrator parameters a list": hostile.method(name="gauss", parameters=[8]),
    "integrator parameters a text": hostile.method(name="gauss", parameters="stages"),
    "integrator parameters a number": hostile.method(name="gauss", parameters=8),
    "integrator other parameters": hostile.method(name="gauss", parameters={"x": 1}),
    "integrator stages null": hostile.method(name="gauss", parameters={"stages": None}),
    "integrator stages a list": hostile.method(name="gauss", parameters={"stages": [8]}),
    "integrator stages huge": hostile.method(name="gauss", parameters={"stages": 10**30}),
    "integrator stages nested": hostile.method(name="gauss", parameters={"stages": {"name": "gauss"}}),
    "integrator base a number": hostile.method(name="composition", parameters={"base": 7, "order": 6}),
    "integrator base a list": hostile.method(name="composition", parameters={"base": [], "order": 6}),
    "integrator order huge": hostile.method(
        name="composition", parameters={"base": {"name": "stormer-verlet", "parameters": {}}, "order": 10**9}
    ),
    "integrator order a list": hostile.method(
        name="composition", parameters={"base": {"name": "stormer-verlet", "parameters": {}}, "order": [2]}
    ),
    "integrator without name": hostile.method(parameters={}),
    "integrator name null": hostile.method(name=None, parameters={}),
    "integrator name a list": hostile.method(name=["gauss"], parameters={}),
    "integrator unknown": hostile.method(name="gaus\x00s", parameters={}),
    "integrator a list": hostile.attribute("@integrator", "[]"),
    "integrator no JSON": hostile.attribute("@integrator", "gauss"),
    "integrator deep": hostile.attribute("@integrator", "[" * 30_000),
    "integrator deeply nested": hostile.attribute(
        "@integrator", '{"name":"composition","parameters":{"base":' * 400 + "1" + "}}" * 400
    ),
    # The certificate.
    "certificate no JSON": certificate("holds"),
    "certificate a list": certificate("[]"),
    "certificate a number": certificate("1"),
    "certificate empty": certificate("{}"),
    "certificate findings null": certificate(json.dumps({**CERTIFICATE, "findings": None})),
    "certificate findings a text": certificate(json.dumps({**CERTIFICATE, "findings": "order"})),
    "certificate finding a number": certificate(json.dumps({**CERTIFICATE, "findings": [1]})),
    "certificate finding unknown": certificate(json.dumps({**CERTIFICATE, "findings": [{**FINDING, "x": 1}]})),
    "certificate figure a text": certificate(json.dumps({**CERTIFICATE, "findings": [{**FINDING, "bound": "one"}]})),
    "certificate figure a list": certificate(json.dumps({**CERTIFICATE, "findings": [{**FINDING, "measured": []}]})),
    "certificate name a number": certificate(json.dumps({**CERTIFICATE, "findings": [{**FINDING, "name": 3}]})),
    "certificate deep": certificate("[" * 30_000),
    # The system.
    "gm nan": hostile.some("system/gm", 0, NAN),
    "gm negative": hostile.some("system/gm", 0, -1.0),
    "gm none": hostile.some("system/gm", slice(None), 0.0),
    "gm one too few": hostile.array("system/gm", np.ones(4)),
    "q inf": hostile.some("system/q", (0, 0), INF),
    "q flat": hostile.array("system/q", np.zeros(15)),
    "q at one point": hostile.some("system/q", slice(None), 0.0),
    "v nan": hostile.some("system/v", (0, 0), NAN),
    "radii negative": hostile.some("system/radii", 0, -1.0),
    "names numbers": hostile.array("system/names", np.arange(5.0)),
    "names twice": hostile.array("system/names", np.array([b"Sun"] * 5)),
    "names empty": hostile.array("system/names", np.array([b""] * 5)),
    "softening nan": hostile.attribute("system@softening", NAN),
    "softening negative": hostile.attribute("system@softening", -1.0),
    "softening text": hostile.attribute("system@softening", "none"),
    "epoch nan": hostile.attribute("system@epoch_jd1", NAN),
    "epoch huge": hostile.attribute("system@epoch_jd1", 1e300),
    "epoch text": hostile.attribute("system@epoch_jd2", "2022"),
    "epoch in part": hostile.without("system@epoch_jd2"),
    # The units.
    "units no JSON": hostile.attribute("units@definition", "SI"),
    "units a list": hostile.attribute("units@definition", "[1, 2]"),
    "units G null": hostile.units(G=None),
    "units G text": hostile.units(G="six"),
    "units G nan": hostile.units(G=NAN),
    "units G zero": hostile.units(G=0.0),
    "units length null": hostile.units(length=None),
    "units length a mass": hostile.units(
        length={"name": "kg", "written": [1.0, [["kg", 1.0]]], "base units": [1.0, [["kg", 1.0]]]}
    ),
    "units power a text": hostile.units(
        length={"name": "m", "written": [1.0, [["m", "one"]]], "base units": [1.0, [["m", "one"]]]}
    ),
    "units of nothing": hostile.units(
        length={"name": "x", "written": [0.0, [["m", 1.0]]], "base units": [0.0, [["m", 1.0]]]}
    ),
    "units endless": hostile.units(
        length={"name": "m" * 50_000, "written": [1.0, [["m", 1.0]]], "base units": [1.0, [["m", 1.0]]]}
    ),
    # The list of items, and links out of the file.
    "items no JSON": hostile.listed("times"),
    "items a number": hostile.listed("7"),
    "items numbers": hostile.listed("[1, 2]"),
    "items none": hostile.listed("[]"),
    "items out of the file": hostile.listed('["../../etc/passwd"]'),
    "times a soft link": hostile.linked("times", h5py.SoftLink("/system/gm")),
    "times a link to itself": hostile.linked("times", h5py.SoftLink("/times")),
    "times an external link": hostile.linked("times", h5py.ExternalLink("other.h5", "/times")),
    "q an external link": hostile.linked("q", h5py.ExternalLink("other.h5", "/q")),
    "q a pipe": hostile.linked("q", h5py.ExternalLink("pipe", "/q")),
    "system an external link": hostile.linked("system", h5py.ExternalLink("other.h5", "/system")),
    "checkpoints an external link": hostile.linked("checkpoints", h5py.ExternalLink("other.h5", "/checkpoints")),
    "q in another file": hostile.elsewhere("q", "/etc/hostname"),
    "times in another file": hostile.elsewhere("times", "/etc/hostname"),
    "q a view": hostile.virtual("q"),
    # Checkpoints.
    "checkpoint of strings": hostile.checkpoint("q", np.array([b"text"] * 8)),
    "checkpoint of texts": hostile.checkpoint("q", ["a", "b"]),
    "checkpoint a bomb": hostile.bomb("checkpoints/0/q"),
}

NOT_RESUMED = {
    "checkpoint empty": hostile.checkpoint("q", np.zeros(0)),
    "checkpoint of integers": hostile.checkpoint("q", np.zeros(16, dtype=np.int64)),
    "checkpoint of another shape": hostile.checkpoint("q", np.zeros((2, 2))),
    "checkpoint without q": hostile.checkpoint("q", None),
    "checkpoint without counts": hostile.checkpoint("counts", None),
    "checkpoint with more": hostile.checkpoint("more", np.zeros(3)),
    "checkpoint counts flat": hostile.checkpoint("counts", np.int64(3)),
    "checkpoint counts of floats": hostile.checkpoint("counts", np.array([NAN, 0.0, 0.0])),
    "checkpoint steps negative": hostile.checkpoint("counts", filled(-5)),
    "passages more than there are": hostile.checkpoint("passage_counts", filled(10**6)),
    "passages fewer than none": hostile.checkpoint("passage_counts", filled(-2)),
    "passage far beyond the run": hostile.checkpoint("passages", one_passage(STEP, 1e15)),
    "passage before the run": hostile.checkpoint("passages", one_passage(STEP, -5.0)),
    "passage at another time than its step": hostile.checkpoint("passages", one_passage(WHEN, 77.0)),
    "passage at no distance": hostile.checkpoint("passages", one_passage(LEAST2, -1.0)),
    "passage of no body": hostile.checkpoint("passages", one_passage(ROW, 1e6)),
    "passage with half a body": hostile.checkpoint("passages", one_passage(MATE, 0.5)),
    "passage of no number": hostile.checkpoint("passages", one_passage(STATE, NAN)),
    "checkpoint steps huge": hostile.checkpoint("counts", filled(2**62)),
    "checkpoint steps too few": hostile.checkpoint("counts", filled(0)),
    "checkpoint nan": hostile.checkpoint("q", filled(NAN)),
    "checkpoint inf": hostile.checkpoint("particle_v", filled(INF)),
    "provenance other": hostile.attribute("provenance@kernel_sources", "0"),
}


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("hostile")
    small.straight()
    small.finished(folder / "other.h5")
    os.mkfifo(folder / "pipe")
    return small.interrupted(folder / "run.h5")


def uses(run: orbits.Trajectory) -> None:
    """What a person does with an archive that opens."""
    repr(run), run._repr_html_(), run.q, run[-1], run["Sun"], run.at(run.times[-1] / 3)
    run.energy(), run.drift(), str(run.closest_approaches()), run.unresolved(), run.elements(primary="Sun")


def refusals(path: Path) -> list[OrbitsError]:
    """Use an archive in every way, and return the errors. Raises what is none of ours, and `Hang`."""
    found = []

    def go_on(path: Path, **options: object) -> None:
        copy = path.with_name("copy.h5")
        shutil.copy(path, copy)
        orbits.resume(copy, progress=False, threads=1, **options).close()

    for use in (
        lambda: Archive.open(path).close(),
        lambda: Archive.open(path, salvage=True).close(),
        lambda: uses(orbits.Trajectory.open(path)),
        lambda: go_on(path),
        lambda: go_on(path, until=small.LONGER),
    ):
        try:
            with at_most(SECONDS):
                use()
        except OrbitsError as error:
            found.append(error)
    return found


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", every(8, REFUSED))
def test_an_archive_that_no_run_writes_is_refused_when_it_is_opened(kind, original):
    path = hostile.made(original, original.with_name("hostile.h5"), REFUSED[kind])
    errors = refusals(path)
    # By the way in of persons and by resume; samples may be read where only the method or the certificate is wrong.
    assert len(errors) >= 3
    for error in errors:
        assert isinstance(error, ArchiveError)
        assert str(original.parent) in str(error)
        assert len(str(error)) < 1000


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", every(8, NOT_RESUMED))
def test_a_checkpoint_that_no_run_writes_is_refused_by_resume(kind, original):
    path = hostile.made(original, original.with_name("hostile.h5"), NOT_RESUMED[kind])
    with at_most(SECONDS), pytest.raises(OrbitsError) as caught:
        orbits.resume(path, progress=False, threads=1)
    assert len(str(caught.value)) < 1000
    assert all(isinstance(error, OrbitsError) for error in refusals(path))


def test_the_tools_of_these_tests_change_nothing_but_what_they_say(original):
    def change(file):
        hostile.reseal(file)
        hostile.recommit(file)

    path = hostile.made(original, original.with_name("hostile.h5"), change)
    assert small.is_part_of_the_run(orbits.Trajectory.open(path))
    assert small.is_part_of_the_run(orbits.resume(path, progress=False))
