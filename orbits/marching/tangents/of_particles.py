"""Tangent vectors of massless particles in a Wisdom–Holman map, eight particles in lanes and on all cores.

The planets march a block of steps, and the particles with their vectors follow through the tables that they leave; see
`orbits.kernels.tangents.of_particles_in_maps`. The bits depend neither on the number of threads nor on the other
particles.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.integrators.base import Integrator
from orbits.integrators.forms import Array, padded
from orbits.integrators.maps.jacobi_form import KeplerSplitting
from orbits.kernels.lanes import WIDTH
from orbits.kernels.search.encounters_of_particles import HILL2, WAYS2, Rules
from orbits.kernels.steps import Share, Storage
from orbits.kernels.tangents.growth import AREA, LOGARITHM, SQUARE
from orbits.kernels.tangents.of_particles_in_maps import NEAR, SHARP, WHICH, Fans, follow_particles
from orbits.lagrangians.base import Lagrangian
from orbits.marching.clocks.constant import ConstantSteps
from orbits.marching.clocks.step_times import Place
from orbits.marching.stepping.alignment import aligned
from orbits.marching.stepping.choice_of_form import form_for, form_of_bodies
from orbits.marching.stepping.loops_of_maps import LoopsOfMap
from orbits.marching.tangents.in_maps import marched_in_blocks, require_map_tangents
from orbits.marching.watching.kepler_passages import HILL_RADII, ways_too_fast


def march_together(integrator: Integrator, lagrangian: Lagrangian) -> bool:
    """Return whether `ParticleTangents` serves a method and a Lagrangian."""
    form = form_for(integrator, lagrangian)
    return isinstance(form, KeplerSplitting) and not form.with_terms


class Passages(NamedTuple):
    """The first passages of particles that the map cannot follow, (m,) each: the time of the step near a planet and the
    number of that planet, and the time of the pericentre that the step does not resolve; NaN, and -1, for none.
    """

    near: Array
    planet: NDArray[np.intp]
    sharp: Array


class ParticleTangents(LoopsOfMap):
    """Massless particles in a Wisdom–Holman map, with tangent vectors whose growth is measured.

    lagrangian, parameters : of the massive bodies; Newton's gravity alone
    integrator : the map; h : the length of its steps
    q, v : (n, 3), the massive bodies at t = 0; x, w : (m, 3), the particles
    vectors : (count, 2, 3), dq and dv at the start of each particle: as they are marched, corrected
    scale : the unit of time in which velocities count in their lengths
    threads : how many threads the particles may use

    Raises InputError if the derivative is not known, or no body dominates the others.
    """

    def __init__(
        self,
        lagrangian: Lagrangian,
        parameters: Array,
        integrator: Integrator,
        h: float,
        bodies: tuple[Array, Array],
        particles: tuple[Array, Array],
        vectors: Array,
        scale: float,
        threads: int,
    ) -> None:
        require_map_tangents(integrator, lagrangian)
        self._steps, (q, v), (x, w) = ConstantSteps(h), bodies, particles
        n, m = len(q), len(x)
        form = form_of_bodies(integrator, lagrangian, self._steps, with_particles=True).for_bodies(n)
        assert isinstance(form, KeplerSplitting)
        form.check_start(parameters, q, v)
        self._turn = 2.0 * math.pi / integrator.least_steps
        super().__init__(form, lagrangian.tag, parameters, self._steps, n, m, threads)
        self.begin(np.concatenate([q, x]), np.concatenate([v, w]), np.arange(n), np.arange(n, n + m))
        self.enter(self.state, self._steps)
        self._strength, self._label, self._done = np.ascontiguousarray(parameters), integrator.label, 0
        self._scale, self._h = float(scale), h
        groups, count = (m + WIDTH - 1) // WIDTH, len(vectors)
        self._fans, self._growth = np.empty((groups, count, 6, WIDTH)), np.zeros((groups, count, 5, WIDTH))
        self._fans[...] = vectors.reshape(1, count, 6, 1)
        lengths = np.sum((vectors * np.array([1.0, scale])[:, None]) ** 2, axis=(1, 2))
        self._growth[:, :, SQUARE] = lengths[:, None]
        self._found = np.full((groups, 3, WIDTH), np.inf)
        self._path, gm = np.zeros((0, 2, padded(3 * n))), self._strength[1:]
        self._sun = int(gm.argmax())
        self._near = np.zeros((2, n))
        self._near[HILL2] = (HILL_RADII * np.cbrt(gm / (3.0 * gm[self._sun]))) ** 2
        self._near[WAYS2] = ways_too_fast(gm / gm[self._sun], integrator.least_steps) ** 2
        self._near[:, self._sun] = 0.0
        self._m = m

    @property
    def time(self) -> float:
        """The time reached."""
        return self._h * self._done

    def advance(self, place: Place) -> None:
        """Follow the map up to the last whole step before a place. Raises SingularityError if massive bodies meet."""

        def march(count: int) -> bool:
            if len(self._path) < count + 1:
                self._path = np.zeros((count + 1, 2, padded(3 * self._n)))
            now = self._steps.numbers(0.0, self._done)
            self.march(self.state, self.bound(self._steps, now), self._path.reshape(-1), count)
            self._path[count] = self.state["q"], self.state["v"]
            finite = bool(np.isfinite(self._path[count]).all())
            if finite:
                self._follow(count)
                self._done += count
            return finite

        for _ in marched_in_blocks(self._label, self._h, self._done, place.steps, self.steps, march):
            pass

    def _follow(self, count: int) -> None:
        """March the particles through the `count` steps that the bodies have just taken, with their vectors."""
        sun, gm, memory = self._sun, self._strength[1:], self.state["particle_memory"]
        rules = Rules(
            self._near, np.zeros((3, 0)), self._path.reshape(-1), padded(3 * self._n), sun, float(gm[sun]),
            self._h, self._turn,
        )  # fmt: skip
        fans = Fans(self._fans, self._growth, self._scale)

        def share(start: int, stop: int) -> None:
            storage = Storage(memory, aligned(self.scratch.shape)[0], self._stages, Share(start, stop, None))
            follow_particles(
                self._tag, self._strength, self._usual, self._h, self._done, count, storage, fans, rules, self._found
            )

        self._helpers.each(share, self._shares)

    def vectors(self, particle: int) -> Array:
        """Return the vectors of a particle as they are marched, (count, 2, 3)."""
        group, slot = divmod(particle, WIDTH)
        return self._fans[group, :, :, slot].reshape(-1, 2, 3).copy()

    def growth(self) -> tuple[Array, Array]:
        """Return MEGNO, the mean of Y over the time |time| > 0, and ln(|x| / |x0|), (m, count) each; not finite for
        particles that are lost.
        """
        both = self._growth[:, :, [AREA, LOGARITHM]].transpose(2, 0, 3, 1)
        mean, log = both.reshape(2, -1, both.shape[-1])[:, : self._m]
        return mean / abs(self.time), log.copy()

    def passages(self) -> Passages:
        """Return the passages so far that the map could not follow."""
        near, which, sharp = (self._found[:, row].ravel()[: self._m] for row in (NEAR, WHICH, SHARP))
        seen = np.isfinite(near)
        planet = np.full(self._m, -1)
        planet[seen] = which[seen].astype(int)
        return Passages(
            np.where(seen, self._h * near, np.nan), planet, np.where(np.isfinite(sharp), self._h * sharp, np.nan)
        )
