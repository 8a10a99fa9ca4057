"""Find a scenario: by the path of its file, or by the name of a bundled one."""

from __future__ import annotations

import ast
import importlib.util
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from types import ModuleType

from orbits import resources
from orbits.errors import InputError, OrbitsError, UnknownNameError, shown
from orbits.scenario.definition import Scenario
from orbits.scenario.study import Study

_OPTION = ("orbits.scenarios.Option", "Option")
"""How the files of bundled scenarios call `Option`, whose first argument is the name."""


@dataclass(frozen=True)
class Listed:
    """A bundled scenario for lists: its name, the first line of its file, the file, and the names of its options."""

    name: str
    summary: str
    path: Path
    options: tuple[str, ...] = ()


def bundled() -> tuple[Listed, ...]:
    """Return the bundled scenarios in alphabetical order, read from their files without running them."""
    return tuple(_listed(path) for path in _files().values())


def load(what: str) -> Scenario | Study:
    """Return the scenario in a file, or the bundled one of this name.

    A path ends in `.py` or contains a folder. The file is run once, with its own folder importable, and must define
    `scenario`. Raises UnknownNameError if there is no such bundled scenario, with close matches, and InputError if the
    file does not exist or does not run, with the file and the line.
    """
    path = Path(what).expanduser()
    if path.suffix != ".py" and len(path.parts) == 1:
        return load_file(_bundled_path(what))
    if not path.is_file():
        found = "is a folder" if path.is_dir() else "is no regular file" if path.exists() else "does not exist"
        names = ", ".join(_files())
        raise InputError(f"the scenario file {what!r} {found}; expected a Python file, or one of: {names}.")
    return load_file(path)


def load_file(path: Path) -> Scenario | Study:
    """Return the `scenario` defined by the Python file at `path`. Raises InputError, with file and line."""
    scenario = getattr(executed(path), "scenario", None)
    if not isinstance(scenario, Scenario | Study):
        got = "defines none" if scenario is None else f"has one of type {type(scenario).__name__}"
        raise InputError(
            f"{path} {got}; expected a line such as: scenario = orbits.scenarios.Scenario(name=..., title=..., ...), "
            "or one with orbits.scenarios.Study."
        )
    return scenario


def executed(path: Path) -> ModuleType:
    """Return the Python file at `path` as a module, after it has run. Raises InputError, with file and line."""
    name = f"_orbits_scenario_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise InputError(f"{path} cannot be read as Python; a scenario is a Python file that ends in .py.")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # where pickle and dataclasses look for what the file defines
    with located(path), _importable(path.resolve().parent):
        spec.loader.exec_module(module)
    return module


@contextmanager
def located(path: Path | None = None) -> Iterator[None]:
    """Turn any error of a scenario's code into an InputError that names the file and the line.

    path : the scenario's file; without it the innermost line outside this package is named, if there is one
    Errors of this package pass unchanged, as their messages are better.
    """
    try:
        yield
    except OrbitsError:
        raise
    except SyntaxError as error:
        line = f", line {error.lineno}" if error.lineno else ""  # a file with null bytes has no lines
        where = f"{error.filename or path}{line}"
        raise InputError(f"{where}: {error.msg}") from error
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # whatever the file's code raises: SystemExit, or a class of its own
        raise InputError(f"{_place(error, path)}: {type(error).__name__}: {_one_line(error)}") from error


def _place(error: BaseException, path: Path | None) -> str:
    frames = traceback.extract_tb(error.__traceback__)
    if path is not None:
        mine = [frame for frame in frames if frame.filename in {str(path), str(path.resolve())}]
    else:
        package = str(Path(__file__).resolve().parents[1])
        mine = [f for f in frames if not f.filename.startswith((package, sys.prefix, "<"))]
    if mine:
        return f"{mine[-1].filename}, line {mine[-1].lineno}"
    return str(path) if path is not None else "in a function of the scenario"


def _one_line(error: BaseException) -> str:
    try:
        return " ".join(str(error).split()) or "(no message)"
    except Exception:  # its own __str__ may raise too
        return "(no message)"


def _files() -> dict[str, Path]:
    """Return the files of the bundled scenarios by name, in alphabetical order; none of them is read."""
    found = sorted(resources.scenarios_dir().glob("*.py"))
    return {path.stem: path for path in found if not path.stem.startswith("_")}


def _bundled_path(name: str) -> Path:
    known = _files()
    if name.lower() in known:
        return known[name.lower()]
    near = get_close_matches(name.lower(), known, n=2, cutoff=0.5)
    hint = f" Did you mean {' or '.join(repr(n) for n in near)}?" if near else ""
    file = Path(f"{name}.py")
    if file.is_file():
        hint = f" There is a file {file}: give it with its ending."
    raise UnknownNameError(f"no scenario is called {shown(name)}; there are {', '.join(known)}.{hint}")


def _listed(path: Path) -> Listed:
    try:
        tree = ast.parse(path.read_text(encoding="utf-8"))
    except (OSError, SyntaxError, ValueError):
        return Listed(path.stem, "", path)
    summary = (ast.get_docstring(tree) or "").split("\n", 1)[0].rstrip(".")
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call) and ast.unparse(node.func) in _OPTION]
    names = [node.args[0].value for node in calls if node.args and isinstance(node.args[0], ast.Constant)]
    return Listed(path.stem, summary, path, tuple(map(str, names)))


@contextmanager
def _importable(folder: Path) -> Iterator[None]:
    """Make the files beside a script importable, as Python does."""
    sys.path.insert(0, str(folder))
    try:
        yield
    finally:
        sys.path.remove(str(folder))
