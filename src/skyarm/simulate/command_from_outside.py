"""A command from outside in place of the law's, as plain numbers."""

from __future__ import annotations

import dataclasses
from typing import Any

from skyarm.actuation import Command
from skyarm.files import shown
from skyarm.records import coerce
from skyarm.records.coerce import RecordError
from skyarm.scenario.scenario_record import ScenarioError


def numbers_of_command(command: Command, rotors: int, joints: int, tilts: int = 0) -> tuple[float, ...]:
    """Rotor speeds, joint setpoints, angles of rotors that tilt, which may be left out: they are at rest then.

    Raises:
        ScenarioError: no command, one with another number of rotors or joints, or one that is not of numbers.
    """
    if not isinstance(command, Command):
        raise ScenarioError(f"command = {shown(command)}: must be a Command")
    if len(command.rotor_speeds) != rotors or len(command.efforts) != joints:
        raise ScenarioError(
            f"command: {len(command.rotor_speeds)} rotor speeds and {len(command.efforts)} efforts: must be "
            f"{rotors} and {joints}"
        )
    if len(command.tilts) not in (0, tilts):
        raise ScenarioError(f"command: {len(command.tilts)} tilts: must be {tilts}, or none")
    if tilts and not command.tilts:
        command = dataclasses.replace(command, tilts=(0.0,) * tilts)
    numbers: tuple[Any, ...] = (*command.rotor_speeds, *command.efforts, *command.tilts)
    if not all(type(number) is float for number in numbers):
        numbers = _plain_numbers(command)
    return numbers


def _plain_numbers(command: Command) -> tuple[float, ...]:
    """The numbers of a command from outside.

    Raises:
        ScenarioError: one that is none.
    """
    found = []
    for field in ("rotor_speeds", "efforts", "tilts"):
        for i, value in enumerate(getattr(command, field)):
            try:
                held = coerce.number(f"command.{field}[{i}]", value)
            except RecordError as error:
                raise ScenarioError(str(error)) from None
            if type(held) is not float:
                raise ScenarioError(f"command.{field}[{i}] = {shown(value)}: must be one number")
            found.append(held)
    return tuple(found)
