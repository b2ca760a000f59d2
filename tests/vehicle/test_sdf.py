"""SDF files: poses and dynamics against MuJoCo and numbers by hand, rotors of plugins,
and what is refused.
"""

import re

import mujoco
import numpy as np
import pytest

from skyarm.dynamics import array_front as arrays
from skyarm.vehicle import VehicleError
from skyarm.vehicle.sdf import read_sdf
from skyarm.vehicle.vehicle_files import load_vehicle

MOMENTS = (
    "<inertia><ixx>0.01</ixx><iyy>0.02</iyy><izz>0.025</izz><ixy>0.001</ixy></inertia>"
)


def link(name, pose="", mass="1", inner=""):
    return (
        "<link"
        f' name="{name}">{pose}<inertial>{inner}<mass>{mass}</mass>{MOMENTS}</inertial>'
        f"</link>"
    )


def joint(name, parent, child, inner="<axis><xyz>0 0 1</xyz></axis>", kind="revolute"):
    return (
        f'<joint name="{name}"'
        f' type="{kind}"><parent>{parent}</parent><child>{child}</child>{inner}</joint>'
    )


def model(body, version="1.9", name="m", words=""):
    return f'<sdf version="{version}"><model name="{name}" {words}>{body}</model></sdf>'


def written(folder, text, name="v.sdf"):
    path = folder / name
    path.parent.mkdir(exist_ok=True)
    path.write_text(text)
    return path


def motor(number, link="r", spin="spin", **changes):
    words = {
        "jointName": spin,
        "linkName": link,
        "turningDirection": "ccw",
        "timeConstantUp": 0.013,
        "timeConstantDown": 0.026,
        "maxRotVelocity": 870,
        "motorConstant": 9.1e-06,
        "momentConstant": 0.017,
        "motorNumber": number,
        "rotorDragCoefficient": 8e-05,
        "rollingMomentCoefficient": 2e-06,
        **changes,
    }
    inner = "".join(f"<{word}>{value}</{word}>" for word, value in words.items())
    return f'<plugin filename="f" name="motor">{inner}</plugin>'


def at(bodies, name):
    frames = {frame.name: frame for frame in bodies.frames}
    return [float(c) for c in frames[name].position]


ALONG_MODEL = '<xyz expressed_in="__model__">0 1 0</xyz>'

ARM = model(
    link(
        "base",
        "<pose>0.3 -0.2 0.5 0 0 0.4</pose>",
        "2.5",
        "<pose>0.01 0.02 -0.03 0.1 0.2 0.3</pose>",
    )
    + link(
        "a",
        '<pose relative_to="shoulder">0 0 0 0.2 0 0</pose>',
        "0.4",
        "<pose>0.05 0 0.02 0 0.5 0</pose>",
    )
    + '<frame name="shoulder" attached_to="base"><pose degrees="true">0.1 0 -0.05 0 30'
    " 90</pose></frame>"
    + link(
        "b",
        '<pose relative_to="a" rotation_format="quat_xyzw">0.2 0.1 0 0 0.6 0'
        " 0.8</pose>",
        "0.3",
    )
    + link("c", '<pose relative_to="b">0 0 0.15 0 0 0</pose>', "0.2")
    + joint(
        "one",
        "base",
        "a",
        '<axis><xyz expressed_in="__model__">0 1'
        " 0</xyz><limit><lower>-1</lower></limit></axis>",
    )
    + joint(
        "two",
        "a",
        "b",
        "<pose>-0.02 0.01 0 0.3 0 0</pose><axis><xyz>0 0 2</xyz></axis>",
    )
    + joint(
        "three",
        "b",
        "c",
        "<axis><xyz>1 0 0</xyz><dynamics><damping>0.3</damping></dynamics></axis>",
        "prismatic",
    )
)


