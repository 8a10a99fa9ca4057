"""The contract of an integrator: a frozen value that says what it is, asks for and promises, and how it steps.

The state of n bodies is four vectors q, q_lo, v, v_lo of 3n coordinates (all x, all y, all z) padded to `padded(3 n)`
elements; (q, q_lo) and (v, v_lo) are numbers of doubled precision. While the massive bodies march, the positions that
the method evaluates forces at are recorded in `field`; each massless particle is then marched through that field on
its own, so that particles may be shared among threads and no particle's bits depend on its neighbours.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError
from orbits.kernels.lanes import WIDTH
from orbits.lagrangians.base import Lagrangian

Array = NDArray[np.float64]

SYMPLECTIC = "symplectic"
SYMMETRIC = "symmetric"
MOMENTUM_MAPS = "momentum maps"

OK, NOT_CONVERGED, NOT_FINITE = 0, 1, 2
"""Status codes of the kernels; `Marcher` turns them into errors."""


def padded(count: int) -> int:
    """Return the length of a vector for `count` numbers, so that lanes may read and write past its end."""
    return (count + WIDTH - 1) // WIDTH * WIDTH + WIDTH


@dataclass(frozen=True)
class Integrator:
    """Base of all methods. A method is a frozen dataclass; its fields are its parameters.

    name : as registered and as typed on the command line
    summary : one line for people
    requires : traits that a Lagrangian must have
    declares : properties that hold to round-off; contract tests check each, and that the others fail
    discrete_lagrangian : name in `orbits.discrete` of the discrete Lagrangian whose Euler–Lagrange equations the step
        solves, if there is one
    source : where the method comes from

    Kernels, the same signature for all methods; both return (status, steps done, index, evaluations):

    advance(tag, parameters, coefficients, h, q, q_lo, v, v_lo, memory, work, field, steps)
        marches the massive bodies; `field` has one slot for each step, or one slot that is used over and over
    advance_particles(tag, parameters, coefficients, h, q, q_lo, v, v_lo, memory, work, field, steps, start, stop)
        marches particles start ... stop - 1, whose vectors have shape (3, padded), through the recorded field
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    requires: ClassVar[frozenset[str]]
    declares: ClassVar[frozenset[str]]
    discrete_lagrangian: ClassVar[str | None] = None
    source: ClassVar[str]
    advance: ClassVar[Any]
    advance_particles: ClassVar[Any]

    @property
    def order(self) -> int:
        """Order of convergence."""
        raise NotImplementedError

    def coefficients(self, h: float) -> Array:
        """Return what the kernels need to know of the method and the step, (rows, 8)."""
        return np.zeros((1, WIDTH))

    def field_shape(self, bodies: int) -> tuple[int, int]:
        """Return the shape of one step's record of the massive bodies' positions."""
        raise NotImplementedError

    def memory_rows(self, bodies: int) -> int:
        """Return how many rows of eight the method carries from step to step for the massive bodies (it is stored for
        resuming).
        """
        return 0

    @property
    def particle_memory_rows(self) -> int:
        """Rows of eight that the method carries from step to step for each particle."""
        return 0

    def work_shape(self, bodies: int) -> tuple[int, int]:
        """Return the shape of the scratch that the kernels want."""
        raise NotImplementedError

    @property
    def label(self) -> str:
        """Name with parameters, as one would type it: "Gauss(stages=8)"."""
        values = ", ".join(f"{f.name}={getattr(self, f.name)!r}" for f in dataclasses.fields(self))
        return f"{type(self).__name__}({values})"

    def check(self, lagrangian: Lagrangian, others: dict[str, type[Integrator]]) -> None:
        """Raise InputError if this method cannot serve `lagrangian`, naming those of `others` that can."""
        missing = self.requires - lagrangian.traits
        if missing:
            able = sorted(c.__name__ for c in others.values() if c.requires <= lagrangian.traits)
            remedy = f"Use {' or '.join(able)}." if able else "No method of this package can."
            raise InputError(
                f"{self.name} needs a Lagrangian that is {' and '.join(sorted(missing))}; "
                f"'{lagrangian.name}' is not. {remedy}"
            )
