"""Programs made once for all tests of a file that fly the same scenario."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from skyarm.compile.llvm import kernel
from skyarm.simulate import compiled_flight, compiled_session, staged_flight


@contextmanager
def shared_programs() -> Iterator[None]:
    """Within it a scenario is traced and compiled once by each engine, however many flights there are of it.

    Most of a short flight is the making of its program. Scenarios are the same if their texts are: laws and components
    of Python are then the same objects, and a structural 0 is not taken for a 0.0. Programs keep nothing of a flight.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compiled_flight, "trace_scenario", _traced(compiled_flight.trace_scenario))
        patch.setattr(compiled_flight, "Kernel", _kernels(compiled_flight.Kernel))
        patch.setattr(compiled_session, "SessionCode", _codes(compiled_session.SessionCode))
        patch.setattr(staged_flight, "FlatStages", _Stages(staged_flight.FlatStages))
        yield


@contextmanager
def hurried(cache: object) -> Iterator[None]:
    """Within it all machine code is made in a hurry, which has the same bits, and is kept in a folder of its own.

    For files that compare lanes with single flights, whose code is made once and flown for a second; what the compiler
    makes of a loop when it takes its time is in ``test_batch``, ``test_native_loop`` and ``tests/compile/test_native``.
    """
    compiled = kernel._compiled
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SKYARM_CACHE", str(cache))
        patch.setattr(kernel, "_compiled", lambda text, effort: compiled(text, 0))
        yield


def _traced(trace: Callable[..., Any]) -> Callable[..., Any]:
    made: dict[str, tuple[Any, Any]] = {}

    def traced(scenario: Any, inputs: Any) -> Any:
        text = repr(scenario)
        if text not in made:
            made[text] = trace(scenario, inputs), scenario  # which is kept, so that no other takes its address
        return made[text][0]

    return traced


def _kernels(kernel: Callable[..., Any]) -> Callable[..., Any]:
    made: dict[tuple[int, Any], Any] = {}

    def kept(loop: Any, lanes: Any, *, logging: bool, effort: int = 2) -> Any:
        key = id(loop), (lanes, logging, effort)
        if key not in made:
            made[key] = kernel(loop, lanes, logging=logging, effort=effort)  # holds the loop
        return made[key]

    return kept


def _codes(code: Callable[..., Any]) -> Callable[..., Any]:
    """As a session keeps its own, by the same rule of what fits."""
    made: list[tuple[str, int, Any, Any]] = []

    def kept(begun: Any, overrides: Any, scenario: Any, first: Any, reference: Any, effort: int = 2) -> Any:
        text = repr(dataclasses.replace(begun, changes=()))
        for other, level, one, _ in made:
            if (other, level) == (text, effort) and one.fits(overrides, scenario, first):
                return one
        new = code(begun, overrides, scenario, first, reference, effort)
        made.append((text, effort, new, begun))
        return new

    return kept


class _Stages:
    """In the place of the class, whose functions are taken from it by name."""

    def __init__(self, stages: Any) -> None:
        self._stages, self._made = stages, dict[str, tuple[Any, Any]]()

    def __call__(self, stages: Any, first: Any, reference: Any) -> Any:
        text = repr(stages.scenario)
        if text not in self._made:
            self._made[text] = self._stages(stages, first, reference), stages
        return self._made[text][0]

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stages, name)
