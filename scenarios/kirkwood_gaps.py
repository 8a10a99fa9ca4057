"""How resonances with Jupiter open gaps in the asteroid belt: 10,000 massless particles for a hundred thousand years.

Sun and giants from DE440, and particles spread evenly from 2.0 to 3.5 au with eccentricities and inclinations drawn
from the real belt, by a Wisdom–Holman map. Eccentricities grow at the 3:1 and 5:2 resonances, where the belt has its
gaps; particles that come within three Hill radii of a planet, or on orbits so eccentric that the step no longer
resolves their pericentres, are retired.

A hundred thousand years show the beginning. In a million, `--duration "1e6 yr"`, 3:1 and 5:2 lose most of what is at
their centres, and 7:3 and 2:1 begin; ten million, `--duration "1e7 yr"`, make the gaps of these as well. Particles are
lost by close encounters with Mars and the Earth too: `--set planets=all` has all planets, takes steps of 3 days, and
twenty times as long. `--set count=500` is for a quick look: of the resonances something is demanded only where 40 calm
particles start at each, which takes some 2,100.

Source: Wisdom (1982), AJ 87, 577; Kirkwood (1867), Meteoric Astronomy.
"""

from collections import Counter

import numpy as np
from astropy import units as u

import orbits
from orbits.scenarios import Check, Option

EPOCH = "2022-08-09"
GIANTS = ("Sun", "Jupiter", "Saturn", "Uranus", "Neptune")
TERRESTRIAL = ("Mercury", "Venus", "Earth-Moon barycenter", "Mars")
INNER, OUTER, SEED = 2.0, 3.5, 1867
RESONANCES = ((4, 1), (3, 1), (5, 2), (7, 3), (2, 1))
WIDTH = 0.015
"""Half the width of the strip about a resonance [au] in which eccentricities are compared with those elsewhere."""
CALM, EXCITED = 0.25, 0.4
"""Eccentricities at the start below which particles are compared, and which those at resonances reach."""
LONG_ENOUGH = 5e4
"""Years from which on the resonances are demanded to show."""
ENOUGH = 40
"""Particles at each resonance below which nothing is demanded of it; there are so many of 2,500 in all."""
BIN = 0.02

OPTIONS = (
    Option("planets", "giants", choices=("giants", "all"), help="the giants alone, or all in shorter steps"),
    Option("count", 10_000, least=1, most=1_000_000, help="number of massless particles"),
)


def system(options):
    """Sun and planets with particles whose eccentricities and inclinations are those of real asteroids."""
    count = options["count"]
    bodies = [GIANTS[0], *TERRESTRIAL, *GIANTS[1:]] if options["planets"] == "all" else list(GIANTS)
    planets = orbits.System.solar_system(epoch=EPOCH, bodies=bodies)
    real = orbits.asteroids(classes="belt")
    rng = np.random.default_rng(SEED)
    drawn = rng.integers(len(real.names), size=count)
    angles = {name: rng.uniform(0.0, 360.0, count) * u.deg for name in ("Omega", "omega", "M")}
    a = np.linspace(INNER, OUTER, count) * u.au
    names = [f"p{k}" for k in range(count)]
    return planets.add(names, primary="Sun", frame="ecliptic", a=a, e=real.e[drawn], inc=real.inc[drawn], **angles)


def dt(options):
    """Steps that resolve the innermost planet."""
    return 3 * u.day if options["planets"] == "all" else 20 * u.day


def fates(run):
    """Return a [au] and e at the start, the largest e of all samples, and which particles were retired."""
    elements = run.elements(primary="Sun")
    columns = np.flatnonzero(~run.system.massive) - 1  # the Sun, first, has no elements about itself
    a, e = elements.a.to_value(u.au)[:, columns], elements.e.value[:, columns]
    return a[0], e[0], np.nanmax(e, axis=0), ~np.isfinite(a[-1])


def resonance(run, p, q):
    """Return the semi-major axis [au] at which an asteroid goes round p times while Jupiter does q times."""
    jupiter = run.elements(primary="Sun")["Jupiter"].a.to_value(u.au).mean()
    return jupiter * (q / p) ** (2 / 3)


