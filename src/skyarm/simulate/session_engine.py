"""The engine of a session, and what it can be given in flight."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from skyarm.actuation import Command
from skyarm.compile.machine_code import NoMachineCodeError
from skyarm.files import shown
from skyarm.records import coerce
from skyarm.records.coerce import RecordError
from skyarm.scenario.numbers import DERIVED, number_at, with_numbers
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.simulate.compiled_session import CompiledSteps
from skyarm.simulate.staged_flight import StagedFlight


def plain_numbers(command: Command) -> tuple[float, ...]:
    """The numbers of a command from outside.

    Raises:
        ScenarioError: one that is none.
    """
    found = []
    for field in ("rotor_speeds", "efforts"):
        for i, value in enumerate(getattr(command, field)):
            try:
                held = coerce.number(f"command.{field}[{i}]", value)
            except RecordError as error:
                raise ScenarioError(str(error)) from None
            if type(held) is not float:
                raise ScenarioError(f"command.{field}[{i}] = {shown(value)}: must be one number")
            found.append(held)
    return tuple(found)


def require_continuous(old: Scenario, new: Scenario) -> None:
    """What a session cannot change is as it began.

    Raises:
        ScenarioError: names it.
    """
    delays, before, after = new.delays, old.world.vehicle, new.world.vehicle
    if old.delays.longest_command is not None:
        # a varied delay of the commands stands within a queue of the same length
        began = old.delays
        delays = dataclasses.replace(delays, command=began.command, rotors=began.rotors, joints=began.joints)
    pairs: list[tuple[str, Any, Any]] = [
        *((name, getattr(old, name), getattr(new, name)) for name in ("rates", "plant", "integrator", "duration")),
        ("delays", old.delays, delays),
        ("joints", before.n, after.n),
        ("rotors", len(before.rotors), len(after.rotors)),
    ]
    for name, began, value in pairs:
        if began != value:
            raise ScenarioError(f"{name} = {shown(value)}: must be {shown(began)} as the session began")


def make_engine(origin: Scenario, paths: Sequence[str], numbers: Mapping[str, Any]) -> Any:
    """Machine code where it can be made, else the stages one by one.

    Args:
        origin: scenario before its numbers were changed.
        paths: numbers that machine code reads in every period.
        numbers: path -> changed number.
    """
    scenario = with_numbers(origin, numbers)
    if scenario.plant == "rigid_body" and scenario.controller.compiled:
        there = [path for path in paths if _leads_on(origin, path)]
        constant = {path: value for path, value in numbers.items() if path not in there}
        try:
            engine = CompiledSteps(with_numbers(with_data(origin, there), constant), there, scenario)
        except NoMachineCodeError:
            pass
        else:
            engine.give(scenario, {path: value for path, value in numbers.items() if path in there})
            return engine
    return StagedFlight(scenario)


def with_data(scenario: Scenario, paths: Sequence[str]) -> Scenario:
    """The scenario with the numbers of these paths made data, so that they may be varied from a structural zero."""
    return with_numbers(scenario, {path: number_at(scenario, path) for path in paths if not path.startswith(DERIVED)})


def _leads_on(scenario: Scenario, path: str) -> bool:
    """Whether there is such a number: another law has other gains."""
    try:
        number_at(scenario, path)
    except ScenarioError:
        return False
    return True
