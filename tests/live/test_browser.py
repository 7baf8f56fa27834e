"""The page in a browser, where one is installed: a track appears, is pointed at, scrolled back to, and fits a phone."""

import json
import os
import shutil
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from faintrack.live.lines import event_of
from faintrack.live.page.feed import greeting, scan_message
from faintrack.live.page.guard import guard_of
from faintrack.live.page.server import Page
from faintrack.live.watch import Watch
from tests.live.streams import pieces, samples, scenario, stream

pytest.importorskip("tornado")
driver = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

BROWSERS = "chromium", "chromium-browser", "google-chrome"
FOUND = os.environ.get("FAINTRACK_CHROMIUM") or next(filter(None, map(shutil.which, BROWSERS)), None)
MOST_MS = 10_000

pytestmark = pytest.mark.skipif(FOUND is None, reason="no Chromium is installed, nor named by FAINTRACK_CHROMIUM")


@pytest.fixture(scope="module")
def opened() -> Iterator[tuple[Page, Any, list[str]]]:
    """The page of a watch that has ended, in a browser, and what was wrong."""
    watch = Watch(stream(pieces(samples())), scenario())
    moments = list(watch.moments())
    wrong: list[str] = []
    with Page(0, guard_of("127.0.0.1")) as page, driver.sync_playwright() as play:
        page.greet(greeting(watch, moments[0]))
        for moment in moments:
            page.send(scan_message(watch, moment, event_of(moment)))
        browser = play.chromium.launch(executable_path=FOUND, args=["--no-sandbox"])
        tab = browser.new_page(viewport={"width": 1300, "height": 900})
        tab.set_default_timeout(MOST_MS)
        tab.on("console", lambda said: wrong.append(said.text) if said.type == "error" else None)
        tab.on("pageerror", lambda error: wrong.append(str(error)))
        tab.on("request", lambda asked: None if asked.url.startswith(page.url) else wrong.append(asked.url))
        tab.goto(page.url)
        tab.wait_for_selector("#tracks tr")
        yield page, tab, wrong
        browser.close()


def until(tab: Any, selector: str, fits: Callable[[str], bool]) -> None:
    """Wait for a text; the page's policy lets no test run code in it again and again."""
    for _ in range(MOST_MS // 50):
        if fits(tab.inner_text(selector)):
            return
        tab.wait_for_timeout(50)
    raise AssertionError(tab.inner_text(selector))


def test_a_track_is_in_the_table_and_nothing_is_wrong(opened: tuple[Page, Any, list[str]]) -> None:
    _, tab, wrong = opened
    assert "in hand" in tab.inner_text("#caption")
    cells = tab.locator("#tracks tr").first.locator("td").all_inner_texts()
    assert cells[0].strip() == "1"
    assert any("°" in cell for cell in cells)
    assert "track 1 at" in tab.get_attribute("#record", "aria-label")
    assert wrong == []


def test_what_is_pointed_at_is_told(opened: tuple[Page, Any, list[str]]) -> None:
    _, tab, _ = opened
    box = tab.locator("#record").bounding_box()
    tab.mouse.move(box["x"] + box["width"] / 2, box["y"] + 6)
    until(tab, "#hover", lambda text: "dB" in text)


def test_it_is_scrolled_back_and_pauses(opened: tuple[Page, Any, list[str]]) -> None:
    _, tab, _ = opened
    now = tab.inner_text("#clock")
    tab.focus("#record")
    for _ in range(3):
        tab.keyboard.press("ArrowDown")
    until(tab, "#clock", lambda text: text != now)
    assert tab.get_attribute("#pause", "aria-pressed") == "true"
    tab.keyboard.press("Home")
    until(tab, "#clock", lambda text: text == now)


def test_an_alarm_is_acknowledged(opened: tuple[Page, Any, list[str]]) -> None:
    page, tab, wrong = opened
    alarm = {"event": "alarm", "name": "<b>south</b>", "time": 5.0, "label": 1, "bearing_deg": 60.0}
    page.send(json.dumps(alarm))
    tab.wait_for_selector("#alarms p")
    assert "<b>south</b>: track 1" in tab.inner_text("#alarms"), "it is text, not markup"
    tab.click("#alarms p button")
    tab.wait_for_selector("#alarms p", state="detached")
    assert wrong == []


@pytest.mark.parametrize("width", [390, 1300])
def test_it_fits_the_window(opened: tuple[Page, Any, list[str]], width: int) -> None:
    _, tab, wrong = opened
    tab.set_viewport_size({"width": width, "height": 844})
    tab.wait_for_timeout(200)
    assert tab.evaluate("document.documentElement.scrollWidth") <= width
    assert wrong == []
