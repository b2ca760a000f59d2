"""The 8x8 form against Pinocchio and against skyarm's own composite-body algorithm."""

import dataclasses

import numpy as np
import pytest
from lagrangian_twin import rotation, states, velocity_jacobians
from planar_vehicles import planar_vehicle, quaternion_wxyz

from skyarm.algebra import Sym3, Vec3
from skyarm.dynamics import array_front as arrays
from skyarm.vehicle.linkage import Body
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.vehicle.vehicle_records import Vehicle
from support import euler_lagrange as el

Q, QD = states(20, seed=4)


@pytest.fixture(scope="module")
def pin():
    return pytest.importorskip("pinocchio")


@pytest.fixture(scope="module")
def model(pin):
    """Free flyer and two y joints built by hand; the links have I_yy only, as Table 1
    gives them.
    """
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -9.81])
    base = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    model.appendBodyToJoint(
        base,
        pin.Inertia(0.716, np.zeros(3), np.diag([7e-3, 7e-3, 1.2e-2])),
        pin.SE3.Identity(),
    )
    rod = pin.Inertia(0.04, np.array([0.0, 0.0, -0.075]), np.diag([0.0, 7.5e-5, 0.0]))
    tip = pin.Inertia(0.01, np.array([0.0, 0.0, -0.15]), np.zeros((3, 3)))
    first = model.addJoint(base, pin.JointModelRY(), pin.SE3.Identity(), "joint1")
    model.appendBodyToJoint(first, rod, pin.SE3.Identity())
    second = model.addJoint(
        first,
        pin.JointModelRY(),
        pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.15])),
        "joint2",
    )
    model.appendBodyToJoint(second, rod, pin.SE3.Identity())
    model.appendBodyToJoint(second, tip, pin.SE3.Identity())
    return model


def body_velocity_map(q):
    """T of nu = T(q) qd, nu = [v_B, w_B, joint rates] as Pinocchio's free flyer has it;
    complex q for its rate.
    """
    T = np.zeros((8, 8), dtype=np.asarray(q).dtype)
    phi, theta = q[3], q[4]
    T[:3, :3] = rotation(q).T
    T[3:6, 3:6] = [
        [1, 0, -np.sin(theta)],
        [0, np.cos(phi), np.sin(phi) * np.cos(theta)],
        [0, -np.sin(phi), np.cos(phi) * np.cos(theta)],
    ]
    T[6:, 6:] = np.eye(2)
    return T


def pinocchio_terms(pin, model, q, qd):
    data = model.createData()
    quaternion = pin.Quaternion(rotation(q)).coeffs()
    configuration = np.concatenate([q[:3], quaternion, q[6:]])
    T = body_velocity_map(q)
    T_rate = body_velocity_map(q + 1e-30j * qd).imag / 1e-30
    M = pin.crba(model, data, configuration)
    M = np.triu(M) + np.triu(M, 1).T
    bias = pin.nonLinearEffects(model, data, configuration, T @ qd)
    return T.T @ M @ T, T.T @ (M @ T_rate @ qd + bias)


def test_mass_matrix_is_pinocchios_mapped_to_euler_rates(pin, model):
    for q, qd in zip(Q, QD, strict=True):
        np.testing.assert_allclose(
            el.mass_matrix(q), pinocchio_terms(pin, model, q, qd)[0], atol=1e-15
        )


def test_coriolis_and_gravity_are_pinocchios_bias_mapped_to_euler_rates(pin, model):
    for q, qd in zip(Q, QD, strict=True):
        found = el.coriolis_matrix(q, qd) @ qd + el.gravity_vector(q)
        # forces up to 8 N; the map's rate carries |qd|^2 |v| = 30 of intermediate size
        np.testing.assert_allclose(
            found, pinocchio_terms(pin, model, q, qd)[1], atol=2e-14
        )


def test_mass_matrix_is_that_of_the_tree_mapped_to_euler_rates():
    vehicle = planar_vehicle()
    for q in Q:
        T = np.eye(8)
        T[3:6, 3:6] = velocity_jacobians(q)[1][:, 3:6]
        M = T.T @ arrays.mass_matrix(vehicle, q[:3], quaternion_wxyz(q), q[6:]) @ T
        np.testing.assert_allclose(el.mass_matrix(q), M, atol=1e-15)


