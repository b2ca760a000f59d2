"""The labelled drawing of a vehicle: everything is named, every arrow turns as the
vehicle's records say.
"""

from __future__ import annotations

import dataclasses
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from matplotlib.patches import Polygon
from scipy.spatial import ConvexHull

import skyarm
from skyarm.algebra import Vec3
from skyarm.vehicle.vehicle_files import list_vehicles
from skyarm.view.figures.projection import SIDE, TOP, arc, axonometric, hull
from skyarm.view.figures.vehicle_drawing import (
    BENT,
    CORNER,
    Posed,
    drawing_angles,
    vehicle_drawing,
)
from skyarm.world.scene.shapes import mesh_of, shape_between
from skyarm.world.scene.vehicle_shapes import vehicle_shapes
from support.cases import sampled

PAPER_VEHICLE = "hummingbird_arm2_rotors"


def words(ax: Any) -> list[str]:
    return [text.get_text() for text in ax.texts]


@pytest.mark.parametrize("name", sampled(list_vehicles(), 6))
def test_everything_of_a_vehicle_is_named_and_no_word_covers_another(name: str) -> None:
    vehicle = skyarm.load_vehicle(name)
    figure = vehicle_drawing(vehicle)
    solid, side, top = figure.axes
    said = [each for each in words(solid) if not each.endswith("\N{DEGREE SIGN}")]
    wanted = [
        "world",
        "base",
        *(link.joint.name for link in vehicle.links),
        *(f.name for f in vehicle.frames),
    ]
    assert sorted(
        each for each in said if each not in ("x", "y", "z") and not each.isdigit()
    ) == sorted(wanted)
    assert {each for each in said if each.isdigit()} == {
        str(i + 1) for i in range(len(vehicle.rotors))
    }
    senses = [
        f"{i + 1} {r.name}\n{'ccw' if r.direction > 0 else 'cw'}"
        for i, r in enumerate(vehicle.rotors)
    ]
    assert [each for each in words(top) if "\n" in each] == senses
    shapes = {shape.name for shape in vehicle_shapes(vehicle)}
    for ax in (solid, side, top):
        assert {
            patch.get_label() for patch in ax.patches if isinstance(patch, Polygon)
        } == shapes
        boxes = [text.get_window_extent() for text in ax.texts]
        assert not [1 for a, b in combinations(boxes, 2) if a.overlaps(b)]
        for box in boxes:
            assert figure.bbox.x0 <= box.x0 < box.x1 <= figure.bbox.x1
            assert figure.bbox.y0 <= box.y0 < box.y1 <= figure.bbox.y1


def bows(ax: Any) -> list[np.ndarray]:
    """Points of the round arrows of a view."""
    return [
        line.get_xydata()
        for line in ax.get_lines()
        if line.get_label() == "_mark" and len(line.get_xdata()) > 2
    ]


def turning(points: np.ndarray) -> float:
    """Twice the area that a way encloses on paper: positive where it turns to the
    left.
    """
    x, y = (points - points.mean(axis=0)).T
    return float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]))


@pytest.mark.parametrize(
    "name", sampled(["octo_coaxial_two_arms", "hummingbird", "hexarotor_arm6"], 3)
)
def test_rotors_turn_as_their_records_say(name: str) -> None:
    """Seen from above, ccw turns to the left on paper; all rotors of these push up."""
    vehicle = skyarm.load_vehicle(name)
    arrows = bows(vehicle_drawing(vehicle).axes[2])
    assert [np.sign(turning(each)) for each in arrows] == [
        rotor.direction for rotor in vehicle.rotors
    ]


def test_lengths_are_those_of_the_records() -> None:
    vehicle = skyarm.load_vehicle(PAPER_VEHICLE)
    figure = vehicle_drawing(vehicle)
    assert words(figure.axes[1]).count("150 mm") == 2
    assert "170 mm" in words(figure.axes[2])
    joint = dataclasses.replace(
        vehicle.links[1].joint, position=Vec3(0.0, 0.0, -0.2345)
    )
    links = (vehicle.links[0], dataclasses.replace(vehicle.links[1], joint=joint))
    assert "234.5 mm" in words(
        vehicle_drawing(dataclasses.replace(vehicle, links=links)).axes[1]
    )


def test_positive_joints_turn_by_the_right_hand_about_their_axes() -> None:
    """The 6-joint arm's yaw turns about -z or z: seen from the tip of its axis the
    arrow turns to the left.
    """
    vehicle = skyarm.load_vehicle("hexarotor_arm6")
    around = bows(vehicle_drawing(vehicle).axes[0])[: vehicle.n]
    for axis, bow in zip(Posed(vehicle).axes, around, strict=True):
        assert np.sign(turning(bow)) == np.sign(axis @ CORNER.toward)


