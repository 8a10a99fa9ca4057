"""Terms and forces as part of a System: values with units, kept, shown, refused."""

import copy
import pickle

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.errors import InputError, UnknownNameError
from orbits.terms import DegreeTwo, Drag, FrameDragging, NobiliRoxburgh, PostNewtonian, ZonalHarmonics

from ..coverings import each

POLE = (286.13 * u.deg, 63.87 * u.deg)


@pytest.fixture
def system():
    return orbits.System.from_elements(
        {
            "Sun": {"mass": 1 * u.M_sun},
            "Jupiter": {"a": 5.2 * u.au, "e": 0.05, "mass": 1 * u.M_jup},
            "Ceres": {"a": 2.77 * u.au, "e": 0.08, "inc": 10 * u.deg},
        }
    )


def zonal(body="Sun", **changes):
    return ZonalHarmonics(body, **{"J2": 2.2e-7, "radius": 696000 * u.km, "pole": POLE, **changes})


def test_terms_and_forces_make_another_system(system):
    flattened = system.with_terms(zonal()).with_forces(Drag(rate=1e-6 / u.yr, bodies=["Ceres"]))
    assert system.terms == ()
    assert system.forces == ()
    assert flattened != system
    assert flattened.replaced(terms=(), forces=()) == system
    assert flattened == system.with_terms(zonal()).with_forces(Drag(rate=1e-6 / u.yr, bodies=["Ceres"]))
    with pytest.raises(AttributeError, match="a System is a value"):
        flattened.terms = ()


def test_numbers_are_kept_in_the_units_of_the_system(system):
    (term,) = system.with_terms(zonal()).terms
    assert term.radius.unit == u.au
    assert term.radius.to_value(u.km) == pytest.approx(696000, rel=1e-15)
    ra, dec = np.radians(286.13), np.radians(63.87)
    assert term.pole == pytest.approx((np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)), rel=1e-15)
    (drag,) = system.with_forces(Drag(rate=1 / u.yr, velocity=[1, 0, 0] * u.km / u.s)).forces
    assert drag.rate.to_value(1 / u.day) == pytest.approx(1 / 365.25, rel=1e-15)
    assert drag.velocity[0].unit == u.au / u.day


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_a_copy_has_the_same_terms_and_forces(system, copied):
    made = system.with_terms(zonal(J3=1e-8), FrameDragging(spin=1.9e41 * u.kg * u.m**2 / u.s, pole=POLE))
    made = made.with_forces(Drag(rate=1e-6 / u.yr))
    assert copied(made) == made
    # Bound again to the same bits: what was stored is not converted a second time.
    assert copied(made).terms == made.replaced(terms=made.terms).terms == made.terms


def test_terms_stay_where_bodies_move_and_come_and_go(system):
    made = system.with_terms(zonal())
    for other in (made.replaced(q=made.q * 2), made.barycentric(), made.add("probe", primary="Sun", a=1 * u.au)):
        assert other.terms == made.terms
    assert made.remove("Ceres").terms == made.terms
    assert (system + made.remove("Ceres")).terms == made.terms
    assert (made + system).terms == made.terms


def test_forces_of_joined_systems_never_act_twice_on_a_body(system):
    def dragged(rate, *bodies):
        return system.with_forces(Drag(rate=rate / u.yr, bodies=list(bodies) or None))

    assert dragged(1, "Ceres") + dragged(1, "Ceres") == dragged(1, "Ceres")
    assert len((dragged(1, "Ceres") + dragged(2, "Jupiter")).forces) == 2
    for one, other in ((dragged(1, "Ceres"), dragged(2, "Jupiter", "Ceres")), (dragged(1), dragged(1, "Ceres"))):
        with pytest.raises(InputError, match="Drag acts on Ceres in both systems, with other numbers"):
            one + other
    rigid = [system.with_rigid("Ceres", orbits.RigidBody(shape=(size, 2, 1) * u.km, attitude="Sun")) for size in (3, 4)]
    with pytest.raises(InputError, match="RigidBodies acts on Ceres in both systems"):
        rigid[0] + rigid[1]


