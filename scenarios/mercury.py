"""Mercury's perihelion: 42.98 arcseconds a century by relativity, beside about 532 by the planets, from runs.

The direction of the perihelion is that of the Laplace–Runge–Lenz vector of Mercury's orbit about the Sun. What it turns
within the plane of the orbit is summed from sample to sample, and a straight line is fitted to it. Two bodies alone
turn by relativity, or by the Sun's flattening. The planets turn it most, Venus above all; that is measured with one of
them at a time, then with all at once, without relativity and with it. By planets the line turns unevenly, and what is
measured depends a little on the years.

Relativity is that of Einstein, Infeld and Hoffmann; its constants and the states are those of DE440. Beside it stands
the formula 6 pi GM / (c^2 a (1 - e^2)) for a revolution.

Source: Clemence (1947), Rev. Mod. Phys. 19, 361: 531.5" by the planets and 43.0" by relativity; Park et al. (2017), AJ
153, 121: 42.9799" by relativity, and 575.31" in all.
"""

import numpy as np
from astropy import constants
from astropy import units as u

import orbits
from orbits.scenario import Check, Study, StudyResult, Table
from orbits.system.solar.constants import constant

EPOCH = "2000-01-01"
CENTURIES = 2.0
DAYS = 4.0
"""The step, and the time from sample to sample."""
METHOD = orbits.Gauss(stages=8)
PLANETS = ("Venus", "Earth-Moon barycenter", "Mars", "Jupiter", "Saturn", "Uranus", "Neptune")
ORDER = ("Venus", "Jupiter", "Earth-Moon barycenter")
ARCSEC = np.pi / 180 / 3600
RELATIVITY, PUBLISHED_PLANETS = 42.980, (528.0, 536.0)
"""By relativity [arcseconds per century]; bounds for the sum over the planets."""


def bodies(*names):
    """Newtonian point masses with the Sun and Mercury first."""
    return orbits.System.solar_system(epoch=EPOCH, bodies=["Sun", "Mercury", *names])


def turning(system):
    """Return centuries and the angle by which the perihelion has turned in the orbit's plane [arcseconds]."""
    times = np.arange(0.0, CENTURIES * 36525.0, DAYS)
    run = orbits.propagate(
        system, METHOD, dt=DAYS * u.day, duration=times[-1], samples=times, progress=False, check_step=False
    )
    gm = float((system.gm[0] + system.gm[1]).value)
    q, v = (np.asarray(x.value[:, 1] - x.value[:, 0]) for x in (run.q, run.v))
    spin = np.cross(q, v)
    towards = np.cross(v, spin) / gm - q / np.linalg.norm(q, axis=1)[:, None]
    towards /= np.linalg.norm(towards, axis=1)[:, None]
    normal = spin / np.linalg.norm(spin, axis=1)[:, None]
    sine = np.sum(normal[:-1] * np.cross(towards[:-1], towards[1:]), axis=1)
    angle = np.concatenate([[0.0], np.cumsum(np.arcsin(sine))])
    return times / 36525.0, angle / ARCSEC


def rate(curve):
    """The slope of the line through the angles of whole revolutions [arcseconds per century]."""
    return float(np.polyfit(*curve, 1)[0])


def formula():
    """6 pi GM / (c^2 a (1 - e^2)) in a revolution, for a century of Mercury's osculating orbit [arcseconds]."""
    orbit = bodies().elements(primary="Sun")["Mercury"]
    a, e = orbit.a.to_value(u.km), float(orbit.e)
    c = constants.c.to_value(u.km / u.s)
    gm = float(bodies().gm.sum().to_value(u.km**3 / u.s**2))
    turns = 36525.0 / orbit.P.to_value(u.day)
    return 6 * np.pi * gm / (c**2 * a * (1 - e**2)) * turns / ARCSEC


