"""The pendulum's phase portrait, exactly and by eight maps: spirals, island chains, a chaotic layer, an integrable map.

Explicit Euler drives every motion outwards and RK4 damps it. Störmer–Verlet with step h is Chirikov's standard map with
K = h^2: its resonances open chains of islands, and at large h a chaotic layer surrounds the separatrix. Suris' map is
Störmer–Verlet for a force that differs from the pendulum's by O(h^2): it has an integral for every h, and no chaos.

Islands are small, and orbits on a grid miss them: half of the orbits of Störmer–Verlet start where others leave gaps.

Sources: Hairer, Lubich & Wanner (2006), sec. I.1; Chirikov (1979); Suris (1989).
"""

from itertools import pairwise

import numpy as np

import orbits
from orbits import discrete
from orbits.lagrangians.pendulum import pendulum
from orbits.marching.flow import Flow
from orbits.scenario import Check, Study, StudyResult, Table

ORBITS, STEPS = 200, 2000
FIRST, ROUNDS = 100, 20  # of the maps with islands: starts on lines and all over, then in rounds in the largest gaps
CELLS = 120  # of the picture, each way, that are looked at for gaps
EMPTY = 0.012  # of the width of the picture: no empty square of two cells, where islands are filled
SHOWN = 25  # the orbit of the controls that is drawn in black, from rest at 54 degrees
SEPARATRIX = 2.0  # |p| at q = 0 of the exact separatrix
REGULAR, CHAOTIC = 0.012, 0.05
"""Exponents per step after 2,000 steps: tangents of regular orbits grow linearly, ln(2000)/2000 = 0.004."""


def panels():
    """Title, method, step and kind of each panel, in the order of reading."""
    verlet = orbits.StormerVerlet()
    return [
        ("exact motion", orbits.Gauss(stages=8), 0.25, "exact"),
        ("explicit Euler, h = 0.02", orbits.methods.ExplicitEuler(), 0.02, "control"),
        ("RK4, h = 0.9", orbits.methods.RungeKutta4(), 0.9, "control"),
        ("Störmer–Verlet, h = 0.5", verlet, 0.5, "standard"),
        ("Störmer–Verlet, h = 0.9", verlet, 0.9, "standard"),
        ("Störmer–Verlet, h = 1.2", verlet, 1.2, "standard"),
        ("Störmer–Verlet, h = 1.6", verlet, 1.6, "standard"),
        ("Suris, h = 1.2", discrete.suris(pendulum), 1.2, "suris"),
        ("Suris, h = 1.6", discrete.suris(pendulum), 1.6, "suris"),
    ]


def top(h, kind):
    """Half of what is looked at in p: the maps of a kick and a drift repeat themselves with 2 pi/h."""
    return min(3.0, np.pi / h) if kind in ("standard", "suris") else 3.0


