"""Functions of users: called, so that the run before them is kept if they fail; described, for files and copies."""

from __future__ import annotations

import hashlib
import pickle
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import CodeType
from typing import Any

import numpy as np

from orbits.errors import InputError

DIGITS = 16
"""The hexadecimal digits of a digest: two functions have the same by chance once in 2e19 times."""

ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")


class Raised(Exception):
    """What a function of a user raised on the way: the loop of the run keeps all before it, and raises `error` again.

    error : the exception itself
    """

    def __init__(self, error: Exception) -> None:
        super().__init__(str(error))
        self.error = error


@contextmanager
def calling(what: str) -> Iterator[None]:
    """Call a function of a user, `what` in words. Raises `Raised` with what it raises, and a note that names it."""
    try:
        yield
    except Exception as error:
        error.add_note(f"This is of {what}. The run up to there is in the exception's .trajectory.")
        raise Raised(error) from error


def description(value: Any) -> dict[str, str]:
    """Return a function or an action as archives describe it: its `name`, and a digest of its `code`.

    Equal functions have the same description in all processes with one version of Python; functions that compute
    something else have another one, except where they differ in what a digest cannot see, as in a global variable.
    """
    digest = hashlib.sha256(repr(_seen(value, ())).encode()).hexdigest()[:DIGITS]
    return {"name": named(value), "code": digest}


def in_full(value: Any) -> str:
    """Return a value as text to tell it from others, the same in all processes: all digits of all its numbers, of which
    quantities show eight; and what `description` sees of functions, where others show addresses.
    """
    with np.printoptions(floatmode="unique", threshold=sys.maxsize):
        text = repr(value)
    if ADDRESS.search(text) is None:
        return text
    return f"{ADDRESS.sub('', text)}, {description(value)['code']}"


def named(value: Any) -> str:
    """Return the name of a function, an action or an expression, the same in all processes."""
    function = getattr(value, "py_func", value)
    if hasattr(value, "free_symbols"):
        return str(value)
    name = getattr(function, "__qualname__", type(function).__qualname__)
    return name.rpartition("<locals>.")[2]


def _seen(value: Any, inside: tuple[int, ...]) -> Any:
    """Return what tells a value from others, of texts and numbers alone; inside : what it is part of."""
    if value is None or isinstance(value, bool | int | float | complex | str | bytes):
        return repr(value)
    if id(value) in inside:
        return "itself"
    inside = (*inside, id(value))
    if isinstance(value, CodeType):
        return [value.co_code.hex(), value.co_names, [_seen(x, inside) for x in value.co_consts]]
    if isinstance(value, np.ndarray):
        numbers = hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()
        return [str(value.dtype), str(getattr(value, "unit", "")), value.shape, numbers]
    if isinstance(value, tuple | list):
        return [type(value).__name__, *(_seen(x, inside) for x in value)]
    if isinstance(value, set | frozenset):
        return [type(value).__name__, *sorted(repr(_seen(x, inside)) for x in value)]
    if isinstance(value, dict):
        return [[_seen(key, inside), _seen(x, inside)] for key, x in value.items()]
    if hasattr(value, "free_symbols"):
        import sympy

        return sympy.srepr(value)
    if hasattr(value, "__func__"):  # a bound method, or one of a class as it stands there
        return [_seen(value.__func__, inside), _seen(getattr(value, "__self__", None), inside)]
    function = getattr(value, "py_func", value)  # of a compiled one
    if hasattr(function, "__code__"):
        parts = [function.__defaults__, function.__kwdefaults__, _enclosed(function)]
        return [_seen(function.__code__, inside), *(_seen(part, inside) for part in parts)]
    if hasattr(value, "func") and hasattr(value, "args"):  # functools.partial
        return [_seen(part, inside) for part in (value.func, value.args, value.keywords)]
    kind = type(value)
    code = [_seen(getattr(kind, name), inside) for name in ("__call__", "act") if hasattr(kind, name)]
    return [kind.__qualname__, code, _seen(dict(getattr(value, "__dict__", {})), inside)]


def _enclosed(function: Any) -> list[Any]:
    """Return the values of the variables that a function takes from around it."""
    found = []
    for cell in function.__closure__ or ():
        try:
            found.append(cell.cell_contents)
        except ValueError:  # not assigned yet
            found.append(None)
    return found


@dataclass(frozen=True)
class Forgotten:
    """Stands for a function that a pickle could not hold, such as a lambda: it cannot be called.

    name : of the function
    """

    name: str

    def __call__(self, *arguments: Any) -> Any:
        """Raise InputError."""
        raise InputError(f"{self.name} is not in the pickle that this event comes from; give the function again.")


def picklable(value: Any) -> Any:
    """Return a value, or `Forgotten` for a function that cannot be pickled."""
    if not callable(value):
        return value
    try:
        pickle.dumps(value)
    except Exception:  # whatever a class of a user raises
        return Forgotten(named(value))
    return value
