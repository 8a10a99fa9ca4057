"""The result of `@kernel`: Numba's dispatchers, made when they are needed, with six differences.

* For compiled callers it compiles without the wrapper for calls from Python: that wrapper takes a fifth of the compile
  time, and most kernels are never called from Python. Those that are get a separate entry point.
* It compiles without Numba's runtime (`_nrt`): no reference counts, no allocation.
* Compiled code calls nothing outside its own library, so that the same input gives the same bits, in whatever order
  code was compiled or loaded (see `code_library.py`).
* For callers that pass whole numbers by value, 0 or n, it is compiled once, not for each of them.
* Of several processes that need the same code, one compiles it (see `entry_locks.py`).
* If a kernel allocates, the error message says where.

It uses private parts of Numba, as the cache does; pyproject.toml pins the tested range of versions.
"""

from __future__ import annotations

import contextlib
import inspect
import linecache
import re
from collections import Counter
from collections.abc import Callable, Mapping
from functools import cached_property, update_wrapper
from pathlib import Path
from typing import Any

from numba import types
from numba.core import entrypoints, sigutils
from numba.core.compiler_lock import global_compiler_lock
from numba.core.errors import NumbaError
from numba.core.event import trigger_event
from numba.core.registry import CPUDispatcher
from numba.core.serialize import ReduceMixin

from orbits.errors import InputError
from orbits.kernels.compile.code_library import CalleeCompiler, KernelCompiler
from orbits.kernels.compile.disk_cache import KernelCache
from orbits.kernels.compile.garbage import garbage_left
from orbits.kernels.compile.source_hash import is_covered

NEEDS_RUNTIME = ("NRT required but not enabled", "Only accept returning of array passed into the function")
"""Numba's messages for a function that allocates but is compiled without the runtime."""


class Compiled(CPUDispatcher):
    """A function and its compiled versions, one for each signature.

    options : Numba's options
    stamp : text that identifies the sources of cached code; None if nothing can be cached
    purpose : a word that distinguishes its cache from others of the same function
    compiler : the class of the compiler
    """

    _cache_hits: Counter[Any]
    _cache_misses: Counter[Any]
    _compiler: Any

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
        """Compile for a signature, unless already compiled. Raises InputError if the function allocates.

        It is Numba's own way, without its timers of all calls to LLVM, which took a twentieth of the time, and with a
        lock of the entry.
        """
        args, result = sigutils.normalize_signature(signature)
        with global_compiler_lock, garbage_left(), self._compiling_counter:
            found: Any = self.overloads.get(tuple(args))
            if found is None and self._stamp is not None:
                self._cache = self.cache
                found = self._loaded(signature)
            if found is None:
                with self._cache.alone(signature) if self._stamp is not None else contextlib.nullcontext():
                    found = self._loaded(signature) or self._made(signature, args, result)
            return found.entry_point

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Return what types a call, with whole numbers that are written at the call as any others: no version is
        compiled for each. Kernels that need their values, to take elements of tuples, get them.
        """
        plain = tuple(types.unliteral(x) if isinstance(x, types.IntegerLiteral) else x for x in args)
        if plain != tuple(args):
            with contextlib.suppress(NumbaError):
                return super().get_call_template(plain, kws)
        return super().get_call_template(args, kws)

    def _compilation_chain_init_hook(self) -> None:
        """Leave Numba's extensions alone: what is in the cache is used without them."""

    def _loaded(self, signature: Any) -> Any:
        """Return the code for a signature from the cache, or None."""
        found = self._cache.load_overload(signature, self.targetctx)
        if found is not None:
            self.targetctx.insert_user_function(found.entry_point, found.fndesc, [found.library])
            self.add_overload(found)
            self._cache_hits[signature] += 1
        return found

    def _made(self, signature: Any, args: Any, result: Any) -> Any:
        """Compile for a signature, and keep the code in the cache."""
        self._cache_misses[signature] += 1
        entrypoints.init_all()
        try:
            with trigger_event("numba:compile", data={"dispatcher": self, "args": args, "return_type": result}):
                made = self._compiler.compile(args, result)
                self.add_overload(made)
        except NumbaError as error:
            if any(sign in str(error) for sign in NEEDS_RUNTIME):
                raise InputError(_allocates(self.py_func, str(error))) from error
            raise
        self._cache.save_overload(signature, made)
        return made


class Kernel(ReduceMixin):
    """A function that is compiled: for calls from Python (`entry`), for compiled callers (`callee`), and for calls by
    address (`addressed`). Each is made when it is first used: Numba takes half a millisecond for one, and of the
    hundreds of kernels that a process imports it calls a few.
    """

    def __init__(self, function: Callable[..., Any], options: Mapping[str, Any], stamp: str | None) -> None:
        update_wrapper(self, function)
        self.py_func = function
        self._options, self._stamp = options, stamp
        if not is_covered(inspect.getfile(function)):  # as it was when it was read
            self.entry, self.callee  # noqa: B018

    def __call__(self, *arguments: Any) -> Any:
        """Call it from Python."""
        return self.entry(*arguments)

    @cached_property
    def entry(self) -> Compiled:
        """The function for calls from Python."""
        return Compiled(self.py_func, self._options, self._stamp)

    @cached_property
    def callee(self) -> Compiled:
        """The same function for compiled callers, which copy it. Calling it from Python would crash the process."""
        return self._without_entry("callee", CalleeCompiler)

    @cached_property
    def addressed(self) -> Compiled:
        """The same function for calls by address. Calling it from Python would crash the process."""
        return self._without_entry("addressed", KernelCompiler)

    def _without_entry(self, purpose: str, compiler: type[KernelCompiler]) -> Compiled:
        return Compiled(self.py_func, {**self._options, "no_cpython_wrapper": True}, self._stamp, purpose, compiler)

    def _reduce_states(self) -> dict[str, Any]:
        return {"function": self.py_func, "options": self._options, "stamp": self._stamp}

    @classmethod
    def _rebuild(cls, **parts: Any) -> Kernel:
        return cls(**parts)

    @property
    def _numba_type_(self) -> Any:
        """The Numba type of this object."""
        return types.Dispatcher(self.callee)


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
