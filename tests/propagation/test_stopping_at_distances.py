"""Runs that end where two bodies come to a distance: on the motion itself, for every kind of march."""


import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.errors import InputError
from orbits.events import Apocentre, CloserThan, Collision, FartherThan, Merge, Pericentre
from orbits.methods import Composition

from ..coverings import cover, only

FREE = {"samples": 2, "progress": False, "check_step": False}
METHODS = {
    "adaptive": {},
    "gauss": {"integrator": "gauss", "dt": 0.21},
    "kicks": {"integrator": Composition(order=8), "dt": 0.05},
    "map": {"integrator": "wisdom-holman", "dt": 0.21},
    "map that is left": {"integrator": orbits.WisdomHolman(encounters="follow planets"), "dt": 0.21},
}


def belt(particles=10):
    """A star, two planets, and massless bodies on eccentric orbits between them."""
    rng = np.random.default_rng(7)
    q, v = [[0, 0, 0], [4, 0, 0], [0, -9, 0]], [[0, 0, 0], [0, 0.5, 0], [1 / 3, 0, 0]]
    for angle in rng.uniform(0, 2 * np.pi, particles):
        x = np.array([np.cos(angle), np.sin(angle), 0.0])
        q.append((1 + 0.02 * len(q)) * x)
        v.append((1.05, 0.8)[len(q) % 2] * np.array([-x[1], x[0], 0.1]))
    gm, names = [1.0, 1e-4, 1e-4] + [0.0] * particles, ["star", "a", "b", *(f"p{k}" for k in range(particles))]
    return orbits.System(names, gm, q, v, units=orbits.DIMENSIONLESS)


def apart(system, body, other):
    k, j = (system.names.index(name) for name in (body, other))
    return float(np.linalg.norm(system.q[k] - system.q[j]).value)


def crossing(phase, nearest):
    """Two light bodies on orbits about a star that cross, which pass each other 3 + phase later."""
    q, v = [[0, 0, 0], [1, 0, 0], [1, 0, nearest]], [[0, 0, 0], [0, 1, 0], [0.25, 0.9, 0.05]]
    met = orbits.System(["star", "a", "b"], [1.0, 1e-13, 1e-13], q, v, units=orbits.DIMENSIONLESS)
    return orbits.propagate(met, duration=-3.0 - phase, **FREE)[-1]


@cover(("dt", "given"), [None, 0.3], ["stop", "events"], strength=1)
def test_a_limit_far_below_a_step_is_not_missed(dt, given):
    rng = np.random.default_rng(3)
    limit = 1e-5
    condition = CloserThan(limit, "a", "b", then="stop" if given == "events" else "record")
    for phase, share in rng.uniform([0, 0.05], [1, 0.9], (12, 2)):
        start = crossing(phase, share * limit)
        run = orbits.propagate(start, "gauss", dt=dt, duration=4.5, **{given: condition}, **FREE)
        assert run.stopped is not None
        # Positions of 1 are rounded to 1e-16, and their difference is 1e-5.
        assert apart(run.stopped.system, "a", "b") == pytest.approx(limit, rel=1e-10)


@pytest.mark.filterwarnings("ignore::orbits.errors.StepWarning")
@cover(("method", "kind", "sign"), METHODS, [CloserThan, FartherThan], [1, -1], strength=1)
def test_every_march_ends_at_the_bound_and_goes_on_as_if_it_had_not(method, kind, sign, tmp_path):
    options = {"duration": sign * 12.0, **FREE, **METHODS[method], "samples": 30}
    system, path = belt(), tmp_path / "run.h5"
    plain = orbits.propagate(system, **options)
    name = {CloserThan: "p3", FartherThan: "p2"}[kind]
    distances = np.linalg.norm((plain[name].q - plain["star"].q).value, axis=1)
    bound = 0.5 * (distances.min() + distances.max())
    stop = kind(bound, name, "star")
    run = orbits.propagate(system, archive=path, stop=stop, **options)
    assert run.stopped.condition is stop
    assert apart(run.stopped.system, name, "star") == pytest.approx(bound, rel=1e-13)  # some roundings
    passed = distances < bound if kind is CloserThan else distances > bound
    assert len(run) == np.argmax(passed)  # no sample after it, none before it left out
    assert np.array_equal(run.q, plain.q[: len(run)])
    assert abs(run.events.time[-1].value) == abs(run.stopped.time.value)
    run.close()
    while not run.complete:
        run = orbits.resume(path, progress=False)
    assert np.array_equal(run.q, plain.q)
    assert len(run.events) == np.sum(np.diff(passed.astype(int)) == 1)


@pytest.mark.parametrize("method", only(("adaptive",), METHODS))
def test_any_body_means_massless_ones_too(method):
    system, options = belt(), {"duration": 12.0, **FREE, **METHODS[method]}
    dense = orbits.propagate(system, **{**options, "samples": 241})
    least = np.linalg.norm((dense.q[:, 3:] - dense.q[:, :1]).value, axis=2)
    bound = 0.5 * (least[0].min() + least.min())
    run = orbits.propagate(system, stop=CloserThan(bound, other="star"), **options)
    first = np.argmax((least < bound).any(axis=1))
    body = f"p{np.argmin(least[first])}"
    assert run.stopped.reason.startswith(f"{body} and star: closer than")
    assert apart(run.stopped.system, body, "star") == pytest.approx(bound, rel=1e-13)
    assert dense.t[first - 1].value <= run.stopped.time.value <= dense.t[first].value


