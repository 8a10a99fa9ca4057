"""Minor bodies: massive bodies that do not attract each other."""

import numpy as np
import pytest

import orbits
from orbits.errors import InputError, UnknownNameError
from orbits.kernels import binding
from orbits.kernels.compile import kernel
from orbits.lagrangians.newtonian import n_body
from orbits.lagrangians.terms.minor_bodies import minor_bodies

from ..coverings import first

GM = np.array([1.0, 2e-5, 1e-5, 3e-5, 5e-6, 7e-6, 1e-5, 2e-5, 4e-5, 1e-5, 6e-6])
MINOR = {1, 4, 5, 7, 8, 9}
METHODS = {
    "gauss": {"integrator": orbits.Gauss(stages=4), "dt": 1 / 16},
    "stormer-verlet": {"integrator": orbits.StormerVerlet(), "dt": 0.01},
    "no dt": {},
}


def state(seed=3):
    """A star and ten bodies around it, heavy ones among minor ones."""
    rng = np.random.default_rng(seed)
    angle, r = rng.uniform(0, 2 * np.pi, len(GM)), np.linspace(0.6, 2.0, len(GM))
    q = np.stack([r * np.cos(angle), r * np.sin(angle), 0.1 * rng.normal(size=len(GM))], axis=1)
    v = np.stack([-np.sin(angle), np.cos(angle), 0.05 * rng.normal(size=len(GM))], axis=1) / np.sqrt(r)[:, None]
    q[0] = v[0] = 0.0
    return q, v


def system(minor=MINOR):
    q, v = state()
    names = [f"body {i}" for i in range(len(GM))]
    made = orbits.System(names, GM, q, v, units=orbits.DIMENSIONLESS).barycentric()
    return made.with_terms(orbits.terms.MinorBodies(bodies=[names[i] for i in sorted(minor)])) if minor else made


def accelerations(q, minor):
    """By the definition: the sum over all pairs but those of two minor bodies."""
    out = np.zeros_like(q)
    for i in range(len(GM)):
        for j in range(len(GM)):
            if i != j and not (i in minor and j in minor):
                d = q[j] - q[i]
                out[i] += GM[j] * d / np.linalg.norm(d) ** 3
    return out


@kernel
def accelerate(tag, parameters, q, out):
    binding.accelerate(tag, parameters, q, out)


@kernel
def accelerate_some(tag, parameters, q, out, start, stop):
    binding.accelerate_some(tag, parameters, q, out, start, stop)


def test_a_pair_of_minor_bodies_does_not_attract_and_all_others_do():
    L = n_body(GM, 0.0, [minor_bodies(MINOR, len(GM))])
    q, v = state()
    found = L.gradients(q, v)[0].reshape(-1, 3) / GM[:, None]
    # Sums of ten numbers of the size of the largest, the star's attraction: some units in its last place.
    assert np.abs(found - accelerations(q, MINOR)).max() < 1e-15 * np.abs(found).max()
    assert np.abs(found - accelerations(q, set())).max() > 1e-6


@pytest.mark.nightly
def test_shares_of_the_accelerations_have_the_bits_of_the_whole():
    L = n_body(GM, 0.0, [minor_bodies(MINOR, len(GM))])
    q = np.zeros(3 * len(GM) + 8)
    q[: 3 * len(GM)] = state()[0].T.ravel()
    whole, parts = np.zeros_like(q), np.zeros_like(q)
    accelerate(L.tag, L.parameter_vector, q, whole)
    for start, stop in ((0, 8), (8, len(GM))):
        accelerate_some(L.tag, L.parameter_vector, q, parts, start, stop)
    assert np.array_equal(whole[: 3 * len(GM)], parts[: 3 * len(GM)])


@pytest.mark.parametrize("options", first(1, METHODS.values()), ids=METHODS)
def test_all_that_is_conserved_is_conserved(options):
    run = orbits.propagate(system(), duration=20.0, samples=41, progress=False, check_step=False, **options)
    drift = run.drift()
    # Round-off of some 1,000 steps: 1e-16 to 4e-15. The energy of Störmer–Verlet oscillates with h^2.
    assert drift.linear_momentum.max_fraction < 2e-14
    assert drift.angular_momentum.max_fraction < 2e-14
    assert drift.energy.max_fraction < (1e-4 if "stormer" in run.integrator.label.lower() else 1e-11)


