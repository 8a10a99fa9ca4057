"""One run in all the ways that must not change a bit: by threads, with other samples, killed and resumed."""

from __future__ import annotations

import os
import signal
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

import orbits
from bits_cases.facts import COSTS, Facts, end, happenings, states, turning
from orbits.errors import InputError
from orbits.events import Event

QUIET: dict[str, Any] = {"check_step": False, "progress": False}
ON_GRID = np.arange(11)
OFF_GRID = np.array([0.0, 0.123, 2.71, 5.001, 7.77, 9.0, 10.0])
"""Samples in tenths of a run."""
SAME = "the same"
BROKEN = "not the same"


def in_all_ways(system: Any, method: Any, *, duration: Any, killed: bool = True, **options: Any) -> Facts:
    """Return the facts of a run with samples on the grid of steps, and for each other way whether it has the same bits.

    duration : of ten times as many whole steps, if they are constant; killed : whether it is killed and resumed too
    """

    def run(samples: Any = ON_GRID, **more: Any) -> Any:
        given = {"threads": 1, "approaches": True, **QUIET, **options, **more}
        return orbits.propagate(system, method, duration=duration, samples=samples * duration / 10, **given)

    first = run()
    found = {**states(first), **turning(first), **happenings(first)}
    whole, last = without_costs(found), end(first)
    off = run(OFF_GRID)
    found |= {"q off the grid": off.q.value, "v off the grid": off.v.value}
    found["samples off the grid"] = compared(last, lambda: end(off))
    found["one sample"] = compared(last, lambda: end(run(ON_GRID[-1:])))
    found["three threads"] = compared(whole, lambda: facts(run(threads=3)))
    if killed:
        for label, part in interrupted(run, options.get("events", ())):
            found[label] = compared(whole, part)
    return found


def interrupted(run: Callable[..., Any], events: Any) -> Iterator[tuple[str, Callable[[], Facts]]]:
    """Yield five runs into archives that were ended early in different ways, and resumed."""

    def resumed(begin: Callable[..., Any], times: int = 0) -> Facts:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "run.h5"
            begin(archive=path)
            again = partial(orbits.resume, path, progress=False, events=events if needed_again(events) else ())
            for _ in range(times):
                if not ended_itself(path):
                    again(threads=1, wall_time=1e-9).close()
            last = orbits.Trajectory.open(path) if ended_itself(path) else again(threads=3)
            found = facts(last)
            last.close()
        return found

    def ended(sample: int, **options: Any) -> None:
        number = count()
        run(callback=lambda t, now: next(number) == sample, **options).close()

    def failed(sample: int, **options: Any) -> None:
        number = count()

        def fail(t: Any, now: Any) -> None:
            if next(number) == sample:
                raise Fault

        try:
            run(callback=fail, **options).close()
        except Fault as fault:
            del fault

    def killed(sample: int, **options: Any) -> None:
        child = os.fork()
        if child:
            os.waitpid(child, 0)
            return
        number = count()
        signal.alarm(120)
        try:
            run(callback=lambda t, now: next(number) == sample and os.kill(os.getpid(), signal.SIGKILL), **options)
        finally:
            os._exit(0)

    def out_of_time(**options: Any) -> None:
        run(wall_time=1e-9, **options).close()

    yield "ended after a block, three times", lambda: resumed(out_of_time, 2)
    yield "ended at sample 1", lambda: resumed(partial(ended, 1))
    yield "failed at sample 4", lambda: resumed(partial(failed, 4))
    yield "killed at sample 6", lambda: resumed(partial(killed, 6))
    yield "ended at sample 9", lambda: resumed(partial(ended, 9))


class Fault(Exception):
    """What a callback raises to end a run."""


def ended_itself(path: Path) -> bool:
    """Whether the run in an archive came to its end, or to an event that stops it."""
    run = orbits.Trajectory.open(path)
    early = run.stopped is None or any(words in run.stopped.reason for words in ("the callback", "the wall time"))
    ended = run.complete or not early
    run.close()
    return bool(ended)


def needed_again(events: Any) -> bool:
    """Whether the events of a run must be given again when it is resumed: those with functions."""
    several = events if isinstance(events, list) else [events] if events else []
    return any(isinstance(event, Event) or callable(getattr(event.then, "act", None)) for event in several)


def facts(run: Any) -> Facts:
    """Return all that is kept of a run but for its costs."""
    return without_costs({**states(run), **turning(run), **happenings(run)})


def without_costs(found: Facts) -> Facts:
    """Return the quantities but for those that depend on where a run was resumed."""
    return {name: value for name, value in found.items() if name not in COSTS}


def compared(expected: Facts, compute: Callable[[], Facts]) -> str:
    """Return whether the quantities of another way are the same, in words; or the kind of its error."""
    try:
        found = compute()
    except InputError:
        return "refused"
    except Exception as error:  # any other error is a broken promise
        return f"{BROKEN}: {type(error).__name__}: {error}"[:200]
    other = [how(name, expected, found) for name in {**expected, **found}]
    return f"{BROKEN}: {', '.join(filter(None, other))}" if any(other) else SAME


def how(name: str, expected: Facts, found: Facts) -> str:
    """Return the name of a quantity and how far it is off, relative to its largest number; nothing if it is alike."""
    one, other = expected.get(name), found.get(name)
    if not (isinstance(one, np.ndarray) and isinstance(other, np.ndarray) and one.shape == other.shape):
        return "" if type(one) is type(other) and not isinstance(one, np.ndarray) and one == other else name
    if one.tobytes() == other.tobytes():
        return ""
    largest = np.nanmax(np.abs(one), initial=0.0, where=np.isfinite(one))
    return f"{name} ({np.nanmax(np.abs(other - one), initial=0.0) / (largest or 1.0):.1g})"
