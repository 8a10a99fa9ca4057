"""Variational integrators for gravitational N-body problems.

    import orbits
    from astropy import units as u

    system = orbits.System.solar_system()
    run = orbits.propagate(system, orbits.Gauss(stages=8), dt=6 * u.day, duration=1000 * u.yr)

Public names and submodules (`orbits.diagnostics`, `orbits.elements`, ...) are loaded on first use: `import orbits`
itself compiles nothing and imports no heavy packages.
"""

from __future__ import annotations

import importlib
import importlib.util
import pkgutil
from typing import TYPE_CHECKING, Any

from orbits._version import __version__

if TYPE_CHECKING:
    from orbits.archive import Archive
    from orbits.certificate import Certificate, certify
    from orbits.elements.kepler_flow import kepler_flow
    from orbits.ephemeris import asteroids, read_mpcorb, read_sbdb
    from orbits.errors import (
        ArchiveError,
        ConvergenceError,
        EpochError,
        EventError,
        EventWarning,
        InputError,
        IntegrationError,
        Interrupted,
        MissingPackageError,
        OrbitsError,
        OrbitsWarning,
        OutOfRangeError,
        OutOfTime,
        RetiredWarning,
        SingularityError,
        StepWarning,
        StorageError,
        SystemsError,
        UnknownNameError,
    )
    from orbits.forces.damping import Damping
    from orbits.forces.drag import Drag
    from orbits.forces.gas_drag import GasDrag
    from orbits.forces.mass_loss import MassLoss
    from orbits.forces.non_gravitational import NonGravitational
    from orbits.forces.radiation_pressure import RadiationPressure
    from orbits.forces.tides import Tides
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
    from orbits.kernels.compile import kernel
    from orbits.lagrangians.base import Lagrangian, Motion
    from orbits.lagrangians.symmetry import Symmetry
    from orbits.lagrangians.terms.degree_two import DegreeTwo
    from orbits.lagrangians.terms.frame_dragging import FrameDragging
    from orbits.lagrangians.terms.minor_bodies import MinorBodies
    from orbits.lagrangians.terms.nobili_roxburgh import NobiliRoxburgh
    from orbits.lagrangians.terms.post_newtonian import PostNewtonian
    from orbits.lagrangians.terms.zonal_harmonics import ZonalHarmonics
    from orbits.marching.clocks.adaptive import Adaptive
    from orbits.marching.clocks.transformed import TimeTransformed
    from orbits.marching.flow import DiscretePath, Flow, march
    from orbits.propagation import Trajectory, propagate, resume
    from orbits.propagation.collisions.merge_and_bounce import Bounce, Merge
    from orbits.propagation.control.heartbeat import Heartbeat
    from orbits.propagation.control.stop_conditions import CloserThan, EnergyErrorAbove, FartherThan, WallTimeOver
    from orbits.propagation.events.base import Action, Happening
    from orbits.propagation.events.kinds.collision import Collision
    from orbits.propagation.events.kinds.from_observer import Conjunction, Occultation, Opposition, Transit
    from orbits.propagation.events.kinds.of_pairs import Apocentre, CloseApproach, Pericentre
    from orbits.propagation.events.kinds.orbital import Ejection, ElementCrossing
    from orbits.propagation.events.kinds.own import Event
    from orbits.propagation.events.kinds.planes import NodeCrossing, PlaneCrossing
    from orbits.propagation.results.shadow_energy import shadow_energy
    from orbits.propagation.resuming.verification import Verification, verify
    from orbits.propagation.variations.megno import megno
    from orbits.propagation.variations.state_transition import state_transition
    from orbits.regression import compare, from_rebound, residuals, run_from_rebound, to_rebound
    from orbits.scenario import Check, Option, Scenario, Study, StudyResult, Table
    from orbits.system import System
    from orbits.system.rigid_body import RigidBody
    from orbits.system.solar.description import solar_model
    from orbits.units import DIMENSIONLESS, SOLAR, UnitSystem
    from orbits.viewing.view import view

