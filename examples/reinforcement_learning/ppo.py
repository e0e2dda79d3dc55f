"""Train PPO of Stable-Baselines3 in 256 simulated worlds at once, then try it.

Needs PyTorch: pip install 'sainet[gym]' stable-baselines3
Run: python examples/reinforcement_learning/ppo.py [pushes]

It prints the share of training episodes that ended at their goal (`success_rate`), then
tries 100 other goals with the policy and with random pushes. Expect nearly all goals to
be solved after a million pushes, which take some minutes.
"""

import sys
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.vec_env import VecEnv, VecMonitor

import sainet  # noqa: F401  (registers the environment)


def make_worlds(count: int, mode: str = "NextStep") -> gymnasium.vector.VectorEnv:
    """Return simulated worlds with continuous pushes and dense rewards."""
    return gymnasium.make_vec(
        "sainet/PushDisks-v0",
        num_envs=count,
        actions="continuous",
        reward="dense",
        autoreset_mode=mode,
    )


class Worlds(VecEnv):
    """A vector environment of Gymnasium as one of Stable-Baselines3."""

    def __init__(self, worlds: gymnasium.vector.VectorEnv) -> None:
        """Take worlds that begin the next trial in the step that ends the last one."""
        self.worlds = worlds
        spaces = worlds.single_observation_space, worlds.single_action_space
        super().__init__(worlds.num_envs, *spaces)

    def reset(self) -> dict[str, np.ndarray]:
        """Begin a trial in every world."""
        return self.worlds.reset(seed=0)[0]

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the pushes until `step_wait`."""
        self.actions = actions

    def step_wait(self) -> tuple[Any, ...]:
        """Push; where an episode is over, say how it ended."""
        seen, reward, terminated, truncated, found = self.worlds.step(self.actions)
        done, infos = terminated | truncated, [{} for _ in range(self.num_envs)]
        for index in np.flatnonzero(done):
            infos[index] = {
                "terminal_observation": found["final_obs"][index],
                "is_success": found["final_info"]["is_success"][index],
                "TimeLimit.truncated": truncated[index] and not terminated[index],
            }
        return seen, 20 * reward, done, infos  # distances in units of 50 mm

    def close(self) -> None:
        """Close the worlds."""
        self.worlds.close()

    def get_attr(self, attr_name: str, indices: object = None) -> list[Any]:
        """Return an attribute of each world; they share their values."""
        return [getattr(self.worlds, attr_name)] * self.num_envs

    def set_attr(self, attr_name: str, value: object, indices: object = None) -> None:
        """Refuse: the options of the worlds are fixed."""
        raise NotImplementedError(attr_name)

    env_method = set_attr

    def env_is_wrapped(self, wrapper_class: type, indices: object = None) -> list[bool]:
        """Return that no world is wrapped."""
        return [False] * self.num_envs


class InRow(BaseFeaturesExtractor):
    """The goal in the frame of the two disks, in which actions are angles, too."""

    def __init__(self, space: gymnasium.spaces.Dict) -> None:
        """Declare the number of features."""
        super().__init__(space, features_dim=3)

    def forward(self, seen: dict[str, torch.Tensor]) -> torch.Tensor:
        """Return the goal ahead and beside (in 33 mm), and the gap (in 3.3 mm)."""
        place = seen["observation"].unflatten(-1, (2, 3))[..., :2]  # m, [env, disk, 2]
        row = place[:, 1] - place[:, 0]
        apart = row.norm(dim=-1)
        x, y = (row / apart[:, None]).T
        goal_x, goal_y = (seen["desired_goal"] - place[:, 1]).T
        ahead, beside = x * goal_x + y * goal_y, x * goal_y - y * goal_x
        return 30 * torch.stack((ahead, beside, 10 * (apart - 0.113)), dim=-1)


def solved(
    worlds: gymnasium.vector.VectorEnv, policy: Callable[[Any], np.ndarray]
) -> int:
    """Return in how many worlds a policy reaches its first goal of another seed."""
    seen, _ = worlds.reset(seed=1000)
    reached, over = np.zeros(worlds.num_envs, bool), np.zeros(worlds.num_envs, bool)
    while not over.all():
        seen, _, terminated, truncated, infos = worlds.step(policy(seen))
        reached |= terminated & ~over & infos["is_success"]
        over |= terminated | truncated
    return int(reached.sum())


if __name__ == "__main__":
    pushes = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    model = PPO(
        "MultiInputPolicy",
        VecMonitor(Worlds(make_worlds(256, "SameStep"))),
        policy_kwargs={"features_extractor_class": InRow, "log_std_init": -0.5},
        n_steps=32,  # pushes in each world between two updates
        batch_size=2048,
        learning_rate=1e-3,
        gamma=0.95,
        seed=0,
        verbose=1,
    )
    model.learn(pushes, log_interval=5)
    model.save("ppo.zip")
    tests = make_worlds(100)
    tests.action_space.seed(0)
    policies = {
        "learned": lambda seen: model.predict(seen, deterministic=True)[0],
        "random": lambda seen: tests.action_space.sample(),
    }
    for name, policy in policies.items():
        print(f"{name}: {solved(tests, policy)} of 100 goals")
