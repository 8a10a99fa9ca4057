"""Elementary functions of float64, of dual numbers and, lane by lane, of `Lanes`: all give the same bits, those of the
C library.
"""

from __future__ import annotations

import math
from functools import partial, update_wrapper

from numba import types
from numba.extending import intrinsic

from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes.arithmetic import select
from orbits.kernels.lanes.dual import dual_number, number, slopes
from orbits.kernels.lanes.memory import full, lane
from orbits.kernels.lanes.reductions import any_lane
from orbits.kernels.lanes.type import VECTOR, LanesType, dual, lanes


@intrinsic
def _packed(typingctx, a, b, c, d, e, f, g, h):
    """Return eight float64 as `Lanes`."""

    def codegen(context, builder, sig, args):
        value = VECTOR(None)
        for k, x in enumerate(args):
            value = builder.insert_element(value, x, context.get_constant(types.int32, k))
        return value

    return lanes(*[types.float64] * 8), codegen


def _unary(function, derivative):
    """Return a decorator for a verb that calls the scalar `function` for float64, and eight times for `Lanes`; of dual
    numbers with its derivative.
    """

    def of_number(x):
        return function(x)

    def of_lanes(x):
        return _packed(
            function(lane(x, 0)),
            function(lane(x, 1)),
            function(lane(x, 2)),
            function(lane(x, 3)),
            function(lane(x, 4)),
            function(lane(x, 5)),
            function(lane(x, 6)),
            function(lane(x, 7)),
        )

    def of_dual(x):
        change = full(0.0)
        if any_lane(slopes(x)):  # what does not change has a derivative where the function has none
            change = select(slopes(x), slopes(x) * differentiated(number(x)), change)
        return dual_number(function(number(x)), change)

    differentiated = verb(lambda x: derivative, options={})

    def choose(x):
        if isinstance(x, LanesType):
            return of_lanes
        if x == dual:
            return of_dual
        return of_number if isinstance(x, types.Float | types.Integer) else None

    return partial(update_wrapper, verb(choose, options={}))


def _binary(function, by_first, by_second):
    def of_numbers(x, y):
        return function(x, y)

    def of_lanes(x, y):
        return _packed(
            function(lane(x, 0), lane(y, 0)),
            function(lane(x, 1), lane(y, 1)),
            function(lane(x, 2), lane(y, 2)),
            function(lane(x, 3), lane(y, 3)),
            function(lane(x, 4), lane(y, 4)),
            function(lane(x, 5), lane(y, 5)),
            function(lane(x, 6), lane(y, 6)),
            function(lane(x, 7), lane(y, 7)),
        )

    def of_lanes_and_number(x, y):
        return of_lanes_both(x, full(y))

    def of_number_and_lanes(x, y):
        return of_lanes_both(full(x), y)

    def of_duals(x, y):
        a, b, change, none = number(x), number(y), full(0.0), full(0.0)
        if any_lane(slopes(x)):
            change = change + select(slopes(x), slopes(x) * first(a, b), none)
        if any_lane(slopes(y)):
            change = change + select(slopes(y), slopes(y) * second(a, b), none)
        return dual_number(function(a, b), change)

    first, second = verb(lambda x, y: by_first, options={}), verb(lambda x, y: by_second, options={})

    def choose(x, y):
        if dual in (x, y):
            return of_duals
        wide = isinstance(x, LanesType), isinstance(y, LanesType)
        return {
            (True, True): of_lanes,
            (True, False): of_lanes_and_number,
            (False, True): of_number_and_lanes,
            (False, False): of_numbers,
        }[wide]

    of_lanes_both = verb(choose, options={})
    return partial(update_wrapper, of_lanes_both)


@_unary(math.sin, lambda x: math.cos(x))
def sin(x):
    """Return the sine; float64, dual numbers or `Lanes`."""


@_unary(math.cos, lambda x: -math.sin(x))
def cos(x):
    """Return the cosine; float64, dual numbers or `Lanes`."""


@_unary(math.tan, lambda x: 1.0 + math.tan(x) ** 2)
def tan(x):
    """Return the tangent; float64, dual numbers or `Lanes`."""


@_unary(math.asin, lambda x: 1.0 / math.sqrt(1.0 - x * x))
def asin(x):
    """Return the inverse sine; float64, dual numbers or `Lanes`."""


@_unary(math.acos, lambda x: -1.0 / math.sqrt(1.0 - x * x))
def acos(x):
    """Return the inverse cosine; float64, dual numbers or `Lanes`."""


@_unary(math.atan, lambda x: 1.0 / (1.0 + x * x))
def atan(x):
    """Return the inverse tangent; float64, dual numbers or `Lanes`."""


@_unary(math.sinh, lambda x: math.cosh(x))
def sinh(x):
    """Return the hyperbolic sine; float64, dual numbers or `Lanes`."""


@_unary(math.cosh, lambda x: math.sinh(x))
def cosh(x):
    """Return the hyperbolic cosine; float64, dual numbers or `Lanes`."""


@_unary(math.tanh, lambda x: 1.0 - math.tanh(x) ** 2)
def tanh(x):
    """Return the hyperbolic tangent; float64, dual numbers or `Lanes`."""


@_unary(math.exp, lambda x: math.exp(x))
def exp(x):
    """Return the exponential; float64, dual numbers or `Lanes`."""


@_unary(math.log, lambda x: 1.0 / x)
def log(x):
    """Return the natural logarithm; float64, dual numbers or `Lanes`."""


@_binary(math.atan2, lambda x, y: y / (x * x + y * y), lambda x, y: -x / (x * x + y * y))
def atan2(y, x):
    """Return the angle of the point (x, y); float64, dual numbers or `Lanes`."""


@_binary(
    math.pow,
    lambda x, y: y * math.pow(x, y - 1.0) if y != 0.0 else 0.0,
    lambda x, y: math.pow(x, y) * math.log(x) if x != 0.0 or y <= 0.0 else 0.0,
)
def power(x, y):
    """Return x to the power y; float64, dual numbers or `Lanes`."""


@partial(verb, options={})
def positive(x):
    """Return x where it is positive, else NaN; float64, dual numbers or `Lanes`."""
    return lambda x: select(x > 0.0, x, math.nan * x)
