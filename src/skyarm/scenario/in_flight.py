"""Scheduled changes during a flight: parameters or whole sections of the scenario, such
as the law, are replaced.

Changes replace, they do not add up: at any instant the scenario is the one that began,
with each path's latest value in the place of its own. A load that a change sets is
therefore the load on top of what the vehicle carried at the start, whatever was set in
between. A part that is replaced as a whole takes the changes below it along: a law that
is changed begins with gains of its own. Parts are replaced first, then numbers.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache

from skyarm.control.actuator_layer import believed_drives, measured_places
from skyarm.control.controller import autopilot_of
from skyarm.dynamics.actuators import AllocationError
from skyarm.records.files import did_you_mean, errors_as, shown
from skyarm.records.immutable import positional
from skyarm.records.leaves import Place, replace_at
from skyarm.records.path_names import agent_of, word_of
from skyarm.records.words import Slot, slots
from skyarm.reference import trajectory_from
from skyarm.reference.path_time import PLANNED
from skyarm.scenario import readers
from skyarm.scenario.document import PartDocument
from skyarm.scenario.numbers import (
    declared_at,
    is_added,
    is_same_load,
    means_the_same,
    number_at,
    require_apart,
    with_numbers,
)
from skyarm.scenario.paths import (
    alone,
    by_agent,
    delay_words,
    errors_of_agent,
    is_below,
    path_of,
    place_of_delay,
    prefix_of,
    roots,
    variable_words,
)
from skyarm.scenario.payload_tables import require_events_as_begun, scheduled_changes
from skyarm.scenario.readers import LAW
from skyarm.scenario.scenario_checks import check_scenario
from skyarm.scenario.scenario_record import Change, Scenario, ScenarioError, in_order


@cache
def whole_parts() -> dict[str, Slot]:
    """Paths of sections that a scheduled change may replace as a whole, each with the
    declaration of its file key.
    """
    by_path: dict[str, Slot] = {}
    for slot in slots(Scenario):
        if slot.word.whole:
            by_path |= {slot.path: slot} | {
                f"{slot.path}.{entry}": slot for entry, _ in slot.word.entries
            }
    return by_path


def with_part(scenario: Scenario, path: str, value: object) -> Scenario:
    """Scenario with one whole section of its file, such as [controller] or the wind,
    replaced.

    Args:
        scenario: scenario with the model and clocks of a new law.
        path: one of :func:`whole_parts`.
        value: entry of a scenario file in its place: tables are dicts, lists lists.

    Raises:
        ValueError: one line with the path, the value and what is allowed.
    """
    # of several vehicles each is changed as the only one of its own flight, below
    if scenario.is_team:
        changed = by_agent(
            scenario,
            {path: value},
            lambda one, own: with_part(one, *next(iter(own.items()))),
        )
        check_scenario(changed)
        return changed
    scenario, path = alone(scenario, path)
    model = scenario.agent.model
    with errors_as(
        ValueError, f"model.vehicle = {model.vehicle.name!r}: ", AllocationError
    ):
        fields = _fields_of_part(scenario, path, value)
        changed = replace_at(scenario, fields)
        check_scenario(changed, fields)
        return changed


def _fields_of_part(
    scenario: Scenario, path: str, value: object
) -> dict[Place, object]:
    """New values of scenario fields, by path, if a section of the scenario file, such
    as the wind, is replaced.
    """
    slot = whole_parts()[path]
    document = PartDocument(slot.path, value, scenario)
    if path == LAW:
        return {slot.field: readers.law(scenario, value)}
    if path != slot.path:
        fixed = (
            "must stay as it is where the reference has a tip"
            if scenario.agent.reference.tip is not None
            else ""
        )
        fixed = PLANNED if scenario.agent.path_time is not None else fixed
        if fixed:
            raise ValueError(
                f"{path} = {shown(value)}: {fixed}; replace reference as a whole"
            )
        entry = path.removeprefix(f"{slot.path}.")
        trajectory = trajectory_from(
            {entry: value}, scenario.agent.vehicle.n, "reference", document.setting
        )
        require_events_as_begun(scenario, document.setting.events)
        return {
            (*slot.field, name): getattr(trajectory, name)
            for name in dict(slot.word.entries)[entry]
        }
    fields = document.planned_fields()
    require_events_as_begun(scenario, document.setting.events)
    return fields


@positional
class Overrides:
    """Replacements made by scheduled changes so far: pairs of parameter path, such as
    plant.gravity, and value.

    Attributes:
        parts: whole parts, as a file has them. numbers: changed numbers by path.
    """

    parts: tuple[tuple[str, object], ...] = ()
    numbers: tuple[tuple[str, float], ...] = ()

    def with_change(self, change: Change) -> Overrides:
        """Overrides with one more scheduled change, which replaces an earlier one of
        the same parameter.
        """
        path, value = change.path, change.table
        if not is_part(path, value):
            others = tuple(pair for pair in self.numbers if pair[0] != path)
            return Overrides(self.parts, (*others, (path, value)))
        parts = tuple(pair for pair in self.parts if not _replaces(path, pair[0]))
        numbers = tuple(pair for pair in self.numbers if not _replaces(path, pair[0]))
        return Overrides((*parts, (path, value)), numbers)

    def data(self, scenario: Scenario, paths: Sequence[str] = ()) -> Overrides:
        """Overrides in a canonical order, which depends on the order of the changes
        only where that has an effect.

        Args:
            scenario: scenario at the beginning of the flight.
            paths: paths whose numbers are read too where nothing holds in their place,
                as far as there are any.
        """
        parts = self.parts_of(scenario)
        numbers = dict(self.numbers)
        for path in paths:
            if not self.holds(parts, path):
                with suppress(ScenarioError):
                    numbers[path] = number_at(parts, path)
        numbers |= self._measured_limits(scenario, numbers)
        # loads add up, and sums depend on their order; of two paths of one number the
        # later counts
        if sum(is_added(parts, path) for path in numbers) <= 1:
            with suppress(ScenarioError):
                require_apart(parts, tuple(numbers))
                numbers = dict(sorted(numbers.items()))
        return Overrides(self.parts, tuple(numbers.items()))

    def _measured_limits(
        self, scenario: Scenario, numbers: Mapping[str, float]
    ) -> dict[str, float]:
        """Limits of safety layers, by path, that follow from gains among the numbers;
        traced code measures none.
        """
        gains = [
            path for path in numbers if is_below(word_of(path), "controller.inner")
        ]
        if not gains:
            return {}
        changed = Overrides(self.parts, tuple(numbers.items())).of(scenario)
        # of gains of the only vehicle no path has a prefix
        owners = {path.removesuffix(word_of(path)) for path in gains}
        limits: dict[str, float] = {}
        for name in changed.agents:
            prefix = prefix_of(changed, name)
            if not prefix or prefix in owners:
                for path in measured_paths(changed, name):
                    limits[path] = number_at(changed, path)
        return limits

    def holds(self, scenario: Scenario, path: str) -> bool:
        """True if the parameter at a path is overridden, also under another name.

        Names of one place are faults.0 and faults.front, or payload.mass and that of
        the only payload.
        """
        if not self.numbers or path in dict(self.numbers):
            return path in dict(self.numbers)
        for own, _ in self.numbers:
            # a path may name what a replaced part has no more
            with suppress(ScenarioError):
                if means_the_same(scenario, own, path):
                    return True
        return False

    def hides(self, path: str) -> bool:
        """True if the overrides replace a parameter, or a whole section that contains
        the parameter.
        """
        gone = any(_replaces(own, path) for own, _ in self.parts)
        return gone or any(path == own for own, _ in self.numbers)

    def parts_of(self, scenario: Scenario) -> Scenario:
        """Scenario with overrides of whole sections applied; single parameters and
        scheduled changes are left out.
        """
        scenario = scenario.as_begun
        for path, value in self.parts:
            scenario = with_part(scenario, path, value)
        return scenario

    def of(self, scenario: Scenario) -> Scenario:
        """Scenario with all overrides applied and without scheduled changes."""
        return with_numbers(self.parts_of(scenario), dict(self.numbers))

    def seen_of(self, scenario: Scenario) -> Scenario:
        """Scenario with the overrides that cameras see, numbers of world and vehicles,
        and without scheduled changes.
        """
        seen = ("world.", "plant.vehicle.")
        numbers = {
            path: value
            for path, value in self.numbers
            if word_of(path).startswith(seen)
        }
        return with_numbers(scenario.as_begun, numbers)


def measured_paths(scenario: Scenario, name: str) -> tuple[str, ...]:
    """Paths of the limits of a vehicle's safety layer that are measured on the law
    inside.
    """
    one = scenario.of(name)
    places = (
        ("agent", "controller", *place)
        for place in measured_places(one.agent.controller)
    )
    return tuple(prefix_of(scenario, name) + path_of(one, place) for place in places)


NONE = Overrides()
"""Empty overrides: no parameter differs from the start of the flight."""


def is_part(path: str, value: object) -> bool:
    """True if a scheduled change replaces a whole section, such as the controller, and
    not a single number.
    """
    # a yaw may be one number, or as a whole a signal
    word = word_of(path)
    return word in whole_parts() and (
        word != "reference.yaw" or isinstance(value, (str, bool, list, tuple, Mapping))
    )


def _replaces(part: str, path: str) -> bool:
    """True if replacing a section of a scenario also replaces the parameter at a given
    path.
    """
    # a law comes with its whole table, gains and layers
    law = word_of(part) == LAW and is_below(path, part.removesuffix(".law"))
    return is_below(path, part) or law


@positional
class Stretch:
    """Interval of control periods between two scheduled changes.

    Attributes:
        start: index of the first control period. overrides: changed values of the
            interval.
    """

    start: int
    overrides: Overrides


def stretches(scenario: Scenario) -> tuple[Stretch, ...]:
    """Split a flight into intervals between its scheduled changes; the first is empty
    for a change at t = 0.

    Changes after the end of the flight are ignored.
    """
    rate = scenario.rates.control
    intervals = [Stretch(0, Overrides())]
    for change in in_order(scheduled_changes(scenario), rate):
        tick = change.tick(rate)
        if tick >= scenario.steps:
            break
        following = Stretch(tick, intervals[-1].overrides.with_change(change))
        # changes of one period are one interval, but the beginning stays as it was
        if tick == intervals[-1].start and len(intervals) > 1:
            intervals[-1] = following
        else:
            intervals.append(following)
    return tuple(intervals)


def is_traceable(scenario: Scenario) -> bool:
    """True if machine code can fly a whole flight: all its laws can be traced, and none
    is an external autopilot.
    """
    flown = [stretch.overrides.parts_of(scenario) for stretch in stretches(scenario)]
    laws = [each.controller for one in flown for each in one.agents.values()]
    return all(law.compiled and autopilot_of(law) is None for law in laws)


def overrides_at(scenario: Scenario, tick: int) -> Overrides:
    """Overrides by scheduled changes that apply in a given control period."""
    return [stretch for stretch in stretches(scenario) if stretch.start <= tick][
        -1
    ].overrides


def sources(scenario: Scenario, tick: int) -> dict[str, int]:
    """For each parameter changed up to a control period: index of the scheduled change
    that set it.
    """
    rate = scenario.rates.control
    numbers = dict(overrides_at(scenario, tick).numbers)
    made = sorted(
        (change.tick(rate), i, change.path)
        for i, change in enumerate(scheduled_changes(scenario))
    )
    # in the order of time, so that the last change of a path stays
    return {path: i for at, i, path in made if at <= tick and path in numbers}


@cache
def what_may() -> str:
    """Text that lists all parameters and sections that may change in flight."""
    numbers = [
        slot.path
        for slot in slots(Scenario)
        if slot.word.varies == "always" and slot.path in variable_words()
    ]
    delays = ", ".join(delay_words())
    parts = ", ".join(whole_parts())
    return (
        f"what may is {delays}, a number of {', '.join(numbers)}, or as a whole {parts}"
    )


def require_changes(scenario: Scenario) -> None:
    """Raise an error if a scheduled change is invalid; changes are tested in order of
    time.

    Raises:
        ScenarioError: one line with the change, its path or its value, and what is
            allowed.
    """
    if changes := [
        (f"changes[{i}]", each) for i, each in enumerate(scheduled_changes(scenario))
    ]:
        _try_in_order(scenario, NONE.parts_of(scenario), NONE, changes)


def try_coming(
    begun: Scenario, now: Scenario, overrides: Overrides, coming: Sequence[Change]
) -> None:
    """Raise an error if a change made now would make a later scheduled change invalid.

    Args:
        begun: scenario at the beginning of the flight.
        now: present scenario.
        overrides: values changed until now.
        coming: changes to come.

    Raises:
        ScenarioError: one line.
    """
    _try_in_order(
        begun,
        now,
        overrides,
        [
            (f"after this the change at {each.at:g} s cannot be made", each)
            for each in coming
        ],
    )


def _try_in_order(
    begun: Scenario,
    now: Scenario,
    overrides: Overrides,
    changes: Sequence[tuple[str, Change]],
) -> None:
    """Test scheduled changes in order of time, those of one control period together."""
    rate = begun.rates.control

    def tick(named: tuple[str, Change]) -> int:
        return named[1].tick(rate)

    # the sort is stable, so changes of one period keep the order of the file
    for _, group in itertools.groupby(sorted(changes, key=tick), key=tick):
        overrides, now = try_changes(begun, now, overrides, list(group))


def try_changes(
    begun: Scenario,
    now: Scenario,
    overrides: Overrides,
    changes: Sequence[tuple[str, Change]],
) -> tuple[Overrides, Scenario]:
    """Apply simultaneous changes; return the new overrides and the resulting scenario.

    Args:
        begun: scenario at the beginning of the flight.
        now: scenario before them.
        overrides: values changed before them.
        changes: (what messages call it, change), in order.

    Raises:
        ScenarioError: one line.
    """
    following = overrides
    for where, change in changes:
        with _name_change_in_errors(where):
            _require_changeable(begun, change.path)
            if not is_part(change.path, change.value):
                _require_number(now, change)
                _require_one_load(
                    now, change.path, [path for path, _ in following.numbers]
                )
            following = following.with_change(change)
            if is_part(change.path, change.value):
                # a number that follows in the same period may lie in the new section
                now = following.of(begun)
    with _name_change_in_errors(changes[0][0] if len(changes) == 1 else ""):
        now = following.of(begun)
        require_continuous(begun, now)
    return following, now


@contextmanager
def _name_change_in_errors(where: str) -> Iterator[None]:
    """Context manager that puts the name of a scheduled change, such as changes[2],
    before error messages.
    """
    try:
        yield
    except ValueError as error:
        words = str(error)
        joint = (
            "."
            if where.endswith("]") and words.startswith(("path = ", "value = "))
            else ": "
        )
        raise ScenarioError(f"{where}{joint}{words}" if where else words) from None


def _require_changeable(scenario: Scenario, path: str) -> None:
    """Raise an error if a parameter or section of the scenario may not change during a
    flight.
    """
    one, word = alone(scenario, path)
    with errors_of_agent(agent_of(path) if word != path else ""):
        _require_changeable_word(one, word)


def _require_changeable_word(scenario: Scenario, path: str) -> None:
    """Raise an error if a parameter or section of a scenario of one vehicle may not
    change during a flight.
    """
    if path in whole_parts() or place_of_delay(scenario, path) is not None:
        return
    if path in delay_words():
        raise ScenarioError(
            f"path = {path!r}: delays.longest_command is missing; it bounds delays that"
            " change in flight"
        )
    fixed = [slot for slot in slots(Scenario) if slot.word.varies != "always"]
    for slot in fixed:
        if is_below(path, slot.path):
            raise ScenarioError(
                f"path = {path!r}: {slot.path} must be as the flight began;"
                f" {what_may()}"
            )
    starts = [
        start for start in roots(scenario) if start not in [slot.path for slot in fixed]
    ]
    if not any(path.startswith(f"{start}.") for start in starts):
        if path in starts:
            raise ScenarioError(
                f"path = {path!r}: must lead to a number below it; {what_may()}"
            )
        near = did_you_mean(path, whole_parts()) or did_you_mean(
            path.split(".", maxsplit=1)[0], starts
        )
        raise ScenarioError(
            f"path = {shown(path)}: {near}nothing of this name changes in flight;"
            f" {what_may()}"
        )


def _require_number(scenario: Scenario, change: Change) -> None:
    """Raise an error unless a change's path leads to a number and the change's value is
    a number.
    """
    try:
        number_at(scenario, change.path)
        if declared_at(scenario, change.path).begins:
            raise ScenarioError(
                f"path = {change.path!r}: must be as the flight began, where alone it"
                " is read"
            )
    except ScenarioError as error:
        # parts have one dot at most: a longer path was meant for a number
        near = (
            did_you_mean(change.path, whole_parts()).strip()
            if change.path.count(".") < 2
            else ""
        )
        raise ScenarioError(f"{error}; {near}" if near else str(error)) from None
    if type(change.value) is not float:
        raise ScenarioError(
            f"value = {shown(change.table)}: must be a number, as {change.path} is one"
        )


def _require_one_load(scenario: Scenario, path: str, changed: Sequence[str]) -> None:
    """Raise an error if two paths set the payload mass at one frame, because payload
    masses add up.
    """
    for other in changed:
        if other != path and is_same_load(scenario, path, other):
            raise ScenarioError(
                f"path = {path!r}: is the same load as {other!r}, must be changed by"
                " that name"
            )


def require_continuous(old: Scenario, new: Scenario) -> None:
    """Raise an error if a changed scenario differs in what is fixed for a flight, such
    as clock rates.

    Raises:
        ScenarioError: names it.
    """
    after = _held_by_all(new)
    for name, began in _held_by_all(old).items():
        value = after.get(name, began)
        if value != began:
            late = ""
            if name.startswith("sensors."):
                late = "readings"
            elif ".drives." in name:
                late = "setpoints"
            must = f"{name} = {shown(value)}: must be"
            if late:
                raise ScenarioError(
                    f"{must} as the session began, since {late} are on their way"
                )
            raise ScenarioError(f"{must} {shown(began)} as the session began")


def _held_by_all(scenario: Scenario) -> dict[str, object]:
    """Settings of all vehicles that must stay the same throughout a flight, by name."""
    return {
        prefix_of(scenario, name) + setting: value
        for name in scenario.agents
        for setting, value in _held_throughout(scenario.of(name)).items()
    }


def _held_throughout(scenario: Scenario) -> dict[str, object]:
    """Settings that must stay the same throughout a flight, by name, such as clocks,
    delays and sensor latencies.
    """
    vehicle, model = scenario.agent.vehicle, scenario.agent.model
    delays = scenario.agent.delays
    # those of the commands vary within a queue of that length
    if delays.longest_command is not None:
        delays = dataclasses.replace(delays, command=0.0, rotors=0, joints=0)
    settings: dict[str, object] = {
        "rates": scenario.rates,
        "duration": scenario.duration,
        "plant.kind": scenario.kind,
        "plant.integrator": scenario.integrator,
        "plant.closure": scenario.closure,
        "plant.contact": scenario.solver.contact,
        "delays": delays,
        "joints": vehicle.n,
        "rotors": len(vehicle.rotors),
    }
    for named in scenario.agent.sensors:
        settings |= {
            f"sensors.{named.name}.{each}": getattr(named.sensor, each)
            for each in ("frequency", "latency")
        }
    for root, links, drives in (
        ("plant", vehicle.links, scenario.agent.all_drives),
        ("model", model.vehicle.links, believed_drives(model)),
    ):
        # drives are none, or one for each joint
        for link, drive in zip(links, drives, strict=False):
            if hasattr(drive, "latency"):
                settings[f"{root}.drives.{link.joint.name}.latency"] = drive.latency
    return settings
