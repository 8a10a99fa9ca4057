"""Commands that judge methods: `compare`, beside REBOUND's or against an ephemeris, and `certify`."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperOption

from orbits.cli.arguments import ScenarioName
from orbits.scenario import command
from orbits.scenario.command import Dt, Duration, Json, Method, NoPlot, Out, Own, Samples, guarded
from orbits.scenario.printed import stdout


class Comparing(TyperCommand):
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
    console, ok = stdout(), True
    records: dict[str, dict[str, Any]] = {}
    with located():
        cases, step = scenario.cases(), scenario.step()
    for case, system in cases.items():
        title, suffix = (f"{scenario.headline()}: {case}", f"-{slug(case)}") if case else (scenario.headline(), "")
        if kernels:
            for found in _residuals(scenario, step, system, kernels, title):
                first, kept = f"residuals-{found.stem}{suffix}", records.setdefault(case, {})
                stem, number = first, 1
                while stem in kept:  # files of one name in two folders
                    number += 1
                    stem = f"{first}-{number}"
                kept[stem] = found.record()
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

    from orbits.propagation.making_runs import propagated
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
