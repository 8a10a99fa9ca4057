"""Sequences of steps gamma_i h of any form of a method.

`method.coefficients` is (tag of the form, its coefficients for each substep, lengths of the substeps, offsets of their
beginnings from that of the step). The stages of a step are the stacked stages of its substeps.

Source: Hairer, Lubich & Wanner (2006), sec. II.4.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from orbits.integrators.forms import Array, Form
from orbits.kernels import dense, steps
from orbits.kernels.compile import kernel
from orbits.kernels.steps import OK, Method, Storage


@kernel(inline=True)
def _substep(storage, i, substeps):
    """Return the storage of a substep."""
    rows = storage.stages.shape[0] // substeps
    return Storage(storage.carry, storage.scratch, storage.stages[i * rows : (i + 1) * rows], storage.share)


@kernel(inline=True)
def step(method, model, t, h, state, storage):
    """Take all substeps."""
    tag, tables, lengths, offsets = method.coefficients
    evaluations = 0
    for i in range(lengths.shape[0]):
        own, base, now = _substep(storage, i, lengths.shape[0]), Method(tag, tables[i]), t + offsets[i]
        steps.begin(base, model, now, lengths[i], state, own)
        status, where, count = steps.step(base, model, now, lengths[i], state, own)
        evaluations += count
        if status != OK:
            return status, where, evaluations
    return OK, 0, evaluations


@kernel(inline=True)
def step_particles(method, model, t, h, particles, carry, storage):
    """Take all substeps of particles; their carry is passed from each to the next."""
    tag, tables, lengths, offsets = method.coefficients
    before, evaluations = particles, 0
    for i in range(lengths.shape[0]):
        own, base = _substep(storage, i, lengths.shape[0]), Method(tag, tables[i])
        particles, carry, status, count = steps.step_particles(
            base, model, t + offsets[i], lengths[i], particles, carry, own
        )
        evaluations += count
        if status != OK:
            return before, carry, status, evaluations
    return particles, carry, OK, evaluations


@kernel(inline=True)
def begin_particles(method, model, particles, storage):
    """As in the composed form."""
    tag, tables, lengths, _ = method.coefficients
    return steps.begin_particles(Method(tag, tables[0]), model, particles, _substep(storage, 0, lengths.shape[0]))


@kernel(inline=True)
def stretch(method, unit, factor):
    """Write the coefficients of the substeps, and their lengths."""
    tag, tables, lengths, offsets = method.coefficients
    _, unit_tables, unit_lengths, unit_offsets = unit.coefficients
    for i in range(lengths.shape[0]):
        dense.stretch(Method(tag, tables[i]), Method(tag, unit_tables[i]), factor)
        lengths[i], offsets[i] = factor * unit_lengths[i], factor * unit_offsets[i]


@dataclass(frozen=True)
class Chain(Form):
    """The composition of a form of a method.

    base : the form
    lengths : a function of h, proportional to it, that returns the lengths of the substeps; substeps : their number
    """

    base: Form
    lengths: Callable[[float], Array]
    substeps: int

    kernels: ClassVar[Mapping[str, Any]] = {
        "step": step,
        "step_particles": step_particles,
        "begin_particles": begin_particles,
        "stretch": stretch,
    }

    def own_kernels(self) -> Mapping[str, Any]:
        """Return the kernels; the layout of particles, if the base supports them, is that of the base."""
        base = self.base.own_kernels()
        of_particles = ("step_particles", "begin_particles") if "step_particles" not in base else ()
        without = (*of_particles, *(("stretch",) if "stretch" not in base else ()))
        own = {name: kernel for name, kernel in self.kernels.items() if name not in without}
        return own if of_particles else {**own, "width": base.get("width", 8)}

    def coefficients(self, h: float, before: float) -> Any:
        """Return the coefficients; the first substep follows the last one of a step of `before`."""
        lengths = self.lengths(h)
        previous = [lengths[-1] if before == h else self.lengths(before)[-1], *lengths[:-1]]
        tables = [self.base.coefficients(x, y) for x, y in zip(lengths, previous, strict=True)]
        return self.base.tag, np.array(tables), lengths, np.append(0.0, np.cumsum(lengths)[:-1])

    def stages_shape(self, size: int) -> tuple[int, int]:
        """The stacked stages of the substeps."""
        rows, columns = self.base.stages_shape(size)
        return self.substeps * rows, columns

    def carry_rows(self, size: int) -> int:
        """As for the base."""
        return self.base.carry_rows(size)

    @property
    def particle_carry_rows(self) -> int:
        """As for the base."""
        return self.base.particle_carry_rows

    def scratch_shape(self, size: int) -> tuple[int, int]:
        """As for the base."""
        return self.base.scratch_shape(size)

    def guess(self, carry: Array, v: Array) -> None:
        """As for the base."""
        self.base.guess(carry, v)

    def forget(self, carry: Array) -> None:
        """As for the base."""
        self.base.forget(carry)

    def accounts(self, carry: Array) -> Array:
        """As for the base."""
        return self.base.accounts(carry)

    def inner_of(self, carry: Array) -> Array:
        """As for the base."""
        return self.base.inner_of(carry)
