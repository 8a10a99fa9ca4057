"""Propagation: bind system, integrator and step; march chunk by chunk; sample, store, report, stop and resume."""

from orbits.propagation.dense import state_at
from orbits.propagation.run import propagate, resume

__all__ = ["propagate", "resume", "state_at"]