def mjcf_of_the_arm():
    """The same arm in MJCF, each pose by MuJoCo's own rules."""
    turn = 'eulerseq="XYZ"'
    moments = 'fullinertia="0.01 0.02 0.025 0.001 0 0"'
    half = np.deg2rad(30) / 2
    quarter = np.deg2rad(90) / 2
    spin = np.array([np.cos(quarter), 0, 0, np.sin(quarter)])
    pitch = np.array([np.cos(half), 0, np.sin(half), 0])
    shoulder, roll, whole = (
        np.zeros(4),
        np.array([np.cos(0.1), np.sin(0.1), 0, 0]),
        np.zeros(4),
    )
    mujoco.mju_mulQuat(shoulder, spin, pitch)
    mujoco.mju_mulQuat(whole, shoulder, roll)
    # the model's y axis in the axes of link a: back through base (yaw 0.4) and the pose
    # of a
    axis, back, total = np.zeros(3), np.zeros(4), np.zeros(4)
    mujoco.mju_mulQuat(total, np.array([np.cos(0.2), 0, 0, np.sin(0.2)]), whole)
    mujoco.mju_negQuat(back, total)
    mujoco.mju_rotVecQuat(axis, np.array([0.0, 1.0, 0.0]), back)
    slant = f"0 {-np.sin(0.3)} {np.cos(0.3)}"

    def words(values):
        return " ".join(repr(float(each)) for each in values)

    return f"""<mujoco><compiler angle="radian" {turn}/><worldbody><body name="base">
    <freejoint/>
    <inertial mass="2.5" pos="0.01 0.02 -0.03" quat="1 0 0 0" diaginertia="1 1 1"/>
    <body name="a" pos="0.1 0 -0.05" quat="{words(whole)}">
    <joint name="one" axis="{words(axis)}"/>
    <inertial mass="0.4" pos="0.05 0 0.02" diaginertia="1 1 1"
      quat="{np.cos(0.25)} 0 {np.sin(0.25)} 0"/>
    <body name="b" pos="0.2 0.1 0" quat="0.8 0 0.6 0">
    <joint name="two" pos="-0.02 0.01 0" axis="{slant}"/>
    <inertial mass="0.3" pos="0 0 0" {moments}/>
    <body name="c" pos="0 0 0.15"><joint name="three" type="slide" axis="1 0 0"/>
    <inertial mass="0.2" pos="0 0 0" {moments}/></body></body></body></body></worldbody>
    </mujoco>"""


@pytest.mark.parametrize("pose", [(0.0, 0.0, 0.0), (0.7, -1.1, 0.2)])
def test_arm_stands_where_mujoco_puts_the_same_arm(tmp_path, pose):
    path = written(tmp_path, ARM)
    vehicle, bodies = load_vehicle(path), read_sdf(path)
    peer = mujoco.MjModel.from_xml_string(mjcf_of_the_arm())
    data = mujoco.MjData(peer)
    data.qpos[7:] = pose
    mujoco.mj_kinematics(peer, data)
    mujoco.mj_comPos(peer, data)
    assert vehicle.joint_names == ("one", "two", "three")
    center = arrays.center_of_mass(vehicle, [0, 0, 0], [1, 0, 0, 0], list(pose))
    np.testing.assert_allclose(center, data.subtree_com[1], atol=1e-14)
    assert {frame.name for frame in bodies.frames} == {"shoulder", "b"}
    one, two, three = (each.joint for each in vehicle.links)
    assert (one.lower, one.upper) == (-1.0, np.inf)
    assert float(three.damping) == 0.3
    assert (two.kind, three.kind) == ("revolute", "prismatic")


def test_joint_beside_its_link_keeps_the_link_as_a_frame(tmp_path):
    bodies = read_sdf(written(tmp_path, ARM))
    assert [each.name for each in bodies.links] == ["a", "b.two", "c"]
    # 0.02, -0.01 from the joint to the origin of b, in the joint's axes, which are
    # turned by 0.3 rad about x
    np.testing.assert_allclose(
        at(bodies, "b"), [0.02, -0.01 * np.cos(0.3), 0.01 * np.sin(0.3)], atol=1e-15
    )


AXES = "<axis><xyz>1 0 0</xyz>{}</axis>"


@pytest.mark.parametrize(
    ("version", "inner", "right"),
    [
        # of the model, whose x axis is -y of a link with yaw pi/2
        ("1.4", "", [0, -1, 0]),
        ("1.5", "", [1, 0, 0]),
        ("1.6", "<use_parent_model_frame>1</use_parent_model_frame>", [0, -1, 0]),
        ("1.7", "<use_parent_model_frame>1</use_parent_model_frame>", [1, 0, 0]),
        ("1.12", "", [1, 0, 0]),
    ],
)
def test_axis_as_its_version_of_sdf_states_it(tmp_path, version, inner, right):
    pose = "<pose>0 0 0.1 0 0 1.5707963267948966</pose>"
    text = model(
        link("base") + link("a", pose) + joint("j", "base", "a", AXES.format(inner)),
        version,
    )
    bodies = read_sdf(written(tmp_path, text))
    np.testing.assert_allclose(
        [float(c) for c in bodies.links[0].joint.axis], right, atol=1e-15
    )
    assert ("use_parent_model_frame" in " ".join(bodies.notes)) == (version == "1.7")


