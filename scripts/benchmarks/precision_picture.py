"""The picture of work and precision in docs/benchmarks.md."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from orbits.plotting.style import BLUE, GREEN, INK, PURPLE, VERMILION, below, figure, look, save

SERIES = (
    ("tolerance", BLUE, "o", "orbits, no dt"),
    ("epsilon", VERMILION, "s", "REBOUND IAS15"),
    ("heyoka", GREEN, "^", "heyoka"),
    ("heyoka-exact", PURPLE, "v", "heyoka, high accuracy"),
)
DEFAULTS = {"tolerance": "1e-09", "epsilon": "1e-09"}


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Draw the rows of `part_precision`, a panel for each problem, and write the picture."""
    names = list(dict.fromkeys(row["problem"] for row in rows))
    with look():
        made = figure(14.0, 3.9 * ((len(names) + 1) // 2) + 0.8)
        panels = made.subplots((len(names) + 1) // 2, 2, squeeze=False).ravel()
        for panel, name in zip(panels, names, strict=False):
            unit = ", km" if any(word in name for word in ("Apophis", "Sun")) else ""
            panel.set(title=name, xscale="log", yscale="log", xlabel="time, ms", ylabel=f"position error{unit}")
            panel.grid(visible=True, color="#ECECEC")
            for kind, colour, mark, label in SERIES:
                points = [row for row in rows if row["problem"] == name and kind in row]
                x, y = ([row[f"{kind} {what}"] for row in points] for what in ("ms", "error"))
                panel.plot(x, y, color=colour, marker=mark, markersize=6, label=label)
                for row in points:
                    if row[kind] == DEFAULTS.get(kind):
                        panel.plot(row[f"{kind} ms"], row[f"{kind} error"], mark, color=colour, mec=INK, ms=11, mew=1.6)
        for panel in panels[len(names) :]:
            panel.remove()
        handles, labels = panels[0].get_legend_handles_labels()
        below(made, handles, labels, "Down and to the left is better. Large marks: what each does by default.")
        save(made, path)
