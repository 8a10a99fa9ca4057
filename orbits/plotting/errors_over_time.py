"""How errors grow: energy, angular momentum and positions against time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError, shown
from orbits.plotting import style, words
from orbits.plotting.over_time import times_of, years
from orbits.plotting.pictures import (
    OF_ROUNDING,
    ROUNDING,
    counted,
    down_to_rounding,
    looks_of,
    named_in,
    relative_change,
    there,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from orbits.protocols import Run

Array = NDArray[np.float64]

SLOPES = "dotted: growth as √t, as of unbiased rounding (Brouwer's law), and as t"

OF_POSITIONS = "of positions as t, as of a symplectic method, as t^(3/2), as of unbiased rounding, and as t²"

THICK = "thick: the largest so far"

FLOOR = 2.5e-17

MOST_EVENTS = 100
"""The most events that are marked."""


@style.look()
def plot_error(
    run: Run,
    *,
    reference: Any = None,
    bodies: Sequence[str] | None = None,
    title: str | None = None,
) -> Figure:
    """Return a picture of the growth of errors, on logarithmic axes: of energy and angular momentum, and of positions
    where they are known.

    reference : a more accurate `Trajectory` with the same bodies at the same times, from which the positions depart;
        by default the error bars of the run, if it has some (`error_estimate=True`, or after `run.error_estimate()`)
    bodies, title : as in `plot_trajectory`

    Raises InputError for a run without samples after its start, a reference of other bodies or times, and a run of
    which no energy, angular momentum or error bars are known.
    """
    chosen = there(run, bodies)
    later = np.flatnonzero(run.times != 0.0)
    if len(later) < 2:
        count = f"{len(later)} sample{'s' * (not len(later))}"
        raise InputError(f"{run!r} has {count} after its start; expected at least 2 to show a growth.")
    later = later[np.argsort(np.abs(run.times[later]), kind="stable")]  # samples may be in any order
    positions, whose = _positions(run, reference)
    series = _conserved(run)
    if positions is None and not series:
        raise InputError(
            f"kind='error' has nothing to draw: {_why_not(run)}, and no errors of positions are known; call "
            "run.error_estimate() first, or give reference=..."
        )
    t, unit = times_of(run)
    t = np.abs(t[later])
    made = style.figure(17 if positions is not None and series else 11, 8.6)
    panels = made.subplots(1, int(bool(series)) + int(positions is not None), squeeze=False)[0].tolist()
    told: list[str] = []
    if series:
        axes = _logarithmic(panels.pop(0))
        for (name, values), colour in zip(series.items(), (style.BLUE, style.VERMILION), strict=False):
            change = np.abs(values[later])
            axes.plot(t, change, lw=0.7, alpha=0.45, color=colour)
            size = name.replace("ΔE/|E|", "|ΔE/E|")
            axes.plot(t, np.maximum.accumulate(change), lw=2.2, color=colour, label=size)
        down_to_rounding(axes)
        end = float(np.abs(next(iter(series.values()))[later]).max())
        _slopes(axes, t, end, (0.5, 1.0))
        axes.set_title("energy and angular momentum")
        axes.set_ylabel("relative change")
        told += [THICK, OF_ROUNDING, *[SLOPES] * (end > 0.0)]
    if positions is not None:
        axes = _logarithmic(panels.pop(0))
        told += _draw_positions(axes, run, positions[later], chosen, t)
        axes.set_title(f"positions: {whose}")
        length = str(run.system.units.length).replace("AU", "au")
        axes.set_ylabel(f"distance [{length}]" if length else "distance")
    for axes in made.axes:
        axes.set_xlabel(words.since(run.system, unit, backwards=run.times[later[-1]] < 0.0))
    made.suptitle(words.made_by(run) if title is None else title, x=0.01, ha="left", fontsize=17)
    named = [pair for axes in made.axes for pair in zip(*named_in(axes), strict=True)]
    style.below(made, [handle for handle, _ in named], [label for _, label in named], "; ".join(told))
    return made


@style.look()
def plot_energy(run: Run, *, title: str | None = None) -> Figure:
    """Return a picture of the changes of energy and angular momentum since the first sample, with their signs, as
    fractions: whether they oscillate, drift, or wander.

    Raises InputError for a run without samples, and where neither is conserved.
    """
    if not len(run):
        raise InputError(f"{run!r} has no samples yet, so there is nothing to draw; expected at least one.")
    series = _conserved(run)
    if not series:
        raise InputError(f"kind='energy' has nothing to draw: {_why_not(run)}.")
    t, unit = times_of(run)
    made = style.figure(15, 2.0 + 3.8 * len(series))
    panels = made.subplots(len(series), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (name, values), colour in zip(panels, series.items(), (style.BLUE, style.VERMILION), strict=False):
        reach = max(float(np.abs(values).max()), ROUNDING)
        power = int(np.floor(np.log10(reach)))
        style.line(axes, t, values / 10.0**power, lw=1.2, color=colour)
        rounding = ROUNDING / 10.0**power
        axes.axhspan(-rounding, rounding, color=style.FAINT, lw=0, zorder=0)
        if not (values < 0.0).any():  # a length
            axes.set_ylim(bottom=-0.02 * reach / 10.0**power)
        axes.set_title(name)
        axes.set_ylabel(f"change [{words.power_of_ten(power)}]" if power else "change")
        axes.grid(color=style.FAINT, lw=0.6)
        far = int(np.abs(run.times).argmax())  # samples may be in any order
        for event in run.events[:MOST_EVENTS]:
            place = float(event.time.value) * (t[far] / run.times[far] if run.times[far] else 1.0)
            axes.axvline(place, color=style.GREY, lw=0.6, alpha=0.5, zorder=0)
    panels[-1].set_xlabel(words.since(run.system, unit))
    years(panels[0], run, t)
    made.suptitle(words.made_by(run) if title is None else title, x=0.01, ha="left", fontsize=17)
    told = ["grey band: 2⁻⁵³, the rounding of one float64"]
    told += ["of the massive bodies"] if not run.system.massive.all() else []
    first = f", the first {MOST_EVENTS} of {len(run.events):,}" * (len(run.events) > MOST_EVENTS)
    told += [f"thin upright lines: events{first}"] if len(run.events) else []
    style.below(made, [], [], "; ".join(told))
    return made


def _logarithmic(axes: Axes) -> Axes:
    axes.set(xscale="log", yscale="log")
    axes.grid(color=style.FAINT, lw=0.6)
    return axes


def _conserved(run: Run) -> dict[str, Array]:
    """Return the relative changes, with signs, of what is conserved: of energy, and of angular momentum the length of
    the vector of changes.
    """
    drift = run.drift()
    energy, moment, _ = run.conserved()
    found: dict[str, Array] = {}
    if not np.isnan(drift.energy.max_fraction) and drift.energy.scale:
        found["energy, ΔE/|E|"] = (energy[1:] - energy[0]) / drift.energy.scale
    if not np.isnan(drift.angular_momentum.max_fraction) and drift.angular_momentum.scale:
        found["angular momentum, |ΔL|/|L|"] = relative_change(moment, drift.angular_momentum.scale)[1:]
    return found


def _why_not(run: Run) -> str:
    drift = run.drift()
    return "; ".join([*drift.remarks, f"energy and angular momentum are those {drift.covers}"])


def _positions(run: Run, reference: Any) -> tuple[Array | None, str]:
    """Return how far positions may be, or are, from where they should be, (samples, bodies), and by what."""
    if reference is None:
        if run.error_bars is None:
            return None, ""
        return np.asarray(run.error_bars.position.value), "error bars of this run"
    if not all(hasattr(reference, name) for name in ("names", "times", "q", "integrator")):
        raise InputError(f"reference is {shown(reference)}; expected a Trajectory of the same bodies and times.")
    same = {
        "bodies": reference.names == run.names,
        "unit of time": reference.system.units.time == run.system.units.time,
        "epoch": reference.system.epoch == run.system.epoch,
        "sample times": np.array_equal(reference.times, run.times),
    }
    other = [what for what, equal in same.items() if not equal]
    if other:
        raise InputError(
            f"the reference differs from this run in {' and '.join(other)}; expected the same. Propagate the same "
            "system to the same samples, with a finer step or another method."
        )
    apart = np.linalg.norm(reference.q.to_value(run.system.units.length) - run.q.value, axis=2)
    return apart, f"distance from {words.method_words(reference.integrator.label)}"


def _draw_positions(axes: Axes, run: Run, errors: Array, chosen: Sequence[int], t: Array) -> list[str]:
    """Draw the errors of positions, and return the meaning of the lines."""
    looks, cloud = looks_of(run.system, list(chosen))
    told = []
    if cloud:
        values = errors[:, cloud]
        with np.errstate(all="ignore"):
            low, middle, high = np.nanpercentile(np.where(np.isfinite(values), values, np.nan), (5, 50, 95), axis=1)
        axes.fill_between(t, np.maximum(low, FLOOR), np.maximum(high, FLOOR), color=style.FAINT, lw=0, zorder=0)
        axes.plot(t, np.maximum(middle, FLOOR), color=style.GREY, label=f"{counted(run.system, cloud)}, median")
        told.append(f"grey band: nine tenths of the {counted(run.system, cloud)}")
    largest = 0.0
    for i in chosen:
        if i in looks:
            values = np.where(np.isfinite(errors[:, i]), errors[:, i], np.nan)
            style.line(axes, t, np.where(values > 0.0, values, np.nan), lw=1.1, **looks[i])
            largest = max(largest, float(np.nanmax(values, initial=0.0)))
    _slopes(axes, t, largest, (1.0, 1.5, 2.0))
    return [*told, OF_POSITIONS]


def _slopes(axes: Axes, t: Array, end: float, powers: Sequence[float]) -> None:
    """Draw lines of growth by powers of the time up to a value at the end."""
    if not end > 0.0:
        return
    low, high = axes.get_ylim()
    for power in powers:
        axes.plot(t, end * (t / t.max()) ** power, ls=":", lw=1.6, color=style.GREY, zorder=0)
    axes.set_ylim(low, high)
