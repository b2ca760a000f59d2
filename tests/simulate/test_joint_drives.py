"""Joint drives: what they hold before the first command, what they remember, and what
acts after them.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.actuators.drive import Drive, TorqueDrive
from skyarm.dynamics.state import example_state
from skyarm.plant.interface import Truth
from skyarm.plant.surroundings import Surroundings
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import JointDrive, ScenarioError, trimmed_state
from skyarm.simulate import Delays, run
from skyarm.simulate.command_delay import drives_after
from skyarm.simulate.first_state import first_loop_state
from skyarm.simulate.loop import run_in_python
from skyarm.world import Fault
from support.components import Lag, Servo, same_logs, with_law
from support.one_vehicle import motion_of

BASE = load_scenario("case1", duration=0.1)


def driven(scenario=BASE, **drives: Any):
    return dataclasses.replace(
        scenario, drives=tuple(JointDrive(joint=j, drive=d) for j, d in drives.items())
    )


def out_arm(**fields: Any):
    """High up, the arm stretched out, so that gravity pulls on it."""
    start = trimmed_state(BASE.plant, Vec3(0.0, 0.0, 50.0), 0.0, (0.5, 0.3))
    return dataclasses.replace(BASE, initial=start, **fields), start


class Recorder:
    """Drive whose memory is the setpoint that it received last."""

    def advance(self, memory, setpoint, position, rate, dt):
        return setpoint


@pytest.mark.parametrize("late", [0.0, 0.0015, 0.005])
def test_a_drive_receives_the_mean_of_the_two_setpoints_of_a_period(late):
    """The oracle samples both on a clock a thousand times as fine."""
    period, count = 0.005, 1000
    before, after = (Command(rotor_speeds=(), efforts=(each,)) for each in (2.0, -1.0))
    now = (np.arange(count) + 0.5) * period / count
    received = drives_after(
        (Recorder(),), (0.0,), before, after, late, example_state(1, 0), period
    )
    assert received == pytest.approx([np.where(now < late, 2.0, -1.0).mean()])


@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
@pytest.mark.parametrize(
    "drive",
    [TorqueDrive(), Servo(), Servo(stiffness=0.1)],
    ids=["torque", "servo", "soft"],
)
def test_until_the_first_command_arrives_the_standing_setpoint_holds_the_arm(
    plant, drive
):
    scenario, start = out_arm(kind=plant, delays=Delays(command=0.02))
    log = run(driven(scenario, joint1=drive, joint2=drive))
    # an equilibrium: 20 ms without torque on the joints would move them by 1e-2 rad
    assert np.abs(log.joints[:5] - start.joints).max() < 1e-12
    assert np.abs(log.joints[8] - start.joints).max() > 1e-6, (
        "then the law's commands arrive"
    )


def test_the_standing_setpoint_is_the_drives_own():
    scenario, start = out_arm()
    torque = first_loop_state(scenario).agent.queue[0].efforts
    servo = (
        first_loop_state(driven(scenario, joint2=Servo(stiffness=5.0)))
        .agent.queue[0]
        .efforts
    )
    assert abs(torque[1]) > 0.01
    assert servo == (
        torque[0],
        pytest.approx(start.joints[1] + torque[1] / 5.0, rel=1e-15),
    )


@pytest.mark.parametrize(("torques", "told"), [(True, 0.3), (False, 0.1)])
def test_a_drive_that_states_no_setpoint_is_told_the_torque_or_else_the_position(
    torques, told
):
    class Own(Drive):
        takes_torque = torques

    assert Own().standing(0.3, 0.1) == told
    assert Own().setpoint((), 0.3, 0.1, 0.0, 0.005) == told


def test_a_drive_that_gives_its_setpoint_is_none():
    scenario, _ = out_arm()
    plain = run(scenario)
    assert same_logs(plain, run(driven(scenario, joint1=TorqueDrive())))
    assert same_logs(
        plain, run(driven(scenario, joint2=TorqueDrive(), joint1=TorqueDrive()))
    )
    assert not same_logs(plain, run(driven(scenario, joint1=Lag(lag=0.02))))


def stepping(
    memory: Any, measurement: Any, reference: Any, dt: Any, *, par: Any
) -> tuple[Any, Command]:
    """Setpoints of 0.02 N m and 0.01 N m that grow with time."""
    return memory, Command(
        rotor_speeds=(480.0,) * 4,
        efforts=(0.02 + measurement.time, 0.01 - measurement.time),
    )


@pytest.mark.parametrize("machine_code", [True, False])
@pytest.mark.parametrize("delay", [0.0, 0.010])
def test_a_drives_memory_follows_the_setpoints_that_act(machine_code, delay):
    """m + (u - m)(1 - exp(-dt/T)) by hand, once a period, under the command that acts
    in it.
    """
    late = round(delay * 200)
    scenario = dataclasses.replace(
        with_law(BASE, stepping), delays=Delays(command=delay)
    )
    flight = skyarm.Session(
        driven(scenario, joint2=Lag(lag=0.02)), machine_code=machine_code
    )
    standing = (
        first_loop_state(driven(scenario, joint2=Lag(lag=0.02)))
        .agent.queue[0]
        .efforts[1]
    )
    wanted = 0.0
    for k in range(10):
        assert flight.now.agent.drives[1][0] == pytest.approx(wanted, abs=1e-15)
        assert flight.now.agent.drives[0] == ()
        setpoint = 0.01 - (k - late) / 200 if k >= late else standing
        wanted += (setpoint - wanted) * (1.0 - math.exp(-0.005 / 0.02))
        flight.step()


def test_a_lag_without_lag_is_the_torque():
    """A time constant of a nanosecond: the memory is the setpoint before the plant
    moves.
    """
    scenario, _ = out_arm()
    quick, plain = (
        run(driven(scenario, joint1=Lag(lag=1e-9), joint2=Lag(lag=1e-9))),
        run(scenario),
    )
    assert np.abs(plain.efforts).max() > 0.01
    np.testing.assert_allclose(quick.joints, plain.joints, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
def test_a_servo_brings_its_joint_to_its_setpoint(plant):
    def law(
        memory: Any, measurement: Any, reference: Any, dt: Any, *, par: Any
    ) -> tuple[Any, Command]:
        return memory, Command(rotor_speeds=(480.0,) * 4, efforts=(0.3, -0.2))

    servo = Servo(stiffness=0.5, damping=0.02)
    scenario = dataclasses.replace(
        with_law(load_scenario("case1", duration=1.0), law), kind=plant, ground=False
    )
    log = run(driven(scenario, joint1=servo, joint2=servo))
    # what gravity and the falling base leave: below 1 % of the way
    np.testing.assert_allclose(log.joints[-1], [0.3, -0.2], atol=0.05)


def test_every_engine_drives_alike():
    # setpoints that grow: a memory that stays where it was would not show
    scenario = driven(with_law(BASE, stepping), joint1=Lag(), joint2=Servo())
    log = run(scenario)
    assert np.ptp(log.joints[:, 0]) > 1e-3
    assert same_logs(log, run_in_python(scenario))
    theirs = run(dataclasses.replace(scenario, kind="mujoco", integrator="euler"))
    ours = run(dataclasses.replace(scenario, integrator="euler"))
    np.testing.assert_allclose(ours.joints, theirs.joints, rtol=0.0, atol=1e-9)


def test_the_joints_own_limit_and_faults_act_on_what_the_drive_gives():
    """A stiff servo far from its setpoint pushes with the joint's limit; a dead one
    with nothing.
    """
    from skyarm.plant.loads import applied_force

    scenario, start = out_arm()
    vehicle = scenario.plant.vehicle
    joints = [
        dataclasses.replace(link.joint, effort_limit=0.25) for link in vehicle.links
    ]
    limited = dataclasses.replace(
        vehicle,
        links=tuple(
            dataclasses.replace(k, joint=j)
            for k, j in zip(vehicle.links, joints, strict=True)
        ),
    )
    stiff = Surroundings(
        drives=(Servo(stiffness=1e4), Servo(stiffness=0.1)), drive_memories=((), ())
    )
    _, torques = applied_force(
        motion_of(Truth(vehicle=limited), start, stiff),
        Command(efforts=(1.0, 1.0)),
        stiff,
    )
    assert torques[0] == 0.25
    assert torques[1] == pytest.approx(0.1 * (1.0 - 0.3), rel=1e-15)
    dead = Fault(joint="joint1", effectiveness=0.0, start=0.0)
    faulty = run(dataclasses.replace(driven(scenario, joint1=Servo()), faults=(dead,)))
    free, held = (
        run(driven(scenario, joint1=Servo(stiffness=k, damping=0.01 * k)))
        for k in (1e-12, 0.3)
    )
    np.testing.assert_allclose(faulty.joints, free.joints, rtol=0.0, atol=1e-9)
    assert np.abs(held.joints - free.joints).max() > 1e-3


@pytest.mark.parametrize(
    ("drives", "words"),
    [
        (
            {"elbow": Lag()},
            r"^drives: joint = 'elbow': must be one of joint1, joint2, once$",
        ),
        ({"joint1": 3.0}, r"^drives\.joint1 = 3\.0: must be a Drive$"),
    ],
)
def test_a_drive_of_no_joint_is_refused(drives, words):
    with pytest.raises(ScenarioError, match=words):
        run(driven(**drives))


def test_two_drives_of_one_joint_are_refused():
    twice = (
        JointDrive(joint="joint1", drive=Lag()),
        JointDrive(joint="joint1", drive=Servo()),
    )
    with pytest.raises(
        ScenarioError, match=r"joint = 'joint1': must be one of joint1, joint2, once"
    ):
        run(dataclasses.replace(BASE, drives=twice))


def test_a_drive_of_a_scenario_on_a_joint_without_torque_is_refused():
    world = BASE.plant
    links = list(world.vehicle.links)
    links[1] = dataclasses.replace(
        links[1], joint=dataclasses.replace(links[1].joint, effort_limit=0.0)
    )
    passive = dataclasses.replace(
        world, vehicle=dataclasses.replace(world.vehicle, links=tuple(links))
    )
    with pytest.raises(
        ScenarioError,
        match=(
            r"joints\[joint2\].effort_limit = 0: must be above 0.*plant.drives.joint2"
        ),
    ):
        run(driven(dataclasses.replace(BASE, plant=passive), joint2=Servo()))
