"""Pictures of a flight: against MuJoCo's rays in its own poses, the same from a log, a
session and a batch, and no part of the flight.
"""

from __future__ import annotations

import re
import tomllib
from dataclasses import replace
from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.algebra import Quaternion
from skyarm.plant.mujoco_model import body_name, build_spec
from skyarm.records.leaves import leaves, rebuild
from skyarm.reference.signals import Ramp
from skyarm.scenario.scenario_record import NamedSensor, ScenarioError, first_state
from skyarm.sensing.cameras.camera_kinds import DepthCamera
from skyarm.sensing.cameras.ray_casting import RayCaster
from skyarm.simulate import eyes as eyes_module
from skyarm.simulate.eyes import Eyes
from skyarm.simulate.first_state import first_loop_state
from skyarm.simulate.loop_state import structure_of
from skyarm.world.signal_vector import SignalVector

EXAMPLES = Path(__file__).parents[2] / "examples"
FILE = EXAMPLES / "see_with_the_wrist.toml"

TOUCHES = 3
"""Group of MuJoCo's geoms that touch; the others are drawn."""

RAYS = {"noise": {}, "width": 16, "height": 12}
"""Wrist without noise, of few pixels."""


def scenario_with(duration=0.3, world=None, **sensors):
    """The example with other sensors."""
    tables = tomllib.loads(FILE.read_text("utf-8"))
    tables |= {"duration": duration}
    for name, fields in sensors.items():
        tables["sensors"][name] = tables["sensors"].get(name, {}) | fields
    if world is not None:
        tables["world"] |= world
    return skyarm.scenario_from(tables, EXAMPLES)


def first(scenario, name):
    """Picture at the start."""
    return Eyes(scenario).frame(name, first_loop_state(scenario), 0.0, 0)


@cache
def flown():
    """Scenario with a noisy wrist and its log."""
    tables = tomllib.loads(FILE.read_text("utf-8"))["world"]
    tables["objects"][0]["com"] = [0.01, 0.0, 0.01]
    wrist = {"width": 16, "height": 12, "frequency": 50.0}
    scenario = scenario_with(world=tables, wrist=wrist)
    return scenario, skyarm.run(scenario)


def mujoco_scene(scenario, log, row):
    """MuJoCo's model at a row of the log: vehicle, shapes and a camera at the wrist."""
    vehicle = scenario.plant.vehicle
    spec = build_spec(vehicle, 9.81)
    kinds = {"box": 0.5, "cylinder": 1.0, "capsule": 1.0, "sphere": 1.0, "plane": 0.0}

    def add(body, shape, position, rotation):
        size = np.zeros(3)
        given = [*map(float, shape.size)]
        size[: len(given)] = np.array(given) * kinds[shape.shape]
        if shape.shape in ("cylinder", "capsule"):
            size[1] *= 0.5
        body.add_geom(
            type=getattr(mujoco.mjtGeom, f"mjGEOM_{shape.shape.upper()}"),
            size=[*size[:2], 1.0] if shape.shape == "plane" else size,
            pos=[*map(float, position)],
            quat=np.roll(Rotation.from_matrix(rotation).as_quat(), 1),
            name=shape.name,
            group=TOUCHES,
        )

    for each in vehicle.collisions:
        body = spec.body(body_name(vehicle, each.link))
        add(body, each, each.position, each.rotation.rows)
    for each in scenario.world.surfaces:
        turn = Rotation.from_euler("xyz", [*map(float, each.angles)]).as_matrix()
        add(spec.worldbody, each, each.position, turn)
    for i, each in enumerate(scenario.world.objects):
        place = log.object_position[row, 3 * i : 3 * i + 3]
        turn = Rotation.from_quat(np.roll(log.object_quaternion[row, :4], -1))
        add(spec.worldbody, each.surfaces[0], place, turn.as_matrix())
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:] = [*log.position[row], *log.quaternion[row], *log.joints[row]]
    mujoco.mj_forward(model, data)
    return model, data


