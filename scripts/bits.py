"""Proof that a refactoring changed no bit: hashes of what every method computes, before and after.

    python scripts/bits.py write FILE              run all cases, some two minutes, and store hashes of their results
    python scripts/bits.py compare FILE            run them again and print differences; exit code 1 if there are any
    python scripts/bits.py compare FILE --only "*verlet*"    only the cases whose name matches (also for `write`)

The cases (`bits_cases.py`) use the public API only, so that both files run unchanged before and after a change. The
hashes cover the float64 bytes of times, positions, velocities or momenta and closest approaches; numbers of force
evaluations are compared as well. A checksum for every sample, a hash without the signs of zeros, and the last sample in
full tell where a difference begins, how large it is, and whether it is only the sign of a zero. The bits depend on the
processor and the version of Numba: write and compare on the same machine.
"""

from __future__ import annotations

import argparse
import fnmatch
import hashlib
import json
import sys
import time
import warnings
import zlib
from collections import Counter
from collections.abc import Callable
from itertools import groupby
from pathlib import Path
from typing import Any

import llvmlite.binding
import numba
import numpy as np
from bits_cases import cases, states

import orbits

MOST_NUMBERS = 400
"""Of a longer last sample, evenly spread numbers are kept: an estimate of a difference, which its hash shows anyway."""


def record(quantities: dict[str, Any]) -> dict[str, Any]:
    """Return what is kept of quantities: for each a text, or the hash of an array and what judges a difference."""
    kept: dict[str, Any] = {}
    for name, value in quantities.items():
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


def computed(only: str) -> dict[str, dict[str, Any]]:
    """Return the records of all cases whose name matches, and say on the way how many and how long."""
    found: dict[str, dict[str, Any]] = {}
    for kind, some in groupby(cases(), key=lambda case: case[0].partition("/")[0]):
        begun, before = time.perf_counter(), len(found)
        for name, compute in some:
            if matches(name, only):
                if name in found:
                    raise ValueError(f"two cases are called {name!r}")
                found[name] = record(outcome(compute))
        if len(found) > before:
            print(f"{kind}: {len(found) - before} cases, {time.perf_counter() - begun:.1f} s", file=sys.stderr)
    return found


def outcome(compute: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """Return the quantities of a case; of one that fails, the kind of the error, and the samples of the run before."""
    try:
        return compute()
    except orbits.IntegrationError as error:
        found = {"raised": type(error).__name__}
        if isinstance(error.trajectory, orbits.Trajectory):
            found |= states(error.trajectory)
            # How many particles went on to the end of the block in which another failed depends on the threads.
            found.pop("particle evaluations", None)
        return found
    except Exception as error:  # a case that breaks is a difference like any other
        return {"raised": type(error).__name__}


def matches(name: str, only: str) -> bool:
    """Whether a case is one of those asked for; brackets stand for themselves."""
    return bool(fnmatch.fnmatchcase(name.lower(), only.lower().replace("[", "[[]")))


def broken_promises(found: dict[str, dict[str, Any]]) -> list[str]:
    """Return where threads or an interruption changed a bit, which they must not."""
    out = [f"{name}: interrupted, resumed, and not the same" for name, kept in found.items() if lost(kept)]
    for stem, names in groupby(found, key=lambda name: name.partition(" [threads=")[0]):
        first, *others = names
        out += [f"{stem}: {name} differs from {first}" for name in others if found[name] != found[first]]
    return out


def lost(kept: dict[str, Any]) -> bool:
    """Whether a run that was interrupted came out differently."""
    return bool(kept.get("as without interruption", "True") != "True")


# --------------------------------------------------------------------------------------------------------- differences


def differences(old: dict[str, dict[str, Any]], new: dict[str, dict[str, Any]]) -> list[tuple[str, str, str]]:
    """Return case, quantity and what differs, in words."""
    out = []
    for name in [*old, *(name for name in new if name not in old)]:
        if name not in old or name not in new:
            out.append((name, "", "was not there" if name in new else "is no longer there"))
            continue
        before, after = old[name], new[name]
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
    given = parser.parse_args()
    stored = None if given.command == "write" else json.loads(given.file.read_text())
    warnings.simplefilter("ignore")
    found = computed(given.only)
    failed = Counter(kept["raised"] for kept in found.values() if "raised" in kept)
    print("cases that end in an error:", ", ".join(f"{count} {kind}" for kind, count in failed.items()) or "none")
    broken = broken_promises(found)
    print(*broken, sep="\n", end="\n" if broken else "")
    if stored is None:
        given.file.write_text(json.dumps({"circumstances": circumstances(), "cases": found}, indent=0) + "\n")
        print(f"{len(found)} cases written to {given.file}")
        return 1 if broken else 0
    if stored["circumstances"] != circumstances():
        print(f"made with {stored['circumstances']}, compared with {circumstances()}: the last bits may differ")
    old = {name: kept for name, kept in stored["cases"].items() if matches(name, given.only)}
    rows = differences(old, found)
    for name, quantity, words in rows:
        print(f"{name}  |  {quantity}  |  {words}")
    changed = len({name for name, _, _ in rows})
    print(f"{len(found)} cases, {changed} of them different" if rows else f"{len(found)} cases, all bits the same")
    return 1 if rows or broken else 0


if __name__ == "__main__":
    sys.exit(main())
