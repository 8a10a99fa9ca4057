"""What `orbits info` and `orbits resume` say of the run in an archive: as text, and as a record for JSON."""

from __future__ import annotations

import json
import math
import shlex
import time
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orbits.body_names import few
from orbits.errors import with_unit
from orbits.export import MOST_ROWS, headed, text_table
from orbits.plotting.words import fitting_time
from orbits.propagation.control.wall_clock import wall_time_text
from orbits.units import date_text

if TYPE_CHECKING:
    from orbits.trajectory import Trajectory

CONSERVED = ("energy", "angular_momentum", "linear_momentum", "centre_of_mass")


def record(file: Path, run: Trajectory) -> dict[str, Any]:
    """Return what is in an archive, for JSON."""
    drift = run.drift() if len(run) else None
    ended = None if run.archive is None else run.archive.ended
    origin = None if run.archive is None else run.archive.origin
    found = {
        "file": str(file),
        "bodies": len(run.names),
        "massive": int(run.system.massive.sum()),
        "names": list(run.names),
        "scenario": None if origin is None else asdict(origin),
        "epoch": None if run.system.epoch is None else date_text(run.system.epoch, between="T"),
        "time_unit": str(run.system.units.time),
        "integrator": run.integrator.label,
        "dt": None if run.clock.changes else abs(run.step),
        "samples": len(run),
        "complete": run.complete,
        "from": float(run.times[0]) if len(run) else None,
        "to": float(run.times[-1]) if len(run) else None,
        "reached": run._reached,
        "end": None if run.archive is None else run.archive.grid.end,
        "running": _running(run),
        "ended": {"how": ended.how, "why": ended.why} if ended is not None and ended.how else None,
        "dense_states": None if run._kept is None else len(run._kept),
        "sought": [{key: event[key] for key in ("kind", "given", "then")} for event in _sought(run)],
        "events": run.events.to_records(),
        "legs": [
            {"time": float(leg.time.value), "names": list(leg.names), "gm": leg.gm.value.tolist()} for leg in run.legs
        ],
        "largest_relative_change": {n: _known(getattr(drift, n).max_fraction) for n in CONSERVED} if drift else None,
        "retired": run.retired.to_records(),
        "excursions": run.excursions.to_records(),
        "rigid": [_rigid(run, name) for name in run.system.rigid] if len(run) else [],
    }
    if run.system.forces:
        found["work"] = [
            {"force": effect.force.kind, "work": float(effect.work[-1].value), "energy_unit": str(effect.work.unit)}
            for effect in (run.work() if len(run) else ())
        ]
    return found


def text(file: Path, run: Trajectory) -> str:
    """Return what is in an archive, in paragraphs: the run and how it ended, its bodies, events and drift."""
    running = _running(run)
    origin = None if run.archive is None else run.archive.origin
    told = [] if origin is None else [f"scenario: {origin}"]
    first = [str(run), *told, *_endings(run), *([_under_way(run, running)] if running else [])]
    if run._kept is not None:
        first.append(f"dense output from {len(run._kept):,} states: run.at(times) answers at once")
    parts = ["\n".join(first), str(run.system)]
    if len(run.legs) > 1:
        parts.append(_legs(run))
    if len(run.retired):
        parts.append(str(run.retired))
    if run.excursions.total:
        parts.append(str(run.excursions))
    if run.system.rigid and len(run):
        parts.append(_turning(run))
    if sought := _sought(run):
        parts.append("\n".join(["sought: " + "\n        ".join(map(_said, sought)), str(run.events)]))
    if len(run):
        parts.append("\n".join([str(run.drift()), *map(str, run.work())]))
    if not run.complete and not running:
        functions = any(event["given"] is None or "does" in event for event in sought)
        python = f"orbits.resume({str(file)!r}, events=[...]), in Python: an archive cannot hold functions"
        parts.append(f"not complete: go on with  {python if functions else f'orbits resume {shlex.quote(str(file))}'}")
    return "\n\n".join(parts)


def _endings(run: Trajectory) -> list[str]:
    """Return how a run was ended, if it did not simply come to its end."""
    ended = None if run.archive is None else run.archive.ended
    if ended is None or not ended.how:
        return []
    when = f"t = {with_unit(f'{run._reached:.10g}', run.system.units.time)}"
    words = {"interrupted": f"interrupted by {ended.why} at {when}", "failed": f"failed after {when}: {ended.why}"}
    return [words.get(ended.how, f"{ended.how}: {ended.why}")]


def _running(run: Trajectory) -> dict[str, Any] | None:
    """Return what is known of the process that writes an archive at this moment, None if there is none."""
    archive = run.archive
    writer = None if archive is None else archive.writer
    if archive is None or writer is None:
        return None
    pace, now = archive.pace, time.time()
    rate = pace.rate
    left = abs(archive.grid.end - pace.reached) / rate - (now - pace.committed)
    return {
        "process": None if writer < 0 else writer,
        "fraction": abs(run._reached / archive.grid.end),
        "last_commit_s_ago": now - pace.committed if pace.committed else None,
        "time_covered_per_s": _known(rate),
        "left_s": _known(max(left, 0.0) if left == left else left),
    }


