"""The view in a real browser: from disk and from its server, with WebGL and without."""

from __future__ import annotations

import io
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import orbits
from orbits.elements import to_frame
from orbits.viewing.server import ViewServer
from tests.view import runs
from tests.view.browser import browser, complaints, opened, settled

from ..coverings import first


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    with browser() as driver:
        yield driver


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("view") / "belt.h5"
    runs.belt(path).close()
    return path


@pytest.fixture(scope="module")
def from_disk(archive: Path) -> str:
    run = orbits.Trajectory.open(archive)
    page = orbits.view(run, archive.with_suffix(".html"), title="a <b>belt</b>")
    run.close()
    return page.path.as_uri()


def serving(archive: Path) -> ViewServer:
    server = ViewServer(archive)
    threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True).start()
    return server


def picture(driver: Any) -> np.ndarray:
    """What is on the screen, (height, width, 3)."""
    settled(driver)
    return np.asarray(Image.open(io.BytesIO(driver.get_screenshot_as_png())).convert("RGB")).astype(int)


def alone(driver: Any) -> None:
    """Leave only the sky on the screen, with points and bodies."""
    driver.execute_script(
        "orbitsView.setPaths('none'); orbitsView.labelsOn = false; orbitsView.pick(-1); orbitsView.setTheme(true);"
        "for (const one of document.querySelectorAll('.panel, .timeline, .title, .tools, .ruler, .notice'))"
        "  one.style.visibility = 'hidden';"
        "document.querySelector('.orbits-view').style.background = 'black'; orbitsView.dirty = true;"
    )


def in_the_axes_of_the_page(run: orbits.Trajectory, sample: int) -> np.ndarray:
    return to_frame(run.q[sample].value, "ecliptic")


def places(driver: Any) -> np.ndarray:
    """Where the page has all bodies, from the origin, in the order of its names."""
    code = "return orbitsView.run.names.map((_, k) => Array.from(orbitsView.run.placeOf(k)))"
    return np.array(driver.execute_script(code))


def drag_the_slider(driver: Any, time: float) -> None:
    driver.execute_script(
        "const slider = document.querySelector('.time'); slider.value = arguments[0];"
        "slider.dispatchEvent(new Event('input', { bubbles: true }))",
        str(time),
    )
    settled(driver)


@pytest.mark.parametrize("way", first(1, ["disk", "server"]))
def test_the_page_loads_without_complaints_and_its_canvas_is_not_blank(
    chromium: Any, archive: Path, from_disk: str, way: str
) -> None:
    server = serving(archive) if way == "server" else None
    try:
        opened(chromium, server.url if server else from_disk)
        alone(chromium)
        seen = picture(chromium)
    finally:
        if server:
            server.shutdown()
            server.server_close()
    assert complaints(chromium) == []
    # 70 points of several pixels, three discs and the glow of the Sun on black; a blank canvas has none.
    assert (seen.max(axis=2) > 60).sum() > 400


@pytest.mark.nightly
def test_texts_of_a_run_are_texts_not_markup(chromium: Any, from_disk: str) -> None:
    opened(chromium, from_disk)
    assert chromium.execute_script("return document.querySelector('h1').textContent") == "a <b>belt</b>"


def test_the_slider_moves_all_bodies_to_where_the_archive_has_them(
    chromium: Any, archive: Path, from_disk: str
) -> None:
    run = orbits.Trajectory.open(archive)
    opened(chromium, from_disk)
    names = chromium.execute_script("return orbitsView.run.names")
    order = [run.names.index(name) for name in names]
    for sample in (0, 1, 7, 18):
        drag_the_slider(chromium, float(run.times[sample]))
        expected = in_the_axes_of_the_page(run, sample)[order]
        size = np.linalg.norm(expected, axis=1).max()
        away = np.abs(places(chromium) - expected).max(axis=1) / size
        assert away[:3].max() < 1e-15  # float64, and relative to the centre: two roundings
        assert away[3:].max() < 1.2e-7  # float32
        assert f"sample {sample + 1} of 19" in chromium.execute_script(
            "return document.querySelector('.where').textContent"
        )
    run.close()


