"""The page: one HTML file with the style, the scripts, three.js with its licence, and the data; it loads nothing.

The scripts in `static/` are small ES modules. Modules of their own cannot be loaded from disk, so they are joined in
the order of their imports into one script; the widget gets the same, as a module.
"""

from __future__ import annotations

import json
import re
from functools import cache
from html import escape
from importlib.resources import files
from typing import Any

from orbits._version import __version__

IMPORT = re.compile(r'^import \{[^}]*\} from "\./([\w.]+)";\n', re.MULTILINE)
EXPORT = re.compile(r"^export (?=(?:async )?(?:const|let|function|class) )", re.MULTILINE)

POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:; connect-src 'self'"
"""A page may load nothing, and talk only to its own server, whatever the names of its bodies are."""

PAGE = """\
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="generator" content="orbits {version}">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<link rel="icon" href="data:,">
<title>{title}</title>
<style>
html, body {{ margin: 0; height: 100%; }}
{style}
</style>
</head>
<body>
<div class="orbits-view orbits-page"><noscript>This page draws the run with JavaScript, which is switched off here. \
Switch it on, or draw a picture with: orbits plot FILE</noscript></div>
<script type="application/json" id="orbits-data">{data}</script>
<script>
/* three.js
{licence}
*/
{three}
</script>
<script>
(() => {{
"use strict";
{script}
startPage(document.querySelector(".orbits-page"), JSON.parse(document.getElementById("orbits-data").textContent));
}})();
</script>
</body>
</html>
"""


@cache
def asset(name: str) -> str:
    """Return a file of `static/` as text."""
    return (files("orbits.viewing") / "static" / name).read_text(encoding="utf-8")


def joined(entry: str) -> str:
    """Return a module and all that it imports as one script, each file once and after those that it imports."""
    done: dict[str, str] = {}

    def add(name: str) -> None:
        if name in done:
            return
        text = asset(name)
        for other in IMPORT.findall(text):
            add(other)
        done[name] = f"// {name}\n{EXPORT.sub('', IMPORT.sub('', text))}"

    add(entry)
    return "\n".join(done.values())


def script_text(value: Any) -> str:
    """Return a value as JSON that can stand within a script of a page, whatever texts are in it."""
    text = json.dumps(value, allow_nan=False, ensure_ascii=True)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def page(header: dict[str, Any], chunk: dict[str, Any], *, follow: bool = False) -> str:
    """Return the page of a run as HTML. follow : whether it asks its server for further samples."""
    return PAGE.format(
        version=__version__,
        policy=POLICY,
        title=escape(header["title"]),
        style=asset("view.css"),
        data=script_text({"header": header, "chunk": chunk, "follow": follow}),
        licence=asset("three.LICENSE"),
        three=asset("three.min.js"),
        script=joined("start.js"),
    )


def widget_module() -> str:
    """Return the view as a module for notebooks, with a default export as anywidget expects it."""
    licence = f"/* three.js\n{asset('three.LICENSE')}\n*/"
    return "\n".join([licence, asset("three.min.js"), joined("widget.js"), "export default widget;"])
