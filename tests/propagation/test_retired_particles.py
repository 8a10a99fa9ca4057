"""A massless particle that cannot be stepped is retired alone: the run continues, reports it, and has NaN for it."""

from __future__ import annotations

import json
import pickle
import warnings
from contextlib import closing

import numpy as np
import pytest
from astropy import units as u
from typer.testing import CliRunner

import orbits
from orbits.archive import Archive, ArchiveWriter
from orbits.propagation import marchers
from orbits.propagation.marchers import bound
from orbits.trajectory.retired import moved

from ..coverings import at, cover

GAUSS, VERLET = orbits.Gauss(stages=8), orbits.StormerVerlet()
DT, END = 1 / 16, 6.0
FALLERS = {"near": 0.8, "far": 2.0}
"""Particles that are let go at these distances: they meet the star after pi (r/2)^1.5, at 0.79 and 3.14."""
ASIDE = 1e-6
"""Their velocity, sideways: they pass the star at 1e-12 of its distance, which no step resolves."""

pytestmark = pytest.mark.filterwarnings("ignore::orbits.errors.OrbitsWarning")


def system(fallers=FALLERS, orbiting=18):
    """A star, a planet, particles on circles, and between these some that fall into the star."""
    names, q, v = ["star", "planet"], [[0, 0, 0], [9, 0, 0]], [[0, 0, 0], [0, 1 / 3, 0]]
    angle, radius = np.linspace(0.1, 5.0, orbiting), np.linspace(2.5, 5.0, orbiting)
    for k in range(orbiting):
        c, s = np.cos(angle[k]), np.sin(angle[k])
        names.append(f"p{k}")
        q.append([radius[k] * c, radius[k] * s, 0.1 * s])
        v.append([-s / radius[k] ** 0.5, c / radius[k] ** 0.5, 0])
        if k == 4:
            for name, distance in fallers.items():
                names.append(name)
                q.append([0, 0, distance])
                v.append([0, ASIDE, 0])
    gm = [1.0, 1e-6] + [0.0] * (len(names) - 2)
    return orbits.System(names, gm=gm, q=q, v=v, units=orbits.DIMENSIONLESS)


def run_of(start, method=GAUSS, **options):
    known = {"dt": DT, "duration": END, "samples": 25, "check_step": False, "approaches": True, **options}
    return orbits.propagate(start, method, **known)


@pytest.fixture(scope="module")
def run():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", orbits.errors.OrbitsWarning)
        return run_of(system())


def bits_of_others(some):
    keep = [k for k, name in enumerate(some.names) if name not in FALLERS]
    return some.q.value[:, keep].tobytes(), some.v.value[:, keep].tobytes()


def test_a_run_lists_who_was_retired_when_where_and_why(run):
    assert run.retired.names == ("near", "far")
    near, far = run.retired
    assert 0 < near.step < far.step
    for one in run.retired:
        assert one.time.value == one.step * DT
        assert one.reason == "the stages did not converge"
        # The last state is the one before the meeting with the star: close to it, on its way there.
        assert 0 < one.q.value[2] < FALLERS[one.name]
        assert one.v.value[2] < 0
    assert run.retired["far"] is far
    assert "near" in repr(run.retired)
    assert "near" in run.retired._repr_html_()
    assert "2 retired" in repr(run)
    assert "near" in run._repr_html_()
    assert list(run.retired.to_table()["body"]) == ["near", "far"]
    with pytest.raises(orbits.errors.UnknownNameError):
        run.retired["p0"]


def test_a_run_without_any_says_nothing():
    some = run_of(system({}), duration=0.5, samples=3)
    assert len(some.retired) == 0
    assert "retired" not in repr(some)
    assert repr(some.retired) == "no retired particles"
    assert len(some.retired.to_table()) == 0


@cover(("threads", "samples"), [1, 2], [25, 4], strength=1)
def test_others_have_the_bits_of_a_run_without_the_retired(run, threads, samples):
    some = run_of(system(), threads=threads, samples=samples)
    alone = run_of(system({}), threads=3 - threads, samples=samples)
    assert len(some.retired) == 2
    assert bits_of_others(some) == bits_of_others(alone)
    if samples == 25:
        assert some.q.value.tobytes() == run.q.value.tobytes()


