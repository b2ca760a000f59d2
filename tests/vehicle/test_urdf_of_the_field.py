"""URDF, xacro and XML as public files have them: what others read loads, and what is
lost is said.

The files are our own; their structure is that of RotorS, gym-pybullet-drones, JSK's
robots, planners and arms.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

from skyarm import load_vehicle
from skyarm.control.laws.centroidal.make import make_centroidal
from skyarm.control.model import Model
from skyarm.scenario.unlikely_numbers import unlikely_in_vehicle
from skyarm.vehicle import Vehicle
from skyarm.vehicle.check import VehicleError

HULL = """<link name="hull"><inertial><mass value="0.8"/>
  <inertia ixx="0.004" iyy="0.005" izz="0.006" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>"""
BAR = """<link name="bar"><inertial><origin xyz="0 0 -0.06"/><mass value="0.2"/>
  <inertia ixx="3e-4" iyy="3e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>"""
SWING = """<joint name="swing" type="revolute"><parent link="hull"/><child link="bar"/>
  <axis xyz="0 1 0"/>
  <limit lower="-1.3" upper="1.4" effort="3" velocity="1.7"/></joint>"""


def robot(*elements: str) -> str:
    return f'<robot name="r">{"".join(elements)}</robot>'


def loaded(folder: Path, text: str, toml: str = "", suffix: str = ".urdf") -> Vehicle:
    """Vehicle of a file with a text, or of a vehicle file that names it."""
    path = folder / f"r{suffix}"
    path.write_text(text, "utf-8")
    if not toml:
        return load_vehicle(path)
    kind = "mjcf" if suffix == ".xml" else "urdf"
    (folder / "v.toml").write_text(
        f'schema = 1\nname = "v"\n{kind} = "r{suffix}"\n{toml}', "utf-8"
    )
    return load_vehicle(folder / "v.toml")


def test_a_prefix_that_nothing_declares_is_forgiven_with_a_note(tmp_path: Path) -> None:
    text = robot(HULL, BAR, SWING.replace("velocity", 'acme:jerk="4" velocity'))
    vehicle, peer = loaded(tmp_path, text), mujoco.MjModel.from_xml_string(text)
    joint = vehicle.links[0].joint
    np.testing.assert_allclose((joint.lower, joint.upper), peer.jnt_range[0])
    assert float(vehicle.mass) == pytest.approx(1.0)
    assert any("no xmlns declares: forgiven" in note for note in vehicle.notes)
    declared = text.replace("<robot", '<robot xmlns:acme="urn:acme"')
    assert not any("forgiven" in note for note in loaded(tmp_path, declared).notes)


def test_two_hyphens_in_a_comment_are_forgiven_with_a_note(tmp_path: Path) -> None:
    text = """<!-- left -- + -- right ---><mujoco><worldbody><body><freejoint/>
      <inertial pos="0 0 0" mass="0.9" diaginertia="0.006 0.007 0.011"/></body>
      </worldbody></mujoco>"""
    vehicle, peer = (
        loaded(tmp_path, text, suffix=".xml"),
        mujoco.MjModel.from_xml_string(text),
    )
    assert float(vehicle.mass) == peer.body_mass.sum()
    assert vehicle.notes == ("'--' inside a comment: forgiven",)
    plain = loaded(tmp_path, robot("<!-- a - b --><!---->", HULL))
    assert plain.notes == ()
    kept = robot('<material name="x"><![CDATA[<!-- -- -->]]></material>', HULL)
    assert loaded(tmp_path, kept).notes == ()


BOMB = "".join(f'<!ENTITY e{i + 1} "{f"&e{i};" * 10}">' for i in range(9))


@pytest.mark.parametrize(
    ("text", "error"),
    [
        (
            f'<!DOCTYPE robot [<!ENTITY e0 "lol">{BOMB}]>{robot(HULL, "&e9;")}',
            "document types and entities",
        ),
        (robot(HULL, "&other;"), "undefined entity"),
        (robot(HULL, "<link>"), "mismatched tag"),
        (robot(HULL, '<acme:link a:b="1">'), "mismatched tag"),
        (robot(HULL, '<link name="a" name="b"/>'), "duplicate attribute"),
        (robot(HULL, '<link name="<!-- -- -->"/>'), "not well-formed"),
        (robot(HULL, "<!-- -- "), "not well-formed"),
        (robot(HULL, "<!-- -->-->]]>"), "not well-formed"),
        (robot(HULL) + robot(HULL), "junk after document element"),
    ],
)
def test_every_other_error_of_xml_is_refused_in_one_line(
    tmp_path: Path, text: str, error: str
) -> None:
    with pytest.raises(VehicleError) as refused:
        loaded(tmp_path, text)
    assert error in str(refused.value)
    assert str(refused.value).endswith(": must be well-formed")
    assert "\n" not in str(refused.value)


