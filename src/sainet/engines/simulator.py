"""Simulator specifications: which engine predicts, and what it assumes of a scene.

A specification is data: it is stored in cards, datasets and identified parameters, and
two equal specifications make the same prediction. `build` returns the engine. Free of
JAX until then.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import msgspec

from sainet.runs.documents import content_hash
from sainet.runs.errors import UnknownName, unknown_name
from sainet.runs.folders import Keyed
from sainet.scenes.quantities import Friction, Mass, PressureRatio, Radius
from sainet.scenes.recording import AGREES, CameraOffset

if TYPE_CHECKING:
    from sainet.engines.base import AbstractEngine, AssumedProperties

UNIFORM_PRESSURE = (
    2 / 3
)  # mean distance of the pressure from the centre over the radius
_DIGEST = 8  # characters that distinguish specifications without a name


class Assumptions(msgspec.Struct, frozen=True, kw_only=True):
    """Properties that an engine assumes; None keeps the scene's own value.

    A disk beyond the listed ones gets the mean of the listed values.
    """

    mass: tuple[Mass, ...] | None = None  # kg
    radius: tuple[Radius, ...] | None = None  # m
    table_friction: Friction | None = None  # between disks and table
    disk_friction: Friction | None = None  # between disks
    pusher_friction: Friction | None = None  # between pusher and disk

    def in_order(self, order: Sequence[int]) -> "Assumptions":
        """Return the properties of the same disks in another order.

        Args:
            order: which of the listed disks is disk 1, disk 2 and so on.
        """
        mass = self.mass and tuple(self.mass[disk] for disk in order)
        radius = self.radius and tuple(self.radius[disk] for disk in order)
        return msgspec.structs.replace(self, mass=mass, radius=radius)


# The paper's properties (section IV-B), and the same with true masses and radii.
PAPER_MASS, PAPER_RADIUS, PAPER_FRICTION = (0.896, 1.1), (0.0525, 0.058), 0.15  # kg, m
PAPER = Assumptions(mass=PAPER_MASS, radius=PAPER_RADIUS, table_friction=PAPER_FRICTION)
TRUE_PROPERTIES = Assumptions(table_friction=PAPER_FRICTION)


class _Spec(Keyed, frozen=True, kw_only=True, tag_field="engine"):
    """What the specifications of all engines have in common."""

    assumptions: Assumptions = PAPER
    version: int = 1  # of the engine's equations: other versions predict otherwise

    engine: ClassVar[str]

    @property
    def slug(self) -> str:
        """The name in options and stored arrays, unique for each specification."""
        for name, spec in SIMULATORS.items():
            if spec == self:
                return name
        return f"{self.engine}-{content_hash(msgspec.json.encode(self))[:_DIGEST]}"

    @property
    def chosen_as(self) -> str:
        """The name of the engine where its assumptions are chosen separately."""
        return self.engine

    @property
    def stored_as(self) -> str:
        """The name of its predictions in datasets; later versions have other names."""
        return self.slug if self.version == 1 else f"{self.slug}.v{self.version}"

    @property
    def is_identified(self) -> bool:
        """Whether parameters were estimated from pushes."""
        return self not in SIMULATORS.values()


class PlanarSpec(_Spec, frozen=True, kw_only=True, tag="planar"):
    """The planar engine."""

    pressure_radius_ratio: PressureRatio = UNIFORM_PRESSURE
    # Whether disks that overlap at the start stay so, instead of being moved apart.
    keeps_overlaps: Literal[True] | msgspec.UnsetType = msgspec.UNSET

    engine: ClassVar[str] = "planar"

    @property
    def chosen_as(self) -> str:
        """The name of the engine where its assumptions are chosen separately."""
        return f"{self.engine}-overlap" if self.keeps_overlaps else self.engine

    def build(self) -> "AssumedProperties":
        """Return the engine with its assumptions."""
        from sainet.engines.base import AssumedProperties
        from sainet.engines.planar.engine import PlanarEngine

        engine = PlanarEngine(pressure_radius_ratio=self.pressure_radius_ratio)
        if self.keeps_overlaps:
            engine = replace(engine, recovery=0.0)
        return AssumedProperties(engine, self.assumptions)


class BulletSpec(_Spec, frozen=True, kw_only=True, tag="bullet"):
    """Bullet (extra `bullet`)."""

    engine: ClassVar[str] = "bullet"

    def build(self) -> "AssumedProperties":
        """Return the engine with its assumptions.

        Raises:
            MissingExtra: PyBullet is not installed.
        """
        from sainet.engines.base import AssumedProperties
        from sainet.engines.bullet.engine import BulletEngine

        return AssumedProperties(BulletEngine(), self.assumptions)


class OwnSpec(_Spec, frozen=True, kw_only=True, tag="own"):
    """An engine of a user's script, which registers it under a name.

    A document contains the name only: opening one never runs code that it names.
    """

    name: Annotated[str, msgspec.Meta(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,49}$")]
    assumptions: Assumptions = Assumptions()

    engine: ClassVar[str] = "own"

    @property
    def is_identified(self) -> bool:
        """False: its parameters are in the script."""
        return False

    def build(self) -> "AssumedProperties":
        """Return the engine with its assumptions.

        Raises:
            UnknownName: no engine was registered under the name.
        """
        from sainet.engines.base import AssumedProperties

        if self.name not in OWN:
            raise UnknownName(
                f"No engine named '{self.name}' was made in this process; call "
                f"`from_step` with name='{self.name}' first, or `from_mjcf`."
            )
        return AssumedProperties(OWN[self.name], self.assumptions)


SimulatorSpec = PlanarSpec | BulletSpec | OwnSpec
OWN: "dict[str, AbstractEngine]" = {}  # engines that scripts registered


class InternalEngine(msgspec.Struct, frozen=True):
    """What predicts s-bar for a network: a simulator, and where its camera looks."""

    simulator: SimulatorSpec
    camera: CameraOffset = AGREES
    # That it was identified on (`runs.digests`); only of an engine to train around.
    pushes: str | msgspec.UnsetType = msgspec.UNSET

    @property
    def settings(self) -> object:
        """What decides its predictions, as JSON values."""
        return msgspec.to_builtins(InternalEngine(self.simulator, self.camera))


# Specifications by the names that options take and that stored arrays have.
SIMULATORS: Mapping[str, SimulatorSpec] = MappingProxyType(
    {
        "planar": PlanarSpec(),
        "planar-true": PlanarSpec(assumptions=TRUE_PROPERTIES),
        "planar-overlap": PlanarSpec(keeps_overlaps=True),
        "planar-true-overlap": PlanarSpec(
            assumptions=TRUE_PROPERTIES, keeps_overlaps=True
        ),
        "bullet": BulletSpec(),
        "bullet-true": BulletSpec(assumptions=TRUE_PROPERTIES),
    }
)


def simulator_named(name: str) -> SimulatorSpec:
    """Return the specification with a name.

    Raises:
        UnknownName: there is none.
    """
    if name not in SIMULATORS:
        raise unknown_name("simulator", name, SIMULATORS)
    return SIMULATORS[name]


def stored_simulator(name: str) -> SimulatorSpec:
    """Return the specification whose predictions have a name in datasets.

    Raises:
        UnknownName: there is none, for example because its engine has a later version.
    """
    known = {spec.stored_as: spec for spec in SIMULATORS.values()}
    if name not in known:
        raise unknown_name("simulator", name, known)
    return known[name]