def test_between_samples_bodies_are_where_the_run_is(chromium: Any, archive: Path, from_disk: str) -> None:
    run = orbits.Trajectory.open(archive)
    opened(chromium, from_disk)
    order = [run.names.index(name) for name in chromium.execute_script("return orbitsView.run.names")]
    time = float(run.times[4] + 37.0)
    drag_the_slider(chromium, time)
    truth = to_frame(run.at(time).values.q, "ecliptic")[order]
    away = np.linalg.norm(places(chromium) - truth, axis=1)
    # Two-body motion that fits both ends of 100 days: what is left are perturbations within, 4.3e-4 au (a Trojan);
    # a straight line would be off by 0.3 au.
    assert away.max() < 6e-4
    assert "between samples 5 and 6" in chromium.execute_script("return document.querySelector('.where').textContent")
    run.close()


@pytest.mark.nightly
@pytest.mark.parametrize("later", [0.0, 41.0])
def test_the_graphics_processor_draws_each_point_where_it_is(
    chromium: Any, archive: Path, from_disk: str, later: float
) -> None:
    opened(chromium, from_disk)
    alone(chromium)
    drag_the_slider(chromium, 500.0 + later)  # a sample, and 41 days after it
    code = (
        "const v = orbitsView, s = v.run.placeOf(v.focus), out = [];"
        "for (let k = v.run.count; k < v.run.names.length; k++) {"
        "  const p = v.run.placeOf(k); out.push(v.sky.onScreen(p[0] - s[0], p[1] - s[1], p[2] - s[2])); }"
        "return out"
    )
    expected = np.array(chromium.execute_script(code))
    seen = picture(chromium).max(axis=2)
    height, width = seen.shape
    inside = (expected > 3).all(axis=1) & (expected[:, 0] < width - 3) & (expected[:, 1] < height - 3)
    assert inside.sum() > 60
    for x, y in expected[inside]:
        around = seen[int(y) - 1 : int(y) + 2, int(x) - 1 : int(x) + 2]
        assert around.max() > 100, (x, y)  # within a pixel; the sky is black
    assert (seen > 100).sum() < 0.01 * seen.size


def test_a_body_that_is_clicked_shows_its_elements_and_closest_approaches(
    chromium: Any, archive: Path, from_disk: str
) -> None:
    from selenium.webdriver.common.action_chains import ActionChains

    run = orbits.Trajectory.open(archive)
    opened(chromium, from_disk)
    drag_the_slider(chromium, float(run.times[-1]))
    where = chromium.execute_script(
        "const v = orbitsView, k = v.run.names.indexOf('Jupiter'), s = v.run.placeOf(0), p = v.run.placeOf(k);"
        "return v.sky.onScreen(p[0] - s[0], p[1] - s[1], p[2] - s[2])"
    )
    canvas = chromium.find_element("css selector", "canvas.sky")
    middle = canvas.size["width"] / 2, canvas.size["height"] / 2
    ActionChains(chromium).move_to_element_with_offset(
        canvas, round(where[0] - middle[0]), round(where[1] - middle[1])
    ).click().perform()
    settled(chromium)
    assert chromium.execute_script("return document.querySelector('.picked h2').textContent") == "Jupiter"
    note = chromium.execute_script("return document.querySelector('.picked .note').textContent")
    assert note == "osculating, about the Sun · ecliptic of J2000"
    cells = chromium.execute_script("return [...document.querySelectorAll('.elements > *')].map((x) => x.textContent)")
    shown = dict(zip(cells[::2], cells[1::2], strict=True))
    elements = run[-1].elements("Sun")["Jupiter"]
    # As many digits as are shown.
    assert float(shown["a"].split()[0]) == pytest.approx(elements.a.value, rel=1e-6)
    assert float(shown["e"]) == pytest.approx(float(elements.e), abs=1e-6)
    for name, angle in (("i", elements.inc), ("Ω", elements.Omega), ("ω", elements.omega), ("M", elements.M)):
        assert float(shown[name].rstrip("°")) == pytest.approx(angle.to_value("deg") % 360, abs=1e-4)
    closest = next(one for one in run.closest_approaches() if "Jupiter" in (one.body, one.other))
    text = chromium.execute_script("return document.querySelector('.approaches, .picked').textContent")
    assert f"{closest.distance.value:.5g}" in text
    run.close()


