"""The kinds of pictures of a run: what they show is what the samples are, and what they cannot show is said."""

from __future__ import annotations

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.errors import InputError, UnknownNameError
from orbits.plotting import style
from orbits.plotting.histories import pieces
from orbits.plotting.resonances import integers_of, libration, turns_back
from tests.plotting import seen
from tests.plotting.runs import MERGING, about_a_star

from ..coverings import cover, each

PLANETS = {"inner": {"a": 1.0, "e": 0.2, "pomega": 1.0}, "outer": {"a": 5.2, "e": 0.05, "M": 2.0, "inc": 0.3}}
MANY = {f"rock {k}": {"a": 2.0 + 0.003 * k, "e": 0.001 * k, "M": 1.0 * k} for k in range(300)}


@pytest.fixture(scope="module")
def kepler() -> orbits.Trajectory:
    times = np.linspace(0.0, 36525.0, 60)
    return about_a_star(PLANETS, times, units=orbits.SOLAR, epoch="2000-01-01T12:00:00")


@pytest.fixture(scope="module")
def many() -> orbits.Trajectory:
    run = about_a_star(MANY, np.linspace(0.0, 60.0, 50))
    q, v = run.q.value.copy(), run.v.value.copy()
    q[20:, 7] = v[20:, 7] = np.nan  # retired
    return orbits.Trajectory(run.system, run.times, q, v, step=1.0, integrator=run.integrator)


@pytest.fixture(scope="module")
def merged() -> orbits.Trajectory:
    system = orbits.System.from_elements(MERGING, units=orbits.DIMENSIONLESS)
    return orbits.propagate(system, duration=20.0, events=orbits.events.Collision(then=orbits.events.Merge()))


@pytest.fixture(scope="module")
def resonant() -> orbits.Trajectory:
    """A planet, and three bodies on fixed ellipses: in the 2:1 resonance exactly, near it, and a Trojan."""
    a = 2.0 ** (-2.0 / 3.0)
    bodies = {
        "planet": {"a": 1.0},
        "in": {"a": a, "e": 0.2, "pomega": 1.0, "M": 0.3},
        "near": {"a": 1.02 * a, "e": 0.1},
        "trojan": {"a": 1.0, "e": 0.05, "M": np.pi / 3, "pomega": 0.0},
    }
    run = about_a_star(bodies, np.linspace(0.0, 600.0, 900))
    gm = run.system.values.gm.copy()
    gm[1] = 1e-12  # it counts as a planet; the ellipses are those of massless bodies
    system = run.system.replaced(gm=gm)
    return orbits.Trajectory(system, run.times, run.q.value, run.v.value, step=1.0, integrator=run.integrator)


def panel(figure, label):
    return next(axes for axes in figure.axes if label in axes.get_ylabel() + axes.get_xlabel())


def line_of(axes, name):
    return next(line for line in axes.lines if line.get_label().startswith(name))


RUNS = ["merged", "many", "kepler"]
RUNS_OF = {
    **dict.fromkeys(("paths", "elements", "phase"), RUNS),
    "resonance": ["resonant"], "error": ["merged"], "energy": ["merged"],
}  # fmt: skip


@cover(("name", "of"), RUNS_OF, [*RUNS, "resonant"], strength=1, allowed=lambda name, of: of in RUNS_OF[name])
def test_nothing_overlaps_in_a_picture_of_any_kind(name, of, request):
    more = {"resonance": "2:1"} if name == "resonance" else {}
    figure = seen.laid_out(request.getfixturevalue(of).plot(name, **more))
    assert seen.colliding_tick_labels(figure) == []
    assert seen.legends_on_panels(figure) == []
    assert seen.captions_on_legends(figure) == []
    assert seen.outside(figure) == []


def test_lines_of_elements_are_the_elements_of_the_run(kepler):
    figure = kepler.plot("elements", elements=("a", "e", "inc"))
    known = kepler.elements("Sun")
    for label, key, unit in (("axis a", "a", u.au), ("eccentricity", "e", ""), ("inclination", "inc", u.deg)):
        for name in PLANETS:
            t, drawn = line_of(panel(figure, label), name).get_data()
            assert np.allclose(drawn, known[name].__getattribute__(key).to_value(unit), rtol=1e-13, atol=1e-13)
            assert np.allclose(t, kepler.times / 365.25)
    assert panel(figure, "time").get_xlabel() == "time since 2000-01-01 12:00 TDB [yr]"
    assert "ecliptic of J2000" in figure.axes[0].get_title(loc="left")


