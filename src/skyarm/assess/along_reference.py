"""Along a scenario's reference: what rotors and joints would have to give, against their limits."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from skyarm import dynamics
from skyarm.actuation import make_mixer
from skyarm.algebra import Mat3, Vec3
from skyarm.assess.arm_poses import Array
from skyarm.assess.finding import FAULT, NOTE, OK, WARNING, Finding
from skyarm.assess.joint_torques import effort_limits
from skyarm.assess.level_hover import WRENCH, Allocation
from skyarm.assess.servo_speeds import OFTEN, servo_speeds, servos
from skyarm.dynamics.state import proper_acceleration
from skyarm.environment import ForceWind
from skyarm.scenario.scenario_record import Scenario

INSTANTS, FEWEST = 2000, 9
"""Instants of a flight, and the least of a stretch between two jumps of the reference."""

SHORTEST = 1e-3
"""s: of a stretch."""

JUMP = 1e-9
"""s before a switch of the reference at which it is looked at for a jump."""


LEFT = 1e-3
"""Share of its limit that a servo is taken to have left where its speed leaves it nothing."""


@dataclass(frozen=True, slots=True)
class Demand:
    """What a reference asks for.

    Attributes:
        time: (K,) s. squared: (rotors, K) (rad/s)^2, of the exact mixer without limits. efforts: (n, K) N m or N.
        joints, rates: (n, K) rad or m, and per s.
    """

    time: Array
    squared: Array
    efforts: Array
    joints: Array
    rates: Array


def along_reference(scenario: Scenario) -> list[Finding]:
    """Reference against joint limits, and instants at which rotors or joints would saturate.

    The plant follows its reference exactly, with the constant force of the wind; gusts, turbulence and drag are left
    out, and so is what the control adds.
    """
    demand = demand_of(scenario)
    vehicle = scenario.world.vehicle
    found = [*_jumps(scenario), *_joint_limits(scenario, demand)]
    top = Allocation.of(make_mixer(vehicle)).highest[:, None]
    parts = [(f"rotors[{rotor.name}]", "max_speed") for rotor in vehicle.rotors]
    found.append(_saturation("rotors along the reference", demand, demand.squared / top, parts, demand.squared < 0.0))
    if vehicle.n:
        parts = [(f"joints[{link.joint.name}]", "effort_limit") for link in vehicle.links]
        found.append(_saturation("joints along the reference", demand, _shares(scenario, demand), parts))
        found += servo_speeds(scenario, demand.time, demand.rates)
    return found


def _shares(scenario: Scenario, demand: Demand) -> Array:
    """Efforts (n, K) over what joints and servos give at the reference's own rates."""
    limits = np.repeat(effort_limits(scenario.world.vehicle)[:, None], len(demand.time), axis=1)
    for i, servo in servos(scenario):
        low, high = (
            np.broadcast_to(np.asarray(b, dtype=float), limits[i].shape) for b in servo.bounds(demand.rates[i])
        )
        most = np.where(demand.efforts[i] < 0.0, -low, high)
        limits[i] = np.minimum(limits[i], np.maximum(most, LEFT * limits[i]))
    return np.asarray(np.abs(demand.efforts) / limits)


def demand_of(scenario: Scenario) -> Demand:
    """Rotor speeds and joint efforts that follow a scenario's reference exactly."""
    pieces = [_stretch(scenario, time) for time in _stretches(scenario)]
    return Demand(*(np.concatenate(each, axis=-1) for each in zip(*pieces, strict=True)))


def _stretches(scenario: Scenario) -> list[Array]:
    """Instants between the reference's jumps, (K,) each, right-hand ends left out."""
    end = scenario.duration
    cuts = [0.0, *(t for t in scenario.trajectory.switch_times() if 0.0 < t < end), end]
    found = []
    for a, b in pairwise(cuts):
        if b - a < SHORTEST and end > SHORTEST:
            continue  # no rates can be had of it
        count = max(FEWEST, round(INSTANTS * (b - a) / end))
        found.append(a + (b - a) * (np.arange(count) + 0.5) / count)
    return found


def _stretch(scenario: Scenario, time: Array) -> tuple[Array, ...]:
    vehicle, gravity = scenario.world.vehicle, float(scenario.world.gravity)
    reference, count = scenario.trajectory.at(time), len(time)

    def lanes(values: object) -> Array:
        rows = [np.broadcast_to(np.asarray(v, dtype=float), count) for v in values]  # type: ignore[attr-defined]
        return np.stack(rows) if rows else np.zeros((0, count))

    a, yaw = lanes(reference.acceleration), lanes([reference.yaw])[0]
    q, qd, qdd = (lanes(v) for v in (reference.joints, reference.joint_rates, reference.joint_accelerations))
    wind = np.zeros((3, 1))
    if isinstance(scenario.wind, ForceWind):
        wind = np.array([[float(c)] for c in scenario.wind.force_W])
    needed = float(vehicle.mass) * (a + np.array([[0.0], [0.0], [gravity]])) - wind
    still = Vec3(0.0, 0.0, 0.0)
    for _ in range(2):  # the reaction of the arm's own motion turns the force that the base must give
        R = _attitude(needed, yaw)
        base = proper_acceleration(_matrix(R), Vec3(*a), still, gravity)
        force, _ = dynamics.inverse_dynamics(vehicle, tuple(q), still, tuple(qd), base, tuple(qdd))
        needed = np.einsum("ijk,jk->ik", R, lanes(force.force)) - wind
    R = _attitude(needed, yaw)
    rate, turning = _rates(R, time)
    base = proper_acceleration(_matrix(R), Vec3(*a), Vec3(*turning), gravity)
    force, efforts = dynamics.inverse_dynamics(vehicle, tuple(q), Vec3(*rate), tuple(qd), base, tuple(qdd))
    needed = np.einsum("ijk,jk->ik", R, lanes(force.force)) - wind
    wrench = np.vstack([lanes(force.torque), np.einsum("ik,ik->k", R[:, 2], needed)[None]])
    squared = Allocation.of(make_mixer(vehicle)).squared(wrench[:WRENCH])
    friction = [
        float(k.joint.damping) * rates + float(k.joint.coulomb) * np.tanh(rates / float(k.joint.coulomb_rate))
        for k, rates in zip(vehicle.links, qd, strict=True)
    ]
    return time, squared, lanes(efforts) + (np.array(friction) if friction else 0.0), q, qd


