"""MPCORB.DAT: every printed digit is read, what is chosen comes back, and what is bad is named by line and column."""

from __future__ import annotations

import gzip
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import strategies as st

import orbits
from orbits.catalogue import asteroids, mpcorb, orbit_classes, read_mpcorb, unreadable
from orbits.errors import EpochError, InputError, OrbitsError, OrbitsWarning, UnknownNameError
from tests.campaigns import campaign

from ..coverings import each
from . import lines
from .lines import CERES, HEADER, PALLAS_2024, VESTA, Line

TWO = f"{CERES}\n{VESTA}\n"


def printed(low: int, high: int, decimals: int) -> st.SearchStrategy[str]:
    return st.integers(low, high).map(lambda n: f"{n / 10**decimals:.{decimals}f}")


@st.composite
def any_line(draw: Any) -> Line:
    if draw(st.booleans()):
        number = draw(st.integers(1, 15_396_335))
        packed, readable = lines.packed_number(number), f"({number}) Name{number}"
    else:
        packed, readable = lines.provisional(draw(st.integers(2000, 2035)), "T", draw(st.integers(0, 10**6)))
    angle = printed(0, 35_999_999, 5)
    return Line(
        packed=packed,
        readable=readable,
        epoch=draw(st.sampled_from(["K223B", "K25BL", "J9611"])),
        M=draw(angle),
        omega=draw(angle),
        Omega=draw(angle),
        inc=draw(printed(0, 18_000_000, 5)),
        e=draw(printed(0, 9_999_999, 7)),
        a=draw(printed(4_000_000, 9_999_999_999, 7)),
        H=draw(printed(-200, 3500, 2)),
    )


@campaign(60, 1500, drawn=st.lists(any_line(), min_size=1, max_size=5), end=st.sampled_from(["\n", "\r\n"]))
def test_what_is_printed_is_read_to_the_last_digit(drawn: list[Line], end: str) -> None:
    catalogue = read_mpcorb("\n" + end.join(map(str, drawn)) + end)
    for i, line in enumerate(drawn):
        assert catalogue.names[i] in line.readable
        for what in ("M", "omega", "Omega", "inc"):
            assert getattr(catalogue, what)[i] == np.radians(float(getattr(line, what)))
        for what in ("a", "e", "H"):
            assert getattr(catalogue, what)[i] == float(getattr(line, what))
        assert catalogue.epoch[i] == {"K223B": 59649.0, "K25BL": 61000.0, "J9611": 50083.0}[line.epoch]


def test_a_published_line_is_read_in_all_its_columns() -> None:
    ceres = read_mpcorb(CERES)
    assert (ceres.names, ceres.numbers.tolist(), ceres.classes) == (("Ceres",), [1], ("MBA",))
    assert (ceres.a[0], ceres.e[0], ceres.H[0], ceres.epoch[0]) == (2.7656157, 0.0795764, 3.34, 61000.0)
    assert np.degrees([ceres.M[0], ceres.omega[0], ceres.Omega[0], ceres.inc[0]]) == pytest.approx(
        [231.53974, 73.29974, 80.24964, 10.58789], rel=3e-16
    )
    details = {what: column[0] for what, column in ceres.details.items()}
    assert details == {
        "G": 0.15, "U": "0", "reference": "MPO980521", "observations": 7297.0, "oppositions": 126.0,
        "arc": "1801-2026", "rms": 0.83, "last_observation": "20260103",
    }  # fmt: skip
    # Perihelion half a period after aphelion: published for 2027 July.
    assert ceres.T[0] == pytest.approx(61599.0, abs=1.0)


@pytest.mark.parametrize("header", ["", HEADER, HEADER.replace("\n", "\r\n")])
@pytest.mark.parametrize("zipped", [False, True])
def test_a_file_is_read_with_and_without_header_plain_and_gzipped(tmp_path: Path, header: str, zipped: bool) -> None:
    path = tmp_path / "MPCORB.DAT"
    content = f"{header}{CERES}\n\n{VESTA}\n".encode()  # blank lines separate the parts of the real file
    path.write_bytes(gzip.compress(content) if zipped else content)
    for source in (path, str(path), content, content.decode()):
        assert read_mpcorb(source).names == ("Ceres", "Vesta")


