"""Arithmetic, comparison and choice, lane by lane; most of it serves float64 as well."""

from __future__ import annotations

import operator

from llvmlite import ir
from numba import types
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic

from orbits.kernels.compile import cpu_features, kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import dual as of_duals
from orbits.kernels.lanes.type import (
    DOUBLE,
    FUSE,
    INT64,
    VECTOR,
    WIDTH,
    LanesType,
    call_intrinsic,
    common_type,
    constant,
    dual,
    is_operand,
    shuffle,
    suffixed,
    widen,
)


def _register_binary(symbol, emit):
    class Template(AbstractTemplate):
        def generic(self, args, kws):
            kind = common_type(*args) if len(args) == 2 else None
            return signature(kind, *args) if isinstance(kind, LanesType) else None

    infer_global(symbol)(Template)

    def lower(context, builder, sig, args):
        like = sig.return_type
        a, b = (widen(context, builder, value, kind, like) for value, kind in zip(args, sig.args, strict=True))
        return emit(builder, a, b)

    for left, right in ((LanesType, LanesType), (LanesType, types.Number), (types.Number, LanesType)):
        lower_builtin(symbol, left, right)(lower)


def _compare(predicate):
    def emit(builder, a, b):
        return builder.uitofp(builder.fcmp_ordered(predicate, a, b), a.type)

    return emit


_register_binary(operator.add, lambda b, x, y: b.fadd(x, y, flags=FUSE))
_register_binary(operator.sub, lambda b, x, y: b.fsub(x, y, flags=FUSE))
_register_binary(operator.mul, lambda b, x, y: b.fmul(x, y, flags=FUSE))
_register_binary(operator.truediv, lambda b, x, y: b.fdiv(x, y, flags=FUSE))
# Numba turns `a += b` into these.
_register_binary(operator.iadd, lambda b, x, y: b.fadd(x, y, flags=FUSE))
_register_binary(operator.isub, lambda b, x, y: b.fsub(x, y, flags=FUSE))
_register_binary(operator.imul, lambda b, x, y: b.fmul(x, y, flags=FUSE))
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
                return signature(args[0], *args)
            return None

    infer_global(symbol)(Template)
    lower_builtin(symbol, LanesType)(lambda context, builder, sig, args: emit(builder, args[0]))


_register_unary(operator.neg, lambda b, x: b.fneg(x))
_register_unary(operator.pos, lambda b, x: x)
_register_unary(abs, lambda b, x: call_intrinsic(b, suffixed("llvm.fabs", x.type), [x]))


@intrinsic
def fma(typingctx, a, b, c):
    """Return a*b + c rounded once; float64, dual numbers or `Lanes`."""
    kind = common_type(a, b, c)
    if kind is None:
        return None

    def codegen(context, builder, sig, args):
        if kind == dual:
            return of_duals.multiply_add(builder, *_operands(context, builder, sig.args, args))
        if kind is types.float64:
            values = [context.cast(builder, v, k, kind) for v, k in zip(args, sig.args, strict=True)]
            return builder.fma(*values)
        operands = [widen(context, builder, v, k, kind) for v, k in zip(args, sig.args, strict=True)]
        return call_intrinsic(builder, suffixed("llvm.fma", operands[0].type), operands)

    return kind(a, b, c), codegen


def _operands(context, builder, kinds, args):
    return [of_duals.operand(context, builder, v, k) for v, k in zip(args, kinds, strict=True)]


def _emit_sqrt(builder, value):
    return call_intrinsic(builder, suffixed("llvm.sqrt", value.type), [value])


def _elementwise(emit, doc, emit_of_duals):
    def typing(typingctx, a, b):
        kind = common_type(a, b)
        if kind is None:
            return None

        def codegen(context, builder, sig, args):
            if kind == dual:
                return emit_of_duals(builder, *_operands(context, builder, sig.args, args))
            pairs = zip(args, sig.args, strict=True)
            if isinstance(kind, LanesType):
                x, y = (widen(context, builder, v, k, kind) for v, k in pairs)
            else:
                x, y = (context.cast(builder, v, k, kind) for v, k in pairs)
            return emit(builder, x, y)

        return kind(a, b), codegen

    typing.__doc__ = doc
    typing.__name__ = "elementwise"
    return intrinsic(typing)


