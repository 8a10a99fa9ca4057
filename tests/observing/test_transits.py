"""Transits and radial velocities as seen from infinity: against IAS15, against Kepler's orbits, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
import rebound
from astropy import units as u
from astropy.time import Time

import orbits
from orbits.errors import InputError, UnknownNameError
from orbits.events import Occultation, Opposition, Transit
from orbits.observing.transits import mid_transits

EPOCH = Time(2457257.93, format="jd", scale="tdb")
PLANETS = {  # three neighbours in resonance, about those of TRAPPIST-1
    "b": {"P": 1.510821 * u.day, "mass": 4.6e-5, "e": 0.007, "omega": 317 * u.deg, "M": 225 * u.deg},
    "c": {"P": 2.421950 * u.day, "mass": 4.4e-5, "e": 0.002, "omega": 310 * u.deg, "M": 42 * u.deg},
    "d": {"P": 4.049193 * u.day, "mass": 1.3e-5, "e": 0.007, "omega": 331 * u.deg, "M": 196 * u.deg},
}
STAR = 0.09 * u.M_sun


def system(inc: u.Quantity = 89.7 * u.deg, frame: str = "sky", **more: u.Quantity) -> orbits.System:
    """Return the star and its planets, with radii."""
    bodies = {"star": {"mass": STAR, "radius": 0.119 * u.R_sun}}
    for name, given in PLANETS.items():
        own = {**given, "mass": given["mass"] * STAR, "radius": 7000 * u.km, "primary": "jacobi"}
        bodies[name] = {**own, "inc": inc, **more}
    return orbits.System.from_elements(bodies, epoch=EPOCH, frame=frame)


@pytest.fixture(scope="module")
def run() -> orbits.Trajectory:
    sought = [Transit(name, "star", observer=orbits.along()) for name in PLANETS]
    return orbits.propagate(system(), duration=40 * u.day, events=sought)


def transits_by_ias15(bodies: orbits.System, planet: int, until: float) -> np.ndarray:
    """Return the times of transits in REBOUND's IAS15, by bisection between its steps of an hour."""
    gm, q, v, _ = bodies.values
    sim = rebound.Simulation()
    for k in range(len(gm)):
        sim.add(m=gm[k], x=q[k, 0], y=q[k, 1], z=q[k, 2], vx=v[k, 0], vy=v[k, 1], vz=v[k, 2])
    sim.integrator = "ias15"

    def parting(t: float) -> tuple[float, float]:
        sim.integrate(t)
        star, body = sim.particles[0], sim.particles[planet]
        way, speed = (body.x - star.x, body.y - star.y), (body.vx - star.vx, body.vy - star.vy)
        return way[0] * speed[0] + way[1] * speed[1], body.z - star.z

    found, before = [], parting(0.0)
    for t in np.arange(1, int(until * 24)) / 24.0:
        now = parting(t)
        if before[0] < 0.0 <= now[0] and now[1] > 0.0:
            low, high = t - 1.0 / 24.0, t
            while high - low > 1e-10:
                middle = 0.5 * (low + high)
                low, high = (middle, high) if parting(middle)[0] < 0.0 else (low, middle)
            found.append(low)
            parting(t)
        before = now
    return np.array(found)


def test_transits_of_any_year_can_be_printed() -> None:
    """`ErfaError: unacceptable date`, before 4713 BC."""
    early = system().replaced(epoch=Time(-5000.0, format="jyear", scale="tdb"))
    found = orbits.propagate(early, duration=2.0, events=Transit("b", "star", observer=orbits.along()))
    assert "-4999.99" in str(found.transits("b")["date"])


def test_times_of_transits_of_three_planets_are_those_of_ias15(run):
    for number, name in enumerate(PLANETS, 1):
        expected = transits_by_ias15(run.system, number, 40.0)
        found = run.transits(name)["time"].to_value(u.day)
        assert len(found) == len(expected) > 8
        # Reached: 7e-6 s, the bisection to 1e-10 d.
        assert np.abs(found - expected).max() * 86400.0 < 2e-5


