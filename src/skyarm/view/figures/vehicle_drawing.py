"""A labelled drawing of any vehicle: frames, joints with their positive directions, rotors, lengths."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch, Polygon
from matplotlib.patheffects import withStroke
from matplotlib.transforms import Bbox

from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Vehicle
from skyarm.view.figures.projection import SIDE, TOP, View, across, arc, axonometric, hull, surface
from skyarm.view.figures.style import PAPER, Picture, Style
from skyarm.world.scene.shapes import Shape
from skyarm.world.scene.vehicle_shapes import body_poses, rotor_radius, vehicle_shapes

Array = npt.NDArray[np.float64]

FILLS = {
    "hull": "#c5cfda",
    "boom": "#aab6c2",
    "rotor": "#8fb8d8",
    "link": "#eab277",
    "joint": "#6c7a89",
    "tip": "#b2182b",
}
"""Role of a shape -> fill."""

AXIS_COLORS = ("#c0262d", "#1a7f37", "#1f5fbf")
"""x, y, z, as in every robot viewer; letters say it without colour."""

AZIMUTH, ELEVATION = -math.radians(58.0), math.radians(24.0)
"""Of the axonometric view: from the right and a little from the front, so that x, y and z all show."""

HEIGHT = 3.9
"""in."""

MARGINS = np.array([0.14, 0.08])
"""Room for labels left and right of a view, and above and below it, as shares of its width and height."""

BENT = 0.5
"""rad: angle of the joints whose motion the side view shows."""

TRIAD = 0.34
"""Length of the axes of a frame, as a share of the vehicle's reach; those without letters are shorter."""

SEEN, FLAT = 0.25, 0.97
"""Least share of its length on paper at which an axis is drawn, and from which a rod's length is written there."""

MERGED = 0.02
"""Share of the reach within which names stand together at one point."""

DISTANCES = (0.9, 1.4, 2.0, 2.8, 3.8, 5.0, 6.5)
"""Of a label from its point, in font sizes, nearest first; in so many directions."""

DIRECTIONS = 16

GAP, LEADER = 0.12, 1.6
"""Font sizes: least gap between two labels; distance from which a thin line leads from a label to its point."""


def vehicle_drawing(vehicle: Vehicle, joints: Sequence[float] | None = None) -> Picture:
    """Draw a vehicle from its records: an axonometric view, one from the side, one from above.

    Args:
        vehicle: with concrete numbers.
        joints: rad or m; if left out, those whose motion the side view shows are bent by 0.5 rad.

    Returns:
        a figure in which bodies are guesses by :mod:`skyarm.world.scene`, and frames, joints, rotors and lengths are
        the vehicle's own. World z up, body x forward, y left, z up.

    Raises:
        ValueError: one line: another number of joints.
    """
    posed = pose(vehicle, joints)
    figure = PAPER.blank(PAPER.wide, HEIGHT)
    figure.set_layout_engine("none")  # every view has its place
    shapes = vehicle_shapes(vehicle)
    for view, place, title, draw in (
        (axonometric(AZIMUTH, ELEVATION), (0.005, 0.01, 0.575, 0.91), "", _draw_solid),
        (SIDE, (0.585, 0.5, 0.41, 0.38), "from the right", _draw_side),
        (TOP, (0.585, 0.01, 0.41, 0.43), "from above", _draw_top),
    ):
        ax = figure.add_axes(place)
        ax.set_axis_off()
        ax.set_title(title, **PAPER.small_words)
        outlines = _outlines(shapes, posed, view)
        corners = np.concatenate([each for _, each in outlines])
        # the axes of the world stand below the vehicle, to its left on paper
        low = corners.min(axis=0) - posed.reach * np.array([0.15, 0.2])
        world = Frame("world", low[0] * np.array(view.right) + low[1] * np.array(view.up), np.eye(3))
        frames = [posed.frames[0], *([world] if draw is _draw_solid else [])]
        ends = [view.flat(frame.at + TRIAD * posed.reach * frame.R.T) for frame in frames]
        _fit(ax, np.concatenate([corners, *ends]))
        marks = Marks(ax, view, posed.reach)
        for i, (shape, outline) in enumerate(outlines):
            drawn = Polygon(outline, closed=True, facecolor=FILLS[shape.role], edgecolor=PAPER.frame)
            alpha = 0.4 if shape.role == "rotor" else 1.0
            drawn.set(linewidth=0.06 * PAPER.small, alpha=alpha, zorder=1.0 + 1e-3 * i, label=shape.name)
            ax.add_patch(drawn)
        draw(marks, vehicle, posed, world)
        marks.write()
    parts = ["frames", *(["joints"] if vehicle.links else []), *(["rotors"] if vehicle.rotors else [])]
    figure.suptitle(f"{vehicle.name}: {', '.join(parts)}", **PAPER.words)
    return figure


