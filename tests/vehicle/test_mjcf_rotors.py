"""Rotors, servos, bases and held joints of MJCF files: against the forces and bodies of
MuJoCo's own model.
"""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from skyarm.vehicle import VehicleError
from skyarm.vehicle.vehicle_files import load_vehicle

FILLED = (
    "[rotor_defaults]\nmax_speed = 900.0\ntime_constant_up = 0.02\ntime_constant_down ="
    " 0.03\n"
)


def inertial(mass=0.2, at="0 0 0"):
    return f'<inertial pos="{at}" mass="{mass}" diaginertia="2e-3 3e-3 4e-3"/>'


def model(inside="", after="", joint="<freejoint/>", beside="", before=""):
    return (
        f'<mujoco><compiler angle="radian"/>{before}<worldbody><body name="hull" pos="0'
        f' 0 1">{joint}{inertial(1.5)}'
        f"{inside}</body>{beside}</worldbody>{after}</mujoco>"
    )


def loaded(tmp_path, text, toml="", name="m.xml"):
    """Vehicle of an MJCF text, by a vehicle file with more lines."""
    (tmp_path / name).write_text(text, encoding="utf-8")
    (tmp_path / "v.toml").write_text(
        f'schema = 1\nname = "v"\nmjcf = "{name}"\n{toml}', encoding="utf-8"
    )
    return load_vehicle(tmp_path / "v.toml")


def arm_on(tmp_path, text, toml=""):
    """An airframe that carries the arm of an MJCF text."""
    (tmp_path / "a.xml").write_text(text, encoding="utf-8")
    head = (
        'schema = 1\nname = "v"\nairframe = "hummingbird"\n[[attach]]\narm = "a.xml"\n'
    )
    (tmp_path / "v.toml").write_text(head + toml, encoding="utf-8")
    return load_vehicle(tmp_path / "v.toml")


SITES = (
    '<site name="front" pos="0.2 0.01 0.03" euler="0.1 0.2 0.3"/><body name="boom"'
    ' pos="-0.1 0 0.02" euler="0.3 0 0.1"><geom size="0.02" mass="0.05"/><site'
    ' name="rear" pos="-0.1 0 0.01" euler="0 -0.4 0"/></body>'
)
THRUSTS = (
    '<actuator><motor name="a" site="front" gear="0 0 2 0 0 -0.05" ctrllimited="true"'
    ' ctrlrange="0 4"/><general name="b" site="rear" gear="0 0.6 0.8 0 0.03 0.04"'
    ' gainprm="3" dyntype="filterexact" dynprm="0.06" ctrllimited="true" ctrlrange="0'
    ' 5" forcelimited="true" forcerange="-1 12"/></actuator>'
)


def test_rotors_push_as_mujocos_actuators_at_their_largest_control(tmp_path):
    text = model(SITES, THRUSTS)
    vehicle = loaded(tmp_path, text, FILLED)
    assert [rotor.name for rotor in vehicle.rotors] == ["front", "rear"]
    assert (
        vehicle.rotors[1].time_constant_up
        == vehicle.rotors[1].time_constant_down
        == 0.06
    )
    plant = mujoco.MjModel.from_xml_string(text)
    for index, (rotor, control, activation) in enumerate(
        zip(vehicle.rotors, (4.0, 0.0), (0.0, 4.0), strict=True)
    ):
        data = mujoco.MjData(plant)
        # 12 N of the second: its force range
        data.ctrl[index], data.act[:] = control, activation
        mujoco.mj_forward(plant, data)
        thrust = rotor.thrust_coefficient * rotor.max_speed**2
        force = np.array(rotor.axis) * thrust
        torque = (
            np.cross(np.array(rotor.position), force)
            - rotor.direction * rotor.moment_coefficient * force
        )
        np.testing.assert_allclose(
            np.concatenate([force, torque]), data.qfrc_actuator[:6], rtol=0, atol=1e-12
        )


def test_a_file_with_thrusts_alone_names_what_it_lacks(tmp_path):
    (tmp_path / "m.xml").write_text(model(SITES, THRUSTS))
    vehicle = load_vehicle(tmp_path / "m.xml")
    assert vehicle.rotors == ()
    first, second = vehicle.gaps
    assert first.startswith(
        "rotors front: the file states no max_speed, time_constant_up,"
        " time_constant_down;"
    )
    assert second.startswith("rotors rear: the file states no max_speed;")


