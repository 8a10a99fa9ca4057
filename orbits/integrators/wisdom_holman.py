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

Source: Wisdom & Holman (1991), AJ 102, 1528; Wisdom, Holman & Touma (1996), Fields Inst. Commun. 10, 217; Wisdom
(2006), AJ 131, 2294; Rein, Tamayo & Brown (2019), MNRAS 489, 4632.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from orbits.errors import InputError, shown
from orbits.integrators.base import MOMENTUM_MAPS, SYMMETRIC, SYMPLECTIC, Integrator, option
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
from orbits.lagrangians.base import NEWTONIAN, SEPARABLE
from orbits.tableaux.correctors import PAIRS, corrector_lengths

HALF, WHOLE, SHIFT, LAZY = 0, 1, 2, 3
"""Columns of the first row of the coefficients: half a kick, the Kepler motion, h^2/12 for the modified and the lazy
kick, and 1 for the latter. The other rows are the corrector: a Kepler motion and a kick each."""

KERNELS = "modified-kick", "lazy", "standard"

ENCOUNTERS = "warn", "retire"

DOMINANT = 0.9
"""Fraction of the total mass that the dominant body must have."""


@kernel
def _kick_of_a_step(coefficients, planets, room, count):
    """Write the interaction for the kick: plain, modified, or at displaced positions."""
    interact(planets, room, count, False)
    if coefficients[0, LAZY] != 0.0:
        displace(planets, room, coefficients[0, SHIFT])
        interact(planets, room, count, True)
    elif coefficients[0, SHIFT] != 0.0:
        modify(planets, room, count, coefficients[0, SHIFT])


@kernel
def _correct(coefficients, planets, room, count, sign):
    """Apply the corrector, or its inverse for sign = -1."""
    stages = coefficients.shape[0] - 1
    for i in range(stages):
        row = 1 + i if sign > 0.0 else stages - i
        move_planets(planets, room, sign * coefficients[row, 0], 0.0)
        finish_velocities(planets, room, 0.0)
        # Backwards, the kick before a Kepler motion follows it.
        other = row if sign > 0.0 else row - 1
        length = coefficients[other, 1] if other > 0 else 0.0
        if length != 0.0:
            interact(planets, room, count, False)
            kick_planets(planets, room, sign * length)


@kernel
def enter(method, model, h, state, storage):
    """Change to corrected Jacobi coordinates."""
    strength, planets, room = model.parameters, storage.carry, storage.scratch
    enter_planets(strength, state.q, state.q_lo, state.p, state.p_lo, planets, room)
    _correct(method.coefficients, planets, room, strength.shape[0] - 2, 1.0)


@kernel
def leave(method, model, h, state, storage):
    """Change back; the marched state is lost."""
    strength, planets, room = model.parameters, storage.carry, storage.scratch
    prepare_room(strength, planets, room)
    _correct(method.coefficients, planets, room, strength.shape[0] - 2, -1.0)
    leave_planets(strength, planets, room, state.q, state.q_lo, state.p, state.p_lo)


@kernel
def show(method, model, state, storage):
    """Write the state of the bodies, uncorrected."""
    show_planets(model.parameters, storage.carry, storage.scratch, state.q, state.p)


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
        model.parameters, storage.carry, storage.scratch, path[first : first + width],
        path[first + width : first + 2 * width],
    )  # fmt: skip


@kernel
def begin(method, model, t, h, state, storage):
    """Compute the interaction of the first half of a kick, which later steps take over."""
    prepare_room(model.parameters, storage.carry, storage.scratch)
    _kick_of_a_step(method.coefficients, storage.carry, storage.scratch, model.parameters.shape[0] - 2)


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
        _kick_of_a_step(coefficients, planets, room, model.parameters.shape[0] - 2)
        finish_velocities(planets, room, half)
    return OK, 0, 1


@kernel
def _kick_among_particles(coefficients, strength, planets, room, stages, first):
    """As `_kick_of_a_step`, with a table for particles, from row `first` of the stages on."""
    count = strength.shape[0] - 2
    interact(planets, room, count, False)
    tabulate(strength, planets, room, stages, first, PLAIN)
    if coefficients[0, LAZY] != 0.0:
        displace(planets, room, coefficients[0, SHIFT])
        interact(planets, room, count, True)
        tabulate(strength, planets, room, stages, first, DISPLACED)
    elif coefficients[0, SHIFT] != 0.0:
        modify(planets, room, count, coefficients[0, SHIFT])
        tabulate(strength, planets, room, stages, first, MODIFIED)


