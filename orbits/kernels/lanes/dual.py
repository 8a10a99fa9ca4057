"""`Dual`: a number and its derivatives along eight directions, x + d e with e^2 = 0; d is a `Lanes`.

A kernel that is written for float64 and `Lanes` gives its own derivatives if it is called with vectors of dual numbers:
`duals` makes one of an (n, 16) array: of a row, the first number is x, and the last eight are d, so that they fill a
register. Derivatives are exact but for rounding.

Comparisons are those of x; but x == y only if the derivatives are the same as well, so that what is left out where a
number is 0 is not where it is about to change.
"""

from __future__ import annotations

import operator

from llvmlite import ir
from numba import types
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic

from orbits.kernels.lanes.type import (
    DOUBLE,
    DUAL,
    DUAL_ROW,
    FUSE,
    INT64,
    WIDTH,
    DualType,
    call_intrinsic,
    common_type,
    constant,
    dual,
    is_contiguous,
    lanes,
    splat,
)

NUMBERS = 2 * WIDTH
"""The length of a row of an array of dual numbers, whose derivatives begin with column `WIDTH`."""


def operand(context, builder, value, kind):
    """Return x and d of an operand; d is None for any other number, whose derivatives are 0."""
    if kind == dual:
        return builder.extract_value(value, 0), builder.extract_value(value, 1)
    return context.cast(builder, value, kind, types.float64), None


def made(builder, x, d):
    """Return the LLVM value of a dual number; d may be None."""
    empty = ir.Constant(DUAL, ir.Undefined)
    return builder.insert_value(builder.insert_value(empty, x, 0), constant(0.0) if d is None else d, 1)


def dual_of(context, builder, value, kind):
    """Return an operand as a dual number."""
    return made(builder, *operand(context, builder, value, kind))


def _scaled(b, factor, d):
    """Emit derivatives times a number."""
    return None if d is None else b.fmul(splat(b, factor), d, flags=FUSE)


def _summed(b, d, e):
    """Emit the sum of derivatives."""
    if d is None or e is None:
        return e if d is None else d
    return b.fadd(d, e, flags=FUSE)


def _negated(b, d):
    return None if d is None else b.fneg(d)


def add(b, u, w):
    """Emit u + w."""
    return made(b, b.fadd(u[0], w[0]), _summed(b, u[1], w[1]))


def subtract(b, u, w):
    """Emit u - w."""
    return made(b, b.fsub(u[0], w[0]), _summed(b, u[1], _negated(b, w[1])))


def multiply(b, u, w):
    """Emit u w."""
    (x, d), (y, e) = u, w
    return made(b, b.fmul(x, y), _summed(b, _scaled(b, x, e), _scaled(b, y, d)))


def divide(b, u, w):
    """Emit u / w."""
    (x, d), (y, e) = u, w
    ratio = b.fdiv(x, y)
    change = _summed(b, d, _negated(b, _scaled(b, ratio, e)))
    return made(b, ratio, None if change is None else b.fdiv(change, splat(b, y)))


def multiply_add(b, u, w, more):
    """Emit u w + more, whose x is rounded once."""
    (x, d), (y, e), (z, f) = u, w, more
    return made(b, b.fma(x, y, z), _summed(b, _scaled(b, x, e), _summed(b, _scaled(b, y, d), f)))


def square_root(b, u):
    """Emit the square root; derivatives are 0 where those of u are."""
    x, d = u
    root = call_intrinsic(b, "llvm.sqrt.f64", [x])
    if d is None:
        return made(b, root, None)
    slope = _scaled(b, b.fdiv(ir.Constant(DOUBLE, 0.5), root), d)
    return made(b, root, b.select(b.fcmp_ordered("==", d, constant(0.0)), constant(0.0), slope))


def absolute(b, u):
    """Emit |u|."""
    return b.select(b.fcmp_ordered("<", u[0], ir.Constant(DOUBLE, 0.0)), negative(b, u), made(b, *u))


def negative(b, u):
    """Emit -u."""
    return made(b, b.fneg(u[0]), _negated(b, u[1]))


def rounded(b, u):
    """Emit the nearest integer, which does not change."""
    return made(b, call_intrinsic(b, "llvm.rint.f64", [u[0]]), None)


