"""Options of a scenario's own: declared, typed, checked, passed to its functions, and recorded with the run."""

from __future__ import annotations

import contextlib
import json
import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from astropy import units as u
from hypothesis import given
from hypothesis import strategies as st

import orbits
from orbits.archive import Archive
from orbits.archive.ended import Ended
from orbits.archive.origin import Origin
from orbits.ensemble import command as campaigns
from orbits.ensemble import run as run_campaign
from orbits.errors import ArchiveError, InputError, Interrupted, UnknownNameError
from orbits.option_values import LARGEST, option_text
from orbits.scenario import bundled, load, perform, unfinished
from orbits.scenario.certificates import certify_scenario, to_record
from orbits.scenario.options import read_options
from orbits.scenarios import Check, Option, Scenario
from tests.stopping import after_samples

from ..coverings import each

PLANETS = Option("planets", "giants", choices=("giants", "all"), help="which planets are there")
COUNT = Option("count", 100, least=1, help="number of particles")
SHARE = Option("share", 0.5, least=0, most=1, help="a part of them")
LOUD = Option("loud", False, help="whether all is said")
WORD = Option("word", "any", help="a word")
ALL = (PLANETS, COUNT, SHARE, LOUD, WORD)


def pair(**changes: Any) -> Scenario:
    """Two bodies at a distance that is an option, in steps that depend on another."""

    def system(options: dict[str, Any]) -> orbits.System:
        orbit = {"star": {"gm": 1.0}, "planet": {"a": options["a"], "gm": 1e-3}}
        return orbits.System.from_elements(orbit, units=orbits.DIMENSIONLESS)

    settings: dict[str, Any] = {
        "name": "pair",
        "title": "Two bodies",
        "options": [
            Option("a", 1.0, least=0.1, help="semi-major axis"),
            Option("fine", False, help="half the step"),
        ],
        "system": system,
        "integrators": [orbits.Gauss(stages=4)],
        "dt": lambda options: 0.0625 if options["fine"] else 0.125,
        "duration": 2.0,
        "samples": 5,
        "against": (),
    }
    return Scenario(**{**settings, **changes})


@each(
    ("option", "text", "value"),
    [
        (PLANETS, "all", "all"),
        (PLANETS, " giants ", "giants"),
        (COUNT, "500", 500),
        (COUNT, "10_000", 10_000),
        (COUNT, "1e4", 10_000),
        (SHARE, "0.25", 0.25),
        (SHARE, "1", 1.0),
        (LOUD, "yes", True),
        (LOUD, "True", True),
        (LOUD, "off", False),
        (WORD, "a=b", "a=b"),
        (WORD, "", ""),
    ],
)
def test_a_value_is_read_as_people_type_it_and_has_the_type_of_the_default(option, text, value) -> None:
    found = option.read(text)
    assert found == value
    assert type(found) is type(option.default)


@each(
    ("option", "text", "message"),
    [
        (PLANETS, "al", "option 'planets' of 'belt' is 'al'; expected giants or all. Did you mean 'all'?"),
        (PLANETS, "", "is ''; expected giants or all."),
        (COUNT, "0", "is 0; expected a whole number >= 1."),
        (COUNT, "2.5", "is '2.5'; expected a whole number >= 1."),
        (COUNT, "nan", "is 'nan'; expected a whole number"),
        (COUNT, "1e400", "is '1e400'; expected a whole number"),
        (COUNT, "1e19", "expected a whole number"),
        (COUNT, "1.0000000000000000001", "is '1.0000000000000000001'; expected a whole number"),
        (COUNT, "1e-400", "is '1e-400'; expected a whole number"),
        (COUNT, "9" * 5000, "9...; expected a whole number"),
        (COUNT, "many", "is 'many'; expected a whole number"),
        (SHARE, "1.5", "is 1.5; expected a number from 0 to 1."),
        (SHARE, "nan", "is nan; expected a number from 0 to 1."),
        (SHARE, "half", "is 'half'; expected a number from 0 to 1."),
        (LOUD, "perhaps", "is 'perhaps'; expected yes or no."),
        (WORD, "a\nb", "expected printable text, without spaces at its ends."),
        (Option("order", 2, choices=(2, 4, 6), help="an order"), "3", "is 3; expected 2, 4 or 6."),
        (Option("most", 2, most=5, help="a bound"), "6", "is 6; expected a whole number <= 5."),
    ],
)
def test_a_value_that_cannot_be_says_what_is_expected_and_what_is_near(option, text, message) -> None:
    with pytest.raises(InputError) as error:
        option.read(text, "belt")
    assert message in str(error.value)


