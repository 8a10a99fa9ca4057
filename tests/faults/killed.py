"""Runs that are killed at one call to the system after another, each in a fork of one process.

    python -m tests.faults.killed FOLDER EVERY

For each stage a child makes, overwrites, resumes or extends an archive and is killed by SIGKILL just before, or just
after, its n-th change of the file or folder; where EVERY is more than 1, after it alone. Prints how many were killed,
and what was wrong with what they left.
"""

from __future__ import annotations

import os
import shutil
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import orbits
from orbits.archive import steps
from orbits.archive.storage import Storage
from orbits.marching.legs.samples import SamplesOfLeg
from orbits.propagation import loop
from orbits.propagation.resuming import sample_store, step_store

from . import small

CALLS: list[tuple[Any, str]] = [
    (Storage, "lock"), (Storage, "resize"), (Storage, "reserve"), (Storage, "_write_some"), (Storage, "sync"),
    (os, "link"), (os, "replace"), (Path, "unlink"),
]  # fmt: skip


def killed_at(work: Callable[[], object], stage: int, late: bool) -> bool:
    """Do the work in a child that is killed at its `stage`-th call; return whether it came so far."""
    child = os.fork()
    if not child:
        count = 0

        def mortal(real: Callable[..., Any]) -> Callable[..., Any]:
            def call(*arguments: Any, **options: Any) -> Any:
                nonlocal count
                count += 1
                if count == stage and not late:
                    os.kill(os.getpid(), signal.SIGKILL)
                result = real(*arguments, **options)
                if count == stage:
                    os.kill(os.getpid(), signal.SIGKILL)
                return result

            return call

        for owner, name in CALLS:
            setattr(owner, name, mortal(getattr(owner, name)))
        try:
            work()
        except BaseException as error:
            print(f"stage {stage}: {error!r}", flush=True)
        os._exit(0)
    _, status = os.waitpid(child, 0)
    return os.WIFSIGNALED(status)


def wrong(path: Path, kind: str) -> str | None:
    """Say what is wrong with what a killed run left behind, or return None."""
    if kind == "kept":
        return wrong_with_steps(path)
    if kind == "made" and not path.exists():
        small.propagate(path).close()  # what lies about is in nobody's way
    run = orbits.Trajectory.open(path)
    if not small.is_part_of_the_run(run):
        return "wrong numbers"
    least = {"made": 0, "overwritten": 0, "resumed": 7, "extended": small.SAMPLES}[kind]
    if len(run) < least:
        return f"{len(run)} samples, {least} were there before"
    run.close()
    if not small.is_part_of_the_run(orbits.resume(path, progress=False, threads=1)):
        return "wrong numbers after resuming"
    small.propagate(path, overwrite=True).close()
    left = [each.name for each in path.parent.iterdir() if each.name != path.name]
    return f"left behind: {left}" if left else None


def wrong_with_steps(path: Path) -> str | None:
    """The same for a run that keeps its steps, in a file that grows while it runs."""
    if not path.exists():
        small.keeping(path).close()
    run = orbits.Trajectory.open(path)
    if not small.is_part_of_the_kept_run(run):
        return "wrong steps"
    run.close()
    run = orbits.resume(path, progress=False, threads=1)
    if not small.is_part_of_the_kept_run(run) or len(run._kept) != len(small.all_steps()[1]):
        return "wrong steps after resuming"
    run.close()
    left = [each.name for each in path.parent.iterdir() if each.name != path.name]
    return f"left behind: {left}" if left else None


def main(folder: Path, every: int) -> None:
    small.straight()
    sample_store.COMMIT_SECONDS, loop.AT_ONCE = 0.0, 1
    SamplesOfLeg.together = lambda samples, places: 1  # type: ignore[method-assign]
    step_store.FIRST_BYTES, step_store.PIECE_BYTES, steps.CHUNK_BYTES = 0, 10_000, 5_000
    small.all_steps()
    os.fsync = lambda descriptor: None  # a killed process loses nothing that it has written, whatever the device has
    half, whole = small.interrupted(folder / "half.h5"), small.finished(folder / "whole.h5")
    (folder / "run").mkdir()
    path = folder / "run" / "run.h5"
    on_its_way: dict[str, Any] = {"progress": False, "threads": 1}
    kinds: dict[str, tuple[Path | None, Callable[[], object]]] = {
        "made": (None, lambda: small.propagate(path)),
        "overwritten": (whole, lambda: small.propagate(path, overwrite=True)),
        "resumed": (half, lambda: orbits.resume(path, **on_its_way)),
        "kept": (None, lambda: small.keeping(path)),
        "extended": (whole, lambda: orbits.resume(path, until=small.LONGER, **on_its_way)),
    }
    killed, found = 0, []
    for kind, (before, work) in kinds.items():
        for late in (False, True) if every == 1 else (True,):
            stage = every
            while True:
                for left in path.parent.iterdir():
                    left.unlink()
                if before is not None:
                    shutil.copy(before, path)
                if not killed_at(work, stage, late):
                    break
                killed += 1
                try:
                    trouble = wrong(path, kind)
                except Exception as error:
                    trouble = repr(error)
                if trouble:
                    found.append(f"{kind}, killed {'after' if late else 'before'} call {stage}: {trouble}")
                # From the second commit on the calls repeat themselves, twenty or so for each: every kind is met.
                stage += every if every > 1 or stage < 60 else 7
    print(killed, flush=True)
    print("\n".join(found), flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
