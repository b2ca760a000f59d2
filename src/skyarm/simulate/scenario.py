"""One experiment: truth, belief, controller, reference, environment, clock."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from skyarm.actuation.hover import hover_trim
from skyarm.algebra import Quaternion, Vec3
from skyarm.control.registry import Controller
from skyarm.dynamics import State
from skyarm.environment import NO_WIND, Wind
from skyarm.plant.rigid_body import World
from skyarm.plant.sensors import SensorNoise
from skyarm.reference import Trajectory

PLANTS = ("rigid_body", "mujoco")


class ScenarioError(ValueError):
    """A scenario's description is wrong."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Rates:
    """Clock rates in Hz; physics / control and control / reference must be whole numbers."""

    physics: int = 1000
    control: int = 200
    reference: int = 50

    def __post_init__(self) -> None:
        for name in ("physics", "control", "reference"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < 1:
                raise ScenarioError(f"rates.{name} = {value!r}: must be a whole number of Hz, at least 1")
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
    """

    measurement: float = 0.0
    command: float = 0.0


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
        wind: environment.
        sensors, delays: measurement.
        initial: state at t = 0; None is hover trim of the truth at the reference.
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
    sensors: SensorNoise = SensorNoise()
    delays: Delays = Delays()
    initial: State | None = None
    seed: int = 0
    episode: int = 0
    ground: bool = True

    def __post_init__(self) -> None:
        _check(self)

    @property
    def steps(self) -> int:
        """Number of control periods."""
        return round(self.duration * self.rates.control)


def _check(scenario: Scenario) -> None:
    if not 0.0 < scenario.duration < float("inf"):
        raise ScenarioError(f"duration = {scenario.duration!r}: must be a finite number greater than 0")
    _whole("duration", scenario.duration, scenario.rates.control, "control periods")
    if scenario.plant not in PLANTS:
        raise ScenarioError(f"plant.kind = {scenario.plant!r}: must be one of {list(PLANTS)}")
    _whole("delays.measurement", scenario.delays.measurement, scenario.rates.control, "control periods")
    _whole("delays.command", scenario.delays.command, scenario.rates.physics, "physics steps")
    truth, belief = scenario.world.vehicle, scenario.controller.par.model.vehicle
    for what, ours, theirs in (("joints", truth.n, belief.n), ("rotors", len(truth.rotors), len(belief.rotors))):
        if ours != theirs:
            raise ScenarioError(
                f"model.vehicle = '{belief.name}': has {theirs} {what}, must have {ours} as plant.vehicle '{truth.name}'"
            )


def _whole(field: str, seconds: float, rate: int, unit: str) -> None:
    count = seconds * rate
    if not seconds >= 0.0 or abs(count - round(count)) > 1e-6:
        raise ScenarioError(f"{field} = {seconds!r}: must be a whole number of {unit} of {1.0 / rate:g} s")


def trimmed_state(world: World, position: Vec3, yaw: float, joints: tuple[Any, ...]) -> State:
    """The truth at rest and level with rotors at the speeds that hold its weight and its arm's torque."""
    vehicle = world.vehicle
    trim = hover_trim(vehicle, joints, world.gravity)
    still = (0.0,) * vehicle.n
    return State(
        position=Vec3(*(float(c) for c in position)),
        quaternion=Quaternion(math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)),
        velocity=Vec3(0.0, 0.0, 0.0),
        rate=Vec3(0.0, 0.0, 0.0),
        joints=tuple(float(q) for q in joints),
        joint_rates=still,
        rotor_speeds=tuple(float(w) for w in trim.speeds),
    )