PLACES = {"prop0_link": "0.04 -0.05 0.01", "prop1_link": "-0.04 0.05 0.01"}
PROPERTIES = robot(
    '<properties arm="0.05" kf="5e-10" km="1.2e-11" thrust2weight="2.5"/>',
    HULL,
    *(
        f"""<link name="{name}"><inertial><origin xyz="{place}"/><mass value="0.01"/>
        <inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="{name}_joint" type="fixed"><origin xyz="0 0 0.02"/>
        <parent link="hull"/><child link="{name}"/>
        </joint>"""
        for name, place in PLACES.items()
    ),
)
LAGS = "[rotor_defaults]\ntime_constant_up = 0.02\ntime_constant_down = 0.03\n"


def test_properties_give_rotors_whose_sense_the_user_states(tmp_path: Path) -> None:
    plain = loaded(tmp_path, PROPERTIES)
    (gap,) = plain.gaps
    assert (
        "direction (it stands in the program's code), time_constant_up,"
        " time_constant_down; state them" in gap
    )
    assert plain.rotors == plain.notes == ()
    senses = "".join(
        f'[[rotors]]\nname = "{name}"\ndirection = "{way}"\n'
        for name, way in zip(PLACES, ("cw", "ccw"), strict=True)
    )
    first, second = loaded(tmp_path, PROPERTIES, LAGS + senses).rotors
    assert (first.direction, second.direction) == (-1, 1)
    np.testing.assert_allclose([*map(float, first.position)], (0.04, -0.05, 0.03))
    # kf and km are torque and thrust per squared rev/min: W rad/s are 60 W / (2 pi) of
    # them BaseAviary's M, of the first link alone, and G
    thrust, speed = 2.5 * 0.8 * 9.8 / 2, float(first.max_speed)
    assert 5e-10 * (speed * 60 / (2 * math.pi)) ** 2 == pytest.approx(thrust, rel=1e-12)
    assert float(first.thrust_coefficient) * speed**2 == pytest.approx(
        thrust, rel=1e-12
    )
    assert float(first.moment_coefficient) == pytest.approx(0.024, rel=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            'kf="5e-10"',
            'kf="0"',
            (
                r"kf of <properties>: rotors\[prop0_link\].thrust_coefficient = 0.0:"
                r" must be above 0"
            ),
        ),
        (
            'kf="5e-10"',
            'kf="-1"',
            (
                r"kf of <properties>: rotors\[prop0_link\].thrust_coefficient = -91.*:"
                r" must be above"
            ),
        ),
        (
            'km="1.2e-11"',
            'km="-1"',
            (
                r"km of <properties>: rotors\[prop0_link\].moment_coefficient = -.*:"
                r" must be at"
            ),
        ),
        (
            'weight="2.5"',
            'weight="-2"',
            r"thrust2weight of <properties>: rotors\[prop0_link\].max_thrust = -7.84",
        ),
    ],
)
def test_properties_that_no_rotor_has_are_refused_beside_gaps(
    tmp_path: Path, old: str, new: str, words: str
) -> None:
    with pytest.raises(VehicleError, match=rf"^\S+: {words}") as refused:
        loaded(tmp_path, PROPERTIES.replace(old, new))
    assert "\n" not in str(refused.value)


def thruster(number: int, carrier: str, place: str, axis: int) -> str:
    return f"""<joint name="rotor{number}" type="continuous">
    <limit effort="100" lower="1" upper="9" velocity="0.5"/>
      <parent link="{carrier}"/><child link="thrust{number}"/>
      <origin xyz="{place}" rpy="0.1 0 0"/>
      <axis xyz="0 0 {axis}"/></joint><link name="thrust{number}"><inertial>
      <mass value="0.01"/>
      <inertia ixx="1e-6" iyy="1e-6" izz="2e-6" ixy="0" ixz="0" iyz="0"/></inertial>
      </link>"""


