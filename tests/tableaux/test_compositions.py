"""Composition schemes: their order conditions, their numbers in binary, their tableaux, and what is refused."""

from fractions import Fraction
from math import ceil, log2

import mpmath
import pytest

import orbits
from orbits.errors import InputError
from orbits.tableaux import convergence_order, gauss
from orbits.tableaux.compositions import ANY_BASE, scheme, scheme_names
from orbits.tableaux.conditions import composition_defects, nystrom_defects, words
from orbits.tableaux.published import COMPOSITIONS, SPLITTINGS

from ..coverings import each, keep

PUBLISHED = sorted(COMPOSITIONS)
RECURSIVE = [(2, 4, "triple-jump"), (2, 4, "suzuki"), (2, 8, "triple-jump"), (4, 6, "suzuki"), (6, 10, "triple-jump")]
COMPOSED = [*((2, order, name) for order, name in PUBLISHED), *RECURSIVE]
ALL = [*COMPOSED, *((2, order, name) for order, name in sorted(SPLITTINGS))]


def largest(defects):
    return max(abs(x) for x in defects)


@pytest.mark.parametrize(
    ("base_order", "order", "name"),
    keep(lambda _, case: case[:2] != (2, 10) or case[2] == "tsitouras", COMPOSED),  # those of order 10 take a second
)
def test_every_order_condition_of_a_composition_holds_to_fifty_digits_and_no_more_of_them_do(base_order, order, name):
    with mpmath.workdps(60):
        steps = scheme(base_order, order, name).steps
        # Numbers of sixty digits: 7e-59 at most was reached.
        assert largest(composition_defects(steps, base_order, order)) < 1e-55
        assert largest(composition_defects(steps, base_order, order + 2)) > 1e-6


@pytest.mark.parametrize(("order", "name"), sorted(SPLITTINGS))
def test_every_order_condition_of_kicks_and_drifts_holds_to_fifty_digits_and_no_more_of_them_do(order, name):
    with mpmath.workdps(60):
        s = scheme(2, order, name, splittings=True)
        assert largest(nystrom_defects(s.kicks, s.drifts, order)) < 1e-55
        assert largest(nystrom_defects(s.kicks, s.drifts, order + 1)) > 1e-7


def test_the_two_kinds_of_conditions_agree_on_verlet_composed():
    """By words in free letters and by trees of the Nyström method: the same order for Kahan and Li's scheme."""
    with mpmath.workdps(60):
        s = scheme(2, 6, "kahan-li")
        assert largest(nystrom_defects(s.kicks, s.drifts, 6)) < 1e-55
        assert largest(nystrom_defects(s.kicks, s.drifts, 7)) > 1e-6


def test_the_number_of_conditions_is_the_one_known():
    """Hairer, Lubich & Wanner (2006), sec. V.3.1: 1, 2, 4, 8, 16 for symmetric compositions of a method of order 2."""
    assert [len(words(2, order)) for order in (2, 4, 6, 8, 10)] == [1, 2, 4, 8, 16]


@each("h", [1.0, 0.0123 - 2.0**-40, -6.25, 365.25])
@each(("base_order", "order", "name"), ALL)
def test_in_binary_the_lengths_are_mirrored_and_their_sum_is_the_step_exactly(base_order, order, name, h):
    h = float(Fraction(round(h * 2**30), 2**30))  # of few bits, as `propagate` makes it
    s = scheme(base_order, order, name, splittings=base_order == 2)
    kicks, drifts = s.binary_kicks_and_drifts(h)
    for lengths, exact in ((kicks, s.kicks), (drifts, s.drifts)):
        assert list(lengths) == list(lengths[::-1])
        assert sum(Fraction(x) for x in lengths) == Fraction(h)
        # Half a unit of the largest length each, which the one in the middle makes up for; 0.9 of this was reached.
        size = max(1.0, *(abs(float(y)) for y in exact))
        errors = [abs(x / h - float(y)) for x, y in zip(lengths, exact, strict=True)]
        assert max(errors) < len(lengths) * 2.0**-52 * size
    # The other drifts have half a unit of the finest grid that there may be: 1.0 of this was reached, by exact halves.
    outer = errors[: (len(errors) - 1) // 2]
    assert max(outer, default=0.0) < 1.2 * 2.0 ** (ceil(log2(size)) - 52)


@each(("base_order", "order", "name"), [a for a in ALL if a[1] <= 6])
def test_the_tableau_is_symplectic_and_symmetric_and_has_the_order(base_order, order, name):
    s = scheme(base_order, order, name, splittings=base_order == 2)
    tableau = s.composed(gauss(base_order // 2)) if s.steps else s.split()
    assert tableau.symplecticity_residual() < 1e-55
    assert tableau.symmetry_residual() < 1e-55
    if s.steps and len(s.steps) <= 5 and order == 4:
        assert convergence_order(tableau) == order
    if s.steps:
        assert s.split().symplecticity_residual() < 1e-55


def test_every_default_is_a_scheme_of_its_order():
    for order in (4, 6, 8, 10):
        method = orbits.methods.Composition(orbits.StormerVerlet(), order=order)
        assert method.order == order
        assert method.scheme in orbits.methods.Composition.schemes(method.base, order)
    assert orbits.methods.Composition(orbits.Gauss(stages=2), order=6).scheme in ANY_BASE


def test_what_does_not_fit_is_refused_with_a_remedy():
    verlet, gauss_2 = orbits.StormerVerlet(), orbits.Gauss(stages=2)
    with pytest.raises(InputError, match=r"not symmetric.*use StormerVerlet"):
        orbits.methods.Composition(orbits.methods.SymplecticEuler())
    with pytest.raises(InputError, match="not symmetric"):
        orbits.methods.Composition(orbits.methods.RungeKutta4())
    with pytest.raises(InputError, match="needs a method"):
        orbits.methods.Composition("verlet")
    with pytest.raises(InputError, match="composed already"):
        orbits.methods.Composition(orbits.methods.Composition(verlet, order=4), order=6)
    for order in (2, 5, 4.0, "6", True, None, [4]):
        with pytest.raises(InputError, match="even order above 2"):
            orbits.methods.Composition(verlet, order=order)
    with pytest.raises(InputError, match="at most 10"):
        orbits.methods.Composition(verlet, order=12)
    with pytest.raises(InputError, match=r"methods of order 2; order 6 from order 4 has suzuki, triple-jump"):
        orbits.methods.Composition(gauss_2, order=6, scheme="kahan-li")
    with pytest.raises(InputError, match="made for Störmer–Verlet"):
        orbits.methods.Composition(orbits.Gauss(stages=1), order=4, scheme="blanes-moan")
    with pytest.raises(InputError, match=r"a scheme for these orders; order 4 from order 2 has blanes-moan, suzuki"):
        orbits.methods.Composition(verlet, order=4, scheme="ruth")


def test_every_published_scheme_is_offered():
    offered = {(order, name) for order in (4, 6, 8, 10) for name in scheme_names(2, order, splittings=True)}
    assert offered >= set(COMPOSITIONS) | set(SPLITTINGS)
