"""Trajectories: samples with units and names, in memory or in a file, and what one asks of them."""

from __future__ import annotations

import pickle
import re
from pathlib import Path

import numpy as np
import pytest
from astropy import units as u
from astropy.time import Time

import orbits
from orbits import diagnostics, former_names
from orbits.archive import ArchiveWriter
from orbits.archive.samples import Samples
from orbits.errors import ArchiveError, InputError, OrbitsError, OutOfRangeError, UnknownNameError
from orbits.propagation import Trajectory
from orbits.results.approaches import Rows
from orbits.time_grid import TimeGrid

from ..problems import FIGURE_EIGHT

METHOD = orbits.Gauss(stages=4)
NAMES = ["Ceres", "Sun", "Vesta", "Jupiter", "Saturn"]
GM = [0.0, 1.0, 0.0, 1e-3, 3e-4]
SAMPLES = 9


def system() -> orbits.System:
    """Massive bodies neither first nor next to one another."""
    rng = np.random.default_rng(5)
    q, v = rng.normal(size=(2, len(NAMES), 3))
    units = orbits.UnitSystem("own", u.au, u.yr / (2 * np.pi), u.M_sun)
    return orbits.System(NAMES, np.multiply(GM, units.G), q, v, epoch="2022-08-09", units=units)


def floats() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    start = system().values
    rng = np.random.default_rng(6)
    q, v = (x + 0.01 * rng.normal(size=(SAMPLES, len(NAMES), 3)) for x in (start.q, start.v))
    q[0], v[0] = start.q, start.v
    return np.arange(SAMPLES) * 0.5, q, v


def in_memory() -> Trajectory:
    t, q, v = floats()
    return Trajectory(system(), t, q, v, step=0.125, integrator=METHOD)


def in_a_file(folder: Path, committed: int = SAMPLES) -> Trajectory:
    t, q, v = floats()
    with ArchiveWriter.create(
        folder / "run.h5", system=system(), integrator=orbits.integrators.describe(METHOD), grid=TimeGrid(0.125, t),
        checkpoint={"counts": np.zeros(3, dtype=np.int64)}, provenance={},
    ) as writer:  # fmt: skip
        writer.commit(q[:committed], v[:committed], {"counts": np.ones(3, dtype=np.int64)})
    return Trajectory.open(folder / "run.h5")


@pytest.fixture(params=["memory", "file"])
def run(request, tmp_path) -> Trajectory:
    return in_memory() if request.param == "memory" else in_a_file(tmp_path)


def test_samples_have_names_and_units(run):
    t, q, v = floats()
    units = run.system.units
    assert run.names == tuple(NAMES)
    assert len(run) == SAMPLES
    assert (run.q.unit, run.v.unit, run.t.unit) == (units.length, units.speed, units.time)
    assert np.array_equal(run.q.value, q)
    assert np.array_equal(run.v.value, v)
    assert np.array_equal(run.t.value, t)
    assert run.dt == 0.125 * units.time
    assert run.complete
    assert np.array_equal(run.q.to_value(u.km), u.Quantity(q, u.au).to_value(u.km))


def test_samples_cannot_be_changed_by_accident(run):
    with pytest.raises(ValueError, match="read-only"):
        run.q[0] = 0 * u.au
    with pytest.raises(ValueError, match="read-only"):
        run.v[...] *= 2
    for one in (run, pickle.loads(pickle.dumps(run))):
        with pytest.raises(ValueError, match="read-only"):
            one.times[...] *= 86400.0


def test_the_times_of_a_run_are_its_own():
    times, q, v = floats()
    run = Trajectory(system(), times, q, v, step=0.125, integrator=METHOD)
    times[...] = -1.0
    assert np.array_equal(run.times, floats()[0])


def test_epochs_count_from_the_systems(run):
    expected = Time("2022-08-09", scale="tdb") + floats()[0] * (u.yr / (2 * np.pi)).to(u.day)
    assert run.epochs.scale == "tdb"
    assert np.abs((run.epochs - expected).to_value(u.ns)).max() < 1
    without = Trajectory(run.system.replaced(epoch=None), *floats(), step=0.125, integrator=METHOD)
    with pytest.raises(OrbitsError, match="no epoch"):
        _ = without.epochs


