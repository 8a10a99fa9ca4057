"""The result of `@kernel`: Numba's dispatcher with four differences.

* For compiled callers it compiles without the wrapper for calls from Python: that wrapper takes a fifth of the compile
  time, and most kernels are never called from Python. Those that are get a separate entry point.
* It compiles without Numba's runtime (`_nrt`): no reference counts, no allocation.
* Compiled code calls nothing outside its own library, so that the same input gives the same bits, in whatever order
    code
  was compiled or loaded (see `code_library.py`).
* If a kernel allocates, the error message says where.

It uses private parts of Numba, as the cache does; pyproject.toml pins the tested range of versions.
"""

from __future__ import annotations

import contextlib
import gc
import inspect
import linecache
import re
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

from numba import types
from numba.core.compiler_lock import global_compiler_lock
from numba.core.errors import NumbaError
from numba.core.registry import CPUDispatcher

from orbits.errors import InputError
from orbits.kernels.compile.code_library import CalleeCompiler, KernelCompiler
from orbits.kernels.compile.disk_cache import KernelCache
from orbits.kernels.compile.source_hash import is_covered

NEEDS_RUNTIME = ("NRT required but not enabled", "Only accept returning of array passed into the function")
"""Numba's messages for a function that allocates but is compiled without the runtime."""


class _Compiled(CPUDispatcher):
    """A function and its compiled versions, one for each signature.

    options : Numba's options
    stamp : text that identifies the sources of cached code; None if nothing can be cached
    purpose : a word that distinguishes its cache from others of the same function
    compiler : the class of the compiler
    """

    def __init__(
        self,
        function: Callable[..., Any],
        options: Mapping[str, Any],
        stamp: str | None,
        purpose: str = "",
        compiler: type[KernelCompiler] = KernelCompiler,
    ) -> None:
        target = {"nopython": True, "_nrt": False, "no_cfunc_wrapper": True, **options}
        super().__init__(function, targetoptions=target, pipeline_class=compiler)
        self._options, self._stamp, self._purpose = options, stamp, purpose
        # For files outside the package, size and time must be those when the file was read.
        self._covered = is_covered(inspect.getfile(function))
        if not self._covered and stamp is not None:
            self._cache = self.cache

    @cached_property
    def cache(self) -> KernelCache:
        """The cache of the compiled code."""
        return KernelCache(self.py_func, str(self._stamp), covered=self._covered, purpose=self._purpose)

    def compile(self, signature: Any) -> Any:
        """Compile for a signature, unless already compiled. Raises InputError if the function allocates."""
        if self._stamp is not None:
            self._cache = self.cache
        try:
            with global_compiler_lock, _garbage_left():
                return super().compile(signature)
        except NumbaError as error:
            if any(sign in str(error) for sign in NEEDS_RUNTIME):
                raise InputError(_allocates(self.py_func, str(error))) from error
            raise


class Kernel(_Compiled):
    """A kernel for calls from Python; for compiled callers, `callee` is compiled instead."""

    def __init__(self, function: Callable[..., Any], options: Mapping[str, Any], stamp: str | None) -> None:
        super().__init__(function, options, stamp)
        if not self._covered:
            vars(self)["callee"] = self._without_entry("callee", CalleeCompiler)

    @cached_property
    def callee(self) -> _Compiled:
        """The same function for compiled callers, which copy it. Calling it from Python would crash the process."""
        return self._without_entry("callee", CalleeCompiler)

    @cached_property
    def addressed(self) -> _Compiled:
        """The same function for calls by address. Calling it from Python would crash the process."""
        return self._without_entry("addressed", KernelCompiler)

    def _without_entry(self, purpose: str, compiler: type[KernelCompiler]) -> _Compiled:
        return _Compiled(self.py_func, {**self._options, "no_cpython_wrapper": True}, self._stamp, purpose, compiler)

    def _reduce_states(self) -> dict[str, Any]:
        return {"function": self.py_func, "options": self._options, "stamp": self._stamp}

    @classmethod
    def _rebuild(cls, function: Callable[..., Any], options: Mapping[str, Any], stamp: str | None) -> Kernel:
        return cls(function, options, stamp)

    @property
    def _numba_type_(self) -> Any:
        """The Numba type of this object."""
        return types.Dispatcher(self.callee)


@contextlib.contextmanager
def _garbage_left() -> Iterator[None]:
    """Switch garbage collection off until the end.

    Compiling makes millions of objects, most of which live for a while: repeated garbage collection took a seventh of
    the time.
    """
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


def _allocates(function: Callable[..., Any], report: str) -> str:
    """Return a message that says where a kernel allocates, from Numba's report, and what to do."""
    file = inspect.getfile(function)
    seen = re.findall(r"at (\S+) \((\d+)\)", report)
    places = [int(line) for path, line in seen if Path(path).name == Path(file).name]
    line = linecache.getline(file, places[-1]).strip() if places else ""
    where = f", line {places[-1]}" + (f", `{line}`" if line else "") if places else ""
    return (
        f"the kernel {function.__name__} ({file}{where}) allocates memory, or returns an array that was not an "
        "argument; kernels run inside a step and cannot. What allocates: np.zeros and its like, lists, arithmetic with "
        "whole arrays (2.0 * q), np.sum and its like, and out[:] = q. Loop over the elements, and write into arrays "
        "that the kernel is given."
    )
