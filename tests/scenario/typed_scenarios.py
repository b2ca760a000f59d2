"""Scenarios that type checkers accept, and those that they refuse.

``make types`` reads this file, nothing runs it. Each refusal has a comment that ignores
it, so that mypy, told to warn of unused ones, fails where it accepts the line.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, assert_type

from skyarm.algebra.scalars import Scalar
from skyarm.control.controller import Controller
from skyarm.dynamics import State
from skyarm.plant.interface import Truth
from skyarm.reference import Trajectory
from skyarm.scenario.scenario_record import Delays, JointDrive, NamedSensor, Scenario
from skyarm.world import NO_WIND, Component, Fault, Force, MovingAir


def accepted(scenario: Scenario) -> None:
    """Fields and groups of the right types, and the shortcuts to what is in the
    groups.
    """
    made = Scenario(name="made", duration=1.0, agents=scenario.agents)
    agent = dataclasses.replace(
        scenario.agent, delays=Delays(command=0.01), initial=None
    )
    environment = dataclasses.replace(scenario.environment, wind=NO_WIND)
    assert_type(
        dataclasses.replace(
            made, name="other", agents={"main": agent}, environment=environment
        ),
        Scenario,
    )
    assert_type(
        made.with_controller(scenario.agent.controller)
        .with_kind("mujoco")
        .under(scenario.agent.controller),
        Scenario,
    )
    assert_type(scenario.agent.plant, Truth)
    assert_type(scenario.agent.controller, Controller)
    assert_type(scenario.agent.reference, Trajectory)
    assert_type(scenario.agent.tracking_start, Scalar)
    assert_type(scenario.agent.sensors, tuple[NamedSensor, ...])
    assert_type(scenario.agent.drives, tuple[JointDrive, ...])
    assert_type(scenario.agent.initial, State | None)
    assert_type(scenario.agent.faults, tuple[Fault, ...])
    assert_type(scenario.wind, Component[Any])
    assert_type(scenario.ground, bool)
    assert_type(scenario.kind, str)


class Creep(Force[tuple[Scalar, Scalar]]):
    """A force whose memory is two numbers."""

    def advance(
        self,
        memory: tuple[Scalar, Scalar],
        t: Scalar,
        dt: float,
        state: State,
        draws: Sequence[Scalar],
    ) -> tuple[Scalar, Scalar]:
        """Memory in the next control period."""
        return memory[1], state.position.z

    def holds(self, memory: float, frame: str) -> tuple[Scalar, ...]:  # type: ignore[override]
        """Takes another memory than the one that it gives."""
        return (memory,)


def parts_of_any_memory(scenario: Scenario) -> None:
    """Components stand side by side, whatever they remember."""
    dataclasses.replace(
        scenario.environment, forces=(Creep(), *scenario.forces), air=(MovingAir(),)
    )
    dataclasses.replace(scenario.environment, forces=(Creep,))  # type: ignore[arg-type]


def refused(scenario: Scenario) -> None:
    """Values of a wrong type, names of no field, and fields that are missing or
    read-only.
    """
    Scenario(name=1, duration=1.0, agents=scenario.agents)  # type: ignore[arg-type]
    Scenario(name="x", duration=1.0)  # type: ignore[call-arg]
    Scenario(name="x", duration=1.0, agents=scenario.agents, plnt=scenario.agent.plant)  # type: ignore[call-arg]
    dataclasses.replace(scenario, name=3)  # type: ignore[arg-type]
    dataclasses.replace(scenario, agents=scenario.agent.plant)  # type: ignore[arg-type]
    dataclasses.replace(scenario.agent, plnt=1)  # type: ignore[call-arg]
    dataclasses.replace(scenario.agent, plant=1)  # type: ignore[arg-type]
    dataclasses.replace(scenario.environment, wind=scenario.agent.plant)  # type: ignore[arg-type]
    scenario.with_controller(scenario.agent.plant)  # type: ignore[arg-type]
    scenario.duration = 2.0  # type: ignore[misc]
    scenario.plnt  # type: ignore[attr-defined]  # noqa: B018
