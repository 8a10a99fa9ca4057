"""Names from other packages, above all REBOUND, and their counterparts here, for hints in messages."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from difflib import get_close_matches
from typing import TypedDict

from orbits.errors import UnknownNameError

OTHER_NAMES = {
    "rk4": "runge-kutta-4",
    "leapfrog": "stormer-verlet",
    "verlet": "stormer-verlet",
    "velocity-verlet": "stormer-verlet",
    "midpoint": "implicit-midpoint",
    "euler": "explicit-euler or symplectic-euler",
}
"""Names that other packages use for methods of this one."""

PEERS = {name: name for name in ("whfast", "whfast512", "saba", "mercurius", "trace", "ias15")}
"""Methods of REBOUND, and the name of the peer to compare with."""

OTHERS_OF_REBOUND = ("janus", "eos", "bs", "sei")
"""Methods of REBOUND that are not among the peers."""

PUBLIC_NAMES = {
    "simulation": "orbits.System(...), which orbits.propagate integrates",
    "simulationarchive": "orbits.Trajectory.open(path), or orbits.rebound.run_from_rebound(path) for REBOUND's files",
    "particle": "orbits.System(...) and its add(name, ...)",
    "orbit": "system.elements(primary=...)",
    "integrate": "orbits.propagate(system, method, dt=..., duration=...)",
    "open": "orbits.Trajectory.open(path)",
    "load": "orbits.Trajectory.open(path)",
    **dict.fromkeys(("init_megno", "lyapunov"), "orbits.megno(system, method, dt=..., duration=...)"),
    **dict.fromkeys(("add_variation", "stm", "monodromy"), "orbits.state_transition(system, duration=...)"),
}
"""Counterparts of names from other packages, in lower case."""

FORCES = (
    "what acts besides Newtonian gravity belongs to the system: system.with_terms(orbits.terms.ZonalHarmonics(...)), "
    "system.with_forces(orbits.terms.Drag(...)); a Lagrangian of your own is integrated by orbits.march "
    "(docs/lagrangians.md)"
)
END = "the end of a run is duration=..., or until=..., a date or a time since the epoch"
STEPS = "dt=... makes steps constant; without it they are chosen"
TOLERANCE = "dt=orbits.Adaptive(tolerance=...) is the tolerance of steps that are chosen"
SAMPLES = "the samples to keep are samples=..., a count or times"
KEYWORDS = {
    "yardstick": "it is called reference now",
    "foils": "it is called controls now",
    "additional_forces": FORCES,
    "forces": FORCES,
    "pre_timestep_modifications": FORCES,
    "post_timestep_modifications": FORCES,
    **dict.fromkeys(("tmax", "t_end", "tend", "t_span", "tspan", "end", "steps", "n_steps", "t"), END),
    **dict.fromkeys(("step", "timestep", "stepsize", "h"), STEPS),
    **dict.fromkeys(("rtol", "atol", "tol", "tolerance", "epsilon", "min_dt"), TOLERANCE),
    **dict.fromkeys(("times", "t_eval", "saveat", "noutputs", "nout", "exact_finish_time"), SAMPLES),
    **dict.fromkeys(("collision", "exit_min_distance"), "stop=orbits.events.CloserThan(distance) ends a run"),
    "exit_max_distance": "stop=orbits.events.FartherThan(distance) ends a run",
    "events": "orbits.propagate and orbits.resume take events=..., and run.events is their table",
    **dict.fromkeys(("method", "solver"), 'the method is the second argument: orbits.Gauss(stages=8), or "gauss"'),
    "softening": "it belongs to the system: system.replaced(softening=...)",
    "epoch": "it belongs to the system: system.replaced(epoch=...)",
    "units": "they belong to the system: orbits.System(..., units=...)",
    **dict.fromkeys(("file", "filename", "path", "output", "out"), "archive=... names the file to write"),
    **dict.fromkeys(("n_jobs", "workers", "nthreads"), "threads=... is the number of threads"),
    "verbose": "progress=... says whether a progress bar is shown",
}
"""Arguments of `propagate` that correspond to arguments of other packages, or to former names."""


def method_hint(name: str, known: Iterable[str]) -> str:
    """Return a hint for an unknown method name, as the end of a sentence.

    known : the registered names
    """
    if peer := _found(name, PEERS):
        return f", which is REBOUND's: compare with it by against=['{peer}'] or --against {peer}."
    if _plain(name) in OTHERS_OF_REBOUND:
        return ", which is REBOUND's, and not available for comparison."
    meant = {each: each for each in known} | OTHER_NAMES
    close = get_close_matches(name.replace("_", "-").lower(), meant, n=1, cutoff=0.4)
    return f"; did you mean {meant[close[0]]}?" if close else "."


def public_name_hint(name: str, public: Iterable[str], elsewhere: Mapping[str, str]) -> str:
    """Return a hint for a name that `orbits` does not have, as the end of a sentence.

    public : the names that it has; elsewhere : those of its namespaces, and where they are, "orbits.methods.SABA"
    """
    if here := _found(name, PUBLIC_NAMES):
        return f": here that is {here}."
    if name in elsewhere:
        return f": it is {elsewhere[name]} now."
    if _found(name, PEERS) or _plain(name) in OTHERS_OF_REBOUND:
        return method_hint(name, ())
    folded = {_plain(each): each for each in public} | {_plain(each): there for each, there in elsewhere.items()}
    if kin := _found(name, OTHER_NAMES):
        return f"; did you mean {' or '.join(folded[_plain(each)] for each in kin.split(' or '))}?"
    close = get_close_matches(_plain(name), folded, n=1, cutoff=0.7)
    return f"; did you mean {folded[close[0]]}?" if close else "."


def keyword_hint(name: str, known: Iterable[str]) -> str:
    """Return a hint for an argument that a function does not have, as sentences.

    known : the arguments that it has
    """
    known = tuple(known)
    if name.lower() in KEYWORDS:
        return f"{KEYWORDS[name.lower()]}."
    close = get_close_matches(name.lower(), known, n=1, cutoff=0.6)
    return f"expected some of {', '.join(known)}." + (f" Did you mean {close[0]}?" if close else "")


class NoOthers(TypedDict):
    """The type of `**others` in functions that take no further arguments, but answer unknown ones with a hint."""


def unknown_argument(function: Callable[..., object], name: str) -> UnknownNameError:
    """Return the error for an argument that a function does not have, with a hint."""
    known = (key for key in inspect.signature(function).parameters if key != "others")
    return UnknownNameError(f"{function.__name__}() has no argument {name!r}: {keyword_hint(name, known)}")


def _plain(name: str) -> str:
    """Return a name in lower case without dashes: "WisdomHolman" and "wisdom-holman" are the same."""
    return name.replace("_", "").replace("-", "").lower()


def _found(name: str, table: Mapping[str, str]) -> str | None:
    return {_plain(key): value for key, value in table.items()}.get(_plain(name))
