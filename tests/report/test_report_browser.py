"""The replay in a real browser: it plays, pauses, scrubs, toggles, and never logs."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from selenium import webdriver

from report import samples
from sainet.report.figures.paths import draw_error_over_time, draw_paths
from sainet.report.pages.page import Report, write_report

pytestmark = pytest.mark.browser
END = round(1000 * samples.STEPS * samples.TIME_STEP)  # ms
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--window-size=1200,1000",
)


@contextmanager
def opened(chromium, folder, *flags) -> Iterator:
    """Open the report; at the end nothing may have been logged as an error."""
    options = webdriver.ChromeOptions()
    options.binary_location = str(chromium.browser)
    for flag in (*FLAGS, f"--user-data-dir={folder / 'profile'}", *flags):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = webdriver.ChromeService(executable_path=str(chromium.driver))
    driver = webdriver.Chrome(options=options, service=service)
    try:
        driver.get((folder / "report.html").as_uri())
        yield driver
        logged = driver.get_log("browser")
        assert [entry for entry in logged if entry["level"] == "SEVERE"] == []
    finally:
        driver.quit()


@pytest.fixture
def folder(tmp_path):
    paths = draw_paths(samples.replay(), tmp_path / "paths.svg")
    errors = tmp_path / "errors.svg"
    draw_error_over_time(samples.curves(), errors, time_step=samples.TIME_STEP)
    report = Report(
        title="A report",
        table=samples.result(),
        figures=[(errors, "Mean errors."), (paths, "Paths of one push.")],
        replays=[samples.replay()],
        episodes=[
            samples.record(),
            samples.record(pushes=0),
            samples.lost_record(),
        ],
    )
    write_report(report, tmp_path / "report.html")
    return tmp_path


@pytest.fixture
def still(chromium, folder):
    """The report for readers who prefer reduced motion."""
    with opened(chromium, folder, "--force-prefers-reduced-motion") as driver:
        yield driver


def element(driver, name, block="replay-0"):
    return driver.find_element("id", f"{block}-{name}")


def milliseconds(driver):
    return int(element(driver, "time").text.removesuffix(" ms"))


def pixels(driver, name="canvas", block="replay-0"):
    return driver.execute_script(
        "return document.getElementById(arguments[0]).toDataURL()", f"{block}-{name}"
    )


def is_playing(driver):
    return element(driver, "play").get_attribute("aria-pressed") == "true"


def wait_until(condition, seconds=10.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not happen in time"
        time.sleep(0.05)


def scrub_to(driver, step, block="replay-0"):
    driver.execute_script(
        "arguments[0].value = arguments[1];"
        "arguments[0].dispatchEvent(new Event('input', { bubbles: true }));",
        element(driver, "scrub", block),
        step,
    )


def test_playback_respects_reduced_motion(still):
    time.sleep(0.3)
    assert milliseconds(still) == END  # it opens at the end, where there is most to see
    assert not is_playing(still)
    element(still, "play").click()
    wait_until(lambda: 20 < milliseconds(still) < END)
    element(still, "play").click()
    assert not is_playing(still)
    paused = milliseconds(still)
    time.sleep(0.3)
    assert milliseconds(still) == paused


def test_scrubbing_moves_the_disks_and_the_read_out(still):
    scrub_to(still, 0)
    start, lens = pixels(still), pixels(still, "lens-1")
    scrub_to(still, samples.STEPS)
    assert milliseconds(still) == END
    assert pixels(still) != start
    assert pixels(still, "lens-1") != lens
    row = still.find_element("css selector", "#replay-0 [data-model='1']")
    assert row.text.split() == ["Physics", "3.80", "mm", "2.66", "mm"]


def drawn_pixels(driver, name, block="replay-0"):
    """How many pixels of a canvas are not empty."""
    return driver.execute_script(
        "const canvas = arguments[0];"
        "const { width, height } = canvas;"
        "const { data } = canvas.getContext('2d').getImageData(0, 0, width, height);"
        "return data.filter((value, at) => at % 4 === 3 && value > 0).length;",
        element(driver, name, block),
    )


def test_regions_are_drawn_in_the_lenses(still):
    row = still.find_element("css selector", "#replay-0 .region")
    assert row.text.split()[-2:] == ["±0.7°", "±0.5°"]
    scrub_to(still, 0)  # without paths, in which pixels are drawn as well
    shown = drawn_pixels(still, "lens-1")
    number = list(samples.replay().tracks).index("sain")
    element(still, f"show-{number}").click()
    # Its dot lies on those of the other models; all that goes is the ellipse.
    assert shown - drawn_pixels(still, "lens-1") > 200


def test_a_model_can_be_hidden_and_shown_again(still):
    scrub_to(still, 150)
    shown = pixels(still)
    element(still, "show-1").click()
    assert pixels(still) != shown
    element(still, "show-1").click()
    assert pixels(still) == shown


def test_differences_can_be_exaggerated_without_changing_the_errors(still):
    scrub_to(still, 150)
    shown = pixels(still)
    table = still.find_element("css selector", ".readout").text
    still.find_element("css selector", "#replay-0-zoom input[value='20']").click()
    assert pixels(still) != shown
    assert still.find_element("css selector", ".readout").text == table


def test_keys_play_step_and_jump(still):
    canvas = element(still, "canvas")
    canvas.send_keys("\ue012")  # arrow left
    assert milliseconds(still) == END - 4
    canvas.send_keys("\ue010")  # end
    assert milliseconds(still) == END
    canvas.send_keys("\ue011")  # home
    assert milliseconds(still) == 0
    canvas.send_keys(" ")
    wait_until(lambda: milliseconds(still) > 0)
    assert is_playing(still)


def test_playback_restarts_at_the_end(still):
    still.find_element("css selector", "#replay-0-speed input[value='1']").click()
    scrub_to(still, 190)
    element(still, "play").click()
    wait_until(lambda: milliseconds(still) < 700)
    assert is_playing(still)


def test_an_episode_is_shown_push_by_push(still):
    block = "episode-0"
    status = element(still, "status", block)
    at_end = pixels(still, "canvas", block)
    scrub_to(still, 0, block)
    assert status.text == "push 1 of 3: disk 2 is 150.0 mm from its goal"
    scene, chart = (pixels(still, name, block) for name in ("canvas", "chart"))
    scrub_to(still, 5, block)
    assert status.text == "push 2 of 3: disk 2 is 140.0 mm from its goal"
    assert pixels(still, "canvas", block) != scene
    assert pixels(still, "chart", block) != chart
    scrub_to(still, 11, block)
    assert status.text == "solved with 3 pushes: disk 2 is 2.3 mm from its goal"
    assert pixels(still, "canvas", block) == at_end  # it opens with the success
    assert milliseconds(still) == END  # the other player is left alone


def test_an_episode_plays_to_its_end(still):
    status = element(still, "status", "episode-0")
    scrub_to(still, 0, "episode-0")
    assert not status.text.startswith("solved")
    element(still, "play", "episode-0").click()
    wait_until(lambda: status.text.startswith("solved"))
    scrub_to(still, 0, "episode-1")
    ended = element(still, "status", "episode-1").text
    assert ended == "solved with 0 pushes: disk 2 is 2.3 mm from its goal"
    scrub_to(still, 11, "episode-2")
    lost = element(still, "status", "episode-2").text
    assert lost == "the simulated world left after 3 pushes: disk 2 is nowhere"


PHONE = {"width": 390, "height": 800, "deviceScaleFactor": 2, "mobile": True}


def corners(driver, selector):
    """The left and top corner of each element, from left to right and top to bottom."""
    return driver.execute_script(
        "return [...document.querySelectorAll(arguments[0])]"
        ".map((each) => each.getBoundingClientRect())"
        ".map(({ left, top }) => [Math.round(left), Math.round(top)]);",
        selector,
    )


def test_nothing_is_wider_than_a_phone(still):
    still.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", PHONE)
    wide = still.execute_script("return document.documentElement.scrollWidth")
    assert wide == 390
    # The table of errors alone scrolls, beside the names of its rows.
    outside = still.execute_script(
        "const ends = (each) => each.getBoundingClientRect();"
        "return [...document.querySelectorAll('body *:not(table.errors, .errors *)')]"
        ".filter((each) => ends(each).right > innerWidth || ends(each).left < 0)"
        ".map((each) => each.outerHTML.slice(0, 200));"
    )
    assert outside == []


@pytest.mark.parametrize(
    ("selector", "count"),
    [("#figure-1 svg", 2), ("#figure-2 svg", 3), ("[data-episode]", 3)],
)
def test_panels_and_players_are_abreast_but_below_each_other_on_a_phone(
    selector, count, still
):
    wide = corners(still, selector)
    assert len(wide) == count
    assert wide[0][0] < wide[1][0] and wide[0][1] == wide[1][1]
    still.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", PHONE)
    tops = [top for _, top in corners(still, selector)]
    assert sorted(set(tops)) == tops


def test_playback_starts_when_visible(chromium, folder):
    with opened(chromium, folder) as driver:
        driver.execute_script("arguments[0].scrollIntoView()", element(driver, "play"))
        driver.execute_script(
            "arguments[0].scrollIntoView({ block: 'center' })",
            element(driver, "canvas"),
        )
        wait_until(lambda: milliseconds(driver) > 20)
