"""Which passages of a run spoilt the rest of it."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from orbits.errors import StepWarning
from orbits.propagation.approach import Approach
from orbits.propagation.guidance import UNRESOLVED, passage_error, step_that_resolves, with_unit
from orbits.propagation.passage_effect import GROWTH, NEGLIGIBLE, effect

if TYPE_CHECKING:
    from orbits.propagation.passages_seen import Passage, Seen
    from orbits.trajectory import Trajectory

MOST_JUDGED = 2000
"""Passages that are marched one by one; of more, those that may be the worst: a few seconds."""

SHOWN = 5
"""Passages that a warning names."""


def error_at_end(run: Trajectory, seen: Seen, passage: Passage) -> float | None:
    """Return the position error at the end of a run that a passage causes, in the unit of length; None if unknown."""
    pair = passage.pair(run.system, seen.dominant)
    if pair is None:
        return None
    end = _end(run)
    return effect(run.integrator, run.step, pair, end - passage.step * run.step, end).error


def spoiling(run: Trajectory, seen: Seen) -> list[tuple[int, float]]:
    """Return the numbers of the passages that spoil the rest of a run, with the error at its end, worst first.

    Those are judged whose states are known, at most `MOST_JUDGED`.
    """
    end = _end(run)
    bounds = {k: bound for k in range(len(seen.passages)) if (bound := _most(run, seen, seen.passages[k], end)) > 0.0}
    found = []
    for k in sorted(bounds, key=lambda k: -bounds[k])[:MOST_JUDGED]:
        passage = seen.passages[k]
        pair = passage.pair(run.system, seen.dominant)
        assert pair is not None
        caused = effect(run.integrator, run.step, pair, end - passage.step * run.step, end)
        if math.isfinite(caused.usual):
            spoils = caused.spoils
        else:
            share, turn = passage_error(run.integrator, *pair.shape(run.step))
            spoils = share > UNRESOLVED and share * turn > NEGLIGIBLE and caused.error > caused.noticeable
        if spoils:
            found.append((k, caused.error))
    return sorted(found, key=lambda pair: -pair[1])


def warn_of(run: Trajectory, seen: Seen, found: Sequence[tuple[int, float]]) -> None:
    """Warn, with `StepWarning`, of passages that spoilt a run, and name the step that would have resolved them."""
    if not found:
        return
    end, enough = _end(run), math.inf
    lines: list[str] = []
    pairs: set[frozenset[int]] = set()
    for k, error in found:
        passage = seen.passages[k]
        named = frozenset((passage.body, passage.other))
        if named in pairs or len(lines) == SHOWN:
            continue
        pairs.add(named)
        pair = passage.pair(run.system, seen.dominant)
        assert pair is not None
        orbit, sharp = pair.orbit, passage
        if abs(pair.ahead) <= 2.0 * abs(run.step) and math.isfinite(orbit.speed):
            steps = passage.step + pair.ahead / run.step
            sharp = replace(passage, distance=orbit.least, speed=orbit.speed, steps=steps)
        lines.append(f"  {Approach.of(run.system, run.step, sharp, error)}.")
        enough = min(enough, step_that_resolves(run.integrator, run.step, pair, end - passage.step * run.step, end))
    unit = run.system.units.time
    more = f"\n  And {len(found) - len(lines):,} more, in run.unresolved()." if len(found) > len(lines) else ""
    remedy = f"With dt <= {with_unit(enough, unit, 2)} {'it' if len(lines) == 1 else 'these'} would have been resolved"
    if not enough:
        remedy = "No step that is practical resolves them with this method: use one of higher order, or a softening"
    count = f"{'at least ' * (len(found) >= MOST_JUDGED)}{len(found):,} close passage{'s' * (len(found) > 1)}"
    warnings.warn(
        f"{run.integrator.label} with dt = {with_unit(abs(run.step), unit, 6)} did not resolve {count}; the rest of "
        "the run is not to be trusted for these bodies:\n"
        + "\n".join(lines)
        + f"{more}\n{remedy}.",
        StepWarning,
        stacklevel=4,
    )


def _most(run: Trajectory, seen: Seen, passage: Passage, end: float) -> float:
    """Return a bound for the error at the end of the run that a passage causes; 0 for one that cannot spoil it."""
    pair = passage.pair(run.system, seen.dominant)
    if pair is None:
        return 0.0
    e, angle = pair.shape(run.step)
    left = abs(end - passage.step * run.step) + abs(run.step)
    around = pair.other_q + pair.q if pair.other_q.any() else pair.q
    worth = 0.1 * NEGLIGIBLE * float(np.linalg.norm(around))
    turn = passage.speed * min(2.0, 2.0 / max(e, 1e-300))
    if not GROWTH * turn * left > worth:
        return 0.0
    share, turned = passage_error(run.integrator, e, angle)
    bound = GROWTH * pair.share * share * turned * passage.speed * left
    return bound if bound > worth else 0.0


def _end(run: Trajectory) -> float:
    """Return the time at which a run ended."""
    if run.stopped is not None:
        return float(run.stopped.time.value)
    return float(run.times[-1]) if len(run.times) else 0.0
