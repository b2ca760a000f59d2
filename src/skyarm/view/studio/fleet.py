"""Up to three simulated flights on one clock, equal but for their controllers, and
their log files.
"""

from __future__ import annotations

import bisect
import itertools
import math
import shlex
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from skyarm.control.catalogue import AUTOPILOTS, OWN, every_name
from skyarm.log.formats import save_log
from skyarm.records.files import require_writable, shown
from skyarm.records.path_names import agent_of, word_of
from skyarm.scenario.in_flight import overrides_at
from skyarm.scenario.numbers import number_at
from skyarm.scenario.paths import prefix_of
from skyarm.scenario.payload_tables import scheduled_changes
from skyarm.scenario.save import save_scenario
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import Agent, Scenario, ScenarioError, with_words
from skyarm.simulate.session import Session, Snapshot, open_session
from skyarm.vehicle import Vehicle
from skyarm.view.studio.clock import Clock
from skyarm.view.studio.knobs import LONGEST_DELAY, knobs_of
from skyarm.view.studio.sights import PlottedInstant, sights
from skyarm.world import NO_WIND, Fault, ForceWind, Gust

MOST = 3
"""Largest number of simultaneous flights."""

GUST = (2.0, 3.0)
"""Force (N) and duration (s) of the gust button, as in the paper's Case 2."""

BLOW = (10.0, 0.1)
"""Force (N) and duration (s) of the push button: 1 N s."""

OF_LAW = ("controller.", "model.")
"""Prefixes of parameter paths that belong to one flight; all others are shared by the
flights."""

LONGEST = 600.0
"""Longest flight (s) of the studio; longer scenarios, and those with a planned
reference, keep their own duration."""

SAMPLES = 20.0
"""Sampling rate (Hz) of the stored plots, chosen: a plot of 10 s has 200 points."""

LOG, SCENARIO = ".npz", ".toml"
"""Suffixes of saved flights and of their scenarios."""


def adjustable(plain: Scenario) -> Scenario:
    """Add wind, push, actuator faults and delay to a scenario, inactive until a slider
    sets them.
    """
    agents = {
        name: _adjustable(each, plain.kind) for name, each in plain.agents.items()
    }
    # a force of a single vehicle states no agent, as in its scenario file
    names = plain.agents if len(agents) > 1 else ("",)
    return with_words(
        plain,
        agents=agents,
        wind=ForceWind() if plain.wind == NO_WIND else plain.wind,
        forces=(
            *plain.forces,
            *(ForceWind(gust=Gust(duration=0.1), agent=name) for name in names),
        ),
    )


def _adjustable(agent: Agent, kind: str) -> Agent:
    """Add inactive actuator faults and, where the plant's kind of simulator varies it,
    the delay to a vehicle.
    """
    vehicle = agent.vehicle
    faults = [Fault(rotor=rotor.name) for rotor in vehicle.rotors]
    faults += [Fault(joint=joint.name) for joint in vehicle.joints]
    # a slider has the path of its fault: a name that two share would be ambiguous
    names = [fault.name for fault in (*agent.faults, *faults)]
    faults = [fault for fault in faults if names.count(fault.name) == 1]
    delays = agent.delays
    if (
        kind == "rigid_body"
        and agent.controller.compiled
        and delays.longest_command is None
    ):
        delays = replace(delays, longest_command=max(delays.longest, LONGEST_DELAY))
    return replace(agent, faults=(*agent.faults, *faults), delays=delays)


def pushes_of(scenario: Scenario) -> dict[str, str]:
    """Path of the push on each vehicle of an adjustable scenario, by the vehicle's
    name.
    """
    begin = len(scenario.forces) - len(scenario.agents)
    return {
        name: f"environment.forces.{begin + i}"
        for i, name in enumerate(scenario.agents)
    }


def is_of_law(path: str) -> bool:
    """True for a parameter path of a law or its model, which belongs to one flight."""
    return word_of(path).startswith(OF_LAW)


