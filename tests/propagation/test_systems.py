"""Lists of systems: each as alone, all of them whatever becomes of one, and clear refusals."""

from __future__ import annotations

import signal
import threading
import warnings

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.errors import (
    ArchiveError,
    InputError,
    IntegrationError,
    Interrupted,
    StepWarning,
    SystemsError,
    UnknownNameError,
)
from orbits.events import CloserThan, FartherThan

GIANTS = [1.0, 9.5e-4, 2.9e-4, 4.4e-5]
"""Masses of the Sun, Jupiter, Saturn and Uranus, about."""


GM = 0.01720209895**2 * u.au**3 / u.day**2


def giants(k: int, *, particles: int = 0, **options) -> orbits.System:
    """Return a star with three planets, a different system for each k."""
    rng = np.random.default_rng(k)
    masses = np.array(GIANTS + [0.0] * particles)
    a = np.array([0.0, 5.2, 9.6, 19.2, *(2.2 + 0.3 * np.arange(particles))])
    angle = rng.uniform(0.0, 2.0 * np.pi, len(a))
    q = a[:, None] * np.stack([np.cos(angle), np.sin(angle), 0.02 * np.sin(3.0 * angle)], axis=1)
    speed = 0.01720209895 / np.sqrt(np.maximum(a, 1e-3)) * (1.0 + 0.03 * rng.standard_normal(len(a)))
    v = speed[:, None] * np.stack([-np.sin(angle), np.cos(angle), 0.02 * np.cos(angle)], axis=1)
    v[0] = 0.0
    names = [f"body {i}" for i in range(len(masses))]
    return orbits.System(
        **{"names": names, "gm": GM * masses, "q": q * u.au, "v": v * u.au / u.day, **options}
    )


def falling(k: int) -> orbits.System:
    """Return a system of the shape of `giants` in which two planets meet head-on."""
    system = giants(k)
    q, v = system.values.q.copy(), system.values.v.copy()
    q[3] = q[1] + [0.2, 0.0, 0.0]
    v[1] = v[3] = 0.0
    q[[1, 3], 2] = 5.0
    q[[1, 3], 1] = 0.0
    q[2] = [0.0, 30.0, 0.0]
    q[0] = [0.0, -60.0, 0.0]
    v[1], v[3] = [1e-4, 0.0, 0.0], [-1e-4, 0.0, 0.0]
    return orbits.System(system.names, gm=GM * np.array(GIANTS), q=q * u.au, v=v * u.au / u.day)


def same(run: orbits.Trajectory, other: orbits.Trajectory) -> bool:
    return run.q.value.tobytes() == other.q.value.tobytes() and run.v.value.tobytes() == other.v.value.tobytes()


@pytest.mark.parametrize("method", ["gauss", "stormer-verlet", "wisdom-holman"])
def test_each_system_of_a_list_has_the_bits_it_has_alone_whatever_the_threads_and_the_order(method):
    systems = [giants(k, particles=2) for k in range(3)]
    options = {"dt": "20 d", "duration": "20 yr", "samples": 7, "check_step": False}
    alone = [orbits.propagate(system, method, **options) for system in systems]
    runs = orbits.propagate(systems, method, threads=1, **options)
    assert [same(*pair) for pair in zip(runs, alone, strict=True)] == [True] * 3
    turned = orbits.propagate(tuple(systems[::-1]), method, threads=3, **options)
    assert [same(*pair) for pair in zip(turned, alone[::-1], strict=True)] == [True] * 3
    assert [run.system for run in runs] == systems


def test_steps_chosen_one_by_one_are_those_of_each_system():
    systems = [giants(k) for k in range(2)]
    runs = orbits.propagate(systems, duration="3 yr", samples=3)
    for run, system in zip(runs, systems, strict=True):
        assert same(run, orbits.propagate(system, duration="3 yr", samples=3))


def test_a_system_that_fails_is_named_and_the_others_are_complete():
    systems = [giants(0), falling(1), giants(2)]
    with pytest.raises(SystemsError, match=r"1 of 3 systems failed(.|\n)*systems\[1\]") as raised:
        orbits.propagate(systems, "gauss", dt="20 d", duration="40 yr", samples=21, check_step=False)
    error = raised.value
    assert list(error.failures) == [1]
    assert isinstance(error.failures[1], IntegrationError)
    assert error.bodies == error.failures[1].bodies
    assert [run.complete for run in error.trajectories] == [True, False, True]
    alone = orbits.propagate(systems[2], "gauss", dt="20 d", duration="40 yr", samples=21, check_step=False)
    assert same(error.trajectories[2], alone)


