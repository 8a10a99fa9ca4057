"""Members: particles, clones of an uncertain orbit, grids and lists."""

from __future__ import annotations

import numpy as np
import pytest
from astropy import units as u
from astropy.table import Column
from astropy.time import Time

import orbits
from orbits import ensemble
from orbits.ensemble.clones import drawn
from orbits.errors import EpochError, InputError, OrbitsWarning, UnknownNameError
from tests.ensemble.belts import belt, giants, system

from ..coverings import each

SIGMA = np.array([1e-6, 2e-6, 3e-6, 1e-8, 2e-8, 3e-8])
CORRELATION = 0.6 * np.ones((6, 6)) + 0.4 * np.eye(6)
COVARIANCE = CORRELATION * np.outer(SIGMA, SIGMA)


def test_clones_have_the_covariance_that_was_given():
    """Of 200,000 draws: variances to 1 %, correlations to 0.01, three standard errors each."""
    found = np.cov(drawn(COVARIANCE, 200_000, 1).T)
    np.testing.assert_allclose(np.diag(found), SIGMA**2, rtol=0.01)
    np.testing.assert_allclose(found / np.outer(SIGMA, SIGMA), CORRELATION, atol=0.01)


def test_a_singular_covariance_is_drawn_in_its_own_directions():
    line = np.outer(SIGMA, SIGMA)
    found = drawn(line, 10, 1) / SIGMA
    # The square root of eigenvalues that are 0 but for rounding, 1e-8.
    np.testing.assert_allclose(found, np.repeat(found[:, :1], 6, axis=1), atol=1e-6)
    assert not drawn(np.zeros((6, 6)), 3, 1).any()


def test_the_first_clone_is_the_body_and_more_clones_begin_with_the_same_ones():
    few, many = (ensemble.clones(system(3), "p1", covariance=COVARIANCE, count=n, seed=3) for n in (5, 50))
    assert few.names[0] == "p1"
    assert len(few) == 6
    np.testing.assert_array_equal(few.q[0], system(3)["p1"].q.value)
    np.testing.assert_array_equal(few.q, many.q[:6])
    other = ensemble.clones(system(3), "p1", covariance=COVARIANCE, count=5, seed=4)
    assert (other.q[1:] != few.q[1:]).all()
    assert few.part(0, 2).system().names == ("Sun", "Jupiter", "Saturn", "p0", "p2", *few.names[:2])


def test_clones_of_elements_have_their_covariance():
    names = {"e": 1, "q": u.au, "T": u.day, "Omega": u.deg, "omega": u.deg, "inc": u.deg}
    sigma = np.array([1e-7, 1e-7, 1e-3, 1e-4, 1e-4, 1e-5])
    C = CORRELATION * np.outer(sigma, sigma)
    members = ensemble.clones(system(3), "p1", covariance=C, count=4000, seed=1, elements=names, primary="Sun")
    found = members.part(0, len(members)).system().elements(primary="Sun")
    own = np.array([getattr(found, key).to_value(u.Unit(unit) if unit != 1 else u.one, u.dimensionless_angles())
                    for key, unit in names.items()])[:, -4000:]  # fmt: skip
    np.testing.assert_allclose(own.std(axis=1), sigma, rtol=0.05)  # four standard errors of 4,000 draws


@pytest.mark.parametrize("primary", ["Sun", "jacobi", "barycentre"])
@pytest.mark.parametrize("mass", [0.0, 1e-4])
def test_clones_of_elements_about_a_centre_of_mass_are_near_a_body_that_is_not_the_last_one(primary, mass):
    """The centre is that of the body: of those before it, or of all with itself once."""
    own = {"a": 2.5 * u.au, "e": 0.2, "inc": 0.1, "M": 1.0, "mass": mass * u.M_sun}
    bodies = {"Sun": {"mass": 1 * u.M_sun}, "x": own, "Jupiter": {"a": 5.2 * u.au, "mass": 1 * u.M_jup}}
    whole = orbits.System.from_elements(bodies, epoch="2026-01-01")
    elements = {"e": 1, "q": u.au, "T": u.day, "Omega": u.deg, "omega": u.deg, "inc": u.deg}
    C = 1e-24 * np.eye(6)
    members = ensemble.clones(whole, "x", covariance=C, count=3, seed=1, elements=elements, primary=primary)
    for k, name in enumerate(members.names):
        one = members.part(k, k + 1).system()
        place = one["x" if mass else name].q - whole["x"].q
        assert abs(place.to_value(u.au)).max() < 1e-11  # q by some 1e-12 au, and T by as many days


