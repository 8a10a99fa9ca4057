"""The figure eight of three equal masses over a hundred periods, by variational methods.

Three bodies follow each other along one curve, a third of a period apart. Each method integrates it with the same
steps; as the initial state is known to ten digits, the distance from it after one period, and after a hundred, is the
error of the method. The scenario `three_body_zoo` has fifteen other periodic orbits.

Source: Chenciner & Montgomery (2000). The bounds of Gauss with two stages are those of the tests of
GeometricProblems.jl.
"""

import json

import numpy as np

import orbits
from orbits.regression import peers
from orbits.resources import data_path
from orbits.scenario import Check, Study, StudyResult, Table

STEPS = 400  # a period
LAPS = 100
PEER_LAPS = (1, 2, 5, 10, 20, 50, 100)
METHODS = [
    orbits.methods.ExplicitEuler(),
    orbits.methods.RungeKutta4(),
    orbits.methods.SymplecticEuler(),
    orbits.StormerVerlet(),
    *(orbits.Gauss(stages=s) for s in (1, 2, 4, 8)),
]
BOUNDS = {"Gauss(stages=2)": (1.3e-7, 2.0e-7, 3e-15), "Gauss(stages=1)": (None, None, 4e-9)}
"""q, v and energy after a period, as the tests of GeometricProblems.jl have them."""
DIGITS = 2e-11
"""What the ten digits of the start let any method close to: 1.5e-11 in q, 1.7e-11 in v."""


