"""The server of the page: static files and one websocket, on one port."""

import asyncio
import errno
import logging
import signal
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from importlib.util import find_spec
from typing import TYPE_CHECKING, TypeVar

import msgspec

from sainet.report.live.config import PlayConfig
from sainet.report.live.inbox import Allowance, Inbox, Letter
from sainet.report.live.messages import (
    LARGEST_MESSAGE,
    Aim,
    BadMessage,
    Notice,
    Status,
    read_message,
)
from sainet.report.live.page import SOCKET, Asset, assets
from sainet.runs.errors import BadSetting, SainetError, missing_extra

if TYPE_CHECKING:
    from websockets.asyncio.server import Server, ServerConnection
    from websockets.http11 import Request, Response

    from sainet.report.live.session import Answer, Session

_MOST_CONNECTIONS = 16
_FORBIDDEN, _MISSING, _BUSY = 403, 404, 503
_REASONS = {200: "OK", 403: "Forbidden", 404: "Not Found", 503: "Service Unavailable"}
T = TypeVar("T")
_log = logging.getLogger("sainet.report.live")


def serve(config: PlayConfig, *, on_listening: Callable[[str], None]) -> None:
    """Serve the page until the process is interrupted or terminated.

    Args:
        config: address, models and world.
        on_listening: called with the address of the page.

    Raises:
        MissingExtra: the package websockets is not installed.
        BadSetting: the port is taken, or the host is not an address of this machine.
        BadInput: a model or the world cannot be used.
    """
    if find_spec("websockets") is None:
        raise missing_extra("The live page needs the package websockets", "live")
    from sainet.models.library import PHYSICS, network_folder

    for name in config.model:
        if name not in PHYSICS:
            network_folder(name)  # an unknown one ends this before it listens
    asyncio.run(LivePage(config).run(on_listening))