def _attitude(force: Array, yaw: Array) -> Array:
    """R_WB (3, 3, K) whose z is along the force and whose x heads along the yaw (Mellinger, Kumar 2011)."""
    z = force / np.maximum(np.linalg.norm(force, axis=0), 1e-12)
    heading = np.stack([np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)])
    y = np.cross(z, heading, axis=0)
    y /= np.maximum(np.linalg.norm(y, axis=0), 1e-12)
    return np.stack([np.cross(y, z, axis=0), y, z], axis=1)


def _rates(R: Array, time: Array) -> tuple[Array, Array]:
    """Angular velocity and acceleration (3, K), base axes, by central differences."""
    dR = np.gradient(R, time, axis=2, edge_order=2)
    W = np.einsum("jik,jlk->ilk", R, dR)
    rate = 0.5 * np.stack([W[2, 1] - W[1, 2], W[0, 2] - W[2, 0], W[1, 0] - W[0, 1]])
    return rate, np.gradient(rate, time, axis=1, edge_order=2)


def _matrix(R: Array) -> Mat3:
    return Mat3(*(Vec3(*(R[i, j] for j in range(3))) for i in range(3)))


def _jumps(scenario: Scenario) -> list[Finding]:
    """Instants at which the reference itself jumps, which no vehicle follows."""
    found = []
    for t in scenario.trajectory.switch_times():
        if not 0.0 < t < scenario.duration:
            continue
        before, after = (scenario.trajectory.at(s) for s in (t - JUMP, t))
        moved = math.dist([float(c) for c in before.position], [float(c) for c in after.position])
        turned = max((abs(float(a) - float(b)) for a, b in zip(before.joints, after.joints, strict=True)), default=0.0)
        if moved > 1e-6 or turned > 1e-6:
            text = f"jumps at {t:g} s: base by {moved:.3g} m, a joint by {turned:.3g} rad or m"
            found.append(Finding(question="reference", level=NOTE, text=text, field="reference", value=t, unit="s"))
    return found


def _joint_limits(scenario: Scenario, demand: Demand) -> list[Finding]:
    found = []
    for i, link in enumerate(scenario.world.vehicle.links):
        joint, q = link.joint, demand.joints[i]
        beyond = (q < float(joint.lower)) | (q > float(joint.upper))
        if np.any(beyond):
            t = float(demand.time[np.argmax(beyond)])
            worst = float(q[np.argmax(np.maximum(float(joint.lower) - q, q - float(joint.upper)))])
            limits = f"{float(joint.lower):g} ... {float(joint.upper):g}"
            found.append(
                Finding(
                    question="reference within joint limits",
                    level=FAULT,
                    text=f"joints[{joint.name}] is to reach {worst:.3g}, beyond {limits}, first at {t:.3g} s",
                    field=f"reference.joints[{i}]",
                    value=worst,
                    limit=float(joint.upper) if worst > float(joint.upper) else float(joint.lower),
                    remedy="a smaller motion, or joint limits as they are (rad, not degrees?)",
                )
            )
    return found


def _saturation(
    question: str, demand: Demand, share: Array, parts: list[tuple[str, str]], reversed_: Any = None
) -> Finding:
    """One finding for all rotors or all joints: when the first saturates, which, and for how much of the flight."""
    outside = share > 1.0 if reversed_ is None else (share > 1.0) | reversed_
    at_any = np.any(outside, axis=0)
    often = float(np.mean(at_any))
    i, k = np.unravel_index(int(np.argmax(share)), share.shape)
    name, field = parts[int(i)]
    text = f"at most {share[i, k]:.3g} of the limit ({name}, at {demand.time[k]:.3g} s)"
    if not often:
        return Finding(
            question=question, level=OK, text=text, field=f"{name}.{field}", value=float(share[i, k]), limit=1.0
        )
    first = int(np.argmax(at_any))
    who = parts[int(np.argmax(outside[:, first]))][0]
    text = f"saturates first at {demand.time[first]:.3g} s ({who}), for {often:.1%} of the flight; {text}"
    return Finding(
        question=question,
        level=FAULT if often > OFTEN else WARNING,
        text=text,
        field=f"{who}.{field}",
        value=float(share[i, k]),
        limit=1.0,
        remedy="a slower or smaller reference, less wind, or stronger rotors and drives",
    )
