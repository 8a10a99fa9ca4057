"""Arenstorf's closed orbits in the rotating frame, by variational methods with equal steps.

A spacecraft orbits Earth and Moon in three or four loops and returns exactly to its starting point, 2,400 km from the
Moon's centre. The frame rotates: the Coriolis force depends on velocities, and the Lagrangian is like that of a charged
particle in a magnetic field. An initial error is amplified up to 300,000 times in one period.

Sources: Arenstorf (1963); Hairer, Nørsett & Wanner (1993), sec. II.0.
"""

import json

import numpy as np

import orbits
from orbits.lagrangians.restricted_three_body import restricted_three_body
from orbits.resources import data_path
from orbits.scenario import Check, Study, StudyResult, Table

METHODS = [orbits.Gauss(stages=8), orbits.Gauss(stages=4)]
STEPS = (2000, 4000, 8000, 16000, 32000, 64000)
CLAIMED = {"Gauss(stages=8)": 8000, "Gauss(stages=4)": 64000}
"""Steps from which on both orbits close to `CLOSED`."""
CLOSED = 1e-9
DRAWN = 40000
DISTANCE, MOON = 384400.0, 1737.4
"""The mean distance of Earth and Moon, and the Moon's radius [km]: scales the inset."""
NEAR = 0.02
"""Half the width of the inset, in distances of Earth and Moon."""


def closed_orbits():
    """The Lagrangian, and (loops, q, v, period) of each orbit, from the data file."""
    data = json.loads(data_path("arenstorf.json").read_text(encoding="utf-8"))
    lagrangian = restricted_three_body.with_parameters(mu=float(data["mu"]))
    made = []
    for orbit in data["orbits"]:
        x, y, vx, vy = map(float, orbit["y0"])
        made.append((int(orbit["loops"]), np.array([x, y]), np.array([vx, vy]), float(orbit["T"])))
    return lagrangian, made


