"""Vehicle files of the page on your vehicle: the starter, an arm by ``[[attach]]``, and
``export --to mjcf``.
"""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import mujoco
import pytest

from skyarm.scenario.scenario_file import load_scenario
from skyarm.simulate import run
from skyarm.vehicle.vehicle_files import load_vehicle
from support.cases import joint, limits, link, robot, saved
from support.commands import refused, skyarm

TOOL = (
    '<link name="{0}"/><joint name="f{0}" type="fixed"><parent link="{1}"/><child'
    ' link="{0}"/></joint>'
)
ARM = (
    link("mount"),
    link("a"),
    link("b"),
    joint("ja", "mount", "a", limits()),
    joint("jb", "a", "b", limits()),
)


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    saved(
        tmp_path,
        robot(*ARM, TOOL.format("tool0", "b"), TOOL.format("camera", "b")),
        "arm.urdf",
    )
    return tmp_path


def test_a_scenario_is_exported_with_its_gravity_and_first_state(here):
    assert skyarm("export", "--to", "mjcf", "case3", "-o", "x.xml").code == 0
    model = mujoco.MjModel.from_xml_path("x.xml")
    assert model.key(0).qpos[2] > 0.0
    assert (
        skyarm(
            "export",
            "--to",
            "mjcf",
            "case3",
            "-o",
            "x.xml",
            "--gravity",
            "1.62",
            "--timestep",
            "0.002",
        ).code
        == 0
    )
    model = mujoco.MjModel.from_xml_path("x.xml")
    assert (model.opt.gravity[2], model.opt.timestep) == (-1.62, 0.002)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("eagle", "-o", "x.xml"), "vehicle = 'eagle': "),
        (("case3", "-o", "x.urdf"), "--out = 'x.urdf': must end in .xml or .mjcf"),
        (("case3", "-o", "x.xml", "--gravity", "-1"), "--gravity = -1"),
        (
            ("case3", "-o", "x.xml", "--timestep", "1"),
            "--timestep = 1.0: must be at most 0.1 s",
        ),
        (
            ("hummingbird_arm2", "-o", "x.xml"),
            "planar = True: must be false in a plant",
        ),
        (("arm.toml", "-o", "x.xml"), "vehicle = 'arm.toml': no such file"),
    ],
)
def test_what_cannot_be_exported_is_one_line(here, words, message):
    refused(skyarm("export", "--to", "mjcf", *words), message)
    assert not (here / "x.xml").exists()


def test_show_prints_the_notes_of_a_file(here):
    saved(
        here,
        robot(
            link("b"), link("a"), joint("j", "b", "a", "", "continuous"), "<gazebo/>"
        ),
        "v.urdf",
    )
    shown = skyarm("show", "v.urdf", columns=200)
    assert shown.code == 0, shown.err
    assert (
        "joint j: without an effort, so passive; [[joints]] effort_limit gives it a"
        " drive" in shown.out
    )
    assert (
        "<gazebo> (1): not read"
        in json.loads(skyarm("show", "v.urdf", "--json").out)["notes"]
    )


ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "your_vehicle.md").read_text("utf-8")
MOUNTED = (ROOT / "docs" / "mount_an_arm.md").read_text("utf-8")
PICKER = (ROOT / "examples" / "picker.urdf").read_text("utf-8")


@pytest.fixture(scope="module")
def shown():
    """Blocks of the pages on vehicles and arms: title or language -> text."""
    fences = re.findall(
        r"```(\w+)(?: title=\"(\S+)\")?\n(.*?)```", PAGE + MOUNTED, re.DOTALL
    )
    return {title or language: text for language, title, text in fences}


SWING = """
name = "swing"
duration = 6.0
plant = { vehicle = "carrier.toml" }
controller = { law = "centroidal" }

[reference]
base = { kind = "hover", position = [0.0, 0.0, 1.5] }
joints = [
    { kind = "sine", amplitude = 0.6, frequency_hz = 0.3, start = 1.0 },
    { kind = "sine", amplitude = 0.8, frequency_hz = 0.3, start = 1.0 },
    { kind = "constant", value = 0.02 },
]
"""


@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
def test_the_arm_of_the_page_flies_on_both_plants_with_its_second_finger(
    here, shown, plant
):
    """In Python floats, 0.1 s: the fingers open by a centimetre against each other."""
    (here / "examples").mkdir()
    saved(here, PICKER, "examples/picker.urdf")
    saved(here, shown["carrier.toml"], "carrier.toml")
    saved(here, SWING, "swing.toml")
    scenario = load_scenario(here / "swing.toml", duration=0.1, plant=plant)
    assert [each.name for each in scenario.plant.vehicle.followers] == ["right_finger"]
    # in Python floats: tracing a law costs seconds
    par = scenario.controller.par
    controller = replace(scenario.controller, compiled=False)
    log = run(replace(scenario, controller=controller))
    assert (log.status, par.model.vehicle.n) == ("completed", 3)
    # it starts beside the reference of 2 cm, which the finger goes to
    assert (
        abs(log.joints[-1, 2] - 0.02) < 0.5 * abs(log.joints[0, 2] - 0.02)
        or abs(log.joints[-1, 2] - 0.02) < 1e-4
    )


def words(text: str) -> str:
    """Text whose blanks and ends of lines are one blank each."""
    return " ".join(text.split())


def test_the_parts_shown_are_those_of_a_new_vehicle(here):
    assert skyarm("new", "vehicle", "my_copter").code == 0
    written = (here / "my_copter.toml").read_text("utf-8")
    parts = re.findall(r"```toml\n(.*?)```", PAGE + MOUNTED, re.DOTALL)
    *of_the_file, servo = parts
    assert len(of_the_file) == 2
    assert all(part.rstrip() in written for part in of_the_file)
    saved(here, f"{written}\n{servo}", "servo.toml")
    assert skyarm("check", "servo.toml").code == 0
    assert [each.name for each in load_vehicle("servo.toml").drives] == ["shoulder"]


def test_a_joint_that_is_too_weak_reads_as_the_page_shows(here):
    assert skyarm("new", "vehicle", "my_copter").code == 0
    written = (here / "my_copter.toml").read_text("utf-8")
    saved(
        here,
        written.replace("effort_limit = 1.5", "effort_limit = 0.25", 1),
        "my_copter.toml",
    )
    found = skyarm("check", "my_copter.toml", columns=100)
    (lines,) = re.findall(r"```text\n(fault .*?)```", PAGE, re.DOTALL)
    assert found.code == 1
    for line in lines.strip().split("\n\n"):
        assert words(line) in words(found.out)


def test_a_vehicle_that_can_fly_reads_as_the_page_shows(here):
    assert skyarm("new", "vehicle", "my_copter").code == 0
    found = skyarm("check", "my_copter.toml", columns=100)
    (lines,) = re.findall(r"```text\n(note  time aloft.*?)```", PAGE, re.DOTALL)
    assert found.code == 0
    for line in lines.strip().split("\n\n"):
        assert words(line) in words(found.out)


def test_the_scenario_of_a_new_vehicle_can_fly(here):
    """Its loop too, about a hover in which all readings repeat."""
    assert skyarm("new", "vehicle", "my_copter").code == 0
    found = skyarm("check", "my_copter_hover.toml")
    assert (found.code, "can fly: no fault, 0 warnings" in found.out) == (0, True)
