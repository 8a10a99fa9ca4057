"""The slow turning of the planets' orbits: perihelia and nodes over five million years, and their frequencies.

Sun and planets from DE440, with relativity by the Sun, by a Wisdom–Holman map. e exp(i pomega) and sin(i/2)
exp(i Omega) of each planet, about the centre of mass of the bodies inside its orbit and in the axes of the invariable
plane, are sums of rotations: the frequencies g1 to g8 of the perihelia and s1 to s8 of the nodes, of which s5 is 0 in
these axes, and combinations of them. Each is found by frequency analysis in one planet, as the largest term that is not
another frequency's; g3 and g4, of which Earth and Mars have about equal parts, are in the order of their size, and so
are s1 and s2, of which Mercury has.
Published values serve for comparison only.

Those of the giants are constant to five digits. Those of the inner planets change, as their motion is chaotic: over a
hundred million years by 0.2 arcseconds a year. A Fourier transform of five million years resolves 0.26.

Source: Laskar (1990), Icarus 88, 266, for the method and the resonances; Laskar et al. (2004), A&A 428, 261, table 3,
for the published values.
"""

from functools import lru_cache

import numpy as np
from astropy import units as u

import orbits
from orbits.scenarios import Check
from orbits.terms import PostNewtonian

EPOCH = "2000-01-01 12:00"
BODIES = ("Sun", "Mercury", "Venus", "Earth-Moon barycenter", "Mars", "Jupiter", "Saturn", "Uranus", "Neptune")
DT = 2.5 * u.day
"""Mercury's eccentricity grows to 0.29, where a full turn at the speed of its perihelion takes 46 days."""
ARCSEC = np.pi / 180 / 3600
BAND = (-60.0, 60.0)
"""Frequencies of terms [arcseconds per year]."""
TERMS = 10
TERMS_OF_THE_SUN = (PostNewtonian(sources=["Sun"]),)
"""Relativity adds 0.43 arcseconds a year to the motion of Mercury's perihelion, and 0.38 to g1."""
LONG_ENOUGH, LONGER, LONGEST = 2e6, 4.5e6, 9.5e6
"""Years from which on the frequencies of the giants, of the inner planets, and s2 as closely as these are demanded."""

PUBLISHED = {
    "g1": 5.59, "g2": 7.452, "g3": 17.368, "g4": 17.916, "g5": 4.257452, "g6": 28.2450, "g7": 3.087951, "g8": 0.673021,
    "s1": -5.59, "s2": -7.05, "s3": -18.850, "s4": -17.755, "s6": -26.347855, "s7": -2.9925259, "s8": -0.691736,
}  # fmt: skip
"""Arcseconds per year, with relativity: over 20 million years for the inner planets, over 50 for the others."""

NAMED = {
    "g": {"g5": "Jupiter", "g6": "Saturn", "g8": "Neptune", "g7": "Uranus",
          "g1": "Mercury", "g2": "Venus", "g3": "Earth-Moon barycenter", "g4": "Earth-Moon barycenter"},
    "s": {"s6": "Saturn", "s8": "Neptune", "s7": "Uranus",
          "s1": "Mercury", "s4": "Mars", "s3": "Earth-Moon barycenter", "s2": "Mercury"},
}  # fmt: skip
"""The planet in which each frequency is looked for, in this order: first those of the giants, which are in all."""


GIANTS = ("g5", "g6", "g7", "g8", "s6", "s7", "s8")
SHOWN = ("Mercury", "Earth-Moon barycenter", "Mars", "Jupiter", "Saturn")


def system():
    """Sun and planets at J2000, with relativity by the Sun."""
    return orbits.System.solar_system(epoch=EPOCH, bodies=list(BODIES)).with_terms(*TERMS_OF_THE_SUN)


def years(run):
    """The times of the samples [yr]."""
    return run.t.to_value(u.yr)


