"""The contributions of terms to the energy, the momenta and the centre of mass of the massive bodies."""

from __future__ import annotations

from typing import Any

import numpy as np

from orbits.kernels.binding import add_gradients, add_inertia, other_terms, total_value
from orbits.kernels.compile import kernel
from orbits.lagrangians.terms.base import Array, SumOfTerms


@kernel
def write_charges(tag, parameters, t, q, v, f, p, out):
    """Write sum v . p - L, sum p and sum q x p for each sample, where p and L are those of the terms.

    t : (samples,); q, v : (samples, 3n) in the kernels' order; f, p : (3n,) scratch; out : (samples, 7)
    """
    n = q.shape[1] // 3
    for k in range(q.shape[0]):
        for j in range(3 * n):
            p[j] = 0.0
        add_gradients(other_terms(tag), parameters[0], parameters[1:], t[k], q[k], v[k], f, p)
        energy = -total_value(other_terms(tag), parameters[0], parameters[1:], t[k], q[k], v[k])
        for j in range(3 * n):
            energy += v[k, j] * p[j]
        out[k, 0] = energy
        for j in range(1, 7):
            out[k, j] = 0.0
        for i in range(n):
            x, y, z, px, py, pz = q[k, i], q[k, n + i], q[k, 2 * n + i], p[i], p[n + i], p[2 * n + i]
            out[k, 1] += px
            out[k, 2] += py
            out[k, 3] += pz
            out[k, 4] += y * pz - z * py
            out[k, 5] += z * px - x * pz
            out[k, 6] += x * py - y * px


def beside_newton(lagrangian: SumOfTerms) -> tuple[Array, ...]:
    """Return the parameters of all terms as those of terms that are added to Newton's attraction of all pairs."""
    newton, *own = lagrangian.parameter_vector
    kinds = zip(lagrangian.summands, own, strict=True)
    return (newton, *(x if term.beside_newton is None else term.beside_newton for term, x in kinds))


def charges(lagrangian: SumOfTerms, q: Array, v: Array, t: Any = 0.0) -> tuple[Array, Array, Array]:
    """Return the contributions of the terms to energy (...), momentum (..., 3) and angular momentum (..., 3), times G.

    q, v : (..., n, 3) of the massive bodies; t : a time, or (...)
    In float64 arithmetic: accurate to about 1e-16 of the terms' own energy.
    """
    x, w, times = _samples(q, v, t)
    out = np.empty((len(x), 7))
    scratch = np.zeros((2, x.shape[1]))
    write_charges(lagrangian.tag, beside_newton(lagrangian), times, x, w, scratch[0], scratch[1], out)
    found = out.reshape((*q.shape[:-2], 7))
    return found[..., 0], found[..., 1:4], found[..., 4:7]


@kernel
def write_inertia(tag, parameters, t, q, v, out):
    """Write what each body weighs in the centre of mass besides GM for each sample, as `write_charges`; out :
    (samples, n).
    """
    for k in range(q.shape[0]):
        for i in range(out.shape[1]):
            out[k, i] = 0.0
        add_inertia(other_terms(tag), parameters[0], parameters[1:], t[k], q[k], v[k], out[k])


def inertia_of(lagrangian: SumOfTerms, q: Array, v: Array, t: Any = 0.0) -> Array:
    """Return what each massive body weighs in the centre of mass besides its mass, times G, (..., n).

    q, v : (..., n, 3) of the massive bodies; t : a time, or (...)
    """
    x, w, times = _samples(q, v, t)
    out = np.empty((len(x), q.shape[-2]))
    write_inertia(lagrangian.tag, lagrangian.parameter_vector, times, x, w, out)
    return out.reshape(q.shape[:-1])


def _samples(q: Array, v: Array, t: Any) -> tuple[Array, Array, Array]:
    """Return states and times of all samples as the kernels take them."""
    shape, n = q.shape[:-2], q.shape[-2]
    samples = int(np.prod(shape, dtype=np.int64))
    x, w = (np.ascontiguousarray(np.moveaxis(a, -1, -2)).reshape(samples, 3 * n) for a in (q, v))
    return x, w, np.ascontiguousarray(np.broadcast_to(np.asarray(t, dtype=np.float64), shape)).reshape(samples)
