"""Coordinates on the target plane, against a hyperbola that is known at its asymptote, and probabilities in a disc."""

from __future__ import annotations

import math

import numpy as np
import pytest

from orbits.elements import two_body
from orbits.elements.target_plane import on_target_plane
from orbits.results.chance import Chance, probability_in_disc

GM, SPEED = 1.0, 1.3
MOVING = np.array([0.3, -1.1, 0.4])
"""The velocity of the planet."""


def incoming(xi: float, zeta: float, far: float = 1e6) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A state far out on a hyperbola with these coordinates, and the axes of the plane, by their definition."""
    eta = np.array([2.0, 3.0, -6.0]) / 7.0
    down = MOVING - (MOVING @ eta) * eta
    axes = np.array([np.cross(eta, -down), eta, -down])
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    q = xi * axes[0] + zeta * axes[2] - far * eta
    v = eta * math.sqrt(SPEED**2 + 2.0 * GM / far)
    return q, v, axes


@pytest.mark.parametrize("place", [(1.4, -2.3), (0.0, 0.9), (1e-3, 0.0)])
def test_coordinates_are_those_of_the_asymptote_at_every_place(place: tuple[float, float]) -> None:
    q, v, axes = incoming(*place)
    near = [two_body(q, v, GM, time) for time in (6.9e5, 7.6923e5, 7.7e5)]
    for state in ((q, v), *near):
        on = on_target_plane(*(np.asarray(x)[None] for x in state), GM, MOVING[None], modified=False)
        # At the start, 1e6 away, b is larger by GM / (v^2 1e6), 6e-7 of itself; beyond the pericentre rounding grows,
        # to 1.1e-7 of the closest passage.
        assert (on.xi[0], on.zeta[0]) == pytest.approx(place, rel=1e-6, abs=2e-7)
        assert math.sqrt(on.speed2[0]) == pytest.approx(SPEED, rel=1e-9)
        np.testing.assert_allclose(on.axes[0], axes, atol=4e-7)
        b2, r = on.xi[0] ** 2 + on.zeta[0] ** 2, on.pericentre[0]
        assert b2 == pytest.approx(r**2 + 2.0 * GM * r / on.speed2[0], rel=1e-7)


def test_on_the_modified_plane_is_the_pericentre_itself() -> None:
    e, r = 0.6, 2.0
    q, v = np.array([r, 0.0, 0.0]), np.array([0.0, math.sqrt(GM * (1.0 + e) / r), 0.0])
    for time in (0.0, 1.0, -3.0):
        state = (np.asarray(x)[None] for x in two_body(q, v, GM, time))
        on = on_target_plane(*state, GM, MOVING[None], modified=True)
        assert on.pericentre[0] == pytest.approx(r, rel=1e-14)
        assert on.speed2[0] < 0.0
        np.testing.assert_allclose(on.axes[0, 1], v / np.linalg.norm(v), atol=1e-14)
        np.testing.assert_allclose(on.xi[0] * on.axes[0, 0] + on.zeta[0] * on.axes[0, 2], q, atol=1e-14)


def test_probability_in_a_disc_where_it_is_known() -> None:
    def disc(x: float, y: float, s: float, t: float, radius: float = 1.0, turn: float = 0.0) -> float:
        c, d = math.cos(turn), math.sin(turn)
        R = np.array([[c, -d], [d, c]])
        return probability_in_disc(R @ [x, y], R @ np.diag([s**2, t**2]) @ R.T, radius)

    for s in (1e-3, 0.3, 1.0, 50.0):  # about the centre of a round one
        assert disc(0.0, 0.0, s, s) == pytest.approx(-math.expm1(-0.5 / s**2), rel=1e-12)
    # Of a line through the disc at x = 0.6, from y = -0.8 to 0.8.
    line = math.erf(0.8 / (2.0 * math.sqrt(2.0)))
    assert disc(0.6, 0.0, 1e-6, 2.0, turn=0.7) == pytest.approx(line, rel=1e-5)
    assert disc(0.999, 0.0, 1e-9, 1e-9) == pytest.approx(1.0, abs=1e-13)
    assert disc(1.001, 0.0, 1e-9, 1e-9) == 0.0
    rng = np.random.default_rng(4)
    sample = rng.normal([0.8, -0.4], [0.5, 1.5], (400_000, 2))
    share = float((np.hypot(*sample.T) < 1.0).mean())
    assert disc(0.8, -0.4, 0.5, 1.5) == pytest.approx(share, abs=3e-3)  # four sigmas of the sample
    assert disc(0.8, -0.4, 0.5, 1.5, turn=2.0) == pytest.approx(disc(0.8, -0.4, 0.5, 1.5), rel=1e-12)


def test_wilson_interval_is_that_of_the_book() -> None:
    found = Chance.of(81, 263)  # Agresti & Coull (1998) and Newcombe (1998), table I: 0.2553 to 0.3662
    assert (found.low, found.high) == pytest.approx((0.2553, 0.3662), abs=5e-5)
    none = Chance.of(0, 1000)
    assert none.low == 0.0
    assert none.high == pytest.approx(0.003827, abs=1e-6)
