"""Compiled kernels on disk: Numba's cache, checked before any part of it is used.

Numba unpickles and links the contents of its files unchecked. A file that is truncated, zeroed or has one bit flipped
(by a power cut or a bad disk) then crashes every later process, with a raw error or a segmentation fault; a file
written by another user is executed. Here an index begins with its own checksum and names each data file by a checksum
of its contents; both are compared before anything is unpickled, and the owner and mode of files and folders are
checked.

Entries belong to a file *and* to the name of its module: compiled code refers to the module by name, and the same file
is `__main__` when it is run as a script.
"""

from __future__ import annotations

import contextlib
import hashlib
import inspect
import os
import pickle
import stat
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from numba import types
from numba.core import caching
from numba.core.codegen import RuntimeLinker
from numba.core.serialize import dumps

from orbits.kernels.compile import trusted_files
from orbits.kernels.compile.entry_locks import locked
from orbits.kernels.compile.frozen import frozen, instructions

CHECKSUM_BYTES = 16


def checksum(data: bytes) -> bytes:
    """Return a checksum of 16 bytes; at 1 GB/s, its time is negligible compared with linking."""
    return hashlib.blake2b(data, digest_size=CHECKSUM_BYTES).digest()


class CheckedFiles(caching.IndexDataCacheFile):
    """The index of one kernel and its data files, one for each signature.

    owners : users whose files are trusted in addition to our own and root's: the owners of the source
    """

    def __init__(self, folder: str, base: str, source_stamp: Any, owners: frozenset[int]) -> None:
        super().__init__(folder, base, source_stamp)
        self._folder, self._base, self._owners = Path(folder), base, owners

    def load(self, key: Any) -> Any:
        """Return the entry of a signature, or None if there is no usable one."""
        name = self._load_index().get(key)
        if name is None:
            return None
        path = self._folder / name
        data = self._read(path)
        if data is None:
            return None
        if name != self._name_of(data):
            self._discard(path, _damaged(path))
            return None
        try:
            return pickle.loads(data)
        except (ImportError, AttributeError):  # it refers to a module that this process does not have
            return None

    def save(self, key: Any, data: Any) -> None:
        """Save the entry of a signature; if that is impossible, warn and continue without."""
        try:
            payload = self._dump(data)
            name = self._name_of(payload)
            trusted_files.write(self._folder / name, payload)
            with locked(self._folder, f"index {self._base}"):
                overloads = {**self._load_index(), key: name}
                self._save_index(overloads)
                self._remove_all_but(set(overloads.values()))
        except OSError as error:
            trusted_files.warn(
                f"compiled kernels cannot be kept in {self._folder} ({error.strerror}): each process will compile "
                "them anew. Free some space there, or choose another folder with NUMBA_CACHE_DIR."
            )

    def alone(self, key: Any) -> contextlib.AbstractContextManager[None]:
        """Return a context in which no other process makes the entry of a signature."""
        return locked(self._folder, f"entry {self._base} {key}")

    def _load_index(self) -> dict[Any, str]:
        path = Path(self._index_path)
        data = self._read(path)
        if data is None:
            return {}
        body = data[CHECKSUM_BYTES:]
        if data[:CHECKSUM_BYTES] != checksum(body):
            self._discard(path, _damaged(path))
            return {}
        version, rest = pickle.loads(body)
        # Compared before the rest is read, which may refer to missing modules.
        if version != self._version:
            return {}
        try:
            stamp, overloads = pickle.loads(rest)
        except (ImportError, AttributeError):
            return {}
        return overloads if stamp == self._source_stamp else {}

    def _save_index(self, overloads: dict[Any, str]) -> None:
        body = pickle.dumps((self._version, self._dump((self._source_stamp, overloads))))
        trusted_files.write(Path(self._index_path), checksum(body) + body)

    def _read(self, path: Path) -> bytes | None:
        try:
            return trusted_files.read(path, self._owners)
        except FileNotFoundError:
            return None
        except trusted_files.DistrustedError as error:
            self._discard(path, str(error))
            return None
        except OSError as error:
            trusted_files.warn(f"the file {path} of kernels cannot be read ({error.strerror}); they are compiled anew.")
            return None

    def _discard(self, path: Path, warning: str) -> None:
        with contextlib.suppress(OSError):
            path.unlink()
        trusted_files.warn(warning)

    def _name_of(self, payload: bytes) -> str:
        return f"{self._base}.{checksum(payload).hex()}.nbc"

    def _remove_all_but(self, names: set[str]) -> None:
        """Remove data files that are not in the index: those of earlier sources."""
        for name in os.listdir(self._folder):  # many times as fast as a pattern
            if name.startswith(f"{self._base}.") and name.endswith(".nbc") and name not in names:
                (self._folder / name).unlink(missing_ok=True)


def _damaged(path: Path) -> str:
    return f"the file {path} of compiled kernels is damaged (its checksum does not match): they are compiled anew."


