"""The 3:1 resonance with Jupiter by MEGNO: regular and chaotic orbits on a grid of semi-major axis and eccentricity.

16,384 massless asteroids in the plane of Jupiter's orbit, in the elliptic restricted problem, each with four tangent
vectors for 10,000 years: a Wisdom–Holman map, eight asteroids at a time. MEGNO is 2 on quasi-periodic orbits, less on
librating ones that are almost periodic, and grows with time on chaotic ones: they line the borders of the resonance.

Eccentricities grow to 0.6 in it, where the steps are fewer than 16 in a full turn at the pericentre. Some of these
orbits are followed again, in steps of a quarter.

Source: Cincotta, Giordano & Simó (2003), Physica D 182, 151; Wisdom (1983), Icarus 56, 51, for the chaos at 3:1.
"""

import warnings
from functools import partial

import numpy as np
from astropy import units as u

import orbits
from orbits.scenario import Check, Study, StudyResult, Table

AXES = np.linspace(2.44, 2.56, 128)
ECCENTRICITIES = np.linspace(0.02, 0.4, 128)
METHOD = orbits.WisdomHolman()
DT = 36 * u.day
DURATION = 10_000 * u.yr
JUPITER = {"gm": 9.5479e-4, "a": 5.2026, "e": 0.0485}
VECTORS = 4
SLAB = 8
"""Rows of the map that are computed at a time."""
AGAIN, FINER, SEED = 64, 4, 1
"""How many orbits with unresolved pericentres are followed again, and by how much shorter steps."""
RAISED = 2.2
"""MEGNO above this is growing, or has not come down to 2 yet, as on the borders of the resonance."""
FAR = 0.05
"""From the resonance, in au: there, below e = 0.25, orbits are regular."""


def system(axes, eccentricities):
    """Sun and Jupiter at its perihelion, and asteroids at theirs, on the other side of the Sun: so they can librate."""
    bodies = {"Sun": {"gm": orbits.SOLAR.G}, "Jupiter": {**JUPITER, "gm": JUPITER["gm"] * orbits.SOLAR.G}}
    start = orbits.System.from_elements(bodies, units=orbits.SOLAR)
    names = [f"{k}" for k in range(len(axes))]
    angles = {"omega": np.full(len(axes), np.pi) * u.rad, "M": np.zeros(len(axes)) * u.rad}
    return start.add(names, primary="Sun", a=axes * u.au, e=eccentricities, **angles)


def followed(axes, eccentricities, dt):
    """MEGNO of asteroids at the end, which pericentres are not resolved on the way, and MEGNO of Sun and Jupiter."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", orbits.errors.StepWarning)  # such pericentres, which are counted
        start = system(axes, eccentricities)
        m = orbits.megno(start, METHOD, dt=dt, duration=DURATION, samples=[DURATION], vectors=VECTORS, check_step=False)
    values = np.array([p.megno[-1] for p in m.particles])
    sharp = np.array([p.passage is not None for p in m.particles])
    return {"megno": values, "sharp": sharp, "massive": m.massive.megno[-1]}


def experiment(say, parts):
    """MEGNO of every asteroid, and what its map shows; each slab is kept, so that the study can go on."""
    axes, eccentricities = (x.ravel() for x in np.meshgrid(AXES, ECCENTRICITIES))
    say(f"{len(axes):,} asteroids for {DURATION:g} in steps of {DT:g}, each with {VECTORS} tangent vectors")
    values, sharp = np.empty(len(axes)), np.empty(len(axes), dtype=bool)
    slab = SLAB * len(AXES)
    for k in range(0, len(axes), slab):
        part = slice(k, k + slab)
        name = f"up to e = {eccentricities[part][-1]:.3f}"
        found = parts.get(name, partial(followed, axes[part], eccentricities[part], DT))
        values[part], sharp[part], massive = found["megno"], found["sharp"], float(found["massive"])
        say(f"{name}, {(k + slab) / len(axes):.0%}")
    rng = np.random.default_rng(SEED)
    some = rng.choice(np.flatnonzero(sharp), min(AGAIN, int(sharp.sum())), replace=False)
    finer = followed(axes[some], eccentricities[some], DT / FINER)["megno"] if len(some) else values[some]
    return judged(values.reshape(len(ECCENTRICITIES), len(AXES)), sharp, values[some] - finer, massive)


def judged(values, sharp, apart, massive):
    """The result, from the map, the orbits with unresolved pericentres, and differences by finer steps."""
    place = JUPITER["a"] * (1 / 3) ** (2 / 3)
    raised, near = values > RAISED, np.abs(AXES - place) < FAR
    calm = values[ECCENTRICITIES < 0.25][:, ~near]
    step = max(1, len(ECCENTRICITIES) // 16)
    rows = [
        [f"{e:.2f}", int(np.sum(row > RAISED)), float(np.min(row)), float(np.median(row)), float(np.max(row))]
        for e, row in list(zip(ECCENTRICITIES, values, strict=True))[::step]
    ]
    least = np.nanmin(values[:, near])
    share = raised[:, near].mean(), raised[ECCENTRICITIES < 0.25][:, ~near].mean()
    off = float(np.median(np.abs(apart))) if len(apart) else 0.0
    checks = [
        Check("Sun and Jupiter are regular", abs(massive - 2.0) < 0.1, f"{massive:.3f}"),
        Check("all asteroids have a MEGNO", bool(np.isfinite(values).all()), f"{np.isfinite(values).sum():,}"),
        Check("far from 3:1 MEGNO is 2", bool(np.abs(np.median(calm) - 2.0) < 0.05), f"median {np.median(calm):.3f}"),
        Check("and nowhere above 2.2", bool(share[1] == 0.0), f"{100 * share[1]:.2g} %"),
        Check("at 3:1 some orbits are above 2.2", bool(share[0] > 0.03), f"{100 * share[0]:.1f} % within {FAR:g} au"),
        Check("others librate, with MEGNO below 1", bool(least < 1.0), f"{least:.2f}"),
        Check(
            f"steps of {DT / FINER:g} show the same where pericentres are not resolved",
            bool(off < 0.02),
            f"median difference {off:.2g} of {len(apart)}; {sharp.sum():,} such orbits",
        ),
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

    figure = plotting.figure(13, 9.5)
    panel = figure.subplots()
    mesh = panel.pcolormesh(AXES, ECCENTRICITIES, values, vmin=0.0, vmax=4.0, cmap="RdYlBu_r", shading="nearest")
    panel.axvline(place, color=plotting.style.INK, lw=1.0, ls=(0, (5, 3)))
    panel.text(place, 1.01, "3:1", transform=panel.get_xaxis_transform(), ha="center", fontsize=14)
    panel.set(xlabel="semi-major axis at the start [au]", ylabel="eccentricity at the start")
    figure.colorbar(mesh, ax=panel, extend="max", label="MEGNO")
    told = (
        "2: quasi-periodic; below: librating, almost periodic; above: chaotic or not settled yet. Asteroids start at "
        f"their perihelia, Jupiter at its own on the other side of the Sun. Steps of {DT:g}"
    )
    plotting.below(figure, [], [], told)
    figure.get_layout_engine().set(w_pad=0.15)
    figure.suptitle(f"The 3:1 resonance with Jupiter after {DURATION:,.0f}", fontsize=21, fontweight="bold")
    return figure


scenario = Study(
    name="resonance_map",
    title="The 3:1 resonance with Jupiter: MEGNO over semi-major axis and eccentricity",
    experiment=experiment,
    resumable=True,
)

if __name__ == "__main__":
    scenario.main()
