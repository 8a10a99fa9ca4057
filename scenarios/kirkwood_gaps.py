"""How resonances with Jupiter open gaps in the asteroid belt: 2,000 massless particles for a hundred thousand years.

Sun and giants from DE440, and particles spread evenly from 2.0 to 3.5 au with eccentricities and inclinations drawn
from the real belt, by a Wisdom–Holman map. Eccentricities grow at the 3:1 and 5:2 resonances, where the belt has its
gaps; particles that come within three Hill radii of a planet, or on orbits so eccentric that the step no longer
resolves their pericentres, are retired. The gaps at 7:3 and 2:1 take longer to open: a million years, with YEARS = 1e6.

Source: Wisdom (1982), AJ 87, 577; Kirkwood (1867), Meteoric Astronomy.
"""

import warnings
from collections import Counter

import numpy as np
from astropy import units as u

import orbits
from orbits.scenario import Check, Study, StudyResult, Table

EPOCH = "2022-08-09"
BODIES = ("Sun", "Jupiter", "Saturn", "Uranus", "Neptune")
COUNT, INNER, OUTER, SEED = 2000, 2.0, 3.5, 1867
RESONANCES = ((4, 1), (3, 1), (5, 2), (7, 3), (2, 1))
WIDTH = 0.03
"""Half the width of the strip about a resonance [au] in which eccentricities are compared with those elsewhere."""
CALM, EXCITED = 0.25, 0.4
"""Eccentricities at the start below which particles are compared, and which those at resonances reach."""
YEARS, DT, SAMPLES = 1e5, 20 * u.day, 201
LONG_ENOUGH = 5e4
"""Years from which on the resonances are demanded to show."""


def system():
    """Sun and giants with particles whose eccentricities and inclinations are those of real asteroids."""
    giants = orbits.System.solar_system(epoch=EPOCH, bodies=list(BODIES))
    real = orbits.asteroids(1100, classes="belt")
    rng = np.random.default_rng(SEED)
    drawn = rng.integers(len(real.names), size=COUNT)
    angles = {name: rng.uniform(0.0, 360.0, COUNT) * u.deg for name in ("Omega", "omega", "M")}
    a = np.linspace(INNER, OUTER, COUNT) * u.au
    names = [f"p{k}" for k in range(COUNT)]
    return giants.add(names, primary="Sun", frame="ecliptic", a=a, e=real.e[drawn], inc=real.inc[drawn], **angles)


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
    """Return the fraction of particles on calm orbits that reach e = 0.4 or are retired: at 3:1, at 5:2, and between
    them, where all is quiet.
    """
    a, start, e, gone = fates(run)
    a, wild = a[start < CALM], (gone | (e > EXCITED))[start < CALM]
    places = [resonance(run, 3, 1), resonance(run, 5, 2)]
    at = [float(wild[np.abs(a - place) < WIDTH].mean()) for place in places]
    quiet = (a > places[0] + 2 * WIDTH) & (a < places[1] - 2 * WIDTH)
    return *at, float(wild[quiet].mean())


def experiment(say):
    """March the particles, and compare the resonances with what is between them."""
    start, method = system(), orbits.WisdomHolman(encounters="retire")
    say(f"{COUNT:,} particles, {YEARS:,.0f} years in steps of {DT:g}")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", orbits.RetiredWarning)
        run = orbits.propagate(start, method, dt=DT, duration=YEARS * u.yr, samples=SAMPLES, check_step=False)
    a, _, e, gone = fates(run)
    reasons = Counter(one.reason for one in run.retired)
    rows = [["still there", int((~gone).sum())], *([reason, count] for reason, count in reasons.most_common())]
    return StudyResult(
        tables=[Table(f"Particles after {YEARS:,.0f} years", ["fate", "particles"], rows)],
        checks=list(judged(run)),
        figures={"kirkwood_gaps": lambda: draw(run)},
        record={"a": a.tolist(), "largest_e": e.tolist(), "retired": gone.tolist()},
    )


def judged(run):
    """Yield what the run has to show: the resonances excite eccentricities, and nothing between them does."""
    drift = run.drift().angular_momentum.max_fraction
    yield Check("the planets keep their angular momentum", drift < 1e-12, f"{drift:.1e}")
    if YEARS < LONG_ENOUGH:
        return
    inner, outer, between = excited(run)
    for name, share in (("3:1", inner), ("5:2", outer)):
        yield Check(
            f"many of the particles at {name} reach e = {EXCITED} or leave, and few elsewhere",
            share > 0.1 and share > 5 * between,
            f"{100 * share:.0f} %, and {100 * between:.1f} % between 3:1 and 5:2",
        )


def draw(run):
    """Eccentricities against a, survivors, and the real belt."""
    from orbits import plotting

    a, _, e, gone = fates(run)
    real = orbits.asteroids(1100, classes="belt").a
    figure = plotting.figure(14, 12)
    panels = figure.subplots(3, 1, sharex=True, height_ratios=[1.6, 1, 1])
    blue, red, grey = plotting.style.BLUE, plotting.style.VERMILION, plotting.style.GREY
    panels[0].plot(a[~gone], e[~gone], ".", ms=5, mew=0, color=blue, label=f"still there, {(~gone).sum():,}")
    panels[0].plot(a[gone], e[gone], ".", ms=7, mew=0, color=red, label=f"retired, {gone.sum():,}")
    bins = np.arange(INNER, OUTER + 1e-9, 0.025)
    panels[1].hist(a[~gone & (e < EXCITED)], bins=bins, color=blue)
    panels[2].hist(real, bins=bins, color=plotting.style.GREEN)
    panels[0].set(ylabel="largest eccentricity", ylim=(0, 1))
    panels[0].legend(loc="upper left", fontsize=14, markerscale=2)
    panels[1].set(ylabel=f"still there, e < {EXCITED}")
    panels[2].set(ylabel="real asteroids", xlabel="semi-major axis at the start [au]", xlim=(INNER, OUTER))
    for p, q in RESONANCES:
        place = resonance(run, p, q)
        for panel in panels:
            panel.axvline(place, color=grey, lw=1.0, ls=(0, (5, 3)), zorder=0)
        panels[0].text(place, 1.01, f"{p}:{q}", transform=panels[0].get_xaxis_transform(), ha="center", fontsize=14)
    years = abs(run.t[-1].to_value(u.yr))
    figure.suptitle(
        f"{len(a):,} particles among Sun and giants for {years:,.0f} years, and the brightest real asteroids",
        fontsize=20, fontweight="bold",
    )  # fmt: skip
    return figure


scenario = Study(
    name="kirkwood_gaps",
    title="Kirkwood's gaps: resonances with Jupiter empty the belt",
    experiment=experiment,
)

if __name__ == "__main__":
    scenario.main()
