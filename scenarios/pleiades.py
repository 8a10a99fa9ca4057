"""The Pleiades: seven stars in a plane with close encounters, compared with published values at t = 3.

The masses are 1 to 7, so methods that split off a central body are of no use, and the errors of each encounter affect
the next one. Gauss with 8 stages and 2,400 equal steps ends within 1e-11 of the reference; with 9,600 only the rounding
of the states is left. With 263 steps that are chosen one by one, and separations in doubled precision, it ends on the
last digit of the reference. REBOUND's IAS15 chooses 400 steps.

Source: Hairer, Nørsett & Wanner (1993), sec. II.10; end values from the Test Set for IVP Solvers (Bari).
"""

import json
from itertools import combinations

import numpy as np

import orbits
from orbits.errors import ConvergenceError
from orbits.regression import peers
from orbits.resources import data_path
from orbits.scenario import Check, Study, StudyResult, Table

END = 3.0
STEPS = (300, 600, 1200, 2400, 4800, 9600, 19200)
METHODS = [
    orbits.methods.RungeKutta4(),
    orbits.StormerVerlet(),
    *(orbits.Gauss(stages=s) for s in (2, 4, 8)),
]
DEMANDS = {"Gauss(stages=8)": (2400, 1e-10), "Gauss(stages=4)": (9600, 1e-9), "StormerVerlet()": (19200, 0.03)}
"""So many steps, and the largest error of a position that they may leave: 6e-12, 1.5e-10 and 0.009 were reached."""
ROUND_OFF = 4e-13
"""For 9,600 steps of Gauss(stages=8): 1.6e-13 was reached, and 2e-14 to 1.6e-13 with 9,580 to 9,620 steps. Meetings
enlarge a rounding of 1e-16 some hundred to a thousand times."""


ADAPTIVE = 1e-14
"""For steps chosen one by one, with positions in doubled precision: 1.5e-15 was reached."""


def stars():
    """The seven stars at the start, and their published positions and velocities at t = 3, (7, 2) each."""
    data = json.loads(data_path("pleiades.json").read_text(encoding="utf-8"))
    flat = np.zeros(7)
    q, v = (np.column_stack([data[x], data[y], flat]) for x, y in (("x0", "y0"), ("vx0", "vy0")))
    names = [f"star {m}" for m in range(1, 8)]
    system = orbits.System(names, np.arange(1.0, 8.0), q, v, units=orbits.DIMENSIONLESS)
    x, y, vx, vy = np.array(data["published"]).reshape(4, 7)
    return system, np.column_stack([x, y]), np.column_stack([vx, vy])


def run_of(system, method, steps, samples=2):
    """March to t = 3, with steps that are too long as well: what comes of them is the point."""
    return orbits.propagate(
        system, method, dt=END / steps, duration=END, samples=samples, check_step=False, progress=False
    )


def experiment(say):
    """Every method with ever more steps, and IAS15, against the published values."""
    system, q, v = stars()
    rows, checks, curves = [], [], {}
    for method in METHODS:
        say(method.label)
        curves[method.label] = []
        for steps in STEPS:
            try:
                run = run_of(system, method, steps)
            except ConvergenceError:
                rows.append([method.label, steps, None, "did not converge", None, None])
                continue
            off_q, off_v = (float(np.abs(a.value[-1, :, :2] - b).max()) for a, b in ((run.q, q), (run.v, v)))
            drift = run.drift()
            rows.append([method.label, steps, run.statistics.evaluations, off_q, off_v, drift.energy.max_fraction])
            curves[method.label].append((steps, run.statistics.evaluations, off_q))
            checks += judged(method, steps, off_q, drift)
    say("REBOUND ias15")
    x = system.values
    peer = peers.run("ias15", x, times=np.array([END]), dt=0.001)
    off_q, off_v = (float(np.abs(a[-1, :, :2] - b).max()) for a, b in ((peer.q, q), (peer.v, v)))
    energy = orbits.diagnostics.energy(x.gm, np.stack([x.q, peer.q[0]]), np.stack([x.v, peer.v[0]]))
    rows.append(["REBOUND ias15", peer.steps, None, off_q, off_v, float(abs(energy[1] / energy[0] - 1.0))])
    say("Gauss(stages=8), adaptive")
    chosen = orbits.propagate(system, orbits.Gauss(stages=8), duration=END, samples=2, progress=False)
    own_q, own_v = (float(np.abs(a.value[-1, :, :2] - b).max()) for a, b in ((chosen.q, q), (chosen.v, v)))
    cost, change = chosen.statistics, chosen.drift().energy.max_fraction
    rows.append(["Gauss(stages=8), adaptive", cost.steps, cost.evaluations, own_q, own_v, change])
    claim = "Gauss(stages=8) with adaptive steps ends at the reference"
    checks.append(Check(claim, own_q < ADAPTIVE, f"{own_q:.1e} with {cost.steps:,} steps, IAS15 {off_q:.1e}"))
    say("the paths in detail")
    path = run_of(system, orbits.Gauss(stages=8), 9600, samples=6001)
    table = Table(
        "Seven stars at t = 3 against the published values",
        ["method", "steps", "forces", "error of q", "error of v", "|dE/E| then"],
        rows,
    )
    return StudyResult(
        tables=[table],
        checks=checks,
        figures={"pleiades": lambda: draw(path, curves, (peer.steps, off_q), (cost.steps, own_q))},
    )


