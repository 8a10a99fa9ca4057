"""Error bars against the errors themselves, for random systems of eight kinds, in units with G = 1."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import orbits
from orbits.elements import state_from_elements
from orbits.errors import ConvergenceError
from orbits.time_grid import fastest_passage_of

Array = NDArray[np.float64]

TURN = 2.0 * np.pi

SEED, EACH, SAMPLES = 20261123, 14, 5
"""Of the random numbers; systems of each kind; samples of a run."""

TOO_LARGE = 30.0
"""The multiple of the error above which a bar says little."""


CHOSEN, CONSTANT = "chosen", "constant"

Truth = Callable[["Drawn", Array], tuple[Array, Array]]
"""The positions of a system at times, (samples, bodies, 3), and their low parts."""


class Drawn(NamedTuple):
    """A system, gm (n,), q and v (n, 3), and how long it is followed."""

    gm: Array
    q: Array
    v: Array
    span: float

    @property
    def system(self) -> orbits.System:
        """As bodies A, B, C, ..."""
        return orbits.System(list("ABCDEFGHIJ"[: len(self.gm)]), *self[:3], units=orbits.DIMENSIONLESS)


def chain(rng: Any, turns: tuple[float, float], gm: Any, *orbits_of: tuple[float, float, float]) -> Drawn:
    """Return bodies each of which moves about the centre of mass of those before it, with random angles.

    turns : powers of 10 between which the time in turns of an orbit of a = 1 about GM = 1 is drawn
    gm : (n,); orbits_of : a, e and the inclination of all but the first
    """
    gm, q, v = np.array(gm, dtype=np.float64), np.zeros((1, 3)), np.zeros((1, 3))
    for k, (a, e, inclination) in enumerate(orbits_of, 1):
        angles = {name: rng.uniform(0.0, TURN) for name in ("Omega", "omega", "M")}
        x, w = state_from_elements(gm[: k + 1].sum(), a=a, e=e, inc=inclination, **angles)
        share = gm[:k] / gm[:k].sum()
        q, v = np.vstack([q, share @ q + x]), np.vstack([v, share @ v + w])
    return centred(gm, q, v, TURN * 10.0 ** rng.uniform(*turns))


def centred(gm: Array, q: Array, v: Array, span: float) -> Drawn:
    """Return bodies about their centre of mass."""
    share = gm / gm.sum()
    return Drawn(gm, q - share @ q, v - share @ v, span)


def planets(rng: Any) -> Drawn:
    """A star and two or three planets, in every third case also a massless particle inside."""
    gm = [1.0, *10.0 ** rng.uniform(-7.0, -3.5, rng.integers(2, 4))]
    sizes = np.cumprod([1.0, *rng.uniform(1.6, 2.3, len(gm) - 2)]).tolist()
    ways = [(a, rng.uniform(0.0, 0.15), rng.uniform(0.0, 0.1)) for a in sizes]
    if rng.uniform() < 1.0 / 3.0:
        gm[1:1], ways[:0] = [0.0], [(rng.uniform(0.4, 0.6), rng.uniform(0.0, 0.3), rng.uniform(0.0, 0.3))]
    return chain(rng, (0.7, 2.3), gm, *ways)


def triple(rng: Any) -> Drawn:
    """Three bodies of comparable masses, one of them far away."""
    far, e = rng.uniform(5.0, 12.0), rng.uniform(0.0, 0.6)
    inner = 1.0, rng.uniform(0.0, 0.6), rng.uniform(0.0, np.pi)
    return chain(rng, (0.7, 2.3), rng.uniform(0.2, 1.0, 3), inner, (far / (1.0 - e), e, 0.5))


def planet_of_binary(rng: Any) -> Drawn:
    """Two stars with a planet about both, or about one of them."""
    light, e, tilt = 10.0 ** rng.uniform(-7.0, -3.0), rng.uniform(0.0, 0.5), rng.uniform(0.0, 0.5)
    inner, small = (1.0, e, tilt), rng.uniform(0.0, 0.2)
    if rng.uniform() < 0.5:
        return chain(rng, (0.7, 2.3), [1.0, rng.uniform(0.2, 1.0), light], inner, (rng.uniform(5.0, 9.0), small, 0.1))
    far = rng.uniform(6.0, 12.0) / (1.0 - e), e, tilt
    return chain(rng, (0.7, 2.3), [1.0, light, rng.uniform(0.2, 1.0)], (1.0, small, 0.1), far)


def moons(rng: Any) -> Drawn:
    """A planet with one or two moons, and their star."""
    gm = [1.0, *10.0 ** rng.uniform(-8.0, -2.0, rng.integers(1, 3)), 10.0 ** rng.uniform(3.0, 5.5)]
    sizes = [1.0, 1.8][: len(gm) - 2]
    away = rng.uniform(5.0, 20.0) * sizes[-1] * (gm[-1] / 3.0) ** (1.0 / 3.0)
    ways = [(a, rng.uniform(0.0, 0.1), rng.uniform(0.0, 0.2)) for a in sizes]
    return chain(rng, (0.7, 2.3), gm, *ways, (away, rng.uniform(0.0, 0.1), 0.0))


def light_third(rng: Any) -> Drawn:
    """A binary with a third body of almost no mass outside it, or inside."""
    light, e = 10.0 ** rng.uniform(-13.0, -11.0), rng.uniform(0.0, 0.5)
    inner, heavy = (1.0, e, rng.uniform(0.0, 0.5)), rng.uniform(0.2, 1.0)
    if rng.uniform() < 2.0 / 3.0:
        return chain(rng, (0.7, 2.4), [1.0, heavy, light], inner, (rng.uniform(4.0, 9.0), rng.uniform(0.0, 0.3), 0.3))
    return chain(rng, (0.7, 2.4), [1.0, light, heavy], (1.0, 0.1, 0.3), (rng.uniform(6.0, 9.0), 0.2 * e, 0.2))


def eccentric(rng: Any) -> Drawn:
    """Two bodies with e from 0.5 to 0.99."""
    e = 1.0 - 10.0 ** rng.uniform(-2.0, -0.3)
    return chain(rng, (0.5, 1.7), [1.0, rng.uniform(0.05, 1.0)], (1.0, e, rng.uniform(0.0, np.pi)))


def encounter(rng: Any) -> Drawn:
    """A planet and a small body that passes within its Hill radius, marched back to before the encounter."""
    m, small = 10.0 ** rng.uniform(-5.0, -3.0), 10.0 ** rng.uniform(-12.0, -9.0)
    pair = chain(rng, (0.0, 0.0), [1.0, m], (1.0, rng.uniform(0.0, 0.1), 0.0))
    apart, faster = rng.normal(size=(2, 3))
    apart *= (m / 3.0) ** (1.0 / 3.0) * 10.0 ** rng.uniform(-1.5, 0.0) / np.linalg.norm(apart)
    escape = np.sqrt(2.0 * m / np.linalg.norm(apart))
    faster *= rng.uniform(1.1, 4.0) * escape / np.linalg.norm(faster)
    q, v = np.vstack([pair.q, pair.q[1] + apart]), np.vstack([pair.v, pair.v[1] + faster])
    met, span = centred(np.append(pair.gm, small), q, v, 0.0), rng.uniform(0.5, 4.0)
    before = orbits.propagate(met.system, duration=-span, samples=[-span])
    return Drawn(met.gm, before.q.value[0], before.v.value[0], rng.uniform(1.2, 10.0) * span)


def chaos(rng: Any) -> Drawn:
    """Three or four bodies of comparable masses anywhere."""
    gm = rng.uniform(0.3, 1.0, rng.integers(3, 5))
    q, v = rng.normal(size=(2, len(gm), 3))
    return centred(gm / gm.sum(), q, 0.3 * v, 10.0 ** rng.uniform(0.7, 1.6))


KINDS: dict[str, Callable[[Any], Drawn]] = {
    "planets": planets,
    "hierarchical triples": triple,
    "binaries with a planet": planet_of_binary,
    "moons": moons,
    "light thirds": light_third,
    "binaries, e to 0.99": eccentric,
    "encounters": encounter,
    "chaotic": chaos,
}


def ways(rng: Any, case: Drawn) -> Iterator[tuple[str, Any, Any]]:
    """Yield the two ways to integrate a system, without dt and with a constant one: a word, method and dt."""
    pick, (*_, distance, speed, _, _) = rng.integers(6), fastest_passage_of(case.system, case.span)
    passage = TURN * distance / speed
    yield CHOSEN, orbits.Gauss(), None if pick < 4 else orbits.Adaptive(10.0 ** rng.uniform(-8.0, -5.0))
    if pick < 3:
        yield CONSTANT, orbits.Gauss(), passage / rng.uniform(12.0, 40.0)
    elif pick == 3:
        yield CONSTANT, orbits.Gauss(stages=int(rng.integers(2, 6))), passage / rng.uniform(15.0, 60.0)
    elif pick == 4:
        yield CONSTANT, orbits.StormerVerlet(), passage / rng.uniform(50.0, 1000.0)
    else:
        yield CONSTANT, orbits.methods.Composition(order=int(rng.choice([4, 6, 8]))), passage / rng.uniform(15.0, 60.0)


class Quadruple:
    """Taylor series of heyoka in 128-bit floats, of 34 digits, for any number of bodies."""

    def __init__(self) -> None:
        self.made: dict[int, Any] = {}

    def __call__(self, case: Drawn, times: Array) -> tuple[Array, Array]:
        """Return the positions, (samples, bodies, 3), and their low parts."""
        import heyoka

        number, n = heyoka.real128, len(case.gm)
        if n not in self.made:
            model = heyoka.model.nbody(n, masses=[heyoka.par[i] for i in range(n)], Gconst=1.0)
            options = {"fp_type": number, "compact_mode": True, "pars": [number(1.0)] * n}
            self.made[n] = heyoka.taylor_adaptive(model, [number(0.0)] * (6 * n), **options)
        taylor, states = self.made[n], np.empty((2, len(times), n, 6))
        taylor.pars[:] = [number(float(x)) for x in case.gm]
        taylor.state[:] = [number(float(x)) for x in np.hstack([case.q, case.v]).ravel()]
        taylor.time = number(0.0)
        for k, t in enumerate(times):
            taylor.propagate_until(number(float(t)))
            high = [float(x) for x in taylor.state]
            low = [float(x - number(y)) for x, y in zip(taylor.state, high, strict=True)]
            states[:, k] = np.reshape([high, low], (2, n, 6))
        return states[0, ..., :3], states[1, ..., :3]


class Judged(NamedTuple):
    """The bars of a run, (samples x bodies,): whether they contain the error, and whether they are too large."""

    kind: str
    way: str
    contain: NDArray[np.bool_]
    too_large: NDArray[np.bool_]


def judged(truth: Truth, each: int = EACH) -> Iterator[Judged]:
    """Yield the bars of `each` systems of each kind, in both ways."""
    for number, (kind, draw) in enumerate(KINDS.items()):
        for k in range(each):
            rng = np.random.default_rng([SEED, number, k])
            case = draw(rng)
            times = np.linspace(0.0, case.span, SAMPLES + 1)[1:]
            high, low = truth(case, times)
            for way, method, dt in ways(rng, case):
                options = {"dt": dt, "duration": case.span, "samples": times, "check_step": False}
                try:
                    run = orbits.propagate(case.system, method, **options)
                except ConvergenceError:  # a constant step that is far too long for an encounter
                    continue
                bar, q = run.error_estimate().position.value, run.q.value
                error = np.linalg.norm((q - high) - low, axis=-1)
                # Errors below this are those of the float64 samples themselves.
                least = np.linalg.norm(np.spacing(np.abs(q)), axis=-1) / 4.0
                too_large = bar > TOO_LARGE * np.maximum(error, least)
                yield Judged(kind, way, (error <= bar).ravel(), too_large.ravel())


def table(found: list[Judged]) -> list[dict[str, Any]]:
    """Return a row for each kind, and one for all."""
    rows = []
    for kind in (*KINDS, "all"):
        row: dict[str, Any] = {"systems": kind}
        for way in (CHOSEN, CONSTANT):
            mine = [one for one in found if one.way == way and kind in (one.kind, "all")]
            contain, too_large = (np.concatenate([one[k] for one in mine]) for k in (2, 3))
            row[f"bars, {way} steps"] = len(contain)
            row[f"contain the error %, {way}"] = 100.0 * float(contain.mean())
            row[f"above {TOO_LARGE:g} errors %, {way}"] = 100.0 * float(too_large.mean())
        rows.append(row)
    return rows


def part_error_bars(repetitions: int) -> dict[str, Any]:
    """How error bars of positions compare with the errors. Random systems of eight kinds are followed for up to 250
    turns, in steps from resolved to far too long: without dt (a third of them with a tolerance of 1e-8 to 1e-5), and
    with a constant one (half of them by Gauss with 8 stages, the others by Gauss with 2 to 5 stages, Störmer–Verlet and
    compositions). The table has the number of bars, the share that contains the error, and the share that is more than
    thirty times as large as the error. The errors are known from Taylor series in 128-bit floats (34 digits). `python
    scripts/benchmark.py error_bars` runs this part; `make bench` does not.
    """
    return {"rows": table(list(judged(Quadruple())))}
