"""Short URDF files for tests, and Pinocchio's dynamics of them."""

from __future__ import annotations

import numpy as np
import pytest

from skyarm.dynamics import array_front as arrays


def link(name, inertia=(0.01, 0.011, 0.012), mass=0.5):
    xx, yy, zz = inertia
    return (
        f'<link name="{name}"><inertial><origin xyz="0.01 0.02 -0.1"/><mass value="{mass}"/>'
        f'<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0.0002" ixz="0" iyz="0"/></inertial></link>'
    )


def joint(name, parent, child, more, kind="revolute", axis="0 0.6 0.8"):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.1 0.05 -0.2" rpy="0.1 0.2 0.3"/><axis xyz="{axis}"/>{more}</joint>'
    )


def limits(lower=-1.0, upper=1.0, effort='effort="3"'):
    return f'<limit lower="{lower}" upper="{upper}" {effort} velocity="4"/>'


def robot(*parts):
    return f'<robot name="r">{"".join(parts)}</robot>'


def saved(tmp_path, text, name="r.urdf"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def pinocchio_of(text, vehicle, values):
    """Mass matrix and bias of Pinocchio's parse, whose mimics are joints like others, at values of ours.

    Args:
        values: joint's name -> (value, ratio to a joint of the vehicle, that one's index, or -1 where it is held).
    """
    pin = pytest.importorskip("pinocchio")
    model = pin.buildModelFromXML(text, pin.JointModelFreeFlyer())
    data, q, n = model.createData(), pin.neutral(model), vehicle.n
    G = np.zeros((model.nv, 6 + n))
    G[:6, :6] = np.eye(6)
    for name, (value, ratio, leader) in values.items():
        each = model.joints[model.getJointId(name)]
        q[each.idx_q] = value
        if leader >= 0:
            G[each.idx_v, 6 + leader] = ratio
    v = np.concatenate([np.zeros(6), np.linspace(0.5, 1.0, n)])
    M = pin.crba(model, data, q)
    M = np.triu(M) + np.triu(M, 1).T
    return G.T @ M @ G, G.T @ pin.rnea(model, data, q, G @ v, np.zeros(model.nv)), v


def agrees(vehicle, expected, joints):
    M, bias, v = expected
    still = (np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.asarray(joints))
    np.testing.assert_allclose(arrays.mass_matrix(vehicle, *still), M, rtol=0, atol=1e-13 * np.abs(M).max())
    found = arrays.inverse_dynamics(vehicle, *still, v, np.zeros_like(v), gravity=9.81)
    np.testing.assert_allclose(found, bias, rtol=0, atol=1e-13 * np.abs(bias).max())
