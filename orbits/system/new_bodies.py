"""States of new bodies, from elements or from DE440."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits import elements as kepler
from orbits import ephemeris
from orbits.body_names import BOTH, checked_names, few
from orbits.errors import EpochError, InputError, UnknownNameError, shown, with_unit
from orbits.system import state_checks
from orbits.system.model import centre_of, masses_at
from orbits.units import UnitSystem, as_epochs

if TYPE_CHECKING:
    from astropy.time import Time

    from orbits.system.system import System

Floats = NDArray[np.float64]
State = tuple[Floats, Floats]

LENGTHS = ("a", "q")
TIMES = ("P", "T")
ANGLES = ("inc", "Omega", "omega", "pomega", "M", "f", "E", "u", "l", "theta")
ELEMENTS = ("a", "P", "n", "q", "e", *ANGLES, "T", "h", "k", "ix", "iy")
OF_A_BODY = ("gm", "mass", "radius")

# Centres of orbits that are not bodies.
BARYCENTRIC = ("barycentre", "barycenter")
JACOBI = "jacobi"

SSB = "ssb"
SAME_EPOCH_NS = 1.0

EXAMPLE = "System.from_elements({'Sun': dict(mass=1 * u.M_sun), 'Ceres': dict(a=2.77 * u.au, e=0.08)})"


def per_body(value: Floats, what: str, names: Sequence[str]) -> Floats:
    """Return one value for each new body, shape (k,). Raises InputError unless there are k, or one for all."""
    if value.shape not in ((), (len(names),)):
        who = repr(names[0]) if len(names) == 1 else f"the {len(names)} bodies {few(names, 3)}"
        shapes = "one number" if len(names) == 1 else f"one number, or {len(names)}"
        raise InputError(f"{what} of {who} has shape {value.shape}; expected {shapes}.")
    return np.broadcast_to(value, (len(names),))


def masses(names: Sequence[str], gm: Any, mass: Any, units: UnitSystem) -> Floats:
    """Return GM of new bodies, shape (k,), from GM or mass; 0 if neither is given.

    Raises InputError if both are given, and, naming the body, for values that are negative or not finite.
    """
    who = few(names, 3)
    if gm is not None and mass is not None:
        raise InputError(f"{who}: both gm and mass are given; expected one of them, as gm = G mass.")
    if mass is not None:
        gm = per_body(units.G * units.mass_value(mass, f"mass of {who}"), "mass", names)
    else:
        gm = per_body(units.gm_value(0.0 if gm is None else gm, f"gm of {who}"), "gm", names)
    values = state_checks.checked_array("gm", gm, names, None, units.gm)
    state_checks.check_not_negative("gm", values, names, units.gm)
    return values


def extended_radii(
    radii: Floats | None, bodies: int, names: Sequence[str], radius: Any, units: UnitSystem
) -> Floats | None:
    """Return the radii of a system with new bodies: 0 for unknown radii, None if all are unknown."""
    if radii is None and radius is None:
        return None
    value = units.length_value(0.0 if radius is None else radius, f"radius of {few(names, 3)}")
    return np.concatenate([np.zeros(bodies) if radii is None else radii, per_body(value, "radius", names)])


def split_mapping(bodies: Any) -> tuple[str, dict[str, Mapping[str, Any]]]:
    """Return the name of the primary, and the other entries, of the argument of `System.from_elements`; checks keys."""
    if not isinstance(bodies, Mapping) or not bodies:
        raise InputError(
            f"from_elements got {shown(bodies)}; expected a dict of bodies by name, as in {EXAMPLE}."
        )
    for name, given in bodies.items():
        if not isinstance(given, Mapping):
            raise InputError(
                f"{name!r} is {shown(given)}; expected a dict of gm or mass and elements, as in {EXAMPLE}."
            )
    first, *others = bodies
    checked_names([first])
    for key in bodies[first]:
        if key not in OF_A_BODY:
            raise InputError(
                f"{first!r} is the first body and so the primary, but has {key!r}; expected only some of "
                f"{', '.join(OF_A_BODY)}. Put the body that the others orbit first."
            )
    for name in others:
        _check_keys(name, [key for key in bodies[name] if key not in (*OF_A_BODY, "primary", "frame", "v")])
    return first, {name: bodies[name] for name in others}


def primary(name: str, given: Mapping[str, Any], units: UnitSystem) -> tuple[float, float | None]:
    """Return GM and radius of the first body of `System.from_elements`. Raises InputError if it has no mass."""
    if given.get("gm") is None and given.get("mass") is None:
        raise InputError(f"{name!r} is the primary and needs gm or mass, as in {EXAMPLE}.")
    gm = float(masses([name], given.get("gm"), given.get("mass"), units)[0])
    if gm == 0.0:
        raise InputError(
            f"gm of {shown(name)} is {with_unit(shown(gm), units.gm)}; expected > 0, as the other bodies orbit it."
        )
    if given.get("radius") is None:
        return gm, None
    what = f"radius of {shown(name)}"
    return gm, state_checks.scalar(units.length_value(given["radius"], what), what, units.length)


def primary_name(names: Sequence[str], gm: Floats, name: str | None) -> str:
    """Return `name`, or if it is None the only massive body. Raises InputError if there are several."""
    if name is not None:
        return name
    heavy = _heavy(names, gm)
    if len(heavy) > 1:
        raise InputError(f"several bodies have mass; choose the primary by primary=..., one of {few(heavy)}.")
    return heavy[0]


def new_states(
    system: System,
    names: Sequence[str],
    gm: Floats,
    around: str | None,
    frame: str | None,
    given: Mapping[str, Any],
) -> State:
    """Return positions and velocities (k, 3), in the system's axes and units, from the arguments of `System.add`."""
    units = system.units
    given = {key: value for key, value in given.items() if value is not None}
    if "v" in given:
        return _from_state(system, names, gm, around, frame, given)
    _check_keys(names[0], list(given))
    around = primary_name(system.names, system.values.gm, around)
    two_body_gm = _two_body_gm(system, names, gm, around)
    floats = {key: per_body(_element(key, value, names, system), key, names) for key, value in given.items()}
    q, v = kepler.state_from_elements(two_body_gm, **floats, names=names)
    frame = kepler.default_frame(units, (*system.names, *names)) if frame is None else frame
    return _placed(system, gm, around, kepler.from_frame(q, frame), kepler.from_frame(v, frame))


