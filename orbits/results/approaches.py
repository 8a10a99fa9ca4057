"""The closest approaches of a run, with names, units, dates, and the effect of each on the run."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property
from itertools import islice
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.body_names import chosen, index_of
from orbits.checks import is_one_of, place_in, positive_number
from orbits.errors import InputError, shown
from orbits.export import MOST_ROWS, Tabled, headed
from orbits.results.approach import LUNAR_DISTANCE, Approach, said, unit_of_errors
from orbits.system.presenting import attributes
from orbits.units import date_text, written

if TYPE_CHECKING:
    from astropy.table import QTable

    from orbits.marching.clocks.clock import Clock
    from orbits.results.passages import Passage, Seen
    from orbits.system import System

Array = NDArray[np.float64]

AT_ONCE = 64
"""The most massless bodies that are marched along to their passages: the march stops at each for all of them."""


TURNING = 1e-9
"""The cosine of the angle between distance and velocity below which a position at the start is a minimum."""


class Approaches(Tabled):
    """The closest approaches of a run: all flybys within the reach of a body, and the closest approach of each body.

    names : of the bodies; distance, time, speed : (bodies, 2) with units; distances are infinite if there was none
    partner : (bodies, 2) indices; column 0 is for the dominant body (unused if no body has 90 % of the mass), column 1
        for the closest other body. Massless particles are recorded within three Hill radii of a planet (or 5 % of its
        distance), and the closest passage is the one at the smallest fraction of that. The approach in which a particle
        was retired is not included: see `run.retired`
    left_out : number of further passages that are not listed; the listed ones have the largest speed / distance

    The list has every flyby within `reach` of a body, every passage that is fast for the step (except pericentres of
    mildly eccentric orbits), and the closest approach of each body. For a satellite it has only the closest
    pericentre and those that are fast for the step, and for a massless particle that a map follows through
    encounters only the closest of the flybys on its own steps. Distances and times are as accurate as the orbit:
    they come from partial steps of the method, taken when they are first needed. Where the motion cannot be
    computed again, they are as recorded on the way, from the two-body orbit within the step (to about 1e-3):
    `estimated` says so.

    With a covariance of a body, its passages have `distance_sigma` and `time_sigma`, and the table these columns.

    approaches["Ceres"] returns the passages of one body, closest first, and last the one by the dominant body.
    Iteration, `len`, `to_table`, print and notebooks cover all passages, closest first, except those by the dominant
    body on orbits about it (a visitor on a hyperbola is there) and positions at the start, from which bodies only part.
    """

    def __init__(
        self,
        system: System,
        clock: Clock,
        seen: Seen,
        *,
        refine: Callable[[Iterable[int]], None],
        error_at_end: Callable[[int], float | None],
        sigmas: Callable[[Sequence[Passage]], list[tuple[float, float | None] | None]] | None = None,
    ) -> None:
        self.names = system.names
        self._system, self._clock, self._seen = system, clock, seen
        self._refine, self._error_at_end = refine, error_at_end
        self._asked = 1
        self._sigmas: Callable[[Sequence[Passage]], list[tuple[float, float | None] | None]] | None = sigmas
        self._spread: dict[int, tuple[float, float | None] | None] = {}

    @property
    def distance(self) -> u.Quantity:
        """Distances, (bodies, 2)."""
        return u.Quantity(self._of_closest("distance", math.inf), self._system.units.length)

    @property
    def time(self) -> u.Quantity:
        """Times since the epoch, (bodies, 2); 0 where there was no approach."""
        steps = self._of_closest("steps", 0.0)
        return u.Quantity(self._clock.time(steps), self._system.units.time)

    @property
    def speed(self) -> u.Quantity:
        """Relative speeds, (bodies, 2); 0 where there was no approach."""
        return u.Quantity(self._of_closest("speed", 0.0), self._system.units.speed)

    @property
    def estimated(self) -> NDArray[np.bool_]:
        """Which of these are estimates, (bodies, 2), as the motion there could not be computed again."""
        closest = self._seen.closest
        self._refine(sorted(set(closest[closest >= 0].tolist())))
        return np.isin(closest, sorted(self._seen.estimated))

    @property
    def partner(self) -> NDArray[np.intp]:
        """Indices of the other bodies, (bodies, 2); 0 where there was no approach."""
        passages, out = self._seen.passages, np.zeros(self._seen.closest.shape, dtype=np.intp)
        for (body, column), k in np.ndenumerate(self._seen.closest):
            if k >= 0:
                pair = passages[k].body, passages[k].other
                out[body, column] = pair[0] if pair[1] == body else pair[1]
        return out

    @property
    def reach(self) -> u.Quantity:
        """The distance from each body within which all flybys are listed, (bodies,).

        It is three Hill radii, or 5 % of the body's initial distance from the dominant body if that is larger; 0 for
        the dominant body, for massless bodies, and if no body dominates.
        """
        return u.Quantity(self._seen.reach, self._system.units.length)

    @property
    def left_out(self) -> int:
        """Number of passages that are not listed; -1 for a run of an earlier version, which listed only the closest."""
        return self._seen.left_out

    def __getitem__(self, name: str) -> Sequence[Approach]:
        """Return the passages of a body, closest first, then the closest one by the dominant body.

        That by the dominant body is refined when it is asked for: it may need the body to be marched again.
        """
        row = index_of(name, self.names, "body")
        dominant = [int(k) for k in self._seen.closest[row, :1] if k >= 0]
        return Rows(self, name, [k for k in self._of_body.get(row, ()) if k not in dominant], dominant)

    def _ipython_key_completions_(self) -> list[str]:
        return list(self.names)

    def __len__(self) -> int:
        """Return the number of passages in the iteration."""
        return len(self._listed)

    def __iter__(self) -> Iterator[Approach]:
        """Yield the passages except those of orbits about the dominant body, closest first."""
        return (self.several([k])[0] for k in self._flybys)

    def as_recorded(self) -> Iterator[Approach]:
        """Yield the same passages as they were recorded on the way, closest first, to about 1e-3 of the distance: at
        once, where to march many bodies again would take as long as the run. Those refined before are as refined.
        """
        seen = self._seen
        for k in sorted(self._listed, key=lambda k: (seen.passages[k].distance, seen.passages[k].steps)):
            estimated = k in seen.estimated or k not in seen.refined
            yield Approach.of(self._system, self._clock, seen.passages[k], None, estimated)

    def to_table(self, bodies: Sequence[str] | None = None, *, within: Any = None, order: str = "distance") -> QTable:
        """Return an astropy QTable of the passages, closest first.

            run.closest_approaches().to_table("Earth", within=0.05 * u.au, order="time")  # as the tables of JPL's CNEOS

        The columns are body (the lighter one), other, date (TDB, if there is an epoch), time (since the epoch),
        distance, lunar_distances (the same in units of 384,400 km, if there are units), speed, v_infinity (without the
        attraction of the two; NaN if they are bound to each other), and error (the position error at the end of the run
        that the passage causes); distance_sigma and time_sigma with a covariance; then estimated, if some are. The meta
        has the epoch (TDB) and further information.

        bodies : names; only passages of these, all by default. Unknown names raise UnknownNameError.
        within : only passages at most at this distance; order : "distance" or "time"
        Raises InputError for a distance that is none, and another order.
        """
        from astropy.table import QTable

        if not is_one_of(order, ("distance", "time")):
            raise InputError(f"order is {shown(order)}; expected 'distance' or 'time'.")
        wanted = np.zeros(len(self.names), dtype=bool)
        wanted[chosen(self.names, bodies)] = True
        passages, units = self._seen.passages, self._system.units
        most = math.inf
        if within is not None:
            most = positive_number(units.length_value(within, "within"), "within", within)
        rows = [k for k in self._flybys if wanted[passages[k].body] or wanted[passages[k].other]]
        rows = [k for k in rows if passages[k].distance <= most]
        ones = self.several(rows)
        if order == "time":
            ones.sort(key=lambda one: one.time)
        kinds = {"distance": units.length, "time": units.time, "speed": units.speed, "v_infinity": units.speed}
        kinds["error"] = unit_of_errors(self._system)
        if self._sigmas is not None:
            kinds |= {"distance_sigma": units.length, "time_sigma": units.time}
        columns: dict[str, object] = {
            "body": np.array([one.body for one in ones], dtype=str),
            "other": np.array([one.other for one in ones], dtype=str),
        }
        figures = {
            key: u.Quantity([np.nan if one is None else one.value for one in (getattr(a, key) for a in ones)], unit)
            for key, unit in kinds.items()
        }
        if self._system.epoch is not None:
            columns["date"] = written(self._system.epoch + figures["time"])
        if units.is_physical:
            columns |= {"distance": figures.pop("distance")}
            columns["lunar_distances"] = (columns["distance"] / LUNAR_DISTANCE).to(u.one)
        columns |= figures
        if any(one.estimated for one in ones):
            columns["estimated"] = np.array([one.estimated for one in ones])
        return QTable(columns, meta=attributes(self._system))

    @cached_property
    def _listed(self) -> list[int]:
        """Indices of the passages in the iteration: without positions at the start, from which bodies only part."""
        return [k for k in self._seen.flybys if not self._parts(self._seen.passages[k])]

    def _parts(self, passage: Passage) -> bool:
        """Return whether a passage is a position at the start, and no minimum of the distance."""
        if passage.steps != 0.0:
            return False
        _, q, v, _ = self._system.values
        apart, speed = (x[passage.body] - x[passage.other] for x in (q, v))
        size = float(np.linalg.norm(apart) * np.linalg.norm(speed))
        return bool(apart @ speed * self._clock.direction > TURNING * size)

    @cached_property
    def _flybys(self) -> list[int]:
        """Indices of the passages in the iteration, in order."""
        listed = set(self._listed)
        return [k for k in self._all_flybys if k in listed]

    @cached_property
    def _all_flybys(self) -> list[int]:
        """The same with positions at the start."""
        self._refine(self._seen.flybys)
        passages = self._seen.passages
        return sorted(self._seen.flybys, key=lambda k: (passages[k].distance, passages[k].steps))

    @cached_property
    def _of_body(self) -> dict[int, list[int]]:
        """Indices of the passages of each body, in order, also at the start."""
        found: dict[int, list[int]] = {}
        for k in self._all_flybys:
            for body in (self._seen.passages[k].body, self._seen.passages[k].other):
                found.setdefault(body, []).append(k)
        return found

    def know_all(self) -> None:
        """Refine all passages to the accuracy of the orbit."""
        self._refine(range(len(self._seen.passages)))

    def _of_closest(self, what: str, missing: float) -> Array:
        closest = self._seen.closest
        self._refine(sorted(set(closest[closest >= 0].tolist())))
        values = [getattr(self._seen.passages[k], what) if k >= 0 else missing for k in closest.ravel()]
        return np.array(values, dtype=np.float64).reshape(closest.shape)

    def several(self, numbers: Sequence[int]) -> list[Approach]:
        """Return some passages as `Approach`es."""
        seen = self._seen
        self._refine(numbers)
        if self._sigmas is not None:  # of all at once, as the run is marched again for them
            new = sorted({*numbers, *self._all_flybys} - set(self._spread))
            self._spread.update(zip(new, self._sigmas([seen.passages[k] for k in new]), strict=True))
        return [
            Approach.of(
                self._system,
                self._clock,
                seen.passages[k],
                self._error_at_end(k),
                k in seen.estimated,
                self._spread.get(k),
            )
            for k in numbers
        ]

    def of_dominant(self, number: int) -> None:
        """Refine the passage of a body by the dominant one, and those of the bodies after it: none more at first, then
        as many as were asked for before, so that a loop over all bodies does not march along each of them alone.
        """
        if number in self._seen.refined:
            return
        known = self._seen.closest[:, 0]
        known = known[known >= 0]
        place = int(np.flatnonzero(known == number)[0])
        self._refine(known[place : place + self._asked].tolist())
        self._asked = min(2 * self._asked, AT_ONCE)

    def __str__(self) -> str:
        return super().__repr__()

    def __repr__(self) -> str:
        return self._caption()

    def _caption(self) -> str:
        bodies = f"Approaches({len(self.names)} bod{'y' if len(self.names) == 1 else 'ies'}"
        more = f", {self.left_out:,} more not listed" if self.left_out > 0 else ""
        more = ", the closest of each body alone" if self.left_out < 0 else more
        if not len(self):
            only = " but by the dominant one" * bool((self._seen.closest >= 0).any())
            return f"{bodies}, none{only}{more})"
        return f"{bodies}, {len(self):,} passage{'s' * (len(self) > 1)}{more}, closest {next(iter(self))})"

    @property
    def _text_columns(self) -> int:
        return 2 + (self._system.epoch is not None)

    def _shown(self) -> tuple[list[str], list[list[str]], int]:
        """Return the head of a table, rows for the closest passages, and the number of others."""
        units = self._system.units
        figures = {"distance": units.length, "time": units.time, "speed": units.speed}
        dated = self._system.epoch is not None
        head = ["body", "passes", *["date (TDB)"] * dated, *(headed(key, unit) for key, unit in figures.items())]
        head += [headed("v_infinity", units.speed)] * units.is_physical
        head.append(headed("off at the end", unit_of_errors(self._system)))
        sigmas = {"distance_sigma": units.length, "time_sigma": units.time} if self._sigmas is not None else {}
        head += [headed(key, unit) for key, unit in sigmas.items()]
        rows = []
        for a in islice(self, MOST_ROWS):
            date = [] if a.date is None else [date_text(a.date, 16)]
            free = ["bound" if a.v_infinity is None else f"{a.v_infinity.value:.6g}"] * units.is_physical
            off = "" if a.error is None else said(a.error).removesuffix(f" {a.error.unit}").replace("less than", "<")
            own = [f"{getattr(a, key).value:.6g}" for key in figures]
            spread = ["" if x is None else f"{x.value:.3g}" for x in (getattr(a, key) for key in sigmas)]
            rows.append([a.body, a.other, *date, *own, *free, off, *spread])
        return head, rows, len(self) - len(rows)


class Rows(Sequence[Approach]):
    """The passages of one body; that by the dominant body is refined when it is asked for."""

    def __init__(self, approaches: Approaches, body: str, others: list[int], dominant: list[int]) -> None:
        self._approaches, self._body = approaches, body
        self._numbers, self._dominant = [*others, *dominant], dominant

    def __len__(self) -> int:
        return len(self._numbers)

    @overload
    def __getitem__(self, k: int) -> Approach: ...
    @overload
    def __getitem__(self, k: slice) -> list[Approach]: ...
    def __getitem__(self, k: int | slice) -> Approach | list[Approach]:
        if isinstance(k, slice):
            some = self._numbers[k]
        else:
            known_as = f"closest_approaches()[{self._body!r}]"
            some = [self._numbers[place_in(len(self), k, known_as, "passages", "an index or a slice")]]
        for number in self._dominant:
            if number in some:
                self._approaches.of_dominant(number)
        found = self._approaches.several(some)
        return found if isinstance(k, slice) else found[0]

    def __iter__(self) -> Iterator[Approach]:
        return iter(self[:])

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and list(self) == list(other)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return "[" + ",\n ".join(map(str, self)) + "]"
