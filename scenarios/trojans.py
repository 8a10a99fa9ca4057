"""Jupiter's Trojans librate about L4 and L5: the 497 brightest real ones for twenty thousand years.

Sun and giants from DE440 and massless particles, by a Wisdom–Holman map. The mean longitude of a Trojan, counted from
Jupiter's, swings about +60° or -60° in 145 to 190 years, as in a pendulum with a soft spring: the wider, the longer,
and the farther from Jupiter on average. Curves are those of the circular restricted problem averaged over a revolution,

    phi'' = -dU/dphi,   U = 3 mu n^2 [1 / (2 sin(phi/2)) - cos(phi)],

in which small librations take P / sqrt(27 mu / 4) = 148 years and end at 23.9° from Jupiter, where horseshoes begin.
Inclined orbits librate more slowly. Two thirds as many bright Trojans trail Jupiter as lead it. None leaves within
twenty thousand years; those that come within three Hill radii of a planet in a longer run (--duration "1 Myr") are
retired.

Source: Murray & Dermott (1999), Solar System Dynamics, ch. 3; Érdi (1988), CeMDA 43, 303; Levison, Shoemaker &
Shoemaker (1997), Nature 385, 42.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from astropy import units as u

import orbits

EPOCH = "2022-08-09"
BODIES = ("Sun", "Jupiter", "Saturn", "Uranus", "Neptune")
COUNT = 497
FINE = 40.0
"""Years between samples up to which periods are measured; a libration takes 145 at least."""
LONG_ENOUGH = 1500.0
"""Years from which on librations are demanded to show: ten of them."""
SMALL, WIDE = 10.0, 20.0
"""Amplitudes [deg] of librations that are small, and of wide ones."""
FLAT = 8.0
"""Inclinations [deg] up to which the averaged planar problem is compared with."""
SHOWN = ("Hektor", "Achilles", "Odysseus", "Patroclus", "Mentor", "Paris")
SWINGS = (3.0, 12.0, 22.0, 40.0)
"""Amplitudes [deg] of the Trojans of either swarm whose paths are drawn: those nearest to each."""


def system():
    """Sun and giants with the Trojans of the bundled catalogue, the brightest first."""
    giants = orbits.System.solar_system(epoch=EPOCH, bodies=list(BODIES))
    return giants.add_particles(orbits.asteroids(COUNT, classes="trojan"))


class Librations(NamedTuple):
    """Of each Trojan: mean, least and largest |phi|, and amplitude [deg]; period [yr], NaN where samples are too
    sparse; eccentricity and inclination [deg], means; whether it leads Jupiter, and whether it has left.

    The amplitude is the root mean square of phi about its mean, times the root of 2: that of a sine.
    """

    names: tuple
    mean: np.ndarray
    least: np.ndarray
    largest: np.ndarray
    amplitude: np.ndarray
    period: np.ndarray
    e: np.ndarray
    inclination: np.ndarray
    leads: np.ndarray
    left: np.ndarray


@lru_cache(maxsize=1)
def librations(run):
    """Measure how the longitudes of the Trojans, counted from Jupiter's, swing."""
    elements, years = run.elements(primary="Sun"), run.t.to_value(u.yr)
    columns = np.flatnonzero(~run.system.massive) - 1  # the Sun, first, has no elements about itself
    longitude = elements.l.to_value(u.deg)
    phi = (longitude[:, columns] - elements["Jupiter"].l.to_value(u.deg)[:, None] + 180.0) % 360.0 - 180.0
    leads = phi[0] > 0.0
    side = np.abs(phi)
    with np.errstate(invalid="ignore"):
        left = ~np.isfinite(phi[-1]) | ((phi > 0.0) != leads).any(axis=0)
    fine = len(years) > 8 and abs(years[1] - years[0]) <= FINE
    period = np.full(len(columns), np.nan)
    for k in np.flatnonzero(~left) if fine else ():
        swing = orbits.diagnostics.frequency_analysis(
            years, side[:, k] - side[:, k].mean(), 1, band=(2 * np.pi / 400, 2 * np.pi / 80)
        )
        period[k] = 2 * np.pi / swing.frequency[0]
    stays = np.where(left, np.nan, 1.0)
    return Librations(
        names=tuple(run.names[k + 1] for k in columns),
        mean=stays * side.mean(axis=0),
        least=stays * side.min(axis=0),
        largest=stays * side.max(axis=0),
        amplitude=stays * np.sqrt(2.0) * side.std(axis=0),
        period=period,
        e=np.nanmean(elements.e.value[:, columns], axis=0),
        inclination=np.nanmean(elements.inc.to_value(u.deg)[:, columns], axis=0),
        leads=leads,
        left=left,
    )


