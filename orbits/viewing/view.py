"""`orbits.view`: the view of a run in memory or in an archive, as a page, in a browser, or as a widget."""

from __future__ import annotations

import sys
import tempfile
from os import PathLike
from pathlib import Path
from typing import Any

from orbits.errors import InputError, MissingPackageError, StorageError, shown
from orbits.finding import Finding
from orbits.propagation import Trajectory
from orbits.propagation.control.progress import in_notebook
from orbits.viewing.browser import opened_in_browser
from orbits.viewing.data import LIMIT, ViewData
from orbits.viewing.page import asset, page, widget_module

MARK = b'<meta name="generator" content="orbits'


def view(
    run: Trajectory | str | PathLike[str],
    output: str | PathLike[str] | None = None,
    *,
    title: str | None = None,
    show: bool | None = None,
    limit: float = LIMIT / 2**20,
) -> View:
    """Look at a run in the browser, or in a notebook: orbits and bodies in three dimensions, along a slider of time.

        orbits.view(run)  # opens the browser; in a notebook, as the last line of a cell, shows it there
        orbits.view(run, "page.html")  # writes a page that needs no network, for disk or for others

    run : as from `orbits.propagate` or `orbits.Trajectory.open`, or the path of an archive
    output : path of the HTML file to write; by default a temporary one
    title : of the page; by default what the system consists of
    show : whether to open the browser; by default outside of notebooks, if no output is given
    limit : the most megabytes of samples in the page; a larger run is thinned, and a warning says how
    Returns the `View`, which can be saved and shown in a notebook (with the extra `orbits[notebook]`). For a run that
    still grows, `orbits view FILE` on the command line follows it.

    Raises InputError for anything that is not a run, for a run without samples, and for one with too many bodies for
    the limit; ArchiveError for a file that is no archive; StorageError if the page cannot be written.
    """
    if isinstance(run, str | PathLike):
        archived = Trajectory.open(run)
        try:
            return view(archived, output, title=title, show=show, limit=limit)
        finally:
            archived.close()
    if not isinstance(run, Trajectory):
        raise InputError(
            f"run is {shown(run)}; expected a run, as orbits.propagate returns it, or orbits.Trajectory.open('run.h5')."
        )
    made = View(run, title=title, limit=_bytes(limit))
    if output is not None:
        made.save(output)
    if show or (show is None and output is None and not in_notebook()):
        made.open()
    return made


class View:
    """The view of a run: `save(path)` writes its page, `open()` opens it in the browser, `widget()` is for notebooks.

    said : what was left out of a run that is too large, "" if nothing was
    """

    def __init__(self, run: Trajectory, *, title: str | None = None, limit: int = LIMIT) -> None:
        data = ViewData(run, title=title, limit=limit)
        self._header, self._chunk = data.header(run) | {"approaches": data.approaches(run)}, data.chunk(run)
        self.said = data.said
        self.path: Path | None = None
        if self.said:
            Finding(f"{self.said} A larger limit shows more.").warn()

    def html(self) -> str:
        """Return the page: one HTML file with all that it needs."""
        return page(self._header, self._chunk)

    def save(self, path: str | PathLike[str]) -> Path:
        """Write the page, and return its path; a page that this package wrote is replaced.

        Raises InputError for another file that is there already, and StorageError if writing fails.
        """
        target = Path(path)
        check_page(target)
        try:
            target.write_text(self.html(), encoding="utf-8")
        except OSError as error:
            raise StorageError(f"{target} could not be written ({error.strerror}).") from error
        self.path = target
        return target

    def open(self) -> bool:
        """Open the page in the browser, from a temporary file if it was not saved; say where it is if there is none."""
        where = self.path or self.save(Path(tempfile.mkdtemp(prefix="orbits-view-")) / "view.html")
        if opened_in_browser(where.absolute().as_uri()):
            return True
        print(f"the view is in {where}; no browser could be opened here", file=sys.stderr)
        return False

    def widget(self) -> Any:
        """Return the view as a widget for notebooks.

        Raises MissingPackageError without the package anywidget.
        """
        try:
            import anywidget
            import traitlets
        except ImportError as error:
            raise MissingPackageError(
                f"view.widget() needs the package anywidget, which cannot be imported ({error}). Install it with "
                "pip install 'orbits[notebook]', or save a page: view.save('page.html')."
            ) from error
        values = {
            "_esm": widget_module(),
            "_css": asset("view.css"),
            "data": traitlets.Dict({"header": self._header, "chunk": self._chunk, "follow": False}).tag(sync=True),
        }
        return type("ViewWidget", (anywidget.AnyWidget,), values)()

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> Any:
        try:
            shown_as = self.widget()
        except MissingPackageError as error:
            return {"text/plain": f"{self!r}\n{error}"}
        return shown_as._repr_mimebundle_(include=include, exclude=exclude)

    def __repr__(self) -> str:
        where = "not saved" if self.path is None else f"in {self.path}"
        return f"View({self._header['title']}; {self._chunk['times']['shape'][0]} samples; {where})"


def check_page(path: Path) -> None:
    """Raise InputError unless a page can be written at `path`: a new file, or one that this package wrote."""
    if path.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"{path} does not end in .html; the view is written as an HTML page.")
    if not path.absolute().parent.is_dir():
        raise InputError(f"the folder {path.absolute().parent} does not exist; make it, or give another path.")
    if path.is_dir():
        raise InputError(f"{path} is a folder; expected the path of a page, such as page.html.")
    if path.exists():
        with path.open("rb") as file:
            if MARK not in file.read(2000):
                raise InputError(f"{path} is there already and was not written by orbits; give another path.")


def _bytes(limit: Any) -> int:
    from orbits.checks import positive_number

    return int(positive_number(limit, "limit") * 2**20)
