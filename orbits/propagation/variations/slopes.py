"""How the vectors of numbers that kernels work with depend on parameters such as "Apophis.A2"."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from orbits.errors import InputError
from orbits.integrators.forms import Array
from orbits.kernels.gravity.terms_and_forces import acted_on
from orbits.marching.tangents.of_bodies import Slopes
from orbits.system import System
from orbits.system.model import model
from orbits.system.parameters import Parameter, parameters_of, with_values

FIRST, LEVELS = 0.25, 6
"""Richardson's extrapolation of differences over this part of the value, and over half of it, so many times: its error
is (FIRST^2)^LEVELS 2^(-LEVELS (LEVELS - 1)), 2e-16, for functions such as powers."""

LINEAR = 1e-12
"""The relative departure from a straight line at which a vector is one."""


def slopes_of(system: System, parameters: Sequence[Parameter]) -> Slopes:
    """Return the derivatives of the parameter vectors of a system, the Lagrangian's and those of forces.

    Raises InputError for a parameter whose value is 0 if it does not enter linearly.
    """
    found = [_derivatives(system, one) for one in parameters_of(system, [p.name for p in parameters])]
    return tuple(
        np.stack(columns) if isinstance(own, np.ndarray) else own
        for own, columns in zip(_vectors(system), zip(*found, strict=True), strict=True)
    )


def _vectors(system: System) -> tuple[Any, ...]:
    acting = model(system)
    return acted_on(acting.lagrangian.tag, acting.vectors, acting.forces)[1]


def _derivatives(system: System, parameter: Parameter) -> list[Array]:
    """Return the derivative of each vector by a parameter."""

    def at(value: float) -> list[Array]:
        try:
            vectors = _vectors(with_values(system, [parameter], [value]))
        except InputError as error:
            raise InputError(
                f"the derivative by {parameter.name} is not known where it is {parameter.value:g}: {error}"
            ) from error
        return [x if isinstance(x, np.ndarray) else np.zeros(0) for x in vectors]

    p = parameter.value
    if p == 0.0:
        begin, middle, end = at(0.0), at(1.0), at(2.0)
        for x, y, z in zip(begin, middle, end, strict=True):
            if x.shape != y.shape or np.any(abs(x - 2.0 * y + z) > LINEAR * abs(z - x)):
                raise InputError(
                    f"the derivative by {parameter.name} is not known where it is 0; expected a small value instead."
                )
        return [y - x for x, y in zip(begin, middle, strict=True)]
    differences = []
    for level in range(LEVELS):
        h = FIRST * 0.5**level * p
        pairs = zip(at(p + h), at(p - h), strict=True)
        differences.append([(ahead - behind) / (2.0 * h) for ahead, behind in pairs])
        if level and all(_alike(x, y) for x, y in zip(*differences[-2:], strict=True)):
            return differences[0]
    table = [list(column) for column in zip(*differences, strict=True)]
    return [_extrapolated(column) for column in table]


def _alike(one: Array, other: Array) -> bool:
    """Whether differences over two lengths are the same, as those of a straight line."""
    return bool(np.all(abs(one - other) <= LINEAR * abs(other)))


def _extrapolated(column: list[Array]) -> Array:
    """Return the limit of central differences of halved lengths."""
    for k in range(1, len(column)):
        column = [(4.0**k * b - a) / (4.0**k - 1.0) for a, b in pairwise(column)]
    return column[0]
