"""Rigid bodies as Lagrangians on R^d: their attitudes are homogeneous quaternions q = (a, b, c, d), of any length.

With N = |q|^2 and w = (q_conjugate q')/N, whose parts 1 ... 3 are half the angular velocity in the axes of the body,

    L = 2 (I_0 w_0^2 + I_1 w_1^2 + I_2 w_2^2 + I_3 w_3^2) - U(R),     R the rotation of q

is regular for any I_0 > 0: |q| is one more coordinate, cyclic, and at rest if it is so at the start (round-off lets it
stray, by 4e-12 in 20,000 steps of a heavy top: rotations do not depend on it). All groups act
linearly: rotations of space from the left, rotations about an axis of the body from the right, q -> e^s q. Variational
Runge–Kutta methods conserve their momenta to round-off. Start with `orbits.rotations.start`, and read attitudes and
rates with `orbits.rotations.matrices` and `body_rates`.

Source: Hairer, Lubich & Wanner (2006), sec. VII.5; Betsch & Siebert (2009), Int. J. Numer. Meth. Engng 79, 444, for
quaternions.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.checks import finite_number, real_numbers
from orbits.errors import InputError, shown
from orbits.lagrangians.base import Lagrangian, Motion, Rotor
from orbits.lagrangians.symbolic import from_sympy
from orbits.lagrangians.symmetry import Symmetry
from orbits.rotations import checked_moments

Array = NDArray[np.float64]

PLACES = 60
"""Tried to find three attitudes at which a potential is defined."""

INVARIANT = 1e-12
"""A group leaves a potential as it is if that changes by no more than this fraction of its size."""


def spinning(q: Sequence[Any], v: Sequence[Any], moments: Sequence[Any], spare: Any) -> Any:
    """Return the kinetic energy of rotation, of numbers or of SymPy expressions."""
    a, b, c, d = q
    va, vb, vc, vd = v
    w0 = a * va + b * vb + c * vc + d * vd
    w1 = a * vb - b * va - c * vd + d * vc
    w2 = a * vc + b * vd - c * va - d * vb
    w3 = a * vd - b * vc + c * vb - d * va
    first, second, third = moments
    size2 = (a * a + b * b + c * c + d * d) ** 2
    return 2 * (spare * w0 * w0 + first * w1 * w1 + second * w2 * w2 + third * w3 * w3) / size2


def turning(q: Sequence[Any]) -> list[list[Any]]:
    """Return the rows of the rotation of q, of numbers or of SymPy expressions."""
    a, b, c, d = q
    size = a * a + b * b + c * c + d * d
    return [
        [(a * a + b * b - c * c - d * d) / size, 2 * (b * c - a * d) / size, 2 * (b * d + a * c) / size],
        [2 * (b * c + a * d) / size, (a * a - b * b + c * c - d * d) / size, 2 * (c * d - a * b) / size],
        [2 * (b * d - a * c) / size, 2 * (c * d + a * b) / size, (a * a - b * b - c * c + d * d) / size],
    ]


def in_space(axis: int, places: int = 0, bodies: int = 1) -> Symmetry:
    """Return the rotation of all about an axis of space, 0, 1, 2.

    The configuration is `places` vectors, then `bodies` quaternions.
    """
    spin = np.zeros((3, 3))
    j, k = (axis + 1) % 3, (axis + 2) % 3
    spin[k, j], spin[j, k] = 1.0, -1.0
    blocks = [spin] * places + [0.5 * _left(axis)] * bodies
    return _linear(f"rotation about {'xyz'[axis]}", blocks)


def of_body(axis: int, body: int = 0, places: int = 0, bodies: int = 1) -> Symmetry:
    """Return the rotation of a body about one of its own axes, 0, 1, 2."""
    blocks = [np.zeros((3, 3))] * places + [np.zeros((4, 4))] * bodies
    blocks[places + body] = 0.5 * _right(axis)
    whose = "" if bodies == 1 else f" of body {body + 1}"
    return _linear(f"rotation about axis {axis + 1}{whose}", blocks)


def stretching(body: int = 0, places: int = 0, bodies: int = 1) -> Symmetry:
    """Return the group q -> e^s q of the quaternion of a body."""
    blocks = [np.zeros((3, 3))] * places + [np.zeros((4, 4))] * bodies
    blocks[places + body] = np.eye(4)
    return _linear("length of q" if bodies == 1 else f"length of q of body {body + 1}", blocks)


def _left(axis: int) -> Array:
    """Return the matrix of the product with a unit from the left."""
    i, j, k = 1 + axis, 1 + (axis + 1) % 3, 1 + (axis + 2) % 3
    out = np.zeros((4, 4))
    out[0, i], out[i, 0], out[j, k], out[k, j] = -1.0, 1.0, -1.0, 1.0
    return out


def _right(axis: int) -> Array:
    """Return the matrix of the product with a unit from the right."""
    i, j, k = 1 + axis, 1 + (axis + 1) % 3, 1 + (axis + 2) % 3
    out = np.zeros((4, 4))
    out[0, i], out[i, 0], out[j, k], out[k, j] = -1.0, 1.0, 1.0, -1.0
    return out


def _linear(name: str, blocks: Sequence[Array]) -> Symmetry:
    """Return the group of the exponentials of a matrix whose blocks have squares that are multiples of 1, or are 0, or
    rotate a plane.
    """
    ends = np.cumsum([len(block) for block in blocks])
    generators = np.zeros((ends[-1], ends[-1]))
    for end, block in zip(ends, blocks, strict=True):
        generators[end - len(block) : end, end - len(block) : end] = block

    def flow(s: float, q: Array) -> Array:
        moved = np.array(q, dtype=np.float64)
        for end, block in zip(ends, blocks, strict=True):
            part = slice(end - len(block), end)
            moved[part] = _exponential(block, s) @ moved[part]
        return moved

    def generator(q: Array) -> Array:
        return np.asarray(generators @ q)

    return Symmetry(name, flow, generator)


def _exponential(block: Array, s: float) -> Array:
    one, square = np.eye(len(block)), block @ block
    rate2 = -float(np.trace(square)) / 2 if len(block) == 3 else -float(square[0, 0])
    if rate2 > 0.0:
        rate = np.sqrt(rate2)
        return np.asarray(one + np.sin(rate * s) / rate * block + 2 * np.sin(rate * s / 2) ** 2 / rate2 * square)
    return np.exp(s * np.diag(block)) * one


def rigid_body(
    inertia: Sequence[float],
    potential: Callable[[Any], Any] | None = None,
    *,
    parameters: dict[Any, float] | None = None,
    name: str = "rigid-body",
) -> Lagrangian:
    """Return the Lagrangian of a rigid body about a fixed point, in a homogeneous quaternion.

        top = orbits.lagrangians.rigid_body((1.0, 1.0, 0.4), potential=lambda R: 2.0 * R[2, 2])
        q, v = orbits.rotations.start(rates=(0.1, 0.0, 5.0), attitude=(1.0, 0.2, 0.0, 0.0))
        path = orbits.march(top, orbits.Gauss(stages=4), q=q, v=v, dt=0.02, steps=1000)

    inertia : the principal moments, (3,); they are the parameters I1, I2, I3
    potential : U(R), a function of the matrix R in SymPy, from the axes of the body to those of space; by default 0
    parameters : values of other symbols in it

    Its symmetries are the rotations of space that leave U as it is, those about an axis of the body if the moments of
    the other two are equal and U allows it, and q -> e^s q.

    Raises InputError for moments that no body has, and as `Lagrangian.from_sympy` does.
    """
    import sympy

    moments = checked_moments(inertia)
    q, v = sympy.symbols("a b c d"), sympy.symbols("va vb vc vd")
    symbols = sympy.symbols("I1 I2 I3")
    U = 0 if potential is None else _potential(potential, q)
    if potential is not None:
        # In other symbols for the attitude, what is left of its names is the user's own.
        own = _potential(potential, sympy.symbols("q:4", cls=sympy.Dummy)).free_symbols & {*q, *v}
        if own:
            raise InputError(
                f"'{name}': potential mentions {', '.join(sorted(map(str, own)))}, by which the attitude or its "
                f"velocity is called; expected other names than {', '.join(map(str, (*q, *v)))}."
            )
    values = {**dict(zip(symbols, moments, strict=True)), **(parameters or {})}
    numbers = {key: finite_number(value, f"parameter {key}") for key, value in values.items()}
    # I_0 moves nothing: of the size of the others, so that no step finds it stiff.
    spare = sum(symbols) / 3
    groups = [in_space(k) for k in range(3)] + [of_body(k) for k in range(3)]
    kept = [_leaves(U, q, group, numbers) for group in groups]

    def symmetries(known: Mapping[str, float]) -> list[Symmetry]:
        now = [known[str(x)] for x in symbols]
        alike = [now[(k + 1) % 3] == now[(k + 2) % 3] for k in range(3)]
        found = [group for group, keeps, fits in zip(groups, kept, [True] * 3 + alike, strict=True) if keeps and fits]
        return [*found, stretching()]

    made = from_sympy(
        spinning(q, v, symbols, spare) - U,
        q=q,
        v=v,
        parameters=values,
        name=name,
        symmetries=symmetries,
        example=Motion(q=(1.0, 0.2, -0.1, 0.3), v=(0.0, 0.2, 0.1, 0.4), dt=0.1),
        source="Hairer, Lubich & Wanner (2006), sec. VII.5",
    )
    return replace(made, rotors=(Rotor(0, ("I1", "I2", "I3")),))


def _potential(potential: Callable[[Any], Any], q: Sequence[Any]) -> Any:
    """Return what a function of a user makes of an attitude. Raises InputError for anything but a SymPy expression."""
    import sympy

    expected = "expected a function of the matrix R, such as lambda R: 2.0 * R[2, 2], with functions of SymPy"
    if not callable(potential):
        raise InputError(f"potential is {shown(potential)}; {expected}.")
    try:
        found = potential(sympy.Matrix(turning(q)))
        U = sympy.sympify(found, strict=True)
    except Exception as error:  # a function of a user may raise anything
        raise InputError(f"potential cannot be made into a formula ({error}); {expected}.") from error
    if not isinstance(U, sympy.Expr) or U.is_Matrix:
        raise InputError(f"potential returns {shown(found)}; {expected}.")
    return U


def _leaves(U: Any, q: Sequence[Any], group: Symmetry, numbers: dict[Any, float]) -> bool:
    """Return whether a group leaves a potential as it is, at three places."""
    import sympy

    if U == 0:
        return True
    value = sympy.lambdify(q, U.subs(numbers), "math")
    pairs: list[tuple[float, float]] = []
    for x in np.random.default_rng(3).normal(size=(PLACES, 4)):
        with contextlib.suppress(ValueError, ZeroDivisionError, OverflowError):  # U is not defined there
            pairs.append((value(*x), value(*group.moved(0.7, x))))
        if len(pairs) == 3:
            break
    same = all(abs(one - other) <= INVARIANT * max(abs(one), abs(other), 1e-300) for one, other in pairs)
    return same and len(pairs) == 3


def full_two_body(
    masses: Sequence[float],
    first: Sequence[float] | None,
    second: Sequence[float],
    *,
    G: float = 1.0,
    name: str = "full-two-body",
) -> Lagrangian:
    """Return the Lagrangian of two bodies, to the second degree of their gravity, about their centre of mass.

        pair = orbits.lagrangians.full_two_body((1.0, 0.01), None, (0.8, 0.9, 1.0))

    masses : of both; first, second : their principal moments of inertia, (3,); None for a sphere, which does not turn
    The coordinates are the place of the second relative to the first, then a quaternion for each body that is no
    sphere: 7 or 11. U = -G m m'/r - sum_i (G o_i / 2 r^3) (tr J_i - 3 n J_i n), o_i the mass of the other, n = r/|r|.

    Raises InputError for masses <= 0, and moments that no body has.

    Source: Maciejewski (1995), Celest. Mech. 63, 1, to the second degree.
    """
    import sympy

    m = real_numbers(masses, "masses")
    if m.shape != (2,) or not (np.isfinite(m).all() and min(m) > 0.0):
        raise InputError(f"masses is {shown(masses)}; expected two masses > 0.")
    finite_number(G, "G")
    bodies = [(k, checked_moments(each)) for k, each in enumerate((first, second)) if each is not None]
    if not bodies:
        raise InputError("first and second are spheres; expected moments of inertia of one at least.")
    r, w = sympy.symbols("x y z"), sympy.symbols("vx vy vz")
    coordinates, velocities = list(r), list(w)
    G_, m1, m2 = sympy.symbols("G m1 m2", positive=True)
    values: dict[Any, float] = {G_: float(G), m1: float(m[0]), m2: float(m[1])}
    distance = sympy.sqrt(sum(x * x for x in r))
    L = m1 * m2 / (m1 + m2) * sum(x * x for x in w) / 2 + G_ * m1 * m2 / distance
    for k, moments in bodies:
        q = sympy.symbols([f"{x}{k + 1}" for x in "abcd"])
        v = sympy.symbols([f"v{x}{k + 1}" for x in "abcd"])
        inertia = sympy.symbols([f"{x}{k + 1}" for x in "ABC"], positive=True)
        values |= dict(zip(inertia, moments, strict=True))
        R = turning(q)
        along = [sum(R[a][c] * r[a] for a in range(3)) / distance for c in range(3)]
        figure = sum(inertia) - 3 * sum(x * s * s for x, s in zip(inertia, along, strict=True))
        L += spinning(q, v, inertia, sum(inertia) / 3) + G_ * (m2 if k == 0 else m1) / (2 * distance**3) * figure
        coordinates += q
        velocities += v
    count = len(bodies)
    start_q, start_v = [2.0, 0.3, -0.2], [0.0, float(np.sqrt(G * sum(m) / 2.0)), 0.1]
    groups = [in_space(k, 1, count) for k in range(3)] + [stretching(k, 1, count) for k in range(count)]
    made = from_sympy(
        L,
        q=coordinates,
        v=velocities,
        parameters=values,
        name=name,
        symmetries=groups,
        example=Motion(
            q=(*start_q, *(1.0, 0.2, -0.1, 0.3) * count), v=(*start_v, *(0.0, 0.1, 0.05, 0.2) * count), dt=0.1
        ),
        source="Maciejewski (1995), to the second degree",
    )
    names = [(f"A{k + 1}", f"B{k + 1}", f"C{k + 1}") for k, _ in bodies]
    return replace(made, rotors=tuple(Rotor(3 + 4 * i, moments) for i, moments in enumerate(names)))
