"""Every exception that `orbits` raises on purpose.

Each message says what was wrong, what was found, what is expected and how to mend it. `exit_code` is what the command
line ends with: 2 for a wrong use, 1 for a run that failed.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from typing import Any


class OrbitsError(Exception):
    """Base of all errors raised by this package; `Interrupted` alone is none of them."""

    exit_code = 1


class InputError(OrbitsError, ValueError):
    """A value given by the caller cannot be used."""

    exit_code = 2


class UnknownNameError(InputError):
    """A body, method, scenario or option that does not exist."""


class EpochError(InputError):
    """An epoch outside an ephemeris, or epochs that do not belong together."""


class MissingPackageError(OrbitsError, ImportError):
    """An optional package is needed and cannot be imported."""

    exit_code = 2


class ArchiveError(InputError):
    """A file that is not a readable archive, or that must not be overwritten."""


class StorageError(OrbitsError):
    """Writing failed while a run was under way: a full disk, a lost device, a file that was deleted or replaced.

    trajectory : the samples before the failure, a `Trajectory`, when the error comes out of `propagate` or `resume`
        while it was marching and they can be read
    """

    def __init__(self, message: str) -> None:
        super().__init__(message)
        self.trajectory: Any = None


class OrbitsWarning(UserWarning):
    """Something was done that the caller should know of: entries left out, digits missing."""


class StepWarning(OrbitsWarning):
    """The step is too long for what happens in a run, before it starts or after it was seen.

    trajectory : where warnings are errors, the run that was done when this one was raised after it; else None
    """

    trajectory: Any = None


class RetiredWarning(OrbitsWarning):
    """Massless particles could not be stepped any further, and the run went on without them; see `run.retired`.

    trajectory : where warnings are errors, the run that was done when this one was raised after it; else None
    """

    trajectory: Any = None


class IntegrationError(OrbitsError):
    """A step could not be taken. What was computed before it stays valid.

    step : index of the step that failed, counted from the epoch of the run
    time : time since the epoch at the start of that step, in the run's time unit
    bodies : names of the bodies concerned
    trajectory : the samples before the failure, a `Trajectory`, when the error comes out of `propagate` or `resume`
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


class Interrupted(KeyboardInterrupt):
    """A run was stopped by a signal after a whole chunk.

    It is a KeyboardInterrupt and no `OrbitsError`, so that a loop over many runs that goes on after a failed one
    (`except Exception: continue`) ends with Ctrl-C.

    trajectory : what was computed, a `Trajectory`
    """

    exit_code = 130

    def __init__(self, message: str, *, trajectory: Any = None) -> None:
        super().__init__(message)
        self.trajectory = trajectory


def shown(value: object) -> str:
    """Return how a message shows what it was given: on one line, not too long, whatever `repr` does."""
    try:
        text = " ".join(repr(value).split())
    except Exception:
        text = f"an object of type {type(value).__name__}"
    text = "".join(c if c.isprintable() else "?" for c in text)
    return text if len(text) <= 80 else text[:77] + "..."


def level_of_caller() -> int:
    """Return the `stacklevel` with which a warning is shown at the line outside this package that led to it."""
    package = os.path.dirname(__file__) + os.sep
    frame, level = sys._getframe(1), 1
    while frame.f_code.co_filename.startswith(package) and frame.f_back is not None:
        frame, level = frame.f_back, level + 1
    return level
