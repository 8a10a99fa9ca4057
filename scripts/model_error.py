"""The deviation of Newtonian point masses from the real Solar System: runs from 2000-01-01 compared with DE440.

    python scripts/model_error.py                  the table of docs/model.md, some seconds

The integration error is round-off here (metres in a thousand years), so the deviation is that of the model: DE440 has
relativity, the figures of Sun, Earth and Moon, tides, 343 asteroids and the Kuiper belt, which these runs lack.
Positions are heliocentric, and for the Moon also geocentric, at the same TDB; the largest distance since the start
counts. Source of the forces in DE440: Park et al. (2021), AJ 161, 105.
"""

from __future__ import annotations

import numpy as np
from astropy import units as u

import orbits
from orbits import ephemeris
from orbits.system.solar.building import APART
from orbits.units import as_epoch

EPOCH = "2000-01-01"
YEARS = (1, 10, 30)
"""Julian years; the bundled part of DE440 ends half a day after thirty of them."""

SAMPLES_A_YEAR = 48
TOGETHER = ephemeris.SOLAR_SYSTEM


def times() -> np.ndarray:
    """Return the days since the epoch at which positions are compared."""
    return np.linspace(0.0, YEARS[-1] * 365.25, YEARS[-1] * SAMPLES_A_YEAR + 1)


def real_positions() -> np.ndarray:
    """Return where DE440 has all of `ephemeris.BODIES` at `times()`, (times, bodies, 3), km, barycentric."""
    zero, days = as_epoch(EPOCH), times()
    return ephemeris.AU_KM * ephemeris.tracks(ephemeris.BODIES, np.full(len(days), zero.jd1), zero.jd2 + days)[0]


def missed(bodies: tuple[str, ...], dt: float, real: np.ndarray) -> dict[str, np.ndarray]:
    """Return the difference from DE440 seen from the Sun, by body: (times, 3), km.

    bodies : of DE440, with the Sun; where Earth and Moon are apart, "Moon from the Earth" and their barycentre come too
    dt : step in days of Gauss with 8 stages
    real : as of `real_positions`
    """
    system = orbits.System.solar_system(epoch=EPOCH, bodies=bodies)
    run = orbits.propagate(
        system, orbits.Gauss(stages=8), dt=dt, duration=times()[-1], samples=times(), progress=False, check_step=False
    )
    names = list(system.names)
    differences = np.asarray(run.q.to_value(u.km)) - real[:, [ephemeris.BODIES.index(name) for name in names]]
    out = {name: differences[:, i] - differences[:, names.index("Sun")] for i, name in enumerate(names)}
    if "Moon" in names:
        earth, moon = ephemeris.gm(["Earth", "Moon"])
        out["Moon from the Earth"] = out["Moon"] - out["Earth"]
        out["Earth-Moon barycenter"] = (earth * out["Earth"] + moon * out["Moon"]) / (earth + moon)
    del out["Sun"]
    return out


def largest(differences: np.ndarray) -> list[float]:
    """Return the largest length within each of `YEARS`."""
    lengths = np.linalg.norm(differences, axis=1)
    return [float(lengths[: y * SAMPLES_A_YEAR + 1].max()) for y in YEARS]


def rounded(km: float) -> str:
    """Return a figure for the table: two digits, and no fractions of a kilometre from ten on."""
    return f"{float(f'{km:.2g}'):,.0f}" if km >= 10 else f"{km:.2g}"


def measured() -> dict[str, list[float]]:
    """Return km within each of `YEARS`, by row of the table."""
    real = real_positions()
    apart, together = missed(APART, 1.0, real), missed(TOGETHER, 6.0, real)
    barycentre = apart.pop("Earth-Moon barycenter")
    merged = together["Earth-Moon barycenter"]
    return {
        **{name: largest(differences) for name, differences in apart.items()},
        "Earth and Moon as one body": largest(merged),
        "effect of making them one body": largest(merged - barycentre),
    }


def main() -> None:
    """Print the table."""
    print("| km, heliocentric, largest within | " + " | ".join(f"{y} yr" for y in YEARS) + " |")
    print("|" + " --- |" * (len(YEARS) + 1))
    for name, km in measured().items():
        print("| " + " | ".join([name, *map(rounded, km)]) + " |")


if __name__ == "__main__":
    main()
