"""The least distance of two ellipses, against closed forms and a dense search in true anomalies that shares no line."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from orbits.elements.least_distance import Ellipses, come_within, least_distance

from ..coverings import first
from .pairs_of_orbits import KINDS, TURN, any_pairs, ellipses


def searched(one: Ellipses, other: Ellipses, power: float) -> float:
    """Return the least |Q - q| / |q|^power that is found for a pair: all minima of a grid, each by ever finer grids."""
    a, b = (float(np.linalg.norm(each.along)) for each in (one, other))
    e, f = float(one.e[0]), float(other.e[0])
    grid = np.linspace(0.0, TURN, 120, endpoint=False) + 0.0123

    def function(E: Any, F: Any) -> Any:
        q, Q = (places(*each) for each in ((one, a, e, E), (other, b, f, F)))
        return np.linalg.norm(Q - q, axis=-1) / np.linalg.norm(q, axis=-1) ** power

    first = function(grid[:, None], grid[None, :])
    lowest = np.ones_like(first, dtype=bool)
    for shift in ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)):
        lowest &= first <= np.roll(first, shift, (0, 1))
    u, v = grid[np.nonzero(lowest)[0]], grid[np.nonzero(lowest)[1]]
    best = np.argsort(first[lowest])[:8]
    u, v, width = u[best], v[best], grid[1] - grid[0]
    star = np.array([(x, y) for x in (-1, -0.5, 0, 0.5, 1) for y in (-1, -0.5, 0, 0.5, 1)])
    for _ in range(40):
        U, V = u[:, None] + width * star[:, 0], v[:, None] + width * star[:, 1]
        values = function(U, V)
        least, rows = values.argmin(axis=1), np.arange(len(u))
        u, v, width = U[rows, least], V[rows, least], 0.5 * width
    return float(values.min())


def places(orbit: Ellipses, a: float, e: float, E: Any) -> Any:
    """Positions by the equation of the conic, r = p / (1 + e cos f)."""
    f = 2.0 * np.arctan2(np.sqrt(1.0 + e) * np.sin(E / 2.0), np.sqrt(1.0 - e) * np.cos(E / 2.0))
    r = a * (1.0 - e**2) / (1.0 + e * np.cos(f))
    x, y = orbit.along[0] / a, orbit.across[0] / np.linalg.norm(orbit.across[0])
    return (r * np.cos(f))[..., None] * x + (r * np.sin(f))[..., None] * y


@pytest.mark.parametrize("count", first(1, [5, 15]))
@pytest.mark.parametrize("kind", KINDS)
def test_a_dense_search_finds_no_pair_of_points_that_is_nearer(kind: str, count: int) -> None:
    one, other = any_pairs(kind, count)
    distance, E, F = least_distance(one, other)
    np.testing.assert_array_equal(distance, np.linalg.norm(other.at(F) - one.at(E), axis=1))
    found = [searched(one.some(np.array([k])), other.some(np.array([k])), 0.0) for k in range(count)]
    size = np.maximum(np.linalg.norm(one.along, axis=1), np.linalg.norm(other.along, axis=1))
    # Over 900 pairs at most 9e-16; the other way round the grid missed minima by up to 3e-3.
    assert ((distance - found) / size).max() < 2e-15


def test_known_distances() -> None:
    one = ellipses([1.0, 1.0, 1.0, 1.0, 1.0], [0.0, 0.0, 0.3, 0.3, 0.2])
    other = ellipses([1.5, 2.0, 1.0, 1.0, 1.0], [0.0, 0.0, 0.3, 0.3, 0.7], [0.0, TURN / 4, 0.0, TURN / 4, 0.0])
    # Concentric; one circle through the axis of the other; the same; turned about the apsides; crossing at two points.
    assert least_distance(one, other)[0] == pytest.approx([0.5, 1.0, 0.0, 0.0, 0.0], abs=1e-15)


def test_none_at_all() -> None:
    none = ellipses(np.empty(0), 0.0)
    assert [len(each) for each in least_distance(none, none)] == [0, 0, 0]
    assert len(come_within(none, none, np.empty(0))) == 0


@pytest.mark.parametrize("kind", ["any", "thin"])
def test_whether_they_come_within_a_share_of_the_distance_is_decided_to_the_last_digits(kind: str) -> None:
    one, other = any_pairs(kind, 15)
    share = np.array([searched(one.some(np.array([k])), other.some(np.array([k])), 1.0) for k in range(15)])
    assert come_within(one, other, share * (1.0 + 1e-9)).all()
    assert not come_within(one, other, share * (1.0 - 1e-9)).any()  # the square of the share has 16 digits, so 1e-15


def test_ellipses_apart_by_their_apsides_need_no_search(monkeypatch: pytest.MonkeyPatch) -> None:
    one, other = ellipses([1.0, 1.0], 0.1), ellipses([1.5, 0.7], 0.1, 0.5)
    monkeypatch.setattr("orbits.elements.least_distance._minimized", None)
    assert not come_within(one, other, np.array([0.2, 0.1])).any()
    with pytest.raises(TypeError):
        come_within(one, other, np.array([0.24, 0.1]))  # (1.5 0.9 - 1.1) / 1.1 is 0.227
