"""What terms of one body b share whose part of L is a sum, over all others, of functions of q_i - q_b and v_i - v_b."""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import get, put


@kernel(inline=True)
def difference(q, i, b, n):
    """Return q_i - q_b, three numbers."""
    return get(q, i) - get(q, b), get(q, n + i) - get(q, n + b), get(q, 2 * n + i) - get(q, 2 * n + b)


@kernel(inline=True)
def add_with_reaction(out, change, i, b, n):
    """Add three numbers to those of body i, and take them from those of body b."""
    for a in range(3):
        put(out, a * n + i, get(out, a * n + i) + change[a])
        put(out, a * n + b, get(out, a * n + b) - change[a])


@kernel(inline=True)
def add_differences(out, at, value, a, c, i, b, n):
    """Add a derivative by differences, of axes a and c, to the block of derivatives that starts at `at`."""
    d = 3 * n
    ii, bb = at + (a * n + i) * d + c * n + i, at + (a * n + b) * d + c * n + b
    ib, bi = at + (a * n + i) * d + c * n + b, at + (a * n + b) * d + c * n + i
    put(out, ii, get(out, ii) + value)
    put(out, bb, get(out, bb) + value)
    put(out, ib, get(out, ib) - value)
    put(out, bi, get(out, bi) - value)
