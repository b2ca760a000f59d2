"""Flights: scenario documents, programs that several flights share, other processes,
flights of windows.

- Scenario documents for tests: the shipped ones, shortened, and a small one of our own.
- A short flight on the error-state filter, as a file describes it, for tests of sensors
  and filter.
- Flights of one engine without a log, and programs made once for all tests of a file
  that fly the same scenario.
- A motion along x that turns about z.
- Calls in other processes, as works fly there.
- Flights without noise of a quadrotor and of one joint below it, whose states, commands
  and delays are all known.
"""

from __future__ import annotations

import copy
import dataclasses
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.control.catalogue import make_controller, suitable_options
from skyarm.dynamics.actuators.servo import PositionServo
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.log.motion import PoseSeries
from skyarm.reference import Constant, Product, Ramp, Sine, Sum, Trajectory
from skyarm.scenario.controller_table import loop_facts
from skyarm.scenario.scenario_file import LIBRARY, list_scenarios
from skyarm.scenario.scenario_record import Delays, Environment, Rates, Scenario
from skyarm.simulate import flight_programs
from skyarm.simulate.engine import Engine, EpisodeCode
from skyarm.simulate.loop_state import LoopState
from skyarm.studies.flights.processes import Processes
from skyarm.studies.tune.excitation import of_vehicle
from skyarm.vehicle.vehicle_records import MountedDrive
from skyarm.world.component import Air
from support.cases import whole_text

SHIPPED = {
    name: tomllib.loads((LIBRARY / f"{name}.toml").read_text("utf-8"))
    for name in list_scenarios()
}

FULL: dict[str, Any] = {
    "schema": 1,
    "name": "everything",
    "title": "every table of a scenario file",
    "duration": 0.1,
    "seed": 3,
    "episode": 1,
    "rates": {"physics": 1000, "control": 200, "reference": 50},
    "plant": {
        "vehicle": "hummingbird_arm2_rotors",
        "gravity": 9.8,
        "kind": "rigid_body",
        "integrator": "rk4",
        "payload": {"mass": 0.02, "frame": "tip"},
        "joints": {
            "damping": 0.002,
            "coulomb": 0.001,
            "coulomb_rate": 0.02,
            "effort_limit": 0.4,
        },
    },
    "model": {
        "vehicle": "hummingbird_arm2",
        "gravity": 9.81,
        "payload": {"mass": 0.01},
    },
    "controller": {
        "law": "hybrid_computed_torque",
        "gains": {
            "position": [4.0, 4.0, 4.0],
            "velocity": [2.2, 2.2, 2.2],
            "attitude": [0.7, 0.7, 0.035],
            "rate": [0.1, 0.1, 0.025],
        },
        "joint_gains": {"stiffness": [350.0, 150.0], "damping": [12.0, 10.0]},
        "mixer": "priority",
        "rate_error": "corrected",
        "without": ["coupling"],
    },
    "reference": {
        "base": {"kind": "hover", "position": [0.0, 0.0, 1.0]},
        "yaw": {
            "kind": "ramp",
            "start": 0.02,
            "duration": 0.05,
            "height": 0.1,
            "shape": "quintic",
        },
        "joints": [
            {
                "kind": "sine",
                "amplitude": 0.1,
                "frequency_hz": 1.0,
                "start": 0.0,
                "stop": 2.0,
            },
            0.05,
        ],
    },
    "environment": {
        "ground": True,
        "wind": {
            "mode": "moving_air",
            "velocity": [1.0, 0.0, 0.0],
            "gust": {
                "velocity": [0.0, 1.0, 0.0],
                "start": 0.02,
                "duration": 0.03,
                "shape": "one_minus_cosine",
            },
            "turbulence": {"altitude": 6.0, "wind_20ft": 7.7},
        },
    },
    "sensors": {
        "position": 0.002,
        "attitude": 0.001,
        "rate": 0.01,
        "joint_rates": 0.02,
    },
    "delays": {"measurement": 0.005, "command": 0.003},
    "initial": {
        "quaternion_wxyz": [1.0, 0.0, 0.0, 0.0],
        "velocity": [0.1, 0.0, 0.0],
        "joints": [0.1, 0.0],
    },
}
"""Every table there is, at least once."""


