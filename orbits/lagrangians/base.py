"""The class `Lagrangian`: kernels for L and its derivatives, traits, and values as plain floats."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.checks import finite_number
from orbits.errors import InputError, SingularityError, shown
from orbits.lagrangians.symmetry import Symmetry

if TYPE_CHECKING:
    from orbits.kernels.binding import Tag

Array = NDArray[np.float64]
Symmetries = Sequence[Symmetry] | Callable[[Mapping[str, float]], Sequence[Symmetry]]
"""Symmetries, or a function that makes them from the values of the parameters by name: K may depend on masses."""

SEPARABLE = "separable"
"""L(q, v) = T(v) - V(q) with a constant mass matrix, independent of time: explicit methods are possible."""

MASSLESS_PARTICLES = "massless particles"
"""It has a field in which each massless particle moves by a Lagrangian of its own."""

GRADIENTS = "gradients"
"""It has kernels for dL/dq, dL/dv and the second derivatives: implicit methods in canonical form are possible."""

NEWTONIAN = "Newtonian"
"""It is that of point masses that attract each other, and of nothing else: their two-body motion is known exactly."""

ABOUT_ONE_BODY = "Newtonian but for terms of one body"
"""It is Newtonian, or adds terms of one body to that: sums over all others of functions of their positions and
velocities relative to it. Terms have its row as their first parameter, and a kernel `about`."""

CONSTRAINED = "constrained"
"""It has holonomic constraints, g(q) = 0: motions stay on them, and only methods that keep them can march it."""

TIME_DEPENDENT = "time-dependent"
"""L depends on t: energy is not conserved."""

RIGID_BODIES = "one of rigid bodies"
"""Attitudes are homogeneous quaternions, `Lagrangian.rotors`; all other coordinates are places, with constant masses,
and L is the kinetic energy less a potential U(places, attitudes)."""

GIVEN = "given bodies"
"""The first massive bodies are given functions of time, as in an ephemeris, whatever acts on them."""


@dataclass(frozen=True)
class Compiled:
    """A Lagrangian as compiled code sees it.

    tag : by which compiled code finds its kernels (see `orbits.kernels.binding`)
    traits : properties that methods may require: `SEPARABLE`, `MASSLESS_PARTICLES`, `GRADIENTS`
    """

    tag: Tag
    traits: frozenset[str]


@dataclass(frozen=True)
class Motion:
    """The initial state of a motion, and a suitable step: q, v of shape (d,), dt in the Lagrangian's unit of time."""

    q: tuple[float, ...]
    v: tuple[float, ...]
    dt: float
    t: float = 0.0


@dataclass(frozen=True)
class Rotor:
    """A rigid body among the coordinates of a Lagrangian.

    at : the first of the four coordinates that are its quaternion; those before all quaternions are places
    moments : the names of the parameters that are its principal moments of inertia
    """

    at: int
    moments: tuple[str, str, str]


class FixedValues(dict[str, float]):
    """Values of parameters by name, which cannot be changed: kernels have been made from them."""

    def _refuse(self, *_: Any, **__: Any) -> Any:
        raise InputError(
            "the parameters of a Lagrangian cannot be changed, as its kernels know them; expected another one with "
            "other values, L.with_parameters(g=9.81)."
        )

    __setitem__ = __delitem__ = __ior__ = update = pop = popitem = setdefault = clear = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return FixedValues, (dict(self),)


