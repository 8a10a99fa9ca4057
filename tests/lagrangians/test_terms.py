"""Terms of the N-body Lagrangian: formulas, derivatives, fields, and the equality of all their forms."""

import os
import subprocess
import sys

import mpmath
import numpy as np
import pytest

import orbits
from orbits.kernels import binding
from orbits.kernels.compile import kernel
from orbits.kernels.gravity.terms_and_forces import particle_momenta
from orbits.kernels.lanes import WIDTH, load, store
from orbits.lagrangians.base import ABOUT_ONE_BODY, GRADIENTS, MASSLESS_PARTICLES, SEPARABLE
from orbits.lagrangians.newtonian import n_body
from orbits.lagrangians.terms.charges import charges
from orbits.lagrangians.terms.degree_two import degree_two
from orbits.lagrangians.terms.einstein_infeld_hoffmann import einstein_infeld_hoffmann
from orbits.lagrangians.terms.frame_dragging import frame_dragging
from orbits.lagrangians.terms.minor_bodies import minor_bodies
from orbits.lagrangians.terms.nobili_roxburgh import nobili_roxburgh
from orbits.lagrangians.terms.post_newtonian import post_newtonian
from orbits.lagrangians.terms.zonal_harmonics import zonal_harmonics

from ..coverings import at

EPS = 2.0**-53
POLE = (0.36, 0.48, 0.8)
J = {2: 0.02, 3: -0.01, 4: 0.03}
GM = (1.0, 0.3, 0.01)
RADIUS = 0.3


def zonal(row=0):
    return zonal_harmonics(row, RADIUS, POLE, J)


def dragging(row=1):
    return frame_dragging(row, (0.03, 0.01, -0.05))


def relativity(row=0):
    return post_newtonian(row, 3.0)


def figure(row=1, towards=2):
    return degree_two(row, 0.2 * RADIUS**2, 0.1 * RADIUS**2, POLE, towards=towards)


# Functions of the number of massive bodies, of which a sum of relativity by several bodies has a list.
SUMS = {
    "zonals": lambda bodies: [zonal()],
    "dragging": lambda bodies: [dragging()],
    "both": lambda bodies: [zonal(1), dragging(0)],
    "relativity": lambda bodies: [relativity(1)],
    "Nobili and Roxburgh": lambda bodies: [nobili_roxburgh(1, 3.0)],
    "relativity by all": lambda bodies: [einstein_infeld_hoffmann(range(bodies), bodies, 3.0)],
    "relativity by two": lambda bodies: [einstein_infeld_hoffmann([2, 0], bodies, 3.0)],
    "minor bodies": lambda bodies: [minor_bodies({1, 2}, bodies)],
    "figure": lambda bodies: [figure()],
    "relativity by all, zonals": lambda bodies: [einstein_infeld_hoffmann(range(bodies), bodies, 3.0), zonal()],
}


def state(seed=1, bodies=3):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(bodies, 3)), rng.normal(size=(bodies, 3))


def derivative(function, x, h=1e-3):
    """Central differences of fourth order in each coordinate, accurate to about 1e-12 of the function."""
    rows = []
    for e in np.eye(len(x)) * h:
        rows.append((function(x - 2 * e) - 8 * function(x - e) + 8 * function(x + e) - function(x + 2 * e)) / (12 * h))
    return np.array(rows)


@pytest.mark.parametrize("softening", [0.0, 0.2])
@pytest.mark.parametrize("terms", SUMS.values(), ids=SUMS)
def test_gradients_and_hessians_of_a_sum_are_the_derivatives_of_its_value(terms, softening):
    L = n_body(GM, softening, terms(len(GM)))
    q, v = (x.ravel() for x in state())
    f, p = L.gradients(q, v)
    qq, qv, vv = L.hessians(q, v)
    # Rounding 1e-16 / h, and h^4 times fifth derivatives: 1e-12 was measured at most.
    bound = 5e-12
    assert np.max(np.abs(derivative(lambda x: L.value(x, v), q) - f)) < bound
    assert np.max(np.abs(derivative(lambda w: L.value(q, w), v) - p)) < bound
    assert np.max(np.abs(derivative(lambda x: L.gradients(x, v)[0], q) - qq)) < bound
    assert np.max(np.abs(derivative(lambda x: L.gradients(x, v)[1], q) - qv)) < bound
    assert np.max(np.abs(derivative(lambda w: L.gradients(q, w)[1], v) - vv)) < bound


