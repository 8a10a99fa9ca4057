"""The probability of an impact, by counting clones."""

from __future__ import annotations

from typing import Any

import numpy as np

from orbits.checks import positive_number
from orbits.ensemble.campaign import Campaign
from orbits.errors import InputError, shown
from orbits.results.chance import Chance


def impact_probability(campaign: Campaign, planet: str, *, radius: Any) -> Chance:
    """Return which part of the clones of a campaign comes to a planet closer than its radius, and how sure that is.

        members = orbits.ensemble.clones(fit.system, fit.name, covariance=fit.covariance(), count=1000)
        campaign = orbits.ensemble.run(members, "clones.campaign", until="2008-10-08")
        print(orbits.ensemble.impact_probability(campaign, "Earth", radius=6378.137 * u.km))

    radius : of the planet, as a point mass attracts: what comes closer to the centre hits
    The nominal orbit, which is the first member, does not count. `TargetPlane.clones_needed` says how many clones
    an error needs. Raises InputError for a campaign that is not finished or did not look for approaches.
    """
    if not isinstance(campaign, Campaign):
        raise InputError(f"campaign is {shown(campaign)}; expected one of orbits.ensemble.run.")
    summary = campaign.summary
    if "closest" not in summary.colnames:
        raise InputError("the campaign did not look for approaches; expected ensemble.run(..., approaches=True).")
    waiting = int((np.asarray(summary["state"]) == "waiting").sum())
    if waiting:
        raise InputError(f"{waiting:,} members of the campaign are still to come; expected a finished one.")
    most = positive_number(float(radius.to_value(summary["closest"].unit)), "radius")
    hit = (np.asarray(summary["closest_to"]) == planet) & (summary["closest"].value < most)
    return Chance.of(int(hit[1:].sum()), len(hit) - 1)
