"""Up to three laws at once, from one seed: flights that share a clock and everything but the law; their files."""

from __future__ import annotations

import bisect
import contextlib
import copy
import itertools
import math
import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from skyarm.control.catalogue import LAWS, PRESETS, TUNED, tuned_factors
from skyarm.records.files import must_be_one_of, read_toml, require_writable, shown, write_atomically
from skyarm.records.files.toml import toml_text
from skyarm.scenario.controller_table import law_table
from skyarm.scenario.scenario_file import LIBRARY, list_scenarios, load_scenario, scenario_from
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.simulate.session import Session
from skyarm.vehicle.vehicle_files import list_vehicles
from skyarm.vehicle.vehicle_records import Vehicle
from skyarm.view.studio.knobs import Knob, knobs_of
from skyarm.view.studio.sights import Load, Sight, goal_of, held_loads, sight
from skyarm.world.scene.vehicle_shapes import Placed, place

MOST = 3
"""Flights at once."""

SPEEDS = (0.25, 0.5, 1.0, 2.0, 4.0)

LONGEST_STRETCH = 0.25
"""s of wall time that are caught up at most: after a pause of the machine the flight goes on from where it was."""

GUST = (2.0, 3.0)
"""N and s of the gust button, those of the paper's Case 2."""

BLOW = (10.0, 0.1)
"""N and s of the push button: 1 N s."""

OF_LAW = ("controller.", "model.")
"""Beginnings of paths that are a flight's own; all others are of what every flight meets."""


class Fleet:
    """Flights side by side.

    Args:
        prepared: what they fly. source: name or file of the scenario.
    """

    def __init__(self, prepared: Prepared, source: str) -> None:
        self.prepared, self.source = prepared, source
        self.flights: list[Flight] = []
        self.tick, self.playing, self.speed = 0, True, 1.0
        self.furthest = 0
        self._due = 0.0

    @property
    def rate(self) -> int:
        """Control periods per second."""
        return self.prepared.scenario.rates.control

    @property
    def time(self) -> float:
        """Time of the flight, s."""
        return self.tick / self.rate

    @property
    def steps(self) -> int:
        """Control periods of the longest flight."""
        return self.prepared.scenario.steps

    def join(self, flight: Flight, place: int | None = None) -> None:
        """Let a flight take part: it meets what the others met, up to now.

        Args:
            flight: at its first period.
            place: of the flight that it takes the place of; None adds one.

        Raises:
            ScenarioError: there are as many as there can be.
        """
        if place is None and len(self.flights) == MOST:
            raise ScenarioError(f"laws = {MOST + 1}: must be at most {MOST} at once")
        shared: dict[int, dict[str, float]] = {}
        for each in self.flights[0 if place is None else place].moved if self.flights else ():
            if not each.path.startswith(OF_LAW):
                shared.setdefault(each.tick, {})[each.path] = each.value
        for tick, values in shared.items():
            flight.to(tick)
            if flight.tick == tick and flight.session.running:
                flight.move(values)
        flight.to(self.tick)
        if place is None:
            self.flights.append(flight)
        else:
            self.flights[place] = flight

    def leave(self, place: int) -> None:
        """Take a flight out; the last one stays."""
        if len(self.flights) > 1:
            del self.flights[place]

    def move(self, values: Mapping[str, float], place: int | None = None) -> None:
        """Change numbers from the next period on, of one flight or of all.

        Raises:
            ScenarioError: a number that cannot be.
        """
        for flight in self.flights if place is None else [self.flights[place]]:
            if flight.session.running:
                flight.move(values)
        self.furthest = self.tick

    def push(self, direction: Sequence[float], force: float, seconds: float) -> None:
        """A force on the base from now on, for a while: a push or a gust.

        Args:
            direction: world axes, of any length but zero.
            force: N.
            seconds: s.
        """
        length = sum(float(c) ** 2 for c in direction) ** 0.5
        peaks = [force * float(c) / length for c in direction]
        self.move(
            {
                **{f"{self.prepared.push}.gust.peak.{axis}": peak for axis, peak in zip("xyz", peaks, strict=True)},
                f"{self.prepared.push}.gust.start": self.time,
                f"{self.prepared.push}.gust.duration": seconds,
            }
        )

    def advance(self, seconds: float) -> None:
        """Fly on by what has passed on the wall, s, at the chosen speed."""
        if not self.playing:
            return
        self._due += min(seconds, LONGEST_STRETCH) * self.speed * self.rate
        ticks = int(self._due)
        self._due -= ticks
        self.go(self.tick + ticks)

    def go(self, tick: int) -> None:
        """Go to an instant, forward or back."""
        self.tick = min(max(tick, 0), self.steps - 1)
        for flight in self.flights:
            flight.to(self.tick)
        self.furthest = max(self.furthest, self.tick)
        if self.flights and self.tick == self.steps - 1:
            self.playing = False

    def step(self) -> None:
        """Stop, and fly one control period."""
        self.playing = False
        self.go(self.tick + 1)

    def reset(self) -> None:
        """Begin again: all that a hand changed is forgotten."""
        for flight in self.flights:
            flight.begin()
        self.tick = self.furthest = 0
        self._due, self.playing = 0.0, True


