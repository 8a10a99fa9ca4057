"""The command `ensemble`: many members in blocks, as a plan or a scenario names them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from orbits.scenario import command
from orbits.scenario.command import Dt, Duration, Json, Own, Samples, guarded

TYPED = "COMMANDLINE"
"""Typer's name for the source of an option that was typed."""


def ensemble(
    context: typer.Context,
    what: Annotated[
        str,
        typer.Argument(
            metavar="WHAT",
            help="A Python file that defines `plan`; a scenario, for its massless particles or its cases; or the "
            "folder of a campaign, to look at it.",
        ),
    ],
    out: Annotated[
        Path | None, typer.Option(help="Folder of the campaign; NAME.campaign by default.", metavar="FOLDER")
    ] = None,
    dt: Dt = None,
    duration: Duration = None,
    integrator: Annotated[
        str | None,
        typer.Option(
            help="Method instead of that of the plan or the scenario: gauss, 'gauss(stages=4)', wisdom-holman. `orbits "
            "list` has all.",
            metavar="METHOD",
        ),
    ] = None,
    samples: Samples = None,
    approaches: Annotated[
        bool | None,
        typer.Option(
            "--approaches/--no-approaches",
            help="Whether the table has the closest approach of each member, as by default. The search for it takes "
            "some 5 % of the time of particles in a map.",
            metavar="",
        ),
    ] = None,
    own: Own = None,
    block: Annotated[
        int | None,
        typer.Option(
            help="Number of members that are integrated together; by default so many that what a block costs besides "
            "is little.",
            metavar="NUMBER",
        ),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(help="Number of threads; all processors by default.", metavar="NUMBER")
    ] = None,
    processes: Annotated[bool, typer.Option("--processes", help="Processes instead of threads.", metavar="")] = False,
    scheduler: Annotated[
        str | None, typer.Option(help="A Dask cluster instead: tcp://host:8786.", metavar="ADDRESS")
    ] = None,
    megno: Annotated[
        bool,
        typer.Option(
            "--megno",
            help="A column of the table with the MEGNO of each member: it tends to 2 for regular motion and grows "
            "with time for chaotic motion. Members are integrated once more for it.",
            metavar="",
        ),
    ] = False,
    table_only: Annotated[
        bool, typer.Option("--table-only", help="Keep the table of the members, and no samples.", metavar="")
    ] = False,
    retry: Annotated[
        bool, typer.Option("--retry", help="Try blocks again that could not be integrated.", metavar="")
    ] = False,
    as_json: Json = False,
) -> None:
    """Integrate many members in blocks, on all processors or a Dask cluster; results go into a folder as they come.

    The same command goes on after Ctrl-C, and a folder alone shows how far its campaign is, also while it runs.

    Example: orbits ensemble kirkwood_gaps --out belt.campaign --scheduler tcp://localhost:8786
    """
    with guarded():
        from orbits.ensemble import command as campaigns

        if (Path(what) / campaigns.ABOUT).is_file():
            given = {name: str(context.get_parameter_source(name)) for name in context.params}
            refused = [name for name, by in given.items() if by.endswith(TYPED) and name not in ("what", "as_json")]
            if refused:
                from orbits.errors import InputError

                option = "set" if refused[0] == "own" else refused[0].replace("_", "-")
                raise InputError(
                    f"{what} is the folder of a campaign, which is shown and not run: it takes no --{option}. To run "
                    "it, give its plan or scenario, and this folder as --out."
                )
            campaigns.show(Path(what), as_json)
            return
        from orbits.integrators import parse
        from orbits.scenario.typed import quantity, step_or_clock

        name, plan = _plan(what, own)
        plan = plan.changed(
            dt=None if dt is None else step_or_clock(dt, "--dt"),
            duration=None if duration is None else quantity(duration, "--duration"),
            integrator=None if integrator is None else parse(integrator),
            samples=samples,
            approaches=approaches,
            block=block,
            megno=True if megno else None,
            trajectories=False if table_only else None,
        )
        how = {"client": scheduler, "workers": workers, "processes": processes, "retry": retry}
        raise typer.Exit(campaigns.execute(plan, out or Path(f"{name}.campaign"), as_json=as_json, **how))


def _plan(what: str, own: list[str] | None) -> tuple[str, Any]:
    """Return the name and the plan of a campaign: that of a file, or of the members of a scenario."""
    from orbits.ensemble import Plan
    from orbits.ensemble import command as campaigns
    from orbits.errors import InputError, shown
    from orbits.scenario import load
    from orbits.scenario.definition import Scenario
    from orbits.scenario.loading import executed, located

    path = Path(what).expanduser()
    if path.suffix == ".py" and path.is_file():
        module = executed(path)
        plan = getattr(module, "plan", None)
        if isinstance(plan, Plan):
            if own:
                raise InputError(f"{path} defines a plan, which has no options: --set is for those of a scenario.")
            campaigns.send_by_value(module)
            return path.stem, plan
        if not hasattr(module, "scenario"):
            raise InputError(
                f"{path} defines neither `plan` nor `scenario`, plan being {shown(plan)}; expected a line such as: "
                "plan = orbits.ensemble.Plan(orbits.ensemble.particles(...), duration=..., dt=...)"
            )
    scenario = command.with_own(load(what), own)
    if not isinstance(scenario, Scenario):
        raise InputError(f"{scenario.name!r} is a study, which has no members; use: orbits run {what}")
    with located():
        cases, step = scenario.cases(), scenario.step()
    options = {"dt": step, "duration": scenario.duration, "samples": scenario.samples}
    options["approaches"] = scenario.approaches
    return scenario.name, campaigns.plan_of(cases, scenario.integrators[0], options)