@pytest.mark.nightly
def test_points_are_found_by_name_and_by_a_click(chromium: Any, from_disk: str) -> None:
    opened(chromium, from_disk)
    name = chromium.execute_script("return orbitsView.run.names[20]")
    chromium.find_element("css selector", "input[type=search]").send_keys(name)
    chromium.find_element("css selector", ".found button").click()
    settled(chromium)
    assert chromium.execute_script("return document.querySelector('.picked h2').textContent") == name
    nearest = chromium.execute_script(
        "const v = orbitsView, s = v.run.placeOf(0), p = v.run.placeOf(20);"
        "return v.nearest(...v.sky.onScreen(p[0] - s[0], p[1] - s[1], p[2] - s[2]))"
    )
    assert nearest == 20


@pytest.mark.nightly
def test_keys_play_step_colour_and_show_their_list(chromium: Any, from_disk: str) -> None:
    from selenium.webdriver.common.keys import Keys

    opened(chromium, from_disk)
    canvas = chromium.find_element("css selector", "canvas.sky")
    canvas.send_keys(Keys.ARROW_RIGHT, Keys.ARROW_RIGHT)
    assert chromium.execute_script("return orbitsView.run.sampleAt(orbitsView.time)") == 2
    canvas.send_keys(Keys.END)
    assert chromium.execute_script("return orbitsView.time === orbitsView.run.end")
    canvas.send_keys(" ")
    assert chromium.execute_script("return orbitsView.playing")
    canvas.send_keys(" ", "c", "n")
    assert chromium.execute_script("return [orbitsView.playing, orbitsView.modeName, orbitsView.picked]") == [
        False,
        "a",
        0,
    ]
    canvas.send_keys("?")
    assert chromium.find_element("css selector", ".keys").is_displayed()
    chromium.switch_to.active_element.send_keys(Keys.ESCAPE)
    assert not chromium.find_element("css selector", ".keys").is_displayed()


@pytest.mark.nightly
def test_every_control_can_be_reached_by_tab(chromium: Any, from_disk: str) -> None:
    from selenium.webdriver.common.keys import Keys

    opened(chromium, from_disk)
    seen = set()
    for _ in range(60):
        chromium.switch_to.active_element.send_keys(Keys.TAB)
        code = "const x = document.activeElement; return x.getAttribute('aria-label') || x.textContent || x.className"
        seen.add(chromium.execute_script(code))
    assert {"time", "colour", "paths", "centre", "find a body", "Play (space)", "keys (?)"} <= seen


@pytest.mark.nightly
def test_playing_moves_time_and_stops_at_the_end(chromium: Any, from_disk: str) -> None:
    from selenium.webdriver.support.ui import WebDriverWait

    opened(chromium, from_disk)
    chromium.execute_script("orbitsView.setSpeed(1e9); orbitsView.toggle()")
    WebDriverWait(chromium, 30).until(lambda d: not d.execute_script("return orbitsView.playing"))
    assert chromium.execute_script("return orbitsView.time === orbitsView.run.end")


