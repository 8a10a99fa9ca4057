"""The grid of a run is made once from the arguments; propagation, comparison, archives and scenarios use it."""

import numpy as np
import pytest

import orbits
from orbits.errors import InputError
from orbits.point_masses import PointMasses
from orbits.time_grid import TimeGrid, dynamical_time_of, step_length

GRID = TimeGrid(0.25, [0.0, 0.5, 1.1])


def planet():
    bodies = {"star": {"gm": 1.0}, "planet": {"a": 1.0, "e": 0.1}}
    return orbits.System.from_elements(bodies, units=orbits.DIMENSIONLESS)


@pytest.mark.parametrize("duration", [7.0, -7.0])
def test_the_step_is_rounded_to_24_bits_and_goes_where_the_duration_goes_whatever_sign_it_is_given(duration):
    for dt in (0.1, -0.1):
        grid = TimeGrid.of(planet(), dt, duration=duration, samples=3)
        assert grid.h == np.copysign(np.float32(0.1), duration)  # float32 has 24 bits, too
        assert (grid.dt, grid.direction) == (abs(grid.h), np.sign(duration))
        assert grid.times.tolist() == [0.0, duration / 2, duration]


def test_whole_steps_and_rests_give_the_times_back_exactly():
    for h in (0.1, -0.1):
        grid = TimeGrid(h, np.linspace(0.0, 1e4 * h, 1234))
        assert (grid.steps * h + grid.places.rests).tolist() == pytest.approx(grid.times.tolist(), rel=2**-52)
        exact = [int(k) * int(h * 2**60) + int(r * 2**60) for k, r in zip(grid.steps, grid.places.rests, strict=True)]
        assert exact == [int(t * 2**60) for t in grid.times]
        assert (np.abs(grid.places.rests) < abs(h)).all()
        assert grid.whole_steps == grid.steps[-1]


def test_a_grid_is_a_value_that_nothing_changes():
    times = np.array([0.0, 1.0])
    grid = TimeGrid(1.0, times)
    times[1] = 5.0
    assert grid.end == 1.0
    with pytest.raises(ValueError, match="read-only"):
        grid.times[1] = 5.0
    with pytest.raises(AttributeError):
        grid.h = 2.0


@pytest.mark.parametrize(
    ("h", "times", "words"),
    [
        (0.0, [0.0], "finite and not 0"),
        (np.nan, [0.0], "finite and not 0"),
        (1.0, [], r"shape \(0,\)"),
        (1.0, [[0.0]], r"shape \(1, 1\)"),
        (1.0, [0.0, np.nan], "all finite"),
        (1.0, [-1.0, 0.0], r"times\[0\] is -1"),
        (-1.0, [0.0, 1.0], r"times\[1\] is 1; .*direction of dt = -1"),
        (1.0, [0.0, 2.0, 2.0], r"times\[2\] is 2"),
        (1e-300, [1.0], "2\\^53"),
    ],
)
def test_what_no_run_has_is_refused(h, times, words):
    with pytest.raises(InputError, match=words):
        TimeGrid(h, times)


def test_an_extension_keeps_what_is_there_and_samples_as_densely():
    system = planet()
    longer = TimeGrid(0.25, [0.0, 0.5, 1.0]).extended(system, 2.25)
    assert longer.times.tolist() == [0.0, 0.5, 1.0, 1.5, 2.0, 2.25]
    assert longer.h == 0.25
    assert GRID.extended(system, GRID.end) is GRID
    for until, words in ((1.0, "lies before the end"), (np.inf, "must be finite"), (1e300, "cannot be reached")):
        with pytest.raises(InputError, match=words):
            GRID.extended(system, until)


def test_another_step_keeps_the_samples_and_the_direction():
    back = TimeGrid(-0.5, [0.0, -1.0])
    finer = back.with_step(planet(), 0.1)
    assert finer.h == -np.float32(0.1)
    assert finer.times is not back.times
    assert np.array_equal(finer.times, back.times)
    assert not finer.is_that_of(back)
    assert back.is_that_of(TimeGrid(-0.5, [0.0, -1.0]))
    with pytest.raises(InputError, match="reference must be finite and not zero"):
        back.with_step(planet(), 0.0, "reference")


def test_a_run_its_archive_and_its_comparison_have_the_same_grid(tmp_path):
    system, method = planet(), orbits.StormerVerlet()
    given = {"dt": "P/200", "duration": 10.0, "samples": 5}
    grid = TimeGrid.of(system, **given)
    assert grid.dt == pytest.approx(2 * np.pi / 200, rel=2**-23)
    run = orbits.propagate(system, method, **given, archive=tmp_path / "run.h5")
    assert run.step == grid.h
    assert run.archive.grid.is_that_of(grid)
    report = orbits.compare(system, method, **given, against=[], reference="none", runs=[run])
    assert report.settings["dt"] == grid.dt
    assert np.array_equal(report.times, grid.times)


@pytest.mark.parametrize("at_once", [1, 40, 100_000])
def test_the_dynamical_time_is_that_of_all_pairs_with_a_mass(monkeypatch, at_once):
    monkeypatch.setattr(step_length, "PAIRS_AT_ONCE", at_once)
    random = np.random.default_rng(5)
    gm, q = np.array([1.0, 0.0, 1e-3, 0.0, 2e-6, 0.0, 0.0]), random.normal(size=(7, 3))
    q[5] = q[6]  # two massless bodies, which do not feel each other
    rate = sum(
        (gm[i] + gm[j]) / (np.sum((q[i] - q[j]) ** 2) + 0.01) ** 1.5
        for i in range(7)
        for j in range(i)
        if gm[i] + gm[j] > 0.0
    )
    # A sum of fifteen positive terms, in another order: some units in the last place.
    assert dynamical_time_of(PointMasses(gm, q, q, 0.1)) == pytest.approx(rate**-0.5, rel=1e-15 * 4)
    assert dynamical_time_of(PointMasses(gm[:1], q[:1], q[:1])) == np.inf
