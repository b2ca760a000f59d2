"""What surrounds the vehicle: wind, gusts, turbulence, drag of the airframe, payloads, faults."""

from skyarm.environment.drag import body_drag
from skyarm.environment.dryden import Dryden, DrydenMemory, low_altitude
from skyarm.environment.effectiveness import Effectiveness
from skyarm.environment.faults import Fault, afflicted, faults_from
from skyarm.environment.gust import Gust
from skyarm.environment.parse import payload_from, wind_from
from skyarm.environment.payload import Payload
from skyarm.environment.wind import NO_WIND, Airspeed, RotorsForce, Wind, WindSample, wind

__all__ = [
    "NO_WIND",
    "Airspeed",
    "Dryden",
    "DrydenMemory",
    "Effectiveness",
    "Fault",
    "Gust",
    "Payload",
    "RotorsForce",
    "Wind",
    "WindSample",
    "afflicted",
    "body_drag",
    "faults_from",
    "low_altitude",
    "payload_from",
    "wind",
    "wind_from",
]