def figure_eight():
    """The three bodies at the start, and the period."""
    rows = json.loads(data_path("three_body_periodic.json").read_text(encoding="utf-8"))["published"]
    row = next(row for row in rows if row["name"].startswith("figure-8"))
    p = np.array([float(row["p1"]), float(row["p2"]), 0.0])
    q = [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    bodies = orbits.System(
        ["first", "second", "third"], np.ones(3), q, [p, p, -2 * p], units=orbits.DIMENSIONLESS
    )
    return bodies, float(row["T"])


def off(run, k=-1):
    """Largest component of q and of v by which sample k differs from the start."""
    return tuple(float(np.abs(x[k].value - x[0].value).max()) for x in (run.q, run.v))


def laps(system, period, method):
    """One period in detail, and `LAPS` of them sampled at their ends."""
    one = orbits.propagate(
        system, method, dt=period / STEPS, duration=period, samples=STEPS + 1, check_step=False, progress=False
    )
    times = period * np.arange(LAPS + 1)
    many = orbits.propagate(
        system, method, dt=period / STEPS, duration=LAPS * period, samples=times, check_step=False, progress=False
    )
    return one, [max(off(many, k)) for k in range(1, LAPS + 1)]


def experiment(say):
    """The eight by all methods and IAS15."""
    eight, period = figure_eight()
    rows, checks, curves = [], [], {}
    for method in METHODS:
        say(method.label)
        one, after = laps(eight, period, method)
        energy = one.energy().value / one.energy().value[0] - 1.0
        q, v = off(one)
        rows.append([short(method.label), q, v, float(np.abs(energy).max()), float(abs(energy[-1])), after[-1]])
        curves[method.label] = after
        checks += judged(method, q, v, energy)
    say("REBOUND ias15")
    peer, far = ias15(eight, period)
    rows.append([f"ias15, {peer:,} steps", *far[0], None, None, max(far[-1])])
    curves["REBOUND ias15"] = [max(each) for each in far]
    table = Table(
        f"The figure eight with {STEPS} steps a period: what is missing after one",
        ["method", "q", "v", "energy at most", "energy after", f"q, v after {LAPS}"],
        rows,
    )
    say("one lap in detail")
    run = orbits.propagate(
        eight,
        orbits.Gauss(stages=8),
        dt=period / STEPS,
        duration=period,
        samples=1201,
        check_step=False,
        progress=False,
    )
    return StudyResult(
        tables=[table],
        checks=checks,
        figures={"figure_eight": lambda: draw_eight(run.q.value, curves)},
        record={"closure_after_each_lap": curves},
    )


def ias15(system, period):
    """Steps that REBOUND's IAS15 takes for the last of `PEER_LAPS`, and what is then missing in q and v, for each.

    Each is a run of its own. Its step is chosen by the ratio of the derivatives of each body's acceleration, and goes
    to nothing where that of the middle body vanishes, at the end of every period: a sample there is a trap.
    """
    x, far = system.values, []
    for lap in PEER_LAPS:
        run = peers.run("ias15", x, times=np.array([lap * period]), dt=period / STEPS)
        far.append((float(np.abs(run.q[-1] - x.q).max()), float(np.abs(run.v[-1] - x.v).max())))
    return run.steps, far


def short(label):
    """A method's label without empty brackets and variants."""
    return label.split("(v")[0].replace("()", "").replace("stages=", "")


def judged(method, q, v, energy):
    """Yield what is demanded of a method on the figure eight."""
    if method.label in BOUNDS:
        for name, value, bound in zip(("q", "v", "energy"), (q, v, abs(energy[-1])), BOUNDS[method.label], strict=True):
            if bound is not None:
                claim = f"{method.label} closes the eight in {name} as GeometricIntegrators does"
                yield Check(claim, value <= bound, f"{value:.2g}, there {bound:.2g}")
    elif method.order >= 8:
        claim = f"{method.label} closes the eight to the digits of its start"
        yield Check(claim, max(q, v) < DIGITS, f"{q:.1e}, {v:.1e}")
    elif not method.variational:
        lost = abs(energy[-1])
        yield Check(f"{method.label} does not return to its energy", lost > 1e-9, f"{lost:.1e}")


def draw_eight(path, curves):
    """The eight with its three bodies and where they come from; what is missing after each of a hundred periods."""
    from matplotlib.collections import LineCollection

    from orbits import plotting

    style = plotting.style
    figure = plotting.figure(14, 10)
    axes = figure.subplot_mosaic([["eight"], ["laps"]], height_ratios=[1.0, 1.12])
    panel = axes["eight"]
    panel.plot(path[:, 0, 0], path[:, 0, 1], color=style.FAINT, lw=5, zorder=1)
    colours = (style.BLUE, style.VERMILION, style.GREEN)
    for body, colour in enumerate(colours):  # a tail behind each body, as long as a sixth of the period
        tail = path[-201:, body, :2]
        strength = np.linspace(0.0, 1.0, 200)
        pieces = LineCollection(np.stack([tail[:-1], tail[1:]], axis=1), colors=colour, zorder=2)
        pieces.set(alpha=strength, linewidth=1.0 + 4.0 * strength)
        panel.add_collection(pieces)
        panel.plot(*path[-1, body, :2], "o", color=colour, ms=17, mec="white", mew=1.5, zorder=5)
    panel.set_aspect("equal")
    panel.axis("off")
    panel.set_title("Three equal masses on one curve, each a third of the period behind the other", loc="center")
    axis = axes["laps"]
    colours = (style.GREY, *(style.PALETTE[k] for k in (1, 2, 4, 5, 3, 7, 0)))
    for k, (name, after) in enumerate(curves.items()):
        peer = name.startswith("REBOUND")
        look = {"color": style.INK, "ls": (0, (5, 2)), "lw": 2.0} if peer else {"color": colours[k], "lw": 2.0}
        if name == "Gauss(stages=8)":  # others end where it does: a broad line beneath theirs
            look |= {"lw": 7.0, "zorder": 1.5}
        count = PEER_LAPS if peer else range(1, LAPS + 1)
        axis.plot(count, np.maximum(after, 1e-12), label=plotting.method_words(name), **look)
    axis.axhspan(1e-12, 1.7e-11, color=style.FAINT, alpha=0.7, lw=0)
    text = axis.text(
        1.02, 1.25e-12, "what the ten digits of the start allow", va="bottom", color=style.GREY, fontsize=13
    )
    plotting.halo(text)
    axis.set(xscale="log", yscale="log", xlim=(1, LAPS), ylim=(1e-12, 30), xlabel="periods")
    axis.set_title(f"distance from the start, in q or v, after so many periods of {STEPS} steps")
    axis.grid(axis="y", color=style.FAINT, lw=0.6)
    plotting.below(figure, *axis.get_legend_handles_labels())
    figure.suptitle("The figure eight of Chenciner and Montgomery", fontsize=21, fontweight="bold")
    return figure


scenario = Study(
    name="figure_eight",
    title="The figure eight of three bodies over a hundred periods",
    experiment=experiment,
    certifies=[(figure_eight()[0], method, 0.05) for method in METHODS[3:]],
)

if __name__ == "__main__":
    scenario.main()
