"""Flights of the centroidal law in machine code, and what they measure against the
continuous reference.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np

from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.log.tip_positions import level_tip, tip
from skyarm.records.leaves import leaves, rebuild
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import Delays, Scenario
from skyarm.sensing.measurement import SensorNoise
from skyarm.simulate.engine import EpisodeCode
from skyarm.simulate.inputs import episode_inputs

NOISE = SensorNoise(
    position=1e-3,
    velocity=1e-2,
    attitude=2e-3,
    rate=1e-2,
    joints=1e-3,
    joint_rates=1e-2,
)
PERIOD = 0.005


@dataclass(frozen=True)
class FlightErrors:
    """Of seeds x instants: mm, mrad; jitter in rad/s per period; memory after the last
    step of the first seed.
    """

    time: Any
    base: Any
    joint: Any
    tip: Any
    base_vector: Any
    tip_vector: Any
    joints: Any
    joints_d: Any
    quaternion: Any
    jitter: float
    memory: Any

    def mean(self, name: str, start: float = 10.0, stop: float = 20.0) -> float:
        at = (self.time >= start) & (self.time < stop)
        return float(getattr(self, name)[:, at].mean())


def planned(
    case: str, *, noisy: bool = False, mode: str = "joint", **options: Any
) -> Scenario:
    """A case of the paper flown by the centroidal law, with noise and its known delay
    if asked for.
    """
    loaded = load_scenario(case)
    law = make_centroidal(
        loaded.controller.par.model,
        mode=mode,
        delay=PERIOD if noisy else 0.0,
        **options,
    )
    changed = dataclasses.replace(loaded, controller=law, duration=20.0)
    if not noisy:
        return changed
    return dataclasses.replace(changed, noise=NOISE, delays=Delays(measurement=PERIOD))


def _table(record: Any, count: int) -> Any:
    columns = [np.broadcast_to(np.asarray(c, dtype=float), (count,)) for c in record]
    return np.stack(columns, axis=1) if columns else np.zeros((count, 0))


def fly(scenario: Scenario, seeds: int = 1) -> FlightErrors:
    """Fly the scenario with several draws of its noise; every episode must live to its
    end.
    """
    inputs = episode_inputs(scenario)
    traced = EpisodeCode(scenario, commands=False, effort=0)
    count, vehicle = scenario.steps, scenario.plant.vehicle
    rows = np.column_stack(
        [inputs.times, np.array(inputs.held_leaves, dtype=float).reshape(count, -1)]
    )
    start = np.array(leaves(traced.carry), dtype=float)
    kernel = Kernel(traced.loop, Lanes(seeds), logging=True)
    ended, logged = kernel.run(
        np.repeat(start[:, None], seeds, axis=1),
        np.zeros((0, seeds)),
        rows,
        seed=scenario.seed,
        episodes=np.arange(seeds),
    )
    goal = inputs.reference
    position_d, joints_d = _table(goal.position, count), _table(goal.joints, count)
    yaw = np.broadcast_to(np.asarray(goal.yaw, dtype=float), (count,))
    tip_d = level_tip(vehicle, position_d, yaw, joints_d)
    columns: dict[str, list[Any]] = {
        name: [] for name in ("position", "tip", "joints", "quaternion", "command")
    }
    for seed in range(seeds):
        sample = rebuild(traced.sample, iter(list(logged[:, :, seed].T)))
        assert np.all(np.asarray(sample.alive) > 0.5)
        sample = sample.agent
        position, quaternion = (
            _table(sample.state.position, count),
            _table(sample.state.quaternion, count),
        )
        joints = _table(sample.state.joints, count)
        columns["position"].append(position)
        columns["tip"].append(tip(vehicle, position, quaternion, joints))
        columns["joints"].append(joints)
        columns["quaternion"].append(quaternion)
        columns["command"].append(_table(sample.command.rotor_speeds, count))
    found = {name: np.array(values) for name, values in columns.items()}
    steady = inputs.times >= 0.5 * scenario.duration
    return FlightErrors(
        time=inputs.times,
        base=1e3 * np.linalg.norm(found["position"] - position_d, axis=2),
        joint=1e3 * np.linalg.norm(found["joints"] - joints_d, axis=2),
        tip=1e3 * np.linalg.norm(found["tip"] - tip_d, axis=2),
        base_vector=1e3 * (found["position"] - position_d),
        tip_vector=1e3 * (found["tip"] - tip_d),
        joints=found["joints"],
        joints_d=joints_d,
        quaternion=found["quaternion"],
        jitter=float(np.abs(np.diff(found["command"][:, steady], axis=1)).mean()),
        memory=rebuild(traced.carry, iter(ended[:, 0].tolist())).agent.memory,
    )
