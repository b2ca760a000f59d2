"""``skyarm check``: exit codes, documents, hostile input."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from skyarm.scenario.scenario_file import LIBRARY as SCENARIOS
from skyarm.vehicle.vehicle_files import LIBRARY
from support.commands import refused, skyarm

FEW = ("--arm-poses", "4")


def shipped(name: str) -> str:
    return (Path(str(LIBRARY)) / f"{name}.toml").read_text("utf-8")


def scenario_text(name: str) -> str:
    return (Path(str(SCENARIOS)) / f"{name}.toml").read_text("utf-8")


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_vehicle_that_flies_ends_with_zero_and_says_so():
    done = skyarm("check", "pelican_arm2", *FEW)
    assert done.code == 0
    assert done.out.rstrip().endswith("can fly: no fault, 0 warnings")
    assert not re.search(r"^(ok|fault|warning) ", done.out, re.MULTILINE)
    assert re.search(
        r"^\d+ without an alarm: .*thrust\s+margin\s+[\d.]+;",
        done.out,
        re.MULTILINE | re.DOTALL,
    )


def test_a_fault_ends_with_one_and_names_field_number_limit_and_remedy():
    done = skyarm("check", "pelican_arm2", "--payload", "0.2", *FEW, columns=300)
    assert done.code == 1
    line = next(
        each
        for each in done.out.splitlines()
        if each.startswith("fault in joints[shoulder].effort_limit")
    )
    assert re.search(r"\(0\.5\d+ N m, limit 0\.26 N m\): a stronger drive", line)
    assert "cannot fly as described: " in done.out


def test_alarms_come_first_and_the_fine_answers_in_short_behind_them():
    done = skyarm("check", "pelican_arm2", "--payload", "0.2", *FEW, columns=300)
    levels = [
        line.split()[0]
        for line in done.out.splitlines()
        if re.match(r"(fault|warning|note|\d+ without) ", line)
    ]
    places = {
        level: levels.index(level)
        for level in dict.fromkeys(levels)
        if not level.isdigit()
    }
    assert next(iter(places)) == "fault"
    assert levels[-1].isdigit()
    assert not re.search(r"^ok ", done.out, re.MULTILINE)


def test_a_plan_that_its_arm_hardly_reaches_is_no_question_of_units(here):
    text = (
        Path("pick.toml"),
        scenario_text("pick_and_carry").replace(
            "posture = [-0.45, -0.9]", "posture = [0.0, 0.0]"
        ),
    )
    text[0].write_text(text[1], "utf-8")
    findings = json.loads(skyarm("check", "pick.toml", "--json", *FEW).out)["findings"]
    said = {each["question"]: each for each in findings if each["level"] == "warning"}
    assert said["plan of the reference"]["text"].startswith("reference.tip")
    assert [each["level"] for each in findings if each["question"] == "units"] == [
        "ok",
        "ok",
    ]


def test_what_the_parts_of_a_scenario_warn_of_is_a_warning(here):
    text = scenario_text("press_and_hold").replace(
        "stiffness = 5000.0", "stiffness = 1e5"
    )
    Path("hard.toml").write_text(text, "utf-8")
    findings = json.loads(skyarm("check", "hard.toml", "--json", *FEW).out)["findings"]
    (found,) = [each for each in findings if each["question"] == "environment"]
    assert found["level"] == "warning"
    assert "asks for integration steps of" in found["text"]


def test_a_scenario_is_checked_along_its_reference():
    done = skyarm("check", "case2", "--json", *FEW)
    found = json.loads(done.out)
    assert done.code == 0
    assert (found["name"], found["vehicle"], found["gravity_m_s2"]) == (
        "case2",
        "hummingbird_arm2_rotors",
        9.8,
    )
    assert "rotors along the reference" in [
        each["question"] for each in found["findings"]
    ]


def test_a_document_holds_every_finding_and_no_number_that_json_lacks():
    done = skyarm("check", "hummingbird", "--json", *FEW)
    found = json.loads(done.out, parse_constant=pytest.fail)
    keys = {
        "question",
        "level",
        "text",
        "field",
        "value",
        "limit",
        "unit",
        "remedy",
        "joints",
        "concerns",
        "follows",
    }
    assert all(set(each) == keys for each in found["findings"])
    assert found["can_fly"] is True
    assert {each["level"] for each in found["findings"]} <= {
        "ok",
        "note",
        "warning",
        "fault",
    }


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("nope",), ("vehicle = 'nope'", "hummingbird")),
        (("nope.toml",), ("nope.toml",)),
        (("hummingbird", "--payload", "-1"), ("--payload = -1.0", "at least 0")),
        (("pelican_arm2", "--payload", "nan"), ("--payload = nan",)),
        (
            ("pelican_arm2", "--payload", "1e300"),
            ("--payload = 1e+300: must be at most 10000",),
        ),
        (("hummingbird", "--payload", "1"), ("--payload = 1", "no tip")),
        (("pelican_arm2", "--arm-poses", "0"), ("--arm-poses = 0", "1 to 1000000")),
        (("pelican_arm2", "--arm-poses", "9999999"), ("--arm-poses = 9999999",)),
        (("pelican_arm2", "--gravity", "0"), ("--gravity = 0",)),
        (("case2", "--gravity", "9"), ("--gravity = 9", "plant.gravity")),
        (("robustness",), ("robustness",)),
    ],
)
def test_wrong_words_are_one_line(here, words, said):
    refused(skyarm("check", *words), *said)


def test_files_that_are_no_vehicles_are_one_line(here):
    (here / "bits.toml").write_bytes(bytes(range(256)))
    (here / "folder.toml").mkdir()
    (here / "half.toml").write_text('schema = 1\nname = "x"\n[plant]\n', "utf-8")
    (here / "study.toml").write_text('scenario = "case1"\nepisodes = 2\n', "utf-8")
    for name in ("bits.toml", "folder.toml", "half.toml", "study.toml"):
        refused(skyarm("check", name), name)


def test_a_vehicle_that_nothing_holds_up_is_a_fault_and_no_error(here):
    text = shipped("hummingbird")
    bare = text[: text.index("[rotor_defaults]")]
    (here / "bare.toml").write_text(bare, "utf-8")
    done = skyarm("check", "bare.toml", *FEW, columns=200)
    assert (done.code, done.err) == (1, "")
    assert "fault in rotors" in done.out


def test_rotors_that_cannot_turn_it_are_a_fault_with_the_rank(here):
    text = re.sub(
        r"position = \[[^]]*\]", "position = [0.0, 0.0, 0.1]", shipped("hummingbird")
    )
    (here / "stacked.toml").write_text(text, "utf-8")
    done = skyarm("check", "stacked.toml", *FEW, columns=200)
    assert (done.code, done.err) == (1, "")
    assert re.search(
        r"allocation of 4 rotors has rank [12]: must be 4; no roll torque, pitch"
        r" torque",
        done.out,
    )


def test_rotors_without_a_highest_speed_leave_the_margin_open(here):
    text = re.sub(r"max_speed = .*", "", shipped("pelican_arm2"))
    text = re.sub(r'"rotor_defaults" = .*', "", text)
    (here / "free.toml").write_text(text, "utf-8")
    done = skyarm("check", "free.toml", *FEW, columns=300)
    assert (done.code, done.err) == (0, "")
    assert "not known: a rotor has no max_speed" in done.out
