"""Curves through samples that are far apart: arcs of two-body motion, where the motion is nearly Keplerian.

Each body orbits a *centre*: for a moon the planet in whose Hill sphere it is, for a circumbinary planet the pair of
stars, otherwise the most massive body. Between two samples, the two-body motions forward from the first and backward
from the second are blended. If they differ by more than `AGREEMENT`, the motion is not Keplerian, and nothing is drawn;
if the run is short enough, its steps are taken again for states between the samples.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.elements.kepler_flow import kepler_flow
from orbits.errors import InputError, OrbitsError
from orbits.plotting.between_samples import Orbit, cubic, nodes, turn
from orbits.point_masses import changed_masses

if TYPE_CHECKING:
    from orbits.protocols import Run, State

Array = NDArray[np.float64]
Bodies = tuple[int, ...]

AGREEMENT = 0.01
"""Fraction of the distance to the centre by which forward and backward motion may differ; less is invisible."""
STRAIGHT, SMOOTH = 0.04, 0.4
"""Largest angle, in radians, between velocities and the line between two samples for which a straight line is drawn or,
where the motion is not Keplerian, a cubic. The error of a cubic through an arc of twice 0.4 is 2e-4 of the arc.
"""
DISTURBED = 0.1
"""Perturbations above this fraction of the attraction by the centre make an osculating ellipse meaningless."""
HEAVY = 0.01
"""A companion with at least this fraction of the largest mass belongs to the centre of bodies that orbit both."""
MOST_CENTRAL = 8
"""The most bodies whose centre of mass is a centre of two-body motion."""
ELLIPSE_POINTS = 721
BETWEEN = 0.25
"""The time between states that are added, in units of the dynamical time: 25 in a revolution on a circle, `SMOOTH`."""
MOST_BETWEEN, MOST_NUMBERS, AT_END = 8_000, 2**21, 1_000
"""The most states that are added, in 300 revolutions or some seconds, the most of all bodies together; and those at the
end of a longer run, in its last 40 revolutions."""

_GAP = np.full((1, 3), np.nan)


class Path(NamedTuple):
    """The curve to draw for one body, in the axes of its system.

    curve : (n, 3), with a row of NaN where it is interrupted
    loose : (samples,) bool, the samples that no curve reaches
    wound : whether the body completes an orbit or more between some samples
    """

    curve: Array
    loose: NDArray[np.bool_]
    wound: bool


def centre_of(system: State, members: Bodies) -> Bodies:
    """Return the bodies whose centre of mass `members` orbit as a group; none for the centre of the system, and among
    more than `MOST_CENTRAL` bodies of like mass, which are a cluster.
    """
    gm, q, _, _ = system.values
    root = int(np.argmax(gm))
    away = np.ones(len(gm), dtype=bool)
    away[[root, *members]] = False
    others = np.flatnonzero((gm >= HEAVY * gm[root]) & (np.arange(len(gm)) != root))
    if root in members:
        return tuple(others[np.argsort(-gm[others], kind="stable")][:1].tolist()) if members == (root,) else ()
    place = _mean(gm, q, members)
    able = np.flatnonzero(away & (gm > gm[list(members)].sum()))
    hill = np.linalg.norm(q[able] - q[root], axis=1) * np.cbrt(gm[able] / (3.0 * gm[root]))
    inside = np.linalg.norm(q[able] - place, axis=1) < hill
    if inside.any():
        return (int(able[inside][np.argmin(hill[inside])]),)
    reach = np.linalg.norm(place - q[root]) / 2.0
    with_root = others[away[others] & (np.linalg.norm(q[others] - q[root], axis=1) < reach)]
    return (root, *with_root.tolist()) if len(with_root) < MOST_CENTRAL else ()


def relative(gm: Array, q: Array, v: Array, members: Bodies, centre: Bodies) -> Orbit:
    """Return the motion of `members` about `centre`; q and v of shape (..., bodies, 3)."""
    return Orbit(
        _mean(gm, q, members) - _mean(gm, q, centre),
        _mean(gm, v, members) - _mean(gm, v, centre),
        float(gm[[*members, *centre]].sum()),
    )


def is_nearly_two_body(system: State, members: Bodies, centre: Bodies) -> bool:
    """Whether perturbations of the relative motion by other bodies are below `DISTURBED` of the centre's attraction."""
    gm, q, v, softening = system.values
    pull = np.zeros_like(q)
    for i in (*members, *centre):
        away = np.delete(q, i, axis=0) - q[i]
        pull[i] = (np.delete(gm, i) / ((away**2).sum(axis=1) + softening**2) ** 1.5) @ away
    orbit = relative(gm, q, v, members, centre)
    alone = -orbit.gm * orbit.q / np.linalg.norm(orbit.q) ** 3
    excess = _mean(gm, pull, members) - _mean(gm, pull, centre) - alone
    return bool(np.linalg.norm(excess) < DISTURBED * np.linalg.norm(alone))


