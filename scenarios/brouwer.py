"""Brouwer's law: unbiased round-off over 32 orbits, each integrated for 5,000 periods.

With unbiased rounding the energy performs a random walk: its error grows as the square root of time, and the phase
error with the power 3/2. This holds for Gauss with coefficients that are exactly symplectic in binary. With the same
coefficients rounded to nearest, which are wrong in the seventeenth digit, the energy drifts in one direction, and the
phase error grows as the square of time. REBOUND's IAS15 is shown for comparison.

The problem is Kepler's, with e = 0.2, 30 steps per period, and a different orientation and anomaly for each orbit.
Phases are mean longitudes, compared with Kepler's third law for exactly the floats of each initial state, in forty
digits.

Sources: Brouwer (1937); Hairer, McLachlan & Razakarivony (2008); Rein & Spiegel (2015) for IAS15.
"""

import mpmath
import numpy as np

import orbits
from orbits.diagnostics import Growth, growth
from orbits.diagnostics.nearest_gauss import NearestGauss
from orbits.diagnostics.stepping import Bodies, march
from orbits.point_masses import PointMasses
from orbits.regression import peers
from orbits.scenario import Check, Study, StudyResult, Table

STARTS, PERIODS, FIRST, PER_PERIOD, SAMPLES = 32, 5_000, 50, 30, 15
ECCENTRICITY = 0.2
GM = np.array([0.999, 0.001])
DT = float(np.float32(2.0 * np.pi / PER_PERIOD))  # 24 bits, so that k DT is exact
MARKS = np.unique(np.round(np.geomspace(FIRST, PERIODS, SAMPLES) * PER_PERIOD).astype(int))
EXACT, ROUNDED, PEER = "Gauss, exact coefficients", "Gauss, coefficients rounded to nearest", "REBOUND ias15"


def starts():
    """`STARTS` pairs (q, v), (2, 3) each: the same orbit, a = GM = 1, turned at random and begun anywhere on it."""
    rng = np.random.default_rng(20)
    e, root = ECCENTRICITY, np.sqrt(1.0 - ECCENTRICITY**2)
    for _ in range(STARTS):
        axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        E = rng.uniform(0.0, 2.0 * np.pi)
        r = axes @ [np.cos(E) - e, root * np.sin(E), 0.0]
        v = axes @ [-np.sin(E), root * np.cos(E), 0.0] / (1.0 - e * np.cos(E))
        yield np.outer([-GM[1], GM[0]], r), np.outer([-GM[1], GM[0]], v)


def mean_longitudes(q, v):
    """Mean longitude of the relative orbit at each sample (samples, 2, 3), in the plane of the first one."""
    r, w = q[:, 1] - q[:, 0], v[:, 1] - v[:, 0]
    mu = GM.sum()
    distance = np.linalg.norm(r, axis=1)
    a = 1.0 / (2.0 / distance - np.sum(w * w, axis=1) / mu)
    e_cos, e_sin = 1.0 - distance / a, np.sum(r * w, axis=1) / np.sqrt(mu * a)
    e, E = np.hypot(e_cos, e_sin), np.arctan2(e_sin, e_cos)
    f = np.arctan2(np.sqrt(1.0 - e * e) * np.sin(E), np.cos(E) - e)
    right = r[0] / distance[0]
    normal = np.cross(r[0], w[0])
    forward = np.cross(normal / np.linalg.norm(normal), right)
    return np.arctan2(r @ forward, r @ right) - f + E - e_sin


def mean_motion(q, v):
    """Kepler's third law for the floats of a start, an mpmath number."""
    r = [mpmath.mpf(float(b)) - mpmath.mpf(float(a)) for a, b in zip(*q, strict=True)]
    w = [mpmath.mpf(float(b)) - mpmath.mpf(float(a)) for a, b in zip(*v, strict=True)]
    mu = mpmath.fsum(map(mpmath.mpf, map(float, GM)))
    a = 1 / (2 / mpmath.sqrt(mpmath.fsum(x * x for x in r)) - mpmath.fsum(x * x for x in w) / mu)
    return mpmath.sqrt(mu / a**3)


def errors(q, v):
    """dE/E and the error of the mean longitude at `MARKS`, from states (1 + marks, 2, 3), the start first."""
    energy = orbits.diagnostics.energy(GM, q, v)
    moved = mean_longitudes(q, v)
    with mpmath.workdps(40):
        n, turn = mean_motion(q[0], v[0]), 2 * mpmath.pi
        expected = np.array([float(mpmath.fmod(n * mpmath.mpf(DT) * int(k), turn)) for k in MARKS])
    off = moved[1:] - moved[0] - expected
    return energy[1:] / energy[0] - 1.0, (off + np.pi) % (2.0 * np.pi) - np.pi


def by_ours(method):
    """A function of a start to the states at `MARKS`."""
    return lambda q, v: march(Bodies.of(GM, q, v), method, DT, MARKS)


def by_ias15(q, v):
    """The same by IAS15 at its default accuracy."""
    run = peers.run("ias15", PointMasses(GM, q, v), times=MARKS * DT, dt=DT)
    return run.q, run.v


def ensemble(states):
    """Errors of energy and phase of all starts, (STARTS, marks) each."""
    made = []
    for q, v in starts():
        moved_q, moved_v = states(q, v)
        made.append(errors(np.concatenate([q[None], moved_q]), np.concatenate([v[None], moved_v])))
    return tuple(np.array(each) for each in zip(*made, strict=True))


