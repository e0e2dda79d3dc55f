"""Push to hard goals in the Gymnasium environment: a planner beside random pushes."""

import gymnasium
from gymnasium.wrappers import RecordEpisodeStatistics

import sainet as sn

env = gymnasium.make("sainet/PushDisks-v0", goals="hard", pushes=40)
env = RecordEpisodeStatistics(env)

# The policy: SAIN predicts, the paper's greedy search plans. Its action is one of the
# 72 pushes, as an index.
planner = sn.GreedyPlanner(sn.load("sain"), env.unwrapped.task)
policies = {
    "planner": planner.act,
    "random pushes": lambda observation: env.action_space.sample(),
}
for name, act in policies.items():
    # The trial that `sainet control --seed 0 --goals hard` begins with, for both.
    observation, info = env.reset(seed=0)
    env.action_space.seed(0)
    done = False
    while not done:
        observation, reward, terminated, truncated, info = env.step(act(observation))
        done = terminated or truncated
    print(
        f"{name}: {info['episode']['l']} pushes, success {info['is_success']}, "
        f"{1000 * info['distance']:.1f} mm from the goal"
    )

# Many worlds at once: one compiled call pushes in all of them.
many = gymnasium.make_vec("sainet/PushDisks-v0", num_envs=64, reward="dense")
many.reset(seed=0)
_, rewards, *_ = many.step(many.action_space.sample())
print(f"{many.num_envs} worlds: on average {-1000 * rewards.mean():.0f} mm to go")
