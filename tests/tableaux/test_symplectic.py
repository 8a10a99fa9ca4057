"""Symplectic pairs of a user's own: completed, made exact in binary, refused with the reason."""

from fractions import Fraction

import numpy as np
import pytest

from orbits.errors import InputError
from orbits.integrators.vprk import VPRK
from orbits.tableaux import drift_kick, explicit_euler, kick_drift, lobatto_iiia_iiib, runge_kutta_4, symplectic
from orbits.tableaux.symplectic import FLOAT_TOLERANCE

from ..coverings import each


def floats(values):
    return tuple(tuple(float(x) for x in row) for row in values)


def test_the_symplectic_eulers_are_one_stage_at_either_end_and_each_others_adjoint():
    for t, node in ((kick_drift(), 0.0), (drift_kick(), 1.0)):
        assert t.nodes[0] == node
        assert not t.symmetric
        assert t.symplecticity_residual() == t.binary_residual() == 0
        assert t.symmetry_residual() == 1.0
    # The adjoint of a is b_j - a_{s+1-i,s+1-j}.
    assert np.array_equal(1.0 - kick_drift().a, drift_kick().a)
    assert np.array_equal(1.0 - kick_drift().a_bar, drift_kick().a_bar)


@pytest.mark.parametrize("make", [explicit_euler, runge_kutta_4])
def test_explicit_methods_are_not_symplectic_by_far(make):
    assert make().symplecticity_residual() > 0.1


@pytest.mark.parametrize("stages", [2, 3])
def test_vprk_completes_iiia_to_its_partner_iiib(stages):
    t = lobatto_iiia_iiib(stages)
    text = {2: (("0", "0"), ("1/2", "1/2")), 3: (("0",) * 3, ("5/24", "1/3", "-1/24"), ("1/6", "2/3", "1/6"))}[stages]
    b = {2: ("1/2", "1/2"), 3: ("1/6", "2/3", "1/6")}[stages]
    mine = VPRK(a=text, b=b)
    assert mine.order == t.order
    assert mine.tableau.symmetric
    for name in ("nodes", "eta", "mu", "mu_bar", "b"):
        assert np.array_equal(getattr(mine.tableau, name), getattr(t, name)), name


def test_a_completed_pair_without_symmetry_is_symplectic_exactly_and_in_binary():
    method = VPRK(a=(("1/5", "1/10"), ("1/2", "2/5")), b=("3/10", "7/10"))
    t = method.tableau
    assert t.symplecticity_residual() < 1e-50
    assert t.binary_residual() == 0
    assert not t.symmetric
    assert "symmetric" not in method.declares
    assert t.binary_asymmetry() > Fraction(1, 100)


@pytest.mark.parametrize("stages", [2, 3, 4, 6, 8])
def test_a_pair_given_in_floats_is_accepted_and_made_exactly_symplectic(stages):
    t = lobatto_iiia_iiib(stages)
    mine = VPRK(a=floats(t.a), b=tuple(t.b.tolist()), a_bar=floats(t.a_bar)).tableau
    assert mine.symplecticity_residual() <= FLOAT_TOLERANCE
    assert mine.binary_residual() == 0
    assert mine.symmetric
    assert mine.binary_asymmetry() == 0
    # Rounding of the given floats, 2^-54 of entries below 1, over the smallest weight, 1 / (s (s - 1)).
    assert np.abs(mine.mu - t.mu).max() <= 2.0**-52 * stages * (stages - 1)


def test_numbers_written_as_text_are_read_exactly_and_floats_are_not():
    text = VPRK(a=(("0.1",),), b=("1",)).tableau
    number = VPRK(a=((0.1,),), b=(1.0,)).tableau
    assert text.exact_a[0][0] != number.exact_a[0][0]
    assert abs(text.exact_a[0][0] * 10 - 1) < 1e-50
    assert text.binary_residual() == number.binary_residual() == 0


HALF = ("1/2", "1/2")
SQUARE = (("0", "0"), HALF)
BAD = {
    "not symplectic": ({"a": SQUARE, "b": HALF, "a_bar": SQUARE}, r"not symplectic.*violated by 0\.25.*Complete"),
    "off by 1e-12": ({"a": ((0.5 + 1e-12,),), "b": (1.0,), "a_bar": ((0.5,),)}, "not symplectic"),
    "zero weight": ({"a": SQUARE, "b": ("0", "1")}, r"weight b_1 is zero.*Leave that stage out"),
    "weights not summing to 1": ({"a": SQUARE, "b": ("1/2", "1/3")}, r"sum to 0\.8333"),
    "no stages": ({"a": (), "b": ()}, "between 1 and 8 stages, got 0"),
    "too many stages": ({"a": tuple(("0",) * 9 for _ in range(9)), "b": ("1/9",) * 9}, "between 1 and 8 stages, got 9"),
    "not square": ({"a": (("0",), ("1/2", "1/2")), "b": HALF}, "2 x 2 tables for the 2 weights"),
    "too few rows": ({"a": (("0", "0"),), "b": HALF}, "2 x 2 tables for the 2 weights"),
    "a_bar of another size": ({"a": SQUARE, "b": HALF, "a_bar": (("1/2",),)}, "2 x 2 tables for the 2 weights"),
    "text that is no number": (
        {"a": (("a half",),), "b": ("1",)},
        "a must consist of finite numbers, or texts such as",
    ),
    "division by zero": ({"a": (("1/0",),), "b": ("1",)}, "a must consist of finite numbers"),
    "nan": ({"a": ((float("nan"),),), "b": (1.0,)}, "a must consist of finite numbers"),
    "inf": ({"a": ((0.5,),), "b": (float("inf"),)}, "b must consist of finite numbers"),
    "complex": ({"a": ((0.5j,),), "b": (1.0,)}, "a must consist of finite numbers"),
    "a complex array": ({"a": np.array([[0.5 + 0.5j]]), "b": (1.0,)}, "a must consist of finite numbers"),
    "a number for a table": ({"a": 0.5, "b": (1.0,)}, "a must be a square table"),
    "a number for a row": ({"a": (0.5,), "b": (1.0,)}, "a must consist of"),
    "text for a table": ({"a": "1/2", "b": ("1",)}, "a must be a square table"),
    "text for the weights": ({"a": (("1/2",),), "b": "1"}, "b must"),
    "a number for the weights": ({"a": (("1/2",),), "b": 1.0}, "b must consist of"),
    "nothing": ({"a": None, "b": None}, "a must be a square table"),
}


@each("case", BAD)
def test_a_pair_that_cannot_be_used_is_refused_with_the_reason(case):
    given, message = BAD[case]
    with pytest.raises(InputError, match=message):
        VPRK(**given)


def test_tables_are_checked_where_they_are_made_too():
    with pytest.raises(InputError, match="not symplectic"):
        symplectic("RK4", runge_kutta_4().exact_a, runge_kutta_4().exact_a, runge_kutta_4().exact_b, 4)
