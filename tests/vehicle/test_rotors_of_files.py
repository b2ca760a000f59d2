"""Rotors that the file of the bodies states, completed by a vehicle file; joints held;
against MuJoCo and by hand.
"""

from __future__ import annotations

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

from skyarm.algebra import Mat3
from skyarm.dynamics import mass_matrix
from skyarm.vehicle import VehicleError, vehicle_tables
from skyarm.vehicle.held_joints import hold_joints
from skyarm.vehicle.stated_rotors import NEEDED
from skyarm.vehicle.urdf import read_urdf, urdf_vehicle
from skyarm.vehicle.vehicle_files import load_vehicle
from support.cases import joint, limits, link, robot, saved

WORDS = {
    "direction": "<turningDirection>{sense}</turningDirection>",
    "thrust_coefficient": "<motorConstant>1.3e-05</motorConstant>",
    "moment_coefficient": "<momentConstant>0.017</momentConstant>",
    "max_speed": "<maxRotVelocity>810</maxRotVelocity>",
    "time_constant_up": "<timeConstantUp>0.014</timeConstantUp>",
    "time_constant_down": "<timeConstantDown>0.031</timeConstantDown>",
}
PLACES = {
    "fl": (0.2, 0.15, 0.03),
    "bl": (-0.2, 0.15, 0.03),
    "br": (-0.2, -0.15, 0.03),
    "fr": (0.2, -0.15, 0.03),
}
STATED = {
    "direction": '"cw"',
    "thrust_coefficient": "1.3e-05",
    "moment_coefficient": "0.017",
    "max_speed": "810.0",
    "time_constant_up": "0.014",
    "time_constant_down": "0.031",
}
TOML = 'schema = 1\nname = "v"\nurdf = "r.urdf"\n'


def spinner(name, place, roll=0.0, carrier="hull"):
    """A rotor link of 12 g on a continuous joint, its body turned about x."""
    return (
        f'<link name="{name}"><inertial><origin xyz="0.001 0 0.002" rpy="{roll} 0'
        ' 0"/><mass value="0.012"/><inertia ixx="2e-6" iyy="5e-5" izz="5.1e-5" ixy="0"'
        f' ixz="0" iyz="0"/></inertial></link><joint name="{name}_joint"'
        f' type="continuous"><parent link="{carrier}"/><child link="{name}"/><origin'
        f' xyz="{" ".join(map(str, place))}"/><axis xyz="0 0 1"/></joint>'
    )


def plugin(name, number, without=()):
    words = "".join(text for word, text in WORDS.items() if word not in without)
    return (
        f'<gazebo><plugin name="motor_{name}"'
        f' filename="m.so"><jointName>{name}_joint</jointName>'
        f"<linkName>{name}</linkName><motorNumber>{number}</motorNumber>"
        f"{words.format(sense='cw' if number % 2 else 'ccw')}"
        "<rollingMomentCoefficient>1.5e-06</rollingMomentCoefficient><rotorDragCoefficient>8e-05</rotorDragCoefficient>"
        "</plugin></gazebo>"
    )


def quad(without=(), plugins=True, more=(), roll=0.0):
    """A quadrotor of four rotor links, with an arm of one joint; plugins stand in
    another order than their numbers.
    """
    parts = [
        link("hull", mass=1.4),
        *(spinner(name, place, roll) for name, place in PLACES.items()),
    ]
    parts += [link("upper", mass=0.2), joint("shoulder", "hull", "upper", limits())]
    if plugins:
        parts += [
            plugin(name, k, without) for k, name in reversed(list(enumerate(PLACES)))
        ]
    return robot(*parts, *more)


