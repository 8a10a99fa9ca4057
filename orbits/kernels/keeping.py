"""Compiled kernels on disk: Numba's cache, checked before anything of it is used.

Numba unpickles and links whatever its files hold. A file cut short, zeroed or with one bit flipped (what a power cut or
a bad disk leaves) then ends every later process, in a raw error or in a segmentation fault; one written by somebody
else is executed. Here an index begins with a checksum of itself and names each data file by a checksum of what is in
it, both are compared before anything is unpickled, and owner and mode of files and folders are looked at.

Entries belong to a file *and* to the name that its module has: compiled code remembers the module by name, and the same
file is `__main__` when it is run as a script.
"""

from __future__ import annotations

import contextlib
import dis
import glob
import hashlib
import inspect
import os
import pickle
import stat
import sys
from collections.abc import Callable
from pathlib import Path
from types import CodeType
from typing import Any

from numba.core import caching
from numba.core.codegen import RuntimeLinker
from numba.core.serialize import dumps

from orbits.kernels import trust
from orbits.kernels.stamp import is_covered

CHECKSUM_BYTES = 16


def checksum(data: bytes) -> bytes:
    """Return 16 bytes that differ for data that differ in anything: 1 GB/s, so nothing beside the linking."""
    return hashlib.blake2b(data, digest_size=CHECKSUM_BYTES).digest()


class CheckedFiles(caching.IndexDataCacheFile):
    """The index of one kernel and its data files, one for each signature.

    owners : users whose files are used beside our own and root's: whoever owns the source could change that
    """

    def __init__(self, folder: str, base: str, source_stamp: Any, owners: frozenset[int]) -> None:
        super().__init__(folder, base, source_stamp)
        self._folder, self._base, self._owners = Path(folder), base, owners

    def load(self, key: Any) -> Any:
        """Return the entry of a signature, or None where there is none that can be used."""
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
        except (ImportError, AttributeError):  # it names a module that this process does not have
            return None

    def save(self, key: Any, data: Any) -> None:
        """Keep the entry of a signature; where that cannot be, warn and go on without."""
        try:
            payload = self._dump(data)
            overloads = {**self._load_index(), key: self._name_of(payload)}
            trust.write(self._folder / overloads[key], payload)
            self._save_index(overloads)
            self._remove_all_but(set(overloads.values()))
        except OSError as error:
            trust.warn(
                f"compiled kernels cannot be kept in {self._folder} ({error.strerror}): each process will compile "
                "them anew. Free some space there, or choose another folder with NUMBA_CACHE_DIR."
            )

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
        # Compared before the rest is read, which may name what is no longer there.
        if version != self._version:
            return {}
        try:
            stamp, overloads = pickle.loads(rest)
        except (ImportError, AttributeError):
            return {}
        return overloads if stamp == self._source_stamp else {}

    def _save_index(self, overloads: dict[Any, str]) -> None:
        body = pickle.dumps((self._version, self._dump((self._source_stamp, overloads))))
        trust.write(Path(self._index_path), checksum(body) + body)

    def _read(self, path: Path) -> bytes | None:
        try:
            return trust.read(path, self._owners)
        except FileNotFoundError:
            return None
        except trust.DistrustedError as error:
            self._discard(path, str(error))
            return None
        except OSError as error:
            trust.warn(f"the file {path} of kernels cannot be read ({error.strerror}); they are compiled anew.")
            return None

    def _discard(self, path: Path, warning: str) -> None:
        with contextlib.suppress(OSError):
            path.unlink()
        trust.warn(warning)

    def _name_of(self, payload: bytes) -> str:
        return f"{self._base}.{checksum(payload).hex()}.nbc"

    def _remove_all_but(self, names: set[str]) -> None:
        """Remove data files that the index does not name: those of earlier sources."""
        for path in self._folder.glob(f"{glob.escape(self._base)}.*.nbc"):
            if path.name not in names:
                path.unlink(missing_ok=True)


def _damaged(path: Path) -> str:
    return f"the file {path} of compiled kernels is damaged (its checksum does not match): they are compiled anew."


class _Private:
    """A place of our own, or none at all: `ensure_cache_path` raises OSError, and the next place is tried."""

    def ensure_cache_path(self: Any) -> None:
        trust.make_private(Path(self.get_cache_path()))


class _BesideSource:
    """The `__pycache__` beside the source, where no more users may write than in the folder of the source."""

    def ensure_cache_path(self: Any) -> None:
        super().ensure_cache_path()  # type: ignore[misc]
        place = Path(self.get_cache_path())
        source = place.parent.stat()
        # Where the sticky bit is set, as in /tmp, others may write beside the source, but not change it.
        shared = 0 if source.st_mode & stat.S_ISVTX else source.st_mode & trust.OTHERS
        reason = trust.distrusted(place.stat(), owners=_owners(self._py_file), shared=shared)
        if reason is not None:
            raise PermissionError(f"{place} {reason}")


