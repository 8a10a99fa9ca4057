"""Propagation: bind system, integrator and step; march chunk by chunk; sample, store, report, stop and resume.

The integrating code is loaded on first use: opening a run and looking at it does not need it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from orbits.later import later
from orbits.propagation.resuming.marching_again import REPLAY
from orbits.trajectory import Trajectory

if TYPE_CHECKING:
    from orbits.propagation.results.dense_output import state_at
    from orbits.propagation.run import propagate, resume

__all__ = ["Trajectory", "propagate", "resume", "state_at"]

# Trajectories do not import the integrating code; those that are opened or made by hand get it here.
Trajectory._marched_again_by = REPLAY

__getattr__ = later(
    __name__,
    {
        "orbits.propagation.run": ["propagate", "resume"],
        "orbits.propagation.results.dense_output": ["state_at"],
    },
)
