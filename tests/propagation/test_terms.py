"""Runs with zonal harmonics: conserved quantities, precession of orbits, particles, archives, refusals."""

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.errors import ArchiveError, InputError
from orbits.rebound import to_rebound
from orbits.terms import FrameDragging, ZonalHarmonics

from ..coverings import first

GM_EARTH, RADIUS = 398600.4418, 6378.137
EARTH = {"J2": 1.0826e-3, "radius": RADIUS}
UNITS = orbits.UnitSystem("KM", length=u.km, time=u.s, mass=u.kg)
POLE = (0.36, 0.48, 0.8)


def planet(**bodies):
    """A planet at rest with satellites on given states."""
    names = ["planet", *bodies]
    gm = [1.0, *(body[0] for body in bodies.values())]
    states = [np.zeros((2, 3)), *(np.array(body[1:]) for body in bodies.values())]
    q, v = (np.array([s[k] for s in states], dtype=float) for k in (0, 1))
    return orbits.System(names, gm, q, v, units=orbits.DIMENSIONLESS)


def three(gm=(0.01, 0.002)):
    return planet(inner=(gm[0], [1, 0, 0.2], [0, 0.9, 0.3]), outer=(gm[1], [-2, 0.5, 0], [-0.1, -0.6, 0.3]))


def flattened(system, **changes):
    return system.with_terms(
        ZonalHarmonics("planet", **{"J2": 0.05, "J3": 0.01, "J4": -0.02, "radius": 0.5, "pole": POLE, **changes})
    )


def march(system, integrator, dt=0.02, duration=20.0, **options):
    return orbits.propagate(system, integrator, dt=dt, duration=duration, progress=False, check_step=False, **options)


@pytest.mark.parametrize(
    "integrator", first(1, [orbits.Gauss(stages=8), orbits.StormerVerlet(), orbits.Gauss(stages=12)])
)
def test_the_whole_energy_and_the_angular_momentum_about_the_pole_are_kept(integrator):
    system = flattened(three())
    run = march(system, integrator)
    drift = run.drift()
    # Round-off, a few units in the last place; the energy of Störmer–Verlet oscillates by dt^2.
    assert drift.angular_momentum.max_ulps < 32
    assert drift.linear_momentum.max_fraction < 32 * 2.0**-53
    assert drift.energy.max_fraction < (1e-3 if integrator.order == 2 else 64 * 2.0**-53)
    assert "ang. mom. of pole" in str(drift)
    # Newton's energy, and the angular momentum about other axes, are not: the test sees it.
    newton = orbits.diagnostics.energy(system.gm.value, run.q.value, run.v.value)
    assert np.ptp(newton) / abs(newton[0]) > 1e-3
    assert orbits.diagnostics.drift(run.angular_momentum().value).max_fraction > 1e-3


@pytest.mark.nightly
def test_terms_with_different_poles_keep_no_angular_momentum_and_the_drift_says_so():
    system = flattened(three()).with_terms(orbits.terms.ZonalHarmonics("inner", J2=0.01, radius=0.1, pole=(1, 0, 0)))
    drift = march(system, orbits.Gauss(stages=4), duration=1.0).drift()
    assert np.isnan(drift.angular_momentum.max_fraction)
    assert "angular momentum is not conserved: terms have different poles" in str(drift)


@pytest.mark.nightly
def test_an_equatorial_satellite_stays_on_the_circle_that_the_field_allows():
    r, J2, radius = 1.3, 0.05, 0.5
    speed = np.sqrt((1 + 1.5 * J2 * (radius / r) ** 2) / r)
    system = planet(satellite=(0.0, [r, 0, 0], [0, speed, 0]))
    system = system.with_terms(orbits.terms.ZonalHarmonics(J2=J2, radius=radius, pole=(0, 0, 1)))
    run = march(system, orbits.Gauss(stages=8), dt=0.1, duration=100.0)
    t, x = run.t.value, run.q.value[:, 1]
    circle = r * np.stack([np.cos(speed / r * t), np.sin(speed / r * t), np.zeros_like(t)], axis=1)
    # The rounding of the speed, 1e-16 of it, over 12 turns.
    assert np.max(np.abs(x - circle)) < 1e-13


