"""Every exception that `orbits` raises on purpose.

Each message says what was wrong, what was found, what is expected and how to fix it. `exit_code` is the exit code of
the command line: 2 for wrong use, 1 for a run that failed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

__all__ = [
    "ArchiveError",
    "ConvergenceError",
    "EpochError",
    "EventError",
    "EventWarning",
    "InputError",
    "IntegrationError",
    "Interrupted",
    "MissingPackageError",
    "OrbitsError",
    "OrbitsWarning",
    "OutOfRangeError",
    "OutOfTime",
    "RetiredWarning",
    "SingularityError",
    "StepWarning",
    "StorageError",
    "SystemsError",
    "UnknownNameError",
]


def __dir__() -> list[str]:
    """Return the public names: all exceptions and warnings, none of the helpers that word them."""
    return __all__


class OrbitsError(Exception):
    """Base of all errors raised by this package, except `Interrupted`."""

    exit_code = 1


class InputError(OrbitsError, ValueError):
    """A value given by the caller cannot be used."""

    exit_code = 2


class UnknownNameError(InputError):
    """A body, method, scenario, option or file that does not exist."""


class OutOfRangeError(InputError, IndexError):
    """An index beyond the ends of a sequence."""


class EpochError(InputError):
    """An epoch outside an ephemeris, or epochs that do not match."""


class MissingPackageError(OrbitsError, ImportError):
    """An optional package is needed and cannot be imported."""

    exit_code = 2


class ArchiveError(InputError):
    """A file that is not a readable archive, or that must not be overwritten."""


class StorageError(OrbitsError):
    """Writing failed during a run: a full disk, a lost device, a file that was deleted or replaced.

    trajectory : the samples before the failure, a `Trajectory`, if `propagate` or `resume` was marching and they can
        still be read; else None
    """

    def __init__(self, message: str) -> None:
        super().__init__(message)
        self.trajectory: Any = None


class OrbitsWarning(UserWarning):
    """Something the caller should know: entries were left out, or digits are missing.

    finding : what was found, an `orbits.finding.Finding`
    trajectory : the completed run, if warnings are errors and this one was raised after it; else None. Of a list of
        systems, a list of these
    """

    finding: Any = None
    trajectory: Any = None


class StepWarning(OrbitsWarning):
    """The step is too long for the motion, as predicted before a run or as seen after it."""


class RetiredWarning(OrbitsWarning):
    """Massless particles could not be integrated any further, and the run went on without them; see `run.retired`."""


class EventWarning(OrbitsWarning):
    """Events of a run mean nothing, or may be incomplete: their function is round-off, or they happen in every step."""


class IntegrationError(OrbitsError):
    """A step could not be taken. Everything computed before it remains valid.

    step : index of the step that failed, counted from the epoch of the run
    time : time since the epoch at the start of that step, in the run's time unit
    bodies : names of the bodies concerned
    trajectory : the samples before the failure, a `Trajectory`, if `propagate` or `resume` raised the error; else None
    """

    def __init__(self, message: str, *, step: int = -1, time: float = float("nan"), bodies: Sequence[str] = ()) -> None:
        super().__init__(message)
        self.trajectory: Any = None
        self.step = step
        self.time = time
        self.bodies = tuple(bodies)


class ConvergenceError(IntegrationError):
    """The stages of an implicit step did not converge to the round-off floor."""


class SingularityError(IntegrationError):
    """The state became infinite or undefined: two bodies met, or the step was far too long."""


class EventError(IntegrationError):
    """An event cannot be sought any further: its function is not finite, it happens too often, or what it does cannot
    be done. Everything computed before it remains valid.
    """


class SystemsError(IntegrationError):
    """Some systems of a list could not be propagated to the end; the others were.

    failures : the error of each that failed, by its number in the list
    trajectories : of all systems, in the order of the list: complete, or the samples before the failure; None for a
        system without any
    step, time, bodies, trajectory : those of the first that failed
    """

    def __init__(self, message: str, *, failures: Mapping[int, BaseException], trajectories: Sequence[Any]) -> None:
        first = min(failures)
        cause = failures[first]
        super().__init__(
            message,
            step=getattr(cause, "step", -1),
            time=getattr(cause, "time", float("nan")),
            bodies=getattr(cause, "bodies", ()),
        )
        self.failures, self.trajectories = dict(failures), list(trajectories)
        self.trajectory = self.trajectories[first]
        self.__cause__ = cause


class Interrupted(KeyboardInterrupt):
    """A run was stopped by a signal, at the end of a chunk of steps.

    It is a KeyboardInterrupt, not an `OrbitsError`, so that Ctrl-C also ends a loop over many runs that continues after
    failed ones (`except Exception: continue`).

    trajectory : the samples computed so far, a `Trajectory`; of a list of systems, a list of these, in its order
    what : the message without its last part, the remedy, which tells how to go on
    """

    exit_code = 130

    def __init__(self, what: str, remedy: str = "", *, trajectory: Any = None) -> None:
        super().__init__(f"{what}; {remedy}" if remedy else what)
        self.what, self.trajectory = what, trajectory


class OutOfTime(OrbitsError):
    """A command of the command line has used up its wall time, and goes on when it is given again; `propagate` and
    `resume` return such a run instead, with the reason in `run.stopped`.
    """

    exit_code = 75
    """EX_TEMPFAIL of sysexits.h: to be tried again."""


def shown(value: object) -> str:
    """Return a value as it is shown in messages: on one line, not too long, even if its `repr` fails."""
    try:
        text = " ".join(repr(value).split())
    except Exception:
        text = f"an object of type {type(value).__name__}"
    text = "".join(c if c.isprintable() else "?" for c in text)
    return text if len(text) <= 80 else text[:77] + "..."


def with_unit(figure: object, unit: object) -> str:
    """Return a figure with its unit as it is shown in messages: "2 AU", and "2" in a system without units."""
    return f"{figure} {unit}".rstrip()


def counted(number: int, what: str) -> str:
    """Return a number of things as it is shown in messages: "1 particle", "1,204 particles", "2 bodies"."""
    several = what.removesuffix("y") + "ies" if what.endswith("body") else f"{what}s"
    return f"{number:,} {what if number == 1 else several}"
