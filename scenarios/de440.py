"""The model of the Solar System built up term by term, against JPL's DE440 over thirty years.

All start from DE440's states on 2000-01-01 and are compared with it to 2030-01-01: from Newtonian point masses, which
miss Mercury by 5,300 km, to the model "full" with 420 bodies, which misses it by a metre. Positions are heliocentric,
of the Moon geocentric; what counts is the largest distance in the last tenth of the time. Masses and constants are
those that DE440 was integrated with. What is left of the Moon is tides, and its librations.

The sixteen largest asteroids are also compared with JPL's own integration of them, sb441-n16, at the end.

Source: Park, Folkner, Williams & Boggs (2021), AJ 161, 105, for what DE440 contains.
"""

import numpy as np
from astropy import units as u

import orbits
from orbits.regression.of_ephemeris import Residuals
from orbits.scenario import Check, Study, StudyResult, Table
from orbits.system.solar.building import LARGEST
from orbits.system.solar.small_bodies import small_bodies
from orbits.system.solar.small_body_states import DAYS as TABLE
from orbits.system.solar.small_body_states import states

EPOCH, DAYS = "2000-01-01", 10958.0
METHOD, DT = orbits.Gauss(stages=8), 3 * u.day
EVERY = 21.0
"""Days from sample to sample, a multiple of the step."""
YEARS = DAYS / 365.25

SHOWN = ("Mercury", "Venus", "Earth-Moon barycenter", "Moon", "Mars", "Jupiter", "Saturn", "Uranus", "Neptune", "Pluto")
FIELDS = ("PostNewtonian", "ZonalHarmonics", "DegreeTwo")
NEWTON, FIGURES, FULL = "Newton", "+ figures", "+ 30 TNOs"

WORDS = (
    *("Newtonian\npoint masses", "+ relativity", "+ J2\nof the Sun", "+ figures of\nEarth and Moon", "+ 16\nasteroids"),
    *("+ 343\nasteroids", "+ loss of mass\nby the Sun", "+ frame\ndragging", "+ ring", "+ 30 trans-\nNeptunians"),
)

RELATIVISTIC_KM = dict(zip(SHOWN, (1, 1, 5, 10, 15, 10, 8, 100, 100, 100), strict=True))
FULL_KM = dict(zip(SHOWN, (0.005, 0.005, 0.04, 8, 0.05, 0.1, 0.6, 1, 1, 1), strict=True))
ASTEROIDS_KM = 1.0


def ladder():
    """Return the systems by name, each with one thing more than the one before."""
    full = orbits.System.solar_system(epoch=EPOCH, model="full")
    known = small_bodies()
    asteroids, objects = known.names[: known.asteroids], known.names[known.asteroids :]
    ring = [name for name in full.names if name.startswith("ring ")]
    lighter = [name for name, gm in zip(asteroids, known.gm, strict=False) if gm < LARGEST]
    steps = [
        (NEWTON, [*asteroids, *objects, *ring], ()),
        ("+ relativity", [*asteroids, *objects, *ring], ("PostNewtonian",)),
        ("+ Sun's J2", [*asteroids, *objects, *ring], ("PostNewtonian", "ZonalHarmonics of Sun")),
        (FIGURES, [*asteroids, *objects, *ring], FIELDS),
        ("+ 16 asteroids", [*lighter, *objects, *ring], (*FIELDS, "MinorBodies")),
        ("+ 343 asteroids", [*objects, *ring], (*FIELDS, "MinorBodies")),
        ("+ mass loss", [*objects, *ring], (*FIELDS, "MinorBodies", "MassLoss")),
        ("+ dragging", [*objects, *ring], None),
        ("+ ring", objects, None),
        (FULL, (), None),
    ]
    return {name: having(full.remove(*without) if without else full, kinds) for name, without, kinds in steps}


def having(system, kinds):
    """Return a system with its terms and forces of some kinds only, or those of a body; None for all."""
    if kinds is None:
        return system
    names = {x: type(x).__name__ for x in system.terms}
    terms = [x for x, name in names.items() if name in kinds or f"{name} of {x.body}" in kinds]
    return system.replaced(terms=terms, forces=[x for x in system.forces if type(x).__name__ in kinds])


def run_of(system):
    """March over the years, sampled every three weeks and at the end."""
    times = np.append(np.arange(0.0, DAYS, EVERY), DAYS)
    return orbits.propagate(system, METHOD, dt=DT, duration=DAYS, samples=times, progress=False, check_step=False)


