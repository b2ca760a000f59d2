"""Labelled drawing of a vehicle: frames, joint axes and positive directions, rotors,
lengths, angles.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch, Polygon
from matplotlib.patheffects import withStroke

from skyarm.records.arrays import Array, float_array, norm
from skyarm.vehicle import BASE, Rotor, Vehicle
from skyarm.view.figures.projection import (
    SIDE,
    TOP,
    Projection,
    arc,
    axonometric,
    outline,
    perpendicular,
)
from skyarm.view.figures.style import PAPER, Picture
from skyarm.world.scene.shapes import Shape
from skyarm.world.scene.vehicle_shapes import place, rotor_radius, vehicle_shapes

Poses = dict[int, tuple[Array, Array]]

FILLS = {
    "hull": "#c5cfda",
    "boom": "#aab6c2",
    "rotor": "#8fb8d8",
    "link": "#eab277",
    "joint": "#6c7a89",
    "tip": "#b2182b",
}
"""Role of a shape -> fill colour."""

AXIS_COLORS = ("#c0262d", "#1a7f37", "#1f5fbf")
"""Colours of the axes x, y, z, as in every robot viewer; letters repeat them."""

CORNER = axonometric(-math.radians(58.0), math.radians(24.0))
"""Projection from the right and a little from the front, so that x, y and z are all
visible."""

UP = np.array([0.0, 0.0, 1.0])

HEIGHT = 3.9
"""Height (in) of the drawing, chosen by eye."""

MARGINS = np.array([0.17, 0.13])
"""Room for labels left and right of a view, and above and below it, as fractions of its
width and height."""

BENT = 0.5
"""Angle (rad) of the joints whose motion the side view shows: an angle of zero
has no arc to name."""

TRIAD = 0.34
"""Length of a frame's axes, as a fraction of the vehicle's reach."""

DASHED = (0.0, (6.0, 2.0))

DISTANCES = np.array([0.7, 1.2, 1.8, 2.5, 3.3, 4.2, 5.2, 6.5, 8.0])
"""Candidate distances of a label from its point, in font sizes."""

DIRECTIONS = 16
"""Number of candidate directions of a label from its point, chosen."""

HIDDEN, COVERED = 40.0, 50.0
"""Cost of a label on ink, against its distance; darkness that counts as another label:
more than any ink (1), so that labels lie on lines rather than on each other. Chosen."""

LEADER = 1.5
"""Distance of a label, in font sizes, from which a thin line leads to its point."""


def vehicle_drawing(vehicle: Vehicle) -> Picture:
    """Draw a labelled picture of a vehicle: an axonometric view, a side view and a top
    view.

    Bodies are guesses by :mod:`skyarm.world.scene`; frames, joints, rotors, lengths and
    angles are the vehicle's own. World z up, body x forward, y left, z up. Joints whose
    motion the side view shows are bent by 0.5 rad.

    Args:
        vehicle: vehicle to draw.
    """
    posed = Posed(vehicle)
    figure = PAPER.blank(PAPER.wide, HEIGHT)
    figure.set_layout_engine("none")  # every view has its place
    sheets = []
    # shares of the figure: the two flat views on top of each other beside the large
    # one, the last 8 % of the height for the title
    for view, box, title, mark in (
        (CORNER, (0.005, 0.01, 0.575, 0.91), "", _mark_frames_and_axes),
        (SIDE, (0.585, 0.5, 0.41, 0.38), "from the right", _mark_lengths_and_angles),
        (TOP, (0.585, 0.01, 0.41, 0.43), "from above", _mark_rotors),
    ):
        sheet = Sheet(figure.add_axes(box), view, posed)
        sheet.ax.set_title(title, **PAPER.small_words)
        mark(sheet)
        sheet.fit()
        sheets.append(sheet)
    parts = [
        "frames",
        *(["joints"] if vehicle.links else []),
        *(["rotors"] if vehicle.rotors else []),
    ]
    figure.suptitle(f"{vehicle.name}: {', '.join(parts)}", **PAPER.words)
    _write_labels(figure, sheets)
    return figure


class Posed:
    """Vehicle with bent joints for its drawing: poses of bodies, frames and joint axes,
    with a level base.

    Attributes:
        vehicle: vehicle with concrete numbers. angles: joint positions, rad or m.
            poses: body -> (R_WB, p_WB).
        frames: name -> (R, origin), base first. axes: (3,) positive direction of each
            joint.
        reach: the longest distance from the base to anything that is named, m.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle = vehicle
        self.angles = drawing_angles(vehicle)
        self.poses = _at_origin(vehicle, self.angles)
        self.frames = {"base": self.poses[BASE]}
        for frame in vehicle.frames:
            R, p = self.poses[frame.link]
            local = np.array([float_array(row) for row in frame.rotation.rows])
            self.frames[frame.name] = R @ local, p + R @ float_array(frame.position)
        self.axes = [
            self.poses[i][0] @ float_array(joint.axis)
            for i, joint in enumerate(vehicle.joints)
        ]
        named = [p for _, p in (*self.frames.values(), *self.poses.values())]
        named += [float_array(rotor.position) for rotor in vehicle.rotors]
        # a vehicle of one point is drawn as one of 0.1 m
        self.reach = max(norm(each) for each in named) or 0.1


