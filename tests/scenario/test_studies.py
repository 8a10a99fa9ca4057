"""Studies: experiments that are run, judged, drawn and refused as scenarios are."""

import json
import os
import re
import runpy
import struct
import subprocess
import sys
from functools import partial
from itertools import pairwise
from pathlib import Path

import h5py
import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.errors import InputError, StorageError
from orbits.lagrangians.pendulum import pendulum
from orbits.scenario import Parts, Study, StudyResult, Table, bundled, load, perform
from orbits.scenario.certificates import certify_scenario
from orbits.scenario.command import changed

from ..coverings import each, first, only

STUDIES = [
    *("arenstorf", "didymos", "discrete_kepler", "figure_eight", "hyperion", "liouville", "mercury_spin"),
    *("outer_solar_system", "pendulum", "planetesimals", "pleiades"),
]


def study(**changes):
    settings = {
        "name": "small",
        "title": "A small study",
        "experiment": lambda say: StudyResult(checks=[orbits.scenarios.Check("it holds", True)]),
    }
    return Study(**{**settings, **changes})


def of(**result):
    return study(experiment=lambda say: StudyResult(**result))


def test_checks_and_tables_of_a_study_may_be_yielded(tmp_path):
    """They were gone when they were judged, and the study held."""
    check = orbits.scenarios.Check("pigs fly", False, "0 of 3")
    table = Table("Pigs", ["number", "flies"], ([k, "no"] for k in range(3)))
    outcome = perform(of(checks=(one for one in [check]), tables=(one for one in [table])), out=tmp_path)
    assert outcome.failures == ("pigs fly: 0 of 3",)
    (told,) = json.loads((tmp_path / "report.json").read_text())["tables"]
    assert told["rows"] == [[0, "no"], [1, "no"], [2, "no"]]


@pytest.mark.parametrize("name", only(["discrete_kepler"], STUDIES))
def test_each_bundled_study_gives_all_that_it_demands(name, tmp_path):
    scenario = load(name)
    outcome = perform(scenario, out=tmp_path)
    assert outcome.ok, outcome.failures
    assert outcome.result.tables
    assert len(outcome.checks) >= 6
    record = json.loads((tmp_path / "report.json").read_text())
    assert record["ok"]
    assert record["scenario"] == name
    assert {path.name for path in outcome.files} == {f"{name}.png", "report.json"}
    width, height = struct.unpack(">II", (tmp_path / f"{name}.png").read_bytes()[16:24])
    assert width >= 1300
    assert height >= 800


def test_a_study_that_was_interrupted_takes_over_its_parts_to_the_bit(tmp_path):
    computed, stops = [], [2]

    def experiment(say, dt, parts):
        def part(k):
            if k in stops:
                raise KeyboardInterrupt
            computed.append(k)
            return {"roots": np.sqrt(np.arange(5.0) + k), "k": k}

        found = [parts.get(f"part {k}", lambda k=k: part(k)) for k in range(4)]
        return StudyResult(record={"roots": [one["roots"] for one in found], "k": [int(one["k"]) for one in found]})

    def record():
        return json.loads((tmp_path / "report.json").read_text())["record"]

    one = study(experiment=experiment, dt=0.1, resumable=True)
    with pytest.raises(KeyboardInterrupt):
        perform(one, out=tmp_path)
    assert computed == [0, 1]
    assert len(list(tmp_path.glob("part-*.h5"))) == 2
    stops.clear()
    said = []
    perform(one, out=tmp_path, say=said.append)
    assert computed == [0, 1, 2, 3]
    assert said[:2] == [f"part {k}: taken over from the run that was interrupted" for k in range(2)]
    assert record()["roots"] == [np.sqrt(np.arange(5.0) + k).tolist() for k in range(4)]
    assert record()["k"] == [0, 1, 2, 3]
    assert not list(tmp_path.glob("part-*"))  # it is done: the next run is a new one

    stops.append(2)
    with pytest.raises(KeyboardInterrupt):
        perform(one, out=tmp_path)
    stops.clear()
    computed.clear()
    perform(changed(one, "0.2", None, None, None), out=tmp_path)
    assert computed == [0, 1, 2, 3]  # with other steps none of them is taken over


