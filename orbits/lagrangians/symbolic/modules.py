"""The folder of generated modules, in which other processes find them, with Numba's compiled code beside them."""

from __future__ import annotations

import hashlib
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

from orbits.kernels.compile import trusted_files
from orbits.kernels.compile.disk_cache import checksum
from orbits.kernels.compile.frozen import GENERATED
from orbits.kernels.compile.source_hash import source_stamp

_LOADING = threading.RLock()


def digest(*parts: str) -> str:
    """Return a hash of some texts and of all kernel sources of this package, which determines when generated code is
    stale.
    """
    text = "\0".join((*parts, source_stamp()))
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def module(key: str, write: Callable[[], str]) -> ModuleType:
    """Return the generated module of that key, made by `write` if no process has made it before."""
    name = f"{GENERATED}{key}"
    with _LOADING:  # another thread must not see a partially executed module
        if name in sys.modules:
            return sys.modules[name]
        path = trusted_files.user_folder("lagrangians") / f"{name}.py"
        text, warning = _kept(path)
        if text is None:
            # The first file is kept: another one would have another time stamp, which makes Numba's stored code stale.
            # An unusable file is replaced without removing it first: another process may just have written a good one.
            trusted_files.write(path, _signed(write()), replace=bool(warning))
            text = path.read_bytes()
        if warning:
            trusted_files.warn(warning)
        made = ModuleType(name)
        made.__file__ = str(path)
        sys.modules[name] = made
        try:
            # The checked text is executed: neither the file nor a .pyc beside it is read again.
            exec(compile(text, str(path), "exec"), made.__dict__)
        except BaseException:
            del sys.modules[name]
            raise
        return made


def _kept(path: Path) -> tuple[bytes | None, str]:
    """Return the text stored at `path` and ""; or None and the reason why an existing file cannot be used."""
    try:
        text = trusted_files.read(path)
    except FileNotFoundError:
        return None, ""
    except trusted_files.DistrustedError as error:
        return None, str(error)
    if text != _signed(text.partition(b"\n")[2].decode(errors="replace")):
        return None, f"the module {path} is damaged (its checksum does not match): it is made anew."
    return text, ""


def _signed(text: str) -> bytes:
    """Return the text of a module after a line with its checksum."""
    body = text.encode()
    return f"# {checksum(body).hex()}\n".encode() + body
