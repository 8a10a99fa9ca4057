"""Tangent vectors of massive bodies that follow the steps of a march; see `orbits.kernels.tangents.through_stages`.

With forces without a Lagrangian, and of parameters, they are those of positions and momenta.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
from typing import Any

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
from orbits.kernels.lanes.dual import NUMBERS
from orbits.kernels.steps import Model
from orbits.kernels.tangents.by_duals import OnDuals, blocks_of
from orbits.kernels.tangents.through_momenta import MomentaRoom, follow_momenta
from orbits.kernels.tangents.through_stages import ETA, Course, Fan, Room, follow
from orbits.lagrangians.base import GIVEN, SEPARABLE, Lagrangian
from orbits.many_digits import many_digits
from orbits.marching.stepping.alignment import aligned
from orbits.marching.stepping.motion import Motion
from orbits.marching.tangents.in_lanes import InLanes
from orbits.tableaux import PartitionedTableau, SymplecticTableau
from orbits.tableaux.partitioned import DIGITS

Slopes = tuple[Any, ...]
"""The derivatives of the parameter vectors of the Lagrangian and of each force by P parameters, (P, length) each."""


class Tangents(InLanes):
    """Tangent vectors of massive bodies, and their growth if it is measured.

    lagrangian, parameters : of the bodies that march, with the vectors of their kernels
    integrator : the method that takes their steps
    bodies : the numbers of the bodies that are varied, in ascending order; the others have no variations
    q, v : (n, 3) of all bodies, where the march begins at t = 0
    vectors : (count, 2, bodies, 3), dq and dv there
    scale : None, or the unit of time in which velocities count in the lengths of the vectors whose growth is measured
    forces : without a Lagrangian; slopes : None, or those by parameters, each of which has a vector after the others

    Raises InputError if the derivative of the method is not known.
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
        require_tangents(integrator, by_force=by_force)
        self._lagrangian, self._integrator, self._slopes = lagrangian, integrator, slopes
        self._forces = [force.name for force in forces]
        self._with_momenta = by_force or SEPARABLE not in lagrangian.traits
        acting = acted_on(lagrangian.tag, parameters, forces) if by_force else (lagrangian.tag, parameters)
        self._model = Model(*acting)
        self._table = (momenta_table_of if self._with_momenta else table_of)(integrator.tableau)
        strength = np.asarray(parameters[0] if isinstance(parameters, tuple) else parameters)
        self._some, self._inertia = np.array(bodies, dtype=np.int64), 1.0 / strength[1:]
        varied, more = len(vectors), 0 if slopes is None else len(slopes[0])
        self._count, n, s = varied + more, len(self._inertia), len(self._table)
        inner = np.concatenate([np.zeros(0), *(force.inner for force in forces)])
        d, m, groups = 3 * len(self._some), len(inner), (self._count + WIDTH - 1) // WIDTH
        e, rows = d + m, d + m + more
        self._vectors, self._kicks, self._growth = aligned(
            (groups, 4, rows, WIDTH),
            (groups, s * (e + d if self._with_momenta else d), WIDTH),
            (0 if scale is None else groups, 5, WIDTH),
        )
        stages, duals = (s, padded(3 * n)), on_duals(self._model.parameters, n, m, slopes)
        if self._with_momenta:
            columns, given = (rows + d + WIDTH - 1) // WIDTH * WIDTH, 6 * n if GIVEN in lagrangian.traits else 0
            turned = (m,), (s, m), (s, m), (WIDTH,), (given, WIDTH)
            shapes = *[stages] * 4, stages[1:], (s, 2, e, columns), (rows + d, WIDTH), (e, WIDTH), *turned
            self._room: Any = MomentaRoom._make([*aligned(*shapes), duals])
            self._room.y[:] = inner
        else:
            shapes = stages, stages, (s, d, d), (d, WIDTH), (s,), (s, WIDTH)
            self._room = Room._make([*aligned(*shapes), duals])
        self._before = 0.0
        self._now = 0.0, np.array(q, dtype=np.float64).ravel(), np.array(v, dtype=np.float64).ravel()
        given_vectors = np.zeros((self._count, 2, len(self._some), 3))
        given_vectors[:varied] = vectors
        lanes = np.zeros((self._count, 2, rows))
        lanes[varied:, 0, e:] = np.eye(more)
        lanes[:, :, :d] = np.moveaxis(given_vectors, 3, 2).reshape(self._count, 2, d)
        if self._with_momenta:
            others, by_velocity = self._momenta()
            lanes[:, 1, :d] = lanes[:, 0] @ others.T + lanes[:, 1, :d] @ by_velocity.T
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
        with known_derivatives(self._lagrangian, self._forces):
            done = kernel(*self._model, self._table, course, self._before, fan, *others)
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

    def branched(self) -> Tangents:
        """Return a copy that can follow another march from here, such as a part of a step."""
        copy: Tangents = object.__new__(Tangents)
        copy.__dict__.update(self.__dict__)
        copy._vectors, copy._kicks, copy._growth = (x.copy() for x in (self._vectors, self._kicks, self._growth))
        copy._room = type(self._room)(*(x.copy() if isinstance(x, np.ndarray) else x for x in self._room))
        return copy

    def vectors(self) -> Array:
        """Return the vectors, (count, 2, bodies, 3), rounded to float64; those of parameters come last."""
        d, lanes = 3 * len(self._some), self._read()
        found = lanes[:, :, :d].copy()
        if self._with_momenta:
            others, by_velocity = self._momenta()
            found[:, 1] = np.linalg.solve(by_velocity, (found[:, 1] - lanes[:, 0] @ others.T).T).T
        return np.ascontiguousarray(np.moveaxis(found.reshape(self._count, 2, 3, -1), 2, 3))

    def to_momenta(self) -> Array:
        """Return the derivative of (q, p) by (q, v) here and now, (2 d, 2 d): x, y, z of each varied body in turn, p
        times G.
        """
        found = self._momenta() if self._with_momenta else ()
        return momenta_by_velocities(1.0 / self._inertia[self._some], *found)

    def _momenta(self) -> tuple[Array, Array]:
        """Return the derivatives of dL/dv over GM here and now, see `momenta_of`."""
        t, q, v = self._now
        with known_derivatives(self._lagrangian, self._forces):
            return momenta_of(self._model, self._room.duals, t, q, v, self._room.y, self._some)