def test_a_largest_thrust_that_the_users_numbers_contradict_is_told(tmp_path):
    """4 N of the first site; 1e-05 (500 rad/s)^2 are 2.5 N. Of the user's own three
    numbers one is too much.
    """
    lags = "time_constant_up = 0.02\ntime_constant_down = 0.02\n"
    both = "thrust_coefficient = 1e-05\nmax_speed = 500.0\n"
    vehicle = loaded(tmp_path, model(SITES, THRUSTS), f"[rotor_defaults]\n{both}{lags}")
    notes = [each for each in vehicle.notes if "at most in the file" in each]
    fly = "at most in the file: thrust_coefficient and max_speed give 2.5 N, which fly"
    assert notes == [f"rotors front: 8 N {fly}", f"rotors rear: 12 N {fly}"]
    assert [each.thrust_coefficient * each.max_speed**2 for each in vehicle.rotors] == [
        2.5,
        2.5,
    ]
    own = (
        'schema = 1\nname = "v"\n[base]\nmass = 1.0\ninertia = [0.01, 0.01,'
        " 0.02]\n[rotor_defaults]\n"
    )
    own += (
        f'moment_coefficient = 0.01\n{both}{lags}[[rotors]]\nname = "a"\nposition ='
        " [0.0, 0.0, 0.1]\n"
    )
    own += 'direction = "cw"\nmax_thrust = '
    # as a data sheet rounds
    (tmp_path / "own.toml").write_text(own + "2.51\n", encoding="utf-8")
    assert load_vehicle(tmp_path / "own.toml").rotors[0].max_speed == 500
    (tmp_path / "own.toml").write_text(own + "3.0\n", encoding="utf-8")
    with pytest.raises(
        VehicleError,
        match=r"rotors\[a\]\.max_thrust = 3\.0: must be left out beside .* give 2\.5 N",
    ):
        load_vehicle(tmp_path / "own.toml")


def test_a_wrench_at_a_site_is_no_rotor_and_a_free_torque_is_no_drag(tmp_path):
    up = '<motor name="up" site="front" gear="0 0 1 0 0 0"/>'
    wrench = f'<actuator>{up}<motor name="x" site="front" gear="{{}}"/></actuator>'
    vehicle = loaded(tmp_path, model(SITES, wrench.format("0 0 0 1 0 0")))
    assert (vehicle.rotors, vehicle.gaps) == ((), ())
    assert any(
        note.startswith("actuators up, x: a part of a wrench") for note in vehicle.notes
    )
    vehicle = loaded(tmp_path, model(SITES, wrench.format("0 0 0 0 0 1")))
    assert vehicle.gaps[0].startswith(
        "rotors front: the file states no direction, thrust_coefficient, moment_coeff"
    )
    assert any(
        note.startswith("actuator x: a part of a wrench") for note in vehicle.notes
    )


SPUN = (
    '<body name="prop" pos="0.2 0 0.02" euler="0 0.1 0"><joint name="spin" axis="0 0 1"'
    ' pos="0 0 0.1"/><inertial pos="0 0 0" mass="0.012" diaginertia="3e-6 5e-5'
    ' 5.2e-5"/><site name="s"/></body>'
)
TILTED = (
    '<body name="nacelle" pos="-0.2 0 0.02" euler="0 0 0.5"><joint name="tilt" axis="2'
    f' 0 0" range="-0.7 1.2" limited="true"/>{inertial()}<site name="t" pos="0 0'
    ' 0.05"/></body>'
)
HINGED = (
    '<actuator><velocity joint="spin" kv="0.01"/><position joint="tilt" kp="3"/><motor'
    ' site="s" gear="0 0 1 0 0 0.1" ctrllimited="true" ctrlrange="0 8"/><motor site="t"'
    ' gear="0 0 1 0 0 -0.1" ctrllimited="true" ctrlrange="0 8"/></actuator>'
)


