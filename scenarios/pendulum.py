"""The pendulum's phase portrait by eight maps: spirals, island chains, a chaotic layer, and an integrable map.

Explicit Euler drives every motion outwards and RK4 damps it. Störmer–Verlet with step h is Chirikov's standard map with
K = h^2: its resonances open chains of islands, and at large h a chaotic layer fills the neighbourhood of the
separatrix. Suris' map is Störmer–Verlet too, for a force that differs from the pendulum's by O(h^2): it has an
integral at every h, and no chaos.

Sources: Hairer, Lubich & Wanner (2006), sec. I.1; Chirikov (1979); Suris (1989).
"""

from itertools import pairwise

import numpy as np

import orbits
from orbits.integrators.flow import Flow
from orbits.kernels.lanes import get, put
from orbits.kernels.lanes.functions import atan2, cos, sin
from orbits.lagrangians.pendulum import pendulum
from orbits.scenario import Check, Study, StudyResult, Table

ORBITS, STEPS = 200, 2000
SHOWN = 25  # the orbit of the foils that is drawn in black, from rest at 54 degrees
SEPARATRIX = 2.0  # |p| at q = 0 of the exact separatrix
REGULAR, CHAOTIC = 0.012, 0.05
"""Exponents per step after 2,000 steps: tangents of regular orbits grow linearly, ln(2000)/2000 = 0.004."""


@orbits.kernel
def suris_accelerate(parameters, q, out):
    """d2q/dt2 = -(1/k) arg(1 + k e^{iq}) with k = h^2/4, in place of -sin q."""
    k = parameters[0]
    x = get(q, 0)
    put(out, 0, -atan2(k * sin(x), 1.0 + k * cos(x)) / k)


suris_template = orbits.Lagrangian.from_kernels(
    {"accelerate": suris_accelerate},
    coordinates=["q"],
    name="suris",
    parameters={"k": 0.25},
    formula="v^2/2 - V(q),  V' = (1/k) arg(1 + k e^{iq})",
    source="Suris (1989)",
)


def suris(h):
    """The Lagrangian whose Störmer–Verlet map with step h is Suris' map."""
    return suris_template.with_parameters(k=h * h / 4)


def panels():
    """Title, Lagrangian, method, step and kind of each panel, in the order of reading."""
    verlet = orbits.StormerVerlet()
    return [
        ("explicit Euler, h = 0.02", pendulum, orbits.ExplicitEuler(), 0.02, "foil"),
        ("RK4, h = 0.9", pendulum, orbits.RungeKutta4(), 0.9, "foil"),
        ("Störmer–Verlet, h = 0.5", pendulum, verlet, 0.5, "standard"),
        ("Störmer–Verlet, h = 0.9", pendulum, verlet, 0.9, "standard"),
        ("Störmer–Verlet, h = 1.2", pendulum, verlet, 1.2, "standard"),
        ("Suris, h = 1.2", suris(1.2), verlet, 1.2, "suris"),
        ("Störmer–Verlet, h = 1.6", pendulum, verlet, 1.6, "standard"),
        ("Suris, h = 1.6", suris(1.6), verlet, 1.6, "suris"),
    ]


def starts(h, kind):
    """Starts (ORBITS, 2): along p = 0, up and down the lines q = 0 and q = pi, and evenly all over the picture."""
    if kind == "foil":
        half, along = 3.0, np.linspace(0.02, 0.95 * np.pi, 80)
    else:
        half, along = min(3.0, np.pi / h), np.linspace(0.02, np.pi - 1e-3, 60)
    rest = ORBITS - len(along)
    k = np.arange(rest)
    sign = np.where(k % 2, 1.0, -1.0)
    up, evenly = sign * half * (k + 0.5) / rest, half * (2 * np.mod(k * 0.5698402909980532, 1.0) - 1)
    q = np.where(k % 3 == 0, np.pi, np.where(k % 3 == 1, 0.0, np.pi * (2 * np.mod(k * 0.7548776662466927, 1.0) - 1)))
    p = np.where(k % 3 == 2, evenly, up)
    return np.vstack([np.column_stack([along, 0 * along]), np.column_stack([q, p])])