QUAD = link("base", "<pose>0 0 0.24 0 0 0</pose>", "1.1") + "".join(
    link(f"r{i}", f"<pose>{x} {y} 0.3 0 0 0</pose>", "0.01")
    + joint(f"s{i}", "base", f"r{i}")
    for i, (x, y) in enumerate([(0.2, -0.2), (-0.2, 0.2), (0.2, 0.2), (-0.2, -0.2)])
)

MOTORS = "".join(
    motor(3 - i, f"r{i}", f"s{i}", turningDirection=sense)
    for i, sense in enumerate(["ccw", "ccw", "cw", "cw"])
)


def test_whole_rotors_of_a_merged_model_in_a_folder_beside(tmp_path):
    written(tmp_path, model(QUAD, name="quad_base"), "quad_base/quad_base.sdf")
    text = model(
        '<include merge="true"><uri>model://quad_base</uri><pose>0 0 5 0 0'
        " 1</pose></include>" + MOTORS
    )
    vehicle = load_vehicle(written(tmp_path, text, "quad/model.sdf"))
    # by motorNumber
    assert [rotor.name for rotor in vehicle.rotors] == ["r3", "r2", "r1", "r0"]
    places = [[float(c) for c in rotor.position] for rotor in vehicle.rotors]
    np.testing.assert_allclose(
        places,
        [[-0.2, -0.2, 0.06], [0.2, 0.2, 0.06], [-0.2, 0.2, 0.06], [0.2, -0.2, 0.06]],
        atol=1e-15,
    )
    assert [rotor.direction for rotor in vehicle.rotors] == [-1, -1, 1, 1]
    rotor = vehicle.rotors[0]
    read = (
        rotor.thrust_coefficient,
        rotor.moment_coefficient,
        rotor.time_constant_up,
        rotor.time_constant_down,
    )
    assert read == (9.1e-06, 0.017, 0.013, 0.026)
    assert (
        rotor.max_speed,
        rotor.drag_coefficient,
        rotor.rolling_moment_coefficient,
    ) == (870, 8e-05, 2e-06)
    assert (vehicle.joint_names, vehicle.gaps) == ((), ())
    assert float(vehicle.base.mass) == pytest.approx(1.14, rel=1e-15)
    # their joints turn ten times slower
    assert float(rotor.inertia) == pytest.approx(0.025 / 10, rel=1e-15)


def test_nested_models_carry_names_and_stand_at_their_placement_frames(tmp_path):
    hand = (
        link("palm", "<pose>0.1 0 0 0 0 0</pose>")
        + '<frame name="grip"><pose>0.3 0 0 0 0 0</pose></frame>'
    )
    written(
        tmp_path,
        model(hand, name="hand", words='placement_frame="palm"'),
        "hand/model.sdf",
    )
    include = (
        '<include><uri>model://hand</uri><name>left</name><pose relative_to="a">0 0.5 0'
        " 0 0 0</pose></include>"
    )
    body = link("base") + link("a", "<pose>1 0 0 0 0 0</pose>") + include
    body += joint("j", "base", "a", kind="fixed") + joint(
        "k", "a", "left::palm", kind="fixed"
    )
    body += joint("w", "world", "base", kind="fixed")
    bodies = read_sdf(written(tmp_path, model(body), "it/model.sdf"))
    # the palm, not the hand's own frame, is at the stated pose
    assert at(bodies, "left::palm") == [1, 0.5, 0]
    np.testing.assert_allclose(at(bodies, "left::grip"), [1.2, 0.5, 0], atol=1e-15)
    assert bodies.notes == (
        "joint w: holds the vehicle to the world; not read: the base floats",
    )


def test_world_gives_its_only_moving_model_or_the_named_one(tmp_path):
    floor = f'<model name="floor"><static>true</static>{link("l")}</model>'
    one, two = (
        f'<model name="{name}">{link("body", mass=mass)}</model>'
        for name, mass in (("x", 3), ("y", 4))
    )
    sun = "<include><uri>model://sun</uri></include>"

    def world(inner):
        return written(
            tmp_path,
            f'<sdf version="1.6"><world name="w">{inner}</world></sdf>',
            "w.world",
        )

    path = world(sun + floor + one)
    vehicle = load_vehicle(path)
    assert (vehicle.name, float(vehicle.base.mass)) == ("x", 3)
    assert "model://sun" in vehicle.notes[0]
    path = world(floor + one + two)
    assert float(read_sdf(path, base="y").base.mass) == 4
    with pytest.raises(
        VehicleError,
        match=r"^models = \['x', 'y'\]: must be one, the vehicle; .*base = \"NAME\"",
    ):
        read_sdf(path)