def test_what_acts_by_or_on_a_body_alone_goes_with_it(system):
    rate = 1e-6 / u.yr
    forces = [Drag(rate=rate, bodies=bodies) for bodies in (["Ceres"], ["Jupiter", "Ceres"], None)]
    made = system.with_terms(zonal("Sun"), zonal("Jupiter")).with_forces(*forces)
    left = made.remove("ceres")
    assert left.terms == made.terms
    assert [force.bodies for force in left.forces] == [("Jupiter",), None]
    left = made.remove("Jupiter", "Ceres")
    assert [term.body for term in left.terms] == ["Sun"]
    assert left.forces == made.forces[2:]


def test_the_medium_of_drag_is_seen_from_the_barycentre(system):
    wind = [1, 0, 0] * u.km / u.s
    made = system.with_forces(Drag(rate=1 / u.yr, velocity=wind))
    boosted = made.replaced(v=made.v + [0, 5, 0] * u.km / u.s).barycentric()
    (drag,) = boosted.forces
    assert u.Quantity(drag.velocity).to_value(u.km / u.s) == pytest.approx([1, -5, 0], abs=1e-14)


def test_the_body_is_the_most_massive_one_unless_it_is_named(system):
    assert system.with_terms(zonal(None)).terms[0].body == "Sun"
    assert system.with_terms(zonal("jupiter")).terms[0].body == "Jupiter"


def test_a_system_shows_what_acts_in_it(system):
    made = system.with_terms(zonal()).with_forces(Drag(rate=1e-6 / u.yr, bodies=["Ceres"]))
    assert "with ZonalHarmonics of Sun, Drag on Ceres; elements: ecliptic of J2000)" in repr(made)
    assert "ZonalHarmonics of Sun" in made._repr_html_()
    assert "with" not in repr(system)


def test_named_arrays_tell_what_acts(system):
    made = system.with_terms(zonal())
    assert '"kind": "zonal-harmonics", "body": "Sun"' in made.to_xarray().attrs["terms_and_forces"]
    assert "terms_and_forces" not in system.to_xarray().attrs


def test_energy_is_that_of_the_whole_lagrangian(system):
    made = system.with_terms(zonal("Sun", J2=1e-3))
    gm, r = made.gm[0].value * made.gm[1].value, made.q[1].value - made.q[0].value
    distance = np.linalg.norm(r)
    (term,) = made.terms
    s = r @ np.array(term.pole) / distance
    expected = gm / distance * 1e-3 * (term.radius.value / distance) ** 2 * (1.5 * s * s - 0.5) / made.units.G
    # A difference of energies that are 1e9 times as large.
    assert (made.energy() - system.energy()).value == pytest.approx(expected, abs=4e-16 * abs(system.energy().value))
    assert np.array_equal(made.angular_momentum(), system.angular_momentum())


def test_a_velocity_dependent_term_has_momenta_but_no_energy(system):
    made = system.with_terms(FrameDragging("Sun", spin=1e45 * u.kg * u.m**2 / u.s, pole=POLE))
    assert made.energy().value == pytest.approx(system.energy().value, rel=1e-15)
    assert not np.array_equal(made.angular_momentum(), system.angular_momentum())
    # Action and reaction: the momentum of the whole stays, up to the rounding of its terms.
    size = np.linalg.norm(system.v.value[1]) * system.gm[1].value / system.units.G
    assert np.max(np.abs((made.linear_momentum() - system.linear_momentum()).value)) < 4e-16 * size


