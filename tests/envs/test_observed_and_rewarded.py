"""Each observed quantity and reward term beside a formula of its own, in NumPy; names,
units, bounds.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs the extra 'gym'")
import skyarm
from skyarm.dynamics.actuators.rotor import push
from skyarm.envs import OBSERVED, REWARDS, Result, Sight
from skyarm.envs.action_kinds import ACTIONS, Turn, middle_and_half
from skyarm.envs.env_program import LARGEST, EnvProgram, observation_of
from skyarm.envs.env_task import make_task
from skyarm.envs.named_tasks import NAMED, task_scenario
from skyarm.envs.randomised_numbers import _corners
from skyarm.records.units import units
from skyarm.scenario.scenario_file import scenario_from
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.sensing.measurement import Image
from skyarm.vehicle.thrust_table import ThrustTable
from support.flights import document

ROLL, YAW = 0.7, 0.4
"""rad, of base and reference."""

SIGHTED = skyarm.Measurement(
    time=0.0,
    position=[0.1, 0.2, 0.9],
    quaternion=[np.cos(ROLL / 2), np.sin(ROLL / 2), 0.0, 0.0],
    velocity=[1.0, -2.0, 0.5],
    rate=[0.5, -1.0, 2.0],
    specific_force=[0.1, 0.2, 9.8],
    joints=[0.3, -0.2],
    joint_rates=[1.0, -4.0],
    rotor_speeds=[400.0] * 4,
    images=(
        Image(
            time=0.0,
            depth=(0.2, 3.0, -np.inf, np.inf, np.nan),
            rows=1,
            columns=5,
            sensor="camera",
        ),
    ),
)
WANTED = skyarm.Reference(
    position=skyarm.Vec3(0.0, 0.5, 1.0),
    velocity=skyarm.Vec3(0.0, 1.0, 0.0),
    yaw=YAW,
    joints=(0.1, 0.1),
)
ERROR = np.array([-0.1, 0.3, 0.1])
LAST, BEFORE = (0.5, -0.5, 0.0, 1.0, 0.2, 0.0), (0.5, 0.5, 0.0, 0.0, 0.2, 0.0)


@pytest.fixture(scope="module")
def planned():
    return skyarm.load_scenario("case3")


def ball(position):
    return {
        "name": "target",
        "shape": "sphere",
        "size": [0.1],
        "position": [*map(float, position)],
    }


def of_tip(vehicle):
    """Wanted minus actual tip: the level arm's, turned by the matrices of the
    angles.
    """
    roll = np.array(
        [[1, 0, 0], [0, np.cos(ROLL), -np.sin(ROLL)], [0, np.sin(ROLL), np.cos(ROLL)]]
    )
    yaw = np.array(
        [[np.cos(YAW), -np.sin(YAW), 0], [np.sin(YAW), np.cos(YAW), 0], [0, 0, 1]]
    )
    tips = []
    for joints, R, position in (
        ((0.1, 0.1), yaw, (0.0, 0.5, 1.0)),
        ((0.3, -0.2), roll, (0.1, 0.2, 0.9)),
    ):
        level, _ = skyarm.frame_pose_world(
            vehicle, [0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], joints
        )
        tips.append(np.array(position) + R @ level)
    return tips[0] - tips[1]


def test_observed_quantities_are_what_they_say(planned):
    model = planned.controller.par.model
    sight = Sight(measurement=SIGHTED, reference=WANTED, action=LAST, model=model)
    c, s = np.cos(ROLL), np.sin(ROLL)
    expected = {
        "position_error": ERROR / 2.0,
        "velocity_error": np.array([-1.0, 3.0, -0.5]) / 2.0,
        "attitude": [1, 0, 0, 0, c, -s, 0, s, c],
        "body_rate": np.array([0.5, -1.0, 2.0]) / 2.0,
        "specific_force": np.array([0.1, 0.2, 9.8]) / 2.0,
        "joint_errors": np.array([-0.2, 0.3]) / 2.0,
        "joint_angles": np.array([0.3, -0.2]) / 2.0,
        "joint_rates": np.array([1.0, -4.0]) / 2.0,
        "tip_error": of_tip(model.vehicle) / 2.0,
        "last_action": LAST,
        "depth": [0.1, 1.0, 0.0, 1.0, 1.0],
    }
    assert set(expected) == set(OBSERVED)
    for name, wanted in expected.items():
        scaled = (
            {"scale": 2.0} if "scale" in OBSERVED[name].__dataclass_fields__ else {}
        )
        assert np.allclose(
            OBSERVED[name](**scaled).numbers(sight), wanted, atol=1e-12
        ), name


def test_reward_terms_are_what_they_say(planned):
    vehicle = planned.plant.vehicle
    state = skyarm.State(
        **{name: getattr(SIGHTED, name) for name in skyarm.State.__dataclass_fields__}
    )
    command = skyarm.Command(rotor_speeds=(400.0,) * 4, efforts=(0.0, 0.0))
    tip, base = np.linalg.norm(of_tip(vehicle)), np.linalg.norm(ERROR)
    target = np.array([0.5, 0.4, 0.3])
    world = {"surfaces": [ball(target)]}
    result = Result(
        scenario=scenario_from({**document("case3"), "world": world}),
        state=state,
        reference=WANTED,
        vehicle=vehicle,
        action=LAST,
        action_before=BEFORE,
        command=command,
        ended=1.0,
    )
    place, _ = skyarm.frame_pose_world(
        vehicle, SIGHTED.position, SIGHTED.quaternion, SIGHTED.joints
    )
    touch = np.linalg.norm(np.array([*place]) - target) - 0.1
    expected = {
        "tip_near": np.exp(-((tip / 2.0) ** 2)),
        "tip_distance": -tip / 2.0,
        "position_near": np.exp(-((base / 2.0) ** 2)),
        "position_distance": -base / 2.0,
        "surface_near": np.exp(-touch / 2.0),
        "upright": np.cos(ROLL),
        "spin": -5.25 / 4.0,
        "joint_distance": -np.mean([0.1**2, 0.15**2]),
        "action_size": -np.mean(np.square(LAST)),
        "action_change": -np.mean(np.subtract(LAST, BEFORE) ** 2),
        "alive": 0.0,
        "lost": -1.0,
    }
    assert set(expected) == set(REWARDS)
    for name, wanted in expected.items():
        scaled = {"scale": 2.0} if "scale" in REWARDS[name].__dataclass_fields__ else {}
        assert float(REWARDS[name](**scaled).value(result)) == pytest.approx(
            wanted, abs=1e-12
        ), name
    for axis, wanted in (
        ((1, 0, 0), np.cos(ROLL)),
        ((0, 1, 0), np.cos(ROLL)),
        ((0, 0, 1), 1.0),
    ):
        turned = (np.cos(ROLL / 2), *(np.sin(ROLL / 2) * each for each in axis))
        posed = dataclasses.replace(
            result,
            state=dataclasses.replace(state, quaternion=skyarm.Quaternion(*turned)),
        )
        assert float(REWARDS["upright"]().value(posed)) == pytest.approx(wanted)
    on_it = {"surfaces": [ball(place)]}
    touched = dataclasses.replace(
        result, scenario=scenario_from({**document("case3"), "world": on_it})
    )
    assert float(REWARDS["surface_near"]().value(touched)) == 1.0
    going = dataclasses.replace(result, ended=0.0)
    assert (REWARDS["alive"]().value(going), REWARDS["lost"]().value(going)) == (
        1.0,
        0.0,
    )


def test_a_surface_that_is_not_there_is_named(planned):
    world = {"surfaces": [ball([0.0, 0.0, 5.0])]}
    flown = scenario_from({**document("case3"), "world": world})
    words = "surface = 'targt': did you mean 'target'"
    with pytest.raises(ScenarioError, match=words):
        EnvProgram(make_task(flown, reward=[REWARDS["surface_near"](surface="targt")]))


def test_every_scale_has_a_unit_and_every_record_a_sentence():
    for kind in (*OBSERVED.values(), *REWARDS.values(), *ACTIONS.values()):
        assert kind.__doc__
        assert "dataclass" not in kind.__doc__
        numbers = set(kind.__dataclass_fields__)
        assert set(units(kind)) == numbers, kind


def test_an_observation_is_finite_whatever_was_measured(planned):
    task = make_task(planned, observation=("velocity_error", "joint_rates"))
    gone = dataclasses.replace(
        SIGHTED, velocity=skyarm.Vec3(np.nan, -np.inf, 3e9), joint_rates=(np.inf, 1.0)
    )
    sight = Sight(
        measurement=gone,
        reference=WANTED,
        action=LAST,
        model=planned.controller.par.model,
    )
    assert observation_of(task, sight) == (0.0, LARGEST, -LARGEST, LARGEST, 0.2)


def test_actions_stand_for_their_limits(planned):
    """At full action: shares of the hover speed and of the weight, the limits of rotors
    and joints.
    """
    par, told = planned.controller.par, (False, False)
    vehicle = par.model.vehicle
    hover = np.sqrt(
        float(vehicle.mass)
        * 9.81
        / sum(float(r.thrust_coefficient) for r in vehicle.rotors)
    )

    def command(kind, action, **numbers):
        def law(memory, measurement, reference):
            return memory, skyarm.Command(rotor_speeds=(hover,) * 4, efforts=(0.1, 0.2))

        level = dataclasses.replace(SIGHTED, rate=skyarm.Vec3(0.0, 0.0, 0.0))
        return ACTIONS[kind](**numbers).command(
            action, Turn((), level, WANTED, law, par, told)
        )[1]

    up = command("rotors_and_joints", (0.1,) * 4 + (1.0, -1.0), span=0.5, joints=0.3)
    assert up.rotor_speeds == pytest.approx([1.05 * hover] * 4, rel=0.02)
    assert up.efforts == (0.3, -0.3)
    top = command("rotors_and_joints", (1.0,) * 4 + (0.0, 0.0), span=5.0)
    assert top.rotor_speeds == tuple(float(r.max_speed) for r in vehicle.rotors)
    assert (
        command("rotors_and_joints", (-1.0,) * 4 + (0.0, 0.0), span=5.0).rotor_speeds
        == (0.0,) * 4
    )
    more = command("residual", (0.5,) * 4 + (1.0, 0.0), span=0.2, joints=0.3)
    assert more.rotor_speeds == pytest.approx([hover * 1.1] * 4, rel=0.02)
    assert more.efforts == pytest.approx([0.4, 0.2])
    thrust = command("rates_and_thrust", (0.0, 0.0, 0.0, 0.21, 0.0, 0.0), thrust=1.0)
    assert thrust.rotor_speeds == pytest.approx([1.1 * hover] * 4, rel=1e-6)
    turning = command(
        "rates_and_thrust", (0.0, 1.0, 0.0, 0.0, 0.0, 0.0), rate=0.5, bandwidth=10.0
    )
    squares = np.square(turning.rotor_speeds)
    pitch = sum(
        -float(r.position.x) * float(r.thrust_coefficient) * w
        for r, w in zip(vehicle.rotors, squares, strict=True)
    )
    assert pitch == pytest.approx(0.5 * 10.0 * float(vehicle.base.inertia.yy), rel=1e-6)


def test_a_displaced_reference_is_what_the_law_is_told(planned):
    told = {}

    def law(memory, measurement, reference):
        told["reference"] = reference
        return memory, skyarm.Command()

    action = (1.0, 0.0, -0.5, 1.0, -1.0)
    wanted = dataclasses.replace(WANTED, tip=(1.0, 2.0, 3.0))
    turn = Turn((), SIGHTED, wanted, law, planned.controller.par, ())
    ACTIONS["references"](position=0.2, angle=0.1).command(action, turn)
    found = told["reference"]
    assert [*found.position] == pytest.approx([0.2, 0.5, 0.9])
    assert found.joints == pytest.approx([0.2, 0.0])
    assert found.tip == pytest.approx([1.2, 2.0, 2.9])
    assert found.velocity == WANTED.velocity


def test_shipped_tasks_are_those_that_are_registered_and_can_be_made():
    import gymnasium

    for name, each in NAMED.items():
        assert f"skyarm/{name}-v0" in gymnasium.registry
        task = make_task(
            task_scenario(name),
            actions=each.actions,
            observation=each.observation,
            reward=each.reward,
            randomise=each.randomise,
        )
        assert task.scenario.name == each.file


@dataclasses.dataclass(frozen=True)
class Kept:
    """Memory of a law that keeps its command."""

    sent: skyarm.Command


def test_joints_keep_to_their_limits_and_a_law_is_told_what_was_sent(planned):
    par = planned.controller.par
    links = [
        dataclasses.replace(
            each,
            joint=dataclasses.replace(
                each.joint, effort_limit=0.4, lower=-0.7, upper=1.2
            ),
        )
        for each in par.model.vehicle.links
    ]
    vehicle = dataclasses.replace(par.model.vehicle, links=tuple(links))
    model = dataclasses.replace(par.model, vehicle=vehicle)
    own = skyarm.Command(rotor_speeds=(480.0,) * 4, efforts=(0.3, -0.1))

    def flown(kind, action, told):
        def law(memory, measurement, reference):
            return Kept(own), own

        asked = dataclasses.replace(par, model=model)
        return ACTIONS[kind]().command(
            (0.0,) * 4 + action, Turn(Kept(own), SIGHTED, WANTED, law, asked, told)
        )

    # a full action is the limit of the effort; where a drive takes setpoints, an end of
    # the range
    assert flown("rotors_and_joints", (1.0, -0.5), (False, True))[
        1
    ].efforts == pytest.approx((0.4, 0.25 - 0.95 / 2))
    for kind in ("rotors_and_joints", "rates_and_thrust"):
        assert flown(kind, (1.0, -1.0), (True, True))[1].efforts == pytest.approx(
            (1.2, -0.7)
        )
    memory, sent = flown("residual", (1.0, -0.5), (False, False))
    assert sent.efforts == pytest.approx((0.4, -0.3))
    assert memory.sent == sent
    # setpoints of a drive are not efforts
    assert flown("residual", (1.0, -0.5), (True, True))[1].efforts == pytest.approx(
        (0.3 + 0.95, -0.1 - 0.95 / 2)
    )


@pytest.mark.parametrize(
    ("lower", "upper", "ends"),
    [
        (0.0, 0.3, (0.0, 0.3)),
        (0.0, 2.0, (0.0, 2.0)),
        (0.2, np.inf, (0.2, 1.2)),
        (-np.inf, 0.3, (-0.7, 0.3)),
        (-np.inf, np.inf, (-0.5, 0.5)),
    ],
)
def test_a_drives_setpoints_go_from_end_to_end_of_the_joints_range(lower, upper, ends):
    middle, half = middle_and_half(lower, upper)
    assert (middle - half, middle + half) == pytest.approx(ends)


@pytest.mark.parametrize(("paths", "lanes"), [(1, 2), (6, 64), (7, 16)])
def test_ends_of_what_is_drawn_are_looked_at_together(paths, lanes):
    """All of them with each other, of many paths each end alone beside all others'
    other ends.
    """
    found = np.array(
        [*_corners({f"p{k}": (float(k), k + 0.5) for k in range(paths)}).values()]
    ).T
    high = found - np.arange(paths) == 0.5
    assert len(found) == len(np.unique(found, axis=0)) == lanes
    assert set(high.sum(axis=1)) == (
        set(range(7)) if paths == 6 else {0, 1, paths - 1, paths}
    )
    # messages name lanes of this order
    if paths > 6:
        assert high.sum(axis=1).tolist() == [0, paths, *[1, paths - 1] * paths]


def test_a_hover_starts_up_to_three_tenths_of_a_metre_around_its_place():
    drawn, place = (
        NAMED["Hover"].randomise,
        task_scenario("Hover").reference.at(0.0).position,
    )
    for axis, at in zip("xyz", place, strict=True):
        assert drawn[f"initial.position.{axis}"]["uniform"] == pytest.approx(
            [at - 0.3, at + 0.3], abs=1e-12
        )


def test_a_thrown_vehicle_has_any_heading():
    drawn = {
        path.removeprefix("initial."): each["uniform"]
        for path, each in NAMED["Recover"].randomise.items()
    }
    assert (drawn["roll"], drawn["yaw"]) == ([-np.pi, np.pi],) * 2
    assert drawn["pitch"] == [-np.pi / 2, np.pi / 2]


def test_a_rotor_with_a_table_turns_at_the_speed_of_its_thrust(planned):
    """At hover, of the arm at rest: a table whose thrust is no parabola."""
    par = planned.controller.par
    table = ThrustTable(speed=(200.0, 400.0, 600.0), thrust=(0.4, 1.6, 3.1))
    rotors = tuple(
        dataclasses.replace(each, table=table) for each in par.model.vehicle.rotors
    )
    vehicle = dataclasses.replace(par.model.vehicle, rotors=rotors)
    asked = dataclasses.replace(
        par, model=dataclasses.replace(par.model, vehicle=vehicle)
    )
    level = dataclasses.replace(SIGHTED, rate=skyarm.Vec3(0.0, 0.0, 0.0))
    arguments = (0.0,) * 6, (), level, WANTED, None, asked, (False, False)
    found = (
        ACTIONS["rates_and_thrust"]()
        .command(arguments[0], Turn(*arguments[1:]))[1]
        .rotor_speeds
    )
    thrust = sum(
        push(rotor, w) * rotor.thrust_coefficient
        for rotor, w in zip(rotors, found, strict=True)
    )
    assert float(thrust) == pytest.approx(float(vehicle.mass) * 9.81, rel=1e-6)
    assert found[0] != pytest.approx(
        np.sqrt(float(vehicle.mass) * 9.81 / 4 / float(rotors[0].thrust_coefficient))
    )


def test_the_rewards_of_shipped_tasks_are_those_that_policies_were_compared_by():
    """Published returns of a task are comparable as long as its weights stay."""
    weights = {
        name: {type(term).__name__: term.weight for term in task.reward}
        for name, task in NAMED.items()
    }
    assert weights["Hover"] == {
        "PositionNear": 1.0,
        "PositionDistance": 0.2,
        "Spin": 0.5,
        "ActionChange": 0.05,
        "Lost": 10.0,
    }
    assert weights["Recover"] == {
        "Upright": 1.0,
        "PositionDistance": 0.1,
        "Spin": 0.5,
        "Alive": 0.1,
        "Lost": 10.0,
    }
    seeing = weights["ReachWhatTheWristSees"]
    assert (seeing["ActionChange"], seeing["Lost"]) == (0.05, 10.0)
