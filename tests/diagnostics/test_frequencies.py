"""Frequency analysis of series that are known, within the bounds that REBOUND's tests assert of its own."""

import json

import numpy as np
import pytest
from astropy import units as u

from orbits import diagnostics
from orbits.errors import InputError
from orbits.resources import data_path

from ..coverings import each, only

ARCSEC = np.pi / 180 / 3600
# Jupiter's eccentricity and perihelion in ten terms of Laskar (1990): arcseconds per year, millionths, degrees.
JUPITER = np.array(
    [
        (4.2488163, 44119, 30.676), (28.2206942, 15750, 308.112), (3.0895148, 1800, 121.362), (52.1925732, 516, 45.551),
        (27.0613982, 183, 218.696), (29.3799573, 178, 217.460), (28.8679427, 107, 32.614), (27.5734578, 95, 43.733),
        (5.4070444, 62, 116.984), (0.6671228, 58, 74.116),
    ]
)  # fmt: skip


def series(t, frequency, amplitude):
    return np.exp(1j * np.outer(t, frequency)) @ np.asarray(amplitude)


def jupiter(n=32768, start=0.0):
    t = start + np.arange(n) * 120_000 / 365.25
    frequency, size, phase = JUPITER[:, 0] * ARCSEC, JUPITER[:, 1] * 1e-6, np.radians(JUPITER[:, 2])
    amplitude = size * np.exp(1j * phase)
    return t, frequency, amplitude, series(t, frequency, amplitude)


@pytest.mark.nightly
@pytest.mark.parametrize("window", only([1], [0, 1, 3]))
def test_ten_terms_of_jupiter_are_found_far_within_the_bounds_of_rebounds_best_method(window):
    rows = json.loads(data_path("rebound_test_bounds.json").read_text())["tests"]
    bounds = {row["name"]: row["asserts"] for row in rows}
    assert "fmft2 2e-8 arcsec/yr" in bounds["test_frequency_analysis"]
    t, frequency, amplitude, z = jupiter()
    found = diagnostics.frequency_analysis(t, z, 10, band=(-60 * ARCSEC, 60 * ARCSEC), window=window)
    # Reached: 4e-14, 2e-13 and 3e-11 degrees; REBOUND's asserts 3e-7 of amplitudes and 5e-5 degrees of phases.
    assert np.abs(found.frequency - frequency).max() / ARCSEC < 2e-13
    assert np.abs(found.amplitude / amplitude - 1).max() < 2e-12
    assert np.degrees(np.abs(np.angle(found.amplitude / amplitude))).max() < 2e-10
    assert found.residual < 1e-13
    assert np.abs(found.series(t) - z).max() < 1e-14


def test_terms_are_given_by_size_and_no_more_than_there_are():
    t, frequency = np.arange(2048) * 0.25, np.array([0.5, -1.25, 0.8, 2.1])
    found = diagnostics.frequency_analysis(t, series(t, frequency, [0.1, 2.0, 1.0j, -0.02]), 7)
    assert len(found) == 4
    assert (np.diff(np.abs(found.amplitude)) < 0).all()
    assert found.frequency == pytest.approx(frequency[[1, 2, 0, 3]], rel=1e-12)


def test_a_term_hidden_beside_one_a_million_times_larger_is_found_by_correcting_both_together():
    """A transform knows frequencies to 1.0 here; the terms are 3.3 apart. The weak one alone would be 3e-4 off."""
    t = np.arange(4096) * 2 * np.pi / 4096
    frequency, amplitude = np.array([10.2, 13.5]), np.array([1.0, 1e-6j])
    found = diagnostics.frequency_analysis(t, series(t, frequency, amplitude), 2)
    assert found.resolution == pytest.approx(1.0)
    assert found.frequency == pytest.approx(frequency, abs=1e-8)  # reached: 1e-10, 1e-16 of amplitude 1 against 1e-6
    assert found.amplitude == pytest.approx(amplitude, abs=1e-13)


def test_what_else_is_in_a_series_displaces_terms_by_little_and_is_told_as_residual():
    t, frequency, amplitude, z = jupiter()
    found = diagnostics.frequency_analysis(t, z, 2)
    # All others, 12 % of the second term, are more than nine resolutions from it, where the window lets 1e-3 through.
    assert np.abs(found.frequency - frequency[:2]).max() / ARCSEC < 1e-4
    rest = np.sqrt(np.sum(np.abs(amplitude[2:]) ** 2) / np.sum(np.abs(amplitude) ** 2))
    assert found.residual == pytest.approx(rest, rel=0.1)


def test_phases_are_those_at_time_zero_wherever_a_series_begins_and_whichever_way_it_goes():
    t, frequency, amplitude, z = jupiter(8192, start=-2e6)
    for order in (slice(None), slice(None, None, -1)):
        found = diagnostics.frequency_analysis(t[order], z[order], 4)
        assert found.frequency[:3] == pytest.approx(frequency[:3], rel=1e-3)
        assert np.abs(np.angle(found.amplitude[:2] / amplitude[:2])).max() < 0.02
    exact = diagnostics.frequency_analysis(t, series(t, frequency[:4], amplitude[:4]), 4)
    assert np.abs(exact.amplitude / amplitude[:4] - 1).max() < 1e-9


def test_a_term_whose_frequency_drifts_does_not_become_two_that_cancel():
    """A drift by one resolution over the series: two terms fitted to it beat with amplitudes above that of the term."""
    n = 4096
    t = np.arange(n) * 2 * np.pi / n
    z = np.exp(1j * (50.0 * t + 0.5 * 0.5 * (t - np.pi) ** 2 / np.pi))
    found = diagnostics.frequency_analysis(t, z, 5)
    assert np.abs(found.amplitude).max() < 1.0
    assert found.frequency[0] == pytest.approx(50.0, abs=0.5)
    apart = np.abs(np.subtract.outer(found.frequency, found.frequency)) + 1e9 * np.eye(5)
    assert apart.min() >= found.resolution


