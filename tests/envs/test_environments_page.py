"""The page on training names classes of actions and environments that there are; the
example of many episodes shows all that are shipped.
"""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

pytest.importorskip("gymnasium", reason="needs the extra 'gym'")
from skyarm.envs.action_kinds import ACTIONS
from skyarm.envs.named_tasks import NAMED, task_scenario

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "environments.md").read_text("utf-8")


def test_every_class_of_actions_has_a_row() -> None:
    rows = re.findall(r"^\| `(\w+)` \| ", PAGE, re.M)
    assert sorted(rows) == sorted(kind.__name__ for kind in ACTIONS.values())


def test_the_environments_of_the_page_are_shipped() -> None:
    shown = set(re.findall(r"skyarm/(\w+)-v0", PAGE)) - {"Scenario"}
    assert shown
    assert shown <= set(NAMED)


@pytest.mark.thorough
def test_the_example_lists_what_is_shipped_and_flies_a_lane_by_hand(
    capsys: pytest.CaptureFixture[str],
) -> None:
    runpy.run_path(str(ROOT / "examples" / "many_episodes.py"))
    told = capsys.readouterr().out
    for name, task in NAMED.items():
        scenario = task_scenario(name)
        line = (
            f"skyarm/{name}-v0: {scenario.title}, {scenario.rates.control} Hz,"
            f" {scenario.duration:g} s, {type(task.actions).__name__}"
        )
        assert line in told
    (parted,) = re.findall(r"parted by (\S+) m", told)
    assert float(parted) < 1e-12
    assert "picture (240, 240, 3)" in told
