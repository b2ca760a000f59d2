"""A labelled drawing of any vehicle: frames, joints with their positive directions, rotors, lengths."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from skyarm.vehicle.vehicle_records import Vehicle
from skyarm.view.figures.drawing_marks import TRIAD, DrawnFrame, Marks, Posed, pose
from skyarm.view.figures.projection import SIDE, TOP, View, axonometric, hull, surface
from skyarm.view.figures.style import Picture, PictureStyle, picture_style
from skyarm.view.scene.shapes import Shape
from skyarm.view.scene.vehicle_shapes import rotor_radius, vehicle_shapes

Array = npt.NDArray[np.float64]

FILLS = {
    False: {
        "hull": "#c5cfda",
        "boom": "#aab6c2",
        "rotor": "#8fb8d8",
        "link": "#eab277",
        "joint": "#6c7a89",
        "tip": "#b2182b",
        "payload": "#8a6d3b",
    },
    True: {
        "hull": "#3d4853",
        "boom": "#55626f",
        "rotor": "#3a6d94",
        "link": "#b8793c",
        "joint": "#93a1af",
        "tip": "#ff7d8b",
        "payload": "#c9a86a",
    },
}
"""Role of a shape -> fill, on light and on dark ground."""

AZIMUTH, ELEVATION = -math.radians(58.0), math.radians(24.0)
"""Of the axonometric view: from the right and a little from the front, so that x, y and z all show."""

HEIGHTS = {"paper": 3.9, "talk": 7.5}
"""in."""

MARGINS = np.array([0.14, 0.08])
"""Room for labels left and right of a view, and above and below it, as shares of its width and height."""


def vehicle_drawing(
    vehicle: Vehicle, joints: Sequence[float] | None = None, *, style: str = "paper", dark: bool = False
) -> Picture:
    """Draw a vehicle from its records: an axonometric view, one from the side, one from above.

    Args:
        vehicle: with concrete numbers.
        joints: rad or m; if left out, those whose motion the side view shows are bent by 0.5 rad.
        style: "paper" or "talk".
        dark: of a talk.

    Returns:
        a figure in which bodies are guesses by :mod:`skyarm.view.scene`, and frames, joints, rotors and lengths are the
        vehicle's own. World z up, body x forward, y left, z up.

    Raises:
        ValueError: one line: an unknown style, or another number of joints.
    """
    chosen = picture_style(style, dark=dark)
    posed = pose(vehicle, joints)
    figure = chosen.blank(chosen.wide, HEIGHTS[style])
    figure.set_layout_engine("none")  # every view has its place
    shapes = vehicle_shapes(vehicle)
    for view, place, draw in (
        (axonometric(AZIMUTH, ELEVATION), (0.005, 0.01, 0.575, 0.91), _solid),
        (SIDE, (0.585, 0.5, 0.41, 0.38), _side),
        (TOP, (0.585, 0.01, 0.41, 0.43), _top),
    ):
        ax = figure.add_axes(place)
        ax.set_axis_off()
        outlines = _outlines(shapes, posed, view)
        world = _world(outlines, posed, view) if draw is _solid else None
        _fit(ax, outlines, posed, view, world)
        _draw_shapes(ax, outlines, chosen)
        marks = Marks(ax, view, chosen, posed.reach)
        for shape, corners in outlines:
            marks.avoid(shape, corners)
        draw(marks, vehicle, posed, world)
        ax.set_title(TITLES[view.name], **chosen.small_words)
    parts = ["frames", *(["joints"] if vehicle.links else []), *(["rotors"] if vehicle.rotors else [])]
    figure.suptitle(f"{vehicle.name}: {', '.join(parts)}", **chosen.words)
    return figure


TITLES = {"axonometric": "", "side": "from the right", "top": "from above"}


def _outlines(shapes: Sequence[Shape], posed: Posed, view: View) -> list[tuple[Shape, Array]]:
    """Each solid with the corners of its outline (K, 2) on paper, the farthest first."""
    placed = []
    for shape in shapes:
        R, p = posed.poses[shape.body]
        points = surface(shape) @ R.T + p
        placed.append((view.depth(points.mean(axis=0)), shape, hull(view.flat(points))))
    return [(shape, corners) for _, shape, corners in sorted(placed, key=lambda each: each[0])]


def _world(outlines: Sequence[tuple[Shape, Array]], posed: Posed, view: View) -> DrawnFrame:
    """Where the axes of the world are drawn: below the vehicle, to its left on paper."""
    flat = np.concatenate([corners for _, corners in outlines])
    low = flat.min(axis=0) - posed.reach * np.array([0.15, 0.2])
    return DrawnFrame("world", low[0] * np.array(view.right) + low[1] * np.array(view.up), np.eye(3))


def _fit(ax: Axes, outlines: Sequence[tuple[Shape, Array]], posed: Posed, view: View, world: DrawnFrame | None) -> None:
    """Limits of a view: all that is drawn in the middle, with room for labels, at one scale on both axes."""
    ends = [frame.at + TRIAD * posed.reach * frame.R.T for frame in (posed.frames[0], *([world] if world else []))]
    flat = np.concatenate([*(corners for _, corners in outlines), *(view.flat(each) for each in ends)])
    low, high = flat.min(axis=0), flat.max(axis=0)
    middle = 0.5 * (low + high)
    size = np.maximum(high - low, 0.3 * float(np.max(high - low)))
    box = ax.get_window_extent()
    scale = float(np.max(size / (1.0 - 2.0 * MARGINS) / np.array([box.width, box.height])))
    half = 0.5 * scale * np.array([box.width, box.height])
    ax.set_xlim(middle[0] - half[0], middle[0] + half[0])
    ax.set_ylim(middle[1] - half[1], middle[1] + half[1])


def _draw_shapes(ax: Axes, outlines: Sequence[tuple[Shape, Array]], style: PictureStyle) -> None:
    """Outlines of the solids, the farthest first."""
    for i, (shape, corners) in enumerate(outlines):
        outline = Polygon(corners, closed=True, facecolor=FILLS[style.dark][shape.role], edgecolor=style.frame)
        clear = shape.role == "rotor"
        outline.set(linewidth=0.06 * style.small, alpha=0.4 if clear else 1.0, zorder=1.0 + 1e-3 * i, label=shape.name)
        ax.add_patch(outline)


def _solid(marks: Marks, vehicle: Vehicle, posed: Posed, world: DrawnFrame | None) -> None:
    """Axonometric: the world, the base, every named frame, the joints' positive directions, the rotors' numbers."""
    if world is not None:
        marks.way(world.at, posed.frames[0].at, "p_WB")
        marks.triad(world, letters=True)
    for i, frame in enumerate(posed.frames):
        marks.triad(frame, letters=i == 0 or frame.name == vehicle.end_effector)
    for joint in posed.joints:
        marks.positive(joint, posed.joints)
    for i, rotor in enumerate(vehicle.rotors):
        marks.rotor(rotor, rotor_radius(vehicle), str(i + 1))
    marks.write()


def _side(marks: Marks, vehicle: Vehicle, posed: Posed, world: DrawnFrame | None) -> None:
    """From the right: angles from zero, and lengths between joints."""
    del world, vehicle
    marks.triad(posed.frames[0], letters=True)
    for joint in posed.joints:
        marks.angle(joint)
    for rod in posed.rods:
        marks.length(rod)
    marks.write()


def _top(marks: Marks, vehicle: Vehicle, posed: Posed, world: DrawnFrame | None) -> None:
    """From above: numbers and names of rotors, the sense in which they turn, the length of the booms."""
    del world
    marks.triad(posed.frames[0], letters=True)
    for i, rotor in enumerate(vehicle.rotors):
        sense = "ccw" if rotor.direction > 0 else "cw"
        marks.rotor(rotor, rotor_radius(vehicle), f"{i + 1} {rotor.name}\n{sense}", outside=True)
    if vehicle.rotors:
        marks.boom(np.array([float(c) for c in vehicle.rotors[0].position]))
    marks.write()