@pytest.mark.parametrize(
    ("systems", "message"),
    [
        ([], "is empty"),
        ("solar", "list of systems"),
        (5, "list of systems"),
        ([giants(0), "b"], r"systems\[1\] is 'b'"),
        ([giants(0), giants(1, particles=1)], r"systems\[1\] has massless particles: 1, but systems\[0\] 0"),
        (
            [giants(0), orbits.System(["a", "b", "c"], np.ones(3), np.eye(3), np.eye(3))],
            r"systems\[1\] has massive bodies: 3, but systems\[0\] 4",
        ),
    ],
)
def test_what_is_no_list_of_systems_of_equal_shape_is_refused_with_what_differs(systems, message):
    with pytest.raises(InputError, match=message):
        orbits.propagate(systems, dt="20 d", duration="1 yr")


def test_systems_in_other_units_are_refused():
    other = giants(1, units=orbits.UnitSystem("SI", u.m, u.s, u.kg))
    with pytest.raises(InputError, match=r"systems\[1\] has units m, s, kg, but systems\[0\] AU, d, solMass"):
        orbits.propagate([giants(0), other], dt="20 d", duration="1 yr")


def test_runs_to_a_date_from_different_epochs_are_refused():
    systems = [giants(0, epoch="2000-01-01"), giants(1, epoch="2001-01-01")]
    with pytest.raises(InputError, match="same samples"):
        orbits.propagate(systems, dt="20 d", until="2010-01-01")


def test_an_error_in_what_one_system_is_given_names_it_before_anything_runs(tmp_path):
    named = giants(0, names=["Sun", "Jupiter", "Saturn", "Uranus"])
    stop = CloserThan(0.1 * u.au, "Jupiter", "Saturn")
    with pytest.raises(UnknownNameError, match=r"systems\[1\]: .*Jupiter"):
        orbits.propagate([named, giants(1)], dt="20 d", duration="1 yr", stop=stop, archive=tmp_path / "runs")
    assert not list(tmp_path.rglob("*.h5"))


def test_warnings_name_their_systems_and_equal_ones_are_given_once():
    options = {"dt": "400 d", "duration": "60 yr", "samples": 3}
    with pytest.warns(StepWarning) as caught:
        orbits.propagate([giants(0), giants(0), giants(3)], "wisdom-holman", **options)
    with pytest.warns(StepWarning) as alone:
        orbits.propagate(giants(0), "wisdom-holman", **options)
    kinds = [[one.message.finding.kind for one in some] for some in (caught, alone)]
    assert kinds[0] == kinds[1]
    assert all(kinds[0])
    texts = [str(one.message) for one in caught if issubclass(one.category, StepWarning)]
    assert len(texts) == 2  # before the runs and after them
    for text in texts:
        assert text.startswith("all 3 systems (their texts differ in figures; this is that of systems[0]): ")
        assert "systems[2]" not in text
    assert caught[0].filename == __file__


def meeting_a_planet(k: int) -> orbits.System:
    """Return a system with a massless particle that comes to the first planet from 1.5 au within two years."""
    system = giants(k, particles=1)
    q, v = system.values.q.copy(), system.values.v.copy()
    q[4], v[4] = q[1] + [0.0, 0.0, 1.5], v[1] - [0.0, 0.0, 3e-3]
    return orbits.System(system.names, system.values.gm, q, v)


def test_a_warning_after_the_runs_that_is_an_error_does_not_lose_them():
    systems = [meeting_a_planet(0), meeting_a_planet(1)]
    with warnings.catch_warnings(), pytest.raises(StepWarning, match=r"systems\[0\]\): ") as raised:  # noqa: PT012
        warnings.simplefilter("error")
        orbits.propagate(systems, "wisdom-holman", dt="20 d", duration="2 yr", samples=3)
    assert [run.complete for run in raised.value.trajectory] == [True, True]


def test_functions_of_the_user_are_called_in_the_callers_thread_one_system_after_the_other():
    seen = []

    def note(t, system):
        seen.append((threading.get_ident(), float(t.value), system.values.q[1, 0]))

    systems = [giants(0), giants(1)]
    runs = orbits.propagate(systems, "gauss", dt="20 d", duration="200 d", samples=3, callback=note)
    assert {thread for thread, _, _ in seen} == {threading.get_ident()}
    assert [t for _, t, _ in seen] == [0.0, 100.0, 200.0] * 2
    assert [x for _, _, x in seen] == [*runs[0].q[:, 1, 0].value, *runs[1].q[:, 1, 0].value]


def test_each_system_stops_by_itself():
    systems = [giants(k, names=["Sun", "a", "b", "c"]) for k in (0, 1, 3)]
    stop = FartherThan(5.3 * u.au, "a", "Sun")
    runs = orbits.propagate(systems, "wisdom-holman", dt="20 d", duration="20 yr", samples=11, stop=stop)
    alone = [
        orbits.propagate(system, "wisdom-holman", dt="20 d", duration="20 yr", samples=11, stop=stop)
        for system in systems
    ]
    assert {run.stopped is None for run in runs} == {True, False}  # some stop, some do not
    for run, own in zip(runs, alone, strict=True):
        assert same(run, own)
        assert (run.stopped is None) == (own.stopped is None)
        assert run.stopped is None or run.stopped.time == own.stopped.time


