"""Wisdom–Holman maps: planets about a dominant body, on exact Kepler orbits between kicks by their interaction.

With the Hamiltonian in Jacobi coordinates (`orbits.kernels.jacobi`) as A + B, A the free centre of mass and the Kepler
motions and B the interaction, whose potential is V, a step is half a kick, Kepler motions, half a kick. It is the
variational integrator of

    L_d(q, q+; h) = M |Q+ - Q|^2 / (2h) + sum_i m'_i S_i(q_i, q_i+; h) - h/2 [V(q) + V(q+)]

with S_i the exact discrete Lagrangian of Kepler's problem. Its error is of the order of (mass of the planets) h^2.
A corrector is a change of variables, applied once at the start and undone for outputs on a copy, that removes this
error up to a power of h: what remains is of the second order in the masses. Its largest part is removed by the modified
kick, by the potential V - h^2/24 sum_i m'_i |a_i|^2 with a the acceleration by V; V in L_d is then this one. The lazy
kick is the acceleration by V at q + h^2/12 a: the same to the second order in the masses, beyond which it is not
symplectic. State and corrected state are in doubled precision.

Terms of the dominant body, such as relativity and oblateness, are a part of B: those of positions alone in its kicks,
all others as a flow for half a step on both sides of the Kepler motions; see `orbits.kernels.terms_about`.

Source: Wisdom & Holman (1991), AJ 102, 1528; Wisdom, Holman & Touma (1996), Fields Inst. Commun. 10, 217; Wisdom
(2006), AJ 131, 2294; Rein, Tamayo & Brown (2019), MNRAS 489, 4632.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from orbits.checks import finite_number
from orbits.errors import InputError, shown
from orbits.integrators.base import MOMENTUM_MAPS, SYMMETRIC, SYMPLECTIC, Integrator, option
from orbits.integrators.democratic_heliocentric import DemocraticHeliocentric
from orbits.integrators.dominant import registers, require_dominant
from orbits.integrators.forms import Array, Form, padded
from orbits.kernels.compile import kernel
from orbits.kernels.interaction import ROWS, STATE_ROWS, displace, interact, modify
from orbits.kernels.jacobi import (
    TRACE_ROWS,
    advance_planets,
    enter_planets,
    finish_velocities,
    kick_planets,
    leave_planets,
    move_planets,
    number_planets,
    prepare_room,
    show_planets,
    step_lazy,
    step_modified,
    step_plain,
    trace_planets,
)
from orbits.kernels.jacobi_particles import (
    AWAY,
    DISPLACED,
    MEMORY_ROWS,
    MODIFIED,
    PLAIN,
    drifted_particles,
    enter_among,
    flow_rows,
    flowing_particles,
    half_of_marched,
    interaction,
    joined_marched,
    kicked_particles,
    leave_among,
    seen_particles,
    store_marched,
    table_rows,
    tabulate,
    tabulate_centres,
    take_particles,
    with_interaction,
)
from orbits.kernels.lanes import WIDTH, full, halves
from orbits.kernels.steps import OK, Particles
from orbits.kernels.systems.approaches import ALL_ROWS
from orbits.kernels.systems.planets import MOST_PLANETS
from orbits.kernels.systems.planets_march import march_planets
from orbits.kernels.terms_about import flow, flow_among, kick_more, strength_of, to_momenta, to_velocities
from orbits.lagrangians.base import ABOUT_ONE_BODY, NEWTONIAN, Lagrangian
from orbits.tableaux.correctors import PAIRS, corrector_lengths

HALF, WHOLE, SHIFT, LAZY = 0, 1, 2, 3
"""Columns of the first row of the coefficients: half a kick, the Kepler motion, h^2/12 for the modified and the lazy
kick, and 1 for the latter. The other rows are the corrector: a Kepler motion and a kick each."""

KERNELS = "modified-kick", "lazy", "standard"

NO_TABLE = -1
"""The row of a table of the flow of terms that nobody reads."""

COORDINATES = "jacobi", "democratic-heliocentric"

ENCOUNTERS = "warn", "follow", "retire"


@kernel
def _kick_of_a_step(model, coefficients, planets, room):
    """Write the interaction for the kick: plain, modified, or at displaced positions; with the kicks of terms."""
    count = strength_of(model).shape[0] - 2
    interact(planets, room, count, False)
    if coefficients[0, LAZY] != 0.0:
        kick_more(model, planets, room)
        displace(planets, room, coefficients[0, SHIFT])
        interact(planets, room, count, True)
    elif coefficients[0, SHIFT] != 0.0:
        modify(planets, room, count, coefficients[0, SHIFT])
    kick_more(model, planets, room)


@kernel
def _correct(model, coefficients, planets, room, sign):
    """Apply the corrector, or its inverse for sign = -1."""
    stages, count = coefficients.shape[0] - 1, strength_of(model).shape[0] - 2
    for i in range(stages):
        row = 1 + i if sign > 0.0 else stages - i
        move_planets(planets, room, sign * coefficients[row, 0], 0.0)
        finish_velocities(planets, room, 0.0)
        # Backwards, the kick before a Kepler motion follows it.
        other = row if sign > 0.0 else row - 1
        length = coefficients[other, 1] if other > 0 else 0.0
        if length != 0.0:
            if sign > 0.0:
                flow(model, planets, room, length)
            interact(planets, room, count, False)
            kick_more(model, planets, room)
            kick_planets(planets, room, sign * length)
            if sign < 0.0:
                flow(model, planets, room, -length)


@kernel
def enter(method, model, h, state, storage):
    """Change to corrected Jacobi coordinates."""
    planets, room = storage.carry, storage.scratch
    enter_planets(strength_of(model), state.q, state.q_lo, state.p, state.p_lo, planets, room)
    to_momenta(model, planets, room, storage.stages, NO_TABLE)
    _correct(model, method.coefficients, planets, room, 1.0)


@kernel
def leave(method, model, h, state, storage):
    """Change back; the marched state is lost."""
    strength, planets, room = strength_of(model), storage.carry, storage.scratch
    prepare_room(strength, planets, room)
    _correct(model, method.coefficients, planets, room, -1.0)
    to_velocities(model, planets, room, storage.stages, NO_TABLE)
    leave_planets(strength, planets, room, state.q, state.q_lo, state.p, state.p_lo)


@kernel
def show(method, model, state, storage):
    """Write the state of the bodies, uncorrected."""
    show_planets(strength_of(model), storage.carry, storage.scratch, state.q, state.p)


@kernel(inline=True)
def trace(method, model, state, storage, path, row):
    """Write a single register of planets as it is marched, rounded, or else the state that is seen."""
    if path.shape[0] == 0:
        return
    if storage.scratch.shape[0] < 2 * ROWS:
        trace_planets(storage.carry, path, TRACE_ROWS * WIDTH * row)
        return
    width = state.q.shape[0]
    first = 2 * row * width
    show_planets(
        strength_of(model), storage.carry, storage.scratch, path[first : first + width],
        path[first + width : first + 2 * width],
    )  # fmt: skip


@kernel
def begin(method, model, t, h, state, storage):
    """Compute the interaction of the first half of a kick, which later steps take over."""
    prepare_room(strength_of(model), storage.carry, storage.scratch)
    _kick_of_a_step(model, method.coefficients, storage.carry, storage.scratch)


@kernel(inline=True)
def step(method, model, t, h, state, storage):
    """Take one step: half a kick, Kepler motions, half a kick."""
    coefficients, planets, room = method.coefficients, storage.carry, storage.scratch
    if room.shape[0] < 2 * ROWS:
        if coefficients[0, LAZY] != 0.0:
            step_lazy(planets, room, coefficients[0, WHOLE], coefficients[0, SHIFT])
        elif coefficients[0, SHIFT] != 0.0:
            step_modified(planets, room, coefficients[0, WHOLE], coefficients[0, SHIFT])
        else:
            step_plain(planets, room, coefficients[0, WHOLE])
    else:
        half = coefficients[0, HALF]
        advance_planets(planets, room, coefficients[0, WHOLE], half)
        _kick_of_a_step(model, coefficients, planets, room)
        finish_velocities(planets, room, half)
    return OK, 0, 1


@kernel
def step_with_terms(method, model, t, h, state, storage):
    """As `step`, with half the flow of terms that depend on velocities before and after the Kepler motions."""
    coefficients, planets, room = method.coefficients, storage.carry, storage.scratch
    half, whole = coefficients[0, HALF], coefficients[0, WHOLE]
    kick_planets(planets, room, half)
    flow(model, planets, room, half)
    advance_planets(planets, room, whole, 0.0)
    finish_velocities(planets, room, 0.0)
    flow(model, planets, room, half)
    _kick_of_a_step(model, coefficients, planets, room)
    kick_planets(planets, room, half)
    return OK, 0, 1


@kernel
def _kick_among_particles(model, coefficients, planets, room, stages, first):
    """As `_kick_of_a_step`, with a table for particles, from row `first` of the stages on."""
    strength, count = strength_of(model), strength_of(model).shape[0] - 2
    modified = coefficients[0, LAZY] == 0.0 and coefficients[0, SHIFT] != 0.0
    interact(planets, room, count, False)
    if not modified:
        kick_more(model, planets, room)
    tabulate(strength, planets, room, stages, first, PLAIN)
    if modified:
        modify(planets, room, count, coefficients[0, SHIFT])
        kick_more(model, planets, room)
        tabulate(strength, planets, room, stages, first, MODIFIED)
    elif coefficients[0, LAZY] != 0.0:
        displace(planets, room, coefficients[0, SHIFT])
        interact(planets, room, count, True)
        kick_more(model, planets, room)
        tabulate(strength, planets, room, stages, first, DISPLACED)


@kernel
def begin_among_particles(method, model, t, h, state, storage):
    """As `begin`, with the table before the first step of a block."""
    planets, room = storage.carry, storage.scratch
    prepare_room(strength_of(model), planets, room)
    _kick_among_particles(model, method.coefficients, planets, room, storage.stages, 0)


@kernel
def step_among_particles(method, model, t, h, state, storage):
    """As `step`, with the table after it: of the planets to the same bits."""
    coefficients, planets, room = method.coefficients, storage.carry, storage.scratch
    strength, half, after = model.parameters, coefficients[0, HALF], table_rows(model.parameters.shape[0] - 2)
    advance_planets(planets, room, coefficients[0, WHOLE], half)
    _kick_among_particles(model, coefficients, planets, room, storage.stages, after)
    finish_velocities(planets, room, half)
    tabulate_centres(strength, planets, room, storage.stages, after)
    return OK, 0, 1


@kernel
def step_with_terms_among_particles(method, model, t, h, state, storage):
    """As `step_with_terms`, with the table after it, and two of the flow of terms."""
    coefficients, planets, room, stages = method.coefficients, storage.carry, storage.scratch, storage.stages
    strength, half = strength_of(model), coefficients[0, HALF]
    count = strength.shape[0] - 2
    after, flows = table_rows(count), flow_rows(count)
    kick_planets(planets, room, half)
    flow_among(model, planets, room, stages, flows, half)
    advance_planets(planets, room, coefficients[0, WHOLE], 0.0)
    finish_velocities(planets, room, 0.0)
    flow_among(model, planets, room, stages, flows + 3 * (count + 1), half)
    _kick_among_particles(model, coefficients, planets, room, stages, after)
    kick_planets(planets, room, half)
    tabulate_centres(strength, planets, room, stages, after)
    return OK, 0, 1


@kernel(inline=True)
def begin_particles(method, model, particles, storage):
    """Return eight particles as they are marched, from their rows of the carry, with g."""
    coefficients, rows = method.coefficients, storage.scratch
    # Those that are retired are at one place, as the padding is.
    there = 1.0 - (particles.x == AWAY) * (particles.y == AWAY) * (particles.z == AWAY)
    marched = take_particles(storage.carry, storage.share.start, there, rows)
    return with_interaction(model, storage.stages, 0, coefficients[0, SHIFT], coefficients[0, LAZY], marched, rows)


@kernel(inline=True)
def step_particles(method, model, t, h, particles, carry, storage):
    """Take one step of eight particles: half a kick, Kepler motions, half a kick. They are returned as observers see
    them.
    """
    marched, (x, y, z, vx, vy, vz) = _stepped(method, model, carry, storage)
    zero = full(0.0)
    return Particles(x, y, z, zero, zero, zero, vx, vy, vz, zero, zero, zero), marched, OK, 1


@kernel(inline=True)
def _stepped(method, model, carry, storage):
    """Return particles after a step, as they are marched and as observers see them."""
    coefficients, rows, count = method.coefficients, storage.scratch, model.parameters.shape[0] - 2
    half, first = coefficients[0, HALF], table_rows(count)
    marched, ax, ay, az = drifted_particles(carry, coefficients[0, WHOLE], half)
    g = interaction(model, storage.stages, first, coefficients[0, SHIFT], coefficients[0, LAZY], marched, rows)
    marched = kicked_particles(marched, (ax, ay, az), half, g)
    return marched, seen_particles(storage.stages, first, marched, rows)


@kernel(inline=True)
def keep_particles(method, carry, storage):
    """Write eight particles as they are marched into their rows of the carry."""
    store_marched(storage.carry, storage.share.start, carry, storage.scratch)


@kernel(inline=True)
def begin_pair(method, model, one, two, storages):
    """Return two times eight particles as they are marched."""
    first = begin_particles(method, model, one, storages[0])
    return joined_marched(first, begin_particles(method, model, two, storages[1]))


@kernel(inline=True)
def step_pair(method, model, t, h, one, two, carry, storages):
    """Take one step of two times eight particles, whose instructions alternate."""
    marched, (x, y, z, u, v, w) = _stepped(method, model, carry, storages[0])
    (x0, x1), (y0, y1), (z0, z1) = halves(x), halves(y), halves(z)
    (u0, u1), (v0, v1), (w0, w1), zero = halves(u), halves(v), halves(w), full(0.0)
    one = Particles(x0, y0, z0, zero, zero, zero, u0, v0, w0, zero, zero, zero)
    return one, Particles(x1, y1, z1, zero, zero, zero, u1, v1, w1, zero, zero, zero), marched, 1


@kernel(inline=True)
def keep_pair(method, carry, storages):
    """Write two times eight particles as they are marched into their rows of the carry."""
    keep_particles(method, half_of_marched(carry, 0), storages[0])
    keep_particles(method, half_of_marched(carry, 1), storages[1])


@kernel(inline=True)
def step_particles_with_terms(method, model, t, h, particles, carry, storage):
    """As `step_particles`, with half the flow of terms before and after the Kepler motions."""
    coefficients, rows, count = method.coefficients, storage.scratch, strength_of(model).shape[0] - 2
    half, first, flows = coefficients[0, HALF], table_rows(count), flow_rows(count)
    zero = full(0.0)
    marched = kicked_particles(carry, (zero, zero, zero), half, (carry.gx, carry.gy, carry.gz))
    marched = flowing_particles(model, storage.stages, flows, marched, rows, half)
    marched, ax, ay, az = drifted_particles(marched, coefficients[0, WHOLE], 0.0)
    marched = kicked_particles(marched, (ax, ay, az), 0.0, (carry.gx, carry.gy, carry.gz))
    marched = flowing_particles(model, storage.stages, flows + 3 * (count + 1), marched, rows, half)
    g = interaction(model, storage.stages, first, coefficients[0, SHIFT], coefficients[0, LAZY], marched, rows)
    marched = kicked_particles(marched, (zero, zero, zero), half, g)
    x, y, z, vx, vy, vz = seen_particles(storage.stages, first, marched, rows)
    return Particles(x, y, z, zero, zero, zero, vx, vy, vz, zero, zero, zero), marched, OK, 1


@kernel
def enter_particles(method, model, state, particles, rows, storage):
    """Change to corrected Jacobi coordinates."""
    planets, room = storage.carry, storage.scratch
    enter_planets(strength_of(model), state.q, state.q_lo, state.p, state.p_lo, planets, room)
    enter_among(model, method.coefficients, planets, room, storage.stages, particles, rows, storage.share)


@kernel
def leave_particles(method, model, state, particles, rows, storage):
    """Change back; what is marched is lost."""
    planets, room = storage.carry, storage.scratch
    prepare_room(strength_of(model), planets, room)
    leave_among(model, method.coefficients, planets, room, storage.stages, particles, rows, storage.share)


@kernel
def stretch(method, unit, factor):
    """Write the coefficients of a step `factor` times as long."""
    own, one = method.coefficients, unit.coefficients
    for row in range(own.shape[0]):
        for k in range(own.shape[1]):
            own[row, k] = factor * one[row, k]
    own[0, SHIFT], own[0, LAZY] = factor * (factor * one[0, SHIFT]), one[0, LAZY]


@dataclass(frozen=True)
class KeplerSplitting(Form):
    """The steps of a Wisdom–Holman map in Jacobi coordinates, which are marched in the carry.

    kernel : the kick, corrector : its order, and corrector2 : whether there is a second one; see `WisdomHolman`
    among_particles : whether the planets leave tables for massless particles
    with_terms : whether the Lagrangian has terms of the dominant body
    """

    kernel: str
    corrector: int
    corrector2: bool = False
    among_particles: bool = False
    with_terms: bool = False

    kernels: ClassVar[Mapping[str, Any]] = {
        "enter": enter,
        "leave": leave,
        "show": show,
        "begin": begin,
        "step": step,
        "stretch": stretch,
    }
    more_kernels: ClassVar[Mapping[str, Any]] = {
        "begin": begin_among_particles,
        "step": step_among_particles,
        "begin_particles": begin_particles,
        "step_particles": step_particles,
        "keep_particles": keep_particles,
        "enter_particles": enter_particles,
        "leave_particles": leave_particles,
    }

    of_pairs: ClassVar[Mapping[str, Any]] = {
        "begin_pair": begin_pair,
        "step_pair": step_pair,
        "keep_pair": keep_pair,
    }

    kernels_with_terms: ClassVar[Mapping[str, Any]] = {"step": step_with_terms}
    more_kernels_with_terms: ClassVar[Mapping[str, Any]] = {
        "step": step_with_terms_among_particles,
        "step_particles": step_particles_with_terms,
    }

    def own_kernels(self) -> Mapping[str, Any]:
        """Return the kernels of this instance."""
        own = {**self.kernels, **(self.kernels_with_terms if self.with_terms else {})}
        if not self.among_particles:
            return {**own, "trace": trace}
        return {**own, **self.more_kernels, **(self.more_kernels_with_terms if self.with_terms else self.of_pairs)}

    def for_particles(self) -> KeplerSplitting:
        """Return the form whose planets leave tables for massless particles."""
        return replace(self, among_particles=True)

    def coefficients(self, h: float, before: float) -> Array:
        """Return the lengths of a step and of the stages of the corrector, (1 + stages, 8)."""
        stages = h * corrector_lengths(self.corrector, self.corrector2) if self.corrector else np.zeros((0, 2))
        rows = np.zeros((1 + len(stages), WIDTH))
        rows[0, [HALF, WHOLE, LAZY]] = h / 2, h, self.kernel == "lazy"
        rows[0, SHIFT] = 0.0 if self.kernel == "standard" else h * h / 12
        rows[1:, :2] = stages
        return rows

    def carry_rows(self, size: int) -> int:
        """The planets, eight in a register, with low parts; their centre of mass; their order."""
        return (STATE_ROWS + 1) * registers(size) + 2

    def stages_shape(self, size: int) -> tuple[int, int]:
        """The tables before and after a step, and workspace; see `orbits.kernels.jacobi_particles`. None are kept
        without particles.
        """
        if not self.among_particles:
            return 1, padded(size)
        planets = size // 3 - 1
        flows = 6 * (planets + 1) if self.with_terms else 0
        return 2 * (3 * (planets + 1) + planets) + flows + 3 * registers(size), WIDTH

    def trace_rows(self, size: int) -> int:
        """Return the rows that `trace` writes: of planets in a single register, without particles."""
        return TRACE_ROWS if registers(size) == 1 and not self.among_particles else 0

    def stages_read(self, size: int) -> int:
        """Return how many numbers of its stages a step writes or reads: not the table before it, but for the first."""
        rows, columns = self.stages_shape(size)
        return (rows - table_rows(size // 3 - 1)) * columns if self.among_particles else rows * columns

    @property
    def particle_carry_rows(self) -> int:
        """Massless particles as they are marched."""
        return MEMORY_ROWS if self.among_particles else 0

    def scratch_shape(self, size: int) -> tuple[int, int]:
        """The rows of `orbits.kernels.jacobi`."""
        return ROWS * registers(size) + WIDTH, WIDTH

    def lanes_of_systems(self, size: int) -> tuple[Any, int] | None:
        """The march of up to eight planets of each."""
        own = self.own_kernels()
        plain = own["begin"] is begin and own["step"] is step and 6 <= size <= 3 + 3 * MOST_PLANETS
        return (march_planets, ALL_ROWS) if plain else None

    def forget(self, carry: Array) -> None:
        """Nothing in the carry depends on the length of the steps."""

    def check_start(self, parameters: Any, q: Array, v: Array) -> None:
        """Raise InputError for softened gravity, and if no body dominates the others."""
        newton, *own = parameters if isinstance(parameters, tuple) else (parameters,)
        require_dominant(newton)
        gm = newton[1:]
        others = [int(vector[0]) for vector in own if int(vector[0]) != int(gm.argmax())]
        if others:
            raise InputError(
                f"a Wisdom–Holman step takes terms of the dominant body alone, the {_ordinal(int(gm.argmax()))} of the "
                f"massive bodies; got one of the {_ordinal(others[0])}. Use a method such as Gauss(stages=8)."
            )


def outwards(gm: Array, q: Array, v: Array) -> list[int]:
    """Return the numbers of the bodies in the order of the method: the dominant one, then the planets outwards.

    gm : (n,); q, v : (n, 3)
    """
    form = KeplerSplitting("standard", 0)
    planets = np.zeros((form.carry_rows(q.size), WIDTH))
    number_planets(np.concatenate([[0.0], gm]), q.T.ravel(), v.T.ravel(), planets)
    first = STATE_ROWS * registers(q.size)
    return [int(planets[first, 6]), *(int(x) for x in planets[first + 2 :].ravel()[: len(gm) - 1])]


def _ordinal(row: int) -> str:
    """Return the number of a body in words: "1st" for row 0."""
    last = {1: "st", 2: "nd", 3: "rd"}.get((row + 1) % 10, "th")
    return f"{row + 1}{'th' if (row + 1) % 100 in (11, 12, 13) else last}"


def _distance(value: Any, name: str) -> float:
    """Return a distance above 0. Raises InputError for anything else."""
    number = finite_number(value, name)
    if not number > 0.0:
        raise InputError(f"{name} is {number:g}; expected a distance above 0, in the system's unit of length")
    return number


@dataclass(frozen=True)
class WisdomHolman(Integrator):
    """The method of planetary dynamics: Kepler orbits about a dominant body, kicked by the planets' interaction.

    coordinates : "jacobi", in which the interaction is small; or "democratic-heliocentric", in which the order of the
        planets plays no part, but the error is larger, by far for planets close to the dominant body, and has no
        corrector: the map of WHFast in these coordinates, for comparison
    kernel : the kick: "modified-kick", by the potential with the correction of the second order in the masses; "lazy",
        the same approximately, by the interaction at displaced positions; or "standard", by the interaction. By default
        the modified kick, and "standard", the only one, in democratic heliocentric coordinates
    corrector : order of the symplectic corrector: 17, 11, 7, 5, 3, or 0 for none, with the standard kernel. By default
        17, and 0, the only one, in democratic heliocentric coordinates
    corrector2 : whether to apply the second symplectic corrector too, with the modified or the lazy kick: it removes a
        part of the oscillations of the second order in the planets' masses, which matters for planets of a hundredth in
        long steps only; positions drift away as without it
    encounters : "warn" of massless particles that come within three Hill radii of a planet, or to a pericentre that the
        step does not resolve, after the run; "follow" them there by steps of their own; or "retire" them before the
        step of that passage, with time and place
    planets : "warn" of massive bodies that come within three mutual Hill radii of each other, before the run and after
        it, or "refuse" to go on, with a SingularityError before the step of that passage
    ejected_beyond, lost_within : the distance from the dominant body beyond which massless particles on open orbits are
        retired, and the pericentre distance below which any are, in the system's unit of length; looked for after every
        64th step

    For bodies by Newton's gravity, with relativity and oblateness of the dominant body if the system has these terms
    (`PostNewtonian`, `ZonalHarmonics`, `LenseThirring`), on orbits that do not come close to planets, elliptic or
    hyperbolic. The planets are numbered outwards by the energies of their orbits at the start, in any order of the
    bodies. A massless particle moves about the centre of mass of the dominant body and the planets whose semi-major
    axes are below its pericentre distance at the start; see `orbits.kernels.jacobi_particles`. The map of the planets
    is symplectic and conserves the momenta, but for the lazy kick, which does so up to the third order in the planets'
    masses; it is symmetric without a corrector, and up to that order with one. With terms, what is left is of the
    second order in them, too, times h^2; of oblateness the lazy kick removes that.

    Closest approaches, and the conditions that end a run, see the states between samples without the corrector: they
    are off by a fraction of about (mass of the planets) x (angle in a step)^2 of the distances, and with relativity
    velocities by (v/c)^2 of them.

    Events are sought on the states that are seen, for which the corrector is undone at each step: that takes 60 times
    the time of a run without events. Collisions are refused.

    With `encounters="follow"` a particle leaves the map at the beginning of the step in which it comes within four Hill
    radii of a planet, or so close that kicks do not add up to the planet's attraction, or in which h v / r about the
    dominant body exceeds half of 2 pi / 16 before a pericentre at which it exceeds all of that; the states at both ends
    of the step tell. By steps of its own, chosen as in runs without dt, it then moves in the field of the planets, and
    enters the map again once it is away. It is exact there, but not reversible in time, nor symplectic; the bits of all
    others do not change. One that comes within the radius of a body, if the system has radii, is retired where it does.

    Take at least 16 steps in a full turn at the speed of the fastest pericentre: 3 days for Mercury. Runs warn of
    pericentres that need more, and of encounters within three Hill radii of a planet, which are not followed.

    Raises InputError for other coordinates, kernels, correctors and answers to encounters, and for a modified or lazy
    kick without a corrector.
    """

    coordinates: str = "jacobi"
    kernel: str | None = None
    corrector: int | None = None
    corrector2: bool = option(False)
    encounters: str = option("warn")
    planets: str = option("warn")
    ejected_beyond: float | None = option(None)
    lost_within: float | None = option(None)

    name: ClassVar[str] = "wisdom-holman"
    summary: ClassVar[str] = "Wisdom–Holman: bodies about a dominant one, corrected Kepler orbits and kicks"
    requires: ClassVar[frozenset[str]] = frozenset({ABOUT_ONE_BODY})
    follows_kepler: ClassVar[bool] = True
    source: ClassVar[str] = (
        "Wisdom & Holman (1991); Wisdom, Holman & Touma (1996); Wisdom (2006); Rein, Tamayo & Brown (2019)"
    )

    def __post_init__(self) -> None:
        if self.coordinates not in COORDINATES:
            known = " or ".join(map(repr, COORDINATES))
            raise InputError(f"coordinates is {shown(self.coordinates)}; expected {known}")
        if self.kernel is None:
            object.__setattr__(self, "kernel", "standard" if self._heliocentric else KERNELS[0])
        if self.corrector is None:
            object.__setattr__(self, "corrector", 0 if self._heliocentric else 17)
        if self.kernel not in KERNELS:
            raise InputError(f"kernel is {shown(self.kernel)}; expected {', '.join(map(repr, KERNELS))}")
        if isinstance(self.corrector, bool) or self.corrector not in PAIRS:
            known = ", ".join(str(order) for order in sorted(PAIRS, reverse=True)[:-1])
            raise InputError(f"corrector is {shown(self.corrector)}; expected {known}, or 0 for none")
        if not isinstance(self.corrector2, bool):
            raise InputError(f"corrector2 is {shown(self.corrector2)}; expected True or False")
        if self._heliocentric:
            self._require_neither_kernel_nor_corrector()
        if self.encounters not in ENCOUNTERS:
            *others, last = map(repr, ENCOUNTERS)
            known = f"{', '.join(others)} or {last}"
            raise InputError(f"encounters is {shown(self.encounters)}; expected {known}")
        if self.planets not in ("warn", "refuse"):
            raise InputError(f"planets is {shown(self.planets)}; expected 'warn' or 'refuse'")
        if self._heliocentric and self.encounters == "follow":
            raise InputError(
                'encounters="follow" lets particles leave Jacobi coordinates, and return; got democratic heliocentric '
                'ones. Use coordinates="jacobi", or encounters="warn".'
            )
        for name in ("ejected_beyond", "lost_within"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, _distance(value, name))
        object.__setattr__(self, "corrector", int(self.corrector))
        if self.kernel != "standard" and not self.corrector:
            raise InputError(
                f"kernel={self.kernel!r} removes an error that only a corrector brings to light, and makes it larger "
                "without one; use corrector=17, or kernel='standard'"
            )
        if self.corrector2 and self.kernel == "standard":
            raise InputError(
                "corrector2=True removes oscillations that are hidden by the larger error of kernel='standard'; use "
                "kernel='modified-kick' or 'lazy'"
            )

    @property
    def _heliocentric(self) -> bool:
        return self.coordinates == "democratic-heliocentric"

    def _require_neither_kernel_nor_corrector(self) -> None:
        """Raise InputError for what is made for Jacobi coordinates."""
        for name, fits in (("kernel", "standard"), ("corrector", 0), ("corrector2", False)):
            if getattr(self, name) != fits:
                raise InputError(
                    f"{name}={getattr(self, name)!r} is made for Jacobi coordinates, and does not fit "
                    f"coordinates='democratic-heliocentric', where kicks and motions of the dominant body are applied "
                    f"together; leave it away, or use coordinates='jacobi'"
                )
        if self.encounters == "follow":
            raise InputError(
                "encounters='follow' leaves and enters Jacobi coordinates, and does not fit "
                "coordinates='democratic-heliocentric'; use encounters='warn' or 'retire', or coordinates='jacobi'"
            )

    @property
    def departures(self) -> tuple[float | None, float | None]:
        """Where massless particles are retired."""
        return self.ejected_beyond, self.lost_within

    @property
    def refuses_meetings(self) -> bool:
        """Whether encounters of planets end a run."""
        return self.planets == "refuse"

    @property
    def follows_encounters(self) -> bool:
        """Whether massless particles take steps of their own in encounters that the method cannot follow."""
        return self.encounters == "follow"

    @property
    def retires_in_encounters(self) -> bool:
        """Whether massless particles are retired before encounters that the method cannot follow."""
        return self.encounters == "retire"

    @property
    def order(self) -> int:
        """Order of convergence for fixed masses: 2, and 4 with the modified or the lazy kick."""
        return 2 if self.kernel == "standard" or self.corrector in (0, 3) else 4

    def order_with(self, lagrangian: Lagrangian) -> int:
        """Return 2 with terms, whose second order, h^2 times their square, is not in the kick."""
        return self.order if NEWTONIAN in lagrangian.traits else 2

    @property
    def declares(self) -> frozenset[str]:  # type: ignore[override]
        """All but for the lazy kick; symmetric without a corrector."""
        if self.kernel == "lazy":
            return frozenset()
        return frozenset({SYMPLECTIC, MOMENTUM_MAPS} | (set() if self.corrector else {SYMMETRIC}))

    @property
    def variational(self) -> bool:  # type: ignore[override]
        """Whether the step is that of L_d: without a corrector, which changes variables, in Jacobi coordinates."""
        return self.corrector == 0 and not self._heliocentric

    @property
    def exact_for_two(self) -> bool:  # type: ignore[override]
        """Whether the motion of a single planet is exact: in Jacobi coordinates."""
        return not self._heliocentric

    @property
    def own_discrete_lagrangian(self) -> str:  # type: ignore[override]
        """What L_d a map has that is not variational."""
        if self._heliocentric:
            return super().own_discrete_lagrangian
        return "that of the same method without a corrector, after a change of variables"

    @property
    def second_order(self) -> KeplerSplitting | DemocraticHeliocentric:
        """Kepler motions and kicks."""
        if self._heliocentric:
            return DemocraticHeliocentric()
        return KeplerSplitting(str(self.kernel), self.corrector or 0, self.corrector2)

    def form(self, lagrangian: Lagrangian, *, canonical: bool = False) -> Form | None:
        """Return the form for this Lagrangian: with terms of the dominant body, if it has any."""
        form = super().form(lagrangian, canonical=canonical)
        if form is None or NEWTONIAN in lagrangian.traits or not isinstance(form, KeplerSplitting):
            return form
        return replace(form, with_terms=True)

    def check(self, lagrangian: Lagrangian, others: Mapping[str, type[Integrator]]) -> None:
        """Raise InputError, naming the terms that have no flow here."""
        summands = getattr(lagrangian, "summands", ())
        strange = [term.name for term in summands if ABOUT_ONE_BODY not in term.traits]
        if summands and self._heliocentric:
            raise InputError(
                f"{self.label} takes no terms besides Newton's gravity, got {', '.join(x.name for x in summands)}; in "
                "Jacobi coordinates it takes those of the dominant body, and Gauss(stages=8) takes all."
            )
        if strange:
            raise InputError(
                f"{self.label} takes terms of the dominant body such as PostNewtonian and ZonalHarmonics, each with a "
                f"motion of its own between Kepler motions, not {', '.join(strange)}. Use Gauss(stages=8)."
            )
        super().check(lagrangian, others)

    @classmethod
    def examples(cls) -> tuple[WisdomHolman, ...]:
        """Return the default, the plain map, and that in democratic heliocentric coordinates."""
        return cls(), cls(kernel="standard", corrector=0), cls(coordinates="democratic-heliocentric")


__all__ = ["KeplerSplitting", "WisdomHolman", "outwards"]
