"""What a method declares holds to round-off; what it does not declare visibly fails. Every registered method is met
here.
"""

import numpy as np
import pytest

import orbits
from orbits.integrators.base import MOMENTUM_MAPS, SYMMETRIC, SYMPLECTIC
from orbits.integrators.forms import Form

from ..coverings import each, first, keep
from ..problems import particles_around, three_bodies
from .problems import errors_against_the_exact_orbit, jacobian, march, marcher, methods, phase_map

EVERY = [*methods(), orbits.Gauss(stages=12)]  # and one of more stages than a register has lanes
IDS = [m.label for m in EVERY]
# The last one has kernels of its own, which `test_many_stages` compiles.
ALL = first(len(EVERY) - 1, EVERY)
WITH_PARTICLES = keep(
    lambda k, m: m.label not in ("ExplicitEuler()", "Gauss(stages=12)"),
    [m for m in EVERY if m.second_order.serves_particles],
)
H = 0.15


def angular_momentum(gm, q, v):
    return (gm[:, None] * np.cross(q, v)).sum(axis=0)


def linear_momentum(gm, v):
    return (gm[:, None] * v).sum(axis=0)


@pytest.mark.parametrize("method", ALL, ids=IDS)
def test_symplectic_if_and_only_if_declared(method):
    """M^T J M = J for the derivative M of one step of the three massive bodies, in coordinates (q, GM v)."""
    gm, q, v = three_bodies()
    m = np.repeat(gm, 3)
    z = np.concatenate([q.ravel(), m * v.ravel()])
    scales = np.concatenate([np.full(9, 0.3), 0.3 * m])
    M = jacobian(phase_map(method, gm, H), z, scales)
    n = len(z) // 2
    J = np.block([[np.zeros((n, n)), np.eye(n)], [-np.eye(n), np.zeros((n, n))]])
    # Positions and momenta of light bodies differ by their masses: compare in units in which all are of order one.
    weight = np.concatenate([np.sqrt(m), 1 / np.sqrt(m)])
    defect = np.abs(weight[:, None] ** -1 * (M.T @ J @ M - J) * weight[None, :] ** -1).max()
    # Round-off of the differences, 2^-53 over a step of 0.003; 1.3e-13 at most was reached, and 1.4e-12 by the method
    # with a corrector, which applies and undoes it in each of these steps: 63 Kepler motions.
    if SYMPLECTIC in method.declares:
        assert defect < (4e-12 if method.follows_kepler else 1e-12)
    else:
        assert defect > 1e-7


@pytest.mark.parametrize("method", WITH_PARTICLES, ids=lambda method: method.label)
def test_each_particle_fibre_is_symplectic_if_and_only_if_declared(method):
    """For given massive bodies, the map of one particle's (q, v) preserves dq ^ dv."""
    gm, q, v = three_bodies()
    (x,), (w,) = particles_around(1)

    def step(z):
        a, b = march(method, np.append(gm, 0.0), np.vstack([q, z[:3]]), np.vstack([v, z[3:]]), 3 * H, 1)
        return np.concatenate([a[-1], b[-1]])

    M = jacobian(step, np.concatenate([x, w]), np.full(6, 0.3))
    J = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.eye(3), np.zeros((3, 3))]])
    defect = np.abs(M.T @ J @ M - J).max()
    if SYMPLECTIC in method.declares:
        assert defect < 1e-12
    else:
        assert defect > 1e-8


@pytest.mark.parametrize("method", ALL, ids=IDS)
def test_symmetric_if_and_only_if_declared(method):
    """A step forth and the same step back is the identity, far from any period of the motion."""
    gm, q, v = three_bodies()
    q1, v1 = march(method, gm, q, v, H, 7)
    q2, v2 = march(method, gm, q1, v1, -H, 7)
    defect = max(np.abs(q2 - q).max(), np.abs(v2 - v).max())
    # The low parts are dropped at the turning point, 1e-16, and grow with the motion; 3.3e-16 at most was reached.
    if SYMMETRIC in method.declares:
        assert defect < 2e-15
    elif method.follows_kepler:
        # A corrector is a palindrome, symmetric but for the third order in the planets' masses; 1e-13 was reached.
        assert defect < 1e-12
    else:
        assert defect > 1e-7


@pytest.mark.parametrize("method", ALL, ids=IDS)
def test_momentum_maps_conserved_if_and_only_if_declared(method):
    """Linear and angular momentum over 300 steps of the three bodies."""
    gm, q, v = three_bodies()
    q1, v1 = march(method, gm, q, v, H / 2, 300)
    scale = (gm[:, None] * np.abs(np.cross(q, v))).sum()
    angular = np.abs(angular_momentum(gm, q1, v1) - angular_momentum(gm, q, v)).max() / scale
    linear = np.abs(linear_momentum(gm, v1) - linear_momentum(gm, v)).max() / (gm[:, None] * np.abs(v)).sum()
    # A random walk of 300 roundings of the products: 2.3e-16 at most was reached.
    assert linear < 2e-15
    if MOMENTUM_MAPS in method.declares:
        assert angular < 1e-15
    else:
        assert angular > 1e-6


