"""What one reaches for: a body by its name in any case, two systems as one, an origin that several systems share."""

from __future__ import annotations

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits import DIMENSIONLESS, SOLAR, System
from orbits.errors import EpochError, InputError, UnknownNameError
from orbits.system import Body

FOUR = ["Sun", "Earth", "Moon", "Jupiter"]


def solar(*bodies: str, **options: str) -> System:
    return System.solar_system("2026-01-01", bodies=bodies or None, **options)


def plain(names: list[str], **options: object) -> System:
    count = len(names)
    return System(names, np.ones(count), np.eye(3)[:count], np.eye(3)[:count], units=DIMENSIONLESS, **options)


def test_a_body_of_a_system_is_a_value_with_units() -> None:
    system = System.from_elements(
        {"Sun": {"mass": 1 * u.M_sun}, "Ceres": {"a": 2.77 * u.au, "radius": 470 * u.km}}, epoch="J2000"
    )
    ceres = system["Ceres"]
    assert isinstance(ceres, Body)
    assert (ceres.name, ceres.gm, ceres.mass) == ("Ceres", 0 * u.au**3 / u.day**2, 0 * u.M_sun)
    assert np.array_equal(ceres.q, system.q[1])
    assert np.array_equal(ceres.v, system.v[1])
    assert ceres.radius == system.radii[1]
    assert system["Sun"].mass.to_value(u.M_sun) == pytest.approx(1.0, rel=1e-15)
    assert system[-1].name == "Ceres"
    assert [body.name for body in system] == list(system.names)
    assert repr(ceres).startswith("Body(Ceres; gm = 0 AU3 / d2; q = [")
    assert plain(["star"])["star"].radius is None


def test_bodies_are_equal_where_their_names_and_values_are() -> None:
    system = plain(["a", "b"], radii=[0.1, 0.1])
    body = system["a"]
    assert body == system[0] == plain(["a", "c"], radii=[0.1, 0.1])["a"]
    assert all(body in system for body in system)
    others = [
        system["b"],
        plain(["a"])["a"],  # no radius is known
        system.replaced(q=system.values.q + 1e-15)["a"],
        System(["a"], [1.0], [[1.0, 0, 0]], [[1.0, 0, 0]], units=SOLAR, radii=[0.1])["a"],
        plain(["A"], radii=[0.1])["A"],
    ]
    for other in others:
        assert body != other
        assert other != body
    assert [other in system for other in others] == [True, False, False, False, False]
    assert body != "a"


@pytest.mark.parametrize(("key", "error"), [(2, IndexError), (-3, IndexError), (True, InputError), (None, InputError)])
def test_what_names_no_body_is_refused(key: object, error: type[Exception]) -> None:
    with pytest.raises(error, match=r"bodies|expected a name"):
        plain(["a", "b"])[key]  # type: ignore[index]


def test_the_case_of_a_name_does_not_matter_where_one_is_asked_for() -> None:
    system = solar("Sun", "Jupiter").add("Ceres", primary="SUN", a=2.77 * u.au)
    assert system == solar("Sun", "Jupiter").add("Ceres", primary="Sun", a=2.77 * u.au)
    assert "sun" in system
    assert system["cERES"].name == "Ceres"
    assert system.remove("ceres") == solar("Sun", "Jupiter")
    assert np.array_equal(system.elements("sun").a, system.elements("Sun").a)
    assert system.elements("sun").primary == "Sun"
    assert system.elements("Sun")["ceres"].names == ("Ceres",)
    assert system.to_table(bodies=["ceres"])["body"] == ["Ceres"]
    with pytest.raises(InputError, match="both called 'Ceres'"):
        system.to_table(bodies=["ceres", "Ceres"])
    stop = orbits.events.FartherThan(9.0, "SUN")
    run = orbits.propagate(system, "STORMER-VERLET", dt=1, duration=4, stop=stop, approaches=True)
    assert run["ceres"].name == "Ceres"
    assert run.closest_approaches()["CERES"] == run.closest_approaches()["Ceres"]


def test_a_name_that_two_bodies_have_but_for_the_case_is_ambiguous_unless_it_is_exact() -> None:
    system = plain(["Sun", "SUN", "dust"])
    assert system.index("SUN") == 1
    assert "sun" not in system
    with pytest.raises(UnknownNameError, match=r"body 'sun' could be 'Sun' or 'SUN'; write it exactly as one of them"):
        system["sun"]


