"""The table of an ephemeris: its columns with units, exports, and its text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.body_names import Named, chosen, few, index_of
from orbits.export import MOST_ROWS, Labelled, Tabular, Variable, html_table, text_table
from orbits.units import written

if TYPE_CHECKING:
    from astropy.coordinates import SkyCoord
    from astropy.table import QTable
    from astropy.time import Time

    from orbits.protocols import State


Array = NDArray[np.float64]

SPEED = u.km / u.s
RATE = u.arcsec / u.hour

COLUMNS: dict[str, tuple[u.UnitBase, u.UnitBase]] = {
    "ra": (u.rad, u.deg),
    "dec": (u.rad, u.deg),
    "ra_rate": (u.rad / u.day, RATE),
    "dec_rate": (u.rad / u.day, RATE),
    "apparent_ra": (u.rad, u.deg),
    "apparent_dec": (u.rad, u.deg),
    "azimuth": (u.rad, u.deg),
    "elevation": (u.rad, u.deg),
    "V": (u.mag, u.mag),
    "sun_distance": (u.au, u.au),
    "sun_range_rate": (u.au / u.day, SPEED),
    "distance": (u.au, u.au),
    "distance_rate": (u.au / u.day, SPEED),
    "range_rate": (u.au / u.day, SPEED),
    "light_time": (u.day, u.min),
    "elongation": (u.rad, u.deg),
    "trails": (u.one, u.one),
    "phase": (u.rad, u.deg),
    "sto": (u.rad, u.deg),
}
"""The columns: the unit in which they are computed, and that in which they are given."""


@dataclass(frozen=True)
class Head:
    """What is said above a table: the observer, the method of the run, and notes; utc : whether dates are in UTC."""

    observer: str
    made_by: str
    notes: tuple[str, ...]
    utc: bool


@dataclass(frozen=True, eq=False, repr=False)
class Ephemeris(Named, Tabular):
    """What an observer sees of bodies: quantities of shape (m, bodies), or (m,) of one that was asked for by name.

    names : the bodies; t : times since the epoch, (m,); epoch : a Time; head : see `Head`
    attributes : of the system of the run, for exports
    values : the columns by name; each is also an attribute, and None if it is not known for any body

    ra, dec : astrometric right ascension and declination: with light time, in the ICRF (Horizons' quantity 1)
    ra_rate, dec_rate : their rates, that of right ascension times cos(dec). (Horizons' quantity 3 has axes of date and
        projects the velocity of the body, when the light left it, less that of the observer: v/c other, up to 2e-4)
    apparent_ra, apparent_dec : with aberration and the deflection of light by the Sun; from the Earth with respect to
        its true equator and equinox of date, otherwise in the ICRF; without refraction (2)
    azimuth, elevation : of apparent places, from north through east, without refraction; from a place on the Earth (4)
    V : visual magnitude, from H and G (9)
    sun_distance, sun_range_rate : distance from the Sun, with light time, and its rate in the time of the body, when
        light left it, within 2 mm/s (19)
    distance, distance_rate : distance from the observer, c times the light time, and its rate: c d(light_time)/dt
    range_rate : the velocity of the body, when light left it, less that of the observer, along the line of sight, as
        Horizons' deldot (20). distance_rate is range_rate / (1 + w/c), w the velocity of the body along it: up to 1 m/s
        other
    light_time : of the light from the body to the observer, without its delay by the field of the Sun (21)
    elongation : the angle between the body and the Sun where they appear (23)
    trails : 1 if the body trails the Sun (evening sky), -1 if it leads it (morning sky); 0 for the Sun
    sto : the angle Sun - target - observer, as Horizons has it: from the direction in which the Sun appears from the
        body to that opposite to the apparent one of the body (24)
    phase : the same angle without aberration, which is up to 20 arcseconds; V is that of this angle

    eph["Ceres"] is the ephemeris of one body, with quantities of shape (m,); len(eph) is m.
    """

    names: tuple[str, ...]
    t: u.Quantity
    epoch: Time
    head: Head
    attributes: Mapping[str, str | float]
    values: Mapping[str, u.Quantity]

    @classmethod
    def of(
        cls,
        system: State,
        attributes: Mapping[str, str | float],
        names: tuple[str, ...],
        times: Array,
        columns: Mapping[str, Array],
        head: Head,
        *,
        single: bool,
    ) -> Ephemeris:
        """Return the ephemeris with these columns, (m, bodies), in the first unit of `COLUMNS`; those of NaN are left
        out.
        """
        values = {
            name: u.Quantity(columns[name], given).to(unit)
            for name, (given, unit) in COLUMNS.items()
            if np.isfinite(columns[name]).any() or name in ("ra", "dec", "distance")
        }
        known = {**attributes, "observer": head.observer, "method": head.made_by, "notes": "; ".join(head.notes)}
        found = cls(names, u.Quantity(times, system.units.time), system.epoch, head, known, values)
        return found[names[0]] if single else found

    def __getattr__(self, name: str) -> Any:
        """Return a column by its name, None if it is not known for any body."""
        if name in COLUMNS:
            return self.values.get(name)
        columns = ", ".join(vars(self).get("values", ()))  # copies are asked before they have any
        raise AttributeError(f"an Ephemeris has no {name!r}; its columns are {columns}")

    def __len__(self) -> int:
        """Return the number of times."""
        return len(self.t)

    def __getitem__(self, name: str) -> Ephemeris:
        """Return the ephemeris of one body, with quantities of shape (m,). Raises UnknownNameError."""
        i = index_of(name, self.names, "ephemeris of")
        values = {key: x if x.ndim == 1 else x[:, i] for key, x in self.values.items()}
        return Ephemeris((self.names[i],), self.t, self.epoch, self.head, self.attributes, values)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self.values]

    def _ipython_key_completions_(self) -> list[str]:
        return list(self.names)

    @property
    def date(self) -> Time:
        """The times of the observation, (m,), in TDB, or in UTC if they were given so; Julian years outside those of
        calendars.
        """
        dates = self.epoch + self.t
        return written((dates.utc if self.head.utc else dates).copy(format="iso"))

    def skycoord(self) -> SkyCoord:
        """Return the astrometric places as an astropy `SkyCoord`: directions, as of stars.

        The distances are in `distance`: with one, coordinates of the ICRS would be places relative to the barycentre,
        as which astropy transforms them.
        """
        from astropy.coordinates import SkyCoord

        return SkyCoord(ra=self.ra, dec=self.dec, frame="icrs")

    def to_table(self, bodies: Sequence[str] | None = None) -> QTable:
        """Return an astropy QTable with a row for each time and body, every column with its unit.

        The columns are date (a Time), time (since the epoch), body, and those of the ephemeris; its meta has the
        observer, the notes, the epoch (TDB) and further information. Unknown names raise UnknownNameError.
        """
        table = super().to_table(bodies)
        count = len(table) // max(1, len(self))
        table.add_column(self.date[np.repeat(np.arange(len(self)), count)], index=0, name="date")
        return table

    def _columns(self, bodies: Sequence[str] | None) -> dict[str, u.Quantity]:
        pick = chosen(self.names, bodies)
        return {key: x.reshape(len(self), len(self.names))[:, pick] for key, x in self.values.items()}

    def _labelled(self, bodies: Sequence[str] | None) -> Labelled:
        names = tuple(np.array(self.names, dtype=object)[chosen(self.names, bodies)])
        variables = {
            key: Variable(x.value, x.unit, ("time", "body")) for key, x in self._columns(bodies).items()
        }
        return Labelled(names, self.t, variables, self.attributes, self.epoch)

    def text(self) -> str:
        """Return all rows as text, under a head with the observer and the notes, like the tables of Horizons."""
        head, rows, _ = self._shown(len(self) * len(self.names))
        return "\n".join([self._caption(), *self.head.notes, text_table("", head, rows, words=self._words)])

    def __str__(self) -> str:
        head, rows, more = self._shown(MOST_ROWS)
        return text_table(self._caption(), head, rows, more, words=self._words)

    def __repr__(self) -> str:
        return f"Ephemeris({self._caption()})"

    def _repr_html_(self) -> str:
        head, rows, more = self._shown(MOST_ROWS)
        return html_table(self._caption(), head, rows, more, words=self._words)

    def _caption(self) -> str:
        times = f"{len(self):,} time{'s' * (len(self) != 1)}"
        return f"{few(self.names, 4)} as seen from {self.head.observer}; {times}; {self.head.made_by}"

    @property
    def _words(self) -> int:
        return 1 + (len(self.names) > 1)

    def _shown(self, most: int) -> tuple[list[str], list[list[str]], int]:
        """Return the head of a table, its first rows, and the number of others."""
        several = len(self.names) > 1
        shown = [column for column in SHOWN if all(name in self.values for name in column.names)]
        head = [f"date ({'UTC' if self.head.utc else 'TDB'})", *["body"] * several, *(column.head for column in shown)]
        count = min(most, len(self) * len(self.names))
        times = -(-count // max(1, len(self.names)))
        dates = self.date[:times]
        dates.precision = 0 if self._even(dates) else 3
        dates = dates.iso if dates.format == "iso" else [f"J{year:.6f}" for year in dates.jyear]
        columns = {key: x.reshape(len(self), len(self.names))[:times].ravel() for key, x in self.values.items()}
        rows = []
        for k in range(count):
            row, body = divmod(k, len(self.names))
            cells = [column.cell(*(columns[name].value[k] for name in column.names)) for column in shown]
            rows.append([dates[row], *[self.names[body]] * several, *cells])
        return head, rows, len(self) * len(self.names) - count

    def _even(self, dates: Time) -> bool:
        """Whether whole seconds tell the dates."""
        seconds = (dates.jd2 * 86400.0) % 1.0
        return bool((np.minimum(seconds, 1.0 - seconds) < 1e-3).all())


@dataclass(frozen=True)
class Shown:
    """One column of the text: its head, the columns it is made from, and their format."""

    head: str
    names: tuple[str, ...]
    cell: Any


def sexagesimal(ra: float, dec: float) -> str:
    """Return right ascension and declination, degrees, as text: hours to 0.001 s, degrees to 0.01 arcseconds."""
    if not np.isfinite(ra):
        return ""
    hours, degrees = round(ra / 15.0 * 3600e3) % (24 * 3600 * 1000), round(abs(dec) * 3600e2)
    h, m, s = hours // 3600000, hours // 60000 % 60, hours % 60000 / 1e3
    d, mm, ss = degrees // 360000, degrees // 6000 % 60, degrees % 6000 / 1e2
    return f"{h:02d} {m:02d} {s:06.3f} {'-' if dec < 0 else '+'}{d:02d} {mm:02d} {ss:05.2f}"


def plain(layout: str) -> Any:
    """Return a function that writes one figure, nothing for NaN."""
    return lambda x: format(x, layout) if np.isfinite(x) else ""


def side(elongation: float, trails: float) -> str:
    """Return the elongation with /T for a body that trails the Sun, /L for one that leads it."""
    if not np.isfinite(elongation):
        return ""
    return f"{elongation:.4f} {'/T' if trails > 0 else '/L' if trails < 0 else '/?'}"


SHOWN = (
    Shown("R.A. (ICRF) Dec.", ("ra", "dec"), sexagesimal),
    Shown("R.A. (apparent) Dec.", ("apparent_ra", "apparent_dec"), sexagesimal),
    Shown("azimuth [deg]", ("azimuth",), plain(".4f")),
    Shown("elevation [deg]", ("elevation",), plain(".4f")),
    Shown("V", ("V",), plain(".3f")),
    Shown("r [au]", ("sun_distance",), plain(".12f")),
    Shown("rdot [km/s]", ("sun_range_rate",), plain(".7f")),
    Shown("delta [au]", ("distance",), plain(".14f")),
    Shown("deldot [km/s]", ("range_rate",), plain(".7f")),
    Shown("light [min]", ("light_time",), plain(".8f")),
    Shown("S-O-T [deg]", ("elongation", "trails"), side),
    Shown("S-T-O [deg]", ("sto",), plain(".4f")),
)
"""The columns of the text, with the names and the digits of Horizons' tables."""