class Fleet(Clock):
    """Simultaneous flights of one scenario under different controllers, on one clock.

    Args:
        source: name or file of the scenario.

    Raises:
        ScenarioError: one line: not a scenario.
    """

    def __init__(self, source: str) -> None:
        super().__init__()
        plain = load_scenario(source)
        self.source = source
        self.planned = True
        self._duration = plain.duration
        # a scenario that cannot last longer ends where its file says
        with suppress(ValueError):
            longest = max(plain.duration, LONGEST)
            longer = load_scenario(source, duration=longest)
            pairs = zip(plain.agents.values(), longer.agents.values(), strict=True)
            # a longer duration must leave reference and path as they are
            if all(
                (a.reference, a.path_time) == (b.reference, b.path_time)
                for a, b in pairs
            ):
                self.planned = False
                self._duration = longest
        self.scenario = self.under(None)
        self.flights: list[Flight] = []

    def under(self, law: str | None) -> Scenario:
        """Load the scenario with a controller given by name; None keeps the scenario's
        own controller.

        Raises:
            ScenarioError: no such law, or one that does not fit the vehicle.
        """
        return adjustable(
            load_scenario(self.source, controller=law, duration=self._duration)
        )

    def make_flight(self, law: str | None) -> Flight:
        """Create a flight under a controller; compiling it takes a while."""
        return Flight(None if law == OWN else law, self.under(law))

    @property
    def rate(self) -> int:
        """Control rate, Hz."""
        return self.scenario.rates.control

    @property
    def steps(self) -> int:
        """Number of control periods of the longest flight."""
        return self.scenario.steps

    def join(self, flight: Flight, place: int | None = None) -> None:
        """Add a flight and simulate it up to the current time, with the user's
        parameter changes so far.

        Args:
            flight: at its first period.
            place: place of the flight that it replaces; None adds one.

        Raises:
            ScenarioError: there are as many as there can be.
        """
        if place is None and len(self.flights) == MOST:
            raise ScenarioError(f"laws = {MOST + 1}: must be at most {MOST} at once")
        # of the first flight nothing was changed yet
        other = self.flights[place or 0] if self.flights else flight
        try:
            for number, values in other.moved.items():
                shared = {
                    path: value for path, value in values.items() if not is_of_law(path)
                }
                tick = flight.tick_at(number / other.rate)
                flight.to(tick)
                if shared and flight.tick == tick and flight.session.running:
                    flight.move(shared)
            flight.to(flight.tick_at(self.time))
        # Ctrl-C, too: nobody else has the flight yet that would close it
        except BaseException:
            flight.session.close()
            raise
        if place is None:
            self.flights.append(flight)
        else:
            self.flights[place].session.close()
            self.flights[place] = flight

    def leave(self, place: int) -> None:
        """Remove a flight, unless it is the last one."""
        if len(self.flights) > 1:
            self.flights[place].session.close()
            del self.flights[place]

    def close(self) -> None:
        """Close all flights, which ends programs that they have started, such as
        autopilots.
        """
        for flight in self.flights:
            flight.session.close()

    def move(self, values: Mapping[str, float], place: int | None = None) -> None:
        """Change parameters of one flight or of all flights, from the next control
        period on.

        Raises:
            ScenarioError: a number that cannot be.
        """
        for flight in self.flights if place is None else [self.flights[place]]:
            if flight.session.running:
                flight.move(values)
        # the later part of the plan is another one: changes begin a new branch
        self.furthest = self.tick

    def push(
        self, direction: Sequence[float], force: float, seconds: float, agent: str
    ) -> None:
        """Apply a force (N) on a vehicle's base for some seconds from now on.

        Args:
            direction: unit vector, world axes.
            force: N.
            seconds: s.
            agent: name of the vehicle.
        """
        peak = {
            f"peak.{axis}": force * float(c)
            for axis, c in zip("xyz", direction, strict=True)
        }
        gust = {**peak, "start": self.time, "duration": seconds}
        self.move(
            {
                f"{pushes_of(self.scenario)[agent]}.gust.{name}": value
                for name, value in gust.items()
            }
        )

    def go(self, tick: int) -> None:
        """Go forward or back to a given control period."""
        super().go(tick)
        for flight in self.flights:
            flight.to(flight.tick_at(self.time))

    def reset(self) -> None:
        """Restart all flights and discard the user's changes."""
        for flight in self.flights:
            flight.begin()
        super().reset()

    def save(self, folder: Path) -> str:
        """Write a log and a scenario file of each flight to new files; returns the
        commands that repeat the flights.

        A flight that no scenario file can say, as one of a log, is repeated from its
        own log.

        Raises:
            ScenarioError: nothing has been flown yet. OSError: a file cannot be
                written.
        """
        if not self.tick:
            raise ScenarioError(
                "time = 0 s: must be above 0; nothing has been flown yet that could be"
                " saved"
            )
        require_writable(str(folder))
        written, without = [], []
        for flight in self.flights:
            # a file of gains is named by its path
            name = f"{self.scenario.name}_{Path(flight.title).stem}"
            # names of files that exist are skipped: nothing is overwritten
            ends = itertools.chain([""], (f"_{k}" for k in itertools.count(1)))
            pairs = (
                (folder / f"{name}{end}{LOG}", folder / f"{name}{end}{SCENARIO}")
                for end in ends
            )
            log, file = next(
                pair for pair in pairs if not any(path.exists() for path in pair)
            )
            save_log(flight.session.log, log)
            # a vehicle that is lost is lost again in the period after its last one
            seconds = (flight.tick + (1 if flight.lost else 0)) / flight.rate
            plan = flight.session.plan
            try:
                shortened = plan if self.planned else replace(plan, duration=seconds)
                saved = save_scenario(file, shortened, self.source, flight.law)
                written.append(f"skyarm run {shlex.quote(str(saved))}")
            except ScenarioError as error:
                without.append(f"; no file of the scenario: {error}")
                duration = "" if self.planned else f" --duration {seconds:g}"
                written.append(f"skyarm run {shlex.quote(str(log))}{duration}")
        return "saved; fly it again: " + ", ".join(written) + "".join(without)


