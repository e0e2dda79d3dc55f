"""Random scenes and pushes with the distributions of the paper (section IV-B)."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from sainet.datasets.config import GenerateConfig, Range, bounds
from sainet.runs.errors import BadInput

_ARRANGEMENTS = 200  # of all disks of a scene
_TRIES = 50  # for each disk of an arrangement
_CHUNK_STREAM = 0x5A1  # keeps these draws apart from other uses of the same seed


@dataclass(frozen=True)
class Draws:
    """The scenes and pushes of one chunk, in NumPy, before anything is simulated."""

    mass: Float[np.ndarray, "push body"]  # kg
    radius: Float[np.ndarray, "push body"]  # m
    table_friction: Float[np.ndarray, " push"]
    contact_friction: Float[np.ndarray, " push"]
    position: Float[np.ndarray, "push body 2"]  # m
    contact_angle: Float[np.ndarray, " push"]  # rad
    direction: Float[np.ndarray, " push"]  # rad
    stroke: Float[np.ndarray, " push"]  # m
    speed: Float[np.ndarray, " push"]  # m/s


def chunk_generator(seed: int, index: int) -> np.random.Generator:
    """Return the generator of one chunk: its own, whichever worker draws from it."""
    return np.random.default_rng([_CHUNK_STREAM, seed, index])


def draw(config: GenerateConfig, rng: np.random.Generator, pushes: int) -> Draws:
    """Draw scenes and pushes.

    Raises:
        BadInput: no room was found for a disk, or for the pusher, beside the others.
    """
    radius = _uniform(rng, config.radius_mm, (pushes, config.disks)) / 1000
    contact = np.deg2rad(config.contact_angle_deg)
    heading = np.deg2rad(config.direction_deg)
    draws = Draws(
        mass=_uniform(rng, config.mass_kg, (pushes, config.disks)),
        radius=radius,
        table_friction=_uniform(rng, config.table_friction, (pushes,)),
        contact_friction=_uniform(rng, config.contact_friction, (pushes,)),
        position=np.stack([_place(config, rng, one) for one in radius]),
        contact_angle=rng.uniform(-contact, contact, pushes),
        direction=rng.uniform(-heading, heading, pushes),
        stroke=_uniform(rng, config.stroke_mm, (pushes,)) / 1000,
        speed=_uniform(rng, config.speed_mm_s, (pushes,)) / 1000,
    )
    return _with_free_pusher(config, rng, draws)


def _uniform(
    rng: np.random.Generator, values: Range, shape: tuple[int, ...]
) -> np.ndarray:
    return rng.uniform(*bounds(values), shape)


def _place(
    config: GenerateConfig, rng: np.random.Generator, radius: Float[np.ndarray, " body"]
) -> Float[np.ndarray, "body 2"]:
    """Put disk 1 at the origin and every other in front of one that is there.

    Disks 2 and 3 touch disk 1, as in the paper; it has no room for more, so that each
    further one touches any of the disks before it. Where the disks that are there
    leave no room for the next (disk 2 right in the middle, say), all start again.
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
    config: GenerateConfig, rng: np.random.Generator, draws: Draws
) -> Draws:
    """Place disks and pusher again where the pusher would start inside a disk.

    The pushed disk is where the pusher starts; from three disks on another may be.
    """
    position, contact_angle = draws.position.copy(), draws.contact_angle.copy()
    # A generator of their own: what is drawn again changes no other push.
    (again,) = rng.spawn(1)
    for _ in range(_ARRANGEMENTS):
        draws = replace(draws, position=position, contact_angle=contact_angle)
        inside = np.flatnonzero((_pusher_gaps(config, draws)[:, 1:] < 0).any(axis=1))
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


def _pusher_gaps(
    config: GenerateConfig, draws: Draws
) -> Float[np.ndarray, "push body"]:
    """Return the gaps between pusher and disks at the start (m); negative: overlap."""
    pushed, radius = draws.position[:, 0], config.pusher_radius_mm / 1000
    ahead = draws.position[:, min(1, config.disks - 1)] - pushed
    angle = np.arctan2(ahead[:, 1], ahead[:, 0]) + draws.contact_angle
    reach = draws.radius[:, :1] + radius + config.gap_mm / 1000
    pusher = pushed - reach * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    apart = np.linalg.norm(draws.position - pusher[:, None], axis=-1)
    return apart - draws.radius - radius


def _find_room(
    config: GenerateConfig,
    rng: np.random.Generator,
    placed: list[np.ndarray],
    radius: Float[np.ndarray, " body"],
) -> Float[np.ndarray, " 2"] | None:
    """Return where the next disk may go, None when no try found room."""
    body = len(placed)
    for _ in range(_TRIES):
        parent = 0 if body < 3 else int(rng.integers(body))  # noqa: PLR2004
        angle = np.deg2rad(rng.uniform(-config.placement_deg, config.placement_deg))
        reach = radius[parent] + radius[body] + config.gap_mm / 1000
        place = placed[parent] + reach * np.array([np.cos(angle), np.sin(angle)])
        if _is_free(place, radius[body], placed, radius, skip=parent):
            return place
    return None


def _is_free(
    place: Float[np.ndarray, " 2"],
    radius: float,
    placed: list[np.ndarray],
    radii: Float[np.ndarray, " body"],
    *,
    skip: int,
) -> bool:
    others = [i for i in range(len(placed)) if i != skip]
    return all(
        np.hypot(*(place - placed[i])) >= radius + radii[i] + 1e-6 for i in others
    )