@pytest.fixture(scope="module")
def two_planets():
    bodies = {"star": {"gm": 1.0}, "b": {"a": 1.0, "e": 0.05, "gm": 1e-4}, "c": {"a": 8.0, "e": 0.1, "gm": 1e-4}}
    system = orbits.System.from_elements(bodies, units=orbits.DIMENSIONLESS)
    return orbits.propagate(system, duration=500.0, samples=201)


@pytest.mark.nightly
def test_each_body_has_a_scale_of_its_own_where_a_common_one_would_flatten_its_changes(two_planets):
    figure = seen.laid_out(two_planets.plot("elements", elements=("a", "e")))
    panels = np.array(figure.axes).reshape(2, 2)
    assert [axes.get_title(loc="left") for axes in panels[0]] == ["semi-major axis a", "eccentricity e"]
    assert [axes.get_xlabel() for axes in panels[1]] == ["time", "time"]
    known = two_planets.elements("star")
    for row, name in zip(panels, "bc", strict=True):
        assert row[0].get_ylabel() == name  # no power and no offset of the axis: these stand at its end
        for axes, key in zip(row, ("a", "e"), strict=True):
            drawn = line_of(axes, name).get_data()[1]
            assert np.allclose(drawn, getattr(known[name], key).value, rtol=1e-13)
            assert np.ptp(axes.get_ylim()) < 1.2 * np.ptp(drawn)  # margins of 5 % on both sides
    assert seen.colliding_tick_labels(figure) == []
    assert seen.outside(figure) == []


def test_bodies_share_a_scale_on_which_their_changes_are_seen_or_are_rounding_alone(two_planets, kepler):
    assert len(two_planets.plot("elements", elements=("l",)).axes) == 1
    assert len(two_planets.plot("elements", elements=("a", "e"), bodies=["b"]).axes) == 2
    assert len(kepler.plot("elements", elements=("a", "e", "inc")).axes) == 3  # two-body motion: constant


def test_the_upper_edge_of_a_time_axis_has_the_years_of_the_calendar(kepler):
    figure = seen.laid_out(kepler.plot("elements"))
    (upper,) = figure.axes[0].child_axes
    assert [label.get_text() for label in upper.get_xticklabels() if label.get_text() in ("2000", "2100")]
    low, high = upper.get_xlim()
    assert low < 2000.0 < 2100.0 < high
    assert upper.get_xlabel() == "year"
    top = max(label.get_window_extent().y1 for label in upper.get_xticklabels() if label.get_text())
    assert upper.xaxis.label.get_window_extent().y0 > top


def test_a_line_is_interrupted_where_its_angle_goes_over_the_edge():
    t, values = pieces(np.arange(5.0), np.array([300.0, 350.0, 20.0, 60.0, 90.0]), 360.0)
    assert np.isnan(values[2])
    assert np.isnan(t[2])
    assert values[[0, 1, 3, 4, 5]].tolist() == [300.0, 350.0, 20.0, 60.0, 90.0]


def test_elements_go_through_mergers_with_the_masses_of_each_moment_and_mark_the_end_of_a_body(merged):
    figure = merged.plot("elements")
    of_a, of_b = (next(axes for axes in figure.axes if axes.get_ylabel() == name) for name in ("a", "b"))
    for k in (0, -1):
        alone = merged[k].elements("star")
        assert line_of(of_b, "b").get_data()[1][k] == pytest.approx(alone["b"].a.value.item(), rel=1e-13)
    drawn = line_of(of_a, "a").get_data()[1]
    assert np.isnan(drawn[-1])
    crosses = [line for line in of_a.lines if line.get_marker() == "x"]
    assert len(crosses) == 1
    last = np.flatnonzero(np.isfinite(drawn))[-1]
    assert crosses[0].get_data()[0] == pytest.approx(merged.times[last])
    triangles = [line for axes in (of_a, of_b) for line in axes.lines if line.get_marker() == "^"]
    assert triangles
    assert triangles[0].get_data()[0] == pytest.approx(merged.events.time.value[0])
    assert any("triangles: merger" in text for text in seen.texts(figure))


