"""Flights of one engine without a log, and programs made once for all tests of a file that fly the same scenario."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from record_text import whole_text
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate import engine, session
from skyarm.simulate.engine import Engine, EpisodeCode
from skyarm.simulate.loop_state import LoopState


@dataclass(frozen=True)
class Flight:
    """What an engine left: samples of its periods, the loop at its end, the engine itself."""

    rows: np.ndarray
    carry: LoopState
    engine: Engine


def fly(scenario: Scenario, *, python: bool = False) -> Flight:
    """An episode by one engine, in machine code or in Python."""
    flown = Engine(session.EpisodeCode(scenario, machine_code=not python, commands=False))
    while flown.fly(scenario.steps):
        pass
    return Flight(flown._log[: flown.tick], flown.now, flown)


@contextmanager
def shared_programs() -> Iterator[None]:
    """Within it a scenario is traced and compiled once by each engine, however many flights there are of it.

    Most of a short flight is the making of its program. Scenarios are the same if their texts are: laws and components
    of Python are then the same objects, and a structural 0 is not taken for a 0.0. Programs keep nothing of a flight.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(session, "EpisodeCode", _codes(session.EpisodeCode))
        yield


def _codes(code: Callable[..., EpisodeCode]) -> Callable[..., EpisodeCode]:
    made: dict[str, tuple[EpisodeCode, Any]] = {}

    def kept(scenario: Any, vary: Any = None, numbers: Any = None, **options: Any) -> EpisodeCode:
        if not scenario.controller.compiled:
            return code(scenario, vary, numbers, **options)
        text = whole_text((dataclasses.replace(scenario, changes=()), numbers, options))
        if text not in made:
            made[text] = code(scenario, vary, numbers, **options), scenario  # kept: no other takes its address
        return made[text][0]

    return kept


__all__ = ["Flight", "engine", "fly", "shared_programs"]
