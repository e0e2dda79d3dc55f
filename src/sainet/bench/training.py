"""One training iteration on the paper's batch, relative to the machine's ceiling.

The ceiling, our iteration and the PyTorch iteration are measured in turn, several
times; every figure is the median of these measurements.
"""

import logging
import subprocess
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import jax
import msgspec
import numpy as np
from jaxtyping import Array

from sainet.bench import Figures
from sainet.bench.timing import ceiling_gflops, check_runs, median_seconds
from sainet.datasets.batch import PushBatch, to_batch
from sainet.datasets.config import GenerateConfig
from sainet.datasets.generate import simulate_chunk, store_info
from sainet.learning.loss import (
    LossWeights,
    feature_scales,
    loss_weights,
    path_to_frame,
    to_target,
)
from sainet.learning.recipes import PAPER, Recipe
from sainet.learning.step import FitState, even_batch, first_state, make_step
from sainet.models.correctors.interaction import InteractionNetwork
from sainet.models.correctors.network import FEATURE_BOUND, AbstractNetwork
from sainet.models.features import feature_set
from sainet.models.inputs import drives, motion_to_frame, push_frame, still_features
from sainet.models.integrators import GRADIENT_BOUND, GRADIENT_SIZES
from sainet.runs.errors import SainetError
from sainet.scenes.state import pack_motion


class Problem(NamedTuple):
    """Inputs of a gradient step."""

    recipe: Recipe
    state: FitState
    weights: LossWeights
    batch: PushBatch


def make_problem(pushes: int = 100, steps: int = 200) -> Problem:
    """Return a simulated batch with an untrained SAIN.

    Args:
        pushes: pushes in the batch: robot setup, two disks, the paper's distributions.
        steps: steps of each push, at most 200.
    """
    data = GenerateConfig(pushes=pushes, chunk_size=pushes)
    info = store_info(data)
    arrays = simulate_chunk(data, 0)
    batch = to_batch(arrays, info, steps=steps, simulated=data.assumed_engine[0])
    recipe = PAPER.changed(batch_size=pushes, steps=steps)
    features = feature_set(info.kind, simulator=True)
    network = InteractionNetwork(
        features,
        time_step=info.time_step,
        key=jax.random.key(recipe.seed),
        scales=feature_scales(batch, features),
    )
    weights = loss_weights(batch, recipe.objective)
    state = first_state(network, recipe.optimiser)
    return Problem(recipe, state, weights, even_batch(batch))


FOLDER = Path(__file__).resolve().parents[3] / "benchmarks"
_SCRIPT = FOLDER / "torch_training.py"
_PYTHON = FOLDER / ".venv" / "bin" / "python"
_TOLERANCE = 1e-3  # of the first loss, relative: single precision over 200 steps


def missing_torch() -> str | None:
    """Return why no comparison with PyTorch is possible, or None if it is."""
    if not _SCRIPT.is_file():
        return "the installed package has no benchmarks/; run from a checkout"
    if not any(FOLDER.glob(".venv/lib/python*/site-packages/torch/__init__.py")):
        return "no PyTorch in benchmarks/.venv; run `make torch-env`"
    return None


class TorchRun(msgspec.Struct, frozen=True):
    """Results of the PyTorch script."""

    losses: tuple[float, ...]  # before each step
    iteration_ms: float  # median


class TorchPeer:
    """Training on a saved problem with PyTorch, checked to do the same work."""

    def __init__(self, problem: Path, loss: float) -> None:
        """Store the file of `save_problem` and our loss before the first step."""
        self._problem = problem
        self._loss = loss

    def iteration_ms(self, iterations: int = 5) -> float:
        """Return the median time of some iterations (ms), after a warm-up iteration.

        Raises:
            SainetError: the first loss of PyTorch differs from ours.
        """
        result = run_torch(self._problem, iterations)
        difference = abs(result.losses[0] - self._loss)
        if not difference <= _TOLERANCE * abs(self._loss):
            raise SainetError(
                f"{_SCRIPT.name}: the first loss is {result.losses[0]:.6g}, ours is "
                f"{self._loss:.6g}; change the script so that both do the same work."
            )
        return result.iteration_ms


