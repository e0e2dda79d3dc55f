"""One training iteration of SAIN in eager PyTorch, for `sainet bench training`.

    benchmarks/.venv/bin/python benchmarks/torch_training.py PROBLEM.npz [ITERATIONS]

The problem is what `sainet.bench.training.save_problem` writes: a batch of pushes in
the push frame, the weights to start from and the settings. The last line of output
is one JSON object: the loss before the first step, the losses of all steps, and the
median time of an iteration.
"""

import json
import os
import sys
from statistics import median
from time import perf_counter

import numpy as np
import torch
from torch import Tensor, nn

Arrays = dict[str, Tensor]


def layers(arrays: Arrays, name: str) -> nn.Sequential:
    """Return linear layers with ReLU after all but the last, with the given weights."""
    count = sum(key.startswith(f"{name}_weight_") for key in arrays)
    modules: list[nn.Module] = []
    for index in range(count):
        weight = arrays[f"{name}_weight_{index}"]
        linear = nn.Linear(*weight.shape)
        with torch.no_grad():
            linear.weight.copy_(weight.T)
            linear.bias.copy_(arrays[f"{name}_bias_{index}"])
        modules += [linear, nn.ReLU()]
    return nn.Sequential(*modules[:-1])


class InteractionNetwork(nn.Module):
    """SAIN for a batch of pushes of any number of bodies."""

    def __init__(self, arrays: Arrays) -> None:
        """Take weights, scales and the time step from a problem."""
        super().__init__()
        self.rel = layers(arrays, "rel")
        self.dyn = layers(arrays, "dyn")
        for name in ("pair_mean", "pair_deviation", "body_mean", "body_deviation"):
            self.register_buffer(name, arrays[f"scales_{name}"])
        self.register_buffer("scale", arrays["scales_acceleration"])
        self.bound = float(arrays["feature_bound"])
        self.time_step = float(arrays["time_step"])

    def forward(self, arrays: Arrays) -> Tensor:
        """Predict recurrently; return packed motion with axes [push, time, body, 6]."""
        motion, path = arrays["initial"], []
        still = torch.stack([arrays["mass"], arrays["radius"]], dim=-1)
        for time in range(arrays["action"].shape[1]):
            motion = self.step(bound_gradient(motion, arrays), still, arrays, time)
            path.append(motion)
        return torch.stack(path, dim=1)

    def step(self, motion: Tensor, still: Tensor, arrays: Arrays, time: int) -> Tensor:
        """Return the next motion: v' = v + dt f_dyn, p' = p + dt v'."""
        effect = self.effects(motion, still, arrays["simulated_rate_step"][:, time])
        shown = self.standardise(
            body_features(motion, still, arrays, time),
            self.body_mean,
            self.body_deviation,
        )
        out = self.dyn(torch.cat([shown, effect], dim=-1)) * self.scale
        rate = motion[..., 3:6] + self.time_step * out
        pose = motion[..., 0:3] + self.time_step * rate
        return torch.cat([pose, rate], dim=-1)

    def effects(self, motion: Tensor, still: Tensor, rate_step: Tensor) -> Tensor:
        """Sum the effects on each body: e_i = sum over j != i of f_rel(i, j)."""
        own = torch.cat([motion[..., 3:6], rate_step], dim=-1)
        seen = torch.cat([motion[..., 0:2], motion[..., 3:6]], dim=-1)
        rows = []
        for shift in range(1, motion.shape[1]):
            offset = seen - seen.roll(-shift, dims=1)
            other = still.roll(-shift, dims=1)
            rows.append(torch.cat([own, offset, still, other], dim=-1))
        pairs = self.standardise(torch.stack(rows), self.pair_mean, self.pair_deviation)
        return self.rel(pairs).sum(dim=0)

    def standardise(self, x: Tensor, mean: Tensor, deviation: Tensor) -> Tensor:
        """Bring features to unit size and bound them smoothly."""
        return self.bound * torch.tanh((x - mean) / deviation / self.bound)


