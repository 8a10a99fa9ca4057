"""Derived quantities of a single state: conserved quantities and osculating elements."""

from __future__ import annotations

from typing import TYPE_CHECKING

from astropy import units as u

from orbits import diagnostics
from orbits.elements import default_frame
from orbits.system import new_bodies
from orbits.system.model import ANGULAR_MOMENTUM, ENERGY, MOMENTUM, centre, of_rigid, whole
from orbits.system.orbital_elements import OrbitalElements, osculating

if TYPE_CHECKING:
    from orbits.system.system import System


class Questions:
    """The methods of `System` for conserved quantities and elements."""

    __slots__ = ()

    def energy(self) -> u.Quantity:
        """Return the energy of the massive bodies, including terms: `orbits.diagnostics.energy` divided by G."""
        system: System = self  # type: ignore[assignment]
        gm, q, v, softening = system.values
        value = whole(system, ENERGY, diagnostics.energy(gm, q, v, softening), q, v) + of_rigid(system, ENERGY)
        return u.Quantity(value / system.units.G, system.units.energy)

    def linear_momentum(self) -> u.Quantity:
        """Return the canonical momentum of the massive bodies, shape (3,)."""
        system: System = self  # type: ignore[assignment]
        gm, q, v, _ = system.values
        value = whole(system, MOMENTUM, diagnostics.linear_momentum(gm, v), q, v)
        return u.Quantity(value / system.units.G, system.units.momentum)

    def angular_momentum(self) -> u.Quantity:
        """Return the angular momentum of the massive bodies about the origin, shape (3,)."""
        system: System = self  # type: ignore[assignment]
        gm, q, v, _ = system.values
        value = whole(system, ANGULAR_MOMENTUM, diagnostics.angular_momentum(gm, q, v), q, v)
        value = value + of_rigid(system, ANGULAR_MOMENTUM)
        return u.Quantity(value / system.units.G, system.units.angular_momentum)

    def centre_of_mass(self) -> u.Quantity:
        """Return the centre of mass of the massive bodies, shape (3,); see `Trajectory.centre_of_mass`."""
        system: System = self  # type: ignore[assignment]
        _, q, v, _ = system.values
        return u.Quantity(centre(system, q[system.massive], v[system.massive]), system.units.length)

    @property
    def frame(self) -> str:
        """The frame of elements, pictures and planes where none is named.

        It is "ecliptic", that of J2000, if one of the bodies is called "Sun" and units are physical: the axes of the
        system are then taken for those of the ICRF. Otherwise it is "system", the axes of the system itself.
        """
        system: System = self  # type: ignore[assignment]
        return default_frame(system.units, system.names)

    def elements(self, primary: str | None = None, frame: str | None = None) -> OrbitalElements:
        """Return the osculating elements of all other bodies; see `OrbitalElements`.

        primary : a body; "barycentre", the centre of mass of all massive bodies; or "jacobi", the centre of mass of
            the preceding bodies. The two-body GM is the sum of the body's and the primary's. Optional if only one body
            has mass
        frame : "ecliptic" (of J2000), "icrf", "sky" or "system" (the system's own axes); by default `System.frame`

        Raises UnknownNameError for a primary or frame that does not exist, InputError, naming the body, for a state
        without elements: at the position of the primary, or moving straight towards or away from it.
        """
        system: System = self  # type: ignore[assignment]
        gm, q, v, _ = system.values
        primary = new_bodies.primary_name(system.names, gm, primary)
        frame = system.frame if frame is None else frame
        return osculating(
            system.names,
            gm,
            q,
            v,
            units=system.units,
            primary=primary,
            frame=frame,
            epoch=system.epoch,
            forces=system.forces,
        )