def test_hinges_along_the_thrust_spin_rotors_and_driven_ones_across_tilt_them(tmp_path):
    text = model(SPUN + TILTED, HINGED)
    with pytest.raises(
        VehicleError, match=r"rotors t: the file states no tilt.time_constant; state"
    ):
        loaded(tmp_path, text, FILLED)
    vehicle = loaded(
        tmp_path,
        text,
        FILLED + '[[rotors]]\nname = "t"\ntilt = { time_constant = 0.08 }\n',
    )
    assert (vehicle.n, vehicle.drives) == (0, ())
    spun, tilted = vehicle.rotors
    assert (spun.inertia, spun.direction, tilted.direction, tilted.inertia) == (
        5.2e-5,
        -1,
        1,
        0,
    )
    plant = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(plant)
    mujoco.mj_forward(plant, data)
    np.testing.assert_allclose(
        np.array(tilted.tilt.axis), data.joint("tilt").xaxis, rtol=0, atol=1e-15
    )
    np.testing.assert_allclose(
        np.array(spun.axis), data.joint("spin").xaxis, rtol=0, atol=1e-15
    )
    np.testing.assert_allclose(
        np.array(tilted.position), data.site("t").xpos - [0, 0, 1], rtol=0, atol=1e-15
    )
    assert (tilted.tilt.lower, tilted.tilt.upper, tilted.tilt.time_constant) == (
        -0.7,
        1.2,
        0.08,
    )
    assert vehicle.mass == pytest.approx(plant.body_mass.sum(), rel=1e-15)
    assert any(
        "tilts a rotor, whose hub is 50 mm beside its axis" in note
        for note in vehicle.notes
    )


PAIR = TILTED.replace(
    '<site name="t"', '<site name="low" pos="0 0 -0.05"/><site name="t"'
)
COAXIAL = HINGED.replace(
    '<motor site="t"',
    '<motor site="low" gear="0 0 1 0 0 0.1" ctrlrange="0 8"/><motor site="t"',
)


@pytest.mark.parametrize("tied", [False, True])
def test_a_hinge_that_tilts_several_rotors_is_no_tilt_of_each(tmp_path, tied):
    """MuJoCo's model has one degree of freedom there; a tilt here is of one rotor.
    Places by MuJoCo, the hinge held.
    """
    other = (
        TILTED.replace("nacelle", "boom")
        .replace('"tilt"', '"bend"')
        .replace('"t"', '"low"')
        .replace("-0.2", "0.3")
    )
    inside = SPUN + (TILTED + other if tied else PAIR)
    tie = '<equality><joint joint1="bend" joint2="tilt"/></equality>' if tied else ""
    drive = (
        '<position joint="bend" kp="3"/><motor site="low"'
        if tied
        else '<motor site="low"'
    )
    after = COAXIAL.replace('<motor site="low"', drive) + tie
    (tmp_path / "m.xml").write_text(model(inside, after))
    gap = load_vehicle(tmp_path / "m.xml").gaps[-1]
    assert gap.startswith(
        "rotors low, t: ride on a link that joint tilt moves" if not tied else "rotors "
    )
    held = 'mimic = "couple"\n' + FILLED + '[[joints]]\nname = "tilt"\nhold = 0.4\n'
    vehicle = loaded(tmp_path, model(inside, after), held)
    assert [each.name for each in vehicle.rotors] == ["s", "low", "t"]
    assert not any(each.tilt for each in vehicle.rotors)
    plant = mujoco.MjModel.from_xml_string(model(inside, after))
    data = mujoco.MjData(plant)
    data.joint("tilt").qpos = 0.4
    if tied:
        data.joint("bend").qpos = 0.4
    mujoco.mj_forward(plant, data)
    for rotor in vehicle.rotors[1:]:
        where = data.site(rotor.name)
        np.testing.assert_allclose(
            np.array(rotor.position), where.xpos - [0, 0, 1], rtol=0, atol=1e-14
        )
        np.testing.assert_allclose(
            np.array(rotor.axis), where.xmat.reshape(3, 3)[:, 2], rtol=0, atol=1e-14
        )


def test_a_riding_rotor_is_at_its_site_although_a_body_has_its_name(tmp_path):
    leaning = SPUN.replace('axis="0 0 1"', 'axis="0 0.6 0.8"').replace(
        'name="s"', 'name="prop" pos="0 0 0.1" euler="0.2 0 0"'
    )
    motor = (
        '<actuator><motor site="prop" gear="0 0 1 0 0 0.1" ctrlrange="0 8"/></actuator>'
    )
    vehicle = loaded(
        tmp_path,
        model(leaning, motor),
        FILLED + '[[joints]]\nname = "spin"\nhold = 0.3\n',
    )
    plant = mujoco.MjModel.from_xml_string(model(leaning, motor))
    data = mujoco.MjData(plant)
    data.joint("spin").qpos = 0.3
    mujoco.mj_forward(plant, data)
    (rotor,), where = vehicle.rotors, data.site("prop")
    np.testing.assert_allclose(
        np.array(rotor.position), where.xpos - [0, 0, 1], rtol=0, atol=1e-15
    )
    np.testing.assert_allclose(
        np.array(rotor.axis), where.xmat.reshape(3, 3)[:, 2], rtol=0, atol=1e-15
    )


