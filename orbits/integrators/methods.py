"""How compiled code finds the kernels of a method: by a tag, as for Lagrangians (see `orbits.kernels.binding`)."""

from __future__ import annotations

import hashlib
from functools import lru_cache
from typing import Any

from numba.extending import overload

from orbits.kernels.binding import Tag, kernel_of
from orbits.kernels.keeping import identity


@lru_cache(maxsize=256)
def method_tag(advance: Any, advance_canonical: Any, advance_particles: Any = None) -> Tag:
    """Return the tag of a method with these kernels; its name tells them from all others."""
    kernels = {"advance": advance, "advance_canonical": advance_canonical, "advance_particles": advance_particles}
    kernels = {name: kernel for name, kernel in kernels.items() if kernel is not None}
    digest = hashlib.sha256()
    for kernel in kernels.values():
        digest.update(identity(kernel.py_func).encode())
    return Tag(f"method-{digest.hexdigest()[:16]}", kernels)


def advance(method, tag, parameters, coefficients, h, q, q_lo, v, v_lo, memory, work, field, path, steps):
    """March in second-order form, as `Integrator.advance`."""
    raise NotImplementedError("advance() is for compiled code only")


@overload(advance)
def _advance(method, tag, parameters, coefficients, h, q, q_lo, v, v_lo, memory, work, field, path, steps):
    compiled = kernel_of(method, "advance")

    def call(method, tag, parameters, coefficients, h, q, q_lo, v, v_lo, memory, work, field, path, steps):
        return compiled(tag, parameters, coefficients, h, q, q_lo, v, v_lo, memory, work, field, path, steps)

    return compiled and call


def advance_particles(
    method,
    tag,
    parameters,
    coefficients,
    h,
    q,
    q_lo,
    v,
    v_lo,
    memory,
    work,
    field,
    steps,
    start,
    stop,
    observer,
    context,
    track,
):
    """March particles in second-order form, as `Integrator.advance_particles`."""
    raise NotImplementedError("advance_particles() is for compiled code only")


@overload(advance_particles)
def _advance_particles(
    method,
    tag,
    parameters,
    coefficients,
    h,
    q,
    q_lo,
    v,
    v_lo,
    memory,
    work,
    field,
    steps,
    start,
    stop,
    observer,
    context,
    track,
):
    compiled = kernel_of(method, "advance_particles")

    def call(
        method,
        tag,
        parameters,
        coefficients,
        h,
        q,
        q_lo,
        v,
        v_lo,
        memory,
        work,
        field,
        steps,
        start,
        stop,
        observer,
        context,
        track,
    ):
        return compiled(
            tag,
            parameters,
            coefficients,
            h,
            q,
            q_lo,
            v,
            v_lo,
            memory,
            work,
            field,
            steps,
            start,
            stop,
            observer,
            context,
            track,
        )

    return compiled and call


def advance_canonical(method, tag, parameters, coefficients, t, first, h, q, q_lo, p, p_lo, memory, work, steps):
    """March in canonical form, as `Integrator.advance_canonical`."""
    raise NotImplementedError("advance_canonical() is for compiled code only")


@overload(advance_canonical)
def _advance_canonical(method, tag, parameters, coefficients, t, first, h, q, q_lo, p, p_lo, memory, work, steps):
    compiled = kernel_of(method, "advance_canonical")

    def call(method, tag, parameters, coefficients, t, first, h, q, q_lo, p, p_lo, memory, work, steps):
        return compiled(tag, parameters, coefficients, t, first, h, q, q_lo, p, p_lo, memory, work, steps)

    return compiled and call
