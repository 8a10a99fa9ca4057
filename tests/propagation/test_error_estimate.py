"""Error bars contain the errors, are not much larger, and say what they do not know."""

from __future__ import annotations

import pickle
import warnings

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.elements import state_from_elements
from orbits.errors import InputError, Interrupted, UnknownNameError
from orbits.marching.legs.block_loop import BlockLoop
from orbits.marching.stepping import bound_loops
from orbits.propagation.results import error_estimate
from orbits.regression.reference import exact
from orbits.results import error_bars

from ..coverings import cover, first

GAUSS, VERLET = orbits.Gauss(stages=8), orbits.StormerVerlet()
YEAR = 2 * np.pi

pytestmark = pytest.mark.filterwarnings("ignore::orbits.errors.OrbitsWarning")


def lengths(x):
    return np.linalg.norm(x, axis=-1)


def binary(e=0.5, m=0.3, rng=None):
    angles = {} if rng is None else dict(zip(("Omega", "omega", "M"), rng.uniform(0, YEAR, 3), strict=True))
    q, v = state_from_elements(1.0, a=1.0, e=e, inc=0.7, **({"M": 0.1} | angles))
    return orbits.System(["A", "B"], [1 - m, m], [-m * q, q - m * q], [-m * v, v - m * v], units=orbits.DIMENSIONLESS)


def planets(*particles):
    """A star and two planets, all in three dimensions."""
    system = binary(0.1, 1e-4)
    q, v = state_from_elements(1.0, a=2.6, e=0.05, inc=0.6, Omega=1.0)
    q, v = np.vstack([system.values.q, q]), np.vstack([system.values.v, v])
    out = orbits.System(["A", "B", "C"], [*system.values.gm, 1e-4], q, v, units=orbits.DIMENSIONLESS)
    for k, (name, a, e) in enumerate(particles):
        out = out.add(name, primary="A", a=a, e=e, M=3.0 + 0.3 * k)
    return out


def burrau():
    q = [[1, 3, 0], [-2, -1, 0], [1, -1, 0]]
    return orbits.System(["a", "b", "c"], gm=[3, 4, 5], q=q, v=np.zeros((3, 3)), units=orbits.DIMENSIONLESS)


def run_of(system, method=GAUSS, duration=20 * YEAR, **options):
    return orbits.propagate(system, method, duration=duration, **{"samples": 13, "check_step": False, **options})


def judged(bar, error, least):
    """Return whether each error is within its bar, and whether the bar is more than thirty times the error.

    least : errors below this are those of the float64 samples themselves
    """
    return error <= bar, bar > 30 * np.maximum(error, least)


def test_bars_contain_the_errors_of_binaries_against_the_exact_solution_and_are_rarely_thirty_times_larger():
    rng = np.random.default_rng(2)
    within, beyond = [], []
    for k in range(24):
        system = binary(rng.uniform(0.1, 0.8), rng.uniform(0.1, 0.5), rng)
        ways = (GAUSS, None), (GAUSS, YEAR / 60), (VERLET, YEAR / 900), (orbits.Gauss(stages=4), YEAR / 80)
        method, dt = ways[k % 4]
        run = run_of(system, method, dt=dt, duration=YEAR * 10 ** rng.uniform(0.3, 1.5), samples=5)
        error = lengths(run.q.value - exact(system.values, run.times).q)[1:]
        bar = run.error_estimate().position.value[1:]
        inside, large = judged(bar, error, lengths(np.spacing(np.abs(run.q.value[1:]))) / 4)
        within.append(inside)
        beyond.append(large)
    assert np.mean(within) > 0.9  # 0.97 seen
    assert np.mean(beyond) < 0.1  # 0.02 seen


@pytest.mark.parametrize(
    ("method", "steps"), [(VERLET, 400), (orbits.Gauss(stages=2), 60), (orbits.methods.Composition(order=6), 30)]
)
def test_where_the_steps_limit_a_run_the_bar_is_twice_its_error(method, steps):
    system = binary(0.3)
    run = run_of(system, method, dt=YEAR / steps, duration=5 * YEAR)
    bars = run.error_estimate()
    ratio = bars.position.value[1:] / lengths(run.q.value - exact(system.values, run.times).q)[1:]
    # The extrapolation by the order misses the error by the next power of the step, a tenth here, and by more where an
    # error passes through zero: 1.6 ... 2.7 seen.
    assert np.median(ratio) == pytest.approx(error_bars.SAFETY, rel=0.15)
    # Of the error of the steps, the second companion leaves what the order does not tell: 4e-5 at most.
    assert np.median((bars.by_rounding[1:] / bars.by_steps[1:]).value) < 1e-4
    assert "steps" in repr(bars)


