"""Wisdom–Holman steps of up to sixteen planets, which stay in registers, and what is seen of them."""

import itertools
import json

import numpy as np
import pytest

import orbits
from orbits.elements import state_from_elements
from orbits.kernels.maps.interaction import displace, interact, modify
from orbits.kernels.maps.jacobi_stages import (
    NO_TABLE,
    advance_planets,
    finish_velocities,
    step_lazy,
    step_modified,
    step_plain,
)
from orbits.kernels.search.record import ABOUT, FASTEST2, LEAST2, MATE, ROW, STEP
from orbits.kernels.steps import Model
from orbits.lagrangians.newtonian import newtonian, parameters
from orbits.marching.legs.leg import Leg
from orbits.resources import data_path

from ..coverings import cover, each, first, keep


def solar_system(count):
    """GM, q, v of the Sun and the first planets."""
    data = json.loads(data_path("solar_system_10body.json").read_text())
    return [np.array(data[name])[: count + 1] for name in ("gm_au3_d2", "q", "v")]


def crossing(seed):
    """A star and seven light planets on eccentric orbits that cross, one of them unbound."""
    rng = np.random.default_rng(seed)
    a, e, M = rng.uniform(0.8, 3.0, 7), rng.uniform(0.0, 0.4, 7), rng.uniform(0, 2 * np.pi, 7)
    E = M.copy()
    for _ in range(50):
        E = M + e * np.sin(E)
    b, r, turn = np.sqrt(1 - e * e), 1 - e * np.cos(E), rng.uniform(0, 2 * np.pi, 7)
    q = np.array([a * (np.cos(E) - e), a * b * np.sin(E), 0.02 * rng.normal(size=7)])
    v = np.array([-np.sin(E), b * np.cos(E), 0.02 * rng.normal(size=7)]) / (r * np.sqrt(a))
    for x in (q, v):
        x[0], x[1] = np.cos(turn) * x[0] - np.sin(turn) * x[1], np.sin(turn) * x[0] + np.cos(turn) * x[1]
    v[:, 6] *= 1.6
    gm = np.concatenate([[1.0], 1e-6 * rng.uniform(0.1, 10.0, 7)])
    return gm, np.vstack([np.zeros(3), q.T]), np.vstack([np.zeros(3), v.T])


def crowded(count):
    """A star and planets close to each other, heavy enough for each pull to show, in an order of their own."""
    rng = np.random.default_rng(count)
    a, angle, e = 1.15 ** np.arange(count), rng.uniform(0, 2 * np.pi, count), rng.uniform(0, 0.05, count)
    r, speed = a * (1 + e), np.sqrt((1 - e) / (1 + e) / a)
    q = np.array([r * np.cos(angle), r * np.sin(angle), 0.03 * a * np.sin(2 * angle)]).T
    v = np.array([-speed * np.sin(angle), speed * np.cos(angle), 0.02 * speed]).T
    gm, order = np.array([1.0, *rng.uniform(1e-5, 1e-4, count)]), rng.permutation(count + 1)
    return gm[order], np.vstack([np.zeros(3), q])[order], np.vstack([np.zeros(3), v])[order]


def marcher(gm, q, v, h, *, looks=True, **options):
    return Leg.of(newtonian, orbits.WisdomHolman(**options), parameters(gm), gm > 0, q, v, h, approaches=looks)


@pytest.mark.parametrize(
    ("kick", "count"),
    keep(
        lambda _, case: case[0] == "modified-kick" and case[1] in (2, 8),
        itertools.product(["standard", "modified-kick", "lazy"], [1, 2, 5, 8]),
    ),
)
def test_a_step_in_registers_has_the_bits_of_its_parts(kick, count):
    h = 3.0
    gm, q, v = solar_system(count)
    march, strength = marcher(gm, q, v, h, kernel=kick), parameters(gm)
    model = Model(newtonian.tag, strength)
    march.advance(5)
    begun = march.stepper.state["memory"], march.stepper.loops._scratch
    planets, room = (x.copy() for x in begun)
    other, its_room = (x.copy() for x in begun)
    shift = h * h / 12
    for _ in range(20):
        advance_planets(other, its_room, h, h / 2)
        interact(other, its_room, count, False)
        if kick == "standard":
            step_plain(None, model, strength, planets, room, room, NO_TABLE, h)
        elif kick == "lazy":
            step_lazy(None, model, strength, planets, room, room, NO_TABLE, h, shift)
            displace(other, its_room, shift)
            interact(other, its_room, count, True)
        else:
            step_modified(None, model, strength, planets, room, room, NO_TABLE, h, shift)
            modify(other, its_room, count, shift)
        finish_velocities(other, its_room, h / 2)
    assert np.isfinite(planets).all()
    assert np.array_equal(planets, other)


