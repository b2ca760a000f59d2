"""Files of gains: flown as they say, refused in one line."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

import skyarm
from skyarm.records.files import read_toml
from skyarm.records.registry.plugins import load_plugin
from skyarm.scenario.controller_table import controller_of_file
from skyarm.scenario.scenario_file import LIBRARY, load_scenario, scenario_from
from support.commands import skyarm as command
from support.components import registry_kept

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
    plain, tuned = (
        load_scenario("case3"),
        load_scenario("case3", controller=write(tmp_path, GAINS)),
    )
    before, after = plain.controller.par, tuned.controller.par
    assert tuple(after.gains.position) == (8.0, 8.0, 8.0)
    assert after.joint_gains.stiffness == (700.0, 300.0)
    assert (after.gains.rate, after.joint_gains.damping) == (
        before.gains.rate,
        before.joint_gains.damping,
    )
    assert after.model == before.model


def test_a_scenario_names_gains_that_lie_beside_it(tmp_path):
    write(tmp_path, GAINS)
    document = read_toml((LIBRARY / "case3.toml").read_bytes())
    document["controller"] = {"tuned": "tuned.toml", "safety": True}
    found = scenario_from(document, tmp_path)
    assert tuple(found.controller.par.inner.gains.position) == (8.0, 8.0, 8.0)
    document["controller"] = {"tuned": "tuned.toml", "preset": "paper_ct"}
    with pytest.raises(
        ValueError,
        match=(
            r"controller.preset = 'paper_ct': must be left out: the file of"
            r" controller.tuned"
        ),
    ):
        scenario_from(document, tmp_path)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            ('"gains.position" = 8.0', '"gains.positon" = 8.0'),
            "gains.'gains.positon': did you mean 'position'",
        ),
        (("= 8.0", "= [8.0, 8.0]"), "must be one number, or a list of 3"),
        (("= 8.0", "= -8.0"), "gains.'gains.position' = -8.0: must be"),
        (("= 8.0", '= "stiff"'), "gains.'gains.position' = 'stiff': must be"),
        (("= 8.0", "= inf"), "gains.'gains.position' = inf: must be"),
        (("gains.position", "model.gravity"), "must be a path of the law's constants"),
        (
            ('"gains.position" = 8.0', "gains = [1.0]"),
            "must be one number, or a list of 12",
        ),
        (('preset = "paper_ct"', 'preset = "paper_ctt"'), "did you mean 'paper_ct'"),
        (
            ('preset = "paper_ct"', 'law = "own.py:make"'),
            "loaded: --plugin own.py or skyarm.load_plugin('own.py')",
        ),
        (
            ('preset = "paper_ct"', 'tuned = "other.toml"'),
            "one file does not name another",
        ),
        (("schema = 1", "schema = 2"), "schema = 2: must be 1"),
        (("[about]", "[abuot]"), "abuot"),
        (
            ("[law]", "[lawn]"),
            "law: is missing; is 'lawn' a misspelling of it? there are",
        ),
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
    with pytest.raises(
        ValueError,
        match="must be a file of gains, and this is a vehicle file, for 'skyarm show'",
    ):
        load_scenario("case3", controller=vehicle)
    gains = write(tmp_path, GAINS)
    with pytest.raises(
        ValueError, match="must be a scenario file, and this is a file of gains"
    ):
        load_scenario(gains)


@pytest.mark.skipif(
    os.geteuid() == 0 if hasattr(os, "geteuid") else True,
    reason="root reads everything",
)
def test_a_file_that_cannot_be_read_is_named(tmp_path):
    path = write(tmp_path, GAINS)
    os.chmod(path, 0)
    with pytest.raises(ValueError, match="must be readable"):
        load_scenario("case3", controller=path)


def test_gains_of_a_law_of_ones_own_fly_once_its_file_is_loaded(tmp_path, monkeypatch):
    source = (
        "import dataclasses\nimport skyarm\nfrom skyarm.control.catalogue import"
        " make_controller\n\n\ndef make(model: skyarm.Model, *, push: float = 1.0) ->"
        " skyarm.Controller:\n    made = make_controller('decoupled_pd', model)\n   "
        " gains = dataclasses.replace(made.par.gains, rate=made.par.gains.rate *"
        " push)\n    return dataclasses.replace(made, name='mine',"
        " par=dataclasses.replace(made.par, gains=gains))\n"
    )
    (tmp_path / "own_of_gains.py").write_text(source, "utf-8")
    monkeypatch.chdir(tmp_path)
    path = write(
        tmp_path, GAINS.replace('preset = "paper_ct"', 'law = "own_of_gains.py:make"')
    )
    with pytest.raises(ValueError, match="must be loaded: --plugin"):
        load_scenario("case3", controller=path)
    with registry_kept():
        load_plugin("own_of_gains.py")
        assert tuple(
            load_scenario("case3", controller=path).controller.par.gains.position
        ) == (8.0, 8.0, 8.0)
        usual = load_scenario("case3", controller=path).controller.par.gains.rate
        options = GAINS.replace(
            'preset = "paper_ct"', 'law = "own_of_gains.py:make"\npush = 2.0'
        )
        pushed = load_scenario(
            "case3", controller=write(tmp_path, options)
        ).controller.par.gains
        assert (pushed.rate, pushed.position.x) == (usual * 2.0, 8.0)
        with pytest.raises(
            ValueError,
            match=r"law.pusch = 2.0: law '.*own_of_gains.py:make' has no such option",
        ):
            load_scenario(
                "case3",
                controller=write(tmp_path, options.replace("push =", "pusch =")),
            )


def test_a_file_of_gains_is_a_controller_in_python(tmp_path):
    model = skyarm.Model(vehicle=skyarm.load_vehicle("hummingbird_arm2"))
    adaptive = GAINS.replace("paper_ct", "centroidal_tip").split('"gains.position"')[0]
    path = Path(write(tmp_path, adaptive + '"base.position" = 20.0\n'))
    found = skyarm.load_controller(path, model, delay=0.01, control_period=0.0025).par
    assert (tuple(found.base.position), found.delay_periods) == ((20.0, 20.0, 20.0), 4)
    assert found.parts.lag.stride == 2, "the period reaches the law"
    for wrong, words in (
        ({"delay": -1.0}, "delay = -1.0: must be"),
        ({"control_period": 0.0}, "control_period = 0.0"),
    ):
        with pytest.raises(ValueError, match=words):
            skyarm.load_controller(path, model, **wrong)
    with pytest.raises(ValueError, match="model = 'hummingbird': must be a Model"):
        skyarm.load_controller(path, "hummingbird")


def test_a_file_of_gains_is_exported(tmp_path):
    path, out = write(tmp_path, GAINS, "calm gains.toml"), tmp_path / "law.c"
    words = ("-o", str(out), "--vehicle", "hummingbird_arm2")
    told = command("export", path, "--to", "c", *words).out
    assert "calm_gains_step, hybrid_computed_torque for hummingbird_arm2" in told
    assert "{8.0, 8.0, 8.0}, /* gains_position */" in out.read_text()
    refused = command("export", path, "--to", "c", "-o", str(out)).err
    assert re.search(r"--vehicle: is missing; controller '.*calm gains.toml'", refused)
    wrong = write(tmp_path, GAINS.replace("gains.position", "gains.positon"))
    assert (
        "did you mean 'position'" in command("export", wrong, "--to", "c", *words).err
    )


def test_a_law_that_cannot_be_tuned_may_say_so():
    document = read_toml((LIBRARY / "case3.toml").read_bytes())
    usual = scenario_from(
        document | {"controller": {"law": "rotors_sim_position"}}
    ).controller
    assert (
        scenario_from(
            document | {"controller": {"law": "rotors_sim_position", "tuned": False}}
        ).controller
        == usual
    )
    with pytest.raises(ValueError, match=r"controller\.tuned = True: "):
        scenario_from(
            document | {"controller": {"law": "rotors_sim_position", "tuned": True}}
        )
