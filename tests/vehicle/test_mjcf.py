"""MJCF files: against MuJoCo's own dynamics of the same file, and what is refused."""

from __future__ import annotations

import re

import mujoco
import numpy as np
import pytest

from skyarm.dynamics import array_front as arrays
from skyarm.vehicle import VehicleError
from skyarm.vehicle.vehicle_files import load_vehicle

ROUNDING = 1e-12
"""Relative; chains of six joints lose two or three digits of 16."""


AXES = ("1 0 0", "0 1 0", "0 0 1")


def random_mjcf(seed, free=True):
    """A random tree: several joints in a body, anchors beside its origin, refs, merged
    bodies, sites.
    """
    rng = np.random.default_rng(seed)
    count = iter(range(100))

    def numbers(values):
        return " ".join(repr(float(each)) for each in values)

    def three(size=0.3):
        return numbers(rng.uniform(-size, size, 3))

    def inertial():
        points = rng.normal(size=(6, 3)) * 0.1
        J = 0.05 * sum(
            (p @ p) * np.eye(3) - np.outer(p, p) for p in points - points.mean(axis=0)
        )
        full = numbers([J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]])
        return (
            f'<inertial pos="{three()}" mass="{rng.uniform(0.1, 1.0)}"'
            f' fullinertia="{full}"/>'
        )

    def joint():
        return (
            f'<joint name="j{next(count)}" type="{rng.choice(["hinge", "slide"])}"'
            f' pos="{three()}" axis="{three(1.0)}" ref="{rng.uniform(-0.5, 0.5)}"'
            ' range="-1.5 1.2" limited="true" damping="0.1" armature="0.01"/>'
        )

    def body(name, inside):
        joints = "".join(joint() for _ in range(rng.integers(0, 3)))
        site = f'<site name="s{name}" pos="{three()}" euler="{three()}"/>'
        return (
            f'<body name="b{name}" pos="{three()}" quat="{three()}'
            f' 0.5">{joints}{inertial()}{site}{inside}</body>'
        )

    tree = body(0, body(1, body(2, "") + body(3, ""))) + body(4, "")
    trunk = f'<body name="trunk" pos="0 0 1">{"<freejoint/>" if free else ""}'
    inner = f"{np.random.default_rng(seed + 50).uniform(0.5, 1.0)}"
    trunk += (
        f'<inertial pos="0.1 0 0" mass="{inner}" diaginertia="0.02 0.02'
        f' 0.03"/>{tree}</body>'
    )
    return (
        f'<mujoco model="m{seed}"><compiler'
        f' angle="radian"/><worldbody>{trunk}</worldbody></mujoco>'
    )


