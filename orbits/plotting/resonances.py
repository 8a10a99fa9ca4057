"""The angles of mean-motion resonances."""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from orbits.body_names import index_of
from orbits.errors import InputError, shown
from orbits.plotting import style, words
from orbits.plotting.histories import Histories, histories, pieces, primary_of
from orbits.plotting.over_time import about_origin, heading, times_of, years
from orbits.plotting.pictures import counted, looks_of, named_in, there

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from orbits.protocols import Run

Array = NDArray[np.float64]

LEAST_GAP = 20.0
"""An angle that leaves out at least this much of the circle, in degrees, librates in these samples."""

LEAST_SAMPLES = 20
"""Fewer samples do not tell whether an angle librates."""

FAR = 0.15
"""Period ratios that differ by more than this fraction from that of a resonance are not near it."""


def integers_of(resonance: Any) -> tuple[int, int]:
    """Return (p, q) of a resonance given as "3:1", "3/1" or (3, 1).

    Raises InputError for anything but two whole numbers from 1 to 99.
    """
    read = re.fullmatch(r"\s*(\d+)\s*[:/]\s*(\d+)\s*", resonance) if isinstance(resonance, str) else None
    given = [int(part) for part in read.groups()] if read else resonance
    try:
        p, q = given
        if isinstance(p, bool) or isinstance(q, bool) or int(p) != p or int(q) != q:
            raise ValueError
        p, q = int(p), int(q)
    except (TypeError, ValueError):
        p = q = 0
    if not (1 <= p <= 99 and 1 <= q <= 99):
        raise InputError(f"resonance is {shown(resonance)}; expected two whole numbers, such as '3:1' or (3, 1).")
    return p, q


