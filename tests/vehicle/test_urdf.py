"""URDF files: against Pinocchio's reader and dynamics, and what is refused."""

import math
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from skyarm.dynamics import array_front as arrays
from skyarm.vehicle import VehicleError
from skyarm.vehicle.vehicle_files import load_vehicle


def rotation(rng):
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def inertial(rng):
    """A random real body: a cloud of points gives an inertia that obeys every
    inequality.
    """
    points, mass = rng.normal(size=(5, 3)) * 0.1, rng.uniform(0.05, 0.5)
    points -= points.mean(axis=0)
    J = mass / 5 * sum((p @ p) * np.eye(3) - np.outer(p, p) for p in points)
    names = (
        ("ixx", 0, 0),
        ("iyy", 1, 1),
        ("izz", 2, 2),
        ("ixy", 0, 1),
        ("ixz", 0, 2),
        ("iyz", 1, 2),
    )
    entries = " ".join(f'{name}="{float(J[i, j])!r}"' for name, i, j in names)
    return (
        f'<inertial>{origin(rng)}<mass value="{mass!r}"/><inertia'
        f" {entries}/></inertial>"
    )


def origin(rng):
    xyz, rpy = rng.uniform(-0.3, 0.3, 3), rng.uniform(-3, 3, 3)
    return (
        f'<origin xyz="{" ".join(map(repr, xyz.tolist()))}"'
        f' rpy="{" ".join(map(repr, rpy.tolist()))}"/>'
    )


def random_urdf(seed, joints):
    """A random tree whose links stand in random order; every fourth joint or so is
    fixed, some links weigh nothing.
    """
    rng = np.random.default_rng(seed)
    links, text = ["trunk"], [f'<link name="trunk">{inertial(rng)}</link>']
    moving = 0
    while moving < joints:
        name = f"l{len(links)}"
        kind = rng.choice(
            ["revolute", "continuous", "prismatic", "fixed"], p=[0.35, 0.2, 0.2, 0.25]
        )
        moving += kind != "fixed"
        parent = links[rng.integers(max(0, len(links) - 3), len(links))]
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        own = "" if kind == "fixed" and rng.random() < 0.5 else inertial(rng)
        text.append(f'<link name="{name}">{own}</link>')
        text.append(
            f'<joint name="j{len(links)}" type="{kind}"><parent link="{parent}"/><child'
            f' link="{name}"/>{origin(rng)}<axis'
            f' xyz="{" ".join(map(repr, axis.tolist()))}"/><limit lower="-3.1"'
            ' upper="3.2" effort="5.5" velocity="9"/><dynamics damping="0.25"'
            ' friction="0.125"/></joint>'
        )
        links.append(name)
    rng.shuffle(text)
    return f'<robot name="random{seed}">{"".join(text)}</robot>'


