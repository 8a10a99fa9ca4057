"""What a map does in encounters: one argument for particles and planets."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import orbits
from orbits.archive.header import Header, from_items, to_items
from orbits.errors import InputError
from orbits.integrators import build, describe, parse
from orbits.integrators.maps.encounters import OF_PARTICLES, OF_PLANETS, Encounters, read
from orbits.marching.clocks.constant import ConstantSteps
from orbits.methods import SABA
from orbits.time_grid import TimeGrid

ASKED = {
    "warn": ("warn", "warn"),
    "follow": ("follow", "follow"),
    "follow all": ("follow", "follow"),
    "follow particles": ("follow", "warn"),
    "follow planets": ("warn", "follow"),
    "retire": ("retire", "warn"),
    "retire particles": ("retire", "warn"),
    "refuse": ("warn", "refuse"),
    "retire particles, follow planets": ("retire", "follow"),
    "refuse planets,  follow  particles": ("follow", "refuse"),
    "retire, refuse": ("retire", "refuse"),
}


def test_one_text_says_what_is_done_with_particles_and_with_planets():
    assert {text: tuple(read(text)) for text in ASKED} == ASKED


def test_every_pair_of_answers_is_read_from_its_text_and_built_from_its_description():
    for particles in OF_PARTICLES:
        for of_planets in OF_PLANETS:
            pair = Encounters(particles, of_planets)
            method = orbits.WisdomHolman(encounters=str(pair))
            assert method.in_encounters == pair
            assert build(json.loads(json.dumps(describe(method)))) == method == parse(method.label)


@pytest.mark.parametrize(
    "value",
    ["leave", "", None, 3, "retire planets", "refuse all", "follow, follow planets", "warn of planets", "follow,"],
)
def test_other_texts_are_refused_with_those_that_are_expected(value):
    with pytest.raises(InputError, match=r"encounters is .*; expected 'warn', 'follow', .*'retire particles'"):
        orbits.WisdomHolman(encounters=value)


def test_saba_follows_planets_but_not_particles():
    assert SABA(encounters="follow").in_encounters == ("warn", "follow")
    with pytest.raises(InputError, match="expected 'warn', 'retire particles', 'follow planets'"):
        SABA(encounters="follow particles")


@pytest.mark.parametrize("method", [orbits.WisdomHolman, SABA])
def test_the_former_argument_says_the_new_one(method):
    with pytest.raises(InputError, match=r'one argument: encounters="follow planets"'):
        method(planets="follow")
    with pytest.raises(InputError, match=r'one argument: encounters="refuse planets"'):
        build({"name": method.name, "parameters": {"planets": "refuse"}})


@pytest.mark.parametrize(
    ("before", "now"),
    [
        ({}, ("warn", "warn")),
        ({"encounters": "follow"}, ("follow", "warn")),
        ({"planets": "follow"}, ("warn", "follow")),
        ({"encounters": "follow", "planets": "follow"}, ("follow", "follow")),
        ({"encounters": "retire", "planets": "refuse"}, ("retire", "refuse")),
    ],
)
def test_archives_made_with_two_arguments_keep_their_meaning(before, now):
    header = Header(
        orbits.System.solar_system(bodies=["Sun", "Jupiter"]),
        {
            "name": "wisdom-holman",
            "parameters": {"coordinates": "jacobi", "kernel": "standard", "corrector": 0, **before},
        },
        TimeGrid(ConstantSteps(0.1), np.array([0.0, 1.0])),
        {},
    )
    assert build(from_items(to_items(header)).integrator).in_encounters == now


def test_what_is_not_named_is_warned_of():
    followed = replace(orbits.WisdomHolman(), encounters="follow particles")
    assert not followed.in_encounters.follow_planets
    assert orbits.WisdomHolman().in_encounters == ("warn", "warn")
