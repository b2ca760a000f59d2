"""Arms on airframes: the same as one file of both, names, frames, and what is
refused.
"""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from skyarm.vehicle import VehicleError
from skyarm.vehicle.attach import Notes
from skyarm.vehicle.vehicle_files import load_vehicle
from support.cases import (
    agrees,
    joint,
    limits,
    link,
    pinocchio_of,
    robot,
    saved,
    toml_text,
)

FRAME = (
    link("body", mass=2.0),
    link("leg", mass=0.1),
    joint("hip", "body", "leg", limits()),
    (
        '<link name="rail"/><joint name="f" type="fixed"><parent link="body"/><child'
        ' link="rail"/><origin xyz="0.1 0 -0.1" rpy="0 0.5 0"/></joint>'
    ),
)
ARM = (
    link("mount", mass=0.3),
    link("upper", mass=0.2),
    link("claw", mass=0.05),
    joint("shoulder", "mount", "upper", limits()),
    joint("grip", "upper", "claw", limits(), "prismatic"),
    (
        '<link name="tip"/><joint name="t" type="fixed"><parent link="claw"/><child'
        ' link="tip"/><origin xyz="0 0 -0.1"/></joint>'
    ),
)
TOML = 'schema = 1\nname = "v"\nurdf = "frame.urdf"\n'
AT = (
    '[[attach]]\narm = "arm.urdf"\nto = "{to}"\nposition = [0.2, 0.3, -0.1]\nrpy ='
    " [0.3, 0.2, 0.1]\n"
)
PLACE = '<origin xyz="0.2 0.3 -0.1" rpy="0.3 0.2 0.1"/>'


def attached(tmp_path, text, arm=ARM):
    saved(tmp_path, robot(*FRAME), "frame.urdf")
    saved(tmp_path, robot(*arm), "arm.urdf")
    return load_vehicle(saved(tmp_path, text, "v.toml"))


@pytest.mark.parametrize("to", ["base", "body", "rail", "leg"])
def test_it_moves_as_one_file_of_both_does(tmp_path, to):
    vehicle = attached(tmp_path, TOML + AT.format(to=to))
    parent = {"base": "body"}.get(to, to)
    seat = (
        f'<joint name="s" type="fixed"><parent link="{parent}"/><child'
        f' link="mount"/>{PLACE}</joint>'
    )
    whole = robot(*FRAME, *ARM, seat)
    assert [each.joint.name for each in vehicle.links] == ["hip", "shoulder", "grip"]
    assert [each.name for each in vehicle.frames] == ["rail", "mount", "tip"]
    values = {"hip": (0.3, 1, 0), "shoulder": (-0.4, 1, 1), "grip": (0.2, 1, 2)}
    agrees(vehicle, pinocchio_of(whole, vehicle, values), [0.3, -0.4, 0.2])
    alone = load_vehicle(saved(tmp_path, whole, "whole.urdf"))
    assert {each.name: each for each in alone.frames} == {
        each.name: each for each in vehicle.frames
    }


def test_two_arms_and_a_gripper_on_one_of_them(tmp_path):
    claw = robot(
        link("palm"), link("finger"), joint("bend", "palm", "finger", limits())
    )
    saved(tmp_path, claw, "claw.urdf")
    text = (
        TOML
        + AT.format(to="base")
        + 'prefix = "l_"\n'
        + AT.format(to="base")
        + 'prefix = "r_"\n[[attach]]\narm = "claw.urdf"\nto = "r_tip"\n'
        + '[[joints]]\nname = "r_grip"\neffort_limit = 7.0\n[[frames]]\nname ='
        ' "eye"\nlink = "l_mount"\n'
    )
    vehicle = attached(tmp_path, text)
    names = [each.name for each in vehicle.links]
    assert names == ["leg", "l_upper", "l_claw", "r_upper", "r_claw", "finger"]
    assert [each.parent for each in vehicle.links] == [-1, -1, 1, -1, 3, 4]
    assert vehicle.mass == pytest.approx(2.1 + 2 * 0.55 + 1.0, abs=1e-12)
    assert vehicle.links[4].joint.effort_limit == 7.0
    assert vehicle.frame("eye").position == vehicle.frame("l_mount").position
    assert vehicle.frame("palm").link == 4


def test_an_airframe_keeps_its_rotors_drag_and_sources_and_its_own_stops(tmp_path):
    saved(tmp_path, robot(*ARM), "arm.urdf")
    text = 'schema = 1\nname = "v"\nairframe = "hexarotor_arm6"\n' + AT.format(
        to="camera"
    )
    with pytest.raises(
        VehicleError,
        match=r"attach\[0\].prefix = '': must tell the arm's frame 'tip' from the airf",
    ):
        load_vehicle(saved(tmp_path, text, "v.toml"))
    vehicle = load_vehicle(saved(tmp_path, text + 'prefix = "my_"\n', "v.toml"))
    whole = load_vehicle("hexarotor_arm6")
    assert (vehicle.rotors, vehicle.drag, vehicle.sources) == (
        whole.rotors,
        whole.drag,
        whole.sources,
    )
    assert vehicle.end_effector == whole.end_effector
    assert [each.joint.stop_stiffness for each in vehicle.links[:6]] == [0] * 6
    assert all(each.joint.stop_stiffness > 0 for each in vehicle.links[6:])
    # the first links but the one that carries the arm are as they were
    assert vehicle.links[:2] == whole.links[:2]
    assert vehicle.links[2].body.mass == pytest.approx(whole.links[2].body.mass + 0.3)


