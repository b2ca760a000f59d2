"""Components of a user's own, as examples: what no file of the library knows. Each is written as a plugin would be."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from skyarm.algebra import ZERO3, Vec3
from skyarm.algebra.scalars import exp, sqrt
from skyarm.algebra.scalars.philox import normals
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.actuators.drive import Drive
from skyarm.records.registry import names, plugins
from skyarm.records.registry.registrations import _FOUND, _SOURCE
from skyarm.scenario.endings import Ending
from skyarm.sensing.estimate.estimator import FULL_STATE, Estimator
from skyarm.sensing.sensor import Sensor
from skyarm.world import Air, Force, Wrench


@dataclass(frozen=True, kw_only=True)
class Turbulence(Air):
    """Turbulence of first order: its memory is the three components in standard deviations."""

    sigma: float = 0.5
    time: float = 0.5
    uniforms = 4

    def __post_init__(self) -> None:
        if isinstance(self.time, float) and not self.time > 0.0:
            raise ValueError(f"time = {self.time!r}: must be above 0 s")

    def start(self, period: float, draws: Sequence[Any]) -> Any:
        return tuple(normals(draws)[:3])

    def advance(self, memory: Any, t: Any, dt: float, state: Any, draws: Sequence[Any]) -> Any:
        a = exp(-dt / self.time)
        return tuple(a * m + sqrt(1.0 - a * a) * x for m, x in zip(memory, normals(draws)[:3], strict=True))

    def velocity(self, memory: Any, t: Any, position_W: Vec3) -> Vec3:
        return Vec3(*memory) * self.sigma


@dataclass(frozen=True, kw_only=True)
class Shear(Air):
    """Wind along x that grows with height: it depends on the place."""

    rate: float = 0.3

    def velocity(self, memory: Any, t: Any, position_W: Vec3) -> Vec3:
        return Vec3(self.rate * position_W.z, 0, 0)


@dataclass(frozen=True, kw_only=True)
class RandomPush(Force):
    """A vertical force on the base, drawn anew each period."""

    sigma: float = 0.0
    uniforms = 2

    def start(self, period: float, draws: Sequence[Any]) -> Any:
        return (0.0,)

    def advance(self, memory: Any, t: Any, dt: float, state: Any, draws: Sequence[Any]) -> Any:
        return (normals(draws)[0],)

    def wrenches(self, memory: Any, t: Any, motion: Any, rotor_speeds: Sequence[Any]) -> Sequence[Wrench]:
        return (Wrench(force_W=Vec3(0.0, 0.0, self.sigma * memory[0])),)


@dataclass(frozen=True, kw_only=True)
class Tether(Force):
    """A spring and damper from a point of a body to a place of the world: it depends on the state."""

    anchor: Vec3 = ZERO3
    stiffness: float = 2.0
    damping: float = 0.1
    point: Vec3 = ZERO3
    body: int = -1

    def wrenches(self, memory: Any, t: Any, motion: Any, rotor_speeds: Sequence[Any]) -> Sequence[Wrench]:
        apart = self.anchor - motion.position(self.point, self.body)
        force = apart * self.stiffness - motion.velocity(self.point, self.body) * self.damping
        return (Wrench(force_W=force, point=self.point, body=self.body),)


@dataclass(frozen=True, kw_only=True)
class SteadyWrench(Force):
    """The same force and torque on one body for ever."""

    force: Vec3 = ZERO3
    torque: Vec3 = ZERO3
    point: Vec3 = ZERO3
    body: int = -1

    def wrenches(self, memory: Any, t: Any, motion: Any, rotor_speeds: Sequence[Any]) -> Sequence[Wrench]:
        return (Wrench(force_W=self.force, torque_W=self.torque, point=self.point, body=self.body),)


@dataclass(frozen=True, kw_only=True)
class Fix(Sensor):
    """Position with white noise; its memory counts the readings, and a reading says which one it is and when it was."""

    rate: float = 0.0
    delay: float = 0.0
    sigma: float = 0.0

    @property
    def frequency(self) -> float:
        return self.rate

    @property
    def latency(self) -> float:
        return self.delay

    def uniforms(self, vehicle: Any) -> int:
        return 4

    def start(self, vehicle: Any) -> Any:
        return (0.0,)

    def measure(self, memory: Any, t: Any, state: Any, specific_force: Vec3, draws: Sequence[Any], dt: float) -> Any:
        noise = normals(draws)[:3]
        where_to = tuple(p + self.sigma * x for p, x in zip(state.position, noise, strict=True))
        return (memory[0] + 1.0,), (1.0 * t, memory[0], *where_to, 1.0 * dt)


@dataclass(frozen=True, kw_only=True)
class Blend(Estimator):
    """The full state, its position drawn towards a fix; its memory is the offset."""

    gain: float = 0.02
    sensor: str = "fix"

    def start(self, vehicle: Any) -> Any:
        return (0.0, 0.0, 0.0)

    def step(self, memory: Any, readings: Mapping[str, Any], command: Command, dt: float) -> Any:
        full, fix = readings[FULL_STATE], readings[self.sensor][2:5]
        off = tuple(m + self.gain * (p - q - m) for m, p, q in zip(memory, fix, full.position, strict=True))
        return off, dataclasses.replace(full, position=full.position + Vec3(*off))


@dataclass(frozen=True, kw_only=True)
class Lag(Drive):
    """The torque follows its setpoint with a lag of first order."""

    lag: float = 0.02

    def start(self, position: Any) -> Any:
        return (0.0,)

    def advance(self, memory: Any, setpoint: Any, position: Any, rate: Any, dt: float) -> Any:
        return (memory[0] + (setpoint - memory[0]) * (1.0 - exp(-dt / self.lag)),)

    def effort(self, memory: Any, setpoint: Any, position: Any, rate: Any) -> Any:
        return memory[0]

    def standing(self, effort: Any, position: Any) -> Any:
        return effort


@dataclass(frozen=True, kw_only=True)
class Servo(Drive):
    """A position servo: its setpoint is an angle."""

    stiffness: float = 0.3
    damping: float = 0.003

    def effort(self, memory: Any, setpoint: Any, position: Any, rate: Any) -> Any:
        return self.stiffness * (setpoint - position) - self.damping * rate

    def standing(self, effort: Any, position: Any) -> Any:
        return position + effort / self.stiffness


@dataclass(frozen=True, kw_only=True)
class Ceiling(Ending):
    """Too high."""

    height: float = 3.0
    status = "ceiling"

    def fine(self, scenario: Any, state: Any, goal: Vec3, slack: Any) -> Any:
        return state.position.z <= self.height - slack

    def cause(self, scenario: Any, state: Any, goal: Vec3) -> str:
        return f"z = {float(state.position.z):.3f} m passed {float(self.height):g}"


def telling(heard: Callable[[Any], Sequence[Any]]) -> Any:
    """A law whose rotor commands tell four numbers of what it hears, on top of 450 rad/s; the arm is left alone."""

    def law(memory: Any, measurement: Any, reference: Any, dt: Any, *, par: Any) -> tuple[Any, Command]:
        del reference, dt
        speeds = tuple(450.0 + each for each in heard(measurement))
        return memory, Command(rotor_speeds=speeds, efforts=(0.0,) * par.model.vehicle.n)

    return law


def with_law(scenario: Any, law: Any, **fields: Any) -> Any:
    """The scenario with another law, which is traced."""
    return dataclasses.replace(scenario, controller=dataclasses.replace(scenario.controller, law=law, **fields))


def same_logs(a: Any, b: Any) -> bool:
    """Two logs to the bit."""
    ours, theirs = a.arrays(), b.arrays()
    return ours.keys() == theirs.keys() and all(ours[name].tobytes() == theirs[name].tobytes() for name in ours)


def equal_logs(a: Any, b: Any) -> bool:
    """Two logs value by value: to the bit, but that a zero may have another sign."""
    ours, theirs = a.arrays(), b.arrays()
    return ours.keys() == theirs.keys() and all(np.array_equal(ours[name], theirs[name]) for name in ours)


@contextmanager
def registry_kept() -> Iterator[None]:
    """What is registered or loaded inside is gone afterwards."""
    names("law")  # everything that ships, and what is installed, is there from now on
    found = {kind: dict(rows) for kind, rows in _FOUND.items()}
    loaded, modules, sources = dict(plugins._LOADED), dict(plugins._MODULES), copy.copy(_SOURCE)
    try:
        yield
    finally:
        _FOUND.update(found)
        for now, before in ((plugins._LOADED, loaded), (plugins._MODULES, modules)):
            now.clear()
            now.update(before)  # type: ignore[arg-type]
        _SOURCE[:] = sources