@each(
    ("given", "message"),
    [
        ({"name": "Count"}, "the name of an option is 'Count'; expected lower-case letters"),
        ({"name": 3}, "the name of an option is 3"),
        ({"name": "dt"}, "option 'dt': every scenario has --dt; give the option another name"),
        ({"help": "red\x1b[31m"}, "help must be one line"),
        ({"default": None}, "its default is None; expected a text, a finite number, or True or False"),
        ({"default": float("inf")}, "its default is inf"),
        ({"default": 3 * u.au}, "its default is "),
        ({"help": ""}, "help must be one line"),
        ({"choices": "giants"}, "choices are 'giants'; expected a list"),
        ({"choices": (1, "x")}, "option 'count' is 'x'; expected a whole number"),
        ({"choices": (1, 2)}, "option 'count' is 100; expected 1 or 2."),
        ({"least": "1"}, "least must be a real number"),
        ({"least": 1000}, "option 'count' is 100; expected a whole number >= 1000."),
        ({"default": "x", "most": 3}, "most is for numbers, and its default is 'x'; leave it out"),
    ],
)
def test_a_declaration_that_contradicts_itself_is_refused(given, message) -> None:
    with pytest.raises(InputError) as error:
        Option(**{"name": "count", "default": 100, "help": "number", **given})
    assert message in str(error.value)


@pytest.mark.parametrize("value", [10**5000, " x", np.inf], ids=["huge", "space", "inf"])
def test_a_value_that_could_not_be_typed_is_refused(value) -> None:
    option = Option("word", "x", help="a text") if isinstance(value, str) else COUNT
    with pytest.raises(InputError, match="expected"):
        option.checked(value)


def test_numbers_of_numpy_become_pythons_own() -> None:
    bounded = Option("count", 3, least=np.int64(1), most=1e6, help="number")
    assert json.loads(json.dumps(bounded.record()))["least"] == 1
    assert bounded.expected == "a whole number from 1 to 1000000"
    assert SHARE.checked(np.float32(0.5)) == 0.5
    assert LOUD.checked(np.True_) is True
    option = Option("count", np.int64(7), choices=np.arange(6, 9).tolist(), help="number")
    assert type(option.default) is int
    assert type(pair(options=[option], dt=0.1).with_options(count=np.int32(8)).chosen["count"]) is int


@pytest.mark.parametrize(
    ("typed", "message"),
    [
        (["count"], "--set 'count': expected NAME=VALUE, such as --set planets=giants."),
        (["=3"], "--set '=3': expected NAME=VALUE"),
        (["conut=3"], "'belt' has no option 'conut'; its options are planets, count, share, loud and word. Did you"),
        (["count=3", "count=4"], "--set count is given twice, the second time as '4'; give it once."),
        (["duration=3"], "`orbits run` takes --duration, without --set."),
    ],
)
def test_what_is_no_name_and_value_is_refused_in_words(typed, message) -> None:
    with pytest.raises(InputError) as error:
        read_options(ALL, typed, "belt")
    assert message in str(error.value)


@given(st.lists(st.text(max_size=12) | st.builds("{}={}".format, st.sampled_from([o.name for o in ALL]), st.text())))
def test_whatever_is_typed_after_set_is_read_or_refused(typed) -> None:
    with contextlib.suppress(InputError):
        found = read_options(ALL, typed, "belt")
        assert all(type(value) is type({o.name: o for o in ALL}[name].default) for name, value in found.items())


@given(
    st.fixed_dictionaries(
        {},
        optional={
            "planets": st.sampled_from(PLANETS.choices),
            "count": st.integers(1, LARGEST),
            "share": st.floats(0.0, 1.0),
            "loud": st.booleans(),
            "word": st.text(st.characters(exclude_categories=["C", "Z"], include_characters=" ,=$")).map(str.strip),
        },
    )
)
def test_values_are_typed_read_and_archived_without_a_change(values) -> None:
    assert read_options(ALL, [f"{name}={option_text(value)}" for name, value in values.items()], "belt") == values
    origin = Origin("belt", {"count": 3, **values})
    assert Origin.from_json(origin.to_json()) == origin


@pytest.mark.parametrize(
    "text", ["", "3", "{}", '{"scenario": 3, "options": {}}', '{"scenario": "x", "options": [3]}', "[" * 9999,
             '{"scenario": "x", "options": [["a", 1]]}', '{"scenario": "x", "options": {"a": "\\ud800"}}',
             '{"scenario": "x\\u001b[31m", "options": {"a": 1}}', '{"scenario": "x", "options": {"a": NaN}}',
             '{"scenario": "x", "options": {"a": 1e999}}', '{"scenario": "x", "options": {"A b": 1}}',
             '{"scenario": "x", "options": {"a": null}}', '{"scenario": "x", "options": {}, "more": 3}'],
)  # fmt: skip
def test_a_scenario_that_no_run_writes_is_refused(text) -> None:
    with pytest.raises(ArchiveError, match="expected the name and the values of the options"):
        Origin.from_json(text)


