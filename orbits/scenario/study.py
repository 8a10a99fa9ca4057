"""Studies: scenarios that are general numerical experiments instead of a system and its runs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from orbits.errors import InputError, shown
from orbits.scenario.definition import Check, check_label
from orbits.scenario.parts import identity

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Say = Callable[[str], None]


@dataclass(frozen=True)
class Table:
    """A table of a study: a title, column heads, and rows of text, whole numbers and floats.

    Raises InputError for a row whose length differs from the number of columns.
    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[Any]]

    def __post_init__(self) -> None:
        for name in ("columns", "rows"):
            object.__setattr__(self, name, list(getattr(self, name)))
        for row in self.rows:
            if len(row) != len(self.columns):
                raise InputError(
                    f"table {self.title!r} has {len(self.columns)} columns, but a row of {len(row)}: {list(row)!r}"
                )

    def _repr_html_(self) -> str:
        from orbits.export import html_table  # imports astropy, which the start of the command line avoids

        text = [all(isinstance(row[k], str | None) for row in self.rows) for k in range(len(self.columns))]
        words = text.index(False) if False in text else len(text)
        return html_table(self.title, self.columns, [[cell(value) for value in row] for row in self.rows], words=words)


def _is_named(values: Any) -> bool:
    """Return whether these are values by name."""
    return isinstance(values, Mapping) and all(isinstance(name, str) for name in values)


def cell(value: Any) -> str:
    """Return a value as text for a table."""
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.3g}"
    return f"{value:,}" if isinstance(value, int) and not isinstance(value, bool) else str(value)


@dataclass(frozen=True, kw_only=True)
class StudyResult:
    """The result of a study's experiment.

    tables : to print, and to store in report.json
    checks : the requirements, with measured values
    figures : functions that make matplotlib Figures, by file name; called only if pictures are drawn
    record : further values for report.json

    Raises InputError for values of another kind.
    """

    tables: Sequence[Table] = ()
    checks: Sequence[Check] = ()
    figures: Mapping[str, Callable[[], Figure]] = field(default_factory=dict)
    record: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, kind in (("tables", Table), ("checks", Check)):
            given = getattr(self, name)
            listed = tuple(given) if isinstance(given, Iterable) else (given,)
            object.__setattr__(self, name, listed)
            for one in listed:
                if not isinstance(one, kind):
                    raise InputError(f"{name} must be orbits.scenarios.{kind.__name__} values, got {shown(one)}.")
        if not _is_named(self.figures) or not all(map(callable, self.figures.values())):
            raise InputError(f"figures is {shown(self.figures)}; expected functions by name: {{'a': draw}}.")
        if not _is_named(self.record):
            raise InputError(f"record is {shown(self.record)}; expected values by name, such as {{'spread': 0.1}}.")

    def _repr_html_(self) -> str:
        return "".join(table._repr_html_() for table in self.tables)


@dataclass(frozen=True, kw_only=True)
class Study:
    """A numerical experiment that is run, judged and drawn like a scenario.

    name, title : as in `Scenario`
    experiment : a function of `say`, which prints a message about the progress, that returns a `StudyResult`
    dt : the steps of its runs, as of `orbits.propagate`, if the experiment takes them as its second argument, and
        --dt replaces them; None for an experiment with steps of its own
    resumable : whether the experiment takes `Parts` as its last argument, and computes its parts by
        `parts.get(name, compute)`: a study that was interrupted takes those over that are done. It
        must be a function in a file, which is compared
    certifies : the problems for `orbits certify`: tuples (Lagrangian or System, integrator, dt) or, for a Lagrangian,
        (Lagrangian, integrator, dt, q, v) with initial q, v of shape (d,)

    Raises InputError for errors that can be detected here; the experiment is performed when the study runs.

        def experiment(say):
            path = orbits.march(orbits.lagrangians.pendulum, orbits.StormerVerlet(), dt=0.1, steps=10_000)
            spread = float(np.ptp(path.energy()))
            check = orbits.scenarios.Check("the energy stays bounded", spread < 0.01, f"{spread:.1e}")
            return orbits.scenarios.StudyResult(checks=[check])

        scenario = orbits.scenarios.Study(name="bounded", title="The energy of a pendulum", experiment=experiment)

        if __name__ == "__main__":
            scenario.main()
    """

    name: str
    title: str
    experiment: Callable[..., StudyResult]
    certifies: Sequence[tuple[Any, ...]] = ()
    dt: Any = None
    resumable: bool = False

    if TYPE_CHECKING:  # set by the package: it lives with the command line
        main: ClassVar[Callable[[], None]]

    def __post_init__(self) -> None:
        check_label(self.name, self.title)
        if not callable(self.experiment):
            raise InputError(
                f"study {self.name!r}: experiment must be a function of `say`; got {shown(self.experiment)}."
            )
        if self.resumable:
            identity(self.experiment, self.name, self.dt)
        for entry in self.certifies:
            if not isinstance(entry, tuple) or len(entry) not in (3, 5) or not hasattr(entry[1], "declares"):
                raise InputError(
                    f"study {self.name!r}: certifies holds {shown(entry)}; expected (Lagrangian, integrator, dt), or "
                    "(Lagrangian, integrator, dt, q, v)."
                )
        object.__setattr__(self, "certifies", tuple(self.certifies))


@dataclass(frozen=True)
class StudyOutcome:
    """The outcome of performing a study: its result, the files written, and problems after the experiment."""

    scenario: Study
    folder: Path
    result: StudyResult
    files: tuple[Path, ...] = ()
    complaints: tuple[str, ...] = ()

    @property
    def checks(self) -> tuple[Check, ...]:
        """What had to hold."""
        return tuple(self.result.checks)

    @property
    def failures(self) -> tuple[str, ...]:
        """All requirements that do not hold, in words."""
        return (*(check.failure for check in self.checks if not check.ok), *self.complaints)

    @property
    def ok(self) -> bool:
        """Whether all requirements of the study hold."""
        return not self.failures
