"""A view of a run in the browser: a page for disk, a server for this machine, a widget for notebooks."""

from orbits.viewing.view import View, view

__all__ = ["View", "view"]
