"""The planets of TRAPPIST-1, weighed by 447 times of transits, which come minutes early or late.

Times of 2015 to 2019 are fitted, from the star alone: circular orbits with the periods of the transits, equal masses.
What the planets do to each other shifts transits by minutes to an hour, and gives mass ratios to one to five per cent.
They are those of the paper within two of their sigmas, though that has a likelihood with longer tails than the least
squares here. Transits of a run of the fitted system, sought as events, are those that were fitted.

Source: Agol et al. (2021), PSJ 2, 1, with the maximum of the likelihood in its repository.
"""

import numpy as np
from astropy import units as u
from astropy.time import Time

import orbits
from orbits.resources import data_path
from orbits.scenario import Check, Study, StudyResult, Table

EPOCH = Time(2457257.93115525, format="jd", scale="tdb")
STAR = {"mass": 0.0898 * u.M_sun, "radius": 0.1192 * u.R_sun}
RADII = [1.116, 1.097, 0.788, 0.920, 1.045, 1.129, 0.755] * u.R_earth
RATIOS = [4.598791e-5, 4.405882e-5, 1.305146e-5, 2.355104e-5, 3.492531e-5, 4.417498e-5, 1.093105e-5]
"""Published ratios of the masses to that of the star."""
CHI2 = 669.93
"""Chi-squared of the published model, the mean of its posterior at each transit."""


def experiment(say):
    """Fit the planets; run the fitted system, and compare its transits with the computed ones."""
    times = orbits.TransitTimes.read(data_path("trappist1_transits.csv"), zero=2450000)
    star = orbits.System.from_elements({"star": STAR}, epoch=EPOCH)
    say(f"fit of {len(times)} transits, from circular orbits about the star")
    fit = orbits.fit(times, star)
    say("a run of the fitted system, with its transits")
    system = fit.system.replaced(radii=[STAR["radius"], *RADII])
    sought = [orbits.events.Transit(name, "star", observer=orbits.along()) for name in times.planets]
    run = orbits.propagate(system, until=times.time.max() + 1 * u.day, events=sought)

    ratios, sigma = (x.reshape(7, 5)[:, 0] for x in (fit.parameters.values, fit.parameters.sigma))
    off = (np.array(RATIOS) - ratios) / sigma
    elements = fit.system.elements("jacobi", frame="sky")
    rows = [
        [name, f"{P:.4f}", f"{e:.4f}", f"{1e5 * m:.3f}", f"{1e5 * s:.3f}", f"{1e5 * published:.3f}", f"{d:+.2f}"]
        for name, P, e, m, s, published, d in zip(
            times.planets, elements.P.to_value(u.day), elements.e.value, ratios, sigma, RATIOS, off, strict=True
        )
    ]
    columns = ["planet", "P [d]", "e", "mass ratio [1e-5]", "sigma", "published", "apart [sigma]"]
    apart = max(_apart(run, fit, name) for name in times.planets)
    checks = [
        Check("chi-squared is at most that of the published model, and within 5 %", 0.95 * CHI2 < fit.chi2 < CHI2,
              f"{fit.chi2:.2f} with {fit.degrees_of_freedom} degrees of freedom, published {CHI2}"),
        Check("mass ratios are within two sigmas of the published ones", bool(np.abs(off).max() < 2.0),
              f"{np.abs(off).max():.2f} at most"),
        Check("transits sought as events are those that were fitted, to ten milliseconds", apart < 1e-2,
              f"{apart:.1e} s at most"),
    ]  # fmt: skip
    return StudyResult(
        tables=[Table("The planets of TRAPPIST-1", columns, rows)], checks=checks, figures={"ttv": lambda: fit.plot()}
    )


def _apart(run, fit, name):
    """Return the largest difference, seconds, between fitted transits of a planet and those of a run."""
    found = run.transits(name)["time"].to_value(u.s)
    table = fit.transit_residuals()
    table = table[table["planet"] == name]
    fitted = ((table["date"] - EPOCH) - table["residual"]).to_value(u.s)
    return float(np.abs(found[np.abs(found[:, None] - fitted).argmin(axis=0)] - fitted).max())


scenario = Study(
    name="ttv",
    title="The planets of TRAPPIST-1, weighed by the times of their transits",
    experiment=experiment,
)

if __name__ == "__main__":
    scenario.main()
