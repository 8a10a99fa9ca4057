"""`propagate` with terms that depend on velocities or on time, and with forces without a Lagrangian."""

import json
import pickle
from dataclasses import dataclass, replace
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from typer.testing import CliRunner

import orbits
from orbits.cli import app
from orbits.errors import ArchiveError, ConvergenceError, InputError, RetiredWarning
from orbits.events import CloserThan
from orbits.integrators.collocation.rows import HB
from orbits.methods import Composition, LobattoIIIAB, RungeKutta4
from orbits.propagation.resuming.sample_store import accounts_in
from orbits.system.model import lagrangian_of
from orbits.terms import Drag
from tests import kepler_truth
from tests.acting import Heavy, Swaying
from tests.problems import kepler
from tests.propagation.bodies import DRAG, FLAT, PARTICLE, POLE, SPIN, planet, three

from ..coverings import at, first

EPS = 2.0**-53
OWN_DRAG = Drag(rate=1e-3, bodies=["inner", "p"])
METHODS = [orbits.Gauss(stages=4), LobattoIIIAB(stages=3), Composition(orbits.Gauss(stages=1), order=4)]


def dragged(system=None):
    """Bodies and a particle with a spin, a flattening and two forces of drag, one on some of them: the same in most
    tests, so that little is compiled.
    """
    return (system or three(**PARTICLE)).with_terms(SPIN, FLAT).with_forces(DRAG, OWN_DRAG)


def satellite(excess, gm=0.0):
    """What `equations` tells of: a particle, or a body of vanishing mass, about a planet at rest, which no drag slows.

    excess : with which masses grow with velocities, if not 0
    """
    terms = (SPIN, FLAT, Heavy(excess=excess)) if excess else (SPIN, FLAT)
    drags = (replace(drag, bodies=["p"]) for drag in (DRAG, OWN_DRAG))
    return planet(p=(gm, *PARTICLE["p"][1:])).with_terms(*terms).with_forces(*drags)


def march(system, integrator, dt=1 / 64, duration=10.0, **options):
    return orbits.propagate(system, integrator, dt=dt, duration=duration, progress=False, check_step=False, **options)


def equations(excess, y):
    """Euler–Lagrange equations of a massless particle about a planet at rest, all terms and drag together."""
    q, v = mpmath.matrix(y[:3]), mpmath.matrix(y[3:])
    r2 = (q.T * q)[0]
    r = mpmath.sqrt(r2)
    size = -2 * mpmath.mpf(0.1) / 9
    pole = mpmath.matrix(POLE)
    k, J2, height = size * pole, mpmath.mpf(FLAT.J2) * mpmath.mpf(FLAT.radius) ** 2, (q.T * pole)[0]
    bent = cross(v, k)
    force = -q / r**3 + (bent - 3 * (q.T * bent)[0] / r2 * q) / r**3
    force -= J2 / r**5 * (3 * height * pole + (1.5 - 7.5 * height**2 / r2) * q)
    # d/dt dL/dv = M a + what the velocity does to k x q / r^3
    force -= cross(k, v) / r**3 - 3 * (q.T * v)[0] / r2 * cross(k, q) / r**3
    for drag in (DRAG, OWN_DRAG):
        force -= mpmath.mpf(drag.rate) * (v - mpmath.matrix(drag.velocity))
    heavy = mpmath.mpf(excess)
    mass = mpmath.eye(3) * (1 + heavy * (v.T * v)[0] / 2) + heavy * v * v.T
    return [*v, *mpmath.lu_solve(mass, force)]


