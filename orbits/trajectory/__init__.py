"""What a run returns."""

from orbits.trajectory.run import Trajectory
from orbits.trajectory.values import BodyTrajectory, ConservedQuantities, Samples, Statistics

__all__ = ["BodyTrajectory", "ConservedQuantities", "Samples", "Statistics", "Trajectory"]
