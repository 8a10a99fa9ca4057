"""Collisions of a run: what is sought, and what becomes of the bodies."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits import diagnostics
from orbits.errors import InputError, SingularityError, with_unit
from orbits.integrators.forms import Array
from orbits.point_masses import changed_masses
from orbits.propagation.collisions.impact import Impact, overlapping
from orbits.propagation.collisions.merge_and_bounce import (
    Bounce,
    Merge,
    State,
    approaching,
    bounced,
    heavier_first,
    merged,
)
from orbits.propagation.events.base import RECORD, STOP, Touching
from orbits.system.model import ANGULAR_MOMENTUM, ENERGY, MOMENTUM, depends_on_time, inertia, whole
from orbits.trajectory import changes
from orbits.trajectory.changes import Bodies, of_bodies
from orbits.trajectory.events import BODY, NUMBER, OTHER, TIME
from orbits.units import told_apart

if TYPE_CHECKING:
    from orbits.system import System


CONTACT = 1.0 + 1e-12
"""Bodies closer than this, as a fraction of the sum of their radii, are in contact at the instant of a bounce."""

AT_REST = 1e-6
"""The time between two bounces of a pair, as a fraction of sqrt((R1 + R2)^3 / (GM1 + GM2)), below which they are at
rest on one another: each further bounce comes sooner, and there is no last one."""

SWEEPS = 4
"""Iterations by which a collision keeps a momentum that is not m v: each gains the ratio of such a part to m v, 1e-2 at
most.
"""


class Done(NamedTuple):
    """What became of a collision: rows for the list of events, and for the changes of bodies; the bodies afterwards;
    the massless ones that vanished while nothing else changed, or None; whether the run ends.
    """

    found: Array
    rows: Array
    after: State
    vanished: list[int] | None = None
    ends: bool = False


class Collisions:
    """The collisions sought in a run of a system, by rules of which the first that applies counts.

    rules : those of each pair, by the numbers under which events are listed

    Raises InputError for a system without radii, and for bodies that overlap at the start.
    """

    def __init__(self, system: System, rules: Mapping[int, Touching]) -> None:
        self._rules = dict(rules)
        self._names, self._unit, self._massive = system.names, system.units.length, system.massive
        concerned = np.zeros(len(system), dtype=bool)
        for rule in rules.values():
            named = [body for body in (rule.first, rule.second) if body is not None]
            concerned[named if len(named) == 2 else slice(None)] = True
        if system.radii is None or not system.radii.value[concerned].any():
            raise InputError(
                "collisions need radii, and the bodies have none. Give them: system.add(..., radius=...), "
                "System(..., radii=...) or system.replaced(radii=...)."
            )
        self._none = np.where(concerned, 0.0, -np.inf)
        values, radii = system.values, system.radii.value
        for i, j in overlapping(values.q, radii, self._massive):
            if self.rule(i, j) is not None:
                lengths = float(np.linalg.norm(values.q[j] - values.q[i])), radii[i] + radii[j]
                distance, least = (with_unit(text, system.units.length) for text in told_apart(*lengths))
                raise InputError(
                    f"{system.names[i]} and {system.names[j]} are {distance} apart at the start, less than their radii "
                    f"together, {least}. Move one, or give smaller radii."
                )

    @property
    def only_merges(self) -> bool:
        """Whether all collisions merge bodies, so that there are fewer of them than bodies."""
        return all(isinstance(rule.then, Merge) for rule in self._rules.values())

    def sought(self, radii: Array) -> Array:
        """Return the radii of the bodies that collisions are sought of, (n,); -inf for the others."""
        return np.asarray(radii + self._none)

    def number(self, i: int, j: int) -> int:
        """Return the number of the rule for two bodies, or -1 if their collision is not sought."""
        if not (self._massive[i] or self._massive[j]):
            return -1
        return next((number for number, rule in self._rules.items() if rule.concerns(i, j)), -1)

    def rule(self, i: int, j: int) -> Touching | None:
        """Return the rule for two bodies, or None if their collision is not sought."""
        return self._rules.get(self.number(i, j))

    def events(self, rows: Array) -> Array:
        """Return the collisions among the rows of all events."""
        return rows[np.isin(rows[:, NUMBER], list(self._rules))]

    def passes(self, i: int, j: int) -> bool | None:
        """Return whether two bodies pass through each other where they collide; None if that is not sought."""
        rule = self.rule(i, j)
        return None if rule is None else rule.then == RECORD

    def act(
        self, system: System, bodies: Bodies, before: State, impact: Impact, known: Array, direction: float
    ) -> Done:
        """Return what becomes of a collision.

        system : at the start of the run; bodies : that are there; before : their state, NaN for those that are gone
        known : the rows of earlier collisions among the events; direction : 1 forwards in time, -1 backwards
        Raises SingularityError for two bodies that come to rest on one another.
        """
        rule = self.rule(impact.first, impact.second)
        assert rule is not None
        if isinstance(rule.then, Merge):
            return self._merge(system, bodies, before, impact)
        if isinstance(rule.then, Bounce):
            return self._bounce(system, bodies, before, impact, known, direction)
        found = self._found(impact.time, before, impact.first, impact.second)
        return Done(found[None], np.empty((0, changes.COLUMNS)), before, ends=rule.then == STOP)

    def _merge(self, system: System, bodies: Bodies, before: State, impact: Impact) -> Done:
        pair: tuple[int, int] | None = (impact.first, impact.second)
        state, parts = _with_masses_of(system, before, impact.time)
        found, changed, vanished, heavy = [], set(), [], False
        while pair is not None:
            first, second = heavier_first(state.gm, *pair)
            following = merged(state, first, second)
            found.append(self._found(impact.time, state, first, second))
            heavy = heavy or state.gm[second] > 0.0
            vanished.append(second)
            changed |= {first, second}
            bodies = bodies._replace(present=_without(bodies.present, second))
            state = following
            sought = overlapping(state.q, state.radii, state.gm > 0.0, of=first)
            pair = next((pair for pair in sought if self._do(Merge, *pair)), None) if heavy else None
        state = state._replace(gm=state.gm / parts)
        if heavy:
            state = _keeping_momentum(system, bodies, impact.time, before, state, changed)
        rows = _rows(impact.time, state, changed if heavy else set(vanished), bodies.present)
        if heavy:
            lost = _lost(system, bodies, impact.time, before, state, with_impulse=bool((parts != 1.0).any()))
            rows[0, changes.ENERGY :] = lost
        return Done(np.array(found), rows, state, None if heavy else vanished)

    def _found(self, time: float, state: State, i: int, j: int) -> Array:
        """Return the row of a collision for the list of events."""
        first, second = heavier_first(state.gm, i, j)
        distance = float(np.linalg.norm(state.q[second] - state.q[first]))
        speed = float(np.linalg.norm(state.v[second] - state.v[first]))
        return np.array([time, self.number(i, j), 0.0, first, second, distance, speed, np.nan])

    def _do(self, what: type[Merge | Bounce], i: int, j: int) -> bool:
        """Return whether two bodies merge, or bounce, where they collide."""
        rule = self.rule(i, j)
        return rule is not None and isinstance(rule.then, what)

    def _bounce(
        self, system: System, bodies: Bodies, before: State, impact: Impact, known: Array, direction: float
    ) -> Done:
        (state, parts), found, changed = _with_masses_of(system, before, impact.time), [], set()
        pairs = [(impact.first, impact.second)]
        for _ in range(10 * len(before.q)):
            for i, j in pairs:
                rule = self.rule(i, j)
                assert rule is not None
                assert isinstance(rule.then, Bounce)
                first, second = heavier_first(state.gm, i, j)
                self._check_at_rest(known, impact.time, first, second, state)
                following = bounced(state, first, second, rule.then.restitution)
                found.append(self._found(impact.time, state, first, second))
                changed |= {first, second}
                state = following
            touching = sorted(overlapping(state.q, state.radii, state.gm > 0.0, CONTACT))
            pairs = [
                (i, j)
                for i, j in touching
                if approaching(state, i, j) == (direction > 0.0) and self._do(Bounce, i, j) and {i, j} & changed
            ][:1]
            if not pairs:
                break
        state = _keeping_momentum(system, bodies, impact.time, before, state._replace(gm=state.gm / parts), changed)
        rows = _rows(impact.time, state, changed, bodies.present)
        lost = _lost(system, bodies, impact.time, before, state, with_impulse=bool((parts != 1.0).any()))
        rows[0, changes.ENERGY :] = lost
        return Done(np.array(found), rows, state)

    def _check_at_rest(self, known: Array, time: float, first: int, second: int, state: State) -> None:
        pair = (known[:, BODY] == first) & (known[:, OTHER] == second)
        if not pair.any():
            return
        reach, gm = state.radii[first] + state.radii[second], state.gm[first] + state.gm[second]
        if abs(time - known[pair, TIME][-1]) < AT_REST * math.sqrt(reach**3 / gm):
            names = self._names[first], self._names[second]
            raise SingularityError(
                f"t = {time:.10g}: {names[1]} comes to rest on {names[0]}; its bounces follow one another without end. "
                "Use then=orbits.events.Merge(), or end the run before.",
                time=time,
                bodies=names,
            )


def _without(present: NDArray[np.bool_], body: int) -> NDArray[np.bool_]:
    present = present.copy()
    present[body] = False
    return present


def _rows(time: float, after: State, changed: set[int], present: NDArray[np.bool_]) -> Array:
    """Return the rows of the bodies that changed at an instant, without what was lost."""
    rows = np.zeros((len(changed), changes.COLUMNS))
    for row, body in zip(rows, sorted(changed), strict=True):
        row[[changes.TIME, changes.BODY, changes.GM]] = time, body, changes.GONE
        if present[body]:
            row[[changes.GM, changes.RADIUS]] = after.gm[body], after.radii[body]
            row[changes.Q : changes.Q + 3], row[changes.V : changes.V + 3] = after.q[body], after.v[body]
    return rows


def rows_of_change(system: System, bodies: Bodies, time: float, before: State, after: State) -> Array:
    """Return the rows of all bodies that differ in two states at an instant, with what was lost.

    system : at the start of the run; bodies : that are there
    """
    differ = np.zeros(len(before.gm), dtype=bool)
    for old, new in zip(before, after, strict=True):
        differ |= (old != new).reshape(len(differ), -1).any(axis=1)
    differ &= bodies.present & np.isfinite(before.q).all(axis=1)
    rows = _rows(time, after, set(np.flatnonzero(differ).tolist()), bodies.present)
    if len(rows):
        rows[0, changes.ENERGY :] = _lost(system, bodies, time, before, after, with_impulse=True)
    return rows


def _of_massive(system: System, bodies: Bodies, state: State) -> tuple[System, Array, Array, Array]:
    """Return a system of the massive bodies that are there, and their GM, q and v."""
    there = bodies._replace(present=(state.gm > 0.0) & ~np.isnan(state.q[:, 0]), gm=state.gm)
    gm, q, v = (x[there.present] for x in (state.gm, state.q, state.v))
    return of_bodies(system, there), gm, q, v


def _momentum(system: System, bodies: Bodies, time: float, state: State) -> Array:
    """Return the linear momentum of the massive bodies, of the whole Lagrangian, times G, (3,)."""
    left, gm, q, v = _of_massive(system, bodies, state)
    return whole(left, MOMENTUM, diagnostics.linear_momentum(gm, v), q, v, time)


def _keeping_momentum(
    system: System, bodies: Bodies, time: float, before: State, after: State, changed: set[int]
) -> State:
    """Return the state after a collision with the momentum of that before, where a term gives weight to energies: by
    one velocity that is added to those of all massive bodies that changed.
    """
    left, _, q, v = _of_massive(system, bodies, before)
    if inertia(left, q, v, time) is None:
        return after
    kept, v = _momentum(system, bodies, time, before), after.v.copy()
    heavy = [body for body in sorted(changed) if after.gm[body] > 0.0 and not np.isnan(after.q[body, 0])]
    for _ in range(SWEEPS):
        v[heavy] += (kept - _momentum(system, bodies, time, after._replace(v=v))) / after.gm[heavy].sum()
    return after._replace(v=v)


def _with_masses_of(system: System, state: State, time: float) -> tuple[State, Array]:
    """Return a state with the GM that bodies have at a time, of which forces may have taken some, and the parts that
    these are of those without, (n,).
    """
    gm = changed_masses(time, system.forces, state.gm, system.names, system.units)
    return state._replace(gm=gm), np.divide(gm, state.gm, out=np.ones(len(gm)), where=state.gm > 0.0)


def _lost(
    system: System, bodies: Bodies, time: float, before: State, after: State, *, with_impulse: bool
) -> Array:
    """Return the energy, the angular momentum and the momentum that massive bodies lost, times G, (7,).

    with_impulse : whether momentum is counted; collisions lose none, but where masses are other parts of those that
        energies and momenta count
    """
    sums = []
    for state in (before, after):
        left, gm, q, v = _of_massive(system, bodies, state)
        energy = whole(left, ENERGY, diagnostics.energy(gm, q, v, system.values.softening), q, v, time)
        spin = whole(left, ANGULAR_MOMENTUM, diagnostics.angular_momentum(gm, q, v), q, v, time)
        momentum = _momentum(system, bodies, time, state) if with_impulse else np.zeros(3)
        sums.append(np.concatenate([[float(energy)], spin, momentum]))
    lost = sums[0] - sums[1]
    if depends_on_time(system):
        lost[0] = 0.0
    return np.asarray(lost)