@cover(("method", "duration"), [GAUSS, VERLET], [END, -END], strength=1)
def test_one_that_fails_in_the_first_step_is_absent_from_the_first_sample_on(method, duration):
    start = system({"hit": 1e-150})
    some = run_of(start, method, duration=duration, samples=7)
    assert some.retired.names == ("hit",)
    assert some.retired[0].step == 0
    hit = start.names.index("hit")
    assert (some.q.value[0, hit] == start.values.q[hit]).all()
    assert np.isnan(some.q.value[1:, hit]).all()
    assert np.isnan(some.v.value[1:, hit]).all()
    assert bits_of_others(run_of(system({}), method, duration=duration, samples=7)) == tuple(
        np.delete(x.value, hit, axis=1).tobytes() for x in (some.q, some.v)
    )
    # It was nowhere, and came close to nobody.
    closest = some.closest_approaches()
    assert np.isinf(closest.distance.value[hit]).all()


def test_backwards_runs_list_negative_times():
    some = run_of(system(), duration=-END)
    assert some.retired.names == ("near", "far")
    assert all(one.time.value == -one.step * DT for one in some.retired)


def test_all_particles_may_be_retired():
    start = orbits.System(
        ["star", "a", "b"], gm=[1, 0, 0], q=[[0, 0, 0], [0, 0, 0.8], [0, 0.8, 0]], v=np.zeros((3, 3)),
        units=orbits.DIMENSIONLESS,
    )  # fmt: skip
    some = run_of(start)
    assert some.complete
    assert some.retired.names == ("a", "b")
    assert some[-1].names == ("star",)
    assert some.drift().energy.max_fraction == 0.0


def test_arrays_are_nan_and_states_leave_them_out_from_the_first_sample_afterwards(run):
    for one in run.retired:
        column, after = run.names.index(one.name), run.times > one.time.value
        assert after.any()
        assert not after.all()
        for x in (run.q.value, run.v.value):
            assert np.isnan(x[after, column]).all()
            assert np.isfinite(x[~after, column]).all()
        for k in range(len(run)):
            assert (one.name in run[k]) == (not after[k])
    others = np.delete(run.q.value, [run.names.index(name) for name in FALLERS], axis=1)
    assert np.isfinite(others).all()
    assert run[3:].retired.names == run.retired.names


def test_a_sample_at_the_moment_itself_has_the_last_state(run):
    near = run.retired["near"]
    some = run_of(system(), samples=[0.0, near.time.value, near.time.value + DT, END])
    column = some.names.index("near")
    assert (some.q.value[1, column] == near.q.value).all()
    assert (some.v.value[1, column] == near.v.value).all()
    assert np.isnan(some.q.value[2, column]).all()


@pytest.mark.parametrize("dense", [False, True])
def test_states_between_samples_follow_the_same_rule(run, dense):
    run = run_of(system(), dense=True) if dense else run  # from a state at which both are retired, among others
    near = run.retired["near"]
    times = [near.time.value - DT / 2, near.time.value, near.time.value + 1.1 * DT, END - DT]
    column = run.names.index("near")
    several = run.at(times)
    assert np.isfinite(several.q.value[:2, column]).all()
    assert np.isnan(several.q.value[2:, column]).all()
    assert "near" in run.at(times[0])
    assert "near" not in run.at(times[2])
    assert "far" in run.at(times[2])
    assert "far" not in run.at(times[3])
    assert (run.at(times[2])["p3"].q == several["p3"].q[2]).all()


def test_nan_of_others_is_no_state(run):
    q = run.q.value.copy()
    q[-1, run.names.index("p3")] = np.nan
    spoilt = run._with_samples(run.times, q, run.v.value)
    with pytest.raises(orbits.errors.InputError, match="p3"):
        spoilt[-1]


def test_a_warning_says_who_is_lost_and_an_error_keeps_the_run():
    with pytest.warns(orbits.errors.RetiredWarning, match=r"2 massless particles(?s:.*)near: t = (?s:.*)smaller dt"):
        run_of(system())
    with warnings.catch_warnings():
        warnings.simplefilter("error", orbits.errors.RetiredWarning)
        with pytest.raises(orbits.errors.RetiredWarning) as caught:
            run_of(system())
    assert caught.value.trajectory.complete
    assert len(caught.value.trajectory.retired) == 2