def test_an_arm_of_toml_is_attached_and_its_followers_follow(tmp_path):
    arm = (
        'schema = 1\nname = "arm"\nend_effector = "t"\n[base]\nmass = 0.2\ninertia ='
        ' [1e-3, 1e-3, 1e-3]\n[[links]]\nname = "a"\nparent = "base"\nmass ='
        ' 0.1\ninertia = [1e-3, 1e-3, 1e-3]\n[links.joint]\nname = "ja"\naxis = [0.0,'
        ' 1.0, 0.0]\n[[links]]\nname = "b"\nparent = "base"\nmass = 0.1\ninertia ='
        ' [1e-3, 1e-3, 1e-3]\n[links.joint]\nname = "jb"\naxis = [0.0, 1.0, 0.0]\nmimic'
        ' = { joint = "ja", ratio = -1.0 }\n[[frames]]\nname = "t"\nlink = "a"\n'
    )
    saved(tmp_path, arm, "arm.toml")
    text = 'schema = 1\nname = "v"\nairframe = "hummingbird"\nend_effector = "x_t"\n'
    text += '[[attach]]\narm = "arm.toml"\nprefix = "x_"\n'
    vehicle = load_vehicle(saved(tmp_path, text, "v.toml"))
    (follower,) = vehicle.followers
    assert (
        follower.name,
        follower.link.joint.name,
        follower.leader,
        follower.ratio,
    ) == ("x_b", "x_jb", 0, -1.0)
    assert vehicle.frame().link == 0


def test_a_frame_of_the_arm_may_be_called_base_and_means_none_but_itself(tmp_path):
    """Universal Robots' files have one; 'base' in a vehicle file stays the airframe."""
    own = (
        '<link name="base"/><joint name="o" type="fixed"><parent link="mount"/><child'
        ' link="base"/></joint>'
    )
    text = TOML + AT.format(to="leg") + '[[frames]]\nname = "eye"\nlink = "base"\n'
    vehicle = attached(tmp_path, text, (*ARM, own))
    assert (vehicle.frame("base").link, vehicle.frame("eye").link) == (0, -1)


@pytest.mark.parametrize(
    ("file", "arm", "followers"),
    [("couple", "", 1), ("couple", "lock", 0), ("lock", "couple", 1)],
)
def test_an_arm_may_say_itself_what_becomes_of_its_followers(
    tmp_path, file, arm, followers
):
    tied = (
        *ARM[:-2],
        joint(
            "grip", "upper", "claw", limits() + '<mimic joint="shoulder"/>', "prismatic"
        ),
    )
    own = f'mimic = "{arm}"\n' if arm else ""
    vehicle = attached(
        tmp_path, f'{TOML}mimic = "{file}"\n{AT.format(to="base")}{own}', tied
    )
    assert len(vehicle.followers) == followers


def test_drives_of_arm_and_airframe_come_with_them_and_the_file_may_state_others(
    tmp_path,
):
    servo = Path(__file__).resolve().parents[1] / "data" / "servo_arm.toml"
    text = servo.read_text("utf-8")
    saved(tmp_path, text, "whole.toml")
    whole = load_vehicle(tmp_path / "whole.toml")
    arm = (
        'schema = 1\nname = "v"\nairframe = "hummingbird"\n[[attach]]\narm ='
        ' "bare.toml"\nprefix = "x_"\n'
    )
    document = tomllib.loads(text)
    airframes = ("rotors", "rotor_defaults", "sources", "battery")
    bare = {name: value for name, value in document.items() if name not in airframes}
    saved(tmp_path, toml_text(bare), "bare.toml")
    vehicle = load_vehicle(saved(tmp_path, arm, "v.toml"))
    assert [(each.name, each.drive) for each in vehicle.drives] == [
        (f"x_{d.name}", d.drive) for d in whole.drives
    ]
    on_top = 'schema = 1\nname = "v"\nairframe = "whole.toml"\n'
    assert load_vehicle(saved(tmp_path, on_top, "v.toml")).drives == whole.drives
    table = toml_text({"drives": {"elbow": document["drives"]["shoulder"]}})
    other = load_vehicle(saved(tmp_path, f"{on_top}{table}", "v.toml"))
    found = {each.name: each.drive for each in other.drives}
    assert found == {"shoulder": whole.drives[0].drive, "elbow": whole.drives[0].drive}


