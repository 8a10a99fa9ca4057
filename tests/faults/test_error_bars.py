"""Error bars contain the errors of random systems of all kinds, and are not much larger; see the benchmark."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

from orbits.point_masses import PointMasses
from orbits.regression.taylor import taylor

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "benchmarks" / "error_bars.py"


@pytest.fixture
def study(monkeypatch):
    spec = importlib.util.spec_from_file_location("error_bars", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "error_bars", module)  # annotations of named tuples are looked up there
    spec.loader.exec_module(module)
    return module


def doubled(case, times):
    """The truth of the small form, in 31 digits."""
    found = taylor(PointMasses(case.gm, case.q, case.v), times)
    return found.q, found.q_lo


@pytest.mark.faults
@pytest.mark.filterwarnings("ignore::orbits.errors.OrbitsWarning")
def test_bars_of_eight_kinds_of_systems_contain_the_errors_and_are_rarely_thirty_times_larger(study):
    found = study.table(list(study.judged(doubled, each=4)))[-1]
    for way in (study.CHOSEN, study.CONSTANT):
        assert found[f"bars, {way} steps"] > 400
        # Three times as many bars have 98 and 97 %, and 1 and 3 %.
        assert found[f"contain the error %, {way}"] > 95.0
        assert found[f"above 30 errors %, {way}"] < 6.0