def centre_of_several(names: Sequence[str], around: str) -> str | None:
    """Return "barycentre", "barycenter" or "jacobi" if `around` is one of these; None if it names a body."""
    known = isinstance(around, str) and around not in names and around.lower() in (*BARYCENTRIC, JACOBI)
    return around.lower() if known else None


def _two_body_gm(system: System, names: Sequence[str], gm: Floats, around: str) -> Floats:
    """Return the total GM of each new body and its primary, shape (k,)."""
    several, masses = centre_of_several(system.names, around), masses_at(system)
    if several is not None:
        total = masses.sum()
        return np.asarray(total + (np.cumsum(gm) if several == JACOBI else np.full(len(gm), gm.sum())))
    place = system.index(around)
    if system.values.gm[place] == 0.0:
        raise InputError(
            f"{few(names, 3)}: the primary {system.names[place]!r} has no mass, so nothing can orbit it. "
            f"Choose one of {few(_heavy(system.names, system.values.gm))}."
        )
    return np.asarray(masses[place] + gm)


def _placed(system: System, gm: Floats, around: str, q: Floats, v: Floats) -> State:
    """Return positions and velocities (k, 3) in the system, from q and v relative to the primary."""
    here, masses = system.values, masses_at(system)
    several = centre_of_several(system.names, around)
    if several is None:
        place = system.index(around)
        return here.q[place] + q, here.v[place] + v
    total = masses.sum()
    if several == JACOBI:
        # Each body shifts the centre of mass that the next one orbits.
        share = (gm / (total + np.cumsum(gm)))[:, None]
        shifts = [np.cumsum(share * x, axis=0) - share * x for x in (q, v)]
    else:
        # q and v are relative to the centre of mass of all, which the new bodies shift from that of the old ones.
        shifts = [np.broadcast_to(gm @ x / total, x.shape) for x in (q, v)]
    centre = [centre_of(masses, x) for x in (here.q, here.v)]
    return centre[0] + shifts[0] + q, centre[1] + shifts[1] + v