def test_motion_is_that_of_the_tree():
    """Same torques, same accelerations: M qdd + C qd + G of one is the inverse dynamics
    of the other.
    """
    vehicle = planar_vehicle()
    for q, qd in zip(Q, QD, strict=True):
        qdd = np.linspace(-2.0, 3.0, 8)
        T = np.eye(8)
        T[3:6, 3:6] = velocity_jacobians(q)[1][:, 3:6]
        T_rate = np.zeros((8, 8))
        T_rate[3:6, 3:6] = body_velocity_map(q + 1e-30j * qd).imag[3:6, 3:6] / 1e-30
        force = arrays.inverse_dynamics(
            vehicle, q[:3], quaternion_wxyz(q), q[6:], T @ qd, T @ qdd + T_rate @ qd
        )
        ours = (
            el.mass_matrix(q) @ qdd
            + el.coriolis_matrix(q, qd) @ qd
            + el.gravity_vector(q)
        )
        np.testing.assert_allclose(ours, T.T @ force, atol=2e-14)


@pytest.mark.parametrize("tip", [0.01, 0.0, 0.2])
def test_parameters_of_a_planar_vehicle_give_its_own_dynamics(tip):
    vehicle = planar_vehicle(tip)
    par = el.parameters_of(vehicle)
    assert par.mass == pytest.approx(0.796 + tip, abs=1e-15)
    assert (par.L1, par.L2) == (0.15, 0.15)
    # the tip, joined to link 2 in the vehicle, is found again
    assert (par.m2, par.lc2, par.me, par.I2yy) == pytest.approx(
        (0.04, 0.075, tip, 7.5e-5), abs=1e-15
    )
    for q, qd in zip(Q[:5], QD[:5], strict=True):
        T = np.eye(8)
        T[3:6, 3:6] = velocity_jacobians(q)[1][:, 3:6]
        M = T.T @ arrays.mass_matrix(vehicle, q[:3], quaternion_wxyz(q), q[6:]) @ T
        np.testing.assert_allclose(el.mass_matrix(q, parameters=par), M, atol=1e-15)
        if tip == el.TABLE_1.me:
            table = el.coriolis_matrix(q, qd)
            np.testing.assert_allclose(
                el.coriolis_matrix(q, qd, parameters=par), table, atol=1e-15
            )


def test_the_shipped_model_of_the_paper_has_the_parameters_of_table_1():
    found = dataclasses.asdict(el.parameters_of(load_vehicle("hummingbird_arm2")))
    table = dataclasses.asdict(el.TABLE_1)
    inertia = found.pop("Ib"), table.pop("Ib")
    assert inertia[0] == pytest.approx(inertia[1], abs=1e-17)
    assert found == pytest.approx(table, abs=1e-16)


def changed(vehicle, index, **joint):
    links = list(vehicle.links)
    links[index] = dataclasses.replace(
        links[index], joint=dataclasses.replace(links[index].joint, **joint)
    )
    return dataclasses.replace(vehicle, links=tuple(links))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda v: changed(v, 0, axis=Vec3(1, 0, 0)),
            "joint 'shoulder', allowed revolute about",
        ),
        (
            lambda v: changed(v, 1, axis=Vec3(0, -1, 0)),
            "joint 'elbow', allowed revolute about",
        ),
        (lambda v: changed(v, 0, position=Vec3(0, 0, -0.02)), "joint 1 position"),
        (
            lambda v: changed(v, 1, position=Vec3(0.01, 0, -0.15)),
            "joint 2 position.x and .y",
        ),
        (
            lambda _: planar_vehicle(rod=Sym3(7.5e-5, 7.5e-5, 1e-7)),
            "link 'upper' inertia.zz",
        ),
        (
            lambda _: planar_vehicle(rod=Sym3(7.5e-5, 7.5e-5, 0)),
            "link 'upper' inertia.xx",
        ),
        (lambda v: Vehicle(name="planar", base=v.base), "0 joints, allowed 2"),
        (
            lambda v: Vehicle(
                name="planar",
                base=Body(mass=1.0, com=Vec3(0, 0, 1e-3), inertia=v.base.inertia),
                links=v.links,
            ),
            "base.com",
        ),
    ],
)
def test_a_vehicle_that_is_not_the_papers_is_refused_by_field(make, message):
    with pytest.raises(
        ValueError, match="vehicle 'planar' is not the paper's planar arm"
    ) as error:
        el.parameters_of(make(planar_vehicle()))
    assert message in str(error.value)
