"""Aliases of controllers stay without a word; old names of the last version work with a line that says the new one."""

from __future__ import annotations

import json
import re
import warnings
from importlib import import_module
from pathlib import Path

import pytest

import skyarm as library
from commanded import skyarm
from skyarm.actuation import make_mixer
from skyarm.compare.comparison import Comparison
from skyarm.compile import leaves
from skyarm.control.catalogue import LAWS, PRESETS, aliases, full_name, make_controller, make_named, make_tuned, preset
from skyarm.control.catalogue.presets import ALIASES as PRESET_ALIASES
from skyarm.control.catalogue.presets import OLD_NAMES as OLD_PRESETS
from skyarm.control.model import Model
from skyarm.environment.environment_tables import wind_from
from skyarm.files.old_names import OldNameWarning
from skyarm.registry.registrations import RegistryError, add, find
from skyarm.registry.shipped import ALIASES, OLD_NAMES
from skyarm.scenario.scenario_file import load_scenario
from skyarm.sweep.plan import prepare
from skyarm.sweep.study_file import study_from

MODEL = Model(vehicle=library.load_vehicle("hummingbird_arm2"))
STAYS = {**PRESET_ALIASES, **ALIASES["law"]}
OLD = {**OLD_PRESETS, **OLD_NAMES["law"]}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_other_names_are_of_controllers_that_are_there_and_hide_none() -> None:
    for other, own in {**STAYS, **OLD}.items():
        assert own in (*PRESETS, *LAWS)
        assert other not in (*PRESETS, *LAWS)
    assert {name: aliases(name) for name in ("centroidal_tip", "centroidal", "indi")} == {
        "centroidal_tip": ["exact_ee"],
        "centroidal": ["exact"],
        "indi": [],
    }


