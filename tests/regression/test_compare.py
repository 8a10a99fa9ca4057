"""`orbits.compare` measures ours and REBOUND's alike, judges ours, and says what could not be measured."""

from __future__ import annotations

import json
import math
import re

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.errors import ConvergenceError, InputError, UnknownNameError
from orbits.methods import ExplicitEuler
from orbits.regression.conserved_quantities import Invariants
from orbits.regression.problem import Problem, Sampled

from ..coverings import each
from ..problems import FIGURE_EIGHT

GAUSS = orbits.Gauss(stages=8)
KEPLER = orbits.System(
    ["star", "circular", "eccentric"],
    gm=[1.0, 0.0, 0.0],
    q=[[0, 0, 0], [1, 0, 0], [0, 0.4, 0]],
    v=[[0, 0, 0], [0, 1, 0], [-2, 0, 0]],
    units=orbits.DIMENSIONLESS,
)
GIANTS = orbits.System(
    ["Saturn", "a rock", "Sun", "Jupiter"],
    gm=[8.46e-8, 0.0, 2.959e-4, 2.825e-7],
    q=[[6.4, 6.2, 2.3], [2.6, 0.4, 0.1], [-0.007, -0.003, -0.001], [4.0, 2.9, 1.2]],
    v=[[-0.0043, 0.0035, 0.0016], [-0.002, 0.0103, 0.0007], [5e-6, -7e-6, -3e-6], [-0.0046, 0.0058, 0.0026]],
)


def rows(report):
    return {row.method: row for row in report.rows}


def test_on_keplers_problem_the_reference_solution_is_exact_and_ours_and_ias15_reach_it():
    report = orbits.compare(
        KEPLER, [GAUSS, ExplicitEuler()], dt=0.1, duration=20 * math.pi, samples=41, against=("ias15", "whfast"),
        tolerances={"gauss": {"energy": 1e-13, "angular_momentum": 1e-14, "position": 1e-12}},
    )  # fmt: skip
    assert report.ok, report.table
    assert report.reference.kind == "exact"
    assert report.reference.error <= 2.0**-53
    got = rows(report)
    # Ten orbits: round-off in the phase, a few ulps each. Euler shows that the reference solution is no tautology.
    for method in ("Gauss(stages=8)", "REBOUND ias15", "REBOUND whfast"):
        assert got[method].position < 1e-11, method
    assert got["ExplicitEuler()"].position > 0.1
    assert got["ExplicitEuler()"].verdict == "not judged"
    assert got["Gauss(stages=8)"].verdict == "ok"
    assert got["REBOUND ias15"].verdict == "peer"
    assert set(got["REBOUND ias15"].positions) == {"star", "circular", "eccentric"}


def test_at_e_0_9_with_400_steps_an_orbit_ias15_and_whfast_are_more_accurate_than_gauss_as_the_readme_says():
    e, names = 0.9, {"star": {"gm": 0.999}}
    names["planet"] = {"gm": 0.001, "a": 1.0, "e": e, "inc": 0.5, "Omega": 0.7, "omega": 0.4}
    system = orbits.System.from_elements(names, units=orbits.DIMENSIONLESS)
    period = 2 * math.pi
    report = orbits.compare(system, GAUSS, dt=period / 400, duration=100 * period, samples=501)
    error = {method: row.position for method, row in rows(report).items()}
    # 4.4e-10, 1.6e-10 and 3.5e-11 in the scenario `kepler`.
    assert error["REBOUND ias15"] < error["REBOUND whfast"] < error["Gauss(stages=8)"] < 1e-9, error


def test_every_method_has_the_same_start_times_and_step():
    report = orbits.compare(
        GIANTS, GAUSS, dt=30 * u.day, duration=-20 * u.yr, samples=7, against=("leapfrog", "whfast")
    )
    got = rows(report)
    for row in report.rows:
        assert row.steps == int(20 * 365.25 / 30), row  # the end is off the grid: a partial step of a copy
        assert row.series.energy[0] == row.series.angular_momentum[0] == row.series.position[0] == 0.0
        assert row.series.energy.shape == (7,)
    assert report.times[-1] == -20.0
    assert report.time_unit == "yr"
    assert got["Gauss(stages=8)"].wall_s > 0
    assert got["Gauss(stages=8)"].compile_s > 0
    assert got["REBOUND whfast"].compile_s is None