def saved(tmp_path, text, name="m.xml"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def unit_quaternion(rng):
    q = rng.normal(size=4)
    return q / np.linalg.norm(q)


@pytest.mark.parametrize("seed", range(6))
def test_mass_matrix_bias_and_frames_equal_mujocos(tmp_path, seed):
    path = saved(tmp_path, random_mjcf(seed))
    vehicle = load_vehicle(path)
    model = mujoco.MjModel.from_xml_path(str(path))
    data, rng = mujoco.MjData(model), np.random.default_rng(seed)
    n = vehicle.n
    assert n == model.njnt - 1 > 0
    p, wxyz, joints, v = (
        rng.normal(size=3),
        unit_quaternion(rng),
        rng.uniform(-1, 1, n),
        rng.normal(size=6 + n),
    )
    qpos = [model.joint(link.joint.name).qposadr[0] for link in vehicle.links]
    dofs = [
        *range(6),
        *(model.joint(link.joint.name).dofadr[0] for link in vehicle.links),
    ]
    data.qpos[:3], data.qpos[3:7], data.qpos[qpos] = p, wxyz, joints + model.qpos0[qpos]
    data.qvel[dofs] = v
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    M = M[np.ix_(dofs, dofs)]
    ours = arrays.mass_matrix(vehicle, p, wxyz, joints)
    np.testing.assert_allclose(ours, M, rtol=0, atol=ROUNDING * np.abs(M).max())
    bias = arrays.inverse_dynamics(
        vehicle, p, wxyz, joints, v, np.zeros(6 + n), gravity=9.81
    )
    expected = data.qfrc_bias[dofs]
    np.testing.assert_allclose(
        bias, expected, rtol=0, atol=ROUNDING * np.abs(expected).max()
    )
    for k in range(5):
        position, attitude = arrays.frame_pose_world(
            vehicle, p, wxyz, joints, frame=f"s{k}"
        )
        np.testing.assert_allclose(
            position, data.site(f"s{k}").xpos, rtol=0, atol=1e-12
        )
        np.testing.assert_allclose(
            attitude, data.site(f"s{k}").xmat.reshape(3, 3), rtol=0, atol=1e-12
        )
    for link in vehicle.links:
        joint = model.joint(link.joint.name)
        ref = model.qpos0[joint.qposadr[0]]
        np.testing.assert_allclose(
            (link.joint.lower, link.joint.upper), joint.range - ref, rtol=0, atol=1e-15
        )
        assert (link.joint.damping, link.joint.armature) == (0.1, 0.01)
    assert any("with a ref" in note for note in vehicle.notes)


def model(inside, after=""):
    return (
        '<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/><body'
        ' name="base"><freejoint/><geom'
        f' size="0.1"/>{inside}</body></worldbody>{after}</mujoco>'
    )


def arm(joint='<joint name="h" axis="0 1 0"/>', inside=""):
    return f'<body name="arm" pos="0 0 -0.2">{joint}<geom size="0.05"/>{inside}</body>'


FINGERS = arm(
    '<joint name="left" type="slide" axis="0 1 0" range="0.01 0.04"/>',
) + arm('<joint name="right" type="slide" axis="0 1 0"/>').replace('"arm"', '"other"')
TIED = (
    '<equality><joint joint1="right" joint2="left" polycoef="0.002 -1 0 0'
    ' 0"/></equality>'
)


def test_an_equality_of_joints_locks_or_couples_the_second_finger(tmp_path):
    path = saved(tmp_path, model(FINGERS, TIED))
    locked = load_vehicle(path)
    assert [link.joint.name for link in locked.links] == ["left"]
    # its leader at the limit next to zero, 0.01
    assert locked.frame("other").position.y == pytest.approx(0.002 - 0.01, abs=1e-15)
    assert any("tied by an equality: fixed at -0.008" in note for note in locked.notes)
    toml = saved(
        tmp_path, 'schema = 1\nname = "v"\nmjcf = "m.xml"\nmimic = "couple"\n', "v.toml"
    )
    coupled = load_vehicle(toml)
    (follower,) = coupled.followers
    assert (
        follower.link.joint.name,
        follower.leader,
        follower.ratio,
        follower.offset,
    ) == ("right", 0, -1.0, 0.002)


@pytest.mark.parametrize("driven", ["left", "right", "both"])
def test_of_two_tied_joints_the_driven_one_leads(tmp_path, driven):
    """MuJoCo's equality binds both joints; a gripper's file drives either. Places of
    both by MuJoCo's relation.
    """
    names = ["left", "right"] if driven == "both" else [driven]
    motors = "".join(
        f'<position name="m_{name}" joint="{name}" kp="200" forcerange="-30 30"/>'
        for name in names
    )
    saved(tmp_path, model(FINGERS, f"{TIED}<actuator>{motors}</actuator>"))
    toml = 'schema = 1\nname = "v"\nmjcf = "m.xml"\nmimic = "couple"\n'
    vehicle = load_vehicle(saved(tmp_path, toml, "v.toml"))
    (follower,) = vehicle.followers
    lead = "right" if driven == "right" else "left"
    assert [link.joint.name for link in vehicle.links] == [lead]
    assert (len(vehicle.drives), vehicle.joints[0].effort_limit) == (1, 30.0)
    q = 0.013
    right, left = (q, follower.ratio * q + follower.offset)[
        :: 1 if lead == "right" else -1
    ]
    assert right == pytest.approx(0.002 - left, abs=1e-15)
    lost = [
        note for note in vehicle.notes if "which follows another one: not read" in note
    ]
    assert lost == (
        ["actuator m_right: at joint right, which follows another one: not read"]
        * (driven == "both")
    )


def test_what_follows_a_joint_that_is_held_is_held_where_that_puts_it(tmp_path):
    chain = '<equality><joint joint1="left" joint2="right" polycoef="0.001 -1 0 0 0"/>'
    held = chain + '<joint joint1="right" polycoef="0.002 0 0 0 0"/></equality>'
    saved(tmp_path, model(FINGERS, held))
    vehicle = load_vehicle(
        saved(
            tmp_path,
            'schema = 1\nname = "v"\nmjcf = "m.xml"\nmimic = "couple"\n',
            "v.toml",
        )
    )
    assert not any(link.joint.name in ("left", "right") for link in vehicle.moving)
    # 0.001 - 0.002
    assert any(
        "left: tied by an equality: fixed at -0.001" in note for note in vehicle.notes
    )


def test_actuators_give_the_efforts(tmp_path):
    motors = (
        '<actuator><motor joint="h" gear="3" ctrlrange="-2 1" ctrllimited="true"/>'
        '<position joint="k" kp="5" forcerange="-4 4" forcelimited="true"/></actuator>'
    )
    inside = (
        arm()
        + arm('<joint name="k"/>').replace('"arm"', '"b"')
        + arm('<joint name="m"/>').replace('"arm"', '"c"')
    )
    vehicle = load_vehicle(saved(tmp_path, model(inside, motors)))
    assert [link.joint.effort_limit for link in vehicle.links] == [6.0, 4.0, 0.0]
    assert any(
        note.startswith("joint m: without an actuator, so passive")
        for note in vehicle.notes
    )


def test_without_a_free_joint_the_only_body_floats(tmp_path):
    path = saved(tmp_path, random_mjcf(3, free=False))
    with_joint = load_vehicle(saved(tmp_path, random_mjcf(3), "free.xml"))
    vehicle = load_vehicle(path)
    assert vehicle.base == with_joint.base
    assert vehicle.links == with_joint.links


SLIDES = "".join(
    f'<joint name="{n}" type="slide" axis="{a}"/>'
    for n, a in zip("xyz", AXES, strict=True)
)
HINGES = "".join(
    f'<joint name="r{n}" axis="{a}"/>' for n, a in zip("xyz", AXES, strict=True)
)


@pytest.mark.parametrize(
    "six", [SLIDES + HINGES, HINGES + SLIDES], ids=["slides first", "hinges first"]
)
def test_three_slides_and_three_hinges_in_the_base_are_a_free_joint(tmp_path, six):
    free = random_mjcf(3)
    turned = free.replace(
        'name="trunk" pos="0 0 1"', 'name="trunk" pos="0.3 0 1" quat="0.5 0.5 0.5 0.5"'
    )
    motor = (
        '<actuator><motor site="r" gear="0 0 1 0 0 0.01" ctrlrange="0 6"/></actuator>'
    )
    site = f'<site name="r"/></body></worldbody>{motor}'
    both = [
        each.replace("</body></worldbody>", site)
        for each in (free, turned.replace("<freejoint/>", six))
    ]
    first, second = (
        load_vehicle(saved(tmp_path, each, f"m{i}.xml")) for i, each in enumerate(both)
    )
    assert (second.base, second.links, second.frames) == (
        first.base,
        first.links,
        first.frames,
    )
    assert second.notes[0].startswith(
        "body trunk: on three slides and three hinges: taken as free"
    )


@pytest.mark.parametrize(
    ("six", "after"),
    [
        (SLIDES.replace('axis="0 0 1"', 'axis="1 1 0"') + HINGES, ""),
        (SLIDES + HINGES, '<actuator><motor joint="z"/></actuator>'),
        (SLIDES + HINGES, '<equality><joint joint1="z" joint2="x"/></equality>'),
        (SLIDES.replace('"z"', '"z" stiffness="3"') + HINGES, ""),
    ],
    ids=["in a plane", "driven", "tied", "on a spring"],
)
def test_six_joints_that_something_holds_are_no_free_joint(tmp_path, six, after):
    path = saved(tmp_path, model(arm(), after).replace("<freejoint/>", six))
    with pytest.raises(
        VehicleError, match=r"'world' weighs nothing|stiffness = 3.0: must be 0"
    ):
        load_vehicle(path)


def test_what_is_fixed_to_the_world_is_left_out_however_many_joints_the_vehicle_has(
    tmp_path,
):
    shelf = (
        '<worldbody><body name="shelf"><body name="board"><geom'
        ' size="1"/></body></body>'
    )
    path = saved(tmp_path, model(arm()).replace("<worldbody>", shelf))
    assert len(load_vehicle(path).links) == 1
    crane = shelf.replace('<geom size="1"/>', '<joint axis="1 0 0"/><geom size="1"/>')
    path = saved(tmp_path, model(arm()).replace("<worldbody>", crane))
    with pytest.raises(
        VehicleError,
        match=r"body\[shelf\] = 'beside the base': must be a part of the base's tree",
    ):
        load_vehicle(path)


REFUSED = {
    "ball": (
        model(arm('<joint name="b" type="ball"/>')),
        "joint[b].type = 'ball': must be 'hinge' or 'slide'",
    ),
    "spring": (
        model(arm('<joint name="h" stiffness="3"/>')),
        "joint[h].stiffness = 3.0: must be 0",
    ),
    "closed chain": (
        model(
            arm(),
            '<equality><connect body1="arm" body2="base" anchor="0 0 0"/></equality>',
        ),
        "equality[0] = 'connect': closed chains are not supported",
    ),
    "curve": (
        model(FINGERS, TIED.replace("-1 0", "-1 2")),
        (
            "equality of joint[right].polycoef = [0.002, -1.0, 2.0, 0.0, 0.0]: must be"
            " a straight line"
        ),
    ),
    "ring": (
        model(
            FINGERS,
            TIED.replace(
                "</equality>", '<joint joint1="left" joint2="right"/></equality>'
            ),
        ),
        "must not lead back (",
    ),
    "tendon": (
        model(
            arm(),
            '<tendon><fixed name="t" stiffness="1"><joint joint="h"'
            ' coef="1"/></fixed></tendon>',
        ),
        "tendon[t] = 'a pull of its own': must pull nothing",
    ),
    "two vehicles": (
        model("", "").replace(
            "</worldbody>",
            '<body name="b"><freejoint/><geom size="1"/></body></worldbody>',
        ),
        "bodies with a free joint = ['base', 'b']: must be one",
    ),
    "gravity compensation": (
        model(arm()).replace('"arm"', '"arm" gravcomp="1"'),
        "body[arm].gravcomp = 1.0: must be 0",
    ),
    "no mass": (model(arm().replace('size="0.05"', 'size="0.05" mass="0"')), "MJCF = "),
    "fixed arm": (
        f"<mujoco><worldbody>{arm()}</worldbody></mujoco>",
        "base.mass = 0.0: must be greater than 0; its root 'world' weighs nothing",
    ),
    "not mjcf": (
        "<robot/>",
        (
            "root element = 'robot': must be <mujoco>; the name of a file with <robot>"
            " ends in .urdf"
        ),
    ),
    "not xml": ("<mujoco>\n<body></mujoco>", "must be well-formed"),
    "unknown element": (model("<wheel/>"), "MJCF = "),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_has_no_counterpart_is_refused_by_name(tmp_path, case):
    text, message = REFUSED[case]
    path = saved(tmp_path, text)
    with pytest.raises(VehicleError) as error:
        load_vehicle(path)
    assert str(error.value).startswith(f"{path}: ")
    assert message in str(error.value)
    assert "\n" not in str(error.value)


WHOLE = (
    '<mujoco><worldbody><body name="b"><freejoint/><inertial pos="0 0 0" mass="2"'
    ' diaginertia="0.1 0.1 0.1"/><body name="arm"><joint name="h" axis="0 1 0"'
    ' range="-60 60" limited="true" damping="0.1"/><geom size="0.05" pos="0 0 0.1"'
    ' mass="0.3"/></body><site name="s" pos="0.1 0'
    ' 0"/></body></worldbody><actuator><motor name="m" site="s" gear="0 0 1 0 0 0.02"'
    ' ctrllimited="true" ctrlrange="0 9"/><position name="p" joint="h"'
    ' kp="10"/></actuator></mujoco>'
)


@pytest.mark.parametrize("bad", ["nan", "inf", "-inf"])
def test_numbers_that_are_not_finite_are_refused_by_element_and_word(tmp_path, bad):
    assert load_vehicle(saved(tmp_path, WHOLE)).n == 1
    places = [
        (found, place)
        for found in re.finditer(r'(\w+)="([-.\d ]+)"', WHOLE)
        for place in re.finditer(r"\S+", found[2])
        if not (found[1].endswith("range") and "inf" in bad)
    ]
    assert len(places) == (30 if bad == "nan" else 26)
    for found, place in places:
        begin = found.start(2) + place.start()
        path = saved(tmp_path, f"{WHOLE[:begin]}{bad}{WHOLE[begin + len(place[0]) :]}")
        with pytest.raises(VehicleError) as error:
            load_vehicle(path)
        element = WHOLE[: found.start()].rpartition("<")[2].partition(" ")[0]
        assert re.match(
            rf"{element}\[\w+\]\.{found[1]} = '{bad}': must be a",
            str(error.value).removeprefix(f"{path}: "),
        )
        assert "\n" not in str(error.value)


def test_a_range_without_end_is_mujocos_own_and_nan_in_an_included_file_is_refused(
    tmp_path,
):
    text = WHOLE.replace('range="-60 60"', 'range="-60 inf"')
    lower, upper = mujoco.MjModel.from_xml_string(text).jnt_range[1]
    (link,) = load_vehicle(saved(tmp_path, text)).links
    assert link.joint.ends == (lower, upper)
    part = (
        '<mujoco><worldbody><body name="c"><geom size="0.1"'
        ' mass="nan"/></body></worldbody></mujoco>'
    )
    saved(tmp_path, part, "part.xml")
    path = saved(
        tmp_path, WHOLE.replace("<worldbody>", '<include file="part.xml"/><worldbody>')
    )
    with pytest.raises(VehicleError, match=r"^\S+: MJCF = \"XML contains a 'NaN'"):
        load_vehicle(path)


def test_a_floor_without_end_beside_the_vehicle_loads(tmp_path):
    floor = '<worldbody><geom type="plane" size="inf inf 1"/>'
    text = WHOLE.replace("<worldbody>", floor)
    assert mujoco.MjModel.from_xml_string(text).nbody == 3
    assert load_vehicle(saved(tmp_path, text)).n == 1


def test_an_arm_fixed_to_its_world_is_attached(tmp_path):
    saved(
        tmp_path,
        f'<mujoco model="a"><worldbody>{arm()}</worldbody></mujoco>',
        "arm.xml",
    )
    text = (
        'schema = 1\nname = "v"\nairframe = "hummingbird"\n[[attach]]\narm ='
        ' "arm.xml"\nposition = [0.1, 0.0, 0.0]\n'
    )
    vehicle = load_vehicle(saved(tmp_path, text, "v.toml"))
    assert [link.joint.name for link in vehicle.links] == ["h"]
    assert vehicle.base == load_vehicle("hummingbird").base
    assert tuple(vehicle.links[0].joint.position) == (0.1, 0, -0.2)


@pytest.mark.parametrize(
    ("file", "name"), [("m.xml", "b\xe4se"), ("caf\udce9.xml", "base")]
)
def test_names_that_are_no_utf8_are_refused_in_one_line(tmp_path, file, name):
    text = f'<?xml version="1.0" encoding="latin-1"?>{model(arm())}'.replace(
        "base", name
    )
    path = tmp_path / file
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(
        VehicleError, match=r"MJCF = .*utf-8.*: must be a model that MuJoCo loads$"
    ):
        load_vehicle(path)
