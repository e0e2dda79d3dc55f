"""Many environments `sainet/PushDisks-v0` at once, in planar worlds."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from sainet.control.episode import MOST_TROUBLES
from sainet.control.gym.actions import ACTIONS
from sainet.control.gym.config import PushDisksConfig
from sainet.control.gym.extra import gymnasium
from sainet.control.gym.spaces import (
    GoalRewards,
    distances,
    is_on_table,
    observation_space,
)
from sainet.control.gym.tables import Tables
from sainet.control.gym.task import Observation, PushDisksTask, observation_of
from sainet.control.trial import make_trial
from sainet.runs.errors import BadInput, BadSetting, require, require_one_of
from sainet.scenes.quantities import require_count, require_seed

_Mode = gymnasium.vector.AutoresetMode
_MOST = 1_000_000  # environments
_SINGLE = "if `vectorization_mode` is not 'sync' or 'async'"
_Each = Bool[np.ndarray, " env"]
_Infos = dict[str, object]


class PushDisksVector(
    GoalRewards, gymnasium.vector.VectorEnv[Observation, np.ndarray, np.ndarray]
):
    """Environments with planar worlds, all pushed in one compiled call.

    Seeds, goals, starts and frictions equal those of `PushDisks`: environment i has
    the trials of seed ``seed + i``. The noise of all environments comes from one
    generator, so that only equal seeds and equal actions have equal results. An
    environment whose episode is over begins its next trial at the next step, whose
    action has no effect (autoreset mode NEXT_STEP), or in the same step, whose infos
    have the last observation and infos of that episode (SAME_STEP).
    """

    def __init__(
        self,
        num_envs: int = 1,
        *,
        autoreset_mode: str | _Mode = _Mode.NEXT_STEP,
        **options: Any,  # noqa: ANN401
    ) -> None:
        """Make the environments.

        Args:
            num_envs: number of environments.
            autoreset_mode: NextStep or SameStep, or the member of Gymnasium's enum.
            options: fields of `PushDisksConfig`; the world has to be planar.

        Raises:
            UnknownName: there is no option of a name.
            BadSetting: an option has a value that cannot be used.
        """
        require_count("num_envs", num_envs, high=_MOST)
        mode = options.pop("render_mode", None)
        require(mode is None, "render_mode", f"None {_SINGLE}", mode)
        name = str(getattr(autoreset_mode, "value", autoreset_mode))
        require_one_of("autoreset_mode", name, ("NextStep", "SameStep"))
        self.metadata = {"render_modes": [], "autoreset_mode": _Mode(name)}
        self.config = PushDisksConfig.of(**options)
        if self.config.world != "planar":
            raise BadSetting("world", self.config.world, f"planar {_SINGLE}")
        control = self.config.control()
        actions = ACTIONS[self.config.actions]()
        self.task = PushDisksTask(make_trial(control, 0).scene, actions, control)
        self.num_envs = num_envs
        batch = gymnasium.vector.utils.batch_space
        self.single_observation_space = observation_space(self.task)
        self.single_action_space = actions.space
        self.observation_space = batch(self.single_observation_space, num_envs)
        self.action_space = batch(self.single_action_space, num_envs)
        self._tables = Tables.empty(control, num_envs)
        self._seeds = np.full(num_envs, -1)  # negative: none yet
        self._trials = np.zeros(num_envs, int)  # to begin next
        self._pose = self._tables.measured  # last finite one on the table
        self._pushes = np.zeros(num_envs, int)
        self._troubles = np.zeros(num_envs, int)  # in a row
        self._is_over = np.ones(num_envs, bool)

    def reset(
        self,
        *,
        seed: int | np.integer | Sequence[int] | None = None,
        options: Mapping[str, object] | None = None,
    ) -> tuple[Observation, _Infos]:
        """Begin a trial in every environment.

        Args:
            seed: of the first environment; the others have the next ones. Or one seed
                for each. None: the next trials.
            options: there are none.

        Raises:
            BadInput: a seed or an option cannot be used.
        """
        if options:
            raise BadInput("options: a vector environment has none; leave them out.")
        if seed is None and self._seeds[0] < 0:
            seed = int(self.np_random.integers(2**31))
        if seed is not None:
            self._seeds, self._trials = _seeds(seed, self.num_envs), 0 * self._trials
            super().reset(seed=int(self._seeds[0]))
            self._tables.seed(self._seeds.tolist())
        self._begin(np.ones(self.num_envs, bool))
        return self._observation, self._infos()

    def step(
        self, actions: object
    ) -> tuple[Observation, Float[np.ndarray, " env"], _Each, _Each, _Infos]:
        """Push in every environment and observe the disks at rest.

        Raises:
            BadSetting: an action is outside the space; nothing was moved.
            ResetNeeded: `reset` was not called.
        """
        if self._seeds[0] < 0:
            raise gymnasium.error.ResetNeeded("Call `reset` before this.")
        pushes = self.task.actions.pushes(actions, (self.num_envs,))
        again = self._is_over
        trouble = self._tables.push(pushes)
        self._pushes += 1
        self._troubles = np.where(trouble, self._troubles + 1, 0)
        kept = is_on_table(self._tables.measured)
        self._pose = np.where(kept[:, None, None], self._tables.measured, self._pose)
        self._begin(again)
        away = distances(self._pose[:, self.task.target, :2], self._tables.goal)
        terminated = (away <= self.task.tolerance) & kept & ~again
        ended = (self._pushes >= self.config.pushes) | ~kept
        ended |= self._troubles >= MOST_TROUBLES
        truncated = ended & ~terminated & ~again
        self._is_over = terminated | truncated
        reward = np.where(again, 0, self.rewards(away))
        final = self._finish()
        return self._observation, reward, terminated, truncated, self._infos() | final

    @property
    def _observation(self) -> Observation:
        return observation_of(self._pose, self._tables.goal, self.task.target)

    def _begin(self, which: _Each) -> None:
        """Begin the next trial of some environments."""
        rows = np.flatnonzero(which)
        self._tables.begin(rows, self._seeds[rows], self._trials[rows])
        self._trials[rows] += 1
        self._pose = np.where(which[:, None, None], self._tables.measured, self._pose)
        self._pushes[rows] = self._troubles[rows] = 0
        self._is_over = self._is_over & ~which

    def _finish(self) -> _Infos:
        """Begin trials in the mode SAME_STEP; return how those before them ended."""
        over = self._is_over
        if self.metadata["autoreset_mode"] is _Mode.NEXT_STEP or not over.any():
            return {}
        each = gymnasium.vector.utils.iterate(self.observation_space, self._observation)
        seen = np.full(self.num_envs, None, object)
        seen[over] = np.fromiter(each, object)[over]
        final = {"final_obs": seen, "final_info": self._infos(over)}
        self._begin(over)
        return _masked(final, over)

    def _infos(self, which: _Each | None = None) -> _Infos:
        """Return success and distance of the true poses, each with its mask."""
        place = self._tables.pose[:, self.task.target, :2]
        away = distances(place, self._tables.goal)
        found = {"is_success": away <= self._tables.success_radius, "distance": away}
        return _masked(found, np.ones(len(away), bool) if which is None else which)


def _masked(found: Mapping[str, object], which: _Each) -> _Infos:
    """Return infos, each with the mask of the environments that it is about."""
    return {**found, **{f"_{name}": which.copy() for name in found}}


def _seeds(seed: int | np.integer | Sequence[int], count: int) -> np.ndarray:
    """Return one seed for each environment.

    Raises:
        BadInput: their number is another one, or a seed is no whole number from 0.
    """
    if not isinstance(seed, Sequence | np.ndarray):
        require_seed(seed)
        seed = range(int(seed), int(seed) + count)
    each = list(seed)
    if len(each) != count:
        raise BadInput(f"seed: {len(each)} seeds; give {count}, or one number.")
    for one in each:
        require_seed(one)
    return np.array(each, np.int64)
