"""State of a vehicle, and accelerations with and without gravity."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated

from skyarm.algebra import (
    E_Z,
    ZERO3_DATA,
    Mat3,
    Motion,
    Quaternion,
    Scalar,
    Scalars,
    Vec3,
)
from skyarm.algebra.quaternion import euler_angles
from skyarm.algebra.scalars import cos, sin
from skyarm.records.field_rules import checked
from skyarm.records.immutable import field_if_any, immutable
from skyarm.records.path_names import Names, NumberView, field_paths
from skyarm.records.units import Unit
from skyarm.records.words import Word

ANGLES = ("roll", "pitch", "yaw")
"""Names of the ZYX Euler angles of an attitude (rad)."""


BaseVelocity = Annotated[Vec3, Unit("m/s", "velocity of the base origin, world axes")]

JointPositions = Annotated[
    Scalars, Unit("rad or m", "joint positions, in the vehicle's order")
]

JointRates = Annotated[
    Scalars, Unit("rad/s or m/s", "joint rates, in the vehicle's order")
]


@immutable
@checked("state", often=True)
class State:
    """State of a vehicle: all quantities that the simulation integrates."""

    position: Annotated[
        Vec3, Unit("m", "position of the base origin, world axes", usual=1000.0)
    ]
    quaternion: Annotated[
        Quaternion,
        Unit("", "attitude as a unit quaternion w x y z, base to world"),
        Word("quaternion_wxyz"),
    ]
    velocity: BaseVelocity
    rate: Annotated[Vec3, Unit("rad/s", "angular velocity, base axes", usual=50.0)]
    joints: JointPositions = ()
    joint_rates: JointRates = ()
    rotor_speeds: Annotated[
        Scalars, Unit("rad/s", "rotor speeds, unsigned, in the vehicle's order")
    ] = ()
    tilts: Annotated[Scalars, Unit("rad", "angles of the tilting rotors")] = (
        field_if_any(default=())
    )

    @property
    def rotation(self) -> Mat3:
        """Rotation from base axes to world axes."""
        return self.quaternion.rotation()

    def path_names(self) -> Names:
        """Parameter paths of the state's fields, and of roll, pitch and yaw as
        alternatives to the quaternion.
        """
        return field_paths(self) | {
            name: NumberView(name, Unit("rad")) for name in ANGLES
        }

    def number_of_view(self, name: str) -> float:
        """Roll, pitch or yaw angle (rad) of the base, by name."""
        return float(euler_angles(self.rotation)[ANGLES.index(name)])

    def with_views(self, values: Mapping[str, Scalar]) -> State:
        """State with roll, pitch or yaw (rad) replaced, by name.

        The other angles are those read from the state, which reads a pitch within 90
        degrees alone.
        """
        usual = dict(zip(ANGLES, euler_angles(self.rotation), strict=True))
        half = [
            (cos(0.5 * angle), sin(0.5 * angle))
            for angle in (usual | dict(values)).values()
        ]
        about = [
            Quaternion(c, *Vec3(*(s if i == axis else 0.0 for i in range(3))))
            for axis, (c, s) in enumerate(half)
        ]
        # ZYX: yaw first, pitch and roll about the axes that it has turned
        return replace(self, quaternion=about[2] * about[1] * about[0])


def example_state(joints: int, rotors: int, tilts: int = 0) -> State:
    """State at rest and level at the origin, with given numbers of joints, rotors and
    tilting rotors.
    """
    return State(
        position=ZERO3_DATA,
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        velocity=ZERO3_DATA,
        rate=ZERO3_DATA,
        joints=(0.0,) * joints,
        joint_rates=(0.0,) * joints,
        rotor_speeds=(0.0,) * rotors,
        tilts=(0.0,) * tilts,
    )


def proper_acceleration(
    R_WB: Mat3, linear_W: Vec3, angular_B: Vec3, gravity: Scalar
) -> Motion:
    """Base acceleration as an accelerometer reads it, R^T (dv/dt + g e_z), base
    axes.
    """
    return Motion(angular_B, R_WB.apply_T(linear_W + E_Z * gravity))


def coordinate_acceleration(
    R_WB: Mat3, proper: Motion, gravity: Scalar
) -> tuple[Vec3, Vec3]:
    """Linear (world axes) and angular (base axes) acceleration of the base from its
    proper acceleration.
    """
    return R_WB.apply(proper.linear) - E_Z * gravity, proper.angular