def law_names() -> list[str]:
    """Names of all controllers: "own" of the scenario's, and as in its file."""
    return [OWN, *every_name(), *AUTOPILOTS]


def open_fleet(source: str, laws: Sequence[str]) -> Fleet:
    """Create the flights' common scenario and check that each controller can fly it.

    Raises:
        ScenarioError: one line.
    """
    if len(laws) > MOST:
        raise ScenarioError(
            f"--laws = {shown(list(laws))}: must be at most {MOST} laws at once"
        )
    fleet = Fleet(source)
    for law in laws:
        fleet.under(law)
    return fleet


class Flight:
    """Simulated flight that steps forward and back, and repeats the user's parameter
    changes at their times.

    A change at an instant takes the place of all that were made later: the flight goes
    another way from there.

    Args:
        law: name that it is chosen by; None is the scenario's own.
        scenario: adjustable, under the law.

    Attributes:
        moved: control periods flown -> path -> value of the numbers that the user
            changed then.
        agents: each vehicle by name.
    """

    def __init__(self, law: str | None, scenario: Scenario) -> None:
        self.law = law
        self.first = scenario
        self.title = law or scenario.law_names
        pushes = pushes_of(scenario).values()
        self.knobs = knobs_of(scenario, pushes)
        numbers = ("peak.x", "peak.y", "peak.z", "start", "duration")
        self._paths = [knob.path for knob in self.knobs]
        self._paths += [f"{push}.gust.{name}" for push in pushes for name in numbers]
        self.session = _session(scenario, self._paths)
        self.moved: dict[int, dict[str, float]] = {}
        self.agents = {name: FlownAgent(self, name) for name in scenario.agents}
        self._every = max(1, round(self.rate / SAMPLES))
        self._snapshots: list[Snapshot] = []
        self._record()

    @property
    def tick(self) -> int:
        """Number of simulated control periods."""
        return self.session.tick

    @property
    def rate(self) -> int:
        """Control rate of the flight (Hz), which under an autopilot may differ from the
        other flights'.
        """
        return self.session.scenario.rates.control

    def tick_at(self, time: float) -> int:
        """Number of control periods up to a time (s)."""
        return round(time * self.rate)

    @property
    def lost(self) -> str:
        """Reason why the vehicle crashed or diverged; empty while it flies."""
        ended = self.session.ended
        return "" if ended is None else ended.cause

    @property
    def numbers(self) -> dict[str, float]:
        """Present value of every number that the user or a scheduled change has set, by
        the path of the change.
        """
        return dict(overrides_at(self.session.plan, self.tick).numbers)

    @property
    def values(self) -> Mapping[str, float]:
        """Present value of every parameter that differs from the scenario's or was set,
        by parameter path.
        """
        values = self.numbers
        now = self.session.scenario
        # numbers under another path, in replaced parts, or that follow from those
        if self.due or values:
            for knob in self.knobs:
                with suppress(ScenarioError):
                    if (
                        knob.path not in values
                        and (value := number_at(now, knob.path)) != knob.value
                    ):
                        values[knob.path] = value
        return values

    @property
    def due(self) -> int:
        """Number of scheduled changes that have fallen due."""
        return sum(
            change.tick(self.rate) <= self.tick
            for change in scheduled_changes(self.first)
        )

    def move(self, values: Mapping[str, float]) -> None:
        """Change parameters of this flight from the next control period on.

        Raises:
            ScenarioError: a number that cannot be; nothing is changed then.
        """
        now = self.tick
        self.session.change(values)
        self.moved = {tick: made for tick, made in self.moved.items() if tick <= now}
        self.moved.setdefault(now, {}).update(
            {path: float(value) for path, value in values.items()}
        )
        # what was flown beyond this instant was flown with other numbers
        self._snapshots = [
            snapshot for snapshot in self._snapshots if snapshot.tick <= now
        ]
        for agent in self.agents.values():
            agent.sights = [seen for seen in agent.sights if seen.tick <= now]

    def step(self) -> bool:
        """Simulate one control period; False once the flight has ended."""
        going = self.session.running and self.session.step()
        if going:
            self._repeat()
            self._record()
        return going

    def begin(self) -> None:
        """Restart the flight with the scenario's parameters."""
        self.moved = {}
        for agent in self.agents.values():
            agent.sights = []
        if self.session.returns:
            self.session.restore(self._snapshots[0])
            self._snapshots = self._snapshots[:1]
        else:
            self.session.close()
            self.session = _session(self.first, self._paths)
        self._record()

    def to(self, tick: int) -> None:
        """Go to a control period: restore an earlier snapshot, then simulate forward.

        A flight that cannot go back, under an autopilot, waits until the clock has
        caught up with it.
        """
        if tick < self.tick and self.session.returns:
            at = (
                bisect.bisect_right(self._snapshots, tick, key=lambda each: each.tick)
                - 1
            )
            self.session.restore(self._snapshots[at])
            self._repeat()
        while self.tick < tick and self.step():
            pass

    def _repeat(self) -> None:
        """Apply the user's recorded parameter changes of the current control period
        again.
        """
        if values := self.moved.get(self.tick):
            self.session.change(values)

    def _record(self) -> None:
        """Store a snapshot every second, and plot samples at 20 Hz."""
        tick = self.tick
        due = tick % self.rate == 0 and self.session.returns
        if due and (not self._snapshots or self._snapshots[-1].tick < tick):
            self._snapshots.append(self.session.snapshot())
        before = next(iter(self.agents.values())).sights
        if tick % self._every == 0 and (not before or before[-1].tick < tick):
            for agent, seen in zip(
                self.agents.values(), sights(self.session), strict=True
            ):
                agent.sights.append(seen)


