"""Kick – turn – kick for rigid bodies, in homogeneous quaternions: the step that all methods on SO(3) share.

With pi = R Pi the angular momentum in the axes of space, tau the torque in them, and places beside (p = m v),

    pi += h/2 tau,  p += h/2 f;     R <- R F, with the method's own F(Pi, h),  places += h p/m;     pi += h/2 tau,  ...

F conserves pi: a free body keeps it to the last bit, and what potentials do to it is added with its rounding error
kept. The attitude is a unit quaternion u with its low part, to which increments are added. What rounding does to |u| is
taken back at each step, along u, which turns nothing. Lengths of quaternions, which move nothing, are followed exactly:

    q = l u,     p = (r u + 2 (0, pi) u)/l,     l <- l exp(h r/(4 I_0)),     r = p . q

Forces and torques are dL/dq at rest: tau = vec(f u_conjugate)/2. One evaluation is made in each step.

Source: Lee, Leok & McClamroch (2007), Comput. Methods Appl. Mech. Engrg. 196, 2907; Hairer, Lubich & Wanner (2006),
sec. VII.5.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from orbits.integrators.forms import Array, Form, padded
from orbits.kernels.binding import gradients, kernel_of
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import WIDTH
from orbits.kernels.rotation.in_doubled_precision import changed
from orbits.kernels.steps import NOT_CONVERGED, NOT_FINITE, OK
from orbits.kernels.sums.summation import accumulate
from orbits.lagrangians.base import Lagrangian

# What the carry has of each rotor, one after another: u, its low part, pi, its low part, r, 4 I_0, l, tau; then, of the
# places, the forces and the masses.
U, U_LO, PI, PI_LO, RADIAL, SPARE, LENGTH, TORQUE, KNOWN = 0, 4, 8, 11, 14, 15, 16, 17, 20
ROTOR = 24

STILL = 2.0**-50
"""A length of q that changes by less than this fraction while the body turns by a radian is at rest: round-off."""


@verb
def turn(method, moments, h, attitude, momentum):
    """Return whether a turn is found, and the change of the unit quaternion of the attitude: (found, a, b, c, d).

    moments : (A, B, C); attitude : (a, b, c, d); momentum : in the axes of the body, (x, y, z)
    """
    return kernel_of(method.types[0], "turn")


@kernel(inline=True)
def cross(x, y):
    """Return x cross y, of tuples."""
    return x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]


@kernel(inline=True)
def times(p, q):
    """Return the product of two quaternions."""
    a, b, c, d = p
    e, f, g, k = q
    return (
        a * e - b * f - c * g - d * k,
        a * f + b * e + c * k - d * g,
        a * g - b * k + c * e + d * f,
        a * k + b * g - c * f + d * e,
    )


@kernel(inline=True)
def generated(f, q):
    """Return vec(f q_conjugate)/2, what a covector at q is for rotations of space."""
    a, b, c, d = q
    return (
        0.5 * (a * f[1] - b * f[0] + c * f[3] - d * f[2]),
        0.5 * (a * f[2] - c * f[0] + d * f[1] - b * f[3]),
        0.5 * (a * f[3] - d * f[0] + b * f[2] - c * f[1]),
    )


@kernel(inline=True)
def in_body(q, x):
    """Return R^T x, R being the rotation of the unit quaternion q."""
    axis = (q[1], q[2], q[3])
    once = cross(axis, x)
    twice = cross(axis, once)
    return (
        x[0] + 2.0 * (twice[0] - q[0] * once[0]),
        x[1] + 2.0 * (twice[1] - q[0] * once[1]),
        x[2] + 2.0 * (twice[2] - q[0] * once[2]),
    )


@kernel(inline=True)
def four(x, at):
    """Return four elements of a vector as a tuple."""
    return x[at], x[at + 1], x[at + 2], x[at + 3]


@kernel
def attract(method, model, t, state, storage):
    """Write the torques, in the axes of space, and the forces on places into the carry. Returns whether they are
    finite.
    """
    table, carry, scratch = method.coefficients, storage.carry.reshape(-1), storage.scratch
    places, rotors = int(table[0, 0]), int(table[0, 1])
    Q, V, f, p = scratch[0], scratch[1], scratch[2], scratch[3]
    for k in range(places):
        Q[k], V[k] = state.q[k], 0.0
    for i in range(rotors):
        at = int(table[1 + i, 0])
        for k in range(4):
            Q[at + k], V[at + k] = carry[ROTOR * i + U + k], 0.0
    gradients(model.tag, model.parameters, t, Q, V, f, p)
    size = 0.0
    for k in range(places):
        carry[ROTOR * rotors + k] = f[k]
        size += abs(f[k])
    for i in range(rotors):
        at = int(table[1 + i, 0])
        torque = generated(four(f, at), four(Q, at))
        for k in range(3):
            carry[ROTOR * i + TORQUE + k] = torque[k]
            size += abs(torque[k])
    return size * 0.0 == 0.0


@kernel
def set_out(method, model, t, state, storage):
    """Write what is marched of the rotors, and the constants of all, into the carry."""
    table, carry, scratch = method.coefficients, storage.carry.reshape(-1), storage.scratch
    places, rotors = int(table[0, 0]), int(table[0, 1])
    V, f, p = scratch[1], scratch[2], scratch[3]
    for k in range(places):
        V[k] = 1.0
    for i in range(rotors):
        at = int(table[1 + i, 0])
        for k in range(4):
            V[at + k] = state.q[at + k]
    # With unit velocities, momenta are masses; with v = q, which turns nothing, p . q = 4 I_0.
    gradients(model.tag, model.parameters, t, state.q, V, f, p)
    for k in range(places):
        carry[ROTOR * rotors + places + k] = p[k]
    for i in range(rotors):
        at, own = int(table[1 + i, 0]), ROTOR * i
        q, y = four(state.q, at), four(state.p, at)
        length = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
        momentum = generated(y, q)
        radial = q[0] * y[0] + q[1] * y[1] + q[2] * y[2] + q[3] * y[3]
        turning = abs(momentum[0]) + abs(momentum[1]) + abs(momentum[2])
        carry[own + RADIAL] = radial if abs(radial) > STILL * turning else 0.0
        carry[own + SPARE] = q[0] * p[at] + q[1] * p[at + 1] + q[2] * p[at + 2] + q[3] * p[at + 3]
        carry[own + LENGTH] = length
        carry[own + KNOWN] = 1.0
        for k in range(4):
            carry[own + U + k], carry[own + U_LO + k] = q[k] / length, 0.0
        for k in range(3):
            carry[own + PI + k], carry[own + PI_LO + k] = momentum[k], 0.0


@kernel(inline=True)
def begin(method, model, t, h, state, storage):
    """At a cold start, compute what is marched, and the first torque; later steps take both from the carry."""
    if storage.carry.reshape(-1)[KNOWN] == 0.0:
        set_out(method, model, t, state, storage)
        attract(method, model, t, state, storage)


@kernel(inline=True)
def kick(method, state, carry, h):
    """Advance all momenta by h times the forces in the carry. Returns their size."""
    table = method.coefficients
    places, rotors = int(table[0, 0]), int(table[0, 1])
    size = 0.0
    for k in range(places):
        state.p[k], state.p_lo[k] = accumulate(state.p[k], state.p_lo[k], h * carry[ROTOR * rotors + k])
        size += abs(state.p[k])
    for i in range(rotors):
        own = ROTOR * i
        for k in range(3):
            hi, lo = accumulate(carry[own + PI + k], carry[own + PI_LO + k], h * carry[own + TORQUE + k])
            carry[own + PI + k], carry[own + PI_LO + k] = hi, lo
            size += abs(hi)
    return size


@kernel(inline=True)
def set_attitude(carry, own, pairs):
    """Write the attitude of the rotor at `own` into the carry: a quaternion and its low part."""
    (a, b, c, d), (a_lo, b_lo, c_lo, d_lo) = pairs
    carry[own + U], carry[own + U + 1], carry[own + U + 2], carry[own + U + 3] = a, b, c, d
    carry[own + U_LO], carry[own + U_LO + 1], carry[own + U_LO + 2], carry[own + U_LO + 3] = a_lo, b_lo, c_lo, d_lo


@kernel(inline=True)
def add_to_attitude(carry, own, change):
    """Add a change to the attitude of the rotor at `own` in the carry; take back what rounding did to its length."""
    set_attitude(carry, own, changed(four(carry, own + U), four(carry, own + U_LO), change))


@verb
def turn_rotor(method, moments, h, carry, own):
    """Turn the rotor at `own` in the carry by the method's `turn`, or as the method itself does. Returns whether a turn
    is found.
    """
    compiled = kernel_of(method.types[0], "turn_rotor")
    if compiled is not None:
        return compiled

    def by_turn(method, moments, h, carry, own):
        u = four(carry, own + U)
        momentum = in_body(u, (carry[own + PI], carry[own + PI + 1], carry[own + PI + 2]))
        found, a, b, c, d = turn(method, moments, h, u, momentum)
        if found:
            add_to_attitude(carry, own, (a, b, c, d))
        return found

    return by_turn


@kernel(inline=True)
def move(method, model, state, carry, h):
    """Turn the bodies and move the places. Returns the number of the first body whose turn is not found, or -1."""
    table, parameters = method.coefficients, model.parameters
    places, rotors = int(table[0, 0]), int(table[0, 1])
    for k in range(places):
        rate = state.p[k] / carry[ROTOR * rotors + places + k]
        state.q[k], state.q_lo[k] = accumulate(state.q[k], state.q_lo[k], h * rate)
    for i in range(rotors):
        own, row = ROTOR * i, table[1 + i]
        moments = parameters[int(row[1])], parameters[int(row[2])], parameters[int(row[3])]
        if not turn_rotor(method, moments, h, carry, own):
            return i
        if carry[own + RADIAL] != 0.0:
            carry[own + LENGTH] *= math.exp(h * carry[own + RADIAL] / carry[own + SPARE])
    return -1


@kernel(inline=True)
def write_out(method, state, carry):
    """Write quaternions and their momenta into the state."""
    for i in range(int(method.coefficients[0, 1])):
        at, own = int(method.coefficients[1 + i, 0]), ROTOR * i
        u, length, radial = four(carry, own + U), carry[own + LENGTH], carry[own + RADIAL]
        y = times((0.0, carry[own + PI], carry[own + PI + 1], carry[own + PI + 2]), u)
        for k in range(4):
            state.q[at + k] = length * u[k]
            state.p[at + k] = (2.0 * y[k] + radial * u[k]) / length


@kernel(inline=True)
def step(method, model, t, h, state, storage):
    """Take one step. Where it fails, `where` is the number of the body."""
    carry = storage.carry.reshape(-1)
    if kick(method, state, carry, 0.5 * h) * 0.0 != 0.0:
        return NOT_FINITE, 0, 0
    lost = move(method, model, state, carry, h)
    if lost >= 0:
        return NOT_CONVERGED, lost, 0
    if not attract(method, model, t + h, state, storage):
        return NOT_FINITE, 0, 1
    kick(method, state, carry, 0.5 * h)
    write_out(method, state, carry)
    return OK, 0, 1


@dataclass(frozen=True)
class Turning(Form):
    """The canonical form of a method that turns rigid bodies between kicks; a method adds the kernel `turn`.

    places : the number of coordinates before the quaternions
    rotors : of each, where its quaternion begins, and where its moments are among the parameters
    """

    places: int
    rotors: tuple[tuple[int, int, int, int], ...]

    kernels: ClassVar[Mapping[str, Any]] = {"begin": begin, "step": step}

    @classmethod
    def of(cls, lagrangian: Lagrangian) -> Turning:
        """Return the form for the rigid bodies of a Lagrangian."""
        names = list(lagrangian.parameters)
        rows = [(rotor.at, *(names.index(name) for name in rotor.moments)) for rotor in lagrangian.rotors]
        return cls(lagrangian.rotors[0].at, tuple(rows))  # type: ignore[arg-type]

    def coefficients(self, h: float, before: float) -> Array:
        """Return the layout, (1 + rotors, 4)."""
        return np.array([(self.places, len(self.rotors), 0, 0), *self.rotors], dtype=np.float64)

    def stages_shape(self, size: int) -> tuple[int, int]:
        """Empty: there are no massless particles."""
        return 1, 1

    def carry_rows(self, size: int) -> int:
        """What is marched of the rotors, and forces and masses of the places."""
        return (ROTOR * len(self.rotors) + 2 * self.places + WIDTH - 1) // WIDTH

    def scratch_shape(self, size: int) -> tuple[int, int]:
        """Positions, velocities, forces and momenta, of which the Lagrangian's gradients are taken."""
        return 4, padded(size)
