"""Up to three laws at once, from one seed: flights that share a clock and everything but the law."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.studio.documents import Prepared, prepare, read_document
from skyarm.studio.flight import Flight
from skyarm.studio.knobs import Knob, knobs_of

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
    """Flights beside each other.

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
    """Knobs of what every flight meets: all but those of the law and of what it believes."""
    return tuple(k for k in knobs_of(prepared.scenario, prepared.push) if not k.path.startswith(OF_LAW))


def law_knobs(flight: Flight, prepared: Prepared) -> tuple[Knob, ...]:
    """Knobs of a flight's own law and belief."""
    return tuple(k for k in knobs_of(flight.first, prepared.push) if k.path.startswith(OF_LAW))