def test_all_methods_end_with_the_last_sample():
    """Ours went on to the duration, whose steps were in their seconds."""
    report = orbits.compare(GIANTS, GAUSS, dt=20, duration=1000.0, samples=[100.0, 200.0], against=("whfast",))
    assert {row.steps for row in report.rows} == {10}


def test_the_converged_reference_solution_agrees_with_ias15_which_shares_no_code_with_it():
    report = orbits.compare(GIANTS, GAUSS, dt=20, duration=3652.5, samples=11)
    assert report.reference.kind == "converged"
    assert report.length_unit == "km"
    got = rows(report)
    # Ten years of giants: metres, where a kilometre is 7e-9 au; the reference solution's own error is less.
    assert 0 < report.reference.error < 1e-3
    assert got["REBOUND ias15"].position < 1e-2
    assert got["Gauss(stages=8)"].position < 1e-2
    assert got["REBOUND whfast"].position > 100  # and it is not blind
    assert got["REBOUND whfast"].worst_body == "a rock"
    assert "Gauss(stages=8) at dt = 8 d, compared with 7 and 6 stages" in " ".join(report.table.split())
    assert "Peers share no code with it." in " ".join(report.table.split())


def test_a_tolerance_that_is_exceeded_fails_the_report_and_says_which():
    report = orbits.compare(
        GIANTS, [GAUSS, "stormer-verlet"], dt=20, duration=3652.5, samples=11, against=(),
        tolerances={"energy": 1e-12, "position_km": {"Saturn": 1.0}},
    )  # fmt: skip
    assert not report.ok
    got = rows(report)
    assert got["Gauss(stages=8)"].verdict == "ok"
    assert got["StormerVerlet()"].verdict == "FAIL"
    energy, saturn = got["StormerVerlet()"].failures
    assert re.fullmatch(r"max \|dE/E\| = .* exceeds 1.00e-12", energy)
    assert re.fullmatch(r"position of Saturn: .* km exceeds 1.00e\+00 km", saturn)
    assert f"FAIL  StormerVerlet(): {energy}" in report.table


def test_errors_are_the_largest_over_the_samples_not_the_last():
    problem = Problem.of(GIANTS)
    reference, v = (np.repeat(x[None], 3, axis=0) for x in problem.start[1:3])
    q = reference.copy()
    q[1, 3, 1] += 2.0**-20  # Jupiter, in the middle only
    q[1, 1, 2] -= 2.0**-19  # and the massless body, twice as far
    invariants = Invariants(problem.start)
    row = Sampled("a method", "peer", q, v, steps=2, wall_s=0.1).measured(problem, invariants, reference)
    km = u.au.to(u.km)
    assert row.worst_body == "a rock"
    assert row.position == pytest.approx(2.0**-19 * km, rel=1e-9)  # the coordinates' own rounding
    assert row.positions["Jupiter"] == pytest.approx(2.0**-20 * km, rel=1e-9)
    assert row.positions["Sun"] == 0.0
    assert row.series.position.tolist() == [0.0, row.positions["Jupiter"], 0.0]  # follows the massive bodies
    assert row.energy == row.series.energy[1] > 0.0


def test_a_peer_that_cannot_do_the_problem_has_a_row_with_the_reason():
    report = orbits.compare(FIGURE_EIGHT, GAUSS, dt=0.02, duration=6.3, samples=5, against=("whfast", "ias15"))
    whfast = rows(report)["REBOUND whfast"]
    assert (whfast.verdict, whfast.steps, whfast.energy) == ("n/a", None, None)
    assert "outweighs" in whfast.note
    assert rows(report)["REBOUND ias15"].energy < 1e-14
    assert report.ok
    assert any("angular momentum vanishes" in note for note in report.notes)


