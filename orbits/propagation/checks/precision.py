"""What the digits of float64 leave of a run, and what its tolerance left: warnings before it and after it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from orbits import diagnostics
from orbits.diagnostics.drift import kinetic_energies, own_scale
from orbits.errors import InputError, StepWarning, with_unit
from orbits.finding import Finding
from orbits.marching.clocks.adaptive import Adaptive
from orbits.system.derived import derived
from orbits.system.model import acts_on_massive, depends_on_time
from orbits.time_grid import MOST_STEPS, TimeGrid, dynamical_time, fastest_passage_of

if TYPE_CHECKING:
    from orbits.system import System
    from orbits.trajectory import Trajectory

FEW_DIGITS = 1e-9
"""The rounding of positions, as a fraction of a separation, above which a warning is given."""

NEARER = 1e-2
"""The size of a system, as a fraction of its distance from the origin, below which a nearer origin gives digits."""

PHASE = 2e-16
"""The rounding errors of phase, in radians, after n turns without dt, divided by n^(3/2): 1e-13 after a hundred."""

LOST = 0.01
"""The error of phase, in radians, about which a warning is given."""

LOOSE = 10.0
"""The multiple of its default above which a tolerance is held to the energy at the end."""


def check_length(system: System, grid: TimeGrid) -> None:
    """Refuse a run of too many steps, estimated by the dynamical time at its start; warn about one in which rounding
    errors spoil the phase. For clocks whose steps differ.
    """
    shortest = derived(system, dynamical_time)
    steps = abs(grid.end) / shortest
    if not (steps > MOST_STEPS or PHASE * steps**1.5 >= LOST):
        return
    length = with_unit(f"{grid.end:g}", system.units.time)
    if steps > MOST_STEPS:
        raise InputError(
            f"duration is {length}, about {steps:.1g} times the dynamical time of the bodies; at most 2^53 steps are "
            "possible. Use a shorter duration."
        )
    period = fastest_passage_of(system, grid.end)[5]
    turns = abs(grid.end) / (period if 0.0 < period < math.inf else 2.0 * math.pi * shortest)
    phase = PHASE * turns**1.5
    if phase > LOST:
        lost = "leave nothing of its phase" if phase > 1.0 else f"make its phase wrong by about {phase:.1g} rad"
        Finding(
            f"duration is {length}, about {turns:.1g} turns of the fastest pair. Rounding errors alone {lost} by the "
            "end; the shape of its orbit is not concerned. Use a shorter duration if places on orbits matter.",
            kind="phase lost to rounding",
        ).warn()


def warn_if_far(system: System, span: float) -> None:
    """Warn if the bodies are, or within `span` will be, so far from the origin that rounded positions leave few digits
    of their separations, and with the centre of mass as origin would leave many more.
    """
    across, out, fastest = derived(system, _extent)
    if across >= NEARER * (out + abs(span) * fastest):
        return  # the usual case, quickly
    gm, q, v, softening = system.values
    heaviest = int(gm.argmax())
    with np.errstate(over="ignore", invalid="ignore"):
        centre, speed = diagnostics.centre_of_mass(gm, q), diagnostics.centre_of_mass(gm, v)
        away = max(float(np.abs(x).max()) for x in (centre, centre + span * speed))
        apart = np.linalg.norm(np.delete(q, heaviest, axis=0) - q[heaviest], axis=1)
        nearest, size = max(float(apart.min(initial=math.inf)), softening), float(apart.max(initial=0.0))
    if not (math.isfinite(away) and size < NEARER * away):
        return
    rounded = 0.5 * float(np.spacing(away))
    if not rounded > FEW_DIGITS * nearest:
        return
    digits = max(int(math.log10(nearest) - math.log10(rounded)), 0) if nearest > 0.0 else 0
    length = system.units.length
    far, by, closest = (with_unit(f"{x:.2g}", length) for x in (away, rounded, nearest))
    Finding(
        f"the bodies are up to {far} from the origin, where positions are rounded to {by}: a separation of {closest} "
        f"has {digits} digits at the start and in the samples, though the steps between lose none. Put the centre of "
        "mass at the origin and at rest before positions are rounded; system.barycentric() afterwards keeps the digits "
        "that are left.",
        kind="far from the origin",
    ).warn()


def _extent(system: System) -> tuple[float, float, float]:
    """Return the largest coordinate of the bodies relative to the heaviest one, and relative to the origin, and the
    largest component of their velocities.
    """
    gm, q, v, _ = system.values
    return tuple(float(np.abs(x).max()) for x in (q - q[gm.argmax()], q, v))  # type: ignore[return-value]


def energy_lost(run: Trajectory) -> Iterator[Finding]:
    """Find whether a tolerance larger than the default left an error of energy larger than itself."""
    clock, system = run.clock, run.system
    if not isinstance(clock, Adaptive) or len(run) == 0:
        return
    tolerance, usual = clock.tolerance_for(run.integrator), Adaptive().tolerance_for(run.integrator)
    changed = run.changes is not None and run.changes.acted_on_massive
    if tolerance <= LOOSE * usual or changed or acts_on_massive(system) or depends_on_time(system):
        return
    first, last = float(system.energy().value), float(run[-1].energy().value)
    kinetic = float(kinetic_energies(system.values.gm, system.values.v)) / system.units.G
    off = abs(last - first) / own_scale(first, kinetic, lambda: abs(last) or 1.0)
    if off > tolerance:
        yield Finding(
            f"with a tolerance of {tolerance:g}, the energy is wrong by {off:.2g} of itself at the end of the run, and "
            f"orbits with it: steps so long do not resolve the motion. Leave dt out: the default, {usual:.2g}, leaves "
            "only round-off.",
            StepWarning,
            "energy lost",
        )
