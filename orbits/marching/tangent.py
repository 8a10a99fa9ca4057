"""Tangent vectors of massive bodies that follow the steps of a march; see `orbits.kernels.tangent`."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray

from orbits.errors import ConvergenceError, InputError
from orbits.integrators.base import Integrator
from orbits.integrators.forms import Array, padded
from orbits.kernels.lanes import WIDTH
from orbits.kernels.steps import Model
from orbits.kernels.tangent import AREA, BEFORE, ETA, LOGARITHM, SQUARE, Course, Fan, Room, follow
from orbits.lagrangians.base import GRADIENTS, SEPARABLE, Lagrangian
from orbits.marching.alignment import aligned
from orbits.marching.motion import Motion
from orbits.tableaux import PartitionedTableau, SymplecticTableau
from orbits.tableaux.partitioned import DIGITS

DQ, DV = 0, 2
"""The parts of a tangent vector: dq and dv; the low part of each follows it."""


class Tangents:
    """Tangent vectors of massive bodies, and their growth if it is measured.

    lagrangian, parameters : of the bodies that march, with the vectors of their kernels
    integrator : the method that takes their steps
    bodies : the numbers of the bodies that are varied; the others have no variations
    vectors : (count, 2, bodies, 3), dq and dv at the start
    scale : None, or the unit of time in which velocities count in the lengths of the vectors whose growth is measured

    Raises InputError if the derivative of the method, or of a term, is not known.
    """

    def __init__(
        self,
        lagrangian: Lagrangian,
        parameters: Any,
        integrator: Integrator,
        bodies: NDArray[np.intp],
        vectors: Array,
        scale: float | None = None,
    ) -> None:
        require_tangents(integrator, lagrangian)
        self._model, self._table = Model(lagrangian.tag, parameters), table_of(integrator.tableau)
        strength = np.asarray(parameters[0] if isinstance(parameters, tuple) else parameters)
        n, size, s = len(strength) - 1, 3 * (len(strength) - 1), len(self._table)
        self._rows = (np.arange(3, dtype=np.int64)[:, None] * n + np.asarray(bodies, dtype=np.int64)).ravel()
        self._inertia = np.tile(1.0 / strength[1 + np.asarray(bodies)], 3)
        self._count, d = len(vectors), len(self._rows)
        groups = (self._count + WIDTH - 1) // WIDTH
        self._vectors, self._kicks, self._growth = aligned(
            (groups, 4, d, WIDTH), (groups, s * d, WIDTH), (0 if scale is None else groups, 5, WIDTH)
        )
        self._room = Room(
            *aligned((s, padded(size)), (s, padded(size)), (3 * size * size,), (s, d, d), (d, WIDTH))
        )
        lanes = np.moveaxis(np.asarray(vectors, dtype=np.float64), 3, 2).reshape(self._count, 2, d)
        filled = np.zeros((groups * WIDTH, 2, d))
        filled[: self._count] = lanes
        filled[self._count :] = lanes[:1]  # lanes that are not used move like the first one
        self._vectors[:, [DQ, DV]] = filled.reshape(groups, WIDTH, 2, d).transpose(0, 2, 3, 1)
        self._scale = 1.0 if scale is None else float(scale)
        if scale is not None:
            parts = self._vectors[:, [DQ, DV]] * np.array([1.0, self._scale])[:, None, None]
            self._growth[:, SQUARE] = np.sum(parts**2, axis=(1, 2))
        self._integrator = integrator

    def follow(self, motion: Motion) -> None:
        """Follow the steps of a stretch of the march, which begins where the last one ended.

        Raises ConvergenceError if the stages of a step do not converge, InputError if the vectors become too large.
        """
        course = Course(*(np.ascontiguousarray(x) for x in (motion.times, motion.lengths, motion.path)))
        fan = Fan(self._vectors, self._kicks, self._growth)
        done = follow(self._model, self._table, course, fan, self._rows, self._inertia, self._scale, self._room)
        if not np.isfinite(self._vectors).all():
            raise InputError(
                f"tangent vectors exceed the range of numbers by t = {course.times[-1]:.10g}, 1e308 times what they were; "
                "expected a shorter duration, or orbits.megno, which scales them on the way."
            )
        if done < len(course.lengths):
            t, h = float(course.times[done]), float(course.lengths[done])
            raise ConvergenceError(
                f"the variational equations of {self._integrator.label} do not converge in the step of {h:.6g} from "
                f"t = {t:.10g}; use a smaller dt.",
                step=int(done),
                time=t,
            )

    def branched(self) -> Tangents:
        """Return a copy that can follow another march from here, such as a part of a step."""
        copy: Tangents = object.__new__(Tangents)
        copy.__dict__.update(self.__dict__)
        copy._vectors, copy._kicks, copy._growth = (
            x.copy() for x in (self._vectors, self._kicks, self._growth)
        )
        return copy

    def vectors(self) -> Array:
        """Return the vectors, (count, 2, bodies, 3), rounded to float64."""
        groups, _, d, _ = self._vectors.shape
        lanes = self._vectors[:, [DQ, DV]].transpose(0, 3, 1, 2).reshape(groups * WIDTH, 2, 3, d // 3)
        return np.ascontiguousarray(np.moveaxis(lanes[: self._count], 2, 3))

    def growth(self, time: float) -> tuple[Array, Array]:
        """Return MEGNO, the mean of Y over the time |time| > 0 of the march, and ln(|x| / |x0|), of each vector,
        (count,) each.
        """
        mean, log = self._growth[:, AREA].ravel() / abs(time), self._growth[:, LOGARITHM].ravel()
        return mean[: self._count], log[: self._count].copy()

    def latest(self) -> Array:
        """Return Y of each vector at the last step, (count,)."""
        return np.asarray(self._growth[:, BEFORE].ravel()[: self._count].copy())


def require_tangents(integrator: Integrator, lagrangian: Lagrangian) -> None:
    """Raise InputError, with the reason, if the derivative of a method or of a Lagrangian of bodies is not known."""
    if integrator.follows_kepler:
        raise InputError(
            f"{integrator.label} moves bodies along Kepler orbits, and the derivative of that motion is not available "
            "yet. Use Gauss(stages=8), or Composition(StormerVerlet(), order=4) for many steps."
        )
    if not isinstance(getattr(type(integrator), "tableau", None), property):
        raise InputError(
            f"{integrator.label} has no tableau from which its derivative could be computed; use Gauss(stages=8)."
        )
    summands = getattr(lagrangian, "summands", ())
    without = [term.name for term in summands if not term.tag.provides("hessians")]
    if without or GRADIENTS not in lagrangian.traits:
        what = f"the term '{without[0]}'" if without else f"'{lagrangian.name}'"
        raise InputError(f"{what} has no second derivatives, so variations are not known; give its kernels `hessians`.")
    if SEPARABLE not in lagrangian.traits:
        bound = [term.name for term in summands if SEPARABLE not in term.traits]
        raise InputError(
            f"variations are computed for forces that depend on positions alone, so far, not with the term "
            f"'{bound[0] if bound else lagrangian.name}'. Leave it out: system.replaced(terms=...)."
        )


@lru_cache(maxsize=64)
def table_of(tableau: PartitionedTableau) -> Array:
    """Return the table (s, 4 + s) of a method: c, w, kick, rest and eta, see `orbits.kernels.tangent`.

    That of a symplectic pair is exactly symplectic in binary, with eta_ij - eta_ji = c_i - c_j and rest = 1 - c. For
    others, w = b where it is not 0, and otherwise 1; eta_ij = (a a_bar)_ij / w_j, kick = b / w, and
    rest_j = (sum_i b_i a_bar_ij) / w_j, rounded once.
    """
    s = tableau.stages
    out = np.zeros((s, ETA + s))
    if isinstance(tableau, SymplecticTableau):
        out[:, :ETA] = np.stack([tableau.nodes, tableau.b, np.ones(s), tableau.one_minus_nodes], axis=1)
        out[:, ETA:] = tableau.eta
        return out
    with mpmath.workdps(DIGITS):
        a, a_bar, b = tableau.exact_a, tableau.exact_a_bar, tableau.exact_b
        columns = [[(k, a_bar[k][j]) for k in range(s) if a_bar[k][j] != 0] for j in range(s)]
        for j in range(s):
            w = b[j] if b[j] != 0 else mpmath.mpf(1)
            rest = mpmath.fsum(b[k] * x for k, x in columns[j]) / w
            out[j, :ETA] = [float(x) for x in (tableau.exact_c[j], w, b[j] / w, rest)]
            for i in range(s):
                out[i, ETA + j] = float(mpmath.fsum(a[i][k] * x for k, x in columns[j] if a[i][k] != 0) / w)
    return out