def load_fleet(source: str) -> Fleet:
    """A fleet of a scenario by name or file, without flights yet.

    Raises:
        ScenarioError: one line.
    """
    try:
        document, folder = read_document(source)
        return Fleet(prepare(document, folder), source)
    except (ValueError, OSError):
        load_scenario(source)  # refuses it with the name of the file
        raise


def make_flight(prepared: Prepared, law: str | None) -> Flight:
    """A flight under a law; machine code is made, which takes a while."""
    scenario = prepared.under(law)
    paths = [knob.path for knob in knobs_of(scenario, prepared.push)]
    return Flight(law, scenario, [*paths, *push_paths(prepared)])


def push_paths(prepared: Prepared) -> list[str]:
    """Numbers that the push and gust buttons move."""
    numbers = (*(f"peak.{axis}" for axis in "xyz"), "start", "duration")
    return [f"{prepared.push}.gust.{number}" for number in numbers]


def shared_knobs(prepared: Prepared) -> tuple[Knob, ...]:
    """Knobs of the surroundings, common to all flights: all but those of the law and its model."""
    return tuple(k for k in knobs_of(prepared.scenario, prepared.push) if not k.path.startswith(OF_LAW))


def law_knobs(flight: Flight, prepared: Prepared) -> tuple[Knob, ...]:
    """Knobs of a flight's law and its nominal model."""
    return tuple(k for k in knobs_of(flight.first, prepared.push) if k.path.startswith(OF_LAW))


def law_names() -> list[str]:
    """Every law by the names that a scenario file has for it."""
    return [*PRESETS, *LAWS, *(f"{law}{TUNED}" for law in tuned_factors())]


def fleet_under(source: str, laws: Sequence[str]) -> Fleet:
    """The fleet of a scenario, refused before a page is opened where it or one of the laws cannot be flown.

    Raises:
        ScenarioError: one line.
    """
    if len(laws) > MOST:
        raise ScenarioError(f"--controller = {shown(list(laws))}: must be at most {MOST} laws at once")
    fleet = load_fleet(source)
    for law in laws:
        if law not in law_names():
            raise ScenarioError(f"--controller = {shown(law)}: {must_be_one_of(law_names(), law)}")
        fleet.prepared.under(law)
    return fleet


SAMPLES = 20.0
"""Hz of what the plots keep."""

SNAPSHOTS = 240
"""Snapshots that are kept; beyond that every second one goes."""


@dataclass(frozen=True, slots=True)
class Moved:
    """A number that a hand changed.

    Attributes:
        tick: control periods flown before it holds. path, value: of the number.
    """

    tick: int
    path: str
    value: float


