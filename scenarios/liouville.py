"""Discrete Liouville: variational methods conserve the area of a loop of initial conditions; Euler and RK4 do not.

Four hundred pendulums start on a circle in the phase plane. The loop that they form is stretched and wound up, but the
area inside, the integral of p dq around it, is conserved to round-off by Störmer–Verlet, symplectic Euler and Gauss; it
grows with explicit Euler, and shrinks with RK4.

Source: Hairer, Lubich & Wanner (2006), sec. I.3, VI.2.
"""

import numpy as np

import orbits
from orbits.diagnostics.loops import area, loop
from orbits.lagrangians.pendulum import pendulum
from orbits.marching.flow import Flow
from orbits.scenario import Check, Study, StudyResult, Table

POINTS = 400
CENTRE, RADIUS = (0.0, 1.2), 0.5
LENGTH = 12.0  # in time; the small swings take 2 pi
SHOWN = (0.0, 2.0, 4.0, 8.0, 12.0)
ROUND_OFF = 5e-15
"""Of a sum over 400 points; the largest change reached is 7e-16. Points are enough for a loop wound up this far."""

METHODS = {
    "explicit Euler": (orbits.methods.ExplicitEuler(), 0.1),
    "RK4": (orbits.methods.RungeKutta4(), 1.0),
    "symplectic Euler": (orbits.methods.SymplecticEuler(), 0.1),
    "Störmer–Verlet": (orbits.StormerVerlet(), 0.5),
    "Lobatto IIIA–IIIB, 3 stages": (orbits.methods.LobattoIIIAB(stages=3), 1.0),
    "Gauss, 2 stages": (orbits.Gauss(stages=2), 1.0),
}


def march_loop(method, h):
    """Positions and momenta of the loop after every step, (steps + 1, POINTS, 1) each."""
    q, p = loop(np.array(CENTRE[:1]), np.array(CENTRE[1:]), np.array([RADIUS]), np.array([RADIUS]), POINTS)
    flow = Flow(pendulum, method, h)
    paths = [flow.march(x, y, round(LENGTH / h)) for x, y in zip(q, p, strict=True)]
    return np.stack([path.q for path in paths], axis=1), np.stack([path.p for path in paths], axis=1)


def experiment(say):
    """March the loop by each method; its area at every step."""
    rows, checks, marched = [], [], []
    for name, (method, h) in METHODS.items():
        say(f"{name}, h = {h:g}: {POINTS} pendulums")
        q, p = march_loop(method, h)
        areas = np.array([area(x, y) for x, y in zip(q, p, strict=True)])
        change = float(np.abs(areas / areas[0] - 1.0).max())
        rows.append([name, h, len(areas) - 1, f"{-areas[0]:.9f}", f"{-areas[-1]:.9f}", f"{change:.1e}"])
        if "symplectic" in method.declares:
            checks.append(Check(f"{name} keeps the area of the loop", change < ROUND_OFF, f"{change:.1e}"))
        else:
            claim = f"{name} does not keep the area of the loop"
            checks.append(Check(claim, change > 1e-3, f"{change:.1e}"))
        marched.append(
            (name, "symplectic" in method.declares, h, q, p, change if change < 0.001 else areas[-1] / areas[0] - 1)
        )
    columns = ["method", "h", "steps", "area at first", "area at last", "largest relative change"]
    return StudyResult(
        tables=[Table(f"The area inside a loop of {POINTS} pendulums, t = 0 to {LENGTH:g}", columns, rows)],
        checks=checks,
        figures={"liouville": lambda: draw(marched)},
    )


def draw(marched):
    """One panel for each method: the loop at a few times, filled, the exact level curves beneath."""
    from orbits import plotting

    style = plotting.style
    figure = plotting.figure(16, 10.5)
    axes = figure.subplots(2, 3, sharex=True, sharey=True)
    grid = np.meshgrid(np.linspace(-np.pi, 3.7, 201), np.linspace(-2.3, 2.3, 121))
    for axis, (name, kept, h, q, p, change) in zip(axes.flat, marched, strict=True):
        axis.contour(
            *grid,
            grid[1] ** 2 / 2 - np.cos(grid[0]),
            levels=[-0.9, -0.6, -0.2, 0.3, 1, 1.8],
            colors=style.FAINT,
            linewidths=0.8,
            linestyles="-",
        )
        for k, t in enumerate(SHOWN):
            step = round(t / h)
            axis.fill(q[step, :, 0], p[step, :, 0], color=style.PALETTE[k], alpha=0.3, lw=0)
            outline = np.append(np.arange(POINTS), 0)
            axis.plot(q[step, outline, 0], p[step, outline, 0], color=style.PALETTE[k], lw=1.6, label=f"t = {t:g}")
        told = f"kept to {change:.0e}" if kept else f"{'lost' if change < 0 else 'gained'}: {abs(change):.0%}"
        axis.set_title(f"{name}, h = {h:g}\narea {told}", fontsize=16)
        axis.set(xlim=(-np.pi, 3.7), ylim=(-2.3, 2.3))
    for axis in axes[:, 0]:
        axis.set_ylabel("p")
    for axis in axes[1]:
        axis.set_xlabel("q")
    told = "grey: level curves of the energy, along which the true motion goes"
    plotting.below(figure, *axes[0, 0].get_legend_handles_labels(), told, size=14)
    figure.suptitle("A loop of initial conditions of the pendulum, marched", fontsize=20, fontweight="bold")
    return figure


scenario = Study(
    name="liouville",
    title="The area of a loop of initial conditions, kept by variational methods and lost by others",
    experiment=experiment,
    certifies=[(pendulum, method, 0.1) for method, _ in METHODS.values()],
)

if __name__ == "__main__":
    scenario.main()
