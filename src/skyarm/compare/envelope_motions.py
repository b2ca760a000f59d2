"""Motions and disturbances of the envelope's trials, as signals whose numbers have paths."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from skyarm.algebra import E_X, Vec3
from skyarm.compare.envelope_setting import Setting
from skyarm.environment import AirSignals, Disturbance, MovingAir
from skyarm.environment.dryden import Dryden
from skyarm.environment.signal_vector import SignalVector
from skyarm.reference import Constant, Product, Pulses, Ramp, Signal, Sine, Sum, Trajectory, Windowed
from skyarm.scenario.scenario_record import Scenario
from skyarm.vehicle.vehicle_records import BodyDrag

EASE = Ramp(start=2.0, duration=3.0, height=1.0, shape="quintic")
"""From 2 to 5 s every motion grows from rest to its amplitude."""

ARM, ARM_HZ, ARM_PHASE = (0.2, 0.15), 0.5, 0.6
"""Swing of the joints beside a motion of the base: rad, one joint after the other, Hz, and rad from joint to joint."""

SWING_PHASE = 0.9
"""rad, from joint to joint where the swing of the arm is the trial."""

PUSH = {"start": 4.0, "period": 1.0, "width": 0.5}
"""s: on for the first half of every second from 4 s on."""

STEP = 1.0
"""s: when the position steps."""

HULL = 0.02
"""N/(m/s)^2: drag of the hull in turbulence, for the paper's weight."""

SCALE_LENGTH = 3.0
"""m, of turbulence along all axes."""


def eased(amplitude: float, frequency_hz: float, phase: float = 0.0) -> Signal:
    """A sine that grows from rest; its numbers stand under ``signal``."""
    return Product(Sine(amplitude=amplitude, frequency_hz=frequency_hz, phase=phase), EASE)


def swings(setting: Setting, amplitudes: tuple[float, ...], frequency_hz: float, phase: float) -> tuple[Signal, ...]:
    """Joints about their middles, one amplitude after the other, each later than the one before by ``phase``."""
    return tuple(
        Sum((Constant(middle), eased(amplitudes[j % len(amplitudes)] * unit, frequency_hz, phase * j)))
        for j, (middle, unit) in enumerate(zip(setting.middle, setting.swing, strict=True))
    )


def moving_base(setting: Setting, **axes: Any) -> Scenario:
    """The base along signals, the arm swinging gently."""
    joints = swings(setting, ARM, ARM_HZ, ARM_PHASE)
    return with_motion(setting, dataclasses.replace(setting.hover.reference, joints=joints, **axes))


def with_motion(setting: Setting, trajectory: Trajectory) -> Scenario:
    """The setting's vehicle on another reference."""
    return setting.hover.with_words(reference=trajectory)


def circle(setting: Setting, radius: float, speed: float) -> Scenario:
    """A horizontal circle at a speed, m and m/s."""
    f = speed / (2.0 * math.pi * radius)
    return moving_base(setting, x=eased(radius, f, 0.5 * math.pi), y=eased(radius, f))


def vertical(setting: Setting, amplitude: float, frequency_hz: float) -> Scenario:
    """A vertical sine, m and Hz."""
    return moving_base(setting, z=Sum((setting.hover.reference.z, eased(amplitude, frequency_hz))))


def arm_swing(setting: Setting, amplitude: float, frequency_hz: float) -> Scenario:
    """All joints swing in hover, rad and Hz."""
    joints = swings(setting, (amplitude,), frequency_hz, SWING_PHASE)
    return with_motion(setting, dataclasses.replace(setting.hover.reference, joints=joints))


def step(setting: Setting, height: float) -> Scenario:
    """A step of the position along x, m, within one control period of the paper's rates."""
    x = Ramp(start=STEP, duration=0.005, height=height)
    return with_motion(setting, dataclasses.replace(setting.hover.reference, x=x))


def turning_wind(setting: Setting, force: float, air: float, period: float) -> Scenario:
    """Hover in a force (N) and an air speed (m/s) that turn about the vertical once in ``period`` s."""
    return setting.hover.with_words(
        forces=(Disturbance(force=_turning(force, period)),),
        air=(AirSignals(velocity_W=_turning(air, period)),),
    )


def _turning(size: float, period: float) -> SignalVector:
    x, y = (Sine(amplitude=size, frequency_hz=1.0 / period, phase=phase) for phase in (0.5 * math.pi, 0.0))
    return SignalVector(x=x, y=y)


def turbulence(setting: Setting, mean: float) -> Scenario:
    """Hover in turbulent air along x, m/s, its standard deviation half the mean; the hull has drag."""
    drag = BodyDrag(area=Vec3(*(2.0 * HULL * setting.weight / 1.225,) * 3), air_density=1.225)
    sigma, length = Vec3(*(0.5 * mean,) * 3), Vec3(*(SCALE_LENGTH,) * 3)
    gusts = Dryden(intensity=sigma, scale_length=length, airspeed=mean, direction_W=E_X)
    vehicle = dataclasses.replace(setting.truth, drag=drag)
    wind = MovingAir(velocity_W=Vec3(mean, 0, 0), turbulence=gusts)
    return setting.hover.with_words(plant=dataclasses.replace(setting.hover.plant, vehicle=vehicle), wind=wind)


def pushes(setting: Setting, axis: str, force: float) -> Scenario:
    """Hover under a force at the tip along a world axis, N, on for the first half of every second."""
    count = max(1, math.ceil(setting.duration))
    pattern = Product(Constant(force), Pulses(count=count, **PUSH))
    frame = setting.truth.end_effector
    return setting.hover.with_words(forces=(Disturbance(frame=frame, force=SignalVector(**{axis: pattern})),))


WIND_STEPS = {"x": ((0.0, 3.0, 1.0), (9.0, 12.0, -1.0)), "y": ((6.0, 9.0, 1.0),), "z": ((15.0, math.inf, 1.0),)}
"""World axis -> (start, stop, share): +x, 0, +y, -x, 0, +z, each for 3 s."""


def wind_steps(setting: Setting, force: float) -> Scenario:
    """Hover under a force on the base that steps from axis to axis, N."""
    vector = SignalVector(
        **{
            axis: Product(Constant(force), Sum(tuple(Windowed(Constant(sign), a, b) for a, b, sign in windows)))
            for axis, windows in WIND_STEPS.items()
        }
    )
    return setting.hover.with_words(forces=(Disturbance(force=vector),))
