"""The command line: `orbits run`, `resume`, `compare`, `certify`, `plot`, `info`, `verify`, `ephemeris`, `ensemble`,
`view`, `warm-up`, `list`.

Exit codes: 0 if all requirements hold, 1 if a check or a run fails, 2 for wrong use, 75 if the wall time is over, 130
if stopped by Ctrl-C or SIGTERM.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperOption

from orbits._version import __version__
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

app = typer.Typer(
    name="orbits",
    help="Variational integrators for gravitational N-body problems: run scenarios, compare with REBOUND.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)

ScenarioName = Annotated[str, typer.Argument(metavar="SCENARIO", help="Path of a file, or the name of a bundled one.")]
File = Annotated[Path, typer.Argument(metavar="FILE", help="An archive, such as results/kepler/run.h5.")]


def main() -> None:
    """Entry point of the console script."""
    with guarded():
        app()


@app.callback(invoke_without_command=True)
def _version(
    version: Annotated[bool, typer.Option("--version", help="Print the version.", metavar="")] = False,
) -> None:
    if version:
        print(f"orbits {__version__}")
        raise typer.Exit


@app.command()
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

        changed = command.changed(load(scenario), dt, duration, integrator, samples, own, approaches)
        if list_options:
            command.show_options(changed, as_json=as_json)
            return
        code = command.execute(
            changed, out=out, as_json=as_json, no_plot=no_plot, wall_time=wall_time, heartbeat=heartbeat
        )
        raise typer.Exit(code)


@app.command()
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

        pacing = command.paced(wall_time, heartbeat)
        done = go_on(
            file,
            until=None if until is None else number_or_text(until),
            same_bits=not any_bits,
            heartbeat=pacing.heartbeat,
            wall_time=pacing.deadline,
        )
        if until is None and done.statistics is None:
            further = with_unit(f"{2 * done.times[-1]:g}", done.system.units.time)
            text = f"complete already, nothing was done; extend it with  orbits resume {file} --until '{further}'"
            command.stderr().print(text, markup=False, soft_wrap=True)
        _show(file, done, as_json)
        if pacing.deadline is not None and pacing.deadline.ended(done):
            raise OutOfTime(f"{pacing.deadline.words}; go on with: orbits resume {file}")


class _ListsPeers(TyperCommand):
    """`compare`; its help gets the list of peers when it is shown, as the module that has them is slow to load."""

    def get_params(self, ctx: Any) -> Any:
        """Return the options, that of the peers with its help."""
        from orbits.regression.peer_choice import PEERS

        params = super().get_params(ctx)
        for option in params:
            if isinstance(option, TyperOption) and option.name == "against":
                option.help = (
                    f"Peers, with commas: {', '.join(PEERS)}; with options after a colon: "
                    "whfast:kernel=lazy,corrector=17. And ephemerides: de440, or the path of an SPK kernel, FILE.bsp."
                )
        return params


@app.command(cls=_ListsPeers)
def compare(
    scenario: ScenarioName,
    against: Annotated[str | None, typer.Option(help="Peers, with commas.", metavar="PEERS")] = None,
    dt: Dt = None,
    duration: Duration = None,
    integrator: Method = None,
    samples: Samples = None,
    own: Own = None,
    out: Out = None,
    as_json: Json = False,
    no_plot: NoPlot = False,
) -> None:
    """Compare the methods of a scenario with REBOUND's on its systems, or its runs with an ephemeris; tables, JSON and
    pictures.

    Example: orbits compare solar_system --against whfast:kernel=lazy,corrector=17,ias15 --duration '100 yr', or with
    --against de440
    """
    with guarded():
        typed = dt, duration, integrator, samples, own
        raise typer.Exit(_compare(scenario, against, typed, out=out, as_json=as_json, no_plot=no_plot))


@app.command()
def certify(
    scenario: ScenarioName,
    dt: Annotated[
        str | None, typer.Option(help="Another step: '6 d', or a number in the problem's unit of time.", metavar="TIME")
    ] = None,
    integrator: Method = None,
    own: Own = None,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Measure on the problems of a scenario whether its methods are the variational integrators they declare to be.

    The tables go to standard output and into certificate.json.

    Controls such as RK4, which declare nothing, are shown and not judged, unless --integrator asks for one.

    Example: orbits certify kepler --integrator "gauss(stages=4)" --dt 0.05
    """
    with guarded():
        from orbits.scenario import load

        chosen = command.with_own(load(scenario), own)
        raise typer.Exit(command.certify(chosen, dt, integrator, out=out, as_json=as_json))