def test_a_pair_that_is_there_already_ends_a_run_when_it_gets_there_again():
    system = belt()
    run = orbits.propagate(system, duration=30.0, stop=CloserThan(1.2, "p0"), **FREE)
    path = orbits.propagate(system, duration=run.stopped.time, **{**FREE, "samples": 500})
    distances = np.linalg.norm((path["p0"].q - path["star"].q).value, axis=1)
    assert distances[0] < 1.1
    assert np.sum(np.diff((distances < 1.2).astype(int)) == 1) <= 1 < distances.max() / 1.2


def test_two_massless_bodies_end_a_run_as_well():
    system = belt()
    run = orbits.propagate(system, duration=12.0, stop=FartherThan(1.9, "p0", "p9"), **FREE)
    assert apart(run.stopped.system, "p0", "p9") == pytest.approx(1.9, rel=1e-10)


def test_an_interrupted_run_keeps_its_conditions(tmp_path):
    path, stop = tmp_path / "run.h5", FartherThan(1.15, "p2", "star")
    whole = orbits.propagate(belt(), duration=12.0, stop=stop, **FREE)
    options = {"duration": 12.0, "progress": False, "samples": 100}
    cut = orbits.propagate(belt(), archive=path, stop=stop, callback=lambda t, state: t.value > 0.1, **options)
    assert cut.stopped.condition is None
    cut.close()
    resumed = orbits.resume(path, progress=False)
    assert resumed.stopped.time == whole.stopped.time
    assert np.array_equal(resumed.stopped.system.q, whole.stopped.system.q)


def test_what_is_recorded_beside_comes_in_order_and_ends_with_the_run():
    system, bound = belt(), 1.15
    beside = [Pericentre("a"), Apocentre("p2"), FartherThan(0.98 * bound, "p2", "star")]
    every = orbits.propagate(system, duration=12.0, events=[*beside, FartherThan(bound, "p2", "star")], **FREE)
    run = orbits.propagate(system, duration=12.0, events=beside, stop=FartherThan(bound, "p2", "star"), **FREE)
    last = run.stopped.time
    assert run.events.kind.tolist() == every.events.kind[every.events.time <= last + 1e-9 * u.one].tolist()
    assert run.events.time[-1] == last


def test_a_passage_in_a_single_step_of_a_massless_body_with_steps_of_its_own_is_found():
    q, v = [[0, 0, 0], [400.0, 0, 0], [-0.3, 1e-3, 0]], [[0, 0, 0], [0, 0.05, 0], [2.7, 0, 0]]
    system = orbits.System(["star", "far", "p"], [1.0, 1e-4, 0.0], q, v, units=orbits.DIMENSIONLESS)
    swept, inverse = 2.7e-3, 2.0 / 0.3 - 2.7**2
    nearest = swept**2 / (1.0 + np.sqrt(1.0 - swept**2 * inverse))
    run = orbits.propagate(system, duration=1.0, stop=CloserThan(1.5 * nearest), **FREE)
    assert apart(run.stopped.system, "p", "star") == pytest.approx(1.5 * nearest, rel=1e-12)


CIRCLE = orbits.System(
    ["S", "A"], [1.0, 0.0], [[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [0, 1, 0]], units=orbits.DIMENSIONLESS
)


@cover(
    ("how", "kind"),
    [("gauss", 1 / 16), ("gauss", None), ("wisdom-holman", 1 / 16)],
    [CloserThan, FartherThan],
    strength=1,
)
def test_rounding_ends_no_run(how, kind):
    """A circle of the radius of the bound is at it all the time; by rounding alone it passes it again and again."""
    method, dt = how
    assert orbits.propagate(CIRCLE, method, dt=dt, duration=12.0, stop=kind(1.0, "S", "A"), **FREE).complete


@pytest.mark.parametrize(("kind", "least", "speed"), [(CloserThan, 0.6, 0.7), (FartherThan, 1.05, 1.1)])
def test_a_run_from_where_another_stopped_goes_on_to_the_next_time(kind, least, speed):
    """The distance there is that of the bound but for rounding, on either side."""
    system = CIRCLE.replaced(v=[[0, 0, 0], [0.3, speed, 0.2]])
    for bound in least + 0.1 * np.arange(4):
        first = orbits.propagate(system, dt=1 / 8, duration=40.0, stop=kind(bound, "S", "A"), **FREE)
        again = orbits.propagate(first.stopped.system, dt=1 / 8, duration=40.0, stop=kind(bound, "S", "A"), **FREE)
        period = 2.0 * np.pi * float(system.elements("S").a.value[0]) ** 1.5
        assert again.stopped.time.value == pytest.approx(period, rel=1e-9)  # a revolution later, at the same anomaly


def test_what_a_run_with_changes_does_not_find_is_refused():
    system = CIRCLE.replaced(gm=[1.0, 1e-9], radii=[0.1, 0.0])
    far = FartherThan(3.0, "S", "A")
    with pytest.raises(InputError, match=r"stop=FartherThan\(\.\.\.\) looks at bodies that stay the same"):
        orbits.propagate(system, duration=1.0, events=Collision(then=Merge()), stop=far, **FREE)
    backwards = [Collision(then=Merge()), FartherThan(3.0, "S", "A", then="stop")]
    with pytest.raises(InputError, match="in a run backwards in time"):
        orbits.propagate(system, duration=-1.0, events=backwards, **FREE)
