"""Rigid bodies as users give them: the same body in several ways, and what is refused."""

import pickle

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits import rotations

from ..coverings import each

SPIN = 1 * u.rad / u.day
SHAPE = (180, 133, 103) * u.km


@pytest.fixture(scope="module")
def system():
    return orbits.System.from_elements({
        "Saturn": {"mass": 5.683e26 * u.kg},
        "Titan": {"a": 1.2219e6 * u.km, "e": 0.0288, "mass": 1.345e23 * u.kg},
        "Hyperion": {"a": 1.4811e6 * u.km, "e": 0.1},
    })


def numbers(body):
    values = (getattr(body, x) for x in ("A", "B", "C", "attitude", "spin"))
    return [np.asarray(getattr(x, "value", x)) for x in values]


def test_moments_shape_and_moments_over_the_mass_are_the_same_body(system):
    a, b, c = SHAPE
    j = [(b**2 + c**2) / 5, (c**2 + a**2) / 5, (a**2 + b**2) / 5]
    m = 1.345e23 * u.kg
    ways = [
        orbits.RigidBody(shape=SHAPE, spin=SPIN),
        orbits.RigidBody(**dict(zip("ABC", j, strict=True)), spin=SPIN),
        orbits.RigidBody(**dict(zip("ABC", [x * m for x in j], strict=True)), spin=[0, 0, 1] * u.rad / u.day),
        orbits.RigidBody(**{x: float(y / u.Mm**2) for x, y in zip("ABC", j, strict=True)}, radius=1 * u.Mm, spin=SPIN),
    ]
    one, *others = (numbers(system.with_rigid("Titan", body).rigid["Titan"]) for body in ways)
    for other in others:
        assert all(np.allclose(x, y, rtol=1e-4, atol=0) for x, y in zip(one, other, strict=True))  # G is known to 2e-5
    assert all(np.allclose(x, y, rtol=1e-15, atol=0) for x, y in zip(one, others[0], strict=True))


def test_a_body_that_points_to_another_turns_with_the_line_to_it(system):
    locked = system.with_rigid("Hyperion", orbits.RigidBody(shape=SHAPE, attitude="Saturn")).rigid["Hyperion"]
    R = rotations.matrices(locked.attitude)
    x, v = (a[0] - a[2] for a in (system.values.q, system.values.v))
    assert np.allclose(R[:, 0], x / np.linalg.norm(x), rtol=0, atol=1e-15)
    assert np.allclose(np.cross(locked.spin.value, x), v - (v @ x) * x / (x @ x), rtol=0, atol=1e-17)
    assert np.allclose(R[:, 2] * np.linalg.norm(locked.spin.value), locked.spin.value, rtol=0, atol=1e-15)


def test_rigid_bodies_with_arrays_are_values():
    one, same = (orbits.RigidBody(shape=SHAPE, attitude=np.array([1, 2, 3, 4]), spin=[0, 0, 1] / u.day) for _ in "12")
    assert one == same
    assert one != orbits.RigidBody(shape=SHAPE, attitude=np.array([1, 2, 3, 5]), spin=one.spin)
    assert one != orbits.RigidBody(shape=SHAPE, attitude="Saturn", spin=one.spin)
    assert one != orbits.RigidBody(shape=SHAPE, spin=one.spin)
    assert one != 1


def test_a_system_with_rigid_bodies_is_a_value(system):
    body = orbits.RigidBody(shape=SHAPE, attitude=(1, 2, 3, 4), spin=SPIN)
    rigid = system.with_rigid({"Hyperion": body, "Titan": body})
    assert list(rigid.rigid) == ["Titan", "Hyperion"]  # those with mass first
    assert rigid == pickle.loads(pickle.dumps(rigid)) == system.with_rigid("Titan", body).with_rigid("Hyperion", body)
    assert rigid != system
    assert rigid.remove("Titan") == system.remove("Titan").with_rigid("Hyperion", body)
    assert rigid.remove("Titan", "Hyperion").forces == ()
    assert system.with_rigid("Titan", body) + system.remove("Titan").with_rigid("Hyperion", body) == rigid
    assert rigid.replaced(forces=()) == system
    assert "with RigidBodies of Titan, Hyperion" in repr(rigid)
    assert list(rigid.replaced(gm=[1.0, 0.0, 1.0]).rigid) == ["Hyperion", "Titan"]
    other = system.with_rigid("Titan", orbits.RigidBody(shape=(3, 2, 1) * u.km, spin=SPIN))
    assert other.with_rigid("Titan", body) == system.with_rigid("Titan", body)


