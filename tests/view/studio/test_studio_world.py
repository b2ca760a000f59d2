"""The world in the studio: what is said of its forces, where its nodes are, and that
nothing is there without one.
"""

from __future__ import annotations

import copy
import dataclasses
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from skyarm import scenario_from
from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics.actuators.tilting import turn_rotors
from skyarm.dynamics.point_motion import PointMotion
from skyarm.simulate.first_state import first_loop_state
from skyarm.simulate.session import Session
from skyarm.simulate.stages import Stages
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.view.picture.marks import tones_of, touch_arrows
from skyarm.view.picture.viser_sink import Arrows, SolidNodes, VehicleNodes
from skyarm.view.studio.controls import charts
from skyarm.view.studio.fleet import Flight, FlownAgent
from skyarm.view.studio.picture import NEWTON, VIEWS, FleetPicture, force_arrows
from skyarm.view.studio.sights import PlottedInstant, contact_forces, sights
from skyarm.world.scene.component_scenes import scene_now
from skyarm.world.scene.scene import Scene, instant_of
from skyarm.world.scene.vehicle_shapes import place, rotor_turns
from support.peers import Scene as Nodes
from support.shaped import shaped
from support.worlds import DOCUMENT, WALL_ANGLE


@cache
def session() -> Session:
    """The flight of the other pictures' tests with the tip in the wall from the start,
    before its first period.
    """
    document = copy.deepcopy(DOCUMENT)
    document["controller"] = {"preset": "paper_pd"}
    document["world"]["points"][0]["radius"] = 0.01
    document["world"]["surfaces"][1]["position"][0] = 0.2715
    return Session(scenario_from(document), machine_code=False)


def test_what_is_seen_of_a_contact_is_what_a_log_keeps() -> None:
    flown = Session(session().scenario, machine_code=False)
    seen = sight(flown)
    assert [surface for surface, force in seen.contacts.items() if force > 0.0] == [
        "wall"
    ]
    assert seen.contact == seen.contacts["wall"]
    flown.step()
    assert seen.contact == pytest.approx(flown.log.contact_force[0, 2], rel=1e-9)


def sight(flown: Session) -> PlottedInstant:
    """What is plotted of the only vehicle."""
    (seen,) = sights(flown)
    return seen


def test_touches_of_shapes_are_marked_with_their_force(tmp_path: Path) -> None:
    feet = [
        {"shape": "sphere", "size": [0.02], "position": [0.1 * x, 0.1 * y, -0.1]}
        for x, y in ((-1, -1), (-1, 1), (1, -1), (1, 1))
    ]
    document = {
        "schema": 1,
        "name": "stands",
        "duration": 1.0,
        "plant": {"vehicle": shaped(tmp_path, feet)},
        "controller": {"law": "decoupled_pd"},
        "world": {"surfaces": [{"name": "post/a"}]},
        "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 0.4]}},
        "initial": {"standing": True, "position": [0.0, 0.0, 0.2]},
    }
    scenario = scenario_from(document, tmp_path)
    standing = Session(scenario, machine_code=False)
    weight = float(scenario.plant.vehicle.mass) * float(scenario.plant.gravity)
    (arrow,) = scene_at(0.0, standing).arrows
    assert arrow.name == "touch/base/post/a"
    np.testing.assert_allclose(arrow.force, [[0.0, 0.0, weight]], rtol=1e-3, atol=1e-9)
    np.testing.assert_allclose(arrow.spot, np.zeros((1, 3)), atol=1e-3)
    assert sight(standing).contacts == {"post/a": pytest.approx(weight, rel=1e-3)}


def scene_at(time: float, flown: Session) -> Scene:
    """The scene of a session as it is, at another instant."""
    scenario, now = flown.scenario, flown.now
    motion = PointMotion(
        scenario.plant.vehicle, now.agent.state, gravity=scenario.plant.gravity
    )
    memories = [replaced_clock(memory, time) for memory in now.memories]
    return scene_now(
        scenario.components, memories, instant_of(motion, time, np.zeros(3)), motion
    )


def replaced_clock(memory: Any, time: float) -> Any:
    """The memory of a contact at another instant."""
    return (
        dataclasses.replace(memory, clock=(time,))
        if getattr(memory, "clock", ())
        else memory
    )


