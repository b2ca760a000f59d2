"""Payload tables of a scenario file, and payloads and grippers that the phases of a
task name.

::

    [[payloads]]
    name = "parcel"                                  # default: its number
    mass = 0.3                                       # kg
    # kg m^2, about its centre of mass, axes of the frame (default 0)
    inertia = [1e-4, 1e-4, 1e-4]
    com = [0, 0, -0.02]                              # m, axes of the frame (default 0)
    frame = "tip"                                    # default: the vehicle's tip
    pick = 8.0                                       # s, or
    # m, world axes: as soon as the frame is there; after (s, 0)
    pick = { within = 0.05, of = [1, 0, 0.5] }
    drop = 14.0  # the same; left out: it is held to the end
    kind = "rigid"  # or "hanging", a point mass on a cord: cord (m, 0.5), stretch (by
  # its weight, of its length, 0.02), damping_ratio (0.2)
    believed = true  # the law's model changes at both instants (default false)

The model of the law takes a point mass at the frame, by changes of
``model.payload.FRAME.mass`` (:mod:`skyarm.scenario.in_flight`).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from skyarm.algebra import Scalar
from skyarm.records.files import did_you_mean, shown
from skyarm.records.leaves import Tree, replace_at
from skyarm.reference.signals import Constant, Sum, Windowed
from skyarm.reference.task_records import TaskEvent
from skyarm.scenario.paths import prefix_of
from skyarm.scenario.scenario_record import Change, Scenario
from skyarm.world import Component, TimedPayload

if TYPE_CHECKING:
    from skyarm.world.contact.gripper import Gripper

FIELD = {"pick": "pick", "place": "drop"}
"""Kind of a task phase -> field of the payload that it sets."""


SAME = 1e-6
"""Share of a control period within which two instants are the same."""


def scheduled_changes(scenario: Scenario) -> tuple[Change, ...]:
    """All changes in a flight: those that the scenario states, then those of models
    that have payloads.

    Changes of models follow from the payloads as they are, so that a mass or an instant
    may be replaced.
    """
    derived = (
        replace(change, path=prefix_of(scenario, name) + change.path)
        for name, agent in scenario.agents.items()
        for change in model_changes(
            agent.modelled_payloads, scenario.steps, scenario.rates.control
        )
    )
    # the plan of a flight states those that a change by hand followed
    return (
        *scenario.changes,
        *(each for each in derived if each not in scenario.changes),
    )


def model_changes(
    payloads: Sequence[TimedPayload], steps: int, rate: int
) -> tuple[Change, ...]:
    """Scheduled changes by which the payload mass of a law's model follows payloads.

    Args:
        payloads: payloads that the model has from pick to drop; masses may be lanes of
            a batch.
        steps: control periods of the flight; changes after its end are left out.
        rate: control rate, Hz.
    """
    changes: list[Change] = []
    for frame in dict.fromkeys(payload.frame for payload in payloads):
        held = [payload for payload in payloads if payload.frame == frame]
        path = f"model.payload.{frame}.mass" if frame else "model.payload.mass"
        times = [float(t) for each in held for t in (each.pick, each.drop)]
        # a payload that is held to the end has no instant of its drop
        for t in sorted({t for t in times if math.isfinite(t)}):
            mass: Scalar = sum(
                (each.mass for each in held if each.pick <= t < each.drop), 0.0
            )
            changes.append(Change(at=t, path=path, value=mass))
    return tuple(
        sorted(
            (each for each in changes if each.tick(rate) < steps),
            key=lambda change: change.at,
        )
    )


def _whole_period(time: float, rate: float) -> float:
    """Start (s) of the first control period at or after a time (s)."""
    # an instant on a period's start must not fall into the next one by rounding
    return math.ceil(time * rate - 1e-9) / rate


def with_instants(
    tables: object, events: Sequence[TaskEvent], control_rate: float
) -> object:
    """Payload tables with pick and drop times filled in from the phases of a task.

    Args:
        tables: payload tables of the file.
        events: events of the phases.
        control_rate: Hz; instants are whole control periods.

    Raises:
        ValueError: one line: a payload that is not there, or one that has the instant
            from elsewhere.
    """
    if (
        not events
        or not isinstance(tables, list)
        or not all(isinstance(table, dict) for table in tables)
    ):
        # nothing to add, or not what the reader of payloads takes
        return tables
    filled = [dict(table) for table in tables]
    named: dict[str, int] = {}
    for i, name in enumerate(table.get("name") for table in filled):
        if isinstance(name, str) and named.setdefault(name, i) != i:
            raise ValueError(
                f"payloads[{i}].name = {shown(name)}: must differ from that of"
                f" payloads[{named[name]}]"
            )
    seen: dict[tuple[str, str], str] = {}
    for event in events:
        at = f"{event.where}.payload = {shown(event.payload)}"
        _require_payload(event, named)
        table = filled[named[event.payload]]
        field = FIELD[event.kind]
        same = (event.payload, event.kind)
        if same in seen:
            raise ValueError(
                f"{at}: must be the name of another payload: {seen[same]} {event.kind}s"
                " it already"
            )
        if event.kind == "pick" and (event.payload, "place") in seen:
            raise ValueError(
                f"{at}: must be picked before {seen[event.payload, 'place']} places it"
            )
        seen[same] = event.where
        if field in table:
            own = f"payloads[{named[event.payload]}].{field} = {shown(table[field])}"
            raise ValueError(f"{own}: must be left out, {event.where} says when")
        table[field] = _whole_period(event.time, control_rate)
    return filled


def require_events_as_begun(scenario: Scenario, events: Sequence[TaskEvent]) -> None:
    """Raise an error if a task that comes in flight picks or places otherwise than the
    flight began.

    Instants of payloads and commands of grippers are fixed for a flight.

    Args:
        scenario: flight of the vehicle whose task it is.
        events: events of the task's phases.

    Raises:
        ValueError: one line: a payload or gripper that is not there, or that has
            another instant.
    """
    named = {each.name: each for each in scenario.agent.payloads}
    rate = scenario.rates.control
    as_begun = "as the flight began, or be left out of a change"
    for event in (each for each in events if not each.gripper):
        _require_payload(event, named)
        field, time = FIELD[event.kind], _whole_period(event.time, rate)
        if abs(getattr(named[event.payload], field) - time) * rate > SAME:
            own = (
                f"{event.where}.payload = {shown(event.payload)}: {event.kind}s it at"
                f" {time:g} s"
            )
            raise ValueError(
                f"{own}, must do so at {getattr(named[event.payload], field):g} s"
                f" {as_begun}"
            )
    commands = [each for each in events if each.gripper]
    if not commands:
        return
    names = {each.gripper for each in commands}
    agent = next(iter(scenario.agents)) if scenario.others else ""
    grippers = scenario.world.grippers if scenario.world is not None else ()
    free = (
        replace(each, closed=type(each.closed)()) if each.name in names else each
        for each in grippers
    )
    # without the commands, which are then made anew and compared
    bare: Any = (
        scenario.world
        if scenario.world is None
        else replace_at(scenario.world, {("grippers",): tuple(free)})
    )
    commanded: Any = with_commands(bare, commands, rate, agent)
    if commanded.grippers != grippers:
        at = f"{commands[0].where}.gripper = {shown(commands[0].gripper)}"
        raise ValueError(f"{at}: must close and open {as_begun}")


def _require_payload(event: TaskEvent, named: Collection[str]) -> None:
    """Raise an error unless a phase names a payload that there is."""
    if event.payload not in named:
        near = did_you_mean(event.payload, named)
        there = ", ".join(named) or "none"
        at = f"{event.where}.payload = {shown(event.payload)}"
        raise ValueError(
            f"{at}: {near}must be the name of one of [[payloads]]; there are {there}"
        )


def with_commands(
    world: Component[Tree] | None,
    events: Sequence[TaskEvent],
    control_rate: float,
    agent: str,
) -> Component[Tree] | None:
    """Contact model whose grippers close and open in the task phases that name them.

    Args:
        world: contact model of the file; None without one.
        events: events of the phases that name a gripper.
        control_rate: Hz; instants are whole control periods.
        agent: name of the vehicle whose task it is; empty for the only one.

    Raises:
        ValueError: one line: a gripper that is not there, is of another vehicle, or has
            its command from elsewhere.
    """
    grippers = {each.name: each for each in getattr(world, "grippers", ())}
    for event in events:
        at = f"{event.where}.gripper = {shown(event.gripper)}"
        gripper = grippers.get(event.gripper)
        if gripper is None:
            near = did_you_mean(event.gripper, grippers)
            there = ", ".join(grippers) or "none"
            raise ValueError(
                f"{at}: {near}must be the name of one of [[world.grippers]]; there are"
                f" {there}"
            )
        if gripper.agent != agent and agent:
            raise ValueError(
                f"{at}: must be a gripper of {agent}, not of"
                f" {gripper.agent or 'no agent'}"
            )
        # a hook has no command, and any but the usual one is the file's own
        if gripper.kind == "hook" or gripper.closed != type(gripper.closed)():
            raise ValueError(
                f"{at}: must be a gripper without a command of its own (closed)"
            )
    if world is None or not events:
        return world
    commanded = tuple(
        _with_task_windows(each, events, control_rate) for each in grippers.values()
    )
    return replace_at(world, {("grippers",): commanded})


def _with_task_windows(
    gripper: Gripper, events: Sequence[TaskEvent], rate: float
) -> Gripper:
    """Gripper that is commanded closed from each pick phase of a task to the next place
    phase.
    """
    windows: list[Windowed] = []
    since: float | None = None
    for event in (each for each in events if each.gripper == gripper.name):
        instant = _whole_period(event.time, rate)
        if (event.kind == "pick") is (since is not None):
            done = (
                "holds something already" if event.kind == "pick" else "holds nothing"
            )
            raise ValueError(
                f"{event.where}.gripper = {shown(event.gripper)}: must be another one:"
                f" it {done} there"
            )
        if since is not None:
            windows.append(Windowed(Constant(1), since, instant))
        since = instant if since is None else None
    if since is not None:
        windows.append(Windowed(Constant(1), since))
    if not windows:
        return gripper
    signal = windows[0] if len(windows) == 1 else Sum(tuple(windows))
    return replace(gripper, closed=type(gripper.closed)(signal))
