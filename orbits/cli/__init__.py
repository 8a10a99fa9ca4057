"""The command line: `orbits run`, `resume`, `compare`, `certify`, `plot`, `info`, `verify`, `ephemeris`, `ensemble`,
`view`, `warm-up`, `list`.

Exit codes: 0 if all requirements hold, 1 if a check or a run fails, 2 for wrong use, 75 if the wall time is over, 130
if stopped by Ctrl-C or SIGTERM.
"""

from __future__ import annotations

from typing import Annotated

import typer

from orbits._version import __version__
from orbits.cli.archives import ephemeris, info, plot, verify, view
from orbits.cli.comparing import Comparing, certify, compare
from orbits.cli.ensembles import ensemble
from orbits.cli.listing import list_
from orbits.cli.running import resume, run, warm_up
from orbits.scenario.command import guarded

app = typer.Typer(
    name="orbits",
    help="Variational integrators for gravitational N-body problems: run scenarios, compare with REBOUND.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)


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


app.command()(run)
app.command()(resume)
app.command(cls=Comparing)(compare)
app.command()(certify)
app.command()(plot)
app.command()(info)
app.command()(verify)
app.command()(ephemeris)
app.command()(ensemble)
app.command()(view)
app.command("warm-up")(warm_up)
app.command("list")(list_)
