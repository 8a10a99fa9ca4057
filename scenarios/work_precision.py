"""Work and precision: every method of the package and REBOUND's on three problems, error against cost.

Kepler's problem with e = 0.6 for 100 periods against the exact orbit; Sun, planets and Pluto for a century against a
quadruple-precision reference; 200 asteroids among the planets for ten years. Each method takes ever shorter steps
until its error no longer falls or a run takes long. Cost is time in the integrating loop, without compiling, and calls
of the forces among the massive bodies.

Methods come from the registry: one that is added appears here. Times are those of one run on a machine that may do
other things; `make bench` measures speed.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from astropy import units as u

import orbits
from orbits.errors import IntegrationError
from orbits.integrators import registry
from orbits.lagrangians.newtonian import newtonian
from orbits.regression import peers
from orbits.resources import data_path
from orbits.scenario import Check, Study, StudyResult, Table

LEFT_OUT = ("implicit-midpoint", "vprk", "lobatto-iiib-iiia", "composition")
"""Registered methods whose examples are left out: Gauss(1) by another name, pairs of one's own, the mirror of Lobatto
IIIA-IIIB, and compositions, which come with their default schemes instead."""
RATIO = np.sqrt(2.0)
SECONDS = 0.15
"""A method's steps are made no shorter once a run takes longer than this."""
PEERS = ("leapfrog", "whfast", "whfast-corrector17", "saba-10-6-4", "ias15")
EVALUATIONS = {"leapfrog": 1, "whfast": 1, "whfast-corrector17": 1}
"""Of a step of a peer; correctors count at the samples only. The others' are not told by REBOUND."""
ASTEROIDS = 200
TOO_FAR = 1.0
"""Errors above this, in the unit of lengths, are not shown."""


@dataclass(frozen=True)
class Problem:
    """A system, when it is looked at, and how the error is measured then.

    times : of the samples, the last one the end; dt : the longest step
    error : a function of the positions (samples, bodies, 3), in `unit`
    """

    name: str
    system: Any
    times: Any
    dt: float
    error: Callable[[Any], float]
    unit: str


def kepler():
    """Two bodies, a = GM = 1, e = 0.6, for a hundred periods."""
    from orbits.elements.two_body import two_body

    bodies = {
        "star": {"gm": 0.999},
        "planet": {"gm": 0.001, "a": 1.0, "e": 0.6, "inc": 0.5, "Omega": 0.7, "omega": 0.4},
    }
    system = orbits.System.from_elements(bodies, units=orbits.DIMENSIONLESS)
    x, times = system.values, 2.0 * np.pi * np.linspace(99.0, 100.0, 9)  # the last period: a single end may be lucky
    exact, _ = two_body(x.q[1] - x.q[0], x.v[1] - x.v[0], x.gm.sum(), times)

    def error(q):
        return float(np.linalg.norm(q[:, 1] - q[:, 0] - exact, axis=1).max())

    return Problem("Kepler, e = 0.6, 100 periods", system, times, 2.0 * np.pi / 24, error, "a")


def solar_system():
    """Sun, planets and Pluto for a hundred years, held to the reference of the data file."""
    data = json.loads(data_path("solar_system_10body.json").read_text(encoding="utf-8"))
    system = orbits.System(data["names"], data["gm_au3_d2"], data["q"], data["v"], units=orbits.SOLAR)
    truth = np.array([[float(x) for x in row[:3]] for row in data["reference_years"]["100"]])

    def error(q):
        return float(np.linalg.norm(q[-1] - truth, axis=1).max())

    return Problem("Sun, planets, Pluto, 100 years", system, np.array([36525.0]), 12.0, error, "au")


def belt():
    """Asteroids among the planets for ten years; the reference is Gauss(8) with steps of half a day."""
    system = orbits.System.solar_system(epoch="2022-08-09").add_particles(orbits.asteroids(ASTEROIDS))
    fine = orbits.propagate(
        system, orbits.Gauss(stages=8), dt=0.5, duration=3652.5, samples=2, check_step=False, progress=False
    ).q.to_value(u.au)[-1]
    particles = system.values.gm == 0.0

    def error(q):
        return float(np.sqrt(np.mean(np.sum((q[-1] - fine)[particles] ** 2, axis=1))))

    return Problem(f"{ASTEROIDS} asteroids, 10 years", system, np.array([3652.5]), 48.0, error, "au")


