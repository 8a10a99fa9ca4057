"""Every registered method on every registered Lagrangian that it can serve: what it declares holds, what it does not
declare visibly fails. By default, a few methods meet one Lagrangian, beside the bodies on which `test_integrators` has
all of them; `make contracts` runs the whole matrix.
"""

import dataclasses

import numpy as np
import pytest

import orbits
from orbits.errors import InputError
from orbits.integrators import registry as methods
from orbits.integrators.base import MOMENTUM_MAPS, SYMMETRIC, SYMPLECTIC
from orbits.lagrangians import registry as lagrangians
from orbits.lagrangians.base import CONSTRAINED, GRADIENTS, SEPARABLE
from orbits.marching.flow import Flow, starting_state
from orbits.methods import VPRK, Composition, ExplicitEuler, Rattle, RungeKutta4
from orbits.tableaux import gauss

LINEAR = {"free-particle", "harmonic-oscillator"}
"""On these a linear method may have properties that it does not have in general: nothing is shown to fail."""

BY_ALL = "kepler"
"""The Lagrangian on which methods are certified by default that need no other."""

DEFAULT = {
    *((BY_ALL, label) for label in ("StormerVerlet()", "RungeKutta4()", "ExplicitEuler()")),
    ("pendulum-on-a-sphere", "Rattle()"),
}
"""Kicks, those that declare less, and a constraint. Gauss is in `tests/certificate`, rigid bodies have files of their
own."""

EXAMPLES = [m for cls in methods().values() for m in cls.examples()]
ALL = [*EXAMPLES, Composition(Rattle(), order=4)]
MATRIX = [(name, m) for name, L in sorted(lagrangians().items()) for m in ALL if m.serves(L)]


CASES = [
    pytest.param(name, m, id=f"{name} {m.label}", marks=[] if (name, m.label) in DEFAULT else [pytest.mark.contracts])
    for name, m in MATRIX
]


@pytest.mark.parametrize(("name", "method"), CASES)
def test_a_certificate_confirms_what_is_declared_and_refutes_what_is_not(name, method):
    """Bounds stand beside each measurement in `orbits.certificate.measuring`."""
    L = lagrangians()[name]
    certificate = orbits.certify(L, method, L.example.dt)
    if method.follows_kepler:  # explicit: it has no equations to solve
        assert certificate.ok, certificate.table()
    else:
        assert certificate.ok == method.variational, certificate.table()
        assert certificate["step solves its equations"].holds
    for finding in certificate.findings:
        if finding.declared:
            assert finding.holds, certificate.table()
    if name in LINEAR or method.follows_kepler:  # a corrector leaves a map that is almost symmetric
        return
    failing = {
        SYMPLECTIC: ["symplecticity", "area of a loop"],
        SYMMETRIC: ["reversibility"],
        MOMENTUM_MAPS: [f.name for f in certificate.findings if f.name.startswith("momentum map: rotation")],
    }
    for declared, findings in failing.items():
        if declared not in method.declares:
            # Thousands of times beyond the bound: nobody could call it round-off.
            assert all(certificate[f].measured > 1e3 * certificate[f].bound for f in findings), certificate.table()


BOTH_FORMS = [
    pytest.param(name, marks=[] if name == BY_ALL else [pytest.mark.contracts])
    for name, L in sorted(lagrangians().items())
    if {SEPARABLE, GRADIENTS} <= L.traits and CONSTRAINED not in L.traits
]


@pytest.mark.parametrize("name", BOTH_FORMS)
def test_the_second_order_and_the_canonical_form_agree_to_round_off(name):
    """Over 40 steps, for every method of the family; by itself the second-order form is taken."""
    L = lagrangians()[name]
    q, p = starting_state(L, None, None)
    scale = max(np.abs(q).max(), 1.0)
    for method in ALL:
        if method.canonical is None:
            continue
        fast, general = Flow(L, method, L.example.dt), Flow(L, method, L.example.dt, canonical=True)
        assert not fast.canonical
        a, b = fast.march(q, p, 40), general.march(q, p, 40)
        # 40 steps of roundings, which the motion amplifies; 1.6e-15 was reached for bodies that meet, 6e-16 otherwise.
        assert np.abs(a.q - b.q).max() < 8e-15 * scale
        assert np.abs(a.p - b.p).max() < 8e-15 * max(np.abs(p).max(), 1.0)


