"""Tangent vectors of massive bodies that follow the steps of a march; see `orbits.kernels.tangents.through_stages`.

With forces without a Lagrangian, and of parameters, they are those of positions and momenta.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
from typing import Any, NamedTuple

import mpmath
import numpy as np
from numba.core.errors import NumbaError
from numpy.typing import NDArray

from orbits.errors import ConvergenceError, InputError
from orbits.forces.base import BoundForce
from orbits.integrators.base import Integrator
from orbits.integrators.forms import Array, padded
from orbits.kernels.gravity.terms_and_forces import acted_on
from orbits.kernels.lanes import WIDTH
from orbits.kernels.steps import Model
from orbits.kernels.tangents.by_duals import Acting, write_sources_now
from orbits.kernels.tangents.through_momenta import MomentaRoom, follow_momenta
from orbits.kernels.tangents.through_stages import ETA, Course, Fan, Room, follow
from orbits.lagrangians.base import GIVEN, GRADIENTS, SEPARABLE, Lagrangian
from orbits.marching.stepping.alignment import aligned
from orbits.marching.stepping.motion import Motion
from orbits.marching.tangents.in_lanes import InLanes
from orbits.tableaux import PartitionedTableau, SymplecticTableau
from orbits.tableaux.partitioned import DIGITS


class Slopes(NamedTuple):
    """The derivatives by P parameters of what acts.

    vectors : of the parameter vectors of the Lagrangian and of each force, (P, length) each
    whole : whether the Lagrangian depends on one of them, not forces alone
    """

    vectors: tuple[Array, ...]
    whole: bool


class Tangents(InLanes):
    """Tangent vectors of massive bodies, and their growth if it is measured.

    lagrangian, parameters : of the bodies that march, with the vectors of their kernels
    integrator : the method that takes their steps
    bodies : the numbers of the bodies that are varied, in ascending order; the others have no variations
    q, v : (n, 3) of all bodies, where the march begins at t = 0
    vectors : (count, 2, bodies, 3), dq and dv there
    scale : None, or the unit of time in which velocities count in the lengths of the vectors whose growth is measured
    forces : without a Lagrangian; slopes : None, or those by parameters, each of which has a vector after the others

    Raises InputError if the derivative of the method, of a term or of a force is not known.
    """

    def __init__(
        self,
        lagrangian: Lagrangian,
        parameters: Any,
        integrator: Integrator,
        bodies: NDArray[np.intp],
        q: Array,
        v: Array,
        vectors: Array,
        scale: float | None = None,
        *,
        forces: Sequence[BoundForce] = (),
        slopes: Slopes | None = None,
    ) -> None:
        by_force = bool(forces) or slopes is not None
        require_tangents(integrator, lagrangian, by_force=by_force)
        self._lagrangian, self._integrator, self._slopes = lagrangian, integrator, slopes
        self._forces = [force.name for force in forces]
        self._with_momenta = by_force or SEPARABLE not in lagrangian.traits
        acting = acted_on(lagrangian.tag, parameters, forces) if by_force else (lagrangian.tag, parameters)
        self._model = Model(*acting)
        self._table = (momenta_table_of if self._with_momenta else table_of)(integrator.tableau)
        strength = np.asarray(parameters[0] if isinstance(parameters, tuple) else parameters)
        self._some, self._inertia = np.array(bodies, dtype=np.int64), 1.0 / strength[1:]
        varied, more = len(vectors), 0 if slopes is None else len(slopes.vectors[0])
        self._count, n, s = varied + more, len(self._inertia), len(self._table)
        inner = np.concatenate([np.zeros(0), *(force.inner for force in forces)])
        d, groups = 3 * len(self._some), (self._count + WIDTH - 1) // WIDTH
        e = d + len(inner)
        self._vectors, self._kicks, self._growth = aligned(
            (groups, 4, e, WIDTH),
            (groups, s * (e + d if self._with_momenta else d), WIDTH),
            (0 if scale is None else groups, 5, WIDTH),
        )
        of_terms = 27 * n * n if self._with_momenta or isinstance(parameters, tuple) else 1
        stages, curvature, rows = (s, padded(3 * n)), (of_terms,), (e, WIDTH)
        if self._with_momenta:
            rows_given = 6 * n if GIVEN in lagrangian.traits else 0
            turned = (len(inner),), (s, len(inner)), (s, len(inner)), (WIDTH,), (rows_given, WIDTH)
            shapes = *[stages] * 4, stages[1:], curvature, (s, 4, e, e), rows, rows, *turned
            own = _acting(self._model.parameters, slopes, n, inner, s, d, varied) if by_force else None
            self._room: Any = MomentaRoom(*[*aligned(*shapes), own])
            self._room.y[:] = inner
        else:
            self._room = Room(*aligned(stages, stages, curvature, (s, d, d), rows, (s,), (s, WIDTH)))
        self._before = 0.0
        self._now = 0.0, np.array(q, dtype=np.float64).ravel(), np.array(v, dtype=np.float64).ravel()
        given = np.zeros((self._count, 2, len(self._some), 3))
        given[:varied] = vectors
        lanes = np.zeros((self._count, 2, e))
        lanes[:, :, :d] = np.moveaxis(self._by_momenta(given), 3, 2).reshape(self._count, 2, d)
        self._write(lanes)
        self._scale = self._begin_growth(scale)

    def follow(self, motion: Motion) -> None:
        """Follow the steps of a stretch of the march, which begins where the last one ended.

        Raises ConvergenceError if the stages of a step do not converge, InputError if the vectors become too large.
        """
        if not len(motion):
            return
        course = Course(*(np.ascontiguousarray(x) for x in (motion.times, motion.lengths, motion.path)))
        fan = Fan(self._vectors, self._kicks, self._growth)
        kernel = follow_momenta if self._with_momenta else follow
        others = self._some, self._inertia, self._scale, self._room
        with self._known_derivatives():
            done = kernel(self._model, self._table, course, self._before, fan, *others)
        self._before = float(course.lengths[-1])
        size = 3 * len(self._inertia)
        q, v = (x[:size].reshape(3, -1).T.ravel() for x in course.path[-1])
        self._now = float(course.times[-1]), q, v
        self._require_finite(float(course.times[-1]))
        if done < len(course.lengths):
            t, h = float(course.times[done]), float(course.lengths[done])
            raise ConvergenceError(
                f"the variational equations of {self._integrator.label} do not converge in the step of {h:.6g} from "
                f"t = {t:.10g}; use a smaller dt.",
                step=int(done),
                time=t,
            )

    @contextmanager
    def _known_derivatives(self) -> Iterator[None]:
        """Raise InputError if a kernel does not run on the numbers that give derivatives."""
        try:
            yield
        except NumbaError as error:
            named = " or ".join(self._forces) or self._lagrangian.name
            why = " ".join(line.strip() for line in str(error).splitlines() if ">>>" in line)
            raise InputError(
                f"the derivatives of {named} are not known: a kernel takes numbers and lanes, but no dual numbers, "
                f"with which it would give its derivatives ({why or type(error).__name__}). Write it with what "
                "orbits.kernels.lanes has for all of them."
            ) from error

    def branched(self) -> Tangents:
        """Return a copy that can follow another march from here, such as a part of a step."""
        copy: Tangents = object.__new__(Tangents)
        copy.__dict__.update(self.__dict__)
        copy._vectors, copy._kicks, copy._growth = (x.copy() for x in (self._vectors, self._kicks, self._growth))
        copy._room = type(self._room)(*(x.copy() if isinstance(x, np.ndarray) else x for x in self._room))
        return copy

    def vectors(self) -> Array:
        """Return the vectors, (count, 2, bodies, 3), rounded to float64; those of parameters come last."""
        lanes = self._read()[:, :, : 3 * len(self._some)].reshape(self._count, 2, 3, -1)
        return self._by_velocities(np.ascontiguousarray(np.moveaxis(lanes, 2, 3)))

    def to_momenta(self) -> Array:
        """Return the derivative of (q, p) by (q, v) here and now, (2 d, 2 d): x, y, z of each varied body in turn, p
        times G.
        """
        t, q, v = self._now
        return momenta_by_velocities(self._lagrangian, q, v, t, self._some, 1.0 / self._inertia)

    def _by_momenta(self, vectors: Array) -> Array:
        """Return vectors of dq and dv, (count, 2, bodies, 3), as those of dq and dw = dp / m, here and now."""
        if self._with_momenta:
            mixed, mass, gm = self._curvatures()
            dq, dv = (vectors[:, k].reshape(self._count, -1) for k in range(2))
            dw = (dq @ mixed + dv @ mass) / gm - self._sources()
            vectors[:, 1] = dw.reshape(vectors[:, 1].shape)
        return vectors

    def _by_velocities(self, vectors: Array) -> Array:
        """Undo `_by_momenta`."""
        if self._with_momenta:
            mixed, mass, gm = self._curvatures()
            dq, dw = (vectors[:, k].reshape(self._count, -1) for k in range(2))
            dw = dw + self._sources()
            vectors[:, 1] = np.linalg.solve(mass, (dw * gm - dq @ mixed).T).T.reshape(vectors[:, 1].shape)
        return vectors

    def _sources(self) -> Any:
        """Return the derivatives of -dL/dv, per GM, by the parameter of each vector, (count, d), here and now."""
        if self._slopes is None or not self._slopes.whole or SEPARABLE in self._lagrangian.traits:
            return 0.0  # momenta are m v
        t, q, v = self._now
        m, d = len(self._some), 3 * len(self._some)
        own = np.zeros(self._room.acting.sources.shape[1:])
        x, w = (np.ascontiguousarray(each.reshape(-1, 3).T).ravel() for each in (q, v))
        with self._known_derivatives():
            write_sources_now(self._model, self._room.acting, t, x, w, self._room.y, self._some, own)
        found = np.zeros((self._count, d))
        found[self._count - len(own) :] = own[:, -d:].reshape(-1, 3, m).swapaxes(1, 2).reshape(-1, d)
        return found

    def _curvatures(self) -> tuple[Array, Array, Array]:
        """Return d2L/dq dv and d2L/dv dv, (d, d), and GM, (d,), of the varied bodies, x, y, z of each in turn."""
        t, q, v = self._now
        return _curvatures(self._lagrangian, q, v, t, self._some, 1.0 / self._inertia)


def _acting(
    parameters: Any, slopes: Slopes | None, n: int, inner: Array, s: int, d: int, first: int
) -> Acting:
    """Return the workspace for forces and parameters of n bodies; first : the number of vectors before those of
    parameters.
    """
    vectors = tuple(x.astype(np.complex128) if isinstance(x, np.ndarray) else x for x in parameters)
    none = [np.zeros((0, len(x))) if isinstance(x, np.ndarray) else x for x in parameters]
    found = none if slopes is None else slopes.vectors
    ends = tuple(
        np.concatenate([x, np.zeros((1, x.shape[1]))]) if isinstance(x, np.ndarray) else x for x in found
    )
    count = len(ends[0]) - 1
    q, v, f, p = np.zeros((4, 3 * n), np.complex128)
    y, rates = np.zeros((2, len(inner)), np.complex128)
    whole = 0 if slopes is not None and slopes.whole else None
    sources = np.zeros((s, count, 2 * d + len(inner)))
    (more,) = aligned((s, 2 * d + len(inner), WIDTH))
    return Acting(vectors, ends, whole, q, v, f, p, y, rates, sources, more, first)


def _curvatures(
    lagrangian: Lagrangian, q: Array, v: Array, t: float, bodies: NDArray[Any], gm: Array
) -> tuple[Array, Array, Array]:
    own_gm = np.repeat(gm[bodies], 3)
    if SEPARABLE in lagrangian.traits:
        return np.zeros((len(own_gm), len(own_gm))), np.diag(own_gm), own_gm
    own = (3 * bodies[:, None] + np.arange(3)).ravel()
    _, mixed, mass = lagrangian.hessians(q.ravel(), v.ravel(), t)
    return mixed[np.ix_(own, own)], mass[np.ix_(own, own)], own_gm


def momenta_by_velocities(
    lagrangian: Lagrangian, q: Array, v: Array, t: float, bodies: NDArray[Any], gm: Array
) -> Array:
    """Return the derivative of (q, p) by (q, v) of some bodies, (2 d, 2 d): x, y, z of each in turn, p times G.

    q, v : (n, 3) of all; gm : (n,)
    """
    mixed, mass, _ = _curvatures(lagrangian, q, v, t, bodies, gm)
    d = len(mass)
    return np.block([[np.eye(d), np.zeros((d, d))], [mixed.T, mass]])


def require_tangents(integrator: Integrator, lagrangian: Lagrangian, *, by_force: bool = False) -> None:
    """Raise InputError, with the reason, if the derivative of a method or of a Lagrangian of bodies is not known;
    by_force : with forces without a Lagrangian, or by parameters.
    """
    if not isinstance(getattr(type(integrator), "tableau", None), property):
        raise InputError(
            f"{integrator.label} has no tableau from which its derivative could be computed; use Gauss(stages=8)."
        )
    if by_force and not isinstance(integrator.tableau, SymplecticTableau):
        raise InputError(
            f"derivatives with forces, or by parameters, are known of symplectic Runge-Kutta methods alone, not of "
            f"{integrator.label}; use Gauss(stages=8)."
        )
    require_hessians(lagrangian)


def require_hessians(lagrangian: Lagrangian) -> None:
    """Raise InputError, with the term, if second derivatives of a Lagrangian of bodies are not known."""
    summands = getattr(lagrangian, "summands", ())
    without = [term.name for term in summands if not term.tag.provides("hessians")]
    if without or GRADIENTS not in lagrangian.traits:
        what = f"the term '{without[0]}'" if without else f"'{lagrangian.name}'"
        raise InputError(f"{what} has no second derivatives, so variations are not known; give its kernels `hessians`.")


@lru_cache(maxsize=64)
def table_of(tableau: PartitionedTableau) -> Array:
    """Return the table (s, 4 + 2 s) of a method: c, w, kick, rest, eta and continuation, see
    `orbits.kernels.tangents.through_stages`.

    That of a symplectic pair is exactly symplectic in binary, with eta_ij - eta_ji = c_i - c_j and rest = 1 - c. For
    others, w = b where it is not 0, and otherwise 1; eta_ij = (a a_bar)_ij / w_j, kick = b / w, and
    rest_j = (sum_i b_i a_bar_ij) / w_j, rounded once.
    """
    s = tableau.stages
    out = np.zeros((s, ETA + 2 * s))
    if isinstance(tableau, SymplecticTableau):
        out[:, :ETA] = np.stack([tableau.nodes, tableau.b, np.ones(s), tableau.one_minus_nodes], axis=1)
        out[:, ETA : ETA + s] = tableau.eta
        out[:, ETA + s :] = tableau.b[:, None] * tableau.continuation / tableau.b
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
    return out  # without a continuation: the stages of implicit ones start at rest


@lru_cache(maxsize=64)
def momenta_table_of(tableau: SymplecticTableau) -> Array:
    """Return the table (s, 2 + 2 s) of a symplectic pair: c, b, mu and mu_bar, exactly symplectic in binary, see
    `orbits.kernels.tangents.through_momenta`.
    """
    return np.column_stack([tableau.nodes, tableau.b, tableau.mu, tableau.mu_bar])