class _Temporary(_Private):
    """A private temporary folder, where nothing else can be had."""

    def get_cache_path(self: Any) -> str:
        return str(trust.temporary_folder() / self.get_suitable_cache_subpath(self._py_file))


def _place(way: type, name: str) -> Any:
    """Return Numba's locator of that name, which began with an underscore in 0.61, with our way to judge a folder."""
    return type(name, (way, getattr(caching, name, None) or getattr(caching, f"_{name}")), {})


PLACES = [
    _place(_Private, "UserProvidedCacheLocator"),  # NUMBA_CACHE_DIR
    _place(_BesideSource, "InTreeCacheLocator"),
    _place(_Private, "UserWideCacheLocator"),
    _place(_Private, "IPythonCacheLocator"),  # what was typed into a session
    _place(_Temporary, "UserWideCacheLocator"),
]
"""Where entries may be, the first that will do."""


class _Implementation(caching.CompileResultCacheImpl):
    _locator_classes = PLACES

    def get_filename_base(self, fullname: str, abiflags: str) -> str:
        """Return how the names of a kernel's files begin: without its line, which moves with the prose above it."""
        version = f"py{sys.version_info[0]}{sys.version_info[1]}{abiflags}"
        return f"{fullname.replace('<', '').replace('>', '')}.{version}"

    def check_cachable(self, compiled: Any) -> bool:
        """Whether a later process can use an entry: not where kernels call each other, through addresses of this one.

        Loaded, such code would end the process; it is compiled anew each time.
        """
        names = [variable.name for variable in compiled.library._final_module.global_variables]
        return not any(name.startswith(RuntimeLinker.PREFIX) for name in names) and super().check_cachable(compiled)


class KernelCache(caching.FunctionCache):
    """The cache of one kernel. Private to Numba; pyproject.toml pins the range in which tests have seen it work.

    stamp : text that must agree for an entry to be used
    covered : whether that text changes with the kernel's own file; where not, size and time of the file must agree too
    purpose : a word that tells caches of one function apart that is compiled in several ways
    """

    _impl_class = _Implementation

    def __init__(self, function: Callable[..., Any], stamp: str, *, covered: bool, purpose: str = "") -> None:
        super().__init__(function)
        module = checksum(f"{function.__module__}{purpose}".encode()).hex()[:8]
        base, locator = f"{self._impl.filename_base}.{module}", self._impl.locator
        owners = _owners(inspect.getfile(function))
        self._cache_file = CheckedFiles(self.cache_path, base, None if covered else locator.get_source_stamp(), owners)
        self._cache_file._version = f"{self._cache_file._version} {stamp}"
        self._instructions = checksum(instructions(function.__code__).encode())

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the kept code of a signature, or None.

        Numba would first bring all that it can compile up to date, a tenth of a second of imports. Code that is loaded
        calls nothing of that, and a compilation begins with it anyway.
        """
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        """Return what tells entries apart, those of functions of one name in one file among them."""
        captured = [cell.cell_contents for cell in self._py_func.__closure__ or ()]
        return sig, codegen.magic_tuple(), self._instructions, checksum(dumps(captured)) if captured else b""


def identity(function: Callable[..., Any]) -> str:
    """Return text that changes when what a kernel compiles to may change, and the stamp does not."""
    name, file = f"{function.__module__}.{function.__qualname__}", inspect.getfile(function)
    if is_covered(file):
        return name
    source = Path(file).read_bytes() if Path(file).is_file() else b""  # nothing for what is typed into a session
    return f"{name} {checksum(source).hex()} {checksum(instructions(function.__code__).encode()).hex()}"


def instructions(code: CodeType) -> str:
    """Return what a function does as text: without its docstring, its comments and its lines."""
    parts = [repr((code.co_varnames, code.co_argcount))]
    for step in dis.get_instructions(code):
        shown = step.argrepr
        if isinstance(step.argval, CodeType):
            shown = instructions(step.argval)
        elif isinstance(step.argval, frozenset):  # in another order in each process
            shown = repr(sorted(step.argval, key=repr))
        parts.append(f"{step.opname} {shown}")
    return "\n".join(parts)


def _owners(source: str) -> frozenset[int]:
    try:
        return frozenset({os.stat(source).st_uid})
    except OSError:  # typed into a session
        return frozenset()
