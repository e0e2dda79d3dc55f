"""The emulated controller as a process of its own, over UDP in real time."""

import heapq
import multiprocessing
import os
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import NamedTuple, Self

import numpy as np

from robots.wire.emulated_controller import Answer, EmulatedController, Fault
from sainet.robots.wire.limits import CYCLE
from sainet.robots.wire.transport import LOOPBACK

Carry = Callable[[np.ndarray], None]  # called every cycle with the tool, m
Beneath = Callable[[np.ndarray], Carry]


class Report(NamedTuple):
    """What a controller received and did since a fault was prepared."""

    answers: list[Answer]
    used: list[np.ndarray]
    places: list[np.ndarray]
    faulty: float  # s
    last_sent: float  # s


class RealController:
    """A process that sends every cycle and receives answers."""

    def __init__(
        self, start: np.ndarray, port: int, *, beneath: Beneath | None = None
    ) -> None:
        """Start.

        Args:
            start: of the tool, m.
            port: to which it sends.
            beneath: makes what the tool moves, in that process.
        """
        context = multiprocessing.get_context("spawn")
        self._pipe, other = context.Pipe()
        self._process = context.Process(
            target=serve, args=(start, port, beneath, other), daemon=True
        )
        self._process.start()
        assert self._pipe.poll(60), "the emulated controller did not start"
        self._pipe.recv()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_) -> None:
        self._pipe.send(None)
        self._process.join(10)
        assert not self._process.is_alive()

    def begin(self, fault: Fault | None) -> None:
        """Forget what happened, and prepare a fault."""
        self._pipe.send(("begin", fault))
        self._pipe.recv()

    def report(self) -> Report:
        """Return what happened."""
        self._pipe.send(("report", None))
        return self._pipe.recv()


def serve(
    start: np.ndarray, port: int, beneath: Beneath | None, pipe: Connection
) -> None:
    """Run a controller until it is asked to end."""
    controller = EmulatedController(start)
    if beneath is not None:
        controller.carry = beneath(start)
        controller.carry(start)
    ours, strange = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
    with ours, strange:
        ours.bind((LOOPBACK, 0))
        flying: list[tuple[float, int, bytes, bool]] = []
        count, following = 0, time.monotonic() + CYCLE
        # A controller is never late; where permitted, this process is not either.
        with suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(2))
        pipe.send("ready")
        while True:
            if pipe.poll():
                order = pipe.recv()
                if order is None:
                    return
                pipe.send(obey(controller, *order))
            wait = min([following] + [each[0] for each in flying[:1]])
            while (left := wait - time.monotonic()) > 0:
                ours.settimeout(left)
                try:
                    data = ours.recv(4096)
                except TimeoutError:
                    break
                controller.take(data, time.monotonic())
            now = time.monotonic()
            if now >= following:
                for delay, data, stranger in controller.tick(now):
                    count += 1
                    heapq.heappush(flying, (now + delay, count, data, stranger))
                following += CYCLE
            while flying and flying[0][0] <= now:
                _, _, data, stranger = heapq.heappop(flying)
                (strange if stranger else ours).sendto(data, (LOOPBACK, port))


def obey(controller: EmulatedController, verb: str, fault: Fault | None) -> object:
    """Answer the process that started this one."""
    if verb == "begin":
        controller.begin(fault)
        return None
    return Report(
        controller.answers,
        controller.used,
        controller.places,
        controller.faulty,
        controller.last_sent,
    )
