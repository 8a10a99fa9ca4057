"""REBOUND's integrators as peers: the same initial floats in, samples at the same times out.

Only this file steps REBOUND simulations. Everything is plain float64 in one system of units; masses are GM and G is 1,
so that no constant is multiplied in. Bodies are passed in order (the central one first, massive ones by orbital energy,
then massless ones as test particles), and the results are returned in the caller's order.

Fixed-step peers stay on t0 + k dt with exactly the step of this package; a sample off that grid is a partial step of a
copied simulation. WHFast and SABA run with `safe_mode = 0` and `keep_unsynchronized = 1`: REBOUND then synchronizes a
copy for each sample, and the run itself is not affected. WHFast512 takes all steps up to a sample at once
(`concatenate_steps`), and is synchronized there, which changes its last digits. MERCURIUS keeps its safe mode, without
which it does not continue from samples. IAS15 keeps its default epsilon and ends each interval exactly at the sample
(`exact_finish_time = 1`), as is common.

Wall time is the time within REBOUND's integrating calls (`Simulation.steps`, `Simulation.integrate`); setup and copying
of positions are not counted.

Source: Rein & Liu (2012), Rein & Spiegel (2015), Rein & Tamayo (2015), Rein, Tamayo & Brown (2019), Rein et al. (2019),
Javaheri et al. (2023), Lu, Hernandez & Rein (2024).
"""

from __future__ import annotations

import contextlib
import ctypes
import signal
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from time import perf_counter, thread_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.errors import IntegrationError, Interrupted, shown
from orbits.point_masses import PointMasses
from orbits.regression.peer_choice import Peer, lookup

Array = NDArray[np.float64]

MOST_IN_LANES = 9
"""Bodies that WHFast512 takes: a star, and eight planets in the lanes of a register."""


@dataclass(frozen=True)
class PeerRun:
    """What a peer reached.

    q, v : (samples, bodies, 3) float64, in the caller's units and order of bodies
    steps : steps that REBOUND took; partial steps of a copy to samples off the grid do not count
    wall_s : seconds inside REBOUND's integrating calls
    warnings : what REBOUND warned about, each sentence once
    """

    q: Array
    v: Array
    steps: int
    wall_s: float
    warnings: tuple[str, ...] = field(default=())


def order_of_bodies(gm: Array, q: Array, v: Array) -> NDArray[np.intp]:
    """The order in which bodies are given to REBOUND: indices, shape (bodies,).

    The most massive body first; then the other massive ones by their orbital energy about it, lowest first, which is by
    semi-major axis (Jacobi coordinates are meant to be nested outwards); then the massless ones as they come.
    """
    central = int(np.argmax(gm))
    dq, dv = q - q[central], v - v[central]
    with np.errstate(divide="ignore"):
        energy = 0.5 * np.sum(dv * dv, axis=1) - (gm[central] + gm) / np.sqrt(np.sum(dq * dq, axis=1))
    massive = np.flatnonzero(gm > 0)
    others = massive[massive != central]
    others = others[np.argsort(energy[others], kind="stable")]
    return np.concatenate(([central], others, np.flatnonzero(gm == 0))).astype(np.intp)


def unsuited(peer: Peer, gm: Array, softening: float) -> str | None:
    """Why `peer` cannot do this problem, in words, or None when it can."""
    if not peer.keplerian:
        return None
    if softening != 0.0:
        return "its Kepler orbits are unsoftened, and this system has a softening length"
    massive = np.sort(gm[gm > 0])
    if massive.size > 2 and massive[-1] <= massive[:-1].sum():
        return "it needs one body that outweighs all the others together, and this system has none"
    return _unsuited_in_lanes(gm) if peer.bundles_steps else None


def _unsuited_in_lanes(gm: Array) -> str | None:
    """Why WHFast512 cannot do this problem, on this machine."""
    import rebound

    if not rebound.avx512_available:
        return "it needs a processor with AVX-512, and this one has none"
    massless = int(np.count_nonzero(gm == 0))
    if massless:
        return f"it takes no massless bodies, and this system has {massless:,}"
    if len(gm) > MOST_IN_LANES:
        return f"it takes at most {MOST_IN_LANES} bodies, and this system has {len(gm):,}"
    return None


