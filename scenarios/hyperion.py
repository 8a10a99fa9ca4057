"""Hyperion's spin about the axis of its orbit: the chaotic sea of Wisdom, Peale and Mignard, and axes that fall over.

Each dot is a pericentre: the angle of the long axis and the rate of the spin. At alpha = 0.89 and e = 0.1 the
resonances 1:2, 1:1 and 3:2 have merged into a sea in which the rate wanders between 0.045 and 2.56 of the mean motion;
islands are left about 1:1, whose spin is at a rate of 0.55 when at the pericentre, 2:1 and others. Then the full
problem in space: spins in the middle of islands, with an axis a ten-millionth of a degree off the normal of the orbit.
At 1:1 and 1:2 the tilt grows by a constant factor in each revolution, until the moon tumbles; at 2:1 and 5:2 it stays
as it is.

That this is what Hyperion does is disputed. It is seen to turn 4.2 to 4.5 times in a revolution, outside of this sea.
Goldberg and Batygin (2024) find that it is near or in a resonance of its nutation with the orbit, in which it rotates
almost regularly, and that chaos, if there is any, is orders of magnitude weaker than was thought.

Sources: Wisdom, Peale & Mignard (1984), Icarus 58, 137; the half-axes are those of Smith et al. (1982), Science 215,
504, and give alpha for a homogeneous ellipsoid. Goldberg & Batygin (2024), A&A 692, A9; the rates seen are in its table
1, from Black et al. (1995) and Harbison et al. (2011).
"""

import numpy as np

import orbits
from orbits import rotations
from orbits.diagnostics.loops import area, loop
from orbits.scenario import Check, Study, StudyResult, Table
from orbits.spin_orbit import PlanarSpins

E, ALPHA = 0.1, 0.89
HALF_AXES = 190.0, 145.0, 114.0
"""Kilometres; (B - A)/C = (a^2 - b^2)/(a^2 + b^2)."""

SPINS = PlanarSpins(eccentricity=E, alpha=ALPHA)
REVOLUTIONS = 2000
RATES = np.linspace(0.0, 3.2, 81)
SEA = 0.05
"""Lyapunov exponents above this, per revolution, are those of the sea; regular ones are below 0.005 after so long."""

ISLANDS = {"1:1": (1, 0.0), "1:2": (0.5, np.pi / 2), "2:1": (2, 0.0), "5:2": (2.5, 0.0)}
"""Turns in a revolution, and the angle at the pericentre."""

TILT, FALL = np.radians(1e-7), 40
PER_REVOLUTION = 192
METHOD = orbits.methods.Composition(orbits.StormerVerlet(), order=8)
"""Kicks and exact rotations."""


def in_space(islands):
    """Saturn, with GM = 1, and a moon of Hyperion's shape in the middle of each island, at a = 1, with little tilt."""
    count, size = len(islands), 1e-9  # so small that its figure does not move its orbit
    place, speed = [1 - E, 0, 0], [0, np.sqrt((1 + E) / (1 - E)), 0]
    system = orbits.System(
        ["Saturn", *islands], [1.0] + [0.0] * count, [[0, 0, 0]] + [place] * count, [[0, 0, 0]] + [speed] * count,
        units=orbits.DIMENSIONLESS,
    )  # fmt: skip
    moons = {}
    for name, island in islands.items():
        half, tilt = 0.5 * island.theta, 0.5 * TILT
        attitude = rotations.product([np.cos(half), 0, 0, np.sin(half)], [np.cos(tilt), np.sin(tilt), 0, 0])
        moons[name] = orbits.RigidBody(shape=size * np.array(HALF_AXES), attitude=attitude, spin=island.rate)
    return system.with_rigid(moons)


def falls(islands):
    """Revolutions, and the tilt of the axis of each moon in degrees."""
    revolution = 2 * np.pi
    run = orbits.propagate(
        in_space(islands), METHOD, dt=revolution / PER_REVOLUTION, duration=FALL * revolution, samples=16 * FALL + 1,
        progress=False,
    )  # fmt: skip
    turning = run.rotation
    return np.linspace(0, FALL, 16 * FALL + 1), {name: np.asarray(turning.obliquity(name).value) for name in islands}


def growth(revolutions, tilt):
    """The logarithm of the factor by which the tilt grows in a revolution, while it is small; 0 if it does not."""
    grown = (tilt > 3 * np.degrees(TILT)) & (np.maximum.accumulate(tilt) < 0.5)
    if grown.sum() < 20:
        return 0.0
    return float(np.polyfit(revolutions[grown], np.log(tilt[grown]), 1)[0])


