"""REBOUND's integrators as peers: the same initial floats in, samples at the same times out.

Only this file steps REBOUND simulations. Everything is plain float64 in one system of units; masses are GM and G is 1,
so that no constant is multiplied in. Bodies are passed in order (the central one first, massive ones by orbital energy,
then massless ones as test particles), and the results are returned in the caller's order.

Fixed-step peers stay on t0 + k dt with exactly the step of this package; a sample off that grid is a partial step of a
copied simulation. WHFast runs with `safe_mode = 0` and `keep_unsynchronized = 1`: REBOUND then synchronizes a copy for
each sample, and the run itself is not affected. IAS15 keeps its default epsilon and ends each interval exactly at the
sample (`exact_finish_time = 1`), as is common.

Wall time is the time within REBOUND's integrating calls (`Simulation.steps`, `Simulation.integrate`); setup and copying
of positions are not counted.

Source: Rein & Liu (2012), Rein & Spiegel (2015), Rein & Tamayo (2015), Rein, Tamayo & Brown (2019).
"""

from __future__ import annotations

import contextlib
import signal
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.errors import IntegrationError, Interrupted, UnknownNameError, shown
from orbits.point_masses import PointMasses

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Peer:
    """A configuration of REBOUND: its name, settings and limitations.

    name : the name for callers
    integrator : REBOUND's name for the integrator
    options : attributes set on `Simulation.integrator`; everything else has REBOUND's defaults
    fixed_step : whether it uses the given step on the grid t0 + k dt
    keplerian : whether it splits off Kepler orbits about the first body, which must then dominate, without softening
    """

    name: str
    integrator: str
    fixed_step: bool
    keplerian: bool = False
    options: tuple[tuple[str, Any], ...] = ()

    @property
    def label(self) -> str:
        """The name in tables: `REBOUND whfast`."""
        return f"REBOUND {self.name}"


_WHFAST = (("safe_mode", 0), ("keep_unsynchronized", 1))

PEERS: dict[str, Peer] = {
    peer.name: peer
    for peer in (
        Peer("whfast", "whfast", True, True, _WHFAST),
        Peer("whfast-corrector17", "whfast", True, True, (*_WHFAST, ("corrector", 17))),
        Peer("whfast-heliocentric", "whfast", True, True, (*_WHFAST, ("coordinates", "democraticheliocentric"))),
        Peer("saba-10-6-4", "saba", True, True, (*_WHFAST, ("type", "10_6_4"))),
        Peer("ias15", "ias15", False),
        Peer("leapfrog", "leapfrog", True),
    )
}
"""Every peer by its name."""


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


def lookup(name: str) -> Peer:
    """The peer of that name; `UnknownNameError` with the nearest names otherwise."""
    peer = PEERS.get(name.strip().lower()) if isinstance(name, str) else None
    if peer is None:
        near = get_close_matches(str(name).lower(), PEERS, n=1)
        hint = f" Did you mean {near[0]!r}?" if near else ""
        raise UnknownNameError(f"no peer is called {shown(name)}; there are {', '.join(PEERS)}.{hint}")
    return peer


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
    advance: Callable[[int], None] | None = None,
) -> PeerRun:
    """Integrate with the peer `name` and sample it at `times`.

    times (samples,) : from the epoch, all of one sign, in order of growing |t|
    dt : step of the fixed-step peers and first step that IAS15 tries, > 0
    advance : called after each sample with its index
    Raises UnknownNameError (no such peer), IntegrationError (REBOUND failed or the problem does not suit the peer),
    Interrupted (Ctrl-C).
    """
    peer = lookup(name)
    gm, q, v, softening = bodies
    reason = unsuited(peer, gm, softening)
    if reason:
        raise IntegrationError(f"{peer.label}: {reason}.")
    order = order_of_bodies(gm, q, v)
    start = PointMasses(gm[order], q[order], v[order], softening)
    backwards = bool(np.any(times < 0))

    with _handlers(peer) as caught:
        sim = _configured(peer, start, -dt if backwards else dt)
        advancer = _on_grid(peer, sim, start, dt, backwards) if peer.fixed_step else _adaptive(sim)
        q_out, v_out = np.empty((len(times), len(gm), 3)), np.empty((len(times), len(gm), 3))
        q_now, v_now = np.empty_like(q), np.empty_like(v)
        steps, wall = 0, 0.0
        for i, t in enumerate(times.tolist()):
            source, more, seconds = advancer(t)
            steps += more
            wall += seconds
            source.serialize_particle_data(xyz=q_now, vxvyvz=v_now)
            q_out[i, order], v_out[i, order] = q_now, v_now
            if not np.all(np.isfinite(q_now)):
                raise IntegrationError(f"{peer.label}: positions are no longer finite at t = {shown(t)}.", time=t)
            if advance is not None:
                advance(i)
        messages = tuple(dict.fromkeys(str(w.message) for w in caught))
    return PeerRun(q_out, v_out, steps, wall, messages)


# (t) -> the simulation that stands at t, the steps taken to get there, the seconds spent inside REBOUND
_Advancer = Callable[[float], "tuple[Any, int, float]"]


def _configured(peer: Peer, start: PointMasses, dt: float) -> Any:
    sim = simulation(start)
    sim.integrator = peer.integrator
    for option, value in peer.options:
        setattr(sim.integrator, option, value)
    sim.dt = dt
    return sim


def _on_grid(peer: Peer, sim: Any, start: PointMasses, dt: float, backwards: bool) -> _Advancer:
    """Whole steps in `sim`; what is left over in a scratch simulation that is set to the state on the grid."""
    scratch = _configured(peer, start, dt)
    if peer.keplerian:  # set anew for each sample, so it must start from its particles and end synchronized
        scratch.integrator.keep_unsynchronized = 0
        scratch.integrator.safe_mode = 1
    q, v = np.empty_like(start.q), np.empty_like(start.v)
    done = 0

    def advance(t: float) -> tuple[Any, int, float]:
        nonlocal done
        k, rest = grid_position(t, dt)
        more, done = k - done, k
        wall = -perf_counter()
        if more:
            sim.steps(more)
        wall += perf_counter()
        if rest == 0.0:
            return sim, more, wall
        sim.serialize_particle_data(xyz=q, vxvyvz=v)
        scratch.set_serialized_particle_data(xyz=q, vxvyvz=v)
        scratch.dt = -rest if backwards else rest
        wall -= perf_counter()
        scratch.steps(1)
        wall += perf_counter()
        return scratch, more, wall

    return advance


def _adaptive(sim: Any) -> _Advancer:
    def advance(t: float) -> tuple[Any, int, float]:
        before = int(sim.steps_done)
        wall = -perf_counter()
        if t != sim.t:
            sim.integrate(t, exact_finish_time=1)
        wall += perf_counter()
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
        except KeyboardInterrupt:
            raise Interrupted(f"stopped by Ctrl-C while {peer.label} was running; nothing was compared.") from None
        finally:
            # REBOUND installs its own C handler for SIGINT and leaves it in place.
            if threading.current_thread() is threading.main_thread():
                handler = signal.getsignal(signal.SIGINT)
                if handler is not None:
                    signal.signal(signal.SIGINT, handler)