def experiment(say):
    """All starts by each method; the powers of time with which their errors grow."""
    runs = {
        EXACT: by_ours(orbits.Gauss(stages=8)),
        ROUNDED: by_ours(NearestGauss(stages=8)),
        PEER: by_ias15,
    }
    periods = MARKS / PER_PERIOD
    rows, found, curves = [], {}, {}
    for name, states in runs.items():
        say(f"{name}: {STARTS} orbits for {PERIODS:,} periods")
        curves[name] = ensemble(states)
        found[name] = [growth(periods, each) for each in curves[name]]
        for what, grown in zip(("energy", "phase"), found[name], strict=True):
            power = f"{grown.exponent:.2f} ± {grown.uncertainty:.2f}"
            rows.append([name, what, power, round(grown.bias, 1), float(grown.rms[-1])])
    columns = ["method", "error of", "grows with the power", "mean [its standard error]", "RMS at the end"]
    title = f"{STARTS} orbits with e = {ECCENTRICITY:g}: errors from {FIRST:,} to {PERIODS:,} periods"
    return StudyResult(
        tables=[Table(title, columns, rows)],
        checks=list(judged(found)),
        figures={"brouwer": lambda: draw(periods, curves, found)},
        record={"periods": periods, "rms": {name: [each.rms for each in found[name]] for name in found}},
    )


def judged(found: dict[str, list[Growth]]):
    """Yield what must hold: Brouwer's law for exact coefficients, a drift for rounded ones."""
    for what, law, drift, exact, rounded in zip(
        ("energy", "phase"), (0.5, 1.5), (1.0, 2.0), found[EXACT], found[ROUNDED], strict=True
    ):
        told = f"power {exact.exponent:.2f} ± {exact.uncertainty:.2f}"
        yield Check(f"{EXACT}: the {what} walks at random, power {law:g}", exact.consistent_with(law), told)
        yield Check(f"{EXACT}: the {what} does not drift", not exact.consistent_with(drift), told)
        told = f"power {rounded.exponent:.2f} ± {rounded.uncertainty:.2f}"
        yield Check(f"{ROUNDED}: the {what} drifts, power {drift:g}", abs(rounded.exponent - drift) < 0.1, told)
        # Of one sign for all starts: hundreds of standard errors; a random walk has one or two.
        yield Check(f"{ROUNDED}: all starts lean to one side", abs(rounded.bias) > 20, f"{rounded.bias:.0f} sigma")
        yield Check(f"{EXACT}: the {what} leans to no side", abs(exact.bias) < 3.5, f"{exact.bias:.1f} sigma")
        worse = rounded.rms[-1] / exact.rms[-1]
        yield Check(f"the last digit matters to the {what} after {PERIODS:,} periods", worse > 10, f"{worse:.0f} times")


def draw(periods, curves, found):
    """Errors of every start, thin, and their root mean square, thick, against time; lines of the laws beneath."""
    from orbits import plotting

    style = plotting.style
    figure = plotting.figure(16, 8.6)
    axes = figure.subplots(1, 2)
    colours = {EXACT: style.BLUE, ROUNDED: style.VERMILION, PEER: style.INK}
    for k, (axis, what, laws) in enumerate(
        zip(axes, ("energy, |ΔE/E|", "phase, mean longitude [rad]"), ((0.5, 1.0), (1.5, 2.0)), strict=True)
    ):
        for name, each in curves.items():
            axis.plot(
                periods, np.maximum(np.abs(each[k]), 2.0**-53).T, color=colours[name], lw=0.5, alpha=0.22, zorder=1
            )
            grown = found[name][k]
            label = f"{name}: power {grown.exponent:.2f} ± {grown.uncertainty:.2f}"
            axis.plot(
                periods,
                grown.rms,
                "os^"[list(curves).index(name)] + "-",
                color=colours[name],
                lw=2.6,
                ms=7,
                label=label,
                zorder=4,
            )
        for law, name, shift in zip(laws, (EXACT, ROUNDED), (0.28, 3.2), strict=True):
            line = shift * found[name][k].rms[-1] * (periods / periods[-1]) ** law
            axis.plot(periods, line, color=style.GREY, lw=1.6, ls=(0, (5, 3)), zorder=3)
            power = {0.5: "1/2", 1.5: "3/2", 1.0: "1", 2.0: "2"}[law]
            middle = len(periods) // 2
            place = {"xytext": (-8, 14 if shift > 1 else -30), "textcoords": "offset points"}
            text = axis.annotate(
                f"$t^{{{power}}}$", (periods[middle], line[middle]), fontsize=15, color=style.GREY, **place
            )
            plotting.halo(text)
        least = min(found[name][k].rms[0] for name in found)
        axis.set(xscale="log", yscale="log", xlabel="periods", title=what)
        axis.set_ylim(bottom=max(least / 30, 6e-17))
        axis.grid(axis="y", color=style.FAINT, lw=0.6)
        axis.legend(loc="upper left", fontsize=13)
        axis.set_ylim(top=axis.get_ylim()[1] * 30)
    title = f"Brouwer's law: {STARTS} orbits with e = {ECCENTRICITY:g}, thin, and their root mean square"
    told = "dashed: the laws, powers of time t; thin lines below 2⁻⁵³ are drawn there"
    plotting.below(figure, [], [], told)
    figure.suptitle(title, fontsize=20, fontweight="bold")
    return figure


scenario = Study(
    name="brouwer",
    title="Brouwer's law: round-off as a random walk, and what a last digit of the coefficients does to it",
    experiment=experiment,
    certifies=[
        (
            orbits.System.from_states(["star", "planet"], GM, *next(starts()), units=orbits.DIMENSIONLESS),
            orbits.Gauss(stages=8),
            DT,
        )
    ],
)

if __name__ == "__main__":
    scenario.main()
