"""`Lanes`: eight float64 in one value, with arithmetic.

Numba leaves loops over pairs of bodies scalar. This type is LLVM's `<8 x double>`: one AVX-512 register, two AVX2 or
four NEON ones, chosen by LLVM. Kernels written with `get`, `put`, `rsqrt_cubed` and operators serve float64 and
`Lanes` from one source: an element of a vector of shape (n,) is a float64, a row of an array of shape (n, 8) is a
`Lanes`.

Comparison gives `Lanes` of 1.0 and 0.0. Nothing here checks bounds.
"""

from __future__ import annotations

import operator

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel.models import PrimitiveModel
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, overload, register_model

from orbits.kernels.compile import cpu_features, kernel

WIDTH = 8
_DOUBLE = ir.DoubleType()
_VECTOR = ir.VectorType(_DOUBLE, WIDTH)
_INT64 = ir.IntType(64)
_INT32 = ir.IntType(32)
_MASK = ir.VectorType(ir.IntType(1), WIDTH)
_FUSE = ("contract",)


class LanesType(types.Type):
    """The Numba type of eight float64 lanes."""

    def __init__(self) -> None:
        super().__init__(name="Lanes")


lanes = LanesType()


@register_model(LanesType)
class _LanesModel(PrimitiveModel):
    def __init__(self, dmm, fe_type):
        super().__init__(dmm, fe_type, _VECTOR)


def _splat(builder, value):
    seed = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), value, _INT32(0))
    return builder.shuffle_vector(
        seed, ir.Constant(_VECTOR, ir.Undefined), ir.Constant(ir.VectorType(_INT32, WIDTH), [0] * WIDTH)
    )


def _constant(value):
    return ir.Constant(_VECTOR, [float(value)] * WIDTH)


def _widen(context, builder, value, kind):
    if isinstance(kind, LanesType):
        return value
    return _splat(builder, context.cast(builder, value, kind, types.float64))


def _shuffle(builder, a, b, indices):
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(_INT32, len(indices)), list(indices)))


def _call(builder, name, args, kinds=None):
    kinds = kinds or [_VECTOR] * len(args)
    function = cgutils.get_or_insert_function(builder.module, ir.FunctionType(_VECTOR, kinds), name)
    return builder.call(function, args)


def _is_operand(kind):
    return isinstance(kind, LanesType | types.Float | types.Integer)


def _register_binary(symbol, emit):
    class Template(AbstractTemplate):
        def generic(self, args, kws):
            if len(args) == 2 and any(isinstance(a, LanesType) for a in args) and all(map(_is_operand, args)):
                return signature(lanes, *args)
            return None

    infer_global(symbol)(Template)

    def lower(context, builder, sig, args):
        a, b = (_widen(context, builder, value, kind) for value, kind in zip(args, sig.args, strict=True))
        return emit(builder, a, b)

    for left, right in ((LanesType, LanesType), (LanesType, types.Number), (types.Number, LanesType)):
        lower_builtin(symbol, left, right)(lower)


def _compare(predicate):
    def emit(builder, a, b):
        return builder.uitofp(builder.fcmp_ordered(predicate, a, b), _VECTOR)

    return emit


_register_binary(operator.add, lambda b, x, y: b.fadd(x, y, flags=_FUSE))
_register_binary(operator.sub, lambda b, x, y: b.fsub(x, y, flags=_FUSE))
_register_binary(operator.mul, lambda b, x, y: b.fmul(x, y, flags=_FUSE))
_register_binary(operator.truediv, lambda b, x, y: b.fdiv(x, y, flags=_FUSE))
# Numba turns `a += b` into these.
_register_binary(operator.iadd, lambda b, x, y: b.fadd(x, y, flags=_FUSE))
_register_binary(operator.isub, lambda b, x, y: b.fsub(x, y, flags=_FUSE))
_register_binary(operator.imul, lambda b, x, y: b.fmul(x, y, flags=_FUSE))
for _symbol, _predicate in (
    (operator.lt, "<"),
    (operator.le, "<="),
    (operator.gt, ">"),
    (operator.ge, ">="),
    (operator.eq, "=="),
):
    _register_binary(_symbol, _compare(_predicate))


def _register_unary(symbol, emit):
    class Template(AbstractTemplate):
        def generic(self, args, kws):
            if len(args) == 1 and isinstance(args[0], LanesType):
                return signature(lanes, *args)
            return None

    infer_global(symbol)(Template)
    lower_builtin(symbol, LanesType)(lambda context, builder, sig, args: emit(builder, args[0]))


