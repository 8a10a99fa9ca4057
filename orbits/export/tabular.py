"""The methods of a value that can be had as a table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from orbits.export.labelled import Labelled

if TYPE_CHECKING:
    import pandas
    import xarray
    from astropy.table import QTable


class Tabular:
    """A value of several bodies, at one time or at several, that can be had as a table. Floats keep their bits.

    Each method takes `bodies`, names of those that are wanted, in that order; all by default. UnknownNameError for one
    that is not there.
    """

    __slots__ = ()

    def _labelled(self, bodies: Sequence[str] | None) -> Labelled:
        raise NotImplementedError

    def to_table(self, bodies: Sequence[str] | None = None) -> QTable:
        """Return an astropy QTable, every column with its unit.

        One row for each body, or for each time and body. Columns: time (of a run, since the epoch), body; for states
        x, y, z, vx, vy, vz, and gm, radius where there is one time; for elements their names. The meta has the epoch
        (TDB) and what else is known.
        """
        return self._labelled(bodies).table()

    def to_pandas(self, bodies: Sequence[str] | None = None) -> pandas.DataFrame:
        """Return a pandas DataFrame, indexed by body, or by time and body; columns as of `to_table`.

        Units are strings in `frame.attrs["units"]`, beside the epoch. Of a run with an epoch there is a last column
        `date`, datetime64[us] in TDB. Raises MissingPackageError without pandas.
        """
        return self._labelled(bodies).pandas()

    def to_xarray(self, bodies: Sequence[str] | None = None) -> xarray.Dataset:
        """Return an xarray Dataset over body, component (x, y, z) and, of a run, time.

        States are q and v with gm and radius, elements have their names. Units are strings in the `attrs["units"]` of
        each; the Dataset's own attrs have the epoch. Of a run with an epoch the coordinate `date`, datetime64[us] in
        TDB, lies along time: `data.swap_dims(time="date")` selects by dates. Of a run in an archive all is read when it
        is used. Raises MissingPackageError without xarray.
        """
        return self._labelled(bodies).xarray()
