"""Films of vehicles that fly together: each is where its log has it, what they share is
drawn once, all are in view.
"""

from __future__ import annotations

import dataclasses
import functools
from itertools import product
from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.log.flight_log import Log
from skyarm.records.arrays import Array
from skyarm.view.film.camera_paths import CAMERAS, looking_towards
from skyarm.view.film.captions import frame_layout, state_words
from skyarm.view.film.filmed_flight import FilmedFlight, film_flights
from skyarm.view.film.make_film import FilmSettings, film_frames, film_panels
from skyarm.view.picture.marks import marks_of, vehicle_solids
from skyarm.view.picture.mujoco_sink import FIELD_OF_VIEW
from skyarm.world.contact.contact import Contact
from skyarm.world.contact.contact_point import ContactPoint
from skyarm.world.contact.grasp import Grasp
from skyarm.world.scene.component_scenes import scene_in_log
from skyarm.world.scene.scene import Instants, Scene
from support.commands import skyarm as typed
from support.pictures import needs_display
from support.teams import TEAMS, rotations, team, with_world

TIMES = np.array([0.0, 0.1, 0.25])


@functools.cache
def flown(name: str) -> Log:
    return skyarm.run(team(name, duration=0.3))


def filmed(*names: str) -> list[FilmedFlight]:
    return film_flights([flown(name) for name in names], TIMES)


def row(log: Log, k: int) -> int:
    return int(np.searchsorted(log.time, TIMES[k] - 1e-9))


@pytest.mark.parametrize("name", ["bar", "triangle", "cables"])
def test_each_vehicle_is_where_its_log_has_it_and_the_body_once(name: str) -> None:
    log, flights = flown(name), filmed(name)
    assert [each.label for each in flights] == [*log.agents]
    assert {each.number for each in flights} == {0}
    assert len({each.color for each in flights}) == len(flights)
    for flight, own in zip(flights, log.agents.values(), strict=True):
        (hull,) = (each for each in vehicle_solids(flight) if each.shape.role == "hull")
        assert hull.rgba is not None
        assert hull.rgba[:3] == flight.color
        for k in range(len(TIMES)):
            np.testing.assert_allclose(
                hull.position[k], own.position[row(log, k)], atol=1e-9
            )
    (body,) = (
        solid
        for each in flights
        for solid in vehicle_solids(each)
        if solid.shape.role == "object"
    )
    at = [row(log, k) for k in range(len(TIMES))]
    np.testing.assert_allclose(body.position, log.object_position[at], atol=1e-9)


@pytest.mark.parametrize("name", ["triangle", "cables"])
def test_grasps_are_marked_on_the_body_and_pull_at_their_vehicles(name: str) -> None:
    log, (first, *others) = flown(name), filmed(name)
    assert not any(
        (each.scene.solids, each.scene.lines, each.scene.arrows) != ((), (), ())
        for each in others
    )
    at = [row(log, k) for k in range(len(TIMES))]
    turn, middle = rotations(log.object_quaternion[at]), log.object_position[at]
    marks = [each for each in first.scene.solids if each.shape.role == "point"]
    grasps = log.scenario.world.grasps
    assert len(marks) == len(first.scene.arrows) == len(grasps)
    for i, (grasp, mark, arrow) in enumerate(
        zip(grasps, marks, first.scene.arrows, strict=True)
    ):
        place = middle + turn @ np.array([float(c) for c in grasp.place])
        np.testing.assert_allclose(mark.position, place, atol=1e-9)
        np.testing.assert_allclose(
            arrow.spot, log.agents[grasp.agent].position[at], atol=1e-9
        )
        np.testing.assert_allclose(
            arrow.force, -log.grasp_pull[at, 3 * i : 3 * i + 3], atol=1e-9
        )
        if grasp.kind == "cable":
            cable = first.scene.lines[i].places
            np.testing.assert_allclose(cable[:, 0], arrow.spot, atol=1e-9)
            np.testing.assert_allclose(cable[:, -1], place, atol=1e-9)
    drawn = marks_of([first, *others], 0.1, 1.0)(2)
    assert sum(each.kind == "arrow" for each in drawn) == len(grasps)


def test_one_of_them_alone_has_its_own_grasp_only() -> None:
    (alone,) = film_flights([flown("cables").agents["right"]], TIMES)
    assert alone.label == "centroidal_joint"
    assert [each.name for each in alone.scene.lines] == ["grasp/right_bar"]
    assert [each.name for each in alone.scene.arrows] == ["grasp/right_bar"]
    assert sorted(each.shape.role for each in alone.scene.solids) == ["object", "point"]


