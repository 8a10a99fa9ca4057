"""Files of a results folder: only those that this package wrote are replaced."""

from __future__ import annotations

import json
import os
from contextlib import suppress
from pathlib import Path

from orbits.errors import InputError, StorageError


def results_folder(path: str | os.PathLike[str]) -> Path:
    """Make the folder if it does not exist. Raises InputError if that fails."""
    path = Path(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise InputError(f"{path} is a file; results need a folder. Give another one with --out.") from None
    except OSError as error:
        raise InputError(f"the folder {path} cannot be made ({error.strerror}); give another one with --out.") from None
    return path


def replaceable(path: Path) -> Path:
    """Return `path` if it does not exist, or was written by this package. Raises InputError otherwise."""
    if path.is_dir() or (path.exists() and not _is_ours(path)):
        raise InputError(f"{path} is there already and was not written by orbits, or is damaged; move it "
            "away, or give another --out.")
    return path


def picture_path(path: Path) -> Path:
    """Return `path` if a PNG can be written there. Raises InputError otherwise."""
    if path.suffix.lower() != ".png":
        raise InputError(f"{path} does not end in .png; pictures are written as PNG.")
    if not path.absolute().parent.is_dir():
        raise InputError(f"the folder {path.absolute().parent} does not exist; make it, or give another --out.")
    return path


def write_text(path: Path, text: str) -> Path:
    """Write a text file. Raises StorageError if that fails."""
    try:
        replaceable(path).write_text(text, encoding="utf-8")
    except OSError as error:
        raise StorageError(f"{path} could not be written ({error.strerror}).") from error
    return path


def remove_pictures(report: Path) -> None:
    """Remove the pictures of an earlier run beside its report, which lists them: some are not drawn again."""
    with suppress(OSError, ValueError, KeyError, TypeError):
        listed = json.loads(report.read_text(encoding="utf-8"))["files"]
        for path in (report.parent / Path(name).name for name in listed):
            if path.suffix == ".png" and _is_ours(path):
                path.unlink()


def _is_ours(path: Path) -> bool:
    if path.suffix == ".h5":
        import h5py

        try:
            with h5py.File(path, "r", locking=False) as file:
                return "orbits" in file.attrs
        except OSError:
            return False
    try:
        head = path.read_bytes()
    except OSError:
        return False
    if path.suffix == ".png":
        return head.startswith(b"\x89PNG") and b"Software\x00orbits" in head[:4096]
    try:
        return str(json.loads(head).get("format", "")).startswith("orbits")
    except (ValueError, AttributeError):
        return False