BAD = {
    "no term": (lambda s: s.with_terms("J2"), "terms has 'J2'; expected a term, such as orbits.terms.ZonalHarmonics"),
    "a force": (lambda s: s.with_terms(Drag(rate=1 / u.yr)), "expected a term"),
    "a class": (lambda s: s.with_terms(ZonalHarmonics), "expected a term"),
    "a term": (lambda s: s.with_forces(zonal()), r"expected a force, such as orbits.terms.Drag\("),
    "massless": (lambda s: s.with_terms(zonal("Ceres")), "gm of 'Ceres' is 0; expected a massive body"),
    "twice": (lambda s: s.with_terms(zonal(), zonal(None)), r"'Sun' has two terms ZonalHarmonics.*terms=\[\.\.\.\]"),
    "no radius": (lambda s: s.with_terms(zonal(radius=None)), "'Sun': radius is missing"),
    "unit": (lambda s: s.with_terms(zonal(radius=1 * u.kg)), "radius of 'Sun' is in kg; expected length in AU"),
    "sign": (lambda s: s.with_terms(zonal(radius=-1 * u.km)), "expected a length > 0"),
    "nothing": (lambda s: s.with_terms(zonal(J2=0)), "J2, J3 and J4 are all 0"),
    "many": (lambda s: s.with_terms(zonal(J2=[1, 2])), r"J2 of 'Sun' is \[1.0, 2.0\]; expected one finite number"),
    "nan": (lambda s: s.with_terms(zonal(J2=np.nan)), "J2 of 'Sun' is nan"),
    "no pole": (lambda s: s.with_terms(zonal(pole=None)), "pole of 'Sun' is missing; expected"),
    "degrees": (lambda s: s.with_terms(zonal(pole=(286.13, 63.87))), "plain numbers are radians, degrees need u.deg"),
    "zero pole": (lambda s: s.with_terms(zonal(pole=(0, 0, 0))), "not all of them 0"),
    "lengths": (lambda s: s.with_terms(zonal(pole=[1 * u.AU] * 3)), "pole of 'Sun' is in AU; expected no unit"),
    "four": (lambda s: s.with_terms(zonal(pole=(0, 0, 0, 1))), "expected .right ascension, declination"),
    "word": (lambda s: s.with_terms(zonal(pole=5)), "pole of 'Sun' is 5; expected"),
    "no spin": (lambda s: s.with_terms(FrameDragging(pole=POLE)), "spin is missing"),
    "no source": (lambda s: s.with_terms(PostNewtonian(sources=[])), r"sources is \[\]; expected names of"),
    "no names": (lambda s: s.with_terms(PostNewtonian(sources=[1])), r"sources is \[1\]; expected names of"),
    "one source twice": (
        lambda s: s.with_terms(PostNewtonian(sources=["Sun", "sun"])),
        r"sources names one body twice, \['Sun', 'sun'\]",
    ),
    "source and body": (
        lambda s: s.with_terms(PostNewtonian("Sun", sources=["Jupiter"])),
        "body is 'Sun' and sources is .'Jupiter'.; expected sources alone",
    ),
    "one of several massless": (
        lambda s: s.with_terms(PostNewtonian(sources=["Sun", "Ceres"])),
        "gm of 'Ceres' is 0; expected a massive body",
    ),
    "all and one": (
        lambda s: s.with_terms(PostNewtonian(), PostNewtonian(sources=["Sun"])),
        "two terms PostNewtonian, of 'all bodies' and 'Sun'; expected one",
    ),
    "two fields": (
        lambda s: s.with_terms(PostNewtonian(sources=["Sun"]), PostNewtonian(sources=["Jupiter"])),
        "two terms PostNewtonian, of 'Sun' and 'Jupiter'; expected one",
    ),
    "light": (lambda s: s.with_terms(PostNewtonian(sources=["Sun"], c=0 * u.km / u.s)), "expected a speed > 0"),
    "another light": (
        lambda s: s.with_terms(PostNewtonian(c=1.0)),
        r"c is 1 AU / d, 1731.45684 km/s; expected the speed of light, 299792.458 km/s. Leave out c, or use",
    ),
    "no such source": (
        lambda s: s.with_terms(PostNewtonian(sources=["Sum"])),
        "^PostNewtonian: there is no body 'Sum' for sources; expected one of Sun",
    ),
    "no such body": (
        lambda s: s.with_terms(FrameDragging("Pluto", spin=1.0, pole=POLE)),
        "^FrameDragging: there is no body 'Pluto'; expected one of Sun",
    ),
    "massless attitude": (
        lambda s: s.with_terms(DegreeTwo("Sun", J2=1e-4, C22=1e-5, radius=1, pole=POLE, attitude="Ceres")),
        "^DegreeTwo: attitude has 'Ceres', but gm of 'Ceres' is 0; expected a massive body",
    ),
    "massless source": (lambda s: s.with_terms(PostNewtonian(sources=["Ceres"])), "expected a massive body"),
    "no rate": (lambda s: s.with_forces(Drag()), "rate is missing"),
    "rate": (
        lambda s: s.with_forces(Drag(rate=1 * u.yr)),
        "the rate of Drag is in yr; expected a number per time",
    ),
    "against": (lambda s: s.with_forces(Drag(rate=-1 / u.yr)), "expected one finite number >= 0"),
    "medium": (lambda s: s.with_forces(Drag(rate=1 / u.yr, velocity=[1, 2])), "expected three finite numbers"),
    "none": (lambda s: s.with_forces(Drag(rate=1 / u.yr, bodies=[])), "expected names, or None for all bodies"),
    "same": (lambda s: s.with_forces(Drag(rate=1 / u.yr, bodies=["Sun", "sun"])), "names one body twice"),
}

