"""The pose in which a vehicle is drawn, and the marks of a view: axes, arrows, angles, lengths and their labels."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch
from matplotlib.patheffects import withStroke
from matplotlib.transforms import Bbox

from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Rotor, Vehicle
from skyarm.view.figures.projection import View, across, arc
from skyarm.view.figures.style import PictureStyle
from skyarm.view.scene.shapes import Shape
from skyarm.view.scene.vehicle_shapes import body_poses

Array = npt.NDArray[np.float64]

AXIS_COLORS = {False: ("#c0262d", "#1a7f37", "#1f5fbf"), True: ("#ff7d8b", "#6fce8f", "#79b0ee")}
"""x, y, z, as in every robot viewer; letters say it without colour."""

LETTERS = "xyz"

TRIAD = 0.34
"""Length of the axes of a frame, as a share of the vehicle's reach; those without letters are shorter."""

SEEN = 0.25
"""Least share of an axis' length on paper at which it is drawn and has its letter; less is a dot."""

FLAT = 0.97
"""Share of its length that a rod shows on paper from which its length is written there."""

MERGED = 0.02
"""Share of the reach within which names stand together at one point."""


DISTANCES = (0.9, 1.4, 2.0, 2.8, 3.8, 5.0, 6.5)
"""Of a label from its point, in font sizes, nearest first."""

DIRECTIONS = 16

GAP = 0.12
"""Least gap between two labels, in font sizes."""

