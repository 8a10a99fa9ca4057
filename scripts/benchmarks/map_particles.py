"""Massless particles among planets on Kepler orbits: Wisdom–Holman maps beside REBOUND's."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

import orbits
from benchmarks.native import Native, how_built, planets
from benchmarks.planets import NATIVE, OURS, THEIRS, H
from benchmarks.problems import belt, marcher
from orbits.marching.legs.leg import available_threads

CHUNKS = 10
"""How many times steps are timed for each repetition: the least is taken, of many short times."""

COUNT, STEPS = 1024, 1024
WHFAST_COUNT, WHFAST_STEPS = 64, 8192
"""Particles, and steps that are timed at once; of REBOUND's, so many that its correctors at both ends do not count."""

PEER = "REBOUND WHFast"


def part_map_particles(repetitions: int) -> dict[str, Any]:
    """Massless particles in Wisdom–Holman maps: 1,024 of the asteroid belt among the Sun and eight planets, in steps of
    3 days. The kernel's nanoseconds for a particle and step, the time of the planets alone subtracted: the least of
    many short pieces in turn, on one thread, with the search for closest approaches; and how many times faster all
    threads are. REBOUND's WHFast looks for no approaches; it is from the wheel, and as built here from source.
    """
    gm, q, v = belt(COUNT)
    bodies = np.arange(len(gm)) != 9
    gm, q, v = gm[bodies], q[bodies], v[bodies]
    alone, threads, native = gm > 0.0, available_threads(), Native.start()
    maps = {name: method for name, method in OURS.items() if isinstance(method, orbits.WisdomHolman)}
    runs = {
        name: (
            marcher(method, gm, q, v, H),
            marcher(method, gm[alone], q[alone], v[alone], H),
            marcher(method, gm, q, v, H, threads),
        )
        for name, method in maps.items()
    }
    for run in [run for three in runs.values() for run in three]:
        run.compile()
    least: dict[tuple[str, int], float] = {}

    def note(name: str, which: int, seconds: float) -> None:
        least[name, which] = min(least.get((name, which), np.inf), seconds)

    for _ in range(CHUNKS * repetitions):
        for name, three in runs.items():
            for which, run in enumerate(three):
                begun = time.perf_counter()
                run.advance(STEPS)
                note(name, which, (time.perf_counter() - begun) / STEPS)
        integrator, options = THEIRS[PEER]
        for which, some in enumerate((slice(9 + WHFAST_COUNT), slice(9))):
            arguments = integrator, options, gm[some], q[some], v[some], H, WHFAST_STEPS
            note(PEER, which, planets(*arguments)[0] / WHFAST_STEPS)
            if native is not None:
                note(f"{PEER}{NATIVE}", which, native.planets(*arguments)[0] / WHFAST_STEPS)
    for three in runs.values():
        three[2].close()
    if native is not None:
        native.close()
    cost = {
        name: 1e9 * (least[name, 0] - least[name, 1]) / (COUNT if name in maps else WHFAST_COUNT)
        for name in {name for name, _ in least}
    }
    rows = [
        {
            "method": name,
            "ns a particle and step": cost[name],
            "built here": cost.get(f"{name}{NATIVE}"),
            "times faster than WHFast": cost[PEER] / cost[name],
            "than WHFast, built here": None if native is None else cost[f"{PEER}{NATIVE}"] / cost[name],
            f"faster on {threads} threads": least[name, 0] / least[name, 2] if name in maps else None,
        }
        for name in [*maps, PEER]
    ]
    return {"rows": rows, "built here by": how_built()}
