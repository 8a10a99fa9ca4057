"""Six runs in all the ways that must not change a bit: by threads, with other samples, killed and resumed.

`scripts/bits.py` has 2,800 of them, and compares them with those of an earlier commit.
"""

import itertools
from pathlib import Path

import pytest

import orbits
from orbits.events import Collision, Merge

from .coverings import keep
from .problems import three_bodies

SCRIPTS = Path(__file__).parents[1] / "scripts"
RUNS = {
    "Gauss": (orbits.Gauss(stages=4), 0.125),
    "steps chosen one by one": (orbits.Gauss(stages=8), None),
    "kicks and drifts": (orbits.StormerVerlet(), 0.0625),
    "map": (orbits.WisdomHolman(), 0.125),
    "particles that leave the map": (orbits.WisdomHolman(encounters="follow"), 0.125),
    "bodies that merge": (orbits.Gauss(stages=8), None),
}


PLAIN = ("Gauss", "kicks and drifts", "map")
"""Runs that many tests interrupt and resume: here they are killed nightly."""
WAYS = keep(lambda k, case: case[1] == (case[0] not in PLAIN), itertools.product(RUNS, [False, True]))


@pytest.mark.parametrize(("name", "killed"), WAYS)
def test_nothing_that_may_not_change_a_bit_changes_one(name, killed, monkeypatch):
    monkeypatch.syspath_prepend(str(SCRIPTS))
    from bits_cases.ways import BROKEN, SAME, in_all_ways

    method, dt = RUNS[name]
    gm, q, v = three_bodies(3)
    radii = [1e-3, 1e-3, 1e-3, 0.0, 0.0, 0.0]
    events = []
    if name == "bodies that merge":
        v[1] = v[0]  # the inner planet falls into the star
        events = [Collision(then=Merge())]
    system = orbits.System([*"abcpqr"], gm, q, v, radii=radii, units=orbits.DIMENSIONLESS)
    # Figures of closest approaches depend on samples in the last bits: they are refined from what blocks kept.
    facts = in_all_ways(system, method, duration=10.0, killed=killed, dt=dt, events=events, approaches=False)
    said = {way: words for way, words in facts.items() if isinstance(words, str)}
    assert not [f"{way}: {words}" for way, words in said.items() if words.startswith(BROKEN)]
    assert list(said.values()).count(SAME) >= (7 if killed else 3)
