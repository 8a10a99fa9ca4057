"""Changes of the bodies of a run, as by mergers: rows of numbers, from which masses and radii at any time follow.

A *leg* is a part of a run in which bodies, masses and radii stay the same.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.body_names import few
from orbits.errors import ArchiveError
from orbits.trajectory.retired import absent, moved

if TYPE_CHECKING:
    from orbits.system import System

Array = NDArray[np.float64]

TIME, BODY, GM, RADIUS, Q, V, ENERGY, SPIN, IMPULSE = 0, 1, 2, 3, 4, 7, 10, 11, 14
COLUMNS = 17
"""Columns of a row: the time since the epoch, a body, and its GM, radius, position and velocity from then on; GM is -1
for a body that is gone. Then what all massive bodies lost at this instant: energy, angular momentum and momentum, times
G, in the first row of the instant."""

GONE = -1.0

CHANGES, COUNTS = "changes", "change_counts"
"""The arrays of a checkpoint: rows with room for more; their number, whether the march is in a part of a step, and the
steps of earlier legs."""


def no_changes() -> Array:
    """Return no rows, (0, COLUMNS)."""
    return np.empty((0, COLUMNS))


class Bodies(NamedTuple):
    """The bodies of a run at a time: which are there (n,), their GM and radii (n,)."""

    present: NDArray[np.bool_]
    gm: Array
    radii: Array


@dataclass(frozen=True, eq=False)
class Legs:
    """A part of a run in which bodies, masses and radii stay the same.

    time : since the epoch, at which it begins
    names, gm, radii : of its bodies; radii are None if they are not known
    """

    time: u.Quantity
    names: tuple[str, ...]
    gm: u.Quantity
    radii: u.Quantity | None

    def __repr__(self) -> str:
        count = len(self.names)
        return f"Legs({count} bod{'y' if count == 1 else 'ies'} from t = {self.time:g} on: {few(self.names)})"


class Changes:
    """The changes of the bodies of a run so far, in the order of time.

    system : at the start of the run
    rows : (k, COLUMNS), see above; direction : 1 forwards in time, -1 backwards
    """

    def __init__(self, system: System, rows: Array, direction: float) -> None:
        self.rows, self._direction = rows, direction
        self._system = system
        radii = np.zeros(len(system)) if system.radii is None else system.radii.value
        self._start = Bodies(np.ones(len(system), dtype=bool), system.values.gm, radii)

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def acted_on_massive(self) -> bool:
        """Whether massive bodies changed."""
        return bool(self._system.massive[self.rows[:, BODY].astype(int)].any())

    @property
    def begin_legs(self) -> bool:
        """Whether bodies went on with other masses or velocities, and not only massless ones were lost: what was
        recorded of their motion before is not that of one march.
        """
        lost = ~self._system.massive[self.rows[:, BODY].astype(int)] & (self.rows[:, GM] == GONE)
        return not bool(lost.all())

    @property
    def kicks(self) -> bool:
        """Whether the momentum of all bodies was changed, beyond round-off."""
        return bool(np.any(self.rows[:, IMPULSE:]))

    def vanished(self) -> dict[int, float]:
        """Return the times at which bodies were gone, by their numbers."""
        gone = self.rows[self.rows[:, GM] == GONE]
        return dict(zip(gone[:, BODY].astype(int).tolist(), gone[:, TIME].tolist(), strict=True))

    def before(self, times: Array) -> NDArray[np.intp]:
        """Return how many rows there are up to each of some times (m,), including those at that time."""
        return np.searchsorted(self.rows[:, TIME] * self._direction, times * self._direction, side="right")

    def between(self, begin: float, end: float) -> Array:
        """Return the rows later than one time and not later than another."""
        first, last = self.before(np.array([begin, end]))
        return self.rows[first:last]

    def bodies_after(self, count: int) -> Bodies:
        """Return the bodies after the first `count` rows."""
        present, gm, radii = self._start.present.copy(), self._start.gm.copy(), self._start.radii.copy()
        for row in self.rows[:count]:
            body = int(row[BODY])
            if row[GM] == GONE:
                present[body] = False
            else:
                gm[body], radii[body] = row[GM], row[RADIUS]
        return Bodies(present, gm, radii)

    def bodies_at(self, time: float) -> Bodies:
        """Return the bodies at a time, after the changes at this time."""
        return self.bodies_after(int(self.before(np.array([time]))[0]))

    def lost(self, times: Array) -> Array:
        """Return the energy, angular momentum and momentum that the bodies lost up to each time, times G, (m, 7)."""
        lost = np.zeros((len(self.rows) + 1, 7))
        np.cumsum(self.rows[:, ENERGY:], axis=0, out=lost[1:])
        return np.asarray(lost[self.before(times)])

    def parts(self, times: Array) -> Iterator[tuple[slice, Bodies]]:
        """Yield the parts of samples at some times (m,), in any order, in which the bodies are the same."""
        after = self.before(times)
        ends = [*(np.flatnonzero(np.diff(after)) + 1).tolist(), len(times)] if len(times) else []
        begin = 0
        for end in ends:
            yield slice(begin, end), self.bodies_after(int(after[begin]))
            begin = end

    def over(self, times: Array) -> Bodies:
        """Return the bodies at each of some times (m,): present, GM and radii, all (m, n)."""
        shape = len(times), len(self._start.gm)
        all_of_them = Bodies(np.ones(shape, dtype=bool), np.empty(shape), np.empty(shape))
        for part, bodies in self.parts(times):
            for kept, now in zip(all_of_them, bodies, strict=True):
                kept[part] = now
        return all_of_them

    def legs(self) -> tuple[Legs, ...]:
        """Return the legs of the run; the first begins at its start."""
        units, system = self._system.units, self._system
        legs: list[Legs] = []
        counts = self.before(np.unique(self.rows[:, TIME] * self._direction) * self._direction)
        for count in [0, *counts.tolist()]:
            present, gm, radii = self.bodies_after(count)
            names = tuple(name for name, there in zip(system.names, present, strict=True) if there)
            sizes = None if system.radii is None else u.Quantity(radii[present], units.length)
            time = u.Quantity(self.rows[count - 1, TIME] if count else 0.0, units.time)
            leg = Legs(time, names, u.Quantity(gm[present], units.gm), sizes)
            if not legs or not _same(leg, legs[-1]):
                legs.append(leg)
        return tuple(legs)

    def __repr__(self) -> str:
        return f"Changes({len(self.rows):,} of bodies; see run.events and run.legs)"


def _same(one: Legs, other: Legs) -> bool:
    """Return whether two legs have the same bodies with the same masses and radii."""
    if one.names != other.names or np.any(one.gm != other.gm):
        return False
    return one.radii is None or not np.any(one.radii != other.radii)


def at_time(system: System, changes: Changes, q: Array, v: Array, time: float) -> System:
    """Return the bodies of a run at a time, from q and v of all bodies (n, 3): without those that are gone by then."""
    bodies = changes.bodies_at(time)
    gone = ~bodies.present | absent(q, v, system.massive)
    radii = None if system.radii is None else bodies.radii
    return moved(system.replaced(gm=bodies.gm, radii=radii), q, v, time, gone)


def of_bodies(system: System, bodies: Bodies) -> System:
    """Return a system of the bodies that are there, with their masses and radii, and the state of the start."""
    gone = [name for name, there in zip(system.names, bodies.present, strict=True) if not there]
    left = system.remove(*gone) if gone else system
    radii = None if system.radii is None else bodies.radii[bodies.present]
    return left.replaced(gm=bodies.gm[bodies.present], radii=radii)


def checked_rows(checkpoint: Mapping[str, NDArray[Any]], system: System) -> Array:
    """Return the changes in a checkpoint. Raises ArchiveError for those that no run makes."""
    count = int(checkpoint[COUNTS][0])
    rows = np.array(checkpoint[CHANGES][: max(count, 0)], dtype=np.float64)
    bodies = rows[:, BODY]
    fits = 0 <= count == len(rows) and bool(((bodies >= 0) & (bodies < len(system)) & (bodies % 1.0 == 0.0)).all())
    kept = rows[rows[:, GM] != GONE]
    if not fits or not np.isfinite(rows).all() or (kept[:, [GM, RADIUS]] < 0.0).any():
        raise ArchiveError("the changes of bodies in its checkpoint are not those of a run.")
    return rows
