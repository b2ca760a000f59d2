"""Flights of vehicles whose every number is known, as noisy sensors measure them, and
start vehicles 20 to 30 % off.

Eight vehicles of a kind fly at once, one in each lane of the machine code; arms are
integrated by fourth-order steps of 0.4 ms, and a flight is kept for all the channels,
noises and clocks that it is measured with.

    case = planted("arm2", seed=3)
    flight = measured(case, noise="low", without=("velocity",))
    found = skyarm.identify_flights([flight], case.start)
    found["base.inertia.xx"].value, case.truth["base.inertia.xx"]
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from functools import cache

import numpy as np

import skyarm
from skyarm.algebra import Sym3, Vec3
from skyarm.control.model import Model
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.plant.interface import Truth
from skyarm.plant.joint_rate import friction_rate
from skyarm.reference import Constant, Product, Ramp, Sine, Sum, Trajectory
from skyarm.scenario.controller_table import loop_facts, make_named_or_tuned
from skyarm.scenario.scenario_record import Delays, Rates, Scenario
from skyarm.sensing.measurement import SensorNoise
from skyarm.simulate.batch_log import BatchLog
from skyarm.vehicle.vehicle_records import Vehicle
from skyarm.world.disturbance_signals import Disturbance
from skyarm.world.signal_vector import SignalVector

KINDS = ("quad", "arm2", "arm3")
"""Quadrotor; quadrotor with two joints; hexarotor with three joints."""

LANES = 8
"""Vehicles that fly at once."""

SAMPLE, PHYSICS = 1.0 / 500.0, 20_000
"""s, between samples of the sensors and between commands; Hz, that delays are whole
steps of."""

GRAVITY = 9.81
SHORT = 5.0
"""s, of flights for which code is made without optimisation."""

LONGEST = 0.016
"""s, of the delays."""

STIFF = 1.5e3
"""1/s, friction for which steps of the fourth-order integrator are chosen, five to a
period: states are then within 1e-9 of those of steps a quarter as long.
"""

NOISES: Mapping[str, Mapping[str, float]] = {
    "none": {},
    "low": {
        "gyro": 0.002,
        "accelerometer": 0.02,
        "position": 2e-4,
        "quaternion": 2e-4,
        "velocity": 2e-3,
        "joint_positions": 1e-4,
        "joint_rates": 2e-3,
    },
    "coarse": {
        "gyro": 0.002,
        "accelerometer": 0.02,
        "position": 2e-4,
        "quaternion": 2e-4,
        "velocity": 2e-3,
        "joint_positions": 1.5e-3,
        "joint_rates": 2e-3,
    },
    "high": {
        "gyro": 0.02,
        "accelerometer": 0.2,
        "position": 2e-3,
        "quaternion": 2e-3,
        "velocity": 2e-2,
        "joint_positions": 1.5e-3,
        "joint_rates": 2e-2,
    },
}
"""Standard deviations of white noise in SI units, of an attitude that of a rotation
vector; coarse: encoders only."""

POSES = ("position", "quaternion", "velocity")
"""Channels at 100 Hz, of a clock of their own where one is asked for."""

POSE_EVERY = 5

LATE, FAST = 3.7, 3e-5
"""s and s/s: what the other clock shows more, and gains."""

MOTIONS = ("excited", "gentle", "hover")
"""Everything shakes; a fifth of that; drifts of some centimetres at rest, under a law
with noisy measurements."""


@dataclasses.dataclass(frozen=True)
class Case:
    """Vehicle with its flight: arrays of N instants, and the numbers that are to be
    found.

    Attributes:
        name: of kind, motion and seed.
        vehicle: that flew. start: what is known before: 20 to 30 % off, of the true
            total mass.
        truth: reported name -> number.
        place: m, of the inertial unit. offset: m/s^2. bias: rad/s.
        seed: of the noise of its sensors.
        states: name of the quantity -> (N, k), true values at instants 2 ms apart.
        commands: name of the quantity -> (N, k).
    """

    name: str
    vehicle: Vehicle
    start: Vehicle
    truth: Mapping[str, float]
    place: tuple[float, float, float]
    offset: tuple[float, float, float]
    bias: tuple[float, float, float]
    seed: int
    states: Mapping[str, np.ndarray]
    commands: Mapping[str, np.ndarray]


def nominal(kind: str) -> Vehicle:
    """Vehicle from which those of a kind are drawn: with hub drag, body drag, friction
    and armature.
    """
    if kind == "quad":
        found = skyarm.load_vehicle("hummingbird")
        links = ()
    elif kind == "arm2":
        found = skyarm.load_vehicle("hummingbird_arm2_rotors")
        links = found.links
    else:
        found = skyarm.load_vehicle("hexarotor_arm6")
        links = found.links[:3]
    small = kind != "arm3"
    joints = [
        dataclasses.replace(
            link.joint,
            damping=0.002 if small else 0.008,
            coulomb=0.004 if small else 0.02,
            coulomb_rate=0.2 if small else 0.3,
            armature=2e-4 if small else 1.5e-3,
        )
        for link in links
    ]
    links = tuple(
        dataclasses.replace(link, joint=joint)
        for link, joint in zip(links, joints, strict=True)
    )
    lags = {} if small else {"time_constant_up": 0.02, "time_constant_down": 0.03}
    rotors = tuple(
        dataclasses.replace(each, inertia=1.2e-5 if small else 8e-5, **lags)
        for each in found.rotors
    )
    area = Vec3(0.02, 0.025, 0.04) if small else Vec3(0.04, 0.05, 0.09)
    frames = tuple(
        dataclasses.replace(
            found.frames[0], link=len(links) - 1, position=Vec3(0.0, 0.0, -0.15)
        )
        for _ in links[:1]
    )
    return dataclasses.replace(
        found,
        name=kind,
        base=dataclasses.replace(found.base, com=Vec3(0.0, 0.0, 0.0)),
        links=links,
        rotors=rotors,
        frames=frames,
        end_effector="tip" if links else "",
        drag=dataclasses.replace(found.drag, area=area),
    )


def _sines(draw: np.random.Generator, *pairs: tuple[float, float]) -> Sum:
    """Sines of amplitudes and frequencies (Hz), of random phases, that fade in from
    rest.
    """
    ease = Ramp(start=0.0, duration=3.0, height=1.0, shape="quintic")
    return Sum(
        tuple(
            Product(
                Sine(amplitude=a, frequency_hz=f, phase=float(draw.uniform(-3.0, 3.0))),
                ease,
            )
            for a, f in pairs
        )
    )


def _path(vehicle: Vehicle, motion: str) -> Trajectory:
    """Reference motion: phases of its sines differ from vehicle to vehicle."""
    draw, size = (
        np.random.default_rng(11),
        {"excited": 0.45, "gentle": 0.1, "hover": 0.0}[motion],
    )
    if motion == "hover":
        x, y, z = (
            _sines(draw, (0.05, 0.05 + slow), (0.03, 0.11 + slow))
            for slow in (0.0, 0.01, 0.02)
        )
        rest = tuple(Constant(0.3 * (i > 0)) for i in range(vehicle.n))
        return Trajectory(
            x=x, y=y, z=Sum((Constant(10.0), z)), yaw=Constant(0.0), joints=rest
        )

    def sines(*pairs: tuple[float, float]) -> Sum:
        return _sines(draw, *((size * a, f) for a, f in pairs))

    swing = 1.6 if vehicle.n < 3 else 0.9
    return Trajectory(
        x=sines((0.5, 0.19), (0.28, 0.47), (0.07, 0.97)),
        y=sines((0.5, 0.23), (0.25, 0.53), (0.07, 1.03)),
        z=Sum((Constant(10.0), sines((0.35, 0.29), (0.14, 0.71), (0.04, 1.4)))),
        yaw=sines((0.6, 0.17), (0.25, 0.61), (0.1, 1.3)),
        joints=tuple(
            Sum(
                (
                    Constant(0.3 * (i > 0)),
                    sines(
                        (0.35 * swing, 0.31 + 0.07 * i),
                        (0.18 * swing, 0.83 + 0.11 * i),
                        (0.06 * swing, 2.1 + 0.2 * i),
                    ),
                )
            )
            for i in range(vehicle.n)
        ),
    )


def _scenario(kind: str, motion: str, seconds: float) -> Scenario:
    """Flight of the nominal vehicle under a law that knows it; the lanes replace its
    numbers.
    """
    vehicle, rates = nominal(kind), Rates(physics=PHYSICS, control=500, reference=100)
    delays = Delays(rotors=0.004, joints=0.003, longest_command=LONGEST)
    named = "centroidal_tip" if vehicle.end_effector else "centroidal_joint"
    law = make_named_or_tuned(
        named, Model(vehicle=vehicle, gravity=GRAVITY), loop_facts(rates, Delays())
    )
    trim = SignalVector(x=Constant(1e-6), y=Constant(1e-6), z=Constant(1e-6))
    noise = SensorNoise(
        position=5e-4,
        velocity=5e-3,
        attitude=1e-3,
        rate=5e-3,
        joints=5e-4,
        joint_rates=5e-3,
    )
    return Scenario(
        name=f"{kind}_{motion}",
        rates=rates,
        plant=Truth(vehicle=vehicle, gravity=GRAVITY),
        controller=law,
        reference=_path(vehicle, motion),
        duration=seconds,
        delays=delays,
        forces=(Disturbance(axes="frame", torque=trim),),
        noise=noise if motion == "hover" else SensorNoise(),
    )


def _drawn(kind: str, vehicle: Vehicle, seed: int) -> dict[str, float]:
    """Numbers of one vehicle by their path in the scenario, up to 25 % off the nominal
    one's.
    """
    draw = np.random.default_rng([seed, KINDS.index(kind), 1])

    def near(value: float, share: float = 0.25) -> float:
        return float(value) * float(draw.uniform(1.0 - share, 1.0 + share))

    at, found = "plant.vehicle", dict[str, float]()
    found[f"{at}.base.mass"] = near(vehicle.base.mass, 0.1)
    second = [near(each) for each in _second_moments(vehicle.base.inertia)]
    for axis, value in zip(
        ("xx", "yy", "zz"), (sum(second) - each for each in second), strict=True
    ):
        found[f"{at}.base.inertia.{axis}"] = value
    for axis in ("xy", "xz", "yz"):
        found[f"{at}.base.inertia.{axis}"] = (
            0.02 * sum(second) * float(draw.uniform(-1.0, 1.0))
        )
    for axis in "xyz":
        found[f"{at}.base.com.{axis}"] = float(draw.uniform(-0.005, 0.005))
        found[f"{at}.drag.area.{axis}"] = near(getattr(vehicle.drag.area, axis))
    for name in OF_ROTORS:
        value = near(
            getattr(vehicle.rotors[0], name),
            0.12 if name == "thrust_coefficient" else 0.25,
        )
        found |= {f"{at}.rotors.{i}.{name}": value for i in range(len(vehicle.rotors))}
    for i, link in enumerate(vehicle.links):
        body, joint, here = link.body, link.joint, f"{at}.links.{i}"
        found[f"{here}.body.mass"] = near(body.mass)
        for axis in "xyz":
            found[f"{here}.body.com.{axis}"] = near(getattr(body.com, axis)) + float(
                draw.uniform(-0.003, 0.003)
            )
        size = near(1.0)
        for axis in ("xx", "yy", "zz"):
            found[f"{here}.body.inertia.{axis}"] = size * float(
                getattr(body.inertia, axis)
            )
        for name in OF_JOINTS:
            found[f"{here}.joint.{name}"] = near(getattr(joint, name))
    found["delays.rotors"] = int(draw.integers(20, 110)) / PHYSICS
    for axis in "xyz":
        found[f"environment.forces.0.torque.{axis}.value"] = float(
            draw.uniform(-1.0, 1.0)
        ) * ((0.003 if axis == "z" else 0.01) * float(vehicle.mass) / 0.8)
    if vehicle.n:
        found["delays.joints"] = int(draw.integers(20, 160)) / PHYSICS
    return found


OF_ROTORS = (
    "thrust_coefficient",
    "moment_coefficient",
    "time_constant_up",
    "time_constant_down",
    "inertia",
    "drag_coefficient",
)
OF_JOINTS = ("damping", "coulomb", "coulomb_rate", "armature")


def _phases(scenario: Scenario, seed: int) -> dict[str, float]:
    """Phases of a vehicle's sines by their path."""
    draw, found = (
        np.random.default_rng([seed, 2, scenario.plant.vehicle.n]),
        dict[str, float](),
    )

    def phases(path: str, signal: Sum) -> None:
        for i, each in enumerate(signal.signals):
            if isinstance(each, Product):
                found[f"{path}.signals.{i}.signal.phase"] = float(
                    draw.uniform(-3.0, 3.0)
                )
            elif isinstance(each, Sum):
                phases(f"{path}.signals.{i}", each)

    path = scenario.reference
    for name in ("x", "y", "z", "yaw"):
        if isinstance(getattr(path, name), Sum):
            phases(f"reference.{name}", getattr(path, name))
    for i, each in enumerate(path.joints):
        if isinstance(each, Sum):
            phases(f"reference.joints.{i}", each)
    return found


