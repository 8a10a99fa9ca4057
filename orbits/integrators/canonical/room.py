"""The coefficients and the workspace of `orbits.integrators.canonical.bodies`, by name."""

from __future__ import annotations

from typing import Any, NamedTuple

from orbits.integrators.collocation.rows import ETA
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH

# Rows of the table after those of `collocation.rows` for one register. MU, MU_BAR, CONTINUATION and INVERSE (of mu_bar)
# are each the first of eight: row j holds column j of a matrix, one stage in each lane. HOURS are times of the stages,
# and LATE by how much the step ends later than t + h, by the rounding of a clock that changes h.
MU = ETA + 3 * WIDTH
MU_BAR, CONTINUATION, INVERSE, HOURS = MU + WIDTH, MU + 2 * WIDTH, MU + 3 * WIDTH, MU + 4 * WIDTH
LATE = HOURS + 1
ROWS = LATE + 1

VELOCITY_SWEEPS = 50
"""The most evaluations of s+ for the velocities at the end of a step; then the step fails."""

SETTLED = 2.0**-46
"""Velocities at the end of a step have converged if their change is below this fraction and no longer falls."""


class Stages(NamedTuple):
    """The stages of a step, from which massless particles are accelerated.

    Q, V : (rows, 8) positions and velocities of the stages; q, v, q_end, v_end : (rows,) at both ends of the step
    Q_lo : (rows, 8), the low parts of Q; empty for a form without
    """

    Q: Any
    V: Any
    q: Any
    v: Any
    q_end: Any
    v_end: Any
    Q_lo: Any


class Work(NamedTuple):
    """The scratch of a step of d coordinates; rows are coordinates, lanes are stages.

    W, base, G : (rows, 8) as in the equations; base is the increment of the stages without W
    F, S : (rows, 8) forces and momenta in addition to Newton's
    change, history : see `orbits.kernels.sums.iteration`
    f, s, s_end, kick, kick_lo : (rows,)
    fine : (5 rows, 8), workspace of a last sweep in doubled precision; empty for a form without
    Y, D : (inner, 8), internal variables of forces at the stages, and h b times their rates; see `inner_rows`
    """

    W: Any
    base: Any
    G: Any
    F: Any
    S: Any
    change: Any
    history: Any
    f: Any
    s: Any
    s_end: Any
    kick: Any
    kick_lo: Any
    fine: Any
    Y: Any
    D: Any


@kernel(inline=True)
def stages_in(room, rows):
    """Return the parts of the stages by name."""
    at, some = 2 * rows, rows // WIDTH
    return Stages(
        room[:rows],
        room[rows:at],
        room[at : at + some].reshape(-1),
        room[at + some : at + 2 * some].reshape(-1),
        room[at + 2 * some : at + 3 * some].reshape(-1),
        room[at + 3 * some : at + 4 * some].reshape(-1),
        room[at + 4 * some :],
    )


@kernel(inline=True)
def inner_rows(count):
    """Return the number of rows for so many internal variables of forces: a multiple of eight."""
    return (count + WIDTH - 1) // WIDTH * WIDTH


@kernel(inline=True)
def work_in(scratch, rows, inner):
    """Return the parts of the scratch by name; inner : the number of rows for internal variables of forces."""
    at, some = 6 * rows, rows // WIDTH
    more = at + 3 * some
    end = scratch.shape[0] - 2 * inner
    return Work(
        scratch[:rows],
        scratch[rows : 2 * rows],
        scratch[2 * rows : 3 * rows],
        scratch[3 * rows : 4 * rows],
        scratch[4 * rows : 5 * rows],
        scratch[5 * rows : 6 * rows],
        scratch[at:more],
        scratch[more : more + some].reshape(-1),
        scratch[more + some : more + 2 * some].reshape(-1),
        scratch[more + 2 * some : more + 3 * some].reshape(-1),
        scratch[more + 3 * some : more + 4 * some].reshape(-1),
        scratch[more + 4 * some : more + 5 * some].reshape(-1),
        scratch[more + 5 * some : end],
        scratch[end : end + inner],
        scratch[end + inner :],
    )


@kernel(inline=True)
def padded_length(count):
    """Return `padded`, in compiled code."""
    return (count + WIDTH - 1) // WIDTH * WIDTH + WIDTH