class Flight:
    """A flight that steps forward, and back; manual changes are repeated at their own periods.

    A change at an instant takes the place of all that were made later: the flight goes another way from there.

    Args:
        law: name that it is chosen by; None is the scenario's own.
        scenario: prepared, under the law.
        paths: numbers that are changed without compiling anew.
    """

    def __init__(self, law: str | None, scenario: Scenario, paths: Sequence[str]) -> None:
        self.law, self.first = law, scenario
        self.title = law or scenario.controller.name
        self.session: Session = _session(scenario, paths)
        self.moved: list[Moved] = []
        self.sights: list[Sight] = []
        self._every = max(1, round(scenario.rates.control / SAMPLES))
        self._apart = round(scenario.rates.control)
        self._kept: list[Any] = []
        self._note()
        self._start = self._kept[0]

    @property
    def tick(self) -> int:
        """Control periods flown."""
        return self.session.tick

    @property
    def lost(self) -> str:
        """Why the vehicle is lost, in words; empty while it flies."""
        ended = self.session.ended
        return "" if ended is None else ended.cause

    @property
    def values(self) -> Mapping[str, float]:
        """Every number that has been changed so far, as it is now."""
        return {moved.path: moved.value for moved in self.moved if moved.tick <= self.tick}

    @property
    def vehicle(self) -> Vehicle:
        """The plant's."""
        return self.first.plant.vehicle

    def poses(self) -> Placed:
        """Poses of the bodies now."""
        state = self.session.state
        return place(self.vehicle, tuple(state.position), tuple(state.quaternion), state.joints)

    def goal(self) -> Placed:
        """Desired poses of the bodies now."""
        return goal_of(self.vehicle, self.session.scenario.reference.at(self.session.time))

    @property
    def loads(self) -> tuple[Load, ...]:
        """Payloads that are held, and the mass that a hand has hung at the tip."""
        mass = self.values.get("plant.payload.mass", 0.0)
        found = held_loads(self.session.scenario.components, self.session.now.components)
        return (*found, Load(mass)) if mass > 0.0 else found

    @property
    def last(self) -> Sight:
        """The latest quantities up to now."""
        return self.sights[self._after(self.tick) - 1]

    def recent(self, seconds: float) -> list[Sight]:
        """Quantities of the last seconds."""
        first = math.ceil(self.tick - seconds * self.session.scenario.rates.control) - 1
        return self.sights[self._after(first) : self._after(self.tick)]

    def _after(self, tick: int) -> int:
        """Number of instants up to a control period."""
        return bisect.bisect_right(self.sights, tick, key=lambda each: each.tick)

    def move(self, values: Mapping[str, float]) -> None:
        """Change numbers from the next period on.

        Raises:
            ScenarioError: a number that cannot be; nothing is changed then.
        """
        now = self.tick
        self.session.change(values)
        kept = [each for each in self.moved if each.tick < now or (each.tick == now and each.path not in values)]
        self.moved = [*kept, *(Moved(now, path, float(value)) for path, value in values.items())]
        # what was flown beyond this instant was flown with other numbers
        self._kept = [snapshot for snapshot in self._kept if snapshot.tick <= now]
        self.sights = [seen for seen in self.sights if seen.tick <= now]

    def step(self) -> bool:
        """Fly one control period; False once the flight has ended."""
        if not self.session.running:
            return False
        going = self.session.step()
        if going:
            self._again()
            self._note()
        return going

    def begin(self) -> None:
        """Begin again, with the numbers of the scenario."""
        self.moved = []
        self.session.restore(self._start)
        self._kept, self.sights = [self._start], self.sights[:1]

    def to(self, tick: int) -> None:
        """Go to an instant: back by a snapshot, then forward by what was changed."""
        if tick < self.tick:
            at = bisect.bisect_right([snapshot.tick for snapshot in self._kept], tick) - 1
            self.session.restore(self._kept[max(at, 0)])
            self._again()
        while self.tick < tick and self.step():
            pass

    def _again(self) -> None:
        """Change what a hand changed at this instant before."""
        values = {each.path: each.value for each in self.moved if each.tick == self.tick}
        if values:
            self.session.change(values)

    def _note(self) -> None:
        """Store a snapshot and the plotted quantities, each at its own rate."""
        tick = self.tick
        if tick % self._apart == 0 and (not self._kept or self._kept[-1].tick < tick):
            self._kept.append(self.session.snapshot())
            if len(self._kept) > SNAPSHOTS:
                self._kept, self._apart = self._kept[::2], 2 * self._apart
        if tick % self._every == 0 and (not self.sights or self.sights[-1].tick < tick):
            self.sights.append(sight(self.session))


