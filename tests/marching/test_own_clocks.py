"""The parts of particles with clocks of their own: bodies between their steps, fields, proposals of steps."""

import math

import numpy as np
import pytest
from numpy.polynomial import legendre

import orbits
from orbits.kernels.compile import kernel
from orbits.kernels.dense import double_integrals, single_integrals
from orbits.kernels.gravity.pair_sums import attraction, close_attraction, gross_field
from orbits.kernels.lanes import WIDTH, load, store
from orbits.kernels.steps import Method, Model
from orbits.lagrangians.newtonian import newtonian, parameters
from orbits.marching.clocks.step_times import Place
from orbits.marching.following.bodies_between import PLACES, chart, place_bodies
from orbits.marching.following.own_clocks import proposed
from orbits.propagation.marchers import bound
from orbits.tableaux import gauss

from ..problems import three_bodies

THETA = np.array([0.0, 0.05, 0.13, 0.31, 0.5, 0.77, 0.95, 1.0])


@kernel
def integrals(theta, rows, out):
    """Call `double_integrals` from Python."""
    double_integrals(load(theta, 0), rows, out)


@kernel
def integrals_once(theta, rows, out):
    """Call `single_integrals` from Python."""
    single_integrals(load(theta, 0), rows, out)


@kernel
def placed(form, coefficients, tag, strength, field, k, theta):
    """Call `place_bodies` from Python."""
    place_bodies(Method(form, coefficients), Model(tag, strength), field, k, load(theta, 0), 0.0, 1.0)


@kernel
def pulled(strength, sources, lows, place, place_lo, out):
    """Call `attraction` and `close_attraction` with eight points in lanes."""
    x, y, z = load(place, 0), load(place, 1), load(place, 2)
    lo = load(place_lo, 0), load(place_lo, 1), load(place_lo, 2)
    a = attraction(strength, sources, x, y, z)
    b = close_attraction(strength, sources, lows, (x, y, z), lo)
    store(out, 0, a[0])
    store(out, 1, b[0])
    store(out, 2, b[1])
    store(out, 3, b[2])
    store(out, 4, b[3])
    store(out, 5, gross_field(strength, sources, x, y, z))


def test_double_integrals_are_those_of_shifted_legendre_polynomials():
    out = np.zeros((12, WIDTH))
    integrals(THETA, 12, out)
    for k in range(12):
        twice = legendre.Legendre.basis(k).integ(2, lbnd=-1)
        np.testing.assert_allclose(out[k], twice(2 * THETA - 1) / 4, rtol=0, atol=1e-16)


@pytest.mark.parametrize("stages", [3, 6, 8])
def test_the_chart_gives_back_the_modes_of_a_polynomial(stages):
    tableau, count = gauss(stages), min(stages + 4, 12)
    modes = np.random.default_rng(4).standard_normal(count)
    table = chart(tableau)
    at_nodes, at_points = (legendre.legval(2 * x - 1, modes) for x in (tableau.nodes, table[0]))
    rows = table[9:41].reshape(2 * WIDTH, 2 * WIDTH)
    kicks = np.zeros(WIDTH)
    kicks[:stages] = tableau.b * at_nodes
    found = np.concatenate([kicks, at_points]) @ rows
    np.testing.assert_allclose(found[:count], modes, rtol=0, atol=1e-14)
    assert not found[count:].any()
    low = modes[:stages] @ np.eye(stages)
    kicks[:stages] = tableau.b * legendre.legval(2 * tableau.nodes - 1, low)
    np.testing.assert_allclose(kicks @ table[1:9], np.pad(low, (0, WIDTH - stages)), rtol=0, atol=1e-14)


def test_the_chart_differentiates_a_polynomial_that_begins_with_0():
    table = chart(gauss(8))
    curve = legendre.Legendre(np.random.default_rng(7).standard_normal(9))  # of degree 8, on [-1, 1]
    curve -= curve(-1.0)
    there = 2.0 * table[0] - 1.0
    np.testing.assert_allclose(curve(there) @ table[41:], 2.0 * curve.deriv()(there), rtol=0, atol=1e-12)


def test_single_integrals_are_those_of_shifted_legendre_polynomials():
    out = np.zeros((12, WIDTH))
    integrals_once(THETA, 12, out)
    for k in range(12):
        once = legendre.Legendre.basis(k).integ(1, lbnd=-1)
        np.testing.assert_allclose(out[k], once(2 * THETA - 1) / 2, rtol=0, atol=2e-16)


