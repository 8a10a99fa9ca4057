"""The stamp of compiled code: it ignores prose, and covers everything that a kernel can freeze."""

import ast
import shutil
import types

import numba
import numpy as np
import pytest

import orbits
from orbits.errors import InputError
from orbits.forces import drag
from orbits.kernels.binding import Tag, kernel_of
from orbits.kernels.compile import kernel
from orbits.kernels.compile.frozen import frozen
from orbits.kernels.compile.source_hash import (
    KERNEL_FOLDERS,
    MARKS,
    PACKAGE,
    imports,
    source_stamp,
    stamp_of,
    without_prose,
)
from orbits.kernels.lanes import put, rsqrt_cubed, sqrt

from ..coverings import first

FILES = {
    "kernels/__init__.py": "",
    "kernels/compile.py": 'import numba\ndef kernel(f):\n    """Compile f."""\n    return numba.njit(a=False)(f)\n',
    "kernels/sums.py": '''"""Sums."""
from orbits.integrators.base import LIMIT, Integrator
from orbits.kernels import sizes
from orbits.kernels.compile import kernel

@kernel
def total(q):
    """Return the sum."""
    s = 0.5  # half
    for k in range(LIMIT):
        s = s + q[k] * sizes.WIDTH
    return s

class Sums(Integrator):
    advance = total
''',
    "kernels/choices.py": """from orbits.kernels.compile.verbs import verb
@verb
def twice(x): return lambda x: 2.0 * x
""",
    "kernels/sizes.py": "WIDTH = 8\ndef unused(): return 1\n",
    "integrators/__init__.py": "",
    "integrators/runs.py": "DAYS = 1\n",
    "integrators/base.py": """from orbits.tables import table
LIMIT = table(3)
OTHER = 7
class Integrator:
    def name(self): return "x"
""",
    "lagrangians/symbolic/printing.py": 'HEADER = "@kernel"\n',
    "plots.py": "COLOUR = 1\n",
    "tables.py": """from typing import TYPE_CHECKING
if TYPE_CHECKING:
    from orbits.plots import COLOUR

def table(n):
    return helper(n)

def helper(n):
    return n + 1
""",
}

KEPT = {
    "docstring of a module": ("kernels/sums.py", '"""Sums."""', '"""Sums of all kinds,\n\nlong."""'),
    "docstring of a kernel": ("kernels/sums.py", "Return the sum", "Return what is summed"),
    "docstring of the decorator": ("kernels/compile.py", "Compile f", "Compile the function f"),
    "lines of comments": ("kernels/sums.py", "    for k in", "    # one half\n    # more\n    for k in"),
    "what no file with kernels imports": ("integrators/runs.py", "DAYS = 1", "DAYS = 2"),
    "what is imported for type checkers": ("plots.py", "COLOUR = 1", "COLOUR = 2"),
}
CHANGED = {
    "digit": ("kernels/sums.py", "0.5", "0.6"),
    "digit in the code of a verb": ("kernels/choices.py", "2.0", "3.0"),
    "operator": ("kernels/sums.py", "s + q[k]", "s - q[k]"),
    "name of a variable": ("kernels/sums.py", "s = 0.5  # half", "t = 0.5"),
    "option of the compiler": ("kernels/compile.py", "False", "True"),
    "constant of another file": ("integrators/base.py", "table(3)", "table(4)"),
    "constant of a module that is imported whole": ("kernels/sizes.py", "WIDTH = 8", "WIDTH = 4"),
    "function of a function that makes a constant": ("tables.py", "n + 1", "n + 2"),
    "what writes kernels": ("lagrangians/symbolic/printing.py", "@kernel", "@kernel "),
}


def edited(package, case):
    name, old, new = case
    text = (package / name).read_text()
    assert old in text
    (package / name).write_text(text.replace(old, new))


def stamp_now(package):
    stamp_of.cache_clear()  # as in another process
    return stamp_of(package).text


