"""Warnings of many systems that say the same of each, with other figures, are one warning with a count."""

import warnings

import numpy as np

import orbits
from orbits import ensemble
from orbits.propagation.alike import alike

TOO_LONG = "dt = {} d is too long for RungeKutta4(): where {} passes Sun, at {} AU, it gets {} of the turn wrong."
NOT_RESOLVED = "StormerVerlet() did not resolve {}; the rest of the run is not to be trusted:\n  Mercury to {}: {} AU."


def test_texts_that_differ_in_figures_names_and_plurals_are_alike_and_others_are_not():
    texts = [
        TOO_LONG.format(6, "Mercury", 0.3075, "1.2 %"),
        NOT_RESOLVED.format("1 close passage", "Venus", 0.31),
        TOO_LONG.format(6, "2007 XB", 1.5e-7, "all"),
        NOT_RESOLVED.format("at least 1,204 close passages", "Mars", 0.4),
        "Mercury falls straight into Sun: no step resolves that.",
    ]
    groups = alike({text: k for k, text in enumerate(texts)}, ["Sun", "Mercury", "2007 XB", "XB"])
    assert [list(group.values()) for group in groups] == [[0, 2], [1, 3], [4]]


def systems():
    """Twelve planets, each with a pericentre of its own."""
    return [
        orbits.System.from_elements(
            {"star": {"gm": 1.0}, "planet": {"gm": 1e-6, "a": 1.0, "e": e}}, units=orbits.DIMENSIONLESS
        )
        for e in np.linspace(0.5, 0.61, 12)
    ]


def told(call):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        call()
    (one,) = [warning for warning in caught if issubclass(warning.category, orbits.StepWarning)]
    return str(one.message)


def test_a_list_of_systems_is_warned_of_once_with_the_text_of_the_first():
    text = told(lambda: orbits.propagate(systems(), "stormer-verlet", dt=0.5, duration=1.0, progress=False))
    assert text.startswith("all 12 systems (their texts differ in figures; this is that of systems[0]): dt = 0.5 is")
    assert text.count("is too long") == 1


def test_a_campaign_warns_once_with_the_number_of_blocks(tmp_path):
    settings = {"dt": 0.5, "duration": 1.0, "integrator": "stormer-verlet", "block": 4, "workers": 1}
    text = told(lambda: ensemble.run(ensemble.systems(systems()), tmp_path / "c", **settings))
    assert text.startswith("3 of 3 blocks (")
    assert " texts that differ in figures, in campaign.blocks[k].warnings; this is one): dt = 0.5 is too long" in text
    assert text.count("is too long") == 1
