"""Elements and two-body motion at 50 digits by the textbook's formulas: slow, plain, sharing no line with orbits."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import mpmath as mp
import pytest

from tests.kepler_truth import flow

DIGITS = 50
Vector = list[Any]


def _mpf(*values: Any) -> list[Any]:
    return [mp.mpf(x) if isinstance(x, mp.mpf) else mp.mpf(float(x)) for x in values]


def anomaly(M: Any, e: Any) -> Any:
    """Return E, or F for e > 1, by bisection of a bracket and Newton's iteration."""
    M, e = _mpf(M, e)
    if e < 1:
        M -= 2 * mp.pi * mp.nint(M / (2 * mp.pi))
        low, high = -mp.pi, mp.pi
        value, slope = (lambda E: E - e * mp.sin(E) - M), (lambda E: 1 - e * mp.cos(E))
    else:
        high = mp.asinh(abs(M) / (e - 1)) + 1
        low = -high
        value, slope = (lambda F: e * mp.sinh(F) - F - M), (lambda F: e * mp.cosh(F) - 1)
    return _root(value, slope, low, high)


def _root(value: Any, slope: Any, low: Any, high: Any) -> Any:
    x = (low + high) / 2
    for _ in range(1000):
        y = value(x)
        low, high = (low, x) if y > 0 else (x, high)
        new = x - y / slope(x)
        if not low < new < high:
            new = (low + high) / 2
        if abs(new - x) <= mp.mpf(10) ** (5 - DIGITS) * abs(new):
            return new
        x = new
    return x


def state_from_elements(
    gm: float, a: float, e: float, inc: float, Omega: float, omega: float, kind: str, where: float
) -> tuple[Vector, Vector]:
    """Return the state; kind is "M", "E", "f", "l" or "theta"; prograde orbits only for the last two."""
    gm, a, e, inc, Omega, omega, where = _mpf(gm, a, e, inc, Omega, omega, where)
    if kind in ("l", "theta"):
        where, kind = where - Omega - omega, "M" if kind == "l" else "f"
    if kind == "M":
        where, kind = anomaly(where, e), "E"
    if kind == "f":
        f = where
    elif e < 1:
        f = 2 * mp.atan(mp.sqrt((1 + e) / (1 - e)) * mp.tan(where / 2))
    else:
        f = 2 * mp.atan(mp.sqrt((e + 1) / (e - 1)) * mp.tanh(where / 2))
    p = a * (1 - e * e)
    r, speed = p / (1 + e * mp.cos(f)), mp.sqrt(gm / p)

    def in_space(x: Any, y: Any) -> Vector:
        x, y = mp.cos(omega) * x - mp.sin(omega) * y, mp.sin(omega) * x + mp.cos(omega) * y
        y, z = mp.cos(inc) * y, mp.sin(inc) * y
        return [mp.cos(Omega) * x - mp.sin(Omega) * y, mp.sin(Omega) * x + mp.cos(Omega) * y, z]

    return in_space(r * mp.cos(f), r * mp.sin(f)), in_space(-speed * mp.sin(f), speed * (e + mp.cos(f)))


def two_body(q: Sequence[Any], v: Sequence[Any], gm: Any, dt: Any) -> tuple[Vector, Vector]:
    """Return the state after dt."""
    q, v, _ = flow(_mpf(*q), _mpf(*v), *_mpf(gm, dt))
    return q, v


def two_body_floor(q: Sequence[Any], v: Sequence[Any], gm: float, dt: float) -> tuple[float, float]:
    """Return what half an ulp of every input does to position and velocity, relative, summed over the inputs."""
    inputs = _mpf(*q, *v, gm, dt)
    *exact, anomaly = flow(inputs[:3], inputs[3:6], inputs[6], inputs[7])
    change, total = mp.mpf("1e-20"), [mp.mpf(0), mp.mpf(0)]
    for i in range(8):
        moved = list(inputs)
        moved[i] *= 1 + change
        *other, _ = flow(moved[:3], moved[3:6], moved[6], moved[7], anomaly)
        total = [
            sum_ + _relative(a, b) / change * mp.mpf(2) ** -53 for sum_, a, b in zip(total, other, exact, strict=True)
        ]
    return float(total[0]), float(total[1])


def _relative(got: Sequence[Any], exact: Sequence[Any]) -> Any:
    size = mp.sqrt(sum(x * x for x in exact))
    return mp.sqrt(sum((x - y) ** 2 for x, y in zip(_mpf(*got), exact, strict=True))) / size


def relative_error(got: Sequence[Any], exact: Sequence[Any]) -> float:
    """Return |got - exact| / |exact| of two vectors."""
    return float(_relative(got, exact))


@pytest.fixture
def oracle() -> Any:
    """The functions of this file, at 50 digits."""
    with mp.workdps(DIGITS):
        yield SimpleNamespace(
            anomaly=anomaly,
            state_from_elements=state_from_elements,
            two_body=two_body,
            two_body_floor=two_body_floor,
            relative_error=relative_error,
        )