JSK = (
    '<baselink name="fc"/><thrust_link name="thrust"/><m_f_rate value="-0.015"/>',
    HULL,
    thruster(1, "hull", "0.1 -0.1 0.02", -1),
    thruster(2, "hull", "-0.1 0.1 0.02", 1),
)


def test_limits_of_a_thrust_link_are_newtons_and_its_axis_the_sense(
    tmp_path: Path,
) -> None:
    (gap,) = loaded(tmp_path, robot(*JSK)).gaps
    assert gap.startswith(
        "rotors rotor1, rotor2: the file states no max_speed, time_constant_up,"
        " time_constant_down; "
    )
    vehicle = loaded(tmp_path, robot(*JSK), f"{LAGS}max_speed = 1500.0\n")
    assert (vehicle.joint_names, vehicle.notes, vehicle.gaps) == ((), (), ())
    assert float(vehicle.mass) == pytest.approx(0.82)
    for rotor, place, turn in zip(
        vehicle.rotors, ((0.1, -0.1, 0.02), (-0.1, 0.1, 0.02)), (-1, 1), strict=True
    ):
        np.testing.assert_allclose([*map(float, rotor.position)], place, atol=1e-15)
        np.testing.assert_allclose(
            [*map(float, rotor.axis)], (0, -math.sin(0.1), math.cos(0.1)), atol=1e-15
        )
        thrust = float(rotor.thrust_coefficient) * 1500.0**2
        assert thrust == pytest.approx(9.0, rel=1e-12)
        # JSK: torque on the body = m_f_rate times z of the joint's axis, per thrust;
        # ours is against the sense
        assert -rotor.direction * float(rotor.moment_coefficient) == pytest.approx(
            -0.015 * turn
        )
        assert float(rotor.inertia) == pytest.approx(2e-6)


def test_the_cure_of_a_link_that_only_stands_in_for_a_propeller_works(
    tmp_path: Path,
) -> None:
    heavy = robot(*JSK).replace("1e-6", "1e-3").replace("2e-6", "1e-3")
    assert heavy != robot(*JSK)
    filled = f"{LAGS}max_speed = 1500.0\n"
    (line,) = (
        each
        for each in unlikely_in_vehicle(loaded(tmp_path, heavy, filled))
        if "inertia" in each
    )
    assert line.startswith(
        "rotors[rotor1].inertia = 0.001 kg m^2: with 2 rotors is more than 10% of the"
        " base's "
    )
    cured = "".join(f'[[rotors]]\nname = "rotor{k}"\ninertia = 0\n' for k in (1, 2))
    vehicle = loaded(tmp_path, heavy, filled + cured)
    assert [each.inertia for each in vehicle.rotors] == [0, 0]
    assert not [each for each in unlikely_in_vehicle(vehicle) if "inertia" in each]


def test_rotors_on_an_arm_are_gaps_that_name_the_joint(tmp_path: Path) -> None:
    vehicle = loaded(
        tmp_path, robot(*JSK, BAR, SWING, thruster(3, "bar", "0 0 -0.1", 1))
    )
    assert vehicle.joint_names == ("swing",)
    assert any(
        "rotor3: ride on a link that joint swing moves; hold it: [[joints]] name ="
        ' "swing"' in g
        for g in vehicle.gaps
    )
    assert all("yours to choose" in gap for gap in vehicle.gaps if "ride on" in gap)
    with pytest.raises(
        VehicleError, match=r"rotors\[rotor1\].max_thrust = -9.0: must be above 0"
    ):
        loaded(tmp_path, robot(*JSK).replace('upper="9"', 'upper="-9"', 1))


PLUGIN = '<gazebo><plugin name="{}" filename="{}">{}</plugin></gazebo>'
MOTOR = (
    "<jointName>rotor1</jointName><linkName>thrust1</linkName>"
    "<turningDirection>cw</turningDirection>"
)


def test_what_a_source_has_read_is_in_no_note_and_other_plugins_are_named(
    tmp_path: Path,
) -> None:
    drags = (
        "<rotorDragCoefficient>1e-4</rotorDragCoefficient>"
        "<rollingMomentCoefficient>0</rollingMomentCoefficient>"
    )
    motor = PLUGIN.format(
        "motor", "libmotor.so", f"{MOTOR}<motorConstant>1e-5</motorConstant>{drags}"
    )
    spun = thruster(1, "hull", "0 0 0", 1).replace('effort="100"', "")
    others = (
        PLUGIN.format("odometry", "libodometry.so", ""),
        '<gazebo reference="hull"><mu1>1</mu1></gazebo>',
    )
    vehicle = loaded(tmp_path, robot(HULL, spun, motor, *others))
    assert vehicle.notes == ("plugin odometry: not read", "<gazebo> (2): not read")
    assert len(vehicle.gaps) == 1


