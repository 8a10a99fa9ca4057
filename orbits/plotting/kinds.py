"""The kinds of pictures that `run.plot(kind=...)` draws."""

from __future__ import annotations

import difflib
import inspect
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from orbits.errors import InputError, UnknownNameError, shown
from orbits.plotting.errors_over_time import plot_energy, plot_error
from orbits.plotting.over_time import plot_elements, plot_phase
from orbits.plotting.pictures import plot_trajectory
from orbits.plotting.resonances import plot_resonance
from orbits.plotting.rotation import plot_rotation

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from orbits.protocols import Run

KINDS: Mapping[str, Callable[..., Any]] = {
    "paths": plot_trajectory,
    "elements": plot_elements,
    "phase": plot_phase,
    "resonance": plot_resonance,
    "error": plot_error,
    "energy": plot_energy,
    "rotation": plot_rotation,
}
"""The function that draws each kind."""


def plot_run(run: Run, kind: str = "paths", **options: Any) -> Figure:
    """Return a picture of a run.

    kind : "paths", the orbits from above and what is conserved; "elements", a, e and the inclination against time, or
        others, elements=("a", "pomega"); "phase", (e cos pomega, e sin pomega) and (a, e); "resonance", the angles of
        a resonance, resonance="3:1", with a planet, planet="Jupiter"; "error", how energy, angular momentum and
        positions depart, on logarithmic axes; "energy", the departures of energy and angular momentum with their signs;
        "rotation", how a rigid body turns, body="Hyperion", about="Saturn"
    options : bodies, title and frame, and those of the kind: see the functions in `orbits.plotting`

    Raises UnknownNameError for another kind, InputError for options that it does not take and for a run of which there
    is no such picture.
    """
    if not isinstance(kind, str) or kind not in KINDS:
        close = difflib.get_close_matches(str(kind).lower(), KINDS, n=1)
        hint = f" Did you mean {close[0]!r}?" if close else ""
        raise UnknownNameError(f"kind is {shown(kind)}; expected one of {', '.join(map(repr, KINDS))}.{hint}")
    draw = KINDS[kind]
    known = [name for name in inspect.signature(draw).parameters if name != "run"]
    for name in options:
        if name not in known:
            raise InputError(f"kind={kind!r} takes no {name}; it takes {', '.join(known)}.")
    figure: Figure = draw(run, **options)
    return figure
