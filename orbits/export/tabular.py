"""The export methods of values that can be converted to tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from orbits.export.labelled import Labelled

if TYPE_CHECKING:
    import pandas
    import xarray
    from astropy.table import QTable


class Tabular:
    """A value of several bodies, at one or several times, that can be converted to a table, with the same floats.

    Each method takes `bodies`, the names of the bodies to include, in that order; all by default. Unknown names raise
    UnknownNameError.
    """

    __slots__ = ()

    def _labelled(self, bodies: Sequence[str] | None) -> Labelled:
        raise NotImplementedError

    def to_table(self, bodies: Sequence[str] | None = None) -> QTable:
        """Return an astropy QTable, every column with its unit.

        It has one row for each body, or for each time and body. The columns are time (of a run, since the epoch) and
        body; for states x, y, z, vx, vy, vz, and for a single time gm and radius; for elements their names. The meta
        has the epoch (TDB) and further information.
        """
        return self._labelled(bodies).table()

    def to_pandas(self, bodies: Sequence[str] | None = None) -> pandas.DataFrame:
        """Return a pandas DataFrame with the columns of `to_table`, indexed by body, or by time and body.

        Units are strings in `frame.attrs["units"]`, beside the epoch. A run with an epoch has a last column `date`,
        datetime64[us] in TDB. Raises MissingPackageError without pandas.
        """
        return self._labelled(bodies).pandas()

    def to_xarray(self, bodies: Sequence[str] | None = None) -> xarray.Dataset:
        """Return an xarray Dataset over body, component (x, y, z) and, for a run, time.

        States are q and v with gm and radius; elements have their names. Units are strings in the `attrs["units"]` of
        each variable, and the epoch is in the attrs of the Dataset. A run with an epoch has a coordinate `date` along
        time, datetime64[us] in TDB: `data.swap_dims(time="date")` selects by date. A run in an archive is read
        completely. Raises MissingPackageError without xarray.
        """
        return self._labelled(bodies).xarray()
