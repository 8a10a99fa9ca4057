"""The public names: explicit, lazy, complete, and light to import."""

from __future__ import annotations

import ast
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import orbits
from orbits import errors
from orbits.integrators import registry

SOURCE = Path(orbits.__file__)
HEAVY = (
    "numba",
    "llvmlite",
    "numpy",
    "scipy",
    "astropy",
    "h5py",
    "matplotlib",
    "rebound",
    "jplephem",
    "mpmath",
    "rich",
    "typer",
)


def in_a_fresh_process(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.parametrize("name", sorted(orbits.__all__))
def test_every_public_name_is_there_and_documented(name: str) -> None:
    value = getattr(orbits, name)
    if inspect.isclass(value) or callable(value):
        assert inspect.getdoc(value)


def test_names_for_the_type_checker_and_at_run_time_are_the_same_and_come_from_the_same_modules() -> None:
    tree = ast.parse(SOURCE.read_text(encoding="utf-8"))
    (block,) = [node for node in tree.body if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"]
    seen = {alias.name: node.module for node in block.body if isinstance(node, ast.ImportFrom) for alias in node.names}
    assert seen == {name: f"orbits.{module}" for name, module in orbits._MODULE_OF.items()}
    assert sorted(orbits.__all__) == sorted([*seen, "__version__"])
    assert set(orbits.__all__) <= set(dir(orbits))


def test_every_registered_integrator_is_a_public_name() -> None:
    assert registry()
    for cls in registry().values():
        assert getattr(orbits, cls.__name__, None) is cls


@pytest.mark.parametrize("cls", [c for c in registry().values() if "__post_init__" in vars(c)], ids=lambda c: c.name)
def test_an_integrator_that_checks_its_parameters_says_what_it_raises(cls: type) -> None:
    assert "Raises InputError" in (inspect.getdoc(cls) or "")


def test_a_march_describes_each_of_its_parameters() -> None:
    items = [line.split(" : ")[0] for line in (inspect.getdoc(orbits.march) or "").splitlines() if " : " in line]
    described = {name.strip() for item in items for name in item.split(",")}
    assert set(inspect.signature(orbits.march).parameters) - {"lagrangian", "integrator"} <= described


def test_every_error_of_the_package_is_a_public_name() -> None:
    found = {name for name, value in vars(errors).items() if isinstance(value, type) and issubclass(value, Exception)}
    assert found
    assert found <= set(orbits.__all__)


def test_an_unknown_name_is_an_attribute_error_that_lists_what_there_is() -> None:
    with pytest.raises(AttributeError, match=r"no attribute 'Gaus'.*Gauss"):
        orbits.Gaus  # noqa: B018
    assert not hasattr(orbits, "_private")
    assert not hasattr(orbits, "__path_of_nothing__")


def test_submodules_load_on_first_use() -> None:
    assert in_a_fresh_process("import orbits; print(orbits.elements.two_body.__name__)") == "two_body"


def test_import_loads_no_heavy_package() -> None:
    code = f"import sys, orbits; print(sorted(set({HEAVY}) & set(sys.modules)))"
    assert in_a_fresh_process(code) == "[]"


def test_import_takes_less_than_the_promised_time() -> None:
    # The promise itself, 0.7 s. Reached is 0.01 s, held by the test above; a tighter bound would measure the machine's
    # other load, for which the least of three runs is judged.
    code = "import time; t = time.perf_counter(); import orbits; print(time.perf_counter() - t)"
    assert min(float(in_a_fresh_process(code)) for _ in range(3)) < 0.7


def test_making_a_system_imports_neither_numba_nor_matplotlib_nor_rebound() -> None:
    # The first step and the first energy pay for compiling; looking at a system does not.
    code = (
        "import sys, orbits; orbits.System.solar_system().elements('Sun');"
        "print(sorted({'numba', 'matplotlib', 'rebound', 'h5py'} & set(sys.modules)))"
    )
    assert in_a_fresh_process(code) == "[]"
