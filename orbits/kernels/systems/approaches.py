"""The search for closest approaches among the star and the planets of eight systems at once.

As in `orbits.kernels.planet_approaches`, all pairs are sampled at equal intervals, those of the system that needs the
shortest. What is found is located in the steps of its system alone, and is the same.
"""

from __future__ import annotations

from orbits.kernels.approach_search import FRACTION, SLACK, estimate, is_near_or_fast
from orbits.kernels.compile import kernel
from orbits.kernels.encounters import DISTANCE2, DOMINANT, OTHER, note_rows
from orbits.kernels.interaction import STATE_ROWS, load_three, store_three
from orbits.kernels.lanes import WIDTH, any_lane, full, lane, load, maximum, minimum, select, sqrt, store
from orbits.kernels.observing import call_enter
from orbits.kernels.planet_approaches import MOST_APART
from orbits.kernels.systems.planets import CENTRE, MOST_PLANETS, ROWS, place_seen, show_in_lanes, store_places
from orbits.kernels.watch import no_particles, set_first, watch_at

PLACES = ROWS
SPEEDS = PLACES + 3 * MOST_PLANETS
LAST_PLACES = SPEEDS + 3 * MOST_PLANETS
LAST_SPEEDS = LAST_PLACES + 3 * MOST_PLANETS
OPENING = LAST_SPEEDS + 3 * MOST_PLANETS
KNOWN = OPENING + MOST_PLANETS * (MOST_PLANETS + 1) // 2
REACHES = KNOWN + 2 * MOST_PLANETS + 1
KEPT = REACHES + MOST_PLANETS + 1
KEPT_ROWS = 6 * (MOST_PLANETS + 1)
ALL_ROWS = KEPT + (MOST_APART + 1) * KEPT_ROWS
"""Rows after those of the march: places and velocities relative to the star at this sample and at the last one; half of
the change of the squared distance in a step then, of each planet from the star, then of each pair; the least squared
distances so far of each planet from the star, of each from the others, and of the star from the others; the reaches of
the planets and of the star; and for each step since the last sample, r' and its velocity, then of the centre of
mass."""


@kernel
def keep_in_lanes(rows, count, slot):
    """Keep the present state, for the case that it has to be shown."""
    first = KEPT + KEPT_ROWS * slot
    for i in range(count):
        for k in range(6):
            store(rows, first + 6 * i + k, load(rows, STATE_ROWS * i + k))
    for k in range(6):
        store(rows, first + 6 * MOST_PLANETS + k, load(rows, CENTRE + k))


@kernel
def _show_steps(rows, count, carries, path, width, steps, whose):
    """Write what is seen of some systems at the beginnings of `steps` steps since the last sample, and after them, into
    the first rows of their paths: they stay in the cache.
    """
    for step in range(steps + 1):
        first = KEPT + KEPT_ROWS * step
        show_in_lanes(rows, first, 6, first + 6 * MOST_PLANETS)
        for system in range(WIDTH):
            if lane(whose, system) != 0.0:
                place_seen(rows, count, carries[system], system, path[system], path[system], 2 * step * width, width)


@kernel
def begin_search(rows, count, h, contexts, carries, path, width):
    """Take the first sample of a block; return the number of steps from sample to sample."""
    first_of_all = False
    for system in range(WIDTH):
        if contexts[system] != 0 and watch_at(contexts[system]).first == 0:
            first_of_all = True
    if first_of_all:
        _show_steps(rows, count, carries, path, width, 0, full(1.0))
    for system in range(WIDTH):
        if contexts[system] != 0 and watch_at(contexts[system]).first == 0:
            note_rows(contexts[system], 0, count + 1)
    _take_known(rows, count, contexts, carries, full(1.0))
    store_places(rows, 0, STATE_ROWS, PLACES)
    store_places(rows, 3, STATE_ROWS, SPEEDS)
    shortest = full(1e300)
    mu = watch_at(contexts[0]).mu
    for system in range(1, WIDTH):
        mu = max(mu, watch_at(contexts[system]).mu) if contexts[system] != 0 else mu
    for i in range(count):
        x, y, z = load_three(rows, PLACES + 3 * i)
        u, v, w = load_three(rows, SPEEDS + 3 * i)
        cx, cy, cz = y * w - z * v, z * u - x * w, x * v - y * u
        swept2 = cx * cx + cy * cy + cz * cz
        parameter = swept2 / mu
        inverse_a = 2.0 / sqrt(x * x + y * y + z * z) - (u * u + v * v + w * w) / mu
        least = parameter / (1.0 + sqrt(maximum(1.0 - parameter * inverse_a, full(0.0))))
        shortest = minimum(shortest, least * least / sqrt(swept2))
    time = lane(shortest, 0)
    for system in range(1, WIDTH):
        time = min(time, lane(shortest, system))
    apart = FRACTION * time / abs(h)
    _take_openings(rows, count, h)
    return int(apart) if 1.0 <= apart < MOST_APART else 1 if not apart >= 1.0 else MOST_APART