def test_parts_of_a_study_are_arrays_with_a_name_each_and_no_file_of_others_is_replaced(tmp_path):
    def twice(say, parts):
        return parts.get("a", lambda: {"x": 1.0}) and parts.get("a", lambda: {"x": 1.0})

    with pytest.raises(InputError, match="a part of that name already is there"):
        perform(study(experiment=twice, resumable=True), out=tmp_path)
    (tmp_path / "part-a.h5").write_text("mine")
    with pytest.raises(InputError, match="was not written by orbits"):
        perform(study(experiment=twice, resumable=True), out=tmp_path)
    with pytest.raises(InputError, match="arrays by name, in a dict"):
        perform(study(experiment=lambda say, parts: parts.get("b", lambda: 3.0), resumable=True), out=tmp_path)


def of_parts(folder, made_by=None, said=None):
    return Parts(folder, made_by or {"study": "small"}, (said if said is not None else []).append)


def damages():
    def cut(size):
        return lambda path: os.truncate(path, size)

    def zeros(path):
        path.write_bytes(bytes(path.stat().st_size))

    def scribble(path):
        """Change a number in an array, which HDF5 does not see without a checksum."""
        data = path.read_bytes()
        value = np.float64(1.75).tobytes()
        assert data.count(value) == 1
        path.write_bytes(data.replace(value, np.float64(1.875).tobytes()))

    def made_by(value):
        def write(path):
            with h5py.File(path, "r+", locking=False) as file:
                file.attrs["made_by"] = value

        return write

    def grouped(path):
        with h5py.File(path, "r+", locking=False) as file:
            file["a/b"] = 1.0

    return {
        "a third of it": cut(2000),
        "three bytes": cut(3),
        "nothing": cut(0),
        "zeros": zeros,
        "another number": scribble,
        "made_by is a number": made_by(3),
        "made_by is no JSON": made_by("{"),
        "made_by is bytes": made_by(np.void(b"\xff")),
        "a group": grouped,
    }


@pytest.mark.parametrize("damage", damages().values(), ids=damages().keys())
def test_a_damaged_part_is_computed_again(tmp_path, damage):
    of_parts(tmp_path).get("one", lambda: {"x": np.array([1.75, 3.0])})
    damage(tmp_path / "part-one.h5")
    said = []
    found = of_parts(tmp_path, said=said).get("one", lambda: {"x": np.array([5.0])})
    assert found["x"].tolist() == [5.0]
    assert said == ["one: part-one.h5 is damaged; it is computed again"]
    again = of_parts(tmp_path).get("one", lambda: pytest.fail("computed anew, though it is there"))
    assert again["x"].tolist() == [5.0]


def test_a_part_is_on_the_device_before_it_has_its_name(tmp_path, monkeypatch):
    calls = []
    for name in ("fsync", "replace"):
        real = getattr(os, name)
        monkeypatch.setattr(os, name, lambda *given, name=name, real=real: (calls.append(name), real(*given))[1])
    of_parts(tmp_path).get("one", lambda: {"x": 1.0})
    assert calls == ["fsync", "replace", "fsync"]  # the file, its name, the folder


def test_two_processes_of_a_study_do_not_disturb_each_other(tmp_path, monkeypatch):
    first, second = of_parts(tmp_path), of_parts(tmp_path)
    real = os.replace

    def other_meanwhile(unfinished, path):
        """The other process writes the same part before the first gives it its name."""
        monkeypatch.setattr(os, "replace", real)
        monkeypatch.setattr(os, "getpid", lambda: 1)  # runs
        assert second.get("a", lambda: {"x": 1.0})["x"] == 1.0
        monkeypatch.undo()
        real(unfinished, path)

    monkeypatch.setattr(os, "replace", other_meanwhile)
    assert first.get("a", lambda: {"x": 1.0})["x"] == 1.0
    first.get("b", lambda: {"x": 2.0})
    (tmp_path / "part-b.h5").unlink()
    second.get("b", lambda: {"x": 2.0})
    first.remove()
    assert [path.name for path in tmp_path.iterdir()] == ["part-b.h5"]  # of the second, which is not done
    assert second.get("c", lambda: {"x": 3.0})["x"] == 3.0
    second.remove()
    assert not list(tmp_path.iterdir())