def _session(scenario: Scenario, paths: Sequence[str]) -> Session:
    """A session with every number adjustable, those of the scenario's changes too, where they do not overlap."""
    scheduled = [change.path for change in scenario.changes if isinstance(change.value, float)]
    with contextlib.suppress(ScenarioError):
        return Session(scenario, tuple(dict.fromkeys((*paths, *scheduled))))
    return Session(scenario, paths)


def saved_document(fleet: Fleet, flight: Flight, folder: Path) -> dict[str, Any]:
    """Tables of a scenario that 'skyarm run' flies to the bits of a flight, up to where it is now.

    Args:
        fleet: of the flight.
        flight: one of its.
        folder: where the file will lie.

    Raises:
        ScenarioError: nothing has been flown yet.
    """
    if not flight.tick:
        raise ScenarioError("time = 0 s: must be above 0; nothing has been flown yet that could be saved")
    # a vehicle that is lost is lost again in the period after its last one
    ticks = flight.tick + (1 if flight.lost else 0)
    moved = [each for each in flight.moved if each.tick < flight.tick]
    paths = {each.path for each in moved}
    document = flown_document(fleet.prepared, flight.law, ticks / fleet.rate, paths, folder)
    document["name"] = f"{fleet.prepared.scenario.name}_{flight.title}"
    document["title"] = f"{fleet.prepared.scenario.title or fleet.prepared.scenario.name}, flown by hand"
    # those of the file first: of one period they take hold before a hand moves anything
    changes = [*(each for each in document.pop("changes", ()) if each["at"] < document["duration"])]
    changes += [{"at": each.tick / fleet.rate, "path": each.path, "value": each.value} for each in moved]
    return {**document, "changes": changes} if changes else document


def save_flights(fleet: Fleet, folder: Path) -> str:
    """Write a scenario for each flight, without overwriting others; returns the commands that fly them, in words.

    Raises:
        ScenarioError: nothing has been flown yet. OSError: a file cannot be written.
    """
    require_writable(str(folder))
    written = []
    for flight in fleet.flights:
        document = saved_document(fleet, flight, folder)
        ends = itertools.chain([""], (f"_{k}" for k in itertools.count(1)))
        file = next(path for end in ends if not (path := folder / f"{document['name']}{end}.toml").exists())
        write_atomically(file, toml_text(document).encode())
        written.append(f"skyarm run {file}")
    return "saved; fly it again: " + ", ".join(written)


LONGEST = 600.0
"""s that a flight of the studio lasts at most; a scenario that is longer keeps its own duration, as one does whose
reference is planned for it."""

LONGEST_DELAY = 0.03
"""s: the longest delay of the commands that a slider gives."""


@dataclass(frozen=True, slots=True)
class Prepared:
    """A scenario that is ready for manual changes.

    Attributes:
        own: the file's tables. document: the same with what was added. folder: where its vehicle paths start.
        scenario: what the tables mean, under the file's own law.
        push: beginning of the paths of the push.
        planned: whether the reference depends on the duration of the file, which the flight and what is saved of it
            then keep.
    """

    own: Mapping[str, Any]
    document: Mapping[str, Any]
    folder: Path
    scenario: Scenario
    push: str
    planned: bool

    def under(self, law: str | None) -> Scenario:
        """The scenario under a law by name; None is the file's own.

        Raises:
            ScenarioError: no such law, or one that does not fit the vehicle.
        """
        return self.scenario if law is None else scenario_from(under_law(self.document, law), self.folder)


def read_document(name: str) -> tuple[dict[str, Any], Path]:
    """Tables of a scenario file or a shipped scenario, and its folder.

    Raises:
        ScenarioError: one line. OSError: no such file.
    """
    if name in list_scenarios():
        return read_toml((LIBRARY / f"{name}.toml").read_bytes()), Path()
    if Path(name).suffix != ".toml":
        raise ScenarioError(f"scenario = {shown(name)}: must be a .toml file or a name of a shipped scenario")
    return read_toml(Path(name).read_bytes()), Path(name).parent


