"""Radar: beside a calculation by way of astropy, and measurements beside JPL's orbit of Apophis."""

from __future__ import annotations

import numpy as np
import pytest
from astropy import units as u
from astropy.coordinates import EarthLocation
from astropy.time import Time
from astropy.utils.iers import earth_orientation_table

import orbits
from orbits.astrometry.observations import Observations
from orbits.ephemeris import AU_KM
from orbits.errors import OrbitsWarning
from orbits.fitting.echoes import Echoes
from orbits.fitting.fitted_orbit import _instruments
from orbits.observing.earth import tables
from orbits.observing.stations import stations
from orbits.plotting.residuals import of_residuals
from orbits.propagation.variations.arc import Arc

from .skies import observed, start, state

LIGHT, GM_OF_SUN = 299792.458, 132712440041.279419
"""km/s, km^3/s^2 (DE440)."""

KINDS = "permID|trx|rcv|obsTime|delay|rmsDelay|doppler|rmsDoppler|frq|com"
ROWS = (
    "433|251|253|2013-01-10T08:00:00Z|97|1|0|1|8560|1",
    "433|253|251|2006-05-06T12:49:00Z|97|1|0|1|2380|0",
    "433|253|253|2021-03-03T06:40:00Z|97|1|0|1|8560|1",
)


def place_of(code: str, time: Time) -> np.ndarray:
    """Return where an antenna is relative to the barycentre, km, by way of astropy's own rotation of the Earth."""
    earth = orbits.ephemeris.tracks(["Earth"], [time.tdb.jd1], [time.tdb.jd2])[0][0, 0] * AU_KM
    return earth + site(code).get_gcrs_posvel(time)[0].xyz.to_value(u.km)


def site(code: str) -> EarthLocation:
    return EarthLocation.from_geocentric(*(stations()[code].x * AU_KM), unit=u.km)


def leg(bounce: np.ndarray, here: np.ndarray, sun: np.ndarray) -> float:
    """Return the seconds of a way, with the delay by the field of the Sun."""
    way = np.linalg.norm(bounce - here)
    ends = np.linalg.norm(bounce - sun) + np.linalg.norm(here - sun)
    return way / LIGHT + 2 * GM_OF_SUN / LIGHT**3 * np.log((ends + way) / (ends - way))


def delay_of(one, received: Time, q: np.ndarray, v: np.ndarray, zero: Time) -> float:
    """Return the seconds between transmission and reception, by clocks at the antennas, for a body on a line."""
    sun = orbits.ephemeris.tracks(["Sun"], [received.tdb.jd1], [received.tdb.jd2])[0][0, 0] * AU_KM
    since = float((received.tdb - zero).to_value(u.s))
    down = up = 0.0
    for _ in range(4):  # each leaves 1e-4 of the error before it, the speed of what moves over that of light
        bounce = q + v * (since - down)
        down = leg(bounce, place_of(one.station, received), sun)
        sent = received.tdb - (down + up) * u.s
        up = leg(bounce, place_of(one.transmitter, sent), sun)
    clocks = [Time(received, location=site(one.station)).tt, Time(sent, location=site(one.transmitter)).tt]
    less = [86400.0 * (a.jd2 - b.jd2 + (a.jd1 - b.jd1)) for a, b in zip(clocks, (received.tdb, sent), strict=True)]
    return down + up + less[0] - less[1]


def test_delays_and_shifts_are_those_of_a_calculation_of_its_own():
    """Its shift is a difference of delays within 10 s; it turns the Earth, and its clocks, by astropy."""
    records = Observations.parse("\n".join([KINDS, *ROWS])).records
    times = Observations(records).time
    radius = 0.2 / AU_KM
    echoes = Echoes(records, times, times[0], radius)
    earth = orbits.ephemeris.tracks(["Earth"], times.jd1, times.jd2)[0][:, 0]
    q, v = earth + np.array([0.05, -0.08, 0.03]), np.tile([0.006, 0.011, 0.003], (len(records), 1))
    delay = np.full(len(records), 5.7e-4)
    found = echoes.seen(q, v, delay).value
    for k, one in enumerate(records):
        zero = times[k] - delay[k] * u.day
        line = q[k] * AU_KM, v[k] * AU_KM / 86400.0, zero
        with earth_orientation_table.set(tables()[-1].table):  # which astropy would read once more, for seconds
            took = [delay_of(one, times[k] + x * u.s, *line) for x in (-5.0, 0.0, 5.0)]
        if one.kind == "delay":
            less = 2 * 0.2 / LIGHT if one.surface else 0.0
            # Reached: 1e-5 microseconds, 2 mm each way.
            assert found[k] == pytest.approx((took[1] - less) * 1e6, abs=1e-4)
        else:
            # Reached: 3e-3 Hz, as the velocities of antennas leave out how the axis of the Earth moves, 0.05 mm/s.
            assert found[k] == pytest.approx(-one.frequency * 1e6 * (took[2] - took[0]) / 10.0, abs=5e-3)


