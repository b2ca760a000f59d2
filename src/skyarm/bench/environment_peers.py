"""Environments of other libraries beside this library's, like for like, where those libraries are installed.

Each peer flies its own quadrotor without an arm. Beside it fly a quadrotor without an arm and one with a two-joint arm
of this library, with the same kind of action, the same control rate and the same number of integration steps a control
period. A single environment of a peer flies on past the end of its episode, so that its slow beginnings are not timed;
ours begins anew.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np

from skyarm.bench.environment_steps import STEPS, WORLDS, stepped
from skyarm.bench.optional_simulators import installed
from skyarm.bench.timing import Contender
from skyarm.scenario.scenario_file import scenario_from
from skyarm.scenario.scenario_record import Scenario

SINGLE_STEPS = 500
"""Steps a round of single environments."""

VEHICLES = {"no arm": "hummingbird", "two-joint arm": "hummingbird_arm2_rotors"}

STARTS = {
    **{f"initial.position.{axis}": {"uniform": [-1.0, 1.0]} for axis in "xy"},
    "initial.position.z": {"uniform": [1.0, 2.0]},
    **{f"initial.velocity.{axis}": {"uniform": [-1.0, 1.0]} for axis in "xyz"},
}
"""Beginnings of the vector environments, as crazyflow draws them."""


def peers() -> list[list[Contender]]:
    """A list for each installed peer: the peer, and ours beside it; nothing without Gymnasium.

    A peer of a version that has not the parts which are flown here counts as one that is not installed.
    """
    if not installed("gymnasium"):
        return []
    found = []
    for name, make in PEERS.items():
        if installed(name):
            with suppress(ImportError, AttributeError):
                found.append(make())
    return found


def beside_crazyflow() -> list[Contender]:
    """Vector environments at 500 Hz, one Euler step a control period, f32, drawn actions, episodes that begin anew.

    crazyflow's drones take angles and thrust, with its usual dynamics (a fitted second-order response of the angles,
    no rotors) and with its rigid body with rotors; ours take body rates and thrust, and fly rigid bodies with rotors.
    """
    import jax
    from crazyflow.dynamics import Dynamics
    from crazyflow.envs.reach_pos_env import ReachPosEnv

    wait: Any = jax.block_until_ready

    def flown(dynamics: Any) -> Contender:
        envs: Any = ReachPosEnv(num_envs=WORLDS, dynamics=dynamics)
        space = envs.single_action_space
        drawn = np.random.default_rng(0).uniform(space.low, space.high, (STEPS, WORLDS, *space.shape))
        actions = [jax.numpy.asarray(each, np.float32) for each in drawn]
        envs.reset(seed=0)

        def run() -> float:
            for action in actions:
                found = envs.step(action)
            wait(found[:4])
            return float(STEPS * WORLDS)

        return Contender(f"crazyflow {dynamics}", f"its position task, angles and thrust, f32, {WORLDS} worlds", run)

    return [*(flown(each) for each in (Dynamics.so_rpy, Dynamics.first_principles)), *_vectors(500)]


def beside_pyflyt() -> list[Contender]:
    """Single environments at 120 Hz, two integration steps a control period, body rates and thrust."""
    from PyFlyt.gym_envs.quadx_envs.quadx_hover_env import QuadXHoverEnv

    env: Any = QuadXHoverEnv(agent_hz=120, flight_dome_size=np.inf, max_duration_seconds=1e9)
    climbing = np.array([0.0, 0.0, 0.0, 0.6])
    name = "PyFlyt QuadX-Hover"
    return [_single(env, climbing, name, "rates and thrust"), *_singles(120, 240, "rates_and_thrust")]


def beside_pybullet_drones() -> list[Contender]:
    """Single environments at 30 Hz, eight integration steps a control period, speeds of the rotors."""
    from gym_pybullet_drones.envs.HoverAviary import HoverAviary
    from gym_pybullet_drones.utils.enums import ActionType

    env: Any = HoverAviary(act=ActionType.RPM, ctrl_freq=30, pyb_freq=240)
    hover = np.zeros(env.action_space.shape)
    name = "gym-pybullet-drones Hover"
    return [_single(env, hover, name, "speeds of rotors"), *_singles(30, 240, "rotors_and_joints")]


def place_to_reach(vehicle: str, control: int, physics: int, duration: float) -> Scenario:
    """A vehicle of the library that is to hold a place, by Euler steps."""
    table: dict[str, Any] = {
        "schema": 1,
        "name": "place_to_reach",
        "duration": duration,
        "rates": {"physics": physics, "control": control, "reference": control},
        "plant": {"vehicle": vehicle, "integrator": "euler"},
        "controller": {"law": "decoupled_pd"},
        "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 1.5]}},
    }
    if vehicle != VEHICLES["no arm"]:
        table["reference"]["joints"] = [0.0, 0.0]
    return scenario_from(table, "place_to_reach")


def _vectors(rate: int) -> list[Contender]:
    """Ours: many worlds, one integration step a control period, one thread."""
    from skyarm.env.vector_environment import VectorEnvironment

    found = []
    for words, vehicle in VEHICLES.items():
        envs = VectorEnvironment(
            WORLDS,
            scenario=place_to_reach(vehicle, rate, rate, 10.0),
            actions="rates_and_thrust",
            observation=("position_error", "attitude", "velocity_error", "body_rate"),
            reward=("position_near", "lost"),
            randomise=STARTS,
        )
        found.append(stepped(envs, f"ours, {words}", f"place to hold, rates and thrust, {rate} Hz"))
    return found


def _singles(control: int, physics: int, actions: str) -> list[Contender]:
    """Ours: one world, double precision."""
    from skyarm.env.single_environment import Environment

    found = []
    for words, vehicle in VEHICLES.items():
        scenario = place_to_reach(vehicle, control, physics, 60.0)
        env = Environment(scenario=scenario, actions=actions, precision="double", reward=("position_near", "lost"))
        action = np.zeros(env.action_space.shape or ())
        found.append(_single(env, action, f"ours, {words}", f"{actions}, f64", begins_anew=True))
    return found


def _single(env: Any, action: Any, name: str, words: str, *, begins_anew: bool = False) -> Contender:
    """Some steps of one world from Python."""
    env.reset(seed=0)

    def run() -> float:
        for _ in range(SINGLE_STEPS):
            *_, ended, truncated, _ = env.step(action)
            if begins_anew and (ended or truncated):
                env.reset()
        return float(SINGLE_STEPS)

    return Contender(name, f"single environment, {words}", run)


PEERS: dict[str, Callable[[], list[Contender]]] = {
    "crazyflow": beside_crazyflow,
    "PyFlyt": beside_pyflyt,
    "gym_pybullet_drones": beside_pybullet_drones,
}
"""Name of a library as it is imported -> its environment and ours beside it."""