@kernel
def begin_among_particles(method, model, t, h, state, storage):
    """As `begin`, with the table before the first step of a block."""
    strength, planets, room = model.parameters, storage.carry, storage.scratch
    prepare_room(strength, planets, room)
    _kick_among_particles(method.coefficients, strength, planets, room, storage.stages, 0)


@kernel
def step_among_particles(method, model, t, h, state, storage):
    """As `step`, with the table after it: of the planets to the same bits."""
    coefficients, planets, room = method.coefficients, storage.carry, storage.scratch
    strength, half, after = model.parameters, coefficients[0, HALF], table_rows(model.parameters.shape[0] - 2)
    advance_planets(planets, room, coefficients[0, WHOLE], half)
    _kick_among_particles(coefficients, strength, planets, room, storage.stages, after)
    finish_velocities(planets, room, half)
    tabulate_centres(strength, planets, room, storage.stages, after)
    return OK, 0, 1


@kernel(inline=True)
def begin_pair(method, model, one, two, storages):
    """Return two times eight particles as they are marched, from their rows of the carry, with g."""
    coefficients, storage = method.coefficients, storages[0]
    marched = joined_marched(_taken(one, storages[0]), _taken(two, storages[1]))
    count, shift, lazy = model.parameters.shape[0] - 2, coefficients[0, SHIFT], coefficients[0, LAZY]
    return with_interaction(storage.stages, 0, count, shift, lazy, marched, storage.scratch)


@kernel(inline=True)
def _taken(particles, storage):
    """Return eight particles from their rows of the carry, without g."""
    # Those that are retired are at one place, as the padding is.
    there = 1.0 - (particles.x == AWAY) * (particles.y == AWAY) * (particles.z == AWAY)
    return take_particles(storage.carry, storage.share.start, there, storage.scratch)


@kernel(inline=True)
def step_pair(method, model, t, h, one, two, carry, storages):
    """Take one step of two times eight particles: half a kick, Kepler motions, half a kick. They are returned as
    observers see them.
    """
    coefficients, (stages, rows) = method.coefficients, (storages[0].stages, storages[0].scratch)
    count, half = model.parameters.shape[0] - 2, coefficients[0, HALF]
    first = table_rows(count)
    marched, ax, ay, az = drifted_particles(carry, coefficients[0, WHOLE], half)
    g = interaction(stages, first, count, coefficients[0, SHIFT], coefficients[0, LAZY], marched, rows)
    marched = kicked_particles(marched, (ax, ay, az), half, g)
    x, y, z, vx, vy, vz = seen_particles(stages, first, marched, rows)
    one, two = _seen(halves(x), halves(y), halves(z), halves(vx), halves(vy), halves(vz))
    return one, two, marched, 1


@kernel(inline=True)
def _seen(x, y, z, vx, vy, vz):
    """Return two times eight particles as observers see them."""
    zero = full(0.0)
    return (
        Particles(x[0], y[0], z[0], zero, zero, zero, vx[0], vy[0], vz[0], zero, zero, zero),
        Particles(x[1], y[1], z[1], zero, zero, zero, vx[1], vy[1], vz[1], zero, zero, zero),
    )


@kernel(inline=True)
def keep_pair(method, carry, storages):
    """Write two times eight particles as they are marched into their rows of the carry."""
    for_one, for_two = storages
    store_marched(for_one.carry, for_one.share.start, half_of_marched(carry, 0), for_one.scratch)
    store_marched(for_two.carry, for_two.share.start, half_of_marched(carry, 1), for_two.scratch)


@kernel
def enter_particles(method, model, state, particles, rows, storage):
    """Change to corrected Jacobi coordinates."""
    strength, planets, room = model.parameters, storage.carry, storage.scratch
    enter_planets(strength, state.q, state.q_lo, state.p, state.p_lo, planets, room)
    enter_among(method.coefficients, strength, planets, room, storage.stages, particles, rows, storage.share)


