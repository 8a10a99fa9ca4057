"""Eight systems in lanes: each has the bits that it has alone, in its states and in what observers see."""

from __future__ import annotations

import numpy as np
import pytest

import orbits
from orbits.lagrangians.newtonian import newtonian, parameters
from orbits.marching.marcher import Marcher
from orbits.marching.stepping.systems_in_lanes import Lanes
from orbits.propagation.side_by_side import groups_of

K = 0.01720209895
"""Gauss's constant, in au^(3/2) and days: the square root of the Sun's GM."""

METHODS = {
    "standard": orbits.WisdomHolman(kernel="standard", corrector=0),
    "modified": orbits.WisdomHolman(),
    "lazy": orbits.WisdomHolman(kernel="lazy", corrector=11),
    "second corrector": orbits.WisdomHolman(corrector2=True),
    "verlet": orbits.StormerVerlet(),
    "euler": orbits.SymplecticEuler(),
    "composition": orbits.Composition(order=4, scheme="suzuki"),
    "drift first": orbits.Composition(order=6, scheme="blanes-moan"),
}


def planets(
    n: int, seed: int, eccentricity: float = 0.05, spacing: float = 1.6
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return GM, positions and velocities of a star and n - 1 planets, in an order of their own."""
    rng = np.random.default_rng(seed)
    a = 0.4 * spacing ** np.arange(n - 1) * (1.0 + 0.05 * rng.random(n - 1))
    gm = K**2 * np.array([1.0, *(10.0 ** rng.uniform(-7.0, -3.0, n - 1))])
    angle, e = rng.uniform(0.0, 2.0 * np.pi, n - 1), eccentricity * rng.random(n - 1)
    r, speed = a * (1.0 + e), K / np.sqrt(a) * np.sqrt((1.0 - e) / (1.0 + e))
    q, v = np.zeros((n, 3)), np.zeros((n, 3))
    q[1:] = (r * np.array([np.cos(angle), np.sin(angle), 0.03 * np.sin(2.0 * angle)])).T
    v[1:] = (speed * np.array([-np.sin(angle), np.cos(angle), 0.03 * np.cos(angle)])).T
    order = rng.permutation(n)
    return gm[order], q[order] + [1.0, 0.0, 0.1], v[order] + [1e-3, 0.0, 0.0]


def march(method: orbits.integrators.base.Integrator, bodies: tuple[np.ndarray, ...], h: float) -> Marcher:
    gm, q, v = bodies
    return Marcher(newtonian, method, parameters(gm), gm > 0.0, q, v, h)


def assert_same(marchers: list[Marcher], alone: list[Marcher], steps: int) -> None:
    """March blocks of eight at once, and each alone, and compare."""
    lanes = Lanes(marchers)
    for count in (1, 7, steps):
        lanes.march(range(len(marchers)), count)
        for one, other in zip(marchers, alone, strict=True):
            one.advance(count)
            other.advance(count)
            mine, theirs = one.checkpoint(), other.checkpoint()
            for name in theirs:
                size = 3 * len(one.names or one.state()[0]) if name in ("q", "q_lo", "v", "v_lo") else None
                assert mine[name][:size].tobytes() == theirs[name][:size].tobytes(), name


@pytest.mark.parametrize("n", [2, 4, 6, 9])
@pytest.mark.parametrize("method", METHODS)
def test_each_of_eight_systems_in_lanes_has_the_bits_it_has_alone(method, n):
    systems = [planets(n, seed) for seed in range(8)]
    h = 2.0 if n % 4 else -2.0
    pairs = [[march(METHODS[method], bodies, h) for bodies in systems] for _ in range(2)]
    assert_same(*pairs, 60)


@pytest.mark.parametrize("count", [9, 10, 16, 17])
@pytest.mark.parametrize("method", ["standard", "modified", "lazy"])
def test_planets_of_several_registers_have_in_lanes_the_bits_they_have_alone(count, method):
    # Close to each other, so that pulls between registers are large enough for the order of their sums to show.
    systems = [planets(count + 1, seed, spacing=1.2) for seed in range(8)]
    pairs = [[march(METHODS[method], bodies, 2.0) for bodies in systems] for _ in range(2)]
    assert_same(*pairs, 60)


SCATTERED = {
    "one falls to the star": (10, 9, 0.05),
    "two meet twice in ten steps": (11, 6, 0.3),
}
"""Seeds, numbers of bodies and eccentricities."""


@pytest.mark.parametrize("what", SCATTERED)
def test_approaches_of_planets_that_scatter_each_other_are_those_found_step_by_step(what):
    seed, n, eccentricity = SCATTERED[what]
    bodies = planets(n, seed, eccentricity, spacing=1.2)
    star = int(bodies[0].argmax())
    order = [star, *(k for k in range(n) if k != star)]
    whole, by_steps = (march(METHODS["standard"], tuple(x[order] for x in bodies), 2.0) for _ in range(2))
    assert whole._watcher._planets
    by_steps._watcher._planets = False
    whole.advance(3000)
    for _ in range(3000):
        by_steps.advance(1)
    found, known = whole.approaches()[0], by_steps.approaches()[0]
    there = np.isfinite(known)
    assert np.allclose(found[there], known[there], rtol=1e-9, atol=0.0)


@pytest.mark.parametrize("count", [5, 7])
def test_lanes_that_are_left_change_nothing(count):
    systems = [planets(5, seed) for seed in range(count)]
    pairs = [[march(METHODS["modified"], bodies, 3.0) for bodies in systems] for _ in range(2)]
    assert_same(*pairs, 60)


def test_a_planet_whose_steps_are_long_does_not_change_the_others():
    systems = [planets(4, seed, 0.95 if seed == 3 else 0.05) for seed in range(8)]
    pairs = [[march(METHODS["modified"], bodies, 25.0) for bodies in systems] for _ in range(2)]
    assert_same(*pairs, 200)


def test_more_bodies_than_lanes_are_marched_in_lanes_by_kicks_and_drifts():
    systems = [planets(13, seed) for seed in range(8)]
    pairs = [[march(METHODS["verlet"], bodies, 2.0) for bodies in systems] for _ in range(2)]
    assert_same(*pairs, 30)


def solar(k: int, **options) -> orbits.System:
    gm, q, v = planets(5, k)
    return orbits.System.from_states(["a", "b", "c", "d", "e"], gm, q, v, **options)


class Spy:
    """Counts the blocks that are computed in lanes."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.blocks: list[int] = []
        usual = Lanes.march

        def march(lanes: Lanes, members: list[int], count: int) -> None:
            self.blocks.append(len(members))
            usual(lanes, members, count)

        monkeypatch.setattr(Lanes, "march", march)


def same(run: orbits.Trajectory, other: orbits.Trajectory) -> bool:
    return run.q.value.tobytes() == other.q.value.tobytes() and run.v.value.tobytes() == other.v.value.tobytes()


@pytest.mark.parametrize("method", [METHODS["modified"], METHODS["verlet"]], ids=["wisdom-holman", "stormer-verlet"])
@pytest.mark.parametrize("dt", ["2 d", "-2 d"])
def test_a_list_is_propagated_in_lanes_to_the_bits_and_approaches_of_each_alone(monkeypatch, method, dt):
    spy = Spy(monkeypatch)
    systems = [solar(k) for k in range(13)]
    options = {"dt": 2.0, "duration": 700.5 if dt == "2 d" else -700.5, "samples": 8, "check_step": False}
    runs = orbits.propagate(systems, method, threads=1, **options)
    assert set(spy.blocks) == {8, 5}
    for k, (run, system) in enumerate(zip(runs, systems, strict=True)):
        alone = orbits.propagate(system, method, **options)
        assert same(run, alone), k
        assert [str(one) for one in run.closest_approaches()] == [str(one) for one in alone.closest_approaches()], k
        assert run.statistics.steps == alone.statistics.steps
        assert run.statistics.evaluations == alone.statistics.evaluations


def test_a_system_that_stops_leaves_the_others_in_lanes(monkeypatch):
    spy = Spy(monkeypatch)
    many = [solar(k) for k in range(40)]
    options = {"dt": 2.0, "duration": 1000.0, "samples": 501, "check_step": False}
    seen = orbits.propagate(many, METHODS["modified"], threads=1, **options)
    apart = np.array([np.linalg.norm((run.q[:, 1] - run.q[:, 2]).value, axis=1) for run in seen])
    bound = float(np.median(apart[:, 0]))
    stops = np.flatnonzero((apart[:, 0] < 0.99 * bound) & (apart.max(axis=1) > 1.01 * bound))
    stays = np.flatnonzero(apart.max(axis=1) < 0.99 * bound)
    systems = [many[k] for k in (*stays[:6], *stops[:2])]
    options["stop"] = orbits.FartherThan(bound, "b", "c")
    spy.blocks.clear()
    runs = orbits.propagate(systems, METHODS["modified"], threads=1, **options)
    alone = [orbits.propagate(system, METHODS["modified"], **options) for system in systems]
    stopped = [run.stopped is not None for run in runs]
    assert stopped == [False] * 6 + [True] * 2
    assert min(spy.blocks) == 6
    for run, other in zip(runs, alone, strict=True):
        assert same(run, other)
        assert (run.stopped and run.stopped.time) == (other.stopped and other.stopped.time)


def test_what_lanes_do_not_hold_is_marched_alone(monkeypatch):
    spy = Spy(monkeypatch)
    systems = [solar(k) for k in range(8)]
    options = {"dt": 2.0, "duration": 20.0, "samples": 2, "check_step": False, "threads": 1}
    orbits.propagate(systems, METHODS["modified"], dense=True, **options)
    orbits.propagate(systems, METHODS["modified"], events=orbits.CloseApproach("a", "b"), **options)
    orbits.propagate(systems, "gauss", **options)
    with_particles = [
        orbits.System.from_states([*"abcdef"], [*s.values.gm, 0.0], np.vstack([s.values.q, [[9, 0, 0]]]),
                                  np.vstack([s.values.v, [[0, K / 3, 0]]]))
        for s in systems
    ]  # fmt: skip
    orbits.propagate(with_particles, METHODS["modified"], **options)
    star = [s.names[int(s.values.gm.argmax())] for s in systems]
    oblate = [s.with_terms(orbits.ZonalHarmonics(name, J2=1e-3, radius=0.01, pole=[0, 0, 1]))
              for s, name in zip(systems, star, strict=True)]  # fmt: skip
    orbits.propagate(oblate, METHODS["modified"], **options)
    orbits.propagate([solar(k, softening=0.01) for k in range(4)], "stormer-verlet", **options)
    assert spy.blocks == []
    orbits.propagate([solar(k, softening=0.01) for k in range(5)], "stormer-verlet", **options)
    assert spy.blocks == [5]


def test_groups_leave_no_thread_idle_for_the_sake_of_lanes():
    class Bound:
        marcher = march(METHODS["modified"], planets(4, 0), 1.0)

    def sizes(count: int, threads: int) -> list[int]:
        return [len(group) for group in groups_of(dict.fromkeys(range(count), Bound), threads)]

    assert sizes(64, 2) == [8] * 8
    assert sizes(19, 2) == [8, 8, 1, 1, 1]
    assert sizes(8, 1) == [8]
    assert sizes(8, 8) == [1] * 8


def test_archives_of_a_list_in_lanes_are_resumed_in_lanes(monkeypatch, tmp_path):
    spy = Spy(monkeypatch)
    systems = [solar(k) for k in range(6)]
    options = {"dt": 2.0, "check_step": False, "threads": 1}
    orbits.propagate(systems, METHODS["modified"], duration=401.0, samples=3, archive=tmp_path / "runs", **options)
    before = len(spy.blocks)
    runs = orbits.resume(sorted((tmp_path / "runs").glob("*.h5")), until=802.0, threads=1)
    assert len(spy.blocks) > before > 0
    whole = orbits.propagate(systems, METHODS["modified"], duration=802.0, samples=5, **options)
    assert [same(*pair) for pair in zip(runs, whole, strict=True)] == [True] * 6


def test_pericentres_that_steps_do_not_resolve_are_listed_as_for_systems_alone() -> None:
    bodies = [planets(3, seed, eccentricity=0.9) for seed in range(8)]
    method = METHODS["modified"]
    marchers, alone = ([march(method, each, 12.0) for each in bodies] for _ in range(2))
    assert_same(marchers, alone, 400)
    listed = [len(one.passages()[0]) for one in alone]
    assert max(listed) > 10
