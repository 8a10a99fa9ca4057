"""The centre of mass moves straight on: what light bodies and terms add to a force takes no digits from it."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import orbits

from ..coverings import cover

BINARY = np.array([[-0.7, 0.0, 0.0], [1.0, 0.0, 0.0]]) / 1.7
SPEEDS = np.array([[0.0, -0.7, -0.07], [0.0, 1.0, 0.1]]) * 1.2 / 1.7


def binary(light):
    """Return two stars in eccentric orbits about each other, and a planet of that GM far out."""
    q = np.vstack([BINARY, [0.0, 7.0, 0.3]])
    v = np.vstack([SPEEDS, [-0.5, 0.0, 0.1]])
    return orbits.System(["A", "B", "planet"], gm=[1.0, 0.7, light], q=q, v=v, units=orbits.DIMENSIONLESS)


def off_the_line(run):
    """Return the largest distance of the centre of mass from where its first state leads, in exact arithmetic."""
    gm = [Fraction(x) for x in run.system.values.gm.tolist()]

    def centre(states, k):
        return sum(m * Fraction(x) for m, x in zip(gm, states[:, k].tolist(), strict=True)) / sum(gm)

    off = [
        float(centre(q, k) - centre(run.system.values.q, k) - centre(run.system.values.v, k) * Fraction(t))
        for t, q in zip(run.t.value.tolist(), run.q.value, strict=True)
        for k in range(3)
    ]
    return max(map(abs, off))


# 1e-17 to 3e-17 seen, the rounding of the samples. Where the attraction of the light body was added in float64 numbers,
# the sum lost the low part of the stars' attraction on each other, and the drift was 4e-15 to 9e-14, growing as t^2.
@cover(("dt", "light"), [None, 0.1], [1e-15, 1e-12, 1e-9, 1e-4], strength=1)
def test_a_light_third_body_does_not_move_the_centre_of_mass_of_a_binary(light, dt):
    run = orbits.propagate(binary(light), "gauss", dt=dt, duration=350.0, samples=8)
    assert off_the_line(run) < 1e-16


@pytest.mark.nightly
def test_a_weak_term_does_not_move_the_centre_of_mass_of_a_binary():
    flat = binary(1e-9).with_terms(orbits.terms.ZonalHarmonics("A", J2=1e-6, radius=0.01, pole=[0.0, 0.0, 1.0]))
    run = orbits.propagate(flat, "gauss", dt=0.1, duration=350.0, samples=8)
    assert off_the_line(run) < 1e-16
