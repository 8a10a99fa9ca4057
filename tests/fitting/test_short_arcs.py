"""First orbits from a few nights, on which more than one may fit: the right one is found, or a warning lists it."""

from __future__ import annotations

import re
import warnings
from functools import cache

import numpy as np
import pytest
from astropy import units as u
from astropy.time import Time

import orbits
from orbits.errors import ConvergenceError, InputError, OrbitsWarning
from orbits.fitting.result import Fit
from orbits.observing.three_directions import triples

from ..coverings import each, first
from .skies import mahalanobis, state

EPOCH, MIDNIGHT, SIGMA = "2012-03-01", 2455987.5, 0.3
THREE, SIX = (2.0, 12.0, 22.0), (2.0, 2.05, 6.0, 6.05, 10.0, 10.05)


def parsed(rows: list[tuple[float, float, float]]) -> orbits.Observations:
    lines = ["permID|stn|obsTime|ra|dec|rmsRA|rmsDec|astCat|mode"]
    for jd, ra, dec in rows:
        time = Time(jd, format="jd", scale="utc", precision=4).isot
        lines.append(f"433|568|{time}Z|{ra % 360:.12f}|{dec:.12f}|{SIGMA}|{SIGMA}|Gaia2|CCD")
    return orbits.Observations.parse("\n".join(lines))


@cache
def seen(orbit: tuple[float, ...], days: tuple[float, ...], seed: int) -> tuple[orbits.Observations, orbits.Trajectory]:
    """Return observations of an orbit (a, e, inc, Omega, omega, M), and its run."""
    elements = dict(zip(("inc", "Omega", "omega", "M"), orbit[2:] * u.deg, strict=True))
    system = orbits.System.in_ephemeris(epoch=EPOCH).add(
        "433", primary="Sun", a=orbit[0] * u.au, e=orbit[1], **elements
    )
    run = orbits.propagate(system, duration=(max(days) + 1) * u.day, samples=2, dense=True)
    jd = MIDNIGHT + np.array(days)
    places = run.ephemeris("433", observer="568", times=Time(jd, format="jd", scale="utc"))
    errors = np.random.default_rng(seed).normal(0.0, SIGMA / 3600, (len(jd), 2))
    ra, dec = places.ra.to_value(u.deg), places.dec.to_value(u.deg)
    ra = ra + errors[:, 0] / np.cos(np.deg2rad(dec))
    return parsed(list(zip(jd.tolist(), ra.tolist(), (dec + errors[:, 1]).tolist(), strict=True))), run