def same_retired(one, other):
    return one.to_records() == other.to_records()


def test_archives_and_pickles_keep_the_list(run, tmp_path):
    path = tmp_path / "run.h5"
    some = run_of(system(), archive=path)
    with closing(orbits.Trajectory.open(path)) as opened:
        assert same_retired(opened.retired, run.retired)
        assert opened.q.value.tobytes() == run.q.value.tobytes()
        assert "near" not in opened[-1]
    for each in (run, some, some[4:]):
        assert same_retired(pickle.loads(pickle.dumps(each)).retired, run.retired)
    Archive.open(path).verify()
    told = CliRunner().invoke(_app(), ["info", str(path)]).output
    assert "near" in told
    assert "did not converge" in told
    record = json.loads(CliRunner().invoke(_app(), ["info", str(path), "--json"]).output)
    assert record["retired"] == run.retired.to_records()


def _app():
    from orbits.cli import app

    return app


@pytest.mark.parametrize("after", at((1,), [1, 8, 20]))
def test_an_interrupted_run_goes_on_to_the_same_bits(run, tmp_path, after):
    path, seen = tmp_path / "run.h5", []
    cut = run_of(system(), archive=path, callback=lambda t, state: seen.append(state) or len(seen) == after)
    assert len(cut) == after
    assert ("near" in seen[-1]) == (cut.times[-1] <= run.retired["near"].time.value)
    done = orbits.resume(path)
    assert done.complete
    assert done.q.value.tobytes() == run.q.value.tobytes()
    assert same_retired(done.retired, run.retired)
    assert (done.closest_approaches().distance == run.closest_approaches().distance).all()


def without_list(path, method=GAUSS, samples=3):
    """Write an archive as earlier versions did: without retired particles in its checkpoint."""
    start = system()
    grid = orbits.time_grid.TimeGrid.of(start, DT, duration=END, samples=25)
    marcher = bound(start, method, grid.h)

    def checkpoint():
        return {name: array for name, array in marcher.checkpoint().items() if name != "retired"}

    writer = ArchiveWriter.create(
        path, system=start, integrator=orbits.integrators.describe(method), grid=grid, checkpoint=checkpoint(),
        provenance=marchers.provenance(),
    )  # fmt: skip
    states = []
    for step in grid.steps[:samples]:
        marcher.advance(int(step) - marcher.step)
        states.append(marcher.state())
    writer.commit(np.array([q for q, _ in states]), np.array([v for _, v in states]), checkpoint())
    writer.close()


def test_archives_of_earlier_versions_open_and_go_on_to_the_same_bits(run, tmp_path):
    path = tmp_path / "old.h5"
    without_list(path)
    opened = orbits.Trajectory.open(path)
    assert len(opened.retired) == 0
    assert "retired" not in opened.archive.checkpoint()
    opened.close()
    done = orbits.resume(path)
    assert done.complete
    assert done.q.value.tobytes() == run.q.value.tobytes()
    assert same_retired(done.retired, run.retired)
    done.close()
    again = orbits.Trajectory.open(path)
    assert same_retired(again.retired, run.retired)  # the file has room for the list by now
    again.close()


@pytest.mark.parametrize("method", [GAUSS, VERLET], ids=str)
def test_who_is_retired_meets_no_condition(method):
    start = system({"hit": 1e-150})
    far = run_of(start, method, stop=orbits.events.FartherThan(20.0))  # others stay within 14 of one another
    assert far.complete
    assert far.stopped is None
    assert far.retired.names == ("hit",)


def test_a_condition_in_the_same_block_still_ends_the_run(run):
    near = run.retired["near"]
    # A mate of p0 passes the mark that the undisturbed run shows a few steps after the retirement.
    gap = np.linalg.norm(run["p0"].q.value - run["planet"].q.value, axis=1)
    k = int(np.argmax(run.times > near.time.value)) + 1
    assert gap[k] > gap[0]
    some = run_of(system(), stop=orbits.events.FartherThan(gap[k], "p0", "planet"), samples=2)
    alone = run_of(system({}), stop=orbits.events.FartherThan(gap[k], "p0", "planet"), samples=2)
    assert some.stopped.time == alone.stopped.time
    assert some.retired.names == ("near",)
    assert "near" not in some.stopped.system


