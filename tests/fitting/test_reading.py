"""Readers of the MPC's 80 columns and of ADES: what they read, and what they say of what they cannot read."""

from __future__ import annotations

import json
import re
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from astropy import units as u
from astropy.time import Time
from hypothesis import given
from hypothesis import strategies as st

from orbits.astrometry.observations import Observations
from orbits.catalogue import packed
from orbits.errors import InputError, OutOfRangeError, UnknownNameError

from ..coverings import each

DATA = Path(__file__).parent / "data"

EROS = """\
00433         A1893 10 29.4132  06 08 59.32 +53 39 04.2                 HA053802
00433         S2011 10 23.34124006 53 03.495+46 43 06.69               X~7lwF275
00433         s2011 10 23.3412401 + 4353.0030 -  481.6100 + 1382.3400   ~7lwF275
00433         V2023 08 26.19193220 55 41.10 -08 18 29.6          15.1 VV~7811270
00433         v2023 08 26.1919321 237.76096  +38.11385      0           ~7811270
"""
"""Real lines, as put together in a test of Smithsonian/layup."""

APOPHIS = "99942K04M04N  C2004 03 15.10789 04 06 08.08 +16 55 04.6                om6394691"

RADAR = """\
04179         R1992 12 02.902778   4218031212  +    52351476   8510 253 JPLRS253
04179         r1992 12 02.902778C         0650           052        253 JPLRS253
"""
"""Real lines, as put into the format by a test of ADES-Master."""

PSV = """\
# version=2022
permID |trx |rcv |obsTime             |doppler   |delay      |rmsDoppler|rmsDelay|com|frq  |ref
   4179|253 |253 |1992-12-02T21:40:00Z|+523514.76|42.18031212| 0.52     | 0.650  |  1|8510.|JPLRS
"""

CCD = """\
permID|stn|obsTime|ra|dec|rmsRA|rmsDec|astCat|mode
433|568|2023-07-06T00:17:43.77Z|273.13|-0.5|0.1|0.2|Gaia2|CCD
"""


def test_a_line_of_80_columns_is_read_to_its_last_digit():
    (one,) = Observations.parse(APOPHIS).records
    assert (one.line, one.kind, one.body, one.station) == (1, "optical", "99942", "691")
    assert (one.jd, one.part) == (2453079.5, 0.10789)
    assert one.ra == pytest.approx(15 * (4 + 6 / 60 + 8.08 / 3600), abs=1e-13)
    assert one.dec == pytest.approx(16 + 55 / 60 + 4.6 / 3600, abs=1e-13)
    assert (one.catalogue, one.mode, one.program) == ("USNOB1", "C", "")
    assert np.isnan(one.mag)


def test_records_of_two_lines_say_where_the_observer_was():
    plate, space, roving = Observations.parse(EROS).records
    assert plate.place is None
    assert space.place is not None
    x = np.array(space.place[:3]) * u.au.to(u.km)
    assert (np.abs(x - [4353.003, -481.61, 1382.34]) < 1e-9).all()
    assert not space.place.turns
    assert roving.place is not None
    assert roving.place.turns
    # Longitude 237.76096 east, latitude 38.11385, at sea level.
    assert np.linalg.norm(roving.place[:3]) * u.au.to(u.km) == pytest.approx(6370.0, abs=1.0)
    assert np.rad2deg(np.arctan2(roving.place.y, roving.place.x)) % 360 == pytest.approx(237.76096, abs=1e-9)


def test_radar_is_the_same_in_both_formats():
    one, other = Observations.parse(RADAR), Observations.parse(PSV)
    assert one.kind.tolist() == other.kind.tolist() == ["delay", "doppler"]
    assert len(one + other) == 2  # the same to all digits: microseconds are rounded once
    for a, b in zip(one.records, other.records, strict=True):
        assert a.value == b.value
        assert (a.frequency, a.transmitter, a.station) == (8510, "253", "253")
        assert (b.frequency, b.transmitter, b.station) == (8510, "253", "253")
        # 19 ms late, as six decimals of a day have it, the delay is 1.2 microseconds shorter: 1.8 of its sigmas.
        assert a.part == b.part
    assert one.records[0].value == pytest.approx(42.18031212)
    assert [x.sigma for x in one.records] == [pytest.approx(0.65e-6), pytest.approx(0.52)]


