"""The Kepler flow at sixty digits and its condition number: slow, plain, sharing no line with orbits."""

from __future__ import annotations

from typing import Any

import mpmath as mp

DIGITS = 60
UNIT = mp.mpf(2) ** -53
"""Half an ulp of 1."""


def _functions(s: Any, beta: Any) -> tuple[Any, Any, Any, Any]:
    """Return G0 ... G3: by trigonometric or hyperbolic functions, or by the series where those cancel."""
    if abs(beta * s * s) < mp.mpf("1e-4"):
        z = -beta * s * s
        return tuple(s**k * sum(z**i / mp.factorial(2 * i + k) for i in range(14)) for k in range(4))  # type: ignore
    w = mp.sqrt(abs(beta))
    x = w * s
    if beta > 0:
        return mp.cos(x), mp.sin(x) / w, (1 - mp.cos(x)) / beta, (x - mp.sin(x)) / (beta * w)
    return mp.cosh(x), mp.sinh(x) / w, (1 - mp.cosh(x)) / beta, (x - mp.sinh(x)) / (beta * w)


def _anomaly(r0: Any, eta: Any, beta: Any, gm: Any, dt: Any, start: Any) -> Any:
    """Return s with r0 G1 + eta G2 + gm G3 = dt, by Newton's iteration in a bracket, from `start` if it is not None."""

    def time(s: Any) -> tuple[Any, Any]:
        G0, G1, G2, G3 = _functions(s, beta)
        return sign * (r0 * G1 + eta * G2 + gm * G3 - dt), r0 * G0 + eta * G1 + gm * G2

    sign = 1 if dt > 0 else -1
    low, high = mp.mpf(0), min(abs(dt) / r0, 1 / mp.sqrt(abs(beta))) if beta else abs(dt) / r0
    if start is not None:
        low, high = abs(start) * (1 - mp.mpf("1e-9")), abs(start) * (1 + mp.mpf("1e-9"))
        if time(sign * low)[0] > 0:
            low = mp.mpf(0)
    while time(sign * high)[0] < 0:
        low, high = high, 2 * high
    s = (low + high) / 2
    for _ in range(2000):
        miss, r = time(sign * s)
        low, high = (low, s) if miss > 0 else (s, high)
        new = s - miss / r if r > 0 else low
        if not low < new < high:
            new = (low + high) / 2
        if abs(new - s) <= mp.mpf(10) ** (8 - mp.mp.dps) * new:
            return sign * new
        s = new
    raise ArithmeticError("no convergence")


def flow(q: Any, v: Any, gm: Any, dt: Any, start: Any = None) -> tuple[list[Any], list[Any], Any]:
    """Return position, velocity and the universal anomaly, int dt/r, after dt, as mpf; `start` is one near by."""
    q, v, gm, dt = [mp.mpf(x) for x in q], [mp.mpf(x) for x in v], mp.mpf(gm), mp.mpf(dt)
    if dt == 0 or gm == 0:
        return [x + dt * u for x, u in zip(q, v, strict=True)], v, None
    r0, eta = norm(q), sum(x * u for x, u in zip(q, v, strict=True))
    beta, turns = 2 * gm / r0 - sum(x * x for x in v), mp.mpf(0)
    if beta > 0:
        period = 2 * mp.pi * gm / beta ** mp.mpf(1.5)
        turns = 2 * mp.pi / mp.sqrt(beta) * mp.nint(dt / period)
        dt -= period * mp.nint(dt / period)
        if dt == 0:
            return q, v, turns
    s = _anomaly(r0, eta, beta, gm, dt, None if start in (None, turns) else start - turns)
    G0, G1, G2, _ = _functions(s, beta)
    r = r0 * G0 + eta * G1 + gm * G2
    f, g, df, dg = 1 - gm * G2 / r0, r0 * G1 + eta * G2, -gm * G1 / (r * r0), 1 - gm * G2 / r
    return (
        [f * x + g * u for x, u in zip(q, v, strict=True)],
        [df * x + dg * u for x, u in zip(q, v, strict=True)],
        s + turns,
    )


def norm(x: Any) -> Any:
    """Return the length of a vector."""
    return mp.sqrt(sum(y * y for y in x))


def distance(x: Any, y: Any) -> Any:
    """Return the length of the difference of two vectors."""
    return norm([a - b for a, b in zip(x, y, strict=True)])


def judged(
    q: Any, v: Any, gm: float, dt: float, got_q: Any, got_v: Any, bound: float
) -> tuple[float, float, float, float]:
    """Return the relative errors of position and velocity in units of 2^-53, and their condition numbers.

    The condition number of position is 1 + the sum over the inputs x_i = q, v (each component), gm, dt of
    |dq+/dx_i| |x_i| / |q+|, Euclidean lengths: what a relative change of each input by 2^-53, and of the result, can
    do. The same with v+ for velocity. Derivatives are difference quotients, good to some fifteen digits. Both are 1,
    the least they can be, where the errors are within the bound anyway.
    """
    with mp.workdps(DIGITS):
        inputs = [mp.mpf(float(x)) for x in (*q, *v, gm, dt)]
        true_q, true_v, s = flow(inputs[:3], inputs[3:6], inputs[6], inputs[7])
        errors = [
            float(distance([mp.mpf(float(x)) for x in got], true) / norm(true) / UNIT)
            for got, true in ((got_q, true_q), (got_v, true_v))
        ]
        if max(errors) <= bound:
            return errors[0], errors[1], 1.0, 1.0
        step = mp.mpf(10) ** -20
        sizes = [norm(true_q), norm(true_v)]
        for i, x in enumerate(inputs):
            moved = list(inputs)
            moved[i] = x * (1 + step)
            end = flow(moved[:3], moved[3:6], moved[6], moved[7], s)
            sizes = [size + distance(x, y) / step for size, x, y in zip(sizes, end, (true_q, true_v), strict=False)]
        return errors[0], errors[1], float(sizes[0] / norm(true_q)), float(sizes[1] / norm(true_v))
