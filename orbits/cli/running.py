"""Commands that integrate: `run`, `resume`, and `warm-up`, which compiles for them."""

from __future__ import annotations

import shlex
from typing import Annotated, Any

import typer

from orbits.cli.arguments import File, ScenarioName, show
from orbits.errors import OutOfTime
from orbits.scenario import command
from orbits.scenario.command import (
    Approaches,
    Beat,
    Dt,
    Duration,
    Json,
    ListOptions,
    Method,
    NoPlot,
    Out,
    Own,
    Samples,
    WallTime,
    guarded,
)
from orbits.scenario.printed import stderr


def run(
    scenario: ScenarioName,
    dt: Dt = None,
    duration: Duration = None,
    integrator: Method = None,
    samples: Samples = None,
    approaches: Approaches = None,
    own: Own = None,
    out: Out = None,
    as_json: Json = False,
    no_plot: NoPlot = False,
    wall_time: WallTime = None,
    heartbeat: Beat = None,
    list_options: ListOptions = False,
) -> None:
    """Run a scenario: integrate, compare, check, draw.

    Example: orbits run kepler --duration 200 --out results/short
    """
    with guarded():
        from orbits.scenario import load

        how: dict[str, Any] = {"out": out, "no_plot": no_plot, "wall_time": wall_time, "heartbeat": heartbeat}
        chosen = command.changed(load(scenario), dt, duration, integrator, samples, own, approaches)
        command.execute(chosen, list_options=list_options, as_json=as_json, **how)


def resume(
    file: File,
    until: Annotated[
        str | None,
        typer.Option(
            help="Extend a finished run to this date, '2050-01-01', or time since the epoch, '2000 yr'.", metavar="TIME"
        ),
    ] = None,
    any_bits: Annotated[
        bool,
        typer.Option("--any-bits", help="Go on although the processor, Numba or the kernels have changed.", metavar=""),
    ] = False,
    as_json: Json = False,
    wall_time: WallTime = None,
    heartbeat: Beat = None,
) -> None:
    """Complete an interrupted run, bit for bit, or extend a finished one.

    Example: orbits resume results/solar_system/run.h5 --until '2000 yr'
    """
    with guarded():
        from orbits.errors import with_unit
        from orbits.propagation import resume as go_on
        from orbits.scenario.typed import number_or_text

        again = f"orbits resume {shlex.quote(str(file))}"
        pacing = command.paced(wall_time, heartbeat)
        done = go_on(
            file,
            until=None if until is None else number_or_text(until),
            same_bits=not any_bits,
            heartbeat=pacing.heartbeat,
            wall_time=pacing.deadline,
        )
        if until is None and done.statistics is None:
            further = with_unit(f"{2 * done.span[1]:g}", done.system.units.time)
            text = f"complete already, nothing was done; extend it with  {again} --until '{further}'"
            stderr().print(text, markup=False, soft_wrap=True)
        show(file, done, as_json)
        if pacing.deadline is not None and pacing.deadline.ended(done):
            raise OutOfTime(f"{pacing.deadline.words}; go on with: {again}")


def warm_up(
    scenarios: Annotated[
        list[str] | None,
        typer.Argument(metavar="[SCENARIO]...", help="Scenarios whose runs to compile for, instead of everyday calls."),
    ] = None,
    everything: Annotated[
        bool, typer.Option("--all", help="Compile for all methods, which takes minutes.", metavar="")
    ] = False,
) -> None:
    """Compile what runs need before they need it, on all processors: for everyday calls, or for scenarios.

    Example: orbits warm-up solar_system kirkwood_gaps
    """
    with guarded():
        from orbits.scenario.warm_up import execute

        execute(scenarios or [], everything_else=everything)