def test_every_method_serves_some_lagrangian_and_every_lagrangian_has_a_method():
    assert {type(m) for _, m in MATRIX} == set(methods().values())
    assert {name for name, _ in MATRIX} == set(lagrangians())


@pytest.mark.parametrize("name", sorted(n for n, L in lagrangians().items() if SEPARABLE not in L.traits))
def test_explicit_methods_refuse_what_they_cannot_serve_and_say_which_can(name):
    L = lagrangians()[name]
    for method in (orbits.StormerVerlet(), RungeKutta4(), ExplicitEuler()):
        if isinstance(method, orbits.StormerVerlet) and L.rotors:
            assert method.serves(L)  # between kicks, rigid bodies turn exactly
            continue
        with pytest.raises(InputError, match=r"needs a Lagrangian that is separable.*Use .*Gauss"):
            orbits.march(L, method, dt=0.1, steps=1)


def wrong_gauss(entry):
    """Gauss with two stages and one wrong entry, in the exact table and in all floats that are made of it."""
    right = gauss(2)
    a = [list(row) for row in right.exact_a]
    a[0][1] += entry
    a = tuple(tuple(row) for row in a)
    mu, eta = right.mu.copy(), right.eta.copy()
    mu[0, 1] += entry / right.b[1]
    mu_bar = right.mu_bar.copy()
    mu_bar[0, 1] = mu[0, 1]
    A = np.array([[float(x) for x in row] for row in a])
    eta = A @ A / right.b
    return dataclasses.replace(right, exact_a=a, exact_a_bar=a, mu=mu, mu_bar=mu_bar, eta=eta)


@dataclasses.dataclass(frozen=True)
class WrongGauss(orbits.Gauss):
    """Declares what Gauss declares, with a tableau that is not Gauss's."""

    stages: int = 2

    @property
    def tableau(self):
        return wrong_gauss(1e-6)


@dataclasses.dataclass(frozen=True)
class BoastingEuler(ExplicitEuler):
    """Explicit Euler, declared to be what it is not."""

    declares = frozenset({SYMPLECTIC, SYMMETRIC, MOMENTUM_MAPS})


@pytest.mark.parametrize("method", [WrongGauss(), BoastingEuler()], ids=["wrong tableau", "boasting Euler"])
def test_a_method_that_is_not_what_it_declares_is_found_out(method):
    certificate = orbits.certify(orbits.lagrangians.kepler, method, 0.1)
    assert not certificate.ok
    for name in ("momentum map: rotation", "symplecticity", "area of a loop", "reversibility"):
        assert certificate[name].verdict == "FAILS, DECLARED", certificate.table()
    assert "NOT CERTIFIED" in certificate.table()
    # What is wrong by 1e-6 shows at about that size, far above round-off.
    assert certificate["symplecticity"].measured > 1e-9


def test_explicit_euler_and_runge_kutta_are_not_certified():
    for method in (ExplicitEuler(), RungeKutta4()):
        certificate = orbits.certify(orbits.lagrangians.kepler, method, 0.1)
        assert not certificate.ok
        assert any("it has none" in failure for failure in certificate.failures)


def test_a_vprk_without_a_symplectic_pair_is_refused():
    with pytest.raises(InputError, match=r"not symplectic.*a_bar_ij = b_j \(1 - a_ji / b_i\)"):
        VPRK(a=((0, 0), (1, 0)), b=(0.5, 0.5), a_bar=((0, 0), (1, 0)))