def run_torch(problem: Path, iterations: int = 5) -> TorchRun:
    """Return the results of `benchmarks/torch_training.py` on a saved problem.

    Raises:
        SainetError: the script failed.
    """
    command = [str(_PYTHON), str(_SCRIPT), str(problem), str(iterations)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise SainetError(f"{_SCRIPT.name} failed ({last}); try `make torch-env`.")
    return msgspec.json.decode(done.stdout.strip().splitlines()[-1], type=TorchRun)


def save_problem(path: Path, problem: Problem) -> Path:
    """Write a problem as arrays in the push frame and return the path.

    Weights have axes ``[input, output]``.
    """
    network, weights = problem.state.network, problem.weights
    optimiser = problem.recipe.optimiser
    arrays = _batch_arrays(problem)
    for name, layers in zip(("rel", "dyn"), network.trained, strict=True):
        for index, weight in enumerate(layers.weights):
            arrays[f"{name}_weight_{index}"] = weight
            arrays[f"{name}_bias_{index}"] = layers.biases[index]
    for group, tree in (("scales", network.scales), ("loss", weights)):
        arrays |= {f"{group}_{name}": value for name, value in vars(tree).items()}
    settings = {
        "feature_bound": FEATURE_BOUND,
        "gradient_bound": GRADIENT_BOUND,
        "gradient_sizes": GRADIENT_SIZES,
        "pushes": optimiser.batch_size,
        "time_step": network.time_step,
        "learning_rate": optimiser.learning_rate,
        "clip_norm": optimiser.clip_norm,
        "l2": problem.recipe.objective.l2,
    }
    saved = {k: np.asarray(v) for k, v in (arrays | settings).items()}
    np.savez(path, **saved)  # pyright: ignore[reportArgumentType]
    return path


def _batch_arrays(problem: Problem) -> dict[str, Array]:
    size, whole = problem.recipe.optimiser.batch_size, problem.batch
    if whole.simulated is None:
        raise ValueError("a batch for SAIN holds s-bar")
    frame = push_frame(whole.scene, whole.initial)
    initial = motion_to_frame(pack_motion(whole.initial), frame)
    simulated = path_to_frame(whole.simulated, frame).swapaxes(0, 1)
    drive = drives(
        whole.controls.in_frame(frame.origin, frame.angle), initial, simulated
    )
    target = to_target(whole)
    arrays = {
        "initial": initial,
        **drive._asdict(),
        **still_features(whole.scene, frame)._asdict(),
        "pose": target.pose.swapaxes(0, 1),
        "rate": target.rate.swapaxes(0, 1),
    }
    # Leave out the pushes that were repeated to make the batch even.
    return {name: value[:size] for name, value in arrays.items()}


_FORWARD_AND_BACK = 3  # a product's two gradients are two products of its size
_log = logging.getLogger(__name__)


class Measurement(NamedTuple):
    """Times of one round of measurements."""

    ceiling_gflops: float
    iteration_ms: float
    torch_ms: float | None


class TrainingLoop:
    """Training iterations on one batch, each from the state of the previous one."""

    def __init__(self, problem: Problem) -> None:
        """Compile and run the first iteration; `first_loss` is the loss before it."""
        self._step = make_step(problem.recipe, problem.weights)
        self._batch = problem.batch
        # Match the step's output device; otherwise the second call compiles again.
        state = jax.device_put(problem.state, jax.devices()[0])
        self._state, loss = self._step(state, problem.batch)
        self.first_loss = float(loss)

    def advance(self) -> Any:  # noqa: ANN401
        """Run one iteration and return its arrays."""
        self._state, loss = self._step(self._state, self._batch)
        return self._state, loss


def bench_training(
    runs: int = 5, *, pushes: int = 100, steps: int = 200, repeats: int = 5
) -> Figures:
    """Return the time of a training iteration of SAIN: gradient and Adam update.

    Args:
        runs: number of measurements, for the median.
        pushes: pushes in the batch, with two disks each, robot setup.
        steps: steps of each push, at most 200.
        repeats: iterations per measurement, for its median.

    Returns:
        `iteration_ms`, `ceiling_fraction`, `eager_torch_ratio` and the sizes of the
        measurement.

    Raises:
        SainetError: the first loss of PyTorch differs from ours.
    """
    check_runs(runs)
    problem = make_problem(pushes, steps)
    bodies = problem.batch.scene.body_count
    work = counted_gflop(problem.state.network, pushes, steps, bodies)
    loop = TrainingLoop(problem)
    reason = missing_torch()
    with TemporaryDirectory(prefix="sainet-bench-") as folder:
        peer = None
        if reason is None:
            path = save_problem(Path(folder) / "problem.npz", problem)
            peer = TorchPeer(path, loop.first_loss)
        measured = [_measure(loop, peer, repeats) for _ in range(runs)]
    return {
        **_figures(measured, work),
        "work_gflop": work,
        "devices": jax.device_count(),
        "runs": runs,
        "reason": reason,
    }


def counted_gflop(
    network: AbstractNetwork, pushes: int, steps: int, bodies: int
) -> float:
    """Return the operations in the matrix products of an iteration (1e9).

    A linear layer with K inputs and N outputs costs ``2 K N`` per row, and twice as
    much in the backward pass, without recomputed products. f_rel has one row for each
    ordered pair of bodies, f_dyn one for each body.
    """
    pairs = bodies * (bodies - 1)
    rel, dyn = network.trained
    row = 2 * (pairs * _weights(rel) + bodies * _weights(dyn))
    return _FORWARD_AND_BACK * row * pushes * steps / 1e9


def _weights(layers: Any) -> int:  # noqa: ANN401
    return sum(weight.size for weight in layers.weights)


def _measure(loop: TrainingLoop, peer: TorchPeer | None, repeats: int) -> Measurement:
    # In blocks with a warm-up each: NumPy's threads keep spinning for some milliseconds
    # after a product and would slow down an iteration that follows immediately.
    ceiling = ceiling_gflops()
    ours = 1000 * median_seconds(loop.advance, repeats)
    theirs = None if peer is None else peer.iteration_ms(repeats)
    measurement = Measurement(ceiling, ours, theirs)
    _log.info("%s", measurement)
    return measurement


def _figures(measured: list[Measurement], work: float) -> Figures:
    fractions = [work / (m.iteration_ms / 1000 * m.ceiling_gflops) for m in measured]
    ratios = [m.torch_ms / m.iteration_ms for m in measured if m.torch_ms is not None]
    return {
        "iteration_ms": median(m.iteration_ms for m in measured),
        "ceiling_gflops": median(m.ceiling_gflops for m in measured),
        "ceiling_fraction": median(fractions),
        "eager_torch_ratio": median(ratios) if ratios else None,
    }
