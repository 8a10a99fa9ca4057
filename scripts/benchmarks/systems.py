"""Several planetary systems at once: eight in lanes, beside each alone, and WHFast512."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

import orbits
from benchmarks.native import planets
from benchmarks.planets import OURS, WHFAST512_CHUNK, H
from benchmarks.problems import marcher, ten_bodies_data
from orbits.kernels.compile import kernel
from orbits.kernels.systems.planets import step_in_lanes
from orbits.marching.stepping.systems_in_lanes import Lanes

CHUNKS = 60
"""How many times steps are timed for each repetition: the least is taken, of many short times."""

CHUNK, BLOCK = 500, 4000
"""Steps that are timed at once: half a millisecond for eight systems; and those of a block of a run."""

SYSTEMS = 8

EXPLICIT = {"Störmer–Verlet": orbits.StormerVerlet(), "the same composed to order 4": orbits.Composition(order=4)}


@kernel
def _steps(rows, count, h, shift, lazy, steps):
    for _ in range(steps):
        step_in_lanes(rows, count, h, shift, lazy)


def part_systems(repetitions: int) -> dict[str, Any]:
    """Eight systems of a Sun and eight planets that start at slightly different velocities, in lanes, steps of 3 days:
    the least time of a step of one system, in many short chunks that alternate with those of one system alone and of
    WHFast512: the steps alone, and whole runs with their search for closest approaches.
    """
    gm, q, v, _ = ten_bodies_data()
    gm, q, v = gm[:9], q[:9], v[:9]
    rng = np.random.default_rng(1)
    starts = [v * (1.0 + 1e-4 * rng.standard_normal(v.shape)) for _ in range(SYSTEMS)]
    rows, theirs = [], np.inf
    maps = {name: method for name, method in OURS.items() if isinstance(method, orbits.WisdomHolman)}
    for name, method in {**maps, **EXPLICIT}.items():
        systems = [marcher(method, gm, q, start, H) for start in starts]
        lanes, alone = Lanes(systems), marcher(method, gm, q, v, H)
        alone.compile()
        least = dict.fromkeys(("steps", "whole", "alone"), np.inf)
        lanes.march(range(SYSTEMS), CHUNK)
        coefficients = systems[0].loops.coefficients
        for _ in range(CHUNKS * repetitions):
            if name in maps:
                arguments = 8, coefficients[0, 1], coefficients[0, 2], bool(coefficients[0, 3])
                least["steps"] = min(least["steps"], _timed(_steps, lanes.rows, *arguments, CHUNK) / SYSTEMS)
            begun = time.perf_counter()
            block = min(BLOCK, systems[0].block)
            lanes.march(range(SYSTEMS), block)
            for system in systems:
                system.advance(block)
            share = CHUNK / block
            least["whole"] = min(least["whole"], share * (time.perf_counter() - begun) / SYSTEMS)
            least["alone"] = min(least["alone"], CHUNK / BLOCK * _timed(alone.advance, BLOCK))
            seconds = planets("whfast512", {}, gm, q, v, H, WHFAST512_CHUNK)[0]
            theirs = min(theirs, seconds * CHUNK / WHFAST512_CHUNK)
        rows.append({"method": name, **{what: 1e9 * seconds / CHUNK for what, seconds in least.items()}})
    whfast512 = 1e9 * theirs / CHUNK
    return {
        "rows": [
            {
                "method": row["method"],
                "ns a step of a system": row["steps"] if np.isfinite(row["steps"]) else None,
                "in a run": row["whole"],
                "alone, in a run": row["alone"],
                "times faster than WHFast512": whfast512 / row["steps"] if np.isfinite(row["steps"]) else None,
                "in a run than alone": row["alone"] / row["whole"],
            }
            for row in rows
        ],
        "WHFast512, ns a step": whfast512,
    }


def _timed(function: Any, *arguments: Any) -> float:
    begun = time.perf_counter()
    function(*arguments)
    return time.perf_counter() - begun
