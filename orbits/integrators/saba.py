"""Symplectic splittings of several kicks a step, for planets about a dominant body: SABA, or ABA.

With the Hamiltonian in Jacobi coordinates (`orbits.kernels.maps.jacobi`) as A + B, A the free centre of mass and the
Kepler motions and B the interaction, a step is a sequence of Kepler motions and kicks, a palindrome that begins and
ends with a motion. With coefficients made for a small B (`orbits.tableaux.near_integrable`), the error of a step is

    eps h^(r1) + eps^2 h^(r2) + eps^3 h^(r3),     eps the mass of the planets in units of that of the dominant body

without any change of variables: what a corrector does for Wisdom–Holman maps of one kick a step. What is marched stands
within the first Kepler motion of a step, joined to the last one of the step before it; the motion back is applied for
outputs only, on a copy. The state is in doubled precision.

Source: Laskar & Robutel (2001), Celest. Mech. Dyn. Astron. 80, 39; Blanes, Casas, Farrés, Laskar, Makazaga & Murua
(2013), Appl. Numer. Math. 68, 58; Farrés et al. (2013), Celest. Mech. Dyn. Astron. 116, 141.
"""

from __future__ import annotations

import ast
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

from orbits.checks import is_whole
from orbits.errors import InputError, shown
from orbits.integrators.base import APART, MOMENTUM_MAPS, SYMMETRIC, SYMPLECTIC, Integrator, option
from orbits.integrators.maps.encounters import FOLLOW, RETIRE, WARN, Encounters, read, without_planets
from orbits.integrators.maps.stages_form import KeplerStages
from orbits.lagrangians.base import NEWTONIAN, SEPARABLE
from orbits.tableaux.near_integrable import KNOWN, REFINED

LEAST_STEPS: dict[tuple[int, ...], int] = {(10, 6, 4): 8, (8, 6, 4): 10}
"""Steps in a full turn at the speed of a pericentre, where less than those of one kick do. Asteroids with e = 0.9 among
the giants are then as accurate after a hundred years as in steps of a fifth of that; with two fewer, Mercury is 3 and 1
km off after a thousand years."""


@without_planets
@dataclass(frozen=True)
class SABA(Integrator):
    """Several kicks a step between Kepler orbits about a dominant body, of high order in the mass of the planets.

    first, second, third : the generalized order (first, second, third), the powers of the step in the errors of the
        first, second and third order in the planets' masses: (10, 6, 4), (8, 6, 4) or (8, 4); or (2 n, 2), the scheme
        of n kicks that Laskar and Robutel call SABA_n, n = 1 ... 10. Also as one value: SABA("10-6-4"), SABA((8, 2))
    encounters : what is done where bodies come too close for steps of this length, as with `WisdomHolman`: "warn",
        "retire" massless particles, "follow planets" by steps chosen one by one, of all bodies; or "retire particles,
        follow planets"

    For systems of the kind that `WisdomHolman` is for, under Newton's gravity alone, in the same Jacobi coordinates;
    see there for encounters and for the places of massless particles. It has no corrector, so that the states between
    samples, which closest approaches and conditions see, are as accurate as the samples, and events cost no more than
    they do with other methods. It is symplectic and symmetric, and conserves the momenta, to round-off.

    Take at least 8 steps of (10, 6, 4), which have 8 kicks each, in a full turn at the speed of the fastest pericentre:
    7 days for Mercury; 10 of (8, 6, 4), with 7 kicks, and 16 of the others. Runs warn of fewer.

    Raises InputError for orders that no scheme here has, and for other answers to encounters.
    """

    first: Any = 10
    second: Any = None
    third: Any = None
    encounters: str = option("warn")

    name: ClassVar[str] = "saba"
    summary: ClassVar[str] = "SABA(10,6,4) and others: bodies about a dominant one, several Kepler orbits and kicks"
    requires: ClassVar[frozenset[str]] = frozenset({SEPARABLE, NEWTONIAN})
    declares: ClassVar[frozenset[str]] = frozenset({SYMPLECTIC, SYMMETRIC, MOMENTUM_MAPS})
    follows_kepler: ClassVar[bool] = True
    instead_of_meeting: ClassVar[str] = "end the run before"
    keeps_every: ClassVar[int] = APART
    source: ClassVar[str] = "McLachlan (1995); Laskar & Robutel (2001); Blanes et al. (2013)"

    def __post_init__(self) -> None:
        orders = _orders(self.first, self.second, self.third)
        for name, value in zip(("first", "second", "third"), (*orders, None), strict=False):
            object.__setattr__(self, name, value)
        asked = read(self.encounters, particles=(WARN, RETIRE), planets=(WARN, FOLLOW))
        object.__setattr__(self, "encounters", str(asked))

    @property
    def orders(self) -> tuple[int, ...]:
        """The generalized order."""
        return tuple(order for order in (self.first, self.second, self.third) if order is not None)

    @cached_property
    def label(self) -> str:
        """The name with the generalized order: "SABA(10, 6, 4)"."""
        more = [f"encounters={self.encounters!r}"] if "encounters" in self.parameters() else []
        return f"SABA({', '.join([*map(str, self.orders), *more])})"

    @cached_property
    def in_encounters(self) -> Encounters:
        """What is done in encounters that the steps cannot follow."""
        return read(self.encounters)

    @property
    def order(self) -> int:
        """Order of convergence for fixed masses: the smallest of the generalized order."""
        return min(self.orders)

    @property
    def least_steps(self) -> int:  # type: ignore[override]
        """Steps in a full turn at the speed of a pericentre below which they do not resolve it."""
        return LEAST_STEPS.get(self.orders, super().least_steps)

    @property
    def second_order(self) -> KeplerStages:
        """Kepler motions and kicks."""
        return KeplerStages(self.orders)

    @classmethod
    def examples(cls) -> tuple[SABA, ...]:
        """Return the default, a shorter scheme and a classic one."""
        return cls(), cls(8, 6, 4), cls(8, 2)


def _orders(first: Any, second: Any, third: Any) -> tuple[int, ...]:
    """Return a generalized order that may be typed as one value or several; (10,) and (10, 6) are (10, 6, 4)."""
    given = first if second is None and third is None and not is_whole(first) else (first, second, third)
    if isinstance(given, str):
        try:
            given = ast.literal_eval(given.replace("-", ","))
        except (SyntaxError, ValueError):
            given = (given,)
    values = tuple(x for x in given if x is not None) if isinstance(given, tuple | list) else (given,)
    if all(map(is_whole, values)) and values in ((10,), (10, 6), (8, 6)):
        values = {10: (10, 6, 4), 8: (8, 6, 4)}[values[0]]
    if all(map(is_whole, values)) and values in KNOWN:
        return tuple(int(x) for x in values)
    schemes = ", ".join(str(orders) for orders in sorted(REFINED, reverse=True))
    hint = ""
    if len(values) == 1 and is_whole(values[0]) and values[0] > 0 and (2 * values[0], 2) in KNOWN:
        hint = f" SABA_{values[0]} of Laskar & Robutel is SABA({2 * values[0]}, 2)."
    raise InputError(
        f"SABA has no scheme of the generalized order {shown(values[0] if len(values) == 1 else values)}; expected one "
        f"of {schemes}, or (2 n, 2) for n = 1 ... 10 kicks.{hint}"
    )


__all__ = ["SABA"]
