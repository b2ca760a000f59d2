"""Joints and base that turn the tip against its reference: where the tip is then, by kinematics of the test."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.algebra import Vec3
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.laws.centroidal.joint_room import ends_of
from skyarm.control.laws.centroidal.tip_rotation import ArmTurn, TurnWeights, turned_reference
from skyarm.control.laws.centroidal.virtual_body import rotation_series
from skyarm.dynamics.kinematics import frame_pose
from thorough import sampled

DT = 0.005
HEXAROTOR = skyarm.load_vehicle("hexarotor_arm6")
OTHER = skyarm.load_vehicle("hexarotor12_arm5")
BENT = np.array([0.1, -0.6, -0.97, 0.2, -0.8, 0.3])
WEIGHTS = TurnWeights()


def still(n):
    return ArmTurn(joints=(0.0,) * n, joint_rates=(0.0,) * n)


def tip_of(vehicle, signals, k=0):
    """Place and rotation of the tip of a level base, world axes."""
    pose = frame_pose(vehicle, vehicle.frame(), [float(q.derivative(0)) for q in signals[4:]])
    heading = Rotation.from_euler("z", float(signals[3].derivative(0))).as_matrix()
    place = [float(signal.derivative(0)) for signal in signals[:3]] + heading @ [float(c) for c in pose.p]
    return place, heading @ np.array([[float(c) for c in row] for row in pose.R.rows])


def reference(t, posture, moving):
    """Base, yaw and joints at a time, with their derivatives."""

    def wave(size, pace, phase):
        parts = [np.sin, np.cos, lambda a: -np.sin(a), lambda a: -np.cos(a), np.sin]
        return Taylor.of_derivatives([float(size * pace**k * f(pace * t + phase)) for k, f in enumerate(parts)])

    size = 1.0 if moving else 0.0
    base = [wave(0.3 * size, 1.0, i) + 1.0 for i in range(3)]
    yaw = wave(0.5 * size, 0.7, 0.3) + (0.4 if moving else 0.0)
    return [*base, yaw, *(wave(0.1 * size, 1.3, i) + float(q) for i, q in enumerate(posture))]


def rotation_vector(t, size):
    """A rotation vector with two derivatives that comes to a wanted size smoothly, about an axis that turns."""
    axis = np.array([0.6 * np.cos(t), 0.6 * np.sin(t), 0.8])
    along = np.array([-0.6 * np.sin(t), 0.6 * np.cos(t), 0.0])
    bend = np.array([-0.6 * np.cos(t), -0.6 * np.sin(t), 0.0])
    s, sd, sdd = size * np.sin(t) ** 2, size * np.sin(2.0 * t), 2.0 * size * np.cos(2.0 * t)
    return s * axis, sd * axis + s * along, sdd * axis + 2.0 * sd * along + s * bend


def fly(vehicle, posture, size, moving, seconds=1.6):
    """Errors of the tip's place (m) and turning (rad) in each period, and the signals."""
    memory, rows, kept = still(vehicle.n), [], []
    for i in range(int(seconds / DT)):
        t = i * DT
        signals, theta = reference(t, posture, moving), rotation_vector(t, size)
        E = rotation_series(tuple(Vec3(*(float(c) for c in each)) for each in theta))
        memory, moved = turned_reference(vehicle, WEIGHTS, ends_of(vehicle), memory, E, signals, DT)
        (place, R), (wanted, R_d) = tip_of(vehicle, moved), tip_of(vehicle, signals)
        left = Rotation.from_matrix(R @ (Rotation.from_rotvec(theta[0]).as_matrix() @ R_d).T).as_rotvec()
        rows.append([*(place - wanted), *left])
        kept.append(moved)
    return np.array(rows), kept


@pytest.mark.parametrize("moving", [pytest.param(False, marks=pytest.mark.thorough), True])
def test_the_tip_is_turned_in_its_place_whatever_reference_and_heading_do(moving):
    found, kept = fly(HEXAROTOR, BENT, 0.5, moving)
    assert np.abs(found[:, :3]).max() < 1e-12  # the base takes what the arm leaves
    assert np.abs(found[:, 3:]).max() < 0.012  # of 0.5 rad; a period of 1 rad/s is 0.005
    base = np.array([[float(s.derivative(0)) for s in moved[:3]] for moved in kept])
    own = np.array([[float(s.derivative(0)) for s in reference(i * DT, BENT, moving)[:3]] for i in range(len(kept))])
    assert np.abs(base - own).max() < 0.02  # the arm takes most of it


@pytest.mark.thorough
def test_an_arm_of_five_joints_turns_the_tip_too_and_the_base_keeps_it_in_place():
    found, kept = fly(OTHER, [0.3, -0.5, -0.8, 0.6, 0.4][: OTHER.n], 0.3, moving=False)
    assert np.abs(found[:, :3]).max() < 1e-12
    assert np.abs(found[:, 3:]).max() < 0.03
    assert max(abs(float(kept[-1][i].derivative(0)) - float(kept[0][i].derivative(0))) for i in range(3)) > 1e-3


def test_signals_carry_their_own_derivatives():
    _, kept = fly(HEXAROTOR, BENT, 0.5, moving=True)
    values = np.array([[[float(s.derivative(k)) for k in range(3)] for s in moved] for moved in kept])
    slope = (values[2:, :, 0] - values[:-2, :, 0]) / (2.0 * DT)
    bend = (values[2:, :, 1] - values[:-2, :, 1]) / (2.0 * DT)
    assert np.abs(slope - values[1:-1, :, 1])[5:].max() < 0.02
    assert np.abs(bend - values[1:-1, :, 2])[5:].max() < 0.2


