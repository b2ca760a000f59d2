"""PX4 parameters of a vehicle and its sensors: rotor geometry, thrust curve, hover
thrust, controller gains, delays.

Facts about PX4 v1.17: the meaning of the parameters ``CA_ROTOR*``, ``THR_MDL_FAC`` and
``MPC_THR_HOVER``, the scale of its mixer, and its default gains ``MC_*`` and ``MPC_*``.
Axes of its parameters are forward, right, down.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from skyarm.algebra.frames import to_our_axes
from skyarm.links.autopilots.autopilot import place_parameters
from skyarm.links.autopilots.effectiveness import (
    centre_of_mass,
    highest_thrust,
    hover_share,
    proportional_gains,
    square_share,
    unit_wrenches,
)
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.vehicle import Rotor, Vehicle

MOST_ROTORS = 12

ROTOR_FUNCTION = 101
"""Output function of PX4's first motor; those of the others follow."""

RATE_BANDWIDTH = 18.0
"""Largest bandwidth (rad/s) of the rate loop about roll and pitch."""

LAG_SHARE = 0.5
"""Largest bandwidth of the rate loop times the rotors' mean time constant: 27 degrees
of phase lag at the crossing."""

YAW_BANDWIDTH = 6.0
"""Largest bandwidth (rad/s) of the yaw rate loop; PX4 filters the yaw torque at 2
Hz."""

ATTITUDE_RATIO = 2.0
"""Bandwidth of the rate loop over the gain of the attitude loop around it: the damping
optimum of a cascade, in which each loop is half as fast as the one inside it. Source:
Kessler 1955; Naslin 1960, characteristic ratios of 2."""

ATTITUDE_P = 6.0
"""Largest gain (1/s) of the attitude loop; with it the velocity and position gains stay
in PX4's ranges."""

VELOCITY_D = 0.2
"""PX4's default gain of the measured acceleration. It makes the response of the
acceleration 1 + D times as fast and as small, so the damping optimum of the velocity
and position loops is attitude gain (1 + D)^2 / 2 and (1 + D) / 4."""

VELOCITY_P, VELOCITY_I = 1.8, 0.4
"""PX4's default velocity gains (1/s and 1/s^2); their ratio is kept."""


def vehicle_parameters(vehicle: Vehicle, gravity: float) -> dict[str, float]:
    """PX4 parameters of a vehicle: rotor positions, axes and spins, thrust curve, hover
    thrust, control gains.

    Rotor places are relative to the centre of mass with the joints at zero, which PX4
    takes for its origin. The moment ratio is positive for a rotor that turns
    counter-clockwise seen from above.

    Raises:
        ScenarioError: more rotors than PX4 has, fewer than three, or rotors that cannot
            lift the vehicle.
    """
    if not 3 <= len(vehicle.rotors) <= MOST_ROTORS:
        raise ScenarioError(
            f"plant.vehicle: {len(vehicle.rotors)} rotors: must be 3 to {MOST_ROTORS}"
            " for PX4"
        )
    com, full = centre_of_mass(vehicle), highest_thrust(vehicle)
    parameters: dict[str, float] = {
        # type 0 is a multirotor
        "CA_AIRFRAME": 0,
        "CA_ROTOR_COUNT": len(vehicle.rotors),
    }
    largest = max(full)
    for i, (rotor, thrust) in enumerate(zip(vehicle.rotors, full, strict=True)):
        place = (float(a) - float(b) for a, b in zip(rotor.position, com, strict=True))
        for letter, vector in (("P", place), ("A", map(float, rotor.axis))):
            turned = zip("XYZ", to_our_axes(*vector), strict=True)
            parameters |= {f"CA_ROTOR{i}_{letter}{axis}": each for axis, each in turned}
        parameters[f"CA_ROTOR{i}_KM"] = float(rotor.moment_coefficient) * float(
            rotor.direction
        )
        # only ratios of the thrust coefficients count, so the strongest has PX4's
        # default
        parameters[f"CA_ROTOR{i}_CT"] = DEFAULT_THRUST * thrust / largest
        parameters[f"PWM_MAIN_FUNC{i + 1}"] = ROTOR_FUNCTION + i
    hover = hover_share(vehicle, gravity, "PX4", 0.9)
    parameters |= {
        "THR_MDL_FAC": thrust_factor(vehicle.rotors[0]),
        "MPC_THR_HOVER": hover,
    }
    return parameters | rate_gains(vehicle) | outer_gains(vehicle)


DEFAULT_THRUST = 6.5
"""PX4's default thrust coefficient of a rotor; only ratios between the rotors
matter."""


