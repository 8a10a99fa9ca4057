"""Discrete mechanics on Q x Q: discrete Lagrangians, their Euler–Lagrange equations, and conserved quantities."""

from orbits.discrete.base import DiscreteLagrangian
from orbits.discrete.boundary import boundary_value
from orbits.discrete.composed import PhaseStep, composed, phase_step
from orbits.discrete.constrained import Constrained, constrained
from orbits.discrete.evolution import advance, march_pairs, start, step
from orbits.discrete.exact import exact, exact_by_collocation
from orbits.discrete.exact_linear import exact_free_particle, exact_harmonic_oscillator, exact_linear
from orbits.discrete.jacobi import kepler_splitting
from orbits.discrete.lambert import exact_kepler
from orbits.discrete.legendre import (
    canonical_form,
    inverse_legendre_minus,
    inverse_legendre_plus,
    legendre_derivative,
    legendre_minus,
    legendre_plus,
    momentum_mismatch,
    pair_derivative,
    phase_derivative,
    phase_map,
    pull_back,
    require_regular,
    two_form,
)
from orbits.discrete.noether import Drift, drift, invariance, momentum_map
from orbits.discrete.path import action, euler_lagrange_residual, momentum_residual
from orbits.discrete.quadrature import midpoint, symplectic_euler_a, symplectic_euler_b, trapezoidal
from orbits.discrete.rotors import (
    body_covectors,
    body_frame,
    body_pair_derivative,
    body_two_form,
    kick_rotate_kick,
    moser_veselov,
)
from orbits.discrete.suris import suris
from orbits.discrete.vprk import vprk

__all__ = [
    "Constrained",
    "DiscreteLagrangian",
    "Drift",
    "PhaseStep",
    "action",
    "advance",
    "body_covectors",
    "body_frame",
    "body_pair_derivative",
    "body_two_form",
    "boundary_value",
    "canonical_form",
    "composed",
    "constrained",
    "drift",
    "euler_lagrange_residual",
    "exact",
    "exact_by_collocation",
    "exact_free_particle",
    "exact_harmonic_oscillator",
    "exact_kepler",
    "exact_linear",
    "invariance",
    "inverse_legendre_minus",
    "inverse_legendre_plus",
    "kepler_splitting",
    "kick_rotate_kick",
    "legendre_derivative",
    "legendre_minus",
    "legendre_plus",
    "march_pairs",
    "midpoint",
    "momentum_map",
    "momentum_mismatch",
    "momentum_residual",
    "moser_veselov",
    "pair_derivative",
    "phase_derivative",
    "phase_map",
    "phase_step",
    "pull_back",
    "require_regular",
    "start",
    "step",
    "suris",
    "symplectic_euler_a",
    "symplectic_euler_b",
    "trapezoidal",
    "two_form",
    "vprk",
]


def __dir__() -> list[str]:
    """Return the public names."""
    return __all__
