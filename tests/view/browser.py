"""Chromium without a window, driven by Selenium, for the tests of the view; they are skipped where there is none."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from typing import Any

import pytest

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
DRIVER = shutil.which("chromedriver")
OPTIONS = (
    *("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--hide-scrollbars"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-dev-shm-usage"),
)
WEBGL = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")
HARMLESS = ("GPU stall due to ReadPixels",)
"""What a driver without a graphics processor says of screenshots."""


@contextlib.contextmanager
def browser(*, webgl: bool = True, size: tuple[int, int] = (1280, 800)) -> Iterator[Any]:
    """Give a browser with a profile of its own; skip the test, with the reason, where there is none."""
    if CHROMIUM is None or DRIVER is None:
        pytest.skip("no browser: the view is tested in Chromium. On Debian: apt-get install chromium chromium-driver")
    webdriver = pytest.importorskip("selenium.webdriver", reason="selenium comes with the extra 'dev'")
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        gl = WEBGL if webgl else ("--disable-3d-apis",)
        for each in (*OPTIONS, *gl, f"--window-size={size[0]},{size[1]}", f"--user-data-dir={profile}"):
            options.add_argument(each)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        service = webdriver.ChromeService(DRIVER, env={**os.environ, "no_proxy": "127.0.0.1,localhost"})
        driver = webdriver.Chrome(options=options, service=service)
        try:
            driver.set_script_timeout(60)
            yield driver
        finally:
            driver.quit()


def opened(driver: Any, url: str) -> Any:
    """Open a page with a view, wait until it is drawn, and return the browser."""
    from selenium.webdriver.support.ui import WebDriverWait

    driver.get(url)
    wait = WebDriverWait(driver, 60)
    wait.until(lambda d: d.execute_script("return Boolean(window.orbitsView && !orbitsView.dirty)"))
    return driver


def settled(driver: Any) -> None:
    """Wait until what was asked for is drawn."""
    done = "requestAnimationFrame(() => requestAnimationFrame(() => arguments[0]()))".replace("arguments[0]", "done")
    driver.execute_async_script(f"const done = arguments[0]; {done}")


def complaints(driver: Any) -> list[str]:
    """Return what the console has of warnings and errors."""
    said = [entry["message"] for entry in driver.get_log("browser") if entry["level"] in ("WARNING", "SEVERE")]
    return [text for text in said if not any(words in text for words in HARMLESS)]
