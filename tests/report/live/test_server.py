"""The server: whom it answers, what it refuses, and that it goes on."""

import http.client
import json
import time

import pytest
from websockets.exceptions import ConnectionClosedError, InvalidStatus
from websockets.sync.client import connect

from report.live.running import running
from sainet.cli.entry import run
from sainet.report.live.config import PlayConfig


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    out = tmp_path_factory.mktemp("live") / "play"
    config = PlayConfig(model=("physics",), noise_level="none", port=0, out=out)
    with running(config) as page:
        yield page


class Browser:
    """The websocket of a page, and what it has received."""

    def __init__(self, page):
        self.socket = connect(
            f"ws://{page.host}/live", origin=f"http://{page.host}", proxy=None
        )

    def send(self, message):
        self.socket.send(message if isinstance(message, str) else json.dumps(message))

    def await_(self, kind, condition=lambda answer: True):
        end = time.monotonic() + 60
        while time.monotonic() < end:
            answer = json.loads(self.socket.recv(timeout=60))
            if answer["type"] == kind and condition(answer):
                return answer
        raise AssertionError(f"no {kind}")


@pytest.fixture
def browser(page):
    browser = Browser(page)
    with browser.socket:
        yield browser


def get(page, path="/", **headers):
    connection = http.client.HTTPConnection("127.0.0.1", page.port, timeout=20)
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    connection.request("GET", path, headers=named)
    answer = connection.getresponse()
    return answer.status, answer.headers, answer.read().decode()


def test_the_page_needs_nothing_from_elsewhere(page):
    for path in ("/", "/play.css", "/play.js", "/table.js", "/geometry.js"):
        status, headers, text = get(page, path)
        assert status == 200
        assert "default-src 'none'" in headers["Content-Security-Policy"]
        found = text.replace("http://www.w3.org/2000/svg", "")
        assert not {"http://", "https://", "@import"} & set(found.split('"'))
        assert "https:" not in found
    assert get(page, "/../../etc/passwd")[0] == 404
    assert get(page, "/play.html.j2")[0] == 404


def test_an_address_with_colons_is_in_brackets_as_browsers_name_it():
    hosts = PlayConfig(host="2001:db8::5", name=("robot:80",)).hosts(8642)
    assert {"[2001:db8::5]", "[2001:db8::5]:8642", "robot:80"} <= hosts


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "localhost.evil"])
def test_other_host_names_are_refused(page, host):
    assert get(page, Host=host)[0] == 403
    assert get(page, "/live", Host=host, Origin=f"http://{host}")[0] == 403


@pytest.mark.parametrize(
    "origin",
    [None, "http://evil.example", "null", "https://{host}", "http://{host}.evil"],
)
def test_connections_of_other_origins_are_refused(page, origin):
    named = origin and origin.format(host=page.host)
    with pytest.raises(InvalidStatus) as refused:
        connect(f"ws://{page.host}/live", origin=named, proxy=None)
    assert refused.value.response.status_code == 403


def test_a_push_is_predicted_and_executed(browser):
    browser.await_("status", lambda status: status["is_ready"])
    browser.send({"type": "restart"})
    view = browser.await_("view")
    aim = {"contact_angle_deg": 10.0, "direction_deg": 0.0}
    browser.send({"type": "aim", "number": 5, **aim})
    ghosts = browser.await_("ghosts")
    assert ghosts["number"] == 5
    browser.send({"type": "push", **aim})
    moved = browser.await_("moved")
    start, end = (each["disks"][0]["pose"][0] for each in (view, moved["view"]))
    assert 5 < end - start < 11  # mm of a push of 10 mm
    assert moved["view"]["pushes"] == 1


def test_another_page_shows_the_same_world(page, browser):
    browser.await_("view")
    with (other := Browser(page)).socket:
        other.send({"type": "goal", "x_mm": 123.0, "y_mm": 45.0})
        is_new = lambda view: view["goal_mm"] == [123.0, 45.0]  # noqa: E731
        assert browser.await_("view", is_new) == other.await_("view", is_new)


MALFORMED = {
    "no JSON": "push!",
    "unknown": '{"type": "rm"}',
    "NaN": '{"type": "goal", "x_mm": NaN, "y_mm": 0}',
    "no disk": '{"type": "disk", "disk": 3, "x_mm": 0, "y_mm": 0}',
    "overlap": '{"type": "disk", "disk": 2, "x_mm": 1, "y_mm": 0}',
    "off the table": '{"type": "goal", "x_mm": 5000, "y_mm": 0}',
}


@pytest.mark.parametrize("text", MALFORMED.values(), ids=MALFORMED)
def test_malformed_messages_are_answered_and_the_session_goes_on(browser, text):
    browser.send(text)
    assert browser.await_("notice")["is_error"]
    browser.send({"type": "goal", "x_mm": 200.0, "y_mm": 50.0})
    assert browser.await_("view", lambda view: view["goal_mm"] == [200.0, 50.0])


def test_a_long_message_ends_its_connection_only(page, browser):
    browser.await_("view")
    with (other := Browser(page)).socket:
        other.send("[" + "1," * 5000 + "1]")
        with pytest.raises(ConnectionClosedError) as closed:
            other.await_("never")
    assert closed.value.rcvd.code == 1009
    browser.send({"type": "goal", "x_mm": 201.0, "y_mm": 50.0})
    assert browser.await_("view", lambda view: view["goal_mm"] == [201.0, 50.0])


def test_a_flood_is_cut_and_the_session_goes_on(browser, monkeypatch):
    browser.await_("view")
    for name in ("_PER_SECOND", "_BURST"):
        monkeypatch.setattr(f"sainet.report.live.inbox.{name}", 20.0)
    for _ in range(60):
        browser.send({"type": "goal", "x_mm": 150.0, "y_mm": 50.0})
    assert "dropped" in browser.await_("notice")["text"]
    time.sleep(0.1)  # the allowance grows again
    browser.send({"type": "goal", "x_mm": 202.0, "y_mm": 50.0})
    assert browser.await_("view", lambda view: view["goal_mm"] == [202.0, 50.0])


def test_a_second_server_on_the_port_ends_with_one_line(page, capsys):
    assert run(["play", "--port", str(page.port)]) == 2
    found = capsys.readouterr()
    assert found.err.count("\n") == 1
    assert f"--port is {page.port}" in found.err


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--host", "192.0.2.1"], "--host"),
        (["--model", "nonsense", "--port", "0"], "No model named 'nonsense'"),
    ],
)
def test_what_cannot_be_served_ends_with_one_line(words, reason, capsys):
    assert run(["play", *words]) == 2
    found = capsys.readouterr()
    assert "Open http" not in found.out + found.err  # nothing listened
    assert reason in found.err
    assert found.err.count("\n") == 1
