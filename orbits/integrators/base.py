"""The contract of an integrator: a frozen value that says what it is, asks for and promises, and how it steps.

The state of d coordinates (of n bodies: all x, all y, all z) is four vectors q, q_lo, v, v_lo padded to `padded(d)`
elements; (q, q_lo) and (v, v_lo) are numbers of doubled precision. While the massive bodies march, the positions that
the method evaluates forces at are recorded in `field`; each massless particle is then marched through that field on
its own, so that particles may be shared among threads and no particle's bits depend on its neighbours.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError
from orbits.kernels.lanes import WIDTH
from orbits.lagrangians.base import GRADIENTS, Lagrangian
from orbits.tableaux import PartitionedTableau

Array = NDArray[np.float64]

SYMPLECTIC = "symplectic"
SYMMETRIC = "symmetric"
MOMENTUM_MAPS = "momentum maps"

OK, NOT_CONVERGED, NOT_FINITE, NOT_REGULAR = 0, 1, 2, 3
"""Status codes of the kernels; `Marcher` and `Flow` turn them into errors."""


def padded(count: int) -> int:
    """Return the length of a vector for `count` numbers, so that lanes may read and write past its end."""
    return (count + WIDTH - 1) // WIDTH * WIDTH + WIDTH


def aligned(*shapes: tuple[int, ...]) -> list[Array]:
    """Return zeros of these shapes, each beginning where a line of the processor's cache does: where eight lanes lie
    across two lines, a step of `Gauss` takes up to a sixth of its time longer.
    """
    sizes = [math.prod(shape) for shape in shapes]
    memory = np.zeros(sum(padded(size) for size in sizes))
    begin = -(memory.__array_interface__["data"][0] // memory.itemsize) % WIDTH
    out = []
    for shape, size in zip(shapes, sizes, strict=True):
        out.append(memory[begin : begin + size].reshape(shape))
        begin += padded(size) - WIDTH
    return out


@dataclass(frozen=True)
class Integrator:
    """Base of all methods. A method is a frozen dataclass; its fields are its parameters.

    name : as registered and as typed on the command line
    summary : one line for people
    requires : traits that a Lagrangian must have
    declares : properties that hold to round-off; contract tests check each, and that the others fail
    variational : whether the step solves the Euler–Lagrange equations of a discrete Lagrangian, that of its tableau
    source : where the method comes from

    Kernels, the same signature for all methods; both return (status, steps done, index, evaluations):

    advance(tag, parameters, coefficients, h, q, q_lo, v, v_lo, memory, work, field, path, steps)
        marches the massive bodies; `field` has one slot for each step, or one slot that is used over and over; the
        state at the beginning of each step goes to `path` (`record_state`)
    advance_particles(
        tag, parameters, coefficients, h, q, q_lo, v, v_lo, memory, work, field, steps, start, stop, observer, context,
        track
    )
        marches particles start ... stop - 1, whose vectors have shape (3, padded), through the recorded field; their
        states go to `track`, eight particles at a time, and the observer is called with them (`call_observer`)

    and, for methods that serve any regular Lagrangian, in positions and momenta, from step `first` of a march from t:

    advance_canonical(tag, parameters, coefficients, t, first, h, q, q_lo, p, p_lo, memory, work, steps)
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    requires: ClassVar[frozenset[str]]
    declares: ClassVar[frozenset[str]]
    variational: ClassVar[bool] = False
    source: ClassVar[str]
    advance: ClassVar[Any]
    advance_particles: ClassVar[Any]
    advance_canonical: ClassVar[Any] = None

    @classmethod
    def examples(cls) -> tuple[Integrator, ...]:
        """Return instances that show the method at work: what tables list and contract tests run."""
        return (cls(),)

    @property
    def tableau(self) -> PartitionedTableau:
        """The step as a partitioned Runge–Kutta method; what certificates are measured against."""
        raise InputError(
            f"{self.name} says no tableau, so nothing can be certified; give its class the property tableau"
        )

    @property
    def order(self) -> int:
        """Order of convergence."""
        raise NotImplementedError

    def coefficients(self, h: float) -> Any:
        """Return what the kernels need to know of the method and the step; by default one row of eight."""
        return np.zeros((1, WIDTH))

    def coefficients_after(self, before: float, h: float) -> Any:
        """Return the coefficients of a step of h that follows one of `before`, whose memory it finds."""
        return self.coefficients(h)

    def kicks_and_drifts(self, h: float) -> tuple[Array, Array] | None:
        """Return the lengths of the s + 1 kicks and the s drifts between them that a step of h consists of, if it does:
        such a step of thousands of bodies is shared among threads.
        """
        return None

    def field_shape(self, size: int) -> tuple[int, int]:
        """Return the shape of one step's record of the positions of `size` coordinates."""
        raise NotImplementedError

    def memory_rows(self, size: int) -> int:
        """Return how many rows of eight the method carries from step to step for `size` coordinates (they are stored
        for resuming).
        """
        return 0

    @property
    def particle_memory_rows(self) -> int:
        """Rows of eight that the method carries from step to step for each particle."""
        return 0

    def work_shape(self, size: int) -> tuple[int, int]:
        """Return the shape of the scratch that the kernels want for `size` coordinates."""
        raise NotImplementedError

    def canonical_work_shape(self, size: int) -> tuple[int, int]:
        """Return the shape of the scratch that `advance_canonical` wants."""
        raise NotImplementedError

    @property
    def label(self) -> str:
        """Name with parameters, as one would type it: "Gauss(stages=8)"."""
        values = ", ".join(f"{f.name}={getattr(self, f.name)!r}" for f in dataclasses.fields(self))
        return f"{type(self).__name__}({values})"

    def serves(self, lagrangian: Lagrangian) -> bool:
        """Whether this method can march `lagrangian`."""
        return self._second_order(lagrangian) or self._canonical(lagrangian)

    def check(self, lagrangian: Lagrangian, others: Mapping[str, type[Integrator]]) -> None:
        """Raise InputError if this method cannot serve `lagrangian`, naming those of `others` that can."""
        if self.serves(lagrangian):
            return
        missing = self.requires - lagrangian.traits
        able = sorted(c.__name__ for c in others.values() if any(m.serves(lagrangian) for m in c.examples()))
        remedy = f"Use {' or '.join(able)}." if able else "No method of this package can."
        raise InputError(
            f"{self.name} needs a Lagrangian that is {' and '.join(sorted(missing))}; "
            f"'{lagrangian.name}' is not. {remedy}"
        )

    def _second_order(self, lagrangian: Lagrangian) -> bool:
        return self.requires <= lagrangian.traits

    def _canonical(self, lagrangian: Lagrangian) -> bool:
        return self.advance_canonical is not None and GRADIENTS in lagrangian.traits
