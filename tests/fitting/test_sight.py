"""What observers should see: beside `run.ephemeris`, and the bending of light at its limits."""

from __future__ import annotations

import erfa
import numpy as np
import pytest
from astropy.time import Time

import orbits
from orbits.astrometry.record import Place, Record
from orbits.errors import ConvergenceError
from orbits.fitting.sight import ARCSECONDS, Sight
from orbits.observing.stations import stations
from orbits.propagation.variations.arc import Arc
from tests.fitting.skies import places, start

MAS = 1e-3 / ARCSECONDS


def test_directions_without_bending_are_those_of_an_ephemeris():
    """`run.ephemeris` iterates light time on its own arcs and places the Earth by its own run."""
    rows = places(10.0, 120)
    records = tuple(Record(1, "optical", "433", jd, 0.0, station, ra=ra, dec=dec) for station, jd, ra, dec in rows)
    times = Time([row[1] for row in rows], format="jd", scale="utc").tdb
    sight = Sight(records, times, start().epoch)
    sight.sun = sight.sun + 1e9  # so far away that it bends nothing
    system, delay = start(), np.zeros(len(rows))
    x = np.concatenate([system.values.q[-1], system.values.v[-1]])
    for _ in range(4):
        seen = sight.seen(*Arc(system, "433").states(x, sight.days - delay), delay)
        delay = seen.delay
    # Reached: 5e-7 mas.
    assert np.abs(sight.residuals(seen)).max() < 2e-9


def test_light_of_a_near_body_is_bent_less_than_that_of_stars():
    """At 90 degrees from the Sun and 1 au from it, that of stars is bent by 4.07 mas away from the Sun."""
    record = Record(1, "optical", "x", 2455000.5, 0.0, "500", place=Place(0.0, 0.0, 0.0, False), ra=0.0, dec=0.0)
    time = Time([2455000.5], format="jd", scale="tdb")
    sight = Sight((record,), time, time[0])
    sight.here, sight.sun = np.zeros((1, 3)), np.array([[0.0, 1.0, 0.0]])
    at_rest, no_delay = np.zeros((1, 3)), np.zeros(1)
    shift = [
        float(sight.seen(np.array([[distance, 0.0, 0.0]]), at_rest, no_delay).direction[0, 1]) / MAS
        for distance in (1e-5, 1e7)
    ]
    # Against catalogued stars, an unbent direction is nearer to the Sun.
    assert shift[0] == pytest.approx(4.07, abs=0.01)
    assert abs(shift[1]) < 1e-3


def test_derivatives_of_directions_are_differences():
    rng = np.random.default_rng(1)
    records = tuple(Record(1, "optical", "x", 2455000.5, 0.0, "500", ra=40.0 + k, dec=k - 10.0) for k in range(20))
    time = Time(np.full(20, 2455000.5), format="jd", scale="tdb")
    sight = Sight(records, time, time[0])
    # As much as some degrees off the measured places, where an outlier may be.
    q = sight.here + (1.5 + rng.random(20))[:, None] * (sight.measured + 0.05 * rng.standard_normal((20, 3)))
    v, delay = 0.01 * rng.standard_normal((20, 3)), np.full(20, 0.01)
    found = sight.derivatives(sight.seen(q, v, delay), np.repeat(np.eye(3)[None], 20, axis=0))
    for k in range(3):
        step = 1e-6 * np.eye(3)[k]
        # Residuals are observed less computed.
        before, after = (sight.residuals(sight.seen(q + sign * step, v, delay)) for sign in (-1, 1))
        change = (before - after) / 2e-6
        # Reached: 1e-7, as the bending is held.
        assert np.abs(found[:, :, k] - change).max() < 1e-6 * np.abs(found).max()


def test_a_start_of_nine_au_a_day_is_followed_along_its_line():
    """As a step of the correction may lead to, with relativity, whose rounding is then more than the tolerance of
    accelerations of 1e-8 au/d^2, by which the body leaves the line.
    """
    far, times = np.array([-11.6, -110.8, 137.0, -1.0, -2.6, 9.0]), np.array([-3.0, 5.0, 16.0])
    q, v = Arc(start(), "433").states(far, times)
    assert np.abs(q - far[:3] - times[:, None] * far[3:]).max() < 0.5 * 1e-8 * 16.0**2
    assert np.abs(v - far[3:]).max() < 1e-8 * 16.0


def test_a_start_that_no_body_has_is_refused_before_long():
    """As a correction towards a place of another body led to; rounding far from the Sun makes its steps endless."""
    far = np.array([-436.00464333, 476.17092766, 258.68832885, 5.94197588, -8.55303672, -3.96000396])
    with pytest.raises(ConvergenceError, match=r"433: the motion through 60 d of observations takes too many steps"):
        Arc(start(), "433").states(far, np.array([60.0]))


def test_an_arc_covers_both_sides_of_its_epoch():
    arc = Arc(orbits.System.in_ephemeris(epoch="2010-06-01").add("x", primary="Sun", a=1.5, e=0.1), "x")
    x = np.concatenate([arc.system.values.q[-1], arc.system.values.v[-1]])
    q, v = arc.states(x, np.array([-1e-3, 0.0, 1e-3]))
    assert (q[1] == x[:3]).all()
    assert np.abs((q[2] - q[0]) / 2e-3 - v[1]).max() < 1e-9


def test_stations_before_the_tables_of_the_earth_are_turned_by_the_clocks_of_observers(recwarn):
    """Earlier times are UT: that of 1938 is 34 s from dynamical time less what is held from 1962."""
    text = "99942K04M04N  C1938 11 28.00000 04 06 08.08 +16 55 04.6                om6394691"
    observations = orbits.Observations.parse(text)
    times, place = observations.time, stations()["691"].x
    sight = Sight(observations.records, times, times[0])
    earth = orbits.ephemeris.tracks(["Earth"], times.jd1, times.jd2)[0][0, 0]
    turn = erfa.c2t06a(times.jd1[0], times.jd2[0], 2429230.5, 0.0, 0.0, 0.0)
    assert np.abs(sight.here[0] - earth - turn.T @ place).max() < 1e-12
    assert not recwarn.list
