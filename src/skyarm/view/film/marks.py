"""Solids, lines and arrows of a film: vehicles, desired poses, payloads, world, trails, wind and contact forces."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from skyarm.view.film.filmed_flight import Color, FilmedFlight
from skyarm.view.scene.poses import body_poses, rotor_turns, turned_shape
from skyarm.view.scene.shapes import RGBA, Solid
from skyarm.view.scene.vehicle_shapes import vehicle_shapes
from skyarm.view.scene.world_shapes import without_holes

Array = npt.NDArray[np.float64]

TRAIL = 4.0
"""s of flight that the tip's trail goes back."""

TRAIL_PIECES = 80
"""Lines of a trail."""

GHOST_OPACITY, ROTOR_OPACITY = 0.16, 0.45
GHOST: Color = (0.15, 0.2, 0.3)
DARK: Color = (0.16, 0.17, 0.2)
TIP: Color = (0.85, 0.12, 0.16)
POINT: Color = (0.95, 0.75, 0.1)
WHITE: Color = (1.0, 1.0, 1.0)
PATH: RGBA = (0.25, 0.28, 0.34, 0.55)
WIND: RGBA = (0.25, 0.55, 0.85, 0.9)

TOUCH: RGBA = (0.78, 0.1, 0.55, 0.95)
"""Of contact forces."""

TOUCH_PER_NEWTON, LONGEST_TOUCH = 0.12, 0.5
"""m per N, m."""

THICK, THIN = 3.5, 2.0
"""Pixels at 720 lines: of a trail, of a desired path."""

LEAST_STEP = 0.004
"""m: a trail is not drawn finer, so that a tip at rest costs nothing."""

ARROW_PER_NEWTON, ARROW_PER_SPEED, LONGEST_ARROW = 0.2, 0.08, 0.6
"""m per N, m per m/s, m."""

LEAST_FORCE, LEAST_SPEED = 0.02, 0.05
"""N and m/s: less wind is not drawn."""


@dataclass(frozen=True, slots=True)
class Mark:
    """A line or an arrow between two points of the world, for one frame.

    Attributes:
        kind: "line" or "arrow". width: pixels of a line, m of an arrow's radius.
    """

    kind: str
    width: float
    start: Array
    end: Array
    rgba: RGBA


