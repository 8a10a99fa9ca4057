"""Is a run fit for a method that moves planets on Kepler orbits about a dominant body? Before and after it.

Such a method follows the two-body motion about the dominant body exactly, so that its error on a single passage (see
`step_check`) says nothing. Steps must resolve the fastest pericentre, or they resonate with it; and the planets
and the massless particles must stay away from planets, because a close pair is not near a Kepler orbit about the
dominant body.

Source: Rauch & Holman (1999), AJ 117, 1087; Wisdom (2015), AJ 150, 127.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from orbits.body_names import few
from orbits.errors import InputError, StepWarning, counted
from orbits.finding import SHOWN, Finding
from orbits.integrators.base import Integrator
from orbits.integrators.forms import Array
from orbits.kernels.search.apsides import apsides_of
from orbits.lagrangians.base import ABOUT_ONE_BODY
from orbits.marching.watching.kepler_passages import HILL_RADII, is_unresolved, near_a_planet, reach, ways_too_fast
from orbits.propagation.checks.crossing_orbits import close_pairs, orbits_of_planets
from orbits.propagation.checks.leg_of_run import LegOfRun, listed_in
from orbits.propagation.checks.step_check import in_digits, rounded_down
from orbits.results.approach import Approach
from orbits.system.derived import derived

if TYPE_CHECKING:
    from orbits.results.passages import Seen
    from orbits.system import System
    from orbits.trajectory import Trajectory
    from orbits.trajectory.excursions import Excursions

FOR_GOOD = 0.3
"""The eccentricity below which an orbit whose pericentre a step does not resolve is not resolved elsewhere either."""

REMEDY_FOR_PLANETS = (
    'Let all bodies take steps that are chosen one by one there, with encounters="follow"; or use Gauss(stages=8), the '
    "default, without dt: steps are then chosen one by one."
)


def require_outside(system: System) -> None:
    """Raise InputError for bodies inside the dominant one, as far as its radius is known."""
    radii = system.radii
    if radii is None:
        return
    sun, units = _dominant(system), system.units
    radius = float(radii.value[sun])
    distance = np.linalg.norm(system.values.q - system.values.q[sun], axis=1)
    inside = [int(k) for k in np.argsort(distance, kind="stable") if distance[k] < radius and k != sun]
    if inside:
        first, star = system.names[inside[0]], system.names[sun]
        near, size = in_digits(float(distance[inside[0]]), units.length), in_digits(radius, units.length)
        more = inside[1:]
        others = f", as {'are' if len(more) > 1 else 'is'} {few([system.names[k] for k in more])}" if more else ""
        raise InputError(
            f"{first!r} is {near} from the centre of {star!r}, inside its radius of {size}{others}: a Wisdom–Holman "
            f"step moves bodies about a point mass. Leave them out with system.remove({first!r}), or take all bodies "
            "for points with system.replaced(radii=None)."
        )


def require_terms_of_dominant(system: System, integrator: Integrator) -> None:
    """Raise InputError for terms of other bodies than the dominant one, where the method takes any."""
    sun = system.names[_dominant(system)]
    for term in system.terms:
        if ABOUT_ONE_BODY in integrator.requires and term.body not in (None, sun):
            raise InputError(
                f"{integrator.label} takes terms of the dominant body alone, {sun!r}; got {type(term).__name__} of "
                f"{term.body!r}. Leave it out, or use a method such as Gauss(stages=8)."
            )


def unfit(system: System, integrator: Integrator, h: float, span: float) -> Iterator[Finding]:
    """Find pericentres within `span` that steps of h do not resolve, of planets and of massless particles, and planets
    that come so close to each other, now or at a crossing of their orbits, that the method cannot follow them.
    """
    orbits = derived(system, orbits_of_planets)
    units, centre = system.units, system.names[_dominant(system)]
    with np.errstate(divide="ignore", invalid="ignore"):  # a fall along a line has no pericentre
        angles = abs(h) * np.sqrt(orbits.mu * (1.0 + orbits.e) / orbits.pericentre**3)
        inverse_a = (1.0 - orbits.e) / orbits.pericentre
    angles = np.where(_passes(orbits.q, orbits.v, orbits.mu, orbits.e, inverse_a, span), angles, 0.0)
    least = integrator.least_steps
    perturbed = len(angles) > 1 or bool(system.terms) or not integrator.exact_for_two
    follows = integrator.in_encounters.follow_planets
    # Where planets are followed, an eccentric orbit leaves the map at each pericentre, a round one for good.
    left = " All bodies would be away from the map for good." if follows else ""
    fastest = int(angles.argmax()) if len(angles) else None
    perturbed = perturbed and (not follows or (fastest is not None and orbits.e[fastest] < FOR_GOOD))
    if fastest is not None and perturbed and angles[fastest] > 2.0 * math.pi / least:
        turn = 2.0 * math.pi / float(angles[fastest])
        body, passed = system.names[orbits.row[fastest]], in_digits(float(orbits.pericentre[fastest]), units.length)
        enough = abs(h) * turn / least
        remedy = f"dt <= {rounded_down(enough, units.time)} resolves it, or" if enough > 0.0 else "No step resolves it:"
        yield Finding(
            f"dt = {in_digits(abs(h), units.time, 6)} is too long for {integrator.label}: where {body} passes "
            f"{centre}, at {passed}, a full turn would take {turn:.2g} steps; fewer than "
            f"{least} resonate with the motion.{left} {remedy} leave out "
            "dt and the method: steps are then chosen one by one.",
            StepWarning,
            "pericentre of a planet ahead",
        )
    if not _is_exact(system) and not system.massive.all() and not integrator.in_encounters.follow_particles:
        yield from _particles_too_fast(system, integrator, h, span)
        if not integrator.in_encounters.retire_particles:
            yield from _particles_near_planets(system, integrator)
    close, count = ([], 0) if follows else derived(system, close_pairs)
    if close:
        yield Finding(
            f"{integrator.label} cannot follow close encounters of massive bodies, and these may have some:",
            StepWarning,
            "planets may meet",
            close,
            count - SHOWN,
            " pairs",
            REMEDY_FOR_PLANETS,
        )


def _is_exact(system: System) -> bool:
    """Return whether nothing acts but the attraction of a single body: steps of any length are then exact."""
    return bool(system.massive.sum() == 1 and not system.terms)


def _particles_too_fast(system: System, integrator: Integrator, h: float, span: float) -> Iterator[Finding]:
    """Find massless particles whose pericentres steps of h do not resolve."""
    values, units, sun = system.values, system.units, _dominant(system)
    rows = np.flatnonzero(~system.massive)
    q, v, mu = values.q[rows] - values.q[sun], values.v[rows] - values.v[sun], float(values.gm[sun])
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        e, pericentre, _, _, inverse_a = apsides_of(q, v, mu)
        steps = 2.0 * math.pi / abs(h) * np.sqrt(pericentre**3 / (mu * (1.0 + e)))
        ahead = _passes(q, v, mu, e, inverse_a, span)
    least = integrator.least_steps
    worst = [k for k in np.argsort(steps, kind="stable").tolist() if ahead[k] and steps[k] < least]
    if not worst:
        return
    enough = abs(h) * float(steps[worst[0]]) / least
    remedy = f"dt <= {rounded_down(enough, units.time)} resolves all, or" if enough > 0.0 else "No step does for all:"
    instead = f"{_following(integrator)} lets each take steps of its own there"
    yield Finding(
        f"dt = {in_digits(abs(h), units.time, 6)} is too long for {counted(len(worst), 'massless particle')} by "
        f"{integrator.label}: fewer than {least} steps in a full turn resonate with the motion at a pericentre, and "
        "errors do not average out:",
        StepWarning,
        "pericentres of particles ahead",
        [
            f"{system.names[rows[k]]} passes {system.names[sun]} at {in_digits(pericentre[k], units.length)}, where a "
            f"full turn would take {steps[k]:.2g} steps"
            for k in worst[:SHOWN]
        ],
        len(worst) - SHOWN,
        remedy=f"{remedy} {instead}.",
    )


def _particles_near_planets(system: System, integrator: Integrator) -> Iterator[Finding]:
    """Find massless particles that start within `HILL_RADII` of a planet: most have no passage to be seen by."""
    close, planets = start_near_planets(system)
    if not len(close):
        return
    lines, q = [], system.values.q
    rows, heavy = np.flatnonzero(~system.massive)[close], np.flatnonzero(system.massive)[planets]
    for row, planet in zip(rows[:SHOWN], heavy, strict=False):
        distance = in_digits(float(np.linalg.norm(q[row] - q[planet])), system.units.length)
        lines.append(f"{system.names[row]} is {distance} from {system.names[planet]}")
    start, them = ("starts", "it") if len(close) == 1 else ("start", "them")
    yield Finding(
        f"{counted(len(close), 'massless particle')} {start} within {HILL_RADII:.0f} Hill radii of a planet, where "
        f"{integrator.label} cannot follow {them}:",
        StepWarning,
        "particles start near planets",
        lines,
        len(close) - SHOWN,
        remedy=f"Use {_following(integrator)}, or Gauss(stages=8) without dt.",
    )


def start_near_planets(system: System) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the massless particles that start within `HILL_RADII` of a planet, by their numbers among these, and the
    numbers of the planets among the massive bodies.
    """
    values, massive = system.values, system.massive
    gm, x = values.gm[massive], values.q[massive]
    sun = int(gm.argmax())
    planets = np.delete(np.arange(len(gm)), sun)
    found = near_a_planet(values.q[~massive] - x[sun], x[planets] - x[sun], gm[planets], float(gm[sun]))
    inside = np.flatnonzero(found >= 0)
    return inside, planets[found[inside]]


