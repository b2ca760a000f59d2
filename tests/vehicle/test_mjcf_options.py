"""Biases, activations and the option of MJCF files: against MuJoCo's own forces of the
same file.
"""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from skyarm.vehicle.vehicle_files import load_vehicle

NUMBERS = (
    "[rotor_defaults]\nmax_speed = 900.0\ntime_constant_up = 0.02\ntime_constant_down ="
    " 0.03\n"
)


def model(actuators, option=""):
    mass = '<inertial pos="0 0 0" mass="1" diaginertia="2e-3 3e-3 4e-3"/>'
    return (
        f'<mujoco>{option}<worldbody><body name="hull"><freejoint/>{mass}<site'
        ' name="s"/><body name="arm">'
        '<joint name="j" axis="0 1'
        f' 0"/>{mass}</body></body></worldbody><actuator>{actuators}</actuator>'
        f"</mujoco>"
    )


def loaded(tmp_path, text):
    (tmp_path / "m.xml").write_text(text)
    (tmp_path / "v.toml").write_text(
        f'schema = 1\nname = "v"\nmjcf = "m.xml"\n{NUMBERS}'
    )
    return load_vehicle(tmp_path / "v.toml")


def settled(text, control, time=1.0):
    """Generalized forces of the actuators after a constant control has acted for a time
    (s), the vehicle held still.
    """
    plant = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(plant)
    for _ in range(round(time / plant.opt.timestep)):
        data.ctrl[:], data.qvel[:], data.qpos[:] = control, 0.0, plant.qpos0
        mujoco.mj_step(plant, data)
    data.qpos[:], data.qvel[:] = plant.qpos0, 0.0
    mujoco.mj_forward(plant, data)
    return np.array(data.qfrc_actuator)


def most(vehicle):
    return [
        float(each.thrust_coefficient) * float(each.max_speed) ** 2
        for each in vehicle.rotors
    ]


UNUSED = 'biasprm="1 -30 -2"'


def test_numbers_of_a_bias_count_only_where_the_actuator_has_one(tmp_path):
    ranges = 'ctrllimited="true" ctrlrange="-3 3"'
    thrust = (
        f'<general name="t" site="s" gear="0 0 1 0 0 0.1" {UNUSED} ctrllimited="true"'
        ' ctrlrange="0 9"/>'
    )
    text = model(f'{thrust}<general name="a" joint="j" {UNUSED} {ranges}/>')
    vehicle, forces = loaded(tmp_path, text), settled(text, 100.0)
    assert most(vehicle) == pytest.approx([forces[2]], rel=1e-12)
    assert (vehicle.joints[0].effort_limit, vehicle.drives) == (forces[6], ())
    assert vehicle.notes == ()
    biased = loaded(tmp_path, text.replace(UNUSED, f'biastype="affine" {UNUSED}'))
    assert (biased.rotors, len(biased.drives)) == ((), 1)


@pytest.mark.parametrize("kind", ["filter", "filterexact"])
@pytest.mark.parametrize(
    ("control", "activation"), [("0 9", "0 5"), ("0 4", "-1 6"), (None, "0 5")]
)
def test_the_largest_thrust_is_what_control_and_activation_let_through(
    tmp_path, kind, control, activation
):
    limited = f'ctrllimited="true" ctrlrange="{control}"' if control else ""
    lag = f'dyntype="{kind}" dynprm="0.05" actlimited="true" actrange="{activation}"'
    text = model(
        f'<general site="s" gear="0 0 1 0 0 0.1" gainprm="2" {lag} {limited}/>'
    )
    vehicle = loaded(tmp_path, text)
    assert most(vehicle) == pytest.approx([settled(text, 50.0, 3.0)[2]], rel=1e-12)
    assert [each.time_constant_up for each in vehicle.rotors] == [0.05]