def test_a_body_by_its_name(run):
    _, q, v = floats()
    path = run["Jupiter"]
    assert path.name == "Jupiter"
    assert np.array_equal(path.q.value, q[:, 3])
    assert np.array_equal(path.v.value, v[:, 3])
    assert path.q.unit == u.au
    with pytest.raises(UnknownNameError, match="Did you mean 'Jupiter'"):
        run["Jupitre"]
    assert all(item in run for item in ("Jupiter", "jupiter", run[0]))
    assert "Jupitre" not in run
    assert 3 not in run
    assert 3 not in run.elements("Sun")  # which has items by name only
    assert [name in run.elements("Sun") for name in ("Jupiter", "Sun")] == [True, False]  # the primary has no orbit


@pytest.mark.parametrize("k", [0, 3, -1, np.int64(-SAMPLES)])
def test_a_sample_by_its_number_is_a_system(run, k):
    t, q, v = floats()
    state = run[k]
    assert isinstance(state, orbits.System)
    assert np.array_equal(state.values.q, q[k])
    assert np.array_equal(state.values.v, v[k])
    assert state.names == run.names
    assert np.array_equal(state.values.gm, run.system.values.gm)
    assert abs((state.epoch - run.epochs[k]).to_value(u.ns)) < 1
    if k == 0:
        assert state == run.system
    assert t[0] == 0


def test_a_sample_that_is_not_there_is_refused(run):
    for k in (SAMPLES, -SAMPLES - 1):
        with pytest.raises(IndexError, match="sample"):
            run[k]
    for key in (1.5, None, True, [2]):
        with pytest.raises(InputError, match="expected a name"):
            run[key]
    assert len(list(run)) == SAMPLES


def test_conserved_quantities_are_those_of_the_massive_bodies_with_units(run):
    _, q, v = floats()
    system, G, units = run.system, run.system.units.G, run.system.units
    gm = system.values.gm
    for got, expected, unit in (
        (run.energy(), diagnostics.energy(gm, q, v) / G, units.energy),
        (run.linear_momentum(), diagnostics.linear_momentum(gm, v) / G, units.momentum),
        (run.angular_momentum(), diagnostics.angular_momentum(gm, q, v) / G, units.angular_momentum),
        (run.centre_of_mass(), diagnostics.centre_of_mass(gm, q), units.length),
    ):
        assert got.unit == unit
        assert np.array_equal(got.value, expected)
    assert run.energy()[0] == system.energy()
    assert np.array_equal(run.angular_momentum()[0], system.angular_momentum())
    # The Sun has the mass of one solar mass in these units, to what G is known to in them.
    assert abs(system.gm[1] / G - 1 * units.gm) < 1e-15 * units.gm


def test_a_softened_potential_enters_the_energy():
    t, q, v = floats()
    soft = system().replaced(softening=0.5)
    run = Trajectory(soft, t, q, v, step=0.125, integrator=METHOD)
    expected = diagnostics.energy(soft.values.gm, q, v, 0.5) / soft.units.G
    assert np.array_equal(run.energy().value, expected)
    assert not np.array_equal(run.energy(), in_memory().energy())


def test_whole_runs_are_reduced_block_by_block_reading_massive_bodies_only(tmp_path, monkeypatch):
    run = in_a_file(tmp_path)
    whole = in_memory()
    asked = []
    read = Samples._read

    def watched(self, samples, first, end):
        asked.append((len(samples), first, end))
        return read(self, samples, first, end)

    monkeypatch.setattr(Samples, "_read", watched)
    monkeypatch.setattr("orbits.trajectory.conservation.BLOCK_BYTES", 2 * 48 * len(NAMES))
    assert np.array_equal(run.energy(), whole.energy())
    assert np.array_equal(run.angular_momentum(), whole.angular_momentum())
    # Two samples at a time; from the Sun to Saturn, without Ceres.
    assert set(asked) == {(2, 1, 5), (1, 1, 5)}
    assert repr(run.drift()) == repr(whole.drift())