@app.command()
def plot(
    file: File,
    out: Annotated[
        Path | None, typer.Option(help="Where to write the PNG; beside FILE by default.", metavar="PICTURE")
    ] = None,
    kind: Annotated[
        str,
        typer.Option(
            help="What to draw: paths, the orbits from above and the changes of energy and angular momentum; elements, "
            "against time; phase, eccentricities with the directions of pericentres; resonance, its angle (give "
            "--resonance 3:1, say); error, the growth of errors; energy, its changes with their signs; or rotation, of "
            "a rigid body.",
            metavar="KIND",
        ),
    ] = "paths",
    body: Annotated[
        list[str] | None,
        typer.Option(
            help="Name of a body to draw; again for more: --body Mercury --body Venus. All by default; `orbits info "
            "FILE` has the names.",
            metavar="NAME",
        ),
    ] = None,
    elements: Annotated[
        str | None,
        typer.Option(
            help="For the kind elements: which ones, with commas; by default a,e,inc. Others are q, Omega, omega, "
            "pomega, M, l, f, n, P, h, k, ix and iy. Angles are drawn in degrees.",
            metavar="NAMES",
        ),
    ] = None,
    resonance: Annotated[
        str | None,
        typer.Option(
            help="For the kind resonance: 3:1 if the body's year is a third of the planet's, 2:3 if it is three halves "
            "of it, 1:1 for a Trojan.",
            metavar="P:Q",
        ),
    ] = None,
    planet: Annotated[
        str | None,
        typer.Option(
            help="For the kind resonance: the planet, such as Jupiter; the heaviest one by default.", metavar="NAME"
        ),
    ] = None,
    primary: Annotated[
        str | None,
        typer.Option(
            help="For the kinds elements, phase, resonance and rotation: the body that is orbited, such as Sun; the "
            "heaviest one by default.",
            metavar="NAME",
        ),
    ] = None,
) -> None:
    """Draw the run in an archive: paths and conserved quantities, or another kind of picture.

    Example: orbits plot results/solar_system/run.h5 --kind elements --body Mercury --out mercury.png
    """
    with guarded():
        from orbits.errors import InputError
        from orbits.plotting import save
        from orbits.scenario.files import picture_path, replaceable
        from orbits.trajectory import Trajectory

        run = Trajectory.open(file)
        own = file.with_suffix(".png") if kind == "paths" else file.with_name(f"{file.stem}-{kind}.png")
        target = replaceable(picture_path(out or own))
        given = {"bodies": body or None, "resonance": resonance, "planet": planet, "primary": primary}
        if kind == "rotation":
            if len(body or []) > 1:
                raise InputError(f"a picture of a rotation is that of one body; got {', '.join(body or [])}.")
            given = {"body": body[0] if body else None, "about": primary, "resonance": resonance, "planet": planet}
        given["elements"] = None if elements is None else [name.strip() for name in elements.split(",")]
        save(run.plot(kind, **{name: value for name, value in given.items() if value is not None}), target)
        print(f"wrote {target}")


@app.command()
def info(file: File, as_json: Json = False) -> None:
    """Show the contents of an archive and the progress of its run.

    Example: orbits info results/kepler/run.h5 --json
    """
    with guarded():
        from orbits.trajectory import Trajectory

        _show(file, Trajectory.open(file), as_json)


@app.command()
def verify(
    file: File,
    recompute: Annotated[
        str,
        typer.Option(
            help="What is integrated again: the last stretch, of ten seconds at most; all; or none.",
            metavar="last|all|none",
        ),
    ] = "last",
    as_json: Json = False,
) -> None:
    """Check an archive: checksums, times, numbers, and that the run gives the same bits when it is integrated again.

    Example: orbits verify results/solar_system/run.h5 --recompute all
    """
    with guarded():
        from orbits.propagation.resuming.verification import verify as check

        found = check(file, recompute=recompute)  # type: ignore[arg-type]
        print(json.dumps(found.record(), indent=1) if as_json else found)
        raise typer.Exit(0 if found.ok else 1)


