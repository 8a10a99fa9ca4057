"""Brouwer's law: unbiased round-off over 32 orbits, each integrated for 5,000 periods.

With unbiased rounding the energy performs a random walk: its error grows as the square root of time, and the phase
error with the power 3/2. REBOUND's IAS15 shows it. Gauss with coefficients that are exactly symplectic in binary ends
each step in doubled precision: its energy walks a hundred times closer, and what is left of its phase is a frequency
wrong by 1e-16, from the last bit of the coefficients. With these rounded to nearest, which are wrong in the seventeenth
digit, the energy drifts in one direction, and the phase error grows as the square of time.

The problem is Kepler's, with e = 0.2, 30 steps per period, and a different orientation and anomaly for each orbit.
Phases are mean longitudes, compared with Kepler's third law for exactly the floats of each initial state. Both are
measured in forty digits, from states with all the digits that a run has.

Sources: Brouwer (1937); Hairer, McLachlan & Razakarivony (2008); Rein & Spiegel (2015) for IAS15.
"""

import mpmath
import numpy as np

import orbits
from orbits.diagnostics import Growth, growth
from orbits.diagnostics.doubledouble import Pair
from orbits.diagnostics.growth import energy_errors, numbers
from orbits.diagnostics.nearest_gauss import NearestGauss
from orbits.diagnostics.stepping import Bodies, march_finely
from orbits.point_masses import PointMasses
from orbits.regression import peers
from orbits.scenario import Check, Study, StudyResult, Table

STARTS, PERIODS, FIRST, PER_PERIOD, SAMPLES = 32, 5_000, 50, 30, 15
ECCENTRICITY = 0.2
GM = np.array([0.999, 0.001])
DT = float(np.float32(2.0 * np.pi / PER_PERIOD))  # 24 bits, so that k DT is exact
MARKS = np.unique(np.round(np.geomspace(FIRST, PERIODS, SAMPLES) * PER_PERIOD).astype(int))
LEAST = 1e-19
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
    """Mean longitudes of the relative orbit at all samples, in the plane of the first one, mpmath numbers."""
    frame, found = None, []
    for r, w in (relative(q, v, k) for k in range(len(q.hi))):
        mu, distance = mass(), mpmath.sqrt(mpmath.fdot(r, r))
        a = 1 / (2 / distance - mpmath.fdot(w, w) / mu)
        e_cos, e_sin = 1 - distance / a, mpmath.fdot(r, w) / mpmath.sqrt(mu * a)
        e, E = mpmath.hypot(e_cos, e_sin), mpmath.atan2(e_sin, e_cos)
        f = mpmath.atan2(mpmath.sqrt(1 - e * e) * mpmath.sin(E), mpmath.cos(E) - e)
        frame = frame or axes(r, w)
        forward, right = mpmath.fdot(r, frame[1]), mpmath.fdot(r, frame[0])
        found.append(mpmath.atan2(forward, right) - f + E - e_sin)
    return found


def relative(q, v, k):
    """The relative position and velocity at sample k, mpmath numbers."""
    return ([b - a for a, b in zip(*numbers(x, k), strict=True)] for x in (q, v))


def axes(r, w):
    """The direction of r, and the one across it in the plane of the orbit."""
    right = [x / mpmath.sqrt(mpmath.fdot(r, r)) for x in r]
    normal = [r[i - 2] * w[i - 1] - r[i - 1] * w[i - 2] for i in range(3)]
    normal = [x / mpmath.sqrt(mpmath.fdot(normal, normal)) for x in normal]
    return right, [normal[i - 2] * right[i - 1] - normal[i - 1] * right[i - 2] for i in range(3)]


def mass():
    """The total GM of exactly the floats."""
    return mpmath.fsum(map(mpmath.mpf, map(float, GM)))


def mean_motion(q, v):
    """Kepler's third law for the numbers of a start."""
    r, w = relative(q, v, 0)
    a = 1 / (2 / mpmath.sqrt(mpmath.fdot(r, r)) - mpmath.fdot(w, w) / mass())
    return mpmath.sqrt(mass() / a**3)


def errors(q, v):
    """dE/E and the error of the mean longitude at `MARKS`, from pairs of numbers (1 + marks, 2, 3), the start first.

    In forty digits: the rounding of the states alone would hide the first thousand periods.
    """
    with mpmath.workdps(40):
        n, turn, moved = mean_motion(q, v), 2 * mpmath.pi, mean_longitudes(q, v)
        off = [x - moved[0] - n * mpmath.mpf(DT) * int(k) for x, k in zip(moved[1:], MARKS, strict=True)]
        phases = [float(x - turn * mpmath.nint(x / turn)) for x in off]
    return energy_errors(GM, q, v), np.array(phases)


