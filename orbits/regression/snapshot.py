"""The content of a REBOUND simulation as plain values; files are read in a separate process.

REBOUND does not check its files: a damaged one can crash the process that opens it. Files are therefore opened by a
child process, which runs this module as a script and returns numbers. It imports nothing of this package.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MAGIC = b"REBOUND Binary File. Version: "
EVERY_BODY = int(np.iinfo(np.uintp).max)
"""REBOUND's N_active when all particles attract."""

SECONDS = 60.0
BYTES_A_SECOND = 2e6
CHILD_MEMORY = 8 * 2**30
"""A child process that needs longer, or more memory, is reading a damaged file."""

ATTEMPTS = 8

SAME_TIME = 1e-9
"""A snapshot matches a requested time if they differ by at most this fraction of the archive's span."""

DAMAGE = ("corrupted", "does not match", "not match particle number")


class Particles(NamedTuple):
    """A simulation at one time, in its own units.

    m, r : (n,);  q, v : (n, 3);  names : None for a particle without
    active : number of attracting particles, which come first;  test_type : REBOUND's testparticle_type
    units : names of the units of length, time and mass, or None if they are not set
    variations : number of variational particles
    functions : functions of the user that affect the motion
    forgotten : whether it was saved with functions, which files do not contain
    """

    m: Array
    r: Array
    q: Array
    v: Array
    names: tuple[str | None, ...]
    t: float
    dt: float
    G: float
    softening: float
    active: int
    test_type: int
    units: tuple[str, str, str] | None
    integrator: str
    gravity: str
    boundary: str
    collision: str
    variations: int
    functions: tuple[str, ...]
    forgotten: bool = False


ARRAYS = ("m", "r", "q", "v")
THE_SAME = ("m", "names", "G", "softening", "active", "test_type", "units", "boundary", "variations")
"""Values that do not change during a run."""

PLAIN = tuple(field for field in Particles._fields if field not in ARRAYS)
FUNCTIONS = ("additional_forces", "pre_timestep_modifications", "post_timestep_modifications")


class UnreadableError(Exception):
    """A file, or a snapshot of it, that cannot be read; the message says why."""


def of_simulation(sim: Any, *, forgotten: bool = False) -> Particles:
    """Return the content of a simulation. If it is not synchronized, a copy is; the simulation is not changed."""
    if not sim.is_synchronized:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of functions that the copy does not have
            copy = sim.copy()
        copy.integrator.keep_unsynchronized = 0
        copy.synchronize()
    else:
        copy = sim
    n = int(sim.N)
    m, r, q, v = np.empty(n), np.empty(n), np.empty((n, 3)), np.empty((n, 3))
    if n:
        copy.serialize_particle_data(m=m, r=r, xyz=q, vxvyvz=v)
    units = tuple(sim.units[kind] for kind in ("length", "time", "mass"))
    return Particles(
        *(m, r, q, v),
        names=tuple(_name(particle) for particle in sim.particles[:n]),
        t=float(sim.t),
        dt=float(sim.dt),
        G=float(sim.G),
        softening=float(sim.softening),
        active=n if int(sim.N_active) == EVERY_BODY else min(int(sim.N_active), n),
        test_type=int(sim.testparticle_type),
        units=units if all(units) else None,
        integrator=str(sim.integrator),
        gravity=str(sim.gravity),
        boundary=str(sim.boundary),
        collision=str(sim.collision),
        variations=int(sim.N_var),
        functions=tuple(name for name in FUNCTIONS if getattr(sim, f"_{name}")),
        forgotten=forgotten,
    )


def of_archive(archive: Any, *, index: int = -1, time: float | None = None) -> Particles:
    """Return a snapshot of an opened Simulationarchive. Raises UnreadableError if it is missing or damaged."""
    times = np.ctypeslib.as_array(archive.t, (len(archive),))
    if time is not None:
        index = _at(times, time)
    if not -len(times) <= index < len(times):
        raise UnreadableError(f"it has {len(times)} snapshots, so there is no snapshot {index}")
    with _messages() as said:
        sim = _loaded(archive, index)
    return of_simulation(sim, forgotten=any("function pointers" in message for message in said))


