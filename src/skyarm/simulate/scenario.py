"""One experiment: truth, belief, controller, reference, environment, clock."""

from __future__ import annotations

import math
import numbers
import re
from dataclasses import dataclass
from typing import Any

from skyarm.actuation import make_mixer
from skyarm.actuation.hover import hover_trim
from skyarm.algebra import Quaternion, Vec3
from skyarm.control.controller import Controller
from skyarm.dynamics import State
from skyarm.environment import NO_WIND, Airspeed, Fault, RotorsForce, Wind
from skyarm.files import number, shown
from skyarm.plant.interface import World
from skyarm.plant.interface import number as data
from skyarm.plant.rigid_body import INTEGRATORS
from skyarm.plant.sensors import SensorNoise
from skyarm.plant.stiffness import friction_rate
from skyarm.reference import Trajectory
from skyarm.scalars import Scalar, cos, minimum, sin
from skyarm.vehicle.check import TOLERANCE, concrete, require_plant

PLANTS = ("rigid_body", "mujoco")

HIGHEST_RATE = 1_000_000
"""Hz: a clock beyond this is a slip of units."""

LONGEST_FLIGHT = 10_000_000
"""Control periods of one episode, 14 h at 200 Hz: its log takes about 10 GB."""

LONGEST_QUEUE = 100
"""Control periods that a varied delay of the commands may take: the loop remembers as many commands."""

PERFECT_SENSORS = SensorNoise()


class ScenarioError(ValueError):
    """A scenario's description is wrong."""


def _whole(value: Any) -> int | None:
    """A whole number, NumPy's too, as Python's; None for anything else."""
    return int(value) if not isinstance(value, bool) and isinstance(value, numbers.Integral) else None


@dataclass(frozen=True, kw_only=True, slots=True)
class Rates:
    """Clock rates in Hz; physics / control and control / reference must be whole numbers."""

    physics: int = 1000
    control: int = 200
    reference: int = 50

    def __post_init__(self) -> None:
        for name in ("physics", "control", "reference"):
            value = getattr(self, name)
            held = _whole(value)
            if held is None or not 1 <= held <= HIGHEST_RATE:
                allowed = f"must be a whole number of Hz from 1 to {HIGHEST_RATE}"
                raise ScenarioError(f"rates.{name} = {shown(value)}: {allowed}")
            object.__setattr__(self, name, held)
        for fast, slow in (("physics", "control"), ("control", "reference")):
            if getattr(self, fast) % getattr(self, slow):
                raise ScenarioError(
                    f"rates.{slow} = {getattr(self, slow)}: must divide rates.{fast} = {getattr(self, fast)}"
                )


@dataclass(frozen=True, kw_only=True, slots=True)
class Delays:
    """Dead times of the loop, s.

    Attributes:
        measurement: age of the measurement, a whole number of control periods.
        command: time before a command takes effect, a whole number of physics steps.
        longest_command: in a batch that varies ``command`` from episode to episode, the longest it gets; its episodes
            may have any delay from 0 to that. None: all episodes have ``command``.
    """

    measurement: float = 0.0
    command: Scalar = 0.0
    longest_command: float | None = None


@dataclass(frozen=True, kw_only=True, slots=True)
class Scenario:
    """Everything that fixes an episode.

    Attributes:
        name: short name. title: one line for people.
        duration: s.
        world: the truth: vehicle and gravity of the plant.
        plant: "rigid_body" or "mujoco". integrator: "rk4" or "euler".
        controller: law with its belief.
        trajectory: reference.
        wind, faults: environment; losses of single actuators.
        sensors, delays: measurement.
        initial: state at t = 0; None is hover trim of the truth at the reference, as far as its rotors can turn.
        seed, episode: keys of all noise.
        ground: end the episode when the lowest point reaches z = 0.
    """

    name: str
    title: str = ""
    duration: float
    rates: Rates = Rates()
    world: World
    plant: str = "rigid_body"
    integrator: str = "rk4"
    controller: Controller
    trajectory: Trajectory
    wind: Wind = NO_WIND
    faults: tuple[Fault, ...] = ()
    sensors: SensorNoise = PERFECT_SENSORS
    delays: Delays = Delays()
    initial: State | None = None
    seed: int = 0
    episode: int = 0
    ground: bool = True

    def __post_init__(self) -> None:
        try:
            _check_kinds(self)
            object.__setattr__(self, "duration", number(self.duration, "duration", low=0.0, strict=True))
            for name in ("seed", "episode"):
                object.__setattr__(self, name, noise_key(name, getattr(self, name)))
            _check(self)
        except ValueError as error:
            raise ScenarioError(str(error)) from None

    @property
    def steps(self) -> int:
        """Number of control periods."""
        return round(self.duration * self.rates.control)


