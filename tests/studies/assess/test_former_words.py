"""Files of versions 0.2 and 0.3 in the words of this version: each loads after the upgrade, comments kept."""

from __future__ import annotations

import functools
import shutil
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

import skyarm
from skyarm.control.controller import FormerNameWarning
from skyarm.records.files.messages import present_names
from skyarm.studies.assess.former_words import upgrade_file
from skyarm.studies.sweep.study_file import load_study
from support.commands import skyarm as command

FORMER = Path(__file__).resolve().parents[2] / "data" / "former"
FILES = sorted(FORMER.rglob("*.toml"))
PLUGINS = sorted(path for path in FORMER.rglob("*.py") if path.stem != "ground_effect")
STUDIES = ("press_in_four_worlds", "robustness")
VEHICLES = ("servo_arm", "tilted_hexarotor")

HEAD = """\
name = "x"   # a name
duration = 1.0
[plant]
vehicle = "hummingbird_arm2_rotors"
[model]
vehicle = "hummingbird_arm2"
"""
HOVER = """
[reference.base]
kind = "hover"
position = [0.0, 0.0, 1.0]
"""


def loads(path):
    if path.stem in STUDIES:
        load_study(str(path))
    elif path.stem in VEHICLES:
        skyarm.load_vehicle(str(path))
    else:
        skyarm.load_scenario(str(path))


def upgraded(tmp_path, text):
    file = tmp_path / "old.toml"
    file.write_text(text)
    return upgrade_file(file)


@pytest.fixture(scope="module")
def folder_of(tmp_path_factory):
    """Version -> copy of all its files, upgraded once: a file may name another."""

    @functools.cache
    def made(version):
        folder = tmp_path_factory.mktemp(version.replace(".", "_"))
        for path in (FORMER / version).iterdir():
            shutil.copy(path, folder)
            found = upgrade_file(path)
            assert found.fault == ""
            (folder / path.name).write_text(found.text)
        return folder

    return made


@pytest.mark.parametrize("file", FILES, ids=lambda file: f"{file.parent.name}-{file.stem}")
def test_a_former_file_loads_after_the_upgrade_without_a_word_of_before(file, folder_of):
    folder = folder_of(file.parent.name)
    with warnings.catch_warnings():
        warnings.simplefilter("error", FormerNameWarning)
        loads(folder / file.name)
    comments = [line.partition("#")[2] for line in file.read_text().splitlines() if line.startswith("#")]
    assert all(comment in (folder / file.name).read_text() for comment in comments)


def test_files_in_the_words_of_now_stay_as_they_are():
    for name in ("case3_wind", "tilted_hexarotor"):
        file = next(path for path in FILES if path.stem == name)
        assert upgrade_file(file).text == file.read_text()
        assert upgrade_file(file).changes == ()


@pytest.mark.parametrize("option", [name.partition(".")[2] for name in present_names("option")])
def test_an_option_that_is_gone_is_left_out(tmp_path, option):
    found = upgraded(
        tmp_path, f'{HEAD}[controller]\nlaw = "centroidal"\nbandwidth = 1.0\n{option} = 0.4   # mine\n{HOVER}'
    )
    assert found.fault == ""
    assert [change.field for change in found.changes] == [f"controller.{option}"]
    assert option not in found.text


@pytest.mark.parametrize("preset", [*present_names("preset"), "exact_ee", "exact_joint_stiff", "rotors_hummingbird"])
def test_a_preset_that_is_gone_becomes_the_one_that_flies_in_its_place(tmp_path, preset):
    found = upgraded(tmp_path, f'{HEAD}[controller]\npreset = "{preset}"   # mine\n{HOVER}')
    now = present_names("preset").get(preset) or present_names("word")[preset].strip("'")
    assert f'preset = "{now}"   # mine' in found.text
    assert found.fault == ""


@pytest.mark.parametrize("law", ["ct_consistent", "ct_observer", "l1_adaptive_lateral", "ct_level_gravity"])
def test_a_law_that_is_an_option_now_gets_it(tmp_path, law):
    found = upgraded(tmp_path, f'{HEAD}[controller]\nlaw = "{law}"\n{HOVER}')
    assert found.fault == ""
    assert len(found.changes) == 1
    law_now = present_names("word")[law].split("'")[1]
    assert f'law = "{law_now}"\n' in found.text
    file = tmp_path / "new.toml"
    file.write_text(found.text)
    assert skyarm.load_scenario(str(file)).controller.name == law_now