def test_q_of_a_file_is_not_read_until_it_is_used(tmp_path, monkeypatch):
    run = in_a_file(tmp_path)
    monkeypatch.setattr(Samples, "_read", None)
    _, q, _ = floats()
    assert np.array_equal(run.q[-1].value, q[-1])
    assert np.array_equal(run.q[2:4, 1].to_value(u.m), u.Quantity(q[2:4, 1], u.au).to_value(u.m))


@pytest.mark.parametrize("some", [slice(3, 4), slice(3, None), slice(None, 2, -1)])
def test_drift_is_measured_from_the_start_of_the_run_also_without_a_sample_there(run, some):
    """One sample, and several without the first: they are as far from the initial state as in the whole run."""
    part, gm = run[some], run.system.values.gm
    rows = np.arange(SAMPLES)[some]
    _, q, v = floats()
    energy, momentum = diagnostics.energy(gm, q, v), diagnostics.linear_momentum(gm, v)
    drift = part.drift()
    assert drift.energy.max_fraction == pytest.approx(np.abs(energy / energy[0] - 1)[rows].max(), rel=1e-14)
    assert drift.energy.scale == run.drift().energy.scale
    away = np.linalg.norm(momentum - momentum[0], axis=1)[rows]
    # Velocities stray by 1 %: differences keep 14 of their 16 digits.
    assert drift.linear_momentum.last_fraction * drift.linear_momentum.scale * run.system.units.G == pytest.approx(
        away[rows.argmax()], rel=1e-12
    )
    assert drift.centre_of_mass.max_fraction > 1e-3


def test_the_drift_at_the_end_is_that_of_the_latest_sample_in_whatever_order_they_are(run):
    want = run.drift()
    for order in (slice(None, None, -1), np.random.default_rng(1).permutation(len(run))):
        assert run._some(order).drift() == want
    assert want.energy.last_fraction > 0.0


def test_drift_is_measured_from_the_first_sample():
    t, q, v = floats()
    run = in_memory()
    drift = run.drift()
    gm = run.system.values.gm
    energy = diagnostics.energy(gm, q, v)
    # Division by G rounds each value once more, and the difference of two of them is compared.
    assert drift.energy.max_fraction == pytest.approx(np.abs(energy / energy[0] - 1).max(), rel=1e-14)
    angular = diagnostics.angular_momentum(gm, q, v)
    size = np.linalg.norm(angular[0])
    expected = np.linalg.norm(angular - angular[0], axis=1).max() / size
    assert drift.angular_momentum.max_fraction == pytest.approx(expected, rel=1e-14)
    still = Trajectory(run.system, t, np.repeat(q[:1], SAMPLES, 0), np.repeat(v[:1], SAMPLES, 0), step=1.0,
                       integrator=METHOD)  # fmt: skip
    assert still.drift().energy.max_ulps == still.drift().angular_momentum.max_ulps == 0.0
    assert re.search(r"angular momentum\s+0\.00e\+00", str(still.drift()))


def test_elements_of_all_samples_are_those_of_each_state(run):
    for options in ({"primary": "Sun"}, {"primary": "Sun", "frame": "icrf"}, {"primary": "barycentre"}):
        found = run.elements(**options)
        for k in (0, 4, SAMPLES - 1):
            alone = run[k].elements(**options)
            assert found.names == alone.names
            for key in alone.keys():  # noqa: SIM118 - no mapping
                if key != "T":
                    assert np.array_equal(getattr(found, key)[k], getattr(alone, key))
            # T counts from the epoch of the run, not from that of the sample: one more addition, one more rounding.
            later = alone.T + run.t[k]
            error = np.abs((found.T[k] - later) / np.maximum(np.abs(alone.T), run.t[k]))
            assert np.all(error <= 4 * 2.0**-53)
    assert found.a.shape == (SAMPLES, len(NAMES))
    with pytest.raises(InputError, match="choose the primary by primary="):
        run.elements()