def hanging(cable: Grasp, apart: float, seconds: float = 0.0) -> Scene:
    """Scene of a body on a cable, ``apart`` (m) beside the vehicle ``left``; ``right``
    has a contact point.
    """
    scenario = team("bar")
    still = np.array([[1.0, 0.0, 0.0, 0.0]])
    places = {"left": np.zeros((1, 3)), "right": np.array([[0.0, 3.0, 0.0]])}
    agents = {
        name: Instants(
            vehicle=scenario.vehicles[name],
            times=np.array([seconds]),
            position=place,
            quaternion=still,
            joints=np.zeros((1, 0)),
            name=name,
        )
        for name, place in places.items()
    }
    assert scenario.world is not None
    point = ContactPoint(
        name="skid", body="base", agent="right", position=Vec3(0.0, 0.0, -0.1)
    )
    world = Contact(objects=scenario.world.objects, grasps=(cable,), points=(point,))
    numbers: dict[str, Array] = {
        column[0]: np.zeros((1, 0)) for column in world.columns
    }
    for column in world.columns:
        numbers[column[0]] = np.hstack([numbers[column[0]], np.zeros((1, 1))])
    numbers |= {
        "object_position": np.array([[apart, 0.0, 0.0]]),
        "object_quaternion": still,
    }
    first, second = (
        scene_in_log(
            [world], dataclasses.replace(each, agents=agents), numbers.__getitem__
        )
        for each in agents.values()
    )
    alone = dataclasses.replace(agents["left"], agents={"left": agents["left"]})
    assert [
        each.name for each in scene_in_log([world], alone, numbers.__getitem__).arrows
    ] == ["grasp/left_bar"]
    assert first.attached == ()
    assert "point/skid" in [shape.name for shape in second.attached]
    (arrow,) = (each for each in first.arrows if each.name.endswith("skid"))
    np.testing.assert_allclose(arrow.spot, [[0.0, 3.0, -0.1]], atol=1e-12)
    return first


def test_a_slack_cable_is_as_long_as_it_is_and_sags_and_a_released_one_is_gone() -> (
    None
):
    cable = Grasp(
        agent="left", frame="grip", body="bar", kind="cable", length=1.0, release=2.0
    )
    for apart, sags in ((0.9, True), (1.0, False), (1.01, False)):
        (line,) = hanging(cable, apart).lines
        (places,) = line.places
        length = np.linalg.norm(np.diff(places, axis=0), axis=1).sum()
        assert length == pytest.approx(max(apart, 1.0), rel=0.02)
        assert bool(places[:, 2].min() < -0.05) == sags
        np.testing.assert_allclose(
            places[[0, -1]], [[0.0, 0.0, 0.0], [apart, 0.0, 0.0]], atol=1e-12
        )
    (line,) = hanging(cable, 0.9, 2.0).lines
    assert np.isnan(line.places).all()


