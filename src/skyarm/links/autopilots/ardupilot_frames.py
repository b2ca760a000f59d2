"""Rotor layouts for which ArduPilot has mixers, and ArduPilot's parameters and gains
for a vehicle with one of them.

Facts of ArduCopter 4.7 (its motors, their mixing and the linearisation of thrust).
Angles are clockwise from the front, seen from above; spin +1 is counter-clockwise, -1
clockwise.
"""

from __future__ import annotations

import math

from skyarm.links.autopilots.effectiveness import (
    highest_thrust,
    hover_share,
    proportional_gains,
    square_share,
)
from skyarm.links.autopilots.px4_parameters import RATE_BANDWIDTH, YAW_BANDWIDTH
from skyarm.records.files import shipped_tables
from skyarm.records.immutable import immutable
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.vehicle import Vehicle

Motors = tuple[tuple[float, int], ...]

ANGLE_TOLERANCE = 15.0
"""Largest angle (deg) between a rotor and its position in a frame: under half of the 45
deg between two motors of an octorotor, so that one motor fits at most."""

UPRIGHT = math.cos(math.radians(10.0))
"""Least vertical component of a rotor's axis; ArduPilot assumes parallel thrusts. At 10
deg 1.5 % of a thrust are lost to it; chosen."""


@immutable
class ArduPilotFrame:
    """Rotor layout that ArduPilot has a mixer for: frame class and type, angle and spin
    of each motor.

    Attributes:
        name: name in words.
        number: ``FRAME_CLASS``.
        form: ``FRAME_TYPE``.
        motors: angle (deg) and spin of each motor, in the order of its numbers.
    """

    name: str
    number: int
    form: int
    motors: Motors


FRAMES = tuple(
    ArduPilotFrame(
        name=name,
        number=row["class"],
        form=row["type"],
        motors=tuple((angle, spin) for angle, spin in row["motors"]),
    )
    for name, row in shipped_tables(__file__).items()
)
"""Supported frames, in the order in which they are tried."""


def fitting_frame(vehicle: Vehicle) -> tuple[ArduPilotFrame, tuple[int, ...]]:
    """ArduPilot frame that fits a vehicle's rotors, and the index of ArduPilot's motor
    for each rotor.

    A rotor fits a motor if it turns the same way and its angle about the middle of the
    rotors differs by less than ``ANGLE_TOLERANCE``.

    Raises:
        ScenarioError: rotors of no frame that is known here.
    """
    rotors = vehicle.rotors
    # about the middle of the rotors, as a base's origin may lie anywhere
    middle = [
        sum(float(rotor.position[axis]) for rotor in rotors) / max(len(rotors), 1)
        for axis in (0, 1)
    ]
    angles = []
    for rotor in rotors:
        x, y = float(rotor.position.x) - middle[0], float(rotor.position.y) - middle[1]
        angles.append(
            (math.degrees(math.atan2(-y, x)), 1 if float(rotor.direction) > 0.0 else -1)
        )
    if all(float(rotor.axis.z) >= UPRIGHT for rotor in rotors):
        for frame in FRAMES:
            places = _places(angles, frame.motors)
            if places is not None:
                return frame, places
    shown = ", ".join(
        f"{angle:.0f} deg {'cw' if spin < 0 else 'ccw'}" for angle, spin in angles
    )
    names = "; ".join(frame.name for frame in FRAMES)
    raise ScenarioError(
        f"plant.vehicle: rotors at {shown} (clockwise from the front): must be upright"
        f" and those of a frame of ArduPilot: {names}"
    )


def _places(angles: list[tuple[float, int]], motors: Motors) -> tuple[int, ...] | None:
    """Index of ArduPilot's motor for each rotor; None unless rotors and motors match
    one to one.
    """
    places = []
    for angle, spin in angles:
        near = [
            i
            for i, (at, way) in enumerate(motors)
            if way == spin and abs(_turn(angle - at)) < ANGLE_TOLERANCE
        ]
        if len(near) != 1:
            return None
        places.append(near[0])
    # every motor exactly once: two rotors near one motor are another frame
    return tuple(places) if sorted(places) == list(range(len(motors))) else None


def _turn(angle: float) -> float:
    """Wrap an angle to the range from -180 to 180 deg."""
    return (angle + 180.0) % 360.0 - 180.0


