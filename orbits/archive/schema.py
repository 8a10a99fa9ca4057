"""The HDF5 structure of an archive: written once at creation, read once at opening, and not changed in between.

    /                 attributes: orbits (the schema, "1"), dt, integrator (JSON), header_checksum, header_items
    /system, /units, /integrator, /provenance      the description of the run: see `header.py`
    /times            (samples,)
    /q, /v            (samples, bodies, 3)         preallocated; rows up to the last commit hold samples
    /chunks           (samples,)                   checksums of the chunks of samples
    /commits          (2,)                         the last two commits: see `commits.py`
    /checkpoints/0, /checkpoints/1                 the state from which to resume, after each of these two
    /steps            with dense output alone: the states at the beginnings of steps, see `steps.py`

The arrays that change during a run are contiguous and allocated at creation, so they have fixed places in the file.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.archive import header as headers
from orbits.archive.commits import CHUNK, ROW, SLOTS
from orbits.archive.header import Header, Item
from orbits.archive.sparse import SparseFile, StoredFile
from orbits.archive.steps import KEPT, NOTHING_KEPT, STEP_CHUNK, StepPlaces, bytes_per_step, chunk_rows
from orbits.archive.storage import Storage
from orbits.errors import ArchiveError, StorageError, shown

SCHEMA = "1"
SCHEMA_OF_MODELS = "1 with terms"
"""The schema of systems with terms or forces, so that earlier versions do not read them as purely Newtonian."""

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
# Checksums on HDF5's own metadata, no flag that stays set when a writer is killed, readable by HDF5 1.8 and later.
_LIBVER = ("v108", "v108")
# All arrays are aligned to cache lines: memory maps give aligned floats, and no commit row crosses a page.
_ALIGNMENT = 64


@dataclass(frozen=True)
class Place:
    """A contiguous array in the file: its offset, shape and type."""

    offset: int
    shape: tuple[int, ...]
    dtype: np.dtype[Any]

    @property
    def size(self) -> int:
        """The size of the array in bytes."""
        return math.prod(self.shape) * self.dtype.itemsize


@dataclass(frozen=True)
class Layout:
    """The places in the file of the arrays that change during a run."""

    q: Place
    v: Place
    chunks: Place
    commits: Place
    checkpoints: tuple[dict[str, Place], ...]
    steps: StepPlaces | None = None


def bytes_needed(header: Header, checkpoint: Mapping[str, NDArray[Any]]) -> int:
    """Return the approximate size of the file: that of the arrays, without the overhead of HDF5."""
    samples, bodies = len(header.grid), len(header.system)
    per_sample = 2 * 24 * bodies + CHUNK.itemsize + 8
    kept = header.steps * bytes_per_step(bodies)
    return samples * per_sample + kept + SLOTS * (ROW.itemsize + sum(array.nbytes for array in checkpoint.values()))


def image(header: Header, checkpoint: Mapping[str, NDArray[Any]]) -> SparseFile:
    """Return the initial contents of the file, with the complete header and space for all samples.

    Raises ArchiveError for values that HDF5 cannot store.
    """
    import h5py

    items = headers.to_items(header)
    shape = (len(header.grid), len(header.system), 3)
    made = SparseFile()
    with h5py.File(made, "w", libver=_LIBVER, alignment_threshold=1, alignment_interval=_ALIGNMENT) as file:
        for name, text in (
            ("@orbits", SCHEMA_OF_MODELS if "system@model" in items else SCHEMA),
            ("@header_checksum", headers.checksum(items)),
            ("@header_items", json.dumps(sorted(items))),
        ):
            _write_item(file, name, text)
        for name, item in items.items():
            _write_item(file, name, item)
        for slot in range(SLOTS):
            group = file.create_group(f"checkpoints/{slot}")
            for name, array in {**checkpoint, **({KEPT: NOTHING_KEPT} if header.steps else {})}.items():
                _preallocate(group, name, array.shape, array.dtype)
        _preallocate(file, "commits", (SLOTS,), ROW)
        _preallocate(file, "chunks", shape[:1], CHUNK)
        for name, unit in (("q", "system/q@unit"), ("v", "system/v@unit")):
            _preallocate(file, name, shape, np.dtype("<f8"))
            _write_item(file, f"{name}@unit", items[unit])
        if header.steps:
            for name, (steps, kind) in _step_shapes(header.steps, shape[1]).items():
                _preallocate(file, f"steps/{name}", steps, kind)
            for name, unit in (("t", "times@unit"), ("q", "system/q@unit"), ("v", "system/v@unit")):
                _write_item(file, f"steps/{name}@unit", items[unit])
    return made


def _step_shapes(room: int, bodies: int) -> dict[str, tuple[tuple[int, ...], np.dtype[Any]]]:
    """Return the shapes and types of the arrays of /steps."""
    floats, states = np.dtype("<f8"), (room, bodies, 3)
    chunks = (room + chunk_rows(bodies) - 1) // chunk_rows(bodies)
    return {"t": ((room, 2), floats), "q": (states, floats), "v": (states, floats), "chunks": ((chunks,), STEP_CHUNK)}


def read(storage: Storage, path: Path) -> tuple[Header, Layout]:
    """Return the header and the layout of the archive that `storage` has open under `path`.

    Raises ArchiveError for a file that is empty, foreign, newer, truncated or damaged.
    """
    import h5py

    if storage.size == 0:
        raise ArchiveError(f"{path} is empty; expected an archive that orbits.propagate(archive=...) wrote.")
    if bytes(storage.read(0, min(len(_SIGNATURE), storage.size))) != _SIGNATURE:
        raise ArchiveError(f"{path} is not an HDF5 file; expected an archive that orbits.propagate(archive=...) wrote.")
    try:
        with h5py.File(StoredFile(storage), "r") as file:
            _check_schema(file, path)
            names = json.loads(_text(file.attrs["header_items"]))
            items: dict[str, Item] = {name: _read_item(file, name, storage.size) for name in names}
            if headers.checksum(items) != _text(file.attrs["header_checksum"]):
                raise ValueError("the header does not hold its checksum")
            try:
                found = headers.from_items(items)
            except ArchiveError as error:
                raise ArchiveError(f"{path} is not as a run writes it: {error} Restore it from a copy.") from error
            layout = _layout(file, (len(found.grid), len(found.system), 3), found.steps, path)
    except (ArchiveError, StorageError):
        raise
    # HDF5 reports damage as OSError, KeyError, ValueError, RuntimeError and more, depending on where it is.
    except Exception as error:
        reason = str(error).strip().partition("\n")[0][:300] or type(error).__name__
        kind = "truncated" if "truncated" in reason else "damaged"
        raise ArchiveError(f"{path} is {kind} ({reason}). Restore it from a copy.") from error
    _check_places(layout, storage.size, path)
    return found, layout


def _check_places(layout: Layout, size: int, path: Path) -> None:
    """Refuse arrays that are not within the file, or that overlap: writing one would change the other."""
    places = [layout.q, layout.v, layout.chunks, layout.commits]
    places += [place for slot in layout.checkpoints for place in slot.values()]
    if layout.steps is not None:
        places += [layout.steps.t, layout.steps.q, layout.steps.v, layout.steps.chunks]
    taken = sorted((place.offset, place.offset + place.size) for place in places if place.size)
    end = taken[-1][1]
    if end > size:
        raise ArchiveError(f"{path} is truncated: {size} of {end} bytes are there. Restore it from a copy.")
    if any(first_end > second for (_, first_end), (second, _) in pairwise(taken)):
        raise ArchiveError(f"{path} is damaged (two of its arrays overlap). Restore it from a copy.")


def _check_schema(file: Any, path: Path) -> None:
    if "orbits" not in file.attrs:
        raise ArchiveError(
            f"{path} is an HDF5 file, but not an archive of orbits: it has no attribute 'orbits'. Expected a file that "
            "orbits.propagate(archive=...) wrote."
        )
    schema = _text(file.attrs["orbits"])
    if schema not in (SCHEMA, SCHEMA_OF_MODELS):
        raise ArchiveError(
            f"{path} has schema {schema!r}; this version of orbits reads {SCHEMA!r}. It was written by a newer one: "
            "pip install --upgrade orbits."
        )


def _preallocate(group: Any, name: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> Any:
    import h5py

    creation = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    creation.set_layout(h5py.h5d.CONTIGUOUS)
    creation.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    creation.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    space = h5py.h5s.create_simple(shape) if shape else h5py.h5s.create(h5py.h5s.SCALAR)
    kind = h5py.h5t.py_create(dtype, logical=True)
    return h5py.Dataset(h5py.h5d.create(group.id, name.encode(), kind, space, creation))


def _layout(file: Any, shape: tuple[int, int, int], steps: int, path: Path) -> Layout:
    def place(name: str, shape: tuple[int, ...] | None, dtype: np.dtype[Any] | None) -> Place:
        """Return where an array is in the file. Raises ValueError for another shape or type than expected (None: any),
        and ArchiveError for an array that is not contiguous.
        """
        dataset = _own(file, name)
        if shape is not None and dataset.shape != shape:
            raise ValueError(f"{name} has shape {dataset.shape}, expected {shape}")
        if dtype is not None and dataset.dtype != dtype:
            raise ValueError(f"{name} has type {dataset.dtype}, expected {dtype}")
        if dtype is None and dataset.dtype.kind not in "biuf":
            raise ValueError(f"{name} has type {dataset.dtype}, expected numbers")
        offset = dataset.id.get_offset()
        if offset is None and dataset.size:
            raise ArchiveError(
                f"{path} was rewritten by another tool: /{name} is no longer one contiguous array. Use the original, "
                "or make it contiguous again: h5repack -l CONTI."
            )
        return Place(offset or 0, dataset.shape, dataset.dtype)

    checkpoints = tuple(
        {name: place(f"checkpoints/{slot}/{name}", None, None) for name in sorted(_own(file, f"checkpoints/{slot}"))}
        for slot in range(SLOTS)
    )
    floats = np.dtype("<f8")
    return Layout(
        q=place("q", shape, floats),
        v=place("v", shape, floats),
        chunks=place("chunks", shape[:1], CHUNK),
        commits=place("commits", (SLOTS,), ROW),
        checkpoints=checkpoints,
        steps=_steps(place, steps, shape[1], checkpoints) if steps else None,
    )


def _steps(
    place: Callable[..., Place], room: int, bodies: int, checkpoints: tuple[dict[str, Place], ...]
) -> StepPlaces:
    """Return the places of the states at the beginnings of steps."""
    for slot in checkpoints:
        if KEPT not in slot or (slot[KEPT].shape, slot[KEPT].dtype) != (NOTHING_KEPT.shape, NOTHING_KEPT.dtype):
            raise ValueError(f"the checkpoint does not tell how many steps are kept: it has no {KEPT}")
    return StepPlaces(**{name: place(f"steps/{name}", *kind) for name, kind in _step_shapes(room, bodies).items()})


def _write_item(file: Any, name: str, item: Item) -> None:
    place, at, attribute = name.partition("@")
    if at:
        owner = file.require_group(place) if place and place not in file else file[place or "/"]
        if isinstance(item, str):
            owner.attrs.create(attribute, _fixed(item))
        else:
            owner.attrs[attribute] = item
    elif isinstance(item, list):
        file.create_dataset(name, data=_fixed(item))
    else:
        file.create_dataset(name, data=np.asarray(item, dtype="<f8"))


def _fixed(text: str | list[str]) -> NDArray[Any]:
    """Return texts as UTF-8 of fixed length, in HDF5's type for that.

    Texts of variable length would be stored in HDF5's global heap, which has no checksums: a flipped bit there has
    caused an endless loop in the library.
    """
    import h5py

    encoded = np.array(np.char.encode(text, "utf-8"))
    return encoded.astype(h5py.string_dtype("utf-8", max(1, encoded.dtype.itemsize)))


def _read_item(file: Any, name: str, most: int) -> Item:
    place, at, attribute = name.partition("@")
    if at:
        value = _own(file, place).attrs[attribute]
        return float(value) if isinstance(value, np.floating) else _text(value)
    dataset = _own(file, name)
    if dataset.nbytes > most:
        raise ValueError(f"{name} claims {dataset.nbytes} bytes in a file of {most}")
    if dataset.dtype.kind == "f":
        return np.asarray(dataset[()], dtype=np.float64)
    return [str(text) for text in dataset.asstr()[()]]


def _own(file: Any, name: str) -> Any:
    """Return an object of this file. Raises ValueError for links, and for data stored in other files."""
    import h5py

    found = file
    for part in filter(None, name.split("/")):
        if found.id.links.get_info(part.encode()).type != h5py.h5l.TYPE_HARD:
            raise ValueError(f"{name} is a link; expected what a run wrote into this file")
        found = found[part]
    if isinstance(found, h5py.Dataset) and (found.external or found.is_virtual):
        raise ValueError(f"the bytes of {name} are in another file")
    return found


def _text(value: Any) -> str:
    return value.decode() if isinstance(value, bytes) else str(value)


def resolved(path: str | os.PathLike[str]) -> Path:
    """Return the absolute path, with links resolved. Raises ArchiveError for an invalid path."""
    try:
        return Path(os.path.realpath(os.fspath(path)))
    except (TypeError, ValueError) as error:
        raise ArchiveError(f"{shown(path)} is not a path ({error}); expected something like 'run.h5'.") from error
