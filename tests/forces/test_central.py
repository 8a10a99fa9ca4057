"""Forces that come from one body, as kernels see them: vectors, rows of stages and particles in lanes agree."""

from dataclasses import replace

import numpy as np
import pytest

import orbits
from orbits.errors import InputError
from orbits.kernels.binding import SumTag
from orbits.kernels.compile import kernel
from orbits.kernels.gravity.terms_and_forces import add_forces, total_particle_force
from orbits.kernels.lanes import full, lane, load
from orbits.terms import Damping, GasDrag, MassLoss, NonGravitational, RadiationPressure

from ..coverings import each, first

UNIT = orbits.DIMENSIONLESS
EPS = 2.0**-53
POLE = (0.36, 0.48, 0.8)
NAMES = ["a", "star", "b"]
GM = np.array([0.3, 1.0, 0.2])
STRENGTH = np.array([0.0, *GM])
T = 1.25


def marsden(A, r, w, alpha=0.7, r0=1.3, m=2.15, n=5.093, k=4.6142):
    x = np.linalg.norm(r) / r0
    radial, normal = r / np.linalg.norm(r), np.cross(r, w) / np.linalg.norm(np.cross(r, w))
    g = alpha * x**-m * (1 + x**n) ** -k
    return g * (A[0] * radial + A[1] * np.cross(normal, radial) + A[2] * normal)


def wind(r, w):
    t = np.cross(POLE, r)
    u = np.sqrt((1 - 2 * 0.1) / np.linalg.norm(r)) * t / np.linalg.norm(t)
    return -0.4 * (np.linalg.norm(r) / 2.0) ** -1.5 * np.linalg.norm(w - u) * (w - u)


def light(r, w, beta=0.2, c=7.0):
    distance = np.linalg.norm(r)
    n = r / distance
    return beta / distance**2 * ((1 - (w @ n) / c) * n - w / c)


def damped(r, w):
    return -w / (2 * 3.0) - 2 * (r @ w) * r / (r @ r) / 0.5 - 2 * (w @ np.array(POLE)) * np.array(POLE) / -2.0


FORCES = {
    "light": (RadiationPressure(beta=0.2, c=7.0), light),
    "Marsden": (
        NonGravitational(A1=0.1, A2=-0.2, A3=0.3, alpha=0.7, r0=1.3),
        lambda r, w: marsden((0.1, -0.2, 0.3), r, w),
    ),
    "Yarkovsky": (
        NonGravitational.yarkovsky(0.2, r0=1.5),
        lambda r, w: marsden((0.0, 0.2, 0.0), r, w, 1.0, 1.5, 2.0, 0.0, 0.0),
    ),
    "damping": (Damping(tau_a=3.0, tau_e=0.5, tau_i=-2.0, pole=POLE), damped),
    "gas": (GasDrag(per_length=0.4, r0=2.0, slope=1.5, eta=0.1, pole=POLE), wind),
    "mass": (MassLoss(fraction=-0.01, since=0.25), lambda r, w: 0.01 * r / np.linalg.norm(r) ** 3),
}


def bound(*forces, particles=()):
    named = (replace(force, source="star").in_units(UNIT) for force in forces)
    made = [force.about(1, NAMES, list(particles), UNIT) for force in named]
    return SumTag([one.tag for one in made]), tuple(one.parameters for one in made)


@kernel
def on_bodies(tags, strength, parameters, t, q, v, f):
    add_forces(tags, strength, parameters, t, q, v, f, f, f)


@kernel
def on_stages(tags, strength, parameters, t, q, v, f):
    add_forces(tags, strength, parameters, full(t), q, v, f, f, f)


@kernel
def on_eight(tags, strength, parameters, t, particle, sources, speeds, points, velocities, out):
    place = load(points, 0), load(points, 1), load(points, 2)
    velocity = load(velocities, 0), load(velocities, 1), load(velocities, 2)
    found = total_particle_force(tags, strength, parameters, t, particle, sources, speeds, place, velocity)
    for a in range(3):
        for k in range(8):
            out[a, k] = lane(found[a], k)


