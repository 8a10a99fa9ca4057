"""The osculating elements of the bodies of a run at all of its samples, for pictures: with the masses of each moment,
through mergers, and up to where particles are retired.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from orbits.body_names import index_of, with_article
from orbits.elements import elements_from_state, to_frame
from orbits.errors import InputError
from orbits.point_masses import changed_masses

if TYPE_CHECKING:
    from orbits.protocols import Run

Array = NDArray[np.float64]

ANGLES = ("inc", "Omega", "omega", "pomega", "M", "E", "f", "u", "l", "theta")
"""Elements that are angles, drawn in degrees."""

TURNING = ANGLES[1:]
"""Those that go round."""

AT_ONCE = 200_000
"""The most states whose elements are computed together."""


@dataclass(frozen=True)
class Histories:
    """Elements of some bodies about one of them at all samples.

    bodies : (k,), their numbers in the system; primary : the number of the body that they orbit
    elements : by their names, (samples, k), angles in radians, of ellipses from 0 to 2 pi; NaN where a body is gone,
        and where it moves straight towards or away from the primary
    frame : that of the angles
    """

    bodies: list[int]
    primary: int
    elements: dict[str, Array]
    frame: str

    def __getitem__(self, name: str) -> Array:
        return self.elements[name]

    def shown(self, name: str) -> Array:
        """Return an element as it is drawn: angles in degrees."""
        return np.degrees(self.elements[name]) if name in ANGLES else self.elements[name]


def primary_of(run: Run, primary: str | None, kind: str) -> int:
    """Return the number of the body that the others orbit: the most massive one, unless it is named.

    Raises UnknownNameError for a name that no body has, InputError for a body without mass.
    """
    gm = run.system.values.gm
    place = int(np.argmax(gm)) if primary is None else index_of(primary, run.names, "body", role="primary")
    if gm[place] <= 0.0:
        raise InputError(
            f"kind={kind!r} draws orbits about a massive body, but {run.names[place]} has no mass; choose another "
            "primary=..."
        )
    return place


def masses_over(run: Run, times: Array) -> Array:
    """Return the GM of all bodies at some times, (times, bodies), as mergers and forces have changed it."""
    gm = np.broadcast_to(run.system.values.gm, (len(times), len(run.names)))
    if run.changes is not None:
        gm = run.changes.over(times).gm
    return changed_masses(times, run.system.forces, gm, run.names, run.system.units)


def histories(
    run: Run,
    bodies: Sequence[int],
    names: Sequence[str],
    *,
    primary: int,
    frame: str | None,
    kind: str,
) -> Histories:
    """Return elements of these bodies, without the primary, at all samples of a run.

    Raises InputError for a run without samples and for one in which nothing else is there, UnknownNameError for an
    unknown frame.
    """
    if not len(run):
        raise InputError(f"{run!r} has no samples yet, so there is nothing to draw; expected at least one.")
    others = [i for i in bodies if i != primary]
    if not others:
        raise InputError(
            f"kind={kind!r} draws orbits about {with_article(run.names[primary])}, but no other body is asked for; "
            "name some, or draw kind='paths'."
        )
    frame = (run.system.frame if frame is None else frame).lower()
    gm = masses_over(run, run.times)
    out = {name: np.full((len(run), len(others)), np.nan) for name in names}
    centre = [x[:, primary][:, None] for x in (run._q, run._v)]
    together = max(1, AT_ONCE // len(run))
    for first in range(0, len(others), together):
        some = np.array(others[first : first + together])
        q, v = (to_frame(x[:, some] - middle, frame) for x, middle in zip((run._q, run._v), centre, strict=True))
        there = np.isfinite(q).all(axis=2) & np.cross(q, v).any(axis=2)  # a straight way has no plane
        if there.any():
            both = gm[:, [primary]] + gm[:, some]
            found = elements_from_state(q[there], v[there], both[there])
            for name in names:
                shown = found[name]
                if name in TURNING:  # M and f of ellipses are from -pi on
                    shown = np.where(found["e"] < 1.0, shown % (2.0 * np.pi), shown)
                out[name][:, first : first + together][there] = shown
    return Histories(others, primary, out, frame)


def pieces(t: Array, values: Array, turn: float | None) -> tuple[Array, Array]:
    """Return times and values of a line that is interrupted where an angle goes over the edge of its range.

    turn : of a full turn; None for what is no angle
    """
    if turn is None or len(t) < 2:
        return t, values
    with np.errstate(invalid="ignore"):
        over = np.flatnonzero(np.abs(np.diff(values)) > 0.5 * turn) + 1
    return np.insert(t, over, np.nan), np.insert(values, over, np.nan)


def on_line(time: float, t: Array, values: Array, turn: float | None) -> float:
    """Return where the line through values, whose times increase, is at a time; NaN outside.

    turn : as in `pieces`, over whose edge the line goes by the shorter way
    """
    k = int(np.clip(np.searchsorted(t, time), 1, len(t) - 1))
    start, change = values[k - 1], values[k] - values[k - 1]
    if turn is not None:
        change = (change + 0.5 * turn) % turn - 0.5 * turn
    found = float(np.interp(time, t[k - 1 : k + 1], [start, start + change], left=np.nan, right=np.nan))
    return found if turn is None else found % turn


def last_seen(values: Array) -> int:
    """Return the number of the last sample of a series, (n,) or (n, 3), that is a number; -1 if none is."""
    known = np.isfinite(values.reshape(len(values), -1)).all(axis=1)
    return int(np.flatnonzero(known)[-1]) if known.any() else -1
