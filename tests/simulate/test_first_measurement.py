"""What a law sees while its first measurement is still on its way: that one, not a
vehicle at the origin.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skyarm.algebra import Quaternion, Vec3
from skyarm.algebra.scalars import divide
from skyarm.dynamics.actuators import Command
from skyarm.plant.compiled import Steps
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import first_state
from skyarm.simulate import Delays, run
from skyarm.simulate.first_state import first_loop_state
from skyarm.simulate.loop import run_in_python
from skyarm.simulate.loop_state import InputRow
from skyarm.simulate.period import make_period
from skyarm.simulate.plant_steps import RigidBodySteps
from skyarm.simulate.stages import Stages

LATE = [0, 1, 3]
"""Control periods of 5 ms."""


def thrown(law, old, plant="rigid_body"):
    """High up, tilted, moving and turning, with the arm out: nothing that a blank
    measurement has.
    """
    base = load_scenario("case1", plant=plant, duration=0.05)
    start = dataclasses.replace(
        first_state(base),
        position=Vec3(0.4, -0.3, 50.0),
        quaternion=Quaternion(0.96, 0.28, 0.0, 0.0),
        velocity=Vec3(0.5, 0.2, -0.1),
        rate=Vec3(0.1, 0.2, 0.3),
        joints=(0.4, -0.2),
        rotor_speeds=(450.0,) * 4,
    )
    return dataclasses.replace(
        base,
        controller=dataclasses.replace(base.controller, law=law),
        delays=Delays(measurement=0.005 * old),
        initial=start,
    )


@pytest.mark.parametrize("old", LATE)
def test_until_the_first_measurement_has_arrived_the_law_sees_that_one(old):
    seen = []

    def listening(memory, measurement, reference, dt, *, par):
        del reference, dt, par
        seen.append(measurement)
        return memory, Command(rotor_speeds=(450.0,) * 4, efforts=(0.0, 0.0))

    scenario = thrown(listening, old)
    stages = Stages(scenario)
    period, carry = (
        make_period(stages, RigidBodySteps(stages, lambda _: Steps(1))),
        first_loop_state(scenario),
    )
    taken = []
    for k in range(7):
        carry, sample = period(
            carry, (InputRow(time=0.005 * k, reference=scenario.reference.at(0.0)),), ()
        )
        assert sample.alive == 1.0
        assert sample.agent.measurement == seen[k]
        taken.append(sample.agent.state)
    assert taken[0].position == first_state(scenario).position
    assert len({state.position for state in taken}) == 7
    assert [each.position for each in seen] == [
        taken[max(0, k - old)].position for k in range(7)
    ]
    assert [each.time for each in seen] == [0.005 * max(0, k - old) for k in range(7)]


def telling(memory, measurement, reference, dt, *, par):
    """Rotor speeds that tell the measured height, speed, tilt and joint; and the
    joint's rate, as an effort.
    """
    del reference, dt, par
    heard = (
        measurement.position.z,
        measurement.velocity.x,
        measurement.quaternion.x,
        measurement.joints[0],
    )
    speeds = tuple(440.0 + each for each in heard)
    return memory, Command(
        rotor_speeds=speeds, efforts=(divide(measurement.joint_rates[1], 1e3), 0.0)
    )


@pytest.mark.parametrize("old", LATE)
@pytest.mark.parametrize(
    ("fly", "plant"),
    [(run, "rigid_body"), (run_in_python, "rigid_body"), (run, "mujoco")],
    ids=["code", "py", "mujoco"],
)
def test_every_loop_hands_out_measurements_of_one_age_from_the_first_on(
    fly, plant, old
):
    if plant == "mujoco":
        pytest.importorskip("mujoco")
    log = fly(thrown(telling, old, plant))
    assert log.status == "completed"
    k = np.maximum(np.arange(len(log.time)) - old, 0)
    heard = [
        log.position[k, 2],
        log.velocity[k, 0],
        log.quaternion[k, 1],
        log.joints[k, 0],
    ]
    # 440 + 50: a rounding of 1e-13
    np.testing.assert_allclose(
        log.rotor_commands, 440.0 + np.stack(heard, axis=1), atol=1e-12
    )
    np.testing.assert_allclose(
        log.efforts[:, 0], log.joint_rates[k, 1] / 1e3, atol=1e-15
    )
