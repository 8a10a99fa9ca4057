"""A state as named arrays and as HTML."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.body_names import chosen, few
from orbits.errors import with_unit
from orbits.export import MOST_ROWS, Labelled, Variable, headed, html_table
from orbits.system.model_text import to_json
from orbits.units import date_text

if TYPE_CHECKING:
    from astropy.time import Time

    from orbits.system.system import System

Floats = NDArray[np.float64]

NANOSECONDS = 9
"""Decimal digits of the seconds of an epoch, as many as astropy can write."""


def in_words(system: System) -> str:
    """Return bodies, epoch, units and what acts, as in the repr of a system, and as a campaign knows its systems."""
    particles = int(np.count_nonzero(~system.massive))
    kinds = f"{len(system) - particles} massive" + (f", {particles} massless" if particles else "")
    epoch = "no epoch" if system.epoch is None else f"epoch {date_text(system.epoch, between='T')} TDB"
    return f"{few(system.names)}; {kinds}; {epoch}; units {system.units.name}{system._acting()}"


def attributes(system: System) -> dict[str, str | float]:
    """Return the properties of a system that hold for all bodies and times, as strings and numbers."""
    known: dict[str, str | float] = {"unit_system": system.units.name, "G": system.units.G}
    known |= dated(system.epoch)
    if system.terms or system.forces:
        known["terms_and_forces"] = to_json(system)
    return {**known, "softening": system.values.softening}


def dated(epoch: Time | None) -> dict[str, str | float]:
    """Return the epoch among such properties, none without one."""
    if epoch is None:
        return {}
    moment = epoch.copy()
    moment.precision = NANOSECONDS
    return {"epoch": date_text(moment, between="T"), "time_scale": "tdb"}


def labelled_state(system: System, bodies: Sequence[str] | None) -> Labelled:
    """Return the state as named arrays."""
    pick = chosen(system.names, bodies)
    gm, q, v, _ = system.values
    units = system.units
    variables = {
        "gm": Variable(gm[pick], units.gm, ("body",)),
        "q": Variable(q[pick], units.length, ("body", "component")),
        "v": Variable(v[pick], units.speed, ("body", "component")),
    }
    if system.radii is not None:
        variables["radius"] = Variable(system.radii.value[pick], units.length, ("body",))
    return Labelled(tuple(np.array(system.names, dtype=object)[pick]), None, variables, attributes(system))


def labelled_run(
    system: System,
    times: Floats,
    q: Floats,
    v: Floats,
    bodies: Sequence[str] | None,
    known: Mapping[str, str | float],
    over: Sequence[Floats] | None = None,
) -> Labelled:
    """Return samples of a run as named arrays; `times` (n,), q and v (n, bodies, 3) in the system's units.

    over : GM and radii at each time, (n, bodies), if they change
    """
    units = system.units
    start = labelled_state(system, bodies)
    pick = chosen(system.names, None if bodies is None else start.names)  # an iterator gives its names once
    variables = {key: start.variables[key] for key in ("gm", "radius") if key in start.variables}
    if over is not None:
        changing = zip(("gm", "radius"), over, strict=True)
        variables = {
            key: Variable(x[:, pick], variables[key].unit, ("time", "body")) for key, x in changing if key in variables
        }
    variables |= {
        "q": Variable(q[:, pick], units.length, ("time", "body", "component")),
        "v": Variable(v[:, pick], units.speed, ("time", "body", "component")),
    }
    known = {**start.attributes, **known}
    return Labelled(start.names, u.Quantity(times, units.time), variables, known, system.epoch)


def span(t: u.Quantity) -> str:
    """Return the range of times of shape (n,) in words."""
    if not len(t):
        return "no samples yet"
    return with_unit(f"t = {t[0].value:g}" + (f" ... {t[-1].value:g}" if len(t) > 1 else ""), t.unit)


def state_html(system: System) -> str:
    """Return the first bodies of a system as an HTML table."""
    gm, q, v, _ = system.values
    units = system.units
    heads: list[tuple[str, Any]] = [("GM", units.gm), *((c, units.length) for c in "xyz")]
    heads += [(f"v{c}", units.speed) for c in "xyz"]
    head = ["body", *(headed(name, unit) for name, unit in heads)]
    rows = [[name, *(f"{x:.6g}" for x in (gm[i], *q[i], *v[i]))] for i, name in enumerate(system.names[:MOST_ROWS])]
    return html_table(repr(system), head, rows, len(system) - len(rows))
