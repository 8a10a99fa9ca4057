"""Parts of a study that are kept on disk, so that a study that was interrupted goes on behind the last of them."""

from __future__ import annotations

import hashlib
import inspect
import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError, StorageError, shown
from orbits.scenario.definition import slug
from orbits.scenario.files import replaceable

Arrays = dict[str, NDArray[Any]]


class Parts:
    """The parts of a study's experiment, each an HDF5 file of its results folder until the study is done.

    folder : that of the results; made_by : what the parts depend on, beside the package and the processor; None keeps
        none of those that are there
    say : receives a line for each part that is taken over from an interrupted run
    """

    def __init__(self, folder: Path, made_by: Mapping[str, str] | None, say: Callable[[str], None]) -> None:
        self._folder, self._say = folder, say
        self._made_by = None if made_by is None else dict(made_by)
        self._mine: dict[str, Path] = {}

    def get(self, name: str, compute: Callable[[], Mapping[str, Any]]) -> Arrays:
        """Return the arrays that `compute` returns, by name; or those that it returned in a run of the same study that
        was interrupted. They have the same bits.

        name : of the part, each once

        Raises InputError for a name that is taken, and if `compute` returns anything else; StorageError if the part
        cannot be written.
        """
        path = self._folder / f"part-{slug(name)}.h5"
        if path in self._mine.values():
            raise InputError(f"parts.get({name!r}): a part of that name already is there; give each another one.")
        self._mine[name] = path
        kept = self._kept(path)
        if kept is not None:
            self._say(f"{name}: taken over from the run that was interrupted")
            return kept
        found = compute()
        if not isinstance(found, Mapping) or not all(isinstance(key, str) for key in found):
            raise InputError(f"parts.get({name!r}): compute must return arrays by name, in a dict; got {shown(found)}.")
        arrays = {key: np.asarray(value) for key, value in found.items()}
        self._keep(path, arrays)
        return arrays

    def remove(self) -> None:
        """Remove the files: the study is done."""
        for path in self._mine.values():
            path.unlink(missing_ok=True)

    def _kept(self, path: Path) -> Arrays | None:
        import h5py

        if self._made_by is None or not replaceable(path).exists():
            return None
        try:
            with h5py.File(path, "r", locking=False) as file:
                if json.loads(file.attrs["made_by"]) != {**self._made_by, **_surroundings()}:
                    return None
                return {name: file[name][()] for name in file}
        except (OSError, KeyError, ValueError):
            return None

    def _keep(self, path: Path, arrays: Arrays) -> None:
        import h5py

        unfinished = path.with_suffix(".unfinished")
        try:
            with h5py.File(unfinished, "w", locking=False) as file:
                file.attrs["orbits"] = "part of a study"
                file.attrs["made_by"] = json.dumps({**(self._made_by or {}), **_surroundings()})
                for name, array in arrays.items():
                    file[name] = array
            os.replace(unfinished, replaceable(path))  # so that it is there as a whole or not at all
        except (OSError, TypeError) as error:
            raise StorageError(f"{path} could not be written ({error}).") from error


def identity(experiment: Callable[..., Any], name: str, dt: Any) -> dict[str, str] | None:
    """Return what the parts of a study depend on: its name, its steps and the file that defines it; None if the file is
    not known.
    """
    try:
        source = inspect.getsourcefile(experiment)
        text = Path(source).read_bytes() if source else None
    except (TypeError, OSError):
        text = None
    if text is None:
        return None
    return {"study": name, "dt": str(dt), "source": hashlib.sha256(text).hexdigest()}


def _surroundings() -> dict[str, str]:
    from orbits.propagation.marchers import provenance  # imports Numba, which the start of the command line avoids

    return provenance()