@lru_cache(maxsize=1)
def turning(run):
    """Return e exp(i pomega) and sin(i/2) exp(i Omega) of each planet, in the axes of the invariable plane."""
    elements = run.elements(primary="jacobi", frame="icrf")
    pole = run.angular_momentum()[0].value
    z = pole / np.linalg.norm(pole)
    x = np.cross([0.0, 0.0, 1.0], z) / np.hypot(z[0], z[1])
    axes = np.array([x, np.cross(z, x), z])
    inc, node, perihelion = (getattr(elements, name).to_value(u.rad) for name in ("inc", "Omega", "omega"))
    normal = np.stack([np.sin(inc) * np.sin(node), -np.sin(inc) * np.cos(node), np.cos(inc)], axis=-1) @ axes.T
    towards = np.stack(
        [
            np.cos(node) * np.cos(perihelion) - np.sin(node) * np.sin(perihelion) * np.cos(inc),
            np.sin(node) * np.cos(perihelion) + np.cos(node) * np.sin(perihelion) * np.cos(inc),
            np.sin(perihelion) * np.sin(inc),
        ],
        axis=-1,
    ) @ axes.T  # fmt: skip
    node = np.arctan2(normal[..., 0], -normal[..., 1])
    line = np.stack([np.cos(node), np.sin(node), np.zeros_like(node)], axis=-1)
    perihelion = np.arctan2(np.sum(towards * np.cross(normal, line), axis=-1), np.sum(towards * line, axis=-1))
    tilt = np.sqrt(0.5 * (1.0 - normal[..., 2]))
    e = elements.e.value * np.exp(1j * (node + perihelion))
    return {"g": dict(zip(elements.names, e.T, strict=True)),
            "s": dict(zip(elements.names, (tilt * np.exp(1j * node)).T, strict=True))}  # fmt: skip


@lru_cache(maxsize=1)
def frequencies(run):
    """Return {"g1": arcseconds per year, ...} of the planets that there are."""
    found = {}
    for kind, order in NAMED.items():
        mine = []
        for name, planet in order.items():
            if planet not in run.names:
                continue
            band = tuple(limit * ARCSEC for limit in BAND)
            terms = orbits.diagnostics.frequency_analysis(years(run), turning(run)[kind][planet], TERMS, band=band)
            others = np.abs(terms.frequency[:, None] - np.array([found[k] * ARCSEC for k in mine])).T
            free = (others > terms.resolution).all(axis=0) if mine else np.ones(len(terms), dtype=bool)
            if free.any():
                found[name] = float(terms.frequency[np.argmax(free)] / ARCSEC)
                mine.append(name)
    if found.get("g3", 0.0) > found.get("g4", 100.0):
        found["g3"], found["g4"] = found["g4"], found["g3"]
    if found.get("s1", 0.0) < found.get("s2", -100.0):
        found["s1"], found["s2"] = found["s2"], found["s1"]
    return {name: found[name] for name in PUBLISHED if name in found}


def bound(name, span):
    """How far a frequency may be from the published one after `span` years [arcseconds per year].

    s2 is modulated the most, by the resonance of g1 - g5 with s1 - s2, which takes longer than five million years: over
    the first five it is 6.95, over the next five 7.03, over both 7.03.
    """
    return 0.15 if name == "s2" and span < LONGEST else 0.05


def checks(outcome):
    """Momentum is kept, and the frequencies are those published."""
    run = outcome.run
    drift = run.drift()
    yield Check(
        "the angular momentum is kept", drift.angular_momentum.max_fraction < 1e-12,
        f"{drift.angular_momentum.max_fraction:.1e}",
    )  # fmt: skip
    yield Check("the energy is kept", drift.energy.max_fraction < 1e-9, f"{drift.energy.max_fraction:.1e}")
    if abs(years(run)[-1]) < LONG_ENOUGH:
        return
    span = abs(years(run)[-1])
    for name, value in frequencies(run).items():
        if name not in GIANTS and span < LONGER:
            continue
        yield Check(
            f'{name} is the published one to {bound(name, span):g}"/yr',
            abs(value - PUBLISHED[name]) < bound(name, span),
            f"{value:.4f}, published {PUBLISHED[name]:g}",
        )


