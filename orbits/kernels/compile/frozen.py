"""What compiled code freezes of functions of users: their code, and the values that they read from around them.

The stamp of `source_hash.py` covers this package alone. Everything else that goes into compiled code is hashed here: it
is in the names of tags and in the keys of the cache, so that code for other values is never taken for the right one.
"""

from __future__ import annotations

import dis
import hashlib
from collections.abc import Mapping, Sequence
from functools import lru_cache
from types import CodeType, FunctionType, ModuleType
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from orbits.errors import InputError

GENERATED = "orbits_lagrangian_"
"""How the names of generated modules begin, which go on with a hash of the Lagrangian."""

_FIRST: WeakKeyDictionary[Any, str] = WeakKeyDictionary()
"""What each kernel froze when it was first asked."""


def frozen(function: Any) -> str:
    """Return a hash of all that the compiled code of a function freezes, "" for what is of this package alone."""
    parts: list[str] = []
    _add(parts, function, set())
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:16] if parts else ""


def frozen_of(kernels: Mapping[str, Any]) -> str:
    """Return a hash of what kernels and constants by name freeze, "" for those of this package.

    Raises InputError if it is no longer what it was when the kernels were first used: their code has it already.
    """
    found = {name: frozen(kernel) for name, kernel in kernels.items() if hasattr(kernel, "py_func")}
    for name, now in found.items():
        if _FIRST.setdefault(kernels[name], now) != now:
            raise InputError(
                f"the kernel {name} reads a variable of its module, or of another one, that has changed since it was "
                "first used; compiled code keeps the first value. Make it one of the parameters, or define the kernel "
                "again."
            )
    if not any(found.values()):
        return ""
    return hashlib.sha256(f"{listed(kernels)}{sorted(found.items())}".encode()).hexdigest()[:16]


def listed(kernels: Mapping[str, Any]) -> str:
    """Return kernels by their names and where they are, and constants, as text that tells them from all others of this
    package.
    """
    where = {
        name: f"{kernel.__module__}.{kernel.__qualname__}" if hasattr(kernel, "py_func") else repr(kernel)
        for name, kernel in kernels.items()
    }
    return "\n".join(f"{name}: {place}" for name, place in sorted(where.items()))


def _function_of(value: Any) -> Any:
    """Return the function of a kernel, or of what else Numba compiles; anything else as it is."""
    value = getattr(value, "_dispatcher", value)  # of numba.vectorize
    return getattr(value, "py_func", getattr(value, "_pyfunc", value))


def _add(parts: list[str], value: Any, seen: set[int]) -> None:
    """Add what tells a value from others; of a function, its instructions and all that they read."""
    value = _function_of(value)
    if isinstance(value, FunctionType):
        if id(value) not in seen:
            seen.add(id(value))
            _add_function(parts, value, seen)
    elif isinstance(value, np.ndarray):
        parts.append(f"{value.dtype}{value.shape}{hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()}")
    elif isinstance(value, tuple):
        parts.append(f"{len(value)} of {type(value).__name__}")
        for each in value:
            _add(parts, each, seen)
    elif isinstance(value, float):  # NumPy's float64 is one
        parts.append(repr(float(value)))
    else:
        shown = repr(value)
        parts.append(type(value).__qualname__ if " at 0x" in shown else shown)


def _add_function(parts: list[str], function: FunctionType, seen: set[int]) -> None:
    around = [cell.cell_contents for cell in function.__closure__ or ()]
    if _is_own(function.__module__):
        if parts:  # read by a function of a user, perhaps under another name
            parts.append(f"{function.__module__}.{function.__qualname__}")
        for each in around:  # a function of this package made from one of a user
            if isinstance(_function_of(each), FunctionType):
                _add(parts, each, seen)
        return
    parts += [function.__qualname__, instructions(function.__code__)]
    for each in (*around, function.__defaults__ or ()):
        _add(parts, each, seen)
    globals_read, attributes = _names(function.__code__)
    _add_named(parts, function.__globals__, globals_read, attributes, seen)


def _add_named(
    parts: list[str], there: Mapping[str, Any], names: Sequence[str], attributes: Sequence[str], seen: set[int]
) -> None:
    """Add what stands under some names; of a module, its name and what is read of it: settings.K, consts.settings.K."""
    for name in names:
        value = there.get(name)
        if isinstance(value, ModuleType):
            parts.append(value.__name__)
            if id(value) not in seen and not _is_own(value.__name__):
                seen.add(id(value))
                _add_named(parts, vars(value), attributes, attributes, seen)
        elif name in there:
            _add(parts, value, seen)


def _is_own(module: str | None) -> bool:
    """Whether a module is of this package, or generated by it."""
    return (module or "").partition(".")[0] == __name__.partition(".")[0] or (module or "").startswith(GENERATED)


@lru_cache(maxsize=1024)
def _names(code: CodeType) -> tuple[list[str], list[str]]:
    """Return the names of globals, and of attributes, that a function and those within it read."""
    found: tuple[set[str], set[str]] = set(), set()
    for step in dis.get_instructions(code):
        if step.opname in ("LOAD_GLOBAL", "LOAD_NAME"):
            found[0].add(step.argval)
        elif step.opname in ("LOAD_ATTR", "LOAD_METHOD"):
            found[1].add(step.argval)
        elif isinstance(step.argval, CodeType):
            for mine, inner in zip(found, _names(step.argval), strict=True):
                mine.update(inner)
    return sorted(found[0]), sorted(found[1])


@lru_cache(maxsize=1024)
def instructions(code: CodeType) -> str:
    """Return the instructions of a function as text, without docstring, comments and line numbers."""
    parts = [repr((code.co_varnames, code.co_argcount))]
    for step in dis.get_instructions(code):
        shown = step.argrepr
        if isinstance(step.argval, CodeType):
            shown = instructions(step.argval)
        elif isinstance(step.argval, frozenset):  # in another order in each process
            shown = repr(sorted(step.argval, key=repr))
        parts.append(f"{step.opname} {shown}")
    return "\n".join(parts)