def test_a_part_that_another_process_removes_while_it_is_looked_for_is_computed(tmp_path, monkeypatch):
    of_parts(tmp_path).get("a", lambda: {"x": 1.0})
    real = h5py.File

    def gone(path, *given, **more):
        Path(path).unlink(missing_ok=True)
        monkeypatch.undo()
        return real(path, *given, **more)

    monkeypatch.setattr(h5py, "File", gone)
    assert of_parts(tmp_path).get("a", lambda: {"x": 2.0})["x"] == 2.0


def test_no_unfinished_file_stays_after_a_failure_or_of_a_process_that_was_killed(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        with pytest.raises(StorageError, match="No space left"):
            of_parts(tmp_path).get("a", lambda: {"x": 1.0})
    assert not list(tmp_path.iterdir())
    ended = subprocess.Popen(["true"])
    ended.wait()
    for process in (ended.pid, os.getpid()):
        (tmp_path / f"part-a.{process}.unfinished").touch()
    parts = of_parts(tmp_path)
    (tmp_path / f"part-a.{os.getpid()}.unfinished").rename(tmp_path / "part-a.1.unfinished")
    parts.get("a", lambda: {"x": 1.0})
    parts.remove()
    assert [path.name for path in tmp_path.iterdir()] == ["part-a.1.unfinished"]  # its process runs


def test_a_part_that_is_taken_over_has_the_types_shapes_and_order_of_the_first(tmp_path):
    made = {
        "z": 3.0,
        "f": np.asfortranarray(np.arange(6.0).reshape(2, 3)),
        "a": np.zeros((0, 3)),
        "m": [True, False],
        "c": 1 + 2j,
        "i": np.arange(3, dtype=">i4"),
    }
    first = of_parts(tmp_path).get("a", lambda: made)
    again = of_parts(tmp_path).get("a", lambda: pytest.fail("it is there"))
    assert list(first) == list(again) == list(made)
    for key, value in first.items():
        other = again[key]
        assert type(value) is type(other) is np.ndarray
        assert (value.dtype, value.shape, value.strides) == (other.dtype, other.shape, other.strides)
        assert value.tobytes() == other.tobytes()


UNFIT = [
    ({"": 1.0}, "as ''; names of arrays"),
    ({"a/b": 1.0}, "as 'a/b'; names of arrays"),
    ({".": 1.0}, "as '.'; names of arrays"),
    ({"a\0": 1.0}, "names of arrays are printable"),
    ({3: 1.0}, "arrays by name, in a dict"),
    ({"x": ["a", "b"]}, r"\['a', 'b'\] as 'x'; expected numbers"),
    ({"x": None}, "None as 'x'; expected numbers"),
    ({"x": [[1], [2, 3]]}, "as 'x', of which no array can be made"),
    ({"x": 3 * u.km}, r"as 'x', but units are not kept; return numbers, as by `.to_value\(unit\)`"),
    ({"x": [[1, 2] * u.km]}, "as 'x', but units are not kept"),
    ({"x": np.ma.array([1, 2], mask=[0, 1])}, "as 'x', but masks are not kept"),
]


@each(("value", "message"), UNFIT)
def test_values_that_a_part_cannot_keep_are_refused_by_name(tmp_path, value, message):
    with pytest.raises(InputError, match=message):
        of_parts(tmp_path).get("a", lambda: value)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "message"), [(3, "must be text"), ("", "needs a letter"), ("x" * 400, "at most 200 characters; got 400")]
)
def test_names_of_parts_that_are_no_names_of_files_are_refused(tmp_path, name, message):
    with pytest.raises(InputError, match=message):
        of_parts(tmp_path).get(name, lambda: pytest.fail("computed before"))