def _check_kinds(scenario: Scenario) -> None:
    """Every field holds a record of its kind: `dataclasses.replace` would take anything."""
    kinds: dict[str, tuple[type, ...]] = {
        **{"title": (str,), "rates": (Rates,), "world": (World,), "controller": (Controller,)},
        **{
            "trajectory": (Trajectory,),
            "wind": (RotorsForce, Airspeed),
            "sensors": (SensorNoise,),
            "delays": (Delays,),
        },
        **{"initial": (State, type(None)), "ground": (bool,)},
    }
    for field, allowed in kinds.items():
        value = getattr(scenario, field)
        if not isinstance(value, allowed):
            names = " or ".join("None" if each is type(None) else each.__name__ for each in allowed)
            raise ScenarioError(f"{field} = {shown(value)}: must be a {names}")
    if not isinstance(scenario.faults, tuple) or not all(isinstance(fault, Fault) for fault in scenario.faults):
        raise ScenarioError(f"faults = {shown(scenario.faults)}: must be a tuple of Fault")


def _check(scenario: Scenario) -> None:
    """Refuse what could not fly, before anything is built."""
    check_name(scenario.name)
    if scenario.duration * scenario.rates.control > LONGEST_FLIGHT:
        longest = LONGEST_FLIGHT / scenario.rates.control
        raise ScenarioError(f"duration = {scenario.duration!r}: must be at most {longest:g} s at this control rate")
    _require_whole("duration", scenario.duration, scenario.rates.control, "control periods")
    for field, value, allowed in (
        ("plant.kind", scenario.plant, PLANTS),
        ("plant.integrator", scenario.integrator, INTEGRATORS),
    ):
        if value not in allowed:
            raise ScenarioError(f"{field} = {shown(value)}: must be one of {', '.join(allowed)}")
    rates = scenario.rates
    for name, rate, unit in (
        ("measurement", rates.control, "control periods"),
        ("command", rates.physics, "physics steps"),
    ):
        if not concrete(getattr(scenario.delays, name)):
            continue
        delay = number(getattr(scenario.delays, name), f"delays.{name}", low=0.0)
        if delay > scenario.duration:
            raise ScenarioError(f"delays.{name} = {delay!r}: must not exceed the duration of {scenario.duration:g} s")
        # the closed loop in machine code takes any delay if it is told the longest; MuJoCo's plant steps
        if name == "measurement" or scenario.delays.longest_command is None or scenario.plant == "mujoco":
            _require_whole(f"delays.{name}", delay, rate, unit)
    _check_longest(scenario)
    _check_vehicles(scenario)
    _check_clocks(scenario)
    if scenario.initial is not None:
        _check_initial(scenario.initial, scenario.world.vehicle.n, len(scenario.world.vehicle.rotors))


def check_name(name: str) -> None:
    """A scenario's name becomes the name of its files."""
    if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9 ._-]{0,99}", name):
        raise ScenarioError(f"name = {shown(name)}: must be 1 to 100 letters, digits, '_', '-', '.' and blanks")


def noise_key(field: str, value: Any) -> int:
    """A key of the noise generator."""
    held = _whole(value)
    if held is None or not 0 <= held < 2**32:
        raise ScenarioError(f"{field} = {shown(value)}: must be a whole number from 0 to 2**32 - 1")
    return held


def _check_clocks(scenario: Scenario) -> None:
    """A law that is told of its clocks is told of those that tick."""
    # a law under guard keeps its own constants inside the guard's
    par, rates = getattr(scenario.controller.par, "inner", scenario.controller.par), scenario.rates
    cutoff = getattr(par, "cutoff", None)
    if cutoff is not None and concrete(cutoff) and not 2.0 * cutoff < rates.control:
        raise ScenarioError(
            f"controller.cutoff = {cutoff!r}: must be below {0.5 * rates.control:g} Hz, half of rates.control"
        )
    for name, rate in (("control_period", rates.control), ("reference_period", rates.reference)):
        believed = getattr(par, name, None)
        if believed is not None and concrete(believed) and abs(believed * rate - 1.0) > 1e-6:
            clock = name.removesuffix("_period")
            raise ScenarioError(f"controller.{name} = {believed!r}: must be {1.0 / rate:g} s, as rates.{clock} has it")


