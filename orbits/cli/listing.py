"""The command `list`: what is there to run, and to run it by."""

from __future__ import annotations

import json

from orbits.scenario.command import Json, guarded
from orbits.scenario.printed import stdout


def list_(as_json: Json = False) -> None:
    """List the bundled scenarios, and the integrators with the properties they declare.

    Example: orbits list --json
    """
    with guarded():
        from orbits import integrators
        from orbits.scenario import bundled

        methods = [cls() for _, cls in sorted(integrators.registry().items())]
        if as_json:
            record = {
                "scenarios": [
                    {"name": s.name, "summary": s.summary, "path": str(s.path), "options": list(s.options)}
                    for s in bundled()
                ],
                "integrators": [
                    {
                        "name": m.name,
                        "label": m.label,
                        "order": m.order,
                        "declares": sorted(m.declares),
                        "summary": m.summary,
                        "source": m.source,
                    }
                    for m in methods
                ],
            }
            print(json.dumps(record, indent=1))
            return
        from rich.table import Table

        console = stdout()
        table = Table("scenario", "what it shows", box=None, header_style="bold")
        for each in bundled():
            options = f"; options: {', '.join(each.options)}" if each.options else ""
            table.add_row(each.name, each.summary + options)
        console.print(table)
        console.print()
        table = Table("integrator", "order", "declares", "what it is", box=None, header_style="bold")
        for m in methods:
            table.add_row(m.name, str(m.order), ", ".join(sorted(m.declares)) or "nothing", m.summary)
        console.print(table)
