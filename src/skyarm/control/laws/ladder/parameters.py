"""Constants and memory of the stepped computed torque."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.actuation import Command
from skyarm.control.blocks.disturbance_observer import Observed, ObserverGains
from skyarm.control.blocks.extrapolation import Channel
from skyarm.control.model import Parameters
from skyarm.records.units import Unit
from skyarm.scalars import Scalar


@dataclass(frozen=True, kw_only=True, slots=True)
class Steps:
    """What stands on top of the paper's law.

    Attributes:
        coupled_thrust: the thrust points along the force that the coupled dynamics need, the arm's reaction in it.
        consistent: the inverse dynamics takes the base's acceleration that the real thrust gives, not the wanted one.
        observer: force, torque and joint torques that the model does not know are estimated and carried.
        feedforward: desired body rate and angular acceleration, by the derivatives of the wanted force.
        extrapolation: held reference samples are continued to the present.
        lag_inversion: rotor commands undo the motors' lag.
    """

    coupled_thrust: bool = False
    consistent: bool = False
    observer: bool = False
    feedforward: bool = False
    extrapolation: bool = False
    lag_inversion: bool = False


@dataclass(frozen=True, kw_only=True, slots=True)
class StepParameters(Parameters):
    """Constants beside the paper's.

    Attributes:
        steps: what is switched on.
        observer: bandwidths, rad/s. reference_period: between published samples, s.
        lag_share: of the motors' lag that rotor commands undo; above 1 counts as 1.
        delay_periods: age of the measurement in control periods, for the observer's inputs.
    """

    steps: Steps
    observer: ObserverGains
    reference_period: Annotated[Scalar, Unit("s", "between published reference samples")]
    lag_share: Annotated[Scalar, Unit("", "1: rotor commands undo the motors' lag, 0: they do not")]
    delay_periods: int = 0


@dataclass(frozen=True, kw_only=True, slots=True)
class StepMemory:
    """What the law remembers; parts of steps that are not taken are empty.

    Attributes:
        started: 0 before the first measurement.
        observed: of the observer, or none. sent: the last commands, oldest first.
        free: 1 while no actuator was at its limit, for the base and each joint.
        age, channels: of the held reference sample.
    """

    started: Annotated[Scalar, Unit("", "0 before the first measurement, then 1")]
    observed: Observed | tuple[()]
    sent: tuple[Command, ...]
    free: Annotated[tuple[Scalar, ...], Unit("", "1 while no actuator is at its limit: base, then joints")]
    age: Annotated[Scalar, Unit("s", "since the held reference sample appeared")]
    channels: tuple[Channel, ...]


def nothing() -> Any:
    """The part of a memory whose step is not taken."""
    return ()
