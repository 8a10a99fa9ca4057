"""A block of steps of a march that was computed along with those of other systems."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from orbits.integrators.forms import Array
from orbits.kernels.state import all_finite
from orbits.kernels.steps import NOT_FINITE, OK

NAMES = "q", "q_lo", "v", "v_lo", "memory"
"""What a march of massive bodies changes."""


class Ready:
    """The block: its steps and evaluations, and the arrays of `NAMES` at its end; of `size` coordinates.

    record : the record of closest approaches at its end, if these were looked for already; else None
    """

    def __init__(
        self, count: int, evaluations: int, size: int, arrays: Sequence[Array], record: Array | None
    ) -> None:
        self.count, self._evaluations = count, evaluations
        self._size, self._arrays, self._record = size, arrays, record

    @property
    def observed(self) -> bool:
        """Whether closest approaches were looked for."""
        return self._record is not None

    def take(self, state: Mapping[str, Array]) -> tuple[int, int, int, int]:
        """Write the state at its end; return what `march` of `orbits.marching.stepping.driver` returns."""
        for name, array in zip(NAMES, self._arrays, strict=True):
            state[name][...] = array
        if self._record is not None:
            state["approaches"][...] = self._record
        status = OK if all_finite(state["q"], state["v"], self._size) else NOT_FINITE
        return status, self.count, 0, self._evaluations