def march_all(lagrangian, method, h, begin, steps=STEPS):
    """Positions and momenta of many orbits, (orbits, steps + 1) each."""
    flow = Flow(lagrangian, method, h)
    paths = [flow.march(start[:1], start[1:], steps) for start in begin]
    return np.stack([path.q[:, 0] for path in paths]), np.stack([path.p[:, 0] for path in paths])


def lyapunov_exponents(q, h, kind):
    """Growth of a tangent vector along each orbit, per step: ln |delta_n| / n, (orbits,).

    The derivative of the Störmer–Verlet map, kick - drift - kick, applied step by step and rescaled.
    """
    x, y = np.full(len(q), 0.6), np.full(len(q), 0.8)
    growth = np.zeros(len(q))
    slope = force_slope(q.T, h, kind)
    for before, after in pairwise(slope):
        y += 0.5 * h * before * x
        x += h * y
        y += 0.5 * h * after * x
        size = np.hypot(x, y)
        x, y = x / size, y / size
        growth += np.log(size)
    return growth / (q.shape[1] - 1)


def force_slope(q, h, kind):
    """Return dg/dq of the acceleration g."""
    if kind == "standard":
        return -np.cos(q)
    k = h * h / 4
    return -(np.cos(q) + k) / (1 + 2 * k * np.cos(q) + k * k)


def suris_integral(q, h):
    """cos((q1 - q0)/2) + (h^2/4) cos((q1 + q0)/2) of neighbouring positions, constant along orbits of Suris' map."""
    before, after = q[..., :-1], q[..., 1:]
    return np.cos((after - before) / 2) + h * h / 4 * np.cos((after + before) / 2)


def energy(q, p):
    """Of the pendulum."""
    return p * p / 2 - np.cos(q)


def experiment(say):
    """March 200 orbits by each of the eight maps, and measure what they keep and how fast neighbours part."""
    marched, rows, checks, exponents = [], [], [], {}
    for title, lagrangian, method, h, kind in panels():
        say(f"{title}: {ORBITS} orbits of {STEPS:,} steps")
        q, p = march_all(lagrangian, method, h, starts(h, kind))
        if kind == "foil":
            above = energy(q, p)[:60] + 1  # the librations that start at rest, up to 125 degrees
            gain = float(np.median(above[:, -1] / above[:, 0]))
            rows.append([title, f"energy x {gain:.2g}", None, None])
            grows = method.name == "explicit-euler"
            claim = f"{title}: {'spirals outwards' if grows else 'loses energy'}"
            checks.append(Check(claim, gain > 1.5 if grows else gain < 0.5, f"energy x {gain:.2g} in {STEPS:,} steps"))
            marched.append((title, h, kind, q, p, None))
            continue
        rates = lyapunov_exponents(q, h, kind)
        exponents[title] = float(rates.max())
        chaotic = float(np.mean(rates > CHAOTIC))
        kept = "symplectic"
        if kind == "suris":
            spread = float(np.ptp(suris_integral(q, h), axis=1).max())
            kept = f"symplectic, and an integral to {spread:.0e}"
            # Positions of rotations grow to 6,000 radians: each of the 2,000 steps rounds them by up to 5e-13.
            checks.append(Check(f"{title}: its integral is constant", spread < 5e-11, f"{spread:.1e}"))
            checks.append(Check(f"{title}: no orbit is chaotic", rates.max() < REGULAR, f"{rates.max():.4f} per step"))
        elif h >= 1.0:
            claim = f"{title}: neighbours part exponentially near the separatrix"
            checks.append(Check(claim, rates.max() > 0.2, f"{rates.max():.3f} per step"))
        rows.append([title, kept, float(rates.max()), f"{chaotic:.0%}"])
        marched.append((title, h, kind, q, p, rates))
    table = Table(
        f"{ORBITS} orbits of {STEPS:,} steps by each map",
        ["map", "what is kept", "largest Lyapunov exponent per step", "chaotic orbits"],
        rows,
    )
    return StudyResult(
        tables=[table],
        checks=checks,
        figures={"pendulum": lambda: draw(marched)},
        record={"largest_lyapunov_exponent_per_step": exponents},
    )


