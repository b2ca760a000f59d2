"""What takes the flight of one vehicle: of several it says so in one line, with their
names and what to do.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import skyarm
from skyarm.cli.main import main
from skyarm.envs.env_task import make_task
from skyarm.scenario.scenario_record import Scenario, ScenarioError
from support.teams import TEAMS, team

LINE = (
    "agents = left, right: must be one for {}; leave the others, and what they hold,"
    " out of the scenario"
)


@pytest.mark.parametrize(
    ("take", "purpose"),
    [
        (skyarm.margins, "stability margins"),
        (skyarm.tune, "a search for gains without [team]"),
        (make_task, "an environment"),
    ],
)
def test_functions_of_one_vehicle(
    take: Callable[[Scenario], object], purpose: str
) -> None:
    for scenario in (team("bar"), team("bar").of("left")):
        with pytest.raises(ScenarioError) as error:
            take(scenario)
        assert str(error.value) == LINE.format(purpose)


@pytest.mark.parametrize(
    ("words", "purpose"),
    [
        (["margins"], "stability margins"),
        (["tune"], "a search for gains without [team]"),
        (["export", "--to", "c", "--out", "law.c"], "the law in C"),
        (["export", "--to", "mjcf", "--out", "model.xml"], "a model of a vehicle"),
    ],
)
def test_commands_of_one_vehicle(
    words: list[str],
    purpose: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(
        "sys.argv", ["skyarm", words[0], str(TEAMS / "bar.toml"), *words[1:]]
    )
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert capsys.readouterr().err == f"skyarm: {LINE.format(purpose)}\n"
    assert not [*tmp_path.iterdir()]