def loaded(tmp_path, text, name="r.urdf"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return load_vehicle(path)


@pytest.mark.parametrize("seed", range(24))
def test_mass_matrix_inverse_dynamics_and_frames_equal_pinocchio(tmp_path, seed):
    """Relative 1e-10: rounding of a chain of up to seven joints is about 1e-14."""
    pin = pytest.importorskip("pinocchio")
    text = random_urdf(seed, 1 + seed % 7)
    vehicle = loaded(tmp_path, text)
    model = pin.buildModelFromXML(text, pin.JointModelFreeFlyer())
    data = model.createData()
    rng = np.random.default_rng(1000 + seed)
    n = vehicle.n
    assert n == model.nv - 6
    R, p, joints = rotation(rng), rng.normal(size=3), rng.uniform(-1.0, 1.0, n)
    quaternion = pin.Quaternion(R)
    v, a = rng.normal(size=6 + n), rng.normal(size=6 + n)
    # Pinocchio's base velocity is (R^T v_W, w_B), and its acceleration that one's
    # derivative
    to_pin = np.eye(6 + n)
    to_pin[:3, :3] = R.T
    order = list(range(6))
    q = pin.neutral(model)
    q[:3], q[3:7] = p, quaternion.coeffs()
    for value, link in zip(joints, vehicle.links, strict=True):
        joint = model.joints[model.getJointId(link.joint.name)]
        order.append(joint.idx_v)
        q[joint.idx_q : joint.idx_q + joint.nq] = (
            [value] if joint.nq == 1 else [math.cos(value), math.sin(value)]
        )
    pick = np.zeros((6 + n, 6 + n))
    pick[order, range(6 + n)] = 1.0
    T = pick @ to_pin
    drift = np.zeros(6 + n)
    drift[:3] = -np.cross(v[3:6], R.T @ v[:3])
    M = pin.crba(model, data, q)
    M = np.triu(M) + np.triu(M, 1).T
    wxyz = np.array([quaternion.w, quaternion.x, quaternion.y, quaternion.z])
    ours = arrays.mass_matrix(vehicle, p, wxyz, joints)
    np.testing.assert_allclose(ours, T.T @ M @ T, rtol=0, atol=1e-10 * np.abs(M).max())
    expected = T.T @ pin.rnea(model, data, q, T @ v, T @ a + pick @ drift)
    found = arrays.inverse_dynamics(vehicle, p, wxyz, joints, v, a, gravity=9.81)
    np.testing.assert_allclose(
        found, expected, rtol=0, atol=1e-10 * np.abs(expected).max()
    )
    pin.framesForwardKinematics(model, data, q)
    for frame in vehicle.frames:
        place = data.oMf[model.getFrameId(frame.name)]
        position, attitude = arrays.frame_pose_world(
            vehicle, p, wxyz, joints, frame=frame.name
        )
        np.testing.assert_allclose(position, place.translation, rtol=0, atol=1e-10)
        np.testing.assert_allclose(attitude, place.rotation, rtol=0, atol=1e-10)


def test_the_random_trees_exercise_every_kind_of_joint_and_merged_links():
    text = "".join(random_urdf(seed, 1 + seed % 7) for seed in range(24))
    assert all(
        f'type="{kind}"' in text
        for kind in ("revolute", "continuous", "prismatic", "fixed")
    )


def random_trunk_and_stalk(kind, limits, seed):
    rng = np.random.default_rng(seed)
    return (
        f'<robot name="r"><link name="trunk">{inertial(rng)}</link><link'
        f' name="stalk">{inertial(rng)}</link><joint name="swing"'
        ' type="revolute"><parent link="trunk"/><child'
        f' link="stalk"/>{origin(rng)}<axis xyz="0 0.6 0.8"/><limit lower="-1"'
        ' upper="1" effort="1" velocity="1"/></joint><link'
        f' name="sensor">{inertial(rng)}</link><joint name="mount"'
        f' type="{kind}"><parent link="stalk"/><child link="sensor"/>{origin(rng)}<axis'
        f' xyz="0.48 0.6 0.64"/>{limits}</joint></robot>'
    )


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
@pytest.mark.parametrize("value", [0.0, 0.7, -2.5])
def test_a_joint_whose_limits_are_one_number_is_fixed_there(tmp_path, kind, value):
    """Against Pinocchio's moving joint, held at that value."""
    pin = pytest.importorskip("pinocchio")
    limits = f'<limit lower="{value}" upper="{value}" effort="0" velocity="0"/>'
    vehicle = loaded(tmp_path, random_trunk_and_stalk(kind, limits, 5))
    assert [each.joint.name for each in vehicle.links] == ["swing"]
    model = pin.buildModelFromXML(
        random_trunk_and_stalk(kind, limits.replace("lower", "x"), 5),
        pin.JointModelFreeFlyer(),
    )
    data = model.createData()
    q = pin.neutral(model)
    for name, at in (("swing", 0.4), ("mount", value)):
        q[model.joints[model.getJointId(name)].idx_q] = at
    still = (np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.4]))
    M = pin.crba(model, data, q)
    M = (np.triu(M) + np.triu(M, 1).T)[:7, :7]
    np.testing.assert_allclose(
        arrays.mass_matrix(vehicle, *still), M, rtol=0, atol=1e-13 * np.abs(M).max()
    )
    pin.framesForwardKinematics(model, data, q)
    place = data.oMf[model.getFrameId("sensor")]
    position, attitude = arrays.frame_pose_world(vehicle, *still, frame="sensor")
    np.testing.assert_allclose(position, place.translation, rtol=0, atol=1e-14)
    np.testing.assert_allclose(attitude, place.rotation, rtol=0, atol=1e-14)


