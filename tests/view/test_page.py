"""The page of a view: complete in itself, with texts as texts, thinned by a rule, refused where it would mislead."""

from __future__ import annotations

import base64
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from astropy import units as u
from typer.testing import CliRunner

import orbits
from orbits.cli import app
from orbits.elements import to_frame
from orbits.plotting.arcs import last_state
from orbits.plotting.histories import histories
from orbits.viewing import page as pages
from orbits.viewing.data import Thinning, ViewData
from orbits.viewing.layout import Layout
from tests.view import runs

ROOT = Path(__file__).resolve().parents[2]
STATIC = ROOT / "orbits" / "viewing" / "static"


@pytest.fixture(scope="module")
def run() -> orbits.Trajectory:
    return runs.planets()


def array(packed: dict[str, Any]) -> np.ndarray:
    raw = base64.b64decode(packed["data"])
    return np.frombuffer(raw, dtype=f"<{packed['type']}").reshape(packed["shape"])


def data_of(html: str) -> Any:
    (text,) = re.findall(r'<script type="application/json" id="orbits-data">(.*?)</script>', html, re.DOTALL)
    return json.loads(text)


def test_a_page_loads_nothing_and_may_load_nothing(run: orbits.Trajectory) -> None:
    html = orbits.view(run, show=False).html()
    own = html.replace(pages.asset("three.min.js"), "")
    assert re.findall(r"""(?:src|href)\s*=\s*["'](?!data:)""", own) == []
    assert "@import" not in own
    assert "default-src 'none'" in html
    assert "Copyright" in html  # three.js asks that its licence goes with it
    assert pages.asset("three.LICENSE") in html


def test_no_name_or_title_can_end_the_script_that_it_stands_in() -> None:
    name = "</script><script>alert(1)</script>"
    system = orbits.System.from_elements(
        {"<!--": {"gm": 1.0}, name: {"a": 1.0, "gm": 1e-3}}, units=orbits.DIMENSIONLESS
    )
    run = orbits.propagate(system, dt=0.1, duration=1.0, samples=3, progress=False)
    html = orbits.view(run, title=name, show=False).html()
    assert html.count("</script>") == 3  # the data, three.js, the view
    assert data_of(html)["header"]["title"] == name


def test_the_page_has_the_samples_of_the_run_bit_for_bit(run: orbits.Trajectory) -> None:
    found = data_of(orbits.view(run, show=False).html())
    bodies = array(found["chunk"]["bodies"])
    q = to_frame(run.q.value, "ecliptic")
    assert (bodies[:, 0, 0] == q[:, 0]).all()  # the Sun, from the origin
    assert (bodies[:, 0, 1] == q[:, 1] - q[:, 0]).all()  # Jupiter, from the Sun
    assert (array(found["chunk"]["times"]) == run.times).all()


def test_two_stars_and_a_planet_about_both_move_about_their_centre_of_mass() -> None:
    bodies = {"A": {"gm": 1.0}, "B": {"gm": 0.7, "a": 1.0}, "p": {"a": 9.0, "primary": "barycentre"}}
    system = orbits.System.from_elements(bodies, units=orbits.DIMENSIONLESS)
    layout = Layout.of(system)
    assert not layout.dominated
    assert layout.centres == (-1, -1, -1)
    # |q|^3 n^2 of each on its circle, n^2 = 1.7 and 1.7/9^3
    assert layout.gm == pytest.approx(((0.7 / 1.7) ** 3 * 1.7, (1.0 / 1.7) ** 3 * 1.7, 1.7), rel=1e-12)


def test_a_moon_moves_about_its_planet() -> None:
    system = orbits.System.solar_system("2022-08-09", bodies=["Sun", "Earth", "Moon", "Jupiter"])
    layout = Layout.of(system)
    names = [system.names[i] for i in layout.bodies]
    centres = {name: None if c < 0 else names[c] for name, c in zip(names, layout.centres, strict=True)}
    assert centres == {"Sun": None, "Earth": "Sun", "Jupiter": "Sun", "Moon": "Earth"}
    gm = dict(zip(system.names, system.values.gm, strict=True))
    assert dict(zip(names, layout.gm, strict=True))["Moon"] == gm["Moon"] + gm["Earth"]