def fitted(observations: orbits.Observations) -> tuple[Fit, str]:
    """Return a fit, and what it warned of."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        fit = orbits.fit(observations)
    return fit, "\n".join(str(one.message) for one in told)


MIDDLE_BELT = (2.5, 0.15, 8.0, 80.0, 40.0, 120.0)


@pytest.mark.nightly
def test_the_root_that_fits_best_is_taken_not_the_nearest_one():
    """Six observations in eight days; a nearer root, a = 0.79 au, has a normalized RMS of 0.65."""
    observations, run = seen(MIDDLE_BELT, SIX, 0)
    with pytest.warns(OrbitsWarning, match="observations of 433 do not decide between 2 orbits") as told:
        fit = orbits.fit(observations)
    assert mahalanobis(fit, state(run.at(fit.epoch))) < 22.5
    assert fit.covariance("keplerian").values[0] == pytest.approx(2.2, abs=0.05)
    first, second, *_ = fit.roots
    assert (first.rms, second.rms) == (pytest.approx(0.484, abs=1e-3), pytest.approx(0.646, abs=1e-3))
    assert (first.a, first.e) == pytest.approx(fit.covariance("keplerian").values[:2], rel=1e-6)
    assert second.a == pytest.approx(0.792, abs=1e-3)
    text = str(told[0].message)
    assert re.search(r"a = 0\.7919 au, e = 0\.703, 0\.\d+ au away: normalized RMS 0\.646", text)
    assert second.distance < 1.0 < 2.5 < first.distance
    assert "The first is taken, which has the least" in text
    assert "More observations, of other nights, decide; or give a start" in text


@pytest.mark.parametrize("days", [THREE, SIX])
@pytest.mark.parametrize("seed", [2, pytest.param(5, marks=pytest.mark.slow), pytest.param(6, marks=pytest.mark.slow)])
def test_the_right_orbit_of_a_short_arc_is_found_or_in_the_warning(days, seed):
    rng = np.random.default_rng(100 + seed)
    orbit = (rng.uniform(0.9, 3.2), rng.uniform(0.0, 0.5), rng.uniform(0.5, 30.0), *rng.uniform(0.0, 360.0, 3))
    observations, run = seen(tuple(map(float, orbit)), days, seed)
    fit, told = fitted(observations)
    assert mahalanobis(fit, state(run.at(fit.epoch))) < 30.0 or "do not decide between" in told


@pytest.mark.nightly
def test_three_observations_do_not_decide_between_orbits_through_all_of_them():
    observations, _ = seen(MIDDLE_BELT, SIX, 0)
    fit, told = fitted(observations[[0, 2, 4]])
    near = [one for one in fit.roots if one.rms < 1e-6]
    assert f"do not decide between {len(near)} orbits" in told
    assert len(near) > 1
    apart = [one for one in near if one.distance > 0.05]
    assert [one.e for one in apart] == sorted(one.e for one in apart)
    assert fit.covariance("keplerian").values[1] == pytest.approx(apart[0].e, rel=1e-6)


def test_observations_of_two_nights_or_of_one_place_say_what_is_missing():
    rows = [(MIDNIGHT + day, 100.0 + 0.01 * k, 5.0) for k, day in enumerate((2.0, 2.03, 2.06, 3.0, 3.03, 3.06))]
    with pytest.raises(ConvergenceError, match="They are of 2 nights: three are needed at least, some days apart"):
        orbits.fit(parsed(rows))
    with pytest.raises(InputError, match="are of 1 time, which do not determine an orbit; expected 3 times at least"):
        orbits.fit(parsed([(MIDNIGHT, 100.0 + k, 5.0) for k in range(4)]))


def test_three_observations_are_chosen_at_three_times():
    days = 0.01 * np.array([0.0, 0.0, 0.0, 1.0, 2.0, 2.0])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        choices = list(triples(days))
    assert choices
    assert all(len(set(days[list(three)])) == 3 for three in choices)


@each("name", ["Sun", "Moon", "Earth"])
def test_a_body_called_as_one_of_the_ephemeris_is_refused(name):
    observations, _ = seen(MIDDLE_BELT, SIX, 0)
    renamed = orbits.Observations(tuple(one._replace(body=name) for one in observations.records))
    with pytest.raises(InputError, match=f"called '{name}', as one of the ephemeris; expected another name"):
        orbits.fit(renamed)


@pytest.mark.nightly
def test_few_observations_are_rejected_only_if_that_costs_less():
    """All good ones count; one that is an arcminute off does not, and takes no other along."""
    observations, _ = seen(MIDDLE_BELT, (*SIX, 14.0, 14.05), 1)
    fit, _ = fitted(observations)
    assert fit.used.all()
    wrong = observations.records[1]
    records = [*observations.records]
    records[1] = wrong._replace(dec=wrong.dec + 60.0 / 3600)
    fit, _ = fitted(orbits.Observations(tuple(records)))
    assert np.flatnonzero(~fit.used).tolist() == [1]


@pytest.mark.nightly
@pytest.mark.parametrize("days", [(2.0, 2.05, 3.0, 3.05), (2.0, 2.05, 2.1, 2.15, 2.2)], ids=len)
def test_one_night_or_two_warn_with_the_range_of_orbits(days):
    observations, run = seen(MIDDLE_BELT, days, 0)
    fit, told = fitted(observations)
    assert "observations of 433 leave a range of orbits, which the covariance does not tell" in told
    distance = [one.distance for one in fit.range]
    when = observations.time[[len(days) // 2]]
    true = run.ephemeris("433", observer="568", times=when).distance.to_value(u.au)[0]
    assert min(distance) < true < max(distance)
    assert all(one.e < 1.0 and one.chi2 <= 9.0 for one in fit.range)
    # From one end to the other.
    assert (np.diff(distance) > 0.0).all() or (np.diff(distance) < 0.0).all()


@pytest.mark.nightly
def test_an_outlier_in_the_middle_of_the_middle_night_does_not_hide_the_orbit():
    observations, run = seen(MIDDLE_BELT, (2.0, 2.05, 2.1, 6.0, 6.05, 6.1, 10.0, 10.05, 10.1), 1)
    records = [*observations.records]
    records[4] = records[4]._replace(dec=records[4].dec + 60.0 / 3600)
    fit, _ = fitted(orbits.Observations(tuple(records)))
    assert np.flatnonzero(~fit.used).tolist() == [4]
    assert mahalanobis(fit, state(run.at(fit.epoch))) < 22.5


LONGER = (0.0, 0.05, 5.0, 5.05, 20.0, 20.1, 60.0, 60.05, 105.0, 105.1)
SHORTER = (0.0, 0.05, 3.0, 3.05, 10.0, 10.1, 25.0, 25.05, 60.0, 60.1)


@pytest.mark.parametrize(("days", "place"), first(1, [(LONGER, 4), (SHORTER, 9), (SHORTER, 4), (SHORTER, 0)]))
def test_a_place_of_another_body_is_rejected_whichever_it_is(days, place):
    """It is 120 degrees off; an orbit through it is one of many au a day, whose march has no end."""
    observations, run = seen(MIDDLE_BELT, days, 1)
    fit, _ = fitted(displaced(observations, place))
    assert np.flatnonzero(~fit.used).tolist() == [place]
    assert "arcsec off" in fit.rejected["reason"][0]
    assert mahalanobis(fit, state(run.at(fit.epoch))) < 22.5


@pytest.mark.nightly
def test_a_place_of_another_body_is_rejected_with_a_start_too():
    observations, run = seen(MIDDLE_BELT, LONGER, 1)
    fit = orbits.fit(displaced(observations, 4), run[0])
    assert np.flatnonzero(~fit.used).tolist() == [4]


def displaced(observations: orbits.Observations, place: int) -> orbits.Observations:
    """Return observations of which one is 120 degrees off."""
    records = [*observations.records]
    records[place] = records[place]._replace(ra=(records[place].ra + 120.0) % 360.0)
    return orbits.Observations(tuple(records))


def test_an_orbit_close_to_a_parabola_is_no_range_of_orbits():
    """Its q and e are known to 2e-4; a relative to itself, q / (1 - e), is never known there."""
    elements = {"inc": 100 * u.deg, "Omega": 10 * u.deg, "omega": 50 * u.deg, "T": 100 * u.day}
    system = orbits.System.in_ephemeris(epoch=EPOCH).add("433", primary="Sun", q=0.8 * u.au, e=1.0, **elements)
    run = orbits.propagate(system, duration=72 * u.day, samples=2, dense=True)
    jd = MIDNIGHT + np.array([2.0, 3.0, 5.0, 9.0, 20.0, 30.0, 40.0, 55.0, 70.0])
    places = run.ephemeris("433", observer="568", times=Time(jd, format="jd", scale="utc"))
    rows = zip(jd.tolist(), places.ra.to_value(u.deg).tolist(), places.dec.to_value(u.deg).tolist(), strict=True)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fit = orbits.fit(parsed(list(rows)), system)
    assert fit.range == ()
    assert fit.covariance("cometary").sigma[:2].max() < 3e-4
    a, sigma = (x[0] for x in (fit.covariance("keplerian").values, fit.covariance("keplerian").sigma))
    assert sigma > 0.1 * abs(a)
