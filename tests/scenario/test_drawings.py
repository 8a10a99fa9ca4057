"""Pictures of bundled scenarios: methods in words, lines explained, frames on the axes, an inset where it matters."""

from __future__ import annotations

import numpy as np
import pytest

from orbits.scenario.definition import CaseOutcome, Outcome
from orbits.scenario.loading import load
from tests.plotting import seen


def nothing_overlaps(figure):
    seen.laid_out(figure)
    return not (seen.colliding_tick_labels(figure) or seen.legends_on_panels(figure) or seen.outside(figure))


@pytest.mark.nightly
def test_arenstorfs_passage_by_the_moon_is_drawn_in_an_inset_to_scale(monkeypatch):
    names = load("arenstorf").experiment.__globals__
    monkeypatch.setitem(names, "DRAWN", 4000)
    lagrangian, starts = names["closed_orbits"]()
    figure = names["draw"](lagrangian, starts)
    assert nothing_overlaps(figure)
    moon = np.array([1.0 - lagrangian.parameters["mu"], 0.0])
    for axes in figure.get_axes():
        (inset,) = axes.child_axes
        way = np.concatenate([line.get_xydata() for line in inset.lines])
        # 0.994 - (1 - mu) = 0.0062775 is where the orbits start, and their pericentre.
        assert np.linalg.norm(way - moon, axis=1).min() == pytest.approx(0.0062775, rel=1e-4)
        assert np.ptp(inset.get_xlim()) == pytest.approx(np.ptp(inset.get_ylim()))
        (disc,) = inset.patches[-1:]
        assert disc.radius == pytest.approx(1737.4 / 384400.0)
        assert "2,413 km" in " ".join(text.get_text() for text in inset.texts)
    told = " ".join(seen.texts(figure))
    assert "Gauss, 8 stages" in told
    assert "rotating with the Moon" in told


@pytest.fixture(scope="module")
def kepler():
    import orbits

    scenario = load("kepler")
    system = scenario.cases()["e = 0.6"]
    length = {"dt": scenario.dt, "duration": 12.0, "samples": 41}
    options = {"progress": False, "check_step": False}
    runs = {method.label: orbits.propagate(system, method, **length, **options) for method in scenario.integrators}
    report = orbits.compare(
        system, list(scenario.integrators), **length, against=("whfast",), runs=list(runs.values()), progress=False
    )
    case = CaseOutcome("e = 0.6", system, runs, report)
    return scenario.draw(Outcome(scenario=scenario, folder=None, cases={case.name: case}))


@pytest.mark.nightly
def test_keplers_pictures_name_methods_in_words_and_explain_their_lines(kepler):
    for figure in kepler.values():
        assert nothing_overlaps(figure)
        told = " ".join(seen.texts(figure)).replace("\n", " ")
        for words in ("explicit Euler", "Störmer–Verlet", "so far", "dashed", "REBOUND"):
            assert words in told
        assert "ExplicitEuler" not in told
        assert "()" not in told
    told = " ".join(seen.texts(kepler["kepler"])).replace("\n", " ")
    for words in ("round-off, 2⁻⁵³", "grey, the exact orbit", "the largest errors so far"):
        assert words in told
