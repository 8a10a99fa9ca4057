"""Whatever a system is asked to be made of, it is made or refused in words."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from astropy import units as u
from hypothesis import strategies as st

import orbits
from orbits import DIMENSIONLESS, SOLAR, System
from orbits.errors import InputError
from tests.campaigns import ODDITIES, campaign, junk, works_or_says_why

from ..coverings import each

GOOD = {
    "names": ["Sun", "Earth", "rock"],
    "gm": [1.0, 1e-6, 0.0],
    "q": [[0, 0, 0], [1, 0, 0], [2, 0, 0]],
    "v": [[0, 0, 0], [0, 1, 0], [0, 0.7, 0]],
}
SUN = System.from_elements({"Sun": {"mass": 1 * u.M_sun}}, epoch="J2000")
THREE = System(**GOOD, units=DIMENSIONLESS)
OF_A_BODY = (
    "a", "P", "n", "q", "e", "inc", "Omega", "omega", "pomega", "M", "f", "E", "u", "l", "theta", "T", "h", "k", "ix",
    "iy", "gm", "mass", "radius", "primary", "frame", "v", "nonsense",
)  # fmt: skip


@campaign(
    40,
    3000,
    changes=st.dictionaries(
        st.sampled_from([*GOOD, "epoch", "units", "radii", "softening"]), junk, min_size=1, max_size=2
    ),
    units=st.sampled_from([SOLAR, DIMENSIONLESS]),
)
def test_any_states_are_a_system_or_refused(changes: dict[str, Any], units: orbits.UnitSystem) -> None:
    works_or_says_why(lambda: System(**{**GOOD, "units": units, **changes}))


@campaign(
    40,
    3000,
    name=st.just("x") | st.just(["x", "y"]) | junk,
    given=st.dictionaries(st.sampled_from(OF_A_BODY), junk, max_size=4),
)
def test_any_body_is_added_or_refused(name: Any, given: dict[str, Any]) -> None:
    works_or_says_why(lambda: SUN.add(name, **given))


@campaign(
    20,
    2000,
    bodies=st.dictionaries(
        st.sampled_from(["Sun", "p"]) | st.integers() | st.none(),
        junk | st.dictionaries(st.sampled_from(["mass", "gm", "a", "e", "radius", "primary"]), junk, max_size=3),
        max_size=3,
    ),
    more=st.dictionaries(st.sampled_from(["epoch", "units", "frame", "softening"]), junk, max_size=1),
)
def test_any_elements_are_a_system_or_refused(bodies: dict[Any, Any], more: dict[str, Any]) -> None:
    works_or_says_why(lambda: System.from_elements(bodies, **more))


USES: dict[str, Callable[[Any], Any]] = {
    "from_elements": System.from_elements,
    "solar_system": lambda x: System.solar_system(epoch=x, bodies=["Sun", "Mars"]),
    "bodies": lambda x: System.solar_system(bodies=x),
    "from_catalogue": System.from_catalogue,
    "read_mpcorb": orbits.read_mpcorb,
    "read_sbdb": orbits.read_sbdb,
    "add_particles": SUN.add_particles,
    "remove": THREE.remove,
    "replaced": lambda x: THREE.replaced(q=x),
    "index": THREE.index,
    "primary": lambda x: THREE.elements(primary=x),
    "frame": lambda x: THREE.elements(primary="Sun", frame=x),
    "asteroids": orbits.asteroids,
    "names": lambda x: orbits.asteroids(names=x),
    "numbers": lambda x: orbits.asteroids(numbers=x),
    "classes": lambda x: orbits.asteroids(classes=x),
    "brighter_than": lambda x: orbits.asteroids(brighter_than=x),
    "units": lambda x: orbits.UnitSystem(x, u.au, u.day, u.M_sun),
    "unit": lambda x: orbits.UnitSystem("mine", x, u.day, u.M_sun),
    "G": lambda x: orbits.UnitSystem("mine", u.au, u.day, u.M_sun, x),
    "stages": lambda x: orbits.Gauss(stages=x),
    "variant": lambda x: orbits.methods.SymplecticEuler(variant=x),
    "base": orbits.methods.Composition,
    "order": lambda x: orbits.methods.Composition(orbits.StormerVerlet(), order=x),
    "scheme": lambda x: orbits.methods.Composition(orbits.StormerVerlet(), order=4, scheme=x),
    "tableau": lambda x: orbits.methods.VPRK(a=x, b=[1.0]),
    "from_rebound": orbits.rebound.from_rebound,
    "to_rebound": orbits.rebound.to_rebound,
    "run_from_rebound": orbits.rebound.run_from_rebound,
    "CloserThan": orbits.events.CloserThan,
    "FartherThan": orbits.events.FartherThan,
    "EnergyErrorAbove": orbits.events.EnergyErrorAbove,
    "WallTimeOver": orbits.events.WallTimeOver,
    "Heartbeat": orbits.Heartbeat,
    "Heartbeat.to": lambda x: orbits.Heartbeat(60.0, to=x),
    "wall_time": lambda x: orbits.propagate([], wall_time=x),
}


@campaign(15, 1500, x=junk)
def test_any_argument_is_taken_or_refused(x: Any) -> None:
    for use in USES.values():
        works_or_says_why(lambda use=use: use(x))


@each("use", USES)
def test_each_oddity_is_taken_or_refused(use: str) -> None:
    for x in (*ODDITIES, *([x] for x in ODDITIES), ODDITIES):
        works_or_says_why(lambda x=x: USES[use](x))


@pytest.mark.parametrize(
    ("use", "x", "message"),
    [
        ("bodies", 3, "bodies is 3; expected a sequence of names, such as"),
        ("numbers", [10**400], "numbers contains one above 10"),
        ("brighter_than", "bright", "brighter_than = 'bright'; expected an absolute magnitude"),
        ("unit", 10**400, "expected an astropy unit such as u.km"),
        ("G", 10**400, "expected a number"),
        ("variant", {}, "SymplecticEuler has the variants"),
        ("order", {}, "an even order above 2, got {}"),
        ("tableau", [[2.0**53 + 2]], "coefficients of size .* expected at most 1000000"),
    ],
)
def test_what_this_campaign_found_is_told_in_words(use: str, x: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        USES[use](x)


@pytest.mark.parametrize("names", ["Sun", 3, 3 * u.au, None])
def test_names_are_a_sequence(names: Any) -> None:
    with pytest.raises(InputError, match=r"names is .*; expected a sequence of strings"):
        System(**{**GOOD, "names": names})


def test_no_names_are_nothing_to_add() -> None:
    with pytest.raises(InputError, match=r"add\(\) got no names"):
        SUN.add([], a=1)