def test_a_method_of_ours_that_fails_fails_the_report_and_the_others_go_on():
    # At a step of half a period the stages of Gauss do not converge.
    report = orbits.compare(
        KEPLER, [GAUSS, "stormer-verlet"], dt=4.0, duration=40.0, samples=5, against="leapfrog", reference="exact"
    )
    got = rows(report)
    assert got["Gauss(stages=8)"].verdict == "FAIL"
    assert got["Gauss(stages=8)"].failures
    assert got["StormerVerlet()"].energy is not None
    assert got["REBOUND leapfrog"].energy is not None
    assert not report.ok
    assert issubclass(ConvergenceError, orbits.errors.IntegrationError)


def test_softening_reaches_every_method():
    softened = orbits.System(
        ["a", "b"],
        [1, 0.5],
        [[0, 0, 0], [1, 0, 0]],
        [[0, -0.2, 0], [0, 0.4, 0]],
        units=orbits.DIMENSIONLESS,
        softening=0.3,
    )
    report = orbits.compare(softened, GAUSS, dt=0.05, duration=20, samples=21, against=("ias15", "leapfrog", "whfast"))
    got = rows(report)
    assert report.reference.kind == "converged"
    assert got["REBOUND ias15"].position < 1e-12
    assert got["REBOUND ias15"].energy < 1e-14
    assert "softening" in got["REBOUND whfast"].note


def test_finished_runs_are_used_and_foreign_ones_refused(tmp_path):
    arguments = {"dt": 20.0, "duration": 3652.5, "samples": 11}
    run = orbits.propagate(GIANTS, GAUSS, **arguments)
    report = orbits.compare(GIANTS, GAUSS, runs=[run], against=(), **arguments)
    assert report.rows[0].wall_s == run.statistics.wall_time
    assert report.rows[0].steps == run.statistics.steps
    orbits.propagate(GIANTS, GAUSS, archive=tmp_path / "run.h5", **arguments)
    reopened = orbits.compare(
        GIANTS, GAUSS, runs=[orbits.Trajectory.open(tmp_path / "run.h5")], against=(), **arguments
    )
    assert reopened.rows[0].positions == report.rows[0].positions
    assert reopened.rows[0].wall_s is None
    with pytest.raises(InputError, match="another system, step or samples"):
        orbits.compare(GIANTS, GAUSS, runs=[run], against=(), **{**arguments, "dt": 10.0})
    moved = GIANTS.replaced(v=GIANTS.v * 1.001)
    with pytest.raises(InputError, match="another system, step or samples"):
        orbits.compare(moved, GAUSS, runs=[run], against=(), **arguments)
    with pytest.raises(InputError, match="not compared"):
        orbits.compare(GIANTS, "stormer-verlet", runs=[run], against=(), **arguments)


def test_the_number_of_threads_is_told_where_it_matters():
    arguments = {"dt": 20.0, "duration": 400.0, "samples": 3, "against": (), "reference": "none"}
    two = orbits.compare(GIANTS, GAUSS, threads=2, **arguments)
    assert "among 2 threads" in two.table
    assert "threads" not in orbits.compare(GIANTS, GAUSS, threads=1, **arguments).table
    assert "threads" not in orbits.compare(GIANTS.remove("a rock"), GAUSS, threads=2, **arguments).table


def test_no_reference_solution_measures_no_positions():
    report = orbits.compare(GIANTS, GAUSS, dt=20, duration=400, samples=3, against=(), reference="none")
    assert report.reference is None
    assert report.rows[0].position is None
    assert report.rows[0].energy is not None
    assert "not measured" in report.table


def test_the_report_of_a_comparison_is_strict_json_with_its_settings(tmp_path):
    report = orbits.compare(GIANTS, GAUSS, dt=20 * u.day, duration=400 * u.day, samples=3, title="Giants")
    record = json.loads(report.to_json(tmp_path / "r.json"))
    assert record["settings"]["title"] == "Giants"
    assert record["settings"]["dt"] == 20.0
    assert record["settings"]["time_unit"] == "d"
    assert record["settings"]["integrators"] == [{"name": "gauss", "parameters": {"stages": 8}}]
    assert record["settings"]["versions"]["rebound"]
    assert record["massive"] == ["Saturn", "Sun", "Jupiter"]
    assert len(record["rows"]) == 3
    assert (report.plot(tmp_path / "r.png")).stat().st_size > 10_000


