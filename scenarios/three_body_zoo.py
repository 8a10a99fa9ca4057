"""Sixteen periodic orbits of three equal masses, without dt: butterflies, moths, goggles, yarn, and how they close.

The published digits of the figure eight close to 1.5e-11; those of the fifteen orbits of Šuvakov and Dmitrašinović
close only to about a thousandth, and this closure, known from forty-digit arithmetic, must be reproduced. In three of
them bodies pass so closely that eight million equal steps do not resolve it; 3,400 to 11,100 steps that are chosen one
by one do. REBOUND's IAS15 stands beside, and a Taylor series with 31 digits measures both.

Sources: Chenciner & Montgomery (2000); Šuvakov & Dmitrašinović (2013), PRL 110, 114301, and (2014), Am. J. Phys. 82,
609.
"""

import json

import numpy as np

import orbits
from orbits.regression import peers
from orbits.regression.taylor import taylor
from orbits.resources import data_path
from orbits.scenario import Check, Study, StudyResult, Table

METHOD, STEPS = orbits.Gauss(stages=8), orbits.Adaptive()
DRAWN = 6001
"""Points of a drawn path."""
CLOSED, ROUNDING = 1e-7, 5e-15
"""What closures may differ by from the known ones: as a fraction, and by rounding. 1.3e-8 at most was reached."""
CLOSE, ERRORS = 1e-3, (2e-12, 5e-11)
"""Bounds of the error after a period: of orbits without passages closer than this, and with them. 6e-13 and 6e-12 were
reached, 7e-12 and 3e-7 by IAS15."""


def published():
    """Name, system, period and closure (q, v) of every orbit of the data file; the figure eight first."""
    rows = json.loads(data_path("three_body_periodic.json").read_text(encoding="utf-8"))["published"]
    for row in sorted(rows, key=lambda row: not row["name"].startswith("figure-8")):
        p = np.array([float(row["p1"]), float(row["p2"]), 0.0])
        q = [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
        bodies = orbits.System(
            ["first", "second", "third"], np.ones(3), q, [p, p, -2 * p], units=orbits.DIMENSIONLESS
        )
        name = "figure eight" if row["name"].startswith("figure-8") else row["name"]
        yield name, bodies, float(row["T"]), (row["closure_pos"], row["closure_vel"])


def off(start, q, v):
    """Largest component of q and of v that differs from the start."""
    return float(np.abs(q - start.q).max()), float(np.abs(v - start.v).max())


def experiment(say, dt):
    """Every orbit for one period: ours, with steps dt, IAS15 and the Taylor series."""
    rows, checks, drawn = [], [], []
    for name, system, period, known in published():
        say(f"{name}: T = {period:.4g}")
        x, end = system.values, np.array([period])
        run = orbits.propagate(system, METHOD, dt=dt, duration=period, samples=end, progress=False)
        peer, truth = peers.run("ias15", x, times=end, dt=1e-3), taylor(x, end)
        closure = off(x, run.q.value[-1], run.v.value[-1])
        error, peer_error = (float(np.abs(truth.from_positions(q)).max()) for q in (run.q.value, peer.q))
        nearest = min(float(each.distance.value) for body in system.names for each in run.closest_approaches()[body])
        rows.append([name, period, nearest, run.statistics.steps, peer.steps, closure[0], known[0], error, peer_error])
        checks += judged(name, closure, known, error, nearest)
        drawn.append((name, system, period, closure[0], dt))
    columns = ["orbit", "period", "closest", "steps", "IAS15", "closure", "known", "error of q", "IAS15"]
    return StudyResult(
        tables=[Table(f"One period by {run.made_by}", columns, rows)],
        checks=checks,
        figures={"three_body_zoo": lambda: draw(drawn)},
    )


def judged(name, closure, known, error, nearest):
    """Yield what must hold of an orbit."""
    miss = max(abs(a - b) - ROUNDING for a, b in zip(closure, known, strict=True))
    claim = f"{name} closes as its digits do in forty digits"
    yield Check(claim, miss < CLOSED * min(known), f"{closure[0]:.9g}, {known[0]:.9g}")
    bound = ERRORS[nearest < CLOSE]
    yield Check(f"{name} ends within {bound:g} of the Taylor series", error < bound, f"{error:.1e}")


def draw(drawn):
    """All orbits, one panel each, a colour for each body."""
    from orbits import plotting

    style = plotting.style
    figure = plotting.figure(16, 16.4)
    axes = figure.subplots(4, 4)
    for axis, (name, system, period, closure, dt) in zip(axes.flat, drawn, strict=True):
        path = orbits.propagate(system, METHOD, dt=dt, duration=period, samples=DRAWN, progress=False).q.value
        width = 1.1 if period < 40.0 else 0.7 if period < 70.0 else 0.3
        for body, colour in enumerate((style.BLUE, style.VERMILION, style.GREEN)):
            axis.plot(path[:, body, 0], path[:, body, 1], color=colour, lw=width, alpha=0.85)
            axis.plot(*path[0, body, :2], "o", color=colour, ms=8, mec="white", mew=1.0, zorder=4)
        axis.set_title(f"{name}\nT = {period:.4g}, closes to {closure:.1e}", loc="center", fontsize=14)
        axis.set_aspect("equal", adjustable="datalim")
        axis.axis("off")
    plotting.below(figure, [], [], "one period T of each, from the discs; sizes differ from panel to panel")
    figure.suptitle("Periodic orbits of three equal masses", fontsize=21, fontweight="bold")
    return figure


scenario = Study(
    name="three_body_zoo",
    title="Sixteen periodic orbits of three equal masses, and how they close",
    experiment=experiment,
    dt=STEPS,
    certifies=[(system, METHOD, 0.05) for name, system, *_ in published() if name == "figure eight"],
)

if __name__ == "__main__":
    scenario.main()