def jupiters(run):
    """Return Jupiter's mean semi-major axis [au], its period [yr] and its part of the mass of both."""
    elements = run.elements(primary="Sun")["Jupiter"]
    gm = run.system.gm.value
    jupiter = gm[run.names.index("Jupiter")]
    return (
        float(elements.a.to_value(u.au).mean()),
        float(elements.P.to_value(u.yr).mean()),
        float(jupiter / (gm[0] + jupiter)),
    )


def potential(phi):
    """U / (3 mu n^2) of the averaged problem."""
    return 0.5 / np.sin(phi / 2.0) - np.cos(phi)


def slope(phi):
    """Its derivative."""
    return np.sin(phi) - 0.25 * np.cos(phi / 2.0) / np.sin(phi / 2.0) ** 2


def tadpole(least, mu):
    """Return (phi, rate) of half a libration that comes to `least` [rad] of Jupiter, and when, in Jupiter's years.

    The rate is phi' in units of Jupiter's mean motion.
    """
    far = np.linspace(np.pi / 3, np.pi, 20_001)
    most = np.interp(potential(least), potential(far), far)
    for _ in range(3):
        most -= (potential(most) - potential(least)) / slope(most)
    angle = (np.arange(4000) + 0.5) * np.pi / 4000  # phi = middle - half cos(angle): no singular ends
    phi = 0.5 * (most + least) - 0.5 * (most - least) * np.cos(angle)
    rate = np.sqrt(6.0 * mu * np.maximum(potential(least) - potential(phi), 1e-30))
    time = np.cumsum(0.5 * (most - least) * np.sin(angle) / rate) * np.pi / 4000
    return phi, rate, time / (2.0 * np.pi)


def theory(mu):
    """Return amplitude and mean [deg] and period, in Jupiter's years, of tadpoles from small ones to the widest."""
    rows = []
    for least in np.radians(np.linspace(59.5, 24.5, 36)):
        phi, _, time = tadpole(least, mu)
        weight = np.diff(time, prepend=0.0) / time[-1]
        mean = weight @ phi
        rows.append((np.degrees(np.sqrt(2.0 * (weight @ (phi - mean) ** 2))), np.degrees(mean), 2.0 * time[-1]))
    return np.array(rows).T


def checks(outcome):
    """Trojans stay about L4 and L5, with the centres and the periods of theory; the planets keep their momentum."""
    run = outcome.run
    drift = run.drift().angular_momentum.max_fraction
    yield orbits.scenarios.Check("the planets keep their angular momentum", drift < 1e-12, f"{drift:.1e}")
    if abs(run.t[-1].to_value(u.yr)) < LONG_ENOUGH:
        return
    seen, (_, year, mu) = librations(run), jupiters(run)
    stay = ~seen.left
    counts = [int(np.sum(stay & side)) for side in (seen.leads, ~seen.leads)]
    yield orbits.scenarios.Check(
        "the Trojans stay about L4 and L5",
        stay.mean() > 0.9 and min(counts) > 0,
        f"{counts[0]} about L4 and {counts[1]} about L5, {seen.left.sum()} gone",
    )
    if not stay.any():
        return
    yield orbits.scenarios.Check(
        "they swing as tadpoles do, not nearer to Jupiter than 23.9° nor beyond 180°",
        np.nanmin(seen.least) > 23.9 and np.nanmax(seen.largest) < 180.0,
        f"{np.nanmin(seen.least):.1f}° to {np.nanmax(seen.largest):.1f}°",
    )
    amplitude, mean, period = theory(mu)
    for name, sign, side in (("L4", 1, seen.leads), ("L5", -1, ~seen.leads)):
        chosen = stay & side & (seen.amplitude < SMALL)
        if not chosen.any():
            continue
        off = np.median(seen.mean[chosen] - np.interp(seen.amplitude[chosen], amplitude, mean))
        centre = np.median(seen.mean[chosen])
        yield orbits.scenarios.Check(
            f"small librations about {name} are centred where theory has them, at {60 * sign:+d}°",
            abs(off) < 1.0 and abs(centre - 60.0) < 2.0,
            f"{sign * centre:+.2f}°, {sign * (centre - off):+.2f}° in theory",
        )
    if not np.isfinite(seen.period[stay]).all():
        return
    flat = stay & (seen.inclination < FLAT)
    if not flat.any():
        return
    ratio = seen.period / (year * np.interp(seen.amplitude, amplitude, period))
    yield orbits.scenarios.Check(
        "the periods of those with small inclinations are those of theory",
        abs(np.median(ratio[flat]) - 1.0) < 0.02 and np.ptp(ratio[flat]) < 0.2,
        f"{np.median(ratio[flat]):.4f} of them, {ratio[flat].min():.3f} to {ratio[flat].max():.3f}",
    )
    groups = [seen.period[flat & which] for which in (seen.amplitude < SMALL, seen.amplitude > WIDE)]
    if not all(map(len, groups)):
        return
    groups = [np.median(group) for group in groups]
    yield orbits.scenarios.Check(
        "wide librations take longer than small ones",
        1.02 * groups[0] < groups[1] < 1.2 * groups[0],
        f"{groups[1]:.1f} and {groups[0]:.1f} yr; all {seen.period[stay].min():.0f} to {seen.period[stay].max():.0f}",
    )