__all__ = [
    "DIMENSIONLESS",
    "SABA",
    "SOLAR",
    "VPRK",
    "Action",
    "Adaptive",
    "Apocentre",
    "Archive",
    "ArchiveError",
    "Bounce",
    "Certificate",
    "Check",
    "CloseApproach",
    "CloserThan",
    "Collision",
    "Composition",
    "Conjunction",
    "ConvergenceError",
    "Damping",
    "DegreeTwo",
    "DiscretePath",
    "Drag",
    "Ejection",
    "ElementCrossing",
    "EnergyErrorAbove",
    "EpochError",
    "Event",
    "EventError",
    "EventWarning",
    "ExplicitEuler",
    "FartherThan",
    "Flow",
    "FrameDragging",
    "GasDrag",
    "Gauss",
    "Happening",
    "Heartbeat",
    "ImplicitMidpoint",
    "InputError",
    "IntegrationError",
    "Interrupted",
    "Lagrangian",
    "LieGroupVariational",
    "LobattoIIIAB",
    "LobattoIIIBA",
    "MassLoss",
    "Merge",
    "MinorBodies",
    "MissingPackageError",
    "Motion",
    "NobiliRoxburgh",
    "NodeCrossing",
    "NonGravitational",
    "Occultation",
    "Opposition",
    "Option",
    "OrbitsError",
    "OrbitsWarning",
    "OutOfRangeError",
    "OutOfTime",
    "Pericentre",
    "PlaneCrossing",
    "PostNewtonian",
    "RadiationPressure",
    "Rattle",
    "RetiredWarning",
    "RigidBody",
    "RungeKutta4",
    "Scenario",
    "SingularityError",
    "StepWarning",
    "StorageError",
    "StormerVerlet",
    "Study",
    "StudyResult",
    "Symmetry",
    "SymplecticEuler",
    "System",
    "SystemsError",
    "Table",
    "Tides",
    "TimeTransformed",
    "Trajectory",
    "Transit",
    "UnitSystem",
    "UnknownNameError",
    "Verification",
    "WallTimeOver",
    "WisdomHolman",
    "ZonalHarmonics",
    "__version__",
    "asteroids",
    "certify",
    "compare",
    "from_rebound",
    "kepler_flow",
    "kernel",
    "march",
    "megno",
    "propagate",
    "read_mpcorb",
    "read_sbdb",
    "residuals",
    "resume",
    "run_from_rebound",
    "shadow_energy",
    "solar_model",
    "state_transition",
    "to_rebound",
    "verify",
    "view",
]