def massless(name: str, kind: str, parent: str, axis: str = "1 0 0") -> str:
    return f"""<link name="{parent}"/><joint name="to_{name}" type="{kind}">
    <parent link="{parent}"/>
      <child link="{name}"/><origin xyz="1 2 3"/><axis xyz="{axis}"/>
      <limit lower="-9" upper="9" effort="0" velocity="5"/></joint>"""


SLIDES = (
    massless("x", "prismatic", "world")
    + massless("y", "prismatic", "x")
    + massless("hull", "continuous", "y")
)


@pytest.mark.parametrize(
    "chain", [SLIDES, massless("hull", "floating", "map")], ids=["slides", "floating"]
)
def test_joints_by_which_a_file_lets_its_base_fly_are_left_out(
    tmp_path: Path, chain: str
) -> None:
    plain, vehicle = (
        loaded(tmp_path, robot(HULL, BAR, SWING)),
        loaded(tmp_path, robot(chain, HULL, BAR, SWING)),
    )
    assert (vehicle.base, vehicle.links, vehicle.frames) == (
        plain.base,
        plain.links,
        plain.frames,
    )
    (note,) = set(vehicle.notes) - set(plain.notes)
    assert note.endswith(
        "to_hull: freedom of the base, which it has here anyway; left out"
    )
    (tmp_path / "on.toml").write_text(
        'schema = 1\nname = "v"\nairframe = "hummingbird"\n[[attach]]\narm ='
        ' "r.urdf"\n',
        "utf-8",
    )
    assert load_vehicle(tmp_path / "on.toml").joint_names == ("swing",)


def test_a_chain_of_an_arm_and_a_floating_joint_inside_stay_what_they_are(
    tmp_path: Path,
) -> None:
    with pytest.raises(VehicleError, match="its root 'world' weighs nothing"):
        loaded(tmp_path, robot(massless("hull", "prismatic", "world"), HULL))
    with pytest.raises(
        VehicleError, match=r"joint\[swing\]\.type = 'floating': must be one of"
    ):
        loaded(tmp_path, robot(HULL, BAR, SWING.replace("revolute", "floating")))
    marker = (
        '<link name="mark"/><joint name="m" type="fixed"><parent link="x"/><child'
        ' link="mark"/></joint>'
    )
    with pytest.raises(VehicleError, match="weighs nothing"):
        loaded(
            tmp_path, robot(HULL, SLIDES, BAR, marker.replace("mark", "other"), SWING)
        )


SERVO = (
    '[drives.swing]\nkind = "position_servo"\nstiffness = 5.0\ndamping = 0.4\ninertia ='
    " 1e-3\n"
)


def test_a_velocity_limit_is_the_speed_limit_of_a_servo_that_states_none(
    tmp_path: Path,
) -> None:
    text = robot(HULL, BAR, SWING)
    note = (
        "joint swing: velocity limit 1.7: the speed_limit of a servo in [drives];"
        " nothing else keeps it"
    )
    assert loaded(tmp_path, text).notes == (note,)
    assert loaded(tmp_path, text, SERVO).drives[0].drive.speed_limit == 1.7
    assert (
        loaded(tmp_path, text, f"{SERVO}speed_limit = 0.9\n")
        .drives[0]
        .drive.speed_limit
        == 0.9
    )
    lagged = '[drives.swing]\nkind = "lagged_torque"\ntime_constant = 0.01\n'
    assert not hasattr(loaded(tmp_path, text, lagged).drives[0].drive, "speed_limit")
    (tmp_path / "on.toml").write_text(
        'schema = 1\nname = "v"\nairframe = "hummingbird"\n[[attach]]\narm ='
        ' "r.urdf"\nprefix = "a_"\n' + SERVO.replace("swing", "a_swing"),
        "utf-8",
    )
    assert load_vehicle(tmp_path / "on.toml").drives[0].drive.speed_limit == 1.7


