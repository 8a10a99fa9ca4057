"""The type itself: LLVM's `<8 x double>` as a Numba type, and helpers for the code generators of this package.

`Pair` is `<16 x double>`: two `Lanes` at once, whose instructions alternate.
"""

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
DUAL = ir.LiteralStructType([DOUBLE, VECTOR])
DUAL_ROW = ir.LiteralStructType([DOUBLE, ir.ArrayType(DOUBLE, WIDTH - 1), VECTOR], packed=True)
"""A dual number as a value, and in an array: a row of two registers, of which the first has x alone."""
INT64 = ir.IntType(64)
INT32 = ir.IntType(32)
FUSE = ("contract",)


class LanesType(types.Type):
    """The Numba type of `count` float64 lanes: 8, or 16."""

    def __init__(self, count: int) -> None:
        super().__init__(name="Lanes" if count == WIDTH else f"Lanes({count})")
        self.count = count


class DualType(types.Type):
    """The Numba type of a number with eight derivatives, see `orbits.kernels.lanes.dual`."""

    def __init__(self) -> None:
        super().__init__(name="Dual")


lanes = LanesType(WIDTH)
pair = LanesType(2 * WIDTH)
dual = DualType()


@register_model(LanesType)
class _LanesModel(PrimitiveModel):
    def __init__(self, dmm, fe_type):
        super().__init__(dmm, fe_type, vector(fe_type.count))


@register_model(DualType)
class _DualModel(PrimitiveModel):
    def __init__(self, dmm, fe_type):
        super().__init__(dmm, fe_type, DUAL)

    def get_data_type(self):
        return DUAL_ROW

    def as_data(self, builder, value):
        row = ir.Constant(DUAL_ROW, ir.Undefined)
        for here, there in ((0, 0), (1, 2)):
            row = builder.insert_value(row, builder.extract_value(value, here), there)
        return row

    def from_data(self, builder, value):
        dual = ir.Constant(DUAL, ir.Undefined)
        for here, there in ((0, 0), (1, 2)):
            dual = builder.insert_value(dual, builder.extract_value(value, there), here)
        return dual


def vector(count):
    return ir.VectorType(DOUBLE, count)


def splat(builder, value, count=WIDTH):
    undefined = ir.Constant(vector(count), ir.Undefined)
    seed = builder.insert_element(undefined, value, INT32(0))
    return builder.shuffle_vector(seed, undefined, ir.Constant(ir.VectorType(INT32, count), [0] * count))


def constant(value, count=WIDTH):
    return ir.Constant(vector(count), [float(value)] * count)


def widen(context, builder, value, kind, like=lanes):
    """Return an operand as lanes of the type `like`."""
    if isinstance(kind, LanesType):
        return value
    return splat(builder, context.cast(builder, value, kind, types.float64), like.count)


def shuffle(builder, a, b, indices):
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(INT32, len(indices)), list(indices)))


def call_intrinsic(builder, name, args, kinds=None):
    """Call an intrinsic of LLVM whose result has the type of the first argument."""
    kinds = kinds or [args[0].type] * len(args)
    function = cgutils.get_or_insert_function(builder.module, ir.FunctionType(args[0].type, kinds), name)
    return builder.call(function, args)


def suffixed(name, kind):
    """Return the name of the variant of an intrinsic for a type of LLVM: float64, or vectors of them."""
    return f"{name}.f64" if kind == DOUBLE else f"{name}.v{kind.count}f64"


def is_operand(kind):
    return isinstance(kind, LanesType | DualType | types.Float | types.Integer)


def element_pointer(context, builder, kind, array, index):
    """Return a pointer to element `index` of a vector, or to row `index` of an (n, 8) array."""
    data = context.make_array(kind)(context, builder, array).data
    if kind.ndim == 2:
        index = builder.mul(index, INT64(WIDTH))
    return builder.gep(data, [index])


def is_contiguous(kind, *dimensions, of=types.float64):
    return isinstance(kind, types.Array) and kind.layout == "C" and kind.dtype == of and kind.ndim in dimensions


def common_type(*kinds):
    """Return the common type of operands: that of the lanes or dual numbers among them, float64 if none are; None for
    several.
    """
    if not all(map(is_operand, kinds)):
        return None
    wide = {k for k in kinds if isinstance(k, LanesType | DualType)}
    if len(wide) > 1:
        return None
    return wide.pop() if wide else types.float64
