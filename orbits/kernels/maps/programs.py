"""Programs: the steps and correctors of Wisdom–Holman maps as sequences of stages, rows (kind, length).

A stage is implemented once for planets (`orbits.kernels.maps.stages`), once for the massless particles among them
(`orbits.kernels.maps.entering`), and once for tangent vectors (`orbits.kernels.tangents.through_maps`). The
coefficients of a method on Kepler orbits are the rows of `HEADER`, of the program that leads from the states that are
seen to those that are marched, and of that of a step.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel

DRIFT, STANDARD, MODIFIED, LAZY, FLOW = 0, 1, 2, 3, 4
"""Kinds of stages: Kepler motions; a kick by the interaction, plain, modified or at displaced places, with terms of
positions alone; the flow of other terms. In democratic heliocentric coordinates a plain kick includes the motion by
that of the dominant body."""

KIND, LENGTH = 0, 1
"""Columns of a stage."""

WHOLE, SHIFT, ANGLE, KICK, ENTRY = 0, 1, 2, 3, 4
"""Columns of the first row of the coefficients, the `HEADER`: the length of a step h; h^2/12 for the modified and the
lazy kick; the largest turn in a step at a pericentre; the kind of the kick; the stages from what is seen to what is
marched."""

HEADER = 1
"""Rows of the header."""


@kernel(inline=True)
def programs_of(coefficients):
    """Return the program that leads from what is seen to what is marched, and that of a step."""
    first = HEADER + int(coefficients[0, ENTRY])
    return coefficients[HEADER:first], coefficients[first:]


@kernel(inline=True)
def stage_of(entry, i, leaving):
    """Return the kind and the length of stage i; leaving : whether the stages are taken backwards."""
    row, sign = (entry.shape[0] - 1 - i, -1.0) if leaving else (i, 1.0)
    return int(entry[row, KIND]), sign * entry[row, LENGTH]


@kernel
def stretch(method, unit, factor):
    """Write the coefficients of a step `factor` times as long."""
    own, one = method.coefficients, unit.coefficients
    for row in range(HEADER, own.shape[0]):
        own[row, KIND], own[row, LENGTH] = one[row, KIND], factor * one[row, LENGTH]
    for column in range(own.shape[1]):
        own[0, column] = one[0, column]
    own[0, WHOLE], own[0, SHIFT] = factor * one[0, WHOLE], factor * (factor * one[0, SHIFT])