def by_ours(method):
    """A function of a start to the states there and at `MARKS`, with all their digits."""
    return lambda q, v: march_finely(Bodies.of(GM, q, v), method, DT, MARKS)


def by_ias15(q, v):
    """The same by IAS15 at its default accuracy."""
    run = peers.run("ias15", PointMasses(GM, q, v), times=MARKS * DT, dt=DT)
    return tuple(Pair(x, np.zeros_like(x)) for x in (np.stack([q, *run.q]), np.stack([v, *run.v])))


def ensemble(states):
    """Errors of energy and phase of all starts, (STARTS, marks) each."""
    made = []
    for q, v in starts():
        made.append(errors(*states(q, v)))
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
            rows.append([name, what, power_of(grown), round(grown.bias, 1), float(grown.rms[-1])])
    columns = ["method", "error of", "grows with the power", "mean [its standard error]", "RMS at the end"]
    title = f"{STARTS} orbits with e = {ECCENTRICITY:g}: errors from {FIRST:,} to {PERIODS:,} periods"
    return StudyResult(
        tables=[Table(title, columns, rows)],
        checks=list(judged(found)),
        figures={"brouwer": lambda: draw(periods, curves, found)},
        record={"periods": periods, "rms": {name: [each.rms for each in found[name]] for name in found}},
    )


def power_of(grown: Growth) -> str:
    """Return the power of time with which errors grow, and its uncertainty."""
    return f"{grown.exponent:.2f} ± {grown.uncertainty:.2f}"


def judged(found: dict[str, list[Growth]]):
    """Yield what must hold: no more than a random walk for exact coefficients, which round so little that less than a
    walk may be left; a random walk for IAS15; a drift for rounded ones.
    """
    for what, law, grown in zip(("energy", "phase"), (0.5, 1.5), found[EXACT], strict=True):
        slower = grown.exponent < law + 3.0 * grown.uncertainty
        claim = f"{EXACT}: the {what} errs no faster than by a random walk, power {law:g}"
        yield Check(claim, slower, f"power {power_of(grown)}")
    energy = found[EXACT][0]
    yield Check(f"{EXACT}: the energy does not drift", not energy.consistent_with(1.0), f"power {power_of(energy)}")
    laws = zip(("energy", "phase"), (0.5, 1.5), (1.0, 2.0), found[EXACT], found[ROUNDED], found[PEER], strict=True)
    for what, law, drift, exact, rounded, peer in laws:
        walks, drifts = peer.consistent_with(law), abs(rounded.exponent - drift) < 0.1
        yield Check(f"{PEER}: the {what} walks at random, power {law:g}", walks, f"power {power_of(peer)}")
        yield Check(f"{ROUNDED}: the {what} drifts, power {drift:g}", drifts, f"power {power_of(rounded)}")
        # Of one sign for all starts: hundreds of standard errors; a random walk has one or two.
        yield Check(f"{ROUNDED}: all starts lean to one side", abs(rounded.bias) > 20, f"{rounded.bias:.0f} sigma")
        worse = rounded.rms[-1] / exact.rms[-1]
        yield Check(f"the last digit matters to the {what} after {PERIODS:,} periods", worse > 10, f"{worse:.0f} times")
        worse = peer.rms[-1] / exact.rms[-1]
        yield Check(f"{EXACT}: the {what} errs less than with {PEER}", worse > 10, f"{worse:.0f} times")


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
                periods, np.maximum(np.abs(each[k]), LEAST).T, color=colours[name], lw=0.5, alpha=0.22, zorder=1
            )
            grown = found[name][k]
            label = f"{name}: power {power_of(grown)}"
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
        for law, name, shift in zip(laws, (PEER, ROUNDED), (0.28, 3.2), strict=True):
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
        axis.set_ylim(bottom=max(least / 30, LEAST))
        axis.grid(axis="y", color=style.FAINT, lw=0.6)
        axis.legend(loc="upper left", fontsize=13)
        axis.set_ylim(top=axis.get_ylim()[1] * 30)
    title = f"Brouwer's law: {STARTS} orbits with e = {ECCENTRICITY:g}, thin, and their root mean square"
    told = "dashed: the laws, powers of time t; thin lines below 1e-19 are drawn there"
    plotting.below(figure, [], [], told)
    figure.suptitle(title, fontsize=20, fontweight="bold")
    return figure


scenario = Study(
    name="brouwer",
    title="Brouwer's law: round-off as a random walk, and what a last digit of the coefficients does to it",
    experiment=experiment,
    certifies=[
        (
            orbits.System(["star", "planet"], GM, *next(starts()), units=orbits.DIMENSIONLESS),
            orbits.Gauss(stages=8),
            DT,
        )
    ],
)

if __name__ == "__main__":
    scenario.main()
