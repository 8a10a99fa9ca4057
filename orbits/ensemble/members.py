"""The members of an ensemble, and the parts of it that workers integrate."""

from __future__ import annotations

import hashlib
import itertools
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.body_names import checked_names, place_of
from orbits.catalogue import Catalogue
from orbits.checks import listed
from orbits.errors import InputError, OrbitsError, shown
from orbits.propagation.events.functions import description, in_full
from orbits.system import System
from orbits.system.presenting import in_words
from orbits.units import gathered

Floats = NDArray[np.float64]

SAMPLE = 17
"""Members of a sample: two registers of eight, and one member more."""

OF_TABLE = re.compile(
    r"name|block|state|end|reason|closest(_to|_at)?|megno|unresolved_at|energy_error|(a|e|inc)_(min|max)"
)
"""The columns of the table of a campaign that are not parameters of a grid."""

TRIED = 1000
"""The points of a grid for which its function may fail before the whole is refused."""

MOST = 10**8
"""The most members of an ensemble: their names and results must fit in memory."""


@dataclass(frozen=True, eq=False)
class Ensemble:
    """Members to be integrated. Made by `particles`, `clones`, `grid` and `systems` of `orbits.ensemble`.

    names : of the members, all different
    kind : "particles", massless bodies among the same massive ones, or "systems"
    columns : what is known of the members beforehand, such as the parameters of a grid: by name, (members,) each
    axes : of a grid, by name; the members are its points, the last axis varying fastest

    A part of it is an ensemble too, small and picklable, as it is sent to workers.
    """

    names: Sequence[str]
    kind: str = ""
    columns: Mapping[str, Any] = field(default_factory=dict)
    axes: Mapping[str, Any] = field(default_factory=dict)

    massless: ClassVar[bool] = False
    """Whether the members are massless bodies of one system; otherwise each is a system of its own."""

    def __len__(self) -> int:
        return len(self.names)

    def part(self, first: int, last: int) -> Ensemble:
        """Return the members from `first` up to `last`, without it."""
        return replace(self, names=tuple(self.names[first:last]), axes={}, **self._some(slice(first, last)))

    def _some(self, rows: slice) -> dict[str, Any]:
        """Return the fields of a part that are other ones."""
        raise NotImplementedError

    def numbers(self, names: Iterable[str]) -> dict[str, int]:
        """Return the numbers of those of these bodies that are massless members, by the names of the members."""
        return {}

    def sample(self) -> Ensemble:
        """Return a few members, with which options are checked and kernels compiled. Raises if none can be made."""
        return self.part(0, min(SAMPLE, len(self)))

    def system(self) -> System:
        """Return the system of which the members are massless bodies, the last ones; or that of the first member."""
        raise NotImplementedError

    def systems(self) -> Iterable[System | OrbitsError]:
        """Return the system of each member, or the error of one that cannot be made."""
        return [self.system()]

    def identity(self) -> dict[str, str]:
        """Return what the results depend on, by its name in messages."""
        return {"kind": self.kind, "members": f"{len(self):,}"}

    def __repr__(self) -> str:
        shape = " x ".join(f"{len(values)} {name}" for name, values in self.axes.items())
        return f"Ensemble({len(self):,} {self.kind}{': ' * bool(shape)}{shape})"


@dataclass(frozen=True, eq=False, repr=False)
class Particles(Ensemble):
    """Massless bodies among the bodies of one system; q, v (members, 3) in its units, radii (members,) or None.

    forces : those that name members; others are in the system
    """

    bodies: System | None = None
    q: Floats = field(default_factory=lambda: np.empty((0, 3)))
    v: Floats = field(default_factory=lambda: np.empty((0, 3)))
    radii: Floats | None = None
    forces: tuple[Any, ...] = ()

    massless: ClassVar[bool] = True

    def _some(self, rows: slice) -> dict[str, Any]:
        radii = None if self.radii is None else self.radii[rows]
        forces = _on(self.names[rows], self.forces)
        return {"columns": {}, "q": self.q[rows], "v": self.v[rows], "radii": radii, "forces": forces}

    def numbers(self, names: Iterable[str]) -> dict[str, int]:
        """Return the numbers of those of these bodies that are members, by the names of the members."""
        assert self.bodies is not None
        others, everyone = len(self.bodies), (*self.bodies.names, *self.names)
        places = (place_of(name, everyone) for name in names)
        return {self.names[k - others]: k - others for k in places if k is not None and k >= others}

    def system(self) -> System:
        """Return the bodies with these at the end."""
        assert self.bodies is not None
        radius: dict[str, Any] = {} if self.radii is None else {"radius": self.radii}
        return self.bodies.add(self.names, q=self.q, v=self.v, **radius).with_forces(*self.forces)

    def identity(self) -> dict[str, str]:
        """Return what the results depend on, by its name in messages."""
        assert self.bodies is not None
        forces = {"forces on the members": digest(in_full(self.forces))} if self.forces else {}
        return super().identity() | {
            "bodies": described(self.bodies),
            "names of the members": digest("\n".join(self.names)),
            "starts of the members": digest(self.q, self.v, self.radii),
            **forces,
        }