def _outlines(shapes: Sequence[Shape], posed: Posed, view: View) -> list[tuple[Shape, Array]]:
    """Each solid with the corners of its outline (K, 2) on paper, the farthest first."""
    placed = []
    for shape in shapes:
        R, p = posed.poses[shape.body]
        points = surface(shape) @ R.T + p
        placed.append((float(view.toward @ points.mean(axis=0)), shape, hull(view.flat(points))))
    return [(shape, corners) for _, shape, corners in sorted(placed, key=lambda each: each[0])]


def _fit(ax: Axes, flat: Array) -> None:
    """Limits of a view: all points (N, 2) in the middle, with room for labels, at one scale on both axes."""
    low, high = flat.min(axis=0), flat.max(axis=0)
    size = np.maximum(high - low, 0.3 * float(np.max(high - low)))
    box = ax.get_window_extent()
    pixels = np.array([box.width, box.height])
    half = 0.5 * float(np.max(size / (1.0 - 2.0 * MARGINS) / pixels)) * pixels
    middle = 0.5 * (low + high)
    ax.set(xlim=(middle[0] - half[0], middle[0] + half[0]), ylim=(middle[1] - half[1], middle[1] + half[1]))


def _draw_solid(marks: Marks, vehicle: Vehicle, posed: Posed, world: Frame) -> None:
    """Axonometric: the world, the base, every named frame, the joints' positive directions, the rotors' numbers."""
    marks.triad(world, letters=True)
    for i, frame in enumerate(posed.frames):
        marks.triad(frame, letters=i == 0 or frame.name == vehicle.end_effector)
    for joint in posed.joints:
        marks.positive_direction(joint, posed.joints)
    for i in range(len(vehicle.rotors)):
        marks.rotor(vehicle, i, str(i + 1))


def _draw_side(marks: Marks, vehicle: Vehicle, posed: Posed, world: Frame) -> None:
    """From the right: lengths between joints."""
    del world, vehicle
    marks.triad(posed.frames[0], letters=True)
    for rod in posed.rods:
        marks.length(rod)


def _draw_top(marks: Marks, vehicle: Vehicle, posed: Posed, world: Frame) -> None:
    """From above: numbers and names of rotors, the sense in which they turn, the length of the booms."""
    del world
    marks.triad(posed.frames[0], letters=True)
    for i, rotor in enumerate(vehicle.rotors):
        marks.rotor(vehicle, i, f"{i + 1} {rotor.name}\n{'ccw' if rotor.direction > 0 else 'cw'}", outside=True)
    for rotor in vehicle.rotors[:1]:
        hub = marks.view.flat(_vector(rotor.position))
        if (size := float(np.linalg.norm(hub))) > 0.05 * marks.reach:
            marks.label(_millimetres(size), 0.5 * hub, PAPER.frame)


@dataclass(frozen=True, slots=True)
class Frame:
    """Axes to draw: a name, their origin (3,), m, and R (3, 3), whose columns are x, y and z in the world."""

    name: str
    at: Array
    R: Array


@dataclass(frozen=True, slots=True)
class PosedJoint:
    """A joint to draw.

    Attributes:
        name: as in the vehicle. turns: else it slides.
        at: origin (3,), m. axis: unit vector (3,) of positive motion.
    """

    name: str
    turns: bool
    at: Array
    axis: Array


@dataclass(frozen=True, slots=True)
class Posed:
    """A vehicle in a pose, level, its base at the world's origin.

    Attributes:
        poses: body -> (R_WB, p_WB). frames: base first, then the named ones. joints: in their order.
        rods: (2, 3) m, from each joint to the next joint or frame.
        reach: the longest distance from the base to anything that is named, m.
    """

    poses: dict[int, tuple[Array, Array]]
    frames: tuple[Frame, ...]
    joints: tuple[PosedJoint, ...]
    rods: tuple[Array, ...]
    reach: float


def drawing_angles(vehicle: Vehicle) -> tuple[float, ...]:
    """Joint values for a drawing: BENT where the axis lies across the side view at zero, else zero; within limits."""
    level = _at_origin(vehicle, [0.0] * vehicle.n)
    found = []
    for i, link in enumerate(vehicle.links):
        bent = link.joint.turns and abs((level[i][0] @ _vector(link.joint.axis))[1]) > 0.9
        found.append(min(max(BENT if bent else 0.0, float(link.joint.lower)), float(link.joint.upper)))
    return tuple(found)


