"""Scenarios: a system, one or more runs, what must hold, what to draw. One file each, runnable three ways.

definition   the values: `Scenario`, `Check`, and what a run of one gives, `Outcome`
study        the same for an experiment that is not a system and its runs: `Study`, `StudyResult`, `Table`
loading      find a scenario by path or by the name of a bundled one
performing   integrate, compare, check, draw, and write the results folder
certifying   the methods of a scenario, measured on its own problems
typed        quantities and methods as they are typed on a command line
files        which files of a results folder may be replaced
command      the options of `orbits run`, which are those of `python scenarios/NAME.py`; errors as single lines
"""

from __future__ import annotations

from orbits.scenario.definition import CaseOutcome, Check, Outcome, Scenario, angular_momentum_checks
from orbits.scenario.loading import Listed, bundled, load
from orbits.scenario.performing import perform
from orbits.scenario.study import Study, StudyOutcome, StudyResult, Table

__all__ = [
    "CaseOutcome",
    "Check",
    "Listed",
    "Outcome",
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
    """Run as a command line of its own, with the options of `orbits run`; ends the process with its exit code."""
    from orbits.scenario import command

    command.main(self)


# A scenario knows nothing of the command line; what leads there is put on it here.
Scenario.main = Study.main = main  # type: ignore[assignment]