@intrinsic
def sqrt(typingctx, x):
    """Return the square root, correctly rounded; float64, dual numbers or `Lanes`."""
    kind = common_type(x)
    if kind is None:
        return None

    def codegen(context, builder, sig, args):
        if kind == dual:
            return of_duals.square_root(builder, *_operands(context, builder, sig.args, args))
        value = args[0] if isinstance(kind, LanesType) else context.cast(builder, args[0], sig.args[0], kind)
        return _emit_sqrt(builder, value)

    return kind(x), codegen


@intrinsic
def rint(typingctx, x):
    """Return the nearest integer, ties to even; float64, dual numbers or `Lanes`."""
    kind = common_type(x)
    if kind is None:
        return None

    def codegen(context, builder, sig, args):
        if kind == dual:
            return of_duals.rounded(builder, *_operands(context, builder, sig.args, args))
        value = args[0] if isinstance(kind, LanesType) else context.cast(builder, args[0], sig.args[0], kind)
        return call_intrinsic(builder, suffixed("llvm.rint", value.type), [value])

    return kind(x), codegen


maximum = _elementwise(
    lambda b, x, y: b.select(b.fcmp_ordered(">", x, y), x, y),
    "Return the larger of a and b, lane by lane; b if one of them is NaN.",
    of_duals.chosen(">"),
)
minimum = _elementwise(
    lambda b, x, y: b.select(b.fcmp_ordered("<", x, y), x, y),
    "Return the smaller of a and b, lane by lane; b if one of them is NaN.",
    of_duals.chosen("<"),
)
exact_add = _elementwise(
    lambda b, x, y: b.fadd(x, y),
    "Return fl(a + b), never fused; float64, dual numbers or `Lanes`.",
    of_duals.add,
)
exact_mul = _elementwise(
    lambda b, x, y: b.fmul(x, y),
    "Return fl(a b), never fused; float64, dual numbers or `Lanes`.",
    of_duals.multiply,
)
exact_sub = _elementwise(
    lambda b, x, y: b.fsub(x, y),
    "Return fl(a - b), never fused; float64, dual numbers or `Lanes`.",
    of_duals.subtract,
)


@intrinsic
def select(typingctx, condition, a, b):
    """Return `a` in the lanes where `condition` is not zero, and `b` in the others; for numbers, one of the two."""
    kind = common_type(a, b)
    if kind is None or not (isinstance(condition, LanesType | types.Boolean) or is_operand(condition)):
        return None
    if isinstance(condition, LanesType) and kind not in (condition, types.float64):
        return None
    if not isinstance(condition, LanesType):

        def choose(context, builder, sig, args):
            chosen = context.cast(builder, args[0], sig.args[0], types.boolean)
            if kind == dual:
                pairs = zip(args[1:], sig.args[1:], strict=True)
                return builder.select(chosen, *(of_duals.dual_of(context, builder, v, k) for v, k in pairs))
            x, y = (context.cast(builder, v, k, kind) for v, k in zip(args[1:], sig.args[1:], strict=True))
            return builder.select(chosen, x, y)

        return (kind(condition, a, b), choose) if kind in (types.float64, dual) and condition != dual else None

    def codegen(context, builder, sig, args):
        x, y = (widen(context, builder, v, k, condition) for v, k in zip(args[1:], sig.args[1:], strict=True))
        return builder.select(builder.fcmp_unordered("!=", args[0], constant(0.0, condition.count)), x, y)

    return condition(condition, a, b), codegen


def _emit_rsqrt_estimate(builder, value, words, count):
    """Return 1/sqrt(x) to 17 bits without the instructions for roots and quotients, which take several times as long:
    half of the exponent and a line for the rest, to 5 bits, then four terms of the series in e = 1 - x y^2.
    """
    half = builder.lshr(builder.bitcast(value, words), ir.Constant(words, [1] * count))
    line = builder.sub(ir.Constant(words, [0x5FE6EB50C7B537A9] * count), half)
    y = builder.bitcast(line, value.type)
    e = _emit_fma(builder, builder.fneg(value), builder.fmul(y, y), constant(1.0, count))
    series = constant(0.3125, count)
    for term in (0.375, 0.5):
        series = _emit_fma(builder, series, e, constant(term, count))
    return _emit_fma(builder, builder.fmul(y, e), series, y)


