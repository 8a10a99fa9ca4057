"""Reports that were never measured, for tests of what shows them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from orbits.regression.report import ReferenceNote, Report, Row, Series

NINE = [f"Planet {i}" for i in range(9)]
TIMES = np.linspace(0.0, 100.0, 11)


def series(size):
    return Series(size * TIMES / 100, size * TIMES / 1000, size * TIMES * 10)


def make(names, massive, *, rows=None, length_unit="km"):
    positions = {name: 0.25 * (i + 1) for i, name in enumerate(names)}
    if rows is None:
        ours = Row("Gauss(stages=8)", "ours", "ok", 1000, 0.2, 1.5, 1e-15, 2e-16, 0.5, names[-1], positions)
        peer = Row("REBOUND whfast-corrector17", "peer", "peer", 1_234_567, 12.5, None, 1e-9, 0.0, 1.5e8, names[0])
        rows = (
            replace(ours, series=series(1e-15)),
            replace(peer, positions=positions, series=series(1e-9)),
            Row("REBOUND whfast", "peer", "n/a", note="it needs one body that outweighs all the others."),
        )
    return Report(
        rows=rows,
        times=TIMES,
        time_unit="yr",
        length_unit=length_unit,
        names=tuple(names),
        massive=tuple(massive),
        followed="worst of the massive bodies",
        reference=ReferenceNote("converged", "Gauss(stages=8) at dt = 1 d", dict.fromkeys(names, 2e-4)),
        settings={"title": "A test", "dt": 6.0},
        notes=("A remark.",),
    )
