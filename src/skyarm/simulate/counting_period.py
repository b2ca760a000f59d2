"""A control period that also counts the totals of which metrics are made."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from skyarm.metrics.accumulate import Goal, Instant, Total, counted
from skyarm.scalars import logical_and, where
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.loop_state import LoopState, Row, Sample
from skyarm.simulate.period import make_period
from skyarm.simulate.plant_steps import RigidBodySteps
from skyarm.simulate.stages import Stages
from skyarm.simulate.tip_and_goal import goal_of, tool_of
from skyarm.simulate.world_columns import logged_in_contact


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
        goals: tuple[Goal, ...],
        inside: Mapping[str, Any],
        uniforms: tuple[Any, ...],
    ) -> tuple[tuple[LoopState, tuple[Any, ...]], Sample]:
        loop, totals = both
        row = stages.led(loop, row)
        if not goals:
            free = stages.waits.reference(*stages.waits.instants(stages.path_times(loop))[1])
            goals = goal_of(vehicle, row.reference.dense()), goal_of(vehicle, free.dense())
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
            phase=stages.waits.phase(row.path_time),
            time=row.time,
            **_touching(scenario, row, sample),
        )
        alive = sample.alive > 0.5
        counts = {name: alive if within is True else logical_and(alive, within) for name, within in inside.items()}
        return (following, counted(totals, wanted, now, counts)), sample

    return step


def _touching(scenario: Scenario, row: Row, sample: Sample) -> dict[str, tuple[Any, ...]]:
    """What metrics see of a contact; nothing of a scenario without a world."""
    if not scenario.contacts:
        return {}
    arrays = logged_in_contact(scenario, sample.wind.contacts)
    contact, taken = scenario.contacts[0], arrays.get("gripper_taken", [])
    push, places = scenario.trajectory.push, arrays.get("object_position", [])
    time = row.time if isinstance(row.path_time, tuple) else row.path_time
    return {
        "push": () if push is None else push.at(time),
        "contact": tuple(arrays.get("contact_force", ())),
        "objects": tuple(places),
        "mechanisms": tuple(arrays.get("mechanism_position", ())),
        "pull": (taken[0], *arrays["gripper_pull"][:3]) if taken else (),
        "hinge": contact.mechanisms[0].hinge if contact.mechanisms else (),
    }
