"""Sensor types that see: depth camera and lidar, on the base or on a link.

Position and angles of a camera are those of its *mount*, as of an inertial unit: x
forward, y left, z up. Pictures are in its *optical frame*: z forward, x right, y down
(ROS REP 103); the first row is the top, the first column the left.

A depth is the distance along the optical axis for a camera and along the ray for a
lidar. It is infinite where no surface is within range, minus infinity where one is
nearer than the least range, and NaN where a reading is lost (ROS REP 117, 118).
"""

from __future__ import annotations

import math
from dataclasses import field
from typing import Annotated, ClassVar

import numpy as np

from skyarm.algebra import ZERO3, Mat3, Vec3
from skyarm.records import coerce
from skyarm.records.arrays import Array
from skyarm.records.coerce import RecordError, refuse
from skyarm.records.field_rules import accept_fields, checked
from skyarm.records.files import shown
from skyarm.records.immutable import UNWRITTEN, immutable
from skyarm.records.units import Unit, nonnegative, positive
from skyarm.sensing.sensor import Sensor
from skyarm.sensing.sensor_kinds import mount_rotation
from skyarm.vehicle import Vehicle
from skyarm.vehicle.check import FARTHEST
from skyarm.vehicle.vehicle_records import BASE_NAME, body_index

OPTICAL = Mat3.from_numbers(((0, 0, 1), (-1, 0, 0), (0, -1, 0)))
"""Rotation from optical axes to those of the mount."""

MOST = 4_000_000
"""Largest number of rays of a picture, which takes 32 MB for each of its numbers."""

WIDEST = 3.0
"""Largest field of view (rad) of a camera; the picture of half a turn has no end."""

Range = tuple[float, float]

Rows = Annotated[int, Unit("", "number of rows", low=1, fixed=True)]

Columns = Annotated[int, Unit("", "number of columns", low=1, fixed=True)]


@immutable
@checked("")
class DepthNoise:
    """Noise of a depth: deviation ``constant + quadratic (depth - offset)^2``.

    Source: Nguyen, Izadi, Lovell 2012, Modeling Kinect sensor noise for improved 3D
    reconstruction and tracking: 0.0012 m, 0.0019 1/m and 0.4 m of a Kinect.
    """

    constant: Annotated[
        float, nonnegative("m", "deviation of the depth at the offset", fixed=True)
    ] = 0.0
    quadratic: Annotated[
        float,
        nonnegative("1/m", "growth of the deviation with the square", fixed=True),
    ] = 0.0
    offset: Annotated[
        float, nonnegative("m", "depth of least deviation", fixed=True)
    ] = 0.0

    def deviation(self, depth: Array) -> Array:
        """Standard deviation (m) at depths (m)."""
        away = depth - self.offset
        return np.asarray(self.constant + self.quadratic * away * away)

    @property
    def any(self) -> bool:
        """True if there is noise."""
        return bool(self.constant or self.quadratic)


