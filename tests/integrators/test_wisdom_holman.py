"""Wisdom–Holman maps: against a plain path in many digits, quadruple precision, and what they promise and refuse."""

import warnings
from fractions import Fraction
from math import factorial

import astropy.units as u
import mpmath
import numpy as np
import pytest

import orbits
from orbits import diagnostics, discrete
from orbits.errors import InputError, StepWarning
from orbits.integrators.maps.jacobi_form import outwards
from orbits.lagrangians.newtonian import n_body, newtonian, parameters
from orbits.marching.legs.leg import Leg
from orbits.tableaux.correctors import PAIRS, corrector, corrector_lengths

from ..contracts.problems import march
from ..coverings import at, cover
from ..problems import three_bodies

DEFAULT, PLAIN = orbits.WisdomHolman(), orbits.WisdomHolman(kernel="standard", corrector=0)
LAZY, CORRECTED = orbits.WisdomHolman(kernel="lazy"), orbits.WisdomHolman(kernel="standard")
KM = 149597870.7


def planets(factor=0.01):
    """Three bodies, the lighter ones with planetary masses."""
    gm, q, v = three_bodies()
    return gm * [1.0, factor, factor], q, v


class Jacobi:
    """The map in mpmath: Jacobi coordinates from their definition, forces in inertial coordinates, Kepler's equation
    by Newton's method, derivatives by differences.
    """

    def __init__(self, method, gm, q, v, h):
        self.gm, self.h, self.method = [mpmath.mpf(float(x)) for x in gm], mpmath.mpf(h), method
        self.inside = [mpmath.fsum(self.gm[: i + 1]) for i in range(len(gm))]
        self.r, self.w = (self._jacobi([mpmath.matrix(list(map(float, row))) for row in x]) for x in (q, v))

    def _jacobi(self, x):
        """R_(n-1), then r'_1, r'_2, ..."""
        centre, out = x[0], []
        for i in range(1, len(x)):
            out.append(x[i] - centre)
            centre = centre + out[-1] * (self.gm[i] / self.inside[i])
        return [centre, *out]

    def _inertial(self, x):
        centre, out = x[0], []
        for i in range(len(x) - 1, 0, -1):
            centre = centre - x[i] * (self.gm[i] / self.inside[i])
            out.insert(0, centre + x[i])
        return [centre, *out]

    def interaction(self, r):
        q, n = self._inertial(r), len(r)
        pulls = [mpmath.matrix(3, 1) for _ in q]
        for i in range(n):
            for j in range(n):
                if i != j:
                    pulls[i] += self.gm[j] * (q[j] - q[i]) / mpmath.norm(q[j] - q[i]) ** 3
        a = self._jacobi(pulls)
        return [a[0] * 0, *(a[i] + self.inside[i] * r[i] / mpmath.norm(r[i]) ** 3 for i in range(1, n))]

    def kick(self, h, modified=False):
        g = self.interaction(self.r)
        if modified:
            along = mpmath.mpf(10) ** -15
            ahead, behind = (
                self.interaction([x + s * along * y for x, y in zip(self.r, g, strict=True)]) for s in (1, -1)
            )
            tide = [(x - y) / (2 * along) for x, y in zip(ahead, behind, strict=True)]
            g = [x + self.h**2 / 12 * y for x, y in zip(g, tide, strict=True)]
        self.w = [x + h * y for x, y in zip(self.w, g, strict=True)]

    def drift(self, h):
        self.r[0] = self.r[0] + h * self.w[0]
        for i in range(1, len(self.r)):
            self.r[i], self.w[i] = kepler(self.r[i], self.w[i], self.inside[i], h)

    def correct(self, sign):
        stages = [] if not self.method.corrector else corrector_lengths(self.method.corrector).tolist()
        if sign < 0:
            kicks = [0.0, *(-k for _, k in reversed(stages[:-1]))]
            stages = [(-d, k) for (d, _), k in zip(reversed(stages), [*kicks[1:], 0.0], strict=True)] if stages else []
        for d, k in stages:
            self.drift(self.h * d)
            self.kick(self.h * k)

    def march(self, steps):
        self.correct(1)
        for _ in range(steps):
            self.kick(self.h / 2, self.method.kernel == "modified-kick")
            self.drift(self.h)
            self.kick(self.h / 2, self.method.kernel == "modified-kick")
        self.correct(-1)
        return tuple(np.array([list(map(float, x)) for x in self._inertial(y)]) for y in (self.r, self.w))


