"""What is seen of a session at one instant: poses, errors, efforts and forces, as plain numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from skyarm.algebra import ZERO3, Vec3
from skyarm.contact import Contact
from skyarm.contact.carried_contact import NOBODY
from skyarm.control.blocks.disturbance_observer import Observed
from skyarm.drawing.pose_program import Array, Placed, PoseProgram
from skyarm.dynamics.point_motion import PointMotion
from skyarm.environment import TimedPayload
from skyarm.plant.surroundings import Surroundings, felt
from skyarm.records.leaves import is_record, parts
from skyarm.reference import Reference
from skyarm.reference.tip_motion import TipPush
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.loop_state import LoopState
from skyarm.vehicle.vehicle_records import Vehicle


@dataclass(frozen=True, slots=True)
class Sight:
    """What the plots show of one instant.

    Attributes:
        tick: control periods flown. time: s.
        tip: its position, world axes, m. error: its distance from where it should be, m; across the
            believed normal while it shall press.
        tilt: of the base's z axis against the vertical, rad.
        efforts: share of each joint's limit that its setpoint takes; N m or N of a joint without a limit.
        rotors: share of each rotor's highest speed.
        air: velocity of the air at the base, world axes, m/s. pushed: force on the base of all that surrounds it, N.
        observed: force on the base that the law's observer has found, N, world axes; None without an observer.
        touching: what the surfaces of the world do to the points of the vehicle; empty without a world.
    """

    tick: int
    time: float
    tip: Array
    error: float
    tilt: float
    efforts: tuple[float, ...]
    rotors: tuple[float, ...]
    air: Array
    pushed: Array
    observed: Vec3 | None
    touching: tuple[Touching, ...] = ()

    @property
    def contact(self) -> float:
        """Sum of all normal forces on the vehicle, N."""
        return sum(each.normal for each in self.touching)


@dataclass(frozen=True, slots=True)
class Touching:
    """One surface and one point now.

    Attributes:
        surface: its name. normal: N.
        spot: (3,) where it acts, world axes, m. force: (3,) N on the vehicle, with friction.
    """

    surface: str
    normal: float
    spot: Array
    force: Array


class Flown(Protocol):
    """Whatever flies a scenario period by period: a session, or an episode that somebody else steps."""

    @property
    def scenario(self) -> Scenario: ...  # noqa: D102
    @property
    def now(self) -> LoopState: ...  # noqa: D102
    @property
    def time(self) -> float: ...  # noqa: D102
    @property
    def tick(self) -> int: ...  # noqa: D102


def sight(session: Flown, program: PoseProgram) -> Sight:
    """What the plots show of a session now."""
    scenario, now, time = session.scenario, session.now, session.time
    vehicle, state = scenario.world.vehicle, now.state
    placed = program(tuple(state.position), tuple(state.quaternion), state.joints)
    goal = goal_of(program, scenario.trajectory.at(time))
    around = Surroundings(components=scenario.components, memories=now.components, time=time)
    outside = felt(around, vehicle, state)
    upward = float(placed.rotations[0, 2, 2])
    return Sight(
        tick=session.tick,
        time=time,
        tip=placed.tip,
        error=_error(getattr(scenario.trajectory, "push", None), placed.tip, goal.tip, time),
        tilt=math.acos(min(1.0, max(-1.0, upward))) if math.isfinite(upward) else math.pi,
        efforts=_efforts(vehicle, now.queue[-1].efforts),
        rotors=tuple(float(w) / float(r.max_speed) for w, r in zip(state.rotor_speeds, vehicle.rotors, strict=True)),
        air=np.array([float(c) for c in outside.air_velocity_W]),
        pushed=np.array([float(c) for c in outside.force_W]),
        observed=observed_force(now.memory),
        touching=touching(scenario.components, now.components, PointMotion(vehicle, state))
        if scenario.contacts
        else (),
    )


@dataclass(frozen=True, slots=True)
class Load:
    """A payload that is held now.

    Attributes:
        mass: kg. frame: that holds it; empty for the tip. com: m, axes of the frame.
        hangs: (3,) m, world axes, where it is on its cord; None of one that the frame holds itself.
    """

    mass: float
    frame: str = ""
    com: Vec3 = ZERO3
    hangs: Array | None = None


def held_loads(components: Sequence[Any], memories: Sequence[Any]) -> tuple[Load, ...]:
    """Payloads that are held.

    Args:
        components: of the scenario.
        memories: one for each.
    """
    found = []
    for each, memory in zip(components, memories, strict=True):
        if isinstance(each, TimedPayload) and float(memory.held) > 0.5:
            hangs = None if each.rigid else np.array([float(c) for c in memory.position])
            found.append(Load(float(each.mass), each.frame, each.com, hangs))
    return tuple(found)


def touching(components: Sequence[Any], memories: Sequence[Any], motion: PointMotion) -> tuple[Touching, ...]:
    """What every surface does to every point now.

    Args:
        components: of the scenario, with their memories.
        memories: one for each.
        motion: of the vehicle.
    """
    found = []
    for contact, memory in zip(components, memories, strict=True):
        if not isinstance(contact, Contact):
            continue
        pairs = zip(contact.pairs, contact.touches(memory, motion), strict=True)
        own = [(surface.name, point, touch) for (surface, point), touch in pairs]
        meetings = [each for each in contact.meetings(memory, motion) if each.by == NOBODY]
        own += [(each.surface, contact.points[each.index], each.touch) for each in meetings]
        for surface, point, touch in own:
            at, body = point.place(motion.vehicle)
            spot = np.array([float(c) for c in motion.position(at, body) + touch.spot])
            force = np.array([float(c) for c in touch.force])
            found.append(Touching(surface, float(touch.normal), spot, force))
    return tuple(found)


def _error(push: TipPush | None, tip: Array, goal: Array, time: float) -> float:
    """Distance of the tip from where it should be, m: what of it counts while it shall press."""
    away = tip - goal
    if push is not None:
        found = push.across(Vec3(*map(float, away)), time, Vec3(*map(float, tip)))
        away = np.array([float(c) for c in found])
    return float(np.linalg.norm(away))


def goal_of(program: PoseProgram, reference: Reference) -> Placed:
    """Where the bodies should be: level, at the desired position, heading and joints."""
    half = 0.5 * float(reference.yaw)
    return program(tuple(reference.position), (math.cos(half), 0.0, 0.0, math.sin(half)), reference.joints)


def _efforts(vehicle: Vehicle, setpoints: Sequence[Any]) -> tuple[float, ...]:
    """Shares of the joints' limits that setpoints take; a joint without a limit shows its N m or N."""
    limits = [float(link.joint.effort_limit) for link in vehicle.links]
    return tuple(float(u) / m if m and math.isfinite(m) else float(u) for u, m in zip(setpoints, limits, strict=True))


def observed_force(memory: Any) -> Vec3 | None:
    """Force on the base that a law's observer has found, world axes, N; None for a law without one."""
    if isinstance(memory, Observed):
        return memory.force
    if is_record(memory) or isinstance(memory, tuple):
        for part in parts(memory).values():
            found = observed_force(part)
            if found is not None:
                return found
    return None