def test_without_dt_ours_and_ias15_choose_their_steps_and_the_reference_is_a_taylor_series():
    report = orbits.compare(GIANTS.remove("a rock"), duration=3652.5, samples=11)
    assert report.reference.kind == "taylor"
    assert report.reference.error < 3e-7  # km: half of the last digit of Saturn's coordinates
    ours, ias15 = report.rows
    assert (ours.method, ias15.method) == ("Gauss(stages=8)", "REBOUND ias15")
    # Ten years of giants in 13 and 34 steps: 2e-7 and 5e-7 km.
    assert ours.steps < ias15.steps
    assert ours.position < 2e-6
    assert ias15.position < 5e-6
    settings = json.loads(report.to_json())["settings"]
    assert settings["dt"] is None
    assert "Steps: ours are chosen one by one, tolerance 1e-09; IAS15" in " ".join(report.table.split())
    loose = orbits.compare(GIANTS.remove("a rock"), dt=orbits.Adaptive(1e-3), duration=3652.5, samples=11, against=())
    assert loose.rows[0].steps < ours.steps
    assert loose.rows[0].position > 1e3 * ours.position
    assert loose.settings["tolerance"] == 1e-3
    assert "IAS15" not in loose.table


def test_a_peer_with_constant_steps_has_a_row_with_the_reason_where_there_is_no_dt():
    report = orbits.compare(FIGURE_EIGHT, GAUSS, duration=2.0, samples=3, against=("leapfrog", "ias15"))
    leapfrog = rows(report)["REBOUND leapfrog"]
    assert (leapfrog.verdict, leapfrog.steps) == ("n/a", None)
    assert "this comparison has no dt" in leapfrog.note
    assert rows(report)["REBOUND ias15"].position < 1e-13


@pytest.mark.parametrize(
    ("reference", "kind"), [("auto", "taylor"), ("taylor", "taylor"), (0.01, "converged"), ("none", None)]
)
def test_the_reference_of_a_comparison_without_dt_can_be_chosen(reference, kind):
    report = orbits.compare(FIGURE_EIGHT, duration=2.0, samples=3, against=(), reference=reference)
    assert (report.reference.kind if report.reference else None) == kind
    if kind is not None:
        assert report.rows[0].position < 1e-14  # 3e-16
    exact = orbits.compare(KEPLER.remove("circular").replaced(gm=[1.0, 1e-3]), duration=2.0, samples=3, against=())
    assert exact.reference.kind == "exact"


def test_a_taylor_series_can_be_the_reference_of_constant_steps_and_agrees_with_the_converged_one():
    arguments = {"dt": 20.0, "duration": 3652.5, "samples": 5, "against": ()}
    taylor, converged = (orbits.compare(GIANTS, GAUSS, reference=kind, **arguments) for kind in ("taylor", "converged"))
    assert taylor.reference.error < converged.reference.error
    for name in GIANTS.names:
        assert abs(taylor.rows[0].positions[name] - converged.rows[0].positions[name]) < 1e-4  # km


def test_a_series_that_would_take_long_is_left_out_and_the_report_says_so(monkeypatch):
    from orbits.regression import reference_choice

    monkeypatch.setattr(reference_choice, "AFFORDABLE", 1e-9)
    report = orbits.compare(FIGURE_EIGHT, duration=2.0, samples=3, against=())
    assert report.reference is None
    assert "reference='taylor' computes it nevertheless" in " ".join(report.table.split())
    assert orbits.compare(FIGURE_EIGHT, duration=2.0, samples=3, against=(), reference="taylor").reference is not None


def test_bodies_that_meet_leave_a_comparison_without_reference_and_without_a_run():
    falling = orbits.System(["a", "b"], [1, 1], [[-1, 0, 0], [1, 0, 0]], [[0, 0, 0]] * 2, units=orbits.DIMENSIONLESS)
    report = orbits.compare(falling, duration=3.0, samples=3, against=())
    assert not report.ok
    assert "a and b meet" in " ".join(report.failures)
    assert "reference solution failed" in " ".join(report.table.split())