@cover(("dt", "away"), [None, YEAR / 30], [0.0, 100.0], strength=1)
def test_the_second_companion_differs_by_round_off_not_by_the_response_to_another_start(dt, away):
    logs = []
    for e in (0.1, 0.2, 0.3):
        values = binary(e).values
        q = values.q + away  # as of a planet with a moon: the last digits of the start are a hundred times coarser
        system = orbits.System(["A", "B"], values.gm, q, values.v, units=orbits.DIMENSIONLESS)
        run = run_of(system, dt=dt, duration=100 * YEAR)
        error = lengths(run.q.value - exact(system.values, run.times).q)[6:]
        own = run.error_estimate().by_rounding.value[6:]
        logs.append(0.5 * np.log(np.mean(own**2) / np.mean(error**2)))
    # The ratio of two random walks scatters by a factor of a few: 0.5 ... 4 here. That of a run from a start changed by
    # a tenth of a unit in the last place is 50 and 230 for the pair far away, and grows with time.
    assert 0.2 < np.exp(np.mean(logs)) < 10


def test_a_strict_tolerance_is_compared_with_a_looser_one_so_that_the_companion_can_still_be_marched():
    clock = orbits.Adaptive(1e-12)
    assert clock.finer(GAUSS, 0.7).tolerance > clock.tolerance
    assert orbits.Adaptive().finer(GAUSS, 0.7).tolerance == pytest.approx(1e-9 * 0.7**7)
    backwards = orbits.Adaptive().towards(-1.0)
    assert backwards.finer(GAUSS, 0.7).direction == -1.0
    bars = run_of(binary(0.6), dt=clock).error_estimate()
    assert bars.position.value.max() < 1e-11  # 1e-13 seen


def test_finer_constant_steps_keep_their_direction_and_have_24_bits():
    finer = orbits.propagate(binary(), dt=0.1, duration=-1).clock.finer(GAUSS, 0.7)
    assert finer.h == pytest.approx(-0.07, rel=1e-7)
    assert np.float32(finer.h) == finer.h


def test_the_error_of_a_symplectic_step_grows_linearly_and_in_chaos_exponentially():
    linear = run_of(planets(), VERLET, dt=YEAR / 500, duration=30 * YEAR, samples=31).error_estimate()
    assert not linear["B"].growth.exponential
    assert linear["B"].growth.power == pytest.approx(1.0, abs=0.15)
    chaos = run_of(burrau(), duration=60, samples=61).error_estimate()
    assert all(growth.exponential for growth in chaos.growth)
    # 17 digits are lost to 6 from the first encounters on: tenfold in 6 to 9.
    assert 4 < chaos["a"].growth.tenfold.value < 12
    assert str(chaos["a"].growth).startswith("tenfold in")


def test_when_the_phase_is_lost_the_bar_is_as_large_as_the_orbit_and_says_since_when():
    run = run_of(binary(0.4), VERLET, dt=YEAR / 30, duration=40 * YEAR, samples=81)
    bars = run.error_estimate()
    lost = bars["B"].lost
    assert 0 < lost.value < 40 * YEAR
    apart = lengths(run.q.value[:, 0] - run.q.value[:, 1])
    before, after = run.times < lost.value, run.times >= lost.value
    assert (bars["B"].position.value[before] < 0.5 * apart[before]).all()
    assert (np.diff(bars["B"].position.value[after]) >= 0).all()
    assert bars["B"].position.value[after][0] >= 0.5 * apart[after][0]
    assert "phase lost from t =" in repr(bars)
    assert "phase lost from t =" in repr(bars["B"])
    assert np.isnan(run_of(binary(0.4)).error_estimate().lost.value).all()


def test_the_start_has_no_error_and_a_sample_at_least_that_of_its_rounding():
    run = run_of(binary(0.1), duration=1e-3, samples=[0.0, 1e-3])
    bar = run.error_estimate().position.value
    assert (bar[0] == 0).all()
    assert (bar[1] >= 0.5 * lengths(np.spacing(np.abs(run.q.value[1])))).all()