@pytest.mark.parametrize("method", [m for m in methods() if not m.follows_kepler], ids=lambda method: method.label)
def test_order_of_convergence_is_the_declared_one(method):
    """The error against the exact two-body orbit falls as h^order, between the first decay and the round-off
    plateau. (An order of 24 leaves no room between them: `test_many_stages` measures it in 58 digits. A method that
    follows two bodies exactly is measured on three, in `test_wisdom_holman`.)
    """
    if method.order <= 8:
        steps, errors = errors_against_the_exact_orbit(method, 0.3, 2.0, 2 ** np.arange(18))
    else:
        # Order 16 passes from 1e-4 to round-off within a factor of 5 in h: fewer, longer steps on a harder orbit.
        steps, errors = errors_against_the_exact_orbit(method, 0.5, 5.0, np.arange(1, 40))
    # The six shortest steps whose errors still stand well above round-off.
    keep = np.flatnonzero((errors > 2e-13) & (errors < 1e-3))[-6:]
    measured = -np.polyfit(np.log(steps[keep]), np.log(errors[keep]), 1)[0]
    assert len(keep) >= 3
    assert abs(measured - method.order) < 0.08 * method.order


@pytest.mark.parametrize("method", WITH_PARTICLES, ids=lambda method: method.label)
def test_a_massless_particle_moves_as_a_body_without_mass_would(method):
    """Against the same method with the particle as a body of GM = 1e-30, which pulls on nothing."""
    gm, q, v = three_bodies()
    x, w = particles_around(5)
    light = march(method, np.append(gm, np.zeros(5)), np.vstack([q, x]), np.vstack([v, w]), H, 40)
    heavy = march(method, np.append(gm, np.full(5, 1e-30)), np.vstack([q, x]), np.vstack([v, w]), H, 40)
    # The same arithmetic in another order: 4.4e-16 at most was reached.
    assert np.abs(light[0] - heavy[0]).max() < 2e-15
    assert np.abs(light[1] - heavy[1]).max() < 2e-15


@pytest.mark.parametrize("method", WITH_PARTICLES, ids=lambda method: method.label)
def test_bits_do_not_depend_on_threads_blocks_or_neighbours(method):
    gm, q, v = three_bodies()
    x, w = particles_around(37)
    gm, q, v = np.append(gm, np.zeros(37)), np.vstack([q, x]), np.vstack([v, w])
    one = marcher(method, gm, q, v, H)
    one.advance(50)
    many = marcher(method, gm, q, v, H, threads=3)
    many.block = 7
    many.advance(50)
    alone = marcher(method, gm[[0, 1, 2, 20]], q[[0, 1, 2, 20]], v[[0, 1, 2, 20]], H)
    for _ in range(50):
        alone.advance(1)
    for a, b, c in zip(one.state(), many.state(), alone.state(), strict=True):
        assert np.array_equal(a, b)
        assert np.array_equal(a[[0, 1, 2, 20]], c)


@pytest.mark.parametrize("method", WITH_PARTICLES, ids=lambda method: method.label)
def test_a_checkpoint_continues_bit_for_bit(method):
    gm, q, v = three_bodies()
    x, w = particles_around(9)
    gm, q, v = np.append(gm, np.zeros(9)), np.vstack([q, x]), np.vstack([v, w])
    straight = marcher(method, gm, q, v, H)
    straight.advance(31)
    first = marcher(method, gm, q, v, H)
    first.advance(17)
    first.state_after(0.3 * H)
    saved = first.checkpoint()
    second = marcher(method, gm, q, v, H)
    second.restore(saved)
    second.advance(14)
    for name, array in straight.checkpoint().items():
        assert np.array_equal(array, second.checkpoint()[name], equal_nan=True), name


@pytest.mark.parametrize("method", ALL, ids=IDS)
def test_a_partial_step_leaves_the_march_untouched(method):
    gm, q, v = three_bodies()
    run = marcher(method, gm, q, v, H)
    run.advance(3)
    before = run.checkpoint()
    run.state_after(0.4 * H)
    run.advance(0)
    for name, array in before.items():
        assert np.array_equal(array, run.checkpoint()[name], equal_nan=True), name


@each("method", EVERY)
def test_every_method_says_where_it_comes_from_and_what_it_is(method):
    assert method.source
    assert method.summary
    assert type(method).__doc__
    assert method.order >= 1
    assert method.declares <= {SYMPLECTIC, SYMMETRIC, MOMENTUM_MAPS}


def test_no_kernel_of_a_method_has_the_name_of_another_function_of_the_contract():
    contract = {"begin", "step", "enter", "leave", "show", "prepare", "end_late", "signal", "begin_particles"}
    contract |= {"step_particles", "keep_particles", "begin_pair", "step_pair", "keep_pair", "enter_particles"}
    contract |= {"leave_particles"}
    kinds = [Form]
    for kind in kinds:
        kinds.extend(kind.__subclasses__())
    named = [
        (kind.__name__, key, getattr(kernel, "__name__", ""))
        for kind in kinds
        for name in ("kernels", "more_kernels")
        for key, kernel in getattr(kind, name, {}).items()
    ]
    assert len(named) > 10
    assert [names for names in named if names[2] in contract - {names[1]}] == []