def circling(**changes: Any) -> dict[str, Any]:
    """Case 3 in wind, whose circle and sines begin after 0.3 s in place of 6 s."""
    made = document("case3_wind", reference__base__start=0.3, **changes)
    for joint in made["reference"]["joints"]:
        joint["start"] = 0.3
    return made


def document(name: str = "case1", **changes: Any) -> dict[str, Any]:
    """A shipped document with entries replaced; a key with double underscores reaches
    into tables, None deletes.

    Its windows, which end after 20 s, are left out: these flights are short.
    """
    made = copy.deepcopy(FULL if name == "everything" else SHIPPED[name])
    made.pop("windows", None)
    for path, value in changes.items():
        *tables, last = path.split("__")
        at = made
        for table in tables:
            at = at.setdefault(table, {})
        if value is None:
            at.pop(last)
        else:
            at[last] = value
    return made


TEXT = """
schema = 1
name = "estimated"
duration = 1.0
seed = 3
estimator = { kind = "ekf", delay_periods = 2, gravity = 9.8 }
[plant]
vehicle = "hummingbird_arm2_rotors"
gravity = 9.8
[model]
vehicle = "hummingbird_arm2"
[controller]
preset = "centroidal_tip"
[reference.base]
kind = "circle"
radius = 0.3
frequency_hz = 0.08
center = [0.0, 0.0, 1.0]
[[reference.joints]]
kind = "sine"
amplitude = 0.2
frequency_hz = 0.5
[[reference.joints]]
kind = "constant"
value = 0.0
[sensors.imu]
kind = "imu"
gyro = { density = 0.005, walk = 1e-4, turn_on = 0.01 }
accelerometer = { density = 0.02, walk = 1e-3, turn_on = 0.1 }
[sensors.mocap]
kind = "pose"
latency = 0.01
[sensors.encoders]
kind = "encoders"
"""

GPS = {
    "kind": "position",
    "frequency": 20.0,
    "latency": 0.05,
    "position": {"sigma": 0.01},
}
COMPASS = {"kind": "heading", "frequency": 20.0, "heading": {"sigma": 0.02}}


def estimated_document() -> dict[str, Any]:
    """The file as plain tables."""
    return tomllib.loads(TEXT)


def estimated(**changes: Any) -> skyarm.Scenario:
    """The flight; ``estimator__gate=3.0`` puts a value in a table, None takes it
    out.
    """
    made = copy.deepcopy(estimated_document())
    for place, value in changes.items():
        *tables, last = place.split("__")
        table = made
        for name in tables:
            table = table.setdefault(name, {})
        table[last] = value
        if value is None:
            del table[last]
    return skyarm.scenario_from(made)


def with_satellites(aiding: str, **changes: Any) -> skyarm.Scenario:
    """The flight on position, with a compass or without, in place of motion capture."""
    given: dict[str, Any] = {"sensors__mocap": None, "sensors__gps": GPS}
    given |= {
        "estimator__aiding": aiding,
        "estimator__delay_periods": 10,
        "estimator__position": 0.01,
    }
    if aiding == "position_heading":
        given["sensors__compass"] = COMPASS
    return estimated(**(given | changes))


@dataclass(frozen=True)
class Flight:
    """What an engine left: samples of its periods, the loop at its end, the engine
    itself.
    """

    rows: np.ndarray
    carry: LoopState
    engine: Engine


def fly(scenario: Scenario, *, python: bool = False) -> Flight:
    """An episode by one engine, in machine code or in Python."""
    flown = Engine(
        flight_programs.EpisodeCode(scenario, machine_code=not python, commands=False)
    )
    while flown.fly(scenario.steps):
        pass
    return Flight(flown.recorder.table[: flown.tick], flown.now, flown)