def test_lines_may_be_a_list_lack_an_end_or_be_cut_behind_the_semi_major_axis() -> None:
    assert read_mpcorb([CERES, VESTA + "\n"]).names == ("Ceres", "Vesta")
    assert read_mpcorb(f"{CERES}\n{VESTA}").names == ("Ceres", "Vesta")
    assert read_mpcorb(f"    {CERES}\n    {VESTA}").names == ("Ceres", "Vesta")
    nameless = read_mpcorb([CERES[:103], "K07Tf8A" + VESTA[7:103]])
    assert (nameless.names, nameless.numbers.tolist()) == (("1", "2007 TA418"), [1, 0])
    no_magnitude = read_mpcorb(CERES[:8] + " " * 11 + CERES[19:])
    assert np.isnan(no_magnitude.H[0])
    assert np.isnan(no_magnitude.details["G"][0])


def test_reading_in_blocks_is_reading_at_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    path = tmp_path / "many.dat"
    path.write_text(HEADER + "".join(f"{lines.packed_number(i):7}{VESTA[7:166]}({i}) B{i}\n" for i in range(1, 200)))
    whole = read_mpcorb(path)
    monkeypatch.setattr(mpcorb, "BLOCK", 1000)
    pieces = read_mpcorb(path)
    assert pieces.names == whole.names == tuple(f"B{i}" for i in range(1, 200))
    assert np.array_equal(pieces.a, whole.a)
    path.write_text(path.read_text() + VESTA.replace(" 26.80969", " 26.8x969"))
    with pytest.raises(InputError, match=r"line 207, columns 27-35"):
        read_mpcorb(path)


@each(
    ("chosen", "names"),
    [
        ({"names": "ceres"}, ("Ceres",)),
        ({"names": ["4 Vesta", "Ceres", "00004"]}, ("Vesta", "Ceres")),
        ({"names": ["(4) Vesta"]}, ("Vesta",)),
        ({"numbers": [4, 1]}, ("Vesta", "Ceres")),
        ({"names": ["Vesta"], "numbers": 1}, ("Vesta", "Ceres")),
        ({"numbers": range(1, 2)}, ("Ceres",)),
        ({"brighter_than": 3.3}, ("Vesta",)),
        ({"count": 1}, ("Vesta",)),
        ({"count": 2}, ("Vesta", "Ceres")),
        ({"classes": "belt"}, ("Ceres", "Vesta")),
        ({"classes": ["trojan", "neo"]}, ()),
        ({"numbers": [1], "classes": "TJN"}, ()),
    ],
)
def test_choosing_goes_as_for_the_bundled_asteroids(chosen: dict[str, Any], names: tuple[str, ...]) -> None:
    assert read_mpcorb(TWO, **chosen).names == names


@pytest.mark.parametrize(
    ("chosen", "error", "message"),
    [
        ({"names": ["Juno", "Ceres"], "numbers": [7]}, UnknownNameError, "'Juno', 7: not among the 2 bodies of the"),
        ({"count": 3}, InputError, "count = 3, but there are only 2"),
        ({"errors": "ignore"}, InputError, "errors = 'ignore'; expected 'raise'"),
        ({"names": [3]}, InputError, "names contains 3"),
        ({"numbers": "1"}, InputError, "numbers contains '1'"),
        ({"classes": "planets"}, UnknownNameError, "no class 'planets'"),
        ({"brighter_than": "x"}, InputError, "brighter_than = 'x'"),
    ],
)
def test_a_choice_that_cannot_be_made_is_refused(chosen: dict[str, Any], error: type, message: str) -> None:
    with pytest.raises(error, match=message):
        read_mpcorb(TWO, **chosen)


