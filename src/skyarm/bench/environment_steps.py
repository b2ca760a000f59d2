"""Vector environments as contenders: actions in, observations, rewards and flags out, in environment steps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from skyarm.bench.optional_simulators import installed
from skyarm.bench.timing import Contender

if TYPE_CHECKING:
    from skyarm.env.vector_environment import VectorEnvironment

WORLDS, STEPS = 1024, 64


def environments() -> list[Contender]:
    """Environments with drawn actions, whose episodes end and begin; none without Gymnasium."""
    if not installed("gymnasium"):
        return []
    from skyarm.env.named_tasks import make_vector
    from skyarm.env.vector_environment import VectorEnvironment

    windy = "the paper's Case 3 in wind"
    return [
        stepped(VectorEnvironment(WORLDS, scenario="case3_wind"), "env commands", f"{windy}, rotors and joints"),
        stepped(
            VectorEnvironment(WORLDS, scenario="case3_wind", actions="residual"),
            "env residual",
            f"{windy}, residual on the paper's law",
        ),
        stepped(make_vector(WORLDS, task="Hover"), "env no arm", "a quadrotor without an arm, starts drawn"),
    ]


def stepped(envs: VectorEnvironment, name: str, words: str) -> Contender:
    """Some steps of all worlds by drawn actions; it returns environment steps in place of simulated seconds."""
    shape = (STEPS, *(envs.action_space.shape or ()))
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, shape).astype(np.float32)
    envs.reset(seed=0)

    def run() -> float:
        for action in actions:
            envs.step(action)
        return float(envs.num_envs * STEPS)

    return Contender(name, f"{words}, f32, {envs.num_envs} worlds, 1 thread", run)
