"""``skyarm new vehicle NAME --from FILE``, and ``skyarm show FILE --compare``."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest

import skyarm as package
from skyarm.algebra import Mat3
from skyarm.vehicle import vehicle_files
from skyarm.vehicle.vehicle_files import load_vehicle
from support.cases import joint, limits, link, robot, saved
from support.commands import refused, skyarm

NUMBERS = {
    "motorConstant": "1.3e-05",
    "momentConstant": "0.017",
    "maxRotVelocity": "900",
    "timeConstantUp": "0.014",
    "timeConstantDown": "0.031",
    "turningDirection": "{}",
}
PLACES = [(0.25, 0, 0.03), (0, 0.25, 0.03), (-0.25, 0, 0.03), (0, -0.25, 0.03)]


def motor(k, without=()):
    words = "".join(
        f"<{word}>{text}</{word}>"
        for word, text in NUMBERS.items()
        if word not in without
    )
    turned = words.format(("cw", "ccw")[k % 2])
    return (
        f'<link name="p{k}"/><joint name="f{k}" type="fixed"><parent'
        f' link="hull"/><child link="p{k}"/>'
        f'<origin xyz="{" ".join(map(str, PLACES[k]))}"/></joint>'
        "<gazebo><plugin"
        f' name="m{k}"><linkName>p{k}</linkName>'
        f"<motorNumber>{k}</motorNumber>{turned}</plugin></gazebo>"
    )


def quad(without=(), only=range(4)):
    parts = [link("hull", (0.02, 0.02, 0.03), mass=1.2), link("upper", mass=0.15)]
    parts += [joint("shoulder", "hull", "upper", limits()), "<sensor/>"]
    return robot(*parts, *(motor(k, without if k in only else ()) for k in range(4)))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def unturned(links):
    """Links whose joints have no rotation, which is written as a quaternion and so read
    back rounded.
    """
    return [
        replace(each, joint=replace(each.joint, rotation=Mat3.identity()))
        for each in links
    ]


def same(read, given):
    """Equal in all that a vehicle file holds; rotations within rounding."""
    assert unturned(read.links) == unturned(given.links)
    for ours, theirs in zip(read.links, given.links, strict=True):
        assert np.array(ours.joint.rotation.rows) == pytest.approx(
            np.array(theirs.joint.rotation.rows), abs=1e-15
        )
    for field in (
        "base",
        "rotors",
        "frames",
        "end_effector",
        "sources",
        "drag",
        "followers",
    ):
        assert getattr(read, field) == getattr(given, field), field


def test_the_whole_vehicle_is_written_with_its_sources(folder):
    saved(folder, quad())
    done = skyarm("new", "vehicle", "mine", "--from", "r.urdf", "--tip", "upper")
    assert done.code == 0, done
    text = (folder / "mine.toml").read_text("utf-8")
    assert "# <sensor> (1): not read" in text
    assert (
        "thrust_coefficient = 1.3e-05  # motorConstant of the motor-model plugins\n"
        in text
    )
    assert "mass = 0.15  # r.urdf\n" in text
    read, given = load_vehicle("mine.toml"), load_vehicle("r.urdf")
    assert (read.name, read.end_effector) == ("mine", "upper")
    assert read.frames[0].link == 0
    assert list(read.frames[0].position) == [0, 0, 0]
    same(replace(read, frames=given.frames, end_effector=""), given)
    scenario = replace(package.load_scenario("mine_hover.toml"), duration=0.1)
    assert package.run(scenario).status == "completed"
    assert (folder / "test_mine.py").read_text("utf-8").count("mine") > 2


def test_inertia_of_what_spins_has_its_source_beside_it(folder):
    spun = (
        '<link name="p1"><inertial><mass value="0.01"/><inertia ixx="1e-5" iyy="1e-5"'
        ' izz="2e-5" {}/></inertial></link>'
    )
    text = quad().replace('<link name="p1"/>', spun.format('ixy="0" ixz="0" iyz="0"'))
    text = text.replace(
        'name="f1" type="fixed">', 'name="f1" type="continuous"><axis xyz="0 0 1"/>'
    )
    saved(
        folder, text.replace("<linkName>p1<", "<jointName>f1</jointName><linkName>p1<")
    )
    assert skyarm("new", "vehicle", "mine", "--from", "r.urdf").code == 0
    written = (folder / "mine.toml").read_text("utf-8")
    source = "links of the rotors, about their axes, by rotorVelocitySlowdownSim = 10"
    assert f"\ninertia = {2e-05 / 10}  # {source}\n" in written
    same(load_vehicle("mine.toml"), load_vehicle("r.urdf"))


@pytest.mark.parametrize("endless", [[], [0], [1, 3], [0, 1, 2, 3]])
def test_largest_thrusts_are_written_as_such_rotor_by_rotor(folder, endless):
    """A site without a range states no thrust, whichever of the four it is."""
    sites = "".join(
        f'<site name="s{k}" pos="{x} {y} 0"/>' for k, (x, y, _) in enumerate(PLACES)
    )
    ranges = [
        "" if k in endless else f'ctrllimited="true" ctrlrange="0 {7 + k}"'
        for k in range(4)
    ]
    gears = [f'gear="0 0 1 0 0 {0.01 * (-1) ** k}"' for k in range(4)]
    motors = "".join(f'<motor site="s{k}" {gears[k]} {ranges[k]}/>' for k in range(4))
    body = '<inertial pos="0 0 0" mass="1" diaginertia=".01 .01 .02"/>'
    saved(
        folder,
        "<mujoco><worldbody><body"
        f' name="b"><freejoint/>{body}{sites}</body></worldbody>'
        f"<actuator>{motors}</actuator></mujoco>",
        "m.xml",
    )
    assert skyarm("new", "vehicle", "mine", "--from", "m.xml").code == 0
    text = (folder / "mine.toml").read_text("utf-8")
    for lag in ("time_constant_up", "time_constant_down"):
        text = re.sub(rf"^# {lag} = .*$", f"{lag} = 0.02", text, flags=re.MULTILINE)
    text = re.sub(r"^# max_speed = .*$", "max_speed = 800.0", text, flags=re.MULTILINE)
    text = re.sub(
        r"^# thrust_coefficient = .*$",
        "thrust_coefficient = 1e-05",
        text,
        flags=re.MULTILINE,
    )
    rotors = load_vehicle(saved(folder, text, "filled.toml")).rotors
    most = [each.thrust_coefficient * each.max_speed**2 for each in rotors]
    assert most == pytest.approx(
        [6.4 if k in endless else 7 + k for k in range(4)], rel=1e-12
    )


def test_a_thrust_coefficient_stays_one_beside_a_largest_thrust(folder):
    """gym-pybullet-drones states both: k_f per rpm^2 and 2.5 weights, from which the
    largest speed follows.
    """
    parts = [link("hull", (0.02, 0.02, 0.03), mass=0.4)]
    for k, place in enumerate(("0.1 0 0", "0 0.1 0", "-0.1 0 0", "0 -0.1 0")):
        parts.append(
            f'<link name="prop{k}_link"/><joint name="p{k}" type="fixed"><parent'
            ' link="hull"/>'
        )
        parts.append(f'<child link="prop{k}_link"/><origin xyz="{place}"/></joint>')
    stated = '<properties arm="0.1" kf="5e-10" km="1.2e-11" thrust2weight="2.5"/>'
    saved(folder, robot(stated, *parts))
    assert skyarm("new", "vehicle", "mine", "--from", "r.urdf").code == 0
    text = (folder / "mine.toml").read_text("utf-8")
    written = float(re.search(r"^thrust_coefficient = (\S+)", text, re.MULTILINE)[1])
    assert written == pytest.approx(5e-10 * (60.0 / (2.0 * np.pi)) ** 2, rel=1e-12)
    assert "\nmax_thrust" not in text


def test_reading_it_back_gives_the_same_vehicle(folder):
    saved(
        folder,
        quad()
        .replace('<link name="p0"/>', '<link name="tip"/>')
        .replace('"p0"', '"tip"')
        .replace(">p0<", ">tip<"),
    )
    assert skyarm("new", "vehicle", "mine", "--from", "r.urdf").code == 0
    same(load_vehicle("mine.toml"), load_vehicle("r.urdf"))
    assert skyarm("new", "vehicle", "again", "--from", "mine.toml").code == 0
    same(load_vehicle("again.toml"), load_vehicle("mine.toml"))


FILLED = {
    "moment_coefficient": "0.017",
    "max_speed": "900.0",
    "time_constant_up": "0.014",
    "time_constant_down": "0.031",
    "thrust_coefficient": "1.3e-05",
}


@pytest.mark.parametrize(
    "without", [("turningDirection",), ("maxRotVelocity", "timeConstantUp")]
)
@pytest.mark.parametrize("only", [range(4), (1, 3)])
def test_gaps_are_comments_that_the_file_asks_for_until_they_are_filled(
    folder, without, only
):
    saved(folder, quad(without, only))
    done = skyarm("new", "vehicle", "mine", "--from", "r.urdf")
    assert done.code == 0, done
    assert "does not fly" in done.out
    assert not (folder / "mine_hover.toml").exists()
    text = (folder / "mine.toml").read_text("utf-8")
    asked = skyarm("check", "mine.toml")
    refused(
        asked,
        "the file states no ",
        "direction" if "turningDirection" in without else "max_speed, time_constant_up",
    )
    senses = iter(("cw", "ccw", "cw", "ccw") if len(only) == 4 else ("ccw", "ccw"))
    text = re.sub(
        r"# direction = \.\.\.", lambda _: f'direction = "{next(senses)}"', text
    )
    text = re.sub(
        r"# (\w+) = \.\.\.", lambda found: f"{found[1]} = {FILLED[found[1]]}", text
    )
    saved(folder, text, "mine.toml")
    saved(folder, quad(), "whole.urdf")
    assert load_vehicle("mine.toml").rotors == load_vehicle("whole.urdf").rotors


TILTING = """<mujoco><compiler angle="radian"/><worldbody><body name="hull"><freejoint/>
  <geom size="0.1" mass="1"/>
{}</body></worldbody><actuator>{}</actuator></mujoco>"""


@pytest.mark.parametrize(
    "ranges", [[1.1, 1.1, 1.1, 1.1], [1.1, 0.9, 1.1, 0.9], [0, 0, 0, 0]]
)
def test_the_gap_of_a_tilt_is_left_out_until_it_is_filled(folder, ranges):
    bodies, motors = "", ""
    for k, (place, most) in enumerate(zip(PLACES, ranges, strict=True)):
        limited = f'range="-{most} {most}"' if most else ""
        bodies += (
            f'<body pos="{" ".join(map(str, place))}"><joint name="t{k}"'
            f' axis="{place[0]} {place[1]} 0" {limited}/>'
        )
        bodies += f'<geom size="0.01" mass="0.02"/><site name="s{k}"/></body>'
        motors += (
            f'<motor site="s{k}" gear="0 0 1 0 0 {0.02 * (-1) ** k}" ctrllimited="true"'
            ' ctrlrange="0 6"/>'
        )
        motors += f'<position joint="t{k}" kp="1"/>'
    saved(folder, TILTING.format(bodies, motors), "t.xml")
    done = skyarm("new", "vehicle", "mine", "--from", "t.xml")
    assert done.code == 0, done
    text = (folder / "mine.toml").read_text("utf-8")
    assert "# missing: tilt.time_constant" in text
    assert ("# missing: tilt.upper" in text) == (not ranges[0])
    refused(skyarm("check", "mine.toml"), "tilt", "is missing")
    filled = re.sub(r"# (max_speed|time_constant_\w+) = \.\.\.", r"\1 = 0.5", text)
    inside = "time_constant = 0.07" + (
        ", lower = -1.0, upper = 1.5" if not ranges[0] else ""
    )
    saved(
        folder,
        re.sub(r"^(tilt = .*?) }", rf"\1, {inside} }}", filled, flags=re.MULTILINE),
        "mine.toml",
    )
    tilts = [each.tilt for each in load_vehicle("mine.toml").rotors]
    assert [(each.lower, each.upper) for each in tilts] == [
        (-most, most) if most else (-1.0, 1.5) for most in ranges
    ]
    assert {each.time_constant for each in tilts} == {0.07}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("law", "mine", "--from", "r.urdf"),
            "--from = 'r.urdf': must be left out unless KIND is vehicle",
        ),
        (
            ("vehicle", "mine", "--tip", "upper"),
            "--tip = 'upper': must stand beside --from",
        ),
        (
            ("vehicle", "mine", "--from", "r.urdf", "--tip", "hand"),
            "r.urdf: --tip = 'hand': must be one of base, upper, p0",
        ),
        (
            ("vehicle", "mine", "--from", "gone.urdf"),
            "vehicle = 'gone.urdf': no such file",
        ),
        (
            ("vehicle", "mine", "--from", "open.toml"),
            "--from = 'open.toml': must be whole: rotors p0, p1, p2, p3: the file",
        ),
    ],
)
def test_what_is_refused_writes_nothing(folder, words, said):
    saved(folder, quad())
    saved(folder, quad(("maxRotVelocity",)), "open.urdf")
    saved(folder, 'schema = 1\nname = "o"\nurdf = "open.urdf"\n', "open.toml")
    refused(skyarm("new", *words), said)
    assert sorted(each.name for each in folder.iterdir()) == [
        "open.toml",
        "open.urdf",
        "r.urdf",
    ]


def compared(file):
    done = skyarm("show", file, "--compare", "--json")
    assert done.code == 0, done
    return {row["quantity"]: row for row in json.loads(done.out)["compare"]}


def test_compare_finds_what_mujoco_reads_equal(folder):
    saved(folder, quad())
    rows = compared("r.urdf")
    assert rows["mass, kg"]["skyarm"] == rows["mass, kg"]["MuJoCo"] == "1.35"
    assert rows["joints in order"]["MuJoCo"] == "shoulder"
    com = np.array(rows["com, m"]["skyarm"].split(), float)
    assert com == pytest.approx([float(c) for c in by_hand()], rel=1e-5)
    assert rows["inertia, kg m^2"]["skyarm"] == rows["inertia, kg m^2"]["MuJoCo"]
    assert 0.0 <= float(rows["M(q) at 8 poses"]["largest relative difference"]) < 1e-12


def by_hand():
    """Centre of mass of both bodies, from the text of the file alone: scipy turns roll,
    pitch and yaw.
    """
    rotation = pytest.importorskip("scipy.spatial.transform").Rotation.from_euler(
        "xyz", [0.1, 0.2, 0.3]
    )
    own = np.array([0.01, 0.02, -0.1])
    upper = np.array([0.1, 0.05, -0.2]) + rotation.apply(own)
    return (1.2 * own + 0.15 * upper) / 1.35


def test_compare_shows_what_is_read_in_another_way(folder):
    """Equal limits fix a joint here, which MuJoCo moves; a link's geometry gives no
    mass here.
    """
    saved(folder, quad().replace('lower="-1.0" upper="1.0"', 'lower="0.5" upper="0.5"'))
    rows = compared("r.urdf")
    assert (rows["joints in order"]["skyarm"], rows["joints in order"]["MuJoCo"]) == (
        "",
        "shoulder",
    )
    assert float(rows["M(q) at 8 poses"]["largest relative difference"]) > 1e-3


@pytest.mark.parametrize(
    ("file", "said"),
    [
        ("v.toml", "--compare = 'v.toml': must be a .urdf, .xml or .mjcf file"),
        (
            "v.xml",
            (
                "--compare = 'v.xml': MuJoCo reads no vehicle: one of its bodies must"
                " be the base"
            ),
        ),
    ],
)
def test_compare_refuses_what_mujoco_does_not_read_as_a_vehicle(folder, file, said):
    saved(folder, quad())
    saved(folder, 'schema = 1\nname = "o"\nurdf = "r.urdf"\n', "v.toml")
    body = '<body><geom size="0.1" mass="1"/></body>'
    saved(
        folder,
        f"<mujoco><worldbody>{body}<body><site/></body></worldbody></mujoco>",
        "v.xml",
    )
    refused(skyarm("show", file, "--compare"), said)


def uncommented(text):
    return re.sub(
        r"^# (\[\[joints]]|name = |hold = )", r"\1", text, flags=re.MULTILINE
    ).replace("hold = ...", "hold = 0.3")


@pytest.mark.filterwarnings("default:--collisions")
def test_rotors_that_ride_on_a_joint_are_kept_and_the_joint_is_asked_for(folder):
    text = quad().replace(
        '<parent link="hull"/><child link="p0"/>',
        '<parent link="upper"/><child link="p0"/>',
    )
    saved(folder, text)
    done = skyarm("new", "vehicle", "mine", "--from", "r.urdf")
    assert done.code == 0, done
    written = (folder / "mine.toml").read_text("utf-8")
    assert '# [[joints]]\n# name = "shoulder"\n# hold = ...' in written
    bare = skyarm(
        "new", "vehicle", "touching", "--from", "r.urdf", "--collisions", "file"
    )
    assert "warning: --collisions file: no shape of FILE touches" in bare.err
    added = '\nimport_collisions = "file"'
    text_of_it = (folder / "touching.toml").read_text("utf-8")
    assert added in text_of_it
    none = (
        "# import_collisions = 'file' takes none: no other file states a shape that"
        " touches\n"
    )
    assert none in text_of_it
    text_of_it = text_of_it.replace(none, "")
    assert text_of_it.replace(added, "").replace("touching", "mine") == written
    asked = skyarm("check", "mine.toml")
    assert "state them in mine.toml" in asked.out
    assert "--from" not in asked.out
    saved(folder, uncommented(written), "mine.toml")
    by_hand = (
        'schema = 1\nname = "mine"\nurdf = "r.urdf"\n[[joints]]\nname ='
        ' "shoulder"\nhold = 0.3\n'
    )
    saved(folder, by_hand, "hand.toml")
    assert len(load_vehicle("mine.toml").rotors) == 4
    assert load_vehicle("mine.toml").rotors == load_vehicle("hand.toml").rotors
    spec = mujoco.MjSpec.from_string(text)
    spec.compiler.fusestatic = False
    spec.worldbody.bodies[0].add_freejoint()
    model = spec.compile()
    data = mujoco.MjData(model)
    data.joint("shoulder").qpos[:] = 0.3
    mujoco.mj_kinematics(model, data)
    for rotor in load_vehicle("mine.toml").rotors:
        assert list(rotor.position) == pytest.approx(
            data.body(rotor.name).xpos, abs=1e-15
        )
        assert list(rotor.axis) == pytest.approx(
            data.body(rotor.name).xmat.reshape(3, 3)[:, 2], abs=1e-15
        )


def test_a_file_without_rotors_gets_an_entry_to_fill_and_no_circle(folder):
    saved(folder, robot(link("hull", (0.02, 0.02, 0.03), mass=1.2)))
    assert skyarm("new", "vehicle", "mine", "--from", "r.urdf").code == 0
    assert "# [[rotors]]\n" in (folder / "mine.toml").read_text("utf-8")
    asked = skyarm("check", "mine.toml")
    assert "add [[rotors]]" in asked.out
    assert "--from" not in asked.out


def test_the_check_of_a_vehicle_that_flies_says_what_makes_its_scenario(folder):
    saved(folder, quad())
    assert skyarm("new", "vehicle", "mine", "--from", "r.urdf").code == 0
    last = skyarm("check", "mine.toml").out.splitlines()[-1]
    assert last == "next: skyarm new vehicle NAME --from mine.toml"
    assert skyarm("new", "vehicle", "again", "--from", "mine.toml").code == 0
    assert (folder / "again_hover.toml").exists()


def test_lags_that_no_file_states_are_marked_as_assumed(folder):
    saved(folder, quad())
    assert skyarm("new", "vehicle", "mine", "--from", "r.urdf").code == 0
    kept = (folder / "mine.toml").read_text("utf-8").splitlines(keepends=True)
    saved(
        folder,
        "".join(each for each in kept if "time_constant" not in each),
        "bare.toml",
    )
    assert skyarm("new", "vehicle", "again", "--from", "bare.toml").code == 0
    assert "time_constant_up = 0.0125  # assumed: " in (
        folder / "again.toml"
    ).read_text("utf-8")


def test_lags_that_a_file_of_the_file_states_are_not_assumed(folder):
    """Those of an airframe or of the library, also where they are the numbers that
    would be assumed.
    """
    saved(folder, quad().replace("0.014", "0.0125"))
    saved(folder, 'schema = 1\nname = "a"\nairframe = "r.urdf"\n', "on.toml")
    for source in ("on.toml", "hummingbird"):
        assert skyarm("new", "vehicle", "again", "--from", source, "--force").code == 0
        text = (folder / "again.toml").read_text("utf-8")
        assert "time_constant_up = 0.0125" in text
        assert "assumed" not in text


def test_a_file_with_gaps_is_read_once(folder, monkeypatch):
    saved(folder, quad(("maxRotVelocity",)))
    read = vehicle_files.read_rigid
    calls = []
    monkeypatch.setattr(
        vehicle_files, "read_rigid", lambda *words: calls.append(words) or read(*words)
    )
    assert skyarm("new", "vehicle", "mine", "--from", "r.urdf").code == 0
    assert len(calls) == 1


def test_one_body_is_not_said_to_be_bodies(folder):
    done = skyarm("export", "hummingbird", "--to", "urdf", "--out", "h.urdf")
    assert done.out == "h.urdf: hummingbird, 1 body, 0 joints, 4 actuators\n"


def test_a_vehicle_with_a_fault_is_not_said_to_fly(folder):
    assert saved(folder, quad()).exists()
    whole = skyarm("new", "vehicle", "whole", "--from", "r.urdf")
    assert whole.out.splitlines()[-1] == "fly it: skyarm run whole_hover.toml"
    text = (folder / "whole.toml").read_text("utf-8")
    (folder / "heavy.toml").write_text(
        re.sub(r"(?m)^mass = .*", "mass = 1200.0", text, count=1), "utf-8"
    )
    heavy = skyarm("new", "vehicle", "heavy2", "--from", "heavy.toml")
    assert (
        heavy.out.splitlines()[-1]
        == "the check of the vehicle finds a fault; which one: skyarm check heavy2.toml"
    )


def test_a_mesh_that_is_not_there_is_told_beside_drawing_and_checks(tmp_path):
    visual = '<visual><geometry><mesh filename="gone.stl"/></geometry></visual>'
    drawn = link("hull").replace("</link>", f"{visual}</link>")
    file = saved(tmp_path, robot(drawn))
    line = "link hull: a mesh file is not there; it is drawn from its joints"
    picture = skyarm("show", str(file), "-o", str(tmp_path / "v.png"))
    assert (picture.code, picture.out.splitlines()[1:]) == (0, [line])
    note = " ".join(skyarm("check", str(file), columns=200).out.split())
    assert f"note meshes {line}" in note


def test_shapes_of_a_file_are_written_where_they_are_asked_for(folder):
    shape = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
    body = link("hull", mass=1.0).replace("</link>", f"{shape * 2}</link>")
    saved(folder, quad().replace(link("hull", (0.02, 0.02, 0.03), mass=1.2), body))
    new = ("new", "vehicle", "mine", "--from", "r.urdf", "--force")
    for word, count in (("none", 0), ("file", 2), ("capsules", 2)):
        assert skyarm(*new, "--collisions", word).code == 0
        assert len(load_vehicle("mine.toml").collisions) == count
    refused(skyarm(*new, "--collisions", "all"), "--collisions = 'all'", "capsules")
    alone = ("new", "vehicle", "other", "--collisions", "file")
    refused(skyarm(*alone), "--collisions: must be left out without --from")
    own = skyarm(*alone, "--from", "mine.toml")
    refused(own, "--collisions = 'file'", "must be left out: FILE has its own")
