"""Rotors that lean push sideways where they turn the base, and what a spinning link
weighs; against MuJoCo.
"""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from skyarm.algebra import Sym3, Vec3
from skyarm.scenario.unlikely_numbers import unlikely_in_vehicle
from skyarm.studies.assess.assessment import assess_vehicle
from skyarm.vehicle import Body, Rotor, Vehicle

MASS, MOMENTS, MOST, PER_THRUST = 6.0, (0.85, 0.86, 1.65), 900.0, 0.018
THRUST = 35.0 / MOST**2


def hexarotor(leans, com=(0.0, 0.0, 0.0)):
    """Six rotors 0.5 m around the centre of mass and 0.09 m above it, which lean
    outward (rad) by given angles.
    """
    rotors = []
    for k, lean in enumerate(leans):
        out = np.array([np.cos(k * np.pi / 3), np.sin(k * np.pi / 3), 0.0])
        hub, axis = (
            com + 0.5 * out + [0, 0, 0.09],
            np.sin(lean) * out
            + [
                0,
                0,
                np.cos(lean),
            ],
        )
        rotors.append(
            Rotor(
                name=f"r{k}",
                position=Vec3(*hub.tolist()),
                axis=Vec3(*axis.tolist()),
                direction=(1, -1)[k % 2],
                thrust_coefficient=THRUST,
                moment_coefficient=PER_THRUST,
                max_speed=MOST,
            )
        )
    base = Body(mass=MASS, com=Vec3(*com), inertia=Sym3(*MOMENTS, 0.0, 0.0, 0.0))
    return Vehicle(name="hexa", base=base, rotors=tuple(rotors))


def judged(vehicle):
    """Thrusts (6, 4) per torque about the base and thrust along z, and MuJoCo's
    accelerations of such thrusts.
    """
    com, moments = " ".join(map(str, vehicle.base.com)), " ".join(map(str, MOMENTS))
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><option gravity="0 0 0"/><worldbody><body><freejoint/><inertial'
        f' pos="{com}" mass="{MASS}"'
        f' diaginertia="{moments}"/></body></worldbody></mujoco>'
    )
    hubs, axes = (
        np.array([list(getattr(each, word)) for each in vehicle.rotors])
        for word in ("position", "axis")
    )
    drag = np.array([[-each.direction * PER_THRUST] for each in vehicle.rotors]) * axes
    thrusts = np.linalg.pinv(np.vstack([(np.cross(hubs, axes) + drag).T, axes[:, 2]]))
    accelerations = []
    for column in thrusts.T:
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        for thrust, hub, axis, torque in zip(column, hubs, axes, drag, strict=True):
            mujoco.mj_applyFT(
                model, data, thrust * axis, thrust * torque, hub, 1, data.qfrc_applied
            )
        mujoco.mj_forward(model, data)
        turned = data.qacc[3:].copy()
        accelerations.append(
            [*(data.qacc[:3] + np.cross(turned, list(vehicle.base.com))), *turned]
        )
    return thrusts, np.array(accelerations)


def found(vehicle):
    return {each.question: each for each in assess_vehicle(vehicle, poses=1).findings}


def test_rotors_that_lean_outward_push_against_the_tilt():
    vehicle = hexarotor([0.35] * 6)
    _, accelerations = judged(vehicle)
    # tilted by a about x the base moves by -g a along y, and by a'' times the first
    # number where it is turned
    against = (
        accelerations[0, 1] / accelerations[0, 3],
        -accelerations[1, 0] / accelerations[1, 4],
    )
    said = found(vehicle)["side force of torques"]
    assert (said.level, said.field) == ("warning", "rotors.axis")
    assert said.value == pytest.approx(np.sqrt(9.81 / max(against)), rel=1e-9)
    assert "bandwidth" in said.remedy


@pytest.mark.parametrize("leans", [[-0.35] * 6, [0.0] * 6, [0.05] * 6])
def test_rotors_that_lean_inward_or_hardly_are_not_warned_of(leans):
    assert "side force of torques" not in found(hexarotor(leans))


@pytest.mark.parametrize("com", [(0.0, 0.0, 0.0), (0.3, 0.1, 0.0), (0.305, 0.53, 0.02)])
@pytest.mark.parametrize("leans", [[0.35, -0.35] * 3, [-0.35, 0.35] * 3])
def test_authority_is_the_acceleration_that_mujoco_gives(leans, com):
    """Side forces turn a base whose origin lies beside its centre of mass: of the yaw
    torque little or none is left.
    """
    vehicle = hexarotor(leans, com)
    thrusts, accelerations = judged(vehicle)
    hover = thrusts @ [com[1] * MASS * 9.81, -com[0] * MASS * 9.81, 0.0, MASS * 9.81]
    for axis, name in enumerate(("roll", "pitch", "yaw")):
        change = thrusts[:, axis]
        room = min(
            min((np.where(sign * change > 0.0, 35.0, 0.0) - hover) / (sign * change))
            for sign in (1.0, -1.0)
        )
        said = found(vehicle)[f"{name} authority"]
        assert said.value == pytest.approx(
            room * accelerations[axis, 3 + axis], rel=1e-9, abs=1e-9
        )
    left = accelerations[2, 5] * MOMENTS[2]
    assert (found(vehicle)["yaw authority"].level == "ok") == (left > 0.5)


@pytest.mark.parametrize(
    ("inertia", "warned"), [(0.02, False), (0.03, True), (0.001, False)]
)
def test_rotors_that_spin_a_tenth_of_the_base_are_suspected(inertia, warned):
    """Six of 0.03 are 0.18 kg m^2 of 1.65, six of 0.02 are 0.12."""
    level = hexarotor([0.0] * 6)
    vehicle = replace(
        level, rotors=tuple(replace(each, inertia=inertia) for each in level.rotors)
    )
    lines = [line for line in unlikely_in_vehicle(vehicle) if "inertia" in line]
    assert bool(lines) == warned
    if warned:
        assert lines[0].startswith(
            "rotors[r0].inertia = 0.03 kg m^2: with 6 rotors is more than 10% of the"
            " base's 1.65"
        )
        assert '[[rotors]] name = "r0", inertia = 0' in lines[0]
