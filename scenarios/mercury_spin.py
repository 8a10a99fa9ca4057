"""Mercury turns three times in two revolutions: its forced libration, its free one, and how tides lead to 3:2.

In the resonance the torque of the Sun on Mercury's figure makes the angle of the long axis swing about 3/2 M, by 38.44
arcseconds in the sin M term and -4.05 in sin 2M. If it is displaced, it also swings freely, in 11.64 years. Only the
mantle does, for the core is liquid: C is that of the mantle. Two formulas stand beside it: 3/2 (B - A)/C (1 - 11 e^2 +
959/48 e^4), and the mean motion times [3 (B - A)/C (7/2 e - 123/16 e^3)]^(1/2).

Then 2,048 spins that tides slow down pass 3:2, at as many angles. The torque with a constant time lag is proportional
to the rate: about a tenth of them are captured, 2 / (1 + pi V / (2 w)) with w the rate of the free libration and V the
distance from the rate at which tides would leave a spin without a figure, in units of n. The tides are far stronger
than Mercury's; the part does not depend on that while they are weak. How Mercury did get there is another question: its
eccentricity was not always what it is (Correia & Laskar 2004, Nature 429, 848).

Sources: Margot et al. (2012), JGR 117, E00L09: (38.5 ± 1.6) arcseconds and (B - A)/C = 2.18e-4; Stark et al. (2015),
Celest. Mech. Dyn. Astron. 123, 263: the period of the orbit; Goldreich & Peale (1966), AJ 71, 425: the chance of
capture; Margot et al. (2007), Science 316, 710: the formula of the libration.
"""

import numpy as np

import orbits
from orbits.scenario import Check, Study, StudyResult, Table
from orbits.spin_orbit import PlanarSpins

E, ASPHERICITY = 0.20563, 2.18e-4
PERIOD = 87.96934962
"""Of the orbit, days."""

OBSERVED = 38.5, 1.6
ARCSEC = np.pi / 180 / 3600
YEAR = 365.25 / PERIOD
"""In revolutions."""

TIDES, SLOW = 4e-6, 0.075
SPINS, EVERY, MEAN = 2048, 10, 30
FIRST = 1.531, 1.532


def measured(spins, locked, degrees, years):
    """Time in revolutions, and the libration theta - 3/2 M of a displaced spin at 16 places of each [arcseconds]."""
    path = spins.march(locked.theta + np.radians(degrees), locked.rate, round(years * YEAR), samples=16)
    return path.revolutions, (path.theta[0] - 1.5 * path.mean_anomaly) / ARCSEC


def free_period(spins, locked):
    """The period of a spin that is displaced by 0.01°, from its angles at 8,192 pericentres, in revolutions."""
    angles = spins.section(locked.theta + np.radians(0.01), locked.rate, 8192).folded[0]
    terms = orbits.diagnostics.frequency_analysis(np.arange(8193.0), angles.astype(complex), 2)
    return float(2 * np.pi / np.abs(terms.frequency[0]))


def passing():
    """Spins slowed down through 3:2 by tides, whether each was captured, and what part should be."""
    spins = PlanarSpins(eccentricity=E, asphericity=ASPHERICITY, tides=TIDES, steps=12)
    smooth = PlanarSpins(eccentricity=E, asphericity=0.0, tides=TIDES, steps=12).section(0.0, 1.5, 100).rate[0]
    revolutions = round(100 * SLOW / (smooth[0] - smooth[-1]) / EVERY) * EVERY
    section = spins.section(
        np.linspace(0, np.pi, SPINS, endpoint=False), np.linspace(*FIRST, SPINS), revolutions, every=EVERY
    )
    captured = np.abs(section.rate[:, -20:].mean(axis=1) - 1.5) < 0.015
    away = 1.5 - spins.equilibrium_rate
    return section, captured, 2 / (1 + 0.5 * np.pi * away * spins.libration(3 / 2).period)


def experiment(say):
    """The locked spin and its librations; then capture."""
    spins = PlanarSpins(eccentricity=E, asphericity=ASPHERICITY)
    locked = spins.libration(3 / 2)
    say("a spin displaced by 0.01°, for 8,192 revolutions")
    found = free_period(spins, locked)
    say(f"{SPINS:,} spins, slowed down by tides")
    section, captured, chance = passing()
    part, spread = float(captured.mean()), float(np.sqrt(chance * (1 - chance) / SPINS))
    terms = {k: locked.sine(k) / ARCSEC for k in (1, 2, 3, 4)}
    series = 1.5 * ASPHERICITY * (1 - 11 * E**2 + 959 / 48 * E**4) / ARCSEC
    pendulum = 1 / np.sqrt(3 * ASPHERICITY * (3.5 * E - 123 / 16 * E**3))
    years = found / YEAR
    rows = [[f"forced, sin {k if k > 1 else ''}M".replace("  ", " "), f'{value:.3f}"'] for k, value in terms.items()]
    rows += [
        ["forced, sin M, by the formula", f'{series:.2f}"'],
        ["forced, seen by radar", f'{OBSERVED[0]} ± {OBSERVED[1]}"'],
        ["free, from the map's derivatives", f"{locked.period / YEAR:.4f} yr"],
        ["free, from a run of 1,973 years", f"{years:.4f} yr"],
        ["free, by the formula", f"{pendulum / YEAR:.2f} yr"],
        ["rate that tides alone lead to", f"{spins.equilibrium_rate:.4f} n"],
        [f"captured, of {SPINS:,}", f"{part:.1%}"],
        ["captured, by the formula", f"{chance:.1%} ± {spread:.1%}"],
    ]
    checks = [
        Check('the forced libration is 38.44" in sin M', abs(terms[1] - 38.44) < 0.01, f'{terms[1]:.3f}"'),
        Check('and -4.05" in sin 2M', abs(terms[2] + 4.05) < 0.01, f'{terms[2]:.3f}"'),
        Check("the formula agrees to a fifth of a percent", abs(series / terms[1] - 1) < 0.002, f'{series:.3f}"'),
        Check("radar has seen as much", abs(terms[1] - OBSERVED[0]) < OBSERVED[1], f"{OBSERVED[0]} ± {OBSERVED[1]}"),
        Check("the free libration takes 11.64 years", abs(years - 11.64) < 0.01, f"{years:.4f}"),
        Check("as the derivatives of the map say", abs(found / locked.period - 1) < 1e-6,
              f"{found / locked.period - 1:.1e}"),
        Check("as many spins are captured as theory says", abs(part - chance) < 3 * spread,
              f"{part:.3f}, {chance:.3f}"),
    ]  # fmt: skip
    return StudyResult(
        tables=[Table("Mercury in 3:2", ["what", "value"], rows)],
        checks=checks,
        figures={"mercury_spin": lambda: draw(spins, locked, section, captured, chance)},
        record={"sines": terms, "free period [yr]": years, "captured": part, "chance": chance},
    )