def of_opened(archive: Any, *, index: int = -1, time: float | None = None) -> Particles:
    """Return a snapshot of a Simulationarchive of the caller: from its file, if it has one."""
    path = _file_of(archive)
    if path is None or (time is None and not -len(archive) <= index < len(archive)):
        return of_archive(archive, index=index, time=time)
    return of_file(path, index=index if time is not None else index % len(archive), time=time)


def all_of_opened(archive: Any) -> tuple[Particles, Array, Array, Array]:
    """Return `all_of_archive` of an archive of the caller: from its file, if it has one, which may have grown."""
    path = _file_of(archive)
    if path is None:
        return all_of_archive(archive)
    first, *arrays = all_of_file(path)
    times, q, v = (array[: len(archive)] for array in arrays)
    return first, times, q, v


def all_of_archive(archive: Any) -> tuple[Particles, Array, Array, Array]:
    """Return the first snapshot, and times (n,), positions and velocities (n, particles, 3) of all.

    Raises UnreadableError if particles differ from those of the first snapshot, or times are not monotonic.
    """
    first = of_archive(archive, index=0)
    times = np.ctypeslib.as_array(archive.t, (len(archive),)).copy()
    turn = np.flatnonzero(np.diff(times) * np.sign(times[-1] - times[0]) <= 0.0)
    if turn.size:
        k = int(turn[0])
        raise UnreadableError(
            f"t goes from {float(times[k])!r} to {float(times[k + 1])!r} between snapshots {k} and {k + 1}; expected "
            "times in order"
        )
    q, v = np.empty((2, len(times), *first.q.shape))
    q[0], v[0] = first.q, first.v
    for k in range(1, len(times)):
        found = of_archive(archive, index=k)
        if not all(np.array_equal(getattr(found, key), getattr(first, key)) for key in THE_SAME):
            raise UnreadableError(f"particles, their masses or G change between snapshots 0 and {k}, as a run cannot")
        q[k], v[k] = found.q, found.v
    return first, times, q, v


def of_file(path: str | os.PathLike[str], *, index: int = -1, time: float | None = None) -> Particles:
    """Return a snapshot of a file, which is opened in a child process. Raises UnreadableError."""
    return _by_child(path, {"index": index, "time": time})[0]


def all_of_file(path: str | os.PathLike[str]) -> tuple[Particles, Array, Array, Array]:
    """Return `all_of_archive` of a file, which is opened in a child process. Raises UnreadableError."""
    first, found = _by_child(path, None)
    return first, found["all_t"], found["all_q"], found["all_v"]


def _by_child(path: str | os.PathLike[str], which: dict[str, Any] | None) -> tuple[Particles, dict[str, Array]]:
    place = Path(path)
    try:
        with place.open("rb") as file:
            begin = file.read(len(MAGIC))
        size = place.stat().st_size
    except (OSError, ValueError) as error:  # ValueError: no path at all, such as one with a null character
        raise UnreadableError(f"it cannot be read ({getattr(error, 'strerror', None) or error})") from error
    if begin != MAGIC:
        raise UnreadableError("it is no Simulationarchive of REBOUND, which begins with its name and version")
    with tempfile.TemporaryDirectory() as folder:
        # REBOUND takes paths in ASCII only.
        link, result = Path(folder) / "archive.bin", Path(folder) / "particles.npz"
        link.symlink_to(place.resolve())
        try:
            child = subprocess.run(
                [sys.executable, "-P", __file__, str(link), str(result), json.dumps(which)],
                env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
                capture_output=True,
                timeout=SECONDS + size / BYTES_A_SECOND,
                check=False,
            )
        except subprocess.TimeoutExpired as error:
            raise UnreadableError(f"REBOUND did not come to an end of it in {error.timeout:.0f} s") from error
        if child.returncode or not result.exists():
            raise UnreadableError(f"REBOUND crashed reading it (status {child.returncode}): it is damaged")
        with np.load(result) as found:
            known = json.loads(found["plain"].item())
            if "error" in known:
                raise UnreadableError(known["error"])
            arrays = {key: found[key] for key in found.files if key != "plain"}
    values: dict[str, Any] = {key: arrays.pop(key) for key in ARRAYS}
    values |= {key: tuple(known[key]) if isinstance(known[key], list) else known[key] for key in PLAIN}
    return Particles(**values), arrays


