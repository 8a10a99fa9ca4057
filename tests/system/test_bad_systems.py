"""Bad input as a table: each names the body and the value and is refused where the system is made."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from astropy import units as u
from astropy.time import Time

import orbits
from orbits import DIMENSIONLESS, SOLAR, System
from orbits.errors import EpochError, InputError, OrbitsError, UnknownNameError

from ..coverings import each

GOOD: dict[str, Any] = {
    "names": ["Sun", "Earth", "rock"],
    "gm": [1.0, 1e-6, 0.0],
    "q": [[0, 0, 0], [1, 0, 0], [2, 0, 0]],
    "v": [[0, 0, 0], [0, 1, 0], [0, 0.7, 0]],
    "units": DIMENSIONLESS,
}


def rows(i: int, row: list[float]) -> list[list[float]]:
    """Return the good positions with row i replaced."""
    return [row if j == i else list(map(float, r)) for j, r in enumerate(GOOD["q"])]


STATES: list[tuple[str, dict[str, Any], type[OrbitsError], str]] = [
    ("nan in q", {"q": rows(1, [math.nan, 0, 0])}, InputError, r"q of 'Earth' is \[nan, 0.0, 0.0\].*finite"),
    ("inf in q", {"q": rows(2, [0, -math.inf, 0])}, InputError, r"q of 'rock' is \[0.0, -inf, 0.0\]"),
    ("nan in v", {"v": rows(2, [0, 0, math.nan])}, InputError, r"v of 'rock' is"),
    ("inf gm", {"gm": [1.0, math.inf, 0.0]}, InputError, r"gm of 'Earth' is inf"),
    ("negative gm", {"gm": [1.0, -1e-6, 0.0]}, InputError, r"gm of 'Earth' is -1e-06.*expected >= 0"),
    ("no mass", {"gm": [0.0, 0.0, 0.0]}, InputError, r"gm of Sun, Earth, rock is 0; expected at least one"),
    ("no bodies", {"names": [], "gm": [], "q": np.empty((0, 3)), "v": np.empty((0, 3))}, InputError, "has no bodies"),
    ("two massive at one place", {"q": rows(1, [0, 0, 0])}, InputError, r"'Sun' and 'Earth' are both at \[0.0, 0.0, 0"),
    ("particle on massive", {"q": rows(2, [1, 0, 0])}, InputError, r"'Earth' and 'rock' are both at \[1.0, 0.0, 0.0\]"),
    ("minus zero is zero", {"q": rows(2, [1, -0.0, 0])}, InputError, r"'Earth' and 'rock' are both at"),
    ("gm too short", {"gm": [1.0, 0.0]}, InputError, r"gm has shape \(2,\); expected \(3,\)"),
    ("gm a number", {"gm": 1.0}, InputError, r"gm has shape \(\); expected \(3,\)"),
    ("q transposed", {"q": np.zeros((2, 3)).T}, InputError, r"q has shape \(3, 2\); expected \(3, 3\)"),
    ("v flat", {"v": np.zeros(9)}, InputError, r"v has shape \(9,\); expected \(3, 3\).*Sun, Earth, rock"),
    ("q ragged", {"q": [[0, 0, 0], [1, 0], [2, 0, 0]]}, InputError, r"q is .*expected real numbers"),
    ("q of text", {"q": "here"}, InputError, r"q is 'here'; expected real numbers"),
    ("q complex", {"q": np.full((3, 3), 1j)}, InputError, r"expected real numbers"),
    ("q with unit", {"q": GOOD["q"] * u.au}, InputError, r"q is in AU; expected a plain number, as DIMENSIONLESS"),
    ("wrong unit", {"v": GOOD["v"] * u.au, "units": SOLAR}, InputError, r"v is in AU; expected velocity in AU / d"),
    ("mass for gm", {"gm": [1, 1, 0] * u.M_sun, "units": SOLAR}, InputError, r"gm is in solMass; expected GM.*mass"),
    ("same name twice", {"names": ["Sun", "rock", "rock"]}, InputError, r"bodies 1 and 2 are both called 'rock'"),
    ("one string", {"names": "Sun"}, InputError, r"names is 'Sun'; expected a sequence of strings"),
    ("no names", {"names": None}, InputError, r"names is None"),
    ("names in a set", {"names": {"Sun", "Mars"}}, InputError, r"names is \{.*; expected a sequence of strings"),
    ("name a number", {"names": ["Sun", 3, "rock"]}, InputError, r"the name of body 1 is 3; expected a string"),
    ("empty name", {"names": ["Sun", "", "rock"]}, InputError, r"the name of body 1 is ''"),
    ("blank at the end", {"names": ["Sun", "Earth ", "rock"]}, InputError, r"the name of body 1 is 'Earth '"),
    ("control character", {"names": ["Sun", "a\0b", "rock"]}, InputError, r"printable characters"),
    ("long name", {"names": ["Sun", "x" * 129, "rock"]}, InputError, r"1 to 128 printable"),
    ("too few names", {"names": ["Sun", "rock"]}, InputError, r"gm has shape \(3,\); expected \(2,\)"),
    ("negative softening", {"softening": -1e-3}, InputError, r"softening is -0.001"),
    ("nan softening", {"softening": math.nan}, InputError, r"softening is nan.*finite"),
    ("softening per body", {"softening": [1, 1, 1]}, InputError, r"softening is \[1.0, 1.0, 1.0\].*one finite"),
    ("negative radius", {"radii": [1, -1, 0]}, InputError, r"radii of 'Earth' is -1.0"),
    ("nan radius", {"radii": [1, 1, math.nan]}, InputError, r"radii of 'rock' is nan"),
    ("radii too few", {"radii": [1, 1]}, InputError, r"radii has shape \(2,\)"),
    ("no such units", {"units": "SI"}, InputError, r"units is 'SI'; expected orbits.SOLAR"),
    ("epoch without days", {"epoch": "J2000"}, EpochError, r"epoch is 'J2000', but DIMENSIONLESS has no unit of time"),
    ("no epoch", {"epoch": "today", "units": SOLAR}, EpochError, r"epoch is 'today'; expected a time"),
]  # fmt: skip


@each(("changes", "error", "message"), [case[1:] for case in STATES])
def test_what_is_no_system_is_refused(changes: dict[str, Any], error: type[OrbitsError], message: str) -> None:
    assert len(System(**GOOD)) == 3
    with pytest.raises(error, match=message) as caught:
        System(**{**GOOD, **changes})
    assert caught.value.exit_code == 2


def test_the_coincident_pair_is_found_among_many_particles_at_one_place() -> None:
    # Massless particles do not feel each other: any number of them may share a place.
    n = 1000
    names = [f"p{i}" for i in range(n)]
    q = np.ones((n, 3))
    q[0] = 0.0
    gm = np.zeros(n)
    gm[0] = 1.0
    system = System(names, gm, q, np.zeros((n, 3)), units=DIMENSIONLESS)
    with pytest.raises(InputError, match="'p0' and 'p617' are both at"):
        system.replaced(q=np.where(np.arange(n)[:, None] == 617, 0.0, q))


def test_softened_bodies_may_be_at_one_place() -> None:
    system = System(**{**GOOD, "q": np.zeros((3, 3))}, softening=0.1)
    assert system.softening == 0.1
    with pytest.raises(InputError, match="are both at"):
        system.replaced(softening=0.0)


def sun() -> System:
    return System.from_elements({"Sun": {"mass": 1 * u.M_sun}}, epoch="J2000")


def add(**given: Any) -> Callable[[], System]:
    return lambda: sun().add("rock", **given)


def planets(*bodies: str) -> Callable[[], System]:
    return lambda: System.solar_system(bodies=bodies)


def elements(bodies: Any, **more: Any) -> Callable[[], System]:
    return lambda: System.from_elements(bodies, **more)


MASS = {"mass": 1.0}
MAKERS: list[tuple[str, Callable[[], System], type[OrbitsError], str]] = [
    ("e < 0", add(a=1, e=-0.1), InputError, r"rock: eccentricity e = -0.1"),
    ("e = 1", add(a=1, e=1), InputError, r"rock: e = 1 exactly: a parabola"),
    ("a < 0 for an ellipse", add(a=-1, e=0.1), InputError, r"rock: "),
    ("nan a", add(a=math.nan), InputError, r"rock: a is nan"),
    ("inf M", add(a=1, M=math.inf), InputError, r"rock: M is inf"),
    ("no size", add(e=0.1), InputError, r"rock: the size of the orbit is given by nothing; expected exactly one"),
    ("two sizes", add(a=1, P=365), InputError, r"rock: the size of the orbit is given by a and P"),
    ("two places", add(a=1, M=0, f=0), InputError, r"rock: the position on the orbit is given by M and f"),
    ("two pericentres", add(a=1, omega=0, pomega=0), InputError, r"rock: .*omega and pomega"),
    ("negative inclination", add(a=1, inc=-5 * u.deg), InputError, r"rock: inc = "),
    ("unknown element", add(a=1, i=5), UnknownNameError, r"'rock' has 'i', which is not an element; expected a, P"),
    ("wrong unit of a", add(a=1 * u.kg), InputError, r"a of rock is in kg; expected length"),
    ("wrong unit of M", add(a=1, M=1 * u.day), InputError, r"M of rock is in d; expected angle"),
    ("e with unit", add(a=1, e=1 * u.au), InputError, r"e of rock is in AU; expected no unit"),
    ("P in au", add(P=1 * u.au), InputError, r"P of rock is in AU; expected time"),
    ("T no moment", add(a=1, T="soon"), EpochError, r"T of rock is 'soon'; expected a time"),
    ("a twice", add(a=[1, 2]), InputError, r"a of 'rock' has shape \(2,\); expected one number"),
    ("gm and mass", add(a=1, gm=0, mass=0), InputError, r"rock: both gm and mass are given"),
    ("negative mass", add(a=1, mass=-1), InputError, r"gm of 'rock' is -0.000295"),
    ("no such primary", add(a=1, primary="sunn"), UnknownNameError, r"there is no body 'sunn'.*Did you mean 'Sun'"),
    ("no such frame", add(a=1, frame="galactic"), UnknownNameError, r"no frame 'galactic'"),
    ("negative radius", add(a=1, radius=-1), InputError, r"radii of 'rock' is -1.0"),
    ("name taken", lambda: sun().add("Sun", a=1), InputError, r"bodies 0 and 1 are both called 'Sun'"),
    ("on the primary", add(q=[0, 0, 0], v=[0, 0, 0]), InputError, r"'Sun' and 'rock' are both at"),
    ("v without q", add(v=[0, 0, 0]), InputError, r"rock: got v; expected only q and v"),
    ("v with elements", add(v=[0, 0, 0], q=[1, 0, 0], e=0.1), InputError, r"rock: got v, q, e"),
    ("v with frame", add(v=[0, 0, 0], q=[1, 0, 0], frame="icrf"), InputError, r"rock: got v, q, frame"),
    ("q with v too short", add(v=[0, 0, 0], q=[1, 0]), InputError, r"q of rock has shape \(2,\); expected \(3,\)"),
    ("massless primary", lambda: sun().add("a", a=1).add("b", primary="a", a=0.1), InputError,
     r"b: the primary 'a' has no mass.*Choose one of Sun"),
    ("which primary", lambda: sun().add("A", a=1, mass=1e-3).add("b", a=1), InputError, r"by primary=\.\.\., one of"),
    ("T without epoch", lambda: sun().replaced(epoch=None).add("c", a=1, T="J2000"), EpochError, r"T of c is J2000"),
    ("three of two", lambda: sun().add(["a", "b"], a=[1, 2, 3]), InputError, r"a of the 2 bodies a, b has shape"),
    ("bad second of two", lambda: sun().add(["a", "b"], a=[1, 2], e=[0, -1]), InputError, r"b: eccentricity e = -1"),
    ("no mapping", elements(["Sun"]), InputError, r"from_elements got \['Sun'\]; expected a dict of bodies"),
    ("empty mapping", elements({}), InputError, r"from_elements got {}"),
    ("value no mapping", elements({"Sun": 1.0}), InputError, r"'Sun' is 1.0; expected a dict"),
    ("primary without mass", elements({"Sun": {}}), InputError, r"'Sun' is the primary and needs gm or mass"),
    ("primary massless", elements({"Sun": {"gm": 0}}), InputError, r"gm of 'Sun' is 0.0.*expected > 0"),
    ("primary nan", elements({"Sun": {"gm": math.nan}}), InputError, r"gm of 'Sun' is nan"),
    ("primary with orbit", elements({"Sun": {"gm": 1, "a": 1}}), InputError, r"'Sun' is the first body.*has 'a'"),
    ("unknown element", elements({"Sun": MASS, "x": {"sma": 1}}), UnknownNameError, r"'x' has 'sma', which is not"),
    ("name as element", elements({"Sun": MASS, "x": {"name": 1}}), UnknownNameError, r"'x' has 'name'"),
    ("later primary", elements({"Sun": MASS, "x": {"a": 1, "primary": "y"}, "y": {"a": 2}}), UnknownNameError,
     r"there is no body 'y'"),
    ("key no name", elements({1: MASS}), InputError, r"the name of body 0 is 1"),
    ("Earth alone", planets("Sun", "Earth"), InputError, r"bodies has 'Earth' without 'Moon'"),
    ("Moon alone", planets("Sun", "Moon"), InputError, r"bodies has 'Moon' without 'Earth'"),
    ("Earth twice", planets("Sun", "Earth", "Moon", "EMB"), InputError, r"'Earth', 'Moon' and 'Earth-Moon barycenter'"),
    ("planet twice", planets("Sun", "Mars", "mars barycenter"), InputError, r"both called 'Mars'"),
    ("no such planet", planets("Sun", "Jupitr"), UnknownNameError, r"no body 'Jupitr'; did you mean 'Jupiter'"),
    ("bodies a string", lambda: System.solar_system(bodies="Sun"), InputError, r"bodies is 'Sun'; expected a sequence"),
    ("no bodies", planets(), InputError, r"the system has no bodies"),
    ("outside DE440", lambda: System.solar_system("1066-10-14"), EpochError, r"1066-10-1. .*outside DE440"),
    ("epoch nan", lambda: System.solar_system(math.nan), EpochError, r"epoch is nan"),
    ("epoch wrong", lambda: System.solar_system("2000-02-31"), EpochError, r"epoch is '2000-02-31'"),
    ("unknown to remove", lambda: sun().remove("Son"), UnknownNameError, r"no body 'Son'.*Did you mean 'Sun'"),
    ("nothing left", lambda: sun().add("x", a=1).remove("Sun"), InputError, r"gm of x is 0; expected at least one"),
    ("unknown value", lambda: sun().replaced(mass=3), InputError, r"replaced\(\) got 'mass'; expected some of names"),
    ("units replaced", lambda: sun().replaced(units=SOLAR), InputError, r"replaced\(\) got 'units'"),
]  # fmt: skip


@each(("make", "error", "message"), [case[1:] for case in MAKERS])
def test_what_cannot_be_made_is_refused(make: Callable[[], System], error: type[OrbitsError], message: str) -> None:
    with pytest.raises(error, match=message) as caught:
        make()
    assert caught.value.exit_code == 2


CATALOGUE: list[tuple[str, Callable[[], System], type[OrbitsError], str]] = [
    ("other epoch", lambda: System.solar_system(), EpochError, r"MJD 51544.5 TDB, but the elements of 'Ceres' "
     r"are of MJD 59800 TDB.*propagate_to_epoch=True"),
    ("UTC for TDB", lambda: System.solar_system(Time("2022-08-09", scale="utc")), EpochError, r"MJD 59800.0008 TDB"),
    ("no epoch", lambda: sun().replaced(epoch=None), InputError, r"the system has no epoch"),
    ("no Sun", lambda: System.solar_system("2022-08-09", ["Jupiter", "Saturn"]), UnknownNameError, r"no 'Sun' among J"),
    ("already there", lambda: System.solar_system("2022-08-09").add_particles(orbits.asteroids(names=["Ceres"])),
     InputError, r"both called 'Ceres'"),
]  # fmt: skip


@pytest.mark.parametrize(("make", "error", "message"), [case[1:] for case in CATALOGUE], ids=[c[0] for c in CATALOGUE])
def test_asteroids_that_do_not_fit_are_refused(
    make: Callable[[], System], error: type[OrbitsError], message: str
) -> None:
    system, ceres = make(), orbits.asteroids(names=["Ceres"])
    with pytest.raises(error, match=message):
        system.add_particles(ceres)


def test_particles_that_are_no_catalogue_are_refused() -> None:
    with pytest.raises(InputError, match=r"the catalogue is a list; expected one from orbits.asteroids"):
        System.solar_system("2022-08-09").add_particles(["Ceres"])  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("primary", "frame", "error", "message"),
    [
        ("Venus", None, UnknownNameError, r"there is no primary 'Venus'"),
        ("rock", None, InputError, r"'rock' has no mass"),
        ("Sun", "galactic", UnknownNameError, r"no frame 'galactic'"),
        (None, None, InputError, r"several bodies have mass; choose the primary by primary=..., one of Sun, Earth"),
    ],
)
def test_elements_about_nothing_are_refused(
    primary: str | None, frame: str | None, error: type[OrbitsError], message: str
) -> None:
    with pytest.raises(error, match=message):
        System(**GOOD).elements(primary, frame)


def test_states_without_elements_name_the_body() -> None:
    system = System(**GOOD)
    with pytest.raises(InputError, match="rock: the motion is straight"):
        system.replaced(v=np.array([[0, 0, 0], [0, 1, 0], [1, 0, 0]])).elements("Sun")
    massless_first = system.replaced(gm=[0, 1, 1], names=["x", "y", "z"])
    with pytest.raises(InputError, match="a first body with mass, but 'x' has none"):
        massless_first.elements("jacobi")