@cover(("kick", "count"), ["standard", "modified-kick", "lazy"], [9, 12, 16], strength=1)
def test_a_step_in_two_registers_is_that_by_passes_over_memory(kick, count):
    h = 0.05
    march = marcher(*crowded(count), h, kernel=kick)
    march.advance(5)
    other, its_room = march.stepper.state["memory"].copy(), march.stepper.loops._scratch.copy()
    begun, shift = other.copy(), h * h / 12
    march.advance(20)
    for _ in range(20):
        advance_planets(other, its_room, h, h / 2)
        interact(other, its_room, count, False)
        if kick == "lazy":
            displace(other, its_room, shift)
            interact(other, its_room, count, True)
        elif kick == "modified-kick":
            modify(other, its_room, count, shift)
        finish_velocities(other, its_room, h / 2)
    planets = march.stepper.state["memory"]
    change = (planets[:24] + 0.0) - other[:24]
    both = [change[k : k + 6] + change[k + 6 : k + 12] for k in (0, 12)]
    assert np.abs(planets[12:18, : count - 8] - begun[12:18, : count - 8]).max() > 0.1
    # The pulls, up to 1e-4 / 0.15^2, are rounded differently: by 1e-18 in a kick of 0.05.
    assert np.abs(both).max() < 4e-18


@pytest.mark.nightly
@pytest.mark.parametrize("kick", ["standard", "modified-kick", "lazy"])
def test_planets_in_two_registers_have_the_same_bits_with_particles_and_without(kick):
    gm, q, v = crowded(12)
    alone = marcher(gm, q, v, 0.05, kernel=kick)
    far = np.array([[30.0, 0.0, 0.0]]), np.array([[0.0, 0.2, 0.0]])
    among = Leg.of(
        newtonian, orbits.WisdomHolman(kernel=kick), parameters(gm), np.arange(14) < 13, np.vstack([q, far[0]]),
        np.vstack([v, far[1]]), 0.05,
    )  # fmt: skip
    for steps in (1, 30, 200):
        alone.advance(steps)
        among.advance(steps)
        for a, b in zip(alone.state(), among.state(), strict=True):
            assert np.array_equal(a, b[:13])


@pytest.mark.parametrize("kick", ["standard", "modified-kick", "lazy"])
def test_planets_move_alike_in_one_register_and_in_two(kick):
    gm, q, v = solar_system(9)
    gm[1] = 1e-40  # Mercury moves nothing, but moves the others by a place, Pluto into a second register
    others = [0, *range(2, 10)]
    one, two = marcher(gm[others], q[others], v[others], 3.0, kernel=kick), marcher(gm, q, v, 3.0, kernel=kick)
    for march in (one, two):
        march.advance(2000)
    for a, b in zip(one.state(), two.state(), strict=True):
        # The sums are rounded differently, but in what is 1e-3 of the motion, with low parts: no bit differed.
        assert np.max(np.abs(a - b[others])) < 1e-14


def cannot_follow(march, listed, gm):
    """Which passages in a list the map cannot follow: of two planets within three mutual Hill radii, and of the star
    in fewer than 16 steps a turn.
    """
    row, mate = listed[:, ROW].astype(int), listed[:, MATE].astype(int)
    least, speed = np.sqrt(listed[:, LEAST2]), np.sqrt(listed[:, FASTEST2])
    near = 3.0 * np.linalg.norm(listed[:, ABOUT : ABOUT + 3], axis=1) * np.cbrt((gm[row] + gm[mate]) / (3.0 * gm[0]))
    central = (row == 0) | (mate == 0)
    return np.where(central, abs(march.clock.h) * speed > 2.0 * np.pi / 16 * least, least < near)


