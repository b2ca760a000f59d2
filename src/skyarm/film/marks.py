"""What a film draws beside the solids: the trail of the tip, the path it should take, the wind."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from skyarm.film.filmed_flight import FilmedFlight
from skyarm.film.solids import RGBA

Array = npt.NDArray[np.float64]

TRAIL = 4.0
"""s of flight that the tip's trail goes back."""

TRAIL_PIECES = 80
"""Lines of a trail."""

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