def experiment(say):
    """The turning of the perihelion by each cause, alone and together."""
    pole = (286.13, 63.87) * u.deg
    flat = orbits.terms.ZonalHarmonics("Sun", J2=constant("J2SUN"), radius=constant("ASUN") * u.km, pole=pole)
    alone = turning(bodies())
    curves = {"relativity": turning(bodies().with_terms(orbits.terms.PostNewtonian())), "the Sun's J2": None}
    curves["the Sun's J2"] = turning(bodies().with_terms(flat))
    for planet in PLANETS:
        say(f"Mercury with {planet}")
        curves[planet] = turning(bodies(planet))
    say("Mercury with all planets, without and with relativity")
    newton, whole = turning(bodies(*PLANETS)), turning(bodies(*PLANETS).with_terms(orbits.terms.PostNewtonian(), flat))
    rates = {name: rate(curve) for name, curve in curves.items()}
    by_planets, total = rate(newton), rate(whole)
    rows = [[name, value] for name, value in sorted(rates.items(), key=lambda item: -item[1])]
    rows += [["all planets at once", by_planets], ["planets, relativity and J2", total]]
    rows += [["of it not by planets", total - by_planets]]
    expected = formula()
    found = rates["relativity"]
    low, high = PUBLISHED_PLANETS
    checks = [
        Check('two bodies without relativity do not turn', abs(rate(alone)) < 1e-6, f'{rate(alone):.1e}"'),
        Check(f'relativity turns it by {RELATIVITY:.3f}" ± 0.001" a century', abs(found - RELATIVITY) < 1e-3,
              f'{found:.4f}"'),
        Check('the formula agrees to 0.001"', abs(found - expected) < 1e-3, f'{expected:.4f}"'),
        Check(f'the planets turn it by {low:g}" to {high:g}"', low < by_planets < high, f'{by_planets:.2f}"'),
        Check(
            'relativity and J2 add to the planets what they do alone, to 0.1"',
            abs(total - by_planets - found - rates["the Sun's J2"]) < 0.1, f'{total - by_planets:.3f}"',
        ),
        Check("Venus turns it most, then Jupiter, then the Earth",
              tuple(sorted(PLANETS, key=lambda name: -rates[name]))[: len(ORDER)] == ORDER, ""),
    ]  # fmt: skip
    return StudyResult(
        tables=[Table("What turns Mercury's perihelion", ["by", "arcseconds a century"], rows)],
        checks=checks,
        figures={"mercury": lambda: draw(curves, rates, newton, whole)},
        record={"arcseconds per century": rates | {"all planets": by_planets, "all": total, "formula": expected}},
    )


def smooth(curve):
    """Means over a year and more, which hide what a revolution does."""
    n = len(curve[0]) // 200
    count = len(curve[0]) // n
    return tuple(np.asarray(x)[: count * n].reshape(count, n).mean(axis=1) for x in curve)


def draw(curves, rates, newton, whole):
    """The angle over time without and with relativity, what lies between, and the share of each cause."""
    from orbits import plotting

    style = plotting.style
    figure = plotting.figure(17, 9)
    panels = figure.subplot_mosaic([["angle", "shares"], ["rest", "shares"]], width_ratios=[1.25, 1])
    axis = panels["angle"]
    for curve, colour, label in (
        (whole, style.VERMILION, "with relativity"), (newton, style.BLUE, "planets alone"),
    ):  # fmt: skip
        t, angle = smooth(curve)
        axis.plot(100 * t, angle, color=colour, lw=2.4, label=f'{label}: {rate(curve):.1f}" a century')
    axis.set(title="the perihelion has turned by", ylabel="arcseconds", xlim=(0, 100 * CENTURIES))
    axis.legend(loc="upper left", fontsize=15)
    axis = panels["rest"]
    t, with_all = smooth(whole)
    rest = with_all - smooth(newton)[1]
    axis.plot(100 * t, rest, color=style.INK, lw=2.2)
    axis.set(title="the difference: 43 arcseconds a century", xlabel="years since 2000", ylabel="arcseconds")
    axis.set_xlim(0, 100 * CENTURIES)
    for each in (panels["angle"], axis):
        each.grid(axis="y", color=style.FAINT, lw=0.6)
    axis = panels["shares"]
    order = sorted(rates, key=lambda name: rates[name])
    values = [rates[name] for name in order]
    colours = [style.VERMILION if name == "relativity" else style.BLUE for name in order]
    axis.barh(range(len(order)), values, color=colours)
    axis.set_yticks(range(len(order)), [plotting.short(name) for name in order])
    axis.set(xscale="log", xlim=(min(values) / 3, 4 * max(values)), xlabel="arcseconds a century")
    axis.set_title("each cause alone")
    for i, value in enumerate(values):
        axis.annotate(f"{value:.3g}", (value, i), xytext=(5, 0), textcoords="offset points", va="center", fontsize=15)
    figure.suptitle("Mercury's perihelion", fontsize=21, fontweight="bold")
    return figure


scenario = Study(
    name="mercury",
    title="Mercury's perihelion: 43 arcseconds a century by relativity, beside 532 by the planets",
    experiment=experiment,
    certifies=[(bodies("Venus").with_terms(orbits.terms.PostNewtonian()), METHOD, 4.0)],
)

if __name__ == "__main__":
    scenario.main()
