"""State-transition matrices of a run, as values."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.body_names import few, index_of
from orbits.diagnostics.tangent import symplecticity_defect
from orbits.errors import InputError, shown
from orbits.export import Tabled, headed
from orbits.time_grid import dynamical_time

if TYPE_CHECKING:
    from orbits.system import System

Array = NDArray[np.float64]

MOST_SHOWN = 10
"""The most bodies in the table of a matrix."""


class StateTransition(Tabled):
    """State-transition matrices of a run: derivatives of the states at its samples by those at the start.

    system : at the start; t : the time of the matrices since the epoch, a quantity, () or (n,)
    matrix : (6 N, 6 N) or (n, 6 N, 6 N) float64: rows are the state at t, columns that at the start, in the order
        x, y, z, vx, vy, vz of each body in turn
    made_by : method and steps, in words

    Numbers are in the units of the system, such as au and d: a position by a position is a pure number, a position by a
    velocity a time, a velocity by a position 1 / time. stm["Mercury", "Venus"], (..., 6, 6), is how Mercury depends on
    the start of Venus; stm["Mercury"] how it depends on its own. Blocks that were not computed, and those of a
    particle after it is lost, are NaN.

    parameters : the names of those by which there are derivatives as well, such as "Apophis.A2"
    by_parameters : (6 N, P) or (n, 6 N, P) float64: the derivatives by these, at the same start, per the unit in which
        the system has each of them; stm["Apophis", "Apophis.A2"] are those of one body by one, (..., 6)
    """

    def __init__(
        self,
        system: System,
        times: Array,
        matrix: Array,
        momenta: Array,
        *,
        made_by: str,
        parameters: tuple[str, ...] = (),
        by_parameters: Array | None = None,
    ) -> None:
        self.system, self.matrix, self.made_by, self.parameters = system, matrix, made_by, parameters
        self.by_parameters = np.zeros((*matrix.shape[:-1], 0)) if by_parameters is None else by_parameters
        self._times, self._momenta = times, momenta
        self.matrix.flags.writeable = self.by_parameters.flags.writeable = False

    def until(self, gone: NDArray[np.bool_]) -> StateTransition:
        """Return it with NaN for the bodies that are gone at a sample; gone : (n, bodies)."""
        rows = np.repeat(gone, 6, axis=1)[:, :, None]
        matrix, by_parameters = (np.where(rows, np.nan, x) for x in (self.matrix, self.by_parameters))
        known: dict[str, Any] = {"made_by": self.made_by, "parameters": self.parameters}
        return StateTransition(self.system, self._times, matrix, self._momenta, by_parameters=by_parameters, **known)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the bodies, in the order of the rows and columns."""
        return self.system.names

    @property
    def t(self) -> u.Quantity:
        """The time of the matrices since the epoch, () or (n,)."""
        return u.Quantity(self._times, self.system.units.time)

    def __getitem__(self, key: str | tuple[str, str]) -> Array:
        """Return the derivatives of a body by the start of another, (..., 6, 6), or by a parameter, (..., 6); of one
        name, by its own start.

        Raises UnknownNameError for unknown names, InputError for other keys.
        """
        pair = (key, key) if isinstance(key, str) else key
        if not (isinstance(pair, tuple) and len(pair) == 2):
            raise InputError(f'stm[{shown(key)}]: expected one name or two, as in stm["Mercury", "Venus"].')
        i = index_of(pair[0], self.names, "body")
        of_both = (*self.names, *self.parameters)
        j = index_of(pair[1], of_both, "body or parameter" if self.parameters else "body")
        if j >= len(self.names):
            return np.asarray(self.by_parameters[..., 6 * i : 6 * i + 6, j - len(self.names)])
        return np.asarray(self.matrix[..., 6 * i : 6 * i + 6, 6 * j : 6 * j + 6])

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        """Return the matrix, for NumPy: np.asarray(stm) @ dx."""
        return np.array(self.matrix, dtype=dtype, copy=copy)

    def _ipython_key_completions_(self) -> list[str]:
        return [*self.names, *self.parameters]

    def symplecticity_defect(self) -> Any:
        """Return the largest |M^T J M - J| of the massive bodies over |M|^2, with momenta p = dL/dv: at the
        level of round-off, 1e-16, for a symplectic method; a number, or (n,).

        In coordinates sqrt(GM) q and p tau / sqrt(GM), tau the shortest dynamical time, which give all bodies equal
        weight. Raises InputError for bodies that are read from an ephemeris.
        """
        if not self._momenta.size:
            raise InputError(
                "the massive bodies are read from an ephemeris and have no map of their own, which could be symplectic."
            )
        massive = np.flatnonzero(self.system.massive)
        tau, gm = dynamical_time(self.system), np.repeat(self.system.values.gm[massive], 3)
        n, d = 6 * len(self.names), len(gm)
        rows = np.arange(n).reshape(len(self.names), 2, 3)[massive].transpose(1, 0, 2).ravel()
        scale = np.concatenate([np.ones(d), np.full(d, tau if np.isfinite(tau) else 1.0)])
        start, *ends = (scale[:, None] * to_momenta for to_momenta in self._momenta)
        found = [
            symplecticity_defect(np.linalg.solve(start.T, (end @ M[np.ix_(rows, rows)]).T).T, np.sqrt(gm))
            for end, M in zip(ends, self.matrix.reshape(-1, n, n), strict=True)
        ]
        return np.array(found).reshape(self._times.shape)[()]

    def _caption(self) -> str:
        count = f"{self.matrix.shape[-1]} x {self.matrix.shape[-1]}"
        end = u.Quantity(self._times.ravel()[-1], self.system.units.time)
        many = f"{self._times.size} samples to " if self._times.ndim else ""
        beside = f", and by {few(self.parameters, 3)}" if self.parameters else ""
        return (
            f"state transition {count}{beside} at {many}t = {end:g}, {self.made_by}; largest derivatives by its own "
            "start"
        )

    def _shown(self) -> tuple[list[str], list[list[str]], int]:
        unit = self.system.units.time
        head = ["body", "q by q", headed("q by v", unit), headed("v by q", unit**-1), "v by v"]
        last, rows = self.matrix.reshape(-1, *self.matrix.shape[-2:])[-1], []
        for i, name in enumerate(self.names[:MOST_SHOWN]):
            own = np.abs(last[6 * i : 6 * i + 6, 6 * i : 6 * i + 6]).reshape(2, 3, 2, 3)
            rows.append([name, *(f"{own[a, :, b].max():.3g}" for a in range(2) for b in range(2))])
        return head, rows, len(self.names) - len(rows)
