"""Every registered force, by its examples: what it takes from bodies is what the steps account for, in runs that are
stored and resumed to the same bits, and in certificates. All at once by default, on massive bodies, so that one sum is
compiled; each alone nightly, on a massless one too.
"""

import numpy as np
import pytest

import orbits
from orbits.forces import registry

from ..coverings import only

METHOD = orbits.Gauss(stages=2)
STEPS = {"progress": False, "check_step": False}
EACH = {f"{kind} {k}": (force,) for kind, cls in registry().items() for k, force in enumerate(cls.examples())}
EXAMPLES = {"all": tuple(force for (force,) in EACH.values()), **EACH}
of_all = pytest.mark.parametrize("forces", [
    pytest.param(forces, id=name, marks=[] if name == "all" else pytest.mark.nightly)
    for name, forces in EXAMPLES.items()
])  # fmt: skip
EPS = 2.0**-53


def system():
    """A star, two planets on inclined orbits, and a massless grain."""
    return orbits.System(
        ["star", "planet", "outer", "grain"],
        [1.0, 1e-2, 5e-3, 0.0],
        [[0.0, 0, 0], [1.2, 0, 0], [0, 2.2, 0.1], [0, -1.6, 0]],
        [[0.0, 0, 0], [0, 0.8, 0.1], [-0.65, 0, 0], [0.75, 0, 0.1]],
        units=orbits.DIMENSIONLESS,
    ).barycentric()


def run(forces, dt=1 / 16, **options):
    start = system() if len(forces) == 1 else system().remove("grain")
    return orbits.propagate(start.with_forces(*forces), METHOD, dt=dt, **{**STEPS, "duration": 8.0, **options})


def test_every_force_has_an_example():
    assert {name.split()[0] for name in EACH} == set(registry())


@of_all
def test_momenta_change_by_impulse_and_torque_to_round_off_and_energy_by_the_work_to_the_order(forces):
    coarse, fine = run(forces, samples=9), run(forces, 1 / 32, samples=9)
    for found in (coarse, fine):
        effects = found.work()
        assert all(np.abs(effect.work.value[-1]) > 1e-9 for effect in effects)  # each does something
        for now, given in (
            (found.angular_momentum(), sum(effect.torque for effect in effects)),
            (found.linear_momentum(), sum(effect.impulse for effect in effects)),
        ):
            left = (now - given).value
            # The state of a sample is rounded; a step is summed in doubled precision. Largest: 1.4e-17 and 2e-18.
            assert np.abs(left - left[0]).max() < 4 * EPS * np.abs(found.angular_momentum().value[0]).max()
    off = [np.abs(np.diff((x.energy() - sum(effect.work for effect in x.work())).value)).max() for x in (coarse, fine)]
    assert off[0] < 1e-6
    assert 12.0 < off[0] / off[1] < 20.0  # of order 4, as Gauss(stages=2) is


@of_all
def test_a_run_is_resumed_to_the_same_bits_with_all_that_the_forces_did(forces, tmp_path):
    path = tmp_path / "run.h5"
    whole = run(forces, samples=9)
    run(forces, duration=4.0, samples=5, archive=path).close()
    resumed = orbits.resume(path, until=8.0, progress=False)
    assert np.array_equal(resumed.q, whole.q)
    for one, other in zip(resumed.work(), whole.work(), strict=True):
        assert np.array_equal(one.torque, other.torque)
    resumed.close()


@of_all
def test_a_state_between_samples_and_a_run_from_a_sample_are_those_of_the_run(forces):
    """They begin from a rounded sample, with the forces as they are there: times, and spins. At most 1e-15 off."""
    fine, found = run(forces, samples=65), run(forces, samples=3)
    assert np.abs((found.at(6.625).q - fine.q[53]).value).max() < 8e-15
    assert np.abs((found.at([6.625, 1.5]).q - fine.q[[53, 12]]).value).max() < 8e-15
    again = orbits.propagate(found[1], METHOD, dt=1 / 16, duration=4.0, samples=2, **STEPS)
    assert np.abs((again.q[-1] - found.q[-1]).value).max() < 8e-15
    for one, other in ((again[-1], found[-1]), (found.at(6.625), fine[53])):
        for mine, its in zip(one.forces, other.forces, strict=True):
            for name, value in vars(its).items():
                assert np.allclose(_numbers(vars(mine)[name]), _numbers(value), rtol=1e-14, atol=0), name


def _numbers(value):
    return np.array([getattr(x, "value", x) for x in value]) if isinstance(value, tuple) else _plain(value)


def _plain(value):
    return 0.0 if value is None or isinstance(value, str) else getattr(value, "value", value)


@pytest.mark.parametrize("force", only([EACH["drag 0"][0]], [force for (force,) in EACH.values()]), ids=EACH)
def test_a_certificate_holds_and_says_what_the_force_takes(force):
    certificate = orbits.certify(system().remove("outer", "grain").with_forces(force), METHOD, 1 / 16)
    assert certificate.ok, certificate.table()
    assert f"what {force.kind} takes is left out but for the balances" in str(certificate)
    assert any(finding.name.startswith("balance: rotation") for finding in certificate.findings)
