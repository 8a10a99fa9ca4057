"""The steps and the samples of a run, made once from the arguments of a caller: dt, duration or until, samples."""

from orbits.marching.clocks.constant import rounded_step
from orbits.time_grid.grid import MOST_STEPS, TimeGrid
from orbits.time_grid.reading import snapped, times_since
from orbits.time_grid.step_length import dynamical_time, dynamical_time_of, fastest_passage_of

__all__ = [
    "MOST_STEPS",
    "TimeGrid",
    "dynamical_time",
    "dynamical_time_of",
    "fastest_passage_of",
    "rounded_step",
    "snapped",
    "times_since",
]
