"""Tangent vectors that follow a Wisdom–Holman map of massive bodies; see `orbits.kernels.tangents.through_maps`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError, SingularityError
from orbits.integrators.base import Integrator
from orbits.integrators.forms import Array, coefficients_of, padded
from orbits.integrators.maps.dominant import registers_for
from orbits.integrators.maps.on_kepler_orbits import OnKeplerOrbits
from orbits.kernels.lanes import WIDTH
from orbits.kernels.lanes.dual import NUMBERS
from orbits.kernels.maps.layout import STATE_ROWS
from orbits.kernels.steps import Model, Share, State, Storage
from orbits.kernels.tangents.through_maps import (
    NUMBERS_OF_A_FLOW,
    VectorRoom,
    enter_with_vectors,
    follow_map,
    leave_with_vectors,
)
from orbits.kernels.tangents.through_stages import Fan
from orbits.lagrangians.base import SEPARABLE, Lagrangian
from orbits.marching.clocks.step_times import Place
from orbits.marching.stepping.alignment import aligned
from orbits.marching.stepping.choice_of_form import form_for
from orbits.marching.tangents.in_lanes import InLanes
from orbits.marching.tangents.of_bodies import known_derivatives, momenta_by_velocities, momenta_of, on_duals

BLOCK = 4096
"""The most steps between two looks at the state, and for an interrupt."""


def require_map_tangents(integrator: Integrator, lagrangian: Lagrangian) -> None:
    """Raise InputError, with the reason, if the derivative of a map on Kepler orbits is not known."""
    form_for(integrator, lagrangian)  # which names the terms that the map does not take
    if integrator.in_encounters.follow_planets:
        raise InputError(
            f"the variations of {integrator.label} are not known where all bodies take steps that are chosen one by "
            "one; use encounters='warn', or Gauss(stages=8) without dt."
        )
    if integrator.in_encounters.refuse_planets or integrator.departures != (None, None):
        raise InputError(
            f"tangent vectors follow all bodies wherever they go, but {integrator.label} asks for an end; leave out "
            "encounters='refuse', ejected_beyond and lost_within."
        )


def marched_in_blocks(
    label: str, h: float, done: int, steps: int, most: int, march: Callable[[int], bool]
) -> Iterator[int]:
    """March a map from `done` steps to `steps`, at most `most` at a time, and yield how many are done each time.

    march : takes a number of steps, and returns whether the massive bodies are finite after them

    Raises SingularityError if they are not.
    """
    while done < steps:
        count = min(most, steps - done)
        finite = march(count)
        done += count
        if not finite:
            raise SingularityError(
                f"{label}: massive bodies meet by step {done} (t = {h * done:.10g}), where their states are no longer "
                "finite. Use a smaller dt, or end the run before.",
                step=done,
                time=h * done,
            )
        yield done


class MapTangents(InLanes):
    """Tangent vectors of massive bodies in a Wisdom–Holman map, which is marched again with them, to the same bits.

    lagrangian, parameters : of the bodies, with the vectors of its kernels
    integrator : the map; h : the length of its steps
    bodies : the numbers of the bodies that are varied, in ascending order; the others have no variations at the start
    q, v : (n, 3) of all bodies at t = 0
    vectors, scale : as in `orbits.marching.tangents.of_bodies.Tangents`; lengths are those of the places and velocities
        of each planet and of the centre of mass as they are marched

    Raises InputError if the derivative is not known, or no body dominates the others.
    """

    def __init__(
        self,
        lagrangian: Lagrangian,
        parameters: Any,
        integrator: Integrator,
        h: float,
        bodies: NDArray[np.intp],
        q: Array,
        v: Array,
        vectors: Array,
        scale: float | None = None,
    ) -> None:
        require_map_tangents(integrator, lagrangian)
        form = form_for(integrator, lagrangian).for_bodies(len(q))
        assert isinstance(form, OnKeplerOrbits)
        form.check_start(parameters, q, v)
        self._form, self._lagrangian, self._integrator = form, lagrangian, integrator
        self._parameters = parameters if isinstance(parameters, tuple) else np.ascontiguousarray(parameters)
        strength = parameters[0] if isinstance(parameters, tuple) else parameters
        self._gm, self._h, self._steps = np.array(strength[1:]), h, 0
        self._bodies, self._count = np.asarray(bodies), len(vectors)
        n, groups = len(q), (len(vectors) + WIDTH - 1) // WIDTH
        width, rows = padded(3 * n), 3 * (n - 1)
        self._state = dict(
            zip(
                ("q", "q_lo", "v", "v_lo", "carry", "scratch", "stages"),
                aligned(*[(width,)] * 4, (form.carry_rows(3 * n), WIDTH), form.scratch_shape(3 * n), (1, width)),
                strict=True,
            )
        )
        self._state["q"][: 3 * n], self._state["v"][: 3 * n] = q.T.ravel(), v.T.ravel()
        self._vectors, self._growth, self._no_kicks = aligned(
            (groups, 4, 3 * n, WIDTH), (0 if scale is None else groups, 5, WIDTH), (groups, 0, WIDTH)
        )
        carry, registers = self._state["carry"].shape, registers_for(3 * n)
        flows = registers, NUMBERS_OF_A_FLOW, WIDTH
        of_planets = (registers, WIDTH), (n - 1,), flows, (8, rows, NUMBERS), (groups, rows, WIDTH)
        self._room = VectorRoom(*aligned(carry, form.room_shape(3 * n), carry, (4, width), *of_planets))
        given = np.zeros((self._count, 2, n, 3))
        given[:, :, self._bodies] = vectors
        self._write(given.reshape(self._count, 2, 3 * n))
        self._start = self._vectors.copy()
        self._change(enter_with_vectors, h)
        self._scale = self._begin_growth(scale)

    def advance(self, place: Place) -> None:
        """Follow the map up to the last whole step before a place.

        Raises SingularityError if bodies meet, InputError if the vectors become too large.
        """
        carry, planets = self._state["carry"], STATE_ROWS * registers_for(3 * len(self._gm))

        def march(count: int) -> bool:
            storage = Storage(carry, self._state["scratch"], self._state["stages"], Share(0, 3 * len(self._gm), None))
            fan = Fan(self._vectors, self._no_kicks, self._growth)
            follow_map(
                self._form.tag, coefficients_of(self._form, self._h), self._lagrangian.tag, self._parameters,
                self._h * self._steps, self._h, self._seen(), storage, count, self._scale, fan, self._room,
            )  # fmt: skip
            self._steps += count
            return bool(np.isfinite(carry[:planets]).all())

        for _ in marched_in_blocks(self._integrator.label, self._h, self._steps, place.steps, BLOCK, march):
            self._require_finite(self.time)

    @property
    def time(self) -> float:
        """The time reached."""
        return self._h * self._steps

    def seen(self, rest: float) -> MapTangents:
        """Return a copy with the vectors of what is seen, uncorrected, after a part of a step if `rest` is not 0; it
        cannot be followed on.
        """
        copy = self._copied()
        if self._steps:
            copy._change(leave_with_vectors, self._h)
        else:  # exactly what it was
            copy._vectors[...] = self._start
        if rest != 0.0:
            copy._change(enter_with_vectors, rest)
            copy._h, copy._steps = rest, 0
            copy.advance(Place(1, 0.0))
            copy._change(leave_with_vectors, rest)
        return copy

    def _copied(self) -> MapTangents:
        copy: MapTangents = object.__new__(MapTangents)
        copy.__dict__.update(self.__dict__)
        copy._state = {name: array.copy() for name, array in self._state.items()}
        copy._vectors, copy._growth = self._vectors.copy(), self._growth[:0].copy()
        copy._room = VectorRoom(*(x.copy() for x in self._room))
        return copy

    def _change(self, kernel: Any, h: float) -> None:
        """Change the variables of state and vectors, by `enter_with_vectors` or its inverse for steps of h."""
        kernel(
            self._form.tag, coefficients_of(self._form, h), self._lagrangian.tag, self._parameters, self._seen(),
            self._state["carry"], self._vectors, self._room,
        )  # fmt: skip

    def _seen(self) -> State:
        """Return the arrays of the state that is seen."""
        return State(*(self._state[name] for name in ("q", "q_lo", "v", "v_lo")))

    def state(self) -> tuple[Array, Array]:
        """Return q and v, (n, 3), of what `seen` returned, rounded to float64."""
        q, v = (self._state[name][: 3 * len(self._gm)].reshape(3, -1).T.copy() for name in "qv")
        return q, v

    def marched(self) -> Array:
        """Return the vectors as they are marched, (count, 2, n, 3): of the planets outwards, then of the centre."""
        return np.ascontiguousarray(self._read().reshape(self._count, 2, -1, 3))

    def vectors(self) -> Array:
        """Return the vectors of what `seen` returned, (count, 2, bodies, 3), rounded to float64."""
        return np.ascontiguousarray(self.marched()[:, :, self._bodies])

    def to_momenta(self) -> Array:
        """Return the derivative of (q, p) by (q, v) of what `seen` returned, or at the start, (2 d, 2 d): x, y, z of
        each varied body in turn, p times G.
        """
        gm = self._gm[self._bodies]
        if SEPARABLE in self._lagrangian.traits:
            return momenta_by_velocities(gm)
        (q, v), model = self.state(), Model(self._lagrangian.tag, self._parameters)
        duals, bodies = on_duals(self._parameters, len(q)), np.array(self._bodies, dtype=np.int64)
        with known_derivatives(self._lagrangian):
            found = momenta_of(model, duals, self.time, q.ravel(), v.ravel(), np.zeros(0), bodies)
        return momenta_by_velocities(gm, *found)
