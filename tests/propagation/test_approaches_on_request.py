"""Closest approaches are looked for where that costs little or is asked for; all else of a run is the same without."""

from __future__ import annotations

import warnings
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import orbits
from orbits import ensemble
from orbits.archive import Archive, header
from orbits.errors import ArchiveError, InputError
from orbits.integrators import registry
from orbits.integrators.base import Integrator
from orbits.lagrangians.newtonian import newtonian
from orbits.viewing.data import ViewData

from ..coverings import STANDARD, only

VERLET, MAP = orbits.StormerVerlet(), orbits.WisdomHolman()
QUIET = {"check_step": False, "progress": False}
SHORT: dict[str, Any] = {"dt": 1 / 32, "duration": 1.0, "samples": 3, **QUIET}

METHODS = [one for kind in registry().values() for one in kind.examples() if one.serves(newtonian)]
METHODS += [orbits.methods.Composition(orbits.Gauss(stages=1), order=4)]
LOOKING = ("gauss", "implicit-midpoint", "lobatto-iiia-iiib", "lobatto-iiib-iiia", "vprk")
"""The methods that look for closest approaches in each run: those that iterate stages."""


def system(particles: int = 3) -> orbits.System:
    """A star with two planets, and particles, of which the first crosses the orbit of the inner planet."""
    made = orbits.System.from_elements(
        {"star": {"gm": 1.0}, "b": {"gm": 1e-3, "a": 1.0, "e": 0.1}, "c": {"gm": 3e-4, "a": 2.5, "M": 1.0}},
        units=orbits.DIMENSIONLESS,
    )
    for k in range(particles):
        made = made.add(f"p{k}", primary="star", a=1.05 + 0.3 * k, e=0.2, M=0.3 + k)
    return made


def looks(run: orbits.Trajectory) -> bool:
    """Return whether a run has closest approaches."""
    with suppress(InputError):
        return len(run.closest_approaches().names) > 0
    return False


@pytest.mark.parametrize("method", only(STANDARD, METHODS), ids=lambda method: method.label)
def test_a_run_looks_for_them_if_its_method_declares_so_or_as_it_is_told(method: Integrator) -> None:
    expected = method.name in LOOKING or (method.name == "composition" and method.base.name == "gauss")
    assert method.looks_for_approaches is expected
    found = [looks(orbits.propagate(system(0), method, approaches=x, **SHORT)) for x in (None, True, False)]
    assert found == [expected, True, False]


@pytest.mark.parametrize("archived", [False, True], ids=["in memory", "from an archive"])
def test_a_run_without_them_says_so_and_how_to_have_them(archived: bool, tmp_path: Path) -> None:
    run = orbits.propagate(system(), VERLET, archive=tmp_path / "run.h5" if archived else None, **SHORT)
    if archived:
        run.close()
        run = orbits.Trajectory.open(tmp_path / "run.h5")
    with pytest.raises(InputError) as caught:
        run.closest_approaches()
    assert str(caught.value) == (
        "this run of StormerVerlet() did not look for closest approaches; expected one made with "
        "orbits.propagate(..., approaches=True). Passages that its step did not resolve are in run.unresolved()."
    )
    with pytest.raises(InputError, match="approaches=True"):
        run.plot("elements", approaches=True)
    if not archived:
        run.plot("elements")
    assert "approaches=True" in ViewData(run).approaches(run)["why"]
    run.close()


@pytest.mark.parametrize(
    ("method", "dt"),
    [
        (VERLET, 1 / 32),
        (MAP, 1 / 16),
        (orbits.WisdomHolman(encounters="retire"), 1 / 16),
        (orbits.WisdomHolman(encounters="follow"), 1 / 16),
        (orbits.Gauss(stages=8), 1 / 4),
        (orbits.Gauss(stages=8), None),
    ],
    ids=["kicks and drifts", "map", "map that retires", "map that follows", "Gauss", "Gauss without dt"],
)
def test_nothing_else_of_a_run_depends_on_them(method: Integrator, dt: float | None) -> None:
    found = []
    event = orbits.events.CloseApproach("p0", "b")
    for approaches in (True, False):
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            run = orbits.propagate(
                system(), method, dt=dt, duration=40.0, samples=7, approaches=approaches, events=event, progress=False
            )
        unresolved = [str(one) for one in run.unresolved()]
        bits = run.q.value.tobytes(), run.v.value.tobytes()
        happened = run.events.to_records(), run.retired.to_records(), run.excursions.to_records()
        found.append((bits, str(happened), unresolved, [str(one.message) for one in said]))
    assert found[0] == found[1]