@immutable
class RaySensor(Sensor):
    """Base class of cameras and lidars: mount, rate, range and errors.

    Its pictures are no part of a control period: they follow from the poses of all
    bodies (:mod:`skyarm.simulate.eyes`), so a flight does not change by a camera.

    Attributes:
        position, rpy: mount on the link, Rz(yaw) Ry(pitch) Rx(roll) to the link's axes.
    """

    sees: ClassVar[bool] = True

    link: Annotated[
        str,
        Unit("", "link that carries the sensor, or base", rule=coerce.name),
    ] = BASE_NAME
    position: Annotated[
        Vec3, Unit("m", "place of the sensor, axes of its link", fixed=True)
    ] = field(default=ZERO3, metadata={UNWRITTEN: ZERO3})
    rpy: Annotated[
        Vec3,
        Unit("rad", "roll, pitch and yaw of the mount's axes in the link", fixed=True),
    ] = field(default=ZERO3, metadata={UNWRITTEN: ZERO3})
    frequency: Annotated[
        float, positive("Hz", "pictures a second; divides the control rate", fixed=True)
    ] = 10.0
    latency: Annotated[
        float,
        nonnegative(
            "s",
            "age of a picture when it arrives, whole control periods",
            fixed=True,
        ),
    ] = 0.0
    nearest: Annotated[
        float, nonnegative("m", "least range; what is nearer reads -inf", fixed=True)
    ] = 0.0
    farthest: Annotated[
        float, positive("m", "largest range; what is farther reads inf", fixed=True)
    ] = 10.0
    noise: Annotated[
        DepthNoise,
        Unit("", "white noise, deviation constant + quadratic (depth - offset)^2"),
    ] = DepthNoise()
    grazing: Annotated[
        float,
        nonnegative(
            "rad",
            "angle between ray and surface below which a reading is lost; 0: none",
            high=0.5 * math.pi,
            fixed=True,
        ),
    ] = 0.0
    sees_own_link: Annotated[
        bool, Unit("", "whether shapes of the sensor's own link are seen")
    ] = False

    def __post_init__(self) -> None:
        accept_fields(self, "")
        if not self.nearest < self.farthest:
            refuse("nearest", self.nearest, f"must be below farthest = {self.farthest}")
        rows, columns = self.shape
        if rows * columns > MOST:
            raise RecordError(
                f"{', '.join(self.sizes)} = {rows} x {columns}: must be at most"
                f" {MOST} rays"
            )

    sizes: ClassVar[tuple[str, str]]
    """Names of the fields with the numbers of rows and columns."""

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of rows and columns of a picture."""
        rows, columns = self.sizes
        return getattr(self, rows), getattr(self, columns)

    def intrinsics(self) -> tuple[float, float, float, float] | None:
        """Focal lengths and principal point fx, fy, cx, cy (pixels) of an image plane;
        None without one.
        """
        return None

    @property
    def fan(self) -> tuple[float, float, float, float] | None:
        """Azimuths at left and right edge and elevations at lower and upper edge (rad)
        of a fan of rays; None without one.
        """
        return None

    def directions(self) -> Array:
        """Directions (rows, columns, 3) of the rays, optical axes, whose length is one
        unit of depth.
        """
        raise NotImplementedError(f"{type(self).__name__} must define directions()")

    def body_of(self, vehicle: Vehicle) -> int:
        """Body that carries the sensor: BASE, or the index of a link.

        Raises:
            RecordError: the vehicle has no such link.
        """
        return body_index(vehicle, "link", self.link)

    @property
    def rotation(self) -> Mat3:
        """Rotation from optical axes to those of the link."""
        R_LM = mount_rotation(self.rpy)
        return OPTICAL if R_LM is None else R_LM @ OPTICAL

    def require_vehicle(self, vehicle: Vehicle) -> None:
        """Refuse a vehicle without the sensor's link, and a mount that is far from
        it.
        """
        self.body_of(vehicle)
        far = math.hypot(*map(float, self.position))
        if far > FARTHEST:
            given = shown([float(each) for each in self.position])
            raise RecordError(
                f"position = {given}: must be within {FARTHEST:g} m of the link's"
                " origin"
            )


@immutable
class DepthCamera(RaySensor):
    """Depth camera: distance along the optical axis of what each pixel sees, m.

    Attributes:
        width, height: numbers of columns and rows.
        field_of_view: horizontal, from edge to edge; pixels are square.
    """

    sizes: ClassVar[tuple[str, str]] = "height", "width"

    width: Columns = 64
    height: Rows = 48
    field_of_view: Annotated[
        float,
        positive(
            "rad",
            "horizontal field of view, from edge to edge",
            high=WIDEST,
            fixed=True,
        ),
    ] = 1.2

    def intrinsics(self) -> tuple[float, float, float, float]:
        """Focal lengths and principal point fx, fy, cx, cy (pixels); the middle of the
        first pixel is at zero.
        """
        focal = 0.5 * self.width / math.tan(0.5 * self.field_of_view)
        return focal, focal, 0.5 * (self.width - 1), 0.5 * (self.height - 1)

    def directions(self) -> Array:
        """Directions (rows, columns, 3) of the rays, optical axes, with z = 1."""
        fx, fy, cx, cy = self.intrinsics()
        x, y = np.meshgrid(
            (np.arange(self.width) - cx) / fx, (np.arange(self.height) - cy) / fy
        )
        return np.stack([x, y, np.ones_like(x)], axis=-1)


@immutable
class Lidar(RaySensor):
    """Lidar: distance along each ray of a fan of rows and columns, m.

    Rays go through the middles of equal parts of ``elevation`` and ``azimuth``, so that
    a full turn has no ray twice.
    """

    sizes: ClassVar[tuple[str, str]] = "rows", "columns"

    rows: Rows = 16
    columns: Columns = 360
    elevation: Annotated[
        Range,
        Unit(
            "rad",
            "lowest and highest elevation above the mount's x-y plane",
            low=-0.5 * math.pi,
            high=0.5 * math.pi,
            fixed=True,
        ),
    ] = (-0.28, 0.28)
    azimuth: Annotated[
        Range,
        Unit(
            "rad",
            "azimuths about the mount's z axis, 0 ahead, left positive",
            low=-math.pi,
            high=math.pi,
            fixed=True,
        ),
    ] = (-math.pi, math.pi)

    def __post_init__(self) -> None:
        RaySensor.__post_init__(self)
        for name in ("elevation", "azimuth"):
            low, high = getattr(self, name)
            if not low < high:
                refuse(name, [low, high], "must rise")

    @property
    def fan(self) -> tuple[float, float, float, float]:
        """Azimuths at left and right edge, elevations at lower and upper edge (rad)."""
        right, left = self.azimuth
        return left, right, *self.elevation

    def directions(self) -> Array:
        """Unit vectors (rows, columns, 3) of the rays, optical axes."""
        angles = (self.azimuth, self.columns), (self.elevation, self.rows)
        left, up = np.meshgrid(
            *(
                # each ray in the middle of its cell, from the left and from above
                high - (high - low) * (np.arange(count) + 0.5) / count
                for (low, high), count in angles
            )
        )
        x, z = -np.cos(up) * np.sin(left), np.cos(up) * np.cos(left)
        return np.stack([x, -np.sin(up), z], axis=-1)