def test_functions_get_the_values_and_the_outcome_has_them(tmp_path: Path) -> None:
    seen: list[Any] = []

    def checks(outcome: Any) -> Any:
        seen.append(outcome.options)
        yield Check("the planet is where it was put", outcome.run.system.q[1, 0].value > 1.9)

    scenario = pair(checks=checks).with_options(a=2, fine=True)
    outcome = perform(scenario, out=tmp_path)
    assert outcome.ok, outcome.failures
    assert outcome.run.dt.value == 0.0625
    assert seen == [{"a": 2.0, "fine": True}]
    assert json.loads((tmp_path / "report.json").read_text())["options"] == {"a": 2.0, "fine": True}
    assert scenario.headline() == "Two bodies (a=2.0, fine=yes)"
    assert pair().headline() == "Two bodies"


def test_values_are_kept_through_other_changes_and_a_dt_replaces_the_function() -> None:
    scenario = pair().with_options(fine=True).with_changes(duration=3.0).with_options(a=2.0)
    assert scenario.chosen == {"a": 2.0, "fine": True}
    assert scenario.step() == 0.0625
    assert scenario.with_changes(dt=0.5).with_options(fine=False).step() == 0.5
    assert pair().chosen == {"a": 1.0, "fine": False}


def test_a_scenario_without_options_has_functions_without_arguments_and_says_nothing_of_options(tmp_path) -> None:
    system = pair().cases()[""]
    scenario = pair(options=(), system=lambda: system, dt=0.125)
    outcome = perform(scenario, out=tmp_path, plot=False)
    assert outcome.options == {}
    assert "options" not in json.loads((tmp_path / "report.json").read_text())
    assert outcome.run.archive.origin is None
    with pytest.raises(UnknownNameError, match="'pair' has no options of its own, and so no option 'a'"):
        scenario.with_options(a=3)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"options": [3]}, "options holds 3; expected a list such as"),
        ({"options": "count"}, "options holds 'count'"),
        ({"options": [COUNT, COUNT]}, "two of its options are called 'count'"),
        ({"chosen": {"b": 3}}, "'pair' has no option 'b'; its options are a and fine"),
        ({"chosen": [3]}, "chosen is \\[3\\]; expected the values of options by name"),
        ({"chosen": {"a": 0.0}}, "option 'a' of 'pair' is 0.0; expected a number >= 0.1"),
        ({"system": lambda: 3}, "'pair': system is a function that cannot be called with the values of the options"),
        ({"dt": lambda a, b: 3}, r"expected one argument: def dt\(options\), which has options\['NAME'\]."),
        ({"options": [Option("self", 1, help="a name")], "chosen": {"self": 0.5}}, "expected a whole number"),
    ],
)
def test_a_scenario_whose_options_cannot_be_is_refused_where_it_is_made(changes, message) -> None:
    with pytest.raises(InputError, match=message):
        pair(**changes)


def test_an_option_that_a_function_misspells_is_told_with_the_line(tmp_path) -> None:
    with pytest.raises(InputError, match=r"test_options.py, line \d+: KeyError: 'finer'"):
        perform(pair(dt=lambda options: options["finer"]), out=tmp_path)
    with pytest.raises(InputError, match=r"test_options.py, line \d+: KeyError: 'finer'"):
        certify_scenario(pair(dt=lambda options: options["finer"]), out=tmp_path)


def stop_after_the_first_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    after_samples(monkeypatch, 1, lambda: os.kill(os.getpid(), signal.SIGINT))


def test_an_unfinished_run_goes_on_with_its_options_and_is_not_lost_to_others(tmp_path, monkeypatch) -> None:
    chosen = pair().with_options(a=2.0)
    stop_after_the_first_samples(monkeypatch)
    with pytest.raises(Interrupted):
        perform(chosen, out=tmp_path, plot=False)
    monkeypatch.undo()
    before = (tmp_path / "run.h5").read_bytes()
    told = "an unfinished run that is not this one: it has a=2.0, this one a=1.0. To complete it"
    with pytest.raises(InputError, match=told):
        perform(pair(), out=tmp_path, plot=False)
    assert (tmp_path / "run.h5").read_bytes() == before
    said: list[str] = []
    again = perform(chosen, out=tmp_path, plot=False, say=said.append)
    assert any("going on with the unfinished run" in line for line in said)
    whole = perform(chosen, out=tmp_path / "whole", plot=False)
    assert again.run.q.value.tobytes() == whole.run.q.value.tobytes()
    assert perform(pair(), out=tmp_path, plot=False).ok  # a finished run is replaced