def test_a_list_of_systems_and_each_alone_are_told_alike() -> None:
    for approaches, expected in ((None, False), (True, True), (False, False)):
        runs = orbits.propagate([system(0), system(0)], MAP, approaches=approaches, **SHORT)
        assert [looks(run) for run in runs] == [expected] * 2


@pytest.mark.parametrize("approaches", [True, False])
def test_a_run_that_is_resumed_or_extended_keeps_what_it_was_told(approaches: bool, tmp_path: Path) -> None:
    method = VERLET if approaches else orbits.Gauss(stages=4)  # each is told what it does not do by itself
    path = tmp_path / "run.h5"
    ended = {"callback": lambda t, now: True, "archive": path, "approaches": approaches}
    orbits.propagate(system(), method, **SHORT, **ended).close()
    for until in (None, 2.0):
        run = orbits.resume(path, until=until, progress=False)
        assert looks(run) is approaches
        run.close()
    run = orbits.Trajectory.open(path)
    assert looks(run) is approaches
    if approaches:
        whole = orbits.propagate(system(), method, approaches=True, **{**SHORT, "duration": 2.0, "samples": 5})
        assert np.array_equal(run.closest_approaches().distance, whole.closest_approaches().distance)
    run.close()


def test_an_archive_that_does_not_say_so_has_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As those of the versions that always looked for them."""
    to_items = header.to_items
    with monkeypatch.context() as patch:
        patch.setattr(header, "to_items", lambda x: {k: v for k, v in to_items(x).items() if k != "@approaches"})
        orbits.propagate(system(), VERLET, archive=tmp_path / "old.h5", approaches=True, **SHORT).close()
    run = orbits.resume(tmp_path / "old.h5", until=2.0, progress=False)
    assert run.archive is not None
    assert run.archive.approaches
    assert looks(run)
    run.close()


def test_a_header_with_another_value_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    to_items = header.to_items
    monkeypatch.setattr(header, "to_items", lambda x: {**to_items(x), "@approaches": 0.5})
    with pytest.raises(ArchiveError, match=r"@approaches is 0\.5; expected 1"):
        orbits.propagate(system(), VERLET, archive=tmp_path / "run.h5", **SHORT)


def test_runs_whose_bodies_may_collide_are_told_too() -> None:
    events = orbits.events.Collision("b", "c", then=orbits.events.Merge())
    for approaches in (None, True, False):
        bodies = system(0).replaced(radii=[1e-3, 1e-4, 1e-4])
        run = orbits.propagate(bodies, VERLET, events=events, approaches=approaches, **SHORT)
        assert looks(run) is bool(approaches)


@pytest.mark.parametrize("answer", [1, "yes", [True]])
def test_what_is_neither_yes_nor_no_is_refused(answer: Any) -> None:
    with pytest.raises(InputError, match="approaches"):
        orbits.propagate(system(), VERLET, approaches=answer, **SHORT)


@pytest.mark.filterwarnings("ignore::orbits.errors.StepWarning")
def test_a_campaign_looks_for_them_unless_it_is_told_not_to(tmp_path: Path) -> None:
    members = ensemble.particles(system(0), system(20))
    options = {"dt": 1 / 16, "duration": 10.0, "integrator": MAP}
    given = ensemble.run(members, tmp_path / "given", **options)
    assert np.isfinite(given.summary["closest"]).any()
    assert looks(given.run(0))
    without = ensemble.run(members, tmp_path / "without", approaches=False, **options)
    assert not {"closest", "closest_to", "closest_at"} & {*without.summary.colnames}
    assert np.array_equal(without["p3"].q, given["p3"].q)
    with pytest.raises(InputError, match="approaches"):
        ensemble.run(members, tmp_path / "given", approaches=False, **options)
    assert "approaches" not in ensemble.Plan(members, **options).identity()  # as before there was a choice


def test_a_campaign_of_systems_can_do_without(tmp_path: Path) -> None:
    members = ensemble.systems([system(0), system(0)], names=["one", "two"])
    options = {"dt": 1 / 16, "duration": 10.0, "integrator": MAP}
    assert "closest" in ensemble.run(members, tmp_path / "given", **options).summary.colnames
    without = ensemble.run(members, tmp_path / "without", approaches=False, **options)
    assert "closest" not in without.summary.colnames


def test_the_header_holds_what_was_done_not_what_was_asked(tmp_path: Path) -> None:
    for method, expected in ((VERLET, False), (orbits.Gauss(stages=4), True)):
        path = tmp_path / f"{method.name}.h5"
        orbits.propagate(system(), method, archive=path, **SHORT).close()
        with Archive.open(path) as archive:
            assert archive.approaches is expected