def pose(vehicle: Vehicle, joints: Sequence[float] | None = None) -> Posed:
    """A vehicle as it is drawn.

    Args:
        vehicle: with concrete numbers.
        joints: rad or m; :func:`drawing_angles` if left out.

    Raises:
        ValueError: one line: another number of joints.
    """
    values = drawing_angles(vehicle) if joints is None else tuple(float(q) for q in joints)
    if len(values) != vehicle.n:
        raise ValueError(f"joints = {list(values)}: must be {vehicle.n} numbers, one a joint of {vehicle.name}")
    poses = _at_origin(vehicle, values)
    frames = [Frame("base", poses[BASE][1], poses[BASE][0])]
    for frame in vehicle.frames:
        R, p = poses[frame.link]
        local = np.array([_vector(row) for row in frame.rotation.rows])
        frames.append(Frame(frame.name, p + R @ _vector(frame.position), R @ local))
    posed = [
        PosedJoint(link.joint.name, link.joint.turns, poses[i][1], poses[i][0] @ _vector(link.joint.axis))
        for i, link in enumerate(vehicle.links)
    ]
    rods = [(i, other.joint.position) for other in vehicle.moving if (i := other.parent) != BASE]
    rods += [(frame.link, frame.position) for frame in vehicle.frames if frame.link != BASE]
    ends = [(poses[i][1], poses[i][0] @ _vector(at)) for i, at in rods]
    drawn = tuple(np.array([p, p + along]) for p, along in ends if np.linalg.norm(along) > 1e-6)
    named = [
        *(frame.at for frame in frames),
        *(each.at for each in posed),
        *(_vector(r.position) for r in vehicle.rotors),
    ]
    return Posed(poses, tuple(frames), tuple(posed), drawn, max(float(np.linalg.norm(each)) for each in named) or 0.1)


def _at_origin(vehicle: Vehicle, joints: Sequence[float]) -> dict[int, tuple[Array, Array]]:
    """Body -> (R_WB, p_WB) of a level base at the origin."""
    level = np.array([[1.0, 0.0, 0.0, 0.0]])
    found = body_poses(vehicle, np.zeros((1, 3)), level, np.array([joints], dtype=float))
    return {body: (R[0], p[0]) for body, (R, p) in found.items()}


def _vector(v: Iterable[Any]) -> Array:
    return np.array([float(c) for c in v])


def _millimetres(length: float) -> str:
    return f"{round(1e3 * length, 1):g} mm"


