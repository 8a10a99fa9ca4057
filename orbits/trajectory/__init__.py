"""Trajectories: the results of runs."""

from orbits.trajectory.conservation import ConservedQuantities
from orbits.trajectory.parts import BodyTrajectory, Samples, Statistics
from orbits.trajectory.retired import RetiredParticle, RetiredParticles
from orbits.trajectory.trajectory import Trajectory

__all__ = [
    "BodyTrajectory",
    "ConservedQuantities",
    "RetiredParticle",
    "RetiredParticles",
    "Samples",
    "Statistics",
    "Trajectory",
]
