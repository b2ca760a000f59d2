"""Clocks and delays that could not tick are refused: delays are whole numbers of steps, laws know the clocks.

Every refusal is a ValueError of one line; :class:`skyarm.scenario.scenario_record.Scenario` makes it a ScenarioError.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from skyarm.control.controller import innermost
from skyarm.files import number
from skyarm.records.coerce import concrete

if TYPE_CHECKING:
    from skyarm.scenario.scenario_record import Scenario

STEPPING = ("mujoco", "mujoco_contacts")
"""Plants that move by whole physics steps only."""

LONGEST_QUEUE = 100
"""Control periods that a varied delay of the commands may take: the loop remembers as many commands."""


def check_delays(scenario: Scenario) -> None:
    """Delays are whole numbers of steps within the flight; one that varies stays below its longest."""
    rates = scenario.rates
    for name, rate, unit in (
        ("measurement", rates.control, "control periods"),
        ("command", rates.physics, "physics steps"),
        ("rotors", rates.physics, "physics steps"),
        ("joints", rates.physics, "physics steps"),
    ):
        if not concrete(getattr(scenario.delays, name)):
            continue
        delay = number(getattr(scenario.delays, name), f"delays.{name}", low=0.0)
        if delay > scenario.duration:
            raise ValueError(f"delays.{name} = {delay!r}: must not exceed the duration of {scenario.duration:g} s")
        # the closed loop in machine code takes any delay if it is told the longest; MuJoCo's plant steps
        if name == "measurement" or scenario.delays.longest_command is None or scenario.plant in STEPPING:
            require_whole(f"delays.{name}", delay, rate, unit)
    _check_longest(scenario)


def _check_longest(scenario: Scenario) -> None:
    """A delay that varies stays below its longest."""
    delays = scenario.delays
    if delays.longest_command is None:
        return
    longest = number(delays.longest_command, "delays.longest_command", low=0.0, strict=True)
    if longest * scenario.rates.control > LONGEST_QUEUE:
        raise ValueError(
            f"delays.longest_command = {longest!r}: must be at most {LONGEST_QUEUE} control periods, "
            f"{LONGEST_QUEUE / scenario.rates.control:g} s"
        )
    if not concrete(delays.command):
        return
    for name in ("rotors", "joints", "command"):
        added = getattr(delays, name)
        own = name == "command"
        if concrete(added) and (added if own else delays.command + added) > longest:
            held, what = (added, "") if own else (delays.command + added, " with delays.command")
            raise ValueError(
                f"delays.{name} = {held!r}{what}: must not exceed delays.longest_command = {delays.longest_command!r}"
            )


def check_clocks(scenario: Scenario) -> None:
    """A law that is told of its clocks is told of those that tick."""
    par, rates = innermost(scenario.controller.par), scenario.rates
    cutoff = getattr(par, "cutoff", None)
    if cutoff is not None and concrete(cutoff) and not 2.0 * cutoff < rates.control:
        raise ValueError(
            f"controller.cutoff = {cutoff!r}: must be below {0.5 * rates.control:g} Hz, half of rates.control"
        )
    for name, rate in (("control_period", rates.control), ("reference_period", rates.reference)):
        believed = getattr(par, name, None)
        if believed is not None and concrete(believed) and abs(believed * rate - 1.0) > 1e-6:
            clock = name.removesuffix("_period")
            raise ValueError(f"controller.{name} = {believed!r}: must be {1.0 / rate:g} s, as rates.{clock} has it")


def require_whole(field: str, seconds: float, rate: int, unit: str) -> None:
    """A time is a whole number of ticks of a clock (Hz), at least one if it is above 0."""
    count = seconds * rate
    if abs(count - round(count)) > 1e-6 or (seconds > 0.0 and round(count) < 1):
        raise ValueError(f"{field} = {seconds!r}: must be a whole number of {unit} of {1.0 / rate:g} s")
