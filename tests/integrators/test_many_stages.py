"""Gauss with more stages than one register holds: by the same tests as all methods, and against one register."""

from dataclasses import dataclass

import mpmath
import numpy as np
import pytest

import orbits
from orbits.integrators.collocation.form import Collocation
from orbits.tableaux import gauss

from ..contracts.problems import march
from ..coverings import first
from ..problems import kepler_orbit, three_bodies
from .plain_steps import one_step

TWELVE = orbits.Gauss(stages=12)


class TwoRegisters(Collocation):
    """Stages that would fit into one register, in two."""

    registers = 2


@dataclass(frozen=True)
class InTwoRegisters(orbits.Gauss):
    """Gauss with stages that would fit one register, by the step for several."""

    second_order = property(lambda self: TwoRegisters(self.tableau))


@pytest.mark.parametrize("stages", first(1, [3, 8]))
def test_a_step_in_several_registers_and_one_in_one_register_agree(stages):
    start = three_bodies(particles=11)
    fast = march(orbits.Gauss(stages=stages), *start, 0.15, 40)
    general = march(InTwoRegisters(stages=stages), *start, 0.15, 40)
    for a, b in zip(fast, general, strict=True):
        assert np.abs(a - b).max() < 1e-15  # sums in another order; 2.2e-16 was reached


@pytest.mark.parametrize("stages", first(3, [9, 12, 16, 32]))
def test_the_exactly_symplectic_form_holds_for_any_number_of_stages(stages):
    tableau = gauss(stages)
    assert tableau.binary_residual() == 0
    assert tableau.binary_asymmetry() == 0
    assert tableau.rounding_residual() < 4


# Three registers are compiled as four are, and take as long: two and four are in the short form.
@pytest.mark.parametrize("stages", first(1, [12, 16, pytest.param(24, marks=pytest.mark.slow), 32]))
def test_long_steps_leave_round_off_only(stages):
    """Steps a quarter of the inner planet's period, against eight stages at an eighth of that."""
    start = three_bodies(particles=11)
    truth = march(orbits.Gauss(stages=8), *start, 0.125, 32)
    longer = march(orbits.Gauss(stages=stages), *start, 0.5 if stages < 16 else 1.0, 8 if stages < 16 else 4)
    for a, b in zip(truth, longer, strict=True):
        assert np.abs(a - b).max() < 6e-15  # 1.4e-15 was reached


@pytest.mark.parametrize("stages", [9, 10, 12])
def test_the_error_of_one_step_falls_with_the_power_order_plus_one_in_58_digits(stages):
    """As for fewer stages in `test_orders`, with steps long enough for so many digits."""
    with mpmath.workdps(58):
        e, t = mpmath.mpf("0.3"), mpmath.mpf("0.8")
        q, p = kepler_orbit(e, t)
        errors = []
        for h in (mpmath.mpf(1) / 8, mpmath.mpf(1) / 16):
            got, exact = one_step(gauss(stages), q, p, h), kepler_orbit(e, t + h)[0]
            errors.append(max(abs(a - b) for a, b in zip(got, exact, strict=True)))
        measured = float(mpmath.log(errors[0] / errors[1], 2)) - 1
    # The next terms of the expansion at such steps: 17.4, 19.6 and 22.8 were measured.
    assert -1.4 < measured - 2 * stages < 0.4, measured


def test_many_stages_refuse_what_is_not_separable_and_their_number_has_an_end():
    with pytest.raises(orbits.errors.InputError, match=r"separable Lagrangians only; 'charged-particle'.*Use 8 stages"):
        orbits.march(orbits.lagrangians.charged_particle, TWELVE, dt=0.1, steps=1)
    with pytest.raises(orbits.errors.InputError, match="between 1 and 32"):
        orbits.Gauss(stages=33)


@pytest.mark.contracts
def test_twelve_stages_are_certified():
    certificate = orbits.certify(orbits.lagrangians.kepler, TWELVE, 0.2)
    assert certificate.ok, certificate.table()
