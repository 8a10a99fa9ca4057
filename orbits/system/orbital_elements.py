"""Osculating elements with names and units, for one state or for all samples of a run at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u
from astropy.units import Quantity
from numpy.typing import ArrayLike, NDArray

from orbits.body_names import Named, chosen, few, index_of, with_article
from orbits.elements import FRAMES, elements_from_state, to_frame
from orbits.elements.kepler_equation import positive_angle
from orbits.errors import InputError
from orbits.export import MOST_ROWS, Labelled, Tabled, Tabular, Variable, headed
from orbits.point_masses import changed_masses
from orbits.system import new_bodies, presenting
from orbits.system.model import centre_of
from orbits.units import UnitSystem

if TYPE_CHECKING:
    from astropy.time import Time

    from orbits.forces.base import Force

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class OrbitalElements(Named, Tabled, Tabular):
    """Osculating elements of k bodies: quantities of shape (k,) for one state, (samples, k) for a run.

    names : the bodies, in the order of the last axis, without the primary
    primary : the centre of the orbits: a body, "barycentre" (of the massive bodies) or "jacobi" (the centre of mass of
        the preceding bodies)
    frame : the frame of the angles, "ecliptic" (of J2000), "icrf", "sky" or "system" (the axes of the system itself)
    t : time of the states since the epoch, shape () or (samples,);  epoch : a Time, or None
    a, e, q, inc, Omega, omega, pomega, M, E, f, u, l, theta, n, P, T, h, k, ix, iy : as defined for every conic in
        `orbits.elements.Elements`; angles in radians, T a time since the epoch

    elements["Ceres"] are the elements of one body, without the last axis; elements["Ceres"].pal() returns its a, l, h,
    k, ix, iy for `System.add`.
    """

    names: tuple[str, ...]
    primary: str
    frame: str
    t: Quantity
    a: Quantity
    e: Quantity
    q: Quantity
    inc: Quantity
    Omega: Quantity
    omega: Quantity
    pomega: Quantity
    M: Quantity
    E: Quantity
    f: Quantity
    u: Quantity
    l: Quantity  # noqa: E741 - the mean longitude's own symbol
    theta: Quantity
    n: Quantity
    P: Quantity
    T: Quantity
    h: Quantity
    k: Quantity
    ix: Quantity
    iy: Quantity
    epoch: Time | None = None

    def keys(self) -> tuple[str, ...]:
        """Return the names of the elements."""
        return tuple(field.name for field in fields(self))[4:-1]

    def pal(self) -> dict[str, Quantity]:
        """Return a, l, h, k, ix, iy; here l is Omega + omega + M, as Pal defines it, also for retrograde orbits."""
        mean_longitude = Quantity(positive_angle((self.Omega + self.omega + self.M).to_value(u.rad)), u.rad)
        return {"a": self.a, "l": mean_longitude, "h": self.h, "k": self.k, "ix": self.ix, "iy": self.iy}

    def __getitem__(self, name: str) -> OrbitalElements:
        """Return the elements of one body. Raises UnknownNameError, with close matches."""
        i = index_of(name, self.names, "orbit of")
        if self.a.ndim == self.t.ndim:
            return self
        one = {key: getattr(self, key)[..., i] for key in self.keys()}
        return OrbitalElements(
            names=(self.names[i],), primary=self.primary, frame=self.frame, t=self.t, epoch=self.epoch, **one
        )

    def blank(self, where: NDArray[np.bool_]) -> OrbitalElements:
        """Return these elements with NaN where `where`, (samples, k), is True."""
        kept = {key: getattr(self, key) for key in self.keys()}
        blanked = {key: u.Quantity(np.where(where, np.nan, x.value), x.unit, copy=False) for key, x in kept.items()}
        return OrbitalElements(
            names=self.names, primary=self.primary, frame=self.frame, t=self.t, epoch=self.epoch, **blanked
        )

    def _ipython_key_completions_(self) -> list[str]:
        return list(self.names)

    def _labelled(self, bodies: Sequence[str] | None) -> Labelled:
        pick = chosen(self.names, bodies)
        names = tuple(np.array(self.names, dtype=object)[pick])
        run = self.t.ndim == 1
        shape = (*self.t.shape, len(self.names))
        variables = {}
        for key in self.keys():
            x = getattr(self, key)
            values = np.reshape(x.value, shape)[..., pick]
            variables[key] = Variable(values, x.unit, ("time", "body") if run else ("body",))
        known = {"primary": self.primary, "frame": self.frame, **presenting.dated(self.epoch)}
        return Labelled(names, self.t if run else None, variables, known, self.epoch)

    def _caption(self) -> str:
        what = f"elements of {few(self.names) or 'no body'} about {with_article(self.primary)}, {FRAMES[self.frame]}"
        if not self.t.ndim:
            return what
        return f"{what}, lowest ... highest of {len(self.t):,} samples, {presenting.span(self.t)}"

    def _shown(self) -> tuple[list[str], list[list[str]], int]:
        """Return the head of a table, its first rows and the number of others; for a run, ranges of a, e and inc."""
        units = {"a": self.a.unit, "e": "", "inc": u.deg}
        if not self.t.ndim:
            units |= dict.fromkeys(("Omega", "omega", "M"), u.deg)
        head = ["body", *(headed(key, unit) for key, unit in units.items())]
        if not self.t.size:
            return head, [], 0
        columns = [self._cells(key, unit) for key, unit in units.items()]
        return head, list(map(list, zip(self.names, *columns, strict=False))), max(0, len(self.names) - MOST_ROWS)

    def _cells(self, key: str, unit: Any) -> list[str]:
        """Return an element of the first bodies as text; for a run, its range."""
        values = getattr(self, key).reshape((*self.t.shape, len(self.names)))[..., :MOST_ROWS].to_value(unit)
        if values.ndim == 1:
            return [f"{x:.6g}" for x in values]
        return [f"{low:.6g} ... {high:.6g}" for low, high in zip(*_range(values), strict=True)]


def _range(values: Floats) -> tuple[Floats, Floats]:
    """Return the lowest and the highest value of each column, ignoring NaN."""
    return np.fmin.reduce(values, axis=0), np.fmax.reduce(values, axis=0)


def osculating(
    names: Sequence[str],
    gm: Floats,
    q: Floats,
    v: Floats,
    *,
    units: UnitSystem,
    primary: str,
    frame: str,
    t: ArrayLike = 0.0,
    epoch: Time | None = None,
    forces: Sequence[Force] = (),
) -> OrbitalElements:
    """Return the osculating elements of all bodies but the primary.

    gm (n,), q and v (..., n, 3), t (...) : floats in `units`; t is the time of the states
    forces : of the system, which may change gm with time
    epoch : of t = 0, passed on to the result
    primary : a body, with the GM of both; "barycentre", the centre of mass of all massive bodies, with the GM of all;
        or "jacobi", the centre of mass of the preceding bodies, with their GM and the body's own
    frame : one of `orbits.elements.FRAMES`

    Raises UnknownNameError for a primary or a frame that does not exist, InputError, naming the body, for a state
    without elements.
    """
    around = new_bodies.centre_of_several(names, primary) or names[index_of(primary, names, "primary")]
    if around in new_bodies.BARYCENTRIC and np.count_nonzero(gm > 0.0) == 1:
        around = names[int(np.argmax(gm > 0.0))]
    times = np.asarray(t, dtype=np.float64)
    gm = changed_masses(times, forces, gm, names, units)
    if around == new_bodies.JACOBI:
        bodies, centre_gm, centre_q, centre_v = _before(names, gm, q, v)
        two_body_gm = centre_gm + gm[..., bodies]
    elif around in new_bodies.BARYCENTRIC:
        bodies = np.arange(len(names))
        two_body_gm = np.broadcast_to(gm.sum(axis=-1, keepdims=True), gm.shape)
        centre_q, centre_v = (centre_of(gm, x)[..., None, :] for x in (q, v))
    else:
        place = index_of(around, names, "primary")
        bodies = np.delete(np.arange(len(names)), place)
        two_body_gm = gm[..., bodies] + gm[..., [place]]
        centre_q, centre_v = q[..., [place], :], v[..., [place], :]
        if not gm[..., place].any():
            raise InputError(f"{around!r} has no mass, so nothing can orbit it. Choose a massive body as primary.")
    chosen = tuple(names[i] for i in bodies)
    found = elements_from_state(
        to_frame(q[..., bodies, :] - centre_q, frame),
        to_frame(v[..., bodies, :] - centre_v, frame),
        two_body_gm,
        t=times[..., None],
        names=chosen,
    )
    kinds: dict[str, Any] = {"a": units.length, "q": units.length}
    kinds |= dict.fromkeys(("e", "h", "k", "ix", "iy"), u.dimensionless_unscaled)
    kinds |= {"P": units.time, "T": units.time, "n": u.rad / units.time}
    quantities = {key: u.Quantity(found[key], kinds.get(key, u.rad), copy=False) for key in found}
    return OrbitalElements(
        names=chosen,
        primary=around,
        frame=frame.lower(),
        t=u.Quantity(times, units.time),
        epoch=epoch,
        **quantities,
    )


def _before(names: Sequence[str], gm: Floats, q: Floats, v: Floats) -> tuple[NDArray[np.intp], Floats, Floats, Floats]:
    """Return the bodies from the second on, and GM, position and velocity of the centres of mass before each."""
    if not gm[..., 0].any():
        raise InputError(f"Jacobi elements need a first body with mass, but {names[0]!r} has none.")
    bodies = np.arange(1, len(names))
    total = np.cumsum(gm, axis=-1)[..., :-1]
    centres = [np.cumsum(gm[..., None] * x, axis=-2)[..., :-1, :] / total[..., None] for x in (q, v)]
    return bodies, total, centres[0], centres[1]