def test_a_study_whose_file_is_not_known_is_not_resumable():
    class Experiment:
        def __call__(self, say, parts):
            return StudyResult()

    typed = {}
    exec("def typed(say, parts):\n    return None", typed)
    for unknown in (partial(of_parts, 3), Experiment(), typed["typed"]):
        with pytest.raises(InputError, match=r"resumable=True takes over parts only while the file .* is not known"):
            study(experiment=unknown, resumable=True)
        study(experiment=unknown)


def test_the_step_of_a_study_that_has_one_is_replaced():
    given = []

    def experiment(say, dt):
        given.append(dt)
        return StudyResult(checks=[orbits.scenarios.Check("it holds", True)])

    own = study(experiment=experiment, dt=orbits.Adaptive())
    for typed, expected in ((None, orbits.Adaptive()), ("transformed:0.2", orbits.TimeTransformed(step=0.2))):
        new = changed(own, typed, None, None, None)
        new.experiment(None, new.dt)
        assert given[-1] == expected
    with pytest.raises(InputError, match="takes no --samples; it takes --dt, --out, --json and --no-plot"):
        changed(own, "6", None, None, 3)
    with pytest.raises(InputError, match="takes no --dt; it takes --out"):
        changed(study(), "6", None, None, None)


@pytest.mark.nightly
def test_the_zoo_and_eccentric_orbits_are_run_in_transformed_time(monkeypatch, tmp_path):
    """Symplectic steps pass the studies made for adaptive ones: all that is judged of three orbits, and of e = 0.9."""
    zoo, eccentric = load("three_body_zoo"), load("eccentric")
    names = zoo.experiment.__globals__
    some = list(names["published"]())[:3]
    monkeypatch.setitem(names, "published", lambda: some)
    names = eccentric.experiment.__globals__
    monkeypatch.setitem(names, "ECCENTRICITIES", (0.9,))
    monkeypatch.setitem(names, "ROTATIONS", 2)
    for one in (zoo, eccentric):
        outcome = perform(changed(one, "transformed:0.3", None, None, None), out=tmp_path / one.name, plot=False)
        assert outcome.ok, outcome.failures
    assert "steps of 0.3 in transformed time" in (tmp_path / "three_body_zoo" / "report.json").read_text()


def test_a_method_that_does_not_converge_says_so_in_its_row(monkeypatch):
    names = load("pleiades").experiment.__globals__
    monkeypatch.setitem(names, "METHODS", [orbits.Gauss(stages=2)])
    monkeypatch.setitem(names, "STEPS", (300, 1200))
    result = names["experiment"](lambda text: None)
    assert "did not converge" in result.tables[0].rows[0]
    assert isinstance(result.tables[0].rows[1][3], float)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "pictures"),
    [("brouwer", {"brouwer.png"}), ("eccentric", {"eccentric.png"})],
)
def test_each_bundled_study_that_takes_long_gives_all_that_it_demands(name, pictures, tmp_path):
    outcome = perform(load(name), out=tmp_path)
    assert outcome.ok, outcome.failures
    assert {path.name for path in outcome.files} == {*pictures, "report.json"}


@pytest.mark.nightly
def test_the_flips_of_a_free_top_come_when_elliptic_functions_say(tmp_path, monkeypatch):
    scenario = load("euler_top")
    names = scenario.experiment.__globals__
    for name, value in (("REVOLUTIONS", 1000), ("FEWER", 100), ("STARTS", 1)):
        monkeypatch.setitem(names, name, value)
    outcome = perform(scenario, out=tmp_path)
    assert outcome.ok, outcome.failures
    assert len(outcome.checks) == 7
    assert {path.name for path in outcome.files} == {"euler_top.png", "euler_top_errors.png", "report.json"}
    # The rounding of 6,000 radians is 7e-13.
    assert outcome.result.tables[1].rows[0][-1] < 3e-12