def draw(spins, locked, section, captured, chance):
    """The forced libration of a revolution, the free one beside it, and spins on their way through the resonance, whose
    border is dashed.
    """
    from orbits import plotting

    style = plotting.style
    figure = plotting.figure(17, 10)
    panels = figure.subplot_mosaic([["forced", "capture"], ["free", "phases"]], width_ratios=[1, 1.15])
    axis = panels["forced"]
    M, angle = locked.path.mean_anomaly[:-1], locked.angle / ARCSEC
    days = M / (2 * np.pi) * PERIOD
    for k, colour in ((1, style.SKY), (2, style.ORANGE)):
        wave = locked.sine(k) / ARCSEC
        label = f'{wave:.2f}" sin {"" if k == 1 else "2"}M'.replace("-", "−")
        axis.plot(days, wave * np.sin(k * M), color=colour, lw=2, ls=(0, (4, 2)), label=label)
    axis.plot(days, angle, color=style.INK, lw=2.6, label="θ − 3/2 M")
    axis.set(xlim=(0, PERIOD), xlabel="days from the perihelion", ylabel="arcseconds", ylim=(-45, 45))
    axis.set_title("forced: in each revolution of 88 days")
    axis.legend(loc="upper right", fontsize=14)
    axis.grid(axis="y", color=style.FAINT, lw=0.6)
    axis = panels["free"]
    revolutions, both = measured(spins, locked, 150 * ARCSEC * 180 / np.pi, 36)
    axis.plot(revolutions / YEAR, both, color=style.BLUE, lw=1.1)
    axis.set(xlim=(0, 36), xlabel="years", ylabel="θ − 3/2 M [arcseconds]", ylim=(-230, 230))
    axis.set_title(f'both, if displaced by 150": {locked.period / YEAR:.2f} years')
    axis.grid(axis="y", color=style.FAINT, lw=0.6)
    axis = panels["capture"]
    kilo = section.revolutions / 1000
    window = np.ones(MEAN) / MEAN
    some = np.concatenate([np.flatnonzero(~captured)[:: SPINS // 36], np.flatnonzero(captured)[::48]])
    for k in some:
        axis.plot(
            kilo[MEAN - 1 :], np.convolve(section.rate[k], window, "valid"), lw=1.2, alpha=0.8,
            color=style.VERMILION if captured[k] else style.BLUE, zorder=3 if captured[k] else 2,
        )  # fmt: skip
    axis.set(xlim=(0, kilo[-1]), ylim=(1.455, 1.535), ylabel="θ′/n, mean of 300 revolutions")
    axis.set(xlabel="thousand revolutions of the orbit")
    axis.set_title(f"slowed down by tides: {captured.mean():.1%} captured, by theory {chance:.1%}")
    axis.text(kilo[-1], 1.502, "captured in 3:2 ", color=style.VERMILION, fontsize=15, ha="right", va="bottom")
    axis.text(kilo[-1], 1.479, "passed ", color=style.BLUE, fontsize=15, ha="right", va="bottom")
    axis = panels["phases"]
    for k, colour in ((some[len(some) // 3], style.BLUE), (np.flatnonzero(captured)[0], style.VERMILION)):
        axis.plot(np.degrees(section.folded[k]), section.rate[k], ".", ms=4, mew=0, color=colour)
    angle = np.linspace(-np.pi / 2, np.pi / 2, 200)
    for sign in (-1, 1):
        border = locked.rate + sign * np.cos(angle) / locked.period
        axis.plot(np.degrees(angle), border, color=style.INK, lw=1.2, ls=(0, (4, 3)))
    axis.set(xlim=(-90, 90), xticks=range(-90, 91, 30), ylim=(1.455, 1.535), ylabel="θ′/n at the perihelion")
    axis.set(xlabel="angle of the long axis at the perihelion, θ [°]")
    axis.set_title("one that is captured, one that passes")
    figure.suptitle("Mercury: three turns in two revolutions", fontsize=21, fontweight="bold")
    return figure


scenario = Study(
    name="mercury_spin",
    title="Mercury's spin in 3:2: forced and free librations, and capture by tides",
    experiment=experiment,
    certifies=[(orbits.lagrangians.spin_orbit.with_parameters(alpha=(3 * ASPHERICITY) ** 0.5), orbits.Gauss(), 0.1)],
)

if __name__ == "__main__":
    scenario.main()