@pytest.mark.parametrize(("alias", "name"), STAYS.items())
def test_an_alias_is_the_same_controller_without_a_warning(alias: str, name: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found, own = make_named(alias, MODEL), make_named(name, MODEL)
        assert full_name(alias) == name
    assert (found.name, leaves(found.par)) == (own.name, leaves(own.par))


@pytest.mark.parametrize(("old", "name"), OLD.items())
def test_an_old_name_is_the_same_controller_and_one_warning_says_the_new_one(old: str, name: str) -> None:
    with pytest.warns(OldNameWarning) as caught:
        found = make_named(old, MODEL)
    own = make_named(name, MODEL)
    assert (found.name, leaves(found.par)) == (own.name, leaves(own.par))
    (line,) = {str(each.message) for each in caught}
    assert repr(old) in line
    assert f"use {name!r}" in line


def test_makers_take_other_names_as_well() -> None:
    assert preset("exact_ee", MODEL).name == "centroidal_tip"
    assert make_controller("exact", MODEL, mode="ee").name == make_controller("centroidal", MODEL, mode="tip").name
    with pytest.warns(OldNameWarning, match="kim2013"):
        old = make_tuned("kim_sliding_mode_style", MODEL)
    assert leaves(old.par) == leaves(make_tuned("kim2013", MODEL).par)
    with pytest.warns(OldNameWarning, match="kim2013"):
        assert full_name("kim_sliding_mode_style_tuned") == "kim2013_tuned"


def test_a_plugin_cannot_take_another_name_of_ours() -> None:
    with pytest.raises(RegistryError, match="law 'exact': is another name of 'centroidal'"):
        add("law", "exact", lambda model: None)


def table(controller: str) -> str:
    """A scenario whose controller is given as TOML."""
    return f"""
schema = 1
name = "x"
duration = 0.1
plant = {{ vehicle = "hummingbird_arm2_rotors" }}
model = {{ vehicle = "hummingbird_arm2" }}
reference = {{ base = {{ kind = "hover", position = [0, 0, 2] }} }}
controller = {{ {controller} }}
"""


def test_a_file_takes_other_names(folder: Path) -> None:
    for i, (words, name) in enumerate(
        [
            ('preset = "exact_ee_stiff"', "centroidal_tip_stiff"),
            ('law = "exact"\nmode = "ee"', "centroidal_tip_robust"),
        ]
    ):
        (folder / f"{i}.toml").write_text(table(words.replace("\n", ", ")))
        assert load_scenario(folder / f"{i}.toml").controller.name == name
    (folder / "old.toml").write_text(table('law = "guo_center_of_inertia_style", tuned = true'))
    with pytest.warns(OldNameWarning, match="guo2023"):
        assert load_scenario(folder / "old.toml").controller.name == "guo2023"


def test_the_command_line_says_the_new_name_in_one_line_and_nothing_of_an_alias(folder: Path) -> None:
    ended = skyarm("run", "case1", "--duration", "0.1", "--controller", "li_feedforward_style")
    assert ended.code == 0
    (line,) = [line for line in ended.err.splitlines() if "li2024" in line]
    assert line.startswith("skyarm: law 'li_feedforward_style' is an old name: use 'li2024'")
    for command in (
        ("run", "case1", "--duration", "0.1", "--controller", "exact_ee", "--out", "run"),
        ("export", "exact_joint", "--to", "c", "--vehicle", "hummingbird_arm2", "--out", "x.c"),
    ):
        ended = skyarm(*command)
        assert (ended.code, "old name" in ended.err) == (0, False), ended.err


def test_the_list_shows_aliases(folder: Path) -> None:
    ended = skyarm("show", "--out", "l.json")
    found = {each["name"]: each for each in json.loads((folder / "l.json").read_text())["presets"]}
    assert found["centroidal_tip_stiff"]["aliases"] == ["exact_ee_stiff"]
    assert found["paper_ct"]["aliases"] == []
    assert "(also exact_ee_stiff)" in " ".join(ended.out.split())


def study(*controllers: str, **more: str):
    """A study of some controllers."""
    return study_from(
        {
            "schema": 1,
            "name": "x",
            "scenario": "case1",
            "duration": 0.1,
            "episodes": 2,
            "controllers": list(controllers),
            **more,
            "vary": {"plant.vehicle.base.mass": {"uniform": [0.6, 0.7]}},
        }
    )


def test_a_study_named_with_an_alias_is_the_same_study() -> None:
    alias, own = study("exact_ee", "paper_ct"), study("centroidal_tip", "paper_ct")
    assert alias.document == own.document
    assert list(alias.scenarios) == ["centroidal_tip", "paper_ct"]
    assert prepare(alias).digest == prepare(own).digest
    with pytest.raises(ValueError, match="must be a list of different presets or laws"):
        study("exact_ee", "centroidal_tip")


def test_the_old_name_of_a_precision_is_the_same_study() -> None:
    with pytest.warns(OldNameWarning) as caught:
        before = study("paper_ct", precision="exact")
    old(caught, "'bit_exact'")
    assert before.document == study("paper_ct", precision="bit_exact").document


def test_the_old_name_of_bit_exact_batches_makes_them_bit_exact() -> None:
    scenario = load_scenario("case1", duration=0.1)
    with pytest.warns(OldNameWarning) as caught:
        before = library.Batch(scenario, exact=True, effort=0).fly({}).state
    old(caught, "bit_exact")
    assert leaves(before) == leaves(library.Batch(scenario, bit_exact=True, effort=0).fly({}).state)
    assert leaves(before) != leaves(library.Batch(scenario, effort=0).fly({}).state)


def test_reproduce_takes_the_old_name_of_a_comparison() -> None:
    with pytest.warns(OldNameWarning) as caught, pytest.raises(ValueError, match="plants"):
        library.reproduce(plants=("none",), bench=Comparison())
    old(caught, "comparison")


def test_a_comparison_takes_other_names_as_the_same_law() -> None:
    from skyarm.cli.compare_command import _entrants

    for words in ("exact_ee, exact_ee without observer", "centroidal_tip,centroidal_tip without observer"):
        assert list(_entrants(words)) == ["centroidal_tip", "centroidal_tip without observer"]


def test_a_comparison_names_its_entrants_of_which_a_list_of_laws_has_not_all() -> None:
    from skyarm.cli.compare_command import _entrants
    from skyarm.compare.entrants import ENTRANTS

    with pytest.raises(ValueError, match=re.escape(f"must be one of {', '.join(ENTRANTS)}")):
        _entrants("xyzzy")


def old(value: object, name: str) -> None:
    """The one warning of an old name says the new one."""
    (line,) = {str(each.message) for each in value}  # type: ignore[attr-defined]
    assert f"use {name}" in line


def test_old_names_of_winds_are_read(folder: Path) -> None:
    for mode, name, found in (("airspeed", "moving_air", "MovingAir"), ("rotors_force", "force_wind", "ForceWind")):
        with pytest.warns(OldNameWarning) as caught:
            wind = wind_from({"mode": mode}, "wind")
        assert type(wind).__name__ == found
        old(caught, repr(name))
    for kind, mode, name in (("air", "airspeed", "moving_air"), ("force", "rotors_force", "force_wind")):
        with pytest.warns(OldNameWarning) as caught:
            assert find(kind, mode) is find(kind, name)
        old(caught, repr(name))


def test_old_names_of_options_are_read() -> None:
    with pytest.warns(OldNameWarning) as caught:
        found = make_controller("decoupled_pd", MODEL, mixer_policy="rotors_clip")
    assert found.par.mixer.policy == "clip"
    old(caught, "'clip'")
    with pytest.warns(OldNameWarning) as caught:
        assert make_mixer(MODEL.vehicle, "rotors_clip").policy == "clip"
    old(caught, "'clip'")
    with pytest.warns(OldNameWarning) as caught:
        found = make_controller("decoupled_pd", MODEL, rate_error="rotors")
    assert found.par.rate_error == "rotors_sim"
    old(caught, "'rotors_sim'")


@pytest.mark.parametrize(("before", "name"), library._OLD.items())
def test_old_names_of_the_front_are_the_new_things(before: str, name: str) -> None:
    with pytest.warns(OldNameWarning) as caught:
        found = getattr(library, before)
    assert found is getattr(library, name)
    old(caught, f"skyarm.{name}")
    assert before not in library.__all__


@pytest.mark.parametrize(
    ("module", "before", "name"),
    [
        ("skyarm.control.laws.centroidal", "make_exact", "make_centroidal"),
        ("skyarm.control.laws.centroidal", "exact", "centroidal"),
        ("skyarm.control.laws.centroidal", "ExactParameters", "CentroidalParameters"),
        ("skyarm.control.safety", "guarded", "with_safety_layer"),
        ("skyarm.control.controller", "informed", "with_applied_command"),
        ("skyarm.control.controller", "all_obeyed", "all_applied"),
        ("skyarm.control.catalogue", "tuned", "make_tuned"),
        ("skyarm.control.catalogue", "named", "make_named"),
    ],
)
def test_old_names_of_documented_functions_are_the_new_ones(module: str, before: str, name: str) -> None:
    room = import_module(module)
    with pytest.warns(OldNameWarning) as caught:
        assert getattr(room, before) is getattr(room, name)
    old(caught, name)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        room.nothing  # noqa: B018