@kernel
def leave_particles(method, model, state, particles, rows, storage):
    """Change back; what is marched is lost."""
    strength, planets, room = model.parameters, storage.carry, storage.scratch
    prepare_room(strength, planets, room)
    leave_among(method.coefficients, strength, planets, room, storage.stages, particles, rows, storage.share)


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

    kernel : the kick, and corrector : its order; see `WisdomHolman`
    among_particles : whether the planets leave tables for massless particles
    """

    kernel: str
    corrector: int
    among_particles: bool = False

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
        "begin_pair": begin_pair,
        "step_pair": step_pair,
        "keep_pair": keep_pair,
        "enter_particles": enter_particles,
        "leave_particles": leave_particles,
    }

    def own_kernels(self) -> Mapping[str, Any]:
        """Return the kernels of this instance."""
        return {**self.kernels, **self.more_kernels} if self.among_particles else {**self.kernels, "trace": trace}

    def for_particles(self) -> KeplerSplitting:
        """Return the form whose planets leave tables for massless particles."""
        return replace(self, among_particles=True)

    def coefficients(self, h: float, before: float) -> Array:
        """Return the lengths of a step and of the stages of the corrector, (1 + stages, 8)."""
        stages = h * corrector_lengths(self.corrector) if self.corrector else np.zeros((0, 2))
        rows = np.zeros((1 + len(stages), WIDTH))
        rows[0, [HALF, WHOLE, LAZY]] = h / 2, h, self.kernel == "lazy"
        rows[0, SHIFT] = 0.0 if self.kernel == "standard" else h * h / 12
        rows[1:, :2] = stages
        return rows

    def carry_rows(self, size: int) -> int:
        """The planets, eight in a register, with low parts; their centre of mass; their order."""
        return (STATE_ROWS + 1) * _registers(size) + 2

    def stages_shape(self, size: int) -> tuple[int, int]:
        """The tables before and after a step, and workspace; see `orbits.kernels.jacobi_particles`. None are kept
        without particles.
        """
        if not self.among_particles:
            return 1, padded(size)
        planets = size // 3 - 1
        return 2 * (3 * (planets + 1) + planets) + 3 * _registers(size), WIDTH

    def trace_rows(self, size: int) -> int:
        """Return the rows that `trace` writes: of planets in a single register, without particles."""
        return TRACE_ROWS if _registers(size) == 1 and not self.among_particles else 0

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
        return ROWS * _registers(size) + WIDTH, WIDTH

    def forget(self, carry: Array) -> None:
        """Nothing in the carry depends on the length of the steps."""

    def check_start(self, parameters: Any, q: Array, v: Array) -> None:
        """Raise InputError for softened gravity, and if no body dominates the others."""
        gm = parameters[1:]
        if parameters[0] > 0.0:
            raise InputError(
                "a Wisdom–Holman step moves the planets on Kepler orbits about point masses; got a softening. Use "
                "softening = 0, or a method such as Gauss(stages=8)."
            )
        if len(gm) < 2 or not gm.max() > DOMINANT * gm.sum():
            share = gm.max() / gm.sum()
            got = "a single body" if len(gm) < 2 else f"the heaviest of {len(gm)} bodies has {100 * share:.3g} %"
            raise InputError(
                f"a Wisdom–Holman step needs a body that dominates the others, with more than {100 * DOMINANT:.0f} % "
                f"of the mass; got {got}. Use a method such as Gauss(stages=8)."
            )


def outwards(gm: Array, q: Array, v: Array) -> list[int]:
    """Return the numbers of the bodies in the order of the method: the dominant one, then the planets outwards.

    gm : (n,); q, v : (n, 3)
    """
    form = KeplerSplitting("standard", 0)
    planets = np.zeros((form.carry_rows(q.size), WIDTH))
    number_planets(np.concatenate([[0.0], gm]), q.T.ravel(), v.T.ravel(), planets)
    first = STATE_ROWS * _registers(q.size)
    return [int(planets[first, 6]), *(int(x) for x in planets[first + 2 :].ravel()[: len(gm) - 1])]


def _registers(size: int) -> int:
    """Return the number of registers of eight planets of `size` coordinates of bodies."""
    return max(1, (size // 3 - 1 + WIDTH - 1) // WIDTH)


@dataclass(frozen=True)
class WisdomHolman(Integrator):
    """The method of planetary dynamics: Kepler orbits about a dominant body, kicked by the planets' interaction.

    coordinates : "jacobi"
    kernel : the kick: "modified-kick", by the potential with the correction of the second order in the masses; "lazy",
        the same approximately, by the interaction at displaced positions; or "standard", by the interaction
    corrector : order of the symplectic corrector: 17, 11, 7, 5, 3, or 0 for none, with the standard kernel
    encounters : "warn" of massless particles that come within three Hill radii of a planet, or to a pericentre that the
        step does not resolve, after the run; or "retire" them before the step of that passage, with time and place

    For bodies by Newton's gravity alone, on orbits that do not come close to planets, elliptic or hyperbolic. The
    planets are numbered outwards by the energies of their orbits at the start, in any order of the bodies. A massless
    particle moves about the centre of mass of the dominant body and the planets whose semi-major axes are below its
    pericentre distance at the start; see `orbits.kernels.jacobi_particles`. The map of the planets is symplectic and
    conserves the momenta, but for the lazy kick, which does so up to the third order in the planets' masses; it is
    symmetric without a corrector, and up to that order with one.

    Closest approaches, and the conditions that end a run, see the states between samples without the corrector: they
    are off by a fraction of about (mass of the planets) x (angle in a step)^2 of the distances.

    Events are sought on the states that are seen, for which the corrector is undone at each step: that takes 60 times
    the time of a run without events. Collisions are refused.

    Take at least 16 steps in a full turn at the speed of the fastest pericentre: 3 days for Mercury. Runs warn of
    pericentres that need more, and of encounters within three Hill radii of a planet, which are not followed.

    Raises InputError for other coordinates, kernels, correctors and answers to encounters, and for a modified or lazy
    kick without a corrector.
    """

    coordinates: str = "jacobi"
    kernel: str = "modified-kick"
    corrector: int = 17
    encounters: str = option("warn")

    name: ClassVar[str] = "wisdom-holman"
    summary: ClassVar[str] = "Wisdom–Holman: bodies about a dominant one, corrected Kepler orbits and kicks"
    requires: ClassVar[frozenset[str]] = frozenset({SEPARABLE, NEWTONIAN})
    follows_kepler: ClassVar[bool] = True
    source: ClassVar[str] = (
        "Wisdom & Holman (1991); Wisdom, Holman & Touma (1996); Wisdom (2006); Rein, Tamayo & Brown (2019)"
    )

    def __post_init__(self) -> None:
        if self.coordinates != "jacobi":
            raise InputError(f"coordinates is {shown(self.coordinates)}; expected 'jacobi'")
        if self.kernel not in KERNELS:
            raise InputError(f"kernel is {shown(self.kernel)}; expected {', '.join(map(repr, KERNELS))}")
        if isinstance(self.corrector, bool) or self.corrector not in PAIRS:
            known = ", ".join(str(order) for order in sorted(PAIRS, reverse=True)[:-1])
            raise InputError(f"corrector is {shown(self.corrector)}; expected {known}, or 0 for none")
        if self.encounters not in ENCOUNTERS:
            known = " or ".join(map(repr, ENCOUNTERS))
            raise InputError(f"encounters is {shown(self.encounters)}; expected {known}")
        object.__setattr__(self, "corrector", int(self.corrector))
        if self.kernel != "standard" and not self.corrector:
            raise InputError(
                f"kernel={self.kernel!r} removes an error that only a corrector brings to light, and makes it larger "
                "without one; use corrector=17, or kernel='standard'"
            )

    @property
    def retires_in_encounters(self) -> bool:
        """Whether massless particles are retired before encounters that the method cannot follow."""
        return self.encounters == "retire"

    @property
    def order(self) -> int:
        """Order of convergence for fixed masses: 2, and 4 with the modified or the lazy kick."""
        return 2 if self.kernel == "standard" or self.corrector < 5 else 4

    @property
    def declares(self) -> frozenset[str]:  # type: ignore[override]
        """All but for the lazy kick; symmetric without a corrector."""
        if self.kernel == "lazy":
            return frozenset()
        return frozenset({SYMPLECTIC, MOMENTUM_MAPS} | (set() if self.corrector else {SYMMETRIC}))

    @property
    def variational(self) -> bool:  # type: ignore[override]
        """Whether the step is that of L_d: without a corrector, which changes variables."""
        return self.corrector == 0

    @property
    def second_order(self) -> KeplerSplitting:
        """Kepler motions and kicks."""
        return KeplerSplitting(self.kernel, self.corrector)

    @classmethod
    def examples(cls) -> tuple[WisdomHolman, ...]:
        """Return the default and the plain map."""
        return cls(), cls(kernel="standard", corrector=0)


__all__ = ["KeplerSplitting", "WisdomHolman", "outwards"]
