"""REBOUND built from source for this processor, in a process of its own: the wheel is compiled for any x86-64.

It is built once, into the virtual environment, from PyPI's source distribution of the installed version; or any other
installation of it is taken, `Native.folder`.
"""

from __future__ import annotations

import importlib.metadata
import os
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from orbits.point_masses import PointMasses

Array = NDArray[np.float64]

SCRIPTS = Path(__file__).resolve().parent.parent
FOLDER = Path(sys.prefix) / "rebound-native"
FLAGS = "-O3 -march=native"


def how_built() -> str:
    """Return what the second REBOUND is, in words."""
    if Native.folder != FOLDER:
        return f"the installation in {Native.folder.name}"
    compiler = subprocess.run(["cc", "--version"], capture_output=True, text=True, check=False).stdout.split("\n")[0]
    return f"{compiler}, {FLAGS}"


def ias15(gm: Array, q: Array, v: Array, span: float, epsilon: float | None = None) -> tuple[float, Array, int]:
    """Return (seconds, positions at `span`, steps) of REBOUND's IAS15; epsilon None is its default."""
    return peer("ias15", gm, q, v, span, epsilon)


def peer(
    name: str, gm: Array, q: Array, v: Array, span: float, epsilon: float | None = None, dt: float | None = None
) -> tuple[float, Array, int]:
    """The same for any of REBOUND's integrators, with a first or constant step of `dt`."""
    import time

    from orbits.regression.peers import simulation

    simulated = simulation(PointMasses(gm, q, v))
    simulated.integrator = name
    if epsilon is not None:
        simulated.integrator.epsilon = epsilon
    simulated.dt = 1e-3 * span if dt is None else dt
    begun = time.perf_counter()
    simulated.integrate(span, exact_finish_time=1)
    seconds, end = time.perf_counter() - begun, np.empty_like(q)
    simulated.serialize_particle_data(xyz=end)
    return seconds, end, int(simulated.steps_done)


def planets(
    name: str, options: dict[str, Any], gm: Array, q: Array, v: Array, dt: float, steps: int
) -> tuple[float, Array]:
    """Return (seconds, positions) of `steps` steps of one of REBOUND's maps on Kepler orbits.

    options : attributes of the integrator; WHFast is not synchronized in between
    """
    import time

    from orbits.regression.peers import arithmetic_kept, simulation

    simulated = simulation(PointMasses(gm, q, v))
    simulated.integrator, simulated.dt = name, dt
    for option, value in options.items():
        setattr(simulated.integrator, option, value)
    begun = time.perf_counter()
    if name == "whfast512":  # it ends after whole bundles of steps
        simulated.integrator.concatenate_steps = steps
        with arithmetic_kept():
            simulated.integrate((steps - 0.5) * dt, exact_finish_time=0)
    else:
        simulated.integrator.safe_mode = 0
        simulated.steps(steps)
        simulated.synchronize()
    seconds, end = time.perf_counter() - begun, np.empty_like(q)
    assert abs(simulated.t - steps * dt) < 0.1 * dt
    simulated.serialize_particle_data(xyz=end)
    return seconds, end


class Native:
    """A process that runs REBOUND as built for this processor; None from `start` where it cannot be built.

    folder : where that installation is, or where it is made
    """

    folder: ClassVar[Path] = FOLDER

    def __init__(self, process: subprocess.Popen[bytes]) -> None:
        self._process = process

    @classmethod
    def start(cls) -> Native | None:
        """Build it if that was not done before, and start the process."""
        version = importlib.metadata.version("rebound")
        if cls.folder == FOLDER and not (FOLDER / f"rebound-{version}.dist-info").is_dir():
            # pip keeps what it has built, whatever the flags were.
            what = ["install", "--quiet", "--no-deps", "--no-cache-dir", "--no-binary", "rebound"]
            command = [sys.executable, "-m", "pip", *what, "--target", str(FOLDER), f"rebound=={version}"]
            if subprocess.run(command, env={**os.environ, "CFLAGS": FLAGS}, check=False).returncode:
                return None
        paths = os.pathsep.join([str(cls.folder), str(SCRIPTS), str(SCRIPTS.parent)])
        command = [sys.executable, "-c", f"from benchmarks.native import serve; serve({str(cls.folder)!r})"]
        pipe = subprocess.PIPE
        process = subprocess.Popen(command, stdin=pipe, stdout=pipe, env={**os.environ, "PYTHONPATH": paths})
        return cls(process)

    def __call__(self, *arguments: Any) -> tuple[float, Array, int]:
        """Return what `peer` returns there."""
        answer: tuple[float, Array, int] = self._ask("peer", *arguments)
        return answer

    def planets(self, *arguments: Any) -> tuple[float, Array]:
        """Return what `planets` returns there."""
        answer: tuple[float, Array] = self._ask("planets", *arguments)
        return answer

    def _ask(self, what: str, *arguments: Any) -> Any:
        requests, answers = self._process.stdin, self._process.stdout
        assert requests is not None
        assert answers is not None
        pickle.dump((what, arguments), requests)
        requests.flush()
        return pickle.load(answers)

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


def serve(folder: str) -> None:
    """Answer requests from standard input until it ends, with the REBOUND of that folder."""
    import rebound

    assert Path(rebound.__file__).is_relative_to(Path(folder).resolve()), rebound.__file__
    answers, sys.stdout = sys.stdout.buffer, sys.stderr
    while True:
        try:
            what, arguments = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        pickle.dump({"peer": peer, "planets": planets}[what](*arguments), answers)
        answers.flush()
