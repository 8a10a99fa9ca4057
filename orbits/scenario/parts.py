"""Parts of a study that are kept on disk, so that a study that was interrupted goes on behind the last of them."""

from __future__ import annotations

import hashlib
import inspect
import json
import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orbits.errors import InputError, StorageError, shown
from orbits.scenario.definition import slug
from orbits.scenario.files import replaceable

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Arrays = dict[str, NDArray[Any]]

HDF5 = b"\x89HDF\r\n\x1a\n"
"""What HDF5 files begin with."""

LONGEST = 200
"""The most characters of a part's file name, so that with what is added it stays below 255."""


class Parts:
    """The parts of a study's experiment, each an HDF5 file of its results folder until the study is done.

    folder : that of the results; made_by : what the parts depend on, beside the package and the processor
    say : receives a line for each part that is taken over from an interrupted run, or is damaged
    prefix : of the names of the files; kept : the names of the parts that are there

    Several processes may run the same study in one folder: each writes files of its own, and renames them when they are
    whole.
    """

    def __init__(
        self, folder: Path, made_by: Mapping[str, str], say: Callable[[str], None], prefix: str = ""
    ) -> None:
        self._folder, self._say, self._prefix = folder, say, prefix
        self._made_by = dict(made_by)
        self._mine: dict[Path, tuple[int, ...] | None] = {}
        self.kept: list[str] = []

    def get(self, name: str, compute: Callable[[], Mapping[str, Any]]) -> Arrays:
        """Return the arrays that `compute` returns, by name; or those that it returned in a run of the same study that
        was interrupted. They have the same bits, types, shapes and order.

        name : of the part, each once
        compute : returns numbers and truth values, or arrays of them, by name; no quantities, whose units would be lost

        Raises InputError for a name that is taken or cannot be that of a file, if `compute` returns anything else, and
        if the part's file is there but not written by this package; StorageError if the part cannot be written.
        """
        path = self._folder / f"part-{self._prefix}{_stem(name)}.h5"
        if path in self._mine:
            raise InputError(f"parts.get({name!r}): a part of that name already is there; give each another one.")
        self._mine[path] = None
        kept = self._kept(path, name)
        if kept is not None:
            self._say(f"{name}: taken over from the run that was interrupted")
            self.kept.append(name)
            return kept
        arrays = _arrays(name, compute())
        self._keep(path, arrays)
        self.kept.append(name)
        return arrays

    def remove(self) -> None:
        """Remove the files: the study is done. Those that another process has replaced since are left to it."""
        for path, state in self._mine.items():
            with suppress(FileNotFoundError):
                if state == _state(path.stat()):
                    path.unlink()
            for unfinished in self._folder.glob(f"{path.stem}.*.unfinished"):
                if not _runs(unfinished.suffixes[-2][1:]):
                    unfinished.unlink(missing_ok=True)

    def _kept(self, path: Path, name: str) -> Arrays | None:
        import h5py
        import numpy as np

        if not _writable(path).exists():
            return None
        try:
            state = _state(path.stat())
            with h5py.File(path, "r", locking=False) as file:
                if json.loads(file.attrs["made_by"]) != {**self._made_by, **_surroundings()}:
                    return None
                arrays = {key: np.asarray(file[key][()]) for key in file}
                self._mine[path] = state
                return arrays
        except FileNotFoundError:  # another process has finished the same study
            return None
        except (OSError, KeyError, ValueError, TypeError, AttributeError, RuntimeError):
            self._say(f"{name}: {path.name} is damaged; it is computed again")
            return None

    def _keep(self, path: Path, arrays: Arrays) -> None:
        import h5py

        from orbits.archive.storage import sync_folder

        unfinished = path.with_name(f"{path.stem}.{os.getpid()}.unfinished")
        try:
            with h5py.File(unfinished, "w", locking=False, track_order=True) as file:
                file.attrs["orbits"] = "part of a study"
                file.attrs["made_by"] = json.dumps({**self._made_by, **_surroundings()})
                for key, array in arrays.items():
                    file.create_dataset(key, data=array, fletcher32=array.size > 0 and array.ndim > 0)
            with unfinished.open("rb+") as written:
                os.fsync(written.fileno())  # so that the name is not on the device before the data are
                state = _state(os.fstat(written.fileno()))
            os.replace(unfinished, _writable(path))  # so that it is there as a whole or not at all
            self._mine[path] = state
            sync_folder(path.parent)
        except (OSError, ValueError, RuntimeError) as error:
            raise StorageError(f"{path} could not be written ({error}).") from error
        finally:
            unfinished.unlink(missing_ok=True)


