"""What steps of changing length ask of `bodies`: coefficients for a new length."""

from __future__ import annotations

from orbits.integrators.canonical.room import CONTINUATION, HOURS, LATE, MU_BAR
from orbits.integrators.collocation import dense_output
from orbits.integrators.collocation.lengths import look_ahead
from orbits.integrators.collocation.rows import HC, columns, combine
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, load, store


@kernel
def prepare(method, h, before, storage):
    """Write `CanonicalBodies.coefficients` for a step of h that follows one of `before`."""
    table = method.coefficients[0]
    ells = storage.scratch[storage.scratch.shape[0] - WIDTH :]  # no step has begun to use it
    look_ahead(table, h, before, ells)
    store(table, HOURS, load(table, HC))
    mu_bar = columns(method, table, MU_BAR)
    for j in range(WIDTH):
        store(table, CONTINUATION + j, combine(mu_bar, 1, table, ells, 0, j))


@kernel(inline=True)
def end_late(method, by):
    """Write by how much the next step ends later than t + h: the next one begins with the same s(q, v, t)."""
    method.coefficients[0, LATE, 0] = by


@kernel(inline=True)
def stretch(method, unit, factor):
    """Write the coefficients of steps `factor` times as long, for a cold start."""
    dense_output.stretch(method, unit, factor)
    store(method.coefficients[0], HOURS, factor * load(unit.coefficients[0], HOURS))
