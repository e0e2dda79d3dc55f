"""The environment `sainet/PushDisks-v0`: one trial of control after another."""

from collections.abc import Mapping
from typing import Any, cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from sainet.control.gym.actions import ACTIONS, Action
from sainet.control.gym.config import PushDisksConfig
from sainet.control.gym.extra import gymnasium
from sainet.control.gym.raster import Picture
from sainet.control.gym.running import RunningTrial
from sainet.control.gym.spaces import (
    GoalRewards,
    distances,
    goal_on_table,
    is_on_table,
    observation_space,
)
from sainet.control.gym.task import Observation, PushDisksTask
from sainet.control.trial import make_trial
from sainet.runs.errors import require, require_one_of
from sainet.scenes.quantities import require_count, require_seed
from sainet.scenes.state import poses_of

_RENDER_MODES = ("rgb_array",)


class PushDisks(GoalRewards, gymnasium.Env[Observation, Action]):
    """Push disk 1 until the target disk is at its goal.

    A goal environment: `compute_reward` returns the reward for any goal. Episodes after
    ``reset(seed=s)`` have the goals, starts, frictions and noise of the trials of
    `sainet control` with this seed, in order. An episode terminates when the measured
    distance from the goal is within the stopping tolerance. It is truncated after
    `pushes` pushes, after three pushes in a row with a trouble, or when a disk leaves
    the table. ``info["is_success"]`` is whether the true pose is within the tolerance,
    ``info["distance"]`` the distance of the true pose from the goal (m), and
    ``info["trouble"]`` the trouble of the last push, empty for most pushes.
    """

    metadata = {"render_modes": list(_RENDER_MODES), "render_fps": 4}

    def __init__(self, *, render_mode: str | None = None, **options: Any) -> None:  # noqa: ANN401
        """Make the environment.

        Args:
            render_mode: None, or "rgb_array".
            options: fields of `PushDisksConfig`.

        Raises:
            UnknownName: there is no option of a name.
            BadSetting: an option has a value that cannot be used.
            MissingExtra: the world needs a package that is not installed.
        """
        if render_mode is not None:
            require_one_of("render_mode", render_mode, _RENDER_MODES)
        self.render_mode = render_mode
        self.config = PushDisksConfig.of(**options)
        control = self.config.control()
        actions = ACTIONS[self.config.actions]()
        self.task = PushDisksTask(make_trial(control, 0).scene, actions, control)
        self.observation_space = observation_space(self.task)
        self.action_space = actions.space
        self._seed: int | None = None
        self._next = 0  # trial
        self._running: RunningTrial | None = None

    def reset(
        self,
        *,
        seed: int | np.integer | None = None,
        options: Mapping[str, object] | None = None,
    ) -> tuple[Observation, dict[str, object]]:
        """Begin the first trial of a seed, or without a seed the next trial.

        Args:
            seed: of goals, frictions and noise.
            options: "trial", the index of a trial, and "goal", a position (m) that
                replaces the goal of the trial.

        Raises:
            BadInput: seed or option cannot be used, or the goal is off the table.
        """
        options = {} if options is None else options
        is_mapping = isinstance(options, Mapping)  # pyright: ignore
        require(is_mapping, "options", "None, or a dict of goal and trial", options)
        for name in options:
            require_one_of("options", str(name), ("goal", "trial"))
        goal = goal_on_table(options["goal"]) if "goal" in options else None
        if (index := options.get("trial")) is not None:
            require_count("trial", index, low=0)
        if seed is not None:
            require_seed(seed)
            seed = int(seed)
        super().reset(seed=seed)
        if seed is not None:
            self._seed, self._next = seed, 0
        elif self._seed is None:
            self._seed = int(self.np_random.integers(2**31))
        chosen = self._next if index is None else int(cast("int", index))
        trial = make_trial(self.config.control(self._seed or 0), chosen)
        if goal is not None:
            task = eqx.tree_at(lambda t: t.goal, trial.task, jnp.asarray(goal))
            trial = trial._replace(task=task)
        self._running, self._next = RunningTrial.begin(trial), chosen + 1
        return self._running.observation, self._running.info()

    def step(
        self, action: object
    ) -> tuple[Observation, float, bool, bool, dict[str, object]]:
        """Execute a push and observe the disks at rest.

        Raises:
            BadSetting: the action is outside the space; nothing was moved.
            ResetNeeded: no episode has begun, or the last one is over.
        """
        running = self._current()
        if running.is_over:
            raise gymnasium.error.ResetNeeded("The episode is over: call `reset`.")
        trouble = running.push(self.task.actions.pushes(action))
        pose = poses_of(running.trial.robot.observe())
        lost = not is_on_table(pose)
        if lost:  # the poses measured before are kept
            trouble = trouble or "a disk left the table"
        else:
            running.pose = pose
        observation = running.observation
        away = distances(observation["achieved_goal"], observation["desired_goal"])
        terminated = bool(away <= self.task.tolerance) and not lost
        spent = running.pushes >= self.config.pushes
        truncated = not terminated and (spent or running.is_stuck or lost)
        running.is_over = terminated or truncated
        reward = float(self.rewards(away))
        return observation, reward, terminated, truncated, running.info(trouble)

    def render(self) -> Picture | None:
        """Return a picture of the true poses; None without a `render_mode`.

        Raises:
            ResetNeeded: no episode has begun.
        """
        if self.render_mode is None:
            return None
        return self._current().picture(self.task.tolerance)

    def _current(self) -> RunningTrial:
        if self._running is None:
            raise gymnasium.error.ResetNeeded("Call `reset` before this.")
        return self._running
