"""The table of the page: its edges, and rules for what is put on it."""

from dataclasses import dataclass

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from sainet.report.live.messages import BadMessage
from sainet.scenes.scene import Scene, pair_gaps
from sainet.scenes.state import State, at_rest

_BEHIND, _AHEAD, _HALF_WIDTH = 0.2, 0.44, 0.26  # m, from disk 1 in a row
_EACH = 0.115  # m, more for every further disk
_DEEPEST = 1e-3  # m: a larger overlap is refused; a page rounds to 0.01 mm
_ROUNDS = 20  # of moving disks apart
_compiled_gaps = eqx.filter_jit(pair_gaps)


@dataclass(frozen=True)
class Table:
    """A rectangle in the table frame."""

    low: tuple[float, float]  # m
    high: tuple[float, float]  # m

    @classmethod
    def for_disks(cls, disks: int) -> "Table":
        """Return a table with room for a row of disks and a goal."""
        more = _EACH * (disks - 2)
        return cls((-_BEHIND, -_HALF_WIDTH), (_AHEAD + more, _HALF_WIDTH))

    def check(self, place: Float[np.ndarray, " 2"], what: str) -> None:
        """Raise `BadMessage` unless a place is on the table (m)."""
        if (place < self.low).any() or (place > self.high).any():
            edges = " and ".join(
                f"{axis} from {1000 * low:g} to {1000 * high:g} mm"
                for axis, low, high in zip("xy", self.low, self.high, strict=True)
            )
            raise BadMessage(f"{what} would be off the table, which has {edges}.")


def with_disk_at(
    scene: Scene, state: State, disk: int, place: Float[np.ndarray, " 2"]
) -> State:
    """Return the state with one disk (an index) moved to a place (m), at rest.

    Raises:
        BadMessage: it would overlap another disk.
    """
    position = jnp.asarray(state.position).at[disk].set(jnp.asarray(place, jnp.float32))
    moved = at_rest(position, state.angle, state.pusher_position)
    gaps = np.asarray(_compiled_gaps(scene, moved))[disk]
    if gaps.min() < -_DEEPEST:
        other = 1 + int(gaps.argmin())
        raise BadMessage(
            f"Disk {disk + 1} would overlap disk {other} by {-1000 * gaps.min():.1f} "
            "mm; put it elsewhere."
        )
    return moved


def moved_apart(scene: Scene, state: State) -> State:
    """Return the state with overlapping disks moved apart; disk 1 stays."""
    position = np.array(state.position, np.float64)
    radius = np.asarray(scene.radius, np.float64)
    for _ in range(_ROUNDS):
        for i in range(1, len(radius)):
            for j in range(i):
                between = position[i] - position[j]
                distance = max(float(np.linalg.norm(between)), 1e-9)
                overlap = max(0.0, radius[i] + radius[j] - distance)
                position[i] += overlap * between / distance
    return at_rest(
        jnp.asarray(position, jnp.float32), state.angle, state.pusher_position
    )