def test_clones_of_a_body_with_mass_are_systems():
    members = ensemble.clones(giants(), "Jupiter", covariance=COVARIANCE, count=3, seed=1)
    assert members.kind == "systems"
    ones = members.part(0, 4).systems()
    assert ones[0] == giants()
    np.testing.assert_array_equal(ones[2].values.q[[0, 2]], giants().values.q[[0, 2]])
    assert (ones[2].values.q[1] != giants().values.q[1]).all()


@pytest.mark.parametrize(
    ("covariance", "message"),
    [
        (np.eye(5), r"shape \(5, 5\); expected \(6, 6\)"),
        (np.triu(np.ones((6, 6))), "not symmetric"),
        (-np.eye(6), "not symmetric with variances >= 0"),
        (np.eye(6) - 0.9 * (np.ones((6, 6)) - np.eye(6)), "negative eigenvalue"),
        (np.full((6, 6), np.nan), "expected finite numbers"),
    ],
)
def test_what_is_no_covariance_is_refused(covariance, message):
    with pytest.raises(InputError, match=message):
        ensemble.clones(system(3), "p1", covariance=covariance, count=3)


def test_unknown_bodies_and_elements_are_refused():
    with pytest.raises(UnknownNameError):
        ensemble.clones(system(3), "Apophis", covariance=COVARIANCE, count=3)
    wrong = {"e": 1, "q": u.au, "T": u.day, "Omega": u.deg, "omega": u.deg, "inclination": u.deg}
    with pytest.raises(InputError, match="no element 'inclination'; expected some of a, e"):
        ensemble.clones(system(3), "p1", covariance=COVARIANCE, count=3, elements=wrong, primary="Sun")
    for unit in ("foo", u.kg, None):
        units = {"e": 1, "q": unit, "T": u.day, "Omega": u.deg, "omega": u.deg, "inc": u.deg}
        with pytest.raises(InputError, match=r"the unit of q is .*; expected one such as AU"):
            ensemble.clones(system(3), "p1", covariance=COVARIANCE, count=3, elements=units, primary="Sun")
    with pytest.raises(InputError, match=r"say of which elements a matrix is; expected none .* a matrix of a state"):
        ensemble.clones(system(3), "p1", covariance=COVARIANCE, count=3, frame="ecliptic")


def test_an_axis_may_be_a_list_of_quantities():
    grid = ensemble.grid(giants(), primary="Sun", a=[2.0 * u.au, 2.5 * u.au], inc=[0.1 * u.rad, 90 * u.deg])
    assert list(grid.names)[:2] == ["a=2 AU inc=0.1 rad", "a=2 AU inc=1.5708 rad"]
    found = grid.part(0, 4).system().elements(primary="Sun")
    np.testing.assert_allclose(found.a[-4:].value, [2, 2, 2.5, 2.5], rtol=1e-13)
    column = ensemble.grid(giants(), primary="Sun", a=Column([2.0, 2.5], unit=u.au))
    assert list(column.names) == ["a=2 AU", "a=2.5 AU"]
    with pytest.raises(InputError, match=r"a is \[.*\]; expected .* in units of one kind"):
        ensemble.grid(giants(), primary="Sun", a=[2.0 * u.au, 2.5 * u.day])


@pytest.mark.parametrize("value", [None, [None, 2], giants(), Time("2026-01-01"), {"a": 1}])
def test_values_that_a_table_cannot_hold_are_refused_before_anything_is_integrated(value):
    with pytest.raises(InputError, match=r"kind is .*; expected numbers, texts or truth values"):
        ensemble.grid(lambda mass, kind: giants(), mass=[1e-3, 2e-3], kind=value)


def test_a_grid_of_elements_is_made_of_particles_at_its_points():
    grid = ensemble.grid(giants(), primary="Sun", a=[2.0, 2.5] * u.au, e=np.linspace(0, 0.2, 3), inc=5 * u.deg)
    assert len(grid) == 6
    assert repr(grid) == "Ensemble(6 particles: 2 a x 3 e)"
    found = grid.part(0, 6).system().elements(primary="Sun")
    np.testing.assert_allclose(found.a[-6:].value, [2, 2, 2, 2.5, 2.5, 2.5], rtol=1e-13)
    np.testing.assert_allclose(found.e[-6:].value, [0, 0.1, 0.2] * 2, atol=1e-13)