@contextmanager
def shared_programs() -> Iterator[None]:
    """Within it a scenario is traced and compiled once by each engine, however many
    flights there are of it.

    Most of a short flight is the making of its program. Scenarios are the same if their
    texts are: laws and components of Python are then the same objects, and a structural
    0 is not taken for a 0.0. Programs keep nothing of a flight.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            flight_programs, "EpisodeCode", _codes(flight_programs.EpisodeCode)
        )
        yield


def _codes(code: Callable[..., EpisodeCode]) -> Callable[..., EpisodeCode]:
    made: dict[str, tuple[EpisodeCode, Any]] = {}

    def kept(
        scenario: Any, vary: Any = None, numbers: Any = (), **options: Any
    ) -> EpisodeCode:
        if not scenario.controller.compiled:
            return code(scenario, vary, numbers, **options)
        text = whole_text((dataclasses.replace(scenario, changes=()), numbers, options))
        if text not in made:
            # kept: no other takes its address
            made[text] = code(scenario, vary, numbers, **options), scenario
        return made[text][0]

    return kept


@contextmanager
def processes(count: int) -> Iterator[Processes]:
    """Pool that ends with the block; what still flies is abandoned if the block
    fails.
    """
    pool, abandon = Processes(count), True
    try:
        yield pool
        abandon = False
    finally:
        pool.close(abandon=abandon)


def elsewhere(function: Callable[..., Any], *arguments: Any) -> Any:
    """Result of a call in another process."""
    with processes(1) as pool:
        pool.submit("only", function, *arguments)
        return pool.collect()[1]


STEP, GRAVITY = 0.002, 9.81
"""s, between samples and between commands, and m/s^2."""

QUAD = skyarm.load_vehicle("hummingbird")
ARM = skyarm.load_vehicle("hummingbird_arm2_rotors")


def _one_joint():
    """The first joint of the arm alone, with friction and the reflected inertia of its
    motor.
    """
    joint = dataclasses.replace(
        ARM.links[0].joint, damping=0.01, coulomb=0.01, coulomb_rate=0.2, armature=1e-3
    )
    links = (dataclasses.replace(ARM.links[0], joint=joint),)
    return dataclasses.replace(
        ARM, name="one_joint", links=links, frames=(), end_effector=""
    )


ONE = _one_joint()


def on_servo(**numbers):
    """One joint on a position servo, whose damping holds that of the joint."""
    (link,) = ONE.links
    link = dataclasses.replace(link, joint=dataclasses.replace(link.joint, damping=0.0))
    servo = PositionServo(
        **{"stiffness": 4.0, "damping": 0.2, "inertia": 1e-3, **numbers}
    )
    return dataclasses.replace(
        ONE, links=(link,), drives=(MountedDrive(name=link.joint.name, drive=servo),)
    )


def multisine(size, low, high, count, seed):
    """Sines of random phases between two frequencies, Hz, that grow from rest in half a
    second.
    """
    draw = np.random.default_rng(seed)
    sines = (
        Sine(
            amplitude=size * low / (f * count**0.5),
            frequency_hz=float(f),
            phase=float(draw.uniform(-3.0, 3.0)),
        )
        for f in np.linspace(low, high, count)
    )
    return Product(
        Sum(tuple(sines)), Ramp(start=0.0, duration=0.5, height=1.0, shape="quintic")
    )


def path(vehicle, swing=0.8, pace=1.0):
    """Reference that excites every axis, and joints by a swing, rad; slower by a pace
    below 1.
    """
    size = 0.5
    return Trajectory(
        x=multisine(size, 0.4 * pace, 1.6 * pace, 5, 1),
        y=multisine(size, 0.45 * pace, 1.7 * pace, 5, 2),
        z=Sum((Constant(10.0), multisine(size, 0.3 * pace, 1.3 * pace, 5, 3))),
        yaw=multisine(size, 0.3 * pace, 1.0 * pace, 5, 4),
        joints=tuple(
            Sum((Constant(0.4), multisine(swing, 0.5, 2.5, 6, 5 + i)))
            for i in range(vehicle.n)
        ),
    )


def unheard(base):
    """The centroidal law of a scenario without its accelerometer: the data stay those
    of noisier commands.
    """
    facts = suitable_options("centroidal", loop_facts(base.rates, base.delays))
    mode = "tip" if base.plant.vehicle.end_effector else "joint"
    return make_controller(
        "centroidal",
        base.controller.par.model,
        mode=mode,
        accelerometer=(0.0, 0.0),
        **facts,
    )


@dataclass(frozen=True)
class ShortSteps(Air):
    """Calm air that has a plant take steps of at most a length, s."""

    largest_step: float | None = None


@cache
def flown(vehicle, duration, rotors=0.0, joints=0.0, swing=0.8, pace=1.0, longest=None):
    """Log of a closed loop at 500 Hz whose commands reach rotors and joints late, s, in
    steps of at most `longest`.
    """
    base = of_vehicle(dataclasses.replace(vehicle, drives=()))
    scenario = dataclasses.replace(
        base,
        controller=_by_setpoints(unheard(base)) if vehicle.drives else unheard(base),
        plant=dataclasses.replace(base.plant, vehicle=vehicle),
        reference=path(vehicle, swing, pace),
        duration=duration,
        rates=Rates(physics=10_000, control=500, reference=50),
        delays=Delays(measurement=0.002, rotors=rotors, joints=joints),
        environment=(
            Environment()
            if longest is None
            else Environment(air=(ShortSteps(longest),))
        ),
    )
    log = skyarm.run(scenario)
    assert log.info["status"] == "completed"
    return log


def _by_setpoints(controller):
    """The control law with the reference's positions as setpoints of the joints."""

    def law(memory, seen, wanted, dt, *, par, inner=controller.law):
        memory, command = inner(memory, seen, wanted, dt, par=par)
        return memory, dataclasses.replace(command, efforts=wanted.joints)

    return dataclasses.replace(controller, law=law)


