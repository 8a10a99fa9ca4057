"""The options of `orbits run` and of `python scenarios/NAME.py`; errors as single lines."""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from io import TextIOWrapper
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from orbits.errors import InputError, Interrupted, OrbitsError, OutOfTime
from orbits.scenario.definition import Outcome, Scenario
from orbits.scenario.options import read_options
from orbits.scenario.printed import escaped, saying, show, show_certificates, show_options, stderr
from orbits.scenario.study import Study, StudyOutcome
from orbits.scenario.typed import number_or_text, quantity, step_or_clock, this_command

if TYPE_CHECKING:
    from orbits.propagation.control.heartbeat import Heartbeat
    from orbits.propagation.control.wall_clock import Deadline

Dt = Annotated[
    str | None,
    typer.Option(
        help="Step: '6 d', a number in the system's unit of time, or P/20, a twentieth of the shortest orbital period, "
        "with --duration for the direction; adaptive or adaptive:1e-8 for steps chosen one by one, to a tolerance; "
        "transformed or transformed:0.3 for constant steps of transformed time.",
        metavar="STEP",
    ),
]
Duration = Annotated[
    str | None,
    typer.Option(
        help="How far: '100 yr', or a number in the system's unit of time; negative for backwards.", metavar="TIME"
    ),
]
Method = Annotated[
    str | None,
    typer.Option(
        help="One method instead of the scenario's: gauss, 'gauss(stages=4)', wisdom-holman. `orbits list` has all.",
        metavar="METHOD",
    ),
]
Samples = Annotated[int | None, typer.Option(help="Number of samples, both ends included.", metavar="NUMBER")]
Approaches = Annotated[
    bool | None,
    typer.Option(
        "--approaches/--no-approaches",
        help="Whether closest approaches are looked for. Gauss does so by default; methods with cheap steps, such as "
        "maps, do not, as it may take longer than their steps.",
        metavar="",
    ),
]
Own = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="An option of the scenario's own, again for more: --set count=500; `orbits run SCENARIO --list-options` "
        "lists them.",
        metavar="NAME=VALUE",
    ),
]
ListOptions = Annotated[
    bool,
    typer.Option("--list-options", help="List the scenario's own options, for --set, and run nothing.", metavar=""),
]
Out = Annotated[Path | None, typer.Option(help="Folder for the results; results/NAME by default.", metavar="FOLDER")]
Json = Annotated[bool, typer.Option("--json", help="Print the outcome as JSON on standard output.", metavar="")]
NoPlot = Annotated[bool, typer.Option("--no-plot", help="Draw nothing.", metavar="")]
WallTime = Annotated[
    str | None,
    typer.Option(
        help="The longest that the command may take: '2 h', 12:00:00, or seconds. It then stops with status 75 and "
        "says how to go on.",
        metavar="TIME",
    ),
]
Beat = Annotated[
    str | None,
    typer.Option(
        "--heartbeat",
        help="Wall time from one line about the run to the next, instead of a bar: '60 s', '5 min', a number of "
        "seconds, or never. By default a minute where there is no terminal. A line has the time reached, steps per "
        "second, what is left, and the drifts of energy and angular momentum.",
        metavar="TIME",
    ),
]


@contextmanager
def guarded() -> Iterator[None]:
    """End the process with errors on one line, and exit code 2 for wrong use, 1 for a failure, 130 after a signal."""
    for stream in ("stdout", "stderr"):
        if getattr(sys, stream) is None:  # closed, as by >&-: what is opened next would get its number
            setattr(sys, stream, os.fdopen(os.open(os.devnull, os.O_WRONLY), "w", encoding="utf-8"))
    if isinstance(sys.stdout, TextIOWrapper) and not sys.stdout.encoding.lower().startswith("utf"):
        sys.stdout.reconfigure(errors="replace")  # a terminal that cannot show a letter gets the others
    try:
        with _signals_interrupt():
            yield
        sys.stdout.flush()
    except OutOfTime as error:
        stderr().print(f"[bold yellow]stopped:[/] {escaped(str(error))}", soft_wrap=True)
        raise SystemExit(error.exit_code) from None
    except (OrbitsError, Interrupted) as error:
        stderr().print(f"[bold red]error:[/] {escaped(' '.join(str(error).split()))}", soft_wrap=True)
        raise SystemExit(error.exit_code) from None
    except KeyboardInterrupt:
        stderr().print("[bold red]error:[/] stopped by Ctrl-C.")
        raise SystemExit(Interrupted.exit_code) from None
    except BrokenPipeError:
        # The reader, such as `head`, has closed the pipe; Python would report this again at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise SystemExit(0) from None
    except MemoryError:
        stderr().print("[bold red]error:[/] not enough memory; take fewer samples or particles.")
        raise SystemExit(1) from None
    except OSError as error:
        stderr().print(f"[bold red]error:[/] {escaped(str(error))}", soft_wrap=True)
        raise SystemExit(1) from None
    except (typer.Exit, typer.Abort):
        raise
    except Exception as error:
        what = f"{type(error).__name__}: {' '.join(str(error).split())}; this is a bug in orbits: please report it"
        stderr().print(f"[bold red]error:[/] {escaped(what)}", soft_wrap=True)
        raise SystemExit(1) from None


