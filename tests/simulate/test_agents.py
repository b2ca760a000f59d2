"""Flights of several agents: each as if it flew alone where nothing joins them, and
what they share.
"""

from __future__ import annotations

import dataclasses
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.log.formats import load_log
from skyarm.plant.interface import make_plant
from skyarm.records.leaves import leaves
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_record import Delays, NamedSensor, Scenario, ScenarioError
from skyarm.simulate.first_state import first_loop_state, first_surroundings
from skyarm.simulate.loop import run_in_python
from skyarm.world.component import Component, Wrench
from support.flights import document, estimated
from support.teams import TEAMS, team, with_world

ARRAYS = (
    "position",
    "quaternion",
    "velocity",
    "rate",
    "joints",
    "joint_rates",
    "rotor_speeds",
    "efforts",
)


def two(**options: Any) -> Scenario:
    """Two vehicles with arms in one scenario, which nothing joins: those of two shipped
    scenarios.
    """
    one, other = (
        skyarm.load_scenario(name, duration=0.5) for name in ("case1", "case3")
    )
    agents = {"left": one.agent, "right": dataclasses.replace(other.agent, **options)}
    return dataclasses.replace(one, agents=agents)


def assert_same(log: Any, other: Any, arrays: tuple[str, ...] = ARRAYS) -> None:
    """Logs of one vehicle with the same bits."""
    for array in arrays:
        np.testing.assert_array_equal(log[array], other[array], err_msg=array)


def alone(scenario: Scenario, name: str) -> Scenario:
    """Scenario of one of several vehicles that are not joined, as if there were no
    others.
    """
    return dataclasses.replace(scenario.of(name), agents={name: scenario.agents[name]})


NIGHTLY = pytest.mark.thorough

ON_TIME, LATE = Delays(), Delays(measurement=0.005, command=0.003)
APART = Delays(command=0.002, rotors=0.004, joints=0.001)


@pytest.mark.parametrize(
    ("plant", "delays"),
    [
        pytest.param("rigid_body", ON_TIME, id="rigid_body-none"),
        pytest.param("rigid_body", LATE, id="rigid_body-late", marks=NIGHTLY),
        pytest.param("rigid_body", APART, id="rigid_body-apart"),
        pytest.param("mujoco", ON_TIME, id="mujoco-none", marks=NIGHTLY),
        pytest.param("mujoco", LATE, id="mujoco-late"),
        pytest.param("mujoco", APART, id="mujoco-apart", marks=NIGHTLY),
    ],
)
def test_agents_that_nothing_joins_fly_as_if_alone(plant: str, delays: Delays) -> None:
    both = two(delays=delays).with_kind(plant)
    log = skyarm.run(both)
    for name in ("left", "right"):
        own = skyarm.run(alone(both, name))
        if plant == "mujoco" or delays == Delays():
            assert_same(log.agents[name], own)
        else:  # commands of both divide the steps of each
            np.testing.assert_allclose(
                log.agents[name].position, own.position, rtol=0, atol=1e-7
            )


@dataclasses.dataclass(frozen=True)
class Shaking(Component[Any]):
    """Random force on the base and loss of rotor speed, and drag in the air, of each
    agent by itself.
    """

    size: float = 0.5
    uniforms = 3

    def start(self, period: float, draws: Any) -> Any:
        """Force from the first half of the draws."""
        return tuple(2.0 * draw - 1.0 for draw in draws[:3])

    def advance(self, memory: Any, t: Any, dt: float, state: Any, draws: Any) -> Any:
        """Force that follows the draws with a lag."""
        return tuple(
            0.8 * held + 0.2 * (2.0 * draw - 1.0)
            for held, draw in zip(memory, draws, strict=True)
        )

    def wrenches(
        self, memory: Any, t: Any, motion: Any, rotor_speeds: Any
    ) -> list[Wrench]:
        """Force on the base."""
        return [
            Wrench(force_W=Vec3(*memory) * self.size + motion.air_velocity() * 0.02)
        ]

    def rotor_commands(self, memory: Any, rotors: Any, commands: Any) -> Any:
        """Speeds that lose a few percent at random."""
        return tuple(command * (0.98 + 0.02 * memory[0]) for command in commands)


