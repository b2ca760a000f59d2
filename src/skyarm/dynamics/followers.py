"""Links that move with others: from a vehicle's coordinates to those of all its joints, and back to its leaders.

All joints are G q + constant with a constant matrix G, so that velocities and accelerations are G times the leaders',
and forces are G^T of all joints': no term of the coupling's own appears in the equations of motion.
Source: Featherstone 2008, section 8.2 (explicit constraints).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from skyarm.algebra import Motion
from skyarm.dynamics.state import State
from skyarm.scalars import add, mul
from skyarm.vehicle.vehicle_records import Vehicle


def every_joint(vehicle: Vehicle, joints: Sequence[Any]) -> tuple[Any, ...]:
    """Values of the links' joints and of the followers', rad or m."""
    return (*joints, *(add(mul(each.ratio, joints[each.leader]), each.offset) for each in vehicle.followers))


def every_rate(vehicle: Vehicle, rates: Sequence[Any]) -> tuple[Any, ...]:
    """First or second time derivatives of the links' joints and of the followers'."""
    return (*rates, *(mul(each.ratio, rates[each.leader]) for each in vehicle.followers))


def onto_leaders(vehicle: Vehicle, efforts: Sequence[Any]) -> tuple[Any, ...]:
    """Generalised forces of the links' joints, from forces (N m or N) of all joints."""
    found = list(efforts[: vehicle.n])
    for each, effort in zip(vehicle.followers, efforts[vehicle.n :], strict=True):
        found[each.leader] = add(found[each.leader], mul(each.ratio, effort))
    return tuple(found)


def columns_of_leaders(vehicle: Vehicle, columns: Sequence[Motion]) -> list[Motion]:
    """Columns of a Jacobian by the rates of the links' joints, from those by the rates of all joints."""
    found = list(columns[: vehicle.n])
    for each, column in zip(vehicle.followers, columns[vehicle.n :], strict=True):
        found[each.leader] = found[each.leader] + column * each.ratio
    return found


def untied(vehicle: Vehicle, state: State) -> tuple[Vehicle, State]:
    """The same motion of a vehicle whose followers have joints of their own."""
    if not vehicle.followers:
        return vehicle, state
    joints, rates = every_joint(vehicle, state.joints), every_rate(vehicle, state.joint_rates)
    return vehicle.untied, dataclasses.replace(state, joints=joints, joint_rates=rates)
