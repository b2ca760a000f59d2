"""Betaflight's configuration for a vehicle (mixer, thrust curve, gains), its radio
sticks and state messages.

Numbers and units are those of Betaflight 4.6.0.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from skyarm.algebra.frames import to_our_attitude, to_our_axes
from skyarm.dynamics.actuators.rotor import push
from skyarm.links.autopilots.angle_control import AttitudeCommand
from skyarm.links.autopilots.autopilot import Numbers
from skyarm.links.autopilots.effectiveness import (
    inertias,
    turning_inertia,
    unit_wrenches,
)
from skyarm.records.arrays import Array, float_array
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.vehicle import Vehicle

STATE, RADIO, MOTORS = (
    struct.Struct("<18d"),
    struct.Struct("<d16H"),
    struct.Struct("<H2x16f"),
)

MOST_ROTORS = 8

IDLE = 0.03
"""Motor signal of an armed motor at zero throttle."""

LINEARIZATION = 1.5
"""Betaflight's largest thrust linearisation; a thrust quadratic in the signal is then
linear within 6 % of full thrust."""

TILT_LIMIT, YAW_LIMIT = 30.0, 120.0
"""Tilt (deg) and yaw rate (deg/s) at the end of a stick."""

LOWEST_STICK = 1050
"""Stick position (us) at which Betaflight's throttle begins."""

UNITS = {"P": 0.032029, "I": 0.244381, "D": 0.000529}
"""Motor signal, in thousandths, per deg/s, deg and deg/s^2 at a gain of 1 (Betaflight
4.6, scales of its rate loop)."""

QUICKEST_RATE, QUICKEST_YAW = 32.0, 8.0
"""Largest bandwidths (rad/s) of the rate loop and of its yaw axis, chosen; at most 0.4
of a rotor's bandwidth is used, which rotors of more than 12.5 ms feel."""


def curve(mix: float) -> float:
    """Motor signal (0 to 1) for a mixed throttle (0 to 1), after Betaflight's thrust
    linearisation.
    """
    return IDLE + (1.0 - IDLE) * min(
        max(mix * (1.0 + LINEARIZATION * (1.0 - mix) ** 2), 0.0), 1.0
    )


def mix_of(throttle: float) -> float:
    """Mixed throttle (0 to 1) at a throttle stick position (0 to 1), as Betaflight
    inverts its thrust linearisation.
    """
    amount = LINEARIZATION - 0.5 * LINEARIZATION**2
    return throttle / (1.0 + amount * (1.0 - throttle) ** 2)


def shares(vehicle: Vehicle) -> Array:
    """Thrust and torque (4, n) per unit thrust of each rotor, about the centre of mass
    with the joints at zero.
    """
    return unit_wrenches(vehicle)[[5, 0, 1, 2]]


def mixer(vehicle: Vehicle) -> Array:
    """Custom mixer for Betaflight (n, 4): each motor's coefficients of throttle, roll,
    pitch and yaw.

    The columns are those of the pseudo-inverse of the rotors' effectiveness, the
    largest share 1. Betaflight turns the sign of the yaw's round.
    """
    if not 3 <= len(vehicle.rotors) <= MOST_ROTORS:
        raise ScenarioError(
            f"plant.vehicle: {len(vehicle.rotors)} rotors: must be 3 to {MOST_ROTORS}"
            " for Betaflight"
        )
    mix = np.asarray(np.linalg.pinv(shares(vehicle)), dtype=np.float64)
    mix /= np.abs(mix).max(axis=0)
    # 5 % of the largest share, chosen
    if mix[:, 0].min() <= 0.05:
        raise ScenarioError(
            "plant.vehicle: every rotor must carry a share of the weight for Betaflight"
        )
    mix[:, 3] *= -1.0
    return mix


def thrust_of(vehicle: Vehicle, mixes: Array) -> Array:
    """Thrust (N) of each rotor for given mixed throttles."""
    rows = zip(vehicle.rotors, mixes, strict=True)
    return float_array(
        r.thrust_coefficient * push(r, curve(float(x)) * r.max_speed) for r, x in rows
    )


