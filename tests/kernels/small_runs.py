"""Runs of few bodies, in numbers that fill no register, with arrays that end with a page: a program for a process.

    python -m tests.kernels.small_runs NAME

A read or a write behind an array ends it; see `page_ends`.
"""

from __future__ import annotations

import faulthandler
import os
import sys
import traceback
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

import orbits
from orbits.events import Collision, Pericentre
from orbits.methods import SABA, Composition
from orbits.terms import DegreeTwo, Drag, PostNewtonian, RadiationPressure, ZonalHarmonics

from . import page_ends

NUMBERS = [(1, 0), (1, 9), (2, 0), (3, 1), (8, 0), (9, 7), (10, 17)]
"""Massive bodies and massless particles."""

HELIOCENTRIC = "democratic-heliocentric"

QUIET: dict[str, Any] = {"check_step": False, "progress": False, "threads": 1, "samples": 3}


def system(n: int, particles: int, gm: float = 1e-5, radius: float = 0.0) -> orbits.System:
    """Return a star, planets of about this GM and massless particles, every third of them near the first planet."""
    rng, count = np.random.default_rng(n), n + particles
    a, angle = 1.0 + 0.7 * np.arange(count), rng.uniform(0.0, 2.0 * np.pi, count)
    q = np.stack([a * np.cos(angle), a * np.sin(angle), 0.02 * rng.normal(size=count)], axis=1)
    v = np.stack([-np.sin(angle), np.cos(angle), 0.02 * rng.normal(size=count)], axis=1) / np.sqrt(a)[:, None]
    q[0] = v[0] = 0.0
    if n > 1:
        q[n::3], v[n::3] = q[1] + 0.1 * (1.0 + 0.1 * np.arange(len(q[n::3])))[:, None], 1.02 * v[1]
    masses = np.where(np.arange(count) < n, gm * (1.0 + rng.random(count)), 0.0)
    masses[0] = 1.0
    names = [f"b{k}" for k in range(count)]
    radii = np.full(count, radius) if radius else None
    return orbits.System(names, masses, q, v, units=orbits.DIMENSIONLESS, radii=radii)


def run(start: Any, method: Any = None, **options: Any) -> Any:
    """Return a run whose passages and whose motion between samples have been looked at."""
    found = orbits.propagate(start, method, **{**QUIET, "duration": 2.0, "approaches": True, **options})
    if isinstance(start, orbits.System):
        found.closest_approaches()
        found.at(0.7)
    return found


def chosen_steps() -> None:
    """Steps that are chosen one by one."""
    for n, particles in NUMBERS:
        run(system(n, particles))
        run(system(n, particles), dense=True)


def constant_steps() -> None:
    """Steps of one length."""
    for n, particles in NUMBERS:
        for method in (orbits.StormerVerlet(), Composition(order=6), orbits.Gauss(stages=4)):
            run(system(n, particles), method, dt=0.1)


def transformed_time() -> None:
    """Constant steps of transformed time."""
    for n in (2, 3, 7, 8, 9):
        run(system(n, 0, gm=0.1), dt=orbits.TimeTransformed(step=0.1))


def maps() -> None:
    """Wisdom-Holman maps and SABA, and encounters in maps."""
    for n, particles in NUMBERS:
        for method in (orbits.WisdomHolman(), orbits.WisdomHolman(HELIOCENTRIC), SABA(8, 6, 4)):
            run(system(n, particles), method, dt=0.1)
        if n > 1 and particles:
            run(
                system(n, particles, gm=1e-4, radius=1e-3),
                orbits.WisdomHolman(encounters="follow particles"),
                dt=0.1,
                duration=9.0,
            )
        if n > 2:
            run(system(n, particles, gm=1e-3), orbits.WisdomHolman(encounters="follow planets"), dt=0.1, duration=9.0)


