"""A hash of all code that can become part of a compiled kernel: code, not prose.

Numba's disk cache looks at the file of the function it compiles, not at the files of the functions called from it:
after an edit in `pair_sums.py` a loop cached from `gauss.py` would go on computing the old digits. Every cache entry is
therefore stamped with this hash. It covers syntax trees, without docstrings, comments and formatting, of

* the files that hold kernels: they import Numba, LLVM, `kernel`, `verb` or `Tag`, or write modules of kernels;
* values that these files import from other files of the package and that compiled code freezes: constants, members of
  enumerations, and their parts;
* NamedTuples, whose fields compiled code accesses by position.

Parsing takes a few tenths of a second, so the hash is stored in a small file together with a hash of the bytes that it
was computed from; later processes compare the bytes.
"""

from __future__ import annotations

import ast
import contextlib
import hashlib
import json
import os
from collections.abc import Iterator
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from orbits.kernels.compile import trusted_files
from orbits.kernels.compile.garbage import garbage_left

PACKAGE = Path(__file__).resolve().parents[2]

KERNEL_FOLDERS = ("kernels", "lagrangians", "forces", "integrators", "marching")
"""The folders that may have files with kernels; a test checks that there are none elsewhere."""

GENERATORS = "lagrangians/symbolic/"
"""The files in this folder write modules of kernels."""

COMPILERS = frozenset({"numba", "llvmlite"})
VERB = ("orbits.kernels.compile.verbs", "verb")
GENERATING = {VERB, ("numba.extending", "overload"), ("numba.extending", "intrinsic"), ("llvmlite", "ir")}
MARKS = {VERB, ("orbits.kernels.compile", "kernel"), ("orbits.kernels.binding", "Tag")}
FROZEN_CLASSES = ("NamedTuple", "namedtuple", "Enum", "Flag")
"""Endings of the names of base classes whose subclasses compiled code looks into."""


class Stamp(NamedTuple):
    """A hash in hexadecimal digits, and the files whose kernels it covers, relative to the package."""

    text: str
    covers: frozenset[str]


@lru_cache(maxsize=1)
def source_stamp() -> str:
    """Return the SHA-256 of all code of this package that compiled kernels depend on."""
    return stamp_of(PACKAGE).text


@lru_cache(maxsize=1024)
def is_covered(file: str) -> bool:
    """Whether the stamp covers the kernels in a file."""
    path = Path(file).resolve()
    return path.is_relative_to(PACKAGE) and path.relative_to(PACKAGE).as_posix() in stamp_of(PACKAGE).covers


@lru_cache(maxsize=8)
def stamp_of(package: Path) -> Stamp:
    """Return the stamp of the package in a folder, from the stored file or else from its syntax trees."""
    own = hashlib.sha256()
    for name in _own(package):
        _add_file(own, package, name)
    place = trusted_files.user_folder("sources") / f"{hashlib.sha256(str(package).encode()).hexdigest()[:32]}.json"
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError, trusted_files.DistrustedError):
        kept = json.loads(trusted_files.read(place))
        if kept["bytes"] == _with_others(own, package, kept["others"]):
            return Stamp(str(kept["stamp"]), frozenset(kept["covers"]))
    with garbage_left():  # a million nodes, all of which are needed
        code = Code(package)
        text = code.digest()
    others = sorted(code.read.difference(_own(package)))
    seen = _with_others(own, package, others)
    kept = {"bytes": seen, "others": others, "stamp": text, "covers": sorted(code.kernels)}
    with contextlib.suppress(OSError):
        trusted_files.write(place, json.dumps(kept).encode())
    return Stamp(text, frozenset(code.kernels))


def _own(package: Path) -> list[str]:
    """Return the names of the files in the folders of kernels, relative to the package, in order."""
    found = []
    for top in KERNEL_FOLDERS:
        for folder, _, files in os.walk(package / top):
            inside = os.path.relpath(folder, package).replace(os.sep, "/")
            found += [f"{inside}/{name}" for name in files if name.endswith(".py")]
    return sorted(found)


def _add_file(total: hashlib._Hash, package: Path, name: str) -> None:
    with open(f"{package}/{name}", "rb") as file:
        data = file.read()
    total.update(f"{name} {len(data)}\n".encode() + data)


def _with_others(own: hashlib._Hash, package: Path, others: list[str]) -> str:
    """Return the hash of the bytes of all files in the folders of kernels, and of some others."""
    total = own.copy()
    for name in others:
        _add_file(total, package, name)
    return total.hexdigest()


