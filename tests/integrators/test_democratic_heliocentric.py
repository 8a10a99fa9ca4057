"""Wisdom–Holman maps in democratic heliocentric coordinates: a plain path, REBOUND's map and bounds, and particles."""

import warnings

import astropy.units as u
import numpy as np
import pytest

import orbits
from orbits import diagnostics
from orbits.elements import state_from_elements, two_body
from orbits.errors import InputError, StepWarning
from orbits.integrators import parse
from orbits.lagrangians.newtonian import newtonian, parameters
from orbits.marching.legs.leg import Leg

from ..contracts.problems import march
from ..maps import BOUNDS, EVERYWHERE, KM, REACHED, among_planets, energies, solar_system, system
from ..problems import particles_around, rebounds_outer_solar_system, three_bodies

METHOD = orbits.WisdomHolman(coordinates="democratic-heliocentric")
JACOBI = orbits.WisdomHolman(kernel="standard", corrector=0)
GAUSS = orbits.Gauss(stages=8)


def plain(gm, q, v, h, steps):
    """The map from its definition, the first body being the dominant one; bodies of mass 0 are massless."""
    m0, total = gm[0], gm.sum()
    centre, motion = gm @ q / total, gm @ v / total
    Q, V = q[1:] - q[0], v[1:] - motion

    def kick(h):
        for i in range(len(Q)):
            for j in range(len(Q)):
                if j != i:
                    V[i] += h * gm[1 + j] * (Q[j] - Q[i]) / np.linalg.norm(Q[j] - Q[i]) ** 3

    def drift(h):
        for i in range(len(Q)):
            Q[i], V[i] = two_body(Q[i], V[i], m0, h)

    for _ in range(steps):
        drift(h / 2)
        Q += h / 2 * (gm[1:] @ V) / m0
        kick(h)
        Q += h / 2 * (gm[1:] @ V) / m0
        drift(h / 2)
        centre = centre + h * motion
    q0 = centre - gm[1:] @ Q / total
    v0 = motion - gm[1:] @ V / m0
    return np.vstack([q0, q0 + Q]), np.vstack([v0, motion + V])


def test_the_steps_are_those_of_the_definition():
    gm, q, v = three_bodies()
    x, w = particles_around(2)
    gm, q, v = np.append(gm, [0.0, 0.0]), np.vstack([q, x]), np.vstack([v + np.array([0.3, 0.1, 0.2]), w])
    got, truth = march(METHOD, gm, q, v, 0.125, 20), plain(gm, q.copy(), v.copy(), 0.125, 20)
    for a, b in zip(got, truth, strict=True):
        assert np.abs(a - b).max() < 2e-14  # the plain path rounds everything: 3e-15 was reached


def test_the_order_is_two_with_particles_too():
    gm, q, v = three_bodies()
    x, w = particles_around(3)
    gm, q, v = np.append(gm, np.zeros(3)), np.vstack([q, x]), np.vstack([v, w])
    truth, _ = march(GAUSS, gm, q, v, 6.0 / 2000, 2000)
    errors = [np.abs(march(METHOD, gm, q, v, 6.0 / n, n)[0] - truth).max(axis=1) for n in (200, 400)]
    assert METHOD.order == 2
    assert np.abs(np.log2(errors[0] / errors[1]) - 2).max() < 0.1


def test_the_order_of_the_bodies_does_not_matter_to_the_last_bit():
    """REBOUND asserts 1e-14 after a period of Jupiter with two bodies swapped."""
    assert "<1e-14 after 1 Jyr" in BOUNDS["test_whfast.test_whfasthelio_orderdoesnotmatter"]
    start = orbits.rebound.from_rebound(rebounds_outer_solar_system()).values
    order = [0, 2, 1, *range(3, len(start.gm))]
    h = 0.005 * 11.862 * 2 * np.pi
    straight = march(METHOD, start.gm, start.q, start.v, h, 200)
    swapped = march(METHOD, start.gm[order], start.q[order], start.v[order], h, 200)
    for a, b in zip(straight, swapped, strict=True):
        assert np.array_equal(a[order], b)


def two_planets():
    """Those of REBOUND's `test_whfast`: of a thousandth at a = 1 and 3, e = 0.1, both at their pericentres."""
    gm, q, v = np.array([1.0, 1e-3, 1e-3]), np.zeros((3, 3)), np.zeros((3, 3))
    for k, (a, inside) in enumerate(((1.0, 1.001), (3.0, 1.002)), 1):
        x, w = state_from_elements(inside, a=a, e=0.1, M=0.0)
        centre = gm[:k] @ q[:k] / gm[:k].sum(), gm[:k] @ v[:k] / gm[:k].sum()
        q[k], v[k] = x + centre[0], w + centre[1]
    return gm, q - gm @ q / gm.sum(), v - gm @ v / gm.sum()


class Start:
    def __init__(self, gm, q, v):
        self.gm, self.q, self.v = gm, q, v