def terms_and_forces() -> None:
    """Terms of the Lagrangian, and forces."""
    about = {"J2": 1e-3, "radius": 0.01, "pole": (0.2, 1.2)}
    terms = [
        [PostNewtonian(sources=["b0"], c=1e4), ZonalHarmonics("b0", **about)],
        [PostNewtonian(c=1e4), DegreeTwo("b1", C22=1e-4, attitude="b0", **about)],
    ]
    for n, particles in NUMBERS[2:]:
        names = [f"b{k}" for k in range(1, n + particles)]
        beta = RadiationPressure(beta=tuple(0.01 * (1 + k % 3) for k in range(len(names))), bodies=names, c=1e4)
        for some in terms:
            run(system(n, particles).with_terms(*some))
        run(system(n, particles).with_forces(Drag(rate=1e-3), beta))
        run(system(n, particles).with_terms(*terms[0]), orbits.WisdomHolman(), dt=0.1)


def variations() -> None:
    """Tangent maps."""
    for n, particles in NUMBERS:
        for method in (None, orbits.StormerVerlet(), orbits.WisdomHolman(), orbits.WisdomHolman(HELIOCENTRIC)):
            options = {"duration": 2.0, "check_step": False, **({} if method is None else {"dt": 0.1})}
            orbits.state_transition(system(n, particles), method, **options)
            orbits.megno(system(n, particles), method, **options)


def collisions_and_events() -> None:
    """Events within steps."""
    for n, particles in NUMBERS[2:]:
        start = system(n, particles, radius=1e-3)
        for method, options in (
            (None, {}),
            (orbits.StormerVerlet(), {"dt": 0.05}),
            (orbits.Gauss(stages=4), {"dt": 0.1}),
        ):
            run(start, method, events=[Collision(), Pericentre("b1", primary="b0")], **options)


def rigid_bodies() -> None:
    """Bodies that turn."""
    for n, particles in NUMBERS[2:]:
        names = [f"b{k}" for k in range(1, n + particles)]
        body = orbits.RigidBody(A=0.010, B=0.013, C=0.016, radius=0.01, spin=(0.3, 0.5, 1.7))
        for some in (names[:1], names, names[-particles:] if particles else names[-1:]):
            orbits.propagate(system(n, particles).with_rigid(dict.fromkeys(some, body)), **QUIET, dt=0.05, duration=0.5)


def spins() -> None:
    """Spins in a plane, and free rotation."""
    planar = orbits.spin_orbit.PlanarSpins(eccentricity=0.1, alpha=0.89)
    for count in (1, 7, 8, 9, 17):
        planar.section(theta=0.0, rate=np.linspace(0.5, 3.0, count), revolutions=3)
        planar.lyapunov(theta=0.0, rate=np.linspace(0.5, 3.0, count), revolutions=3)
        orbits.rotations.free_rotation((1, 2, 3), np.linspace(0.0, 9.0, count), rates=(0.01, 1.0, 0.01))


def one_lane_too_far() -> None:
    """What must not be done."""
    from orbits.kernels.lanes import load, store

    @orbits.kernel
    def read(a: Any, out: Any) -> None:
        store(out, 0, load(a, 1))

    read(np.arange(8.0), np.zeros(8))


RUNS: dict[str, Callable[[], None]] = {
    of.__name__: of
    for of in (
        chosen_steps,
        constant_steps,
        transformed_time,
        maps,
        terms_and_forces,
        variations,
        collisions_and_events,
        rigid_bodies,
        spins,
    )
}
WRONG = one_lane_too_far.__name__


def main(name: str) -> None:
    """Do the runs of a name, and end the process."""
    warnings.simplefilter("ignore")
    faulthandler.enable()
    runs = {**RUNS, WRONG: one_lane_too_far}[name]
    page_ends.install()
    code = 1
    try:
        runs()
        code = 0
    except BaseException:
        traceback.print_exc()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


if __name__ == "__main__":
    main(sys.argv[1])