@pytest.mark.nightly
def test_the_gaps_of_the_belt_begin_to_open_in_twenty_thousand_years(tmp_path, monkeypatch):
    """Eccentricities grow by 0.26 at 3:1, and by 0.09 at most between the resonances."""
    scenario = load("kirkwood_gaps").with_options(count=128)
    names = scenario.system.__globals__
    for name, value in (("INNER", 2.4), ("OUTER", 2.8)):
        monkeypatch.setitem(names, name, value)
    outcome = perform(scenario.with_changes(duration=20_000 * u.yr, samples=81), out=tmp_path)
    assert outcome.ok, outcome.failures
    a, begun, largest, _ = names["fates"](outcome.run)
    assert len(a) == 128
    grown = largest - begun
    assert grown[np.abs(a - 2.5) < 0.015].max() > 2.0 * grown[np.abs(a - 2.65) < 0.05].max()
    width, height = struct.unpack(">II", (tmp_path / "kirkwood_gaps.png").read_bytes()[16:24])
    assert min(width, height) >= 800


@pytest.mark.parametrize(("count", "failing"), [(100, 0), (2500, 2)])
def test_resonances_are_demanded_to_show_among_enough_particles_only(count, failing, tmp_path, monkeypatch):
    """In fifty years they do not: 2,500 particles fail what is demanded of longer runs, of 100 nothing is demanded."""
    scenario = load("kirkwood_gaps").with_options(count=count).with_changes(duration=50 * u.yr, samples=3)
    monkeypatch.setitem(scenario.checks.__globals__, "LONG_ENOUGH", 10)
    outcome = perform(scenario, out=tmp_path, plot=False)
    assert len(outcome.failures) == failing
    assert len(outcome.checks) == 2 + failing


def test_the_figure_eight_is_judged_by_closure_and_energy(tmp_path, monkeypatch):
    """With half of the steps Gauss(2) misses what others demand of it, and Gauss(4) the digits of the start."""
    scenario = load("figure_eight")
    monkeypatch.setitem(scenario.experiment.__globals__, "STEPS", 200)
    monkeypatch.setitem(scenario.experiment.__globals__, "PEER_LAPS", (1,))
    outcome = perform(scenario, out=tmp_path, plot=False)
    assert any("Gauss(stages=2) closes the eight in q" in failure for failure in outcome.failures)
    assert not any("Gauss(stages=8)" in failure for failure in outcome.failures)


@pytest.mark.nightly
def test_all_orbits_of_the_zoo_close_as_their_digits_do(tmp_path, monkeypatch):
    scenario = load("three_body_zoo")
    monkeypatch.setitem(scenario.experiment.__globals__, "DRAWN", 301)
    outcome = perform(scenario, out=tmp_path)
    assert outcome.ok, outcome.failures
    assert len(outcome.result.tables[0].rows) == 16
    assert len(outcome.checks) == 32
    assert (tmp_path / "three_body_zoo.png").exists()


def test_an_orbit_of_the_zoo_that_is_not_resolved_is_seen(tmp_path, monkeypatch):
    """Moth III closes to four digits of its closure with so few steps only; the figure eight needs no more."""
    names = load("three_body_zoo").experiment.__globals__
    chosen = [each for each in names["published"]() if each[0] in ("figure eight", "I.B.4 moth III")]
    monkeypatch.setitem(names, "published", lambda: chosen)
    result = names["experiment"](lambda text: None, orbits.Adaptive(1e-5))
    failed = [check.claim for check in result.checks if not check.ok]
    assert any(claim.startswith("I.B.4 moth III closes") for claim in failed), result.tables