class FlownAgent:
    """One vehicle of a flight in the studio, with the quantities of its plots and its
    sliders.

    Args:
        flight: flight of all vehicles.
        name: name of the vehicle.

    Attributes:
        first: scenario of its flight alone, as it began.
        title: name of the flight, and of several vehicles its own.
        sights: plotted quantities, oldest first.
        own_knobs: adjustable parameters of the controller and its nominal model.
        shared_knobs: those of vehicle, reference and environment, common to all
            flights.
    """

    def __init__(self, flight: Flight, name: str) -> None:
        self.flight = flight
        self.first = flight.first.of(name)
        self._of = prefix_of(flight.first, name)
        self.title = f"{flight.title}, {name}" if self._of else flight.title
        self.sights: list[PlottedInstant] = []
        knobs = [each for each in flight.knobs if agent_of(each.path) in ("", name)]
        self.own_knobs = [each for each in knobs if is_of_law(each.path)]
        self.shared_knobs = [each for each in knobs if not is_of_law(each.path)]

    @property
    def vehicle(self) -> Vehicle:
        """Simulated vehicle of the plant."""
        return self.first.agent.vehicle

    @property
    def hung_mass(self) -> float:
        """Mass (kg) that the user attached to the tip."""
        return self.flight.numbers.get(f"{self._of}plant.payload.mass", 0.0)

    @property
    def last(self) -> PlottedInstant:
        """Latest plotted quantities up to the current time."""
        return self.sights[self._samples_until(self.flight.tick) - 1]

    def recent(self, seconds: float) -> list[PlottedInstant]:
        """Plotted quantities of the vehicle over its last seconds."""
        tick = self.flight.tick
        first = math.ceil(tick - seconds * self.flight.rate) - 1
        return self.sights[self._samples_until(first) : self._samples_until(tick)]

    def _samples_until(self, tick: int) -> int:
        """Number of stored plot samples up to and including a control period."""
        return bisect.bisect_right(self.sights, tick, key=lambda each: each.tick)


def _session(scenario: Scenario, paths: Sequence[str]) -> Session:
    """Create a simulation session in which the given parameters are adjustable."""
    scheduled = [
        change.path
        for change in scheduled_changes(scenario)
        if isinstance(change.value, float)
    ]
    if scenario.autopilot is not None:
        # a number of the sensors compiles anew when it is moved: those that the
        # autopilot adds have other draws
        return open_session(
            scenario, [path for path in paths if not path.startswith("sensors.")]
        )
    # refused where a change names a number of the paths in another way
    with suppress(ScenarioError):
        return Session(scenario, tuple(dict.fromkeys((*paths, *scheduled))))
    return Session(scenario, paths)