LEADER = 1.6
"""Distance from which a thin line leads from a label to its point, in font sizes."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """A label still to be placed: its words, its point (2,) on paper, its colour."""

    text: str
    at: Array
    color: str | None = None


class Marks:
    """What is drawn over the shapes of one view.

    Args:
        ax: with its limits set. view: of it. style: of the picture. reach: of the vehicle, m.
    """

    def __init__(self, ax: Axes, view: View, style: PictureStyle, reach: float) -> None:
        self.ax, self.view, self.style, self.reach = ax, view, style, reach
        self.colors = AXIS_COLORS[style.dark]
        self._wanted: list[Wanted] = []
        self._names: list[tuple[Array, list[str]]] = []
        self._points: list[Array] = []

    def avoid(self, shape: Shape, corners: Array) -> None:
        """Keep labels off a solid, where there is room."""
        if shape.role in ("link", "boom", "joint", "tip"):
            closed = np.concatenate([corners, corners[:1]])
            middle = corners.mean(axis=0)
            self._points.append(np.concatenate([middle + share * (closed - middle) for share in (0.5, 1.0)]))

    def triad(self, frame: DrawnFrame, *, letters: bool) -> None:
        """Axes of a frame, with the letters of those that are not seen end on."""
        size = (TRIAD if letters else 0.6 * TRIAD) * self.reach
        for i, color in enumerate(self.colors):
            ends = self.view.flat(np.array([frame.at, frame.at + size * frame.R[:, i]]))
            if np.linalg.norm(ends[1] - ends[0]) < SEEN * size:
                continue
            self._arrow(ends, color, 0.13)
            if letters:
                self._wanted.append(Wanted(LETTERS[i], ends[1], color))
        self._name(frame.at, frame.name)

    def positive(self, joint: DrawnJoint, others: Sequence[DrawnJoint]) -> None:
        """An arrow about, or along, the axis of a joint in its positive direction; smaller where others are near."""
        apart = [float(np.linalg.norm(joint.at - other.at)) for other in others]
        size = min([0.13 * self.reach, *(0.8 * each for each in apart if each > MERGED * self.reach)])
        if joint.revolute:
            start = size * across(joint.axis)
            self._arrow(self.view.flat(arc(joint.at, joint.axis, start, 1.5 * math.pi)), self.style.ink, 0.1)
        else:
            ends = np.array([joint.at - size * joint.axis, joint.at + 2.0 * size * joint.axis])
            self._arrow(self.view.flat(ends), self.style.ink, 0.1)
        reached = np.array([joint.at - 1.4 * size * joint.axis, joint.at + 1.4 * size * joint.axis])
        self._line(self.view.flat(reached), dash=(6.0, 2.0, 1.0, 2.0))
        self._name(joint.at, joint.name)

    def angle(self, joint: DrawnJoint) -> None:
        """The angle of a joint whose axis is seen end on: from where its rod points at zero, in the positive sense."""
        rod = float(np.linalg.norm(joint.zero))
        if not joint.revolute or abs(joint.axis @ self.view.toward) < FLAT or rod < MERGED * self.reach:
            return
        if abs(joint.value) < 0.05:
            return
        self._line(self.view.flat(np.array([joint.at, joint.at + 0.85 * joint.zero])), dash=(3.0, 2.0))
        along = joint.zero - joint.axis * (joint.axis @ joint.zero)
        bow = arc(joint.at, joint.axis, 0.6 * along, joint.value)
        flat = self.view.flat(bow)
        self._arrow(flat, self.style.ink, 0.1)
        sign = ">" if joint.value > 0.0 else "<"
        # beside the beginning of the arrow, away from the link
        begin, centre = flat[len(flat) // 5], self.view.flat(joint.at)
        self._wanted.append(Wanted(f"{joint.name} {sign} 0", centre + 1.1 * (begin - centre)))

    def length(self, rod: Rod) -> None:
        """The length of a rod that lies in the paper."""
        flat = self.view.flat(np.array([rod.start, rod.end]))
        whole = float(np.linalg.norm(rod.end - rod.start))
        if np.linalg.norm(flat[1] - flat[0]) < FLAT * whole or whole < 0.05 * self.reach:
            return
        words, at = _millimetres(whole), flat.mean(axis=0)
        # of two arms one behind the other the length is said once
        if not any(each.text == words and math.dist(each.at, at) < MERGED * self.reach for each in self._wanted):
            self._wanted.append(Wanted(words, at, self.style.frame))

    def rotor(self, rotor: Rotor, radius: float, words: str, *, outside: bool = False) -> None:
        """A bow with a head in the sense in which a rotor turns, and its words at the hub or beyond the disc."""
        hub = np.array([float(c) for c in rotor.position])
        axis = np.array([float(c) for c in rotor.axis])
        axis = axis / np.linalg.norm(axis)
        start = 0.72 * radius * across(axis)
        self._arrow(self.view.flat(arc(hub, axis, start, rotor.direction * 1.35 * math.pi)), self.style.ink, 0.11)
        at = self.view.flat(hub)
        away = float(np.linalg.norm(at))
        if outside and away > 0.0:
            at = at * (1.0 + 0.95 * radius / away)
        self._wanted.append(Wanted(words, at))

    def boom(self, hub: Array) -> None:
        """The distance of a rotor's hub from the base, on paper."""
        flat = self.view.flat(hub)
        size = float(np.linalg.norm(flat))
        if size > 0.05 * self.reach:
            self._wanted.append(Wanted(_millimetres(size), 0.5 * flat, self.style.frame))

    def way(self, start: Array, end: Array, words: str) -> None:
        """A dashed vector from one origin to another, with its symbol."""
        flat = self.view.flat(np.array([start, end]))
        self._arrow(flat, self.style.frame, 0.07, dashed=True)
        self._wanted.append(Wanted(words, flat.mean(axis=0), self.style.frame))

    def write(self) -> None:
        """Place every label; names of what stands at one point are one label."""
        labels = Labels(self.ax, self.style, np.concatenate(self._points) if self._points else np.zeros((0, 2)))
        names = [Wanted(", ".join(names), at) for at, names in self._names]
        # the letters of axes first: they have the least room
        letters = [each for each in self._wanted if each.text in LETTERS]
        for each in (*letters, *names, *(each for each in self._wanted if each.text not in LETTERS)):
            labels.put(each.text, each.at, each.color)

    def _name(self, at: Array, name: str) -> None:
        flat = self.view.flat(at)
        for place, names in self._names:
            if math.dist(place, flat) < MERGED * self.reach:
                names.append(name)
                return
        self._names.append((flat, [name]))

    def _arrow(self, flat: Array, color: str, width: float, *, dashed: bool = False) -> None:
        """A line through points (N, 2) with a head at its end."""
        dash = (0, (3.0, 2.0)) if dashed else "-"
        look: dict[str, Any] = {"color": color, "linewidth": width * self.style.small, "linestyle": dash, "zorder": 5.0}
        self.ax.plot(*flat.T, solid_capstyle="butt", label="_mark", **look)
        # the head alone: its shaft would end before the point
        ends = tuple(flat[-2]), tuple(flat[-1])
        scale = 0.9 * self.style.small
        head = FancyArrowPatch(*ends, arrowstyle="-|>", mutation_scale=scale, color=color, shrinkA=0.0, shrinkB=0.0)
        head.set(linewidth=0.0, zorder=5.1)
        self.ax.add_patch(head)
        self._points.append(flat if len(flat) > 2 else np.linspace(flat[0], flat[1], 24))

    def _line(self, flat: Array, dash: tuple[float, ...]) -> None:
        look: dict[str, Any] = {"color": self.style.frame, "linewidth": 0.08 * self.style.small, "zorder": 4.5}
        self.ax.plot(*flat.T, linestyle=(0, dash), label="_mark", **look)


