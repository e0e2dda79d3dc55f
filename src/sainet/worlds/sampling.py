"""Random scenes and pushes with the distributions of the paper (section IV-B)."""

from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from sainet.runs.errors import BadInput, BadSetting
from sainet.scenes.pushes import Push, place_pusher
from sainet.scenes.scene import Scene, pusher_gaps
from sainet.scenes.state import State, at_rest, in_a_row
from sainet.worlds.config import OfDisks, Range, WorldConfig

_ARRANGEMENTS = 200  # of all disks of a scene
_TRIES = 50  # for each disk of an arrangement
_CHUNK_STREAM = 0x5A1  # keeps these draws apart from other uses of the same seed


@dataclass(frozen=True)
class Draws:
    """Random scenes and pushes in double precision."""

    mass: Float[np.ndarray, "push body"]  # kg
    radius: Float[np.ndarray, "push body"]  # m
    table_friction: Float[np.ndarray, " push"]
    contact_friction: Float[np.ndarray, " push"]
    position: Float[np.ndarray, "push body 2"]  # m
    contact_angle: Float[np.ndarray, " push"]  # rad
    direction: Float[np.ndarray, " push"]  # rad
    stroke: Float[np.ndarray, " push"]  # m
    speed: Float[np.ndarray, " push"]  # m/s
    pusher_radius: float  # m

    def scene(self) -> Scene:
        """Return the scenes."""
        contact = _single(self.contact_friction)
        return Scene(
            mass=_single(self.mass),
            radius=_single(self.radius),
            table_friction=_single(self.table_friction),
            disk_friction=contact,
            pusher_friction=contact,
            pusher_radius=jnp.full_like(contact, self.pusher_radius),
        )

    def state(self) -> State:
        """Return the disks at rest; the pusher is not placed."""
        position = _single(self.position)
        return at_rest(position, jnp.zeros(position.shape[:2]), position[:, 0])

    def push(self) -> Push:
        """Return the pushes."""
        drawn = self.contact_angle, self.direction, self.stroke, self.speed
        return Push(*map(_single, drawn))


def _single(values: np.ndarray) -> Array:
    return jnp.asarray(values, jnp.float32)


def chunk_generator(seed: int, index: int) -> np.random.Generator:
    """Return the random generator of one chunk, the same in every process."""
    return np.random.default_rng([_CHUNK_STREAM, seed, index])


def draw(config: WorldConfig, rng: np.random.Generator, pushes: int) -> Draws:
    """Draw scenes and pushes.

    Raises:
        BadInput: a disk or the pusher could not be placed without overlap.
    """
    radius = _uniform(rng, config.radii, (pushes, config.disks)) / 1000
    contact = np.deg2rad(config.contact_angle_deg)
    heading = np.deg2rad(config.direction_deg)
    draws = Draws(
        mass=_uniform(rng, config.masses, (pushes, config.disks)),
        radius=radius,
        table_friction=_uniform(rng, config.table_friction, (pushes,)),
        contact_friction=_uniform(rng, config.contact_friction, (pushes,)),
        position=np.stack([_place(config, rng, one) for one in radius]),
        contact_angle=rng.uniform(-contact, contact, pushes),
        direction=rng.uniform(-heading, heading, pushes),
        stroke=_uniform(rng, config.stroke_mm, (pushes,)) / 1000,
        speed=_uniform(rng, config.speed_mm_s, (pushes,)) / 1000,
        pusher_radius=config.pusher_radius_mm / 1000,
    )
    return _with_free_pusher(config, rng, draws)


def _uniform(
    rng: np.random.Generator, values: Range | OfDisks, shape: tuple[int, ...]
) -> np.ndarray:
    return rng.uniform(values[0], values[-1], shape)


def _place(
    config: WorldConfig, rng: np.random.Generator, radius: Float[np.ndarray, " body"]
) -> Float[np.ndarray, "body 2"]:
    """Place disk 1 at the origin and every other disk in front of an earlier disk.

    In a cluster, disks 2 and 3 touch disk 1, as in the paper. Disk 1 has no room for
    more, so each further disk touches any earlier disk. If the placed disks leave no
    room for the next, the arrangement starts again.
    """
    for _ in range(_ARRANGEMENTS):
        placed = [np.zeros(2)]
        while len(placed) < len(radius):
            place = _find_room(config, rng, placed, radius)
            if place is None:
                break
            placed.append(place)
        else:
            return np.stack(placed)
    raise BadInput(
        f"`disks` is {config.disks}: they could not be placed without overlap; "
        "increase `placement_deg` or narrow `radius_mm`."
    )


