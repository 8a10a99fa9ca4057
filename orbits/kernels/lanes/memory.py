"""Loads and stores of lanes: rows of (n, 8) arrays, eight elements of a vector, single lanes."""

from __future__ import annotations

from functools import partial

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes.dual import dual_of, made
from orbits.kernels.lanes.type import (
    DOUBLE,
    DUAL_ROW,
    INT32,
    INT64,
    VECTOR,
    WIDTH,
    LanesType,
    common_type,
    constant,
    dual,
    element_pointer,
    is_contiguous,
    is_operand,
    lanes,
    pair,
    shuffle,
    widen,
)


@intrinsic
def load(typingctx, array, index):
    """Return eight consecutive elements of a vector from `index` on, or row `index` of an (n, 8) array."""
    if not is_contiguous(array, 1, 2):
        return None

    def codegen(context, builder, sig, args):
        index = context.cast(builder, args[1], sig.args[1], types.int64)
        pointer = element_pointer(context, builder, sig.args[0], args[0], index)
        return builder.load(builder.bitcast(pointer, VECTOR.as_pointer()), align=8)

    return lanes(array, index), codegen


@intrinsic
def store(typingctx, array, index, value):
    """Write eight lanes to where `load` reads them; in a row of an (n, 8) array, also a number, in all eight."""
    number = isinstance(value, types.Float | types.Integer) and is_contiguous(array, 2)
    if not (is_contiguous(array, 1, 2) and (value == lanes or number)):
        return None

    def codegen(context, builder, sig, args):
        index = context.cast(builder, args[1], sig.args[1], types.int64)
        pointer = element_pointer(context, builder, sig.args[0], args[0], index)
        given = widen(context, builder, args[2], sig.args[2])
        builder.store(given, builder.bitcast(pointer, VECTOR.as_pointer()), align=8)
        return context.get_dummy_value()

    return types.void(array, index, value), codegen


@intrinsic
def load_some(typingctx, array, index, count):
    """Return the first `count` of eight consecutive elements of a vector from `index` on, with zeros in the other
    lanes, of which nothing is read; all, if count > 8.
    """
    if not is_contiguous(array, 1):
        return None

    def codegen(context, builder, sig, args):
        index, count = (context.cast(builder, args[k], sig.args[k], types.int64) for k in (1, 2))
        pointer = builder.bitcast(element_pointer(context, builder, sig.args[0], args[0], index), VECTOR.as_pointer())
        mask = _first_lanes(builder, count)
        kinds = [pointer.type, INT32, mask.type, VECTOR]
        function = cgutils.get_or_insert_function(
            builder.module, ir.FunctionType(VECTOR, kinds), "llvm.masked.load.v8f64.p0"
        )
        return builder.call(function, [pointer, INT32(8), mask, constant(0.0)])

    return lanes(array, index, count), codegen


@intrinsic
def store_some(typingctx, array, index, value, count):
    """Write the first `count` of eight lanes to consecutive elements of a vector from `index` on; all, if count > 8."""
    if not (is_contiguous(array, 1) and value == lanes):
        return None

    def codegen(context, builder, sig, args):
        index, count = (context.cast(builder, args[k], sig.args[k], types.int64) for k in (1, 3))
        pointer = builder.bitcast(element_pointer(context, builder, sig.args[0], args[0], index), VECTOR.as_pointer())
        mask = _first_lanes(builder, count)
        kinds = [VECTOR, pointer.type, INT32, mask.type]
        function = cgutils.get_or_insert_function(
            builder.module, ir.FunctionType(ir.VoidType(), kinds), "llvm.masked.store.v8f64.p0"
        )
        builder.call(function, [args[2], pointer, INT32(8), mask])
        return context.get_dummy_value()

    return types.void(array, index, value, count), codegen


def _first_lanes(builder, count):
    """Return a mask of the first `count` of eight lanes."""
    words = ir.VectorType(INT64, WIDTH)
    limit = builder.insert_element(ir.Constant(words, ir.Undefined), count, INT32(0))
    limit = shuffle(builder, limit, ir.Constant(words, ir.Undefined), [0] * WIDTH)
    return builder.icmp_signed("<", ir.Constant(words, list(range(WIDTH))), limit)


def _parts_of_row(builder, pointer):
    """Return pointers to x and d of a dual number in an array."""
    return [builder.gep(pointer, [INT32(0), INT32(k)]) for k in (0, 2)]


@intrinsic
def _load_element(typingctx, array, index):
    def codegen(context, builder, sig, args):
        index = context.cast(builder, args[1], sig.args[1], types.int64)
        pointer = element_pointer(context, builder, sig.args[0], args[0], index)
        if array.dtype != dual:
            return builder.load(pointer)
        x, d = _parts_of_row(builder, pointer)
        return made(builder, builder.load(x), builder.load(d, align=8))

    return array.dtype(array, index), codegen


@intrinsic
def _store_element(typingctx, array, index, value):
    def codegen(context, builder, sig, args):
        index = context.cast(builder, args[1], sig.args[1], types.int64)
        pointer = element_pointer(context, builder, sig.args[0], args[0], index)
        if array.dtype != dual:
            builder.store(context.cast(builder, args[2], sig.args[2], types.float64), pointer)
            return context.get_dummy_value()
        value = dual_of(context, builder, args[2], sig.args[2])
        x, d = _parts_of_row(builder, pointer)
        builder.store(builder.extract_value(value, 0), x)
        builder.store(builder.extract_value(value, 1), d, align=8)
        return context.get_dummy_value()

    return types.void(array, index, value), codegen