def bound_gradient(motion: Tensor, arrays: Arrays) -> Tensor:
    """Return the motion; on the way back, shorten each push's gradient to the bound."""
    if not motion.requires_grad:
        return motion

    def shorten(gradient: Tensor) -> Tensor:
        # The loss is a mean over pushes here, and a sum where the bound is defined.
        bound = arrays["gradient_bound"] / arrays["pushes"]
        squared = (gradient * arrays["gradient_sizes"]).square().sum((-1, -2), True)
        share = (bound * squared.clamp(min=1e-30).rsqrt()).clamp(max=1.0)
        usable = squared.isfinite() & gradient.isfinite()
        return torch.where(usable, gradient * share, 0.0)

    bounded = motion.view_as(motion)
    bounded.register_hook(shorten)
    return bounded


def body_features(motion: Tensor, still: Tensor, arrays: Arrays, time: int) -> Tensor:
    """Return the inputs of f_dyn but the effects; the action is the pushed disk's."""
    offset = arrays["pusher"][:, None, time] - motion[..., 0:2]
    distance = (offset.square().sum(dim=-1) + 1e-12).sqrt()
    gap = distance - arrays["radius"] - arrays["pusher_radius"][:, None]
    velocity = arrays["action"][:, None, time].expand(-1, motion.shape[1], -1)
    action = torch.cat([velocity, offset, gap[..., None]], dim=-1)
    pushed = arrays["pushed"][..., None] * action
    simulated = arrays["simulated_pose_step"][:, time]
    return torch.cat([motion[..., 3:6], simulated, pushed, still], dim=-1)


def loss_of(path: Tensor, arrays: Arrays) -> Tensor:
    """Return the loss: summed over bodies, mean over time and pushes."""
    pose, rate = arrays["pose"], arrays["rate"]
    place = (path[..., 0:2] - pose[..., 0:2]).square().sum(dim=-1)
    sine = (path[..., 2].sin() - pose[..., 2].sin()).square()
    cosine = (path[..., 2].cos() - pose[..., 2].cos()).square()
    velocity = (path[..., 3:5] - rate[..., 0:2]).square().sum(dim=-1)
    spin = (path[..., 5] - rate[..., 2]).square()
    terms = arrays["loss_position"] * place + arrays["loss_rotation"] * (sine + cosine)
    terms = terms + arrays["loss_velocity"] * velocity + arrays["loss_spin"] * spin
    return terms.sum(dim=-1).mean()


def train(arrays: Arrays, iterations: int) -> tuple[list[float], list[float]]:
    """Return the loss before each iteration and how long each took (s)."""
    network = InteractionNetwork(arrays)
    rate, l2 = float(arrays["learning_rate"]), float(arrays["l2"])
    optimizer = torch.optim.Adam(network.parameters(), lr=rate)
    losses, times = [], []
    for _ in range(iterations):
        start = perf_counter()
        optimizer.zero_grad()
        loss = loss_of(network(arrays), arrays)
        decay = sum(weight.square().sum() for weight in network.parameters())
        (loss + l2 * decay).backward()
        nn.utils.clip_grad_norm_(network.parameters(), float(arrays["clip_norm"]))
        optimizer.step()
        losses.append(loss.item())
        times.append(perf_counter() - start)
    return losses, times


def use_the_faster_threads(arrays: Arrays) -> None:
    """Use all cores, or one: on a busy machine, threads that wait cost dearly."""
    times = {}
    for threads in (1, len(os.sched_getaffinity(0))):
        torch.set_num_threads(threads)
        times[threads] = train(arrays, 2)[1][-1]
    torch.set_num_threads(min(times, key=lambda threads: times[threads]))


def main() -> None:
    """Load the problem, train one iteration to warm up and then those that count."""
    with np.load(sys.argv[1], allow_pickle=False) as file:
        arrays = {name: torch.as_tensor(file[name]).float() for name in file.files}
    iterations = int(sys.argv[2]) if len(sys.argv) > 2 else 5  # noqa: PLR2004
    use_the_faster_threads(arrays)
    losses, times = train(arrays, 1 + iterations)
    result = {
        "iteration_ms": 1000 * median(times[1:]),
        "losses": losses,
        "threads": torch.get_num_threads(),
        "torch": torch.__version__,
    }
    print(json.dumps(result))


if __name__ == "__main__":
    main()
