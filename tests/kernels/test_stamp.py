"""The stamp of compiled code: it ignores prose, and covers everything that a kernel can freeze."""

import ast
import json
import shutil
from pathlib import Path

import pytest

from orbits.kernels.compile import source_hash, trusted_files
from orbits.kernels.compile.source_hash import (
    GENERATING,
    KERNEL_FOLDERS,
    MARKS,
    PACKAGE,
    Code,
    File,
    shape,
    source_stamp,
    stamp_of,
)

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
    "kernels/records.py": '''from typing import NamedTuple
class Path(NamedTuple):
    """A path."""
    first: float
    second: float
''',
    "kernels/choices.py": """from orbits.kernels.compile.verbs import verb
@verb
def twice(x): return lambda x: 2.0 * x
""",
    "kernels/sizes.py": "WIDTH = 8\ndef unused(): return 1\n",
    "integrators/__init__.py": "",
    "integrators/base.py": """from orbits.tables import table
LIMIT = table(3)
OTHER = 7
class Integrator:
    def name(self): return "x"
""",
    "lagrangians/symbolic/printing.py": 'HEADER = "@kernel"\n',
    "tables.py": "def table(n):\n    return helper(n)\n\ndef helper(n):\n    return n + 1\n\ndef far(): return 2\n",
}


@pytest.fixture
def package(tmp_path):
    for name, text in FILES.items():
        path = tmp_path / "orbits" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tmp_path / "orbits"


KEPT = {
    "docstring of a module": ("kernels/sums.py", '"""Sums."""', '"""Sums of all kinds,\n\nlong."""'),
    "docstring of a kernel": ("kernels/sums.py", "Return the sum", "Return what is summed"),
    "docstring of the decorator": ("kernels/compile.py", "Compile f", "Compile the function f"),
    "comment": ("kernels/sums.py", "# half", "# one half\n    # more"),
    "formatting": ("kernels/sums.py", "q[k] * sizes.WIDTH", "(q[k]\n            * sizes.WIDTH)"),
    "constant that no kernel reads": ("integrators/base.py", "OTHER = 7", "OTHER = 8"),
    "method of a base class": ("integrators/base.py", '"x"', '"y"'),
    "function beside a constant": ("kernels/sizes.py", "return 1", "return 2"),
    "function beside one that makes a constant": ("tables.py", "return 2", "return 3"),
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
    "order of the fields of a record": ("kernels/records.py", "first: float\n    second", "second: float\n    first"),
    "what writes kernels": ("lagrangians/symbolic/printing.py", "@kernel", "@kernel "),
}


def edited(package, case):
    name, old, new = case
    text = (package / name).read_text()
    assert old in text
    (package / name).write_text(text.replace(old, new))


@pytest.mark.parametrize("case", KEPT)
def test_what_compiled_code_does_not_see_keeps_the_stamp(package, case):
    before = Code(package).digest()
    edited(package, KEPT[case])
    assert Code(package).digest() == before


@pytest.mark.parametrize("case", CHANGED)
def test_what_compiled_code_freezes_changes_the_stamp(package, case):
    before = stamp_of(package).text
    edited(package, CHANGED[case])
    stamp_of.cache_clear()  # as in another process, which finds what this one kept
    assert stamp_of(package).text != before


@pytest.mark.parametrize(
    ("name", "old", "new"),
    first(2, [
        ("kernels/gravity/pair_sums.py", "rsqrt_cubed(r2)", "rsqrt_cubed(r2) * 1.01"),
        ("kernels/steps.py", "OK, NOT_CONVERGED", "NOT_CONVERGED, OK"),
        ("integrators/collocation/rows.py", "HC, HC_LO", "HC_LO, HC"),
        ("kernels/compile/decorator.py", '{"contract"}', '{"fast"}'),
        ("lagrangians/newtonian.py", '"accelerate": body_accelerations', '"accelerate": share_of_accelerations'),
        ("lagrangians/symbolic/printing.py", "sqrt", "cbrt"),
    ]),
)
def test_edits_of_this_package_that_change_digits_change_the_stamp(tmp_path, name, old, new):
    copy = tmp_path / "orbits"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    assert Code(copy).digest() == source_stamp()
    edited(copy, (name, old, new))
    assert Code(copy).digest() != source_stamp()


