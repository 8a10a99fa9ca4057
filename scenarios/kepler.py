"""Kepler's problem from a circle to e = 0.9: conservation by variational methods and by non-symplectic controls.

A hundred orbits with 400 steps each, by Störmer–Verlet, Gauss, explicit Euler and RK4, together with REBOUND's WHFast
and IAS15, all measured against the exact orbit. Angular momentum is conserved to round-off by the variational methods,
but not by the controls.
"""

import numpy as np

import orbits
from orbits.scenario import angular_momentum_checks

ECCENTRICITIES = (0.0, 0.3, 0.6, 0.9)
METHODS = [orbits.Gauss(stages=8), orbits.StormerVerlet(), orbits.methods.RungeKutta4(), orbits.methods.ExplicitEuler()]
PERIOD = 2 * np.pi
DT = PERIOD / 400
SHOWN = 0.6
ROUND_OFF = 1e-14


def two_bodies(e):
    """A star and a planet of a thousandth of its mass, GM = 1 in all, a = 1, inclined: no component is zero."""
    bodies = {"star": {"gm": 0.999}, "planet": {"gm": 0.001, "a": 1.0, "e": e, "inc": 0.5, "Omega": 0.7, "omega": 0.4}}
    return orbits.System.from_elements(bodies, units=orbits.DIMENSIONLESS)


def systems():
    """One case for each eccentricity."""
    return {f"e = {e:g}": two_bodies(e) for e in ECCENTRICITIES}


def checks(outcome):
    """Angular momentum: at round-off where the method declares its momentum maps, visibly not where it does not."""
    controls = abs(outcome.run.step) > 0.99 * DT
    for name, case in outcome.cases.items():
        yield from angular_momentum_checks(case.runs, bound=ROUND_OFF, controls=controls, case=name)


def draw(outcome):
    """The orbits that each method draws at e = 0.6, and its errors; then the position errors at every eccentricity."""
    case = outcome.cases.get(f"e = {SHOWN:g}") or outcome.case
    return {"kepler": orbits_and_errors(case, outcome.scenario.dt), "kepler_eccentricities": eccentricities(outcome)}


def orbits_and_errors(case, dt):
    """One panel for each method: three orbits as a line, the samples of all as dots; below, what it keeps."""
    from orbits import plotting

    runs = list(case.runs.values())
    figure = plotting.figure(16, 10)
    above, below = figure.subfigures(2, 1, height_ratios=[1, 1.35])
    axes = above.subplot_mosaic([[f"orbit {k}" for k in range(len(runs))]])
    axes |= below.subplot_mosaic([["position", "energy", "momentum"]])
    exact = exact_ellipse(case.system)
    for k, run in enumerate(runs):
        panel = axes[f"orbit {k}"]
        options = {"dt": dt, "duration": 3 * PERIOD, "samples": 1201, "check_step": False}
        first = orbits.propagate(case.system, run.integrator, **options)
        panel.plot(exact[:, 0], exact[:, 1], color=plotting.style.GREY, lw=0.8)
        for part, look in ((run, {"ls": "", "marker": ".", "ms": 2.2, "alpha": 0.6}), (first, {"ls": "-", "lw": 1.2})):
            seen = orbital_plane(case.system, part["planet"].q.value - part["star"].q.value)
            panel.plot(seen[:, 0], seen[:, 1], color=plotting.style.PALETTE[k], **look)
        panel.plot(0, 0, "o", color="#E69F00", ms=8)
        panel.set(xlim=(-2.1, 1.0), ylim=(-1.45, 1.45), aspect="equal", xticks=[], yticks=[])
        for side in panel.spines.values():
            side.set_visible(False)
        panel.set_title(plotting.method_words(run.integrator.label), fontsize=17, loc="center")
    error_panels(axes, case)
    steps = "adaptive steps" if runs[0].clock.changes else f"{PERIOD / abs(runs[0].step):.0f} steps each"
    figure.suptitle(
        f"{abs(runs[0].times[-1]) / PERIOD:.4g} orbits with {case.name}, {steps}: "
        "what is kept, what is lost",
        fontsize=21,
        fontweight="bold",
    )
    told = (
        "above, in the plane of the orbit: grey, the exact orbit; coloured line, the first three orbits; dots, samples "
        "of all orbits within the panel. Below: the largest errors so far; coloured and dashed, REBOUND"
    )
    plotting.below(figure, *axes["position"].get_legend_handles_labels(), told)
    return figure


