"""``[reference.tip]``: a motion of the tip, from which base and joints follow.

::

    [reference.tip]
    path = { kind = "circle", radius = 0.2, frequency_hz = 0.1, center = [0, 0, 0.7] }  # a motion, or a list of them
    relative_to = "world"        # or "base": against its origin, axes of its heading; [reference.base] then moves it
    posture = [0.4, -0.8]        # joints that the arm prefers, rad or m; the middle of their limits if left out
    base_share = 0.7             # of the tip's way in the world that the base takes; 1: the arm stays in its posture
    arm_range = 0.1              # m, that the arm moves its tip at most for the rest
    orientation = [0.0, 0.0, 0.0]  # signals: roll, pitch, yaw (ZYX) of the tip, in the world or relative to the base
    joint_speed = 2.0            # rad/s or m/s, the largest that is planned
    rate = 10.0                  # Hz of the plan's samples

The joints follow from ``posture`` and inverse kinematics: ``[[reference.joints]]`` stands nowhere beside it.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from skyarm.files import Fields, shown
from skyarm.reference.joint_moves import with_joint_moves
from skyarm.reference.push_tables import push_from
from skyarm.reference.reference_tables import motion_from, trajectory_from
from skyarm.reference.setting import Setting
from skyarm.reference.signal_tables import signal_from
from skyarm.reference.task_tables import within
from skyarm.reference.tip_plan import TipChoices, with_tip
from skyarm.reference.trajectory import Trajectory
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Vehicle


def reference_from(table: Any, n_joints: int, where: str, setting: Setting) -> Trajectory:
    """The trajectory of a reference, whose tip may have a motion of its own.

    Args:
        table: of the whole reference, as :func:`skyarm.reference.trajectory_from` takes it, and ``tip``, ``push``,
            ``load``.
        n_joints: joints of the vehicle.
        where: name of the reference's table.
        setting: whose vehicle, and for how long.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    if isinstance(table, dict) and "push" in table:
        push = push_from(table["push"], f"{where}.push", setting.duration)
        rest = {name: value for name, value in table.items() if name != "push"}
        found = reference_from(rest, n_joints, where, setting)
        if setting.pushes:
            raise ValueError(f"{where}.push: must be left out beside phases that press")
        return dataclasses.replace(found, push=push)
    if isinstance(table, dict) and "load" in table:
        load = signal_from(table["load"], f"{where}.load")
        rest = {name: value for name, value in table.items() if name != "load"}
        return dataclasses.replace(reference_from(rest, n_joints, where, setting), load=load)
    if not isinstance(table, dict) or "tip" not in table:
        found = _pushing(trajectory_from(table, n_joints, where, setting), setting)
        return with_joint_moves(found, setting.joint_moves, setting.vehicle)
    rest = {name: value for name, value in table.items() if name not in ("tip", "joints")}
    base = trajectory_from(rest, n_joints, where, setting)
    found = _pushing(_of_tip(table, base, where, setting), setting)
    return dataclasses.replace(found, guards=setting.all_guards, phases=setting.all_phases)


def _pushing(trajectory: Trajectory, setting: Setting) -> Trajectory:
    """The trajectory with the push that phases ask for."""
    return dataclasses.replace(trajectory, push=setting.pushes[0]) if setting.pushes else trajectory


def _of_tip(table: dict[str, Any], base: Trajectory, where: str, setting: Setting) -> Trajectory:
    """The trajectory of a reference with a tip, from its heading and the motion of its base."""
    fields = Fields(table["tip"], f"{where}.tip")
    vehicle = _vehicle(setting, fields.where)
    if "joints" in table:
        raise ValueError(f"{where}.joints = {shown(table['joints'])}: must be left out beside tip; see tip.posture")
    relative = fields.choice("relative_to", ("world", "base"), "world") == "base"
    if "base" in table and not relative:
        raise ValueError(f"{where}.base = {shown(table['base'])}: must be left out, the base follows from tip.path")
    path = motion_from(fields.take("path"), fields.at("path"), setting)
    choices = _choices(fields, vehicle, relative)
    fields.done()
    try:
        found = with_tip(base, vehicle, path, choices, setting.duration, relative=relative)
    except ValueError as error:
        raise ValueError(f"{fields.where}.{error}") from None
    return with_joint_moves(found, setting.joint_moves, vehicle, choices.joint_speed)


def _vehicle(setting: Setting, where: str) -> Vehicle:
    vehicle = setting.vehicle
    if vehicle is None or not vehicle.end_effector:
        name = "none is known" if vehicle is None else f"{vehicle.name!r} has none (end_effector)"
        raise ValueError(f"{where}: needs a vehicle with a tip; {name}")
    link = vehicle.frame(vehicle.end_effector).link
    if link == BASE or link >= vehicle.n:
        held = "the base" if link == BASE else "a link that follows others"
        raise ValueError(f"{where}: needs a tip that joints move; that of {vehicle.name!r} is fixed to {held}")
    return vehicle


def _choices(fields: Fields, vehicle: Vehicle, relative: bool) -> TipChoices:
    usual = TipChoices(posture=())
    share = fields.number("base_share", 0.0 if relative else usual.base_share, low=0.0)
    if share > 1.0 or (relative and share):
        allowed = "must be left out of a tip that is relative to the base" if relative else "must be from 0 to 1"
        raise ValueError(f"{fields.at('base_share')} = {share!r}: {allowed}")
    turn = fields.take("orientation", None)
    if turn is not None and (not isinstance(turn, list) or len(turn) != 3):
        raise ValueError(f"{fields.at('orientation')} = {shown(turn)}: must be three signals: roll, pitch, yaw")
    signals = None
    if turn is not None:
        roll, pitch, yaw = (signal_from(entry, f"{fields.at('orientation')}[{i}]") for i, entry in enumerate(turn))
        signals = roll, pitch, yaw
    return TipChoices(
        posture=_posture(fields, vehicle),
        base_share=share,
        arm_range=_bounded(fields, "arm_range", usual.arm_range),
        joint_speed=_bounded(fields, "joint_speed", usual.joint_speed),
        orientation=signals,
        rate=_bounded(fields, "rate", usual.rate),
    )


def _bounded(fields: Fields, name: str, usual: float) -> float:
    """A number that is not absurd."""
    return within(fields.number(name, usual), fields.at(name), 1e-3)


def _posture(fields: Fields, vehicle: Vehicle) -> tuple[float, ...]:
    """Joints that the arm prefers, within their limits."""
    bounds = [(float(link.joint.lower), float(link.joint.upper)) for link in vehicle.links]
    if fields.take("posture", None) is None:
        return tuple(
            0.5 * (low + high) if math.isfinite(high - low) else min(max(0.0, low), high) for low, high in bounds
        )
    posture = fields.numbers("posture")
    if len(posture) != vehicle.n:
        raise ValueError(f"{fields.at('posture')} = {len(posture)} numbers: must be one for each of {vehicle.n} joints")
    for i, (q, (low, high), link) in enumerate(zip(posture, bounds, vehicle.links, strict=True)):
        if not low <= q <= high:
            name = link.joint.name
            raise ValueError(f"{fields.at('posture')}[{i}] = {q:g}: must be within {low:g} and {high:g} of {name!r}")
    return posture