def _following(integrator: Integrator) -> str:
    """Return what lets particles take steps of their own: an option of the method, or another method."""
    return 'encounters="follow"' if integrator.name == "wisdom-holman" else 'WisdomHolman(encounters="follow")'


def encounters(
    system: System, integrator: Integrator, h: float, seen: Seen, away: Excursions | None = None
) -> list[int]:
    """Return the numbers of the passages that the method could not follow in steps of h, the worst first: within
    `HILL_RADII` of a planet, and at a pericentre, or a particle's flyby, that the step did not resolve; but for those
    on excursions, `away`.
    """
    gm, massive, found = system.values.gm, system.massive, []
    perturbed = massive.sum() > 2 or bool(system.terms) or not integrator.exact_for_two
    followed, together = integrator.in_encounters.follow_particles, integrator.in_encounters.follow_planets
    for k in range(len(seen.passages)):
        passage = seen.judged(k)
        both = bool(massive[passage.body] and massive[passage.other])
        gone = away is not None and away.include(passage.steps)
        if passage.about is None or (together if both else followed) or gone:
            continue
        if seen.dominant in (passage.body, passage.other):
            lighter = passage.other if passage.body == seen.dominant else passage.body
            resolved = not is_unresolved(h, passage.distance, passage.speed, integrator.least_steps)
            if (perturbed or not massive[lighter]) and not resolved and not _is_exact(system):
                found.append((passage.distance / abs(h * passage.speed), k))
            continue
        near = float(reach(passage.about[:3], gm[passage.body] + gm[passage.other], gm[seen.dominant]))
        ways = ways_too_fast(gm[[passage.body, passage.other]].max() / gm[seen.dominant], integrator.least_steps)
        if passage.distance < near or (not both and passage.distance < abs(h) * passage.speed * ways):
            found.append((passage.distance / near, k))
    return [k for _, k in sorted(found)]


