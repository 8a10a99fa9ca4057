"""Proof that a refactoring changed no bit: hashes of what every method computes, before and after.

    python scripts/bits.py write FILE              run all cases, which takes minutes, and store hashes of the results
    python scripts/bits.py compare FILE            run them again and print differences; exit code 1 if there are any
    python scripts/bits.py compare FILE --only "*verlet*"    only the cases whose name matches (also for `write`)
    python scripts/bits.py write FILE --cold       each kind of case in a process of its own, with an empty cache

The cases (`bits_cases/`) use the public API only, so that they run unchanged before and after a change. The hashes
cover the float64 bytes of times, positions, velocities or momenta, events, and closest approaches; numbers of force
evaluations are compared as well. A checksum for every sample, a hash without the signs of zeros, and the last sample in
full tell where a difference begins, how large it is, and whether it is only the sign of a zero. The bits depend on the
processor and the version of Numba: write and compare on the same machine.

Threads, samples, and a run that is killed and resumed must change no bit. Where they do, the promise is broken, and the
case holds in words what differs and by how much; `write` counts them, and `compare` lists those that FILE does not have
already. A combination that is refused is kept as its error, and a case whose packages are missing is skipped.

Besides, FILE has the seconds for compiling in each case, and for marching its first run. They are no bits: `compare`
prints by kind of case what has changed by more than a tenth, and by a tenth of a second. Seconds for compiling are
those of kernels that are not in the cache: they are compared only if both were written with --cold.
"""

from __future__ import annotations

import argparse
import fnmatch
import hashlib
import json
import os
import sys
import tempfile
import time
import warnings
import zlib
from collections import Counter, defaultdict
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from itertools import groupby
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import llvmlite.binding
import numba
import numpy as np
from bits_cases import cases
from bits_cases.facts import Facts, Skipped, states
from bits_cases.ways import BROKEN
from numba.core.event import TimingListener, install_listener

import orbits

MOST_NUMBERS = 400
"""Of a longer last sample, evenly spread numbers are kept: an estimate of a difference, which its hash shows anyway."""


LEAST_SECONDS = 0.1
"""Sums of times that have changed by less are not printed."""

SECONDS = "seconds"
"""How the names of quantities end that are times on a clock, and not compared."""

Kept = dict[str, dict[str, Any]]


def record(quantities: dict[str, Any]) -> dict[str, Any]:
    """Return what is kept of quantities: for each a text, or the hash of an array and what judges a difference."""
    kept: dict[str, Any] = {}
    for name, value in quantities.items():
        if name.endswith(SECONDS):
            continue
        if not isinstance(value, np.ndarray):
            kept[name] = str(value)
            continue
        array = np.ascontiguousarray(value, dtype=np.float64)
        kept[name] = {
            "hash": hashlib.sha256(array.tobytes()).hexdigest(),
            "shape": list(array.shape),
            "unsigned": hashlib.sha256((array + 0.0).tobytes()).hexdigest(),  # -0 + 0 is +0
            "samples": "".join(f"{zlib.crc32(row.tobytes()):08x}" for row in array),
            "last": [x.hex() for x in thinned(array[-1:].ravel()).tolist()],
        }
    return kept


