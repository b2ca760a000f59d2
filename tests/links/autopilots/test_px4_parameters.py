"""PX4 parameters of vehicles: rotor geometry, thrust curve, mixer scales and gains
against plain computations.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from stand_in_px4 import Mixer

import skyarm
from skyarm.dynamics.array_front import (
    center_of_mass,
    forward_dynamics,
    inverse_dynamics,
)
from skyarm.links.autopilots.autopilot import place_parameters
from skyarm.links.autopilots.effectiveness import highest_thrust, turning_inertia
from skyarm.links.autopilots.px4_parameters import (
    LAG_SHARE,
    outer_gains,
    rate_bandwidth,
    rate_gains,
    sensor_parameters,
    thrust_factor,
    torque_of_signal,
    vehicle_parameters,
)
from skyarm.scenario.scenario_record import NamedSensor, ScenarioError
from skyarm.sensing.channel import Channel
from skyarm.sensing.navigation_sensors import Barometer, Gnss, Magnetometer
from skyarm.sensing.sensor_kinds import Imu
from skyarm.vehicle.thrust_table import ThrustTable
from skyarm.vehicle.vehicle_records import Vehicle

PLUS, CROSS, TILTED, TABLED = (
    "hummingbird_arm2_rotors",
    "crazyflie_arm1",
    "tilted_hexarotor",
    "hexarotor12_arm5",
)

VEHICLES = [
    PLUS,
    CROSS,
    TILTED,
    TABLED,
    "pelican_arm2",
    "hexarotor_arm6",
    "quadrotor_roll_arm2",
]


def plant_torque(vehicle: Vehicle, thrusts: list[float]) -> np.ndarray:
    """Torque about the centre of mass of rotor thrusts, base axes forward left up: an
    independent computation.
    """
    com = center_of_mass(vehicle, (0, 0, 0), (1, 0, 0, 0), (0,) * vehicle.n)
    total = np.zeros(3)
    for rotor, thrust in zip(vehicle.rotors, thrusts, strict=True):
        force = thrust * np.array([float(c) for c in rotor.axis])
        total += np.cross(np.array([float(c) for c in rotor.position]) - com, force)
        # a propeller's drag turns it back
        total -= float(rotor.direction) * float(rotor.moment_coefficient) * force
    return total


@pytest.mark.parametrize("name", VEHICLES)
def test_a_torque_set_point_of_px4_is_the_same_torque_of_the_plant(name: str) -> None:
    vehicle = skyarm.load_vehicle(name)
    mixer = Mixer(vehicle_parameters(vehicle, 9.81))
    full = np.array(highest_thrust(vehicle))
    share = 0.4
    for axis, (sign, torque) in enumerate(
        zip((1, -1, -1), torque_of_signal(vehicle), strict=True)
    ):
        # PX4's axes are forward right down; thrusts are in proportion to the mixer's
        # shares
        unit = np.zeros(3)
        unit[axis] = sign * 0.01
        thrusts = (mixer.mix[:, :3] @ unit - mixer.mix[:, 5] * share) * full.max()
        wanted = np.zeros(3)
        wanted[axis] = 0.01 * torque
        found = plant_torque(vehicle, list(thrusts))
        still = plant_torque(vehicle, list(-mixer.mix[:, 5] * share * full.max()))
        np.testing.assert_allclose(found - still, wanted, atol=1e-9 * full.max())


def test_rotor_places_are_relative_to_the_centre_of_mass_forward_right_down() -> None:
    # its centre of mass is 1 cm ahead and 9 cm below the origin
    vehicle = skyarm.load_vehicle("hexarotor_arm6")
    com = center_of_mass(vehicle, (0, 0, 0), (1, 0, 0, 0), (0,) * vehicle.n)
    found = vehicle_parameters(vehicle, 9.81)
    for i, rotor in enumerate(vehicle.rotors):
        place = [found[f"CA_ROTOR{i}_P{c}"] for c in "XYZ"]
        assert place == pytest.approx(
            [
                rotor.position[0] - com[0],
                com[1] - rotor.position[1],
                com[2] - rotor.position[2],
            ],
            abs=1e-12,
        )
        assert [found[f"CA_ROTOR{i}_A{c}"] for c in "XYZ"] == [0.0, 0.0, -1.0]
        assert found[f"PWM_MAIN_FUNC{i + 1}"] == 101 + i


def test_the_moment_ratio_is_positive_for_a_rotor_that_turns_counter_clockwise() -> (
    None
):
    vehicle = skyarm.load_vehicle(PLUS)
    found = vehicle_parameters(vehicle, 9.81)
    # cw, ccw, cw, ccw
    assert [math.copysign(1, found[f"CA_ROTOR{i}_KM"]) for i in range(4)] == [
        -1,
        1,
        -1,
        1,
    ]


def test_a_weaker_rotor_has_a_smaller_thrust_coefficient() -> None:
    vehicle = skyarm.load_vehicle(PLUS)
    first = dataclasses.replace(
        vehicle.rotors[0], thrust_coefficient=0.5 * vehicle.rotors[0].thrust_coefficient
    )
    found = vehicle_parameters(
        dataclasses.replace(vehicle, rotors=(first, *vehicle.rotors[1:])), 9.81
    )
    assert found["CA_ROTOR0_CT"] == pytest.approx(0.5 * found["CA_ROTOR1_CT"])


@pytest.mark.parametrize("name", VEHICLES)
def test_the_hover_signal_carries_the_weight(name: str) -> None:
    vehicle = skyarm.load_vehicle(name)
    found = vehicle_parameters(vehicle, 9.81)
    signals = Mixer(found).signals(np.zeros(3), found["MPC_THR_HOVER"])
    lift = 0.0
    for rotor, signal in zip(vehicle.rotors, signals, strict=True):
        speed = signal * float(rotor.max_speed)
        thrust = rotor.table.push(speed) if rotor.table is not None else speed * speed
        lift += float(rotor.thrust_coefficient * thrust * rotor.axis[2])
    # a table of thrusts is no parabola: within 2 %
    assert lift == pytest.approx(
        9.81 * float(vehicle.mass), rel=0.02 if name == TABLED else 0.01
    )


def test_the_thrust_curve_of_a_rotor_with_a_square_law_is_the_square() -> None:
    assert thrust_factor(skyarm.load_vehicle(PLUS).rotors[0]) == pytest.approx(1.0)
    assert 0.9 < thrust_factor(skyarm.load_vehicle(TABLED).rotors[0]) <= 1.0


@pytest.mark.parametrize(("bend", "share"), [(0.3, 0.3), (0.8, 0.8), (1.2, 1.0)])
def test_the_thrust_curve_of_a_table_is_its_bend_up_to_the_square(
    bend: float, share: float
) -> None:
    """Thrusts of the share u of the highest speed, finely; PX4 knows no curve beyond
    the square.
    """
    vehicle = skyarm.load_vehicle(PLUS)
    u = np.linspace(0.0, 1.0, 81)[1:]
    thrust = np.maximum((1 - bend) * u + bend * u * u, 1e-6 * u)
    table = ThrustTable(
        speed=tuple((float(vehicle.rotors[0].max_speed) * u).tolist()),
        thrust=tuple(thrust.tolist()),
    )
    assert thrust_factor(
        dataclasses.replace(vehicle.rotors[0], table=table)
    ) == pytest.approx(share, abs=1e-3)


@pytest.mark.parametrize("name", VEHICLES)
def test_the_rate_loop_has_the_bandwidth_between_a_locked_and_a_free_arm(
    name: str,
) -> None:
    vehicle = skyarm.load_vehicle(name)
    gains = rate_gains(vehicle)
    for axis, letter in enumerate(("ROLL", "PITCH", "YAW")):
        # at a rate error of 1 rad/s
        torque = gains[f"MC_{letter}RATE_P"] * torque_of_signal(vehicle)[axis]
        force = np.zeros(6 + vehicle.n)
        force[3 + axis] = torque
        still = ((0, 0, 0), (1, 0, 0, 0), (0,) * vehicle.n, (0,) * (6 + vehicle.n))
        free = forward_dynamics(vehicle, *still, force, gravity=0.0)[3 + axis]
        # the arm held still: the acceleration whose inverse dynamics has this torque on
        # the base and no force
        columns = np.array(
            [
                inverse_dynamics(vehicle, *still, unit, gravity=0.0)[:6]
                for unit in np.eye(6 + vehicle.n)[:6]
            ]
        )
        locked = np.linalg.solve(columns.T, force[:6])[3 + axis]
        bandwidth = (
            rate_bandwidth(vehicle)
            if letter != "YAW"
            else min(6.0, rate_bandwidth(vehicle))
        )
        # the mean is of the diagonals of the inertia, whose products shift it by little
        assert math.sqrt(free * locked) == pytest.approx(bandwidth, rel=0.03)


DEFAULT = {
    "MC_ROLL_P": 4.0,
    "MC_PITCH_P": 4.0,
    "MPC_XY_VEL_P_ACC": 1.8,
    "MPC_XY_VEL_I_ACC": 0.4,
    "MPC_XY_P": 0.95,
}
"""PX4's own outer gains."""


