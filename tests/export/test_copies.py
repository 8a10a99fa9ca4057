"""Values go through pickle, copy and other processes without losing a bit."""

from __future__ import annotations

import copy
import functools
import multiprocessing
import os
import pickle
from pathlib import Path

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.certificate.certificate import Certificate, Finding
from orbits.errors import ArchiveError, SingularityError
from orbits.integrators import registry

from ..coverings import each

MAKERS = {
    "pickle": lambda x: pickle.loads(pickle.dumps(x)),
    "oldest pickle": lambda x: pickle.loads(pickle.dumps(x, protocol=2)),
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
}


@pytest.fixture(params=MAKERS.values(), ids=MAKERS)
def again(request):
    return request.param


def systems() -> dict[str, orbits.System]:
    solar = orbits.System.solar_system("2022-08-09T00:00:00.123456789", bodies=["Sun", "Jupiter", "Saturn"])
    own = orbits.UnitSystem("own", u.au, u.yr / (2 * np.pi), u.M_sun)
    pure = orbits.System(["a"], [1.0], [[-0.0, 5e-324, 1]], [[0, 0, 0]], units=orbits.DIMENSIONLESS, softening=0.1)
    return {
        "solar": solar.add("probe", primary="Sun", a=1.0, radius=1e-9),
        "own units": orbits.System(solar.names, solar.gm, solar.q, solar.v, units=own),
        "pure numbers": pure,
    }


def bits(system: orbits.System) -> tuple:
    gm, q, v, softening = system.values
    epoch = None if system.epoch is None else (system.epoch.jd1, system.epoch.jd2, system.epoch.scale)
    radii = None if system.radii is None else system.radii.value.tobytes()
    return system.names, gm.tobytes(), q.tobytes(), v.tobytes(), softening, epoch, system.units, radii


def short_run(system: orbits.System, **options) -> orbits.Trajectory:
    return orbits.propagate(system, orbits.Gauss(stages=4), dt=20, duration=200, samples=5, **options)


@pytest.mark.parametrize("which", systems())
def test_a_system_keeps_every_bit(again, which):
    system = systems()[which]
    copied = again(system)
    assert bits(copied) == bits(system)
    assert copied == system
    assert not copied.values.q.flags.writeable


@each("name", registry())
def test_an_integrator_is_the_same_value(again, name):
    kind = registry()[name]
    needs = {"gauss": {"stages": 3}, "lobatto-iiia-iiib": {"stages": 3}, "lobatto-iiib-iiia": {"stages": 3}}
    try:
        method = kind(**needs.get(name, {}))
    except TypeError:
        pytest.skip("needs tables of its own")
    assert again(method) == method
    assert again(method).label == method.label


def test_a_run_in_memory_keeps_its_samples_and_goes_on_answering(again):
    run = short_run(systems()["solar"])
    copied = again(run)
    assert bits(copied.system) == bits(run.system)
    for mine, theirs in ((run.times, copied.times), (run.q.value, copied.q.value), (run.v.value, copied.v.value)):
        assert mine.tobytes() == theirs.tobytes()
    assert (copied.step, copied.statistics, repr(copied)) == (run.step, run.statistics, repr(run))
    assert copied.at(33.0) == run.at(33.0)
    assert repr(copied.closest_approaches()) == repr(run.closest_approaches())


@pytest.fixture(scope="module")
def archive(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("copies") / "run.h5"
    finding = Finding("symplectic", 3.0, 64.0, "ulps", True, True, True)
    certificate = Certificate("a problem", "Gauss(stages=4)", 20.0, "d", (finding,))
    short_run(systems()["solar"], archive=path, certificate=certificate).close()
    return path


def test_a_run_in_an_archive_is_opened_again_and_has_its_certificate(again, archive, monkeypatch):
    monkeypatch.chdir(archive.parent)
    run = orbits.Trajectory.open(archive.name)
    monkeypatch.chdir("/")
    copied = again(run)
    assert np.array_equal(copied.q, run.q)
    assert copied.certificate == run.certificate
    assert again(run.certificate) == run.certificate
    run.close()
    assert np.array_equal(copied.energy(), again(copied).energy())
    copied.close()


def test_a_stopped_run_in_an_archive_says_where_it_stopped(again, tmp_path):
    near = orbits.events.CloserThan(4.955 * u.au, "Sun", "Jupiter")
    run = short_run(systems()["solar"], archive=tmp_path / "run.h5", stop=near)
    copied = again(run)
    assert run.stopped is not None
    assert (copied.stopped.reason, copied.stopped.time) == (run.stopped.reason, run.stopped.time)
    assert repr(copied.closest_approaches()) == repr(run.closest_approaches())


def test_a_pickled_run_whose_archive_is_gone_or_shorter_says_so(tmp_path):
    run = short_run(systems()["solar"], archive=tmp_path / "run.h5")
    pickled = pickle.dumps(run)
    run.close()
    orbits.propagate(
        run.system, run.integrator, dt=20, duration=20, samples=2, archive=run.path, overwrite=True
    ).close()
    with pytest.raises(ArchiveError, match="has 2 samples; expected the 5"):
        pickle.loads(pickled)
    other = short_run(systems()["solar"].replaced(q=1.001 * run.system.values.q), archive=run.path, overwrite=True)
    assert len(other) == 5
    with pytest.raises(ArchiveError, match="now has another run"):
        pickle.loads(pickled)
    os.remove(run.path)
    with pytest.raises(ArchiveError, match="does not exist"):
        pickle.loads(pickled)


def test_an_error_keeps_its_step_bodies_and_trajectory(again):
    error = SingularityError("two bodies met", step=7, time=3.5, bodies=["a", "b"])
    error.trajectory = short_run(systems()["solar"])
    copied = again(error)
    assert (str(copied), copied.step, copied.time, copied.bodies) == ("two bodies met", 7, 3.5, ("a", "b"))
    assert np.array_equal(copied.trajectory.q, error.trajectory.q)


@pytest.mark.nightly
def test_runs_in_spawned_processes_have_the_bits_of_this_one():
    system = systems()["solar"]
    work = functools.partial(orbits.propagate, integrator=orbits.Gauss(stages=4), dt=20, duration=200, samples=5)
    expected = work(system)
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        found = pool.apply(work, (system,))
    assert found.q.value.tobytes() == expected.q.value.tobytes()
    assert bits(found[-1]) == bits(expected[-1])
