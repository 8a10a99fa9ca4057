"""The models of the Solar System by name: "newtonian", "relativistic", "full"."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from orbits.checks import is_one_of
from orbits.errors import InputError, UnknownNameError, shown

if TYPE_CHECKING:
    from astropy.time import Time

    from orbits.system.system import System

NEWTONIAN, RELATIVISTIC, FULL = "newtonian", "relativistic", "full"
NAMES = (NEWTONIAN, RELATIVISTIC, FULL)


def checked_model(model: Any) -> str:
    """Return the name of a model. Raises UnknownNameError for another."""
    if is_one_of(model, NAMES):
        return str(model)
    raise UnknownNameError(
        f"there is no model {shown(model)} of the Solar System; expected 'newtonian', point masses, 'relativistic', "
        "with relativity and the figures of Sun, Earth and Moon, or 'full', with the asteroids of DE440 and more."
    )


def modelled(cls: type[System], model: str, epoch: Time, bodies: Sequence[str] | None) -> System:
    """Return the Solar System by the model "relativistic" or "full", relative to the Solar System barycentre.

    bodies : as in `System.solar_system`, with Earth and Moon apart; for "full" only None
    """
    from orbits.system.new_bodies import from_ephemeris
    from orbits.system.solar.building import APART, relativistic_terms, with_all
    from orbits.units import SOLAR

    if model == FULL and bodies is not None:
        raise InputError(
            "bodies is given, but the model 'full' has all bodies of DE440. Leave out bodies=, or remove some from the "
            "system: system.remove('Pluto'). The model 'relativistic' takes bodies."
        )
    given = from_ephemeris(epoch, APART if bodies is None else bodies, apart_in=model)
    system = cls(**given, units=SOLAR)
    day = epoch.jd1 + epoch.jd2
    if model == RELATIVISTIC:
        return system.with_terms(*relativistic_terms(system.names, day))
    from orbits.system.solar.small_body_states import states

    return with_all(system, day, states(cls, epoch.jd1, epoch.jd2))