def of_lag(seconds: float) -> Vehicle:
    """Hexarotor whose rotors have one time constant."""
    vehicle = skyarm.load_vehicle("hexarotor_arm6")
    rotors = [
        dataclasses.replace(r, time_constant_up=seconds, time_constant_down=seconds)
        for r in vehicle.rotors
    ]
    return dataclasses.replace(vehicle, rotors=tuple(rotors))


def cascade(vehicle: Vehicle, lag: float) -> tuple[np.ndarray, np.ndarray]:
    """PX4's position, velocity, attitude and rate loops along one axis around rotors of
    a lag: x' = A x + b(s) p.

    x is position, velocity, acceleration by tilt, its rate and second rate (first-order
    rotors), and the integral of the velocity error; b is the forcing at s = j by a
    reference position of 1, with its velocity and acceleration.
    """
    g, rate = outer_gains(vehicle), rate_bandwidth(vehicle)
    attitude, velocity, integral = (
        g["MC_PITCH_P"],
        g["MPC_XY_VEL_P_ACC"],
        g["MPC_XY_VEL_I_ACC"],
    )
    slope, position = g.get("MPC_XY_VEL_D_ACC", 0.2), g["MPC_XY_P"]  # 0.2 is PX4's own
    A, b = np.diag([1.0, 1.0, 1.0, 1.0, 0.0], 1), np.zeros(6, complex)
    wanted = np.array(
        [-velocity * position, -velocity, -slope - 1.0, 0.0, 0.0, integral]
    )
    A[4] = (rate * (attitude * wanted - np.eye(6)[3]) - np.eye(6)[4]) / lag
    A[5] = [-position, -1.0, 0.0, 0.0, 0.0, 0.0]
    b[4], b[5] = (
        rate * attitude * (1j * 1j + velocity * (1j + position)) / lag,
        1j + position,
    )
    return A, b