def from_ephemeris(epoch: Time, bodies: Sequence[str] | None, apart_in: str | None = None) -> dict[str, Any]:
    """Return the arguments of `System` for bodies of DE440, relative to the Solar System barycentre.

    apart_in : the model in which Earth and Moon are apart, so that their barycentre is no body; None for none
    """
    if isinstance(bodies, str) or not isinstance(bodies, Iterable | None) or getattr(bodies, "shape", None) == ():
        example = bodies if isinstance(bodies, str) else "Sun"
        raise InputError(f"bodies is {shown(bodies)}; expected a sequence of names, such as [{example!r}].")
    names = [ephemeris.canonical_name(name) for name in (ephemeris.SOLAR_SYSTEM if bodies is None else bodies)]
    if apart_in is not None and BOTH in names:
        raise InputError(
            f"bodies has {BOTH!r}, but in the model {apart_in!r} the Earth and the Moon are apart; expected 'Earth' "
            "and 'Moon'. The figures of both act on their orbits."
        )
    pair = {"Earth", "Moon"}
    if 0 < len(pair & set(names)) < 2:
        (there,), (missing,) = pair & set(names), pair - set(names)
        raise InputError(
            f"bodies has {there!r} without {missing!r}, but each perturbs the other strongly. Name both"
            + (f", or {BOTH!r} for the two as one body." if apart_in is None else ", or neither.")
        )
    if "Earth" in names and BOTH in names:
        raise InputError(
            "bodies has 'Earth', 'Moon' and 'Earth-Moon barycenter'; the barycentre already represents the other two. "
            "Name either the pair or the barycentre."
        )
    gm, q, v = ephemeris.states(names, epoch.jd1, epoch.jd2)
    return {"names": names, "gm": gm, "q": q, "v": v, "epoch": epoch}


def is_about_ssb(origin: str) -> bool:
    """Return whether an origin is "ssb", and not the barycentre of the bodies. Raises UnknownNameError for others."""
    known = origin.lower() if isinstance(origin, str) else ""
    if known in BARYCENTRIC or known == SSB:
        return known == SSB
    raise UnknownNameError(
        f"there is no origin {shown(origin)}; expected 'barycentre', of the selected bodies, or 'ssb', the Solar "
        "System barycentre. For another, move the bodies: system.replaced(q=..., v=...)"
    )