@style.look()
def plot_resonance(
    run: Run,
    *,
    resonance: Any = None,
    planet: str | None = None,
    primary: str | None = None,
    bodies: Sequence[str] | None = None,
    title: str | None = None,
    frame: str | None = None,
) -> Figure:
    """Return a picture of the angles of a mean-motion resonance with a planet: against time, and e cos phi, e sin phi.

    resonance : "3:1" of a body whose year is a third of the planet's; "2:3" of one whose year is three halves of it,
        as Pluto's of Neptune's; "1:1" of a Trojan. With p:q the angle is phi = p L - q l - (p - q) pomega, where L is
        the longitude of the planet, l and pomega those of the body; of 1:1 it is l - L
    planet : the most massive body beside the primary by default
    primary, bodies, title, frame : as in `plot_elements`; all bodies but these two by default

    The legend says for each body about what its angle librates in these samples, and how far, or that it circulates;
    of one that has not turned back, that the samples are too short to tell.
    Raises InputError without a resonance, and for samples too far apart to follow the angle; otherwise as
    `plot_elements`.
    """
    if resonance is None:
        raise InputError("kind='resonance' needs one: give resonance='3:1', say, and planet='Jupiter'.")
    p, q = integers_of(resonance)
    place = primary_of(run, primary, "resonance")
    other = _planet(run, planet, place)
    chosen = [i for i in there(run, bodies) if i not in (place, other)]
    if not chosen:
        raise InputError(
            f"kind='resonance' draws angles of bodies with {run.names[other]}, but no third body is asked for."
        )
    names = ("l", "pomega", "e", "n", "a")
    known = histories(run, [other, *chosen], names, primary=place, frame=frame, kind="resonance")
    near = _near(run, known, p, q)
    left_out = 0
    if bodies is None:  # those that have nothing to do with the resonance only cover the others
        left_out = int((~near).sum())
        kept = [0, *(np.flatnonzero(near) + 1).tolist()]
        chosen, near = [chosen[k - 1] for k in kept[1:]], near[near]
        elements = {name: x[:, kept] for name, x in known.elements.items()}
        known = Histories([other, *chosen], place, elements, known.frame)
    angles = angles_of(known, p, q)
    looks, cloud = looks_of(run.system, chosen)
    t, unit = times_of(run)
    made = style.figure(17, 8.6)
    over, plane = made.subplots(1, 2, width_ratios=[1.7, 1.0])
    low = 0.0 if _around_half(angles) else -180.0
    count = 0
    for k, i in enumerate(chosen):
        phi = np.degrees(angles[:, k])
        shown_phi = (phi - low) % 360.0 + low
        x, y = known["e"][:, k + 1] * np.cos(angles[:, k]), known["e"][:, k + 1] * np.sin(angles[:, k])
        centre, reach = libration(angles[:, k]) if near[k] else (None, 180.0)
        librates = centre is not None and turns_back(angles[:, k])
        count += librates
        if i not in looks:
            dots: dict[str, Any] = {"mew": 0, "color": style.BLUE if librates else style.GREY}
            over.plot(t, shown_phi, ".", ms=2.5 if librates else 1.5, alpha=0.6, zorder=1, **dots)
            plane.plot(x, y, ".", ms=2.5 if librates else 1.5, alpha=0.6, zorder=1, **dots)
            continue
        said = _said(centre, reach, low, librates=librates) if near[k] else "far from the resonance"
        look = {**looks[i], "label": f"{looks[i]['label']}: {said}"}
        if centre is None:
            over.plot(t, shown_phi, ".", ms=3.5, mew=0, alpha=0.7, zorder=2, color=look["color"])
            over.plot([], [], lw=2.5, **look)
        else:
            over.plot(*pieces(t, shown_phi, 360.0), lw=1.1, zorder=3, **look)
        plane.plot(x, y, ".", ms=3, mew=0, color=look["color"])
    if cloud:
        over.plot([], [], ".", ms=8, color=style.GREY, label=counted(run.system, cloud))
    over.set_ylim(low, low + 360.0)
    over.set_yticks(np.arange(low, low + 361.0, 60.0))
    over.set(xlabel=words.since(run.system, unit), ylabel=f"φ = {_formula(p, q)} [°]")
    reach_of_plane = max(1e-12, float(np.nanmax(known["e"][:, 1:]))) * 1.08
    about_origin(plane, reach_of_plane)
    plane.set(xlabel="e cos φ", ylabel="e sin φ")
    for axes in (over, plane):
        axes.grid(color=style.FAINT, lw=0.6)
    years(over, run, t)
    own = f"{p}:{q} with {words.short(run.names[other])}; {heading(run, known)}"
    over.set_title(own if title is None else title)
    told = [f"{count:,} of {len(chosen):,} librate in these samples"] * (len(chosen) > 1)
    told += ["many other bodies: blue where they librate, else grey"] * bool(cloud)
    far = "1 body far from the resonance is" if left_out == 1 else f"{left_out:,} bodies far from the resonance are"
    told += [f"{far} left out"] * bool(left_out)
    style.below(made, *named_in(over), "; ".join([*told, "primed: of the planet"]))
    return made


def angles_of(known: Histories, p: int, q: int) -> Array:
    """Return the angle of the resonance of all bodies but the first, which is the planet, (samples, k), radians."""
    of_planet, longitude, pericentre = known["l"][:, :1], known["l"][:, 1:], known["pomega"][:, 1:]
    if p == q:
        return np.asarray(longitude - of_planet)
    return np.asarray(p * of_planet - q * longitude - (p - q) * pericentre)


def libration(angle: Array) -> tuple[float | None, float]:
    """Return the middle of the arc in which an angle stays, and half of its length, in degrees; None if it goes round.

    It stays in an arc if it leaves out one of `LEAST_GAP` at least, which is no gap between samples of one that goes
    round: several times as long as the next one, in `LEAST_SAMPLES` at least.
    """
    some = np.sort(np.degrees(angle[np.isfinite(angle)]) % 360.0)
    if len(some) < LEAST_SAMPLES:
        return None, 180.0
    gaps = np.diff(np.append(some, some[0] + 360.0))
    widest = int(np.argmax(gaps))
    if gaps[widest] < max(LEAST_GAP, 3.0 * np.sort(gaps)[-2]):
        return None, 180.0
    reach = 0.5 * (360.0 - float(gaps[widest]))
    return float((some[(widest + 1) % len(some)] + reach) % 360.0), reach


