"""Systems with the bodies of a catalogue: one call from a downloaded file to Sun, planets and asteroids."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits import elements as kepler
from orbits import ephemeris
from orbits.body_names import few
from orbits.checks import checked_flag
from orbits.errors import EpochError, InputError, UnknownNameError
from orbits.system.new_bodies import is_about_ssb
from orbits.units import as_epoch

if TYPE_CHECKING:
    from astropy.time import Time

    from orbits.catalogue import Catalogue
    from orbits.system.system import System

Floats = NDArray[np.float64]

# A Julian date as one float64 resolves 4e-10 d: epochs closer than this are the same.
SAME_EPOCH_DAYS = 1e-9
MJD_ZERO = 2400000.5


class FromCatalogues:
    """The methods of `System` for catalogues."""

    __slots__ = ()

    @classmethod
    def from_catalogue(
        cls,
        catalogue: Catalogue,
        *,
        bodies: Sequence[str] | None = None,
        epoch: Any = None,
        propagate_to_epoch: bool = False,
        massive: bool = False,
        origin: str = "barycentre",
    ) -> Self:
        """Return Sun and planets of JPL's DE440 with the bodies of a catalogue, at the catalogue's epoch.

            System.from_catalogue(orbits.asteroids(1000))
            System.from_catalogue(orbits.read_mpcorb("MPCORB.DAT.gz", brighter_than=12))
            System.from_catalogue(orbits.read_sbdb("sbdb_query_results.csv"))

        catalogue : as returned by `asteroids`, `read_mpcorb` or `read_sbdb`
        bodies : as in `solar_system`; "Sun" must be among them
        epoch : of the system, by default the epoch of the elements
        propagate_to_epoch : propagate elements of other epochs, as `add_particles` does; without epoch= to the most
            common epoch of the catalogue
        massive : as in `add_particles`
        origin : "barycentre", the barycentre of all massive bodies, which is at rest; or "ssb", the Solar System
            barycentre, as in `solar_system`

        Raises EpochError if epochs differ and `propagate_to_epoch` is False, or DE440 does not cover them; InputError
        for an empty catalogue.
        """
        _check(catalogue)
        propagate_to_epoch = checked_flag(propagate_to_epoch, "propagate_to_epoch")
        if not len(catalogue):
            raise InputError("the catalogue has no bodies; expected at least one. Relax the selection")
        when = _common_epoch(catalogue, propagate_to_epoch) if epoch is None else as_epoch(epoch)
        planets: Any = cls.solar_system(epoch=when, bodies=bodies, origin=origin)  # type: ignore[attr-defined]
        system = planets.add_particles(catalogue, propagate_to_epoch=propagate_to_epoch, massive=massive)
        moves = massive and not is_about_ssb(origin)
        return system.barycentric() if moves else system  # type: ignore[no-any-return]

    def add_particles(self, catalogue: Catalogue, *, propagate_to_epoch: bool = False, massive: bool = False) -> Self:
        """Return this system with the bodies of a catalogue as massless particles around its body "Sun".

            system.add_particles(orbits.asteroids(1000))
            system.add_particles(orbits.read_mpcorb("MPCORB.DAT.gz", numbers=range(1, 101)), propagate_to_epoch=True)

        propagate_to_epoch : propagate elements of other epochs to that of the system along two-body orbits, which
            neglects the perturbations by the planets in between
        massive : give a mass to bodies whose GM is in the catalogue. Their elements still refer to the GM of the Sun
            alone, as in the Small-Body Database

        Raises EpochError if epochs differ and `propagate_to_epoch` is False, InputError for a system without an epoch,
        and for massive=True with a catalogue without any GM, UnknownNameError for a system without "Sun".
        """
        system: Any = self
        _check(catalogue)
        propagate_to_epoch = checked_flag(propagate_to_epoch, "propagate_to_epoch")
        massive = checked_flag(massive, "massive")
        q, v = particle_states(system, catalogue, propagate_to_epoch)
        gm = np.zeros(len(catalogue))
        if massive:
            gm = system.units.gm_value(catalogue.gm * (u.au**3 / u.day**2))
            if not (gm > 0.0).any():
                raise InputError(
                    f"no GM is known for {few(catalogue.names, 3)}; expected a catalogue with GM. Ask the database "
                    "for the column GM, or leave out massive=True"
                )
        radii = catalogue.radius * u.au if (catalogue.radius > 0.0).any() else None
        return system._extended(tuple(catalogue.names), gm, q, v, radii)  # type: ignore[no-any-return]


def particle_states(system: System, catalogue: Catalogue, propagate_to_epoch: bool) -> tuple[Floats, Floats]:
    """Return positions and velocities of a catalogue's bodies in the system's axes and units."""
    units = system.units
    if system.epoch is None:
        raise InputError("the system has no epoch, so the positions of asteroids are undefined. Make it with epoch=...")
    if "Sun" not in system:
        raise UnknownNameError(
            f"the asteroids' elements are heliocentric, but there is no 'Sun' among {few(system.names)}."
        )
    sun = system.index("Sun")
    gm = float(system.gm[sun].to_value(u.au**3 / u.day**2))
    days = (system.epoch.jd1 - MJD_ZERO - catalogue.epoch) + system.epoch.jd2
    late = np.abs(days) > SAME_EPOCH_DAYS
    if late.any() and not propagate_to_epoch:
        i = int(np.argmax(late))
        raise EpochError(
            f"the system's epoch is MJD {system.epoch.mjd:.9g} TDB, but the elements of {catalogue.names[i]!r} are "
            f"of MJD {catalogue.epoch[i]:.9g} TDB. Make the system at that epoch, or use propagate_to_epoch=True "
            "to propagate them along two-body orbits."
        )
    q, v = _heliocentric(catalogue, gm)
    if late.any():
        q, v = kepler.two_body(q, v, gm, days, names=catalogue.names)
    return (
        system.values.q[sun] + units.length_value(kepler.from_frame(q, catalogue.frame) * u.au),
        system.values.v[sun] + units.speed_value(kepler.from_frame(v, catalogue.frame) * (u.au / u.day)),
    )


def _heliocentric(catalogue: Catalogue, gm: float) -> tuple[Floats, Floats]:
    """Return positions and velocities at the epochs of the elements, from a and M, or from q and T."""
    q, v = np.empty((2, len(catalogue), 3))
    for by_perihelion in (False, True):
        rows = np.flatnonzero(catalogue.by_perihelion == by_perihelion)
        if not len(rows):
            continue
        part = catalogue if len(rows) == len(catalogue) else catalogue[rows]
        angles = {key: getattr(part, key) for key in ("e", "inc", "Omega", "omega")}
        if by_perihelion:
            place = {"q": part.q, "T": part.T - part.epoch}
        else:
            place = {"a": part.a, "M": part.M}
        q[rows], v[rows] = kepler.state_from_elements(gm, **place, **angles, names=part.names)
    return q, v


def _check(catalogue: Any) -> None:
    if not isinstance(catalogue, ephemeris.Catalogue):
        raise InputError(
            f"the catalogue is a {type(catalogue).__name__}; expected one from orbits.asteroids, orbits.read_mpcorb or "
            "orbits.read_sbdb."
        )


def _common_epoch(catalogue: Catalogue, propagate_to_epoch: bool) -> Time:
    """Return the epoch of the elements, or of most of them. Raises EpochError if they differ without permission."""
    from astropy.time import Time

    epochs, counts = np.unique(catalogue.epoch, return_counts=True)
    if len(epochs) > 1 and not propagate_to_epoch:
        raise EpochError(
            f"the elements of {catalogue.source} are of {len(epochs)} epochs, MJD {epochs[0]:.9g} to {epochs[-1]:.9g} "
            "TDB. Use propagate_to_epoch=True to propagate them along two-body orbits to the most common epoch, or to "
            "epoch=...; or choose bodies of one epoch"
        )
    return Time(MJD_ZERO, float(epochs[np.argmax(counts)]), format="jd", scale="tdb")
