"""A run and its file: opened from an archive, and opened again for a copy."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from orbits.errors import ArchiveError
from orbits.trajectory.archived import changes_of, identity_of, made_by

if TYPE_CHECKING:
    from orbits.archive import Archive
    from orbits.trajectory.parts import Statistics
    from orbits.trajectory.trajectory import Trajectory


def of_archive(kind: type[Trajectory], archive: Archive, **known: Any) -> Trajectory:
    """Return the trajectory in an open archive, which is closed with it, or at once if this fails.

    known : path and statistics of the trajectory
    Raises ArchiveError for an unknown method, and for an invalid certificate.
    """
    try:
        integrator, certificate = made_by(archive)
        run = kind(
            archive.system,
            archive.times[: archive.committed],
            archive.q,
            archive.v,
            step=archive.grid.clock,
            integrator=integrator,
            complete=archive.complete,
            certificate=certificate,
            kept=archive.steps,
            close=archive.close,
            **known,
        )
    except BaseException:
        archive.close()
        raise
    run.archive = archive
    run.changes = changes_of(archive)
    if run.changes is not None and run.changes.begin_legs:
        run._kept = None  # steps are of the bodies of the start
    run._span = 0.0, archive.reached
    return run


def reopened(
    kind: type[Trajectory], path: str, samples: int, statistics: Statistics | None, identity: str
) -> Trajectory:
    """Return the run in an archive for a copy, checking that it still has these samples and this identity."""
    run = kind.open(path, statistics=statistics)
    try:
        if len(run) < samples:
            raise ArchiveError(f"{path} has {len(run)} samples; expected the {samples} of the run that was copied.")
        if identity_of(run, samples) != identity:
            raise ArchiveError(f"{path} now has another run; expected the one that was copied.")
    except BaseException:
        run.close()
        raise
    return run
