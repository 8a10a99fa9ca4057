"""Runs with dense=True: the state at any time, from the steps kept in memory or in an archive."""

import copy
import os
import pickle

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.archive import steps as archived_steps
from orbits.errors import ArchiveError, InputError, StorageError
from orbits.propagation.resuming import step_store

from ..coverings import cover, only
from ..problems import three_bodies

QUIET = {"progress": False, "check_step": False}


def system(particles=0):
    gm, q, v = three_bodies(particles)
    names = ["star", "inner", "outer", *(f"p{k}" for k in range(particles))]
    return orbits.System(names, gm, q, v, units=orbits.DIMENSIONLESS)


def times(count=300, end=20.0):
    return np.sort(np.random.default_rng(3).uniform(0.0, end, count))


CASES = {
    "adaptive": {},
    "gauss": {"integrator": "gauss(stages=4)", "dt": 0.05},
    "verlet": {"integrator": "stormer-verlet", "dt": 0.01},
    "composition": {"integrator": orbits.methods.Composition(order=4), "dt": 0.05},
    "backwards": {"duration": -20.0},
    "wisdom-holman": {"integrator": "wisdom-holman", "dt": 0.05},
}


@cover(("where", "case"), ["memory", "archive"], CASES, strength=1)
def test_the_state_at_any_time_is_what_a_sample_there_would_be(case, where, tmp_path):
    """Samples are computed by the march itself, from the state with its low parts; the kept states are rounded."""
    options = {"duration": 20.0, **CASES[case], **QUIET}
    asked = times() * np.sign(options["duration"])
    sampled = orbits.propagate(system(), samples=asked, **options)
    run = orbits.propagate(
        system(), samples=3, dense=True, archive=tmp_path / "run.h5" if where == "archive" else None, **options
    )
    if where == "archive":
        run.close()
        run = orbits.Trajectory.open(tmp_path / "run.h5")
    order = np.random.default_rng(4).permutation(len(asked))
    found = run.at(asked[order])
    assert np.array_equal(found.times, asked[order])
    # A corrected map marches on from every 64th state, with the round-off of that; 3.4e-15 was reached.
    bound = 1e-14 if case == "wisdom-holman" else 2e-15
    assert np.abs(found.q - sampled.q[order]).max() < bound  # 1.6e-15 was reached: kept states are rounded
    assert np.abs(found.v - sampled.v[order]).max() < 2 * bound  # 6.7e-16
    assert np.array_equal(run.at(float(asked[7])).q, run.at(asked[:9]).q[7])
    assert np.array_equal(run.at(run.times).q, run.q)
    run.close()


@cover(("particles", "case"), [0, 2], CASES, strength=1)
def test_states_asked_for_together_have_the_bits_of_those_asked_for_one_by_one(case, particles):
    options = {"duration": 20.0, **CASES[case], **QUIET}
    run = orbits.propagate(system(particles), samples=4, **options)
    asked = np.random.default_rng(5).permutation(times(40)) * np.sign(options["duration"])
    asked = np.append(asked, [asked[3], asked[3], run.times[1], run.times[-1]])
    found = run.at(asked)
    for k, time in enumerate(asked.tolist()):
        one = run.at(time).values
        assert np.array_equal(found.q.value[k], one.q)
        assert np.array_equal(found.v.value[k], one.v)


@pytest.mark.parametrize("case", ["verlet", "composition", "wisdom-holman"])
def test_states_after_a_sample_within_a_step_are_on_the_steps_of_the_run(case):
    """The partial step to the sample is taken back. Steps that began there were off by 1.5e-6, 2.8e-10 and 1.7e-12."""
    options = {"duration": 20.0, **CASES[case], **QUIET}
    asked = times()
    sampled = orbits.propagate(system(), samples=asked, **options)
    run = orbits.propagate(system(), samples=[3.213, 9.8765, 16.1], **options)
    found = run.at(asked)
    assert np.abs(found.q - sampled.q).max() < 2e-13  # 3.3e-14 was reached in the map, 2e-15 otherwise
    assert np.abs(found.v - sampled.v).max() < 2e-13  # 4.5e-14


