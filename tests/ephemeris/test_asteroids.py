"""The catalogue of real asteroids: what is in it, how to choose, and that its numbers mean what they should."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest

from orbits.catalogue import EPOCH_MJD, Catalogue, asteroids
from orbits.elements import ecliptic_to_icrf, elements_from_state, state_from_elements
from orbits.ephemeris import gm
from orbits.errors import InputError, UnknownNameError

from ..coverings import each


def heliocentric(catalogue: Catalogue) -> tuple[np.ndarray, np.ndarray]:
    return state_from_elements(
        gm(["Sun"])[0], a=catalogue.a, e=catalogue.e, inc=catalogue.inc, Omega=catalogue.Omega,
        omega=catalogue.omega, M=catalogue.M, names=catalogue.names)  # fmt: skip


def test_all_but_two_have_the_same_epoch_and_those_two_are_left_out() -> None:
    everything = asteroids()
    assert len(everything) == 2782 - 1 - 2
    assert everything.classes.count("TJN") == 497
    assert np.all(everything.epoch == EPOCH_MJD)
    assert len(set(everything.names)) == len(everything)
    others = asteroids(names=["1927 LA", "(1988 RH9)"])
    assert others.epoch.tolist() == [25051.0, 47411.0]
    assert others.numbers.tolist() == [0, 0]


def test_brightest_come_first() -> None:
    first = asteroids(10)
    assert first.names[:4] == ("Vesta", "Ceres", "Pallas", "Juno")
    assert np.all(np.diff(asteroids(1000).H) >= 0)
    assert asteroids(1000).H.max() <= np.partition(asteroids().H, 1000)[1000]


def test_ceres_is_where_it_belongs() -> None:
    ceres = asteroids(names="Ceres")
    q, v = heliocentric(ceres)
    assert 2.5 < np.linalg.norm(q[0]) < 3.0
    orbit = elements_from_state(q, v, gm(["Sun"])[0], t=EPOCH_MJD)
    assert orbit.a[0] == pytest.approx(2.7666, abs=1e-4)
    assert np.degrees(orbit.inc[0]) == pytest.approx(10.587, abs=1e-3)
    assert orbit.P[0] / 365.25 == pytest.approx(4.60, abs=0.01)
    # Published: perihelion on 2022 December 7, MJD 59920, at 2.549 au.
    assert orbit.T[0] == pytest.approx(59920.0, abs=1.0)
    assert orbit.q[0] == pytest.approx(2.5491, abs=1e-4)
    # Its orbit's pole, in the ICRF, is 10.6 degrees off the ecliptic's, not 34.
    pole = ecliptic_to_icrf(np.cross(q[0], v[0]))
    north = ecliptic_to_icrf([0.0, 0.0, 1.0])
    assert np.degrees(np.arccos(pole @ north / np.linalg.norm(pole))) == pytest.approx(10.587, abs=1e-3)


def test_belt_has_kirkwoods_gaps_and_trojans_share_jupiters_orbit() -> None:
    belt = asteroids(classes="belt")
    counts, _ = np.histogram(belt.a, [2.70, 2.80, 2.825 - 0.01, 2.825 + 0.01, 2.85, 2.95])
    # The 5:2 resonance with Jupiter, at 2.825 au, against its neighbourhoods five times as wide.
    assert counts[2] * 5 < 0.2 * min(counts[0], counts[4])
    trojans = asteroids(classes="trojan")
    assert len(trojans) == 497
    assert np.all((trojans.a > 5.0) & (trojans.a < 5.4))


def test_elements_are_read_to_the_last_digit() -> None:
    pallas = asteroids(names="Pallas")
    assert pallas.a[0] == 2.769463340774141
    assert pallas.e[0] == 0.229986445975499
    assert pallas.inc[0] == np.radians(34.92714126736759)
    assert pallas.Omega[0] == np.radians(172.9179047880803)
    assert pallas.omega[0] == np.radians(310.8426241527283)
    assert pallas.M[0] == np.radians(315.0911121671828)
    assert (pallas.numbers[0], pallas.H[0], pallas.classes[0], pallas.frame) == (2, 4.12, "MBA", "ecliptic")


@pytest.mark.parametrize("said", ["Ceres", "ceres", "1 Ceres", "1", "A801 AA", "1 Ceres (A801 AA)"])
def test_one_asteroid_has_many_names(said: str) -> None:
    assert asteroids(names=[said]).names == ("Ceres",)


def test_nameless_asteroids_go_by_designation() -> None:
    chosen = asteroids(names=["36922", "2000 SN209", "37298 (2001 BU80)"])
    assert chosen.names == ("2000 SN209", "2001 BU80")
    assert chosen.numbers.tolist() == [36922, 37298]


@each(
    ("chosen", "names"),
    [
        ({"names": ["Vesta", "Ceres", "Vesta"]}, ("Vesta", "Ceres")),
        ({"numbers": [4, 1]}, ("Vesta", "Ceres")),
        ({"numbers": np.arange(1, 4)}, ("Ceres", "Pallas", "Juno")),
        ({"numbers": 3}, ("Juno",)),
        ({"names": ["Pallas"], "numbers": [1]}, ("Pallas", "Ceres")),
        ({"brighter_than": 5}, ("Vesta", "Ceres", "Pallas")),
        ({"classes": ["TJN"], "count": 2}, ("Hektor", "Agamemnon")),
        ({"numbers": range(1, 11), "count": 2}, ("Vesta", "Ceres")),
        ({"names": ["Ceres", "Hektor"], "classes": "Trojans"}, ("Hektor",)),
        ({"brighter_than": 1.0}, ()),
    ],
)
def test_choosing_by_name_number_class_brightness_and_count(chosen: dict[str, Any], names: tuple[str, ...]) -> None:
    assert asteroids(**chosen).names == names


def test_classes_of_the_database_add_up_to_the_belt() -> None:
    parts = [len(asteroids(classes=code)) for code in ("IMB", "mba", "OMB", "MCA")]
    assert sum(parts) == len(asteroids(classes="belt")) == 2282


@each(
    ("chosen", "error", "message"),
    [
        ({"names": "Cerez"}, UnknownNameError, r"no asteroid 'Cerez' here; did you mean 'Ceres'.*2781"),
        ({"names": "Nonesuch body"}, UnknownNameError, r"no asteroid 'Nonesuch body' here\. Expected"),
        ({"numbers": [433]}, UnknownNameError, r"number 433 here; the closest are 43\d, 43\d, 43\d"),
        ({"numbers": [0]}, UnknownNameError, r"number 0 here; the closest are 1, 2, 3"),
        ({"classes": "NEA"}, UnknownNameError, r"no class 'NEA'.*'belt', 'trojan'.*IMB \(inner belt\)"),
        ({"count": 0}, InputError, "count = 0; expected a whole number"),
        ({"count": 2.5}, InputError, "count = 2.5"),
        ({"count": True}, InputError, "count = True"),
        ({"count": 5000}, InputError, "count = 5000, but there are only 2779"),
        ({"names": [3]}, InputError, r"names contains 3; expected strings .*numbers= takes numbers"),
        ({"numbers": ["Ceres"]}, InputError, "numbers contains 'Ceres'; expected whole numbers"),
        ({"brighter_than": np.nan}, InputError, "brighter_than = nan; expected an absolute magnitude"),
    ],
)
def test_what_is_not_there_is_refused_with_what_is(chosen: dict[str, Any], error: type, message: str) -> None:
    with pytest.raises(error, match=message):
        asteroids(**chosen)


def test_catalogue_is_sliced_masked_and_indexed_like_an_array() -> None:
    catalogue = asteroids(100)
    assert catalogue[:3].names == catalogue.names[:3]
    assert catalogue[-1].names == catalogue.names[-1:]
    assert catalogue[[2, 0]].names == (catalogue.names[2], catalogue.names[0])
    assert np.all(catalogue[catalogue.a > 3.0].a > 3.0)
    assert catalogue["ceres"].names == ("Ceres",)
    assert len(catalogue[:0]) == 0
    with pytest.raises(UnknownNameError, match="did you mean 'Vesta'"):
        catalogue["Vista"]
    with pytest.raises(IndexError):
        catalogue[100]
    with pytest.raises(InputError, match="expected a name, an index, a slice, a mask or an array of indices"):
        catalogue[[[1, 2], [3]]]


def test_catalogue_is_a_frozen_value_that_travels() -> None:
    catalogue = asteroids(3)
    with pytest.raises(ValueError, match="read-only"):
        catalogue.a[0] = 1.0
    with pytest.raises(AttributeError):
        catalogue.a = np.zeros(3)  # type: ignore[misc]
    copy = pickle.loads(pickle.dumps(catalogue))
    assert copy.names == catalogue.names
    assert np.array_equal(copy.a, catalogue.a)


def test_repr_says_what_one_wants_to_know() -> None:
    text = repr(asteroids(1000))
    for part in (
        "1000 asteroids: Vesta, Ceres, Pallas, Juno, ...",
        "878 in the belt, 122 Trojans",
        "MJD 59800 TDB",
        "ecliptic",
    ):
        assert part in text
    assert repr(asteroids(names="Ceres")).startswith("Catalogue of 1 asteroid: Ceres\n")
    assert repr(asteroids(brighter_than=1)) == "Catalogue of 0 asteroids"