def _under_way(run: Trajectory, known: Mapping[str, Any]) -> str:
    """Return in words how far a run is that is being written."""
    assert run.archive is not None
    end = run.archive.grid.end
    factor, unit = fitting_time(end, run.system.units.time)
    who = "another process" if known["process"] is None else f"process {known['process']}"
    reached = with_unit(f"{factor * run._reached:,.6g} of {factor * end:,.6g}", unit)
    parts = [f"being written by {who}: {known['fraction']:.1%}, t = {reached}"]
    if known["last_commit_s_ago"] is not None:
        parts[0] += f" at the last commit, {wall_time_text(max(0.0, known['last_commit_s_ago']))} ago"
    if known["time_covered_per_s"] is not None:
        hourly = 3600.0 * factor * known["time_covered_per_s"]
        parts.append(with_unit(f"{hourly:,.4g}", unit) + " an hour")
        at = time.strftime("%Y-%m-%d %H:%M", time.localtime(time.time() + known["left_s"]))
        parts.append(f"done in about {wall_time_text(known['left_s'])}, at {at}")
    return "; ".join(parts)


def _sought(run: Trajectory) -> list[dict[str, Any]]:
    """Return the events that were sought, as the archive describes them."""
    known = "" if run.archive is None else run.archive.events_text
    found: list[dict[str, Any]] = json.loads(known) if known else []
    return found


def _said(event: Mapping[str, Any]) -> str:
    """Return what was sought in words: Pericentre(body='p', primary='star'), then stop."""
    given = event["given"] if event["given"] is not None else event.get("of", {})
    fields = [f"{name}={_field(value)}" for name, value in given.items() if value not in (None, [], 0)]
    then = str(event["then"] if "does" not in event else event["does"]["name"])
    return f"{event['kind']}({', '.join(fields)})" + (f", then {then}" if then != "record" else "")


def _field(value: Any) -> str:
    return str(value["name"]) if isinstance(value, dict) and "name" in value else repr(value)


def _legs(run: Trajectory) -> str:
    """Return a table of the parts of a run in which bodies, masses and radii stay the same."""
    legs, before, rows = run.legs, None, []
    for leg in legs[:MOST_ROWS]:
        what = ""
        if before is not None:
            known = dict(zip(before.names, before.gm.value, strict=True))
            gone = [name for name in before.names if name not in leg.names]
            other = [name for name, gm in zip(leg.names, leg.gm.value, strict=True) if gm != known.get(name)]
            parts = [f"{few(names)} {how}" for names, how in ((gone, "gone"), (other, "of another mass")) if names]
            what = ", ".join(parts) or "other radii"
        rows.append([what, f"{leg.time.value:.10g}", f"{len(leg.names):,}"])
        before = leg
    head = ["change", headed("from t", run.system.units.time), "bodies"]
    return text_table(f"{len(legs):,} legs, with other bodies, masses or radii", head, rows, len(legs) - len(rows))


def _rigid(run: Trajectory, name: str) -> dict[str, Any]:
    """Return the moments of inertia of a rigid body, and its attitude and rotation at the last sample."""
    body, last = run.system.rigid[name], run[-1:]
    moments = [float(getattr(x, "value", x)) for x in (body.A, body.B, body.C)]
    return {
        "name": name,
        "moments_per_mass": moments,
        "attitude": last.rotation.attitude(name)[0].tolist(),
        "spin": last.rotation.angular_velocity(name)[0].value.tolist(),
        "rate_unit": str(run.system.units.rate),
    }


def _turning(run: Trajectory) -> str:
    """Return a table of the rigid bodies: their moments, and how they turn at the last sample."""
    rows, last = [], run[-1:]
    for name in list(run.system.rigid)[:MOST_ROWS]:
        moments = _rigid(run, name)["moments_per_mass"]
        shares = " : ".join(f"{x / max(moments):.6g}" for x in moments)
        rate, tilt = last.rotation.rate(name)[0].value, last.rotation.euler_angles(name)[0, 1].value
        rows.append([name, shares, f"{rate:.8g}", f"{tilt:.4g}"])
    head = ["body", "A : B : C", headed("turns by", run.system.units.rate), "tilt [deg]"]
    count = len(run.system.rigid)
    one = "one rigid body" if count == 1 else f"{count:,} rigid bodies"
    return text_table(f"{one}, as at the last sample", head, rows, count - len(rows))


def _known(figure: float) -> float | None:
    """Return a figure, None for what is not conserved: JSON has no NaN."""
    return None if math.isnan(figure) else figure
