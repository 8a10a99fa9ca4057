"""Runs that a step or a method cannot follow are warned of before they start, or refused, by option, with a remedy."""

import re
import warnings

import astropy.units as u
import numpy as np
import pytest

import orbits
from orbits.elements import state_from_elements
from orbits.errors import InputError, RetiredWarning, StepWarning
from orbits.propagation.checks.kepler_splitting import unfit

from ..coverings import first

MAP = orbits.WisdomHolman()
OPTIONS = {"samples": 2, "progress": False}


def around_a_star(*others, radii=None):
    """Two quiet planets of a star, with other bodies: (name, gm, position on the x axis, speed along y)."""
    names, gm, x, w = zip(("star", 1.0, 0.0, 0.0), ("b", 1e-4, 1.0, 1.0), ("c", 1e-4, -2.0, -0.7), *others, strict=True)
    q, v = np.zeros((len(gm), 3)), np.zeros((len(gm), 3))
    q[:, 0], v[:, 1] = x, w
    return orbits.System(names, gm, q, v, units=orbits.DIMENSIONLESS, radii=radii)


def test_a_dt_too_long_for_the_innermost_pericentre_is_refused_with_the_one_that_would_do():
    system = orbits.System.solar_system(bodies=["Sun", "Mercury", "Venus", "Mars", "Jupiter", "Saturn"])
    text = r"dt = 6 d is too long.*Mercury passes Sun, at 0\.3075 AU.*dt <= 3\.5 d"
    with pytest.raises(InputError, match=text) as caught:
        orbits.propagate(system, MAP, dt="6 d", duration="1 yr", check_step="refuse", **OPTIONS)
    assert str(caught.value).endswith("This is refused by check_step='refuse'.")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        orbits.propagate(system, MAP, dt="3.5 d", duration="1 yr", check_step="refuse", **OPTIONS)
        orbits.propagate(system, "gauss", duration="30 d", check_step="refuse", **OPTIONS)  # steps chosen one by one
    with pytest.raises(InputError, match=r"dt = 30 d is too long for StormerVerlet"):
        orbits.propagate(system, "stormer-verlet", dt="30 d", duration="1 yr", check_step="refuse", **OPTIONS)


@pytest.mark.parametrize("gm", [1e-5, 0.0])
def test_the_dt_that_would_do_does(gm):
    """It is rounded down: to the nearest two digits it would be too long for half of all orbits."""
    for x in np.linspace(0.03, 0.3, 40):
        system = around_a_star(("d", gm, x, 1.1 / np.sqrt(x)))
        with pytest.raises(InputError) as caught:
            orbits.propagate(system, MAP, dt=0.5, duration=2.0, check_step="refuse", **OPTIONS)
        enough = min(map(float, re.findall(r"dt <= (\S+) resolves", str(caught.value))))
        assert not list(unfit(system, MAP, enough, 2.0))
        assert list(unfit(system, MAP, 1.12 * enough, 2.0))  # two digits


def test_a_massive_orbit_that_crosses_another_is_refused_before_the_start():
    crossing = around_a_star(("d", 1e-4, 1.3, 1.0))
    with pytest.raises(InputError, match=r"(?s)orbits of c and d come within 0, less.*Gauss\(stages=8\), the default"):
        orbits.propagate(crossing, MAP, dt=0.05, duration=1.0, check_step="refuse", **OPTIONS)
    with pytest.warns(StepWarning, match="cannot follow close encounters of massive bodies"):
        orbits.propagate(crossing, MAP, dt=0.05, duration=1.0, **OPTIONS)


def test_orbits_that_cross_are_warned_of_wherever_they_do():
    """Two planets of 1e-7, for which three Hill radii are 0.012: less than two degrees of their orbits."""
    for turned in np.linspace(0.0, 0.06, 9):
        q, v = state_from_elements(1.0, a=[1.0, 1.2], e=[0.0, 0.3], omega=[0.0, turned], M=[0.0, 3.0])
        q, v = np.vstack([np.zeros(3), q]), np.vstack([np.zeros(3), v])
        system = orbits.System(["star", "b", "c"], [1.0, 1e-7, 1e-7], q, v, units=orbits.DIMENSIONLESS)
        (found,) = unfit(system, MAP, 0.01, 1.0)
        assert found.rows == ["the orbits of b and c come within 0, less than 3 Hill radii"]


