"""Coefficients of Runge–Kutta methods from first principles, exactly symplectic in binary floats."""

from orbits.tableaux.elementary import drift_kick, explicit_euler, kick_drift, runge_kutta_4
from orbits.tableaux.gauss import gauss
from orbits.tableaux.lobatto import lobatto_iiia_iiib, lobatto_iiib_iiia
from orbits.tableaux.order import convergence_order
from orbits.tableaux.partitioned import PartitionedTableau
from orbits.tableaux.symplectic import SymplecticTableau, symplectic

__all__ = [
    "PartitionedTableau",
    "SymplecticTableau",
    "convergence_order",
    "drift_kick",
    "explicit_euler",
    "gauss",
    "kick_drift",
    "lobatto_iiia_iiib",
    "lobatto_iiib_iiia",
    "runge_kutta_4",
    "symplectic",
]
