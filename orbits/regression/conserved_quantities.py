"""Errors of energy and angular momentum, by the same functions for every method."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from orbits import diagnostics
from orbits.diagnostics.drift import CANCELLED, kinetic_energies, moments
from orbits.point_masses import PointMasses

Array = NDArray[np.float64]


class Invariants:
    """The conserved quantities of an initial state, and the errors of runs from it.

    For two or more massive bodies these are their energy and angular momentum about the origin. A single massive body
    has neither, so they are the specific energy and angular momentum of each massless particle about it, and the
    largest relative error of all particles counts. If an initial value cancels to zero (as the angular momentum of the
    figure-eight does), the scale is the sum of the sizes of its terms, and `notes` says so. If these vanish too, as for
    bodies at rest, it is their largest sum over the samples.
    """

    def __init__(self, start: PointMasses) -> None:
        gm, q, v, softening = start
        self._gm, self._softening = gm, softening
        self._alone = np.count_nonzero(gm) == 1
        self.notes: tuple[str, ...] = ()
        if self._alone:
            self.notes = (
                "Energy and angular momentum: of each massless particle about the one massive body, the worst of them.",
            )
        energy, momentum = self._values(q[None], v[None])
        self._energy, self._momentum = energy[0], momentum[0]
        self._scales = self._compare_with(q, v)

    def errors(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Return |dE/E| and |dL/L| of q, v (samples, bodies, 3): each (samples,); NaN for a single massive body."""
        energy, momentum = self._values(q, v)
        energy_scale, momentum_scale = self._scales
        if np.any(momentum_scale == 0.0):
            momentum_scale = np.where(momentum_scale > 0.0, momentum_scale, self._terms(q, v)[1].max(axis=0))
        de = np.abs(energy - self._energy) / energy_scale
        dl = np.linalg.norm(momentum - self._momentum, axis=-1) / momentum_scale
        if self._alone:
            de, dl = (x.max(axis=1) if x.shape[1] else np.full(len(q), np.nan) for x in (de, dl))
        return de, dl

    def _values(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Return energy and angular momentum: (samples,) and (samples, 3), for particles with one more axis."""
        if not self._alone:
            gm = self._gm
            return diagnostics.energy(gm, q, v, self._softening), diagnostics.angular_momentum(gm, q, v)
        dq, dv = self._relative(q, v)
        # A unit mass about the attractor held at the origin: energy v^2/2 - gm/r and momentum q x v per unit mass.
        pair_q, pair_v = (np.stack((np.zeros_like(x), x), axis=-2) for x in (dq, dv))
        gm = np.array([self._gm.max(), 1.0])
        one = np.ones(1)
        return (
            diagnostics.energy(gm, pair_q, pair_v, self._softening),
            diagnostics.angular_momentum(one, dq[..., None, :], dv[..., None, :]),
        )

    def _relative(self, q: Array, v: Array) -> tuple[Array, Array]:
        centre = int(np.argmax(self._gm))
        others = np.arange(len(self._gm)) != centre
        return (q - q[:, centre, None])[:, others], (v - v[:, centre, None])[:, others]

    def _terms(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Return the sums of the sizes of the terms of both, with the shapes of their values without components."""
        if self._alone:
            dq, dv = self._relative(q, v)
            return 0.5 * np.sum(dv * dv, axis=-1), np.linalg.norm(dq, axis=-1) * np.linalg.norm(dv, axis=-1)
        return kinetic_energies(self._gm, v), moments(self._gm, q, v)

    def _compare_with(self, q: Array, v: Array) -> tuple[Array, Array]:
        kinetic, areal = (terms[0] for terms in self._terms(q[None], v[None]))
        energy, energy_cancelled = _scale(np.abs(self._energy), kinetic)
        momentum, momentum_cancelled = _scale(np.linalg.norm(self._momentum, axis=-1), areal)
        for what, cancelled in (("energy", energy_cancelled), ("angular momentum", momentum_cancelled)):
            if cancelled:
                self.notes += (f"The initial {what} vanishes: its errors are relative to the sizes of its terms.",)
        return energy, momentum


def _scale(value: Array, terms: Array) -> tuple[Array, bool]:
    cancelled = value <= CANCELLED * terms
    return np.where(cancelled, terms, value), bool(np.any(cancelled))