def identity(experiment: Callable[..., Any], name: str, dt: Any) -> dict[str, str]:
    """Return what the parts of a study depend on: its name, its steps and the file that defines its experiment.

    Raises InputError if that file is not known: nothing would tell whether parts are those of the same experiment.
    """
    try:
        source = inspect.getsourcefile(inspect.unwrap(experiment))
        text = Path(source).read_bytes() if source else None
    except (TypeError, ValueError, OSError):
        text = None
    if text is None:
        raise InputError(
            f"study {name!r}: resumable=True takes over parts only while the file that defines the experiment is the "
            f"same, and that of {shown(experiment)} is not known; give a function that is written in a file (with def, "
            "instead of functools.partial, a callable object or a function typed into a session), or resumable=False."
        )
    return {"study": name, "dt": str(dt), "source": hashlib.sha256(text).hexdigest()}


def _stem(name: str) -> str:
    """The name of a part as that of its file."""
    if not isinstance(name, str):
        raise InputError(f"parts.get({shown(name)}): the name of a part must be text.")
    stem = slug(name)
    if not stem:
        raise InputError(f"parts.get({name!r}): the name of a part needs a letter from A to Z or a digit.")
    if len(stem) > LONGEST:
        raise InputError(
            f"parts.get({shown(name)}): names of parts, which are those of files, have at most {LONGEST} characters; "
            f"got {len(stem)}."
        )
    return stem


def _arrays(name: str, found: Any) -> Arrays:
    """What `compute` returned, as arrays that a file keeps as they are."""
    import numpy as np

    if not isinstance(found, Mapping) or not all(isinstance(key, str) for key in found):
        raise InputError(f"parts.get({name!r}): compute must return arrays by name, in a dict; got {shown(found)}.")
    arrays = {}
    for key, value in found.items():
        what = f"parts.get({name!r}): compute returned {shown(value)} as {shown(key)}"
        if key in ("", ".") or "/" in key or not key.isprintable():
            raise InputError(f"{what}; names of arrays are printable, without '/', and neither empty nor '.'.")
        if _has_unit(value):
            raise InputError(f"{what}, but units are not kept; return numbers, as by `.to_value(unit)`.")
        if isinstance(value, np.ma.MaskedArray):
            raise InputError(f"{what}, but masks are not kept; return `.data` and `.mask` as two arrays.")
        try:
            array = np.array(value, order="C")  # in the order of a file, so that also its sums have the same bits
        except (TypeError, ValueError) as error:
            raise InputError(f"{what}, of which no array can be made ({error}).") from error
        if array.dtype.kind not in "biufc":
            raise InputError(f"{what}; expected numbers or truth values, or an array of them.")
        arrays[key] = array
    return arrays


def _has_unit(value: Any) -> bool:
    if isinstance(value, list | tuple):
        return any(_has_unit(item) for item in value)
    return getattr(value, "unit", None) is not None


def _writable(path: Path) -> Path:
    """Return `path` if nothing is there, a file of this package, or what a failure of power or disk left of one: an
    empty file, zeros, or HDF5 that cannot be opened. Raises InputError otherwise.
    """
    import h5py

    try:
        with path.open("rb") as file:
            head = file.read(len(HDF5))
    except FileNotFoundError:
        return path
    except OSError:
        return replaceable(path)
    if not HDF5.startswith(head) and any(head):
        return replaceable(path)
    try:
        with h5py.File(path, "r", locking=False) as file:
            ours = "orbits" in file.attrs
    except (OSError, KeyError, RuntimeError):  # damaged, or another process has finished the same study
        return path
    return path if ours else replaceable(path)


def _state(status: os.stat_result) -> tuple[int, ...]:
    """What differs between a file and one that has replaced it."""
    return status.st_dev, status.st_ino, status.st_mtime_ns


def _runs(process: str) -> bool:
    """Whether a process of that number runs."""
    try:
        os.kill(int(process), 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError, ValueError):
        return True
    return True


def _surroundings() -> dict[str, str]:
    from orbits.propagation.marchers import provenance  # imports Numba, which the start of the command line avoids

    return provenance()
