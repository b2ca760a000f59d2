"""Grasps as constraints of MuJoCo: stiffness, damping, logged force, and flights
against springs on our own plant.
"""

from __future__ import annotations

import dataclasses
import tomllib
from itertools import product
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics.point_motion import PointMotion
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.interface import make_plant
from skyarm.plant.mujoco import MujocoPlant
from skyarm.plant.surroundings import Surroundings, Together
from skyarm.records.coerce import RecordError
from skyarm.records.leaves import leaves, rebuild
from skyarm.scenario.in_flight import require_continuous
from skyarm.scenario.scenario_record import Scenario, ScenarioError, Solver
from skyarm.simulate.first_state import (
    first_loop_state,
    first_state,
    first_surroundings,
)
from skyarm.vehicle.vehicle_records import Frame
from skyarm.world.contact.closed_contact import ClosedContact
from skyarm.world.contact.contact import Contact
from skyarm.world.contact.free_object import FreeObject
from skyarm.world.contact.grasp import Grasp
from skyarm.world.contact.surface import Surface, rotation_of
from support.teams import TEAMS, adrift, rotations, team, with_grasps
from support.worlds import at_rest, fall, states

WELD = Solver(kind="mujoco", closure="weld")

STIFF, DAMPED, RADIUS = 800.0, 2.0, 0.03


def welded(scenario: Scenario) -> Scenario:
    """Scenario on MuJoCo's plant with grasps as constraints."""
    return dataclasses.replace(scenario, solver=WELD)


def carried(
    kind: str,
    duration: float = 0.25,
    table: float | None = None,
    *,
    centre: bool = False,
) -> Scenario:
    """Vehicle whose arm holds a turned box at the tip, off its centre of mass or there;
    ``table`` (m) below or none.
    """
    scenario = skyarm.load_scenario("case1", duration=duration)
    vehicle = scenario.agent.plant.vehicle
    tip = vehicle.frame(None)
    at = PointMotion(vehicle, first_state(scenario)).position(tip.position, tip.link)
    place = Vec3(0.03, 0.01, 0.02)
    angles = Vec3(0.1, 0.2, 0.4) if table is None else Vec3(0.0, 0.0, 0.4)
    if centre:
        place = Vec3(0.01, 0.0, 0.005)
    start = at - rotation_of(angles).apply(place)
    box = FreeObject(
        name="box",
        mass=0.05,
        size=(0.1, 0.06, 0.04),
        com=Vec3(0.01, 0.0, 0.005),
        position=start,
        angles=angles,
    )
    grasp = Grasp(
        body="box",
        kind=kind,
        place=place,
        stiffness=STIFF,
        damping=DAMPED,
        radius=RADIUS,
    )
    under = Vec3(0.0, 0.0, float(box.position.z) - 0.02 - (table or 0.0))
    tables = (
        ()
        if table is None
        else (Surface(name="table", shape="plane", size=(), position=under),)
    )
    world = Contact(objects=(box,), grasps=(grasp,), surfaces=tables)
    return dataclasses.replace(
        scenario,
        environment=dataclasses.replace(
            scenario.environment, world=world, ground=False
        ),
    )


def moving(duration: float, **grasps: Any) -> Scenario:
    """Two vehicles that carry a bar along a circle, each on its own path."""
    tables = tomllib.loads((TEAMS / "bar.toml").read_text("utf-8"))
    ramp = {
        "kind": "ramp",
        "start": 0.0,
        "duration": 1.0,
        "height": 1.0,
        "shape": "quintic",
    }
    x, across = (
        {
            "kind": "product",
            "factor": ramp,
            "signal": {"kind": "sine", "amplitude": 0.2, "frequency_hz": rate},
        }
        for rate in (0.4, 0.3)
    )
    for name, y in (("left", 0.19), ("right", -0.19)):
        tables["agents"][name]["reference"]["base"] = {
            "kind": "signals",
            "x": x,
            "y": [y, across],
            "z": 1.0,
        }
    return with_grasps(
        skyarm.scenario_from({**tables, "duration": duration}, TEAMS), **grasps
    )


