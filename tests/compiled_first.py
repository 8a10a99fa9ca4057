"""Fill the cache with the kernels that many tests share, on all cores, before workers of pytest start.

    python -m tests.compiled_first

Workers that need a kernel at the same time would each compile it. Each task here compiles a family of its own; a kernel
that is in the cache already is loaded, so that all of this takes seconds where nothing has changed.
"""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import Any

import orbits
from orbits.methods import SABA, Composition, LobattoIIIAB

from .problems import three_bodies


def run(method: Any = None, particles: int = 0, **options: Any) -> None:
    """March three bodies, and particles, with a sample within a step."""
    gm, q, v = three_bodies(particles)
    names = [f"b{k}" for k in range(len(gm))]
    system = orbits.System(names, gm, q, v, radii=[1e-4] * 3 + [0.0] * particles, units=orbits.DIMENSIONLESS)
    method = {} if method is None else {"integrator": method}
    orbits.propagate(system, **method, duration=1.01, samples=3, progress=False, check_step=False, **options)


def certify(method: Any) -> None:
    """Certify a method on bodies."""
    gm, q, v = three_bodies(1)
    system = orbits.System(["a", "b", "c", "p"], gm, q, v, units=orbits.DIMENSIONLESS)
    orbits.certify(system, method, 0.1)


TASKS: dict[str, Callable[[], Any]] = {
    "steps chosen one by one": lambda: run(particles=9),
    "maps that are left": lambda: run(orbits.WisdomHolman(encounters="follow"), 9, dt=0.05),
    "maps": lambda: run(orbits.WisdomHolman(), 9, dt=0.05, approaches=True),
    "maps of bodies alone": lambda: run(orbits.WisdomHolman(), dt=0.05),
    "Gauss": lambda: run(orbits.Gauss(stages=4), 9, dt=0.05),
    "certificate": lambda: certify(orbits.Gauss(stages=4)),
    "certificate of kicks": lambda: certify(orbits.StormerVerlet()),
    "Lobatto": lambda: run(LobattoIIIAB(stages=3), 9, dt=0.05),
    "kicks": lambda: run(orbits.StormerVerlet(), 9, dt=0.01, approaches=True),
    "splitting of orbits": lambda: run(SABA(), 9, dt=0.05),
    "composition": lambda: run(Composition(order=4), 9, dt=0.05),
    "heliocentric maps": lambda: run(orbits.WisdomHolman(coordinates="democratic-heliocentric"), 9, dt=0.02),
    "transformed time": lambda: run(dt=orbits.TimeTransformed(step=0.1)),
}
"""What is compiled, the longest first."""


def compile_for(name: str) -> float:
    """Do one of the tasks; the seconds that it took."""
    begun = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        TASKS[name]()
    return time.perf_counter() - begun


def main() -> None:
    """Do all tasks, in as many processes as there are cores, up to four."""
    workers = min(os.cpu_count() or 1, 4)
    print(f"Compiling what tests share, in {workers} processes:", flush=True)
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        names = {pool.submit(compile_for, name): name for name in TASKS}
        for one in as_completed(names):
            print(f"  {names[one]}: {one.result():.0f} s", flush=True)


if __name__ == "__main__":
    main()
