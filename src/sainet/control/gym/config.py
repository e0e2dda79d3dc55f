"""Options of the environment, the keywords of `gymnasium.make`; free of JAX."""

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, Literal, get_args

from sainet.control.config import ControlConfig, GivenProperties
from sainet.control.worlds import TableConfig
from sainet.robots import Surface
from sainet.runs.errors import require, require_one_of, unknown_name
from sainet.tasks import Goals

if TYPE_CHECKING:
    from sainet.control.gym.actions import ActionKind

RewardKind = Literal["sparse", "dense"]


@dataclass(frozen=True, kw_only=True)
class PushDisksConfig(TableConfig):
    """Options of `sainet/PushDisks-v0`; defaults as in `sainet control`."""

    goals: Goals = "easy"
    """Goals: easy (within 30 degrees of the disks' axis) or hard (30 to 60 degrees to
    either side)."""
    actions: "ActionKind" = "grid"
    """Actions: grid (an index of 72 pushes), or continuous (contact angle and push
    direction, as fractions of 60 and 30 degrees)."""
    reward: RewardKind = "sparse"
    """Reward: sparse (0 at the goal, else -1) or dense (minus the measured distance of
    the target disk from the goal, m)."""
    pushes: int = 60
    """Number of pushes after which an episode is truncated."""
    lab: int = 0
    """Number of the virtual lab, the seed of its hidden properties."""
    surface: Surface = "abs"
    """Surface of the virtual lab: abs or plywood."""
    given_properties: GivenProperties = "true"
    """Masses and radii given to models: true, or assumed."""

    def __post_init__(self) -> None:
        """Check every option.

        Raises:
            BadSetting: an option has a value that cannot be used.
        """
        require_one_of("actions", self.actions, ("grid", "continuous"))
        require_one_of("reward", self.reward, get_args(RewardKind))
        self.control()
        is_lab = self.world == "lab"
        wanted = f"left out {'in' if is_lab else 'outside'} the world lab"
        for name in ("noise_level",) if is_lab else ("lab", "surface"):
            value, usual = getattr(self, name), getattr(type(self), name)
            require(value == usual, name, wanted, value)

    @classmethod
    def of(cls, **options: Any) -> "PushDisksConfig":  # noqa: ANN401
        """Return the configuration with these options.

        Raises:
            UnknownName: there is no option of a name.
            BadSetting: an option has a value that cannot be used.
        """
        known = [each.name for each in fields(cls)]
        for name in options:
            if name not in known:
                raise unknown_name("option", name, known)
        return cls(**options)

    def control(self, seed: int = 0) -> ControlConfig:
        """Return the settings of `sainet control` with the same trials."""
        usual = ControlConfig(
            lab=self.lab,
            surface=self.surface,
            goals=self.goals,
            pushes=self.pushes,
            given_properties=self.given_properties,
            seed=seed,
        )
        return self.on_table(usual)