def test_a_planet_that_falls_straight_into_the_star_has_no_step_that_resolves_it():
    falling = around_a_star(("d", 1e-6, 5.0, 0.0))
    v = falling.values.v.copy()
    v[3, 0] = -1.0
    (found,) = unfit(falling.replaced(v=v), MAP, 0.01, 1.0)
    assert re.search(r"d passes star, at 0, .* 0 steps; .*No step resolves it: leave out dt", found.said)


def test_all_that_is_wrong_is_said_at_once():
    crossing = around_a_star(("d", 1e-4, 1.3, 1.0), ("rock", 0.0, 0.5, 0.4))
    with pytest.raises(InputError) as caught:
        orbits.propagate(crossing, MAP, dt=0.1, duration=9.0, check_step="refuse", **OPTIONS)
    for part in ("too long for 1 massless particle", "rock passes star", "the orbits of c and d come within"):
        assert part in str(caught.value)


@pytest.mark.parametrize("derivative", [orbits.megno, orbits.state_transition])
def test_derivatives_of_runs_are_refused_alike(derivative):
    system = orbits.System.solar_system()
    with pytest.raises(InputError, match=r"(?s)dt = 30 d is too long for Gauss\(stages=2\).*check_step='refuse'"):
        derivative(system, orbits.Gauss(stages=2), dt="30 d", duration="1 yr", check_step="refuse")


def test_an_archive_is_not_begun_by_a_run_that_is_refused(tmp_path):
    with pytest.raises(InputError):
        orbits.propagate(
            orbits.System.solar_system(), MAP, dt="6 d", duration="1 yr", archive=tmp_path / "run.h5",
            check_step="refuse", **OPTIONS,
        )  # fmt: skip
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("answer", ["warn", "Refuse", 1, None])
def test_another_answer_to_the_check_of_the_step_is_refused(answer):
    with pytest.raises(InputError, match=r"check_step is .*; expected True \(warn\), False or 'refuse'"):
        orbits.propagate(around_a_star(), MAP, dt=0.1, duration=1.0, check_step=answer, **OPTIONS)


def test_bodies_inside_the_primary_are_refused_where_its_radius_is_known():
    inside = around_a_star(("p", 0.0, 0.01, 1.0), ("q", 0.0, 0.04, 1.0), radii=[0.05, 0.0, 0.0, 0.0, 0.0])
    text = (
        r"'p' is 0\.01 from the centre of 'star', inside its radius of 0\.05, as is q: a Wisdom–Holman step moves "
        r"bodies about a point mass\. Leave them out with system\.remove\('p'\)"
    )
    for check in (True, False):
        with pytest.raises(InputError, match=text):
            orbits.propagate(inside, MAP, dt=0.01, duration=1.0, check_step=check, **OPTIONS)
    orbits.propagate(inside.remove("p", "q"), MAP, dt=0.01, duration=1.0, **OPTIONS)
    with pytest.warns(StepWarning, match="p passes star at"):
        orbits.propagate(inside.replaced(radii=None), MAP, dt=0.01, duration=1.0, **OPTIONS)
    orbits.propagate(inside, duration=0.01, **OPTIONS)  # other methods take it for a point


def test_a_particle_almost_at_the_centre_is_retired_without_warnings_of_numpy():
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        with pytest.warns(RetiredWarning, match="p: t = 0, step 1: the state is no longer finite"):
            orbits.propagate(around_a_star(("p", 0.0, 1e-200, 0.1)), MAP, dt=0.1, duration=1.0, **OPTIONS)
    with pytest.raises(InputError, match="'star' and 'p' are both at"):
        around_a_star(("p", 0.0, 0.0, 0.1))


