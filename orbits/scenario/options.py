"""Options of a scenario's own: declared with a default, typed as `--set NAME=VALUE`, checked before anything is run."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from decimal import Decimal, InvalidOperation
from difflib import get_close_matches
from typing import Any

from orbits.errors import InputError, UnknownNameError, shown
from orbits.option_values import LARGEST, OPTION_NAME, is_option_value, option_text

_OF_ALL = ("dt", "duration", "integrator", "samples", "approaches")
"""What can be changed in any scenario, by options of the command line."""
_WORDS = {"yes": True, "true": True, "on": True, "no": False, "false": False, "off": False}
"""How truth values may be typed."""


@dataclass(frozen=True)
class Option:
    """An option of a scenario: a name, and a default whose type is that of all its values.

    name : lower-case letters, digits and `_`
    default : a text, a whole number, a number, or True or False
    help : one line that says what it is for
    choices : all values that it may have; for a text or number without them, any
    least, most : the smallest and the largest value of a number

    Raises InputError for a declaration that contradicts itself.

        orbits.scenarios.Option("planets", "giants", choices=("giants", "all"), help="which planets are there")
        orbits.scenarios.Option("count", 10_000, least=1, help="number of massless particles")
    """

    name: str
    default: bool | int | float | str
    _: KW_ONLY
    help: str
    choices: Sequence[Any] = ()
    least: float | None = None
    most: float | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not OPTION_NAME.fullmatch(self.name):
            raise InputError(
                f"the name of an option is {shown(self.name)}; expected lower-case letters, digits and '_', such as "
                "'count'."
            )
        what = f"option {self.name!r}"
        if self.name in _OF_ALL:
            raise InputError(f"{what}: every scenario has --{self.name}; give the option another name.")
        if not isinstance(self.help, str) or not self.help.strip() or not self.help.isprintable():
            raise InputError(f"{what}: help must be one line of text; got {shown(self.help)}.")
        if self._kind is None:
            raise InputError(
                f"{what}: its default is {shown(self.default)}; expected a text, a finite number, or True or False."
            )
        if isinstance(self.choices, str) or not isinstance(self.choices, Sequence):
            raise InputError(f"{what}: choices are {shown(self.choices)}; expected a list, such as ['giants', 'all'].")
        object.__setattr__(self, "choices", tuple(self.choices))
        from orbits.checks import finite_number, is_whole  # imports NumPy, which the start of the command line avoids

        for which in ("least", "most"):
            bound = getattr(self, which)
            if bound is not None and self._kind in ("text", "truth"):
                got = f"its default is {shown(self.default)}"
                raise InputError(f"{what}: {which} is for numbers, and {got}; leave it out.")
            if bound is not None:
                number = finite_number(bound, f"{what}: {which}")
                object.__setattr__(self, which, int(bound) if is_whole(bound) else float(number))
        choices = tuple(self.choices)
        object.__setattr__(self, "choices", ())
        object.__setattr__(self, "choices", tuple(self.checked(value) for value in choices))
        object.__setattr__(self, "default", self.checked(self.default))

    @property
    def _kind(self) -> str | None:
        """What its values are, by its default."""
        return _kind_of(self.default)

    @property
    def typed(self) -> str:
        """What may be typed, in short: "giants|all", or "NUMBER"."""
        return "|".join(map(option_text, self.choices)) or {"truth": "yes|no", "text": "TEXT"}.get(
            str(self._kind), "NUMBER"
        )

    @property
    def expected(self) -> str:
        """What its values are, in words."""
        if self.choices:
            return _listed([*map(option_text, self.choices)], "or")
        if self._kind in ("truth", "text"):
            return {"truth": "yes or no", "text": "printable text, without spaces at its ends"}[self._kind]
        kind = "a whole number" if self._kind == "whole" else "a number"
        if self.least is None or self.most is None:
            bounds = (">=", self.least), ("<=", self.most)
            return kind + "".join(f" {sign} {_typed(bound)}" for sign, bound in bounds if bound is not None)
        return f"{kind} from {_typed(self.least)} to {_typed(self.most)}"

    def record(self) -> dict[str, Any]:
        """Return the option as values for JSON."""
        bounds = {name: getattr(self, name) for name in ("least", "most") if getattr(self, name) is not None}
        choices = {"choices": list(self.choices)} if self.choices else {}
        return {"name": self.name, "default": self.default, **choices, **bounds, "help": self.help}

    def checked(self, value: Any, of: str = "") -> bool | int | float | str:
        """Return a value as Python's own. Raises InputError, naming the scenario, for one that it cannot have."""
        own = self._own(value)
        if own is not None and (not self.choices or own in self.choices):
            return own
        hint = _did_you_mean(value, map(option_text, self.choices)) if isinstance(value, str) else ""
        where = f" of {of!r}" if of else ""
        raise InputError(f"option {self.name!r}{where} is {shown(value)}; expected {self.expected}.{hint}")

    def read(self, text: str, of: str = "") -> bool | int | float | str:
        """Return the value that was typed. Raises InputError for one that the option cannot have."""
        value: Any = text.strip()
        if self._kind == "truth":
            value = _WORDS.get(value.lower(), value)
        elif self._kind in ("whole", "number"):
            value = _number(value, whole=self._kind == "whole")
        return self.checked(value, of)

    def _own(self, value: Any) -> bool | int | float | str | None:
        """Return a value as Python's own; None for one of another type, or out of bounds."""
        kind = _kind_of(value)
        if kind != self._kind and (kind, self._kind) != ("whole", "number"):
            return None
        if kind in ("truth", "text"):
            own = str(value) if kind == "text" else bool(value)
            return own if is_option_value(own) else None
        if self._kind == "number" and abs(value) > sys.float_info.max:
            return None
        number = int(value) if self._kind == "whole" else float(value)
        inside = (self.least is None or number >= self.least) and (self.most is None or number <= self.most)
        return number if inside and is_option_value(number) else None


