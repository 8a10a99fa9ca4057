"""The asteroid belt for a century: Sun, planets and more than a thousand real asteroids, compared with REBOUND.

The brightest main-belt asteroids and Jupiter Trojans of JPL's Small-Body Database as massless particles among Sun and
planets from DE440, by Gauss collocation and Störmer–Verlet, with RK4 and explicit Euler as controls. Kirkwood's gaps
are where they should be, and the angular momentum of the massive bodies is constant to sixteen digits. All are
Newtonian point masses: after a century, DE440 puts Mercury 23,000 km and Jupiter 500 km elsewhere.
"""

import numpy as np
from astropy import units as u

import orbits
from orbits.scenario import angular_momentum_checks

EPOCH = "2022-08-09"
PLANETS = ("Sun", "Mercury", "Venus", "Earth-Moon barycenter", "Mars", "Jupiter", "Saturn", "Uranus", "Neptune")
METHODS = [orbits.Gauss(stages=8), orbits.StormerVerlet(), orbits.methods.RungeKutta4(), orbits.methods.ExplicitEuler()]
ROUND_OFF = 1e-14
DT = 6 * u.day
BELT, TROJANS = 1100, 150
RESONANCES = ((4, 1), (3, 1), (5, 2), (7, 3), (2, 1), (3, 2))
FAMILIES = ("Flora", "Vesta", "Phocaea", "Maria", "Eunomia", "Koronis", "Eos", "Themis", "Cybele", "Hilda")


def system():
    """Sun and planets with the brightest asteroids of the belt and of the Trojan clouds."""
    planets = orbits.System.solar_system(epoch=EPOCH, bodies=list(PLANETS))
    belt = planets.add_particles(orbits.asteroids(BELT, classes="belt"))
    return belt.add_particles(orbits.asteroids(TROJANS, classes="trojan"))


def checks(outcome):
    """Angular momentum of the massive bodies: kept where declared, lost where not; asteroids where they belong."""
    controls = abs(outcome.run.step) >= DT.value
    yield from angular_momentum_checks(outcome.runs, bound=ROUND_OFF, controls=controls)
    a, e, _ = mean_elements(outcome.run)
    inside = np.isfinite(a) & (a > 1.5) & (a < 6.0) & (e < 1.0)
    yield orbits.scenarios.Check(
        "every asteroid is still bound and between Mars and Saturn", inside.all(), f"{inside.sum()} of {len(a)}"
    )


def particles(run):
    """Return the columns of the massless bodies."""
    return np.flatnonzero(~run.system.massive)


def mean_elements(run):
    """Return a [au], e and i [deg] of the asteroids, averaged over the samples: families stand out better so."""
    elements = run.elements(primary="Sun")
    columns = particles(run) - 1  # the Sun, first, has no elements about itself
    mean = {name: getattr(elements, name)[:, columns].mean(axis=0) for name in ("a", "e", "inc")}
    return mean["a"].to_value(u.au), mean["e"].value, mean["inc"].to_value(u.deg)


def resonance(run, p, q):
    """Return the semi-major axis [au] at which an asteroid goes round p times while Jupiter does q times."""
    jupiter = run.elements(primary="Sun")["Jupiter"].a.to_value(u.au).mean()
    return jupiter * (q / p) ** (2 / 3)


def zones(run, a):
    """Yield the belt's zones between the main gaps, and the Trojans: label, colour, which asteroids."""
    from orbits.plotting import style

    edges = [0.0, resonance(run, 3, 1), resonance(run, 5, 2), resonance(run, 2, 1), 4.6, np.inf]
    labels = ("inner belt", "middle belt", "outer belt", "Cybele and Hilda groups", "Jupiter Trojans")
    colours = (style.BLUE, style.GREEN, style.VERMILION, style.PURPLE, style.ORANGE)
    for label, colour, low, high in zip(labels, colours, edges[:-1], edges[1:], strict=True):
        yield label, colour, (a >= low) & (a < high)


def draw(outcome):
    """The belt in elements and in space, and what is conserved."""
    run = outcome.run
    return {"asteroid_belt": belt_figure(outcome), "asteroid_belt_from_above": from_above(run)}