REFUSED = {
    "no file": ('arm = "x.urdf"', "attach[0].arm = 'x.urdf': no such file"),
    "near": (
        'arm = "bads.urdf"',
        "attach[0].arm = 'bads.urdf': did you mean '{folder}/bad.urdf'? no such file",
    ),
    "kind": (
        'arm = "arm.step"',
        (
            "attach[0].arm = 'arm.step': must be a name of the library, or the path of"
            " a file"
        ),
    ),
    "xacro": ('arm = "arm.xacro"', "attach[0].arm = 'arm.xacro': no such file"),
    "arguments": (
        'arm = "arm.urdf"\nxacro = {n = 1}',
        "attach[0].xacro = 'a table': must be left out: arm.urdf is no .xa",
    ),
    "itself": (
        'arm = "v.toml"',
        "attach[0].arm = 'v.toml': must not lead back to a file that refers to it",
    ),
    "rotors": (
        'arm = "hummingbird"',
        "attach[0].arm = 'hummingbird': must have no rotors (front)",
    ),
    "to": (
        'arm = "arm.urdf"\nto = "foot"',
        "attach[0].to = 'foot': must be one of base, leg, rail",
    ),
    "unknown field": (
        'arm = "arm.urdf"\nat = "leg"',
        "attach[0].at = 'leg': unknown field; allowed: arm, mimic",
    ),
    "missing": (
        "position = [0.0, 0.0, 0.0]",
        "attach[0].arm: is missing; there are position",
    ),
    "pose": (
        'arm = "arm.urdf"\nposition = [0.0, 0.0]',
        "attach[0].position = [0.0, 0.0]: must be three numbers",
    ),
    "both": (
        (
            'arm = "arm.urdf"\nrpy = [0.0, 0.0, 0.0]\nquaternion_wxyz = [1.0, 0.0, 0.0,'
            " 0.0]"
        ),
        (
            "attach[0].rpy = [0.0, 0.0, 0.0]: must not be given together with"
            " quaternion_wxyz"
        ),
    ),
    "twice": (
        'arm = "arm.urdf"\n[[attach]]\narm = "arm.urdf"',
        "attach[1].prefix = '': must tell the arm's link 'upper'",
    ),
    "override": (
        'arm = "arm.urdf"\n[[joints]]\nname = "knee"',
        "joints.name = 'knee': must be one of hip, shoulder",
    ),
    "mimic": (
        'arm = "arm.urdf"\nmimic = "free"',
        "attach[0].mimic = 'free': must be one of lock, couple",
    ),
    "broken": (
        'arm = "bad.urdf"',
        "attach[0].arm = 'bad.urdf': robot = 'no <link>': must have at least one link",
    ),
    "folder": ('arm = "folder.urdf"', "attach[0].arm = 'folder.urdf': is a folder"),
}


def test_notes_name_several_things_by_their_plural():
    notes = Notes()
    for kind in ("joint", "body", "rotor"):
        for name in ("a", "b")[: 1 if kind == "rotor" else 2]:
            notes.add("not read", name, kind)
    assert notes.lines() == (
        "joints a, b: not read",
        "bodies a, b: not read",
        "rotor a: not read",
    )


@pytest.mark.parametrize("case", REFUSED)
def test_a_wrong_table_is_refused_in_one_line(tmp_path, case):
    lines, message = REFUSED[case]
    saved(tmp_path, robot(), "bad.urdf")
    (tmp_path / "folder.urdf").mkdir()
    with pytest.raises(VehicleError) as error:
        attached(tmp_path, f"{TOML}[[attach]]\n{lines}\n")
    message = message.replace("{folder}", str(tmp_path))
    assert str(error.value).startswith(f"{tmp_path / 'v.toml'}: {message}")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (
            'airframe = "hummingbird"\nurdf = "arm.urdf"',
            "airframe = 'hummingbird': must not be given together with 'urdf'",
        ),
        (
            'airframe = "eagle"',
            (
                "airframe = 'eagle': must be a name of the library, or the path of a"
                " file that ends in"
            ),
        ),
        (
            'airframe = "v.toml"',
            "airframe = 'v.toml': must not lead back to a file that refers to it",
        ),
        (
            'airframe = "w.toml"',
            "airframe = 'w.toml': airframe = 'v.toml': must not lead back",
        ),
        (
            'mjcf = "arm.urdf"',
            "mjcf = 'arm.urdf': must be the path of a file that ends in .xml or .mjcf",
        ),
        (
            'airframe = "hummingbird"\nbase = { mass = 1.0 }',
            "base = 'a table': must not be given together with 'airframe'",
        ),
    ],
)
def test_a_wrong_source_of_bodies_is_refused_in_one_line(tmp_path, lines, message):
    saved(tmp_path, 'schema = 1\nname = "w"\nairframe = "v.toml"\n', "w.toml")
    with pytest.raises(VehicleError) as error:
        attached(tmp_path, f'schema = 1\nname = "v"\n{lines}\n')
    assert str(error.value).startswith(f"{tmp_path / 'v.toml'}: {message}")
