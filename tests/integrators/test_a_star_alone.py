"""Massless particles about a star without planets: exact Kepler motion by the maps, and the terms of the star."""

import warnings

import numpy as np
import pytest

import orbits
from orbits.elements import state_from_elements, two_body
from orbits.errors import RetiredWarning, StepWarning
from orbits.methods import SABA
from orbits.terms import FrameDragging, PostNewtonian, ZonalHarmonics

from ..coverings import at, cover, first
from .strong_terms import DEFAULT, GAUSS, POLE, STRONG, marched

EPS = 2.0**-53
ORBITS = [(1.0, 0.0), (1.3, 0.3), (5.2, 0.9), (0.4, 0.2), (30.0, 0.05), (-2.0, 1.5), (3.0, 0.5), (1.5, 0.93)]


def particles(orbits_=ORBITS):
    """A star that moves, and massless particles of these (a, e)."""
    rng, gm, q, v = np.random.default_rng(4), [1.0], [np.array([0.1, 0.2, -0.3])], [np.array([0.01, -0.02, 0.03])]
    for a, e in orbits_:
        angles = dict(zip(("inc", "Omega", "omega", "M"), rng.uniform([0, 0, 0, 0.5], [1, 6, 6, 3]), strict=True))
        x, w = state_from_elements(1.0, a=a, e=e, **angles)
        gm.append(0.0)
        q.append(q[0] + x)
        v.append(v[0] + w)
    return np.array(gm), np.array(q), np.array(v)


def system():
    return orbits.System(["star", *(f"p{k}" for k in range(len(ORBITS)))], *particles(), units=orbits.DIMENSIONLESS)


@cover(
    ("method", "dt"),
    [DEFAULT, orbits.WisdomHolman(encounters="follow"), orbits.WisdomHolman(encounters="retire"), SABA(8, 6, 4)],
    [1.0, -0.125],
    strength=1,
)
def test_particles_about_a_star_alone_move_as_the_two_body_flow_moves_them_whatever_the_step(method, dt):
    """To what rounding errors leave of the way, 1e3 of them at pericentres, and without a word: nothing is disturbed
    there, so that none is warned of, retired, or followed by steps that would not be exact.
    """
    start, time = system(), np.copysign(64.0, dt)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = orbits.propagate(start, method, dt=abs(dt), duration=time, samples=3, progress=False)
    _, q, v = particles()
    assert np.abs(run.q[-1, 0] - (q[0] + time * v[0])).max() < 16 * EPS
    for k, (a, e) in enumerate(ORBITS, 1):
        x, w = two_body(q[k] - q[0], v[k] - v[0], 1.0, time)
        off = np.abs(run.q[-1, k] - run.q[-1, 0] - x).max()
        fastest = np.sqrt((1.0 + e) / abs(a * (1.0 - e)))
        assert off < 1e4 * EPS * max(fastest, abs(a)), (a, e)
        assert np.abs(run.v[-1, k] - run.v[-1, 0] - w).max() < 1e5 * EPS * fastest, (a, e)
    assert not len(run.retired)


@pytest.mark.nightly
def test_particles_feel_the_terms_of_a_star_alone():
    """Relativity, oblateness and frame dragging, as by Gauss: the error falls as h^2, times the square of the terms."""
    start, terms = particles([*ORBITS[:2], (0.7, 0.1)]), STRONG["all"](0)
    truth = marched(GAUSS, terms, start, 0.001, 12000)[0]
    one, other = (np.abs(marched(DEFAULT, terms, start, h, round(12.0 / h))[0] - truth)[1:] for h in (0.04, 0.02))
    assert one.max() < 1.2e-8  # 9.1e-9 was reached
    assert one.max(axis=1) / other.max(axis=1) == pytest.approx(4.0, rel=0.01)


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore::orbits.errors.OrbitsWarning")
def test_a_pericentre_that_the_step_does_not_resolve_is_said_with_terms():
    start = system().with_terms(
        ZonalHarmonics("star", J2=2e-3, radius=0.05, pole=POLE),
        PostNewtonian(sources=["star"], c=100.0),
        FrameDragging("star", spin=5e-2, pole=POLE, c=100.0),
    )
    options = {"dt": 0.25, "duration": 20.0, "samples": 2, "progress": False}
    with pytest.warns(StepWarning, match=r"(?s)too long for 2 massless particles.*p7 passes star.*p3 passes"):
        run = orbits.propagate(start, DEFAULT, **options)
    assert any("p3" in str(passage) for passage in run.unresolved())


@pytest.mark.parametrize("coordinates", first(1, ["jacobi", "democratic-heliocentric"]))
@pytest.mark.parametrize("planet", at((1,), [0.0, 1e-4]))
def test_a_particle_that_falls_is_where_it_is_on_its_way_and_hits_the_surface(coordinates, planet):
    """Samples while it takes steps of its own, and the impact: t = 4.276519514 by Kepler's equation for r = 0.05."""
    method = orbits.WisdomHolman(coordinates=coordinates, encounters="follow particles")
    q, v = zip(
        (np.zeros(3), np.zeros(3)),
        state_from_elements(1.0, a=20.0, e=0.01, inc=0.0, Omega=0.0, omega=0.0, M=1.0),
        state_from_elements(1.0, a=1.0, e=0.99, inc=0.1, Omega=0.0, omega=0.0, M=2.0),
        strict=True,
    )
    start = orbits.System(["star", "planet", "grain"], [1.0, planet, 0.0], q, v, units=orbits.DIMENSIONLESS)
    options = {"duration": 6.0, "samples": 61, "progress": False}
    run = orbits.propagate(start, method, dt=0.02, **options)
    truth = orbits.propagate(start, **options)
    assert np.abs((run.q - truth.q).value).max() < 3e-7  # 1.8e-7 was reached in democratic heliocentric coordinates
    with_surface = start.replaced(radii=[0.05, 0.0, 0.0])
    with pytest.warns(RetiredWarning, match="it hit star"):
        run = orbits.propagate(with_surface, method, dt=0.02, **options)
    assert abs(float(run.retired["grain"].time) - 4.276519514) < 1e-6
