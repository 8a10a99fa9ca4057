"""`Lanes`: eight float64 in one value, with arithmetic.

Numba leaves loops over pairs of bodies scalar. This type is LLVM's `<8 x double>`: one AVX-512 register, two AVX2 or
four NEON ones, chosen by LLVM. Kernels written with `get`, `put`, `rsqrt_cubed` and operators serve float64 and
`Lanes` from one source: an element of a vector of shape (n,) is a float64, a row of an array of shape (n, 8) is a
`Lanes`.

`joined` makes one value of sixteen lanes of two: the same arithmetic with the same bits, whose instructions alternate.

Comparison gives `Lanes` of 1.0 and 0.0. Nothing here checks bounds.
"""

from orbits.kernels.lanes.arithmetic import (
    exact_add,
    exact_mul,
    exact_sub,
    fma,
    inverse_powers,
    maximum,
    minimum,
    rint,
    rsqrt_cubed,
    rsqrt_cubed_pair,
    select,
    sqrt,
)
from orbits.kernels.lanes.memory import (
    alike,
    full,
    get,
    halves,
    joined,
    lane,
    load,
    load_like,
    load_some,
    put,
    room,
    store,
    store_like,
    store_some,
    unit,
)
from orbits.kernels.lanes.reductions import (
    any_lane,
    first_lane,
    largest,
    row_maxima,
    row_sums,
    sums_after,
    sums_before,
    total,
    transposed,
    turned,
)
from orbits.kernels.lanes.type import WIDTH, LanesType, lanes, pair

__all__ = [
    "WIDTH",
    "LanesType",
    "alike",
    "any_lane",
    "exact_add",
    "exact_mul",
    "exact_sub",
    "first_lane",
    "fma",
    "full",
    "get",
    "halves",
    "inverse_powers",
    "joined",
    "lane",
    "lanes",
    "largest",
    "load",
    "load_like",
    "load_some",
    "maximum",
    "minimum",
    "pair",
    "put",
    "rint",
    "room",
    "row_maxima",
    "row_sums",
    "rsqrt_cubed",
    "rsqrt_cubed_pair",
    "select",
    "sqrt",
    "store",
    "store_like",
    "store_some",
    "sums_after",
    "sums_before",
    "total",
    "transposed",
    "turned",
    "unit",
]
