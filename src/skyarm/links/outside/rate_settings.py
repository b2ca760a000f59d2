"""Settings of the loop around a control law that commands body rates, from the
autopilot's parameters.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence

from skyarm.algebra import Vec3
from skyarm.control.model import Model
from skyarm.links.autopilots.effectiveness import centre_of_mass
from skyarm.links.autopilots.px4_parameters import rate_gains, torque_of_signal
from skyarm.links.mavlink_vehicle import ModeNumbers
from skyarm.links.outside.offboard_link import OffboardError, OffboardLink
from skyarm.links.outside.outside_law import LoopSettings
from skyarm.links.outside.rate_commands import (
    GuidedRateLoop,
    IdealRateLoop,
    PidRateLoop,
    RateLoop,
    Three,
)
from skyarm.records.coerce import refuse
from skyarm.vehicle import Vehicle

AXES = ("ROLL", "PITCH", "YAW")

LIMITS = {"ROLL": "MC_RR_INT_LIM", "PITCH": "MC_PR_INT_LIM", "YAW": "MC_YR_INT_LIM"}

DEFAULTS: Mapping[str, float] = dict.fromkeys(LIMITS.values(), 0.3) | {
    f"MC_{axis}RATE_K": 1.0 for axis in AXES
}
"""PX4's defaults of the parameters that
:func:`skyarm.links.autopilots.px4_parameters.rate_gains` does not set."""

NAMES = tuple(f"MC_{axis}RATE_{gain}" for axis in AXES for gain in "KPID") + tuple(
    LIMITS.values()
)
"""Names of the parameters that describe the rate loop."""

ANGLE_GAINS, ANGLE_FILTER = (
    (
        "ATC_ANG_RLL_P",
        "ATC_ANG_PIT_P",
        "ATC_ANG_YAW_P",
    ),
    "ATC_RAT_YAW_FLTE",
)
"""ArduPilot's gains of its attitude loop, 1/s, and cutoff (Hz) of its filter of the yaw
rate's error, 0 for none."""

YAW_FILTER, LEAST_CUTOFF = "MC_YAW_TQ_CUTOFF", 8.0
"""Cutoff (Hz) of PX4's filter of the yaw torque, 0 for none, and the least at which a
law's yaw control is steady: at PX4's usual 2 Hz ``centroidal`` oscillates with 0.6
rad/s, which drives rotors to their limits."""


def px4_rate_loop(vehicle: Vehicle, parameters: Mapping[str, float]) -> PidRateLoop:
    """Model of PX4's PID rate loop, each gain multiplied by the torque of a full
    control signal.

    Args:
        vehicle: vehicle with the rotors that PX4's parameters of geometry describe.
        parameters: autopilot's parameters; those that are missing are the ones that
            ``skyarm run`` sets.

    Raises:
        RecordError: a parameter that is no finite number, is negative, or is zero where
            the loop is divided by it.
    """
    values = {**DEFAULTS, **rate_gains(vehicle), **parameters}
    for name in NAMES:
        if (
            not math.isfinite(values[name])
            or values[name] < 0.0
            or (values[name] == 0.0 and name[-1] in "KP")
        ):
            refuse(
                f"--link: PX4's {name}", values[name], "must be a finite gain, above 0"
            )
    torques = torque_of_signal(vehicle)

    def row(gain: str) -> Three:
        x, y, z = (
            values[f"MC_{axis}RATE_K"] * values[f"MC_{axis}RATE_{gain}"] * torque
            for axis, torque in zip(AXES, torques, strict=True)
        )
        return x, y, z

    x, y, z = (
        values[LIMITS[axis]] * torque
        for axis, torque in zip(AXES, torques, strict=True)
    )
    return PidRateLoop(
        proportional=row("P"), integral=row("I"), derivative=row("D"), limit=(x, y, z)
    )


HOVER = (0.05, 0.95)
"""Range of plausible thrust set points in hover."""