def test_states_after_a_sample_within_an_excursion_are_those_of_the_run():
    """A march that began within an encounter returned to another phase of the map, off by 4.4e-10."""
    pair = orbits.System.from_elements(
        {
            "star": {"gm": 1.0},
            "a": {"a": 1.0, "e": 0.05, "gm": 1e-3},
            "b": {"a": 1.25, "e": 0.05, "inc": 0.02, "M": 2.0, "gm": 1e-3},
        },
        units=orbits.DIMENSIONLESS,
    )
    options = {"integrator": orbits.WisdomHolman(encounters="follow"), "dt": 0.1, "duration": 60.0, **QUIET}
    asked = np.random.default_rng(1).uniform(0.0, 60.0, 40)
    sampled = orbits.propagate(pair, samples=np.sort(asked), **options)
    assert len(sampled.excursions) > 1
    within = [0.5 * (one.left + one.returned).value + 0.0123 for one in sampled.excursions if one.returned is not None]
    found = orbits.propagate(pair, samples=within, **options).at(np.sort(asked))
    assert np.abs(found.q - sampled.q).max() < 1e-12


@pytest.mark.parametrize("dense", [False, True])
def test_states_before_the_first_sample_are_those_of_the_run_too(dense):
    options = {"duration": 20.0, **CASES["gauss"], **QUIET}
    run = orbits.propagate(system(), samples=[8.0, 12.0], dense=dense, **options)
    asked = [0.0, 3.21, 9.87]
    known = orbits.propagate(system(), samples=asked, **options)
    found = run.at(asked)
    assert np.abs(found.q - known.q).max() < 4e-15
    assert np.abs(found.v - known.v).max() < 8e-15


def test_keeping_the_steps_changes_neither_samples_nor_the_march(tmp_path):
    for k, options in enumerate(CASES.values()):
        options = {"duration": 20.0, "samples": 30, **options, **QUIET}
        plain = orbits.propagate(system(), **options)
        archive = tmp_path / f"{k}.h5" if k % 2 else None
        dense = orbits.propagate(system(), dense=True, archive=archive, **options)
        assert np.array_equal(dense.q, plain.q)
        assert np.array_equal(dense.v, plain.v)
        assert dense.statistics.evaluations == plain.statistics.evaluations
        dense.close()


def stopped(path, case, samples=10, whole=30, **options):
    """Write the run up to that sample, as a run is that was interrupted."""
    seen = []
    options = {"duration": 20.0, **CASES[case], **QUIET, **options}
    start = options.pop("system", None) or system()
    orbits.propagate(
        start, samples=whole, dense=True, archive=path, **options,
        callback=lambda t, state: seen.append(t) or len(seen) == samples,
    ).close()  # fmt: skip
    return path


@pytest.fixture
def little_room(monkeypatch):
    """Steps are written in many pieces and chunks, to a file that grows again and again."""
    monkeypatch.setattr(step_store, "FIRST_BYTES", 0)
    monkeypatch.setattr(step_store, "PIECE_BYTES", 40 * 160)
    monkeypatch.setattr(archived_steps, "CHUNK_BYTES", 30 * 160)


@pytest.mark.parametrize("case", only(("adaptive", "verlet", "wisdom-holman"), CASES))
def test_an_interrupted_run_answers_up_to_its_last_step_and_goes_on_to_the_same_bits(case, tmp_path, little_room):
    options = {"duration": 20.0, **CASES[case], **QUIET}
    whole = orbits.propagate(system(), samples=30, dense=True, **options)
    path = stopped(tmp_path / "run.h5", case)
    part = orbits.Trajectory.open(path)
    assert 0 < len(part._kept) < len(whole._kept)
    last = part._kept.times[-1, 0]
    if case == "wisdom-holman":  # every 64th step is kept, and the samples lead beyond
        assert part.times[-1] - last < 64 * 0.05
        last = part.times[-1]
    assert abs(last) >= abs(part.times[-1]) * 0.99
    asked = last * np.random.default_rng(5).random(50)
    assert np.array_equal(part.at(asked).q, whole.at(asked).q)
    with pytest.raises(InputError, match="lies outside"):
        part.at(1.2 * last)
    part.close()
    run = orbits.resume(path, progress=False)
    assert np.array_equal(run._kept.times, whole._kept.times)
    for mine, others in zip(run._kept.states(every(run)), whole._kept.states(every(whole)), strict=True):
        assert np.array_equal(mine, others)
    run.close()
    assert [each.name for each in tmp_path.iterdir()] == ["run.h5"]