def test_energies_are_within_rebounds_bounds():
    """At the end, as there; where what REBOUND reaches exceeds its own bound, that is the bound. The energy oscillates
    with several times that.
    """
    assert "democraticheliocentric <1.5e-8" in BOUNDS["test_whfast.test_whfast_outersolarsystem"]
    turn = 2 * np.pi
    outer = orbits.rebound.from_rebound(rebounds_outer_solar_system()).values
    gm = np.array([1.0, 1e-3])
    x, w = state_from_elements(1.001, a=-1.0, e=2.5, M=0.0)
    unbound = Start(gm, np.array([-1e-3 * x, x]) / 1.001, np.array([-1e-3 * w, w]) / 1.001)
    for name, start, h, steps in (
        ("whfast dh OSS same", outer, 0.005 * 12 * turn, 16667),
        ("whfast dh hyperbolic", unbound, 0.00512 * turn, 19532),
        ("whfast dh 2 planets", Start(*two_planets()), 0.005123 * turn, 195_199),
    ):
        found = energies(METHOD, start, h, steps)
        assert abs(found[-1] / found[0] - 1.0) < max(REACHED[name]["bound"], REACHED[name]["reached"])


def test_it_is_the_map_of_whfast():
    """REBOUND's steps from the same start, 100 of them: to the rounding of both."""
    start = rebounds_outer_solar_system()
    x = orbits.rebound.from_rebound(start).values
    start.integrator = "whfast"
    start.integrator.coordinates = "democraticheliocentric"
    start.dt = 0.06 * 2 * np.pi
    start.steps(100)
    q, v = march(METHOD, x.gm, x.q, x.v, start.dt, 100)
    assert np.abs(q - [p.xyz for p in start.particles]).max() < 1e-12  # of 40 au
    assert np.abs(v - [p.vxyz for p in start.particles]).max() < 1e-13


def test_a_light_body_passes_by_at_any_speed():
    """One step of REBOUND's, at 1e5, to a rounding; its bound is 1e-15."""
    assert "<1e-15" in BOUNDS["test_whfast.test_whfast_veryhyperbolic"]
    gm = np.array([1.0, 1e-30])
    q, v = np.array([[0.0, 0, 0], [1.0, 0, 0]]), np.array([[0.0, 0, 0], [0.0, 1e5, 0]])
    got, _ = march(METHOD, gm, q, v, 1.234567, 1)
    assert abs(got[1, 1] / two_body(q[1], v[1], 1.0, 1.234567)[0][1] - 1.0) < 1e-15


def test_steps_of_many_periods_leave_a_light_planet_on_its_circle():
    gm = np.array([1.0, 1e-30])
    q, v = np.array([[0.0, 0, 0], [1.0, 0, 0]]), np.array([[0.0, 0, 0], [0.0, 1.0, 0]])
    got, _ = march(METHOD, gm, q, v, 4.56 * 2 * np.pi, 25)  # 114 periods
    assert np.abs(got - q).max() < 1e-12


def test_planets_move_alike_in_one_register_and_in_two():
    gm, q, v, _ = solar_system()
    gm[1] = 1e-40  # Mercury moves nothing, but moves the others by a place, Pluto into a second register
    others = [0, *range(2, 10)]
    one, two = march(METHOD, gm[others], q[others], v[others], 3.0, 2000), march(METHOD, gm, q, v, 3.0, 2000)
    for a, b in zip(one, two, strict=True):
        assert np.max(np.abs(a - b[others])) < 1e-13


@pytest.mark.nightly
def test_jacobi_coordinates_are_the_better_base():
    """A thousand years of the planets in steps of 3 d: in democratic heliocentric coordinates, Mercury is 7.8e5 km off
    its place, mostly along its orbit; 1.8e3 km in Jacobi's.
    """
    gm, q, v, truth = solar_system()
    off = {}
    for method in (METHOD, JACOBI):
        x, _ = march(method, gm, q, v, 3.0, 121_750)
        off[method] = KM * np.linalg.norm(x - truth, axis=1)[1:]
    assert 7e5 < off[METHOD][0] < 9e5
    assert off[METHOD][0] > 400 * off[JACOBI][0]


def test_the_motion_back_ends_where_it_began():
    for method, h in ((METHOD, 0.05), (METHOD, -0.05)):
        assert diagnostics.reversibility(*three_bodies(), method, h, 1000).ulps < 1000  # 200 were reached


def test_bits_depend_neither_on_neighbours_nor_threads_nor_blocks_nor_the_order_of_the_bodies():
    gm, q, v = among_planets((list(EVERYWHERE) * 5)[:37])
    run = Leg.of(newtonian, METHOD, parameters(gm[gm > 0]), gm > 0, q, v, 3.0, threads=3)
    run.advance(50)
    x, w = run.state()
    massive, _ = march(METHOD, gm[:9], q[:9], v[:9], 3.0, 50)
    assert np.array_equal(x[:9], massive)
    order = np.random.default_rng(1).permutation(len(gm))
    masses = gm[order]
    strength = parameters(masses[masses > 0])
    other = [Leg.of(newtonian, METHOD, strength, masses > 0, q[order], v[order], 3.0) for _ in range(2)]
    other[0].block = 7
    other[0].advance(20)
    other[0].state_after(1.7)
    other[1].restore(other[0].checkpoint())
    other[1].advance(30)
    assert np.array_equal(other[1].state()[0], x[order])
    assert np.array_equal(other[1].state()[1], w[order])
    for k in (9, 14, 40):
        alone = np.append(np.arange(9), k)
        assert np.array_equal(march(METHOD, gm[alone], q[alone], v[alone], 3.0, 50)[0][-1], x[k])


