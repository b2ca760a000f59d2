"""The name "own" of a scenario's controller, and the warning where its law is named in
place of it.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import pytest

from skyarm.cli.tune_command import tuning_inputs
from skyarm.records.identity import identity
from skyarm.scenario.controller_table import OwnOptionsWarning
from skyarm.scenario.save import save_scenario
from skyarm.scenario.scenario_file import as_scenario, load_scenario
from skyarm.studies.sweep.study_file import load_study
from support.commands import refused, skyarm

SCENARIO = """
schema = 1
name = "mine"
duration = 1.0

[plant]
vehicle = "pelican_arm2"

[controller]
law = "hybrid_computed_torque"
joint_gains = { stiffness = [30.0, 30.0], damping = [9.0, 9.0] }

[reference]
base = { kind = "hover", position = [0.0, 0.0, 2.0] }
joints = [{ kind = "constant", value = 0.1 }, { kind = "constant", value = 0.1 }]
"""

STUDY = """
schema = 1
name = "both"
scenario = "mine.toml"
controllers = ["own", "centroidal"]
episodes = 2

[vary]
"plant.vehicle.base.mass" = { uniform = [0.9, 1.1] }
"""

LEFT_OUT = (
    "^mine: flies hybrid_computed_torque with its defaults, not the options of the"
    " scenario: write 'own'"
)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "mine.toml"
    path.write_text(SCENARIO)
    return path


def test_own_is_the_law_of_the_scenario_with_its_options(file: Path) -> None:
    scenario = load_scenario(file)
    assert load_scenario(file, controller="own") == scenario
    assert as_scenario(scenario, "own") == scenario
    assert tuning_inputs(str(file), "own") == tuning_inputs(str(file), None)


def test_a_study_flies_the_own_law_beside_others(file: Path) -> None:
    study = file.with_name("both.toml")
    study.write_text(STUDY)
    laws = load_study(study).scenarios
    assert [*laws] == ["own", "centroidal"]
    own = load_study(study, ["own"]).scenarios["own"]
    alone = load_study(study, None).scenarios["own"]
    assert identity(own) == identity(alone)
    assert own.agent.controller == load_scenario(file).agent.controller


def test_an_episode_under_the_own_law_is_saved_as_a_scenario(file: Path) -> None:
    saved = save_scenario(
        file.with_name("again.toml"), load_scenario(file), file, "own"
    )
    assert identity(load_scenario(saved)) == identity(load_scenario(file))


def test_the_own_law_by_its_name_says_that_it_lacks_its_options(file: Path) -> None:
    law = "hybrid_computed_torque"
    with pytest.warns(OwnOptionsWarning, match=LEFT_OUT) as told:
        named = load_scenario(file, controller=law)
    assert len(told) == 1
    with pytest.warns(OwnOptionsWarning, match=LEFT_OUT):
        again = as_scenario(load_scenario(file), law)
    assert identity(named) == identity(again) != identity(load_scenario(file))


@pytest.mark.parametrize("by_record", [False, True])
def test_a_preset_that_is_the_own_law_says_that_it_lacks_its_options(
    by_record: bool,
) -> None:
    scenario = load_scenario("open_door") if by_record else "open_door"
    line = "^open_door: flies centroidal_tip with its defaults"
    with pytest.warns(OwnOptionsWarning, match=line) as told:
        as_scenario(scenario, "centroidal_tip")
    assert len(told) == 1


@pytest.mark.parametrize("by_record", [False, True])
@pytest.mark.parametrize(
    ("name", "law"),
    [
        ("case1", "paper_ct"),
        ("case1", "hybrid_computed_torque"),
        ("open_door", "centroidal_joint"),
    ],
)
def test_a_preset_has_no_options_to_lose_and_another_mode_is_another_law(
    name: str, law: str, by_record: bool
) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error", OwnOptionsWarning)
        as_scenario(load_scenario(name) if by_record else name, law)


@pytest.mark.parametrize("by_record", [False, True])
def test_gains_that_the_file_states_by_path_are_options(
    file: Path, by_record: bool
) -> None:
    text = "\n".join(line for line in SCENARIO.split("\n") if "joint_gains" not in line)
    file.write_text(f'{text}\n[numbers]\n"controller.gains.position.x" = 4.2\n')
    scenario = load_scenario(file) if by_record else file
    with pytest.warns(OwnOptionsWarning, match=LEFT_OUT):
        as_scenario(scenario, "hybrid_computed_torque")


@pytest.mark.parametrize("by_record", [False, True])
def test_a_file_of_gains_has_options_of_its_own(file: Path, by_record: bool) -> None:
    gains = file.with_name("gains.toml")
    gains.write_text('schema = 1\n[law]\nlaw = "hybrid_computed_torque"\n')
    with warnings.catch_warnings():
        warnings.simplefilter("error", OwnOptionsWarning)
        as_scenario(load_scenario(file) if by_record else file, str(gains))


def test_a_law_without_options_and_another_law_say_nothing(file: Path) -> None:
    bare = file.with_name("bare.toml")
    bare.write_text(
        "\n".join(line for line in SCENARIO.split("\n") if "joint_gains" not in line)
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load_scenario(bare, controller="hybrid_computed_torque")
        as_scenario(load_scenario(bare), "hybrid_computed_torque")
        load_scenario(file, controller="decoupled_pd")


def test_a_vehicle_has_no_law_of_its_own(file: Path) -> None:
    out = file.with_name("tuned")
    refused(
        skyarm("tune", "pelican_arm2", "--laws", "own", "--out", str(out)),
        "skyarm: --laws = 'own': a vehicle has no law of its own",
    )
    assert not out.exists()


@pytest.mark.parametrize("command", ["run", "compare"])
def test_the_own_law_is_named_once(
    file: Path, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(file.parent)
    refused(
        skyarm(command, "mine.toml", "--laws", "own,own"),
        "skyarm: --laws = ['own', 'own']: must be a list of different presets or laws;"
        " 'own' and 'own' are one",
    )


def test_commands_take_the_own_law(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(file.parent)
    file.with_name("both.toml").write_text(STUDY)
    flown = skyarm("run", "mine.toml", "--laws", "own,centroidal", "--out", "flown")
    assert flown.code == 0, flown.err
    assert sorted(each.name for each in Path("flown").glob("*.npz")) == [
        "mine_centroidal.npz",
        "mine_own.npz",
    ]
    swept = skyarm("sweep", "both.toml", "--laws", "own,centroidal", "--out", "rows")
    assert swept.code == 0, swept.err
    assert "2 episodes under own, centroidal" in swept.out
    assert "warning: flies" not in flown.err + swept.err
