"""Sensor messages of PX4: signs of every field, new readings, and values that the wire
cannot carry.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from px4_flights import READINGS
from scipy.spatial.transform import Rotation

from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics.state import State
from skyarm.links.autopilots.px4_sensors import HOME, SensorMessages, pressure_altitude
from skyarm.sensing.navigation_sensors import Barometer, Gnss, Magnetometer

TO_WIRE = np.diag([1.0, -1.0, -1.0])
"""From forward left up to forward right down, and from north west up to north east
down."""


def readings_at(
    attitude: Rotation, position: tuple[float, ...], velocity: tuple[float, ...]
) -> dict[str, tuple]:
    """True readings of a vehicle that hovers at an attitude, by our sensors."""
    x, y, z, w = attitude.as_quat()
    state = State(
        position=Vec3(*position),
        quaternion=Quaternion(w, x, y, z),
        velocity=Vec3(*velocity),
        rate=Vec3(0.1, 0.2, 0.3),
        joints=(),
        joint_rates=(),
        rotor_speeds=(),
    )
    force = attitude.inv().apply([0.0, 0.0, 9.81])
    found = {"imu": (0.0, 0.1, 0.2, 0.3, *force)}
    for name, sensor in (
        ("magnetometer", Magnetometer()),
        ("barometer", Barometer()),
        ("gnss", Gnss()),
    ):
        values = [
            float(v)
            for _, _, part in sensor.quantities(state, Vec3(*force))
            for v in part
        ]
        found[name] = (0.0, *values)
    return found


@pytest.mark.parametrize(
    "angles", [(0, 0, 0), (0.3, 0, 0), (0, 0.3, 0), (0, 0, 0.8), (0.2, -0.4, 2.5)]
)
def test_gravity_and_field_appear_on_the_axes_of_the_wire(
    angles: tuple[float, float, float],
) -> None:
    attitude = Rotation.from_euler("xyz", angles)
    fields = SensorMessages().inertial(readings_at(attitude, (0, 0, 0), (0, 0, 0)))
    # the rotation from forward right down to north east down, and the vectors there as
    # textbooks have them
    R = TO_WIRE @ attitude.as_matrix() @ TO_WIRE
    force, field = R.T @ [0.0, 0.0, -9.81], R.T @ [0.215, 0.0, 0.427]
    assert [fields[f"{c}acc"] for c in "xyz"] == pytest.approx(list(force))
    assert [fields[f"{c}mag"] for c in "xyz"] == pytest.approx(list(field))
    assert [fields[f"{c}gyro"] for c in "xyz"] == pytest.approx([0.1, -0.2, -0.3])
    assert fields["fields_updated"] == 0b1101111111111


def test_signs_of_simple_attitudes_in_words() -> None:
    nose_up = SensorMessages().inertial(
        readings_at(Rotation.from_euler("y", -0.3), (0, 0, 0), (0, 0, 0))
    )
    assert nose_up["xacc"] > 2.0  # the specific force points out of the nose
    left_down = SensorMessages().inertial(
        readings_at(Rotation.from_euler("x", -0.3), (0, 0, 0), (0, 0, 0))
    )
    assert left_down["yacc"] > 2.0  # and to the right, which is up
    west = SensorMessages().inertial(
        readings_at(Rotation.from_euler("z", math.pi / 2), (0, 0, 0), (0, 0, 0))
    )
    assert west["ymag"] == pytest.approx(0.215)  # north is to the right


def test_satellite_positions_and_velocities_are_north_east_down() -> None:
    fields = SensorMessages().satellite(
        readings_at(Rotation.identity(), (30.0, 40.0, 5.0), (1.0, 2.0, 3.0))
    )
    assert fields is not None
    metre = 1e7 / 111_194  # of latitude, on a sphere: within half a percent
    assert fields["lat"] - HOME[0] * 1e7 == pytest.approx(30 * metre, rel=5e-3)
    assert fields["lon"] - HOME[1] * 1e7 == pytest.approx(
        -40 * metre / math.cos(math.radians(HOME[0])), rel=5e-3
    )
    assert fields["alt"] == pytest.approx((488.0 + 5.0) * 1e3, abs=2)
    assert (fields["vn"], fields["ve"], fields["vd"]) == (100, -200, -300)
    assert fields["vel"] == round(100 * math.hypot(1, 2))
    assert fields["cog"] == pytest.approx(
        100 * (360 - math.degrees(math.atan2(2, 1))), abs=1
    )


def test_a_reading_is_sent_once() -> None:
    messages = SensorMessages()
    assert messages.inertial(READINGS)["fields_updated"] == 0b1101111111111
    assert messages.satellite(READINGS) is not None
    later = READINGS | {
        "imu": (0.004, *READINGS["imu"][1:]),
        "barometer": (0.02, 950.0, 11.0),
    }
    assert messages.inertial(later)["fields_updated"] == 0b1101000111111
    assert "xmag" not in messages.inertial(later)
    assert messages.satellite(later) is None


@pytest.mark.parametrize("height", [-400.0, 0.0, 488.0, 3000.0])
def test_the_altitude_of_a_pressure_inverts_the_barometer(height: float) -> None:
    pressure = float(
        readings_at(Rotation.identity(), (0, 0, height - 488.0), (0, 0, 0))[
            "barometer"
        ][1]
    )
    # a geopotential height: 0.016 % less per km of height
    assert pressure_altitude(pressure) == pytest.approx(
        height, abs=0.1 + abs(height) ** 2 / 6.3e6
    )


def test_velocities_that_the_wire_cannot_carry_are_cut_off() -> None:
    fields = SensorMessages().satellite(
        READINGS | {"gnss": (0.0, 0.0, 0.0, 1e6, 900.0, -900.0, 1e9)}
    )
    assert fields is not None
    assert (fields["vn"], fields["ve"], fields["vd"], fields["vel"]) == (
        32767,
        32767,
        -32767,
        32767,
    )


@pytest.mark.parametrize(
    ("height", "millimetres"), [(3e6, 2147483647), (-3e6, -2147483647), (1e3, 1488000)]
)
def test_a_height_that_32_bits_cannot_carry_in_millimetres_is_cut_off(
    height: float, millimetres: int
) -> None:
    fields = SensorMessages().satellite(
        READINGS | {"gnss": (0.0, 0.0, 0.0, height, 0.0, 0.0, 0.0)}
    )
    assert fields is not None
    assert fields["alt"] == pytest.approx(
        millimetres, abs=1.0 if abs(height) < 1e6 else 0.0
    )