def test_members_of_a_grid_are_named_by_their_values_also_if_some_are_close_or_the_same():
    grid = ensemble.grid(giants(), primary="Sun", a=[2.0, 2.5] * u.au, e=[0.1, 0.1 + 1e-9])
    assert grid.names[0] == "a=2 AU e=0.1"
    assert grid.names[3] == "a=2.5 AU e=0.100000001"
    assert ensemble.grid(giants(), primary="Sun", a=3.0 * u.au, e=[0.1, 0.1]).names == ["e=0.1 (0)", "e=0.1 (1)"]
    assert ensemble.grid(giants, mass=[1e-5], kind=["a", "b"]).names == ["mass=1e-05 kind=a", "mass=1e-05 kind=b"]


def test_a_map_of_a_grid_has_its_shape_and_units(tmp_path):
    axes = {"a": np.linspace(2.2, 3.2, 4) * u.au, "e": np.linspace(0.0, 0.2, 5)}
    grid = ensemble.grid(giants(), primary="Sun", **axes)
    campaign = ensemble.run(grid, tmp_path / "c", duration=10 * u.yr, dt="30 d", integrator="wisdom-holman",
                            progress=False)  # fmt: skip
    assert campaign.map("e_max").shape == (4, 5)
    assert campaign.map("a_min").unit == u.au
    np.testing.assert_array_equal(campaign.axes["a"], axes["a"])
    np.testing.assert_array_equal(campaign.map("a")[:, 0], axes["a"])
    assert (np.diff(campaign.map("e_max"), axis=1) > 0.0).all()
    with pytest.raises(InputError, match="no column 'eccentricity'"):
        campaign.map("eccentricity")


def test_particles_come_from_a_catalogue_a_system_or_states():
    planets = orbits.System.solar_system(epoch="2022-08-09", bodies=["Sun", "Jupiter"])
    catalogue = orbits.asteroids(30, classes="belt")
    members = ensemble.particles(planets, catalogue, propagate_to_epoch=True)
    whole = planets.add_particles(catalogue, propagate_to_epoch=True)
    assert members.part(0, 30).system() == whole
    assert ensemble.particles(planets, whole).part(0, 30).system() == whole
    assert ensemble.particles(whole, whole).part(0, 30).system() == whole
    states = {"q": whole.q[2:], "v": whole.v[2:], "names": whole.names[2:]}
    np.testing.assert_array_equal(ensemble.particles(planets, states).q, members.q)


@each(
    ("make", "message"),
    [
        (lambda: ensemble.particles(giants(), giants()), "no members"),
        (lambda: ensemble.particles(giants(), 3), "members is 3; expected a catalogue"),
        (lambda: ensemble.particles(3, {"q": 1, "v": 2}), "bodies is 3; expected an orbits.System"),
        (lambda: ensemble.particles(giants(), {"q": np.ones(3), "v": np.ones(3)}), r"q has shape \(3,\)"),
        (lambda: ensemble.systems([]), "no members"),
        (lambda: ensemble.systems([giants(), 3]), r"members\[1\] is 3"),
        (lambda: ensemble.systems(giants()), "expected a list"),
        (lambda: ensemble.systems([giants()] * 2, names=["a"]), "1 names for 2 systems"),
        (lambda: ensemble.grid(giants(), primary="Sun", a=3.0), "no axes"),
        (lambda: ensemble.grid(giants(), primary="Sun", a=[]), "an axis"),
        (lambda: ensemble.grid(3, a=[1, 2]), "neither a System nor a function"),
        (lambda: ensemble.grid(giants(), a=np.ones(10**5), e=np.ones(10**5)), r"1e\+10 points"),
        (lambda: ensemble.clones(giants(), "Jupiter", covariance=COVARIANCE, count=0), "count must be"),
    ],
)
def test_what_is_no_ensemble_is_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()


@pytest.mark.nightly
def test_blocks_of_few_members_and_of_many_have_a_size_by_their_work():
    def size(count, **options):
        plan = ensemble.Plan(belt(10) if count == 10 else many(count), integrator="wisdom-holman", **options)
        return plan.block_size(plan.grid(giants()), 3)

    def many(count):
        return ensemble.particles(giants(), {"q": np.ones((count, 3)), "v": np.ones((count, 3))})

    assert size(10, duration=1000, dt=10) == 10
    assert size(100_000, duration="1000 yr", dt="10 d") == 816  # 3e7 particle steps
    assert size(100_000, duration="1 yr", dt="10 d") == 6240  # a sixteenth
    assert size(100_000, duration="1 Myr", dt="10 d") == 64
    assert size(100_000, duration="100 yr", dt="10 d", samples=10_000) == 544  # 256 MB
    assert size(1000, duration="100 yr", dt="10 d") == 48  # so that there are sixteen and more
    assert size(1000, duration="100 yr", dt="10 d", block=7) == 7


