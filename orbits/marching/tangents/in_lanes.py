"""What tangent vectors of bodies have in common, whatever march they follow: eight in lanes, and their growth."""

from __future__ import annotations

import numpy as np

from orbits.errors import InputError
from orbits.integrators.forms import Array
from orbits.kernels.lanes import WIDTH
from orbits.kernels.tangents.growth import AREA, LOGARITHM, SQUARE

DQ, DV = 0, 2
"""The parts of a tangent vector: dq and dv; the low part of each follows it."""


class InLanes:
    """Tangent vectors in lanes: `_count` of them in `_vectors`, (groups, 4, d, 8), and `_growth`, (groups, 5, 8), see
    `orbits.kernels.tangents.growth`, with no groups if it is not measured.
    """

    _count: int
    _vectors: Array
    _growth: Array

    def _write(self, lanes: Array) -> None:
        """Write vectors, (count, 2, d), into lanes; lanes that are not used move like the first one."""
        groups = len(self._vectors)
        filled = np.concatenate([lanes, np.repeat(lanes[:1], groups * WIDTH - len(lanes), axis=0)])
        self._vectors[:, [DQ, DV]] = filled.reshape(groups, WIDTH, *lanes.shape[1:]).transpose(0, 2, 3, 1)

    def _read(self) -> Array:
        """Return the vectors, (count, 2, d), rounded to float64."""
        groups, _, d, _ = self._vectors.shape
        return self._vectors[:, [DQ, DV]].transpose(0, 3, 1, 2).reshape(groups * WIDTH, 2, d)[: self._count]

    def _begin_growth(self, scale: float | None) -> float:
        """Write the lengths of the vectors, in which velocities count in units of time of `scale`, and return it; 1 if
        no growth is measured.
        """
        if scale is not None:
            parts = self._vectors[:, [DQ, DV]] * np.array([1.0, scale])[:, None, None]
            self._growth[:, SQUARE] = np.sum(parts**2, axis=(1, 2))
        return 1.0 if scale is None else float(scale)

    def _require_finite(self, time: float) -> None:
        """Raise InputError if the vectors have become too large by a time."""
        if not np.isfinite(self._vectors).all():
            raise InputError(
                f"tangent vectors exceed 1e308, the range of numbers, by t = {time:.10g}; expected a shorter duration, "
                "or orbits.megno, which scales them on the way."
            )

    def growth(self, time: float) -> tuple[Array, Array]:
        """Return MEGNO, the mean of Y over the time |time| > 0 of the march, and ln(|x| / |x0|), of each vector,
        (count,) each.
        """
        mean, log = self._growth[:, AREA].ravel() / abs(time), self._growth[:, LOGARITHM].ravel()
        return mean[: self._count], log[: self._count].copy()
