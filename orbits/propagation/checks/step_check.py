"""Is the step short enough? The method is tried on a single passage of two bodies, and its error is measured.

A passage is characterized by its eccentricity e and by the angle h v/d that a step covers at the pericentre, with
distance d and speed v. It is marched with the method itself, from a quarter of a period or the time of ten radians
before the pericentre to as long after it, and compared with the exact orbit. The error is that of the velocity, as a
fraction of the change of velocity in the passage.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from orbits.elements import state_from_elements
from orbits.errors import IntegrationError, StepWarning, with_unit
from orbits.finding import Finding
from orbits.integrators.base import SYMPLECTIC, Integrator
from orbits.integrators.maps.dominant import DOMINANT
from orbits.propagation.checks.passage_effect import (
    FINE,
    GRID,
    GROWTH,
    NEGLIGIBLE,
    NOT_FOLLOWED,
    RADIANS,
    Effect,
    effect,
)
from orbits.propagation.checks.passing_pair import MOST_ANGLE, MOST_ECCENTRICITY, Pair, march_pair
from orbits.propagation.events.base import RECORD
from orbits.results.approach import as_error, at_least, said, two_digits
from orbits.system.rigid_body import RIGID
from orbits.time_grid import fastest_passage_of

if TYPE_CHECKING:
    from orbits.propagation.events.base import Touching
    from orbits.system import System

TOO_LONG = 1e-2
"""A step is too long if the error of the fastest passage exceeds this, before a run."""

INSTEAD = "leave dt out: steps are then chosen one by one"
"""The advice that serves all systems but those with rigid bodies."""

OF_HIGHER_ORDER = "take a method of higher order, such as orbits.methods.Composition(order=8)"
"""The advice for those, whose steps cannot be chosen one by one, if the method is of an order below `HIGH`."""

HIGH = 8

UNRESOLVED = 0.1
"""A passage with a larger error was not resolved."""

QUIET = 2e-3
"""Angle per step below which every method of order 2 or more is far below `TOO_LONG`."""

STRAIGHT = 1e-12
"""A pericentre nearer than this fraction of the distance now, at an angle above `MOST_ANGLE`, is a straight fall."""

SHORTER, TRIALS = 2.0**-0.5, 28
"""Factor by which steps are shortened in the search for a suitable one, and how often: down to a ten-thousandth."""

MARGIN, MARGIN_OF_MANY = 0.5, 0.15
"""The suggested step may use this fraction of the allowed error, as the phase of the passage in it is unknown; and of
many pericentres, as their effects at the end are known from their mean alone."""

ROUNDS, CLOSE_ENOUGH = 6, 1e-3
"""Rounds in which a pericentre among three bodies is found, and the change of its time after which they end: the phase
within the step is not known any better before a run."""

ROUND, NEAR = 0.3, 1.0
"""The eccentricity up to which it does not matter where in its revolution a run starts, and the radians at the speed of
the pericentre beyond which it does not either."""

PHASES = (0.1, 0.25, 0.4)
"""Positions of the pericentre within a step, none of them 0 or 1/2, where symmetric methods get the turn right by
symmetry alone.
"""


def passage_error(integrator: Integrator, eccentricity: float, angle: float) -> tuple[float, float]:
    """Return (error as a fraction of the turn, turn as a fraction of the speed) of a passage; the error is at most 1.

    eccentricity : of the two-body orbit, >= 0; angle : step x speed / distance at the pericentre, in radians
    """
    if not eccentricity < MOST_ECCENTRICITY:  # includes NaN, from a square that overflowed
        eccentricity = MOST_ECCENTRICITY
    rounded = 2.0 ** (math.ceil(GRID * math.log2(max(angle, FINE))) / GRID)
    if eccentricity < 0.97:
        e = 1.0 - 2.0 ** (math.floor(GRID / 2 * math.log2(1.0 - eccentricity)) / (GRID / 2))
    else:
        e = max(1.0, 2.0 ** (math.ceil(GRID / 2 * math.log2(eccentricity)) / (GRID / 2)))
    try:
        share, turn = _tried(integrator, e, rounded)
    except TypeError:  # a method whose fields cannot be hashed
        share, turn = _tried.__wrapped__(integrator, e, rounded)
    return share * min(angle / FINE, 1.0) ** integrator.order, turn


@lru_cache(maxsize=4096)
def _tried(integrator: Integrator, e: float, angle: float) -> tuple[float, float]:
    speed = math.sqrt(1.0 + e)
    half = RADIANS / speed
    if e < 1.0:
        half = min(half, 0.5 * math.pi / math.sqrt((1.0 - e) ** 3))
    h = angle / speed
    steps = max(2, math.ceil(2.0 * half / h))
    worst, turn = 0.0, 0.0
    for shift in PHASES:
        begin = -(steps // 2 + shift) * h
        q, v = state_from_elements(1.0, q=1.0, e=e, T=0.0, t=np.array([begin, begin + steps * h]))
        turn = float(np.linalg.norm(v[1] - v[0])) / speed
        try:
            _, end = march_pair(integrator, 1.0, 0.0, q[0], v[0], h, steps)
        except IntegrationError:
            return 1.0, turn
        worst = max(worst, float(np.linalg.norm(end - v[1])) / speed)
    return min(worst / max(turn, 1e-300), 1.0), turn


class Ahead(NamedTuple):
    """The fastest passage ahead that steps do not resolve.

    row, partner : numbers of the body and of the other;  distance : at their pericentre
    angle : of a step there, infinite for a fall into the centre;  share : the error, as a fraction of the turn
    caused : the effect on the run, or None if there is no pericentre within it;  enough : a step that resolves the
        passage, 0 if none is found
    """

    row: int
    partner: int
    distance: float
    angle: float
    share: float
    caused: Effect | None
    enough: float


def passage_ahead(system: System, integrator: Integrator, h: float, span: float) -> Ahead | None:
    """Return the fastest passage within `span` from now on, if steps of h are too long for it."""
    row, partner, distance, speed, e = fastest_passage_of(system, span)[:5]
    if row < 0:
        return None
    h, softening = math.copysign(min(abs(h), abs(span)), h), system.values.softening  # the last step may be a part
    if softening > 0.0:  # it limits the speed, as the potential is 1/softening deep
        mu = float(system.values.gm[row] + system.values.gm[partner])
        now = float(np.linalg.norm(system.values.v[row] - system.values.v[partner]))
        speed = min(speed, math.sqrt(now * now + 2.0 * mu / softening))
    reach = math.hypot(distance, softening)  # no square underflows
    angle = abs(h) * speed / reach if reach > 0.0 else math.inf
    apart = float(np.linalg.norm(system.values.q[row] - system.values.q[partner]))
    if angle > MOST_ANGLE and reach < STRAIGHT * apart:
        angle = math.inf
    if angle < QUIET:
        return None
    if system.values.gm[row] > system.values.gm[partner]:
        row, partner = partner, row
    if not math.isfinite(angle):
        return Ahead(row, partner, distance, angle, 1.0, None, 0.0)
    share, turn = passage_error(integrator, e, min(angle, MOST_ANGLE))
    first = _from_start(system, integrator, row, partner, h, span) if e > ROUND else None
    if first is None and share <= TOO_LONG and GROWTH * share * turn * speed * abs(span) < 0.1 * NEGLIGIBLE * distance:
        return None
    pair, start = _ahead(system, row, partner, h, span)
    caused = None if pair is None else _all_pericentres(integrator, h, pair, span - start, span)
    if first is not None and first.spoils and (caused is None or first.error > caused.error):
        caused = first
    if share <= TOO_LONG and (caused is None or not caused.spoils):
        return None
    if pair is None:
        enough = largest_resolved_angle(integrator, e, angle) * abs(h) / angle
    else:
        enough = step_that_resolves(integrator, h, pair, span - start, span)
    for _ in range(TRIALS if first is not None and enough > 0.0 else 0):
        first = _from_start(system, integrator, row, partner, math.copysign(enough, h), span)
        if first is None or not first.spoils:
            break
        enough *= SHORTER
    return Ahead(row, partner, distance, angle, share, caused, enough)


def too_long(
    system: System, integrator: Integrator, h: float, span: float, touching: Collection[Touching] = ()
) -> Iterator[Finding]:
    """Find whether steps of h are too long for the fastest passage within `span` from now on.

    touching : the rules of collisions that are sought: bodies that meet before their pericentre do not pass it
    Only this passage is known before a run: what it costs alone is a lower bound, and others may need shorter steps.
    """
    ahead = passage_ahead(system, integrator, h, span)
    if ahead is None or _meet_before(system, integrator, h, ahead, touching):
        return
    units, name, other = system.units, system.names[ahead.row], system.names[ahead.partner]
    if not math.isfinite(ahead.angle):
        yield Finding(
            f"{name} falls straight into {other}: no step resolves that. Use a softening, or other initial values.",
            StepWarning,
            "fall ahead",
        )
        return
    what = f"the method gets {percent(ahead.share)} of the turn wrong"
    if ahead.caused is not None and ahead.caused.spoils:
        error, count = as_error(system, ahead.caused.error), ahead.caused.passages
        what = f"that alone puts {name} {at_least(error)} off by the end of the run"
        if count > 1:
            what = f"{count:,} such passages put {name} about {said(error)} off by the end of the run"
    advice = what_to_do(system, integrator, ahead.enough, "this passage")
    yield Finding(
        f"dt = {in_digits(abs(h), units.time, 6)} is too long for {integrator.label}: where {name} passes {other}, at "
        f"{in_digits(ahead.distance, units.length)}, a full turn would take {two_digits(2 * math.pi / ahead.angle)} "
        f"steps, and {what}. {advice[0].upper()}{advice[1:]}. Other passages are known only after the run.",
        StepWarning,
        "passage ahead",
    )


def _meet_before(
    system: System, integrator: Integrator, h: float, ahead: Ahead, touching: Collection[Touching]
) -> bool:
    """Return whether two bodies touch before their pericentre, and merge, bounce or end the run there, in steps that
    resolve the way to it.
    """
    pair = [ahead.row, ahead.partner]
    rule = next((rule for rule in touching if rule.concerns(*pair)), None)
    reach = 0.0 if system.radii is None else float(system.radii.value[pair].sum())
    if rule is None or rule.then == RECORD or not ahead.distance < reach:
        return False
    gm, q, v, _ = system.values
    fall = 2.0 * gm[pair].sum() * (1.0 / reach - 1.0 / float(np.linalg.norm(np.diff(q[pair], axis=0))))
    speed = math.sqrt(max(fall + float(np.sum(np.diff(v[pair], axis=0) ** 2)), 0.0))
    return passage_error(integrator, 1.0, abs(h) * speed / reach)[0] <= TOO_LONG


def what_to_do(system: System, integrator: Integrator, enough: float, what: str) -> str:
    """Return what can be done about a step that is too long.

    enough : a step that resolves `what`, 0 if none is found
    """
    shorter = f"take dt <= {rounded_down(enough, system.units.time)} to resolve {what}" if enough else ""
    advice = instead(system, integrator)
    higher = "take a method of higher order, or " * (integrator.order < HIGH)
    none = f"no practical step resolves {what}: {higher}use softening"
    return "; or ".join(words for words in (advice, shorter) if words) or none


def instead(system: System, integrator: Integrator) -> str:
    """Return the advice for a system whose step is too long, besides a shorter one; "" if there is none."""
    if not any(force.kind == RIGID for force in system.forces):
        return INSTEAD
    return OF_HIGHER_ORDER if integrator.order < HIGH else ""


def step_that_resolves(integrator: Integrator, h: float, pair: Pair, left: float, span: float, count: int = 1) -> float:
    """Return a step below |h| with which a passage does not spoil a run at any phase; 0 if none is found.

    pair, left, span : see `effect`
    count : the number of such passages of the pair, which must not spoil it together
    """
    ahead = pair.ahead
    e, angle = pair.shape(h)
    margin = MARGIN_OF_MANY if pair.is_bound() and pair.orbit.period < abs(left) else MARGIN
    longest = abs(h) * largest_resolved_angle(integrator, e, angle) / angle if angle > 0.0 else abs(h)
    for k in range(TRIALS if longest > 0.0 else 0):
        shorter = math.copysign(longest * SHORTER**k, h)
        if abs(shorter) >= abs(h):
            continue
        try:
            moved = [pair.after(ahead - phase * shorter) for phase in PHASES]
        except NOT_FOLLOWED:
            return 0.0
        effects = (_all_pericentres(integrator, shorter, p, left - ahead, span) for p in moved)
        if all(math.isfinite(f.error) and count * f.error <= margin * f.limit for f in effects):
            return abs(shorter)
    return 0.0


def _all_pericentres(integrator: Integrator, h: float, pair: Pair, left: float, span: float) -> Effect:
    """Return the effect on a run of the next pericentre and, for a bound pair, of all later ones.

    On average the later ones have half of the remaining time.
    """
    first = effect(integrator, h, pair, left, span)
    if not (pair.is_bound() and pair.orbit.period < abs(left)):
        return first
    passages = abs(left) / pair.orbit.period
    rest = seen_for(integrator, h, pair, left, 0.5 * left)
    later = min(effect(integrator, h, pair, rest, span).error * passages, 2.0 * first.distance)
    return first._replace(error=later, passages=math.ceil(passages)) if later > first.error else first


def seen_for(integrator: Integrator, h: float, pair: Pair, left: float, most: float) -> float:
    """Return for how long the error of one of many passages is seen, in which it adds up to those of the others.

    left : time to the end of the run; most : the longest, signs as h
    At its pericentres a symplectic method leaves the same error of phase and direction each time, seen where the run
    ends in the revolution. What it does to the energy depends on where in a step they lie, and averages out when they
    have gone through all of it; but not where they come back to the same place, or every other time.
    """
    period = pair.orbit.period
    if not (SYMPLECTIC in integrator.declares and pair.is_bound() and period < abs(left)):
        return most
    steps = abs(period / h)
    shift = min(abs(k * steps - round(k * steps)) for k in (1, 2))  # from one pericentre to the next, in steps
    together = min(abs(most), period / max(2.0 * math.pi * shift, 1e-300))
    return math.copysign(max(period + math.fmod(abs(left), period), together), left)


def largest_resolved_angle(integrator: Integrator, eccentricity: float, angle: float) -> float:
    """Return an angle per step, at most `angle`, with an error of at most `TOO_LONG`; 0 if none is found."""
    trials = (angle * SHORTER**k for k in range(TRIALS))
    return next((trial for trial in trials if passage_error(integrator, eccentricity, trial)[0] <= TOO_LONG), 0.0)


def _now(system: System, row: int, partner: int) -> Pair:
    """Return two bodies, the lighter one first."""
    gm = system.values.gm
    return Pair.now(system, row, partner, int(gm.argmax()) if gm.max() > DOMINANT * gm.sum() else -1)


def _from_start(
    system: System, integrator: Integrator, row: int, partner: int, h: float, span: float
) -> Effect | None:
    """Return the effect on a run of the rest of a passage in which it starts, which may be a hundred times that of a
    whole one; None if it starts elsewhere.
    """
    pair = _now(system, row, partner)
    try:
        within = abs(pair.ahead) * pair.rate < NEAR
    except NOT_FOLLOWED:
        return None
    return effect(integrator, h, pair, span, span) if within else None


def _ahead(system: System, row: int, partner: int, h: float, span: float) -> tuple[Pair | None, float]:
    """Return two bodies, the lighter one first, at the beginning of the step with their next pericentre, and its time.

    The pair is None if there is no pericentre within `span`.
    """
    pair = _now(system, row, partner)
    try:
        ahead, period = pair.ahead, pair.orbit.period
        if ahead * h < 0.0:
            ahead += math.copysign(period, h)
        if not abs(ahead) <= abs(span):
            return None, 0.0
        if pair.is_flyby:
            pair, ahead = _at_pericentre(pair, ahead)
            start = math.floor(ahead / h) * h
            return pair.after(start - ahead), start
        start = math.floor(ahead / h) * h
        return pair.after(start), start
    except NOT_FOLLOWED:
        return None, 0.0


def _at_pericentre(pair: Pair, ahead: float) -> tuple[Pair, float]:
    """Return a pair at its next pericentre, and the time until then, which for the conic of now is `ahead`: the third
    body bends the way there.
    """
    there = pair.after(ahead)
    for _ in range(ROUNDS):
        more = there.ahead
        there, ahead = there.after(more), ahead + more
        if abs(more) < CLOSE_ENOUGH * abs(ahead):
            break
    return replace(there, seen=(0.0, float(np.linalg.norm(there.q)), float(np.linalg.norm(there.v)))), ahead


def percent(share: float) -> str:
    """Return a fraction in percent."""
    return f"{100 * share:.2g} %" if share < 0.995 else "all"


def in_digits(x: float, unit: object, digits: int = 4) -> str:
    """Return a number to some digits, with its unit if it has one."""
    return with_unit(f"{x:.{digits}g}", unit)


def rounded_down(step: float, unit: object) -> str:
    """Return a step to two digits, rounded down: one that is rounded up would not do."""
    digit = 10.0 ** (math.floor(math.log10(step)) - 1)
    return in_digits(math.floor(step / digit) * digit, unit, 2)
