"""What commands print of a scenario: messages to people, and on standard output tables, checks, files and verdicts."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orbits.option_values import option_text
from orbits.scenario.definition import MIND, Outcome, Scenario
from orbits.scenario.study import Study, StudyOutcome, Table, cell

if TYPE_CHECKING:
    from rich.console import Console

    from orbits.scenario.certificates import CertifyOutcome


def stderr() -> Console:
    """Return the console for messages to people, while standard output is for results."""
    from rich.console import Console

    return Console(stderr=True, highlight=False)


def stdout() -> Console:
    """Return the console for results: as wide as the terminal, or 100 columns otherwise."""
    from rich.console import Console

    class Results(Console):
        def on_broken_pipe(self) -> None:
            raise BrokenPipeError  # for `guarded`, as `print` does; Rich would end with the status 1

    console = Results(highlight=False)
    return console if console.is_terminal else Results(highlight=False, width=100)


def show_certificates(outcome: CertifyOutcome) -> None:
    """Print the tables and the verdict on standard output."""
    console = stdout()
    for each in outcome.certified:
        if each.case:
            console.print(f"[bold]{escaped(each.case)}[/]")
        console.print(escaped(each.certificate.table()), soft_wrap=True)
        if each.control:
            console.print("  a control, shown for comparison: it does not claim to be variational, and is not judged")
        console.print()
    console.print(f"wrote {escaped(str(outcome.file))}", soft_wrap=True)
    judged = [each for each in outcome.certified if not each.control]
    if outcome.ok:
        controls = len(outcome.certified) - len(judged)
        shown = f", {controls} control{'s' * (controls > 1)} not judged" if controls else ""
        console.print(f"[bold green]ok:[/] {len(judged)} certified{shown}")
    for each in judged:
        if not each.ok:
            where = f"{each.case}: " if each.case else ""
            console.print(f"[bold red]FAILED:[/] {escaped(where + each.certificate.method)} is not certified")


def show(outcome: Outcome | StudyOutcome) -> None:
    """Print tables, checks, files and the verdict on standard output."""
    from rich.padding import Padding

    console = stdout()
    if isinstance(outcome, StudyOutcome):
        for table in outcome.result.tables:
            console.print(_table(table))
            console.print()
    else:
        for name, case in outcome.cases.items():
            if case.report is not None:
                console.print(case.report)
            else:
                for label, run in case.runs.items():
                    console.print(f"{escaped(name)} {escaped(label)}".strip())
                    console.print(escaped(run.drift()))
    for check in outcome.checks:
        mark = "[green]holds[/]" if check.ok else "[bold red]FAILS[/]"
        console.print(f"{mark}  {escaped(check.claim)}" + (f": {escaped(check.measured)}" if check.measured else ""))
    console.print()
    for folder, names in _by_folder(outcome.files).items():
        console.print(f"wrote to {escaped(folder)}:", soft_wrap=True)
        console.print(Padding(escaped(", ".join(names)), (0, 0, 0, 2)))
    if outcome.ok:
        console.print("[bold green]ok:[/] all requirements of this scenario hold")
    for failure in outcome.failures:
        console.print(f"[bold red]FAILED:[/] {escaped(failure)}")


def _by_folder(files: Sequence[Path]) -> dict[str, list[str]]:
    """Return the names of files by their folders."""
    found: dict[str, list[str]] = {}
    for path in files:
        found.setdefault(str(path.parent), []).append(path.name)
    return found


def show_options(scenario: Scenario | Study, *, as_json: bool = False) -> None:
    """Print the options of a scenario's own on standard output."""
    options = () if isinstance(scenario, Study) else scenario.options
    if as_json:
        print(json.dumps([option.record() for option in options], indent=1))
        return
    if not options:
        print(f"{scenario.name} has no options of its own.")
        return
    rows = [[f"{each.name}={each.typed}", option_text(each.default), each.help] for each in options]
    stdout().print(_table(Table(f"Options of {scenario.name}, for --set", ["option", "default", "what it is"], rows)))


def _table(table: Table) -> Any:
    from rich.table import Table as RichTable

    made = RichTable(
        title=escaped(table.title), title_justify="left", title_style="bold", box=None, header_style="bold"
    )
    for k, head in enumerate(table.columns):
        numbers = not all(isinstance(row[k], str | None) for row in table.rows)
        made.add_column(escaped(head), justify="right" if numbers else "left")
    for row in table.rows:
        made.add_row(*(escaped(cell(value)) for value in row))
    return made


def saying(console: Console) -> Any:
    """Return the function by which a scenario says what it does."""

    def say(text: str) -> None:
        under_way = "" if text.startswith(MIND) else " ..."
        console.print(f"[dim]{escaped(text)}{under_way}[/]")

    return say


def escaped(text: Any) -> str:
    """Return a text in which brackets are no markup."""
    from rich.markup import escape

    return escape(str(text))