def test_ades_as_psv_with_commas_and_as_xml_is_the_same():
    psv = CCD
    cells = dict(zip(*(line.split("|") for line in psv.splitlines()), strict=True))
    xml = "<ades><optical>" + "".join(f"<{a}>{b}</{a}>" for a, b in cells.items()) + "</optical></ades>"
    found = [Observations.parse(text).records[0]._replace(line=0) for text in (psv, psv.replace("|", ","), xml)]
    assert repr(found[0]) == repr(found[1]) == repr(found[2])
    assert (found[0].ra, found[0].dec, found[0].sigma_ra, found[0].sigma_dec) == (273.13, -0.5, 0.1, 0.2)


@each(
    ("line", "reason"),
    [
        (APOPHIS[:-1], "79 columns; expected 80"),
        (APOPHIS.replace("2004 03", "2004 13"), "is no date"),
        (APOPHIS.replace("2004 03", "2004-03"), "the date is"),
        (APOPHIS.replace("04 06 08.08", "24 06 08.08"), "right ascension is '24 06 08.08', which is out of its range"),
        (APOPHIS.replace("04 06 08.08", "04 60 08.08"), "out of its range"),
        (APOPHIS.replace("+16 55", "+1655 "), "declination is"),
        (APOPHIS.replace("+16 55", "*16 55"), "the sign of the declination is '*'"),
        (APOPHIS.replace("C2004", "X2004"), "replaced by a later measurement"),
        (APOPHIS.replace("C2004", "?2004"), "column 15 is '\\?'"),
        (APOPHIS.replace("C2004", "S2004"), "its second line, with 's' in column 15, does not follow"),
        (APOPHIS.replace("C2004", "s2004"), "a second line without the first one"),
        (APOPHIS[:-3] + "???", "'\\?\\?\\?' is no code of an observatory"),
        (APOPHIS[:-3] + "250", "250 Hubble Space Telescope has no place on the Earth, and the record gives none"),
    ],
)
def test_each_line_that_is_not_used_is_told_with_its_number_and_the_reason(line, reason):
    found = Observations.parse(f"{APOPHIS}\n\n{line}\n")
    assert len(found) == 1
    (ignored,) = found.ignored
    assert (ignored.line, ignored.text) == (3, line)
    assert re.search(reason, ignored.reason)


@each(
    ("text", "message"),
    [
        ("", "it is empty"),
        ("nothing of it", "line 1: 13 columns; expected 80; expected the MPC's 80 columns"),
        ("<ades><optical>", "line 1: no valid XML"),
        ("<!DOCTYPE a [<!ENTITY b 'c'>]><ades/>", "line 1: has a document type"),
        ("permID|obsTime\n433|yesterday", "line 2: obsTime is 'yesterday'"),
    ],
)
def test_a_file_without_an_observation_is_refused_with_the_first_reason(text, message):
    with pytest.raises(InputError, match=message):
        Observations.parse(text)


def test_a_file_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        Observations.read(tmp_path / "none.txt")


@given(st.text(max_size=400) | st.binary(max_size=400).map(lambda x: x.decode("utf-8", errors="replace")))
def test_no_text_breaks_the_readers(text):
    for head in ("", "permID|obsTime|ra|dec|stn\n", "<ades><optical><permID>", APOPHIS + "\n"):
        try:
            found = Observations.parse(head + text)
        except InputError:
            continue
        assert len(found) + len(found.ignored) > 0


@given(st.integers(0, 79), st.characters(min_codepoint=32, max_codepoint=126), st.sampled_from(EROS.splitlines()))
def test_one_wrong_character_is_read_or_told(place, character, line):
    """Every line of a text is among the observations, those ignored, or is a second line of one that was read."""
    changed = line[:place] + character + line[place + 1 :]
    text = EROS.replace(line, changed)
    found = Observations.parse(text)
    seen = {one.line for one in found.records} | {one.line for one in found.ignored}
    seconds = {one.line + 1 for one in found.records if one.mode in ("S", "V")}
    assert seen | seconds == set(range(1, 6))