def simulation(start: PointMasses, names: Sequence[str] | None = None) -> Any:
    """A `rebound.Simulation` with exactly these floats: G = 1, masses GM, massless bodies as test particles.

    start : in the order in which REBOUND gets them, massive bodies first. The floats in the simulation are compared
        with these bit for bit; `IntegrationError` if any differs.
    """
    import rebound

    gm, q, v, softening = start
    sim = rebound.Simulation()
    sim.G = 1.0
    sim.softening = softening
    for i, (m, (x, y, z), (vx, vy, vz)) in enumerate(zip(gm.tolist(), q.tolist(), v.tolist(), strict=True)):
        sim.add(m=m, x=x, y=y, z=z, vx=vx, vy=vy, vz=vz, name=names[i] if names else None)
    active = int(np.count_nonzero(gm))
    if active < len(gm):
        sim.N_active = active
        sim.testparticle_type = 0
    m_out, q_out, v_out = np.empty(len(gm)), np.empty((len(gm), 3)), np.empty((len(gm), 3))
    sim.serialize_particle_data(m=m_out, xyz=q_out, vxvyvz=v_out)
    for what, ours, theirs in (("gm", gm, m_out), ("q", q, q_out), ("v", v, v_out)):
        if ours.tobytes() != theirs.tobytes():
            raise IntegrationError(f"REBOUND holds other initial values of {what} than it was given; nothing compared.")
    return sim


def grid_position(t: float, dt: float) -> tuple[int, float]:
    """Whole steps of length dt > 0 that fit in |t|, and what is left: (k, |t| - k dt), with 0 <= rest < dt."""
    k = int(abs(t) / dt)
    while k * dt > abs(t):
        k -= 1
    while (k + 1) * dt <= abs(t):
        k += 1
    return k, abs(t) - k * dt


def run(
    name: str,
    bodies: PointMasses,
    *,
    times: Array,
    dt: float,
    reached: Callable[[float, int], None] = lambda time, steps: None,
    halves: bool = False,
) -> PeerRun:
    """Integrate with the peer `name`, such as "whfast:kernel=lazy,corrector=17", and sample it at `times`.

    times (samples,) : from the epoch, all of one sign, in order of growing |t|
    dt : step of the fixed-step peers and first step that IAS15 tries, > 0
    reached : called after each sample with its time and the steps so far
    halves : whether each half of the massless bodies is integrated with the massive ones on a thread of its own; a peer
        that chooses steps then chooses them for each half. The massive bodies, and the steps, are those of the first
        half; the seconds are those of the processor in both.
    Raises InputError (no such peer or option), IntegrationError (REBOUND failed or the problem does not suit the peer),
    Interrupted (Ctrl-C).
    """
    peer = lookup(name)
    gm, q, v, softening = bodies
    reason = unsuited(peer, gm, softening)
    if reason:
        raise IntegrationError(f"{peer.label}: {reason}.")
    order = order_of_bodies(gm, q, v)
    start = PointMasses(gm[order], q[order], v[order], softening)
    with _handlers(peer) as caught:
        if halves:
            integrated = _in_halves(peer, start, times, dt, reached)
        else:
            integrated = _integrated(peer, start, times, dt, reached)
        q_seen, v_seen, steps, wall = integrated
        messages = tuple(dict.fromkeys(str(w.message) for w in caught))
    q_out, v_out = np.empty_like(q_seen), np.empty_like(v_seen)
    q_out[:, order], v_out[:, order] = q_seen, v_seen
    return PeerRun(q_out, v_out, steps, wall, messages)


def _integrated(
    peer: Peer,
    start: PointMasses,
    times: Array,
    dt: float,
    reached: Callable[[float, int], None],
    clock: Callable[[], float] = perf_counter,
) -> tuple[Array, Array, int, float]:
    """Return q and v at the samples, (samples, bodies, 3), the steps, and the seconds of a clock; see `run`."""
    backwards = bool(np.any(times < 0))
    sim = _configured(peer, start, -dt if backwards else dt)
    advancer = _on_grid(peer, sim, start, dt, backwards, clock) if peer.fixed_step else _adaptive(sim, clock)
    q, v = np.empty((2, len(times), *start.q.shape))
    steps, wall = 0, 0.0
    for i, t in enumerate(times.tolist()):
        source, more, seconds = advancer(t)
        steps += more
        wall += seconds
        source.serialize_particle_data(xyz=q[i], vxvyvz=v[i])
        if not np.all(np.isfinite(q[i])):
            raise IntegrationError(f"{peer.label}: positions are no longer finite at t = {shown(t)}.", time=t)
        reached(t, steps)
    return q, v, steps, wall


