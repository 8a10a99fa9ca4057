"""A kernel in memory: machine code that calls only code compiled into its own library.

A kernel that is not inlined into its caller is copied: it exists once in its own library and once in that of each
caller, and is optimized each time. A second optimization may fuse a*b + c*d the other way, and change the last bit.
Numba gives the copies one name, and all calls go to the copy that a process has loaded first: with an empty cache on
disk the callee's own, later a copy in the library of the caller, or of another kernel that happened to be loaded
before. Here each library calls its own copies, which are invisible to others: equal inputs then give equal bits, in
whatever order code was compiled or loaded.

Functions of one qualified name and one signature, such as those that one factory makes, have a number in their names,
which Numba counts from 1 in each process. One that comes out of the cache and another that is compiled now could have
the same, and in the library that calls both one would take the place of the other: wrong results, kept in the cache.
Here each process begins to count at a random number.

It uses private parts of Numba, as the cache does; pyproject.toml pins the tested range of versions.
"""

from __future__ import annotations

import itertools
import os
import secrets
from typing import Any

from llvmlite.binding import Linkage, parse_assembly
from numba.core.bytecode import FunctionIdentity
from numba.core.codegen import JITCodeLibrary, RuntimeLinker
from numba.core.compiler import Compiler

from orbits.kernels.compile.operator_types import remembering

ENVIRONMENT = "_ZN08NumbaEnv"
"""Prefix of the names of the variables by which Numba finds the constants of a function."""


def _begin_numbers() -> None:
    """Let the numbers in the names of functions differ from those of other processes."""
    FunctionIdentity._unique_ids = itertools.count(secrets.randbits(60))


_begin_numbers()
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_begin_numbers)


UNNEEDED = ("WithLifting", "InlineClosureLikes", "InlineOverloads", "NopythonRewrites")
"""Passes of Numba for what no kernel has: object mode, closures, code inlined before it is typed, and arithmetic with
whole arrays."""


class KernelLibrary(JITCodeLibrary):
    """The machine code of one kernel for one signature."""

    def _finalize_final_module(self) -> None:
        """Hide the copies of other kernels from the linker, after optimization and before code generation.

        Callers get a module in which nothing is hidden, so that they contain one copy of a kernel, not one for each
        path to it.
        """
        self._shared_module = _open(self._final_module.clone())
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == Linkage.linkonce_odr:
                function.linkage = "internal"
        super()._finalize_final_module()


class CalleeLibrary(KernelLibrary):
    """A kernel that is called only by kernels, which copy it; it has no machine code of its own, which would never run.

    Kernels that call each other recursively are called by address, and have machine code.
    """

    def _optimize_final_module(self) -> None:
        """Leave the optimization to the kernel at the top: each caller in between would begin it again."""

    def _finalize_final_module(self) -> None:
        """Keep the module for callers; machine code is made only of the variables by which Numba finds its
        constants.
        """
        variables = list(self._final_module.global_variables)
        if any(variable.name.startswith(RuntimeLinker.PREFIX) for variable in variables):
            super()._finalize_final_module()
            return
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        whole = self._final_module
        self._shared_module = _open(whole)
        self._final_module = parse_assembly("\n".join(str(x) for x in variables if x.name.startswith(ENVIRONMENT)))
        self._final_module.name, self._final_module.triple = whole.name, whole.triple
        self._final_module.data_layout = whole.data_layout
        JITCodeLibrary._finalize_final_module(self)

    def get_llvm_str(self) -> str:
        """Return the code that callers copy."""
        return str(self._get_module_for_linking())


class KernelCompiler(Compiler):
    """Numba's compiler, which writes into a `KernelLibrary`."""

    library: type[KernelLibrary] = KernelLibrary

    def __init__(self, typingctx: Any, *rest: Any) -> None:
        super().__init__(remembering(typingctx), *rest)

    def define_pipelines(self) -> Any:
        """Return Numba's passes that kernels need. They make one of Numba's own libraries only if there is none."""
        if self.state.library is None:
            self.state.library = self.library(self.state.targetctx.codegen(), self.state.func_id.func_qualname)
            self.state.library.enable_object_caching()
        pipelines = super().define_pipelines()
        for passes in pipelines:
            passes.passes = [x for x in passes.passes if x[0].__name__ not in UNNEEDED]
            passes.finalize()
        return pipelines


class CalleeCompiler(KernelCompiler):
    """The compiler of kernels that are called only by kernels."""

    library = CalleeLibrary


def _open(module: Any) -> Any:
    """Return a module whose functions may be in several libraries."""
    for function in module.functions:
        if not function.is_declaration and function.linkage == Linkage.external:
            function.linkage = "linkonce_odr"
    return module