def test_terms_and_forces_without_a_flow_in_the_map_are_refused_with_the_methods_that_take_them():
    """Those that depend on velocities: frame dragging by a planet, by the Sun in other maps, and drag."""
    system, heliocentric = orbits.System.solar_system(), orbits.WisdomHolman(coordinates="democratic-heliocentric")

    def dragged(body):
        pole = (286.13, 63.87) * u.deg
        return system.with_terms(orbits.terms.FrameDragging(body, spin=1.9e41 * u.kg * u.m**2 / u.s, pole=pole))

    slowed = system.with_forces(orbits.terms.Drag(rate=1e-6 / u.yr, bodies=["Mars"]))
    for bodies, method, text in (
        (dragged("Jupiter"), MAP, r"dominant body alone, 'Sun'; got FrameDragging of 'Jupiter'\. Leave it out, or"),
        (dragged("Sun"), orbits.methods.SABA(), r"'newtonian \+ frame dragging' is not\. Use Gauss.*WisdomHolman"),
        (dragged("Sun"), heliocentric, r"no terms besides Newton's gravity, got frame dragging; in Jacobi .*Gauss"),
        (slowed, MAP, r"cannot march bodies with the force of drag\. Use Gauss"),
    ):
        with pytest.raises(InputError, match=text):
            orbits.propagate(bodies, method, dt="3 d", duration="1 yr", **OPTIONS)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"corrector": 17}, r"corrector=17 is made for Jacobi coordinates, and does not fit .*leave it out"),
        ({"kernel": "lazy"}, r"kernel='lazy' is made for Jacobi coordinates, and does not fit .*leave it out"),
        ({"corrector2": True}, r"corrector2=True is made for Jacobi coordinates, and does not fit .*leave it out"),
        ({"coordinates": "jacobi", "kernel": "lazy", "corrector": 0}, r"use corrector=17, or kernel='standard'"),
        ({"coordinates": "jacobi", "kernel": "standard", "corrector2": True}, r"use kernel='modified-kick' or 'lazy'"),
        ({"coordinates": "jacobi", "corrector": -3}, r"corrector is -3; expected 17, 11, 7, 5, 3, or 0 for none"),
    ],
)
def test_a_corrector_is_refused_with_a_kernel_or_coordinates_that_it_does_not_fit(options, text):
    with pytest.raises(InputError, match=text):
        orbits.WisdomHolman(**({"coordinates": "democratic-heliocentric"} | options))


def test_a_system_without_a_body_that_dominates_others_is_refused():
    text = r"with more than 90 % of the mass; the heaviest of these 3 has 55\.6 %\. Use a method"
    with pytest.raises(InputError, match=text):
        orbits.propagate(around_a_star().replaced(gm=[1.0, 0.8, 1e-4]), MAP, dt=0.1, duration=1.0, **OPTIONS)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"samples": 0}, "samples = 0: a count includes both ends, so at least 2"),
        ({"samples": -3}, "samples = -3: a count includes both ends"),
        ({"threads": 0}, "threads, if given, must be a whole number >= 1, got 0"),
        ({"threads": -2}, "threads, if given, must be a whole number >= 1, got -2"),
        ({"dt": 0.0}, "dt must be finite and not zero, got 0"),
        ({"duration": 0.0}, "duration is 0; give a positive one"),
    ],
)
def test_a_count_of_none_or_fewer_is_refused_by_name(options, text):
    with pytest.raises(InputError, match=text):
        orbits.propagate(around_a_star(), MAP, **({"dt": 0.1, "duration": 1.0, "progress": False} | options))


HELIOCENTRIC = {"coordinates": "democratic-heliocentric"}


