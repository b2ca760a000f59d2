"""Lanes for stable-baselines3: PPO("MlpPolicy", Lanes("skyarm/HoldTipInWind-v0", 64)).learn(100_000)."""

import gymnasium
import numpy as np
from stable_baselines3.common.vec_env import VecEnv

import skyarm.envs  # registers the tasks


class Lanes(VecEnv):
    def __init__(self, task, count):
        mode = {"vectorization_mode": "vector_entry_point", "autoreset_mode": "SameStep"}
        self.envs = gymnasium.make_vec(task, num_envs=count, **mode)
        super().__init__(count, self.envs.single_observation_space, self.envs.single_action_space)

    def reset(self):
        seeds, self._seeds = self._seeds, [None] * self.num_envs
        return self.envs.reset(seed=seeds)[0]

    def step_async(self, actions):
        self.actions = actions

    def step_wait(self):
        observations, rewards, ended, cut, found = self.envs.step(self.actions)
        infos = [{} for _ in range(self.num_envs)]
        for k in np.flatnonzero(ended | cut):
            infos[k] = {"terminal_observation": found["final_obs"][k], "TimeLimit.truncated": bool(cut[k] & ~ended[k])}
        return observations, rewards, ended | cut, infos

    def close(self):
        self.envs.close()

    def get_attr(self, name, indices=None):
        return [getattr(self.envs, name, None) for _ in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper, indices=None):
        return [False for _ in self._get_indices(indices)]

    set_attr = env_method = None  # nothing of one lane is another's
