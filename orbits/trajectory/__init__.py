"""Trajectories: the results of runs."""

from orbits.trajectory.conservation import ConservedQuantities
from orbits.trajectory.events import Events, FoundEvent
from orbits.trajectory.excursions import Excursion, Excursions
from orbits.trajectory.parts import BodyTrajectory, Statistics
from orbits.trajectory.retired import RetiredParticle, RetiredParticles
from orbits.trajectory.trajectory import Trajectory
from orbits.trajectory.work import ForceEffect

__all__ = [
    "BodyTrajectory",
    "ConservedQuantities",
    "Events",
    "Excursion",
    "Excursions",
    "ForceEffect",
    "FoundEvent",
    "RetiredParticle",
    "RetiredParticles",
    "Statistics",
    "Trajectory",
]
