"""Reversibility and symplecticity of the compiled step, found where they are and missed where they are not."""

import numpy as np
import pytest

import orbits
from orbits import diagnostics
from orbits.diagnostics.doubledouble import subtract
from orbits.diagnostics.nearest_gauss import NearestGauss
from orbits.diagnostics.stepping import Bodies, StepMap, turned
from orbits.errors import InputError
from orbits.integrators import registry
from orbits.integrators.base import SYMMETRIC, SYMPLECTIC

from ..coverings import STANDARD, each, only
from ..problems import three_bodies

METHODS = [
    method
    for _, cls in sorted(registry().items())
    for method in cls.examples()
    if method.second_order and method.second_order.serves_particles
]
IDS = [method.label for method in METHODS]


@pytest.mark.parametrize("method", only([*STANDARD, "RungeKutta4()"], METHODS), ids=IDS)
def test_a_thousand_steps_forth_and_back_are_the_identity_if_and_only_if_the_method_is_symmetric(method):
    found = diagnostics.reversibility(*three_bodies(particles=2), method, 0.05, 1000)
    assert found.steps == 1000
    # Eight periods of the inner planet amplify the rounding of 2,000 steps: 142 ulps at most were reached.
    if SYMMETRIC in method.declares:
        assert found.ulps < 1000
        assert max(found.q, found.v) < 4e-13
    elif method.follows_kepler:  # a corrector leaves 1e-6 with 60 steps of 0.8, but only 1e-14 with these
        far = diagnostics.reversibility(*three_bodies(particles=2), method, 0.8, 60)
        assert min(far.q, far.v) > 1e-8
    else:
        assert min(found.q, found.v) > 1e-5  # RK4, the most accurate of them: 3.4e-4


@pytest.mark.parametrize("method", only([*STANDARD, "RungeKutta4()"], METHODS), ids=IDS)
def test_the_step_is_symplectic_on_massive_bodies_and_on_fibres_if_and_only_if_declared(method):
    found = diagnostics.symplecticity(*three_bodies(particles=2), method, 0.15)
    # 2e-14 was reached; it is what the differences of the derivatives leave, after 33 stages of a corrector 1.4e-12.
    assert found.noise < (5e-12 if method.follows_kepler else 1e-13)
    assert found.particles.shape == (2,)
    if method.follows_kepler:
        assert found.massive < 2e-12  # 5.3e-13
        assert found.particles.max() < 3e-13  # 7.5e-14
    elif SYMPLECTIC in method.declares:
        assert found.massive < 5e-14  # 8e-15 at most was reached
        assert found.particles.max() < 5e-15  # 7e-16 at most was reached
    else:
        assert found.massive > 1e-5  # RK4: 5e-5
        assert found.particles.min() > 1e-9  # RK4: 5e-9


def test_a_method_that_spoils_a_single_particle_is_seen_in_its_fibre_alone():
    """Explicit Euler on a particle far out: its defect is h^2 times its own tide, that of the planets far larger."""
    found = diagnostics.symplecticity(*three_bodies(particles=2), orbits.methods.ExplicitEuler(), 0.15)
    assert found.massive > 10 * found.particles.max()
    tide = 2.0 * 1.013 * 0.15**2 / np.linalg.norm(three_bodies(particles=2)[1][3:], axis=1) ** 3
    assert found.particles == pytest.approx(tide, rel=0.3)


def test_the_rounding_of_coefficients_is_too_small_for_a_single_step_to_show():
    """Which is why ensembles are needed, and exact coefficients checked with fractions."""
    found = diagnostics.symplecticity(*three_bodies(particles=2), NearestGauss(stages=8), 0.15)
    assert found.massive < 5e-14
    assert NearestGauss(stages=8).tableau.binary_residual() > 0


def test_velocities_are_flipped_with_all_their_digits_and_nothing_else_is():
    marcher = Bodies.of(*three_bodies(particles=2)).marcher(orbits.Gauss(stages=2), 0.1)
    marcher.advance(20)
    before = marcher.checkpoint()
    turned(marcher)
    after = marcher.checkpoint()
    for name in ("v", "v_lo", "particle_v", "particle_v_lo"):
        assert np.any(before[name])
        np.testing.assert_array_equal(after[name], -before[name])
    for name in ("q", "q_lo", "particle_q", "particle_q_lo"):
        np.testing.assert_array_equal(after[name], before[name])


