"""`compare`: our methods and REBOUND's on one problem, sampled at the same times, measured by the same functions."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from orbits import integrators as methods
from orbits.errors import InputError, IntegrationError, Interrupted
from orbits.propagation import propagate
from orbits.regression import peers
from orbits.regression import tolerances as bounds
from orbits.regression import yardstick as rod
from orbits.regression.invariants import Invariants
from orbits.regression.problem import Problem, Sampled, time_axis
from orbits.report import Report, Row, YardstickNote
from orbits.system import System

if TYPE_CHECKING:
    from astropy.units import Quantity

    from orbits.trajectory import Trajectory

Array = NDArray[np.float64]

EXACT_SOLVES = 200_000
"""With yardstick="auto" the exact solution is used up to this many bodies times samples (some 20 s)."""

_YARDSTICKS = ("auto", "exact", "step-halved", "none")
_WARM_UP_STEPS = 3


def compare(
    system: System,
    integrators: Any,
    *,
    dt: Quantity | float,
    duration: Quantity | float,
    samples: Any = 101,
    against: str | Sequence[str] = ("whfast", "ias15"),
    tolerances: Mapping[str, Any] | None = None,
    yardstick: str | Quantity | float = "auto",
    title: str | None = None,
    threads: int | None = None,
    progress: bool | None = None,
) -> Report:
    """Run our methods and REBOUND's from the same floats, at the same step, and judge ours.

    integrators : one of ours or several, such as `[orbits.Gauss(stages=8), "stormer-verlet"]`
    dt, duration, samples, threads : as in `propagate`. dt is also the step of the fixed-step peers, to the bit, and the
        first that IAS15 tries; every method is sampled at the same times
    against : names of peers: "whfast", "whfast-corrector17", "whfast-heliocentric", "ias15", "leapfrog"; may be empty
    tolerances : what ours must keep, as largest values over the samples: {"energy": 1e-12, "angular_momentum": 1e-14,
        "position_km": 1.0}; positions also by body, {"position_km": {"Mercury": 0.1, "particles": 100}}, or as a length
        in the system's unit, {"position": 1e-9}; for one method alone, {"gauss": {"energy": 1e-13}}
    yardstick : what positions are measured against. "auto": the exact solution where there is one, otherwise
        "step-halved": Gauss collocation with 8 stages at dt/2 and at dt/4, the finer being the yardstick and the
        largest difference between the two its own error, which is printed. A time is the coarser of the two steps
        instead of dt/2. "exact" insists on the exact solution; "none" measures no positions
    title : heads the table and the picture
    progress : True, False or None (on a terminal): says on stderr which run is under way

    Wall times are of integration alone. Ours are compiled beforehand in a run of a few steps, whose time is the column
    "compile s"; for the peers it is the time inside REBOUND's integrating calls, without setting up and copying out.

    Returns a `Report`; its `ok` is False when one of ours exceeds a tolerance or fails. A method that fails, or a peer
    that cannot do the problem, has a row that says why.
    Raises InputError and its kin for a wrong use, before the long runs; IntegrationError when all of ours fail;
    Interrupted for Ctrl-C.
    """
    ours = _ours(integrators)
    theirs = [peers.lookup(name) for name in ([against] if isinstance(against, str) else against)]
    problem = Problem.of(system)
    _check(yardstick, samples, problem)
    wanted = bounds.parse(
        tolerances,
        methods=[(method.name, method.label) for method in ours],
        names=problem.names,
        massive=problem.massive_names,
        units=system.units,
        unit_of_report=problem.length,
    )
    say = _teller(progress)
    try:
        attempts = [_attempt(system, method, dt, duration, samples, threads, progress, say) for method in ours]
        grid = _grid(attempts)
        reference = _reference(system, problem, grid, yardstick, threads, say)
        others = [_peer(problem, peer, grid, say) for peer in theirs]
    except KeyboardInterrupt:
        raise Interrupted("stopped by Ctrl-C; nothing was compared.") from None
    invariants = Invariants(problem.gm, problem.q, problem.v, problem.softening)
    rod_q, rod_note, rod_remark = reference
    rows = [
        _judged(attempt.sampled.measured(problem, invariants, rod_q), bound, rod_note, problem)
        for attempt, bound in zip(attempts, wanted, strict=True)
    ]
    rows += [other.measured(problem, invariants, rod_q) for other in others]
    times, time_unit = time_axis(grid.times, _in_days(system))
    return Report(
        rows=tuple(rows),
        times=times,
        time_unit=time_unit,
        length_unit=problem.length_unit,
        names=problem.names,
        massive=problem.massive_names,
        followed="worst of the massive bodies" if np.count_nonzero(problem.massive) > 1 else "worst of the bodies",
        yardstick=rod_note,
        settings=_settings(system, problem, grid, ours, tolerances, title),
        notes=(*invariants.notes, *rod_remark),
    )


@dataclass(frozen=True)
class _Grid:
    """The times of all samples since the epoch, and the step that was taken, as floats in the system's unit of time."""

    times: Array
    dt: float