def test_the_energy_is_that_of_the_pairs_that_attract():
    made, plain = system(), system(minor=())
    q, _ = made.q.value, made.v.value
    left_out = sum(
        GM[i] * GM[j] / np.linalg.norm(q[i] - q[j]) for i in MINOR for j in MINOR if i < j
    )
    energies = [
        orbits.propagate(x, orbits.Gauss(), dt=0.05, duration=0.1, samples=2, progress=False).energy()[0].value
        for x in (made, plain)
    ]
    assert energies[0] - energies[1] == pytest.approx(left_out, rel=1e-9)


def test_minor_bodies_move_as_rebounds_test_particles_of_type_1():
    made = system()
    sim = orbits.rebound.to_rebound(made)
    assert (sim.N_active, sim.testparticle_type) == (len(GM) - len(MINOR), 1)
    sim.integrator = "ias15"
    sim.integrate(10.0)
    run = orbits.propagate(made, orbits.Gauss(stages=8), dt=0.05, duration=10.0, samples=2, progress=False)
    for particle in sim.particles:
        there = run[particle.name].q[-1].value
        # Both are at round-off, which grows with the time: 2e-14 was seen.
        assert np.abs(there - [particle.x, particle.y, particle.z]).max() < 1e-12
    settings = {"dt": 0.05, "duration": 10.0, "samples": 2, "progress": False}
    other = orbits.propagate(system(minor=()), orbits.Gauss(stages=8), **settings)
    assert np.abs(other.q[-1].value - run.q[-1].value).max() > 1e-6


@pytest.mark.nightly
def test_massless_particles_feel_minor_bodies_too():
    made = system().add("probe", q=[1.3, 0.2, 0.05], v=[0.1, 0.8, 0.0])
    lone = system(minor=()).add("probe", q=[1.3, 0.2, 0.05], v=[0.1, 0.8, 0.0])
    short = {"dt": 1e-3, "duration": 2e-3, "samples": 2, "progress": False}
    runs = [orbits.propagate(x, orbits.Gauss(stages=4), **short)["probe"] for x in (made, lone)]
    # Over two short steps the places of the bodies differ by 1e-9: its acceleration is by the same bodies.
    assert np.abs(runs[0].v[-1] - runs[1].v[-1]).max().value < 1e-10
    with pytest.raises(InputError, match="minor bodies and massless ones, probe; in REBOUND"):
        orbits.rebound.to_rebound(made)


def test_a_run_is_resumed_to_the_same_bits(tmp_path):
    options = {"integrator": orbits.Gauss(stages=4), "dt": 0.05, "progress": False}
    whole = orbits.propagate(system(), duration=4.0, samples=5, **options)
    path = tmp_path / "run.h5"
    orbits.propagate(system(), duration=2.0, samples=3, archive=path, **options)
    resumed = orbits.resume(path, until=4.0, progress=False)
    assert resumed.system.terms == system().terms
    assert np.array_equal(resumed.q[-1].value, whole.q[-1].value)


@pytest.mark.nightly
def test_the_certificate_passes():
    few = system().remove(*[f"body {i}" for i in (2, 3, 6, 7, 8, 9, 10)])
    assert few.terms[0].bodies == ("body 1", "body 4", "body 5")
    assert orbits.certify(few, orbits.Gauss(stages=2), dt=0.05).ok


def test_bodies_that_go_are_minor_no_more():
    made = system()
    assert made.remove("body 1").terms[0].bodies == made.terms[0].bodies[1:]
    assert made.remove(*made.terms[0].bodies).terms == ()


def test_what_cannot_be_is_refused():
    plain = system(minor=())
    with pytest.raises(InputError, match="'body 1' twice"):
        orbits.terms.MinorBodies(bodies=["body 1", "body 1"])
    with pytest.raises(InputError, match="expected names of massive bodies in a list"):
        orbits.terms.MinorBodies()
    with pytest.raises(InputError, match=r"belongs to several bodies, but body is \['body 1', 'body 2'\]; expected"):
        orbits.terms.MinorBodies(["body 1", "body 2"])
    with pytest.raises(UnknownNameError, match="body 12"):
        plain.with_terms(orbits.terms.MinorBodies(bodies=["body 12"]))
    light = plain.add("probe", q=[3, 0, 0], v=[0, 0.5, 0])
    with pytest.raises(InputError, match="gm of 'probe' is 0"):
        light.with_terms(orbits.terms.MinorBodies(bodies=["probe"]))
    with pytest.raises(InputError, match="minor"):
        orbits.propagate(system(), orbits.WisdomHolman(), dt=0.01, duration=1.0)
