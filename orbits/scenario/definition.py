"""`Scenario` and `Outcome`: the definition of a scenario and the result of performing it."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Unpack

from orbits.elsewhere import NoOthers, unknown_argument
from orbits.errors import InputError, shown
from orbits.option_values import options_text
from orbits.scenario.options import Option, all_values, checked_options

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from orbits.archive.origin import Origin
    from orbits.regression.report import Report
    from orbits.system import System
    from orbits.trajectory import Trajectory

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")
ONLY = ""
"""The name of the only case of a scenario with a single system."""
MIND = "mind: "
"""Prefix of messages that are warnings, while a scenario runs; other messages tell its progress."""


@dataclass(frozen=True)
class Check:
    """A requirement of a scenario beyond its tolerances: a claim, whether it holds, and the measured value.

    Raises InputError for a claim that is no text, and unless `ok` is True or False.
    """

    claim: str
    ok: bool
    measured: str = ""

    def __post_init__(self) -> None:
        from orbits.checks import checked_flag  # imports NumPy, which the start of the command line avoids

        if not isinstance(self.claim, str):
            raise InputError(f"the claim of a Check is {shown(self.claim)}; expected a text: Check(claim, ok, ...).")
        object.__setattr__(self, "ok", checked_flag(self.ok, f"ok of Check({shown(self.claim)}, ...)"))
        object.__setattr__(self, "measured", "" if self.measured is None else str(self.measured))

    @property
    def failure(self) -> str:
        """The claim and the measured value, for a list of failures."""
        return f"{self.claim}: {self.measured}" if self.measured else self.claim


def _is_function(value: Any) -> bool:
    """Whether a value is a function, rather than a class or a value."""
    return callable(value) and not isinstance(value, type)


def _names(value: Any) -> tuple[str, ...] | None:
    """Return a list of names; None for anything else."""
    try:
        names = tuple(value)
    except TypeError:  # also numbers that call themselves iterable
        return None
    return None if isinstance(value, str) or not all(isinstance(name, str) for name in names) else names


def _check_takes_options(function: Any, scenario: str, what: str) -> None:
    """Raise InputError for a function that cannot be called with the values of the options."""
    if not _is_function(function):
        return
    try:
        inspect.signature(function).bind({})
    except TypeError as error:
        raise InputError(
            f"scenario {scenario!r}: {what} is a function that cannot be called with the values of the options "
            f"({error}); expected one argument: def {what}(options), which has options['NAME']."
        ) from None
    except ValueError:  # a function without a signature
        return


def _default_integrators() -> tuple[Any, ...]:
    from orbits.integrators.gauss import Gauss  # imports Numba, which the start of the command line avoids

    return (Gauss(stages=8),)


def check_label(name: Any, title: Any) -> None:
    """Raise InputError unless `name` is suitable for a folder and `title` is one line of text."""
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise InputError(
            f"a scenario's name becomes a folder: letters, digits, '_', '-' and '.' only; got {shown(name)}."
        )
    if not isinstance(title, str) or not title.strip() or "\n" in title:
        raise InputError(f"scenario {name!r}: title must be one line of text; got {shown(title)}.")


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """A system, methods, tolerances, checks and pictures.

    name : of the results folder and of the files in it; letters, digits, `_`, `-`, `.`
    title : one line for lists and pictures
    system : a `System`, or a function that makes one, without arguments; in a scenario with options it has one, their
        values by name. For several related problems, a mapping from short names to Systems (or a function that makes
        such a mapping): each is a *case*, run and judged in the same way
    integrators : methods as in `orbits.propagate`, values or texts such as "gauss", by default Gauss with 8 stages; the
        run of the first one is archived
    dt, duration : as in `orbits.propagate`; the sign of `duration` gives the direction. Without dt, or with
        `orbits.Adaptive(...)`, steps are chosen one by one. In a scenario with options dt may also be a function of
        their values
    samples : number of samples, both ends included
    approaches : as in `orbits.propagate`: True for checks and pictures that use the closest approaches of a run by a
        method that does not look for them by default
    against : peers to compare with, such as "whfast" and "ias15"; empty for no comparison. Only "ias15" takes part in
        a comparison without dt
    tolerances : of the comparison, as in `orbits.compare`
    checks : a function from the `Outcome` to the `Check`s that it must pass
    draw : a function from the `Outcome` to a matplotlib Figure, or to several by name; by default the orbits,
        conserved quantities, and the comparison
    options : its own `Option`s, which `--set NAME=VALUE` and `with_options` change
    chosen : their values by name; those that are left out have their defaults. `system` and `dt` get all of them as
        their argument, `checks` and `draw` find them in `outcome.options`

    Raises InputError for errors that can be detected here; systems are made, and times are read, when it runs.

    A complete scenario file:

        import orbits
        from astropy import units as u

        scenario = orbits.scenarios.Scenario(
            name="giants",
            title="The four giants for ten thousand years",
            system=lambda: orbits.System.solar_system(bodies=["Sun", "Jupiter", "Saturn", "Uranus", "Neptune"]),
            integrators=[orbits.Gauss(stages=8)],
            dt=60 * u.day,
            duration=10_000 * u.yr,
            tolerances={"angular_momentum": 1e-14},
        )

        if __name__ == "__main__":
            scenario.main()
    """

    name: str
    title: str
    system: System | Mapping[str, System] | Callable[..., System | Mapping[str, System]]
    integrators: Sequence[Any] = field(default_factory=_default_integrators)
    dt: Any = None
    duration: Any
    samples: int = 101
    approaches: bool | None = None
    against: Sequence[str] = ("whfast", "ias15")
    tolerances: Mapping[str, Any] = field(default_factory=dict)
    checks: Callable[[Outcome], Iterable[Check]] | None = None
    draw: Callable[[Outcome], Figure | Mapping[str, Figure]] | None = None
    options: Sequence[Option] = ()
    chosen: Mapping[str, Any] = field(default_factory=dict)

    if TYPE_CHECKING:  # set by the package: it lives with the command line
        main: ClassVar[Callable[[], None]]

    def __post_init__(self) -> None:
        # These import NumPy, which the start of the command line avoids.
        from orbits.checks import checked_choice, whole_number
        from orbits.integrators import named

        check_label(self.name, self.title)
        against = _names(self.against)
        if against is None:
            raise InputError(
                f"scenario {self.name!r}: against must be a list of peers' names, such as ['whfast']; "
                f"got {shown(self.against)}."
            )
        listed = isinstance(self.integrators, Sequence) and not isinstance(self.integrators, str)
        given: Sequence[Any] = self.integrators if listed else [self.integrators]
        if not given:
            raise InputError(f"scenario {self.name!r}: integrators is empty; name one, such as orbits.Gauss(stages=8).")
        try:
            integrators = tuple(named(method) for method in given)
        except InputError as error:
            raise type(error)(f"scenario {self.name!r}: {error}") from None
        labels = [method.label for method in integrators]
        for label in (label for k, label in enumerate(labels) if label in labels[:k]):
            raise InputError(f"scenario {self.name!r}: {label} is among the integrators twice; give each method once.")
        whole_number(self.samples, f"scenario {self.name!r}: samples (both ends included)", least=2)
        checked_choice(self.approaches, f"scenario {self.name!r}: approaches")
        if not isinstance(self.tolerances, Mapping) or not all(isinstance(key, str) for key in self.tolerances):
            raise InputError(
                f"scenario {self.name!r}: tolerances must be a mapping such as {{'energy': 1e-12}}; got "
                f"{self.tolerances!r}."
            )
        for what in ("checks", "draw"):
            if getattr(self, what) is not None and not callable(getattr(self, what)):
                raise InputError(f"scenario {self.name!r}: {what} must be a function of the outcome.")
        options = checked_options(self.options, self.name)
        for what in ("system", "dt") if options else ():
            _check_takes_options(getattr(self, what), self.name, what)
        object.__setattr__(self, "options", options)
        object.__setattr__(self, "chosen", all_values(options, self.chosen, self.name))
        object.__setattr__(self, "integrators", integrators)
        object.__setattr__(self, "against", against)

    def cases(self) -> dict[str, System]:
        """Return the systems to run, by case; a scenario with one system has one case, named "".

        Raises InputError if `system` does not give systems.
        """
        from orbits.system import System

        made = self.system(*self._given()) if callable(self.system) else self.system
        cases = {ONLY: made} if isinstance(made, System) else made
        if not isinstance(cases, Mapping) or not cases:
            raise InputError(
                f"scenario {self.name!r}: system must give a System, or systems by name; got {type(made).__name__}."
            )
        for key, system in cases.items():
            if not isinstance(key, str) or not isinstance(system, System):
                raise InputError(
                    f"scenario {self.name!r}: system must give a System, or systems by name; "
                    f"got {shown(key)}: {type(system).__name__}."
                )
        slugs = [slug(key) for key in cases]
        if len(set(slugs)) < len(slugs):
            raise InputError(f"scenario {self.name!r}: the cases' names {list(cases)} do not give distinct file names.")
        return dict(cases)

    def with_changes(self, **changes: Any) -> Scenario:
        """Return the scenario with some fields replaced; None leaves a field unchanged."""
        return replace(self, **{key: value for key, value in changes.items() if value is not None})

    def with_options(self, /, **values: Any) -> Scenario:
        """Return the scenario with other values of its own options.

        Raises UnknownNameError for a name that is not that of an option, with the nearest, and InputError for a value
        that an option cannot have.
        """
        return replace(self, chosen={**self.chosen, **values})

    def step(self) -> Any:
        """Return dt, that of the chosen values if it depends on the options."""
        return self.dt(*self._given()) if self.options and _is_function(self.dt) else self.dt

    def origin(self) -> Origin | None:
        """Return what archives say of the scenario: its name and the values of its options; None without options."""
        from orbits.archive.origin import Origin  # imports h5py, which the start of the command line avoids

        return Origin(self.name, dict(self.chosen)) if self.options else None

    def headline(self) -> str:
        """Return the title, with the values of options that are not the defaults."""
        changed = {each.name: self.chosen[each.name] for each in self.options if self.chosen[each.name] != each.default}
        if not changed:
            return self.title
        return f"{self.title} ({options_text(changed)})"

    def _given(self) -> tuple[dict[str, Any], ...]:
        """What functions of the options are called with."""
        return (dict(self.chosen),) if self.options else ()

    def demands(self) -> dict[str, Any]:
        """The tolerances, except those for methods of this package that the scenario does not run.

        This allows running a scenario with other methods than its own.
        """
        from orbits import integrators

        mine = {name.lower() for method in self.integrators for name in (method.name, method.label)}

        def of_another(key: str) -> bool:
            with suppress(InputError):
                return key.lower() not in mine and bool(integrators.named(key))
            return False

        return {key: value for key, value in self.tolerances.items() if not of_another(key)}


@dataclass(frozen=True)
class CaseOutcome:
    """The results for one system.

    runs : by the integrator's label, in the scenario's order; the first one reads from the archive
    report : the comparison with the peers, None without one
    """

    name: str
    system: System
    runs: Mapping[str, Trajectory]
    report: Report | None = None

    @property
    def run(self) -> Trajectory:
        """The run of the first integrator."""
        return next(iter(self.runs.values()))


@dataclass(frozen=True)
class Outcome:
    """The results of performing a scenario, which are passed to its `checks` and `draw`.

    cases : by name; `run`, `runs` and `report` are those of the first case
    folder : of the files
    files : the files written, in order
    complaints : problems after the integration, in words, such as a picture that could not be drawn
    """

    scenario: Scenario
    folder: Path
    cases: Mapping[str, CaseOutcome]
    checks: tuple[Check, ...] = ()
    files: tuple[Path, ...] = ()
    complaints: tuple[str, ...] = ()

    @property
    def options(self) -> dict[str, Any]:
        """The values of the scenario's options, by name."""
        return dict(self.scenario.chosen)

    @property
    def case(self) -> CaseOutcome:
        """The first case, often the only one."""
        return next(iter(self.cases.values()))

    @property
    def run(self) -> Trajectory:
        """The archived run of the first case."""
        return self.case.run

    @property
    def runs(self) -> Mapping[str, Trajectory]:
        """All runs of the first case, by the integrator's label."""
        return self.case.runs

    @property
    def report(self) -> Report | None:
        """The comparison of the first case."""
        return self.case.report

    @property
    def failures(self) -> tuple[str, ...]:
        """All requirements that do not hold, in words."""
        exceeded = [
            f"{case.name}: {failure}" if case.name else failure
            for case in self.cases.values()
            for failure in (case.report.failures if case.report is not None else ())
        ]
        return (*exceeded, *(check.failure for check in self.checks if not check.ok), *self.complaints)

    @property
    def ok(self) -> bool:
        """Whether all requirements of the scenario hold."""
        return not self.failures