def test_an_actuator_that_is_a_plugin_is_named_and_gives_nothing(tmp_path):
    """Of MuJoCo's own pid, whose range of control is an angle: 1.5 rad was read as 1.5
    N m.
    """
    pid = (
        '<extension><plugin plugin="mujoco.pid"><instance name="p"><config key="kp"'
        ' value="40"/></instance></plugin></extension>'
    )
    act = (
        '<actuator><plugin name="a" joint="j" plugin="mujoco.pid" instance="p"'
        ' actdim="0" ctrlrange="-1.5 1.5"/>'
    )
    vehicle = loaded(tmp_path, model(ARM.format(""), f"{act}</actuator>", before=pid))
    assert (vehicle.drives, vehicle.joints[0].effort_limit) == ((), 0)
    assert any(
        note.startswith("actuator a: muscle, damper, dcmotor, plugin")
        for note in vehicle.notes
    )


@pytest.mark.parametrize(
    "word", ['slewmax="1"', 'ki="2" imax="0.5"', 'delay="0.02" nsample="30"']
)
def test_what_a_servo_of_a_file_loses_is_named(tmp_path, word):
    vehicle = loaded(
        tmp_path,
        model(
            ARM.format(""),
            f'<actuator><pid name="a" joint="j" kp="10" {word}/></actuator>',
        ),
    )
    assert any(
        note.startswith("actuator a: with a delay, slewmax or imax: not read")
        for note in vehicle.notes
    )


def test_a_rotor_on_an_arm_is_a_gap_until_its_joint_is_held(tmp_path):
    leaning = SPUN.replace('axis="0 0 1"', 'axis="0 0.6 0.8"')
    motor = (
        '<actuator><motor site="s" gear="0 0 1 0 0 0.1" ctrllimited="true" ctrlrange="0'
        ' 8"/></actuator>'
    )
    (tmp_path / "m.xml").write_text(model(leaning, motor))
    (gap,) = load_vehicle(tmp_path / "m.xml").gaps
    assert (
        'ride on a link that joint spin moves; hold it: [[joints]] name = "spin", hold'
        " = 0.0" in gap
    )
    vehicle = loaded(
        tmp_path,
        model(leaning, motor),
        FILLED + '[[joints]]\nname = "spin"\nhold = 0.3\n',
    )
    plant = mujoco.MjModel.from_xml_string(model(leaning, motor))
    data = mujoco.MjData(plant)
    data.qpos[7] = 0.3
    mujoco.mj_forward(plant, data)
    (rotor,) = vehicle.rotors
    np.testing.assert_allclose(
        np.array(rotor.position), data.site("s").xpos - [0, 0, 1], rtol=0, atol=1e-15
    )
    np.testing.assert_allclose(
        np.array(rotor.axis), data.site("s").xmat[2::3], rtol=0, atol=1e-15
    )


ARM = (
    '<body name="arm" pos="0 0 -0.1"><joint name="j" axis="0 1 0"'
    f" {{}}/>{inertial(0.3, '0 0 -0.1')}</body>"
)
SERVOS = {
    "position": (
        '<position joint="j" kp="40" kv="1.5" gear="2" forcelimited="true"'
        ' forcerange="-6 6"/>'
    ),
    "velocity": '<velocity joint="j" kv="0.7" forcelimited="true" forcerange="-6 6"/>',
    "pid": '<pid joint="j" kp="10" kv="1" forcelimited="true" forcerange="-2 2"/>',
    "scaled": '<general joint="j" gainprm="0.3" biastype="affine" biasprm="0 -30 -2"/>',
}


