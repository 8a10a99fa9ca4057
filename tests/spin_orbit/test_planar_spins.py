"""Planar spins: one map with the Lagrangian of the package, areas, orders, bits, Hyperion's sea, tides, refusals."""

import math

import mpmath
import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.diagnostics.loops import area, loop
from orbits.errors import InputError, SingularityError, StepWarning
from orbits.kernels.rotation.planar_spins import cosine_of_turns, sine_of_turns
from orbits.methods import Composition
from orbits.spin_orbit import PlanarSpins, planar

from ..coverings import cover, each

HYPERION = PlanarSpins(eccentricity=0.1, alpha=0.89)
MERCURY = PlanarSpins(eccentricity=0.20563, asphericity=2.18e-4)
ARCSEC = np.pi / 180 / 3600


def test_sine_and_cosine_of_turns_are_right_to_the_last_bits():
    y = np.linspace(-0.5, 0.5, 301)
    sine, cosine = np.array([(sine_of_turns(x, x * x), cosine_of_turns(x * x)) for x in y]).T
    with mpmath.workdps(30):
        exact = [(mpmath.sin(2 * mpmath.pi * mpmath.mpf(x)), mpmath.cos(2 * mpmath.pi * mpmath.mpf(x))) for x in y]
        errors = np.array([(float(a - c), float(b - d)) for a, b, (c, d) in zip(sine, cosine, exact, strict=True)])
    assert np.abs(errors[:, 0]).max() < 3e-16
    assert np.abs(errors[:, 1]).max() < 8e-16


@pytest.mark.parametrize(
    ("e", "alpha", "start"), [(0.1, 0.89, (0.3, 1.3)), (0.6, 0.5, (-1.0, 0.4)), (0.0, 1.0, (2.0, 3.0))]
)
def test_spins_are_those_of_the_lagrangian_of_orbit_and_spin(e, alpha, start):
    lagrangian = orbits.lagrangians.spin_orbit.with_parameters(alpha=alpha, eps=1e-20)
    q, v = [1 - e, 0.0, start[0]], [0.0, np.sqrt((1 + e) / (1 - e)), start[1]]
    n = 400
    path = orbits.march(lagrangian, orbits.Gauss(stages=8), q=q, v=v, dt=2 * np.pi / n, steps=3 * n, every=n)
    spins = PlanarSpins(eccentricity=e, alpha=alpha, steps=400)
    mine = spins.section(*start, 3)
    # By chaos, differences grow tenfold in a revolution of the second.
    assert np.abs(mine.theta[0] - path.q[:, 2]).max() < 5e-12
    assert np.abs(mine.rate[0] - path.v[:, 2]).max() < 5e-12


def test_a_rigid_body_in_the_plane_of_its_orbit_turns_as_the_planar_spin():
    e, theta, rate = 0.1, 0.3, 1.3
    moon = orbits.RigidBody(  # so small that its figure does not move its orbit
        shape=np.array([190, 145, 114]) * 1e-9, attitude=[np.cos(theta / 2), 0, 0, np.sin(theta / 2)], spin=rate
    )
    places, speeds = [[0, 0, 0], [1 - e, 0, 0]], [[0, 0, 0], [0, np.sqrt((1 + e) / (1 - e)), 0]]
    system = orbits.System(["Saturn", "Hyperion"], [1.0, 0.0], places, speeds, units=orbits.DIMENSIONLESS)
    run = orbits.propagate(
        system.with_rigid({"Hyperion": moon}), Composition(orbits.StormerVerlet(), order=8), dt=2 * np.pi / 384,
        duration=6 * np.pi, samples=4, progress=False,
    )  # fmt: skip
    section = PlanarSpins(eccentricity=e, asphericity=(190**2 - 145**2) / (190**2 + 145**2)).section(theta, rate, 3)
    axis = run.rotation.attitude("Hyperion", matrix=True)[:, :, 0]
    seen = np.arctan2(axis[:, 1], axis[:, 0]) - section.theta[0]
    # A spin of the sea, whose errors grow fivefold in a revolution: 1e-9 is what PlanarSpins is asked for.
    assert np.abs(np.sin(seen)).max() < 2e-8
    assert np.abs(run.rotation.angular_velocity("Hyperion").value[:, 2] - section.rate[0]).max() < 2e-8