@app.command()
def ephemeris(
    file: File,
    body: Annotated[
        list[str] | None, typer.Option(help="A body to look at, again for more; all by default.", metavar="NAME")
    ] = None,
    observer: Annotated[
        str,
        typer.Option(
            help="A body, 'barycentre', the code of an observatory, such as 568, or a place on the Earth: degrees "
            "east, degrees north, metres, with commas, as in -70.7366,-30.2407,2663.",
            metavar="WHERE",
        ),
    ] = "Earth",
    start: Annotated[
        str | None,
        typer.Option(
            "--from",
            help="First time, or the only one: a date, '2026-01-01' or '2026-01-01T12:00', or a time since the epoch, "
            "'10 d'. Without it, the times are those of the samples.",
            metavar="TIME",
        ),
    ] = None,
    stop: Annotated[
        str | None, typer.Option("--to", help="Last time, as --from; it needs --step.", metavar="TIME")
    ] = None,
    step: Annotated[
        str | None,
        typer.Option(
            help="Time from one row of a body to the next, between --from and --to: '1 d', '10 min', or a number in "
            "the run's unit of time.",
            metavar="TIME",
        ),
    ] = None,
    utc: Annotated[bool, typer.Option("--utc", help="Dates are in UTC instead of TDB.", metavar="")] = False,
    h: Annotated[float | None, typer.Option("--h", help="Absolute magnitude of the body.", metavar="NUMBER")] = None,
    g: Annotated[float | None, typer.Option("--g", help="Its slope parameter G.", metavar="NUMBER")] = None,
    as_json: Json = False,
) -> None:
    """Print what an observer sees of the bodies of an archive: places, distances, angles, magnitudes.

    Example: orbits ephemeris run.h5 --body Mars --from 2026-01-01 --to 2026-02-01 --step '1 d'
    """
    with guarded():
        from orbits.propagation import Trajectory
        from orbits.scenario.ephemerides import record, typed_observer, typed_times

        run = Trajectory.open(file)
        times = typed_times(run, start, stop, step, utc=utc)
        table = run.ephemeris(body or None, typed_observer(observer), times, H=h, G=g)
        print(json.dumps(record(table), indent=1) if as_json else table.text())


@app.command()
def ensemble(
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
            help="Whether the table has the closest approach of each member, as by default. The search for it takes 10 "
            "to 50 % of the time of particles in a map.",
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
            if own:
                from orbits.errors import InputError

                raise InputError(f"--set {own[0]}: {what} is a campaign, which has its options; leave --set out.")
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


@app.command()
def view(
    file: File,
    output: Annotated[
        Path | None,
        typer.Option(help="Write a self-contained page for disk instead, and serve nothing.", metavar="PAGE"),
    ] = None,
    port: Annotated[
        int, typer.Option(help="Port of this machine for the page; a free one by default.", metavar="NUMBER")
    ] = 0,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Print the address, and open no browser.", metavar="")
    ] = False,
    limit: Annotated[
        float,
        typer.Option(
            help="The most megabytes of samples in the page. Of a larger run every second, third, ... sample is kept, "
            "and fewer massless particles where that is not enough; the page says so. More: --limit 200.",
            metavar="MB",
        ),
    ] = 48.0,
) -> None:
    """Look at the run in an archive in the browser, in three dimensions; follow it while it grows. Ctrl-C ends it.

    Example: orbits view results/solar_system/run.h5, or with --output solar_system.html
    """
    with guarded():
        from orbits.viewing.command import serve, write

        if output is None:
            serve(file, port=port, browser=not no_browser, limit=limit)
        else:
            print(f"wrote {write(file, output, limit=limit)}")


@app.command("warm-up")
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


