"""Euler's free top: a body that spins about its middle axis turns over again and again (Dzhanibekov's flip).

The angular momentum is fixed in space; seen from the body it runs along a polhode, the curve of one energy on the
sphere of its length. About the axes of the largest and of the least moment the polhodes are small circles, about the
middle one there is a saddle: what starts near it goes round to the other side and back, the later the nearer it starts.

The motion is known in closed form, by Jacobi's elliptic functions, which are evaluated here in forty digits. The exact
rotation follows it to the rounding of the angle, for 100,000 revolutions in steps of a radian, as it leaves the energy
to the last bit of doubled precision. What is left of methods of high order is the walk of their rounding errors, which
each passage of the saddle amplifies a thousand times; of methods of low order, their phase.

Sources: Landau & Lifshitz, Mechanics, sec. 37; Ashbaugh, Chicone & Cushman (1991), J. Dyn. Diff. Eq. 3, 67, on the
twisting tennis racket.
"""

import mpmath
import numpy as np

import orbits
from orbits import rotations
from orbits.diagnostics.free_top import free_top
from orbits.lagrangians import euler_top
from orbits.scenario import Check, Study, StudyResult, Table

INERTIA = np.array([1.0, 2.0, 3.0])
RATES = np.array([1e-3, 1.0, 1e-3])
"""Near the middle axis, so that it takes some turns to leave it."""

END, SAMPLES = 120.0, 4801
REVOLUTIONS, FEWER, EVERY = 100_000, 10_000, 10
MARKS = np.unique(np.round(np.geomspace(1, REVOLUTIONS / EVERY, 13)).astype(int))
STARTS = 3


def methods():
    """(method, steps in a revolution, the most revolutions, colour) of each curve of errors."""
    lgvi = orbits.methods.LieGroupVariational()
    return [
        (orbits.StormerVerlet(), 6, REVOLUTIONS, 0),
        (orbits.Gauss(stages=8), 6, REVOLUTIONS, 1),
        (orbits.methods.Composition(lgvi, order=8), 40, FEWER, 2),
        (lgvi, 200, FEWER, 3),
    ]


def words(method):
    """The name of a method in this study."""
    from orbits import plotting

    if isinstance(method, orbits.methods.Composition):
        return f"LGVI, composed to order {method.order}"
    known = {orbits.StormerVerlet: "exact rotation", orbits.methods.LieGroupVariational: "LGVI, order 2"}
    return known.get(type(method)) or plotting.method_words(method.label)


def bodies():
    """Random moments, quaternions and rates: (inertia, q, rates) of `STARTS` bodies."""
    rng = np.random.default_rng(14)
    for _ in range(STARTS):
        a, b = rng.uniform(0.4, 1.0, 2)
        inertia = np.array([a, b, rng.uniform(abs(a - b), a + b)])
        q = rng.normal(size=4)
        yield inertia, q / np.linalg.norm(q), rng.normal(size=3)


def marched(lagrangian, q, p):
    """The attitude and the momentum in the axes of the body that a march of (q, p) begins with."""
    half = rotations.product(q * [1, -1, -1, -1], p)[1:] / 2.0
    return q, half


def errors(method, per_turn, most, inertia, q, rates):
    """Errors of the attitude, in radians, at the marks up to `most` revolutions."""
    top = euler_top.with_parameters(**dict(zip(("I1", "I2", "I3"), inertia, strict=True)))
    q, v = rotations.start(rates, q)
    p = top.momentum(q, v)
    dt = 2.0 * np.pi / np.linalg.norm(rates) / per_turn
    marks = MARKS[most >= MARKS * EVERY]
    path = orbits.march(top, method, q=q, p=p, dt=dt, steps=most * per_turn, every=EVERY * per_turn)
    found = []
    for mark in marks:
        steps = int(mark) * EVERY * per_turn
        attitude, _ = free_top(inertia, *marched(top, q, p), mpmath.mpf(dt) * steps)
        found.append(apart(path.q[mark], attitude))
    return marks * EVERY, np.array(found)


