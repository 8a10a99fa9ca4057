"""What a kernel becomes in memory: machine code that calls nothing but what was compiled into it.

A kernel that is not copied into its caller stands beside it, once in its own library and once in that of each caller,
optimized anew each time: after another round a*b + c*d may be fused the other way, and differ in its last bit. Numba
gives the copies one name, and all calls go to the first that a process has loaded: while the cache on disk is empty to
the callee's own, later to a copy beside the caller, or to one beside another kernel that happened to be needed before.
Here each library calls its own copies, which no other sees: equal inputs then give equal bits, in whatever order code
was compiled or loaded.

Private to Numba, as the cache; pyproject.toml pins the range in which tests have seen it work.
"""

from __future__ import annotations

from typing import Any

from llvmlite.binding import Linkage, parse_assembly
from numba.core.codegen import JITCodeLibrary, RuntimeLinker
from numba.core.compiler import Compiler

ENVIRONMENT = "_ZN08NumbaEnv"
"""How the names of the variables begin by which Numba finds the constants of a function."""


class KernelLibrary(JITCodeLibrary):
    """The machine code of one kernel for one signature."""

    def _finalize_final_module(self) -> None:
        """Hide the copies of other kernels from the linker, once all is optimized and before it becomes machine code.

        Callers are given a module in which nothing is hidden, so that they hold one copy of a kernel, not one for each
        way that leads to it.
        """
        self._shared_module = _open(self._final_module.clone())
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == Linkage.linkonce_odr:
                function.linkage = "internal"
        super()._finalize_final_module()


class CalleeLibrary(KernelLibrary):
    """A kernel that only kernels call: what they copy, without machine code of its own, which nobody would run.

    Kernels that call each other go by addresses, and have machine code.
    """

    def _finalize_final_module(self) -> None:
        """Keep the module for callers; what becomes machine code is that by which Numba finds its constants."""
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
        """Return what callers copy."""
        return str(self._get_module_for_linking())


class KernelCompiler(Compiler):
    """Numba's compiler, which writes into a `KernelLibrary`."""

    library: type[KernelLibrary] = KernelLibrary

    def define_pipelines(self) -> Any:
        """Return Numba's passes. They make a library of Numba's own only where there is none."""
        if self.state.library is None:
            self.state.library = self.library(self.state.targetctx.codegen(), self.state.func_id.func_qualname)
            self.state.library.enable_object_caching()
        return super().define_pipelines()


class CalleeCompiler(KernelCompiler):
    """A compiler for what only kernels call."""

    library = CalleeLibrary


def _open(module: Any) -> Any:
    """Return a module whose functions may stand in several libraries."""
    for function in module.functions:
        if not function.is_declaration and function.linkage == Linkage.external:
            function.linkage = "linkonce_odr"
    return module
