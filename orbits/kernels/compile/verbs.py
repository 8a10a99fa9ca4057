"""`@verb`: functions of compiled code whose code depends on the types of their arguments.

The decorated function is called by Numba, while it compiles a caller, with the types of the arguments; it returns the
kernel to call or the function to compile for them, or None to refuse them. Its docstring says what the compiled
function does.

A kernel, or an intrinsic, is called as it is. A function that only calls one would be compiled like any other, and
optimize all code of the kernel once more.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, NamedTuple, TypeVar

from numba import types
from numba.core.extending import _Intrinsic
from numba.core.typing.templates import _OverloadFunctionTemplate, infer, infer_global, make_overload_template

from orbits.kernels.compile.code_library import CalleeCompiler
from orbits.kernels.compile.dispatcher import Kernel

Choice = TypeVar("Choice", bound=Callable[..., Any])

INLINED: Any = {"forceinline": True, "error_model": "numpy", "_nrt": False, "pipeline_class": CalleeCompiler}
"""Options for functions that only lead to a kernel: they are inlined into their caller. As separate functions they
would pass registers through memory.
"""


class WithoutFirst(NamedTuple):
    """What a verb returns to have a kernel called with all arguments but the first."""

    called: Kernel


def verb(choose: Choice, options: Any = INLINED) -> Choice:
    """Return the function to call in compiled code; called from Python, it raises NotImplementedError.

    choose : returns the code for the types of the arguments; options : Numba's options for that code, unless it is a
        kernel, which has its own
    """

    @wraps(choose)
    def called(*_: Any, **__: Any) -> Any:
        raise NotImplementedError(f"{called.__name__}() is for compiled code only")

    options = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "nopython": True, **options}
    usual = make_overload_template(called, choose, options, True, "never")
    template = type(f"Verb_{choose.__name__}", (_Template,), dict(vars(usual)))
    infer(template)
    infer_global(called, types.Function(template))
    return called  # type: ignore[return-value]


class _Template(_OverloadFunctionTemplate):
    """How Numba finds the type of the call of a verb, and its code."""

    _overload_func: Callable[..., Any]
    _compiled_overloads: dict[Any, Any]

    def generic(self, args: Any, kws: Any) -> Any:
        """Return the signature of a call with arguments of these types, or None."""
        chosen = None if kws else self._overload_func(*args)
        if isinstance(chosen, WithoutFirst):
            return self._without_first(self.context.resolve_value_type(chosen.called), args)
        if not isinstance(chosen, Kernel | _Intrinsic):
            return super().generic(args, kws)
        called = self.context.resolve_value_type(chosen)
        signature = called.get_call_type(self.context, args, kws)
        if signature is not None:
            self._compiled_overloads[signature.args] = called.get_impl_key(signature)
        return signature

    def _without_first(self, called: Any, args: Any) -> Any:
        inner = called.get_call_type(self.context, args[1:], {})

        def call(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            return context.get_function(called, inner)(builder, values[1:])

        signature = inner.replace(args=(args[0], *inner.args), pysig=None)
        if signature.args not in self._compiled_overloads:
            self._compiled_overloads[signature.args] = call
            called.dispatcher.targetctx.insert_func_defn([(call, call, signature.args)])
        return signature