def mujoco_matrix(text, values, fixed=()):
    """M(q) by MuJoCo for [v, w, joints that are not fixed], and its data; values by
    joint name.
    """
    spec = mujoco.MjSpec.from_string(text)
    for geom in spec.geoms:
        spec.delete(geom)
    spec.compiler.fusestatic = False
    spec.worldbody.bodies[0].add_freejoint()
    model = spec.compile()
    data = mujoco.MjData(model)
    for name, value in values.items():
        data.joint(name).qpos[:] = value
    mujoco.mj_fwdPosition(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    gone = {int(model.joint(name).dofadr[0]) for name in fixed}
    stays = [k for k in range(model.nv) if k not in gone]
    return M[np.ix_(stays, stays)], data


def our_matrix(vehicle, joints):
    return np.array(mass_matrix(vehicle, Mat3.identity(), joints), float)


def loaded(tmp_path, text, tables=""):
    saved(tmp_path, text)
    return load_vehicle(saved(tmp_path, TOML + tables, "v.toml"))


def test_motor_models_give_the_rotors(tmp_path):
    vehicle = load_vehicle(saved(tmp_path, quad()))
    assert [each.name for each in vehicle.rotors] == list(PLACES)
    for k, each in enumerate(vehicle.rotors):
        # Gazebo pushes at the centre of mass of the link
        pushed = np.add(PLACES[each.name], (0.001, 0.0, 0.002))
        assert list(each.position) == pytest.approx(pushed, abs=1e-15)
        assert (each.direction, each.thrust_coefficient, each.moment_coefficient) == (
            (1, -1)[k % 2],
            1.3e-05,
            0.017,
        )
        assert (each.time_constant_up, each.time_constant_down, each.max_speed) == (
            0.014,
            0.031,
            810,
        )
        assert (each.drag_coefficient, each.rolling_moment_coefficient) == (
            8e-05,
            1.5e-06,
        )
    assert vehicle.joint_names == ("shoulder",)
    assert not vehicle.gaps
    assert (
        dict(vehicle.sources)["rotors.max_speed"]
        == "maxRotVelocity of the motor-model plugins"
    )


def test_what_spins_joins_the_base(tmp_path):
    vehicle = load_vehicle(saved(tmp_path, quad()))
    theirs, _ = mujoco_matrix(
        quad(), {"shoulder": 0.4}, [f"{name}_joint" for name in PLACES]
    )
    assert our_matrix(vehicle, [0.4]) == pytest.approx(theirs, rel=1e-12, abs=1e-14)


@pytest.mark.parametrize(
    ("roll", "about_the_axis"), [(0.0, 5.1e-5), (1.5707963267948966, 5e-5)]
)
@pytest.mark.parametrize(
    ("word", "slower"),
    [("", 10.0), ("<rotorVelocitySlowdownSim>4</rotorVelocitySlowdownSim>", 4)],
)
def test_spin_inertia_is_that_about_the_axis(
    tmp_path, roll, about_the_axis, word, slower
):
    """By the momentum in the simulation: its joint turns at the rotor's speed over the
    slowdown, 10 by default.
    """
    vehicle = load_vehicle(
        saved(
            tmp_path,
            quad(roll=roll).replace("<momentConstant>", f"{word}<momentConstant>"),
        )
    )
    momentum = about_the_axis * (600.0 / slower)
    assert [float(each.inertia) * 600.0 for each in vehicle.rotors] == pytest.approx(
        [momentum] * 4, rel=1e-12
    )
    assert (
        f"rotorVelocitySlowdownSim = {slower:g}"
        in dict(vehicle.sources)["rotors.inertia"]
    )


@pytest.mark.parametrize("slower", ["0", "-10", "nan"])
def test_a_slowdown_of_a_motor_model_is_above_zero(tmp_path, slower):
    word = (
        f"<rotorVelocitySlowdownSim>{slower}</rotorVelocitySlowdownSim><momentConstant>"
    )
    with pytest.raises(
        VehicleError,
        match=r"rotorVelocitySlowdownSim = .*: must be (above 0|a finite number)",
    ):
        load_vehicle(saved(tmp_path, quad().replace("<momentConstant>", word)))


def test_what_a_motor_model_leaves_to_its_simulator_is_noted(tmp_path):
    """Defaults of RotorS' gazebo_motor_model.h and gz-sim's
    MulticopterMotorModel.cc.
    """
    text = re.sub(
        "<r(oll|otorD)[^/]*/[^>]*>",
        "",
        quad().replace("<rollingMomentCoefficient>1.5e-06", "<rolled>", 1),
    )
    vehicle = load_vehicle(saved(tmp_path, text))
    drags = {
        (each.drag_coefficient, each.rolling_moment_coefficient)
        for each in vehicle.rotors
    }
    assert drags == {(1e-4, 1e-6)}
    (note,) = (each for each in vehicle.notes if "states no" in each)
    words = (
        "rotorDragCoefficient (0.0001), rollingMomentCoefficient (1e-06): the default"
        " of its plugin flies"
    )
    assert note == f"rotors fl, bl, br, fr: the file states no {words}"


@pytest.mark.parametrize(
    ("name", "signs"),
    [
        ("libgazebo_motor_model.so", [1, -1] * 2),
        ("librotors_gazebo_motor_model.so", [1] * 4),
    ],
)
def test_the_rolling_moment_has_the_sign_of_the_plugin(tmp_path, name, signs):
    """PX4's Gazebo classic multiplies by turning_direction_, RotorS and gz-sim do
    not.
    """
    vehicle = load_vehicle(saved(tmp_path, quad().replace("m.so", name)))
    assert [float(each.rolling_moment) for each in vehicle.rotors] == [
        1.5e-06 * sign for sign in signs
    ]


WRONG = {
    "motorConstant": ("1.3e-05", ("0", "-2", "1e-400"), "thrust_coefficient"),
    "momentConstant": ("0.017", ("-0.1",), "moment_coefficient"),
    "maxRotVelocity": ("810", ("0", "-810"), "max_speed"),
    "timeConstantDown": ("0.031", ("0", "-1"), "time_constant_down"),
    "rollingMomentCoefficient": ("1.5e-06", ("-1",), "rolling_moment_coefficient"),
}


@pytest.mark.parametrize("word", WRONG)
def test_a_wrong_number_is_refused_although_others_are_missing(tmp_path, word):
    right, values, field = WRONG[word]
    for value in values:
        path = saved(
            tmp_path,
            quad(["direction"]).replace(f"<{word}>{right}<", f"<{word}>{value}<", 1),
        )
        with pytest.raises(VehicleError) as error:
            load_vehicle(path)
        begin = (
            f"{path}: {word} of the motor-model plugins: rotors[fr].{field} ="
            f" {float(value)}: must be "
        )
        assert str(error.value).startswith(begin)
        assert "\n" not in str(error.value)


def test_a_table_of_the_user_takes_the_place_of_a_wrong_number(tmp_path):
    text = quad().replace("<motorConstant>1.3e-05<", "<motorConstant>0<")
    tables = "".join(
        f'[[rotors]]\nname = "{name}"\nthrust_coefficient = 2e-5\n' for name in PLACES
    )
    assert {
        each.thrust_coefficient for each in loaded(tmp_path, text, tables).rotors
    } == {2e-5}


def test_a_plugin_names_a_joint_that_is_there(tmp_path):
    path = saved(
        tmp_path, quad().replace("<jointName>bl_joint<", "<jointName>bl_hinge<")
    )
    with pytest.raises(
        VehicleError,
        match=(
            "jointName = 'bl_hinge': must be a joint of the file: fl_joint, bl_joint,"
        ),
    ):
        load_vehicle(path)


def test_a_motor_model_of_positions_is_a_servo_and_no_rotor(tmp_path):
    """RotorS's motors of the type position turn the arms of its omav: the rotors ride
    on them.
    """
    servo = spinner("boom", (0.1, 0.0, 0.0)) + plugin("boom", 4).replace(
        "<motorConstant>", "<motorType>position</motorType><motorConstant>"
    )
    held = '[[joints]]\nname = "boom_joint"\nhold = 0.0\n'
    vehicle = loaded(tmp_path, quad(more=(servo,)), held)
    assert [each.name for each in vehicle.rotors] == list(PLACES)
    assert "plugin motor_boom: not read" in vehicle.notes
    assert load_vehicle(tmp_path / "r.urdf").joint_names == ("shoulder", "boom_joint")


@pytest.mark.parametrize("word", NEEDED)
def test_what_the_file_lacks_is_a_gap(tmp_path, word):
    vehicle = load_vehicle(saved(tmp_path, quad([word])))
    assert vehicle.rotors == ()
    (gap,) = vehicle.gaps
    assert gap.startswith("rotors fl, bl, br, fr: the file states no " + word + "; ")
    assert vehicle.joint_names == ("shoulder",)


@pytest.mark.parametrize("word", NEEDED)
def test_a_gap_is_filled_from_the_tables(tmp_path, word):
    entries = "".join(
        f'[[rotors]]\nname = "{name}"\n{word} = {STATED[word]}\n' for name in PLACES
    )
    vehicle = loaded(tmp_path, quad([word]), entries)
    assert {getattr(each, word) for each in vehicle.rotors} == (
        {-1} if word == "direction" else {float(STATED[word])}
    )
    whole = load_vehicle(saved(tmp_path, quad(), "whole.urdf"))
    assert [each.position for each in vehicle.rotors] == [
        each.position for each in whole.rotors
    ]
    with pytest.raises(
        VehicleError, match=f"rotors bl, br, fr: the file states no {word}"
    ):
        loaded(tmp_path, quad([word]), entries[: entries.index("[[rotors]]", 1)])


def test_defaults_fill_all_rotors_and_yield_to_the_file(tmp_path):
    vehicle = loaded(
        tmp_path,
        quad(["max_speed"]),
        "[rotor_defaults]\nmax_speed = 700.0\nmoment_coefficient = 0.5\n",
    )
    assert {(each.max_speed, each.moment_coefficient) for each in vehicle.rotors} == {
        (700.0, 0.017)
    }


def test_the_tables_overrule_the_file(tmp_path):
    vehicle = loaded(
        tmp_path,
        quad(),
        '[[rotors]]\nname = "bl"\nmoment_coefficient = 0.02\nposition = [0.0, 0.01,'
        " 0.0]\n",
    )
    assert [each.moment_coefficient for each in vehicle.rotors] == [
        0.017,
        0.02,
        0.017,
        0.017,
    ]
    # of the base, as no link is named
    assert list(vehicle.rotors[1].position) == [0.0, 0.01, 0.0]


def test_rotors_of_other_names_stand_in_place_of_the_files(tmp_path):
    own = '[[rotors]]\nname = "lift"\nposition = [0, 0, 0.1]\ndirection = "cw"\n'
    own += "thrust_coefficient = 1e-4\nmoment_coefficient = 0.1\n"
    vehicle = loaded(tmp_path, quad(), own)
    assert [each.name for each in vehicle.rotors] == ["lift"]
    assert any(
        note.startswith("rotors fl, bl, br, fr of the file: left out")
        for note in vehicle.notes
    )
    assert vehicle.joint_names == ("shoulder",)
    with pytest.raises(
        VehicleError,
        match=r"rotors.name = 'lift': must be one of fl, bl, br, fr, or none",
    ):
        loaded(tmp_path, quad(), own + '[[rotors]]\nname = "bl"\n')


@pytest.mark.parametrize(
    ("without", "table", "name", "value"),
    [
        ("max_speed", "max_thrust = 5.2", "max_speed", (5.2 / 1.3e-05) ** 0.5),
        (
            "thrust_coefficient",
            "max_thrust = 8.1",
            "thrust_coefficient",
            8.1 / 810.0**2,
        ),
    ],
)
def test_the_largest_thrust_gives_what_is_missing(
    tmp_path, without, table, name, value
):
    vehicle = loaded(tmp_path, quad([without]), f"[rotor_defaults]\n{table}\n")
    assert [getattr(each, name) for each in vehicle.rotors] == pytest.approx(
        [value] * 4, rel=1e-14
    )


def test_the_largest_thrust_alone_is_one_gap(tmp_path):
    with pytest.raises(VehicleError, match="states no max_speed;"):
        loaded(
            tmp_path,
            quad(["max_speed", "thrust_coefficient"]),
            "[rotor_defaults]\nmax_thrust = 5.0\n",
        )


def test_a_named_link_gives_place_and_axis(tmp_path):
    leaning = (
        '<link name="seat"/><joint name="s" type="fixed"><parent link="hull"/><child'
        ' link="seat"/>'
    )
    leaning += '<origin xyz="0 0 0.2" rpy="0.5 0 0"/></joint>' + spinner(
        "lift", (0, 0.1, 0), carrier="seat"
    )
    text = quad(plugins=False, more=(leaning,))
    numbers = (
        'direction = "ccw"\nthrust_coefficient = 1e-5\nmoment_coefficient = 0.02\n'
    )
    vehicle = loaded(
        tmp_path, text, f'[[rotors]]\nname = "lift"\nlink = "lift"\n{numbers}'
    )
    _, data = mujoco_matrix(text, {})
    assert list(vehicle.rotors[0].position) == pytest.approx(
        data.body("lift").xpos, abs=1e-15
    )
    assert list(vehicle.rotors[0].axis) == pytest.approx(
        data.body("lift").xmat.reshape(3, 3)[:, 2], abs=1e-15
    )
    assert vehicle.joint_names == (*(f"{name}_joint" for name in PLACES), "shoulder")


def test_a_rotor_on_a_link_that_moves_names_the_joint(tmp_path):
    riding = spinner("lift", (0, 0, 0.1), carrier="upper") + plugin("lift", 4)
    vehicle = load_vehicle(saved(tmp_path, quad(more=(riding,))))
    (gap,) = vehicle.gaps
    assert gap.startswith(
        "rotors lift: ride on a link that joint shoulder moves; hold it: [[joints]]"
        ' name = "shoulder"'
    )
    held = loaded(
        tmp_path, quad(more=(riding,)), '[[joints]]\nname = "shoulder"\nhold = 0.4\n'
    )
    _, data = mujoco_matrix(quad(more=(riding,)), {"shoulder": 0.4})
    (lift,) = (each for each in held.rotors if each.name == "lift")
    assert list(lift.position) == pytest.approx(data.body("lift").xipos, abs=1e-15)
    assert list(lift.axis) == pytest.approx(
        data.body("lift").xmat.reshape(3, 3)[:, 2], abs=1e-15
    )


@pytest.mark.parametrize(
    ("again", "words"),
    [
        (plugin("fl", 7), r"rotors.name = 'fl': stands at two rotors; must be at one"),
        (
            plugin("fl", 7).replace("<linkName>fl", "<linkName>upper"),
            r"rotors.joint = 'fl_joint': stands at two rotors",
        ),
    ],
)
def test_a_rotor_stands_once(tmp_path, again, words):
    with pytest.raises(VehicleError, match=words):
        load_vehicle(saved(tmp_path, quad(more=(again,))))


@pytest.mark.parametrize("prefix", ["", "left_"])
def test_an_arm_that_has_rotors_loses_them_with_a_note(tmp_path, prefix):
    arm = robot(
        link("mount"), spinner("fan", (0, 0, 0.1), carrier="mount"), plugin("fan", 0)
    )
    saved(tmp_path, arm.replace('name="test"', 'name="fans"'), "arm.urdf")
    table = (
        f'[[attach]]\narm = "arm.urdf"\nprefix = "{prefix}"\nposition = [0.1, 0,'
        " -0.2]\n"
    )
    vehicle = loaded(tmp_path, quad(), table)
    assert vehicle.joint_names == ("shoulder",)
    assert [each.name for each in vehicle.rotors] == list(PLACES)
    assert any(
        "rotors fan: left out; those of the airframe fly" in note
        for note in vehicle.notes
    )
    assert f"{prefix}fan" in [each.name for each in vehicle.frames]
    assert float(vehicle.mass) == pytest.approx(
        1.4 + 4 * 0.012 + 0.2 + 0.5 + 0.012, rel=1e-14
    )


def test_numbers_that_must_be_stated_have_no_default(tmp_path):
    own = 'schema = 1\nname = "v"\n[base]\nmass = 1.0\ninertia = [0.01, 0.01, 0.02]\n'
    own += "[rotor_defaults]\nall_stated = true\n"
    own += (
        "thrust_coefficient = 1e-5\nmoment_coefficient = 0.02\ntime_constant_up ="
        " 0.02\n"
    )
    own += '[[rotors]]\nname = "a"\nposition = [0.1, 0, 0]\ndirection = "cw"\n'
    with pytest.raises(
        VehicleError,
        match="rotors a: the file states no max_speed, time_constant_down; state them",
    ):
        load_vehicle(saved(tmp_path, own, "o.toml"))
    whole = own.replace(
        "time_constant_up",
        "max_speed = 900.0\ntime_constant_down = 0.03\ntime_constant_up",
    )
    assert load_vehicle(saved(tmp_path, whole, "w.toml")).rotors[0].max_speed == 900.0


def test_a_vehicle_of_too_many_joints_is_refused_unless_some_are_held(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(vehicle_tables, "MOST_JOINTS", 2)
    with pytest.raises(
        VehicleError,
        match=(
            "number of joints = 3: must be at most 2, for its mass matrix takes minutes"
        ),
    ):
        loaded(tmp_path, CHAIN)
    held = '[[joints]]\nname = "jb"\nhold = 0.1\n'
    assert loaded(tmp_path, CHAIN, held).joint_names == ("ja", "jc")


CHAIN = robot(
    link("hull", mass=1.0),
    link("a", mass=0.3),
    link("b", mass=0.2),
    link("c", mass=0.1),
    joint("ja", "hull", "a", limits()),
    joint("jb", "a", "b", limits()),
    joint("jc", "b", "c", limits(), "prismatic"),
)


@pytest.mark.parametrize(
    "held", [{"ja": 0.3}, {"jb": -0.6}, {"jc": 0.25}, {"ja": 0.2, "jc": -0.1}]
)
def test_a_held_joint_leaves_the_mass_matrix_of_the_others(tmp_path, held):
    free = {"ja": 0.5, "jb": -0.4, "jc": 0.2}
    theirs, data = mujoco_matrix(CHAIN, free | held, held)
    vehicle = urdf_vehicle(hold_joints(read_urdf(Path(saved(tmp_path, CHAIN))), held))
    moving = [free[name] for name in vehicle.joint_names]
    assert set(vehicle.joint_names) == set(free) - set(held)
    assert our_matrix(vehicle, moving) == pytest.approx(theirs, rel=1e-11, abs=1e-13)
    frames = {each.name: each for each in vehicle.frames if each.link == -1}
    for name, each in frames.items():
        assert list(each.position) == pytest.approx(data.body(name).xpos, abs=1e-14)


def test_followers_of_a_held_joint_stand_where_it_puts_them(tmp_path):
    text = CHAIN.replace(
        '<joint name="jb" type="revolute">',
        '<joint name="jb" type="revolute"><mimic joint="ja" multiplier="-0.5"'
        ' offset="0.1"/>',
    )
    assert "mimic" in text
    bodies = hold_joints(read_urdf(Path(saved(tmp_path, text)), "couple"), {"ja": 0.3})
    theirs, _ = mujoco_matrix(CHAIN, {"ja": 0.3, "jb": -0.05, "jc": 0.2}, ("ja", "jb"))
    assert our_matrix(urdf_vehicle(bodies), [0.2]) == pytest.approx(
        theirs, rel=1e-11, abs=1e-13
    )
    assert not bodies.mimics


def test_a_joint_with_limits_that_is_held_below_a_rotor_is_said(tmp_path):
    fields = 'direction = "cw"\nthrust_coefficient = 1e-05\nmoment_coefficient = 0.02\n'
    vehicle = loaded(
        tmp_path,
        quad(plugins=False),
        f'[[rotors]]\nname = "x"\nlink = "upper"\n{fields}',
    )
    assert [note for note in vehicle.notes if "held" in note] == [
        "joint shoulder: held although it has limits, for it moves the link of a rotor"
    ]
    assert "shoulder" not in vehicle.joint_names


def test_a_file_alone_says_of_limited_joints_of_rotors_what_a_vehicle_file_says(
    tmp_path,
):
    turning = quad().replace('type="continuous"', 'type="revolute"', 1)
    turning = turning.replace(
        "<axis", '<limit lower="-1" upper="1" effort="0" velocity="0"/><axis', 1
    )
    by_toml = loaded(tmp_path, turning)
    alone = load_vehicle(saved(tmp_path, turning))
    assert [note for note in alone.notes if "although it has limits" in note]
    assert alone.notes == by_toml.notes
