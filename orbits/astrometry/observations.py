"""A set of observations: read from a file, with all that was not used and why."""

from __future__ import annotations

import gzip
import re
import zlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from astropy import units as u
from astropy.time import Time
from numpy.typing import NDArray

from orbits.astrometry import ades, jpl_radar, mpc80, weights
from orbits.astrometry.record import OPTICAL, Ignored, Record
from orbits.body_names import few
from orbits.errors import InputError, OutOfRangeError, UnknownNameError, counted, shown
from orbits.observing.clocks import dynamical
from orbits.resources import data_path

if TYPE_CHECKING:
    from astropy.table import QTable

Array = NDArray[np.float64]


BUNDLED = ("apophis", "bennu")
GZIP = b"\x1f\x8b"
"""The first bytes of a compressed file."""


@dataclass(frozen=True, eq=False, repr=False)
class Observations:
    """Observations of small bodies: optical astrometry, and radar delays and Doppler shifts.

        observations = orbits.Observations.read("99942.dat")
        print(observations, observations.ignored[:3])

    records : one for each observation, see `orbits.astrometry.record.Record`
    ignored : lines that are not used, each with its number, the reason, and its text
    source : where they are from, in words

    len() is their number; observations[mask] and observations.of("609631") are some of them, one + other all of both.
    An observation that is there twice, to all digits, counts once; the copy is among the ignored.
    """

    records: tuple[Record, ...]
    ignored: tuple[Ignored, ...] = ()
    source: str = field(default="", kw_only=True)

    @classmethod
    def read(cls, path: str | Path) -> Self:
        """Return the observations in a file, of 80 columns, ADES (PSV, commas or XML), or of radar as JPL's text or
        JSON, as its content tells; it may be compressed (gzip).

        Raises InputError for a file that cannot be read, or that has no line with an observation: the message has the
        first reason. All other lines that cannot be used are in `ignored`.
        """
        try:
            data = Path(path).read_bytes()
            data = gzip.decompress(data) if data.startswith(GZIP) else data
        except (OSError, EOFError, zlib.error, ValueError, TypeError) as error:
            raise InputError(f"the observations in {shown(path)} cannot be read: {error}") from None
        return cls.parse(_decoded(data, Path(path).name), source=Path(path).name)

    @classmethod
    def bundled(cls, name: str) -> Self:
        """Return the observations of "apophis" or "bennu" that come with the package, optical and of radar.

        Raises UnknownNameError for another name.
        """
        if name not in BUNDLED:
            known = ", ".join(BUNDLED)
            raise UnknownNameError(f"no observations of {shown(name)} are bundled; expected one of {known}.")
        return cls.read(data_path(f"{name}_optical.obs80.gz")) + cls.read(data_path(f"{name}_radar.txt"))

    @classmethod
    def parse(cls, text: str, *, source: str = "text") -> Self:
        """Return the observations in a text, as `read` does for a file. Raises InputError if there are none."""
        if not isinstance(text, str):
            raise InputError(f"the text of observations is {shown(text)}; expected a str.")
        text = text.removeprefix("\ufeff")
        lines = text.replace("\r\n", "\n").split("\n")
        found = list(
            ades.read_xml(text)
            if text.lstrip().startswith("<")
            else ades.read_psv(lines)
            if any(ades.is_heading(line) for line in lines)
            else jpl_radar.read(jpl_radar.lines_of(text))
            if text.lstrip().startswith("{")
            else jpl_radar.read(lines)
            if any(jpl_radar.is_row(line) for line in lines)
            else mpc80.read(lines)
        )
        records, copies = _without_copies([one for one in found if isinstance(one, Record)])
        ignored = (*(one for one in found if isinstance(one, Ignored)), *copies)
        if not records:
            why = f"line {ignored[0].line}: {ignored[0].reason}" if ignored else "it is empty"
            raise InputError(
                f"there is no observation in {source}: {why}; expected the MPC's 80 columns, ADES as PSV or "
                "XML, or JPL's radar astrometry."
            )
        return cls(records, ignored, source=source)

    def __len__(self) -> int:
        return len(self.records)

    def __getitem__(self, rows: Any) -> Self:
        """Return some of them, by a slice, numbers or a mask. Raises OutOfRangeError for anything else."""
        try:
            picked = np.atleast_1d(np.arange(len(self))[rows])
            if picked.ndim > 1:
                raise ValueError(f"rows of shape {picked.shape}")
        except (IndexError, TypeError, ValueError) as error:
            expected = "expected a slice, numbers or a mask; of one body they are observations.of(name)."
            raise OutOfRangeError(f"observations[{shown(rows)}]: {error}; {expected}") from None
        return type(self)(tuple(self.records[k] for k in picked.tolist()), self.ignored, source=self.source)

    def of(self, body: str) -> Self:
        """Return those of one body. Raises InputError if there are none."""
        rows = [k for k, one in enumerate(self.records) if one.body == body]
        if not rows:
            raise InputError(f"{self.source} has no observation of {shown(body)}; it has some of {few(self.bodies)}.")
        return self[np.array(rows)]

    def __add__(self, other: Observations) -> Self:
        """Return these and others; copies of these are ignored. Raises InputError for anything but observations."""
        if not isinstance(other, Observations):
            raise InputError(f"{shown(other)} is added to observations; expected orbits.Observations.")
        records, copies = _without_copies([*self.records, *other.records])
        return type(self)(records, self.ignored + other.ignored + copies, source=f"{self.source} + {other.source}")

    @property
    def bodies(self) -> tuple[str, ...]:
        """The numbers or designations of the bodies, the most observed one first."""
        return tuple(name for name, _ in Counter(one.body for one in self.records).most_common())

    @property
    def kind(self) -> NDArray[np.str_]:
        """"optical", "delay" or "doppler", (m,)."""
        return np.array([one.kind for one in self.records])

    @property
    def station(self) -> NDArray[np.str_]:
        """The codes of the observatories, (m,)."""
        return np.array([one.station for one in self.records])

    @cached_property
    def time(self) -> Time:
        """The times, (m,), in TDB; those of radar are of the reception."""
        jd, part = np.array([(one.jd, one.part) for one in self.records]).reshape(-1, 2).T
        return dynamical(jd, part)

    @property
    def ra(self) -> u.Quantity:
        """Right ascension, (m,), J2000/ICRF, astrometric; NaN for radar."""
        return u.Quantity([one.ra for one in self.records], u.deg)

    @property
    def dec(self) -> u.Quantity:
        """Declination, (m,)."""
        return u.Quantity([one.dec for one in self.records], u.deg)

    @cached_property
    def sigma(self) -> u.Quantity:
        """Uncertainties of right ascension, times cos(dec), and of declination, (m, 2): those given, and otherwise
        those of Vereš et al. (2017) by station, date, catalogue and technique, which grow as sqrt(N / 4) for N > 4
        observations from one station in a night; NaN for radar.
        """
        out = np.full((len(self), 2), np.nan)
        optical = self.kind == OPTICAL
        out[optical] = weights.sigmas([one for one in self.records if one.kind == OPTICAL])
        return u.Quantity(out, u.arcsec)

    def to_table(self) -> QTable:
        """Return an astropy QTable with a row for each observation; dates are TDB."""
        from astropy.table import QTable

        columns: dict[str, Any] = {name: [getattr(one, name) for one in self.records] for name in ("line", "body")}
        columns["date"] = Time(self.time, format="iso", precision=0)
        columns |= {"kind": self.kind, "station": self.station, "ra": self.ra, "dec": self.dec}
        columns |= {"sigma_ra": self.sigma[:, 0], "sigma_dec": self.sigma[:, 1]}
        for name in ("value", "catalogue", "mode", "notes", "mag", "band"):
            columns[name] = [getattr(one, name) for one in self.records]
        return QTable(columns, meta={"source": self.source})

    def __repr__(self) -> str:
        if not self.records:
            return f"Observations(none, from {self.source})"
        days = self.time.isot
        kinds = ", ".join(f"{count:,} {kind}" for kind, count in Counter(self.kind.tolist()).most_common())
        stations = counted(len(set(self.station.tolist())), "station")
        order = np.argsort(self.time.jd)
        span = f"{days[order[0]][:10]} to {days[order[-1]][:10]}"
        more = f"; {counted(len(self.ignored), 'line')} ignored" if self.ignored else ""
        return f"Observations({kinds} of {few(self.bodies)}, {stations}, {span}, from {self.source}{more})"


def _decoded(data: bytes, source: str) -> str:
    """Return the text of a file: in the encoding that XML declares, otherwise in UTF-8."""
    declared = re.match(rb"""\s*<\?xml[^>]*?\sencoding\s*=\s*["']([A-Za-z0-9._-]+)["']""", data)
    encoding = declared[1].decode() if declared else "utf-8-sig"
    try:
        return data.decode(encoding, errors="replace")
    except LookupError:
        raise InputError(f"{source} declares the encoding {encoding!r}, which is not known; expected UTF-8.") from None


def _without_copies(records: Sequence[Record]) -> tuple[tuple[Record, ...], tuple[Ignored, ...]]:
    """Return the observations, each once, and those that are copies of others."""
    first: dict[tuple[Any, ...], Record] = {}
    copies: list[Ignored] = []
    for one in records:
        measured = one.value if one.kind != OPTICAL else (one.ra, one.dec)
        key = (*one[1:7], one.transmitter, measured)
        if key not in first:
            first[key] = one
        else:
            what = f"{one.body} at JD {one.jd + one.part:.6f} from {one.station}"
            copies.append(Ignored(one.line, f"a copy of the observation in line {first[key].line}", what))
    return tuple(first.values()), tuple(copies)