@pytest.mark.filterwarnings("ignore::orbits.errors.StepWarning")
@cover(("tides", "order"), [0.0, 0.05], [2, 4, 6, 8], strength=1)
def test_a_revolution_converges_with_the_order_of_the_method(order, tides):
    def end(steps, order=order):
        spins = PlanarSpins(eccentricity=0.3, alpha=1.2, tides=tides, order=order, steps=steps)
        return spins.section([0.3, 1.0, 2.0], [0.5, 1.4, 2.2], 1).theta[:, 1]

    exact = end(400, 8)
    counts = {2: (400, 800), 4: (48, 96), 6: (48, 96), 8: (36, 72)}[order]
    errors = [np.abs(end(count) - exact).max() for count in counts]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.5)
    coarse = PlanarSpins(eccentricity=0.3, alpha=1.2, tides=tides, order=order, steps=counts[0])
    told = coarse.error_of_a_revolution([0.3, 1.0, 2.0], [0.5, 1.4, 2.2])
    assert told == pytest.approx((1.0 - 0.5**order) * errors[0], rel=0.1)  # beside twice as many steps


@pytest.mark.parametrize(("centre", "revolutions"), [((0.0, 0.55), 30), ((0.5, 1.8), 2)])
def test_areas_of_the_section_are_kept(centre, revolutions):
    theta, rate = loop(np.array(centre[:1]), np.array(centre[1:]), np.array([0.1]), np.array([0.1]), 4000)
    section = HYPERION.section(theta[:, 0], rate[:, 0], revolutions)
    areas = [area(section.theta[:, k, None], section.rate[:, k, None]) for k in range(revolutions + 1)]
    assert np.abs(np.array(areas) / areas[0] - 1).max() < 2e-13
    _, matrices = HYPERION.tangents(*centre, 16)
    assert np.abs(np.linalg.det(matrices) - 1).max() < 1e-13


def test_tangents_are_the_derivatives_of_the_march():
    spins, h = PlanarSpins(eccentricity=0.3, alpha=0.8, tides=0.01), 1e-6
    place, matrices = spins.tangents(0.4, 1.2, 8)
    near = spins.march([0.4 + h, 0.4 - h, 0.4, 0.4], [1.2, 1.2, 1.2 + h, 1.2 - h], 1, samples=8)
    both = np.stack([near.theta, near.rate], axis=-1)[:, 1:]
    found = np.stack([both[0] - both[1], both[2] - both[3]], axis=-1) / (2 * h)
    assert np.abs(matrices - found).max() < 1e-8
    assert np.abs(place - both.mean(axis=0)).max() < 1e-10


def test_on_a_circle_the_energy_about_the_planet_neither_drifts_nor_leaves_its_band():
    spins = PlanarSpins(eccentricity=0.0, alpha=0.6, steps=16)
    path = spins.section([0.4, 1.2, 0.1], [1.0, 1.1, 2.5], 30_000, every=30)
    energy = (path.rate - 1) ** 2 / 2 - 0.36 / 4 * np.cos(2 * path.theta)
    early, late = energy[:, :500], energy[:, 500:]
    assert np.abs(late.mean(axis=1) - early.mean(axis=1)).max() < 1e-9
    assert np.abs(energy - energy[:, :1]).max() < 2e-7


