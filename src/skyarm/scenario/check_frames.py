"""Payloads and forces that name a frame of the vehicle, or have a number for each link, fit the vehicle."""

from __future__ import annotations

from typing import TYPE_CHECKING

from skyarm.environment import Disturbance, HangingPayload, LinkDrag, TimedPayload
from skyarm.vehicle.check import VehicleError

if TYPE_CHECKING:
    from skyarm.scenario.scenario_record import Scenario


def check_frames(scenario: Scenario) -> None:
    """Refuse a payload or a force that the true vehicle cannot have.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    taken = [payload.name for payload in scenario.payloads if payload.name]
    for i, payload in enumerate(scenario.payloads):
        if payload.name and taken.count(payload.name) > 1:
            raise ValueError(f"payloads[{i}].name = {payload.name!r}: must be of one payload only")
    vehicle, period = scenario.world.vehicle, 1.0 / scenario.rates.control
    named = [(f"payloads[{i}]", each) for i, each in enumerate(scenario.payloads)]
    for where, each in [*named, *((f"environment.forces[{i}]", each) for i, each in enumerate(scenario.forces))]:
        try:
            if isinstance(each, TimedPayload) or (isinstance(each, Disturbance) and each.frame):
                vehicle.frame(each.frame or None)
            if isinstance(each, LinkDrag):
                each.check(vehicle)
            if isinstance(each, HangingPayload):
                each.require_slow(period, scenario.world.gravity)
        except VehicleError as error:
            raise ValueError(f"{where}.frame = {getattr(each, 'frame', '')!r}: {error}") from None
        except ValueError as error:
            raise ValueError(f"{where}.{error}") from None
    for contact in scenario.contacts:
        contact.check(vehicle)