def hover_slope(vehicle: Vehicle, gravity: float) -> Array:
    """Derivative of each rotor's thrust (N) with respect to the mixed throttle, in
    hover.
    """
    share = mixer(vehicle)[:, 0]
    weight, low, high = float(vehicle.mass) * gravity, 0.0, 1.0
    # a tenth more than the weight, chosen
    if thrust_of(vehicle, share).sum() < 1.1 * weight:
        raise ScenarioError(
            "plant.vehicle: full thrust must be at least 1.1 times the weight for"
            " Betaflight"
        )
    # bisection: the curve rises steadily, and 50 halvings reach rounding
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (
            (middle, high)
            if thrust_of(vehicle, middle * share).sum() < weight
            else (low, middle)
        )
    # a difference about the hover; its width is chosen
    step = 0.02
    slope = thrust_of(vehicle, low * share + step) - thrust_of(
        vehicle, low * share - step
    )
    return slope / (2.0 * step)


def vehicle_loops(vehicle: Vehicle, gravity: float) -> tuple[Array, dict[str, int]]:
    """Mixer (:func:`mixer`) and control gains for a vehicle, in Betaflight's units.

    The bandwidth of the rate loop is ``QUICKEST_RATE`` for the geometric mean of the
    inertias with limp and with locked joints, since a joint's controller is somewhere
    between. P = bandwidth J / torque per mix in hover. The integral gains are a third
    of what the bandwidth is with locked joints (yaw: a quarter), times P, and so is the
    gain of the angle. A share of the mixer grows where P would not fit into
    Betaflight's range.
    """
    mix = mixer(vehicle)
    torques = np.abs(np.diag((shares(vehicle) * hover_slope(vehicle, gravity)) @ mix))[
        1:
    ]
    slowest = max(float(rotor.time_constant_up) for rotor in vehicle.rotors)
    # of a rigid vehicle, with the lag of its rotors alone, 0.4 and the thirds below
    # leave the rate loop a damping ratio of 0.81 and the angle loop 0.43 (computed);
    # 0.8 for 0.4 leaves them 0.41 and 0.16, halves for the integral's third 0.61 and
    # 0.30. 1e-3, as a rotor without lag would divide by zero
    fast = min(QUICKEST_RATE, 0.4 / max(slowest, 1e-3))
    (_, locked), turning = inertias(vehicle), turning_inertia(vehicle)
    settings: dict[str, int] = {}
    angle = fast
    # Betaflight multiplies the integral gain of yaw by 2.5, and takes 250 at most
    for i, (name, bandwidth, boost) in enumerate(
        (
            ("roll", fast, 1.0),
            ("pitch", fast, 1.0),
            ("yaw", min(QUICKEST_YAW, fast), 2.5),
        )
    ):
        inertia = turning[i]
        slow = bandwidth * inertia / locked[i]
        # thousandths per deg/s
        gain = bandwidth * inertia / torques[i] * 1e3 * math.pi / 180.0
        # P is at most 200 in the settings: beyond, the mixer's share is the larger
        # factor
        grow = max(gain / UNITS["P"] / 200.0, 1.0)
        mix[:, i + 1] *= grow
        gain /= grow
        # a quarter puts both poles of a loop without lag in one place
        integral = slow / (3.0 if name != "yaw" else 4.0)
        # a gain of 0 would switch the axis off
        settings[f"p_{name}"] = max(round(gain / UNITS["P"]), 1)
        settings[f"i_{name}"] = min(round(integral * gain / (UNITS["I"] * boost)), 250)
        # the damping ratios above are without D
        settings |= {f"d_{name}": 0, f"d_max_{name}": 0, f"f_{name}": 0}
        # of all axes that tilt the thrust the slowest one bounds the angle loop
        angle = min(angle, slow / 3.0) if name != "yaw" else angle
    settings["angle_p_gain"] = round(10.0 * angle)
    return mix, settings


