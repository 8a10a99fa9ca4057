"""The picture of target planes: a planet, the disc of what hits it, and where a body passes, with its uncertainty."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u

from orbits.plotting import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SIGMAS = (1.0, 2.0, 3.0)
SMALL = 0.02
"""Below this size relative to the whole, the ellipses have a panel of their own."""


@style.look()
def of_target_planes(planes: Mapping[str, Any]) -> Figure:
    """Return a picture of some orbits on the target plane of one planet: all of it, and the ellipses enlarged.

    planes : of `orbits.target_plane`, by their labels; the first one is the centre of the enlarged part
    """
    first = next(iter(planes.values()))
    known = [one for one in planes.values() if one.matrix is not None]
    width = max((float(one.ellipse()[0].value) for one in known), default=0.0)
    apart = max(np.hypot((one.xi - first.xi).value, (one.zeta - first.zeta).value) for one in planes.values())
    whole = max(float(x.value) for one in planes.values() for x in (one.b, one.capture_radius))
    close = 0.0 < max(width, apart) < SMALL * whole * 10.0
    figure = style.figure(16.0 if close else 9.0, 8.0)
    panels = figure.subplots(1, 1 + close, squeeze=False)[0]
    _whole(panels[0], first, planes)
    if close:
        _enlarged(panels[1], first, planes)
    kind = "target plane" if first.v_infinity is not None else "modified target plane"
    figure.suptitle(f"{first.body} on the {kind} of {first.planet}, {first.date.iso[:10]}", fontweight="bold")
    return figure


def _whole(axes: Axes, first: Any, planes: Mapping[str, Any]) -> None:
    from matplotlib.patches import Circle

    colour = style.BODY_COLOURS.get(first.planet, style.BLUE)
    radius, capture = (float(x.value) for x in (first.radius, first.capture_radius))
    axes.add_patch(Circle((0.0, 0.0), radius, color=colour, lw=0, alpha=0.85))
    axes.add_patch(Circle((0.0, 0.0), capture, fill=False, ec=colour, lw=1.4, ls="--"))
    axes.annotate(
        f"what comes here hits: b < {capture:,.0f} km", (0.0, -capture), (0, -6), textcoords="offset points",
        ha="center", va="top", color=colour, fontsize=12,
    )  # fmt: skip
    for k, (name, one) in enumerate(planes.items()):
        _draw(axes, one, style.PALETTE[(k + 1) % len(style.PALETTE)], name, 0.0, 0.0)
    reach = 1.25 * max(capture, *(float(np.abs(x.value)) for one in planes.values() for x in (one.xi, one.zeta)))
    axes.set_xlim(-reach, reach)
    axes.set_ylim(-reach, reach)
    axes.set_aspect("equal")
    axes.set_xlabel("ξ [km]")
    axes.set_ylabel("ζ [km], later arrivals above")
    axes.legend(loc="upper right")


def _enlarged(axes: Axes, first: Any, planes: Mapping[str, Any]) -> None:
    x, y = float(first.xi.value), float(first.zeta.value)
    for k, (name, one) in enumerate(planes.items()):
        _draw(axes, one, style.PALETTE[(k + 1) % len(style.PALETTE)], name, x, y)
    axes.set_xlabel(f"ξ from {x:,.1f} km [km]")
    axes.set_ylabel(f"ζ from {y:,.1f} km [km]")
    known = any(one.matrix is not None for one in planes.values())
    axes.set_title("enlarged" + ": ellipses of one, two, three sigmas" * known)
    axes.axis("equal")


def _draw(axes: Axes, one: Any, colour: str, name: str, x: float, y: float) -> None:
    from matplotlib.patches import Ellipse

    place = float(one.xi.to_value(u.km)) - x, float(one.zeta.to_value(u.km)) - y
    axes.plot(*place, "o", ms=5, color=colour, label=name)
    for sigmas in SIGMAS if one.matrix is not None else ():
        large, small, angle = (float(part.value) for part in one.ellipse(sigmas))
        axes.add_patch(Ellipse(place, 2.0 * large, 2.0 * small, angle=angle, fill=False, ec=colour, lw=1.2))