def test_a_run_in_progress_shows_what_is_there(tmp_path):
    run = in_a_file(tmp_path, committed=4)
    assert (len(run), run.complete, run.q.shape) == (4, False, (4, len(NAMES), 3))
    assert run.times.tolist() == [0.0, 0.5, 1.0, 1.5]
    assert "incomplete" in repr(run)


@pytest.mark.parametrize("key", [7, -8, 10**400])
def test_an_index_beyond_the_end_is_an_index_error_in_words(key):
    """Whatever has a length: what was asked, how many there are, and what may be asked."""
    run = in_memory()[:2]
    listed = Rows(run, "Ceres", [], [])
    for sequence, said in (
        (run, "number of samples is 2"),
        (run.events, "number of events is 0"),
        (run.retired, "number of retired particles is 0"),
        (run.excursions, "number of excursions is 0"),
        (run.system, "number of bodies is 5"),
        (orbits.asteroids(3), "number of bodies is 3"),
        (listed, "number of passages is 0"),
    ):
        with pytest.raises(OutOfRangeError, match=f"{said}; expected .*an? "):
            sequence[key]
        for strange in (1.5, None, True, np.array([[1]])):
            with pytest.raises(InputError, match="expected "):
                sequence[strange]
    assert issubclass(OutOfRangeError, IndexError)  # by which Python ends loops over sequences


def test_a_run_without_samples_yet_is_empty_and_says_so(tmp_path):
    run = in_a_file(tmp_path, committed=0)
    assert (len(run), run.q.shape, run.energy().shape, run.angular_momentum().shape) == (0, (0, 5, 3), (0,), (0, 3))
    assert "no samples yet" in repr(run)
    with pytest.raises(InputError, match="no samples yet"):
        run.drift()
    with pytest.raises(IndexError):
        run[-1]


def test_a_method_that_is_not_known_is_refused_in_words_and_the_samples_stay_readable(tmp_path):
    path, (t, q, v) = tmp_path / "run.h5", floats()
    with ArchiveWriter.create(
        path, system=system(), integrator={"name": "from-the-future", "parameters": {}}, grid=TimeGrid(1.0, t),
        checkpoint={}, provenance={},
    ) as writer:  # fmt: skip
        writer.commit(q, v, {})
    with pytest.raises(ArchiveError, match=r"from-the-future.*orbits\.Archive\.open"):
        Trajectory.open(path)
    assert np.array_equal(orbits.Archive.open(path).q, q)


def test_shapes_that_do_not_fit_are_refused():
    t, q, v = floats()
    with pytest.raises(InputError, match="for these times and bodies"):
        Trajectory(system(), t[:-1], q, v, step=0.1, integrator=METHOD)
    with pytest.raises(InputError, match="for these times and bodies"):
        Trajectory(system(), t, q, v[:, :2], step=0.1, integrator=METHOD)


def test_a_closed_run_says_so(tmp_path):
    run = in_a_file(tmp_path)
    run.close()
    with pytest.raises(ArchiveError, match="was closed"):
        _ = run.q
    with pytest.raises(ArchiveError, match="was closed"):
        run.energy()
    assert run.names == tuple(NAMES)


def propagated(q, v, gm) -> Trajectory:
    names = [f"body {k}" for k in range(len(gm))]
    start = orbits.System(names, gm, q, v, units=orbits.DIMENSIONLESS)
    return orbits.propagate(start, METHOD, dt=0.01, duration=1.0, samples=11)


EIGHT = (FIGURE_EIGHT.values.q, FIGURE_EIGHT.values.v, FIGURE_EIGHT.values.gm)
FALL = ([[1.0, 2, 3], [-1, -2, -3]], np.zeros((2, 3)), [1.0, 1.0])