def test_what_has_no_parts_or_uneven_ones_is_refused_in_words():
    planets = orbits.System.from_elements({"Sun": {"mass": 1 * u.M_sun}, "b": {"a": 1 * u.au, "mass": 1 * u.M_jup}})
    for scalar in (-1 * u.yr, Time("2020-01-01")):
        with pytest.raises(InputError, match=r"expected a list of orbits\.System"):
            orbits.ensemble.systems(scalar)
        with pytest.raises(InputError, match=r"a list of systems of equal shape, got"):
            orbits.propagate(scalar, duration=1)
    with pytest.raises(InputError, match=r"a is \[\[1, 2\], \[3\]\]; expected one value, or those of an axis"):
        orbits.ensemble.grid(planets, primary="Sun", a=[[1, 2], [3]])
    with pytest.raises(InputError, match="pole"):
        planets.with_terms(orbits.terms.ZonalHarmonics("Sun", J2=1e-3, radius=1 * u.km, pole=([1, 2], [3, 4])))


def test_members_keep_the_forces_that_name_them():
    """By its own number for each: a campaign in which Yarkovsky's force was left out told of another orbit."""
    light = orbits.terms.RadiationPressure(beta=(0.1, 0.2), bodies=["p0", "p2"])
    heat = orbits.terms.NonGravitational.yarkovsky(1e-12 * u.au / u.day**2, bodies=["p1"])
    whole = system(3).with_forces(light, heat)
    for members in (ensemble.particles(giants(), whole), ensemble.particles(whole, whole)):
        (force,) = members.part(2, 3).system().forces
        assert (force.bodies, force.beta) == (("p2",), (0.2,))
        assert members.identity() != belt(3).identity()
    clones = ensemble.clones(whole, "p2", covariance=COVARIANCE, count=2)
    assert {f.bodies: f.beta for f in clones.part(1, 3).system().forces if f.bodies != ("p1",)} == {
        ("p0",): (0.1,), ("p2 clone 0", "p2 clone 1"): 0.2}  # fmt: skip


def test_what_acts_on_all_in_the_system_of_the_members_acts_on_none_of_the_bodies():
    relativity, drag = orbits.terms.PostNewtonian(), orbits.terms.Drag(rate=1e-3 / u.yr)
    found = ensemble.particles(giants(), system(3).with_terms(relativity).with_forces(drag))
    assert (found.bodies.terms, found.bodies.forces, found.forces) == ((), (), ())
    moved = ensemble.particles(system(3), system(3).remove("p1", "p2").replaced(radii=[1e-3, 0, 0, 0]))
    assert (list(moved.names), moved.bodies.names[-2:]) == (["p0"], ("p1", "p2"))


def test_a_system_whose_members_do_not_fit_among_the_bodies_is_refused():
    """Numbers in other units and from another origin were taken as they were: 2.5 au became 2.5 km."""
    metres = orbits.UnitSystem("metres", u.m, u.s, u.kg)
    other = orbits.System(giants().names, giants().gm, giants().q, giants().v, epoch=giants().epoch, units=metres)
    with pytest.raises(InputError, match="the systems are in metres and SOLAR"):
        ensemble.particles(other, system(3))
    with pytest.raises(InputError, match="both systems have 'Sun', 1 AU apart"):
        ensemble.particles(giants().replaced(q=giants().values.q + np.array([1.0, 0.0, 0.0])), system(3))
    with pytest.raises(EpochError):
        ensemble.particles(giants().replaced(epoch="2023-08-09"), system(3))


def test_names_of_members_may_be_an_array():
    states = {"q": np.ones((2, 3)), "v": np.zeros((2, 3)), "names": np.array(["one", "two"])}
    assert list(ensemble.particles(giants(), states).names) == ["one", "two"]
    with pytest.raises(InputError, match="q is"):
        ensemble.particles(giants(), {"q": [[1, 2], [2, 3, 4]], "v": np.zeros((2, 3))})


def test_the_bodies_of_a_campaign_are_those_with_mass_wherever_they_stand(tmp_path):
    planets = giants()
    values, order = planets.add("dust", primary="Sun", a=2.0).values, [0, 3, 1, 2]
    mixed = orbits.System(["Sun", "dust", "Jupiter", "Saturn"], *(x[order] for x in values[:3]), epoch=planets.epoch)
    found = ensemble.run(ensemble.grid(mixed, primary="Sun", a=[3.0, 3.1] * u.au), tmp_path / "c",
                         duration="100 d", dt="10 d", integrator="wisdom-holman", progress=False)  # fmt: skip
    assert found.summary.meta["bodies"] == ["Sun", "Jupiter", "Saturn"]