def test_derivatives_of_echoes_are_differences():
    records = Observations.parse("\n".join([KINDS, *ROWS])).records
    times = Observations(records).time
    echoes = Echoes(records, times, times[0], 0.0)
    earth = orbits.ephemeris.tracks(["Earth"], times.jd1, times.jd2)[0][:, 0]
    q, v = earth + np.array([0.05, -0.08, 0.03]), np.tile([0.006, 0.011, 0.003], (len(records), 1))
    delay = np.full(len(records), 5.7e-4)
    found = echoes.derivatives(echoes.seen(q, v, delay), np.repeat(np.eye(6)[None], len(records), axis=0))[:, 0]
    for k, step in enumerate([1e-7] * 3 + [1e-7] * 3):
        move = step * np.eye(6)[k]
        ends = [echoes.seen(q + sign * move[:3], v + sign * move[3:], delay).value for sign in (-1, 1)]
        # The times of bounce and transmission are held, which costs as much as the speed of light: 1e-4.
        assert np.abs(found[:, k] - (ends[1] - ends[0]) / (2 * step)).max() < 3e-4 * np.abs(found).max()


JPL = Time(2456323.5, format="jd", scale="tdb"), [-0.6885941010606326, 0.7853011708041518, 0.2744012411423299], [
    *(-0.01236352140633316, -0.007926849409608376, -0.003263604704470501)]  # fmt: skip
"""Apophis at JD 2456323.5 TDB, relative to the barycentre, ICRF, au and au/d: JPL Horizons, DE441."""


def test_measurements_of_apophis_are_where_its_orbit_by_jpl_has_them():
    """All delays are longer by about 0.3 microseconds, 40 m each way, which a fit takes off.

    Asteroids are left out, and the drift by heat: A2 = -2.9e-14 au/d^2 moves it by 8 m in 60 d.
    """
    day, q, v = JPL
    system = orbits.System.in_ephemeris(epoch=day).add("99942", q=q * u.au, v=v * u.au / u.day)
    observations = Observations.bundled("apophis")
    some = observations[(observations.kind != "optical") & (abs(observations.time - system.epoch) < 60 * u.day)]
    echoes, arc = Echoes(some.records, some.time, system.epoch, 0.0), Arc(system, "99942")
    seen = echoes.seen(*arc.states(state(system, "99942"), echoes.days), np.zeros(len(some)))
    seen = echoes.seen(*arc.states(state(system, "99942"), echoes.days - seen.delay), seen.delay)
    ratio = echoes.residuals(seen)[:, 0] / [one.sigma * (1e6 if one.kind == "delay" else 1.0) for one in some.records]
    delays = some.kind == "delay"
    assert (len(some), delays.sum()) == (39, 15)
    # Reached: 0.39, and 1.49 of sigmas that are 0.25 microseconds as a rule, 40 m.
    assert np.sqrt(np.mean(ratio[~delays] ** 2)) < 0.5
    assert np.sqrt(np.mean(ratio[delays] ** 2)) < 1.8


def test_delays_to_a_surface_without_a_radius_are_told():
    system = orbits.System.in_ephemeris(epoch="2013-01-30").add("433", primary="Sun", a=1.5 * u.au, e=0.1)
    given = Observations.parse("\n".join([KINDS, *(row.replace("|1|8560|1", "|1|8560|0") for row in ROWS)]))
    with pytest.warns(OrbitsWarning, match="delays of 433 were measured to its surface, whose radius is not given"):
        _instruments(given, system, "433")


def test_radar_that_is_rejected_is_told():
    """Four delays in an hour, of which one is half a millisecond longer than the others leave room for."""
    rows = [f"433|253|253|2010-06-05T0{k}:00:00Z|97|1|||8560|1" for k in range(4)]
    given = Observations.parse("\n".join([KINDS, *rows]))
    echoes, arc = Echoes(given.records, given.time, start().epoch, 0.0), Arc(start(), "433")
    seen = echoes.seen(*arc.states(state(start()), echoes.days), np.zeros(4))
    for _ in range(2):
        seen = echoes.seen(*arc.states(state(start()), echoes.days - seen.delay), seen.delay)
    values = 1e-6 * seen.value + [0.0, 0.0, 5e-4, 0.0]
    radar = Observations(tuple(one._replace(value=x) for one, x in zip(given.records, values, strict=True)))
    with pytest.warns(OrbitsWarning, match=r"1 of 4 delays, by up to \d+ us .chi-squared [0-9e+.]+") as told:
        fit = orbits.fit(observed(np.zeros((60, 2)), 2.0) + radar, start())
    assert "Does it lack a force, such as parameters=" in str(told[0].message)
    assert np.flatnonzero(~fit.used).tolist() == [62]
    assert "4 delays, 1 rejected, RMS 0." in repr(fit)
    assert "4 delays, 1 rejected" in fit.plot().axes[0].get_title(loc="left")
    of_radar = of_residuals(fit.residuals[fit.residuals["kind"] == "delay"], "radar alone")
    assert [panel.get_ylabel() for panel in of_radar.axes] == ["delay [us]"]  # no empty ones of right ascension
