"""Runs with dense=True: the state at any time, from the steps kept in memory or in an archive."""

import copy
import os
import pickle
import warnings

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.archive import steps as archived_steps
from orbits.errors import ArchiveError, InputError, StorageError
from orbits.marching.kept_steps import StepsInMemory
from orbits.propagation import step_store

from ..problems import three_bodies

QUIET = {"progress": False, "check_step": False}


def system(particles=0):
    gm, q, v = three_bodies(particles)
    names = ["star", "inner", "outer", *(f"p{k}" for k in range(particles))]
    return orbits.System.from_states(names, gm, q, v, units=orbits.DIMENSIONLESS)


def times(count=300, end=20.0):
    return np.sort(np.random.default_rng(3).uniform(0.0, end, count))


CASES = {
    "adaptive": {},
    "gauss": {"integrator": "gauss(stages=4)", "dt": 0.05},
    "verlet": {"integrator": "stormer-verlet", "dt": 0.01},
    "composition": {"integrator": orbits.Composition(base=orbits.Gauss(stages=1), order=4), "dt": 0.05},
    "backwards": {"duration": -20.0},
}


@pytest.mark.parametrize("where", ["memory", "archive"])
@pytest.mark.parametrize("case", CASES)
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
    assert np.abs(found.q - sampled.q[order]).max() < 1e-15  # 4.4e-16 was reached
    assert np.abs(found.v - sampled.v[order]).max() < 3e-15  # 6.7e-16
    assert np.array_equal(run.at(float(asked[7])).q, run.at(asked[:9]).q[7])
    assert np.array_equal(run.at(run.times).q, run.q)
    run.close()


def test_keeping_the_steps_changes_neither_samples_nor_the_march(tmp_path):
    for options in CASES.values():
        options = {"duration": 20.0, "samples": 30, **options, **QUIET}
        plain = orbits.propagate(system(), **options)
        for archive in (None, tmp_path / "run.h5"):
            dense = orbits.propagate(system(), dense=True, archive=archive, overwrite=True, **options)
            assert np.array_equal(dense.q, plain.q)
            assert np.array_equal(dense.v, plain.v)
            assert dense.statistics.evaluations == plain.statistics.evaluations
            dense.close()