def prepare(document: Mapping[str, Any], folder: str | os.PathLike[str] = "") -> Prepared:
    """Add the adjustable parts, as far as the scenario's plant and law allow them.

    Raises:
        ScenarioError: the document is no scenario.
    """
    plain = scenario_from(document, folder)
    planned = _is_planned(plain, document, folder)
    ready = copy.deepcopy(dict(document))
    if not planned:
        ready["duration"] = max(plain.duration, LONGEST)
    environment = ready.setdefault("environment", {})
    if environment.get("wind", {}).get("mode", "none") == "none":
        environment["wind"] = {"mode": "force_wind"}
    forces = environment.setdefault("forces", [])
    forces.append({"kind": "force_wind", "gust": {"peak": [0.0, 0.0, 0.0], "start": 0.0, "duration": 0.1}})
    environment["faults"] = [*environment.get("faults", []), *_faults(plain)]
    delays = ready.setdefault("delays", {})
    if plain.kind == "rigid_body" and plain.controller.compiled and "longest_command" not in delays:
        delays["longest_command"] = max(plain.delays.longest, LONGEST_DELAY)
    scenario, push = scenario_from(ready, folder), f"environment.forces.{len(forces) - 1}"
    return Prepared(document, ready, Path(folder), scenario, push, planned)


def _is_planned(plain: Scenario, document: Mapping[str, Any], folder: str | os.PathLike[str]) -> bool:
    """True if a longer flight has another reference or none: of joints, or with a path time planned ahead."""
    try:
        longer = scenario_from({**document, "duration": plain.duration + 1.0}, folder)
        return bool((plain.reference, plain.path_time) != (longer.reference, longer.path_time))
    except ValueError:
        return True


def _faults(scenario: Scenario) -> list[dict[str, Any]]:
    """A fault that takes nothing, for every actuator that has none."""
    known = {fault.name for fault in scenario.faults}
    vehicle = scenario.plant.vehicle
    actuators = [("rotor", rotor.name) for rotor in vehicle.rotors]
    actuators += [("joint", link.joint.name) for link in vehicle.links]
    names = [name for _, name in actuators]
    return [
        {kind: name, "effectiveness": 1.0, "start": 0.0}
        for kind, name in actuators
        if name not in known and names.count(name) == 1
    ]


def flown_document(
    prepared: Prepared, law: str | None, duration: float, paths: Collection[str], folder: Path
) -> dict[str, Any]:
    """The tables of what was flown: with the adjustable parts only where one of them was moved.

    Args:
        prepared: what was flown.
        law: by name; None is the file's own.
        duration: s that were flown; a reference that is planned keeps the duration that it was planned for.
        paths: numbers that were changed by hand.
        folder: where the tables are going to be written; paths of vehicles are made to start there.
    """
    added = any(path.startswith(("environment.", "delays.")) for path in paths)
    document = copy.deepcopy(dict(prepared.document if added else prepared.own))
    lasting = prepared.own["duration"] if prepared.planned else duration
    document = under_law({**document, "duration": lasting}, law)
    if lasting != prepared.own["duration"]:
        document.pop("windows", None)  # of another duration
    for table in ("plant", "model"):
        _move_vehicle(document.get(table, {}), prepared.folder, folder)
    return document


def under_law(document: Mapping[str, Any], law: str | None) -> dict[str, Any]:
    """The tables with a law by name in place of their own, if one is given; changes of the own one go."""
    if law is None:
        return dict(document)
    changes = [each for each in document.get("changes", ()) if each["path"].split(".", maxsplit=1)[0] != "controller"]
    return {**document, "changes": changes, "controller": law_table(law, document["controller"])}


def _move_vehicle(table: dict[str, Any], old: Path, new: Path) -> None:
    """Let the path of a vehicle's file start at another folder."""
    named = table.get("vehicle")
    if isinstance(named, str) and named not in list_vehicles():
        table["vehicle"] = os.path.relpath((old / named).resolve(), new.resolve())