def one_map():
    """The largest difference, after three revolutions, from orbit and spin marched together by Gauss."""
    lagrangian = orbits.lagrangians.spin_orbit.with_parameters(alpha=ALPHA, eps=1e-20)
    path = orbits.march(
        lagrangian, orbits.Gauss(stages=8), dt=2 * np.pi / 200, steps=600, every=200,
        q=[1 - E, 0, 0.5], v=[0, np.sqrt((1 + E) / (1 - E)), 0.6],
    )  # fmt: skip
    own = PlanarSpins(eccentricity=E, alpha=ALPHA, steps=400).section(0.5, 0.6, 3)
    return float(np.abs([own.theta[0] - path.q[:, 2], own.rate[0] - path.v[:, 2]]).max())


def experiment(say):
    """The section, its islands and its sea; then four moons in space."""
    axes = np.square(HALF_AXES)
    alpha = float(np.sqrt(3 * (axes[0] - axes[1]) / (axes[0] + axes[1])))
    theta, rate = (x.ravel() for x in np.meshgrid([0.0, np.pi / 2], RATES))
    say(f"{len(rate)} spins for {REVOLUTIONS:,} revolutions")
    section = SPINS.section(theta, rate, REVOLUTIONS)
    chaotic = SPINS.lyapunov(theta, rate, REVOLUTIONS) > SEA
    say("ten spins of the sea for 20,000 revolutions")
    wandering = SPINS.section(1.0, np.linspace(1.0, 2.0, 10), 20_000)
    low, high = float(wandering.rate.min()), float(wandering.rate.max())
    exponent = float(SPINS.lyapunov(1.0, np.linspace(1.0, 2.0, 10), 20_000).mean())
    ring = [x[:, 0] for x in loop(np.zeros(1), np.array([0.55]), np.array([0.1]), np.array([0.1]), 400)]
    ring = SPINS.section(*ring, 100)
    areas = np.array([area(x[:, None], y[:, None]) for x, y in zip(ring.theta.T, ring.rate.T, strict=True)])
    kept = float(np.abs(areas / areas[0] - 1).max())
    islands = {name: SPINS.libration(turns, theta=angle) for name, (turns, angle) in ISLANDS.items()}
    say(f"{len(islands)} moons in space, for {FALL} revolutions")
    revolutions, tilts = falls(islands)
    grown = {name: growth(revolutions, tilt) for name, tilt in tilts.items()}
    most = {name: float(tilt.max()) for name, tilt in tilts.items()}
    rows = [
        [name, f"{abs(np.degrees(island.theta)):.0f}°", f"{island.rate:.4f}", f"{island.period:.2f}",
         f"{grown[name]:.2f}" if grown[name] else "none",
         f"{most[name]:.0f}°" if most[name] > 1 else f"{most[name]:.1e}°"]
        for name, island in islands.items()
    ]  # fmt: skip
    same = one_map()
    found = islands["1:1"].rate
    checks = [
        Check("the half-axes of Voyager give alpha = 0.89", abs(alpha - ALPHA) < 0.005, f"{alpha:.4f}"),
        Check("the synchronous island is about a rate of 0.55", abs(found - 0.55) < 0.005, f"{found:.4f}"),
        Check("the sea begins near a rate of 0.05", abs(low - 0.05) < 0.04, f"{low:.3f}"),
        Check("the sea ends near a rate of 2.54", abs(high - 2.54) < 0.04, f"{high:.3f}"),
        Check("neighbours in the sea separate by more than e^0.5 in a revolution", exponent > 0.5, f"e^{exponent:.2f}"),
        Check("the area of a loop of spins is kept over 100 revolutions", kept < 1e-12, f"{kept:.1e}"),
        Check("spins are those of orbit and spin marched together by Gauss", same < 1e-11, f"{same:.1e}"),
        Check("the axis falls over in the synchronous island", most["1:1"] > 30, f"by {most['1:1']:.0f}°"),
        Check("the axis falls over in the island 1:2", most["1:2"] > 60, f"by {most['1:2']:.0f}°"),
        Check("the axis stays in the islands 2:1 and 5:2", max(most["2:1"], most["5:2"]) < 3e-7,
              f"{max(most['2:1'], most['5:2']):.1e}°"),
    ]  # fmt: skip
    columns = ["island", "θ at the pericentre", "θ′/n there", "libration takes [revolutions]",
               "ln of the tilt's growth in a revolution", f"largest tilt in {FALL} revolutions"]  # fmt: skip
    return StudyResult(
        tables=[Table("Islands of Hyperion's section, and what becomes of a tilt of 1e-7°", columns, rows)],
        checks=checks,
        figures={"hyperion": lambda: draw(section, chaotic, islands, wandering, revolutions, tilts)},
        record={
            "sea": {"low": low, "high": high, "lyapunov exponent per revolution": exponent},
            "islands": {name: [each.theta, each.rate, each.period] for name, each in islands.items()},
            "growth of the tilt": grown,
        },
    )