class Code:
    """The code of a package that its kernels depend on.

    kernels : files that hold kernels, relative to the package; read : all files that were parsed for it
    """

    def __init__(self, package: Path) -> None:
        self.package, self.read = package, set[str]()
        self._files: dict[str, File] = {}
        self._found: dict[tuple[str, str], str | None] = {}
        files = _own(package)
        self.kernels = {name for name in files if name.startswith(GENERATORS) or self.file(name).holds_kernels}
        self._taken = {origin for name in self.kernels for origin in self.file(name).imports.values()}
        self._parts: dict[tuple[str, int], bytes] = {}

    def file(self, name: str) -> File:
        """Return a file by its name relative to the package."""
        if name not in self._files:
            self.read.add(name)
            module = ["orbits", *name.removesuffix(".py").removesuffix("/__init__").split("/")]
            package = module if name.endswith("__init__.py") else module[:-1]
            self._files[name] = File((self.package / name).read_bytes(), package)
        return self._files[name]

    def digest(self) -> str:
        """Return the SHA-256 of all this code."""
        for name in _own(self.package):
            if name in self.kernels:
                self._follow(name, self.file(name))
            else:  # the type of an argument is used without being named
                records = [node for node in self.file(name).tree.body if isinstance(node, ast.ClassDef)]
                self._parts |= {(name, node.lineno): shape(node).encode() for node in records if _is_frozen(node)}
        total = hashlib.sha256()
        for name in sorted(self.kernels):
            total.update(f"{name}\0{shape(self.file(name).tree)}\0".encode())
        for (name, _), part in sorted(self._parts.items()):
            total.update(name.encode() + b"\0" + part + b"\0")
        return total.hexdigest()

    def _follow(self, name: str, file: File) -> None:
        """Add the definitions that a file with kernels takes from files without."""
        used = _names(file.tree)
        # The results of functions that run on import, or that generate code, are frozen.
        generates = not GENERATING.isdisjoint(file.imports.values())
        module = f"orbits.{name.removesuffix('.py').removesuffix('/__init__').replace('/', '.')}"
        taken = {local for origin, local in self._taken if origin == module}
        runs = used if generates else file.names_used_on_import(taken)
        for local in sorted(used & file.imports.keys()):
            self._add(*file.imports[local], wanted=local in runs)

    def _add(self, module: str, name: str, *, wanted: bool) -> None:
        """Add the definition of a name in a module, with its parts.

        wanted : also if it is a function or an ordinary class
        """
        found = self._find(module, name)
        if found is None or found in self.kernels:
            return
        file = self.file(found)
        if not name or found != self._find(module, ""):  # a module as a whole
            module = f"{module}.{name}".rstrip(".")
            statements = [node for node in file.tree.body if wanted or _is_frozen(node)]
        elif name in file.imports:  # imported from elsewhere
            self._add(*file.imports[name], wanted=wanted)
            return
        else:
            statements = [node for node in file.definitions.get(name, ()) if wanted or _is_frozen(node)]
        for node in statements:
            key = (found, node.lineno)
            if key in self._parts:
                continue
            self._parts[key] = shape(node).encode()
            called = {name for call in ast.walk(node) if isinstance(call, ast.Call) for name in _names(call.func)}
            for used in sorted(_names(node)):
                if used in file.definitions:
                    self._add(module, used, wanted=used in called)
                elif used in file.imports:
                    self._add(*file.imports[used], wanted=used in called)

    def _find(self, module: str, name: str) -> str | None:
        """Return the file of a module of the package, or None for a module of another package."""
        if (module, name) not in self._found:
            self._found[module, name] = self._look_for(module, name)
        return self._found[module, name]

    def _look_for(self, module: str, name: str) -> str | None:
        parts = module.split(".")
        if parts[0] != "orbits":
            return None
        stem = "/".join(parts[1:])
        candidates = [f"{stem}.py", f"{stem}/__init__.py"]
        if name:
            candidates = [f"{stem}/{name}.py", f"{stem}/{name}/__init__.py", *candidates]
        return next((x for x in (x.lstrip("/") for x in candidates) if (self.package / x).is_file()), None)