def starts(h, kind, count=ORBITS):
    """Starts (count, 2): along p = 0, up and down the lines q = 0 and q = pi, and evenly all over the picture."""
    half = top(h, kind)
    along = np.linspace(0.02, 0.95 * np.pi, 80) if kind == "control" else np.linspace(0.02, np.pi - 1e-3, count // 3)
    rest = count - len(along)
    k = np.arange(rest)
    sign = np.where(k % 2, 1.0, -1.0)
    up, evenly = sign * half * (k + 0.5) / rest, half * (2 * np.mod(k * 0.5698402909980532, 1.0) - 1)
    q = np.where(k % 3 == 0, np.pi, np.where(k % 3 == 1, 0.0, np.pi * (2 * np.mod(k * 0.7548776662466927, 1.0) - 1)))
    p = np.where(k % 3 == 2, evenly, up)
    return np.vstack([np.column_stack([along, 0 * along]), np.column_stack([q, p])])


def march_all(method, h, begin, steps=STEPS):
    """Positions and momenta of many orbits, (orbits, steps + 1) each; by an integrator, or by Suris' map."""
    if isinstance(method, discrete.DiscreteLagrangian):
        q, p = method.march(*begin.T, h, steps)
        return q.T, p.T
    flow = Flow(pendulum, method, h)
    paths = [flow.march(start[:1], start[1:], steps) for start in begin]
    return np.stack([path.q[:, 0] for path in paths]), np.stack([path.p[:, 0] for path in paths])


def march_into_gaps(method, h, kind):
    """As `march_all` from `starts`, half of them; then, in rounds, from the middle of the largest empty squares."""
    marched = [march_all(method, h, starts(h, kind, FIRST))]
    seen = visited(*marched[0], h, kind)
    for _ in range(ROUNDS):
        # A few at a time: one orbit fills all islands of its chain.
        into = gaps(seen, (ORBITS - FIRST) // ROUNDS, top(h, kind))
        if not len(into):
            break
        marched.append(march_all(method, h, into[:, :2]))
        seen |= visited(*marched[-1], h, kind)
    q, p = (np.vstack(parts) for parts in zip(*marched, strict=True))
    return q, p


def folded(q, p, period):
    """q folded to (-pi, pi], p to its own period, if it has one."""
    x = np.mod(q + np.pi, 2 * np.pi) - np.pi
    return x, p if period is None else np.mod(p + period / 2, period) - period / 2


def visited(q, p, h, kind):
    """Which cells of the picture the orbits visit, (CELLS, CELLS) of bool: rows of q, columns of p."""
    half = top(h, kind)
    x, y = folded(q.ravel(), p.ravel(), 2 * np.pi / h if kind in ("standard", "suris") else None)
    counts, _, _ = np.histogram2d(x, y, bins=CELLS, range=[[-np.pi, np.pi], [-half, half]])
    return counts > 0


def gaps(seen, count, half):
    """The largest empty squares, none of which overlap, (n, 3), n <= count: q and p of the middle, side in cells."""
    taken, found = seen.copy(), []
    for side in range(CELLS // 4, 0, -1):
        sums = np.zeros((CELLS + 1, CELLS + 1), dtype=np.int64)
        sums[1:, 1:] = np.cumsum(np.cumsum(taken, axis=0), axis=1)
        inside = sums[side:, side:] - sums[:-side, side:] - sums[side:, :-side] + sums[:-side, :-side]
        for i, j in np.argwhere(inside == 0):
            if len(found) == count:
                return np.array(found)
            if not taken[i : i + side, j : j + side].any():
                taken[i : i + side, j : j + side] = True
                x, y = 2 * (i + side / 2) / CELLS - 1, 2 * (j + side / 2) / CELLS - 1
                found.append((np.pi * x, half * y, side))
    return np.array(found)


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


def energy(q, p):
    """Of the pendulum."""
    return p * p / 2 - np.cos(q)


def experiment(say):
    """March 200 orbits exactly and by each of the eight maps; measure what they keep and how fast neighbours part."""
    marched, rows, checks, exponents = [], [], [], {}
    for title, method, h, kind in panels():
        say(f"{title}: {ORBITS} orbits of {STEPS:,} steps")
        if kind == "control":
            q, p = march_all(method, h, starts(h, kind))
            above = energy(q, p)[:60] + 1  # the librations that start at rest, up to 125 degrees
            gain = float(np.median(above[:, -1] / above[:, 0]))
            rows.append([title, f"energy x {gain:.2g}", None, None])
            grows = method.name == "explicit-euler"
            claim = f"{title}: {'spirals outwards' if grows else 'loses energy'}"
            checks.append(Check(claim, gain > 1.5 if grows else gain < 0.5, f"energy x {gain:.2g} in {STEPS:,} steps"))
            marched.append((title, h, kind, q, p, None))
            continue
        q, p = march_into_gaps(method, h, kind) if kind == "standard" else march_all(method, h, starts(h, kind))
        if kind == "exact":
            spread = float(np.ptp(energy(q, p), axis=1).max())
            # Rotations grow to 1,500 radians, whose rounding the force feels in each of 2,000 steps.
            checks.append(Check(f"{title}: the energy is constant", spread < 5e-12, f"{spread:.1e}"))
            rows.append([title, f"energy to {spread:.0e}", None, None])
            marched.append((title, h, kind, q, p, np.zeros(len(q))))
            continue
        rates = lyapunov_exponents(q, h, kind)
        exponents[title] = float(rates.max())
        wild = visited(q[rates > CHAOTIC], p[rates > CHAOTIC], h, kind)
        kept = "symplectic"
        if kind == "suris":
            spread = float(np.ptp(method.integral(q[:, :-1], q[:, 1:], h), axis=1).max())
            kept = f"symplectic, and an integral to {spread:.0e}"
            # Positions of rotations grow to 6,000 radians: each of the 2,000 steps rounds them by up to 5e-13.
            checks.append(Check(f"{title}: its integral is constant", spread < 5e-11, f"{spread:.1e}"))
            checks.append(Check(f"{title}: no orbit is chaotic", rates.max() < REGULAR, f"{rates.max():.4f} per step"))
        else:
            largest = max((side / CELLS for *_, side in gaps(visited(q, p, h, kind), 1, top(h, kind))), default=0.0)
            claim = f"{title}: no island is left empty"
            checks.append(Check(claim, largest < EMPTY, f"at most {largest:.1%} of the width"))
        if kind == "standard" and h >= 1.0:
            claim = f"{title}: neighbours part exponentially near the separatrix"
            checks.append(Check(claim, rates.max() > 0.2, f"{rates.max():.3f} per step"))
        rows.append([title, kept, float(rates.max()), f"{np.mean(wild):.0%}"])
        marched.append((title, h, kind, q, p, rates))
    table = Table(
        f"{ORBITS} orbits of {STEPS:,} steps by each map",
        ["map", "what is kept", "largest Lyapunov exponent per step", "area of chaos"],
        rows,
    )
    return StudyResult(
        tables=[table],
        checks=checks,
        figures={"pendulum": lambda: draw(marched)},
        record={"largest_lyapunov_exponent_per_step": exponents},
    )


def draw(marched):
    """Nine phase portraits, the exact separatrix in each; chaotic orbits in another colour than regular ones."""
    from orbits import plotting

    figure = plotting.figure(15, 16.2)
    axes = figure.subplots(3, 3, sharex=True, sharey=True)
    style = plotting.style
    for axis, (title, h, kind, q, p, rates) in zip(axes.flat, marched, strict=True):
        separatrix(axis)
        if kind == "control":
            cloud(axis, q, p, style.SKY, alpha=0.35)
            cloud(axis, q[SHOWN : SHOWN + 1], p[SHOWN : SHOWN + 1], style.INK, "o", ms=2.0)
        else:
            period = None if kind == "exact" else 2 * np.pi / h
            for chosen, colour in ((rates <= CHAOTIC, style.BLUE), (rates > CHAOTIC, style.VERMILION)):
                cloud(axis, q[chosen], p[chosen], colour, period=period)
        axis.set_title(title)
        axis.set(xlim=(-np.pi, np.pi), ylim=(-3, 3), xticks=[-np.pi, 0, np.pi], yticks=[-2, 0, 2])
        axis.set_xticklabels(["−π", "0", "π"])
    for axis in axes[:, 0]:
        axis.set_ylabel("momentum p")
    for axis in axes[-1]:
        axis.set_xlabel("angle q")
        # Labels at the ends stay within their panel, or "π" and "−π" of neighbours run into each other.
        for label, side in zip(axis.get_xticklabels(), ("left", "center", "right"), strict=True):
            label.set_horizontalalignment(side)
    figure.suptitle(
        f"The pendulum, exactly and by eight maps: {ORBITS} orbits of {STEPS:,} steps", fontsize=20, fontweight="bold"
    )
    figure.legend(handles=legend(), loc="outside lower center", ncols=2, fontsize=15)
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


def separatrix(axis):
    """The exact separatrix, dashed."""
    from orbits.plotting import style

    q = np.linspace(-np.pi, np.pi, 361)
    for sign in (1, -1):
        axis.plot(q, sign * SEPARATRIX * np.cos(q / 2), color=style.INK, lw=1.4, ls=(0, (4, 3)), zorder=3)


def cloud(axis, q, p, colour, marker=",", *, period=None, **look):
    """All points of the orbits that fall into the picture, q folded to (-pi, pi], p by the map's own period 2 pi/h."""
    x, y = folded(q.ravel(), p.ravel(), period)
    if period is not None:
        x, y = np.tile(x, 3), np.concatenate([y, y + period, y - period])
    seen = np.abs(y) < 3
    axis.plot(x[seen], y[seen], marker, color=colour, mew=0, **look)


scenario = Study(
    name="pendulum",
    title="The pendulum exactly and by eight maps: spirals, islands, chaos, and an integrable map",
    experiment=experiment,
    certifies=[
        (pendulum, orbits.StormerVerlet(), 0.1),
        (pendulum, orbits.methods.RungeKutta4(), 0.1),
        (pendulum, orbits.methods.ExplicitEuler(), 0.02),
    ],
)

if __name__ == "__main__":
    scenario.main()