_register_unary(operator.neg, lambda b, x: b.fneg(x))
_register_unary(operator.pos, lambda b, x: x)
_register_unary(abs, lambda b, x: _call(b, "llvm.fabs.v8f64", [x]))


def _element_pointer(context, builder, kind, array, index):
    """Return a pointer to element `index` of a vector, or to row `index` of an (n, 8) array."""
    data = context.make_array(kind)(context, builder, array).data
    if kind.ndim == 2:
        index = builder.mul(index, _INT64(WIDTH))
    return builder.gep(data, [index])


def _is_contiguous(kind, *dimensions):
    return (
        isinstance(kind, types.Array) and kind.layout == "C" and kind.dtype == types.float64 and kind.ndim in dimensions
    )


@intrinsic
def load(typingctx, array, index):
    """Return eight consecutive elements of a vector from `index` on, or row `index` of an (n, 8) array."""
    if not _is_contiguous(array, 1, 2):
        return None

    def codegen(context, builder, sig, args):
        index = context.cast(builder, args[1], sig.args[1], types.int64)
        pointer = _element_pointer(context, builder, sig.args[0], args[0], index)
        return builder.load(builder.bitcast(pointer, _VECTOR.as_pointer()), align=8)

    return lanes(array, index), codegen


@intrinsic
def store(typingctx, array, index, value):
    """Write eight lanes where `load` would read them."""
    if not (_is_contiguous(array, 1, 2) and isinstance(value, LanesType)):
        return None

    def codegen(context, builder, sig, args):
        index = context.cast(builder, args[1], sig.args[1], types.int64)
        pointer = _element_pointer(context, builder, sig.args[0], args[0], index)
        builder.store(args[2], builder.bitcast(pointer, _VECTOR.as_pointer()), align=8)
        return context.get_dummy_value()

    return types.void(array, index, value), codegen


@intrinsic
def _load_element(typingctx, array, index):
    def codegen(context, builder, sig, args):
        index = context.cast(builder, args[1], sig.args[1], types.int64)
        return builder.load(_element_pointer(context, builder, sig.args[0], args[0], index))

    return types.float64(array, index), codegen


@intrinsic
def _store_element(typingctx, array, index, value):
    def codegen(context, builder, sig, args):
        index = context.cast(builder, args[1], sig.args[1], types.int64)
        builder.store(args[2], _element_pointer(context, builder, sig.args[0], args[0], index))
        return context.get_dummy_value()

    return types.void(array, index, value), codegen


def get(array, index):
    """Return element `index` of a vector as float64, or row `index` of an (n, 8) array as `Lanes`."""
    raise NotImplementedError("get() is for compiled code only")


@overload(get)
def _get(array, index):
    if _is_contiguous(array, 2):
        return lambda array, index: load(array, index)
    if _is_contiguous(array, 1):
        return lambda array, index: _load_element(array, index)
    return None


def put(array, index, value):
    """Write float64 to element `index` of a vector, or `Lanes` to row `index` of an (n, 8) array."""
    raise NotImplementedError("put() is for compiled code only")


@overload(put)
def _put(array, index, value):
    if _is_contiguous(array, 2):
        return lambda array, index, value: store(array, index, value)
    if _is_contiguous(array, 1):
        return lambda array, index, value: _store_element(array, index, value)
    return None


@intrinsic
def full(typingctx, value):
    """Return a float64 in all eight lanes."""
    if not isinstance(value, types.Float | types.Integer):
        return None

    def codegen(context, builder, sig, args):
        return _widen(context, builder, args[0], sig.args[0])

    return lanes(value), codegen


@intrinsic
def unit(typingctx, index):
    """Return 1 in lane `index` and 0 in the others."""
    if not isinstance(index, types.Integer):
        return None

    def codegen(context, builder, sig, args):
        index = context.cast(builder, args[0], sig.args[0], types.int32)
        return builder.insert_element(_constant(0.0), ir.Constant(_DOUBLE, 1.0), index)

    return lanes(index), codegen


@intrinsic
def lane(typingctx, value, index):
    """Return lane `index` (0 ... 7) as float64."""
    if not isinstance(value, LanesType):
        return None

    def codegen(context, builder, sig, args):
        return builder.extract_element(args[0], context.cast(builder, args[1], sig.args[1], types.int32))

    return types.float64(value, index), codegen


