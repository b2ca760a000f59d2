"""Fly one episode: clock, sensors, controller, plant, log."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import cache

from skyarm.compile.machine_code import NoMachineCodeError, SlowFlightWarning
from skyarm.files import shown
from skyarm.log.flight_log import Log, rows_of
from skyarm.scenario.scenario_checks import require_flight
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.simulate import compiled_flight
from skyarm.simulate.assemble_log import Piece, Samples, assemble, describe, joined
from skyarm.simulate.check_endings import RUNNING, Ended
from skyarm.simulate.inputs import EpisodeInputs, episode_inputs
from skyarm.simulate.session import Session
from skyarm.simulate.staged_flight import StagedFlight

Progress = Callable[[int, int], None]

Keep = Callable[[int, Callable[[int, int], Log]], None]
"""(periods flown, function that gives the log of some of them, from the first to before the last)."""

SLOWER = "about 150 times slower per step, the same numbers"
"""Measured on the paper's vehicle; with the tracing, which both need, 10 s take ten times as long."""


OFTEN = 0.25
"""s of flight between two calls of ``keep`` in Python."""


def run(scenario: Scenario, progress: Progress | None = None, *, keep: Keep | None = None) -> Log:
    """Fly the scenario's episode and return its log.

    A diverging episode, a joint past its limit or ground contact ends the episode: the log's status, cause and end time
    say so. ``progress(done, total)`` is called about a hundred times. ``keep(done, between)`` is called now and then
    while the episode goes on: ``between(first, stop)`` is the log of these control periods, of status "running".

    The rigid-body plant flies in machine code, unless the law cannot be traced. Where that code cannot be made a
    warning says so, and the episode flies in Python: slower, the same numbers to the last bit.

    Changes in flight take hold in their control periods, as in a :class:`skyarm.Session` of the scenario.
    """
    require_flight(scenario)
    if progress is not None and not callable(progress):
        raise ScenarioError(f"progress = {shown(progress)}: must be a function of periods flown and all")
    if keep is not None and not callable(keep):
        raise ScenarioError(f"keep = {shown(keep)}: must be a function of periods flown and of what gives their log")
    if scenario.changes:
        return _run_with_changes(scenario, progress, keep)
    if scenario.plant == "rigid_body" and scenario.controller.compiled:
        inputs = episode_inputs(scenario)
        try:
            kept = None if keep is None else _kept(scenario, inputs, keep)
            flown = compiled_flight.fly(scenario, inputs, progress=progress, keep=kept)
        except NoMachineCodeError as error:
            warnings.warn(f"{error}; flying as Python floats: {SLOWER}", SlowFlightWarning, stacklevel=2)
        else:
            ended = compiled_flight.ending(scenario, inputs, flown, len(flown.rows))
            return assemble(scenario, inputs, compiled_flight.samples(flown), ended)
    return run_in_python(scenario, progress, keep=keep)


def run_in_python(scenario: Scenario, progress: Progress | None = None, *, keep: Keep | None = None) -> Log:
    """Fly an episode as :func:`run` does, stage by stage in Python floats, on any plant and with any law."""
    require_flight(scenario)
    if scenario.changes:
        return _to_its_end(Session(scenario, machine_code=False), progress, keep)
    flight = StagedFlight(scenario)
    total = scenario.steps
    every = max(1, total // 100)
    kept = None if keep is None else _kept(scenario, flight.inputs, keep)
    often = _often(scenario)
    for k in range(total):
        if progress is not None and k % every == 0:
            progress(k, total)
        if not flight.step():
            break
        if kept is not None and k % often == 0:
            kept(k + 1, flight.samples)
    if progress is not None:
        progress(total, total)
    return flight.log()


def _often(scenario: Scenario) -> int:
    """Control periods between two calls of ``keep``."""
    return max(1, round(scenario.rates.control * OFTEN))


def _kept(scenario: Scenario, inputs: EpisodeInputs, keep: Keep) -> compiled_flight.Keep:
    """A function that is given what periods left and gives logs of them on."""
    said = cache(lambda: describe(scenario, Ended(RUNNING, "", 0.0)))

    def offer(done: int, left: Callable[[int, int], Samples]) -> None:
        def between(first: int, stop: int) -> Log:
            return joined(scenario, [Piece(scenario, inputs, first, left(first, stop))], None, info=said())

        keep(done, between)

    return offer


def _run_with_changes(scenario: Scenario, progress: Progress | None, keep: Keep | None) -> Log:
    """Fly an episode whose scenario changes on its way."""
    session = Session(scenario)
    if session.slow:
        warnings.warn(f"{session.slow}; flying as Python floats: {SLOWER}", SlowFlightWarning, stacklevel=3)
    return _to_its_end(session, progress, keep)


def _to_its_end(session: Session, progress: Progress | None, keep: Keep | None) -> Log:
    """Step a session to its end; the log of all of it."""
    if progress is None and keep is None:
        return session.run()
    total, often = session.scenario.steps, _often(session.scenario)
    every = max(1, total // 100)
    if progress is not None:
        progress(0, total)
    while session.step():
        if progress is not None and session.tick % every == 0:
            progress(session.tick, total)
        if keep is not None and session.tick % often == 0:
            keep(session.tick, lambda first, stop: rows_of(session.log, slice(first, stop)))
    if progress is not None:
        progress(total, total)
    return session.log