def test_a_transit_takes_as_long_as_a_circle_says():
    star = orbits.System.from_elements({"star": {"mass": STAR, "radius": 0.119 * u.R_sun}}, epoch=EPOCH)
    alone = star.add("p", mass=1e-15 * u.M_sun, P=3 * u.day, inc=89.5 * u.deg, radius=7000 * u.km, frame="sky")
    sought = Transit("p", "star", observer=orbits.along(), then="record")
    table = orbits.propagate(alone, duration=10 * u.day, events=sought).transits("p")
    a, R, r = (x.to_value(u.km) for x in (alone.elements("star").a[0], 0.119 * u.R_sun, 7000 * u.km))
    i = np.deg2rad(89.5)
    for column, size in (("duration", R + r), ("full_duration", R - r)):
        # Winn (2010), "Transits and occultations", eq. 14 and 15, for a circle.
        expected = 3.0 / np.pi * np.arcsin(np.sqrt(size**2 - (a * np.cos(i)) ** 2) / (a * np.sin(i)))
        np.testing.assert_allclose(table[column].to_value(u.day), expected, rtol=1e-9)
    np.testing.assert_allclose(table["impact_parameter"], a * np.cos(i) / R, rtol=1e-9)
    np.testing.assert_allclose(table["time"].to_value(u.day), 3.0 * (0.25 + np.arange(4)), atol=1e-11)
    assert np.abs(table["o_minus_c"].to_value(u.day)).max() < 1e-11
    assert table.meta["period"].to_value(u.day) == pytest.approx(3.0, abs=1e-11)


def test_light_time_shifts_the_middle_by_the_distance_of_the_planet():
    star = orbits.System.from_elements({"star": {"mass": STAR, "radius": 0.119 * u.R_sun}}, epoch=EPOCH)
    alone = star.add("p", mass=1e-15 * u.M_sun, P=30 * u.day, inc=90 * u.deg, radius=7000 * u.km, frame="sky")
    times = [
        orbits.propagate(
            alone, duration=20 * u.day, events=Transit("p", "star", observer=orbits.along(), apparent=light)
        ).transits("p")["time"][0]
        for light in (False, True)
    ]
    # The planet is nearer by a than the star, which rests: its light arrives a/c earlier. To second order in v/c: 3e-9.
    expected = (alone.elements("star").a[0] / (299792.458 * u.km / u.s)).to_value(u.s)
    assert (times[0] - times[1]).to_value(u.s) == pytest.approx(expected, rel=1e-6)