@pytest.mark.parametrize("names", first(1, [[*FORCES], *([name] for name in FORCES)]), ids=["all", *FORCES])
def test_a_force_is_its_formula_on_bodies_and_particles(names):
    """The sum of all, and each alone."""
    forces = [FORCES[name][0] for name in names]

    def formula(r, w):
        return sum(FORCES[name][1](r, w) for name in names)

    rng = np.random.default_rng(4)
    q, v, f = rng.normal(size=9), rng.normal(size=9), np.ones(9)
    tags, parameters = bound(*forces)
    on_bodies(tags, STRENGTH, parameters, T, q, v, f)
    places, speeds = q.reshape(3, 3), v.reshape(3, 3)
    for i in (0, 2):
        expected = formula(places[:, i] - places[:, 1], speeds[:, i] - speeds[:, 1])
        # A dozen roundings of numbers near 1, and of the power of a quotient.
        assert np.allclose(f.reshape(3, 3)[:, i] - 1.0, GM[i] * expected, rtol=32 * EPS, atol=32 * EPS)
    assert np.array_equal(f.reshape(3, 3)[:, 1], np.ones(3))
    tags, parameters = bound(*forces, particles=[f"p{k}" for k in range(11)])
    points, velocities, out = rng.normal(size=(3, 8)), rng.normal(size=(3, 8)), np.empty((3, 8))
    on_eight(tags, STRENGTH, parameters, T, 3, q, v, points, velocities, out)
    for k in range(8):
        expected = formula(points[:, k] - places[:, 1], velocities[:, k] - speeds[:, 1])
        assert np.allclose(out[:, k], expected, rtol=64 * EPS, atol=32 * EPS)


@pytest.mark.nightly
@pytest.mark.parametrize("names", [[*FORCES], *([name] for name in FORCES)], ids=["all", *FORCES])
def test_a_force_on_rows_of_stages_is_that_on_bodies(names):
    q, v = np.random.default_rng(4).normal(size=(2, 9))
    f, rows = np.ones(9), np.ones((9, 8))
    tags, parameters = bound(*(FORCES[name][0] for name in names))
    on_bodies(tags, STRENGTH, parameters, T, q, v, f)
    on_stages(tags, STRENGTH, parameters, T, *(np.repeat(x[:, None], 8, axis=1) for x in (q, v)), rows)
    assert np.allclose(rows, f[:, None], rtol=4 * EPS, atol=4 * EPS)


@pytest.mark.parametrize("stages", [False, True])
def test_each_body_named_has_its_own_coefficient(stages):
    names = [f"p{k}" for k in range(11)]
    force = RadiationPressure(beta=(0.1, 0.4, 0.2), bodies=("p5", "b", "p3"), c=1e9)
    tags, parameters = bound(force, particles=names)
    f, ones, zeros = np.zeros(9), np.repeat([1.0, 0.0, 0.0], 8).reshape(3, 8), np.zeros((3, 8))
    q = np.array([1.0, 0.0, 1.0, 0, 0, 0, 0, 0, 0])
    on_bodies(tags, STRENGTH, parameters, 0.0, q, np.zeros(9), f)
    assert np.allclose(f, [0, 0, 0.2 * 0.4, 0, 0, 0, 0, 0, 0], rtol=4 * EPS, atol=0)
    out = np.empty((3, 8))
    sources = np.repeat(q[:, None], 8, axis=1) if stages else q
    on_eight(tags, STRENGTH, parameters, 0.0, 3, sources, 0.0 * sources, ones, zeros, out)
    expected = np.full(8, 0.2) if stages else np.array([0.2, 0, 0.1, 0, 0, 0, 0, 0])
    assert np.allclose(out[0], expected, rtol=4 * EPS, atol=0)


def test_what_has_no_orbital_plane_gets_no_transverse_force():
    tags, parameters = bound(NonGravitational(A1=0.1, A2=0.2, A3=0.3, r0=1.0))
    f = np.zeros(9)
    on_bodies(tags, STRENGTH, parameters, 0.0, np.array([1.0, 0, 3.0, 0, 0, 0, 0, 0, 0]), np.zeros(9), f)
    assert np.all(np.isfinite(f))
    assert f[0] > 0.0
    assert not f[3:].any()


