"""Regression against REBOUND: conversion both ways, peers on the same floats, a reference solution, a verdict.

Only this folder imports `rebound`, and only when a function is called.
"""

from __future__ import annotations

from orbits.regression.comparison import compare
from orbits.regression.conversion import from_rebound, run_from_rebound, to_rebound
from orbits.regression.of_ephemeris import residuals
from orbits.regression.peer_choice import PEERS

__all__ = ["PEERS", "compare", "from_rebound", "residuals", "run_from_rebound", "to_rebound"]