def test_bits_do_not_depend_on_threads_or_company_or_on_where_a_march_pauses(monkeypatch):
    rng = np.random.default_rng(4)
    theta, rate = rng.uniform(0, 3, 77), rng.uniform(0, 3, 77)
    one, two = (HYPERION.section(theta, rate, 50, threads=threads) for threads in (1, 2))
    alone = HYPERION.section(theta[40], rate[40], 50)
    monkeypatch.setattr(planar, "AT_ONCE", 7)
    paused = HYPERION.section(theta, rate, 50, threads=1)
    for other in (two, paused):
        assert np.array_equal(one.theta, other.theta)
        assert np.array_equal(one.rate, other.rate)
    assert np.array_equal(alone.theta[0], one.theta[40])
    thinned = HYPERION.section(theta, rate, 50, every=10)
    assert np.array_equal(thinned.rate, one.rate[:, ::10])
    assert np.array_equal(thinned.eccentric_anomaly, one.eccentric_anomaly[::10])
    exponents = [HYPERION.lyapunov(theta, rate, 21, threads=threads) for threads in (1, 2)]
    assert np.array_equal(*exponents)


def test_a_march_passes_the_pericentres_of_the_section():
    section = HYPERION.section([0.1, 0.2], [0.5, 2.7], 5)
    path = HYPERION.march([0.1, 0.2], [0.5, 2.7], 5, samples=32)
    assert np.abs(path.theta[:, ::32] - section.theta).max() < 1e-8
    assert path.true_anomaly[::32] == pytest.approx(2 * np.pi * np.arange(6), abs=1e-12)
    assert path.true_anomaly[16] == pytest.approx(np.pi)
    assert np.all(np.diff(path.true_anomaly) > 0)
    assert np.all(np.abs(path.off_planet) <= np.pi / 2)


def test_hyperions_section_has_the_sea_and_the_island_of_wisdom_peale_and_mignard():
    island = HYPERION.libration(1)
    assert island.stable
    assert island.rate == pytest.approx(0.5515, abs=1e-4)
    sea = HYPERION.section(1.0, [1.0, 1.5, 2.0], 20_000)
    # All of them wander through the same sea, of these edges.
    assert sea.rate.min(axis=1) == pytest.approx([0.05] * 3, abs=0.03)
    assert sea.rate.max(axis=1) == pytest.approx([2.54] * 3, abs=0.03)
    exponents = HYPERION.lyapunov([1.0, island.theta + 0.1, 0.0], [1.5, island.rate, 2.8], 2000)
    assert exponents[0] > 0.5
    assert exponents[1:].max() < 0.01


def test_mercurys_forced_libration_is_the_measured_one_and_its_free_one_takes_twelve_years():
    found = MERCURY.libration(3 / 2)
    assert found.stable
    # Margot et al. (2007) measured 35.8 ± 2 arcseconds; of the series of Goldreich and Peale these are the values.
    assert found.sine(1) / ARCSEC == pytest.approx(38.44, abs=0.01)
    assert found.sine(2) / ARCSEC == pytest.approx(-4.05, abs=0.01)
    assert abs(found.cosine(1)) < 1e-9 * found.sine(1)
    assert found.period * 87.9693 / 365.25 == pytest.approx(11.64, abs=0.01)
    # The same period from a spin that librates freely.
    path = MERCURY.section(found.theta + 1e-4, found.rate, 4096)
    angle = path.folded[0] - found.theta
    terms = orbits.diagnostics.frequency_analysis(np.arange(4097.0), angle.astype(complex), 2)
    assert 2 * np.pi / abs(terms.frequency[0]) == pytest.approx(found.period, rel=1e-5)


@pytest.mark.parametrize("alpha", [0.02, 0.3, 0.8, 1.3, 1.7])
def test_on_a_circle_a_small_libration_takes_one_over_alpha_revolutions_also_if_it_is_shorter_than_one(alpha):
    found = PlanarSpins(eccentricity=0.0, alpha=alpha).libration(1)
    assert found.rate == pytest.approx(1.0, abs=1e-12)
    assert np.abs(found.angle).max() < 1e-12
    assert found.period == pytest.approx(1 / alpha, rel=1e-8)