def test_eccentric_orbits_are_judged_from_either_end(monkeypatch):
    names = load("eccentric").experiment.__globals__
    monkeypatch.setitem(names, "ROTATIONS", 1)
    monkeypatch.setitem(names, "ORBITS", 10)
    result = names["experiment"](lambda text: None, names["STEPS"])
    assert all(check.ok for check in result.checks), result.checks
    assert len(result.checks) == 20
    assert len(result.tables[0].rows) == 10
    result.figures["eccentric"]()
    monkeypatch.setitem(names, "METHOD", orbits.Gauss(stages=3))
    monkeypatch.setitem(names, "ECCENTRICITIES", (0.5,))
    few_stages = names["experiment"](lambda text: None, names["STEPS"]).checks
    assert [check.ok for check in few_stages if "fewer steps" in check.claim] == [False, False]


@pytest.mark.nightly
def test_the_map_of_a_resonance_has_chaos_and_libration_at_it_and_neither_far_from_it(tmp_path, monkeypatch):
    names = load("resonance_map").experiment.__globals__
    monkeypatch.setitem(names, "AXES", np.array([2.43, 2.48, 2.485, 2.49, 2.495, 2.5, 2.57]))
    monkeypatch.setitem(names, "ECCENTRICITIES", np.array([0.1, 0.2]))
    result = names["experiment"](lambda text: None, of_parts(tmp_path))
    assert all(check.ok for check in result.checks), result.checks
    assert np.shape(result.record["megno"]) == (2, 7)
    result.figures["resonance_map"]()


@pytest.mark.nightly
def test_brouwers_law_over_a_short_time_tells_rounded_coefficients_from_exact_ones(tmp_path, monkeypatch):
    scenario = load("brouwer")
    names = scenario.experiment.__globals__
    monkeypatch.setitem(names, "STARTS", 8)
    monkeypatch.setitem(names, "MARKS", names["MARKS"][:6])  # to 260 periods
    outcome = perform(scenario, out=tmp_path, plot=False)
    rows = outcome.result.tables[0].rows
    powers = {(row[0], row[1]): float(row[2].split()[0]) for row in rows}
    ends = {(row[0], row[1]): row[4] for row in rows}
    assert powers[names["EXACT"], "energy"] < 0.8  # over so short a time a walk has 0.05 to 0.65 (twelve seeds)
    assert ends[names["EXACT"], "energy"] < 3e-17  # 1e-17 was reached, with rounded coefficients 1.3e-14
    assert 0.8 < powers[names["ROUNDED"], "energy"] < 1.2
    assert powers[names["ROUNDED"], "phase"] > 1.75
    assert powers[names["EXACT"], "phase"] < powers[names["ROUNDED"], "phase"] - 0.2


@pytest.mark.nightly
def test_work_and_precision_are_swept_down_to_round_off_and_show_the_order(monkeypatch):
    names = load("work_precision").experiment.__globals__
    monkeypatch.setitem(names, "SECONDS", 0.05)
    problem = names["kepler"]()
    points = names["sweep"](problem, names["by_ours"](problem, orbits.Gauss(stages=4)))
    assert points[0][1] > 1e-4
    assert min(error for _, error, _, _ in points) < 1e-9
    assert 7 < names["measured"](points) < 9
    assert all(more[3] > less[3] for less, more in pairwise(points[:7]))  # shorter steps cost more forces
    labels = {method.label for method in names["methods"]()}
    assert {"Gauss(stages=8)", "StormerVerlet()", "RungeKutta4()"} <= labels
    assert any("order=10" in label for label in labels)


@pytest.mark.nightly
def test_the_controls_of_the_pictures_are_judged_to_fail(tmp_path):
    """Euler and RK4 stand in the checks as what they are; the variational methods beside them hold."""
    claims = [
        c.claim for name in ("pendulum", "liouville") for c in perform(load(name), out=tmp_path, plot=False).checks
    ]
    for words in ("spirals outwards", "loses energy", "explicit Euler does not keep", "RK4 does not keep"):
        assert any(words in claim for claim in claims)