def test_limits_that_are_not_kept_are_noted(tmp_path: Path) -> None:
    soft = SWING.replace(
        "</joint>",
        '<safety_controller soft_lower_limit="-1" soft_upper_limit="1"/></joint>',
    )
    notes = loaded(
        tmp_path, robot(HULL, BAR, soft.replace('effort="3"', 'effort="inf"'))
    ).notes
    assert "joint swing: soft limits of its safety_controller: not read" in notes
    assert "joint swing: of infinite effort, so without a limit of its drive" in notes
    locked = loaded(tmp_path, robot(HULL, BAR, SWING.replace("-1.3", "1.4")))
    assert (locked.joint_names, locked.notes) == (
        (),
        ("joint swing: lower equal to upper: fixed at 1.4",),
    )


FLAT = HULL.replace('izz="0.006"', 'izz="0.011"')
"""Moments x + y are less than z by 18 %; with second moments l: x = l2 + l3, y = l1 +
l3, z = l1 + l2, and l3 >= 0."""


@pytest.mark.parametrize(
    ("lower", "upper"), [("-1e16", "1e16"), ("-1.3", "1e+17"), ("-1E16", "1.4")]
)
def test_a_limit_of_ten_to_the_sixteen_is_none_as_in_gazebo(
    tmp_path: Path, lower: str, upper: str
) -> None:
    wide = SWING.replace('lower="-1.3" upper="1.4"', f'lower="{lower}" upper="{upper}"')
    joint = loaded(tmp_path, robot(HULL, BAR, wide)).links[0].joint
    assert joint.lower == (-1.3 if lower == "-1.3" else -math.inf)
    assert joint.upper == (1.4 if upper == "1.4" else math.inf)


@pytest.mark.parametrize(
    ("lower", "upper", "word"), [("inf", "inf", "lower"), ("-1e16", "-INF", "upper")]
)
def test_a_limit_that_is_endless_on_the_wrong_side_is_one_line(
    tmp_path: Path, lower: str, upper: str, word: str
) -> None:
    wrong = SWING.replace(
        'lower="-1.3" upper="1.4"', f'lower="{lower}" upper="{upper}"'
    )
    with pytest.raises(
        VehicleError,
        match=rf"joint\[swing\]\.limit\.{word} = '-?(inf|INF)': must be .* finite$",
    ):
        loaded(tmp_path, robot(HULL, BAR, wrong))


@pytest.mark.parametrize("name", ["foot", "base"])
def test_a_root_without_inertia_is_refused_with_a_cure_that_works(
    tmp_path: Path, name: str
) -> None:
    foot = f'<link name="{name}"><inertial><mass value="0.1"/>'
    foot += '<inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/>'
    arm = robot(foot + "</inertial></link>", BAR, SWING.replace('"hull"', f'"{name}"'))
    for toml in ("", "mimic = 'lock'\n"):
        with pytest.raises(
            VehicleError,
            match=(
                rf"base\.inertia = 0\.0: .* root '{name}' has no inertia, .*"
                r" \[\[attach\]\]$"
            ),
        ):
            loaded(tmp_path, arm, toml)
    mounted = (
        'schema = 1\nname = "m"\nairframe = "hummingbird"\n[[attach]]\narm = "r.urdf"\n'
    )
    (tmp_path / "on.toml").write_text(mounted, "utf-8")
    added = float(load_vehicle(tmp_path / "on.toml").mass) - float(
        load_vehicle("hummingbird").mass
    )
    assert added == pytest.approx(0.3)


def test_the_nearest_inertia_is_named_and_taken_on_request(tmp_path: Path) -> None:
    x, y, z = 0.004, 0.005, 0.011
    nearest = ((x - y + z) / 2, (y - x + z) / 2, z)
    with pytest.raises(
        VehicleError,
        match=r'of a real body is 0.005, 0.006, 0.011, 0.*inertia_repair = "nearest"',
    ):
        loaded(tmp_path, robot(FLAT))
    vehicle = loaded(tmp_path, robot(FLAT), 'inertia_repair = "nearest"\n')
    np.testing.assert_allclose(
        [*map(float, vehicle.base.inertia.entries)], (*nearest, 0, 0, 0), atol=1e-12
    )
    assert vehicle.notes[0].startswith(
        "link hull: inertia repaired: principal moments 0.004, 0.005, 0.011 -> 0.005"
    )
    with pytest.raises(
        VehicleError, match=r"inertia_repair = 'all': .*must be one of small, nearest"
    ):
        loaded(tmp_path, robot(FLAT), 'inertia_repair = "all"\n')


