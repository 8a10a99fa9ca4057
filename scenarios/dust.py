"""Dust spirals into the Sun: Poynting–Robertson drag on nine grains for 2,000 years, against the secular formula.

Sunlight pushes a grain outwards with beta times the Sun's gravity, and drags it along: it meets the light aberrated, a
little from ahead. Orbits about the remaining 1 - beta of the mass shrink and become round; averaged over a revolution,
with eta = beta G M / c,

    da/dt = -(eta / a) (2 + 3 e^2) / (1 - e^2)^(3/2),   de/dt = -(5 eta / 2 a^2) e / (1 - e^2)^(1/2),

so that a (1 - e^2) / e^(4/5) is constant, and a circular orbit takes 400 yr (a / au)^2 / beta to fall into the Sun.
Each grain starts on that orbit of its eccentricity from which it comes to 0.25 au in the time of the run. Grains take
steps of their own, which become shorter as their orbits shrink.

Source: Wyatt & Whipple (1950), ApJ 111, 134; Burns, Lamy & Soter (1979), Icarus 40, 1.
"""

from functools import lru_cache

import numpy as np
from astropy import units as u

import orbits
from orbits.scenarios import Check
from orbits.terms import RadiationPressure

BETAS, ECCENTRICITIES = (0.1, 0.2, 0.4), (0.0, 0.4, 0.8)
GRAINS = tuple((beta, e) for e in ECCENTRICITIES for beta in BETAS)
NAMES = tuple(f"beta {beta:g}, e {e:g}" for beta, e in GRAINS)
SPAN = 2000.0
"""Years in which the grains fall."""
LAST = 0.25
"""The semi-major axis [au] that they reach then."""
FINE = 20_001
"""Points of the secular solution between which it is interpolated; its error is of their number to the power -2."""
NODES, WEIGHTS = np.polynomial.legendre.leggauss(5)
BOUND_A, BOUND_E, ROUND = 2e-5, 4e-6, 6e-4
"""The most that a, as a part of itself, and e may be off, by the square of what changes in a revolution: 7e-6 and
1.3e-6 were reached. The most that e of a round orbit may be: falling inwards gives it 2 beta v / c."""


def drag(beta, gm, c):
    """Return eta = beta G M / c in au^2 / yr."""
    return (beta * gm / c).to_value(u.au**2 / u.yr)


def secular(a, e, eta, years):
    """Return a and e at times [yr], from those at the start; a is 0 once the grain has fallen."""
    if e == 0.0:
        return np.sqrt(np.maximum(a * a - 4.0 * eta * years, 0.0)), 0.0 * years
    C = a * (1.0 - e * e) / e**0.8
    # With s = e^(8/5), eta dt = -(C^2 / 4) (1 - s^(5/4))^(-3/2) ds, which is smooth.
    s = np.linspace(e**1.6, 0.0, FINE)
    width = s[0] / (FINE - 1)
    inside = s[1:, None] + 0.5 * width * (1.0 + NODES)
    steps = 0.5 * width * ((1.0 - inside**1.25) ** -1.5 @ WEIGHTS)
    time = np.concatenate([[0.0], np.cumsum(steps)]) * C * C / (4.0 * eta)
    found = np.interp(years, time, s) ** 0.625
    return C * found**0.8 / (1.0 - found**2), found


@lru_cache
def start(e, eta):
    """Return the semi-major axis [au] from which a grain comes to the last one in the span."""
    low, high = LAST, 100.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        reached = float(secular(middle, e, eta, np.array([SPAN]))[0][0])
        low, high = (middle, high) if reached < LAST else (low, middle)
    return 0.5 * (low + high)


def constants():
    """Return GM of the Sun, and the speed of light."""
    sun = orbits.System.solar_system(bodies=["Sun"]).barycentric()
    return sun, sun["Sun"].gm, 299792.458 * u.km / u.s


def system():
    """The Sun and nine grains at their perihelia, spread around it, in one plane."""
    sun, gm, c = constants()
    for k, (name, (beta, e)) in enumerate(zip(NAMES, GRAINS, strict=True)):
        a = start(e, drag(beta, gm, c)) * u.au
        speed = np.sqrt(gm * (1.0 - beta) / a * (1.0 + e) / (1.0 - e))
        turn = np.radians(40.0 * k)
        q = (a * (1.0 - e)) * np.array([np.cos(turn), np.sin(turn), 0.0])
        v = speed * np.array([-np.sin(turn), np.cos(turn), 0.0])
        sun = sun.add(name, gm=0.0 * u.au**3 / u.day**2, q=q, v=v)
    light = RadiationPressure(beta=tuple(beta for beta, _ in GRAINS), bodies=NAMES)
    return sun.with_forces(light)


