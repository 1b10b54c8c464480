"""The page in a browser: it opens without complaint or network, plays, and answers to mouse and keys."""

import json
import re
import time

import numpy as np
import pytest

import browser
from run_folders import write_run
from spume.outputs import vtkhdf
from spume.report import write_report

pytest.importorskip("plotly")
pytestmark = pytest.mark.skipif(bool(browser.missing()), reason=browser.missing() or "all there")

SECONDS = 60  # in which anything must have happened, on a busy machine


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    return {"2D": write_run(folder / "flat"), "3D": write_run(folder / "deep", width=0.4)}


@pytest.fixture(scope="module")
def driver():
    with browser.chromium() as driver:
        yield driver


@pytest.fixture
def opened(runs, driver):
    """Open the page of runs, wide and light."""

    def opened(*names):
        page = runs[names[0]].parent / f"{'-'.join(names)}.html"
        if not page.exists():
            write_report([runs[name] for name in names] if len(names) > 1 else runs[names[0]], page)
        browser.screen(driver, 1200, 900)
        driver.get("about:blank")
        driver.get_log("performance")
        browser.complaints(driver)
        driver.get(page.as_uri())
        until(driver, "window.spume && window.spume.ready")
        return driver

    return opened


def until(driver, condition):
    begin = time.monotonic()
    while not driver.execute_script(f"return {condition}"):
        assert time.monotonic() - begin < SECONDS, condition
        time.sleep(0.02)


def ask(driver, expression, *arguments):
    return driver.execute_script(f"return {expression}", *arguments)


def mouse(driver, kind, x, y, **more):
    event = {"type": kind, "x": x, "y": y, "button": "left", "clickCount": 1} | more
    driver.execute_cdp_cmd("Input.dispatchMouseEvent", event)


def click(driver, x, y):
    for kind in ("mousePressed", "mouseReleased"):
        mouse(driver, kind, x, y)


def picture(driver):
    """A number for what the canvas shows."""
    return ask(driver, "spume.player.views[0].pixels.reduce((sum, p) => (31 * sum + p) | 0, 7)")


@pytest.mark.parametrize("names", [("2D",), ("3D",), ("2D", "3D")], ids=["2D", "3D", "comparison"])
def test_the_page_opens_without_complaint_and_without_network(opened, names):
    driver = opened(*names)
    until(driver, "document.querySelectorAll('[data-chart]').length > 5")
    driver.execute_script("document.querySelector('[data-chart]').scrollIntoView()")
    until(driver, "document.querySelector('[data-chart]').dataset.drawn")
    if names == ("2D",):  # all of them, as for paper
        driver.execute_script("window.dispatchEvent(new Event('beforeprint'))")
        until(driver, "[...document.querySelectorAll('[data-chart]')].every((place) => place.dataset.drawn)")
        assert ask(driver, "document.querySelectorAll('.chart svg.main-svg').length") >= 8
    for dark in (False, True):
        for width in (1200, 390):
            browser.screen(driver, width, 844, dark=dark)
            time.sleep(0.1)
            assert ask(driver, "document.documentElement.scrollWidth") <= width
    assert browser.complaints(driver) == []
    assert ask(driver, "document.getElementById('trouble').hidden")
    requests = [json.loads(entry["message"])["message"] for entry in driver.get_log("performance")]
    urls = [r["params"]["request"]["url"] for r in requests if r["method"] == "Network.requestWillBeSent"]
    assert [url for url in urls if not url.startswith(("file:", "data:", "blob:"))] == []
    assert any(url.startswith("file:") for url in urls)  # requests are seen at all


def test_it_plays_to_its_end_and_again(opened):
    driver = opened("2D")
    assert ask(driver, "spume.player.frame") == 0
    first = picture(driver)
    driver.execute_script("document.getElementById('rate').value = '4'")
    driver.find_element("id", "play").click()
    assert ask(driver, "document.getElementById('play').textContent") == "❚❚ Pause"
    until(driver, "spume.player.frame > 3")
    assert picture(driver) != first
    until(driver, "!spume.player.playing")
    assert ask(driver, "[spume.player.frame, document.getElementById('scrub').value]") == [10, "10"]
    assert "frame 11 of 11" in ask(driver, "document.getElementById('clock').textContent")
    driver.find_element("id", "play").click()
    until(driver, "spume.player.frame < 8")
    driver.find_element("id", "play").click()
    assert not ask(driver, "spume.player.playing")