def apart(q, attitude):
    """The angle between the rotation of q and a matrix of mpmath, small ones to all digits."""
    R = rotations.matrices(q)
    gap = [float(attitude[i, j] - mpmath.mpf(R[i, j])) for i in range(3) for j in range(3)]
    return 2.0 * np.arcsin(min(np.linalg.norm(gap) / np.sqrt(8.0), 1.0))


def flips(t, rate):
    """The times at which a rate changes its sign."""
    k = np.flatnonzero(np.diff(np.sign(rate)) != 0)
    return t[k] - rate[k] * (t[k + 1] - t[k]) / (rate[k + 1] - rate[k])


def half_period():
    """From one flip to the next: 2 K(k)/lambda, in forty digits."""
    one, two, three = map(mpmath.mpf, INERTIA)
    pi = [mpmath.mpf(x) * mpmath.mpf(y) for x, y in zip(INERTIA, RATES, strict=True)]
    square, twice = mpmath.fdot(pi, pi), mpmath.fdot(pi, map(mpmath.mpf, RATES))
    low, high = square - twice * one, twice * three - square
    large, small = (three - two) * low, (two - one) * high
    large, small = max(large, small), min(large, small)
    return float(2 * mpmath.ellipk(small / large) / mpmath.sqrt(large / (one * two * three)))


def flight(say):
    """The flip in closed form and by three marches: tables, checks, and what is drawn."""
    t = np.linspace(0.0, END, SAMPLES)
    q, rates = rotations.free_rotation(INERTIA, t, rates=RATES)
    start, v = rotations.start(RATES)
    truth = [free_top(INERTIA, start, INERTIA * RATES, mpmath.mpf(x)) for x in t[::400]]
    closed = max(apart(one, attitude) for one, (attitude, _) in zip(q[::400], truth, strict=True))
    rows = [["closed form", None, closed]]
    chosen = (orbits.StormerVerlet(), 1.0), (orbits.Gauss(stages=8), 0.25), (orbits.methods.LieGroupVariational(), 0.01)
    for method, dt in chosen:
        say(f"{words(method)}: {END:g} units of time in steps of {dt:g}")
        steps = round(10 / dt)
        path = orbits.march(euler_top, method, q=start, v=v, dt=dt, steps=round(END / dt), every=steps)
        worst = max(apart(one, attitude) for one, (attitude, _) in zip(path.q, truth, strict=True))
        rows.append([words(method), dt, worst])
    turned = flips(t, rates[:, 1])
    gap = float(np.mean(np.diff(turned)))
    expected = half_period()
    checks = [
        Check("the closed form is that of elliptic functions", closed < 5e-14, f"{closed:.1e} radians"),
        Check("so is the exact rotation in steps of a radian", rows[1][2] < 5e-14, f"{rows[1][2]:.1e} radians"),
        Check("Gauss(8) leaves nine digits at the saddle", rows[2][2] < 3e-9, f"{rows[2][2]:.1e} radians"),
        Check("it turns over every half period", abs(gap / expected - 1) < 1e-5, f"every {gap:.4f}, {expected:.4f}"),
    ]
    table = Table(f"The attitude over {len(turned)} flips, in radians", ["method", "dt", "largest error"], rows)
    return table, checks, (t, q, rates, turned)