SYSTEMS = {
    "crossing": lambda rng: crossing(int(rng.integers(1000))),
    "heavy": lambda rng: planets_of(rng, gm=1e-3, count=4, apart=0.6, e=0.1),
    "many": lambda rng: planets_of(rng, gm=3e-5, count=8, apart=0.12, e=0.15),
    "twelve": lambda rng: planets_of(rng, gm=3e-5, count=12, apart=0.12, e=0.15),
    "sixteen, wide": lambda rng: planets_of(rng, gm=1e-5, count=16, apart=0.4, e=0.45),
    "eccentric": lambda rng: planets_of(rng, gm=1e-5, count=3, apart=1.0, e=0.75),
}


def planets_of(rng, *, gm, count, apart, e):
    """A star and planets on orbits each wider than the one before by a factor."""
    masses, states = [1.0], [np.zeros((2, 3))]
    for k in range(count):
        a, angles = (1.0 + apart) ** k * rng.uniform(0.97, 1.03), rng.uniform(0.0, 2.0 * np.pi, 3)
        masses.append(gm * 10.0 ** rng.uniform(-1.0, 0.3))
        shape = {"e": e * rng.uniform(0.3, 1.0), "inc": 0.05 * rng.random()}
        angles = dict(zip(("Omega", "omega", "M"), angles, strict=True))
        states.append(np.array(state_from_elements(1.0 + masses[-1], a=a, **shape, **angles)))
    q, v = np.array(states).transpose(1, 0, 2)
    return np.array(masses), q, v


@pytest.mark.parametrize("seed", first(1, range(6)))
@each("kind", SYSTEMS)
def test_no_passage_that_the_map_cannot_follow_is_missed_by_looking_at_kicks_alone(kind, seed):
    gm, q, v = SYSTEMS[kind](np.random.default_rng(seed))
    missed, hard, blind = 0, 0, 0
    for h in (0.05, 0.15, -0.3):
        every, screened = (marcher(gm, q, v, h, looks=looks) for looks in (True, False))
        for march in (every, screened):
            march.block = 64
        for _ in range(60):
            every.advance(64)
            screened.advance(64)
            blind += not screened.observers.sees_path
        listed, found = every.listing.passages.passages, {row.tobytes() for row in screened.listing.passages.passages}
        for row in listed[cannot_follow(every, listed, gm)]:
            hard, missed = hard + 1, missed + (row.tobytes() not in found)
        assert np.array_equal(every.state(), screened.state())
    assert missed == 0
    assert hard > 0 or kind in ("heavy", "sixteen, wide")
    assert blind > 0 or kind != "heavy"


@pytest.mark.parametrize("count", [8, 9])
def test_the_planets_in_the_usual_steps_are_never_looked_at_closely(count):
    march = marcher(*solar_system(count), 3.0, looks=False)
    march.advance(100_000)
    assert not march.observers.sees_path
    assert len(march.listing.passages.passages) == 0


@cover(("looks", "count"), [True, False], [3, 8], strength=1)
def test_every_meeting_of_planets_is_listed_also_if_their_distance_hardly_changes(count, looks):
    for seed in range(8):
        gm, q, v = planets_of(np.random.default_rng(seed), gm=1e-3, count=count, apart=0.1, e=0.3)
        plain, steps = {"kernel": "standard", "corrector": 0, "looks": looks}, 150
        march, whole = (marcher(gm, q, v, 0.1, **plain) for _ in range(2))
        states = [march.state()]
        for _ in range(steps):
            march.advance(1)
            states.append(march.state())
        whole.advance(steps)
        listed = {(int(row[ROW]), int(row[MATE]), int(row[STEP])) for row in whole.listing.passages.passages}
        x, u = np.array(states).transpose(1, 0, 2, 3)
        for i in range(1, len(gm)):
            for j in range(i + 1, len(gm)):
                apart, speed = x[:, j] - x[:, i], u[:, j] - u[:, i]
                opening, distance = (apart * speed).sum(axis=1), np.linalg.norm(apart, axis=1)
                reach = 3.0 * np.linalg.norm(x[:, i] - x[:, 0], axis=1) * np.cbrt((gm[i] + gm[j]) / (3.0 * gm[0]))
                # Two planets that revolve about each other are listed when they meet, not at each turn.
                free = 0.5 * (speed * speed).sum(axis=1) > (gm[i] + gm[j]) / distance
                for k in np.flatnonzero((opening[:-1] < 0.0) & (opening[1:] >= 0.0) & free[:-1]):
                    if max(distance[k], distance[k + 1]) < 0.95 * reach[k]:
                        assert (i, j, k) in listed
