"""Certificates of systems, their tables and files. (What they find is held to every method in tests/contracts.)"""

import json
import math
import warnings

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.certificate import Certificate
from orbits.certificate.certifying import _order
from orbits.diagnostics.convergence import Slope
from orbits.errors import InputError
from orbits.methods import ExplicitEuler, LobattoIIIAB, RungeKutta4

from ..coverings import first
from ..problems import three_bodies


@pytest.fixture(scope="module")
def system():
    bodies = ["Sun", "Earth-Moon barycenter", "Jupiter"]
    system = orbits.System.solar_system(bodies=bodies)
    return system.add("asteroid", primary="Sun", a=2.6 * u.au, e=0.2, inc=8 * u.deg, Omega=1.0, omega=2.0, M=0.5)


@pytest.fixture(scope="module")
def certificate():
    """Of a pair with a massless particle that rests at the origin, found without a warning."""
    q, v = np.zeros((3, 3)), np.zeros((3, 3))
    q[:2, 0], v[:2, 1] = (0.1, 1.0), (-0.1, 1.0)
    G = orbits.SOLAR.G
    resting = orbits.System(["a", "b", "p"], [G, 0.1 * G, 0.0], q, v * G**0.5, units=orbits.SOLAR)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return orbits.certify(resting, orbits.Gauss(stages=2), 3 * u.day)


@pytest.mark.nightly
def test_a_system_with_particles_is_certified_with_their_fibres(system):
    certificate = orbits.certify(system, orbits.Gauss(stages=4), 10 * u.day)
    assert certificate.ok, certificate.table()
    assert certificate["symplecticity of particles"].holds
    # Six rounding errors of numbers of order one: 6.7e-16 at most was reached.
    assert certificate["symplecticity of particles"].measured < 4e-15
    assert certificate["symplecticity"].measured < 4e-15
    assert [f.name for f in certificate.findings if f.name.startswith("momentum map")] == [
        *(f"momentum map: translation along {x}" for x in "xyz"),
        *(f"momentum map: boost along {x}" for x in "xyz"),
        *(f"momentum map: rotation about {x}" for x in "xyz"),
    ]
    assert certificate["order of the map"].measured == pytest.approx(8, abs=0.5)


def test_a_particle_at_rest_at_the_origin_is_certified_too(certificate):
    """Its part was NaN, which passed for 0."""
    assert certificate.ok
    assert 0.0 < certificate["symplecticity of particles"].measured < 4e-15


def test_an_order_is_told_by_errors_along_a_line_alone():
    h = (0.277, 0.392, 0.554)
    bent = _order("order of L_d", Slope(2.2, h, (2.4e-10, 1.33e-9, 2.24e-9)), 16)
    assert not bent.needed
    assert "slopes that differ by 3.4: no asymptotic regime" in bent.note
    line = _order("order of the map", Slope(1.0, h, tuple(1e-4 * x for x in h)), 2)
    assert line.verdict == "FAILS, DECLARED"


@pytest.mark.nightly
def test_a_close_pair_far_from_the_origin_is_not_refuted_by_steps_too_long_for_it():
    """The order of L_d was 2.2: errors of steps longer than the period of the pair are small beside its distance."""
    sun, body = 1.32712440018e11, 0.0552
    away, apart = 1.64 * 1.495978707e8, 171.0
    along, around = (sun / away) ** 0.5, (2.0 * body / apart) ** 0.5
    q, v = np.zeros((3, 3)), np.zeros((3, 3))
    q[1:, 0], v[1:, 1] = away + np.array([0.5, -0.5]) * apart, along + np.array([0.5, -0.5]) * around
    pair = orbits.System(["Sun", "a", "b"], [sun, body, body] * u.km**3 / u.s**2, q * u.km, v * u.km / u.s)
    certificate = orbits.certify(pair, orbits.Gauss(), 0.6 * u.hour)
    assert certificate.ok, certificate.table()
    assert "no asymptotic regime" in certificate["order of L_d"].note
    assert certificate["order of the map"].holds