def test_a_system_in_its_own_plane_transits_as_one_in_the_sky(run):
    # Longitudes count from the node on: omega from the sky's is the longitude of pericentre from x, less the node.
    flat = system(0 * u.deg, "system", Omega=50 * u.deg)
    line = orbits.along(inc=89.7 * u.deg, node=50 * u.deg)
    tilted = orbits.propagate(flat, duration=10 * u.day, events=Transit("b", "star", observer=line))
    ours = tilted.transits("b", line)
    theirs = run.transits("b")[: len(ours)]
    # Reached: 4e-15 d and 6e-17, rounding.
    np.testing.assert_allclose(ours["time"].value, theirs["time"].value, rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(ours["impact_parameter"], theirs["impact_parameter"], rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(
        tilted.radial_velocity("star", line, [1.0, 2.0]).value, run.radial_velocity("star", times=[1.0, 2.0]).value,
        rtol=1e-11,
    )  # fmt: skip


def test_a_star_recedes_as_published_elements_say():
    star = orbits.System.from_elements({"star": {"mass": 1 * u.M_sun}}, epoch=EPOCH)
    e, omega, inc = 0.4, np.deg2rad(70.0), np.deg2rad(60.0)
    pair = star.add("p", mass=1e-3 * u.M_sun, P=100 * u.day, e=e, omega=omega, inc=inc, frame="sky")
    found = orbits.propagate(pair, duration=100 * u.day, samples=7)
    f = np.array([found[k].elements("star", frame="sky").f.to_value(u.rad)[0] for k in range(7)])
    a = pair.elements("star").a[0]
    K = 1e-3 / 1.001 * (2 * np.pi * a / (100 * u.day)).to_value(u.m / u.s) * np.sin(inc) / np.sqrt(1 - e * e)
    expected = K * (np.cos(omega + f) + e * np.cos(omega))
    np.testing.assert_allclose(found.radial_velocity("star").to_value(u.m / u.s), expected, atol=1e-9 * K)
    node = star.add("p", mass=1e-3 * u.M_sun, P=100 * u.day, inc=inc, Omega=30 * u.deg, frame="sky")
    way, speed = (x[1] - x[0] for x in (node.values.q, node.values.v))
    np.testing.assert_allclose([np.rad2deg(np.arctan2(way[1], way[0])), way[2]], [30.0, 0.0], atol=1e-12)
    assert speed[2] > 0.0  # at the node a planet approaches the observer, along z
    at = found.radial_velocity("star", times=found.t[3])
    assert at.shape == ()
    assert at.value == pytest.approx(expected[3], abs=1e-9 * K)


def test_a_star_has_its_velocity_where_mergers_were_sought_and_none_was():
    bodies = system()
    sought = orbits.events.Collision(then=orbits.events.Merge())
    with_them, without = (
        orbits.propagate(bodies, duration=4 * u.day, samples=5, **more) for more in ({"events": sought}, {})
    )
    np.testing.assert_array_equal(with_them.radial_velocity("star"), without.radial_velocity("star"))
    wide = bodies.replaced(radii=bodies.radii + [0.0, 3.4e5, 3.4e5, 0.0] * u.km)  # b and c touch when they pass
    merged = orbits.propagate(wide, duration=4 * u.day, samples=5, events=sought)
    assert len(merged.legs) > 1
    with pytest.raises(InputError, match="massive bodies merge or are changed"):
        merged.radial_velocity("star")


def test_a_star_that_loses_mass_has_its_velocity_about_the_barycentre_of_the_masses_that_are_left():
    star = orbits.System.from_elements({"star": {"mass": 1 * u.M_sun}}, epoch=EPOCH)
    pair = star.add("p", mass=0.3 * u.M_sun, a=1 * u.au, e=0.2, inc=90 * u.deg, frame="sky")
    pair = pair.with_forces(orbits.terms.MassLoss(source="star", fraction=-0.5 / u.yr))
    run = orbits.propagate(pair, duration=1 * u.yr, samples=5)
    receding = run.v.value[:, 1, 2] - run.v.value[:, 0, 2]
    left = 1.0 - 0.5 * run.t.to_value(u.yr)
    expected = (0.3 / (left + 0.3) * receding * u.au / u.day).to_value(u.m / u.s)
    np.testing.assert_allclose(run.radial_velocity("star").to_value(u.m / u.s), expected, rtol=1e-12)
    np.testing.assert_array_equal(run.radial_velocity("star", times=run.t[3]), run.radial_velocity("star")[3])


def test_transits_outlive_an_archive(tmp_path, run):
    path = tmp_path / "run.h5"
    sought = Transit("b", "star", observer=orbits.along(inc=10 * u.deg, node=1.0))
    orbits.propagate(system(), duration=5 * u.day, events=sought, archive=path)
    resumed = orbits.resume(path)
    assert len(resumed.events) == 0  # ten degrees from the pole nothing transits


def test_what_cannot_be_seen_is_refused(run):
    for line in (orbits.along(inc=20 * u.deg), orbits.along(inc=0.5 * u.deg, node=90 * u.deg)):
        with pytest.raises(InputError, match=r"sought along another line of sight"):
            run.transits("b", line)
    with pytest.raises(InputError, match=r"'star' has none at the times of these.*events=orbits.events.Transit"):
        run.transits("star")
    with pytest.raises(UnknownNameError, match="'x'"):
        run.transits("x")
    with pytest.raises(InputError, match=r"along is 'Earth'; expected a line of sight, such as orbits.along"):
        run.radial_velocity("star", "Earth")
    with pytest.raises(InputError, match=r"Opposition of 'b' and 'star' has observer="):
        Opposition("b", "star", observer=orbits.along())
    with pytest.raises(InputError, match=r"Transit.observer is .*; expected a line of sight"):
        Transit("b", "star", observer=(1.0, 1.0, 0.0))
    with pytest.raises(InputError, match=r"observer=orbits.along\(inc=...\)"):
        Occultation("b", "star")
    with pytest.raises(InputError, match=r"Transit: 'b' twice; expected two bodies"):
        Transit("b", "b", observer=orbits.along())
    for wrong in ([1, 2] * u.deg, np.nan * u.deg):
        with pytest.raises(InputError, match=r"inc must be "):
            orbits.along(inc=wrong)
    with pytest.raises(InputError, match=r"inc is 89.7, 89.7 radians; expected -pi to pi, or degrees"):
        orbits.along(inc=89.7)
    assert orbits.along(inc=270 * u.deg) == pytest.approx((0.0, -1.0, 0.0), abs=1e-15)  # as of -90 degrees
    assert str(orbits.along(inc=0 * u.deg)) == "an observer at infinity towards (0, 0, 1)"


def test_each_event_has_a_table_of_its_own(tmp_path):
    lines = orbits.along(), orbits.along(inc=0.1 * u.deg, node=180 * u.deg)
    sought = [Transit("b", "star", observer=line) for line in lines]
    both = orbits.propagate(system(), duration=10 * u.day, events=sought)
    with pytest.raises(InputError, match=r"'b' has those of 2 events, of star, an observer at infinity towards"):
        both.transits("b")
    for line, event in zip(lines, sought, strict=True):
        alone = orbits.propagate(system(), duration=10 * u.day, events=event).transits("b")
        assert len(alone) == 6
        for column in ("time", "duration", "impact_parameter"):
            np.testing.assert_array_equal(both.transits("b", line)[column], alone[column])
        assert tuple(alone.meta["line_of_sight"]) == tuple(line)
    with pytest.raises(InputError, match=r"those of 2 events"):
        orbits.propagate(system(), duration=3 * u.day, events=[sought[0], sought[0]]).transits("b")
    stored = orbits.propagate(system(), duration=10 * u.day, events=sought, archive=tmp_path / "run.h5")
    again = orbits.Trajectory.open(tmp_path / "run.h5").transits("b", lines[1])
    np.testing.assert_array_equal(again["impact_parameter"], stored.transits("b", lines[1])["impact_parameter"])


def test_the_impact_parameter_is_that_of_the_light():
    """Measured as the event sees both; without the time of the light it is 0.14 per cent larger."""
    event = Transit("b", "star", observer=orbits.along(), apparent=True)
    moving = orbits.propagate(system(), duration=3 * u.day, events=event)
    table = moving.transits("b")
    sight = event.sight(moving.system)
    state = moving.at(table["time"])
    a, b, *_ = sight.of(state.q.value, state.v.value)
    expected = sight.apart(a, b) / moving.system.radii.value[0]
    np.testing.assert_allclose(table["impact_parameter"], expected, rtol=1e-12)


def test_the_impact_parameter_is_in_radii_of_the_star_whoever_merged_before():
    """A body that stands before the star falls into it before the first transit, which leaves the others' places."""
    bodies = system()
    fallen = orbits.System(
        ["stone", *bodies.names],
        np.append(1e-15 * bodies.values.gm[0], bodies.values.gm),
        np.vstack([[0, 1.2e-3, 0], bodies.values.q]),
        np.vstack([[0, -0.02, 0], bodies.values.v]),
        epoch=EPOCH,
        units=bodies.units,
        radii=np.append(1e-8, bodies.radii.value),
    )
    sought = [Transit("b", "star", observer=orbits.along())]
    alone = orbits.propagate(bodies, duration=3 * u.day, events=sought).transits("b")
    merging = orbits.events.Collision(then=orbits.events.Merge())
    run = orbits.propagate(fallen, duration=3 * u.day, events=[*sought, merging])
    assert run.legs[-1].time < alone["time"][0]
    np.testing.assert_allclose(run.transits("b")["impact_parameter"], alone["impact_parameter"], rtol=1e-9)


def test_transits_of_circles_seen_edge_on_are_found_wherever_rounding_puts_the_pericentre():
    """The vector to the pericentre of a circle is rounding, which may lie across the orbit alone: 15 of these did."""
    rng, gm, a = np.random.default_rng(1), 2.36e-4, 0.0531
    n = np.sqrt(gm / a**3)
    phase = rng.uniform(-np.pi, np.pi, 20_000)
    across, sideways = 1e-18 * rng.normal(size=(2, len(phase)))
    q = np.stack([a * np.sin(phase), across, a * np.cos(phase)], axis=1)
    v = np.stack([n * a * np.cos(phase), sideways, -n * a * np.sin(phase)], axis=1)
    found = mid_transits(np.full(len(phase), gm), q, v, np.array([0.0, 0.0, 1.0]))
    assert np.abs(found + phase / n).max() < 1e-14  # 4e-15 was reached, of periods of 5