def test_kernels_stand_only_where_the_stamp_looks_for_them():
    for path in PACKAGE.glob("**/*.py"):
        name = path.relative_to(PACKAGE).as_posix()
        if not name.startswith(tuple(f"{folder}/" for folder in KERNEL_FOLDERS)):
            origins = set(File(path.read_bytes(), ["orbits", *name.split("/")[:-1]]).imports.values())
            assert origins.isdisjoint(MARKS | GENERATING) or name == "__init__.py", name  # which hands `kernel` on
            assert b"njit" not in path.read_bytes(), name
    covered = stamp_of(PACKAGE).covers
    kernels = {"kernels/gravity/pair_sums.py", "integrators/kicks_and_drifts/splitting.py", "lagrangians/newtonian.py"}
    assert kernels <= covered
    assert not {"integrators/base.py", "lagrangians/pendulum.py", "kernels/compile/trusted_files.py"} & covered


def kept_at(package: Path) -> Path:
    (place,) = trusted_files.user_folder("sources").glob("*.json")
    return place


@pytest.fixture
def again(package, tmp_path, monkeypatch):
    """Return a function that computes the stamp as a new process would, and returns whether it had to parse."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    trees = []
    monkeypatch.setattr(source_hash, "Code", lambda folder: trees.append(folder) or Code(folder))

    def ask():
        stamp_of.cache_clear()
        trees.clear()
        return stamp_of(package).text, bool(trees)

    return ask


def test_a_second_start_reads_no_syntax_tree(again, package):
    text, cold = again()
    assert cold
    assert again() == (text, False)
    edited(package, KEPT["comment"])
    assert again() == (text, True)
    assert again() == (text, False)
    edited(package, CHANGED["constant of another file"])
    assert again()[0] != text


def test_a_stamp_does_not_depend_on_what_was_there_before(again, package):
    """Resumed runs compare stamps: equal files have equal stamps."""
    first, _ = again()
    (package / "kernels/more.py").write_text("from orbits.kernels.compile import kernel\n")
    assert again()[0] != first
    (package / "kernels/more.py").unlink()
    assert again()[0] == first


@pytest.mark.parametrize(
    "spoil",
    [
        lambda path: path.write_bytes(b""),
        lambda path: path.write_text("{}"),
        lambda path: path.write_text("[1]"),
        lambda path: path.write_text(json.dumps({**json.loads(path.read_text()), "others": ["none.py"]})),
        lambda path: (path.write_text(path.read_text().replace('"stamp": "', '"stamp": "0')), path.chmod(0o666)),
    ],
    ids=["empty", "without entries", "a list", "a file that is gone", "open to others"],
)
def test_a_kept_stamp_that_cannot_be_used_is_made_anew(again, package, spoil):
    text, _ = again()
    spoil(kept_at(package))
    assert again() == (text, True)
    assert again() == (text, False)


def test_the_shape_of_a_tree_does_not_depend_on_the_version_of_python():
    """Python 3.12 gave functions a field for type parameters; empty fields are left out."""
    tree = ast.parse("@d\ndef f(a, *, b=1):\n    'prose'\n    return a[b], 'text'\n'prose'")
    assert shape(tree) == (
        "Module(body=[FunctionDef(name='f',args=arguments(args=[arg(arg='a')],kwonlyargs=[arg(arg='b')],"
        "kw_defaults=[Constant(value=1)]),body=[Return(value=Tuple(elts=[Subscript(value=Name(id='a'),"
        "slice=Name(id='b')),Constant(value='text')]))],decorator_list=[Name(id='d')])])"
    )