def momenta_of(
    model: Model, duals: OnDuals, t: float, q: Array, v: Array, y: Array, some: NDArray[np.int64]
) -> tuple[Array, Array]:
    """Return the derivatives of dL/dv over GM of some bodies, (d, rows) by what stands in the rows of dq of a vector,
    and (d, d) by velocities; q, v : (3n,), x, y, z of each body in turn
    """
    d, m = 3 * len(some), len(y)
    rows = d + m + len(duals.count)
    x, w = (np.ascontiguousarray(each.reshape(-1, 3).T).ravel() for each in (q, v))
    out = np.zeros((2, d + m, rows + d + WIDTH))
    blocks_of(*model, duals, t, x, w, y, some, out)
    return out[1, :d, :rows], out[1, :d, rows : rows + d] + np.eye(d)


def momenta_by_velocities(gm: Array, others: Array | None = None, by_velocity: Array | None = None) -> Array:
    """Return the derivative of (q, p) by (q, v) of some bodies, (2 d, 2 d): x, y, z of each in turn, p times G.

    gm : of each; others, by_velocity : of `momenta_of`; None for momenta m v
    """
    m, d = len(gm), 3 * len(gm)
    order = np.arange(d).reshape(3, m).T.ravel()  # all x, then all y, then all z, to those of each body
    mixed, mass = np.zeros((d, d)), np.eye(d)
    if others is not None and by_velocity is not None:
        mixed, mass = others[np.ix_(order, order)], by_velocity[np.ix_(order, order)]
    weight = np.repeat(gm, 3)[:, None]
    return np.block([[np.eye(d), np.zeros((d, d))], [weight * mixed, weight * mass]])


@contextmanager
def known_derivatives(lagrangian: Lagrangian, forces: Sequence[str] = ()) -> Iterator[None]:
    """Raise InputError if a kernel does not run on the numbers that give derivatives; forces : their names."""
    try:
        yield
    except NumbaError as error:
        named = " or ".join(forces) or lagrangian.name
        why = " ".join(line.strip() for line in str(error).splitlines() if ">>>" in line)
        raise InputError(
            f"the derivatives of {named} are not known: a kernel takes numbers and lanes, but no dual numbers, with "
            f"which it would give its derivatives ({why or type(error).__name__}). Write it with what "
            "orbits.kernels.lanes has for all of them."
        ) from error


def on_duals(parameters: Any, n: int, m: int = 0, slopes: Slopes | None = None) -> OnDuals:
    """Return the workspace for n bodies and m internal variables."""
    vectors, count = parameters, 0
    if slopes is not None:
        vectors, count = tuple(_with_slopes(x) for x in parameters), len(slopes[0])
    shapes = (count,), *[(3 * n, NUMBERS)] * 4, *[(m, NUMBERS)] * 2
    return OnDuals(vectors, slopes, *(np.zeros(shape) for shape in shapes))


def _with_slopes(vector: Any) -> Any:
    """Return a parameter vector as dual numbers; what is none, as it is."""
    return np.pad(vector[:, None], ((0, 0), (0, NUMBERS - 1))) if isinstance(vector, np.ndarray) else vector


def require_tangents(integrator: Integrator, *, by_force: bool = False) -> None:
    """Raise InputError, with the reason, if the derivative of a method is not known; by_force : with forces without a
    Lagrangian, or by parameters.
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
    with many_digits(DIGITS):
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
