"""What one asks of a single state: what is conserved, and the orbits that bodies osculate."""

from __future__ import annotations

from typing import TYPE_CHECKING

from astropy import units as u

from orbits import diagnostics
from orbits.system import new_bodies
from orbits.system.model import ANGULAR_MOMENTUM, ENERGY, MOMENTUM, whole
from orbits.system.orbital_elements import OrbitalElements, osculating

if TYPE_CHECKING:
    from orbits.system.system import System


class Questions:
    """What `System` has for conserved quantities and elements."""

    __slots__ = ()

    def energy(self) -> u.Quantity:
        """Return the energy of the massive bodies, terms included. Source: `orbits.diagnostics.energy`, over G."""
        system: System = self  # type: ignore[assignment]
        gm, q, v, softening = system.values
        value = whole(system, ENERGY, diagnostics.energy(gm, q, v, softening), q, v)
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
        return u.Quantity(value / system.units.G, system.units.angular_momentum)

    def centre_of_mass(self) -> u.Quantity:
        """Return the centre of mass of the massive bodies, shape (3,)."""
        system: System = self  # type: ignore[assignment]
        gm, q, _, _ = system.values
        return u.Quantity(diagnostics.centre_of_mass(gm, q), system.units.length)

    def elements(self, primary: str | None = None, frame: str | None = None) -> OrbitalElements:
        """Return the osculating elements of all other bodies; see `OrbitalElements`.

        primary : a body; "barycentre", the centre of mass of all massive bodies; or "jacobi": each body goes around
            the centre of mass of those before it. The two-body GM is that of the body and of all it goes around. May
            be left out where only one body has mass
        frame : "ecliptic" (of J2000) or "icrf" (the system's own axes); by default as of `add`

        Raises UnknownNameError for a primary or frame that does not exist, InputError, naming the body, for a state
        without elements: at the primary's place, or moving straight towards or away from it.
        """
        system: System = self  # type: ignore[assignment]
        gm, q, v, _ = system.values
        primary = new_bodies.primary_name(system.names, gm, primary)
        return osculating(system.names, gm, q, v, units=system.units, primary=primary, frame=frame, epoch=system.epoch)