@each(
    ("good", "bad", "message"),
    [
        ("00004  ", "0000%  ", r"line 2, columns 1-7: '0000%  ' is not a valid packed number or designation"),
        ("00004  ", "K07Tf8 ", "columns 1-7"),
        (" 3.25 ", " 3.2x ", "columns 9-13: ' 3.2x' is not a valid absolute magnitude"),
        ("K25BL", "K25BZ", "columns 21-25: 'K25BZ' is not a valid packed epoch"),
        (" 26.80969", "         ", "columns 27-35: '         ' is not a valid mean anomaly"),
        ("151.53711", "361.53711", "columns 38-46: '361.53711' is not a valid argument of perihelion"),
        ("103.70232", "-03.70232", "columns 49-57"),
        ("  7.14406", "  7.1 406", "columns 60-68"),
        ("0.0901676", "0.09.1676", "columns 71-79"),
        ("0.0901676", "1.0901676", "line 2: a and e do not define an ellipse"),
        ("0.27158812", "0.27258812", "line 2: n and a contradict Kepler's third law"),
        ("  2.3615413", "  2.3615e13", "columns 93-103"),
        ("(4) Vesta", "(5) Vesta", "columns 167-194"),
        ("(4) Vesta", "(4) V\u00e9sta", "not ASCII"),
        (VESTA[90:], "", "line 2: the line ends after 90 columns; expected at least 103"),
    ],
)
def test_a_bad_line_is_named_with_line_and_columns_or_left_out_aloud(good: str, bad: str, message: str) -> None:
    assert VESTA.count(good) == 1
    text = f"{CERES}\n{VESTA.replace(good, bad)}\n{PALLAS_2024}\n"
    with pytest.raises(InputError, match=re.escape(message) if "\\" not in message else message):
        read_mpcorb(text)
    with pytest.warns(OrbitsWarning, match="1 of 3 entries cannot be read and were left out: line 2"):
        rest = read_mpcorb(text, errors="skip")
    assert (rest.names, rest.skipped) == (("Ceres", "Pallas"), 1)


