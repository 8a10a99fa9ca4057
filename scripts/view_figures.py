"""Draw the pictures of docs/view.md anew: the view in Chromium, on a desk and on a phone, dark and light.

    python scripts/view_figures.py            # all of them: a few minutes
    python scripts/view_figures.py view_dark  # of these names

It needs chromium and chromedriver, and selenium (the extra `dev`). The runs are made in a temporary folder.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from astropy import units as u
from figures import FIGURES, coded
from PIL import Image
from selenium import webdriver

import orbits

OPTIONS = (
    *("--headless=new", "--no-sandbox", "--disable-gpu", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
    *("--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update"),
    *("--disable-sync", "--hide-scrollbars"),
)
DESK, PHONE, WIDTH = (1440, 900), (390, 844), 1600


@dataclass(frozen=True)
class Shot:
    """A picture: the run that it is of, what is done before it is taken, and where it is seen."""

    run: str
    script: str
    size: tuple[int, int] = DESK
    dark: bool = True


SHOTS = {
    "view_dark": [Shot("planets", "v.jump(330); v.pick(v.run.names.indexOf('Saturn'))")],
    "view_light": [Shot("belt", "v.setMode('a'); v.jump(30); v.pick(600)", dark=False)],
    "view_asteroids": [Shot("many", "v.setMode('a'); v.jump(40)")],
    "view_phones": [
        Shot("belt", "v.setMode('i'); v.jump(12)", PHONE),
        Shot("planets", "v.jump(30); v.pick(v.run.names.indexOf('Uranus')); v.sky.fit()", PHONE, dark=False),
    ],
}
"""The pictures of the page; those of one are put beside each other."""


def planets() -> orbits.Trajectory:
    """The Sun and the planets over Neptune's period."""
    system = orbits.System.solar_system("2022-08-09")
    return orbits.propagate(system, orbits.Gauss(stages=8), dt=6 * u.day, duration=165 * u.yr, samples=661)


def belt() -> orbits.Trajectory:
    """1,250 asteroids of the catalogue among the planets."""
    system = orbits.System.solar_system("2022-08-09").add_particles(orbits.asteroids(1250))
    return orbits.propagate(system, "wisdom-holman", dt=3 * u.day, duration=20 * u.yr, samples=101)


def many() -> orbits.Trajectory:
    """10,000 asteroids that are drawn by lot, with a fixed seed, between Mars and Jupiter."""
    dice, count = np.random.default_rng(7), 10_000
    system = orbits.System.solar_system("2022-08-09", bodies=["Sun", "Mars", "Jupiter", "Saturn"])
    names = [f"asteroid {k + 1}" for k in range(count)]
    angles = {name: dice.uniform(0.0, 360.0, count) * u.deg for name in ("Omega", "omega", "M")}
    elements = {
        "a": dice.uniform(2.05, 3.6, count) * u.au,
        "e": np.abs(dice.normal(0.13, 0.07, count)).clip(0.0, 0.4),
        "inc": np.abs(dice.normal(0.0, 9.0, count)) * u.deg,
    }
    system = system.add(names, primary="Sun", **elements, **angles)
    return orbits.propagate(system, "wisdom-holman", dt=20 * u.day, duration=30 * u.yr, samples=101)


RUNS: dict[str, Callable[[], orbits.Trajectory]] = {"planets": planets, "belt": belt, "many": many}


def browser(shot: Shot) -> Any:
    """Return a browser of the size and with the colours of a picture."""
    options = webdriver.ChromeOptions()
    for each in (*OPTIONS, f"--user-data-dir={tempfile.mkdtemp()}", f"--window-size={shot.size[0]},{shot.size[1]}"):
        options.add_argument(each)
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which("chromedriver")))
    width, height = shot.size
    metrics = {"width": width, "height": height, "deviceScaleFactor": 2, "mobile": shot.size == PHONE}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    scheme = {"name": "prefers-color-scheme", "value": "dark" if shot.dark else "light"}
    driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [scheme]})
    return driver


def taken(shot: Shot, page: Path) -> Image.Image:
    """Return the picture of a page."""
    driver = browser(shot)
    try:
        driver.get(page.as_uri())
        time.sleep(3)
        driver.execute_script(f"const v = orbitsView; {shot.script}")
        time.sleep(3)
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "shot.png"
            driver.save_screenshot(str(file))
            with Image.open(file) as picture:
                return picture.convert("RGB")
    finally:
        driver.quit()


def beside(pictures: list[Image.Image]) -> Image.Image:
    """Return pictures of one height beside each other, with a gap, 1,600 pixels wide at most."""
    gap = 40 if len(pictures) > 1 else 0
    width = sum(picture.width for picture in pictures) + gap * (len(pictures) - 1)
    whole = Image.new("RGB", (width, pictures[0].height), "#8b95a8")
    left = 0
    for picture in pictures:
        whole.paste(picture, (left, 0))
        left += picture.width + gap
    small = min(1.0, WIDTH / width)
    return whole.resize((round(width * small), round(whole.height * small)), Image.Resampling.LANCZOS)


def save(name: str, picture: Image.Image) -> None:
    """Write a picture of the docs."""
    path = FIGURES / f"{name}.png"
    path.write_bytes(coded(picture))
    print(f"{path}: {path.stat().st_size / 1024:.0f} kB")


def main() -> None:
    """Draw what is asked for."""
    names = sys.argv[1:] or list(SHOTS)
    if unknown := sorted(set(names) - set(SHOTS)):
        raise SystemExit(f"there is no picture {unknown[0]!r}; expected some of {', '.join(SHOTS)}")
    warnings.simplefilter("ignore")
    with tempfile.TemporaryDirectory() as folder:
        for run in sorted({shot.run for name in names for shot in SHOTS[name]}):
            orbits.view(RUNS[run](), Path(folder) / f"{run}.html")
        for name in names:
            save(name, beside([taken(one, Path(folder) / f"{one.run}.html") for one in SHOTS[name]]))


if __name__ == "__main__":
    main()