ROTORS_IMU = """
<robot name="hummingbird">
  <link name="hummingbird/base_link"><inertial><mass value="0.68"/>
    <inertia ixx="0.007" iyy="0.007" izz="0.012" ixy="0" ixz="0" iyz="0"/></inertial>
    </link>
  <link name="hummingbird/imu_link"><inertial><mass value="0.015"/>
  <origin xyz="0 0 0" rpy="0 0 0"/>
    <inertia ixx="0.0001" ixy="0" ixz="0" iyy="0.000002" iyz="0" izz="0.000002"/>
    </inertial></link>
  <joint name="hummingbird/imu_joint" type="revolute">
  <parent link="hummingbird/base_link"/>
    <child link="hummingbird/imu_link"/><origin xyz="0 0 0.02" rpy="0 0 0"/>
    <limit effort="0" lower="0" upper="0" velocity="0"/></joint>
</robot>
"""


def test_a_sensor_hung_as_gazebo_models_hang_it_joins_the_base(tmp_path):
    vehicle = loaded(tmp_path, ROTORS_IMU)
    assert vehicle.n == 0
    assert vehicle.base.mass == pytest.approx(0.695, abs=1e-15)
    assert vehicle.base.com.z == pytest.approx(0.015 * 0.02 / 0.695, rel=1e-14)
    (imu,) = vehicle.frames
    assert (imu.name, imu.link, tuple(imu.position)) == (
        "hummingbird/imu_link",
        -1,
        (0, 0, 0.02),
    )


@pytest.mark.parametrize(
    ("limits", "low", "high"),
    [
        ('effort="1"', -math.inf, math.inf),
        ('effort="1" lower="0"', 0.0, math.inf),
        ('effort="1" upper="0"', -math.inf, 0.0),
        ('effort="1" lower="-0.5"', -0.5, 0.0),
        ('effort="1" upper="0.5"', 0.0, 0.5),
        ('effort="1" lower="-inf" upper="0.5"', -math.inf, 0.5),
    ],
)
def test_limits_left_out_are_none_or_the_specifications_zero_and_never_fix_a_joint(
    tmp_path, limits, low, high
):
    vehicle = loaded(
        tmp_path, random_trunk_and_stalk("revolute", f"<limit {limits}/>", 5)
    )
    mount = vehicle.links[1].joint
    assert (mount.name, mount.lower, mount.upper) == ("mount", low, high)
    assert ("joint mount: with" in " ".join(vehicle.notes)) == ("inf" not in limits)


def link(name, mass=0.5, at="0 0 -0.1"):
    return (
        f'<link name="{name}"><inertial><origin xyz="{at}"/><mass'
        f' value="{mass}"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0"'
        ' iyz="0"/></inertial></link>'
    )


def joint(
    name,
    parent,
    child,
    kind="revolute",
    more='<limit lower="-1" upper="2" effort="3" velocity="4"/>',
):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child'
        f' link="{child}"/>{more}</joint>'
    )


def robot(*parts):
    return f'<robot name="r">{"".join(parts)}</robot>'


def test_limits_damping_and_friction_are_read(tmp_path):
    more = (
        '<axis xyz="0 0 2"/><limit lower="-1" upper="2" effort="3" velocity="4"/>'
        '<dynamics damping="0.5" friction="0.25"/>'
    )
    found = (
        loaded(tmp_path, robot(link("b"), link("a"), joint("j", "b", "a", more=more)))
        .links[0]
        .joint
    )
    assert (
        found.lower,
        found.upper,
        found.effort_limit,
        found.damping,
        found.coulomb,
    ) == (-1.0, 2.0, 3.0, 0.5, 0.25)
    assert tuple(found.axis) == (0, 0, 1)
    assert all(type(c) is int for c in found.axis)


def test_a_continuous_joint_has_no_limits_and_an_axis_left_out_is_x(tmp_path):
    found = (
        loaded(
            tmp_path,
            robot(link("b"), link("a"), joint("j", "b", "a", "continuous", "")),
        )
        .links[0]
        .joint
    )
    assert (found.kind, tuple(found.axis)) == ("revolute", (1, 0, 0))
    assert (found.lower, found.upper, found.effort_limit) == (-math.inf, math.inf, 0.0)
    assert (found.damping, found.coulomb) == (0, 0)
    limited = joint(
        "j",
        "b",
        "a",
        "continuous",
        '<limit lower="-1" upper="1" effort="3" velocity="4"/>',
    )
    found = loaded(tmp_path, robot(link("b"), link("a"), limited)).links[0].joint
    assert (found.lower, found.upper, found.effort_limit) == (-math.inf, math.inf, 3.0)