def _second_moments(inertia: Sym3) -> tuple[float, float, float]:
    """Second moments of mass along x, y, z, kg m^2, of the moments of inertia."""
    half = 0.5 * (float(inertia.xx) + float(inertia.yy) + float(inertia.zz))
    return half - float(inertia.xx), half - float(inertia.yy), half - float(inertia.zz)


def _far(draw: np.random.Generator) -> float:
    """Factor 20 to 30 % off 1."""
    return 1.0 + float(draw.choice([-1.0, 1.0]) * draw.uniform(0.2, 0.3))


def _start(vehicle: Vehicle, seed: int) -> tuple[Vehicle, dict[str, float]]:
    """Vehicle 20 to 30 % off, of the same total mass and rotor places, and the factors
    of its links' inertia.
    """
    draw, factors = (
        np.random.default_rng([seed, 3, len(vehicle.links)]),
        dict[str, float](),
    )
    rotor = {name: _far(draw) for name in OF_ROTORS}
    rotors = tuple(
        dataclasses.replace(
            each,
            **{
                name: factor * float(getattr(each, name))
                for name, factor in rotor.items()
            },
        )
        for each in vehicle.rotors
    )
    links = []
    for link in vehicle.links:
        factors[link.name] = _far(draw)
        body = dataclasses.replace(
            link.body,
            mass=_far(draw) * float(link.body.mass),
            com=Vec3(0.0, 0.0, _far(draw) * float(link.body.com.z)),
            inertia=Sym3(
                *(
                    factors[link.name] * float(each)
                    for each in link.body.inertia.entries
                )
            ),
        )
        joint = {
            name: _far(draw) * float(getattr(link.joint, name)) for name in OF_JOINTS
        }
        links.append(
            dataclasses.replace(
                link, body=body, joint=dataclasses.replace(link.joint, **joint)
            )
        )
    second = [_far(draw) * each for each in _second_moments(vehicle.base.inertia)]
    moments = [sum(second) - each for each in second]
    base = dataclasses.replace(
        vehicle.base,
        mass=float(vehicle.mass) - sum(float(link.body.mass) for link in links),
        com=Vec3(0.0, 0.0, 0.0),
        inertia=Sym3(*moments, 0.0, 0.0, 0.0),
    )
    area = Vec3(*(_far(draw) * float(each) for each in vehicle.drag.area))
    drag = dataclasses.replace(vehicle.drag, area=area)
    name = f"{vehicle.name}_start"
    return (
        dataclasses.replace(
            vehicle, name=name, base=base, rotors=rotors, links=tuple(links), drag=drag
        ),
        factors,
    )


