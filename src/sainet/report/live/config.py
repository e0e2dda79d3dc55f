"""Settings of the live page, free of JAX."""

from dataclasses import dataclass
from pathlib import Path

from sainet.control.config import ControlConfig
from sainet.control.worlds import TableConfig
from sainet.runs.errors import require
from sainet.scenes.quantities import require_count, require_seed
from sainet.tasks import Goals

DISK_COUNTS = (2, 3, 4)
LOOPBACK = ("127.0.0.1", "localhost", "[::1]")
_LARGEST_PORT = 65535
_MOST_MODELS = 6


@dataclass(frozen=True, kw_only=True)
class PlayConfig(TableConfig):
    """Address of the page, and the scene that it starts with."""

    model: tuple[str, ...] = ("physics", "in", "sain")
    """Models whose predictions the page shows, or folders of trained networks; at first
    the last model plans."""
    goals: Goals = "hard"
    """Drawn goals: easy (within 30 degrees of the disks' axis) or hard (30 to
    60 degrees to either side)."""
    seed: int = 0
    """Random seed of goals, friction and noise."""
    port: int = 8642
    """Port of the page; 0 takes any free port."""
    host: str = "127.0.0.1"
    """Address to listen on. If it is not a loopback address, anybody who can reach it
    can use the page."""
    name: tuple[str, ...] = ()
    """Further host names under which browsers may open the page. Default: none."""
    out: Path = Path("runs/play")
    """Run folder to which the page saves episodes."""

    def __post_init__(self) -> None:
        """Check every setting."""
        few = 0 < len(set(self.model)) == len(self.model) <= _MOST_MODELS
        require(few, "model", f"1 to {_MOST_MODELS} different models", self.model)
        require_count("disks", self.disks, low=DISK_COUNTS[0], high=DISK_COUNTS[-1])
        require_seed(self.seed)
        require_count("port", self.port, low=0, high=_LARGEST_PORT)
        require(bool(self.host), "host", "an address of this machine", self.host)
        self.control()

    def control(self) -> ControlConfig:
        """Return the settings of the first episode.

        Raises:
            BadSetting: the world does not have so many disks.
        """
        usual = ControlConfig(model=self.model[-1], goals=self.goals, seed=self.seed)
        return self.on_table(usual)

    def hosts(self, port: int) -> frozenset[str]:
        """Return the values that the header Host may have."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        names = {*LOOPBACK, host, *self.name}
        return frozenset(names | {f"{name}:{port}" for name in names})