@given(
    st.floats(0.0, 360.0, exclude_max=True),
    st.floats(-90.0, 90.0),
    st.integers(2415020, 2470000),
    st.integers(0, 99999),
)
def test_what_is_written_is_read(ra, dec, day, part):
    hours, degrees = round(ra / 15 * 3600e3) % 86400000, round(abs(dec) * 3600e2)
    date = Time(day + 0.5, format="jd", scale="tai").strftime("%Y %m %d")
    h, m, s = hours // 3600000, hours // 60000 % 60, hours % 60000 / 1e3
    d, mm, ss = degrees // 360000, degrees // 6000 % 60, degrees % 6000 / 1e2
    place = f"{h:02d} {m:02d} {s:06.3f}{'-' if dec < 0 else '+'}{d:02d} {mm:02d} {ss:05.2f}"
    (one,) = Observations.parse(f"99942         C{date}.{part:05d} {place}{'':15}V{'':5}568").records
    assert (one.jd, one.part) == (day + 0.5, part / 1e5)
    assert abs((one.ra - ra + 180) % 360 - 180) <= 0.51e-3 * 15 / 3600
    assert abs(one.dec - dec) <= 0.51e-2 / 3600


@each(
    ("number", "provisional", "name"),
    [
        ("00433", "", "433"),
        ("A0345", "", "100345"),
        ("z9999", "", "619999"),
        ("~0000", "", "620000"),
        ("~000z", "", "620061"),
        ("     ", "K04M04N", "2004 MN4"),
        ("     ", "J98SA8Q", "1998 SQ108"),
        ("     ", "K16P01f", "2016 P1-F"),
        ("     ", "J95A010", "1995 A1"),
        ("     ", "PLS2040", "2040 P-L"),
        ("0001P", "", "1P"),
        ("0001P", "J82U010", "1P"),
        ("0073P", "      b", "73P-B"),  # other bodies than 73P
        ("0073P", "     bb", "73P-BB"),
        ("J013S", "", "J013S"),  # not unpacked, and as it is: it was "J013S/"
        ("", "boops", "boops"),
    ],
)
def test_packed_names_are_unpacked(number, provisional, name):
    """Examples of the MPC's page on packed designations."""
    assert packed.name(number, provisional) == name


def test_catalogues_have_the_names_of_ades():
    """As in packUtil.py of ADES-Master. "m" was ACT."""
    for letter, name in (("l", "ACT"), ("m", "GSCACT"), ("V", "Gaia2"), ("t", "PPMXL"), ("d", "USNOSA2")):
        assert Observations.parse(APOPHIS[:71] + letter + APOPHIS[72:]).records[0].catalogue == name


def test_times_before_utc_are_those_of_the_earth():
    text = APOPHIS.replace("2004 03 15.10789", "1938 11 28.00000")
    (time,) = Observations.parse(text).time
    assert (time - Time("1938-11-28", scale="tdb")).to_value(u.s) == pytest.approx(24.0, abs=0.5)  # Espenak: 24.0 s
    (later,) = Observations.parse(APOPHIS).time
    assert (later - Time("2004-03-15 02:35:21.696", scale="tdb")).to_value(u.s) == pytest.approx(64.184, abs=0.01)


def test_times_on_a_day_with_a_leap_second_are_those_of_clocks():
    clocks = ("2016-12-31T18:00:00", "2016-12-31T23:59:60.5", "2017-01-01T00:00:00", "1965-12-31T18:00:00")
    head, row = CCD.splitlines()
    rows = [row.replace("2023-07-06T00:17:43.77", clock) for clock in clocks]
    found = Observations.parse("\n".join([head, *rows])).time
    of_clocks = Time(list(clocks), scale="utc").tdb
    assert np.abs((found - of_clocks).to_value(u.s)).max() < 1e-8  # parts of the longer day were 0.75 s late