@pytest.mark.parametrize("kind", SERVOS)
def test_servos_pull_as_mujocos_do(tmp_path, kind):
    text = model(ARM.format(""), f"<actuator>{SERVOS[kind]}</actuator>")
    vehicle = loaded(tmp_path, text)
    plant = mujoco.MjModel.from_xml_string(text)
    (mounted,), limit = vehicle.drives, vehicle.joints[0].effort_limit
    force = plant.actuator_forcerange[0][1] * plant.actuator_gear[0][0]
    assert limit == (force if plant.actuator_forcelimited[0] else np.inf)
    assert any("unlimited effort" in note for note in vehicle.notes) == (
        kind == "scaled"
    )
    for position, rate in ((0.02, -0.3), (-0.05, 0.1), (1.0, 2.0)):
        data = mujoco.MjData(plant)
        data.qpos[7], data.qvel[6] = position, rate
        mujoco.mj_forward(plant, data)
        memory = mounted.drive.begin(position, 0.0, 0.005)
        ours = np.clip(mounted.drive.effort(memory, 0.0, position, rate), -limit, limit)
        assert ours == pytest.approx(data.qfrc_actuator[6], rel=1e-14)
    assert mounted.drive.inertia == pytest.approx(
        1.0 / plant.dof_invweight0[6], rel=1e-15
    )


OTHER_ACTUATORS = {
    "damper": ('<damper name="a" joint="j" kv="2" ctrlrange="0 1"/>', 0.0),
    "filtered": (
        (
            '<general name="a" joint="j" dyntype="filter" dynprm="0.1"'
            ' ctrllimited="true" ctrlrange="-3 3"/>'
        ),
        3.0,
    ),
    "biased": (
        (
            '<general name="a" joint="j" biastype="affine" biasprm="1 0 0"'
            ' forcerange="-4 4" forcelimited="true"/>'
        ),
        4.0,
    ),
}


@pytest.mark.parametrize("kind", OTHER_ACTUATORS)
def test_actuators_without_a_counterpart_are_named(tmp_path, kind):
    text, effort = OTHER_ACTUATORS[kind]
    vehicle = loaded(tmp_path, model(ARM.format(""), f"<actuator>{text}</actuator>"))
    assert (vehicle.drives, vehicle.joints[0].effort_limit) == ((), effort)
    assert any(
        note.startswith("actuator a: muscle, damper, dcmotor, plugin, or with a filter")
        for note in vehicle.notes
    )


def test_motors_at_a_free_joint_uneven_ranges_and_its_defaults_are_notes(tmp_path):
    motors = (
        '<actuator><motor name="lift" joint="root" gear="0 0 1 0 0 0"/>'
        '<motor joint="j" ctrllimited="true" ctrlrange="0 3"/></actuator>'
    )
    free = '<joint name="root" type="free"/>'
    vehicle = loaded(
        tmp_path,
        model(
            ARM.format(""),
            motors,
            free,
            before='<default><joint armature="0.05"/></default>',
        ),
    )
    assert vehicle.joints[0].effort_limit == 3.0
    for start in (
        "actuator lift: at the free joint: a wrench on the vehicle",
        "joint j: with a range of effort that differs both ways",
        "joint root: free, with armature or friction of the file's defaults, not read",
    ):
        assert any(note.startswith(start) for note in vehicle.notes), start


def test_a_servo_too_fast_to_be_stepped_takes_a_torque_until_armature_slows_it(
    tmp_path,
):
    light = ARM.format("").replace(
        'mass="0.3" diaginertia="2e-3 3e-3 4e-3"',
        'mass="1e-4" diaginertia="1e-7 1e-7 1e-7"',
    )
    text = model(light, '<actuator><position joint="j" kp="500" kv="25"/></actuator>')
    vehicle = loaded(tmp_path, text)
    assert vehicle.drives == ()
    assert any(
        note.startswith("joint j: with a servo too fast to be stepped")
        for note in vehicle.notes
    )
    slowed = loaded(tmp_path, text, '[[joints]]\nname = "j"\narmature = 0.1\n')
    plant = mujoco.MjModel.from_xml_string(text)
    assert slowed.drives[0].drive.inertia == pytest.approx(
        0.1 + 1.0 / plant.dof_invweight0[6], rel=1e-14
    )
    own = loaded(
        tmp_path,
        text,
        '[drives.j]\nkind = "position_servo"\nstiffness = 2.0\ninertia = 0.1\n',
    )
    assert own.drives[0].drive.stiffness == 2.0


TWO = '<body name="light" pos="0 0 0.3"><geom size="0.1" mass="0.7"/></body>'


