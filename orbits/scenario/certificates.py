"""Certificates for the methods of a scenario, measured on its own problems."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from orbits.certificate import Certificate, certify
from orbits.errors import InputError
from orbits.marching.clocks.adaptive import Adaptive
from orbits.scenario.definition import Scenario
from orbits.scenario.files import replaceable, results_folder, write_text
from orbits.scenario.loading import located
from orbits.scenario.study import Study
from orbits.time_grid import TimeGrid


@dataclass(frozen=True)
class Certified:
    """One method on one problem of a scenario.

    case : which of the scenario's systems; "" where there is only one, and for a study
    control : whether the method is shown as a control (`Integrator.variational` is False) and is not judged
    """

    case: str
    certificate: Certificate
    control: bool

    @property
    def ok(self) -> bool:
        """Whether the method is certified, or only a control."""
        return self.control or self.certificate.ok


@dataclass(frozen=True)
class CertifyOutcome:
    """The certificates of a scenario, and the file that they were written to."""

    scenario: Scenario | Study
    certified: tuple[Certified, ...]
    file: Path

    @property
    def ok(self) -> bool:
        """Whether every method that is judged is certified."""
        return all(each.ok for each in self.certified)


def certify_scenario(
    scenario: Scenario | Study,
    *,
    dt: Any = None,
    integrator: Any = None,
    out: str | os.PathLike[str] | None = None,
    say: Callable[[str], None] = lambda text: None,
) -> CertifyOutcome:
    """Certify every method of a scenario on all of its systems, or the entries of a study's `certifies`.

    dt, integrator : replace the scenario's own. Controls are not judged, unless `integrator` asks for one
    out : results folder, ./results/NAME by default; certificate.json is written there

    Raises InputError for a study with nothing to certify, and as `orbits.certify` does.
    """
    file = replaceable(results_folder(out or Path("results") / scenario.name) / "certificate.json")
    certified = []
    for case, problem, method, step, start in _problems(scenario, integrator, dt):
        if step is None or isinstance(step, Adaptive):
            raise InputError(
                f"{scenario.name!r} has adaptive steps, and a certificate needs steps of one length: give their length "
                "with --dt, or dt=..."
            )
        say(f"{case + ', ' if case else ''}{method.label}: certifying")
        control = integrator is None and not method.variational
        certificate = certify(problem, method, step, **start)
        certified.append(Certified(case, certificate, control))
    outcome = CertifyOutcome(scenario, tuple(certified), file)
    write_text(file, json.dumps(to_record(outcome), indent=1, allow_nan=False) + "\n")
    return outcome


def to_record(outcome: CertifyOutcome) -> dict[str, Any]:
    """Return the certificates as values for JSON."""
    options = outcome.scenario.chosen if isinstance(outcome.scenario, Scenario) else {}
    return {
        "format": "orbits-certificates",
        "version": 2,  # in version 1 the key "control" was "foil"
        "scenario": outcome.scenario.name,
        **({"options": dict(options)} if options else {}),
        "ok": outcome.ok,
        "certificates": [
            {"case": each.case, "control": each.control, "certificate": each.certificate.to_record()}
            for each in outcome.certified
        ],
    }


def _problems(
    scenario: Scenario | Study, integrator: Any, dt: Any
) -> Iterator[tuple[str, Any, Any, Any, dict[str, Any]]]:
    if isinstance(scenario, Scenario):
        with located():
            cases, own = scenario.cases(), scenario.step()
        for case, system in cases.items():
            step = own if dt is None else dt
            if isinstance(step, str):  # a text such as "P/100", which this system gives a meaning
                step = TimeGrid.of(system, step, duration=scenario.duration, samples=2).dt
            for method in scenario.integrators if integrator is None else (integrator,):
                yield case, system, method, step, {}
        return
    if not scenario.certifies:
        raise InputError(
            f"study {scenario.name!r} names nothing to certify; give it certifies=[(lagrangian, integrator, dt)]."
        )
    seen: list[Any] = []
    for problem, method, step, *start in scenario.certifies:
        if integrator is not None:
            if problem in seen:
                continue
            seen.append(problem)
        yield "", problem, integrator or method, step if dt is None else dt, dict(zip(("q", "v"), start, strict=False))