@dataclass(frozen=True, eq=False, repr=False)
class Systems(Ensemble):
    """Systems that were made beforehand."""

    members: Sequence[System] = ()

    def _some(self, rows: slice) -> dict[str, Any]:
        return {"columns": {}, "members": tuple(self.members[rows])}

    def sample(self) -> Ensemble:
        """Return the first member."""
        return self.part(0, 1)

    def system(self) -> System:
        """Return the first one."""
        return self.members[0]

    def systems(self) -> list[System | OrbitsError]:
        """Return them."""
        return list(self.members)

    def identity(self) -> dict[str, str]:
        """Return what the results depend on, by its name in messages."""
        return super().identity() | {
            "names of the members": digest("\n".join(self.names)),
            "systems": digest("\n".join(described(one) for one in self.members)),
        }


@dataclass(frozen=True, eq=False, repr=False)
class Made(Ensemble):
    """Systems that a function makes on the workers, from the parameters of each member."""

    make: Callable[..., System] | None = None

    def _some(self, rows: slice) -> dict[str, Any]:
        return {"columns": {name: values[rows] for name, values in self.columns.items()}}

    def sample(self) -> Ensemble:
        """Return the first member that can be made. Raises InputError if the function fails for all of the first."""
        failures = []
        for k in range(min(len(self), TRIED)):
            part = self.part(k, k + 1)
            try:
                part.system()
            except OrbitsError as error:
                failures.append(error)
            else:
                return part
        raise failures[0]

    def system(self) -> System:
        """Return the first one. Raises InputError if the function fails."""
        return self._made(0)

    def systems(self) -> Iterator[System | OrbitsError]:
        """Yield the system of each member, or the error of one that cannot be made."""
        for k in range(len(self)):
            try:
                yield self._made(k)
            except OrbitsError as error:
                yield error

    def _made(self, k: int) -> System:
        assert self.make is not None
        point = {name: values[k] for name, values in self.columns.items()}
        try:
            system = self.make(**point)
        except OrbitsError:
            raise
        except Exception as error:
            why = f"{type(error).__name__}: {error}"
            raise InputError(f"the function of the grid fails for {_named(point)}: {why}") from error
        if not isinstance(system, System):
            raise InputError(f"the function of the grid returned {shown(system)}; expected an orbits.System.")
        return system

    def identity(self) -> dict[str, str]:
        """Return what the results depend on, by its name in messages: of the function its name and its code."""
        points = "\n".join(f"{name} {np.asarray(values).tolist()}" for name, values in self.columns.items())
        return super().identity() | {"function": ", ".join(description(self.make).values()), "points": digest(points)}