@pytest.fixture
def package(tmp_path):
    for name, text in FILES.items():
        path = tmp_path / "orbits" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    yield tmp_path / "orbits"
    stamp_of.cache_clear()


@pytest.mark.parametrize("case", KEPT)
def test_what_compiled_code_does_not_see_keeps_the_stamp(package, case):
    before = stamp_now(package)
    edited(package, KEPT[case])
    assert stamp_now(package) == before


@pytest.mark.parametrize("case", CHANGED)
def test_what_compiled_code_freezes_changes_the_stamp(package, case):
    before = stamp_now(package)
    edited(package, CHANGED[case])
    assert stamp_now(package) != before


def test_a_stamp_does_not_depend_on_what_was_there_before(package):
    """Resumed runs compare stamps: equal files have equal stamps."""
    before = stamp_now(package)
    (package / "kernels/more.py").write_text("from orbits.kernels.compile import kernel\n")
    assert stamp_now(package) != before
    (package / "kernels/more.py").unlink()
    assert stamp_now(package) == before


@pytest.mark.parametrize(
    ("name", "old", "new"),
    first(
        1,
        [
            ("kernels/gravity/pair_sums.py", "rsqrt_cubed(r2)", "rsqrt_cubed(r2) * 1.01"),
            ("kernels/steps.py", "OK, NOT_CONVERGED", "NOT_CONVERGED, OK"),
            ("integrators/collocation/rows.py", "HC, HC_LO", "HC_LO, HC"),
            ("kernels/compile/decorator.py", '{"contract"}', '{"fast"}'),
            ("lagrangians/newtonian.py", '"accelerate": body_accelerations', '"accelerate": share_of_accelerations'),
            ("lagrangians/symbolic/printing.py", "sqrt", "cbrt"),
        ],
    ),
)
def test_edits_of_this_package_that_change_digits_change_the_stamp(tmp_path, name, old, new):
    copy = tmp_path / "orbits"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    assert stamp_of(copy).text == source_stamp()
    edited(copy, (name, old, new))
    assert stamp_now(copy) != source_stamp()


def test_kernels_stand_only_where_the_stamp_looks_for_them():
    for path in PACKAGE.glob("**/*.py"):
        name, text = path.relative_to(PACKAGE).as_posix(), path.read_text(encoding="utf-8")
        if not name.startswith(tuple(f"{folder}/" for folder in KERNEL_FOLDERS)):
            assert MARKS.isdisjoint(imports(text)) or name == "__init__.py", name  # which hands `kernel` on
            assert "njit" not in text, name
            assert "numba.extending" not in text, name
    covered = stamp_of(PACKAGE).covers
    kernels = {"kernels/gravity/pair_sums.py", "integrators/kicks_and_drifts/splitting.py", "lagrangians/newtonian.py"}
    assert kernels <= covered
    assert not {name for name in covered if name.startswith(("propagation/", "marching/legs/record", "system/"))}


@pytest.mark.parametrize("every", first(1, [5, 1]))
def test_of_the_files_that_are_covered_no_code_and_no_import_is_missed(every):
    """The stamp reads text; here Python reads it."""
    for name in sorted(stamp_of(PACKAGE).covers)[::every]:
        text = (PACKAGE / name).read_text(encoding="utf-8")
        code = without_prose(text)
        assert ast.dump(without_docstrings(text)) == ast.dump(without_docstrings(code)), name
        assert taken(text) <= imports(code), name


def without_docstrings(text):
    tree = ast.parse(text)
    for node in ast.walk(tree):
        documented = isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef)
        if documented and ast.get_docstring(node, clean=False) is not None:
            del node.body[0]
    return tree


def taken(text):
    """Return what a file imports and the code for type checkers does not."""
    tree = ast.parse(text)
    blocks = [node for node in ast.walk(tree) if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"]
    skipped = {id(node) for block in blocks for part in block.body for node in ast.walk(part)}
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import) and id(node) not in skipped:
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and id(node) not in skipped:
            assert node.level == 0
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


