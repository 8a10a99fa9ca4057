"""The probability of an impact, by counting clones."""

from __future__ import annotations

from typing import Any

import numpy as np
from astropy import units as u

from orbits.body_names import index_of
from orbits.checks import positive_number
from orbits.ensemble.campaign import Campaign
from orbits.ensemble.summaries import LOST, SURVIVED
from orbits.errors import ArchiveError, InputError, counted, shown
from orbits.finding import Finding
from orbits.results.chance import Chance

AT_END = 1e-9
"""Of the time of the end: how near to it a closest approach is no minimum, but the end of the run."""


def impact_probability(campaign: Campaign, planet: str, *, radius: Any) -> Chance:
    """Return which part of the clones of a campaign comes to a planet closer than its radius, and how sure that is.

        members = orbits.ensemble.clones(fit.system, fit.name, covariance=fit, count=1000)
        campaign = orbits.ensemble.run(members, "clones.campaign", until="2008-10-08")
        print(orbits.ensemble.impact_probability(campaign, "Earth", radius=6378.137 * u.km))

    radius : of the planet, as a point mass attracts: what comes closer to the centre hits
    A clone that is lost within the planet, where no step is short enough for a point mass, hits, if the campaign keeps
    trajectories. The nominal orbit, which is the first member, does not count, nor do clones that failed, or were lost
    elsewhere: a warning says how many, and how many still come nearer at the end. `TargetPlane.clones_needed` says how
    many clones an error needs. Raises InputError for a campaign of systems, one that is not finished or did not look
    for approaches, and a radius that is no length; UnknownNameError for a planet that is not there.
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
        most = positive_number(float(u.Quantity(radius).to_value(summary["closest"].unit)), "radius")
    except (u.UnitConversionError, TypeError, ValueError) as error:
        raise InputError(f"radius is {shown(radius)}; expected a length, such as 6378.137 * u.km.") from error
    near = np.asarray(summary["closest_to"])[1:] == planet
    if planet == about.get("primary") and not near.any():
        raise InputError(
            f"a campaign does not tell approaches to {planet}, about which its members orbit; expected another body."
        )
    hit = near & (summary["closest"].value[1:] < most)
    for k in np.flatnonzero((state == LOST) & ~hit).tolist():
        hit[k] = _is_lost_within(campaign, k + 1, planet, most * summary["closest"].unit)
    counts = hit | (state == SURVIVED)
    _warn(planet, int((~counts).sum()), int((counts & ~hit & near & _at_the_end(summary)[1:]).sum()))
    return Chance.of(int(hit.sum()), int(counts.sum()))


def _is_lost_within(campaign: Campaign, member: int, planet: str, radius: u.Quantity) -> bool:
    """Return whether the last state of a lost clone is in a planet; False if the campaign keeps no trajectories."""
    try:
        run = campaign.run(member)
    except ArchiveError:
        return False
    lost = run.retired[campaign.names[member]]
    return bool(np.linalg.norm(lost.q - run.at(lost.time).q[run.names.index(planet)]) < radius)


def _at_the_end(summary: Any) -> Any:
    """Return which members are closest at their end, (members,)."""
    end, at = (np.asarray(summary[name].value) for name in ("end", "closest_at"))
    return np.abs(end - at) <= AT_END * np.abs(end)


def _warn(planet: str, unknown: int, nearer: int) -> None:
    if unknown:
        Finding(f"{counted(unknown, 'clone')} failed or were lost before the end, and do not count.").warn()
    if nearer:
        Finding(
            f"{counted(nearer, 'clone')} still come nearer to {planet} at the end of the campaign, and may hit later; "
            "expected one that ends after the encounter: until=..."
        ).warn()