@contextmanager
def _signals_interrupt() -> Iterator[None]:
    """Let SIGTERM and SIGHUP end what is done here as Ctrl-C does, also where no run is marched."""

    def stop(number: int, _: Any) -> None:
        raise Interrupted(f"stopped by {signal.Signals(number).name}")

    known = (getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
    taken = [number for number in known if signal.getsignal(number) == signal.SIG_DFL]
    if threading.current_thread() is not threading.main_thread():
        taken = []
    for number in taken:
        signal.signal(number, stop)
    try:
        yield
    finally:
        for number in taken:
            signal.signal(number, signal.SIG_DFL)


SOON = 5.0
"""Seconds until the first line about a run where there is no terminal: what is left is then measured."""


@dataclass(frozen=True)
class Pacing:
    """What the options say of the wall time: the lines about a run, and the limit of the command."""

    heartbeat: Heartbeat | None = None
    deadline: Deadline | None = None


def paced(wall_time: str | None, heartbeat: str | None) -> Pacing:
    """Return the options `--wall-time` and `--heartbeat` as values. Raises InputError for what cannot be read."""
    from orbits.propagation.control.compiling import words
    from orbits.propagation.control.heartbeat import Heartbeat
    from orbits.propagation.control.wall_clock import Deadline, seconds_of

    words.in_logs = heartbeat is None or heartbeat.strip().lower() != "never"
    deadline = None if wall_time is None else Deadline(number_or_text(wall_time), "--wall-time")
    if heartbeat is None:
        return Pacing(None if sys.stderr.isatty() else Heartbeat(first=SOON), deadline)
    if heartbeat.strip().lower() == "never":
        return Pacing(None, deadline)
    return Pacing(Heartbeat(seconds_of(number_or_text(heartbeat), "--heartbeat")), deadline)


def with_own(scenario: Scenario | Study, typed: Sequence[str] | None) -> Scenario | Study:
    """Return the scenario with the values of its own options, as typed after --set. Raises InputError for a study, and
    for what cannot be read.
    """
    if not typed:
        return scenario
    if isinstance(scenario, Study):
        raise InputError(f"{scenario.name!r} is a study, which has no options of its own: it takes no --set.")
    return scenario.with_options(**read_options(scenario.options, typed, scenario.name))


def changed(
    scenario: Scenario | Study,
    dt: str | None,
    duration: str | None,
    integrator: str | None,
    samples: int | None,
    own: Sequence[str] | None = None,
    approaches: bool | None = None,
) -> Scenario | Study:
    """Return the scenario with the options of the command line. Raises InputError for those that a study refuses: all
    of them, but for --dt if it has one.
    """
    scenario = with_own(scenario, own)
    if isinstance(scenario, Study):
        typed = {"--dt": dt, "--duration": duration, "--integrator": integrator, "--samples": samples}
        typed |= {"--approaches" if approaches else "--no-approaches": approaches}
        takes = ["--dt"] if scenario.dt is not None else []
        refused = [option for option, value in typed.items() if value is not None and option not in takes]
        if refused:
            own = "methods and lengths" if takes else "steps, methods and lengths"
            raise InputError(
                f"{scenario.name!r} is a study with {own} of its own: it takes no {' or '.join(refused)}; it takes "
                f"{', '.join([*takes, '--out', '--json'])} and --no-plot."
            )
        return scenario if dt is None else replace(scenario, dt=step_or_clock(dt, "--dt"))
    from orbits import integrators
    from orbits.marching.clocks.clock import Clock

    new = scenario.with_changes(
        dt=None if dt is None else step_or_clock(dt, "--dt"),
        duration=None if duration is None else quantity(duration, "--duration"),
        integrators=None if integrator is None else [integrators.parse(integrator)],
        samples=samples,
        approaches=approaches,
    )
    if isinstance(new.dt, Clock):
        try:
            for method in new.integrators:
                new.dt.check(method)
        except InputError as error:
            raise InputError(f"{error} Here: --integrator gauss") from None
    return new


def execute(
    scenario: Scenario | Study,
    *,
    list_options: bool,
    as_json: bool,
    out: Path | None,
    no_plot: bool,
    wall_time: str | None,
    heartbeat: str | None,
) -> None:
    """Perform a scenario, print its outcome, and end with the exit code; or list its options."""
    from orbits.scenario.performing import perform, to_json

    if list_options:
        show_options(scenario, as_json=as_json)
        return
    console = stderr()
    console.print(f"[bold]{escaped(scenario.title if isinstance(scenario, Study) else scenario.headline())}[/]")
    outcome: Outcome | StudyOutcome
    if isinstance(scenario, Study):
        _refuse_pacing(scenario, wall_time, heartbeat)
        outcome = perform(scenario, out=out, plot=not no_plot, say=saying(console))
    else:
        pacing = paced(wall_time, heartbeat)
        try:
            outcome = perform(
                scenario,
                out=out,
                plot=not no_plot,
                say=saying(console),
                heartbeat=pacing.heartbeat,
                wall_time=pacing.deadline,
            )
        except Interrupted as stopped:
            raise Interrupted(stopped.what, f"to go on: {this_command()}") from None
    if as_json:
        print(to_json(outcome))
    else:
        show(outcome)
    raise typer.Exit(0 if outcome.ok else 1)


def _refuse_pacing(study: Study, wall_time: str | None, heartbeat: str | None) -> None:
    given = [name for name, value in {"--wall-time": wall_time, "--heartbeat": heartbeat}.items() if value is not None]
    if given:
        raise InputError(
            f"{study.name!r} is a study, which makes its runs by itself: it takes no {' or '.join(given)}."
        )


def certify(
    scenario: Scenario | Study, dt: str | None, integrator: str | None, *, out: Path | None, as_json: bool
) -> int:
    """Certify the methods of a scenario, print the tables, and return the exit code."""
    from orbits import integrators
    from orbits.scenario.certificates import certify_scenario, to_record

    console = stderr()
    console.print(f"[bold]{escaped(scenario.title if isinstance(scenario, Study) else scenario.headline())}[/]")
    outcome = certify_scenario(
        scenario,
        dt=None if dt is None else step_or_clock(dt, "--dt"),
        integrator=None if integrator is None else integrators.parse(integrator),
        out=out,
        say=saying(console),
    )
    if as_json:
        print(json.dumps(to_record(outcome), indent=1))
    else:
        show_certificates(outcome)
    return 0 if outcome.ok else 1


def main(scenario: Scenario | Study) -> None:
    """Run a scenario as a program; ends the process."""

    def run(
        dt: Dt = None,
        duration: Duration = None,
        integrator: Method = None,
        samples: Samples = None,
        approaches: Approaches = None,
        own: Own = None,
        out: Out = None,
        as_json: Json = False,
        no_plot: NoPlot = False,
        wall_time: WallTime = None,
        heartbeat: Beat = None,
        list_options: ListOptions = False,
    ) -> None:
        with guarded():
            how: dict[str, Any] = {"out": out, "no_plot": no_plot, "wall_time": wall_time, "heartbeat": heartbeat}
            chosen = changed(scenario, dt, duration, integrator, samples, own, approaches)
            execute(chosen, list_options=list_options, as_json=as_json, **how)

    options = "" if isinstance(scenario, Study) else "--duration '10 yr' "
    run.__doc__ = f"{scenario.title}\n\nExample: python {Path(sys.argv[0]).name} {options}--no-plot"
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    app.command()(run)
    app()
