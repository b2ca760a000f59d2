"""Fly one episode: scenario in, log out."""

from __future__ import annotations

import warnings
from collections.abc import Callable

from skyarm.compile.machine_code import SlowFlightWarning
from skyarm.files import shown
from skyarm.log.flight_log import Log
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.simulate.session import Session

Progress = Callable[[int, int], None]

Keep = Callable[[int, Callable[[int, int], Log]], None]
"""(periods flown, function that gives the log of some of them, from the first to before the last)."""

SLOWER = "about 150 times slower per step, the same numbers"
"""Measured on the paper's vehicle; with the tracing, which both need, 10 s take ten times as long."""


class _Episode(Session):
    """A session without commands from outside."""

    _commands = False


def run(scenario: Scenario, progress: Progress | None = None, *, keep: Keep | None = None) -> Log:
    """Fly the scenario's episode and return its log.

    A diverging episode, a joint past its limit or ground contact ends the episode: the log's status, cause and end time
    say so. ``progress(done, total)`` is called about a hundred times. ``keep(done, between)`` is called now and then
    while the episode goes on: ``between(first, stop)`` is the log of these control periods, of status "running".

    The rigid-body plant flies in machine code, unless the law cannot be traced. Where that code cannot be made a
    warning says so, and the episode flies in Python: slower, the same numbers to the last bit.

    Changes in flight take hold in their control periods, as in a :class:`skyarm.Session` of the scenario.
    """
    return _fly(_Episode, scenario, progress, keep)


def run_in_python(scenario: Scenario, progress: Progress | None = None, *, keep: Keep | None = None) -> Log:
    """Fly an episode as :func:`run` does, in Python floats, on any plant and with any law."""
    return _fly(lambda each: _Episode(each, machine_code=False), scenario, progress, keep)


def _fly(make: Callable[[Scenario], Session], scenario: Scenario, progress: Progress | None, keep: Keep | None) -> Log:
    """The log of a session that is flown to its end."""
    if progress is not None and not callable(progress):
        raise ScenarioError(f"progress = {shown(progress)}: must be a function of periods flown and all")
    if keep is not None and not callable(keep):
        raise ScenarioError(f"keep = {shown(keep)}: must be a function of periods flown and of what gives their log")
    session = make(scenario)
    if session.slow:
        warnings.warn(f"{session.slow}; flying as Python floats: {SLOWER}", SlowFlightWarning, stacklevel=3)
    total, due = scenario.steps, 0
    every = max(1, total // 100)
    while True:
        if progress is not None and session.tick >= due:
            progress(session.tick, total)
            due = (session.tick // every + 1) * every
        if not session.fly(total if progress is None else min(total, due)):
            break
        if keep is not None:
            keep(session.tick, session.between)
    if progress is not None:
        progress(total, total)
    return session.log
