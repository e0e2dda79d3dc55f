"""Connecting to a cell: its arm, its tracker, and the people beside it."""

import sys
from collections.abc import Callable
from contextlib import ExitStack, closing

import numpy as np
from jaxtyping import Float

from sainet.robots import RobotConfig
from sainet.robots.wire.abb import AbbRobot
from sainet.robots.wire.arm import AbstractArm, DryArm
from sainet.robots.wire.cell import Cell, Tracking, read_cell
from sainet.robots.wire.guidance import EgmArm
from sainet.robots.wire.motion_capture import MotionCapture
from sainet.robots.wire.tracker import AbstractTracker
from sainet.robots.wire.transport import UdpTransport
from sainet.robots.wire.vicon import ViconStream
from sainet.runs.errors import BadInput, SainetError, require

Show = Callable[[float, Float[np.ndarray, "3"]], None]  # time (s), position (m)


def abb_robot(config: RobotConfig, *_seed: int) -> AbbRobot:
    """Return the robot of the configured cell.

    Raises:
        BadInput: the configuration cannot be used, or the tracker names other bodies.
    """
    show = show_command if config.dry_run else None
    return connect(configured_cell(config), show=show)


def configured_cell(config: RobotConfig) -> Cell:
    """Return the configuration of the cell of a physical robot.

    Raises:
        BadInput: it cannot be used, lists another number of disks, or its disks do not
            fit in the area.
    """
    assert config.config is not None
    cell = read_cell(config.config)
    if len(cell.disks) != config.disks:
        raise BadInput(
            f"{config.config}: it has {len(cell.disks)} [[disks]], not {config.disks}; "
            "list every disk on the table, the pushed one first."
        )
    apart = sum(disk.radius_mm for disk in cell.disks)  # centres of both disks
    require(config.area_mm >= apart, "area_mm", f"at least {apart:g}", config.area_mm)
    return cell


def show_command(time: float, position: Float[np.ndarray, "3"]) -> None:
    """Print a command of a dry run, in the frame of the robot's base."""
    x, y, z = 1000 * position
    print(f"{time:8.3f} s {x:9.2f} {y:9.2f} {z:9.2f} mm", file=sys.stderr)


def ask_operator(request: str) -> None:
    """Show a request on the terminal and wait for Enter.

    Raises:
        SainetError: nobody is there.
    """
    print(f"{request} Then press Enter.", file=sys.stderr, flush=True)
    if not sys.stdin.readline():
        raise SainetError(
            "nobody is at the terminal to arrange the disks; run it from a terminal."
        )


def connect(
    cell: Cell, *, ask: Callable[[str], None] = ask_operator, show: Show | None = None
) -> AbbRobot:
    """Return the robot of a cell, which listens from now on until it is closed.

    Args:
        cell: the configuration.
        ask: shows a request to people and returns when they have met it.
        show: called with every command of a dry run, which sends none; None: move.

    Raises:
        BadInput: an address cannot be listened to, or the tracker names other bodies.
        MissingExtra: the tracker needs a package that is not installed.
    """
    with ExitStack() as stack:
        tracker = stack.enter_context(closing(_tracker(cell.tracker)))
        arm = stack.enter_context(closing(_arm(cell, show)))
        robot = AbbRobot(cell, arm, tracker, ask=ask)
        robot.check_names()
        stack.pop_all()
    return robot


def _tracker(settings: Tracking) -> AbstractTracker:
    if settings.kind != "vicon-stream":
        return MotionCapture(settings.kind, settings.host)
    return ViconStream(
        UdpTransport(controller=settings.host, port=settings.port, host=settings.listen)
    )


def _arm(cell: Cell, show: Show | None) -> AbstractArm:
    if show is not None:
        limits = cell.limits
        return DryArm(np.mean([limits.low, limits.high], axis=0), limits, show)
    own = cell.controller
    transport = UdpTransport(controller=own.host, port=own.port, host=own.listen)
    return EgmArm(transport, cell.limits)