def test_samples_and_archives_leave_the_run_as_it_is_and_observers_see_it(tmp_path):
    start, options = system({(1.3, 0.1): 3, (2.7, 0.15): 4}), {"dt": 1 * u.day, "progress": False, "check_step": False}
    method = "wisdom-holman(coordinates='democratic-heliocentric')"
    many = orbits.propagate(start, method, duration=1200 * u.day, samples=38, approaches=True, **options)
    part = orbits.propagate(
        start, METHOD, duration=500 * u.day, samples=4, archive=tmp_path / "run.h5", threads=1, **options
    )
    whole = orbits.resume(part.path, until=1200 * u.day, progress=False)
    assert whole.integrator == METHOD
    assert np.array_equal(many.q[-1], whole.q[-1])
    back = orbits.propagate(many[-1], METHOD, duration=-1200 * u.day, samples=2, **options)
    assert np.linalg.norm((back.q[-1] - start.q).to_value(u.km), axis=1).max() < 1e-3
    exact = orbits.propagate(start, GAUSS, duration=1200 * u.day, samples=2, **options).closest_approaches()
    for name in ("Mars", "p1"):
        seen = {one.other: one.distance for one in many.closest_approaches()[name]}
        assert all(abs(seen[one.other] - one.distance) < 3e-5 * u.au for one in exact[name])


def test_what_is_made_for_jacobi_coordinates_is_refused_and_left_away_by_default():
    assert METHOD.label == "WisdomHolman(coordinates='democratic-heliocentric', kernel='standard', corrector=0)"
    assert parse("wisdom-holman(coordinates='democratic-heliocentric')") == METHOD
    assert orbits.WisdomHolman() == orbits.WisdomHolman(kernel="modified-kick", corrector=17)
    assert orbits.WisdomHolman(kernel="standard").corrector == 17
    for options, text in (
        ({"corrector": 17}, "corrector=17 is made for Jacobi coordinates"),
        ({"kernel": "lazy"}, "kernel='lazy' is made for Jacobi coordinates"),
        ({"corrector2": True}, "corrector2=True is made for Jacobi coordinates"),
    ):
        with pytest.raises(InputError, match=f"{text}.*or coordinates='jacobi'|{text}.*or use coordinates='jacobi'"):
            orbits.WisdomHolman(coordinates="democratic-heliocentric", **options)
    for options, text in (
        ({"coordinates": "heliocentric"}, "expected 'jacobi' or 'democratic-heliocentric'"),
        ({"corrector2": True, "kernel": "standard"}, "corrector2=True .*kernel='modified-kick' or 'lazy'"),
        ({"corrector2": 2}, "corrector2 is 2; expected True or False"),
    ):
        with pytest.raises(InputError, match=text):
            orbits.WisdomHolman(**options)


def test_steps_of_a_single_planet_are_judged_since_they_are_not_exact():
    solar = orbits.System.solar_system()
    alone = solar.remove(*solar.names[2:])
    with pytest.warns(StepWarning, match=r"Mercury passes Sun, at 0\.3075 AU.*dt <= 3\.5 d"):
        orbits.propagate(alone, METHOD, dt="9 d", duration="1 yr", samples=2, progress=False)


@pytest.mark.nightly
def test_it_is_certified_with_and_without_particles():
    for start in (orbits.System.solar_system(), system({(2.5, 0.1): 0, (1.3, 0.1): 0})):
        found = orbits.certify(start, METHOD, 3 * u.day)
        assert found.ok, found.table()
        assert found["symplecticity"].holds
        assert found["reversibility"].holds


def test_massless_particles_about_a_star_alone_are_exact_whatever_the_step():
    """Five steps a turn, and pericentres that they do not resolve: nothing perturbs them. 2e-12 au in 100 years."""
    states = [(1.0, 0.0167, 0.0), (3.0, 0.3, 0.9), (0.4, 2.0, 0.5)]
    sun = orbits.System(["Sun"], [0.00029591220828411956], np.zeros((1, 3)), np.zeros((1, 3)), units=orbits.SOLAR)
    start = sun
    for k, (a, anomaly, e) in enumerate(states):
        start = start.add(f"p{k}", primary="Sun", a=a, e=e, M=anomaly)
    exact = orbits.propagate(start, duration="100 yr", samples=3, progress=False)
    for method in (orbits.WisdomHolman(coordinates="democratic-heliocentric"), orbits.WisdomHolman()):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            run = orbits.propagate(start, method, dt="20 d", duration="100 yr", samples=3, progress=False)
        assert np.abs((run.q - exact.q).value).max() < 2e-11