@partial(verb, options={})
def get(array, index):
    """Return element `index` of a vector as float64 or dual number, or row `index` of an (n, 8) array as `Lanes`."""
    if is_contiguous(array, 2):
        return load
    if is_contiguous(array, 1) or is_contiguous(array, 1, of=dual):
        return _load_element
    return None


@partial(verb, options={})
def put(array, index, value):
    """Write a number to element `index` of a vector, float64 or dual, or `Lanes` or a number to row `index` of an
    (n, 8) array.
    """
    if is_contiguous(array, 2):
        return store
    if is_contiguous(array, 1) or is_contiguous(array, 1, of=dual):
        return _store_element
    return None


@intrinsic
def room(typingctx, count, like):
    """Return `count` numbers, or rows of eight if `like` has such rows, on the stack: workspace until the kernel that
    calls this returns. A kernel calls it once, outside of loops, for at most a megabyte.
    """
    if not (is_contiguous(like, 1, 2) or is_contiguous(like, 1, of=dual)) or not isinstance(count, types.Integer):
        return None
    found = types.Array(like.dtype, like.ndim, "C")
    element, size = (DUAL_ROW, 16 * WIDTH) if like.dtype == dual else (DOUBLE, 8)

    def codegen(context, builder, sig, args):
        from numba.np.arrayobj import populate_array  # a run whose kernels are on disk does not need it

        shape = [context.cast(builder, args[0], sig.args[0], types.int64), INT64(WIDTH)][: like.ndim]
        strides = [INT64(size)] if like.ndim == 1 else [INT64(8 * WIDTH), INT64(8)]
        elements = shape[0] if like.ndim == 1 else builder.mul(*shape)
        data = builder.alloca(element, size=elements)
        data.align = 64
        array = context.make_array(found)(context, builder)
        populate_array(array, data=data, shape=shape, strides=strides, itemsize=INT64(size), meminfo=None)
        return array._getvalue()

    return found(count, like), codegen


@intrinsic
def full(typingctx, value):
    """Return a float64 in all eight lanes."""
    if not isinstance(value, types.Float | types.Integer):
        return None

    def codegen(context, builder, sig, args):
        return widen(context, builder, args[0], sig.args[0])

    return lanes(value), codegen


@intrinsic
def alike(typingctx, value, other):
    """Return a float64 in all lanes of the kind that `other` has; the float64 itself, if that is one."""
    if not isinstance(value, types.Float | types.Integer) or not is_operand(other):
        return None
    kind = common_type(value, other)

    def codegen(context, builder, sig, args):
        if isinstance(kind, LanesType):
            return widen(context, builder, args[0], sig.args[0], kind)
        if kind == dual:
            return dual_of(context, builder, args[0], sig.args[0])
        return context.cast(builder, args[0], sig.args[0], kind)

    return kind(value, other), codegen


@intrinsic
def joined(typingctx, a, b):
    """Return two `Lanes` as one value of sixteen lanes, whose instructions alternate: so latencies overlap."""
    if not a == b == lanes:
        return None
    return pair(a, b), lambda context, builder, sig, args: shuffle(builder, *args, range(2 * WIDTH))


@intrinsic
def halves(typingctx, value):
    """Return the two `Lanes` of what `joined` returns."""
    if value != pair:
        return None

    def codegen(context, builder, sig, args):
        parts = [shuffle(builder, args[0], args[0], range(k, k + WIDTH)) for k in (0, WIDTH)]
        return context.make_tuple(builder, sig.return_type, parts)

    return types.UniTuple(lanes, 2)(value), codegen


@verb
def load_like(like, array, row, apart):
    """Return a row of an (n, 8) array, for `like` of sixteen lanes joined with the row that is `apart` further on."""
    if like == pair:
        return lambda like, array, row, apart: joined(load(array, row), load(array, row + apart))
    return lambda like, array, row, apart: load(array, row)


def _store_both(array, row, apart, value):
    one, two = halves(value)
    store(array, row, one)
    store(array, row + apart, two)


@verb
def store_like(array, row, apart, value):
    """Write `Lanes` to where `load_like` reads them."""
    return _store_both if value == pair else lambda array, row, apart, value: store(array, row, value)


@intrinsic
def unit(typingctx, index):
    """Return 1 in lane `index` and 0 in the others."""
    if not isinstance(index, types.Integer):
        return None

    def codegen(context, builder, sig, args):
        index = context.cast(builder, args[0], sig.args[0], types.int32)
        return builder.insert_element(constant(0.0), ir.Constant(DOUBLE, 1.0), index)

    return lanes(index), codegen


@intrinsic
def lane(typingctx, value, index):
    """Return lane `index`, counted from 0, as float64."""
    if not isinstance(value, LanesType):
        return None

    def codegen(context, builder, sig, args):
        return builder.extract_element(args[0], context.cast(builder, args[1], sig.args[1], types.int32))

    return types.float64(value, index), codegen
