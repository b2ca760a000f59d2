"""Rotors of LiftDrag blades in SDF files: their direction by the lift that gz-sim
computes, and what is left open.
"""

import re

import numpy as np
import pytest

from skyarm.vehicle import VehicleError
from skyarm.vehicle.own_file import own_vehicle_file
from skyarm.vehicle.sdf import read_sdf
from skyarm.vehicle.vehicle_files import load_vehicle

MASS = (
    "<inertial><mass>1</mass><inertia><ixx>0.01</ixx><iyy>0.01</iyy><izz>0.01</izz>"
    "</inertia></inertial>"
)
LIFTING = "gz::sim::systems::LiftDrag"


def blade(cp, forward, upward, link="propeller"):
    words = (
        f"<cp>{cp}</cp><forward>{forward}</forward><upward>{upward}</upward>"
        f"<link_name>{link}</link_name>"
    )
    return (
        f'<plugin name="{LIFTING}"'
        f' filename="l"><a0>0.3</a0><cla>4.25</cla>{words}</plugin>'
    )


def craft(pose, axis, blades, control, upward="0 0 1"):
    """A wing with a propeller of two blades and, where control has text, ArduPilot's
    plugin that turns its joint.
    """
    turned = (
        f"<control><jointName>spin</jointName>{control}</control>" if control else ""
    )
    return (
        f'<model name="m"><link name="wing">{MASS}</link><link'
        f' name="propeller"><pose>{pose}</pose>{MASS}</link>'
        '<joint name="spin"'
        ' type="revolute"><parent>wing</parent><child>propeller</child>'
        f"<axis><xyz>{axis}</xyz></axis>"
        f"</joint>{''.join(blade(*each, upward) for each in blades)}"
        f'<plugin name="ArduPilotPlugin" filename="a">{turned}</plugin></model>'
    )


def saved(folder, text, name="v.sdf"):
    (folder / name).write_text(
        text if name != "v.sdf" else f'<sdf version="1.7">{text}</sdf>'
    )
    return folder / name


X_BLADES = [("0.074 0 0", "0 1 0"), ("-0.074 0 0", "0 -1 0")]
CRAFTS = {
    "zephyr": (
        (
            "0 0.07 0.008 0 1.5708 0",
            "0 -1 0",
            [("0 0 0.074", "-1 0 0"), ("0 0 -0.074", "1 0 0")],
        ),
        ("<multiplier>838</multiplier>", "0 -1 0"),
        (0, -1, 0),
    ),
    "alti_transition_quad, behind": (
        ("-0.46 0 -0.014 0 -1.5708 0", "0 0 1", X_BLADES),
        ("<multiplier>-1500</multiplier>", "0 0 1"),
        (0, 0, -1),
    ),
    "alti_transition_quad, of a sense": (
        ("-0.46 0 -0.014 0 -1.5708 0", "0 0 1", X_BLADES),
        ("<turningDirection>cw</turningDirection>", "0 0 1"),
        (0, 0, -1),
    ),
    "alti_transition_quad, left": (
        ("0.4 0.43 -0.04 0.052 0 0", "0 0 1", X_BLADES),
        ("<multiplier>1500</multiplier>", "0 0 1"),
        (0, 0, 1),
    ),
    "blades that point down": (
        ("0 0 0 0 0 0", "0 0 -2", X_BLADES),
        ("<multiplier>-9</multiplier>", "0 0 -3"),
        (0, 0, -1),
    ),
}


def lift(cp, forward, upward, turning):
    """Lift at rest, of a0 0.3 and cla 4.25, in axes of the link: LiftDrag.cc of gz-sim,
    from vel to cl * q * liftI.
    """
    vel = np.cross(turning, cp)
    spanwise = np.cross(forward, upward) / np.linalg.norm(np.cross(forward, upward))
    in_plane = vel - vel @ spanwise * spanwise
    along = np.cross(spanwise, in_plane) / np.linalg.norm(in_plane)
    angle = np.arccos(np.clip(along @ upward / np.linalg.norm(upward), -1.0, 1.0))
    alpha = 0.3 + (angle if along @ np.array(forward) >= 0.0 else -angle)
    while abs(alpha) > np.pi / 2:
        alpha -= np.pi * np.sign(alpha)
    return 4.25 * alpha * (in_plane @ in_plane) * along


