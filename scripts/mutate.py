"""Does the suite find what is broken? Break places of the engine, one at a time, and run the tests that should see it.

    python scripts/mutate.py                        break forty places, chosen by a seed, and run tests against each
    python scripts/mutate.py --list                 only say which
    python scripts/mutate.py --only 3 7-9           some of them, by their numbers; the rest another time
    python scripts/mutate.py --seed 2 --seconds 900 other places, and longer runs of tests for each

A place is a sign, an index, a coefficient, a bound or a comparison, eight of each. Each is broken in a copy of the
tree, where pytest runs the files of the default suite that have most to do with it, up to the first failure. A test
that fails must pass in the unbroken tree, or the place does not count as found. Exit code 1 if more than a tenth is
missed.

Compiled kernels are taken from the caches of this tree, but for those that hold code of the broken file: kernels name
all modules that they are made of. Those that a file writes by itself, instruction by instruction, name no module: if it
is broken, none is taken. Run the default suite first, so that there are caches.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
ENVIRONMENT = dict(os.environ)
ENGINE = ("kernels", "integrators", "marching", "lagrangians", "forces", "tableaux", "elements", "propagation")
NOT_ENGINE = ("kernels/compile/", "lagrangians/symbolic/", "propagation/checks/", "integrators/base.py")
KINDS = ("sign", "index", "coefficient", "bound", "comparison")
OPPOSITE = {ast.Lt: ">", ast.LtE: ">", ast.Gt: "<", ast.GtE: "<", ast.Eq: "!=", ast.NotEq: "=="}
OF_THE_CACHE = ("test_stamp.py", "test_compile.py", "test_library.py", "test_kernel_cache.py", "test_modules.py")
"""Tests that would notice that caches are kept in spite of an edit."""

WRITES_CODE = re.compile(rb"^ *(?:from|import) (?:llvmlite|numba\.extending)", re.M)
"""In a file that writes instructions of kernels."""

FILES = 14
"""Of the test files, those with most to do with a place."""


class Place(NamedTuple):
    """A place in a file of the package: what stands there, and the new text of the bytes from `start` to `end`."""

    file: str
    kind: str
    line: int
    start: int
    end: int
    before: str
    after: str

    def __str__(self) -> str:
        return f"{self.kind:11} orbits/{self.file}:{self.line}  {self.before}  ->  {self.after}"


def chosen(seed: int, count: int) -> list[Place]:
    """Return places of all kinds in turn, each in a file of its own as long as there are files."""
    rng = random.Random(seed)
    found: dict[str, dict[str, list[Place]]] = {kind: {} for kind in KINDS}
    for path in sorted(path for top in ENGINE for path in (ROOT / "orbits" / top).rglob("*.py")):
        name = path.relative_to(ROOT / "orbits").as_posix()
        if not name.startswith(NOT_ENGINE):
            for place in places(name, path.read_text()):
                found[place.kind].setdefault(name, []).append(place)
    taken: list[Place] = []
    while len(taken) < count:
        of_kind = found[KINDS[len(taken) % len(KINDS)]]
        used = {place.file for place in taken}
        names = sorted(of_kind.keys() - used) or sorted(of_kind)
        name = rng.choice(names)
        taken.append(of_kind[name].pop(rng.randrange(len(of_kind[name]))))
        if not of_kind[name]:
            del of_kind[name]
    return taken


def places(name: str, source: str) -> Iterator[Place]:
    """Yield the places in functions of a file that can be broken."""
    offsets = [0]
    for line in source.splitlines(keepends=True):
        offsets.append(offsets[-1] + len(line.encode()))
    data = source.encode()

    def at(line: int, column: int) -> int:
        return offsets[line - 1] + column

    def span(node: ast.expr) -> tuple[int, int]:
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        return at(node.lineno, node.col_offset), at(node.end_lineno, node.end_col_offset)

    def place(kind: str, node: ast.expr, where: tuple[int, int], new: str) -> Place:
        begin, end = span(node)
        return Place(name, kind, node.lineno, *where, " ".join(data[begin:end].decode().split())[:80], new)

    for node in in_functions(ast.parse(source)):
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub) and not has_text(node):
            begin, end = span(node.left)[1], span(node.right)[0]
            between = data[begin:end].decode()
            old, new = ("+", "-") if isinstance(node.op, ast.Add) else ("-", "+")
            if between.count(old) == 1:
                k = begin + between.index(old)
                yield place("sign", node, (k, k + 1), new)
        if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Constant) and type(node.slice.value) is int:
            k = node.slice.value
            yield place("index", node, span(node.slice), str(k - 1 if k > 0 else k + 1))
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult | ast.Div | ast.Add | ast.Sub):
            for part in (node.left, node.right):
                if isinstance(part, ast.Constant) and type(part.value) is float and 1e-6 < part.value < 1e6:
                    yield place("coefficient", node, span(part), repr(part.value * 1.001))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "range" and node.args:
            stop = node.args[min(len(node.args) - 1, 1)]
            yield place("bound", node, span(stop), f"({ast.unparse(stop)}) - 1")
        if isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in OPPOSITE:
            begin, end = span(node.left)[1], span(node.comparators[0])[0]
            between = data[begin:end].decode()
            if (match := re.search(r"<=|>=|==|!=|<|>", between)) and between.strip(" \n()") == match.group():
                where = (begin + match.start(), begin + match.end())
                yield place("comparison", node, where, OPPOSITE[type(node.ops[0])])


def in_functions(tree: ast.AST, inside: bool = False) -> Iterator[ast.AST]:
    """Walk the bodies of functions, without annotations, defaults, decorators, assertions, and what is raised."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Raise | ast.Assert | ast.arguments | ast.Import | ast.ImportFrom):
            continue
        if isinstance(node, ast.FunctionDef):
            for statement in node.body:
                yield from in_functions(ast.Module([statement], []), True)
        elif isinstance(node, ast.AnnAssign):
            if node.value is not None:
                yield from in_functions(ast.Module([ast.Expr(node.value)], []), inside)
        else:
            if inside:
                yield node
            yield from in_functions(node, inside)


