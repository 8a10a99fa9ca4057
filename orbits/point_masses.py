"""`PointMasses`: the state of point masses as floats, in any consistent system of units; their masses as forces change
them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class PointMasses(NamedTuple):
    """Bodies at a time: gm (n,), q and v (n, 3), float64, and the softening length.

    Length, time and GM are in one system of units, with G absorbed into GM; gm = 0 is a massless particle.
    """

    gm: Array
    q: Array
    v: Array
    softening: float = 0.0

    @property
    def massive(self) -> NDArray[np.bool_]:
        """Which bodies have a mass, (n,)."""
        massive: NDArray[np.bool_] = self.gm > 0.0
        return massive


def changed_masses(t: Any, forces: Iterable[Any], gm: Array, names: Sequence[str], units: Any) -> Array:
    """Return the GM of the bodies of a system at times t since its epoch, (..., bodies), with the sum of what each of
    its forces has changed by then; gm : without these.
    """
    return np.asarray(gm + sum(force.masses(gm, names, t, units) - gm for force in forces))