def united(one: System, other: System) -> dict[str, Any]:
    """Return the changed arguments of `one` when the bodies of `other` are added to it.

    Raises EpochError and InputError if the two systems do not match.
    """
    if one.units != other.units:
        raise InputError(f"the systems are in {one.units.name} and {other.units.name}; expected the same units.")
    here, there = one.epoch, other.epoch
    if (here is None) != (there is None):
        raise EpochError(
            "one system has an epoch and the other does not; expected both or neither: use replaced(epoch=...)."
        )
    if here is not None and there is not None and abs((here - there).to_value(u.ns)) > SAME_EPOCH_NS:
        raise EpochError(
            f"the epochs of the systems are {here.isot} and {there.isot} TDB; expected the same. Propagate one to the "
            "epoch of the other: orbits.propagate(..., until=other.epoch)[-1]."
        )
    mine, theirs = one.values, other.values
    if mine.softening != theirs.softening:
        raise InputError(f"softening is {one.softening} and {other.softening}; expected the same for all bodies.")
    places = {name: k for k, name in enumerate(one.names)}
    new, known = [], [np.zeros(len(x)) if x.radii is None else x.radii.value.copy() for x in (one, other)]
    for i, name in enumerate(other.names):
        k = places.get(name)
        if k is None:
            new.append(i)
            continue
        if any(not np.array_equal(a[k], b[i]) for a, b in zip(mine[:3], theirs[:3], strict=True)):
            apart = u.Quantity(np.linalg.norm(mine.q[k] - theirs.q[i]), one.units.length)
            remedy = (
                " Are their origins different? System.solar_system(..., origin='ssb') gives all systems the same one."
                if mine.gm[k] == theirs.gm[i] and one.units.is_physical
                else ""
            )
            raise InputError(
                f"both systems have {name!r}, {apart:.6g} apart; expected different names or exactly the same values. "
                f"Remove it from one of them.{remedy}"
            )
        if 0.0 < known[0][k] != known[1][i] > 0.0:
            sizes = " and ".join(f"{u.Quantity(x, one.units.length):.6g}" for x in (known[0][k], known[1][i]))
            raise InputError(
                f"both systems have {name!r}, with the radii {sizes}; expected the same: replaced(radii=...), "
                "or remove it from one of them."
            )
        known[0][k] = max(known[0][k], known[1][i])
    radii = None
    if one.radii is not None or other.radii is not None:
        radii = np.concatenate([known[0], known[1][new]])
    gm, q, v = (np.concatenate([a, b[new]]) for a, b in zip(mine[:3], theirs[:3], strict=True))
    return {"names": one.names + tuple(other.names[i] for i in new), "gm": gm, "q": q, "v": v, "radii": radii}


def _from_state(
    system: System,
    names: Sequence[str],
    gm: Floats,
    around: str | None,
    frame: str | None,
    given: Mapping[str, Any],
) -> State:
    if set(given) != {"q", "v"} or frame is not None:
        extra = [*given, *(["frame"] if frame is not None else [])]
        raise InputError(
            f"{few(names, 3)}: got {', '.join(extra)}; expected only q and v (position and velocity in the system's "
            "axes), or elements without v."
        )
    states = []
    shape = (len(names), 3)
    values = {"q": system.units.length_value(given["q"], "q"), "v": system.units.speed_value(given["v"], "v")}
    for what, value in values.items():
        if value.shape not in ((3,), shape):
            expected = "(3,): x, y, z" if len(names) == 1 else f"(3,) or {shape}"
            raise InputError(f"{what} of {few(names, 3)} has shape {value.shape}; expected {expected}.")
        states.append(np.broadcast_to(value, shape))
    if around is None:
        return states[0], states[1]
    return _placed(system, gm, around, states[0], states[1])


def _heavy(names: Sequence[str], gm: Floats) -> list[str]:
    return [name for name, value in zip(names, gm.tolist(), strict=True) if value > 0.0]


def _check_keys(name: str, keys: Sequence[str]) -> None:
    for key in keys:
        if key not in ELEMENTS:
            raise UnknownNameError(
                f"{name!r} has {key!r}, which is not an element; expected a, P, n or q (pericentre distance), e, inc, "
                "Omega, omega or pomega, and one of M, f, E, u, l, theta or T; or Pal's h, k, ix, iy and l; or q with "
                "v, a position and a velocity; besides gm or mass, radius, primary, frame."
            )


def _element(key: str, value: Any, names: Sequence[str], system: System) -> Floats:
    what = f"{key} of {few(names, 3)}"
    units = system.units
    if key in LENGTHS:
        return units.length_value(value, what)
    if key in ANGLES:
        return units.angle_value(value, what)
    if key == "n":
        return units.rate_value(value, what)
    if key == "T" and _is_moment(value):
        if system.epoch is None:
            raise EpochError(
                f"{what} is {value}, but the system has no epoch. Give the system an epoch, or T as a time span."
            )
        return units.time_value((as_epochs(value, what) - system.epoch).to(u.day), what)
    if key in TIMES:
        return units.time_value(value, what)
    return units.pure_value(value, what)


def _is_moment(value: Any) -> bool:
    from astropy.time import Time

    return isinstance(value, str | Time) or (isinstance(value, list) and all(isinstance(x, str) for x in value))
