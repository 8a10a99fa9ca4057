"""MEGNO tells regular orbits from chaotic ones, and its numbers are those of the definition and of others."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

import orbits
from orbits.errors import InputError, RetiredWarning
from orbits.resources import data_path
from orbits.time_grid import dynamical_time

YEAR = 2 * math.pi
BOUNDS = {row["name"]: row["asserts"] for row in json.loads(data_path("rebound_test_bounds.json").read_text())["tests"]}


MAPS = [("jacobi", "modified-kick", 17), ("jacobi", "lazy", 11), ("jacobi", "standard", 0)]


def two_planets(a, e, gm):
    rebound = pytest.importorskip("rebound")
    sim = rebound.Simulation()
    sim.add(m=1.0)
    for axis in a:
        sim.add(m=gm, a=axis, e=e)
    sim.move_to_com()
    return sim, orbits.from_rebound(sim)


@pytest.fixture(scope="module")
def chaotic():
    """REBOUND's example of chaos, by its own IAS15 and by runs without dt."""
    assert "MEGNO>50" in BOUNDS["test_megno"]
    sim, system = two_planets([1.0, 1.17 ** (2 / 3)], 0.0, 1e-4)
    sim.integrator = "ias15"
    sim.init_megno(seed=1)
    sim.integrate(1e4)
    return sim.megno(), orbits.megno(system, duration=1e4, samples=11)


@pytest.mark.parametrize(
    ("method", "dt"),
    [
        (orbits.Gauss(stages=8), None),
        (orbits.Gauss(stages=8), "P/20"),
        (orbits.StormerVerlet(), "P/50"),
        *((orbits.WisdomHolman(*kind), "P/20") for kind in MAPS),
    ],
    ids=["adaptive", "gauss", "stormer-verlet", "modified-kick", "lazy", "standard"],
)
def test_regular_planets_keep_the_bound_of_rebounds_test(method, dt):
    assert "MEGNO=2+-.2 at T=1e4" in BOUNDS["test_megno"]
    _, system = two_planets([1.5, 15.0], 0.1, 1e-3)
    m = orbits.megno(system, method, dt=dt, duration=1e4, samples=3, check_step=False)
    assert abs(m.massive.megno[-1] - 2.0) < 0.02  # seen: 0.004, IAS15 in REBOUND 0.013
    assert m.massive.spread[-1] < 0.05
    assert m.massive.lyapunov[-1].value < math.log(1e4) / 1e4 * 1.2  # linear growth


def test_chaotic_planets_keep_the_bound_of_rebounds_test_and_agree_with_it(chaotic):
    theirs, m = chaotic
    assert m.massive.megno[-1] > 50.0
    assert abs(m.massive.megno[-1] / theirs - 1.0) < 0.3  # of one random vector, on an orbit that forgets its digits


def test_chaotic_planets_in_a_map_keep_the_bound_of_rebounds_test_and_agree_with_it(chaotic):
    theirs, _ = chaotic
    _, system = two_planets([1.0, 1.17 ** (2 / 3)], 0.0, 1e-4)
    m = orbits.megno(system, "wisdom-holman", dt=0.07 * YEAR, duration=1e4, samples=3, check_step=False)
    assert m.massive.megno[-1] > 50.0
    assert abs(m.massive.megno[-1] / theirs - 1.0) < 0.3


def test_megno_of_a_chaotic_orbit_grows_as_half_the_lyapunov_exponent(chaotic):
    _, m = chaotic
    t, Y = m.t.value, m.massive.megno
    slope = np.polyfit(t[5:], Y[5:], 1)[0]
    rate = np.polyfit(t[5:], (m.massive.lyapunov.value * t)[5:], 1)[0]  # ln |x| itself
    assert abs(2.0 * slope / rate - 1.0) < 0.25


def test_vectors_are_scaled_when_they_become_large(chaotic):
    _, m = chaotic
    # |x|^2 beyond 2^600, at which vectors are scaled, is ln |x| > 208; seen: 229.
    assert m.massive.lyapunov[-1].value * 1e4 > 210.0
    assert np.isfinite(m.massive.megno[1:]).all()


