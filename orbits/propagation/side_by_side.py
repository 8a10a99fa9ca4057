"""Runs of several systems marched at the same time, each in one of several threads."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import wait

from orbits.marching.legs.leg import available_threads
from orbits.marching.stepping.pool import Pool
from orbits.propagation.control.signals import StopRequest
from orbits.propagation.loop import Marching

PAUSE = 0.1
"""Seconds between two looks at what the threads have reached."""


def march_in_threads(
    begun: Mapping[int, Marching],
    stop: StopRequest,
    show: Callable[[], None],
    threads: int | None,
) -> dict[int, BaseException]:
    """March runs up to the point at which warnings are given; return the errors of those that fail.

    begun : what `marching` returned for each, by their numbers; stop : ends them; show : called again and again
    """
    failures: dict[int, BaseException] = {}
    count = available_threads() if threads is None else threads

    def task(k: int) -> None:
        if not stop.name:  # runs that are not begun yet stay so
            _march(k, begun, failures)

    pool = Pool(min(count, len(begun)))
    running = set()
    try:
        for k in begun:
            running.add(pool.submit(task, k))
        while running:
            done, running = wait(running, PAUSE)
            for future in done:
                future.result()
            show()
    except BaseException:
        stop.name = stop.name or "an interrupt"
        wait(running)
        raise
    finally:
        pool.shutdown()
    return failures


def _march(k: int, begun: Mapping[int, Marching], failures: dict[int, BaseException]) -> None:
    """March a run block by block; note its error."""
    try:
        while next(begun[k]) is not None:
            pass
    except BaseException as error:
        failures[k] = error
