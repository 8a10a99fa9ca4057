"""The search for closest approaches among the star and the planets of eight systems at once.

As in `orbits.kernels.search.approaches_of_planets`, all pairs are sampled at equal intervals, those of the system that
needs the shortest. What is found is located in the steps of its system alone, and is the same.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, any_lane, full, lane, load, maximum, minimum, select, store
from orbits.kernels.maps.interaction import load_three, store_three
from orbits.kernels.search.approaches import FRACTION, SLACK, estimate, is_near_or_fast
from orbits.kernels.search.approaches_of_planets import MOST_APART, WANDERING, apsides_and_time, length2
from orbits.kernels.search.apsides import OPEN
from orbits.kernels.search.context import no_particles, set_first, watch_at
from orbits.kernels.search.observers import call_enter
from orbits.kernels.search.record import DISTANCE2, DOMINANT, OTHER, note_rows
from orbits.kernels.systems.interaction import store_places
from orbits.kernels.systems.planet_rows import CENTRE, PLANET, STATE, body_of, registers_of, rows_of_planets
from orbits.kernels.systems.planets import place_seen, show_in_lanes

MOST_SOUGHT = WIDTH
"""The most planets among which approaches are looked for here: with more, each march looks through its own states, at
the samples that it takes alone."""

KNOWN_STAR, REACH_STAR, STAR_ROWS = 0, 1, 2
PLACES, SPEEDS, LAST_PLACES, LAST_SPEEDS, OPENING, KNOWN, KNOWN_OTHER, REACH = 0, 3, 6, 9, 12, 13, 14, 15
NEAR, FAR, SOUGHT = 16, 17, 18
"""Rows after those of the march: the least squared distance so far of the star from the other planets, and its reach;
then `SOUGHT` rows of each planet: its place and velocity relative to the star at this sample and at the last one; half
of the change of the squared distance in a step then; the least squared distances so far from the star and from other
planets, and its reach; the squared distances from the star at which it has left its apsides. Then half of that change
of each pair; and for each step since the last sample, r' and its velocity of each planet, then those of the centre of
mass."""


def rows_of_search(count: int) -> int:
    """Return the rows for the march of `count` planets and the search among them, if they are not too many."""
    if count > MOST_SOUGHT:
        return rows_of_planets(count)
    filled = -(-count // WIDTH) * WIDTH
    return rows_of_planets(count) + STAR_ROWS + SOUGHT * filled + _pairs(count) + (MOST_APART + 1) * 6 * (filled + 1)


def _pairs(count):
    return count * (count - 1) // 2


_pairs_of = kernel(_pairs, inline=True)


@kernel(inline=True)
def _star(count):
    """Return the first row of the search."""
    return STATE + PLANET * WIDTH * registers_of(count)


@kernel(inline=True)
def _sought(count):
    """Return the first row of the first planet."""
    return _star(count) + STAR_ROWS


@kernel(inline=True)
def _first_pair(count):
    return _sought(count) + SOUGHT * WIDTH * registers_of(count)


@kernel(inline=True)
def _kept(count, slot):
    """Return the first row of a state that is kept."""
    return _first_pair(count) + _pairs_of(count) + 6 * (WIDTH * registers_of(count) + 1) * slot


@kernel(inline=True)
def _centre(count):
    """Return where the centre of mass is in a state that is kept."""
    return 6 * WIDTH * registers_of(count)


@kernel
def keep_in_lanes(rows, count, slot):
    """Keep the present state, for the case that it has to be shown."""
    first = _kept(count, slot)
    for i in range(count):
        for k in range(6):
            store(rows, first + 6 * i + k, load(rows, PLANET * i + STATE + k))
    for k in range(6):
        store(rows, first + _centre(count) + k, load(rows, CENTRE + k))


@kernel
def _take_back(rows, count, slot):
    """Make a state that was kept the present one; low parts stay."""
    first = _kept(count, slot)
    for i in range(count):
        for k in range(6):
            store(rows, PLANET * i + STATE + k, load(rows, first + 6 * i + k))


@kernel
def _show_steps(rows, count, carries, path, width, slot, steps, whose):
    """Write what is seen of some systems at the beginnings of `steps` steps, and after them, into the first rows of
    their paths: they stay in the cache. The first one is kept in `slot`.
    """
    for step in range(steps + 1):
        first = _kept(count, slot + step)
        show_in_lanes(rows, count, first, 6, first + _centre(count))
        for system in range(WIDTH):
            if lane(whose, system) != 0.0:
                place_seen(rows, count, carries[system], system, path[system], path[system], 2 * step * width, width)


@kernel
def _store_sample(rows, count):
    """Write places and velocities relative to the star."""
    store_places(rows, count, STATE, _sought(count) + PLACES, SOUGHT)
    store_places(rows, count, STATE + 3, _sought(count) + SPEEDS, SOUGHT)


@kernel
def _have_left(rows, count):
    """Return whether a planet is outside its apsides at the beginning of the block."""
    for i in range(count):
        planet = _sought(count) + SOUGHT * i
        x, y, z = load_three(rows, planet + PLACES)
        r2 = x * x + y * y + z * z
        if any_lane((r2 < load(rows, planet + NEAR)) + (r2 > load(rows, planet + FAR))):
            return True
    return False


@kernel(inline=True)
def _sample(rows, planet):
    """Return place and velocity at this sample; planet : its first row."""
    return load_three(rows, planet + PLACES), load_three(rows, planet + SPEEDS)


@kernel(inline=True)
def _last_sample(rows, planet):
    return load_three(rows, planet + LAST_PLACES), load_three(rows, planet + LAST_SPEEDS)


@kernel(inline=True)
def _of_pair(one, other):
    """Return place and velocity of another planet relative to one."""
    return _difference(other[0], one[0]), _difference(other[1], one[1])


@kernel
def begin_search(rows, count, h, contexts, carries, path, width):
    """Take the first sample of a block; return the number of steps from sample to sample."""
    first_of_all = False
    for system in range(WIDTH):
        if contexts[system] != 0 and watch_at(contexts[system]).first == 0:
            first_of_all = True
    if first_of_all:
        _show_steps(rows, count, carries, path, width, 0, 0, full(1.0))
    for system in range(WIDTH):
        if contexts[system] != 0 and watch_at(contexts[system]).first == 0:
            note_rows(contexts[system], 0, count + 1)
    _take_known(rows, count, contexts, carries, full(1.0))
    _store_sample(rows, count)
    shortest = full(1e300)
    mu = watch_at(contexts[0]).mu
    for system in range(1, WIDTH):
        mu = max(mu, watch_at(contexts[system]).mu) if contexts[system] != 0 else mu
    for i in range(count):
        planet = _sought(count) + SOUGHT * i
        lowest, highest, at_lowest = apsides_and_time(mu, *_sample(rows, planet))
        near, far = lowest / WANDERING, minimum(WANDERING * highest, full(OPEN))
        store(rows, planet + NEAR, near * near)
        store(rows, planet + FAR, far * far)
        shortest = minimum(shortest, at_lowest)
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
        first = _sought(count)
        if contexts[system] == 0:
            rows[_star(count) + KNOWN_STAR, system] = rows[_star(count) + REACH_STAR, system] = 0.0
            for i in range(count):
                for k in (KNOWN, KNOWN_OTHER, REACH):
                    rows[first + SOUGHT * i + k, system] = 0.0
        else:
            watch, planets = watch_at(contexts[system]), carries[system]
            record, reaches = watch.record, watch.reaches
            for i in range(count):
                body, planet = body_of(planets, count, i), first + SOUGHT * i
                rows[planet + KNOWN, system] = record[DISTANCE2, DOMINANT, body]
                rows[planet + KNOWN_OTHER, system] = record[DISTANCE2, OTHER, body]
                rows[planet + REACH, system] = reaches[body]
            rows[_star(count) + KNOWN_STAR, system] = record[DISTANCE2, OTHER, 0]
            rows[_star(count) + REACH_STAR, system] = reaches[0]


@kernel(inline=True)
def _take_openings(rows, count, h):
    """Make the present sample the last one."""
    pair = _first_pair(count)
    for i in range(count):
        planet = _sought(count) + SOUGHT * i
        place, velocity = _sample(rows, planet)
        store_three(rows, planet + LAST_PLACES, place)
        store_three(rows, planet + LAST_SPEEDS, velocity)
        store(rows, planet + OPENING, _opening((place, velocity), h))
        for j in range(i):
            there = _sample(rows, _sought(count) + SOUGHT * j)
            store(rows, pair, _opening(_of_pair((place, velocity), there), h))
            pair += 1


@kernel(inline=True)
def _difference(a, b):
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel(inline=True)
def _opening(sample, h):
    """Return half of the change of the squared distance in a step."""
    (x, y, z), (u, v, w) = sample
    return (x * u + y * v + z * w) * h


@kernel
def search_in_lanes(rows, count, h, begin, end, contexts, carries, path, width):
    """Look for approaches between the last sample, at step `begin`, and the present state, at step `end`; return
    whether each step has to be a sample from here on: planets have left their apsides, or may deflect each other.
    """
    _store_sample(rows, count)
    if end - begin == 1 or not _have_left(rows, count):
        return _look(rows, count, h, begin, 0, end - begin, contexts, carries, path, width)
    for slot in range(end - begin):
        _take_back(rows, count, slot + 1)
        _store_sample(rows, count)
        _look(rows, count, h, begin, slot, 1, contexts, carries, path, width)
    return True


@kernel
def _look(rows, count, h, begin, slot, many, contexts, carries, path, width):
    """Look for approaches between the last sample, which is kept in `slot`, and the present one, `many` steps later;
    return whether planets may come within their reach in as many steps again.

    begin : the step whose state is in the first slot
    """
    within = False
    whose, pair = full(0.0), _first_pair(count)
    for i in range(count):
        planet = _sought(count) + SOUGHT * i
        here = _sample(rows, planet)
        met = (load(rows, planet + OPENING) < 0.0) * (_opening(here, h) >= 0.0)
        if any_lane(met):
            met = met * _wanted_of_star(rows, h, many, _star(count), planet, contexts)
            whose = maximum(whose, met)
        store(rows, planet + OPENING, met)
        for j in range(i):
            other = _sought(count) + SOUGHT * j
            apart = _of_pair(here, _sample(rows, other))
            now, reach = _opening(apart, h), maximum(load(rows, planet + REACH), load(rows, other + REACH))
            draws_near = length2(apart[0]) + 3.0 * many * minimum(now, full(0.0)) < reach * reach
            within = within or any_lane(draws_near)
            met = (load(rows, pair) < 0.0) * (now >= 0.0)
            if any_lane(met):
                met = met * _wanted_of_pair(rows, h, many, planet, other, contexts)
                whose = maximum(whose, met)
            store(rows, pair, met)
            pair += 1
    if any_lane(whose):
        _show_steps(rows, count, carries, path, width, slot, many, whose)
        pair = _first_pair(count)
        for i in range(count):
            met = load(rows, _sought(count) + SOUGHT * i + OPENING)
            if any_lane(met):
                _enter(contexts, carries, count, met, i, -1, begin + slot, many, h)
            for j in range(i):
                if any_lane(load(rows, pair)):
                    _enter(contexts, carries, count, load(rows, pair), i, j, begin + slot, many, h)
                pair += 1
        _take_known(rows, count, contexts, carries, whose)
    _take_openings(rows, count, h)
    return within


@kernel
def _wanted_of_star(rows, h, many, star, planet, contexts):
    """Return in which systems a planet and the star may have come closer than before, or within their reach."""
    known = maximum(load(rows, planet + KNOWN), load(rows, star + KNOWN_STAR))
    reach = maximum(load(rows, planet + REACH), load(rows, star + REACH_STAR))
    watch = watch_at(contexts[0])
    # Above an angle of 1, what is recorded is the osculating pericentre.
    angle = min(watch.passage_angle, SLACK * min(watch.pericentre_angle, 1.0))
    return _wanted(angle, h, many, _last_sample(rows, planet), _sample(rows, planet), (known, reach))


@kernel
def _wanted_of_pair(rows, h, many, planet, other, contexts):
    """The same of two planets."""
    known = maximum(load(rows, planet + KNOWN_OTHER), load(rows, other + KNOWN_OTHER))
    reach = maximum(load(rows, planet + REACH), load(rows, other + REACH))
    first = _of_pair(_last_sample(rows, planet), _last_sample(rows, other))
    second = _of_pair(_sample(rows, planet), _sample(rows, other))
    return _wanted(watch_at(contexts[0]).passage_angle, h, many, first, second, (known, reach))


@kernel(inline=True)
def _wanted(passage_angle, h, many, first, second, limits):
    (known, reach), before, now = limits, _opening(first, h), _opening(second, h)
    (x, y, z), _ = second
    # While it grows, the squared distance grows by at most 2 now in a step; 3, as its growth may not be steady.
    least = x * x + y * y + z * z - 3.0 * many * now
    if not any_lane(SLACK * least < maximum(known, reach * reach)):
        return full(0.0)
    d2 = estimate(h * many, before * many, now * many, (*first[0], *first[1]), (*second[0], *second[1]))
    near = is_near_or_fast(passage_angle, h, reach, d2, first[1], second[1])
    return select((SLACK * d2 < known) + near > 0.0, full(1.0), full(0.0))


@kernel
def _enter(contexts, carries, count, wanted, i, j, begin, many, h):
    """Record the approach of planets i and j, or of planet i and the star for j = -1, in the `many` steps from `begin`
    on, in the systems in which it is wanted.
    """
    for system in range(WIDTH):
        if contexts[system] != 0 and lane(wanted, system) != 0.0:
            body, other = body_of(carries[system], count, i), body_of(carries[system], count, j)
            context, enter = contexts[system], watch_at(contexts[system]).enter
            first = watch_at(context).first
            set_first(context, first + begin)
            call_enter(enter, context, no_particles(), min(body, other), max(body, other), 0, many, h)
            set_first(context, first)
