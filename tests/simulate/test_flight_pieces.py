"""Machine code runs in pieces as long as its clock allows: short enough to hear Ctrl-C, long enough to be fast."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from skyarm.scenario.scenario_file import load_scenario
from skyarm.simulate import compiled_flight as native
from skyarm.simulate.inputs import episode_inputs

TICK = 1.0 / 128.0
"""s a period takes on a clock that the test turns: sixteen fit into an eighth of a second."""


def pieces(monkeypatch: pytest.MonkeyPatch, speeds: Any) -> tuple[list[int], np.ndarray]:
    """Periods of each piece of a flight whose periods take ``speeds(first)`` ticks, and its log."""
    clock, sizes = [0.0], []
    monkeypatch.setattr(native, "PIECE", 0.125)
    monkeypatch.setattr(native, "perf_counter", lambda: clock[0])
    in_python = native._in_python

    def timed(*arguments: Any) -> Any:
        advance = in_python(*arguments)

        def step(carry: Any, rows: Any, first: int) -> Any:
            sizes.append(len(rows))
            clock[0] += TICK * speeds(first) * len(rows)
            return advance(carry, rows, first)

        return step

    monkeypatch.setattr(native, "_in_python", timed)
    scenario = load_scenario("case1", duration=0.5)
    flown = native.fly(scenario, episode_inputs(scenario), reference=True)
    assert sum(sizes) == scenario.steps == 100
    return sizes, flown.rows


def test_pieces_grow_eightfold_at_most_until_they_last_as_long_as_they_may(monkeypatch):
    sizes, _ = pieces(monkeypatch, lambda first: 1.0)
    assert sizes == [1, 8, 16, 16, 16, 16, 16, 11]


def test_pieces_shrink_where_periods_take_longer_and_are_never_empty(monkeypatch):
    sizes, _ = pieces(monkeypatch, lambda first: 1.0 if first < 40 else 64.0)
    assert sizes[:4] == [1, 8, 16, 16]
    # the piece that met the slow part first was cut for the fast one
    assert set(sizes[5:]) == {1}


def test_a_clock_that_stands_still_lets_pieces_grow_and_changes_no_number(monkeypatch):
    sizes, log = pieces(monkeypatch, lambda first: 0.0)
    assert sizes == [1, 8, 64, 27]
    monkeypatch.undo()
    assert np.array_equal(log, pieces(monkeypatch, lambda first: 4.0)[1])