def test_a_blade_of_no_link_is_refused_in_one_line(tmp_path):
    lift = '<plugin name="Lift"><cla>4</cla><link_name>r9</link_name></plugin>'
    with pytest.raises(
        VehicleError, match=r"plugin\[Lift\].link_name = 'r9': must be one of base, r0"
    ):
        load_vehicle(written(tmp_path, model(QUAD + lift)))


def test_toml_completes_rotors_of_blades_and_takes_an_sdf_arm(tmp_path):
    lift = "".join(
        f'<plugin name="Lift"><cla>4</cla><link_name>r{i}</link_name></plugin>'
        for i in range(4)
    )
    path = written(tmp_path, model(QUAD + lift))
    assert (
        load_vehicle(path)
        .gaps[0]
        .startswith(
            "rotors r0, r1, r2, r3: the file states no direction, thrust_coefficient"
            " (its blades are LiftDrag plugins"
        )
    )
    numbers = "thrust_coefficient = 1e-5\nmoment_coefficient = 0.02\nmax_speed = 900\n"
    numbers += "time_constant_up = 0.01\ntime_constant_down = 0.02\n"
    senses = "".join(
        f'[[rotors]]\nname = "r{i}"\ndirection = "{way}"\n'
        for i, way in enumerate(["ccw", "ccw", "cw", "cw"])
    )
    arm = model(
        link("root")
        + link("a", "<pose>0 0 -0.1 0 0 0</pose>")
        + joint("j", "root", "a"),
        name="arm",
    )
    written(tmp_path, arm, "arm.sdf")
    attach = '[[attach]]\narm = "arm.sdf"\n'
    text = (
        'schema = 1\nname = "t"\nsdf ='
        f' "v.sdf"\n[rotor_defaults]\n{numbers}{senses}{attach}'
    )
    vehicle = load_vehicle(written(tmp_path, text, "t.toml"))
    assert [float(rotor.position.z) for rotor in vehicle.rotors] == pytest.approx(
        [0.06] * 4, abs=1e-15
    )
    assert (vehicle.joint_names, vehicle.gaps) == (("j",), ())


def on_airframe(folder, file):
    """An airframe of the library that carries the arm of a file, turned and moved."""
    table = (
        f'[[attach]]\narm = "{file}"\nposition = [0.1, 0.0, -0.05]\nrpy = [0.0, 0.0,'
        " 0.4]\n"
    )
    return load_vehicle(
        written(
            folder,
            f'schema = 1\nname = "v"\nairframe = "hummingbird"\n{table}',
            "on.toml",
        )
    )


def test_an_attached_root_keeps_its_pose_in_its_model_as_mujoco_has_it(tmp_path):
    """The same arm in MJCF, which MuJoCo's own attach puts at the same seat."""
    root = '<pose relative_to="seat">0 0 -0.1 0 0 1.5707963267948966</pose>'
    tip = '<frame name="tip" attached_to="a"><pose>0.3 0.1 0 0 0 0</pose></frame>'
    seat = '<frame name="seat"><pose>0.02 0 0 0.2 0 0</pose></frame>'
    inner = (
        link("root", root)
        + link("a", '<pose relative_to="root">0 0 -0.2 0 0 0</pose>')
        + joint("j", "root", "a")
    )
    # where the model stands is left
    written(tmp_path, model(f"<pose>5 6 7 1 0 0</pose>{seat}{inner}{tip}"), "arm.sdf")
    vehicle = on_airframe(tmp_path, "arm.sdf")
    turns = 'quat="0.99500416527802582 0.09983341664682815 0 0"'  # cos and sin of 0.1
    body = (
        f'<body name="seat" pos="0.02 0 0" {turns}><body name="root" pos="0 0 -0.1"'
        ' quat="0.5 0 0 0.5">'
    )
    arm = (
        '<body pos="0 0 -0.2"><joint/><inertial pos="0 0 0" mass="1" diaginertia="1 1'
        ' 1"/><site name="tip" '
    )
    spec, child = (
        mujoco.MjSpec(),
        mujoco.MjSpec.from_string(
            f'<mujoco><worldbody>{body}{arm}pos="0.3 0.1'
            ' 0"/></body></body></body></worldbody></mujoco>'
        ),
    )
    frame = spec.worldbody.add_frame(
        pos=[0.1, 0, -0.05], quat=[np.cos(0.2), 0, 0, np.sin(0.2)]
    )
    frame.attach_body(child.body("seat"), "z_", "")
    data = mujoco.MjData(spec.compile())
    mujoco.mj_kinematics(data.model, data)
    where = arrays.frame_pose_world(
        vehicle, [0, 0, 0], [1, 0, 0, 0], [0.0], frame="tip"
    )
    np.testing.assert_allclose(where[0], data.site("z_tip").xpos, rtol=0, atol=1e-15)
    np.testing.assert_allclose(
        where[1], data.site("z_tip").xmat.reshape(3, 3), rtol=0, atol=1e-15
    )
    kept = (
        "body root: moved or turned in its file, a pose that it keeps where [[attach]]"
        " names this file"
    )
    assert any(kept in note for note in vehicle.notes)
    assert kept in " ".join(load_vehicle(tmp_path / "arm.sdf").notes)


