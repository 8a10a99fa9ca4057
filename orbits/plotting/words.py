"""Texts for pictures: methods, time spans, dates, and shortened names."""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import MISSING, fields
from typing import TYPE_CHECKING, Any

from astropy import units as u

from orbits.body_names import with_article
from orbits.errors import InputError
from orbits.integrators import registry
from orbits.integrators.base import Integrator
from orbits.units import date_text

if TYPE_CHECKING:
    from orbits.protocols import Run, State

SHORT_NAMES: Mapping[str, str] = {"Earth-Moon barycenter": "Earth–Moon"}
LONGEST_NAME = 28
"""Characters of a name in a legend; longer ones lose their middle, as names often differ only at their ends."""

CUSTOMARY: Mapping[str, str] = {"Gauss collocation": "Gauss", "classical Runge–Kutta": "RK4"}
"""Short names of methods in the literature."""

TIMES = ((u.s, 0.0), (u.min, 2.0), (u.h, 3.0), (u.d, 3.0), (u.yr, 3.0), (u.kyr, 10.0), (u.Myr, 1.0), (u.Gyr, 1.0))
"""Units of time, each with the shortest span given in it: an hour in minutes, a year in days, a century in years."""


def shortened(name: str) -> str:
    """Return a name shortened to at most 28 characters, keeping both ends."""
    name = SHORT_NAMES.get(name, name)
    keep = (LONGEST_NAME - 1) // 2
    return name if len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME - 1 - keep]}…{name[-keep:]}"


def literal(text: str) -> str:
    """Return a text with names as it is given to Matplotlib, which leaves labels that begin with "_" out of legends,
    and reads what is between two "$" as a formula.
    """
    return (" " * text.startswith("_") + text).replace("$", r"\$")


def short(name: str) -> str:
    """Return a name shortened for a label of a picture to at most 28 characters, keeping both ends."""
    return literal(shortened(name))


def in_prose(name: str) -> str:
    """Return a name as in a sentence: with its article, "the Sun", or shortened if it takes none."""
    own = with_article(name)
    return shortened(name) if own == name else own


def method_words(label: str) -> str:
    """Return a method's label in words: `Gauss(stages=8)` is "Gauss, 8 stages", `ExplicitEuler()` "explicit Euler".

    Labels of methods that are not registered, for example REBOUND's, are returned unchanged.
    """
    try:
        call = ast.parse(label, mode="eval").body
    except (SyntaxError, ValueError):
        return label
    known = {cls.__name__: cls for cls in registry().values()}
    if not isinstance(call, ast.Call) or not isinstance(call.func, ast.Name) or call.func.id not in known:
        return label
    cls = known[call.func.id]
    head = re.split(r"[:,(]", cls.summary)[0].strip()
    if len(head.split()) > 3:  # a sentence, not a name
        head = cls.__name__ if cls.__name__.isupper() else cls.__name__.lower()
    customary = {f.name: f.default_factory().label for f in fields(cls) if f.default_factory is not MISSING}
    orders = [str(given.value) for given in call.args if isinstance(given, ast.Constant)]
    parts = [" ".join([CUSTOMARY.get(head, head), ", ".join(orders)]).strip()]
    for given in call.keywords:
        value = given.value
        if isinstance(value, ast.Call):
            base = ast.unparse(value)
            if base != customary.get(given.arg or ""):
                parts[0] += f" of {method_words(base)}"
        elif isinstance(value, ast.Constant) and value.value is not None:
            parts.append(_parameter(given.arg or "", value.value))
    return ", ".join(parts)


def in_title(integrator: Integrator) -> str:
    """Return a method as in a title: "Wisdom–Holman", without the options that it has by default; stages are told.

    Of a run of REBOUND the label, all that is known of its method.
    """
    if not isinstance(integrator, Integrator):
        return integrator.label
    cls = type(integrator)
    with suppress(TypeError, InputError):  # methods that need arguments
        if "stages" not in integrator.parameters() and integrator == cls():
            return method_words(f"{cls.__name__}()")
    return method_words(integrator.label)


def made_by(run: Run) -> str:
    """Return method and step of a run as in a title: "Gauss, 8 stages, dt = 6 d"."""
    step = "" if math.isnan(run.step) else f", dt = {in_fitting_time(abs(run.step), run.system.units.time)}"
    return in_title(run.integrator) + step


def _parameter(name: str, value: Any) -> str:
    if isinstance(value, str):
        return value.replace("-", "–") if "drift" in value else value
    if name == "stages":
        return f"{value} stage{'' if value == 1 else 's'}"
    return f"{name} {value}"


def fitting_time(span: float, unit: Any) -> tuple[float, str]:
    """Return a factor for times, and the unit they then have, suited to a time span.

    span : in `unit`, of either sign; `unit` : an astropy unit, or its name
    Times without a unit are unchanged, or in powers of a thousand if the span is long: (0.001, "10³").
    """
    unit = u.Unit(unit)
    if unit == u.dimensionless_unscaled:
        power = next((n for n in (12, 9, 6, 3) if abs(span) >= 50 * 10.0**n), 0)
        return 10.0**-power, power_of_ten(power)
    best = [each for each, least in TIMES if abs(span) * unit.to(each) >= 0.999 * least][-1]  # allow for rounded spans
    return float(unit.to(best)), str(best)


def power_of_ten(power: int) -> str:
    """Return a power of ten as text, 10⁶; "" for 1."""
    return "10" + str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")) if power else ""


def in_fitting_time(duration: float, unit: Any) -> str:
    """Return a duration, such as a step, with four digits in a suitable unit: "6 d", "30 min"."""
    if u.Unit(unit) == u.dimensionless_unscaled:
        return f"{duration:.4g}"
    times = [each for each, _ in TIMES[:5] if abs(duration) * u.Unit(unit).to(each) >= 0.9999]
    best = times[-1] if times else u.s
    best = u.d if best == u.yr and abs(duration) * u.Unit(unit).to(u.yr) < 3 else best
    return f"{duration * u.Unit(unit).to(best):.4g} {best}"


def since(system: State, unit: str, *, backwards: bool = False) -> str:
    """Return the label of a time axis, with epoch and unit; backwards : whether it counts the time before the epoch."""
    start = " before the start" if backwards else ""
    if system.epoch is not None:
        start = f" {'before' if backwards else 'since'} {moment(system)}"
    return f"time{start} [{unit}]" if unit else f"time{start}"


def moment(system: State) -> str:
    """Return the epoch of a system to the minute, or the date for midnight: "2000-01-01 12:00 TDB"."""
    if system.epoch is None:
        return ""
    return f"{date_text(system.epoch, 16).removesuffix(' 00:00')} TDB"
