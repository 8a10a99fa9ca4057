"""Judgement of the passages of a run: those that spoilt the rest of it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from orbits.errors import RetiredWarning, StepWarning, counted
from orbits.finding import SHOWN, Finding
from orbits.integrators.base import SYMPLECTIC
from orbits.kernels.steps import IMPACT, NEAR_A_PLANET, NOT_RESOLVED
from orbits.marching.following.retirement import EJECTED, HIT, REASONS, TOO_CLOSE
from orbits.propagation.checks.kepler_splitting import encounters
from orbits.propagation.checks.leg_of_run import LegOfRun, listed_in
from orbits.propagation.checks.passage_effect import GROWTH, NEGLIGIBLE, Effect, effect
from orbits.propagation.checks.passing_pair import MOST_ANGLE, Pair
from orbits.propagation.checks.step_check import (
    UNRESOLVED,
    in_digits,
    passage_ahead,
    passage_error,
    seen_for,
    step_that_resolves,
    what_to_do,
)
from orbits.propagation.results.recording import observed_until
from orbits.propagation.results.refinement import refine
from orbits.results.approach import Approach, as_error, said

if TYPE_CHECKING:
    from orbits.results.passages import Passage, Seen
    from orbits.trajectory import Trajectory
    from orbits.trajectory.retired import RetiredParticle

LEAST_SHARE = 1e-3
"""Fraction of a noticeable error below which even a thousand passages of a pair have no noticeable effect together."""

ON_THE_SAFE_SIDE = 0.1
"""Passages of two bodies that are bound to each other are judged if the bounds of their errors come to this fraction of
what is noticeable at the pericentre, where they are closest."""

MOST_JUDGED = 300
"""The most passages that are marched one by one after a run, in a second; if there are more, the worst ones."""

FEW_STEPS = 20_000
"""The most steps that are marched again to state a passage in a warning to the accuracy of the orbit."""

AS_ASKED = REASONS[EJECTED], REASONS[TOO_CLOSE]
"""Reasons for which particles are retired because the method was told where."""

BEFORE_ENCOUNTERS = REASONS[NEAR_A_PLANET], REASONS[NOT_RESOLVED]
"""Reasons for which particles are retired before passages that a method cannot follow, if it was told to do so."""

HITS = REASONS[HIT].format("")
"""The beginning of the reason of one that hit a body."""


def error_at_end(run: Trajectory, seen: Seen, k: int) -> float | None:
    """Return the position error at the end of a run that passage k causes, in the unit of length; None if unknown."""
    if k not in seen.errors:
        caused = _effect(run, seen, k)
        seen.errors[k] = None if caused is None else caused.error
    return seen.errors[k]


def _effect(run: Trajectory | LegOfRun, seen: Seen, k: int, *, of_many: bool = False) -> Effect | None:
    """Return the effect of passage k on a run; of_many : what of it adds up to those of others of the pair."""
    if run.clock.changes or run.integrator.follows_kepler:  # these resolve all passages, or none of those listed
        return None
    passage, end = seen.judged(k), _end(run, seen)
    pair = Pair.of(passage, run.system, run.clock, seen.dominant)
    if pair is None:
        return None
    begun, h = run.clock.time(passage.step), _step(run, end)
    left = seen_for(run.integrator, h, pair, end - begun, end - begun) if of_many else end - begun
    return effect(run.integrator, h, pair, left, end, begun)


def _step(run: Trajectory | LegOfRun, end: float) -> float:
    """Return the step of a run, of which no more is taken than leads to its end."""
    return math.copysign(min(abs(run.step), abs(end)), run.step)


def spoiling(run: Trajectory | LegOfRun, seen: Seen, most: int | None = None) -> list[tuple[int, float]]:
    """Return the numbers of the passages that spoil the rest of a run, with the error at its end, worst first: those
    that spoil it individually, and those of a pair that do so together.

    Only passages with known states are judged; at most `most`, those that may be the worst.
    """
    if run.clock.changes:
        return []
    if run.integrator.follows_kepler:
        return [(k, math.nan) for k in encounters(run.system, run.integrator, run.step, seen, run.excursions)]
    end = _end(run, seen)
    bounds = _in_doubt(run, seen, end)
    judged: dict[frozenset[int], list[tuple[int, Effect]]] = {}
    for k in sorted(bounds, key=lambda k: -bounds[k])[:most]:
        caused = _effect(run, seen, k)
        assert caused is not None
        seen.errors[k] = caused.error
        judged.setdefault(_pair_of(seen, k), []).append((k, caused))
    found = []
    for effects in judged.values():
        errors, limit = [caused.error for _, caused in effects], max(caused.limit for _, caused in effects)
        if sum(errors) > limit and SYMPLECTIC in run.integrator.declares:
            adding = (_effect(run, seen, k, of_many=True) for k, _ in effects)
            errors = [caused.error for caused in adding if caused is not None]
        spoilt = sum(errors) > limit
        found += [(k, caused.error) for k, caused in effects if spoilt or _spoils(run, seen, k, caused)]
    return sorted(found, key=lambda pair: -pair[1])


def _in_doubt(run: Trajectory | LegOfRun, seen: Seen, end: float) -> dict[int, float]:
    """Return bounds of the errors at the end of a run that passages cause, but for those of pairs whose passages cannot
    cause a noticeable one together.
    """
    pairs: dict[frozenset[int], dict[int, float]] = {}
    least: dict[frozenset[int], float] = {}
    for k in range(len(seen.passages)):
        bound, noticed = _most(run, seen, seen.judged(k), end)
        if bound > 0.0:
            of = _pair_of(seen, k)
            pairs.setdefault(of, {})[k] = bound
            least[of] = min(least.get(of, math.inf), noticed)
    return {k: bound for of, bounds in pairs.items() if sum(bounds.values()) > least[of] for k, bound in bounds.items()}


def _spoils(run: Trajectory | LegOfRun, seen: Seen, k: int, caused: Effect) -> bool:
    """Return whether a single passage spoils a run; without a primary, whether its deflection is wrong."""
    if math.isfinite(caused.usual):
        return caused.spoils
    pair = Pair.of(seen.judged(k), run.system, run.clock, seen.dominant)
    assert pair is not None
    share, turn = passage_error(run.integrator, *pair.shape(_step(run, _end(run, seen))))
    return share > UNRESOLVED and share * turn > NEGLIGIBLE and caused.error > caused.noticeable


def _pair_of(seen: Seen, k: int) -> frozenset[int]:
    return frozenset((seen.passages[k].body, seen.passages[k].other))


def not_resolved(run: Trajectory | LegOfRun, seen: Seen) -> Iterator[Finding]:
    """Find passages that spoilt a run, and the step that would have resolved them."""
    most = run.most if isinstance(run, LegOfRun) else MOST_JUDGED
    found = spoiling(run, seen, most)
    if not found:
        return
    pairs: dict[frozenset[int], list[tuple[int, float]]] = {}
    for k, error in found:
        pairs.setdefault(_pair_of(seen, k), []).append((k, error))
    shown = list(pairs.values())[:SHOWN]
    if not isinstance(run, LegOfRun):
        refine(run, seen, [k for (k, _), *_ in shown if _is_close_to_a_sample(run, seen.passages[k])])
    rows = []
    for (k, error), *others in shown:
        together = said(as_error(run.system, error + sum(one for _, one in others)))
        more = f" ({len(others) + 1:,} passages, together up to {together})" if others else ""
        rows.append(f"{Approach.of(run.system, run.clock, seen.passages[k], error)}{more}")
    steps = [_enough(run, seen, [k for k, _ in passages]) for passages in _hardest(seen, list(pairs.values()))]
    if not isinstance(run, LegOfRun):
        ahead = passage_ahead(run.system, run.integrator, run.step, _end(run, seen))
        steps += [] if ahead is None else [ahead.enough]  # its own course may have been lost
    advice = what_to_do(run.system, run.integrator, min(steps), "it" if len(found) == 1 else "them")
    unit = run.system.units.time
    some = len(found) >= most or seen.left_out > 0
    yield Finding(
        f"{run.integrator.label} with dt = {in_digits(abs(run.step), unit, 6)} did not resolve {'at least ' * some}"
        f"{counted(len(found), 'close passage')}; the rest of the run is not to be trusted for these bodies:",
        StepWarning,
        "passages not resolved",
        rows,
        len(found) - sum(len(passages) for passages in shown),
        listed_in(run),
        f"{advice[0].upper()}{advice[1:]}.",
    )


def _hardest(seen: Seen, pairs: list[list[tuple[int, float]]]) -> list[list[tuple[int, float]]]:
    """Return the passages of the pairs that may need the shortest steps: those with the largest errors, and those that
    are the fastest for their distance.
    """

    def rate(passages: list[tuple[int, float]]) -> float:
        return max(seen.passages[k].speed / max(seen.passages[k].distance, 1e-300) for k, _ in passages)

    fastest = sorted(pairs[SHOWN:], key=rate, reverse=True)
    return [*pairs[:SHOWN], *fastest[:SHOWN]]


def _enough(run: Trajectory | LegOfRun, seen: Seen, numbers: list[int]) -> float:
    """Return a step with which no passage of a pair would spoil the run, nor all of them together; 0 if none is found.

    numbers : of the passages of the pair that did, worst first
    """
    end, steps = _end(run, seen), []
    for k in {numbers[0], min(numbers, key=lambda k: abs(seen.passages[k].step))}:
        passage = seen.passages[k]
        pair = Pair.of(passage, run.system, run.clock, seen.dominant)
        assert pair is not None
        left, count = end - run.clock.time(passage.step), 1 if pair.is_bound() else len(numbers)
        steps.append(step_that_resolves(run.integrator, _step(run, end), pair, left, end, count))
    return min(steps)


def lost(run: Trajectory) -> Iterator[Finding]:
    """Find the particles that were retired in a run, but for those that merged."""
    asked = [particle for particle in run.retired if particle.reason in AS_ASKED]
    met = [particle for particle in run.retired if particle.reason in BEFORE_ENCOUNTERS]
    hits = [particle for particle in run.retired if particle.reason.startswith(HITS)]
    without = "{whose} q and v are NaN from then on, and run[k] leaves {them} out."
    if asked:
        told = f"{run.integrator.label} retired {_count(asked)}, as asked: {_of(asked, without)}"
        yield _listed("retired as asked", asked, told)
    if met:
        yield _listed(
            "retired before encounters",
            met,
            f"{run.integrator.label} retired {_count(met)} before encounters that it cannot follow, as asked: "
            f"{_of(met, without)} All others are the same as without {_of(met, '{them}')}.",
            _of(met, "{They} can be run by {themselves} among the massive bodies without dt and method, by steps of ")
            + _of(met, "{whose} own."),
        )
    if hits:
        yield _listed("hit a body", hits, f"{_count(hits)} hit a body: {_of(hits, without)}")
    known = {one.name for one in (*asked, *met, *hits)}
    retired = [one for one in run.retired if one.name not in known and one.reason != REASONS[IMPACT]]
    if not retired:
        return
    unit = run.system.units.time
    if run.clock.changes:
        how = run.made_by
        remedy = "They meet a body there, as points do. Use softening, or end the run before."
    else:
        how = f"{run.integrator.label} with dt = {in_digits(abs(run.step), unit, 6)}"
        remedy = "Use a smaller dt for them (they can be run by themselves among the massive bodies), or softening."
    yield _listed(
        "cannot be stepped",
        retired,
        f"{how} could not step {_count(retired)} any further, and the run went on without: their q and v are NaN from "
        "then on, and run[k] leaves them out. All others are the same as without them.",
        remedy,
    )


def _of(retired: Sequence[RetiredParticle], words: str) -> str:
    """Return words about one particle or several."""
    if len(retired) > 1:
        return words.format(whose="their", them="them", They="They", themselves="themselves")
    return words.format(whose="its", them="it", They="It", themselves="itself")


def _count(retired: Sequence[RetiredParticle]) -> str:
    return counted(len(retired), "massless particle")


def _listed(kind: str, retired: Sequence[RetiredParticle], told: str, remedy: str = "") -> Finding:
    """Return what is said of retired particles, with the first of them."""
    first = sorted(retired, key=lambda particle: abs(particle.time.value))[:SHOWN]
    rows, hidden = [str(particle) for particle in first], len(retired) - SHOWN
    return Finding(told, RetiredWarning, kind, rows, hidden, ", in run.retired", remedy)


def _is_close_to_a_sample(run: Trajectory, passage: Passage) -> bool:
    """Return whether marching to a passage again takes little time."""
    before = run.times[np.abs(run.times) <= abs(run.clock.time(passage.step))]
    return passage.step - (abs(float(before[-1]) / run.step) if len(before) else 0.0) <= FEW_STEPS


def _most(run: Trajectory | LegOfRun, seen: Seen, passage: Passage, end: float) -> tuple[float, float]:
    """Return a bound of the error at the end of the run caused by a passage, 0 for one that cannot spoil it, and the
    sum of the bounds of a pair from which on it may be noticed.
    """
    pair = Pair.of(passage, run.system, run.clock, seen.dominant)
    if pair is None:
        return 0.0, 0.0
    e, angle = pair.shape(_step(run, end))
    left = abs(end - run.clock.time(passage.step)) + abs(_step(run, end))
    if angle < MOST_ANGLE and pair.is_bound():  # from a pericentre an error leads the farther, the larger e is
        growth = GROWTH * max(1.0, 0.5 * math.sqrt((1.0 + e) / max(1.0 - e, 1e-300)))
        noticeable = NEGLIGIBLE * pair.orbit.least
        noticed = ON_THE_SAFE_SIDE * noticeable
    else:
        growth, noticeable, noticed = GROWTH, NEGLIGIBLE * float(np.linalg.norm(pair.other_q + pair.q)), 0.0
    worth = LEAST_SHARE * noticeable
    turn = passage.speed * min(2.0, 2.0 / max(e, 1e-300))
    if not growth * turn * left > worth:
        return 0.0, noticed
    share, turned = passage_error(run.integrator, e, angle)
    bound = growth * pair.share * share * turned * passage.speed * left
    return bound if bound > worth else 0.0, noticed


def _end(run: Trajectory | LegOfRun, seen: Seen) -> float:
    """Return the time at which a run ended: that of its last sample, or where it was stopped."""
    until = run.end if isinstance(run, LegOfRun) else observed_until(run)
    return max(until, float(run.clock.time(seen.end)), key=abs)
