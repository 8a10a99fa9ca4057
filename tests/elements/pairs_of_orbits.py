"""Pairs of elliptic orbits of all kinds."""

from __future__ import annotations

from typing import Any

import numpy as np

from .guaranteed_search import Ellipses

TURN = 2.0 * np.pi


def ellipses(a: Any, e: Any, inc: Any = 0.0, Omega: Any = 0.0, omega: Any = 0.0) -> Ellipses:
    """Ellipses by their elements, each a number or an array."""
    a, e, inc, Omega, omega = (np.atleast_1d(x) for x in np.broadcast_arrays(a, e, inc, Omega, omega))
    node = np.stack([np.cos(Omega), np.sin(Omega), 0.0 * inc], axis=1)
    ahead = np.stack([-np.sin(Omega) * np.cos(inc), np.cos(Omega) * np.cos(inc), np.sin(inc)], axis=1)
    c, s = np.cos(omega)[:, None], np.sin(omega)[:, None]
    along, across = c * node + s * ahead, c * ahead - s * node
    return Ellipses(a[:, None] * along, (a * np.sqrt(1.0 - e**2))[:, None] * across, e.astype(float))


def any_pairs(kind: str, n: int) -> tuple[Ellipses, Ellipses]:
    """Random pairs of a kind."""
    rng = np.random.default_rng(sorted(KINDS).index(kind))
    shape = {
        "a": np.exp(rng.uniform(-1.0, 1.0, (2, n))),
        "e": rng.uniform(0.0, 0.99, (2, n)),
        "inc": np.arccos(rng.uniform(-1.0, 1.0, (2, n))),
        "Omega": rng.uniform(0.0, TURN, (2, n)),
        "omega": rng.uniform(0.0, TURN, (2, n)),
    }
    KINDS[kind](rng, shape, n)
    return ellipses(*(x[0] for x in shape.values())), ellipses(*(x[1] for x in shape.values()))


def like_planets(rng, x, n):
    x["a"], x["e"], x["inc"] = rng.uniform(0.9, 1.1, (2, n)), 0.1 * x["e"], 0.02 * x["inc"]


def nearly_the_same(rng, x, n):
    for each in x.values():
        each[1] = each[0] * (1.0 + 10.0 ** rng.uniform(-8, -2, n) * rng.normal(size=n))
    x["e"][1] = np.minimum(x["e"][1], 0.995)


def touching_from_within(rng, x, n):
    """With the apsides of one in those of the other, and a gap of 1e-9 of its size."""
    x["inc"] *= 0.0
    x["Omega"] *= 0.0
    x["omega"][1] = x["omega"][0]
    x["e"] *= 0.5
    x["a"][1] = x["a"][0] * (1.0 - x["e"][0]) / (1.0 - x["e"][1]) * (1.0 + 1e-9)


KINDS = {
    "any": lambda rng, x, n: None,
    "in one plane": lambda rng, x, n: x.update(inc=0.0 * x["inc"]),
    "like planets": like_planets,
    "of any sizes": lambda rng, x, n: x.update(a=np.exp(rng.uniform(-4.0, 4.0, (2, n)))),
    "thin": lambda rng, x, n: x.update(e=1.0 - 10.0 ** rng.uniform(-5, -1, (2, n))),
    "nearly the same": nearly_the_same,
    "touching from within": touching_from_within,
}