def kepler(q, v, mu, h):
    r0, eta = mpmath.norm(q), mpmath.fsum(a * b for a, b in zip(q, v, strict=True))
    beta = 2 * mu / r0 - mpmath.norm(v) ** 2

    def functions(s):
        x = mpmath.sqrt(beta)
        sine = mpmath.sin(x * s) / x
        return sine.real, ((1 - mpmath.cos(x * s)) / beta).real, ((s - sine) / beta).real

    def time(s):
        g1, g2, g3 = functions(s)
        return r0 * g1 + eta * g2 + mu * g3 - h

    s = mpmath.findroot(time, h / r0)
    g1, g2, g3 = functions(s)
    r = r0 + eta * g1 + (mu - beta * r0) * g2
    f, g = 1 - mu * g2 / r0, h - mu * g3
    return f * q + g * v, -mu * g1 / (r0 * r) * q + (1 - mu * g2 / r) * v


@pytest.mark.parametrize("method", at((0, 2), [PLAIN, CORRECTED, DEFAULT]), ids=lambda method: method.label)
def test_three_steps_equal_the_plain_path_in_forty_digits(method):
    gm, q, v = three_bodies()
    got = march(method, gm, q, v, 0.125, 3)
    with mpmath.workdps(40):
        truth = Jacobi(method, gm, q, v, 0.125).march(3)
    for x, y in zip(got, truth, strict=True):
        # 2.2e-16 was reached by the plain map on numbers of 1.5; a corrector is 126 Kepler motions of up to 5 steps.
        assert np.abs(x - y).max() < (6e-16 if method == PLAIN else 2e-14)


@cover(("method", "count"), [PLAIN, orbits.WisdomHolman(corrector=3)], [9, 12, 16], strength=1)
def test_planets_in_two_registers_in_any_order_equal_the_plain_path_in_forty_digits(method, count):
    rng = np.random.default_rng(count)
    a, angle = 1.15 ** np.arange(count), rng.uniform(0, 2 * np.pi, count)
    q, v = np.zeros((2, count + 1, 3))
    q[1:] = (a * np.array([np.cos(angle), np.sin(angle), 0.03 * np.sin(2 * angle)])).T
    v[1:] = (np.array([-np.sin(angle), np.cos(angle), 0.02 + 0.0 * angle]) / np.sqrt(a)).T
    gm = np.array([1.0, *rng.uniform(1e-5, 1e-4, count)])
    order = rng.permutation(count + 1)
    got = march(method, gm[order], q[order], v[order], 0.125, 2)
    with mpmath.workdps(40):
        truth = Jacobi(method, gm, q, v, 0.125).march(2)
    for x, y in zip(got, truth, strict=True):
        # A unit in the last place of the outermost places is 9e-16.
        assert np.abs(x - y[order]).max() < 1e-15


@pytest.mark.parametrize("order", [order for order in PAIRS if order])
def test_correctors_fulfil_their_conditions_exactly(order):
    """The series of sum 2 b sinh(a x) agrees with that of ((x/2) coth(x/2) - 1)/x as far as there are pairs."""
    bernoulli = [Fraction(1, 6), Fraction(-1, 30), Fraction(1, 42), Fraction(-1, 30), Fraction(5, 66)]
    bernoulli += [Fraction(-691, 2730), Fraction(7, 6), Fraction(-3617, 510)]
    for j in range(PAIRS[order]):
        found = sum(2 * b * a ** (2 * j + 1) for a, b in corrector(order)) / factorial(2 * j + 1)
        assert found == bernoulli[j] / factorial(2 * j + 2)
    assert abs(corrector_lengths(order).sum(axis=0)).max() < 1e-14  # it ends where it begins


