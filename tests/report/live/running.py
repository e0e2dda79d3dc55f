"""A live page that runs in a thread of the tests."""

import asyncio
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field

from sainet.report.live.config import PlayConfig
from sainet.report.live.server import LivePage


@dataclass
class Running:
    """A page on a free port."""

    config: PlayConfig
    address: str = ""
    _listens: threading.Event = field(default_factory=threading.Event)

    def serve(self) -> None:
        """Serve until `stop`."""
        with suppress(asyncio.CancelledError):
            asyncio.run(LivePage(self.config).run(self._on_listening))

    def stop(self) -> None:
        """End the server."""
        self._loop.call_soon_threadsafe(self._task.cancel)

    def wait(self) -> None:
        """Wait until the port is open."""
        assert self._listens.wait(20)

    def _on_listening(self, address: str) -> None:
        self.address = address
        self._loop, self._task = asyncio.get_running_loop(), asyncio.current_task()
        self._listens.set()

    @property
    def host(self) -> str:
        """Host and port."""
        return self.address.removeprefix("http://").rstrip("/")

    @property
    def port(self) -> int:
        """The port."""
        return int(self.host.rpartition(":")[2])


@contextmanager
def running(config: PlayConfig) -> Iterator[Running]:
    """Serve a page; at the end its thread has ended."""
    page = Running(config)
    thread = threading.Thread(target=page.serve)
    thread.start()
    page.wait()
    try:
        yield page
    finally:
        page.stop()
        thread.join(30)
    assert not thread.is_alive()