@pytest.mark.parametrize("archive", ["folder", "run-{}.h5", "list"])
def test_each_system_has_an_archive_of_its_own(tmp_path, archive):
    target = [tmp_path / "a.h5", tmp_path / "b.h5"] if archive == "list" else tmp_path / archive
    expected = {
        "folder": ["folder/0.h5", "folder/1.h5"],
        "run-{}.h5": ["run-0.h5", "run-1.h5"],
        "list": ["a.h5", "b.h5"],
    }[archive]
    options = {"dt": "20 d", "duration": "2 yr", "samples": 5}
    systems = [giants(0), giants(1)]
    runs = orbits.propagate(systems, "wisdom-holman", archive=target, **options)
    assert [run.path for run in runs] == [str(tmp_path / name) for name in expected]
    for name, system in zip(expected, systems, strict=True):
        assert same(orbits.Trajectory.open(tmp_path / name), orbits.propagate(system, "wisdom-holman", **options))
    with pytest.raises(ArchiveError, match="exists already"):
        orbits.propagate(systems, "wisdom-holman", archive=target, **options)


@pytest.mark.parametrize(
    ("archive", "message"),
    [
        ("one.h5", r"one file, for 2 systems; expected a folder, a path with \{\}"),
        (["a.h5"], "1 paths for 2 systems"),
        (["a.h5", "a.h5"], "the same path twice"),
        (7, "expected a folder"),
    ],
)
def test_archives_that_do_not_fit_a_list_are_refused(tmp_path, monkeypatch, archive, message):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=message):
        orbits.propagate([giants(0), giants(1)], "wisdom-holman", dt="20 d", duration="1 yr", archive=archive)
    assert not list(tmp_path.iterdir())


def test_a_folder_with_archives_of_other_runs_is_refused(tmp_path):
    (tmp_path / "7.h5").write_bytes(b"")
    with pytest.raises(InputError, match=r"archives of other runs, such as 7\.h5"):
        orbits.propagate([giants(0), giants(1)], "wisdom-holman", dt="20 d", duration="1 yr", archive=tmp_path)


def test_archives_of_a_list_are_extended_to_the_bits_of_a_longer_run(tmp_path):
    systems = [giants(k) for k in range(2)]
    options = {"dt": "20 d", "samples": 6}
    orbits.propagate(systems, "wisdom-holman", duration="10 yr", archive=tmp_path / "runs", **options)
    paths = sorted((tmp_path / "runs").glob("*.h5"))
    runs = orbits.resume(paths, until="20 yr")
    assert isinstance(runs, list)
    whole = orbits.propagate(systems, "wisdom-holman", dt="20 d", duration="20 yr", samples=11)
    assert [same(*pair) for pair in zip(runs, whole, strict=True)] == [True] * 2
    again = orbits.resume(paths)
    assert [run.complete for run in again] == [True] * 2
    with pytest.raises(ArchiveError, match="is a folder"):
        orbits.resume(tmp_path / "runs")
    with pytest.raises(ArchiveError, match="empty"):
        orbits.resume([])


@pytest.mark.nightly
def test_a_list_that_is_interrupted_can_be_resumed_to_the_same_bits(tmp_path):
    systems = [giants(k) for k in range(3)]
    options = {"dt": "4 d", "duration": "30000 yr", "samples": 4}
    timer = threading.Timer(0.4, lambda: signal.raise_signal(signal.SIGINT))
    orbits.propagate(systems[:1], "wisdom-holman", dt="4 d", duration="10 yr")  # compiled before the signal
    timer.start()
    with pytest.raises(Interrupted, match="of 3 systems are complete") as raised:
        orbits.propagate(systems, "wisdom-holman", archive=tmp_path / "runs", **options)
    timer.join()
    assert len(raised.value.trajectory) == 3
    runs = orbits.resume(sorted((tmp_path / "runs").glob("*.h5")))
    alone = orbits.propagate(systems[1], "wisdom-holman", **options)
    assert [run.complete for run in runs] == [True] * 3
    assert same(runs[1], alone)


def test_error_bars_and_steps_are_kept_for_each_system():
    systems = [giants(0), giants(1)]
    options = {"dt": "20 d", "duration": "2 yr", "samples": 3, "error_estimate": True, "dense": True}
    runs = orbits.propagate(systems, "gauss", **options)
    alone = orbits.propagate(systems[1], "gauss", **options)
    assert runs[1].error_bars is not None
    assert runs[1].at(100 * u.day).values.q.tobytes() == alone.at(100 * u.day).values.q.tobytes()