def test_a_companion_that_fails_leaves_infinite_bars_and_a_note():
    bars = run_of(burrau(), dt=1e-3, duration=30, samples=31).error_estimate()
    assert any(note.startswith("the companion with finer steps failed: step") for note in bars.notes)
    assert np.isinf(bars.position.value[-1]).all()
    assert np.isfinite(bars.position.value[3]).all()
    assert bars.notes[0] in repr(bars)
    assert "unknown" in repr(bars)


def test_a_retired_particle_has_no_bars_afterwards_and_others_keep_theirs():
    falling = [(f"falls {k}", 0.3 + 0.1 * k, 1 - 1e-13) for k in range(8)]
    run = run_of(planets(*falling, ("stays", 0.4, 0.1)), dt=YEAR / 100)
    assert 0 < len(run.retired) <= 8
    bars = run.error_estimate()
    np.testing.assert_array_equal(np.isnan(bars.position.value), np.isnan(run.q.value[..., 0]))
    assert np.isfinite(bars["stays"].position.value).all()
    assert bars["stays"].position.value[-1] > 0


@pytest.mark.parametrize("method", first(1, [GAUSS, orbits.Gauss(stages=3)]))
def test_terms_and_forces_act_on_the_companions_too(method):
    pole = [0.0, 0.6, 0.8]
    system = planets().with_terms(
        orbits.terms.FrameDragging("A", spin=1e-3, pole=pole, c=100.0),
        orbits.terms.ZonalHarmonics("A", J2=1e-4, radius=0.01, pole=pole),
    )
    system = system.with_forces(*(orbits.terms.Drag(rate=1e-4, bodies=[name]) for name in ("B", "C")))
    bars = run_of(system, method, dt=YEAR / 40).error_estimate()
    coarse = bars["B"].position.value[-1]
    assert 0 < coarse < (1e-12 if method is GAUSS else 1e-3)  # without the drag in a companion, 0.3


def test_bars_of_an_archive_are_those_of_the_run_that_wrote_it(tmp_path):
    run = run_of(planets(), dt=YEAR / 40, archive=tmp_path / "run.h5", error_estimate=True)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        again = orbits.Trajectory.open(tmp_path / "run.h5")
    memory = run_of(planets(), dt=YEAR / 40)
    for other in (again, memory):
        np.testing.assert_array_equal(other.error_estimate().position, run.error_estimate().position)
        np.testing.assert_array_equal(other.error_estimate().velocity, run.error_estimate().velocity)
    again.close()


def test_with_error_estimate_the_bars_are_made_with_the_run_whose_bits_stay(monkeypatch):
    plain = run_of(planets())
    run = run_of(planets(), error_estimate=True)
    np.testing.assert_array_equal(run.q, plain.q)
    assert plain.error_bars is None
    monkeypatch.setattr(error_estimate, "bound", None)  # nothing is marched any more
    assert run.error_estimate() is run.error_estimate()
    assert pickle.loads(pickle.dumps(run)).error_estimate().position[-1, 1] == run.error_estimate().position[-1, 1]


def test_samples_of_a_run_have_the_bars_of_the_run_in_any_order_and_backwards():
    run = run_of(planets(), duration=-20 * YEAR)
    bars = run.error_estimate().position
    np.testing.assert_array_equal(run[3:9:2].error_estimate().position, bars[3:9:2])
    some = run.at(run.t[[7, 2, 2, 12]]).error_estimate().position
    # `run.at` starts from the samples, which are rounded: their bars are a unit in the last place larger or smaller.
    np.testing.assert_allclose(some.value, bars[[7, 2, 2, 12]].value, atol=2e-15)


def test_a_moon_has_smaller_bars_relative_to_its_planet():
    system = orbits.System.solar_system("2026-01-01", bodies=["Sun", "Earth", "Moon", "Jupiter"])
    run = orbits.propagate(system, VERLET, dt=0.25 * u.day, duration=2 * u.yr, check_step=False)
    bars = run.error_estimate()
    near = bars.relative_to("earth")
    assert (near["Earth"].position == 0).all()
    # The Moon runs ahead by the error of its own orbit, which is a hundred times that of the Earth's around the Sun.
    ratio = near["Moon"].position[-1] / bars["Moon"].position[-1]
    assert 0.2 < ratio < 2
    assert "relative to Earth" in repr(near)
    assert bars.position.unit == u.au
    assert "position [km]" in repr(bars)
    assert "km at the end" in repr(bars["Moon"])