class ParameterReader:
    """Reader of parameters from an autopilot whose heartbeat has arrived.

    Args:
        link: link to it.
        wait: waits so many seconds for messages, at most, and reads them.
    """

    def __init__(self, link: OffboardLink, wait: Callable[[float], None]) -> None:
        assert link.modes is not None
        self.modes: ModeNumbers = link.modes
        self._link, self._wait = link, wait

    def read(self, names: Sequence[str]) -> dict[str, float]:
        """Read parameters of the autopilot by name.

        Raises:
            OffboardError: it does not send one of them.
        """
        link = self._link

        def missing() -> list[str]:
            return [name for name in names if name not in link.parameters]

        # UDP loses requests: five rounds, each only for those still missing
        for _ in range(5):
            for name in missing():
                link.request_parameter(name)
            # 0.4 s for the answers of a round, chosen
            until = time.monotonic() + 0.4
            while time.monotonic() < until and missing():
                self._wait(0.02)
        if unsent := missing():
            raise OffboardError(
                f"--link: {self.modes.title} does not send its parameter {unsent[0]}"
            )
        return link.parameters


def rate_settings(
    reader: ParameterReader,
    model: Model,
    period: float,
    bandwidth: Three | None,
    hover_share: float | None,
) -> LoopSettings:
    """Read the autopilot's parameters and make the settings of the loop around a
    control law.

    Args:
        reader: reader of the autopilot.
        model: law's model.
        period: law's period, s.
        bandwidth: bandwidth of the rate loop, rad/s; None inverts PX4's by its
            parameters.
        hover_share: thrust set point in hover; None takes the autopilot's own
            parameter.

    Raises:
        OffboardError: a parameter is missing or wrong.
    """
    name = reader.modes.hover
    share = reader.read([name])[name] if hover_share is None else hover_share
    _require_thrust(reader)
    if not HOVER[0] <= share <= HOVER[1]:
        raise OffboardError(
            f"--link: {reader.modes.title}'s {name} = {share:g}: must be from"
            f" {HOVER[0]} to {HOVER[1]}"
        )
    vehicle = model.vehicle
    return LoopSettings(
        period=period,
        rate_loop=_rate_loop(reader, vehicle, bandwidth),
        # thrust in hover is the weight, which calibrates the thrust of a full set point
        full_thrust=float(vehicle.mass) * float(model.gravity) / share,
        center=Vec3(*map(float, centre_of_mass(vehicle))),
    )


def _require_thrust(reader: ParameterReader) -> None:
    """Raise an error if the autopilot interprets the thrust of a set point as a climb
    rate.

    Raises:
        OffboardError: its option is not set.
    """
    if reader.modes.option is None:
        return
    name, bit = reader.modes.option
    value = reader.read([name])[name]
    # a float of single precision is a whole number exactly up to 2^24
    if not (0.0 <= value < 2.0**24 and int(value) & bit):
        raise OffboardError(
            f"--link: {reader.modes.title}'s {name} = {value:g}: must include {bit}, so"
            " that thrust is not a climb rate"
        )


def _rate_loop(
    reader: ParameterReader, vehicle: Vehicle, wide: Three | None
) -> RateLoop:
    """Model of the autopilot's rate loop, from a given bandwidth or, for PX4, from its
    parameters.

    Raises:
        OffboardError: no bandwidth for another autopilot, or a filter behind which yaw
            oscillates.
    """
    title = reader.modes.title
    px4 = title == "PX4"
    if wide is None and not px4:
        raise OffboardError(
            f"--rate-bandwidth: must be given for {title}, whose rate loop is not known"
        )
    gains, name = (NAMES, YAW_FILTER) if px4 else (ANGLE_GAINS, ANGLE_FILTER)
    given = px4 and wide is not None  # then gains do not count
    parameters = reader.read([name] if given else [*gains, name])
    cutoff = parameters[name]
    if not (cutoff == 0.0 or cutoff >= LEAST_CUTOFF):
        raise OffboardError(
            f"--link: {title}'s {name} = {cutoff:g}: must be 0 or at least"
            f" {LEAST_CUTOFF:g} Hz, so that yaw does not oscillate behind the filter"
        )
    if wide is not None and px4:
        return IdealRateLoop(bandwidth=wide)
    if wide is not None:
        x, y, z = (parameters[each] for each in ANGLE_GAINS)
        return GuidedRateLoop(bandwidth=wide, gain=(x, y, z))
    return px4_rate_loop(vehicle, parameters)
