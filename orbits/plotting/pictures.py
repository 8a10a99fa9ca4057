"""Pictures of a system and of a run: paths and conserved quantities."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from orbits import body_names
from orbits.elements import FRAMES, to_frame
from orbits.errors import InputError
from orbits.plotting import arcs, style, words

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from orbits.protocols import Run, State

Array = NDArray[np.float64]
Looks = dict[int, dict[str, Any]]

MOST_PATHS = 24
"""The most bodies whose paths are drawn as lines; if there are more, massless ones become a cloud of points."""
MOST_LINES = 200
"""The most massive bodies that are drawn as lines; the others join the cloud."""
MOST_NAMES = 40
"""The most names in a legend."""
STILL = 0.01
"""If the central body moves less than this fraction of the map, only a disc is drawn."""
ROUNDING = 2.0**-53
"""The rounding of one float64, relative to it."""
OF_ROUNDING = "grey band: up to 2⁻⁵³, the rounding of one float64, on a linear scale"
ELLIPSES = "ellipses: the osculating two-body orbits at this time"
MOST_POWERS = 7
"""The most powers of ten beside an axis of errors."""
INNER, FEW = 0.1, 3
"""Bodies within this fraction of the largest distance get a map of their own, if they are at least three."""


@style.look()
def plot_system(system: State, *, title: str | None = None, frame: str | None = None) -> Figure:
    """Return a picture of a system from above: bodies at the epoch with their osculating ellipses.

    Bodies close to the centre are also shown in a map of their own.
    frame : the view is along the third axis of the "ecliptic" of J2000, of the "icrf" or of the "system" itself; by
        default `System.frame`
    Raises UnknownNameError for another frame.
    """
    looks, cloud = looks_of(system, list(range(len(system))))
    points = in_plane(system, system.values.q, frame)
    inner = _inner(system, points, looks, cloud)
    made = style.figure(16, 9.5) if inner else style.figure(11, 11)
    maps = made.subplots(1, 2) if inner else [made.subplots()]
    told = [
        _draw_bodies(axes, system, points, looks, [i for i in cloud if i in chosen], chosen, frame)
        for axes, chosen in zip(maps, (set(range(len(system))), inner), strict=False)
    ]
    maps[0].set_title(words.moment(system) if title is None else title, parse_math=False)
    style.below(made, *named_in(maps[0]), "; ".join(dict.fromkeys(words for some in told for words in some)))
    return made


def _draw_bodies(
    axes: Axes, system: State, points: Array, looks: Looks, cloud: list[int], chosen: set[int], frame: str | None
) -> list[str]:
    """Draw the chosen bodies and their ellipses, and return the meaning of the marks."""
    told = [words for words in [_draw_cloud(axes, system, points, cloud)] if words]
    middle, any_ellipse = int(np.argmax(system.values.gm)), False
    for i in sorted(chosen & set(looks)):
        path = osculating_ellipse(system, i, frame)
        if path is not None:
            any_ellipse = True
            axes.plot(path[:, 0], path[:, 1], lw=1.2, alpha=0.8, color=looks[i]["color"])
        axes.plot(*points[i, :2], "o", ms=9 if i == middle else 6, **looks[i])
    map_axes(axes, system, frame)
    return [*[ELLIPSES] * any_ellipse, *told]


@style.look()
def plot_trajectory(
    run: Run, *, title: str | None = None, bodies: Sequence[str] | None = None, frame: str | None = None
) -> Figure:
    """Return a picture of a run: the paths from above, and the errors of energy and angular momentum against time.

    Bodies close to the centre are also shown in a map of their own.
    bodies : all by default; if there are many, massless ones, and all but the 200 most massive ones, are shown as a
        cloud of points at the end of the run
    frame : as in `plot_system`
    The line of a body that merges into another one, or is retired, ends at its last sample. Raises InputError for a run
    without samples, and for bodies that are in none of them; UnknownNameError for a frame or body that does not exist.
    """
    system = run.system
    chosen = there(run, bodies)
    looks, cloud = looks_of(system, chosen)
    inner = _inner(system, in_plane(system, arcs.last_state(run).values.q, frame), looks, cloud)
    maps = ["map", "inner"] if inner else ["map"]
    made = style.figure(17, 8.4) if inner else style.figure(16, 10)
    ratios = [1.0, 1.0, 0.95] if inner else [1.15, 1.0]
    axes = made.subplot_mosaic([[*maps, "energy"], [*maps, "momentum"]], width_ratios=ratios)
    told: dict[str, None] = {}
    for name, part in zip(maps, (set(chosen), inner), strict=False):
        told |= dict.fromkeys(_draw_paths(axes[name], run, looks, [i for i in cloud if i in part], part, frame))
    axes["map"].set_title(words.made_by(run) if title is None else title, parse_math=False)
    conserved(axes["energy"], axes["momentum"], {"": run})
    massive = [] if system.massive.all() else ["energy and angular momentum: of the massive bodies"]
    style.below(made, *named_in(axes["map"]), "; ".join([*told, *massive, OF_ROUNDING]))
    return made


def paths(
    axes: Axes, run: Run, *, bodies: Sequence[str] | None = None, frame: str | None = None
) -> tuple[str, ...]:
    """Draw the paths as seen from above, and return the meaning of the marks, for a caption.

    Samples that are far apart are joined by arcs of two-body motion, or drawn as dots if the motion is not Keplerian.
    Many massless particles, and massive bodies beyond the 200 most massive ones, are drawn as points at the last
    sample. Raises as `plot_trajectory` does.
    """
    chosen = there(run, bodies)
    looks, cloud = looks_of(run.system, chosen)
    return _draw_paths(axes, run, looks, cloud, set(chosen), frame)


def _draw_paths(
    axes: Axes, run: Run, looks: Looks, cloud: list[int], chosen: set[int], frame: str | None
) -> tuple[str, ...]:
    system = run.system
    told: dict[str, None] = {}
    end = arcs.last_state(run)
    last = in_plane(system, end.values.q, frame)
    middle = int(np.argmax(end.values.gm))
    gone = _gone(run)
    if words_of_cloud := _draw_cloud(axes, system, last, [i for i in cloud if not gone[i]]):
        told[words_of_cloud] = None
    reach = float(np.linalg.norm(last[sorted(chosen)] - last[middle], axis=1).max())
    still = np.ptp(run[system.names[middle]].q.value, axis=0).max() < STILL * reach
    single = sorted(chosen & set(looks))
    samples, ways = arcs.followed(run, [i for i in single if i != middle or not still])
    for i in single:
        look, colour = looks[i], looks[i]["color"]
        if gone[i]:
            axes.plot([], [], **look)
        else:
            axes.plot(*last[i, :2], "o", ms=6, mec="white", mew=0.5, zorder=3, **look)
        if i not in ways:
            continue
        path = ways[i]
        curve = in_plane(system, path.curve, frame)
        axes.plot(curve[:, 0], curve[:, 1], lw=1.3, color=colour)
        if path.loose.any():
            dots = in_plane(system, samples.q(i)[path.loose], frame)
            axes.plot(dots[:, 0], dots[:, 1], ".", ms=3.5, mew=0, color=colour)
            told["dots: samples too far apart for a line"] = None
        around = None if gone[i] else osculating_ellipse(end, i, frame)
        if around is not None:
            axes.plot(around[:, 0], around[:, 1], lw=0.8, alpha=0.45, zorder=1, color=colour)
            told["thin ellipses: the osculating orbits at the end"] = None
    map_axes(axes, system, frame)
    if any(gone[i] for i in chosen):
        told["lines without a disc: bodies that merged, or were retired"] = None
    return ("discs: the bodies at the end", *told)


def conserved(energy: Axes, momentum: Axes, runs: Mapping[str, Run], *, time: str | None = None) -> None:
    """Draw |dE/E| and |dL/L| against time for several runs, with the round-off floor.

    time : the unit of time; by default one suited to the length of the runs
    """
    system = next(iter(runs.values())).system
    span = max((float(np.abs(run.times).max()) for run in runs.values() if len(run)), default=0.0)
    factor, unit = words.fitting_time(span, system.units.time)
    if time is not None:
        factor, unit = float(system.units.time.to(time)), time
    for k, (label, run) in enumerate(runs.items()):
        look: dict[str, Any] = {"color": style.PALETTE[k % len(style.PALETTE)], "lw": 1.4}
        kept, t = run.drift(), run.times * factor
        changing, turning, _ = run.conserved()
        style.line(energy, t, relative_change(changing, kept.energy.scale)[1:], label=label, **look)
        style.line(momentum, t, relative_change(turning, kept.angular_momentum.scale)[1:], **look)
    for axes, name in ((energy, "energy, |ΔE/E|"), (momentum, "angular momentum, |ΔL|/|L|")):
        down_to_rounding(axes)
        axes.set_title(name)
        axes.set_ylabel("relative change")
        axes.grid(axis="y", color=style.FAINT, lw=0.6)
    energy.tick_params(labelbottom=False)
    momentum.set_xlabel(words.since(system, unit))
    if len(runs) > 1:
        energy.legend(loc="best", fontsize=13)


def down_to_rounding(axes: Axes) -> None:
    """Give relative errors, none of which is negative, a logarithmic scale down to the rounding of one float64, and
    from there to zero a linear one, with a band.
    """
    from matplotlib.ticker import FixedLocator, NullLocator

    high = axes.dataLim.y1 if np.isfinite(axes.dataLim.y1) else 0.0
    top = max(2.0 * high, 1e-14)
    powers = np.arange(-15, math.floor(math.log10(top)) + 1)
    axes.set_yscale("symlog", linthresh=ROUNDING, linscale=0.6)
    axes.set_ylim(-0.06 * ROUNDING, top)
    shown = powers[:: -(-len(powers) // MOST_POWERS)]
    axes.yaxis.set_major_locator(FixedLocator([0.0, *(10.0**power for power in shown.tolist())]))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.axhspan(-ROUNDING, ROUNDING, color=style.FAINT, alpha=0.7, lw=0, zorder=0)


def flatness(axes: Axes, t: Array, series: Array, title: str, components: Sequence[str] = ("x", "y", "z")) -> None:
    """Draw the relative change of each component of a conserved quantity, in units of 10^-16, on a linear scale.

    series : (n,) or (n, 3), with a legend of the `components`; the band is the rounding of one float64
    """
    values = series.reshape(len(series), -1)
    change = (values - values[0]) / (float(np.linalg.norm(values[0])) or 1.0) * 1e16
    for component, colour, name in zip(change.T, (style.BLUE, style.VERMILION, style.GREEN), components, strict=False):
        style.line(axes, t, component, color=colour, lw=1.2, label=name if values.shape[1] > 1 else None)
    reach = max(10.0, 1.3 * float(np.abs(change).max()))
    band = ROUNDING * 1e16
    axes.axhspan(-band, band, color=style.FAINT, alpha=0.7, lw=0, zorder=0)
    axes.set_ylim(-reach, reach)
    axes.set_title(title)
    axes.set_ylabel("change [10⁻¹⁶]")
    axes.grid(axis="y", color=style.FAINT, lw=0.6)
    if values.shape[1] > 1:
        axes.legend(loc="upper right", ncols=3, fontsize=13, borderpad=0.0, handlelength=1.2, columnspacing=1.2)


def relative_change(series: Array, scale: float | None = None) -> Array:
    """Return |x_k - x_0| / |x_0| of a scalar or vector series.

    scale : replaces |x_0|, which may cancel to zero; see `ConservedQuantities`
    """
    values = series.reshape(len(series), -1)
    size = (float(np.linalg.norm(values[0])) if scale is None else scale) or 1.0
    return np.asarray(np.linalg.norm(values - values[0], axis=1) / size)


def in_plane(system: State, q: Array, frame: str | None = None) -> Array:
    """Return positions as seen from above, (..., 3), in the axes of `frame`.

    The default is `System.frame`.
    """
    return to_frame(q, system.frame if frame is None else frame)


def map_axes(axes: Axes, system: State, frame: str | None = None, origin: str = "") -> None:
    """Label the axes of a map with frame, origin and unit, and give both axes the same scale."""
    unit = str(system.units.length).replace("AU", "au")
    frame = system.frame if frame is None else frame.lower()
    where = FRAMES[frame] if frame != "system" else ""
    axes.set_aspect("equal", adjustable="datalim")
    farthest = max(map(abs, (*axes.get_xlim(), *axes.get_ylim())))
    power = 0 if 0.1 <= farthest < 1e5 else 3 * int(np.floor(np.log10(farthest) / 3))  # longer numbers would overlap
    unit = " ".join(part for part in (words.power_of_ten(power), unit) if part)
    for name, axis in (("x", axes.xaxis), ("y", axes.yaxis)):
        label = ", ".join(part for part in (name, where, origin) if part)
        axis.set_label_text(f"{label} [{unit}]" if unit else label)
        if power:
            axis.set_major_formatter(lambda x, _: f"{x / 10.0**power:g}".replace("-", "−"))


def osculating_ellipse(system: State, body: str | int, frame: str | None = None) -> Array | None:
    """Return 721 points, as seen from above, of a body's osculating ellipse.

    Its centre is the planet of a moon, the pair of stars of a circumbinary planet, or the most massive body. None for
    the central body, for parabolas and hyperbolas, and where perturbations exceed a tenth of the attraction.
    """
    path = arcs.ellipse(system, body if isinstance(body, int) else system.index(body))
    return None if path is None else in_plane(system, path, frame)


def _chosen(system: State, bodies: Sequence[str] | None) -> list[int]:
    chosen: list[int] = np.arange(len(system))[body_names.chosen(system.names, bodies)].tolist()
    return chosen


def there(run: Run, bodies: Sequence[str] | None) -> list[int]:
    """Return the chosen bodies that are in any sample. Raises InputError if none is, or one that was named."""
    chosen = _chosen(run.system, bodies)
    if not len(run):
        return chosen  # refused where the samples are read
    seen = arcs.seen(run)
    if bodies is not None and not seen[chosen].all():
        gone = body_names.few([run.names[i] for i in chosen if not seen[i]])
        raise InputError(
            f"bodies has {gone}, gone before the first of these samples; expected bodies that are there. Leave it out, "
            "or draw earlier samples too."
        )
    return [i for i in chosen if seen[i]]


def _gone(run: Run) -> NDArray[np.bool_]:
    """Return which bodies are gone by the last sample, merged or retired, (bodies,)."""
    return np.asarray(~np.isfinite(run._q[-1]).all(axis=1))


def looks_of(system: State, chosen: list[int]) -> tuple[Looks, list[int]]:
    """Return the looks of the bodies that are drawn individually, and the bodies that are drawn as a cloud."""
    massive = system.massive
    heavy = sorted((i for i in chosen if massive[i]), key=lambda i: -system.values.gm[i])
    gone = set(heavy[MOST_LINES:]) | ({i for i in chosen if not massive[i]} if len(chosen) > MOST_PATHS else set())
    cloud, single = [i for i in chosen if i in gone], [i for i in chosen if i not in gone]
    names = [system.names[i] for i in single]
    colours = style.colours(names)
    return {
        i: {"color": colour, "label": words.short(name)} for i, name, colour in zip(single, names, colours, strict=True)
    }, cloud


def counted(system: State, cloud: list[int]) -> str:
    """Return the number of the bodies of a cloud in words."""
    kind = "lighter" if system.massive[cloud].any() else "massless"
    return f"{len(cloud):,} {kind} bod{'y' if len(cloud) == 1 else 'ies'}"


def _inner(system: State, points: Array, looks: Looks, cloud: list[int]) -> set[int]:
    """Return the central body and those close to it, if there are several and others are far away; else nothing."""
    middle = int(np.argmax(system.values.gm))
    distance = np.linalg.norm(points - points[middle], axis=1)
    drawn = [i for i in (*looks, *cloud) if i != middle]
    close = {i for i in drawn if distance[i] < INNER * distance[drawn].max()}
    return {middle, *close} if middle in looks and len(close & set(looks)) >= FEW else set()


def _draw_cloud(axes: Axes, system: State, points: Array, cloud: list[int]) -> str:
    """Draw bodies as points, and return what they are if the legend has no room for it."""
    if not cloud:
        return ""
    label = counted(system, cloud)
    look: dict[str, Any] = {"mew": 0, "color": style.GREY}
    size = max(2.0, min(5.0, 100.0 / len(cloud) ** 0.5))
    axes.plot(points[cloud, 0], points[cloud, 1], ".", ms=size, alpha=0.7, zorder=1, **look)
    axes.plot([], [], ".", ms=8, label=label, **look)
    return f"grey points: {label}, without a line" if system.massive[cloud].any() else ""


def named_in(axes: Axes) -> tuple[list[Any], list[str]]:
    handles, labels = axes.get_legend_handles_labels()
    return (handles, labels) if len(labels) <= MOST_NAMES else ([], [])