def test_hundreds_of_bodies_are_one_collection_of_lines_and_a_retired_one_ends_with_a_cross(many):
    axes = panel(many.plot("elements"), "axis a")
    (lines,) = axes.collections
    assert len(lines.get_segments()) == 300
    (cross,) = [line for line in axes.lines if line.get_marker() == "x"]
    assert cross.get_data()[0] == pytest.approx(many.times[19])
    assert axes.get_legend() is None


def test_phase_planes_have_equal_scales_about_the_origin_and_both_ends(kepler):
    figure = kepler.plot("phase")
    plane = panel(figure, "cos")
    assert plane.get_xlim() == plane.get_ylim()
    assert plane.get_xlim()[0] == -plane.get_xlim()[1]
    dots = next(line for line in plane.lines if len(line.get_data()[0]) == len(kepler))
    known = kepler.elements("Sun")["inner"]
    assert np.allclose(dots.get_data(), [known.k.value, known.h.value], atol=1e-13)


def test_a_resonant_angle_of_exact_resonance_stands_still_and_others_circulate(resonant):
    figure = resonant.plot("resonance", resonance="2:1", bodies=["in", "near"])
    over = panel(figure, "time")
    # phi = 2 L - l - pomega = -M(0) - 2 pomega at the start, with L = 0: -0.3 - 2 rad.
    assert np.allclose(np.degrees(-2.3) + 360.0, line_of(over, "in").get_data()[1], atol=1e-6)
    assert line_of(over, "in").get_label() == "in: within 228° ± 0°, too short to tell"  # it has not turned back
    assert line_of(over, "near").get_label() == "near: circulates"
    assert "φ = 2λ′ − λ − ϖ" in over.get_ylabel()
    trojan = resonant.plot("resonance", resonance=(1, 1), bodies=["trojan"])
    assert line_of(panel(trojan, "time"), "trojan").get_label().startswith("trojan: within 60° ± 0°")


def test_bodies_far_from_a_resonance_are_not_said_to_librate(resonant):
    figure = resonant.plot("resonance", resonance="2:1")
    assert any("1 body far" in text for text in seen.texts(figure))
    assert not any("trojan" in text for text in seen.texts(figure))
    named = resonant.plot("resonance", resonance="2:1", bodies=["in", "trojan"])
    assert line_of(panel(named, "time"), "trojan").get_label() == "trojan: far from the resonance"


def test_libration_is_the_arc_in_which_an_angle_stays():
    angle = np.radians(350.0 + 30.0 * np.sin(np.linspace(0.0, 50.0, 1001)))
    centre, reach = libration(angle)
    assert centre == pytest.approx(350.0, abs=0.1)
    assert reach == pytest.approx(30.0, abs=0.1)
    assert libration(np.linspace(0.0, 40.0, 1001))[0] is None
    assert libration(np.radians(25.0) * np.arange(200))[0] is None  # the gaps of samples that are far apart
    assert libration(angle[:10])[0] is None
    assert turns_back(angle)
    # An angle that drifts by a degree stays in an arc, too, but does not librate.
    drifting = np.radians(294.0 + np.linspace(0.0, 1.0, 200) + 0.2 * np.sin(np.arange(200)))
    assert libration(drifting)[0] is not None
    assert not turns_back(drifting)