@dataclass(frozen=True)
class _Attempt:
    sampled: Sampled
    run: Trajectory | None
    error: IntegrationError | None


_Say = Callable[[str], None]


def _ours(integrators: Any) -> list[Any]:
    several = list(integrators) if isinstance(integrators, list | tuple) else [integrators]
    if not several:
        raise InputError("no integrator to compare; give one, such as orbits.Gauss(stages=8), or a list of them.")
    out = [methods.parse(method) if isinstance(method, str) else method for method in several]
    known = tuple(methods.registry().values())
    for method in out:
        if not isinstance(method, known):
            names = ", ".join(kind.__name__ for kind in known)
            raise InputError(f"{method!r} is no integrator; expected one of {names}.")
    labels = [method.label for method in out]
    for label in labels:
        if labels.count(label) > 1:
            raise InputError(f"{label} is compared twice; give each method once.")
    return out


def _check(yardstick: Any, samples: Any, problem: Problem) -> None:
    if isinstance(yardstick, str) and yardstick not in _YARDSTICKS:
        raise InputError(f"yardstick is {yardstick!r}; expected {', '.join(_YARDSTICKS)} or a step (a time).")
    exact = rod.exact_applies(problem.gm, problem.q, problem.v, problem.softening)
    if isinstance(yardstick, str) and yardstick == "exact" and not exact:
        raise InputError(
            "yardstick='exact' needs one massive body with massless ones, or two massive bodies alone, without "
            "softening; this system has no exact solution. Use 'auto' or 'step-halved'."
        )
    if np.size(samples) == 0 or (np.ndim(samples) == 0 and np.isscalar(samples) and samples == 0):
        raise InputError("samples is empty; expected a count of at least 2, or an array of times.")


def _teller(progress: bool | None) -> _Say:
    if progress or (progress is None and sys.stderr.isatty()):
        return lambda what: print(f"comparing: {what} ...", file=sys.stderr, flush=True)
    return lambda what: None


def _attempt(
    system: System, method: Any, dt: Any, duration: Any, samples: Any, threads: int | None, progress: Any, say: _Say
) -> _Attempt:
    """Compile in a run of a few steps, then run; an IntegrationError becomes a row, a wrong use is raised."""
    say(method.label)
    started = perf_counter()
    direction = np.sign(system.units.time_value(duration, what="duration"))
    if direction in (1.0, -1.0):
        short = direction * (_WARM_UP_STEPS + 0.5) * dt
        with contextlib.suppress(IntegrationError):  # the run itself fails in the same way, and says so
            propagate(system, method, dt=dt, duration=short, samples=2, threads=threads, progress=False)
    compile_s = perf_counter() - started
    try:
        run = propagate(system, method, dt=dt, duration=duration, samples=samples, threads=threads, progress=progress)
    except IntegrationError as error:
        return _Attempt(Sampled(method.label, "ours", compile_s=compile_s, note=str(error)), None, error)
    units, statistics = system.units, run.statistics
    sampled = Sampled(
        method.label,
        "ours",
        q=np.asarray(run.q.to_value(units.length)),
        v=np.asarray(run.v.to_value(units.speed)),
        steps=int(statistics.steps),
        wall_s=float(statistics.wall_time),
        compile_s=compile_s,
    )
    return _Attempt(sampled, run, None)