def turned_by(vector: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Rotation matrix R turned by a rotation vector in world axes, by Rodrigues'
    formula.
    """
    angle = np.linalg.norm(vector)
    x, y, z = vector / angle
    S = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(
        (np.eye(3) + np.sin(angle) * S + (1.0 - np.cos(angle)) * S @ S) @ R
    )


@pytest.mark.parametrize("kind", ["ball", "fixed"])
@pytest.mark.parametrize("seed", range(3))
def test_a_constraint_has_the_stiffness_and_damping_of_its_grasp_in_every_posture(
    kind: str, seed: int
) -> None:
    rng, scenario = np.random.default_rng(seed), welded(carried(kind))
    first = first_loop_state(scenario)
    around = first_surroundings(scenario, first)
    plant = make_plant(scenario, around)
    assert isinstance(plant, MujocoPlant)
    own = first.agents[0]
    joints = rng.uniform(-0.8, 0.8, len(own.state.joints))
    state = dataclasses.replace(
        own.state,
        joints=tuple(map(float, joints)),
        joint_rates=tuple(map(float, rng.standard_normal(joints.size))),
        rate=Vec3(*map(float, rng.standard_normal(3))),
        velocity=Vec3(*map(float, rng.standard_normal(3))),
    )
    # the box stays near the tip, a little off and a little turned
    tip = scenario.agent.plant.vehicle.frame(None)
    motion = PointMotion(scenario.agent.plant.vehicle, state)
    R = turned_by(
        0.05 * rng.standard_normal(3),
        np.array(
            [[*motion.to_world(tip.rotation.column(i), tip.link)] for i in range(3)]
        ).T,
    )
    memory = around.memories[0]
    turn = (
        np.array([[*row] for row in memory.turns[0].rows])
        if kind == "fixed"
        else np.eye(3)
    )
    attitude = R @ turn
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, attitude.ravel())
    arm = np.array([0.02, 0.01, 0.015])
    place = np.array(
        [*motion.position(tip.position, tip.link)]
    ) + 0.002 * rng.standard_normal(3)
    box = dataclasses.replace(
        memory.carried[0],
        attitude=Quaternion(*map(float, quaternion)),
        position=Vec3(*map(float, place - attitude @ arm)),
        velocity=Vec3(*map(float, rng.standard_normal(3))),
        rate=Vec3(*map(float, rng.standard_normal(3))),
    )
    inputs = leaves(around.with_coupled((dataclasses.replace(memory, carried=(box,)),)))
    plant.specific_force(
        tuple(leaves(state)), (0.0,) * len(leaves(own.queue[0])), tuple(inputs)
    )
    model, data = plant.model, plant._data
    sites = [model.site(tip.name).id, model.site("grasp 0").id]
    apart = data.site_xpos[sites[0]] - data.site_xpos[sites[1]]
    motions = np.zeros((2, 6))
    for site, row in zip(sites, motions, strict=True):
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_SITE, site, row, 0)
    turning, speed = (motions[0] - motions[1]).reshape(2, 3)
    torque, force = np.reshape(plant._welds[0].wrenches(), (2, 3))
    np.testing.assert_allclose(data.site_xpos[sites[1]], place, atol=1e-12)
    expected = STIFF * apart + DAMPED * speed
    assert np.linalg.norm(force - expected) < 2e-3 * np.linalg.norm(expected)
    if kind == "ball":
        assert np.abs(torque).max() < 1e-12
        return
    across = (
        data.site_xmat[sites[0]].reshape(3, 3)
        @ data.site_xmat[sites[1]].reshape(3, 3).T
    )
    sine = 0.5 * np.array(
        [
            across[2, 1] - across[1, 2],
            across[0, 2] - across[2, 0],
            across[1, 0] - across[0, 1],
        ]
    )
    moment = RADIUS**2 * (STIFF * sine + DAMPED * turning)
    assert np.linalg.norm(torque - moment) < 5e-3 * np.linalg.norm(moment)


@pytest.mark.parametrize("kind", ["ball", "fixed"])
def test_the_logged_pull_is_the_force_of_the_constraint_on_the_body(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows, read = list[Any](), MujocoPlant.specific_force

    def specific_force(self: MujocoPlant, *given: Any) -> Any:
        result = read(self, *given)
        rows.append(
            (
                self._data.efc_force.copy(),
                self._data.efc_J.reshape(self._data.nefc, -1).copy(),
            )
        )
        return result

    monkeypatch.setattr(MujocoPlant, "specific_force", specific_force)
    log = skyarm.run(
        welded(adrift(with_grasps(team("bar", duration=0.1), kind=kind), 3))
    )
    forces, jacobians = (np.array(each) for each in zip(*rows, strict=True))
    # rows of a grasp are the axes of the world, and the body is the one that they take
    # from
    each = {"ball": 3, "fixed": 6}[kind]
    linear = forces.reshape(len(rows), 2, each)[:, :, :3]
    np.testing.assert_allclose(
        jacobians.reshape(len(rows), 2, each, -1)[:, :, :3, -6:-3],
        -np.tile(np.eye(3), (len(rows), 2, 1, 1)),
    )
    assert np.abs(linear).max() > 0.1
    count = len(log.time)
    np.testing.assert_allclose(
        log.grasp_pull[1:].reshape(-1, 2, 3), -linear[1:count], rtol=0, atol=1e-9
    )
    np.testing.assert_allclose(
        log.grasp_force[1:], np.linalg.norm(linear[1:count], axis=2), rtol=0, atol=1e-9
    )
    # at the start the constraint is the spring that it stands for
    np.testing.assert_allclose(
        log.grasp_pull[0].reshape(2, 3),
        -linear[0],
        rtol=0,
        atol=2e-3 * np.abs(linear[0]).max(),
    )


def loaded(scenario: Scenario) -> Scenario:
    """Team whose first vehicle takes up a load in flight."""
    load = skyarm.TimedPayload(
        name="load", mass=0.05, frame="grip", pick=0.05, drop=9.0
    )
    name, agent = next(iter(scenario.agents.items()))
    return dataclasses.replace(
        scenario,
        agents={**scenario.agents, name: dataclasses.replace(agent, payloads=(load,))},
    )


FLIGHTS = {
    "bar": lambda: team("bar", duration=0.5),
    "bar along a circle": lambda: moving(0.4),
    "bar along a circle, fixed": lambda: moving(0.4, kind="fixed"),
    "plate": lambda: team("triangle", duration=0.3),
    "arm, ball": lambda: carried("ball"),
    "arm, fixed": lambda: carried("fixed"),
    "arm, fixed at the centre of mass": lambda: carried("fixed", centre=True),
    "arm, above a table": lambda: carried("ball", table=0.0002),
    "a load taken up": lambda: loaded(team("bar", duration=0.3)),
    "opened": lambda: with_grasps(team("bar", duration=0.3), release=0.1),
}

QUICK = ("bar", "arm, fixed", "a load taken up", "opened")
"""Flights of every run of the tests: one of each kind, of a load and of an opened
grasp."""


def assert_as_stiff(scenario: Scenario, steady: int = 0) -> None:
    """Flights of springs on our own plant and of constraints on MuJoCo's, pose by pose
    and pull by pull.
    """
    ours, theirs = skyarm.run(scenario), skyarm.run(welded(scenario))
    assert (ours.status, theirs.status) == ("completed", "completed")
    assert scenario.world is not None
    box = scenario.world.objects[0]
    for corner in product(
        *((-0.5 * float(edge), 0.5 * float(edge)) for edge in box.size)
    ):
        places = (
            each.object_position + rotations(each.object_quaternion) @ corner
            for each in (ours, theirs)
        )
        assert np.linalg.norm(next(places) - next(places), axis=1).max() < 1e-4
    for name, own in ours.agents.items():
        assert np.abs(own.position - theirs.agents[name].position).max() < 1e-4
    largest = np.abs(ours.grasp_pull).max()
    assert np.abs(ours.grasp_pull - theirs.grasp_pull).max() < 1e-2 * largest
    if steady:
        assert (
            np.abs(ours.grasp_pull - theirs.grasp_pull)[-steady:].max() < 1e-3 * largest
        )


@pytest.mark.parametrize(
    "name",
    [
        each if each in QUICK else pytest.param(each, marks=pytest.mark.thorough)
        for each in FLIGHTS
    ],
)
def test_a_constraint_flies_as_a_spring_of_its_stiffness(name: str) -> None:
    assert_as_stiff(FLIGHTS[name](), 0 if "circle" in name else 10)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("kind", "stiffness", "seconds"),
    # two laws that know nothing of each other fight over a bar that both hold stiffly:
    # steps of another length on our own plant alone part its flights by 7 mm in 8 s at
    # 5000 N/m
    [
        ("ball", 500.0, 8.0),
        ("ball", 5e3, 8.0),
        ("ball", 5e4, 8.0),
        ("fixed", 500.0, 8.0),
        ("fixed", 5e3, 2.0),
    ],
)
def test_a_constraint_flies_a_whole_task_as_a_spring_of_its_stiffness(
    kind: str, stiffness: float, seconds: float
) -> None:
    assert_as_stiff(moving(seconds, kind=kind, stiffness=stiffness))
    assert_as_stiff(
        with_grasps(team("bar", duration=6.0), kind=kind, stiffness=stiffness), 100
    )


def test_a_flight_goes_on_from_where_it_was_to_the_bit() -> None:
    session = skyarm.Session(
        welded(adrift(with_grasps(team("bar", duration=0.1), kind="fixed"), 5))
    )
    session.fly(7)
    before = session.snapshot()
    log = session.run()
    session.restore(before)
    again = session.run()
    for array in ("grasp_pull", "object_position", "object_quaternion", "object_rate"):
        np.testing.assert_array_equal(
            log.component(array), again.component(array), err_msg=array
        )


@pytest.mark.thorough
def test_a_changed_stiffness_is_that_of_the_constraint_too() -> None:
    def changed(scenario: Scenario) -> Any:
        session = skyarm.Session(scenario)
        session.fly(20)
        session.change({"world.grasps.0.stiffness": 500.0})
        return session.run()

    scenario = with_grasps(team("bar", duration=0.25), stiffness=5000.0, damping=20.0)
    ours, theirs = changed(scenario), changed(welded(scenario))
    stiff = skyarm.run(scenario)
    assert np.abs(ours.object_position - stiff.object_position).max() > 1e-4
    assert np.abs(ours.object_position - theirs.object_position).max() < 2e-5


UNLESS = (
    "plant.closure = 'weld': must be 'spring' unless kind is 'mujoco' and integrator is"
    " not 'euler'"
)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"kind": "rigid_body"}, UNLESS),
        ({"integrator": "euler"}, UNLESS),
        ({"closure": "glue"}, "plant.closure = 'glue': must be one of spring, weld"),
    ],
)
def test_a_plant_without_constraints_is_refused_in_one_line(
    changed: dict[str, str], words: str
) -> None:
    tables = tomllib.loads((TEAMS / "bar.toml").read_text("utf-8"))
    tables["plant"] |= {"kind": "mujoco", "closure": "weld", **changed}
    with pytest.raises(ScenarioError) as error:
        skyarm.scenario_from(tables, TEAMS)
    assert str(error.value) == words
    tables["plant"] |= {"kind": "mujoco", "closure": "weld", "integrator": "rk4"}
    assert skyarm.scenario_from(tables, TEAMS).closure == "weld"


def test_grasps_that_are_no_constraints_are_refused_in_one_line() -> None:
    with pytest.raises(
        ScenarioError,
        match=r"^world\.grasps\[0\]\.kind = 'cable': must be 'ball' or 'fixed' where",
    ):
        skyarm.run(welded(team("cables", duration=0.1)))
    door = skyarm.load_scenario("open_door", duration=0.1)
    assert door.world is not None
    grasp = Grasp(body=door.world.mechanisms[0].name, kind="ball")
    held = ClosedContact(mechanisms=door.world.mechanisms, grasps=(grasp,))
    vehicle = door.agent.plant.vehicle
    with pytest.raises(
        RecordError,
        match=(
            r"^world\.grasps\[0\]\.body = 'door': must be an object where"
            r" plant\.closure"
        ),
    ):
        held.require_vehicles({"": vehicle}, 0.005, 9.81)


def test_a_grasp_at_a_follower_pulls_its_leader_as_a_spring_does() -> None:
    fingers = skyarm.load_vehicle(
        Path(__file__).parents[2] / "examples" / "two_fingers.toml"
    )
    hand = Frame(name="hand", link=1, position=Vec3(0.0, 0.0, -0.05))
    vehicle = dataclasses.replace(
        fingers, frames=(*fingers.frames, hand), collisions=()
    )
    start = dataclasses.replace(
        at_rest(vehicle, (0.0, 0.0, 1.0), (0.0,)), joint_rates=(0.3,)
    )
    box = FreeObject(
        name="box", mass=0.05, size=(0.1, 0.06, 0.04), position=Vec3(0.0, 0.0, 0.89)
    )
    grasp = Grasp(body="box", frame="hand", stiffness=STIFF, damping=DAMPED)
    rows = []
    for plant, kind in ((RigidBodyPlant, Contact), (MujocoPlant, ClosedContact)):
        contact = kind(objects=(box,), grasps=(grasp,)).on({"": vehicle})
        motion = PointMotion(vehicle, start)
        memory = contact.settle(contact.start(0.005, ()), motion, vehicle=False)
        around = Together(
            each=(Surroundings(),), components=(contact,), memories=(memory,)
        )
        flown = fall(vehicle, start, around, 0.05, kind=plant, gravity=0.0)
        (after,) = rebuild(around.memories, iter(flown[-1][-len(leaves(memory)) :]))
        body = after.carried[0]
        rows.append(
            [
                *states(start, flown)[-1].joint_rates,
                *body.position,
                *body.velocity,
                *body.rate,
            ]
        )
    assert rows[0][5] < -0.04
    assert rows[1] == pytest.approx(rows[0], rel=1e-3, abs=2e-5)


def test_the_closure_stays_as_a_session_began() -> None:
    spring = carried("ball").with_kind("mujoco")
    with pytest.raises(
        ScenarioError,
        match=r"^plant\.closure = 'weld': must be 'spring' as the session began$",
    ):
        require_continuous(spring, welded(spring))
