"""The Kepler flow: compared with sixty digits, lanes with numbers, and the energy error of many steps."""

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orbits.kernels.compile import kernel
from orbits.kernels.kepler.flow import kepler_flow, kepler_increments
from orbits.kernels.lanes import load, store
from orbits.kernels.sums.summation import accumulate

from ..coverings import at
from ..kepler_truth import distance, flow, judged
from .kepler_starts import all_sorts, ellipses, energies, increments, needs_extended, start

ECCENTRICITIES = [0.0, 1e-9, 0.1, 0.6, 0.9, 0.99, 0.9999, 1 - 2**-53, 1.0, 1 + 2**-52, 1.001, 1.5, 2.5, 10.0, 3000.0]
# Fractions of the dynamical time at pericentre; from 1 on, for ellipses, sevenths of a period to 300 periods.
STEPS = [1e-9, 1e-5, 0.01, 0.1, 0.5, 1.0, 3.0, 30.0, 1e3, 1e6]


def one_by_one_source(state, gm, dt):
    for p in range(state.shape[1]):
        x, y, z, vx, vy, vz = state[0, p], state[1, p], state[2, p], state[3, p], state[4, p], state[5, p]
        dx, dy, dz, dvx, dvy, dvz = kepler_increments(x, y, z, vx, vy, vz, gm[p], dt[p])
        state[0, p], state[1, p], state[2, p] = x + dx, y + dy, z + dz
        state[3, p], state[4, p], state[5, p] = vx + dvx, vy + dvy, vz + dvz


one_by_one = kernel(one_by_one_source)


@kernel
def many_steps(state, rest, gm, dt, steps):
    """March with increments added by Kahan's addition, as an integrator does; `rest` holds the low parts."""
    for p in range(0, state.shape[1], 8):
        x, y, z = load(state[0], p), load(state[1], p), load(state[2], p)
        u, v, w = load(state[3], p), load(state[4], p), load(state[5], p)
        a, b, c = load(rest[0], p), load(rest[1], p), load(rest[2], p)
        d, e, f = load(rest[3], p), load(rest[4], p), load(rest[5], p)
        h, m = load(dt, p), load(gm, p)
        for _ in range(steps):
            dx, dy, dz, du, dv, dw = kepler_increments(x, y, z, u, v, w, m, h)
            x, a = accumulate(x, a, dx)
            y, b = accumulate(y, b, dy)
            z, c = accumulate(z, c, dz)
            u, d = accumulate(u, d, du)
            v, e = accumulate(v, e, dv)
            w, f = accumulate(w, f, dw)
        store(state[0], p, x)
        store(state[1], p, y)
        store(state[2], p, z)
        store(state[3], p, u)
        store(state[4], p, v)
        store(state[5], p, w)
        store(rest[0], p, a)
        store(rest[1], p, b)
        store(rest[2], p, c)
        store(rest[3], p, d)
        store(rest[4], p, e)
        store(rest[5], p, f)


def moved(state, gm, dt):
    """One step of states (6, n), by lanes."""
    count = state.shape[1]
    padded, strength, step = np.ones((6, count + -count % 8)), np.ones(count + -count % 8), np.zeros(count + -count % 8)
    padded[:, :count], strength[:count], step[:count] = state, gm, dt
    kepler_flow(padded, strength, step)
    return padded[:, :count]


def time(e, step, rng):
    """A time step of either sign: see STEPS."""
    if e < 1 and step >= 1:
        step = min(step, 2100.0) / 7 * 2 * np.pi * (1 - e) ** -1.5
    return float(rng.choice([-1, 1])) * step


def worst_ratio(e, step, rng, count):
    ratios = []
    for _ in range(count):
        state, dt = start(e, rng), time(e, step, rng)
        (end,) = moved(state[:, None], 1.0, dt).T
        error_q, error_v, condition_q, condition_v = judged(state[:3], state[3:], 1.0, dt, end[:3], end[3:], BOUND)
        ratios.append(max(error_q / condition_q, error_v / condition_v))
    return max(ratios)


# The demand is 10. Over 3,000 samples 1.9 was reached.
BOUND = 4.0


@pytest.mark.parametrize("e", ECCENTRICITIES)
def test_flow_of_every_conic_is_within_a_few_times_what_rounding_its_input_does(e):
    rng = np.random.default_rng(int(1e6 * min(e, 1000.0)) + 1)
    some = STEPS[ECCENTRICITIES.index(e) % 6 :: 6]  # each of them with two eccentricities or three; all are slow
    assert max(worst_ratio(e, step, rng, 1) for step in some) <= BOUND


