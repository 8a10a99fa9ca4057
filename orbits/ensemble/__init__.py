"""Ensembles: many members in blocks, on threads, processes or a Dask cluster, with results that stream into a folder.

    belt = orbits.ensemble.particles(planets, orbits.asteroids(100_000))
    clones = orbits.ensemble.clones(system, "Apophis", covariance=C, count=10_000, seed=1)
    grid = orbits.ensemble.grid(planets, primary="Sun", a=np.linspace(2, 3.5, 300), e=np.linspace(0, 0.5, 200))
    campaign = orbits.ensemble.run(belt, "belt.campaign", duration="1 Myr", dt="8 d", integrator="wisdom-holman")
    campaign.summary, campaign.progress, campaign["Ceres"]

Members are integrated in blocks, each of which is reproducible by itself: the same block gives the same bits in a
thread, a process and on a worker of a cluster. A campaign that was stopped goes on by the same call.
"""

from __future__ import annotations

from orbits.ensemble.campaign import Campaign, Progress, open_campaign
from orbits.ensemble.clones import clones
from orbits.ensemble.impacts import impact_probability
from orbits.ensemble.members import Ensemble, grid, particles, systems
from orbits.ensemble.plan import Plan
from orbits.ensemble.running import run

open = open_campaign

__all__ = [
    "Campaign",
    "Ensemble",
    "Plan",
    "Progress",
    "clones",
    "grid",
    "impact_probability",
    "open",
    "particles",
    "run",
    "systems",
]


def __dir__() -> list[str]:
    """Return the public names."""
    return __all__