def ellipse(system: State, i: int) -> Array | None:
    """Return (721, 3) points, in the system's axes, of the osculating ellipse of body i about its centre.

    None for the central body, for parabolas, hyperbolas and radial falls, and where perturbations by other bodies are
    too strong for an ellipse to be meaningful.
    """
    gm, q, v, _ = system.values
    centre = centre_of(system, (i,))
    if not centre:
        return None
    orbit = relative(gm, q, v, (i,), centre)
    h = np.cross(orbit.q, orbit.v)
    if orbit.binding <= 0.0 or not h.any() or not is_nearly_two_body(system, (i,), centre):
        return None
    r = float(np.linalg.norm(orbit.q))
    a = orbit.gm / float(orbit.binding)
    eccentricity = np.cross(orbit.v, h) / orbit.gm - orbit.q / r
    e = float(np.linalg.norm(eccentricity))
    x = eccentricity / e if e > 1e-12 else orbit.q / r
    y = np.cross(h / np.linalg.norm(h), x)
    angle = np.linspace(0.0, 2 * np.pi, ELLIPSE_POINTS)[:, None]
    round_centre = a * ((np.cos(angle) - e) * x + np.sqrt(max(1 - e * e, 0.0)) * np.sin(angle) * y)
    return np.asarray(_mean(gm, q, (i, *centre)) + _share(gm, (i,), centre) * round_centre)


def joined(run: Run, i: int, samples: Samples | None = None) -> Path:
    """Return the path of body i; samples : of the run, if they are read for several bodies.

    It consists of straight lines between close samples, arcs of two-body motion between distant ones, and cubics where
    the motion is smooth but not Keplerian.
    """
    samples = samples or Samples(run)
    q, count = samples.q(i), len(run)
    if count < 2:
        return Path(_GAP, np.ones(count, dtype=bool), False)
    steps = np.diff(run.times)
    centre = centre_of(samples.end, (i,))
    orbit = samples.orbit((i,), centre) if centre else None
    wound = np.zeros(count - 1, dtype=bool)
    if orbit and is_nearly_two_body(samples.end, (i,), centre):
        wound = np.abs(steps) >= np.minimum(orbit.period[:-1], orbit.period[1:])
    turned = np.where(wound, np.inf, turn(q, samples.v(i), run.times))
    straight = turned < STRAIGHT
    smooth = np.flatnonzero(~straight & (turned < SMOOTH))
    arcs = dict(zip(smooth.tolist(), samples.cubics((i,), smooth), strict=True))
    there = np.asarray(np.isfinite(q).all(axis=1))  # retired particles are NaN
    curved = np.flatnonzero(~straight & ~wound & there[:-1] & there[1:])
    if len(curved) and orbit:
        points, good = samples.arcs((i,), orbit, curved)
        arcs |= {k: arc for k, arc, fine in zip(curved.tolist(), points, good, strict=True) if fine}
    drawn = straight.copy()
    drawn[list(arcs)] = True
    pieces: list[Array] = []
    k = 0
    for stop in [*np.flatnonzero(~straight).tolist(), count - 1]:  # straight lines up to here, then another segment
        if stop > k:
            pieces.append(q[k : stop + 1])
        if stop in arcs:
            pieces.append(arcs[stop])
        elif stop < count - 1 and pieces and pieces[-1] is not _GAP:
            pieces.append(_GAP)
        k = stop + 1
    loose = there & ~(np.append(drawn, False) | np.append(False, drawn))
    return Path(np.concatenate(pieces or [_GAP]), loose, bool(wound.any()))