def not_followed(run: Trajectory | LegOfRun, seen: Seen) -> Iterator[Finding]:
    """Find the passages in a run that its method did not follow."""
    found = encounters(run.system, run.integrator, run.step, seen, run.excursions)
    central = [k for k in found if seen.dominant in (seen.passages[k].body, seen.passages[k].other)]
    flybys = [k for k in found if k not in set(central)]
    some = "at least " * (seen.left_out > 0)
    if flybys:
        yield _not_to_be_trusted(
            run,
            seen,
            "encounters not followed",
            flybys,
            f"cannot follow close encounters, within {HILL_RADII:.0f} Hill radii or too fast for the step, and had "
            f"{some}{len(flybys):,},",
            [str(Approach.of(run.system, run.clock, seen.passages[k], None)) for k in flybys[:SHOWN]],
        )
    if central:
        units, sun = run.system.units, run.system.names[seen.dominant]
        turns = [2.0 * math.pi * seen.passages[k].distance / seen.passages[k].speed for k in central]
        enough, which = min(turns) / run.integrator.least_steps, "it" if len(central) == 1 else "all of them"
        lines = []
        for k in central[:SHOWN]:
            passage = seen.passages[k]
            body = run.system.names[passage.other if passage.body == seen.dominant else passage.body]
            when = in_digits(float(run.clock.time(passage.steps)), units.time, 10)
            steps = 2.0 * math.pi * passage.distance / abs(run.step * passage.speed)
            lines.append(
                f"{body} passes {sun} at {in_digits(passage.distance, units.length)} about t = {when}, where a full "
                f"turn would take {steps:.2g} steps"
            )
        yield _not_to_be_trusted(
            run,
            seen,
            "pericentres not resolved",
            central,
            f"needs {run.integrator.least_steps} steps in a full turn at a pericentre, as fewer resonate with the "
            f"motion; {some}{counted(len(central), 'passage')}",
            lines,
            " had fewer",
            f"dt <= {rounded_down(enough, units.time)} resolves {which}. " if enough > 0.0 else "",
        )