def _millimetres(length: float) -> str:
    return f"{round(1e3 * length, 1):g} mm"


class Labels:
    """Labels of one panel, placed one after the other, each where it covers no other one.

    Args:
        ax: with its limits set. style: of the picture. points: (N, 2) in data units that labels should leave free.
    """

    def __init__(self, ax: Axes, style: PictureStyle, points: Array) -> None:
        self.ax, self.style = ax, style
        self._taken: list[Bbox] = []
        self._points = ax.transData.transform(points) if points.size else np.zeros((0, 2))
        self._dots = style.small * ax.figure.dpi / 72.0

    def put(self, text: str, at: Array, color: str | None = None) -> None:
        """Write a label near a point (2,), where it covers no label and as few points as can be."""
        words = {**self.style.small_words, "color": color or self.style.ink}
        label = self.ax.text(
            float(at[0]), float(at[1]), text, ha="center", va="center", zorder=9.0, linespacing=1.0, **words
        )
        halo = withStroke(linewidth=0.3 * self.style.small, foreground=self.style.face, alpha=0.8)
        label.set_path_effects([halo])
        here, box = self.ax.transData.transform(at), label.get_window_extent()
        _, middle, box = min(self._tries(here, box), key=lambda found: found[0])
        label.set_position(tuple(self.ax.transData.inverted().transform(middle)))
        self._taken.append(box.padded(GAP * self._dots))
        if math.dist(middle, here) > LEADER * self._dots + 0.5 * box.width:
            edge = np.array([np.clip(here[0], box.x0, box.x1), np.clip(here[1], box.y0, box.y1)])
            ends = self.ax.transData.inverted().transform([edge, here])
            width = 0.07 * self.style.small
            self.ax.plot(*ends.T, color=self.style.frame, linewidth=width, zorder=8.0, label="_leader")

    def _tries(self, here: Array, box: Bbox) -> Iterator[tuple[float, Array, Bbox]]:
        """(cost, middle, box) of each place, in dots."""
        size = np.array([box.width, box.height])
        for distance in DISTANCES:
            for k in range(DIRECTIONS):
                angle = 2.0 * math.pi * (k + 0.5) / DIRECTIONS
                way = np.array([math.cos(angle), math.sin(angle)])
                middle = here + way * (distance * self._dots + 0.5 * size)
                tried = Bbox([middle - 0.5 * size, middle + 0.5 * size])
                yield distance + self._cost(tried), middle, tried

    def _cost(self, box: Bbox) -> float:
        wide, inside = box.padded(GAP * self._dots), self.ax.bbox
        covered = sum(wide.overlaps(each) for each in self._taken)
        out = not (inside.x0 <= box.x0 and box.x1 <= inside.x1 and inside.y0 <= box.y0 and box.y1 <= inside.y1)
        hits = np.all((self._points >= box.min) & (self._points <= box.max), axis=1).sum()
        return 1000.0 * covered + 500.0 * out + min(int(hits), 8)


BENT = 0.5
"""rad: angle of the joints whose motion the side view shows."""

UPRIGHT = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class DrawnFrame:
    """Axes to draw: a name, their origin (3,), m, and R (3, 3), whose columns are x, y and z in the world."""

    name: str
    at: Array
    R: Array