def particles(bodies: System, members: Any, *, propagate_to_epoch: bool = False) -> Ensemble:
    """Return an ensemble of massless particles among the same bodies.

        orbits.ensemble.particles(planets, orbits.asteroids(100_000))
        orbits.ensemble.particles(planets, planets.add_particles(catalogue))  # those that a system has already
        orbits.ensemble.particles(planets, {"q": q, "v": v})               # (n, 3) each, about the origin

    bodies : a `System`; all its bodies go into each block, where massless ones of it are integrated along
    members : a catalogue; a `System` with massless bodies and the forces that name them, which fits as in `bodies +
        members`; or a mapping with positions q and velocities v, (n, 3), as quantities or in the units of the system,
        and optionally names
    propagate_to_epoch : of a catalogue, as in `System.add_particles`

    Particles do not influence each other. Raises InputError for no members, and as `System.add` and `add_particles` do.
    """
    if not isinstance(bodies, System):
        raise InputError(f"bodies is {shown(bodies)}; expected an orbits.System, among whose bodies the members move.")
    if isinstance(members, System):
        massless = np.array(members.names)[~members.massive].tolist()
        there = bodies.remove(*np.array(bodies.names)[~bodies.massive & np.isin(bodies.names, massless)].tolist())
        whole = there + members.replaced(terms=(), forces=_on(massless, members.forces))
        return among(there, whole, np.flatnonzero(np.isin(whole.names, massless)))
    if isinstance(members, Catalogue):
        whole = bodies.add_particles(members, propagate_to_epoch=propagate_to_epoch)
        return among(bodies, whole, np.arange(len(bodies), len(whole)))
    if not isinstance(members, Mapping) or not {"q", "v"} <= set(members) <= {"q", "v", "names"}:
        raise InputError(
            f"members is {shown(members)}; expected a catalogue such as orbits.asteroids(1000), a System with massless "
            'bodies, or positions and velocities: {"q": q, "v": v}, (n, 3) each, and names if they have any.'
        )
    q, names = bodies.units.length_value(members["q"], "q"), members.get("names")
    if q.ndim != 2 or not len(q):
        raise InputError(f"q has shape {q.shape}; expected the positions of n members, (n, 3).")
    names = checked_names(numbered("p", len(q)) if names is None else names)
    whole = bodies.add(names, q=q, v=members["v"])
    return among(bodies, whole, np.arange(len(bodies), len(whole)))


def among(bodies: System, whole: System, rows: NDArray[np.intp], **known: Any) -> Particles:
    """Return the ensemble of some bodies of `whole`, which are massless, among `bodies`."""
    if not len(rows):
        raise InputError("the ensemble has no members; expected at least one massless body.")
    values, radii = whole.values, None if whole.radii is None else whole.radii.value[rows]
    names = [whole.names[k] for k in rows]
    if values.gm[rows].any():
        heavy = names[int(np.argmax(values.gm[rows]))]
        raise InputError(
            f"{heavy!r} has a mass, but these members are massless; expected a function that makes a System with it: "
            "orbits.ensemble.grid(make_system, mass=...)."
        )
    kept = bodies
    if taken := set(names) & set(bodies.names):
        kept = bodies.remove(*(name for name in bodies.names if name in taken))
    own: dict[str, Any] = {"q": values.q[rows], "v": values.v[rows], "radii": radii, "forces": _on(names, whole.forces)}
    return Particles(names, "particles", bodies=kept, **own, **known)


def _on(names: Sequence[str], forces: Iterable[Any]) -> tuple[Any, ...]:
    """Return what is left of forces on these bodies, of those that name any of them."""
    here = set(names)
    named = (force.without(set(force.bodies) - here) for force in forces if force.bodies is not None)
    return tuple(force for force in named if force is not None)


def systems(members: Iterable[System], *, names: Sequence[str] | None = None) -> Ensemble:
    """Return an ensemble of systems, each integrated by itself.

    members : systems; those of equal shape are marched eight at a time
    names : of the members; by default their numbers
    Raises InputError for no members, for anything but systems, and for names that occur twice.
    """
    made = None if isinstance(members, System) else listed(members)
    if made is None:
        raise InputError(f"members is {shown(members)}; expected a list of orbits.System.")
    for k, one in enumerate(made):
        if not isinstance(one, System):
            raise InputError(f"members[{k}] is {shown(one)}; expected an orbits.System.")
    if not made:
        raise InputError("the ensemble has no members; expected at least one System.")
    own = checked_names(numbered("", len(made)) if names is None else names)
    if len(own) != len(made):
        raise InputError(f"there are {len(own)} names for {len(made)} systems; expected one for each.")
    return Systems(own, "systems", members=made)