def test_a_quarter_turn_of_an_inertial_swaps_its_moments_and_leaves_structural_zeros(
    tmp_path,
):
    text = (
        '<link name="b"><inertial><origin rpy="0 0 1.5707963267948966"/><mass'
        ' value="1"/><inertia ixx="0.01" iyy="0.02" izz="0.025" ixy="0" ixz="0"'
        ' iyz="0"/></inertial></link>'
    )
    inertia = loaded(tmp_path, robot(text)).base.inertia
    assert inertia.entries == (0.02, 0.01, 0.025, 0, 0, 0)
    assert all(type(c) is int for c in inertia.entries[3:])


def test_a_fixed_child_joins_its_parent_and_leaves_its_frame(tmp_path):
    fixed = joint(
        "f",
        "a",
        "tip",
        "fixed",
        '<origin xyz="0 0 -0.2" rpy="0 1.5707963267948966 0"/>',
    )
    vehicle = loaded(
        tmp_path,
        robot(
            link("b"),
            link("a"),
            link("tip", 0.25, "0.1 0 0"),
            joint("j", "b", "a"),
            fixed,
        ),
    )
    assert vehicle.n == 1
    assert vehicle.end_effector == "tip"
    assert vehicle.frame("tip").link == 0
    assert tuple(vehicle.frame("tip").position) == (0, 0, -0.2)
    # x of the tip's frame points along -z of the arm: the tip's mass sits at z = -0.3
    body = vehicle.links[0].body
    assert body.mass == 0.75
    assert body.com.z == pytest.approx((0.5 * -0.1 + 0.25 * -0.3) / 0.75, abs=1e-15)
    assert body.com.x == 0


def test_the_root_may_weigh_nothing_if_a_fixed_child_does(tmp_path):
    assert (
        loaded(
            tmp_path,
            robot(
                '<link name="root"/>',
                link("body"),
                joint("f", "root", "body", "fixed", ""),
            ),
        ).mass
        == 0.5
    )


def without(pattern):
    """A link whose text lost what matches."""
    text = re.sub(pattern, "", link("b"), count=1)
    assert text != link("b")
    return text


def twice(tag):
    """A link with an element that stands twice."""
    text = re.sub(
        rf"<{tag}[ >].*(?:/{tag}>)|<{tag} [^>]*/>",
        lambda found: 2 * found[0],
        link("b"),
        count=1,
    )
    assert text.count(f"<{tag}>") + text.count(f"<{tag} ") == 2
    return text


