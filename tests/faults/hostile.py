"""Archives that somebody made up: each with the right checksums, and something in it that no run writes."""

from __future__ import annotations

import json
import shutil
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from orbits.archive import header as headers
from orbits.archive.commits import Commit

Change = Callable[[h5py.File], None]


def reseal(file: h5py.File) -> None:
    """Give the header the checksum of what it says now."""
    names = json.loads(file.attrs["header_items"])
    items = {}
    for name in names:
        place, at, attribute = name.partition("@")
        if at:
            value = file[place or "/"].attrs[attribute]
            items[name] = float(value) if isinstance(value, np.floating) else _text(value)
        elif file[name].dtype.kind == "f":
            items[name] = np.asarray(file[name][()], dtype=np.float64)
        else:
            items[name] = [str(text) for text in file[name].asstr()[()]]
    seal(file, headers.checksum(items), names)


def seal(file: h5py.File, checksum: str, names: Any) -> None:
    set_text(file, "header_checksum", checksum)
    set_text(file, "header_items", json.dumps(names))


def set_text(owner: Any, name: str, text: str) -> None:
    encoded = np.array(text.encode())
    owner.attrs.create(name, encoded.astype(h5py.string_dtype("utf-8", max(1, encoded.dtype.itemsize))))


def recommit(file: h5py.File, **changes: Any) -> None:
    """Make the last commit row stand for what the file holds now, or for what is given instead."""
    rows = file["commits"][:]
    row = max(rows, key=lambda row: row["sequence"])
    slot = (int(row["sequence"]) - 1) % 2
    crc = 0
    group = file[f"checkpoints/{slot}"]
    for name in sorted(group):
        if isinstance(group.get(name, getlink=True), h5py.HardLink) and group[name].dtype.kind != "O":
            crc = zlib.crc32(group[name][()].tobytes(), crc)
    values = {name: int(row[name]) for name in ("sequence", "samples", "chunks", "chunks_crc")}
    commit = Commit(**{**values, "checkpoint_crc": crc, **changes})
    encoded = np.frombuffer(commit.encoded().ljust(4096, b"\0"), dtype=rows.dtype)
    rows[slot] = encoded[0]
    file["commits"][:] = rows


def made(original: Path, path: Path, change: Change) -> Path:
    """Copy an archive, change it, and give it the right checksums."""
    shutil.copy(original, path)
    with h5py.File(path, "r+", locking=False) as file:
        change(file)
    return path


def _text(value: Any) -> str:
    return value.decode() if isinstance(value, bytes) else str(value)


def attribute(name: str, value: Any) -> Change:
    """Change one attribute of the header: a text as text, all else as it is."""

    def change(file: h5py.File) -> None:
        place, _, key = name.partition("@")
        owner = file[place or "/"]
        if isinstance(value, str):
            set_text(owner, key, value)
        else:
            owner.attrs.create(key, value)
        reseal(file)

    return change


def array(name: str, value: Any) -> Change:
    """Replace one array of the header."""

    def change(file: h5py.File) -> None:
        attributes = dict(file[name].attrs)
        del file[name]
        file.create_dataset(name, data=value).attrs.update(attributes)
        reseal(file)

    return change


def some(name: str, index: Any, value: float) -> Change:
    """Change some numbers of an array of the header."""

    def change(file: h5py.File) -> None:
        file[name][index] = value
        reseal(file)

    return change


def without(name: str) -> Change:
    """Leave an item of the header out, as if it had never been there."""

    def change(file: h5py.File) -> None:
        names = [each for each in json.loads(file.attrs["header_items"]) if each != name]
        set_text(file, "header_items", json.dumps(names))
        reseal(file)

    return change


def listed(text: str) -> Change:
    """Give another text for the list of items."""
    return lambda file: set_text(file, "header_items", text)


def method(**description: Any) -> Change:
    """Describe another method."""
    return attribute("@integrator", json.dumps(description))


def units(**changes: Any) -> Change:
    """Change the definition of the units."""

    def change(file: h5py.File) -> None:
        definition = json.loads(file["units"].attrs["definition"])
        set_text(file["units"], "definition", json.dumps({**definition, **changes}))
        reseal(file)

    return change


def checkpoint(name: str, value: Any) -> Change:
    """Change an array of the last checkpoint, or put another one in its place, with the right checksum."""

    def change(file: h5py.File) -> None:
        last = max(int(row["sequence"]) for row in file["commits"][:])
        for slot in (0, 1):
            group = file[f"checkpoints/{slot}"]
            if value is None:
                del group[name]
            elif callable(value):
                if slot == (last - 1) % 2:
                    value(group[name])
            else:
                if name in group:
                    del group[name]
                group.create_dataset(name, data=value)
        recommit(file)

    return change


def linked(name: str, link: Any) -> Change:
    """Put a link where an object was."""

    def change(file: h5py.File) -> None:
        del file[name]
        file[name] = link

    return change


def elsewhere(name: str, path: str) -> Change:
    """Keep the bytes of an array in another file."""

    def change(file: h5py.File) -> None:
        shape, dtype = file[name].shape, file[name].dtype
        del file[name]
        file.create_dataset(name, shape, dtype, external=[(path, 0, h5py.h5f.UNLIMITED)])

    return change


def virtual(name: str) -> Change:
    """Make an array a view of another one."""

    def change(file: h5py.File) -> None:
        shape, dtype = file[name].shape, file[name].dtype
        layout = h5py.VirtualLayout(shape, dtype)
        layout[...] = h5py.VirtualSource("/etc/hostname", name, shape)
        del file[name]
        file.create_virtual_dataset(name, layout)

    return change


def bomb(name: str) -> Change:
    """Put an array of terabytes that takes no room in the place of one of the header."""

    def change(file: h5py.File) -> None:
        del file[name]
        file.create_dataset(name, (2**40,), "<f8", chunks=(2**20,), compression="gzip")

    return change