@lru_cache(maxsize=1)
def measured(run):
    """Return years, and a [au] and e of each grain about 1 - beta of the Sun, (grains, samples) each, without what they
    have changed since the last perihelion, or will until the next one, beyond the average.
    """
    _, gm, c = constants()
    rows = []
    for name, (beta, e0) in zip(NAMES, GRAINS, strict=True):
        mu, eta = (gm * (1.0 - beta)).to_value(u.au**3 / u.yr**2), drag(beta, gm, c)
        r = (run[name].q - run["Sun"].q).to_value(u.au)
        v = (run[name].v - run["Sun"].v).to_value(u.au / u.yr)
        distance, h = np.linalg.norm(r, axis=1), np.linalg.norm(np.cross(r, v), axis=1)
        a = 1.0 / (2.0 / distance - (v**2).sum(axis=1) / mu)
        towards = np.cross(v, np.cross(r, v)) / mu - r / distance[:, None]
        e = np.linalg.norm(towards, axis=1)
        f = np.arctan2(h * (r * v).sum(axis=1) / mu, h * h / mu - distance)
        E = np.arctan2(np.sqrt(1.0 - e * e) * np.sin(f), e + np.cos(f))
        ahead = f - (E - e * np.sin(E))  # of the mean anomaly: h changes by -eta f
        more = (1.0 + 1.5 * e * e) * ahead + 2.0 * e * np.sin(f) - 0.25 * e * e * np.sin(2.0 * f)
        da = -2.0 * a * a * eta * mu / h**3 * more
        de = (2.0 * h * eta * ahead / (mu * a) + h * h * da / (mu * a * a)) / (2.0 * e) if e0 else 0.0
        rows.append((a - da, e - de))
    a, e = np.array(rows).swapaxes(0, 1)
    return run.t.to_value(u.yr), a, e


@lru_cache(maxsize=1)
def expected(run):
    """Return a [au] and e of each grain by the secular formula, (grains, samples) each."""
    _, gm, c = constants()
    years = run.t.to_value(u.yr)
    etas = [drag(beta, gm, c) for beta, _ in GRAINS]
    rows = [secular(start(e, eta), e, eta, years) for (_, e), eta in zip(GRAINS, etas, strict=True)]
    return tuple(np.array(rows).swapaxes(0, 1))


def checks(outcome):
    """Every grain falls as the secular formula says, and its orbit becomes round as it shrinks."""
    run = outcome.run
    (_, a, e), (known_a, known_e) = measured(run), expected(run)
    off_a, off_e = np.abs(a / known_a - 1.0).max(axis=1), np.abs(e - known_e).max(axis=1)
    for name, (_, e0), da, de in zip(NAMES, GRAINS, off_a, off_e, strict=True):
        yield Check(
            f"{name}: a and e are those of the secular formula",
            bool(da < BOUND_A and de < (BOUND_E if e0 else ROUND)),
            f"a to {da:.1e} of it, e to {de:.1e}",
        )
    yield Check("all come closer to the Sun", bool((a[:, -1] < a[:, 0]).all()), f"to {a[:, -1].max():.3f} au")


def looks():
    """A colour for each beta, a line for each eccentricity."""
    from orbits.plotting import style

    return dict(zip(BETAS, (style.BLUE, style.ORANGE, style.VERMILION), strict=True)), dict(
        zip(ECCENTRICITIES, ("-", (0, (5, 2)), (0, (1.5, 1.5))), strict=True)
    )


