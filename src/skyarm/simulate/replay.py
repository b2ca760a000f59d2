"""Fly the flight of a log again: the same scenario with the same noise, under its own law or another."""

from __future__ import annotations

import os
from pathlib import Path

from skyarm.actuation import AllocationError
from skyarm.control.controller import Controller
from skyarm.files import shown, unreadable
from skyarm.log.flight_log import Log
from skyarm.log.formats import load_log
from skyarm.scenario.controller_table import under_law
from skyarm.scenario.scenario_record import Scenario, ScenarioError, without_law
from skyarm.simulate.loop import Progress, run


def replay(
    log: Log | str | os.PathLike[str],
    controller: str | Controller | None = None,
    *,
    progress: Progress | None = None,
) -> Log:
    """Fly a flight again.

    Without a controller it is flown to the bits of the log, by the version that wrote it and on a processor that rounds
    alike. With one it shows what another law would have done with the same vehicle in the same wind, noise, pushes and
    changes; changes of the log's own controller are left out.

    Args:
        log: of the flight, or the path of its file.
        controller: a preset, a law, LAW_tuned, or a controller; the log's own if left out.
        progress: called with (periods flown, periods in all).

    Raises:
        ScenarioError: one line: no log, one that keeps no scenario, or a law that does not fit its vehicle.
        OSError: the file cannot be read.
    """
    return run(scenario_to_replay(read(log), controller), progress)


def read(log: Log | str | os.PathLike[str]) -> Log:
    """A log as it is, or from its file.

    Raises:
        ScenarioError: one line.
    """
    if isinstance(log, Log):
        return log
    if not isinstance(log, (str, os.PathLike)):
        raise ScenarioError(f"log = {shown(log)}: must be a Log or the path of one's file")
    reason = unreadable(Path(log))
    if reason:
        raise ScenarioError(f"log = {shown(os.fspath(log))}: {reason}")
    try:
        return load_log(log)
    except ValueError as error:
        raise ScenarioError(str(error)) from None


def scenario_to_replay(log: Log, controller: str | Controller | None = None) -> Scenario:
    """The scenario of a log, under its own law or another.

    Raises:
        ScenarioError: one line.
    """
    try:
        scenario: Scenario = log.scenario
        if controller is None:
            return scenario
        if isinstance(controller, Controller):
            return scenario.with_words(controller=controller, changes=without_law(scenario.changes))
        return under_law(scenario, controller)
    except (ValueError, AllocationError) as error:
        raise ScenarioError(str(error)) from None