def has_text(tree: ast.AST) -> bool:
    """Whether there is text among what is added."""
    return any(isinstance(node, ast.JoinedStr) or isinstance(getattr(node, "value", 0), str) for node in ast.walk(tree))


def copy_tree(folder: Path, place: Place | None) -> None:
    """Copy this tree with the compiled kernels that hold no code of the file of a place, and break the place."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True, text=True)
    for name in filter(None, listed.stdout.split("\0")):
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)
    sys.path.insert(0, str(ROOT))
    from orbits.kernels.compile.source_hash import PACKAGE, stamp_of

    mangled, kept = b"", True
    if place is not None:
        path = folder / "orbits" / place.file
        data = path.read_bytes()
        path.write_bytes(data[: place.start] + place.after.encode() + data[place.end :])
        parts = ["orbits", *place.file.removesuffix(".py").removesuffix("/__init__").split("/")]
        mangled, kept = "".join(f"{len(part)}{part}" for part in parts).encode(), not WRITES_CODE.search(data)
        # Other kernels are as they were: the stamp stays, and those with code of this file are left behind.
        with (folder / "orbits/kernels/compile/source_hash.py").open("a") as file:
            file.write(f"\n\ndef stamp_of(_: object) -> Stamp:\n    return {stamp_of(PACKAGE)!r}\n")
    for path in [*ROOT.glob("orbits/**/*.nb[ci]"), *ROOT.glob("tests/**/*.nb[ci]")] if kept else []:
        target = folder / path.relative_to(ROOT)
        if path.suffix == ".nbc" and mangled and mangled in path.read_bytes():
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        with contextlib.suppress(FileNotFoundError):
            shutil.copy2(path, target)


def likely(place: Place) -> list[str]:
    """Return test files, those first that name the module, its folder, or words of its name."""
    *folders, stem = place.file.removesuffix(".py").split("/")
    words = [word for word in re.split(r"[_/]", "_".join([*folders[1:], stem])) if len(word) > 3]
    scores: dict[str, float] = {}
    for path in sorted((ROOT / "tests").rglob("test_*.py")):
        if path.name in OF_THE_CACHE:
            continue
        name, text = path.relative_to(ROOT).as_posix(), path.read_text()
        score = 12.0 * (".".join(["orbits", *folders, stem]) in text) + 5.0 * (".".join(["orbits", *folders]) in text)
        score += 4.0 * (stem in path.stem or path.stem.removeprefix("test_") in stem)
        score += 6.0 * (len(words) > 1 and stem.replace("_", "-") in text)
        score += sum(2.0 * (word in path.stem) + min(1.0, 0.1 * text.count(word)) for word in words)
        score += 1.5 * name.startswith(f"tests/{folders[0]}/")
        scores[name] = score / (1.0 + text.count("subprocess") * 0.2)
    whole = ["tests/contracts/test_integrators.py", "tests/propagation/test_propagate.py"]
    first = sorted(scores, key=lambda name: (-scores[name], name))
    return [*(name for name in first if name not in whole)][:FILES] + whole


def run_tests(folder: Path, names: list[str], seconds: float) -> tuple[int | None, str]:
    """Run tests in a tree up to the first failure; the exit code, None after so many seconds, and what was printed."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-rfE", "-p", "no:cacheprovider", "--disable-warnings"]
    command += ["--timeout", "200", "--timeout-method", "thread", *names]
    environment = {**ENVIRONMENT, "PYTHONPATH": str(folder)}
    if folder != ROOT:
        environment["XDG_CACHE_HOME"] = str(folder / ".cache")
    with tempfile.TemporaryFile("w+") as output:
        process = subprocess.Popen(command, cwd=folder, env=environment, stdout=output, stderr=subprocess.STDOUT)
        try:
            code: int | None = process.wait(timeout=seconds)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            code = None
        output.seek(0)
        return code, output.read()