def console_lines(
    vehicle: Vehicle, gravity: float, parameters: Mapping[str, float]
) -> list[str]:
    """Lines for Betaflight's command line that configure it for a vehicle."""
    lines = ["mixer CUSTOM", "mmix reset"]
    mix, loops = vehicle_loops(vehicle, gravity)
    for i, row in enumerate(mix):
        lines.append(f"mmix {i} " + " ".join(f"{share:.4f}" for share in row))
    lines += [
        "feature -GPS",
        "feature -TELEMETRY",
        "feature AIRMODE",
        # armed by the fifth channel, angle mode by the sixth
        "aux 0 0 0 1700 2100 0 0",
        "aux 1 1 1 1700 2100 0 0",
        # what would delay the sticks, disarm a vehicle that is held on its stand, or
        # change the computed gains in flight is switched off, here and below
        "set rates_type = ACTUAL",
        "set rc_smoothing = OFF",
        "set runaway_takeoff_prevention = OFF",
        "set iterm_relax = OFF",
        "set simplified_pids_mode = OFF",
        "set tpa_mode = D",
    ]
    # in Betaflight's units: us, hundredths of a percent, percent, deg
    numbers: dict[str, float] = {
        "min_check": LOWEST_STICK,
        "motor_idle": round(IDLE * 1e4),
        "thrust_linear": round(LINEARIZATION * 100),
        "angle_limit": round(TILT_LIMIT),
        "angle_feedforward": 0,
        "throttle_boost": 0,
        "anti_gravity_gain": 0,
        # arms at any tilt; tenths of a second without radio, as on a busy machine
        "small_angle": 180,
        "failsafe_delay": 200,
        "tpa_rate": 0,
        "airmode_start_throttle_percent": 5,
    }
    # straight lines: one rate at the middle and at the end of a stick, in tens of deg/s
    for axis, rate in (("roll", 20), ("pitch", 20), ("yaw", round(YAW_LIMIT / 10))):
        numbers |= {f"{axis}_rc_rate": rate, f"{axis}_srate": rate, f"{axis}_expo": 0}
    numbers |= loops | dict(parameters)
    return lines + [f"set {name} = {value:g}" for name, value in numbers.items()]


class Sticks:
    """Conversion of an attitude set point to radio channels (us) for angle mode."""

    def __init__(self, vehicle: Vehicle, gravity: float) -> None:
        self._mass, share = float(vehicle.mass), mixer(vehicle)[:, 0]
        # steps of half a percent, chosen
        self._throttles = np.linspace(0.0, 1.0, 201)
        self._thrusts = np.array(
            [
                thrust_of(vehicle, mix_of(float(t)) * share).sum()
                for t in self._throttles
            ]
        )

    def channels(self, attitude: AttitudeCommand) -> tuple[int, ...]:
        """Stick channels (us) in the order roll, pitch, throttle, yaw; positive yaw
        turns right.
        """
        throttle = float(
            np.interp(self._mass * attitude.thrust, self._thrusts, self._throttles)
        )
        return (
            _stick(math.degrees(attitude.roll) / TILT_LIMIT),
            _stick(math.degrees(attitude.pitch) / TILT_LIMIT),
            round(LOWEST_STICK + throttle * (2000 - LOWEST_STICK)),
            _stick(-math.degrees(attitude.yaw_rate) / YAW_LIMIT),
        )


def _stick(part: float) -> int:
    return round(1500.0 + 500.0 * min(max(part, -1.0), 1.0))


def state_message(
    seconds: float, imu: Numbers, pose: Numbers, velocity: Iterable[float]
) -> bytes:
    """State message for Betaflight from the readings of the inertial unit and of motion
    capture.

    Args:
        seconds: s, time of the state.
        imu: time, rate (rad/s) and specific force (m/s^2) in base axes.
        pose: time, position (m) and attitude w, x, y, z.
        velocity: m/s, world axes.
    """
    w, x, y, z = pose[4:8]
    return STATE.pack(
        seconds,
        *to_our_axes(*imu[1:4]),
        # it turns the sign of the accelerometer round
        *(-force for force in imu[4:7]),
        *to_our_attitude(w, x, y, z),
        *to_our_axes(*velocity),
        *to_our_axes(*pose[1:4]),
        # the standard atmosphere loses 12 Pa a metre near the ground
        101325.0 - 12.0 * pose[3],
    )


def shown_numbers(numbers: Sequence[float]) -> str:
    """Format numbers in brackets for an error message."""
    return "[" + ", ".join(f"{each:g}" for each in numbers) + "]"
