"""Flights through readings that stand still, leap or are wrong, through blows, and with
false or true friction.
"""

from __future__ import annotations

import dataclasses
from typing import Annotated, Any

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Mat3, Vec3
from skyarm.algebra.scalars import logical_and, where
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.model import Model
from skyarm.dynamics import mass_matrix
from skyarm.records.leaves import blend
from skyarm.records.units import Unit
from skyarm.reference import Constant, Sine, Trajectory, Windowed
from skyarm.sensing.estimate.estimator import PassThrough
from skyarm.sensing.measurement import SensorNoise, blank_measurement
from skyarm.simulate.batch import Batch
from skyarm.world import Disturbance
from skyarm.world.signal_vector import SignalVector

BEGIN, END = 1.5, 1.9
GROUPS = {
    "pose": ("position", "quaternion"),
    "velocity": ("velocity",),
    "rate": ("rate",),
    "accelerometer": ("specific_force",),
    "joints": ("joints", "joint_rates"),
}


@dataclasses.dataclass(frozen=True, kw_only=True, slots=True)
class Faulty(PassThrough):
    """Readings of which some stand still for 0.4 s, or whose accelerometer is wrong, or
    whose velocity leaps once.
    """

    pose: Annotated[float, Unit("")] = 0.0
    velocity: Annotated[float, Unit("")] = 0.0
    rate: Annotated[float, Unit("")] = 0.0
    accelerometer: Annotated[float, Unit("")] = 0.0
    joints: Annotated[float, Unit("")] = 0.0
    factor: Annotated[float, Unit("")] = 1.0
    leap: Annotated[float, Unit("m/s")] = 0.0

    def start(self, vehicle):
        return blank_measurement(vehicle.n, len(vehicle.rotors))

    def step(self, memory, readings, command, dt):
        _, told = PassThrough.step(self, (), readings, command, dt)
        within = logical_and(told.time >= BEGIN - 1e-6, told.time < END - 1e-6)
        once = logical_and(within, told.time < BEGIN + 0.5 * dt)
        force, velocity = told.specific_force, told.velocity
        told = dataclasses.replace(
            told,
            specific_force=blend(within, force * self.factor, force),
            velocity=velocity + Vec3(1.0, 0.0, -1.0) * where(once, self.leap, 0.0),
        )
        held: dict[str, Any] = {}
        for group, names in GROUPS.items():
            still = logical_and(within, getattr(self, group) > 0.5)
            held |= {
                name: blend(still, getattr(memory, name), getattr(told, name))
                for name in names
            }
        told = dataclasses.replace(told, **held)
        return told, told


def flight(name, duration, reference, **changes):
    found = skyarm.load_scenario("case3", duration=duration)
    vehicle = skyarm.load_vehicle(name)
    mode = "tip" if vehicle.end_effector and vehicle.n else "joint"
    plant = dataclasses.replace(found.plant, vehicle=vehicle)
    law = make_centroidal(
        Model(vehicle=vehicle, gravity=float(found.plant.gravity)), mode=mode
    )
    return dataclasses.replace(
        found, plant=plant, controller=law, reference=reference, **changes
    )


def sway(vehicle):
    """A base and an arm that never rest."""
    swing = tuple(
        Sine(amplitude=0.2, frequency_hz=0.7, phase=0.5 * i) for i in range(vehicle.n)
    )
    side = Sine(amplitude=0.3, frequency_hz=0.5)
    return Trajectory(
        x=side,
        y=Sine(amplitude=0.2, frequency_hz=0.5, phase=1.0),
        z=Constant(1.0),
        joints=swing,
    )


def paths_of(flown):
    """Positions (m) of the base at the logged instants, each lane."""
    return np.stack([np.asarray(c) for c in flown.log.state.position], axis=-1)


FAULTS = {
    "nothing": {},
    **{f"{group} stands still": {group: 1.0} for group in GROUPS},
    "accelerometer upside down": {"factor": -1.0},
    "accelerometer dead": {"factor": 0.0},
    "velocity leaps by 20 m/s": {"leap": 20.0},
}


def test_what_a_sensor_does_wrong_for_half_a_second_is_flown_through():
    """In motion under an unknown load, push and noise: beside the flight without it all
    the time, and back soon.
    """
    reference = sway(skyarm.load_vehicle("hummingbird_arm2_rotors"))
    push = SignalVector(
        x=Constant(0.6), y=Constant(-0.4), z=Sine(amplitude=0.5, frequency_hz=0.8)
    )
    scenario = flight(
        "hummingbird_arm2_rotors",
        3.5,
        reference,
        estimator=Faulty(),
        forces=(Disturbance(force=push),),
        noise=SensorNoise(
            position=1e-3,
            velocity=1e-2,
            attitude=2e-3,
            rate=1e-2,
            joints=1e-3,
            joint_rates=1e-2,
            specific_force=0.05,
        ),
    )
    names = ("pose", "velocity", "rate", "accelerometer", "joints", "factor", "leap")
    columns = {
        f"estimator.{name}": np.array(
            [each.get(name, float(name == "factor")) for each in FAULTS.values()]
        )
        for name in names
    }
    flown = Batch(scenario, columns, effort=0, log_every=4).fly(columns)
    assert set(flown.status) == {"completed"}
    course = paths_of(flown)
    off = np.linalg.norm(course - course[:1], axis=-1)
    for name, most, last in zip(
        FAULTS, off.max(axis=1), off[:, -15:].max(axis=1), strict=True
    ):
        assert last < 0.01, name
        assert most < 0.03, name
        assert (most > 1e-4) == (name != "nothing"), name


