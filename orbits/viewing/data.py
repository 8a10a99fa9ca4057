"""The data of a view: samples as numbers, what is conserved, events, names and units, for JSON.

Positions and velocities are in the frame of the system (`System.frame`). Bodies that are drawn one by one have float64,
relative to their centres (see `orbits.viewing.layout`); the others are float32, relative to the root.

A run whose samples take more than `LIMIT` bytes is thinned by one rule: every m-th sample is kept, with the least m
that fits; where this would leave less than `FEWEST` samples of a run with points, `FEWEST` of them and every k-th point
are kept. The page says so.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from orbits.body_names import few
from orbits.elements import FRAMES, to_frame
from orbits.errors import ArchiveError, InputError
from orbits.plotting import style, words
from orbits.plotting.histories import masses_over
from orbits.trajectory.archived import identity_of
from orbits.trajectory.work import accounts_of
from orbits.viewing.approaches import approaches_of
from orbits.viewing.happenings import happenings
from orbits.viewing.layout import Layout, relative

if TYPE_CHECKING:
    from orbits.system import System
    from orbits.trajectory import Trajectory

Array = NDArray[np.float64]

LIMIT = 48 * 2**20
"""The most bytes of samples in a page: a browser on a phone opens it."""
FEWEST = 100
"""The number of samples down to which samples are left out before points are."""
FEW_NAMES = 4
"""The most bodies that are all named in the title."""
MOST_LEGS = 1000
"""The most changes of masses of a page; elements after further ones are with the masses of the last."""
BODY_BYTES, POINT_BYTES = 48, 24
J2000 = 2451545.0


@dataclass(frozen=True)
class Thinning:
    """Which samples and points of a run a page has: every `samples`-th, and every `points`-th."""

    samples: int = 1
    points: int = 1

    @classmethod
    def of(cls, layout: Layout, total: int, limit: int) -> Thinning:
        """Return the thinning with which a run of so many samples takes at most `limit` bytes."""
        bodies, points = BODY_BYTES * len(layout.bodies), POINT_BYTES * len(layout.points)

        def fits(every: int, point: int) -> bool:
            return math.ceil(total / every) * (bodies + points / point) <= limit

        most = max(1, total // FEWEST)
        least = max(1, math.ceil(total * (bodies + points) / limit))
        every = min(least, most)
        if fits(every, 1) or not points:
            return cls(least if not points else every)
        room = limit / math.ceil(total / every) - bodies
        if room < POINT_BYTES:
            raise InputError(
                f"a view of {len(layout.bodies) + len(layout.points):,} bodies has no room in {limit / 2**20:.0f} MB "
                "even with 100 samples; view a part of the run, run[::10], or give a larger limit."
            )
        return cls(every, math.ceil(points / room))

    def said(self, samples: int, points: int) -> str:
        """Return what was left out in a sentence, "" if nothing was."""
        parts = [f"every {_ordinal(self.samples)} of {samples:,} samples"] * (self.samples > 1)
        parts += [f"every {_ordinal(self.points)} of {points:,} particles"] * (self.points > 1)
        return f"The run is too large for one page: this one has {' and '.join(parts)}." if parts else ""


class ViewData:
    """What a page shows of a run: `header()` once, `chunk(run, first)` for samples from `first` on.

    run : with at least one sample; limit : the most bytes of samples
    Raises InputError for a run without samples, for samples that are not in its order, and for one with too many
    bodies for the limit.
    """

    def __init__(self, run: Trajectory, *, title: str | None = None, limit: int = LIMIT) -> None:
        if not len(run):
            raise InputError(f"{run!r} has no samples yet, so there is nothing to see; expected at least one.")
        gaps = np.diff(run.times) * run.clock.direction
        if (gaps < 0.0).any() and ((gaps > 0.0).any() or len(run.legs) > 1):
            raise InputError(
                "the samples are not in the order of the run, in which a view goes from one to the next; expected "
                "sorted times, such as run.at(np.sort(times))."
            )
        self.title = title
        system = run.system
        self.total = len(run) if run.archive is None else len(run.archive.times)
        self._identity = identity_of(run, 1)
        there = np.asarray(np.isfinite(run._sample(len(run) - 1)[0]).all(axis=1))
        whole = Layout.of(system, there)
        self.thinning = Thinning.of(whole, self.total, limit)
        self.layout = Layout.of(system, there, self.thinning.points)
        self.points = len(whole.points)
        self.said = self.thinning.said(self.total, self.points)
        self._frame = system.frame
        drift = run[:1].drift()
        self._scales = {"energy": drift.energy.scale, "angular momentum": drift.angular_momentum.scale}

    def chosen(self, run: Trajectory, first: int) -> NDArray[np.intp]:
        """Return the numbers of the samples that a page has from its sample `first` on; the last one of a complete run
        is among them.
        """
        every, count = self.thinning.samples, len(run)
        rows = np.arange(first * every, count, every)
        if run.complete and count and (count - 1) % every and first * every < count:
            rows = np.append(rows, count - 1)
        return rows

    def approaches(self, run: Trajectory) -> dict[str, Any] | None:
        """Return the closest approaches of a run that is complete or was ended; None for one that still grows."""
        return approaches_of(run, self.layout) if run.complete or _ended(run) else None

    def header(self, run: Trajectory) -> dict[str, Any]:
        """Return all that does not grow with the run."""
        system, layout = run.system, self.layout
        names = [system.names[i] for i in layout.bodies]
        span = abs(run.times[-1]) if run.archive is None else abs(run.archive.times[-1])
        factor, unit = words.fitting_time(float(span), system.units.time)
        epoch = system.epoch
        return {
            "title": self.title or _title(system),
            "made_by": f"{words.method_words(run.integrator.label)}{_step(run)}",
            "frame": FRAMES[self._frame],
            "units": {
                "length": str(system.units.length).replace("AU", "au"),
                "speed": {
                    "name": "km/s" if system.units.is_physical else "",
                    "factor": float(system.units.speed.to("km / s")) if system.units.is_physical else 1.0,
                },
                "time": str(system.units.time),
                "shown": unit,
                "factor": factor,
                "days": float(system.units.time.to("d")) if system.units.is_physical else None,
            },
            "epoch": None if epoch is None else float((epoch.tdb.jd1 - J2000) + epoch.tdb.jd2),
            "moment": words.moment(system),
            "bodies": {
                "names": [words.SHORT_NAMES.get(name, name) for name in names],
                "in_prose": [words.in_prose(name) for name in names],
                "colours": style.colours(names),
                "gm": [float(system.values.gm[i]) for i in layout.bodies],
                "centre": list(layout.centres),
                "two_body_gm": list(layout.gm),
            },
            "focus": 0 if layout.dominated else -1,
            "points": {"names": [system.names[i] for i in layout.points], "two_body_gm": layout.points_gm},
            "span": float(span),
            "total": self.total,
            "every": self.thinning.samples,
            "said": self.said,
            "has_error": run.error_bars is not None,
        }

    def chunk(self, run: Trajectory, first: int = 0) -> dict[str, Any]:
        """Return the samples from `first` on, counted as the page counts them, with all that grows with the run.

        Raises ArchiveError for another run than that of the header.
        """
        if identity_of(run, 1) != self._identity:
            raise ArchiveError(f"{run.path} has another run by now; reload the page to see it.")
        rows = self.chosen(run, first)
        count = len(rows)
        bodies = np.empty((count, 2, len(self.layout.bodies), 3))
        points = np.empty((count, 2, len(self.layout.points), 3), dtype=np.float32)
        root, light = self.layout.bodies[0], list(self.layout.points)
        for k, row in enumerate(rows):
            for part, states in enumerate(run._sample(int(row))):
                seen = to_frame(states, self._frame)
                bodies[k, part] = relative(self.layout, seen)
                points[k, part] = seen[light] - seen[root]
        some: dict[str, Any] = {
            "first": first,
            "times": encoded(run.times[rows]),
            "bodies": encoded(bodies),
            "points": encoded(points),
            "numbers": encoded(rows.astype(np.float64)),
            "conserved": self._changes(run, rows),
            "complete": bool(run.complete),
            "ended": _ended(run),
            "events": happenings(run, self.layout),
            "masses": self._masses(run),
        }
        if run.error_bars is not None:
            bars = run.error_bars.position.value[rows]
            some["errors"] = encoded(bars[:, [*self.layout.bodies, *light]].astype(np.float32))
        return some

    def _changes(self, run: Trajectory, rows: NDArray[np.intp]) -> list[dict[str, Any]]:
        """Return the relative changes of energy and angular momentum since the start of a run, at some samples; none of
        what is not conserved.
        """
        some = run._with_samples(run.times[rows], *_states(run, rows))
        some._accounts = accounts_of(run)[rows]  # the spins of rigid bodies are among them
        found = []
        for (name, scale), kept in zip(self._scales.items(), some.conserved()[:2], strict=True):
            if not math.isnan(scale):
                change = np.linalg.norm((kept[1:] - kept[0]).reshape(len(rows), kept[0].size), axis=1) / (scale or 1.0)
                found.append({"name": name, "change": encoded(change)})
        return found

    def _masses(self, run: Trajectory) -> list[list[Any]]:
        """Return the times from which on masses are others, each with the GM of all bodies; [] if they stay the same.

        A body that is gone has 0.
        """
        legs = [float(leg.time.value) for leg in run.legs] if run.changes is not None else []
        slowly = run.times[:: math.ceil(len(run) / MOST_LEGS)].tolist() if run.system.forces else []
        forwards = (run.times[-1] - run.times[0] or run.clock.direction) > 0.0
        times = np.unique([*legs[:MOST_LEGS], *slowly])[:: 1 if forwards else -1]
        if not len(times):
            return []
        gm = masses_over(run, times)
        if run.changes is not None:
            gm = np.where(run.changes.over(times).present, gm, 0.0)
        gm = gm[:, list(self.layout.bodies)]
        new = np.append(True, (gm[1:] != gm[:-1]).any(axis=1))
        changes = zip(times[new].tolist(), gm[new].tolist(), strict=True)
        return [[t, now] for t, now in changes] if np.count_nonzero(new) > 1 else []


def _states(run: Trajectory, rows: Iterable[int]) -> tuple[Array, Array]:
    """Return positions and velocities at some samples, (n, bodies, 3)."""
    pairs = [run._sample(int(row)) for row in rows]
    shape = (0, len(run.names), 3)
    return tuple(np.array([pair[part] for pair in pairs]) if pairs else np.empty(shape) for part in (0, 1))  # type: ignore[return-value]


def encoded(array: Array | NDArray[np.float32]) -> dict[str, Any]:
    """Return an array for JSON: its type, its shape, and its bytes, little-endian, in base64."""
    kind = "f4" if array.dtype == np.float32 else "f8"
    raw = np.ascontiguousarray(array, dtype=f"<{kind}").tobytes()
    return {"type": kind, "shape": list(array.shape), "data": base64.b64encode(raw).decode("ascii")}


def _title(system: System) -> str:
    if len(system) <= FEW_NAMES:
        return few([words.shortened(name) for name in system.names])
    heavy = int(system.massive.sum())
    light = len(system) - heavy
    root = words.shortened(system.names[int(np.argmax(system.values.gm))])
    kinds = [f"{heavy - 1:,} other massive"] * (heavy > 1) + [f"{light:,} massless"] * (light > 0)
    last = light or heavy - 1
    return f"{root}, {' and '.join(kinds)} {'body' if last == 1 else 'bodies'}" if kinds else root


def _step(run: Trajectory) -> str:
    if math.isnan(run.step):
        steps = run.clock.describe(run.integrator)
        return f", {steps}" if steps else ""
    return f", dt = {words.in_fitting_time(abs(run.step), run.system.units.time)}"


def _ended(run: Trajectory) -> str:
    if run.archive is None:
        return f"stopped: {run.stopped.reason}" if run.stopped is not None else ""
    ended = run.archive.ended
    return f"{ended.how}: {ended.why}" if ended.how else ""


def _ordinal(number: int) -> str:
    ending = "th" if number % 100 in (11, 12, 13) else {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th")
    return f"{number:,}{ending}"
