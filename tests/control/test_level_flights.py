"""Flights at a level attitude by sideways force: translation, wind, an arm, noise;
tilting where it does not reach.
"""

from __future__ import annotations

import dataclasses
import re
from functools import cache

import numpy as np
import pytest
from centroidal_flights import NOISE, PERIOD, fly

import skyarm
from skyarm.algebra import Vec3
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.model import Model
from skyarm.plant.interface import Truth
from skyarm.reference import Trajectory
from skyarm.reference.signals import Constant, Ramp, Sine
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import Change, Delays, Scenario
from skyarm.simulate import run
from skyarm.world import ForceWind
from support.pages import EQUATIONS

PAGE = EQUATIONS / "32_sideways_force.md"
HEXA = skyarm.load_vehicle("tilted_hexarotor")
ARM2 = skyarm.load_vehicle("hummingbird_arm2_rotors")
ARM = dataclasses.replace(ARM2, base=HEXA.base, rotors=HEXA.rotors)


def scenario(
    vehicle, trajectory, wind=(0.0, 0.0, 0.0), *, duration=4.0, delay=0.0, **options
):
    mode = "tip" if vehicle.n else "joint"
    return Scenario(
        name="level",
        duration=duration,
        plant=Truth(vehicle=vehicle),
        controller=make_centroidal(
            Model(vehicle=vehicle), mode=mode, delay=delay, **options
        ),
        reference=trajectory,
        wind=ForceWind(force_W=Vec3(*wind)),
        delays=Delays(measurement=delay),
        ground=False,
    )


def across(seconds, joints=()):
    """A metre along x from 1 s on."""
    x = Ramp(start=1.0, duration=seconds, height=1.0, shape="quintic")
    return Trajectory(
        x=x, y=Constant(0.0), z=Constant(1.5), yaw=Constant(0.0), joints=joints
    )


def tilt(quaternion):
    """Degrees."""
    q = np.asarray(quaternion)
    return np.degrees(np.arccos(1.0 - 2.0 * (q[..., 1] ** 2 + q[..., 2] ** 2)))


SWINGING = tuple(Sine(amplitude=0.3, frequency_hz=0.4, phase=0.6 * i) for i in range(2))


@cache
def moved():
    return fly(
        scenario(
            ARM, across(2.5, SWINGING), (0.0, 3.0, 0.0), delay=2 * PERIOD, sideways=0.9
        )
    )


def test_a_metre_in_wind_from_the_side_is_flown_level_and_within_a_millimetre():
    flown = moved()
    late = flown.time >= 1.5
    assert tilt(flown.quaternion[0][late]).max() < 0.5
    assert flown.base[0][late].max() < 1.0
    assert flown.tip[0][late].max() < 0.5


def test_the_observer_takes_the_sideways_force_for_the_rotors_own():
    force = moved().memory.observed.force
    np.testing.assert_allclose([force.x, force.y, force.z], [0.0, 3.0, 0.0], atol=0.05)


@pytest.mark.thorough
def test_under_noise_the_tip_is_kept_where_a_tilting_base_does_not():
    found = []
    for options in ({}, {"sideways": 0.9}):
        planned = scenario(
            ARM, across(2.0, SWINGING), (0.0, 4.0, 0.0), delay=PERIOD, **options
        )
        flown = fly(dataclasses.replace(planned, noise=NOISE))
        found.append(
            (
                flown.mean("tip", 1.0, 4.0),
                tilt(flown.quaternion[0][flown.time >= 1.0]).max(),
            )
        )
    (tip, most), (level, least) = found
    assert level < 1.0 < 2.6 * level < tip
    assert least < 1.1
    assert most > 8.0


@pytest.mark.thorough
def test_a_roll_and_pitch_are_held_while_the_base_moves_and_turns():
    trajectory = dataclasses.replace(
        across(2.5), yaw=Sine(amplitude=1.0, frequency_hz=0.2)
    )
    planned = scenario(HEXA, trajectory, sideways=0.9, attitude=[-0.06, 0.001])
    turned = Change(at=2.0, path="controller.center.sideways.attitude.1", value=0.1)
    log = run(dataclasses.replace(planned, changes=(turned,)))
    assert (
        np.linalg.norm(log.position - log.position_reference, axis=1)[
            log.time >= 1.0
        ].max()
        < 2.0e-3
    )
    # a turning heading is followed 0.2 deg late
    for start, stop, pitch in ((1.0, 2.0, 0.001), (2.5, 4.0, 0.1)):
        during = (log.time >= start) & (log.time < stop)
        np.testing.assert_allclose(log.euler[during, 0], -0.06, atol=0.01)
        np.testing.assert_allclose(log.euler[during, 1], pitch, atol=0.01)


LEVEL = """
name = "level_flight"
duration = 8.0

[plant]
vehicle = "tilted_hexarotor"

[reference.base]
kind = "signals"
x = { kind = "ramp", start = 2.0, duration = 3.0, height = 1.0, shape = "quintic" }
z = 1.5

"""


@pytest.mark.parametrize(
    "plant", ["rigid_body", pytest.param("mujoco", marks=pytest.mark.thorough)]
)
def test_a_force_beyond_the_rotors_reach_is_flown_by_tilting(plant, tmp_path):
    """The controller of the page in 12 N of wind, half the weight: 6.1 N go sideways at
    most, the rest leans.
    """
    text, *_ = re.findall(r"```toml\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    (tmp_path / "level.toml").write_text(LEVEL + text, "utf-8")
    planned = load_scenario(tmp_path / "level.toml", duration=4.0)
    log = run(
        dataclasses.replace(
            planned, kind=plant, wind=ForceWind(force_W=Vec3(8.0, -9.0, 0.0))
        )
    )
    assert log.status == "completed"
    late = log.time >= 3.0
    assert (
        np.linalg.norm((log.position - log.position_reference)[late], axis=1).max()
        < 1.0
    )
    flat = np.degrees(np.arctan(np.hypot(8.0, 9.0) / (float(HEXA.mass) * 9.81)))
    assert 0.4 * flat < tilt(log.quaternion[late]).mean() < 0.75 * flat
