"""What could not fly is refused before anything is built: clocks, delays, vehicles, initial states.

Every refusal is a ValueError of one line; :class:`skyarm.simulate.scenario.Scenario` makes it a ScenarioError.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from skyarm.actuation import make_mixer
from skyarm.dynamics import State
from skyarm.files import number, shown
from skyarm.plant.stiffness import friction_rate
from skyarm.vehicle.check import TOLERANCE, concrete, require_plant

if TYPE_CHECKING:
    from skyarm.simulate.scenario import Scenario

LONGEST_QUEUE = 100
"""Control periods that a varied delay of the commands may take: the loop remembers as many commands."""


def check_delays(scenario: Scenario) -> None:
    """Delays are whole numbers of steps within the flight; one that varies stays below its longest."""
    rates = scenario.rates
    for name, rate, unit in (
        ("measurement", rates.control, "control periods"),
        ("command", rates.physics, "physics steps"),
    ):
        if not concrete(getattr(scenario.delays, name)):
            continue
        delay = number(getattr(scenario.delays, name), f"delays.{name}", low=0.0)
        if delay > scenario.duration:
            raise ValueError(f"delays.{name} = {delay!r}: must not exceed the duration of {scenario.duration:g} s")
        # the closed loop in machine code takes any delay if it is told the longest; MuJoCo's plant steps
        if name == "measurement" or scenario.delays.longest_command is None or scenario.plant == "mujoco":
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
    if concrete(delays.command) and delays.command > delays.longest_command:
        raise ValueError(
            f"delays.command = {delays.command!r}: must not exceed delays.longest_command = {delays.longest_command!r}"
        )


def check_clocks(scenario: Scenario) -> None:
    """A law that is told of its clocks is told of those that tick."""
    # a law under guard keeps its own constants inside the guard's
    par, rates = getattr(scenario.controller.par, "inner", scenario.controller.par), scenario.rates
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


def check_vehicles(scenario: Scenario) -> None:
    """Truth and belief have the same joints and rotors, the reference fits them, and the truth can be simulated.

    Its rotors must reach every torque and thrust; whether they are strong enough to carry it, the flight shows.
    """
    truth, belief = scenario.world.vehicle, scenario.controller.par.model.vehicle
    try:
        require_plant(truth)
        make_mixer(truth)
        friction_rate(truth)
    except ValueError as error:
        raise ValueError(f"plant.vehicle = {truth.name!r}: {error}") from None
    for what, ours, theirs in (("joints", truth.n, belief.n), ("rotors", len(truth.rotors), len(belief.rotors))):
        if ours != theirs:
            raise ValueError(
                f"model.vehicle = {belief.name!r}: has {theirs} {what}, must have {ours} as the plant {truth.name!r}"
            )
    for i, fault in enumerate(scenario.faults):
        try:
            fault.check(truth)
        except ValueError as error:
            raise ValueError(f"environment.faults[{i}].{error}") from None
    found = len(scenario.trajectory.joints)
    if found != truth.n:
        raise ValueError(f"reference.joints = {found} signals: must be {truth.n}, one for each joint")


def check_initial(state: State, joints: int, rotors: int) -> None:
    """An initial state has a number for each joint and rotor, and a quaternion."""
    counts = (("joints", joints), ("joint_rates", joints), ("rotor_speeds", rotors))
    for name, count in counts:
        if len(getattr(state, name)) != count:
            raise ValueError(f"initial.{name}: {len(getattr(state, name))} values, must be {count}")
    check_quaternion(tuple(state.quaternion))


def check_quaternion(values: tuple[Any, ...]) -> None:
    """Four numbers of unit length."""
    good = len(values) == 4
    if good and concrete(*values):
        good = abs(math.sqrt(sum(c * c for c in values)) - 1.0) <= TOLERANCE
    if not good:
        raise ValueError(
            f"initial.quaternion_wxyz = {shown(list(values))}: must be four numbers of length 1 within {TOLERANCE:g}"
        )


def require_whole(field: str, seconds: float, rate: int, unit: str) -> None:
    """A time is a whole number of ticks of a clock (Hz), at least one if it is above 0."""
    count = seconds * rate
    if abs(count - round(count)) > 1e-6 or (seconds > 0.0 and round(count) < 1):
        raise ValueError(f"{field} = {seconds!r}: must be a whole number of {unit} of {1.0 / rate:g} s")