REFUSED = {
    "floating": (
        robot(link("b"), link("a"), joint("j", "b", "a", "floating")),
        "joint[j].type = 'floating': must be one",
    ),
    "planar": (
        robot(link("b"), link("a"), joint("j", "b", "a", "planar")),
        "joint[j].type = 'planar': must be one of",
    ),
    "two parents": (
        robot(
            link("b"),
            link("a"),
            link("c"),
            joint("j", "b", "a"),
            joint("k", "b", "c"),
            joint("m", "c", "a"),
        ),
        (
            "joint[m].child = 'a': closed chains are not supported (joint 'j' moves it"
            " already)"
        ),
    ),
    "ring": (
        robot(
            link("b"), link("a"), link("c"), joint("j", "a", "c"), joint("k", "c", "a")
        ),
        "parent of link[c] = 'a': closed chains are not supported (c -> a -> c)",
    ),
    "ring without a root": (
        robot(link("a"), link("c"), joint("j", "a", "c"), joint("k", "c", "a")),
        "closed chains are not supported (c -> a -> c)",
    ),
    "loop element": (
        robot(link("b"), '<loop_joint name="x"/>'),
        "<loop_joint> = 'x': closed chains are not supported",
    ),
    "two roots": (
        robot(link("b"), link("a")),
        "links without a parent = ['b', 'a']: must be exactly one",
    ),
    "no mass moved": (
        robot(link("b"), '<link name="a"/>', joint("j", "b", "a")),
        "joints[j] = \"revolute joint of 'a', mass 0.0 kg\": must move mass",
    ),
    "unknown child": (
        robot(link("b"), joint("j", "b", "a")),
        "joint[j].child = 'a': must be one of b",
    ),
    "unknown parent": (
        robot(link("b"), link("a"), joint("j", "x", "a")),
        "joint[j].parent = 'x': must be one of b, a",
    ),
    "zero axis": (
        robot(
            link("b"),
            link("a"),
            joint("j", "b", "a", "continuous", '<axis xyz="0 0 0"/>'),
        ),
        "joint[j].axis = [0.0, 0.0, 0.0]: must have a direction",
    ),
    "short axis": (
        robot(
            link("b"),
            link("a"),
            joint("j", "b", "a", "continuous", '<axis xyz="0 1"/>'),
        ),
        "joint[j].axis.xyz = '0 1': must be three numbers",
    ),
    "negative mass": (
        robot(link("b", -1.0)),
        "link[b].inertial.mass = -1.0: must be at least 0",
    ),
    "no mass": (
        robot(without("<mass .*?/>")),
        "link[b].inertial.mass = '(missing)': must give value",
    ),
    "empty mass": (
        robot(without(' value="0.5"')),
        "link[b].inertial.mass.value = '(missing)': must be a number",
    ),
    "mass without a number": (
        robot(link("b", "")),
        "link[b].inertial.mass.value = '': must be a finite number",
    ),
    "no inertia": (
        robot(without("<inertia .*?/>")),
        "link[b].inertial.inertia = '(missing)': must give ixx, iyy",
    ),
    "no moment": (
        robot(without('iyy="0.01" ')),
        "link[b].inertial.inertia.iyy = '(missing)': must be a number",
    ),
    "no product": (
        robot(without(' iyz="0"')),
        "link[b].inertial.inertia.iyz = '(missing)': must be a number",
    ),
    "empty inertial": (
        robot('<link name="b"><inertial/></link>'),
        "link[b].inertial.mass = '(missing)'",
    ),
    "two inertials": (
        robot(twice("inertial")),
        "link[b].inertial = '2 elements <inertial>': must be at most one",
    ),
    "two masses": (
        robot(twice("mass")),
        "link[b].inertial.mass = '2 elements <mass>': must be at most one",
    ),
    "two inertias": (
        robot(twice("inertia")),
        "link[b].inertial.inertia = '2 elements <inertia>': must be at most one",
    ),
    "two origins": (
        robot(twice("origin")),
        "link[b].inertial.origin = '2 elements <origin>': must be at most one",
    ),
    "axis without a direction": (
        robot(link("b"), link("a"), joint("j", "b", "a", "continuous", "<axis/>")),
        "joint[j].axis.xyz = '(missing)': must be three numbers",
    ),
    "two axes": (
        robot(
            link("b"),
            link("a"),
            joint(
                "j", "b", "a", "continuous", '<axis xyz="0 0 1"/><axis xyz="0 1 0"/>'
            ),
        ),
        "joint[j].axis = '2 elements <axis>': must be at most one",
    ),
    "two limits": (
        robot(
            link("b"),
            link("a"),
            joint(
                "j", "b", "a", more='<limit lower="-1" upper="1"/><limit effort="3"/>'
            ),
        ),
        "joint[j].limit = '2 elements <limit>': must be at most one",
    ),
    "two parents in a joint": (
        robot(link("b"), link("a"), joint("j", "b", "a", more='<parent link="a"/>')),
        "joint[j].parent = '2 elements <parent>': must be at most one",
    ),
    "nan mass": (
        robot(link("b", "nan")),
        "link[b].inertial.mass.value = 'nan': must be a finite number",
    ),
    "triangle": (
        robot(link("b").replace('ixx="0.01"', 'ixx="0.05"')),
        "base.inertia = 'principal moments",
    ),
    "two links of one name": (
        robot(link("b"), link("b")),
        "link.name = 'b': stands twice",
    ),
    "two joints of one name": (
        robot(
            link("b"), link("a"), link("c"), joint("j", "b", "a"), joint("j", "a", "c")
        ),
        "joint.name = 'j': stands twice",
    ),
    "no root element": ("<model/>", "root element = 'model': must be <robot>"),
    "of SDF": (
        "<sdf/>",
        (
            "root element = 'sdf': must be <robot>; the name of a file with <sdf> ends"
            " in .sdf"
        ),
    ),
    "no link": ("<robot/>", "robot = 'no <link>': must have at least one link"),
    "not xml": ("<robot>\n<link>\n</robot>", "line 3"),
    "xacro": (
        '<robot xmlns:xacro="http://x/xacro"><xacro:arm/></robot>',
        "expand xacro first",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_flown_is_refused_by_name(tmp_path, case):
    text, message = REFUSED[case]
    with pytest.raises(VehicleError) as error:
        loaded(tmp_path, text)
    assert str(error.value).startswith(f"{tmp_path / 'r.urdf'}: ")
    assert message in str(error.value)
    assert "\n" not in str(error.value)


SEAT = '<origin xyz="0 0 -0.3" rpy="0 1.5707963267948966 0"/>'
ARM = robot(
    link("trunk"),
    link("arm"),
    link("gripper", 0.1),
    joint("elbow", "trunk", "arm"),
    joint("f", "arm", "gripper", "fixed", SEAT),
)
OVERLAY = """
schema = 1
name = "mixed"
urdf = "sub/arm.urdf"
end_effector = "tool"
[[joints]]
name = "elbow"
effort_limit = 1.5
damping = 0.01
upper = 0.5
[[frames]]
name = "tool"
link = "gripper"
position = [0.1, 0.0, 0.0]
rpy = [0.0, -1.5707963267948966, 0.0]
[[frames]]
name = "eye"
link = "trunk"
position = [0.1, 0.0, 0.0]
[[rotors]]
name = "only"
position = [0.0, 0.0, 0.1]
axis = [0.0, 3.0, 4.0]
direction = "ccw"
thrust_coefficient = 1e-5
moment_coefficient = 0.01
"""


def overlay(tmp_path, text):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "arm.urdf").write_text(ARM, encoding="utf-8")
    path = tmp_path / "mixed.toml"
    path.write_text(text, encoding="utf-8")
    return load_vehicle(path)


def test_a_toml_file_adds_rotors_frames_and_limits_to_a_urdf_file(tmp_path):
    vehicle = overlay(tmp_path, OVERLAY)
    elbow = vehicle.links[0].joint
    assert vehicle.name == "mixed"
    assert (elbow.lower, elbow.upper, elbow.effort_limit, elbow.damping) == (
        -1.0,
        0.5,
        1.5,
        0.01,
    )
    assert [frame.name for frame in vehicle.frames] == ["gripper", "tool", "eye"]
    # the gripper's x axis points along -z of the arm, and the tool's frame turns back
    tool = vehicle.frame(vehicle.end_effector)
    assert (tool.link, tool.position.x, tool.position.y) == (0, 0, 0)
    assert tool.position.z == pytest.approx(-0.4, abs=1e-15)
    assert [tuple(row) for row in tool.rotation.rows] == [
        (1, 0, 0),
        (0, 1, 0),
        (0, 0, 1),
    ]
    assert vehicle.frame("eye").link == -1
    assert tuple(vehicle.rotors[0].axis) == (0, 0.6, 0.8)
    assert vehicle.rotors[0].direction == 1


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('name = "elbow"', 'name = "knee"', "joints.name = 'knee': must be elbow"),
        (
            'link = "gripper"',
            'link = "claw"',
            "frames[tool].link = 'claw': must be one of base, arm, gripper",
        ),
        (
            "end_effector",
            "base = {mass = 1.0}\nend_effector",
            "base = 'a table': must not be given together with 'urdf'",
        ),
        ("sub/arm.urdf", "arm.urdf", "urdf = 'arm.urdf': no such file"),
        (
            "damping = 0.01",
            "axis = [1.0, 0.0, 0.0]",
            "joints[elbow].axis = [1.0, 0.0, 0.0]: unknown field; allowed: name, lower",
        ),
    ],
)
def test_a_wrong_addition_is_refused(tmp_path, old, new, message):
    with pytest.raises(VehicleError) as error:
        overlay(tmp_path, OVERLAY.replace(old, new, 1))
    assert message in str(error.value)


def test_an_error_in_the_urdf_file_names_both_files(tmp_path):
    (tmp_path / "bad.urdf").write_text(robot(), encoding="utf-8")
    path = tmp_path / "v.toml"
    path.write_text('schema = 1\nname = "v"\nurdf = "bad.urdf"\n', encoding="utf-8")
    with pytest.raises(
        VehicleError, match=r"v.toml: urdf = 'bad.urdf': robot = 'no <link>'"
    ):
        load_vehicle(path)


def test_the_xml_of_the_random_trees_is_well_formed():
    assert len(ET.fromstring(random_urdf(3, 4)).findall("joint")) >= 4
