import socket

import pytest

from sainet.robots.wire.limits import Stopped
from sainet.robots.wire.transport import LOOPBACK, UdpTransport
from sainet.runs.errors import BadInput


@pytest.fixture
def transport():
    made = UdpTransport(controller=LOOPBACK, port=0)
    yield made
    made.close()


def sender(host: str = LOOPBACK) -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.bind((host, 0))
    made.settimeout(1.0)
    return made


def test_it_answers_the_sender(transport: UdpTransport):
    with sender() as controller:
        controller.sendto(b"feedback", (LOOPBACK, transport.port))
        assert transport.receive(1.0) == b"feedback"
        transport.send(b"command")
        assert controller.recvfrom(100) == (b"command", (LOOPBACK, transport.port))
    assert transport.receive(0.0) is None


def test_nothing_is_sent_before_something_was_received(transport: UdpTransport):
    with pytest.raises(Stopped, match="no feedback to answer"):
        transport.send(b"command")


@pytest.mark.parametrize("host", [LOOPBACK, "127.0.0.2"])
def test_another_sender_is_reported_and_not_answered(
    transport: UdpTransport, host: str
):
    with sender() as controller, sender(host) as stranger:
        controller.sendto(b"1", (LOOPBACK, transport.port))
        assert transport.receive(1.0) == b"1"
        stranger.sendto(b"2", (LOOPBACK, transport.port))
        with pytest.raises(Stopped, match=f"another sender, {host}:"):
            transport.receive(1.0)
        transport.send(b"command")
        assert controller.recv(100) == b"command"


def test_another_host_is_reported_although_it_is_first(transport: UdpTransport):
    with sender("127.0.0.2") as stranger:
        stranger.sendto(b"1", (LOOPBACK, transport.port))
        with pytest.raises(Stopped, match="another sender, 127.0.0.2"):
            transport.receive(1.0)


def test_what_was_received_can_be_dropped(transport: UdpTransport):
    with sender() as first, sender() as second:
        for _ in range(5):
            first.sendto(b"old", (LOOPBACK, transport.port))
        assert transport.receive(1.0) == b"old"
        transport.discard()
        second.sendto(b"new", (LOOPBACK, transport.port))
        assert transport.receive(1.0) == b"new"


def test_a_port_in_use_is_one_line(transport: UdpTransport):
    with pytest.raises(BadInput, match=f"another process listens .* {transport.port}"):
        UdpTransport(controller=LOOPBACK, port=transport.port)


@pytest.mark.parametrize(
    ("settings", "why"),
    [
        ({"controller": "robot.example"}, "`controller` is robot.example"),
        ({"controller": "::1"}, "`controller` is ::1"),
        ({"host": "localhost"}, "`host` is localhost"),
        ({"host": "192.0.2.1"}, "cannot be listened on"),
        ({"port": 70_000}, "`port` is 70000"),
    ],
)
def test_bad_addresses(settings: dict[str, object], why: str):
    with pytest.raises(BadInput, match=why):
        UdpTransport(**({"controller": LOOPBACK, "port": 0} | settings))