@pytest.mark.parametrize("own", [False, True])
def test_a_picture_is_what_rays_of_mujoco_meet_from_the_links_pose(own):
    rpy = [0.1, 1.9, -0.3]
    mount = RAYS | {"rpy": rpy, "position": [0.03, 0.0, -0.05]}
    scenario = scenario_with(wrist=mount | {"sees_own_link": own})
    _, log = flown()
    frame = [*Eyes(scenario).frames("wrist", log)][-1]
    row = round(frame.time * 200)
    model, data = mujoco_scene(scenario, log, row)
    link = model.body(body_name(scenario.plant.vehicle, 1)).id
    R_WL = data.xmat[link].reshape(3, 3)
    eye = data.xpos[link] + R_WL @ [0.03, 0.0, -0.05]
    mount = R_WL @ Rotation.from_euler("ZYX", rpy[::-1]).as_matrix()
    R_WO = mount @ [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]
    np.testing.assert_allclose(frame.position, eye, atol=1e-12)
    turn = Rotation.from_quat(np.roll(frame.quaternion, -1)).as_matrix()
    np.testing.assert_allclose(turn, R_WO, atol=1e-12)
    geom, normal = np.zeros((1, 1), np.int32), np.zeros((3, 1))
    seen = set[str]()
    group = (np.arange(6) == TOUCHES).astype(np.uint8)
    for i, j in np.ndindex(frame.depth.shape):
        way = R_WO @ frame.directions[i, j]
        but = -1 if own else link
        far = mujoco.mj_ray(model, data, eye, way, group, 1, but, geom, normal)
        if far < 0.0 or far > 2.0:
            assert frame.depth[i, j] == np.inf
            assert frame.segment[i, j] == 0
            continue
        assert frame.depth[i, j] == pytest.approx(far, abs=1e-9)
        name = model.geom(geom[0, 0]).name
        called = {"hull": "base", "upper": "link1", "fore": "link2"}.get(name, name)
        assert frame.names[frame.segment[i, j]] == called
        seen.add(called)
        np.testing.assert_allclose(R_WO @ frame.normal[i, j], normal[:, 0], atol=1e-8)
        np.testing.assert_allclose(
            eye + R_WO @ frame.points()[i, j], eye + way * far, atol=1e-9
        )
    assert {"table", "parcel"} <= seen
    assert ("link2" in seen) == own


