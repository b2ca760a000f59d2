"""Where the camera of a film looks from, frame by frame."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from skyarm.film.filmed_flight import FilmedFlight

Array = npt.NDArray[np.float64]

FIELD_OF_VIEW = 40.0
"""deg, from the lower to the upper edge of a panel."""

AZIMUTH, ELEVATION = 125.0, -16.0
"""deg: the camera looks along +x turned by the azimuth about z, and downwards by -elevation."""

TURN = 12.0
"""deg/s of film time at which the orbiting camera goes round."""

SMOOTH = 0.6
"""s: time constant with which a following camera turns to what it follows."""


LEAVES = 6.0
"""Reaches of a vehicle: farther from its desired position a following camera lets it go."""


@dataclass(frozen=True, slots=True)
class CameraPath:
    """A camera at F frames.

    Attributes:
        look_at: (F, 3) m. distance: (F,) m. azimuth, elevation: (F,) deg, as MuJoCo's free camera has them.
    """

    look_at: Array
    distance: Array
    azimuth: Array
    elevation: Array


def fixed(flights: Sequence[FilmedFlight], seconds: Array, aspect: float) -> CameraPath:
    """A camera that stands still and has every vehicle in view all the time."""
    low, high = _bounds(flights)
    radius = 0.5 * float(np.linalg.norm(high - low))
    return _path(np.tile(0.5 * (low + high), (len(seconds), 1)), _to_hold(radius, aspect))


def orbit(flights: Sequence[FilmedFlight], seconds: Array, aspect: float) -> CameraPath:
    """The same, going round."""
    still = fixed(flights, seconds, aspect)
    return CameraPath(still.look_at, still.distance, still.azimuth + TURN * seconds, still.elevation)


def follow(flights: Sequence[FilmedFlight], seconds: Array, aspect: float) -> CameraPath:
    """A camera that goes with the vehicles and their desired positions, so that how far they are apart is seen."""
    desired = np.mean([flight.desired_position for flight in flights], axis=0)
    farthest = LEAVES * max(map(vehicle_reach, flights))
    # a lost vehicle leaves the picture
    places = np.array([desired, *(_at_most(flight.position - desired, farthest) + desired for flight in flights)])
    middle = _smoothed(0.5 * (places.min(axis=0) + places.max(axis=0)), seconds)
    off = np.linalg.norm(places - middle, axis=2).max(axis=0) + max(map(vehicle_reach, flights))
    return _path(middle, _to_hold(0.95 * float(np.quantile(off, 0.98)), aspect))


def tip(flights: Sequence[FilmedFlight], seconds: Array, aspect: float) -> CameraPath:
    """A close look at the desired place of the tip."""
    desired = np.mean([flight.desired_tip for flight in flights], axis=0)
    return _path(_smoothed(desired, seconds), _to_hold(0.9 * max(map(vehicle_reach, flights)), aspect))


CAMERAS: dict[str, Callable[[Sequence[FilmedFlight], Array, float], CameraPath]] = {
    "fixed": fixed,
    "follow": follow,
    "orbit": orbit,
    "tip": tip,
}
"""Camera paths by name: (flights in one picture, seconds of film (F,), width over height) -> path."""


def _path(look_at: Array, distance: float) -> CameraPath:
    ones = np.ones(len(look_at))
    return CameraPath(look_at, distance * ones, AZIMUTH * ones, ELEVATION * ones)


def vehicle_reach(flight: FilmedFlight) -> float:
    """How far the vehicle reaches from its base, m: booms with their discs, arm stretched out."""
    booms = [math.hypot(*(float(c) for c in rotor.position)) for rotor in flight.vehicle.rotors]
    arm = float(np.max(np.linalg.norm(flight.desired_tip - flight.desired_position, axis=1)))
    return max([1.5 * boom for boom in booms] + [arm, 0.1])


def _bounds(flights: Sequence[FilmedFlight]) -> tuple[Array, Array]:
    """Corners of the box that holds every vehicle at every frame, but for the flight of a lost one."""
    low, high = [], []
    for flight in flights:
        near = np.linalg.norm(flight.position - flight.desired_position, axis=1) < 10.0 * vehicle_reach(flight)
        places = np.concatenate([flight.position[near], flight.desired_position])
        low.append(places.min(axis=0) - vehicle_reach(flight))
        high.append(places.max(axis=0) + vehicle_reach(flight))
    return np.min(low, axis=0), np.max(high, axis=0)


def _at_most(offset: Array, length: float) -> Array:
    """Vectors (F, 3), shortened to a length where they are longer."""
    size = np.linalg.norm(offset, axis=1, keepdims=True)
    return np.asarray(offset * np.minimum(1.0, length / np.maximum(size, 1e-9)), dtype=float)


def _to_hold(radius: float, aspect: float) -> float:
    """Distance from which a ball fits into the picture."""
    half = math.radians(0.5 * FIELD_OF_VIEW)
    across = math.atan(math.tan(half) * aspect)
    return radius / math.sin(min(half, across))


def _smoothed(places: Array, seconds: Array) -> Array:
    """Low-pass of a path (F, 3), the same forwards and backwards, so that it does not lag."""
    step = float(seconds[1] - seconds[0]) if len(seconds) > 1 else 1.0
    keep = math.exp(-step / SMOOTH)
    found = places.copy()
    for order in (range(1, len(found)), range(len(found) - 2, -1, -1)):
        before = found[0 if order.step > 0 else -1]
        for k in order:
            found[k] = before = keep * before + (1.0 - keep) * found[k]
    return found
