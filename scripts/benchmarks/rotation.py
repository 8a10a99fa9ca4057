"""The free rotation of rigid bodies: time of a step in lanes and alone, and errors after 100,000 revolutions."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray

import orbits
from orbits import rotations
from orbits.diagnostics.free_top import free_top
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import load, store
from orbits.kernels.rotation.free_rotation import rotate
from orbits.lagrangians import euler_top

Array = NDArray[np.float64]

REVOLUTIONS, BODIES = 100_000, 8


@kernel
def _in_lanes(moments: Any, h: Any, q: Any, momentum: Any, steps: Any) -> None:
    """Take steps of eight bodies in place; h : (1, 8), the rest (3, 8) and (4, 8)."""
    own = load(moments, 0), load(moments, 1), load(moments, 2)
    attitude = load(q, 0), load(q, 1), load(q, 2), load(q, 3)
    pi = load(momentum, 0), load(momentum, 1), load(momentum, 2)
    for _ in range(steps):
        attitude, pi = rotate(own, load(h, 0), attitude, pi)
    store(q, 0, attitude[0])
    store(q, 1, attitude[1])
    store(q, 2, attitude[2])
    store(q, 3, attitude[3])
    store(momentum, 0, pi[0])
    store(momentum, 1, pi[1])
    store(momentum, 2, pi[2])


@kernel
def _alone(moments: Any, h: Any, q: Any, momentum: Any, steps: Any) -> None:
    """Take steps of one body in place."""
    attitude, pi = (q[0], q[1], q[2], q[3]), (momentum[0], momentum[1], momentum[2])
    for _ in range(steps):
        attitude, pi = rotate((moments[0], moments[1], moments[2]), h, attitude, pi)
    q[0], q[1], q[2], q[3] = attitude
    momentum[0], momentum[1], momentum[2] = pi


def bodies() -> tuple[Array, Array, Array]:
    """Moments, unit quaternions and momenta of random bodies, (3, 8), (4, 8), (3, 8)."""
    rng = np.random.default_rng(1)
    a, b = rng.uniform(0.4, 1.0, (2, BODIES))
    q = rng.normal(size=(4, BODIES))
    moments = np.array([a, b, rng.uniform(abs(a - b), a + b)])
    return moments, q / np.linalg.norm(q, axis=0), rng.normal(size=(3, BODIES))


def part_rotation(repetitions: int) -> dict[str, Any]:
    """Free rotation of random bodies in closed form: ns a step for each of eight bodies in lanes, and for one alone;
    and the largest error of the attitude after 100,000 revolutions, in radians, compared with elliptic functions in 40
    digits. Then the same by `orbits.march`, whose kicks and energy are in doubled precision, and by Gauss with eight
    stages. The rounding of the angle alone makes 7e-11 radians.
    """
    moments, q, momentum = bodies()
    turning = np.linalg.norm(momentum / moments, axis=0)
    rows = []
    for angle in (0.01, 0.25, 1.0, 10.0, 1e4):
        h = angle / turning[None]
        steps = 20_000 if angle < 2.0 else 2_000
        wide = _best(repetitions, lambda h=h, n=steps: _in_lanes(moments, h, q.copy(), momentum.copy(), n))
        one = _best(repetitions, lambda h=h, n=steps: [
            _alone(moments[:, k].copy(), h[0, k], q[:, k].copy(), momentum[:, k].copy(), n) for k in range(BODIES)
        ])
        name = f"steps of {angle:g} rad"
        rows.append({"what": name, "ns in lanes": 1e9 * wide / steps / BODIES, "ns alone": 1e9 * one / steps / BODIES})
    leap = max(_error(moments[:, k], q[:, k], momentum[:, k], None)[0] for k in range(BODIES))
    rows.append({"what": "free_rotation, one leap", "error": leap})
    for method, angle in ((orbits.StormerVerlet(), 1.0), (orbits.StormerVerlet(), 0.25), (orbits.Gauss(stages=8), 1.0)):
        found = [_error(moments[:, k], q[:, k], momentum[:, k], (method, angle)) for k in range(3)]
        name = "exact rotation" if isinstance(method, orbits.StormerVerlet) else "Gauss, 8 stages"
        ns = 1e9 * min(spent for _, spent in found)
        what, worst = f"march, {name}, steps of {angle:g} rad", max(error for error, _ in found)
        rows.append({"what": what, "ns alone": ns, "error": worst})
    return {"rows": rows}


def _best(repetitions: int, run: Callable[[], Any]) -> float:
    run()
    found = []
    for _ in range(max(3, repetitions)):
        begin = time.perf_counter()
        run()
        found.append(time.perf_counter() - begin)
    return min(found)


def _error(inertia: Array, q: Array, momentum: Array, by: tuple[Any, float] | None) -> tuple[float, float]:
    """Return the error of the attitude after all revolutions, and the seconds of a step."""
    rates = momentum / inertia
    start, v = rotations.start(rates, q)
    span = 2.0 * np.pi * REVOLUTIONS / float(np.linalg.norm(rates))
    if by is None:
        found, _ = rotations.free_rotation(inertia, span, rates=rates, attitude=start)
        attitude, _ = free_top(inertia, start, inertia * rates, span)
        return _apart(found, attitude), 0.0
    method, angle = by
    top = euler_top.with_parameters(**dict(zip(("I1", "I2", "I3"), map(float, inertia), strict=True)))
    p = top.momentum(start, v)
    steps = round(2.0 * np.pi * REVOLUTIONS / angle)
    dt = span / steps
    orbits.march(top, method, q=start, p=p, dt=dt, steps=10)
    begin = time.perf_counter()
    path = orbits.march(top, method, q=start, p=p, dt=dt, steps=steps, every=steps)
    spent = time.perf_counter() - begin
    own = rotations.product(start * [1, -1, -1, -1], p)[1:] / 2.0
    attitude, _ = free_top(inertia, start, own, mpmath.mpf(dt) * steps)
    return _apart(path.q[-1], attitude), spent / steps


def _apart(q: Array, attitude: Any) -> float:
    """Return the largest error of an element of the rotation of q."""
    R = rotations.matrices(q)
    return max(abs(float(attitude[i, j] - mpmath.mpf(R[i, j]))) for i in range(3) for j in range(3))