def _check_longest(scenario: Scenario) -> None:
    """A delay that varies stays below its longest."""
    delays = scenario.delays
    if delays.longest_command is None:
        return
    longest = number(delays.longest_command, "delays.longest_command", low=0.0, strict=True)
    if longest * scenario.rates.control > LONGEST_QUEUE:
        raise ScenarioError(
            f"delays.longest_command = {longest!r}: must be at most {LONGEST_QUEUE} control periods, "
            f"{LONGEST_QUEUE / scenario.rates.control:g} s"
        )
    if concrete(delays.command) and delays.command > delays.longest_command:
        raise ScenarioError(
            f"delays.command = {delays.command!r}: must not exceed delays.longest_command = {delays.longest_command!r}"
        )


def _check_vehicles(scenario: Scenario) -> None:
    """Truth and belief have the same joints and rotors, the reference fits them, and the truth can be simulated.

    Its rotors must reach every torque and thrust; whether they are strong enough to carry it, the flight shows.
    """
    truth, belief = scenario.world.vehicle, scenario.controller.par.model.vehicle
    try:
        require_plant(truth)
        make_mixer(truth)
        friction_rate(truth)
    except ValueError as error:
        raise ScenarioError(f"plant.vehicle = {truth.name!r}: {error}") from None
    for what, ours, theirs in (("joints", truth.n, belief.n), ("rotors", len(truth.rotors), len(belief.rotors))):
        if ours != theirs:
            raise ScenarioError(
                f"model.vehicle = {belief.name!r}: has {theirs} {what}, must have {ours} as the plant {truth.name!r}"
            )
    for i, fault in enumerate(scenario.faults):
        try:
            fault.check(truth)
        except ValueError as error:
            raise ScenarioError(f"environment.faults[{i}].{error}") from None
    found = len(scenario.trajectory.joints)
    if found != truth.n:
        raise ScenarioError(f"reference.joints = {found} signals: must be {truth.n}, one for each joint")


def _check_initial(state: State, joints: int, rotors: int) -> None:
    counts = (("joints", joints), ("joint_rates", joints), ("rotor_speeds", rotors))
    for name, count in counts:
        if len(getattr(state, name)) != count:
            raise ScenarioError(f"initial.{name}: {len(getattr(state, name))} values, must be {count}")
    check_quaternion(tuple(state.quaternion))


def check_quaternion(values: tuple[Any, ...]) -> None:
    """Four numbers of unit length."""
    good = len(values) == 4
    if good and concrete(*values):
        good = abs(math.sqrt(sum(c * c for c in values)) - 1.0) <= TOLERANCE
    if not good:
        raise ScenarioError(
            f"initial.quaternion_wxyz = {shown(list(values))}: must be four numbers of length 1 within {TOLERANCE:g}"
        )


def _require_whole(field: str, seconds: float, rate: int, unit: str) -> None:
    count = seconds * rate
    if abs(count - round(count)) > 1e-6 or (seconds > 0.0 and round(count) < 1):
        raise ScenarioError(f"{field} = {seconds!r}: must be a whole number of {unit} of {1.0 / rate:g} s")


def trimmed_state(world: World, position: Vec3, yaw: float, joints: tuple[Any, ...]) -> State:
    """The truth at rest and level, rotors at the speeds that hold its weight and its arm's torque.

    No rotor turns faster than it can: a truth that is too heavy to hover starts at full speed and sinks.
    """
    vehicle = world.vehicle
    trim = hover_trim(vehicle, joints, world.gravity)
    still = (0.0,) * vehicle.n
    return State(
        position=Vec3(*(data(c) for c in position)),
        quaternion=Quaternion(cos(0.5 * yaw), 0.0, 0.0, sin(0.5 * yaw)),
        velocity=Vec3(0.0, 0.0, 0.0),
        rate=Vec3(0.0, 0.0, 0.0),
        joints=tuple(data(q) for q in joints),
        joint_rates=still,
        rotor_speeds=tuple(data(minimum(w, r.max_speed)) for w, r in zip(trim.speeds, vehicle.rotors, strict=True)),
    )
