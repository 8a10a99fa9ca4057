"""Kicks and drifts of bodies of which some are rigid: a drift turns them too, freely and exactly.

    v <- v + k g(q, R),  l <- l + k M(q, R);   then  q <- q + d v,  R <- free rotation of R for d

The kinetic energy is that of motion and rotation, the potential that of all terms and of the second degree of the rigid
bodies (`orbits.kernels.gravity.rigid_bodies`). Both flows are exact, so that every splitting of kicks and drifts keeps
its order, is symplectic, and conserves the angular momentum of orbits and spins.

Massless bodies follow in lanes, rigid or not, through the positions and attitudes of the massive ones at the kicks.

Source: numerically as Hairer, Lubich & Wanner (2006), sec. VII.5; Touma & Wisdom (1994), Astron. J. 107, 1189.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from orbits.integrators.forms import Array, padded
from orbits.integrators.kicks_and_drifts.splitting import Splitting, stretch
from orbits.kernels.compile import kernel
from orbits.kernels.gravity.rigid_bodies import (
    STATE_ROWS,
    accelerate_by_terms,
    field_of_bodies,
    field_of_terms,
    field_on_tops,
    keep_tops,
    kick_spins,
    moments_of_tops,
    note_attitudes,
    pull,
    state_of_tops,
    turn,
    turned,
)
from orbits.kernels.gravity.terms_and_forces import FIGURES
from orbits.kernels.lanes import WIDTH
from orbits.kernels.state import copy, drift, drifted, kick, kicked
from orbits.kernels.steps import OK
from orbits.kernels.sums.summation import accumulate

STATE = STATE_ROWS * WIDTH
"""The numbers of the state of a rigid body."""


@kernel(inline=True)
def attract(model, q, storage):
    """Write the accelerations and the rates of the spins into the two rows of scratch."""
    strength, own = model.parameters[0], model.parameters[len(model.parameters) - 1]
    accelerate_by_terms(model.tag, model.parameters, q, storage.scratch[0])
    pull(strength, own, q, storage.carry, storage.scratch[0], storage.scratch[1])


@kernel(inline=True)
def begin(method, model, t, h, state, storage):
    """Compute the force of the first kick, which later steps take over from the last kick."""
    kicks, last = method.coefficients[0], method.coefficients.shape[1] - 1
    if kicks[0] != 0.0 and kicks[last] != 0.0:
        attract(model, state.q, storage)


@kernel(inline=True)
def step(method, model, t, h, state, storage):
    """Take one step; `storage.stages` receives the positions and attitudes before it and after each drift."""
    kicks, drifts, last = method.coefficients[0], method.coefficients[1], method.coefficients.shape[1] - 1
    q, q_lo, v, v_lo = state
    own, (start, stop) = model.parameters[len(model.parameters) - 1], (storage.share.start, storage.share.stop)
    g, torques, stages, evaluations = storage.scratch[0], storage.scratch[1], storage.stages, 0
    copy(q, start, stop, stages[0])
    note_attitudes(own, storage.carry, stages[0])
    if kicks[0] != 0.0:
        if kicks[last] == 0.0:
            attract(model, q, storage)
            evaluations += 1
        kick(v, v_lo, kicks[0], g, start, stop)
        kick_spins(own, storage.carry, kicks[0], torques)
    for i in range(last):
        drift(q, q_lo, drifts[i], v, v_lo, start, stop)
        turn(own, storage.carry, drifts[i])
        copy(q, start, stop, stages[i + 1])
        note_attitudes(own, storage.carry, stages[i + 1])
        if kicks[i + 1] != 0.0:
            attract(model, q, storage)
            evaluations += 1
            kick(v, v_lo, kicks[i + 1], g, start, stop)
            kick_spins(own, storage.carry, kicks[i + 1], torques)
    return OK, 0, evaluations


@kernel(inline=True)
def field(model, stage, particles):
    """Return the accelerations of massless particles by terms and by the second degree of rigid bodies."""
    strength, own = model.parameters[0], model.parameters[len(model.parameters) - 1]
    place = particles.x, particles.y, particles.z
    g = field_of_terms(model.tag, model.parameters, stage, particles.x, particles.y, particles.z)
    more = field_of_bodies(strength, own, stage, place)
    return g[0] + more[0], g[1] + more[1], g[2] + more[2]


@kernel(inline=True)
def begin_particles(method, model, particles, storage):
    """Return the accelerations of the particles, the carry of this method."""
    return field(model, storage.stages[0], particles)


@kernel(inline=True)
def step_particles(method, model, t, h, particles, carry, storage):
    """Take one step of eight particles in the field of the bodies before it and after each drift."""
    kicks, drifts, last = method.coefficients[0], method.coefficients[1], method.coefficients.shape[1] - 1
    evaluations = 0
    if kicks[0] != 0.0:
        if kicks[last] == 0.0:
            carry = field(model, storage.stages[0], particles)
            evaluations += 1
        particles = kicked(particles, kicks[0], carry)
    for i in range(last):
        particles = drifted(particles, drifts[i])
        if kicks[i + 1] != 0.0:
            carry = field(model, storage.stages[i + 1], particles)
            evaluations += 1
            particles = kicked(particles, kicks[i + 1], carry)
    return particles, carry, OK, evaluations


@kernel(inline=True)
def field_with_torques(model, stage, particles, attitude, first):
    """Return the accelerations of massless rigid bodies, and the rates of their spins."""
    strength, own = model.parameters[0], model.parameters[len(model.parameters) - 1]
    g = field(model, stage, particles)
    more, rates = field_on_tops(strength, own, stage, (particles.x, particles.y, particles.z), first, attitude)
    return (g[0] + more[0], g[1] + more[1], g[2] + more[2]), rates


@kernel(inline=True)
def kicked_spins(spin, spin_lo, h, rates):
    """Return spins and their low parts after a kick of h."""
    one, one_lo = accumulate(spin[0], spin_lo[0], h * rates[0])
    two, two_lo = accumulate(spin[1], spin_lo[1], h * rates[1])
    three, three_lo = accumulate(spin[2], spin_lo[2], h * rates[2])
    return (one, two, three), (one_lo, two_lo, three_lo)


@kernel(inline=True)
def begin_tops(method, model, particles, storage):
    """Return the attitudes and spins of the particles, with their accelerations and the rates of their spins."""
    attitude, low, spin, spin_lo = state_of_tops(storage.carry, storage.share.start)
    g, rates = field_with_torques(model, storage.stages[0], particles, attitude, storage.share.start)
    return attitude, low, spin, spin_lo, g, rates


@kernel(inline=True)
def step_tops(method, model, t, h, particles, carry, storage):
    """Take one step of eight massless particles that turn."""
    kicks, drifts, last = method.coefficients[0], method.coefficients[1], method.coefficients.shape[1] - 1
    own, first = model.parameters[len(model.parameters) - 1], storage.share.start
    attitude, low, spin, spin_lo, g, rates = carry
    moments, evaluations = moments_of_tops(own, first), 0
    if kicks[0] != 0.0:
        if kicks[last] == 0.0:
            g, rates = field_with_torques(model, storage.stages[0], particles, attitude, first)
            evaluations += 1
        particles = kicked(particles, kicks[0], g)
        spin, spin_lo = kicked_spins(spin, spin_lo, kicks[0], rates)
    for i in range(last):
        particles = drifted(particles, drifts[i])
        attitude, low = turned(moments, drifts[i], attitude, low, spin, spin_lo)
        if kicks[i + 1] != 0.0:
            g, rates = field_with_torques(model, storage.stages[i + 1], particles, attitude, first)
            evaluations += 1
            particles = kicked(particles, kicks[i + 1], g)
            spin, spin_lo = kicked_spins(spin, spin_lo, kicks[i + 1], rates)
    return particles, (attitude, low, spin, spin_lo, g, rates), OK, evaluations


@kernel(inline=True)
def keep_particles(method, carry, storage):
    """Write the attitudes and spins of eight particles into their rows."""
    keep_tops(storage.carry, storage.share.start, carry[0], carry[1], carry[2], carry[3])


@dataclass(frozen=True)
class RigidSplitting(Splitting):
    """Kicks and drifts of bodies of which some are rigid.

    rigid : the number of rigid bodies with mass; tops : the numbers of the massless particles that are rigid
    """

    rigid: int = 0
    tops: tuple[int, ...] = ()

    kernels: ClassVar[Mapping[str, Any]] = {
        "begin": begin,
        "step": step,
        "begin_particles": begin_particles,
        "step_particles": step_particles,
        "stretch": stretch,
    }

    def own_kernels(self) -> Mapping[str, Any]:
        """Return the kernels; without massless rigid bodies, particles are points."""
        of_tops = {"begin_particles": begin_tops, "step_particles": step_tops, "keep_particles": keep_particles}
        return {**self.kernels, **of_tops} if self.tops else self.kernels

    @property
    def shared(self) -> bool:
        """False: one thread advances all massive bodies."""
        return False

    def stages_shape(self, size: int) -> tuple[int, int]:
        """Positions and attitudes before the step and after each drift."""
        return self.drifts + 1, padded(size) + padded(4 * self.rigid)

    def scratch_shape(self, size: int) -> tuple[int, int]:
        """Accelerations, and the rates of spins."""
        return 2, padded(size)

    def carry_rows(self, size: int) -> int:
        """The states of the rigid bodies."""
        return STATE_ROWS * self.rigid

    @property
    def particle_carry_rows(self) -> int:
        """The state of each massless particle, if some are rigid."""
        return STATE_ROWS if self.tops else 0

    def forget(self, carry: Array) -> None:
        """Delete nothing: no part of the carry depends on the length of the steps."""

    def accounts(self, carry: Array) -> Array:
        """Zeros: rigid bodies are part of the Lagrangian, and take nothing from the bodies."""
        return np.zeros((1, FIGURES))

    def inner_values(self, state: Mapping[str, Array]) -> Array:
        """Return the states of the rigid bodies, those with mass first."""
        massive = state["memory"][: STATE_ROWS * self.rigid].reshape(-1)
        return np.concatenate([massive, state["particle_memory"][list(self.tops)].reshape(-1)])

    def set_inner(self, state: Mapping[str, Array], values: Array) -> None:
        """Write the states of the rigid bodies; massless bodies that are not rigid do not turn."""
        massive = STATE * self.rigid
        state["memory"][...] = values[:massive].reshape(-1, WIDTH)
        if self.tops:
            state["particle_memory"][:, 0, 0] = 1.0
            state["particle_memory"][list(self.tops)] = values[massive:].reshape(-1, STATE_ROWS, WIDTH)
