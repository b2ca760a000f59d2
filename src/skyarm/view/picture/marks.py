"""Marks of a flight in a picture: solids of vehicle and desired pose, trail, path, wind
and contact forces.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from skyarm.records.arrays import Array, lengths, norm
from skyarm.records.immutable import positional
from skyarm.view.picture.frames import Color, FlightFrames
from skyarm.world.scene.scene import Arrow
from skyarm.world.scene.shapes import RGBA, Shape, Solid
from skyarm.world.scene.vehicle_shapes import (
    Poses,
    rotor_turns,
    shape_rotation,
    vehicle_shapes,
)

Paint = Callable[[str], RGBA]
"""Function from a shape's role to its colour."""

TRAIL = 4.0
"""Duration (s) of the tip's trail, chosen by eye."""

TRAIL_PIECES = 80
"""Number of line segments of a trail: each has an opacity and is a geom of its own."""

ROTOR_OPACITY = 0.45
"""Opacity of the discs of rotors, chosen: what is behind them stays visible."""
GHOST: RGBA = (0.15, 0.2, 0.3, 0.16)
DARK: Color = (0.16, 0.17, 0.2)
TIP: Color = (0.85, 0.12, 0.16)
POINT: Color = (0.95, 0.75, 0.1)
WHITE: Color = (1.0, 1.0, 1.0)
PATH: RGBA = (0.25, 0.28, 0.34, 0.55)
WIND: RGBA = (0.25, 0.55, 0.85, 0.9)

TOUCH: RGBA = (0.78, 0.1, 0.55, 0.95)
"""Colour of contact forces."""

TOUCH_PER_NEWTON, LONGEST_TOUCH = 0.12, 0.5
"""Length of a contact arrow: m per N, and largest (m); chosen: forces above 4.2 N have
the largest."""

TONES = {
    "hull": 1.0,
    "boom": 0.75,
    "rotor": 0.5,
    "link": 0.85,
    "joint": 0.6,
    "tip": 1.15,
    "point": 1.4,
    "payload": 0.4,
}
"""Role of a shape -> brightness of its law's colour in the studio; 0.6 for any
other."""

THICK, THIN = 3.5, 2.0
"""Line widths (pixels at 720 lines) of a trail and of a desired path."""

LEAST_STEP = 0.004
"""Least length (m) of a trail's segment, so that a tip at rest costs nothing."""

ARROW_PER_NEWTON, ARROW_PER_SPEED, LONGEST_ARROW = 0.2, 0.08, 0.6
"""Length of wind arrows: m per N, m per m/s, and largest (m); chosen: 3 N or 7.5 m/s
have the largest."""

LEAST_FORCE, LEAST_SPEED = 0.02, 0.05
"""Least force (N) and air speed (m/s) that are drawn: arrows of 4 mm."""


@positional
class Stroke:
    """Line or arrow between two world points, drawn in one frame of a film.

    Attributes:
        kind: "line" or "arrow". width: pixels of a line, m of an arrow's radius.
    """

    kind: str
    width: float
    start: Array
    end: Array
    rgba: RGBA


