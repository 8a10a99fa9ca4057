"""`orbits warm-up`: compile the kernels of everyday calls, or of scenarios, before they are needed, on all cores.

Each kind of run is a task: a run of a few steps, in a process of its own. Several processes that need the same kernel
compile it once (`orbits.kernels.compile.entry_locks`).
"""

from __future__ import annotations

import os
import sys
import time
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any, NamedTuple

from orbits.errors import InputError, OrbitsError, OrbitsWarning

STEPS, SAMPLES = 60.5, 9
"""The length of a run of a scenario, in steps, and its samples: off the grid of the steps, several to a block."""

MAP = "wisdom-holman(encounters='follow')"
"""The method of everyday for planets that stay apart."""

PAUSE = 0.5
"""Seconds from one look at the processes to the next."""


class Task(NamedTuple):
    """A kind of run.

    label : what it is, in words
    name : of the function of this module that makes it; arguments : what that is called with
    """

    label: str
    name: str
    arguments: tuple[Any, ...] = ()


class Done(NamedTuple):
    """Whether a task compiled anything, and why it was refused, or an empty text."""

    compiled: bool
    refused: str


@dataclass(frozen=True)
class WarmUp:
    """What was compiled.

    tasks : how many kinds of run; seconds : what it took; compiled : for how many kinds anything was compiled
    refused : reasons, by label, why a combination is refused
    """

    tasks: int
    seconds: float
    compiled: int
    refused: dict[str, str]

    def __str__(self) -> str:
        if self.compiled == 0:
            return f"nothing to compile: the kernels of {self.tasks} kinds of run are in the cache"
        return f"ready after {self.seconds:.0f} s: {self.compiled} of {self.tasks} kinds of run had kernels to compile"


def everyday() -> list[Task]:
    """Return the tasks for everyday calls."""
    return [
        Task("steps chosen, with a massless body and an approach", "flyby"),
        Task("gauss, constant steps", "bodies", ("gauss",)),
        Task("wisdom-holman, encounters followed, with massless bodies", "particles", (MAP,)),
        Task("gauss, constant steps, with massless bodies", "particles", ("gauss",)),
        Task("stormer-verlet, with massless bodies", "particles", ("stormer-verlet",)),
    ]


def everything() -> list[Task]:
    """Return the tasks for all methods, with and without massless bodies, after those for everyday calls."""
    from orbits import integrators

    names = sorted(integrators.registry())
    more = [Task(name, "bodies", (name,)) for name in names]
    more += [Task(f"{name}, with massless bodies", "particles", (name,)) for name in names]
    known = {task[1:] for task in everyday()}
    return everyday() + [task for task in more if task[1:] not in known]


def of_scenario(what: str) -> list[Task]:
    """Return the tasks for the runs of a scenario, one for each method. Raises InputError for a study."""
    from orbits.scenario.definition import Scenario
    from orbits.scenario.loading import load

    scenario = load(what)
    if not isinstance(scenario, Scenario):
        raise InputError(f"{what!r} is a study, which makes its runs by itself; expected a scenario.")
    count = len(scenario.integrators)
    return [Task(f"{scenario.name}: {scenario.integrators[k].label}", "part_of", (what, k)) for k in range(count)]


def flyby() -> None:
    """An asteroid without mass, steps chosen one by one, an event, samples, elements, a check of the energy."""
    from orbits.propagation import propagate
    from orbits.propagation.events.kinds.of_pairs import CloseApproach

    system = _planets().add("asteroid", primary="Sun", a=2.3, e=0.2)
    near = CloseApproach("asteroid", within=0.1)
    run = propagate(system, duration=20.0, samples=11, events=[near], progress=False)
    run.drift()
    run.elements(primary="Sun")


def bodies(method: str) -> None:
    """Sun and planets by a method, in constant steps."""
    _march(_planets(), method)


def particles(method: str) -> None:
    """Sun and planets with massless bodies by a method, in constant steps."""
    system = _planets()
    for k in range(9):
        system = system.add(f"asteroid {k}", primary="Sun", a=2.3 + 0.1 * k, e=0.1)
    _march(system, method)


def part_of(what: str, number: int) -> None:
    """A few steps of a method of a scenario, on each of its systems."""
    from orbits.propagation import propagate
    from orbits.scenario.loading import load
    from orbits.time_grid import TimeGrid

    scenario: Any = load(what)
    for system in scenario.cases().values():
        grid = TimeGrid.of(system, scenario.dt, duration=scenario.duration, samples=scenario.samples)
        length = grid.end / 1000.0 if grid.clock.changes else STEPS * grid.clock.h
        options = {"duration": length, "samples": SAMPLES, "approaches": scenario.approaches, "progress": False}
        propagate(system, scenario.integrators[number], dt=scenario.dt, **options).drift()


def perform(tasks: Sequence[Task], processes: int, say: Callable[[int, float], None]) -> WarmUp:
    """Perform tasks in processes; return what was compiled.

    say : called from time to time with the number of tasks that are done and the seconds so far
    """
    begun, compiled, refused = time.perf_counter(), 0, {}
    with ProcessPoolExecutor(min(processes, len(tasks)), mp_context=get_context("spawn")) as pool:
        left = {pool.submit(performed, task): task for task in tasks}
        try:
            while left:
                for future in wait(left, timeout=PAUSE, return_when=FIRST_COMPLETED).done:
                    task, done = left.pop(future), future.result()
                    compiled += done.compiled
                    if done.refused:
                        refused[task.label] = done.refused
                say(len(tasks) - len(left), time.perf_counter() - begun)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return WarmUp(len(tasks), time.perf_counter() - begun, compiled, refused)


def performed(task: Task) -> Done:
    """Perform a task in this process. A combination of `everything` that is refused is no failure: nobody can need its
    kernels.
    """
    from orbits.kernels.compile.compile_time import compile_time

    refused = ""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", OrbitsWarning)
        try:
            globals()[task.name](*task.arguments)
        except OrbitsError as error:
            if task.name == "part_of":
                raise
            refused = str(error)
    return Done(compile_time.seconds() > 0.0, refused)


def _planets() -> Any:
    from orbits.system import System

    return System.solar_system()


def _march(system: Any, method: str) -> None:
    from orbits.propagation import propagate

    run = propagate(system, method, dt="4 d", duration="242 d", samples=SAMPLES, progress=False)
    run.drift()


def execute(scenarios: Sequence[str], *, everything_else: bool) -> None:
    """Perform what the command asks for, and say what is done and how long it takes."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    tasks = [task for what in scenarios for task in of_scenario(what)]
    if everything_else or not tasks:
        tasks += everything() if everything_else else everyday()
    processes = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    console = Console(stderr=True, highlight=False)
    words = f"compiling for this machine, once: {len(tasks)} kinds of run, {min(processes, len(tasks))} at a time"
    if not console.is_terminal:
        print(words, file=sys.stderr, flush=True)
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[so_far]}")
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        shown = bar.add_task("compiling for this machine, once", total=len(tasks), so_far="")

        def say(done: int, seconds: float) -> None:
            bar.update(shown, completed=done, so_far=f"{seconds:.0f} s so far …")

        print(perform(tasks, processes, say))
