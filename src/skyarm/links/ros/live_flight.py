"""Flight at real time with live ROS topics."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import closing

from skyarm.cli.lines import say
from skyarm.links.ros import open_node
from skyarm.links.ros.node import Node, RosError
from skyarm.links.ros.ros_link import RosLink, Warn, goal_topics, open_live
from skyarm.log.flight_log import Log
from skyarm.records.immutable import immutable
from skyarm.scenario.scenario_record import Scenario

MOST_LATE = 0.25
"""Longest delay (s of wall time) that is made up for; after a longer pause the flight
stays late."""

TOLD = 0.1
"""Wall time (s) between two updates of the progress display."""

SOON = 0.005
"""Lateness (s) that is attributed to the system's clock and not counted."""


class Pace:
    """Pacing clock that starts each control period at its time on the wall clock.

    Args:
        speed: flight time over wall time; infinite waits for nothing.

    Attributes:
        late: s of wall time by which the flight has fallen behind, beyond what it
            caught up.
    """

    def __init__(self, speed: float) -> None:
        self._speed, self._origin = speed, math.nan
        self.late = 0.0

    def wait(self, flight_time: float) -> None:
        """Sleep until the wall clock has reached a given flight time (s)."""
        if math.isinf(self._speed):
            return
        now = time.perf_counter()
        # the first period sets the origin, since compiling has taken its time before
        if math.isnan(self._origin):
            self._origin = now - flight_time / self._speed
        behind = now - (self._origin + flight_time / self._speed)
        if behind < 0.0:
            time.sleep(-behind)
        elif behind > MOST_LATE:
            # what cannot be caught up becomes a later origin
            self._origin += behind
            self.late += behind


@immutable
class LiveFlight:
    """Result of a flight with live ROS topics: log, counts of commands and goals, and
    delay.

    Attributes:
        log: log of the flight.
        commanded: periods flown under commands from ROS.
        goals: taken from ROS.
        late: s by which it was slower than its pace.
        interrupted: exception that ended it from outside (Ctrl-C), to be raised again
            once the log is written; else None.
    """

    log: Log
    commanded: int
    goals: int
    late: float
    interrupted: BaseException | None

    @property
    def facts(self) -> dict[str, float]:
        """ROS version, counts of commands and goals, and delay (s), by their keys in
        the JSON document.
        """
        return {
            "version": 2,
            "commanded": self.commanded,
            "goals": self.goals,
            "late_s": self.late,
        }

    @property
    def lines(self) -> list[str]:
        """Sentences on the ROS commands and goals of the flight, and on its delay."""
        rate = float(self.log.info["rates_hz"]["control"])
        lines: list[str] = []
        if self.commanded:
            seconds = self.commanded / rate
            lines.append(
                f"ROS 2: commanded from outside for {seconds:g} s, which no scenario"
                " repeats"
            )
        if self.goals:
            lines.append(f"ROS 2: goals taken: {self.goals}")
        if self.late > SOON:
            lines.append(
                f"ROS 2: {self.late:.3g} s behind its pace; --pace makes it slower"
            )
        return lines


def fly_with_topics(
    scenario: Scenario,
    version: int,
    *,
    pace: float,
    advance: Callable[[int, int], object],
    preparing: Callable[[float, float], object],
) -> LiveFlight:
    """Fly a scenario for ``skyarm run --ros``.

    Raises:
        ValueError: a pace below 0, another version than 2, or its library is missing.
    """
    if not 0.0 <= pace < math.inf:
        raise ValueError(f"--pace = {pace:g}: must be a finite number, 0 or above")
    return fly_live(
        scenario,
        open_node(version),
        # 0 on the command line: as fast as it can
        pace=pace or math.inf,
        advance=advance,
        preparing=preparing,
        warn=lambda line: say(f"warning: {line}"),
    )


def fly_live(
    scenario: Scenario,
    node: Node,
    *,
    pace: float = 1.0,
    advance: Callable[[int, int], object] = lambda _done, _total: None,
    preparing: Callable[[float, float], object] | None = None,
    warn: Warn,
) -> LiveFlight:
    """Fly a scenario with live ROS topics; the node is closed at the end, even after an
    error.

    Args:
        scenario: scenario to fly.
        node: node of ROS.
        pace: flight time over wall time; infinite waits for nothing.
        advance: is called with the periods flown and their number some times a second.
        preparing: function as of :func:`skyarm.simulate.session.open_session`.
        warn: is told in one line of messages that are refused.
    """
    interrupted: BaseException | None = None
    clock = Pace(pace)
    try:
        session, reasons = open_live(scenario, preparing)
        if session.slow:
            warn(f"{session.slow}; flying as Python floats: slower, the same numbers")
        for name, reason in reasons.items():
            topics = goal_topics(scenario, name)
            warn(
                f"no goals are taken on {' and '.join(topics)}, since of the reference"
                f" {reason}"
            )
        with closing(session):
            link = RosLink(session, node, warn=warn)
            try:
                _fly(link, clock, advance)
            # ROS may be lost in flight, what was flown is not
            except RosError as error:
                warn(f"{error}; the flight ends after {session.time:g} s")
            except Exception:
                raise
            except BaseException as error:
                # Ctrl-C and signals: they go on once the log is written
                interrupted = error
            log = session.log
    finally:
        node.close()
    return LiveFlight(
        log=log,
        commanded=link.commanded,
        goals=link.goals,
        late=clock.late,
        interrupted=interrupted,
    )


def _fly(link: RosLink, clock: Pace, advance: Callable[[int, int], object]) -> None:
    """Simulate a session with ROS topics, paced by a clock, until it ends."""
    session, reported = link.session, -math.inf
    while session.running:
        clock.wait(session.time)
        link.step()
        if time.perf_counter() - reported > TOLD or not session.running:
            reported = time.perf_counter()
            advance(session.tick, session.scenario.steps)