def methods():
    """The registered methods for bodies, and compositions with the default scheme of each order."""
    for name, cls in registry().items():
        if name in LEFT_OUT:
            continue
        seen = set()
        for method in cls.examples():
            if method.serves(newtonian) and method.order not in seen and method.label != "LobattoIIIAB(stages=2)":
                seen.add(method.order)
                yield method
    for order in (4, 6, 8, 10):
        yield orbits.methods.Composition(orbits.StormerVerlet(), order=order)


def sweep(problem, take):
    """Rows (dt, error, seconds, evaluations) of ever shorter steps; `take` gives positions, seconds, evaluations."""
    rows, best, stuck = [], np.inf, 0
    dt = problem.dt
    while stuck < 4 and (not rows or rows[-1][2] < SECONDS):
        try:
            step = float(np.float32(dt))
            q, seconds, evaluations = take(step)
            for _ in range(2 if seconds < SECONDS / 4 else 0):  # short runs are soon disturbed: the best of three
                seconds = min(seconds, take(step)[1])
            error = problem.error(q)
        except IntegrationError:
            error, seconds, evaluations = np.inf, 0.0, 0
        if error < TOO_FAR:
            rows.append((float(np.float32(dt)), error, seconds, evaluations))
            stuck = 0 if error < 0.7 * best else stuck + 1
            best = min(best, error)
        elif seconds > SECONDS:
            break
        dt /= RATIO
    return rows


def by_ours(problem, method):
    """A function of dt: one run with this method."""

    def take(dt):
        run = orbits.propagate(
            problem.system,
            method,
            dt=dt,
            duration=problem.times[-1],
            samples=problem.times,
            check_step=False,
            progress=False,
        )
        cost = run.statistics
        return run.q.value, cost.wall_time, cost.evaluations

    return take


def by_peer(problem, name):
    """The same with REBOUND; evaluations are 0 where they are not known."""
    x = problem.system.values

    def take(dt):
        run = peers.run(name, x, times=problem.times, dt=dt)
        return run.q, run.wall_s, run.steps * EVALUATIONS.get(name, 0)

    return take


def experiment(say):
    """Sweep every method over its steps on every problem."""
    tables, checks, curves = [], [], {}
    for problem in (kepler(), solar_system(), belt()):
        rows, found = [], {}
        for method in methods():
            say(f"{problem.name}: {method.label}")
            found[method.label] = (method, sweep(problem, by_ours(problem, method)))
        for name in PEERS:
            say(f"{problem.name}: REBOUND {name}")
            take = by_peer(problem, name)
            if name == "ias15":
                q, seconds, _ = take(problem.dt / 8)
                found[f"REBOUND {name}"] = (None, [(None, problem.error(q), seconds, 0)])
            else:
                found[f"REBOUND {name}"] = (None, sweep(problem, take))
        for label, (method, points) in found.items():
            if points:
                dt, error, seconds, evaluations = min(points, key=lambda row: row[1])
                order = measured(points) if method else None
                rows.append([label, order, dt, error, seconds, evaluations or None])
        columns = ["method", "order seen", "best at dt", f"error [{problem.unit}]", "seconds", "forces"]
        tables.append(Table(problem.name, columns, rows))
        checks += judged(problem, found)
        curves[problem.name] = (problem, found)
    return StudyResult(
        tables=tables,
        checks=checks,
        figures={"work_precision": lambda: draw(curves)},
        record={name: {label: points for label, (_, points) in found.items()} for name, (_, found) in curves.items()},
    )


def measured(points):
    """The order seen in a sweep; None where no part of it is straight."""
    if len(points) < 4:
        return None
    dt, error, *_ = np.array(points, dtype=float).T
    order = orbits.diagnostics.convergence(dt, error).order
    return None if np.isnan(order) else round(float(order), 2)