def draw(outcome):
    """The swarms in the frame that rotates with Jupiter; tadpoles, periods and amplitudes."""
    from orbits import plotting

    run, style = outcome.run, plotting.style
    seen = librations(run)
    figure = plotting.figure(18, 12.5)
    panels = figure.subplot_mosaic(
        [["map", "tadpoles"], ["map", "periods"], ["map", "amplitudes"]], width_ratios=[1.5, 1.0]
    )
    swarms = [("L4", seen.leads, style.BLUE), ("L5", ~seen.leads, style.VERMILION)]
    rotating(panels["map"], run, swarms)
    tadpoles(panels["tadpoles"], run, seen, swarms)
    periods(panels["periods"], run, seen, swarms)
    panel, bins = panels["amplitudes"], np.arange(0.0, 42.0, 2.0)
    for name, side, colour in swarms:
        values = seen.amplitude[side & ~seen.left]
        panel.hist(values, bins=bins, histtype="step", lw=2.4, color=colour,
                   label=f"{name}, {len(values)}, median {np.median(values):.1f}°")  # fmt: skip
    panel.set(xlabel="amplitude of libration [°]", ylabel="Trojans", xlim=(0, 40))
    panel.legend(fontsize=14, loc="upper right")
    told = (
        "Left: every Trojan at forty times of the run, Jupiter held to the right; names where they are at the start. "
        "Grey and black curves: the circular restricted problem averaged over a revolution, in the plane, with its "
        "tadpoles (dashed: the widest) and its periods"
    )
    plotting.below(figure, [], [], told)
    years = abs(run.t[-1].to_value(u.yr))
    figure.suptitle(
        f"{len(seen.left)} Trojans of Jupiter for {years:,.0f} years: {(seen.leads & ~seen.left).sum()} about L4, "
        f"{(~seen.leads & ~seen.left).sum()} about L5, {seen.left.sum() or 'none'} gone",
        fontsize=21, fontweight="bold",
    )  # fmt: skip
    return figure


def rotating(panel, run, swarms):
    """Draw all Trojans as seen from the north, in the frame in which Jupiter stays on the right."""
    from orbits import plotting

    style, count = plotting.style, len(run)
    rows = np.unique(np.linspace(0, count - 1, 41).astype(int))
    place = plotting.in_plane(run.system, run.q.value[rows] - run["Sun"].q.value[rows][:, None])[..., :2]
    jupiter = run.names.index("Jupiter")
    angle = np.arctan2(place[:, jupiter, 1], place[:, jupiter, 0])
    turned = (place[..., 0] + 1j * place[..., 1]) * np.exp(-1j * angle)[:, None]
    particles = np.flatnonzero(~run.system.massive)
    radius = float(np.abs(turned[:, jupiter]).mean())
    ring = radius * np.exp(1j * np.linspace(0, 2 * np.pi, 361))
    panel.plot(ring.real, ring.imag, color=style.GREY, lw=1.0, ls=(0, (5, 3)), zorder=0)
    for name, side, colour in swarms:
        dots = turned[:, particles[side]].ravel()
        panel.plot(dots.real, dots.imag, ".", ms=2.2, mew=0, alpha=0.45, color=colour, rasterized=True)
        sign = 1 if name == "L4" else -1
        spot = radius * np.exp(1j * sign * np.pi / 3)
        panel.plot([0, spot.real], [0, spot.imag], color=style.GREY, lw=0.9)
        panel.plot(spot.real, spot.imag, "+", ms=17, mew=2.2, color=style.INK)
        words = {"L4": "L4, leading:\nthe Greek camp", "L5": "L5, trailing:\nthe Trojan camp"}[name]
        panel.text(0.1 * radius, sign * 1.27 * radius, words, ha="left", va="center", fontsize=16, color=colour)
    for name in (name for name in SHOWN if name in run.names):
        spot = turned[0, run.names.index(name)]
        panel.plot(spot.real, spot.imag, "o", ms=5, mfc="white", mec=style.INK, mew=1.3)
        text = panel.annotate(name, (spot.real, spot.imag), xytext=(7, 5), textcoords="offset points", fontsize=13)
        plotting.halo(text)
    path = turned[:, jupiter]
    panel.plot(path.real, path.imag, "o", ms=9, mew=0, alpha=0.25, color="#A0522D")
    panel.plot(radius, 0.0, "o", ms=15, color="#A0522D")
    panel.annotate("Jupiter", (radius, 0.0), xytext=(-8, 15), textcoords="offset points", fontsize=15, ha="right")
    panel.plot(0.0, 0.0, "o", ms=17, color=style.ORANGE)
    panel.annotate("Sun", (0.0, 0.0), xytext=(-14, 0), textcoords="offset points", fontsize=15, ha="right", va="center")
    limit = 1.42 * radius
    panel.set(xlim=(-0.75 * limit, 0.95 * limit), ylim=(-limit, limit), xlabel="au", ylabel="au")
    panel.set_aspect("equal", adjustable="box")