def _loaded(archive: Any, index: int) -> Any:
    """Return a snapshot as a simulation with reliable names.

    REBOUND 5.2 restores names by the addresses that they had in the process that saved them, and confuses two if a new
    name happens to be at such an address. As long as a simulation is kept, the next one has other addresses, so two
    successive ones that agree are correct.
    """
    kept = [archive[index]]
    for _ in range(ATTEMPTS):
        kept.append(archive[index])
        if [_name(p) for p in kept[-1].particles] == [_name(p) for p in kept[-2].particles]:
            return kept[-1]
    raise UnreadableError("REBOUND gives its particles other names each time; expected a file, opened by its path")


def _file_of(archive: Any) -> str | None:
    path = os.fsdecode(archive._filename) if archive._filename else ""
    return path if os.path.isfile(path) else None


def _at(times: Array, time: float) -> int:
    """Return the snapshot at a time."""
    nearest = int(np.argmin(np.abs(times - time)))
    if not abs(times[nearest] - time) <= SAME_TIME * float(np.ptp(times)):
        raise UnreadableError(
            f"it has no snapshot at t = {time!r}; the nearest is snapshot {nearest}, at t = {float(times[nearest])!r}"
        )
    return nearest


def _name(particle: Any) -> str | None:
    try:
        name: str | None = particle.name
    except UnicodeDecodeError:
        raise UnreadableError("it has a particle whose name is no text") from None
    return name


@contextlib.contextmanager
def _messages() -> Iterator[list[str]]:
    """Collect REBOUND's warnings. Raises UnreadableError for damage."""
    said: list[str] = []
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            yield said
    # REBOUND raises RuntimeError, AttributeError, ValueError and others for what it cannot make sense of.
    except UnreadableError:
        raise
    except Exception as error:
        raise UnreadableError(f"REBOUND cannot read it ({str(error).strip().rstrip('.')})") from error
    said += [str(warning.message) for warning in caught]
    for message in said:
        if any(sign in message for sign in DAMAGE):
            raise UnreadableError(
                f"it is damaged: REBOUND says {message.rstrip('.')!r}. For what is whole take a "
                "simulation from rebound.Simulationarchive(path), check it and its names and give that"
            )


def _child(path: str, result: str, which: str) -> None:
    """Read a snapshot and write it to a file for the parent process."""
    with contextlib.suppress(ImportError):
        import resource

        limit = CHILD_MEMORY + 20 * os.path.getsize(path)
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    chosen = json.loads(which)
    more: dict[str, Array] = {}
    try:
        import rebound

        with _messages():
            archive = rebound.Simulationarchive(path, process_warnings=True)
        major = int(archive._reb_version_major)
        if major != int(rebound.__version__.partition(".")[0]):
            raise UnreadableError(
                f"it was written by REBOUND {major}, and {rebound.__version__} is installed, which may read it "
                "wrongly. Open it with the version that wrote it, or check rebound.Simulation(path) and give that"
            )
        if chosen is None:
            first, more["all_t"], more["all_q"], more["all_v"] = all_of_archive(archive)
            found = first._asdict()
        else:
            found = of_archive(archive, **chosen)._asdict()
    except UnreadableError as error:
        found = {**dict.fromkeys(ARRAYS, np.empty(0)), "error": str(error)}
    arrays = {key: found.pop(key) for key in ARRAYS}
    everything: dict[str, Any] = {"plain": np.array(json.dumps(found)), **arrays, **more}
    np.savez(result, **everything)


if __name__ == "__main__":
    _child(*sys.argv[1:])
