"""What a governor plans, judged by other lines than its own: second differences of what
is told, and those of check.
"""

import dataclasses
import functools
import math
from types import SimpleNamespace

import numpy as np
import pytest

import skyarm
from skyarm.dynamics.actuators.hover import highest_thrust
from skyarm.dynamics.actuators.motion_demand import MotionSamples
from skyarm.dynamics.actuators.servo import PositionServo
from skyarm.reference import Constant, Sine, Sum, Trajectory
from skyarm.reference.path_time import governed_reference
from skyarm.reference.signals import Product, Ramp, Signal, Windowed, sequence
from skyarm.scenario.in_flight import with_part
from skyarm.scenario.path_governor import GovernorOptions, PathLimits, _reasons_against
from skyarm.scenario.path_plan import Ceilings
from skyarm.scenario.path_plan import follow as law_of_time
from skyarm.scenario.scenario_checks import check_scenario
from skyarm.scenario.scenario_file import scenario_from
from skyarm.studies.assess.along_reference import follow
from skyarm.studies.assess.flight_loads import flight_parts
from skyarm.vehicle.vehicle_records import MountedDrive
from skyarm.world.contact.gripper import Command

DOCUMENT = {
    "name": "governed",
    "duration": 5.0,
    "plant": {"vehicle": "hummingbird_arm2_rotors"},
    "controller": {"preset": "paper_ct"},
    "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 2.0]}},
}
HOVER = scenario_from(DOCUMENT)
EASE = Ramp(start=0.5, duration=1.5, height=1.0, shape="quintic")


def eased(amplitude, frequency, phase=0.0):
    return Product(EASE, Sine(amplitude=amplitude, frequency_hz=frequency, phase=phase))


REST = Trajectory(z=Constant(2.0), joints=(Constant(0.0), Constant(0.0)))


def flight(duration=5.0, **signals):
    return dataclasses.replace(
        HOVER, reference=dataclasses.replace(REST, **signals), duration=duration
    )


CIRCLE = flight(x=eased(1.0, 1.0, math.pi / 2.0), y=eased(1.0, 1.0))
DROP = flight(z=Sum((Constant(2.0), eased(0.4, 1.2))))
SWING = flight(joints=(eased(1.0, 3.0), eased(1.0, 3.0, 0.9)))
CORNERS = flight(
    9.0,
    x=sequence(0.5, [(0.4, 1.0), (0.4, 1.0), (0.4, 0.0)]),
    y=sequence(0.5, [(0.4, 0.0), (0.4, 1.0), (0.4, 1.0)]),
)
OPTIONS = GovernorOptions()
PLANNED = {"circle": CIRCLE, "drop": DROP, "swing": SWING, "corners": CORNERS}


@functools.cache
def led(name):
    return skyarm.govern(PLANNED[name])


TIME = np.arange(0.05, 4.95, 0.005)


def accelerations(scenario):
    """(3, K) of the base as told, by second differences of where it is led."""
    h = 1e-3

    def position(t):
        return np.stack(
            [
                c + 0.0 * t
                for c in governed_reference(
                    scenario.reference, scenario.path_time, t
                ).position
            ]
        )

    return (position(TIME + h) - 2.0 * position(TIME) + position(TIME - h)) / h**2


@pytest.mark.parametrize("name", PLANNED)
def test_the_path_s_time_runs_forward_and_never_ahead(name):
    s, rate = led(name).path_time.derivatives(np.linspace(0.0, 5.0, 4000))[:2]
    assert abs(s[0]) < 1e-15
    assert np.diff(s).min() >= 0.0
    assert rate.min() > -1e-15
    assert rate.max() < 1.0 + 1e-6
    assert (s - np.linspace(0.0, 5.0, 4000)).max() < 1e-8
    assert s[-1] < 4.9