BESIDE = {"1:2": (-18, 0), "5:2": (36, 0.2)}
"""Where the label of an island too small for one stands, from its middle: degrees, and the rate."""


def draw(section, chaotic, islands, wandering, revolutions, tilts):
    """The section, large; the rate of a spin in the sea; the tilts of axes in four islands."""
    from orbits import plotting

    style = plotting.style
    figure = plotting.figure(17, 10.5)
    panels = figure.subplot_mosaic([["section", "rate"], ["section", "tilt"]], width_ratios=[1.45, 1])
    axis = panels["section"]
    angles, shades = np.degrees(section.folded), [style.BLUE, style.GREEN, style.PURPLE, style.SKY, style.ORANGE]
    axis.plot(angles[chaotic].ravel(), section.rate[chaotic].ravel(), ",", color="#8F8F8F", zorder=1)
    for k, (x, y) in enumerate(zip(angles[~chaotic], section.rate[~chaotic], strict=True)):
        axis.plot(x, y, ".", ms=1.3, mew=0, color=shades[k % len(shades)], zorder=2)
    for name, island in islands.items():
        middle = np.degrees(island.theta), island.rate
        away = BESIDE.get(name, (0, 0))
        label = axis.annotate(
            name, middle, np.add(middle, away), ha="center", va="center", fontsize=15, fontweight="bold", zorder=4,
            arrowprops={"arrowstyle": "-|>", "color": style.INK, "shrinkA": 1, "shrinkB": 8} if any(away) else None,
        )  # fmt: skip
        style.halo(label)
    axis.set(xlim=(-90, 90), ylim=(0, 3.2), xticks=range(-90, 91, 30))
    axis.set(xlabel="angle of the long axis at the pericentre, θ [°]", ylabel="rate of the spin there, θ′/n")
    axis.set_title(f"{len(angles)} spins for {REVOLUTIONS:,} revolutions: α = {ALPHA}, e = {E}")
    axis = panels["rate"]
    axis.plot(wandering.rate[3, :301], "-", color=style.GREY, lw=0.5)
    axis.plot(wandering.rate[3, :301], ".", color=style.VERMILION, ms=5, mew=0)
    axis.set(xlim=(0, 300), ylim=(0, 2.7), xlabel="revolutions of the orbit", ylabel="θ′/n at the pericentre")
    axis.set_title("one spin of the sea")
    axis = panels["tilt"]
    colours = {"1:1": style.VERMILION, "1:2": style.PURPLE, "2:1": style.BLUE, "5:2": style.GREEN}
    for name, tilt in tilts.items():
        axis.plot(revolutions, tilt, color=colours[name], lw=2)
    axis.set(yscale="log", ylim=(1e-8, 3e2), xlim=(0, FALL), xlabel="revolutions of the orbit")
    axis.set(ylabel="tilt of the axis [°]", yticks=[1e-7, 1e-5, 1e-3, 1e-1, 10])
    axis.set_title("in space: an axis 1e-7° off, in four islands")
    for name, place in {"1:2": (5.2, 3e-3), "1:1": (18.5, 3e-2), "2:1": (31, 8e-7), "5:2": (36, 8e-7)}.items():
        axis.text(*place, name, color=colours[name], fontsize=16, fontweight="bold", ha="center")
    axis.grid(axis="y", color=style.FAINT, lw=0.6)
    caption = (
        "Grey: spins of the sea. Hyperion is seen to turn 4.2 to 4.5 times in a revolution, above what is drawn; "
        "whether it tumbles at random is disputed (Goldberg and Batygin 2024)."
    )
    plotting.below(figure, [], [], caption, size=14)
    title = "Hyperion: a chaotic sea, and islands in which its axis is unstable"
    figure.suptitle(title, fontsize=21, fontweight="bold")
    return figure


scenario = Study(
    name="hyperion",
    title="Hyperion's spin: Wisdom's chaotic sea, islands, and axes that fall over",
    experiment=experiment,
    certifies=[(orbits.lagrangians.spin_orbit, orbits.Gauss(stages=8), 0.1)],
)

if __name__ == "__main__":
    scenario.main()