@pytest.mark.slow
@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("e", ECCENTRICITIES)
def test_flow_of_every_conic_over_many_starts(e, step):
    assert worst_ratio(e, step, np.random.default_rng(8), 20) <= BOUND


@given(
    e=st.floats(0.0, 5.0) | st.floats(0.0, 1e-6) | st.floats(-1e-9, 1e-9).map(lambda x: 1.0 + x),
    exponent=st.floats(-9.0, 6.0),
    scale=st.floats(-30.0, 30.0),
    seed=st.integers(0, 2**32 - 1),
)
def test_flow_holds_for_any_conic_step_and_unit(e, exponent, scale, seed):
    rng = np.random.default_rng(seed)
    state, dt = start(e, rng), time(e, 10.0**exponent, rng)
    length, gm = 10.0**scale, 10.0 ** (scale / 2)
    speed = np.sqrt(gm / length)
    state[:3] *= length
    state[3:] *= speed
    dt *= length / speed
    (end,) = moved(state[:, None], gm, dt).T
    error_q, error_v, condition_q, condition_v = judged(state[:3], state[3:], gm, dt, end[:3], end[3:], BOUND)
    assert error_q <= BOUND * condition_q
    assert error_v <= BOUND * condition_v


def test_lanes_have_the_bits_of_numbers_and_do_not_feel_their_neighbours():
    state, gm, dt = all_sorts(800, 1)
    wide, single = state.copy(), state.copy()
    kepler_flow(wide, gm, dt)
    one_by_one(single, gm, dt)
    assert np.isfinite(wide).all()
    assert np.array_equal(wide, single)
    order = np.random.default_rng(2).permutation(800)
    shuffled = np.ascontiguousarray(state[:, order])
    kepler_flow(shuffled, np.ascontiguousarray(gm[order]), np.ascontiguousarray(dt[order]))
    assert np.array_equal(shuffled, wide[:, order])


def test_time_backwards_is_the_mirror_of_time_forwards_to_the_bit():
    state, gm, dt = all_sorts(400, 3)
    mirrored = state * np.array([[1.0], [1.0], [1.0], [-1.0], [-1.0], [-1.0]])
    there, back = state.copy(), mirrored.copy()
    kepler_flow(there, gm, dt)
    kepler_flow(back, gm, -dt)
    back[3:] *= -1.0
    assert np.array_equal(there, back)


def test_no_time_changes_no_bit_and_no_mass_is_a_straight_line():
    state, gm, dt = all_sorts(400, 4)
    still = state.copy()
    kepler_flow(still, gm, 0.0 * dt)
    assert np.array_equal(still, state)
    straight = state.copy()
    kepler_flow(straight, 0.0 * gm, dt)
    assert np.array_equal(straight[3:], state[3:])
    assert np.array_equal(straight[:3], state[:3] + dt * state[3:])


def test_a_short_step_keeps_all_digits_of_its_increment():
    rng = np.random.default_rng(5)
    state = np.array([start(rng.choice([0.0, 0.5, 1.0, 3.0]), rng) for _ in range(64)]).T.copy()
    dt, out = 10.0 ** rng.uniform(-12, -4, 64), np.empty((6, 64))
    increments(state, np.ones(64), dt, out)
    worst = 0.0
    with mp.workdps(60):
        for before, h, change in zip(state.T[::4], dt[::4], out.T[::4], strict=True):
            q, v, _ = flow(before[:3], before[3:], 1.0, h)
            for true, old, got in ((q, before[:3], change[:3]), (v, before[3:], change[3:])):
                exact = [x - mp.mpf(y) for x, y in zip(true, old, strict=True)]
                size = mp.sqrt(sum(x * x for x in exact))
                worst = max(worst, float(distance([mp.mpf(x) for x in got], exact) / size) * 2.0**53)
    # Some roundings of r^-3 and of the product with q: 3.4 was reached.
    assert worst <= 6.0


def test_motion_on_a_line_through_the_centre_bounces_as_the_limit_of_narrow_orbits():
    # From rest at distance 1 the fall takes pi/(2 sqrt 2); then the way back: after twice that time it is where it was.
    fall = np.pi / (2 * np.sqrt(2))
    dt = fall * np.array([0.5, 0.9, 1.1, 1.5, 2.0, -1.3, 20.7, 200.3])
    state = np.zeros((6, 8))
    state[0] = 1.0
    end = moved(state, 1.0, dt)
    assert np.isfinite(end).all()
    assert np.array_equal(end[[1, 2, 4, 5]], np.zeros((4, 8)))
    narrow = np.zeros((6, 8))
    narrow[0], narrow[4] = 1.0, 1e-9
    # An orbit with a pericentre of 5e-19 differs from the line by as much; the time that rounding takes from it more.
    assert np.max(np.abs(moved(narrow, 1.0, dt)[0] - end[0])) <= 1e-12
    assert np.max(np.abs(end[0] - moved(state, 1.0, dt + 2 * fall)[0])) <= 1e-12
    # Straight out at more than the escape velocity, and straight in.
    state[3] = np.array([2.0, -2.0, 10.0, -10.0, np.sqrt(2.0), -np.sqrt(2.0), 1e5, -1e5])
    assert np.isfinite(moved(state, 1.0, 3.7)).all()