def _emit_fma(builder, a, b, c):
    return call_intrinsic(builder, suffixed("llvm.fma", a.type), [a, b, c])


@intrinsic
def _rsqrt_estimate(typingctx, x):
    """Return 1/sqrt(x) to 14 bits or better, cut to 17 bits so that its cube is exact; float64 or `Lanes`."""
    kind = common_type(x)
    if kind is None or kind == dual:
        return None

    def codegen(context, builder, sig, args):
        count = kind.count if isinstance(kind, LanesType) else 1
        value = args[0] if count > 1 else context.cast(builder, args[0], sig.args[0], kind)
        words = ir.VectorType(INT64, count) if count > 1 else INT64
        keep = ir.Constant(words, [-(1 << 36)] * count if count > 1 else -(1 << 36))
        if count > 1 and "avx512f" in cpu_features():  # LLVM aborts the process if the CPU lacks it
            parts = [
                value if count == WIDTH else shuffle(builder, value, value, range(k, k + WIDTH))
                for k in range(0, count, WIDTH)
            ]
            name, every = "llvm.x86.avx512.rsqrt14.pd.512", ir.IntType(8)(255)
            kinds = [VECTOR, VECTOR, ir.IntType(8)]
            found = [call_intrinsic(builder, name, [part, constant(0.0), every], kinds) for part in parts]
            y = found[0] if count == WIDTH else shuffle(builder, *found, range(count))
        elif count > 1:
            y = _emit_rsqrt_estimate(builder, value, words, count)
        else:
            y = builder.fdiv(ir.Constant(DOUBLE, 1.0), _emit_sqrt(builder, value))
        return builder.bitcast(builder.and_(builder.bitcast(y, words), keep), value.type)

    return kind(x), codegen


@verb
def rsqrt_cubed(x):
    """Return x^(-3/2) for x > 0, almost correctly rounded; float64, dual numbers or `Lanes`. At x = 0 it is not finite.

    With y near x^(-1/2) cut to 17 bits, y^2 and y^3 are exact and e = 1 - x y^2 is small; the result is the series of
    y^3 (1 - e)^(-3/2), where only the last rounding matters. As |e| < 1.6e-4, the first omitted term, 2.7 e^5, is less
    than 3e-19.
    """
    return _cubed_of_dual if x == dual else _cubed


@kernel(inline=True)
def _cubed(x):
    y = _rsqrt_estimate(x)
    y2 = y * y
    y3 = y2 * y
    e = fma(-x, y2, 1.0)
    series = fma(fma(fma(2.4609375, e, 2.1875), e, 1.875), e, 1.5)
    return fma(y3 * e, series, y3)


@kernel(inline=True)
def _cubed_of_dual(x):
    return _powers_of_dual(x)[0]


@verb
def inverse_powers(x):
    """Return x^(-3/2), as `rsqrt_cubed`, and 1/x to 5e-12 of it."""
    return _powers_of_dual if x == dual else _powers


@kernel(inline=True)
def _powers(x):
    y = _rsqrt_estimate(x)
    y2 = y * y
    y3 = y2 * y
    e = fma(-x, y2, 1.0)
    series = fma(fma(fma(2.4609375, e, 2.1875), e, 1.875), e, 1.5)
    return fma(y3 * e, series, y3), fma(y2 * e, 1.0 + e, y2)


@kernel(inline=True)
def _powers_of_dual(x):
    cubed = _cubed(of_duals.number(x))
    near, d = cubed * of_duals.number(x), of_duals.slopes(x)
    square = near * near
    return of_duals.dual_number(cubed, -1.5 * cubed * square * d), of_duals.dual_number(square, -square * square * d)


@kernel(inline=True)
def rsqrt_cubed_pair(x, x_lo):
    """Return (x + x_lo)^(-3/2) as a sum of two numbers, the first of 51 bits, with an error of 3e-19 of it.

    |x_lo| is at most a few units in the last place of x; see `rsqrt_cubed`.
    """
    y = _rsqrt_estimate(x)
    y2 = y * y
    y3 = y2 * y
    e = fma(-x_lo, y2, fma(-x, y2, 1.0))
    series = fma(fma(fma(2.4609375, e, 2.1875), e, 1.875), e, 1.5)
    return y3, y3 * e * series