def belt_figure(outcome):
    """Histogram of semi-major axes with Kirkwood's gaps, a-e and a-i maps, and the conserved angular momentum."""
    from orbits import plotting

    run = outcome.run
    a, e, inclination = mean_elements(run)
    figure = plotting.figure(16, 11)
    axes = figure.subplot_mosaic(
        [["histogram", "momentum"], ["e", "energy"], ["i", "errors"]], width_ratios=[1.75, 1], height_ratios=[1.1, 1, 1]
    )
    for _, colour, chosen in zones(run, a):
        axes["histogram"].hist(a[chosen], bins=np.arange(2.0, 4.1, 0.0125), color=colour)
        axes["e"].plot(a[chosen], e[chosen], ".", ms=4.5, mew=0, color=colour)
        axes["i"].plot(a[chosen], inclination[chosen], ".", ms=4.5, mew=0, color=colour)
    labels = {"histogram": "asteroids per 0.0125 au", "e": "eccentricity", "i": "inclination, ecliptic [°]"}
    for name, label in labels.items():
        axes[name].set(xlim=(2.0, 4.1), ylabel=label)
        for p, q in RESONANCES:
            place = resonance(run, p, q)
            axes[name].axvline(place, color=plotting.style.GREY, lw=1.0, ls=(0, (5, 3)), zorder=0)
            if name == "histogram":
                axes[name].text(place, 1.01, f"{p}:{q}", transform=axes[name].get_xaxis_transform(), ha="center",
                                fontsize=14)  # fmt: skip
    names = [run.names[i] for i in particles(run)]
    for namesake in set(FAMILIES) & set(names):
        k = names.index(namesake)
        spot = {"ms": 6, "mfc": "none", "mec": plotting.style.INK, "mew": 1.0}
        axes["i"].plot(a[k], inclination[k], "o", **spot)
        text = axes["i"].annotate(namesake, (a[k], inclination[k]), xytext=(6, 5), textcoords="offset points",
                                  fontsize=13)  # fmt: skip
        plotting.halo(text)
    axes["e"].set_ylim(0, 0.4)
    axes["i"].set(ylim=(0, 35), xlabel="semi-major axis about the Sun [au]; elements are means over the run")
    years = run.t.to_value(u.yr)
    plotting.flatness(axes["momentum"], years, run.angular_momentum().value, "angular momentum of Sun and planets")
    plotting.flatness(axes["energy"], years, run.energy().value, "energy of Sun and planets")
    axes["energy"].set_xlabel("years since " + EPOCH)
    if outcome.report is not None:
        method_bars(axes["errors"], outcome.report, run)
    told = (
        "dashed: mean-motion resonances with Jupiter, 3:1 being three revolutions to its one; rings: what families and "
        "groups are named after; bands: 2⁻⁵³, a float64's rounding"
    )
    plotting.below(figure, [], [], told)
    steps = "adaptive steps" if run.clock.changes else f"dt = {run.dt:.3g}"
    figure.suptitle(
        f"{len(a):,} asteroids over {abs(years[-1]):.0f} years and Kirkwood's gaps: "
        f"{plotting.method_words(run.integrator.label)}, {steps}",
        fontsize=21, fontweight="bold",
    )  # fmt: skip
    return figure


def method_bars(panel, report, run):
    """Position errors of all asteroids, method by method: the spread from the median to the worst."""
    from orbits import plotting

    names = [run.names[i] for i in particles(run)]
    rows = [row for row in report.rows if row.positions]
    for k, row in enumerate(rows):
        values = np.maximum([row.positions.get(name, np.nan) for name in names], 1e-9)
        panel.hist(values, bins=np.logspace(-8, 10, 109), color=plotting.style.PALETTE[k], alpha=0.75,
                   label=plotting.method_words(row.method))  # fmt: skip
    panel.set(xscale="log", xlabel="largest position error [km]", ylabel="asteroids", title="error of each asteroid")
    panel.legend(fontsize=13, loc="upper left", bbox_to_anchor=(0.28, 1.02), labelspacing=0.3)


def from_above(run):
    """Asteroids and planets as seen from the ecliptic's north pole at the end."""
    from orbits import plotting

    figure = plotting.figure(11, 11.8)
    panel = figure.subplots()
    place = plotting.in_plane(run.system, run.q[-1].value - run["Sun"].q[-1].value)
    a, _, _ = mean_elements(run)
    columns = particles(run)
    for label, colour, chosen in zones(run, a):
        x = place[columns[chosen]]
        panel.plot(x[:, 0], x[:, 1], ".", ms=5, mew=0, color=colour, label=f"{label}, {chosen.sum()}")
    end = run[len(run) - 1]
    sun = plotting.in_plane(end, end.values.q[0])
    for i, name in enumerate(run.names):
        if not run.system.massive[i] or name in ("Saturn", "Uranus", "Neptune"):
            continue
        look = {"color": plotting.style.ORANGE if name == "Sun" else plotting.style.INK}
        ellipse = plotting.osculating_ellipse(end, name)
        if ellipse is not None:
            panel.plot(ellipse[:, 0] - sun[0], ellipse[:, 1] - sun[1], lw=1.0, alpha=0.8, **look)
        panel.plot(*place[i, :2], "o", ms=10 if name in ("Sun", "Jupiter") else 6, mec="white", mew=0.6, **look)
        if name in ("Sun", "Jupiter", "Mars"):
            panel.annotate(name, place[i, :2], xytext=(9, 7), textcoords="offset points", fontsize=14)
    panel.set(xlim=(-6.3, 6.3), ylim=(-6.3, 7.3))
    plotting.map_axes(panel, run.system, origin="from the Sun")
    panel.set_aspect("equal", adjustable="box")
    panel.set_title(f"The belt on {run.epochs[-1].isot[:10]}, seen from the north pole of the ecliptic", fontsize=18)
    panel.legend(loc="upper left", ncols=2, fontsize=14, markerscale=2.5, handletextpad=0.1)
    return figure


scenario = orbits.scenarios.Scenario(
    name="asteroid_belt",
    title="The asteroid belt, judged against REBOUND",
    system=system,
    integrators=METHODS,
    dt=DT,
    duration=100 * u.yr,
    samples=201,
    against=("whfast", "ias15"),
    tolerances={
        "gauss": {
            "energy": 1e-14,
            "angular_momentum": ROUND_OFF,
            "position_km": {"massive": 0.05, "particles": 0.05},
        },
        "stormer-verlet": {"angular_momentum": ROUND_OFF},
    },
    checks=checks,
    draw=draw,
)

if __name__ == "__main__":
    scenario.main()
