"""Runs for the tests of the view."""

from __future__ import annotations

from pathlib import Path

import orbits

SUN_AND_TWO = ["Sun", "Jupiter", "Saturn"]


def belt(path: Path | None = None, **options: object) -> orbits.Trajectory:
    """Two planets and 70 asteroids over five years, 21 samples: the asteroids are points, drawn by the shader.

    Jupiter and Saturn, in conjunction in 2020, have a closest approach within the run.
    """
    system = orbits.System.solar_system("2019-08-09", bodies=SUN_AND_TWO)
    system = system.add_particles(orbits.asteroids(70), propagate_to_epoch=True)
    given = {"dt": 20, "duration": 1800, "samples": 19, "progress": False, "archive": path, **options}
    return orbits.propagate(system, orbits.Gauss(stages=8), **given)


def planets(path: Path | None = None, **options: object) -> orbits.Trajectory:
    """The Sun and two planets over 5,000 days, 26 samples, with the apocentres of Jupiter as events."""
    system = orbits.System.solar_system("2022-08-09", bodies=SUN_AND_TWO)
    given = {"dt": 20, "duration": 5000, "samples": 26, "progress": False, "archive": path, **options}
    return orbits.propagate(system, orbits.Gauss(stages=8), **given)


def interrupted(path: Path, after: int) -> None:
    """Write the run of `planets` up to some samples, as a run that is going on has them in its archive."""
    seen = 0

    def ends(time: object, system: object) -> None:
        nonlocal seen
        seen += 1
        if seen == after:
            raise RuntimeError("enough")

    try:
        planets(path, callback=ends)
    except RuntimeError:
        return
    raise AssertionError("the run was not interrupted")
