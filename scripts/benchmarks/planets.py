"""Planets on Kepler orbits about the Sun: Wisdom–Holman maps beside REBOUND's."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import orbits
from benchmarks.native import Native, how_built, planets
from benchmarks.problems import AU_KM, YEAR, marcher, ours, ten_bodies_data
from benchmarks.references import ends, errors, rotated, rotations

H = 3.0
"""Days in a step."""

CHUNKS = 40
"""How many times steps are timed for each repetition: the least is taken, of many short times."""

CHUNK, WHFAST_CHUNK, WHFAST512_CHUNK = 8192, 8192, 16384
"""Steps that are timed at once, for some milliseconds: a block of ours, and those of REBOUND's integrators, with their
correctors at both ends.
"""

OURS = {
    "WisdomHolman, standard, no corrector": orbits.WisdomHolman(kernel="standard", corrector=0),
    "WisdomHolman, modified kick, corrector 17": orbits.WisdomHolman(),
    "WisdomHolman, lazy kick, corrector 17": orbits.WisdomHolman(kernel="lazy"),
    "SABA(10, 6, 4)": orbits.methods.SABA(),
}

THEIRS: dict[str, tuple[str, dict[str, Any]]] = {
    "REBOUND WHFast": ("whfast", {}),
    "REBOUND WHFast modified kick, corrector 17": ("whfast", {"kernel": "modifiedkick", "corrector": 17}),
    "REBOUND WHFast lazy, correctors 17 and 2": ("whfast", {"kernel": "lazy", "corrector": 17, "corrector2": 1}),
    "REBOUND SABA(10,6,4)": ("saba", {"type": "10_6_4"}),
    "REBOUND WHFast512, corrector 17": ("whfast512", {"corrector": 17}),
}
"""WHFast512 is last: it leaves AVX-512 registers in a state in which the SSE code of the wheel that follows takes twice
the time; kernels of ours clear them."""

COMPARED = {
    "REBOUND WHFast": "times faster than WHFast",
    "REBOUND WHFast lazy, correctors 17 and 2": "than WHFast lazy",
    "REBOUND WHFast512, corrector 17": "than WHFast512",
}
"""Peers with which all are compared, and the heads of these columns."""

NATIVE = ", built here"
"""What follows the name of a peer that was built from source."""

SHOWN = ("Mercury", "Venus", "Earth-Moon", "Mars", "Jupiter", "Saturn", "Uranus", "Neptune", "Pluto")


def part_planets(repetitions: int) -> dict[str, Any]:
    """Wisdom–Holman maps of the planets in steps of 3 days. For Sun and eight planets: nanoseconds a step, the least of
    many short pieces of a run, in turn with REBOUND's WHFast, SABA and WHFast512, from the wheel and as built here from
    source; how many times faster than each of these; and the largest relative error of the energy in ten million steps.
    For ten bodies over 1,000 years: seconds of a whole run, and position errors as in the first table.
    """
    native = Native.start()
    gm, q, v, reference = ten_bodies_data()
    times = _steps(gm[:9], q[:9], v[:9], repetitions, native)
    seconds, rms = _thousand_years(gm, q, v, reference["1000"], max(8, repetitions), native)
    if native is not None:
        native.close()
    rows = []
    for name in [*OURS, *THEIRS]:
        mine = name in OURS
        row: dict[str, Any] = {
            "method": name,
            "ns a step": times[name],
            "built here": times.get(f"{name}{NATIVE}"),
        }
        for peer, head in COMPARED.items():
            for build, which in {"": "", NATIVE: ", built here"}.items():
                theirs = times.get(f"{peer}{build}")
                row[f"{head}{which}"] = None if theirs is None else theirs / times[name]
        row |= {
            "energy": _energy(OURS[name], gm[:9], q[:9], v[:9]) if mine else None,
            "run s": seconds.get(name),
            "run s, built here": seconds.get(f"{name}{NATIVE}"),
        }
        if name in rms:
            row["rms_km"] = dict(zip(SHOWN, rms[name].tolist(), strict=True))
        rows.append(row)
    return {"starts": max(8, repetitions), "built here by": how_built(), "rows": rows}


def _steps(gm: np.ndarray, q: np.ndarray, v: np.ndarray, repetitions: int, native: Native | None) -> dict[str, float]:
    """Return nanoseconds a step."""
    options = {name: {"approaches": method.looks_for_approaches} for name, method in OURS.items()}
    runs = {name: marcher(method, gm, q, v, H, **options[name]) for name, method in OURS.items()}
    for run in runs.values():
        run.compile()
    least: dict[str, float] = {}

    def note(name: str, seconds: float, steps: int) -> None:
        least[name] = min(least.get(name, np.inf), 1e9 * seconds / steps)

    for _ in range(CHUNKS * repetitions):
        for name, run in runs.items():
            begun = time.perf_counter()
            run.advance(CHUNK)
            note(name, time.perf_counter() - begun, CHUNK)
        for name, (integrator, options) in THEIRS.items():
            steps = WHFAST512_CHUNK if integrator == "whfast512" else WHFAST_CHUNK
            arguments = integrator, options, gm, q, v, H, steps
            note(name, planets(*arguments)[0], steps)
            if native is not None:
                note(f"{name}{NATIVE}", native.planets(*arguments)[0], steps)
    return least


def _thousand_years(
    gm: np.ndarray, q: np.ndarray, v: np.ndarray, end: Any, count: int, native: Native | None
) -> tuple[dict[str, float], dict[str, np.ndarray]]:
    """Return the seconds, and the RMS errors in km, of all that take ten bodies."""
    span = 1000 * YEAR
    starts = [rotated(q, v, rotation) for rotation in rotations(count)]
    truths = ends(gm, q, v, end, starts, span)
    runs: dict[str, Callable[..., tuple[float, np.ndarray]]] = {
        name: lambda q, v, method=method: ours(method, gm, q, v, H, span) for name, method in OURS.items()
    }
    for name, (integrator, options) in THEIRS.items():
        if integrator != "whfast512":
            arguments = integrator, options, gm
            runs[name] = lambda q, v, a=arguments: planets(*a, q, v, H, round(span / H))
            if native is not None:
                runs[f"{name}{NATIVE}"] = lambda q, v, a=arguments: native.planets(*a, q, v, H, round(span / H))
    seconds: dict[str, list[float]] = {name: [] for name in runs}
    squares: dict[str, list[np.ndarray]] = {name: [] for name in runs}
    for start, truth in zip(starts, truths, strict=True):
        for name, run in runs.items():
            spent, reached = run(start.q, start.v)
            seconds[name].append(spent)
            squares[name].append(errors(reached, start, truth) ** 2)
    return (
        {name: statistics.median(spent) for name, spent in seconds.items()},
        {name: AU_KM * np.sqrt(np.mean(square, axis=0))[1:] for name, square in squares.items()},
    )


def _energy(method: Any, gm: np.ndarray, q: np.ndarray, v: np.ndarray) -> float:
    """Return the largest relative energy error at 50 samples of ten million steps."""
    run, start, worst = marcher(method, gm, q, v, H), _total(gm, q, v), 0.0
    for _ in range(50):
        run.advance(200_000)
        worst = max(worst, abs(float(_total(gm, *run.state()) / start - 1)))
    return worst


def _total(gm: np.ndarray, q: np.ndarray, v: np.ndarray) -> np.longdouble:
    """Return the energy, times G."""
    m, x, u = gm.astype(np.longdouble), q.astype(np.longdouble), v.astype(np.longdouble)
    i, j = np.triu_indices(len(m), 1)
    pairs = m[i] * m[j] / np.sqrt(((x[i] - x[j]) ** 2).sum(axis=1))
    return (m[:, None] * u * u).sum() / 2 - pairs.sum()