def rich() -> Scenario:
    """Two vehicles in turbulent wind, each with a load, a fault, noisy sensors and an
    estimator of its own.
    """
    one, other = (
        skyarm.load_scenario(name, duration=0.4) for name in ("case1", "case3")
    )
    flown, wind = (
        estimated(duration=0.4),
        skyarm.scenario_from(document("everything")).wind,
    )

    def equipped(agent: Any, mass: float, fault: skyarm.Fault, **more: Any) -> Any:
        load = skyarm.TimedPayload(name="load", mass=mass, pick=0.05, drop=0.3)
        noise = dataclasses.replace(agent.noise, position=0.002, rate=0.01)
        return dataclasses.replace(
            agent, payloads=(load,), noise=noise, faults=(fault,), **more
        )

    vehicle = one.agent.plant.vehicle
    weak = skyarm.Fault(rotor=vehicle.rotors[1].name, effectiveness=0.9, start=0.1)
    stuck = skyarm.Fault(joint=vehicle.links[1].joint.name, stuck=True, start=0.15)
    sensed = flown.agent.sensors
    left = equipped(
        one.agent, 0.02, weak, sensors=sensed, estimator=flown.agent.estimator
    )
    right = equipped(other.agent, 0.05, stuck, sensors=sensed[:2])
    air = dataclasses.replace(other.environment, wind=wind, forces=(Shaking(),))
    return dataclasses.replace(
        one, environment=air, agents={"left": left, "right": right}
    )


RICH = (*ARRAYS, "wind_force", "air_velocity", "measured_position", "measured_joints")


@pytest.mark.parametrize("plant", ["rigid_body", pytest.param("mujoco", marks=NIGHTLY)])
def test_loads_faults_wind_sensors_and_estimators_are_of_each_agent_alone(
    plant: str,
) -> None:
    both = rich().with_kind(plant)
    log = skyarm.run(both)
    for name, pair in log.agents.items():
        own = skyarm.run(alone(both, name))
        for array in RICH:  # MuJoCo sums over both trees, in another order
            np.testing.assert_allclose(
                pair[array],
                own[array],
                rtol=0,
                atol=0 if plant == "rigid_body" else 1e-9,
            )
        assert pair.readings.keys() == own.readings.keys()
        for key, readings in pair.readings["imu"].items():
            np.testing.assert_allclose(
                readings, own.readings["imu"][key], rtol=0, atol=1e-7
            )
    assert (
        np.abs(log.agents["left"].air_velocity - log.agents["right"].air_velocity).max()
        > 1e-3
    )


def test_equal_agents_have_noise_wind_and_forces_of_their_own() -> None:
    both = rich()
    twin = dataclasses.replace(both.agents["right"], faults=(), payloads=())
    log = skyarm.run(dataclasses.replace(both, agents={"left": twin, "right": twin}))
    left, right = log.agents.values()
    for name in ("measured_position", "air_velocity"):
        noise = [each[name][:2] - each.position[:2] for each in (left, right)]
        assert np.abs(noise[0] - noise[1]).max() > 1e-4, name
    first = [
        {key: value[0] for key, value in each.readings["imu"].items()}
        for each in (left, right)
    ]
    assert any(np.abs(first[0][key] - first[1][key]).max() > 1e-3 for key in first[0])
    calm = dataclasses.replace(
        both.environment, wind=skyarm.load_scenario("case1").wind
    )
    log = skyarm.run(
        dataclasses.replace(
            both, environment=calm, agents={"left": twin, "right": twin}, duration=0.02
        )
    )
    left, right = log.agents.values()
    assert np.abs(left.wind_force[0] - right.wind_force[0]).max() > 1e-3
    assert np.abs(left.wind_force[-1] - right.wind_force[-1]).max() > 1e-3


def test_python_floats_fly_the_bits_of_machine_code() -> None:
    both = team("bar", duration=0.1)
    ours, theirs = skyarm.run(both), run_in_python(both)
    for name in ("left", "right"):
        assert_same(ours.agents[name], theirs.agents[name])
    np.testing.assert_array_equal(ours.object_position, theirs.object_position)


def test_the_only_agent_of_a_team_is_that_of_a_scenario_without_names() -> None:
    one = skyarm.load_scenario("case3", duration=0.5)
    solo = dataclasses.replace(one, agents={"solo": one.agent})
    assert_same(skyarm.run(solo), skyarm.run(one))


def test_noise_of_an_agent_follows_from_its_name() -> None:
    one = skyarm.load_scenario("case3", duration=0.2)
    noise = dataclasses.replace(one.agent.noise, position=0.01)
    noisy = dataclasses.replace(one.agent, noise=noise)
    pair = skyarm.run(dataclasses.replace(one, agents={"main": noisy, "other": noisy}))
    main = skyarm.run(dataclasses.replace(one, agents={"main": noisy}))
    # an agent beside it changes no other's draws
    assert_same(pair.agents["main"], main)
    measured = {
        name: each.measured_position - each.position
        for name, each in pair.agents.items()
    }
    assert 0.005 < measured["other"].std() < 0.02
    assert (
        abs(np.corrcoef(measured["main"].ravel(), measured["other"].ravel())[0, 1])
        < 0.25
    )