def test_uncertainties_are_those_of_veres_by_station_date_and_catalogue():
    def sigma(*lines: str) -> list[float]:
        return Observations.parse("\n".join(lines)).sigma[:, 0].to_value(u.arcsec).tolist()

    assert sigma(APOPHIS) == [0.5]
    assert sigma(APOPHIS.replace("2004", "2002")) == [0.6]
    assert sigma(APOPHIS[:-9] + "V" + APOPHIS[-8:-3] + "568") == [0.1]
    assert sigma(APOPHIS[:-9] + " " + APOPHIS[-8:-3] + "568") == [1.5]
    assert sigma(APOPHIS.replace("C2004", " 2004")) == [2.5]
    in_space = EROS.splitlines()[1:3]
    head, row = CCD.replace("|rmsRA|rmsDec", "").replace("|0.1|0.2", "").splitlines()
    place = "|sys|ctr|pos1|pos2|pos3", "|ICRF_KM|399|4353.0030|-481.6100|1382.3400"
    for station, expected in (("C51", 1.0), ("250", 1.5)):  # in both formats, whatever the mode
        assert sigma(*(line[:-3] + station for line in in_space)) == [expected]
        assert sigma(head + place[0], row.replace("568", station) + place[1]) == [expected]
    for code, mode, expected in (("n", "VID", 1.0), ("N", "NOR", 2.5), ("e", "ENC", 0.75), ("C", "CCD", 0.1)):
        line = APOPHIS.replace("C2004", f"{code}2004")
        assert sigma(line[:-9] + "V" + line[-8:-3] + "568") == sigma(head, row.replace("CCD", mode)) == [expected]
    night = [APOPHIS.replace(".10789", f".1078{k}") for k in range(9)]
    assert sigma(*night) == pytest.approx([0.5 * 1.5] * 9)
    assert Observations.parse(CCD).sigma[0].to_value(u.arcsec).tolist() == [0.1, 0.2]


def test_a_set_can_be_divided_and_joined():
    found = Observations.read(DATA / "03666_tiny.txt")
    assert (len(found), found.bodies, found.ignored) == (200, ("3666",), ())
    again = found[:50] + found[np.arange(200) >= 50]
    assert again.records == found.records
    with pytest.raises(InputError, match="no observation of '433'; it has some of 3666"):
        found.of("433")
    for wrong in ("3666", [True, False], True, 200):
        with pytest.raises(OutOfRangeError, match=r"observations\[.*expected a slice, numbers or a mask; .*of\(name\)"):
            found[wrong]
    assert sum(len(one) for one in found[:3]) == 3
    table = found.to_table()
    assert len(table) == 200
    assert table["ra"].unit == u.deg
    assert "200 optical of 3666, 11 stations, 1984-03-31 to 2001-06-16" in repr(found)


def test_nights_of_several_bodies_are_counted_apart():
    night = [APOPHIS.replace(".10789", f".1078{k}") for k in range(4)]
    other = [line.replace("99942K04M04N", "99943K04M05N") for line in night]
    assert Observations.parse("\n".join(night + other)).sigma[:, 0].to_value(u.arcsec).tolist() == [0.5] * 8


XML = (
    "<ades><optical><trkSub>Å1</trkSub><stn>568</stn><obsTime>2023-07-06T00:17:43.77Z</obsTime>"
    "<ra>273.13</ra><dec>-0.5</dec></optical></ades>"
)


def test_xml_is_decoded_as_it_declares(tmp_path):
    path = tmp_path / "one.xml"
    for encoding in ("ISO-8859-1", "UTF-8"):
        path.write_bytes(f'<?xml version="1.0" encoding="{encoding}"?>\n{XML}'.encode(encoding))
        assert Observations.read(path).bodies == ("Å1",)
    path.write_bytes(f'<?xml version="1.0" encoding="nonsense"?>{XML}'.encode())
    with pytest.raises(InputError, match=r"one.xml declares the encoding 'nonsense', which is not known"):
        Observations.read(path)
    # A text is decoded already.
    assert Observations.parse(f'<?xml version="1.0" encoding="nonsense"?>{XML}').bodies == ("Å1",)