def thinned(values: np.ndarray) -> np.ndarray:
    """Return at most `MOST_NUMBERS` of some values, evenly spread."""
    return values[:: -(-len(values) // MOST_NUMBERS) or 1]


def computed(only: str, only_kind: str = "") -> tuple[Kept, Kept]:
    """Return the records of all cases whose name matches, and their times; say on the way how many and how long.

    only_kind : one kind of cases; empty for all
    """
    warnings.simplefilter("ignore")
    found: Kept = {}
    times: Kept = {}
    for kind, some in groupby(cases(), key=lambda case: kind_of(case[0])):
        begun, before = time.perf_counter(), len(found)
        for name, compute in some:
            if matches(name, only) and only_kind in ("", kind):
                if name in found:
                    raise ValueError(f"two cases are called {name!r}")
                with install_listener("numba:compile", TimingListener()) as compiling:
                    quantities = outcome(compute)
                found[name] = record(quantities)
                marching, steps = quantities.get(SECONDS), quantities.get("steps")
                times[name] = {"compiling": compiling.duration if compiling.done else 0.0, "marching": marching}
                times[name]["per step"] = marching / steps if marching and steps else None
        if len(found) > before:
            print(f"{kind}: {len(found) - before} cases, {time.perf_counter() - begun:.1f} s", file=sys.stderr)
    return found, times


def computed_cold(only: str) -> tuple[Kept, Kept]:
    """Return the same, with each kind of case in a process of its own that compiles all that it needs."""
    found: Kept = {}
    times: Kept = {}
    for kind in dict.fromkeys(kind_of(name) for name, _ in cases() if matches(name, only)):
        with tempfile.TemporaryDirectory() as folder:
            os.environ["NUMBA_CACHE_DIR"] = folder
            with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as alone:
                some = alone.submit(computed, only, kind).result()
        found, times = found | some[0], times | some[1]
    return found, times


def kind_of(name: str) -> str:
    """Return the kind of a case."""
    return name.partition("/")[0]


def outcome(compute: Callable[[], Facts]) -> Facts:
    """Return the quantities of a case; of one that fails, the kind of the error, and the samples of the run before."""
    try:
        return compute()
    except orbits.errors.IntegrationError as error:
        found = {"raised": type(error).__name__}
        if isinstance(error.trajectory, orbits.Trajectory):
            found |= states(error.trajectory)
            # How many particles went on to the end of the block in which another failed depends on the threads.
            found.pop("particle evaluations", None)
        return found
    except Skipped as error:
        return {"skipped": str(error)}
    except Exception as error:  # a case that breaks is a difference like any other
        return {"raised": type(error).__name__}


def matches(name: str, only: str) -> bool:
    """Whether a case is one of those asked for; brackets stand for themselves."""
    return bool(fnmatch.fnmatchcase(name.lower(), only.lower().replace("[", "[[]")))


def broken_promises(found: Kept) -> dict[str, str]:
    """Return where threads, samples or an interruption changed a bit, which they must not: case and way, and how."""
    out: dict[str, str] = {}
    for _, names in groupby(found, key=lambda name: name.partition(" [threads=")[0]):
        first, *others = names
        out |= {f"{name}: threads": f"differs from {first}" for name in others if found[name] != found[first]}
    for name, kept in found.items():
        if lost(kept):
            out[f"{name}: interrupted, resumed"] = BROKEN
        out |= {f"{name}: {way}": words for way, words in kept.items() if str(words).startswith(BROKEN)}
    return out


def lost(kept: dict[str, Any]) -> bool:
    """Whether a run that was interrupted came out differently."""
    return bool(kept.get("as without interruption", "True") != "True")


# --------------------------------------------------------------------------------------------------------- differences


def differences(old: Kept, new: Kept) -> list[tuple[str, str, str]]:
    """Return case, quantity and what differs, in words."""
    out = []
    for name in [*old, *(name for name in new if name not in old)]:
        if name not in old or name not in new:
            out.append((name, "", "was not there" if name in new else "is no longer there"))
            continue
        before, after = old[name], new[name]
        if "skipped" in before or "skipped" in after:
            continue
        for quantity in [*before, *(key for key in after if key not in before)]:
            one, other = before.get(quantity), after.get(quantity)
            if one != other:
                out.append((name, quantity, in_words(one, other)))
    return out


def in_words(one: Any, other: Any) -> str:
    """Return how a quantity differs from the stored one."""
    if not isinstance(one, dict) or not isinstance(other, dict):
        return f"{shortened(one)} -> {shortened(other)}"
    if one["shape"] != other["shape"]:
        return f"shape {one['shape']} -> {other['shape']}"
    if one["unsigned"] == other["unsigned"]:
        return "only the sign of a zero"
    checksums = [[kept["samples"][k : k + 8] for k in range(0, len(kept["samples"]), 8)] for kept in (one, other)]
    differing = [k for k, (a, b) in enumerate(zip(*checksums, strict=True)) if a != b]
    return f"{relative(one['last'], other['last'])} at the end, from sample {differing[0]} of {len(checksums[0])} on"


def relative(one: list[str], other: list[str]) -> str:
    """Return the largest difference of the last sample, relative to its largest number."""
    a, b = (np.array([float.fromhex(x) for x in values]) for values in (one, other))
    finite = np.isfinite(a) & np.isfinite(b)
    if np.any(finite != (np.isfinite(a) | np.isfinite(b))):
        return "not finite where it was, or the other way round,"
    size = float(np.max(np.abs(a[finite]), initial=0.0))
    difference = float(np.max(np.abs(b[finite] - a[finite]), initial=0.0))
    return f"{difference / size if size > 0.0 else difference:.2g}"


def shortened(value: Any) -> str:
    """Return a stored value for a table."""
    if value is None:
        return "nothing"
    text = f"an array {value['shape']}" if isinstance(value, dict) else str(value)
    return text if len(text) <= 40 else f"{text[:37]}..."


def changed_times(old: Kept, new: Kept, cold: bool) -> list[str]:
    """Return a table of the seconds of each kind of case that have changed by more than a tenth.

    cold : whether both had empty caches, so that seconds for compiling can be compared
    """
    kinds: defaultdict[tuple[str, str], list[float]] = defaultdict(lambda: [0.0, 0.0])
    for name in old.keys() & new.keys():
        for what in ("compiling", "marching") if cold else ("marching",):
            pair = [times[name][what] for times in (old, new)]
            if None not in pair:
                both = kinds[kind_of(name), what]
                both[0], both[1] = both[0] + pair[0], both[1] + pair[1]
    return [
        f"{kind:12} {what:10} {before:9.2f} s -> {after:9.2f} s  {after / before - 1.0:+.0%}"
        for (kind, what), (before, after) in sorted(kinds.items())
        if abs(after - before) > 0.1 * before > 0.0 and abs(after - before) > LEAST_SECONDS
    ]


def circumstances() -> dict[str, str]:
    """Return what the bits depend on besides the code."""
    processor = llvmlite.binding.get_host_cpu_name()
    return {"numba": numba.__version__, "numpy": np.__version__, "processor": processor}


def main() -> int:
    """Write or compare; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("command", choices=["write", "compare"])
    parser.add_argument("file", type=Path, help="JSON file of the hashes")
    parser.add_argument("--only", default="*", help='cases whose name matches, such as "many bodies/*" or "*gauss*"')
    parser.add_argument("--cold", action="store_true", help="compile everything: a process and a cache for each kind")
    given = parser.parse_args()
    stored = None if given.command == "write" else json.loads(given.file.read_text())
    found, times = (computed_cold if given.cold else computed)(given.only)
    failed = Counter(kept["raised"] for kept in found.values() if "raised" in kept)
    print("cases that end in an error:", ", ".join(f"{count} {kind}" for kind, count in failed.items()) or "none")
    for name, kept in found.items():
        if "skipped" in kept:
            print(f"{name}: skipped: {kept['skipped']}")
    broken = broken_promises(found)
    if stored is None:
        for way, count in Counter(where.rpartition(": ")[2] for where in broken).items():
            print(f"{way}: {BROKEN} in {count} cases")
        kept = {"circumstances": circumstances(), "cold": given.cold, "cases": found, "times": times}
        given.file.write_text(json.dumps(kept, indent=0) + "\n")
        print(f"{len(found)} cases written to {given.file}; {len(broken)} broken promises")
        return 1 if broken else 0
    if stored["circumstances"] != circumstances():
        print(f"made with {stored['circumstances']}, compared with {circumstances()}: the last bits may differ")
    old = {name: kept for name, kept in stored["cases"].items() if matches(name, given.only)}
    known = broken_promises(old)
    worse = {where: how for where, how in broken.items() if where not in known}
    for where, how in worse.items():
        print(f"{where}: {how}")
    rows = differences(old, found)
    for name, quantity, words in rows:
        print(f"{name}  |  {quantity}  |  {words}")
    for row in changed_times(stored["times"], times, given.cold and stored["cold"]):
        print(row)
    changed = len({name for name, _, _ in rows})
    print(f"{len(broken)} broken promises, {len(known)} before" if broken or known else "no broken promises")
    print(f"{len(found)} cases, {changed} of them different" if rows else f"{len(found)} cases, all bits the same")
    return 1 if rows or worse else 0


if __name__ == "__main__":
    sys.exit(main())