@pytest.mark.parametrize("e", [0.0, 0.2, 0.6, 0.9])
def test_tides_alone_lead_to_the_pseudo_synchronous_rate_of_hut(e):
    spins = PlanarSpins(eccentricity=e, asphericity=0.0, tides=1e-6 * (1 - e * e) ** 6)
    # Without a figure the map of the rate is linear: two starts give its fixed point.
    start = np.array([0.5, 3.0])
    end = spins.section(0.0, start, 1).rate[:, 1] - start
    found = start[0] - end[0] * (start[1] - start[0]) / (end[1] - end[0])
    assert found == pytest.approx(spins.equilibrium_rate, rel=1e-6)


def test_tides_shrink_areas_as_the_mean_of_the_sixth_power_of_the_distance_says():
    e, tides = 0.3, 0.01
    spins = PlanarSpins(eccentricity=e, alpha=0.5, tides=tides)
    _, matrices = spins.tangents(0.4, 1.2, 1)
    mean = (1 + 3 * e**2 + 3 / 8 * e**4) / (1 - e * e) ** 4.5
    assert np.log(np.linalg.det(matrices[0])) == pytest.approx(-2 * np.pi * tides * mean, rel=1e-9)


def test_tides_turn_the_locked_axis_to_where_the_torques_balance():
    spins = PlanarSpins(eccentricity=0.20563, asphericity=2.18e-4, tides=1e-6)
    found = spins.libration(1.5)
    assert np.abs(found.multipliers).max() < 1
    path = spins.section(found.theta, found.rate, 20)
    assert np.abs(path.folded - found.theta).max() < 1e-11
    e2 = 0.20563**2
    mean = found.theta - found.cosine(1) - found.cosine(2)
    drag = 1e-6 * (1.5 - spins.equilibrium_rate) * (1 + 3 * e2 + 3 / 8 * e2**2) / (1 - e2) ** 4.5
    stiffness = MERCURY.libration(1.5).period ** -2
    assert mean == pytest.approx(-drag / stiffness, rel=1e-3)


def test_more_than_one_shape_of_starts_and_units_of_angle():
    grid = HYPERION.section(np.zeros((2, 1)), np.ones((1, 3)), 2)
    assert grid.theta.shape == (6, 3)
    assert np.array_equal(HYPERION.section(30 * u.deg, 1.0, 2).theta, HYPERION.section(np.radians(30), 1.0, 2).theta)
    assert "6 starts, 2 revolutions" in repr(grid)
    assert grid.plot().axes[0].get_title() == "e = 0.1, α = 0.89"


@each(
    ("changes", "message"),
    [
        ({"eccentricity": 1.0}, "expected that of an ellipse"),
        ({"eccentricity": -0.1}, "expected that of an ellipse"),
        ({"eccentricity": math.nan}, "eccentricity must be finite"),
        ({"alpha": -0.1}, "alpha is -0.1; expected a finite number >= 0"),
        ({"alpha": None}, "the moon has no figure"),
        ({"asphericity": 0.1}, "give one of them"),
        ({"alpha": 2.0}, "no body has more than 1"),
        ({"tides": -1e-9}, "tides is -1e-09; expected a finite number >= 0"),
        ({"order": 5}, "expected 2, 4, 6 or 8"),
        ({"steps": 0}, "steps must be a whole number >= 1"),
    ],
)
def test_what_is_no_orbit_or_moon_is_refused(changes, message):
    with pytest.raises(InputError, match=message):
        PlanarSpins(**{"eccentricity": 0.1, "alpha": 0.89, **changes})


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([], [], 10), "theta and rate are empty"),
        ((0.0, math.inf, 10), "rate is inf; expected finite numbers"),
        (([0.0, math.nan], 1.0, 10), r"theta\[1\] is nan"),
        (([0.0, 1.0], [1.0, 2.0, 3.0], 10), "one start for each pair"),
        ((0.0, 1.0, -3), "revolutions must be a whole number >= 1, got -3"),
        ((0.0, 1.0, 0), "revolutions must be a whole number >= 1, got 0"),
        ((0.0, 1.0, 2.5), "revolutions must be a whole number >= 1"),
        ((1 * u.km, 1.0, 2), "theta"),
    ],
)
def test_starts_that_are_none_are_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        HYPERION.section(*arguments)
    with pytest.raises(InputError, match=message):
        HYPERION.lyapunov(*arguments)


