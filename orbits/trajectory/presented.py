"""How a run is shown: its line of text, its table in a notebook, and its axes for other packages."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from orbits.body_names import few
from orbits.errors import with_unit
from orbits.export import Labelled, html_pairs
from orbits.marching.clocks.variable_steps import ChangingSteps
from orbits.system.presenting import labelled_run, span
from orbits.trajectory.parts import as_array
from orbits.units import date_text

if TYPE_CHECKING:
    from orbits.trajectory.trajectory import Trajectory


def as_table(run: Trajectory) -> str:
    """Return the table of a run in a notebook, as HTML."""
    epoch = run.system.epoch
    begun = "none" if epoch is None else f"{date_text(epoch, between='T')} TDB"
    pairs = {"bodies": few(run.names), "epoch": begun}
    pairs |= {"units": run.system.units.name}
    if run._stopped is not None:
        pairs |= {"stopped": run._stopped.reason}
    elif run.archive is not None and run.archive.ended.how:
        pairs |= {run.archive.ended.how: run.archive.ended.why}
    if len(run.retired):
        pairs |= {"retired": few(run.retired.names)}
    if run.excursions.total:
        pairs |= {"excursions": f"{run.excursions.total:,}"}
    if run.statistics is not None:
        pairs |= {"steps": f"{run.statistics.steps:,} in {run.statistics.wall_time:.3g} s"}
    if run._kept is not None:
        pairs |= {"dense output": f"from {len(run._kept):,} states"}
    if run.certificate is not None:
        pairs |= {"certificate": "holds" if run.certificate.ok else "; ".join(run.certificate.failures)}
    return html_pairs(repr(run), pairs.items())


def as_line(run: Trajectory) -> str:
    """Return a run in one line."""
    where = f", in {run.path}" if run.path else ""
    state = "" if run.complete else ", incomplete"
    gone = {"merged": _merged(run), "retired": len(run.retired)}
    lost = ", ".join(f"{count:,} {how}" for how, count in gone.items() if count)
    lost = f" ({lost})" if lost else ""
    bodies = f"{len(run.names)} bod{'y' if len(run.names) == 1 else 'ies'}"
    what = f"{bodies}{lost}, {len(run)} sample{'s' * (len(run) != 1)}, {span(run.t)}"
    if run._reached != run._last_time and (run.complete or run._has_stopped):
        what += f" of a run to {with_unit(f'{run._reached:.6g}', run.system.units.time)}"
    if count := run.excursions.total:
        what += f", {count:,} excursion{'s' * (count > 1)} from the map"
    return f"Trajectory({what}; {run.made_by}{state}{where})"


def _merged(run: Trajectory) -> int:
    """Return how many massive bodies are gone by the end of the run, or the last of these samples."""
    if run.changes is None:
        return 0
    end = run.changes.bodies_at(run._last_time if run._span is None else run._span[1])
    return int((run.system.massive & ~end.present).sum())


def labelled(run: Trajectory, bodies: Sequence[str] | None) -> Labelled:
    """Return a run with names and units of its axes, for tables and xarray; all bodies by default."""
    known: dict[str, str | float] = {"integrator": run.integrator.label}
    if isinstance(run.clock, ChangingSteps):
        known["steps"] = run.clock.describe(run.integrator)
    elif not math.isnan(run.step):
        known["dt"] = abs(run.step)
    over = None
    if run.changes is not None and len(run.legs) > 1:
        bodies_then = run.changes.over(run.times)
        massless = ~run.system.massive  # those that are retired keep the radius that they had
        over = tuple(np.where(bodies_then.present | massless, x, np.nan) for x in bodies_then[1:])
    samples = as_array(run._q), as_array(run._v)
    found = labelled_run(run.system, run.times, *samples, bodies, known, over)
    if not run.system.rigid or run._own_accounts() is None:
        return found
    return replace(found, variables={**found.variables, **run.rotation.labelled(found.names)})