@pytest.mark.parametrize("kind", ["integrator", "muscle"])
def test_a_thruster_whose_force_is_no_lag_of_its_control_is_not_read(tmp_path, kind):
    """A control of 1 for 1 s and for 2 s gives MuJoCo's integrator 1 N and 2 N: no
    control has a thrust.
    """
    thrust = (
        f'<general name="a" site="s" gear="0 0 1 0 0 0.1" dyntype="{kind}"'
        ' ctrllimited="true" ctrlrange="0 1"/>'
    )
    text = model(thrust)
    if kind == "integrator":
        assert [settled(text, 1.0, time)[2] for time in (1.0, 2.0)] == pytest.approx(
            [1.0, 2.0], rel=1e-9
        )
    vehicle = loaded(tmp_path, text)
    assert vehicle.rotors == ()
    assert any(
        each.startswith("actuator a: a part of a wrench") and "activation" in each
        for each in vehicle.notes
    )


def test_a_motor_on_an_integrator_is_bounded_by_its_activation(tmp_path):
    bounds = 'ctrllimited="true" ctrlrange="0 1" actlimited="true" actrange="-3 3"'
    text = model(
        f'<general name="a" joint="j" dyntype="integrator" gainprm="2" {bounds}/>'
    )
    assert (
        loaded(tmp_path, text).joints[0].effort_limit
        == settled(text, 1.0, 5.0)[6]
        == 6.0
    )


def test_actuators_of_disabled_groups_are_left_out_with_a_note(tmp_path):
    thrusts = "".join(
        f'<motor name="{name}" site="s" group="{group}" gear="0 0 {scale} 0 0 .1"'
        ' ctrllimited="true" ctrlrange="0 8"/>'
        for name, group, scale in (("up", 0, 1), ("off", 2, -1))
    )
    joints = (
        '<motor joint="j" gear="2" ctrllimited="true" ctrlrange="-3 3" group="31"/>'
    )
    joints += '<position name="off_j" joint="j" kp="40" group="4" forcerange="-9 9"/>'
    text = model(thrusts + joints, '<option actuatorgroupdisable="2 4"/>')
    vehicle, forces = loaded(tmp_path, text), settled(text, 1e3)
    np.testing.assert_allclose([*vehicle.rotors[0].axis], [0, 0, 1])
    assert [each.name for each in vehicle.rotors] == ["s"]
    assert forces[2] == 8.0
    assert (vehicle.joints[0].effort_limit, vehicle.drives) == (forces[6], ())
    off = [each for each in vehicle.notes if "disables" in each]
    assert off == [
        "actuators off, off_j: of a group that the option disables: left out"
    ]
    assert not any("not at a joint" in each for each in vehicle.notes)


FLAGS = (
    "constraint equality frictionloss limit spring damper gravity clampctrl actuation"
)


def test_physics_that_the_option_disables_stands_in_one_note(tmp_path):
    motor = '<motor joint="j" ctrllimited="true" ctrlrange="-3 3"/>'
    words = " ".join(f'{flag}="disable"' for flag in (*FLAGS.split(), "contact"))
    flags = f"<option><flag {words}/></option>"
    assert not settled(model(motor, flags), 1.0).any()  # MuJoCo drives nothing
    assert (
        mujoco.MjModel.from_xml_string(model(motor, flags)).opt.disableflags.bit_count()
        == 10
    )
    listed = ", ".join(FLAGS.split())
    assert loaded(tmp_path, model(motor, flags)).notes == (
        f"{listed}: disabled by the option of the file; not read: here they act",
    )
    for flag in FLAGS.split():
        alone = loaded(
            tmp_path, model(motor, f'<option><flag {flag}="disable"/></option>')
        ).notes
        assert alone == (
            f"{flag}: disabled by the option of the file; not read: here they act",
        )
    assert (
        loaded(
            tmp_path, model(motor, '<option><flag contact="disable"/></option>')
        ).notes
        == ()
    )


@pytest.mark.parametrize(
    ("gravity", "noted"),
    [("0 0 0", True), ("0 0 9.81", True), ("1 0 -9.8", True), ("0 0 -1.62", False)],
)
def test_gravity_that_does_not_pull_down_is_noted(tmp_path, gravity, noted):
    notes = loaded(tmp_path, model("", f'<option gravity="{gravity}"/>')).notes
    numbers = [float(each) for each in gravity.split()]
    words = (
        f"gravity {numbers} of the option: not read; the scenario states gravity,"
        " along -z"
    )
    assert [each for each in notes if "gravity" in each] == [words] * noted