def test_a_changed_number_of_one_agent_is_of_that_one_alone() -> None:
    both = two()
    session = skyarm.Session(both)
    session.fly(40)
    before = session.snapshot()
    session.change({"agents.right.plant.payload.mass": 0.1})
    log = session.run()
    assert_same(log.agents["left"], skyarm.run(alone(both, "left")))
    unchanged = skyarm.run(both).agents["right"]
    assert np.abs(log.agents["right"].position - unchanged.position).max() > 1e-3
    again = skyarm.run(session.plan)
    assert_same(again.agents["right"], log.agents["right"])
    session.restore(before)
    assert_same(session.run().agents["right"], unchanged)
    with pytest.raises(
        ScenarioError,
        match=r"^path = 'plant.gravity': is of one agent, must be agents.NAME.plant",
    ):
        skyarm.Session(both).change({"plant.gravity": 9.0})


def test_the_end_of_a_flight_names_the_agent_that_ended_it() -> None:
    both = two()
    falling = dataclasses.replace(
        both,
        environment=dataclasses.replace(both.environment, ground=True),
        duration=3.0,
    )
    log = skyarm.run(with_numbers(falling, {"agents.right.plant.payload.mass": 2.0}))
    assert log.status == "ground"
    assert log.info["cause"].startswith("right: ")
    assert log.agents["left"].status == "ground"
    assert log.agents["left"].time.size == log.time.size


def test_a_log_of_several_agents_is_read_as_it_was_written(tmp_path: Path) -> None:
    flown = team("bar", duration=0.1)
    log = skyarm.run(flown)
    log.save_npz(tmp_path / "team.npz")
    read = load_log(tmp_path / "team.npz")
    assert list(read.agents) == ["left", "right"]
    assert read.arrays().keys() == log.arrays().keys()
    for name, array in log.arrays().items():
        np.testing.assert_array_equal(read[name], array)
    assert read.scenario == flown
    assert_same(skyarm.replay(read).agents["left"], log.agents["left"])
    with pytest.raises(
        ValueError,
        match=(
            r"^log.position: is of one agent; log.agents\[NAME\].position, of left,"
            r" right$"
        ),
    ):
        read.position  # noqa: B018
    log.save_csv(tmp_path / "team.csv")
    heads = (tmp_path / "team.csv").read_text("utf-8").split("\n")[0].split(",")
    assert heads[:2] == ["time [s]", "left_position_x [m]"]
    assert heads.count("object_position_bar_x [m]") == 1


def test_a_whole_scenario_flies_and_not_one_agent_of_it() -> None:
    both = team("bar", duration=0.1)
    with pytest.raises(
        ScenarioError, match=r"^agents = left: flies beside right; fly all$"
    ):
        skyarm.run(both.of("left"))
    with pytest.raises(
        ScenarioError, match=r"^agents = left, right: must be one here; scenario\.of"
    ):
        both.plant  # noqa: B018
    with pytest.raises(
        ScenarioError, match=r"^agents = 'nobody': must be one of left, right$"
    ):
        both.of("nobody")


@dataclasses.dataclass(frozen=True)
class Rubber(Component[tuple[()]]):
    """Elastic cord between the bases of two agents."""

    stiffness: float = 5.0
    shared = True

    def wrenches(
        self, memory: Any, t: Any, motion: Any, rotor_speeds: Any
    ) -> list[Wrench]:
        """Pull of the cord on both."""
        apart = motion.agents["right"].position() - motion.agents["left"].position()
        return [
            Wrench(force_W=apart * self.stiffness, agent="left"),
            Wrench(force_W=apart * -self.stiffness, agent="right"),
        ]


@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
def test_a_force_of_ones_own_sees_all_agents_and_acts_on_each_by_name(
    plant: str,
) -> None:
    both = team("bar", duration=1.0).with_kind(plant)
    joined = dataclasses.replace(both.environment, world=None, forces=(Rubber(),))
    log = skyarm.run(dataclasses.replace(both, environment=joined))
    pulls = {name: each.wind_force[0] for name, each in log.agents.items()}
    assert pulls["left"] == pytest.approx([0.0, -0.38 * 5.0, 0.0])
    assert pulls["right"] == pytest.approx([0.0, 0.38 * 5.0, 0.0])
    lean = {name: each.position[-1, 1] for name, each in log.agents.items()}
    assert lean["left"] == pytest.approx(-lean["right"], abs=1e-9)
    wrong = dataclasses.replace(joined, forces=(Wrong(),))
    with pytest.raises(
        ScenarioError,
        match=r"gives a wrench on agent 'middle': must be one of left, right$",
    ):
        skyarm.run(dataclasses.replace(both, environment=wrong))


