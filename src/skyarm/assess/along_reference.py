"""Along a scenario's reference: what rotors and joints would have to give, against their limits."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np

from skyarm.actuation import make_mixer
from skyarm.actuation.motion_demand import Demand, demand_of_motion, motion_of
from skyarm.assess.arm_poses import Array
from skyarm.assess.finding import FAULT, NOTE, OK, WARNING, Finding
from skyarm.assess.joint_torques import effort_limits
from skyarm.assess.level_hover import Allocation
from skyarm.assess.servo_speeds import OFTEN, servo_speeds, servos
from skyarm.environment import ForceWind
from skyarm.records.leaves import field_names
from skyarm.reference.path_time import governed
from skyarm.scenario.scenario_record import Scenario

INSTANTS, FEWEST = 2000, 9
"""Instants of a flight, and the least of a stretch between two jumps of the reference."""

SHORTEST = 1e-3
"""s: of a stretch."""

JUMP = 1e-9
"""s before a switch of the reference at which it is looked at for a jump."""


LEFT = 1e-3
"""Share of its limit that a servo is taken to have left where its speed leaves it nothing."""


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
    names = field_names(Demand) or ()
    return Demand(*(np.concatenate([getattr(piece, name) for piece in pieces], axis=-1) for name in names))


def _stretches(scenario: Scenario) -> list[Array]:
    """Instants between the reference's jumps, (K,) each, right-hand ends left out."""
    end = scenario.duration
    cuts = [0.0, *(t for t in _switches(scenario) if 0.0 < t < end), end]
    found = []
    for a, b in pairwise(cuts):
        if b - a < SHORTEST and end > SHORTEST:
            continue  # no rates can be had of it
        count = max(FEWEST, round(INSTANTS * (b - a) / end))
        found.append(a + (b - a) * (np.arange(count) + 0.5) / count)
    return found


def _switches(scenario: Scenario) -> list[float]:
    """Times of the flight at which what the law is told may jump, in order, s."""
    path, times = scenario.path_time, scenario.trajectory.switch_times()
    return list(times) if path is None else [path.when(t) for t in times if t > 0.0]


def _stretch(scenario: Scenario, time: Array) -> Demand:
    vehicle, gravity = scenario.world.vehicle, float(scenario.world.gravity)
    path = scenario.path_time
    reference = scenario.trajectory.at(time) if path is None else governed(scenario.trajectory, path, time)
    wind = np.zeros((3, 1))
    if isinstance(scenario.wind, ForceWind):
        wind = np.array([[float(c)] for c in scenario.wind.force_W])
    return demand_of_motion(vehicle, gravity, motion_of(reference, time), wind)


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
