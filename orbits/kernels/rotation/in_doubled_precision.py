"""Free rotation with the energy kept in doubled precision, so that rounding leaves no walk of the phase.

An exact rotation conserves the energy. Its rounding, 1e-16 of the angle of a step, adds up as a random walk, and so
the phase of the motion drifts as the time to the power 3/2: 1e-7 radians in 100,000 revolutions. The energy before and
after a step, of attitudes and momenta in doubled precision, tells the change of attitude that takes it back.

Every entry is a float64, or `Lanes` with one body in each.

Source: Brouwer (1937), Astron. J. 46, 149, on the growth of rounding errors.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import fma, select
from orbits.kernels.rotation.free_rotation import product, rotation
from orbits.kernels.sums.summation import accumulate, quick_two_sum, two_product, two_sum

LEAST = 2.0**-80
"""Below this fraction of |Pi|^2 |Omega|^2, the square of Omega x Pi, a body rotates about a principal axis."""

LARGEST = 2.0**-40
"""A larger change of the attitude, in radians, would be more than rounding."""


@kernel(inline=True, exact=True)
def _times(x, y):
    """Return the product of two pairs."""
    p, e = two_product(x[0], y[0])
    return p, e + (x[0] * y[1] + x[1] * y[0])


@kernel(inline=True, exact=True)
def _plus(x, y):
    """Return the sum of two pairs."""
    s, e = two_sum(x[0], y[0])
    return quick_two_sum(s, e + (x[1] + y[1]))


@kernel(inline=True, exact=True)
def _minus(x, y):
    """Return the difference of two pairs."""
    return _plus(x, (-y[0], -y[1]))


@kernel(inline=True, exact=True)
def _twice(x):
    return 2.0 * x[0], 2.0 * x[1]


@kernel(inline=True, exact=True)
def _dot(x, y, z, p):
    """Return x p_0 + y p_1 + z p_2, of pairs."""
    return _plus(_plus(_times(x, p[0]), _times(y, p[1])), _times(z, p[2]))


@kernel(exact=True)
def momentum_and_energy(attitude, momentum, inverse):
    """Return the momentum in the axes of the body, rounded, and twice its energy as a pair.

    attitude : four pairs (hi, lo), of about unit length together
    momentum : three pairs, in the axes of space
    inverse : 1/A, 1/B, 1/C, as numbers
    """
    a, b, c, d = attitude
    aa, bb, cc, dd = _times(a, a), _times(b, b), _times(c, c), _times(d, d)
    ab, ac, ad = _times(a, b), _times(a, c), _times(a, d)
    bc, bd, cd = _times(b, c), _times(b, d), _times(c, d)
    even, odd, rest, other = _plus(aa, bb), _plus(cc, dd), _minus(aa, bb), _minus(cc, dd)
    x = _dot(_minus(even, odd), _twice(_plus(bc, ad)), _twice(_minus(bd, ac)), momentum)
    y = _dot(_twice(_minus(bc, ad)), _plus(rest, other), _twice(_plus(cd, ab)), momentum)
    z = _dot(_twice(_plus(bd, ac)), _twice(_minus(cd, ab)), _minus(rest, other), momentum)
    size = _plus(even, odd)
    square = _times(size, size)
    X, Y, Z = _times(x, x), _times(y, y), _times(z, z)
    energy = _dot(X, Y, Z, ((inverse[0], 0.0), (inverse[1], 0.0), (inverse[2], 0.0)))
    # Of an attitude that is not of unit length to the last bit.
    ratio = energy[0] / square[0]
    left = fma(-ratio, square[0], energy[0]) + (energy[1] - ratio * square[1])
    return (x[0] / size[0], y[0] / size[0], z[0] / size[0]), quick_two_sum(ratio, left / square[0])


@kernel
def rotation_to_energy(momentum, inverse, excess):
    """Return the smallest rotation, a vector in the axes of the body, that takes `excess` from twice its energy.

    0 for a body that rotates about a principal axis, whose energy no rotation changes.
    """
    x, y, z = momentum
    u, v, w = inverse[0] * x, inverse[1] * y, inverse[2] * z
    p, q, r = v * z - w * y, w * x - u * z, u * y - v * x
    square = p * p + q * q + r * r
    along = -0.5 * excess / square
    along = select(along * along * square < LARGEST * LARGEST, along, 0.0)
    along = select(square > LEAST * (x * x + y * y + z * z) * (u * u + v * v + w * w), along, 0.0)
    return along * p, along * q, along * r


@kernel(inline=True)
def changed(attitude, low, change):
    """Return a unit quaternion and its low parts after a change, without what rounding did to its length."""
    a, b, c, d = attitude
    short = 0.5 * (1.0 - (a * a + b * b + c * c + d * d))
    a, a_lo = accumulate(a, low[0], change[0] + short * a)
    b, b_lo = accumulate(b, low[1], change[1] + short * b)
    c, c_lo = accumulate(c, low[2], change[2] + short * c)
    d, d_lo = accumulate(d, low[3], change[3] + short * d)
    return (a, b, c, d), (a_lo, b_lo, c_lo, d_lo)


@kernel(inline=True)
def _pairs(attitude, low):
    return (attitude[0], low[0]), (attitude[1], low[1]), (attitude[2], low[2]), (attitude[3], low[3])


@kernel(inline=True)
def turned_freely(moments, h, attitude, low, momentum):
    """Return the attitude and its low parts after free rotation for h, with the energy to the last bit of its pair.

    moments, h, attitude : as for `orbits.kernels.rotation.free_rotation.rotate`; low : the low parts of the attitude
    momentum : three pairs, in the axes of space
    """
    inverse = 1.0 / moments[0], 1.0 / moments[1], 1.0 / moments[2]
    own, before = momentum_and_energy(_pairs(attitude, low), momentum, inverse)
    more, _ = rotation(moments, h, own)
    attitude, low = changed(attitude, low, product(attitude, more))
    own, after = momentum_and_energy(_pairs(attitude, low), momentum, inverse)
    x, y, z = rotation_to_energy(own, inverse, (after[0] - before[0]) + (after[1] - before[1]))
    return changed(attitude, low, product(attitude, (0.0, 0.5 * x, 0.5 * y, 0.5 * z)))


__all__ = ["changed", "momentum_and_energy", "rotation_to_energy", "turned_freely"]
