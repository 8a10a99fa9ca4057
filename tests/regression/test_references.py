"""The references of the benchmark belong to the starts that the methods get, with all the rounding of these."""

from __future__ import annotations

import importlib
import importlib.util
import math
from pathlib import Path

import numpy as np
import pytest

from orbits.point_masses import PointMasses
from orbits.regression import reference

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "benchmarks" / "references.py"


@pytest.fixture(scope="module")
def references():
    spec = importlib.util.spec_from_file_location("references", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_rotations_are_orthogonal_without_any_rounding(references):
    for rotation in references.rotations(8):
        assert np.array_equal(rotation @ rotation.T, references.exact(np.eye(3)))
        x = rotation.tolist()
        assert np.dot(np.cross(x[0], x[1]), x[2]) == 1


@pytest.mark.nightly
def test_where_a_rounded_rotated_start_leads_is_known_to_more_digits_than_its_rounding_costs(references):
    # Star and planet, 3,000 orbits: both ends are known exactly.
    gm, span = np.array([1.0, 1e-3]), 3000 * 2 * math.pi
    q, v = np.array([0.9, 0.1, 0.2]), np.array([-0.2, 1.0, 0.1])
    q, v = np.array([-1e-3 * q, q]), np.array([-1e-3 * v, v])
    at = np.array([span])
    end = references.exact(reference.exact(PointMasses(gm, q, v), at).q[0])
    starts = [references.rotated(q, v, rotation) for rotation in references.rotations(3)[1:]]
    rounding = 0.0
    for start, truth in zip(starts, references.ends(gm, q, v, end, starts, span), strict=True):
        really = reference.exact(PointMasses(gm, start.q, start.v), at).q[0]
        # Two exact solutions, each rounded to float64 once, differ by less than an ulp of 1.3.
        assert references.errors(really, start, truth).max() < 3e-16
        rounding = max(rounding, references.errors(really, start, end).max())
    assert rounding > 1e-14  # what a good method was blamed for: fifty times as much


def test_a_benchmark_of_one_part_leaves_the_other_sections_of_the_page(monkeypatch):
    monkeypatch.syspath_prepend(str(SCRIPT.parent.parent))
    benchmark = importlib.import_module("benchmark")
    page = "# Head\n\nMade by.\n\n## One\n\nold\n\n## Two\n\nkept\n\n## By hand\n\nkept too\n"
    new = "# Head\n\nMade elsewhere.\n\n## One\n\nnew\n\n"
    assert benchmark.merged(page, new) == page.replace("old", "new")
