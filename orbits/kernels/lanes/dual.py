"""`Dual`: a number and its derivative along one direction, x + d e with e^2 = 0.

A kernel that is written for float64 and `Lanes` gives its own derivative if it is called with vectors of dual numbers:
`duals` makes one of complex numbers x + d i, the form in which they are stored. Derivatives are exact but for rounding.

Comparisons are those of x; but x == y only if the derivatives are the same as well, so that what is left out where a
number is 0 is not where it is about to change.
"""

from __future__ import annotations

import operator

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic

from orbits.kernels.lanes.type import DOUBLE, DUAL, FUSE, INT64, DualType, call_intrinsic, common_type, dual

ZERO = ir.Constant(DOUBLE, 0.0)


def parts(builder, value):
    """Return x and d of the LLVM value of a dual number."""
    return builder.extract_value(value, 0), builder.extract_value(value, 1)


def made(builder, x, d):
    """Return the LLVM value of a dual number."""
    return builder.insert_value(builder.insert_value(ir.Constant(DUAL, ir.Undefined), x, 0), d, 1)


def dual_of(context, builder, value, kind):
    """Return an operand as a dual number; d of any other is 0."""
    return value if kind == dual else made(builder, context.cast(builder, value, kind, types.float64), ZERO)


def add(b, u, w):
    """Emit u + w."""
    (x, d), (y, e) = parts(b, u), parts(b, w)
    return made(b, b.fadd(x, y), b.fadd(d, e))


def subtract(b, u, w):
    """Emit u - w."""
    (x, d), (y, e) = parts(b, u), parts(b, w)
    return made(b, b.fsub(x, y), b.fsub(d, e))


def multiply(b, u, w):
    """Emit u w."""
    (x, d), (y, e) = parts(b, u), parts(b, w)
    return made(b, b.fmul(x, y), b.fadd(b.fmul(x, e, flags=FUSE), b.fmul(d, y, flags=FUSE), flags=FUSE))


def divide(b, u, w):
    """Emit u / w."""
    (x, d), (y, e) = parts(b, u), parts(b, w)
    ratio = b.fdiv(x, y)
    return made(b, ratio, b.fdiv(b.fsub(d, b.fmul(ratio, e)), y))


def multiply_add(b, u, w, more):
    """Emit u w + more, whose x is rounded once."""
    (x, d), (y, e), (z, f) = parts(b, u), parts(b, w), parts(b, more)
    return made(b, b.fma(x, y, z), b.fma(x, e, b.fma(d, y, f)))


def square_root(b, u):
    """Emit the square root; d is 0 where that of u is."""
    x, d = parts(b, u)
    root = call_intrinsic(b, "llvm.sqrt.f64", [x])
    slope = b.fdiv(b.fmul(ir.Constant(DOUBLE, 0.5), d), root)
    return made(b, root, b.select(b.fcmp_ordered("==", d, ZERO), ZERO, slope))


def absolute(b, u):
    """Emit |u|."""
    x, d = parts(b, u)
    return b.select(b.fcmp_ordered("<", x, ZERO), made(b, b.fneg(x), b.fneg(d)), u)


def rounded(b, u):
    """Emit the nearest integer, which does not change."""
    return made(b, call_intrinsic(b, "llvm.rint.f64", [parts(b, u)[0]]), ZERO)


def chosen(predicate):
    """Return a function that emits one of two dual numbers, by comparing them."""
    return lambda b, u, w: b.select(b.fcmp_ordered(predicate, parts(b, u)[0], parts(b, w)[0]), u, w)


def _register(symbol, emit, result, *others):
    class Template(AbstractTemplate):
        def generic(self, args, kws):
            numbers = [types.float64 if kind == types.boolean else kind for kind in args]
            known = len(args) == 1 + bool(others) and common_type(*numbers) == dual
            return signature(result, *args) if known else None

    infer_global(symbol)(Template)

    def lower(context, builder, sig, args):
        return emit(builder, *(dual_of(context, builder, x, kind) for x, kind in zip(args, sig.args, strict=True)))

    for kinds in others or ((DualType,),):
        lower_builtin(symbol, *kinds)(lower)


def _register_binary(symbol, emit, result=dual):
    kinds = [(DualType, kind) for kind in (DualType, types.Number, types.Boolean)]
    _register(symbol, emit, result, *kinds, *((other, one) for one, other in kinds[1:]))


def _compare(predicate):
    return lambda b, u, w: b.fcmp_ordered(predicate, parts(b, u)[0], parts(b, w)[0])


def _equal(b, u, w):
    return b.and_(*(b.fcmp_ordered("==", x, y) for x, y in zip(parts(b, u), parts(b, w), strict=True)))


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
_register(operator.neg, lambda b, u: made(b, *map(b.fneg, parts(b, u))), dual)
_register(operator.pos, lambda b, u: u, dual)
_register(abs, absolute, dual)
_register(int, lambda b, u: b.fptosi(parts(b, u)[0], INT64), types.int64)


@intrinsic
def dual_number(typingctx, x, d):
    """Return x + d e for two float64."""
    if x != types.float64 or d != types.float64:
        return None
    return dual(x, d), lambda context, builder, sig, args: made(builder, *args)


@intrinsic
def number(typingctx, value):
    """Return x of a dual number x + d e, float64; or of a float64, itself."""
    if value != dual and not isinstance(value, types.Float | types.Integer):
        return None

    def codegen(context, builder, sig, args):
        return parts(builder, dual_of(context, builder, args[0], sig.args[0]))[0]

    return types.float64(value), codegen


@intrinsic
def slope(typingctx, value):
    """Return d of a dual number x + d e, float64; 0 of a float64."""
    if value != dual and not isinstance(value, types.Float | types.Integer):
        return None

    def codegen(context, builder, sig, args):
        return parts(builder, dual_of(context, builder, args[0], sig.args[0]))[1]

    return types.float64(value), codegen


@intrinsic
def duals(typingctx, array):
    """Return a vector of complex numbers x + d i as one of dual numbers x + d e; it is the same memory."""
    if not (isinstance(array, types.Array) and array.layout == "C" and array.ndim == 1):
        return None
    if array.dtype != types.complex128:
        return None
    found = types.Array(dual, 1, "C")

    def codegen(context, builder, sig, args):
        from numba.np.arrayobj import populate_array  # a run whose kernels are on disk does not need it

        given = context.make_array(sig.args[0])(context, builder, args[0])
        new = context.make_array(found)(context, builder)
        data = builder.bitcast(given.data, DUAL.as_pointer())
        shape, strides = (cgutils.unpack_tuple(builder, x) for x in (given.shape, given.strides))
        populate_array(new, data=data, shape=shape, strides=strides, itemsize=given.itemsize, meminfo=None)
        return new._getvalue()

    return found(array), codegen
