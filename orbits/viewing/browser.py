"""Opening a page in the browser of this machine, if it has one with windows."""

from __future__ import annotations

import os
import sys
import webbrowser


def opened_in_browser(url: str) -> bool:
    """Open a page, and return whether a browser was started; one that would take over the terminal is not."""
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return False
    try:
        return webbrowser.open(url)
    except webbrowser.Error:
        return False
