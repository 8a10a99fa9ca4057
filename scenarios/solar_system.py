"""The Solar System for a thousand years: Sun, planets and Pluto from JPL's DE440, to the round-off floor.

Newtonian point masses from J2000 at steps of six days: Gauss collocation with 8 stages, Störmer–Verlet, and RK4 and
explicit Euler as the foils that lose angular momentum; beside them REBOUND's WHFast and IAS15. Positions are measured
against Gauss with half and a quarter of the step.
"""

import numpy as np
from astropy import units as u

import orbits

METHODS = [orbits.Gauss(stages=8), orbits.StormerVerlet(), orbits.RungeKutta4(), orbits.ExplicitEuler()]
ROUND_OFF = 1e-14
INNER = ("Mercury", "Venus", "Earth-Moon barycenter", "Mars")


def checks(outcome):
    """Angular momentum: at round-off where the method declares its momentum maps, visibly not where it does not."""
    for label, run in outcome.runs.items():
        change = run.drift().angular_momentum.max_fraction
        if "momentum maps" in run.integrator.declares:
            yield orbits.Check(f"{label} keeps angular momentum", change < ROUND_OFF, f"{change:.1e}")
        else:
            yield orbits.Check(f"{label} loses angular momentum", change > 10 * ROUND_OFF, f"{change:.1e}")


def draw(outcome):
    """Orbits from above, inner and outer; conserved quantities; the error of every planet, method by method."""
    from orbits import plotting

    run, report = outcome.run, outcome.report
    figure = plotting.figure(16, 10)
    axes = figure.subplot_mosaic(
        [["outer", "outer", "energy", "energy"], ["outer", "outer", "momentum", "momentum"],
         ["inner", "inner", "errors", "errors"], ["inner", "inner", "errors", "errors"]],
    )  # fmt: skip
    start, end = run[0], run[len(run) - 1]
    for name, panel, reach in (("outer", axes["outer"], 50.0), ("inner", axes["inner"], 1.75)):
        for i, body in enumerate(run.names):
            if (body in INNER) != (name == "inner") and body != "Sun":
                continue
            look = {"color": plotting.colour(body, i)}
            for state, width in ((start, 0.7), (end, 1.6)):
                ellipse = plotting.osculating_ellipse(state, body)
                if ellipse is not None:
                    panel.plot(ellipse[:, 0], ellipse[:, 1], lw=width, **look)
            place = plotting.in_plane(end, end.values.q[i])
            label = None if body == "Sun" else plotting.short(body)
            panel.plot(place[0], place[1], "o", ms=8, mec="white", mew=0.8, label=label, **look)
        panel.set(xlim=(-reach, reach * 1.9), ylim=(-reach, reach), xlabel="x [au]", ylabel="y [au]")
        panel.set_aspect("equal", adjustable="box")
        panel.legend(loc="center right", fontsize=13, handletextpad=0.1)
    axes["outer"].set_title("outer planets and Pluto")
    axes["inner"].set_title("inner planets (thin: orbits at the start)")
    years = run.t.to_value(u.yr)
    plotting.flatness(axes["energy"], years, run.energy().value, "energy")
    plotting.flatness(axes["momentum"], years, run.angular_momentum().value, "angular momentum, three components")
    axes["momentum"].set_xlabel("years since J2000")
    if report is not None:
        errors(axes["errors"], report, [name for name in run.names if name != "Sun"])
    first, last = run.epochs[0].jyear, run.epochs[-1].jyear
    figure.suptitle(
        f"The Solar System from {first:.0f} to {last:.0f}: {run.integrator.label}, dt = {run.dt:.4g}",
        fontsize=21,
        fontweight="bold",
    )
    return figure


def errors(panel, report, names):
    """The largest position error of each body: a dot for each method."""
    from orbits import plotting

    markers = "osD^vP"
    for k, row in enumerate(report.rows):
        if row.positions:
            values = [max(row.positions.get(name, np.nan), 1e-7) for name in names]
            panel.plot(
                values, range(len(names)), markers[k % 6], ms=9, color=plotting.style.PALETTE[k], label=row.method
            )
    panel.set_yticks(range(len(names)), [plotting.short(name) for name in names])
    panel.invert_yaxis()
    panel.set(xscale="log", xlabel="km", title="largest position error")
    panel.grid(color=plotting.style.FAINT, lw=0.6)
    panel.legend(loc="lower center", bbox_to_anchor=(0.45, -0.32), ncols=4, fontsize=13)


scenario = orbits.Scenario(
    name="solar_system",
    title="Sun, planets and Pluto for a thousand years from DE440",
    system=orbits.System.solar_system,
    integrators=METHODS,
    dt=6 * u.day,
    duration=1000 * u.yr,
    samples=1001,
    against=("whfast-corrector17", "ias15"),
    tolerances={
        "gauss": {"energy": 1e-14, "angular_momentum": ROUND_OFF, "position_km": 0.2},
        "stormer-verlet": {"angular_momentum": ROUND_OFF},
    },
    checks=checks,
    draw=draw,
)

if __name__ == "__main__":
    scenario.main()
