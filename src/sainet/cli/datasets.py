"""Commands that make datasets: `generate`, `import`, `split` and `add-bystander`."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional, arg

from sainet.cli.devices import use_cache, use_devices
from sainet.cli.output import Json, Output, progress_bar
from sainet.datasets.config import GenerateConfig
from sainet.datasets.recorded.units import Units
from sainet.runs.errors import BadInput
from sainet.runs.executors import Machines
from sainet.scenes.quantities import require_seed
from sainet.worlds.config import SetupName

if TYPE_CHECKING:
    from sainet.datasets.store import Store


@dataclass(frozen=True, kw_only=True)
class Settings(GenerateConfig):
    """Simulated pushes with the distributions of the paper (section IV-B).

    A range is a uniform distribution between two numbers, or one constant.
    """

    setup: Positional[SetupName] = "robot"
    """Setup: robot (the pusher follows a path) or direct-force (a force drives it)."""


@dataclass(frozen=True, kw_only=True)
class Generate:
    """Simulate pushes with the paper's distributions, and store them as a dataset."""

    config: Settings = field(default_factory=Settings)
    out: Path
    """Run folder to write; identical settings resume."""
    workers: int | None = None
    """Number of processes, which does not affect the result. Default: one per core."""
    machines: Machines = field(default_factory=Machines)
    output: Output = field(default_factory=Output)

    def run(self) -> Json:
        """Generate the dataset, or the chunks of a shard."""
        from sainet.datasets.generate import generate, generate_share

        shard = self.machines.share
        total = None if shard else self.config.pushes
        bar = progress_bar("Simulating", total, self.output)
        with self.machines.executor(self.workers) as pool, bar as advance:
            report = lambda pushes: advance(pushes, "")  # noqa: E731
            if shard is not None:
                pushes = generate_share(
                    self.config, self.out, shard, executor=pool, on_pushes=report
                )
                self.output.say(f"{pushes} pushes of shard {shard} are in {self.out}")
                return {"out": str(self.out), "shard": str(shard), "pushes": pushes}
            store = generate(self.config, self.out, executor=pool, on_pushes=report)
        self.output.say(f"{store.info.pushes} pushes are in {self.out}")
        return {"out": str(self.out), "pushes": store.info.pushes}


@dataclass(frozen=True, kw_only=True)
class Import:
    """Convert recorded pushes to a dataset."""

    format: Positional[Literal["mitpush-endpoints", "mitpush", "table"]]
    """mitpush-endpoints: poses before and after pushes of the MIT Push dataset.
    mitpush: raw MIT Push dataset, poses during each push of the disk ellip1.
    table: own pushes, one row for each push, time and body."""
    path: Annotated[Positional[Path], arg(metavar="PATH")]
    """mitpush-endpoints: the CSV, its folder, or a .mat log of the authors.
    mitpush: a zip, a folder tree of zips, or a folder of .h5 or .json files.
    table: a .csv or .parquet file."""
    out: Path
    """Run folder; identical settings resume."""
    properties: Path | None = None
    """TOML file of masses (kg), radii (m) and frictions, only for the format table.
    Default: none."""
    contact_friction: float | None = None
    """Friction between pusher and disk, and between disks. Default: that of the
    properties of a table, else 0.25, published for the robot of the MIT Push dataset.
    """
    units: Units = field(default_factory=Units)
    skip_bad: bool = False
    """Leave out the pushes of a table that have a problem; print how many and why."""
    output: Output = field(default_factory=Output)

    def run(self) -> Json:
        """Import the pushes."""
        use_cache()
        store = self._import()
        self.output.say(f"{store.info.pushes} pushes are in {self.out}")
        groups = list(store.info.groups)
        result = {"out": str(self.out), "pushes": store.info.pushes, "groups": groups}
        if self.skip_bad:
            from sainet.runs.documents import read_json
            from sainet.runs.folders import CONFIG

            result["left_out"] = read_json(self.out / CONFIG).get("left_out", 0)
        return result

    def _import(self) -> "Store":
        friction = self.contact_friction
        if self.format == "table":
            from sainet.datasets.recorded.own import import_table

            if self.properties is None:
                raise BadInput("`properties` is missing; give a TOML file of bodies.")
            return import_table(
                self.path,
                self.properties,
                self.out,
                contact_friction=friction,
                skip_bad=self.skip_bad,
                units=self.units,
            )
        given = {"properties": self.properties, "skip_bad": self.skip_bad}
        for name in [n for n, value in given.items() if value] + [*self.units.settings]:
            raise BadInput(f"`{name}` is for the format table; leave it out.")
        given = {} if friction is None else {"contact_friction": friction}
        if self.format == "mitpush":
            from sainet.datasets.recorded.raw import import_mitpush

            return import_mitpush(self.path, self.out, **given)
        from sainet.datasets.recorded.endpoints import import_endpoints

        return import_endpoints(self.path, self.out, **given)


@dataclass(frozen=True, kw_only=True)
class Split:
    """Divide recorded pushes into training pushes and test pushes.

    Repeats stay together. Train on OUT/train, evaluate on OUT/test.
    """

    data: Path
    """Dataset to divide. For simulated pushes generate a test dataset with another
    seed instead."""
    out: Path
    """Folder for the datasets train and test; identical settings resume."""
    test: float = 0.2
    """Share of the test pushes, above 0 and below 1."""
    seed: int = 0
    """Random seed of the draw."""
    chains: bool = False
    """Keep recorded chains together: pushes that start where another push ended."""
    output: Output = field(default_factory=Output)

    def run(self) -> Json:
        """Write both datasets."""
        from sainet.datasets.splits import write_split
        from sainet.datasets.store import open_store

        parts = write_split(
            open_store(self.data),
            self.out,
            test=self.test,
            seed=self.seed,
            chains=self.chains,
        )
        train, test = (part.info.pushes for part in parts)
        self.output.say(f"{train} training pushes and {test} test pushes: {self.out}")
        return {"out": str(self.out), "train": train, "test": test}


@dataclass(frozen=True, kw_only=True)
class AddBystander:
    """Add a bystander, a disk that nothing touches, to each push of a dataset.

    Networks trained further on such pushes predict scenes of more disks better.
    """

    data: Path
    """Dataset of pushes with complete trajectories, for example simulated pushes."""
    out: Path
    """Run folder to write, a dataset."""
    seed: int = 0
    """Random seed of the masses, radii and places of the bystanders."""
    output: Output = field(default_factory=Output)

    def run(self) -> Json:
        """Write the dataset."""
        use_devices(None)
        from sainet.datasets.bystander import add_bystander
        from sainet.datasets.store import open_store

        require_seed(self.seed)
        store = open_store(self.data)
        total = store.info.pushes * len(store.info.assumed_engines)
        with progress_bar("Simulator predictions", total, self.output) as advance:
            found = add_bystander(
                store, self.out, seed=self.seed, on_pushes=lambda n: advance(n, "")
            )
        info = found.info
        self.output.say(f"{info.pushes} pushes of {info.bodies} disks: {self.out}")
        return {"out": str(self.out), "pushes": info.pushes, "disks": info.bodies}