def turns_back(angle: Array) -> bool:
    """Return whether an angle goes half of its way, from its least to its largest value, in both directions."""
    followed = np.unwrap(angle[np.isfinite(angle)])
    rise = np.max(followed - np.minimum.accumulate(followed))
    fall = np.max(np.maximum.accumulate(followed) - followed)
    return bool(min(rise, fall) >= 0.5 * np.ptp(followed))


def _said(centre: float | None, reach: float, low: float, *, librates: bool) -> str:
    if centre is None:
        return "circulates"
    middle = f"{(centre - low) % 360.0 + low:.0f}°".replace("-0°", "0°").replace("-", "−")
    arc = f"{middle} ± {reach:.0f}°"
    return f"librates, {arc}" if librates else f"within {arc}, too short to tell"


def _around_half(angles: Array) -> bool:
    """Return whether angles are nearer to 180° than to 0 on the whole, so that 0 ... 360° shows them in one piece."""
    middle = [libration(column)[0] for column in angles.T]
    away = [np.cos(np.radians(one)) for one in middle if one is not None]
    return bool(away) and float(np.mean(away)) < 0.0


def _planet(run: Run, planet: str | None, primary: int) -> int:
    gm = run.system.values.gm.copy()
    if planet is not None:
        place = index_of(planet, run.names, "body", role="planet")
    else:
        gm[primary] = 0.0
        place = int(np.argmax(gm))
    if place == primary or gm[place] <= 0.0:
        raise InputError(
            f"kind='resonance' needs a planet with a mass beside {run.names[primary]}, but "
            f"{'there is none' if planet is None else f'{run.names[place]} is not one'}; give planet=..."
        )
    return place


def _near(run: Run, known: Histories, p: int, q: int) -> NDArray[np.bool_]:
    """Return which bodies are near the resonance, with samples that follow their angle, (k,), without the planet.

    Raises InputError if none is near, and if the samples follow the angle of none.
    """
    with np.errstate(invalid="ignore", divide="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of bodies that are never there
        means = np.nanmedian(np.abs(known["n"]), axis=0)
        slow = np.abs(p * means[0] - q * means[1:])
    if len(run) < 3:
        raise InputError(f"{len(run)} samples show no angle that changes; expected at least 3.")
    ratio = means[1:] / means[0]
    near = np.abs(ratio * q / p - 1.0) < FAR
    if np.isnan(ratio).all():
        raise InputError(
            f"in these samples no body goes round beside {run.names[known.bodies[0]]}; choose another planet=..., or "
            "earlier samples."
        )
    if not near.any():
        closest = int(np.nanargmin(np.abs(ratio * q / p - 1.0)))
        raise InputError(
            f"no body is near the {p}:{q} resonance with {run.names[known.bodies[0]]}: the nearest, "
            f"{run.names[known.bodies[closest + 1]]}, goes round {ratio[closest]:.4g} times in its year, not "
            f"{p / q:.4g} times."
        )
    gap = float(np.max(np.abs(np.diff(run.times))))
    each = gap * slow / (2.0 * np.pi)
    turns = float(np.nanmin(np.where(near, each, np.nan)))
    if turns > 0.5:
        raise InputError(
            f"the samples are {turns:.2g} turns of the angle apart, so that it cannot be followed; take more samples, "
            "or run.at(times)."
        )
    return np.asarray(near & (each <= 0.5))


def _formula(p: int, q: int) -> str:
    if p == q:
        return "λ − λ′"
    order = p - q
    sign, size = ("−", order) if order > 0 else ("+", -order)
    first, second, third = (f"{n}" if n > 1 else "" for n in (p, q, size))
    return f"{first}λ′ − {second}λ {sign} {third}ϖ"
