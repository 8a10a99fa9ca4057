"""Published test problems: the outer solar system, the Pleiades and the figure eight, to the digits that are known."""

import json

import numpy as np
import pytest

import orbits
from orbits import diagnostics
from orbits.methods import ExplicitEuler, SymplecticEuler
from orbits.resources import data_path

GAUSS = orbits.Gauss(stages=8)


def read(name):
    return json.loads(data_path(f"{name}.json").read_text(encoding="utf-8"))


def outer_solar_system():
    data = read("hlw_outer_solar_system")
    mass = [float(m) if "/" not in m else float(m.split("/")[0]) / float(m.split("/")[1]) for m in data["m"]]
    gm = data["G"] * np.array(mass)
    return data, orbits.System(data["bodies"], gm, data["q"], data["v"], units=orbits.SOLAR)


def test_the_outer_solar_system_of_hairer_lubich_and_wanner_is_to_the_last_digit_after_200_days():
    """One step of Gauss with 8 stages; the reference has twenty digits. Half an ulp of 25 au is 1.8e-15."""
    data, system = outer_solar_system()
    known = data["reference_200_days"]
    for dt in (200, 50):
        run = orbits.propagate(system, GAUSS, dt=dt, duration=200, samples=2, check_step=False)
        assert np.abs(run.q.value[-1] - np.array(known["q"], dtype=float)).max() < 8e-15  # 1.8e-15 was reached
        assert np.abs(run.v.value[-1] - np.array(known["v"], dtype=float)).max() < 4e-18  # 9e-19 was reached
    energy = diagnostics.energy(system.values.gm, system.values.q, system.values.v) / data["G"]
    assert abs(energy / float(data["E0"]) - 1) < 5e-16


def test_the_steps_of_the_books_picture_keep_symplectic_energies_bounded_for_200000_days():
    """Explicit Euler with 10 days, symplectic Euler with 100, Störmer–Verlet with 200; bounds a tenth above."""
    _, system = outer_solar_system()

    def strays(method, dt):
        energy = (
            orbits.propagate(system, method, dt=dt, duration=200_000, samples=1001, check_step=False).energy().value
        )
        return np.abs(energy / energy[0] - 1)

    assert strays(ExplicitEuler(), 10)[-1] > 0.5  # 0.66: planets far outside
    for method, dt, reached in ((SymplecticEuler(), 100, 0.0252), (orbits.StormerVerlet(), 200, 0.00196)):
        found = strays(method, dt)
        assert found.max() < 1.1 * reached
        assert found[500:].max() < 1.05 * found[:500].max()
    assert strays(GAUSS, 200).max() < 5e-15  # 1e-15 was reached


def pleiades():
    data = read("pleiades")
    flat = np.zeros(7)
    q, v = (np.column_stack([data[x], data[y], flat]) for x, y in (("x0", "y0"), ("vx0", "vy0")))
    names = [f"star {m}" for m in range(1, 8)]
    return orbits.System(names, np.arange(1.0, 8.0), q, v, units=orbits.DIMENSIONLESS), data["published"]


@pytest.mark.parametrize(
    ("method", "steps", "bound"),
    [
        (GAUSS, 2400, 2e-11),  # 6.4e-12 was reached
        (GAUSS, 19_200, 1e-13),  # 1.1e-14: round-off, enlarged by the meetings
        (orbits.Gauss(stages=4), 19_200, 2e-12),  # 5.9e-13 was reached
        (orbits.StormerVerlet(), 19_200, 0.02),  # 0.009 was reached
    ],
    ids=lambda x: getattr(x, "label", x),
)
def test_the_pleiades_end_where_they_are_published_to_end(method, steps, bound):
    system, published = pleiades()
    run = orbits.propagate(system, method, dt=3 / steps, duration=3, samples=2, check_step=False)
    x, y, vx, vy = np.array(published).reshape(4, 7)
    assert np.abs(run.q.value[-1, :, :2] - np.column_stack([x, y])).max() < bound
    assert np.abs(run.v.value[-1, :, :2] - np.column_stack([vx, vy])).max() < 4 * bound
    assert run.drift().angular_momentum.max_fraction < 2e-15


def three_bodies(row):
    p = np.array([float(row["p1"]), float(row["p2"]), 0.0])
    q = [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    names = ["first", "second", "third"]
    return orbits.System(names, np.ones(3), q, [p, p, -2 * p], units=orbits.DIMENSIONLESS)


def closure(system, method, period, steps):
    """Return the largest errors of components of q and v after a period, and of the energy."""
    run = orbits.propagate(system, method, dt=period / steps, duration=period, samples=2, check_step=False)
    energy = run.energy().value
    missing = [float(np.abs(x.value[-1] - x.value[0]).max()) for x in (run.q, run.v)]
    return *missing, abs(energy[-1] / energy[0] - 1)


def test_the_figure_eight_closes_as_closely_as_geometric_integrators_demands():
    """400 steps a period; 1.3e-7, 2.0e-7 and 3e-15 for Gauss with 2 stages, 4e-9 in energy for the midpoint rule."""
    asserted = read("rebound_test_bounds")["geometric_integrators"]["figure8"]
    assert "closure 1.3e-7 q, 2.0e-7 p, energy 3e-15" in asserted
    row = read("three_body_periodic")["published"][-1]
    eight, period = three_bodies(row), float(row["T"])
    q, v, energy = closure(eight, orbits.Gauss(stages=2), period, 400)
    assert q < 1.3e-7  # 1.17e-7
    assert v < 2.0e-7  # 1.95e-7
    assert energy < 3e-15  # 1.6e-15
    assert closure(eight, orbits.Gauss(stages=1), period, 400)[2] < 4e-9  # 3.5e-9
    q, v, _ = closure(eight, GAUSS, period, 400)
    assert q == pytest.approx(row["closure_pos"], rel=0.01)  # what its ten digits allow, 1.5e-11
    assert v == pytest.approx(row["closure_vel"], rel=0.01)


@pytest.mark.parametrize("name", ["I.A.1", "I.B.1", "I.B.2", "I.B.5", "II.C.2b"])
def test_other_periodic_orbits_close_as_their_digits_do_in_forty_digits(name):
    """To a few 1e-4, which is due to the published digits, and is reproduced to seven figures."""
    (row,) = [row for row in read("three_body_periodic")["published"] if row["name"].split()[0] == name]
    system = three_bodies(row)
    assert diagnostics.energy(system.values.gm, system.values.q, system.values.v) == pytest.approx(
        float(row["energy"]), rel=4e-16
    )
    q, v, _ = closure(system, GAUSS, float(row["T"]), round(10_000 * float(row["T"])))
    assert q == pytest.approx(row["closure_pos"], rel=1e-8)  # 2e-10 was reached
    assert v == pytest.approx(row["closure_vel"], rel=1e-8)