@kernel(inline=True)
def _take_known(rows, count, contexts, carries, whose):
    """Write the least distances so far and the reaches of some systems."""
    for system in range(WIDTH):
        if lane(whose, system) == 0.0:
            continue
        if contexts[system] == 0:
            for k in range(KNOWN, KEPT):
                rows[k, system] = 0.0
        else:
            watch, planets = watch_at(contexts[system]), carries[system]
            record, reaches = watch.record, watch.reaches
            for i in range(count):
                body = int(planets[STATE_ROWS + 2, i])
                rows[KNOWN + i, system] = record[DISTANCE2, DOMINANT, body]
                rows[KNOWN + MOST_PLANETS + i, system] = record[DISTANCE2, OTHER, body]
                rows[REACHES + i, system] = reaches[body]
            rows[KNOWN + 2 * MOST_PLANETS, system] = record[DISTANCE2, OTHER, 0]
            rows[REACHES + MOST_PLANETS, system] = reaches[0]


@kernel(inline=True)
def _take_openings(rows, count, h):
    """Make the present sample the last one."""
    pair = OPENING + MOST_PLANETS
    for i in range(count):
        place, velocity = load_three(rows, PLACES + 3 * i), load_three(rows, SPEEDS + 3 * i)
        store_three(rows, LAST_PLACES + 3 * i, place)
        store_three(rows, LAST_SPEEDS + 3 * i, velocity)
        store(rows, OPENING + i, _opening(place, velocity, h))
        for j in range(i):
            there, then = load_three(rows, PLACES + 3 * j), load_three(rows, SPEEDS + 3 * j)
            store(rows, pair, _opening(_difference(there, place), _difference(then, velocity), h))
            pair += 1


@kernel(inline=True)
def _difference(a, b):
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel(inline=True)
def _opening(place, velocity, h):
    """Return half of the change of the squared distance in a step."""
    return (place[0] * velocity[0] + place[1] * velocity[1] + place[2] * velocity[2]) * h


@kernel
def search_in_lanes(rows, count, h, begin, end, contexts, carries, path, width):
    """Look for approaches between the last sample, at step `begin`, and the present state, at step `end`."""
    store_places(rows, 0, STATE_ROWS, PLACES)
    store_places(rows, 3, STATE_ROWS, SPEEDS)
    whose, pair = full(0.0), OPENING + MOST_PLANETS
    for i in range(count):
        place, velocity = load_three(rows, PLACES + 3 * i), load_three(rows, SPEEDS + 3 * i)
        met = (load(rows, OPENING + i) < 0.0) * (_opening(place, velocity, h) >= 0.0)
        if any_lane(met):
            met = met * _wanted_of_star(rows, h, end - begin, i, contexts)
            whose = maximum(whose, met)
        store(rows, OPENING + i, met)
        for j in range(i):
            there, then = load_three(rows, PLACES + 3 * j), load_three(rows, SPEEDS + 3 * j)
            now = _opening(_difference(there, place), _difference(then, velocity), h)
            met = (load(rows, pair) < 0.0) * (now >= 0.0)
            if any_lane(met):
                met = met * _wanted_of_pair(rows, h, end - begin, i, j, contexts)
                whose = maximum(whose, met)
            store(rows, pair, met)
            pair += 1
    if any_lane(whose):
        _show_steps(rows, count, carries, path, width, end - begin, whose)
        pair = OPENING + MOST_PLANETS
        for i in range(count):
            if any_lane(load(rows, OPENING + i)):
                _enter(contexts, carries, load(rows, OPENING + i), i, -1, begin, end, h)
            for j in range(i):
                if any_lane(load(rows, pair)):
                    _enter(contexts, carries, load(rows, pair), i, j, begin, end, h)
                pair += 1
        _take_known(rows, count, contexts, carries, whose)
    _take_openings(rows, count, h)


