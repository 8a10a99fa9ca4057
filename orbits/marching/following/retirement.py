"""Massless particles that cannot be stepped any further are retired alone; the bits of the others do not change."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError
from orbits.integrators.forms import Array, padded
from orbits.kernels.steps import (
    IMPACT,
    NEAR_A_PLANET,
    NOT_CONVERGED,
    NOT_FINITE,
    NOT_REGULAR,
    NOT_RESOLVED,
    OK,
    TOO_SHORT,
)
from orbits.marching.following.own_clocks import REACHED

HIT, EJECTED, TOO_CLOSE = 20, 21, 22
"""The status of a massless particle that has hit a body while it was followed, left the others, or come to an orbit too
close to the dominant one."""

REASONS = {
    NOT_CONVERGED: "the stages did not converge",
    NOT_FINITE: "the state is no longer finite",
    NOT_REGULAR: "its equations have no solution there",
    IMPACT: "it merged with a body that it hit",
    TOO_SHORT: "no step is short enough to go on",
    NEAR_A_PLANET: "it came within three Hill radii of a planet, or passed it too fast for the step",
    NOT_RESOLVED: "the step did not resolve its pericentre",
    HIT: "it hit {}",
    EJECTED: "it was ejected",
    TOO_CLOSE: "its pericentre is below the limit",
}


PER_BODY = 1000
"""The status of a particle that hit a body is `HIT` and this times the number of the body, from 1 on among the massive
ones; `HIT` alone in archives of earlier versions, which do not say which."""


def hit(body: int) -> int:
    """Return the status of a particle that hit the massive body of this number, from 0 on."""
    return HIT + PER_BODY * (1 + body)


def kind_of(status: Any) -> Any:
    """Return the status, a number or an array, without the number of a body."""
    return np.where(np.asarray(status) % PER_BODY == HIT, HIT, status)


def reason(status: int, names: Sequence[str]) -> str:
    """Return a status in words; names : of the massive bodies."""
    body = status // PER_BODY - 1
    return REASONS[int(kind_of(status))].format(names[body] if 0 <= body < len(names) else "a body")


class Lost(NamedTuple):
    """Particles that could not take the step after a number of steps of a block, and why."""

    steps: int
    particles: NDArray[np.intp]
    status: NDArray[np.int64]


def earlier(lost: Lost | None, others: Lost | None) -> Lost | None:
    """Return the particles that were lost first; of equal ones, for the reasons of the first argument."""
    if others is None or (lost is not None and lost.steps < others.steps):
        return lost
    if lost is None or others.steps < lost.steps:
        return others
    more = ~np.isin(others.particles, lost.particles)
    particles = np.concatenate([lost.particles, others.particles[more]])
    order = np.argsort(particles)
    status = np.concatenate([lost.status, others.status[more]])
    return Lost(lost.steps, particles[order], status[order])


class Retirement(NamedTuple):
    """A retired massless particle: its number, the number of steps before, the reading of the clock and the reason, and
    its last q and v, (3,) each.
    """

    body: int
    step: int
    reading: float
    reason: str
    q: Array
    v: Array


def retirements(
    table: NDArray[np.int64],
    q: Array,
    v: Array,
    particles: NDArray[np.intp],
    clocks: Array | None = None,
    parts: Array | None = None,
    names: Sequence[str] = (),
) -> list[Retirement]:
    """Return the retired particles of a table from a checkpoint.

    table : (m, 2), status and step; q, v : (3, padded); particles : (m,), their numbers among all bodies
    clocks : (m, columns), of particles with clocks of their own; see `orbits.marching.following.own_clocks`
    parts : (m,), the part of the next step that each has taken, among constant steps
    names : of the massive bodies, for those that hit one
    Raises InputError for an unknown status.
    """
    gone = (table[:, 0] != OK).nonzero()[0]
    if not gone.size:
        return []
    unknown = set(kind_of(table[gone, 0]).tolist()) - set(REASONS)
    if unknown:
        raise InputError(
            f"its checkpoint has retired particles with the reasons {sorted(unknown)}; known are {sorted(REASONS)}."
        )
    readings = table[:, 1] if clocks is None else clocks[:, REACHED]
    if parts is not None and parts[gone].any():
        readings = table[:, 1] + parts
    return [
        Retirement(
            int(particles[k]),
            int(table[k, 1]),
            readings[k].item(),
            reason(int(table[k, 0]), names),
            q[:, k].copy(),
            v[:, k].copy(),
        )
        for k in gone
    ]


class Retired:
    """The retired ones of m particles: why, and after how many steps of the march.

    block : (padded, 2) int64, read and written by kernels: status, and step of the block
    """

    def __init__(self, particles: int) -> None:
        self._known = np.zeros((padded(particles), 2), dtype=np.int64)
        self._count = particles
        self.block = self._known.copy()

    def begin(self, known: NDArray[np.int64] | None = None) -> None:
        """Prepare for a block: reset it to the particles retired before, or to those of an earlier table, (m, 2)."""
        self.block[...] = self._known
        if known is not None:
            self.block[: self._count] = known

    def lost(self) -> Lost | None:
        """Return the particles that were lost first in the block just marched, or None."""
        new = (self.block[: self._count, 0] != self._known[: self._count, 0]).nonzero()[0]
        if not new.size:
            return None
        first = int(self.block[new, 1].min())
        particles = new[self.block[new, 1] == first]
        return Lost(first, particles, self.block[particles, 0])

    def lost_or(self, others: Lost | None) -> Lost | None:
        """Return the particles that were lost first, in the block just marched or among `others`."""
        return earlier(self.lost(), others)

    def add(self, lost: Lost, step: int) -> None:
        """Retire particles after `step` steps of the march."""
        self._known[lost.particles, 0], self._known[lost.particles, 1] = lost.status, step
        self.begin()

    def return_to(self, step: int) -> None:
        """Take back the retirement of particles after more than `step` steps of the march."""
        self._known[self._known[:, 1] > step] = 0
        self.begin()

    def take_back(self, before: NDArray[np.int64], step: int) -> None:
        """Take back the retirement, since the table was `before`, (m, 2), of particles lost after `step` steps."""
        known = self.table()
        lost = (known != before).any(axis=1) & (known[:, 1] >= step)
        known[lost] = before[lost]
        self.begin()

    def take(self, other: Retired) -> None:
        """Retire, before the first step of this march, the particles retired in another march of as many particles."""
        self._known[:, 0] = other._known[:, 0]
        self.begin()

    def follow(self, other: Retired) -> None:
        """Take over the particles retired in another march of the same particles, which this one continues."""
        self._known[...] = other._known
        self.begin()

    def take_over(self, other: Retired, lost: NDArray[np.bool_], steps: NDArray[np.int64]) -> None:
        """Retire the particles `lost`, (m,) bool, for the reasons in another march, after as many steps of this one."""
        which = np.flatnonzero(lost)
        self._known[which, 0], self._known[which, 1] = other._known[which, 0], steps
        self.begin()

    @contextmanager
    def all_but(self, particle: int) -> Iterator[None]:
        """A context in which all other particles count as retired, so that a copy is marched with one alone."""
        known = self._known.copy()
        self._known[:, 0] = IMPACT
        self._known[particle] = known[particle]
        try:
            yield
        finally:
            self._known[...] = known
            self.begin()

    def gone(self) -> NDArray[np.bool_]:
        """Return a mask (m,) of the particles that are retired or were lost in the block just marched."""
        return np.asarray(self.block[: self._count, 0] != OK)

    def table(self) -> NDArray[np.int64]:
        """Return the status of each particle and the number of steps after which it was retired, (m, 2)."""
        return self._known[: self._count]

    def checkpoint(self) -> dict[str, NDArray[np.generic]]:
        """Return the table as an array of a fixed shape; {} if there are no particles."""
        return {"retired": self._known[: self._count].copy()} if self._count else {}

    def restore(self, retired: NDArray[np.generic] | None, steps: int) -> None:
        """Restore a checkpoint; those of earlier versions have no retired particles. Raises InputError if it is
        invalid: of more than `steps` steps, unless it is known, from the legs before this one.
        """
        before = self.table().copy()
        self._known[:] = 0
        if retired is not None:
            if retired.shape != (self._count, 2):
                raise InputError(f"the retired particles in its checkpoint are {retired.shape}, not {self._count, 2}.")
            status, step = np.asarray(retired)[:, 0], np.asarray(retired)[:, 1]
            taken = (step <= steps) | (retired == before).all(axis=1)
            if not (np.isin(kind_of(status), [OK, *REASONS]).all() and (step >= 0).all() and taken.all()):
                raise InputError("the retired particles in its checkpoint have impossible reasons or steps.")
            self._known[: self._count] = retired
        self.begin()
