"""Flights of a vehicle whose rotors tilt: motions, scenario, and errors of a log."""

from __future__ import annotations

import numpy as np

import skyarm
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.model import Model
from skyarm.control.safety import with_safety_layer
from skyarm.plant.interface import Truth
from skyarm.reference import Trajectory
from skyarm.reference.signals import Constant, Product, Ramp, Sine
from skyarm.scenario.scenario_record import Delays, Scenario
from skyarm.sensing.measurement import SensorNoise
from skyarm.world import ForceWind

VOLIRO = skyarm.load_vehicle("voliro_like")
NOISE = SensorNoise(
    position=1e-3,
    velocity=1e-2,
    attitude=2e-3,
    rate=1e-2,
    joints=1e-3,
    joint_rates=1e-2,
)

SWINGING = tuple(Sine(amplitude=0.3, frequency_hz=0.4, phase=0.6 * i) for i in range(2))


def across(seconds, joints=(), start=0.5):
    """A metre along x."""
    x = Ramp(start=start, duration=seconds, height=1.0, shape="quintic")
    return Trajectory(
        x=x, y=Constant(0.0), z=Constant(1.5), yaw=Constant(0.0), joints=joints
    )


def scenario(
    vehicle,
    trajectory,
    duration,
    *,
    truth=None,
    delay=0.0,
    wind=(0.0, 0.0, 0.0),
    guarded=False,
    **options,
):
    law = make_centroidal(
        Model(vehicle=vehicle),
        mode="tip" if vehicle.n else "joint",
        delay=delay,
        **({"sideways": 0.9} | options),
    )
    return Scenario(
        name="vectored",
        duration=duration,
        plant=Truth(vehicle=truth or vehicle),
        controller=with_safety_layer(law) if guarded else law,
        reference=trajectory,
        wind=ForceWind(force_W=wind),
        delays=Delays(measurement=delay),
        ground=False,
    )


def tilt(log):
    """Degrees."""
    q = log.quaternion
    return np.degrees(np.arccos(1.0 - 2.0 * (q[:, 1] ** 2 + q[:, 2] ** 2)))


def errors(log, name):
    """Millimetres."""
    return 1e3 * np.linalg.norm(
        getattr(log, name) - getattr(log, f"{name}_reference"), axis=1
    )


def eased_circle(speed):
    """A circle of 1 m that is eased in from 1 s to 4 s."""
    ease = Ramp(start=1.0, duration=3.0, height=1.0, shape="quintic")
    hertz = speed / (2.0 * np.pi)
    x, y = (
        Product(Sine(amplitude=1.0, frequency_hz=hertz, phase=phase), ease)
        for phase in (0.5 * np.pi, 0.0)
    )
    return Trajectory(x=x, y=y, z=Constant(1.5), yaw=Constant(0.0), joints=SWINGING)
