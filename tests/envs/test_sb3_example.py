"""The example that hands lanes to stable-baselines3: its interface, and values of the
environment behind it.
"""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

pytestmark = pytest.mark.thorough
EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
TASK, COUNT = "skyarm/HoldTipInWind-v0", 3


def test_lanes_are_a_vector_environment_of_stable_baselines3(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    vectors = pytest.importorskip("stable_baselines3.common.vec_env.base_vec_env")
    monkeypatch.syspath_prepend(str(EXAMPLES))
    example: Any = importlib.import_module("lanes_for_sb3")
    lanes = example.Lanes(TASK, COUNT)
    assert isinstance(lanes, vectors.VecEnv)
    lanes.seed(7)
    beside = gymnasium.make_vec(
        TASK, num_envs=COUNT, vectorization_mode="vector_entry_point"
    )
    found, (expected, _) = lanes.reset(), beside.reset(seed=7)
    assert (found == expected).all()
    random, ended = np.random.default_rng(1), 0
    for _ in range(1200):
        actions = random.uniform(-1.0, 1.0, (COUNT, *lanes.action_space.shape))
        found, rewards, over, infos = lanes.step(actions.astype(np.float32))
        if not ended:  # the environment beside begins its next episodes one step later
            expected, gained, terminated, truncated, _ = beside.step(
                actions.astype(np.float32)
            )
            assert (rewards == gained).all()
            assert (over == (terminated | truncated)).all()
            for k in range(COUNT):
                assert ("terminal_observation" in infos[k]) == over[k]
                last = infos[k]["terminal_observation"] if over[k] else found[k]
                assert (last == expected[k]).all()
                assert not over[k] or infos[k]["TimeLimit.truncated"] == (
                    not terminated[k]
                )
        ended += int(over.sum())
    assert ended >= COUNT
    lanes.close()