@pytest.mark.nightly
def test_a_run_that_grows_is_followed(chromium: Any, tmp_path: Path) -> None:
    from selenium.webdriver.support.ui import WebDriverWait

    path = tmp_path / "growing.h5"
    runs.interrupted(path, after=9)
    with orbits.Archive.open(path) as begun:
        had = begun.committed
    assert 0 < had < 26
    server = serving(path)
    try:
        opened(chromium, server.url)
        assert chromium.execute_script("return orbitsView.run.length") == had
        assert f"{had} of 26 samples" in chromium.execute_script("return document.querySelector('.badge').textContent")
        orbits.resume(path, progress=False).close()
        wait = WebDriverWait(chromium, 30)
        wait.until(lambda d: d.execute_script("return orbitsView.run.complete && orbitsView.run.approaches !== null"))
    finally:
        server.shutdown()
        server.server_close()
    run = orbits.Trajectory.open(path)
    assert chromium.execute_script("return Array.from(orbitsView.run.times)") == run.times.tolist()
    drag_the_slider(chromium, float(run.times[-1]))
    order = [run.names.index(name) for name in chromium.execute_script("return orbitsView.run.names")]
    assert np.abs(places(chromium) - in_the_axes_of_the_page(run, -1)[order]).max() < 1e-14
    run.close()


@pytest.mark.nightly
def test_events_are_marks_on_the_time_line(chromium: Any, tmp_path: Path) -> None:
    run = runs.planets(events=orbits.events.Apocentre("Jupiter", "Sun"))
    assert len(run.events)
    opened(chromium, orbits.view(run, tmp_path / "events.html").path.as_uri())
    marks = chromium.find_elements("css selector", ".mark")
    assert len(marks) == len(run.events)
    marks[0].click()
    settled(chromium)
    assert chromium.execute_script("return orbitsView.time") == run.events[0].time.value
    assert "apocentre of Jupiter" in chromium.find_element("css selector", ".tip").text


