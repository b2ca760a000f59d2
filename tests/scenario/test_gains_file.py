"""Files of gains: flown as they say, refused in one line."""

from __future__ import annotations

import os
import re

import pytest

from added_components import registry_kept
from skyarm.files import read_toml
from skyarm.registry.plugins import load_file
from skyarm.scenario.gains_file import controller_of_file
from skyarm.scenario.scenario_file import LIBRARY, load_scenario, scenario_from

GAINS = """
schema = 1
[law]
preset = "paper_ct"
[gains]
"gains.position" = 8.0
"joint_gains.stiffness" = [700.0, 300.0]
[about]
seed = 1
"""


def write(folder, text, name="tuned.toml"):
    (folder / name).write_text(text, "utf-8")
    return str(folder / name)


def test_a_controller_is_named_by_the_path_of_its_gains(tmp_path):
    plain, tuned = load_scenario("case3"), load_scenario("case3", controller=write(tmp_path, GAINS))
    before, after = plain.controller.par, tuned.controller.par
    assert tuple(after.gains.position) == (8.0, 8.0, 8.0)
    assert after.joint_gains.stiffness == (700.0, 300.0)
    assert (after.gains.rate, after.joint_gains.damping) == (before.gains.rate, before.joint_gains.damping)
    assert after.model == before.model


def test_a_scenario_names_gains_that_lie_beside_it(tmp_path):
    write(tmp_path, GAINS)
    document = read_toml((LIBRARY / "case3.toml").read_bytes())
    document["controller"] = {"tuned": "tuned.toml", "safety": True}
    found = scenario_from(document, tmp_path)
    assert tuple(found.controller.par.inner.gains.position) == (8.0, 8.0, 8.0)
    document["controller"] = {"tuned": "tuned.toml", "preset": "paper_ct"}
    with pytest.raises(
        ValueError, match=r"controller.preset = 'paper_ct': must be left out: the file of controller.tuned"
    ):
        scenario_from(document, tmp_path)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (('"gains.position" = 8.0', '"gains.positon" = 8.0'), "gains.'gains.positon': did you mean 'position'"),
        (("= 8.0", "= [8.0, 8.0]"), "must be one number, or a list of 3"),
        (("= 8.0", "= -8.0"), "gains.'gains.position' = -8.0: must be"),
        (("= 8.0", '= "stiff"'), "gains.'gains.position' = 'stiff': must be"),
        (("= 8.0", "= inf"), "gains.'gains.position' = inf: must be"),
        (("gains.position", "model.gravity"), "must be a path of the law's constants"),
        (('"gains.position" = 8.0', "gains = [1.0]"), "must be one number, or a list of 12"),
        (('preset = "paper_ct"', 'preset = "paper_ctt"'), "did you mean 'paper_ct'"),
        (('preset = "paper_ct"', 'law = "own.py:make"'), "must be loaded on the command line: --plugin own.py"),
        (('preset = "paper_ct"', 'tuned = "other.toml"'), "one file does not name another"),
        (("schema = 1", "schema = 2"), "schema = 2: must be 1"),
        (("[about]", "[abuot]"), "abuot"),
        (("[law]", "[lawn]"), "law: is missing"),
        (("schema = 1", "schema = "), "tuned.toml"),
    ],
)
def test_what_is_wrong_with_a_file_is_one_line_that_names_it(tmp_path, change, words):
    assert change[0] in GAINS
    path = write(tmp_path, GAINS.replace(*change, 1))
    with pytest.raises(ValueError, match=re.escape(words)) as caught:
        load_scenario("case3", controller=path)
    assert str(caught.value).startswith("case3: ") or path in str(caught.value)
    assert "\n" not in str(caught.value)
    assert path in str(caught.value)


def test_what_is_no_file_of_gains_is_refused(tmp_path):
    model = load_scenario("case3").controller.par.model
    for name, words in (
        ("none.toml", "no such file"),
        (7, "must be true, false, or a file"),
        ("", "must be true, false, or a file"),
    ):
        with pytest.raises(ValueError, match=f"controller.tuned = .*{words}"):
            controller_of_file(name, tmp_path, model, {}, "controller.tuned")
    vehicle = write(tmp_path, "schema = 1\n[base]\nmass = 1.0\n", "vehicle.toml")
    with pytest.raises(ValueError, match="must be a file of gains, and this is a vehicle file, for 'skyarm show'"):
        load_scenario("case3", controller=vehicle)
    gains = write(tmp_path, GAINS)
    with pytest.raises(ValueError, match="must be a scenario file, and this is a file of gains"):
        load_scenario(gains)


@pytest.mark.skipif(os.geteuid() == 0 if hasattr(os, "geteuid") else True, reason="root reads everything")
def test_a_file_that_cannot_be_read_is_named(tmp_path):
    path = write(tmp_path, GAINS)
    os.chmod(path, 0)
    with pytest.raises(ValueError, match="must be readable"):
        load_scenario("case3", controller=path)


def test_gains_of_a_law_of_ones_own_fly_once_its_file_is_loaded(tmp_path, monkeypatch):
    source = (
        "import dataclasses\nimport skyarm\nfrom skyarm.control.catalogue import make_controller\n\n\n"
        "def make(model: skyarm.Model, *, push: float = 1.0) -> skyarm.Controller:\n"
        "    return dataclasses.replace(make_controller('decoupled_pd', model), name='mine')\n"
    )
    (tmp_path / "own_of_gains.py").write_text(source, "utf-8")
    monkeypatch.chdir(tmp_path)
    path = write(tmp_path, GAINS.replace('preset = "paper_ct"', 'law = "own_of_gains.py:make"'))
    with pytest.raises(ValueError, match="must be loaded on the command line"):
        load_scenario("case3", controller=path)
    with registry_kept():
        load_file("own_of_gains.py")
        assert tuple(load_scenario("case3", controller=path).controller.par.gains.position) == (8.0, 8.0, 8.0)
