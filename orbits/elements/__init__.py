"""Keplerian elements, the two-body flow and the frames they refer to. Floats in, floats out, whole arrays at once.

    q, v = state_from_elements(gm, a=2.77, e=0.08, inc=0.18, Omega=1.4, omega=1.3, M=5.8)
    elements = elements_from_state(q, v, gm);  elements.a, elements.pomega, ...
    q, v = two_body(q, v, gm, dt)

Units are consistent ones of your choice, angles are radians. `Elements` defines the degenerate cases.
"""

from __future__ import annotations

from orbits.elements.frames import (
    FRAMES,
    OBLIQUITY,
    default_frame,
    ecliptic_to_icrf,
    from_frame,
    icrf_to_ecliptic,
    to_frame,
)
from orbits.elements.osculating import Elements, elements_from_state
from orbits.elements.states_from_elements import state_from_elements
from orbits.elements.two_body import two_body

__all__ = [
    "FRAMES",
    "OBLIQUITY",
    "Elements",
    "default_frame",
    "ecliptic_to_icrf",
    "elements_from_state",
    "from_frame",
    "icrf_to_ecliptic",
    "state_from_elements",
    "to_frame",
    "two_body",
]


def __dir__() -> list[str]:
    """Return the public names."""
    return __all__
