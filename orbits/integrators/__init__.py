"""Integrators, one file each. Every `Integrator` is registered by being in this folder."""

from __future__ import annotations

import ast
import dataclasses
import re
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from orbits.elsewhere import method_hint
from orbits.errors import InputError, UnknownNameError, shown
from orbits.integrators.base import Integrator
from orbits.registered import registered


def registry() -> dict[str, type[Integrator]]:
    """Return every integrator of the package by its name."""
    return registered(__name__, Integrator, "name")


def describe(integrator: Integrator) -> dict[str, Any]:
    """Return {"name": ..., "parameters": {...}}, the argument of `build` for an equal integrator."""
    return {
        "name": integrator.name,
        "parameters": {k: describe(v) if isinstance(v, Integrator) else v for k, v in integrator.parameters().items()},
    }


def build(description: Mapping[str, Any]) -> Integrator:
    """Return the integrator that `describe` described. Raises UnknownNameError or InputError."""
    cls = _find(str(description.get("name")))
    parameters = description.get("parameters", {})
    values = {k: build(v) if isinstance(v, Mapping) and "name" in v else v for k, v in parameters.items()}
    try:
        return cls(**values)
    except TypeError:
        known = ", ".join(f.name for f in dataclasses.fields(cls)) or "none"
        given = ", ".join(parameters)
        raise InputError(f"{cls.name} got the parameters ({given}); it knows: {known}") from None


@lru_cache(maxsize=64)
def parse(text: str) -> Integrator:
    """Return the integrator of a text: "gauss", "gauss(stages=4)", "Composition(StormerVerlet(), order=6)".

    Words need no quotes: "wisdom-holman(kernel=lazy)".

    Raises UnknownNameError for a name that is not registered and InputError for invalid parameters.
    """
    try:
        # Names may be typed with dashes; text in quotes is a value and is not changed.
        pieces = re.split(r"""('[^']*'|"[^"]*")""", text.strip())
        pieces[::2] = [re.sub(r"(?<=[A-Za-z])-(?=\w)", "_", piece) for piece in pieces[::2]]
        read = _read(ast.parse("".join(pieces), mode="eval").body)
    except InputError:
        raise
    except (SyntaxError, ValueError, TypeError, MemoryError, RecursionError):
        read = None
    if isinstance(read, Integrator):
        return read
    raise InputError(
        f'cannot read the integrator {text!r}; write e.g. gauss, "gauss(stages=4)" or "wisdom-holman(kernel=lazy)"'
    )


def named(method: Integrator | str) -> Integrator:
    """Return a method, which may be given as a text for `parse`: "gauss", "Gauss(stages=4)".

    Raises InputError for anything else, and what `parse` raises.
    """
    if isinstance(method, str):
        return parse(method)
    if isinstance(method, Integrator):
        return method
    raise InputError(
        f'integrator must be a method such as orbits.Gauss(stages=8), or its name such as "gauss"; got {shown(method)}'
    )


def _read(node: ast.expr) -> Any:
    """Return the method of a name or call, or a plain value."""
    if isinstance(node, ast.Name):
        return build({"name": node.id})
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        kinds = {f.name: str(f.type) for f in dataclasses.fields(_find(node.func.id))}
        typed = dict(zip(kinds, node.args, strict=False))
        if len(typed) < len(node.args):
            raise ValueError(node.func.id)
        typed |= {str(k.arg): k.value for k in node.keywords}
        given = {name: _value(each, kinds.get(name, "")) for name, each in typed.items()}
        return build({"name": node.func.id, "parameters": given})
    return ast.literal_eval(node)


def _value(node: ast.expr, kind: str) -> Any:
    """Return a parameter, where a name is text if its annotation, `kind`, is."""
    if isinstance(node, ast.Name) and re.search(r"\bstr\b", kind):
        return node.id.replace("_", "-")
    return _read(node)


def _find(name: str) -> type[Integrator]:
    def key(text: str) -> str:
        return text.lower().replace("-", "").replace("_", "")

    known = registry()
    for cls in known.values():
        if key(name) in (key(cls.name), key(cls.__name__)):
            return cls
    hint = method_hint(name, known)
    raise UnknownNameError(f"no integrator is called {shown(name)}{hint} Known: {', '.join(sorted(known))}.")
