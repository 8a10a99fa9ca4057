"""Pictures of runs whose bodies merge: a body that is gone ends in the picture."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pytest

import orbits
from orbits.errors import InputError
from orbits.plotting import arcs

from .runs import MERGING, about_a_star

MERGED_AT = 10.37


@pytest.fixture(scope="module")
def run() -> orbits.Trajectory:
    system = orbits.System.from_elements(MERGING, units=orbits.DIMENSIONLESS)
    return orbits.propagate(system, duration=20.0, events=orbits.events.Collision(then=orbits.events.Merge()))


def lines(figure: plt.Figure) -> dict[str, list[np.ndarray]]:
    """Return the lines and discs of each body in the map, by the name in the legend; unnamed ones by colour."""
    found: dict[str, list[np.ndarray]] = {}
    named = {line.get_color(): line.get_label() for line in figure.axes[0].lines if line.get_label()[0] != "_"}
    for line in figure.axes[0].lines:
        found.setdefault(named[line.get_color()], []).append(np.array(line.get_data()).T)
    return found


def test_the_path_of_a_merged_body_ends_at_its_last_sample_without_a_disc_or_an_ellipse(run) -> None:
    drawn = lines(run.plot())
    last = run["a"].q.value[np.flatnonzero(run.times < MERGED_AT)[-1], :2]
    (path,) = [line for line in drawn["a"] if len(line)]
    assert np.array_equal(path[np.isfinite(path).all(axis=1)][-1], last)
    assert sorted(map(len, drawn["b"]))[0] == 1  # a disc
    assert len(drawn["b"]) == 3  # a path and an ellipse beside it


@pytest.mark.parametrize("part", [slice(60, None), slice(-1, None), slice(None, None, -1), slice(0, 1)])
def test_parts_of_a_run_after_and_before_a_merger_can_be_drawn(run, part) -> None:
    some = run[part]
    assert ("a" in lines(some.plot())) == bool(np.isfinite(some["a"].q.value).any())


def test_states_asked_for_after_a_merger_can_be_drawn(run) -> None:
    assert "a" not in lines(run.at([15.0, 16.0]).plot())


def test_a_body_that_is_in_no_sample_is_refused_by_name(run) -> None:
    with pytest.raises(InputError, match="bodies has a, gone before the first of these samples"):
        run[60:].plot(bodies=["a", "b"])
    assert run.plot(bodies=["a"])


def test_the_last_state_that_is_drawn_has_the_masses_of_then(run) -> None:
    assert arcs.last_state(run).values.gm.tolist() == [1.0, 0.0, 3e-6, 0.0]
    assert arcs.last_state(run[:20]).values.gm.tolist() == [1.0, 1e-6, 2e-6, 0.0]


def test_a_retired_particle_has_no_disc_at_the_end_and_is_none_of_the_points() -> None:
    """Its last place was drawn as if it were there at the end."""
    belt = {f"rock {k}": {"a": 2.0 + 0.001 * k, "M": 0.1 * k} for k in range(40)}
    for bodies in ({"near": {"a": 1.0}, "far": {"a": 2.0}}, belt):
        whole = about_a_star(bodies, np.linspace(0.0, 60.0, 50))
        q, v = whole.q.value.copy(), whole.v.value.copy()
        q[20:, 1] = v[20:, 1] = np.nan
        run = orbits.Trajectory(whole.system, whole.times, q, v, step=1.0, integrator=whole.integrator)
        figure = run.plot()
        points = [line.get_xydata() for line in figure.axes[0].lines if line.get_marker() in ("o", ".")]
        assert not np.isin(np.concatenate(points), q[19, 1, :2]).any()
        last = 1 if len(bodies) == 2 else 39
        assert sum(np.isin(part[:, 0], q[-1, 2:, 0]).sum() for part in points) == last


def test_a_resonance_with_a_planet_that_is_in_no_sample_is_refused(run) -> None:
    """It ended in a ValueError of NumPy."""
    with pytest.raises(InputError, match="in these samples no body goes round beside a; choose another planet"):
        run[60:].plot("resonance", resonance="2:1", planet="a")