def _not_to_be_trusted(
    run: Trajectory | LegOfRun,
    seen: Seen,
    kind: str,
    found: list[int],
    what: str,
    rows: list[str],
    had: str = "",
    step: str = "",
) -> Finding:
    """Return what is said of passages, and of the bodies concerned.

    step : a sentence with a step that resolves them
    """
    massive = run.system.massive
    pairs = [(seen.passages[k].body, seen.passages[k].other) for k in found]
    who = len({body for pair in pairs for body in pair if not massive[body]})
    of_planets = any(massive[one] and massive[other] for one, other in pairs)
    whose = f" of {counted(who, 'massless particle')}" * (who > 0) + " and" * (who > 0 and of_planets)
    whose += " of massive bodies" * of_planets
    others = "" if of_planets or isinstance(run, LegOfRun) else "All others are right. "
    remedy = REMEDY_FOR_PLANETS if of_planets else _remedy_for_particles(run.integrator)
    return Finding(
        f"{run.integrator.label} {what}{whose}{had}; the rest of the run is not to be trusted for these bodies:",
        StepWarning,
        kind,
        rows,
        len(found) - SHOWN,
        listed_in(run),
        f"{others}{step}{remedy}",
    )


def _remedy_for_particles(integrator: Integrator) -> str:
    """Return the advice for particles that the method could not follow."""
    follow = _following(integrator)
    if follow.startswith("W"):
        return f'Use {follow}, or retire them, with encounters="retire".'
    return f'Let these take steps of their own there, with {follow}; or retire them, with encounters="retire".'


def _dominant(system: System) -> int:
    return int(system.values.gm.argmax())


def _passes(q: Array, v: Array, mu: Any, e: Array, inverse_a: Array, span: float) -> NDArray[np.bool_]:
    """Return which bodies pass their pericentres within `span`, roughly: on open orbits those that are falling in.

    q, v : (n, 3), relative to the dominant body
    """
    bound = inverse_a > 0.0
    period = np.where(bound, 2.0 * math.pi / np.sqrt(mu * np.where(bound, inverse_a, 1.0) ** 3), np.inf)
    return np.asarray((abs(span) >= period) | (e < 0.1) | ((q * v).sum(axis=1) * span < 0.0))
