"""Systems from elements, from DE440 and from the catalogue of asteroids."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from astropy import constants
from astropy import units as u
from astropy.time import Time

import orbits
from orbits import DIMENSIONLESS, SOLAR, System, UnitSystem
from orbits.elements import OBLIQUITY, elements_from_state, state_from_elements, two_body
from orbits.resources import data_path

EPS = 2.0**-52


def kepler(**elements: object) -> System:
    return System.from_elements({"star": {"gm": 1}, "planet": elements}, units=DIMENSIONLESS)


def test_a_circular_orbit_of_pure_numbers() -> None:
    system = kepler(a=1)
    np.testing.assert_array_equal(system.values.q, [[0, 0, 0], [1, 0, 0]])
    np.testing.assert_array_equal(system.values.v, [[0, 0, 0], [0, 1, 0]])
    assert system.gm.value.tolist() == [1, 0]
    assert system.epoch is None


def test_the_sun_is_one_solar_mass_of_de440() -> None:
    assert System.from_elements({"Sun": {"mass": 1 * u.M_sun}}).values.gm[0] == SOLAR.G
    assert System.from_elements({"Sun": {"gm": constants.GM_sun}}).values.gm[0] == pytest.approx(SOLAR.G, rel=4e-10)


def test_all_ways_to_give_an_orbit_agree() -> None:
    reference = kepler(a=2, e=0.3, inc=0.4, Omega=0.5, omega=0.6, M=0.7)
    got = elements_from_state(reference.values.q[1], reference.values.v[1], 1.0)
    inclined = {"e": 0.3, "inc": 0.4, "Omega": 0.5}
    others = [
        kepler(P=2 * math.pi * math.sqrt(8), **inclined, omega=0.6, M=0.7),
        kepler(q=1.4, **inclined, pomega=1.1, M=0.7),
        kepler(a=2, **inclined, omega=0.6, f=float(got.f)),
        kepler(a=2, **inclined, omega=0.6, E=float(got.E)),
        kepler(a=2, **inclined, omega=0.6, l=1.8),
        kepler(a=2, **inclined, omega=0.6, theta=float(got.theta)),
        kepler(a=2, **inclined, omega=0.6, T=-0.7 * math.sqrt(8)),
        kepler(a=2, e=0.3, inc=math.degrees(0.4) * u.deg, Omega=0.5 * u.rad, omega=0.6, M=0.7),
    ]
    for other in others:
        # f and E come from the state, with the digits that its rounding leaves: 11 EPS reached, 1 EPS for the others.
        np.testing.assert_allclose(other.values.q, reference.values.q, rtol=0, atol=16 * EPS)
        np.testing.assert_allclose(other.values.v, reference.values.v, rtol=0, atol=8 * EPS)


def test_a_hyperbola() -> None:
    system = kepler(q=1, e=1.5, M=0.3)
    assert system.elements("star")["planet"].a.value == pytest.approx(-2.0, rel=4 * EPS)
    np.testing.assert_allclose(system.elements("star")["planet"].M.value, 0.3, rtol=16 * EPS)


def test_the_mass_of_the_body_itself_counts_for_its_period() -> None:
    # Equal masses: the period of a = 1 is 2 pi/sqrt(2), and each is half as far from the barycentre.
    pair = System.from_elements({"A": {"mass": 1}, "B": {"a": 1, "mass": 1}}, units=DIMENSIONLESS)
    np.testing.assert_array_equal(pair.values.q, [[-0.5, 0, 0], [0.5, 0, 0]])
    np.testing.assert_allclose(pair.values.v[1], [0, math.sqrt(0.5), 0], rtol=EPS)
    np.testing.assert_allclose(pair.elements("A").P.value, 2 * math.pi / math.sqrt(2), rtol=4 * EPS)


def test_elements_of_a_system_without_the_sun_are_in_its_own_axes() -> None:
    """A transiting planet at 89.9 degrees stays there, in the axes of the system, as in the paper and in REBOUND."""
    planet = {"P": 3.5, "e": 0.1, "inc": 89.9 * u.deg, "Omega": 0.3, "omega": 1.2, "M": 2.0}
    made = System.from_elements({"WASP-1": {"mass": 1.2}, "b": planet})
    h = np.cross(*(x[1] - x[0] for x in made.values[1:3]))
    assert h[2] / np.linalg.norm(h) == pytest.approx(math.cos(math.radians(89.9)), rel=1e-12)
    assert (made.frame, made.elements().frame, made.elements()["b"].frame) == ("system",) * 3
    assert "b about WASP-1, axes of the system" in repr(made.elements())
    assert "ecliptic" not in repr(made)
    added = System.from_elements({"WASP-1": {"mass": 1.2}}).add("b", **planet)
    for system in (made, added):
        found = system.elements()
        for key in planet:  # in and out are the same; 4e-16 of e = 0.1 is lost in each of them
            given = u.Quantity(planet[key]).si.value
            assert getattr(found, key)[0].value == pytest.approx(given, rel=4e-14), key


def test_the_sun_among_the_bodies_makes_the_ecliptic_the_frame_and_all_that_is_shown_says_so() -> None:
    for name in ("Sun", "sun"):
        made = System.from_elements({name: {"mass": 1}, "x": {"a": 1, "inc": 0.1, "M": 1}})
        assert made.frame == made.elements().frame == "ecliptic"
        assert "ecliptic of J2000" in repr(made)
        assert "ecliptic of J2000" in repr(made.elements())
        np.testing.assert_allclose(made.elements().inc.value, 0.1, rtol=1e-14)
    # The frame is that of the whole, whichever body comes first.
    last = System.from_elements({"star": {"mass": 1}, "x": {"a": 1, "inc": 0.1}, "Sun": {"a": 9, "inc": 0.2}})
    np.testing.assert_allclose(last.elements().inc.value, [0.1, 0.2], rtol=1e-13)
    assert last.remove("Sun").frame == "system"
    assert kepler(a=1, M=1).frame == "system"


def test_elements_refer_to_the_ecliptic_of_the_sun_unless_a_frame_or_dimensionless_units_say_otherwise() -> None:
    def pole(system: System) -> np.ndarray:
        h = np.cross(system.values.q[-1], system.values.v[-1])
        return h / np.linalg.norm(h)

    ecliptic_pole = [0, -math.sin(OBLIQUITY), math.cos(OBLIQUITY)]
    sun = System.from_elements({"Sun": {"mass": 1}})
    np.testing.assert_allclose(pole(sun.add("x", a=1, M=1)), ecliptic_pole, atol=2 * EPS)
    np.testing.assert_allclose(pole(sun.add("x", a=1, M=1, frame="icrf")), [0, 0, 1], atol=EPS)
    np.testing.assert_allclose(pole(kepler(a=1, M=1)), [0, 0, 1], atol=EPS)
    np.testing.assert_allclose(pole(kepler(a=1, M=1, frame="ecliptic")), ecliptic_pole, atol=2 * EPS)
    in_one = System.from_elements({"Sun": {"mass": 1}, "x": {"a": 1, "M": 1}}, frame="icrf")
    np.testing.assert_allclose(pole(in_one), [0, 0, 1], atol=EPS)
    np.testing.assert_allclose(in_one.elements(frame="icrf").inc.value, 0, atol=EPS)
    np.testing.assert_allclose(in_one.elements().inc.value, OBLIQUITY, rtol=4 * EPS)


def test_pericentre_passage_may_be_a_moment_or_a_time_since_the_epoch() -> None:
    sun = System.from_elements({"Sun": {"mass": 1}}, epoch="2000-01-01")
    moment = sun.add("x", a=1, e=0.5, T="2000-03-01")
    for T in (60 * u.day, 60, Time("2000-03-01", scale="tdb"), 1440 * u.hr):
        np.testing.assert_allclose(sun.add("x", a=1, e=0.5, T=T).values.q, moment.values.q, atol=4 * EPS)
    dates = ["2000-03-01", "2000-04-01"]
    for T in (dates, Time(dates, scale="tdb")):
        both = sun.add(["x", "y"], a=1, e=0.5, T=T)
        np.testing.assert_array_equal(both.values.q[1:2], moment.values.q[1:])
        np.testing.assert_array_equal(both.values.q[2:], sun.add("y", a=1, e=0.5, T=dates[1]).values.q[1:])
    found = moment.elements().T[0]
    assert found.to_value(u.day) == pytest.approx(60.0, rel=8 * EPS)


def test_many_bodies_at_once_are_the_same_as_one_by_one() -> None:
    sun = System.from_elements({"Sun": {"mass": 1}})
    a = np.linspace(2.0, 3.5, 5)
    together = sun.add(list("abcde"), a=a * u.au, e=0.1, M=[0, 1, 2, 3, 4], gm=[0, 0, 0, 0, 1e-12])
    alone = sun
    for i, name in enumerate("abcde"):
        alone = alone.add(name, primary="Sun", a=a[i], e=0.1, M=i, gm=1e-12 if name == "e" else 0)
    assert together.names == alone.names
    np.testing.assert_allclose(together.values.q, alone.values.q, rtol=0, atol=4 * EPS)
    np.testing.assert_allclose(together.values.v, alone.values.v, rtol=0, atol=0.02 * 4 * EPS)


def test_a_body_by_position_and_velocity() -> None:
    system = System.solar_system()
    moon = system.add("probe", primary="Mars", q=[1e5, 0, 0] * u.km, v=[0, 1, 0] * u.km / u.s)
    relative = moon.q[-1] - moon.q[moon.index("Mars")]
    # 1e5 km is 7e-4 au beside Mars' 1.4: 2^-53 au is 1.7e-5 km.
    np.testing.assert_allclose(relative.to_value(u.km), [1e5, 0, 0], atol=5e-5)
    free = system.add("probe", q=[1, 2, 3], v=[0, 0, 0.01] * u.au / u.day)
    assert free.values.q[-1].tolist() == [1, 2, 3]
    assert free.values.v[-1].tolist() == [0, 0, 0.01]


def test_a_mapping_takes_positions_and_velocities_in_the_axes_of_the_system() -> None:
    orbit = {"q": [1, 0, 0.5] * u.au, "v": [0, 5, 25] * u.km / u.s}
    mapped = System.from_elements({"Sun": {"mass": 1 * u.M_sun}, "comet": orbit})
    assert mapped == System.from_elements({"Sun": {"mass": 1 * u.M_sun}}).add("comet", primary="Sun", **orbit)


def test_a_moon_of_a_planet_in_one_mapping() -> None:
    system = System.from_elements(
        {
            "Sun": {"mass": 1 * u.M_sun, "radius": 695700 * u.km},
            "Jupiter": {"a": 5.2 * u.au, "e": 0.049, "mass": 1 * u.M_jup},
            "Io": {"primary": "Jupiter", "a": 421800 * u.km, "radius": 1822 * u.km},
        },
        epoch="J2000",
    )
    assert np.abs(system.centre_of_mass().value).max() < EPS
    assert np.abs(system.linear_momentum().value).max() < EPS * 1e-2
    io = system.elements("Jupiter")["Io"]
    # Io's 2.8e-3 au are the difference of two positions near 5 au, known to 2^-51 au: 2e-13 of it.
    assert io.a.to_value(u.km) == pytest.approx(421800, rel=1e-12)
    assert io.P.to_value(u.day) == pytest.approx(1.769, abs=1e-3)  # 1.769 d is what is observed
    assert system.radii is not None
    np.testing.assert_allclose(system.radii.to_value(u.km), [695700, 0, 1822], rtol=2 * EPS)


def test_the_solar_system_is_that_of_the_reference_file() -> None:
    reference = json.loads(data_path("solar_system_10body.json").read_text(encoding="utf-8"))
    gm, q, v = (np.array(reference[key]) for key in ("gm_au3_d2", "q", "v"))
    system = System.solar_system()
    assert system.names == (
        "Sun", "Mercury", "Venus", "Earth-Moon barycenter", "Mars", "Jupiter", "Saturn", "Uranus", "Neptune", "Pluto",
    )  # fmt: skip
    # The file's GM are rounded to the digits of km^3/s^2 in a later table; DE440's own differ by up to 3.1e-10 (EMB).
    np.testing.assert_allclose(system.values.gm, gm, rtol=3.1e-10)
    assert system.values.gm[0] == gm[0]
    # Those differences move the barycentre by 8e-16 au; beside it only the last bit of Pluto's 32 au is rounded.
    np.testing.assert_allclose(system.values.q, q, rtol=0, atol=4e-15)
    np.testing.assert_allclose(system.values.v, v, rtol=0, atol=2e-17)
    # With the file's GM all but the last bits are the file's.
    same = system.replaced(gm=gm).barycentric()
    np.testing.assert_allclose(same.values.q, q, rtol=0, atol=4e-15)
    np.testing.assert_allclose(same.values.q[:5], q[:5], rtol=0, atol=4e-16)
    assert system.epoch is not None
    assert system.epoch.jd == 2451545.0
    assert np.abs(system.centre_of_mass().value).max() < 1e-17


def test_bodies_are_chosen_by_name_and_kept_in_the_order_given() -> None:
    system = System.solar_system(bodies=["Jupiter", "sun", "EMB"])
    assert system.names == ("Jupiter", "Sun", "Earth-Moon barycenter")
    assert np.abs(system.centre_of_mass().value).max() < 1e-15  # of Jupiter's 5 au


def test_earth_and_moon_together_have_the_barycentre_of_the_two() -> None:
    pair = System.solar_system(bodies=["Sun", "Earth", "Moon"])
    one = System.solar_system(bodies=["Sun", "EMB"])
    weights = pair.values.gm[1:]
    # GM of the two and of their barycentre agree to 1e-15, positions to what 1 au is rounded to.
    assert weights.sum() == pytest.approx(one.values.gm[1], rel=1e-13)
    between = weights @ pair.values.q[1:] / weights.sum() - pair.values.q[0]
    np.testing.assert_allclose(between, one.values.q[1] - one.values.q[0], rtol=0, atol=1e-15)
    distance = np.linalg.norm(pair.q[2] - pair.q[1])
    assert 356_000 * u.km < distance < 407_000 * u.km


def test_asteroids_come_in_at_their_own_epoch_as_massless_particles() -> None:
    catalogue = orbits.asteroids(50)
    system = System.solar_system("2022-08-09")
    full = system.add_particles(catalogue)
    assert full.names == system.names + catalogue.names
    assert not full.massive[10:].any()
    assert full.remove(*catalogue.names) == system
    elements = full.elements("Sun")
    for i, name in enumerate(catalogue.names):
        one = elements[name]
        # The state about the barycentre is rounded at some 3 au. Reached: 1.5e-15, 7e-16 and 1.7e-16.
        assert one.a.to_value(u.au) == pytest.approx(catalogue.a[i], rel=4e-15)
        assert one.e.value == pytest.approx(catalogue.e[i], abs=2e-15)
        assert one.inc.to_value(u.rad) == pytest.approx(catalogue.inc[i], abs=5e-16)


def test_asteroids_of_another_epoch_are_carried_along_their_two_body_orbits_when_asked() -> None:
    catalogue = orbits.asteroids(names=["Ceres"])
    system = System.solar_system().add_particles(catalogue, propagate_to_epoch=True)
    gm = system.values.gm[0]
    q, v = state_from_elements(
        gm, **{key: getattr(catalogue, key)[0] for key in ("a", "e", "inc", "Omega", "omega", "M")}
    )
    q, v = two_body(q, v, gm, 51544.5 - 59800.0)
    cos, sin = math.cos(OBLIQUITY), math.sin(OBLIQUITY)
    turn = np.array([[1, 0, 0], [0, cos, -sin], [0, sin, cos]])
    # The barycentre's 3 au are added: one rounding of 2^-52.
    np.testing.assert_allclose(system.values.q[-1] - system.values.q[0], turn @ q, rtol=0, atol=8 * EPS)
    np.testing.assert_allclose(system.values.v[-1] - system.values.v[0], turn @ v, rtol=0, atol=0.02 * 8 * EPS)


def test_particles_in_other_units_are_the_same_particles() -> None:
    km = UnitSystem("km", u.km, u.s, u.kg)
    catalogue = orbits.asteroids(3)
    solar = System.solar_system("2022-08-09", ["Sun", "Jupiter"])
    other = System(solar.names, solar.gm, solar.q, solar.v, epoch=solar.epoch, units=km).add_particles(catalogue)
    expected = solar.add_particles(catalogue)
    np.testing.assert_allclose(other.q.to_value(u.au), expected.q.value, rtol=0, atol=10 * EPS)
    np.testing.assert_allclose(other.v.to_value(u.au / u.day), expected.v.value, rtol=0, atol=0.02 * 10 * EPS)


def test_the_library_example_of_three_lines() -> None:
    system = System.from_elements({"Sun": {"mass": 1 * u.M_sun}, "Earth": {"a": 1 * u.au, "e": 0.0167}}, epoch="J2000")
    assert system.elements().P[0].to_value(u.yr) == pytest.approx(1.0, abs=2e-5)  # the Gaussian year is 365.2569 d


@pytest.mark.parametrize(
    ("name", "now"),
    [
        ("from_states", r"System\(names, gm, q, v, \.\.\.\)"),
        ("from_mpcorb", r"System\.from_catalogue\(orbits\.read_mpcorb\(\.\.\.\)\)"),
        ("from_sbdb", r"System\.from_catalogue\(orbits\.read_sbdb\(\.\.\.\)\)"),
    ],
)
def test_a_constructor_that_has_gone_is_answered_with_the_one_for_it(name, now):
    with pytest.raises(AttributeError, match=f"the class System has no attribute '{name}': it is {now} now"):
        getattr(System, name)
    assert not hasattr(System, "from_nothing")
