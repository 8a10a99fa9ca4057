"""Our elements are REBOUND's, name by name, wherever REBOUND has them; where it loses digits, ours are nearer."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import rebound

from orbits.elements import elements_from_state, state_from_elements

TURN = 2.0 * np.pi
N = 300


def sample(kind: str) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(21)
    e = rng.uniform(0.05, 0.9, N) if kind != "hyperbolas" else rng.uniform(1.1, 5.0, N)
    inc = rng.uniform(0.1, 1.5, N) if kind == "prograde" else rng.uniform(0.1, 3.04, N)
    limit = np.where(e < 1.0, np.pi, 0.9 * np.arccos(-1.0 / np.maximum(e, 1.0)))
    return {
        "a": np.where(e < 1.0, 1.0, -1.0) * 10.0 ** rng.uniform(-2, 3, N), "e": e, "inc": inc,
        "Omega": rng.uniform(0, TURN, N), "omega": rng.uniform(0, TURN, N), "f": rng.uniform(-1, 1, N) * limit,
    }  # fmt: skip


def theirs(elements: dict[str, Any], **more: Any) -> tuple[Any, Any]:
    """Return REBOUND's particle and its orbit about a mass of 1 at rest at the origin."""
    simulation = rebound.Simulation()
    simulation.add(m=1.0)
    simulation.add(primary=simulation.particles[0], **{key: float(x) for key, x in (elements | more).items()})
    particle = simulation.particles[1]
    return particle, particle.orbit(primary=simulation.particles[0])


def turned(x: Any, y: Any) -> float:
    return float(abs((x - y + np.pi) % TURN - np.pi))


@pytest.mark.parametrize("kind", ["prograde", "any inclination", "hyperbolas"])
def test_states_and_elements_are_rebounds(kind: str) -> None:
    given = sample(kind)
    q, v = state_from_elements(1.0, **given)
    ours = elements_from_state(q, v, 1.0)
    for i in range(N):
        particle, orbit = theirs({key: x[i] for key, x in given.items()})
        # Near the asymptote 1 + e cos f, which REBOUND forms by subtraction, is 0.02 and more: 50 roundings.
        assert np.linalg.norm(q[i] - particle.xyz) <= 2e-14 * np.linalg.norm(q[i])
        assert np.linalg.norm(v[i] - particle.vxyz) <= 2e-14 * np.linalg.norm(v[i])
        assert ours.a[i] == pytest.approx(orbit.a, rel=4e-14)
        assert ours.e[i] == pytest.approx(orbit.e, rel=4e-14)
        assert ours.inc[i] == pytest.approx(orbit.inc, abs=4e-15)
        assert ours.n[i] == pytest.approx(abs(orbit.n), rel=4e-14)
        # A few roundings in the vector of the node and in that of pericentre, magnified by 1/sin(inc) and 1/e, 10 and
        # 20 here: 8e-14 was reached. M and l of a hyperbola are no angles.
        for key in ("Omega", "omega", "pomega", "f", "theta"):
            assert turned(ours[key][i], getattr(orbit, key)) <= 2e-13, key
        assert abs(ours.h[i] - orbit.pal_h) <= 5e-14
        assert abs(ours.k[i] - orbit.pal_k) <= 5e-14
        assert abs(ours.ix[i] - orbit.pal_ix) <= 3e-14
        assert abs(ours.iy[i] - orbit.pal_iy) <= 3e-14
        if kind != "hyperbolas":
            for key in ("M", "E", "l"):
                assert turned(ours[key][i], getattr(orbit, key)) <= 2e-13, key
            assert ours.P[i] == pytest.approx(orbit.P, rel=4e-14)


@pytest.mark.parametrize("key", ["M", "E", "l", "theta", "T", "pomega", "P"])
def test_every_name_means_the_same_on_the_way_in(key: str) -> None:
    rng = np.random.default_rng(4)
    given = {**sample("any inclination"), key: rng.uniform(0.1, 3.0, N)}
    for other in {"pomega": ("omega",), "P": ("a",)}.get(key, ("f",)):
        del given[other]
    q, v = state_from_elements(1.0, **given)
    for i in range(N):
        particle, _ = theirs({name: x[i] for name, x in given.items()})
        # A longitude is a sum of angles of up to 2 pi; REBOUND stops Kepler's equation at 1e-16 to 1e-15 in E, and goes
        # to f by a tangent: thin ellipses (1 - e = 0.1) magnify that.
        assert np.linalg.norm(q[i] - particle.xyz) <= 1e-12 * np.linalg.norm(q[i])
        assert np.linalg.norm(v[i] - particle.vxyz) <= 1e-12 * np.linalg.norm(v[i])


def test_pals_elements_mean_the_same_on_the_way_in() -> None:
    rng = np.random.default_rng(8)
    for _ in range(N):
        # Between 0.2 and 0.3 REBOUND 5.2 iterates its equation for p and q too few times: it was off by up to 1.7e-5.
        e = rng.choice([rng.uniform(0.0, 0.15), rng.uniform(0.3, 0.8)])
        turn, tilt = rng.uniform(0, TURN, 3), rng.uniform(0.0, 1.95)
        given = {"a": rng.uniform(0.5, 5.0), "l": turn[0], "h": e * np.sin(turn[1]), "k": e * np.cos(turn[1]),
                 "ix": tilt * np.cos(turn[2]), "iy": tilt * np.sin(turn[2])}  # fmt: skip
        particle, _ = theirs(given)
        q, v = state_from_elements(1.0, **given)
        # l of up to 2 pi is known to 9e-16, which e = 0.8 magnifies by up to 11.
        assert np.linalg.norm(q - particle.xyz) <= 2e-14 * np.linalg.norm(q)
        assert np.linalg.norm(v - particle.vxyz) <= 2e-14 * np.linalg.norm(v)


def test_what_rebound_refuses_is_refused() -> None:
    for wrong in (
        {"a": 1.0, "e": 1.0}, {"a": 1.0, "e": -0.1}, {"a": -1.0, "e": 0.5}, {"a": 1.0, "e": 1.5},
        {"a": -1.0, "e": 1.5, "f": 3.0}, {"a": 1.0, "P": 1.0}, {"e": 0.1}, {"a": 1.0, "omega": 0.1, "pomega": 0.1},
        {"a": 1.0, "f": 0.1, "M": 0.1}, {"a": 1.0, "l": 0.1, "theta": 0.1}, {"a": 1.0, "f": 0.1, "T": 0.1},
        {"a": 1.0, "h": 0.1, "e": 0.1}, {"a": 1.0, "k": 0.1, "M": 0.1}, {"a": 1.0, "ix": 2.0, "iy": 0.5},
    ):  # fmt: skip
        with pytest.raises(ValueError):  # noqa: PT011 - any of REBOUND's
            theirs(wrong)
        with pytest.raises(ValueError, match=r"expected|given together|parabola"):
            state_from_elements(1.0, **wrong)