def _truth(
    vehicle: Vehicle,
    numbers: Mapping[str, float],
    factors: Mapping[str, float],
    place: Sequence[float],
) -> dict[str, float]:
    """True values by their reported name, but for those of the accelerometer."""
    found = {
        f"rotors.{name}": float(getattr(vehicle.rotors[0], name)) for name in OF_ROTORS
    }
    for axis in ("xx", "yy", "zz", "xy", "xz", "yz"):
        found[f"base.inertia.{axis}"] = float(getattr(vehicle.base.inertia, axis))
    for i, axis in enumerate("xyz"):
        found[f"base.com.{axis}"] = float(getattr(vehicle.base.com, axis))
        found[f"drag.area.{axis}"] = float(getattr(vehicle.drag.area, axis))
        found[f"place.{axis}"] = place[i]
        found[f"torque.{axis}"] = numbers[f"environment.forces.0.torque.{axis}.value"]
    for link in vehicle.links:
        at = f"links.{link.name}"
        found[f"{at}.mass"] = float(link.body.mass)
        found |= {
            f"{at}.com.{axis}": float(getattr(link.body.com, axis)) for axis in "xyz"
        }
        found[f"{at}.inertia"] = 1.0 / factors[link.name]
        found |= {
            f"{at}.joint.{name}": float(getattr(link.joint, name)) for name in OF_JOINTS
        }
    found["delay"] = numbers["delays.rotors"]
    if vehicle.links:
        found["joint_delay"] = numbers["delays.joints"]
    found["drift"] = 0.0
    return found