class _Private:
    """A private folder; otherwise `ensure_cache_path` raises OSError, and the next place is tried."""

    def ensure_cache_path(self: Any) -> None:
        trusted_files.make_private(Path(self.get_cache_path()))


class _BesideSource:
    """The `__pycache__` beside the source, if no other users may write there than in the folder of the source."""

    def ensure_cache_path(self: Any) -> None:
        super().ensure_cache_path()  # type: ignore[misc]
        place = Path(self.get_cache_path())
        source = place.parent.stat()
        # If the sticky bit is set, as in /tmp, others may write beside the source, but not change it.
        shared = 0 if source.st_mode & stat.S_ISVTX else source.st_mode & trusted_files.OTHERS
        reason = trusted_files.distrusted(place.stat(), owners=_owners(self._py_file), shared=shared)
        if reason is not None:
            raise PermissionError(f"{place} {reason}")


class _Temporary(_Private):
    """A private temporary folder, the last resort."""

    def get_cache_path(self: Any) -> str:
        return str(trusted_files.temporary_folder() / self.get_suitable_cache_subpath(self._py_file))


def _place(way: type, name: str) -> Any:
    """Return Numba's locator of that name (with an underscore in front in 0.61), with our check of its folder."""
    return type(name, (way, getattr(caching, name, None) or getattr(caching, f"_{name}")), {})


PLACES = [
    _place(_Private, "UserProvidedCacheLocator"),  # NUMBA_CACHE_DIR
    _place(_BesideSource, "InTreeCacheLocator"),
    _place(_Private, "UserWideCacheLocator"),
    _place(_Private, "IPythonCacheLocator"),  # code typed into a session
    _place(_Temporary, "UserWideCacheLocator"),
]
"""The places for entries; the first usable one is taken."""


class _Implementation(caching.CompileResultCacheImpl):
    _locator_classes = PLACES

    def get_filename_base(self, fullname: str, abiflags: str) -> str:
        """Return the beginning of the names of a kernel's files, without its line number, which changes with
        docstrings.
        """
        version = f"py{sys.version_info[0]}{sys.version_info[1]}{abiflags}"
        return f"{fullname.replace('<', '').replace('>', '')}.{version}"

    def check_cachable(self, compiled: Any) -> bool:
        """Return whether a later process can use an entry: not if kernels call each other by addresses of this process.

        Such code would crash a process that loads it; it is compiled anew each time.
        """
        names = [variable.name for variable in compiled.library._final_module.global_variables]
        return not any(name.startswith(RuntimeLinker.PREFIX) for name in names) and super().check_cachable(compiled)


class KernelCache(caching.FunctionCache):
    """The cache of one kernel. It uses private parts of Numba; pyproject.toml pins the tested range of versions.

    stamp : text that must agree for an entry to be used
    covered : whether that text changes with the kernel's own file; if not, size and time of the file must agree too
    purpose : a word that distinguishes the caches of a function that is compiled in several ways
    """

    _impl_class = _Implementation
    _cache_file: CheckedFiles

    def __init__(self, function: Callable[..., Any], stamp: str, *, covered: bool, purpose: str = "") -> None:
        super().__init__(function)
        module = checksum(f"{function.__module__}{purpose}".encode()).hex()[:8]
        base, locator = f"{self._impl.filename_base}.{module}", self._impl.locator
        owners = _owners(inspect.getfile(function))
        self._cache_file = CheckedFiles(self.cache_path, base, None if covered else locator.get_source_stamp(), owners)
        self._cache_file._version = f"{self._cache_file._version} {stamp}"
        self._instructions = checksum(instructions(function.__code__).encode())

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the saved code of a signature, or None.

        Numba would first refresh its registries, with a tenth of a second of imports. Loaded code does not need them,
        and each compilation refreshes them anyway.
        """
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)

    def alone(self, sig: Any) -> contextlib.AbstractContextManager[None]:
        """Return a context in which no other process compiles for a signature."""
        return self._cache_file.alone(sig)

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        """Return the key of an entry, which also distinguishes functions of the same name in one file, those that read
        other values, and records of the same types with other fields.
        """
        captured = [cell.cell_contents for cell in self._py_func.__closure__ or ()]
        own = (checksum(dumps(captured)) if captured else b"") + frozen(self._py_func).encode()
        return sig, codegen.magic_tuple(), self._instructions, own, *fields_of_records(getattr(sig, "args", sig))


def fields_of_records(arguments: Any) -> Iterator[tuple[str, ...]]:
    """Return the names of the fields of all tuples among the types of arguments, and within these; a plain tuple has
    none.
    """
    for one in arguments:
        if isinstance(one, types.BaseTuple):
            yield tuple(getattr(one, "fields", ()))
            yield from fields_of_records(one)


def _owners(source: str) -> frozenset[int]:
    try:
        return frozenset({os.stat(source).st_uid})
    except OSError:  # typed into a session
        return frozenset()