KERNEL = """
@kernel
def force(strength, own, t, q, v, f):
    put(f, 0, settings.K * TABLE[0] * root(own[0]) {})
"""


def tag_of(K=1.0, table=(1.0, 2.0), root=sqrt, more=""):
    settings = types.ModuleType("settings")
    settings.K = K
    scope = {"kernel": kernel, "put": put, "__name__": "mine", "settings": settings, "TABLE": table, "root": root}
    exec(compile(KERNEL.format(more), "<stdin>", "exec"), scope)
    return Tag("headwind", {"force": scope["force"]})


def test_what_kernels_of_users_freeze_is_in_the_names_of_their_tags():
    """An edited force, and one that reads other values, would otherwise run the code of the first of that name."""
    tables = [np.array([1.0, *np.zeros(2000), x]) for x in (0.0, 1.0)]  # shown alike
    others = [{}, {"K": 2.0}, {"table": (3.0, 2.0)}, {"root": rsqrt_cubed}, {"more": "+ 1"}]
    names = [tag_of(**changed).name for changed in (*others, *({"table": x} for x in tables))]
    assert len(set(names)) == len(names)
    assert tag_of().name == names[0]
    assert drag.TAG.name == "drag"  # the stamp covers the package


def own_kernel(body, **scope):
    """Return a kernel f(q) of a user, made of a line and of what it reads."""
    scope = {"kernel": kernel, "put": put, "__name__": "mine"} | scope
    exec(compile(f"@kernel\ndef force(q):\n    {body}\n", "<stdin>", "exec"), scope)
    return scope["force"]


def test_what_kernels_read_is_followed_to_where_it_stands_and_no_further():
    consts = types.ModuleType("consts")
    consts.settings = types.ModuleType("consts.settings")

    def dotted(K):
        consts.settings.K = K
        return frozen(own_kernel("put(q, 0, consts.settings.K)", consts=consts))

    def helped(factor):
        scope = {}
        exec(f"def root(a):\n    return {factor} * a", scope)
        return frozen(own_kernel("put(q, 0, root(1.0))", root=numba.vectorize(scope["root"])))

    assert dotted(2.0) != dotted(3.0)
    assert dotted(2.0) == dotted(np.float64(2.0))
    assert helped(1) != helped(2)
    shapes = [frozen(own_kernel("put(q, 0, 1.0 * q.shape[0])", shape=x)) for x in ("spheres", "cubes")]
    assert shapes[0] == shapes[1]  # an attribute, not the global of that name
    assert frozen(own_kernel("put(q, 0, 1.0)", __name__=None))  # as of functions that SymPy makes


def test_kernels_of_the_package_in_a_tag_of_a_user_tell_it_from_others():
    mine = own_kernel("put(q, 0, 1.0)")
    two = [Tag("x", {"force": mine, "particle_force": kernel}).name for kernel in (rsqrt_cubed, drag.particle_force)]
    assert two[0] != two[1]
    made = [
        orbits.Lagrangian.from_kernels({"accelerate": f}, coordinates=["x"], name="mine", example=None)
        for f in (accelerate_of("pendulum"), accelerate_of("harmonic-oscillator"))
    ]
    assert made[0].tag.name != made[1].tag.name


def accelerate_of(name):
    return kernel_of(orbits.lagrangians.registry()[name].tag.type, "accelerate")


def test_values_may_change_before_kernels_are_used_and_are_refused_after():
    settings = types.ModuleType("settings")
    settings.K = 1.0
    tag = Tag("late", {"force": own_kernel("put(q, 0, settings.K)", settings=settings)})
    settings.K = 2.0
    tag.check()
    settings.K = 3.0
    with pytest.raises(InputError, match="has changed since it was first used"):
        tag.check()
