"""Wisdom–Holman maps: planets about a dominant body, on exact Kepler orbits between kicks by their interaction.

With the Hamiltonian in Jacobi coordinates (`orbits.kernels.maps.jacobi`) as A + B, A the free centre of mass and the
Kepler motions and B the interaction, whose potential is V, a step is half a kick, Kepler motions, half a kick. It is
the variational integrator of

    L_d(q, q+; h) = M |Q+ - Q|^2 / (2h) + sum_i m'_i S_i(q_i, q_i+; h) - h/2 [V(q) + V(q+)]

with S_i the exact discrete Lagrangian of Kepler's problem. Its error is of the order of (mass of the planets) h^2.
A corrector is a change of variables, applied once at the start and undone for outputs on a copy, that removes this
error up to a power of h: what remains is of the second order in the masses. Its largest part is removed by the modified
kick, by the potential V - h^2/24 sum_i m'_i |a_i|^2 with a the acceleration by V; V in L_d is then this one. The lazy
kick is the acceleration by V at q + h^2/12 a: the same to the second order in the masses, beyond which it is not
symplectic. State and corrected state are in doubled precision.

Terms of the dominant body, such as relativity and oblateness, are a part of B: those of positions alone in its kicks,
all others as a flow for half a step on both sides of the Kepler motions; see `orbits.kernels.maps.terms_of_dominant`.

Source: Wisdom & Holman (1991), AJ 102, 1528; Wisdom, Holman & Touma (1996), Fields Inst. Commun. 10, 217; Wisdom
(2006), AJ 131, 2294; Rein, Tamayo & Brown (2019), MNRAS 489, 4632.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

from orbits.checks import checked_flag, finite_number, has_unit, is_one_of, is_whole
from orbits.errors import InputError, shown
from orbits.integrators.base import APART, MOMENTUM_MAPS, SYMMETRIC, SYMPLECTIC, Integrator, option
from orbits.integrators.forms import Form
from orbits.integrators.maps.encounters import Encounters, read, without_planets
from orbits.integrators.maps.jacobi_form import KeplerSplitting
from orbits.integrators.maps.stages_form import DemocraticHeliocentric
from orbits.lagrangians.base import ABOUT_ONE_BODY, NEWTONIAN, Lagrangian
from orbits.tableaux.correctors import PAIRS

KERNELS = "modified-kick", "lazy", "standard"

COORDINATES = "jacobi", "democratic-heliocentric"


def _one_of(choices: tuple[str, ...]) -> str:
    """Return choices in words: 'a', 'b' or 'c'."""
    *others, last = map(repr, choices)
    return f"{', '.join(others)} or {last}"


def _distance(value: Any, name: str) -> float:
    """Return a distance above 0. Raises InputError for anything else."""
    if has_unit(value):
        raise InputError(
            f"{name} is {shown(value)}; expected a number in the system's unit of length, such as {name}=100"
        )
    number = finite_number(value, name)
    if not number > 0.0:
        raise InputError(f"{name} is {number:g}; expected a distance above 0, in the system's unit of length")
    return number


@without_planets
@dataclass(frozen=True)
class WisdomHolman(Integrator):
    """The method of planetary dynamics: Kepler orbits about a dominant body, kicked by the planets' interaction.

    coordinates : "jacobi", in which the interaction is small; or "democratic-heliocentric", in which the order of the
        planets plays no part, but the error is larger, by far for planets close to the dominant body, and has no
        corrector: the map of WHFast in these coordinates, for comparison
    kernel : the kick: "modified-kick", by the potential with the correction of the second order in the masses; "lazy",
        the same approximately, by the interaction at displaced positions; or "standard", by the interaction. By default
        the modified kick, and "standard", the only one, in democratic heliocentric coordinates
    corrector : order of the symplectic corrector: 17, 11, 7, 5, 3, or 0 for none, with the standard kernel. By default
        17, and 0, the only one, in democratic heliocentric coordinates
    corrector2 : whether to apply the second symplectic corrector too, with the modified or the lazy kick: it removes a
        part of the oscillations of the second order in the planets' masses, which matters for planets of a hundredth in
        long steps only; positions drift away as without it
    encounters : what is done where bodies come too close for steps of this length: "warn", before the run and after
        it; "follow" them there, massless particles each by steps of its own, planets by steps of all bodies that are
        chosen one by one; "retire" massless particles before the step of that passage, with time and place; or
        "refuse" to go on where planets meet, with a SingularityError before that step. "follow particles" and "follow
        planets" follow these alone, and two answers are separated by a comma: "retire particles, follow planets". Of
        what is not named is warned
    ejected_beyond, lost_within : the distance from the dominant body beyond which massless particles on open orbits are
        retired, and the pericentre distance below which any are, in the system's unit of length, whatever `encounters`
        is; looked for after every 64th step

    For bodies by Newton's gravity, with relativity and oblateness of the dominant body if the system has these terms
    (`PostNewtonian`, `ZonalHarmonics`, `FrameDragging`), on orbits that do not come close to planets, elliptic or
    hyperbolic. The planets are numbered outwards by the energies of their orbits at the start, in any order of the
    bodies. A massless particle moves about the centre of mass of the dominant body and the planets whose semi-major
    axes are below its pericentre distance at the start; see `orbits.kernels.maps.jacobi_particles`. The map of the
    planets is symplectic and conserves the momenta, but for the lazy kick, which does so up to the third order in the
    planets' masses; it is symmetric without a corrector, and up to that order with one. With terms, what is left is of
    the second order in them, too, times h^2; of oblateness the lazy kick removes that.

    Closest approaches, and the conditions that end a run, see the states between samples without the corrector: they
    are off by a fraction of about (mass of the planets) x (angle in a step)^2 of the distances, and with relativity
    velocities by (v/c)^2 of them.

    Events are sought on the states that are seen, for which the corrector is undone at each step: that takes 60 times
    the time of a run without events. Collisions are refused.

    When encounters are followed, a particle leaves the map at the beginning of the step in which it comes within four
    Hill radii of a planet, or so close that kicks do not add up to the planet's attraction, or in which h v / r about
    the dominant body exceeds half of 2 pi / 16 before a pericentre at which it exceeds all of that; the states at both
    ends of the step tell. By steps of its own, chosen as in runs without dt, it then moves in the field of the planets,
    and enters the map again once it is away. It is exact there, but not reversible in time, nor symplectic; the bits of
    all others do not change. All terms of the run act on it there too. One that comes within the radius of a body, if
    the system has radii, is retired where it does.

    About a dominant body that is alone, without terms, massless particles move exactly, whatever the step; then none
    leaves the map, or is warned of.

    All bodies leave the map, in both coordinates, at the beginning of the step in which two
    planets come within four mutual Hill radii of each other, or within the way that they make relative to each other in
    a step, or in which a planet comes to a pericentre that the step does not resolve, as above; the states at both ends
    of the step tell. By steps of Gauss(stages=8), chosen as in runs without dt, they then go on until the planets are
    1.1 times as far apart, and enter the map again at the next multiple of the step, with planets that are numbered
    anew. `run.excursions` lists when they left and returned. That is neither reversible in time nor symplectic; without
    encounters, all bits are those of the map, and after one, the last bits depend on the order in which the massive
    bodies are given. A planet that stays near another one, as in a pair of them, keeps all
    bodies away from the map for good. There is no dense output.

    Take at least 16 steps in a full turn at the speed of the fastest pericentre: 3 days for Mercury. Runs warn of
    pericentres that need more, and of encounters within three Hill radii of a planet, mutual ones of planets, or, of
    massless particles, within their way in a step relative to it, unless they are followed.

    Raises InputError for other coordinates, kernels, correctors and answers to encounters, and for a modified or lazy
    kick without a corrector.
    """

    coordinates: str = "jacobi"
    kernel: str | None = None
    corrector: int | None = None
    corrector2: bool = option(False)
    encounters: str = option("warn")
    ejected_beyond: float | None = option(None)
    lost_within: float | None = option(None)

    name: ClassVar[str] = "wisdom-holman"
    summary: ClassVar[str] = "Wisdom–Holman: bodies about a dominant one, corrected Kepler orbits and kicks"
    requires: ClassVar[frozenset[str]] = frozenset({ABOUT_ONE_BODY})
    follows_kepler: ClassVar[bool] = True
    instead_of_meeting: ClassVar[str] = "end the run before"
    keeps_every: ClassVar[int] = APART
    source: ClassVar[str] = (
        "Wisdom & Holman (1991); Wisdom, Holman & Touma (1996); Wisdom (2006); Rein, Tamayo & Brown (2019)"
    )

    def __post_init__(self) -> None:
        if not is_one_of(self.coordinates, COORDINATES):
            raise InputError(f"coordinates is {shown(self.coordinates)}; expected {_one_of(COORDINATES)}")
        if self.kernel is None:
            object.__setattr__(self, "kernel", "standard" if self._heliocentric else KERNELS[0])
        if self.corrector is None:
            object.__setattr__(self, "corrector", 0 if self._heliocentric else 17)
        if not is_one_of(self.kernel, KERNELS):
            raise InputError(f"kernel is {shown(self.kernel)}; expected {_one_of(KERNELS)}")
        if not is_whole(self.corrector) or self.corrector not in PAIRS:
            known = ", ".join(str(order) for order in sorted(PAIRS, reverse=True)[:-1])
            raise InputError(f"corrector is {shown(self.corrector)}; expected {known}, or 0 for none")
        object.__setattr__(self, "corrector", int(self.corrector))
        object.__setattr__(self, "corrector2", checked_flag(self.corrector2, "corrector2"))
        if self._heliocentric:
            self._require_neither_kernel_nor_corrector()
        object.__setattr__(self, "encounters", str(read(self.encounters)))
        for name in ("ejected_beyond", "lost_within"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, _distance(value, name))
        if None not in self.departures and not self.lost_within < self.ejected_beyond:  # type: ignore[operator]
            raise InputError(
                f"lost_within is {self.lost_within:g}, and ejected_beyond {self.ejected_beyond:g}; expected a smaller "
                "distance within than beyond"
            )
        if self.kernel != "standard" and not self.corrector:
            raise InputError(
                f"kernel={self.kernel!r} removes an error that only a corrector brings to light, and makes it larger "
                "without one; use corrector=17, or kernel='standard'"
            )
        if self.corrector2 and self.kernel == "standard":
            raise InputError(
                "corrector2=True removes oscillations that are hidden by the larger error of kernel='standard'; use "
                "kernel='modified-kick' or 'lazy'"
            )

    @property
    def _heliocentric(self) -> bool:
        return self.coordinates == "democratic-heliocentric"

    def _require_neither_kernel_nor_corrector(self) -> None:
        """Raise InputError for what is made for Jacobi coordinates."""
        for name, fits in (("kernel", "standard"), ("corrector", 0), ("corrector2", False)):
            if getattr(self, name) != fits:
                raise InputError(
                    f"{name}={getattr(self, name)!r} is made for Jacobi coordinates, and does not fit "
                    f"coordinates='democratic-heliocentric', where kicks and motions of the dominant body are applied "
                    f"together; leave it out, or use coordinates='jacobi'"
                )

    @property
    def departures(self) -> tuple[float | None, float | None]:
        """Where massless particles are retired."""
        return self.ejected_beyond, self.lost_within

    @cached_property
    def in_encounters(self) -> Encounters:
        """What is done in encounters that the steps cannot follow."""
        return read(self.encounters)

    @property
    def order(self) -> int:
        """Order of convergence for fixed masses: 2, and 4 with the modified or the lazy kick."""
        return 2 if self.kernel == "standard" or self.corrector in (0, 3) else 4

    def order_with(self, lagrangian: Lagrangian) -> int:
        """Return 2 with terms, whose second order, h^2 times their square, is not in the kick."""
        return self.order if NEWTONIAN in lagrangian.traits else 2

    @property
    def declares(self) -> frozenset[str]:  # type: ignore[override]
        """All but for the lazy kick; symmetric without a corrector."""
        if self.kernel == "lazy":
            return frozenset()
        return frozenset({SYMPLECTIC, MOMENTUM_MAPS} | (set() if self.corrector else {SYMMETRIC}))

    @property
    def variational(self) -> bool:  # type: ignore[override]
        """Whether the step is that of L_d: without a corrector, which changes variables, in Jacobi coordinates."""
        return self.corrector == 0 and not self._heliocentric

    @property
    def exact_for_two(self) -> bool:  # type: ignore[override]
        """Whether the motion of a single planet is exact: in Jacobi coordinates."""
        return not self._heliocentric

    @property
    def own_discrete_lagrangian(self) -> str:  # type: ignore[override]
        """What L_d a map has that is not variational."""
        if self._heliocentric:
            return super().own_discrete_lagrangian
        return "that of the same method without a corrector, after a change of variables"

    @property
    def second_order(self) -> KeplerSplitting | DemocraticHeliocentric:
        """Kepler motions and kicks."""
        if self._heliocentric:
            return DemocraticHeliocentric()
        return KeplerSplitting(str(self.kernel), self.corrector or 0, self.corrector2)

    def form(self, lagrangian: Lagrangian, *, canonical: bool = False) -> Form | None:
        """Return the form for this Lagrangian: with terms of the dominant body, if it has any."""
        form = super().form(lagrangian, canonical=canonical)
        if form is None or NEWTONIAN in lagrangian.traits or not isinstance(form, KeplerSplitting):
            return form
        return replace(form, with_terms=True)

    def check(self, lagrangian: Lagrangian, others: Callable[[], Mapping[str, type[Integrator]]]) -> None:
        """Raise InputError, naming the terms that have no flow here."""
        summands = getattr(lagrangian, "summands", ())
        strange = [term.name for term in summands if ABOUT_ONE_BODY not in term.traits]
        if summands and self._heliocentric:
            raise InputError(
                f"{self.label} takes no terms besides Newton's gravity, got {', '.join(x.name for x in summands)}; in "
                "Jacobi coordinates it takes those of the dominant body, and Gauss(stages=8) takes all."
            )
        if strange:
            raise InputError(
                f"{self.label} takes terms of the dominant body such as PostNewtonian of one source, each with a "
                f"motion of its own between Kepler motions, not {', '.join(strange)}. Use Gauss(stages=8)."
            )
        super().check(lagrangian, others)

    @classmethod
    def examples(cls) -> tuple[WisdomHolman, ...]:
        """Return the default, the plain map, and that in democratic heliocentric coordinates."""
        return cls(), cls(kernel="standard", corrector=0), cls(coordinates="democratic-heliocentric")