def experiment(say):
    """The flip, and the errors of four methods over up to 100,000 revolutions of random bodies."""
    table, checks, seen = flight(say)
    rows, curves = [], []
    for method, per_turn, most, colour in methods():
        say(f"{words(method)}: {most:,} revolutions of {STARTS} bodies")
        measured = [errors(method, per_turn, most, *body) for body in bodies()]
        revolutions = measured[0][0]
        rms = np.sqrt(np.mean([found**2 for _, found in measured], axis=0))
        worst = max(found[-1] for _, found in measured)
        rows.append([words(method), per_turn, float(rms[0]), most, float(rms[-1])])
        curves.append((words(method), revolutions, rms, colour, method))
        if isinstance(method, orbits.StormerVerlet):
            claim = f"exact rotation: {REVOLUTIONS:,} revolutions keep nine digits"
            checks.append(Check(claim, worst < 3e-10, f"{worst:.1e} radians"))
        elif method.order >= 8:
            claim = f"{words(method)}: {most:,} revolutions keep six digits"
            checks.append(Check(claim, worst < 1e-6, f"{worst:.1e} radians"))
    columns = ["method", "steps in a turn", f"error after {EVERY}", "revolutions", "error then"]
    growth = Table(f"Attitudes of {STARTS} random bodies, RMS error in radians", columns, rows)
    return StudyResult(
        tables=[table, growth],
        checks=checks,
        figures={"euler_top": lambda: draw_flip(*seen), "euler_top_errors": lambda: draw_errors(curves)},
        record={name: {"revolutions": n.tolist(), "rms": rms.tolist()} for name, n, rms, *_ in curves},
    )


def draw_flip(t, q, rates, turned):
    """Polhodes on the sphere of the momentum, the rates, and the body in space during one flip."""
    from orbits import plotting

    style = plotting.style
    figure = plotting.figure(16, 11)
    grid = figure.add_gridspec(2, 2, width_ratios=(1.0, 1.55), height_ratios=(2.3, 1.0))
    sphere(figure.add_subplot(grid[0, 0]), rates * INERTIA)
    axis = figure.add_subplot(grid[0, 1])
    for k, name in enumerate(("least", "middle", "largest")):
        axis.plot(t, rates[:, k], color=style.PALETTE[k], lw=2.4, label=f"{name} moment")
    for x in turned:
        axis.axvline(x, color=style.FAINT, lw=1.2, zorder=0)
    axis.set(xlabel="time", xlim=(0, END), ylim=(-1.3, 1.6))
    axis.set_title("Angular velocity about the axes of the body", fontweight="bold")
    axis.legend(loc="upper center", ncols=3, fontsize=14, handlelength=1.2, columnspacing=1.4)
    axis.grid(color=style.FAINT, lw=0.6)
    frames(figure.add_subplot(grid[1, :]), turned[1])
    figure.suptitle("Dzhanibekov's flip: a free body spun about its middle axis", fontsize=21, fontweight="bold")
    return figure


TOWARDS = np.array([np.cos(0.42) * np.cos(0.62), np.cos(0.42) * np.sin(0.62), np.sin(0.42)])
"""The direction, in the axes of the body, from which the sphere is seen."""


def seen(points):
    """Where points (..., 3) are in the picture: to the right, upwards, and towards the eye."""
    right = np.cross([0.0, 0.0, 1.0], TOWARDS)
    right /= np.linalg.norm(right)
    return np.moveaxis(points @ np.stack([right, np.cross(TOWARDS, right), TOWARDS], axis=1), -1, 0)