class LivePage:
    """The page, its connections, and the session that they share."""

    def __init__(self, config: PlayConfig) -> None:
        """Prepare the page; `run` opens the port."""
        self._config = config
        self._files = assets(config)
        self._hosts: frozenset[str] = frozenset()
        self._connections: set[ServerConnection] = set()
        self._aims: Inbox[ServerConnection] = Inbox()
        self._actions: Inbox[ServerConnection] = Inbox()
        self._status = Status("Loading models …", is_ready=False, can_predict=False)
        self._session: Session | None = None
        # Predictions do not wait for pushes, nor either of them for compilation.
        self._threads = ThreadPoolExecutor(3, thread_name_prefix="play")

    async def run(self, on_listening: Callable[[str], None]) -> None:
        """Serve until interrupted; see `serve`."""
        stop = asyncio.Event()
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            with suppress(NotImplementedError, ValueError, RuntimeError):
                loop.add_signal_handler(number, stop.set)
        server = await self._listen()
        host, port = server.sockets[0].getsockname()[:2]
        self._hosts = self._config.hosts(port)
        on_listening(f"http://{f'[{host}]' if ':' in host else host}:{port}/")
        work = asyncio.create_task(self._work())
        end = asyncio.create_task(stop.wait())
        try:
            await asyncio.wait((work, end), return_when=asyncio.FIRST_COMPLETED)
            if work.done():
                work.result()
        finally:
            work.cancel()
            self._threads.shutdown(wait=False, cancel_futures=True)
            server.close()

    async def _listen(self) -> "Server":
        from websockets.asyncio.server import serve

        logger = logging.getLogger("sainet.report.live.websockets")
        logger.setLevel(logging.CRITICAL)  # broken connections are no news
        config = self._config
        try:
            return await serve(
                self._converse,
                config.host,
                config.port,
                process_request=self._admit,
                max_size=LARGEST_MESSAGE,
                logger=logger,
                compression=None,
            )
        except OSError as error:
            if error.errno in (errno.EADDRINUSE, errno.EACCES):
                wanted = "a port that this user may open and no other program uses"
                raise BadSetting("port", config.port, wanted) from None
            wanted = "an address of this machine"
            raise BadSetting("host", config.host, wanted) from None

    async def _work(self) -> None:
        """Load the session, then answer messages while the rest is compiled."""
        loop = asyncio.get_running_loop()

        def on_status(status: Status) -> None:
            loop.call_soon_threadsafe(self._show, status)

        session = await self._in_thread(_loaded, self._config, on_status)
        self._session = session
        self._send(self._connections, [session.view])
        await asyncio.gather(
            self._in_thread(session.compile),
            self._answer(self._aims, session),
            self._answer(self._actions, session),
        )

    async def _in_thread(self, work: Callable[..., T], *arguments: object) -> T:
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(self._threads, work, *arguments)

    async def _answer(
        self, inbox: "Inbox[ServerConnection]", session: "Session"
    ) -> None:
        """Answer messages one by one; an error is shown on the page that sent one."""
        while True:
            letter = await inbox.next()
            try:
                answers = await self._in_thread(session.act, letter.message)
            except SainetError as error:
                self._send([letter.sender], [Notice(str(error)), session.view])
            except Exception as error:
                _log.exception("A message could not be answered: %s", letter.message)
                text = f"The server failed ({type(error).__name__}); see its terminal."
                self._send([letter.sender], [Notice(text), session.view])
            else:
                is_private = isinstance(letter.message, Aim)
                to = [letter.sender] if is_private else self._connections
                self._send(to, answers)

    async def _converse(self, connection: "ServerConnection") -> None:
        """Take the messages of one page until it closes."""
        self._connections.add(connection)
        self._send([connection], [self._status])
        if self._session is not None:
            self._send([connection], [self._session.view])
        allowance = Allowance()
        try:
            async for text in connection:
                if allowance.take():
                    self._receive(connection, text)
                elif allowance.is_news:
                    self._send([connection], [_TOO_MANY])
        finally:
            self._connections.discard(connection)

    def _receive(self, connection: "ServerConnection", text: str | bytes) -> None:
        try:
            message = read_message(text)
        except BadMessage as error:
            self._send([connection], [Notice(str(error))])
            return
        inbox = self._aims if isinstance(message, Aim) else self._actions
        if not inbox.put(Letter(connection, message)):
            self._send([connection], [_TOO_MANY])

    def _show(self, status: Status) -> None:
        self._status = status
        self._send(self._connections, [status])

    @staticmethod
    def _send(
        to: "Iterable[ServerConnection]", answers: "Iterable[Answer | Status]"
    ) -> None:
        from websockets.asyncio.server import broadcast

        for answer in answers:
            broadcast(to, msgspec.json.encode(answer).decode())

    def _admit(
        self, connection: "ServerConnection", request: "Request"
    ) -> "Response | None":
        """Return a file, a refusal, or None: the request opens the websocket."""
        del connection
        hosts = request.headers.get_all("Host")
        if len(hosts) != 1 or hosts[0] not in self._hosts:
            return _refusal(_FORBIDDEN, "Open this page by its own address.")
        if request.path != SOCKET:
            asset = self._files.get(request.path.partition("?")[0])
            missing = _refusal(_MISSING, "No such page.")
            return _response(200, asset) if asset else missing
        if request.headers.get_all("Origin") != [f"http://{hosts[0]}"]:
            return _refusal(_FORBIDDEN, "Another page may not connect.")
        if len(self._connections) >= _MOST_CONNECTIONS:
            return _refusal(_BUSY, "Too many pages are open.")
        return None


_TOO_MANY = Notice("Too many messages at once; some were dropped.")


def _refusal(status: int, reason: str) -> "Response":
    return _response(status, Asset("text/plain", f"{reason}\n".encode()))


def _response(status: int, asset: Asset) -> "Response":
    from websockets.datastructures import Headers
    from websockets.http11 import Response

    headers = Headers(asset.headers.items())
    return Response(status, _REASONS[status], headers, asset.body)


def _loaded(config: PlayConfig, on_status: Callable[[Status], None]) -> "Session":
    """Return the session: its imports take seconds, while the page opens."""
    from sainet.report.live.session import Session

    return Session(config, on_status)