def mean_forces(log, place=(0.0, 0.0, 0.0)):
    """Specific force (rows - 1, 3) at a place of the base, m/s^2, by what the velocity
    there gains over each period.
    """
    R = rotations(log.quaternion)
    velocity = log.velocity + np.einsum(
        "kij,kj->ki", R, np.cross(log.rate, np.array(place))
    )
    gained = np.diff(velocity, axis=0) / np.diff(log.time)[:, None] + np.array(
        [0.0, 0.0, GRAVITY]
    )
    half = log.quaternion[1:] + log.quaternion[:-1]
    return np.einsum(
        "kji,kj->ki",
        rotations(half / np.linalg.norm(half, axis=1, keepdims=True)),
        gained,
    )


def rotations(quaternion):
    """Rotation matrices (N, 3, 3) of attitudes (N, 4), w x y z."""
    w, x, y, z = quaternion.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


NOISE = {
    "gyro": 2e-3,
    "accelerometer": 0.02,
    "position": 5e-4,
    "quaternion": 5e-4,
    "velocity": 5e-3,
    "joint_positions": 2e-4,
}
"""Standard deviations of good sensors, SI units."""


def measured(
    log,
    *,
    noise=0.0,
    place=(0.0, 0.0, 0.0),
    late=0.0,
    without=(),
    name="flight",
    seed=0,
    servo=False,
):
    """Flight as sensors measure it at every period; the mean specific force has the
    time of its middle.

    Args:
        log: of the simulation.
        noise: times that of good sensors.
        place: m, of the inertial unit.
        late: s, of the stamps of the pose.
        without: quantities that are left out.
        name: of the flight.
        seed: of the noise.
        servo: whether the joints' commands are setpoints.
    """
    draw, pose = np.random.default_rng(seed), ("position", "quaternion", "velocity")
    rows = {
        "gyro": log.rate,
        "accelerometer": np.concatenate(
            [[[0.0, 0.0, GRAVITY]], mean_forces(log, place)]
        ),
        "position": log.position,
        "quaternion": log.quaternion,
        "velocity": log.velocity,
        "rotor_speed_commands": log.rotor_commands,
    }
    if log.joints.shape[1]:
        rows |= {
            "joint_positions": log.joints,
            "joint_commands" if servo else "joint_efforts": log.efforts,
        }
    channels = {}
    for each, values in rows.items():
        if each in without:
            continue
        size = noise * NOISE.get(each, 0.0) * (0.5 if each == "quaternion" else 1.0)
        noisy = values + size * draw.standard_normal(values.shape)
        if each == "quaternion":
            noisy = noisy / np.linalg.norm(noisy, axis=1, keepdims=True)
        shift = (
            late if each in pose else -0.5 * STEP if each == "accelerometer" else 0.0
        )
        channels[each] = Channel(time=log.time + shift, values=noisy, source=each)
    return FlightData(name=name, file=f"{name}.npz", channels=channels)


def turning(time, rate=0.8, speed=2.0):
    """Motion along x that turns about z, with quaternions of alternating sign."""
    time = np.asarray(time, dtype=float)
    zero, half = 0.0 * time, 0.5 * rate * time
    signs = np.where(np.arange(len(time)) % 2, -1.0, 1.0)[:, None]
    return PoseSeries(
        time=time,
        position=np.stack([speed * time, zero, zero], axis=1),
        quaternion=signs * np.stack([np.cos(half), zero, zero, np.sin(half)], axis=1),
        joints=time[:, None],
    )
