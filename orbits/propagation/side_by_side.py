"""Runs of several systems marched at the same time: in groups of eight in lanes where they can be, and on threads."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from concurrent.futures import wait

from orbits.kernels.lanes import WIDTH
from orbits.marching.clocks.constant import Place
from orbits.marching.marcher import Marcher, available_threads
from orbits.marching.stepping.pool import Pool
from orbits.marching.stepping.systems_in_lanes import Lanes
from orbits.propagation.control.signals import StopRequest
from orbits.propagation.loop import Marching, Run

ENOUGH = 5
"""The fewest systems for which eight lanes take less time than one after another."""

IN_LANES = 0.6
"""The time of a system among eight in lanes, as a fraction of that alone, about."""

PAUSE = 0.1
"""Seconds between two looks at what the threads have reached."""


def groups_of(runs: Mapping[int, Run], threads: int) -> list[list[int]]:
    """Return the numbers of the runs in groups, each of which is marched in a thread: in lanes if it is large enough.

    threads : how many there are; lanes are left empty where more threads than groups would be idle
    """
    kinds: dict[Hashable, list[int]] = {}
    for k, run in runs.items():
        kind = run.marcher.kind_in_lanes() if isinstance(run.marcher, Marcher) else None
        kinds.setdefault(("alone", k) if kind is None else kind, []).append(k)
    groups = [numbers[i : i + WIDTH] for numbers in kinds.values() for i in range(0, len(numbers), WIDTH)]
    split = [[k] for numbers in groups for k in numbers]
    large = [numbers for numbers in groups if len(numbers) >= ENOUGH]
    rest = [[k] for numbers in groups if len(numbers) < ENOUGH for k in numbers]
    in_lanes = -(-len(large) // threads) * WIDTH * IN_LANES + -(-len(rest) // threads)
    return large + rest if large and in_lanes <= -(-len(split) // threads) else split


def march_in_threads(
    runs: Mapping[int, Run],
    begun: Mapping[int, Marching],
    stop: StopRequest,
    show: Callable[[], None],
    threads: int | None,
) -> dict[int, BaseException]:
    """March runs up to the point at which warnings are given; return the errors of those that fail.

    begun : what `marching` returned for each; stop : ends them; show : called again and again
    """
    failures: dict[int, BaseException] = {}
    count = available_threads() if threads is None else threads
    groups = groups_of(runs, count)

    def task(numbers: list[int]) -> None:
        if not stop.name:  # runs that are not begun yet stay so
            _march_group(numbers, runs, begun, failures)

    pool = Pool(min(count, len(groups)))
    running = set()
    try:
        for numbers in groups:
            running.add(pool.submit(task, numbers))
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


def _march_group(
    numbers: list[int], runs: Mapping[int, Run], begun: Mapping[int, Marching], failures: dict[int, BaseException]
) -> None:
    """March runs together, the one that is behind first."""
    ahead: dict[int, Place] = {}

    def go_on(k: int) -> None:
        """March a run by its next block; note the place to which the one after leads, or its error."""
        ahead.pop(k, None)
        try:
            place = next(begun[k])
        except BaseException as error:
            failures[k] = error
        else:
            if place is not None:
                ahead[k] = place

    for k in numbers:
        go_on(k)
    marchers = {k: march for k in numbers if isinstance(march := runs[k].marcher, Marcher)}
    lanes = Lanes([marchers[k] for k in numbers]) if len(numbers) >= ENOUGH else None
    while ahead:
        if lanes is None:
            for k in list(ahead):
                go_on(k)
            continue
        behind = min(marchers[k].step for k in ahead)
        steps = {k: marchers[k].next_block(place) for k, place in ahead.items() if marchers[k].step == behind}
        for count in set(steps.values()):
            together = [k for k in steps if steps[k] == count]
            if len(together) >= ENOUGH:
                lanes.march([numbers.index(k) for k in together], count)
        for k in steps:
            go_on(k)