@app.command("list")
def list_(as_json: Json = False) -> None:
    """List the bundled scenarios, and the integrators with the properties they declare.

    Example: orbits list --json
    """
    with guarded():
        from orbits import integrators
        from orbits.scenario import bundled

        methods = [cls() for _, cls in sorted(integrators.registry().items())]
        if as_json:
            record = {
                "scenarios": [
                    {"name": s.name, "summary": s.summary, "path": str(s.path), "options": list(s.options)}
                    for s in bundled()
                ],
                "integrators": [
                    {
                        "name": m.name,
                        "label": m.label,
                        "order": m.order,
                        "declares": sorted(m.declares),
                        "summary": m.summary,
                        "source": m.source,
                    }
                    for m in methods
                ],
            }
            print(json.dumps(record, indent=1))
            return
        from rich.console import Console
        from rich.table import Table

        console = Console(highlight=False)
        table = Table("scenario", "what it shows", box=None, header_style="bold")
        for each in bundled():
            options = f"; options: {', '.join(each.options)}" if each.options else ""
            table.add_row(each.name, each.summary + options)
        console.print(table)
        console.print()
        table = Table("integrator", "order", "declares", "what it is", box=None, header_style="bold")
        for m in methods:
            table.add_row(m.name, str(m.order), ", ".join(sorted(m.declares)) or "nothing", m.summary)
        console.print(table)


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


def _compare(
    name: str, against: str | None, typed: tuple[Any, ...], *, out: Path | None, as_json: bool, no_plot: bool
) -> int:
    from orbits.errors import InputError
    from orbits.json_text import json_text
    from orbits.regression import compare as compare_methods
    from orbits.regression.of_ephemeris import split
    from orbits.scenario import load
    from orbits.scenario.definition import slug
    from orbits.scenario.files import replaceable, results_folder, write_text
    from orbits.scenario.loading import located
    from orbits.scenario.study import Study

    scenario = command.changed(load(name), *typed)
    if isinstance(scenario, Study):
        raise InputError(f"{scenario.name!r} is a study, which has no system to compare on; use: orbits run {name}")
    peers, kernels = (scenario.against, []) if against is None else split(against)
    folder = results_folder(out or Path("results") / scenario.name)
    console, ok = command.stdout(), True
    records: dict[str, dict[str, Any]] = {}
    with located():
        cases, step = scenario.cases(), scenario.step()
    for case, system in cases.items():
        title, suffix = (f"{scenario.headline()}: {case}", f"-{slug(case)}") if case else (scenario.headline(), "")
        if kernels:
            for found in _residuals(scenario, step, system, kernels, title):
                stem = f"residuals-{found.stem}{suffix}"
                records.setdefault(case, {})[stem] = found.record()
                if not as_json:
                    print(found)
                if not no_plot:
                    found.plot(replaceable(folder / f"{stem}.png"))
                write_text(folder / f"{stem}.json", found.to_json() + "\n")
        if kernels and not peers:
            continue
        report = compare_methods(
            system,
            list(scenario.integrators),
            dt=step,
            duration=scenario.duration,
            samples=scenario.samples,
            against=peers,
            tolerances=scenario.demands() or None,
            title=title,
        )
        ok = ok and report.ok
        stem = f"comparison{suffix}"
        records.setdefault(case, {}).update(json.loads(report.to_json()))
        if not as_json:
            console.print(report)
        if not no_plot:
            report.plot(replaceable(folder / f"{stem}.png"))
        write_text(folder / f"{stem}.json", report.to_json() + "\n")
    if as_json:
        options = {"options": scenario.chosen} if scenario.options else {}
        print(json_text({"scenario": scenario.name, **options, "ok": ok, "cases": records}))
    return 0 if ok else 1


def _residuals(scenario: Any, step: Any, system: Any, kernels: list[str], title: str) -> Iterator[Any]:
    """Yield how far the runs of a scenario's methods on one system are from ephemerides."""
    from astropy import units as u

    from orbits.propagation.run import propagated
    from orbits.regression.of_ephemeris import check_covered, residuals
    from orbits.time_grid import TimeGrid

    grid = TimeGrid.of(system, step, duration=scenario.duration, samples=scenario.samples)
    days = grid.times * system.units.time.to(u.day) if system.units.is_physical else grid.times
    for kernel in kernels:
        check_covered(system, kernel, days)  # before the long runs
    for method in scenario.integrators:
        run = propagated(system, method, grid)
        for kernel in kernels:
            yield residuals(run, kernel, title=title)


def _show(file: Path, run: Any, as_json: bool) -> None:
    from orbits.scenario.information import record, text

    print(json.dumps(record(file, run), indent=1) if as_json else text(file, run))