def test_errors_are_drawn_from_a_reference_and_along_brouwers_slope(merged):
    system = orbits.System.from_elements(
        {"star": {"gm": 1.0}, "planet": {"a": 1.0, "e": 0.2, "gm": 1e-3}}, units=orbits.DIMENSIONLESS
    )
    given = {"duration": 100.0, "samples": 51, "check_step": False}
    run = orbits.propagate(system, "stormer-verlet", dt=0.02, **given)
    exact = orbits.propagate(system, **given)
    figure = run.plot("error", reference=exact)
    energy, positions = figure.axes
    assert (energy.get_xscale(), energy.get_yscale(), positions.get_yscale()) == ("log", "symlog", "log")
    drawn = line_of(positions, "planet").get_data()[1]
    assert np.allclose(drawn, np.linalg.norm((run["planet"].q - exact["planet"].q).value, axis=1)[1:])
    largest = line_of(energy, "energy").get_data()[1]
    assert largest[-1] == pytest.approx(run.drift().energy.max_fraction)
    assert line_of(energy, "energy").get_label() == "energy, |ΔE/E|"  # without its sign
    dotted = [line for line in energy.lines if line.get_linestyle() == ":"]
    slopes = [np.polyfit(*np.log(line.get_data()), 1)[0] for line in dotted]
    assert slopes == pytest.approx([0.5, 1.0])
    assert len(merged.plot("error").axes) == 1
    days = orbits.System(system.names, *system.values[:3])  # the same numbers, but days and years of our own
    with pytest.raises(InputError, match="the reference differs from this run in unit of time; expected the same"):
        run.plot("error", reference=orbits.propagate(days, **given))
    again = run[::-1].plot("error").axes[0]  # the largest so far, from the start of the run
    assert np.array_equal(line_of(again, "energy").get_data()[1], largest)
    back = orbits.propagate(system, "stormer-verlet", dt=0.02, duration=-10.0, check_step=False)
    assert [x.plot("error").axes[0].get_xlabel() for x in (run, back)] == ["time", "time before the start"]


@each(
    ("kind", "options", "error", "message"),
    [
        ("element", {}, UnknownNameError, "expected one of 'paths', 'elements', 'phase', .* Did you mean 'elements'"),
        (3, {}, UnknownNameError, "kind is 3"),
        ("elements", {"resonance": "3:1"}, InputError, "takes no resonance; it takes elements, primary"),
        ("elements", {"elements": ("a", "Z")}, UnknownNameError, "there is no element 'Z' to draw"),
        ("elements", {"elements": ()}, InputError, "elements is empty"),
        ("elements", {"primary": "inner"}, InputError, "inner has no mass"),
        ("elements", {"bodies": ["Sun"]}, InputError, "no other body is asked for"),
        ("phase", {"bodies": ["Vulcan"]}, UnknownNameError, "Vulcan"),
        ("resonance", {}, InputError, "give resonance='3:1'"),
        ("resonance", {"resonance": "3:1"}, InputError, "there is none; give planet="),
        ("resonance", {"resonance": "three"}, InputError, "two whole numbers"),
        ("error", {"reference": 3}, InputError, "expected a Trajectory"),
        ("error", {}, InputError, r"of Sun alone, which nothing perturbs; .*, and no errors of positions are known"),
        ("energy", {}, InputError, "nothing to draw: energy and angular momentum are those of Sun alone"),
    ],
)
def test_what_a_picture_cannot_show_is_said(kepler, kind, options, error, message):
    with pytest.raises(error, match=message):
        kepler.plot(kind, **options)


def test_a_resonance_that_no_body_is_near_and_samples_too_far_apart_are_refused(resonant):
    with pytest.raises(InputError, match=r"is near the 3:1 resonance with planet: the nearest, in, goes round 2"):
        resonant.plot("resonance", resonance="3:1", bodies=["in", "near"])
    with pytest.raises(InputError, match="turns of the angle apart, so that it cannot be followed"):
        resonant[::300].plot("resonance", resonance="2:1", bodies=["near"])
    assert [integers_of(x) for x in ("3:1", "2/3", (7, 4))] == [(3, 1), (2, 3), (7, 4)]


def test_colours_of_lines_are_safe_for_the_colour_blind(kepler):
    figure = kepler.plot("elements")
    assert {line.get_color() for line in figure.axes[0].lines} <= {*style.PALETTE, *style.BODY_COLOURS.values()}


def test_a_body_that_moves_straight_towards_the_primary_at_a_sample_has_no_elements_there_and_is_drawn_elsewhere() -> (
    None
):
    q = [[0.97000436, -0.24308753, 0], [-0.97000436, 0.24308753, 0], [0, 0, 0]]
    half = [0.466203685, 0.43236573, 0]
    system = orbits.System(
        ["A", "B", "C"], gm=[1, 1, 1], q=q, v=[half, half, [-0.93240737, -0.86473146, 0]], units=orbits.DIMENSIONLESS
    )
    run = orbits.propagate(system, dt=0.01, duration=2.0, samples=21, progress=False)
    lines = panel(run.plot("elements"), "eccentricity").lines
    values = next(line for line in lines if len(line.get_ydata()) == 21).get_ydata()
    assert np.isnan(values[0])  # B starts with the velocity of A
    assert np.isfinite(values[1:]).all()


