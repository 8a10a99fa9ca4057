"""Kick – exact rotation – kick: splittings for Lagrangians of rigid bodies, whose drifts are free motions.

    p <- p + k_0 f(q);   for i = 1 ... s:   the free motion of the time d_i,   p <- p + k_i f(q)

Between kicks places drift, and each body turns as a free one does, exactly, by `orbits.kernels.rotation.free_rotation`:
there is no limit to the angle of a step, and a body without a potential is followed exactly. The lengths k and d are
those of `orbits.integrators.kicks_and_drifts.splitting`, for the same methods. The discrete Lagrangian of one drift
between two half kicks is

    L_d = S(q, q+; h) - h/2 [U(q) + U(q+)],     S the exact action of the free motion

Source: Celledoni, Fassò, Säfström & Zanna (2008), SIAM J. Sci. Comput. 30, 2084; Hairer, Lubich & Wanner (2006), sec.
II.5, VII.5.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from orbits.integrators.forms import Array
from orbits.integrators.rigid.rotors import (
    PI,
    PI_LO,
    U_LO,
    Turning,
    U,
    attract,
    four,
    kick,
    move,
    set_attitude,
    write_out,
)
from orbits.kernels.compile import kernel
from orbits.kernels.rotation.in_doubled_precision import turned_freely
from orbits.kernels.steps import NOT_FINITE, OK
from orbits.lagrangians.base import Lagrangian


@kernel(inline=True)
def turn_rotor(method, moments, h, carry, own):
    """Turn the rotor at `own` in the carry as a free body, with its energy to the last bit of doubled precision."""
    x = carry[own + PI], carry[own + PI_LO]
    y = carry[own + PI + 1], carry[own + PI_LO + 1]
    z = carry[own + PI + 2], carry[own + PI_LO + 2]
    set_attitude(carry, own, turned_freely(moments, h, four(carry, own + U), four(carry, own + U_LO), (x, y, z)))
    return True


@kernel(inline=True)
def step(method, model, t, h, state, storage):
    """Take one step."""
    table, carry = method.coefficients, storage.carry.reshape(-1)
    first = 1 + int(table[0, 1])
    last = int(table[0, 2])
    evaluations = 0
    if table[first, 0] != 0.0:
        if table[first, last] == 0.0:
            attract(method, model, t, state, storage)
            evaluations += 1
        if kick(method, state, carry, table[first, 0]) * 0.0 != 0.0:
            return NOT_FINITE, 0, evaluations
    now = t
    for i in range(last):
        move(method, model, state, carry, table[first + 1, i])
        now += table[first + 1, i]
        if table[first, i + 1] != 0.0:
            if not attract(method, model, now, state, storage):
                return NOT_FINITE, 0, evaluations
            evaluations += 1
            kick(method, state, carry, table[first, i + 1])
    write_out(method, state, carry)
    return OK, 0, evaluations


@dataclass(frozen=True)
class Rotating(Turning):
    """The form of kicks and free motions for a Lagrangian of rigid bodies.

    lengths : a function of h, proportional to it, that returns the s + 1 kicks and the s drifts between them
    """

    lengths: Callable[[float], tuple[Array, Array]]

    kernels: ClassVar[Mapping[str, Any]] = {**Turning.kernels, "step": step, "turn_rotor": turn_rotor}

    @classmethod
    def between(cls, lagrangian: Lagrangian, lengths: Callable[[float], tuple[Array, Array]]) -> Rotating:
        """Return the form of these kicks and drifts for the rigid bodies of a Lagrangian."""
        layout = Turning.of(lagrangian)
        return cls(layout.places, layout.rotors, lengths)

    def coefficients(self, h: float, before: float) -> Array:
        """Return the layout, with the number of drifts, then the kicks and the drifts."""
        layout, (kicks, drifts) = super().coefficients(h, before), self.lengths(h)
        layout[0, 2] = len(drifts)
        out = np.zeros((len(layout) + 2, max(4, len(kicks))))
        out[: len(layout), :4] = layout
        out[-2, : len(kicks)] = kicks
        out[-1, : len(drifts)] = drifts
        return out