def test_an_oscillation_of_real_numbers_has_a_term_of_either_sign():
    t = np.linspace(0.0, 100.0, 2001)
    found = diagnostics.frequency_analysis(t, 0.5 + np.cos(3.0 * t + 0.4), 3)
    assert sorted(found.frequency) == pytest.approx([-3.0, 0.0, 3.0], abs=1e-10)
    assert 2 * abs(found.amplitude[found.frequency > 1.0][0]) == pytest.approx(1.0, abs=1e-10)


@pytest.mark.parametrize("below", [0.005, 0.001, 0.0, -0.003])
def test_a_term_beside_the_fastest_that_the_samples_resolve_is_found(below):
    """From both sides: half a turn in a sample, and less than that backwards, look alike."""
    k, frequency = np.arange(100), np.pi - below
    found = diagnostics.frequency_analysis(k, np.exp(1j * (frequency * k + 0.3)), 1)
    assert np.abs(found.frequency) <= np.pi
    assert np.exp(1j * found.frequency) == pytest.approx(np.exp(1j * frequency), abs=1e-13)
    assert found.amplitude == pytest.approx(np.exp(0.3j), abs=1e-11)


def test_a_series_of_zeros_has_no_terms():
    found = diagnostics.frequency_analysis(np.arange(64.0), np.zeros(64), 3)
    assert (len(found), found.residual) == (0, 0.0)


def test_a_band_leaves_out_what_is_outside_it():
    t, frequency, _, z = jupiter()
    found = diagnostics.frequency_analysis(t, z, 1, band=(10 * ARCSEC, 60 * ARCSEC))
    assert found.frequency == pytest.approx(frequency[1:2], rel=1e-4)


@each(
    ("changes", "message"),
    [
        ({"t": np.arange(100.0) ** 1.1}, "t is not evenly spaced: t\\[.*expected equal intervals"),
        ({"t": np.zeros(100)}, "t is not evenly spaced"),
        ({"t": np.arange(99.0)}, r"t and series have shapes \(99,\) and \(100,\)"),
        ({"series": np.full(100, np.nan)}, "series holds .*nan.*; expected finite values"),
        ({"series": np.array(["a"] * 100)}, "series holds str.*; expected complex or real numbers"),
        ({"series": [[1.0], [1.0, 2.0]]}, "series is .*; expected complex or real numbers"),
        ({"series": np.ma.masked_equal(np.arange(100.0), 5)}, "series is a masked array; expected numbers for all"),
        ({"terms": 0}, "terms"),
        ({"terms": 26}, "100 samples cannot tell 26 terms; expected at least 104, or fewer terms"),
        ({"window": -1}, "window"),
        ({"band": (1.0, 0.5)}, r"band is \(1.0, 0.5\); expected \(lowest, highest\) frequency"),
        ({"band": (-4.0, 4.0)}, "samples 1 apart resolve frequencies up to 3.14159"),
    ],
)
def test_series_that_cannot_be_analysed_are_refused(changes, message):
    given = {"t": np.arange(100.0), "series": np.exp(0.1j * np.arange(100.0)), **changes}
    with pytest.raises(InputError, match=message):
        diagnostics.frequency_analysis(**given)


def test_times_with_a_unit_are_refused_with_the_call_that_takes_it_off():
    with pytest.raises(InputError, match=r"t is in yr; expected plain numbers, such as run\.t\.to_value\(u\.yr\)"):
        diagnostics.frequency_analysis(np.arange(99.0) * u.yr, np.ones(99), 1)


def test_terms_are_printed_as_a_table_with_words_above_each_column():
    t = np.arange(4096) * 0.25
    found = diagnostics.frequency_analysis(t, series(t, [0.5, -1.25], [2.0 * np.exp(0.3j), 0.1]), terms=2)
    head, first, second, last = str(found).splitlines()
    assert head.split() == ["frequency", "period", "amplitude", "phase", "[rad]"]
    assert first.split() == ["0.5", "12.56637", "2", "0.3000"]
    assert [float(x) for x in second.split()] == pytest.approx([-1.25, 5.026548, 0.1, 0.0], abs=1e-7)
    assert "of the series is left; frequencies in radians per unit of time, resolution 0.00614" in last


@each("scale", [2.0**-900, 2.0**900])
def test_squares_of_tiny_and_huge_series_are_neither_lost_nor_infinite(scale):
    t = np.arange(400) * 0.25
    z = series(t, [0.5, -1.25], [2.0, 0.1])
    plain, found = diagnostics.frequency_analysis(t, z, 2), diagnostics.frequency_analysis(t, scale * z, 2)
    assert np.array_equal(found.frequency, plain.frequency)  # powers of two change no bit
    assert np.array_equal(found.amplitude, scale * plain.amplitude)


@each("half", [1e-4, 1e-8])
def test_a_band_narrower_than_the_spectrum_is_searched_has_its_term(half):
    """It had none, with all of the series left."""
    t = np.linspace(0.0, 100.0, 401)
    z = series(t, [1.3, -3.3], [2.0 * np.exp(0.5j), 0.1])
    for scale in (1.0, -1.0):
        band = sorted(scale * (1.3 + x) for x in (-half, 0.5 * half))
        found = diagnostics.frequency_analysis(scale * t, z, 2, band=band)
        assert len(found) == 1
        assert found.frequency[0] == pytest.approx(scale * 1.3, abs=1e-7)  # displaced by the other term, at 0.05 of it
        assert found.amplitude[0] == pytest.approx(2.0 * np.exp(0.5j), rel=1e-4)
