"""In a system without units, messages have no gap where a unit would stand."""

import re
from collections.abc import Callable
from typing import Any

import pytest

import orbits
from orbits.errors import InputError, with_unit

from ..coverings import each

STATES: dict[str, Any] = {
    "names": ["star", "planet"],
    "gm": [1.0, 1e-3],
    "q": [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]],
    "v": [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
    "units": orbits.DIMENSIONLESS,
}
PAIR = orbits.System(**STATES)
TOUCHING = PAIR.replaced(radii=[0.9, 0.2])

GAP = re.compile(r" [,.;:)](?!\.)|\(\s|  | in$|\s$")
"""A space before a mark, two spaces, or a preposition without a unit."""

WRONG: dict[str, Callable[[], Any]] = {
    "a sample outside": lambda: orbits.propagate(PAIR, duration=2.0, samples=[3.0]),
    "a duration without meaning": lambda: orbits.propagate(PAIR, duration="soon"),
    "an end without meaning": lambda: orbits.propagate(PAIR, until="soon"),
    "a step without meaning": lambda: orbits.propagate(PAIR, duration=2.0, dt="short"),
    "an endless run": lambda: orbits.propagate(PAIR, duration=1e17),
    "radii that overlap": lambda: orbits.propagate(TOUCHING, duration=2.0, events=orbits.events.Collision()),
    "a condition that holds": lambda: orbits.propagate(
        PAIR, duration=2.0, stop=orbits.events.CloserThan(3.0, "star", "planet")
    ),
    "a negative softening": lambda: orbits.System(**STATES, softening=-1.0),
    "two softenings": lambda: orbits.System(**STATES, softening=[1.0, 2.0]),
    "a negative mass": lambda: orbits.System(**{**STATES, "gm": [1.0, -1.0]}),
    "a position that is not finite": lambda: orbits.System(
        **{**STATES, "q": [[0.0, 0.0, 0.0], [float("nan"), 0.0, 0.0]]}
    ),
    "bodies at one place": lambda: orbits.System(**{**STATES, "q": [[0.0, 0.0, 0.0]] * 2}),
    "no mass": lambda: orbits.System.from_elements({"star": {"gm": 0.0}}, units=orbits.DIMENSIONLESS),
}


@each("case", WRONG)
def test_a_message_about_numbers_without_units_has_no_gap(case: str) -> None:
    with pytest.raises(InputError) as caught:
        WRONG[case]()
    assert not GAP.search(str(caught.value)), str(caught.value)


def test_an_extension_that_goes_back_names_the_end_without_a_gap(tmp_path: Any) -> None:
    orbits.propagate(PAIR, "gauss", dt=0.1, duration=2.0, archive=tmp_path / "run.h5").close()
    with pytest.raises(InputError, match="until = 1 lies before the end of the run, 2; expected a later time"):
        orbits.resume(tmp_path / "run.h5", until=1.0)


def test_an_extension_of_a_run_backwards_in_time_is_earlier(tmp_path: Any) -> None:
    orbits.propagate(PAIR, "gauss", dt=0.1, duration=-2.0, archive=tmp_path / "run.h5").close()
    with pytest.raises(InputError, match="until = 4 lies before the end of the run, -2; expected an earlier one, as"):
        orbits.resume(tmp_path / "run.h5", until=4.0)


def test_a_unit_is_shown_if_there_is_one() -> None:
    assert (with_unit("2", "AU"), with_unit(2, ""), with_unit("2", orbits.DIMENSIONLESS.length)) == ("2 AU", "2", "2")


def test_an_event_and_an_approach_name_their_figures_where_no_unit_does() -> None:
    run = orbits.propagate(PAIR, duration=8.0, events=orbits.events.CloseApproach("star", "planet"))
    assert re.search(r"close approach of star and planet, distance [0-9.]+, speed [0-9.]+$", str(run.events[0]))
    nearest = str(run.closest_approaches()["planet"][0])
    assert re.search(r"planet to star: [0-9.]+ at t = [0-9.]+, speed [0-9.]+$", nearest)
