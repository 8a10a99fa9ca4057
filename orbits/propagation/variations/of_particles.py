"""The growth of tangent vectors along the orbits of thousands of massless particles in a map on Kepler orbits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from orbits.body_names import few
from orbits.checks import whole_number
from orbits.errors import RetiredWarning, StepWarning, counted, with_unit
from orbits.finding import SHOWN, Finding
from orbits.integrators.base import Integrator
from orbits.integrators.forms import Array
from orbits.integrators.maps.encounters import WARN
from orbits.marching.legs.leg import available_threads
from orbits.marching.tangents.of_particles import ParticleTangents, Passages
from orbits.marching.watching.kepler_passages import HILL_RADII
from orbits.propagation.checks.kepler_splitting import encounters, start_near_planets
from orbits.propagation.marchers import bound
from orbits.results.passages import Seen
from orbits.system import System
from orbits.system.model import model
from orbits.time_grid import TimeGrid


class Growths(NamedTuple):
    """The numbers of `TangentGrowth` for m particles.

    megno, spread, lyapunov : (samples, m); passage : (m,), the time of the first passage that the map cannot follow,
        NaN for none
    """

    megno: Array
    spread: Array
    lyapunov: Array
    passage: Array

    @classmethod
    def of(cls, found: Sequence[Array]) -> Growths:
        """Return those of particles of which each has MEGNO, spread and rate, (3, samples), without passages."""
        mean, spread, rate = np.array(found).transpose(1, 2, 0)
        return cls(mean, spread, rate, np.full(len(found), np.nan))


def growths_of_particles(
    system: System, integrator: Integrator, grid: TimeGrid, vectors: Array, scale: float, threads: int | None
) -> Growths:
    """Return the growth of tangent vectors, (count, 2, 3), of each massless particle, among the massive bodies.

    Warns, with `RetiredWarning`, of particles that are lost, and of those retired in encounters if the method asks for
    that: their numbers are NaN from there on; and with `StepWarning` of others with encounters.
    """
    acting, values, massive = model(system), system.values, system.massive
    count = available_threads() if threads is None else whole_number(threads, "threads, if given,")
    bodies, particles = ((values.q[which], values.v[which]) for which in (massive, ~massive))
    march = ParticleTangents(
        acting.lagrangian, acting.vectors, integrator, grid.h, bodies, particles, vectors, scale, count
    )
    shape = len(grid), int((~massive).sum())
    means, spreads, rates = np.full((3, *shape), np.nan)
    out = Growths(means, spreads, rates, np.full(shape[1], np.nan))
    try:
        for sample in range(len(grid)):
            march.advance(grid.place(sample))
            if march.time != 0.0:
                mean, log = march.growth()
                out.megno[sample], out.lyapunov[sample] = _mean(mean), _mean(log) / abs(march.time)
                if len(vectors) > 1:
                    away = (mean - out.megno[sample, :, None]) ** 2
                    out.spread[sample] = np.sqrt(_mean(away) * (len(vectors) / (len(vectors) - 1)))
    finally:
        march.close()
    judge(system, integrator, grid, out, march.passages())
    return out


def passages_of_run(system: System, integrator: Integrator, grid: TimeGrid, threads: int | None) -> Passages:
    """Return the first passages of massless particles that a map on Kepler orbits cannot follow, from a march in
    which none is retired in encounters.
    """
    instead = integrator.in_encounters._replace(particles=WARN)
    method = replace(integrator, encounters=str(instead))  # type: ignore[call-arg]
    march = bound(system, method, grid.clock, threads=threads)
    try:
        march.advance_to(grid.place(len(grid) - 1))
        seen = Seen(system, march.record(float(grid.times[-1])), grid.clock)
    finally:
        march.close()
    light, heavy = np.flatnonzero(~system.massive).tolist(), np.flatnonzero(system.massive).tolist()
    near, planet, sharp = np.full(len(light), np.nan), np.full(len(light), -1), np.full(len(light), np.nan)
    found = [seen.passages[k] for k in encounters(system, method, grid.h, seen)]
    for passage in sorted(found, key=lambda one: -one.steps):  # the first one last
        body, other = sorted((passage.body, passage.other), key=lambda one: float(system.values.gm[one]))
        time = float(grid.clock.time(passage.steps))
        if body in light and other == seen.dominant:
            sharp[light.index(body)] = time
        elif body in light:
            near[light.index(body)], planet[light.index(body)] = time, heavy.index(other)
    return Passages(near, planet, sharp)


def _mean(values: Array) -> Array:
    """Return the means of rows, summed in the same order whatever their number."""
    total = values[:, 0].copy()
    for k in range(1, values.shape[1]):
        total += values[:, k]
    return np.asarray(total / values.shape[1])


def judge(system: System, integrator: Integrator, grid: TimeGrid, out: Growths, passages: Passages) -> None:
    """Write the times of passages, put NaN for what is not known, and warn."""
    names = np.array(system.names, dtype=object)[~system.massive]
    bodies = np.array(system.names, dtype=object)[system.massive]
    retires = integrator.in_encounters.retire_particles
    if retires:  # those that start too close are retired at once, though most have no passage to be seen by
        inside, planet = start_near_planets(system)
        passages.near[inside], passages.planet[inside] = 0.0, planet
    times = np.fmin(abs(passages.near), abs(passages.sharp))
    out.passage[:] = times * grid.direction
    met = np.isfinite(times)
    lost = ~np.isfinite(out.megno[-1]) & (grid.times[-1] != 0.0) & ~(met & retires)
    if retires:
        gone = met & (abs(grid.times[:, None]) > times)
        for values in out[:3]:
            values[gone] = np.nan
    for values in out[:3]:
        values[~np.isfinite(values)] = np.nan
    if lost.any():
        Finding(
            f"the MEGNO of {few(names[lost].tolist(), SHOWN)} is not known from where its motion is no longer finite: "
            "a fall into a body, or a step too long by far.",
            RetiredWarning,
            "MEGNO lost",
        ).warn()
    if not met.any():
        return
    unit, rows, count = system.units.time, [], int(met.sum())
    for k in np.flatnonzero(met)[np.argsort(times[met], kind="stable")][:SHOWN]:
        near = abs(passages.near[k]) == times[k]
        what = (
            f"within {HILL_RADII:.0f} Hill radii of {bodies[passages.planet[k]]}"
            + ("" if times[k] == 0.0 else ", or past it too fast for the step")
            if near
            else f"at a pericentre where a full turn would take fewer than {integrator.least_steps} steps"
        )
        rows.append(f"{names[k]} {what}, at t = " + with_unit(f"{out.passage[k]:.6g}", unit))
    told = f"{counted(count, 'massless particle')} came where {integrator.label}"
    them, their, have = ("it", "its", "has") if count == 1 else ("them", "their", "have")
    if retires:
        told += f" retires {them}, and {have} no MEGNO from there on:"
        Finding(told, RetiredWarning, "MEGNO retired", rows, count - SHOWN).warn()
        return
    told += (
        f" cannot follow {them}: {their} MEGNO is large where the orbit is chaotic, as such orbits mostly are, but its "
        "value from there on is that of the steps:"
    )
    these = "it" if count == 1 else "these"
    remedy = f'Use a smaller dt, another method for {these}, or encounters="retire".'
    Finding(told, StepWarning, "MEGNO of the steps", rows, count - SHOWN, remedy=remedy).warn()
