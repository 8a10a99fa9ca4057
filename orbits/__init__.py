"""Variational integrators for gravitational N-body problems.

    import orbits
    from astropy import units as u

    system = orbits.System.solar_system()
    run = orbits.propagate(system, orbits.Gauss(stages=8), dt=6 * u.day, duration=1000 * u.yr)

Public names and submodules (`orbits.diagnostics`, `orbits.elements`, ...) are loaded on first use: `import orbits`
itself compiles nothing and imports no heavy packages.
"""

from __future__ import annotations

import gc
import importlib
import importlib.util
from typing import TYPE_CHECKING, Any

from orbits._version import __version__

if TYPE_CHECKING:
    from orbits import errors as errors
    from orbits import events as events
    from orbits import methods as methods
    from orbits import rebound as rebound
    from orbits import scenarios as scenarios
    from orbits import terms as terms
    from orbits.archive import Archive
    from orbits.astrometry.observations import Observations
    from orbits.certificate import Certificate, certify
    from orbits.elements.kepler_flow import kepler_flow
    from orbits.ephemeris import asteroids, read_mpcorb, read_sbdb
    from orbits.fitting.fitted_orbit import fit
    from orbits.integrators.gauss import Gauss
    from orbits.integrators.stormer_verlet import StormerVerlet
    from orbits.integrators.wisdom_holman import WisdomHolman
    from orbits.kernels.compile import kernel
    from orbits.lagrangians.base import Lagrangian, Motion
    from orbits.lagrangians.symmetry import Symmetry
    from orbits.marching.clocks.adaptive import Adaptive
    from orbits.marching.clocks.transformed import TimeTransformed
    from orbits.marching.flow import DiscretePath, Flow, march
    from orbits.observing.line_of_sight import along
    from orbits.observing.measured import RadialVelocities, TransitTimes
    from orbits.propagation import Trajectory, propagate, resume
    from orbits.propagation.control.heartbeat import Heartbeat
    from orbits.propagation.results.shadow_energy import shadow_energy
    from orbits.propagation.resuming.verification import Verification, verify
    from orbits.propagation.variations.encounters import entry, target_plane
    from orbits.propagation.variations.megno import megno
    from orbits.propagation.variations.state_transition import state_transition
    from orbits.regression import compare, residuals
    from orbits.results.moid import moid
    from orbits.system import System
    from orbits.system.rigid_body import RigidBody
    from orbits.system.solar.description import solar_model
    from orbits.units import DIMENSIONLESS, SOLAR, UnitSystem
    from orbits.viewing.view import view

__all__ = [
    "DIMENSIONLESS",
    "SOLAR",
    "Adaptive",
    "Archive",
    "Certificate",
    "DiscretePath",
    "Flow",
    "Gauss",
    "Heartbeat",
    "Lagrangian",
    "Motion",
    "Observations",
    "RadialVelocities",
    "RigidBody",
    "StormerVerlet",
    "Symmetry",
    "System",
    "TimeTransformed",
    "Trajectory",
    "TransitTimes",
    "UnitSystem",
    "Verification",
    "WisdomHolman",
    "__version__",
    "along",
    "asteroids",
    "certify",
    "compare",
    "entry",
    "fit",
    "kepler_flow",
    "kernel",
    "march",
    "megno",
    "moid",
    "propagate",
    "read_mpcorb",
    "read_sbdb",
    "residuals",
    "resume",
    "shadow_energy",
    "solar_model",
    "state_transition",
    "target_plane",
    "verify",
    "view",
]

_HOME = {
    "archive": ["Archive"],
    "certificate": ["Certificate", "certify"],
    "elements.kepler_flow": ["kepler_flow"],
    "ephemeris": ["asteroids", "read_mpcorb", "read_sbdb"],
    "fitting.fitted_orbit": ["fit"],
    "astrometry.observations": ["Observations"],
    "integrators.gauss": ["Gauss"],
    "integrators.stormer_verlet": ["StormerVerlet"],
    "integrators.wisdom_holman": ["WisdomHolman"],
    "kernels.compile": ["kernel"],
    "lagrangians.base": ["Lagrangian", "Motion"],
    "lagrangians.symmetry": ["Symmetry"],
    "marching.clocks.adaptive": ["Adaptive"],
    "marching.clocks.transformed": ["TimeTransformed"],
    "marching.flow": ["DiscretePath", "Flow", "march"],
    "observing.line_of_sight": ["along"],
    "observing.measured": ["RadialVelocities", "TransitTimes"],
    "propagation": ["Trajectory", "propagate", "resume"],
    "propagation.control.heartbeat": ["Heartbeat"],
    "propagation.results.shadow_energy": ["shadow_energy"],
    "propagation.resuming.verification": ["Verification", "verify"],
    "propagation.variations.encounters": ["entry", "target_plane"],
    "propagation.variations.megno": ["megno"],
    "propagation.variations.state_transition": ["state_transition"],
    "regression": ["compare", "residuals"],
    "results.moid": ["moid"],
    "system": ["System"],
    "system.rigid_body": ["RigidBody"],
    "system.solar.description": ["solar_model"],
    "units": ["DIMENSIONLESS", "SOLAR", "UnitSystem"],
    "viewing.view": ["view"],
}
_MODULE_OF = {name: module for module, names in _HOME.items() for name in names}


_SPACES = ("errors", "events", "methods", "rebound", "scenarios", "terms")
"""The namespaces of public names."""

_PARTS = (
    "diagnostics",
    "discrete",
    "elements",
    "ensemble",
    "ephemeris",
    "lagrangians",
    "plotting",
    "rotations",
    "spin_orbit",
)
"""The public submodules besides them."""


def __getattr__(name: str) -> Any:
    """Load a public name, or a submodule, on first use."""
    if name in _MODULE_OF:
        collects = gc.isenabled()
        gc.disable()  # what modules make lives on: looking for garbage among it takes a fifth of the time of loading
        try:
            value = getattr(importlib.import_module(f"orbits.{_MODULE_OF[name]}"), name)
        finally:
            if collects:
                gc.enable()
        globals()[name] = value
        return value
    if not name.startswith("_") and importlib.util.find_spec(f"orbits.{name}") is not None:
        return importlib.import_module(f"orbits.{name}")  # the import system sets it as an attribute
    from orbits.elsewhere import public_name_hint

    hint = "." if name.startswith("_") else public_name_hint(name, __all__, _in_spaces())
    names = ", ".join([*__all__, *_SPACES])
    raise AttributeError(f"module 'orbits' has no attribute {name!r}{hint} Its public names are {names}")


def _in_spaces() -> dict[str, str]:
    """Return where the names of the namespaces are that `orbits` does not have, without loading what is in them."""
    import ast
    from pathlib import Path

    found: dict[str, str] = {}
    for space in _SPACES:
        for node in ast.parse(Path(__file__).with_name(f"{space}.py").read_text(encoding="utf-8")).body:
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
                found |= {name: f"orbits.{space}.{name}" for name in ast.literal_eval(node.value)}
    return {name: there for name, there in found.items() if name not in __all__}


def __dir__() -> list[str]:
    """Return the public names, namespaces and submodules, and the module attributes, without what is internal."""
    return sorted({*__all__, *_SPACES, *_PARTS, *(name for name in globals() if name.startswith("__"))})