def _in_halves(
    peer: Peer, start: PointMasses, times: Array, dt: float, reached: Callable[[float, int], None]
) -> tuple[Array, Array, int, float]:
    """As `_integrated`, half of the massless bodies on another thread: REBOUND does without Python's lock."""
    active = int(np.count_nonzero(start.gm))
    middle = (active + len(start.gm)) // 2
    whole = np.arange(len(start.gm))
    first, second = (
        PointMasses(start.gm[part], start.q[part], start.v[part], start.softening)
        for part in (whole[:middle], np.concatenate((whole[:active], whole[middle:])))
    )
    ended = threading.Event()

    def unless_ended(time: float, steps: int) -> None:
        if ended.is_set():
            raise Interrupted("the other half has ended")

    with ThreadPoolExecutor(1) as other:
        later = other.submit(_integrated, peer, second, times, dt, unless_ended, thread_time)
        try:
            q, v, steps, wall = _integrated(peer, first, times, dt, reached, thread_time)
        except BaseException:
            ended.set()
            raise
        more_q, more_v, _, more_wall = later.result()
    joined = (np.concatenate((a, b[:, active:]), axis=1) for a, b in ((q, more_q), (v, more_v)))
    return *joined, steps, wall + more_wall  # type: ignore[return-value]


@contextlib.contextmanager
def arithmetic_kept() -> Iterator[None]:
    """Give the thread its floating-point mode back.

    WHFast512 of REBOUND 5.2 leaves one in which numbers below 2.2e-308 are zero, in all that is computed afterwards.
    """
    library, mode = ctypes.CDLL(None), ctypes.create_string_buffer(256)  # fenv_t has 32 bytes on x86-64
    library.fegetenv(mode)
    try:
        yield
    finally:
        library.fesetenv(mode)


# (t) -> the simulation that stands at t, the steps taken to get there, the seconds spent inside REBOUND
_Advancer = Callable[[float], "tuple[Any, int, float]"]


def _configured(peer: Peer, start: PointMasses, dt: float) -> Any:
    sim = simulation(start)
    sim.integrator = peer.integrator
    for option, value in peer.options:
        setattr(sim.integrator, option, value)
    sim.dt = dt
    if peer.bundles_steps:
        sim.exact_finish_time = 0  # it has no other
    return sim


def _take(peer: Peer, sim: Any, steps: int) -> None:
    if not peer.bundles_steps:
        sim.steps(steps)
        return
    sim.integrator.concatenate_steps = steps
    with arithmetic_kept():
        sim.steps(1)


def _on_grid(
    peer: Peer, sim: Any, start: PointMasses, dt: float, backwards: bool, clock: Callable[[], float]
) -> _Advancer:
    """Whole steps in `sim`; what is left over in a scratch simulation that is set to the state on the grid."""
    scratch = _configured(peer, start, dt)
    if "keep_unsynchronized" in dict(peer.options):
        # Set anew for each sample, it must start from its particles and end synchronized.
        scratch.integrator.keep_unsynchronized = 0
        scratch.integrator.safe_mode = 1
    q, v = np.empty_like(start.q), np.empty_like(start.v)
    done = 0

    def advance(t: float) -> tuple[Any, int, float]:
        nonlocal done
        k, rest = grid_position(t, dt)
        more, done = k - done, k
        wall = -clock()
        if more:
            _take(peer, sim, more)
        wall += clock()
        if rest == 0.0:
            return sim, more, wall
        sim.serialize_particle_data(xyz=q, vxvyvz=v)
        scratch.set_serialized_particle_data(xyz=q, vxvyvz=v)
        scratch.dt = -rest if backwards else rest
        wall -= clock()
        _take(peer, scratch, 1)
        wall += clock()
        return scratch, more, wall

    return advance


def _adaptive(sim: Any, clock: Callable[[], float]) -> _Advancer:
    def advance(t: float) -> tuple[Any, int, float]:
        before = int(sim.steps_done)
        wall = -clock()
        if t != sim.t:
            sim.integrate(t, exact_finish_time=1)
        wall += clock()
        return sim, int(sim.steps_done) - before, wall

    return advance


@contextlib.contextmanager
def _handlers(peer: Peer) -> Iterator[list[warnings.WarningMessage]]:
    """Collect REBOUND's warnings, turn its exceptions into ours, give SIGINT back to Python afterwards."""
    import rebound

    failures = (
        rebound.GenericError, rebound.Encounter, rebound.Escape, rebound.Collision, rebound.NoParticles, RuntimeError,
    )  # fmt: skip
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            yield caught
        except failures as error:
            raise IntegrationError(f"{peer.label} stopped: {str(error).strip() or type(error).__name__}") from error
        except Interrupted:
            raise
        except KeyboardInterrupt:
            raise Interrupted("stopped by Ctrl-C") from None
        finally:
            # REBOUND installs its own C handler for SIGINT and leaves it in place.
            if threading.current_thread() is threading.main_thread():
                handler = signal.getsignal(signal.SIGINT)
                if handler is not None:
                    signal.signal(signal.SIGINT, handler)