def test_what_water_adds_and_what_an_include_changes_are_noted(tmp_path):
    written(tmp_path, model(link("a"), name="hand"), "hand/model.sdf")
    include = "<include><uri>model://hand</uri><experimental:params><x/></experimental:params></include>"
    wet = link("base", inner="<fluid_added_mass><xx>1</xx></fluid_added_mass>")
    text = model(wet + include + joint("j", "base", "hand::a", kind="fixed"), "1.10")
    named = text.replace(
        "<sdf ", '<sdf xmlns:experimental="http://sdformat.org/schemas/experimental" '
    )
    for each in (text, named):
        notes = read_sdf(written(tmp_path, each, "it/model.sdf")).notes
        assert "<experimental:params> of the include of model://hand: not read" in notes
        assert "link base: <fluid_added_mass>: not read" in notes


NO_WORD = "<dynamics><spring_stiffness>3</spring_stiffness></dynamics>"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            model(link("a") + link("b")),
            "links without a parent = ['a', 'b']: must be exactly one",
        ),
        (
            model(link("a", mass="nan")),
            "link[a].inertial.mass.value = 'nan': must be a finite number",
        ),
        (
            model(link("a", mass="-1")),
            "link[a].inertial.mass = -1.0: must be at least 0",
        ),
        (
            model(link("a", "<pose>1 2 3</pose>")),
            "link[a].pose = '1 2 3': must be six numbers",
        ),
        (
            model(link("a") + '<frame name="f"><pose relative_to="x"/></frame>'),
            "relative_to = 'x': must be a link",
        ),
        (model(link("a") * 2), "link.name = 'a': must be there, and once in its model"),
        (
            model(link("a") + link("b") + joint("j", "a", "b", kind="ball")),
            "joint[j].type = 'ball': must be one of",
        ),
        (
            model(link("a") + link("b") + joint("j", "x", "b")),
            "joint[j] = 'x': must be a link, as a, b",
        ),
        (
            model(link("a") + link("b") + joint("j", "a", "b") + joint("k", "b", "a")),
            "parent of link[b] = 'a': closed chains are not supported (b -> a -> b)",
        ),
        (
            model(
                link("a") + link("b") + joint("j", "a", "b", f"<axis>{NO_WORD}</axis>")
            ),
            "joint[j].spring_stiffness = '3': must be 0; springs are not supported",
        ),
        (model(link("a") + motor(0, "")), "plugin[motor].linkName = '(missing)'"),
        (
            model(link("a") + motor(0, "x", "")),
            "rotors[x].link = 'x': must be one of base",
        ),
        (
            model(link("a") + motor(0, "a", "") * 2),
            "rotors.name = 'a': stands at two rotors",
        ),
        (
            model(link("a") + motor(0, "a")),
            "plugin[motor].jointName = 'spin': must be a joint of the file: it has no",
        ),
        (
            model(link("a") + link("r") + joint("turn", "a", "r") + motor(0)),
            "plugin[motor].jointName = 'spin': must be a joint of the file: turn",
        ),
        (
            model(link("a", '<pose relative_to="x"/>')),
            "pose of a: relative_to = 'x': must be a link, frame, joint or model",
        ),
        (
            model('<pose relative_to="x"/>' + link("a")),
            (
                "model[m].pose.relative_to = 'x': must be left out, or be a name of the"
                " world"
            ),
        ),
        (
            model('<link name="a"><inertial auto="true"/></link>'),
            "link[a].inertial.auto = 'true': must be false",
        ),
        (
            model(link("a"), "1.3"),
            "root element = 'sdf version 1.3': must be <sdf> of version 1.4 to 1.12",
        ),
        (
            model("<include><uri>model://../x</uri></include>"),
            "include.uri = 'model://../x': must be model://NAME",
        ),
        (
            model("<include><uri>v.sdf</uri><name>n</name></include>"),
            "models = 101: must be at most 100",
        ),
    ],
)
def test_refusal_in_one_line(tmp_path, text, words):
    path = written(tmp_path, text)
    with pytest.raises(
        VehicleError, match=f"^{re.escape(f'{path}: {words}')}"
    ) as error:
        load_vehicle(path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("start", ["pad", "pad::top", "world", "rig"])
def test_a_model_may_stand_at_what_is_in_its_world(tmp_path, start):
    pad = (
        f'<model name="pad"><static>1</static>{link("top")}</model><frame name="rig"/>'
    )
    vehicle = f'<model name="m"><pose relative_to="{start}"/>{link("a")}</model>'
    path = written(
        tmp_path, f'<sdf version="1.9"><world name="w">{pad}{vehicle}</world></sdf>'
    )
    assert float(load_vehicle(path).mass) == 1


def test_what_is_not_read_is_noted_and_a_polynomial_is_no_thrust_coefficient(tmp_path):
    body = (
        '<link name="a"><gravity>0</gravity><sensor name="imu"/></link>'
        + link("r")
        + joint("s", "a", "r")
    )
    body += (
        motor(0, "r", "s", motorType="force_polynomial", reversible="true")
        + '<plugin name="Other"/>'
    )
    vehicle = load_vehicle(written(tmp_path, model(body)))
    assert vehicle.notes[:4] == (
        "sensor imu: not read",
        "link a: without gravity in the file; here it weighs",
        "link a: without mass, ixx, iyy, izz: 1 kg and 1 kg m^2, as SDF defines",
        "plugin Other: not read",
    )
    assert float(vehicle.base.mass) == 2
    assert vehicle.gaps[0].startswith(
        "rotors r: the file states no thrust_coefficient (motorType is force_polynomial"
    )


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("iris.sdf.jinja", "pip install jinja2-cli; jinja2 iris.sdf.jinja -o iris.sdf"),
        (
            "my models/iris.sdf.jinja",
            "jinja2 'my models/iris.sdf.jinja' -o 'my models/iris.sdf'",
        ),
        (
            "nothere.ulg",
            "vehicle = 'nothere.ulg': there is no such file; must be one of",
        ),
        ("drone.usda", "nvidia-srl-usd-to-urdf"),
    ],
)
def test_other_formats_name_what_makes_a_file_that_is_read(name, words):
    with pytest.raises(VehicleError, match=re.escape(words)):
        load_vehicle(name)


def test_a_missing_model_is_not_replaced_by_the_ground(tmp_path):
    ground = f'<model name="ground"><static>1</static>{link("g")}</model>'
    include = "<include><uri>https://example.org/X3</uri></include>"
    path = written(
        tmp_path, f'<sdf version="1.9"><world name="w">{ground}{include}</world></sdf>'
    )
    with pytest.raises(
        VehicleError,
        match=r"^models = \['ground'\]: must be one.*include\.uri = 'https",
    ):
        read_sdf(path)
    with pytest.raises(
        VehicleError, match=r"^base = 'other': must be one of ground; include\.uri"
    ):
        read_sdf(path, base="other")


def test_thrust_acts_at_the_centre_of_mass_of_the_rotors_link(tmp_path):
    # gz-sim's AddWorldForce and Gazebo's AddRelativeForce push at the link's centre of
    # mass
    turning = link(
        "r", "<pose>0.2 0 0 0 0 0</pose>", "0.01", "<pose>0 0.03 0.05 0 0 0</pose>"
    )
    parts = link("b") + turning + joint("spin", "b", "r")
    vehicle = load_vehicle(written(tmp_path, model(parts + motor(0))))
    assert [*vehicle.rotors[0].position] == [0.2, 0.03, 0.05]