@pytest.mark.parametrize("name", ["circle", "drop", "swing"])
def test_what_is_told_keeps_thrust_and_tilt_that_the_command_does_not(name):
    vehicle = HOVER.plant.vehicle
    most = float(highest_thrust(vehicle)) / float(vehicle.mass)
    force = accelerations(led(name)) + np.array([[0.0], [0.0], [9.81]])
    size = np.linalg.norm(force, axis=0)
    assert size.max() < most * (1.0 - OPTIONS.reserve)
    assert np.arctan2(np.hypot(force[0], force[1]), force[2]).max() < OPTIONS.tilt
    # of the least thrust, the reserve's share of the weight is left
    assert force[2].min() > OPTIONS.reserve * 9.81


@pytest.mark.parametrize("name", ["circle", "drop", "swing"])
def test_rotors_and_joints_saturate_as_commanded_and_not_as_governed(name):
    def shares(scenario):
        demand, vehicle = follow(flight_parts(scenario)).demand, scenario.plant.vehicle
        top = np.array([float(rotor.max_speed) ** 2 for rotor in vehicle.rotors])[
            :, None
        ]
        limits = np.array([float(link.joint.effort_limit) for link in vehicle.links])[
            :, None
        ]
        return demand.squared / top, np.abs(demand.efforts) / limits

    asked, _ = shares(dataclasses.replace(led(name), path_time=None))
    assert asked.max() > 1.0 or asked.min() < 0.0
    rotors, joints = shares(led(name))
    assert rotors.max() < 1.0
    assert rotors.min() > 0.0
    assert joints.max() < 1.0


def test_a_climb_keeps_below_the_rotors_most():
    up = Ramp(start=0.4, duration=0.3, height=0.9, shape="quintic")
    climb = skyarm.govern(flight(2.0, z=Sum((Constant(1.0), up))), reserve=0.5)
    demand, most = (
        follow(flight_parts(climb)).demand,
        float(climb.plant.vehicle.rotors[0].max_speed) ** 2,
    )
    assert 0.4 * most < demand.squared.max() < 0.5 * most * 1.01


def test_joints_keep_their_efforts_and_servos_theirs():
    swing = flight(3.0, joints=SWING.reference.joints)
    weak = skyarm.with_numbers(
        swing, {"model.vehicle.links.link1.joint.effort_limit": 0.06}
    )
    efforts = np.abs(follow(flight_parts(skyarm.govern(weak))).demand.efforts[0])
    # the plan's attitude is smoother than this one's: that is what the reserve is for
    assert 0.035 < efforts.max() < 0.06
    vehicle = weak.controller.par.model.vehicle
    name = vehicle.links[0].joint.name
    drive = MountedDrive(
        name=name,
        drive=PositionServo(
            stiffness=5.0, inertia=0.01, torque_limit=0.04, speed_limit=1.5
        ),
    )
    model = dataclasses.replace(
        weak.controller.par.model, vehicle=dataclasses.replace(vehicle, drives=(drive,))
    )
    limits = PathLimits(unlimited(model), OPTIONS)
    fast, slow = (limits.shares(turning(vehicle, rate))[:, 0] for rate in (3.0, 0.02))
    speed, effort = (
        limits.names().index(f"{word} of joint {name!r}")
        for word in ("speed", "effort")
    )
    assert fast[speed] == pytest.approx(3.0 / 1.5)
    assert slow[effort] == pytest.approx(
        abs(effort_of(vehicle, 0.02)) / (0.04 * (1.0 - OPTIONS.reserve)), rel=1e-3
    )


def unlimited(model):
    """A belief in which nothing but the servo limits the first joint."""
    first, *others = model.vehicle.links
    first = dataclasses.replace(
        first, joint=dataclasses.replace(first.joint, effort_limit=math.inf)
    )
    return dataclasses.replace(
        model, vehicle=dataclasses.replace(model.vehicle, links=(first, *others))
    )


def turning(vehicle, rate):
    """A level base at rest while the first joint turns through its middle."""
    count = 9
    zeros = np.zeros((vehicle.n, count))
    rates = zeros.copy()
    rates[0] = rate
    return MotionSamples(
        time=np.arange(count) * 0.01,
        acceleration=np.zeros((3, count)),
        yaw=np.zeros(count),
        joints=zeros + 0.3,
        rates=rates,
        accelerations=zeros,
    )


