"""Measure speed, accuracy, start-up and memory; write JSON and the Markdown tables of docs/benchmarks.md.

    make bench                                     all that does not take long, about seven minutes
    python scripts/benchmark.py ten_bodies         one part; --help lists them
    python scripts/benchmark.py ten_bodies --docs  one part, and its section of docs/benchmarks.md

Peers run in the same process, alternating with ours, one core unless said; compile time is measured apart. The figure
is the median over the repetitions, the accuracy the root mean square over rotated starts, each against where that
start, rounded as it is, leads in quadruple precision.
"""

from __future__ import annotations

import argparse
import json
import platform
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.adaptive import part_adaptive, part_crossers, part_drift, part_light_bodies, part_precision
from benchmarks.bodies import part_explicit, part_kepler, part_large, part_particles, part_ten_bodies, part_threads
from benchmarks.energy import part_energy
from benchmarks.ensemble import part_ensemble
from benchmarks.error_bars import part_error_bars
from benchmarks.jacobi_constant import part_jacobi
from benchmarks.map_particles import part_map_particles
from benchmarks.native import Native
from benchmarks.physics import part_physics
from benchmarks.planets import part_planets
from benchmarks.processes import (
    part_calls,
    part_lagrangians,
    part_memory,
    part_pendulum,
    part_samples,
    part_start,
    part_symbolic,
)
from benchmarks.rotation import part_rotation
from benchmarks.scattering import part_scattering
from benchmarks.small_bodies import part_small_bodies

import orbits
from orbits.kernels.compile import cpu_features, cpu_name
from orbits.marching.legs.leg import available_threads

ROOT = Path(__file__).resolve().parent.parent
FIGURES = ROOT / "docs" / "figures"


BY_HAND = "## How close to the machine"
"""The heading in docs/benchmarks.md from which on the page is not written by this script."""


PARTS = {
    "ten_bodies": part_ten_bodies,
    "planets": part_planets,
    "map_particles": part_map_particles,
    "ensemble": part_ensemble,
    "physics": part_physics,
    "energy": part_energy,
    "adaptive": part_adaptive,
    "light_bodies": part_light_bodies,
    "crossers": part_crossers,
    "jacobi": part_jacobi,
    "scattering": part_scattering,
    "drift": part_drift,
    "precision": part_precision,
    "particles": part_particles,
    "ephemeris": part_small_bodies,
    "explicit": part_explicit,
    "threads": part_threads,
    "large": part_large,
    "calls": part_calls,
    "samples": part_samples,
    "start": part_start,
    "memory": part_memory,
    "kepler": part_kepler,
    "lagrangians": part_lagrangians,
    "symbolic": part_symbolic,
    "pendulum": part_pendulum,
    "rotation": part_rotation,
    "error_bars": part_error_bars,
}

LONG = {"energy", "ensemble", "error_bars"}
"""Parts that take minutes each, and are only run when they are named."""


def machine() -> dict[str, Any]:
    """What was measured on."""
    import numba

    versions = {"python": platform.python_version(), "numba": numba.__version__, "numpy": np.__version__}
    for name in ("rebound", "heyoka"):
        try:
            versions[name] = str(__import__(name).__version__)
        except ImportError:
            versions[name] = "not installed"
    lanes = "AVX-512" if "avx512f" in cpu_features() else "no AVX-512"
    return {
        "processor": f"{cpu_name()}, {lanes}, {available_threads()} cores",
        "orbits": orbits.__version__,
        **versions,
    }


def _cell(value: Any) -> str:
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: "-"}[value]
    if isinstance(value, float):
        return f"{value:.3g}"
    return str(value)