@pytest.mark.nightly
def test_a_lobatto_method_is_certified_on_a_system(system):
    assert orbits.certify(system, LobattoIIIAB(stages=3), 5 * u.day).ok


def test_runge_kutta_is_not_certified_on_a_system_and_neither_are_its_particles(system):
    certificate = orbits.certify(system, RungeKutta4(), 20 * u.day)
    assert not certificate.ok
    for name in ("symplecticity", "symplecticity of particles"):
        assert not certificate[name].holds
        assert certificate[name].verdict == "fails"


@pytest.mark.parametrize(("dt", "speed"), first(1, [(-0.1, 1e-3), (-0.1, 1.0), (0.1, 1e-3)]))
def test_a_pendulum_is_certified_backwards_and_near_its_rest(dt, speed):
    """Near its rest its weight, a constant in L, rounds to 1e-10 of the action of its motion."""
    certificate = orbits.certify(orbits.lagrangians.pendulum, orbits.Gauss(stages=4), dt, q=[0.0], v=[speed])
    assert certificate.ok, certificate.table()
    for order in ("order of the map", "order of L_d"):
        assert certificate[order].measured == pytest.approx(8, abs=0.5)


def test_the_table_names_the_step_the_unit_and_the_verdict(certificate):
    text = certificate.table()
    assert text.startswith("Gauss(stages=2) on 2 bodies, 1 massless particle, dt = 3 d")
    assert text.endswith("a variational integrator, as declared")
    assert str(certificate) == text


def test_a_certificate_survives_json_and_says_null_for_what_was_not_measured(certificate, tmp_path):
    text = certificate.to_json(tmp_path / "certificate.json")
    assert (tmp_path / "certificate.json").read_text() == text + "\n"
    again = Certificate.from_record(json.loads(text))
    assert again.to_record() == certificate.to_record()
    nothing = orbits.certify(orbits.lagrangians.kepler, ExplicitEuler(), 0.1)
    record = nothing.to_record()
    assert record["ok"] is False
    assert next(f for f in record["findings"] if f["name"] == "discrete Lagrangian")["measured"] is None
    assert math.isnan(Certificate.from_record(record)["discrete Lagrangian"].measured)


@pytest.mark.parametrize("record", [{}, {"format": "x", "version": 1}, {"format": "orbits-certificate", "version": 1}])
def test_what_is_no_certificate_is_refused(record):
    with pytest.raises(InputError, match="certificate"):
        Certificate.from_record(record)


def test_a_run_stores_its_certificate_in_the_archive_and_keeps_it_when_extended(system, tmp_path):
    path, system = tmp_path / "run.h5", system.remove("Earth-Moon barycenter")
    run = orbits.propagate(
        system, orbits.StormerVerlet(), dt=5 * u.day, duration=100 * u.day, samples=3, archive=path, certificate=True
    )
    assert run.certificate.ok
    assert run.certificate.dt == run.dt.to_value(u.day)
    assert run.certificate["symplecticity"].holds
    record = run.certificate.to_record()
    run.close()
    extended = orbits.resume(path, until=200 * u.day)
    assert extended.certificate.to_record() == record
    extended.close()
    plain = orbits.propagate(
        system, orbits.StormerVerlet(), dt=5, duration=100, samples=3, archive=path, overwrite=True
    )
    assert plain.certificate is None