def draw(outcome):
    """The shrinking orbits of one grain; a, and e, of all against the formula; what is left."""
    from orbits import plotting

    run, style = outcome.run, plotting.style
    (years, a, e), (known_a, _) = measured(run), expected(run)
    colours, lines = looks()
    figure = plotting.figure(18, 12.5)
    rows = [["orbits", "fall"], ["orbits", "round"], ["orbits", "left"]]
    panels = figure.subplot_mosaic(rows, width_ratios=[1.25, 1.0])
    shrinking(panels["orbits"], run, years, a, e)
    fall, ring, left = (panels[name] for name in ("fall", "round", "left"))
    fine = np.linspace(0.0, years[-1], 400)
    _, gm, c = constants()
    for k, (beta, e0) in enumerate(GRAINS):
        look = {"color": colours[beta], "ls": lines[e0], "lw": 2.0}
        there = slice(k % 3, None, max(1, len(years) // 14))
        dots = {"marker": "o", "ls": "", "ms": 5.5, "mfc": "white", "mec": colours[beta], "mew": 1.5}
        x, y = secular(start(e0, drag(beta, gm, c)), e0, drag(beta, gm, c), fine)
        fall.plot(fine, x, **look)
        fall.plot(years[there], a[k, there], **dots)
        if e0:
            ring.plot(x, y, **look)
            ring.plot(a[k, there], e[k, there], **dots)
        left.plot(years[1:], np.maximum(np.abs(a[k] / known_a[k] - 1.0), 1e-12)[1:], **{**look, "lw": 1.5})
    fall.set(xlabel="time [yr]", ylabel="semi-major axis [au]", xlim=(0, years[-1]), ylim=(0, None))
    ring.set(xlabel="semi-major axis [au]", ylabel="eccentricity", xscale="log", ylim=(0, 0.85))
    ticks = (0.25, 0.5, 1, 2, 4)
    ring.set_xticks(ticks, [f"{x:g}" for x in ticks])
    ring.minorticks_off()
    left.set(xlabel="time [yr]", ylabel="a, off the formula", xlim=(0, years[-1]), yscale="log", ylim=(1e-10, 1e-4))
    handles = [fall.plot([], [], color=colours[beta], lw=3, label=f"β = {beta:g}")[0] for beta in BETAS]
    handles += [fall.plot([], [], color=style.GREY, ls=lines[x], lw=2.4, label=f"e = {x:g}")[0] for x in ECCENTRICITIES]
    handles += [fall.plot([], [], "o", ms=6, mfc="white", mec=style.GREY, mew=1.5, label="integrated")[0]]
    told = (
        "Lines: the formula of Wyatt and Whipple; rings: the integration. Each grain starts where it falls to "
        f"{LAST:g} au in {SPAN:,.0f} years. Below right: the squares of what changes in a revolution"
    )
    plotting.below(figure, handles, [each.get_label() for each in handles], told)
    figure.suptitle("Dust spirals into the Sun: sunlight takes energy and eccentricity", fontsize=21, fontweight="bold")
    return figure


def shrinking(panel, run, years, a, e):
    """Draw osculating orbits of the most eccentric grain of the largest beta, from light to dark."""
    import matplotlib

    from orbits import plotting

    style, k = plotting.style, GRAINS.index((max(BETAS), max(ECCENTRICITIES)))
    r = (run[NAMES[k]].q - run["Sun"].q).to_value(u.au)
    v = (run[NAMES[k]].v - run["Sun"].v).to_value(u.au / u.yr)
    mu = (run.system["Sun"].gm * (1.0 - GRAINS[k][0])).to_value(u.au**3 / u.yr**2)
    towards = np.cross(v, np.cross(r, v)) / mu - r / np.linalg.norm(r, axis=1)[:, None]
    f = np.linspace(0.0, 2.0 * np.pi, 721)
    shades = matplotlib.colormaps["YlOrRd"]
    rows = np.unique(np.searchsorted(years, np.linspace(0.0, years[-1], 13)).clip(0, len(years) - 1))
    for j, row in enumerate(rows):
        turn = np.arctan2(towards[row, 1], towards[row, 0])
        radius = a[k, row] * (1.0 - e[k, row] ** 2) / (1.0 + e[k, row] * np.cos(f))
        shade = shades(0.3 + 0.65 * j / max(1, len(rows) - 1))
        panel.plot(radius * np.cos(f + turn), radius * np.sin(f + turn), color=shade, lw=2.0)
    for height, row, depth in ((0.95, rows[0], 0.45), (0.9, rows[-1], 0.95)):
        words = f"{years[row]:,.0f} yr: a = {a[k, row]:.2f} au, e = {e[k, row]:.2f}"
        panel.text(0.97, height, words, transform=panel.transAxes, ha="right", fontsize=16, color=shades(depth))
    panel.plot(0.0, 0.0, "o", ms=13, color=style.ORANGE, mec="white", zorder=5)
    panel.set_title(f"orbits of the grain with β = {max(BETAS):g} and e = {max(ECCENTRICITIES):g}", fontsize=16)
    panel.set(xlabel="au", ylabel="au")
    panel.set_aspect("equal", adjustable="datalim")


scenario = orbits.scenarios.Scenario(
    name="dust",
    title="Dust spirals into the Sun by Poynting–Robertson drag",
    system=system,
    duration=SPAN * u.yr,
    samples=401,
    against=(),
    checks=checks,
    draw=draw,
)

if __name__ == "__main__":
    scenario.main()