def test_zonal_harmonics_are_those_of_the_textbook_in_thirty_digits():
    d = np.array([0.4, -0.3, 0.7])
    L = n_body([2.0, 0.3], 0.0, [zonal()])
    without = n_body([2.0, 0.3])
    q, v = np.array([0.1, 0.2, 0.3]) + np.array([np.zeros(3), d]), np.zeros((2, 3))
    with mpmath.workdps(30):

        def potential(x, y, z):
            r = mpmath.sqrt(x * x + y * y + z * z)
            s = (POLE[0] * x + POLE[1] * y + POLE[2] * z) / r
            return 2 / r * sum(j * (mpmath.mpf(RADIUS) / r) ** n * mpmath.legendre(n, s) for n, j in J.items())

        separation = [mpmath.mpf(x) for x in (q[1] - q[0])]
        expected = -0.3 * float(potential(*separation))
        force = [-0.3 * float(mpmath.diff(potential, separation, n)) for n in np.eye(3, dtype=int).tolist()]
    # Differences with Newton's, which is 20 times as large, to some units in its last place.
    assert L.value(q, v) - without.value(q, v) == pytest.approx(expected, abs=8 * EPS)
    found = (L.gradients(q, v)[0] - without.gradients(q, v)[0]).reshape(2, 3)
    assert np.max(np.abs(found - [np.negative(force), force])) < 32 * EPS


def test_the_figure_of_degree_two_is_that_of_the_textbook():
    """J2 P_2(sin phi) - C22 P_22(sin phi) cos 2 lambda, P_22 = 3 cos^2, with longitudes from the axis to body 2."""
    L, without = n_body(GM, 0.0, [figure()]), n_body(GM)
    q, v = state(9)
    pole, d = np.array(POLE), q - q[1]
    first = d[2] - (d[2] @ pole) * pole
    first /= np.linalg.norm(first)
    expected = 0.0
    for i in (0, 2):
        r = np.linalg.norm(d[i])
        sine, longitude = d[i] @ pole / r, np.arctan2(d[i] @ np.cross(pole, first), d[i] @ first)
        legendre = 0.2 * (1.5 * sine**2 - 0.5) - 0.1 * 3 * (1 - sine**2) * np.cos(2 * longitude)
        expected -= GM[i] * GM[1] / r * (RADIUS / r) ** 2 * legendre
    assert L.value(q, v) - without.value(q, v) == pytest.approx(expected, abs=8 * EPS)


def test_a_figure_that_turns_has_at_each_time_the_field_of_one_that_points_there():
    """Angles are counted from the node of the equator on the xy-plane; forces are the derivatives of the value."""
    rate, t = 1.3, 0.7
    L = n_body(GM, 0.1, [degree_two(1, 0.02, 0.01, POLE, turning=(0.4, rate))])
    q, v = (x.ravel() for x in state(9))
    pole = np.array(POLE)
    node = np.cross([0, 0, 1], pole)
    node /= np.linalg.norm(node)
    axis = np.cos(0.4 + rate * t) * node + np.sin(0.4 + rate * t) * np.cross(pole, node)
    # A fourth body far away in that direction, of no weight, to which the axis of another figure points.
    gm = (*GM, 1e-30)
    pointing = n_body(gm, 0.1, [degree_two(1, 0.02, 0.01, POLE, towards=3)])
    more = np.concatenate([q, q[3:6] + 1e13 * axis]), np.concatenate([v, np.zeros(3)])
    assert L.value(q, v, t) == pytest.approx(pointing.value(*more), abs=16 * EPS)
    assert np.max(np.abs(L.gradients(q, v, t)[0] - pointing.gradients(*more)[0][:9])) < 64 * EPS
    found = derivative(lambda x: L.gradients(x, v, t)[0], q) - L.hessians(q, v, t)[0]
    assert np.max(np.abs(found)) < 5e-12
    assert L.value(q, v, t) != pytest.approx(L.value(q, v, 0.0), rel=1e-6)