def excited(run):
    """Return of each particle on a calm orbit whether it reaches e = 0.4 or is retired: of those at 3:1, of those at
    5:2, and of those between them, where all is quiet.
    """
    a, start, e, gone = fates(run)
    a, wild = a[start < CALM], (gone | (e > EXCITED))[start < CALM]
    places = [resonance(run, 3, 1), resonance(run, 5, 2)]
    quiet = (a > places[0] + 0.06) & (a < places[1] - 0.06)
    return [wild[strip] for strip in (*(np.abs(a - place) < WIDTH for place in places), quiet)]


def checks(outcome):
    """The resonances excite eccentricities, and nothing between them does; the planets are not disturbed."""
    run = outcome.run
    drift = run.drift().angular_momentum.max_fraction
    yield Check("the planets keep their angular momentum", drift < 1e-12, f"{drift:.1e}")
    reasons = Counter(one.reason for one in run.retired)
    fate = "; ".join(f"{count:,}: {reason}" for reason, count in reasons.most_common()) or "all are still there"
    yield Check("each particle is there at the end, or retired with a reason", _accounted(run), fate)
    if abs(run.t[-1].to_value(u.yr)) < LONG_ENOUGH:
        return
    strips = excited(run)
    if min(map(len, strips)) < ENOUGH:
        return
    inner, outer, between = (float(strip.mean()) for strip in strips)
    for name, share in (("3:1", inner), ("5:2", outer)):
        yield Check(
            f"many of the particles at {name} reach e = {EXCITED} or leave, and few elsewhere",
            share > 0.1 and share > 5 * between,
            f"{100 * share:.0f} %, and {100 * between:.1f} % between 3:1 and 5:2",
        )


def _accounted(run):
    there = int((~fates(run)[3]).sum())
    return there + len(run.retired) == int((~run.system.massive).sum())


def draw(outcome):
    """Eccentricities against a, how many are excited or lost, and the real belt."""
    from orbits import plotting

    run = outcome.run
    a, start, e, gone = fates(run)
    real = orbits.asteroids(classes="belt").a
    figure = plotting.figure(15, 13)
    panels = figure.subplots(3, 1, sharex=True, height_ratios=[1.7, 1, 1])
    blue, red, green = plotting.style.BLUE, plotting.style.VERMILION, plotting.style.GREEN
    size = {"ms": 2.5 if len(a) > 3000 else 5, "mew": 0}
    panels[0].plot(a[~gone], e[~gone], ".", color=blue, label=f"still there: {(~gone).sum():,}", **size)
    panels[0].plot(a[gone], e[gone], ".", color=red, label=f"retired: {gone.sum():,}", **size)
    bins = np.arange(INNER, OUTER + 1e-9, BIN)
    calm = start < CALM
    whole, _ = np.histogram(a[calm], bins)
    wild, _ = np.histogram(a[calm & (gone | (e > EXCITED))], bins)
    panels[1].stairs(100 * wild / np.maximum(whole, 1), bins, fill=True, color=red)
    panels[2].hist(real, bins=bins, color=green)
    panels[0].set(ylabel="largest eccentricity", ylim=(0, 1))
    panels[0].legend(loc="upper right", fontsize=14, markerscale=5)
    panels[1].set(ylabel=f"reach e = {EXCITED}\nor leave [%]", ylim=(0, None))
    panels[2].set(ylabel=f"real asteroids\n({len(real):,})", xlabel="semi-major axis at the start [au]")
    panels[2].set_xlim(INNER, OUTER)
    for p, q in RESONANCES:
        place = resonance(run, p, q)
        for panel in panels:
            panel.axvline(place, color=plotting.style.GREY, lw=1.0, ls=(0, (5, 3)), zorder=0)
        panels[0].text(place, 1.01, f"{p}:{q}", transform=panels[0].get_xaxis_transform(), ha="center", fontsize=14)
    years, planets = abs(run.t[-1].to_value(u.yr)), "planets" if outcome.options["planets"] == "all" else "giants"
    figure.suptitle(
        f"{len(a):,} particles among Sun and {planets} for {years:,.0f} years, and the real belt",
        fontsize=20, fontweight="bold",
    )  # fmt: skip
    return figure


scenario = orbits.scenarios.Scenario(
    name="kirkwood_gaps",
    title="Kirkwood's gaps: resonances with Jupiter empty the belt",
    system=system,
    integrators=[orbits.WisdomHolman(encounters="retire")],
    options=OPTIONS,
    dt=dt,
    duration=1e5 * u.yr,
    samples=101,
    against=[],
    checks=checks,
    draw=draw,
)

if __name__ == "__main__":
    scenario.main()
