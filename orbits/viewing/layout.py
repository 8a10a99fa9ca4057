"""How a run is laid out for a view: which bodies are drawn one by one, and about what each of them moves.

A body that is drawn one by one is shown relative to its *centre*: for a moon its planet, for planets the *root*, which
is the body with most mass. The root is shown relative to the origin, as are two stars, planets about both, and bodies
that move about no other. Between two samples, the motion about the centre is two-body motion that fits both of them, or
a cubic where it is not nearly Keplerian.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from orbits.plotting import arcs

if TYPE_CHECKING:
    from orbits.system import System

Array = NDArray[np.float64]

MOST_BODIES = 200
"""The most massive bodies that are drawn one by one; lighter ones are points, as particles are."""
MOST_WITH_PARTICLES = 60
"""The most bodies of a system whose massless particles are drawn one by one as well."""
DOMINANT = 0.9
"""The fraction of all mass from which on the points are taken to orbit the root."""
BARYCENTRIC = 1e-6
"""How far from rest at the origin, as a fraction, the centre of mass may be if bodies are to move about the origin."""


@dataclass(frozen=True)
class Layout:
    """The bodies of a run as a view shows them.

    bodies, points : numbers of those that are drawn one by one, the root first, and of the others
    centres : for each of the bodies the place of its centre among `bodies`, -1 for the origin; a centre precedes those
        that move about it
    gm : for each of the bodies the GM of its two-body motion, 0 where cubics join its samples
    points_gm : the same for the points, which are relative to the root
    dominated : whether the root has nearly all mass, so that a view is centred on it and not on the origin
    """

    bodies: tuple[int, ...]
    points: tuple[int, ...]
    centres: tuple[int, ...]
    gm: tuple[float, ...]
    points_gm: float
    dominated: bool

    @classmethod
    def of(cls, system: System, there: NDArray[np.bool_] | None = None, particle_stride: int = 1) -> Layout:
        """Return the layout of a system; of its points, only every `particle_stride`-th is kept.

        there : (bodies,), which bodies are there to the end; only those can be centres. By default all
        """
        gm = system.values.gm
        there = np.ones(len(gm), dtype=bool) if there is None else there
        root = int(np.argmax(np.where(there, gm, -1.0)))
        dominated = bool(gm[root] >= DOMINANT * gm.sum())
        heavy = np.flatnonzero(system.massive)
        single = heavy[np.argsort(-gm[heavy], kind="stable")][:MOST_BODIES].tolist()
        if len(system) <= MOST_WITH_PARTICLES:
            single += np.flatnonzero(~system.massive).tolist()
        able = {i for i in single if there[i]}
        motion = {i: _motion(system, i, root, able, dominated) for i in single}
        order = _from_the_root(root, {i: centre for i, (centre, _) in motion.items()})
        place = {None: -1} | {i: k for k, i in enumerate(order)}
        rest = sorted(set(range(len(system))) - set(single))
        return cls(
            tuple(order),
            tuple(rest[::particle_stride]),
            tuple(place[motion[i][0]] for i in order),
            tuple(motion[i][1] for i in order),
            float(gm[root]) if dominated else 0.0,
            dominated,
        )


def _motion(
    system: System, i: int, root: int, able: set[int], dominated: bool
) -> tuple[int | None, float]:
    """Return the body about which body i moves, None for the origin, and the GM of that motion, 0 for a cubic.

    able : the bodies that can be centres
    """
    gm = system.values.gm
    found = arcs.centre_of(system, (i,))
    partner = arcs.centre_of(system, (root,))
    if i == root or (found == (root,) and partner == (i,)) or len(found) > 1:
        about = found if i != root else partner
        if not about or not _is_barycentric(system) or not arcs.is_nearly_two_body(system, (i,), about):
            return (None, 0.0) if i == root or not dominated else (root, 0.0)
        others = float(gm[list(about)].sum())
        return None, others**3 / (gm[i] + others) ** 2  # relative to the common centre of mass
    centre = found[0] if found and found[0] in able else root
    if arcs.is_nearly_two_body(system, (i,), (centre,)):
        return centre, float(gm[i] + gm[centre])
    return (centre if dominated else None), 0.0


def _is_barycentric(system: System) -> bool:
    """Whether the centre of mass rests at the origin."""
    gm, q, v, _ = system.values
    heavy = system.massive
    sizes = [np.abs(x[heavy]).max() for x in (q, v)]
    return all(
        np.abs(gm @ x).max() <= BARYCENTRIC * gm.sum() * size for x, size in zip((q, v), sizes, strict=True)
    )


def _from_the_root(root: int, centre_of: dict[int, int | None]) -> list[int]:
    """Return the bodies, the root first and each after its centre; otherwise in their order."""
    order = [root]
    waiting = [i for i in centre_of if i != root]
    while waiting:
        ready = [i for i in waiting if centre_of[i] is None or centre_of[i] in order]
        order += ready
        waiting = [i for i in waiting if i not in ready]
    return order


def relative(layout: Layout, states: Array) -> Array:
    """Return the states of the bodies relative to their centres, (..., bodies, 3); states : (..., all bodies, 3)."""
    shown = states[..., list(layout.bodies), :]
    others = np.array([k for k, centre in enumerate(layout.centres) if centre >= 0], dtype=np.intp)
    about = [layout.centres[k] for k in others]
    out = shown.copy()
    out[..., others, :] -= shown[..., about, :]
    return np.asarray(out)
