"""For any arguments, a run succeeds or is refused with a message."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import strategies as st

import orbits
from orbits import System
from orbits.errors import InputError
from tests.campaigns import campaign, junk, works_or_says_why

PAIR = System.from_elements({"star": {"gm": 1}, "planet": {"a": 1, "gm": 1e-3}}, units=orbits.DIMENSIONLESS)
VERLET = orbits.StormerVerlet()


pytestmark = pytest.mark.filterwarnings("ignore::orbits.errors.StepWarning")


def is_short(x: Any) -> bool:
    """Return whether a run of that length, or with that step, is short."""
    return not isinstance(x, int | float) or isinstance(x, bool) or not 0 < abs(x) < 1e-3


def many(x: Any) -> bool:
    return isinstance(x, int | float) and abs(x) > 1e3


@campaign(
    20,
    1500,
    changes=st.dictionaries(
        st.sampled_from(
            [
                "samples",
                "progress",
                "certificate",
                "threads",
                "integrator",
                "system",
                "stop",
                "callback",
                "check_step",
                "approaches",
            ]
        ),
        junk,
        max_size=2,
    ),
)
def test_any_argument_of_a_run_is_taken_or_refused(changes: dict[str, Any]) -> None:
    if many(changes.get("samples")):
        changes["samples"] = 3
    given = {"system": PAIR, "integrator": VERLET, "dt": 0.1, "duration": 1.0, **changes}
    works_or_says_why(lambda: orbits.propagate(given.pop("system"), given.pop("integrator"), **given))


@campaign(20, 1500, x=junk.filter(is_short))
def test_any_step_and_any_length_run_or_are_refused(x: Any) -> None:
    works_or_says_why(lambda: orbits.propagate(PAIR, VERLET, dt=x, duration=0.5, samples=2))
    if isinstance(x, str):
        works_or_says_why(lambda: orbits.propagate(PAIR, VERLET, dt=f"P/{x}", duration=0.5, samples=2))
    if not many(x):
        works_or_says_why(lambda: orbits.propagate(PAIR, VERLET, dt=0.1, duration=x, samples=2))
        works_or_says_why(lambda: orbits.propagate(PAIR, VERLET, dt=0.1, until=x, samples=2))


@campaign(10, 1000, x=junk)
def test_any_question_to_a_run_is_answered_or_refused(x: Any) -> None:
    run = orbits.propagate(PAIR, VERLET, dt=0.1, duration=1.0, samples=3)
    for use in (
        run.at,
        lambda x: PAIR + x,
        lambda x: orbits.System.solar_system(origin=x, bodies=["Sun", "Mars"]),
        lambda x: run[x] if not isinstance(x, int) else None,
        lambda x: PAIR[x] if not isinstance(x, int) else None,
        lambda x: run.elements(primary=x),
        orbits.Trajectory.open,
        orbits.Archive.open,
        orbits.resume,
        lambda x: orbits.compare(x, VERLET, dt=0.1, duration=1, against=[]),
        lambda x: orbits.certify(PAIR, x, dt=0.1) if not isinstance(x, str) else None,
        lambda x: orbits.march(x, VERLET, q=[1.0], v=[0.0], dt=0.1, steps=3),
    ):
        works_or_says_why(lambda use=use: use(x))


@pytest.mark.parametrize("x", [None, 3, len, "Sun"])
def test_comparing_needs_a_system_and_names_of_peers(x: Any) -> None:
    with pytest.raises(InputError, match=r"system must be an orbits.System, got a"):
        orbits.compare(x, VERLET, dt=0.1, duration=1, against=[])
    if x not in (None, "Sun"):  # None: all that suit
        with pytest.raises(InputError, match="against must be names of peers"):
            orbits.compare(PAIR, VERLET, dt=0.1, duration=1, against=x)


def test_a_certificate_is_a_certificate(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"certificate is a tuple; expected True or a result of orbits.certify"):
        orbits.propagate(PAIR, VERLET, dt=0.1, duration=1, archive=tmp_path / "x.h5", certificate=(1, 2))  # type: ignore[arg-type]