def test_the_node_of_a_low_orbit_regresses_as_theory_says():
    """-3/2 n J2 (R/p)^2 cos i, of first order: 51.6 degrees and 394 km give about 5 degrees a day."""
    r, inc = RADIUS + 394.0, np.radians(51.6)
    speed = np.sqrt(GM_EARTH / r)
    state = [[0, 0, 0], [r, 0, 0]], [[0, 0, 0], [0, speed * np.cos(inc), speed * np.sin(inc)]]
    system = orbits.System(["Earth", "station"], [GM_EARTH, 0.0], *state, units=UNITS)
    system = system.with_terms(orbits.terms.ZonalHarmonics("Earth", **EARTH, pole=(0, 0, 1)))
    run = orbits.propagate(
        system, orbits.Gauss(stages=8), dt=300, duration=5 * u.day, samples=5 * 288 + 1, progress=False
    )
    h = np.cross(run.q.value[:, 1], run.v.value[:, 1])
    node = np.unwrap(np.arctan2(h[:, 0], -h[:, 1]))
    rate = np.degrees(np.polyfit(run.t.value / 86400, node, 1)[0])
    q, v = run.q.value[:, 1], run.v.value[:, 1]
    a = np.mean(1 / (2 / np.linalg.norm(q, axis=1) - np.sum(v * v, axis=1) / GM_EARTH))
    tilt = np.mean(h[:, 2] / np.linalg.norm(h, axis=1))
    first = -1.5 * np.sqrt(GM_EARTH / a**3) * EARTH["J2"] * (RADIUS / a) ** 2 * tilt * 86400
    # What is left is of second order in J2.
    assert rate == pytest.approx(np.degrees(first), rel=2 * EARTH["J2"])
    assert rate == pytest.approx(-5.02, abs=0.03)


@pytest.mark.parametrize("integrator", first(1, [orbits.Gauss(stages=8), orbits.StormerVerlet()]))
def test_a_massless_satellite_moves_as_one_of_vanishing_mass(integrator):
    outer = (0.002, [-2, 0.5, 0], [-0.1, -0.6, 0.3])
    runs = [
        march(flattened(planet(outer=outer, satellite=(gm, [1, 0, 0.2], [0, 0.9, 0.3]))), integrator, duration=5.0)
        for gm in (0.0, 1e-30)
    ]
    # Two summation orders over 250 steps.
    assert np.max(np.abs(runs[0].q.value - runs[1].q.value)) < 1e-13


