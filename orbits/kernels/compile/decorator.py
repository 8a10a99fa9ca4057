"""`@kernel`, the only way this package compiles a function.

`source_hash.py` decides when a cached entry is stale, and `disk_cache.py` checks entries before they are used.
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import llvmlite.binding
from numba.core import config as numba_config

from orbits.kernels.compile.dispatcher import Kernel
from orbits.kernels.compile.source_hash import is_covered, source_stamp

config: Any = numba_config  # its attributes are set at run time


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
    exact : without fusing; for error-free transformations

    A kernel writes into arrays that are passed to it: one that allocates raises InputError when it is compiled.
    """

    def compile_function(function: Callable) -> Kernel:
        options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "forceinline": inline}
        options["fastmath"] = set() if exact else {"contract"}
        # Code typed into a session has no file to keep a cache for, unless IPython makes one.
        file = inspect.getfile(function)
        kept = is_covered(file) or os.path.isfile(file) or file.startswith("<ipython")
        return Kernel(function, options, source_stamp() if kept else None)

    return compile_function if function is None else compile_function(function)