@pytest.mark.nightly
def test_the_time_line_says_how_many_events_are_not_marked(
    chromium: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = runs.planets(events=[orbits.events.Apocentre("Jupiter", "Sun"), orbits.events.Pericentre("Jupiter", "Sun")])
    for most, said in ((1, f"events: the first 1 of {len(run.events)}"), (len(run.events), "")):
        monkeypatch.setattr("orbits.viewing.happenings.MOST", most)
        opened(chromium, orbits.view(run, tmp_path / f"{most}.html").path.as_uri())
        assert len(chromium.find_elements("css selector", ".mark")) == most
        assert chromium.find_element("css selector", ".timeline .some").text == said


@pytest.mark.nightly
def test_without_webgl_there_is_a_picture_and_a_sentence_and_the_slider_moves_it(from_disk: str) -> None:
    with browser(webgl=False) as driver:
        opened(driver, from_disk)
        assert "no WebGL" in driver.find_element("css selector", ".notice").text
        assert complaints(driver) == []
        alone(driver)
        before = picture(driver)
        assert (before.max(axis=2) > 60).sum() > 150
        drag_the_slider(driver, 900.0)
        assert (picture(driver) != before).any()


@pytest.mark.nightly
def test_light_and_dark_follow_the_system_and_the_switch(chromium: Any, from_disk: str) -> None:
    def theme() -> str:
        return str(chromium.execute_script("return document.querySelector('.orbits-view').dataset.theme"))

    for scheme in ("light", "dark"):
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        chromium.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
        opened(chromium, from_disk)
        assert theme() == scheme
    chromium.find_element("css selector", "button[title='light or dark (T)']").click()
    assert theme() == "light"


@pytest.mark.nightly
def test_reduced_motion_stops_the_view_from_gliding(chromium: Any, from_disk: str) -> None:
    features = [{"name": "prefers-reduced-motion", "value": "reduce"}]
    chromium.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
    opened(chromium, from_disk)
    gliding = chromium.execute_script("return orbitsView.sky.controls.enableDamping")
    chromium.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
    assert gliding is False


@pytest.mark.nightly
def test_the_module_of_the_widget_draws_the_view_into_an_element(chromium: Any, tmp_path: Path) -> None:
    import json

    from orbits.viewing.page import asset, widget_module

    made = orbits.view(runs.planets(), show=False)
    values = json.dumps(made.widget().data)
    page = tmp_path / "notebook.html"
    page.write_text(
        f"<!DOCTYPE html><meta charset='utf-8'><link rel='icon' href='data:,'><style>{asset('view.css')}</style>"
        f"<div id='cell' style='width: 900px'></div><script type='module'>{widget_module().split('export default')[0]}"
        f"window.left = widget.render({{ model: {{ get: () => ({values}) }}, el: document.getElementById('cell') }});"
        "</script>",
        encoding="utf-8",
    )
    chromium.get(page.as_uri())
    settled(chromium)
    settled(chromium)
    seen = picture(chromium)[50:400, 100:600]
    assert complaints(chromium) == []
    title = chromium.execute_script("return document.querySelector('#cell h1').textContent")
    assert title == "Sun, Jupiter, Saturn"
    assert seen.max() - seen.min() > 100
    chromium.execute_script("window.left()")
    assert chromium.execute_script("return document.querySelector('#cell canvas')") is None


@pytest.mark.nightly
def test_a_run_backwards_in_time_plays_backwards_and_trails_follow(chromium: Any, tmp_path: Path) -> None:
    run = runs.planets(duration=-5000)
    opened(chromium, orbits.view(run, tmp_path / "back.html").path.as_uri())
    drag_the_slider(chromium, -4990.0)
    chromium.execute_script("orbitsView.setPaths('trails')")
    settled(chromium)
    order = [run.names.index(name) for name in chromium.execute_script("return orbitsView.run.names")]
    truth = to_frame(run.at(-4990.0).values.q, "ecliptic")[order]
    assert np.abs(places(chromium) - truth).max() < 1e-3  # arcs over 200 days, see above
    code = "const t = orbitsView.sky.trails; return [t.length, Array.from(t.known.slice(720, 1440))]"
    length, known = chromium.execute_script(code)
    trail = np.array(known, dtype=float).reshape(-1, 3)  # of the second body, Jupiter, about the Sun
    assert length < 0
    radius = np.linalg.norm(trail, axis=1)
    assert ((radius > 4.9) & (radius < 5.5)).all()


@pytest.mark.nightly
def test_a_title_and_a_time_line_are_readable_on_a_phone(from_disk: str) -> None:
    with browser(size=(390, 844)) as driver:
        metrics = {"width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": True}
        driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        opened(driver, from_disk)
        settled(driver)
        boxes = {
            name: driver.execute_script(
                "const b = document.querySelector(arguments[0]).getBoundingClientRect();"
                "return [b.left, b.top, b.right, b.bottom]",
                name,
            )
            for name in (".title", ".tools", ".timeline", ".play, .buttons")
        }
        for left, top, right, bottom in boxes.values():
            assert 0 <= left < right <= 390
            assert 0 <= top < bottom <= 844
        assert boxes[".title"][2] <= boxes[".tools"][0]
        assert driver.execute_script("return document.documentElement.scrollWidth") == 390
        small = driver.execute_script(
            "return Math.min(...[...document.querySelectorAll('.buttons button')].map((b) => b.offsetHeight))"
        )
        assert small >= 38  # a finger
        driver.find_element("css selector", ".more").click()
        settled(driver)
        assert driver.find_element("css selector", ".panel").is_displayed()


@pytest.mark.nightly
def test_on_a_phone_on_its_side_the_elements_of_a_body_can_be_read(chromium: Any, from_disk: str) -> None:
    size = {"width": 844, "height": 390, "deviceScaleFactor": 1, "mobile": False}
    chromium.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        opened(chromium, from_disk)
        chromium.execute_script("orbitsView.pick(1)")
        settled(chromium)
        code = (
            "const seen = document.querySelector('.elements').getBoundingClientRect();"
            "return [...document.querySelectorAll('.panel, .panel-inside')].every((one) => {"
            "  const box = one.getBoundingClientRect(); return box.top <= seen.top && seen.bottom <= box.bottom; })"
        )
        assert chromium.execute_script(code)
    finally:
        chromium.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