def beside_jupiter(*distances):
    """The Sun, Jupiter and Saturn, with massless particles about Jupiter, and one that is far from all."""
    start = orbits.System.solar_system("2022-08-09", bodies=["Sun", "Jupiter", "Saturn"])
    for k, distance in enumerate(distances):
        start = start.add(f"m{k}", primary="Jupiter", a=distance * u.au, e=0.1)
    return start.add("far", primary="Sun", a=2.5 * u.au, e=0.1)


@pytest.mark.parametrize(
    ("method", "remedy"),
    [
        (MAP, 'Use encounters="follow", or'),
        (orbits.WisdomHolman(**HELIOCENTRIC), 'Use encounters="follow", or'),
        (orbits.methods.SABA(), r'Use WisdomHolman\(encounters="follow"\), or'),
    ],
)
def test_particles_that_start_beside_a_planet_are_told_before_the_start_or_refused(method, remedy):
    """They may come no closer than they are, so that no passage would tell: one is bound, one 0.8 au away."""
    start, options = beside_jupiter(0.001, 0.9), {"dt": "50 d", "duration": "1 yr", **OPTIONS}
    text = (
        r"2 massless particles start within 3 Hill radii of a planet, where .* cannot follow them:\n  m0 is 0\.0009 AU "
        rf"from Jupiter\.\n  m1 is 0\.81 AU from Jupiter\.\n{remedy} Gauss\(stages=8\) without dt\."
    )
    with pytest.warns(StepWarning, match=text):
        orbits.propagate(start, method, **options)
    with pytest.raises(InputError, match=text):
        orbits.propagate(start, method, check_step="refuse", **options)
    with pytest.warns(StepWarning, match="1 massless particle starts within .* cannot follow it:\n  m0 is"):
        orbits.propagate(start.remove("m1"), method, **options)


@pytest.mark.nightly
@pytest.mark.parametrize("flat", first(1, [True, False]))
def test_with_terms_of_any_kind_they_are_sent_to_steps_of_their_own(flat):
    oblate = orbits.terms.ZonalHarmonics("Sun", J2=2e-7, radius=696000 * u.km, pole=(286.13, 63.87) * u.deg)
    term = oblate if flat else orbits.terms.PostNewtonian(sources=["Sun"])
    with pytest.raises(InputError, match=r'm0 is 0\.0009 AU from Jupiter\.\nUse encounters="follow", or Gauss'):
        orbits.propagate(
            beside_jupiter(0.001).with_terms(term), MAP, dt="50 d", duration="1 yr", check_step="refuse", **OPTIONS
        )


@pytest.mark.parametrize("method", [orbits.WisdomHolman, orbits.methods.SABA])
def test_particles_that_start_beside_a_planet_are_retired_before_the_first_step(method, tmp_path):
    """By their places at the start, in archives and runs that go on as well; the one that is far from all goes on."""
    start, options = beside_jupiter(0.001, 0.9), {"dt": "50 d", "samples": 3, "progress": False}
    method = method(encounters="retire")
    with pytest.warns(RetiredWarning, match=r"2 massless particles .*") as seen:
        run = orbits.propagate(start, method, duration="2 yr", archive=tmp_path / "run.h5", **options)
    assert "m1: " in str(seen[-1].message)
    for one in (run, orbits.resume(run.path, until=3 * u.yr, progress=False)):
        assert {each.name: (each.step, each.reason) for each in one.retired} == dict.fromkeys(
            ("m0", "m1"), (0, "it came within three Hill radii of a planet, or passed it too fast for the step")
        )
        assert np.allclose(one.retired["m0"].q.to_value(u.au), start["m0"].q.to_value(u.au), rtol=0, atol=1e-12)
        assert np.isfinite(one.q[0].value).all()
    alone = orbits.propagate(start.remove("m0", "m1"), method, duration="2 yr", **options)
    assert np.array_equal(run.q[-1, -1].value, alone.q[-1, -1].value)


def test_particles_that_start_beside_a_planet_and_are_followed_need_no_warning():
    method = orbits.WisdomHolman(encounters="follow")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        orbits.propagate(beside_jupiter(0.01), method, dt="50 d", duration="1 yr", **OPTIONS)