def judged(problem, found):
    """Yield what must hold of accuracy; of speed nothing is demanded."""
    best = {label: min((row[1] for row in points), default=np.inf) for label, (_, points) in found.items()}
    ours, theirs = best["Gauss(stages=8)"], best["REBOUND ias15"]
    # Single runs: round-off is luck of a factor of three either way.
    claim = f"{problem.name}: Gauss(stages=8) is as accurate as IAS15"
    yield Check(claim, ours < 3.0 * theirs, f"{ours:.1e}, {theirs:.1e} {problem.unit}")
    if problem.name.startswith("Kepler"):
        for label, (method, points) in found.items():
            # RK4 shows the power 5: the energy that it loses, h^5 a step, delays it by the square of time.
            judged_by_order = method is not None and method.variational and 2 <= method.order <= 8
            order = measured(points) if judged_by_order else None
            if order is not None:
                off = abs(order - method.order) / method.order
                yield Check(f"{label}: errors fall with the power {method.order}", off < 0.15, f"{order:.2f}")


FAMILIES = {
    "gauss": "BLUE", "composition": "ORANGE", "lobatto-iiia-iiib": "GREEN", "stormer-verlet": "VERMILION",
    "symplectic-euler": "PURPLE",
}  # fmt: skip
SHADES = {2: 0.6, 4: 0.4, 6: 0.0, 8: -0.35, 10: -0.65, 16: -0.65}
"""Of families with several orders: the part of white, or of black if negative, mixed with the family's colour."""
MARKERS = {1: "v", 2: "o", 4: "s", 6: "D", 8: "^", 10: "P", 16: "*"}
PEER_MARKERS = dict(zip(PEERS, "xos^*", strict=True))


def draw(curves):
    """Error against seconds and against evaluations, one column for each problem; colours are families."""
    from matplotlib.lines import Line2D

    from orbits import plotting

    style = plotting.style
    figure = plotting.figure(17, 12)
    axes = figure.subplots(2, len(curves))
    handles = {}
    for k, (name, (problem, found)) in enumerate(curves.items()):
        for label, (method, points) in found.items():
            if not points:
                continue
            _, error, seconds, evaluations = np.array([[row[0] or 0.0, *row[1:]] for row in points]).T
            look = appearance(label, method)
            handles.setdefault(plotting.method_words(label), Line2D([], [], **look))
            error = np.maximum(error, 1e-17)
            axes[0, k].plot(seconds, error, **look)
            if evaluations.all():
                axes[1, k].plot(evaluations, error, **look)
        axes[0, k].set(title=name, xlabel="seconds")
        axes[1, k].set(xlabel="evaluations of the forces")
        for axis in axes[:, k]:
            axis.set(xscale="log", yscale="log", ylabel=f"error at the end [{problem.unit}]")
            axis.grid(color=style.FAINT, lw=0.5)
    told = "SABA and IAS15:\nnot counted\nby REBOUND"
    axes[1, 0].text(0.03, 0.6, told, transform=axes[1, 0].transAxes, va="center", color=style.GREY, fontsize=13)
    told = "each mark is a run; marks tell the order, colours the family; black and open: REBOUND"
    plotting.below(figure, list(handles.values()), list(handles), told)
    figure.suptitle("Work and precision: every method, ever shorter steps", fontsize=21, fontweight="bold")
    return figure


def appearance(label, method):
    """Colour by family, darker and with another marker by order; peers black and dashed, their markers open."""
    from matplotlib.colors import to_rgb

    from orbits.plotting import style

    if method is None:
        name = label.split()[-1]
        alone = name == "ias15"
        return {
            "color": style.INK, "ls": "" if alone else (0, (4, 2)), "lw": 1.2,
            "marker": PEER_MARKERS[name], "ms": 16 if alone else 8, "mfc": style.INK if alone else "white",
        }  # fmt: skip
    colour = getattr(style, FAMILIES.get(method.name, "GREY"))
    if method.name in ("composition", "gauss", "lobatto-iiia-iiib"):
        part = SHADES.get(method.order, 0.0)
        colour = tuple((1.0 - abs(part)) * np.array(to_rgb(colour)) + max(part, 0.0))
    return {"color": colour, "lw": 1.5, "marker": MARKERS.get(method.order, "h"), "ms": 6, "alpha": 0.9}


scenario = Study(
    name="work_precision",
    title="Work and precision: every method and REBOUND's on three problems",
    experiment=experiment,
)

if __name__ == "__main__":
    scenario.main()