def test_a_servo_beyond_its_no_load_speed_is_out_of_its_share_and_no_number_is_lost():
    model = HOVER.controller.par.model
    name = model.vehicle.links[0].joint.name
    motor = PositionServo(
        stiffness=5.0,
        inertia=1e-3,
        torque_constant=0.01,
        resistance=2.0,
        voltage=12.0,
        gear=100.0,
        current_limit=2.0,
    )
    vehicle = dataclasses.replace(
        model.vehicle, drives=(MountedDrive(name=name, drive=motor),)
    )
    limits = PathLimits(unlimited(dataclasses.replace(model, vehicle=vehicle)), OPTIONS)
    row = limits.names().index(f"effort of joint {name!r}")
    shares = limits.shares(turning(vehicle, 1.5 * 12.0 / (100.0 * 0.01)))[row]
    assert np.isfinite(shares).all()
    assert shares.min() > 1.0


def test_a_tip_that_an_upright_arm_holds_asks_for_more_tilt_than_its_base():
    model, count = HOVER.controller.par.model, 401
    time, zeros = np.arange(count) * 0.01, np.zeros((model.vehicle.n, count))
    surge, w = np.zeros((3, count)), 4.0
    surge[0] = 2.0 * np.sin(w * time)
    up = zeros.copy()
    up[0] = math.pi
    moved = MotionSamples(
        time=time,
        acceleration=surge,
        yaw=zeros[0],
        joints=up,
        rates=zeros,
        accelerations=zeros,
    )
    blunt = dataclasses.replace(
        model, vehicle=dataclasses.replace(model.vehicle, end_effector="")
    )
    middle = slice(100, 301)
    with_tip, without = (
        PathLimits(each, OPTIONS).shares(moved)[-2, middle].max()
        for each in (model, blunt)
    )
    # a base under a tip 0.3 m above it that stays where a level base has it: 1 + 0.3
    # w^2 / g of the acceleration
    assert with_tip / without == pytest.approx(1.0 + 0.3 * w**2 / 9.81, rel=0.15)


def effort_of(vehicle, rate):
    """Effort of the first joint there by the front of arrays, base level: what the
    arm's reaction tilts is left out.
    """
    speeds = np.zeros(6 + vehicle.n)
    speeds[6] = rate
    q, level = np.full(vehicle.n, 0.3), [1.0, 0.0, 0.0, 0.0]
    force = skyarm.inverse_dynamics(
        vehicle, np.zeros(3), level, q, speeds, np.zeros(6 + vehicle.n)
    )
    joint = vehicle.links[0].joint
    return (
        force[6]
        + float(joint.damping) * rate
        + float(joint.coulomb) * np.tanh(rate / float(joint.coulomb_rate))
    )


class Parabola(Signal):
    """At rest until 2 s, from then on at 6 m/s^2 for half a second, then as fast as it
    is.
    """

    def derivatives(self, t):
        u = np.clip(np.asarray(t) - 2.0, 0.0, 0.5)
        on = (np.asarray(t) >= 2.0) & (np.asarray(t) < 2.5)
        after = np.maximum(np.asarray(t) - 2.5, 0.0)
        return 3.0 * u * u + 3.0 * after, 6.0 * u, 6.0 * on, 0, 0

    def switch_times(self):
        return (2.0, 2.5)


def test_a_jump_of_the_acceleration_is_told_as_a_small_one():
    path = skyarm.govern(flight(3.0, x=Parabola())).path_time
    assert 0.1 < 6.0 * float(path.derivatives(path.instant_of(2.0))[1]) ** 2 < 1.0


def test_the_path_stands_still_at_a_corner_and_only_there():
    path = led("corners").path_time
    for corner in (0.5, 0.9, 1.3):
        when = path.instant_of(corner)
        s, *rates = path.derivatives(when + 0.1)
        assert abs(float(s) - corner) < 1e-12
        assert max(abs(float(rate)) for rate in rates) < 1e-6
    between = [path.instant_of(0.5 * (a + b)) for a, b in ((0.5, 0.9), (0.9, 1.3))]
    assert path.derivatives(np.array(between))[1].min() > 0.2


