"""Surroundings of the vehicle: wind, gusts, turbulence, payloads, contact and
faults.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from skyarm.world.component import Air, Component, Force, Wrench
from skyarm.world.dryden import Dryden, DrydenMemory, low_altitude
from skyarm.world.effectiveness import Effectiveness
from skyarm.world.faults import Fault, effectiveness_at
from skyarm.world.gust import Gust
from skyarm.world.payload import Payload
from skyarm.world.timed_payload import PayloadMemory, Reach, TimedPayload
from skyarm.world.wind import NO_WIND, ForceWind, MovingAir, Wind, WindSample, wind_from

if TYPE_CHECKING:
    from skyarm.world.aerodynamic_forces import GroundEffect, LinkDrag, RotorDrag
    from skyarm.world.disturbance_signals import AirSignals, Disturbance
    from skyarm.world.hanging_payload import HangingPayload
    from skyarm.world.signal_vector import ColouredNoise, SignalVector

_LATER = {
    "aerodynamic_forces": ("GroundEffect", "LinkDrag", "RotorDrag"),
    "disturbance_signals": ("AirSignals", "Disturbance"),
    "hanging_payload": ("HangingPayload",),
    "signal_vector": ("ColouredNoise", "SignalVector"),
}
"""Modules that are imported at the first use of one of their names."""


def __getattr__(name: str) -> Any:
    module = next((module for module, names in _LATER.items() if name in names), None)
    if module is None:
        raise AttributeError(f"module 'skyarm.world' has no attribute {name!r}")
    return getattr(import_module(f"skyarm.world.{module}"), name)


__all__ = [
    "NO_WIND",
    "Air",
    "AirSignals",
    "ColouredNoise",
    "Component",
    "Disturbance",
    "Dryden",
    "DrydenMemory",
    "Effectiveness",
    "Fault",
    "Force",
    "ForceWind",
    "GroundEffect",
    "Gust",
    "HangingPayload",
    "LinkDrag",
    "MovingAir",
    "Payload",
    "PayloadMemory",
    "Reach",
    "RotorDrag",
    "SignalVector",
    "TimedPayload",
    "Wind",
    "WindSample",
    "Wrench",
    "effectiveness_at",
    "low_altitude",
    "wind_from",
]
