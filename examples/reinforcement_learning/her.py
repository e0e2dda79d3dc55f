"""Train SAC with hindsight experience replay of Stable-Baselines3 on easy goals.

Needs PyTorch: pip install 'sainet[gym]' stable-baselines3
Run: python examples/reinforcement_learning/her.py [steps]
"""

import sys

import gymnasium
from stable_baselines3 import SAC, HerReplayBuffer
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor

import sainet  # noqa: F401  (registers the environment)

steps = int(sys.argv[1]) if len(sys.argv) > 1 else 20_000
env = Monitor(
    gymnasium.make("sainet/PushDisks-v0", actions="continuous", reward="sparse")
)
model = SAC(
    "MultiInputPolicy",
    env,
    replay_buffer_class=HerReplayBuffer,
    replay_buffer_kwargs={"n_sampled_goal": 4, "goal_selection_strategy": "future"},
    learning_starts=200,  # pushes, more than one episode
    gamma=0.95,
    seed=0,
)
model.learn(total_timesteps=steps)
model.save("her.zip")
mean, spread = evaluate_policy(model, env, n_eval_episodes=5)
print(f"after {steps} pushes: return {mean:.1f} +- {spread:.1f}")
