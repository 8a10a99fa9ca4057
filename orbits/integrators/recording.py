"""Compiled loops that march any method on any Lagrangian and record states on the way."""

from __future__ import annotations

from orbits.integrators.methods import advance, advance_canonical
from orbits.kernels.compile import kernel


@kernel
def record(method, tag, parameters, coefficients, h, q, q_lo, v, v_lo, memory, work, field_record, every, out_q, out_v):
    """Fill out_q, out_v (samples, d) with the states after every `every` steps of h.

    Returns (status, steps done or tried, evaluations).
    """
    evaluations = 0
    for sample in range(out_q.shape[0]):
        status, done, _, count = advance(
            method, tag, parameters, coefficients, h, q, q_lo, v, v_lo, memory, work, field_record, q[:0], every
        )
        evaluations += count
        if status != 0:
            return status, sample * every + done, evaluations
        for k in range(out_q.shape[1]):
            out_q[sample, k] = q[k]
            out_v[sample, k] = v[k]
    return 0, out_q.shape[0] * every, evaluations


@kernel
def record_canonical(method, tag, parameters, coefficients, t, h, q, q_lo, p, p_lo, memory, work, every, out_q, out_p):
    """Fill out_q, out_p (samples, d), the march starting at time t; as `record` otherwise."""
    evaluations = 0
    for sample in range(out_q.shape[0]):
        status, done, _, count = advance_canonical(
            method, tag, parameters, coefficients, t, sample * every, h, q, q_lo, p, p_lo, memory, work, every
        )
        evaluations += count
        if status != 0:
            return status, sample * every + done, evaluations
        for k in range(out_q.shape[1]):
            out_q[sample, k] = q[k]
            out_p[sample, k] = p[k]
    return 0, out_q.shape[0] * every, evaluations
