"""Which way of following serves a march."""

from __future__ import annotations

from typing import Any

from orbits.integrators.forms import Array, Form
from orbits.marching.clocks.constant import Clock
from orbits.marching.following.excursion_rules import OwnSteps, WithExcursions
from orbits.marching.following.follower import Follower
from orbits.marching.following.own_memory import ByOwnSteps
from orbits.marching.stepping.pool import Helpers


def follower_of(
    clock: Clock,
    form: Form,
    n: int,
    steps: int,
    helpers: Helpers,
    coefficients: Array,
    parameters: Any,
    followed: OwnSteps | None,
) -> Follower:
    """Return what marches the massless particles of a march.

    clock : of the march; coefficients : of a step of the method; parameters : of what acts on the bodies
    followed : the passages that a map leaves to steps of their own, or None; the others are those of `Follower`
    """
    if followed is not None:
        return WithExcursions(form, n, steps, helpers, followed, parameters)
    if clock.changes:
        return ByOwnSteps(form, n, steps, helpers, coefficients)
    return Follower(form, n, steps, helpers)
