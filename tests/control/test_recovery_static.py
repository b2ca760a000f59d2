"""The recovery's command at rest holds the vehicle as it stands: weight, the arm's
moment, the joints' torques.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from published_laws import ARM, MODEL, measured, vec
from scipy.spatial.transform import Rotation

from skyarm.control.catalogue import make_controller
from skyarm.control.safety import with_safety_layer
from skyarm.control.safety.recovery import recover
from skyarm.reference import Reference
from support.cases import sampled
from support.laws import pushes, scalars
from support.vehicles import PinocchioTwin, RandomState


@pytest.mark.parametrize("joints", [(0.0, 0.0), (0.5, -0.3), (-0.8, 1.1)])
@pytest.mark.parametrize("yaw", sampled([2.0, 0.0], 2))
def test_at_rest_on_its_reference_it_holds_what_pinocchio_says(joints, yaw):
    x, y, z, w = Rotation.from_euler("Z", yaw).as_quat()
    position = np.array([0.3, -0.2, 1.5])
    state = RandomState(
        position=position,
        quaternion=np.array([w, x, y, z]),
        joints=np.array(joints),
        velocity=np.zeros(8),
    )
    par = with_safety_layer(make_controller("ct_ladder", MODEL)).par
    reference = Reference(
        position=vec(position), yaw=yaw, joints=joints, joint_rates=(0.0, 0.0)
    ).dense()
    mixer = make_controller("hybrid_computed_torque", MODEL).par.mixer
    command = recover(par.recovery, MODEL, mixer, measured(state), reference)
    torque, thrust = pushes(ARM, command)
    held = PinocchioTwin(ARM).inverse_dynamics(state, np.zeros(8))
    assert thrust == pytest.approx(held[2], rel=1e-12)
    np.testing.assert_allclose(torque, held[3:6], atol=1e-12)
    np.testing.assert_allclose(scalars(command.efforts), held[6:], atol=1e-12)


def test_joints_are_pulled_by_its_own_gains_towards_their_reference():
    state = RandomState(
        position=np.zeros(3),
        quaternion=np.array([1.0, 0, 0, 0]),
        joints=np.array([0.1, -0.2]),
        velocity=np.zeros(8),
    )
    par = with_safety_layer(make_controller("ct_ladder", MODEL)).par
    mixer = make_controller("hybrid_computed_torque", MODEL).par.mixer
    moving = dataclasses.replace(measured(state), joint_rates=(0.3, 0.4))
    reference = Reference(joints=(0.15, -0.1), joint_rates=(0.1, -0.1)).dense()
    at_rest = recover(
        par.recovery,
        MODEL,
        mixer,
        measured(state),
        Reference(joints=(0.1, -0.2), joint_rates=(0.0, 0.0)).dense(),
    )
    pulled = recover(par.recovery, MODEL, mixer, moving, reference)
    gains = par.recovery.joint_gains
    wanted = np.array(gains.stiffness) * [0.05, 0.1] + np.array(gains.damping) * [
        -0.2,
        -0.5,
    ]
    np.testing.assert_allclose(
        np.array(scalars(pulled.efforts)) - np.array(scalars(at_rest.efforts)),
        wanted,
        atol=1e-12,
    )
