"""The probability of an impact, by counting clones."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.body_names import few, index_of
from orbits.checks import positive_number
from orbits.ensemble.campaign import Campaign
from orbits.ensemble.summaries import FAILED, LOST, SURVIVED
from orbits.errors import ArchiveError, InputError, counted, shown
from orbits.finding import Finding
from orbits.propagation.results.refinement import refine
from orbits.propagation.resuming.marching_again import seen_by
from orbits.results.chance import Chance

if TYPE_CHECKING:
    from orbits.results.passages import Seen
    from orbits.trajectory import Trajectory

AT_END = 1e-9
"""Of the time of the end: how near to it a closest approach is no minimum, but the end of the run."""

AT_SURFACE = 1e-6
"""Of the radius: how far above the surface a clone that merged with a planet may be, by round-off of its place."""


def impact_probability(campaign: Campaign, planet: str, *, radius: Any) -> Chance:
    """Return which part of the clones of a campaign comes to a planet closer than its radius, and how sure that is.

        members = orbits.ensemble.clones(fit.system, fit.name, covariance=fit, count=1000)
        campaign = orbits.ensemble.run(members, "clones.campaign", until="2008-10-08")
        print(orbits.ensemble.impact_probability(campaign, "Earth", radius=6378.137 * u.km))

    radius : of the planet, as a point mass attracts: what comes closer to the centre hits
    A clone that is lost within the planet, where no step is short enough for a point mass, or merges with it at its
    surface, hits, if the campaign keeps trajectories; without them it is not known of clones that came relatively
    closer to another body whether they hit. The nominal orbit, which is the first member, does not count, nor do
    clones that failed, were stopped before the end, or lost elsewhere: a warning says how many, how many still come
    nearer at the end, and of how many the campaign does not tell.
    `TargetPlane.clones_needed` says how many clones an error needs. Raises InputError for a campaign of systems, one
    that is not finished or did not look for approaches, and a radius that is no length, or, if the campaign keeps
    trajectories, larger than the distance within which approaches are recorded; UnknownNameError for a planet that is
    not there.
    """
    if not isinstance(campaign, Campaign):
        raise InputError(f"campaign is {shown(campaign)}; expected one of orbits.ensemble.run.")
    summary, about = campaign.summary, campaign._store.about
    if "closest" not in summary.colnames:
        raise InputError("the campaign did not look for approaches; expected ensemble.run(..., approaches=True).")
    if about["kind"] != "particles":
        raise InputError("the members are systems, of which the closest pair alone is known; expected massless clones.")
    planet = about["bodies"][index_of(planet, about["bodies"])]
    state = np.asarray(summary["state"])[1:]
    waiting = int((np.asarray(summary["state"]) == "waiting").sum())
    if waiting:
        raise InputError(f"{waiting:,} members of the campaign are still to come; expected a finished one.")
    try:
        length = float(u.Quantity(radius).to_value(summary["closest"].unit))
    except (u.UnitConversionError, TypeError, ValueError) as error:
        raise InputError(f"radius is {shown(radius)}; expected a length, such as 6378.137 * u.km.") from error
    most = positive_number(length, "radius", radius)
    near = np.asarray(summary["closest_to"])[1:] == planet
    if planet == about.get("primary") and not near.any():
        raise InputError(
            f"a campaign does not tell approaches to {planet}, about which its members orbit; expected another body."
        )
    hit = near & (summary["closest"].value[1:] < most)
    for k in np.flatnonzero((state == LOST) & ~hit).tolist():
        hit[k] = _is_lost_within(campaign, k + 1, planet, most)
    beside, coming, untold = _closer_to_others(campaign, summary, planet, most)[:, 1:]
    hit |= beside
    to_the_end = (state == SURVIVED) & (np.asarray(summary["reason"])[1:] == "")
    counts = hit | to_the_end
    nearer = coming | (near & _at_the_end(summary)[1:])
    _warn(planet, int((~counts).sum()), int((counts & ~hit & nearer).sum()))
    others = np.asarray(summary["closest_to"])[1:][counts & ~hit & untold].tolist()
    _warn_of_untold(planet, radius, others, about["identity"]["trajectories"] == "kept")
    return Chance.of(int(hit.sum()), int(counts.sum()))


def _closer_to_others(campaign: Campaign, summary: Any, planet: str, most: float) -> NDArray[np.bool_]:
    """Return which clones that came relatively closer to another body hit a planet nevertheless, which still come
    nearer to it at the end, and of which the campaign does not tell; (3, members).

    The summary has the closest approach alone, as a fraction of the reach of the body. A clone misses a planet whose
    radius is a smaller fraction; of others the trajectories tell.
    """
    closest, to, block = summary["closest"].value, np.asarray(summary["closest_to"]), np.asarray(summary["block"])
    asked = (to != planet) & (np.asarray(summary["state"]) != FAILED)
    asked[0] = False
    found = np.zeros((3, len(summary)), dtype=bool)
    for number in np.unique(block[asked]):
        members = np.flatnonzero(asked & (block == number))
        try:
            run = campaign.run(int(members[0]))
        except ArchiveError:
            found[2, members] = (to[members] != "") | np.isnan(closest[members])  # NaN: bodies with mass merged, say
            continue
        try:
            seen = seen_by(run)
        except InputError:  # bodies with mass merged, say
            found[2, members] = True
            continue
        reach = dict(zip(run.names, seen.reach.tolist(), strict=True)) if seen.dominant >= 0 else {}
        if most > reach.get(planet, math.inf):
            unit = run.system.units.length
            raise InputError(
                f"radius is {most:.6g} {unit}, but approaches to {planet} are recorded within {reach[planet]:.6g} "
                f"{unit}; expected less."
            )
        fractions = closest[members] / [reach.get(name, 1.0) for name in to[members]]
        members = members[fractions < most / reach.get(planet, 1.0)]
        if len(members):
            found[:, members] = _followed(run, seen, planet, most, [campaign.names[k] for k in members])
    return found


def _followed(run: Trajectory, seen: Seen, planet: str, most: float, names: Sequence[str]) -> NDArray[np.bool_]:
    """Return the same of some clones of a run, (3, clones), from its passages and its ends."""
    other, rows = run.names.index(planet), {run.names.index(name): k for k, name in enumerate(names)}
    ends = run.at([0.0, run._reached])
    apart, speed = (x[:, list(rows)] - x[:, [other]] for x in (ends._q, ends._v))
    hit = (np.linalg.norm(apart, axis=2) < most).any(axis=0)
    nearer = (apart[1] * speed[1]).sum(axis=1) * run.clock.direction < 0.0
    nearer &= np.linalg.norm(apart[1], axis=1) < seen.reach[other]
    numbers = [k for k, one in enumerate(seen.passages) if other in (one.body, one.other)]
    refine(run, seen, [k for k in numbers if not np.isfinite(seen.passages[k].distance)])
    for passage in (seen.passages[k] for k in numbers):
        body = passage.body + passage.other - other
        if passage.distance < most and body in rows:
            hit[rows[body]] = True
    # Without a body that dominates, or beyond their number, passages are not listed.
    return np.array([hit, nearer, np.full(len(rows), seen.dominant < 0 or seen.left_out != 0)])


def _is_lost_within(campaign: Campaign, member: int, planet: str, radius: float) -> bool:
    """Return whether the last state of a lost clone is in a planet or at its surface; False if the campaign keeps no
    trajectories.
    """
    try:
        run = campaign.run(member)
    except ArchiveError:
        return False
    lost = run.retired[campaign.names[member]]
    state = run.at(lost.time)
    if planet not in state:  # it merged with another body before
        return False
    return bool(np.linalg.norm((lost.q - state[planet].q).value) < radius * (1.0 + AT_SURFACE))


def _at_the_end(summary: Any) -> Any:
    """Return which members are closest at their end, (members,)."""
    end, at = (np.asarray(summary[name].value) for name in ("end", "closest_at"))
    return np.abs(end - at) <= AT_END * np.abs(end)


def _warn(planet: str, unknown: int, nearer: int) -> None:
    if unknown:
        who = counted(unknown, "clone")
        Finding(f"{who} failed, were lost or stopped before the end, and do not count.").warn()
    if nearer:
        Finding(
            f"{counted(nearer, 'clone')} still come nearer to {planet} at the end of the campaign, and may hit later; "
            "expected one that ends after the encounter: until=..."
        ).warn()


def _warn_of_untold(planet: str, radius: Any, others: list[str], kept: bool) -> None:
    """Warn of clones of which a campaign does not tell: the bodies to which they came closest, "" if none is known.

    kept : whether it keeps trajectories, whose passages then are not all listed
    """
    if not others:
        return
    known = sorted(set(others) - {""})
    closer = f"came relatively closer to {few(known)} than to {planet}" if known else "have no closest body"
    remedy = "" if kept else " Keep trajectories: ensemble.run(..., trajectories=True)."
    Finding(
        f"{counted(len(others), 'clone')} {closer}; the campaign does not tell whether they came within {radius} of "
        f"{planet}, and they count as misses.{remedy}"
    ).warn()
