"""What a run returns."""

from orbits.trajectory.conservation import ConservedQuantities
from orbits.trajectory.trajectory import Trajectory
from orbits.trajectory.values import BodyTrajectory, Samples, Statistics

__all__ = ["BodyTrajectory", "ConservedQuantities", "Samples", "Statistics", "Trajectory"]
