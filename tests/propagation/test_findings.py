"""What is found in many systems alike, with other bodies and figures, is one warning with a count."""

import pickle
import warnings

import numpy as np
import pytest

import orbits
from orbits import ensemble
from orbits.finding import SHOWN, Finding
from orbits.propagation.systems import each


def test_a_finding_lists_its_cases_counts_the_others_and_ends_with_the_remedy():
    found = Finding("3 of them:", rows=["one", "two"], hidden=1_204, where=", in run.retired", remedy="Go on.")
    assert str(found) == "3 of them:\n  one.\n  two.\n  And 1,204 more, in run.retired.\nGo on."
    assert str(Finding("3 of them:", rows=["one"], hidden=1 - SHOWN)) == "3 of them:\n  one."


def test_a_warning_carries_its_finding_and_names_the_line_that_asked_for_the_run():
    with pytest.warns(orbits.errors.StepWarning) as caught:
        orbits.propagate(systems()[0], "stormer-verlet", dt=0.5, duration=1.0, progress=False)
    found = caught[0].message.finding
    assert str(found) == str(caught[0].message)
    assert found.kind == "passage ahead"
    assert caught[0].filename == __file__
    assert pickle.loads(pickle.dumps(caught[0].message)).finding == found


def test_findings_of_one_kind_are_told_once_and_other_warnings_by_their_text():
    def make(k):
        name = ["Mercury", "2007 XB", "Venus"][k]
        Finding(f"{name} passes at {k} AU", orbits.errors.StepWarning, "passage").warn()
        warnings.warn(f"of the user, {k // 2}", RuntimeWarning, stacklevel=1)

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        each(3, make)
    passages, of_user = (str(one.message) for one in caught)
    assert passages == (
        "all 3 systems (their texts differ in figures; this is that of systems[0]): Mercury passes at 0 AU"
    )
    assert of_user == "systems[0, 1]: of the user, 0\nsystems[2]: of the user, 1"


def systems():
    """Six planets, each with a pericentre of its own."""
    return [
        orbits.System.from_elements(
            {"star": {"gm": 1.0}, "planet": {"gm": 1e-6, "a": 1.0, "e": e}}, units=orbits.DIMENSIONLESS
        )
        for e in np.linspace(0.5, 0.61, 6)
    ]


def told(call):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        call()
    (one,) = [warning for warning in caught if issubclass(warning.category, orbits.errors.StepWarning)]
    return str(one.message)


def test_a_list_of_systems_is_warned_of_once_with_the_text_of_the_first():
    text = told(lambda: orbits.propagate(systems(), "stormer-verlet", dt=0.5, duration=1.0, progress=False))
    assert text.startswith("all 6 systems (their texts differ in figures; this is that of systems[0]): dt = 0.5 is")
    assert text.count("is too long") == 1


def test_a_campaign_warns_once_with_the_number_of_blocks(tmp_path):
    settings = {"dt": 0.5, "duration": 1.0, "integrator": "stormer-verlet", "block": 2, "workers": 1}
    text = told(lambda: ensemble.run(ensemble.systems(systems()), tmp_path / "c", **settings))
    assert text.startswith("3 of 3 blocks (")
    assert " texts that differ in figures, in campaign.blocks[k].warnings; this is one): dt = 0.5 is too long" in text
    assert text.count("is too long") == 1
