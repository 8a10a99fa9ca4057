"""Every bundled data file is the one that data/README.md describes."""

from __future__ import annotations

import hashlib
import json
import re

from orbits.resources import bundled, data_path

from ..coverings import each

HASHES = {
    name: digest
    for digest, name in re.findall(
        r"^\s*([0-9a-f]{64})  (\S+)$", data_path("README.md").read_text(encoding="utf-8"), re.MULTILINE
    )
}


@each("name", sorted(HASHES))
def test_file_has_the_hash_in_the_readme(name: str) -> None:
    assert hashlib.sha256(data_path(name).read_bytes()).hexdigest() == HASHES[name]


def test_every_file_has_a_hash_and_a_row_in_the_table() -> None:
    present = {path.name for path in bundled("data").iterdir() if not path.name.startswith(".")} - {"README.md"}
    assert present == set(HASHES)
    rows = re.findall(r"^\| (`[^|]+`) \|", data_path("README.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert {name.strip("`") for row in rows for name in row.split(", ")} == present


def test_gm_table_is_the_one_in_the_ephemeris_own_comments() -> None:
    from jplephem.spk import SPK

    with SPK.open(str(data_path("de440_2000_2030.bsp"))) as spk:
        comments = spk.comments()
    table = json.loads(data_path("gm_de440.json").read_text(encoding="utf-8"))["au3_d2"]
    assert len(table) == 12
    for key, value in table.items():
        (text,) = re.findall(rf"^\s*{key}\s+(\d\.\d+e-\d+)\b", comments, re.MULTILINE)
        assert float(text) == value