@pytest.mark.parametrize("h", first(1, [0.9, 1.6]))
def test_the_pendulums_picture_leaves_no_island_empty(h):
    """Starts on lines and a grid do, all 200 of them: squares of 2.5 and 4 % of the width stay white."""
    names = load("pendulum").experiment.__globals__
    verlet, cells = orbits.StormerVerlet(), names["CELLS"]

    def largest(marched):
        empty = names["gaps"](names["visited"](*marched, h, "standard"), 1, names["top"](h, "standard"))
        return max((side / cells for *_, side in empty), default=0.0)

    assert largest(names["march_into_gaps"](verlet, h, "standard")) < names["EMPTY"]
    assert largest(names["march_all"](verlet, h, names["starts"](h, "standard"))) > 2 * names["EMPTY"]


@pytest.mark.nightly
def test_arenstorfs_orbits_close_with_8000_steps_of_gauss(tmp_path):
    outcome = perform(load("arenstorf"), out=tmp_path, plot=False)
    rows = [row for row in outcome.result.tables[0].rows if row[1:3] == ["Gauss(stages=8)", 8000]]
    assert [row[0] for row in rows] == [4, 3]
    assert all(max(row[3:5]) < 2e-10 for row in rows)  # 8e-11 in v, 5e-13 in q


def test_a_study_runs_as_a_program_of_its_own_and_refuses_what_it_cannot_take(tmp_path, monkeypatch, capsys):
    path = next(each.path for each in bundled() if each.name == "discrete_kepler")
    monkeypatch.chdir(tmp_path)

    def program(*options):
        monkeypatch.setattr(sys, "argv", [str(path), *options])
        with pytest.raises(SystemExit) as ended:
            runpy.run_path(str(path), run_name="__main__")
        return ended.value.code, capsys.readouterr()

    status, said = program("--no-plot", "--json")
    assert not status, said.err
    assert json.loads(said.out) == json.loads((tmp_path / "results" / "discrete_kepler" / "report.json").read_text())
    assert not list(tmp_path.rglob("*.png"))
    status, said = program("--dt", "1")
    assert status == 2
    assert "takes no --dt" in said.err


def test_figures_are_made_only_where_they_are_wanted(tmp_path):
    def draw():
        raise ZeroDivisionError("nothing to draw")

    assert perform(of(figures={"x": draw}), out=tmp_path, plot=False).ok
    outcome = perform(of(figures={"x": draw}), out=tmp_path)
    (failure,) = outcome.failures
    assert "test_studies.py, line" in failure
    assert "ZeroDivisionError: nothing to draw" in failure
    assert not json.loads((tmp_path / "report.json").read_text())["ok"]


def test_a_check_that_does_not_hold_is_a_failure(tmp_path):
    outcome = perform(of(checks=[orbits.scenarios.Check("pigs fly", np.bool_(False), "0 of 3")]), out=tmp_path)
    assert outcome.failures == ("pigs fly: 0 of 3",)


def test_numbers_of_numpy_go_into_the_report_and_what_is_not_finite_is_null(tmp_path):
    table = Table("numbers", ["n", "x"], [[np.int64(3), np.float64(0.5)], [4, float("nan")]])
    perform(of(tables=[table], record={"x": np.arange(3.0), "s": {"y": (1, "a")}}), out=tmp_path)
    text = (tmp_path / "report.json").read_text()
    assert '"x": [0.0, 1.0, 2.0]' in text  # a list of numbers on one line
    record = json.loads(text)
    assert record["tables"][0]["rows"] == [[3, 0.5], [4, None]]
    assert record["record"] == {"x": [0.0, 1.0, 2.0], "s": {"y": [1, "a"]}}


WRONG = [
    ({"name": "../x"}, "name"),
    ({"title": ""}, "title"),
    ({"experiment": 3}, "experiment must be a function"),
    ({"certifies": [pendulum]}, "certifies holds"),
    ({"certifies": [(pendulum, "gauss", 0.1)]}, "certifies holds"),
]