def test_what_a_system_says_of_its_rigid_bodies_makes_them_again(system):
    body = orbits.RigidBody(shape=SHAPE, attitude=(1, 2, 3, 4), spin=[1, 2, 3] * u.rad / u.day)
    rigid = system.with_rigid("Hyperion", body)
    again = system.with_rigid(rigid.rigid).rigid["Hyperion"]
    for one, other in zip(numbers(rigid.rigid["Hyperion"]), numbers(again), strict=True):
        assert np.allclose(one, other, rtol=1e-14, atol=0)
    plain = orbits.System(["a", "b"], [2.0, 0.0], [[0, 0, 0], [1, 0, 0]], np.zeros((2, 3)), units=orbits.DIMENSIONLESS)
    plain = plain.with_rigid("a", orbits.RigidBody(A=1.0, B=1.0, C=1.5, spin=(0, 0, 1)))
    assert np.isclose(plain.rigid["a"].C, 0.75)  # divided by the mass of 2, and the square of R = 1
    assert np.allclose(plain.angular_momentum().value, [0, 0, 1.5], rtol=1e-15)
    assert plain.with_rigid(plain.rigid) == plain


NO_ROTATION = np.eye(3) * 1.01
AXES = {"A": 1, "B": 1, "C": 1}


@each(
    ("given", "words"),
    [
        ({}, "neither A, B, C nor shape"),
        ({**AXES, "shape": SHAPE, "spin": SPIN}, "both A, B, C and shape"),
        ({"A": 1, "B": 1, "radius": 1 * u.km, "spin": SPIN}, "C missing"),
        ({**AXES, "spin": SPIN}, "A is 1, without a unit"),
        ({**AXES, "C": 3, "radius": 1 * u.km, "spin": SPIN}, "A = 1, B = 1, C = 3 are no .*C exceeds the sum"),
        ({**AXES, "A": -1, "radius": 1 * u.km, "spin": SPIN}, "those are > 0"),
        ({**AXES, "A": np.nan, "radius": 1 * u.km, "spin": SPIN}, "A is nan; expected one finite number"),
        ({**AXES, "A": 1 * u.km**2, "radius": 1 * u.km, "spin": SPIN}, "leave out the radius"),
        ({"A": 1 * u.kg * u.m**2, "B": 1, "C": 1, "spin": SPIN}, "has no mass"),
        ({"A": 1 * u.kg, "B": 1, "C": 1, "spin": SPIN}, "has no mass|moment of inertia"),
        ({"shape": (1, 2, 3) * u.kg, "spin": SPIN}, "shape is in kg; expected length"),
        ({"shape": (1, 2) * u.km, "spin": SPIN}, "expected three semi-axes > 0"),
        ({"shape": (1, -2, 1) * u.km, "spin": SPIN}, "expected three semi-axes > 0"),
        ({"shape": SHAPE, "radius": 1 * u.km, "spin": SPIN}, "shape and radius are both given"),
        ({"shape": SHAPE}, "spin is missing"),
        ({"shape": SHAPE, "spin": np.nan * u.rad / u.day}, "spin is nan"),
        ({"shape": SHAPE, "spin": 3 * u.km}, "spin is in km; expected angle per time"),
        ({"shape": SHAPE, "spin": SPIN, "attitude": NO_ROTATION}, r"no rotation: R\^T R differs from 1 by 0.02"),
        ({"shape": SHAPE, "spin": SPIN, "attitude": np.diag([1, 1, -1])}, "it is a reflection"),
        ({"shape": SHAPE, "spin": SPIN, "attitude": (0, 0, 0, 0)}, "expected a quaternion"),
        ({"shape": SHAPE, "spin": SPIN, "attitude": [(1, 2), 3]}, "expected a quaternion"),
        ({"shape": SHAPE, "attitude": "Saturm"}, "Did you mean 'Saturn'"),
        ({"shape": SHAPE, "attitude": "Hyperion"}, "names the body itself"),
    ],
)
def test_what_is_no_rigid_body_is_refused(system, given, words):
    with pytest.raises(orbits.errors.InputError, match=words):
        system.with_rigid("Hyperion", orbits.RigidBody(**given))


def test_an_attitude_towards_a_body_needs_an_orbit_about_it(system):
    still = system.replaced(v=np.zeros((3, 3)))
    with pytest.raises(orbits.errors.InputError, match="needs an orbit about it"):
        still.with_rigid("Hyperion", orbits.RigidBody(shape=SHAPE, attitude="Saturn"))


def test_names_that_a_system_does_not_have_are_refused(system):
    body = orbits.RigidBody(shape=SHAPE, spin=SPIN)
    with pytest.raises(orbits.errors.UnknownNameError, match="Did you mean 'Hyperion'"):
        system.with_rigid("Hyperon", body)
    with pytest.raises(orbits.errors.InputError, match="twice"):
        system.with_rigid({"Hyperion": body, "hyperion": body})
    for wrong in (("Hyperion",), (["Hyperion"], body), ({},), ("Hyperion", 3)):
        with pytest.raises(orbits.errors.InputError, match="expected a"):
            system.with_rigid(*wrong)