def test_tables_elements_and_drift_take_the_absence(run):
    near = run.retired["near"]
    column, after = run.names.index("near"), run.times > near.time.value
    elements = run.elements(primary="star")
    assert (np.isnan(elements["near"].a.value) == after).all()
    alone = run_of(system({})).elements(primary="star")
    assert (elements["p3"].a == alone["p3"].a).all()
    jacobi = run.elements(primary="jacobi")
    assert np.isfinite(jacobi["p17"].a.value).all()
    assert "nan" not in repr(elements)
    assert np.isfinite(run.drift().energy.max_fraction)
    assert np.isnan(run.to_table()["x"].value.reshape(len(run), -1)[after, column]).all()
    pytest.importorskip("pandas")
    assert np.isnan(run.to_pandas()["x"].to_numpy().reshape(len(run), -1)[after, column]).all()


def test_pictures_show_it_where_it_was_last(run):
    pytest.importorskip("matplotlib")
    from matplotlib import pyplot

    pyplot.close(run.plot())
    pyplot.close(run.plot(bodies=["star", "near"]))
    pyplot.close(run[-1].plot())


def test_jupiter_crossers_no_longer_end_the_run_of_all():
    giants = orbits.System.solar_system("2020-01-01", bodies=["Sun", "Jupiter", "Saturn", "Uranus", "Neptune"])
    rng, count = np.random.default_rng(1), 50
    angles = {key: rng.uniform(0, 2 * np.pi, count) * u.rad for key in ("Omega", "omega", "M")}
    start = giants.add(
        [f"c{k}" for k in range(count)], primary="Sun",
        a=rng.uniform(4, 12, count) * u.au, e=rng.uniform(0, 0.8, count), inc=rng.uniform(0, 0.3, count) * u.rad,
        **angles,
    )  # fmt: skip
    some = orbits.propagate(start, GAUSS, dt=60 * u.day, duration=300 * u.yr, samples=11, check_step=False)
    assert some.complete
    assert 0 < len(some.retired) < count
    assert some.retired[0].date is not None
    assert some.retired[0].date.scale == "tdb"
    assert len(some[-1]) == 55 - len(some.retired)
    kept = [k for k, name in enumerate(start.names) if name not in some.retired.names]
    alone = orbits.propagate(
        start.remove(*some.retired.names), GAUSS, dt=60 * u.day, duration=300 * u.yr, samples=11, check_step=False
    )
    assert alone.q.value.tobytes() == some.q.value[:, kept].tobytes()


def test_an_spk_file_has_the_others_and_who_is_retired_is_refused(tmp_path):
    start = orbits.System.solar_system("2020-01-01", bodies=["Sun", "Jupiter"]).add(
        ["falls", "stays"], primary="Sun", a=[5, 3] * u.au, e=[0.999999, 0.1], M=[3.0, 0.0] * u.rad
    )
    some = orbits.propagate(start, GAUSS, dt=40 * u.day, duration=10 * u.yr, samples=11, check_step=False)
    ids = {"falls": 2999998, "stays": 2999999}
    with pytest.raises(orbits.errors.InputError, match="'falls' was retired"):
        some.to_spk(tmp_path / "all.bsp", ids=ids)
    rest = some.to_spk(tmp_path / "others.bsp", ids=ids, bodies=["Sun", "Jupiter", "stays"], tolerance_km=1.0)
    assert set(rest.ids) == {"Sun", "Jupiter", "stays"}
    k = int(np.argmax(some.times > some.retired[0].time.value))
    assert "falls" in some[:k].to_spk(tmp_path / "before.bsp", ids=ids, tolerance_km=1.0).ids


def test_a_comparison_says_who_was_given_up():
    report = orbits.compare(system(orbiting=5), GAUSS, dt=DT, duration=END, samples=7, reference="converged")
    assert not report.ok
    assert "2 massless particles" in str(report)
    assert "lost near, far" in " ".join(str(report).split())  # the reference solution: nothing is compared with NaN


