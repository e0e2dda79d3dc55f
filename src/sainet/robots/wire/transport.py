"""Transports: how datagrams travel between a controller and this program."""

import errno
import socket
from abc import ABC, abstractmethod
from contextlib import suppress
from ipaddress import IPv4Address
from typing import final

from sainet.robots.wire.limits import Stopped
from sainet.runs.errors import BadInput, BadSetting
from sainet.scenes.quantities import require_count

LOOPBACK = "127.0.0.1"
LARGEST_PORT = 65_535
_LARGEST_DATAGRAM = 4096  # bytes; messages of controllers have a few hundred
_MOST_QUEUED = 10_000  # datagrams that are dropped at once


class AbstractTransport(ABC):
    """Datagrams from one sender, and answers to it."""

    @abstractmethod
    def receive(self, timeout: float) -> bytes | None:
        """Return the next datagram, or None after a time (s) without one.

        Raises:
            Stopped: another sender sent one, or the connection failed.
        """

    @abstractmethod
    def send(self, data: bytes) -> None:
        """Send a datagram to the sender of the last one.

        Raises:
            Stopped: nothing was received yet, or the connection failed.
        """

    @abstractmethod
    def discard(self) -> None:
        """Drop what has been received; the next datagram may have another port."""

    @abstractmethod
    def close(self) -> None:
        """Stop listening."""


@final
class UdpTransport(AbstractTransport):
    """UDP: listens on one address, and to one host alone."""

    def __init__(self, *, controller: str, port: int, host: str = LOOPBACK) -> None:
        """Listen.

        Args:
            controller: IPv4 address from which the controller sends.
            port: to listen on; the controller is configured with it.
            host: IPv4 address of this machine to listen on.

        Raises:
            BadInput: an address is none, or the port is in use.
        """
        for name, address in (("controller", controller), ("host", host)):
            _check_address(name, address)
        require_count("port", port, low=0, high=LARGEST_PORT)
        self._controller = controller
        self._peer: tuple[str, int] | None = None
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
        except OSError as cause:
            self._socket.close()
            raise _bind_error(host, port, cause) from None

    @property
    def port(self) -> int:
        """The port that is listened on."""
        return self._socket.getsockname()[1]

    def receive(self, timeout: float) -> bytes | None:
        """Return the next datagram, or None after a time (s) without one."""
        self._socket.settimeout(max(timeout, 0.0))
        try:
            data, sender = self._socket.recvfrom(_LARGEST_DATAGRAM)
        except (TimeoutError, BlockingIOError):
            return None
        except OSError as cause:
            raise Stopped(f"the connection failed: {cause.strerror}") from cause
        if sender[0] != self._controller or self._peer not in (None, sender):
            raise Stopped(f"feedback from another sender, {sender[0]}:{sender[1]}")
        self._peer = sender
        return data

    def send(self, data: bytes) -> None:
        """Send a datagram to the sender of the last one."""
        if self._peer is None:
            raise Stopped("there is no feedback to answer")
        try:
            self._socket.sendto(data, self._peer)
        except OSError as cause:
            raise Stopped(f"the answer was not sent: {cause.strerror}") from cause

    def discard(self) -> None:
        """Drop what has been received; the next datagram may have another port."""
        self._peer = None
        self._socket.settimeout(0.0)
        with suppress(OSError):
            for _ in range(_MOST_QUEUED):
                self._socket.recv(_LARGEST_DATAGRAM)

    def close(self) -> None:
        """Stop listening."""
        self._socket.close()


def _check_address(name: str, address: str) -> None:
    try:
        IPv4Address(address)
    except ValueError:
        wanted = "an IPv4 address, for example 127.0.0.1"
        raise BadSetting(name, address, wanted) from None


def _bind_error(host: str, port: int, cause: OSError) -> BadInput:
    if cause.errno == errno.EADDRINUSE:
        return BadInput(
            f"another process listens on UDP port {port} of {host}; end it, or choose "
            "another port here and in the controller."
        )
    reason = f"UDP port {port} of {host} cannot be listened on ({cause.strerror})"
    return BadInput(f"{reason}; give an address of this machine and a free port.")