def test_of_several_bodies_in_the_world_the_named_one_is_the_base(tmp_path):
    text = model(joint="", beside=TWO)
    with pytest.raises(VehicleError) as error:
        loaded(tmp_path, text)
    assert (
        'must be one, the base; base = "NAME" of the vehicle file takes one: hull (1.5'
        " kg), light (0.7 kg)" in str(error.value)
    )
    for name, mass in (("hull", 1.5), ("light", 0.7)):
        assert loaded(tmp_path, text, f'base = "{name}"\n').mass == pytest.approx(
            mass, rel=1e-15
        )
    with pytest.raises(
        VehicleError, match="base = 'wing': must be a body of the world: hull"
    ):
        loaded(tmp_path, text, 'base = "wing"\n')


def test_scenery_beside_an_arm_is_left_out_with_a_note(tmp_path):
    target = '<body name="target" mocap="true"><geom size="0.1"/></body>'
    vehicle = loaded(tmp_path, model(ARM.format(""), joint="", beside=TWO + target))
    assert (vehicle.mass, vehicle.n) == (pytest.approx(1.8, rel=1e-15), 1)
    assert (
        "parts light, target: fixed to the world beside the vehicle; not read"
        in vehicle.notes
    )
    two_arms = model(
        ARM.format(""), joint="", beside=TWO.replace("<geom", "<joint/><geom")
    )
    vehicle = arm_on(tmp_path, two_arms, 'base = "hull"\n')
    assert [joint.name for joint in vehicle.joints] == ["j"]


def test_an_attached_root_keeps_its_pose_as_mujocos_attach_has_it(tmp_path):
    arm = model(
        ARM.format("") + '<site name="tip" pos="0.3 0.1 0"/>', joint=""
    ).replace(
        'name="hull" pos="0 0 1"', 'name="hull" pos="0.02 0 0.05" euler="0.2 0.1 1.2"'
    )
    pose = "position = [0.1, 0.0, -0.05]\nrpy = [0.0, 0.0, 0.4]\n"
    vehicle = arm_on(tmp_path, arm, pose)
    spec, child = mujoco.MjSpec(), mujoco.MjSpec.from_string(arm)
    seat = spec.worldbody.add_frame(
        pos=[0.1, 0, -0.05], quat=[np.cos(0.2), 0, 0, np.sin(0.2)]
    )
    seat.attach_body(child.body("hull"), "z_", "")
    data = mujoco.MjData(spec.compile())
    mujoco.mj_kinematics(data.model, data)
    np.testing.assert_allclose(
        np.array(vehicle.frame("tip").position),
        data.site("z_tip").xpos,
        rtol=0,
        atol=1e-15,
    )
    kept = (
        "body hull: moved or turned in its file, a pose that it keeps where [[attach]]"
        " names this file"
    )
    assert any(kept in note for note in vehicle.notes)
    (tmp_path / "own.toml").write_text('schema = 1\nname = "own"\nmjcf = "a.xml"\n')
    table = (
        'schema = 1\nname = "v"\nairframe = "hummingbird"\n[[attach]]\narm ='
        f' "own.toml"\n{pose}'
    )
    (tmp_path / "on.toml").write_text(table)
    other = load_vehicle(tmp_path / "on.toml")
    assert any(f"{kept}, and not elsewhere" in note for note in other.notes)
    half = np.array([np.cos(0.4), np.sin(0.4), 0.0])  # the pose of the table alone
    turned = [half[0] * 0.3 - half[1] * 0.1, half[1] * 0.3 + half[0] * 0.1, 0.0]
    np.testing.assert_allclose(
        np.array(other.frame("tip").position),
        np.add([0.1, 0, -0.05], turned),
        atol=1e-15,
    )


BALL = (
    f'<body name="ball" pos="0 0.1 0"><joint name="b" type="ball"/>{inertial()}</body>'
)
LOOP = '<equality><connect body1="arm" body2="hull" anchor="0 0 0"/></equality>'
PULL = (
    '<tendon><fixed name="t" stiffness="1"><joint joint="j" coef="1"/></fixed></tendon>'
)
HARMLESS = {
    "spring": (
        model(ARM.format('stiffness="3"')),
        "joint[j].stiffness = 3.0: must be 0",
        {"j": 0.2},
    ),
    "loop": (
        model(ARM.format(""), LOOP),
        "equality[0] = 'connect': closed chains are not supported",
        {"j": 0.2},
    ),
    "tendon": (
        model(ARM.format(""), PULL),
        "tendon[t] = 'a pull of its own'",
        {"j": 0.2},
    ),
    "ball": (model(BALL), "joint[b].type = 'ball'", {"b": 0.0}),
    "both": (
        model(ARM.format('stiffness="3"') + BALL),
        "joint[j].stiffness = 3.0",
        {"b": 0.0, "j": 0.2},
    ),
}


