"""Nothing is lost on the way to REBOUND and back: not a bit, not a name, not the softening."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
import rebound
from astropy import units as u
from hypothesis import given
from hypothesis import strategies as st

import orbits
from orbits.errors import EpochError, InputError, OrbitsWarning
from orbits.rebound import from_rebound, to_rebound
from orbits.terms import MinorBodies

from ..coverings import each

NAMES = ["probe", "Sun", "Jupiter", "a grain"]
GM = [0.0, 2.9591220828411956e-4, 2.8253458252257923e-7, 0.0]
Q = [[1.1, 0.2, 0.3], [-0.007, -0.003, -0.001], [4.0, 2.9, 1.2], [0.1, 2.5, -0.3]]
V = [[0.001, 0.015, 0.0], [5.4e-6, -6.8e-6, -3e-6], [-0.0046, 0.0058, 0.0026], [-0.01, 0.001, 0.0]]


def states(sim):
    return [(p.name, p.m, p.x, p.y, p.z, p.vx, p.vy, p.vz) for p in sim.particles]


def test_there_and_back_is_the_identity_when_massive_bodies_come_first():
    order = [1, 2, 0, 3]
    system = orbits.System(
        [NAMES[i] for i in order], *([x[i] for i in order] for x in (GM, Q, V)), epoch="J2000", radii=[1e-2, 1e-3, 0, 0]
    )
    sim = to_rebound(system)
    assert from_rebound(sim, units=orbits.SOLAR, epoch="J2000") == system


def test_massive_bodies_go_first_and_massless_ones_become_test_particles():
    sim = to_rebound(orbits.System(NAMES, GM, Q, V, softening=0.125))
    assert states(sim) == [(NAMES[i], GM[i], *Q[i], *V[i]) for i in (1, 2, 0, 3)]
    assert (sim.G, sim.N_active, sim.testparticle_type, sim.softening, sim.t) == (1.0, 2, 0, 0.125, 0.0)


def test_a_simulation_with_units_keeps_them_and_its_G():
    sim = rebound.Simulation()
    sim.units = ("AU", "yr", "Msun")
    sim.add(m=1.0, name="star")
    sim.add(m=1e-3, a=1.0)
    system = from_rebound(sim)
    assert system.names == ("star", "particle 1")
    assert system.units.G == sim.G
    assert system.units.length.to(u.au) == pytest.approx(1.0, rel=1e-15)
    assert system.units.time.to(u.yr) == 1.0
    assert system.gm[0].to_value(u.au**3 / u.yr**2) == pytest.approx(4 * np.pi**2, rel=1e-4)  # Kepler's third law
    np.testing.assert_array_equal(system.values.gm, sim.G * np.array([1.0, 1e-3]))


def test_a_simulation_without_units_is_pure_numbers_with_its_G():
    sim = rebound.Simulation()
    sim.add(m=2.0)
    sim.add(m=0.5, x=1.0, vy=1.0)
    assert from_rebound(sim).units == orbits.DIMENSIONLESS
    sim.G = 3.0
    system = from_rebound(sim)
    assert system.units.G == 3.0
    assert system.values.gm.tolist() == [6.0, 1.5]
    assert system.energy().value == pytest.approx(sim.energy(), rel=1e-15)


def test_an_unsynchronized_simulation_is_read_synchronized_and_left_alone():
    def made(safe):
        sim = rebound.Simulation()
        sim.add(m=1.0)
        sim.add(m=1e-3, a=1.0, e=0.1)
        sim.integrator, sim.dt = "whfast", 0.05
        sim.integrator.safe_mode = safe
        sim.integrator.keep_unsynchronized = 1 - safe
        sim.steps(10)
        return sim

    sim = made(safe=0)
    assert not sim.is_synchronized
    before = states(sim)
    system = from_rebound(sim)
    # The same ten steps, synchronized after each: the same up to the round-off of nine more half-steps.
    np.testing.assert_allclose(system.values.q, from_rebound(made(safe=1)).values.q, rtol=0, atol=1e-14)
    assert states(sim) == before
    assert not sim.is_synchronized


def plain():
    sim = rebound.Simulation()
    sim.add(m=1.0, name="star")
    sim.add(m=1e-3, x=1.0, vy=1.0, name="planet")
    return sim


def with_two_heavy_test_particles_of_type_1():
    sim = plain()
    sim.add(m=0.0, x=2.0)
    sim.N_active, sim.testparticle_type = 1, 1
    return sim


def with_variations():
    sim = plain()
    sim.add_variation()
    return sim


def with_modifications():
    sim = plain()
    sim.post_timestep_modifications = lambda _: None
    return sim


def in_a_shearing_sheet():
    sim = plain()
    sim.integrator = "sei"
    return sim


def with_another_G_than_its_units():
    sim = rebound.Simulation()
    sim.units = ("AU", "yr", "Msun")
    sim.G = 1.0
    sim.add(m=1.0)
    return sim


def with_a_name_twice():
    sim = plain()
    sim.add(x=3.0, name="planet")
    return sim


def with_forces():
    sim = plain()
    sim.additional_forces = lambda _: None
    return sim


def with_boundary():
    sim = plain()
    sim.boundary = "periodic"
    return sim


def without_gravity():
    sim = plain()
    sim.gravity = "none"
    return sim


@each(
    ("make", "message"),
    [
        (with_two_heavy_test_particles_of_type_1, "'planet' is a test particle .* of type 1 with mass 0.001"),
        (with_forces, "additional forces"),
        (with_boundary, "periodic"),
        (without_gravity, "none"),
        (with_variations, "2 variational particles"),
        (with_modifications, "post timestep modifications"),
        (in_a_shearing_sheet, "'sei'"),
        (with_another_G_than_its_units, "G = 1.0, but G is 39.4"),
        (with_a_name_twice, "both called 'planet'"),
        (rebound.Simulation, "the system has no bodies"),
    ],
)
def test_what_a_system_cannot_be_is_refused_in_words(make, message):
    with pytest.raises(InputError, match=message):
        from_rebound(make())


def test_what_is_no_simulation_is_refused_in_words():
    with pytest.raises(InputError, match="got a int; expected a rebound"):
        from_rebound(7)
    with pytest.raises(InputError, match="one state only"):
        from_rebound(plain(), snapshot=3)
    with pytest.raises(InputError, match="got a int; expected a System"):
        to_rebound(7)


numbers = st.floats(allow_nan=False, allow_infinity=False)
lengths = st.floats(0, 1e300)
text = st.text("aZ09 äλ星🪐<&'\"\\", min_size=1, max_size=30).map(str.strip).filter(bool)


@st.composite
def systems(draw):
    n = draw(st.integers(1, 6))
    massive = draw(st.integers(1, n))
    column = st.lists(numbers, min_size=3 * n, max_size=3 * n)
    gm = [*draw(st.lists(st.floats(5e-324, 1e300), min_size=massive, max_size=massive)), *[0.0] * (n - massive)]
    radii = draw(st.none() | st.lists(lengths, min_size=n, max_size=n).filter(any))
    units = draw(st.sampled_from([orbits.SOLAR, orbits.DIMENSIONLESS]))
    epoch = draw(st.none() | st.floats(2.4e6, 2.5e6)) if units is orbits.SOLAR else None
    names = draw(st.lists(text, min_size=n, max_size=n, unique=True))
    q, v = (np.reshape(draw(column), (n, 3)) for _ in "qv")
    softening = draw(st.floats(5e-324, 1e300))  # > 0, so that bodies may share a place
    return orbits.System(names, gm, q, v, epoch=epoch, units=units, radii=radii, softening=softening)


@given(systems())
def test_there_and_back_keeps_every_bit_of_any_system(system):
    back = from_rebound(to_rebound(system), epoch=system.epoch)
    assert back == system
    for mine, theirs in zip(system.values[:3], back.values[:3], strict=True):
        assert mine.tobytes() == theirs.tobytes()  # the sign of a zero, too


def test_a_solar_simulation_names_its_units_with_G_1_to_the_bit():
    sim = to_rebound(orbits.System(NAMES, GM, Q, V))
    assert (sim.G, sim.units) == (1.0, {"length": "au", "time": "d", "mass": "massist"})
    # REBOUND's own unit agrees with DE440's GM of the Sun: a solar mass in it.
    assert rebound.units.masses_SI["msun"] / rebound.units.masses_SI["massist"] == pytest.approx(GM[1], rel=1e-10)


def test_a_sample_of_a_run_goes_over_with_its_time_and_comes_back_with_its_epoch():
    system = orbits.System.solar_system("2022-08-09", bodies=["Sun", "Jupiter"])
    run = orbits.propagate(system, orbits.Gauss(stages=4), dt=20, duration=200, samples=3)
    assert from_rebound(to_rebound(run), zero=system.epoch) == run[-1]
    with pytest.raises(InputError, match="sample is 'Sun'"):
        to_rebound(run, "Sun")
    sim = to_rebound(run, 1)
    assert sim.t == 100.0
    assert from_rebound(sim, epoch=run[1].epoch) == from_rebound(sim, zero="2022-08-09") == run[1]
    with pytest.raises(EpochError, match="both given"):
        from_rebound(sim, epoch="2022-08-09", zero="2022-08-09")
    with pytest.raises(EpochError, match="no unit of time"):
        from_rebound(plain(), zero="2022-08-09")


def test_si_units_and_a_gaussian_constant():
    sim = rebound.Simulation()
    sim.units = ("m", "s", "kg")
    sim.add(m=2e30)
    system = from_rebound(sim)
    assert (system.units.length, system.units.time, system.units.mass) == (u.m, u.s, u.kg)
    assert system.values.gm[0] == sim.G * 2e30
    sim = plain()
    sim.G = 0.01720209895**2
    assert from_rebound(sim, units=orbits.SOLAR).gm[0] == 0.01720209895**2 * u.au**3 / u.day**2


def test_units_other_than_those_of_the_simulation_are_refused_as_its_numbers_are_not_converted():
    sim = rebound.Simulation()
    sim.units = ("km", "s", "kg")
    sim.add(m=2e30)
    sim.add(a=1.5e8)
    with pytest.raises(InputError, match=r"SOLAR, of AU and d, but the simulation is in km, s, kg.*convert_particle"):
        from_rebound(sim, units=orbits.SOLAR)
    assert from_rebound(sim, units=orbits.DIMENSIONLESS).q[1, 0] == 1.5e8
    sim.convert_particle_units("au", "d", "massist")
    assert from_rebound(sim, units=orbits.SOLAR).q[1, 0].to_value(u.km) == pytest.approx(1.5e8, rel=1e-15)


def test_a_test_particle_of_type_0_is_massless_and_its_mass_is_told():
    sim = plain()
    sim.N_active = 1
    with pytest.warns(OrbitsWarning, match="planet: test particles with mass, which attract nothing"):
        system = from_rebound(sim)
    assert system.values.gm.tolist() == [1.0, 0.0]


def with_one_heavy_test_particle_of_type_1():
    sim = plain()
    sim.N_active, sim.testparticle_type = 1, 1
    return sim


def softened():
    sim = plain()
    sim.softening = 0.3
    return sim


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("make", [with_one_heavy_test_particle_of_type_1, softened])
def test_what_is_taken_over_moves_as_in_rebound(make):
    sim = make()
    sim.particles["planet"].m = 0.3
    system = from_rebound(sim)
    assert system.values.gm.tolist() == [1.0, 0.3]
    sim.integrate(5.0)
    run = orbits.propagate(system, orbits.Gauss(stages=8), dt=0.05, duration=5.0, samples=2)
    # Both are exact to round-off; reached is 2e-16.
    assert np.abs(run.q[-1].value - [p.xyz for p in sim.particles]).max() < 4e-15


@pytest.mark.filterwarnings("error")
def test_heavy_test_particles_of_type_1_are_minor_bodies_there_and_back():
    sim = plain()
    sim.add(m=2e-3, x=2.0, vy=0.7, name="other")
    sim.N_active, sim.testparticle_type = 1, 1
    system = from_rebound(sim)
    assert system.terms == (MinorBodies(bodies=["planet", "other"]),)
    back = to_rebound(system)
    assert (back.N_active, back.testparticle_type) == (1, 1)
    assert [p.m for p in back.particles] == [p.m for p in sim.particles]


@pytest.mark.nightly
def test_heavy_test_particles_of_type_1_move_as_minor_bodies():
    sim = plain()
    sim.add(m=2e-3, x=2.0, vy=0.7, name="other")
    sim.N_active, sim.testparticle_type = 1, 1
    system = from_rebound(sim)
    sim.integrate(5.0)
    run = orbits.propagate(system, orbits.Gauss(stages=8), dt=0.05, duration=5.0, samples=2)
    # Both are exact to round-off; the attraction of the two would move them by 1e-3.
    assert np.abs(run.q[-1].value - [p.xyz for p in sim.particles]).max() < 4e-14


@pytest.mark.filterwarnings("error")
def test_massless_test_particles_of_type_1_are_massless():
    sim = plain()
    sim.add(x=2.0)
    sim.N_active, sim.testparticle_type = 2, 1
    assert from_rebound(sim).values.gm.tolist() == [1.0, 1e-3, 0.0]


def test_collisions_are_told():
    sim = plain()
    sim.collision = "direct"
    with pytest.warns(OrbitsWarning, match="pass through each other"):
        from_rebound(sim)


def with_time_and_units(units, G):
    sim = rebound.Simulation()
    if units is not None:
        sim.units = units
    if G is not None:
        sim.G = G
    sim.add(m=1.0, name="star", r=0.01)
    sim.add(m=1e-3 / 3, a=1.3, e=0.2, name="planet")  # no short number: G m / G is not m for all G
    sim.add(m=7.1e-7, a=2.2, name="another")
    sim.add(a=3.0, name="grain")
    sim.N_active = 3
    sim.integrate(3.7)
    return sim


SIMULATIONS = [
    (("AU", "yr", "Msun"), None),
    (("m", "s", "kg"), None),
    (("au", "d", "massist"), 1.0),
    (("au", "yr2pi", "msun"), None),
    (None, None),
    (None, 4 * np.pi**2),
]


@pytest.mark.parametrize(("units", "G"), SIMULATIONS, ids=str)
def test_a_simulation_comes_back_with_its_G_its_units_its_masses_and_its_t(units, G):
    sim = with_time_and_units(units, G)
    system = from_rebound(sim)
    for made in (system, pickle.loads(pickle.dumps(system)), copy.deepcopy(system)):
        back = to_rebound(made)
        assert (back.G, back.t, back.units, back.N_active) == (sim.G, sim.t, sim.units, sim.N_active)
        assert states(back) == states(sim)
        assert [p.r for p in back.particles] == [p.r for p in sim.particles]
    run = orbits.propagate(system, "gauss", dt=0.01, duration=1.0, samples=3)
    back = to_rebound(run)
    assert (back.G, back.units) == (sim.G, sim.units)
    assert back.t == sim.t + 1.0
    assert to_rebound(run, 0).t == sim.t
    assert np.array_equal(from_rebound(back).values.gm, system.values.gm)
    assert from_rebound(back).units == system.units


def test_what_is_made_of_a_simulations_system_is_a_system_like_any_other():
    system = from_rebound(with_time_and_units(("AU", "yr", "Msun"), None))
    moved = system.barycentric()
    assert type(moved) is orbits.System
    back = to_rebound(moved)
    assert (back.t, back.G) == (0.0, system.units.G)
    assert [back.G * p.m for p in back.particles] == system.values.gm.tolist()
    # A GM that is G times no float is kept all the same, with G = 1.
    others = np.nextafter(np.full(40, 1e-3), 1.0) * np.arange(1, 41)
    odd = orbits.System(
        [f"b{k}" for k in range(40)], others, np.arange(120.0).reshape(40, 3), np.zeros((40, 3)), units=system.units
    )
    made = to_rebound(odd)
    assert [made.G * p.m for p in made.particles] == others.tolist()