@pytest.mark.parametrize(
    ("before", "now"),
    [
        (
            "[controller]\npreset = 'paper_ct'\n[trajectory.base]\nkind = 'hover'\nposition = [0, 0, 1]\n",
            "[reference.base]",
        ),
        (f"[controller]\npreset = 'paper_ct'\n{HOVER}[reference]\njoined = 0.5\n", "tracking_start = 0.5"),
        (
            f"[controller]\npreset = 'paper_ct'\n{HOVER}"
            "[[environment.air]]\nkind = 'airspeed'\nsource = { velocity = [1, 0, 0] }\n",
            'kind = "moving_air"',
        ),
    ],
)
def test_a_renamed_word_is_written_anew(tmp_path, before, now):
    found = upgraded(tmp_path, HEAD + before)
    assert now in found.text
    assert len(found.changes) == 1


def test_the_former_base_shift_that_was_off_stays_off(tmp_path):
    found = upgraded(
        tmp_path,
        f'{HEAD}[controller]\nlaw = "centroidal"\nbandwidth = 1.0\nshift_bandwidth = 0.0\nswing_rate = 2.0\n{HOVER}',
    )
    assert "preview = 0.0" in found.text
    assert "shift_bandwidth" not in found.text
    assert "swing_rate" not in found.text


def test_a_fault_of_the_file_itself_stays_its_fault(tmp_path):
    found = upgraded(tmp_path, f'{HEAD}[controller]\npreset = "exact_ee"\n{HOVER}mass = 3.0\n')
    assert "reference.base.mass" in found.fault


def test_a_former_plugin_whose_name_is_shipped_now_says_so(tmp_path):
    (tmp_path / "mine.py").write_text(upgrade_file(FORMER / "0.2" / "ground_effect.py").text)
    done = subprocess.run(
        [sys.executable, "mine.py"], cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False
    )
    assert "force 'ground_effect': is registered by skyarm" in done.stderr


@pytest.mark.parametrize("file", PLUGINS, ids=lambda file: file.stem)
def test_a_former_plugin_loads_after_the_upgrade(file, tmp_path):
    found = upgrade_file(file)
    (tmp_path / file.name).write_text(found.text)
    subprocess.run([sys.executable, file.name], cwd=tmp_path, check=True, timeout=120)
    renamed = {change.before for change in found.changes}
    assert renamed == {name for name in ("skyarm.scalars", "skyarm.actuation") if name in file.read_text()}


def test_names_that_skyarm_exports_no_more_are_renamed_or_told(tmp_path):
    file = tmp_path / "mine.py"
    file.write_text("from skyarm import World\nfrom skyarm import scalars\nimport skyarm\nx = skyarm.BatchSession\n")
    found = upgrade_file(file)
    assert found.text.splitlines()[:2] == ["from skyarm import Truth as World", "from skyarm.algebra import scalars"]
    assert found.notes == ("line 4: skyarm.BatchSession is now skyarm.envs, for lanes that are stepped",)


def test_the_command_writes_the_file_anew_and_keeps_the_one_before(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = f'{HEAD}[controller]\npreset = "exact_ee"   # mine\n{HOVER}'
    (tmp_path / "old.toml").write_text(text)
    refused = command("check", "old.toml")
    assert refused.code == 2
    assert "1 word of an earlier version; 'skyarm check old.toml --upgrade'" in refused.out
    assert (tmp_path / "old.toml").read_text() == text
    done = command("check", "old.toml", "--upgrade")
    assert done.code == 0
    assert "controller.preset: 'exact_ee' -> 'centroidal_tip'" in done.out
    assert 'preset = "centroidal_tip"   # mine' in (tmp_path / "old.toml").read_text()
    assert (tmp_path / "old.toml.before").read_text() == text
    (tmp_path / "old.toml").write_text(text)
    again = command("check", "old.toml", "--upgrade")
    assert again.code == 2
    assert (tmp_path / "old.toml.before").read_text() == text


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("none.toml", None, "no such file"),
        ("odd.toml", "a = 1\n", "must be a scenario, a vehicle, a study or a Python file"),
        ("odd.py", "def (:\n", "must be Python"),
        ("odd.toml", "a = \n", "odd.toml"),
    ],
)
def test_what_is_no_such_file_is_one_line(tmp_path, name, text, words):
    if text is not None:
        (tmp_path / name).write_text(text)
    with pytest.raises((ValueError, OSError), match=words) as error:
        upgrade_file(tmp_path / name)
    assert "\n" not in str(error.value)


@pytest.mark.thorough
@pytest.mark.parametrize("file", [f for f in FILES if f.stem not in (*STUDIES, *VEHICLES)], ids=lambda file: file.stem)
def test_a_former_scenario_flies_after_the_upgrade(file, folder_of):
    scenario = skyarm.load_scenario(str(folder_of(file.parent.name) / file.name))
    # a law without force control presses until a rotor touches the wall
    ends = {"press_a_wall": "rotor_contact"}
    assert skyarm.run(scenario).status == ends.get(file.stem, "completed")
