"""What it takes to steer a row of disks: the cost-to-go of a linear regulator.

A row of three or more disks that is pushed from behind is unstable: its bends grow, and
the pusher acts on the first disk only. About a straight row, the motion in one push is
linear in the directions of the links and in both angles of the push. For every number
of pushes left, the Riccati recursion of the linear-quadratic regulator gives the least
sum of squared angles and bends for which the target disk meets its goal.
"""

from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from sainet.scenes.geometry import direction, norm, wrap_angle
from sainet.scenes.pushes import Push, PushGrid
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, at_rest

Roll = Callable[[State, Push], State]  # where one push from each state ends

_TURN = 0.15  # rad, of a link or a push: motion is linear up to twice as much
_PUSHES = 64  # the longest way, in pushes
_ASIDE = 10.0  # m: from disks that are not in the row
_LEAST = 1e-4  # m, of a push


class Steering(eqx.Module):
    """The cost-to-go of a row.

    Attributes:
        effort: by the number of pushes left, quadratic in the angles of the links from
            the direction to the goal, [push, link, link] (1/rad^2). An effort of 1 is
            that of a push at the widest angle, or of a bend of one radian.
        advance: of the target disk in one push, m.
        worth: cost of an effort of 1, m: the length of a push.
    """

    effort: Float[Array, "push link link"]
    advance: Float[Array, ""]
    worth: Float[Array, ""]

    def cost(
        self, row: Float[Array, "*batch disk 2"], ahead: Float[Array, "*batch 2"]
    ) -> Float[Array, "*batch"]:
        """Return what the effort costs that brings the last disk to its goal (m).

        Args:
            row: places of the disks, m.
            ahead: from the last disk to its goal, m.
        """
        links = direction(row[..., 1:, :] - row[..., :-1, :])
        turn = wrap_angle(links - direction(ahead)[..., None])
        last = len(self.effort) - 1
        left = jnp.clip(jnp.nan_to_num(norm(ahead) / self.advance), 0, last)
        before = jnp.minimum(left.astype(int), last - 1)
        part = (left - before)[..., None, None]
        effort = (1 - part) * self.effort[before] + part * self.effort[before + 1]
        return self.worth * jnp.einsum("...i,...ij,...j->...", turn, effort, turn)


def steering_of(
    roll: Roll, scene: Scene, state: State, grid: PushGrid, *, row: int, miss: float
) -> Steering | None:
    """Return the steering of a row, from pushes of the same disks in a straight row.

    Args:
        roll: predicts pushes.
        scene: one scene, without a batch axis.
        state: observed; the straight row begins at disk 1 and points to the target.
        grid: candidate pushes, of which ranges, length and speed count.
        row: number of disks in the row, of which the last is the target.
        miss: distance from the goal that counts like an effort of 1, m.

    Returns:
        The steering; None where a prediction diverged.
    """
    links = row - 1
    # In each push one link is turned, or one angle of the push; in the last, nothing.
    turned = _TURN * np.eye(links + 3, links + 2)
    starts, heading = _starts(scene, state, turned[:, :links])
    ends = np.asarray(roll(starts, _pushes(grid, turned[:, links:])).position, float)
    if not np.isfinite(ends).all():
        return None
    moved = (ends - np.asarray(starts.position, float))[:, links]
    along, across = _rotated(moved, -heading).T
    ways = _rotated(np.diff(ends[:, :row], axis=1), -heading)
    angles = np.arctan2(ways[..., 1], ways[..., 0])
    after = np.concatenate([angles, across[:, None]], axis=1)
    response = (after[:-1] - after[-1]).T / _TURN
    ranges = np.array([grid.contact_range, grid.direction_range])
    effort = _cost_to_go(response[:, :links], response[:, links:] * ranges, miss)
    return Steering(
        effort=jnp.asarray(effort, jnp.float32),
        advance=jnp.asarray(max(along[-1], _LEAST), jnp.float32),
        worth=jnp.asarray(grid.length, jnp.float32),
    )


def _starts(
    scene: Scene, state: State, turned: Float[np.ndarray, "push link"]
) -> tuple[State, float]:
    """Return touching rows with turned links, and the direction of the straight one."""
    count, links = turned.shape
    place, radius = np.asarray(state.position, float), np.asarray(scene.radius, float)
    heading = float(np.arctan2(*(place[links] - place[0])[::-1]))
    lengths = radius[:links] + radius[1 : links + 1]
    angles = heading + turned
    ways = lengths[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    position = np.repeat(place[None], count, axis=0)
    position[:, 1 : links + 1] = place[0] + np.cumsum(ways, axis=1)
    others = np.arange(1, len(place) - links)
    position[:, links + 1 :] = place[0] - _ASIDE * others[:, None]
    same = jnp.broadcast_to(jnp.asarray(state.angle), position.shape[:2])
    pusher = jnp.broadcast_to(jnp.asarray(state.pusher_position), (count, 2))
    return at_rest(jnp.asarray(position, jnp.float32), same, pusher), heading


def _pushes(grid: PushGrid, angles: Float[np.ndarray, "push 2"]) -> Push:
    contact, direct = jnp.asarray(angles.T, jnp.float32)
    like = jnp.ones_like(contact)
    return Push(contact, direct, grid.length * like, grid.speed * like)


def _rotated(
    vector: Float[np.ndarray, "*batch 2"], angle: float
) -> Float[np.ndarray, "*batch 2"]:
    cosine, sine = np.cos(angle), np.sin(angle)
    return vector @ np.array([[cosine, sine], [-sine, cosine]])


def _cost_to_go(
    links: Float[np.ndarray, "value link"],
    push: Float[np.ndarray, "value 2"],
    miss: float,
) -> Float[np.ndarray, "push link link"]:
    """Return the efforts by the number of pushes left, by the Riccati recursion.

    Args:
        links: response of the links' angles and the target's lateral distance to the
            links.
        push: response to the angles of a push, as fractions of their ranges.
        miss: m.
    """
    size, count = links.shape
    kept = np.eye(size)[:, count:]  # a lateral distance stays
    free, bends = np.hstack([links, kept]), np.diff(np.eye(count, size), axis=0)
    cost = np.diag(np.r_[np.zeros(count), miss**-2.0])
    efforts = [cost]
    for _ in range(_PUSHES):
        gain = np.linalg.solve(np.eye(2) + push.T @ cost @ push, push.T @ cost)
        cost = bends.T @ bends + free.T @ (cost - cost @ push @ gain) @ free
        cost = (cost + cost.T) / 2
        efforts.append(cost)
    return np.stack(efforts)[:, :count, :count]
