"""Operations across lanes: sums, maxima, and the same for eight rows at a time."""

from __future__ import annotations

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from orbits.kernels.lanes.type import (
    INT32,
    INT64,
    VECTOR,
    WIDTH,
    LanesType,
    constant,
    element_pointer,
    is_contiguous,
    lanes,
    shuffle,
    splat,
)


@intrinsic
def any_lane(typingctx, condition):
    """Return whether `condition` is not zero in some lane; of a number or a boolean, whether it is not zero."""
    if isinstance(condition, types.Boolean | types.Number):

        def truth(context, builder, sig, args):
            return context.cast(builder, args[0], sig.args[0], types.boolean)

        return types.boolean(condition), truth
    if not isinstance(condition, LanesType):
        return None

    def codegen(context, builder, sig, args):
        mask, word = builder.fcmp_unordered("!=", args[0], constant(0.0, condition.count)), ir.IntType(condition.count)
        return builder.icmp_unsigned("!=", builder.bitcast(mask, word), word(0))

    return types.boolean(condition), codegen


@intrinsic
def first_lane(typingctx, condition):
    """Return the first lane in which `condition` is not zero; the number of lanes if there is none."""
    if not isinstance(condition, LanesType):
        return None

    def codegen(context, builder, sig, args):
        mask, word = builder.fcmp_unordered("!=", args[0], constant(0.0, condition.count)), ir.IntType(condition.count)
        bits = builder.zext(builder.bitcast(mask, word), INT64)
        # A bit beyond the lanes, so that there is always one.
        return builder.cttz(builder.or_(bits, INT64(1 << condition.count)), ir.Constant(ir.IntType(1), 1))

    return types.int64(condition), codegen


# Three rounds fold or mix pairs of vectors, whose lanes then alternate between the two.
_ROUNDS = (
    ([0, 8, 2, 10, 4, 12, 6, 14], [1, 9, 3, 11, 5, 13, 7, 15]),
    ([0, 1, 8, 9, 4, 5, 12, 13], [2, 3, 10, 11, 6, 7, 14, 15]),
    ([0, 1, 2, 3, 8, 9, 10, 11], [4, 5, 6, 7, 12, 13, 14, 15]),
)


def _rows(context, builder, sig, args):
    row = context.cast(builder, args[1], sig.args[1], types.int64)
    pointer = element_pointer(context, builder, sig.args[0], args[0], row)
    pointer = builder.bitcast(pointer, VECTOR.as_pointer())
    return [builder.load(builder.gep(pointer, [INT64(i)]), align=8) for i in range(WIDTH)]


def _row_reduction(combine, doc):
    def typing(typingctx, array, row):
        if not is_contiguous(array, 2):
            return None

        def codegen(context, builder, sig, args):
            vectors = _rows(context, builder, sig, args)
            for even, odd in _ROUNDS:
                vectors = [
                    combine(builder, shuffle(builder, a, b, even), shuffle(builder, a, b, odd))
                    for a, b in zip(vectors[::2], vectors[1::2], strict=True)
                ]
            return vectors[0]

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


def _registers_of(builder, value):
    """Return the registers of eight lanes of a value."""
    count = value.type.count
    if count == WIDTH:
        return [value]
    return [shuffle(builder, value, value, range(k, k + WIDTH)) for k in range(0, count, WIDTH)]


def _of_registers(builder, registers):
    """Return the value of these registers."""
    return registers[0] if len(registers) == 1 else shuffle(builder, *registers, range(2 * WIDTH))


def _total(builder, x):
    """Return the sum of eight lanes, in the first lane."""
    for step in (4, 2, 1):
        x = builder.fadd(x, shuffle(builder, x, x, [(i + step) % WIDTH for i in range(WIDTH)]))
    return builder.extract_element(x, INT32(0))


@intrinsic
def total(typingctx, value):
    """Return the sum of the lanes, added pairwise; of two registers, of their sums."""
    if not isinstance(value, LanesType):
        return None

    def codegen(context, builder, sig, args):
        first, *others = _registers_of(builder, args[0])
        for other in others:
            first = builder.fadd(first, other)
        return _total(builder, first)

    return types.float64(value), codegen


@intrinsic
def largest(typingctx, value):
    """Return the largest lane. NaN lanes may be ignored."""
    if not isinstance(value, LanesType):
        return None

    def codegen(context, builder, sig, args):
        x = args[0]
        for step in (4, 2, 1):
            y = shuffle(builder, x, x, [(i + step) % WIDTH for i in range(WIDTH)])
            x = builder.select(builder.fcmp_ordered(">", x, y), x, y)
        return builder.extract_element(x, INT32(0))

    return types.float64(value), codegen


@intrinsic
def transposed(typingctx, array, row):
    """Return rows `row` ... `row` + 7 of an (n, 8) array as eight `Lanes`, the j-th holding element j of each row."""
    if not is_contiguous(array, 2):
        return None

    def codegen(context, builder, sig, args):
        vectors = _rows(context, builder, sig, args)
        for step, (even, odd) in zip((1, 2, 4), _ROUNDS, strict=True):
            mixed = list(vectors)
            for i in range(WIDTH):
                if not i & step:
                    mixed[i] = shuffle(builder, vectors[i], vectors[i + step], even)
                    mixed[i + step] = shuffle(builder, vectors[i], vectors[i + step], odd)
            vectors = mixed
        return context.make_tuple(builder, sig.return_type, vectors)

    return types.UniTuple(lanes, WIDTH)(array, row), codegen


def _running(typing_name, doc, up):
    def typing(typingctx, value):
        if not isinstance(value, LanesType):
            return None

        def codegen(context, builder, sig, args):
            zero = constant(0.0)

            def moved(x, step):
                indices = [i - step if i >= step else WIDTH + i for i in range(WIDTH)]
                if not up:
                    indices = [i + step if i + step < WIDTH else WIDTH + i for i in range(WIDTH)]
                return shuffle(builder, x, zero, indices)

            def within(x):
                # Of the three next to it, and of the four beyond: two moves deep.
                one, two, three = moved(x, 1), moved(x, 2), moved(x, 3)
                pair = builder.fadd(one, two)
                four = builder.fadd(builder.fadd(x, three), pair)
                return builder.fadd(builder.fadd(pair, three), moved(four, 4))

            parts = _registers_of(builder, args[0])
            found = [within(part) for part in parts]
            if len(parts) == 2:
                here, there = (1, 0) if up else (0, 1)
                found[here] = builder.fadd(found[here], splat(builder, _total(builder, parts[there])))
            return _of_registers(builder, found)

        return value(value), codegen

    typing.__doc__ = doc
    typing.__name__ = typing_name
    return intrinsic(typing)


@intrinsic(prefer_literal=True)
def turned(typingctx, value, places):
    """Return the lanes turned: lane i is lane i + places of `value`, counted round; each register of two for itself.

    places : a literal integer
    """
    if not isinstance(value, LanesType) or not isinstance(places, types.IntegerLiteral):
        return None
    count = places.literal_value

    def codegen(context, builder, sig, args):
        order = [i - i % WIDTH + (i + count) % WIDTH for i in range(value.count)]
        return shuffle(builder, args[0], args[0], order)

    return value(value, places), codegen


sums_before = _running("sums_before", "Return in each lane the sum of the lanes before it.", True)
sums_after = _running("sums_after", "Return in each lane the sum of the lanes after it.", False)
