"""Osculating elements with units: about a body, the barycentre, Jacobi's centres; one state or a whole run."""

from __future__ import annotations

import math
from dataclasses import fields

import numpy as np
import pytest
from astropy import units as u

from orbits import DIMENSIONLESS, Gauss, System, Trajectory
from orbits.elements import elements_from_state
from orbits.errors import UnknownNameError
from orbits.system import OrbitalElements, osculating
from orbits.terms import MassLoss

EPS = 2.0**-52
KEYS = tuple(field.name for field in fields(OrbitalElements))[4:-1]


def test_elements_are_those_of_the_relative_state_with_units() -> None:
    system = System.solar_system()
    elements = system.elements("Sun", frame="icrf")
    assert elements.names == system.names[1:]
    gm, q, v, _ = system.values
    expected = elements_from_state(q[1:] - q[0], v[1:] - v[0], gm[1:] + gm[0])
    assert elements.keys() == KEYS
    for key in KEYS:
        np.testing.assert_array_equal(getattr(elements, key).value, expected[key])
    assert elements.a.unit == u.au
    assert elements.P.unit == u.day
    assert elements.n.unit == u.rad / u.day
    assert elements.e.unit == u.dimensionless_unscaled
    assert elements.Omega.unit == u.rad


def test_the_planets_have_the_orbits_that_almanacs_give() -> None:
    # Mean elements of J2000 from Standish & Williams (Explanatory Supplement, table 8.10.2); osculating ones differ by
    # the planets' perturbations, a thousandth of a for the inner ones.
    elements = System.solar_system().elements("Sun")
    for name, a, e, inc in [("Mercury", 0.38710, 0.20563, 7.005), ("Mars", 1.52368, 0.09340, 1.850)]:
        one = elements[name]
        assert one.a.to_value(u.au) == pytest.approx(a, rel=1e-4)
        assert one.e.value == pytest.approx(e, abs=1e-3)
        assert one.inc.to_value(u.deg) == pytest.approx(inc, abs=1e-2)


def pair_and_dust() -> System:
    # Binary of equal masses, separation 1, and dust far outside on a circle about both.
    pair = System.from_elements({"A": {"gm": 1}, "B": {"a": 1, "gm": 1}}, units=DIMENSIONLESS)
    return pair.add("dust", q=[100, 0, 0], v=[0, math.sqrt(2 / 100), 0])


def test_barycentric_elements_are_about_the_massive_bodies_centre_with_all_their_mass() -> None:
    elements = pair_and_dust().elements("barycentre")
    assert elements.names == ("A", "B", "dust")
    assert elements["dust"].a.value == pytest.approx(100.0, rel=4 * EPS)
    assert elements["dust"].e.value == pytest.approx(0.0, abs=4 * EPS)
    assert pair_and_dust().elements("Barycenter").primary == "barycenter"


def test_with_one_massive_body_the_barycentre_is_that_body() -> None:
    system = System.from_elements({"star": {"gm": 1}, "dust": {"a": 2}}, units=DIMENSIONLESS)
    assert system.elements("barycentre").primary == "star"
    assert system.elements().primary == "star"


def test_jacobi_elements_are_about_the_centre_of_those_before() -> None:
    system = pair_and_dust().add("C", q=[0, 10, 0], v=[-math.sqrt(0.3), 0, 0], gm=1)
    elements = system.elements("jacobi")
    assert elements.names == ("B", "dust", "C")
    assert elements["B"].a.value == pytest.approx(1.0, rel=4 * EPS)
    assert elements["dust"].a.value == pytest.approx(100.0, rel=4 * EPS)
    assert elements["C"].a.value == pytest.approx(10.0, rel=4 * EPS)  # the GM of A, B and C together: v^2 = 3/10


def test_all_samples_of_a_run_at_once_are_the_same_as_one_by_one() -> None:
    system = System.solar_system()
    gm, q, v, _ = system.values
    rng = np.random.default_rng(3)
    runs_q = q + 1e-3 * rng.normal(size=(4, *q.shape))
    runs_v = v + 1e-6 * rng.normal(size=(4, *v.shape))
    times = np.array([0.0, 10.0, 20.0, 30.0])
    for primary in ("Sun", "barycentre", "jacobi"):
        about = {"units": system.units, "primary": primary, "frame": "ecliptic"}
        together = osculating(system.names, gm, runs_q, runs_v, **about, t=times)
        for i, t in enumerate(times):
            one = osculating(system.names, gm, runs_q[i], runs_v[i], **about, t=t)
            for key in KEYS:
                np.testing.assert_allclose(getattr(together, key)[i].value, getattr(one, key).value, rtol=1e-13)
        assert together["Mars"].a.shape == (4,)
        assert together["Mars"].names == ("Mars",)
        assert together["Mars"]["Mars"].a.shape == (4,)