@dataclass(frozen=True, eq=False)
class Lagrangian:
    """L(q, v, t) of a mechanical system on R^d, with the values of its parameters.

    name : its name, also in the registry
    formula : L(q, v, t), for users
    coordinates : (d,) names
    parameters : the parameters' values by name, in the order of the kernels' parameter vector
    compile : makes the kernels, on first use; called once
    example : a typical nonlinear motion, the default of tables and tests; None for a Lagrangian without one
    groups : one-parameter groups that leave L unchanged up to a total derivative, or a function of the parameters that
        returns them; read them as `symmetries`
    source : its source in the literature
    order : (d,) the coordinate at each place of the kernels' vectors; None for the same order
    symbolic : returns the formula in SymPy; None for handwritten kernels
    rotors : the rigid bodies among the coordinates, in their order; see `orbits.lagrangians.rigid_bodies`
    constraints : the functions g(q) that are 0 along motions, for users; empty for most Lagrangians
    check_parameters : raises InputError for values of the parameters, by name, that the formula is not for
    signs : (d,) those of the coordinates that L is for, 1 or -1, and 0 for both; empty for both of all

    Vectors of coordinates have shape (d,). For bodies in space, (n, 3) is accepted for (3n,). Numbers are in
    units of your choice. Raises InputError for invalid names, parameters, examples or symmetries.
    """

    name: str
    formula: str
    coordinates: tuple[str, ...]
    parameters: Mapping[str, float]
    compile: Callable[[], Compiled] = field(repr=False)
    example: Motion | None
    groups: Symmetries = ()
    source: str = ""
    order: tuple[int, ...] | None = field(default=None, repr=False)
    symbolic: Callable[[], Any] | None = field(default=None, repr=False)
    rotors: tuple[Rotor, ...] = field(default=(), repr=False)
    constraints: tuple[str, ...] = ()
    check_parameters: Callable[[Mapping[str, float]], None] | None = field(default=None, repr=False)
    signs: tuple[int, ...] = field(default=(), repr=False)

    if TYPE_CHECKING:  # set by the package `orbits.lagrangians`
        from_sympy: ClassVar[Callable[..., Lagrangian]]
        from_kernels: ClassVar[Callable[..., Lagrangian]]

    def __post_init__(self) -> None:
        """Raise InputError for invalid names, parameters, examples or symmetries."""
        require_name(self.name)
        names = self.coordinates
        if not names or not all(isinstance(x, str) and x for x in names) or len(set(names)) < len(names):
            raise InputError(f"'{self.name}': coordinates must be different names, one for each, got {list(names)}")
        if not isinstance(self.parameters, Mapping):
            raise InputError(f"'{self.name}': parameters must be values by name, got {shown(self.parameters)}")
        values = {key: finite_number(value, f"parameter {key}") for key, value in self.parameters.items()}
        object.__setattr__(self, "parameters", FixedValues(values))
        if self.check_parameters is not None:
            self.check_parameters(values)
        if self.example is not None:
            self.vector(self.example.q, "the example's q")
            self.vector(self.example.v, "the example's v")
        groups = self.groups(self.parameters) if callable(self.groups) else self.groups
        strangers = [x for x in groups if not isinstance(x, Symmetry)] if isinstance(groups, Sequence) else [groups]
        if strangers:
            raise InputError(
                f"'{self.name}': symmetries must be `orbits.Symmetry` objects, in a list, or a function of the "
                f"parameters that returns one; got {shown(strangers[0])}"
            )

    def __copy__(self) -> Lagrangian:
        return self

    def __deepcopy__(self, memo: Any) -> Lagrangian:
        return self

    @cached_property
    def symmetries(self) -> tuple[Symmetry, ...]:
        """The one-parameter groups that leave L unchanged up to a total derivative, for these parameters."""
        return tuple(self.groups(self.parameters) if callable(self.groups) else self.groups)

    @cached_property
    def compiled(self) -> Compiled:
        """The kernels and traits; made on first use."""
        return self.compile()

    @property
    def tag(self) -> Tag:
        """The tag for compiled code."""
        return self.compiled.tag

    @property
    def traits(self) -> frozenset[str]:
        """Properties that methods may require."""
        made = self.compiled.traits
        return made | {RIGID_BODIES} if self.rotors else made

    @property
    def autonomous(self) -> bool:
        """Whether L does not depend on t."""
        return TIME_DEPENDENT not in self.traits

    @property
    def dimension(self) -> int:
        """Number of coordinates d."""
        return len(self.coordinates)

    @cached_property
    def parameter_vector(self) -> Array:
        """The parameter vector of the kernels; never empty."""
        return np.array([*self.parameters.values(), 0.0][: max(1, len(self.parameters))], dtype=np.float64)

    def with_parameters(self, **values: float) -> Lagrangian:
        """Return the same Lagrangian with other values of some parameters. Raises InputError for unknown names."""
        unknown = sorted(set(values) - set(self.parameters))
        if unknown:
            known = ", ".join(self.parameters) or "none"
            raise InputError(f"'{self.name}' has no parameter {', '.join(unknown)}; it has: {known}")
        made = self.compiled
        return replace(self, parameters={**self.parameters, **values}, compile=lambda: made)

    def value(self, q: ArrayLike, v: ArrayLike, t: float = 0.0) -> float:
        """Return L(q, v, t). Raises SingularityError if it is not finite."""
        from orbits.lagrangians.evaluation import value

        x, w, t = self._at(q, v, t)
        result = float(value(self.tag, self.parameter_vector, t, self._in(x), self._in(w)))
        self._finite(result, x, w, t)
        return result

    def gradients(self, q: ArrayLike, v: ArrayLike, t: float = 0.0) -> tuple[Array, Array]:
        """Return (dL/dq, dL/dv), each (d,). Raises SingularityError if they are not finite."""
        from orbits.lagrangians.evaluation import gradients

        x, w, t = self._at(q, v, t)
        f, p = gradients(self.tag, self.parameter_vector, t, self._in(x), self._in(w))
        self._finite(float(np.sum(f) + np.sum(p)), x, w, t)
        return self._out(f), self._out(p)

    def hessians(self, q: ArrayLike, v: ArrayLike, t: float = 0.0) -> tuple[Array, Array, Array]:
        """Return (d2L/dq dq, d2L/dq dv, d2L/dv dv), each (d, d); rows of the mixed one belong to q.

        Raises SingularityError if they are not finite.
        """
        from orbits.lagrangians.evaluation import hessians

        x, w, t = self._at(q, v, t)
        d = self.dimension
        out = hessians(self.tag, self.parameter_vector, t, self._in(x), self._in(w))
        self._finite(float(np.sum(out)), x, w, t)
        blocks = out.reshape(3, d, d)
        if self.order is not None:
            place = np.argsort(self.order)
            blocks = blocks[:, place][:, :, place]
        return blocks[0], blocks[1], blocks[2]

    def momentum(self, q: ArrayLike, v: ArrayLike, t: float = 0.0) -> Array:
        """Return p = dL/dv, the Legendre transform of v at q, (d,)."""
        return self.gradients(q, v, t)[1]

    def velocity(self, q: ArrayLike, p: ArrayLike, t: float = 0.0) -> Array:
        """Return v with dL/dv(q, v, t) = p, the inverse Legendre transform, (d,), by Newton's method.

        Raises InputError if L is not regular at q: the matrix d2L/dv dv has no inverse.
        """
        x, target = self.vector(q, "q"), self.vector(p, "p")
        size = float(np.max(np.abs(target)))
        failure: InputError | None = None
        # Start from rest or, if L is not regular at rest, along the momentum.
        for start in (np.zeros(self.dimension), target / size if size > 0.0 else target):
            try:
                return self._velocity(x, target, t, start)
            except InputError as error:
                failure = failure or error
        raise failure if failure is not None else InputError(f"'{self.name}': no velocity found")

    def _velocity(self, x: Array, target: Array, t: float, start: Array) -> Array:
        """Newton's method, with steps halved while they leave the domain of L or increase the residual."""
        v = start.copy()
        residual = target - self.momentum(x, v, t)
        previous = np.inf
        for _ in range(60):
            mass = self.hessians(x, v, t)[2]
            change = self.solve_mass(mass, residual, x)
            size = float(np.max(np.abs(change)))
            near = size <= 1e-8 * float(np.max(np.abs(v)))
            for _ in range(40):
                try:
                    new = target - self.momentum(x, v + change, t)
                except SingularityError:
                    new = np.full_like(target, np.inf)
                if near or np.max(np.abs(new)) <= np.max(np.abs(residual)):
                    break
                change = change / 2.0
            v, residual = v + change, new
            if size == 0.0 or (size >= previous and size <= 1e-8 * float(np.max(np.abs(v)))):
                return v
            previous = size
        raise InputError(
            f"'{self.name}': no velocity belongs to the momentum p = {show(target)} at q = {show(x)}: Newton's "
            "method does not settle; the Legendre transform is not invertible there."
        )

    def energy(self, q: ArrayLike, v: ArrayLike, t: float = 0.0) -> float:
        """Return p . v - L, the energy (Jacobi's integral in a rotating frame)."""
        w = self.vector(v, "v")
        return float(self.momentum(q, w, t) @ w) - self.value(q, w, t)

    def require_regular(self, q: ArrayLike, v: ArrayLike, t: float = 0.0) -> None:
        """Raise InputError unless d2L/dv dv is invertible at (q, v, t)."""
        self.solve_mass(self.hessians(q, v, t)[2], np.zeros(self.dimension), self.vector(q, "q"))

    def solve_mass(self, mass: Array, right: Array, q: Array) -> Array:
        """Return mass^-1 right; InputError, with the reason, if the mass matrix d2L/dv dv has no inverse."""
        # Masses of bodies differ widely: all rows and columns are scaled first.
        size = np.sqrt(np.max(np.abs(mass), axis=1))
        even = mass / np.where(size > 0.0, size, 1.0)[:, None] / np.where(size > 0.0, size, 1.0)[None, :]
        singular = np.linalg.svd(even, compute_uv=False)
        if not singular[-1] > 1e-14 * singular[0]:
            raise InputError(
                f"'{self.name}' is not regular at q = {show(q)}: the matrix d2L/dv dv = {show(mass)} has no inverse, "
                "so momenta do not determine velocities. Expected a Lagrangian whose kinetic energy depends on every "
                "velocity; remove the coordinates that have none, or choose others."
            )
        return np.asarray(np.linalg.solve(mass, right), dtype=np.float64)

    def vector(self, x: ArrayLike, what: str) -> Array:
        """Return x as a vector of d finite floats. Raises InputError for anything else."""
        try:
            given = np.array(None) if hasattr(x, "unit") else np.asarray(x)
        except (TypeError, ValueError):
            given = np.array(None)
        if given.dtype == object or given.dtype.kind not in "fiub":
            raise InputError(f"'{self.name}': {what} must be {self.dimension} real numbers; got {shown(x)}")
        if given.size != self.dimension or (given.ndim > 1 and given.shape != (self.dimension // 3, 3)):
            names = ", ".join(self.coordinates[:6]) + (", ..." if self.dimension > 6 else "")
            count = f"{self.dimension} coordinate{'s' * (self.dimension > 1)}"
            raise InputError(f"'{self.name}' has {count} ({names}); got {what} of shape {given.shape}")
        values = np.array(given, dtype=np.float64).reshape(-1)
        if not np.all(np.isfinite(values)):
            raise InputError(f"'{self.name}': {what} must be finite; got {show(values)}")
        return values

    def kernel_order(self, x: Array) -> Array:
        """Return coordinates (..., d) in the order of the kernels' vectors."""
        return np.ascontiguousarray(x) if self.order is None else np.ascontiguousarray(x[..., list(self.order)])

    def caller_order(self, x: Array) -> Array:
        """Undo `kernel_order`."""
        return x if self.order is None else np.ascontiguousarray(x[..., np.argsort(self.order)])

    _in = kernel_order
    _out = caller_order

    def require_signs(self, q: Array) -> None:
        """Raise InputError for states (..., d) of coordinates whose signs are not those of which L was made."""
        wrong = np.argwhere(np.atleast_2d(q) * (self.signs or 0) < 0.0)
        if len(wrong):
            row, k = wrong[0]
            sign = ">= 0" if self.signs[k] > 0 else "<= 0"
            raise InputError(
                f"'{self.name}': {self.coordinates[k]} was declared to SymPy {sign}, and "
                f"L is simplified accordingly; it is {np.atleast_2d(q)[row, k]:.6g}. Declare the symbol with real=True."
            )

    def _at(self, q: ArrayLike, v: ArrayLike, t: float) -> tuple[Array, Array, float]:
        """Return a state at which L is to be evaluated, checked."""
        if GRADIENTS not in self.traits:
            raise InputError(
                f"'{self.name}' has accelerations only: L and its derivatives are not known. Give value, gradients and "
                "hessians to Lagrangian.from_kernels as well."
            )
        x = self.vector(q, "q")
        self.require_signs(x)
        return x, self.vector(v, "v"), finite_number(t, "t")

    def _finite(self, probe: float, q: Array, v: Array, t: float) -> None:
        if not np.isfinite(probe):
            raise SingularityError(
                f"'{self.name}' is singular at q = {show(q)}, v = {show(v)}, t = {t:.6g}: its value or derivatives "
                "are not finite there. Start elsewhere, or use a smaller dt.",
                time=float(t),
            )


def require_name(name: Any) -> None:
    """Raise InputError unless `name` is a valid name of a Lagrangian."""
    if not isinstance(name, str) or not name.strip():
        raise InputError(f"a Lagrangian's name must be a word, got {shown(name)}")


def show(x: Array) -> str:
    """Return a vector or matrix as text for a message, at most a line."""
    text = np.array2string(np.asarray(x), precision=6, threshold=12, separator=", ").replace("\n", "")
    return " ".join(text.split())
