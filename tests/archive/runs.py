"""A small run in which every value identifies its place."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from orbits import DIMENSIONLESS, System
from orbits.archive import Archive, ArchiveWriter
from orbits.time_grid import TimeGrid

INTEGRATOR = {"name": "gauss", "parameters": {"stages": 8}}
PROVENANCE = {"orbits": "0.0", "cpu_features": "avx2 fma"}


def system(bodies: int = 3) -> System:
    rng = np.random.default_rng(7)
    names = [f"body {i}" for i in range(bodies)]
    gm = np.where(np.arange(bodies) < 2, 1.0, 0.0)
    q, v = rng.normal(size=(2, bodies, 3))
    return System(names, gm, q, v, units=DIMENSIONLESS)


def samples(count: int, bodies: int = 3, seed: int = 8) -> tuple[np.ndarray, np.ndarray]:
    q, v = np.random.default_rng(seed).normal(size=(2, count, bodies, 3))
    return q, v


def checkpoint(sequence: int, bodies: int = 3) -> dict[str, np.ndarray]:
    """Arrays of the kinds a run has, all of them different after each commit; one of them is empty."""
    rng = np.random.default_rng(1000 + sequence)
    return {
        "counts": np.array([sequence, 10 * sequence], dtype=np.int64),
        "q_lo": rng.normal(size=(bodies, 3)) * 1e-17,
        "memory": rng.normal(size=(2, bodies, 3)),
        "nothing": np.empty((0, 3)),
        "flag": np.array(sequence % 2 == 0),
    }


def create(path: Path, times: Any, bodies: int = 3, **options: Any) -> ArchiveWriter:
    """Create an archive of that many samples, or with those times."""
    grid = TimeGrid(options.pop("dt", 0.25), np.arange(times) * 0.5 if isinstance(times, int) else times)
    given = {"integrator": INTEGRATOR, "provenance": PROVENANCE, "system": system(bodies)} | options
    return ArchiveWriter.create(path, grid=grid, checkpoint=checkpoint(0, bodies), **given)


def finished(path: Path, count: int = 6, chunk: int = 2, bodies: int = 3, **options: Any) -> Path:
    """Write a whole run, `chunk` samples a commit, and return its path."""
    q, v = samples(count, bodies)
    with create(path, count, bodies, **options) as writer:
        for number, first in enumerate(range(0, count, chunk), start=1):
            writer.commit(q[first : first + chunk], v[first : first + chunk], checkpoint(number, bodies))
    return path


def same_checkpoint(got: dict[str, np.ndarray], expected: dict[str, np.ndarray]) -> bool:
    return set(got) == set(expected) and all(
        got[name].dtype == expected[name].dtype and np.array_equal(got[name], expected[name]) for name in expected
    )


def assert_whole(path: Path, count: int = 6, bodies: int = 3) -> None:
    q, v = samples(count, bodies)
    with Archive.open(path) as archive:
        archive.verify()
        assert archive.committed == count
        assert np.array_equal(archive.q, q)
        assert np.array_equal(archive.v, v)