def torque_of_signal(vehicle: Vehicle) -> tuple[float, float, float]:
    """Torque (N m) about x, y and z that a full torque command produces with
    ArduPilot's motor mixer.

    A motor's share of roll and pitch goes with the sine and cosine of its angle, that
    of yaw with its spin; the largest share is 1/2 of the full thrust. Source:
    ArduCopter 4.7, matrix of the motors.
    """
    frame, places = fitting_frame(vehicle)
    torque = [0.0, 0.0, 0.0]
    shares = [
        (-math.sin(math.radians(at)), math.cos(math.radians(at)), float(spin))
        for at, spin in frame.motors
    ]
    most = [max(abs(share[axis]) for share in shares) for axis in range(3)]
    for rotor, place, thrust in zip(
        vehicle.rotors, places, highest_thrust(vehicle), strict=True
    ):
        arms = (
            float(rotor.position.y),
            float(rotor.position.x),
            float(rotor.direction) * float(rotor.moment_coefficient),
        )
        for axis in range(3):
            torque[axis] += 0.5 * shares[place][axis] / most[axis] * arms[axis] * thrust
    return torque[0], torque[1], torque[2]


def rate_bandwidths(vehicle: Vehicle) -> tuple[float, float, float]:
    """Rate-loop bandwidths (rad/s) about x, y and z that the rotors' lag permits."""
    slowest = max(float(rotor.time_constant_up) for rotor in vehicle.rotors)
    # about 18 degrees of phase lag of the rotors at the crossing of the loop
    fast = min(RATE_BANDWIDTH, 0.33 / max(slowest, 1e-3))
    return fast, fast, min(YAW_BANDWIDTH, fast)


def rate_gains(vehicle: Vehicle) -> dict[str, float]:
    """Gains of ArduPilot's rate loop: P = bandwidth J / torque of a full command, I and
    D in its default ratios.
    """
    parameters: dict[str, float] = {}
    gains = proportional_gains(
        vehicle, torque_of_signal(vehicle), rate_bandwidths(vehicle)
    )
    for name, gain in zip(("RLL", "PIT", "YAW"), gains, strict=True):
        # I / P and D / P of ArduPilot's defaults
        integral, slope = (1.0, 0.0267) if name != "YAW" else (0.1, 0.0)
        parameters |= {
            f"ATC_RAT_{name}_P": gain,
            f"ATC_RAT_{name}_I": integral * gain,
            f"ATC_RAT_{name}_D": slope * gain,
        }
    return parameters


def thrust_curve(vehicle: Vehicle) -> float:
    """Coefficient e of the thrust curve (1 - e) u + e u^2 of a signal u; 1 for thrust
    proportional to u^2.

    Least squares over the range of the signal and the rotors; e is limited to -1 to 1,
    as ArduPilot limits it.
    """
    # the ends 0 and 1 fit by construction and have no weight
    signals = [k / 50.0 for k in range(1, 50)]
    exponent = sum(square_share(rotor, signals) for rotor in vehicle.rotors) / len(
        vehicle.rotors
    )
    return min(max(round(exponent, 6), -1.0), 1.0)


def vehicle_parameters(vehicle: Vehicle, gravity: float) -> dict[str, float]:
    """ArduPilot parameters of a vehicle: frame, thrust curve, hover thrust, gains of
    rate and climb control.

    A motor's signal is its speed in parts of the highest; the whole range of the signal
    is used. The gains of the vertical acceleration follow the hover thrust, as
    ArduPilot's instructions for the first flight ask.

    Raises:
        ScenarioError: rotors of no frame that is known here, or too little thrust to
            hover.
    """
    frame, _ = fitting_frame(vehicle)
    hover = hover_share(vehicle, gravity, "ArduPilot", 1.0)
    return {
        "FRAME_CLASS": frame.number,
        "FRAME_TYPE": frame.form,
        "MOT_PWM_MIN": 1000,
        "MOT_PWM_MAX": 2000,
        "MOT_SPIN_ARM": 0,
        "MOT_SPIN_MIN": 0,
        "MOT_SPIN_MAX": 1,
        "MOT_THST_EXPO": thrust_curve(vehicle),
        # the range that ArduPilot's own learning of the hover thrust keeps to
        "MOT_THST_HOVER": min(max(hover, 0.125), 0.6875),
        "PSC_ACCZ_P": hover,
        "PSC_ACCZ_I": 2.0 * hover,
        "INS_GYRO_FILTER": GYRO_FILTER,
        **{
            f"ATC_RAT_{name}_FLT{kind}": 0.5 * GYRO_FILTER
            for name in ("RLL", "PIT", "YAW")
            for kind in "TD"
        },
        **rate_gains(vehicle),
    }


GYRO_FILTER = 80.0
"""Cut-off frequency (Hz) of the gyroscope's filter, twice that of the rate loop, as in
ArduPilot's first-flight instructions. The instructions ask for 42 Hz with propellers of
10 inch and for 75 Hz with 5 inch; the default of 20 Hz is for the largest."""