def _typed(bound: float) -> str:
    """Return a bound as it is typed."""
    return str(int(bound)) if bound == int(bound) and abs(bound) <= LARGEST else str(bound)


def checked_options(options: Any, of: str) -> tuple[Option, ...]:
    """Return the options of a scenario. Raises InputError for what is none, and for names that occur twice."""
    listed = tuple(options) if isinstance(options, Iterable) and not isinstance(options, str) else (options,)
    for each in listed:
        if not isinstance(each, Option):
            raise InputError(
                f"scenario {of!r}: options holds {shown(each)}; expected a list such as "
                "[orbits.scenarios.Option('count', 100, help='number of particles')]."
            )
    names = [each.name for each in listed]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"scenario {of!r}: two of its options are called {name!r}; give each a name of its own.")
    return listed


def all_values(options: Sequence[Option], chosen: Any, of: str) -> dict[str, Any]:
    """Return the value of each option: the one that is chosen, or else the default.

    Raises UnknownNameError for a name that is not that of an option, with the nearest, and InputError for values that
    an option cannot have.
    """
    if not isinstance(chosen, Mapping):
        raise InputError(
            f"scenario {of!r}: chosen is {shown(chosen)}; expected the values of options by name, such as "
            "{'count': 500}."
        )
    for name in chosen:
        named(options, name, of)
    return {each.name: each.checked(chosen.get(each.name, each.default), of) for each in options}


def named(options: Sequence[Option], name: Any, of: str) -> Option:
    """Return the option of that name. Raises UnknownNameError, with the nearest name, if there is none."""
    for each in options:
        if each.name == name:
            return each
    known = [each.name for each in options]
    hint = _did_you_mean(name, known) if isinstance(name, str) else ""
    if name in _OF_ALL:
        hint = f" `orbits run` takes --{name}, without --set."
    if not known:
        raise UnknownNameError(f"{of!r} has no options of its own, and so no option {shown(name)}.{hint}")
    told = "its only option is" if len(known) == 1 else "its options are"
    raise UnknownNameError(f"{of!r} has no option {shown(name)}; {told} {_listed(known, 'and')}.{hint}")


def read_options(options: Sequence[Option], typed: Sequence[str], of: str) -> dict[str, Any]:
    """Return the values of `--set NAME=VALUE`, each as it was typed.

    Raises InputError for what is not of that form, a name given twice, and values that an option cannot have;
    UnknownNameError for a name that is not that of an option.
    """
    found: dict[str, Any] = {}
    for text in typed:
        name, equals, value = text.partition("=")
        name = name.strip()
        if not equals or not name:
            example = f"{options[0].name}={option_text(options[0].default)}" if options else "count=500"
            raise InputError(f"--set {shown(text)}: expected NAME=VALUE, such as --set {example}.")
        option = named(options, name, of)
        if name in found:
            raise InputError(f"--set {name} is given twice, the second time as {shown(value)}; give it once.")
        found[name] = option.read(value, of)
    return found


def _kind_of(value: Any) -> str | None:
    if isinstance(value, bool):
        return "truth"
    if isinstance(value, str):
        return "text" if value.isprintable() else None
    import numpy as np  # not before it is needed: the start of the command line avoids it

    from orbits.checks import is_whole

    if isinstance(value, np.bool_):
        return "truth"
    if is_whole(value):
        return "whole"
    return "number" if isinstance(value, float | np.floating) and np.isfinite(value) else None


def _number(text: str, *, whole: bool) -> Any:
    """Return the number that was typed, "1e4" as a whole one too; the text, if it is no such number."""
    try:
        if not whole:
            return float(text)
        number = Decimal(text)  # of floats, not all that are large are what was typed
        return int(number) if number.adjusted() < 20 and number == number.to_integral_value() else text
    except (ValueError, InvalidOperation, OverflowError):
        return text


def _listed(words: Sequence[str], last: str) -> str:
    """Return words with commas, and `last` before the last of them."""
    return f" {last} ".join([*([", ".join(words[:-1])] if words[1:] else []), words[-1]])


def _did_you_mean(name: str, known: Iterable[str]) -> str:
    close = get_close_matches(name.lower(), list(known), n=1, cutoff=0.5)
    return f" Did you mean {close[0]!r}?" if close else ""
