"""The outer solar system for 200,000 days, as in the picture of Hairer, Lubich and Wanner, with more methods.

Sun, four giants and Pluto with the book's numbers. With explicit Euler and steps of 10 days the planets spiral
outwards; symplectic Euler with 100 days and Störmer–Verlet with 200 days keep them on their orbits with fewer force
evaluations; Gauss with 200 days is at round-off. With RK4 and 200 days Jupiter falls towards the Sun. Positions are
measured against Gauss with steps of 25 days; REBOUND is shown for comparison.

Source: Hairer, Lubich & Wanner (2006), sec. I.2.4, table 2.2 and fig. 2.4.
"""

import json

import numpy as np

import orbits
from orbits.regression import peers
from orbits.resources import data_path
from orbits.scenario import Check, Study, StudyResult, Table

DAYS = 200_000
EVERY = 200  # days between samples: all steps divide it
METHODS = {
    "explicit Euler": (orbits.methods.ExplicitEuler(), 10),
    "RK4": (orbits.methods.RungeKutta4(), 200),
    "symplectic Euler": (orbits.methods.SymplecticEuler(), 100),
    "Störmer–Verlet": (orbits.StormerVerlet(), 200),
    "Gauss, 8 stages": (orbits.Gauss(stages=8), 200),
}
PEERS = {"whfast": 200, "ias15": 200}
REFERENCE_DT = 25


def book():
    """The data file: bodies, masses, positions and velocities of the book, and where they are after 200 days."""
    return json.loads(data_path("hlw_outer_solar_system.json").read_text(encoding="utf-8"))


def system():
    """The six bodies where the book has them: the Sun at rest at the origin."""
    data = book()
    G = data["G"]
    mass = [float(m) if "/" not in m else float(m.split("/")[0]) / float(m.split("/")[1]) for m in data["m"]]
    return orbits.System(data["bodies"], G * np.array(mass), data["q"], data["v"], units=orbits.SOLAR)


def march(bodies, method, dt):
    """Positions (samples, 6, 3), energies, and the run: every `EVERY` days."""
    run = orbits.propagate(
        bodies, method, dt=dt, duration=DAYS, samples=DAYS // EVERY + 1, check_step=False, progress=False
    )
    return run.q.value, run.energy().value, run


def experiment(say):
    """Run the book's methods and REBOUND's; energies and positions at every sample."""
    bodies = system()
    say(f"Gauss, 8 stages, {REFERENCE_DT} days: what positions are measured against")
    truth, _, _ = march(bodies, orbits.Gauss(stages=8), REFERENCE_DT)
    rows, checks, drawn = [], [], []
    for name, (method, dt) in METHODS.items():
        say(f"{name}, {dt} days")
        q, energy, run = march(bodies, method, dt)
        strays = np.abs(energy / energy[0] - 1.0)
        error = np.linalg.norm(q - truth, axis=2).max(axis=1)
        rows.append([name, dt, run.statistics.evaluations, float(strays.max()), trend(energy), float(error.max())])
        drawn.append((name, dt, q, strays, error))
        checks += judged(name, method, energy, strays, error)
    x = bodies.values
    for name, dt in PEERS.items():
        say(f"REBOUND {name}, {dt} days")
        times = np.arange(0.0, DAYS + 1, EVERY)
        run = peers.run(name, x, times=times, dt=float(dt))
        energy = orbits.diagnostics.energy(x.gm, run.q, run.v)
        strays, error = np.abs(energy / energy[0] - 1.0), np.linalg.norm(run.q - truth, axis=2).max(axis=1)
        label = f"REBOUND {name}"
        rows.append(
            [
                label,
                None if name == "ias15" else dt,
                run.steps if name == "whfast" else None,
                float(strays.max()),
                trend(energy),
                float(error.max()),
            ]
        )
        drawn.append((label, dt, None, strays, error))
    columns = ["method", "step [d]", "forces", "|dE/E| at most", "dE/E per century", "position error [au]"]
    return StudyResult(
        tables=[Table(f"The outer solar system for {DAYS:,} days", columns, rows)],
        checks=[*checks, *against_the_book(bodies)],
        figures={"outer_solar_system": lambda: draw(bodies, drawn)},
    )


def trend(energy):
    """Slope of a straight line through dE/E, per century."""
    centuries = np.arange(len(energy)) * EVERY / 36525
    return float(np.polyfit(centuries, energy / energy[0] - 1.0, 1)[0])


def judged(name, method, energy, strays, error):
    """Yield what each method has to show."""
    if name == "explicit Euler":
        gained = energy[-1] / energy[0] - 1.0
        yield Check("explicit Euler: the planets spiral outwards", gained < -0.2, f"dE/E = {gained:.2g}")
    elif name == "RK4":
        quarters = [float(part.mean()) for part in np.array_split(energy / energy[0] - 1.0, 4)]
        steps = np.diff(quarters)
        claim = "RK4: the energy drifts, quarter by quarter"
        yield Check(claim, bool(steps.min() > 0 or steps.max() < 0), f"{quarters[0]:.1e} to {quarters[-1]:.1e}")
    elif method.order <= 2:
        # Bounded: the second half strays no farther than the first; 1.02 at most was reached.
        half = len(strays) // 2
        ratio = float(strays[half:].max() / strays[:half].max())
        yield Check(
            f"{name}: the energy stays bounded", ratio < 1.1, f"{strays.max():.1e}, later half / first {ratio:.2f}"
        )
    else:
        yield Check(f"{name}: the energy is kept to round-off", strays.max() < 5e-15, f"{strays.max():.1e}")
        yield Check(f"{name}: positions are those of shorter steps", error.max() < 1e-9, f"{error.max():.1e} au")


