"""Steps gamma_i h of any method, one after the other, by the method's own kernels.

`coefficients` is (tag of the method, its coefficients for each substep, lengths of the substeps, their beginnings as
offsets from that of the step). The record of a step's field is that of its substeps, stacked.

Source: Hairer, Lubich & Wanner (2006), sec. II.4.
"""

from __future__ import annotations

from orbits.integrators import methods
from orbits.integrators.base import OK
from orbits.kernels.binding import dimension
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH
from orbits.kernels.observing import call_observer
from orbits.kernels.paths import record_state


@kernel
def advance(tag, parameters, coefficients, h, q, q_lo, v, v_lo, memory, work, field_record, path, steps):
    """March the massive bodies; as the method's own `advance`."""
    method, tables, lengths, _ = coefficients
    substeps = lengths.shape[0]
    size = dimension(tag, parameters)
    rows, columns = field_record.shape[1] // substeps, field_record.shape[2]
    evaluations = 0
    for step in range(steps):
        record_state(path, step, q, v, size)
        record = field_record[step % field_record.shape[0]]
        for i in range(substeps):
            own = record[i * rows : (i + 1) * rows].reshape(1, rows, columns)
            status, _, where, count = methods.advance(
                method, tag, parameters, tables[i], lengths[i], q, q_lo, v, v_lo, memory, work, own, path[:0], 1
            )
            evaluations += count
            if status != OK:
                return status, step, where, evaluations
    return OK, steps, 0, evaluations


@kernel
def advance_particles(
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
    field_record,
    steps,
    start,
    stop,
    observer,
    context,
    track,
):
    """March particles start ... stop - 1, eight at a time, through the recorded field of the substeps."""
    method, tables, lengths, _ = coefficients
    substeps = lengths.shape[0]
    rows, columns = field_record.shape[1] // substeps, field_record.shape[2]
    # What lies between the ends of a step is not observed: the method writes its track aside.
    none = 0 * observer
    aside, own_work = work[:12], work[12:]
    evaluations = 0
    for p in range(start, stop, WIDTH):
        last = min(p + WIDTH, stop)
        for step in range(steps):
            _record(track, step, q, v, p, last)
            for i in range(substeps):
                own = field_record[step, i * rows : (i + 1) * rows].reshape(1, rows, columns)
                status, _, where, count = methods.advance_particles(
                    method,
                    tag,
                    parameters,
                    tables[i],
                    lengths[i],
                    q,
                    q_lo,
                    v,
                    v_lo,
                    memory,
                    own_work,
                    own,
                    1,
                    p,
                    last,
                    none,
                    none,
                    aside,
                )
                evaluations += count
                if status != OK:
                    return status, step, where, evaluations
        _record(track, steps, q, v, p, last)
        call_observer(observer, context, track, h, steps, p, stop)
    return OK, steps, 0, evaluations


@kernel(inline=True)
def _record(track, step, q, v, first, stop):
    for p in range(first, stop):
        for k in range(3):
            track[6 * step + k, p - first], track[6 * step + 3 + k, p - first] = q[k, p], v[k, p]


@kernel
def advance_canonical(tag, parameters, coefficients, t, first, h, q, q_lo, p, p_lo, memory, work, steps):
    """March in canonical form; as the method's own `advance_canonical`."""
    method, tables, lengths, offsets = coefficients
    evaluations = 0
    for step in range(steps):
        now = t + (first + step) * h
        for i in range(lengths.shape[0]):
            status, _, where, count = methods.advance_canonical(
                method,
                tag,
                parameters,
                tables[i],
                now + offsets[i],
                0,
                lengths[i],
                q,
                q_lo,
                p,
                p_lo,
                memory,
                work,
                1,
            )
            evaluations += count
            if status != OK:
                return status, step, where, evaluations
    return OK, steps, 0, evaluations