GIVEN = {
    "no beta": (lambda: RadiationPressure(c=1.0), "beta is missing"),
    "negative beta": (lambda: RadiationPressure(beta=-1, c=1.0), "expected numbers >= 0"),
    "no c": (lambda: RadiationPressure(beta=1), "has no speed of light: give c="),
    "c": (lambda: RadiationPressure(beta=1, c=0), "expected a speed > 0"),
    "no A": (lambda: NonGravitational(r0=1.0), "A1, A2 and A3 are missing"),
    "no r0": (lambda: NonGravitational(A2=1.0), "has no au: give a length"),
    "two A": (lambda: NonGravitational(A2=(1.0, 2.0), r0=1.0), "bodies does not name any"),
    "NaN": (lambda: NonGravitational(A2=np.nan, r0=1.0), "A2 of NonGravitational is nan; expected finite"),
    "no tau": (lambda: Damping(), "are missing; expected one time at least"),
    "tau": (lambda: Damping(tau_e=0.0), "tau_e is 0"),
    "pole": (lambda: Damping(tau_i=1.0, pole=(0, 0, 0)), "pole of Damping"),
    "no k": (lambda: GasDrag(r0=1.0), "per_length is missing"),
    "k": (lambda: GasDrag(per_length=-1.0, r0=1.0), "per_length is -1.0; expected numbers >= 0"),
    "eta": (lambda: GasDrag(per_length=1.0, r0=1.0, eta=0.5), "expected 0 <= eta < 1/2"),
    "no fraction": (lambda: MassLoss(), "fraction is missing"),
    "fractions": (lambda: MassLoss(fraction=(1.0, 2.0)), "expected one finite number"),
    "itself": (lambda: Damping(tau_a=1.0, bodies=["star"]), "comes from 'star' and cannot act on it"),
    "massless": (lambda: Damping(tau_a=1.0, source="grain"), "gm of 'grain' is 0"),
}


def system():
    return orbits.System(["star", "planet", "grain"], [1.0, 1e-3, 0.0], np.eye(3), np.zeros((3, 3)), units=UNIT)


@each(("force", "words"), GIVEN.values())
def test_what_makes_no_sense_is_refused_with_a_reason(force, words):
    with pytest.raises(InputError, match=words):
        system().with_forces(force())


def test_the_body_that_loses_mass_is_named_first_as_of_tides_and_figures():
    (loss,) = system().with_forces(MassLoss("planet", fraction=-0.1)).forces
    assert (loss.source, loss.bodies) == ("planet", None)


def test_a_force_goes_with_its_bodies_and_with_its_source():
    force = RadiationPressure(beta=(0.1, 0.2), bodies=["planet", "grain"], c=1.0)
    acting = system().with_forces(force)
    (left,) = acting.remove("planet").forces
    assert (left.bodies, left.beta, left.source) == (("grain",), (0.2,), "star")
    assert not system().with_forces(replace(force, source="star")).remove("star").forces


def test_the_beta_of_a_grain_is_that_of_burns_lamy_and_soter():
    from astropy import units as u

    # beta = 0.57 Q / (rho s), with the radius in um and the density in g/cm3.
    beta = RadiationPressure.beta_of_sphere(2 * u.um, 2.5 * u.g / u.cm**3, 0.9)
    assert beta == pytest.approx(0.574 * 0.9 / 5.0, rel=2e-3)
    with pytest.raises(InputError, match="expected a length and a density"):
        RadiationPressure.beta_of_sphere(2 * u.yr, 1.0)


def test_light_has_its_own_speed_in_physical_units():
    star = orbits.System(["Sun"], gm=[1.3e20], q=[[0, 0, 0]], v=[[0, 0, 0]])
    with pytest.raises(InputError, match=r"RadiationPressure: c is 2 AU / d, .*expected the speed of light"):
        star.with_forces(RadiationPressure(beta=0.1, c=2.0))