def test_frame_dragging_accelerates_as_the_textbook_has_it():
    """2 G S / (c^2 r^3) [3 (r x v)(r . s) / r^2 + v x s], from d/dt dL/dv = dL/dx."""
    k = -2.0 * 0.01 * np.array(POLE)
    L = n_body([1.0, 1e-12], 0.0, [frame_dragging(0, tuple(k))])
    r, v = np.array([0.4, -0.9, 0.6]), np.array([0.3, 0.8, 0.2])
    q, w = np.array([np.zeros(3), r]).ravel(), np.array([np.zeros(3), v]).ravel()
    f, _ = L.gradients(q, w)
    _, mixed, mass = L.hessians(q, w)
    found = np.linalg.solve(mass[3:, 3:], f[3:] - mixed[3:, 3:].T @ v) + r / np.linalg.norm(r) ** 3
    size = np.linalg.norm(r)
    term = 0.02 / size**3 * (3 * np.cross(r, v) * (r @ POLE) / size**2 + np.cross(v, POLE))
    # What is left of Newton's attraction, which is 1, after its subtraction.
    assert np.max(np.abs(found - term)) < 16 * EPS


def test_relativity_accelerates_as_the_textbook_has_it_up_to_the_second_order():
    """M/(c^2 r^3) [(4 M/r - v^2) r + 4 (r . v) v], the Schwarzschild field in harmonic coordinates, of a light body."""
    r, v = np.array([0.4, -0.9, 0.6]), np.array([0.3, 0.8, 0.2])
    q, w = np.array([np.zeros(3), r]).ravel(), np.array([np.zeros(3), v]).ravel()
    size, M, off = np.linalg.norm(r), 2.0, []
    for c in (10.0, 10.0**1.5, 100.0):
        L = n_body([M, 1e-12], 0.0, [post_newtonian(0, c)])
        f, _ = L.gradients(q, w)
        _, mixed, mass = L.hessians(q, w)
        found = np.linalg.solve(mass[3:, 3:], f[3:] - mixed[3:, 3:].T @ v) + M * r / size**3
        term = M / (c * c * size**3) * ((4 * M / size - v @ v) * r + 4 * (r @ v) * v)
        off.append(np.max(np.abs(found - term)) / np.max(np.abs(term)))
    # The difference is of second order: relative to the term it falls with c^2, 5e-2, 5e-3, 5e-4.
    assert off[0] / off[1] == pytest.approx(10.0, rel=0.1)
    assert off[1] / off[2] == pytest.approx(10.0, rel=0.03)


def test_the_hamiltonian_of_relativity_is_that_of_saha_and_tremaine():
    """H_1 = (3/2 H_K^2 - p^4/2 - M^2/r^2) / c^2 with the reduced mass, up to the second order."""
    gm, off = (2.0, 0.3), []
    M, reduced = sum(gm), gm[0] * gm[1] / sum(gm)
    q, r, p = np.zeros(6), np.array([0.4, -0.9, 0.6]), np.array([0.3, 0.8, 0.2])
    q[3:] = r
    for c in (100.0, 1000.0):
        L = n_body(gm, 0.0, [post_newtonian(0, c)])
        momenta = reduced * np.concatenate([-p, p])
        kepler = p @ p / 2 - M / np.linalg.norm(r)
        added = (1.5 * kepler**2 - (p @ p) ** 2 / 2 - M**2 / (r @ r)) / c**2
        H = L.energy(q, L.velocity(q, momenta)) / reduced
        off.append(abs(H - kepler - added))
    # Half of (dL_1/dv)^2, 1/c^4 p^2/2 (p^2/2 + 3 M/r)^2.
    assert off[0] == pytest.approx(1e-8 * (p @ p) / 2 * ((p @ p) / 2 + 3 * M / np.linalg.norm(r)) ** 2, rel=0.01)
    assert off[0] / off[1] == pytest.approx(1e4, rel=0.02)


