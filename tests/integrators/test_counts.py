"""Stages and orders of methods are whole numbers: of Python or NumPy, not floats, flags, texts or arrays."""

import numpy as np
import pytest

import orbits
from orbits.errors import InputError
from orbits.integrators import parse

from ..coverings import each

METHODS = {
    "Gauss": (lambda count: orbits.Gauss(stages=count), 2),
    "LobattoIIIAB": (lambda count: orbits.methods.LobattoIIIAB(stages=count), 3),
    "LobattoIIIBA": (lambda count: orbits.methods.LobattoIIIBA(stages=count), 3),
    "Composition": (lambda count: orbits.methods.Composition(orbits.StormerVerlet(), order=count), 6),
    "WisdomHolman": (lambda count: orbits.WisdomHolman(corrector=count), 17),
    "SABA, the first order alone": (lambda count: orbits.methods.SABA(count), 10),
    "SABA, all orders": (lambda count: orbits.methods.SABA(count, 6, 4), 8),
}


NO_COUNTS = [float, np.float64, bool, str, lambda count: [count], lambda count: np.array([count])]
ORDERS = NO_COUNTS[3:]
"""What SABA takes for orders if it stands alone: a text such as "8, 4", and what is a list."""


@each(
    ("name", "given"),
    [(name, given) for name in METHODS for given in NO_COUNTS if not ("alone" in name and given in ORDERS)],
)
def test_what_is_no_whole_number_is_refused(name, given):
    make, count = METHODS[name]
    with pytest.raises(InputError, match=r"got|expected") as refused:
        make(given(count))
    assert str(given(count))[:4] in str(refused.value)


@pytest.mark.parametrize("name", METHODS)
def test_a_whole_number_of_numpy_makes_the_same_method_with_a_label_that_is_read_again(name):
    make, count = METHODS[name]
    method = make(np.int64(count))
    assert repr(method) == repr(make(count))
    assert parse(method.label) == make(count)


@pytest.mark.parametrize(
    "make", [lambda flag: orbits.Gauss(close_pairs=flag), lambda flag: orbits.WisdomHolman(corrector2=flag)]
)
def test_flags_are_true_or_false(make):
    assert repr(make(np.True_)) == repr(make(True))
    assert parse(make(np.True_).label) == make(True)
    for wrong in (1, 1.0, "yes", None):
        with pytest.raises(InputError, match="expected True or False"):
            make(wrong)


@pytest.mark.parametrize("coordinates", ["jacobi", "democratic-heliocentric"])
def test_a_corrector_of_zero_is_a_whole_number_too(coordinates):
    with pytest.raises(InputError, match=r"corrector is 0\.0; expected 17, 11, 7, 5, 3, or 0 for none"):
        orbits.WisdomHolman(coordinates=coordinates, kernel="standard", corrector=0.0)