def test_bodies_between_their_steps_are_where_partial_steps_lead():
    """To 4e-15 at a tolerance of 1e-8, where the polynomial through the stages alone is 1.2e-13 off."""
    gm, q, v = three_bodies(particles=1)
    start = orbits.System(["a", "b", "c", "p"], gm=gm, q=q, v=v, units=orbits.DIMENSIONLESS)
    march = bound(start, "gauss", orbits.Adaptive(1e-8), 1)
    march.advance(12)
    loops, begun = march.stepper.loops, march.stepper.state["clock"].copy()
    path, kicks = loops._record
    mine = loops.follower._memories[0].stepping(begun, (loops.times, loops._stages, path, kicks), path, (0, 0))
    off = {"known": 0.0, "first": 0.0}
    for k in (3, 7, 11):
        for name in off:
            mine.field.known[:] = False
            table = mine.field.chart.copy()
            if name == "first":  # nothing is learnt from other points: the modes of the stages alone
                table[9:41] = 0.0
                table[9:25:2] = table[1:9]
            field = mine.field._replace(chart=table)
            h = loops.times[k + 1] - loops.times[k]
            placed(march.stepper.form.tag, mine.table, newtonian.tag, parameters(gm[:3]), field, k, THETA)
            for i, theta in enumerate(THETA):
                again = bound(start, "gauss", orbits.Adaptive(1e-8), 1)
                expected, _ = again_at(again, k, theta * h)
                high = field.room[PLACES : PLACES + 9, i].reshape(3, 3).T
                off[name] = max(off[name], np.abs(high - expected[:3]).max())
    assert begun[0] == march.time
    assert off["known"] < 1e-14
    assert off["first"] > 5e-14


def again_at(march, steps, part):
    """Return the state a time after some steps."""
    march.advance(steps)
    return march.state_at(Place(0, march.time + part))


def test_close_fields_keep_digits_and_give_the_rate():
    rng = np.random.default_rng(8)
    gm = rng.uniform(0.1, 1.0, 5)
    strength, sources = parameters(gm, 0.0), rng.standard_normal((15, WIDTH))
    place, out = sources[[0, 5, 10]] + rng.standard_normal((3, WIDTH)), np.zeros((6, WIDTH))
    zero = np.zeros_like(sources)
    pulled(strength, sources, zero, place, zero[:3], out)
    assert np.array_equal(out[0], out[1])
    apart = sources.reshape(3, 5, WIDTH) - place[:, None]
    r = np.sqrt((apart**2).sum(axis=0))
    np.testing.assert_allclose(out[4], (gm[:, None] / r**3).sum(axis=0), rtol=1e-14)
    np.testing.assert_allclose(out[5], (gm[:, None] / r**2).sum(axis=0), rtol=1e-14)
    # A body and a particle at 1e-8 of each other, at distance 1 of the origin: the low parts are all that tells.
    sources[:], place[:] = 1.0, 1.0
    sources[1:5], sources[6:10], sources[11:] = 50.0, 50.0, 50.0
    lows = np.zeros_like(sources)
    lows[0] = 1e-17
    place[0] = 1.0 - 2.0**-27
    pulled(strength, sources, lows, place, np.zeros((3, WIDTH)), out)
    pull = gm[0] / (2.0**-27 + 1e-17) ** 2
    np.testing.assert_allclose(out[1], pull, rtol=1e-14)


@kernel
def proposal(h, factor, nodes, rates, stages):
    """Call `proposed` from Python."""
    return proposed(h, factor, nodes, rates, stages)


@pytest.mark.parametrize("stages", [3, 8])
def test_a_proposal_is_as_long_as_the_last_step_in_units_of_the_dynamical_time(stages):
    nodes, fill = gauss(stages).nodes, WIDTH - stages
    padded = np.pad(nodes, (0, fill), mode="edge")
    assert proposal(-2.0, 1.2, padded, np.full(WIDTH, 3.0), stages) == pytest.approx(2.4)
    assert proposal(2.0, 2.0, padded, np.full(WIDTH, 3.0), stages) == pytest.approx(3.0)  # at most half as much again
    assert proposal(2.0, 1.0, padded, np.zeros(WIDTH), stages) == 2.0
    growing = np.exp(0.4 * padded)  # S grows by exp(0.4) in a step
    expected = 2.0 * math.exp(-0.2)  # in the middle of the next step it is that much larger than in the last
    assert proposal(2.0, 1.0, padded, growing, stages) == pytest.approx(expected, rel=0.02)


def test_the_clock_of_a_particle_is_in_its_checkpoint():
    gm, q, v = three_bodies(particles=3)
    start = orbits.System([*"abcpqr"], gm=gm, q=q, v=v, units=orbits.DIMENSIONLESS)
    march = bound(start, "gauss", orbits.Adaptive(), 1)
    march.advance(5)
    kept = march.checkpoint()
    assert kept["particle_clock"].shape == (3, 4)
    assert (kept["particle_clock"][:, :2] != 0.0).all()
    march.advance(20)
    other = bound(start, "gauss", orbits.Adaptive(), 1)
    other.restore(kept)
    other.advance(20)
    for name, array in march.checkpoint().items():
        assert np.array_equal(array, other.checkpoint()[name]), name