@kernel
def _wanted_of_star(rows, h, many, i, contexts):
    """Return in which systems planet i and the star may have come closer than before, or within their reach."""
    known = maximum(load(rows, KNOWN + i), load(rows, KNOWN + 2 * MOST_PLANETS))
    reach = maximum(load(rows, REACHES + i), load(rows, REACHES + MOST_PLANETS))
    first = load_three(rows, LAST_PLACES + 3 * i), load_three(rows, LAST_SPEEDS + 3 * i)
    second = load_three(rows, PLACES + 3 * i), load_three(rows, SPEEDS + 3 * i)
    watch = watch_at(contexts[0])
    # Above an angle of 1, what is recorded is the osculating pericentre.
    angle = min(watch.passage_angle, SLACK * min(watch.pericentre_angle, 1.0))
    return _wanted(angle, h, many, first, second, (known, reach))


@kernel
def _wanted_of_pair(rows, h, many, i, j, contexts):
    """The same of planets i and j."""
    known = maximum(load(rows, KNOWN + MOST_PLANETS + i), load(rows, KNOWN + MOST_PLANETS + j))
    reach = maximum(load(rows, REACHES + i), load(rows, REACHES + j))
    first = (
        _difference(load_three(rows, LAST_PLACES + 3 * j), load_three(rows, LAST_PLACES + 3 * i)),
        _difference(load_three(rows, LAST_SPEEDS + 3 * j), load_three(rows, LAST_SPEEDS + 3 * i)),
    )
    second = (
        _difference(load_three(rows, PLACES + 3 * j), load_three(rows, PLACES + 3 * i)),
        _difference(load_three(rows, SPEEDS + 3 * j), load_three(rows, SPEEDS + 3 * i)),
    )
    return _wanted(watch_at(contexts[0]).passage_angle, h, many, first, second, (known, reach))


@kernel(inline=True)
def _wanted(passage_angle, h, many, first, second, limits):
    (known, reach), before, now = limits, _opening(first[0], first[1], h), _opening(second[0], second[1], h)
    (x, y, z), _ = second
    # While it grows, the squared distance grows by at most 2 now in a step; 3, as its growth may not be steady.
    least = x * x + y * y + z * z - 3.0 * many * now
    if not any_lane(SLACK * least < maximum(known, reach * reach)):
        return full(0.0)
    d2 = estimate(h * many, before * many, now * many, (*first[0], *first[1]), (*second[0], *second[1]))
    near = is_near_or_fast(passage_angle, h, reach, d2, first[1], second[1])
    return select((SLACK * d2 < known) + near > 0.0, full(1.0), full(0.0))


@kernel
def _enter(contexts, carries, wanted, i, j, begin, end, h):
    """Record the approach of planets i and j, or of planet i and the star for j = -1, in the systems in which it is
    wanted.
    """
    for system in range(WIDTH):
        if contexts[system] != 0 and lane(wanted, system) != 0.0:
            planets = carries[system]
            body = int(planets[STATE_ROWS + 2, i])
            other = int(planets[STATE_ROWS, 6]) if j < 0 else int(planets[STATE_ROWS + 2, j])
            context, enter = contexts[system], watch_at(contexts[system]).enter
            first = watch_at(context).first
            set_first(context, first + begin)
            call_enter(enter, context, no_particles(), min(body, other), max(body, other), 0, end - begin, h)
            set_first(context, first)
