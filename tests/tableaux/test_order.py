"""Orders found from the order conditions of partitioned methods."""

from fractions import Fraction

import mpmath
import pytest

from orbits.tableaux import (
    PartitionedTableau,
    convergence_order,
    drift_kick,
    explicit_euler,
    gauss,
    kick_drift,
    lobatto_iiia_iiib,
    lobatto_iiib_iiia,
    runge_kutta_4,
)
from orbits.tableaux.order import HIGHEST
from orbits.tableaux.partitioned import exact

from ..coverings import each

KNOWN = {
    "explicit Euler": (explicit_euler, 1),
    "kick-drift": (kick_drift, 1),
    "drift-kick": (drift_kick, 1),
    "Runge-Kutta 4": (runge_kutta_4, 4),
    "Gauss 1": (lambda: gauss(1), 2),
    "Gauss 2": (lambda: gauss(2), 4),
    "Gauss 3": (lambda: gauss(3), 6),
    "Lobatto IIIA-IIIB 2": (lambda: lobatto_iiia_iiib(2), 2),
    "Lobatto IIIA-IIIB 3": (lambda: lobatto_iiia_iiib(3), 4),
    "Lobatto IIIA-IIIB 4": (lambda: lobatto_iiia_iiib(4), 6),
    "Lobatto IIIB-IIIA 3": (lambda: lobatto_iiib_iiia(3), 4),
}


@each("name", KNOWN)
def test_the_order_found_is_the_order_known(name):
    make, order = KNOWN[name]
    assert convergence_order(make()) == order == make().order


@each("name", KNOWN)
def test_weights_add_up_to_one_in_sixty_digits(name):
    with mpmath.workdps(70):
        assert abs(sum(KNOWN[name][0]().exact_b) - 1) < 1e-58


def test_no_order_beyond_the_highest_is_claimed():
    assert gauss(4).order == 8
    assert convergence_order(gauss(4)) == HIGHEST == 6


def changed(t, table, i, j, by):
    rows = [list(row) for row in getattr(t, table)]
    rows[i][j] += by
    tables = {"exact_a": t.exact_a, "exact_a_bar": t.exact_a_bar, table: tuple(map(tuple, rows))}
    return PartitionedTableau("changed", tables["exact_a"], tables["exact_a_bar"], t.exact_b, t.order)


@pytest.mark.parametrize(("table", "colour"), [("exact_a", "positions"), ("exact_a_bar", "momenta")])
def test_one_wrong_entry_lowers_the_order(table, colour):
    """A wrong row sum breaks the second order; a change that keeps row sums shows at the third."""
    t = runge_kutta_4()
    wrong = changed(t, table, 2, 1, mpmath.mpf("1e-6"))
    assert convergence_order(wrong) == 1
    kept = changed(changed(t, table, 2, 1, mpmath.mpf("0.01")), table, 2, 0, mpmath.mpf("-0.01"))
    assert convergence_order(kept) == 2


def test_each_table_of_order_4_alone_does_not_make_a_pair_of_order_4():
    """Two methods of order 3, each for itself, that do not fit together: the conditions of mixed trees fail."""
    third, sixth = Fraction(1, 3), Fraction(1, 6)
    kutta = exact([[0, 0, 0], [Fraction(1, 2), 0, 0], [-1, 2, 0]])
    heun_like = exact([[0, 0, 0], [Fraction(1, 4), Fraction(1, 4), 0], [0, 1, 0]])
    b = exact([sixth, 2 * third, sixth])
    assert convergence_order(PartitionedTableau("Kutta 3", kutta, kutta, b, 3)) == 3
    assert convergence_order(PartitionedTableau("Lobatto-like", heun_like, heun_like, b, 3)) == 4
    assert convergence_order(PartitionedTableau("mixed", kutta, heun_like, b, 3)) == 3


def test_weights_that_do_not_sum_to_one_have_order_zero():
    t = PartitionedTableau("no order", exact([[0]]), exact([[0]]), exact([Fraction(9, 10)]), 1)
    assert convergence_order(t) == 0
