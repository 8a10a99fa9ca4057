"""Curves between samples are those of two-body motion, and are left out where motion is not of two bodies."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

import orbits
from orbits.elements.kepler_flow import kepler_flow
from orbits.plotting import arcs, between_samples, osculating_ellipse, pictures
from tests.plotting.runs import about_a_star

from ..coverings import cover

PERIOD = 2 * np.pi


def turns(curve):
    """Return the angles by which a curve turns from piece to piece, radians."""
    steps = np.diff(curve[np.isfinite(curve[:, 0])], axis=0)
    steps = steps[np.linalg.norm(steps, axis=1) > 1e-12]  # where two arcs meet, a point is there twice
    return np.arctan2(np.linalg.norm(np.cross(steps[:-1], steps[1:]), axis=1), (steps[:-1] * steps[1:]).sum(axis=1))


def off_the_orbit(system, i, curve):
    """Return how far points are from the conic r = p / (1 + e cos f) of body i about body 0, over r."""
    _, q, v, _ = system.values
    q, v, gm = q[i] - q[0], v[i] - v[0], system.values.gm[0]
    h = np.cross(q, v)
    eccentricity = np.cross(v, h) / gm - q / np.linalg.norm(q)
    points = curve[np.isfinite(curve[:, 0])] - system.values.q[0]
    r = np.linalg.norm(points, axis=1)
    in_plane = np.abs(points @ h) / np.linalg.norm(h) / r
    return np.maximum(in_plane, np.abs((r + points @ eccentricity) / (h @ h / gm) - 1.0))


CONICS = {
    "circle": {"a": 1.0, "e": 0.0, "inc": 0.3},
    "ellipse": {"a": 1.0, "e": 0.6, "inc": 0.5, "Omega": 1.0, "omega": 2.0, "M": 1.0},
    "comet": {"a": 2.0, "e": 0.97, "inc": 2.5, "M": 3.0},
    "hyperbola": {"q": 0.5, "e": 1.5, "f": -1.5, "inc": 1.0},
}


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("name", CONICS)
def test_the_curve_between_coarse_samples_is_the_two_body_orbit_and_no_polygon(name, direction):
    times = direction * np.linspace(0.0, 4.5, 4)
    run = about_a_star({name: CONICS[name]}, times)
    path = arcs.joined(run, 1)
    assert not path.loose.any()
    assert len(path.curve) >= 64
    # 2e-14 at most is reached; a chord between two samples of the circle is off by 0.3.
    assert off_the_orbit(run.system, 1, path.curve).max() < 1e-12
    # Straight lines turn by a radian and more between these samples.
    assert turns(path.curve).max() < 0.06


def test_the_curve_passes_through_every_sample_at_its_time():
    run = about_a_star({"planet": CONICS["ellipse"]}, np.linspace(0.0, 4.5, 4))
    curve = arcs.joined(run, 1).curve
    for sample in run.q[:, 1].value:
        assert np.linalg.norm(curve - sample, axis=1).min() < 1e-14


def test_the_arc_is_where_the_body_is_at_each_of_its_times():
    run = about_a_star({"planet": CONICS["comet"]}, np.linspace(0.0, 6.0, 4))
    samples = arcs.Samples(run)
    orbit, k = samples.orbit((1,), (0,)), np.arange(3)
    times = between_samples.nodes(orbit, run.times, k)
    points, good = samples.arcs((1,), orbit, k)
    true, _ = kepler_flow(run.q[0, 1].value, run.v[0, 1].value, 1.0, (run.times[k][:, None] + times).ravel())
    assert good.all()
    # At the pericentre, r = 0.06, the states of the samples carry roundings of 1e-16 enlarged by the passage.
    assert np.abs(points.reshape(-1, 3) - true).max() < 1e-12


def test_samples_more_than_a_period_apart_stay_dots_and_the_ellipse_stands_for_the_path():
    run = about_a_star({"planet": CONICS["ellipse"]}, np.linspace(0.0, 100.0, 12))
    path = arcs.joined(run, 1)
    assert path.wound
    assert path.loose.all()
    drawn = osculating_ellipse(run[-1], "planet")
    assert len(drawn) >= 360
    assert off_the_orbit(run.system, 1, drawn).max() < 1e-12  # 3e-15 is reached


# Samples every 2.5 revolutions, and every 500.
@cover(("count", "direction"), [401, 3], [1, -1], strength=1)
def test_the_end_of_a_long_run_is_drawn_through_the_steps_and_samples_before_are_dots(count, direction):
    times = direction * np.linspace(0.0, 1000.3 * PERIOD, count)
    bodies = {"star": {"gm": 1.0}, "planet": CONICS["ellipse"]}
    system = orbits.System.from_elements(bodies, units=orbits.DIMENSIONLESS)
    run = orbits.propagate(system, duration=times[-1], samples=times)
    samples, paths = arcs.followed(run, [1])
    loose = samples.run.times[paths[1].loose]
    drawn = np.abs(samples.run.times[~paths[1].loose])
    assert abs(loose[0]) == 0.0
    assert np.isin(loose, run.times).all()
    assert drawn.max() == abs(times[-1])
    # A thousand states, each a quarter of the dynamical time at the pericentre from the next.
    assert 9.0 * PERIOD < np.ptp(drawn) < 41.0 * PERIOD
    assert off_the_orbit(system, 1, paths[1].curve).max() < arcs.AGREEMENT
    assert turns(paths[1].curve).max() < 0.4


def test_slow_strobing_is_not_taken_for_a_slow_path():
    # A sample every 1.001 periods moves by a thousandth of the orbit: a line through them would be a false path.
    run = about_a_star({"planet": CONICS["circle"]}, 1.001 * PERIOD * np.arange(20))
    assert arcs.joined(run, 1).loose.all()


def test_motion_that_no_two_body_orbit_describes_is_not_drawn_as_one():
    run = about_a_star({"planet": CONICS["circle"]}, np.linspace(0.0, 4.0, 4))
    q, v = run.q.value.copy(), run.v.value.copy()
    q[2, 1] *= 1.2  # kicked on the way, by what no sample tells
    kicked = orbits.Trajectory(run.system, run.times, q, v, step=1.0, integrator=run.integrator)
    path = arcs.joined(kicked, 1)
    assert path.loose.tolist() == [False, False, True, True]
    assert np.isfinite(path.curve[:-1]).all()


def test_a_moon_goes_round_its_planet_and_not_the_sun():
    system = orbits.System.solar_system(epoch="2024-01-01", bodies=["Sun", "Earth", "Moon"])
    sun, earth, moon = range(3)
    assert arcs.centre_of(system, (moon,)) == (earth,)
    assert arcs.centre_of(system, (earth,)) == (sun,)
    about = osculating_ellipse(system, "Moon") - osculating_ellipse(system, "Moon").mean(axis=0)
    # 0.0027 au from the Earth, not 1 au from the Sun.
    assert np.linalg.norm(about, axis=1).max() < 0.003


def test_a_planet_of_two_stars_goes_round_both_and_the_stars_round_each_other():
    bodies = {
        "A": {"gm": 1.0},
        "B": {"gm": 0.8, "a": 1.0, "e": 0.3},
        "planet": {"gm": 1e-4, "a": 8.0, "e": 0.1, "primary": "barycentre"},
    }
    system = orbits.System.from_elements(bodies, units=orbits.DIMENSIONLESS)
    assert arcs.centre_of(system, (2,)) == (0, 1)
    assert arcs.centre_of(system, (0,)) == (1,)
    assert arcs.centre_of(system, (1,)) == (0,)
    both = osculating_ellipse(system, "A"), osculating_ellipse(system, "B")
    # Opposite in place, and as 0.8 to 1 in size.
    assert np.allclose(np.ptp(both[0], axis=0) / np.ptp(both[1], axis=0).clip(1e-300), [0.8, 0.8, 0.0], atol=1e-3)


def test_three_equal_masses_osculate_no_ellipse():
    q = [[1.0, 0.0, 0.0], [-0.5, 0.866, 0.0], [-0.5, -0.866, 0.0]]
    v = [[0.0, 0.5, 0.0], [-0.433, -0.25, 0.0], [0.433, -0.25, 0.0]]
    system = orbits.System(["a", "b", "c"], [1.0] * 3, q, v, units=orbits.DIMENSIONLESS)
    assert [osculating_ellipse(system, name) for name in "abc"] == [None] * 3


def test_a_disc_of_massive_bodies_has_lines_of_the_heaviest_and_says_that_the_others_are_points(monkeypatch):
    """The centres of the bodies that are drawn are looked for, each in one pass over all bodies."""
    monkeypatch.setattr(pictures, "MOST_LINES", 40)
    count, random = 200, np.random.default_rng(0)
    a, turned = random.uniform(0.8, 1.5, count), random.uniform(0.0, 2.0 * np.pi, count)
    bodies = {f"b{k}": {"a": a[k], "l": turned[k]} for k in range(count)}
    still = about_a_star(bodies, [0.0, 0.1])
    gm = np.append(1.0, np.linspace(1e-9, 2e-9, count))
    run = orbits.Trajectory(
        still.system.replaced(gm=gm), still.times, still.q.value, still.v.value, step=0.1, integrator=still.integrator
    )
    calls = []
    centre_of = arcs.centre_of
    monkeypatch.setattr(arcs, "centre_of", lambda *given: calls.append(given) or centre_of(*given))
    figure = Figure()
    axes = figure.subplots()
    told = pictures.paths(axes, run)
    assert len(calls) <= 4 * pictures.MOST_LINES
    assert f"grey points: {count + 1 - pictures.MOST_LINES:,} lighter bodies, without a line" in told
    (cloud,) = (line for line in axes.lines if len(line.get_xdata()) == count + 1 - pictures.MOST_LINES)
    assert cloud.get_linestyle() == "None"


def test_a_cluster_of_like_masses_is_no_centre_of_two_body_motion():
    random = np.random.default_rng(0)
    cluster = orbits.System(
        [f"b{k}" for k in range(40)], gm=np.full(40, 1 / 40), q=random.standard_normal((40, 3)),
        v=random.standard_normal((40, 3)), units=orbits.DIMENSIONLESS,
    )  # fmt: skip
    centres = [arcs.centre_of(cluster, (k,)) for k in range(40)]
    assert max(map(len, centres)) <= arcs.MOST_CENTRAL