def test_outer_gains_are_no_weaker_than_px4_s_own_where_the_rotors_allow() -> None:
    for vehicle in (
        skyarm.load_vehicle(PLUS),
        skyarm.load_vehicle(TABLED),
        of_lag(0.04),
    ):
        gains = outer_gains(vehicle)
        assert all(gains[name] >= value for name, value in DEFAULT.items())
        assert gains["MPC_XY_VEL_P_ACC"] <= 5.0  # PX4's ranges
        assert gains["MPC_XY_P"] <= 2.0
    assert rate_bandwidth(skyarm.load_vehicle(PLUS)) == 18.0
    assert rate_bandwidth(skyarm.load_vehicle(TABLED)) == pytest.approx(
        LAG_SHARE / 0.06
    )
    assert outer_gains(of_lag(0.2))["MPC_XY_P"] < DEFAULT["MPC_XY_P"]


@pytest.mark.parametrize("lag", [0.02, 0.03, 0.04, 0.05, 0.06, 0.1, 0.2])
def test_the_cascade_is_damped_whatever_the_rotors_lag(lag: float) -> None:
    poles = np.linalg.eigvals(cascade(of_lag(lag), lag)[0])
    assert (-poles.real / abs(poles)).min() > 0.4
    # rad/s of the slowest pole, that of the integral among them
    fast = 0.8 if lag < 0.07 else 0.1
    assert -poles.real.max() > fast * 0.25


