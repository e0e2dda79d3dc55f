"""Train PPO of Stable-Baselines3 in 256 simulated worlds at once, then try it.

Needs PyTorch: pip install 'sainet[gym]' stable-baselines3
Run: python examples/reinforcement_learning/ppo.py [pushes]

It prints the share of training episodes that ended at their goal (`success_rate`), then
tries 100 other goals with the policy and with random pushes. Expect nearly all goals to
be solved after a million pushes, which take some minutes.
"""

import sys
from typing import Any

import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.vec_env import VecEnv, VecMonitor

import sainet  # noqa: F401  (registers the environment)

OPTIONS: dict[str, Any] = {"actions": "continuous", "reward": "dense", "pushes": 60}


class Worlds(VecEnv):
    """A vector environment of Gymnasium as one of Stable-Baselines3."""

    def __init__(self, worlds: gymnasium.vector.VectorEnv) -> None:
        """Take worlds that begin the next trial in the step that ends the last one."""
        spaces = worlds.single_observation_space, worlds.single_action_space
        super().__init__(worlds.num_envs, *spaces)
        self.worlds = worlds

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


def solved(policy: str, model: PPO, goals: int = 100) -> int:
    """Return how many goals of another seed are reached."""
    worlds = gymnasium.make_vec("sainet/PushDisks-v0", num_envs=goals, **OPTIONS)
    worlds.action_space.seed(0)
    seen, _ = worlds.reset(seed=1000)
    reached, over = np.zeros(goals, bool), np.zeros(goals, bool)
    while not over.all():
        actions = worlds.action_space.sample()
        if policy == "learned":
            actions, _ = model.predict(seen, deterministic=True)
        seen, _, terminated, truncated, infos = worlds.step(actions)
        reached |= terminated & ~over & infos["is_success"]
        over |= terminated | truncated
    return int(reached.sum())


if __name__ == "__main__":
    pushes = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    worlds = gymnasium.make_vec(
        "sainet/PushDisks-v0", num_envs=256, autoreset_mode="SameStep", **OPTIONS
    )
    model = PPO(
        "MultiInputPolicy",
        VecMonitor(Worlds(worlds)),
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
    for policy in ("learned", "random"):
        print(f"{policy}: {solved(policy, model)} of 100 goals")
