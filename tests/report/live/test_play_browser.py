"""The live page in headless Chromium: drag, predict, push, plan, reload."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from selenium import webdriver
from selenium.webdriver import ActionChains, Keys

from report.live.running import running
from report.test_report_browser import FLAGS, wait_until
from sainet.report.live.config import PlayConfig

pytestmark = pytest.mark.browser


@contextmanager
def opened(chromium, folder, **settings) -> Iterator[webdriver.Chrome]:
    """The page in a browser; at the end nothing may have been logged as an error."""
    options = webdriver.ChromeOptions()
    options.binary_location = str(chromium.browser)
    flags = (f"--user-data-dir={folder / 'profile'}", "--force-prefers-reduced-motion")
    for flag in (*FLAGS, *flags):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = webdriver.ChromeService(executable_path=str(chromium.driver))
    config = PlayConfig(port=0, noise_level="none", out=folder / "play", **settings)
    with running(config) as server:
        driver = webdriver.Chrome(options=options, service=service)
        try:
            driver.get(server.address)
            wait_until(lambda: is_ready(driver), 120)
            yield driver
            logged = driver.get_log("browser")
            assert [entry for entry in logged if entry["level"] == "SEVERE"] == []
        finally:
            driver.quit()


@pytest.fixture
def page(chromium, tmp_path):
    with opened(chromium, tmp_path) as driver:
        yield driver


def is_ready(page):
    body = page.find_element("tag name", "body")
    return body.get_attribute("data-ready") == "true"


def text(page, name):
    return page.find_element("id", name).text


def place(page, name):
    return page.find_element("id", name).get_attribute("transform")


def ghosts(page):
    """Places of the visible ghosts, by their ids."""
    return {
        each.get_attribute("id"): each.get_attribute("transform")
        for each in page.find_elements("class name", "ghost")
        if each.get_attribute("visibility") == "visible"
    }


def point_beside_disk_1(page, x, y):
    disk = page.find_element("id", "disk-1")
    ActionChains(page, 50).move_to_element_with_offset(disk, x, y).perform()


def pointing_at_disk_1_shows_every_prediction(page):
    point_beside_disk_1(page, -80, 10)
    wait_until(lambda: len(ghosts(page)) == 6)
    before, row = ghosts(page), text(page, "row-sain")
    assert set(before) == {
        f"ghost-{m}-{n}" for m in ("physics", "in", "sain") for n in (1, 2)
    }
    assert row.count("mm") == 2
    assert text(page, "row-physics").count("–") == 2
    point_beside_disk_1(page, -60, -60)
    wait_until(lambda: ghosts(page) != before and text(page, "row-sain") != row)


def a_dragged_disk_stays_and_touches(page):
    before = ghosts(page)
    disk = page.find_element("id", "disk-2")
    ActionChains(page, 50).drag_and_drop_by_offset(disk, -60, -90).perform()
    wait_until(lambda: "Ready" in text(page, "status") and ghosts(page) != before)
    label = disk.get_attribute("aria-label")
    assert "y " in label and "y 0 mm" not in label
    gap = page.execute_script(
        "const [a, b] = ['disk-1', 'disk-2'].map((id) => {"
        "  const moves = document.getElementById(id).transform.baseVal;"
        "  return [moves.getItem(0).matrix.e, moves.getItem(0).matrix.f]; });"
        "return Math.hypot(a[0] - b[0], a[1] - b[1]);"
    )
    assert gap == pytest.approx(113, abs=0.1)  # mm, the sum of both radii
    assert not page.find_element("id", "notice").is_displayed()


def a_click_pushes_and_shows_errors(page):
    point_beside_disk_1(page, -90, 30)
    wait_until(lambda: page.find_element("id", "push").is_enabled())
    before = place(page, "disk-1")
    ActionChains(page, 50).click().perform()
    wait_until(lambda: text(page, "outcome").startswith("After 1 push,"))
    assert place(page, "disk-1") != before
    assert text(page, "readout-title").startswith("Errors")
    assert text(page, "row-physics").count("mm") == 2
    shown, zoom = ghosts(page), "#zoom input[value='20']"
    page.find_element("css selector", zoom).click()
    assert ghosts(page) != shown


def keys_move_the_goal_and_the_planner_reaches_it(page):
    goal = page.find_element("id", "goal")
    before = goal.get_attribute("transform")
    goal.send_keys(Keys.ARROW_LEFT)
    wait_until(lambda: text(page, "outcome").startswith("After 0 pushes"))
    assert goal.get_attribute("transform") != before
    page.find_element("id", "continue").click()
    wait_until(lambda: "is at its goal" in text(page, "outcome"), 60)
    assert page.find_element("id", "continue").text == "Continue to the goal"
    page.find_element("id", "save").click()
    wait_until(lambda: "Saved 2 episodes" in text(page, "notice"))


def a_reload_shows_the_same_world(page):
    wanted = {name: place(page, name) for name in ("disk-1", "disk-2", "goal")}
    outcome = text(page, "outcome")
    page.refresh()
    wait_until(lambda: is_ready(page) and text(page, "outcome") == outcome)
    assert {name: place(page, name) for name in wanted} == wanted


def a_refusal_is_shown_and_can_be_closed(page):
    page.execute_script(
        "document.querySelector('input[name=model]').value = 'nonsense';"
        "document.querySelector('input[name=model]').click();"
    )
    wait_until(lambda: "No model of this page" in text(page, "notice"))
    page.find_element("id", "close-notice").click()
    assert not page.find_element("id", "notice").is_displayed()
    assert is_ready(page)


def a_moved_slider_leaves_the_other_values_alone(page):
    sent = page.execute_async_script(
        "const [view, done] = arguments;"
        "import('/panel.js').then(({ Sliders }) => {"
        "  new Sliders(done).show(view);"
        "  const input = document.getElementById('mass-1');"
        "  input.value = 1.2;"
        "  input.dispatchEvent(new Event('input'));"
        "  input.dispatchEvent(new Event('change')); });",
        {
            "disks": [{"mass_kg": 0.987, "radius_mm": 52.34}],
            "table_friction": 0.1234,
            "has_own_properties": True,
        },
    )
    others = {"radius_mm": [52.34], "table_friction": 0.1234}
    assert sent == {"mass_kg": [1.2], **others}


def nothing_is_wider_than_a_phone(page):
    size = {"width": 390, "height": 800, "deviceScaleFactor": 2, "mobile": True}
    page.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    wide = page.execute_script("return document.documentElement.scrollWidth")
    assert wide == 390


def test_drag_predict_push_plan_and_reload(page):
    # One test, because the browser and the compiled models serve all steps.
    pointing_at_disk_1_shows_every_prediction(page)
    a_dragged_disk_stays_and_touches(page)
    a_click_pushes_and_shows_errors(page)
    keys_move_the_goal_and_the_planner_reaches_it(page)
    a_reload_shows_the_same_world(page)
    a_refusal_is_shown_and_can_be_closed(page)
    nothing_is_wider_than_a_phone(page)
    a_moved_slider_leaves_the_other_values_alone(page)
