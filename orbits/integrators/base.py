"""The contract of an integrator: a frozen value with its requirements, its declared properties and its forms."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

from orbits.errors import InputError
from orbits.integrators.forms import Array, Form
from orbits.integrators.maps.encounters import WARNED, Encounters
from orbits.lagrangians.base import CONSTRAINED, GRADIENTS, Lagrangian
from orbits.tableaux import PartitionedTableau

if TYPE_CHECKING:
    from orbits.discrete.base import DiscreteLagrangian

SYMPLECTIC = "symplectic"
"""Property: the step conserves the symplectic form."""

SYMMETRIC = "symmetric"
"""Property: a step of -h undoes a step of h."""

MOMENTUM_MAPS = "momentum maps"
"""Property: the step conserves the charges of translations and rotations: momentum, angular momentum."""


OPTION = "option"


APART = 64
"""The number of steps between the states that are kept of a run of which not all are."""


def option(default: Any) -> Any:
    """Return a field of a method that labels and archives name only where it differs from its default: those made
    before there was such a field stay as they are.
    """
    return dataclasses.field(default=default, metadata={OPTION: True})


@dataclass(frozen=True)
class Integrator:
    """Base of all methods. A method is a frozen dataclass; its fields are its parameters.

    name : its name in the registry and on the command line
    summary : one line for users
    requires : traits that a Lagrangian must have
    declares : properties that hold to round-off; contract tests check each, and that the others fail
    variational : whether the step solves the Euler–Lagrange equations of the discrete Lagrangian of its tableau
    follows_kepler : whether bodies move on Kepler orbits about a dominant one, and steps are judged as such
    least_steps : then, the steps in a full turn at the speed of a pericentre below which they do not resolve it
    instead_of_meeting : what the user may do besides a smaller dt where bodies meet, in words
    keeps_every : the steps between the states that dense output keeps of massive bodies; more where one is costly
    exact_for_two : then, whether the motion of a single planet is exact
    own_discrete_lagrangian : in words for certificates, what L_d a method on Kepler orbits has that is not variational
    source : the literature on the method

    A method has one or two forms, see `Form`: `second_order` for separable Lagrangians, in positions and
    velocities, and `canonical` for any regular one, in positions and momenta; or `constrained`, for separable
    Lagrangians with constraints.
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    requires: ClassVar[frozenset[str]]
    declares: ClassVar[frozenset[str]]
    variational: ClassVar[bool] = False
    follows_kepler: ClassVar[bool] = False
    least_steps: ClassVar[int] = 16
    instead_of_meeting: ClassVar[str] = "softening"
    keeps_every: ClassVar[int] = 1
    exact_for_two: ClassVar[bool] = True
    own_discrete_lagrangian: ClassVar[str] = "that of a composition of maps, with states between them"
    source: ClassVar[str]

    @classmethod
    def examples(cls) -> tuple[Integrator, ...]:
        """Return examples of the method, for tables and contract tests."""
        return (cls(),)

    @property
    def tableau(self) -> PartitionedTableau:
        """The step as a partitioned Runge–Kutta method, with which certificates compare it."""
        raise InputError(
            f"{self.name} has no tableau, so nothing can be certified; give its class the property tableau"
        )

    @property
    def order(self) -> int:
        """Order of convergence: that of its tableau."""
        return self.tableau.order

    def order_with(self, lagrangian: Lagrangian) -> int:
        """Return the order of convergence for a Lagrangian, if its terms change it."""
        return self.order

    @property
    def departures(self) -> tuple[float | None, float | None]:
        """The distance beyond which massless particles on open orbits are retired, and the pericentre distance below
        which all are; None for none.
        """
        return None, None

    @property
    def in_encounters(self) -> Encounters:
        """What is done in encounters that the method cannot follow."""
        return WARNED

    @property
    def looks_for_approaches(self) -> bool:
        """Whether runs record closest approaches if they are not told to or not to: where that costs little beside a
        step, as beside an implicit one.
        """
        return False

    @property
    def second_order(self) -> Form | None:
        """The form for separable Lagrangians, q'' = g(q), or None."""
        return None

    @property
    def canonical(self) -> Form | None:
        """The form for any regular Lagrangian, or None."""
        return None

    @property
    def constrained(self) -> Form | None:
        """The form for separable Lagrangians with constraints, in positions and velocities, or None."""
        return None

    def form_with(self, forces: int, inner: int = 0) -> Form | None:
        """Return the form, in positions and velocities, for bodies with terms of any kind and `forces` forces without a
        Lagrangian, which have so many internal variables together, or None.
        """
        return None

    def form_of_rotors(self, lagrangian: Lagrangian) -> Form | None:
        """Return the form, in positions and momenta, for a Lagrangian of rigid bodies, or None."""
        return None

    def form(self, lagrangian: Lagrangian, *, canonical: bool = False) -> Form | None:
        """Return the form for this Lagrangian, the canonical one if it is requested or the only one."""
        of_rotors = self.form_of_rotors(lagrangian) if lagrangian.rotors else None
        if of_rotors is not None:
            return of_rotors
        if CONSTRAINED in lagrangian.traits:
            return None if canonical else self.constrained
        if not canonical and self.requires <= lagrangian.traits and self.second_order is not None:
            return self.second_order
        return self.canonical if GRADIENTS in lagrangian.traits else None

    def parameters(self) -> dict[str, Any]:
        """Return the parameters by name, without options (`option`) that are not used."""
        values = {f: getattr(self, f.name) for f in dataclasses.fields(self)}
        return {f.name: value for f, value in values.items() if OPTION not in f.metadata or value != f.default}

    @cached_property
    def label(self) -> str:
        """The name with parameters, as in code: "Gauss(stages=8)"."""
        values = ", ".join(f"{name}={value!r}" for name, value in self.parameters().items())
        return f"{type(self).__name__}({values})"

    def serves(self, lagrangian: Lagrangian) -> bool:
        """Return whether this method can march `lagrangian`."""
        return self.form(lagrangian) is not None

    def discrete_lagrangian(self, lagrangian: Lagrangian) -> DiscreteLagrangian | None:
        """Return the discrete Lagrangian whose map a step is, for methods that have one but no tableau; else None."""
        return None

    def refusal(self, lagrangian: Lagrangian, q: Array, p: Array, dt: float, *, share: float = 1.0) -> str | None:
        """Return why equations that did not converge from (q, p) have no solution, and the remedy, or None if this is
        not known; share : the longest step in dt, as a fraction of it.
        """
        return None

    def check(self, lagrangian: Lagrangian, others: Callable[[], Mapping[str, type[Integrator]]]) -> None:
        """Raise InputError if this method cannot march `lagrangian`, naming those of `others()` that can."""
        if self.serves(lagrangian):
            return
        if CONSTRAINED in lagrangian.traits:
            raise InputError(
                f"{self.name} does not keep constraints, and '{lagrangian.name}' has {len(lagrangian.constraints)}: "
                f"{', '.join(f'{g} = 0' for g in lagrangian.constraints)}. Use orbits.methods.Rattle(), or raise "
                "its order with orbits.methods.Composition(orbits.methods.Rattle(), order=4)."
            )
        missing = self.requires - lagrangian.traits
        able = sorted(c.__name__ for c in others().values() if any(m.serves(lagrangian) for m in c.examples()))
        remedy = f"Use {' or '.join(able)}." if able else "No method of this package can."
        raise InputError(
            f"{self.name} needs a Lagrangian that is {' and '.join(sorted(missing))}; "
            f"'{lagrangian.name}' is not. {remedy}"
        )