@pytest.mark.parametrize("start", [EIGHT, FALL], ids=["figure-eight", "fall from rest"])
def test_what_vanishes_by_cancellation_is_compared_with_the_size_of_its_terms(start):
    run = propagated(*start)
    drift = run.drift()
    gm, q, v = run.system.values.gm, run.q.value, run.v.value
    terms = np.sum(gm * np.linalg.norm(q, axis=2) * np.linalg.norm(v, axis=2), axis=1)
    expected = terms[0] or terms.max()
    assert drift.angular_momentum.scale == pytest.approx(expected, rel=1e-14)
    # Each of 100 steps rounds a few products of size 1: 1e-16 is reached.
    assert drift.angular_momentum.max_fraction < 5e-16
    assert drift.linear_momentum.max_fraction < 5e-16
    assert "inf" not in str(drift)


def test_a_picture_and_a_table_of_one_run_show_the_same_change():
    run = propagated(*EIGHT)
    (line,) = run.plot().axes[2].lines[:1]
    assert np.max(line.get_ydata()) == pytest.approx(max(run.drift().angular_momentum.max_fraction, 2.5e-17), rel=1e-12)


def test_the_drift_says_which_bodies_it_covers():
    one = propagated([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0.0, 0, 0], [0, 1, 0], [0, 0.7, 0]], [1.0, 0.0, 0.0])
    unseen = "this says nothing about the orbits of the 2 massless particles"
    assert str(one.drift()).endswith(f"of body 0 alone, which nothing perturbs; {unseen}")
    assert f"of Sun, Jupiter, Saturn only; {unseen}" in str(in_memory().drift())
    assert propagated(*FALL).drift().covers == "of body 0, body 1"


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"system": 3}, "system is 3"),
        ({"times": None}, "times is None"),
        ({"times": np.full(SAMPLES, np.nan)}, r"times\[0\] is nan"),
        ({"times": np.zeros((SAMPLES, 1))}, r"times has shape \(9, 1\)"),
        ({"times": 3.0}, r"times has shape \(\)"),
        ({"q": 3.0}, "q and v have shapes None and"),
        ({"integrator": None}, "integrator is None"),
    ],
)
def test_what_is_no_run_is_refused_in_words(changed, words):
    t, q, v = floats()
    given = {"system": system(), "times": t, "q": q, "v": v, "step": 0.125, "integrator": METHOD} | changed
    with pytest.raises(InputError, match=words):
        Trajectory(given.pop("system"), given.pop("times"), given.pop("q"), given.pop("v"), **given)


def test_the_span_of_a_run_is_that_of_run_at_and_of_samples_alone_that_of_theirs():
    run = orbits.propagate(orbits.System.solar_system(), dt="6 d", duration="-60 d", samples=[-48, -54], progress=False)
    assert run.span == (0.0, -60.0)
    assert run[:1].span == (-48.0, -48.0)
    assert run[::-1].span == (-48.0, -54.0)
    assert run[:0].span == (0.0, 0.0)


@pytest.mark.parametrize(
    ("name", "now"),
    [
        ("sample", r"run\[k\], a System"),
        ("reached", r"run\.span\[1\]"),
        ("last_time", r"run\.times\[-1\]"),
        ("obliquity", r"run\.rotation\.obliquity"),
        ("rotation_rate", r"run\.rotation\.rate"),
    ],
)
def test_a_former_name_is_answered_with_the_new_one(name, now):
    run = orbits.propagate(orbits.System.solar_system(), dt="6 d", duration="6 d", samples=2, progress=False)
    with pytest.raises(AttributeError, match=f"this Trajectory has no attribute '{name}': it is {now}"):
        getattr(run, name)
    with pytest.raises(AttributeError, match=r"no attribute 'nothing'\.$"):
        run.nothing  # noqa: B018
    assert name not in dir(run)


@pytest.mark.parametrize("name", former_names.INTERNAL["Trajectory"])
def test_the_error_of_a_former_internal_says_what_to_use(name):
    run = orbits.propagate(orbits.System.solar_system(), dt="6 d", duration="6 d", samples=2, progress=False)
    for owner in (run, orbits.Trajectory):
        with pytest.raises(AttributeError, match=f"'{name}', which is internal now: use (orbits|run)") as e:
            getattr(owner, name)
        for reader in re.findall(r"(?:run|Trajectory)\.(\w+)", str(e.value).split("use ", 1)[1]):
            assert hasattr(run, reader), reader
