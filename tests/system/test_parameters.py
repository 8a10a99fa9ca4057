"""Parameters of what acts in a system, by name."""

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.errors import InputError, UnknownNameError
from orbits.system.parameters import parameters_of, with_values
from orbits.terms import Damping, NonGravitational, RadiationPressure, Tides, ZonalHarmonics
from orbits.units import UnitSystem

PLAIN = UnitSystem("plain", u.dimensionless_unscaled, u.dimensionless_unscaled, u.dimensionless_unscaled, G=1)


def solar():
    bodies = {"names": ["Sun", "Earth", "Apophis", "Bennu"], "gm": [2.96e-4, 8.9e-10, 0.0, 0.0]}
    q = np.array([[0, 0, 0], [1, 0, 0], [0, 0.9, 0], [0, 0, 1.1]])
    v = np.array([[0, 0, 0], [0, 0.017, 0], [0.018, 0, 0], [0, 0.016, 0]])
    A2 = NonGravitational.yarkovsky(-2.9e-14 * u.au / u.day**2, bodies=["Apophis"])
    flat = ZonalHarmonics("Earth", J2=1.08e-3, radius=6378 * u.km, pole=(0.0, 0.0, 1.0))
    return orbits.System(**bodies, q=q, v=v).with_forces(A2).with_terms(flat)


def test_each_parameter_has_its_value_in_the_units_of_the_system():
    found = parameters_of(solar(), ["Apophis.A2", "earth.GM", "Earth.J2"])
    assert [(p.name, p.value, str(p.unit)) for p in found] == [
        ("Apophis.A2", -2.9e-14, "AU / d2"),
        ("Earth.gm", 8.9e-10, "AU3 / d2"),
        ("Earth.J2", 1.08e-3, ""),
    ]


def test_with_values_changes_these_and_nothing_else():
    system = solar()
    found = parameters_of(system, ["Apophis.A2", "Apophis.A1", "Earth.gm", "Earth.J2"])
    other = with_values(system, found, [1e-14, 2e-14, 9e-10, 1e-3])
    assert [p.value for p in parameters_of(other, [p.name for p in found])] == [1e-14, 2e-14, 9e-10, 1e-3]
    assert with_values(other, found, [p.value for p in found]) == system.replaced(
        forces=[NonGravitational.yarkovsky((-2.9e-14,) * u.au / u.day**2, A1=(0,), A3=(0,), bodies=["Apophis"])]
    )
    assert parameters_of(with_values(system, found[:1], [0.0]), ["Apophis.A2"])[0].value == 0.0


def test_a_number_of_several_bodies_becomes_one_for_each():
    system = solar().replaced(forces=[RadiationPressure(beta=0.1)])
    other = with_values(system, parameters_of(system, ["Bennu.beta"]), [0.2])
    assert other.forces[0].bodies == ("Earth", "Apophis", "Bennu")
    assert other.forces[0].beta == (0.1, 0.1, 0.2)


def test_a_force_of_one_body_has_parameters_of_that():
    tides = Tides("star", k2=0.3, radius=0.1, lag=0.01, inertia=0.3, spin=(0, 0, 1))
    system = orbits.System(names=["star", "b"], gm=[1.0, 1e-3], q=np.eye(2, 3), v=np.eye(2, 3)[::-1], units=PLAIN)
    system = system.with_forces(tides, Damping(tau_a=100.0, bodies=["b"]))
    assert [p.value for p in parameters_of(system, ["star.k2", "star.lag", "b.tau_a"])] == [0.3, 0.01, 100.0]
    with pytest.raises(UnknownNameError, match=r"no parameter 'b.tau_e'"):
        parameters_of(system, ["b.tau_e"])


def twice():
    return solar().with_forces(NonGravitational(A2=1e-12 * u.au / u.day**2, bodies=["Apophis"]))


@pytest.mark.parametrize(
    ("ask", "error", "message"),
    [
        (lambda: parameters_of(solar(), "Apophis.A2"), InputError, "expected a list of names"),
        (lambda: parameters_of(solar(), ["A2"]), UnknownNameError, "Did you mean 'Apophis.A2'"),
        (lambda: parameters_of(solar(), ["Bennu.A2"]), UnknownNameError, "A force has to act before"),
        (lambda: parameters_of(solar(), ["Apophis.gm"]), UnknownNameError, "no parameter 'Apophis.gm'"),
        (lambda: parameters_of(solar(), ["Sun.gm", "sun.gm"]), InputError, "names 'Sun.gm' twice"),
        (lambda: parameters_of(twice(), ["Apophis.A2"]), InputError, "a number of 2 forces of 'Apophis'"),
        (lambda: with_values(solar(), parameters_of(solar(), ["Sun.gm"]), [0.0]), InputError, "expected a mass > 0"),
        (lambda: with_values(solar(), parameters_of(solar(), ["Sun.gm"]), []), InputError, "0 values of 1 parameter"),
    ],
)
def test_what_is_not_one_parameter_is_refused(ask, error, message):
    with pytest.raises(error, match=message):
        ask()