@pytest.mark.parametrize("camera", ["follow", "fixed"])
@pytest.mark.parametrize("name", ["bar", "triangle", "cables"])
def test_all_vehicles_and_the_body_are_in_the_picture(name: str, camera: str) -> None:
    """The pinhole of the test: it looks along the azimuth and the elevation, z up."""
    flights, aspect = filmed(name), 1.5
    path = CAMERAS[camera](flights, TIMES, aspect)
    (body,) = (each for each in flights[0].scene.solids if each.shape.role == "object")
    corners = [
        np.array(signs) * body.shape.size for signs in product((-1.0, 1.0), repeat=3)
    ]
    boom = 0.1
    for k in range(len(TIMES)):
        ends = [body.position[k] + body.rotation[k] @ corner for corner in corners]
        ends += [
            each.position[k] + boom * np.array(way)
            for each in flights
            for way in (*np.eye(3)[:2], *-np.eye(3)[:2])
        ]
        forward = looking_towards(path.azimuth[k], path.elevation[k])
        right = np.cross(forward, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        rays = np.array(ends) - (path.look_at[k] - path.distance[k] * forward)
        slope = np.tan(np.radians(0.5 * FIELD_OF_VIEW)) * (rays @ forward)
        assert (np.abs(rays @ right) < aspect * slope).all()
        assert (np.abs(rays @ np.cross(right, forward)) < slope).all()
    middles = np.array([each.position[0] for each in flights]) @ right
    assert np.ptp(middles) > 0.6 * np.linalg.norm(
        np.ptp([each.position[0] for each in flights], axis=0)
    )


def test_captions_have_the_force_of_the_own_grasps() -> None:
    log = flown("triangle")
    for i, (flight, own) in enumerate(
        zip(filmed("triangle"), log.agents.values(), strict=True)
    ):
        force, error = (
            log.grasp_force[row(log, 2), i],
            own.position[row(log, 2)] - own.position_reference[row(log, 2)],
        )
        said = state_words(flight, TIMES[2], 2)
        assert said.startswith(f"contact {force:.1f} N, tip error ")
        assert float(said.split()[-2]) == pytest.approx(
            1e3 * np.linalg.norm(error), rel=0.05
        )


def test_teams_stand_side_by_side_each_under_its_names() -> None:
    flights = filmed("triangle", "bar")
    assert [each.number for each in flights] == [0, 0, 0, 1, 1]
    assert flights[3].label.endswith("two_hold_a_bar, left")
    settings = FilmSettings(width=640, height=360)
    layout = frame_layout(640, 360, 2, "side", plot=True, agents=[3, 2])
    first, second = layout.panels
    inside = [
        [first, second].index(p)
        for h in layout.heads
        for p in layout.panels
        if p.left <= h.left < p.left + p.width
    ]
    assert inside == [0, 0, 0, 1, 1]
    assert layout.heads[-1].left + layout.heads[-1].width == 640
    panels = film_panels(flights, TIMES, settings, layout)
    assert [sum(s.shape.role == "object" for s in each.solids) for each in panels] == [
        1,
        1,
    ]
    # of each vehicle and of its ghost
    assert [sum(s.shape.role == "hull" for s in each.solids) for each in panels] == [
        6,
        4,
    ]
    with pytest.raises(ValueError, match="agents = 8: must be from 1 to 6 in one film"):
        filmed("bar", "bar", "bar", "bar")


def test_a_recording_has_every_vehicle_and_the_body_once() -> None:
    pytest.importorskip("viser", reason="no extra 'studio'")
    from recorded_scenes import place_at, unpacked

    from skyarm.view.film.recording import record

    log = flown("bar")
    messages = unpacked(record([log], FilmSettings(fps=10, layout="side")).content)[
        "messages"
    ]
    for i, own in enumerate(log.agents.values()):
        for k in (0, 1):
            place = place_at(
                messages,
                f"/flight{i + 1}/vehicle",
                "SetPositionMessage",
                "position",
                TIMES[k],
            )
            np.testing.assert_allclose(place, own.position[row(log, k)], atol=2e-4)
    names = {str(message.get("name")) for _, message in messages}
    assert {name for name in names if name.endswith("world/bar")} == {
        "/flight1/solids/world/bar"
    }


def test_recorded_teams_stand_apart_and_their_vehicles_together() -> None:
    pytest.importorskip("viser", reason="no extra 'studio'")
    from recorded_scenes import place_at, unpacked

    from skyarm.view.film.recording import record

    both = record([flown("bar"), flown("cables")], FilmSettings(fps=10, layout="side"))
    messages = unpacked(both.content)["messages"]
    roots = [
        place_at(messages, f"/flight{i}", "SetPositionMessage", "position", 0.0)
        for i in range(1, 5)
    ]
    np.testing.assert_array_equal(roots[0], roots[1])
    np.testing.assert_array_equal(roots[2], roots[3])
    assert np.linalg.norm(roots[0] - roots[2]) > 0.5


def test_contact_points_are_on_their_own_vehicle() -> None:
    above = {"body": "base", "position": Vec3(0.0, 0.0, 0.1)}
    points = tuple(
        ContactPoint(name=f"{name}_hook", agent=name, **above)
        for name in ("left", "right")
    )
    flights = film_flights(
        [skyarm.run(with_world(team("bar", duration=0.02), points=points))], TIMES[:1]
    )
    for flight, name in zip(flights, ("left", "right"), strict=True):
        assert {each.name for each in flight.scene.attached} == {
            f"point/{name}_hook",
            f"stalk/{name}_hook",
        }


@needs_display
def test_hulls_have_their_colours_in_a_picture() -> None:
    flights = filmed("bar")
    picture = next(
        film_frames(
            flights, TIMES, FilmSettings(width=480, height=320, plot=False, ghost=False)
        )
    )
    below = picture[60:].astype(float)
    for each in flights:
        hue = below / np.maximum(below.max(axis=2, keepdims=True), 1.0) - np.array(
            each.color
        ) / max(each.color)
        assert (
            (np.abs(hue).max(axis=2) < 0.15) & (below.max(axis=2) > 60)
        ).sum() > 100, each.label


@needs_display
def test_the_command_films_a_scenario_and_a_log(tmp_path: Path) -> None:
    flown("bar").save_npz(tmp_path / "bar.npz")
    for source in (TEAMS / "bar.toml", tmp_path / "bar.npz"):
        words = ("--size", "160x120", "--fps", "5", "--window", "0", "0.2")
        done = typed("film", str(source), str(tmp_path / "a.webp"), *words)
        assert (done.code, done.err) == (0, "")