def test_a_run_of_three_equal_masses_is_joined_by_cubics() -> None:
    q, v = np.array([[1.0, 0, 0], [-1.0, 0.1, 0], [0.2, 1.0, 0]]), np.zeros((3, 3))
    system = orbits.System(["A", "B", "C"], gm=[1.0] * 3, q=q, v=v, units=orbits.DIMENSIONLESS)
    layout = Layout.of(system)
    assert layout.gm == (0.0, 0.0, 0.0)
    assert layout.centres == (-1, -1, -1)  # their trails are in the axes of the system


def test_bodies_that_merge_are_no_centres_and_elements_have_the_masses_after_it() -> None:
    q = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [10.2, 0.0, 0.0], [0.0, 30.0, 0.0]])
    v = np.array([[0.0, 0.0, 0.0], [0.0, 0.3, 0.0], [-0.02, 0.3, 0.0], [-0.18, 0.0, 0.0]])
    gm, radii = [1.0, 1e-5, 5e-6, 1e-6], [0.01, 0.1, 0.05, 0.01]
    system = orbits.System(["S", "A", "B", "C"], gm=gm, q=q, v=v, radii=radii, units=orbits.DIMENSIONLESS)
    run = orbits.propagate(
        system, duration=40.0, samples=41, events=orbits.events.Collision(then=orbits.events.Merge()), progress=False
    )
    assert len(run.legs) == 2
    found = data_of(orbits.view(run, show=False).html())
    names, centre = found["header"]["bodies"]["names"], found["header"]["bodies"]["centre"]
    gone = next(name for name in names if name not in run.legs[-1].names)
    assert all(centre[k] != names.index(gone) for k in range(len(names)))
    (start, before), (later, after) = found["chunk"]["masses"]
    assert start < later
    assert sum(after) == pytest.approx(sum(before), rel=1e-15)
    assert after[names.index(gone)] == 0.0
    assert any(event["kind"] == "collision" for event in found["chunk"]["events"]["list"])
    with pytest.raises(orbits.errors.InputError, match="not in the order of the run"):
        orbits.view(run[::-1], show=False)  # masses at its times would be those of others


@pytest.fixture(scope="module")
def losing() -> orbits.System:
    """A planet about a star that loses a hundredth of its mass a year."""
    system = orbits.System.from_elements({"S": {"mass": 1 * u.M_sun}, "p": {"a": 1 * u.au, "e": 0.1}})
    return system.with_forces(orbits.terms.MassLoss(fraction=-1e-2 / u.yr))


LEFT = np.array([1.0, 0.95, 0.9, 0.85, 0.8])
"""The share of its mass that the star has after 0, 5 ... 20 years."""


def test_orbits_about_a_star_that_loses_mass_are_of_the_mass_of_their_time_in_pictures(losing: orbits.System) -> None:
    """As `run.elements()`: with the mass of the start, e = 0.1 rose to 0.24."""
    q, v = (np.repeat(getattr(losing, x).value[None], 5, axis=0) for x in "qv")
    run = orbits.Trajectory(losing, 1826.25 * np.arange(5), q, v, step=1.0, integrator=orbits.Gauss(stages=8))
    known = histories(run, [1], ("a", "e"), primary=0, frame=None, kind="elements")
    for name in ("a", "e"):
        np.testing.assert_array_equal(known[name], getattr(run.elements(), name).value)
    np.testing.assert_allclose(last_state(run).values.gm, 0.8 * losing.gm.value, rtol=1e-15)