def every(run):
    return np.arange(len(run._kept))


@pytest.mark.parametrize("case", ["adaptive", "verlet"])
def test_an_extended_run_keeps_the_steps_of_its_extension_too(case, tmp_path, little_room):
    options = {**CASES[case], **QUIET}
    whole = orbits.propagate(system(), samples=31, duration=30.0, dense=True, **options)
    orbits.propagate(system(), samples=21, duration=20.0, dense=True, archive=tmp_path / "run.h5", **options).close()
    run = orbits.resume(tmp_path / "run.h5", until=30.0, progress=False)
    asked = times(end=30.0)
    assert np.array_equal(run.at(asked).q, whole.at(asked).q)
    assert len(run._kept) == len(whole._kept)
    run.close()


def test_with_massless_particles_states_are_marched_from_every_sixty_fourth_step(tmp_path):
    start, options = system(3), {"dt": 0.05, "duration": 20.0, **QUIET}
    plain = orbits.propagate(start, samples=2, **options)
    run = orbits.propagate(start, samples=2, dense=True, archive=tmp_path / "run.h5", **options)
    assert np.array_equal(run.q, plain.q)
    assert np.array_equal(run._kept.times[:, 0], 64 * run.step * np.arange(7))
    asked = times(20)
    sampled = orbits.propagate(start, samples=asked, **options)
    assert np.abs(run.at(asked).q - sampled.q).max() < 2e-15  # 4.4e-16 was reached
    run.close()
    part = orbits.Trajectory.open(stopped(tmp_path / "part.h5", "gauss", system=start, integrator="gauss"))
    part.close()
    again = orbits.resume(tmp_path / "part.h5", progress=False)
    assert np.array_equal(again._kept.times, run._kept.times)
    again.close()


def test_slices_copies_and_pickles_answer_as_the_run_does(tmp_path):
    for archive in (None, tmp_path / "run.h5"):
        run = orbits.propagate(system(), duration=20.0, samples=21, dense=True, archive=archive, **QUIET)
        expected = run.at([7.3, 5.5]).q
        for other in (run[3:12], copy.copy(run), copy.deepcopy(run), pickle.loads(pickle.dumps(run)), run.at([0, 19])):
            assert np.array_equal(other.at([7.3, 5.5]).q, expected)
            other.close()
        with pytest.raises(InputError, match="lies outside"):
            run[3:12].at(12.5)
        run.close()


def test_a_run_whose_file_was_deleted_still_has_its_steps(tmp_path):
    path = tmp_path / "run.h5"
    run = orbits.propagate(system(), duration=20.0, samples=21, dense=True, archive=path, **QUIET)
    expected = run.at([7.3, 5.5]).q
    os.unlink(path)
    assert np.array_equal(run.at([7.3, 5.5]).q, expected)
    run.close()


def test_a_run_that_a_condition_ends_keeps_the_steps_up_to_there():
    stop = orbits.events.CloserThan(1.3, "outer", "star")
    run = orbits.propagate(system(), duration=20.0, samples=3, dense=True, stop=stop, **QUIET)
    assert run.stopped is not None
    end = float(run.stopped.time)
    assert run._kept.times[-1, 0] < end  # the last whole step
    assert np.abs(run.at(end).q - run.stopped.system.q).max() < 1e-15  # its time has a second part; 2.2e-16


def test_steps_that_do_not_fit_into_memory_are_refused_or_end_the_run_with_what_there_is(monkeypatch):
    monkeypatch.setattr(step_store, "memory", lambda: 1e5)
    with pytest.raises(InputError, match=r"dense=True keeps 2,001 steps of 3 bodies, which need .* archive="):
        orbits.propagate(system(), dt=0.01, duration=20.0, dense=True, **QUIET)
    monkeypatch.setattr(step_store, "memory", lambda: 2e6)  # for several blocks of steps, but not for all
    with pytest.raises(StorageError, match="nearly all that this machine has; use archive=") as raised:
        orbits.propagate(system(), duration=2000.0, samples=1001, dense=True, **QUIET)
    run = raised.value.trajectory
    assert len(run) > 3
    plain = orbits.propagate(system(), duration=2000.0, samples=1001, **QUIET)
    assert np.array_equal(run.q, plain.q[: len(run)])


