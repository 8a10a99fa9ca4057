"""The method and certificate of an archived run, and the identity of runs."""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING

import numpy as np

from orbits.errors import ArchiveError, InputError
from orbits.trajectory.changes import COUNTS, Changes, checked_rows

if TYPE_CHECKING:
    from orbits.archive import Archive
    from orbits.certificate import Certificate
    from orbits.integrators.base import Integrator
    from orbits.trajectory.trajectory import Trajectory


def made_by(archive: Archive) -> tuple[Integrator, Certificate | None]:
    """Return the method of the run in an archive, and its certificate, if there is one.

    Raises ArchiveError for an unknown method, one that cannot have the steps of the run, and an invalid certificate.
    """
    from orbits import integrators
    from orbits.certificate import Certificate

    try:
        text = archive.certificate_text
        integrator = integrators.build(archive.integrator)
        archive.grid.clock.check(integrator)
        return integrator, Certificate.from_record(json.loads(text)) if text else None
    except InputError as error:
        raise ArchiveError(
            f"{archive.path}: {str(error).rstrip('.')}. Read the samples with orbits.Archive.open(path), or use a "
            "version of orbits that knows this method."
        ) from error


def changes_of(archive: Archive) -> Changes | None:
    """Return the changes of bodies in an archived run, or None for one in which they cannot change."""
    if COUNTS not in archive.layout.checkpoints[0]:
        return None
    try:
        rows = checked_rows(archive.checkpoint(), archive.system)
    except ArchiveError as error:
        raise ArchiveError(f"{archive.path} is damaged: {error}") from error
    return Changes(archive.system, rows, archive.grid.direction)


def identity_of(run: Trajectory, samples: int) -> str:
    """Return a digest of a run's initial state, method, step, and its first `samples` times."""
    values = run.system.values
    digest = hashlib.sha256(repr((run.names, run.integrator.label, run.step, values.softening)).encode())
    for array in (values.gm, values.q, values.v, run.times[:samples]):
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()