def against_the_book(bodies):
    """Yield checks of one step of 200 days, and of the energy, against values of twenty digits."""
    data = book()
    run = orbits.propagate(
        bodies, orbits.Gauss(stages=8), dt=200, duration=200, samples=2, check_step=False, progress=False
    )
    known = data["reference_200_days"]
    for name, got, right, size in (("positions", run.q, known["q"], 1.0), ("velocities", run.v, known["v"], 1e-3)):
        off = float(np.abs(got.value[-1] - np.array(right, dtype=float)).max())
        # Half a unit in the last place of 25 au is 1.8e-15, of 0.007 au/d 4e-19.
        yield Check(f"after a single step of 200 days: {name} to the last digit", off < 8e-15 * size, f"{off:.1e}")
    energy = orbits.diagnostics.energy(bodies.values.gm, bodies.values.q, bodies.values.v) / data["G"]
    off = float(abs(energy / float(data["E0"]) - 1.0))
    yield Check("the energy at the start is the known one", off < 1e-15, f"{off:.1e}")


def draw(bodies, drawn):
    """The orbits by each method, seen along the total angular momentum; below, energies and positions."""
    from orbits import plotting

    style = plotting.style
    figure = plotting.figure(17, 8.8)
    above, below = figure.subfigures(2, 1, height_ratios=[0.75, 1.15])
    panels = above.subplots(1, len(METHODS))
    axes = below.subplot_mosaic([["energy", "position"]])
    turn = seen_along_the_angular_momentum(bodies)
    years = np.arange(len(drawn[0][3])) * EVERY / 365.25
    for k, (name, dt, q, strays, error) in enumerate(drawn):
        if q is not None:
            orbits_of(panels[k], bodies, (q - q[:, :1]) @ turn.T, f"{name}, {dt} d")
        peer = q is None
        look = {
            "color": style.INK if peer else style.PALETTE[(1, 4, 3, 0, 2)[k]],
            "label": name if "ias15" in name else f"{name}, {dt} d",
        }
        look["ls"] = {"REBOUND whfast": (0, (5, 2)), "REBOUND ias15": (0, (1, 1.3))}.get(name, "-")
        for panel, series in (("energy", strays), ("position", error)):
            axes[panel].plot(years[1:], np.maximum(np.maximum.accumulate(series[1:]), 3e-17), **look)
    axes["energy"].set(title="largest |ΔE/E| so far", ylim=(3e-17, 3))
    axes["position"].set(title="largest position error so far [au]", ylim=(1e-16, 300))
    for panel in axes.values():
        panel.set(yscale="log", xscale="log", xlabel="years")
        panel.grid(axis="y", color=style.FAINT, lw=0.6)
    told = (
        "above: positions from the Sun every 200 days, seen along the total angular momentum; discs, where bodies are "
        "at the end. Black lines: REBOUND"
    )
    plotting.below(figure, *axes["energy"].get_legend_handles_labels(), told)
    figure.suptitle(f"The outer solar system for {DAYS:,} days", fontsize=21, fontweight="bold")
    return figure


def seen_along_the_angular_momentum(bodies):
    """Rows: two axes of the plane of the total angular momentum, and its direction."""
    x = bodies.values
    L = orbits.diagnostics.angular_momentum(x.gm, x.q - x.q[0], x.v)
    up = L / np.linalg.norm(L)
    right = np.cross([0.0, 1.0, 0.0], up)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(up, right), up])


def orbits_of(panel, bodies, q, title):
    """Samples of each body as points, the last one as a disc; relative to the Sun."""
    from orbits import plotting

    style = plotting.style
    for i, body in enumerate(bodies.names):
        colour = plotting.colour(body, i)
        if body != "Sun":
            panel.plot(q[:, i, 0], q[:, i, 1], ".", ms=1.8, alpha=0.7, color=colour, mew=0)
        panel.plot(*q[-1, i, :2], "o", ms=7 if body == "Sun" else 5.5, color=colour, mec="white", mew=0.6)
        if title.startswith("Gauss") and body != "Sun":
            side = -1 if q[-1, i, 0] < 0 else 1
            place = {"xytext": (7 * side, 4), "textcoords": "offset points", "ha": "left" if side > 0 else "right"}
            plotting.halo(panel.annotate(body, q[-1, i, :2], fontsize=13, zorder=5, **place))
    # Pluto's aphelion is up and to the right of the Sun.
    panel.set(xlim=(-40, 52), ylim=(-37, 55), aspect="equal", xticks=[], yticks=[])
    panel.set_title(title, fontsize=16, loc="center")
    if title.startswith("explicit"):
        panel.plot([32, 52], [-35, -35], color=style.INK, lw=2)
        panel.text(42, -33.5, "20 au", ha="center", va="bottom", fontsize=13)
    for side in panel.spines.values():
        side.set_visible(False)


scenario = Study(
    name="outer_solar_system",
    title="The outer solar system for 200,000 days, after Hairer, Lubich and Wanner",
    experiment=experiment,
    certifies=[(system(), method, float(dt)) for method, dt in METHODS.values()],
)

if __name__ == "__main__":
    scenario.main()
