"""State-transition matrices are the derivatives of what the methods compute, and leave the orbit as it is."""

from __future__ import annotations

import math

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.diagnostics.stepping import Bodies, StepMap
from orbits.errors import InputError, RetiredWarning, UnknownNameError
from orbits.integrators import registry
from orbits.integrators.base import SYMPLECTIC
from orbits.lagrangians.newtonian import newtonian
from orbits.marching.legs.within_step import stretches
from orbits.marching.tangents.of_bodies import Tangents
from orbits.methods import SABA, LobattoIIIAB
from orbits.propagation.marchers import bound
from orbits.propagation.variations.following import massive_of, particle_of, tangents_of
from orbits.rebound import to_rebound
from orbits.terms import Drag, FrameDragging, PostNewtonian, ZonalHarmonics
from orbits.time_grid import TimeGrid

from ..coverings import STANDARD, at, first, only

GAUSS, VERLET = orbits.Gauss(stages=8), orbits.StormerVerlet()
YEAR = 2 * math.pi

MAPS = [
    orbits.WisdomHolman(kernel="lazy"),
    orbits.WisdomHolman(corrector=5),
    orbits.WisdomHolman(corrector2=True),
    orbits.WisdomHolman(kernel="standard", corrector=11),
]
METHODS = [*(m for kind in registry().values() for m in kind.examples() if m.serves(newtonian)), *MAPS]
HELIOCENTRIC = orbits.WisdomHolman(coordinates="democratic-heliocentric")
KINDS = [*(label for label in STANDARD if not label.startswith("Lobatto")), "RungeKutta4()"]
"""One method of each kind of tangent maps."""
WEIGHTS = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}  # central differences of eighth order

GM = [1.0, 1e-3, 3e-4]
Q = [[0, 0, 0], [1.0, 0.1, 0.05], [-0.3, 1.7, -0.1]]
V = [[0, 0, 0], [-0.1, 0.95, 0.02], [-0.7, -0.1, 0.05]]


def planets(*particles):
    """A star and two planets, all in three dimensions, and massless particles at these semi-major axes."""
    q, v = np.array(Q) - np.array(GM) @ Q / sum(GM), np.array(V) - np.array(GM) @ V / sum(GM)
    out = orbits.System(["A", "B", "C"], GM, q, v, units=orbits.DIMENSIONLESS)
    for k, a in enumerate(particles):
        out = out.add(f"p{k}", primary="A", a=a, e=0.1, inc=0.2, M=2.0 + k)
    return out


def matrix(system, method=GAUSS, **options):
    return orbits.state_transition(system, method, check_step=False, **options)


