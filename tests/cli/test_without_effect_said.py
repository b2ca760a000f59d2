"""Vertical air on a vehicle that does not feel it is said once by run, check and sweep;
exit codes stay.
"""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import pytest

from skyarm.cli.lines import say_suspicious, say_warning
from skyarm.scenario.scenario_file import load_scenario
from support.commands import skyarm

SAID = (
    "environment.wind: moves the air along z, where 'hummingbird' has drag by its tilt"
    " alone: hardly any effect of that"
)
LIFT = """schema = 1
name = "lift"
duration = 0.2
plant = { vehicle = "hummingbird" }
controller = { preset = "centroidal_joint" }
reference = { base = { kind = "hover", position = [0.0, 0.0, 1.0] } }
environment = { wind = { mode = "moving_air", velocity = [0.0, 0.0, 1.5] } }
"""
STUDY = """schema = 1
name = "updraughts"
scenario = "calm.toml"
episodes = 3
design = "grid"
vary = { "environment.wind.velocity_W.z" = { list = [0.0, -1.0, 0.5] } }
"""

pytestmark = pytest.mark.filterwarnings(
    "default::skyarm.scenario.without_effect.WithoutEffectWarning"
)


def test_what_loading_has_said_is_not_repeated_before_the_flight(
    tmp_path, monkeypatch, capsys
) -> None:
    (tmp_path / "lift.toml").write_text(LIFT)
    monkeypatch.setattr(warnings, "showwarning", say_warning)
    say_suspicious(load_scenario(tmp_path / "lift.toml"))
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"skyarm: warning: lift: {SAID}")


@pytest.mark.thorough
def test_a_check_has_it_as_a_finding_alone(tmp_path: Path) -> None:
    (tmp_path / "lift.toml").write_text(LIFT)
    found = skyarm("check", str(tmp_path / "lift.toml"), "--arm-poses", "1", "--json")
    assert (found.code, found.err) == (0, "")
    (finding,) = [
        each for each in json.loads(found.out)["findings"] if each["level"] == "warning"
    ]
    assert finding["text"].startswith(SAID)
    assert (finding["question"], finding["field"]) == (
        "environment",
        "environment.wind",
    )


@pytest.mark.thorough
def test_a_run_and_a_sweep_say_it_once(tmp_path: Path) -> None:
    (tmp_path / "lift.toml").write_text(LIFT)
    (tmp_path / "calm.toml").write_text(LIFT.replace("1.5", "0.0"))
    (tmp_path / "up.toml").write_text(STUDY)
    for command, name in (("run", "lift"), ("sweep", "up")):
        flown = skyarm(
            command, str(tmp_path / f"{name}.toml"), "--out", str(tmp_path / command)
        )
        assert flown.code == 0, flown.err
        (line,) = [each for each in flown.err.splitlines() if "warning" in each]
        assert SAID in line
