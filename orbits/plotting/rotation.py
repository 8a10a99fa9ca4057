"""Pictures of how a rigid body turns: libration, rotation rate, obliquity, and the path of its axis among the stars."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from orbits.body_names import few, orbited
from orbits.errors import InputError
from orbits.plotting import style, words

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from orbits.protocols import Run

Array = NDArray[np.float64]

CIRCLES = (30, 60, 90, 120, 150, 180)
"""Angles from the pole of the orbit that are drawn, in degrees."""

LABELLED = 120
"""The largest of them that has room for a label."""

NEAR = 0.35
"""The longest way between two samples that is drawn as a line, on a map of radius 2."""

TINY = 1e-300
"""Instead of 0 in a denominator."""

CAPTION = (
    "Libration: how far axis 1 is ahead of the direction to {about}, in the equator of {body}. Rotation: the angular "
    "velocity in units of the mean motion n about {about} at the start. Right: all directions of space, in an "
    "equal-area projection about the pole of the orbit at the start, with the path of axis 3 from the circle on; the "
    "rim is the opposite pole."
)


@style.look()
def plot_rotation(
    run: Run, body: str | None = None, *, about: str | None = None, title: str | None = None
) -> Figure:
    """Return a picture of a rigid body's rotation: libration angle, rate and obliquity against time, and the path of
    its axis 3 among the stars.

    body : its name; may be left out if only one is rigid
    about : the body that it orbits; by default the heaviest of the others
    Raises InputError for a run without samples, and as `run.rotation.attitude` and `run.rotation.obliquity` do.
    """
    if not len(run):
        raise InputError(f"{run!r} has no samples yet, so nothing can be drawn; expected at least one.")
    system, name = run.system, _rigid(run, body)
    primary, pole, n = _orbit(run, name, about)
    made = style.figure(17, 8.6)
    mosaic: Any = [["libration", "sky"], ["rate", "sky"], ["obliquity", "sky"]]
    axes = made.subplot_mosaic(mosaic, width_ratios=[1.25, 1.0])
    factor, unit = words.fitting_time(float(np.abs(run.times).max()), system.units.time)
    t = run.times * factor
    rate = run.rotation.rate(name).value / (n or 1.0)
    whole = f"rotation rate [{run.system.units.rate}]"
    panels = {
        "libration": ("libration angle [deg]", _unbroken(run.rotation.libration_angle(name, primary).value)),
        "rate": ("rotation rate / n" if n else whole, rate),
        "obliquity": ("obliquity [deg]", run.rotation.obliquity(name, primary).value),
    }
    for k, (key, (label, values)) in enumerate(panels.items()):
        style.line(axes[key], t, values, color=style.PALETTE[k], lw=1.3)
        axes[key].set_title(label)
        axes[key].grid(axis="y", color=style.FAINT, lw=0.6)
        axes[key].margins(x=0.01)
    if n:
        axes["rate"].axhline(1.0, color=style.GREY, lw=1.0, ls=(0, (6, 4)))
    tilted = max(1.0, float(np.nanmax(panels["obliquity"][1], initial=0.0)))
    axes["obliquity"].set_ylim(-0.04 * tilted, 1.05 * tilted)
    if float(np.nanmax(np.abs(panels["libration"][1]), initial=0.0)) > 90.0:
        axes["libration"].set_yticks([-180, -90, 0, 90, 180])
    axes["obliquity"].set_xlabel(words.since(system, unit))
    for key in ("libration", "rate"):
        axes[key].tick_params(labelbottom=False)
    _draw_sky(made, axes["sky"], run, name, pole, (t, unit))
    head = f"where {words.short(name)} points its axis 3" if title is None else title
    axes["sky"].set_title(head)
    about, body = (words.literal(words.in_prose(one)) for one in (primary, name))
    style.below(made, [], [], CAPTION.format(about=about, body=body))
    return made


def _rigid(run: Run, body: str | None) -> str:
    """Return the name of the body that is drawn. Raises InputError if it is not said, and several are rigid."""
    rigid = list(run.system.rigid)
    if body is not None:
        return run.system.names[run.system.index(body)]
    if not rigid:
        raise InputError("no body is rigid in this run, so no rotation can be drawn; see system.with_rigid(...).")
    if len(rigid) > 1:
        raise InputError(f"a picture of a rotation is that of one body: give body=..., one of {few(rigid)}.")
    return rigid[0]


def _orbit(run: Run, body: str, about: str | None) -> tuple[str, Array, float]:
    """Return the name of the primary, the pole of the orbit at the start and its mean motion, 0 if it is open."""
    system, gm = run.system, run.system.values.gm
    i, j = orbited(system.names, gm, body, about)
    x, v = system.values.q[i] - system.values.q[j], system.values.v[i] - system.values.v[j]
    mu, normal = float(gm[i] + gm[j]), np.cross(x, v)
    inverse = 2.0 / np.linalg.norm(x) - float(v @ v) / mu
    return system.names[j], normal / np.linalg.norm(normal), float(np.sqrt(mu * inverse**3)) if inverse > 0.0 else 0.0


def _unbroken(angles: Array) -> Array:
    """Return angles with NaN where they leave at one end and come back at the other, so that no line crosses."""
    out = np.array(angles)
    out[1:][np.abs(np.diff(angles)) > 180.0] = np.nan
    return out


def _draw_sky(made: Figure, axes: Axes, run: Run, body: str, pole: Array, time: tuple[Array, str]) -> None:
    """Draw the path of axis 3 in an equal-area projection about a pole."""
    third = run.rotation.attitude(body, matrix=True)[:, :, 2]
    east = np.cross([0.0, 0.0, 1.0] if abs(pole[2]) < 0.99 else [1.0, 0.0, 0.0], pole)
    east = east / np.linalg.norm(east)
    z = third @ pole
    x, y = third @ east, third @ np.cross(pole, east)
    across = np.hypot(x, y)
    y = np.where((across == 0.0) & (z < 0.0), 1.0, y)  # the opposite pole is the whole rim; here it is above
    scale = np.where(
        z > 0.0, np.sqrt(2.0 / (1.0 + np.maximum(z, 0.0))), np.sqrt(2.0 * (1.0 - z)) / np.maximum(np.hypot(x, y), TINY)
    )
    x, y = scale * x, scale * y
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    for angle in CIRCLES:
        radius = 2.0 * np.sin(np.radians(angle) / 2.0)
        look: dict[str, Any] = {"color": style.GREY if angle in (90, 180) else style.FAINT, "lw": 1.0}
        axes.plot(radius * np.cos(turn), radius * np.sin(turn), **look)
        if angle <= LABELLED:
            style.halo(axes.text(0.0, -radius, f"{angle}°", ha="center", va="center", fontsize=12, color=style.GREY))
    near = np.hypot(np.diff(x), np.diff(y)) < NEAR
    line_x, line_y = (np.where(near, part[1:], np.nan) for part in (x, y))
    axes.plot(line_x, line_y, color=style.GREY, lw=0.4, alpha=0.7, zorder=2)
    dots = axes.scatter(x, y, c=time[0], s=9, cmap="viridis", lw=0, zorder=3)
    axes.plot(x[0], y[0], "o", ms=9, mfc="white", mec=style.INK, zorder=4)
    made.colorbar(dots, ax=axes, shrink=0.72, label=f"time [{time[1]}]" if time[1] else "time")
    axes.set_aspect("equal")
    axes.axis("off")