@pytest.mark.parametrize("nested", [False, True])
@pytest.mark.parametrize("name", CRAFTS)
def test_blades_push_to_the_side_of_their_lift_as_their_joint_is_turned(
    tmp_path, name, nested
):
    """Poses, axes, blades and multipliers of ArduPilot's ardupilot_gazebo and
    SITL_Models.
    """
    (pose, axis, blades), (control, upward), right = CRAFTS[name]
    text = craft(pose, axis, blades, control, upward)
    (rotor,) = read_sdf(
        saved(tmp_path, f'<model name="outer">{text}</model>' if nested else text)
    ).rotors
    words = re.sub("<.*?>", "", control).replace("cw", "-1")
    turning = np.array(axis.split(), float) * float(words)
    total = sum(
        lift(*(np.array(each.split(), float) for each in (*two, upward)), turning)
        for two in blades
    )
    np.testing.assert_allclose(
        [*rotor.axis], total / np.linalg.norm(total), rtol=0, atol=1e-15
    )
    assert [*rotor.axis] == [*right]


def test_a_pusher_behind_the_wing_pushes_forward(tmp_path):
    """The motor_f of alti_transition_quad: its model has x forward, and its link stands
    on its pitch of -pi/2.
    """
    (pose, axis, blades), (control, upward), _ = CRAFTS["alti_transition_quad, behind"]
    saved(tmp_path, craft(pose, axis, blades, control, upward))
    numbers = (
        "thrust_coefficient = 1e-5\nmoment_coefficient = 0.02\nmax_speed ="
        " 900.0\ntime_constant_up = 0.01\n"
    )
    numbers += (
        'time_constant_down = 0.02\n[[rotors]]\nname = "propeller"\ndirection = "cw"\n'
    )
    toml = saved(
        tmp_path,
        f'schema = 1\nname = "t"\nsdf = "v.sdf"\n[rotor_defaults]\n{numbers}',
        "v.toml",
    )
    assert [*load_vehicle(toml).rotors[0].axis] == pytest.approx([1, 0, 0], abs=1e-5)


def test_blades_that_no_plugin_turns_push_upward(tmp_path):
    """A blade is made to move forward; LiftDrag.cc then lifts along <upward>."""
    pose, axis, blades = CRAFTS["zephyr"][0]
    (rotor,) = read_sdf(saved(tmp_path, craft(pose, axis, blades, "", "0 -1 0"))).rotors
    assert [*rotor.axis] == [0, -1, 0]


@pytest.mark.parametrize("case", ["across", "both sides"])
def test_lift_across_the_joint_leaves_the_direction_of_a_rotor_open(tmp_path, case):
    pose, axis, blades = CRAFTS["zephyr"][0]
    if case == "both sides":
        blades = [blades[0], (blades[0][0], "1 0 0")]
    upward = "0 1 0" if case == "both sides" else "0 -1 0.1"
    path = saved(
        tmp_path, craft(pose, axis, blades, "<multiplier>838</multiplier>", upward)
    )
    (gap,) = load_vehicle(path).gaps
    assert (
        "axis (<upward> of its LiftDrag plugins is not along the joint, or to both"
        " sides)" in gap
    )
    with pytest.raises(
        VehicleError,
        match=(
            r"--from = .*: must state the direction of each thrust; it lacks axis \(<"
        ),
    ):
        own_vehicle_file(str(path), "mine")
    rest = "".join(
        f"{word} = 0.02\n"
        for word in ("thrust_coefficient", "moment_coefficient", "max_speed")
    )
    rest += "time_constant_up = 0.02\ntime_constant_down = 0.02\n"
    own = '[[rotors]]\nname = "propeller"\ndirection = "cw"\n'
    head = f'schema = 1\nname = "t"\nsdf = "v.sdf"\n[rotor_defaults]\n{rest}{own}'
    with pytest.raises(
        VehicleError, match=r"rotors propeller: the file states no axis \("
    ):
        load_vehicle(saved(tmp_path, head, "v.toml"))
    whole = load_vehicle(saved(tmp_path, f"{head}axis = [0.0, -1.0, 0.0]\n", "w.toml"))
    assert [*whole.rotors[0].axis] == [0, -1, 0]


def test_lift_of_a_wing_is_noted_and_that_of_a_propeller_is_its_rotors(tmp_path):
    (pose, axis, blades), (control, upward), _ = CRAFTS["zephyr"]
    text = craft(pose, axis, blades, control, upward)
    wing = blade("0 -0.1 0", "0 -1 0", "0 0 1", "wing").replace(LIFTING, "Wing")
    vehicle = load_vehicle(saved(tmp_path, text.replace("</model>", f"{wing}</model>")))
    assert [each for each in vehicle.notes if "plugin" in each] == [
        "plugins ArduPilotPlugin, Wing: not read"
    ]