def trail(flight: FlightFrames, k: int, width: float) -> list[Stroke]:
    """Make the fading trail of the tip's last seconds, as lines."""
    times = flight.times
    first = int(np.searchsorted(times, times[k] - TRAIL))
    # every so many frames of the film, not of the trail, so that a line stays where it
    # was drawn once
    every = max(1, int(np.searchsorted(times, times[0] + TRAIL)) // TRAIL_PIECES)
    at = _thin_out(flight.tip[[*range(-(-first // every) * every, k, every), k]])
    # opacities from the oldest piece to the newest, chosen
    share = np.linspace(0.15, 0.85, max(len(at) - 1, 1))
    return [
        Stroke("line", width, a, b, (*flight.color, float(s)))
        for a, b, s in zip(at[:-1], at[1:], share, strict=False)
    ]


def desired_path(flight: FlightFrames, width: float) -> list[Stroke]:
    """Make the line of the desired tip path over a whole film."""
    # four times as many pieces as a trail has, chosen
    at = _thin_out(
        flight.desired_tip[:: -(-len(flight.desired_tip) // (4 * TRAIL_PIECES))]
    )
    return [Stroke("line", width, a, b, PATH) for a, b in pairwise(at)]


def wind_arrow(flight: FlightFrames, k: int, reach: float) -> list[Stroke]:
    """Make an arrow along the wind near the vehicle, with a length by wind force or air
    speed, the longer one.
    """
    seen = [
        scale * each[k]
        for each, scale, least in (
            (flight.force, ARROW_PER_NEWTON, LEAST_FORCE),
            (flight.air, ARROW_PER_SPEED, LEAST_SPEED),
        )
        if np.linalg.norm(each[k]) > least
    ]
    length = max(seen, key=norm, default=np.zeros(3))
    size = norm(length)
    if not size:
        return []
    along = length / size
    # beside and above the vehicle, which the arrow thus does not hide
    end = (
        flight.desired_position[k]
        - 1.6 * reach * along
        + np.array([0.0, 0.0, 0.8 * reach])
    )
    return [
        Stroke("arrow", 0.06 * reach, end - min(size, LONGEST_ARROW) * along, end, WIND)
    ]


def touch_arrows(
    arrows: Sequence[Arrow], k: int, per_newton: float, longest: float = np.inf
) -> Array:
    """Start and end points (m) of the arrows of contact forces at frame k, (N, 2, 3),
    each from its contact point.

    Args:
        arrows: N forces.
        k: number of the frame.
        per_newton: length of an arrow, m per N.
        longest: its largest length, m.
    """
    pairs = np.array([(each.spot[k], each.force[k]) for each in arrows]).reshape(
        -1, 2, 3
    )
    spots, forces = pairs.swapaxes(0, 1)
    # by at least the least visible force, so that none divides by zero
    scale = np.minimum(per_newton, longest / np.maximum(lengths(forces), LEAST_FORCE))
    return np.stack([spots, spots + scale[:, None] * forces], axis=1)


def touch_marks(flight: FlightFrames, k: int, reach: float) -> list[Stroke]:
    """Make arrows of all contact forces at frame k, without those that are too small to
    be seen.
    """
    ends = touch_arrows(flight.scene.arrows, k, TOUCH_PER_NEWTON, LONGEST_TOUCH)
    least = TOUCH_PER_NEWTON * LEAST_FORCE
    return [
        Stroke("arrow", 0.045 * reach, start, end, TOUCH)
        for start, end in ends
        if norm(end - start) > least
    ]


def wind_words(flight: FlightFrames, k: int) -> str:
    """Caption with the force on the base and the wind speed in a frame; empty if both
    are negligible.
    """
    force, speed = (norm(each[k]) for each in (flight.force, flight.air))
    words = [f"force {force:.1f} N"] if force > LEAST_FORCE else []
    return ", ".join(
        [*words, *([f"wind {speed:.1f} m/s"] if speed > LEAST_SPEED else [])]
    )


def _thin_out(places: Array) -> Array:
    """Thin out a path (F, 3) so that neighbouring points keep a minimum distance."""
    chosen = [places[0]]
    for place in places[1:]:
        if np.linalg.norm(place - chosen[-1]) > LEAST_STEP:
            chosen.append(place)
    return np.array(chosen)


def marks_of(
    flights: Sequence[FlightFrames], reach: float, scale: float
) -> Callable[[int], list[Stroke]]:
    """Make a function that lists the lines and arrows of a film panel at a given
    frame.
    """
    still = desired_path(flights[0], THIN * scale)
    for flight in flights[1:]:
        # a path at the same place, but for rounding, would only darken the line
        if not np.allclose(flight.desired_tip, flights[0].desired_tip, atol=1e-6):
            still += desired_path(flight, THIN * scale)

    def at(k: int) -> list[Stroke]:
        marks = [*still]
        for draw, size in (
            (trail, THICK * scale),
            (scene_lines, THICK * scale),
            (touch_marks, reach),
            (wind_arrow, reach),
        ):
            for flight in flights:
                marks += draw(flight, k, size)
        return marks

    return at


def vehicle_solids(flight: FlightFrames) -> list[Solid]:
    """Make the solids of a flight in a film: vehicle in the flight's colour, payloads
    and surroundings.
    """
    paint = paint_of(flight.color)
    turns = rotor_turns(flight.vehicle, flight.tilts)
    shapes = *vehicle_shapes(flight.vehicle), *flight.scene.attached
    around = (
        replace(each, rgba=each.rgba or paint(each.shape.role))
        for each in flight.scene.solids
    )
    return [*_solids(shapes, flight.poses, paint, turns), *around]


def scene_lines(flight: FlightFrames, k: int, width: float) -> list[Stroke]:
    """Make the lines of line-shaped objects, such as cables, in a film's frame k;
    hidden ones (NaN) are left out.
    """
    pieces = [
        (a, b, line.rgba)
        for line in flight.scene.lines
        for a, b in pairwise(line.places[k])
    ]
    return [
        Stroke("line", width, a, b, rgba)
        for a, b, rgba in pieces
        if np.isfinite([a, b]).all()
    ]


def ghost_solids(flight: FlightFrames) -> list[Solid]:
    """Make transparent solids of the vehicle in its desired pose: level base, joints on
    reference, servos at rest.
    """
    return _solids(
        vehicle_shapes(flight.vehicle), flight.desired_poses, lambda _: GHOST, {}
    )


def _solids(
    shapes: Sequence[Shape], poses: Poses, paint: Paint, turns: dict[str, Array]
) -> list[Solid]:
    """Make the solids of shapes on a vehicle's bodies."""
    solids = []
    for shape in shapes:
        R, p = poses[shape.body]
        place, turn = p + R @ np.array(shape.position), R @ shape_rotation(shape, turns)
        solids.append(Solid(shape, place, turn, paint(shape.role)))
    return solids


def paint_of(color: Color) -> Paint:
    """Make a function from a shape's role (hull, link, rotor, ...) to its colour in a
    film, given the flight's.
    """
    own: dict[str, RGBA] = {
        "hull": (*color, 1.0),
        "link": (*_mix(color, WHITE, 0.25), 1.0),
        "rotor": (*_mix(color, WHITE, 0.45), ROTOR_OPACITY),
        "tip": (*TIP, 1.0),
        "point": (*POINT, 1.0),
        "payload": (*_mix(color, DARK, 0.5), 1.0),
    }
    return lambda role: own.get(role, (*DARK, 1.0))


def tones_of(color: Sequence[int], opacity: float = 1.0) -> Paint:
    """Make a function from a shape's role to a shade of one colour (0 to 255); rotors
    are transparent.
    """

    def paint(role: str) -> RGBA:
        red, green, blue = (min(1.0, TONES.get(role, 0.6) * c / 255.0) for c in color)
        return (
            red,
            green,
            blue,
            # 0.35 at most, chosen: what is behind a disc stays visible
            0.5 * min(opacity, 0.7) if role == "rotor" else opacity,
        )

    return paint


def _mix(a: Color, b: Color, share: float) -> Color:
    """Blend of two colours, with a ``share`` of the second."""
    red, green, blue = (
        (1.0 - share) * one + share * other for one, other in zip(a, b, strict=True)
    )
    return (red, green, blue)