def same(one, other):
    assert one.time == other.time
    for name in ("depth", "segment", "normal", "position", "quaternion"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_a_log_a_session_and_many_lanes_show_the_same_numbers():
    scenario, log = flown()
    frames = [*log.frames("wrist")]
    assert [round(each.time * 50) for each in frames] == [*range(15)]
    session, states, times = skyarm.Session(scenario), [], []
    for frame in frames[:4]:
        while session.tick < round(frame.time * 200):
            session.step()
        same(session.frame("wrist"), frame)
        states.append(leaves(session.now))
        times.append(session.time)
    eyes = Eyes(scenario)
    lanes = np.array(states, dtype=float).T
    now = rebuild(structure_of(session.now), iter(lanes))
    ticks = np.rint(np.array(times) * 200)
    depths = eyes.depths("wrist", now, np.array(times), ticks)
    np.testing.assert_array_equal(depths, [each.depth for each in frames[:4]])


def test_pictures_of_a_saved_log_are_the_same(tmp_path):
    _, log = flown()
    loaded = skyarm.Log.load_npz(log.save_npz(tmp_path / "log.npz"))
    for one, other in zip(loaded.frames("wrist"), log.frames("wrist"), strict=True):
        same(one, other)


def test_a_log_shows_the_world_as_it_changed_in_flight():
    tables = tomllib.loads(FILE.read_text("utf-8")) | {"duration": 0.3}
    tables["sensors"]["wrist"] |= RAYS
    down = {"path": "world.surfaces.table.position.z", "value": 0.5}
    tables["changes"] = [{"at": 0.15} | down]
    session, seen = skyarm.Session(skyarm.scenario_from(tables, EXAMPLES)), []
    while session.running:
        if session.is_due("wrist"):
            seen.append(session.frame("wrist"))
        session.step()
    assert np.median(seen[2].depth - seen[1].depth) == pytest.approx(0.1, abs=1e-3)
    for one, other in zip(session.log.frames("wrist"), seen, strict=True):
        same(one, other)


def test_a_log_shows_pictures_also_if_its_law_is_unknown_by_now():
    scenario, log = flown()
    plain = scenario.agent.controller

    def law(*given, par):
        return plain.law(*given, par=par)

    own = replace(plain, name="own", law=law, compiled=False)
    other = skyarm.run(scenario.with_controller(own))
    with pytest.raises(ValueError, match="made inside a function"):
        _ = other.scenario
    same(next(other.frames("wrist")), next(log.frames("wrist")))


def test_large_pictures_of_a_log_are_met_one_by_one(monkeypatch):
    _, log = flown()
    monkeypatch.setattr(eyes_module, "RAYS", 3 * 16 * 12 - 1)
    sizes, cast = list[int](), RayCaster.cast

    def spy(caster, rotations, eyes):
        sizes.append(len(eyes))
        return cast(caster, rotations, eyes)

    monkeypatch.setattr(RayCaster, "cast", spy)
    frames = [*log.frames("wrist")]
    assert max(sizes) == 3
    assert sum(sizes) == len(frames)


def test_a_flight_with_cameras_has_the_bits_of_the_flight_without():
    scenario, log = flown()
    bare = skyarm.run(scenario.with_agent(replace(scenario.agent, sensors=())))
    assert log.arrays().keys() == bare.arrays().keys()
    for name, array in bare.arrays().items():
        np.testing.assert_array_equal(log[name], array)


def test_noise_has_its_deviation_and_differs_from_picture_to_picture():
    scenario = scenario_with(
        wrist={"noise": {"constant": 0.01, "quadratic": 0.02, "offset": 0.2}}
    )
    exact = scenario_with(wrist={"noise": {}})
    noisy, clean = first(scenario, "wrist"), first(exact, "wrist")
    deviation = 0.01 + 0.02 * (clean.depth - 0.2) ** 2
    errors = (noisy.depth - clean.depth) / deviation
    assert errors.mean() == pytest.approx(0.0, abs=4.0 / errors.size**0.5)
    assert errors.std() == pytest.approx(1.0, abs=4.0 / (2 * errors.size) ** 0.5)
    eyes, now = Eyes(scenario), first_loop_state(scenario)
    lanes = np.array([leaves(now)] * 3, dtype=float).T
    many, keys = rebuild(structure_of(now), iter(lanes)), (scenario.seed, [0, 0, 1])
    begun, later, other = eyes.depths("wrist", many, np.zeros(3), [0, 20, 0], keys=keys)
    np.testing.assert_array_equal(begun, noisy.depth)
    for each in (later, other):
        assert abs(np.corrcoef((begun - each).ravel(), errors.ravel())[0, 1]) < 0.8
        assert (begun != each).all()


def test_what_is_out_of_range_or_grazed_reads_as_ros_says():
    frame = first(scenario_with(wrist=RAYS), "wrist")
    middle = float(np.sort(frame.depth.ravel())[40])
    seen = first(scenario_with(wrist=RAYS | {"farthest": middle}), "wrist")
    assert (np.isposinf(seen.depth) == (frame.depth > middle)).all()
    assert ((seen.segment == 0) == (frame.depth > middle)).all()
    assert np.isnan(seen.points()[seen.segment == 0]).all()
    near = first(scenario_with(wrist=RAYS | {"nearest": middle}), "wrist")
    assert (np.isneginf(near.depth) == (frame.depth < middle)).all()
    read = first(scenario_with(wrist=RAYS | {"grazing": 1.3}), "wrist")
    ways = frame.directions / np.linalg.norm(frame.directions, axis=-1)[..., None]
    met = np.arcsin(-(frame.normal * ways).sum(axis=-1))
    assert (np.isnan(read.depth) == (met < 1.3)).all()
    assert 0.1 < np.isnan(read.depth).mean() < 0.9
    np.testing.assert_array_equal(read.segment, frame.segment)


def test_a_lidar_measures_along_its_rays():
    scenario = scenario_with(around={"rows": 5, "columns": 24, "farthest": 4.0})
    frame = first(scenario, "around")
    wall = frame.segment == frame.names.index("wall")
    R = Rotation.from_quat(np.roll(frame.quaternion, -1)).as_matrix()
    world = frame.position + frame.points() @ R.T
    np.testing.assert_allclose(world[wall][:, 0], 1.5, atol=1e-4)
    np.testing.assert_allclose(frame.points(world=True), world, atol=1e-12)
    assert wall.sum() > 20
    np.testing.assert_allclose(
        np.linalg.norm(frame.points()[wall], axis=1), frame.depth[wall]
    )


def test_a_surface_that_moves_is_seen_where_it_is():
    scenario = scenario_with(wrist=RAYS)
    table, *others = scenario.world.surfaces
    rising = replace(
        table, motion=SignalVector(z=Ramp(start=0.0, duration=2.0, height=0.1))
    )
    moved = replace(scenario.world, surfaces=(rising, *others), objects=())
    environment = replace(scenario.environment, world=moved)
    scenario = replace(scenario, environment=environment)
    eyes, now = Eyes(scenario), first_loop_state(scenario)
    begun, later = (eyes.frame("wrist", now, t, 0).depth for t in (0.0, 2.0))
    np.testing.assert_allclose(begun - later, 0.1, atol=1e-4)


def test_a_door_is_seen_where_it_has_turned_to():
    scenario = skyarm.load_scenario("open_door")
    camera = DepthCamera(farthest=9.0, width=16, height=12)
    front = NamedSensor(name="front", sensor=camera)
    scenario = scenario.with_agent(replace(scenario.agent, sensors=(front,)))
    now = first_loop_state(scenario)
    memory = now.components[-1]
    (door,) = memory.carried
    eyes, shown = Eyes(scenario), []
    for angle in (0.0, 0.3):
        turned = replace(memory, carried=(replace(door, coordinate=angle),))
        then = replace(now, components=(*now.components[:-1], turned))
        shown.append(eyes.frame("front", then, 0.0, 0))
    before, after = (
        each.segment == each.names.index(scenario.world.mechanisms[0].name)
        for each in shown
    )
    both = before & after
    assert both.any()
    faces = [each.normal[both] for each in shown]
    cosines = (faces[0] * faces[1]).sum(axis=1)
    assert np.median(cosines) == pytest.approx(np.cos(0.3), abs=1e-9)


def test_an_unknown_sensor_is_refused_by_name():
    scenario, log = flown()
    with pytest.raises(ScenarioError, match=r"sensors.writs: .*wrist"):
        next(log.frames("writs"))
    bare = scenario.with_agent(replace(scenario.agent, sensors=()))
    with pytest.raises(ScenarioError, match=r"sensors.wrist: there is no camera"):
        first(bare, "wrist")


@pytest.mark.parametrize(
    ("mount", "within"),
    [
        ({"position": [0.0, 0.0, -0.1], "sees_own_link": True}, "fore] of link2"),
        ({"link": "base", "position": [0.0, 0.0, -0.1]}, "upper] of link1"),
    ],
)
def test_a_camera_inside_a_shape_that_it_sees_is_refused(mount, within):
    scenario = scenario_with()
    wrist = replace(scenario.agent.cameras["wrist"], **mount)
    agent = replace(
        scenario.agent,
        sensors=(NamedSensor(name="wrist", sensor=wrist),),
        # upright the arm would hang along an axis of the world
        initial=replace(
            first_state(scenario), quaternion=Quaternion(0.9, 0.3, 0.3, 0.1)
        ),
    )
    with pytest.raises(ScenarioError, match=re.escape(within)):
        skyarm.run(scenario.with_agent(agent))


def test_members_of_a_team_see_each_other():
    tables = tomllib.loads(FILE.read_text("utf-8"))
    tables["duration"] = 0.1
    shared = ("schema", "name", "duration", "world")
    own = {k: v for k, v in tables.items() if k not in (*shared, "title")}
    left = own | {
        "initial": {"position": [0.0, 0.0, 1.6]},
        "sensors": {"front": {"kind": "depth_camera", "farthest": 5.0}},
    }
    right = own | {"initial": {"position": [0.9, 0.0, 1.6]}, "sensors": {}}
    for each in (left, right):
        x = each["initial"]["position"][0]
        each["reference"] = {"base": {"kind": "hover", "position": [x, 0.0, 1.6]}}
    team = {k: tables[k] for k in shared} | {"agents": {"left": left, "right": right}}
    scenario = skyarm.scenario_from(team, EXAMPLES)
    frame = first(scenario, "left.front")
    assert Eyes(scenario).names == ("left.front",)
    seen = {frame.names[i] for i in np.unique(frame.segment)}
    assert {"right.base", "wall"} <= seen
    here = frame.segment == frame.names.index("right.base")
    assert np.median(frame.depth[here]) == pytest.approx(0.84, abs=0.03)
    log = skyarm.run(scenario)
    same(next(log.frames("left.front")), frame)
    # its log alone has not the other one's poses
    with pytest.raises(ScenarioError, match="see right, too, whose poses are in"):
        next(log.agents["left"].frames("front"))