def test_a_reference_that_is_not_turned_is_left_as_it_is():
    found, kept = fly(HEXAROTOR, BENT, 0.0, moving=True, seconds=0.3)
    for i, moved in enumerate(kept):
        for a, b in zip(moved, reference(i * DT, BENT, moving=True), strict=True):
            assert [a.derivative(k) for k in range(5)] == pytest.approx([b.derivative(k) for k in range(5)], abs=1e-9)
    assert np.abs(found).max() < 1e-12


@pytest.mark.thorough
def test_no_joint_goes_further_than_a_share_of_its_way_to_a_limit():
    joints = [float(link.joint.upper) for link in HEXAROTOR.links]
    joints[4] = -0.8 + 0.5  # rad, of the wrist's pitch
    links = tuple(
        dataclasses.replace(link, joint=dataclasses.replace(link.joint, upper=upper))
        for link, upper in zip(HEXAROTOR.links, joints, strict=True)
    )
    vehicle, E = dataclasses.replace(HEXAROTOR, links=links), None
    memory, wrist = still(6), []
    signals = reference(0.0, BENT, moving=False)
    for i in range(400):
        angle = min(0.01 * i, 1.2)
        E = rotation_series((Vec3(0.0, angle, 0.0), Vec3(0.0, 2.0 if angle < 1.2 else 0.0, 0.0), Vec3(0.0, 0.0, 0.0)))
        memory, moved = turned_reference(vehicle, WEIGHTS, ends_of(vehicle), memory, E, signals, DT)
        wrist.append(float(moved[8].derivative(0)))
    assert max(wrist) == pytest.approx(-0.8 + 0.8 * 0.5, abs=0.01)
    place, _ = tip_of(vehicle, moved)
    assert place == pytest.approx(tip_of(vehicle, signals)[0], abs=1e-12)


def narrow(reach):
    """The hexarotor with limits of its wrist's pitch that stand evenly."""
    links = list(HEXAROTOR.links)
    links[4] = dataclasses.replace(links[4], joint=dataclasses.replace(links[4].joint, lower=-reach, upper=reach))
    return dataclasses.replace(HEXAROTOR, links=tuple(links))


def swinging(t, size, w=2.0 * np.pi):
    """The bent arm at rest, its wrist's pitch a sine."""
    signals = reference(0.0, BENT, moving=False)
    signals[8] = Taylor.of_derivatives([float(size * w**k * np.sin(w * t + 0.5 * np.pi * k)) for k in range(5)])
    return signals


@pytest.mark.parametrize("size", sampled([1.7, 1.89, 2.1], 3))
def test_a_moving_reference_that_nothing_turns_is_left_as_it_is_also_at_a_limit(size):
    """In limits of 1.9 rad at 100 Hz: 1.7 rad was cut where the limit's room counted as at rest."""
    vehicle, memory, dt = narrow(1.9), still(6), 0.01
    none = rotation_series((Vec3(0.0, 0.0, 0.0),) * 3)
    for i in range(200):
        signals = swinging(i * dt, size)
        memory, moved = turned_reference(vehicle, WEIGHTS, ends_of(vehicle), memory, none, signals, dt)
        for a, b in zip(moved, signals, strict=True):
            assert [a.derivative(k) for k in range(3)] == pytest.approx([b.derivative(k) for k in range(3)], abs=1e-9)


@pytest.mark.parametrize("sign", sampled([1.0, -1.0], 2))
def test_a_joint_that_is_turned_beside_a_moving_reference_comes_to_its_share_of_the_moving_way(sign):
    vehicle, memory = narrow(1.0), still(6)
    shares = []
    for i in range(400):
        angle = sign * min(0.005 * i, 1.6)
        rate = sign * 1.0 if abs(angle) < 1.6 else 0.0
        E = rotation_series((Vec3(0.0, angle, 0.0), Vec3(0.0, rate, 0.0), Vec3(0.0, 0.0, 0.0)))
        signals = swinging(i * DT, 0.5)
        memory, _ = turned_reference(vehicle, WEIGHTS, ends_of(vehicle), memory, E, signals, DT)
        told = swinging((i + 1) * DT, 0.5)[8].derivative(0)
        shares.append(float(memory.joints[4]) / (sign - told))
    assert max(shares) < 0.82
    assert shares[-100:] == pytest.approx([0.8] * 100, abs=0.02)


def test_a_batch_equals_a_loop():
    rng = np.random.default_rng(2)
    offsets, rates, thetas = rng.normal(size=(6, 4)) * 0.1, rng.normal(size=(6, 4)) * 0.1, rng.normal(size=(3, 4)) * 0.4
    signals = reference(0.7, BENT, moving=True)
    flat = (Vec3(0.3, 0.1, -0.2), Vec3(0.0, 0.5, 0.0))

    def one(dq, rate, theta):
        E = rotation_series((Vec3(*theta), *flat))
        return turned_reference(
            HEXAROTOR, WEIGHTS, ends_of(HEXAROTOR), ArmTurn(joints=dq, joint_rates=rate), E, signals, DT
        )

    memory, moved = one(tuple(offsets), tuple(rates), thetas)
    for i in range(4):
        alone, own = one(*(tuple(float(c) for c in each[:, i]) for each in (offsets, rates, thetas)))
        assert [each[i] for each in memory.joints] == pytest.approx([*alone.joints], rel=1e-12)
        for a, b in zip(moved, own, strict=True):
            assert [np.broadcast_to(a.derivative(k), 4)[i] for k in range(3)] == pytest.approx(
                [b.derivative(k) for k in range(3)], rel=1e-9, abs=1e-9
            )
