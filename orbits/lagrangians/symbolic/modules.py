"""Where generated modules live, so that another process finds them, and Numba's compiled code beside them."""

from __future__ import annotations

import contextlib
import getpass
import hashlib
import importlib.util
import os
import sys
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

from orbits.kernels.compile import source_stamp

_LOADING = threading.RLock()


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
    with _LOADING:  # another thread must not see a module half executed
        if name in sys.modules:
            return sys.modules[name]
        place = folder()
        path = place / f"{name}.py"
        if not path.exists():
            _publish(path, write())
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


def _publish(path: Path, text: str) -> None:
    """Write a file that other processes see whole or not at all; the first to come is the one that stays.

    A second one would have another time stamp, with which the code that Numba keeps goes stale.
    """
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f"{path.stem}.", suffix=".partial")
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        file.write(text)
    try:
        os.link(name, path)
    except FileExistsError:
        pass
    except OSError:  # a file system without hard links
        os.replace(name, path)
        return
    Path(name).unlink()