def followed(run: Run, bodies: Sequence[int]) -> tuple[Samples, dict[int, Path]]:
    """Return the samples of a run and the paths of some bodies.

    Where samples are more than a revolution apart, or too far apart for a line where the motion is not Keplerian, the
    paths go through states between them, for which the steps of the run are taken again, if they can be: of a long run
    those of its end.
    """
    samples = Samples(run)
    paths = {i: joined(run, i, samples) for i in bodies}
    if not any(path.loose.any() for path in paths.values()) or len(run) < 2:
        return samples, paths
    gaps = np.abs(np.diff(run.times))
    between = gaps / (BETWEEN * min(_fastest(run, bodies), float(gaps.max())))
    most = min(MOST_BETWEEN, MOST_NUMBERS / len(run.names))
    times = _with_more(run.times, between, most if between.sum() < most else min(AT_END, most))
    try:
        finer: Run = run.at(times)
    except OrbitsError:
        return samples, paths
    samples = Samples(finer)
    return samples, {i: joined(finer, i, samples) for i in bodies}


def _with_more(times: Array, between: Array, most: float) -> Array:
    """Return the times of samples with others between them, at most about `most`, as far back from the end.

    between : (n - 1,), how many are wanted from each sample to the next
    """
    parts, left = [times[-1:]], most
    for begin, end, count in zip(times[-2::-1].tolist(), times[:0:-1].tolist(), between[::-1].tolist(), strict=True):
        share = min(1.0, left / count) if count > 0.0 else 1.0
        more = np.linspace(end - share * (end - begin), end, max(2, math.ceil(share * count) + 1))[:-1]
        parts.append(more if share == 1.0 else np.append(begin, more if share > 0.0 else []))
        left = max(left - count, 0.0)
    return np.concatenate(parts[::-1])


def _fastest(run: Run, bodies: Sequence[int]) -> float:
    """Return the shortest dynamical time of some bodies in the first and in the last sample."""
    gm, rows, rate2 = run.system.values.gm, list(bodies), 0.0
    for q in (run._q[0], run._q[-1]):
        r2 = ((q[rows, None] - q) ** 2).sum(axis=2) + run.system.values.softening**2
        r2[np.arange(len(rows)), rows] = np.inf
        rate2 = max(rate2, float(np.nanmax(np.nansum((gm + gm[rows, None]) * r2**-1.5, axis=1), initial=0.0)))
    return rate2**-0.5 if rate2 > 0.0 else math.inf


def last_state(run: Run) -> State:
    """Return the system at the last sample, with the masses of then; retired particles, and bodies that merged, are
    without mass at their last positions, or at those of the start if no sample has them (see `seen`).

    It has no epoch, as the end of a long run may be beyond all dates. Raises InputError for a run without samples.
    """
    if not len(run):
        raise InputError(f"{run!r} has no samples yet, so there is nothing to draw; expected at least one.")
    q, v = run.q[-1].value.copy(), run.v[-1].value.copy()
    for particle in run.retired:
        body = run.names.index(particle.name)
        if np.isnan(q[body]).all():
            q[body], v[body] = particle.q.value, particle.v.value
    for body in np.flatnonzero(np.isnan(q).all(axis=1)).tolist():  # merged into another one
        there = np.flatnonzero(np.isfinite(run._q[:, body]).all(axis=1))
        last = run._sample(int(there[-1])) if there.size else run.system.values[1:3]
        q[body], v[body] = last[0][body], last[1][body]
    gm, time = run.system.values.gm, run._last_time
    if run.changes is not None:
        bodies = run.changes.bodies_at(time)
        gm = np.where(bodies.present, bodies.gm, 0.0)
    gm = changed_masses(time, run.system.forces, gm, run.names, run.system.units)
    # Without terms and forces, which may be of bodies that are without mass by now, or have changed it.
    return run.system.replaced(gm=gm, q=q, v=v, epoch=None, terms=(), forces=())


