"""The names that the API reference documents: those in `__all__`, and those that pages of the documentation import.

A name of `orbits.__all__` belongs to the page of the namespace that has it, too, such as `orbits.methods`, or else of
the module that it comes from; every other public package has a page for its own `__all__`. What a page of the
documentation imports is documented too, and so is the base of a documented class that has public names of its own.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import Any

import orbits

DOCS = Path(__file__).resolve().parents[1]
IMPORT = re.compile(r"^from (orbits[\w.]*) import (.+)$", re.MULTILINE)


@dataclass(frozen=True)
class Entry:
    """One documented object: where it is imported from, its name there, itself, and the page it stands on."""

    module: str
    name: str
    value: Any
    page: str

    @property
    def full_name(self) -> str:
        """The name by which it is imported."""
        return f"{self.module}.{self.name}"

    @property
    def kind(self) -> str:
        """One of class, exception, function, compiled, data."""
        if inspect.isclass(self.value):
            return "exception" if issubclass(self.value, BaseException) else "class"
        if inspect.isfunction(self.value):
            return "function"
        return "compiled" if callable(self.value) and inspect.getdoc(self.value) else "data"

    @property
    def doc(self) -> str:
        """The docstring of the object; of a constant the text below its assignment."""
        return attribute_doc(self) if self.kind == "data" else inspect.getdoc(self.value) or ""

    @property
    def summary(self) -> str:
        """The first sentence."""
        return self.doc.strip().split("\n\n")[0].replace("\n", " ")


@lru_cache(maxsize=1)
def documented() -> tuple[Entry, ...]:
    """Return every entry, once, in the order of the pages."""
    found: dict[int | str, Entry] = {}

    def take(module: str, name: str, value: Any) -> None:
        if isinstance(value, ModuleType):
            for each, member in vars(value).items():
                if not each.startswith("_") and getattr(member, "__module__", None) == value.__name__:
                    take(value.__name__, each, member)
            return
        key = id(value) if callable(value) else f"{module}.{name}"
        page = home if module == "orbits" else ".".join(module.split(".")[:2])
        found.setdefault(key, Entry(module, name, value, page))

    spaces = {space: importlib.import_module(f"orbits.{space}").__all__ for space in orbits._SPACES}
    for name in orbits.__all__:
        space = next((space for space, names in spaces.items() if name in names), None)
        home = f"orbits.{space or orbits._MODULE_OF.get(name, '_version').split('.')[0]}"
        if not name.startswith("_"):
            take("orbits", name, getattr(orbits, name))
    for module in sorted(packages(), key=lambda module: module.__name__.removeprefix("orbits.") not in spaces):
        for name in getattr(module, "__all__", ()):
            value = getattr(module, name)
            if not isinstance(value, ModuleType):
                take(module.__name__, name, value)
    for module_name, name in imported_by_pages():
        module = importlib.import_module(module_name)
        take(module_name, name, getattr(module, name))
    for entry in list(found.values()):
        for base in entry.value.__mro__ if inspect.isclass(entry.value) else ():
            if base.__module__.startswith("orbits.") and not all(name.startswith("_") for name in vars(base)):
                take(base.__module__, base.__name__, base)
    return tuple(sorted(found.values(), key=lambda entry: (entry.page, entry.module != "orbits", entry.module)))


def public_name(value: Any) -> str:
    """Return the name by which a documented object is imported."""
    return next(entry.full_name for entry in documented() if entry.value is value)


def packages() -> Iterator[ModuleType]:
    """Yield the modules right below `orbits`, and all packages below them."""
    for found in pkgutil.walk_packages(orbits.__path__, "orbits."):
        if (found.ispkg or found.name.count(".") == 1) and "._" not in found.name:
            yield importlib.import_module(found.name)


def imported_by_pages() -> Iterator[tuple[str, str]]:
    """Yield (module, name) of all that the pages import from this package."""
    for page in pages_written():
        for module, names in IMPORT.findall(page.read_text(encoding="utf-8")):
            yield from ((module, name.split()[0]) for name in names.split(", "))


def pages_written() -> list[Path]:
    """Return the Markdown pages that people write, in alphabetic order."""
    return sorted(page for page in DOCS.rglob("*.md") if not {"_generated", "api"} & set(page.parts))


def attribute_doc(entry: Entry) -> str:
    """Return the string that follows the assignment of a constant, or of several, in the module that assigns it."""
    start = f"orbits.{orbits._MODULE_OF[entry.name]}" if entry.module == "orbits" else entry.module
    package = importlib.import_module(start)
    inside = [m.name for m in pkgutil.iter_modules(getattr(package, "__path__", ()))]
    for module in [package, *(importlib.import_module(f"{start}.{name}") for name in inside)]:
        body = ast.parse(inspect.getsource(module)).body
        for statement, following in pairwise(body):
            targets = getattr(statement, "targets", [getattr(statement, "target", None)])
            single = [name for target in targets for name in getattr(target, "elts", [target])]
            named = entry.name in [getattr(name, "id", None) for name in single]
            if named and isinstance(following, ast.Expr) and isinstance(following.value, ast.Constant):
                return inspect.cleandoc(str(following.value.value))
    return ""