def cross(a, b):
    return mpmath.matrix([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@pytest.fixture(scope="module", params=first(1, [0.0, 0.1]), ids=["masses that stay", "masses that grow"])
def truth(request):
    """The excess of masses, and where the particle is at the time 1, by Taylor series of 17 digits."""
    with mpmath.workdps(17):
        start = [mpmath.mpf(x) for x in (*PARTICLE["p"][1], *PARTICLE["p"][2])]
        motion = mpmath.odefun(lambda t, y: equations(request.param, y), 0, start)
        return request.param, np.array([float(x) for x in motion(1)])


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("integrator", "steps"),
    at((2,), [
        (orbits.Gauss(stages=1), (8, 16)),
        (orbits.Gauss(stages=2), (8, 16)),
        (orbits.Gauss(stages=4), (1, 2)),
        (LobattoIIIAB(stages=3), (8, 16)),
        (LobattoIIIAB(stages=4), (2, 4)),
    ]),
    ids=lambda x: getattr(x, "label", None),
)
@pytest.mark.parametrize("gm", first(1, [0.0, 1e-40]), ids=["particle", "body"])
def test_orders_are_kept_with_terms_of_velocity_and_drag(truth, integrator, steps, gm):
    excess, expected = truth
    system, errors = satellite(excess, gm), []
    for count in steps:
        run = march(system, integrator, dt=1 / count, duration=1.0, samples=2)
        errors.append(np.max(np.abs([*run.q.value[-1, 1], *run.v.value[-1, 1]] - expected)))
    slope = np.log2(errors[0] / errors[1])
    assert slope > 0.85 * integrator.order, errors
    assert errors[1] < 1e-3


@pytest.mark.nightly
def test_a_composition_keeps_its_order():
    """Against Gauss with eight stages, which the series above have judged."""
    best, *runs = (
        march(dragged(), method, dt=dt, duration=1.0, samples=2)
        for method, dt in ((orbits.Gauss(stages=8), 1 / 16), (METHODS[-1], 1 / 16), (METHODS[-1], 1 / 32))
    )
    errors = [np.max(np.abs(run.q.value[-1] - best.q.value[-1])) for run in runs]
    assert np.log2(errors[0] / errors[1]) > 3.8, errors


def test_the_floor_of_a_short_step_is_round_off(truth):
    excess, expected = truth
    run = march(satellite(excess), orbits.Gauss(stages=8), dt=1 / 16, duration=1.0, samples=2)
    assert np.max(np.abs(run.q.value[-1, 1] - expected[:3])) < 8 * EPS
    assert np.max(np.abs(run.v.value[-1, 1] - expected[3:])) < 8 * EPS


@pytest.mark.nightly
@pytest.mark.parametrize("particle", [False, True])
def test_a_term_that_depends_on_time_moves_all_by_what_it_is(particle):
    """Relative orbits do not notice an acceleration that is the same everywhere: Kepler's orbit and a closed form."""
    sway, T = Swaying(phase=0.4), 6.0
    gm, q, v = kepler(0.3)
    gm = np.array([1.0, 0.0]) if particle else gm
    system = orbits.System(["a", "b"], gm, q, v, units=orbits.DIMENSIONLESS).with_terms(sway, Heavy(excess=0.0))
    run = march(system, orbits.Gauss(stages=8), dt=1 / 16, duration=T, samples=7)
    with mpmath.workdps(25):
        start = ([mpmath.mpf(float(x)) for x in one[1] - one[0]] for one in (q, v))
        x, w, _ = kepler_truth.flow(*start, mpmath.mpf(1), mpmath.mpf(T))
    last, speed = run.q.value[-1], run.v.value[-1]
    assert np.max(np.abs(last[1] - last[0] - np.array(x, dtype=float))) < 64 * EPS
    assert np.max(np.abs(speed[1] - speed[0] - np.array(w, dtype=float))) < 64 * EPS
    shares = gm / gm.sum()
    for k, t in enumerate(run.times):
        far, fast = sway.displacement(t)
        assert np.max(np.abs(shares @ run.q.value[k] - shares @ (q + t * v) - far)) < 64 * EPS
        assert np.max(np.abs(shares @ run.v.value[k] - shares @ v - fast)) < 64 * EPS
    assert np.isnan(run.drift().energy.max_fraction)
    assert "no energy to keep" in str(run.drift())


@pytest.mark.nightly
def test_time_counts_from_the_epoch_of_the_run_wherever_a_state_of_it_is_taken_up_again():
    system = three(**PARTICLE).with_terms(SPIN, FLAT, Swaying()).with_forces(DRAG)
    run = march(system, orbits.Gauss(stages=8), duration=4.0, samples=5)
    assert np.max(np.abs(run.at(2.7).q.value - march(system, orbits.Gauss(stages=8), duration=2.7).q.value[-1])) < 1e-14
    again = march(run[2], orbits.Gauss(stages=8), duration=2.0, samples=3)
    assert np.max(np.abs(again.q.value - run.q.value[2:])) < 1e-14
    wrong = march(run[2].replaced(terms=system.terms), orbits.Gauss(stages=8), duration=2.0, samples=3)
    assert np.max(np.abs(wrong.q.value - run.q.value[2:])) > 1e-2
    back = march(run[-1], orbits.Gauss(stages=8), duration=-4.0, samples=5)
    assert np.max(np.abs(back.q.value[::-1] - run.q.value)) < 1e-14


@pytest.mark.nightly
def test_bodies_are_marched_by_the_map_of_the_canonical_form():
    system = three().with_terms(SPIN, FLAT)
    for integrator in METHODS[:2]:
        run = march(system, integrator, samples=11)
        q, v = system.values.q.ravel(), system.values.v.ravel()
        path = orbits.march(lagrangian_of(system), integrator, dt=1 / 64, steps=640, every=64, q=q, v=v)
        # Two ways to the same numbers, 640 steps of rounding apart.
        assert np.max(np.abs(run.q.value.reshape(11, -1) - path.q)) < 64 * EPS


@pytest.mark.nightly
@pytest.mark.parametrize("integrator", METHODS[:2], ids=lambda m: m.label)
def test_what_velocity_dependent_terms_conserve_is_kept_to_round_off(integrator):
    drift = march(three().with_terms(SPIN, FLAT), integrator, duration=30.0).drift()
    assert drift.angular_momentum.max_ulps < 16
    assert drift.linear_momentum.max_fraction < 16 * EPS
    assert drift.centre_of_mass.max_fraction < 16 * EPS
    assert drift.energy.max_fraction < (16 * EPS if integrator.order == 8 else 1e-7)


@pytest.mark.parametrize("integrator", first(1, METHODS), ids=lambda m: m.label)
def test_drag_takes_the_angular_momentum_of_the_discrete_torque_to_round_off(integrator):
    run = march(dragged(), integrator, samples=31)
    L, P = run.angular_momentum().value, run.linear_momentum().value
    all_of_it, some = run.work()
    torque, impulse = all_of_it.torque.value + some.torque.value, all_of_it.impulse.value + some.impulse.value
    assert np.linalg.norm(torque[-1]) > 0.02 * np.linalg.norm(L[0])
    size = np.linalg.norm(L[0])
    # Samples lie between steps too, where a part of a step adds to the accounts of the whole ones.
    assert np.max(np.abs((L - L[0] - torque) @ POLE)) < 16 * EPS * size
    assert np.max(np.abs(P - P[0] - impulse)) < 16 * EPS * np.sum(np.abs(run.v.value[0, :, :]), axis=0).max()
    drift = run.drift()
    assert drift.angular_momentum.max_ulps < 16
    # The energy changes by the work up to an error of the order of the method.
    assert drift.energy.max_fraction < (16 * EPS if integrator.order == 8 else 1e-7)
    assert np.isnan(drift.centre_of_mass.max_fraction)
    assert "less what Drag gave" in str(drift)


def test_linear_drag_of_a_single_body_is_the_exponential():
    one = orbits.System(["stone"], [2.0], [[1.0, 0, 0]], [[0.3, -0.2, 0.1]], units=orbits.DIMENSIONLESS)
    # Terms of pairs do nothing to one alone.
    one = one.with_terms(*(replace(term, body="stone") for term in (SPIN, FLAT)))
    one = one.with_forces(Drag(rate=0.5), Drag(rate=0.0))
    run = march(one, orbits.Gauss(stages=8), dt=1 / 8, samples=11)
    v = np.array([0.3, -0.2, 0.1]) * np.exp(-0.5 * run.times)[:, None]
    assert np.max(np.abs(run.v.value[:, 0] - v)) < 4 * EPS
    work = run.work()[0].work.value
    assert np.max(np.abs(work - (v**2 - v[0] ** 2).sum(axis=1))) < 4 * EPS
    assert run.work()[0].work.unit == run.system.units.energy


@pytest.mark.parametrize("integrator", first(1, METHODS[:2]), ids=lambda m: m.label)
def test_a_massless_particle_moves_as_a_body_of_vanishing_mass(integrator):
    runs = []
    for gm in (0.0, 1e-40):
        runs.append(march(dragged(three(p=(gm, *PARTICLE["p"][1:]))), integrator, duration=3.0))
    # Two orders of summation over 192 steps, on orbits that part.
    assert np.max(np.abs(runs[0].q.value - runs[1].q.value)) < 128 * EPS
    assert np.max(np.abs(runs[0].v.value - runs[1].v.value)) < 128 * EPS


def crowd(count=21, rate=1e-2):
    rng = np.random.default_rng(3)
    bodies = {}
    for k in range(count):
        x = rng.normal(size=3)
        x *= rng.uniform(1.5, 3.0) / np.linalg.norm(x)
        bodies[f"p{k}"] = (0.0, x, np.cross(POLE, x) / np.linalg.norm(x) ** 1.5)
    system = three(**bodies).with_terms(SPIN, FLAT)
    return system.with_forces(*(Drag(rate=rate, bodies=[name]) for name in ("p2", "p17")))


def test_particles_get_the_same_bits_with_any_number_of_threads_and_each_its_own_force():
    one, two = (march(crowd(), orbits.Gauss(stages=4), duration=3.0, threads=threads) for threads in (1, 2))
    assert np.array_equal(one.q, two.q)
    assert np.array_equal(one.v, two.v)
    few = march(crowd(18), orbits.Gauss(stages=4), duration=3.0)
    assert np.array_equal(one.q[:, :21], few.q)
    # Massive bodies are as they were, so that only those that drag acts on are elsewhere.
    without = march(crowd(rate=0.0), orbits.Gauss(stages=4), duration=3.0)
    felt = np.abs(one.v.value[-1] - without.v.value[-1]).max(axis=1)[3:]
    assert set(np.flatnonzero(felt)) == {2, 17}


@pytest.mark.parametrize("integrator", first(1, METHODS), ids=lambda m: m.label)
def test_an_interrupted_run_goes_on_to_the_same_bits_work_included(tmp_path, integrator):
    system, path = dragged(), tmp_path / "run.h5"
    whole = march(system, integrator, duration=8.0, samples=9)
    march(system, integrator, duration=4.0, samples=5, archive=path).close()
    part = orbits.Trajectory.open(path)
    assert np.array_equal(part.work()[1].torque, whole.work()[1].torque[:5])
    part.close()
    run = orbits.resume(path, until=8.0, progress=False)
    assert np.array_equal(run.q, whole.q)
    assert np.array_equal(run.v, whole.v)
    assert np.array_equal(run.work()[0].work, whole.work()[0].work)
    assert np.array_equal(run[2:5].work()[0].impulse, whole.work()[0].impulse[2:5])
    assert run.drift() == whole.drift()
    assert np.array_equal(run.at(2.55).q, whole.at(2.55).q)
    with pytest.raises(InputError, match="has only samples, but the work of forces is summed"):
        run.at([1.5, 2.5]).work()
    run.close()


def test_closest_approaches_and_conditions_see_positions_and_velocities():
    system = dragged()
    run = march(system, orbits.Gauss(stages=8), duration=20.0, samples=1281)
    found = next(a for a in run.closest_approaches()["p"] if "planet" in (a.body, a.other))
    before = int(np.argmin(np.linalg.norm(run.q.value[:, 3] - run.q.value[:, 0], axis=1))) - 1
    fine = march(run[before], orbits.Gauss(stages=8), dt=1 / 16384, duration=1 / 32, samples=513)
    distance = np.linalg.norm(fine.q.value[:, 3] - fine.q.value[:, 0], axis=1)
    k = int(np.argmin(distance))
    # Between two of these samples the distance is less by its curvature alone.
    assert found.distance.value == pytest.approx(distance[k], rel=1e-8)
    assert found.time.value == pytest.approx(run.times[before] + fine.times[k], abs=1 / 16384)
    assert found.speed.value == pytest.approx(np.linalg.norm(fine.v.value[k, 3] - fine.v.value[k, 0]), rel=1e-3)
    limit = 1.001 * distance[k]
    stopped = march(system, orbits.Gauss(stages=8), duration=20.0, stop=CloserThan(limit, "p", "planet"))
    apart = np.linalg.norm((stopped.stopped.system["p"].q - stopped.stopped.system["planet"].q).value)
    assert apart == pytest.approx(limit, rel=1e-12)


@pytest.mark.nightly
def test_an_approach_is_found_with_the_time_of_the_run_and_the_force_of_the_particle():
    # Where momenta are not linear in velocities, what sways all alike is felt in relative orbits too.
    sway = march(three(**PARTICLE).with_terms(Swaying(), Heavy()), orbits.Gauss(stages=8), duration=20.0)
    for run, name in ((sway, "p"), (march(crowd(), orbits.Gauss(stages=8), duration=20.0), "p17")):
        (*_, closest) = run.closest_approaches()[name]  # by the planet, which dominates
        there = run.at(closest.time)
        place, speed = there[name].q - there["planet"].q, there[name].v - there["planet"].v
        assert np.linalg.norm(place).value == pytest.approx(closest.distance.value, rel=1e-13)
        assert np.linalg.norm(speed).value == pytest.approx(closest.speed.value, rel=1e-13)


def test_a_particle_that_cannot_be_stepped_is_retired_alone():
    falling = {"falls": (0.0, [0.5, 0.0, 0.0], [0.0, 0.0, 0.0])}
    system = dragged(three(**PARTICLE, **falling))
    with pytest.warns(RetiredWarning):
        run = march(system, orbits.Gauss(stages=4))
    assert run.retired.names == ("falls",)
    without = march(dragged(), orbits.Gauss(stages=4))
    assert np.array_equal(run.q[:, :4], without.q)
    assert "falls" not in run[-1]


@pytest.mark.nightly
def test_a_velocity_that_momenta_do_not_determine_is_an_error_and_not_a_number():
    system = three().with_terms(SPIN, FLAT, Heavy(excess=30.0)).with_forces(DRAG)
    with pytest.raises(ConvergenceError, match="adds as much as m v to the momenta"):
        march(system, orbits.Gauss(stages=2))


@pytest.mark.parametrize(
    ("system", "words"),
    [
        (three().with_terms(SPIN), "by 'newtonian . frame dragging', which is not separable"),
        (three().with_forces(DRAG), "with the force of drag"),
    ],
    ids=["term", "force"],
)
@pytest.mark.parametrize("integrator", [orbits.StormerVerlet(), orbits.Gauss(stages=12), RungeKutta4()])
def test_a_method_that_cannot_take_it_refuses_and_names_those_that_can(system, words, integrator):
    with pytest.raises(InputError, match=r"Gauss or .*LobattoIIIAB"):
        march(system, integrator)


def test_a_copy_of_a_run_knows_what_forces_did_also_where_no_path_leads_to_its_archive(tmp_path):
    run = march(dragged(), METHODS[0], duration=2.0, samples=3, archive=tmp_path / "run.h5")
    known = run.work()[0].torque
    assert np.array_equal(pickle.loads(pickle.dumps(run)).work()[0].torque, known)
    run._place = None
    assert np.array_equal(pickle.loads(pickle.dumps(run)).work()[0].torque, known)
    run.close()


@pytest.mark.nightly
def test_a_certificate_says_what_forces_leave_and_holds():
    certificate = orbits.certify(dragged(), orbits.Gauss(stages=2), 0.05)
    assert certificate.ok, str(certificate)
    assert certificate["balance: rotation about the pole"].holds
    assert "what drag takes is left out but for the balances" in str(certificate)
    assert orbits.certify(three().with_terms(SPIN, FLAT), orbits.Gauss(stages=2), 0.05)["step of bodies"].holds


def test_the_command_line_tells_what_forces_did(tmp_path):
    path = tmp_path / "run.h5"
    march(dragged(), METHODS[0], duration=2.0, samples=3, archive=path).close()
    shown = CliRunner().invoke(app, ["info", str(path)])
    assert shown.exit_code == 0, shown.output
    assert "Drag on all: work -0.0" in shown.output
    record = json.loads(CliRunner().invoke(app, ["info", str(path), "--json"]).output)
    assert [each["force"] for each in record["work"]] == ["drag", "drag"]
    assert record["work"][0]["work"] < record["work"][1]["work"] < 0
    assert record["largest_relative_change"]["centre_of_mass"] is None


def test_an_archive_whose_checkpoint_does_not_tell_what_forces_did_is_not_resumed(tmp_path):
    march(dragged(), METHODS[0], duration=2.0, samples=3, archive=tmp_path / "run.h5").close()
    with orbits.Archive.open(tmp_path / "run.h5") as archive:
        known = archive.checkpoint()
        assert accounts_in(archive, 5, 2).shape == (5, 2, 7)
        for changed in (None, known["accounts"][:, :1], known["accounts"][:1], np.full_like(known["accounts"], np.nan)):
            checkpoint = {**known, "accounts": np.zeros(0) if changed is None else changed}
            archive._checkpoint = checkpoint
            with pytest.raises(ArchiveError, match="does not tell what forces did"):
                accounts_in(archive, 5, 2)


@pytest.mark.parametrize("method", [*(orbits.Gauss(stages=s) for s in range(1, 9)), LobattoIIIAB(stages=5)])
def test_the_weights_of_a_step_sum_to_its_length_exactly_so_that_what_nothing_pulls_moves_uniformly(method):
    for h in (0.25, -3.0, float(np.float32(0.013)), float(np.float32(5.7e9))):
        table = method.form_with(0).coefficients(h, h)[0]
        assert sum(map(Fraction, table[HB].tolist())) == Fraction(h)
        assert np.max(np.abs(table[HB, : len(method.tableau.b)] - h * method.tableau.b)) < 4 * EPS * abs(h)


@pytest.mark.nightly
@pytest.mark.parametrize("bodies", first(1, [["outer", "p"], None]), ids=str)
def test_motion_under_drag_is_the_same_in_the_frame_of_the_barycentre(bodies):
    """The medium is seen from there too. After a time of 20: 2e-14 apart; 0.05 or more with the medium as it was."""
    start = three(**PARTICLE)
    place, speed = np.array([5.0, 0.0, 1.0]), np.array([0.3, 0.1, -0.2])
    drifting = start.replaced(q=start.q.value + place, v=start.v.value + speed)
    drifting = drifting.with_forces(replace(DRAG, bodies=bodies))
    moving = drifting.barycentric()
    place, speed = (x[0] for x in (drifting.q.value - moving.q.value, drifting.v.value - moving.v.value))
    there, here = (march(system, orbits.Gauss(stages=4), duration=20.0) for system in (drifting, moving))
    assert np.abs(there.v.value[-1] - here.v.value[-1] - speed).max() < 1e-12
    assert np.abs(there.q.value[-1] - here.q.value[-1] - place - 20.0 * speed).max() < 1e-12


@dataclass(frozen=True)
class Bound(Heavy):
    """A term that is written for the frame in which it was measured."""

    def seen_from(self, place, velocity):
        raise InputError("Bound cannot be seen from an origin that moves.")


def test_what_cannot_be_seen_from_another_origin_may_refuse():
    system = three().with_terms(Bound())
    with pytest.raises(InputError, match="Bound cannot be seen"):
        system.barycentric()