def draw(marched):
    """Eight phase portraits, the exact level curves beneath; chaotic orbits in another colour than regular ones."""
    from orbits import plotting

    figure = plotting.figure(20, 11.2)
    axes = figure.subplots(2, 4, sharex=True, sharey=True)
    style = plotting.style
    for axis, (title, h, kind, q, p, rates) in zip(axes.flat, marched, strict=True):
        level_curves(axis)
        if kind == "foil":
            cloud(axis, q, p, style.SKY, alpha=0.35)
            cloud(axis, q[SHOWN : SHOWN + 1], p[SHOWN : SHOWN + 1], style.INK, "o", ms=2.0)
        else:
            for chosen, colour in ((rates <= CHAOTIC, style.BLUE), (rates > CHAOTIC, style.VERMILION)):
                cloud(axis, q[chosen], p[chosen], colour, period=2 * np.pi / h)
        axis.set_title(title)
        axis.set(xlim=(-np.pi, np.pi), ylim=(-3, 3), xticks=[-np.pi, 0, np.pi], yticks=[-2, 0, 2])
        axis.set_xticklabels(["−π", "0", "π"])
    for axis in axes[:, 0]:
        axis.set_ylabel("p")
    for axis in axes[1]:
        axis.set_xlabel("q")
    figure.suptitle(
        f"The pendulum by eight maps: {ORBITS} orbits of {STEPS:,} steps each", fontsize=21, fontweight="bold"
    )
    figure.legend(handles=legend(), loc="outside lower center", ncols=4, fontsize=15)
    return figure


def legend():
    """Handles for what is drawn."""
    from matplotlib.lines import Line2D

    from orbits.plotting import style

    dots = {"ls": "", "marker": "o", "ms": 8}
    return [
        Line2D([], [], color=style.INK, ls=(0, (4, 3)), lw=1.4, label="exact separatrix"),
        Line2D([], [], color=style.BLUE, label="regular orbits", **dots),
        Line2D([], [], color=style.VERMILION, label="chaotic orbits: neighbours part exponentially", **dots),
        Line2D([], [], color=style.INK, label="one orbit of Euler, of RK4", **dots),
    ]


def level_curves(axis):
    """The exact motion: curves of constant energy, the separatrix darker."""
    from orbits.plotting import style

    q, p = np.meshgrid(np.linspace(-np.pi, np.pi, 181), np.linspace(-3.2, 3.2, 161))
    axis.contour(q, p, energy(q, p), levels=[-0.8, -0.4, 0.2, 0.7, 1.6, 2.6, 3.8], colors=style.FAINT, linewidths=1.0)
    exact = {"colors": style.INK, "linewidths": 1.4, "linestyles": [(0, (4, 3))], "zorder": 3}
    axis.contour(q, p, energy(q, p), levels=[1.0], **exact)


def cloud(axis, q, p, colour, marker=",", *, period=None, **look):
    """All points of the orbits that fall into the picture, q folded to (-pi, pi], p by the map's own period 2 pi/h."""
    x, y = np.mod(q.ravel() + np.pi, 2 * np.pi) - np.pi, p.ravel()
    if period is not None:
        y = np.mod(y + period / 2, period) - period / 2
        x, y = np.tile(x, 3), np.concatenate([y, y + period, y - period])
    seen = np.abs(y) < 3
    axis.plot(x[seen], y[seen], marker, color=colour, mew=0, **look)


scenario = Study(
    name="pendulum",
    title="The pendulum by eight maps: spirals, islands, chaos, and an integrable map",
    experiment=experiment,
    certifies=[
        (pendulum, orbits.StormerVerlet(), 0.1),
        (pendulum, orbits.RungeKutta4(), 0.1),
        (pendulum, orbits.ExplicitEuler(), 0.02),
    ],
)

if __name__ == "__main__":
    scenario.main()