def test_a_massless_last_link_is_refused_with_a_cure_that_works(tmp_path: Path) -> None:
    text = robot(HULL, '<link name="bar"/>', SWING)
    with pytest.raises(VehicleError) as refused:
        loaded(tmp_path, text)
    cure = '[[joints]] name = "swing", armature = 1e-4'
    assert cure in str(refused.value)
    vehicle = loaded(tmp_path, text, cure.replace("]] ", "]]\n").replace(", ", "\n"))
    assert float(vehicle.links[0].joint.armature) == 1e-4


TOOL = (
    '<link name="tool0"/><joint name="t" type="fixed"><parent link="bar"/><child'
    ' link="tool0"/></joint>'
)


@pytest.mark.parametrize(
    ("more", "cure"),
    [
        (TOOL, '; end_effector = "tool0" in its vehicle file would be one'),
        (
            "",
            (
                '; [[frames]] name = "tip", link = "bar" and end_effector = "tip" in'
                " its vehicle file would be one"
            ),
        ),
    ],
    ids=["frame", "link"],
)
def test_the_refusal_of_a_law_proposes_an_end_effector(
    tmp_path: Path, more: str, cure: str
) -> None:
    rotors = "".join(
        f'[[rotors]]\nname = "{name}"\nposition = {place}\ndirection = "{way}"\n'
        for name, place, way in (
            ("a", "[0.2, 0.0, 0.0]", "cw"),
            ("b", "[0.0, 0.2, 0.0]", "ccw"),
            ("c", "[-0.2, 0.0, 0.0]", "cw"),
            ("d", "[0.0, -0.2, 0.0]", "ccw"),
        )
    )
    usual = (
        "[rotor_defaults]\nthrust_coefficient = 1e-5\nmoment_coefficient ="
        " 0.02\nmax_speed = 900.0\n"
    )
    vehicle = loaded(tmp_path, robot(HULL, BAR, SWING, more), usual + rotors)
    assert vehicle.tip_cure == cure
    with pytest.raises(ValueError, match="has no end_effector") as refused:
        make_centroidal(Model(vehicle=vehicle), mode="tip")
    assert str(refused.value).endswith(cure)
    tables, _, word = (
        cure.removeprefix("; ")
        .removesuffix(" in its vehicle file would be one")
        .rpartition(" and ")
    )
    lines = "\n".join(
        (word, usual, rotors, tables.replace("]] ", "]]\n").replace(", ", "\n"))
    )
    assert loaded(tmp_path, robot(HULL, BAR, SWING, more), lines).end_effector in (
        "tool0",
        "tip",
    )


MACROS = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="r">
  <xacro:include filename="$(find parts_of_ours)/parts.xacro"/>
  <xacro:hull mass="${2 * $(arg mass)}"/></robot>"""
PARTS = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:macro name="hull" params="mass">
  <link name="hull"><inertial><mass value="${mass}"/>
  <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>
  </inertial></link></xacro:macro></robot>"""


@pytest.fixture
def macros(tmp_path: Path) -> Path:
    """Folder of a xacro file whose parts lie in a package beside its own."""
    for package in ("parts_of_ours", "robot_of_ours"):
        (tmp_path / package).mkdir()
        (tmp_path / package / "package.xml").write_text(
            f"<package><name>{package}</name></package>", "utf-8"
        )
    (tmp_path / "parts_of_ours" / "parts.xacro").write_text(PARTS, "utf-8")
    folder = tmp_path / "robot_of_ours" / "urdf"
    folder.mkdir()
    return folder