def test_a_feasible_reference_is_left_as_it_is():
    slow = flight(
        x=Ramp(start=0.5, duration=3.0, height=0.3, shape="quintic"),
        joints=(eased(0.2, 0.5), Constant(0.1)),
    )
    assert skyarm.govern(slow) == slow
    assert (
        scenario_from(
            DOCUMENT | {"reference": {**DOCUMENT["reference"], "governor": True}}
        )
        == HOVER
    )


def test_what_moves_at_once_sets_off_from_rest():
    path = skyarm.govern(flight(x=Sine(amplitude=0.3, frequency_hz=0.3))).path_time
    assert [float(each) for each in path.derivatives(0.0)] == [0.0] * 5


def test_less_tilt_is_kept_and_more_reserve_is_slower():
    round_ = skyarm.govern(
        flight(x=eased(1.0, 0.5, 0.5 * math.pi), y=eased(1.0, 0.5)), tilt=0.15
    )
    force = accelerations(round_) + np.array([[0.0], [0.0], [9.81]])
    tilt = np.arctan2(np.hypot(force[0], force[1]), force[2]).max()
    assert 0.12 < tilt < 0.151
    spared = skyarm.govern(DROP, reserve=0.5).path_time.derivatives(5.0)[0]
    assert spared < led("drop").path_time.derivatives(5.0)[0] - 0.3


def test_joints_keep_their_speed():
    path = skyarm.govern(SWING, joint_speed=2.0).path_time
    told = governed_reference(SWING.reference, path, TIME)
    assert max(np.abs(rate).max() for rate in told.joint_rates) < 2.01


@pytest.mark.parametrize(
    ("governor", "words"),
    [
        ({"reserve": 1.5}, "reference.governor.reserve = 1.5: must be at most 0.9"),
        ({"tilt": 0}, "reference.governor.tilt = 0: must be above 0"),
        ({"joint_speed": -1}, "reference.governor.joint_speed = -1: must be above 0"),
        (
            {"turning": "fast"},
            "reference.governor.turning = 'fast': must be a finite number",
        ),
        ({"speed": 1.0}, "allowed: reserve, tilt, turning, joint_speed"),
        ("yes", "reference.governor = 'yes': must be true, false or a table of limits"),
    ],
)
def test_wrong_limits_are_refused_in_one_line(governor, words):
    document = DOCUMENT | {"reference": {**DOCUMENT["reference"], "governor": governor}}
    with pytest.raises(skyarm.ScenarioError) as caught:
        scenario_from(document)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_cannot_be_planned_is_refused_in_one_line():
    for make, words in (
        (
            lambda: skyarm.govern(HOVER, speed=1.0),
            "speed: is no option of a governor; there are reserve, tilt",
        ),
        (lambda: skyarm.govern("case3"), "scenario = 'case3': must be a Scenario"),
        (
            lambda: check_scenario(dataclasses.replace(led("drop"), duration=9.0)),
            "was planned for 5.4 s, the flight lasts 9 s",
        ),
        (
            lambda: skyarm.with_numbers(led("drop"), {"reference.x.value": 1.0}),
            "must stay as it is where",
        ),
        (
            lambda: skyarm.with_numbers(led("drop"), {"model.gravity": 9.0}),
            "must stay as it is where",
        ),
        (
            lambda: skyarm.govern(
                flight(x=Ramp(start=0.0, duration=1.0, height=1e308))
            ),
            "not finite",
        ),
    ):
        with pytest.raises(skyarm.ScenarioError) as caught:
            make()
        assert words in str(caught.value)
        assert "\n" not in str(caught.value)