@pytest.mark.parametrize("lag", [0.02, 0.03, 0.04, 0.05, 0.06])
def test_a_circle_of_a_metre_at_a_metre_a_second_is_flown_within_eleven_centimetres(
    lag: float,
) -> None:
    A, b = cascade(of_lag(lag), lag)
    flown = np.linalg.solve(1j * np.eye(6) - A, b)[0]
    assert abs(1.0 - flown) < 0.11


def test_yaw_is_no_faster_than_roll_and_pitch_of_slow_rotors() -> None:
    vehicle = skyarm.load_vehicle("hummingbird")
    lazy = [
        dataclasses.replace(each, time_constant_up=0.2, time_constant_down=0.3)
        for each in vehicle.rotors
    ]
    vehicle = dataclasses.replace(vehicle, rotors=tuple(lazy))
    gains = rate_gains(vehicle)
    for axis, letter in enumerate(("ROLL", "PITCH", "YAW")):
        acceleration = (
            gains[f"MC_{letter}RATE_P"]
            * torque_of_signal(vehicle)[axis]
            / turning_inertia(vehicle)[axis]
        )
        assert acceleration == pytest.approx(2.0)  # 0.5 over 0.25 s
    assert gains["MC_ROLLRATE_I"] == pytest.approx(2.0 / 13.5 * gains["MC_ROLLRATE_P"])
    assert gains["MC_YAWRATE_I"] == pytest.approx(2.0 / 12.0 * gains["MC_YAWRATE_P"])
    assert (gains["MC_PITCHRATE_D"], gains["MC_YAWRATE_D"]) == pytest.approx(
        (0.02 * gains["MC_PITCHRATE_P"], 0.0)
    )


def test_px4_is_told_the_delays_and_the_noise_of_the_sensors() -> None:
    sensors = (
        NamedSensor(
            name="gnss",
            sensor=Gnss(
                latency=0.12, position=Channel(sigma=0.3), velocity=Channel(sigma=0.001)
            ),
        ),
        NamedSensor(name="magnetometer", sensor=Magnetometer(latency=0.02)),
        NamedSensor(name="barometer", sensor=Barometer(latency=0.04)),
    )
    found = sensor_parameters(
        dataclasses.replace(skyarm.load_scenario("case3"), sensors=sensors)
    )
    names = (
        "EKF2_GPS_DELAY",
        "EKF2_MAG_DELAY",
        "EKF2_BARO_DELAY",
        "EKF2_GPS_P_NOISE",
        "EKF2_GPS_V_NOISE",
    )
    assert [found[name] for name in names] == pytest.approx(
        [120.0, 20.0, 40.0, 0.3, 0.01]
    )
    assert not any(name.startswith("EKF2_IMU_POS") for name in found)


def test_an_autopilot_is_told_the_place_of_its_inertial_unit_front_right_down() -> None:
    imu = NamedSensor(
        name="imu", sensor=Imu(position=[0.1, 0.02, -0.03], rpy=[0.0, 0.0, 1.0])
    )
    placed = dataclasses.replace(skyarm.load_scenario("case3"), sensors=(imu,))
    assert place_parameters(placed, "INS_POS1_") == {
        "INS_POS1_X": 0.1,
        "INS_POS1_Y": -0.02,
        "INS_POS1_Z": 0.03,
    }
    assert place_parameters(skyarm.load_scenario("case3"), "INS_POS1_") == {}


def test_the_inertia_of_a_vehicle_without_an_arm_is_its_base_s() -> None:
    vehicle = skyarm.load_vehicle("hummingbird")
    assert turning_inertia(vehicle) == pytest.approx((0.007, 0.007, 0.012))


def test_vehicles_that_px4_cannot_fly_are_refused_in_one_line() -> None:
    vehicle = skyarm.load_vehicle(PLUS)
    heavy = [dataclasses.replace(rotor, max_speed=480.0) for rotor in vehicle.rotors]
    idle = [
        dataclasses.replace(rotor, moment_coefficient=0.0) for rotor in vehicle.rotors
    ]
    for rotors, words in (
        (vehicle.rotors[:2], "2 rotors: must be 3 to 12"),
        (heavy, "must lift more"),
        (idle, "torques about all three axes"),
    ):
        with pytest.raises(ScenarioError, match=words) as caught:
            vehicle_parameters(dataclasses.replace(vehicle, rotors=tuple(rotors)), 9.81)
        assert "\n" not in str(caught.value)