@pytest.mark.parametrize("terms", SUMS.values(), ids=SUMS)
def test_a_sum_keeps_momentum_and_the_angular_momentum_about_its_poles(terms):
    """By Noether: the forces add up to zero, and their torque has no component along the only axis."""
    terms = terms(len(GM))
    L = n_body(GM, 0.0, terms)
    q, v = state()
    f, p = (x.reshape(-1, 3) for x in L.gradients(q, v))
    assert np.max(np.abs(f.sum(axis=0))) < 8 * EPS * np.max(np.abs(f))
    turned = np.cross(q, f).sum(axis=0) + np.cross(v, p).sum(axis=0)  # d/dt sum q x p on the motion
    named = {symmetry.name for symmetry in L.symmetries}
    assert {f"translation along {x}" for x in "xyz"} <= named
    boosted = all(term.galilean for term in terms)
    assert {f"boost along {x}" in named for x in "xyz"} == {boosted}
    axes = [term.axis for term in terms if term.axis is not None]
    assert ("rotation about the pole" in named) == (len(axes) == 1)
    assert ({f"rotation about {x}" for x in "xyz"} <= named) == (not axes)
    if len(axes) < 2:
        scale = np.abs(np.cross(q, f)).sum() + np.abs(np.cross(v, p)).sum()
        assert np.max(np.abs((axes or np.eye(3)) @ turned)) < 8 * EPS * scale
        if axes:
            assert np.linalg.norm(turned) > 1e-4 * scale  # about other axes it is not kept


def test_a_sum_has_the_traits_that_all_of_its_terms_have():
    common = {MASSLESS_PARTICLES, GRADIENTS, ABOUT_ONE_BODY}
    assert n_body(GM, 0.0, [zonal()]).traits == {SEPARABLE, *common}
    assert n_body(GM, 0.0, [zonal(), dragging()]).traits == common
    assert n_body(GM, 0.0, [zonal(), relativity()]).traits == common


def test_a_sum_without_terms_is_the_newtonian_lagrangian_itself():
    assert n_body(GM).tag is n_body(GM, 0.0, [zonal()]).tag.terms[0]
    assert isinstance(n_body(GM).parameter_vector, np.ndarray)


@kernel
def evaluate_canonical(tag, parameters, t, q, v, f, p, hessian, value):
    store(value, 0, binding.value(tag, parameters, t, q, v))
    binding.gradients(tag, parameters, t, q, v, f, p)
    binding.hessians(tag, parameters, t, q, v, hessian)


@kernel
def accelerations(tag, parameters, q, out):
    binding.accelerate(tag, parameters, q, out)


@kernel
def accelerations_of_some(tag, parameters, q, out, start, stop):
    binding.accelerate_some(tag, parameters, q, out, start, stop)


@kernel
def evaluate_stages(tag, parameters, times, q, v, f, p, hessian, value):
    evaluate_canonical(tag, parameters, load(times, 0), q, v, f, p, hessian, value)


@pytest.mark.nightly
@pytest.mark.parametrize("terms", SUMS.values(), ids=SUMS)
def test_stages_in_lanes_and_vectors_give_the_same_numbers(terms):
    L = n_body(GM, 0.1, terms(len(GM)))
    states = [state(seed) for seed in range(WIDTH)]
    rows_q, rows_v = (np.stack([s[k].T.ravel() for s in states], axis=1) for k in (0, 1))
    d = 3 * len(GM)
    f, p, hessian, value = np.empty((d, 8)), np.empty((d, 8)), np.empty((3 * d * d, 8)), np.empty((1, 8))
    evaluate_stages(L.tag, L.parameter_vector, np.zeros((1, 8)), rows_q, rows_v, f, p, hessian, value)
    for lane, (q, v) in enumerate(states):
        expected = L.gradients(q, v)
        # Relative to the largest: sums are fused otherwise in lanes.
        for rows, vector in zip((f, p), expected, strict=True):
            vector = L.kernel_order(vector)
            assert np.max(np.abs(rows[:, lane] - vector)) < 16 * EPS * np.max(np.abs(vector))
        assert value[0, lane] == pytest.approx(L.value(q, v), abs=64 * EPS)
        blocks = np.array(L.hessians(q, v))
        order = list(L.order)
        blocks = blocks[:, order][:, :, order]
        assert np.max(np.abs(hessian[:, lane].reshape(3, d, d) - blocks)) < 32 * EPS * np.max(np.abs(blocks))