def test_a_file_is_planned_with_its_numbers():
    circle = {
        "kind": "circle",
        "radius": 1.0,
        "frequency_hz": 0.8,
        "center": [0.0, 0.0, 2.0],
    }
    weak = {f"model.vehicle.rotors.{i}.max_speed": 600.0 for i in range(4)}
    governed = {"reference": {"base": circle, "governor": True}}
    planned = scenario_from(DOCUMENT | governed | {"numbers": weak})
    twin = skyarm.govern(
        skyarm.with_numbers(
            scenario_from(DOCUMENT | {"reference": {"base": circle}}), weak
        )
    )
    strong = scenario_from(DOCUMENT | governed)
    assert planned.path_time == twin.path_time != strong.path_time
    assert planned.path_time is not None
    wide = scenario_from(
        DOCUMENT | governed | {"numbers": {"reference.base.radius": 2.0}}
    )
    assert wide.path_time != strong.path_time


def test_tasks_whose_instants_would_come_too_early_are_refused():
    waits = {"kind": "hold", "duration": 1.0, "until": {"error": 0.1}}
    task = {"kind": "phases", "position": [0.0, 0.0, 2.0], "phases": [waits]}
    with pytest.raises(
        skyarm.ScenarioError,
        match=r"reference\.governor: must be left out of .* wait \(until\)",
    ):
        scenario_from(DOCUMENT | {"reference": {"base": task, "governor": True}})
    pick = {"kind": "pick", "payload": "box", "position": [0.1, 0.0, 2.0], "dwell": 1.0}
    task = {"kind": "phases", "position": [0.0, 0.0, 2.0], "phases": [pick]}
    box = {"name": "box", "mass": 0.05}
    with pytest.raises(
        skyarm.ScenarioError,
        match=r"reference\.governor: must be left out of .* picks or places",
    ):
        scenario_from(
            DOCUMENT
            | {
                "reference": {"base": task, "governor": True},
                "payloads": [box],
            }
        )


def test_a_flight_that_takes_something_at_an_instant_is_not_governed():
    box = {"name": "box", "mass": 0.05, "pick": 1.0, "believed": True}
    told = scenario_from(DOCUMENT | {"payloads": [box]})
    with pytest.raises(
        skyarm.ScenarioError,
        match=r"reference\.governor: must be left out where the law's model",
    ):
        skyarm.govern(told)
    blind = scenario_from(DOCUMENT | {"payloads": [box | {"believed": False}]})
    assert skyarm.govern(blind).payloads == blind.payloads
    for closed, refused in (
        (Constant(1), False),
        (Windowed(Constant(1), 1.0, 2.0), True),
    ):
        hand = SimpleNamespace(name="hand", closed=Command(closed))
        steady = SimpleNamespace(guards=())
        flight = SimpleNamespace(
            duration=1.0,
            world=SimpleNamespace(grippers=(hand,)),
            changes=(),
            agent=SimpleNamespace(payloads=(), reference=steady),
        )
        reasons = (
            ["where gripper 'hand' closes or opens at an instant"] if refused else []
        )
        assert list(_reasons_against(flight, ())) == reasons


def test_a_reference_that_takes_another_s_place_is_governed_by_its_own_table():
    motion = {"kind": "sine", "amplitude": 0.5, "frequency_hz": 1.0}
    moving = {"base": {"kind": "signals", "z": 2.0, "x": motion}}
    governed_one = with_part(HOVER, "reference", moving | {"governor": {"tilt": 0.3}})
    assert governed_one.path_time is not None
    with pytest.raises(
        ValueError,
        match=(
            r"reference\.base = .*must stay as it is where the reference has a governor"
        ),
    ):
        with_part(
            governed_one,
            "reference.base",
            {"kind": "hover", "position": [0.0, 0.0, 1.0]},
        )
    assert with_part(governed_one, "reference", moving).path_time is None


def test_points_of_a_law_of_time_are_whole_nanoseconds_next_to_its_line():
    """It begins at the largest power of 0.93 below its bound, in steps of 0.2 s."""
    ceilings = Ceilings(duration=2.0)
    ceilings.rate[:] = 0.4
    points = np.array(law_of_time(ceilings, 2.0).points[:5])
    line = 0.2 * 0.93**13 * np.arange(-2, 3)
    assert np.abs(points - line).max() <= 0.5e-9 + 1e-15
    assert np.allclose(1e9 * points, np.rint(1e9 * points), rtol=0.0, atol=1e-6)
