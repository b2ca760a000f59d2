"""``skyarm plan`` as a user types it."""

from __future__ import annotations

from pathlib import Path

import pytest

import skyarm
from skyarm.planning.planner import PlanError
from support.commands import skyarm as command

UP = """schema = 1
vehicle = "hummingbird"
phases = [{ to = { base = [0.0, 0.0, 1.0], rest = true } }]
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "up.toml").write_text(UP)
    return tmp_path


def test_a_plan_of_free_length_flies_by_the_scenario_beside_it(folder: Path) -> None:
    """The length of a flight must be a whole number of control periods, which that of a plan is not."""
    ended = command("plan", "up.toml", "-o", "up.npz", "--scenario", "fly/up.toml")
    assert ended.code == 0, ended.err
    flight = skyarm.load_scenario("fly/up.toml")
    log = skyarm.run(flight)
    assert log.status == "completed"
    assert log.position[-1] == pytest.approx([0.0, 0.0, 1.0], abs=5e-3)


def test_a_task_without_a_plan_ends_with_3_and_its_cause(monkeypatch: pytest.MonkeyPatch) -> None:
    def none(*_: object, **__: object) -> None:
        raise PlanError("up: phases[0] 'go': base is off by 2")

    monkeypatch.setattr("skyarm.planning.planner.plan", none)
    ended = command("plan", "up.toml")
    assert (ended.code, ended.out) == (3, "up: phases[0] 'go': base is off by 2\n")
    assert command("plan", "up.toml", "-q").err == "skyarm: up: phases[0] 'go': base is off by 2\n"
    assert not Path("plan.npz").exists()