def _columns(record: object, lane: int, names: Sequence[str]) -> np.ndarray:
    """Numbers of a logged record in one lane, (N, names)."""
    return np.stack([np.asarray(getattr(record, name))[lane] for name in names], axis=1)


@cache
def fly(
    kind: str, motion: str = "excited", seconds: float = 60.0, block: int = 0
) -> tuple[Case, ...]:
    """Eight vehicles of a kind on their flights: seeds ``8 * block`` on."""
    scenario = _scenario(kind, motion, seconds)
    seeds = range(LANES * block, LANES * (block + 1))
    drawn = [_drawn(kind, scenario.plant.vehicle, seed) for seed in seeds]
    values = [
        {**numbers, **_phases(scenario, seed)}
        for numbers, seed in zip(drawn, seeds, strict=True)
    ]
    paths = tuple(values[0])
    batch = skyarm.Batch(
        scenario,
        paths,
        metrics=(),
        stiffest=_stiff(scenario) if scenario.plant.vehicle.n else None,
        log_every=1,
        effort=2 if seconds > SHORT else 0,
    )
    flown = batch.fly(
        {path: np.array([each[path] for each in values]) for path in paths}, seed=block
    )
    assert flown.completed.all(), f"{kind}, {motion}: {flown.status}"
    return tuple(
        _case(kind, scenario, seed, numbers, flown.log, lane)
        for lane, (seed, numbers) in enumerate(zip(seeds, drawn, strict=True))
    )


