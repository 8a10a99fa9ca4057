"""A small real run: planets and asteroids for a year, in an archive with a commit for each sample or so."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.propagation.resuming import sample_store

METHOD = orbits.StormerVerlet()
SAMPLES = 13


def look(time: Any, state: Any) -> None:
    """A callback, for which samples are taken, and committed, one by one."""


ARGUMENTS: dict[str, Any] = {
    "dt": 0.5 * u.day, "duration": 60 * u.day, "samples": SAMPLES, "progress": False, "check_step": False, "threads": 1,
    "approaches": True, "callback": look,
}  # fmt: skip
LONGER = 80 * u.day


@cache
def system() -> orbits.System:
    sun = orbits.System.solar_system("2022-08-09")
    keep = ["Sun", "Earth-Moon barycenter", "Jupiter"]
    index = [sun.names.index(name) for name in keep]
    some = sun.replaced(q=sun.values.q, v=sun.values.v)
    return orbits.System(
        keep, some.values.gm[index], some.values.q[index], some.values.v[index],
        epoch=sun.epoch, units=sun.units, radii=[0.005, 1e-4, 5e-4],
    ).add_particles(orbits.asteroids(2))  # fmt: skip


def propagate(path: Path | None = None, **options: Any) -> orbits.Trajectory:
    return orbits.propagate(system(), METHOD, archive=path, **{**ARGUMENTS, **options})


@cache
def straight() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, positions and velocities of the run extended to `LONGER`, never stopped and never in a file."""
    run = propagate(duration=LONGER, samples=17)
    return run.times, run.q.value, run.v.value


def interrupted(path: Path, samples: int = 7, **options: Any) -> Path:
    """Write the run up to so many samples, one commit each, and return the path."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sample_store, "COMMIT_SECONDS", 0.0)
        seen: list[Any] = []
        propagate(path, callback=lambda t, state: seen.append(t) or len(seen) == samples, **options).close()
    return path


def finished(path: Path) -> Path:
    """Write the whole run, one commit for each sample, and return the path."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sample_store, "COMMIT_SECONDS", 0.0)
        propagate(path).close()
    return path


KEPT: dict[str, Any] = {**ARGUMENTS, "dt": None, "duration": 6000 * u.day, "samples": 4, "dense": True}
"""A run without dt that keeps its steps: their number is not known beforehand."""


@cache
def massive() -> orbits.System:
    x, n = system().values, 3
    return orbits.System(system().names[:n], x.gm[:n], x.q[:n], x.v[:n], units=system().units)


def keeping(path: Path | None = None, **options: Any) -> orbits.Trajectory:
    return orbits.propagate(massive(), archive=path, **{**KEPT, **options})


@cache
def all_steps() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The samples, and times, positions and velocities of all steps, of that run."""
    run = keeping()
    return run.q.value, run._kept.times, *run._kept.states(np.arange(len(run._kept)))


def is_part_of_the_kept_run(run: orbits.Trajectory) -> bool:
    """Whether its samples and steps are those of the run, and undamaged."""
    samples, *steps = all_steps()
    run.archive.verify()
    n = len(run._kept)
    found = (run._kept.times, *run._kept.states(np.arange(n)))
    return np.array_equal(run.q.value, samples[: len(run)]) and all(
        np.array_equal(mine, known[:n]) for mine, known in zip(found, steps, strict=True)
    )


def is_part_of_the_run(run: orbits.Trajectory) -> bool:
    """Whether every value of a run is one that was computed: bodies, times, states, what it says of itself."""
    times, q, v = straight()
    n = len(run)
    return (
        run.system == system()
        and run.integrator == METHOD
        and run.step == 0.5
        and np.array_equal(run.times, times[:n])
        and np.array_equal(run.q.value, q[:n])
        and np.array_equal(run.v.value, v[:n])
        and all(np.array_equal(run[k].values.q, q[k]) for k in range(n))
    )