def trail(flight: FilmedFlight, times: Array, k: int, width: float) -> list[Mark]:
    """Where the tip was in the last seconds, fading."""
    first = int(np.searchsorted(times, times[k] - TRAIL))
    # every so many frames of the film, not of the trail, so that a line stays where it was drawn once
    every = max(1, int(np.searchsorted(times, times[0] + TRAIL)) // TRAIL_PIECES)
    at = _apart(flight.tip[[*range(-(-first // every) * every, k, every), k]])
    share = np.linspace(0.15, 0.85, max(len(at) - 1, 1))
    return [
        Mark("line", width, a, b, (*flight.color, float(s))) for a, b, s in zip(at[:-1], at[1:], share, strict=False)
    ]


def desired_path(flight: FilmedFlight, width: float) -> list[Mark]:
    """Where the tip should be all through the film."""
    at = _apart(flight.desired_tip[:: -(-len(flight.desired_tip) // (4 * TRAIL_PIECES))])
    return [Mark("line", width, a, b, PATH) for a, b in pairwise(at)]


def one_wind(flights: Sequence[FilmedFlight]) -> bool:
    """Whether the flights fly in the same wind, to what a film's numbers show."""
    first = flights[0]
    return all(
        np.allclose(each.force, first.force, rtol=0.0, atol=LEAST_SPEED)
        and np.allclose(each.air, first.air, rtol=0.0, atol=LEAST_SPEED)
        for each in flights[1:]
    )


def wind_arrow(flight: FilmedFlight, k: int, reach: float, rgba: RGBA = WIND) -> list[Mark]:
    """An arrow along the wind that ends beside the vehicle; as long as the force, or else the air's speed, is large."""
    length = np.zeros(3)
    if np.linalg.norm(flight.force[k]) > LEAST_FORCE:
        length = ARROW_PER_NEWTON * flight.force[k]
    elif np.linalg.norm(flight.air[k]) > LEAST_SPEED:
        length = ARROW_PER_SPEED * flight.air[k]
    size = float(np.linalg.norm(length))
    if not size:
        return []
    along = length / size
    end = flight.desired_position[k] - 1.6 * reach * along + np.array([0.0, 0.0, 0.8 * reach])
    return [Mark("arrow", 0.06 * reach, end - min(size, LONGEST_ARROW) * along, end, rgba)]


def touch_marks(flight: FilmedFlight, k: int, reach: float) -> list[Mark]:
    """An arrow for every contact force, from where it acts, along it."""
    found = []
    for touch in flight.touches:
        size = float(np.linalg.norm(touch.force[k]))
        if size > LEAST_FORCE:
            length = min(TOUCH_PER_NEWTON * size, LONGEST_TOUCH)
            end = touch.spot[k] + touch.force[k] * (length / size)
            found.append(Mark("arrow", 0.045 * reach, touch.spot[k], end, TOUCH))
    return found


def wind_words(flight: FilmedFlight, k: int) -> str:
    """The wind at a frame in words; empty without wind."""
    force, speed = (float(np.linalg.norm(each[k])) for each in (flight.force, flight.air))
    words = [f"{force:.1f} N"] if force > LEAST_FORCE else []
    if speed > LEAST_SPEED:
        words.append(f"{speed:.1f} m/s")
    return f"wind {', '.join(words)}" if words else ""


def _apart(places: Array) -> Array:
    """Those of the places (F, 3), in order, that are apart from one another."""
    chosen = [places[0]]
    for place in places[1:]:
        if np.linalg.norm(place - chosen[-1]) > LEAST_STEP:
            chosen.append(place)
    return np.array(chosen)


def marks_of(flights: Sequence[FilmedFlight], times: Array, reach: float, scale: float) -> Callable[[int], list[Mark]]:
    """Function that gives the marks of one panel at a frame."""
    still = desired_path(flights[0], THIN * scale)
    for flight in flights[1:]:
        if not np.allclose(flight.desired_tip, flights[0].desired_tip, atol=1e-6):
            still += desired_path(flight, THIN * scale)

    # flights in winds of their own have arrows of their own colours
    winds: list[tuple[FilmedFlight, RGBA]] = [(flights[0], WIND)]
    if not one_wind(flights):
        winds = [(flight, (*flight.color, WIND[3])) for flight in flights]

    def at(k: int) -> list[Mark]:
        moving = [mark for flight in flights for mark in trail(flight, times, k, THICK * scale)]
        touching = [mark for flight in flights for mark in touch_marks(flight, k, reach)]
        blowing = [arrow for each, rgba in winds for arrow in wind_arrow(each, k, reach, rgba)]
        return [*still, *moving, *touching, *blowing]

    return at


def vehicle_solids(flight: FilmedFlight) -> list[Solid]:
    """The vehicle in its colour, the payloads that it takes and leaves, the surfaces that it may touch."""
    own = _solids(flight, flight.position, flight.quaternion, flight.joints, ghost=False)
    return [*own, *load_solids(flight), *without_holes(flight.surfaces)]


def load_solids(flight: FilmedFlight) -> list[Solid]:
    """Payloads where they are held, and where they lie before and after."""
    return [replace(each, rgba=role_color("payload", flight.color, ghost=False)) for each in flight.loads]


def ghost_solids(flight: FilmedFlight) -> list[Solid]:
    """The desired pose, see-through: a level base on its reference, joints on theirs."""
    desired = flight.desired_position, flight.desired_quaternion, flight.desired_joints
    return _solids(flight, *desired, ghost=True)


def role_color(role: str, color: Color, *, ghost: bool) -> RGBA:
    """Colour of a shape by what it stands for; ``color`` is the flight's."""
    if ghost:
        return (*GHOST, GHOST_OPACITY)
    if role == "rotor":
        return (*_mix(color, WHITE, 0.45), ROTOR_OPACITY)
    own = {
        "hull": color,
        "link": _mix(color, WHITE, 0.25),
        "tip": TIP,
        "point": POINT,
        "payload": _mix(color, DARK, 0.5),
    }
    return (*own.get(role, DARK), 1.0)


def _solids(flight: FilmedFlight, position: Array, quaternion: Array, joints: Array, *, ghost: bool) -> list[Solid]:
    poses = body_poses(flight.vehicle, position, quaternion, joints)
    # nothing is wanted of the servos: the desired pose has them at rest
    turns = {} if ghost else rotor_turns(flight.vehicle, flight.tilts)
    found = []
    for shape in (*vehicle_shapes(flight.vehicle), *(() if ghost else flight.points)):
        R, p = poses[shape.body]
        color = role_color(shape.role, flight.color, ghost=ghost)
        found.append(Solid(shape, p + R @ np.array(shape.position), R @ turned_shape(shape, turns), color))
    return found


def _mix(a: Color, b: Color, share: float) -> Color:
    """Colour between two, ``share`` of the second."""
    red, green, blue = ((1.0 - share) * one + share * other for one, other in zip(a, b, strict=True))
    return (red, green, blue)
