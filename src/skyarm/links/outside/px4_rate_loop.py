"""PX4's rate loop as its parameters state it, for a vehicle whose rotors its parameters describe."""

from __future__ import annotations

import math
from collections.abc import Mapping

from skyarm.links.autopilots.px4_parameters import rate_gains, torque_of_signal
from skyarm.links.outside.rate_commands import PidRateLoop, Three
from skyarm.records.coerce import refuse
from skyarm.vehicle.vehicle_records import Vehicle

AXES = ("ROLL", "PITCH", "YAW")

LIMITS = {"ROLL": "MC_RR_INT_LIM", "PITCH": "MC_PR_INT_LIM", "YAW": "MC_YR_INT_LIM"}

DEFAULTS: Mapping[str, float] = dict.fromkeys(LIMITS.values(), 0.3) | {f"MC_{axis}RATE_K": 1.0 for axis in AXES}
"""PX4's own values of what :func:`skyarm.links.autopilots.px4_parameters.rate_gains` leaves as it is."""

NAMES = tuple(f"MC_{axis}RATE_{gain}" for axis in AXES for gain in "KPID") + tuple(LIMITS.values())
"""Parameters that describe the loop."""

ANGLE_GAINS, ANGLE_FILTER = ("ATC_ANG_RLL_P", "ATC_ANG_PIT_P", "ATC_ANG_YAW_P"), "ATC_RAT_YAW_FLTE"
"""ArduPilot's gains of its attitude loop, 1/s, and cutoff (Hz) of its filter of the yaw rate's error, 0 for none."""

YAW_FILTER, LEAST_CUTOFF = "MC_YAW_TQ_CUTOFF", 8.0
"""Cutoff (Hz) of PX4's filter of the yaw torque, 0 for none, and the least at which a law's yaw control is steady: at
PX4's usual 2 Hz ``centroidal`` oscillates with 0.6 rad/s, which drives rotors to their limits."""


def px4_rate_loop(vehicle: Vehicle, parameters: Mapping[str, float]) -> PidRateLoop:
    """Rate loop of PX4 in torques: each gain times the torque of a full signal.

    Args:
        vehicle: whose rotors PX4's parameters of geometry describe.
        parameters: as the autopilot has them; those that are missing are the ones that ``skyarm run`` sets.

    Raises:
        RecordError: a parameter that is no finite number, is negative, or is zero where the loop is divided by it.
    """
    known = {**DEFAULTS, **rate_gains(vehicle), **parameters}
    for name in NAMES:
        if not math.isfinite(known[name]) or known[name] < 0.0 or (known[name] == 0.0 and name[-1] in "KP"):
            refuse(f"--link: PX4's {name}", known[name], "must be a finite gain, above 0")
    torques = torque_of_signal(vehicle)

    def row(gain: str) -> Three:
        x, y, z = (
            known[f"MC_{axis}RATE_K"] * known[f"MC_{axis}RATE_{gain}"] * torque
            for axis, torque in zip(AXES, torques, strict=True)
        )
        return x, y, z

    x, y, z = (known[LIMITS[axis]] * torque for axis, torque in zip(AXES, torques, strict=True))
    return PidRateLoop(proportional=row("P"), integral=row("I"), derivative=row("D"), limit=(x, y, z))