def judged(method, steps, off_q, drift):
    """Yield what is demanded of a method with so many steps."""
    if (method.label, steps) in {(label, n) for label, (n, _) in DEMANDS.items()}:
        bound = DEMANDS[method.label][1]
        yield Check(f"{method.label} with {steps:,} steps ends within {bound:g}", off_q < bound, f"{off_q:.1e}")
    if method.label == "Gauss(stages=8)" and steps == 9600:
        yield Check(f"{method.label} with {steps:,} steps ends at the reference", off_q < ROUND_OFF, f"{off_q:.1e}")
    if steps == STEPS[-1]:
        change = drift.angular_momentum.max_fraction
        if method.variational:
            # 1.3e-16 at most was reached.
            yield Check(f"{method.label} keeps angular momentum", change < 2e-15, f"{change:.1e}")
        else:
            yield Check(f"{method.label} loses angular momentum", change > 1e-11, f"{change:.1e}")


def meetings(path):
    """Distances of all pairs at every sample, (pairs, samples), and the pairs."""
    pairs = list(combinations(range(7), 2))
    q = path.q.value
    return pairs, np.array([np.linalg.norm(q[:, i] - q[:, j], axis=1) for i, j in pairs])


def draw(path, curves, peer, chosen):
    """The paths, ringed where stars meet; error against steps; the distance of the closest pair against time."""
    from orbits import plotting

    style = plotting.style
    figure = plotting.figure(17, 9.6)
    axes = figure.subplot_mosaic([["paths", "errors"], ["paths", "closest"]], width_ratios=[1.12, 1.0])
    panel, q = axes["paths"], path.q.value
    for i, name in enumerate(path.names):
        colour = style.PALETTE[i]
        panel.plot(q[:, i, 0], q[:, i, 1], color=colour, lw=1.8, alpha=0.9)
        panel.plot(*q[0, i, :2], "o", ms=5, mfc="white", mec=colour, mew=1.5)
        panel.plot(*q[-1, i, :2], "o", ms=5 + 1.6 * (i + 1), color=colour, mec="white", mew=1.2, zorder=5)
        away = q[-1, i, :2] - q[-40, i, :2]
        place = {"xytext": tuple(18 * away / np.linalg.norm(away)), "textcoords": "offset points"}
        plotting.halo(panel.annotate(name[5:], q[-1, i, :2], ha="center", va="center", fontsize=15, zorder=6, **place))
    pairs, distance = meetings(path)
    for (i, j), row in zip(pairs, distance, strict=True):
        for k in np.flatnonzero((row[1:-1] < row[:-2]) & (row[1:-1] < row[2:]) & (row[1:-1] < 0.2)) + 1:
            panel.plot(*(q[k, i, :2] + q[k, j, :2]) / 2, "o", ms=17, mfc="none", mec=style.INK, mew=1.2, zorder=4)
    panel.set(xlabel="x", ylabel="y")
    panel.set_aspect("equal", adjustable="datalim")
    panel.set_title("from t = 0 (open) to t = 3; rings: closer than 0.2")
    axis = axes["errors"]
    for k, (label, points) in enumerate(curves.items()):
        steps, _, error = np.array(points).T
        axis.plot(steps, error, "osD^v"[k] + "-", color=style.PALETTE[k], ms=7,
                  label=plotting.method_words(label))  # fmt: skip
    axis.plot(*peer, "*", ms=19, color=style.INK, label="REBOUND ias15,\nits own steps")
    axis.plot(*chosen, "*", ms=19, color=style.PALETTE[4], mec="white", label="Gauss, 8 stages,\nadaptive")
    axis.axhspan(1e-16, 1.8e-15, color=style.FAINT, alpha=0.8, lw=0)
    axis.text(STEPS[0], 2.4e-15, "digits of the reference", color=style.GREY, fontsize=13)
    axis.set(xscale="log", yscale="log", xlabel="steps", ylim=(4e-16, 300))
    axis.set_title("error of the positions at t = 3")
    axis.grid(axis="y", color=style.FAINT, lw=0.6)
    axis.legend(fontsize=13, loc="center left", bbox_to_anchor=(1.0, 0.5))
    axis = axes["closest"]
    nearest = distance.argmin(axis=0)
    shown = [k for k in np.unique(nearest) if distance[k].min() < 0.2]
    for n, k in enumerate(shown):
        low = np.where(nearest == k, distance[k], np.nan)
        i, j = pairs[k]
        axis.plot(path.t.value, low, color=style.PALETTE[n % 8], lw=2.2, label=f"{i + 1} and {j + 1}")
    axis.plot(path.t.value, distance.min(axis=0), color=style.FAINT, lw=5, zorder=1, label="any other pair")
    axis.set(yscale="log", xlabel="t", ylabel="distance", title="the closest pair")
    axis.grid(axis="y", color=style.FAINT, lw=0.6)
    axis.legend(fontsize=13, loc="center left", bbox_to_anchor=(1.0, 0.5))
    figure.suptitle("The Pleiades: seven stars of masses 1 to 7", fontsize=21, fontweight="bold")
    return figure


scenario = Study(
    name="pleiades",
    title="The Pleiades: seven stars that meet closely, against published values",
    experiment=experiment,
    certifies=[(stars()[0], method, 0.001) for method in METHODS],
)

if __name__ == "__main__":
    scenario.main()