def verdict(place: Place, seconds: float) -> tuple[bool, str]:
    """Break a place and run tests: whether one finds it, and which or why not."""
    with tempfile.TemporaryDirectory(prefix="orbits-mutant-") as folder:
        copy_tree(Path(folder), place)
        code, output = run_tests(Path(folder), likely(place), seconds)
    if code is None:
        return False, f"not found in {seconds:.0f} s"
    if code == 0:
        return False, f"the {FILES} files with most to do with it pass"
    failed = re.findall(r"^(?:FAILED|ERROR) (tests/.+?)(?: - .*)?$", output, re.M)
    if code == 1 and failed and "::" in failed[0]:
        test = failed[0].split("[")[0] if " " in failed[0] else failed[0]
        code, output = run_tests(ROOT, [test], seconds)
        if code != 0:
            return False, f"{test} fails in the unbroken tree, too"
        return True, test
    return True, failed[0] if failed else f"pytest ended with {code}: {output.strip().splitlines()[-1][:100]}"


def numbers(texts: list[str]) -> set[int]:
    """Return the numbers in texts such as 3 or 7-9."""
    ends = [[int(x) for x in text.split("-")] for text in texts]
    return {k for pair in ends for k in range(pair[0], pair[-1] + 1)}


def main() -> int:
    """Break places and print a line for each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--only", nargs="+", default=[], metavar="N", help="numbers of places: 3 7-9")
    parser.add_argument("--seconds", type=float, default=600.0, help="the most for each")
    parser.add_argument("--list", action="store_true")
    options = parser.parse_args()
    all_of_them = list(enumerate(chosen(options.seed, options.count), 1))
    wanted = numbers(options.only)
    missed = done = 0
    for number, place in all_of_them:
        if wanted and number not in wanted:
            continue
        if options.list:
            print(f"{number:3} {place}")
            continue
        begun = time.perf_counter()
        found, how = verdict(place, options.seconds)
        done, missed = done + 1, missed + (not found)
        seconds = time.perf_counter() - begun
        print(f"{number:3} {'found ' if found else 'MISSED'} {seconds:4.0f} s  {place}\n    {how}", flush=True)
    if done:
        print(f"{done - missed} of {done} found")
    return int(missed > done / 10)


if __name__ == "__main__":
    sys.exit(main())