BLOW = 0.5
VEHICLES = ("hummingbird_arm2_rotors", "octo_coaxial_two_arms", "quadrotor_roll_arm2")
SPUN = ("hexacopter680_flying_arm_2", "hextilt_flying_arm_5")
"""Vehicles whose base is light beside their arm: a blow to its origin spins it by 30
rad/s for each m/s."""


@pytest.mark.parametrize("name", [*VEHICLES, *SPUN])
def test_a_blow_of_a_metre_a_second_is_flown_through(name):
    """1 m/s within a control period, each way along each axis: the vehicle is back
    within 50 mm after 3 s.
    """
    vehicle = skyarm.load_vehicle(name)
    hit = Windowed(signal=Constant(0.0), start=BLOW, stop=BLOW + 0.005)
    reference = Trajectory(
        z=Constant(30.0), joints=tuple(Constant(0.0) for _ in range(vehicle.n))
    )
    scenario = flight(
        name,
        3.5,
        reference,
        forces=(Disturbance(force=SignalVector(x=hit, y=hit, z=hit)),),
    )
    size = float(vehicle.mass) / 0.005
    columns = {
        f"environment.forces.0.force.{axis}.value": np.array(
            [sign * size * (each == axis) for each in "xyz" for sign in (1.0, -1.0)]
        )
        for axis in "xyz"
    }
    flown = Batch(scenario, columns, effort=0, log_every=4).fly(columns)
    assert set(flown.status) == {"completed"}
    off = np.linalg.norm(paths_of(flown) - [0.0, 0.0, 30.0], axis=-1)
    assert off[:, -10:].max() < 0.05
    assert off.max(axis=1).min() > 0.05


def friction_of(name, decay):
    """Damping of each joint by which its rate decays by exp(-decay) in a control
    period, the others free.
    """
    vehicle = skyarm.load_vehicle(name)
    M = np.array(mass_matrix(vehicle, Mat3.identity(), (0.0,) * vehicle.n), dtype=float)
    return decay / (0.005 * np.diag(np.linalg.inv(M))[6:])


def swung(name, duration):
    """A hover whose arm swings, of a vehicle without friction."""
    vehicle = skyarm.load_vehicle(name).with_joints(damping=0.0)
    swing = tuple(
        Sine(amplitude=0.3, frequency_hz=0.8, phase=0.7 * i) for i in range(vehicle.n)
    )
    found = flight(name, duration, Trajectory(z=Constant(1.0), joints=swing))
    return dataclasses.replace(
        found,
        plant=dataclasses.replace(found.plant, vehicle=vehicle),
        controller=make_centroidal(
            Model(vehicle=vehicle, gravity=float(found.plant.gravity))
        ),
    )


def bent(flown, scenario, after=2.0):
    """Largest distance (rad) of a joint from its reference after some seconds, each
    lane.
    """
    time = np.asarray(flown.log.time)
    goal = np.array(
        [[float(q) for q in scenario.reference.at(float(t)).joints] for t in time]
    )
    joints = np.stack([np.asarray(q) for q in flown.log.state.joints], axis=-1)
    return np.abs(joints - goal)[:, time > after].max(axis=(1, 2))


def test_a_law_that_believes_in_friction_that_is_not_there_learns_that():
    """A rate decays by exp(-1) in a period by the model: of one joint, of both; and by
    exp(-0.5). Found within 7 s.
    """
    name, damping = (
        "hummingbird_arm2_rotors",
        friction_of("hummingbird_arm2_rotors", 1.0),
    )
    scenario, rows = (
        swung(name, 8.0),
        np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.5, 0.5]]),
    )
    paths = [f"controller.model.vehicle.links.{i}.joint.damping" for i in range(2)]
    flown = Batch(scenario, paths, effort=0, log_every=4).fly(
        dict(zip(paths, (rows * damping).T, strict=True))
    )
    assert set(flown.status) == {"completed"}
    off = bent(flown, scenario, 7.0)
    assert off.max() < 0.03


def test_a_law_that_knows_of_quick_friction_flies_with_it():
    """A rate decays by exp(-10) in a period: explicit predictions would diverge."""
    name = "hummingbird_arm2_rotors"
    scenario = swung(name, 3.0)
    links = scenario.plant.vehicle.links
    sticky = dataclasses.replace(
        scenario.plant.vehicle,
        links=tuple(
            dataclasses.replace(
                link, joint=dataclasses.replace(link.joint, damping=float(d))
            )
            for link, d in zip(
                links, friction_of(name, np.array([2.0, 10.0])), strict=True
            )
        ),
    )
    scenario = dataclasses.replace(
        scenario,
        plant=dataclasses.replace(scenario.plant, vehicle=sticky),
        controller=make_centroidal(
            Model(vehicle=sticky, gravity=float(scenario.plant.gravity))
        ),
    )
    flown = Batch(scenario, ["reference.base.z.value"], effort=0, log_every=4).fly(
        {"reference.base.z.value": [1.0]}
    )
    assert set(flown.status) == {"completed"}
    assert bent(flown, scenario, 0.5).max() < 0.03
