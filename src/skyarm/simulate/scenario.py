"""One experiment: truth, belief, controller, reference, environment, clock."""

from __future__ import annotations

import numbers
import re
from dataclasses import dataclass
from typing import Any

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
from skyarm.reference import Trajectory
from skyarm.scalars import Scalar, cos, minimum, sin
from skyarm.simulate.scenario_checks import check_clocks, check_delays, check_initial, check_vehicles, require_whole

PLANTS = ("rigid_body", "mujoco")

HIGHEST_RATE = 1_000_000
"""Hz: a clock beyond this is a slip of units."""

LONGEST_FLIGHT = 10_000_000
"""Control periods of one episode, 14 h at 200 Hz: its log takes about 10 GB."""

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
    require_whole("duration", scenario.duration, scenario.rates.control, "control periods")
    for field, value, allowed in (
        ("plant.kind", scenario.plant, PLANTS),
        ("plant.integrator", scenario.integrator, INTEGRATORS),
    ):
        if value not in allowed:
            raise ScenarioError(f"{field} = {shown(value)}: must be one of {', '.join(allowed)}")
    check_delays(scenario)
    check_vehicles(scenario)
    check_clocks(scenario)
    if scenario.initial is not None:
        check_initial(scenario.initial, scenario.world.vehicle.n, len(scenario.world.vehicle.rotors))


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