def _broadcast_signature(*kinds):
    """Return the common type of operands: `Lanes` if one of them is, float64 otherwise."""
    if not all(map(_is_operand, kinds)):
        return None
    return lanes if any(isinstance(k, LanesType) for k in kinds) else types.float64


@intrinsic
def fma(typingctx, a, b, c):
    """Return a*b + c rounded once; float64 or `Lanes`."""
    kind = _broadcast_signature(a, b, c)
    if kind is None:
        return None

    def codegen(context, builder, sig, args):
        if kind is types.float64:
            values = [context.cast(builder, v, k, kind) for v, k in zip(args, sig.args, strict=True)]
            return builder.fma(*values)
        operands = [_widen(context, builder, v, k) for v, k in zip(args, sig.args, strict=True)]
        return _call(builder, "llvm.fma.v8f64", operands)

    return kind(a, b, c), codegen


def _emit_sqrt(builder, value):
    name = "llvm.sqrt.f64" if value.type == _DOUBLE else "llvm.sqrt.v8f64"
    function = cgutils.get_or_insert_function(builder.module, ir.FunctionType(value.type, [value.type]), name)
    return builder.call(function, [value])


def _elementwise(emit, doc):
    def typing(typingctx, a, b):
        kind = _broadcast_signature(a, b)
        if kind is None:
            return None

        def codegen(context, builder, sig, args):
            pairs = zip(args, sig.args, strict=True)
            if kind is lanes:
                x, y = (_widen(context, builder, v, k) for v, k in pairs)
            else:
                x, y = (context.cast(builder, v, k, kind) for v, k in pairs)
            return emit(builder, x, y)

        return kind(a, b), codegen

    typing.__doc__ = doc
    typing.__name__ = "elementwise"
    return intrinsic(typing)


@intrinsic
def sqrt(typingctx, x):
    """Return the square root, correctly rounded; float64 or `Lanes`."""
    kind = _broadcast_signature(x)
    if kind is None:
        return None

    def codegen(context, builder, sig, args):
        return _emit_sqrt(builder, args[0] if kind is lanes else context.cast(builder, args[0], sig.args[0], kind))

    return kind(x), codegen


maximum = _elementwise(
    lambda b, x, y: b.select(b.fcmp_ordered(">", x, y), x, y),
    "Return the larger of a and b, lane by lane; b where one of them is NaN.",
)
minimum = _elementwise(
    lambda b, x, y: b.select(b.fcmp_ordered("<", x, y), x, y),
    "Return the smaller of a and b, lane by lane; b where one of them is NaN.",
)
exact_add = _elementwise(lambda b, x, y: b.fadd(x, y), "Return fl(a + b), never fused; float64 or `Lanes`.")
exact_mul = _elementwise(lambda b, x, y: b.fmul(x, y), "Return fl(a b), never fused; float64 or `Lanes`.")
exact_sub = _elementwise(lambda b, x, y: b.fsub(x, y), "Return fl(a - b), never fused; float64 or `Lanes`.")


@intrinsic
def select(typingctx, condition, a, b):
    """Return `a` in the lanes where `condition` is not zero, and `b` in the others."""
    if not isinstance(condition, LanesType) or _broadcast_signature(a, b) is None:
        return None

    def codegen(context, builder, sig, args):
        x, y = (_widen(context, builder, v, k) for v, k in zip(args[1:], sig.args[1:], strict=True))
        return builder.select(builder.fcmp_unordered("!=", args[0], _constant(0.0)), x, y)

    return lanes(condition, a, b), codegen


@intrinsic
def any_lane(typingctx, condition):
    """Return whether `condition` is not zero in some lane."""
    if not isinstance(condition, LanesType):
        return None

    def codegen(context, builder, sig, args):
        mask = builder.fcmp_unordered("!=", args[0], _constant(0.0))
        return builder.icmp_unsigned("!=", builder.bitcast(mask, ir.IntType(8)), ir.IntType(8)(0))

    return types.boolean(condition), codegen


def _tree(builder, vectors, combine):
    """Combine the lanes of each of eight vectors; lane i of the result belongs to vector i."""
    # Three rounds; in each, pairs of vectors are folded into one whose lanes alternate between the two.
    rounds = (
        ([0, 8, 2, 10, 4, 12, 6, 14], [1, 9, 3, 11, 5, 13, 7, 15]),
        ([0, 1, 8, 9, 4, 5, 12, 13], [2, 3, 10, 11, 6, 7, 14, 15]),
        ([0, 1, 2, 3, 8, 9, 10, 11], [4, 5, 6, 7, 12, 13, 14, 15]),
    )
    for even, odd in rounds:
        vectors = [
            combine(_shuffle(builder, a, b, even), _shuffle(builder, a, b, odd))
            for a, b in zip(vectors[::2], vectors[1::2], strict=True)
        ]
    return vectors[0]