@pytest.mark.parametrize("name", ["2D", "3D"])
def test_a_click_on_a_particle_tells_the_values_of_the_file(opened, runs, name):
    driver = opened(name)
    driver.execute_script("spume.player.seek(6); document.getElementById('view-0').scrollIntoView({block: 'center'})")
    row = ask(
        driver,
        "(() => { const v = spume.player.views[0]; v.options.extreme = false; return v.groups.fluid.rows - 1 })()",
    )
    place = ask(
        driver,
        "(() => { const v = spume.player.views[0], b = v.canvas.getBoundingClientRect(), s = v.groups.fluid.screen;"
        "return [b.left + s[3 * arguments[0]] / v.ratio, b.top + s[3 * arguments[0] + 1] / v.ratio] })()",
        row,
    )
    click(driver, *place)
    until(driver, "document.getElementById('told').textContent.includes('chosen')")
    told = ask(driver, "document.getElementById('told').textContent")
    number, where, pressure, speed = re.search(
        r"chosen: particle (\d+) at \((.*?)\) m, pressure (\S+) Pa, speed (\S+) m/s", told
    ).groups()
    frame = vtkhdf.read(runs[name] / "run.vtkhdf", 6)
    found = int(np.flatnonzero(frame["id"] == int(number))[0])
    np.testing.assert_allclose([float(v) for v in where.split(",")], frame.position[found], atol=0.004)
    assert float(pressure) == pytest.approx(frame["pressure"][found], abs=20.0)
    assert float(speed) == pytest.approx(frame.speed[found], abs=0.006)
    # It stays chosen while time goes on.
    driver.execute_script("spume.player.seek(9)")
    later = vtkhdf.read(runs[name] / "run.vtkhdf", 9)
    told = ask(driver, "document.getElementById('told').textContent")
    assert f"particle {number} at" in told
    assert float(told.split("speed ")[1].split()[0]) == pytest.approx(later.speed[found], abs=0.006)


def test_keys_play_step_zoom_and_turn(opened):
    driver = opened("3D")
    driver.execute_script("document.getElementById('view-0').focus()")

    def press(key):
        for kind in ("keyDown", "keyUp"):
            event = {"type": kind, "key": key, "text": key if len(key) == 1 and kind == "keyDown" else ""}
            driver.execute_cdp_cmd("Input.dispatchKeyEvent", event)

    press(".")
    press(".")
    press(",")
    assert ask(driver, "spume.player.frame") == 1
    seen = [picture(driver)]
    for key in ("+", "ArrowLeft", "ArrowUp", "0"):
        press(key)
        seen.append(picture(driver))
    assert len(set(seen[:4])) == 4
    assert seen[4] == seen[0]
    press(" ")
    assert ask(driver, "spume.player.playing")
    press(" ")
    assert not ask(driver, "spume.player.playing")


def test_dragging_turns_in_3d_and_moves_in_2d(opened):
    for name, expression in (("3D", "spume.player.views[0].azimuth"), ("2D", "spume.player.views[0].middle[0]")):
        driver = opened(name)
        driver.execute_script("document.getElementById('view-0').scrollIntoView({block: 'center'})")
        before = ask(driver, expression)
        x, y = ask(driver, "(() => { const b = spume.player.views[0].canvas.getBoundingClientRect();"
                   "return [b.left + b.width / 2, b.top + b.height / 2] })()")  # fmt: skip
        mouse(driver, "mousePressed", x, y)
        mouse(driver, "mouseMoved", x + 60, y, buttons=1)
        mouse(driver, "mouseReleased", x + 60, y)
        assert ask(driver, expression) < before
        driver.find_element("id", "reset").click()
        assert ask(driver, expression) == pytest.approx(before)


def test_runs_of_a_comparison_are_seen_from_the_same_side(opened):
    driver = opened("3D", "3D")
    driver.execute_script("document.getElementById('view-1').focus()")
    before = ask(driver, "spume.player.views[0].azimuth")
    for kind in ("keyDown", "keyUp"):
        driver.execute_cdp_cmd("Input.dispatchKeyEvent", {"type": kind, "key": "ArrowLeft"})
    first, second = ask(driver, "spume.player.views.map((view) => view.azimuth)")
    assert first == second != before


def test_colours_follow_the_choice(opened):
    driver = opened("2D")
    seen = []
    for name in ("pressure", "speed", "free_surface"):
        driver.execute_script(
            "const c = document.getElementById('colour'); c.value = arguments[0]; c.dispatchEvent(new Event('change'))",
            name,
        )
        seen.append(picture(driver))
        assert ask(driver, "document.getElementById('scale').hidden") == (name == "free_surface")
    assert len(set(seen)) == 3
    driver.execute_script("document.getElementById('walls').click()")
    assert picture(driver) != seen[-1]


def test_it_looks_as_it_should(opened):
    """Water has the colours of its pressure: dark above, bright below; walls are grey, what is empty is paper."""
    driver = opened("2D")
    driver.execute_script(
        "const c = document.getElementById('colour'); c.value = 'pressure'; c.dispatchEvent(new Event('change'))"
    )

    def colour(x, y):
        value = ask(
            driver,
            "(() => { const v = spume.player.views[0], c = v.lastCamera;"
            "const px = Math.round(c.x + (arguments[0] - c.centre[0]) * c.scale);"
            "const py = Math.round(c.y - (arguments[1] - c.centre[1]) * c.scale);"
            "return v.pixels[py * v.canvas.width + px] })()", x, y,
        )  # fmt: skip
        return np.array([value & 255, value >> 8 & 255, value >> 16 & 255])

    bottom, top = colour(0.45, 0.05), colour(0.45, 0.45)
    np.testing.assert_allclose(bottom, [253, 231, 37], atol=12)  # viridis' end
    assert top.sum() < 0.6 * bottom.sum()
    np.testing.assert_array_equal(colour(0.45, 0.8), [255, 255, 255])
    wall = colour(-0.05, 0.25)
    assert np.ptp(wall) < 20
    assert 100 < wall.mean() < 200