class File:
    """A syntax tree, without prose, and the origins of its names.

    package : the names of the package that contains it
    """

    def __init__(self, source: bytes, package: list[str]) -> None:
        self.tree = ast.parse(source)
        self.package = package

    @cached_property
    def imports(self) -> dict[str, tuple[str, str]]:
        """The module and name of each imported local name, anywhere in the file; for a module, the name is ""."""
        found: dict[str, tuple[str, str]] = {}
        for node in _statements(self.tree.body):
            if isinstance(node, ast.Import):
                for alias in node.names:
                    top = alias.name if alias.asname else alias.name.partition(".")[0]
                    found[alias.asname or top] = (top, "")
            elif isinstance(node, ast.ImportFrom):
                base = self.package[: len(self.package) + 1 - node.level] if node.level else []
                module = ".".join([*base, *([node.module] if node.module else [])])
                for alias in node.names:
                    found[alias.asname or alias.name] = (module, alias.name)
        return found

    @cached_property
    def definitions(self) -> dict[str, list[ast.stmt]]:
        """The statements of the module that bind each name."""
        found: dict[str, list[ast.stmt]] = {}
        for node in self.tree.body:
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                found.setdefault(node.name, []).append(node)
            elif not isinstance(node, ast.Import | ast.ImportFrom):
                for name in _names(node, ast.Store):
                    found.setdefault(name, []).append(node)
        return found

    @property
    def holds_kernels(self) -> bool:
        """Whether its code can become part of compiled code."""
        origins = set(self.imports.values())
        return not MARKS.isdisjoint(origins) or any(module.partition(".")[0] in COMPILERS for module, _ in origins)

    def names_used_on_import(self, taken: set[str]) -> set[str]:
        """Return the names that are read while the module is imported, for definitions used by kernels.

        taken : names that other files with kernels import from this one
        """
        parts: list[ast.AST] = []
        functions = [node for node in self.tree.body if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]
        # Decorated functions may be compiled; a function compiled by a call is assigned to a name.
        used = taken.union(*(_names(node) for node in functions if node.decorator_list))
        for function in functions:
            parts += [*function.decorator_list, *function.args.defaults, *filter(None, function.args.kw_defaults)]
        for node in self.tree.body:
            if isinstance(node, ast.ClassDef):
                parts += [node] if _is_frozen(node) else []
            elif isinstance(node, ast.Assign | ast.AnnAssign):
                targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                parts += [node] if used & set().union(*map(_names, targets)) else []
            elif not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                parts.append(node)
        return set[str]().union(*(_names(part) for part in parts))


def _names(node: ast.AST, context: type = ast.expr_context) -> set[str]:
    """Return the names in a tree except in annotations; with ast.Store, those that it binds."""
    found: set[str] = set()
    left: list[Any] = [node]
    while left:
        part = left.pop()
        if isinstance(part, list):
            left += part
        elif isinstance(part, ast.Name):
            found |= {part.id} if isinstance(part.ctx, context) else set()
        elif isinstance(part, ast.AST):
            left += [getattr(part, name, None) for name in part._fields if name not in ("annotation", "returns")]
    return found


def _statements(body: list[ast.stmt]) -> Iterator[ast.stmt]:
    """Walk the statements of a block and of those within it, skipping code for type checkers only."""
    for node in body:
        if isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING"):
            continue
        yield node
        for part in ("body", "orelse", "finalbody"):
            yield from _statements(getattr(node, part, []))
        for branch in [*getattr(node, "handlers", []), *getattr(node, "cases", [])]:
            yield from _statements(branch.body)


def _is_frozen(node: ast.stmt) -> bool:
    """Whether compiled code freezes the definition made by a statement of a module."""
    if isinstance(node, ast.ClassDef):
        return any(ast.unparse(base).endswith(FROZEN_CLASSES) for base in node.bases)
    return isinstance(node, ast.Assign | ast.AnnAssign)


def shape(node: object) -> str:
    """Return a syntax tree as text, without prose and line numbers, and the same for all versions of Python."""
    if isinstance(node, ast.AST):
        fields = (
            f"{name}={shape(value)}"
            for name, value in ast.iter_fields(node)
            if name not in ("ctx", "kind", "type_comment") and value is not None and value != []
        )
        return f"{type(node).__name__}({','.join(fields)})"
    if isinstance(node, list):
        return f"[{','.join(shape(item) for item in node if not _is_prose(item))}]"
    return repr(node)


def _is_prose(node: object) -> bool:
    """Whether a node is a docstring, or any other bare text."""
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
