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

from llvmlite.binding import Linkage
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler


class KernelLibrary(JITCodeLibrary):
    """The machine code of one kernel for one signature."""

    def _finalize_final_module(self) -> None:
        """Hide the copies of other kernels from the linker, once all is optimized and before it becomes machine code.

        Callers are given a module in which nothing is hidden, so that they hold one copy of a kernel, not one for each
        way that leads to it.
        """
        self._shared_module = self._final_module.clone()
        for function in self._shared_module.functions:
            if not function.is_declaration and function.linkage == Linkage.external:
                function.linkage = "linkonce_odr"
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == Linkage.linkonce_odr:
                function.linkage = "internal"
        super()._finalize_final_module()


class KernelCompiler(Compiler):
    """Numba's compiler, which writes into a `KernelLibrary`."""

    def define_pipelines(self) -> Any:
        """Return Numba's passes. They make a library of Numba's own only where there is none."""
        if self.state.library is None:
            self.state.library = KernelLibrary(self.state.targetctx.codegen(), self.state.func_id.func_qualname)
            self.state.library.enable_object_caching()
        return super().define_pipelines()
