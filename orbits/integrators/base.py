"""The contract of an integrator: a frozen value that says what it is, asks for and promises, and how it steps."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from orbits.errors import InputError
from orbits.integrators.forms import Form
from orbits.lagrangians.base import GRADIENTS, Lagrangian
from orbits.tableaux import PartitionedTableau

SYMPLECTIC = "symplectic"
"""Property: the step keeps the symplectic form."""

SYMMETRIC = "symmetric"
"""Property: a step of -h undoes a step of h."""

MOMENTUM_MAPS = "momentum maps"
"""Property: the step keeps the charges of symmetries that translate or turn: momentum, angular momentum."""


@dataclass(frozen=True)
class Integrator:
    """Base of all methods. A method is a frozen dataclass; its fields are its parameters.

    name : as registered and as typed on the command line
    summary : one line for people
    requires : traits that a Lagrangian must have
    declares : properties that hold to round-off; contract tests check each, and that the others fail
    variational : whether the step solves the Euler–Lagrange equations of a discrete Lagrangian, that of its tableau
    source : where the method comes from

    A method steps in one or two forms, see `Form`: `second_order` for separable Lagrangians, in positions and
    velocities, and `canonical` for any regular one, in positions and momenta.
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    requires: ClassVar[frozenset[str]]
    declares: ClassVar[frozenset[str]]
    variational: ClassVar[bool] = False
    source: ClassVar[str]

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

    @property
    def second_order(self) -> Form | None:
        """How the method steps a separable Lagrangian, q'' = g(q); None where it does not."""
        return None

    @property
    def canonical(self) -> Form | None:
        """How the method steps any regular Lagrangian; None where it does not."""
        return None

    def form_with(self, forces: int) -> Form | None:
        """Return how the method steps bodies, by positions and velocities, on which terms of any kind act and so many
        forces without a Lagrangian; None where it does not.
        """
        return None

    def form(self, lagrangian: Lagrangian, *, canonical: bool = False) -> Form | None:
        """Return how the method steps this Lagrangian, in canonical form if that is asked for or the only one."""
        if not canonical and self.requires <= lagrangian.traits and self.second_order is not None:
            return self.second_order
        return self.canonical if GRADIENTS in lagrangian.traits else None

    @property
    def label(self) -> str:
        """Name with parameters, as one would type it: "Gauss(stages=8)"."""
        values = ", ".join(f"{f.name}={getattr(self, f.name)!r}" for f in dataclasses.fields(self))
        return f"{type(self).__name__}({values})"

    def serves(self, lagrangian: Lagrangian) -> bool:
        """Whether this method can march `lagrangian`."""
        return self.form(lagrangian) is not None

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
