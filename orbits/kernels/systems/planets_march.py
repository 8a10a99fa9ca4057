"""The march of Wisdom–Holman maps of eight systems, with the search for closest approaches on the way."""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH
from orbits.kernels.systems.approaches import begin_search, keep_in_lanes, search_in_lanes
from orbits.kernels.systems.planet_rows import CENTRE, PLANET, STATE, gather_planets, scatter_planets
from orbits.kernels.systems.planets import kick_in_lanes, place_seen, show_in_lanes, step_in_lanes


@kernel
def march_planets(coefficients, strengths, q, q_lo, v, v_lo, carries, room, rows, path, contexts, steps):
    """March eight systems of planets by `steps` steps; return the evaluations of each.

    coefficients : of `KeplerSplitting`; strengths, carries, room : see `gather_planets`; rows : workspace
    q, v : (8, padded), receive what is seen at the end; their low parts are not used
    path : (8, length), receives q and v of each system, each padded, at the beginning of each step
    contexts : (8,) int64, the contexts of observers that look for closest approaches, see
        `orbits.kernels.search.context`; only states that they look at are then recorded. 0 for a lane that is left, and
        all 0 if all states are recorded
    """
    count = strengths.shape[1] - 2
    h, shift, lazy = coefficients[0, 1], coefficients[0, 2], coefficients[0, 3] != 0.0
    gather_planets(strengths, carries, room, rows)
    kick_in_lanes(rows, count, shift, lazy)
    width = q.shape[1]
    if contexts[0] == 0:
        for k in range(steps):
            show_in_lanes(rows, count, STATE, PLANET, CENTRE)
            for system in range(WIDTH):
                place_seen(rows, count, carries[system], system, path[system], path[system], 2 * k * width, width)
            step_in_lanes(rows, count, h, shift, lazy)
    else:
        keep_in_lanes(rows, count, 0)
        apart, last = begin_search(rows, count, h, contexts, carries, path, width), 0
        for k in range(1, steps + 1):
            step_in_lanes(rows, count, h, shift, lazy)
            keep_in_lanes(rows, count, k - last)
            if k - last == apart or k == steps:
                if search_in_lanes(rows, count, h, last, k, contexts, carries, path, width):
                    apart = 1
                keep_in_lanes(rows, count, 0)
                last = k
    show_in_lanes(rows, count, STATE, PLANET, CENTRE)
    for system in range(WIDTH):
        place_seen(rows, count, carries[system], system, q[system], v[system], 0, 0)
    scatter_planets(rows, count, carries)
    return steps
