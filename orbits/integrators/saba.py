"""Symplectic splittings of several kicks a step, for planets about a dominant body: SABA, or ABA.

With the Hamiltonian in Jacobi coordinates (`orbits.kernels.maps.jacobi`) as A + B, A the free centre of mass and the
Kepler motions and B the interaction, a step is a sequence of Kepler motions and kicks, a palindrome that begins and
ends with a motion. With coefficients made for a small B (`orbits.tableaux.near_integrable`), the error of a step is

    eps h^(r1) + eps^2 h^(r2) + eps^3 h^(r3),     eps the mass of the planets in units of that of the dominant body

without any change of variables: what a corrector does for Wisdom–Holman maps of one kick a step. What is marched stands
within the first Kepler motion of a step, joined to the last one of the step before it; the motion back is applied for
outputs only, on a copy. The state is in doubled precision.

Source: Laskar & Robutel (2001), Celest. Mech. Dyn. Astron. 80, 39; Blanes, Casas, Farrés, Laskar, Makazaga & Murua
(2013), Appl. Numer. Math. 68, 58; Farrés et al. (2013), Celest. Mech. Dyn. Astron. 116, 141.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from orbits.checks import is_one_of, is_whole
from orbits.errors import InputError, shown
from orbits.integrators.base import MOMENTUM_MAPS, SYMMETRIC, SYMPLECTIC, Integrator, option
from orbits.integrators.forms import Array, padded
from orbits.integrators.maps.dominant import registers_for
from orbits.integrators.maps.on_kepler_orbits import (
    InJacobiCoordinates,
    begin_particles,
    keep_particles,
    rows_of,
    stretch_rows,
)
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, full
from orbits.kernels.maps.interaction import ROWS, registers_of
from orbits.kernels.maps.jacobi import enter_planets, finish_velocities, leave_planets, move_planets, prepare_room
from orbits.kernels.maps.jacobi_particles import seen_particles
from orbits.kernels.maps.jacobi_particles_entering import enter_among, leave_among
from orbits.kernels.maps.jacobi_stages import (
    particles_at_the_end,
    particles_in_stages,
    registers_in,
    room_rows,
    show_at_the_end,
    step_in_stages,
    step_in_stages_among_particles,
    tabulate_the_end,
)
from orbits.kernels.maps.stages import DRIFT, STANDARD
from orbits.kernels.steps import OK, Particles
from orbits.lagrangians.base import NEWTONIAN, SEPARABLE
from orbits.tableaux.near_integrable import KNOWN, REFINED, binary_splitting

ENTRY, STAGES = 1, 2
"""Rows of the coefficients: the motion from the states that are seen to what is marched, as a corrector of one stage,
(drift, kick); then the stages of a step, (kick, drift). The first row is not used."""


LEAST_STEPS: dict[tuple[int, ...], int] = {(10, 6, 4): 8, (8, 6, 4): 10}
"""Steps in a full turn at the speed of a pericentre, where less than those of one kick do. Asteroids with e = 0.9 among
the giants are then as accurate after a hundred years as in steps of a fifth of that; with two fewer, Mercury is 3 and 1
km off after a thousand years."""


@kernel(inline=True)
def _rooms(planets, scratch):
    """Return the parts of the scratch: the room of the planets, and that for a copy of them."""
    rows = room_rows(registers_in(planets))
    return scratch[:rows], scratch[rows:]


@kernel
def enter(method, model, h, state, storage):
    """Change to Jacobi coordinates within the first motion of a step."""
    strength, planets = model.parameters, storage.carry
    room, _ = _rooms(planets, storage.scratch)
    enter_planets(strength, state.q, state.q_lo, state.p, state.p_lo, planets, room)
    move_planets(planets, room, method.coefficients[ENTRY, 0], 0.0)
    finish_velocities(planets, room, 0.0)


@kernel
def leave(method, model, h, state, storage):
    """Change back; the marched state is lost."""
    strength, planets = model.parameters, storage.carry
    room, _ = _rooms(planets, storage.scratch)
    prepare_room(strength, planets, room)
    move_planets(planets, room, -method.coefficients[ENTRY, 0], 0.0)
    finish_velocities(planets, room, 0.0)
    leave_planets(strength, planets, room, state.q, state.q_lo, state.p, state.p_lo)


@kernel
def show(method, model, state, storage):
    """Write the state of the bodies."""
    room, copy = _rooms(storage.carry, storage.scratch)
    back = -method.coefficients[ENTRY, 0]
    show_at_the_end(model.parameters, storage.carry, room, copy, back, state.q, state.p)


@kernel
def begin(method, model, t, h, state, storage):
    """Write the constants of the planets."""
    room, _ = _rooms(storage.carry, storage.scratch)
    prepare_room(model.parameters, storage.carry, room)


@kernel
def step(method, model, t, h, state, storage):
    """Take one step."""
    room, _ = _rooms(storage.carry, storage.scratch)
    stages = method.coefficients[STAGES:]
    step_in_stages(registers_of(method), storage.carry, room, model.parameters.shape[0] - 2, stages)
    return OK, 0, stages.shape[0]


@kernel
def step_among_particles(method, model, t, h, state, storage):
    """As `step`, with the tables: of the planets to the same bits."""
    room, copy = _rooms(storage.carry, storage.scratch)
    stages = method.coefficients[STAGES:]
    step_in_stages_among_particles(registers_of(method), model.parameters, storage.carry, room, stages, storage.stages)
    tabulate_the_end(model.parameters, storage.carry, room, copy, -method.coefficients[ENTRY, 0], storage.stages)
    return OK, 0, stages.shape[0]


@kernel(inline=True)
def step_particles(method, model, t, h, particles, carry, storage):
    """Take one step of eight particles. They are returned as observers see them."""
    rows, stages = storage.scratch, method.coefficients[STAGES:]
    marched = particles_in_stages(model, carry, storage.stages, stages, rows)
    ended = particles_at_the_end(marched, -method.coefficients[ENTRY, 0])
    x, y, z, vx, vy, vz = seen_particles(storage.stages, 0, ended, rows)
    zero = full(0.0)
    return Particles(x, y, z, zero, zero, zero, vx, vy, vz, zero, zero, zero), marched, OK, stages.shape[0]


@kernel
def enter_particles(method, model, state, particles, rows, storage):
    """Change to Jacobi coordinates within the first motion of a step."""
    strength, planets = model.parameters, storage.carry
    room, _ = _rooms(planets, storage.scratch)
    enter_planets(strength, state.q, state.q_lo, state.p, state.p_lo, planets, room)
    entry = method.coefficients[:STAGES]
    enter_among(model, entry, planets, room, storage.stages, particles, rows, storage.share)


@kernel
def leave_particles(method, model, state, particles, rows, storage):
    """Change back; what is marched is lost."""
    strength, planets = model.parameters, storage.carry
    room, _ = _rooms(planets, storage.scratch)
    prepare_room(strength, planets, room)
    entry = method.coefficients[:STAGES]
    leave_among(model, entry, planets, room, storage.stages, particles, rows, storage.share)


@kernel
def stretch(method, unit, factor):
    """Write the coefficients of a step `factor` times as long."""
    stretch_rows(method.coefficients, unit.coefficients, factor)


@dataclass(frozen=True)
class KeplerStages(InJacobiCoordinates):
    """The steps of `SABA` in Jacobi coordinates, which are marched in the carry.

    orders : the generalized order of the scheme
    """

    orders: tuple[int, ...]

    kernels: ClassVar[Mapping[str, Any]] = {
        "enter": enter,
        "leave": leave,
        "show": show,
        "begin": begin,
        "step": step,
        "stretch": stretch,
    }
    more_kernels: ClassVar[Mapping[str, Any]] = {
        "step": step_among_particles,
        "begin_particles": begin_particles,
        "step_particles": step_particles,
        "keep_particles": keep_particles,
        "enter_particles": enter_particles,
        "leave_particles": leave_particles,
    }

    def coefficients(self, h: float, before: float) -> Array:
        """Return the lengths of the motion to what is marched and of the stages of a step, (2 + s, 8)."""
        drifts, kicks = binary_splitting(self.orders, h)
        rows = np.zeros((STAGES + len(kicks), WIDTH))
        rows[ENTRY, 0] = drifts[0]
        rows[STAGES:, 0], rows[STAGES:, 1] = kicks, [*drifts[1:-1], drifts[-1] + drifts[0]]
        return rows

    def stages_of(self, h: float) -> tuple[Array, Array]:
        """The motion to what is marched, and kicks and motions."""
        rows = self.coefficients(h, h)
        step = [pair for kick, drift in rows[STAGES:, :2].tolist() for pair in ((STANDARD, kick), (DRIFT, drift))]
        return rows_of([(DRIFT, rows[ENTRY, 0])]), rows_of(step)

    def stages_shape(self, size: int) -> tuple[int, int]:
        """A table for each kick, and workspace; see `orbits.kernels.maps.jacobi_particles`. None are kept without
        particles.
        """
        if not self.among_particles:
            return 1, padded(size)
        planets, kicks = size // 3 - 1, len(binary_splitting(self.orders, 1.0)[1])
        return kicks * (3 * (planets + 1) + planets) + 3 * registers_for(size), WIDTH

    def scratch_shape(self, size: int) -> tuple[int, int]:
        """The rows of `orbits.kernels.maps.jacobi`, and a copy of the planets."""
        return ROWS * registers_for(size) + WIDTH + self.carry_rows(size), WIDTH


@dataclass(frozen=True)
class SABA(Integrator):
    """Several kicks a step between Kepler orbits about a dominant body, of high order in the mass of the planets.

    first, second, third : the generalized order (first, second, third), the powers of the step in the errors of the
        first, second and third order in the planets' masses: (10, 6, 4), (8, 6, 4) or (8, 4); or (2 n, 2), the scheme
        of n kicks that Laskar and Robutel call SABA_n, n = 1 ... 10. Also as one value: SABA("10-6-4"), SABA((8, 2))
    encounters : "warn" of massless particles that come within three Hill radii of a planet, or to a pericentre that the
        step does not resolve, after the run; or "retire" them before the step of that passage, with time and place
    planets : "warn" of massive bodies that come within three mutual Hill radii of each other, before the run and after
        it; or "follow" these encounters by steps chosen one by one, of all bodies, as with `WisdomHolman`

    For systems of the kind that `WisdomHolman` is for, under Newton's gravity alone, in the same Jacobi coordinates;
    see there for encounters and for the places of massless particles. It has no corrector, so that the states between
    samples, which closest approaches and conditions see, are as accurate as the samples, and events cost no more than
    they do with other methods. It is symplectic and symmetric, and conserves the momenta, to round-off.

    Take at least 8 steps of (10, 6, 4), which have 8 kicks each, in a full turn at the speed of the fastest pericentre:
    7 days for Mercury; 10 of (8, 6, 4), with 7 kicks, and 16 of the others. Runs warn of fewer.

    Raises InputError for orders that no scheme here has, and for other answers to encounters.
    """

    first: Any = 10
    second: Any = None
    third: Any = None
    encounters: str = option("warn")
    planets: str = option("warn")

    name: ClassVar[str] = "saba"
    summary: ClassVar[str] = "SABA(10,6,4) and others: bodies about a dominant one, several Kepler orbits and kicks"
    requires: ClassVar[frozenset[str]] = frozenset({SEPARABLE, NEWTONIAN})
    declares: ClassVar[frozenset[str]] = frozenset({SYMPLECTIC, SYMMETRIC, MOMENTUM_MAPS})
    follows_kepler: ClassVar[bool] = True
    source: ClassVar[str] = "McLachlan (1995); Laskar & Robutel (2001); Blanes et al. (2013)"

    def __post_init__(self) -> None:
        orders = _orders(self.first, self.second, self.third)
        for name, value in zip(("first", "second", "third"), (*orders, None), strict=False):
            object.__setattr__(self, name, value)
        if not is_one_of(self.encounters, ("warn", "retire")):
            raise InputError(f"encounters is {shown(self.encounters)}; expected 'warn' or 'retire'")
        if not is_one_of(self.planets, ("warn", "follow")):
            raise InputError(f"planets is {shown(self.planets)}; expected 'warn' or 'follow'")

    @property
    def orders(self) -> tuple[int, ...]:
        """The generalized order."""
        return tuple(order for order in (self.first, self.second, self.third) if order is not None)

    @property
    def label(self) -> str:
        """The name with the generalized order: "SABA(10, 6, 4)"."""
        more = {name: value for name, value in self.parameters().items() if name in ("encounters", "planets")}
        return f"SABA({', '.join([*map(str, self.orders), *(f'{name}={value!r}' for name, value in more.items())])})"

    @property
    def follows_meetings(self) -> bool:
        """Whether all bodies take steps of another method in encounters of planets."""
        return self.planets == "follow"

    @property
    def retires_in_encounters(self) -> bool:
        """Whether massless particles are retired before encounters that the method cannot follow."""
        return self.encounters == "retire"

    @property
    def order(self) -> int:
        """Order of convergence for fixed masses: the smallest of the generalized order."""
        return min(self.orders)

    @property
    def least_steps(self) -> int:  # type: ignore[override]
        """Steps in a full turn at the speed of a pericentre below which they do not resolve it."""
        return LEAST_STEPS.get(self.orders, super().least_steps)

    @property
    def second_order(self) -> KeplerStages:
        """Kepler motions and kicks."""
        return KeplerStages(self.orders)

    @classmethod
    def examples(cls) -> tuple[SABA, ...]:
        """Return the default, a shorter scheme and a classic one."""
        return cls(), cls(8, 6, 4), cls(8, 2)


def _orders(first: Any, second: Any, third: Any) -> tuple[int, ...]:
    """Return a generalized order that may be typed as one value or several; (10,) and (10, 6) are (10, 6, 4)."""
    given = first if second is None and third is None and not is_whole(first) else (first, second, third)
    if isinstance(given, str):
        try:
            given = ast.literal_eval(given.replace("-", ","))
        except (SyntaxError, ValueError):
            given = (given,)
    values = tuple(x for x in given if x is not None) if isinstance(given, tuple | list) else (given,)
    if all(map(is_whole, values)) and values in ((10,), (10, 6), (8, 6)):
        values = {10: (10, 6, 4), 8: (8, 6, 4)}[values[0]]
    if all(map(is_whole, values)) and values in KNOWN:
        return tuple(int(x) for x in values)
    schemes = ", ".join(str(orders) for orders in sorted(REFINED, reverse=True))
    hint = ""
    if len(values) == 1 and is_whole(values[0]) and values[0] > 0 and (2 * values[0], 2) in KNOWN:
        hint = f" SABA_{values[0]} of Laskar & Robutel is SABA({2 * values[0]}, 2)."
    raise InputError(
        f"SABA has no scheme of the generalized order {shown(values[0] if len(values) == 1 else values)}; expected one "
        f"of {schemes}, or (2 n, 2) for n = 1 ... 10 kicks.{hint}"
    )


__all__ = ["SABA", "KeplerStages"]
