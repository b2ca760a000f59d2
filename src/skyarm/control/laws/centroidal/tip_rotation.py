"""The tip gives way to a torque as an inertia, a damper and a spring of one's choice: the rotation of an admittance.

A virtual body (:mod:`skyarm.control.blocks.virtual_turn`) that the torque about the tip turns says by how much the tip
is turned against its reference; the joints do it, and the base where they cannot keep the tip in its place meanwhile
(:mod:`skyarm.control.laws.centroidal.turned_reference`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skyarm.algebra import Vec3
from skyarm.control.blocks.outside_force import Hearing, HearingMemory, hear_torque
from skyarm.control.blocks.select import vector_data
from skyarm.control.blocks.virtual_turn import moved_turn, turned_by
from skyarm.control.laws.centroidal.admittance_records import RotationGains, RotationMemory
from skyarm.control.laws.centroidal.turned_reference import turned_reference
from skyarm.scalars.taylor import Taylor
from skyarm.vehicle.vehicle_records import Vehicle


def listen(
    gains: RotationGains,
    memory: RotationMemory,
    hearing: tuple[Hearing, HearingMemory],
    torque: Vec3,
    force: Vec3,
    felt: Vec3 | None,
    dt: Any,
) -> tuple[RotationMemory, Vec3]:
    """The memory with what is heard of a torque, and the torque from outside (N m, world axes).

    Args:
        gains: constants.
        memory: one period earlier.
        hearing: constants and memory, one period earlier, of the force.
        torque: that counts, N m, world axes.
        force: that counts, N, world axes.
        felt: N m, of a sensor, filtered, axes of the tip; None without one.
        dt: control period, s.
    """
    heard, outside = hear_torque(*hearing, memory.hearing, gains.threshold, torque, force, dt, felt)
    after = RotationMemory(
        body=memory.body,
        arm=memory.arm,
        hearing=heard,
        torque=vector_data(torque),
        felt=memory.felt if felt is None else vector_data(felt),
    )
    return after, outside


def turn(
    gains: RotationGains, memory: RotationMemory, vehicle: Vehicle, outside: Vec3, signals: Sequence[Taylor], dt: Any
) -> tuple[RotationMemory, list[Taylor]]:
    """The memory one period later, and the reference's signals with the tip turned.

    Args:
        gains: constants.
        memory: that has listened.
        vehicle: model.
        outside: torque about the tip, N m, world axes.
        signals: of the reference, series in time.
        dt: control period, s.
    """
    body, vector = moved_turn(gains.body, memory.body, outside, dt)
    arm, moved = turned_reference(vehicle, gains, memory.arm, turned_by(vector), signals, dt)
    after = RotationMemory(body=body, arm=arm, hearing=memory.hearing, torque=memory.torque, felt=memory.felt)
    return after, moved