def rate_gains(vehicle: Vehicle) -> dict[str, float]:
    """Gains of PX4's rate loop: P = bandwidth J / torque of a full signal; I and D in
    ratios near PX4's defaults.
    """
    fast = rate_bandwidth(vehicle)
    parameters: dict[str, float] = {}
    wide = (fast, fast, min(YAW_BANDWIDTH, fast))
    gains = proportional_gains(vehicle, torque_of_signal(vehicle), wide)
    for name, gain, bandwidth in zip(
        ("ROLL", "PITCH", "YAW"), gains, wide, strict=True
    ):
        # at the usual bandwidths I / P and D / P are those of PX4's defaults; a slower
        # loop has a slower integral
        integral, slope = (
            (bandwidth / 13.5, 0.02) if name != "YAW" else (bandwidth / 12.0, 0.0)
        )
        parameters |= {
            f"MC_{name}RATE_P": gain,
            f"MC_{name}RATE_I": integral * gain,
            f"MC_{name}RATE_D": slope * gain,
        }
    return parameters


def outer_gains(vehicle: Vehicle) -> dict[str, float]:
    """Gains of PX4's attitude, velocity and position loops: the damping optimum around
    the rate loop.
    """
    attitude = min(ATTITUDE_P, rate_bandwidth(vehicle) / ATTITUDE_RATIO)
    # each loop has half of the bandwidth of the one within it
    velocity = 0.5 * attitude * (1.0 + VELOCITY_D) ** 2
    return {
        "MC_ROLL_P": attitude,
        "MC_PITCH_P": attitude,
        "MPC_XY_VEL_P_ACC": velocity,
        "MPC_XY_VEL_I_ACC": VELOCITY_I * (velocity / VELOCITY_P) ** 2,
        "MPC_XY_VEL_D_ACC": VELOCITY_D,
        "MPC_XY_P": 0.25 * attitude * (1.0 + VELOCITY_D),
    }


def rate_bandwidth(vehicle: Vehicle) -> float:
    """Rate-loop bandwidth (rad/s) about roll and pitch that the rotors' lag permits."""
    slowest = max(
        0.5 * (float(rotor.time_constant_up) + float(rotor.time_constant_down))
        for rotor in vehicle.rotors
    )
    # one that is quicker than a millisecond has no lag here
    return min(RATE_BANDWIDTH, LAG_SHARE / max(slowest, 1e-3))


def thrust_factor(rotor: Rotor) -> float:
    """Least-squares weight a of the square in PX4's thrust curve a s^2 + (1 - a) s of a
    signal s.
    """
    # from a fifth of the signal up, as no rotor flies below
    return min(max(square_share(rotor, [0.2 + 0.05 * k for k in range(17)]), 0.0), 1.0)


def torque_of_signal(vehicle: Vehicle) -> tuple[float, float, float]:
    """Torque (N m) about x, y and z that a full torque set point produces with PX4's
    control allocation.

    PX4 mixes by the pseudo-inverse of the rotors' effectiveness, each column scaled:
    roll and pitch alike so that the signals' root mean square over the rotors that take
    part is 1/sqrt(2) of the larger, yaw by its largest signal.
    Source: PX4 v1.17, control allocation, scale of the mixer's columns.

    Raises:
        ScenarioError: rotors that have no torque about an axis.
    """
    full = np.array(highest_thrust(vehicle))
    most = float(full.max())
    # torque and force of full thrusts, in parts of the largest
    shape = unit_wrenches(vehicle) * (full / most)
    # 1e-6: of an axis that rounding alone turns about no share is made, and it is
    # refused below; 1e-4: rotors with less of a share take no part
    mix = np.linalg.pinv(shape, rcond=1e-6)[:, :3]
    scale = [
        math.sqrt(2.0 * float(c @ c) / max(int(np.count_nonzero(np.abs(c) > 1e-4)), 1))
        for c in mix.T[:2]
    ]
    # PX4's yaw is about an axis down
    scales = np.array([max(scale), max(scale), float((-mix[:, 2]).max())])
    torques = np.diag(shape[:3] @ mix) / np.maximum(scales, 1e-12) * most
    if not (np.all(np.isfinite(torques)) and np.all(torques > 1e-9)):
        raise ScenarioError(
            "plant.vehicle: rotors must have torques about all three axes for PX4"
        )
    x, y, z = torques.tolist()
    return x, y, z


def sensor_parameters(scenario: Scenario) -> dict[str, float]:
    """PX4 parameters of the sensors: delays and noise for its estimator, and zero
    magnetic declination.
    """
    sensors: dict[str, Any] = {
        each.name: each.sensor for each in scenario.agent.sensors
    }
    gnss, magnetometer, barometer = (
        sensors[name] for name in ("gnss", "magnetometer", "barometer")
    )
    return {
        # delays in ms
        "EKF2_GPS_DELAY": 1e3 * float(gnss.latency),
        "EKF2_MAG_DELAY": 1e3 * float(magnetometer.latency),
        "EKF2_BARO_DELAY": 1e3 * float(barometer.latency),
        # PX4 takes no noise below 0.01
        "EKF2_GPS_P_NOISE": max(float(gnss.position.sigma), 0.01),
        "EKF2_GPS_V_NOISE": max(float(gnss.velocity.sigma), 0.01),
        "EKF2_DECL_TYPE": 0,
        "EKF2_MAG_DECL": 0,
        **place_parameters(scenario, "EKF2_IMU_POS_"),
    }
