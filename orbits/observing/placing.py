"""Where a run is in the Solar System, and where its observer and the Sun are.

The origin of a run is seldom the barycentre of the Solar System, and is not at rest there if bodies are left out: with
the Sun and Jupiter alone it moves by metres a second, which is milliarcseconds of light time and of aberration. So a
run is placed by the most massive of its bodies that DE440 has, the Sun as a rule: what it knows are positions relative
to that. At each time of an observation the run is moved as a whole, at a uniform velocity while the light is under way.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits import ephemeris
from orbits.errors import InputError
from orbits.observing.observers import EARTH, EARTH_MOON, SUN, Observer, known

Array = NDArray[np.float64]

WITH_MOONS = ephemeris.BODIES[ephemeris.BODIES.index("Mars") :]
"""Bodies that DE440 has with their moons: a run of one of them and its moons has their barycentre."""


class State(NamedTuple):
    """Positions and velocities at m times, (m, 3) each, au and au/d, relative to the barycentre."""

    q: Array
    v: Array


class Placing(NamedTuple):
    """A run in the Solar System at m times.

    shift : what is added to positions and velocities of the run
    observer : the centre of the observer's body; sun : the Sun, or None if its place is not known
    notes : in words, for the head of a table
    """

    shift: State
    observer: State
    sun: State | None
    notes: tuple[str, ...]


def placed(
    names: Sequence[str], gm: Array, q: Array, v: Array, jd1: Array, jd2: Array, observer: Observer
) -> Placing:
    """Return where a run is, (m, bodies, 3) for q and v, at the Julian dates jd1 + jd2, TDB.

    Raises InputError if it has no body that tells, and EpochError if what is needed lies outside DE440.
    """
    in_de440 = {i: name for i, name in enumerate(map(known, names)) if name is not None}
    anchor = max((i for i in in_de440 if gm[i] > 0.0), key=lambda i: gm[i], default=None)
    shift = State(np.zeros(q[:, 0].shape), np.zeros(q[:, 0].shape))
    covered = anchor is not None and ephemeris.covers(jd1, jd2)
    if anchor is not None and covered:
        there, what, centre = _de440(in_de440[anchor], jd1, jd2), names[anchor], State(q[:, anchor], v[:, anchor])
        if len(in_de440) == 1 and in_de440[anchor] in WITH_MOONS and np.count_nonzero(gm) > 1:
            what = f"barycentre, as {names[anchor]} with its moons,"
            centre = State(barycentre(gm, q), barycentre(gm, v))
        shift = State(there.q - centre.q, there.v - centre.v)
        notes = [f"the run is placed in the Solar System by its {what} and that of DE440"]
    else:
        notes = ["the origin of the run is taken as the barycentre of the Solar System"]

    def of_run(i: int) -> State:
        return State(q[:, i] + shift.q, v[:, i] + shift.v)

    rows = {name: i for i, name in in_de440.items()}
    if SUN in rows:
        sun: State | None = of_run(rows[SUN])
    else:
        sun = _de440(SUN, jd1, jd2) if covered else None
    body = observer.body
    if body is None:
        return Placing(shift, State(np.zeros_like(shift.q), np.zeros_like(shift.v)), sun, tuple(notes))
    if body in names:
        return Placing(shift, of_run(names.index(body)), sun, tuple(notes))
    if body in rows:
        return Placing(shift, of_run(rows[body]), sun, tuple(notes))
    if body == EARTH and EARTH_MOON in rows:
        away = _de440(EARTH, jd1, jd2), _de440(EARTH_MOON, jd1, jd2)
        both = of_run(rows[EARTH_MOON])
        earth = State(both.q + (away[0].q - away[1].q), both.v + (away[0].v - away[1].v))
        notes.append("the Earth is placed by the barycentre of Earth and Moon of the run, and relative to it by DE440")
        return Placing(shift, earth, sun, tuple(notes))
    if anchor is None:
        raise InputError(
            f"the observer is at {body} of DE440, but this run has no body of DE440 that tells where it is in the "
            f"Solar System; expected an observer among its own bodies, or a run with a body such as {SUN!r}."
        )
    notes.append(f"{body} is that of DE440, as the run has none")
    return Placing(shift, _de440(body, jd1, jd2), sun, tuple(notes))


def barycentre(gm: Array, x: Array) -> Array:
    """Return the mean of positions or velocities, (m, bodies, 3), by mass, (m, 3), of the bodies that are there."""
    weights = np.where(np.isfinite(x[..., 0]), gm, 0.0)
    weights /= weights.sum(axis=1, keepdims=True)
    return np.asarray(np.nansum(weights[..., None] * x, axis=1))


def _de440(name: str, jd1: Array, jd2: Array) -> State:
    q, v = ephemeris.tracks([name], jd1, jd2)
    return State(q[:, 0], v[:, 0])