def error_panels(axes, case):
    """Largest errors so far of position, energy and angular momentum against time, all methods and peers."""
    from orbits import plotting

    unit = PERIOD
    for k, row in enumerate(case.report.rows if case.report else ()):
        if row.series is None:
            continue
        peer = row.kind == "peer"
        look = {
            "color": plotting.style.PALETTE[k % 8],
            "lw": 1.3 if peer else 2.0,
            "ls": (0, (5, 2)) if peer else "-",
            "label": plotting.method_words(row.method),
        }
        for name in ("position", "energy", "angular_momentum"):
            series = np.maximum.accumulate(np.maximum(np.nan_to_num(getattr(row.series, name)), 3e-17))
            axes["momentum" if name == "angular_momentum" else name].plot(
                np.abs(case.report.times) / unit, series, **look
            )
    for name, title in (
        ("position", "position error so far [a]"),
        ("energy", "energy, |ΔE/E| so far"),
        ("momentum", "angular momentum, |ΔL/L| so far"),
    ):
        panel = axes[name]
        panel.set(yscale="log", xscale="log", ylim=(2e-17, 10), title=title, xlabel="orbits")
        panel.axhline(2.0**-53, color=plotting.style.GREY, lw=1.2, ls=":", label="round-off, 2⁻⁵³")
        panel.grid(axis="y", color=plotting.style.FAINT, lw=0.6)


def eccentricities(outcome):
    """Position errors at every eccentricity."""
    from orbits import plotting

    names = list(outcome.cases)
    figure = plotting.figure(16, 7)
    axes = figure.subplot_mosaic([names], sharey=True)
    for name, case in outcome.cases.items():
        for k, row in enumerate(case.report.rows if case.report else ()):
            if row.series is None:
                continue
            peer = row.kind == "peer"
            axes[name].plot(
                np.abs(case.report.times) / PERIOD,
                np.maximum.accumulate(np.maximum(np.nan_to_num(row.series.position), 3e-17)),
                color=plotting.style.PALETTE[k % 8],
                lw=1.3 if peer else 2.0,
                ls=(0, (5, 2)) if peer else "-",
                label=plotting.method_words(row.method),
            )
        axes[name].set(yscale="log", xscale="log", ylim=(2e-17, 30), title=name, xlabel="orbits")
        axes[name].grid(axis="y", color=plotting.style.FAINT, lw=0.6)
    axes[names[0]].set_ylabel("largest position error so far [a]")
    told = "dashed: REBOUND. Errors below 3e-17, and of exactly 0, are drawn at 3e-17; those above 30 leave the panel"
    plotting.below(figure, *axes[names[0]].get_legend_handles_labels(), told)
    figure.suptitle("Error against the exact orbit, by eccentricity", fontsize=21, fontweight="bold")
    return figure


def orbital_plane(system, relative):
    """Return positions relative to the star in the orbit's own plane, the pericentre to the right."""
    x = system.values
    r, v = x.q[1] - x.q[0], x.v[1] - x.v[0]
    normal = np.cross(r, v) / np.linalg.norm(np.cross(r, v))
    right = r / np.linalg.norm(r)
    return relative @ np.array([right, np.cross(normal, right), normal]).T


def exact_ellipse(system):
    """Return points of the exact orbit in its plane."""
    e = float(system.elements(primary="star")["planet"].e)
    angle = np.linspace(0, 2 * np.pi, 721)
    return np.column_stack([np.cos(angle) - e, np.sqrt(1 - e * e) * np.sin(angle)])


scenario = orbits.scenarios.Scenario(
    name="kepler",
    title="Kepler's problem: variational methods and non-symplectic controls against the exact orbit",
    system=systems,
    integrators=METHODS,
    dt=DT,
    duration=100 * PERIOD,
    samples=2003,
    against=("whfast", "ias15"),
    tolerances={
        "gauss": {"energy": 5e-13, "angular_momentum": ROUND_OFF, "position": 1e-8},
        "stormer-verlet": {"angular_momentum": ROUND_OFF},
    },
    checks=checks,
    draw=draw,
)

if __name__ == "__main__":
    scenario.main()
