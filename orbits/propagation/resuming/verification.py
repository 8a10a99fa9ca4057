"""`orbits.verify`: checks everything about an archive that can be checked, and says what is damaged."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from orbits.archive import Archive
from orbits.archive.schema import resolved
from orbits.archive.storage import human
from orbits.body_names import few
from orbits.checks import checked_choice, is_one_of
from orbits.errors import ArchiveError, InputError, IntegrationError, StorageError, counted, shown, with_unit
from orbits.plotting.words import fitting_time
from orbits.propagation.marchers import differences
from orbits.propagation.resuming.recomputing import Compared, recomputed
from orbits.trajectory import Trajectory
from orbits.trajectory.stored import of_archive

if TYPE_CHECKING:
    from orbits.propagation.events.base import Sought

Path_ = str | PathLike[str]
Recompute = Literal["all", "last", "none"]

BLOCK_BYTES = 32 * 1024 * 1024
"""The part of the samples that is in memory at a time."""


@dataclass(frozen=True)
class Finding:
    """What was found of one part of an archive.

    part : such as "samples"; said : what was found, in words
    ok : whether it is as it should be; None for what is told without a judgement
    """

    part: str
    said: str
    ok: bool | None = True


@dataclass(frozen=True)
class Verification:
    """What `orbits.verify` found in an archive. Printed as a list, with the verdict at its end.

    path : of the file; findings : one for each part
    readable : the number of samples that are whole; samples : of those that were stored; None if that is not known
    """

    path: str
    findings: tuple[Finding, ...]
    readable: int
    samples: int | None

    @property
    def ok(self) -> bool:
        """Whether nothing is damaged, and no computed bit differs."""
        return not self.failures

    @property
    def failures(self) -> tuple[str, ...]:
        """What is not as it should be, in words."""
        return tuple(f"{one.part}: {one.said}" for one in self.findings if one.ok is False)

    def record(self) -> dict[str, Any]:
        """Return it as values for JSON."""
        found = [{"part": one.part, "ok": one.ok, "said": one.said} for one in self.findings]
        return {
            "file": self.path,
            "ok": self.ok,
            "samples": self.samples,
            "readable": self.readable,
            "findings": found,
        }

    def __str__(self) -> str:
        width = max(len(one.part) for one in self.findings)
        marks = {True: "  ", False: "! ", None: "  "}
        lines = [f"{marks[one.ok]}{one.part:{width}}  {one.said}" for one in self.findings]
        verdict = "ok" if self.ok else f"DAMAGED: {'; '.join(self.failures)}"
        if not self.ok and self.readable:
            verdict += f"\n{self._still_readable()}"
        return "\n".join([self.path, *lines, verdict])

    def _still_readable(self) -> str:
        of = "" if self.samples is None else f" of {self.samples:,}"
        how = "orbits.Archive.open(path, salvage=True) reads those before the damage"
        return f"{self.readable:,}{of} samples are whole; {how}"


def verify(
    path: Path_,
    *,
    recompute: Recompute = "last",
    events: Sought | Sequence[Sought] = (),
    threads: int | None = None,
    progress: bool | None = None,
) -> Verification:
    """Check the archive at `path`, and return what was found; `print` it, or ask for its `ok`.

        print(orbits.verify("run.h5"))
        assert orbits.verify("run.h5", recompute="all").ok

    Checked are the header, the commits, the checkpoint, every chunk of samples and of dense output against their
    checksums, the order of times, that samples are numbers except where a particle was retired or a body merged, that
    the first sample is the start of the run, and that a part of the run, integrated again, gives the same samples and
    the same state at the end, bit for bit. The result also has the drift of the conserved quantities, the versions that
    made the run, and whether a process is writing the file, which is not disturbed.

    recompute : "last" integrates from the last checkpoint but one, ten seconds of the run at most; "all" from the
        start; "none" does not
    events : those of the run, if an archive cannot hold them: functions of your own
    threads, progress : as in `propagate`

    With another processor, Numba or kernels than those of the run last bits may differ: that is told, but not damage.
    Raises ArchiveError for a path where there is no file, InputError for other arguments.
    """
    if not is_one_of(recompute, ("all", "last", "none")):
        raise InputError(f"recompute is {shown(recompute)}; expected 'all', 'last' or 'none'.")
    place, progress = resolved(path), checked_choice(progress, "progress")
    if not Path(place).is_file():
        raise ArchiveError(f"{path} is not there, or is no file; expected an archive that orbits.propagate wrote.")
    findings: list[Finding] = []
    archive = None
    try:
        archive = Archive.open(path)
    except (ArchiveError, StorageError) as error:
        findings.append(Finding("file", str(error), False))
        try:
            archive = Archive.open(path, salvage=True)
        except (ArchiveError, StorageError):
            return Verification(str(path), tuple(findings), 0, None)
    with archive:
        return _verified(str(path), archive, findings, recompute, events, threads, progress)


def _verified(
    path: str,
    archive: Archive,
    findings: list[Finding],
    recompute: Recompute,
    events: Sought | Sequence[Sought],
    threads: int | None,
    progress: bool | None,
) -> Verification:
    whole = not findings
    changed = differences(archive.provenance)
    findings += [Finding("header", _run(archive)), Finding("made with", _made(archive, changed), None)]
    if whole:
        findings.append(Finding("commits", _commits(archive)))
    damaged = archive.damaged()
    lost = sum(last - first + 1 for first, last in damaged)
    findings.append(_samples(archive, damaged))
    if archive.steps is not None:
        findings.append(_steps(archive))
    sound = whole and not damaged
    findings.append(_numbers(archive, damaged))
    if sound and findings[-1].ok:
        run = of_archive(Trajectory, Archive.open(path), path=path)
        with run.archive:  # type: ignore[union-attr]
            findings.append(Finding("conserved", _drift(run), None))
    if whole and recompute != "none":
        findings.append(_computed(archive, recompute, events, threads, progress, changed))
    elif not whole:
        findings.append(Finding("computed", "nothing: there is no whole checkpoint to go on from", None))
    return Verification(path, tuple(findings), archive.committed - lost, archive.committed if whole else None)


def _run(archive: Archive) -> str:
    """Return what a run is."""
    from orbits.trajectory.archived import made_by

    bodies, method = counted(len(archive.system), "body"), made_by(archive)[0]
    steps = archive.grid.clock.describe(method, archive.system.units.time)
    told = f"holds its checksum: {bodies}, {method.label}, {steps}"
    return told if archive.origin is None else f"{told}; scenario {archive.origin}"


def _made(archive: Archive, changed: list[str]) -> str:
    """Return what a run was made with, and whether its bits can be computed here."""
    made = archive.provenance
    known = f"orbits {made.get('orbits')}, kernels {str(made.get('kernel_sources'))[:12]}, numba {made.get('numba')}"
    where = f"{made.get('cpu_name')}, {made.get('platform')}"
    same = f"its last bits may be others here: {', '.join(changed)}" if changed else "as here"
    return f"{known}, {where}; {same}"


def _commits(archive: Archive) -> str:
    ended, done = archive.ended, f"{archive.committed:,} of {len(archive.times):,} samples"
    state = "complete" if archive.complete else "not complete" + f": {ended.how}, {ended.why}" * bool(ended.how)
    writer = archive.writer
    if writer is not None:
        state += ", being written" + (f" by process {writer}" if writer > 0 else "")
    before = "" if archive.before() is None else ", and the one before"
    return f"number {archive.last.sequence:,} is whole with its checkpoint{before}; {done}, {state}"


def _samples(archive: Archive, damaged: list[tuple[int, int]]) -> Finding:
    chunks, size = len(archive.chunks), human(2 * archive.q.size * 8)
    if not damaged:
        where = f"{chunks:,} chunk{'s' * (chunks != 1)}"
        return Finding("samples", f"{archive.committed:,} in {where}, {size}, hold their checksums")
    some = ", ".join(f"{first:,} to {last:,}" for first, last in damaged[:8]) + ", ..." * (len(damaged) > 8)
    return Finding("samples", f"{some} do not hold their checksums; the others of {archive.committed:,} do", False)


def _steps(archive: Archive) -> Finding:
    assert archive.steps is not None
    try:
        archive.steps.check_all()
        count = len(archive.steps.times)
    except (ArchiveError, StorageError) as error:
        return Finding("dense output", str(error), False)
    return Finding("dense output", f"{count:,} states hold their checksums, and are in the order of their times")


def _numbers(archive: Archive, damaged: list[tuple[int, int]]) -> Finding:
    """Check that times ascend and samples are finite, but for bodies that are gone from some sample on, and for samples
    of massless bodies between two steps, to which no partial step may lead.
    """
    done, names = archive.committed, archive.system.names
    if not done:
        return Finding("values", "no samples yet", None)
    gone = missing = at_last = np.zeros(len(names), dtype=bool)
    clock, wrong = archive.grid.clock, []
    between = ~archive.system.massive & (clock.places(archive.times[:done]).rests != 0.0)[:, None] & (not clock.changes)
    for first, q, v in _blocks(archive, damaged):
        absent = np.isnan(q).all(axis=2) & np.isnan(v).all(axis=2)
        bad = ~(np.isfinite(q).all(axis=2) & np.isfinite(v).all(axis=2)) & ~absent
        ended = absent & ~between[first : first + len(q)]
        back = (np.logical_or.accumulate(ended) | gone) & ~absent
        for what, rows in (("is not finite", bad), ("is there again", back)):
            if rows.any():
                sample, body = np.argwhere(rows)[0]
                wrong.append(f"{names[body]} {what} at sample {first + int(sample):,}")
        gone, missing, at_last = gone | ended.any(axis=0), missing | absent.any(axis=0), absent[-1]
        if first == 0 and archive.times[0] == 0.0 and not np.array_equal(q[0], archive.system.values.q):
            wrong.append("the first sample is not the start of the run")
    factor, unit = fitting_time(float(archive.times[done - 1]), archive.system.units.time)
    span = with_unit(f"{factor * archive.times[0]:.6g} ... {factor * archive.times[done - 1]:.6g}", unit)
    if wrong:
        return Finding("values", "; ".join(wrong[:3]), False)
    ends = [names[k] for k in np.flatnonzero(at_last)]
    lost = f"; {len(ends):,} {'bodies end' if len(ends) > 1 else 'body ends'}: {few(ends)}" if ends else ""
    missed = [names[k] for k in np.flatnonzero(missing & ~at_last)]
    lost += f"; without some samples between two steps: {few(missed)}" if missed else ""
    return Finding("values", f"finite, t = {span} in order{lost}")


def _blocks(archive: Archive, damaged: list[tuple[int, int]]) -> Iterator[tuple[int, NDArray[Any], NDArray[Any]]]:
    """Yield the number of the first sample, q and v of all samples that are whole, in blocks."""
    rows = max(1, BLOCK_BYTES // (48 * len(archive.system)))
    edges = [0]
    for first, last in damaged:
        edges += [first, last + 1]
    edges.append(archive.committed)
    for start, end in zip(edges[::2], edges[1::2], strict=True):
        for first in range(start, end, rows):
            part = slice(first, min(first + rows, end))
            yield first, archive.q[part], archive.v[part]


def _drift(run: Trajectory) -> str:
    if not len(run):
        return "no samples yet"
    drift = run.drift()
    parts = {"energy": drift.energy, "angular momentum": drift.angular_momentum, "momentum": drift.linear_momentum}
    figures = [f"{name} {one.max_fraction:.2g}" for name, one in parts.items() if one.max_fraction == one.max_fraction]
    return f"largest relative changes: {', '.join(figures)}" if figures else "nothing is"


def _computed(
    archive: Archive,
    recompute: Recompute,
    events: Sought | Sequence[Sought],
    threads: int | None,
    progress: bool | None,
    changed: list[str],
) -> Finding:
    try:
        found = recomputed(archive, whole=recompute == "all", events=events, threads=threads, progress=progress)
    except IntegrationError as error:
        return Finding("computed", f"a step could not be taken again: {error}", None if changed else False)
    except (ArchiveError, InputError) as error:
        return Finding("computed", f"nothing: {error}", None)
    if found is None:
        why = "no step lies between the last two checkpoints; 'all' computes the whole run" if archive.marched else ""
        return Finding("computed", f"nothing: {why or 'the run is at its start'}", None)
    what = _stretch(found)
    if not found.samples and found.checkpoint is None:
        return Finding("computed", f"{what}: nothing was compared, as they do not end at the last checkpoint", None)
    if found.same:
        state = {True: ", and the same state at the last checkpoint", None: ""}[found.checkpoint or None]
        return Finding("computed", f"{what}: the same bits{state}")
    if found.differing is None:
        said = "the same samples, but another state at the last checkpoint"
    else:
        sample, body = found.differing
        size = f"up to {found.largest:.1e} of the largest distance"
        said = f"other bits from sample {sample:,} on, at first of {body}, by {size}"
    if changed:
        return Finding("computed", f"{what}: {said}; the run was made with a different {', '.join(changed)}", None)
    return Finding("computed", f"{what}: {said}", False)


def _stretch(found: Compared) -> str:
    last = found.first + found.samples - 1
    which = f"samples {found.first:,} to {last:,}" if found.samples > 1 else f"sample {last:,}"
    return f"{which if found.samples else 'no samples'} in {found.steps:,} steps"