@pytest.mark.parametrize("case", HARMLESS)
def test_what_acts_on_held_joints_only_is_no_fault(tmp_path, case):
    text, message, held = HARMLESS[case]
    with pytest.raises(VehicleError) as error:
        loaded(tmp_path, text)
    assert message in str(error.value)
    more = ", and so j" if len(held) > 1 else ""
    assert str(error.value).endswith(
        f'[[joints]] name = "{min(held)}", hold = 0.0{more}'
    )
    lines = "".join(
        f'[[joints]]\nname = "{name}"\nhold = {value}\n' for name, value in held.items()
    )
    vehicle = loaded(tmp_path, text, lines)
    plant = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(plant)
    for name in held.keys() - {"b"}:
        data.joint(name).qpos[0] = held[name]
    mujoco.mj_forward(plant, data)
    M = np.zeros((plant.nv, plant.nv))
    mujoco.mj_fullM(plant, data, M)
    com = np.array(vehicle.base.com)
    turned = np.array(vehicle.base.inertia.full().rows, dtype=float)
    about = turned + vehicle.mass * (com @ com * np.eye(3) - np.outer(com, com))
    np.testing.assert_allclose(about, M[3:6, 3:6], rtol=0, atol=1e-14)
    np.testing.assert_allclose(com, data.subtree_com[1] - [0, 0, 1], rtol=0, atol=1e-15)


WRONG_HOLDS = {
    "range": (
        'name = "j"\nhold = 2.0',
        "joints[j].hold = 2.0: must be within the joint's limits, -1.0 to 1.0",
    ),
    "ball": (
        'name = "b"\nhold = 0.1',
        "joints[b].hold = 0.1: must be within the joint's limits, 0.0 to 0.0",
    ),
    "unknown": ('name = "k"\nhold = 0.1', "joints.name = 'k': must be j"),
    "more": ('name = "j"\nhold = 0.1\ndamping = 0.1', "joints[j].damping = 0.1"),
    "equal ends": (
        'name = "j"\nlower = 0.5\nupper = 0.5',
        "must be below upper = 0.5; [[joints]] hold = 0.5 fixes a",
    ),
}


@pytest.mark.parametrize("case", WRONG_HOLDS)
def test_joints_are_held_where_they_can_be_only(tmp_path, case):
    text, message = WRONG_HOLDS[case]
    inside = ARM.format('limited="true" range="-1 1"') + (
        BALL if case == "ball" else ""
    )
    with pytest.raises(VehicleError) as error:
        loaded(tmp_path, model(inside), f"[[joints]]\n{text}\n")
    assert message in str(error.value)


def test_what_ties_the_vehicle_to_its_world_is_refused_whatever_is_held(tmp_path):
    weld = '<equality><weld body1="arm"/></equality>'
    with pytest.raises(
        VehicleError, match=r"equality\[0\] = 'weld': .*; must be left out of the file"
    ):
        loaded(
            tmp_path,
            model(ARM.format(""), weld),
            '[[joints]]\nname = "j"\nhold = 0.0\n',
        )


def test_a_joint_that_is_held_loses_its_servo(tmp_path):
    text = model(ARM.format(""), f"<actuator>{SERVOS['position']}</actuator>", joint="")
    vehicle = arm_on(tmp_path, text, '[[joints]]\nname = "j"\nhold = 0.4\n')
    assert (vehicle.n, vehicle.drives) == (0, ())


@pytest.mark.parametrize(
    ("least", "notes"),
    [
        (
            "-5",
            (
                (
                    "rotor a: least thrust -5 N: not read; a rotor here stops, or"
                    " reverses as far"
                ),
            ),
        ),
        ("-13", ()),
        ("0", ()),
    ],
)
def test_a_least_thrust_that_no_rotor_has_here_is_said(tmp_path, least, notes):
    site = (
        f'<motor site="a" gear="0 0 1 0 0 0.02" ctrllimited="true" ctrlrange="{least}'
        ' 13"/>'
    )
    text = model('<site name="a" pos="0.1 0 0"/>', f"<actuator>{site}</actuator>")
    assert loaded(tmp_path, text).notes == notes