@pytest.mark.nightly
def test_orbits_about_a_star_that_loses_mass_are_of_the_mass_of_their_time_on_the_page(losing: orbits.System) -> None:
    run = orbits.propagate(losing, duration=20 * u.yr, samples=5, progress=False)
    times, masses = zip(*data_of(orbits.view(run, show=False).html())["chunk"]["masses"], strict=True)
    np.testing.assert_array_equal(times, run.times)
    np.testing.assert_allclose(masses, np.outer(LEFT, losing.gm.value), rtol=1e-15)


def test_masses_on_the_page_are_those_that_mergers_and_a_loss_have_left() -> None:
    """With the first merger, the loss was left out: the star had 1.14 instead of 0.11 at the end."""
    q, v = [[0.0, 0, 0], [1, 0, 0], [5, 0, 0]], [[0.0, 0, 0], [-0.2, 0, 0], [0, 0.4, 0]]
    system = orbits.System(["S", "p", "x"], [1.0, 0.1, 1e-9], q, v, radii=[0.05, 0.05, 0], units=orbits.DIMENSIONLESS)
    merge = orbits.events.Collision(then=orbits.events.Merge())
    for sign in (1.0, -1.0):
        falling = system.replaced(v=sign * system.v).with_forces(orbits.terms.MassLoss("S", fraction=-0.3 * sign))
        run = orbits.propagate(falling, orbits.Gauss(stages=4), duration=3.0 * sign, samples=7, events=merge)
        times, gm = (np.array(x) for x in zip(*ViewData(run).chunk(run)["masses"], strict=True))
        assert (np.diff(times) * sign > 0.0).all()
        (merged,) = run.events
        after = np.abs(times) >= abs(merged.time.value)
        left = 1.0 - 0.3 * np.abs(times)
        np.testing.assert_allclose(gm[:, 0], np.where(after, run.legs[1].gm.value[0], 1.0) * left, rtol=1e-15)
        np.testing.assert_array_equal(gm[:, 1], np.where(after, 0.0, 0.1))