@dataclass(frozen=True, slots=True)
class DrawnJoint:
    """A joint to draw.

    Attributes:
        name: as in the vehicle. revolute: it turns; else it slides. value: rad or m.
        at: origin (3,), m. axis: unit vector (3,) of positive motion. zero: (3,) where its rod would point at zero, m;
            of no length where its link carries nothing.
    """

    name: str
    revolute: bool
    value: float
    at: Array
    axis: Array
    zero: Array


@dataclass(frozen=True, slots=True)
class Rod:
    """A length to write: from one joint to the next joint or frame, both (3,), m."""

    start: Array
    end: Array


@dataclass(frozen=True, slots=True)
class Posed:
    """A vehicle in a pose, level, its base at the world's origin.

    Attributes:
        poses: body -> (R_WB, p_WB). frames: base first, then the named ones. joints, rods: in their order.
        reach: the longest distance from the base to anything that is named, m.
    """

    poses: dict[int, tuple[Array, Array]]
    frames: tuple[DrawnFrame, ...]
    joints: tuple[DrawnJoint, ...]
    rods: tuple[Rod, ...]
    reach: float


def drawing_angles(vehicle: Vehicle) -> tuple[float, ...]:
    """Joint values for a drawing: BENT where the axis lies across the side view at zero, else zero; within limits."""
    level = _at_origin(vehicle, [0.0] * vehicle.n)
    found = []
    for i, link in enumerate(vehicle.links):
        axis = level[i][0] @ np.array([float(c) for c in link.joint.axis])
        wanted = BENT if link.joint.kind == "revolute" and abs(axis[1]) > 0.9 else 0.0
        found.append(min(max(wanted, float(link.joint.lower)), float(link.joint.upper)))
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
    frames = [DrawnFrame("base", poses[BASE][1], poses[BASE][0])]
    for frame in vehicle.frames:
        R, p = poses[frame.link]
        local = np.array([[float(c) for c in row] for row in frame.rotation.rows])
        frames.append(DrawnFrame(frame.name, p + R @ _vector(frame.position), R @ local))
    drawn = tuple(_joint(vehicle, i, values, poses) for i in range(vehicle.n))
    points = [frame.at for frame in frames] + [joint.at for joint in drawn]
    points += [_vector(rotor.position) for rotor in vehicle.rotors]
    rods = tuple(Rod(poses[i][1], end) for i in range(len(vehicle.moving)) for end in _ends(vehicle, i, poses))
    return Posed(poses, tuple(frames), drawn, rods, max(float(np.linalg.norm(each)) for each in points) or 0.1)


def _joint(vehicle: Vehicle, i: int, values: Sequence[float], poses: dict[int, tuple[Array, Array]]) -> DrawnJoint:
    joint = vehicle.links[i].joint
    R, p = poses[i]
    axis = R @ _vector(joint.axis)
    ends = _ends(vehicle, i, poses)
    rod = ends[0] - p if ends else np.zeros(3)
    if joint.kind == "revolute":
        # the rod turned back by the joint's own angle
        back = -values[i]
        along = axis * (axis @ rod)
        rod = along + math.cos(back) * (rod - along) + math.sin(back) * np.cross(axis, rod)
    return DrawnJoint(joint.name, joint.kind == "revolute", values[i], p, axis, rod)


def _ends(vehicle: Vehicle, i: int, poses: dict[int, tuple[Array, Array]]) -> list[Array]:
    """Joints and frames that a link carries away from its own joint."""
    R, p = poses[i]
    found = [R @ _vector(other.joint.position) for other in vehicle.moving if other.parent == i]
    found += [R @ _vector(frame.position) for frame in vehicle.frames if frame.link == i]
    return [p + each for each in found if np.linalg.norm(each) > 1e-6]


def _at_origin(vehicle: Vehicle, joints: Sequence[float]) -> dict[int, tuple[Array, Array]]:
    """Body -> (R_WB, p_WB) of a level base at the origin."""
    found = body_poses(vehicle, np.zeros((1, 3)), np.array([UPRIGHT]), np.array([joints], dtype=float))
    return {body: (R[0], p[0]) for body, (R, p) in found.items()}


def _vector(v: Iterable[Any]) -> Array:
    return np.array([float(c) for c in v])