@pytest.mark.parametrize("name", ["Earth", "moon"])
def test_the_earth_is_answered_with_the_barycentre_that_is_there(name: str) -> None:
    with pytest.raises(UnknownNameError, match=r"'Earth-Moon barycenter' stands for both; .*'Earth', 'Moon'"):
        solar()[name]
    with pytest.raises(UnknownNameError, match="'Earth-Moon barycenter' stands for"):
        solar().elements(primary=name)
    with pytest.raises(UnknownNameError, match=r"there is no body 'Earth'; expected one of Sun, Jupiter\.$"):
        solar("Sun", "Jupiter").index("Earth")


def test_the_barycentre_of_the_bodies_chosen_is_not_that_of_the_solar_system() -> None:
    of_four, ssb = solar(*FOUR), solar(*FOUR, origin="ssb")
    offset = np.linalg.norm((of_four["Sun"].q - ssb["Sun"].q).to_value(u.km))
    assert offset == pytest.approx(711_906, abs=1)  # what the docs say, in km
    assert np.linalg.norm(ssb.centre_of_mass().to_value(u.km)) == pytest.approx(offset, rel=1e-12)
    assert np.linalg.norm((solar()["Sun"].q - solar(origin="SSB")["Sun"].q).to_value(u.km)) == pytest.approx(116, abs=1)
    # Relative to one another the bodies are where they were, to the rounding of the shift.
    assert np.abs(np.diff(of_four.values.q, axis=0) - np.diff(ssb.values.q, axis=0)).max() < 1e-15
    assert solar(*FOUR, origin="barycenter") == of_four
    for wrong in ("sun", None, 3):
        with pytest.raises(UnknownNameError, match=r"there is no origin .* 'ssb', the Solar System barycentre"):
            solar(origin=wrong)  # type: ignore[arg-type]


def test_about_the_solar_systems_barycentre_a_body_is_where_it_is_whatever_comes_with_it() -> None:
    assert np.array_equal(solar("Sun", "Jupiter", origin="ssb")["Jupiter"].q, solar(origin="ssb")["Jupiter"].q)
    asteroids = orbits.asteroids(2)
    system = System.from_catalogue(asteroids, bodies=["Sun", "Jupiter"], origin="ssb")
    alone = System.solar_system(system.epoch, bodies=["Sun", "Jupiter"], origin="ssb")
    assert np.array_equal(system["Sun"].q, alone["Sun"].q)


def test_systems_about_one_origin_are_joined_and_a_body_that_both_have_is_one() -> None:
    both = solar("Sun", "Jupiter", origin="ssb") + solar("Saturn", "Sun", origin="ssb")
    assert both == solar("Sun", "Jupiter", "Saturn", origin="ssb")
    with_radii = plain(["a"], radii=[0.5]) + plain(["b", "c"]).replaced(q=np.eye(3)[1:])
    assert with_radii.radii is not None
    assert with_radii.radii.value.tolist() == [0.5, 0.0, 0.0]
    one, other = (plain(["a"], radii=[size]) for size in (0.5, 0.6))
    assert (plain(["a"]) + one) == (one + plain(["a"])) == one
    with pytest.raises(InputError, match=r"both systems have 'a', with the radii 0\.5 and 0\.6"):
        _ = one + other


@pytest.mark.parametrize(
    ("other", "error", "message"),
    [
        (lambda s: solar("Sun", "Saturn"), InputError, r"both systems have 'Sun', .* apart; .*origin='ssb'"),
        (lambda s: s.replaced(epoch="2026-01-02"), EpochError, r"2026-01-01.* and 2026-01-02.*until=other.epoch"),
        (lambda s: s.replaced(epoch=None), EpochError, "one system has an epoch"),
        (lambda s: s.replaced(softening=1e-3), InputError, "softening is 0.0 AU and 0.001 AU"),
        (lambda s: plain(["a"]), InputError, "in SOLAR and DIMENSIONLESS; expected the same units"),
        (lambda s: orbits.asteroids(1), InputError, r"expected another System.*add_particles"),
        (lambda s: 1, InputError, "expected another System"),
        (
            lambda s: System(["twin"], [1], s.q[:1], s.v[:1], epoch=s.epoch, units=SOLAR),
            InputError,
            "'Sun' and 'twin' are both at",
        ),
    ],
    ids=["origins", "epochs", "no epoch", "softening", "units", "catalogue", "number", "place"],
)
def test_systems_that_do_not_go_together_are_not_joined(other, error, message) -> None:  # type: ignore[no-untyped-def]
    system = solar("Sun", "Jupiter")
    with pytest.raises(error, match=message):
        _ = system + other(system)