@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
def test_a_plant_refuses_a_wrench_on_an_agent_that_is_not_there(plant: str) -> None:
    both = team("bar", duration=0.1).with_kind(plant)
    wrong = dataclasses.replace(
        both,
        environment=dataclasses.replace(
            both.environment, world=None, forces=(Wrong(),)
        ),
    )
    around = first_surroundings(wrong, first_loop_state(wrong))
    state, command = (
        (tuple(leaves(first_loop_state(wrong).agents[i].state)) for i in (0, 1)),
        (0.0,) * 8,
    )
    with pytest.raises(
        ValueError,
        match=r"^Wrong\.wrenches: agent = 'middle': must be one of left, right$",
    ):
        make_plant(wrong, around).advance(
            tuple(c for each in state for c in each), command, leaves(around), 0.005
        )


class Wrong(Rubber):
    """Force on an agent that is not there."""

    def wrenches(
        self, memory: Any, t: Any, motion: Any, rotor_speeds: Any
    ) -> list[Wrench]:
        """Push on nobody."""
        return [Wrench(force_W=Vec3(1.0, 0.0, 0.0), agent="middle")]


@pytest.mark.thorough
def test_sensors_of_two_agents_are_read_by_their_own_names() -> None:
    both = two()
    imu = skyarm.load_scenario("hover_swing").agent.sensors[0].sensor
    agents = {
        name: dataclasses.replace(each, sensors=(NamedSensor(name="own", sensor=imu),))
        for name, each in both.agents.items()
    }
    log = skyarm.run(dataclasses.replace(both, agents=agents))
    left, right = (each.readings["own"] for each in log.agents.values())
    assert left.keys() == right.keys()
    assert any(not np.array_equal(left[key], right[key]) for key in left)


@pytest.mark.parametrize("machine_code", [True, pytest.param(False, marks=NIGHTLY)])
def test_commands_of_one_vehicle_leave_the_others_under_their_laws(
    machine_code: bool,
) -> None:
    scenario = team("bar", duration=0.05)
    by_laws = skyarm.run(scenario)
    session = skyarm.Session(scenario, machine_code=machine_code)
    begun = session.snapshot()
    for rotors in (False, True):
        session.restore(begun)
        for row in by_laws.agents["left"].rotor_commands:
            own = tuple(map(float, row))
            if rotors:
                session.step(rotors={"left": own})
            else:
                session.step({"left": skyarm.Command(rotor_speeds=own, efforts=())})
        for name, log in session.log.agents.items():
            assert_same(
                log,
                by_laws.agents[name],
                ("position", "rotor_speeds", "rotor_commands"),
            )
    session.restore(begun)
    still = skyarm.Command(rotor_speeds=(0.0,) * 4, efforts=())
    session.step({"right": still})
    session.step()
    left, right = session.log.agents.values()
    assert (left.rotor_commands > 0.0).all()
    assert (right.rotor_commands[0] == 0.0).all()
    assert (right.rotor_commands[1] > 0.0).all()


def test_what_a_session_of_several_vehicles_has_not_is_one_line() -> None:
    session = skyarm.Session(team("bar", duration=0.05))
    for word in ("state", "measurement", "reference", "wind"):
        with pytest.raises(
            ScenarioError,
            match=(
                rf"^session\.{word}: is of one agent; session\.now\.agents is of left,"
                r" right$"
            ),
        ):
            getattr(session, word)
    command = skyarm.Command(rotor_speeds=(0.0,) * 4, efforts=())
    with pytest.raises(
        ScenarioError,
        match=r"^command = Command.*: must be a table by agent, of left, right$",
    ):
        session.step(command)
    with pytest.raises(
        ScenarioError,
        match=r"^rotors = \{'middle': .*\}: must be a table by agent, of left, right$",
    ):
        session.step(rotors={"middle": (0.0,) * 4})
    with pytest.raises(ScenarioError, match=r"^left: command = 3: must be a Command$"):
        session.step({"left": 3})
    least = (400.0, 400.0, -1.0, 400.0)
    joints = len(session.scenario.agents["right"].vehicle.joints)
    backwards = skyarm.Command(rotor_speeds=least, efforts=(0.0,) * joints)
    with pytest.raises(
        ScenarioError,
        match=r"^right: command\.rotor_speeds\[2\] = -1\.0: must be from 0 to ",
    ):
        session.step({"right": backwards})
    with pytest.raises(
        ScenarioError, match=r"^right: rotors\[2\] = -1\.0: must be from 0 to "
    ):
        session.step(rotors={"left": (400.0,) * 4, "right": least})
    assert session.tick == 0