@pytest.mark.parametrize(("wrong", "message"), WRONG, ids=[str(w)[:40] for w, _ in WRONG])
def test_a_study_that_cannot_be_is_refused_where_it_is_made(wrong, message):
    with pytest.raises(InputError, match=message):
        study(**wrong)


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (study(experiment=lambda say: 3), "must return a StudyResult"),
        (of(checks=["fine"]), r"checks must be orbits\.scenarios\.Check values, got 'fine'"),
        (of(checks=None), r"checks must be orbits\.scenarios\.Check values, got None"),
        (of(tables=[["a", "b"]]), r"tables must be orbits\.scenarios\.Table values, got \['a', 'b'\]"),
        (of(figures=[len]), r"figures is \[<built-in function len>\]; expected functions by name"),
        (of(figures={"a": "a figure"}), "figures is {'a': 'a figure'}; expected functions by name"),
        (of(record=[1.0]), r"record is \[1\.0\]; expected values by name"),
        (of(record={"x": object()}), "hold text, numbers"),
        (of(record={"x": 1 * u.m}), r"hold text, numbers.*; got <Quantity 1\. m>"),
        (study(experiment=lambda say: 1 / 0), r"test_studies.py, line \d+: ZeroDivisionError"),
        (study(experiment=lambda say: Table("t", ["a"], [[1, 2]])), "a row of 2"),
    ],
)
def test_an_experiment_that_gives_something_else_is_refused_in_words(tmp_path, made, message):
    with pytest.raises(InputError, match=message):
        perform(made, out=tmp_path)


def test_a_report_of_somebody_else_is_seen_before_the_experiment(tmp_path):
    (tmp_path / "report.json").write_text("my notes")
    with pytest.raises(InputError, match="was not written by orbits"):
        perform(study(experiment=lambda say: pytest.fail("the experiment was begun")), out=tmp_path)


def test_a_picture_of_somebody_else_is_kept(tmp_path):
    from orbits.plotting import figure

    (tmp_path / "mine.png").write_text("my picture")
    outcome = perform(of(figures={"mine": lambda: figure(4, 3)}), out=tmp_path)
    assert "mine.png is there already" in outcome.failures[0]
    assert (tmp_path / "mine.png").read_text() == "my picture"


@pytest.mark.nightly
def test_certifying_a_study_takes_its_own_starts_and_one_method_on_each_problem_once(tmp_path):
    methods = [orbits.StormerVerlet(), orbits.methods.ExplicitEuler()]
    kepler = orbits.lagrangians.kepler
    made = study(certifies=[(kepler, method, 0.1, (1.0, 0.0), (0.0, 0.9)) for method in methods])
    outcome = certify_scenario(made, out=tmp_path)
    assert [each.control for each in outcome.certified] == [False, True]
    assert outcome.ok
    (one,) = certify_scenario(made, integrator=orbits.Gauss(stages=2), out=tmp_path).certified
    assert one.certificate.method == "Gauss(stages=2)"
    assert one.certificate.ok


def test_a_study_without_anything_to_certify_says_so(tmp_path):
    with pytest.raises(InputError, match="names nothing to certify"):
        certify_scenario(study(), out=tmp_path)


def test_the_study_of_the_docs_runs(tmp_path):
    text = (Path(__file__).parents[2] / "docs" / "scenarios.md").read_text(encoding="utf-8")
    (code,) = [block for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL) if "Study(" in block]
    (tmp_path / "bounded.py").write_text(code, encoding="utf-8")
    made = load(str(tmp_path / "bounded.py"))
    assert perform(made, out=tmp_path).ok
    assert certify_scenario(made, out=tmp_path).ok


@pytest.mark.slow
def test_apophis_from_its_observations_passes_where_jpl_has_it(tmp_path):
    outcome = perform(load("fit"), out=tmp_path)
    assert outcome.ok, outcome.failures
    assert {path.name for path in outcome.files} == {"fit.png", "residuals.png", "report.json"}


def test_pictures_of_an_earlier_study_do_not_stay_beside_the_report_of_another(tmp_path):
    from matplotlib.figure import Figure

    perform(of(figures={"first": Figure}), out=tmp_path)
    assert (tmp_path / "first.png").exists()
    perform(of(figures={"second": Figure}), out=tmp_path)
    assert [path.name for path in tmp_path.glob("*.png")] == ["second.png"]