def tadpoles(panel, run, seen, swarms):
    """Draw the guiding centres of some Trojans for a libration and more: longitude from Jupiter and a."""
    from orbits import plotting

    style = plotting.style
    axis, year, mu = jupiters(run)
    span = min(220.0, abs(run.t[-1].to_value(u.yr)) - year)
    times = np.sign(run.t[-1].value) * np.linspace(0.0, span + year, 471) * u.yr
    elements = run.at(times).elements(primary="Sun")
    width = max(1, round(year / abs(times[1] - times[0]).to_value(u.yr)))
    smooth = np.ones(width) / width  # over a revolution
    jupiter = elements["Jupiter"]
    for _, side, colour in swarms:
        distance = np.abs(seen.amplitude[:, None] - SWINGS)
        distance[~side | seen.left] = np.inf
        for k in set(np.argmin(distance, axis=0)) if np.isfinite(distance).any() else ():
            orbit = elements[seen.names[k]]
            phi = np.degrees((orbit.l - jupiter.l).to_value(u.rad) % (2 * np.pi))
            phi = phi if seen.leads[k] else phi - 360.0
            apart = (orbit.a - jupiter.a).to_value(u.au)
            panel.plot(*(np.convolve(each, smooth, mode="valid") for each in (phi, apart)), lw=1.9, color=colour)
    for sign in (1, -1):
        for least, line in ((np.radians(23.92), (0, (5, 3))), (np.radians(45.0), "-"), (np.radians(53.0), "-")):
            phi, rate, _ = tadpole(least, mu)
            x, y = sign * np.degrees(phi), 2 / 3 * rate * axis
            for half in (1, -1):
                panel.plot(x, half * y, color=style.GREY, lw=1.0, ls=line, zorder=0)
    panel.axvline(0.0, color="#A0522D", lw=1.2)
    panel.text(0.0, 1.02, "Jupiter", transform=panel.get_xaxis_transform(), ha="center", fontsize=14)
    panel.set(xlim=(-180, 180), ylim=(-0.32, 0.32), xticks=range(-180, 181, 60), ylabel="a, from Jupiter's [au]",
              xlabel="longitude from Jupiter [°], means over a revolution")  # fmt: skip


def periods(panel, run, seen, swarms):
    """Draw the periods against amplitudes, with the curve of the averaged problem."""
    from orbits import plotting

    style = plotting.style
    _, year, mu = jupiters(run)
    amplitude, _, period = theory(mu)
    flat = seen.inclination < FLAT
    for _, side, colour in swarms:
        panel.plot(seen.amplitude[side & flat], seen.period[side & flat], "o", ms=4.5, mew=0, color=colour)
        hollow = {"ms": 4.0, "mfc": "none", "mec": colour, "mew": 0.8}
        panel.plot(seen.amplitude[side & ~flat], seen.period[side & ~flat], "o", **hollow)
    panel.plot(amplitude, year * period, color=style.INK, lw=1.6)
    panel.plot([], [], "o", ms=5, mew=0, color=style.GREY, label=f"inclination below {FLAT:g}°")
    panel.plot([], [], "o", ms=5, mfc="none", mec=style.GREY, label="above")
    panel.legend(fontsize=13, loc="upper right")
    panel.set(xlabel="amplitude of libration [°]", ylabel="period [yr]", xlim=(0, 40), ylim=(140, 195))


scenario = orbits.scenarios.Scenario(
    name="trojans",
    title="Jupiter's Trojans librate about L4 and L5",
    system=system,
    integrators=[orbits.WisdomHolman(encounters="retire")],
    dt=50 * u.day,
    duration=20_000 * u.yr,
    samples=2001,
    against=(),
    checks=checks,
    draw=draw,
)

if __name__ == "__main__":
    scenario.main()