def _stiff(scenario: Scenario) -> Scenario:
    """The scenario with friction so stiff that the integrator takes short steps."""
    vehicle = scenario.plant.vehicle
    times = STIFF / friction_rate(vehicle)
    numbers = {
        f"plant.vehicle.links.{i}.joint.{name}": (
            times * float(getattr(link.joint, name))
        )
        for i, link in enumerate(vehicle.links)
        for name in ("damping", "coulomb")
    }
    return skyarm.with_numbers(scenario, numbers)


def _case(
    kind: str,
    scenario: Scenario,
    seed: int,
    numbers: dict[str, float],
    log: BatchLog,
    lane: int,
) -> Case:
    """One lane's vehicle with its flight."""
    draw = np.random.default_rng([seed, KINDS.index(kind), 4])
    place, offset, bias = (
        tuple(float(draw.uniform(-most, most)) for most in each)
        for each in ((0.02,) * 3, (0.1, 0.1, 0.03), (0.004,) * 3)
    )
    vehicle = skyarm.with_numbers(scenario, numbers).plant.vehicle
    start, factors = _start(vehicle, seed)
    state, command = log.state, log.command
    position, velocity, rate = (
        _columns(each, lane, ("x", "y", "z"))
        for each in (state.position, state.velocity, state.rate)
    )
    attitude = _columns(state.quaternion, lane, ("w", "x", "y", "z"))
    states = {
        "gyro": rate,
        "position": position,
        "quaternion": attitude,
        "velocity": velocity,
    }
    states["accelerometer"] = _specific_force(velocity, attitude, rate, np.array(place))
    commands = {"rotor_speed_commands": _rows(command.rotor_speeds, lane)}
    if vehicle.n:
        states |= {
            "joint_positions": _rows(state.joints, lane),
            "joint_rates": _rows(state.joint_rates, lane),
        }
        commands["joint_efforts"] = _rows(command.efforts, lane)
    return Case(
        name=f"{scenario.name}_{seed}",
        vehicle=vehicle,
        start=start,
        truth=_truth(vehicle, numbers, factors, place)
        | {f"offset.{axis}": value for axis, value in zip("xyz", offset, strict=True)},
        place=place,
        offset=offset,
        bias=bias,
        seed=seed,
        states=states,
        commands=commands,
    )


def _rows(columns: Sequence[np.ndarray], lane: int) -> np.ndarray:
    """Numbers of one lane, (N, columns)."""
    return np.stack([np.asarray(each)[lane] for each in columns], axis=1)


