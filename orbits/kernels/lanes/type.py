"""The type itself: LLVM's `<8 x double>` as a Numba type, and helpers for the code generators of this package."""

from __future__ import annotations

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel.models import PrimitiveModel
from numba.extending import register_model

WIDTH = 8
"""The number of float64 in a `Lanes`."""
DOUBLE = ir.DoubleType()
VECTOR = ir.VectorType(DOUBLE, WIDTH)
INT64 = ir.IntType(64)
INT32 = ir.IntType(32)
FUSE = ("contract",)


class LanesType(types.Type):
    """The Numba type of eight float64 lanes."""

    def __init__(self) -> None:
        super().__init__(name="Lanes")


lanes = LanesType()


@register_model(LanesType)
class _LanesModel(PrimitiveModel):
    def __init__(self, dmm, fe_type):
        super().__init__(dmm, fe_type, VECTOR)


def splat(builder, value):
    seed = builder.insert_element(ir.Constant(VECTOR, ir.Undefined), value, INT32(0))
    return builder.shuffle_vector(
        seed, ir.Constant(VECTOR, ir.Undefined), ir.Constant(ir.VectorType(INT32, WIDTH), [0] * WIDTH)
    )


def constant(value):
    return ir.Constant(VECTOR, [float(value)] * WIDTH)


def widen(context, builder, value, kind):
    if isinstance(kind, LanesType):
        return value
    return splat(builder, context.cast(builder, value, kind, types.float64))


def shuffle(builder, a, b, indices):
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(INT32, len(indices)), list(indices)))


def call_intrinsic(builder, name, args, kinds=None):
    kinds = kinds or [VECTOR] * len(args)
    function = cgutils.get_or_insert_function(builder.module, ir.FunctionType(VECTOR, kinds), name)
    return builder.call(function, args)


def is_operand(kind):
    return isinstance(kind, LanesType | types.Float | types.Integer)


def element_pointer(context, builder, kind, array, index):
    """Return a pointer to element `index` of a vector, or to row `index` of an (n, 8) array."""
    data = context.make_array(kind)(context, builder, array).data
    if kind.ndim == 2:
        index = builder.mul(index, INT64(WIDTH))
    return builder.gep(data, [index])


def is_contiguous(kind, *dimensions):
    return (
        isinstance(kind, types.Array) and kind.layout == "C" and kind.dtype == types.float64 and kind.ndim in dimensions
    )


def common_type(*kinds):
    """Return the common type of operands: `Lanes` if one of them is, float64 otherwise."""
    if not all(map(is_operand, kinds)):
        return None
    return lanes if any(isinstance(k, LanesType) for k in kinds) else types.float64
