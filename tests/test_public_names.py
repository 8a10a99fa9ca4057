"""The public names: explicit, lazy, complete, and light to import."""

from __future__ import annotations

import ast
import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

import orbits
from orbits import elsewhere, errors, forces, integrators
from orbits.integrators import registry
from orbits.lagrangians import terms

from .coverings import each

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


@each("name", sorted(orbits.__all__))
def test_every_public_name_is_there_and_documented(name: str) -> None:
    value = getattr(orbits, name)
    if inspect.isclass(value) or callable(value):
        assert inspect.getdoc(value)


def test_names_for_the_type_checker_and_at_run_time_are_the_same_and_come_from_the_same_modules() -> None:
    tree = ast.parse(SOURCE.read_text(encoding="utf-8"))
    (block,) = [node for node in tree.body if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"]
    seen = {alias.name: node.module for node in block.body if isinstance(node, ast.ImportFrom) for alias in node.names}
    assert {name for name, module in seen.items() if module == "orbits"} == set(orbits._SPACES)
    seen = {name: module for name, module in seen.items() if module != "orbits"}
    assert seen == {name: f"orbits.{module}" for name, module in orbits._MODULE_OF.items()}
    assert sorted(orbits.__all__) == sorted([*seen, "__version__"])
    assert set(orbits.__all__) <= set(dir(orbits))


def test_there_are_few_names_at_the_top() -> None:
    assert len([name for name in dir(orbits) if not name.startswith("__")]) <= 60  # with observations and encounters


@pytest.mark.parametrize("space", [*orbits._SPACES, *orbits._PARTS])
def test_a_namespace_shows_its_names_alone_and_each_is_documented(space: str) -> None:
    module = getattr(orbits, space)
    assert module.__doc__
    registered = [key.replace("-", "_") for key in orbits.lagrangians.registry()] if space == "lagrangians" else []
    assert dir(module) == sorted([*module.__all__, *registered])
    for name in module.__all__:
        assert inspect.getdoc(getattr(module, name)), name


def test_what_moved_into_a_namespace_is_there_and_the_error_of_the_former_name_says_so() -> None:
    for space in orbits._SPACES:
        for name in set(getattr(orbits, space).__all__) - set(orbits.__all__) - {"load"}:  # REBOUND's is a run's
            with pytest.raises(AttributeError, match=rf"no attribute '{name}': it is orbits\.{space}\.{name} now\. "):
                getattr(orbits, name)


def test_every_registered_method_term_and_force_is_a_public_name() -> None:
    assert registry()
    for cls in registry().values():
        assert getattr(orbits.methods, cls.__name__, None) is cls
    acting = {cls for found in (terms.registry(), forces.registry()) for cls in found.values()}
    # Systems make the term of the bodies of an ephemeris themselves.
    assert {cls.__name__ for cls in acting} - set(orbits.terms.__all__) == {"InEphemeris"}


@pytest.mark.parametrize("cls", [c for c in registry().values() if "__post_init__" in vars(c)], ids=lambda c: c.name)
def test_an_integrator_that_checks_its_parameters_says_what_it_raises(cls: type) -> None:
    assert "Raises InputError" in (inspect.getdoc(cls) or "")


def test_a_march_describes_each_of_its_parameters() -> None:
    items = [line.split(" : ")[0] for line in (inspect.getdoc(orbits.march) or "").splitlines() if " : " in line]
    described = {name.strip() for item in items for name in item.split(",")}
    assert set(inspect.signature(orbits.march).parameters) - {"lagrangian", "integrator"} <= described


def test_every_error_of_the_package_is_a_public_name() -> None:
    classes = {name: value for name, value in vars(errors).items() if isinstance(value, type)}
    found = {name for name, value in classes.items() if issubclass(value, BaseException)}
    assert "Interrupted" in found
    assert found == set(errors.__all__)


def test_an_unknown_name_is_an_attribute_error_that_lists_what_there_is() -> None:
    with pytest.raises(AttributeError, match=r"no attribute 'Gaus'.*Gauss"):
        orbits.Gaus  # noqa: B018
    assert not hasattr(orbits, "_private")
    assert not hasattr(orbits, "__path_of_nothing__")


@each(
    ("name", "answer"),
    [
        ("WHFast", "which is REBOUND's: compare with it by against=['whfast'] or --against whfast."),
        ("IAS15", "which is REBOUND's: compare with it by against=['ias15']"),
        ("MERCURIUS", "compare with it by against=['mercurius']"),
        ("JANUS", "which is REBOUND's, and not available for comparison."),
        ("Simulation", ": here that is orbits.System(...), which orbits.propagate integrates."),
        ("gauss", "; did you mean Gauss?"),
        ("RK4", "; did you mean orbits.methods.RungeKutta4?"),
        ("Leapfrog", "; did you mean StormerVerlet?"),
        ("euler", "; did you mean orbits.methods.ExplicitEuler or orbits.methods.SymplecticEuler?"),
        ("innputerror", "; did you mean orbits.errors.InputError?"),
        ("quux", "'quux'. Its public names are"),
    ],
)
def test_a_name_of_another_package_is_answered_with_what_there_is(name: str, answer: str) -> None:
    with pytest.raises(AttributeError, match=f"module 'orbits' has no attribute '{name}'") as caught:
        getattr(orbits, name)
    assert answer in str(caught.value)


def test_a_method_that_is_rebounds_is_answered_alike_wherever_it_is_asked_for() -> None:
    answer = r"which is REBOUND's: compare with it by against=\['whfast'\]"
    for ask in (integrators.parse, integrators.named):
        with pytest.raises(orbits.errors.UnknownNameError, match=answer):
            ask("WHFast")
    assert set(elsewhere.PEERS.values()) <= set(orbits.regression.PEERS)


def test_what_is_said_to_be_here_is_here() -> None:
    known = set(inspect.signature(orbits.propagate).parameters)
    for hint in elsewhere.KEYWORDS.values():
        assert set(re.findall(r"(?<!\w)(\w+)=", hint)) <= {*known, "softening", "epoch", "units", "stages", "tolerance"}
    for hint in (*elsewhere.KEYWORDS.values(), *elsewhere.PUBLIC_NAMES.values()):
        for name in re.findall(r"orbits\.(\w+)", hint):
            assert hasattr(orbits, name), hint
    for name in elsewhere.OTHER_NAMES.values():
        assert set(name.split(" or ")) <= set(registry())


@pytest.fixture(scope="module")
def of_a_system() -> list[str]:
    """What a process prints that makes a system, looks at it, and imports the comparison with REBOUND."""
    code = (
        "import sys, orbits; print(orbits.elements.two_body.__name__); system = orbits.System.solar_system();"
        "print(*dir(orbits)); system.elements('Sun');"
        "print(sorted({'numba', 'matplotlib', 'rebound', 'h5py'} & set(sys.modules)));"
        "import orbits.regression.report; print(sorted({'rebound', 'matplotlib'} & set(sys.modules)))"
    )
    return in_a_fresh_process(code).splitlines()


def test_dir_shows_public_names_namespaces_and_submodules_and_nothing_internal(of_a_system: list[str]) -> None:
    shown = {name for name in of_a_system[1].split() if not name.startswith("__")}  # internal ones are loaded by then
    assert shown == {*orbits.__all__, *orbits._SPACES, *orbits._PARTS} - {"__version__"}
    assert {"propagate", "Gauss", "events", "diagnostics"} <= shown
    for part in orbits._PARTS:
        assert getattr(orbits, part).__doc__


def test_an_unknown_name_loads_no_heavy_package() -> None:
    code = f"import sys, orbits; hasattr(orbits, 'WHFast'); print(sorted(set({HEAVY}) & set(sys.modules)))"
    assert in_a_fresh_process(code) == "[]"


def test_submodules_load_on_first_use(of_a_system: list[str]) -> None:
    assert of_a_system[0] == "two_body"


def test_import_loads_no_heavy_package() -> None:
    code = f"import sys, orbits; print(sorted(set({HEAVY}) & set(sys.modules)))"
    assert in_a_fresh_process(code) == "[]"


def test_import_takes_less_than_the_promised_time() -> None:
    # The promise itself, 0.7 s. Reached is 0.01 s, held by the test above; a tighter bound would measure the machine's
    # other load, for which the least of three runs is judged.
    code = "import time; t = time.perf_counter(); import orbits; print(time.perf_counter() - t)"
    assert min(float(in_a_fresh_process(code)) for _ in range(3)) < 0.7


def test_making_a_system_imports_neither_numba_nor_matplotlib_nor_rebound(of_a_system: list[str]) -> None:
    # The first step and the first energy pay for compiling; looking at a system does not.
    assert of_a_system[2] == "[]"


def test_importing_the_comparison_loads_neither_rebound_nor_matplotlib(of_a_system: list[str]) -> None:
    assert of_a_system[3] == "[]"


PAIR = """
pair = orbits.System(
    ["a", "b"], [1, 1e-3], [[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [0, 1, 0]], units=orbits.DIMENSIONLESS
)
orbits.propagate(pair, orbits.Gauss(stages=8), dt=0.1, duration=0.1, samples=2, progress=False)
"""
PLANETS = """
planets = orbits.System.solar_system()
orbits.propagate(planets, orbits.Gauss(stages=8), dt="6 d", duration="6 d", samples=2, progress=False)
"""
KINDS = (
    *("integrators.saba", "integrators.composition", "lagrangians.terms.post_newtonian", "forces.tides"),
    *("lagrangians.pendulum", "discrete", "archive.reader", "catalogue", "observing.ephemeris_of_run"),
    *("propagation.chain_of_legs", "propagation.events.archived", "propagation.checks.kepler_splitting"),
)
OTHERS = ("numba.np.arrayobj", "numba.np.linalg", "sympy", "scipy", "h5py", "matplotlib", "rebound", "pandas")


@pytest.fixture(scope="module")
def after_runs() -> list[str]:
    """What a process prints after a run of two bodies, and after another of the planets, with kernels from disk."""
    exec(PAIR + PLANETS, {"orbits": orbits})  # whose kernels are on disk from here on
    loaded = "print(gc.isenabled(), [name for name in {} if name in sys.modules])\n"
    kinds = [f"orbits.{kind}" for kind in KINDS]
    code = "import gc, sys, orbits\n" + PAIR + loaded.format(kinds) + PLANETS + loaded.format(OTHERS)
    return in_a_fresh_process(code).splitlines()


def test_a_run_with_kernels_from_disk_loads_nothing_that_compiles_archives_draws_or_compares(
    after_runs: list[str],
) -> None:
    # A third of what a run costs that takes one step; what is named of Numba stands for all that it compiles with.
    assert after_runs[1] == "True []"


def test_a_run_loads_the_method_that_it_needs_and_not_all_and_leaves_the_collector_on(after_runs: list[str]) -> None:
    """Each module takes about a millisecond."""
    assert after_runs[0] == "True []"