def differences(end, q, v, size):
    """Return the derivative of `end`, which takes displacements (dq, dv) to (2, n, 3), by central differences."""
    n = len(q)
    out = np.empty((6 * n, 6 * n))
    for body in range(n):
        for k in range(6):
            column = 0.0
            for m, weight in WEIGHTS.items():
                moved = np.zeros((2, n, 3))
                moved[k // 3, body, k % 3] = m * size
                column = column + weight * (end(*moved) - end(*-moved))
            out[:, 6 * body + k] = column.transpose(1, 0, 2).ravel() / size
    return out


@pytest.mark.parametrize("method", only(KINDS, METHODS), ids=lambda m: m.label)
def test_the_matrix_of_a_step_is_its_derivative_for_every_method(method):
    h, system = 0.125, planets()
    values = system.values
    step = StepMap(Bodies.of(*values[:3]), method, h, particles=False)
    # Differences of states in doubled precision, whose error is that of the eighth-order formula and of the stages.
    by_differences = differences(lambda dq, dv: step(dq, dv).rounded(), values.q, values.v, 2.0**-7)
    found = matrix(system, method, dt=h, duration=h).matrix
    # The largest seen: 2.3e-14; of maps on Kepler orbits, through whose corrector the differences go too, 2.8e-13.
    assert np.abs(found - by_differences).max() < (6e-13 if method.follows_kepler else 6e-14)


@pytest.mark.parametrize("method", only(KINDS, METHODS), ids=lambda m: m.label)
def test_the_matrix_is_symplectic_to_round_off_if_the_method_is_and_far_from_it_if_not(method):
    stm = matrix(planets(), method, dt=0.0625, duration=40.0)
    # Six orbits of the inner planet in 640 steps: seen are up to 5.5e-16.
    # The lazy kick is symplectic to the second order in the masses: it is off by 8e-16 here.
    if SYMPLECTIC in method.declares or method.follows_kepler:
        assert stm.symplecticity_defect() < 1.5e-15
    else:
        assert stm.symplecticity_defect() > 1e-9


def test_the_derivative_after_a_period_of_a_circle_is_that_of_keplers_third_law():
    system = orbits.System(["A"], [1.0], np.zeros((1, 3)), np.zeros((1, 3)), units=orbits.DIMENSIONLESS)
    system = system.add("p", primary="A", a=1.0)
    stm = matrix(system, duration=YEAR)
    # At x = a, a push along the orbit by dv makes it larger, da = 2 a dv / v, and the period longer by 3/2 da / a: the
    # body is 3 P dv behind where it was. A push outwards leaves no trace.
    forward = stm["p"] @ np.array([0, 0, 0, 0, 1.0, 0])
    np.testing.assert_allclose(forward, [0, -3 * YEAR, 0, 3 * YEAR, 1, 0], atol=1e-11)
    np.testing.assert_allclose(stm["p"][:, 3], [0, 0, 0, 1, 0, 0], atol=1e-11)


BOTH = pytest.mark.parametrize(
    ("method", "clock"), [(VERLET, 0.125), (GAUSS, 0.125), (GAUSS, None)], ids=["explicit", "implicit", "adaptive"]
)


@BOTH
def test_a_matrix_is_the_product_of_those_of_its_parts(method, clock):
    system = planets(0.6)
    whole = matrix(system, method, dt=clock, duration=3.0, samples=[0.0, 1.0, 3.0])
    middle = orbits.propagate(system, method, dt=clock, duration=1.0, samples=[1.0], check_step=False)[-1]
    second = matrix(middle, method, dt=clock, duration=2.0)
    np.testing.assert_array_equal(whole.matrix[0], np.eye(24))
    # To round-off with steps at the same places, and to the error of the method where steps are chosen anew.
    product = second.matrix @ whole.matrix[1]
    np.testing.assert_allclose(whole.matrix[2], product, atol=3e-13 if clock else 1e-11)


def test_a_sample_between_steps_is_the_derivative_of_a_part_of_a_step():
    system = planets()
    between = matrix(system, VERLET, dt=0.125, duration=0.5625, samples=[0.5625]).matrix[0]
    first = matrix(system, VERLET, dt=0.125, duration=0.5)
    middle = orbits.propagate(system, VERLET, dt=0.125, duration=0.5, samples=[0.5], check_step=False)[-1]
    rest = matrix(middle, VERLET, dt=0.0625, duration=0.0625)
    np.testing.assert_allclose(between, rest.matrix @ first.matrix, atol=2e-14)


def test_samples_change_no_bit_of_the_matrices():
    system = planets(0.6)
    many = matrix(system, dt=0.1, duration=2.0, samples=[0.33, 0.77, 1.0, 2.0])
    few = matrix(system, dt=0.1, duration=2.0, samples=[1.0, 2.0])
    np.testing.assert_array_equal(many.matrix[-2:], few.matrix)


@BOTH
def test_the_way_back_is_the_inverse(method, clock):
    system = planets()
    there = matrix(system, method, dt=clock, duration=2.0)
    end = orbits.propagate(system, method, dt=clock, duration=2.0, samples=[2.0], check_step=False)[-1]
    back = matrix(end, method, dt=clock, duration=-2.0)
    # Symmetric methods retrace their steps up to the rounding of the end; steps chosen anew leave their own errors.
    np.testing.assert_allclose(back.matrix @ there.matrix, np.eye(18), atol=1e-12 if clock else 1e-11)


@BOTH
def test_the_orbit_has_the_same_bits_with_variations_as_without(method, clock):
    system = planets()
    run = orbits.propagate(system, method, dt=clock, duration=5.0, samples=[5.0], check_step=False)
    march = bound(system, method, run.clock, dense=True)
    tangents = tangents_of(massive_of(system), method, np.ones((3, 2, 3, 3)))
    place = run.clock.place(5.0)
    for motion, _ in stretches(march, place):
        tangents.follow(motion)
    q, v = march.state_at(place)
    np.testing.assert_array_equal(q, run.q.value[-1])
    np.testing.assert_array_equal(v, run.v.value[-1])


def missed_by(found, system, method, **march):
    """The most by which a matrix misses differences of runs, of eighth order, along directions of the start at random.

    They are of rounded states: 2e-16 / 2^-10 times the largest ones is left.
    """
    q, v, n, size = system.values.q, system.values.v, len(system), 2.0**-10

    def end(dq, dv):
        run = orbits.propagate(system.replaced(q=q + dq, v=v + dv), method, check_step=False, **march)
        return np.concatenate([run.q.value[-1], run.v.value[-1]], axis=1).ravel()

    most = 0.0
    for direction in np.random.default_rng(4).uniform(-1.0, 1.0, (3, 6 * n)):
        way = size * direction.reshape(n, 2, 3).transpose(1, 0, 2)
        known = sum(weight * (end(*(m * way)) - end(*(-m * way))) for m, weight in WEIGHTS.items()) / size
        most = max(most, np.abs(found @ direction - known).max())
    return most


@pytest.mark.parametrize("duration", at((1, 2), [3.0, 3.02, -2.98]))
@pytest.mark.parametrize(
    "method",
    first(1, [orbits.WisdomHolman(), MAPS[0], HELIOCENTRIC, SABA()]),
    ids=["modified", "lazy", "heliocentric", "SABA"],
)
def test_the_matrix_of_a_map_is_the_derivative_of_the_run_with_a_particle_at_any_sample(method, duration):
    system = planets(0.6)
    whole, alone = (
        matrix(system, method, dt=0.05, duration=duration, coupled=coupled) for coupled in (True, False)
    )
    assert np.abs(whole.matrix).max() > 15.0
    assert missed_by(whole.matrix, system, method, dt=0.05, duration=duration, samples=[duration]) < 1e-10  # 3e-11
    np.testing.assert_allclose(alone["p0"], whole["p0"], rtol=1e-12, atol=1e-12)


@pytest.mark.nightly
def test_the_matrix_of_a_map_holds_for_planets_in_two_registers_and_in_any_order():
    system = orbits.System(["S"], [1.0], np.zeros((1, 3)), np.zeros((1, 3)), units=orbits.DIMENSIONLESS)
    for k in range(11):
        place = {"a": 1.35 ** (7 * k % 11), "e": 0.05, "inc": 0.05 + 0.01 * k, "M": 2.0 * k, "omega": 0.7 * k}
        system = system.add(f"p{k}", gm=1e-5 * (k + 1), primary="S", **place)
    values = system.values
    for method in (orbits.WisdomHolman(), MAPS[0], HELIOCENTRIC, SABA(8, 2)):
        step = StepMap(Bodies.of(*values[:3]), method, 0.125, particles=False)
        by_differences = differences(lambda dq, dv, step=step: step(dq, dv).rounded(), values.q, values.v, 2.0**-8)
        found = matrix(system, method, dt=0.125, duration=0.125).matrix
        assert np.abs(found - by_differences).max() < 2e-12  # seen: 6e-13


@pytest.mark.parametrize("method", first(1, [orbits.WisdomHolman(), HELIOCENTRIC]), ids=["jacobi", "heliocentric"])
def test_a_star_alone_moves_freely_in_maps_with_variations(method):
    """Three times, as memory of no planets may lie anywhere, next to any numbers."""
    star = orbits.System(["star"], [1.0], [[0.1, 0.2, -0.3]], [[0.01, -0.02, 0.03]], units=orbits.DIMENSIONLESS)
    free = np.eye(6) + 2.0 * np.eye(6, k=3)
    for _ in range(3):
        found = orbits.state_transition(star, method, dt=0.125, duration=2.0, check_step=False)
        assert np.array_equal(found.matrix, free)


@pytest.mark.parametrize("kernel", ["modified-kick", "lazy"])
def test_the_matrix_of_a_map_holds_in_what_is_of_the_second_order_in_the_masses(kernel):
    """With planets of a fiftieth of the star's mass and long steps, what the modified kick adds is above rounding."""
    q, v, gm = np.array(Q), np.array(V), np.array([1.0, 0.02, 0.01])
    method, h = orbits.WisdomHolman(kernel=kernel), 0.5
    system = orbits.System(["A", "B", "C"], gm, q, v, units=orbits.DIMENSIONLESS)
    step = StepMap(Bodies.of(gm, q, v), method, h, particles=False)
    by_differences = differences(lambda dq, dv: step(dq, dv).rounded(), q, v, 2.0**-8)
    found = matrix(system, method, dt=h, duration=h).matrix
    assert np.abs(found - by_differences).max() < 2e-11  # seen: 2e-12; 2e-8 if a third derivative is off by 2 %


@pytest.mark.parametrize("method", first(1, [orbits.WisdomHolman(), HELIOCENTRIC, SABA()]), ids=lambda m: m.label[:6])
def test_a_map_with_variations_marches_as_the_run_does(method):
    """But for rounding: what is seen goes through the stages of the corrector one by one."""
    system = planets()
    times = [5.0, 5.03]
    run = orbits.propagate(system, method, dt=0.0625, duration=6.0, samples=times, check_step=False)
    grid = TimeGrid(run.clock, np.array(times))
    tangents = tangents_of(massive_of(system), method, np.ones((3, 2, 3, 3)), clock=run.clock)
    for k in range(2):
        place = grid.place(k)
        tangents.advance(place)
        q, v = tangents.seen(place.rest).state()
        np.testing.assert_allclose(q, run.q.value[k], rtol=0, atol=1e-15)
        np.testing.assert_allclose(v, run.v.value[k], rtol=0, atol=1e-15)


@pytest.mark.parametrize("clock", [0.05, None], ids=["constant", "adaptive"])
def test_rows_of_a_massless_particle_are_the_derivatives_of_its_orbit(clock):
    system = planets(0.6)
    found = matrix(system, dt=clock, duration=3.0).matrix
    assert np.abs(found).max() > 15.0
    assert missed_by(found, system, GAUSS, dt=clock, duration=3.0, samples=[3.0]) < 1e-10  # seen: 2e-11
    np.testing.assert_array_equal(found[:18, 18:], 0.0)  # it moves nothing


def test_a_particle_alone_has_the_same_derivative_by_its_own_start_and_none_by_others():
    system = planets(0.6, 0.8)
    whole, alone = matrix(system, dt=0.05, duration=3.0), matrix(system, dt=0.05, duration=3.0, coupled=False)
    for name in ("p0", "p1"):
        np.testing.assert_allclose(alone[name], whole[name], rtol=1e-13, atol=1e-13)
        assert np.isnan(alone[name, "B"]).all()
        assert np.isfinite(whole[name, "B"]).all()
    np.testing.assert_array_equal(alone["B", "A"], whole["B", "A"])
    np.testing.assert_array_equal(alone["p0", "p1"], 0.0)


J2 = ZonalHarmonics("A", J2=0.3, J3=0.05, radius=0.1, pole=(0.1, 0.3, 0.9))
SPIN = FrameDragging("A", spin=0.02, pole=(0.1, 0.3, 0.9), c=1.0)


RELATIVITY = PostNewtonian(sources=["A"], c=20.0)


@pytest.mark.parametrize(
    ("terms", "method"),
    first(
        1,
        [
            pytest.param((J2,), VERLET, id="J2 explicit"),
            pytest.param((J2,), GAUSS, id="J2"),
            pytest.param((SPIN,), orbits.Gauss(stages=4), id="spin"),
            pytest.param((J2, SPIN), LobattoIIIAB(stages=3), id="both"),
            pytest.param((J2,), MAPS[0], id="J2 in a lazy map"),
            # in the order of `strong_terms.py`, whose kernels these are
            pytest.param((J2, RELATIVITY, SPIN), orbits.WisdomHolman(), id="all in a map"),
        ],
    ),
)
def test_terms_bring_their_own_variations(terms, method):
    system = planets(0.6).with_terms(*terms)
    stm = matrix(system, method, dt=0.05, duration=2.0)
    assert missed_by(stm.matrix, system, method, dt=0.05, duration=2.0, samples=[2.0]) < 2e-10
    without = matrix(planets(0.6), method, dt=0.05, duration=2.0)
    assert np.abs(stm.matrix - without.matrix).max() > 1e-2  # the terms matter
    # With momenta dL/dv, which are not m v; the lazy kick is symplectic up to the third order in masses and terms.
    lazy = method.follows_kepler and method.kernel == "lazy"
    assert stm.symplecticity_defect() < (1e-13 if lazy else 1e-15)


@pytest.mark.nightly
def test_steps_of_a_map_with_terms_are_followed_to_the_same_bits_in_blocks_of_any_length(monkeypatch):
    system = planets().with_terms(J2, RELATIVITY)
    options = {"dt": 0.05, "duration": 5.0, "check_step": False}
    whole = orbits.megno(system, "wisdom-holman", samples=[5.0], **options)
    monkeypatch.setattr("orbits.marching.tangents.in_maps.BLOCK", 7)
    parts = orbits.megno(system, "wisdom-holman", samples=[1.0, 2.22, 5.0], **options)
    assert parts.massive.megno[-1] == whole.massive.megno[-1]


def test_rebounds_variational_particles_agree():
    rebound = pytest.importorskip("rebound")
    system = planets()
    stm, in_map = matrix(system, duration=10.0), matrix(system, orbits.WisdomHolman(), dt=0.05, duration=10.0)
    for name, k in (("B", 0), ("C", 4)):
        sim = to_rebound(system)
        sim.integrator = "ias15"
        variation = sim.add_variation()
        setattr(variation.particles[system.names.index(name)], ("x", "y", "z", "vx", "vy", "vz")[k], 1.0)
        sim.integrate(10.0)
        theirs = [[p.x, p.y, p.z, p.vx, p.vy, p.vz] for p in variation.particles]
        mine = stm.matrix[:, 6 * system.names.index(name) + k].reshape(3, 6)
        np.testing.assert_allclose(mine, theirs, atol=1e-9 * np.abs(theirs).max())  # IAS15's own error here
        # Of a map it is the derivative of its own steps, whose errors show: seen are 2e-12. REBOUND's bound is 1e-5.
        of_map = in_map.matrix[:, 6 * system.names.index(name) + k].reshape(3, 6)
        np.testing.assert_allclose(of_map, theirs, atol=1e-11 * np.abs(theirs).max())
    assert rebound.__version__


def test_a_matrix_says_what_it_is_and_gives_blocks_by_name():
    system = orbits.System.solar_system(bodies=["Sun", "Mercury", "Venus"])
    stm = orbits.state_transition(system, "gauss", dt=2 * u.day, duration=10 * u.day)
    assert stm.matrix.shape == (18, 18)
    assert stm.t == 10 * u.day
    np.testing.assert_array_equal(stm["Mercury", "Venus"], stm.matrix[6:12, 12:18])
    np.testing.assert_array_equal(stm["Mercury"], stm["mercury", "Mercury"])
    np.testing.assert_array_equal(np.asarray(stm) @ np.ones(18), stm.matrix @ np.ones(18))
    assert "Gauss(stages=8), dt = 2 d" in repr(stm)
    assert "q by v [d]" in repr(stm)
    several = orbits.state_transition(system, "gauss", dt=2 * u.day, duration=10 * u.day, samples=3)
    assert several["Sun", "Venus"].shape == (3, 6, 6)
    assert several.t.shape == several.symplecticity_defect().shape == (3,)
    with pytest.raises(UnknownNameError, match="Vulcan"):
        stm["Vulcan"]
    with pytest.raises(InputError, match="one name or two"):
        stm[0]


def test_no_bit_depends_on_the_threads():
    system = planets(0.5, 0.6, 0.7)
    one, two = (matrix(system, VERLET, dt=0.05, duration=1.0, threads=threads) for threads in (1, 2))
    np.testing.assert_array_equal(one.matrix, two.matrix)
    one, two = (orbits.megno(system, VERLET, dt=0.05, duration=1.0, threads=k, check_step=False) for k in (1, 2))
    assert [x.megno[-1] for x in one.particles] == [x.megno[-1] for x in two.particles]


def test_a_run_gives_the_matrices_at_its_samples():
    system = planets(0.6)
    run = orbits.propagate(system, VERLET, dt=0.05, duration=2.0, samples=5, check_step=False)
    np.testing.assert_array_equal(
        run.state_transition().matrix, matrix(system, VERLET, dt=0.05, duration=2.0, samples=5).matrix
    )


def test_what_has_no_known_derivative_is_refused_with_the_reason():
    system = planets()
    with pytest.raises(InputError, match="steps of their own"):
        matrix(planets(0.6), orbits.WisdomHolman(encounters="follow particles"), dt=0.1, duration=1.0)
    with pytest.raises(InputError, match="no terms besides Newton's gravity"):
        matrix(system.with_terms(J2), HELIOCENTRIC, dt=0.1, duration=1.0)
    with pytest.raises(InputError, match="Drag"):
        matrix(system.with_forces(Drag(rate=0.1)), orbits.WisdomHolman(), dt=0.1, duration=1.0)
    with pytest.raises(InputError, match="steps of time"):
        matrix(system, dt=orbits.TimeTransformed(step=0.3), duration=1.0)
    with pytest.raises(InputError, match="not separable"):
        matrix(system.with_terms(SPIN), VERLET, dt=0.1, duration=1.0)
    with pytest.raises(UnknownNameError, match="tmax"):
        orbits.state_transition(system, dt=0.1, duration=1.0, tmax=3.0)
    with pytest.raises(InputError, match=r"orbits\.System"):
        orbits.state_transition("sun", dt=0.1, duration=1.0)


def test_a_particle_that_is_lost_has_no_derivative_from_there_on():
    system = planets(0.6)
    q, v = system.values.q.copy(), system.values.v.copy()
    q[3], v[3] = q[0] + [0.3, 0.0, 0.0], v[0]  # it falls into the star
    with pytest.warns(RetiredWarning, match="p0"):
        stm = matrix(system.replaced(q=q, v=v), dt=0.05, duration=1.0, samples=[0.05, 1.0])
    assert np.isfinite(stm["p0"][0]).all()
    assert np.isnan(stm["p0"][1]).all()
    assert np.isfinite(stm["B"]).all()


def test_vectors_beyond_the_range_of_numbers_are_refused():
    system = planets()
    tangents = tangents_of(massive_of(system), VERLET, np.full((1, 2, 3, 3), 1e308))
    march = bound(system, VERLET, 0.1, dense=True)
    motion, _ = next(stretches(march, march.clock.place(20.0)))
    with pytest.raises(InputError, match=r"orbits\.megno"):
        tangents.follow(motion)


def test_a_step_in_which_the_vectors_do_not_converge_is_named(monkeypatch):
    """In all runs that were tried the stages of the motion fail first: the kernel is told to stop here."""
    monkeypatch.setattr("orbits.marching.tangents.of_bodies.follow", lambda *arguments: 2)
    with pytest.raises(orbits.errors.ConvergenceError, match=r"in the step of 0\.1 from t = 0\.2"):
        matrix(planets(), dt=0.1, duration=1.0, samples=2)


def test_some_bodies_alone_are_varied_in_the_field_of_the_others():
    followed = particle_of(planets(0.6), 3, coupled=False)
    assert followed.varied.tolist() == followed.numbers.tolist() == [3]
    tangents = tangents_of(followed, VERLET, np.eye(6).reshape(6, 2, 1, 3))
    assert isinstance(tangents, Tangents)
    np.testing.assert_array_equal(tangents.vectors().reshape(6, 6), np.eye(6))
