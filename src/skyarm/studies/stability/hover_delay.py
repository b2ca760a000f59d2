"""Delay margin in hover: tolerable delay beyond the controller's nominal delay."""

from __future__ import annotations

import dataclasses
import math

from skyarm.compile.machine_code import NoMachineCodeError
from skyarm.control.controller import ControllerError, innermost
from skyarm.dynamics.actuators import AllocationError
from skyarm.records.files import PathLike
from skyarm.records.identity import identity, own_files
from skyarm.records.immutable import immutable
from skyarm.records.plain import digest
from skyarm.reference.signals import Constant
from skyarm.scenario.scenario_file import as_scenario
from skyarm.scenario.scenario_record import (
    PERFECT_SENSORS,
    Scenario,
    ScenarioError,
    with_words,
)
from skyarm.studies.stability.flight_margins import frozen_hover, hovering
from skyarm.studies.stability.frozen_scenario import LAGS
from skyarm.studies.stability.margins import delay_margin

ENOUGH = 1.5
"""Margin over the nominal delay below which a warning is issued; the nominal delay may
be wrong by its own size."""


@immutable
class HoverDelay:
    """Delay margin of a closed loop in hover, with the controller's nominal delay.

    Attributes:
        margin: further dead time, s, with the worse of the rotors' two time constants;
            inf beyond 0.1 s, 0 where the loop is unstable as it is.
        swings: further dead time, s, from which on flights oscillate.
        believed: nominal delay, s: the controller's or the scenario's.
        period: s, of the control: a computer that sends its command in the next period
            is late by so much.
    """

    margin: float
    swings: float
    believed: float
    period: float = 0.0

    @property
    def least_margin(self) -> float:
        """Required delay margin, s: ``ENOUGH`` times the nominal delay, at least one
        control period.
        """
        return max(ENOUGH * self.believed, self.period)

    @property
    def enough(self) -> bool:
        """True if the delay margin is at least the required one; False for an unstable
        loop.
        """
        return self.margin > 0.0 and self.margin >= self.least_margin

    def sentence(self, law: str) -> str:
        """Text with the delay margin, the delay at which flights begin to oscillate,
        and the nominal delay.
        """
        if not self.margin > 0.0:
            return f"the loop of {law} is unstable in hover as it is"
        if math.isinf(self.margin):
            tolerated = "more than 100 ms"
        else:
            swings = (
                ""
                if math.isinf(self.swings)
                else f" (flights swing from {1e3 * self.swings:.3g} ms on)"
            )
            tolerated = f"{1e3 * self.margin:.3g} ms{swings}"
        return (
            f"{law} in hover tolerates {tolerated} of further delay; its nominal delay"
            f" is {1e3 * self.believed:.3g} ms"
        )

    @property
    def shortfall(self) -> str:
        """Text about a required delay margin that is not met; empty if it is met or the
        loop is unstable.
        """
        if self.enough or not self.margin > 0.0:
            return ""
        if self.least_margin > ENOUGH * self.believed:
            return f"below one control period, {1e3 * self.period:.3g} ms"
        return f"below {ENOUGH:g} times the nominal delay"


def hover_delay(scenario: Scenario | PathLike) -> HoverDelay:
    """Delay margin of a scenario's closed loop in settled hover; zero if the vehicle
    crashes.

    Args:
        scenario: or its name or path.

    Raises:
        ScenarioError: the loop has a memory that its linearisation does not know.
    """
    scenario = as_scenario(scenario)
    hover = frozen_hover(scenario)
    margin = swings = 0.0
    if hover is not None:
        margin = min(delay_margin(hover.open_loop(lag)) for lag in LAGS)
        swings = delay_margin(hover.open_loop("between"))
    believed = believed_delay(scenario)
    return HoverDelay(
        margin=margin, swings=swings, believed=believed, period=scenario.rates.period
    )


def hover_digest(scenario: Scenario) -> str:
    """Digest of all that a vehicle's delay margin in hover depends on; in free air the
    place is no part of it.

    There is no ground, wind or other air in a hover, but a force, or code of the
    user's, may depend on the place.
    """
    # the reference is constant, whenever it is tracked, and the loop is linearised
    # without noise
    held = with_words(hovering(scenario), noise=PERFECT_SENSORS, tracking_start=0)
    if not held.forces and held.world is None and not own_files(held.agent):
        reference = dataclasses.replace(
            held.agent.reference, x=NOWHERE, y=NOWHERE, z=NOWHERE
        )
        held = with_words(held, reference=reference)
    return digest(
        [identity(each) for each in (held.agent, held.environment, held.rates)]
    )


NOWHERE = Constant(0.0)
"""Coordinate of a hover that is anywhere."""


def hover_delay_if_known(scenario: Scenario) -> HoverDelay | str:
    """Delay margin of a scenario in hover, or a text with the reason why it cannot be
    computed.
    """
    try:
        return hover_delay(scenario)
    except (
        ScenarioError,
        ControllerError,
        AllocationError,
        NoMachineCodeError,
    ) as error:
        return str(error)


def believed_delay(scenario: Scenario) -> float:
    """Nominal loop delay, s: the larger of the delay stated to the controller and the
    scenario's delay.
    """
    # a law without that option reckons with no delay
    nominal = (
        float(getattr(innermost(scenario.agent.controller.par), "delay_periods", 0))
        / scenario.rates.control
    )
    stated = float(scenario.agent.delays.measurement) + float(
        scenario.agent.delays.command
    )
    return max(nominal, stated) if math.isfinite(nominal) else stated
