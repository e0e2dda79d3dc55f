"""The same training iteration in PyTorch, in a separate environment and process.

PyTorch is not a dependency of the package: the comparison is in `benchmarks/`, next to
the sources, and `make torch-env` creates its environment.
"""

import subprocess
from pathlib import Path

import msgspec
import numpy as np
from jaxtyping import Array

from sainet.bench.training import Problem
from sainet.learning.loss import path_to_frame, to_target
from sainet.models.correctors.interaction import FEATURE_BOUND
from sainet.models.inputs import drives, motion_to_frame, push_frame, still_features
from sainet.models.integrators import GRADIENT_BOUND, GRADIENT_SIZES
from sainet.runs.errors import SainetError
from sainet.scenes.state import pack_motion

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
    for name, layers in (("rel", network.rel), ("dyn", network.dyn)):
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