def test_where_no_line_can_be_read_that_is_an_error_even_when_bad_lines_are_skipped() -> None:
    with pytest.raises(InputError, match=r"none of its 2 entries can be read. line 1: the line ends after 5 columns"):
        read_mpcorb("hello\nworld\n", errors="skip")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "no line with elements"),
        (b"\n\n   \n", "no line with elements"),
        (HEADER.encode(), "no line with elements"),
        (b"x" * 5_000_000, "no end of line in 4 MB"),
        (gzip.compress(bytes(50_000_000)), "no end of line in 4 MB"),
        (gzip.compress(CERES.encode() * 99)[:-20], "damaged gzip"),
        (b"\x1f\x8b\x00\x00", "damaged gzip"),
        (bytes(range(256)) * 9, "line 1"),
    ],
)
def test_what_is_no_such_file_is_refused(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "bad.dat"
    path.write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_mpcorb(path)


def test_a_file_that_unpacks_without_end_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    assert mpcorb.MOST_LINES == 20_000_000
    monkeypatch.setattr(mpcorb, "MOST_LINES", 20_000)
    with pytest.raises(InputError, match="more than 20,000 lines"):
        read_mpcorb(gzip.compress(b"\n" * 20_001))
    monkeypatch.setattr(unreadable, "MOST", 1000)
    with pytest.raises(InputError, match=r"more than 1,000 entries cannot be read.* line 1: the line ends after 1 col"):
        read_mpcorb(gzip.compress(b"x\n" * 3_000), errors="skip")


@pytest.mark.parametrize("source", ["nowhere.dat", "a\0b", ".", "/dev/zero", 3, None, [], [CERES, 3], 2.5])
def test_a_source_that_is_no_file_and_no_text_is_refused(source: Any) -> None:
    with pytest.raises(InputError, match="expected"):
        read_mpcorb(source)


@campaign(
    80,
    1500,
    text=st.just(f"{CERES}\n{VESTA}\n{PALLAS_2024}\n".encode()),
    changes=st.lists(st.tuples(st.integers(0, 608), st.integers(0, 255)), min_size=1, max_size=4),
    keep=st.integers(0, 610),
    zipped=st.booleans(),
    errors=st.sampled_from(["raise", "skip"]),
)
def test_flipped_bytes_and_truncation_give_a_catalogue_or_an_error_in_words(
    text: bytes, changes: list[tuple[int, int]], keep: int, zipped: bool, errors: str
) -> None:
    damaged = bytearray(gzip.compress(text, mtime=0) if zipped else text)
    for place, value in changes:
        damaged[place % len(damaged)] = value
    check_read(bytes(damaged[:keep]), errors)


@campaign(60, 1500, data=st.binary(max_size=700), errors=st.sampled_from(["raise", "skip"]))
def test_random_bytes_give_a_catalogue_or_an_error_in_words(data: bytes, errors: str) -> None:
    check_read(data, errors)
    check_read(b"\x1f\x8b" + data, errors)


def check_read(data: bytes, errors: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", OrbitsWarning)
        try:
            catalogue = read_mpcorb(data, errors=errors)
        except OrbitsError:
            return
    for what in ("a", "e", "inc", "Omega", "omega", "M", "epoch"):
        assert np.isfinite(getattr(catalogue, what)).all()
    assert all(name.isprintable() for name in catalogue.names)


def test_classes_from_elements_are_those_of_the_small_body_database() -> None:
    every = asteroids()
    assert orbit_classes(every.a, every.e, np.zeros(len(every), dtype=bool)) == list(every.classes)


def test_one_call_makes_a_system_at_the_epoch_of_the_elements() -> None:
    system = orbits.System.from_catalogue(orbits.read_mpcorb(TWO))
    assert system.names[-2:] == ("Ceres", "Vesta")
    assert system.epoch.mjd == 61000.0
    assert not system.massive[-2:].any()
    orbit = system.elements(primary="Sun")["Ceres"]
    assert orbit.a.to_value("au") == pytest.approx(2.7656157, rel=1e-14)
    assert orbit.inc.to_value("deg") == pytest.approx(10.58789, rel=1e-14)
    assert orbit.M.to_value("deg") % 360.0 == pytest.approx(231.53974, rel=1e-12)


def test_the_minor_planet_centers_ceres_is_where_jpls_goes_by_integration() -> None:
    """From JPL's elements of 2022 August to the Minor Planet Center's of 2025 November, two sources in one place."""
    chosen = orbits.asteroids(names=["Ceres", "Vesta"])
    start = orbits.System.from_catalogue(chosen)
    run = orbits.propagate(start, orbits.Gauss(stages=8), dt=6, duration=1200.0, samples=2)
    end = orbits.System.from_catalogue(orbits.read_mpcorb(TWO))
    for name in chosen.names:
        i, j = run.names.index(name), end.index(name)
        sun = run.names.index("Sun")
        ours = (run.q[-1][i] - run.q[-1][sun]).to_value("au")
        theirs = (end.q[j] - end.q[end.index("Sun")]).to_value("au")
        # 7e-7 and 5e-7 au: the MPC's elements end at 1e-5 degrees, 4e-7 au, and Newton's nine bodies are not all.
        assert np.linalg.norm(ours - theirs) < 1e-6


def test_epochs_that_differ_are_refused_or_carried_over_when_asked() -> None:
    text = f"{TWO}{PALLAS_2024}\n"
    with pytest.raises(EpochError, match=r"2 epochs, MJD 60400 to 61000 TDB. Use propagate_to_epoch=True"):
        orbits.System.from_catalogue(orbits.read_mpcorb(text))
    with pytest.raises(EpochError, match="MJD 59800 TDB, but the elements of 'Ceres' are of MJD 61000"):
        orbits.System.from_catalogue(orbits.read_mpcorb(TWO), epoch="2022-08-09")
    both = orbits.read_mpcorb(text)
    assert orbits.System.from_catalogue(both, propagate_to_epoch=True).epoch.mjd == 61000.0
    assert orbits.System.from_catalogue(both, propagate_to_epoch=True, epoch="2022-08-09").epoch.mjd == 59800.0
    with pytest.raises(InputError, match="the catalogue has no bodies"):
        orbits.System.from_catalogue(orbits.read_mpcorb(TWO, classes="TNO"))


def test_an_empty_path_is_told_so() -> None:
    with pytest.raises(InputError, match="the path is empty; expected"):
        read_mpcorb("")


@pytest.mark.parametrize("columns", [25, 26, 60, 102])
def test_a_line_that_was_cut_short_is_no_name_of_a_file(columns: int) -> None:
    with pytest.raises(InputError, match=f"the line ends after {columns} columns"):
        orbits.read_mpcorb(CERES[:columns])


@pytest.mark.parametrize("name", ["propagate_to_epoch", "massive"])
def test_flags_are_true_or_false_and_no_arrays(name: str) -> None:
    system = orbits.System.solar_system("2025-11-21", bodies=["Sun", "Jupiter"])
    with pytest.raises(InputError, match=f"{name} is .*expected True or False"):
        system.add_particles(orbits.read_mpcorb(CERES), **{name: np.array([True, False])})
