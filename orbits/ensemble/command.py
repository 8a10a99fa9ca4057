"""`orbits ensemble`: a campaign from the command line, and a look at one."""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from orbits.ensemble.campaign import WAITING, Campaign, open_campaign
from orbits.ensemble.members import Ensemble, particles, systems
from orbits.ensemble.plan import Plan
from orbits.ensemble.running import run
from orbits.ensemble.store import ABOUT as ABOUT
from orbits.ensemble.summaries import LOST, STOPPED, SURVIVED
from orbits.errors import OrbitsWarning
from orbits.integrators.base import Integrator
from orbits.json_text import json_text
from orbits.system import System

if TYPE_CHECKING:
    from rich.console import Console

REASONS = 8
"""The most different reasons that are shown."""


def plan_of(cases: Mapping[str, System], integrator: Integrator, options: Mapping[str, Any]) -> Plan:
    """Return the plan for a scenario: its massless particles, or else its cases, are the members."""
    (first, *others) = cases.values()
    ensemble: Ensemble
    if not others and not first.massive.all():
        ensemble = particles(first, first)
    else:
        ensemble = systems(cases.values(), names=[name or "system" for name in cases])
    given = {name: value for name, value in options.items() if value is not None}
    return Plan(ensemble, integrator=integrator, **given)


def send_by_value(module: ModuleType) -> None:
    """Let the functions of a file be sent to other processes, which do not have it, if Dask's cloudpickle is there."""
    try:
        importlib.import_module("cloudpickle").register_pickle_by_value(module)
    except ImportError:
        return


def execute(plan: Plan, folder: Path, *, as_json: bool, **how: Any) -> int:
    """Run a campaign, print what became of its members, and return the exit code: 1 if some could not be integrated."""
    console = _stderr()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", OrbitsWarning)
        campaign = run(plan, folder, **how, say=lambda text: console.print(text, markup=False, soft_wrap=True))
    for one in caught:
        console.print(f"mind: {one.message}", markup=False, soft_wrap=True)
    _print(campaign, as_json)
    return 1 if campaign.progress.members_failed else 0


def show(folder: Path, as_json: bool) -> None:
    """Print how far a campaign is, and what became of its members."""
    _print(open_campaign(folder), as_json)


def record(campaign: Campaign) -> dict[str, Any]:
    """Return a campaign as a record for JSON."""
    progress, table = campaign.progress, campaign.summary
    states, counts = np.unique(table["state"], return_counts=True)
    found = {
        "folder": str(campaign.folder),
        "made_by": table.meta["made_by"],
        "complete": progress.complete,
        "blocks": {"all": progress.blocks, "done": progress.done, "failed": progress.failed},
        "members": dict(zip(states.tolist(), counts.tolist(), strict=True)),
        "reasons": _reasons(table),
        "failed": {str(block): reason for block, reason in campaign.failed.items()},
        "seconds of work": round(progress.seconds, 3),
    }
    return found | ({"bits": campaign.bits} if progress.complete else {})


def _print(campaign: Campaign, as_json: bool) -> None:
    found = record(campaign)
    if as_json:
        print(json_text(found))
        return
    table = campaign.summary
    print(f"{found['made_by']}\n{campaign.progress}")
    told = {SURVIVED: "to the end", STOPPED: "stopped by an event or a condition", LOST: "lost on the way"}
    told[WAITING] = "of blocks that are not done yet"
    for state, count in found["members"].items():
        print(f"  {count:>10,}  {told.get(state, 'could not be integrated')}")
    for reason, count in list(found["reasons"].items())[:REASONS]:
        print(f"  {count:>10,}  {reason}")
    for name, what in (("e_max", "largest eccentricity"), ("megno", "MEGNO"), ("closest", "closest approach")):
        if name not in table.colnames:
            continue
        values = np.asarray(getattr(table[name], "value", table[name]), dtype=float)
        values = values[np.isfinite(values)]
        if len(values):
            unit = str(getattr(table[name], "unit", None) or "")
            low, middle, high = np.quantile(values, [0.0, 0.5, 1.0])
            print(f"  {what}: least {low:.4g}, median {middle:.4g}, largest {high:.4g} {unit}".rstrip())
    for block, reason in list(campaign.failed.items())[:REASONS]:
        print(f"  block {block} could not be integrated: {reason}")
    print(f"in {campaign.folder}: campaign = orbits.ensemble.open({str(campaign.folder)!r}), campaign.summary")


def _reasons(table: Any) -> dict[str, int]:
    """Return how many members ended for each reason, with figures left out, the most frequent first."""
    if "reason" not in table.colnames:
        return {}
    found: dict[str, int] = {}
    for text in table["reason"]:
        if text:
            found[str(text)] = found.get(str(text), 0) + 1
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def _stderr() -> Console:
    from rich.console import Console

    return Console(stderr=True, highlight=False)
