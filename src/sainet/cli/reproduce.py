"""`sainet reproduce`."""

from collections.abc import Callable
from concurrent.futures import Executor
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tyro.conf import Positional

from sainet.cli.devices import use_devices
from sainet.cli.output import Output
from sainet.cli.progress import progress_bar
from sainet.runs.errors import BadInput
from sainet.runs.workers import core_count, worker_pool
from sainet.studies.config import Scale

if TYPE_CHECKING:
    from sainet.studies.chain import Chain
    from sainet.studies.result import Result


@dataclass(frozen=True, kw_only=True)
class Reproduce:
    """Reproduce tables; finished steps are not repeated."""

    experiments: Positional[tuple[str, ...]] = ()
    """Experiments: direct-force-two-disks (the paper's Table I),
    direct-force-three-disks (II) and robot-two-disks (III), with Bullet;
    data-efficiency, recurrent-or-not, regularisation and robustness, with the networks
    of Table III; simulated-control, with shipped networks; robot-planar; engine-parity;
    fine-tuning (settings chosen on simulated pushes); recorded-pushes and
    recorded-data-efficiency, which need --recorded. Default: every experiment whose
    requirements are met."""
    scale: Scale = "quick"
    """Size of datasets and training runs: quick for minutes per table, paper for 4,500
    pushes and 10,000 iterations per network."""
    out: Path = Path("runs/reproduce")
    """Folder to write, with one run folder per experiment."""
    recorded: Path | None = None
    """Dataset of recorded pushes, from 'sainet import mitpush-endpoints'.
    Default: none."""
    trainers: int | None = None
    """Number of networks trained at once, one per core and about 1 GB each; with 1, all
    devices share each batch. Default: one per core, 1 on a GPU."""
    devices: int | None = None
    """Number of CPU devices that share a batch. Default: one per core."""
    output: Output = field(default_factory=Output)

    def run(self) -> dict[str, Any]:
        """Run the experiments one after another."""
        use_devices(self.devices)
        from sainet.report.arrange import arrange
        from sainet.report.writers import print_table
        from sainet.studies.chain import Chain

        tables: dict[str, Any] = {}
        bar = partial(progress_bar, output=self.output)
        with worker_pool(None) as pool, self._trainer_pool() as trainers:
            chain = Chain(self.out, pool, self.output.say, bar, self.recorded, trainers)
            for name, make in self._look_up(chain).items():
                own = replace(chain, out=self.out / f"{name}-{self.scale}")
                result = make(self.scale, own)
                print_table(arrange(result.summary), self.output.console)
                tables[name] = result.to_json()
        only = next(iter(tables.values()))
        return only if len(tables) == 1 else {"experiments": tables}

    def _trainer_pool(self) -> AbstractContextManager[Executor | None]:
        """Return the processes that train in parallel; None for one at a time.

        Raises:
            BadInput: fewer than one is wanted, or several on one GPU.
        """
        import jax

        is_cpu = jax.default_backend() == "cpu"
        count = self.trainers
        if count is None:
            count = core_count() if is_cpu else 1
        if count < 1:
            raise BadInput(f"--trainers is {count}; it must be at least 1.")
        if count > 1 and not is_cpu:
            raise BadInput(f"--trainers is {count}; on a GPU it must be 1.")
        return worker_pool(count, core_each=True) if count > 1 else nullcontext()

    def _look_up(self, chain: "Chain") -> dict[str, Callable[..., "Result"]]:
        """Return what makes each table; what cannot be had is said before any runs."""
        from sainet.engines import make_engine
        from sainet.studies import load_experiment, needs_bullet, needs_recorded

        names = self.experiments or self._possible()
        found = {name: load_experiment(name) for name in names}
        if any(map(needs_bullet, names)):
            make_engine("bullet")
        if any(map(needs_recorded, names)):
            chain.recorded_pushes()
        return found

    def _possible(self) -> tuple[str, ...]:
        """Return what can be made here, and say what cannot."""
        from sainet.studies import EXPERIMENTS, needs_bullet, needs_recorded

        names = tuple(EXPERIMENTS)
        for lacks, lacking, needs in (
            (self.recorded is None, "--recorded", needs_recorded),
            (
                find_spec("pybullet") is None,
                "PyBullet (Python 3.11 only)",
                needs_bullet,
            ),
        ):
            left = [name for name in names if lacks and needs(name)]
            if left:
                self.output.warn(f"Left out without {lacking}: {', '.join(left)}.")
            names = tuple(name for name in names if name not in left)
        return names
