"""Pictures of a system and of a run: paths, and what is conserved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from orbits.elements import icrf_to_ecliptic
from orbits.plotting import style
from orbits.system import presenting

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from orbits.system import System
    from orbits.trajectory import Trajectory

Array = NDArray[np.float64]

MOST_PATHS = 24
"""Bodies whose paths are drawn as lines; more become a cloud of points."""


@style.look()
def plot_system(system: System, *, title: str | None = None) -> Figure:
    """Return a picture of a system from above: bodies at the epoch, with the ellipses that they osculate.

    Physical systems are seen from the pole of the ecliptic, others along their third axis.
    """
    made = style.figure(11, 10)
    axes = made.subplots()
    gm, q, _, _ = system.values
    massive = system.massive
    points = in_plane(system, q)
    centre = int(np.argmax(gm))
    cloud = np.flatnonzero(~massive)
    if len(system) > MOST_PATHS and cloud.size:
        axes.plot(*points[cloud, :2].T, ".", ms=3, color=style.GREY, alpha=0.6, zorder=1)
    for i, name in enumerate(system.names):
        if not massive[i] and len(system) > MOST_PATHS:
            continue
        path = osculating_ellipse(system, i)
        if path is not None:
            axes.plot(path[:, 0], path[:, 1], color=style.colour(name, i), lw=1.2, alpha=0.7)
        axes.plot(*points[i, :2], "o", ms=9 if i == centre else 6, color=style.colour(name, i), label=style.short(name))
    _finish_map(axes, system)
    axes.set_title(title or _when(system))
    if massive.sum() <= MOST_PATHS:
        made.legend(loc="outside right upper", fontsize=13)
    return made


@style.look()
def plot_trajectory(run: Trajectory, *, title: str | None = None, bodies: Sequence[str] | None = None) -> Figure:
    """Return a picture of a run: the paths from above, and the errors of energy and angular momentum against time.

    bodies : which ones; all of them by default, massless ones as a cloud at the end where there are many
    """
    made = style.figure(16, 9)
    axes = made.subplot_mosaic([["map", "energy"], ["map", "momentum"]], width_ratios=[1.15, 1])
    paths(axes["map"], run, bodies=bodies)
    axes["map"].set_title(title or run.made_by)
    conserved(axes["energy"], axes["momentum"], {run.integrator.label: run})
    return made


def paths(axes: Axes, run: Trajectory, *, bodies: Sequence[str] | None = None) -> None:
    """Draw the sampled paths as seen from above; many massless particles become points at the last sample."""
    system = run.system
    chosen = np.arange(len(system))[presenting.chosen(system.names, bodies)].tolist()
    cloud = [i for i in chosen if not system.massive[i]] if len(chosen) > MOST_PATHS else []
    if cloud and len(run):
        last = in_plane(system, run[len(run) - 1].values.q[cloud])
        axes.plot(last[:, 0], last[:, 1], ".", ms=3, color=style.GREY, alpha=0.6)
    for i in chosen:
        if i in cloud:
            continue
        name = system.names[i]
        points = in_plane(system, run[name].q.value)
        look: dict[str, Any] = {"color": style.colour(name, i)}
        dense = len(points) > 2 and _turns_slowly(points)
        axes.plot(points[:, 0], points[:, 1], "-" if dense else ".", lw=1.0, ms=2.0, alpha=0.7, **look)
        axes.plot(*points[-1, :2], "o", ms=6, label=style.short(name), **look)
    _finish_map(axes, system)
    if len(chosen) - len(cloud) <= 12:
        axes.legend(loc="upper right", fontsize=12)


def conserved(energy: Axes, momentum: Axes, runs: Mapping[str, Trajectory], *, time: str | None = None) -> None:
    """Draw |dE/E| and |dL/L| against time for several runs, with the round-off floor."""
    for k, (label, run) in enumerate(runs.items()):
        t = run.t.to_value(time) if time else run.times
        look: dict[str, Any] = {"color": style.PALETTE[k % len(style.PALETTE)], "lw": 1.4}
        kept = run.drift()
        energy.plot(t, relative_change(run.energy().value, kept.energy.scale), label=label, **look)
        momentum.plot(t, relative_change(run.angular_momentum().value, kept.angular_momentum.scale), **look)
    for axes, name in ((energy, "energy, |ΔE/E|"), (momentum, "angular momentum, |ΔL|/|L|")):
        axes.set_yscale("log")
        low, high = axes.get_ylim()
        axes.set_ylim(min(low, 2e-17), max(high, 1e-14))
        axes.axhline(2.0**-53, color=style.GREY, lw=1.0, ls=(0, (6, 4)))
        axes.text(0.995, 2.0**-53 * 1.15, "round-off, 2⁻⁵³", transform=axes.get_yaxis_transform(), ha="right",
                  va="bottom", fontsize=11, color=style.GREY)  # fmt: skip
        axes.set_title(name)
        axes.grid(axis="y", color=style.FAINT, lw=0.6)
    unit = time or str(next(iter(runs.values())).system.units.time)
    momentum.set_xlabel(f"time [{unit}]" if unit else "time")
    if len(runs) > 1:
        energy.legend(loc="best", fontsize=12)


def flatness(axes: Axes, t: Array, series: Array, title: str) -> None:
    """Draw how flat a conserved quantity is: each component's change over its size, in units of 10^-16, linear.

    series : (n,) or (n, 3); the band is the rounding of one float64
    """
    values = series.reshape(len(series), -1)
    change = (values - values[0]) / (float(np.linalg.norm(values[0])) or 1.0) * 1e16
    for component, colour in zip(change.T, (style.BLUE, style.VERMILION, style.GREEN), strict=False):
        axes.plot(t, component, color=colour, lw=1.2)
    reach = max(10.0, 1.3 * float(np.abs(change).max()))
    band = 2.0**-53 * 1e16
    axes.axhspan(-band, band, color=style.FAINT, alpha=0.7, lw=0)
    axes.set_ylim(-reach, reach)
    axes.set_title(title)
    axes.set_ylabel("change [10⁻¹⁶]")
    axes.grid(axis="y", color=style.FAINT, lw=0.6)


def relative_change(series: Array, scale: float | None = None, floor: float = 2.5e-17) -> Array:
    """Return |x_k - x_0| / |x_0| of a scalar or vector series, at least `floor` so that zero shows on a log axis.

    scale : compared with in place of |x_0|, which may vanish by cancellation; see `ConservedQuantities`
    """
    values = series.reshape(len(series), -1)
    size = (float(np.linalg.norm(values[0])) if scale is None else scale) or 1.0
    change: Array = np.linalg.norm(values - values[0], axis=1) / size
    return np.maximum(change, floor)


def in_plane(system: System, q: Array) -> Array:
    """Return positions as seen from above: ecliptic coordinates for physical systems, the system's own otherwise."""
    return icrf_to_ecliptic(q) if system.units.is_physical else q


