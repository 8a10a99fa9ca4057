"""Which steps of a map on Kepler orbits lead planets through passages that it cannot follow, and where it can again.

The rule is that for massless particles (`orbits.kernels.search.encounters_of_particles`), for each pair of planets,
with the Hill radius of both masses at the distance of one of them; and for the pericentre of each.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import full, lane
from orbits.kernels.search.encounters_of_particles import (
    EARLY,
    FASTEST2,
    HILL2,
    LEAST2,
    MOST2,
    WAYS2,
    Rules,
    Seen,
    falls,
    may_return,
    measure_bodies,
    meets,
)


@kernel(inline=True)
def _planet(rules, k, i):
    """Return planet i at the beginning of step k, in all lanes."""
    path, n, a = rules.path, rules.near.shape[1], 2 * k * rules.stride + i
    b = a + rules.stride
    return Seen(
        full(path[a]), full(path[a + n]), full(path[a + 2 * n]),
        full(path[b]), full(path[b + n]), full(path[b + 2 * n]),
    )  # fmt: skip


@kernel
def _may_meet(rules, i, j):
    """Return whether two planets may come too close to each other in a block, as those do not whose distances from the
    dominant body are too different.
    """
    hill2, ways2, extent = rules.near[HILL2, j], rules.near[WAYS2, j], rules.extent
    gap = max(extent[LEAST2, i] ** 0.5 - extent[MOST2, j] ** 0.5, extent[LEAST2, j] ** 0.5 - extent[MOST2, i] ** 0.5)
    way = abs(rules.h) * (extent[FASTEST2, i] ** 0.5 + extent[FASTEST2, j] ** 0.5)
    return gap < 1.001 * ((1.0 + ways2**0.5) * way + (hill2 * extent[MOST2, j]) ** 0.5)


@kernel
def first_encounter(path, stride, near, extent, limits, h, steps, who):
    """Return the first step of a block that the map cannot follow; `steps` if there is none.

    path : flat, the states at the beginning of each step and at the end, each vector padded to `stride`
    near : (n, 2, n), `Rules.near` of each planet, with zeros for planets up to itself and for the dominant body
    extent : (3, n), workspace; limits : (3,), the number of the dominant body, its GM, and the bound of h v / r
    who : (2,) int64, receives the numbers of the bodies that pass each other
    """
    dominant = int(limits[0])
    first = steps
    measure_bodies(Rules(near[0], extent, path, stride, dominant, limits[1], h, limits[2]), steps)
    for i in range(near.shape[0]):
        if i == dominant:
            continue
        rules = Rules(near[i], extent, path, stride, dominant, limits[1], h, limits[2])
        bound = EARLY * limits[2]
        if h * h * extent[FASTEST2, i] > 0.999 * bound * bound * extent[LEAST2, i]:
            for k in range(min(first + 1, steps) + 1):
                if lane(falls(rules, k, _planet(rules, k, i), 1.0), 0) != 0.0 and max(k - 1, 0) < first:
                    first, who[0], who[1] = max(k - 1, 0), i, dominant
        for j in range(i + 1, near.shape[0]):
            if j == dominant or not _may_meet(rules, i, j):
                continue
            for k in range(min(first, steps) + 1):
                seen = _planet(rules, k, i)
                if k > 0 and k - 1 < first and lane(meets(rules, k, j, seen, -1.0, 1.0), 0) != 0.0:
                    first, who[0], who[1] = k - 1, i, j
                if k < first and lane(meets(rules, k, j, seen, 1.0, 1.0), 0) != 0.0:
                    first, who[0], who[1] = k, i, j
    return first


@kernel
def first_clear(path, stride, near, extent, limits, h, steps):
    """Return the first of the states after each of some steps, counted from 1, from which on the map can follow the
    planets; `steps` + 1 if there is none. The arguments are those of `first_encounter`; h : of the map.
    """
    for k in range(1, steps + 1):
        clear = True
        for i in range(near.shape[0]):
            rules = Rules(near[i], extent, path, stride, int(limits[0]), limits[1], h, limits[2])
            if clear and i != int(limits[0]):
                clear = may_return(rules, k, _planet(rules, k, i), 0)
        if clear:
            return k
    return steps + 1
