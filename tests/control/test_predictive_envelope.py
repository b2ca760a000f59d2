"""Where the predictive law was lost: near free fall, in arm swings, pushes, unknown delay and with frozen sensors."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.control.catalogue import make_controller
from skyarm.environment import Force, ForceWind, Wrench
from skyarm.metrics.windows import Window, Windows
from skyarm.reference import Constant, Sine, Sum, Trajectory
from skyarm.scalars import floor, where
from skyarm.scenario.scenario_parts import Delays
from skyarm.sensors.measurement import SensorNoise

NOISE = SensorNoise(position=0.001, velocity=0.01, attitude=0.002, rate=0.01, joints=0.001, joint_rates=0.01)
BASE = skyarm.load_scenario("case3")
STILL = (Constant(0.0), Constant(0.0))
CALM = (Sine(amplitude=0.2, frequency_hz=0.5), Sine(amplitude=0.15, frequency_hz=0.5))


def flight(duration, z=None, joints=STILL, controller=None, **more):
    """A flight of the paper's vehicle at 1.5 m; the law is told of a measurement's delay, of a command's never."""
    trajectory = Trajectory(z=z or Constant(1.5), joints=joints)
    delay = more["delays"].measurement if "delays" in more else 0.0
    law = controller or make_controller("nmpc", BASE.controller.par.model, delay_periods=round(delay / 0.005))
    window = Windows(steady=Window(0.5 * duration, duration))
    changed = {"trajectory": trajectory, "duration": duration, "wind": ForceWind(), "windows": window}
    return skyarm.run(dataclasses.replace(BASE, controller=law, **changed, **more))


def off(log):
    """Mean distance in m of the tip from its reference over the second half."""
    late = log.time > 0.5 * log.time[-1]
    return float(np.linalg.norm(log.tool - log.tool_reference, axis=1)[late].mean())


def tilt(log):
    """Largest tilt, degrees."""
    q = log.quaternion
    return math.degrees(np.arccos(np.clip(1.0 - 2.0 * (q[:, 1] ** 2 + q[:, 2] ** 2), -1.0, 1.0)).max())


def swinging(frequency, amplitude=1.0):
    return tuple(Sine(amplitude=amplitude, frequency_hz=frequency, phase=phase) for phase in (0.0, 0.9))


def frozen(law, start, stop):
    """A controller that is given the reading of ``start`` until ``stop``, in s."""

    def step(memory, measurement, reference, dt, *, par):
        inner, held = memory
        if start <= measurement.time < stop:
            held = held or measurement
            measurement = held
        inner, command = law.law(inner, measurement, reference, dt, par=par)
        return (inner, held), command

    return dataclasses.replace(law, name="frozen", law=step, memory=(law.memory, None), compiled=False)


def test_an_arm_that_swings_fast_is_foreseen():
    log = flight(1.0, joints=swinging(1.5, 0.8))
    assert log.status == "completed"
    assert off(log) < 0.01


def test_commands_20_ms_late_that_nobody_told_are_flown():
    log = flight(1.2, joints=CALM, sensors=NOISE, delays=Delays(measurement=0.005, command=0.02))
    assert log.status == "completed"
    assert off(log) < 0.02


def test_sensors_that_freeze_for_0_3_s_are_flown_through():
    law = make_controller("nmpc", BASE.controller.par.model, delay_periods=1)
    held = frozen(law, 0.5, 0.8)
    log = flight(1.1, joints=CALM, sensors=NOISE, delays=Delays(measurement=0.005), controller=held)
    assert log.status == "completed"
    assert tilt(log) < 10.0


@pytest.mark.thorough
@pytest.mark.parametrize("noisy", [False, True])
def test_it_flies_near_free_fall(noisy):
    more = {"sensors": NOISE, "delays": Delays(measurement=0.005)} if noisy else {}
    z = Sum((Constant(1.5), Sine(amplitude=0.2, frequency_hz=1.0)))
    log = flight(6.0, z=z, joints=CALM, **more)
    assert log.status == "completed"
    assert off(log) < 0.008
    assert tilt(log) < 30.0


@pytest.mark.thorough
@pytest.mark.parametrize("frequency", [1.0, 1.5, 2.0])
def test_swings_of_1_rad_are_flown(frequency):
    log = flight(6.0, joints=swinging(frequency))
    assert log.status == "completed"
    assert off(log) < 0.010


@pytest.mark.thorough
@pytest.mark.parametrize("delay", [0.01, 0.02, 0.03])
def test_unknown_delays_of_commands_are_flown(delay):
    log = flight(6.0, joints=CALM, sensors=NOISE, delays=Delays(measurement=0.005, command=delay))
    assert log.status == "completed"
    assert off(log) < 0.004


@dataclasses.dataclass(frozen=True, kw_only=True, slots=True)
class Pushes(Force):
    """A force at the tip for the first half of each second, from 1 s on."""

    x: float
    y: float
    z: float

    def wrenches(self, memory, t, motion, rotor_speeds):
        point, body = motion.frame()
        on = where(t - floor(t) < 0.5, 1.0, 0.0) * where(t >= 1.0, 1.0, 0.0)
        return (Wrench(force_W=Vec3(self.x * on, self.y * on, self.z * on), point=point, body=body),)


@pytest.mark.thorough
@pytest.mark.parametrize("sign", [-3.0, 3.0])
@pytest.mark.parametrize("axis", "xyz")
def test_pushes_of_3_n_beyond_the_arms_strength_lose_no_vehicle(axis, sign):
    push = Pushes(**{name: sign if name == axis else 0.0 for name in "xyz"})
    log = flight(10.0, sensors=NOISE, delays=Delays(measurement=0.005), forces=(push,))
    assert log.status == "completed"
    assert tilt(log) < 80.0


@pytest.mark.thorough
@pytest.mark.parametrize("seconds", [0.1, 0.5, 1.0])
def test_frozen_sensors_lose_no_vehicle(seconds):
    law = frozen(make_controller("nmpc", BASE.controller.par.model, delay_periods=1), 3.0, 3.0 + seconds)
    log = flight(6.0, joints=CALM, sensors=NOISE, delays=Delays(measurement=0.005), controller=law)
    assert log.status == "completed"
    assert tilt(log) < 45.0


@pytest.mark.thorough
@pytest.mark.parametrize("angle", [0.0, 45.0, 90.0])
def test_wind_from_any_side_leaves_the_tip_where_it_was(angle):
    from skyarm.compare.suite import turned

    base = skyarm.load_scenario("case3_wind", controller="nmpc", duration=15.0)
    log = skyarm.run(dataclasses.replace(base, wind=turned(base.wind, math.radians(angle))))
    late = log.time > 10.0
    assert np.linalg.norm(log.tool - log.tool_reference, axis=1)[late].mean() < 0.0008