def seen(run: Run) -> NDArray[np.bool_]:
    """Return which bodies are in any sample of a run, (bodies,): those that merged before are not."""
    found = np.zeros(len(run.names), dtype=bool)
    for sample in (0, -1):
        found |= np.isfinite(run._q[sample]).all(axis=1)
    for body in np.flatnonzero(~found).tolist():  # samples may be in any order
        found[body] = np.isfinite(run._q[:, body]).all(axis=1).any()
    return found


class Samples:
    """The samples of a run, read body by body; those of the bodies used last are kept."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self.end = last_state(run)
        self.gm = self.end.values.gm
        self._known: dict[int, tuple[Array, Array]] = {}

    def q(self, i: int) -> Array:
        return self._body(i)[0]

    def v(self, i: int) -> Array:
        return self._body(i)[1]

    def orbit(self, members: Bodies, centre: Bodies) -> Orbit:
        """Return the relative motion at every sample."""
        (q, v), (to_q, to_v) = self._middle(members), self._middle(centre)
        return Orbit(q - to_q, v - to_v, float(self.gm[[*members, *centre]].sum()))

    def arcs(self, members: Bodies, orbit: Orbit, k: NDArray[np.intp]) -> tuple[Array, NDArray[np.bool_]]:
        """Return points (len(k), n, 3) from each sample k to the next, and which of these arcs are reliable."""
        times = nodes(orbit, self.run.times, k)
        return self._between(members, k, times)

    def cubics(self, members: Bodies, k: NDArray[np.intp]) -> Array:
        """Return points (len(k), 17, 3) of the cubics from each sample k to the next."""
        length = np.diff(self.run.times)[k][:, None]
        return cubic(*self._middle(members), k, length * np.linspace(0.0, 1.0, 17), length)

    def _between(self, members: Bodies, k: NDArray[np.intp], times: Array) -> tuple[Array, NDArray[np.bool_]]:
        centre = centre_of(self.end, members)
        length = np.diff(self.run.times)[k][:, None]
        if not centre:
            return cubic(*self._middle(members), k, times, length), np.ones(len(k), dtype=bool)
        orbit = self.orbit(members, centre)
        forward, _ = kepler_flow(orbit.q[k][:, None], orbit.v[k][:, None], orbit.gm, times)
        backward, _ = kepler_flow(orbit.q[k + 1][:, None], orbit.v[k + 1][:, None], orbit.gm, times - length)
        done = times / length
        blended = forward + (done * done * (3.0 - 2.0 * done))[..., None] * (backward - forward)
        apart = np.linalg.norm(backward - forward, axis=-1)
        good = (apart < AGREEMENT * np.linalg.norm(blended, axis=-1)).all(axis=1)
        base, fine = self._between((*members, *centre), k, times)
        return base + _share(self.gm, members, centre) * blended, good & fine

    def _middle(self, members: Bodies) -> tuple[Array, Array]:
        weights = _weights(self.gm, members)
        both = [self._body(i) for i in members]
        q, v = (np.asarray(sum(w * x[part] for w, x in zip(weights, both, strict=True))) for part in (0, 1))
        return q, v

    def _body(self, i: int) -> tuple[Array, Array]:
        if i in self._known:
            self._known[i] = self._known.pop(i)
            return self._known[i]
        if len(self._known) > 2 * MOST_CENTRAL:
            del self._known[next(iter(self._known))]
        path = self.run[self.run.names[i]]
        self._known[i] = (path.q.value, path.v.value)
        return self._known[i]


def _weights(gm: Array, members: Bodies) -> Array:
    some = gm[list(members)]
    return np.asarray(some / some.sum() if some.sum() > 0.0 else np.full(len(some), 1.0 / len(some)))


def _mean(gm: Array, x: Array, members: Bodies) -> Array:
    return np.asarray(np.einsum("j,...jk->...k", _weights(gm, members), x[..., list(members), :]))


def _share(gm: Array, members: Bodies, centre: Bodies) -> float:
    """Return the share of `members` in the relative motion about the common centre of mass."""
    return float(gm[list(centre)].sum() / gm[[*members, *centre]].sum())
