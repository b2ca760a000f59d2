"""Transport delay of commands between control law and actuators, common or separate for
rotors and joints.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from itertools import accumulate
from operator import le
from typing import Any, NamedTuple

from skyarm.algebra import Scalar, Scalars
from skyarm.algebra.scalars import add, floor, maximum, minimum, same
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.actuators.drive import Drive
from skyarm.dynamics.actuators.rotor import require_speeds
from skyarm.plant.surroundings import Memories
from skyarm.records import coerce
from skyarm.records.coerce import RecordError, concrete
from skyarm.records.files import errors_as, shown
from skyarm.records.leaves import blend
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.vehicle import Rotor, Vehicle


def command_delay(scenario: Scenario) -> tuple[Scalar | None, Scalar]:
    """Command delay as a number of whole control periods (None: given by the queue
    length) and a remainder (s).
    """
    rates = scenario.rates
    delay = scenario.agent.delays.command
    if scenario.agent.delays.longest_command is None:
        return (
            None,
            round(float(delay * rates.physics))
            % (rates.physics // rates.control)
            / rates.physics,
        )
    return _split(delay, rates.control)


def rotor_and_joint_delays(
    scenario: Scenario,
) -> tuple[tuple[Scalar, Scalar], tuple[Scalar, Scalar]]:
    """Delays of rotor and joint commands, each as whole control periods and the
    remainder in s.
    """
    rates = scenario.rates
    delays = scenario.agent.delays
    split = list[tuple[Scalar, Scalar]]()
    ratio = rates.physics // rates.control
    for more in (delays.rotors, delays.joints):
        delay = add(delays.command, more)
        # a constant delay ends with a step of the physics, as the plant is integrated
        if concrete(delay) and delays.longest_command is None:
            whole, rest = divmod(round(float(delay * rates.physics)), ratio)
            split.append((float(whole), rest / rates.physics))
        else:
            # any other may end within a step
            split.append(_split(delay, rates.control))
    return split[0], split[1]


def _split(delay: Scalar, rate: int) -> tuple[Scalar, Scalar]:
    """Split a delay (s) into whole control periods and the remainder in s."""
    # a delay that is a multiple of the period up to rounding is one
    whole = floor(delay * float(rate) + 1e-9)
    return whole, maximum(delay - whole / float(rate), 0.0)


def switches(
    before: Command, after: Command, rotors: Scalar, joints: Scalar
) -> list[tuple[Scalar, Command]]:
    """Split a control period where delayed rotor or joint commands arrive: list of
    (seconds, active command).

    Args:
        before: the command before this period's arrives.
        after: this period's.
        rotors: s within the period at which it takes effect in the rotors.
        joints: s within the period at which it takes effect in the joints.
    """
    rotors_first = joined_parts(after, before)
    joints_first = joined_parts(before, after)
    # an interval of constant length zero would be integrated for nothing
    if type(joints) is float and type(rotors) is not float and joints == 0.0:
        return [(rotors, joints_first)]
    if type(rotors) is float and type(joints) is not float and rotors == 0.0:
        return [(joints, rotors_first)]
    first = minimum(rotors, joints)
    return [
        (first, before),
        (
            maximum(rotors, joints) - first,
            blend(rotors < joints, rotors_first, joints_first),
        ),
    ]


Parts = list[tuple[Scalar, tuple[Command, ...]]]
"""Intervals of a control period: duration (s) and the commands of all vehicles that are
in force."""


def arrivals(
    late: Sequence[Scalars], before: Sequence[Command], after: Sequence[Command]
) -> Parts:
    """Split a control period where delayed commands arrive; after the last interval
    those of ``after`` are in force.

    Args:
        late: for each vehicle the time (s) in the period at which its commands take
            effect, of all actuators or of rotors and joints.
        before: commands before this period's arrive.
        after: this period's.
    """
    each = [
        [(rest[0], old)] if len(rest) == 1 else switches(old, new, *rest)
        for rest, old, new in zip(late, before, after, strict=True)
    ]
    # equal delays of all vehicles, the usual case, need no sorting
    if all(
        len(rest) == len(late[0]) and all(map(same, rest, late[0])) for rest in late
    ):
        return [
            (row[0][0], tuple(command for _, command in row))
            for row in zip(*each, strict=True)
        ]
    ends = [[*accumulate(seconds for seconds, _ in parts)] for parts in each]
    every = [end for some in ends for end in some]
    parts = Parts()
    start: Scalar = 0.0
    plain = all(type(end) is float for end in every)
    # a set of floats: equal ends would leave intervals of no length
    for end in sorted({*map(float, every)}) if plain else _ascending(every):
        now = list[Command]()
        for some, own, new in zip(ends, each, after, strict=True):
            command = new
            # the earliest of its arrivals is tested last, so that it wins
            for at, (_, old) in reversed([*zip(some, own, strict=True)]):
                command = blend(at < end, command, old)
            now.append(command)
        parts.append((end - start, tuple(now)))
        start = end
    return parts


def _ascending(values: Sequence[Scalar]) -> list[Scalar]:
    """Sorted scalars, which may be traced: each is carried past the larger ones before
    it.
    """
    ordered = list[Scalar]()
    for value in values:
        largest = value
        # insertion by minimum and maximum: traced numbers allow no branch
        for i, other in enumerate(ordered):
            ordered[i], largest = minimum(other, largest), maximum(other, largest)
        ordered.append(largest)
    return ordered


def command_in_force(queue: Sequence[Command], whole: Scalar | None) -> Command:
    """Command of ``whole`` periods ago from a queue of past commands; the oldest if
    ``whole`` is None.
    """
    if whole is None:
        return queue[0]
    if type(whole) is float:
        return queue[len(queue) - 1 - round(whole)]
    in_force = queue[-1]
    for age, command in enumerate(queue[-2::-1], start=1):
        # ages are whole numbers: halfway between them rounding decides nothing
        in_force = blend(whole < age - 0.5, in_force, command)
    return in_force


def drives_after(
    drives: Sequence[Drive],
    memories: Memories,
    before: Command,
    after: Command,
    late: Scalar,
    state: State,
    period: float,
) -> Memories:
    """Internal states of the joint drives after a control period (s) in which a new
    command arrives after ``late`` seconds.

    A drive's memory is stepped once per period: of two setpoints it receives the mean,
    as with its own latency.

    Args:
        drives: drive of each joint; none where every joint takes a torque.
        memories: internal states of the drives before it.
        before: command before the new one arrives.
        after: the new one.
        late: s.
        state: state of the vehicle at the beginning.
        period: s.
    """
    setpoints: Scalars = after.efforts
    # a delay that is known to be none costs nothing; a traced one may be of any size
    if not (type(late) is float and late == 0.0):
        share = late / period
        setpoints = tuple(
            new + (old - new) * share
            for old, new in zip(before.efforts, after.efforts, strict=True)
        )
    # not strict: drives are none, or one for each joint
    rows = zip(
        drives, memories, setpoints, state.joints, state.joint_rates, strict=False
    )
    return tuple(
        drive.advance(memory, u, q, qd, period) for drive, memory, u, q, qd in rows
    )


def joined_parts(rotors: Command, joints: Command) -> Command:
    """Combine the rotor speeds and tilt angles of one command with the joint setpoints
    of another.
    """
    return Command(
        rotor_speeds=rotors.rotor_speeds, efforts=joints.efforts, tilts=rotors.tilts
    )


class CommandRange(NamedTuple):
    """Numbers that a vehicle takes in a command: counts of joints, rotors and tilts,
    and range of rotor speeds (rad/s).

    The range is compared in every period of a session; only a speed out of it, or NaN,
    takes the time of a message.
    """

    rotors: tuple[Rotor, ...]
    sizes: tuple[int, int, int]
    least: Scalars
    most: Scalars

    @classmethod
    def of(cls, vehicle: Vehicle) -> CommandRange:
        """Numbers that a vehicle takes in a command."""
        least, most = (
            tuple(getattr(r, name) for r in vehicle.rotors)
            for name in ("min_speed", "max_speed")
        )
        return cls(vehicle.rotors, vehicle.sizes, least, most)

    def require(self, speeds: Sequence[float], field: str) -> None:
        """Refuse rotor speeds, which may be followed by other numbers, out of the range
        of their rotors.

        Raises:
            ScenarioError: one line with the rotor and its range.
        """
        if not (all(map(le, self.least, speeds)) and all(map(le, speeds, self.most))):
            with errors_as(ScenarioError):
                require_speeds(self.rotors, speeds[: len(self.rotors)], field)


def numbers_of_command(command: Command, taken: CommandRange) -> tuple[float, ...]:
    """Flatten a user's command: rotor speeds, joint setpoints, rotor tilt angles (zero
    if left out).

    Raises:
        ScenarioError: no command, one with another number of rotors or joints, one that
            is not of numbers, or a rotor speed out of range.
    """
    joints, rotors, tilts = taken.sizes
    if not isinstance(command, Command):
        raise ScenarioError(f"command = {shown(command)}: must be a Command")
    if len(command.rotor_speeds) != rotors or len(command.efforts) != joints:
        raise ScenarioError(
            f"command: {len(command.rotor_speeds)} rotor speeds and"
            f" {len(command.efforts)} efforts: must be {rotors} and {joints}"
        )
    if len(command.tilts) not in (0, tilts):
        raise ScenarioError(
            f"command: {len(command.tilts)} tilts: must be {tilts}, or none"
        )
    if tilts and not command.tilts:
        command = dataclasses.replace(command, tilts=(0.0,) * tilts)
    numbers: tuple[Any, ...] = (
        *command.rotor_speeds,
        *command.efforts,
        *command.tilts,
    )
    # the check of each number by type is fast; conversion is for the odd call
    if not set(map(type, numbers)) <= {float}:
        numbers = _plain_numbers(command)
    taken.require(numbers, "command.rotor_speeds")
    return numbers


def rotor_numbers(
    speeds: Sequence[float], command: object, taken: CommandRange
) -> tuple[float, ...]:
    """Flatten a command of rotor speeds (rad/s) alone; joint setpoints and tilt angles
    become zero.

    Raises:
        ScenarioError: a command beside them, another number of rotors, what are not
            numbers, or a speed out of range.
    """
    joints, rotors, tilts = taken.sizes
    if command is not None:
        raise ScenarioError(
            "rotors: must be left out beside a command, which has rotor speeds of"
            " its own"
        )
    if not coerce.is_sequence(speeds):
        raise ScenarioError(f"rotors = {shown(speeds)}: must be {rotors} numbers")
    numbers = tuple(speeds)
    others = (0.0,) * (joints + tilts)
    plain = set(map(type, numbers)) == {float}  # as every period under an autopilot
    if plain and len(numbers) == rotors:
        taken.require(numbers, "rotors")
        return numbers + others
    given = Command(
        rotor_speeds=numbers, efforts=others[:joints], tilts=others[joints:]
    )
    return numbers_of_command(given, taken)


def _plain_numbers(command: Command) -> tuple[float, ...]:
    """Convert the entries of a user's command to floats; refuse those that are no
    numbers.

    Raises:
        ScenarioError: an entry is no number.
    """
    numbers = []
    for field in ("rotor_speeds", "efforts", "tilts"):
        for i, value in enumerate(getattr(command, field)):
            with errors_as(ScenarioError, of=RecordError):
                number = coerce.number(f"command.{field}[{i}]", value)
            if type(number) is not float:
                raise ScenarioError(
                    f"command.{field}[{i}] = {shown(value)}: must be one number"
                )
            numbers.append(number)
    return tuple(numbers)
