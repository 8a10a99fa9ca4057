"""The cases of `bits.py`: what is computed, by theme.

`constant_steps` has every method on massive bodies, few and many, particles, Lagrangians, archives and encounters;
`tables` has clocks, events, collisions, maps, terms, forces, rigid bodies, an ephemeris, tangent vectors and lists of
systems, each row run in all the ways of `ways`: by threads, with other samples, killed and resumed. `systems` has the
bodies, and `facts` what is kept of a run.

Only the public API of the package is used, so that the cases run unchanged before and after a refactoring.
"""

from __future__ import annotations

from collections.abc import Iterator

from bits_cases import constant_steps, tables
from bits_cases.facts import Case


def cases() -> Iterator[Case]:
    """Yield all cases, those of a kind one after the other; the kind is the name up to the first slash."""
    yield from constant_steps.cases()
    yield from tables.cases()
