"""The 3:1 resonance with Jupiter by MEGNO: regular and chaotic orbits on a grid of semi-major axis and eccentricity.

Hundreds of massless asteroids in the plane of Jupiter's orbit, in the elliptic restricted problem, each with eight
tangent vectors for 10,000 years. MEGNO is 2 on quasi-periodic orbits, less on librating ones that are almost periodic,
and grows with time on chaotic ones: they line the borders of the resonance, thinly after so short a time.

Source: Cincotta, Giordano & Simó (2003), Physica D 182, 151; Wisdom (1983), Icarus 56, 51, for the chaos at 3:1.
"""

import numpy as np
from astropy import units as u

import orbits
from orbits.scenario import Check, Study, StudyResult, Table

AXES = np.linspace(2.44, 2.56, 31)
ECCENTRICITIES = np.linspace(0.02, 0.38, 13)
METHOD = orbits.Gauss(stages=8)
DT = 60 * u.day
"""Eccentricities grow to 0.6, which splittings of second order resolve with steps of a few days only: with longer ones
orbits look chaotic that are not."""
DURATION = 10_000 * u.yr
JUPITER = {"gm": 9.5479e-4, "a": 5.2026, "e": 0.0485}
RAISED = 2.2
"""MEGNO above this is growing, or has not come down to 2 yet, as on the borders of the resonance."""
FAR = 0.05
"""From the resonance, in au: there, below e = 0.25, orbits are regular."""


def system(axes, eccentricities):
    """Sun and Jupiter at its perihelion, and asteroids at theirs, on the other side of the Sun: so they can librate."""
    bodies = {"Sun": {"gm": orbits.SOLAR.G}, "Jupiter": {**JUPITER, "gm": JUPITER["gm"] * orbits.SOLAR.G}}
    start = orbits.System.from_elements(bodies, units=orbits.SOLAR)
    a, e = (x.ravel() for x in np.meshgrid(axes, eccentricities))
    names = [f"{k}" for k in range(len(a))]
    angles = {"omega": np.full(len(a), np.pi) * u.rad, "M": np.zeros(len(a)) * u.rad}
    return start.add(names, primary="Sun", a=a * u.au, e=e, **angles)


def experiment(say):
    """MEGNO of every asteroid, and what its map shows."""
    start = system(AXES, ECCENTRICITIES)
    say(f"{len(start) - 2} asteroids for {DURATION:g}, each with 8 tangent vectors")
    m = orbits.megno(start, METHOD, dt=DT, duration=DURATION, samples=[DURATION])
    values = np.array([p.megno[-1] for p in m.particles]).reshape(len(ECCENTRICITIES), len(AXES))
    place = JUPITER["a"] * (1 / 3) ** (2 / 3)
    raised, near = values > RAISED, np.abs(AXES - place) < FAR
    calm = values[ECCENTRICITIES < 0.25][:, ~near]
    rows = [
        [f"{e:.2f}", int(np.sum(row > RAISED)), float(np.min(row)), float(np.median(row)), float(np.max(row))]
        for e, row in zip(ECCENTRICITIES, values, strict=True)
    ]
    least = values[:, near].min()
    share = raised[:, near].mean(), raised[ECCENTRICITIES < 0.25][:, ~near].mean()
    checks = [
        Check("Sun and Jupiter are regular", abs(m.massive.megno[-1] - 2.0) < 0.1, f"{m.massive.megno[-1]:.3f}"),
        Check("far from 3:1 MEGNO is 2", np.abs(np.median(calm) - 2.0) < 0.05, f"median {np.median(calm):.3f}"),
        Check("and nowhere above 2.2", share[1] == 0.0, f"{100 * share[1]:.1f} %"),
        Check("at 3:1 some orbits are above 2.2", share[0] > 0.03, f"{100 * share[0]:.1f} % within {FAR:g} au"),
        Check("others librate, with MEGNO below 1", least < 1.0, f"{least:.2f}"),
    ]
    return StudyResult(
        tables=[Table("MEGNO by eccentricity", ["e", "above 2.2", "least", "median", "largest"], rows)],
        checks=checks,
        figures={"resonance_map": lambda: draw(values, place)},
        record={"a": AXES.tolist(), "e": ECCENTRICITIES.tolist(), "megno": values.tolist()},
    )


def draw(values, place):
    """The map: MEGNO over a and e."""
    from orbits import plotting

    figure = plotting.figure(13, 8.6)
    panel = figure.subplots()
    mesh = panel.pcolormesh(AXES, ECCENTRICITIES, values, vmin=0.0, vmax=4.0, cmap="RdYlBu_r", shading="nearest")
    panel.axvline(place, color=plotting.style.INK, lw=1.0, ls=(0, (5, 3)))
    panel.text(place, 1.01, "3:1", transform=panel.get_xaxis_transform(), ha="center", fontsize=14)
    panel.set(xlabel="semi-major axis at the start [au]", ylabel="eccentricity at the start")
    figure.colorbar(mesh, ax=panel, extend="max", label="MEGNO")
    told = (
        "2: quasi-periodic; below: librating, almost periodic; above: chaotic or not settled yet. Asteroids start at "
        "their perihelia, Jupiter at its own on the other side of the Sun"
    )
    plotting.below(figure, [], [], told)
    figure.suptitle(f"The 3:1 resonance with Jupiter after {DURATION:,.0f}", fontsize=21, fontweight="bold")
    return figure


scenario = Study(
    name="resonance_map",
    title="The 3:1 resonance with Jupiter: MEGNO over semi-major axis and eccentricity",
    experiment=experiment,
)

if __name__ == "__main__":
    scenario.main()
