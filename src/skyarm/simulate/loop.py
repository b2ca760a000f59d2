"""Simulation of a flight from scenario to log, and repetition of a logged flight."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from skyarm.compile.machine_code import SlowFlightWarning
from skyarm.control.controller import Controller
from skyarm.log.flight_log import Log
from skyarm.log.flown_scenario import warn_of_commands
from skyarm.log.formats import as_log, require_format, save_log
from skyarm.log.stored_arrays import ArrayFile
from skyarm.records.files import PathLike, errors_as, output_file, shown
from skyarm.scenario.controller_table import under_law
from skyarm.scenario.scenario_file import as_scenario
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from skyarm.simulate.assemble_log import Piece
from skyarm.simulate.check_endings import RUNNING, Ended
from skyarm.simulate.session import Session, open_session

Progress = Callable[[int, int], None]

SLOWER = "about 150 times slower per step, the same numbers"
"""Text on the speed of Python floats, measured on the paper's vehicle; with tracing,
which both need, 10 s take ten times as long."""


WINDOW = 10_000
"""Number of control periods in memory of a flight whose log may read its arrays from a
file: 50 s at 200 Hz. All in memory, an hour of case3 took 2391 MB, five times its
log."""


class _Episode(Session):
    """Simulation of a flight without user commands, which compiles to a shorter
    program.

    Args:
        scenario, paths, machine_code: as of :class:`skyarm.Session`.
        file: file with the arrays of all but the last periods; None for all in memory.
    """

    _commands = False

    def __init__(
        self,
        scenario: Scenario,
        paths: Sequence[str] = (),
        *,
        file: ArrayFile | None = None,
        **options: bool,
    ) -> None:
        self._file = file
        self._window = None if file is None else WINDOW
        super().__init__(scenario, paths, **options)

    def fly(self, stop: int) -> bool:
        """Simulate several control periods, as :meth:`skyarm.Session.fly`; store what
        would be overwritten next.
        """
        going = super().fly(stop)
        engine = self._engine
        file = self._file
        # stored before the flight goes on, which would overwrite the table's rows
        if going and file is not None and engine.full:
            flown = (*self._course.flown, engine.piece)
            try:
                flown = tuple(
                    each.in_file(file) if isinstance(each, Piece) else each
                    for each in flown
                )
            except OSError as error:
                # a full disk ends the flight: what has been flown is still a log
                engine.ended = Ended(
                    RUNNING, f"log: must be writable ({error.strerror})", self.time
                )
                return False
            # no signal comes between the two: a piece is in memory or in the file
            self._course, engine.begun = replace(self._course, flown=flown), engine.tick
        return going


def run(
    scenario: Scenario | PathLike,
    progress: Progress | None = None,
    *,
    to: PathLike | None = None,
) -> Log:
    """Simulate the flight of a scenario, given as an object, a file path or a shipped
    name, and return its log.

    A diverging episode, a joint past its limit or the ground ends the episode: the
    log's status, cause and end time say so. ``progress(done, total)`` is called about a
    hundred times.

    The rigid-body plant flies in machine code, unless the law cannot be traced. Where
    that code cannot be made a warning says so, and the episode flies in Python: slower,
    the same numbers to the last bit.

    Changes in flight take hold in their control periods, as in a
    :class:`skyarm.Session` of the scenario.

    Args:
        scenario: a scenario, the path of its file or of a log, or a shipped name.
        progress: called with (periods flown, periods in all).
        to: file of the log, in the format of its suffix (:func:`skyarm.save_log`). A
            long flight then needs little more memory than a short one: its arrays go to
            disk, and the returned log reads them from there at each access. An
            interruption (Ctrl-C) leaves the log up to then in the file.

    Raises:
        OSError: the file cannot be written.
    """
    scenario = as_scenario(scenario)
    folder = None
    if to is not None:
        require_format(to, "to")
        folder = output_file(os.fspath(to), "to").parent
    log, interrupted = run_until_interrupted(scenario, progress, folder=folder)
    if to is not None:
        save_log(log, to)
    if interrupted is not None:
        raise interrupted
    return log


def run_in_python(scenario: Scenario, progress: Progress | None = None) -> Log:
    """Simulate a flight in Python floats instead of machine code; works with any plant
    and any control law.
    """
    with closing(_new_session(scenario, machine_code=False)) as session:
        _advance(session, progress)
        return session.log


def run_until_interrupted(
    scenario: Scenario,
    progress: Progress | None = None,
    preparing: Callable[[float, float], object] | None = None,
    folder: Path | None = None,
) -> tuple[Log, BaseException | None]:
    """Simulate a flight to its end or to an interruption (Ctrl-C or a signal), and
    return the log up to then.

    Args:
        scenario: scenario of the flight.
        progress: called with (periods flown, periods in all).
        preparing: as of :func:`skyarm.simulate.session.open_session`.
        folder: folder of the file from which the log of a long flight reads its arrays;
            None: they are in memory.

    Returns:
        The log, and what ended the flight from outside, to be raised again once the log
        is written; else None.
    """
    make = partial(_Episode, file=None if folder is None else ArrayFile(folder))
    with closing(_new_session(scenario, make, preparing=preparing)) as session:
        interrupted: BaseException | None = None
        try:
            _advance(session, progress)
        # an error is raised at once; a signal or Ctrl-C leaves the log up to then
        except Exception:
            raise
        except BaseException as error:
            interrupted = error
        return session.log, interrupted


def _new_session(
    scenario: Scenario, make: Callable[..., Session] = _Episode, **options: Any
) -> Session:
    session = open_session(scenario, make=make, **options)
    if session.slow:
        warnings.warn(
            f"{session.slow}; flying as Python floats: {SLOWER}",
            SlowFlightWarning,
            # the line of the user who called run()
            stacklevel=4,
        )
    return session


def _advance(session: Session, progress: Progress | None) -> None:
    """Simulate a session to the end of its flight."""
    if progress is not None and not callable(progress):
        raise ScenarioError(
            f"progress = {shown(progress)}: must be a function of periods flown and all"
        )
    total = session.scenario.steps
    due = 0
    # each report ends a stretch of machine code: a hundred of them cost little
    every = max(1, total // 100)
    while True:
        if progress is not None and session.tick >= due:
            progress(session.tick, total)
            due = (session.tick // every + 1) * every
        if not session.fly(total if progress is None else min(total, due)):
            break
    if progress is not None:
        progress(total, total)


def replay(
    log: Log | PathLike,
    controller: str | Controller | None = None,
    *,
    progress: Progress | None = None,
) -> Log:
    """Simulate the scenario of a logged flight again, with the same controller or
    another one.

    Without a controller it is flown to the bits of the log, by the version that wrote
    it and on a processor that rounds alike. With one it shows what another law would
    have done with the same vehicle in the same wind, noise and pushes, without what the
    scenario schedules of the log's own controller.

    Args:
        log: log of the flight, or the path of its file.
        controller: a preset, a law, LAW_tuned, or a controller; the log's own if left
            out.
        progress: function of (periods flown, periods in all).

    Raises:
        ScenarioError: one line: no log, one that keeps no scenario, or a law that does
            not fit its vehicle.
        OSError: the file cannot be read.
    """
    return run(scenario_to_replay(read(log), controller), progress)


def read(log: Log | PathLike) -> Log:
    """Load a log from a file; an argument that is a log already is returned unchanged.

    Raises:
        ScenarioError: one line.
    """
    with errors_as(ScenarioError):
        return as_log(log)


def scenario_to_replay(log: Log, controller: str | Controller | None) -> Scenario:
    """Scenario of a logged flight, optionally with its controller replaced.

    Raises:
        ScenarioError: one line.
    """
    warn_of_commands(log.info)
    with errors_as(ScenarioError):
        scenario: Scenario = log.scenario
        if controller is None:
            return scenario
        if isinstance(controller, Controller):
            return scenario.under(controller)
        return under_law(scenario, controller)