@pytest.mark.parametrize("particles", [False, True], ids=["massive", "particles"])
def test_a_displacement_below_the_last_bit_of_a_position_comes_out_of_a_step(particles):
    step = StepMap(Bodies.of(*three_bodies(particles=2)), orbits.StormerVerlet(), 1e-3, particles=particles)
    nothing = np.zeros((2 if particles else 3, 3))
    tiny = nothing.copy()
    tiny[1, 0] = 2.0**-60
    off = subtract(step(tiny, nothing), step(nothing, nothing)).rounded()
    assert off[0] == pytest.approx(tiny, rel=1e-6, abs=0.0)


def test_flipping_velocities_where_a_step_is_not_symmetric_is_seen_by_the_order_of_its_error():
    """Symplectic Euler comes back to first order in dt only."""
    off = [
        diagnostics.reversibility(*three_bodies(particles=2), orbits.methods.SymplecticEuler(), h, round(1 / h)).q
        for h in (2e-3, 1e-3)
    ]
    assert 1.8 < off[0] / off[1] < 2.2


def test_softening_counts():
    gm, q, v = three_bodies(particles=2)
    found = diagnostics.symplecticity(gm, q, v, orbits.Gauss(stages=2), 0.15, softening=0.2)
    assert found.massive < 5e-14
    with pytest.raises(InputError, match="softening"):
        diagnostics.reversibility(gm, q, v, orbits.Gauss(stages=2), 0.1, 10, softening=-1.0)


WRONG = [
    ({"integrator": 8}, "integrator must be a method"),
    ({"dt": 0.0}, "dt must be finite and not zero"),
    ({"dt": float("nan")}, "dt must be finite"),
    ({"dt": "a"}, "dt must be a real number, got 'a'"),
    ({"dt": [0.1, 0.2]}, "dt must be a single number"),
    ({"softening": "soft"}, "softening must be a real number, got 'soft'"),
    ({"gm": "a"}, "gm is 'a'; expected an array of real numbers"),
    ({"gm": [[1.0], 2.0]}, "expected an array of real numbers"),
    ({"q": None}, "q is None"),
    ({"q": np.ones((3, 3), dtype=complex)}, "expected an array of real numbers"),
    ({"v": {}}, "v is {}; expected an array of real numbers"),
    ({"gm": [1.0, 2.0]}, "q has shape"),
    ({"gm": [0.0, 0.0, 0.0]}, "at least one of them > 0"),
    ({"q": [[0, 0, np.nan]] * 3}, "q holds values that are not finite"),
    ({"v": np.zeros((2, 3))}, "v has shape"),
]


@each(("wrong", "message"), WRONG)
def test_what_cannot_be_marched_is_refused_in_words(wrong, message):
    gm, q, v = three_bodies()
    given = {"gm": gm, "q": q, "v": v, "integrator": orbits.StormerVerlet(), "dt": 0.1} | wrong
    with pytest.raises(InputError, match=message):
        diagnostics.symplecticity(**given)
    with pytest.raises(InputError, match=message):
        diagnostics.reversibility(**given, steps=3)
    with pytest.raises(InputError, match=message):
        diagnostics.order(**given, steps=3)


@each("measure", [diagnostics.convergence, diagnostics.growth])
@each("given", [("a", [1.0]), ([1.0], "a"), (None, None), ({}, [1.0]), ([1.0], [1j])])
def test_what_holds_no_numbers_cannot_be_fitted(measure, given):
    with pytest.raises(InputError, match=r"expected an array of real numbers|must be"):
        measure(*given)


def test_no_steps_are_refused():
    with pytest.raises(InputError, match="steps must be a whole number >= 1"):
        diagnostics.reversibility(*three_bodies(particles=2), orbits.StormerVerlet(), 0.1, 0)


@pytest.mark.parametrize("steps", [2**64, 10**9 + 1])
def test_more_steps_than_anybody_waits_for_are_refused(steps):
    with pytest.raises(InputError, match="at most 1e\\+09 are possible"):
        diagnostics.reversibility(*three_bodies(particles=2), orbits.StormerVerlet(), 0.05, steps)
    with pytest.raises(InputError, match="at most 1e\\+09 are possible"):
        diagnostics.order(*three_bodies(particles=2), orbits.StormerVerlet(), 0.05, steps)
    with pytest.raises(InputError, match=r"steps \* 2\^halvings"):
        diagnostics.order(*three_bodies(particles=2), orbits.StormerVerlet(), 0.05, 10, halvings=40)