def test_megno_is_what_its_definition_says():
    """Against the sum over the lengths of a single vector, taken from state-transition matrices at every step."""
    _, system = two_planets([1.0, 1.6], 0.05, 1e-3)
    h, steps, seed = 0.125, 40, 3
    times = h * np.arange(steps + 1)
    method = orbits.StormerVerlet()
    stm = orbits.state_transition(system, method, dt=h, duration=steps * h, samples=times, check_step=False)
    m = orbits.megno(system, method, dt=h, duration=steps * h, samples=times, seed=seed, check_step=False)
    tau, n = dynamical_time(system), len(system)
    starts = np.random.default_rng(seed).standard_normal((8, 2, n, 3))
    starts[:, 1] /= tau
    expected = []
    for x in starts.transpose(0, 2, 1, 3).reshape(8, 6 * n):
        parts = (stm.matrix @ x).reshape(steps + 1, n, 2, 3) * np.array([1.0, tau])[:, None]
        growth = np.diff(np.log(np.linalg.norm(parts.reshape(steps + 1, -1), axis=1)))
        middle, ends = h * (np.arange(steps) + 0.5), h * np.arange(1, steps + 1)
        Y = np.append(0.0, 2.0 / ends * np.cumsum(middle * growth))
        expected.append(np.cumsum(0.5 * (Y[1:] + Y[:-1])) * h / ends)
    np.testing.assert_allclose(m.massive.megno[1:], np.mean(expected, axis=0), rtol=1e-11)


def test_a_particle_in_a_chaotic_zone_stands_out():
    system = orbits.System(["S"], [1.0], np.zeros((1, 3)), np.zeros((1, 3)), units=orbits.DIMENSIONLESS)
    system = system.add("J", gm=1e-3, a=1.0, e=0.05)
    # Inside the overlap of resonances, |a - 1| < 1.3 mu^(2/7) = 0.18 (Wisdom 1980), and far outside.
    system = system.add("wild", primary="S", a=0.86, e=0.05, M=2.0).add("calm", primary="S", a=0.4, M=1.0)
    options = {"duration": 300 * YEAR, "samples": 3}  # steps chosen, as it meets the planet
    m = orbits.megno(system, orbits.Gauss(stages=8), **options)
    assert m["wild"].megno[-1] > 10.0
    assert abs(m["calm"].megno[-1] - 2.0) < 0.1
    assert abs(m.massive.megno[-1] - 2.0) < 0.1
    coupled = orbits.megno(system, orbits.Gauss(stages=8), coupled=True, **options)
    assert coupled["wild"].megno[-1] > 10.0
    assert abs(coupled["calm"].megno[-1] - 2.0) < 0.2
    assert "wild" in repr(m)
    assert m.to_table()["body"].tolist() == ["all massive bodies", "wild", "calm"]


def test_a_run_gives_the_megno_at_its_samples():
    _, system = two_planets([1.0, 1.6], 0.05, 1e-3)
    run = orbits.propagate(system, "gauss", dt=0.1, duration=50.0, samples=5, check_step=False)
    other = orbits.megno(system, "gauss", dt=0.1, duration=50.0, samples=5, check_step=False)
    np.testing.assert_array_equal(run.megno().massive.megno, other.massive.megno)
    assert math.isnan(run.megno().massive.megno[0])  # there is no time yet in which vectors could grow


def test_questions_without_an_answer_are_refused():
    _, system = two_planets([1.0, 1.6], 0.05, 1e-3)
    with pytest.raises(InputError, match="seed"):
        orbits.megno(system, dt=0.1, duration=1.0, seed=-1)
    m = orbits.megno(system, dt=0.1, duration=1.0, check_step=False)
    with pytest.raises(InputError, match=r"m\.massive"):
        m[system.names[1]]


def test_a_particle_that_is_lost_has_no_megno_from_there_on():
    system = orbits.System(["S"], [1.0], np.zeros((1, 3)), np.zeros((1, 3)), units=orbits.DIMENSIONLESS)
    system = system.add("J", gm=1e-3, a=1.0).add("falls", primary="S", a=0.5)
    v = system.values.v.copy()
    v[2] = v[0]
    with pytest.warns(RetiredWarning, match="falls"):
        m = orbits.megno(system.replaced(v=v), "gauss", dt=0.05, duration=3.0, samples=4, check_step=False)
    assert math.isnan(m["falls"].megno[-1])
    assert np.isfinite(m.massive.megno[1:]).all()