def test_a_team_of_one_keeps_its_name_in_the_log(tmp_path: Path) -> None:
    both = team("bar", duration=0.1)
    one = dataclasses.replace(
        with_world(both, objects=(), grasps=()), agents={"left": both.agents["left"]}
    )
    log = skyarm.run(
        dataclasses.replace(
            one, environment=dataclasses.replace(one.environment, world=None)
        )
    )
    assert [*log.agents] == ["left"]
    skyarm.save_log(log, tmp_path / "one.npz")
    assert [*skyarm.load_log(tmp_path / "one.npz").agents] == ["left"]


def test_agents_that_are_not_there_are_named_with_those_that_are() -> None:
    log = skyarm.run(team("bar", duration=0.05))
    for agents in (log.agents, team("bar").agents):
        with pytest.raises(KeyError, match="lft: must be one of left, right"):
            agents["lft"]


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (("left", "Left"), "must differ from other names"),
        (("left", "\u00e9"), "a to z"),
    ],
)
def test_names_of_agents_that_files_cannot_tell_apart_are_refused(
    names: tuple[str, str], words: str
) -> None:
    both = team("bar")
    with pytest.raises(ValueError, match=words):
        dataclasses.replace(
            both, agents=dict(zip(names, both.agents.values(), strict=True))
        )


def test_a_file_whose_vehicles_stand_below_agents_alone_is_a_scenario(
    tmp_path: Path,
) -> None:
    from skyarm.scenario.scenario_file import kind_of_file

    text = (
        (TEAMS / "bar.toml")
        .read_text("utf-8")
        .replace("[plant]", "[agents.left.plant]")
    )
    (tmp_path / "apart.toml").write_text(
        text.replace("[controller]", "[agents.left.controller]"), "utf-8"
    )
    assert kind_of_file(str(tmp_path / "apart.toml")) == "scenario"


def test_a_gripper_tells_its_own_vehicle_alone_that_it_holds() -> None:
    scenario = skyarm.load_scenario("pick_and_carry")
    assert scenario.world is not None
    (magnet,) = scenario.world.grippers
    world = dataclasses.replace(
        scenario.world, grippers=(dataclasses.replace(magnet, agent="right"),)
    )
    memory = world.start(0.0, ())
    tip = scenario.agent.plant.vehicle.end_effector
    assert [
        len(list(world.holds(memory, tip, name))) for name in ("left", "right")
    ] == [0, 1]


def test_the_gripper_of_another_vehicle_tells_a_law_of_no_load() -> None:
    tables = tomllib.loads((TEAMS / "bar.toml").read_text("utf-8"))
    tables |= {
        "plant": {"vehicle": "pelican_arm2"},
        "controller": {"law": "centroidal", "mode": "joint", "load": 0.1},
    }
    for name, y in (("left", 1.0), ("right", -1.0)):
        tables["agents"][name] = {
            "reference": {"base": {"kind": "hover", "position": [0.0, y, 2.0]}}
        }
    del tables["world"]["grasps"]
    tables["world"]["objects"][0]["position"] = [3.0, 0.0, 0.5]
    tables["world"]["grippers"] = [{"name": "hand", "agent": "left"}]
    with pytest.raises(
        ScenarioError,
        match=r"agents\.right\.controller\.load = 0\.1: must be 0 without",
    ):
        skyarm.scenario_from(tables, TEAMS)
    tables["world"]["grippers"].append({"name": "other", "agent": "right"})
    skyarm.scenario_from(tables, TEAMS)


@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
def test_a_force_of_one_vehicle_acts_on_it_alone(plant: str) -> None:
    both, force = two().with_kind(plant), Vec3(0.3, 0.0, 0.0)
    log = skyarm.run(
        dataclasses.replace(
            both, forces=(skyarm.world.ForceWind(force_W=force, agent="right"),)
        )
    )
    pushed = dataclasses.replace(
        alone(both, "right"), forces=(skyarm.world.ForceWind(force_W=force),)
    )
    assert_same(log.agents["left"], skyarm.run(alone(both, "left")))
    assert_same(log.agents["right"], skyarm.run(pushed))
    assert (
        log.agents["right"].wind_force - log.agents["left"].wind_force
        == [0.3, 0.0, 0.0]
    ).all()
