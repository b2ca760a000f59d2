"""Fly one episode: clock, sensors, controller, plant, log."""

from __future__ import annotations

import warnings
from collections.abc import Callable

from skyarm.compile.machine_code import NoMachineCodeError, SlowFlightWarning
from skyarm.files import shown
from skyarm.log.flight_log import Log
from skyarm.scenario.scenario_checks import require_flight
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.simulate import compiled_flight
from skyarm.simulate.assemble_log import assemble
from skyarm.simulate.inputs import episode_inputs
from skyarm.simulate.session import Session
from skyarm.simulate.staged_flight import StagedFlight

Progress = Callable[[int, int], None]

SLOWER = "about 150 times slower per step, the same numbers"
"""Measured on the paper's vehicle; with the tracing, which both need, 10 s take ten times as long."""


def run(scenario: Scenario, progress: Progress | None = None) -> Log:
    """Fly the scenario's episode and return its log.

    A diverging episode, a joint past its limit or ground contact ends the episode: the log's status, cause and end time
    say so. ``progress(done, total)`` is called about a hundred times.

    The rigid-body plant flies in machine code, unless the law cannot be traced. Where that code cannot be made a
    warning says so, and the episode flies in Python: slower, the same numbers to the last bit.

    Changes in flight take hold in their control periods, as in a :class:`skyarm.Session` of the scenario.
    """
    require_flight(scenario)
    if progress is not None and not callable(progress):
        raise ScenarioError(f"progress = {shown(progress)}: must be a function of periods flown and all")
    if scenario.changes:
        return _run_with_changes(scenario, progress)
    if scenario.plant == "rigid_body" and scenario.controller.compiled:
        inputs = episode_inputs(scenario)
        try:
            flown = compiled_flight.fly(scenario, inputs, progress=progress)
        except NoMachineCodeError as error:
            warnings.warn(f"{error}; flying as Python floats: {SLOWER}", SlowFlightWarning, stacklevel=2)
        else:
            ended = compiled_flight.ending(scenario, inputs, flown, len(flown.rows))
            return assemble(scenario, inputs, compiled_flight.samples(flown), ended)
    return run_in_python(scenario, progress)


def run_in_python(scenario: Scenario, progress: Progress | None = None) -> Log:
    """Fly an episode as :func:`run` does, stage by stage in Python floats, on any plant and with any law."""
    require_flight(scenario)
    if scenario.changes:
        return _to_its_end(Session(scenario, machine_code=False), progress)
    flight = StagedFlight(scenario)
    total = scenario.steps
    every = max(1, total // 100)
    for k in range(total):
        if progress is not None and k % every == 0:
            progress(k, total)
        if not flight.step():
            break
    if progress is not None:
        progress(total, total)
    return flight.log()


def _run_with_changes(scenario: Scenario, progress: Progress | None) -> Log:
    """Fly an episode whose scenario changes on its way."""
    session = Session(scenario)
    if session.slow:
        warnings.warn(f"{session.slow}; flying as Python floats: {SLOWER}", SlowFlightWarning, stacklevel=3)
    return _to_its_end(session, progress)


def _to_its_end(session: Session, progress: Progress | None) -> Log:
    """Step a session to its end; the log of all of it."""
    if progress is None:
        return session.run()
    total = session.scenario.steps
    every = max(1, total // 100)
    progress(0, total)
    while session.step():
        if session.tick % every == 0:
            progress(session.tick, total)
    progress(total, total)
    return session.log