def test_angular_momentum_of_bodies_that_begin_at_rest_is_measured():
    resting = orbits.System(
        ["a", "b", "c"], [3, 4, 5], [[1, 3, 0], [-2, -1, 0], [1, -1, 0]], [[0, 0, 0]] * 3, units=orbits.DIMENSIONLESS
    )
    report = orbits.compare(resting, duration=3.0, samples=7, against=(), tolerances={"angular_momentum": 1e-15})
    assert report.ok, report.table
    assert 0.0 < report.rows[0].angular_momentum < 1e-15
    assert any("angular momentum vanishes" in note for note in report.notes)


def test_finished_runs_without_dt_are_used_and_those_with_other_steps_refused(tmp_path):
    arguments = {"duration": 2.0, "samples": 3}
    run = orbits.propagate(FIGURE_EIGHT, archive=tmp_path / "run.h5", **arguments)
    report = orbits.compare(FIGURE_EIGHT, runs=[orbits.Trajectory.open(tmp_path / "run.h5")], against=(), **arguments)
    fresh = orbits.compare(FIGURE_EIGHT, against=(), **arguments)
    assert report.rows[0].positions == fresh.rows[0].positions
    for dt in (0.01, orbits.Adaptive(1e-8)):
        with pytest.raises(InputError, match="another system, step or samples"):
            orbits.compare(FIGURE_EIGHT, dt=dt, runs=[run], against=(), **arguments)


def test_a_comparison_ends_at_a_date_too():
    system = orbits.System.solar_system("2020-01-01", bodies=["Sun", "Jupiter", "Saturn"])
    report = orbits.compare(system, until="2019-01-01", samples=3, against=())
    assert report.times[-1] == -365.0
    assert report.rows[0].position < 1e-6


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"integrators": [GAUSS, "stormer-verlet"]}, r"StormerVerlet\(\) needs a dt"),
        ({"reference": "converged"}, "there is no dt; give its step"),
        ({"dt": "adaptive"}, r"expected dt=orbits.Adaptive\(\), or no dt"),
        ({"duration": None}, "neither duration nor until"),
    ],
)
def test_a_wrong_use_without_dt_is_refused_before_anything_runs(change, message, monkeypatch):
    from orbits.regression import comparison

    monkeypatch.setattr(comparison, "propagated", lambda *_, **__: pytest.fail("ran before it was checked"))
    with pytest.raises(InputError, match=message):
        orbits.compare(FIGURE_EIGHT, **{"duration": 2.0, "samples": 3, **change})


@each(
    ("change", "error", "message"),
    [
        ({"integrators": []}, InputError, "no integrator"),
        ({"integrators": 3}, InputError, "integrator must be a method"),
        ({"integrators": [GAUSS, GAUSS]}, InputError, "twice"),
        ({"integrators": "gaus"}, UnknownNameError, "gauss"),
        ({"against": ("whfsat",)}, UnknownNameError, "Did you mean 'whfast'"),
        ({"tolerances": {"enegry": 1.0}}, UnknownNameError, "Did you mean 'energy'"),
        ({"samples": 0}, InputError, "samples"),
        ({"samples": []}, InputError, "samples"),
        ({"dt": 0}, InputError, "dt"),
        ({"dt": 1 * u.km}, InputError, "dt"),
        ({"duration": math.inf}, InputError, "duration"),
        ({"reference": "perfect"}, InputError, "expected auto, exact"),
        ({"reference": "exact"}, InputError, "no exact solution"),
        ({"reference": "step-halved"}, InputError, "called 'converged' now"),
        ({"reference": 1 * u.km}, InputError, "reference"),
        ({"yardstick": "none"}, UnknownNameError, "no argument 'yardstick': it is called reference now"),
        ({"refrence": "none"}, UnknownNameError, "Did you mean reference"),
    ],
)
def test_a_wrong_use_is_refused_before_anything_runs(change, error, message, monkeypatch):
    from orbits.regression import comparison

    monkeypatch.setattr(comparison, "propagated", lambda *_, **__: pytest.fail("ran before it was checked"))
    arguments = {"integrators": GAUSS, "dt": 20.0, "duration": 400.0, "samples": 3, **change}
    with pytest.raises(error, match=message):
        orbits.compare(GIANTS, arguments.pop("integrators"), **arguments)
