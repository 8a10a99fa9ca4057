"""Pictures of runs, systems and reports: nothing overlaps, axes tell frame and unit, lines are explained."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

import orbits
from orbits.plotting import arcs, save, style
from orbits.regression.report_picture import picture
from tests.plotting import seen
from tests.plotting.runs import about_a_star
from tests.regression.reports import NINE, make

from ..coverings import each, only

PLANETS = {"inner": {"a": 1.0, "e": 0.2}, "outer": {"a": 5.2, "e": 0.05, "M": 2.0}}
SPANS = {"an hour": 1 / 24, "a year": 365.25, "40 years": 14610.0, "40 years back": -14610.0, "1e6 years": 3.6525e8}
LONG = {f"A planet with a name of forty characters{k}": {"a": 1.0 + k} for k in range(6)}
FORTY = {f"{k} asteroid of some length": {"a": 2.0 + 0.01 * k, "M": 1.0 * k} for k in range(40)}
MANY_ASTEROIDS = {**FORTY, "far": {"a": 90.0}}
THIRTY = {f"planet {k}": {"a": 1.15**k, "M": 2.4 * k} for k in range(1, 30)}
UNITS = {"an hour": "[min]", "a year": "[d]", "40 years": "[yr]", "40 years back": "[yr]", "1e6 years": "[Myr]"}


@cache
def physical(span):
    times = np.linspace(0.0, span, 60)
    # From the last sample but one on, steps of a day are taken again for the end of the picture.
    times[-2] = max(times[-2], span - 36525.0)
    return about_a_star(PLANETS, times, units=orbits.SOLAR, epoch="2000-01-01T12:00:00")


PICTURES = {
    **{name: lambda span=span: physical(span).plot() for name, span in SPANS.items()},
    "long names": lambda: about_a_star(LONG, np.linspace(0.0, 60.0, 50)).plot(),
    "thirty massless": lambda: about_a_star(THIRTY, np.linspace(0.0, 60.0, 50)).plot(),
    "two samples": lambda: about_a_star(PLANETS, [0.0, 1.0]).plot(),
    "no units, long": lambda: about_a_star(PLANETS, np.linspace(0.0, 7e6, 50)).plot(),
    "metres": lambda: in_metres().plot(),
    "moons": lambda: about_a_star({"moon": {"a": 0.01, "e": 0.1}}, np.linspace(0.0, 0.006, 50)).plot(),
    "kilometres": lambda: about_a_star({"moon": {"a": 1e5, "e": 0.1}}, np.linspace(0.0, 2e8, 50)).plot(),
    "one body": lambda: alone().plot(),
    "many asteroids": lambda: about_a_star(MANY_ASTEROIDS, np.linspace(0.0, 60.0, 50)).plot(),
    "a system": lambda: orbits.System.solar_system().plot(),
    "a system of long names": lambda: about_a_star(LONG, [0.0, 1.0]).system.plot(),
    "a system of thirty": lambda: heavy_thirty().plot(),
    "a report": lambda: picture(make(NINE, NINE)),
}


def alone():
    q, v = [[1.0, 0.0, 0.0]], [[0.1, 0.0, 0.2]]
    system = orbits.System(["rock"], [1.0], q, v, units=orbits.DIMENSIONLESS)
    times = np.linspace(0.0, 10.0, 11)
    q, v = system.values.q + times[:, None, None] * system.values.v, np.tile(system.values.v, (11, 1, 1))
    return orbits.Trajectory(system, times, q, v, step=0.1, integrator=orbits.StormerVerlet())


def heavy_thirty():
    bodies = {"star": {"gm": 1.0}, **{name: {"gm": 1e-9, **given} for name, given in THIRTY.items()}}
    return orbits.System.from_elements(bodies, units=orbits.DIMENSIONLESS)


def in_metres():
    from astropy import units as u

    si = orbits.UnitSystem("SI", length=u.m, time=u.s, mass=u.kg)
    bodies = {
        "star": {"gm": 1.3e20 * u.m**3 / u.s**2},
        "planet": {"gm": 4e14 * u.m**3 / u.s**2, "a": 1.5e11 * u.m, "e": 0.1},
    }
    return orbits.System.from_elements(bodies, units=si)


@cache
def drawn(name):
    """Return one of the pictures, drawn once and asked by many tests."""
    return PICTURES[name]()


EACH_KIND = ("40 years back", "moons", "kilometres", "one body", "long names", "many asteroids", "a report")
"""Of each kind of map and legend one picture; the others differ from these in little."""


@pytest.mark.parametrize("name", only(EACH_KIND, PICTURES))
def test_nothing_in_a_picture_overlaps(name):
    figure = seen.laid_out(drawn(name))
    assert seen.colliding_tick_labels(figure) == []
    assert seen.legends_on_panels(figure) == []
    assert seen.captions_on_legends(figure) == []
    assert seen.outside(figure) == []
    assert not any(axes.get_legend() for axes in figure.get_axes())  # none within a panel, on the orbits


@each("name", SPANS)
def test_time_is_told_in_a_unit_that_suits_the_run_and_since_when(name):
    (label,) = {axes.get_xlabel() for axes in drawn(name).get_axes() if "time" in axes.get_xlabel()}
    assert label == f"time since 2000-01-01 12:00 TDB {UNITS[name]}"


def map_of(figure):
    return next(axes for axes in figure.get_axes() if axes.get_xlabel().startswith("x"))


def test_maps_tell_their_frame_and_unit():
    run = physical(365.25)
    assert map_of(drawn("a year")).get_xlabel() == "x, ecliptic of J2000 [au]"
    assert map_of(run.plot(frame="icrf")).get_ylabel() == "y, ICRF [au]"
    assert map_of(run.system.plot()).get_ylabel() == "y, ecliptic of J2000 [au]"
    assert map_of(drawn("two samples")).get_xlabel() == "x"
    assert "10⁹ m]" in map_of(drawn("metres")).get_xlabel()
    assert (map_of(drawn("moons")).get_xlabel(), map_of(drawn("kilometres")).get_xlabel()) == ("x [10⁻³]", "x [10³]")


def test_the_frame_on_the_axes_is_the_one_that_is_drawn():
    system = orbits.System.solar_system(bodies=["Sun", "Jupiter"])
    x, y, _ = system.values.q[system.index("Jupiter")]
    ends = {}
    for frame in ("icrf", "ecliptic"):
        axes = map_of(system.plot(frame=frame))
        ends[frame] = [np.ravel(line.get_data()) for line in axes.lines if line.get_marker() == "o"][-1]
    assert ends["icrf"] == pytest.approx([x, y], rel=1e-14)
    assert abs(ends["ecliptic"][1] - y) > 0.1  # the obliquity turns y, by 8 %, and brings z in
    with pytest.raises(orbits.errors.UnknownNameError, match="there is no frame"):
        system.plot(frame="galactic")


def test_a_run_is_headed_by_its_method_and_step_in_words():
    assert map_of(drawn("a year")).get_title(loc="left") == "Gauss, 8 stages, dt = 1 d"
    assert map_of(physical(1.0).plot(title="Mine")).get_title(loc="left") == "Mine"


def test_a_run_past_the_last_date_that_astropy_knows_can_be_drawn():
    assert map_of(drawn("1e6 years")) is not None


def test_a_run_without_samples_is_refused_in_words():
    run = about_a_star(PLANETS, [0.0, 1.0])
    empty = (run.times[:0], run.q.value[:0], run.v.value[:0])
    with pytest.raises(orbits.errors.InputError, match="no samples yet, so there is nothing to draw"):
        orbits.Trajectory(run.system, *empty, step=1.0, integrator=run.integrator).plot()


def test_the_band_of_a_run_and_the_ellipses_are_explained():
    told = " ".join(seen.texts(drawn("a year"))).replace("\n", " ")
    band = "grey band: up to 2⁻⁵³, the rounding of one float64"
    for words in (band, "thin ellipses: the osculating", "discs: the bodies"):
        assert words in told
    assert "energy and angular momentum: of the massive bodies" in told  # the planets are massless here


def test_coarse_samples_are_not_joined_to_a_polygon():
    figure = about_a_star({"planet": {"a": 1.0, "e": 0.5}}, np.linspace(0.0, 6.0, 8)).plot()
    curve = max((line.get_xydata() for line in map_of(figure).lines if line.get_linestyle() == "-"), key=len)
    assert len(curve) >= 360


def test_thirty_massive_bodies_have_thirty_colours_and_names():
    (legend,) = drawn("a system of thirty").legends
    assert len(legend.get_texts()) == 30
    assert len({handle.get_color() for handle in legend.get_lines()}) == 30


def test_planets_close_about_the_sun_have_a_map_of_their_own():
    planets = {name: {"a": a} for name, a in (("a", 0.4), ("b", 0.7), ("c", 1.0), ("far", 30.0))}
    run = about_a_star(planets, np.linspace(0.0, 6.0, 50), units=orbits.SOLAR)
    for figure in (run.plot(), run.system.plot()):
        wide, close = (axes for axes in figure.get_axes() if axes.get_xlabel().startswith("x"))
        assert np.ptp(wide.get_xlim()) > 50
        assert np.ptp(close.get_ylim()) < 4
    assert len([axes for axes in run.plot(bodies=["a", "far"]).get_axes() if axes.get_xlabel().startswith("x")]) == 1


def test_a_report_explains_its_lines_and_names_methods_in_words():
    told = " ".join(seen.texts(drawn("a report"))).replace("\n", " ")
    for words in ("Gauss, 8 stages", "strong lines: the largest error so far", "faint: the error itself",
                  "dashed: REBOUND", "round-off, 2⁻⁵³", "the reference solution's own error"):  # fmt: skip
        assert words in told
    assert "stages=" not in told


def test_a_report_of_a_long_run_is_in_years_and_of_one_back_in_time_says_so():
    report = make(NINE, NINE)
    assert "time since the start [Myr]" in seen.texts(picture(replace(report, times=report.times * 1e4)))
    assert "time before the start [yr]" in seen.texts(picture(replace(report, times=-report.times)))


NAME_OF_A_METHOD = "Wisdom–Holman, democratic–heliocentric, standard, corrector 17, follow, dt = 12.5 d; " * 2


@pytest.mark.parametrize("kind", only(["phase"], ["paths", "elements", "phase"]))
def test_a_long_title_is_broken_into_lines_that_end_before_the_next_panel(kind):
    figure = seen.laid_out(physical(365.25).plot(kind, title=NAME_OF_A_METHOD))
    assert seen.outside(figure) == []
    assert seen.titles_on_panels(figure) == []
    assert any(" ".join(text.split()) == NAME_OF_A_METHOD.strip() for text in seen.texts(figure))


@pytest.mark.nightly
def test_the_long_title_of_a_report_is_whole():
    report = make(NINE, NINE)
    figure = seen.laid_out(picture(replace(report, settings={**report.settings, "title": NAME_OF_A_METHOD})))
    assert seen.outside(figure) == []
    assert any(" ".join(text.split()) == NAME_OF_A_METHOD.strip() for text in seen.texts(figure))


def test_points_without_neighbours_have_dots_which_no_line_shows():
    axes = style.figure().add_subplot()
    y = np.array([1.0, np.nan, 3.0, 4.0, np.nan, 6.0])
    assert style.line(axes, np.arange(6.0), y).get_markevery() == [0, 5]
    assert style.line(axes, np.arange(2.0), y[2:4]).get_marker() == "None"
    run = about_a_star({"a": {"a": 1.0, "e": 0.2}}, np.array([3.0]))  # the panels were empty
    lines = [line for panel in run.plot("elements").axes for line in panel.lines]
    assert len(lines) == 3
    assert all(line.get_marker() == "o" for line in lines)


def test_the_offset_of_an_axis_is_in_its_label():
    """Of an unperturbed orbit, whose elements change by round-off alone: matplotlib has 1e-13+2.864788976e-1."""
    run = about_a_star({"planet": {"a": 1.0, "e": 0.2864788976}}, np.linspace(0.0, 36525.0, 60), units=orbits.SOLAR)
    figure = seen.laid_out(run.plot("elements", elements=("e", "a")))
    eccentricity, axis = (axes.yaxis for axes in figure.get_axes()[:2])
    assert eccentricity.get_label_text() == "eccentricity e\n− 0.2864788976 [10⁻¹³]"
    assert axis.get_label_text() == "semi-major axis a\n− 1 [10⁻¹² au]"
    assert {each.get_offset_text().get_text() for each in (eccentricity, axis)} == {""}
    seen.laid_out(figure)  # again
    assert eccentricity.get_label_text() == "eccentricity e\n− 0.2864788976 [10⁻¹³]"


@pytest.mark.nightly
def test_paths_follow_the_motion_within_the_steps_where_samples_are_more_than_a_revolution_apart():
    """A planet of the year 1 with samples 7.5 apart, on an ellipse; three bodies on an eight, with five samples."""
    bodies = {"star": {"gm": 1.0}, "planet": {"a": 1.0, "e": 0.6, "gm": 0.0}}
    system = orbits.System.from_elements(bodies, units=orbits.DIMENSIONLESS)
    run = orbits.propagate(system, duration=60.0, samples=9)
    line = max(drawn_of(run), key=lambda line: np.isfinite(line).all(axis=1).sum())
    r = np.linalg.norm(line, axis=1)
    # The conic r = p - e x, which straight lines between samples would miss by 0.5.
    assert np.abs(r - (1 - 0.36) + 0.6 * line[:, 0]).max() < 1e-9
    turned = np.unwrap(np.arctan2(line[:, 1], line[:, 0]))
    assert abs(turned[-1] - turned[0]) > 9 * 2 * np.pi
    fine = on_an_eight(701).q.value[:, 0, :2]
    for line in drawn_of(on_an_eight()):
        whole = [np.linspace(a, b, 20) for a, b in pairwise(line) if np.linalg.norm(b - a) > 0.02]
        apart = np.linalg.norm(fine[:, None] - np.concatenate([line, *whole])[None], axis=2)
        # All three go round the same curve: the points of the line are on it, and none of it is left out.
        assert np.nanmax(np.nanmin(apart, axis=0)) < 0.01
        assert np.nanmax(np.nanmin(apart, axis=1)) < 0.01


@cache
def on_an_eight(samples=5):
    (x, y), (u, v) = (0.97000436, -0.24308753), (-0.93240737, -0.86473146)
    q, p = [[x, y, 0], [-x, -y, 0], [0, 0, 0]], [[-u / 2, -v / 2, 0], [-u / 2, -v / 2, 0], [u, v, 0]]
    system = orbits.System(["a", "b", "c"], [1.0, 1.0, 1.0], q, p, units=orbits.DIMENSIONLESS)
    return orbits.propagate(system, duration=6.3259, samples=samples)


def drawn_of(run):
    """Return the lines of a picture of paths, (n, 2) each, of hundreds of points."""
    axes = run.plot().axes[0]
    return [np.column_stack(line.get_data()) for line in axes.lines if len(line.get_xdata()) > 100]


def test_of_a_run_of_many_revolutions_the_end_alone_is_marched_again_for_its_picture(monkeypatch):
    bodies = {"star": {"gm": 1.0}, "planet": {"a": 1.0, "e": 0.1, "gm": 0.0}}
    system = orbits.System.from_elements(bodies, units=orbits.DIMENSIONLESS)
    run = orbits.propagate(system, "wisdom-holman", dt=0.3, duration=5000.0, samples=11)
    marched, at = [], orbits.Trajectory.at
    monkeypatch.setattr(arcs, "AT_END", 200)
    monkeypatch.setattr(orbits.Trajectory, "at", lambda run, times: marched.extend(times) or at(run, times))
    assert "dots: samples too far apart for a line" in " ".join(seen.texts(run.plot()))
    more = np.setdiff1d(marched, run.times)
    assert 180 < len(more) <= 200  # of 20,000 in 795 revolutions
    assert more.min() > 4940.0


@pytest.mark.parametrize("kind", ["paths", "error"])
def test_errors_of_zero_are_at_zero_within_the_band_of_rounding(kind):
    figure = on_an_eight().plot(kind)
    panels = [axes for axes in figure.axes if axes.get_ylabel() == "relative change"]
    assert panels
    for axes in panels:
        low, high = axes.get_ylim()
        assert low < 0.0 < 2.0**-53 < high
        assert [patch.get_height() for patch in axes.patches] == [2.0 * 2.0**-53]  # to both sides of zero
        changes = np.concatenate([line.get_ydata() for line in axes.lines if line.get_linestyle() == "-"])
        # Whole numbers of roundings, or exactly none: nothing is put at a floor above zero.
        assert (changes == 0.0).any()
        assert (changes[changes > 0.0] > 1e-18).all()


def test_a_picture_that_is_not_finished_leaves_the_one_that_was_there(tmp_path, monkeypatch):
    """A run that is killed while it draws leaves no damaged picture, which the next one would refuse to replace."""
    made, path = style.figure(1.0, 1.0), tmp_path / "run.png"
    save(made, path)
    before = path.read_bytes()

    def stopped(target, **how):
        target.write_bytes(b"")
        raise SystemExit

    monkeypatch.setattr(made, "savefig", stopped)
    with pytest.raises(SystemExit):
        save(made, path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]