def draw(outcome):
    """Eccentricities and inclinations over time, their spectra, and the frequencies beside published ones."""
    from orbits import plotting

    run = outcome.run
    figure = plotting.figure(20, 12.5)
    panels = figure.subplot_mosaic(
        [["e", "g", ".", "table"], ["i", "s", ".", "table"]], width_ratios=[1.25, 1.25, 0.07, 0.72]
    )
    shown = [name for name in run.names[1:] if name in SHOWN]
    inner = [name for name in shown if name not in ("Jupiter", "Saturn")] or shown
    myr = years(run) / 1e6
    for name in inner:
        z, tilt = turning(run)["g"][name], turning(run)["s"][name]
        look = {"lw": 1.3, "color": colour(name)}
        panels["e"].plot(myr, np.abs(z), **look)
        panels["i"].plot(myr, np.degrees(2 * np.arcsin(np.abs(tilt))), **look)
    panels["e"].set(ylabel="eccentricity", ylim=(0, None))
    panels["i"].set(ylabel="inclination to the invariable plane [°]", ylim=(0, None), xlabel="million years from J2000")
    for kind, limits in (("g", (-2, 31)), ("s", (-31, 2))):
        spectrum(panels[kind], run, kind, shown, limits)
    panels["s"].set(xlabel="frequency [arcseconds per year]")
    table(panels["table"], run)
    handles, labels = panels["g"].get_legend_handles_labels()
    absent = [plotting.short(name) for name in run.names[1:] if name not in shown]
    left_out = f"; {', '.join(absent[:-1])} and {absent[-1]} not drawn" if len(absent) > 1 else ""
    told = (
        "Spectra with the window of the frequency analysis; dashed: the frequencies found. Right: arcseconds per year; "
        "published values over 20 (inner planets) and 50 million years, Laskar et al. (2004)"
        + left_out
    )
    plotting.below(figure, handles, labels, told)
    figure.suptitle(
        f"Perihelia and nodes of the planets over {abs(myr[-1]):.3g} million years and their frequencies",
        fontsize=22, fontweight="bold",
    )  # fmt: skip
    return figure


def colour(name):
    """The colour of a planet. Jupiter's own is much like that of Mars, which it crosses here."""
    from orbits import plotting

    return plotting.style.GREEN if name == "Jupiter" else plotting.colour(name, 0)


def spectrum(panel, run, kind, shown, limits):
    """Draw the amplitudes of a Fourier transform, and where the frequencies are."""
    from orbits import plotting

    t = years(run)
    n = len(t)
    window = 1.0 + np.cos(2 * np.pi * (np.arange(n) / (n - 1) - 0.5))
    grid = 2 * np.pi * np.fft.fftfreq(4 * n, t[1] - t[0]) / ARCSEC
    order = np.argsort(grid)
    order = order[(grid[order] > limits[0]) & (grid[order] < limits[1])]
    for name in shown:
        size = np.abs(np.fft.fft(window * turning(run)[kind][name], 4 * n)) / n
        look = {"lw": 1.5, "color": colour(name), "label": plotting.short(name)}
        panel.plot(grid[order], size[order], **look)
    for name, value in frequencies(run).items():
        if name[0] == kind and limits[0] < value < limits[1]:
            panel.axvline(value, color=plotting.style.GREY, lw=0.9, ls=(0, (5, 3)), zorder=0)
            aside = {"g7": -0.45, "g5": -0.2, "g1": 0.25, "g3": -0.5, "g4": 0.5, "s4": 0.3, "s3": -0.3}.get(name, 0.0)
            panel.text(value + aside, 1.01, name, transform=panel.get_xaxis_transform(), ha="center", fontsize=13)
    label = {"g": "e exp(iϖ)", "s": "sin(i/2) exp(iΩ)"}[kind]
    panel.set(yscale="log", ylim=(1e-5, 0.4 if kind == "g" else 0.12), xlim=limits, ylabel=f"amplitude in {label}")


def table(panel, run):
    """Write the frequencies beside the published ones."""
    from orbits import plotting

    panel.set_axis_off()
    rows = [("", "here", "published", "period")]
    for name, value in frequencies(run).items():
        rows.append((name, f"{value:.3f}", f"{PUBLISHED[name]:.3f}", f"{1.296e3 / abs(value):,.0f} kyr"))
    for k, row in enumerate(rows):
        for place, text in zip((0.0, 0.36, 0.68, 1.0), row, strict=True):
            panel.text(
                place, 0.97 - 0.058 * k, text.replace("-", "−"), transform=panel.transAxes, fontsize=15,
                ha="left" if place == 0.0 else "right", color=plotting.style.GREY if k == 0 else plotting.style.INK,
            )  # fmt: skip


scenario = orbits.scenarios.Scenario(
    name="secular",
    title="Perihelia and nodes of the planets over five million years",
    system=system,
    integrators=[orbits.WisdomHolman()],
    dt=DT,
    duration=5e6 * u.yr,
    samples=10_001,
    against=(),
    checks=checks,
    draw=draw,
)

if __name__ == "__main__":
    scenario.main()