def markdown(results: dict[str, Any]) -> str:
    """Return the results as a page of tables."""
    facts = ", ".join(f"{k} {v}" for k, v in results["machine"].items() if k != "processor")
    lines = ["# Benchmarks", "", f"Made by `make bench` on {results['machine']['processor']}; {facts}.", ""]
    for name, part in results["parts"].items():
        lines += [title(name), "", " ".join(str(PARTS[name].__doc__).split()), ""]
        if "picture" in part:
            lines += [f"![{title(name)[3:]}](figures/{name}.png)", ""]
        rows = [
            {
                **{k: x for k, x in row.items() if k != "rms_km"},
                **{f"{k} km": x for k, x in row.get("rms_km", {}).items()},
            }
            for row in part["rows"]
        ]
        head = list(dict.fromkeys(key for row in rows for key in row))
        lines += ["| " + " | ".join(h.replace("_", " ") for h in head) + " |", "|" + " --- |" * len(head)]
        lines += ["| " + " | ".join(_cell(row.get(h)) for h in head) + " |" for row in rows]
        notes = {k: x for k, x in part.items() if k not in ("rows", "picture")}
        if notes:
            lines += ["", "; ".join(f"{k.replace('_', ' ')}: {_cell(x)}" for k, x in notes.items()) + "."]
        lines.append("")
    return "\n".join(lines)


def title(name: str) -> str:
    """Return the heading of a part."""
    return f"## {name.replace('_', ' ').capitalize()}"


def merged(page: str, new: str) -> str:
    """Return the page with the sections of `new` in it: instead of those of the same name, or before what is written by
    hand; all else as it is.
    """
    sections = {section.split("\n", 1)[0]: section for section in _sections(new)[1:]}
    out = ""
    for section in _sections(page):
        name = section.split("\n", 1)[0]
        if name == BY_HAND:
            out += "".join(sections.values())
        out += sections.pop(name, section)
    return out


def _sections(page: str) -> list[str]:
    """Return what is before the first heading of the second level, and then each with what follows it."""
    return re.split(r"^(?=## )", page, flags=re.MULTILINE)


def main() -> None:
    """Run the parts asked for and write what they gave."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    what = "which parts; all but those that take minutes, when none is named"
    parser.add_argument("parts", nargs="*", choices=[[], *PARTS], help=what)
    parser.add_argument("--repetitions", type=int, default=7, help="at least 5 for figures to be quoted")
    parser.add_argument(
        "--docs", action="store_true", help="write the tables to docs/benchmarks.md as well: of the parts that were run"
    )
    parser.add_argument(
        "--rebound", type=Path, metavar="FOLDER", help="an installation of REBOUND (pip install --target FOLDER) for "
        "the columns `built here`; by default one from source with -O3 -march=native"
    )  # fmt: skip
    parser.add_argument("--out", type=Path, default=ROOT / "results" / "benchmark", help="folder for JSON and Markdown")
    options = parser.parse_args()
    if options.rebound is not None:
        if not (options.rebound / "rebound" / "__init__.py").is_file():
            parser.error(f"--rebound: {options.rebound} has no folder rebound; expected what pip --target filled.")
        Native.folder = options.rebound.resolve()
    results: dict[str, Any] = {"machine": machine(), "parts": {}}
    for name in options.parts or [name for name in PARTS if name not in LONG]:
        print(f"{name} ...", file=sys.stderr, flush=True)
        part = PARTS[name](options.repetitions)
        draw = part.pop("picture", None)
        if draw is not None:
            folder = FIGURES if options.docs else options.out
            folder.mkdir(parents=True, exist_ok=True)
            draw(part["rows"], folder / f"{name}.png")
            part["picture"] = f"{name}.png"
        results["parts"][name] = part
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "benchmark.json").write_text(json.dumps(results, indent=1) + "\n")
    page = markdown(results)
    (options.out / "benchmark.md").write_text(page)
    if options.docs:
        target = ROOT / "docs" / "benchmarks.md"
        before = target.read_text()
        _, heading, by_hand = before.partition(BY_HAND)
        long = "".join(part for part in _sections(before) if part.split("\n", 1)[0] in map(title, LONG))
        target.write_text(merged(before, page + "\n") if options.parts else f"{page}\n{long}{heading}{by_hand}")
    print(page)


if __name__ == "__main__":
    main()
