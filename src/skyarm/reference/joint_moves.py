"""Joints that a task moves beside the tip's motion: the fingers of a gripper, phase by phase."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

from skyarm.files import did_you_mean, shown
from skyarm.reference.compose import Sum
from skyarm.reference.minimum_snap import minimum_snap
from skyarm.reference.setting import JointMove
from skyarm.reference.signals import Constant, Signal
from skyarm.reference.trajectory import Trajectory
from skyarm.vehicle.vehicle_records import Vehicle

PEAK_RATE = 2.1875
"""Largest speed of a motion of least snap from rest to rest by 1 in 1 s: 35/16, half-way through."""


def with_joint_moves(
    trajectory: Trajectory, moves: Sequence[JointMove], vehicle: Vehicle | None, fastest: float = math.inf
) -> Trajectory:
    """The trajectory whose joints beside the tip's arm make moves, in the order of time.

    Args:
        trajectory: whose own signals of these joints are constant.
        moves: of a task's phases.
        vehicle: whose joints; needed where there are moves.
        fastest: rad/s or m/s, that a move may reach.

    Raises:
        ValueError: one line: a joint that is not there, carries the tip or moves already, a value beyond its limits,
            a move that is too fast.
    """
    if not moves:
        return trajectory
    if vehicle is None:
        raise ValueError(f"{moves[0].where} = {moves[0].value:g}: needs a vehicle; none is known")
    signals = list(trajectory.joints)
    added: dict[int, list[Any]] = {}
    reached: dict[int, float] = {}
    for move in sorted(moves, key=lambda each: each.start):
        i = _index(move, trajectory, vehicle)
        at = reached.get(i, float(signals[i].derivatives(0.0)[0]))
        _require_within(move, at, vehicle, i, fastest)
        if move.value != at:
            added.setdefault(i, []).append(minimum_snap([move.start, move.end], [0.0, move.value - at]))
        reached[i] = move.value
    for i, parts in added.items():
        signals[i] = Sum((signals[i], *parts))
    return dataclasses.replace(trajectory, joints=tuple(signals))


def _index(move: JointMove, trajectory: Trajectory, vehicle: Vehicle) -> int:
    """Number of a move's joint, which is one that nothing else moves."""
    names = [link.joint.name for link in vehicle.links]
    carriers = () if trajectory.tip is None else trajectory.tip.arm.carriers
    if move.joint not in names:
        others = [name for i, name in enumerate(names) if i not in carriers]
        there = f"must be a joint that does not carry the tip; there are {', '.join(others) or 'none'}"
        raise ValueError(f"{move.where}: {did_you_mean(move.joint, others)}{there}")
    i = names.index(move.joint)
    if i in carriers:
        raise ValueError(f"{move.where}: must be left out, joint {move.joint!r} carries the tip and follows its path")
    signal: Signal = trajectory.joints[i]
    if not isinstance(signal, Constant):
        raise ValueError(f"{move.where}: must be left out, reference.joints[{i}] moves joint {move.joint!r} already")
    return i


def _require_within(move: JointMove, at: float, vehicle: Vehicle, i: int, fastest: float) -> None:
    """Refuse a value beyond the joint's limits, and a move that is too fast."""
    joint = vehicle.links[i].joint
    low, high = float(joint.lower), float(joint.upper)
    if not low <= move.value <= high:
        raise ValueError(f"{move.where} = {move.value:g}: must be within {low:g} and {high:g} of {joint.name!r}")
    seconds = move.end - move.start
    if PEAK_RATE * abs(move.value - at) > fastest * seconds:
        unit = "rad" if joint.kind == "revolute" else "m"
        least = PEAK_RATE * abs(move.value - at) / fastest
        raise ValueError(
            f"{move.where} = {shown(move.value)}: moves by {abs(move.value - at):.3g} {unit} in {seconds:.3g} s; "
            f"must have {least:.3g} s or more (joint_speed = {fastest:g} {unit}/s)"
        )
