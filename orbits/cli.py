"""The command line: `orbits run`, `resume`, `compare`, `certify`, `plot`, `info`, `ephemeris`, `list`.

Exit codes: 0 if all requirements hold, 1 if a check or a run fails, 2 for wrong use, 130 if stopped by Ctrl-C or
SIGTERM.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperOption

from orbits._version import __version__
from orbits.scenario import command
from orbits.scenario.command import Dt, Duration, Json, Method, NoPlot, Out, Samples, guarded

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
    out: Out = None,
    as_json: Json = False,
    no_plot: NoPlot = False,
) -> None:
    """Run a scenario: integrate, compare, check, draw.

    Example: orbits run kepler --duration 200 --out results/short
    """
    with guarded():
        from orbits.scenario import load

        changed = command.changed(load(scenario), dt, duration, integrator, samples)
        raise typer.Exit(command.execute(changed, out=out, as_json=as_json, no_plot=no_plot))


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
) -> None:
    """Complete an interrupted run, bit for bit, or extend a finished one.

    Example: orbits resume results/solar_system/run.h5 --until '2000 yr'
    """
    with guarded():
        from orbits.errors import with_unit
        from orbits.propagation import resume as go_on
        from orbits.scenario.typed import number_or_text

        done = go_on(file, until=None if until is None else number_or_text(until), same_bits=not any_bits)
        if until is None and done.statistics is None:
            further = with_unit(f"{2 * done.times[-1]:g}", done.system.units.time)
            text = f"complete already, nothing was done; extend it with  orbits resume {file} --until '{further}'"
            command.stderr().print(text, markup=False, soft_wrap=True)
        _show(file, done, as_json)


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
        raise typer.Exit(
            _compare(scenario, against, (dt, duration, integrator, samples), out=out, as_json=as_json, no_plot=no_plot)
        )


@app.command()
def certify(
    scenario: ScenarioName,
    dt: Annotated[
        str | None, typer.Option(help="Another step: '6 d', or a number in the problem's unit of time.", metavar="TIME")
    ] = None,
    integrator: Method = None,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Measure on the problems of a scenario whether its methods are the variational integrators they declare to be.

    The tables go to standard output and into certificate.json. Controls such as RK4, which declare nothing, are shown
    and not judged, unless --integrator asks for one.

    Example: orbits certify kepler --integrator "gauss(stages=4)" --dt 0.05
    """
    with guarded():
        from orbits.scenario import load

        raise typer.Exit(command.certify(load(scenario), dt, integrator, out=out, as_json=as_json))


@app.command()
def plot(
    file: File,
    out: Annotated[
        Path | None, typer.Option(help="Where to write the PNG; beside FILE by default.", metavar="PICTURE")
    ] = None,
) -> None:
    """Draw the run in an archive: paths, energy, angular momentum.

    Example: orbits plot results/solar_system/run.h5 --out solar_system.png
    """
    with guarded():
        from orbits.plotting import save
        from orbits.scenario.files import picture_path, replaceable
        from orbits.trajectory import Trajectory

        run = Trajectory.open(file)
        target = replaceable(picture_path(out or file.with_suffix(".png")))
        save(run.plot(), target)
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
def ephemeris(
    file: File,
    body: Annotated[
        list[str] | None, typer.Option(help="A body to look at, again for more; all by default.", metavar="NAME")
    ] = None,
    observer: Annotated[
        str,
        typer.Option(
            help="A body, 'barycentre', or a place on the Earth: degrees east, degrees north, metres, with commas.",
            metavar="WHERE",
        ),
    ] = "Earth",
    start: Annotated[
        str | None,
        typer.Option("--from", help="First time: '2026-01-01' or '10 d'; by default the samples.", metavar="TIME"),
    ] = None,
    stop: Annotated[str | None, typer.Option("--to", help="Last time.", metavar="TIME")] = None,
    step: Annotated[str | None, typer.Option(help="From time to time: '1 d'.", metavar="TIME")] = None,
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
                "scenarios": [{"name": s.name, "summary": s.summary, "path": str(s.path)} for s in bundled()],
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
            table.add_row(each.name, each.summary)
        console.print(table)
        console.print()
        table = Table("integrator", "order", "declares", "what it is", box=None, header_style="bold")
        for m in methods:
            table.add_row(m.name, str(m.order), ", ".join(sorted(m.declares)) or "nothing", m.summary)
        console.print(table)


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
        cases = scenario.cases()
    for case, system in cases.items():
        title, suffix = (f"{scenario.title}: {case}", f"-{slug(case)}") if case else (scenario.title, "")
        if kernels:
            for found in _residuals(scenario, system, kernels, title):
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
            dt=scenario.dt,
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
        print(json_text({"scenario": scenario.name, "ok": ok, "cases": records}))
    return 0 if ok else 1


def _residuals(scenario: Any, system: Any, kernels: list[str], title: str) -> Iterator[Any]:
    """Yield how far the runs of a scenario's methods on one system are from ephemerides."""
    from astropy import units as u

    from orbits.propagation.run import propagated
    from orbits.regression.of_ephemeris import check_covered, residuals
    from orbits.time_grid import TimeGrid

    grid = TimeGrid.of(system, scenario.dt, duration=scenario.duration, samples=scenario.samples)
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