@pytest.mark.nightly
@pytest.mark.parametrize("method", [orbits.Gauss(stages=8), LobattoIIIAB(stages=4)], ids=lambda m: m.label)
def test_bodies_in_transformed_time_are_certified(method, tmp_path):
    """The Lagrangian of equal tau, and the steps of the run, with their times, against plain solutions for it: 1 unit
    of 2^-53 is seen, and 7e5 if E0 of the one differs by 1e-9.
    """
    gm, q, v = three_bodies()
    start, clock = orbits.System(list("abc"), gm, q, v, units=orbits.DIMENSIONLESS), orbits.TimeTransformed(step=0.1)
    certificate = orbits.certify(start, method, dt=clock)
    assert certificate.ok, certificate.table()
    assert certificate["steps of bodies"].measured < 8.0
    assert "dt = 0.1 in transformed time" in certificate.table()
    names = [finding.name for finding in certificate.findings]
    assert "momentum map: rotation about z" in names
    assert not [name for name in names if "boost" in name]
    run = orbits.propagate(start, method, dt=clock, duration=1.0, archive=tmp_path / "run.h5", certificate=certificate)
    assert run.certificate.ok


def test_clocks_that_cannot_be_certified_are_refused_with_the_reason(system):
    for arguments, message in (
        ((system, orbits.Gauss(), orbits.Adaptive()), "depend on the state, so that no method is symplectic"),
        ((orbits.lagrangians.kepler, orbits.Gauss(), orbits.TimeTransformed()), "lagrangians.time_transformed"),
        ((system, orbits.StormerVerlet(), orbits.TimeTransformed()), "cannot march in transformed time"),
    ):
        with pytest.raises(InputError, match=message):
            orbits.certify(*arguments)


def test_wrong_uses_are_refused_with_the_remedy(system, tmp_path):
    pendulum = orbits.lagrangians.pendulum
    for arguments, message in (
        ((pendulum, 8, 0.1), "such as orbits.Gauss"),
        ((3, orbits.Gauss(), 0.1), "a System or a Lagrangian, got int"),
        ((pendulum, orbits.Gauss(), 0.0), "dt must be finite and not zero"),
        ((pendulum, orbits.Gauss(), "x"), "dt must be a real number"),
        ((orbits.lagrangians.double_pendulum, orbits.StormerVerlet(), 0.1), "needs a Lagrangian that is separable"),
    ):
        with pytest.raises(InputError, match=message):
            orbits.certify(*arguments)
    with pytest.raises(InputError, match="leave out q and v"):
        orbits.certify(system, orbits.Gauss(), 5 * u.day, q=np.zeros(12))
    with pytest.raises(InputError, match="needs q together with v"):
        orbits.certify(pendulum, orbits.Gauss(), 0.1, v=[1.0])
    with pytest.raises(InputError, match="give archive= too"):
        orbits.propagate(system, orbits.Gauss(), dt=5 * u.day, duration=50 * u.day, certificate=True)


def test_a_start_at_rest_is_refused():
    with pytest.raises(InputError, match=r"'pendulum': q stays 0 from this start, .* expected a motion"):
        orbits.certify(orbits.lagrangians.pendulum, orbits.Gauss(stages=4), 0.1, q=[0.0], v=[0.0])
    system = orbits.System(["A", "b"], [1.0, 0.0], [[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [0, 1, 0]])
    for method in ("gauss", "wisdom-holman"):  # the latter ended in a ZeroDivisionError
        with pytest.raises(InputError, match=r"A is the only massive body, and at rest: .* second body a mass"):
            orbits.certify(system, method, 0.1)


def test_a_certificate_asked_for_something_else_says_what_it_has(certificate):
    with pytest.raises(InputError, match=r"it has: gradients are those of value, .* step solves its equations"):
        certificate["beauty"]


@pytest.mark.parametrize("dt", [2.5, 3.0])
def test_steps_that_are_not_stable_keep_areas_as_others_do(dt):
    """Of Störmer–Verlet above dt = 2 the motion grows by 6 or 7 in a step, to 1e160: the area of a loop was NaN."""
    L = orbits.lagrangians.harmonic_oscillator.with_parameters(k=1.0)
    certificate = orbits.certify(L, orbits.StormerVerlet(), dt, q=[0.5], v=[0.3])
    assert certificate["area of a loop"].holds
    assert certificate.ok, certificate.table()