def _with_free_pusher(
    config: WorldConfig, rng: np.random.Generator, draws: Draws
) -> Draws:
    """Draw disks and pusher again where the pusher would start inside a disk.

    Only from three disks on can another disk than the pushed disk be in its way.
    """
    position, contact_angle = draws.position.copy(), draws.contact_angle.copy()
    # A generator of their own: redrawn pushes leave all others unchanged.
    (again,) = rng.spawn(1)
    for _ in range(_ARRANGEMENTS):
        draws = replace(draws, position=position, contact_angle=contact_angle)
        inside = np.flatnonzero(_pusher_overlaps(draws, config.gap_mm / 1000))
        if not len(inside):
            return draws
        widest = np.deg2rad(config.contact_angle_deg)
        contact_angle[inside] = again.uniform(-widest, widest, len(inside))
        for push in inside:
            position[push] = _place(config, again, draws.radius[push])
    raise BadInput(
        f"`disks` is {config.disks}: the pusher could not be placed without overlap; "
        "reduce `placement_deg` or `pusher_radius_mm`."
    )


def _pusher_overlaps(draws: Draws, gap: float) -> Bool[np.ndarray, " push"]:
    """Return whether the pusher starts inside another disk than the pushed disk."""
    scene, state = draws.scene(), draws.state()
    start = place_pusher(scene, state, draws.push(), gap=gap)
    gaps = pusher_gaps(scene, at_rest(state.position, state.angle, start))
    return np.any(np.asarray(gaps)[:, 1:] < 0, axis=1)


def _find_room(
    config: WorldConfig,
    rng: np.random.Generator,
    placed: list[np.ndarray],
    radius: Float[np.ndarray, " body"],
) -> Float[np.ndarray, " 2"] | None:
    """Return a place for the next disk, None if no try found room."""
    for _ in range(_TRIES):
        place, parents = _draw_place(config, rng, placed, radius)
        body = len(placed)
        if place is not None and _is_free(place, radius[body], placed, radius, parents):
            return place
    return None


def _draw_place(
    config: WorldConfig,
    rng: np.random.Generator,
    placed: list[np.ndarray],
    radius: Float[np.ndarray, " body"],
) -> tuple[Float[np.ndarray, " 2"] | None, tuple[int, ...]]:
    """Return a place where the next disk touches others, and which; None: nowhere."""
    body, gap = len(placed), config.gap_mm / 1000
    if config.arrangement == "triangle" and body > 1:
        one, other = map(int, rng.choice(body, 2, replace=False))
        reach = radius[[one, other]] + radius[body] + gap
        side = int(rng.choice([-1, 1]))
        return _corner(placed[one], placed[other], reach, side), (one, other)
    parent = body - 1
    if config.arrangement != "row":
        parent = 0 if body < 3 else int(rng.integers(body))  # noqa: PLR2004
    angle = np.deg2rad(rng.uniform(-config.placement_deg, config.placement_deg))
    reach = radius[parent] + radius[body] + gap
    place = placed[parent] + reach * np.array([np.cos(angle), np.sin(angle)])
    return place, (parent,)


def _corner(
    one: np.ndarray, other: np.ndarray, reach: np.ndarray, side: int
) -> Float[np.ndarray, " 2"] | None:
    """Return the point at two distances from two points, on one side, ahead of one.

    None if they are too far apart, or if it would be behind both.
    """
    way = other - one
    apart = np.hypot(*way)
    along = (apart**2 + reach[0] ** 2 - reach[1] ** 2) / (2 * apart)
    across = reach[0] ** 2 - along**2
    if across <= 0:
        return None
    normal = np.array([-way[1], way[0]]) * side
    place = one + (along * way + np.sqrt(across) * normal) / apart
    return place if place[0] > min(one[0], other[0]) else None


def _is_free(
    place: Float[np.ndarray, " 2"],
    radius: float,
    placed: list[np.ndarray],
    radii: Float[np.ndarray, " body"],
    touched: tuple[int, ...],
) -> bool:
    others = [i for i in range(len(placed)) if i not in touched]
    return all(
        np.hypot(*(place - placed[i])) >= radius + radii[i] + 1e-6 for i in others
    )


def scattered(
    rng: np.random.Generator, radius: Float[np.ndarray, " body"], side: float
) -> State:
    """Return disks at rest that touch in a row, anywhere in a square, turned at random.

    Args:
        rng: of the draws.
        radius: of each disk, m.
        side: of the square around the table's origin that has all centres, m.

    Raises:
        BadSetting: the square is too small.
    """
    row = np.asarray(in_a_row(radius).position)
    for _ in range(_ARRANGEMENTS):
        axis, *own = rng.uniform(-np.pi, np.pi, 1 + len(radius))
        along = np.array([np.cos(axis), np.sin(axis)])
        position = row[:, :1] * along + rng.uniform(-side / 2, side / 2, 2)
        if np.abs(position).max() <= side / 2:
            behind = position[0] - 2 * radius[0] * along
            return at_rest(_single(position), _single(np.array(own)), _single(behind))
    raise BadSetting("area_mm", f"{1000 * side:g}", "larger, so that the disks fit")
