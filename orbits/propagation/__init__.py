"""Propagation: bind system, integrator and step; march chunk by chunk; sample, store, report, stop and resume.

The integrating code is loaded on first use: opening a run and looking at it does not need it.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from orbits.propagation.resuming.marching_again import REPLAY
from orbits.trajectory import Trajectory

if TYPE_CHECKING:
    from orbits.propagation.results.dense_output import state_at
    from orbits.propagation.run import propagate, resume

__all__ = ["Trajectory", "propagate", "resume", "state_at"]

_LATER = {"propagate": "run", "resume": "run", "state_at": "results.dense_output"}

# Trajectories do not import the integrating code; those that are opened or made by hand get it here.
Trajectory._marched_again_by = REPLAY


def __getattr__(name: str) -> Any:
    """Load a public name on first use."""
    if name not in _LATER:
        raise AttributeError(f"module 'orbits.propagation' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"orbits.propagation.{_LATER[name]}"), name)
    globals()[name] = value
    return value