def test_bodies_of_systems_have_their_columns_by_name_and_one_unit(tmp_path):
    """Saturn alone stood in the column of Jupiter, and 1.4e9 km became 1.4e9 au."""
    pl = giants()
    kilometres = orbits.UnitSystem("kilometres", u.km, u.s, u.kg)
    third = orbits.System(pl.names, pl.gm, pl.q, pl.v, epoch=pl.epoch, units=kilometres)
    with pytest.warns(OrbitsWarning, match="the system is in km and s; expected AU and d, the units of the first"):
        found = ensemble.run(ensemble.systems([pl, pl.remove("Jupiter"), third]), tmp_path / "c",
                             duration="100 d", dt="10 d", progress=False).summary  # fmt: skip
    assert found["state"].tolist() == ["survived", "survived", "failed"]
    np.testing.assert_allclose(found["a_max"][:2, 2].value, 9.57, rtol=0.01)  # perturbed by Jupiter, or not
    assert np.isnan(found["a_max"][1, :2]).all()


def test_members_with_masses_among_the_same_bodies_are_refused():
    """The runs were without them, in silence."""
    with pytest.raises(InputError, match=r"'a=3 AU' has a mass, but these members are massless"):
        ensemble.grid(giants(), primary="Sun", a=[3.0, 3.1] * u.au, mass=1e-6 * u.M_sun)


def test_parameters_of_a_grid_that_are_columns_of_the_table_are_refused():
    with pytest.raises(InputError, match="'state' is a column of the table"):
        ensemble.grid(giants, state=[1, 2])


def test_campaigns_that_differ_in_the_last_digit_are_told_apart():
    """Quantities show eight digits, and long arrays their ends; a function of a grid reads what is around it."""

    def pushed(A2):
        return ensemble.particles(giants(), system(3).with_forces(orbits.terms.NonGravitational(A2=A2, bodies=["p0"])))

    def grid(a):
        return ensemble.grid(lambda e: giants().add("x", primary="Sun", a=a, e=e), e=[0.0, 0.1])

    def plan(members, t):
        samples, event = np.arange(0.0, 10.0) * t, orbits.events.Event(lambda t, q, v: t - end, name="end")
        return ensemble.Plan(members, duration="20 yr", dt=10, samples=samples, events=event)

    tiny, end = 1e-12 * u.au / u.day**2, 1.0
    assert pushed(tiny).identity() != pushed(tiny * (1.0 + 1e-11)).identity()
    table = {k: np.array([*np.ones(1000), k, *np.ones(1000)]) for k in (1.0, 2.0)}
    named = [ensemble.grid(lambda e, t=table[k]: giants(), e=[0.0]).identity()["function"] for k in table]
    assert named[0] != named[1]
    assert grid(3.0).identity() == grid(3.0).identity() != grid(3.0 + 1e-12).identity()
    first, other = (plan(belt(3), t).identity() for t in (u.yr, u.day))
    assert first != other
    end = 2.0
    assert plan(belt(3), u.yr).identity() != first


def test_a_campaign_is_told_by_no_address_of_the_errors_of_its_function():
    """A message may have one, and another one in each process."""

    def failing():
        def make(e, what=object()):  # noqa: B008
            raise ValueError(f"{what} is not there")

        return ensemble.grid(make, e=[0.0])

    one, other = failing(), failing()
    assert str(*one.systems()) != str(*other.systems())
    assert one.identity() == other.identity()


def test_a_campaign_is_told_by_what_its_options_are_whatever_holds_them():
    """Of nine events the addresses of their functions told, other ones in each process; a list was not its array."""

    def told(**options):
        return ensemble.Plan(belt(3), **{"duration": "20 yr", "dt": 10} | options).identity()

    def events(end):
        return [orbits.events.Event(lambda t, q, v, k=k: t - end - k, name=f"e{k}") for k in range(9)]

    one, same, other = events(1.0), events(1.0), events(2.0)
    assert told(events=one) == told(events=same) != told(events=other)
    times, dates = np.arange(1.0, 12.0), Time(2460000.5 + np.arange(0.0, 2000.0), format="jd", scale="tdb")
    for some in (times[:3], times):
        assert told(samples=some) == told(samples=some.tolist()) != told(samples=some * u.yr)
        assert told(samples=some * u.yr) == told(samples=[x * u.yr for x in some])
    late = dates + np.where(np.arange(2000) == 1000, 1e-3, 0.0) * u.s
    assert told(samples=dates) != told(samples=late)