def closure(lagrangian, method, start, steps):
    """How far from its start, in q and in v, the orbit ends after one period, and how far Jacobi's integral strays."""
    _, q, v, period = start
    path = orbits.march(lagrangian, method, q=q, v=v, dt=period / steps, steps=steps, every=steps // 200)
    jacobi = -2.0 * path.energy()
    return (
        float(np.abs(path.q[-1] - q).max()),
        float(np.abs(path.v[-1] - v).max()),
        float(np.abs(jacobi / jacobi[0] - 1.0).max()),
    )


def experiment(say):
    """March both orbits for one period by each method with ever more steps."""
    lagrangian, starts = closed_orbits()
    rows, checks = [], []
    for start in starts:
        for method in METHODS:
            say(f"{start[0]} loops by {method.label}")
            for steps in STEPS:
                q, v, jacobi = closure(lagrangian, method, start, steps)
                rows.append([start[0], method.label, steps, q, v, jacobi])
                if steps >= CLAIMED[method.label]:
                    claim = f"{start[0]} loops by {method.label} close to {CLOSED:g} with {steps:,} steps"
                    checks.append(Check(claim, max(q, v) < CLOSED, f"{q:.1e} in q, {v:.1e} in v"))
                    # Rounding of the energy near the Moon, where |v|^2/2 and mu/r are 2 and cancel to 1.5.
                    claim = f"{start[0]} loops by {method.label}, {steps:,} steps: Jacobi's integral is kept"
                    checks.append(Check(claim, jacobi < 2e-13, f"{jacobi:.1e}"))
    columns = ["loops", "method", "steps", "closure in q", "closure in v", "Jacobi's integral, relative change"]
    return StudyResult(
        tables=[Table("One period with equal steps", columns, rows)],
        checks=checks,
        figures={"arenstorf": lambda: draw(lagrangian, starts)},
        record={"mu": lagrangian.parameters["mu"]},
    )


def draw(lagrangian, starts):
    """Both orbits in the rotating frame, Earth and Moon at rest."""
    from orbits import plotting

    figure = plotting.figure(16, 9.4)
    axes = figure.subplots(1, 2)
    mu = lagrangian.parameters["mu"]
    method = METHODS[0]
    for axis, (loops, q, v, period) in zip(axes, starts, strict=True):
        path = orbits.march(lagrangian, method, q=q, v=v, dt=period / DRAWN, steps=DRAWN, every=8)
        axis.plot(path.q[:, 0], path.q[:, 1], color=plotting.style.BLUE, lw=1.6)
        for x, name, size in ((-mu, "Earth", 12), (1 - mu, "Moon", 7)):
            axis.plot(x, 0, "o", ms=size, color=plotting.colour(name, 0), zorder=3)
            axis.annotate(name, (x, 0), (12, -6), textcoords="offset points", fontsize=15)
        end = np.hypot(*(path.q[-1] - q))
        axis.set_title(f"{loops} loops, T = {period:.4f}: ends {end:.0e} from its start")
        axis.set(xlim=(-1.35, 1.45), ylim=(-1.4, 1.4), xlabel="x, rotating with the Moon [distance of Earth and Moon]")
        axis.set_aspect("equal", adjustable="box")
        axis.grid(color=plotting.style.FAINT, lw=0.6)
        axis.set_axisbelow(True)
        beside_the_moon(axis, lagrangian, method, (q, v, period))
    axes[0].set_ylabel("y, rotating with the Moon [distance of Earth and Moon]")
    told = (
        "insets: the passage by the Moon, drawn to scale; the dot is start and end. T and all else: units in which the "
        "distance of Earth and Moon, their mass, and the angular speed of the frame are 1"
    )
    plotting.below(figure, [], [], told)
    figure.suptitle(
        f"Arenstorf's closed orbits in the rotating frame, by {plotting.method_words(method.label)}, "
        f"with {DRAWN:,} equal steps",
        fontsize=20,
        fontweight="bold",
    )
    return figure


def beside_the_moon(axis, lagrangian, method, start):
    """Draw the passage by the Moon, which is at its closest at start and end, in an inset; the Moon to scale."""
    from matplotlib.patches import Circle

    from orbits import plotting

    style = plotting.style
    q, v, period = start
    inset = axis.inset_axes([0.655, 0.03, 0.335, 0.335])
    place = 1.0 - lagrangian.parameters["mu"]
    for way in (1, -1):
        near = orbits.march(lagrangian, method, q=q, v=v, dt=way * period / (10 * DRAWN), steps=2000, every=4)
        inset.plot(near.q[:, 0], near.q[:, 1], color=style.BLUE, lw=1.6)
    inset.plot(*q, "o", ms=6, color=style.BLUE, zorder=3)
    inset.add_patch(Circle((place, 0.0), MOON / DISTANCE, color=plotting.colour("Moon", 0), alpha=0.6, lw=0))
    text = f"{abs(q[0] - place) * DISTANCE:,.0f} km\nfrom the\nMoon's centre"
    inset.annotate(text, (q[0], 0.0), (8, 0), textcoords="offset points", fontsize=13, va="center")
    inset.set(xlim=(place - 0.5 * NEAR, place + 1.5 * NEAR), ylim=(-NEAR, NEAR), xticks=[], yticks=[])
    inset.set_aspect("equal")
    for side in inset.spines.values():
        side.set(visible=True, color=style.GREY)
    axis.indicate_inset_zoom(inset, edgecolor=style.GREY)


def certified():
    """Each orbit from its far side, half a period on, with a step that suits the motion there.

    At the start itself, beside the Moon, steps as long as an order is measured with leave the motion unresolved.
    """
    lagrangian, starts = closed_orbits()
    far = []
    for _, q, v, period in starts:
        path = orbits.march(lagrangian, METHODS[0], q=q, v=v, dt=period / 16000, steps=8000, every=8000)
        far.append((tuple(path.q[-1]), tuple(path.v[-1])))
    return [(lagrangian, method, 0.08, *there) for there in far for method in METHODS]


scenario = Study(
    name="arenstorf",
    title="Arenstorf's closed orbits, closed by Gauss methods with equal steps in the rotating frame",
    experiment=experiment,
    certifies=certified(),
)

if __name__ == "__main__":
    scenario.main()
