"""Calling an observer by its address.

An observer of blocks of steps is compiled once, not into each method: compiled code gets the address of the observer,
and of the memory with everything that the observer needs (see `context.py`). Addresses are arguments, so that they are
not part of cached code; address 0 means no observer.
"""

from __future__ import annotations

from threading import Lock
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import lanes

INT64 = ir.IntType(64)

OBSERVER = types.none(
    types.int64, types.Array(types.float64, 2, "C"), types.float64, types.int64, types.int64, types.int64
)
"""The signature of an observer: (context, track, h, steps, start, stop); see `context.py`."""

SEARCH = types.none(
    types.int64, types.Array(types.float64, 2, "C"), types.float64, types.int64, types.int64, types.int64, lanes
)
"""The signature of `search`: (context, track, h, steps, j, row, valid)."""

ENTER = types.none(
    types.int64,
    types.Array(types.float64, 2, "C"),
    types.int64,
    types.int64,
    types.int64,
    types.int64,
    types.float64,
)
"""The signature of `enter_passage`: (context, track, row, j, begin, end, h)."""

_KEPT: dict[tuple[Any, int], tuple[Any, Any, int]] = {}
"""What is compiled for each kernel and signature, known by its identity, as hashing it takes long; and its address."""

_LOCK = Lock()


def observer_address(kernel: Any, signature: Any = OBSERVER) -> int:
    """Return the machine address of a kernel compiled for a signature, or loaded from the cache on disk.

    The code stays in memory for the life of the process. Raises TypeError if the kernel returns another type.
    """
    with _LOCK:
        if (kernel, id(signature)) not in _KEPT:
            addressed = kernel.addressed
            addressed.compile(signature.args)
            compiled = addressed.overloads[signature.args]
            if compiled.signature.return_type != signature.return_type:
                raise TypeError(
                    f"{kernel.__name__} returns {compiled.signature.return_type}, expected {signature.return_type}"
                )
            name = compiled.fndesc.llvm_func_name
            _KEPT[kernel, id(signature)] = signature, compiled, compiled.library.get_pointer_to_function(name)
        return _KEPT[kernel, id(signature)][2]


@intrinsic
def call_observer(typingctx, address, context, track, h, steps, start, stop):
    """Call an observer, unless the address is 0."""
    return _call(OBSERVER)


@intrinsic
def call_search(typingctx, address, context, track, h, steps, j, row, valid):
    """Call the kernel at an address, which searches among eight pairs."""
    return _call(SEARCH)


@intrinsic
def call_enter(typingctx, address, context, track, row, j, begin, end, h):
    """Call the kernel at an address, which records a closest approach."""
    return _call(ENTER)


@kernel
def observe(address, context, track, h, steps, start, stop):
    """Call an observer from Python, unless the address is 0."""
    call_observer(address, context, track, h, steps, start, stop)


def _call(signature):
    """Return the type and code generator of an intrinsic that calls the code of a signature at an address."""
    result, kinds = signature.return_type, signature.args

    def codegen(context, builder, sig, args):
        pointer = context.call_conv.get_function_type(result, kinds).as_pointer()
        with builder.if_then(builder.icmp_unsigned("!=", args[0], INT64(0))):
            # Kernels raise nothing: there is no exception to pass on.
            context.call_conv.call_function(builder, builder.inttoptr(args[0], pointer), result, kinds, args[1:])
        return context.get_dummy_value()

    return types.void(types.int64, *kinds), codegen