def test_axes_of_frames_are_right_handed_on_paper() -> None:
    for view, right, up, toward in (
        (SIDE, [1, 0, 0], [0, 0, 1], [0, -1, 0]),
        (TOP, [1, 0, 0], [0, 1, 0], [0, 0, 1]),
    ):
        np.testing.assert_array_equal(
            view.flat(np.array([right, up, toward], dtype=float)),
            [[1, 0], [0, 1], [0, 0]],
        )
        np.testing.assert_array_equal(view.toward, toward)
    view = axonometric(0.3, 0.5)
    frame = np.array([view.right, view.up, view.toward])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(
        view.toward,
        [np.cos(0.5) * np.cos(0.3), np.cos(0.5) * np.sin(0.3), np.sin(0.5)],
        atol=1e-15,
    )


def test_an_outline_is_the_hull() -> None:
    """Corners of the hull that are seen under more than half a degree are on the
    outline, counter-clockwise.
    """
    draw = np.random.default_rng(3)
    for count in (3, 10, 500):
        points = draw.normal(size=(count, 2))
        corners, wanted = hull(points), ConvexHull(points)
        assert set(map(tuple, corners)) <= set(map(tuple, points[wanted.vertices]))
        assert 0.5 * turning(np.concatenate([corners, corners[:1]])) == pytest.approx(
            wanted.volume, rel=1e-3
        )
    assert hull(np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]])).shape[0] <= 3


@pytest.mark.parametrize("name", [PAPER_VEHICLE, "hexarotor_arm6", "tilted_hexarotor"])
def test_lengths_and_angles_lie_clear_of_the_bodies(name: str) -> None:
    figure = vehicle_drawing(skyarm.load_vehicle(name))
    for ax in figure.axes:
        bodies = [patch for patch in ax.patches if isinstance(patch, Polygon)]
        paths = [
            patch.get_transform().transform_path(patch.get_path()) for patch in bodies
        ]
        for text in ax.texts:
            if text.get_text().endswith((" mm", "\N{DEGREE SIGN}")):
                middle = text.get_window_extent()
                at = (0.5 * (middle.x0 + middle.x1), 0.5 * (middle.y0 + middle.y1))
                assert not any(path.contains_point(at) for path in paths), (
                    text.get_text()
                )


def test_angles_of_bent_joints_and_tilted_rotors_are_written() -> None:
    vehicle = skyarm.load_vehicle(PAPER_VEHICLE)
    assert words(vehicle_drawing(vehicle).axes[1]).count("28.6\N{DEGREE SIGN}") == 2
    stiff = vehicle_drawing(vehicle.with_joints(lower=-1.0, upper=0.25))
    assert words(stiff.axes[1]).count("14.3\N{DEGREE SIGN}") == 2
    tilted = vehicle_drawing(skyarm.load_vehicle("tilted_hexarotor"))
    assert words(tilted.axes[0]).count("30\N{DEGREE SIGN}") == 1


def test_surfaces_have_their_sizes() -> None:
    rod = shape_between(
        "rod", "link", "capsule", 0, 0.01, (0.0, 0.0, 0.0), (0.3, 0.0, 0.4)
    )
    flat = SIDE.flat(mesh_of(rod)[0])
    # a capsule ends half a ball beyond its ends
    assert flat.max(axis=0) == pytest.approx([0.31, 0.41], abs=1e-4)
    assert flat.min(axis=0) == pytest.approx([-0.01, -0.01], abs=1e-4)
    disc = shape_between(
        "disc", "rotor", "cylinder", 0, 0.2, (0.0, 0.0, 0.0), (0.0, 0.0, 0.02)
    )
    assert np.ptp(TOP.flat(mesh_of(disc)[0]), axis=0) == pytest.approx(
        [0.4, 0.4], abs=1e-3
    )
    hull_shape = vehicle_shapes(skyarm.load_vehicle("hummingbird"))[0]
    half = hull_shape.size
    assert np.abs(mesh_of(hull_shape)[0]).max(axis=0) == pytest.approx(half, rel=1e-6)


def test_an_arc_turns_by_the_right_hand() -> None:
    axis, start = np.array([0.0, 0.0, 1.0]), np.array([2.0, 0.0, 0.0])
    points = arc(np.array([1.0, 1.0, 1.0]), axis, start, 0.5 * np.pi)
    np.testing.assert_allclose(
        points[[0, -1]], [[3.0, 1.0, 1.0], [1.0, 3.0, 1.0]], atol=1e-12
    )


def test_joints_across_the_side_view_are_bent_within_their_limits() -> None:
    vehicle = skyarm.load_vehicle(PAPER_VEHICLE)
    assert drawing_angles(vehicle) == (BENT, BENT)
    assert drawing_angles(vehicle.with_joints(lower=-1.0, upper=0.2)) == (0.2, 0.2)
    assert drawing_angles(skyarm.load_vehicle("hummingbird")) == ()
