"""A hash of all code that can become part of a compiled kernel: code, not prose.

Numba's disk cache looks at the file of the function it compiles, not at the files of the functions called from it:
after an edit in `pair_sums.py` a loop cached from `gauss.py` would go on computing the old digits. Every cache entry is
therefore stamped with this hash. It covers the text, without docstrings and lines of comments, of

* the files that hold kernels: they import Numba, LLVM, `kernel`, `verb` or `Tag`, or write modules of kernels;
* all files of the package that these import, directly or not: compiled code freezes their constants.

What compiled code reads without importing it, the order of the fields of a record, is part of the key of an entry.
"""

from __future__ import annotations

import hashlib
import os
import re
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

PACKAGE = Path(__file__).resolve().parents[2]

KERNEL_FOLDERS = ("kernels", "lagrangians", "forces", "integrators", "marching")
"""The folders that may have files with kernels; a test checks that there are none elsewhere."""

GENERATORS = "lagrangians/symbolic/"
"""The files in this folder write modules of kernels."""

COMPILERS = ("numba", "llvmlite")
MARKS = {"orbits.kernels.compile.kernel", "orbits.kernels.compile.verbs.verb", "orbits.kernels.binding.Tag"}

COMMENTS = re.compile(r"\n[ \t]*#.*")
FOR_TYPES = re.compile(r"\nif TYPE_CHECKING:(?:\n[ \t]+.*|\n(?=\n))+")
NAME = re.compile(r"\w+")
IMPORT = re.compile(r"\n[ \t]*(?:from ([\w.]+) import (\([^)]*\)|.*)|import ([\w.]+))")


class Stamp(NamedTuple):
    """A hash in hexadecimal digits, and the files that it covers, relative to the package."""

    text: str
    covers: frozenset[str]


@lru_cache(maxsize=1)
def source_stamp() -> str:
    """Return the SHA-256 of all code of this package that compiled kernels depend on."""
    return stamp_of(PACKAGE).text


@lru_cache(maxsize=1024)
def is_covered(file: str) -> bool:
    """Whether the stamp covers a file."""
    path = Path(file).resolve()
    return path.is_relative_to(PACKAGE) and path.relative_to(PACKAGE).as_posix() in stamp_of(PACKAGE).covers


@lru_cache(maxsize=8)
def stamp_of(package: Path) -> Stamp:
    """Return the stamp of the package in a folder."""
    texts = {name: _code(package, name) for name in _candidates(package)}
    taken = {name: imports(text) for name, text in texts.items()}
    code = {name: x for name, x in texts.items() if name.startswith(GENERATORS) or holds_kernels(taken[name])}
    left, seen = [taken[name] for name in code], set[str]()
    while left:
        for module in left.pop() - seen:
            seen.add(module)
            name = _file_of(package, module)
            if name is not None and name not in code:
                code[name] = texts.get(name) or _code(package, name)
                left.append(taken.get(name) or imports(code[name]))
    total = hashlib.sha256()
    for name in sorted(code):
        total.update(f"{name}\0{code[name]}\0".encode())
    return Stamp(total.hexdigest(), frozenset(code))


def without_prose(text: str) -> str:
    """Return the text of a file without docstrings of modules, classes and functions and without lines of comments."""
    parts = text.split('"""')  # every other one is between quotes
    for k in range(1, len(parts), 2):
        before = parts[k - 1].rstrip(" r")
        if before.endswith(":\n") or not (before or k > 1):
            parts[k] = ""
    return COMMENTS.sub("", '"""'.join(parts))


def imports(text: str) -> set[str]:
    """Return the modules that a file imports, anywhere but for type checkers, and what it takes from them, which may be
    modules as well: "orbits.kernels.binding" and "orbits.kernels.binding.Tag".
    """
    found = set()
    for module, names, whole in IMPORT.findall(FOR_TYPES.sub("", f"\n{text}")):
        found |= {module or whole, *(f"{module}.{name}" for name in NAME.findall(names))}
    return found


def holds_kernels(imported: set[str]) -> bool:
    """Whether the code of a file that imports these can become part of compiled code."""
    return not MARKS.isdisjoint(imported) or any(module.startswith(COMPILERS) for module in imported)


def _candidates(package: Path) -> list[str]:
    """Return the names of the files in the folders of kernels, relative to the package."""
    found = []
    for top in KERNEL_FOLDERS:
        for folder, _, files in os.walk(package / top):
            inside = os.path.relpath(folder, package).replace(os.sep, "/")
            found += [f"{inside}/{name}" for name in files if name.endswith(".py")]
    return found


def _code(package: Path, name: str) -> str:
    with open(f"{package}/{name}", encoding="utf-8") as file:
        return without_prose(file.read())


def _file_of(package: Path, module: str) -> str | None:
    """Return the name of the file of a module, relative to the package, or None if it has none there."""
    top, *parts = module.split(".")
    stem = "/".join(parts)
    found = (x for x in (f"{stem}.py", f"{stem}/__init__.py") if os.path.isfile(f"{package}/{x}"))
    return next(found, None) if top == package.name and stem else None