def _grid(attempts: list[_Attempt]) -> _Grid:
    for attempt in attempts:
        if attempt.run is not None:
            unit = attempt.run.system.units.time
            times = np.asarray(attempt.run.t.to_value(unit), dtype=np.float64)
            return _Grid(times, float(attempt.run.dt.to_value(unit)))
    error = attempts[0].error
    assert error is not None
    raise error


def _reference(
    system: System, problem: Problem, grid: _Grid, kind: Any, threads: int | None, say: _Say
) -> tuple[Array | None, YardstickNote | None, tuple[str, ...]]:
    """Reference positions, the note about them, and remarks where there are none."""
    if isinstance(kind, str) and kind == "none":
        return None, None, ("No yardstick: positions are not measured.",)
    exact = rod.exact_applies(problem.gm, problem.q, problem.v, problem.softening)
    if isinstance(kind, str) and (
        kind == "exact" or (kind == "auto" and exact and len(problem.gm) * len(grid.times) <= EXACT_SOLVES)
    ):
        say("the exact solution")
        made = rod.exact(problem.gm, problem.q, problem.v, grid.times)
    else:
        coarse = grid.dt / 2 if isinstance(kind, str) else float(system.units.time_value(kind, what="yardstick"))
        say("the yardstick")
        try:
            made = rod.step_halved(system, grid.times, coarse, threads)
        except IntegrationError as error:
            return None, None, (f"The yardstick failed, so positions are not measured: {error}",)
    errors = dict(zip(problem.names, (made.error * problem.length).tolist(), strict=True))
    return made.q, YardstickNote(made.kind, made.description, errors), ()


def _peer(problem: Problem, peer: peers.Peer, grid: _Grid, say: _Say) -> Sampled:
    """A peer's samples, or why it has none."""
    reason = peers.unsuited(peer, problem.gm, problem.softening)
    if reason:
        return Sampled(peer.label, "peer", note=reason + ".")
    say(peer.label)
    try:
        run = peers.run(
            peer.name, problem.gm, problem.q, problem.v, times=grid.times, dt=grid.dt, softening=problem.softening
        )
    except IntegrationError as error:
        return Sampled(peer.label, "peer", note=str(error))
    return Sampled(peer.label, "peer", run.q, run.v, run.steps, run.wall_s, note=" ".join(run.warnings))


def _judged(row: Row, bound: bounds.Bounds, note: YardstickNote | None, problem: Problem) -> Row:
    """The row of one of ours with its verdict."""
    if row.verdict == "n/a":
        return replace(row, verdict="FAIL", failures=(row.note,), note="")
    if not bound:
        return replace(row, verdict="not judged")
    reached = {
        key: value
        for key, value in (("energy", row.energy), ("angular_momentum", row.angular_momentum))
        if value is not None
    }
    unit = f" {problem.length_unit}" if problem.length_unit else ""
    failures = bound.failures(reached, row.positions, note.errors if note is not None else {}, unit)
    return replace(row, verdict="FAIL" if failures else "ok", failures=failures)


def _in_days(system: System) -> float | None:
    from astropy import units as u

    return float(system.units.time.to(u.day)) if system.units.time.is_equivalent(u.day) else None


def _settings(
    system: System, problem: Problem, grid: _Grid, ours: list[Any], wanted: Any, title: str | None
) -> dict[str, Any]:
    """What was compared, ready for JSON."""
    from orbits._version import __version__

    plain = {key: _plain(value) for key, value in (wanted or {}).items()}
    return {
        "title": title or f"{len(problem.names):,} bodies, {len(problem.massive_names)} of them massive",
        "integrators": [methods.describe(method) for method in ours],
        "dt": grid.dt,
        "times": [float(grid.times[0]), float(grid.times[-1])],
        "time_unit": str(system.units.time),
        "samples": len(grid.times),
        "bodies": len(problem.names),
        "massive": len(problem.massive_names),
        "units": system.units.name,
        "epoch": None if system.epoch is None else f"{system.epoch.tdb.isot} TDB",
        "tolerances": plain,
        "versions": {"orbits": __version__, "rebound": _rebound_version(), "numpy": np.__version__},
    }


def _rebound_version() -> str:
    from importlib.metadata import version

    return version("rebound")


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(inner) for key, inner in value.items()}
    return value if isinstance(value, int | float) else str(value)