def angular_momentum_checks(
    runs: Mapping[str, Trajectory],
    *,
    bound: float,
    controls: bool = True,
    case: str = "",
    **others: Unpack[NoOthers],
) -> Iterator[Check]:
    """Yield a check for each run: angular momentum is kept by methods that declare it, and lost by the others.

    runs : by the integrator's label
    bound : the largest relative change that counts as kept; ten times as much counts as lost
    controls : whether the non-symplectic controls must be seen to lose it. At short steps that may take them long; a
        run shorter than one step is never held to it
    case : prefix of the claims, for a scenario with several cases
    """
    if others:
        raise unknown_argument(angular_momentum_checks, next(iter(others)))
    for label, run in runs.items():
        change = run.drift().angular_momentum.max_fraction
        head = f"{case}: {label}" if case else label
        if "momentum maps" in run.integrator.declares:
            yield Check(f"{head} keeps angular momentum", change < bound, f"{change:.1e}")
        elif controls and not abs(run.times[-1]) <= 0.99 * abs(run.step):  # dt was rounded
            yield Check(f"{head} loses angular momentum", change > 10 * bound, f"{change:.1e}")


def slug(case: str) -> str:
    """Return a case's name in the form used in file names: `e = 0.9` gives `e-0.9`."""
    return re.sub(r"[^A-Za-z0-9_.]+", "-", case).strip("-.")
