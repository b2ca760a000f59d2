"""The wanted force of a task in contact."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from skyarm.log.metrics import score
from skyarm.reference.signals import Constant, Windowed
from skyarm.reference.tip_motion import TipPush
from skyarm.view.figures.flight_facts import desired_push


def test_the_wanted_force_of_a_task_that_waits_stands_at_its_own_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    push = TipPush(force=Windowed(Constant(2.0), 1.0, 2.0), normal=(-1.0, 0.0, 0.0))
    time, late = np.array([0.0, 1.5, 3.0]), np.array([0.0, 0.5, 1.5])
    flown = SimpleNamespace(agent=SimpleNamespace(reference=SimpleNamespace(push=push)))
    log: Any = SimpleNamespace(
        scenario=flown,
        time=time,
        path_time=late,
        info={"scenario_record": {"type": "any"}},
    )
    for read in ("written_at", "restored_at"):
        monkeypatch.setattr(score, read, lambda *_: flown.agent.reference.push)
    found = desired_push(log)
    assert found is not None
    assert found.tolist() == [0.0, 0.0, 2.0]
    log.path_time = np.zeros(0)
    assert desired_push(log).tolist() == [0.0, 2.0, 0.0]  # type: ignore[union-attr]
    flown.agent.reference.push = None
    assert desired_push(log) is None