def test_damaged_steps_are_named_and_the_samples_stay_readable(tmp_path):
    path = tmp_path / "run.h5"
    orbits.propagate(system(), duration=20.0, samples=21, dense=True, archive=path, **QUIET).close()
    with orbits.Archive.open(path) as archive:
        place, samples = archive.layout.steps.q, np.array(archive.q)
    data = bytearray(path.read_bytes())
    data[place.offset + 1000] ^= 1
    path.write_bytes(data)
    run = orbits.Trajectory.open(path)
    assert np.array_equal(run.q.value, samples)
    with pytest.raises(ArchiveError, match=r"steps 0 to .* do not hold their checksum"):
        run.at(7.3)
    run.close()
    with pytest.raises(ArchiveError, match=r"steps 0 to .* do not hold their checksum"):
        orbits.resume(path, until=30.0, progress=False)


def test_dense_is_true_or_false():
    with pytest.raises(InputError, match="dense"):
        orbits.propagate(system(), duration=1.0, dense="yes", **QUIET)


def test_steps_a_hundred_years_on_are_kept_to_the_second_part_of_their_times():
    """Times are then rounded to 0.3 microseconds, in which Mercury moves 2 centimetres: 1e-13 au."""
    start = orbits.System.solar_system(bodies=["Sun", "Mercury", "Jupiter"])
    asked = 36525.0 + np.array([0.1, 3.3, 17.0, 40.0, 61.7, 80.0])
    sampled = orbits.propagate(start, samples=asked, duration=36615 * u.day, progress=False)
    run = orbits.propagate(start, samples=2, duration=36615 * u.day, dense=True, progress=False)
    assert np.abs(run.at(asked).q - sampled.q).max().value < 2e-15


def test_behind_the_last_step_the_march_goes_on_with_shorter_steps_where_it_must():
    """Two light bodies meet, which the clock does not foresee: it proposes a step far beyond, and rejects it."""
    q = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1e-6, 0.0]])
    v = np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.5]])
    names = ["star", "planet", "moonlet"]
    meeting = orbits.System(names, np.array([1.0, 1e-9, 1e-12]), q, v, units=orbits.DIMENSIONLESS)
    before = orbits.propagate(meeting, duration=-0.5, **QUIET)[-1]
    start = orbits.System(
        names, before.values.gm, before.values.q, before.values.v, units=orbits.DIMENSIONLESS
    )
    times = orbits.propagate(start, duration=0.6, dense=True, **QUIET)._kept.times[:, 0]
    lengths = np.diff(times)
    sudden = int(np.argmin(lengths[1:] / lengths[:-1]))
    run = orbits.propagate(start, duration=times[sudden + 1] + 0.9 * lengths[sudden], samples=2, dense=True, **QUIET)
    asked = np.linspace(run._kept.times[-1, 0], run.times[-1], 9)[1:-1]
    sampled = orbits.propagate(start, duration=run.times[-1], samples=asked, **QUIET)
    assert np.abs(run.at(asked).q - sampled.q).max() < 1e-13  # 1.1e-14; one partial step alone would be 1e-4 off


@pytest.mark.nightly
def test_terms_and_forces_act_in_partial_steps_too():
    spin = orbits.terms.FrameDragging("star", spin=0.1, pole=(0.36, 0.48, 0.8), c=3.0)
    drag = orbits.terms.Drag(rate=1e-2, velocity=(0.05, 0.0, -0.02))
    start, options = system().with_terms(spin).with_forces(drag), {"dt": 0.05, "duration": 20.0, **QUIET}
    sampled = orbits.propagate(start, samples=times(), **options)
    run = orbits.propagate(start, samples=3, dense=True, **options)
    assert np.abs(run.at(times()).q - sampled.q).max() < 1e-15  # 4.4e-16 was reached


def test_a_slice_of_an_archived_run_reads_the_steps_of_its_file(tmp_path):
    run = orbits.propagate(system(), duration=20.0, samples=21, dense=True, archive=tmp_path / "run.h5", **QUIET)
    some = run[3:12]
    run.close()
    with pytest.raises(ArchiveError, match=r"run\.h5 was closed; open it again"):
        some.at(7.3)