def rotate(attitude: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Vectors (N, 3) in world axes of such in base axes, by attitudes (N, 4) w, x, y,
    z.
    """
    w, v = attitude[:, :1], attitude[:, 1:]
    turned = np.cross(v, vectors)
    return vectors + 2.0 * (w * turned + np.cross(v, turned))


def inverse(attitude: np.ndarray) -> np.ndarray:
    """Attitudes (N, 4) of the world in base axes."""
    return attitude * [1.0, -1.0, -1.0, -1.0]


def product(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Attitudes (N, 4): the second turned by the first."""
    (a, b, c, d), (w, x, y, z) = first.T, second.T
    rows = (
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    )
    return np.stack(rows, axis=1)


def _specific_force(
    velocity: np.ndarray, attitude: np.ndarray, rate: np.ndarray, place: np.ndarray
) -> np.ndarray:
    """Mean specific force over the sample's period before each instant, at a place of
    the base, base axes.

    What the velocity there gains over the period, in the axes of its middle: within
    1e-4 m/s^2 of the mean of what is felt in turning axes. The first row repeats the
    second.
    """
    there = velocity + rotate(attitude, np.cross(rate, place))
    middle = attitude[1:] + attitude[:-1]
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    gained = np.diff(there, axis=0) / SAMPLE + [0.0, 0.0, GRAVITY]
    felt = rotate(inverse(middle), gained)
    return np.concatenate([felt[:1], felt])


def planted(
    kind: str, seed: int = 0, motion: str = "excited", seconds: float = 60.0
) -> Case:
    """One vehicle of a kind with its flight."""
    return fly(kind, motion, seconds, seed // LANES)[seed % LANES]


def measured(
    case: Case,
    noise: str = "low",
    without: Sequence[str] = (),
    *,
    other_clock: bool = False,
    on_rows: bool = False,
    seconds: float = 0.0,
) -> FlightData:
    """The flight as sensors of a noise measure it.

    Args:
        case: vehicle and flight.
        noise: name in ``NOISES``.
        without: channels that are left out; ``pose`` means position and quaternion.
        other_clock: pose and velocity are stamped by a clock that is seconds off and
            gains.
        on_rows: they are held on the gyro's rows, as a logger at its rate writes them.
        seconds: of the flight that are kept; all by default.
    """
    left_out = {
        each for name in without for each in (POSES[:2] if name == "pose" else (name,))
    }
    draw, sizes = (
        np.random.default_rng([case.seed, list(NOISES).index(noise), 5]),
        NOISES[noise],
    )
    count = len(case.states["gyro"]) if not seconds else round(seconds / SAMPLE)
    time, channels = SAMPLE * np.arange(count), dict[str, Channel]()
    biases = {"gyro": np.array(case.bias), "accelerometer": np.array(case.offset)}
    for name, rows in case.states.items():
        noisy = draw.normal(
            scale=sizes.get(name, 0.0) or 0.0,
            size=(len(rows), 3 if name == "quaternion" else rows.shape[1]),
        )
        if name == "quaternion":
            half = np.concatenate([np.ones((len(rows), 1)), 0.5 * noisy], axis=1)
            values = product(rows, half / np.linalg.norm(half, axis=1, keepdims=True))
        else:
            values = rows + noisy + biases.get(name, 0.0)
        stamps, values = time, values[:count]
        if name in POSES:
            stamps, values = time[::POSE_EVERY], values[::POSE_EVERY]
            if on_rows:
                held = np.arange(count) // POSE_EVERY
                stamps, values = time, values[held]
            elif other_clock:
                stamps = (1.0 + FAST) * stamps + LATE
        if name not in left_out:
            channels[name] = Channel(time=stamps, values=values, source=name)
    for name, rows in case.commands.items():
        if name not in left_out:
            channels[name] = Channel(time=time, values=rows[:count], source=name)
    return FlightData(name=case.name, file=f"{case.name}.csv", channels=channels)


def rubbing(case: Case, share: float) -> Vehicle:
    """The start of a case that knows damping and dry friction of the joints to a share,
    and their bend and armature.
    """
    links = tuple(
        dataclasses.replace(
            link,
            joint=dataclasses.replace(
                true.joint,
                damping=share * true.joint.damping,
                coulomb=share * true.joint.coulomb,
            ),
        )
        for link, true in zip(case.start.links, case.vehicle.links, strict=True)
    )
    return dataclasses.replace(case.start, links=links)