def test_a_xacro_file_is_expanded_with_its_arguments(macros: Path) -> None:
    pytest.importorskip("xacrodoc", reason="needs the extra 'xacro'")
    vehicle = loaded(macros, MACROS, "[xacro]\nmass = 0.35\n", suffix=".urdf.xacro")
    assert float(vehicle.mass) == pytest.approx(0.7)
    (macros / "on.toml").write_text(
        'schema = 1\nname = "v"\nairframe = "hummingbird"\n[[attach]]\narm ='
        ' "r.urdf.xacro"\nxacro = {mass = 0.1}\n',
        "utf-8",
    )
    carried = load_vehicle(macros / "on.toml")
    assert float(carried.mass) - float(
        load_vehicle("hummingbird").mass
    ) == pytest.approx(0.2)
    whole = loaded(
        macros,
        MACROS.replace('name="r">', 'name="r"><xacro:arg name="mass" default="0.5"/>'),
        suffix=".xacro",
    )
    assert float(whole.mass) == pytest.approx(1.0)
    for text, error in (
        (MACROS, "arguments mass are missing"),
        (
            MACROS.replace("parts_of_ours", "parts_of_nobody"),
            "Package not found: parts_of_nobody",
        ),
        (MACROS.replace("parts.xacro", "none.xacro"), "No such file"),
        (MACROS.replace("2 * $(arg mass)", "2 +* 1"), "invalid syntax"),
        (MACROS.replace("</robot>", ""), "no element found"),
    ):
        with pytest.raises(VehicleError) as refused:
            loaded(macros, text, suffix=".xacro")
        assert error in str(refused.value)
        assert "\n" not in str(refused.value)
    cure = str(refused.value).partition("its arguments: ")[2]
    whole, table = cure.split(" and in the table ")
    assert (whole, table) == (
        'schema = 1, name = "v", urdf = "r.xacro"',
        "[xacro] NAME = VALUE",
    )
    (macros / "r.xacro").write_text(MACROS, "utf-8")
    (macros / "w.toml").write_text(
        f"{whole}, {table}".replace(", ", "\n").replace(
            "] NAME = VALUE", "]\nmass = 0.9"
        )
    )
    assert float(load_vehicle(macros / "w.toml").mass) == pytest.approx(1.8)


def test_an_argument_that_a_xacro_file_does_not_have_is_refused(macros: Path) -> None:
    """Also where the right one has a default, and in the table of an arm that is
    attached.
    """
    pytest.importorskip("xacrodoc", reason="needs the extra 'xacro'")
    text = MACROS.replace(
        'name="r">', 'name="r"><xacro:arg name="mass" default="0.5"/>'
    )
    with pytest.raises(
        VehicleError,
        match=r"xacro\.mas = '0\.35': is of no effect: did you mean 'mass'\?",
    ):
        loaded(macros, text, "[xacro]\nmas = 0.35\n", suffix=".urdf.xacro")
    (macros / "on.toml").write_text(
        'schema = 1\nname = "v"\nairframe = "hummingbird"\n[[attach]]\narm ='
        ' "r.urdf.xacro"\nxacro = {maas = 0.1}\n',
        "utf-8",
    )
    with pytest.raises(VehicleError, match=r"xacro\.maas = '0\.1': is of no effect"):
        load_vehicle(macros / "on.toml")


def test_all_missing_arguments_of_a_xacro_file_stand_in_one_line(macros: Path) -> None:
    """Also those that stand behind the first one, in names of files and in
    expressions.
    """
    pytest.importorskip("xacrodoc", reason="needs the extra 'xacro'")
    more = (
        '<link name="$(arg prefix)_tip"/><joint name="j" type="fixed"><parent'
        ' link="$(arg hull)"/>'
    )
    more += '<child link="$(arg prefix)_tip"/></joint></robot>'
    text = MACROS.replace(
        'name="r">', 'name="r"><xacro:arg name="hull" default="hull"/>'
    ).replace("</robot>", more)
    with pytest.raises(VehicleError) as refused:
        loaded(macros, text, suffix=".xacro")
    said = str(refused.value)
    assert "xacro: arguments mass, prefix are missing: must expand; " in said
    assert said.endswith("in the table [xacro] mass = VALUE, prefix = VALUE")
    vehicle = loaded(
        macros, text, "[xacro]\nmass = 0.35\nprefix = 'left'\n", suffix=".urdf.xacro"
    )
    assert [each.name for each in vehicle.frames] == ["left_tip"]


def test_a_package_is_found_by_the_name_it_states(macros: Path) -> None:
    """ROS finds packages by <name>: a repository's folder is often called otherwise."""
    pytest.importorskip("xacrodoc", reason="needs the extra 'xacro'")
    (macros.parents[1] / "parts_of_ours").rename(macros.parents[1] / "Parts-main")
    assert float(
        loaded(macros, MACROS, "[xacro]\nmass = 0.35\n", suffix=".urdf.xacro").mass
    ) == pytest.approx(0.7)


def test_without_the_package_one_line_names_the_extra(
    macros: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "xacro", None)
    with pytest.raises(
        VehicleError,
        match=r"r\.xacro: xacro: is missing; a \.xacro file needs the extra 'xacro': ",
    ):
        loaded(macros, MACROS, suffix=".xacro")