def test_options_that_one_of_two_runs_has_not_are_told(tmp_path, monkeypatch) -> None:
    stop_after_the_first_samples(monkeypatch)
    with pytest.raises(Interrupted):
        perform(pair(), out=tmp_path)
    monkeypatch.undo()
    more = [*pair().options, Option("word", "", help="a text")]
    with pytest.raises(InputError, match=r"it has no word, this one word=''. To complete it"):
        perform(pair(options=more), out=tmp_path)


def test_an_unfinished_run_goes_on_if_it_has_the_closest_approaches_that_are_asked_for(tmp_path, monkeypatch) -> None:
    verlet = pair(integrators=["stormer-verlet"])
    for asked in (None, True):
        stop_after_the_first_samples(monkeypatch)
        with pytest.raises(Interrupted):
            perform(verlet.with_changes(approaches=asked), out=tmp_path / str(asked), plot=False)
        monkeypatch.undo()
    with pytest.raises(InputError, match=r"it looks for no closest approaches, and this one does\. To complete it"):
        perform(verlet.with_changes(approaches=True), out=tmp_path / "None", plot=False)
    said: list[str] = []
    run = perform(verlet, out=tmp_path / "True", plot=False, say=said.append).run
    assert any("going on with the unfinished run" in line for line in said)
    assert run.closest_approaches().names == ("star", "planet")


@pytest.mark.parametrize("why", ["ConvergenceError: a step", "shown: by a user", "ValueError: a mistake", ""])
def test_only_a_failed_step_is_a_reason_to_replace_a_run(why) -> None:
    assert unfinished._failed(Ended(False, 1.0, "failed", why)) is why.startswith("ConvergenceError")
    assert not unfinished._failed(Ended(False, 1.0, "interrupted", why))


def test_a_run_that_failed_does_not_keep_others_from_its_folder(tmp_path) -> None:
    hopeless = pair(integrators=[orbits.Gauss(stages=8)], dt=8.0, duration=100.0)
    assert not perform(hopeless.with_options(a=0.5), out=tmp_path, plot=False).ok
    with Archive.open(tmp_path / "run.h5") as archive:
        assert (archive.complete, archive.ended.how) == (False, "failed")
    assert perform(pair(), out=tmp_path, plot=False).ok


def test_an_archive_says_its_scenario_and_options_also_when_it_is_extended(tmp_path) -> None:
    perform(pair().with_options(a=2.0), out=tmp_path, plot=False)
    orbits.resume(tmp_path / "run.h5", until=4.0).close()
    with Archive.open(tmp_path / "run.h5") as archive:
        assert archive.origin == Origin("pair", {"a": 2.0, "fine": False})
    assert "scenario pair, a=2.0, fine=no" in str(orbits.verify(tmp_path / "run.h5"))


@pytest.mark.nightly
def test_certificates_say_the_options_and_take_their_dt(tmp_path) -> None:
    outcome = certify_scenario(pair().with_options(fine=True), out=tmp_path)
    assert outcome.certified[0].certificate.dt == 0.0625
    assert to_record(outcome)["options"] == {"a": 1.0, "fine": True}


def test_a_campaign_with_other_options_is_refused(tmp_path) -> None:
    def plan(scenario: Scenario) -> Any:
        options = {"dt": scenario.step(), "duration": 2.0, "samples": 3}
        return campaigns.plan_of(scenario.cases(), scenario.integrators[0], options)

    run_campaign(plan(pair()), tmp_path / "c")
    with pytest.raises(ArchiveError, match="another campaign"):
        run_campaign(plan(pair().with_options(a=2.0)), tmp_path / "c")


def test_lists_name_the_options_of_each_bundled_scenario_as_it_has_them() -> None:
    with_options = {each.name: each.options for each in bundled() if "Option(" in each.path.read_text(encoding="utf-8")}
    assert "kirkwood_gaps" in with_options
    for name, options in with_options.items():
        scenario = load(name)
        assert isinstance(scenario, Scenario)
        assert options == tuple(option.name for option in scenario.options)


def test_the_belt_is_set_among_giants_or_all_planets() -> None:
    scenario = load("kirkwood_gaps")
    assert isinstance(scenario, Scenario)
    assert scenario.chosen == {"planets": "giants", "count": 10_000}
    assert scenario.step() == 20 * u.day
    few, everything = scenario.with_options(count=7), scenario.with_options(count=7, planets="all")
    (giants,), (planets,) = few.cases().values(), everything.cases().values()
    assert (int(giants.massive.sum()), len(giants)) == (5, 12)
    assert (int(planets.massive.sum()), len(planets)) == (9, 16)
    assert everything.step() == 3 * u.day
