"""Methods, spans of time and names as a reader wants them."""

from __future__ import annotations

import pytest
from astropy import units as u
from matplotlib.cbook import is_math_text

import orbits
from orbits.integrators import registry
from orbits.plotting import fitting_time, in_fitting_time, method_words, short
from orbits.plotting.words import in_prose

from ..coverings import each

WORDS = {
    "ExplicitEuler()": "explicit Euler",
    "Gauss(stages=8)": "Gauss, 8 stages",
    "Gauss(stages=1)": "Gauss, 1 stage",
    "StormerVerlet()": "Störmer–Verlet",
    "RungeKutta4()": "RK4",
    "LobattoIIIAB(stages=3)": "Lobatto IIIA–IIIB, 3 stages",
    "SymplecticEuler(variant='kick-drift')": "symplectic Euler, kick–drift",
    "Composition(base=StormerVerlet(), order=4, scheme='suzuki')": "composition, order 4, suzuki",
    "Composition(base=Gauss(stages=1), order=6, scheme='yoshida')": "composition of Gauss, 1 stage, order 6, yoshida",
    "REBOUND ias15": "REBOUND ias15",
    "REBOUND whfast-corrector17": "REBOUND whfast-corrector17",
}


@each("label", WORDS)
def test_a_method_is_told_in_words(label):
    assert method_words(label) == WORDS[label]


def test_names_are_drawn_letter_by_letter_and_all_are_in_the_legend():
    bodies = {"star": {"gm": 1.0}, r"$\foo$": {"a": 1.0, "gm": 1e-6}, "_b": {"a": 2.0}, "US$ 5 and $6": {"a": 3.0}}
    figure = orbits.System.from_elements(bodies, units=orbits.DIMENSIONLESS).plot()
    drawn = [text.get_text() for text in figure.legends[0].get_texts()]
    assert [text.strip().replace(r"\$", "$") for text in drawn] == list(bodies)
    assert not any(is_math_text(text) for text in drawn)


@each("cls", registry().values())
def test_every_registered_method_has_words_without_brackets_that_tell_its_examples_apart(cls):
    words = [method_words(method.label) for method in cls.examples()]
    assert not any(set("()=_") & set(text) for text in words)
    if cls.name != "vprk":  # its tables of coefficients are no words
        assert len(set(words)) == len(words)


SPANS = [
    (30 * u.s, "s"), (1 * u.h, "min"), (12 * u.h, "h"), (1 * u.yr, "d"), (-100 * u.yr, "yr"), (1000 * u.yr, "yr"),
    (30_000 * u.yr, "kyr"), (1e6 * u.yr, "Myr"), (5e9 * u.yr, "Gyr"),
]  # fmt: skip


@each(("span", "unit"), SPANS)
def test_a_span_of_time_is_told_in_the_unit_that_suits_it(span, unit):
    factor, found = fitting_time(span.to_value(u.day), u.day)
    assert found == unit
    assert factor * span.to_value(u.day) == pytest.approx(span.to_value(unit), rel=1e-15)
    assert abs(factor * span.to_value(u.day)) <= 10_000  # at most five digits on a tick label


def test_long_times_without_a_unit_become_powers_of_ten():
    assert fitting_time(100.0, "") == (1.0, "")
    factor, unit = fitting_time(2e6, "")
    assert (factor * 2e6, unit) == (pytest.approx(2000.0), "10³")
    factor, unit = fitting_time(-7e8, "")
    assert (factor * -7e8, unit) == (pytest.approx(-700.0), "10⁶")


@pytest.mark.parametrize(
    ("step", "unit", "words"),
    [(6.0, "d", "6 d"), (1 / 1440, "d", "1 min"), (0.5, "d", "12 h"), (400.0, "d", "400 d"), (0.015708, "", "0.01571")],
)
def test_a_step_is_told_in_the_unit_that_suits_it(step, unit, words):
    assert in_fitting_time(step, unit) == words


def test_a_long_name_keeps_both_its_ends():
    names = [f"A planet with a name of forty characters{k}" for k in range(3)]
    shown = [short(name) for name in names]
    assert len(set(shown)) == 3
    assert all(len(each) <= 28 and each.startswith("A planet") for each in shown)
    assert short("Earth-Moon barycenter") == "Earth–Moon"
    assert short("Ceres") == "Ceres"


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("Sun", "the Sun"),
        ("Moon", "the Moon"),
        ("Earth-Moon barycenter", "the Earth-Moon barycenter"),
        ("Jupiter", "Jupiter"),
        ("Moonlet", "Moonlet"),
        ("A planet with a name of forty characters", "A planet with …ty characters"),
    ],
)
def test_a_name_takes_its_article_in_a_sentence(name, told):
    assert in_prose(name) == told
