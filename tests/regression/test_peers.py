"""REBOUND as a peer gets our floats, keeps our grid, and gives its samples back in our order."""

from __future__ import annotations

import os
import signal
import threading

import numpy as np
import pytest
import rebound
from hypothesis import given
from hypothesis import strategies as st

from orbits import diagnostics
from orbits.errors import IntegrationError, Interrupted
from orbits.point_masses import PointMasses
from orbits.regression import peers, reference
from orbits.regression.peer_choice import PEERS, lookup

from ..coverings import each
from ..mixed_bodies import DT, GM, Q, V

DAYS = 128 * DT
IN_LANES = "whfast512", "whfast512:corrector=17"
ALL = [
    *(name for name in PEERS if name not in IN_LANES),
    "whfast:kernel=composition,corrector=17",
    "whfast:coordinates=barycentric,corrector=3",
    "saba:type=cl_4",
    "trace:peri_mode=partial_bs",
    "leapfrog:order=8",
]
FIXED = [name for name in ALL if not name.startswith("ias15")]
WITH_AVX512 = pytest.mark.skipif(not rebound.avx512_available, reason="this processor has no AVX-512")


def test_the_simulation_holds_the_same_bits_massive_bodies_first_and_central_body_leading():
    order = peers.order_of_bodies(GM, Q, V)
    assert order.tolist() == [2, 0, 4, 1, 3]
    sim = peers.simulation(PointMasses(GM[order], Q[order], V[order], 0.25), ["Sun", "Jupiter", "Saturn", "a", "b"])
    assert [(p.m, p.x, p.y, p.z, p.vx, p.vy, p.vz) for p in sim.particles] == [(GM[i], *Q[i], *V[i]) for i in order]
    assert (sim.G, sim.softening, sim.N_active, sim.testparticle_type, sim.t) == (1.0, 0.25, 3, 0, 0.0)
    assert [p.name for p in sim.particles] == ["Sun", "Jupiter", "Saturn", "a", "b"]


@each("name", ALL)
def test_samples_come_back_in_the_order_of_the_caller(name):
    run = peers.run(name, PointMasses(GM, Q, V), times=np.array([0.0, DAYS]), dt=DT)
    np.testing.assert_array_equal(run.q[0], Q)
    np.testing.assert_array_equal(run.v[0], V)
    shuffled = [3, 2, 4, 1, 0]
    again = peers.run(name, PointMasses(GM[shuffled], Q[shuffled], V[shuffled]), times=np.array([0.0, DAYS]), dt=DT)
    # Only the order of the two massless bodies differs inside REBOUND, and they act on nobody.
    np.testing.assert_array_equal(again.q, run.q[:, shuffled])


@each("name", FIXED)
def test_sampling_does_not_disturb_a_fixed_step_run(name):
    alone = peers.run(name, PointMasses(GM, Q, V), times=np.array([DAYS]), dt=DT)
    on_grid = peers.run(name, PointMasses(GM, Q, V), times=np.arange(0, DAYS + DT, 2 * DT), dt=DT)
    off_grid = peers.run(name, PointMasses(GM, Q, V), times=np.linspace(0, DAYS, 100), dt=DT)
    assert alone.steps == on_grid.steps == off_grid.steps == 128
    np.testing.assert_array_equal(on_grid.q[-1], alone.q[-1])
    np.testing.assert_array_equal(off_grid.q[-1], alone.q[-1])
    np.testing.assert_array_equal(off_grid.v[-1], alone.v[-1])


@each("name", FIXED)
def test_samples_between_grid_points_are_as_good_as_those_on_it(name):
    """A partial step that begins or ends unsynchronized, or of the wrong length, would be off by 0.01 au and more."""
    errors = []
    for times in (np.arange(0, DAYS + DT, DT), np.linspace(0, DAYS, 100)):
        truth = peers.run("ias15", PointMasses(GM, Q, V), times=times, dt=DT).q
        errors.append(np.abs(peers.run(name, PointMasses(GM, Q, V), times=times, dt=DT).q - truth).max(axis=(0, 2)))
    # Errors grow with time, so the largest on and off the grid agree: to 0.3 % where this was written; SABA's are
    # round-off, 1e-13, and agree to 1e-15.
    np.testing.assert_allclose(errors[1], errors[0], rtol=0.01, atol=5e-15)


def test_the_corrector_and_the_coordinates_that_a_name_promises_are_in_force():
    massive = GM > 0
    truth = peers.run("ias15", PointMasses(GM, Q, V), times=np.array([DAYS]), dt=DT).q
    error = {n: np.abs(peers.run(n, PointMasses(GM, Q, V), times=np.array([DAYS]), dt=DT).q - truth)[0] for n in FIXED}
    # Reached: a factor of 94, and of 1.26: another splitting makes another error.
    assert error["whfast-corrector17"][massive].max() < 0.02 * error["whfast"][massive].max()
    assert error["whfast-heliocentric"][massive].max() > 1.1 * error["whfast"][massive].max()


