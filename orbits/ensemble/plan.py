"""The plan of a campaign: an ensemble, and how it is integrated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from astropy import units as u
from astropy.time import Time

from orbits import integrators
from orbits.archive.storage import free_bytes, human
from orbits.checks import checked_flag, whole_number
from orbits.elsewhere import unknown_argument
from orbits.ensemble.members import Ensemble, digest
from orbits.ensemble.tasks import Task
from orbits.errors import InputError, StorageError, UnknownNameError, shown
from orbits.integrators.base import Integrator
from orbits.propagation import propagate
from orbits.propagation.checks.rigid_runs import default_method
from orbits.propagation.events.functions import in_full
from orbits.system import System
from orbits.time_grid import TimeGrid
from orbits.time_grid.step_length import FRACTION

WORK = 3e7
"""The particle steps of a block by default: two seconds in a Wisdom–Holman map, beside which the 0.05 s that a block
costs are a few per cent (docs/benchmarks.md)."""

LEAST, MOST = 64, 16384
"""The fewest and the most particles of a block by default."""

WORK_OF_SYSTEMS, MOST_SYSTEMS = 1e7, 64
"""The steps of the systems of a block by default, and the most systems."""

SHARES = 16
"""The least number of blocks by default, if there are enough members, so that several workers are busy to the end."""

ROOM = 1 << 28
"""The most bytes of the samples of a block by default."""

OF_A_STATE, OF_A_BODY, OF_AN_ARCHIVE = 48, 2000, 200_000
"""About how many bytes an archive takes for a body at a sample, for a body beside that, and for itself."""

SHOWN = 8
"""The most values of an option that messages show; of more they show a hash."""

OPTIONS = "dt", "duration", "until", "samples", "events", "stop", "check_step", "approaches"
"""The options of `propagate` that a campaign takes."""


@dataclass(frozen=True, eq=False, init=False)
class Plan:
    """An ensemble and how it is integrated, for `orbits.ensemble.run(plan, folder)`, and for `orbits ensemble FILE`
    where a file defines `plan`.

        plan = orbits.ensemble.Plan(belt, duration="1 Myr", dt="8 d", integrator="wisdom-holman")

    integrator : as in `orbits.propagate`
    dt, duration, until, samples, events, stop, check_step : as in `orbits.propagate`; two samples by default, the start
        and the end. An event that names a massless member is sought in its block
    approaches : as in `orbits.propagate`, but True by default, for the columns of the table that tell the closest
        approach of each member. Particles of a map take some 5 % more time for it; False leaves these columns out
    megno : True for MEGNO of each member, or a dict of options of `orbits.megno`: vectors, seed, coupled
    trajectories : whether the samples of each member are kept, or the table alone
    block : members that are integrated together; by default as many as make the overhead of a block small

    Raises InputError for options that `propagate` does not take, and UnknownNameError for other arguments.
    """

    ensemble: Ensemble
    integrator: Integrator
    megno: bool | dict[str, Any] = False
    trajectories: bool = True
    block: int | None = None
    options: Mapping[str, Any] = field(default_factory=dict)

    def __init__(
        self,
        ensemble: Ensemble,
        *,
        integrator: Integrator | str | None = None,
        megno: bool | dict[str, Any] = False,
        trajectories: bool = True,
        block: int | None = None,
        **options: Any,
    ) -> None:
        if not isinstance(ensemble, Ensemble):
            raise InputError(
                f"the ensemble is {shown(ensemble)}; expected one from orbits.ensemble.particles, clones, grid or "
                "systems."
            )
        for name in options:
            if name not in OPTIONS:
                raise unknown_argument(propagate, name) if name not in ("archive",) else UnknownNameError(
                    "a campaign has an archive for each block in its folder; expected no archive=..."
                )
        if not isinstance(megno, bool | dict):
            raise InputError(f"megno is {shown(megno)}; expected True, False or a dict such as {{'vectors': 4}}.")
        method = default_method(ensemble.sample().system()) if integrator is None else integrators.named(integrator)
        for name, value in (
            ("ensemble", ensemble),
            ("integrator", method),
            ("megno", megno),
            ("trajectories", checked_flag(trajectories, "trajectories")),
            ("block", None if block is None else whole_number(block, "block")),
            ("options", {"samples": 2, "approaches": True, **options}),
        ):
            object.__setattr__(self, name, value)

    def changed(self, **options: Any) -> Plan:
        """Return this plan with some options changed; None leaves one as it is. A duration takes the place of until,
        and until that of a duration.
        """
        own = {name: getattr(self, name) for name in ("integrator", "megno", "trajectories", "block")}
        now, given = own | dict(self.options), {name: value for name, value in options.items() if value is not None}
        if {"duration", "until"} & set(given):
            now = {name: value for name, value in now.items() if name not in ("duration", "until")}
        return Plan(self.ensemble, **{**now, **given})

    @cached_property
    def dt(self) -> Any:
        """The step as blocks are given it: a fraction of the shortest period is that of all massless members."""
        dt = self.options.get("dt")
        if self.ensemble.massless and isinstance(dt, str) and FRACTION.fullmatch(dt):
            return self._grid(self.ensemble.system(), dt).dt
        return dt

    def grid(self, system: System) -> TimeGrid:
        """Return the steps and samples of a system."""
        return self._grid(system, self.dt)

    def _grid(self, system: System, dt: Any) -> TimeGrid:
        known = {name: self.options[name] for name in ("duration", "until", "samples") if name in self.options}
        return TimeGrid.of(system, dt, **known)

    def first(self) -> System:
        """Return the system of the first block, or of the first member."""
        return self.ensemble.sample().system()

    def block_size(self, grid: TimeGrid, massive: int) -> int:
        """Return the members of a block: given, or by the work and the memory of a block.

        No time is measured here, so that the same campaign has the same blocks everywhere.
        """
        members = len(self.ensemble)
        if self.block is not None:
            return min(self.block, members)
        particles = self.ensemble.kind == "particles"
        steps = abs(grid.end / grid.h) if grid.h == grid.h else 1e4
        work, least, most = (WORK, LEAST, MOST) if particles else (WORK_OF_SYSTEMS, 8, MOST_SYSTEMS)
        size = min(max(work / max(steps, 1.0), least), most)
        of_a_member = len(grid) * OF_A_STATE * (1 if particles else massive)
        if self.trajectories:
            size = min(size, ROOM / of_a_member)
        size = min(size, members / SHARES)
        unit = 16 if particles else 8
        return min(max(unit, int(size) // unit * unit), members)

    def identity(self) -> dict[str, str]:
        """Return what the results depend on, by its name in messages."""
        megno = "no" if self.megno is False else "yes" if self.megno is True else repr(dict(sorted(self.megno.items())))
        own = {name: _described(self.options[name]) for name in OPTIONS if name in self.options}
        if self.options["approaches"] is True:  # as in campaigns that were begun before they could do without
            own.pop("approaches")
        return {
            **self.ensemble.identity(),
            "integrator": repr(integrators.describe(self.integrator)),
            **own,
            "megno": megno,
            "trajectories": "kept" if self.trajectories else "not kept",
        }

    @cached_property
    def _of_members(self) -> dict[str, list[tuple[Any, dict[str, int]]]]:
        """The events and conditions of options that name massless members, each with the numbers of these by name."""
        found = {}
        for option in ("events", "stop"):
            given = self.options.get(option, ())
            each = given if isinstance(given, list | tuple) else [given]
            sought = [(one, self.ensemble.numbers(getattr(one, "bodies_named", ()))) for one in each]
            if any(members for _, members in sought):
                found[option] = sought
        return found

    def check_events(self, block: int) -> None:
        """Raise InputError for an event of members that are in different blocks of this size."""
        for one, members in (row for sought in self._of_members.values() for row in sought):
            if len({number // block for number in members.values()}) > 1:
                raise InputError(
                    f"{type(one).__name__} of {' and '.join(map(repr, members))}: these are in different blocks of "
                    f"{block:,} members, which are integrated apart; expected members of one block, as with "
                    f"block={max(members.values()) + 1}."
                )

    def bytes_needed(self, grid: TimeGrid, massive: int, block: int) -> int:
        """Return about how many bytes the whole store takes."""
        members = len(self.ensemble)
        table = 200 * members
        if not self.trajectories:
            return table
        of_a_body = len(grid) * OF_A_STATE + OF_A_BODY
        if self.ensemble.kind != "particles":
            return members * (massive * of_a_body + OF_AN_ARCHIVE) + table
        blocks = -(-members // block)
        return (members + blocks * massive) * of_a_body + blocks * OF_AN_ARCHIVE + table

    def check_disk(self, folder: Any, needed: int, done: float) -> None:
        """Raise StorageError if the rest of the store needs more than is free, `done` of it being there already."""
        place = folder
        while not place.exists():
            place = place.parent
        free, left = free_bytes(place), int(needed * (1.0 - done))
        if left > free:
            raise StorageError(
                f"the campaign would need about {human(left)} in {folder}, but {human(free)} are free there. Take "
                "fewer samples or members, keep the table alone (trajectories=False), or choose another disk."
            )

    def task(self, block: int, part: Ensemble, **known: Any) -> Task:
        """Return a block as it is sent to a worker: without the events of members of other blocks."""
        here, options = set(part.names), {**self.options, "dt": self.dt}
        for option, sought in self._of_members.items():
            options[option] = [one for one, members in sought if here.issuperset(members)]
        megno = None if self.megno is False else {} if self.megno is True else dict(self.megno)
        return Task(
            number=block,
            part=part,
            integrator=self.integrator,
            options=options,
            megno=megno,
            trajectories=self.trajectories,
            **known,
        )


def _described(value: Any) -> str:
    """Return an option as a text that is the same in each process, and for a list as for an array of the same."""
    if isinstance(value, Time):
        count, text = value.size, f"{np.asarray(value.jd1).tolist()} + {np.asarray(value.jd2).tolist()} {value.scale}"
    elif isinstance(value, list | tuple) or (hasattr(value, "__array__") and not isinstance(value, str)):
        count, text = _listed(value)
    else:
        count, text = 1, in_full(value)
    return text if count <= SHOWN else f"{count} values, {digest(text)}"


def _listed(values: Any) -> tuple[int, str]:
    """Return the length of a list or an array, and its text: numbers with their unit, or one item after the other."""
    try:
        numbers = u.Quantity(values)
    except (TypeError, ValueError):  # not of numbers, or not of one kind of unit
        items = values if isinstance(values, list | tuple) else np.ravel(values).tolist()
        return len(items), ", ".join(map(_described, items))
    return numbers.size, f"{numbers.value.tolist()} {numbers.unit}".rstrip()
