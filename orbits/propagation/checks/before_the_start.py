"""What is looked at before a run begins: whether its steps resolve what lies ahead. It warns, or refuses the run."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from orbits import integrators
from orbits.body_names import few
from orbits.checks import checked_flag
from orbits.errors import InputError, UnknownNameError, with_unit
from orbits.finding import Finding
from orbits.integrators.base import Integrator
from orbits.point_masses import changed_masses
from orbits.propagation.checks import step_check
from orbits.propagation.checks.precision import warn_if_far
from orbits.propagation.checks.rigid_runs import is_rigid, turning_fast
from orbits.system.model import most_inner
from orbits.system.model_text import require_known

if TYPE_CHECKING:
    from orbits.propagation.events.base import Touching
    from orbits.propagation.events.seeking import Seeking
    from orbits.system import System
    from orbits.time_grid import TimeGrid

REFUSE = "refuse"

RELATIVITY = "post-newtonian", "nobili-roxburgh"
"""The kinds of terms that are relativity."""


def checked_answer(check_step: Any) -> bool | str:
    """Return True, False or "refuse" as it was given. Raises InputError for anything else."""
    if isinstance(check_step, str) and check_step == REFUSE:
        return check_step
    return checked_flag(check_step, "check_step", f"True (warn), False or {REFUSE!r}")


def check_bodies(system: System, integrator: Integrator) -> None:
    """Raise InputError, naming them, for bodies and terms that a method on Kepler orbits cannot take."""
    if integrator.follows_kepler:
        from orbits.propagation.checks import kepler_splitting

        kepler_splitting.require_outside(system)
        kepler_splitting.require_terms_of_dominant(system, integrator)


def check_archived(system: System, integrator: Integrator) -> None:
    """Raise InputError for a method, terms or forces that are not of the package: archives find them by name."""
    require_known(system, "archive=")
    try:
        known = integrators.build(integrators.describe(integrator)) == integrator
    except UnknownNameError:
        known = False
    if not known:
        raise InputError(
            f"archive= finds methods by name among those of the package, where {integrator.label} "
            f"({integrator.name!r}) is not. Leave it out, which keeps the run in memory, or put the file of the method "
            "into orbits/integrators/."
        )


def check_what_is_kept(system: System, integrator: Integrator, seeking: Seeking, *, dense: bool) -> None:
    """Raise InputError for dense output and events of a run whose steps, as they are kept and searched, do not tell all
    of its motion.
    """
    if not (dense or system.forces):
        return
    if dense and seeking.touching:
        raise InputError(
            "dense=True keeps the steps of the same bodies from start to end, but they may collide; leave it out: "
            "run.at(times) marches on from the preceding sample, through the collisions."
        )
    if dense and integrator.in_encounters.follow_planets:
        raise InputError(
            "dense=True keeps the steps of one method, but where planets are followed, encounters take others; leave "
            "it out: run.at(times) marches on from the preceding sample, through the encounters. Where massless "
            "particles alone may be in encounters, encounters='follow particles' has dense output."
        )
    on_motion = [type(seeking.asked.of[k]).__name__ for k in seeking.asked.on_motion]
    if most_inner(system) and (dense or on_motion):
        kinds = [*dict.fromkeys(type(force).__name__ for force in system.forces if force.variables)]
        those, change = " and ".join(kinds), "changes" if len(kinds) == 1 else "change"
        known = "a spin as well, or other internal variables"
        if is_rigid(system):
            those, change, known = "rigid bodies", "have", "attitudes and spins as well"
        what, remedy = "dense=True keeps", (
            "leave it out: run.at(times) marches on from the preceding sample, with what it is there."
        )
        if not dense:
            what = "events are sought from"
            remedy = f"leave out {few([*dict.fromkeys(on_motion)])}, or {those}."
        raise InputError(
            f"{what} positions and velocities, but {those} {change} {known}; {remedy}"
        )
    if dense and any(search.interrupts for search in seeking.particles):
        raise InputError(
            "dense=True keeps the steps of a run that goes on, but events of massless bodies with then='stop' end it "
            "between samples; leave one of the two out: run.at(times) marches on from the preceding sample."
        )


def check_span(system: System, grid: TimeGrid) -> None:
    """Raise EpochError, naming the term, if one does not describe the motion until the end of a run, and InputError,
    naming the body, if a force has taken all of its mass by then, or at the start.
    """
    for term in system.terms:
        term.check_span(grid.end, system.units)
    nominal = system.values.gm
    for force, time in product(system.forces, (0.0, grid.end)):
        # What one force takes is felt by its bodies alone, what others take by all: here all feel both.
        felt = [replace(other, bodies=None) for other in system.forces if other is force or other.bodies is None]
        gm = changed_masses(time, felt, nominal, system.names, system.units)
        gone = np.flatnonzero((gm <= 0.0) & (nominal > 0.0))
        if len(gone):
            name, left = system.names[gone[0]], with_unit(f"{gm[gone[0]]:.6g}", system.units.gm)
            when = with_unit(f"{time:g}", system.units.time)
            raise InputError(
                f"{type(force).__name__}: gm of {name!r} would be {left} at t = {when}; expected mass to be left: make "
                "the run shorter, or begin the loss nearer to it."
            )


def check_once(system: System) -> None:
    """Raise InputError for a body with a J2 or C22 by two terms, or by a term and as a rigid body, and for one with
    relativity by two terms.
    """
    acting: list[tuple[Any, str, str]] = []
    for term in system.terms:
        for what in ("J2", "C22"):
            if getattr(term, what, 0.0) != 0.0:
                acting.append((term.body, f"has a {what}", type(term).__name__))
        if term.kind in RELATIVITY:
            of = getattr(term, "sources", None) or (system.names if term.body is None else [term.body])
            acting += [(name, "has relativity", type(term).__name__) for name in of]
    for force in system.forces:
        for name, (A, B, C) in zip(force.bodies or (), getattr(force, "moments", ()), strict=False):  # of rigid bodies
            figure = {"has a J2": not A == B == C, "has a C22": A != B}
            acting += [(name, what, "RigidBody") for what, there in figure.items() if there]
    found: dict[tuple[Any, str], str] = {}
    for name, what, kind in acting:
        earlier = found.setdefault((name, what), kind)
        if earlier != kind:
            raise InputError(
                f"{name!r} {what} twice, by {earlier} and by {kind}; expected one of them, as they add up. Leave the "
                "other one out: system.replaced(terms=[...])."
            )


def check_before_start(
    system: System, integrator: Integrator, grid: TimeGrid, check_step: Any, touching: Collection[Touching] = ()
) -> None:
    """Warn of what the steps of a run do not resolve, or refuse the run, or do neither, as `check_step` says.

    Raises InputError for another `check_step`, and with "refuse" for all that is a `StepWarning` with True.
    """
    if checked_answer(check_step):
        warn_if_far(system, grid.end)
    check_span(system, grid)
    check_once(system)
    warn_or_refuse(found_ahead(system, integrator, grid, touching), check_step)


def found_ahead(
    system: System, integrator: Integrator, grid: TimeGrid, touching: Collection[Touching] = ()
) -> Iterator[Finding]:
    """Find what steps of one length do not resolve; touching : see `step_check.too_long`."""
    if grid.clock.changes:
        return
    if integrator.follows_kepler:
        from orbits.propagation.checks.kepler_splitting import unfit

        yield from unfit(system, integrator, grid.h, grid.end)
    else:
        yield from step_check.too_long(system, integrator, grid.h, grid.end, touching)
    yield from turning_fast(system, grid.h)


def warn_or_refuse(found: Iterable[Finding], check_step: Any) -> None:
    """Warn of what is found, if `check_step` is True; with "refuse" raise InputError with all of it."""
    answer = checked_answer(check_step)
    if answer == REFUSE:
        if texts := [str(finding) for finding in found]:
            raise InputError("\n".join([*texts, f"This is refused by check_step={REFUSE!r}."]))
    elif answer:
        for finding in found:
            finding.warn()
