"""Packed designations and dates, against the Minor Planet Center's own examples and against packing them."""

from __future__ import annotations

import contextlib
import datetime

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orbits.catalogue import packed

from ..coverings import each
from . import lines

HALF_MONTHS = "ABCDEFGHJKLMNOPQRSTUVWXY"


@each(
    ("code", "number"),
    # Of the page "Packed Provisional and Permanent Designations", and the ends of each range.
    [("00001", 1), ("03202", 3202), ("99999", 99_999), ("A0000", 100_000), ("A0345", 100_345), ("a0017", 360_017),
     ("K3289", 203_289), ("z9999", 619_999), ("~0000", 620_000), ("~000z", 620_061), ("~AZaz", 3_140_113),
     ("~zzzz", 15_396_335)],
)  # fmt: skip
def test_numbers_of_the_description_unpack(code: str, number: int) -> None:
    assert packed.number(code) == number
    assert lines.packed_number(number) == code


@each(
    ("code", "readable"),
    [("J95X00A", "1995 XA"), ("J95X01L", "1995 XL1"), ("J95F13B", "1995 FB13"), ("J98SA8Q", "1998 SQ108"),
     ("J98SC7V", "1998 SV127"), ("J98SG2S", "1998 SS162"), ("K99AJ3Z", "2099 AZ193"), ("K08Aa0A", "2008 AA360"),
     ("K07Tf8A", "2007 TA418"), ("PLS2040", "2040 P-L"), ("T1S3138", "3138 T-1"), ("T2S1010", "1010 T-2"),
     ("T3S4101", "4101 T-3"), ("J04O00A", "A904 OA"), ("I01A00A", "A801 AA"), ("_QC0000", "2026 CA620"),
     ("_QC0aEM", "2026 CZ6190"), ("_QCzzzz", "2026 CL591673"), ("_AH9fZ7", "2010 HJ92809")],
)  # fmt: skip
def test_designations_of_the_description_unpack(code: str, readable: str) -> None:
    assert packed.designation(code) == readable
    assert packed.ANY.fullmatch(code)


@pytest.mark.parametrize(
    ("code", "day"),
    [("J9611", "1996-01-01"), ("J961A", "1996-01-10"), ("J969U", "1996-09-30"), ("J96A1", "1996-10-01"),
     ("K01AM", "2001-10-22"), ("K223B", "2022-03-11"), ("K242T", "2024-02-29"), ("I01CV", "1801-12-31")],
)  # fmt: skip
def test_dates_of_the_description_unpack(code: str, day: str) -> None:
    assert packed.date(code) == (datetime.date.fromisoformat(day) - datetime.date(1858, 11, 17)).days


@given(st.integers(1, 15_396_335))
def test_every_number_comes_back(number: int) -> None:
    assert packed.number(lines.packed_number(number)) == number


@given(st.integers(2000, 2035), st.sampled_from(HALF_MONTHS), st.integers(0, 15_500 + 62**4 - 1))
def test_every_designation_comes_back(year: int, half: str, count: int) -> None:
    code, readable = lines.provisional(year, half, count)
    assert packed.designation(code) == readable


@given(st.integers(1801, 1999), st.sampled_from(HALF_MONTHS), st.integers(0, 15_499))
def test_every_old_designation_comes_back(year: int, half: str, count: int) -> None:
    code, readable = lines.provisional(year, half, count)
    assert packed.designation(code) == readable


@given(st.dates(datetime.date(1801, 1, 1), datetime.date(2099, 12, 31)))
def test_every_date_comes_back(day: datetime.date) -> None:
    century = {18: "I", 19: "J", 20: "K"}[day.year // 100]
    code = f"{century}{day.year % 100:02d}{lines.BASE_62[day.month]}{lines.BASE_62[day.day]}"
    assert packed.date(code) == (day - datetime.date(1858, 11, 17)).days


@given(st.text("019AJKTZaz~_é\x00 -", max_size=8))
def test_what_is_not_packed_is_a_value_error_and_nothing_else(text: str) -> None:
    for unpack in (packed.number, packed.designation, packed.date):
        with contextlib.suppress(ValueError):
            unpack(text)


@pytest.mark.parametrize("code", ["00000", "0001 ", "~00-0", "0000a", "", "A000", "é0001", "-0001"])
def test_what_looks_like_a_number_is_refused(code: str) -> None:
    with pytest.raises(ValueError, match="not a packed number"):
        packed.number(code)


@pytest.mark.parametrize("code", ["K230B", "K22D1", "K232V", "H2211", "K2231B", "K 211", "K22-1", "K2211 "])
def test_what_looks_like_a_date_is_refused(code: str) -> None:
    with pytest.raises(ValueError, match="not a packed date"):
        packed.date(code)


def test_numbers_of_many_lines_are_those_of_each() -> None:
    numbers = [1, 99_999, 100_000, 619_999, 620_000, 15_396_335]
    text = "".join(f"{lines.packed_number(number):7}" for number in numbers) + "K07Tf8A" + "T1S3138"
    columns = np.frombuffer(text.encode(), dtype=np.uint8).reshape(-1, 7)
    assert packed.numbers(columns).tolist() == [*numbers, 0, 0]