def test_the_infinite_axis_of_a_parabola_is_left_out_of_its_panel() -> None:
    """At the start; rounding leaves ellipses and hyperbolas of any size after that."""
    system = orbits.System.from_elements({"star": {"mass": 1.0}, "planet": {"a": 5.0, "e": 0.05, "mass": 1e-3}})
    run = orbits.propagate(
        system.add("comet", primary="star", q=1.0, e=1.0, T=-1.0), orbits.Gauss(4), dt=0.1, duration=20.0, samples=20
    )
    assert run.elements(primary="star")["comet"].a[0].value == np.inf
    figure = run.plot("elements")
    assert [len(axes.lines) > 0 for axes in figure.axes] == [True] * len(figure.axes)
    alone = run.plot("elements", bodies=["comet"], elements="a")
    assert np.all(np.isfinite(alone.axes[0].get_ylim()))


def test_angles_that_go_round_are_within_the_panel_and_events_are_marked_on_them() -> None:
    """M and f from -180 to 0 were below it. At a pericentre M is 0, between samples at 357 and 1 degrees."""
    bodies = {"s": {"gm": 1.0}, "p": {"a": 1.0, "e": 0.3, "M": 1.0}}
    system = orbits.System.from_elements(bodies, units=orbits.DIMENSIONLESS)
    run = orbits.propagate(system, duration=20.0, samples=401, events=orbits.events.Pericentre("p"))
    (axes,) = run.plot("elements", elements=["M"]).axes
    drawn = axes.lines[0].get_ydata()
    assert (np.nanmin(drawn) > 0.0, np.nanmax(drawn) < 360.0, axes.get_ylim()) == (True, True, (-10.0, 370.0))
    marked = np.array([line.get_ydata()[0] for line in axes.lines if line.get_marker() == "^"])
    assert len(marked) == len(run.events) == 3
    # Of Kepler's motion, M is linear in time: to rounding of the elements.
    np.testing.assert_allclose((marked + 180.0) % 360.0, 180.0, atol=1e-9)


def test_events_have_the_time_of_the_samples_in_a_picture_of_energy_also_from_the_end_on() -> None:
    """In days on an axis of years, as the last of the samples was at 0."""
    system = orbits.System.solar_system("2022-08-09", bodies=["Sun", "Mars", "Jupiter"])
    run = orbits.propagate(system, dt="5 d", duration="9 yr", samples=9, events=orbits.events.Pericentre("Mars"))
    axes = run[::-1].plot("energy").axes[0]
    lines = {line.get_xdata()[0] for line in axes.lines if len(line.get_xdata()) == 2}
    assert sorted(lines) == pytest.approx(run.events.time.to_value(u.yr))


@pytest.mark.nightly
def test_a_picture_of_energy_says_how_many_events_it_has_no_lines_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("orbits.plotting.errors_over_time.MOST_EVENTS", 2)
    system = orbits.System.solar_system("2022-08-09", bodies=["Sun", "Mars", "Jupiter"])
    run = orbits.propagate(system, dt="5 d", duration="9 yr", samples=9, events=orbits.events.Pericentre("Mars"))
    assert len(run.events) > 2
    assert f"events, the first 2 of {len(run.events)}" in " ".join(seen.texts(run.plot("energy"))).replace("\n", " ")


def test_the_path_of_a_parabola_is_drawn_without_warnings_of_numpy(recwarn: pytest.WarningsRecorder) -> None:
    system = orbits.System.from_elements({"star": {"gm": 1.0}}, units=orbits.DIMENSIONLESS)
    for e in (1.0, 2.0):
        system = system.add(f"e = {e}", primary="star", q=1.0, e=e, T=3.0)
    orbits.propagate(system, orbits.Gauss(4), duration=10.0, samples=51).plot()
    assert not [warning for warning in recwarn if issubclass(warning.category, RuntimeWarning)]