def drawing_angles(vehicle: Vehicle) -> tuple[float, ...]:
    """Joint values for a drawing: 0.5 rad for joints whose motion the side view shows,
    else zero, within limits.
    """
    level = _at_origin(vehicle, [0.0] * vehicle.n)
    angles = []
    for i, joint in enumerate(vehicle.joints):
        # an axis within 26 degrees of y, along which the side view looks
        bent = joint.turns and abs((level[i][0] @ float_array(joint.axis))[1]) > 0.9
        angles.append(
            min(max(BENT if bent else 0.0, float(joint.lower)), float(joint.upper))
        )
    return tuple(angles)


def _at_origin(vehicle: Vehicle, joints: Sequence[float]) -> Poses:
    """Poses (R_WB, p_WB) of all bodies, by body number, with the base level at the
    origin.
    """
    placed = place(vehicle, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), joints)
    return {body: (R[0], p[0]) for body, (R, p) in placed.poses.items()}


class Sheet:
    """One view in a vehicle drawing: outlines of the bodies, and the requested
    labels.
    """

    def __init__(self, ax: Axes, view: Projection, posed: Posed) -> None:
        self.ax = ax
        self.view = view
        self.posed = posed
        self.reach = posed.reach
        self.labels: list[tuple[str, Array, str]] = []
        self._drawn: list[Array] = []
        ax.set_axis_off()

        def height(shape: Shape) -> float:
            R, p = posed.poses[shape.body]
            return float(view.toward @ (p + R @ np.array(shape.position)))

        # farther parts first, so that nearer ones cover them
        for i, shape in enumerate(sorted(vehicle_shapes(posed.vehicle), key=height)):
            corners = outline(shape, *posed.poses[shape.body], view)
            drawn = Polygon(
                corners, closed=True, facecolor=FILLS[shape.role], edgecolor=PAPER.frame
            )
            # arms below a disc stay visible
            alpha = 0.4 if shape.role == "rotor" else 1.0
            drawn.set(
                linewidth=0.06 * PAPER.small,
                alpha=alpha,
                zorder=1.0 + 1e-3 * i,
                label=shape.name,
            )
            ax.add_patch(drawn)
            self._drawn.append(corners)

    def below(self) -> Array:
        """World position (3,) that appears below and to the left of the drawn
        bodies.
        """
        # a little apart from the bodies, chosen by eye
        low = np.concatenate(self._drawn).min(axis=0) - self.reach * np.array(
            [0.15, 0.2]
        )
        return np.asarray(
            low[0] * np.array(self.view.right) + low[1] * np.array(self.view.up)
        )

    def label(self, text: str, at: Array, color: str = PAPER.ink) -> None:
        """Request a label at a point (3,); labels are placed after everything else is
        drawn.
        """
        self.labels.append((text, self.view.flat(at), color))

    def line(self, points: Array) -> None:
        """Draw a thin dashed line through points (N, 3)."""
        flat = self.view.flat(points)
        self.ax.plot(
            *flat.T,
            color=PAPER.frame,
            linewidth=0.08 * PAPER.small,
            linestyle=DASHED,
            label="_line",
        )

    def arrow(self, points: Array, color: str = PAPER.ink, width: float = 0.1) -> None:
        """Draw an arrow along points (N, 3), its head at the last one."""
        flat = self.view.flat(points)
        self._drawn.append(flat)
        self.ax.plot(
            *flat.T,
            color=color,
            linewidth=width * PAPER.small,
            zorder=5.0,
            label="_mark",
        )
        # the head alone: its shaft would end before the point
        head = FancyArrowPatch(
            tuple(flat[-2]),
            tuple(flat[-1]),
            arrowstyle="-|>",
            color=color,
            shrinkA=0,
            shrinkB=0,
        )
        head.set(linewidth=0.0, zorder=5.1, mutation_scale=0.9 * PAPER.small)
        self.ax.add_patch(head)

    def triad(self, name: str, R: Array, at: Array, share: float = TRIAD) -> None:
        """Draw the x, y and z axes of a coordinate frame (columns of R) with letters
        and the frame's name.
        """
        for letter, axis, color in zip("xyz", R.T, AXIS_COLORS, strict=True):
            # an axis seen end on would be a dot with a letter
            if np.linalg.norm(self.view.flat(axis)) >= 0.25:
                end = at + share * self.reach * axis
                self.arrow(np.array([at, end]), color, 0.13)
                self.label(letter, end, color)
        self.label(name, at)

    def angle(self, centre: Array, start: Array, axis: Array, angle: float) -> None:
        """Draw an angle as an arc with an arrowhead and its value in degrees."""
        bow = arc(centre, axis, start, angle)
        # the line reaches a quarter beyond the arc; its length and the widths are
        # chosen
        self.line(np.array([centre, centre + 1.25 * start]))
        self.arrow(bow, AXIS_COLORS[2], 0.08)
        self.label(
            f"{math.degrees(abs(angle)):.3g}\N{DEGREE SIGN}",
            bow[len(bow) // 2],
            AXIS_COLORS[2],
        )

    def fit(self) -> None:
        """Set axes limits that centre the drawing with margins for labels, at equal
        scale.
        """
        points = np.concatenate(self._drawn)
        low, high = points.min(axis=0), points.max(axis=0)
        # a thin side counts as 0.3 of the long one, so that labels find room beside it
        size = np.maximum(high - low, 0.3 * float(np.max(high - low)))
        box = self.ax.get_window_extent()
        pixels = np.array([box.width, box.height])
        half = 0.5 * float(np.max(size / (1.0 - 2.0 * MARGINS) / pixels)) * pixels
        left, down = 0.5 * (low + high) - half
        self.ax.set(
            xlim=(left, left + 2.0 * half[0]), ylim=(down, down + 2.0 * half[1])
        )


def _mark_frames_and_axes(sheet: Sheet) -> None:
    """Add coordinate frames, joint axes, rotor numbers and rotor tilts to the
    axonometric view.
    """
    posed = sheet.posed
    vehicle = posed.vehicle
    sheet.triad("world", np.eye(3), sheet.below())
    origins = [posed.poses[i][1] for i in range(vehicle.n)]
    for joint, at, axis in zip(vehicle.joints, origins, posed.axes, strict=True):
        # sizes of marks are shares of the reach, chosen by eye
        apart = [norm(at - other) for other in origins]
        # shorter than the way to the next joint, unless both are at one place
        size = min(
            [
                0.13 * sheet.reach,
                *(0.8 * each for each in apart if each > 0.02 * sheet.reach),
            ]
        )
        bow = arc(at, axis, size * perpendicular(axis), 1.5 * math.pi)
        sheet.arrow(
            bow if joint.turns else np.array([at - size * axis, at + 2.0 * size * axis])
        )
        sheet.line(at + 1.4 * size * np.array([-axis, axis]))
        sheet.label(joint.name, at)
    for name, frame in posed.frames.items():
        sheet.triad(
            name,
            *frame,
            TRIAD if name in ("base", vehicle.end_effector) else 0.6 * TRIAD,
        )
    marked = set()
    length = 0.8 * rotor_radius(vehicle) if vehicle.rotors else 0.0
    for i, rotor in enumerate(vehicle.rotors):
        hub, axis = _rotor_bow(sheet, rotor)
        sheet.label(str(i + 1), hub)
        # rounding may leave a unit axis more than 1; below 0.01 rad a rotor counts as
        # upright
        tilt = math.acos(min(1.0, abs(axis[2])))
        upward = math.copysign(1.0, axis[2]) * axis
        if tilt > 0.01 and round(tilt, 3) not in marked:
            marked.add(round(tilt, 3))
            about = np.cross(UP, upward)
            sheet.angle(hub, length * UP, about / np.linalg.norm(about), tilt)
            sheet.line(np.array([hub, hub + 1.25 * length * upward]))


def _mark_lengths_and_angles(sheet: Sheet) -> None:
    """Add lengths between joints, and joint angles, to the side view."""
    posed = sheet.posed
    vehicle = posed.vehicle
    sheet.triad("base", *posed.frames["base"])
    ends = [(link.parent, float_array(link.joint.position)) for link in vehicle.moving]
    ends += [(frame.link, float_array(frame.position)) for frame in vehicle.frames]
    written: list[tuple[str, Array]] = []
    for i, (link, axis, angle) in enumerate(
        zip(vehicle.links, posed.axes, posed.angles, strict=True)
    ):
        R, at = posed.poses[i]
        # an end on the joint itself has no length
        rods = [
            R @ end for body, end in ends if body == i and np.linalg.norm(end) > 1e-6
        ]
        for rod in rods:
            length = norm(rod)
            middle = at + 0.5 * rod
            # two arms in one line of sight have one label
            words = f"{round(1e3 * length, 1):g} mm"
            flat = sheet.view.flat(middle)
            labelled = any(
                text == words and math.dist(there, flat) < 0.02 * sheet.reach
                for text, there in written
            )
            # only lengths that the view does not shorten are written into it
            seen = norm(sheet.view.flat(rod)) >= 0.97 * length > 0.05 * sheet.reach
            if not seen or labelled:
                continue
            written.append((words, flat))
            sheet.label(words, middle)
            # an angle is written once for a joint, and only if the view looks along its
            # axis
            if (
                rod is rods[0]
                and link.joint.turns
                and angle
                and abs(axis @ sheet.view.toward) > 0.9
            ):
                start = arc(at, axis, 0.5 * rod, -angle)[-1] - at
                sheet.angle(at, start, axis, angle)


def _mark_rotors(sheet: Sheet) -> None:
    """Add numbers, names and rotation senses of the rotors, and a boom length, to the
    top view.
    """
    vehicle = sheet.posed.vehicle
    sheet.triad("base", *sheet.posed.frames["base"])
    for i, rotor in enumerate(vehicle.rotors):
        hub, _ = _rotor_bow(sheet, rotor)
        away = norm(hub[:2])
        edge = hub * (1.0 + 0.95 * rotor_radius(vehicle) / away) if away > 0.0 else hub
        sheet.label(
            f"{i + 1} {rotor.name}\n{'ccw' if rotor.direction > 0 else 'cw'}", edge
        )
        if i == 0 and away > 0.05 * sheet.reach:
            sheet.label(f"{round(1e3 * away, 1):g} mm", 0.5 * hub)


def _rotor_bow(sheet: Sheet, rotor: Rotor) -> tuple[Array, Array]:
    """Draw a rotor's sense of rotation as an arc with an arrowhead; returns the rotor's
    hub and axis.
    """
    hub, axis = float_array(rotor.position), float_array(rotor.axis)
    axis = axis / np.linalg.norm(axis)
    # within the disc, and open by a third of a turn, so that its sense can be seen;
    # both chosen
    start = 0.72 * rotor_radius(sheet.posed.vehicle) * perpendicular(axis)
    sheet.arrow(arc(hub, axis, start, rotor.direction * 1.35 * math.pi))
    return hub, axis


def _write_labels(figure: Picture, sheets: Sequence[Sheet]) -> None:
    """Write all labels of a drawing where they overlap least with lines, bodies and
    each other.
    """
    figure.canvas.draw()
    canvas: Any = figure.canvas
    # black is 1; rows from the bottom, as Matplotlib counts pixels
    ink = 1.0 - np.asarray(canvas.buffer_rgba())[::-1, :, :3].mean(axis=2) / 255.0
    for sheet in sheets:
        # the letters of axes first: they have the least room
        for text, at, color in sorted(
            sheet.labels, key=lambda each: each[0] not in ("x", "y", "z")
        ):
            _write_label(sheet.ax, text, at, color, ink)


def _write_label(ax: Axes, text: str, at: Array, color: str, ink: Array) -> None:
    """Write one label near a point (2,), and mark its area in the image ``ink`` as
    taken.
    """
    font = PAPER.small * ax.figure.dpi / 72.0
    words = {
        **PAPER.small_words,
        "color": color,
        "ha": "center",
        "va": "center",
        "linespacing": 1.0,
    }
    label = ax.text(float(at[0]), float(at[1]), text, zorder=9.0, **words)
    label.set_path_effects(
        [withStroke(linewidth=0.3 * PAPER.small, foreground=PAPER.face, alpha=0.8)]
    )
    point = ax.transData.transform(at)
    drawn = label.get_window_extent()
    half = 0.5 * np.array([drawn.width, drawn.height])
    # half a step off: no label lies exactly on an axis of the picture
    turns = 2.0 * math.pi * (np.arange(DIRECTIONS) + 0.5) / DIRECTIONS
    ways = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    best = math.inf
    for distance in DISTANCES:
        for centre in point + ways * (distance * font + half):
            # a pixel of margin around the words
            low = np.floor(centre - half - 1.0).astype(int)
            high = np.ceil(centre + half + 1.0).astype(int)
            if (low < ax.bbox.min).any() or (high > ax.bbox.max).any():
                continue
            cost = distance + HIDDEN * float(
                ink[low[1] : high[1], low[0] : high[0]].mean()
            )
            if cost < best:
                best = cost
                middle = centre
                taken = (slice(low[1], high[1]), slice(low[0], high[0]))
    if best == math.inf:  # no room at all: it stays at its point
        return
    ink[taken] = COVERED
    label.set_position(tuple(ax.transData.inverted().transform(middle)))
    edge = np.clip(point, middle - half, middle + half)
    if math.dist(edge, point) > LEADER * font:
        ends = ax.transData.inverted().transform([edge, point])
        ax.plot(
            *ends.T,
            color=PAPER.frame,
            linewidth=0.07 * PAPER.small,
            zorder=8.0,
            label="_leader",
        )
