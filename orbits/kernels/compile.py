"""`@kernel`, the only way this package compiles a function.

Numba's disk cache looks at the file of the function it compiles, not at the files of the functions called from it:
after an edit in `gravity.py` a loop cached from `gauss.py` would go on computing the old digits. Every cache entry is
therefore stamped with a hash of all kernel sources; any edit makes all entries stale at once. What else is checked
before an entry is used is in `keeping.py`.
"""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import llvmlite.binding
import numba
from numba.core import config as numba_config

from orbits.kernels.keeping import KernelCache

config: Any = numba_config  # its attributes are set at run time

KERNEL_FOLDERS = ("kernels", "lagrangians", "forces", "integrators")


@lru_cache(maxsize=1)
def source_stamp() -> str:
    """Return the SHA-256 of every source file that may hold a kernel."""
    package = Path(__file__).resolve().parent.parent
    digest = hashlib.sha256()
    for folder in KERNEL_FOLDERS:
        for path in sorted((package / folder).glob("**/*.py")):
            digest.update(path.relative_to(package).as_posix().encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()


@lru_cache(maxsize=1)
def cpu_features() -> frozenset[str]:
    """Return the names of the CPU features that kernels are compiled for, e.g. {"avx2", "fma"}."""
    if config.CPU_FEATURES is not None:
        return frozenset(name[1:] for name in config.CPU_FEATURES.split(",") if name.startswith("+"))
    return frozenset(name for name, on in llvmlite.binding.get_host_cpu_features().items() if on)


def cpu_name() -> str:
    """Return the name of the CPU that kernels are compiled for."""
    return config.CPU_NAME or llvmlite.binding.get_host_cpu_name()


def kernel(function: Callable | None = None, *, inline: bool = False, exact: bool = False) -> Any:
    """Compile `function` with Numba: no GIL, cached on disk, a*b + c fused, nothing else relaxed.

    inline : copy the body into every caller (for the few lines inside an inner loop)
    exact : do not even fuse; for error-free transformations
    """

    def compile_function(function: Callable) -> Any:
        options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "forceinline": inline}
        options["fastmath"] = set() if exact else {"contract"}
        if not Path(inspect.getfile(function)).is_file() and not function.__code__.co_filename.startswith("<ipython"):
            return numba.njit(**options)(function)  # typed into a session: there is no file to keep a cache for
        dispatcher: Any = numba.njit(**options)(function)
        dispatcher._cache = KernelCache(function, source_stamp())
        return dispatcher

    return compile_function if function is None else compile_function(function)
