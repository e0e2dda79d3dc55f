"""Train SAC with hindsight experience replay of Stable-Baselines3 on easy goals.

Needs PyTorch: pip install 'sainet[gym]' stable-baselines3
Run: python examples/reinforcement_learning/her.py [pushes]

It prints the share of training episodes that ended at their goal, then tries 20 other
goals with the policy and with random pushes. Expect few solved goals after thousands of
pushes: the tolerance is a few mm, and a goal is several pushes away. A planner
(`sn.GreedyPlanner`) needs no training on goals.
"""

import sys

import gymnasium
import torch
from stable_baselines3 import SAC, HerReplayBuffer
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor

import sainet  # noqa: F401  (registers the environment)


class InRow(BaseFeaturesExtractor):
    """The goal in the frame of the two disks, in which actions are angles, too."""

    def __init__(self, space: gymnasium.spaces.Dict) -> None:
        """Declare the number of features."""
        super().__init__(space, features_dim=3)

    def forward(self, seen: dict[str, torch.Tensor]) -> torch.Tensor:
        """Return the goal ahead and beside, and the gap, in units of 20 mm."""
        place = seen["observation"].unflatten(-1, (2, 3))[..., :2]  # m, [env, disk, 2]
        row = place[:, 1] - place[:, 0]
        apart = row.norm(dim=-1)
        x, y = (row / apart[:, None]).T
        goal_x, goal_y = (seen["desired_goal"] - place[:, 1]).T
        features = (x * goal_x + y * goal_y, x * goal_y - y * goal_x, apart - 0.11)
        return 50 * torch.stack(features, dim=-1)


env = Monitor(gymnasium.make("sainet/PushDisks-v0", actions="continuous"))
model = SAC(
    "MultiInputPolicy",
    env,
    replay_buffer_class=HerReplayBuffer,
    replay_buffer_kwargs={"n_sampled_goal": 4, "goal_selection_strategy": "future"},
    policy_kwargs={"features_extractor_class": InRow},
    learning_starts=200,  # pushes; more than those of one episode
    gamma=0.95,
    seed=0,
    verbose=1,  # prints rollout/success_rate
)
model.learn(int(sys.argv[1]) if len(sys.argv) > 1 else 20_000, log_interval=10)
model.save("her.zip")

policies = {
    "learned": lambda seen: model.predict(seen, deterministic=True)[0],
    "random": lambda seen: env.action_space.sample(),
}
for name, act in policies.items():
    solved = 0
    seen, _ = env.reset(seed=1)  # trials of another seed, in order
    for _ in range(20):
        done = False
        while not done:
            seen, _, terminated, truncated, info = env.step(act(seen))
            done = terminated or truncated
        solved += info["is_success"]
        seen, _ = env.reset()
    print(f"{name}: {solved} of 20 goals")