class Marks:
    """Marks over the shapes of one view: axes, arrows, angles, lengths and their labels.

    Args:
        ax: with its limits set. view: of it. reach: of the vehicle, m.
    """

    def __init__(self, ax: Axes, view: View, reach: float) -> None:
        self.ax, self.view, self.reach = ax, view, reach
        self._labels: list[tuple[str, Array, str]] = []
        self._names: list[tuple[Array, list[str]]] = []
        self._points: list[Array] = [np.zeros((0, 2))]
        self._taken: list[Bbox] = []
        self._dots = PAPER.small * ax.figure.dpi / 72.0

    def label(self, text: str, at: Array, color: str = "") -> None:
        """Request a label near a point (2,) on paper."""
        self._labels.append((text, at, color or PAPER.ink))

    def triad(self, frame: Frame, *, letters: bool) -> None:
        """Axes of a frame, with the letters of those that are not seen end on."""
        size = (TRIAD if letters else 0.6 * TRIAD) * self.reach
        for letter, axis, color in zip("xyz", frame.R.T, AXIS_COLORS, strict=True):
            ends = self.view.flat(np.array([frame.at, frame.at + size * axis]))
            if np.linalg.norm(ends[1] - ends[0]) >= SEEN * size:
                self.arrow(ends, color, 0.13)
                if letters:
                    self.label(letter, ends[1], color)
        self._name(frame.at, frame.name)

    def positive_direction(self, joint: PosedJoint, others: Sequence[PosedJoint]) -> None:
        """An arrow about, or along, the axis of a joint in its positive direction; smaller where others are near."""
        apart = [float(np.linalg.norm(joint.at - other.at)) for other in others]
        size = min([0.13 * self.reach, *(0.8 * each for each in apart if each > MERGED * self.reach)])
        way = np.array([joint.at - size * joint.axis, joint.at + 2.0 * size * joint.axis])
        if joint.turns:
            way = arc(joint.at, joint.axis, size * across(joint.axis), 1.5 * math.pi)
        self.arrow(self.view.flat(way), PAPER.ink, 0.1)
        self._line(np.array([joint.at - 1.4 * size * joint.axis, joint.at + 1.4 * size * joint.axis]), (6, 2, 1, 2))
        self._name(joint.at, joint.name)

    def length(self, rod: Array) -> None:
        """Dimension of a rod that lies in the paper plane; of two arms in one line of sight only once."""
        flat, whole = self.view.flat(rod), float(np.linalg.norm(rod[1] - rod[0]))
        if np.linalg.norm(flat[1] - flat[0]) < FLAT * whole or whole < 0.05 * self.reach:
            return
        words, at = _millimetres(whole), flat.mean(axis=0)
        if not any(text == words and math.dist(p, at) < MERGED * self.reach for text, p, _ in self._labels):
            self.label(words, at, PAPER.frame)

    def rotor(self, vehicle: Vehicle, i: int, words: str, *, outside: bool = False) -> None:
        """A bow with a head in the sense in which a rotor turns, and its words at the hub or beyond the disc."""
        rotor, radius = vehicle.rotors[i], rotor_radius(vehicle)
        hub, axis = _vector(rotor.position), _vector(rotor.axis)
        axis = axis / np.linalg.norm(axis)
        bow = arc(hub, axis, 0.72 * radius * across(axis), rotor.direction * 1.35 * math.pi)
        self.arrow(self.view.flat(bow), PAPER.ink, 0.11)
        at = self.view.flat(hub)
        away = float(np.linalg.norm(at))
        self.label(words, at * (1.0 + 0.95 * radius / away) if outside and away > 0.0 else at)

    def arrow(self, flat: Array, color: str, width: float) -> None:
        """A line through points (N, 2) with a head at its end."""
        look: Style = {"color": color, "linewidth": width * PAPER.small, "zorder": 5.0}
        self.ax.plot(*flat.T, solid_capstyle="butt", label="_mark", **look)
        # the head alone: its shaft would end before the point
        options: Style = {"arrowstyle": "-|>", "mutation_scale": 0.9 * PAPER.small, "shrinkA": 0.0}
        head = FancyArrowPatch(tuple(flat[-2]), tuple(flat[-1]), color=color, shrinkB=0.0, **options)
        head.set(linewidth=0.0, zorder=5.1)
        self.ax.add_patch(head)
        self._points.append(flat if len(flat) > 2 else np.linspace(flat[0], flat[1], 24))

    def write(self) -> None:
        """Place every label, one after the other; names at one point are merged into one label."""
        points = self.ax.transData.transform(np.concatenate(self._points))
        names = [(", ".join(names), at, PAPER.ink) for at, names in self._names]
        # the letters of axes first: they have the least room
        order = [*names, *self._labels]
        for text, at, color in sorted(order, key=lambda each: each[0] not in ("x", "y", "z")):
            self._place(text, at, color, points)

    def _name(self, at: Array, name: str) -> None:
        flat = self.view.flat(at)
        near = (names for place, names in self._names if math.dist(place, flat) < MERGED * self.reach)
        if (names := next(near, None)) is not None:
            names.append(name)
        else:
            self._names.append((flat, [name]))

    def _line(self, points: Array, dash: tuple[float, ...]) -> None:
        look: Style = {"color": PAPER.frame, "linewidth": 0.08 * PAPER.small, "zorder": 4.5}
        self.ax.plot(*self.view.flat(points).T, linestyle=(0, dash), label="_mark", **look)

    def _place(self, text: str, at: Array, color: str, points: Array) -> None:
        """Write a label where it covers no other one and as few points (N, 2), dots, as can be."""
        words: Style = {**PAPER.small_words, "color": color, "ha": "center", "va": "center"}
        label = self.ax.text(float(at[0]), float(at[1]), text, zorder=9.0, linespacing=1.0, **words)
        label.set_path_effects([withStroke(linewidth=0.3 * PAPER.small, foreground=PAPER.face, alpha=0.8)])
        here, drawn = self.ax.transData.transform(at), label.get_window_extent()
        size = np.array([drawn.width, drawn.height])
        best = math.inf
        for distance in DISTANCES:
            for angle in 2.0 * math.pi * (np.arange(DIRECTIONS) + 0.5) / DIRECTIONS:
                centre = here + np.array([math.cos(angle), math.sin(angle)]) * (distance * self._dots + 0.5 * size)
                tried = Bbox([centre - 0.5 * size, centre + 0.5 * size])
                if (cost := distance + self._cost(tried, points)) < best:
                    best, middle, box = cost, centre, tried
        label.set_position(tuple(self.ax.transData.inverted().transform(middle)))
        self._taken.append(box.padded(GAP * self._dots))
        if math.dist(middle, here) > LEADER * self._dots + 0.5 * box.width:
            edge = np.clip(here, box.min, box.max)
            ends = self.ax.transData.inverted().transform([edge, here])
            self.ax.plot(*ends.T, color=PAPER.frame, linewidth=0.07 * PAPER.small, zorder=8.0, label="_leader")

    def _cost(self, box: Bbox, points: Array) -> float:
        wide, inside = box.padded(GAP * self._dots), self.ax.bbox
        covered = sum(wide.overlaps(each) for each in self._taken)
        out = box.x0 < inside.x0 or box.y0 < inside.y0 or box.x1 > inside.x1 or box.y1 > inside.y1
        hits = int(np.all((points >= box.min) & (points <= box.max), axis=1).sum())
        return float(1000 * covered + 500 * out + min(hits, 8))