def _finish_map(axes: Axes, system: System) -> None:
    unit = str(system.units.length).replace("AU", "au")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel(f"x [{unit}]" if unit else "x")
    axes.set_ylabel(f"y [{unit}]" if unit else "y")


def _when(system: System) -> str:
    return "" if system.epoch is None else f"{system.epoch.isot[:10]} TDB, seen from the ecliptic's pole"


def osculating_ellipse(system: System, body: str | int) -> Array | None:
    """Return 361 points, as seen from above, of the ellipse that a body osculates about the most massive one.

    None for the most massive body itself and for parabolas and hyperbolas.
    """
    i = body if isinstance(body, int) else system.index(body)
    gms, qs, vs, _ = system.values
    centre = int(np.argmax(gms))
    if i == centre:
        return None
    gm, q, v = float(gms[centre] + gms[i]), qs[i] - qs[centre], vs[i] - vs[centre]
    r, h = float(np.linalg.norm(q)), np.cross(q, v)
    energy = float(v @ v) / 2 - gm / r
    if energy >= 0.0 or not h.any():
        return None
    a = -gm / (2 * energy)
    eccentricity = np.cross(v, h) / gm - q / r
    e = float(np.linalg.norm(eccentricity))
    x = eccentricity / e if e > 1e-12 else q / r
    y = np.cross(h / np.linalg.norm(h), x)
    angle = np.linspace(0.0, 2 * np.pi, 361)[:, None]
    ellipse: Array = a * ((np.cos(angle) - e) * x + np.sqrt(1 - e * e) * np.sin(angle) * y)
    return in_plane(system, qs[centre] + ellipse)


def _turns_slowly(points: Array) -> bool:
    """Whether neighbouring samples lie close enough to be joined by a line: less than 30 degrees apart on average."""
    steps = np.diff(points[:, :2], axis=0)
    turn = np.abs(np.angle(np.exp(1j * np.diff(np.arctan2(steps[:, 1], steps[:, 0])))))
    return bool(np.median(turn) < 0.5)
