"""Where the bundled data and scenarios are: inside the installed package, or beside it in a checkout.

The wheel carries the repository's `data/` and `scenarios/` as `orbits/_bundled/`; an editable installation and a
checkout read the folders themselves, so there is never a second copy to go stale.
"""

from __future__ import annotations

from pathlib import Path

from orbits.errors import OrbitsError, UnknownNameError


def bundled(folder: str) -> Path:
    """Return the folder "data" or "scenarios" that is installed with the package.

    Raises OrbitsError if the installation lacks it.
    """
    package = Path(__file__).resolve().parent
    candidates = [package / "_bundled" / folder]
    if (package.parent / "pyproject.toml").is_file():
        candidates.append(package.parent / folder)
    for candidate in candidates:
        if candidate.is_dir():
            return candidate
    raise OrbitsError(
        f"this installation of orbits has no {folder}/ folder; looked for {' and '.join(map(str, candidates))}. "
        "Install the package again."
    )


def scenarios_dir() -> Path:
    """Return the folder of the bundled scenarios. Raises OrbitsError if the installation lacks it."""
    return bundled("scenarios")


def data_path(name: str) -> Path:
    """Return the path of a bundled data file, such as "gm_de440.json".

    Raises UnknownNameError, listing the files that exist, if there is no such file.
    """
    folder = bundled("data")
    present = sorted(path.name for path in folder.iterdir() if path.is_file())
    if name not in present:
        raise UnknownNameError(f"there is no data file {name!r}; the bundled files are {', '.join(present)}.")
    return folder / name