def chosen(predicate):
    """Return a function that emits one of two dual numbers, by comparing them."""
    return lambda b, u, w: b.select(b.fcmp_ordered(predicate, u[0], w[0]), made(b, *u), made(b, *w))


def _register(symbol, emit, result, *others):
    class Template(AbstractTemplate):
        def generic(self, args, kws):
            numbers = [types.float64 if kind == types.boolean else kind for kind in args]
            known = len(args) == 1 + bool(others) and common_type(*numbers) == dual
            return signature(result, *args) if known else None

    infer_global(symbol)(Template)

    def lower(context, builder, sig, args):
        return emit(builder, *(operand(context, builder, x, kind) for x, kind in zip(args, sig.args, strict=True)))

    for kinds in others or ((DualType,),):
        lower_builtin(symbol, *kinds)(lower)


def _register_binary(symbol, emit, result=dual):
    kinds = [(DualType, kind) for kind in (DualType, types.Number, types.Boolean)]
    _register(symbol, emit, result, *kinds, *((other, one) for one, other in kinds[1:]))


def _compare(predicate):
    return lambda b, u, w: b.fcmp_ordered(predicate, u[0], w[0])


def _equal(b, u, w):
    d, e = (constant(0.0) if one is None else one for one in (u[1], w[1]))
    word = ir.IntType(WIDTH)
    same = b.icmp_unsigned("==", b.bitcast(b.fcmp_ordered("==", d, e), word), word(2**WIDTH - 1))
    return b.and_(b.fcmp_ordered("==", u[0], w[0]), same)


for _symbols, _emit in (
    ((operator.add, operator.iadd), add),
    ((operator.sub, operator.isub), subtract),
    ((operator.mul, operator.imul), multiply),
    ((operator.truediv, operator.itruediv), divide),
):
    for _symbol in _symbols:
        _register_binary(_symbol, _emit)
for _symbol, _predicate in ((operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">=")):
    _register_binary(_symbol, _compare(_predicate), types.boolean)
_register_binary(operator.eq, _equal, types.boolean)
_register_binary(operator.ne, lambda b, u, w: b.not_(_equal(b, u, w)), types.boolean)
_register(operator.neg, negative, dual)
_register(operator.pos, lambda b, u: made(b, *u), dual)
_register(abs, absolute, dual)
_register(int, lambda b, u: b.fptosi(u[0], INT64), types.int64)


@intrinsic
def dual_number(typingctx, x, d):
    """Return x + d e for a float64 and `Lanes`."""
    if x != types.float64 or d != lanes:
        return None
    return dual(x, d), lambda context, builder, sig, args: made(builder, *args)


@intrinsic
def number(typingctx, value):
    """Return x of a dual number x + d e, float64; or of a float64, itself."""
    if value != dual and not isinstance(value, types.Float | types.Integer):
        return None

    def codegen(context, builder, sig, args):
        return operand(context, builder, args[0], sig.args[0])[0]

    return types.float64(value), codegen


@intrinsic
def slopes(typingctx, value):
    """Return d of a dual number x + d e, `Lanes`; zeros of a float64."""
    if value != dual and not isinstance(value, types.Float | types.Integer):
        return None

    def codegen(context, builder, sig, args):
        d = operand(context, builder, args[0], sig.args[0])[1]
        return constant(0.0) if d is None else d

    return lanes(value), codegen


@intrinsic
def duals(typingctx, array):
    """Return an (n, 16) array as a vector of dual numbers; it is the same memory."""
    if not is_contiguous(array, 2):
        return None
    found = types.Array(dual, 1, "C")

    def codegen(context, builder, sig, args):
        from numba.np.arrayobj import populate_array  # a run whose kernels are on disk does not need it

        given = context.make_array(sig.args[0])(context, builder, args[0])
        new = context.make_array(found)(context, builder)
        data, size = builder.bitcast(given.data, DUAL_ROW.as_pointer()), INT64(8 * NUMBERS)
        shape = [builder.extract_value(given.shape, 0)]
        populate_array(new, data=data, shape=shape, strides=[size], itemsize=size, meminfo=None)
        return new._getvalue()

    return found(array), codegen
