"""``skyarm attach`` and ``skyarm export-mjcf``: the files they write, and what they refuse."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import mujoco
import pytest

from commanded import refused, skyarm
from skyarm.scenario.scenario_file import load_scenario
from skyarm.simulate import run
from skyarm.vehicle.vehicle_files import load_vehicle
from urdf_texts import joint, limits, link, robot, saved

TOOL = '<link name="{0}"/><joint name="f{0}" type="fixed"><parent link="{1}"/><child link="{0}"/></joint>'
ARM = (link("mount"), link("a"), link("b"), joint("ja", "mount", "a", limits()), joint("jb", "a", "b", limits()))


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    saved(tmp_path, robot(*ARM, TOOL.format("tool0", "b"), TOOL.format("camera", "b")), "arm.urdf")
    return tmp_path


def test_the_file_refers_to_both_and_leaves_them_as_they_are(here):
    (here / "arms").mkdir()
    (here / "mine").mkdir()
    (here / "arm.urdf").rename(here / "arms" / "arm.urdf")
    before = (here / "arms" / "arm.urdf").read_bytes()
    words = ("--to", "base", "--position", "0", "0", "-0.1", "--rpy", "0", "0", "-1.57", "--prefix", "my_")
    done = skyarm("attach", "tilted_hexarotor", "arms/arm.urdf", "-o", "mine/both.toml", *words, "--json")
    assert done.code == 0, done.err
    said = json.loads(done.out)
    assert (said["joints"], said["tip"], said["rotors"]) == (["my_ja", "my_jb"], "my_tool0", 6)
    text = (here / "mine" / "both.toml").read_text("utf-8")
    for line in ('airframe = "tilted_hexarotor"', 'arm = "../arms/arm.urdf"', "position = [0.0, 0.0, -0.1]"):
        assert line in text
    assert "to =" not in text
    assert (here / "arms" / "arm.urdf").read_bytes() == before
    vehicle = load_vehicle(here / "mine" / "both.toml")
    assert vehicle.mass == pytest.approx(said["mass_kg"])
    assert (vehicle.end_effector, vehicle.frame().link) == ("my_tool0", 1)


@pytest.mark.parametrize(
    ("wanted", "tip", "link_of_tip"),
    [(None, "tool0", 1), ("camera", "camera", 1), ("a", "tip", 0), ("mount", "mount", -1)],
)
def test_the_tip_is_a_frame_a_link_or_the_usual_one(here, wanted, tip, link_of_tip):
    words = () if wanted is None else ("--tip", wanted)
    assert skyarm("attach", "hummingbird", "arm.urdf", "-o", "v.toml", *words).code == 0
    vehicle = load_vehicle(here / "v.toml")
    assert (vehicle.end_effector, vehicle.frame().link) == (tip, link_of_tip)


def test_an_arm_of_two_ends_has_no_tip_of_itself_and_one_chain_its_last(here):
    fork = (
        link("mount"),
        link("a"),
        link("b"),
        joint("ja", "mount", "a", limits()),
        joint("jb", "mount", "b", limits()),
    )
    saved(here, robot(*fork), "fork.urdf")
    done = skyarm("attach", "hummingbird", "fork.urdf", "-o", "v.toml")
    assert "no tip (--tip)" in done.out
    assert load_vehicle(here / "v.toml").end_effector == ""
    saved(here, robot(*ARM), "chain.urdf")
    assert "tip 'tip'" in skyarm("attach", "hummingbird", "chain.urdf", "-o", "w.toml").out
    assert load_vehicle(here / "w.toml").frame().link == 1


def test_a_vehicle_file_that_is_there_stays_as_it_is(here):
    (here / "mine.toml").write_text("# by hand\n", "utf-8")
    refused(
        skyarm("attach", "hummingbird", "arm.urdf", "-o", "mine.toml"), "--out = 'mine.toml': must not be there yet"
    )
    assert (here / "mine.toml").read_text("utf-8") == "# by hand\n"


def test_another_arm_on_what_was_written(here):
    assert skyarm("attach", "hummingbird", "arm.urdf", "-o", "one.toml").code == 0
    refused(skyarm("attach", "one.toml", "arm.urdf", "-o", "two.toml"), "two.toml: attach[0].prefix = ''", "link 'a'")
    assert not (here / "two.toml").exists()
    assert skyarm("attach", "one.toml", "arm.urdf", "-o", "two.toml", "--prefix", "r_", "--to", "tool0").code == 0
    two = load_vehicle(here / "two.toml")
    assert [each.parent for each in two.links] == [-1, 0, 1, 2]
    assert two.end_effector == "r_tool0"


REFUSED = {
    "out": (("hummingbird", "arm.urdf", "-o", "v.urdf"), "--out = 'v.urdf': must end in .toml"),
    "no arm": (("hummingbird", "leg.urdf", "-o", "v.toml"), "attach[0].arm = 'leg.urdf': no such file"),
    "no airframe": (("eagle", "arm.urdf", "-o", "v.toml"), "airframe = 'eagle': must be a name of the library"),
    "itself": (("v.toml", "arm.urdf", "-o", "v.toml"), "airframe = 'v.toml': no such file"),
    "tip": (("hummingbird", "arm.urdf", "-o", "v.toml", "--tip", "tool1"), "--tip = 'tool1': did you mean 'tool0'?"),
    "to": (("hummingbird", "arm.urdf", "-o", "v.toml", "--to", "wing"), "attach[0].to = 'wing': must be one of base"),
    "position": (
        ("hummingbird", "arm.urdf", "-o", "v.toml", "--position", "nan", "0", "0"),
        "attach[0].position[0] = nan",
    ),
    "mimic": (
        ("hummingbird", "arm.urdf", "-o", "v.toml", "--mimic", "loose"),
        "mimic = 'loose': must be one of lock, couple",
    ),
    "xacro": (("hummingbird", "arm.xacro", "-o", "v.toml"), "must be expanded first: xacro arm.xacro -o arm.urdf"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_wrong_is_one_line_and_nothing_is_written(here, case):
    words, message = REFUSED[case]
    refused(skyarm("attach", *words), message)
    assert sorted(each.name for each in here.iterdir()) == ["arm.urdf"]


def test_a_file_is_not_written_over_what_it_refers_to(here):
    assert skyarm("attach", "hummingbird", "arm.urdf", "-o", "v.toml").code == 0
    before = (here / "v.toml").read_bytes()
    refused(skyarm("attach", "v.toml", "arm.urdf", "-o", "v.toml"), "must not lead back to a file that refers to it")
    assert (here / "v.toml").read_bytes() == before


def test_a_scenario_is_exported_with_its_gravity_and_first_state(here):
    assert skyarm("export", "--to", "mjcf", "case3", "-o", "x.xml").code == 0
    model = mujoco.MjModel.from_xml_path("x.xml")
    assert model.key(0).qpos[2] > 0.0
    assert (
        skyarm("export", "--to", "mjcf", "case3", "-o", "x.xml", "--gravity", "1.62", "--timestep", "0.002").code == 0
    )
    model = mujoco.MjModel.from_xml_path("x.xml")
    assert (model.opt.gravity[2], model.opt.timestep) == (-1.62, 0.002)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("eagle", "-o", "x.xml"), "vehicle = 'eagle': "),
        (("case3", "-o", "x.urdf"), "--out = 'x.urdf': must end in .xml or .mjcf"),
        (("case3", "-o", "x.xml", "--gravity", "-1"), "--gravity = -1"),
        (("case3", "-o", "x.xml", "--timestep", "1"), "--timestep = 1.0: must be at most 0.1 s"),
        (("hummingbird_arm2", "-o", "x.xml"), "planar = True: must be false in a plant"),
        (("arm.toml", "-o", "x.xml"), "vehicle = 'arm.toml': no such file"),
    ],
)
def test_what_cannot_be_exported_is_one_line(here, words, message):
    refused(skyarm("export", "--to", "mjcf", *words), message)
    assert not (here / "x.xml").exists()


def test_show_prints_the_notes_of_a_file(here):
    saved(here, robot(link("b"), link("a"), joint("j", "b", "a", "", "continuous"), "<gazebo/>"), "v.urdf")
    shown = skyarm("show", "v.urdf", columns=200)
    assert shown.code == 0, shown.err
    assert "joint j: without an effort, so passive; [[joints]] effort_limit gives it a drive" in shown.out
    assert "<gazebo> (1): not read" in json.loads(skyarm("show", "v.urdf", "--json").out)["notes"]


ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "your_vehicle.md").read_text("utf-8")
PICKER = (ROOT / "examples" / "picker.urdf").read_text("utf-8")


@pytest.fixture(scope="module")
def shown():
    """Blocks of the page on arms: title or language -> text."""
    fences = re.findall(r"```(\w+)(?: title=\"(\S+)\")?\n(.*?)```", PAGE, re.DOTALL)
    return {title or language: text for language, title, text in fences}


def test_the_page_on_arms_shows_what_is_written(here, shown):
    (here / "examples").mkdir()
    saved(here, PICKER, "examples/picker.urdf")
    (words,) = re.findall(r"^skyarm (attach .*)$", PAGE, re.M)
    assert skyarm(*words.split()).code == 0
    assert (here / "carrier.toml").read_text("utf-8").split("\n", 1)[1] == shown["toml"]


@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
def test_the_arm_of_the_page_flies_on_both_plants_with_its_second_finger(here, shown, plant):
    """In Python floats, 0.1 s: the fingers open by a centimetre against each other."""
    saved(here, PICKER, "picker.urdf")
    saved(here, shown["swing.toml"], "swing.toml")
    assert skyarm("attach", "tilted_hexarotor", "picker.urdf", "-o", "carrier.toml", "--mimic", "couple").code == 0
    scenario = load_scenario(here / "swing.toml", duration=0.1, plant=plant)
    assert [each.name for each in scenario.plant.vehicle.followers] == ["right_finger"]
    # in Python floats: tracing a law costs seconds
    par = scenario.controller.par
    controller = replace(scenario.controller, compiled=False)
    log = run(replace(scenario, controller=controller))
    assert (log.status, par.model.vehicle.n) == ("completed", 3)
    # it starts beside the reference of 2 cm, which the finger goes to
    assert abs(log.joints[-1, 2] - 0.02) < 0.5 * abs(log.joints[0, 2] - 0.02) or abs(log.joints[-1, 2] - 0.02) < 1e-4
