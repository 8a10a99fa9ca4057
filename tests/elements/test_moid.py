"""The least distance of two orbits, against a guaranteed search for ellipses, dense grids for others, and JPL."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.elements.moid import Conics, come_within, least_distances
from orbits.errors import InputError

from ..coverings import first
from .guaranteed_search import Ellipses, least_distance
from .pairs_of_orbits import KINDS, any_pairs, ellipses

JPL = {  # of the Small-Body Database: e, q, inc, Omega, omega, epoch (JD), MOID with the Earth
    "Halley": (0.9679359956953211, 0.5748638313743413, 162.1905300439129, 59.09894720612437, 112.2414314637764,
               2439875.5, 0.0745097),
    "Ceres": (0.07957631994408416, 2.545538135581839, 10.58788658206854, 80.24963090816965, 73.29975464616518,
              2461000.5, 1.58055),
    "2024 YR4": (0.6614725333952861, 0.8516805168910683, 3.408160404032607, 271.3638496075921, 134.3660171414643,
                 2461000.5, 0.00280259),
    "Eros": (0.2228359407071628, 1.13319923411471, 10.82846651399785, 304.2701025753316, 178.9297536744151,
             2461000.5, 0.148353),
    "2014 UN271": (0.9982038485060989, 10.93235960555621, 95.45188946326404, 189.9400666797848, 326.3970042529126,
                   2459299.5, 10.0854),
    "C/2022 E3": (1.000301905819192, 1.11224437022534, 109.169480756749, 302.5550197167474, 145.81492879,
                  2459873.5, 0.219806),
}  # fmt: skip


def conics(ellipses: Ellipses) -> Conics:
    a, b = (np.linalg.norm(x, axis=1) for x in (ellipses.along, ellipses.across))
    return Conics(b**2 / a, ellipses.e, ellipses.along / a[:, None], ellipses.across / b[:, None])


def turned(e: Any, rng: np.random.Generator) -> Conics:
    """Orbits with these eccentricities, turned at random."""
    n, turn = len(e), 2.0 * np.pi
    angles = np.arccos(rng.uniform(-1.0, 1.0, n)), rng.uniform(0.0, turn, n), rng.uniform(0.0, turn, n)
    return Conics.of(np.exp(rng.uniform(-1.0, 1.0, n)), e, *angles)


def searched(one: Conics, other: Conics, power: float = 0.0) -> float:
    """The least |Q - q| / |q|^power of two orbits by minima of a grid in polar angles, each refined by finer grids."""

    def places(orbit: Conics, f: Any) -> Any:
        r = orbit.p[0] / (1.0 + orbit.e[0] * np.cos(f))
        where = np.cos(f)[..., None] * orbit.along[0] + np.sin(f)[..., None] * orbit.across[0]
        return np.where(r[..., None] > 0.0, r[..., None] * where, np.inf)

    def function(f: Any, F: Any) -> Any:
        q, Q = places(one, f), places(other, F)
        apart = np.linalg.norm(Q - q, axis=-1) / np.linalg.norm(q, axis=-1) ** power
        return np.where(np.isfinite(apart), apart, np.inf)

    grids = [np.linspace(-1.0, 1.0, 201) * np.arccos(-1.0 / max(x.e[0], 1.0)) * 0.9999 for x in (one, other)]
    with np.errstate(invalid="ignore"):
        first = function(grids[0][:, None], grids[1][None, :])
        edged = np.pad(first, 1, constant_values=np.inf)
        lowest = np.ones_like(first, dtype=bool)
        for i, j in ((0, 1), (2, 1), (1, 0), (1, 2), (0, 0), (2, 2), (0, 2), (2, 0)):
            lowest &= first <= edged[i : i + 201, j : j + 201]
        rows = np.argwhere(lowest)[np.argsort(first[lowest])[:8]]
        f, F = grids[0][rows[:, 0]], grids[1][rows[:, 1]]
        step, width = np.linspace(-1.0, 1.0, 7), 0.05
        for _ in range(60):
            values = function((f[:, None] + width * np.repeat(step, 7)), (F[:, None] + width * np.tile(step, 7)))
            best = values.argmin(axis=1)
            f, F = f + width * np.repeat(step, 7)[best], F + width * np.tile(step, 7)[best]
            width *= 0.6
    return float(values.min())


@pytest.mark.parametrize("n", first(1, [50, 150]))
@pytest.mark.parametrize("kind", KINDS)
def test_ellipses_have_the_least_distance_of_a_search_that_cannot_miss_it(kind: str, n: int) -> None:
    one, other = any_pairs(kind, 10 if kind == "nearly the same" else n)
    known = least_distance(one, other)[0]
    found, f, F = least_distances(conics(one), conics(other))
    size = np.maximum(np.linalg.norm(one.along, axis=1), np.linalg.norm(other.along, axis=1))
    # At most 1.2e-15 farther apart; those of the search are up to 7e-15 too large.
    assert ((found - known) / size).max() < 2e-15
    assert ((known - found) / size).max() < 1e-14
    places = [x.at(g[:, None])[0][:, 0] for x, g in ((conics(one), f), (conics(other), F))]
    np.testing.assert_allclose(found, np.linalg.norm(places[1] - places[0], axis=1), rtol=3e-16)


@pytest.mark.parametrize("n", first(1, [8, 30]))
@pytest.mark.parametrize("kind", ["hyperbolas", "parabolas", "nearly parabolas"])
def test_open_orbits_have_the_least_distance_of_a_dense_search(kind: str, n: int) -> None:
    rng = np.random.default_rng(len(kind))
    near = 1.0 + rng.choice([-1.0, 1.0], n) * 10.0 ** rng.uniform(-13, -2, n)
    e = {"hyperbolas": rng.uniform(1.0, 4.0, n), "parabolas": np.ones(n), "nearly parabolas": near}[kind]
    one, other = turned(e, rng), turned(rng.uniform(0.0, 1.5, n), rng)
    found = least_distances(one, other)[0]
    dense = [searched(one.some(slice(k, k + 1)), other.some(slice(k, k + 1))) for k in range(n)]
    assert np.abs(found - dense).max() < 4e-15  # distances up to 5


def test_known_distances() -> None:
    one = Conics.of(*np.array([[1.0, 1.0, 1.0, 1.0], [0.0, 0.0, 1.0, 2.0], *np.zeros((3, 4))]))
    tilted = [0.0, np.pi / 2, 0.0, 0.0]
    other = Conics.of(*np.array([[1.5, 1.0, 1.0, 3.0], [0.0, 0.0, 1.0, 2.0], tilted, np.zeros(4), np.zeros(4)]))
    # Concentric circles; circles that cross; the same parabola; hyperbolas of one shape, whose pericentres are nearest.
    assert least_distances(one, other)[0] == pytest.approx([0.5, 0.0, 0.0, 2.0], abs=1e-15)
    none = Conics.of(*np.empty((5, 0)))
    assert [len(x) for x in least_distances(none, none)] == [0, 0, 0]
    assert len(come_within(none, none, np.empty(0))) == 0


@pytest.mark.parametrize("kind", ["any", "like planets"])
def test_whether_they_come_within_a_share_of_the_distance_is_decided_to_the_last_digits(kind: str) -> None:
    one, other = (conics(x) for x in any_pairs(kind, 15))
    share = np.array([searched(one.some(slice(k, k + 1)), other.some(slice(k, k + 1)), 1.0) for k in range(15)])
    assert come_within(one, other, share * (1.0 + 1e-9)).all()
    assert not come_within(one, other, share * (1.0 - 1e-9)).any()  # the square of the share has 16 digits, so 1e-15


def test_ellipses_apart_by_their_apsides_need_no_search(monkeypatch: pytest.MonkeyPatch) -> None:
    one, other = conics(ellipses([1.0, 1.0], 0.1)), conics(ellipses([1.5, 0.7], 0.1, 0.5))
    monkeypatch.setattr("orbits.elements.moid._of_some", None)
    assert not come_within(one, other, np.array([0.2, 0.1])).any()
    with pytest.raises(TypeError):
        come_within(one, other, np.array([0.24, 0.1]))  # (1.5 0.9 - 1.1) / 1.1 is 0.227


@pytest.mark.parametrize("name", JPL)
def test_moid_with_the_earth_is_that_of_jpl(name: str) -> None:
    from astropy.time import Time

    e, q, inc, Omega, omega, epoch, known = JPL[name]
    system = orbits.System.solar_system(Time(epoch, format="jd", scale="tdb"), bodies=["Sun", "Earth", "Moon"])
    angles = {"inc": inc * u.deg, "Omega": Omega * u.deg, "omega": omega * u.deg}
    system = system.add(name, primary="Sun", frame="ecliptic", e=e, a=q / (1.0 - e) * u.au, M=0.0, **angles)
    elements = system.elements(primary="Sun")
    found = orbits.moid(elements[name], elements["Earth"]).to_value(u.au)
    # The Earth's orbit is osculating here, which the Moon moves: by 3.6e-6 au at most, and half a last digit.
    assert found == pytest.approx(known, abs=4e-6 + 0.5 * 10.0 ** (np.floor(np.log10(known)) - 5))
    several = orbits.moid(elements, elements["Earth"])
    assert several.shape == (3,)
    assert several[elements.names.index(name)].to_value(u.au) == pytest.approx(found, abs=1e-15)


def test_of_a_run_retired_particles_have_no_moid_and_other_samples_are_refused() -> None:
    """`numpy.linalg.LinAlgError: Array must not contain infs or NaNs`"""
    system = orbits.System.solar_system("2025-01-01", bodies=["Sun", "Earth", "Moon"]).add("p", primary="Sun", a=2.0)
    q, v = (np.repeat(x[None], 3, axis=0) for x in (system.values.q, system.values.v))
    run = orbits.Trajectory(system, np.arange(3.0), q, v, step=1.0, integrator=orbits.Gauss(stages=8))
    elements = run.elements(primary="Sun")
    gone = np.zeros((3, 3), dtype=bool)
    gone[2, 2] = True
    found = orbits.moid(elements.blank(gone), system.elements(primary="Sun")["Earth"])
    np.testing.assert_array_equal(np.isnan(found), gone)
    with pytest.raises(InputError, match=r"shapes \(3, 3\) and \(2, 3\); expected the same"):
        orbits.moid(elements, run[:2].elements(primary="Sun"))


def test_samples_of_a_body_are_those_of_the_others_also_where_there_are_as_many_of_them() -> None:
    system = orbits.System.solar_system("2025-01-01", bodies=["Sun", "Mars", "Jupiter", "Saturn"])
    q, v = (np.stack([x, x[[0, 2, 3, 1]], x[[0, 3, 1, 2]]]) for x in (system.values.q, system.values.v))
    run = orbits.Trajectory(system, np.arange(3.0), q, v, step=1.0, integrator=orbits.Gauss(stages=8))
    elements = run.elements(primary="Sun")
    found = orbits.moid(elements, elements["Mars"])
    for k, state in enumerate(run[i] for i in range(3)):
        one = state.elements(primary="Sun")
        np.testing.assert_allclose(found[k], orbits.moid(one, one["Mars"]), rtol=1e-15)  # by the order of the pairs
        np.testing.assert_allclose(orbits.moid(one, elements["Mars"])[k], found[k], rtol=1e-15)


def test_orbits_about_other_primaries_are_refused() -> None:
    system = orbits.System.solar_system("2025-01-01", bodies=["Sun", "Earth", "Moon"])
    about = {primary: system.elements(primary=primary) for primary in ("Sun", "Earth")}
    jacobi = system.elements(primary="jacobi")
    with pytest.raises(InputError, match=r"centres of mass of the bodies before each, which differ; expected"):
        orbits.moid(jacobi["Earth"], jacobi["Moon"])
    with pytest.raises(InputError, match=r"about Sun in the frame .* and about Earth"):
        orbits.moid(about["Sun"]["Moon"], about["Earth"]["Moon"])
    with pytest.raises(InputError, match="is no orbit; expected elements"):
        orbits.moid(system, about["Sun"]["Earth"])  # type: ignore[arg-type]
    bare = orbits.System.from_elements({"Sun": {"gm": 1}, "p": {"a": 1}}, units=orbits.DIMENSIONLESS)
    with pytest.raises(InputError, match="one orbit has units, the other none"):
        orbits.moid(bare.elements()["p"], system.elements(primary="Sun", frame="system")["Earth"])