def test_the_part_of_a_step_at_the_end_is_looked_at_for_the_others_too():
    some = run_of(system({"near": 0.8, "slow": 5.0}), duration=END - DT / 3, samples=5)
    assert some.retired.names == ("near",)
    # What falls all the time is closest at the end, behind the last whole step.
    column = some.names.index("slow")
    last = np.linalg.norm(some.q.value[-1, column] - some.q.value[-1, 0])
    assert float(some.closest_approaches().distance.value[column, 0]) == pytest.approx(last, rel=1e-12)


@pytest.mark.parametrize("bodies", [["near"], ["near", "p3"], None], ids=str)
def test_a_force_on_the_retired_goes_with_them(bodies):
    start = system().with_forces(orbits.terms.Drag(rate=1e-6, bodies=bodies))
    rest = moved(start, start.values.q, start.values.v, 0.0, np.isin(start.names, ["near"]))
    assert "near" not in rest
    assert len(rest.forces) == (bodies != ["near"])


@pytest.mark.parametrize(
    ("options", "time"),
    [({}, np.pi), ({"dt": 20.0}, 0.0), ({"dt": 0.01, "duration": 3.1475}, 3.14)],
    ids=["without dt", "in the first step", "in the last part of a step"],
)
def test_a_particle_lost_in_a_step_that_the_run_does_not_take_whole_is_retired(options, time, tmp_path):
    """A star alone sets no step: two particles fall into it from 2 and 3, within the first one, which leads beyond the
    run; they had no place in the last samples, and no word was said.
    """
    q = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [4.0, 3.0, 0.0]]
    v = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.5, 0.0]]
    start = orbits.System(["star", "b", "far"], gm=[1, 0, 0], q=q, v=v, units=orbits.DIMENSIONLESS)
    options = {"duration": 3.5, "samples": 15, "check_step": False, "progress": False, **options}
    with pytest.warns(orbits.errors.RetiredWarning, match="b: t = "):
        run = orbits.propagate(start, archive=tmp_path / "run.h5", **options)
    assert np.isnan(run.q.value[-1, 1]).all()
    assert run.retired["b"].time.value == pytest.approx(time, abs=1e-6)
    run.close()
    stored = orbits.Trajectory.open(tmp_path / "run.h5")
    assert [one.name for one in stored.retired] == [one.name for one in run.retired]
    if "dt" not in options:
        assert len(run.retired) == 1
        with pytest.warns(orbits.errors.RetiredWarning):
            whole = orbits.propagate(start, **{**options, "duration": 14.0, "samples": 57})
        longer = orbits.resume(tmp_path / "run.h5", until=14.0, progress=False)
        assert np.array_equal(longer.q.value, whole.q.value, equal_nan=True)
        assert str(longer.retired) == str(whole.retired)


MERGE = orbits.events.Collision("a", "b", then=orbits.events.Merge())


@pytest.mark.parametrize(("closing", "changed"), [(0.0, 0), (0.5, 2)], ids=["none merged", "two merged"])
def test_an_archive_has_who_was_lost_at_the_end_of_a_run_that_seeks_mergers(closing, changed, tmp_path):
    # It falls into the star within the last part of a step. The planets touch before, or not at all.
    pair = {"a": {"a": 30.0, "gm": 1e-6, "radius": 0.5}, "b": {"a": 30.3, "gm": 1e-6, "radius": 0.5, "l": 0.1}}
    start = orbits.System.from_elements({"star": {"gm": 1.0, "radius": 1e-6}, **pair}, units=orbits.DIMENSIONLESS)
    q, v = start.values.q, start.values.v.copy()
    v[2] += closing * (q[1] - q[2])
    start = start.replaced(v=v).add("falls", q=q[0] + [-2.0, 0.0, 0.0], v=v[0], radius=0)
    options = {"dt": 0.01, "duration": 3.1475, "samples": 3, "check_step": False, "progress": False}
    with pytest.warns(orbits.errors.RetiredWarning, match="falls"):
        run = orbits.propagate(start, GAUSS, events=MERGE, archive=tmp_path / "run.h5", **options)
    assert len(run.changes) == changed
    known = str(run.retired)
    assert run.retired["falls"].time.value == pytest.approx(3.14, abs=1e-6)
    run.close()
    assert str(orbits.Trajectory.open(tmp_path / "run.h5").retired) == known