@pytest.mark.parametrize("term", at((1,), [zonal(1), figure()]), ids=["zonals", "figure"])
def test_accelerations_are_forces_over_masses_in_vectors_and_in_lanes(term):
    L = n_body(GM, 0.0, [term])
    q, v = state()
    n = len(GM)
    padded, out = np.zeros(3 * n + 8), np.zeros(3 * n + 8)
    padded[: 3 * n] = q.T.ravel()
    accelerations(L.tag, L.parameter_vector, padded, out)
    force = L.gradients(q, v)[0].reshape(n, 3)
    expected = (force / np.array(GM)[:, None]).T.ravel()
    assert np.max(np.abs(out[: 3 * n] - expected)) < 16 * EPS * np.max(np.abs(expected))
    rows, found = np.repeat(padded[: 3 * n, None], 8, axis=1), np.empty((3 * n, 8))
    accelerations(L.tag, L.parameter_vector, rows, found)
    assert np.max(np.abs(found - expected[:, None])) < 16 * EPS * np.max(np.abs(expected))


@pytest.mark.nightly
@pytest.mark.parametrize("term", [zonal(9), figure(9, 3)], ids=["zonals", "figure"])
def test_bodies_may_be_shared_out_among_threads_to_the_same_bits(term):
    bodies = 21
    rng = np.random.default_rng(5)
    L = n_body(rng.uniform(0.1, 1.0, bodies), 0.0, [term])
    q, _ = state(3, bodies)
    padded, whole, parts = np.zeros(3 * bodies + 8), np.zeros(3 * bodies + 8), np.zeros(3 * bodies + 8)
    padded[: 3 * bodies] = q.T.ravel()
    accelerations(L.tag, L.parameter_vector, padded, whole)
    for start, stop in ((0, 8), (8, 16), (16, bodies)):
        accelerations_of_some(L.tag, L.parameter_vector, padded, parts, start, stop)
    assert np.array_equal(whole, parts)


@kernel
def field_at(tag, parameters, sources, x, y, z):
    return binding.field(tag, parameters, sources, x, y, z)


@kernel
def field_in_lanes(tag, parameters, sources, points, out):
    ax, ay, az = binding.field(tag, parameters, sources, load(points, 0), load(points, 1), load(points, 2))
    store(out, 0, ax)
    store(out, 1, ay)
    store(out, 2, az)


@pytest.mark.nightly
@pytest.mark.parametrize("term", [zonal(), figure()], ids=["zonals", "figure"])
def test_a_particle_feels_what_a_body_of_vanishing_mass_does(term):
    q, v = state(2, 4)
    particle = n_body([*GM, 1e-30], 0.05, [term])
    acceleration = particle.gradients(q, v)[0].reshape(4, 3)[3] / 1e-30
    L = n_body(GM, 0.05, [term])
    sources = q[:3].T.ravel().copy()
    found = field_at(L.tag, L.parameter_vector, sources, *q[3])
    assert np.max(np.abs(found - acceleration)) < 16 * EPS * np.max(np.abs(acceleration))
    points, out = np.repeat(q[3][:, None], 8, axis=1), np.empty((3, 8))
    points += 0.1 * np.arange(8)
    field_in_lanes(L.tag, L.parameter_vector, sources, points, out)
    alone = np.array([field_at(L.tag, L.parameter_vector, sources, *point) for point in points.T]).T
    assert np.max(np.abs(out - alone)) < 16 * EPS * np.max(np.abs(alone))


@kernel
def particle(tag, parameters, sources, speeds, place, velocity):
    return binding.particle_gradients(tag, parameters, 0.0, sources, speeds, place, velocity)


@pytest.mark.parametrize("terms", at((2, 3, 5), SUMS.values()), ids=SUMS)
def test_a_particles_own_lagrangian_is_that_of_a_body_of_vanishing_mass(terms):
    q, v = state(2, 4)
    f, p = n_body([*GM, 1e-30], 0.05, terms(4)).gradients(q, v)
    L = n_body(GM, 0.05, terms(3))
    sources, speeds = (x[:3].T.ravel().copy() for x in (q, v))
    found = np.array(particle(L.tag, L.parameter_vector, sources, speeds, tuple(q[3]), tuple(v[3])))
    expected = np.concatenate([f.reshape(4, 3)[3], p.reshape(4, 3)[3]]) / 1e-30
    assert np.max(np.abs(found - expected)) < 16 * EPS * np.max(np.abs(expected))


