"""Option ``--autopilot`` of a flight: the autopilot's name, and options of its record behind a colon."""

from __future__ import annotations

import dataclasses
import shlex
import tomllib
from typing import Any

from skyarm.control.catalogue import AUTOPILOTS, entry_of, make_controller, no_option
from skyarm.control.controller import autopilot_of, innermost, with_innermost
from skyarm.records.files import must_be_one_of, shown
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import Scenario


def autopilot_name(typed: str, controller: str | None) -> str:
    """Name of the autopilot that ``--autopilot`` has before the colon.

    Raises:
        ValueError: no autopilot's name, or a controller beside it.
    """
    name = typed.partition(":")[0]
    if controller is not None:
        raise ValueError(f"--controller = {shown(controller)}: must be left out beside --autopilot")
    if name not in AUTOPILOTS:
        raise ValueError(f"--autopilot = {shown(typed)}: {must_be_one_of(AUTOPILOTS, name)}")
    return name


def with_typed_options(planned: Scenario, typed: str) -> Scenario:
    """Scenario whose autopilot has the options behind the colon: ``px4:outside,instance=3``.

    Raises:
        ValueError: an option that the autopilot does not have, or a value that it cannot be.
    """
    name, _, words = typed.partition(":")
    options = dict(_option(word) for word in words.split(",") if word)
    if not options:
        return planned
    allowed = entry_of(name).options()
    for option, value in options.items():
        if option not in allowed:
            raise ValueError(f"--autopilot = {shown(typed)}: {option} = {shown(value)}: {no_option(name, allowed)}")
    controller, par = planned.controller, innermost(planned.controller.par)
    record = autopilot_of(make_controller(name, par.model, **options))
    left = with_innermost(controller.par, dataclasses.replace(par, autopilot=record))
    return planned.with_words(controller=dataclasses.replace(controller, par=left))


def _option(word: str) -> tuple[str, Any]:
    """Name and value of an option; the value is one of TOML, or else text, and true where none stands."""
    name, given, value = word.partition("=")
    try:
        return name, tomllib.loads(f"value = {value}")["value"] if given else True
    except tomllib.TOMLDecodeError:
        return name, value


def outside_command(scenario: str, planned: Scenario) -> str:
    """Command of the program outside that flies the vehicle from its hover on; empty for a flight without one."""
    record = autopilot_of(planned.controller)
    if record is None or not record.outside:
        return ""
    mavlink, joints = record.outside_ports
    law = " --controller LAW" if autopilot_of(load_scenario(scenario).controller) is not None else ""
    address = f"--link mavlink://127.0.0.1:{mavlink} --joints udp://127.0.0.1:{joints}"
    vehicle = innermost(planned.controller.par).model.vehicle
    return f"skyarm fly {shlex.quote(scenario)}{law} {address}{record.outside_options(vehicle)}"