def test_bars_convert_to_a_table():
    bars = run_of(planets()).error_estimate()
    table = bars.to_table(["C", "A"])
    assert len(table) == 2 * len(bars)
    assert list(table["body"][:3]) == ["C", "A", "C"]
    assert table["position"][-2] == bars["C"].position[-1]
    assert "<table>" in bars._repr_html_()
    with pytest.raises(UnknownNameError, match="no body"):
        bars["D"]


def test_what_cannot_be_estimated_is_refused():
    run = run_of(planets())
    with pytest.raises(InputError, match="no samples yet"):
        run[:0].error_estimate()
    with pytest.raises(InputError, match=r"error_estimate is .yes.; expected True or False"):
        run_of(planets(), error_estimate="yes")

    class Foreign:
        label = "ias15"

    other = orbits.Trajectory(run.system, run.times, run.q.value, run.v.value, step=np.nan, integrator=Foreign())
    with pytest.raises(InputError, match=r"run\.error_estimate .* ias15 is not a method of this package"):
        other.error_estimate()
    unknown = orbits.Trajectory(run.system, run.times, run.q.value, run.v.value, step=np.nan, integrator=GAUSS)
    with pytest.raises(InputError, match="no known steps"):
        unknown.error_estimate()


def test_more_bars_than_fit_into_memory_are_refused_with_a_remedy(monkeypatch):
    run = run_of(planets())
    monkeypatch.setattr(error_estimate, "memory", lambda: 1000.0)
    with pytest.raises(InputError, match=r"run\[::10\]\.error_estimate"):
        run.error_estimate()


def test_an_interrupt_of_the_estimate_leaves_the_run(monkeypatch):
    class Stopped(error_estimate.StopRequest):
        def __enter__(self):
            self.name = "Ctrl-C"
            return self

        def __exit__(self, *error):
            pass

    monkeypatch.setattr(error_estimate, "StopRequest", Stopped)
    with pytest.raises(Interrupted, match="Ctrl-C came while the error was estimated") as caught:
        run_of(planets(), error_estimate=True)
    assert len(caught.value.trajectory) == 13


def test_an_estimate_ends_after_the_block_in_which_it_is_interrupted(monkeypatch):
    class Later(error_estimate.StopRequest):
        asked = 0

        @property
        def name(self):
            self.asked += 1
            return "Ctrl-C" if self.asked > 2 else ""

        @name.setter
        def name(self, name):
            pass

    run, marched, real = run_of(planets(), samples=2), [], BlockLoop.one_block
    monkeypatch.setattr(error_estimate, "StopRequest", Later)
    monkeypatch.setattr(bound_loops, "PATH_BYTES", 1)
    monkeypatch.setattr(BlockLoop, "one_block", lambda self, most: marched.append(most) or real(self, most))
    with pytest.raises(Interrupted):
        run.error_estimate()
    assert len(marched) < 8 < run.statistics.steps / bound_loops.LEAST_BLOCK


@pytest.mark.nightly
def test_runs_in_transformed_time_have_bars_and_runs_with_mergers_say_why_they_have_none():
    bars = run_of(burrau(), dt=orbits.TimeTransformed(step=0.3), duration=20).error_estimate()
    assert 0 < bars.position.value[-1].max() < 1e-11  # 1e-13 seen
    orbit = {"gm": 1e-6, "radius": 0.05, "e": 0.1}
    bodies = {"star": {"gm": 1.0, "radius": 0.05}, "a": {**orbit, "a": 1.0}}
    bodies["b"] = {**orbit, "a": 1.1, "l": 1.0, "pomega": 3.0}
    disc = orbits.System.from_elements(bodies, units=orbits.DIMENSIONLESS)
    run = run_of(disc, events=orbits.events.Collision(then=orbits.events.Merge()), error_estimate=True)
    assert len(run.events) == 1
    with pytest.raises(InputError, match=r"the same bodies from start to end, but in this run bodies merge, bounce"):
        run.error_estimate()