TWICE = {
    "two figures": (
        lambda s: s.with_terms(zonal(), DegreeTwo("Sun", J2=1e-4, C22=1e-5, radius=1, pole=POLE, attitude="Jupiter")),
        "^'Sun' has a J2 twice, by ZonalHarmonics and by DegreeTwo; expected one of them, as they add up",
    ),
    "a figure that turns": (
        lambda s: s.with_terms(zonal()).with_rigid("Sun", orbits.RigidBody(shape=(3, 3, 2) * u.km, spin=1.0)),
        "^'Sun' has a J2 twice, by ZonalHarmonics and by RigidBody",
    ),
    "relativity twice": (
        lambda s: s.with_terms(PostNewtonian(sources=["Jupiter", "Sun"]), NobiliRoxburgh("Sun")),
        "^'Sun' has relativity twice, by PostNewtonian and by NobiliRoxburgh",
    ),
    "relativity of all and of one": (
        lambda s: s.with_terms(NobiliRoxburgh("Sun"), PostNewtonian()),
        "^'Sun' has relativity twice, by NobiliRoxburgh and by PostNewtonian",
    ),
    "C22 twice": (
        lambda s: s.with_terms(DegreeTwo("Sun", J2=0, C22=1e-5, radius=1, pole=POLE, attitude="Jupiter")).with_rigid(
            "Sun", orbits.RigidBody(shape=(3, 2, 1) * u.km, spin=1.0)
        ),
        "^'Sun' has a C22 twice, by DegreeTwo and by RigidBody",
    ),
}


@each(("make", "message"), BAD.values())
def test_what_cannot_act_is_refused_in_words(system, make, message):
    with pytest.raises(InputError, match=message):
        make(system)


@each(("make", "message"), TWICE.values())
def test_a_run_in_which_a_figure_or_relativity_counts_twice_is_refused(system, make, message):
    with pytest.raises(InputError, match=message):
        orbits.propagate(make(system), dt="1 d", duration="2 d")


@pytest.mark.nightly
def test_motion_too_fast_for_the_first_order_of_relativity_is_refused_before_a_run():
    units, c = orbits.DIMENSIONLESS, 9.0
    system = orbits.System(["a", "b"], [1, 0.1], [[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [0, 1, 0]], units=units)
    fast = system.with_terms(PostNewtonian(sources=["a"], c=c))
    for method in (orbits.Gauss(stages=4), orbits.WisdomHolman()):
        with pytest.raises(InputError, match=r"'b' .* of the speed of light.*\(v/c\)\^2 = 0.0272"):
            orbits.propagate(fast, method, dt=0.01, duration=1.0, progress=False)


def test_unknown_bodies_are_named_with_what_comes_close(system):
    with pytest.raises(UnknownNameError, match=r"ZonalHarmonics: there is no body 'Jupyter'.*Did you mean 'Jupiter'"):
        system.with_terms(zonal("Jupyter"))
    with pytest.raises(UnknownNameError, match="Drag: there is no body 'Pallas'"):
        system.with_forces(Drag(rate=1 / u.yr, bodies=["Pallas"]))


def test_dimensionless_systems_take_plain_numbers_and_ask_for_the_speed_of_light():
    system = orbits.System(["a", "b"], [1, 0.1], [[0, 0, 0], [1, 0, 0]], np.zeros((2, 3)), units=orbits.DIMENSIONLESS)
    made = system.with_terms(ZonalHarmonics("a", J2=1e-3, radius=0.1, pole=(0, 0, 2)))
    assert made.terms[0].pole == (0, 0, 1)
    assert made == pickle.loads(pickle.dumps(made))
    with pytest.raises(InputError, match="has no speed of light: give c="):
        system.with_terms(FrameDragging("a", spin=0.1, pole=(0, 0, 1)))
    with pytest.raises(InputError, match="has no speed of light: give c="):
        system.with_terms(PostNewtonian(sources=["a"]))
    assert system.with_terms(PostNewtonian(sources="A", c=100)).terms[0].sources == ("a",)
    assert system.with_terms(FrameDragging("a", spin=0.1, pole=(0, 0, 1), c=100)).terms[0].c.value == 100