def test_nodes_of_the_world_go_where_it_goes_and_what_stands_still_is_sent_once() -> (
    None
):
    nodes = Nodes()
    world = SolidNodes(nodes, "/scene1", tones_of((1, 2, 3)))
    world.place(scene_at(0.0, session()).solids)
    wall, post, parcel = (
        nodes.nodes[f"/scene1/world/{name}"] for name in ("wall", "post", "parcel")
    )
    assert "/scene1/world/ground" not in nodes.nodes
    before = getattr(wall, "writes", 0)
    later = scene_at(0.25, session()).solids
    fallen = [
        (
            dataclasses.replace(each, position=each.position - [0.0, 0.0, 0.4])
            if "parcel" in each.shape.name
            else each
        )
        for each in later
    ]
    world.place(fallen)
    np.testing.assert_allclose(wall.position, [0.2715, 0.0, 0.45], atol=1e-4)
    np.testing.assert_allclose(
        post.position, [0.3 * np.sin(0.25 * np.pi), 2.0, 0.5], atol=1e-4
    )
    (solid,) = (each for each in fallen if "parcel" in each.shape.name)
    np.testing.assert_allclose(parcel.position, solid.position[0], atol=1e-4)
    assert getattr(wall, "writes", 0) == before


def test_arrows_of_contact_are_shown_while_something_pushes() -> None:
    nodes, forces = Nodes(), scene_at(0.0, session()).arrows
    arrows = Arrows(
        nodes, "/touches1", [(1, 2, 3)] * len(forces), 0.01, np.zeros((2, 3))
    )
    node, ends = nodes.nodes["/touches1"], touch_arrows(forces, 0, NEWTON)
    arrows.point(0.0 * ends)
    assert not getattr(node, "visible", False)
    arrows.point(ends)
    assert node.visible
    (acting,) = (i for i, each in enumerate(forces) if each.force.any())
    wall = forces[acting]
    np.testing.assert_allclose(
        node.points[acting],
        [wall.spot[0], wall.spot[0] + NEWTON * wall.force[0]],
        rtol=1e-5,
    )
    seen, outward = (
        sight(session()),
        np.array([-np.cos(WALL_ANGLE), -np.sin(WALL_ANGLE), 0.0]),
    )
    np.testing.assert_allclose(wall.spot[0], seen.tip - 0.01 * outward, atol=1e-12)
    assert np.linalg.norm(wall.force[0]) == pytest.approx(seen.contact, rel=1e-9)
    assert np.all(
        node.points[[i for i in range(len(forces)) if i != acting]]
        == node.points[acting][0]
    )
    arrows.point(0.0 * ends)
    assert not node.visible


def picture_of(scenario: Any) -> tuple[FleetPicture, Nodes, SimpleNamespace]:
    """A picture of a scenario under two laws, on a server without a browser."""
    scene, camera = Nodes(), SimpleNamespace()
    picture = FleetPicture(SimpleNamespace(scene=scene, initial_camera=camera))
    picture.build(scenario, ["a", "b"])
    return picture, scene, camera


def test_a_camera_that_follows_leaves_the_vehicle_and_moves_the_ground() -> None:
    picture, scene, _ = picture_of(session().scenario)
    flown = session()
    start, seen = flown.state, sight(flown)
    for follow in (True, False):
        picture.follow = follow
        for k in (1, 2):
            away = dataclasses.replace(
                start, position=start.position + Vec3(3.0 * k, 0.0, 0.5)
            )
            flight = Flight.__new__(Flight)
            now = flown.now.with_agent(dataclasses.replace(flown.now.agent, state=away))
            flight.session = SimpleNamespace(  # type: ignore[assignment]
                running=True,
                scenario=flown.scenario,
                plan=flown.plan,
                time=0.0,
                tick=0,
                now=now,
                ended=None,
            )
            flight.title, flight.first, flight.moved, flight.knobs = (
                "a",
                flown.scenario,
                {},
                (),
            )
            flight.agents = {"main": FlownAgent(flight, "main")}
            flight.agents["main"].sights = [seen]
            picture.draw([flight])
            base, stage = scene.nodes["/stage/law1"], scene.nodes["/stage"]
            drawn = np.array(base.position) + stage.position
            np.testing.assert_allclose(
                drawn, list(start.position if follow else away.position), atol=1e-3
            )


def test_without_a_world_nothing_of_it_is_there() -> None:
    document = {key: value for key, value in DOCUMENT.items() if key != "world"}
    document["reference"] = {
        key: value for key, value in DOCUMENT["reference"].items() if key != "push"
    }
    scenario = scenario_from({**document, "controller": {"preset": "paper_pd"}})
    _, scene, camera = picture_of(scenario)
    assert not [
        name
        for name in scene.nodes
        if "world" in name or "touch" in name or "point" in name
    ]
    assert scene.nodes["/stage/ground"].position[2] == 0.0
    np.testing.assert_allclose(
        np.array(camera.position) - camera.look_at, VIEWS[0] - [0.12, 0.08, -0.28]
    )
    plain = Session(scenario, machine_code=False)
    assert not sight(plain).contacts
    assert "contact force (N)" not in titles(plain)
    assert "contact force (N)" in titles(session())