def sphere(axis, momentum):
    """Polhodes of some energies on the sphere of |momentum|, and that of the flight."""
    from matplotlib.patches import Circle

    from orbits import plotting

    style = plotting.style
    axis.add_patch(Circle((0, 0), 1.0, facecolor="#F4F4F1", edgecolor=style.GREY, lw=1.2, zorder=0))
    for k in (0, 2):
        for tilt in (0.12, 0.27, 0.42, 0.56, 0.68):
            for sign in (1.0, -1.0):
                first = np.zeros(3)
                first[k], first[1] = sign * np.cos(tilt), np.sin(tilt)
                ring(axis, polhode(first), style.PALETTE[k], 1.2)
    ring(axis, momentum / np.linalg.norm(momentum[0]), style.VERMILION, 3.2)
    for k, name in enumerate(("least", "middle", "largest")):
        x, y, _ = seen(np.outer([1.0, 1.25], np.eye(3)[k]))
        away = 1.0 + 0.15 / np.hypot(x[1], y[1])
        axis.plot(x, y, color=style.INK, lw=2.2, zorder=5)
        box = {"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 1.0}
        axis.text(away * x[1], away * y[1], name, ha="center", va="center", fontsize=14, zorder=6, bbox=box)
    axis.set(xlim=(-1.35, 1.35), ylim=(-1.2, 1.5), aspect="equal")
    axis.set_axis_off()
    axis.set_title("Angular momentum, seen from the body", fontweight="bold")


def polhode(direction):
    """The curve of the momentum from a direction, on the unit sphere."""
    return rotations.free_rotation(INERTIA, np.linspace(0.0, 60.0, 1500), rates=direction / INERTIA)[1] * INERTIA


def ring(axis, points, colour, width):
    """A curve on the sphere, faint where it is behind."""
    x, y, depth = seen(points)
    for behind, alpha in ((True, 0.22), (False, 1.0)):
        shown = (depth < 0.0) == behind
        axis.plot(np.where(shown, x, np.nan), np.where(shown, y, np.nan), color=colour, lw=width, alpha=alpha)


def frames(axis, centre):
    """The body in space at nine times of a flip: a handle with arms along its axes."""
    from orbits import plotting

    style = plotting.style
    when = np.linspace(centre - 7.0, centre + 7.0, 9)
    attitudes, _ = rotations.free_rotation(INERTIA, when, rates=RATES)
    # The momentum is along y in space, but for a thousandth: it points upwards.
    right, up, eye = np.array([0.8, 0.0, 0.6]), np.array([0.0, 1.0, 0.0]), np.array([-0.6, 0.0, 0.8])
    arms = (
        (1, np.array([[0, 0, 0], [0, 1.15, 0]])),
        (0, np.array([[-0.75, 0, 0], [0.75, 0, 0]])),
        (2, np.array([[0, 0, -0.3], [0, 0, 0.3]])),
    )
    for k, R in enumerate(rotations.matrices(attitudes)):
        for colour, ends in sorted(arms, key=lambda arm: float((arm[1] @ R.T @ eye).mean())):
            x = ends @ R.T
            look = {"color": style.PALETTE[colour], "lw": 8 if colour < 2 else 6, "solid_capstyle": "round"}
            axis.plot(x @ right + 2.6 * k, x @ up, **look)
        axis.text(2.6 * k, -1.75, f"{when[k]:.1f}", ha="center", fontsize=14, color=style.GREY)
    arrow = {"arrowstyle": "-|>", "color": style.INK, "lw": 2.4, "mutation_scale": 20}
    axis.annotate("", (-1.7, 0.75), (-1.7, -1.2), arrowprops=arrow)
    axis.text(-1.7, 0.85, "angular\nmomentum", ha="center", va="bottom", fontsize=13)
    axis.set_title("The body in space during the second flip, at the times below", fontweight="bold")
    axis.set(xlim=(-2.6, 2.6 * 8 + 1.2), ylim=(-2.0, 1.8), aspect="equal")
    axis.set_axis_off()


def draw_errors(curves):
    """Errors of the attitude against revolutions, log-log."""
    from orbits import plotting

    style = plotting.style
    figure = plotting.figure(13, 9)
    axis = figure.subplots()
    for (name, revolutions, rms, colour, _), mark in zip(curves, "osD^", strict=True):
        axis.loglog(revolutions, rms, marker=mark, ms=8, lw=2.2, color=style.PALETTE[colour], label=name)
    n = np.array([EVERY, REVOLUTIONS])
    axis.loglog(n, 2 * np.pi * n * 2.0**-53, ls=(0, (2, 3)), lw=1.4, color=style.INK, label="angle times $2^{-53}$")
    axis.set(xlabel="revolutions", ylabel="error of the attitude, radians", ylim=(1e-15, 30))
    axis.set_title("Free rotation of random bodies against elliptic functions", fontweight="bold", fontsize=19)
    axis.grid(color=style.FAINT, lw=0.6)
    axis.legend(loc="upper left", bbox_to_anchor=(0.0, 0.75), fontsize=14)
    return figure


scenario = Study(
    name="euler_top",
    title="Euler's free top and Dzhanibekov's flip, against elliptic functions",
    experiment=experiment,
    certifies=[(euler_top, orbits.Gauss(stages=4), 0.1)],
)

if __name__ == "__main__":
    scenario.main()