def test_other_requests_that_make_no_sense_are_refused():
    with pytest.raises(InputError, match="every = 3 does not divide the 10 revolutions"):
        HYPERION.section(0.0, 1.0, 10, every=3)
    with pytest.raises(InputError, match="expected a multiple of 1/2"):
        HYPERION.libration(1.2)
    with pytest.raises(InputError, match="expected 0 or pi/2, unless a rate is given"):
        HYPERION.libration(1, theta=0.4)
    with pytest.raises(InputError, match="threads, if given"):
        HYPERION.section(0.0, 1.0, 10, threads=0)
    for ask in (lambda: HYPERION.march(0.0, 1.0, 10, samples=0), lambda: HYPERION.tangents(0.0, 1.0, 0)):
        with pytest.raises(InputError, match="samples must be a whole number"):
            ask()
    with pytest.raises(InputError, match="theta must be a single number"):
        HYPERION.tangents([0.0, 1.0], 1.0, 4)


def test_a_spin_too_fast_for_the_steps_is_told_with_how_many_it_takes():
    message = r"of rates from 0 to 60: their angles err by .* rad in one revolution. With steps=\d+"
    with pytest.warns(StepWarning, match=message):
        HYPERION.section(0.0, [0.0, 60.0], 2)
    with pytest.warns(StepWarning, match="too long for the tides, whose mean is wrong by 0.0"):
        PlanarSpins(eccentricity=0.5, alpha=0.0, tides=1e-8, steps=4).section(0.0, 1.0, 2)
    with pytest.warns(StepWarning, match="too long"):
        PlanarSpins(eccentricity=0.5, alpha=0.89, steps=8).section(0.0, 1.0, 2)
    with pytest.warns(StepWarning), pytest.raises(SingularityError, match="became infinite"):
        HYPERION.section(0.0, 1e308, 20)


def test_a_resonance_that_is_not_there_is_said_so():
    with pytest.raises(InputError, match="no spin of 2 turns in a revolution was found"):
        PlanarSpins(eccentricity=0.0, alpha=0.5, tides=0.1).libration(2)


@pytest.mark.parametrize(("resonance", "theta"), [(1.5, 0.0), (1.5, math.pi / 2), (2, 0.0), (3, math.pi / 2)])
def test_a_circle_locks_spins_in_no_resonance_but_1(resonance, theta):
    """There the problem is a pendulum: all spins of a rate repeat, whatever theta is, and none librates."""
    with pytest.raises(InputError, match="A resonance too weak for floats, as all but 1 on a circle, is none"):
        PlanarSpins(eccentricity=0.0, alpha=0.3).libration(resonance, theta=theta)
    assert PlanarSpins(eccentricity=0.0, alpha=0.3).libration(1).period == pytest.approx(1 / 0.3, rel=1e-9)


def test_a_loop_has_whole_numbers_of_points_and_its_area():
    assert area(*loop([1, 0], [0, 1], [0.1, 0], [0.1, 0], points=5)) == pytest.approx(-math.pi * 0.01, rel=1e-13)
    for points in (3.5, 3):
        with pytest.raises(InputError, match="points must be a whole number >= 4"):
            loop([1, 0], [0, 1], [0.1, 0], [0.1, 0], points=points)


def test_dots_take_options_of_matplotlib_by_either_name():
    lines = HYPERION.section(0.0, [0.5, 1.0], 2).plot(markersize=4, c="k").axes[0].lines
    assert {(line.get_markersize(), line.get_color()) for line in lines} == {(4, "k")}


def test_a_section_that_no_memory_holds_is_refused_with_its_size():
    with pytest.raises(InputError, match=r"10,000 spins at 100,000,000,000 places take 16,000,000 GB"):
        HYPERION.section(np.zeros(10_000), 1.0, 10**11)