@pytest.mark.parametrize("across", [0.0, 1e-9, 1e-8, 1e-7, 1e-6])
def test_within_rounding_of_a_collision_a_body_is_as_near_as_the_time_tells(across):
    # A fall from distance 1, until some roundings dt before and after it: the distance is (9/2 dt^2)^(1/3), which one
    # rounding of the time changes by 6e-11. 1.3e-10 was reached; 0.2 when the last correction was divided by 0.
    until = np.pi / (2.0 - across**2) ** 1.5
    ulps = np.arange(-12, 12)
    state = np.zeros((6, 24))
    state[0], state[4] = 1.0, across
    end = moved(state, 1.0, until + ulps * np.spacing(until))
    away = np.cbrt(4.5 * (ulps * np.spacing(until)) ** 2)
    assert np.abs(np.hypot(end[0], end[1]) - away).max() <= 2.5e-10


def test_no_step_of_any_orbit_hangs_or_leaves_it():
    rng = np.random.default_rng(6)
    n = 40_000
    e = np.concatenate([1 - 10.0 ** rng.uniform(-15.9, 0, n), 1 + 10.0 ** rng.uniform(-15.6, 3.5, n)])
    f = rng.uniform(-1, 1, 2 * n) * np.where(e < 1, np.pi, 0.99 * np.arccos(-1 / np.maximum(e, 1.0)))
    r, root = (1 + e) / (1 + e * np.cos(f)), np.sqrt(1 + e)
    state = np.zeros((6, 2 * n))
    state[0], state[1], state[3], state[4] = r * np.cos(f), r * np.sin(f), -np.sin(f) / root, (e + np.cos(f)) / root
    dt = rng.choice([-1, 1], 2 * n) * 10.0 ** rng.uniform(-15, 12, 2 * n)
    end = moved(state, 1.0, dt)
    assert np.isfinite(end).all()
    # Relative to the kinetic energy at pericentre, of which a rounding of the start is some 1e-16; 4e-14 was reached.
    assert np.max(np.abs(energies(end) - energies(state)) / ((1 + e) / 2)) <= 1e-13


@needs_extended
@pytest.mark.parametrize(
    ("e", "steps_per_period"), at((1, 4), [(0.0, 20), (0.0, 100), (0.05, 17), (0.05, 100), (0.3, 25)])
)
def test_rounding_of_one_step_has_no_preferred_sign(e, steps_per_period):
    state, period = ellipses(e, 160_000, 7)
    out = np.empty_like(state)
    increments(state, np.ones(state.shape[1]), period / steps_per_period, out)
    wide = state.astype(np.longdouble)
    error = np.asarray(energies(wide + out) / energies(wide) - 1, dtype=float) * 2.0**53
    # Not a bias of 1/300 of the rms, which is 0.04 to 0.4 ulp; four standard errors of the mean are a hundredth.
    assert abs(error.mean()) <= 4 * error.std() / np.sqrt(error.size)


@needs_extended
@pytest.mark.parametrize(("e", "rms"), at((0, 2), [(0.0, 0.4), (0.05, 0.15), (0.6, 1.0)]))
def test_energy_wanders_as_the_root_of_the_number_of_steps(e, rms):
    state, period = ellipses(e, 128, 8)
    dt = period / 100 * np.random.default_rng(9).uniform(1.0, 1.5, 128)
    before = energies(state.astype(np.longdouble))
    rest, gm, errors = np.zeros_like(state), np.ones(128), []
    for steps in (10_000, 190_000):
        many_steps(state, rest, gm, dt, steps)
        errors.append(np.asarray(energies(state.astype(np.longdouble) + rest) / before - 1, dtype=float) * 2.0**53)
    for error, steps in zip(errors, (1e4, 2e5), strict=True):
        # In units of 2^-53, over the root of the steps; WHFast's is 0.9 for e = 0 and 0.05, and 1.8 for 0.7.
        assert np.sqrt(np.mean(error**2) / steps) <= rms
        assert abs(error.mean()) <= 4 * error.std() / np.sqrt(128)
