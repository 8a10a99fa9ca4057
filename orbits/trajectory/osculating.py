"""The osculating elements of the bodies of a run, with the masses of its samples."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError
from orbits.system import OrbitalElements, osculating
from orbits.system.new_bodies import primary_name
from orbits.trajectory.parts import as_array
from orbits.trajectory.retired import absent

if TYPE_CHECKING:
    from orbits.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]


def elements_of(run: Trajectory, primary: str | None, frame: str) -> OrbitalElements:
    """Return the elements of all other bodies than the primary at all samples; see `Trajectory.elements`."""
    values = run.system.values
    there, gm = _common_masses(run)
    names = tuple(name for name, stays in zip(run.names, there, strict=True) if stays)
    primary = primary_name(names, gm, primary)
    q, v = (as_array(x) if there.all() else as_array(x)[:, there] for x in (run._q, run._v))
    gone = None
    if len(run.retired):
        gone = absent(q, v, run.system.massive[there])
        q, v = (np.where(gone[..., None], x, y) for x, y in ((values.q[there], q), (values.v[there], v)))
    found = osculating(
        names,
        gm,
        q,
        v,
        units=run.system.units,
        primary=primary,
        frame=frame,
        t=run.times,
        epoch=run.system.epoch,
        forces=run.system.forces,
    )
    return found if gone is None else found.blank(gone[:, [names.index(name) for name in found.names]])


def _common_masses(run: Trajectory) -> tuple[NDArray[np.bool_], Array]:
    """Return which bodies are there at all samples, (bodies,), and their GM. Raises InputError if that changes."""
    there = np.ones(len(run.names), dtype=bool)
    if run.changes is None or not run.changes.acted_on_massive or not len(run):
        return there, run.system.values.gm
    bodies = run.changes.over(run.times)
    if (bodies.gm != bodies.gm[0]).any() or (bodies.present != bodies.present[0])[:, run.system.massive].any():
        raise InputError(
            "bodies merge, or masses change, between these samples, so that their elements have no common masses; "
            "take them sample by sample, run[k].elements(), or from samples between two changes, "
            "run[10:20].elements(); run.legs has the times of the changes."
        )
    there = bodies.present[0] | ~run.system.massive
    return there, bodies.gm[0, there]