def test_one_body_is_chosen_by_name() -> None:
    elements = System.solar_system().elements("Sun")
    assert elements["Mars"].a == elements.a[elements.names.index("Mars")]
    assert elements["Mars"]["Mars"].a == elements["Mars"].a
    with pytest.raises(UnknownNameError, match=r"there is no orbit of 'marz'.*Did you mean 'Mars'"):
        elements["marz"]
    with pytest.raises(UnknownNameError, match="there is no orbit of 'Sun'"):
        elements["Sun"]


def test_the_repr_is_a_table() -> None:
    text = repr(System.solar_system(bodies=["Sun", "Mercury", "Jupiter"]).elements("Sun"))
    head, columns, mercury, jupiter = text.split("\n")
    assert head == "elements of Mercury, Jupiter about the Sun, ecliptic of J2000"
    assert columns.split("  ")[-1].strip() == "M [deg]"
    assert mercury.split()[:3] == ["Mercury", "0.387098", "0.20563"]
    assert jupiter.split()[:3] == ["Jupiter", "5.20427", "0.0487749"]
    assert len({len(columns), len(mercury), len(jupiter)}) == 1
    alone = repr(System.solar_system(bodies=["Sun"]).elements("Sun"))
    assert alone.startswith("elements of no body about the Sun, ecliptic of J2000")


@pytest.mark.parametrize("primary", ["star", "jacobi", "barycentre"])
def test_elements_are_of_the_mass_that_a_star_has_left(primary: str) -> None:
    times, systems = np.array([0.0, 20.0, 100.0]), []
    for t in times.tolist():
        star = System(["star"], [1.0], np.zeros((1, 3)), np.zeros((1, 3)), units=DIMENSIONLESS)
        star = star.with_forces(MassLoss(fraction=-0.005, since=-t))
        systems.append(star.add("b", primary=primary, a=2.0, e=0.1, gm=1e-2).add("c", primary=primary, a=5.0, e=0.2))
    mu = 1.0 - 0.005 * times + (0.0 if primary == "star" else 1e-2)
    q, v = (np.array([getattr(one, x).value for one in systems]) for x in "qv")
    run = Trajectory(systems[0], times, q, v, step=0.1, integrator=Gauss(stages=8))
    assert run.elements(primary=primary)["c"].P.value == pytest.approx(2.0 * np.pi * np.sqrt(5.0**3 / mu), rel=1e-14)
    for found in (run.elements(primary=primary)["c"], *(one.elements(primary=primary)["c"] for one in systems)):
        # A few roundings, which e of 0.2 multiplies: 3e-15 seen.
        np.testing.assert_allclose(found.a.value, 5.0, rtol=1e-14)
        np.testing.assert_allclose(found.e.value, 0.2, rtol=1e-14)


def test_two_losses_of_a_star_add_up_in_elements_as_they_do_in_the_force() -> None:
    """They were multiplied."""
    losses = MassLoss(fraction=-0.25, since=-1.0), MassLoss(fraction=-0.125, since=-2.0)
    star = System(["star"], [1.0], np.zeros((1, 3)), np.zeros((1, 3)), units=DIMENSIONLESS).with_forces(*losses)
    star = star.add("b", primary="star", q=[2.0, 0.0, 0.0], v=[0.0, 0.5, 0.0])
    assert star.elements("star")["b"].a.value == pytest.approx(2.0, rel=1e-15)  # a circle, as GM is 1/2


def test_the_centre_of_mass_is_of_the_mass_that_a_star_has_left() -> None:
    times, left = np.array([0.0, 20.0, 100.0]), np.array([1.0, 0.9, 0.5])
    q = np.broadcast_to([[0.0, 0.0, 0.0], [2.0, 0.0, 1.0]], (3, 2, 3))
    system = System(["star", "planet"], [1.0, 0.1], q[0], q[0][::-1], units=DIMENSIONLESS)
    system = system.with_forces(MassLoss(fraction=-0.005))
    run = Trajectory(system, times, q, np.zeros(q.shape), step=0.1, integrator=Gauss(stages=8))
    expected = 0.1 * q[:, 1] / (left + 0.1)[:, None]
    np.testing.assert_allclose(run.centre_of_mass().value, expected, rtol=2 * EPS)
    assert run[1:1].centre_of_mass().shape == (0, 3)
    np.testing.assert_allclose(run[2].centre_of_mass().value, expected[2], rtol=2 * EPS)
    moved = run[2].barycentric().values
    np.testing.assert_allclose(0.5 * moved.q[0] + 0.1 * moved.q[1], 0.0, atol=EPS)
    np.testing.assert_allclose(0.5 * moved.v[0] + 0.1 * moved.v[1], 0.0, atol=EPS)
