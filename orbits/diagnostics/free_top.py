"""The free rotation of a rigid body in many digits, by Jacobi's elliptic functions and the integral of the third kind.

It shares nothing with `orbits.kernels.rotation.free_rotation`, which it judges. With I_1 < I_2 < I_3, M = |Pi|, and t =
0 where Omega_2 = 0, the rates are multiples of cn, sn and dn of lambda t if Pi goes round the axis 3, of dn, sn and cn
if it goes round the axis 1, and

    R = R_z(phi) R_x(theta) R_z(psi),     cos(theta) = Pi_3/M,     psi = atan2(Pi_1, Pi_2)
    phi = (M/I_3) t + M (I_3 - I_1)/(I_1 I_3 lambda) Pi(n; am(lambda t) | k^2)

Source: Landau & Lifshitz, Mechanics, sec. 37; Whittaker (1937), Analytical Dynamics, sec. 69.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mpmath

from orbits.errors import InputError
from orbits.many_digits import many_digits


def free_top(
    inertia: Sequence[float], q: Sequence[float], momentum: Sequence[float], time: Any, *, digits: int = 40
) -> tuple[Any, Any]:
    """Return the attitude, (3, 3), and the momentum in the axes of the body, (3, 1), as matrices of mpmath.

    inertia : three different principal moments; q : the attitude at the start, a quaternion of any length
    momentum : at the start, in the axes of the body, (3,); the motion must not be one about a principal axis, nor the
        separatrix
    time : a number, also of mpmath

    Raises InputError for equal moments.
    """
    if len(set(inertia)) < 3:
        raise InputError(f"inertia is {tuple(inertia)}; expected three different moments.")
    with many_digits(digits):
        moments = [mpmath.mpf(x) for x in inertia]
        pi = mpmath.matrix([mpmath.mpf(x) for x in momentum])
        square = mpmath.fdot(pi, pi)
        size, twice = mpmath.sqrt(square), sum(x * x / y for x, y in zip(pi, moments, strict=True))
        axes = _axes(moments, pi, square > twice * sorted(moments)[1])
        motion = _Motion(sorted(moments), square, size, twice, axes * pi)
        begin, after = motion.at(0), motion.at(mpmath.mpf(time))
        return _rotation(q) * axes.T * begin[0].T * after[0] * axes, axes.T * after[1]


class _Motion:
    """The motion of a body with I_1 < I_2 < I_3 about its axis 3, or 1, whose momentum is positive."""

    def __init__(self, moments: Any, square: Any, size: Any, twice: Any, pi: Any) -> None:
        one, two, three = moments
        self.moments, self.size = moments, size
        low, high = square - twice * one, twice * three - square
        self.last = square > twice * two
        product = one * two * three
        if self.last:
            self.rate = mpmath.sqrt((three - two) * low / product)
            self.m = (two - one) * high / ((three - two) * low)
            self.n = -three * (two - one) / (one * (three - two))
            middle = mpmath.sqrt(high / (two * (three - two)))
        else:
            self.rate = mpmath.sqrt((two - one) * high / product)
            self.m = (three - two) * low / ((two - one) * high)
            self.n = -three * low / (one * high)
            middle = mpmath.sqrt(low / (two * (two - one)))
        first, third = mpmath.sqrt(high / (one * (three - one))), mpmath.sqrt(low / (three * (three - one)))
        self.sizes = first, middle, third
        turning = pi[0] / one / first if self.last else pi[2] / three / third
        self.start = mpmath.ellipf(mpmath.atan2(pi[1] / two / middle, turning), self.m)
        self.before = mpmath.mpf(0)
        self.before = self._integral(self.start)[0]

    def _integral(self, u: Any) -> tuple[Any, Any]:
        """Return the integral of the third kind at am(u), less that at the start, and u less whole periods."""
        quarter = mpmath.ellipk(self.m)
        turns = mpmath.nint(u / (4 * quarter))
        rest = u - 4 * turns * quarter
        sn, cn = (mpmath.ellipfun(name, rest, m=self.m) for name in ("sn", "cn"))
        angle = mpmath.atan2(sn, cn)
        if abs(angle - mpmath.pi * rest / (2 * quarter)) > mpmath.pi:  # at the ends, atan2 is on the other side
            angle -= 2 * mpmath.pi * mpmath.sign(angle)
        found = mpmath.ellippi(self.n, angle, self.m) + 4 * turns * mpmath.ellippi(self.n, self.m)
        return found - self.before, rest

    def at(self, time: Any) -> tuple[Any, Any]:
        """Return the attitude, but for a constant rotation, and the momentum."""
        one, _, three = self.moments
        third, u = self._integral(self.start + self.rate * time)
        sn, cn, dn = (mpmath.ellipfun(name, u, m=self.m) for name in ("sn", "cn", "dn"))
        shapes = (cn, sn, dn) if self.last else (dn, sn, cn)
        pi = mpmath.matrix([x * y * z for x, y, z in zip(self.moments, self.sizes, shapes, strict=True)])
        phi = self.size * (time / three + (three - one) / (one * three * self.rate) * third)
        return _about_z(phi) * _about_x(mpmath.acos(pi[2] / self.size)) * _about_z(mpmath.atan2(pi[0], pi[1])), pi


def _axes(moments: Any, pi: Any, last: bool) -> Any:
    """Return the rotation to axes in the order of the moments, about one of which the momentum is positive."""
    order = sorted(range(3), key=lambda k: moments[k])
    out = mpmath.zeros(3)
    for row, k in enumerate(order):
        out[row, k] = 1
    if mpmath.det(out) < 0:
        out = -out
    if (out * pi)[2 if last else 0] < 0:
        out = mpmath.diag([-1, 1, -1]) * out
    return out


def _rotation(q: Any) -> Any:
    a, b, c, d = (mpmath.mpf(x) for x in q)
    size = a * a + b * b + c * c + d * d
    rows = [
        [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
        [2 * (b * c + a * d), a * a - b * b + c * c - d * d, 2 * (c * d - a * b)],
        [2 * (b * d - a * c), 2 * (c * d + a * b), a * a - b * b - c * c + d * d],
    ]
    return mpmath.matrix(rows) / size


def _about_x(angle: Any) -> Any:
    c, s = mpmath.cos(angle), mpmath.sin(angle)
    return mpmath.matrix([[1, 0, 0], [0, c, -s], [0, s, c]])


def _about_z(angle: Any) -> Any:
    c, s = mpmath.cos(angle), mpmath.sin(angle)
    return mpmath.matrix([[c, -s, 0], [s, c, 0], [0, 0, 1]])


__all__ = ["free_top"]