def test_another_run_under_the_same_name_is_not_mixed_with_the_first(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    runs.planets(path).close()
    first = orbits.Trajectory.open(path)
    known = ViewData(first)
    first.close()
    runs.belt(path, overwrite=True).close()
    other = orbits.Trajectory.open(path)
    with pytest.raises(orbits.errors.ArchiveError, match="has another run by now; reload the page"):
        known.chunk(other, 3)
    other.close()


def test_a_path_is_as_good_as_a_run(tmp_path: Path) -> None:
    runs.planets(tmp_path / "run.h5").close()
    made = orbits.view(tmp_path / "run.h5", tmp_path / "run.html")
    assert len(array(data_of((tmp_path / "run.html").read_text())["chunk"]["times"])) == 26
    assert "26 samples" in repr(made)


@pytest.mark.parametrize(
    ("bodies", "points", "total", "limit", "expected"),
    [
        (4, 0, 1000, 10**6, (1, 1)),
        (4, 0, 100_000, 10**6, (20, 1)),
        (4, 1000, 1000, 10**6 * 10, (3, 1)),
        (4, 10_000, 1000, 10**6 * 10, (10, 3)),
        (4, 10_000, 50, 10**6, (1, 13)),
    ],
)
def test_a_run_that_is_too_large_is_thinned_by_the_rule(
    bodies: int, points: int, total: int, limit: int, expected: tuple[int, int]
) -> None:
    layout = Layout(tuple(range(bodies)), tuple(range(bodies, bodies + points)), (), (), 1.0, True)
    found = Thinning.of(layout, total, limit)
    assert (found.samples, found.points) == expected
    kept = -(-total // found.samples), -(-points // found.points)
    assert kept[0] * (48 * bodies + 24 * kept[1]) <= limit * 1.01  # rounding up of a last particle
    assert bool(found.said(total, points)) == (expected != (1, 1))


def test_thinning_is_said_and_keeps_the_first_and_the_last_sample() -> None:
    run = runs.planets(samples=1001, dt=5)
    with pytest.warns(orbits.errors.OrbitsWarning, match=r"every 5th of 1,001 samples"):
        made = orbits.view(run, show=False, limit=0.03)
    found = data_of(made.html())
    times = array(found["chunk"]["times"])
    assert times[0] == run.times[0]
    assert times[-1] == run.times[-1]
    assert found["header"]["said"] == made.said


def test_energy_and_angular_momentum_are_those_of_the_run(run: orbits.Trajectory) -> None:
    conserved = data_of(orbits.view(run, show=False).html())["chunk"]["conserved"]
    kept = {one["name"]: array(one["change"]) for one in conserved}
    drift = run.drift()
    assert kept["energy"].max() == pytest.approx(drift.energy.max_fraction, rel=1e-12)
    assert kept["angular momentum"].max() == pytest.approx(drift.angular_momentum.max_fraction, rel=1e-12)


def test_error_bars_that_the_run_has_are_in_the_page() -> None:
    run = runs.planets(error_estimate=True)
    found = data_of(orbits.view(run, show=False).html())
    assert found["header"]["has_error"]
    bars = array(found["chunk"]["errors"])
    assert bars[-1, 1] == pytest.approx(run.error_bars.position[-1, 1].value, rel=1e-6)  # float32


def test_a_page_that_another_program_wrote_is_kept(run: orbits.Trajectory, tmp_path: Path) -> None:
    mine = tmp_path / "page.html"
    mine.write_text("<html>precious</html>")
    with pytest.raises(orbits.errors.InputError, match="was not written by orbits"):
        orbits.view(run, mine)
    assert mine.read_text() == "<html>precious</html>"
    ours = tmp_path / "ours.html"
    orbits.view(run, ours)
    orbits.view(run, ours)


@pytest.mark.parametrize(
    ("output", "said"), [("page.png", "does not end in .html"), ("missing/page.html", "does not exist")]
)
def test_paths_where_no_page_can_be_are_refused(run: orbits.Trajectory, tmp_path: Path, output: str, said: str) -> None:
    with pytest.raises(orbits.errors.InputError, match=re.escape(said)):
        orbits.view(run, tmp_path / output)


def test_what_is_no_run_and_a_run_without_samples_are_refused(run: orbits.Trajectory) -> None:
    with pytest.raises(orbits.errors.InputError, match="expected a run"):
        orbits.view(run.system)  # type: ignore[arg-type]
    with pytest.raises(orbits.errors.InputError, match="no samples yet"):
        orbits.view(run[:0], show=False)
    with pytest.raises(orbits.errors.InputError, match="not in the order of the run"):
        orbits.view(run.at(run.t[[3, 1, 2]]), show=False)
    assert orbits.view(run[::-1], show=False).html()
    with pytest.raises(orbits.errors.InputError, match="limit"):
        orbits.view(run, show=False, limit=-1)


def test_a_run_with_too_many_bodies_for_the_limit_is_refused(run: orbits.Trajectory) -> None:
    layout = Layout(tuple(range(200)), tuple(range(200, 1200)), (), (), 1.0, True)
    with pytest.raises(orbits.errors.InputError, match="has no room in 1 MB"):
        Thinning.of(layout, 10_000, 2**20 - 200_000)


def test_a_view_of_some_samples_says_why_it_has_no_approaches_and_still_works(run: orbits.Trajectory) -> None:
    found = data_of(orbits.view(run[5:10], show=False).html())
    assert len(array(found["chunk"]["times"])) == 5


def test_the_scripts_are_joined_each_once_after_what_they_import_and_no_name_twice() -> None:
    script = pages.joined("start.js")
    names = re.findall(r"^// (\w+\.js)$", script, re.MULTILINE)
    assert sorted(names) == sorted({*names})
    assert {path.name for path in STATIC.glob("*.js")} == {*names, "widget.js", "three.min.js"}
    for path in STATIC.glob("*.js"):
        for other in pages.IMPORT.findall(path.read_text(encoding="utf-8")):
            if path.name in names:
                assert names.index(other) < names.index(path.name)
    assert not re.search(r"^(?:import|export) ", script, re.MULTILINE)
    top = re.findall(r"^(?:async )?(?:function|class|const|let) (\w+)", script, re.MULTILINE)
    assert sorted(top) == sorted({*top})


def test_the_vendored_library_is_what_its_script_builds() -> None:
    command = [sys.executable, str(ROOT / "scripts" / "build_three.py"), "verify"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_the_widget_has_the_same_data_and_scripts(run: orbits.Trajectory) -> None:
    pytest.importorskip("anywidget", reason="anywidget comes with the extra 'notebook'")
    made = orbits.view(run, show=False)
    widget = made.widget()
    assert widget.data["header"] == data_of(made.html())["header"]
    assert "export default widget;" in widget._esm
    assert "application/vnd.jupyter.widget-view+json" in str(made._repr_mimebundle_())


def test_without_anywidget_the_widget_says_what_to_install(
    run: orbits.Trajectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "anywidget", None)
    made = orbits.view(run, show=False)
    with pytest.raises(orbits.errors.MissingPackageError, match=r"pip install 'orbits\[notebook\]'"):
        made.widget()
    assert "notebook" in made._repr_mimebundle_()["text/plain"]


def test_the_command_writes_a_page(tmp_path: Path) -> None:
    runs.planets(tmp_path / "run.h5").close()
    out = CliRunner().invoke(app, ["view", str(tmp_path / "run.h5"), "--output", str(tmp_path / "run.html")])
    assert out.exit_code == 0, out.output
    assert f"wrote {tmp_path / 'run.html'}" in out.output
    assert len(array(data_of((tmp_path / "run.html").read_text())["chunk"]["times"])) == 26


def test_a_thinned_run_that_grows_gets_the_samples_that_a_complete_one_has(tmp_path: Path) -> None:
    path = tmp_path / "growing.h5"
    runs.interrupted(path, after=9)
    run = orbits.Trajectory.open(path)
    known = ViewData(run, limit=26 * 3 * 48 // 4)
    assert known.thinning.samples == 4
    first = array(known.chunk(run)["numbers"]).tolist()
    run.close()
    orbits.resume(path, progress=False).close()
    run = orbits.Trajectory.open(path)
    more = array(known.chunk(run, len(first))["numbers"]).tolist()
    assert first + more == [*range(0, 26, 4), 25]
    run.close()


def test_a_run_that_was_stopped_has_its_approaches(tmp_path: Path) -> None:
    path = tmp_path / "stopped.h5"
    stopped = runs.planets(path, stop=orbits.events.FartherThan(5.0, "Jupiter", "Sun"))
    assert not stopped.complete
    stopped.close()
    run = orbits.Trajectory.open(path)
    known = ViewData(run)
    assert known.chunk(run)["ended"].startswith("stopped: ")
    assert known.approaches(run)["why"] == ""
    run.close()


def test_approaches_among_many_massive_bodies_are_as_recorded_and_the_page_says_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """To march all of them again would take as long as the run."""
    monkeypatch.setattr("orbits.viewing.approaches.MOST_MASSIVE", 2)
    q, v = [[0, 0, 0], [1, 0, 0], [1.02, -0.01, -0.05]], [[0, 0, 0], [0, 1, 0], [0, 1.02, 0.1]]
    system = orbits.System(["star", "b", "c"], gm=[1, 1e-6, 1e-6], q=q, v=v, units=orbits.DIMENSIONLESS)
    run = orbits.propagate(system, dt=0.01, duration=12.0, samples=7, progress=False, check_step=False)
    found = data_of(orbits.view(run, show=False).html())["header"]["approaches"]
    assert found["said"] == "of 3 massive bodies: as recorded on the way, to about 1e-3 of the distance"
    assert not run._passages.refined
    exact = [one.distance.value for one in run.closest_approaches()]
    assert exact
    np.testing.assert_allclose([row[3] for row in found["list"]], exact[: len(found["list"])], rtol=1e-3)


def test_a_rigid_body_can_be_looked_at_and_its_rotation_is_in_the_energy() -> None:
    pair = orbits.System(
        ["a", "b"], gm=[1.0, 0.3], q=[[0, 0, 0], [1.2, 0, 0]], v=[[0, 0, 0], [0, 1.0, 0.1]], units=orbits.DIMENSIONLESS
    )
    turning = pair.with_rigid("b", orbits.RigidBody(A=0.010, B=0.013, C=0.016, radius=1.0, spin=(0.3, 0.5, 1.7)))
    run = orbits.propagate(turning, dt=0.01, duration=2.0, samples=11, progress=False)
    seen = data_of(orbits.view(run, show=False).html())["chunk"]["conserved"]
    assert [kept["name"] for kept in seen] == ["energy", "angular momentum"]
    # As run.drift() has it, which is round-off; without the rotation, which the torques change, both would be 1e-4.
    assert array(seen[0]["change"]).max() == pytest.approx(run.drift().energy.max_fraction, rel=1e-6, abs=1e-16)
    expected = run.drift().angular_momentum.max_fraction
    assert array(seen[1]["change"]).max() == pytest.approx(expected, rel=1e-6, abs=1e-16)


def test_of_too_many_events_the_first_of_the_run_are_kept_also_backward_in_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("orbits.viewing.happenings.MOST", 3)
    system = orbits.System.solar_system("2022-08-09", bodies=runs.SUN_AND_TWO)
    events = orbits.events.Pericentre("Jupiter")
    run = orbits.propagate(
        system, dt="20 d", duration="-80 yr", samples=5, events=events, progress=False
    )
    kept = data_of(orbits.view(run, show=False).html())["chunk"]["events"]
    assert kept["count"] == len(run.events) > 3
    assert [event["time"] for event in kept["list"]] == sorted(run.events.time.value, reverse=True)[:3]


def test_a_run_with_mergers_says_in_the_words_of_a_reader_why_it_has_no_approaches() -> None:
    q = [[0, 0, 0], [1, 0, 0], [1.1, 0, 0]]
    system = orbits.System(
        ["star", "b", "c"], gm=[1, 1e-3, 1e-3], q=q, v=[[0, 0, 0], [0, 1, 0], [0, 0.94, 0]],
        radii=[0.01, 0.05, 0.05], units=orbits.DIMENSIONLESS,
    )
    merges = orbits.events.Collision(then=orbits.events.Merge())
    run = orbits.propagate(system, duration=6.0, samples=7, events=merges, progress=False)
    why = data_of(orbits.view(run, show=False).html())["header"]["approaches"]["why"]
    assert "merge" in why
    assert "run." not in why


def test_a_run_whose_particles_are_retired_near_a_planet_can_be_looked_at() -> None:
    rng = np.random.default_rng(1)
    n = 80
    elements = {"a": rng.uniform(3.5, 5.6, n), "e": rng.uniform(0, 0.5, n), "inc": rng.uniform(0, 10, n) * u.deg}
    angle = rng.uniform(0, 360, n) * u.deg
    names = [f"p{k}" for k in range(n)]
    system = orbits.System.solar_system("2022-08-09", bodies=["Sun", "Jupiter"])
    system = system.add(names, primary="Sun", M=angle, **elements)
    method = orbits.WisdomHolman(encounters="retire")
    with pytest.warns(orbits.errors.OrbitsWarning):
        run = orbits.propagate(
            system, method, dt="40 d", duration="60 yr", samples=61, approaches=True, progress=False
        )
    assert len(run.retired) > 20
    passages = list(run.closest_approaches())
    assert passages
    assert all(np.isfinite(one.distance.value) for one in passages)
    data_of(orbits.view(run, show=False).html())  # JSON knows no NaN
