"""Camera paths of films: position and direction at every frame."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from numpy.linalg import norm

from skyarm.records.arrays import Array, doubles, lengths
from skyarm.records.files import must_be_one_of, shown
from skyarm.view.picture.frames import FlightFrames, Flights, by_flight
from skyarm.view.picture.mujoco_sink import FIELD_OF_VIEW, CameraPath
from skyarm.world.scene.scene import OBSTACLES, hidden_share
from skyarm.world.scene.shapes import Shape
from skyarm.world.scene.vehicle_shapes import longest_boom, matrices

AZIMUTH, ELEVATION = 125.0, -16.0
"""View direction (deg): along +x turned by the azimuth about z, and downwards by
-elevation."""

SIDES = (AZIMUTH, 180.0 - AZIMUTH, -AZIMUTH, AZIMUTH - 180.0)
"""Candidate azimuths: from the front right, from the rear right, and the same from the
left."""

ACROSS = tuple(90.0 - side for side in SIDES)
"""Further candidates for several vehicles, which may stand behind each other in the
others: nearer to the x axis."""

LOOKS = 24
"""Number of instants at which a view is evaluated."""

SMOOTH = 0.6
"""Time constant (s) with which a following camera turns."""


def _axes_of_view(azimuth: float) -> Array:
    """Camera axes right, up and away (matrix columns) for a viewing azimuth (deg) and
    the elevation ELEVATION.
    """
    az = math.radians(azimuth)
    away = looking_towards(azimuth)
    right = np.array([math.sin(az), -math.cos(az), 0.0])
    return np.stack([right, np.cross(right, away), away], axis=1)


HEIGHT = 0.4
"""Height over width of a flying vehicle at its usual attitudes."""

LEAVES = 6.0
"""Distance from the desired position, in reaches of a vehicle, beyond which a following
camera stops following it."""


def fixed_camera(flights: Flights, seconds: Array, aspect: float) -> CameraPath:
    """Path of a camera that stands still and keeps all vehicles in view."""
    places = np.concatenate(
        [part for flight in flights for part in _places_in_view(flight)]
    )
    azimuth = free_azimuth(flights)
    view = _axes_of_view(azimuth)
    low, high = ((places @ view).min(axis=0), (places @ view).max(axis=0))
    middle = view @ (0.5 * (low + high))
    distance = _distance_for_positions(places - middle, flights, aspect, azimuth)
    return _path(np.tile(middle, (len(seconds), 1)), distance, azimuth)


def follow(flights: Flights, seconds: Array, aspect: float) -> CameraPath:
    """Path of a camera that follows the vehicles and their desired positions."""
    places = np.stack([part for flight in flights for part in _places_in_view(flight)])
    middle = _low_pass(0.5 * (places.min(axis=0) + places.max(axis=0)), seconds)
    azimuth = free_azimuth(flights)
    return _path(
        middle,
        _distance_for_positions(
            (places - middle).reshape(-1, 3), flights, aspect, azimuth
        ),
        azimuth,
    )


def tip(flights: Flights, seconds: Array, aspect: float) -> CameraPath:
    """Path of a close-up camera that follows the desired tip position."""
    desired = np.mean([flight.desired_tip for flight in flights], axis=0)
    apart = max(
        float(norm(flight.desired_tip - desired, axis=1).max()) for flight in flights
    )
    # 0.9 is chosen: a little closer than what shows the whole vehicle
    distance = _distance_for_sphere(
        0.9 * max(map(vehicle_reach, flights)) + apart, aspect
    )
    return _path(_low_pass(desired, seconds), distance, free_azimuth(flights))


def sensor_camera(
    name: str, flights: Flights, seconds: Array, aspect: float
) -> CameraPath:
    """Path of a depth camera on the first vehicle that has it, whose whole picture is
    in view.
    """
    flight, sensor = next(
        (each, each.cameras[name]) for each in flights if name in each.cameras
    )
    body = sensor.body_of(flight.vehicle)
    places = flight.place(sensor.position, body)
    height, width = sensor.shape
    fx, fy, *_ = sensor.intrinsics()
    return replace(
        _path(places, 0.0, 0.0),
        rotation=flight.poses[body][0] @ matrices(sensor.rotation, 1)[0],
        # of the wider direction, in a panel of another shape than the picture
        slope=0.5 * max(height / fy, width / fx / aspect),
    )


def hides(flight: FlightFrames, name: str, shape: Shape) -> bool:
    """True for a shape of the link that carries a depth camera, which does not see
    it.
    """
    sensor = flight.cameras.get(name)
    if sensor is None or sensor.sees_own_link or shape.role in OBSTACLES:
        return False
    return bool(shape.body == sensor.body_of(flight.vehicle))


Path = Callable[[Flights, Array, float], CameraPath]

CAMERAS: dict[str, Path] = {
    "follow": follow,
    "fixed": fixed_camera,
    "tip": tip,
}
"""Camera path by name: function (flights in one picture, seconds of film (F,), width
over height) -> path."""


def camera_named(name: str, flights: Flights = (), cure: str = "") -> Path:
    """Return the camera path of a name, also of a depth camera of the flights.

    Args:
        name: word of ``CAMERAS``, or name of a depth camera.
        flights: flights whose depth cameras are allowed.
        cure: what else shows a depth camera, for the error.

    Raises:
        ValueError: one line: no such camera.
    """
    sensors = dict[str, Any]()
    for flight in flights:
        sensors |= flight.cameras
    flat = [each for each, sensor in sensors.items() if sensor.intrinsics()]
    if name not in (*CAMERAS, *flat):
        known = must_be_one_of([*CAMERAS, *flat], name)
        if name in sensors:
            cure = f"inset = {shown(name)} shows the ranges of this lidar"
        end = f"; {cure}" if cure else ""
        raise ValueError(f"camera = {shown(name)}: {known}{end}")
    return CAMERAS.get(name, partial(sensor_camera, name))


def _path(look_at: Array, distance: float, azimuth: float) -> CameraPath:
    ones = np.ones(len(look_at))
    return CameraPath(look_at, distance * ones, azimuth * ones, ELEVATION * ones)


def vehicle_reach(flight: FlightFrames) -> float:
    """Radius (m) of a vehicle around its base: rotor booms with discs, or the arm,
    whichever is longer.
    """
    arm = float(np.max(lengths(flight.desired_tip - flight.desired_position)))
    # half a boom more for the discs, chosen
    return max(1.5 * longest_boom(flight.vehicle), arm)


def _places_in_view(flight: FlightFrames) -> list[Array]:
    """Positions (F, 3) that the camera keeps in view: actual and desired ones of base
    and tip, and bodies in grasps.
    """
    farthest = LEAVES * vehicle_reach(flight)
    pairs = (flight.position, flight.desired_position), (flight.tip, flight.desired_tip)
    bodies = [
        corner - flight.desired_position for corner in _corners_of_grasped(flight)
    ]
    # a lost vehicle leaves the picture, and so does a body that falls
    return [
        *(
            part
            for at, desired in pairs
            for part in (desired + _limit_lengths(at - desired, farthest), desired)
        ),
        *(
            flight.desired_position
            + _limit_lengths(each, farthest + float(norm(each[0])))
            for each in bodies
        ),
    ]


def _corners_of_grasped(flight: FlightFrames) -> Iterator[Array]:
    """Corners (F, 3) of the movable bodies of a flight with grasps."""
    solids = flight.scene.solids
    # marks of grasps are the only solids of their role
    grasped = any(each.shape.role == "point" for each in solids)
    for body in (each for each in solids if grasped and each.shape.role == "object"):
        half = (
            body.shape.size if body.shape.kind == "box" else (max(body.shape.size),) * 3
        )
        for signs in product((-1.0, 1.0), repeat=3):
            yield body.position + body.rotation @ np.multiply(signs, half)


def _limit_lengths(offset: Array, length: float) -> Array:
    """Shorten vectors (F, 3) that are longer than a given length."""
    size = np.linalg.norm(offset, axis=1, keepdims=True)
    return doubles(offset * np.minimum(1.0, length / np.maximum(size, 1e-9)))


def _distance_for_sphere(radius: float, aspect: float) -> float:
    """Camera distance at which a sphere of given radius fits into the picture."""
    half = math.radians(0.5 * FIELD_OF_VIEW)
    across = math.atan(math.tan(half) * aspect)
    # the narrower of the two angles of view decides
    return radius / math.sin(min(half, across))


def _distance_for_positions(
    places: Array, flights: Flights, aspect: float, azimuth: float
) -> float:
    """Camera distance at which vehicles at all given positions (N, 3), relative to its
    target, are in view.
    """
    across, upwards, away = (places @ _axes_of_view(azimuth)).T
    slope = math.tan(math.radians(0.5 * FIELD_OF_VIEW))
    # the largest vehicle is drawn within it
    margin = 1.6 * max(longest_boom(flight.vehicle) for flight in flights)
    # a ball of radius m is inside an edge of slope e where e times its depth exceeds
    # its offset by m sqrt(1 + e^2)
    needed = [
        (np.abs(off) + margin * share * math.hypot(1.0, edge)) / edge - away
        for off, edge, share in (
            (across, slope * aspect, 1.0),
            (upwards, slope, HEIGHT),
        )
    ]
    return float(np.max(needed))


def _low_pass(places: Array, seconds: Array) -> Array:
    """Zero-phase low-pass filter of a path (F, 3)."""
    step = float(seconds[1] - seconds[0]) if len(seconds) > 1 else 1.0
    keep = math.exp(-step / SMOOTH)
    smooth = places.copy()
    # forward and backward, so that the camera does not lag
    for order in (range(1, len(smooth)), range(len(smooth) - 2, -1, -1)):
        before = smooth[0 if order.step > 0 else -1]
        for k in order:
            smooth[k] = before = keep * before + (1.0 - keep) * smooth[k]
    return smooth


def looking_towards(azimuth: float, elevation: float = ELEVATION) -> Array:
    """Unit vector (3,) of a camera's viewing direction; azimuth and elevation in
    deg.
    """
    az, el = math.radians(azimuth), math.radians(elevation)
    return np.array(
        [math.cos(el) * math.cos(az), math.cos(el) * math.sin(az), math.sin(el)]
    )


def free_azimuth(flights: Flights) -> float:
    """Camera azimuth (deg) from which surfaces and objects hide the tips least, and
    vehicles stand widest apart.
    """
    team = by_flight(flights)[0]
    # nothing can hide the tip: the usual side
    if len(team) == 1 and not any(flight.scene.obstacles for flight in flights):
        return AZIMUTH
    places = np.array([flight.desired_position.mean(axis=0) for flight in team])
    # hidden tips against width, both about 0 to 1
    # 1e-9 m: vehicles at one place have no width, and no division by 0
    places = places / max(float(norm(np.ptp(places, axis=0))), 1e-9)
    sides = SIDES if len(team) == 1 else SIDES + ACROSS
    hidden = [
        sum(_occlusion(flight, -looking_towards(side)) for flight in flights)
        for side in sides
    ]
    apart = [float(np.ptp(places @ _axes_of_view(side)[:, 0])) for side in sides]
    return sides[int(np.argmin(np.subtract(hidden, apart)))]


def _occlusion(flight: FlightFrames, towards: Array) -> float:
    """Share of a flight's time in which a surface or object hides the tip from a given
    direction (3,).
    """
    chosen = np.unique(np.linspace(0, len(flight.tip) - 1, LOOKS).astype(int))
    obstacles = flight.scene.obstacles
    solids = [
        replace(each, position=each.position[chosen], rotation=each.rotation[chosen])
        for each in obstacles
    ]
    return hidden_share(solids, flight.tip[chosen], towards)
