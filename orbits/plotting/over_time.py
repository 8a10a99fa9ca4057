"""Elements against time, and in their phase planes."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from itertools import islice
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.checks import checked_flag
from orbits.elements import FRAMES
from orbits.errors import InputError, UnknownNameError, shown
from orbits.plotting import style, words
from orbits.plotting.fitting import ROW
from orbits.plotting.histories import TURNING, Histories, histories, last_seen, on_line, pieces, primary_of
from orbits.plotting.pictures import Looks, counted, looks_of, named_in, there

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from orbits.protocols import Run

Array = NDArray[np.float64]

WORDS: Mapping[str, str] = {
    "a": "semi-major axis a",
    "e": "eccentricity e",
    "q": "pericentre distance q",
    "inc": "inclination i",
    "Omega": "ascending node Ω",
    "omega": "argument of pericentre ω",
    "pomega": "longitude of pericentre ϖ",
    "M": "mean anomaly M",
    "l": "mean longitude λ",
    "f": "true anomaly f",
    "n": "mean motion n",
    "P": "period P",
    "h": "h = e sin ϖ",
    "k": "k = e cos ϖ",
    "ix": "ix",
    "iy": "iy",
}
"""The elements that can be drawn against time."""

MOST_MARKS = 300
"""The most events, and approaches, that are marked."""

MOST_ROWS = 12
"""The most bodies that have a panel of their own."""

FLAT, UNCHANGED = 0.03, 1e-9
"""Smaller changes are not seen on a common scale, as a fraction of it; and are rounding, as a fraction of the value."""

CLOUD = "thin lines, from blue to yellow: {}, in the order of their first values"


@style.look()
def plot_elements(
    run: Run,
    *,
    elements: Sequence[str] = ("a", "e", "inc"),
    primary: str | None = None,
    bodies: Sequence[str] | None = None,
    title: str | None = None,
    frame: str | None = None,
    approaches: bool = False,
) -> Figure:
    """Return a picture of osculating elements against time, one panel for each; of up to 12 bodies one for each body,
    where on a common scale the changes of some would not be seen.

    elements : their names, as in `run.elements()`: a, e, q, inc, Omega, omega, pomega, M, l, f, n, P, h, k, ix, iy
    primary : the body that the others orbit; the most massive one by default
    bodies, title, frame : as in `plot_trajectory`
    approaches : whether the close approaches of the run are marked too, those of `run.closest_approaches()`, in a run
        that looked for them

    Lines end with a cross where a particle was retired or a body merged; events are small triangles on the line of
    their body. Raises UnknownNameError for an unknown element, body or frame, InputError for a run without samples.
    """
    wanted = (elements,) if isinstance(elements, str) else tuple(elements)
    for name in wanted:
        if name not in WORDS:
            raise UnknownNameError(f"there is no element {shown(name)} to draw; expected some of {', '.join(WORDS)}.")
    if not wanted:
        raise InputError(f"elements is empty; expected some of {', '.join(WORDS)}.")
    chosen = there(run, bodies)
    known = histories(run, chosen, wanted, primary=primary_of(run, primary, "elements"), frame=frame, kind="elements")
    looks, cloud = looks_of(run.system, known.bodies)
    checked_flag(approaches, "approaches")
    if not cloud and any(_is_flattened(known.shown(name), name) for name in wanted):
        return _one_by_one(run, known, wanted, looks, approaches=approaches, title=title)
    t, unit = times_of(run)
    made = style.figure(16, 3.2 + 2.9 * len(wanted))
    panels = made.subplots(len(wanted), 1, sharex=True, squeeze=False)[:, 0]
    told: dict[str, None] = {}
    marks = _marks(run, approaches=approaches)
    for axes, name in zip(panels, wanted, strict=True):
        told |= dict.fromkeys(_draw(axes, run, known, name, t, looks, cloud))
        told |= dict.fromkeys(said for mark in marks if (said := _mark(axes, run, known, name, t, looks, mark)))
        axes.set_ylabel(_label(run, name))
        if name in TURNING and _is_round(known.shown(name)):
            axes.set(ylim=(-10.0, 370.0), yticks=np.arange(0.0, 361.0, 90.0))
        axes.grid(color=style.FAINT, lw=0.6)
    panels[-1].set_xlabel(words.since(run.system, unit))
    years(panels[0], run, t)
    made.align_ylabels()
    panels[0].set_title(heading(run, known) if title is None else title)
    style.below(made, *named_in(panels[0]), "; ".join(told))
    return made


def _is_flattened(values: Array, name: str) -> bool:
    """Return whether a common scale hides how the values of a body, (samples, k), change."""
    if not 1 < values.shape[1] <= MOST_ROWS or len(values) < 2:
        return False
    values = np.where(np.isfinite(values), values, np.nan)  # a of a parabola is infinite
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of bodies that are never there
        low, high = np.nanmin(values, axis=0), np.nanmax(values, axis=0)
    whole = 360.0 if name in TURNING else float(np.nanmax(high, initial=-np.inf) - np.nanmin(low, initial=np.inf))
    moved = (high - low) > UNCHANGED * np.maximum(np.maximum(np.abs(low), np.abs(high)), whole)
    return bool((moved & (high - low < FLAT * whole)).any())


def _is_round(values: Array) -> bool:
    """Return whether angles are within a turn: those of hyperbolas may be negative, or beyond."""
    return not ((values < 0.0) | (values > 360.0)).any()


def _one_by_one(
    run: Run, known: Histories, wanted: Sequence[str], looks: Looks, *, approaches: bool, title: str | None
) -> Figure:
    """Return a picture with a column for each element and a row for each body, each panel on a scale of its own."""
    t, unit = times_of(run)
    made = style.figure(5.4 * max(len(wanted), 2), 1.8 + 1.45 * len(known.bodies))
    panels = made.subplots(len(known.bodies), len(wanted), sharex=True, squeeze=False)
    told: dict[str, None] = {}
    marks = _marks(run, approaches=approaches)
    for row, i in enumerate(known.bodies):
        one = Histories([i], known.primary, {name: x[:, [row]] for name, x in known.elements.items()}, known.frame)
        for axes, name in zip(panels[row], wanted, strict=True):
            told |= dict.fromkeys(_draw(axes, run, one, name, t, looks, []))
            told |= dict.fromkeys(said for mark in marks if (said := _mark(axes, run, one, name, t, looks, mark)))
            _own_scale(axes, one.shown(name), name)
            axes.tick_params(labelsize=12)
            axes.grid(color=style.FAINT, lw=0.6)
        named = words.short(run.names[i])
        panels[row, 0].set_ylabel(named, fontsize=13, rotation=0.0, ha="right", va="center", gid=ROW)
    for axes, name in zip(panels[0], wanted, strict=True):
        axes.set_title(_label(run, name), fontsize=15)
    for axes in panels[-1]:
        axes.set_xlabel(words.since(run.system, unit), fontsize=13)
    made.suptitle(heading(run, known) if title is None else title, x=0.01, ha="left", fontsize=17)
    made.align_ylabels()
    style.below(made, [], [], "; ".join(["each panel has a scale of its own", *told]))
    return made


def _own_scale(axes: Axes, values: Array, name: str) -> None:
    """Scale a panel to the values in it; those that change by rounding alone are a line in its middle."""
    from matplotlib.ticker import MaxNLocator

    axes.yaxis.set_major_locator(MaxNLocator(3, steps=[1, 2, 5, 10]))
    values = values[np.isfinite(values)]
    if len(values):
        low, high = float(values.min()), float(values.max())
        if name in TURNING and high - low > 180.0 and _is_round(values):
            axes.set(ylim=(-10.0, 370.0), yticks=[0.0, 180.0, 360.0])
        elif high - low <= UNCHANGED * max(abs(low), abs(high)):
            half = max(0.05 * abs(high), 1e-3)
            axes.set_ylim(low - half, high + half)


def _draw(
    axes: Axes, run: Run, known: Histories, name: str, t: Array, looks: Looks, cloud: list[int]
) -> list[str]:
    """Draw one element of all bodies, and return the meaning of the marks."""
    values, turn = known.shown(name), 360.0 if name in TURNING else None
    told: dict[str, None] = {}
    if cloud:
        _draw_many(axes, t, values[:, [known.bodies.index(i) for i in cloud]], turn)
        told[CLOUD.format(counted(run.system, cloud))] = None
    ends = run._reached if run._span is not None else run._last_time
    for k, i in enumerate(known.bodies):
        last = last_seen(values[:, k])
        gone = 0 <= last < len(t) - 1 and np.isnan(values[last + 1 :, k]).all()
        if i in looks:
            line = style.line(axes, *pieces(t, values[:, k], turn), lw=1.3, zorder=3, **looks[i])
            if cloud:
                style.outline(line)
        colour = looks[i]["color"] if i in looks else style.GREY
        if gone and ends is not None:
            axes.plot(t[last], values[last, k], "x", ms=8 if i in looks else 4, mew=1.8, color=colour, zorder=4)
            told["crosses: bodies that merged, or were retired"] = None
    return [*told]


def _draw_many(axes: Axes, t: Array, values: Array, turn: float | None) -> None:
    """Draw the lines of many bodies, thin, from dark to light by their first values."""
    from matplotlib import colormaps
    from matplotlib.collections import LineCollection

    first = np.array([x[np.isfinite(x)][0] if np.isfinite(x).any() else np.nan for x in values.T])
    order = np.argsort(np.argsort(first)) / max(1, len(first) - 1)
    lines = [np.column_stack(pieces(t, x, turn)) for x in values.T]
    thin = max(0.25, min(0.8, 30.0 / len(lines)))
    colours = colormaps["cividis"](0.15 + 0.75 * order)
    if len(t) == 1:
        axes.scatter(np.full(len(lines), t[0]), values[0], s=9.0, alpha=0.75, color=colours, zorder=1)
    axes.add_collection(LineCollection(lines, lw=thin, alpha=0.75, colors=colours, zorder=1))
    axes.autoscale_view()


class Marks(NamedTuple):
    """What is marked on lines: the symbol, what it means, and the time and the bodies of each."""

    symbol: str
    said: str
    at: Sequence[tuple[float, tuple[str | None, ...]]]


def _marks(run: Run, *, approaches: bool) -> list[Marks]:
    """Return the events of a run, and its close approaches if they are asked for."""
    found = []
    if len(run.events):
        kinds = list(dict.fromkeys(run.events.kind[:MOST_MARKS]))
        what = ", ".join(kinds[:3]) + ", ..." * (len(kinds) > 3)
        more = f", the first {MOST_MARKS} of {len(run.events):,}" * (len(run.events) > MOST_MARKS)
        at = [(float(event.time.value), (event.body, event.other)) for event in run.events[:MOST_MARKS]]
        found.append(Marks("^", f"triangles: {what}{more}", at))
    if approaches:
        some = list(islice(run.closest_approaches(), MOST_MARKS))
        at = [(float(one.time.value), (one.body, one.other)) for one in some]
        found.append(Marks("D", "diamonds: close approaches", at))
    return found


def _mark(
    axes: Axes, run: Run, known: Histories, name: str, t: Array, looks: Looks, marks: Marks
) -> str:
    """Mark events or approaches on the lines of their bodies, and return what the marks mean, if there are any."""
    if len(t) < 2 or run.times[0] == run.times[-1]:
        return ""
    values, order = known.shown(name), np.argsort(t)
    factor = float(t[-1] - t[0]) / float(run.times[-1] - run.times[0])
    places = {run.names[i]: k for k, i in enumerate(known.bodies)}
    any_there = False
    for time, names in marks.at:
        k = next((places[one] for one in names if one in places), None)
        if k is not None:
            line = values[order, k]
            value = on_line(factor * time, t[order], line, 360.0 if name in TURNING and _is_round(line) else None)
            colour = looks.get(known.bodies[k], {}).get("color", style.GREY)
            axes.plot(factor * time, value, marks.symbol, ms=11, mec="white", mew=0.5, color=colour, zorder=5)
            any_there = any_there or bool(np.isfinite(value))
    return marks.said if any_there else ""


@style.look()
def plot_phase(
    run: Run,
    *,
    primary: str | None = None,
    bodies: Sequence[str] | None = None,
    title: str | None = None,
    frame: str | None = None,
) -> Figure:
    """Return a picture of the phase planes of the orbits: (e cos pomega, e sin pomega), in which secular motion goes
    round the forced eccentricity, and (a, e), with the curves of equal pericentre and apocentre of the massive bodies.

    primary, bodies, title, frame : as in `plot_elements`
    Raises as `plot_elements` does.
    """
    chosen = there(run, bodies)
    place = primary_of(run, primary, "phase")
    known = histories(run, chosen, ("a", "e", "h", "k"), primary=place, frame=frame, kind="phase")
    looks, cloud = looks_of(run.system, known.bodies)
    made = style.figure(17, 9)
    plane, sizes = made.subplots(1, 2)
    bound = known["e"] < 1.0
    told: dict[str, None] = {}
    for axes, x, y in ((plane, known["k"], known["h"]), (sizes, known["a"], known["e"])):
        x, y = np.where(bound, x, np.nan), np.where(bound, y, np.nan)
        for k, i in enumerate(known.bodies):
            if i in looks:
                told |= dict.fromkeys(_wander(axes, x[:, k], y[:, k], looks[i]))
        if cloud:
            many = [known.bodies.index(i) for i in cloud]
            told |= dict.fromkeys(_ends(axes, x[:, many], y[:, many]))
    if not bound.all() and (known["e"] >= 1.0).any():
        told["samples on hyperbolas are left out"] = None
    if cloud:
        plane.plot([], [], ".", ms=8, mew=0, color=style.BLUE, label=counted(run.system, cloud))
    about_origin(plane, max(map(abs, (*plane.get_xlim(), *plane.get_ylim()))))
    unit = _unit(run)
    plane.set(xlabel="k = e cos ϖ", ylabel="h = e sin ϖ")
    sizes.set(xlabel=f"semi-major axis a [{unit}]" if unit else "semi-major axis a", ylabel="eccentricity e")
    sizes.set_ylim(bottom=0.0)
    for axes in (plane, sizes):
        axes.grid(color=style.FAINT, lw=0.6)
    made.suptitle(heading(run, known) if title is None else title, x=0.01, ha="left", fontsize=17)
    style.below(made, *named_in(plane), "; ".join(told))
    return made


def _ends(axes: Axes, x: Array, y: Array) -> list[str]:
    """Draw where many points, (samples, k), begin and end, and return what that means."""
    known = np.isfinite(x) & np.isfinite(y)
    some = np.flatnonzero(known.any(axis=0))
    first, last = known.argmax(axis=0)[some], len(x) - 1 - known[::-1].argmax(axis=0)[some]
    axes.plot(x[first, some], y[first, some], ".", ms=4, mew=0, color=style.GREY, alpha=0.6, zorder=1)
    axes.plot(x[last, some], y[last, some], ".", ms=5, mew=0, color=style.BLUE, alpha=0.8, zorder=2)
    return ["of many: grey at the start, blue at the end"] if len(some) else []


def _wander(axes: Axes, x: Array, y: Array, look: Mapping[str, Any]) -> list[str]:
    """Draw how a point wanders, from a ring to a disc, and return what they mean."""
    known = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    if not len(known):
        return []
    first, last = known[0], known[-1]
    colour = look["color"]
    axes.plot(x, y, ".", ms=3, mew=0, alpha=0.8, color=colour)
    axes.plot(x, y, lw=0.4, alpha=0.35, color=colour)
    axes.plot([], [], lw=2.5, **look)
    axes.plot(x[first], y[first], "o", ms=8, mfc="white", mec=colour, mew=1.6, zorder=3)
    axes.plot(x[last], y[last], "o", ms=8, mec="white", mew=0.5, color=colour, zorder=4)
    return ["rings: at the start", "discs: at the end"]


def about_origin(axes: Axes, reach: float) -> None:
    """Give a plane equal scales about its origin, which is marked."""
    from matplotlib.ticker import MaxNLocator

    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(4, symmetric=True))
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach))
    axes.set_aspect("equal", adjustable="box")
    axes.axhline(0.0, color=style.GREY, lw=0.7, zorder=0)
    axes.axvline(0.0, color=style.GREY, lw=0.7, zorder=0)


def times_of(run: Run) -> tuple[Array, str]:
    """Return the times of the samples in a unit that suits the run, and the unit."""
    factor, unit = words.fitting_time(float(np.abs(run.times).max()), run.system.units.time)
    return run.times * factor, unit


def years(axes: Axes, run: Run, t: Array) -> None:
    """Give a time axis the years of the calendar at its upper edge, if they are of use."""
    epoch, span = run.system.epoch, float(np.ptp(run.times)) if len(run) else 0.0
    if epoch is None or len(t) < 2 or not span:
        return
    per_unit = float(run.system.units.time.to("yr")) * float(np.ptp(run.times)) / float(np.ptp(t))
    if not 3.0 <= per_unit * np.ptp(t) <= 20_000.0:
        return
    start = float(epoch.jyear)

    def to_years(x: Any) -> Any:
        return start + per_unit * x

    def from_years(x: Any) -> Any:
        return (x - start) / per_unit

    upper = axes.secondary_xaxis("top", functions=(to_years, from_years))
    upper.tick_params(labelsize=12, colors=style.GREY)
    upper.xaxis.set_major_formatter(lambda x, _: f"{x:g}")
    upper.spines["top"].set_visible(False)
    upper.set_xlabel("year", fontsize=12, color=style.GREY, labelpad=4.0)


def heading(run: Run, known: Histories) -> str:
    """Return what a picture of elements is of: the centre, the frame and the method."""
    frame = f", {FRAMES[known.frame]}" if known.frame != "system" else ""
    centre = words.literal(words.in_prose(run.names[known.primary]))
    return f"orbits about {centre}{frame}; {words.in_title(run.integrator)}"


def _unit(run: Run) -> str:
    return str(run.system.units.length).replace("AU", "au")


def _label(run: Run, name: str) -> str:
    """Return the label of an axis, with the unit."""
    units = run.system.units
    time = str(units.time)
    own = {"a": _unit(run), "q": _unit(run), "P": time, "n": f"rad / {time}" if time else ""}
    unit = own.get(name, "°" if name in ("inc", *TURNING) else "")
    return f"{WORDS[name]} [{unit}]" if unit else WORDS[name]