def _row_reduction(combine, doc):
    def typing(typingctx, array, row):
        if not _is_contiguous(array, 2):
            return None

        def codegen(context, builder, sig, args):
            row = context.cast(builder, args[1], sig.args[1], types.int64)
            pointer = _element_pointer(context, builder, sig.args[0], args[0], row)
            pointer = builder.bitcast(pointer, _VECTOR.as_pointer())
            rows = [builder.load(builder.gep(pointer, [_INT64(i)]), align=8) for i in range(WIDTH)]
            return _tree(builder, rows, lambda a, b: combine(builder, a, b))

        return lanes(array, row), codegen

    typing.__doc__ = doc
    typing.__name__ = "row_reduction"
    return intrinsic(typing)


row_sums = _row_reduction(
    lambda b, x, y: b.fadd(x, y), "Return the sums of rows `row` ... `row` + 7 of an (n, 8) array, one in each lane."
)
row_maxima = _row_reduction(
    lambda b, x, y: b.select(b.fcmp_ordered(">", x, y), x, y),
    "Return the maxima of rows `row` ... `row` + 7 of an (n, 8) array, one in each lane.",
)


@intrinsic
def total(typingctx, value):
    """Return the sum of the lanes, added pairwise."""
    if not isinstance(value, LanesType):
        return None

    def codegen(context, builder, sig, args):
        x = args[0]
        for step in (4, 2, 1):
            x = builder.fadd(x, _shuffle(builder, x, x, [(i + step) % WIDTH for i in range(WIDTH)]))
        return builder.extract_element(x, _INT32(0))

    return types.float64(value), codegen


@intrinsic
def largest(typingctx, value):
    """Return the largest lane. NaN lanes may be passed over."""
    if not isinstance(value, LanesType):
        return None

    def codegen(context, builder, sig, args):
        x = args[0]
        for step in (4, 2, 1):
            y = _shuffle(builder, x, x, [(i + step) % WIDTH for i in range(WIDTH)])
            x = builder.select(builder.fcmp_ordered(">", x, y), x, y)
        return builder.extract_element(x, _INT32(0))

    return types.float64(value), codegen


@intrinsic
def _rsqrt_estimate(typingctx, x):
    """Return 1/sqrt(x) to 14 bits or better, cut to 17 bits so that its cube is exact; float64 or `Lanes`."""
    kind = _broadcast_signature(x)
    if kind is None:
        return None

    def codegen(context, builder, sig, args):
        value = args[0] if kind is lanes else context.cast(builder, args[0], sig.args[0], kind)
        words = ir.VectorType(_INT64, WIDTH) if kind is lanes else _INT64
        keep = ir.Constant(words, [-(1 << 36)] * WIDTH if kind is lanes else -(1 << 36))
        if kind is lanes and "avx512f" in cpu_features():  # LLVM aborts the process where the CPU lacks it
            name, every = "llvm.x86.avx512.rsqrt14.pd.512", ir.IntType(8)(255)
            y = _call(builder, name, [value, _constant(0.0), every], [_VECTOR, _VECTOR, ir.IntType(8)])
        else:
            root = _emit_sqrt(builder, value)
            y = builder.fdiv(_constant(1.0) if kind is lanes else ir.Constant(_DOUBLE, 1.0), root)
        return builder.bitcast(builder.and_(builder.bitcast(y, words), keep), value.type)

    return kind(x), codegen


@kernel(inline=True)
def rsqrt_cubed(x):
    """Return x^(-3/2) for x > 0, all but correctly rounded; float64 or `Lanes`. At x = 0 it is not finite.

    With y near x^(-1/2) cut to 17 bits, y^2 and y^3 are exact and e = 1 - x y^2 is small; the result is the series of
    y^3 (1 - e)^(-3/2), where only the last rounding counts.
    """
    y = _rsqrt_estimate(x)
    y2 = y * y
    y3 = y2 * y
    e = fma(-x, y2, 1.0)
    series = fma(fma(fma(fma(2.70703125, e, 2.4609375), e, 2.1875), e, 1.875), e, 1.5)
    return fma(y3 * e, series, y3)
