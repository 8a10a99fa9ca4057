"""Where generated modules live, so that another process finds them, and Numba's compiled code beside them."""

from __future__ import annotations

import contextlib
import getpass
import hashlib
import importlib.util
import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

from orbits.kernels.compile import source_stamp


def digest(*parts: str) -> str:
    """Return a hash of some texts and of all kernel sources of this package, with which generated code goes stale."""
    text = "\0".join((*parts, source_stamp()))
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def folder() -> Path:
    """Return the folder of generated modules: in NUMBA_CACHE_DIR, else XDG_CACHE_HOME or ~/.cache, else a private
    temporary folder.
    """
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser())
    places = [Path(chosen) / "orbits" if chosen else home / "orbits" / "lagrangians"]
    with contextlib.suppress(KeyError, OSError):
        places.append(Path(tempfile.gettempdir()) / f"orbits-{getpass.getuser()}")
    for place in places:
        with contextlib.suppress(OSError):
            place.mkdir(parents=True, exist_ok=True, mode=0o700)
            owned = not hasattr(os, "getuid") or place.stat().st_uid == os.getuid()
            if owned and os.access(place, os.W_OK):
                return place
    return Path(tempfile.mkdtemp(prefix="orbits-"))


def module(key: str, write: Callable[[], str]) -> ModuleType:
    """Return the generated module of that key, made by `write` if no process has made it before."""
    name = f"orbits_lagrangian_{key}"
    if name in sys.modules:
        return sys.modules[name]
    place = folder()
    path = place / f"{name}.py"
    if not path.exists():
        text = write()
        # Written aside and renamed: another process sees the whole file or none.
        handle, partial = tempfile.mkstemp(dir=place, prefix=f"{name}.", suffix=".partial")
        with os.fdopen(handle, "w") as file:
            file.write(text)
        if path.exists():
            Path(partial).unlink()  # a new time stamp would make compiled code stale
        else:
            os.replace(partial, path)
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"cannot load {path}")
    made = importlib.util.module_from_spec(spec)
    sys.modules[name] = made
    try:
        spec.loader.exec_module(made)
    except BaseException:
        del sys.modules[name]
        raise
    return made
