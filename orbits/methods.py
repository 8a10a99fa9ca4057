"""The methods, and the clocks of steps that differ in length.

    orbits.propagate(system, orbits.methods.SABA(order=10), dt=..., duration=...)

`Gauss`, `StormerVerlet` and `WisdomHolman`, `Adaptive` and `TimeTransformed` are names of `orbits` as well.
"""

from __future__ import annotations

from orbits.integrators.composition import Composition
from orbits.integrators.explicit_euler import ExplicitEuler
from orbits.integrators.gauss import Gauss
from orbits.integrators.implicit_midpoint import ImplicitMidpoint
from orbits.integrators.lie_group_variational import LieGroupVariational
from orbits.integrators.lobatto import LobattoIIIAB, LobattoIIIBA
from orbits.integrators.rattle import Rattle
from orbits.integrators.runge_kutta_4 import RungeKutta4
from orbits.integrators.saba import SABA
from orbits.integrators.stormer_verlet import StormerVerlet
from orbits.integrators.symplectic_euler import SymplecticEuler
from orbits.integrators.vprk import VPRK
from orbits.integrators.wisdom_holman import WisdomHolman
from orbits.marching.clocks.adaptive import Adaptive
from orbits.marching.clocks.transformed import TimeTransformed

__all__ = [
    "SABA",
    "VPRK",
    "Adaptive",
    "Composition",
    "ExplicitEuler",
    "Gauss",
    "ImplicitMidpoint",
    "LieGroupVariational",
    "LobattoIIIAB",
    "LobattoIIIBA",
    "Rattle",
    "RungeKutta4",
    "StormerVerlet",
    "SymplecticEuler",
    "TimeTransformed",
    "WisdomHolman",
]


def __dir__() -> list[str]:
    """Return the public names."""
    return __all__
