"""The `Certificate`: findings, a verdict, a table, JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from orbits.errors import InputError, shown, with_unit
from orbits.export import html_table

FORMAT = "orbits-certificate"
VERSION = 1


@dataclass(frozen=True)
class Finding:
    """One property, measured.

    name : of the property
    measured, bound : the figure and its bound, in `unit`; NaN where nothing could be measured
    holds : whether the method has the property
    declared : whether the method declares it; None for what no method needs to declare
    needed : whether a variational integrator must have it
    note : how it was measured, or why it was not
    """

    name: str
    measured: float
    bound: float
    unit: str
    holds: bool
    declared: bool | None
    needed: bool
    note: str = ""

    @property
    def verdict(self) -> str:
        """The verdict in one or two words, for the table."""
        if math.isnan(self.measured) and not self.needed:
            return "not measured"
        if self.holds:
            return "holds" if self.declared in (True, None) else "holds, undeclared"
        if self.declared:
            return "FAILS, DECLARED"
        return "fails" if self.needed else "no"


@dataclass(frozen=True, repr=False)
class Certificate:
    """The properties of one method on one problem with one step, as measured.

    problem, method : in words
    dt : the step, in the problem's unit of time (`time_unit`)
    findings : one for each property

    `certificate.ok` says whether the method is what it declares to be; `certificate.failures` lists what it is not.
    """

    problem: str
    method: str
    dt: float
    time_unit: str
    findings: tuple[Finding, ...]

    @property
    def ok(self) -> bool:
        """Whether the method was found to be a variational integrator, with all the properties it declares."""
        return not self.failures

    @property
    def failures(self) -> tuple[str, ...]:
        """The properties that a variational integrator must have, or the method declares, and that do not hold."""
        return tuple(_failure(f) for f in self.findings if not f.holds and (f.needed or f.declared))

    def __getitem__(self, name: str) -> Finding:
        for finding in self.findings:
            if finding.name == name:
                return finding
        raise InputError(
            f"the certificate has no finding {shown(name)}; it has: {', '.join(f.name for f in self.findings)}"
        )

    def table(self) -> str:
        """Return the certificate as text, one line for each property."""
        head = ("property", "measured", "bound", "", "")
        rows = [(f.name, _number(f.measured), _number(f.bound), f.unit, f.verdict) for f in self.findings]
        widths = [max(len(row[k]) for row in [head, *rows]) for k in range(5)]
        lines = [self._head(), ""]
        for row in [head, *rows]:
            cells = [row[0].ljust(widths[0]), row[1].rjust(widths[1]), row[2].rjust(widths[2])]
            lines.append("  ".join([*cells, row[3].ljust(widths[3]), row[4]]).rstrip())
        lines += ["", self._verdict()]
        lines += [f"  {failure}" for failure in self.failures]
        return "\n".join(lines)

    def __str__(self) -> str:
        return self.table()

    def __repr__(self) -> str:
        return f"Certificate({self._head()}; {self._verdict()})"

    def _repr_html_(self) -> str:
        head = ("property", "measured", "bound", "unit", "verdict")
        rows = [(f.name, _number(f.measured), _number(f.bound), f.unit, f.verdict) for f in self.findings]
        return html_table(f"{self._head()}: {self._verdict()}", head, rows)

    def _head(self) -> str:
        return f"{self.method} on {self.problem}, dt = {with_unit(f'{self.dt:.6g}', self.time_unit)}"

    def _verdict(self) -> str:
        return "a variational integrator, as declared" if self.ok else "NOT CERTIFIED"

    def to_record(self) -> dict[str, Any]:
        """Return values for JSON; a figure that could not be measured is null."""
        findings = []
        for f in self.findings:
            record = {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in asdict(f).items()}
            findings.append({**record, "verdict": f.verdict})
        return {
            "format": FORMAT,
            "version": VERSION,
            "problem": self.problem,
            "method": self.method,
            "dt": self.dt,
            "time_unit": self.time_unit,
            "ok": self.ok,
            "failures": list(self.failures),
            "findings": findings,
        }

    def to_json(self, path: str | Path | None = None) -> str:
        """Return the certificate as JSON, and write it to `path` if given. Raises InputError if that fails."""
        text = json.dumps(self.to_record(), indent=1, allow_nan=False)
        if path is not None:
            try:
                Path(path).write_text(text + "\n")
            except OSError as error:
                raise InputError(f"cannot write the certificate to {path}: {error.strerror}") from None
        return text

    @classmethod
    def from_record(cls, record: Mapping[str, Any]) -> Certificate:
        """Return the certificate that `to_record` described. Raises InputError for anything else."""
        try:
            if record["format"] != FORMAT or record["version"] != VERSION:
                raise InputError(f"expected a certificate of version {VERSION}, got {record['format']!r}")
            findings = tuple(_finding(finding) for finding in record["findings"])
            return cls(
                str(record["problem"]), str(record["method"]), float(record["dt"]), str(record["time_unit"]), findings
            )
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"this is not a certificate: {error}") from None


def _failure(f: Finding) -> str:
    declared = ", which the method declares" if f.declared else ""
    if math.isnan(f.measured):
        return f"{f.name}: {f.note}{declared}"
    if f.name.startswith("order"):
        return f"{f.name}: {f.measured:.2f}, declared {f.bound:g}"
    how = f" ({f.note})" if f.note else ""
    return f"{f.name}: {with_unit(_number(f.measured), f.unit)}, at most {_number(f.bound)} allowed{declared}{how}"


def _finding(record: Mapping[str, Any]) -> Finding:
    values = {key: value for key, value in record.items() if key != "verdict"}
    for key in ("measured", "bound"):
        values[key] = math.nan if values[key] is None else float(values[key])
    finding = Finding(**values)
    texts = (finding.name, finding.unit, finding.note)
    words = (finding.holds, finding.needed, finding.declared or False)
    if not (all(isinstance(x, str) for x in texts) and all(isinstance(x, bool) for x in words)):
        raise InputError(f"this is not a certificate: {shown(record)} is not a finding")
    return finding


def _number(x: float) -> str:
    if not math.isfinite(x):
        return "-"
    return f"{x:.2f}" if 0.05 <= abs(x) < 1000 else f"{x:.1e}"
