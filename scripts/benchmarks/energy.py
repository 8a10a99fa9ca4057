"""The energy of a Wisdom–Holman map over eight million years: how round-off adds up."""

from __future__ import annotations

import time
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import orbits
from benchmarks.problems import YEAR, marcher, ten_bodies_data
from orbits.plotting.style import BLUE, GREY, INK, below, figure, look, save

H = 3.0
"""Days in a step."""

STEPS, EVERY = 1_000_000_000, 20_000
"""Steps of the run, and steps between two energies."""

SPANS = (20_000, 100_000, 1_000_000, 10_000_000, 100_000_000)
"""Steps over which changes of the energy are told: there are ten of the longest."""


def part_energy(repetitions: int, steps: int = STEPS) -> dict[str, Any]:
    """The energy of Sun and eight planets over a thousand million steps of 3 days, 8.2 million years, by the default
    map on one thread: the root mean square of its relative change over spans of the run. That of a random walk grows
    with the square root of the number of steps, that of a drift with the number itself. Energies are computed from the
    states and their low parts in 80-bit floats. `python scripts/benchmark.py energy` runs this part; `make bench` does
    not.
    """
    gm, q, v, _ = ten_bodies_data()
    run = marcher(orbits.WisdomHolman(), gm[:9], q[:9], v[:9], H)
    run.compile()
    energies = [energy(gm[:9], run.checkpoint(seen=True))]
    begun = time.perf_counter()
    for _ in range(steps // EVERY):
        run.advance(EVERY)
        energies.append(energy(gm[:9], run.checkpoint(seen=True)))
    seconds = time.perf_counter() - begun
    errors = np.array([float(one / energies[0] - 1) for one in energies])
    return told(errors, seconds)


def told(errors: np.ndarray, seconds: float) -> dict[str, Any]:
    """Return the rows, and what is said with them."""
    spans = np.array([span for span in SPANS if span // EVERY < len(errors)])
    rms = np.array([change(errors, span // EVERY) for span in spans])
    steps = EVERY * (len(errors) - 1)
    growth = float(np.polyfit(np.log(spans), np.log(rms), 1)[0]) if len(spans) > 1 else float("nan")
    return {
        "rows": [{"steps": int(n), "years": n * H / YEAR, "RMS change": x} for n, x in zip(spans, rms, strict=True)],
        "growth_with_steps_to_the_power": growth,
        "largest_error": float(np.abs(errors).max()),
        "error_at_the_end": float(errors[-1]),
        "ns_a_step": 1e9 * seconds / steps,
        "picture": partial(draw, errors),
    }


def change(errors: np.ndarray, samples: int) -> float:
    """Return the RMS change over spans of so many samples, from every sample on."""
    return float(np.sqrt(np.mean((errors[samples:] - errors[:-samples]) ** 2)))


def energy(gm: np.ndarray, state: Any) -> np.longdouble:
    """Return the energy, times G, of a state with its low parts."""
    m, n = gm.astype(np.longdouble), len(gm)
    x, u = (
        np.asarray(state[name])[: 3 * n].reshape(3, n).T.astype(np.longdouble)
        + np.asarray(state[f"{name}_lo"])[: 3 * n].reshape(3, n).T
        for name in ("q", "v")
    )
    i, j = np.triu_indices(n, 1)
    pairs = m[i] * m[j] / np.sqrt(((x[i] - x[j]) ** 2).sum(axis=1))
    return (m[:, None] * u * u).sum() / 2 - pairs.sum()


def draw(errors: np.ndarray, rows: list[dict[str, Any]], path: Path) -> None:
    """Draw the error over time, and its change over spans of all lengths."""
    spans = np.unique(np.geomspace(1, (len(errors) - 1) // 4, 40).astype(int))
    with look():
        made = figure(15.0, 6.0)
        left, right = made.subplots(1, 2, width_ratios=[1.35, 1.0])
        left.plot(np.arange(len(errors)) * EVERY * H / YEAR / 1e6, errors * 1e15, lw=0.6, color=BLUE)
        left.axhline(0.0, color=GREY, lw=0.8)
        left.set(xlabel="million years", ylabel="relative error of the energy [10⁻¹⁵]", title="one run")
        rms = [change(errors, int(n)) for n in spans]
        right.plot(spans * EVERY, rms, "o", ms=5, color=BLUE, label="RMS change of the energy")
        root = rms[0] * np.sqrt(spans / spans[0])
        right.plot(spans * EVERY, root, color=INK, lw=1.4, label="square root of the number of steps")
        right.axhline(2.0**-53, color=GREY, lw=1.2, ls=":", label="2⁻⁵³")
        right.set(xscale="log", yscale="log", xlabel="steps", title="over spans of all lengths")
        handles, labels = right.get_legend_handles_labels()
        below(made, handles, labels)
        save(made, path)
