"""A system's elements make the system again: about a body, Jacobi's centres and the barycentre, for every conic."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits import DIMENSIONLESS, System
from orbits.elements import two_body

# One of each conic, of masses that matter; the last but one is circular, retrograde and in the plane.
ORBITS: dict[str, dict[str, Any]] = {
    "ellipse": {"mass": 1e-3, "a": 1.0, "e": 0.3, "inc": 0.4, "Omega": 1.0, "omega": 2.0, "M": 0.7},
    "retrograde": {"mass": 2e-3, "P": 60.0, "e": 0.1, "inc": 2.8, "Omega": 4.0, "pomega": 2.0, "l": 5.0},
    "massless": {"a": 9.0, "h": 0.1, "k": -0.2, "ix": 0.3, "iy": 0.1, "l": 3.0},
    "parabola": {"mass": 1e-4, "q": 2.0, "e": 1.0, "inc": 1.2, "Omega": 3.0, "omega": 1.0, "T": -11.0},
    "nearly one": {"mass": 1e-5, "q": 2.0, "a": 1e9, "inc": 1.3, "Omega": 2.0, "omega": 5.0, "T": 12.0},
    "hyperbola": {"mass": 3e-3, "n": 0.05, "e": 2.5, "inc": 0.1, "Omega": 0.5, "omega": 0.5, "f": -1.4},
    "circle": {"mass": 1e-3, "a": 30.0, "inc": np.pi, "u": 1.0},
}
EXACT = ("a", "q", "inc", "Omega", "omega", "T")


def made(orbits_: Mapping[str, Mapping[str, Any]], primary: str) -> System:
    system = System.from_elements({"star": {"mass": 1.0}}, units=DIMENSIONLESS)
    for name, elements in orbits_.items():
        system = system.add(name, primary=primary, **elements)
    return system


@pytest.mark.parametrize("primary", ["star", "jacobi"])
def test_every_conic_comes_back_about_a_body_and_in_jacobis_way(primary: str) -> None:
    system = made(ORBITS, primary)
    elements = system.elements(primary)
    again = made(
        {
            name: {"mass": given.get("mass", 0.0)} | {key: getattr(elements[name], key) for key in EXACT}
            for name, given in ORBITS.items()
        },
        primary,
    )
    # A position relative to the centre is a difference, rounded to an ulp of 30.
    np.testing.assert_allclose(again.values.q, system.values.q, rtol=0, atol=3e-14)
    np.testing.assert_allclose(again.values.v, system.values.v, rtol=0, atol=3e-15)
    assert elements["parabola"].e == 1.0
    assert np.isinf(elements["parabola"].a)
    assert elements["hyperbola"].n.value == pytest.approx(0.05, rel=2e-14)
    assert elements["nearly one"].a.value == pytest.approx(1e9, rel=1e-5)  # 1e-15 of the energy, magnified by a/r
    for key in ("h", "k", "ix", "iy"):
        assert getattr(elements["massless"], key).value == pytest.approx(ORBITS["massless"][key], abs=5e-15)


def test_the_primary_of_jacobi_elements_is_the_interior_mass() -> None:
    outer = {"a": 10.0, "mass": 1.0}
    system = made({"inner": {"a": 1.0, "mass": 1.0}, "outer": outer}, "jacobi")
    # Two inner bodies of mass 1 and its own 1: n^2 a^3 = 3, about the centre of the two.
    n = system.elements("jacobi")["outer"].n.value
    assert n == pytest.approx(np.sqrt(3.0 / 1000.0), rel=1e-14)
    centre = system.values.q[:2].mean(axis=0)
    np.testing.assert_allclose(system.values.q[2] - centre, [10.0, 0.0, 0.0], rtol=0, atol=2e-15)
    together = made({}, "jacobi").add(["inner", "outer"], primary="jacobi", a=[1.0, 10.0], mass=[1.0, 1.0])
    np.testing.assert_allclose(together.values.q, system.values.q, rtol=0, atol=2e-15)
    np.testing.assert_allclose(together.values.v, system.values.v, rtol=0, atol=1e-15)


@pytest.mark.parametrize("name", ORBITS)
def test_the_last_body_comes_back_about_the_barycentre_of_all(name: str) -> None:
    pair = made({"companion": {"a": 0.5, "mass": 0.4}}, "star")
    system = pair.add(name, primary="barycentre", **ORBITS[name])
    elements = system.elements("barycentre")[name]
    centre, weight = system.centre_of_mass().value, system.values.gm.sum()
    assert elements.n.value**2 * abs(elements.a.value) ** 3 == pytest.approx(weight, rel=1e-14) or elements.e == 1.0
    assert np.linalg.norm(system.values.q[-1] - centre) >= elements.q.value * (1 - 1e-14)
    given = {key: getattr(elements, key) for key in EXACT}
    again = pair.add(name, primary="barycentre", mass=ORBITS[name].get("mass", 0.0), **given)
    np.testing.assert_allclose(again.values.q, system.values.q, rtol=0, atol=3e-14)
    np.testing.assert_allclose(again.values.v, system.values.v, rtol=0, atol=3e-15)


def test_several_bodies_at_once_share_one_barycentre() -> None:
    pair = made({"companion": {"a": 0.5, "mass": 0.4}}, "star")
    system = pair.add(["x", "y"], primary="barycentre", a=[5.0, -7.0], e=[0.1, 1.4], mass=[0.1, 0.2], f=[1.0, 2.0])
    elements = system.elements("barycentre")
    np.testing.assert_allclose(elements.a.value[2:], [5.0, -7.0], rtol=1e-14)
    np.testing.assert_allclose(elements.f.value[2:], [1.0, 2.0], rtol=0, atol=1e-14)


def test_pals_elements_go_from_one_system_into_another_retrograde_or_not() -> None:
    for inc in (20 * u.deg, 150 * u.deg):
        sun = System.from_elements({"Sun": {"mass": u.M_sun}}, epoch="J2000")
        rock = sun.add("rock", a=2.2 * u.au, e=0.2, inc=inc, Omega=50 * u.deg, omega=70 * u.deg, M=100 * u.deg)
        found = rock.elements()["rock"]
        again = sun.add("rock", **found.pal())
        np.testing.assert_allclose(again.values.q, rock.values.q, rtol=0, atol=5e-15)
        assert found.pal()["l"].to_value(u.deg) == pytest.approx(220.0, abs=1e-12)
        assert found.u.to_value(u.rad) == pytest.approx((found.omega + found.f).to_value(u.rad), abs=2e-15)


def test_mean_motion_and_argument_of_latitude_have_units() -> None:
    sun = System.from_elements({"Sun": {"mass": 1 * u.M_sun}})
    rock = sun.add("rock", n=0.5 * u.deg / u.day, e=0.1, omega=30 * u.deg, u=40 * u.deg)
    found = rock.elements()["rock"]
    assert found.n.to_value(u.deg / u.day) == pytest.approx(0.5, rel=4e-15)
    assert found.P.to_value(u.day) == pytest.approx(720.0, rel=4e-15)
    assert found.f.to_value(u.deg) == pytest.approx(10.0, rel=1e-13)


def test_a_bare_unit_is_one_of_it() -> None:
    system = System.from_elements({"Sun": {"mass": u.M_sun}, "Earth": {"a": u.au, "mass": u.M_earth}})
    same = System.from_elements({"Sun": {"mass": 1 * u.M_sun}, "Earth": {"a": 1 * u.au, "mass": 1 * u.M_earth}})
    assert system == same


def test_a_run_gives_all_elements_of_all_conics_at_every_sample() -> None:
    system = made({name: {**given, "mass": 0.0} for name, given in ORBITS.items()}, "star")
    times = np.linspace(0.0, 2.0, 5)
    q, v = np.zeros((2, 5, len(system), 3))
    q[:, 1:], v[:, 1:] = two_body(system.values.q[1:], system.values.v[1:], 1.0, times[:, None])
    run = orbits.Trajectory(system, times, q, v, step=0.5, integrator=orbits.Gauss(stages=8))
    for primary in ("star", "jacobi", "barycentre"):
        elements = run.elements(primary)
        assert elements.names == tuple(ORBITS)
        assert elements.h.shape == (5, len(ORBITS))
        for name in ORBITS:
            if name != "circle":
                # Two-body motion: T stays where it was, to the rounding of states of size 1 to 10.
                assert np.ptp(elements[name].T.value) <= 2e-13, name