def titles(flown: Session) -> list[str]:
    """Titles of the plots beside the scene."""
    gui = SimpleNamespace(add_uplot=lambda *_, **words: words["title"])
    flight = SimpleNamespace(first=flown.scenario, title="a", recent=lambda _: [])
    return [chart._node for chart in charts(gui, [flight])]  # type: ignore[list-item]


def test_a_world_stands_once_and_a_tab_looks_round_the_wall() -> None:
    _, scene, camera = picture_of(session().scenario)
    assert scene.nodes["/stage/ground"].position[2] == -0.3
    assert "/stage/scene1/world/wall" in scene.nodes
    assert not [name for name in scene.nodes if name.startswith("/stage/scene2/")]
    assert camera.position[0] < camera.look_at[0], "from behind: the wall is ahead"
    assert "/stage/law1/-1/point/skid" in scene.nodes
    assert "/stage/ghost/-1/point/skid" not in scene.nodes


def test_rotors_that_tilt_are_turned_with_their_thrusts() -> None:
    vehicle, scene = load_vehicle("voliro_like"), Nodes()
    nodes = VehicleNodes(scene, "/law1", vehicle, tones_of((10, 20, 30)))
    angles = np.linspace(-0.5, 0.7, len(vehicle.tilts))
    turns = rotor_turns(vehicle, angles[None])
    placed = place(vehicle, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0), [0.0] * vehicle.n)
    nodes.place(placed.poses, turns)
    speeds = np.full(len(vehicle.rotors), 100.0)
    seen: Any = SimpleNamespace(air=np.zeros(3), pushed=np.zeros(3))
    ends = force_arrows(vehicle, seen, placed, speeds, turns)
    for i, (rotor, after) in enumerate(
        zip(vehicle.rotors, turn_rotors(vehicle, tuple(angles)).rotors, strict=True)
    ):
        node, axis = (
            scene.nodes[f"/law1/-1/rotor/{rotor.name}"],
            [float(c) for c in after.axis],
        )
        R = np.array(
            [
                [float(c) for c in row]
                for row in Quaternion(*node.wxyz).normalized().rotation().rows
            ]
        )
        np.testing.assert_allclose(R[:, 2], axis, atol=3e-4)
        np.testing.assert_allclose(
            node.position, [float(c) for c in rotor.position], atol=1e-4
        )
        along = ends[i, 1] - ends[i, 0]
        np.testing.assert_allclose(along / np.linalg.norm(along), axis, atol=1e-9)


def test_contact_forces_of_a_team_are_those_on_the_vehicle_that_touches() -> None:
    one = session().scenario
    assert one.world is not None
    world = dataclasses.replace(
        one.world,
        points=tuple(
            dataclasses.replace(each, agent="left") for each in one.world.points
        ),
        grippers=tuple(
            dataclasses.replace(each, agent="left") for each in one.world.grippers
        ),
    )
    environment = dataclasses.replace(one.environment, world=world)
    both = dataclasses.replace(
        one, agents={"right": one.agent, "left": one.agent}, environment=environment
    )
    (right, left), (alone,) = touching(both), touching(one)
    assert left == alone
    assert left["wall"] > 0.0
    assert right == {}
    seen = SimpleNamespace(
        time=0.0, error=0.0, tilt=0.0, contacts=right, efforts=(0.0, 0.0), rotors=(0.0,)
    )
    flight = SimpleNamespace(
        first=both.of("right"), title="a", recent=lambda _: [seen, seen]
    )
    gui = SimpleNamespace(
        add_uplot=lambda data, *_, **words: SimpleNamespace(data=data, **words)
    )
    plots = {chart._node.title: chart._node.data for chart in charts(gui, [flight])}  # type: ignore[arg-type, list-item]
    assert not np.any(plots["contact force (N)"][1])


def touching(scenario: Any) -> list[dict[str, float]]:
    """Contact forces on each vehicle at the start of a scenario."""
    rows = Stages(scenario).around(first_loop_state(scenario), 0.0)
    return [
        contact_forces(around.components, around.memories, motion)
        for around, motion in rows
    ]