@pytest.mark.parametrize("integrator", first(1, [orbits.Gauss(stages=8), orbits.StormerVerlet()]))
def test_particles_get_the_same_bits_with_any_number_of_threads(integrator):
    rng = np.random.default_rng(6)
    directions = rng.normal(size=(40, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    bodies = {
        f"p{k}": (0.0, x, np.cross(POLE, x) / np.linalg.norm(x) ** 1.5)
        for k, x in enumerate(rng.uniform(1.5, 3.0, (40, 1)) * directions)
    }
    system = flattened(planet(moon=(0.01, [1, 0, 0.2], [0, 0.9, 0.3]), **bodies))
    one, two = (march(system, integrator, duration=2.0, threads=threads) for threads in (1, 2))
    assert np.array_equal(one.q, two.q)
    assert np.array_equal(one.v, two.v)


def test_an_archive_holds_the_terms_and_a_resumed_run_has_the_same_bits(tmp_path):
    system, path = flattened(three()), tmp_path / "run.h5"
    whole = march(system, orbits.Gauss(stages=8), duration=8.0, samples=9)
    march(system, orbits.Gauss(stages=8), duration=4.0, samples=5, archive=path)
    stored = orbits.Trajectory.open(path)
    assert stored.system == system
    assert np.array_equal(stored.energy(), whole.energy()[:5])
    stored.close()
    run = orbits.resume(path, until=8.0, progress=False)
    assert np.array_equal(run.q, whole.q)
    assert np.array_equal(run.v, whole.v)
    assert run[3].terms == system.terms
    assert np.array_equal(run.at(0.51).q, whole.at(0.51).q)
    run.close()


def test_an_archive_of_newtonian_runs_is_as_before(tmp_path):
    import h5py

    march(three(), orbits.Gauss(stages=8), duration=1.0, archive=tmp_path / "plain.h5").close()
    march(flattened(three()), orbits.Gauss(stages=8), duration=1.0, archive=tmp_path / "terms.h5").close()
    with h5py.File(tmp_path / "plain.h5") as plain, h5py.File(tmp_path / "terms.h5") as terms:
        assert plain.attrs["orbits"] == b"1"
        assert "model" not in plain["system"].attrs
        # A version that does not know of terms must not read this one as Newton's.
        assert terms.attrs["orbits"] == b"1 with terms"
        assert "model" in terms["system"].attrs


def test_an_archive_with_a_term_of_a_later_version_says_so():
    from orbits.system.model_text import from_json

    text = '{"terms": [{"kind": "tides", "body": "planet"}], "forces": []}'
    with pytest.raises(ArchiveError, match="'tides' is not known to this version of orbits"):
        from_json(three(), text)


@pytest.mark.nightly
def test_a_certificate_is_measured_on_the_whole_lagrangian():
    certificate = orbits.certify(flattened(three()), orbits.Gauss(stages=4), 0.05)
    names = [finding.name for finding in certificate.findings]
    assert "momentum map: rotation about the pole" in names
    assert "momentum map: rotation about x" not in names
    assert certificate.ok, str(certificate)


def test_what_a_method_or_a_tool_cannot_take_is_refused(tmp_path):
    spin = FrameDragging("planet", spin=0.1, pole=POLE, c=50)
    with pytest.raises(InputError, match=r"'newtonian . frame dragging'.* is not"):
        march(three().with_terms(spin), orbits.StormerVerlet())
    with pytest.raises(InputError, match=r"cannot march bodies with the force of drag. Use .*Gauss"):
        march(three().with_forces(orbits.terms.Drag(rate=1e-3)), orbits.StormerVerlet())
    with pytest.raises(InputError, match="knows Newton's gravity alone, but this system also has ZonalHarmonics"):
        march(flattened(three()), orbits.Gauss(stages=4), stop=orbits.events.EnergyErrorAbove(1e-6))
    with pytest.raises(InputError, match="REBOUND knows Newton's gravity alone"):
        to_rebound(flattened(three()))


@pytest.mark.nightly
def test_a_velocity_dependent_term_is_certified_in_canonical_form():
    spin = FrameDragging("planet", spin=0.1, pole=POLE, c=3)
    certificate = orbits.certify(three().with_terms(spin), orbits.Gauss(stages=2), 0.05)
    assert certificate.ok, str(certificate)


@pytest.mark.nightly
def test_thousands_of_bodies_share_the_term_among_threads_to_the_same_bits():
    n = 1001
    rng = np.random.default_rng(8)
    q, v = rng.normal(size=(n, 3)), 0.1 * rng.normal(size=(n, 3))
    gm = np.full(n, 1e-3)
    system = orbits.System([f"b{k}" for k in range(n)], gm, q, v, units=orbits.DIMENSIONLESS, softening=0.1)
    system = system.with_terms(orbits.terms.ZonalHarmonics("b500", J2=100.0, radius=0.05, pole=POLE))
    runs = [march(system, orbits.StormerVerlet(), dt=0.01, duration=0.03, threads=threads) for threads in (1, 2)]
    assert np.array_equal(runs[0].q, runs[1].q)
    assert runs[0].drift().linear_momentum.max_fraction < 1e-15