_HOME = {
    "archive": ["Archive"],
    "certificate": ["Certificate", "certify"],
    "elements.kepler_flow": ["kepler_flow"],
    "ephemeris": ["asteroids", "read_mpcorb", "read_sbdb"],
    "errors": [
        "ArchiveError",
        "ConvergenceError",
        "EpochError",
        "EventError",
        "EventWarning",
        "InputError",
        "IntegrationError",
        "Interrupted",
        "MissingPackageError",
        "OrbitsError",
        "OrbitsWarning",
        "OutOfRangeError",
        "OutOfTime",
        "RetiredWarning",
        "SingularityError",
        "StepWarning",
        "StorageError",
        "SystemsError",
        "UnknownNameError",
    ],
    "forces.damping": ["Damping"],
    "forces.drag": ["Drag"],
    "forces.gas_drag": ["GasDrag"],
    "forces.mass_loss": ["MassLoss"],
    "forces.non_gravitational": ["NonGravitational"],
    "forces.radiation_pressure": ["RadiationPressure"],
    "forces.tides": ["Tides"],
    "integrators.composition": ["Composition"],
    "integrators.explicit_euler": ["ExplicitEuler"],
    "marching.clocks.adaptive": ["Adaptive"],
    "marching.flow": ["DiscretePath", "Flow", "march"],
    "marching.clocks.transformed": ["TimeTransformed"],
    "integrators.gauss": ["Gauss"],
    "integrators.implicit_midpoint": ["ImplicitMidpoint"],
    "integrators.lie_group_variational": ["LieGroupVariational"],
    "integrators.lobatto": ["LobattoIIIAB", "LobattoIIIBA"],
    "integrators.rattle": ["Rattle"],
    "integrators.runge_kutta_4": ["RungeKutta4"],
    "integrators.saba": ["SABA"],
    "integrators.stormer_verlet": ["StormerVerlet"],
    "integrators.symplectic_euler": ["SymplecticEuler"],
    "integrators.vprk": ["VPRK"],
    "integrators.wisdom_holman": ["WisdomHolman"],
    "kernels.compile": ["kernel"],
    "lagrangians.base": ["Lagrangian", "Motion"],
    "lagrangians.symmetry": ["Symmetry"],
    "lagrangians.terms.degree_two": ["DegreeTwo"],
    "lagrangians.terms.frame_dragging": ["FrameDragging"],
    "lagrangians.terms.minor_bodies": ["MinorBodies"],
    "lagrangians.terms.nobili_roxburgh": ["NobiliRoxburgh"],
    "lagrangians.terms.post_newtonian": ["PostNewtonian"],
    "lagrangians.terms.zonal_harmonics": ["ZonalHarmonics"],
    "propagation": ["Trajectory", "propagate", "resume"],
    "propagation.collisions.merge_and_bounce": ["Bounce", "Merge"],
    "propagation.events.kinds.collision": ["Collision"],
    "propagation.events.base": ["Action", "Happening"],
    "propagation.events.kinds.of_pairs": ["Apocentre", "CloseApproach", "Pericentre"],
    "propagation.events.kinds.orbital": ["Ejection", "ElementCrossing"],
    "propagation.events.kinds.own": ["Event"],
    "propagation.events.kinds.planes": ["NodeCrossing", "PlaneCrossing"],
    "propagation.events.kinds.from_observer": ["Conjunction", "Occultation", "Opposition", "Transit"],
    "regression": ["compare", "from_rebound", "residuals", "run_from_rebound", "to_rebound"],
    "propagation.control.heartbeat": ["Heartbeat"],
    "propagation.results.shadow_energy": ["shadow_energy"],
    "propagation.control.stop_conditions": ["CloserThan", "EnergyErrorAbove", "FartherThan", "WallTimeOver"],
    "propagation.variations.megno": ["megno"],
    "propagation.variations.state_transition": ["state_transition"],
    "propagation.resuming.verification": ["Verification", "verify"],
    "scenario": ["Check", "Option", "Scenario", "Study", "StudyResult", "Table"],
    "system": ["System"],
    "system.rigid_body": ["RigidBody"],
    "system.solar.description": ["solar_model"],
    "units": ["DIMENSIONLESS", "SOLAR", "UnitSystem"],
    "viewing.view": ["view"],
}
_MODULE_OF = {name: module for module, names in _HOME.items() for name in names}


def __getattr__(name: str) -> Any:
    """Load a public name, or a submodule, on first use."""
    if name in _MODULE_OF:
        value = getattr(importlib.import_module(f"orbits.{_MODULE_OF[name]}"), name)
        globals()[name] = value
        return value
    if not name.startswith("_") and importlib.util.find_spec(f"orbits.{name}") is not None:
        return importlib.import_module(f"orbits.{name}")  # the import system sets it as an attribute
    from orbits.elsewhere import public_name_hint

    hint = "." if name.startswith("_") else public_name_hint(name, __all__)
    raise AttributeError(f"module 'orbits' has no attribute {name!r}{hint} Its public names are {', '.join(__all__)}")


def __dir__() -> list[str]:
    """Return the public names, the submodules and the module attributes, without the imports of this file."""
    submodules = {found.name for found in pkgutil.iter_modules(__path__) if not found.name.startswith("_")}
    return sorted({*__all__, *submodules, *(name for name in globals() if name.startswith("__"))})
