"""Discrete Lagrangians of Kepler's problem against the exact one: their errors fall as h to the order plus one.

L_d(q0, q1; h) approximates the action of the true motion from q0 to q1; the exact action has a closed form, Lambert's
theorem. A method of order r has |L_d - exact| = O(h^(r+1)) along true solutions, as is measured here for symplectic
Euler, the trapezoidal and midpoint rules, Lobatto IIIA-IIIB and Gauss.

Source: Marsden & West (2001), theorem 2.3.1.
"""

import numpy as np

import orbits
from orbits import discrete
from orbits.diagnostics.convergence import slope
from orbits.lagrangians.kepler import kepler
from orbits.scenario import Check, Study, StudyResult, Table

Q, V = np.array([0.7, 0.2]), np.array([-0.3, 1.2])  # an ellipse of e = 0.35, GM = 1
STEPS = 0.64 * 2.0 ** (-0.5 * np.arange(19))
FLOOR, CEILING = 2e-14, 3e-4
"""Errors between round-off, the action being h, and steps so long that the next power of h shows."""
SLACK = 0.03
"""Relative, of a slope: the next power of h bends the curve of Gauss(4) by 0.02."""


def methods():
    """(name, order, discrete Lagrangian) of each method."""
    vprk = [orbits.methods.LobattoIIIAB(stages=3), *(orbits.Gauss(stages=s) for s in (2, 3, 4))]
    return [
        ("symplectic Euler", 1, discrete.symplectic_euler_b(kepler)),
        ("trapezoidal", 2, discrete.trapezoidal(kepler)),
        ("midpoint", 2, discrete.midpoint(kepler)),
        *((m.label, m.order, discrete.vprk(kepler, m.tableau, name=m.label)) for m in vprk),
    ]


def true_positions():
    """Where the true motion is after each step: Gauss(8) in steps of at most 0.005, exact to round-off."""
    gauss = orbits.Gauss(stages=8)
    ends = []
    for h in STEPS:
        steps = int(np.ceil(h / 0.005))
        ends.append(orbits.march(kepler, gauss, q=Q, v=V, dt=h / steps, steps=steps, every=steps).q[-1])
    return ends


def experiment(say):
    """Errors of each L_d for steps that fall by the root of two, and the slope where it can be seen."""
    exact = discrete.exact_kepler(kepler.parameters["GM"])
    ends = true_positions()
    truth = [exact.value(Q, q1, h) for q1, h in zip(ends, STEPS, strict=True)]
    rows, checks, curves = [], [], []
    for name, order, L_d in methods():
        say(f"{name}: L_d for {len(STEPS)} steps")
        errors = np.array([abs(L_d.value(Q, q1, h) - e) for q1, h, e in zip(ends, STEPS, truth, strict=True)])
        fitted = slope(STEPS, errors, floor=FLOOR, ceiling=CEILING)
        rows.append([name, order, order + 1, fitted.order, len(fitted.h), float(errors[0])])
        claim = f"{name}: |L_d - exact| falls as h^{order + 1}"
        checks.append(Check(claim, abs(fitted.order - order - 1) < SLACK * (order + 1), f"slope {fitted.order:.2f}"))
        curves.append((name, order, errors, fitted))
    columns = ["method", "order r", "r + 1", "slope", "steps fitted", f"error at h = {STEPS[0]:g}"]
    table = Table("|L_d - exact L_d| along a true orbit", columns, rows)
    record = {"h": STEPS, "errors": {name: errors for name, _, errors, _ in curves}}
    return StudyResult(tables=[table], checks=checks, figures={"discrete_kepler": lambda: draw(curves)}, record=record)


def draw(curves):
    """Errors against h, log-log; each curve with its slope at its end."""
    from orbits import plotting

    style = plotting.style
    figure = plotting.figure(13, 9)
    axis = figure.subplots()
    markers = "osD^vPX"
    for k, (name, order, errors, fitted) in enumerate(curves):
        look = {"color": style.PALETTE[k], "marker": markers[k]}
        label = f"{plotting.method_words(name)}: slope {fitted.order:.2f}, order {order}"
        seen = errors > 0
        axis.loglog(STEPS[seen], errors[seen], ls="", ms=4, alpha=0.45, **look)
        axis.loglog(fitted.h, fitted.errors, ms=8, lw=2.2, label=label, **look)
        h = np.array([min(fitted.h), STEPS[0]])
        axis.loglog(h, fitted.errors[0] * (h / h[0]) ** (order + 1), ls=(0, (2, 3)), lw=1, color=style.PALETTE[k])
    axis.axhspan(1e-19, 2.0**-53, color=style.FAINT, alpha=0.7, lw=0)
    axis.text(STEPS[0], 2.0**-53.5, "round-off", ha="right", va="top", fontsize=13, color=style.GREY)
    axis.set(ylim=(3e-18, 30), xlabel="step h", ylabel="$|L_d(q_0, q_1; h)$ − exact|")
    axis.set_title("Discrete Lagrangians against the action of the true motion", fontweight="bold", fontsize=19)
    axis.grid(color=style.FAINT, lw=0.6)
    axis.legend(loc="upper left", fontsize=15)
    told = "large marks and lines: where the slope is fitted; small marks: all steps; dotted: h to the order plus one"
    plotting.below(figure, [], [], told)
    return figure


scenario = Study(
    name="discrete_kepler",
    title="Discrete Lagrangians of Kepler's problem against the exact one",
    experiment=experiment,
    certifies=[
        (kepler, method, 0.1, tuple(Q), tuple(V))
        for method in (orbits.StormerVerlet(), orbits.methods.LobattoIIIAB(stages=3), orbits.Gauss(stages=3))
    ],
)

if __name__ == "__main__":
    scenario.main()
