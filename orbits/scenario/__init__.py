"""Scenarios: a system, one or more runs, checks and pictures, in one file each that can be run in three ways.

definition    the values: `Scenario`, `Check`, and the result of a run, `Outcome`
options       what a scenario lets its user choose: `Option`
study         the same for other numerical experiments: `Study`, `StudyResult`, `Table`
loading       find a scenario by path, or by the name of a bundled one
performing    integrate, compare, check, draw, and write the results folder
certificates  certify the methods of a scenario on its own problems
typed         read quantities and methods as typed on a command line
files         which files of a results folder may be replaced
unfinished    runs in a results folder that are not complete: go on with this one, lose no other
command       the options of `orbits run` and of `python scenarios/NAME.py`; errors as single lines
"""

from __future__ import annotations

from orbits.scenario.definition import CaseOutcome, Check, Outcome, Scenario, angular_momentum_checks
from orbits.scenario.loading import Listed, bundled, load
from orbits.scenario.options import Option
from orbits.scenario.parts import Parts
from orbits.scenario.performing import perform
from orbits.scenario.study import Study, StudyOutcome, StudyResult, Table

__all__ = [
    "CaseOutcome",
    "Check",
    "Listed",
    "Option",
    "Outcome",
    "Parts",
    "Scenario",
    "Study",
    "StudyOutcome",
    "StudyResult",
    "Table",
    "angular_momentum_checks",
    "bundled",
    "load",
    "perform",
]


def main(self: Scenario | Study) -> None:
    """Run as a program with the options of `orbits run`; ends the process with its exit code."""
    from orbits.scenario import command

    command.main(self)


# `definition` does not import the command line, so `main` is attached here.
Scenario.main = Study.main = main  # type: ignore[assignment]