def test_a_mark_of_byte_order_spoils_no_line(tmp_path):
    path = tmp_path / "one.txt"
    for text in (APOPHIS, CCD, XML):
        path.write_bytes(b"\xef\xbb\xbf" + text.encode())
        for found in (Observations.read(path), Observations.parse("\ufeff" + text)):
            assert (len(found), found.ignored) == (1, ())


@each(
    ("text", "message"),
    [
        ("<html><body>Not found</body></html>", "XML of <html>, in which no element is one of optical, radar"),
        ('<ades xmlns="https://x"><optical/></ades>', "XML of <{https://x}ades>, in which no element is one of"),
    ],
)
def test_xml_of_another_kind_is_refused_with_what_was_found(text, message):
    with pytest.raises(InputError, match=re.escape(message)):
        Observations.parse(text)


@each("comment", ["# obsTime, ra and dec are of 2004", "obsTime, as observed"])
def test_a_comment_that_names_a_column_is_no_heading(comment):
    found = Observations.parse(f"{comment}\n{APOPHIS}")
    assert len(found) == 1


def test_copies_count_once_and_are_told():
    one = Observations.parse("\n".join([APOPHIS, APOPHIS.replace(".10789", ".10790"), APOPHIS]))
    assert len(one) == 2
    assert one.ignored == ((3, "a copy of the observation in line 1", "99942 at JD 2453079.607890 from 691"),)
    twice = one + one
    assert twice.records == one.records
    assert [x.reason for x in twice.ignored[-2:]] == [f"a copy of the observation in line {k}" for k in (1, 2)]


def test_only_observations_are_added():
    with pytest.raises(InputError, match=r"3 is added to observations; expected orbits.Observations"):
        Observations.parse(APOPHIS) + 3


JPL_RADAR = """\
99942 Apophis (2004 MN4)\t2005-01-27 23:31:00\t-100849.1434\t0.250\tHz\t2380\t251\t251\tC
433 Eros (A898 PA)\t2012-01-27 06:30:00\t179356850.89\t25.0\tus\t8560\t253\t253\tP
433 Eros (A898 PA)\t2012-01-27 06:30:00\t179356850.89\t25.0\tm\t8560\t253\t253\tP
"""


def test_radar_is_read_as_jpl_gives_it():
    text = Observations.parse(JPL_RADAR)
    assert text.bodies == ("99942", "433")
    doppler, delay = text.records
    assert (doppler.kind, doppler.value, doppler.sigma, doppler.frequency) == ("doppler", -100849.1434, 0.25, 2380.0)
    assert (doppler.station, doppler.transmitter, doppler.surface) == ("251", "251", False)
    assert (delay.value, delay.sigma) == (179.35685089, pytest.approx(25e-6, rel=1e-15))
    assert delay.surface
    assert text.ignored[0].line == 3
    assert "the unit is 'm'" in text.ignored[0].reason
    rows = [["433", "2012-01-27 06:30:00", "1.7935685089e8", "25.0", "us", "8560.0", "-14", "-14", "P"]]
    fields = ["des", "epoch", "value", "sigma", "units", "freq", "rcvr", "xmit", "bp"]
    answer = Observations.parse(json.dumps({"fields": fields, "data": rows}))
    assert answer.records[0]._replace(line=2) == delay
    with pytest.raises(InputError, match="no radar astrometry of JPL's: 1 columns with tabs between; expected 9"):
        Observations.parse("{}")


@pytest.mark.nightly
def test_observations_that_come_with_the_package():
    """The counts are those of the files' sources; one line of Apophis' was replaced by a later measurement."""
    apophis = Observations.bundled("apophis")
    assert Counter(apophis.kind.tolist()) == {"optical": 7818, "doppler": 30, "delay": 20}
    assert [one.line for one in apophis.ignored] == [7]
    bennu = Observations.bundled("bennu")
    assert Counter(bennu.kind.tolist()) == {"optical": 580, "doppler": 7, "delay": 22}
    with pytest.raises(UnknownNameError, match="no observations of 'eros' are bundled; expected one of apophis, bennu"):
        Observations.bundled("eros")
