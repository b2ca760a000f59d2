"""Changes in flight that could not be made are refused before anything flies."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from skyarm.actuation.drive import Drive
from skyarm.actuation.servo import Servo
from skyarm.control.actuator_layer import believed_drives
from skyarm.files import did_you_mean, shown
from skyarm.scenario.changes import Change
from skyarm.scenario.derived import is_payload
from skyarm.scenario.in_flight import NONE, Overrides, is_part
from skyarm.scenario.numbers import means_the_same, number_at
from skyarm.scenario.places import LATER, STRUCTURE, roots
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.scenario.whole_parts import WHOLE_PARTS
from skyarm.vehicle.vehicle_records import Vehicle

NUMBERS = (
    "plant", "model", "controller", "environment.wind", "environment.air", "environment.forces", "environment.faults",
    "sensors", "reference", "endings", "estimator", "payloads", "world",
)  # fmt: skip
"""Beginnings of the paths of numbers that may change in flight."""

FIXED = ("name", "title", "schema", "plugins", "initial", "windows", "changes", *STRUCTURE)
"""Words of a file that hold for the whole flight."""

MAY = f"what may is a number of {', '.join(NUMBERS)}, or as a whole {', '.join(WHOLE_PARTS)}"


def require_changes(scenario: Scenario) -> None:
    """Refuse changes that could not be made; they are tried one after the other, those of one instant together.

    Raises:
        ScenarioError: one line with the change, its path or its value, and what is allowed.
    """
    _try_in_order(
        scenario, NONE.parts_of(scenario), NONE, [(f"changes[{i}]", c) for i, c in enumerate(scenario.changes)]
    )


def try_coming(begun: Scenario, now: Scenario, held: Overrides, coming: Sequence[Change]) -> None:
    """Refuse what has just been changed if changes to come could not be made any more.

    Args:
        begun: as the flight began.
        now: as it is.
        held: what holds now.
        coming: changes to come.

    Raises:
        ScenarioError: one line.
    """
    _try_in_order(
        begun, now, held, [(f"after this the change at {each.at:g} s cannot be made", each) for each in coming]
    )


def _try_in_order(begun: Scenario, now: Scenario, held: Overrides, changes: Sequence[tuple[str, Change]]) -> None:
    """Make changes one after the other as they take hold, those of one control period together."""
    rate = begun.rates.control

    def tick(named: tuple[str, Change]) -> int:
        return named[1].tick(rate)

    for _, group in itertools.groupby(sorted(changes, key=tick), key=tick):
        held, now = try_changes(begun, now, held, list(group))


def try_changes(
    begun: Scenario, now: Scenario, held: Overrides, changes: Sequence[tuple[str, Change]]
) -> tuple[Overrides, Scenario]:
    """What holds after some more changes of one instant, and the scenario then.

    Args:
        begun: as the flight began.
        now: as it is before them.
        held: what holds before them.
        changes: (what messages call it, change), in order.

    Raises:
        ScenarioError: one line.
    """
    following = held
    for where, change in changes:
        with _said_of(where):
            _require_changeable(begun, change.path)
            if not is_part(change.path, change.value):
                _require_number(now, change)
                _require_one_load(now, change.path, [path for path, _ in following.numbers])
            following = following.then(change)
            if is_part(change.path, change.value):
                now = following.of(begun)
    alone = len(changes) == 1
    try:
        with _said_of(changes[0][0] if alone else ""):
            now = following.of(begun)
            require_continuous(begun, now)
    except ScenarioError:
        # of several the one is named that alone would be refused
        for where, change in () if alone else changes:
            with _said_of(where):
                require_continuous(begun, held.then(change).of(begun))
        raise
    return following, now


@contextmanager
def _said_of(where: str) -> Iterator[None]:
    """Errors of a change begin with what it is called."""
    try:
        yield
    except ValueError as error:
        words = str(error)
        joint = "." if where.endswith("]") and words.startswith(("path = ", "value = ")) else ": "
        raise ScenarioError(f"{where}{joint}{words}" if where else words) from None


def _require_changeable(scenario: Scenario, path: str) -> None:
    """Refuse what no change reaches."""
    if path in WHOLE_PARTS or (path in LATER and scenario.delays.longest_command is not None):
        return
    if path in LATER:
        raise ScenarioError(
            f"path = {path!r}: delays.longest_command is missing; it bounds delays that change in flight"
        )
    for word in FIXED:
        if path == word or path.startswith(f"{word}."):
            raise ScenarioError(f"path = {path!r}: {word} must be as the flight began; {MAY}")
    starts = [*NUMBERS, *roots(scenario)]
    if not any(path.startswith(f"{start}.") for start in starts):
        if path in starts:
            raise ScenarioError(f"path = {path!r}: must lead to a number below it; {MAY}")
        near = did_you_mean(path, WHOLE_PARTS) or did_you_mean(path.split(".", maxsplit=1)[0], starts)
        raise ScenarioError(f"path = {shown(path)}: {near}nothing of this name changes in flight; {MAY}")


def _require_number(scenario: Scenario, change: Change) -> None:
    """The path leads to a number, and gets one."""
    try:
        number_at(scenario, change.path)
    except ScenarioError as error:
        near = did_you_mean(change.path, WHOLE_PARTS).strip() if change.path.count(".") < 2 else ""
        raise ScenarioError(f"{error}; {near}" if near else str(error)) from None
    if type(change.value) is not float:
        raise ScenarioError(f"value = {shown(change.table)}: must be a number, as {change.path} is one")


def _require_one_load(scenario: Scenario, path: str, changed: Sequence[str]) -> None:
    """Loads add up: one that is changed again keeps its name, or it would hang there twice."""
    for other in changed if is_payload(path) else ():
        if other != path and is_payload(other) and means_the_same(scenario, path, other):
            raise ScenarioError(f"path = {path!r}: is the same load as {other!r}, must be changed by that name")


def require_continuous(old: Scenario, new: Scenario) -> None:
    """Refuse to fly on with a scenario in which something is other that holds for a whole flight.

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
    for a, b in zip(old.instruments, new.instruments, strict=False):
        for clock in ("frequency", "latency"):
            if getattr(a.sensor, clock) != getattr(b.sensor, clock):
                words = "must be as the session began, since readings are on their way"
                raise ScenarioError(f"sensors.{b.name}.{clock} = {shown(getattr(b.sensor, clock))}: {words}")
    _require_latencies("plant", before, old.all_drives, new.all_drives)
    beliefs = [each.controller.par.model for each in (old, new)]
    _require_latencies("model", beliefs[0].vehicle, *(believed_drives(model) for model in beliefs))


def _require_latencies(root: str, vehicle: Vehicle, old: Sequence[Drive], new: Sequence[Drive]) -> None:
    """Refuse another latency of a servo, which says how many setpoints are on their way to it."""
    for link, a, b in zip(vehicle.links, old, new, strict=False):
        if isinstance(a, Servo) and isinstance(b, Servo) and a.latency != b.latency:
            words = "must be as the session began, since setpoints are on their way"
            raise ScenarioError(f"{root}.drives.{link.joint.name}.latency = {shown(b.latency)}: {words}")
