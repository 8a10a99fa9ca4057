"""What commands share: the arguments that name a scenario or an archive, and what is printed of an archive."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

ScenarioName = Annotated[str, typer.Argument(metavar="SCENARIO", help="Path of a file, or the name of a bundled one.")]
File = Annotated[Path, typer.Argument(metavar="FILE", help="An archive, such as results/solar_system/run.h5.")]


def show(file: Path, run: Any, as_json: bool) -> None:
    """Print what an archive has, and how far its run is."""
    from orbits.scenario.information import record, text

    print(json.dumps(record(file, run), indent=1) if as_json else text(file, run))