@each("name", FIXED)
def test_fixed_step_peers_run_backwards_to_where_they_came_from(name):
    there = peers.run(name, PointMasses(GM, Q, V), times=np.array([DAYS]), dt=DT)
    back = peers.run(name, PointMasses(GM, there.q[-1], there.v[-1]), times=np.array([-DAYS]), dt=DT)
    # All are symmetric maps; the correctors cost a few digits more than the bare steps: 3.1e-13 with composition.
    np.testing.assert_allclose(back.q[-1], Q, rtol=0, atol=6e-13)


def test_ias15_runs_backwards_and_stops_exactly_at_the_samples():
    gm, q, v = np.array([1.0, 0.0]), np.array([[0.0, 0, 0], [1, 0, 0]]), np.array([[0.0, 0, 0], [0, 1.1, 0]])
    times = -np.linspace(0, 30, 41)
    run = peers.run("ias15", PointMasses(gm, q, v), times=times, dt=0.1)
    # 1e-13: IAS15's own error over five orbits. A sample missed by 1e-12 in time would show tenfold.
    np.testing.assert_allclose(run.q, reference.exact(PointMasses(gm, q, v), times).q, rtol=0, atol=1e-13)


def test_massless_bodies_leave_the_massive_ones_alone():
    massive = GM > 0
    for name in ALL:
        with_particles = peers.run(name, PointMasses(GM, Q, V), times=np.array([DAYS]), dt=DT)
        without = peers.run(name, PointMasses(GM[massive], Q[massive], V[massive]), times=np.array([DAYS]), dt=DT)
        # IAS15 chooses its steps by all particles, so only it may differ in the last digits.
        atol = 1e-13 if name == "ias15" else 0.0
        np.testing.assert_allclose(with_particles.q[:, massive], without.q, rtol=0, atol=atol)


def test_halves_are_as_exact_as_the_whole_in_the_order_of_the_caller():
    assert np.count_nonzero(GM == 0) > 1
    times, told = np.linspace(0.0, DAYS, 4), []
    given = PointMasses(GM, Q, V)
    whole = peers.run("ias15", given, times=times, dt=DT)
    halves = peers.run("ias15", given, times=times, dt=DT, reached=lambda *at: told.append(at), halves=True)
    # Each half chooses its steps by its own particles: the last digits differ.
    np.testing.assert_allclose(halves.q, whole.q, rtol=0, atol=1e-12)
    np.testing.assert_allclose(halves.v, whole.v, rtol=0, atol=1e-12)
    assert [time for time, _ in told] == list(times)
    assert halves.steps == told[-1][1]
    fixed = (
        peers.run("leapfrog", given, times=times, dt=DT),
        peers.run("leapfrog", given, times=times, dt=DT, halves=True),
    )
    np.testing.assert_array_equal(fixed[0].q, fixed[1].q)


def test_the_softening_length_is_passed_on():
    gm, q, v = np.array([1.0, 0.5]), np.array([[0.0, 0, 0], [1, 0, 0]]), np.array([[0.0, -0.2, 0], [0, 0.4, 0]])
    run = peers.run("ias15", PointMasses(gm, q, v, 0.3), times=np.linspace(0, 20, 21), dt=0.1)
    softened = diagnostics.energy(gm, run.q, run.v, 0.3)
    unsoftened = diagnostics.energy(gm, run.q, run.v, 0.0)
    assert np.ptp(softened) < 1e-14 * abs(softened[0])
    assert np.ptp(unsoftened) > 0.01 * abs(unsoftened[0])


def test_whfast_is_not_offered_a_problem_that_it_cannot_do():
    three = np.ones(3)
    whfast = lookup("whfast")
    assert "outweighs" in (peers.unsuited(whfast, three, 0.0) or "")
    assert "softening" in (peers.unsuited(whfast, GM, 0.1) or "")
    assert peers.unsuited(whfast, GM, 0.0) is None
    assert peers.unsuited(whfast, np.ones(2), 0.0) is None  # two bodies are one Kepler problem, whatever the masses
    assert peers.unsuited(lookup("ias15"), three, 0.1) is None
    with pytest.raises(IntegrationError, match="outweighs"):
        peers.run("whfast", PointMasses(three, Q[:3], V[:3]), times=np.array([1.0]), dt=0.1)