@kernel
def momenta_of_particle(tag, parameters, sources, speeds, place, velocity):
    return particle_momenta(tag, parameters, 0.0, sources, speeds, place, velocity)


@pytest.mark.parametrize("terms", at((2, 3, 5), SUMS.values()), ids=SUMS)
def test_the_momentum_of_a_particle_alone_is_that_beside_its_force(terms):
    q, v = state(2, 4)
    L = n_body(GM, 0.05, terms(3))
    arguments = (*(x[:3].T.ravel().copy() for x in (q, v)), tuple(q[3]), tuple(v[3]))
    found = np.array(momenta_of_particle(L.tag, L.parameter_vector, *arguments))
    expected = np.array(particle(L.tag, L.parameter_vector, *arguments))[3:] - v[3]
    assert np.max(np.abs(found - expected)) < 8 * EPS


@pytest.mark.parametrize("terms", at((5, 8), SUMS.values()), ids=SUMS)
def test_the_charges_of_terms_complete_those_of_newton(terms):
    L, newton = n_body(GM, 0.1, terms(len(GM))), n_body(GM, 0.1)
    q, v = state()
    energy, momentum, angular = charges(L, q[None], v[None])
    p, plain = (x.gradients(q, v)[1].reshape(-1, 3) for x in (L, newton))
    # Each side is a difference of numbers of about 1.
    assert energy[0] == pytest.approx(L.energy(q, v) - newton.energy(q, v), abs=32 * EPS)
    assert np.max(np.abs(momentum[0] - (p - plain).sum(axis=0))) < 16 * EPS
    assert np.max(np.abs(angular[0] - np.cross(q, p - plain).sum(axis=0))) < 16 * EPS


PROGRAM = """
import numpy as np
from orbits.lagrangians.newtonian import n_body
from orbits.lagrangians.terms import charges
from orbits.lagrangians.terms.zonal_harmonics import zonal_harmonics

L = n_body([1.0, 0.3], 0.0, [zonal_harmonics(0, 0.3, (0.0, 0.0, 1.0), {2: 0.02})])
charges.charges(L, np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), np.zeros((2, 3)))
stats = charges.write_charges.entry.stats
print(sum(stats.cache_hits.values()), sum(stats.cache_misses.values()))
"""


@pytest.mark.nightly
def test_a_second_process_finds_the_compiled_sum_on_disk(tmp_path):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    run = [
        subprocess.run([sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, check=True)
        for _ in range(2)
    ]
    assert [process.stdout.split() for process in run] == [["0", "1"], ["1", "0"]]


@pytest.mark.nightly
def test_frame_dragging_turns_the_node_by_2GS_over_c2a3():
    """Lense and Thirring: dOmega/dt = 2 G S / (c^2 a^3 (1 - e^2)^(3/2)), and the energy stays, in canonical form."""
    drag, inc = 1e-4, 0.7
    L = n_body([1.0, 1e-9], 0.0, [frame_dragging(0, (0.0, 0.0, -2.0 * drag))])
    q = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
    v = [[0.0, 0.0, 0.0], [0.0, np.cos(inc), np.sin(inc)]]
    path = orbits.march(L, orbits.Gauss(stages=4), q=q, v=v, dt=2 * np.pi / 40, steps=800)
    x, p = path.q.reshape(-1, 2, 3), path.p.reshape(-1, 2, 3)
    h = np.cross(x[:, 1] - x[:, 0], p[:, 1] / 1e-9 - p[:, 0])
    node = np.unwrap(np.arctan2(h[:, 0], -h[:, 1]))
    # Periodic terms of 1e-4 over 20 turns, against 2e-4 * 126: the slope has 1e-3 of them, and second order 1e-4.
    assert np.polyfit(path.t, node, 1)[0] == pytest.approx(2.0 * drag, rel=5e-3)
    energy = path.energy()
    assert np.ptp(energy) < 64 * EPS * abs(energy[0])
