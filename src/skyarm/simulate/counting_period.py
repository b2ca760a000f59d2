"""A control period that also counts the totals of which metrics are made."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from skyarm.algebra import Vec3
from skyarm.dynamics import State, frame_pose
from skyarm.metrics.accumulate import Goal, Instant, Total, counted
from skyarm.reference import Reference
from skyarm.scalars import cos, logical_and, sin, where
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.loop_state import LoopState, Row, Sample
from skyarm.simulate.period import make_period
from skyarm.simulate.stages import RigidBodySteps, Stages
from skyarm.vehicle.vehicle_records import Vehicle


def make_counting_period(
    scenario: Scenario, substeps: Callable[[float], int], wanted: Sequence[Total]
) -> Callable[..., tuple[tuple[LoopState, tuple[Any, ...]], Sample]]:
    """The function of one control period that also counts totals of a living episode.

    It takes (loop state, totals), the row, the held and the continuous goal, the windows the instant lies in (name ->
    condition), and the uniform numbers.
    """
    stages = Stages(scenario)
    period = make_period(stages, RigidBodySteps(stages, substeps))
    vehicle = scenario.world.vehicle

    def step(
        both: tuple[LoopState, tuple[Any, ...]],
        row: Row,
        goals: tuple[Goal, Goal],
        inside: Mapping[str, Any],
        uniforms: tuple[Any, ...],
    ) -> tuple[tuple[LoopState, tuple[Any, ...]], Sample]:
        loop, totals = both
        following, sample = period(loop, row, uniforms)
        state, command = sample.state, sample.command
        first = loop.ticks < 0.5
        pairs = zip(command.rotor_speeds, loop.queue[-1].rotor_speeds, strict=True)
        now = Instant(
            state=state,
            tool=tool_of(vehicle, state),
            command=command,
            before=tuple(where(first, new, old) for new, old in pairs),
            held=goals[0],
            continuous=goals[1],
            lag=0.0 if isinstance(row.path_time, tuple) else row.time - row.path_time,
        )
        alive = sample.alive > 0.5
        counts = {name: alive if within is True else logical_and(alive, within) for name, within in inside.items()}
        return (following, counted(totals, wanted, now, counts)), sample

    return step


def tool_of(vehicle: Vehicle, state: State) -> Vec3:
    """World position of the tip; of the base origin if the vehicle has none."""
    if not vehicle.end_effector:
        return state.position
    held = frame_pose(vehicle, vehicle.frame(vehicle.end_effector), state.joints).p
    return state.position + state.quaternion.rotation().apply(held)


def goal_of(vehicle: Vehicle, reference: Reference) -> Goal:
    """What a reference wants; its tool is the tip's own reference, or that of the level vehicle.

    The latter is p_d + R_z(psi_d) p_e(th_d).
    """
    if reference.tip:
        return Goal(position=reference.position, joints=reference.joints, tool=Vec3(*reference.tip))
    tool = reference.position
    if vehicle.end_effector:
        held = frame_pose(vehicle, vehicle.frame(vehicle.end_effector), reference.joints).p
        c, s = cos(reference.yaw), sin(reference.yaw)
        tool = tool + Vec3(c * held.x - s * held.y, s * held.x + c * held.y, held.z)
    return Goal(position=reference.position, joints=reference.joints, tool=tool)
