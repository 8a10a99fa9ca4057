"""A zero with which a run starts does not count, however its functions are rounded; all that follow do."""

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.events import Apocentre, ElementCrossing, Event, NodeCrossing, Pericentre

from ..coverings import cover

PERIOD = 2.0 * np.pi
METHODS = {
    "gauss": {},
    "map": {"integrator": "wisdom-holman", "dt": 0.1},
    "saba": {"integrator": "saba(10,6,4)", "dt": 0.1},
}


def ship(angles, mass=1e-20, **elements):
    inc, node, omega = angles
    orbit = {"a": 1.0, "e": 0.2, "inc": inc, "Omega": node, "omega": omega, "gm": mass} | elements
    return orbits.System.from_elements({"star": {"gm": 1.0}, "ship": orbit}, units=orbits.DIMENSIONLESS)


def orientations(count):
    return np.random.default_rng(0).uniform(0.0, np.pi, (count, 3))


@cover(
    ("method", "mass", "direction"),
    list(METHODS),
    [1e-20, 0.0],
    [1.0, -1.0],
    strength=1,
    allowed=lambda method, mass, direction: mass > 0.0 or method == "gauss",
)
def test_a_pericentre_at_the_start_does_not_count_in_any_orientation(method, mass, direction):
    for angles in orientations(6):
        run = orbits.propagate(
            ship(angles, mass), duration=direction * 2.5 * PERIOD, events=Pericentre("ship"), **METHODS[method]
        )
        # The first one is a whole revolution later, to the error of the methods' periods, 1e-7 for these steps.
        np.testing.assert_allclose(direction * run.events.time.value, PERIOD * np.array([1.0, 2.0]), rtol=1e-6)


def test_a_node_and_an_element_at_the_start_do_not_count_either():
    for node in (0.1, 0.5, 0.9, 1.3, 1.7, 2.1):
        events = [NodeCrossing("ship"), ElementCrossing("ship", "f", 0.0)]
        run = orbits.propagate(ship((0.3, node, 0.0)), duration=1.2 * PERIOD, events=events)
        assert run.events.time.value.min() > 1.0
        assert len(run.events) == 3  # both nodes and the pericentre, where the ascending node is


def test_a_pericentre_of_a_satellite_soon_after_the_start_counts():
    """At 1 au from the Sun 1e-11 of a place are metres, which hid a pericentre 0.8 s after the start."""
    system = orbits.System.from_elements({"Sun": {"gm": 1.0}, "rock": {"a": 1.0, "gm": 1e-19}}, units=orbits.SOLAR)
    moon = {"a": 3 * u.km, "e": 0.1, "M": -1e-3}
    run = orbits.propagate(
        system.add("moon", primary="rock", **moon), duration=0.1 * u.day, events=Pericentre("moon", "rock")
    )
    assert run.events.time[0] < 0.001 * u.day


@pytest.mark.parametrize("eccentricity", [1e-6, 0.01, 0.2, 0.9])
def test_a_run_from_where_an_event_stopped_another_does_not_stop_there_again(eccentricity):
    for angles in orientations(4):
        system = ship(angles, e=eccentricity, M=angles[0])
        for _ in range(2):
            system = orbits.propagate(
                system, duration=3.0 * PERIOD, events=Apocentre("ship", then="stop")
            ).stopped.system
        again = orbits.propagate(system, duration=3.0 * PERIOD, events=Apocentre("ship", then="stop")).stopped
        # The place of an apsis is known to the error of the motion within steps, 1e-12, over the eccentricity.
        assert again.time.value == pytest.approx(PERIOD, abs=1e-11 / eccentricity)


def test_a_map_with_its_corrector_does_not_act_at_a_pericentre_with_which_it_starts():
    def burn(t, system):
        return system.replaced(v=system.v * [[1.0], [1.05]])

    system = orbits.System(["star", "ship"], [1, 1e-20], [[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [0, 1.1, 0]],
                           units=orbits.DIMENSIONLESS)  # fmt: skip
    run = orbits.propagate(system, "wisdom-holman", dt=0.1, duration=25.0, events=Pericentre("ship", then=burn))
    semi_major = [1.0 / (2.0 - v * v) for v in (1.1, 1.1 * 1.05)]
    np.testing.assert_allclose(run.events.time.value, np.cumsum(PERIOD * np.power(semi_major, 1.5)), rtol=1e-9)


def test_an_event_right_after_the_start_counts():
    for anomaly in (1e-8, 1e-4):
        run = orbits.propagate(ship((0.3, 1.0, 2.0), M=-anomaly), duration=1.0, events=Pericentre("ship"))
        assert run.events.time.value.tolist() == pytest.approx([anomaly], abs=1e-14)


@cover(("begun", "sign", "way"), [1e-18, 0.0, -1e-18], [1.0, -1.0], [1.0, -1.0], strength=2)
def test_a_zero_after_one_at_the_start_is_found_in_the_same_step(begun, sign, way):
    event = Event(lambda t, q, v: sign * (t - way * begun) * (t - way * 1e-3), name="twice")
    run = orbits.propagate(ship((0.3, 1.0, 2.0)), duration=way, events=event)
    assert run.events.time.value.tolist() == pytest.approx([way * 1e-3], abs=1e-15)


def test_a_year_from_the_pericentre_is_as_in_the_guide():
    bodies = {"Sun": {"mass": 1.0 * u.M_sun}, "Earth": {"a": 1.0 * u.au, "e": 0.0167, "mass": 1.0 * u.M_earth}}
    for node in range(0, 100, 10):
        bodies["Earth"] |= {"inc": 20.0 * u.deg, "Omega": node * u.deg, "omega": 50.0 * u.deg}
        system = orbits.System.from_elements(bodies, epoch="2026-01-01")
        run = orbits.propagate(system, duration=3.0 * u.yr, events=Pericentre("Earth", then="stop"))
        assert run.stopped.time.to_value(u.day) == pytest.approx(365.2563, abs=1e-4)


def test_a_pericentre_at_the_start_does_not_count_however_soon_the_first_sample_is():
    for angles in orientations(6):
        for soon in (1e-16, 1e-11, 1e-3):
            samples = [0.0, soon, 7.0]
            run = orbits.propagate(ship(angles, 0.0), duration=7.0, samples=samples, events=Pericentre("ship"))
            assert run.events.time.value.tolist() == pytest.approx([PERIOD], abs=1e-11)
