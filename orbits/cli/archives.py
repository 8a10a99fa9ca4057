"""Commands that read an archive: `plot`, `info`, `verify`, `ephemeris`, `view`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from orbits.cli.arguments import File, show
from orbits.scenario.command import Json, guarded


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
        from orbits.propagation import Trajectory
        from orbits.scenario.files import picture_path, replaceable

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


def info(file: File, as_json: Json = False) -> None:
    """Show the contents of an archive and the progress of its run.

    Example: orbits info results/solar_system/run.h5 --json
    """
    with guarded():
        from orbits.propagation import Trajectory

        show(file, Trajectory.open(file), as_json)


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