@pytest.mark.parametrize(("method", "order"), [(PLAIN, 2), (CORRECTED, 2), (DEFAULT, 4), (LAZY, 4)], ids=str)
def test_the_order_is_the_declared_one(method, order):
    gm, q, v = planets()
    truth, _ = march(orbits.Gauss(stages=8), gm, q, v, 6.0 / 2000, 2000)
    errors = [np.abs(march(method, gm, q, v, 6.0 / n, n)[0] - truth).max() for n in (48, 96)]
    assert method.order == order
    assert abs(np.log2(errors[0] / errors[1]) - order) < 0.15 * order
    assert errors[0] < {PLAIN: 4e-7, CORRECTED: 6e-10}.get(method, 2e-12)


def test_a_thousand_years_of_ten_bodies_are_as_accurate_as_by_collocation():
    """Against quadruple precision, in steps of 3 d. RMS over eight rotated starts: Mercury 0.013 km, Venus 0.003,
    Earth 0.002, all others 0.001 and less.
    """
    import json

    from orbits.resources import data_path

    data = json.loads(data_path("solar_system_10body.json").read_text())
    gm, q, v = (np.array(data[key]) for key in ("gm_au3_d2", "q", "v"))
    run = Leg.of(newtonian, DEFAULT, parameters(gm), gm > 0, q, v, 3.0)
    run.advance(1000 * 1461 // 12)
    truth = np.array(data["reference_years"]["1000"], dtype=float)[:, :3]
    off = KM * np.linalg.norm(run.state()[0] - truth, axis=1)
    assert off[1] < 0.05  # a random walk of round-off
    assert off[2:].max() < 0.01


@pytest.mark.slow
def test_the_energy_does_not_drift_in_a_million_steps():
    system = orbits.System.solar_system()
    run = orbits.propagate(system, DEFAULT, dt="3 d", duration=3e6 * u.day, samples=5, progress=False)
    energy = run.energy().value
    assert np.abs(energy / energy[0] - 1.0).max() < 3e-15  # 4e-16 was reached


def test_samples_do_not_change_a_bit_of_the_run_and_are_as_accurate_off_the_grid(tmp_path):
    system, years = orbits.System.solar_system(), 8 * u.yr
    few = orbits.propagate(system, DEFAULT, dt="3 d", duration=years, samples=2, progress=False)
    many = orbits.propagate(system, DEFAULT, dt="3 d", duration=years, samples=38, progress=False)
    assert np.array_equal(few.q[-1], many.q[-1])
    assert np.array_equal(few.v[-1], many.v[-1])
    assert np.array_equal(few.q[0], system.q)
    truth = orbits.propagate(system, "gauss", dt="3 d", duration=years, samples=38, progress=False)
    off = np.linalg.norm((many.q - truth.q).to_value(u.km), axis=2)
    assert off.max() < 5e-4  # 1.5e-4 was reached, by Mercury
    part = orbits.propagate(
        system, DEFAULT, dt="3 d", duration=3 * u.yr, samples=4, archive=tmp_path / "run.h5", progress=False
    )
    whole = orbits.resume(part.path, until=years, progress=False)
    assert np.array_equal(whole.q[-1], few.q[-1])
    back = orbits.propagate(many[-1], DEFAULT, dt="3 d", duration=-years, samples=2, progress=False)
    assert np.linalg.norm((back.q[-1] - system.q).to_value(u.km), axis=1).max() < 2e-3


def test_bits_do_not_depend_on_blocks_or_on_the_order_of_the_bodies():
    gm, q, v = planets()
    straight = Leg.of(newtonian, DEFAULT, parameters(gm), gm > 0, q, v, 0.1)
    straight.advance(50)
    pieces = Leg.of(newtonian, DEFAULT, parameters(gm), gm > 0, q, v, 0.1)
    pieces.block = 7
    pieces.advance(20)
    pieces.state_after(0.03)
    saved = pieces.checkpoint()
    pieces = Leg.of(newtonian, DEFAULT, parameters(gm), gm > 0, q, v, 0.1)
    pieces.restore(saved)
    pieces.advance(30)
    order = [2, 0, 1]
    turned = Leg.of(newtonian, DEFAULT, parameters(gm[order]), gm > 0, q[order], v[order], 0.1)
    turned.advance(50)
    for a, b, c in zip(straight.state(), pieces.state(), turned.state(), strict=True):
        assert np.array_equal(a, b)
        assert np.array_equal(a[order], c)


def test_it_is_symplectic_but_for_the_lazy_kick_and_nearly_symmetric_with_a_corrector():
    gm, q, v = planets(6.0)  # planets of 6 % of the star: what is of the third order in their masses shows
    found = {method: diagnostics.symplecticity(gm, q, v, method, 0.6).massive for method in (DEFAULT, LAZY, PLAIN)}
    assert found[DEFAULT] < 1e-11  # round-off of the corrector: 2.6e-12 was reached
    assert found[LAZY] > 1e-10  # 9e-10
    assert found[PLAIN] < 1e-12  # 8e-14
    gm, q, v = three_bodies()
    for method, least, most in ((DEFAULT, 0.0, 3e-15), (LAZY, 1e-12, 1e-10)):
        x, w = march(method, gm, q, v, 0.15, 400)
        change = (gm[:, None] * (np.cross(x, w) - np.cross(q, v))).sum(axis=0)
        assert least <= np.abs(change).max() / (gm[:, None] * np.abs(np.cross(q, v))).sum() < most  # 3.5e-16, 9e-12
    # 242 ulps at most were reached, in a thousand steps in which the motion amplifies the roundings.
    for method in (DEFAULT, PLAIN):
        assert diagnostics.reversibility(*three_bodies(), method, 0.05, 1000).ulps < 1000


def test_the_plain_map_is_that_of_its_discrete_lagrangian():
    """Exact Kepler arcs by Lambert's theorem: its Euler–Lagrange equations and momenta, to round-off."""
    gm, q, v = three_bodies()
    order = [2, 0, 1]
    gm, q, v = gm[order], q[order], v[order]
    known = outwards(gm, q, v)
    assert known == [1, 2, 0]
    L_d = discrete.kepler_splitting(n_body(gm), known)
    missed = {}
    for method in (PLAIN, CORRECTED):
        states = [march(method, gm, q, v, 0.1, steps) for steps in range(1, 16)]
        path, p = np.array([x for x, _ in states]), gm[:, None] * np.array([w for _, w in states])
        residuals = discrete.euler_lagrange_residual(L_d, path, 0.1), discrete.momentum_residual(L_d, path, p, 0.1)
        missed[method] = max(np.abs(r).max() for r in residuals)
    assert missed[PLAIN] < 3e-16  # 5e-17 was reached, of momenta of 1e-2
    assert missed[CORRECTED] > 1e-9
    q0, q1 = (x.ravel() for x in path[:2])
    jet, along, tiny = L_d.jet(q0, q1, 0.1), np.linspace(-1.0, 1.0, 9), 1e-5
    for k, (first, second) in enumerate(((jet.d1, jet.d11), (jet.d2, jet.d12))):
        ends = [(q0 + s * tiny * along, q1) if k == 0 else (q0, q1 + s * tiny * along) for s in (1, -1)]
        value = [L_d.value(*pair, 0.1) for pair in ends]
        slope = [L_d.d1(*pair, 0.1) for pair in ends]
        assert abs((value[0] - value[1]) / (2 * tiny) - first @ along) < 1e-11  # 5e-14
        assert np.abs((slope[0] - slope[1]) / (2 * tiny) - second @ along).max() < 1e-10  # 7e-13


@pytest.mark.nightly
def test_it_is_certified_on_the_solar_system():
    plain = orbits.certify(orbits.System.solar_system(), PLAIN, 3 * u.day)
    assert plain.ok, plain.table()
    assert plain["discrete Euler-Lagrange residual"].holds
    assert plain["momenta of L_d"].holds
    corrected = orbits.certify(orbits.System.solar_system(), DEFAULT, 3 * u.day)
    assert corrected.ok, corrected.table()
    assert corrected["symplecticity"].holds


def test_an_unbound_planet_passes_by():
    gm, q, v = planets()
    q[2], v[2] = [-6.0, 3.0, 0.4], [1.5, -0.1, 0.05]
    truth = march(orbits.Gauss(stages=8), gm, q, v, 0.004, 2000)
    got = march(DEFAULT, gm, q, v, 0.04, 200)
    assert np.abs(got[0] - truth[0]).max() < 1e-9


def test_what_it_cannot_march_is_refused_with_a_remedy():
    for options, text in (
        ({"kernel": "diligent"}, r"expected 'modified-kick', 'lazy' or 'standard'"),
        ({"corrector": 13}, r"expected 17, 11, 7, 5, 3, or 0 for none"),
        ({"corrector": True}, r"corrector is True"),
        ({"coordinates": "heliocentric"}, r"expected 'jacobi'"),
        ({"kernel": "lazy", "corrector": 0}, r"use corrector=17, or kernel='standard'"),
    ):
        with pytest.raises(InputError, match=text):
            orbits.WisdomHolman(**options)
    gm, q, v = three_bodies()
    with pytest.raises(InputError, match=r"dominates the others.*has 40 %.*Gauss"):
        march(DEFAULT, gm * [0.4, 30, 100], q, v, 0.1, 1)
    with pytest.raises(InputError, match="softening = 0"):
        Leg.of(newtonian, DEFAULT, parameters(gm, 0.1), gm > 0, q, v, 0.1)
    with pytest.raises(InputError, match="Newtonian"):
        orbits.march(orbits.lagrangians.pendulum, DEFAULT, dt=0.1, steps=1)
    with pytest.raises(InputError, match="cannot be composed"):
        orbits.methods.Composition(PLAIN, order=4)
    system = orbits.System.solar_system()
    term = orbits.terms.ZonalHarmonics("Jupiter", J2=0.0147, radius=71492 * u.km, pole=(268.06, 64.5) * u.deg)
    with pytest.raises(InputError, match="terms of the dominant body alone"):
        orbits.propagate(system.with_terms(term), DEFAULT, dt="3 d", duration="1 yr")
    with pytest.raises(InputError, match="EnergyErrorAbove cannot be watched"):
        orbits.propagate(system, DEFAULT, dt="3 d", duration="1 yr", stop=orbits.events.EnergyErrorAbove(1e-9))
    with pytest.raises(InputError, match="needs a dt"):
        orbits.propagate(system, DEFAULT, duration="1 yr")


def test_steps_that_do_not_resolve_a_pericentre_are_warned_of_with_those_that_do():
    system = orbits.System.solar_system()
    with pytest.warns(StepWarning, match=r"Mercury passes Sun, at 0\.3075 AU.*dt <= 3\.5 d"):
        orbits.propagate(system, DEFAULT, dt="6 d", duration="1 yr", samples=2, progress=False)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        orbits.propagate(system, DEFAULT, dt="3.5 d", duration="1 yr", samples=2, progress=False)
        alone = system.remove(*system.names[2:])  # exact with any step
        orbits.propagate(alone, DEFAULT, dt="9 d", duration="1 yr", samples=2, progress=False)


def pair_of_planets(gap):
    """Two planets of 1e-4 on circles of radius 1 and 1 + gap; three Hill radii are 0.12."""
    radius = np.array([1.0, 1.0 + gap])
    angle = np.array([0.0, 0.3])
    q = np.zeros((3, 3))
    q[1:, 0], q[1:, 1] = radius * np.cos(angle), radius * np.sin(angle)
    v = np.zeros((3, 3))
    v[1:, 0], v[1:, 1] = -np.sin(angle) / np.sqrt(radius), np.cos(angle) / np.sqrt(radius)
    return orbits.System(["star", "b", "c"], [1.0, 1e-4, 1e-4], q, v, units=orbits.DIMENSIONLESS)


def test_planets_that_come_close_are_warned_of_before_and_after_a_run():
    options = {"dt": 0.1, "samples": 2, "progress": False}
    with pytest.warns(StepWarning) as seen:
        orbits.propagate(pair_of_planets(0.05), DEFAULT, duration=60.0, **options)
    said = [str(warning.message) for warning in seen]
    assert "the orbits of b and c come within 0.05" in said[0]
    assert "cannot follow close encounters" in said[-1]
    assert "c to b" in said[-1] or "b to c" in said[-1]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = orbits.propagate(pair_of_planets(0.3), DEFAULT, duration=60.0, **options)
    assert run.unresolved() == []