def grid(what: System | Callable[..., System], **given: Any) -> Ensemble:
    """Return an ensemble over all points of a grid: of elements, or of the parameters of a function.

        orbits.ensemble.grid(planets, primary="Sun", a=np.linspace(2, 3.5, 300) * u.au, e=np.linspace(0, 0.5, 200))
        orbits.ensemble.grid(make_system, mass=np.geomspace(1e-5, 1e-3, 40), e=np.linspace(0, 0.3, 30))

    what : a `System`: the members are massless bodies among its bodies, with these arguments of `System.add`; or a
        function that makes a `System` from one value of each parameter, the same one each time. It is called on the
        workers; for processes it must be written in a file
    given : each axis by its name, that of no other column of the table: a sequence or an array (m,); a single value is
        the same for all members

    Members are named by their values, "a=2.5 AU e=0.1". The last axis varies fastest. Raises InputError for a grid
    without an axis, with an empty one, or with values that are neither numbers, texts nor truth values; for a `System`
    as `System.add` does.
    """
    given = {name: _as_array(name, values) for name, values in given.items()}
    axes = {name: values for name, values in given.items() if not isinstance(values, str) and np.ndim(values)}
    for name in filter(OF_TABLE.fullmatch, given):
        raise InputError(f"{name!r} is a column of the table of a campaign; expected another name of the parameter.")
    for name, values in axes.items():
        if values.ndim != 1 or not len(values):
            raise InputError(f"{name} has shape {values.shape}; expected the values of an axis, (m,), one or more.")
    if not axes:
        raise InputError("the grid has no axes; expected values by name, such as e=np.linspace(0, 0.5, 50).")
    shape = [len(values) for values in axes.values()]
    if math.prod(shape) > MOST:
        raise InputError(f"the grid has {math.prod(shape):.3g} points; at most {MOST:.0e} are possible.")
    fixed = {name: value for name, value in given.items() if name not in axes}
    places = np.unravel_index(np.arange(math.prod(shape)), shape)
    columns = {name: values[k] for (name, values), k in zip(axes.items(), places, strict=True)}
    texts = [[f"{name}={text}" for text in _texts(values)] for name, values in axes.items()]
    names = [" ".join(point) for point in itertools.product(*texts)]
    if isinstance(what, System):
        whole = what.add(names, **columns, **fixed)
        return among(what, whole, np.arange(len(what), len(whole)), columns=columns, axes=axes)
    if not callable(what):
        raise InputError(f"{shown(what)} is neither a System nor a function that makes one.")
    columns |= {name: _constant(value, len(names)) for name, value in fixed.items()}
    for name in (name for name, values in columns.items() if values.dtype.kind == "O"):
        expected = "expected numbers, texts or truth values, of which the function makes other things"
        raise InputError(f"{name} is {shown(given[name])}; {expected}.")
    return Made(names, "systems", columns=columns, axes=axes, make=what)


def _texts(values: Any) -> list[str]:
    """Return the values of an axis for names, in as many digits as tell them apart; numbered if some are the same."""
    texts: list[str] = []
    for digits in (17, 12, 6):
        shorter = [f"{value:.{digits}g}" if isinstance(value, float | u.Quantity) else str(value) for value in values]
        if len(set(shorter)) < len(set(map(str, values))):
            break
        texts = shorter
    return texts if len(set(texts)) == len(texts) else [f"{text} ({k})" for k, text in enumerate(texts)]


def numbered(stem: str, count: int) -> list[str]:
    """Return names that sort as their numbers do."""
    digits = len(str(count - 1))
    return [f"{stem}{k:0{digits}d}" for k in range(count)]


def digest(*parts: Any) -> str:
    """Return a short hash of texts and arrays, of which None is one too."""
    found = hashlib.sha256()
    for part in parts:
        found.update(part.encode() if isinstance(part, str) else b"-" if part is None else np.asarray(part).tobytes())
        found.update(b"\x00")
    return found.hexdigest()[:16]


def described(system: System) -> str:
    """Return a system as a short text, with a hash of all its values."""
    gm, q, v, softening = system.values
    radii = None if system.radii is None else system.radii.value
    epoch = "" if system.epoch is None else repr((system.epoch.jd1, system.epoch.jd2))
    acting = chr(10).join(map(in_full, (system.terms, system.forces, system.units, softening)))
    return f"System({in_words(system)}), {digest(chr(10).join(system.names), gm, q, v, radii, epoch, acting)}"


def _as_array(name: str, values: Any) -> Any:
    """Return an argument of a grid; several values as an array, or as a quantity if they are quantities."""
    try:
        values = gathered(values)
        several = not isinstance(values, str | u.Quantity) and np.shape(values)
    except (TypeError, ValueError) as error:
        expected = "expected one value, or those of an axis, (m,), in units of one kind"
        raise InputError(f"{name} is {shown(values)}; {expected}.") from error
    return np.asarray(values) if several else values


def _constant(value: Any, count: int) -> Any:
    if isinstance(value, u.Quantity):
        return u.Quantity(np.full(count, value.value), value.unit)
    return np.array([value] * count)


def _named(point: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} = {value}" for name, value in point.items())