@pytest.mark.parametrize("integrator", ["mercurius", "trace"])
def test_hybrid_peers_follow_an_encounter_that_whfast_does_not(integrator):
    """A light planet on its way through three Hill radii of a giant, in steps of a hundredth of a turn."""
    gm = np.array([1.0, 1e-3, 1e-9])
    angle = 0.4
    q = np.array([[0.0, 0, 0], [1, 0, 0], [1.15 * np.cos(angle), 1.15 * np.sin(angle), 0]])
    v = np.array([[0.0, 0, 0], [0, 1, 0], [-np.sin(angle) / np.sqrt(1.15), np.cos(angle) / np.sqrt(1.15), 0]])
    x, times = PointMasses(gm, q, v), np.array([9.0])
    truth = peers.run("ias15", x, times=times, dt=0.06).q
    off = {name: np.abs(peers.run(name, x, times=times, dt=0.06).q - truth).max() for name in (integrator, "whfast")}
    assert off[integrator] < 0.2 * off["whfast"]
    # Where all encounters are told to be none, it is the plain map.
    plain = peers.run(f"{integrator}:r_crit_hill=1e-9", x, times=times, dt=0.06).q
    assert np.abs(plain - truth).max() > 2 * off[integrator]


@WITH_AVX512
@pytest.mark.parametrize("name", IN_LANES)
def test_whfast512_takes_the_steps_it_is_asked_for_in_both_directions_and_between_grid_points(name):
    massive = GM > 0
    x = PointMasses(GM[massive], Q[massive], V[massive])
    alone = peers.run(name, x, times=np.array([DAYS]), dt=DT)
    often = peers.run(name, x, times=np.linspace(0, DAYS, 100), dt=DT)
    assert alone.steps == often.steps == 128
    # Synchronized at each sample: 1.9e-13 were reached, of coordinates of 5 au.
    np.testing.assert_allclose(often.q[-1], alone.q[-1], rtol=0, atol=1e-12)
    back = peers.run(name, PointMasses(x.gm, alone.q[-1], alone.v[-1]), times=np.array([-DAYS]), dt=DT)
    np.testing.assert_allclose(back.q[-1], x.q, rtol=0, atol=3e-13)
    truth = peers.run("ias15", x, times=np.linspace(0, DAYS, 100), dt=DT).q
    # 2.2e-7 and 2.3e-9: a step more or less, or a partial one of the wrong length, would be off by 0.01 au and more.
    assert np.abs(often.q - truth).max() < (4e-9 if "corrector" in name else 4e-7)


@WITH_AVX512
def test_whfast512_leaves_the_arithmetic_of_the_process_as_it_was():
    """It sets flags by which the processor takes subnormal numbers for zero, for all that is computed later."""
    massive = GM > 0
    peers.run("whfast512", PointMasses(GM[massive], Q[massive], V[massive]), times=np.array([DAYS]), dt=DT)
    assert np.array([1e-310])[0] * 0.5 == 5e-311


def test_whfast512_says_what_it_cannot_take(monkeypatch):
    peer = lookup("whfast512")
    monkeypatch.setattr(rebound, "avx512_available", True)
    assert peers.unsuited(peer, GM, 0.0) == "it takes no massless bodies, and this system has 2"
    ten = np.array([1.0, *[1e-6] * 9])
    assert peers.unsuited(peer, ten, 0.0) == "it takes at most 9 bodies, and this system has 10"
    assert "outweighs" in (peers.unsuited(peer, np.ones(3), 0.0) or "")
    assert peers.unsuited(peer, GM[GM > 0], 0.0) is None
    monkeypatch.setattr(rebound, "avx512_available", False)
    assert "AVX-512" in (peers.unsuited(peer, GM[GM > 0], 0.0) or "")


def test_python_gets_the_keyboard_back_after_rebound():
    """REBOUND replaces the C handler of SIGINT; Python must see Ctrl-C again afterwards."""
    peers.run("ias15", PointMasses(GM, Q, V), times=np.array([DAYS]), dt=DT)
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


@given(k=st.integers(0, 10**7), part=st.floats(0, 1, exclude_max=True), exponent=st.integers(-20, 10))
def test_the_grid_position_is_whole_steps_and_a_rest_shorter_than_one(k, part, exponent):
    dt = float(np.float32(1.7)) * 2.0**exponent  # 24 bits, as the steps of runs are, so that k dt is exact
    t = k * dt + part * dt
    whole, rest = peers.grid_position(t, dt)
    assert 0 <= rest < dt
    assert whole * dt + rest == t
    assert peers.grid_position(-t, dt) == (whole, rest)


def test_ctrl_c_stops_a_peer_in_words():
    interrupt = threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT))
    interrupt.start()
    try:
        with pytest.raises(Interrupted, match=r"^stopped by Ctrl-C$"):
            peers.run("ias15", PointMasses(GM, Q, V), times=np.array([1e9]), dt=DT)  # minutes, if nothing stopped it
    finally:
        interrupt.cancel()
