"""How an uncertain orbit spreads along a run: a covariance at its start, and the derivatives of later states."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from orbits.body_names import few, index_of
from orbits.checks import finite_numbers
from orbits.errors import InputError
from orbits.finding import Finding
from orbits.integrators.forms import Array
from orbits.propagation.results.recording import observed_until
from orbits.propagation.variations.following import require_followable
from orbits.propagation.variations.state_transition import state_transition_of
from orbits.results.approaches import TURNING
from orbits.results.covariance import Covariance, decomposed, in_units_of
from orbits.system.parameters import parameters_of
from orbits.time_grid import TimeGrid

if TYPE_CHECKING:
    from orbits.results.passages import Passage
    from orbits.system import System
    from orbits.trajectory import Trajectory


AT_END = 1e-12
"""Of the length of a run: how near to its ends a passage is there."""


class Uncertain(NamedTuple):
    """A body whose orbit is uncertain.

    body : its name; matrix : (6 + p, 6 + p), the covariance of its state at the start, in the units and axes of the
        system, and of p parameters; parameters : their names
    """

    body: str
    matrix: Array
    parameters: tuple[str, ...] = ()

    @classmethod
    def of(cls, system: System, covariance: Any, body: str | None = None) -> Uncertain:
        """Return what a caller gives: a fit, its `covariance()`, or a matrix.

        body : its name; by default that of the fit, or the only massless one
        Raises InputError for what is no covariance of a state, and for a fit whose orbit is not the start of the run.
        """
        if hasattr(covariance, "system"):
            own = [x[covariance.system.names.index(covariance.name)] for x in covariance.system.values[1:3]]
            here = [x[index_of(covariance.name, system.names, "body")] for x in system.values[1:3]]
            if covariance.system.epoch != system.epoch or not np.array_equal(own, here):
                raise InputError(
                    f"the run does not begin with the orbit of {covariance.name} that was fitted; expected a run of "
                    "fit.system, or a covariance at the start of this one."
                )
            warn_of_range(covariance)
            covariance = covariance.covariance()
        if getattr(covariance, "form", "cartesian") != "cartesian":
            raise InputError(f"the covariance is {covariance.form}; expected one of the state: fit.covariance().")
        whose, parameters = getattr(covariance, "body", None), tuple(getattr(covariance, "names", ())[6:])
        body = the_body(system, whose if body is None else body)
        matrix, size = finite_numbers(getattr(covariance, "matrix", covariance), "covariance"), 6 + len(parameters)
        decomposed(matrix, size, "of x, y, z, vx, vy, vz in the units and axes of the system")
        if isinstance(covariance, Covariance):
            covariance.require_of(system, body)
            matrix = in_units_of(system, covariance)
        return cls(body, matrix, parameters)


def warn_of_range(fit: Any) -> None:
    """Warn of a fit whose orbits are a wide range, of which its covariance has the middle alone."""
    if fit.range:
        Finding(
            f"the orbits that fit the observations of {fit.name} are a wide range, which its covariance, linear, does "
            "not tell: ellipses, sigmas and probabilities are those about one of them.",
            remedy="fit.range has orbits from one end to the other: propagate these.",
        ).warn()


def the_body(system: System, body: str | None) -> str:
    """Return the name of a body; None for the only massless one."""
    if body is not None:
        return system.names[index_of(body, system.names, "body")]
    massless = [name for name, massive in zip(system.names, system.massive, strict=True) if not massive]
    if len(massless) != 1:
        raise InputError(f"the run has {few(massless) if massless else 'no massless body'}; expected body=..., a name.")
    return massless[0]


def followed(run: Trajectory, given: Uncertain, times: Array) -> tuple[System, TimeGrid]:
    """Return the system without other massless bodies, and the grid on which its variations are followed.

    Raises InputError as `orbits.state_transition` does.
    """
    system, grid = run.system, TimeGrid(run.clock, times)
    rest = [x for x, massive in zip(system.names, system.massive, strict=True) if not (massive or x == given.body)]
    alone = system.remove(*rest) if rest else system
    require_followable(alone, run.integrator, grid)
    return alone, grid


def spread(run: Trajectory, given: Uncertain, times: Array, others: Sequence[str] | None = None) -> Array:
    """Return the covariance of a body's states, (m, 6, 6).

    times : (m,), in the direction of the run; others : (m,), the bodies that the states are relative to
    Raises InputError as `orbits.state_transition` does.
    """
    body = given.body
    ahead, place = np.unique(np.abs(times), return_inverse=True)
    alone, grid = followed(run, given, ahead * run.clock.direction)
    by: dict[str, Any] = {"parameters": parameters_of(alone, given.parameters)} if given.parameters else {}
    found = state_transition_of(alone, run.integrator, grid, coupled=False, **by)

    def columns(name: str) -> Array:
        own = [found[name, one][..., None] for one in given.parameters]
        return np.concatenate([found[name, body], *own], axis=-1)

    D = columns(body)[place]
    if others is not None:
        D = D - np.array([columns(other)[k] for other, k in zip(others, place.tolist(), strict=True)])
    return np.asarray(D @ given.matrix @ np.swapaxes(D, -1, -2))


def turns(run: Trajectory, time: float, q: Array, v: Array) -> bool:
    """Return whether the distance is least at a time, and not only at this end of the run; q, v : relative, (3,)."""
    first, last = float(run.times[0]), observed_until(run)
    at_an_end = min(abs(time - first), abs(time - last)) <= AT_END * max(abs(first), abs(last))
    return not at_an_end or bool(abs(q @ v) <= TURNING * np.linalg.norm(q) * np.linalg.norm(v))


def sigmas_of_passages(
    run: Trajectory, given: Uncertain, passages: Sequence[Passage]
) -> list[tuple[float, float | None] | None]:
    """Return the standard deviations of distance and time of passages, None for those of other bodies.

    At the ends of the run, where a body still comes nearer or parts already, there is none of the time.
    """
    place, gm = run.names.index(given.body), run.system.values.gm
    own = [k for k, one in enumerate(passages) if place in (one.body, one.other) and one.distance > 0.0]
    out: list[tuple[float, float | None] | None] = [None] * len(passages)
    if not own:
        return out
    times = np.array([run.clock.time(passages[k].steps) for k in own])
    others = [one.other if one.body == place else one.body for one in (passages[k] for k in own)]
    matrices = spread(run, given, times, [run.names[other] for other in others])
    states = run.at(times)
    q, v = states.q.value, states.v.value
    for i, (k, other) in enumerate(zip(own, others, strict=True)):
        r, w = q[i, place] - q[i, other], v[i, place] - v[i, other]
        distance = float(np.linalg.norm(r))
        by_time = -np.concatenate([w, r]) / (w @ w - (gm[place] + gm[other]) / distance)
        by = np.array([np.concatenate([r / distance, np.zeros(3)]), by_time])
        distance, late = np.sqrt(np.diag(by @ matrices[i] @ by.T)).tolist()
        out[k] = distance, late if turns(run, float(times[i]), r, w) else None
    return out
