"""What an environment tells of force sensors and of the gripper's command is what a
session tells.
"""

from __future__ import annotations

import dataclasses

import pytest

pytest.importorskip("gymnasium", reason="needs the extra 'gym'")
import skyarm
from skyarm.envs import Observed
from skyarm.envs.env_program import EnvProgram
from skyarm.envs.env_task import make_task
from skyarm.simulate.program import NO_INPUTS, TracedPeriod

DOCUMENT = {
    "schema": 1,
    "name": "felt",
    "duration": 0.1,
    "rates": {"physics": 400, "control": 200, "reference": 50},
    "plant": {"vehicle": "hummingbird_arm2_rotors"},
    "model": {"vehicle": "hummingbird_arm2"},
    "controller": {"preset": "paper_ct"},
    "reference": {
        "base": {"kind": "hover", "position": [0.0, 0.0, 1.0]},
        # it closes in the third control period and opens in the eighth: no period of
        # the published reference
        "load": {"kind": "windowed", "signal": 1.0, "start": 0.01, "stop": 0.035},
    },
    "environment": {
        "forces": [{"kind": "disturbance", "frame": "tip", "force": [0.5, 0.0, 0.0]}]
    },
    "sensors": {"wrist": {"kind": "force_torque"}},
}


@dataclasses.dataclass(frozen=True, kw_only=True)
class Told(Observed):
    """The gripper's command, and what the force sensor at the tip reads."""

    def numbers(self, sight):
        return (*sight.reference.load, *sight.measurement.tip_force)


def test_force_sensors_and_the_grippers_command_are_those_of_a_session():
    planned, actions = (
        skyarm.scenario_from(DOCUMENT),
        skyarm.envs.RotorsAndJoints(span=1.0, joints=0.5),
    )
    program = EnvProgram(
        make_task(planned, actions=actions, observation=[Told()], reward=["alive"])
    )
    draws = (0.5,) * sum(count for _, count in program.uniforms)
    now, observed = program.start((), draws)
    session, closed = skyarm.Session(planned, machine_code=False), []
    command, action = (
        skyarm.Command(rotor_speeds=(0.0,) * 4, efforts=(0.0, 0.5)),
        (-1.0,) * 4 + (0.0, 1.0),
    )
    for _ in range(9):
        told = session.measurement.tip_force
        assert observed == pytest.approx((*session.reference.load, *told), abs=1e-9)
        closed.append(observed[0])
        session.step(command)
        stages = program._program.stages(((), action))
        plant = program._program.plant_steps(stages)
        now, outcome = program.step(
            TracedPeriod(stages, plant, ((), action), NO_INPUTS, draws), now
        )
        observed = outcome.observation
    assert closed == [0.0] * 2 + [1.0] * 5 + [0.0] * 2
    assert abs(observed[1]) < 0.499  # the arm has turned
