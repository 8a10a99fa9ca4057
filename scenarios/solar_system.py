"""The Solar System for a thousand years: Sun, planets and Pluto from JPL's DE440, to the round-off floor.

Newtonian point masses from J2000 with steps of six days: Gauss collocation with 8 stages, Störmer–Verlet, and RK4 and
explicit Euler as controls that lose angular momentum, together with REBOUND's WHFast and IAS15. Positions are measured
against Gauss with shorter steps, which cannot reveal errors common to all Gauss methods. A check therefore runs the
same method from the ten bodies of data/solar_system_10body.json, whose positions after 10, 100 and 1,000 years are
known from a Taylor integration in quadruple precision.

Errors of the model are not measured here: from 2000 to 2030 Mercury deviates from DE440 by 5,400 km, the Earth by
1,800.
"""

import json
import math
from fractions import Fraction

import numpy as np
from astropy import units as u

import orbits
from orbits.ephemeris import AU_KM
from orbits.resources import data_path
from orbits.scenario import Check, angular_momentum_checks

METHODS = [orbits.Gauss(stages=8), orbits.StormerVerlet(), orbits.methods.RungeKutta4(), orbits.methods.ExplicitEuler()]
ROUND_OFF = 1e-14
DT = 6 * u.day
POSITION_KM = 0.2
YEAR = 365.25
INNER = ("Mercury", "Venus", "Earth-Moon barycenter", "Mars")


def checks(outcome):
    """Angular momentum: at round-off where the method declares its momentum maps, visibly not where it does not. Gauss
    against quadruple precision.
    """
    controls = abs(outcome.run.step) >= DT.value
    yield from angular_momentum_checks(outcome.runs, bound=ROUND_OFF, controls=controls)
    for run in outcome.runs.values():
        if isinstance(run.integrator, orbits.Gauss) and run.times[-1] >= 10 * YEAR:
            yield against_quadruple_precision(run, outcome.scenario.dt)


def against_quadruple_precision(run, dt):
    """The method and step of a run, on the problem whose solution is bundled with 34 digits, for at most as long."""
    data = json.loads(data_path("solar_system_10body.json").read_text(encoding="utf-8"))
    years = max(int(year) for year in data["reference_years"] if int(year) * YEAR <= run.times[-1])
    start = orbits.System(data["names"], data["gm_au3_d2"], data["q"], data["v"], units=orbits.SOLAR)
    end = orbits.propagate(
        start, run.integrator, dt=dt, duration=years * YEAR, samples=2, check_step=False, progress=False
    )
    found, truth = end.q.value[-1].tolist(), data["reference_years"][str(years)]
    km = {
        name: AU_KM * math.hypot(*(Fraction(x) - Fraction(y) for x, y in zip(q, row[:3], strict=True)))
        for name, q, row in zip(data["names"], found, truth, strict=True)
    }
    worst = max(km, key=km.get)
    return Check(
        f"{run.integrator.label} is where quadruple precision is after {years:,} years",
        km[worst] < POSITION_KM,
        f"{worst} {km[worst]:.1e} km, Earth and Moon {km['EMB']:.1e} km, Jupiter {km['Jupiter']:.1e} km",
    )


def draw(outcome):
    """Orbits from above, outer and inner; conserved quantities; the error of every planet, method by method."""
    from orbits import plotting

    run, report = outcome.run, outcome.report
    figure = plotting.figure(16, 10)
    above, below = figure.subfigures(2, 1, height_ratios=[1.35, 1])
    axes = above.subplot_mosaic([["outer", "inner", "energy"], ["outer", "inner", "momentum"]])
    inside = {"Sun", *INNER}
    seen_from_above(axes["outer"], run, [name for name in run.names if name not in INNER], "outer planets and Pluto")
    seen_from_above(axes["inner"], run, [name for name in run.names if name in inside], "inner planets")
    years = run.t.to_value(u.yr)
    plotting.flatness(axes["energy"], years, run.energy().value, "energy")
    plotting.flatness(axes["momentum"], years, run.angular_momentum().value, "angular momentum")
    axes["momentum"].set_xlabel("years since J2000")
    marks = errors(below, report, [name for name in run.names if name != "Sun"]) if report is not None else ([], [])
    told = "maps: places and osculating ellipses at the end. Grey bands: the rounding of one float64, 2⁻⁵³"
    plotting.below(figure, *marks, told)
    first, last = run.epochs[0].jyear, run.epochs[-1].jyear
    method = plotting.method_words(run.integrator.label)
    steps = "adaptive steps" if run.clock.changes else f"dt = {run.dt:.4g}"
    figure.suptitle(
        f"The Solar System from {first:.0f} to {last:.0f}: {method}, {steps}",
        fontsize=21,
        fontweight="bold",
    )
    return figure


def seen_from_above(panel, run, bodies, title):
    """Places at the end of the run and the ellipses that the bodies then osculate, from the ecliptic's north pole."""
    from orbits import plotting

    end = run[len(run) - 1]
    places = plotting.in_plane(end, end.values.q)
    reach = 0.0
    for body in bodies:
        i = end.index(body)
        colour = plotting.colour(body, i)
        ellipse = plotting.osculating_ellipse(end, body)
        if ellipse is not None:
            panel.plot(ellipse[:, 0], ellipse[:, 1], lw=1.4, color=colour)
            reach = max(reach, 1.08 * np.abs(ellipse[:, :2]).max())
        panel.plot(*places[i, :2], "o", ms=9, mec="white", mew=0.8, color=colour)
        if body != "Sun":
            side = -1 if places[i, 0] < 0 else 1  # away from the Sun
            text = panel.annotate(
                plotting.short(body), places[i, :2], xytext=(8 * side, 6), textcoords="offset points", fontsize=13,
                ha="left" if side > 0 else "right", zorder=5,
            )  # fmt: skip
            plotting.halo(text)
    panel.set(xlim=(-reach, reach), ylim=(-reach, reach), title=title)
    plotting.map_axes(panel, end)
    panel.set_aspect("equal", adjustable="box")


def errors(figure, report, names):
    """The largest position error of each body: a mark for each method."""
    from orbits import plotting

    panel = figure.subplots()
    markers = "osD^vP"
    for k, row in enumerate(report.rows):
        if row.positions:
            values = [max(row.positions.get(name, np.nan), 1e-7) for name in names]
            style = {"ms": 10, "color": plotting.style.PALETTE[k], "label": plotting.method_words(row.method)}
            panel.plot(range(len(names)), values, markers[k % 6], **style)
    panel.set_xticks(range(len(names)), [plotting.short(name) for name in names])
    panel.set(yscale="log", ylabel="km", title="largest position error over the whole run")
    panel.grid(axis="y", color=plotting.style.FAINT, lw=0.6)
    return panel.get_legend_handles_labels()


scenario = orbits.scenarios.Scenario(
    name="solar_system",
    title="Sun, planets and Pluto from DE440",
    system=orbits.System.solar_system,
    integrators=METHODS,
    dt=DT,
    duration=1000 * u.yr,
    samples=1001,
    against=("whfast-corrector17", "ias15"),
    tolerances={
        "gauss": {"energy": 1e-14, "angular_momentum": ROUND_OFF, "position_km": POSITION_KM},
        "stormer-verlet": {"angular_momentum": ROUND_OFF},
    },
    checks=checks,
    draw=draw,
)

if __name__ == "__main__":
    scenario.main()
