"""The page on environments names everything that there is, with its usual numbers."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

pytest.importorskip("gymnasium", reason="needs the extra 'gym'")
from skyarm.envs.action_kinds import ACTIONS
from skyarm.envs.env_task import PRECISIONS
from skyarm.envs.named_tasks import NAMED, task_scenario
from skyarm.envs.observed_quantities import OBSERVED
from skyarm.envs.reward_terms import REWARDS

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "environments.md").read_text(
    "utf-8"
)


def row(name):
    """The row of a table whose first column names something."""
    found = [line for line in PAGE.splitlines() if re.match(rf"\| [^|]*`{name}`", line)]
    assert len(found) == 1, name
    return [cell.strip() for cell in found[0].strip("|").split("|")]


@pytest.mark.parametrize("known", [OBSERVED, REWARDS], ids=["observed", "rewarded"])
def test_every_quantity_stands_in_a_table_with_its_usual_scale(known):
    for name, kind in known.items():
        first, *_, last = row(name)
        names, scales = (
            re.findall(r"`(\w+)`", first.split(" times")[0]),
            re.findall(r"\d[\d.]*", last),
        )
        record = kind()
        if hasattr(record, "scale"):
            # one number for all in the row, or one for each
            assert float(scales[names.index(name) % len(scales)]) == record.scale, name
        else:
            assert not scales, name


def test_every_kind_of_action_stands_in_a_table_with_its_usual_numbers():
    for name, kind in ACTIONS.items():
        cells = row(name)
        assert cells[1] == f"`{kind.__name__}`"
        usual = {
            field: float(value)
            for field, value in re.findall(r"`(\w+)` \((\d[\d.]*)", cells[3])
        }
        usual |= (
            {"span": float(*re.findall(r"`span` \(([\d.]+)\)", cells[3]))}
            if "span" in cells[3]
            else {}
        )
        record = kind()
        numbers = {
            field: getattr(record, field)
            for field in kind.__dataclass_fields__
            if field != "joints"
        }
        assert usual == numbers, name


def test_every_shipped_task_stands_in_a_table_with_its_actions_rate_and_length():
    for name, each in NAMED.items():
        _, what, actions, _ = row(f"skyarm/{name}-v0")
        kind = next(
            word for word, record in ACTIONS.items() if isinstance(each.actions, record)
        )
        assert actions.startswith(f"`{kind}`")
        scenario = task_scenario(name)
        assert f"{scenario.duration:g} s" in what
        assert "Hz" not in what or f"{scenario.rates.control} Hz" in what
    assert all(f'`"{each}"`' in PAGE for each in PRECISIONS)
