"""Option ``--autopilot`` of a flight: the autopilot's name, then settings after a
colon.
"""

from __future__ import annotations

import re
import shlex
import tomllib
from contextlib import suppress
from dataclasses import replace
from functools import partial

from skyarm.control.actuator_layer import plain_model
from skyarm.control.catalogue import AUTOPILOTS, entry_of, no_option
from skyarm.control.controller import autopilot_of, innermost, with_innermost
from skyarm.records.files import Fields, must_be_one_of, shown
from skyarm.records.files.toml import Entry
from skyarm.scenario.controller_table import PYTHON_ONLY, by_words
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import Scenario


def autopilot_name(typed: str, controller: str | None) -> str:
    """Autopilot name in the value of ``--autopilot``, before the colon.

    Raises:
        ValueError: no autopilot's name, or a controller beside it.
    """
    name = typed.partition(":")[0]
    if controller is not None:
        raise ValueError(
            f"--laws = {shown(controller)}: must be left out beside --autopilot"
        )
    if name not in AUTOPILOTS:
        raise ValueError(
            f"--autopilot = {shown(typed)}: {must_be_one_of(AUTOPILOTS, name)}"
        )
    return name


def load_under_autopilot(
    source: str,
    typed: str,
    controller: str | None,
    *,
    plant: str | None = None,
    seed: int | None = None,
    duration: float | None = None,
) -> Scenario:
    """Load a scenario under an autopilot, with the settings in the scenario's file if
    it names the same autopilot.

    Raises:
        ValueError: an autopilot, an option or a value that cannot be, or a scenario
            that cannot be loaded.
    """
    name = autopilot_name(typed, controller)
    load = partial(load_scenario, source, plant=plant, seed=seed, duration=duration)
    same = False
    # the scenario's own law may not load where another stands in its place
    with suppress(ValueError):
        own = autopilot_of(load().agent.controller)
        same = own is not None and own.name == name
    return with_typed_options(load(controller=None if same else name), typed)


def with_typed_options(planned: Scenario, typed: str) -> Scenario:
    """Scenario with the autopilot settings that follow the colon, as in
    ``px4:outside,instance=3``.

    Raises:
        ValueError: an option that the autopilot does not have, or a value that it
            cannot be.
    """
    name, _, words = typed.partition(":")
    options = _options(words, typed)
    if not options:
        return planned
    allowed = [
        option for option in entry_of(name).options() if option not in PYTHON_ONLY
    ]
    for option, value in options.items():
        if option not in allowed:
            raise ValueError(
                f"--autopilot = {shown(typed)}: {option} = {shown(value)}:"
                f" {no_option(name, allowed, option)}"
            )
    controller, par = planned.agent.controller, innermost(planned.agent.controller.par)
    # read by the same function as the table of a file, so that both accept the same
    table = Fields({"autopilot": name, **options}, "controller")
    made = innermost(by_words(table, plain_model(controller.par.model), {}).par)
    given = {
        option: getattr(made.autopilot, option)
        for option in options
        if option != "joint_gains"
    }
    gains = made.joint_gains if "joint_gains" in options else par.joint_gains
    own = replace(par, autopilot=replace(par.autopilot, **given), joint_gains=gains)
    return planned.with_controller(
        replace(controller, par=with_innermost(controller.par, own))
    )


def _options(words: str, typed: str) -> dict[str, Entry]:
    """Parse comma-separated ``name=value`` settings, where quotes and brackets protect
    commas.

    Raises:
        ValueError: an option that is given twice.
    """
    pieces = [""]
    depth = 0
    # quoted texts as a whole, all else letter by letter
    for part in re.findall(r'"[^"]*"|\'[^\']*\'|.', words, re.DOTALL):
        depth += (part in "[{") - (part in "]}")
        if part == "," and not depth:
            pieces.append("")
        else:
            pieces[-1] += part
    options: dict[str, Entry] = {}
    for name, given, text in (piece.partition("=") for piece in pieces if piece):
        if name in options:
            raise ValueError(
                f"--autopilot = {shown(typed)}: {name} = {shown(text)}: must be given"
                " once"
            )
        options[name] = _value(text) if given else True
    return options


def _value(text: str) -> Entry:
    """Parse a value as TOML; text that is not TOML is returned unchanged."""
    with suppress(tomllib.TOMLDecodeError, RecursionError):
        table: dict[str, Entry] = tomllib.loads(f"value = {text}")
        if len(table) == 1:
            return table["value"]
    return text


def outside_command(scenario: str, planned: Scenario) -> str:
    """Command line of the external program that takes over in hover; empty for a flight
    without one.
    """
    record = planned.autopilot
    if record is None or not record.outside:
        return ""
    mavlink, joints = record.outside_ports
    # a scenario that an autopilot flies states no law, so one must be chosen
    law = (
        " --laws LAW"
        if autopilot_of(load_scenario(scenario).agent.controller) is not None
        else ""
    )
    address = f"--link mavlink://127.0.0.1:{mavlink} --joints udp://127.0.0.1:{joints}"
    vehicle = planned.agent.model.vehicle
    return (
        f"skyarm fly {shlex.quote(scenario)}{law}"
        f" {address}{record.outside_options(vehicle)}"
    )