def asteroids_off(run):
    """Return the distances of the largest asteroids from JPL's own integration at the end [km], by name."""
    known = small_bodies()
    q = np.asarray(run.q[-1].to_value(u.km))
    real = dict(zip(known.names, states(orbits.System, float(TABLE[-1]), 0.0)[0], strict=True))
    sun = q[run.system.index("Sun")]
    largest = [name for name, gm in zip(known.names[: known.asteroids], known.gm, strict=False) if gm >= LARGEST]
    return {name: float(np.linalg.norm(q[run.system.index(name)] - sun - (real[name] * u.au).to_value(u.km)))
            for name in largest}  # fmt: skip


def inner():
    """Sun, Mercury and Jupiter by the relativistic model, for the certificate."""
    return orbits.System.solar_system(epoch=EPOCH, bodies=["Sun", "Mercury", "Jupiter"], model="relativistic")


def experiment(say):
    """All rungs of the ladder, and what each misses."""
    found, off, seconds = {}, {}, 0.0
    for name, system in ladder().items():
        say(f"{name}: {len(system)} bodies")
        run = run_of(system)
        seconds = run.statistics.wall_time
        bodies = [body for body in run.names if body in (*SHOWN, "Sun", "Earth")]
        found[name] = orbits.residuals(run, bodies=bodies, title=name)
        if name == FULL:
            off = asteroids_off(run)
    late = {name: each.last_tenth() for name, each in found.items()}
    rows = [[name, *(values[body] for body in SHOWN)] for name, values in late.items()]
    rows += [["demanded: figures", *map(float, RELATIVISTIC_KM.values())]]
    rows += [["demanded: all", *map(float, FULL_KM.values())]]
    checks = [
        Check(f"{name}: {body} within {km:g} km of DE440", late[rung][body] <= km, f"{late[rung][body]:.3g} km")
        for rung, name, bounds in ((FIGURES, "relativity and figures", RELATIVISTIC_KM), (FULL, "full", FULL_KM))
        for body, km in bounds.items()
    ]
    median = float(np.median(list(off.values())))
    checks.append(
        Check(f"the 16 largest asteroids: median within {ASTEROIDS_KM:g} km of JPL's integration",
              median <= ASTEROIDS_KM, f"{median:.2f} km")
    )  # fmt: skip
    columns = ["each row adds", *("EMB" if body == SHOWN[2] else body[:4] for body in SHOWN)]
    return StudyResult(
        tables=[
            Table(f"Largest distance from DE440 [km], years {0.9 * YEARS:.0f} to {YEARS:.0f}", columns, rows),
            Table("From sb441-n16 after 30 years", ["asteroid", "km"], [list(x) for x in off.items()]),
        ],
        checks=checks,
        figures={"de440": lambda: draw(found, late)},
        record={"last_tenth_km": late, "asteroids_km": off, "seconds_of_the_full_model": seconds},
    )


def draw(found: dict[str, Residuals], late):
    """Residuals over time of three rungs [km], and the ladder."""
    from orbits import plotting
    from orbits.regression.residuals_picture import panel

    style = plotting.style
    figure = plotting.figure(19, 13)
    panels = figure.subplot_mosaic([[NEWTON, FIGURES, FULL], ["ladder"] * 3], height_ratios=[1, 1.15])
    titles = {NEWTON: "Newtonian point masses", FIGURES: "relativity, figures of bodies", FULL: "all that acts"}
    for (name, title), least in zip(titles.items(), (0.1, 1e-3, 1e-7), strict=True):
        each = found[name]
        some = Residuals(each.kernel, each.method, each.years, {k: x for k, x in each.km.items() if k != "Earth"})
        panel(panels[name], some, least=least)
        panels[name].set_title(title)
    axis = panels["ladder"]
    names = list(late)
    for i, body in enumerate(SHOWN):
        values = [late[name][body] for name in names]
        axis.plot(range(len(names)), values, "o-", color=plotting.colour(body, i), lw=2.4, ms=7, label=body)
    ends = {body: late[names[-1]][body] for body in SHOWN}
    axis.set(yscale="log", ylabel="km", title="largest distance from DE440 in the last three of thirty years")
    axis.set_xticks(range(len(names)), list(WORDS))
    axis.tick_params(axis="x", labelsize=13)
    axis.set_xlim(-0.3, len(names) - 0.3)
    axis.set_ylim(min(ends.values()) / 3, 2e4)
    axis.grid(axis="y", color=style.FAINT, lw=0.6)
    handles, labels = axis.get_legend_handles_labels()
    told = "heliocentric, the Moon from the Earth; heavy lines: the largest so far"
    plotting.below(figure, handles, [plotting.short(label) for label in labels], told, size=15)
    figure.suptitle("The Solar System against DE440, 2000 to 2030", fontsize=22, fontweight="bold")
    return figure


scenario = Study(
    name="de440",
    title="The Solar System built up term by term, against JPL's DE440",
    experiment=experiment,
    certifies=[(inner(), METHOD, 3.0)],
)

if __name__ == "__main__":
    scenario.main()
