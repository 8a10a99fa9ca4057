"""What a run returns."""

from orbits.trajectory.conservation import ConservedQuantities
from orbits.trajectory.parts import BodyTrajectory, Samples, Statistics
from orbits.trajectory.trajectory import Trajectory

__all__ = ["BodyTrajectory", "ConservedQuantities", "Samples", "Statistics", "Trajectory"]
