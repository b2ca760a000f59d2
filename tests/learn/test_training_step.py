"""The training of the learned law's network: Adam as its paper writes it, and what a model leaves out of a flight."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import skyarm
from logs_synthetic import synthetic_log
from skyarm.control.model import Model
from skyarm.dynamics import array_front as arrays
from skyarm.learn.samples import residuals
from skyarm.learn.training import Trainer

BETA = (0.9, 0.999)


def loss(parts, x, y):
    """Mean squared error of a perceptron with tanh between its layers; complex numbers may pass."""
    value = x.astype(complex)
    for i in range(0, len(parts), 2):
        value = value @ parts[i] + parts[i + 1]
        if i + 2 < len(parts):
            value = np.tanh(value)
    return ((value - y) ** 2).sum() / y.size


def gradient(parts, x, y):
    """By complex steps, exact to rounding."""
    found = []
    for i, part in enumerate(parts):
        slope = np.empty(part.shape)
        for place in np.ndindex(part.shape):
            moved = [each.astype(complex) for each in parts]
            moved[i][place] += 1e-30j
            slope[place] = loss(moved, x, y).imag / 1e-30
        found.append(slope)
    return found


@pytest.mark.parametrize("sizes", [(3, 2), (3, 5, 2), (3, 4, 5, 2)])
def test_steps_are_those_of_adam_as_published(sizes):
    """Kingma, Ba 2015, algorithm 1, with the gradient by complex steps: five steps on changing batches."""
    rng = np.random.default_rng(3)
    trainer = Trainer(sizes, np.random.default_rng(4))
    parts = [part.copy() for part in trainer.parts]
    m, v = ([np.zeros_like(part) for part in parts] for _ in range(2))
    for t in range(1, 6):
        x, y, rate = rng.normal(size=(7, sizes[0])), rng.normal(size=(7, sizes[-1])), 0.1 / t
        g = gradient(parts, x, y)
        told = loss(parts, x, y).real
        for i, slope in enumerate(g):
            m[i] = BETA[0] * m[i] + (1.0 - BETA[0]) * slope
            v[i] = BETA[1] * v[i] + (1.0 - BETA[1]) * slope**2
            parts[i] = parts[i] - rate * (m[i] / (1.0 - BETA[0] ** t)) / (np.sqrt(v[i] / (1.0 - BETA[1] ** t)) + 1e-8)
        assert trainer.step(x, y, rate) == pytest.approx(told, rel=1e-12)
        for ours, theirs in zip(trainer.parts, parts, strict=True):
            np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-9)


def test_what_a_model_leaves_out_is_found_sample_by_sample():
    """At each instant alone, rotated by SciPy: force and torque that the rotors' thrust and drag do not give."""
    vehicle = skyarm.load_vehicle("hummingbird_arm2")
    rng = np.random.default_rng(8)
    log, count = synthetic_log("case1", "rigid_body", "CT", seconds=0.03), 6
    xyzw = Rotation.random(count, random_state=1).as_quat()
    log = dataclasses.replace(
        log,
        position=rng.normal(size=(count, 3)),
        quaternion=xyzw[:, [3, 0, 1, 2]],
        velocity=rng.normal(size=(count, 3)),
        rate=rng.normal(size=(count, 3)),
        joints=rng.normal(size=(count, 2)),
        joint_rates=rng.normal(size=(count, 2)),
        efforts=rng.normal(size=(count, 2)),
        rotor_speeds=rng.uniform(300.0, 700.0, size=(count, 4)),
    )
    found = residuals(Model(vehicle=vehicle, gravity=9.81), log)
    assert found.shape == (count - 1, 8)
    velocity = np.hstack([log.velocity, log.rate, log.joint_rates])
    for k in range(count - 1):
        slope = (velocity[k + 1] - velocity[k]) / 0.005
        needed = arrays.inverse_dynamics(
            vehicle, log.position[k], log.quaternion[k], log.joints[k], velocity[k], slope, gravity=9.81
        )
        push, turn = np.zeros(3), np.zeros(3)
        for rotor, speed in zip(vehicle.rotors, 0.5 * (log.rotor_speeds[k] + log.rotor_speeds[k + 1]), strict=True):
            thrust = np.array([*rotor.axis], dtype=float) * float(rotor.thrust_coefficient) * speed**2
            push += thrust
            spin = float(rotor.moment_coefficient * rotor.thrust_coefficient) * speed**2
            turn += np.cross(np.array([*rotor.position], dtype=float), thrust)
            turn -= float(rotor.direction) * spin * np.array([*rotor.axis], dtype=float)
        R = Rotation.from_quat(xyzw[k]).as_matrix()
        np.testing.assert_allclose(found[k, :3], R.T @ needed[:3] - push, atol=1e-9)
        np.testing.assert_allclose(found[k, 3:6], needed[3:6] - turn, atol=1e-9)
        np.testing.assert_allclose(found[k, 6:], needed[6:] - log.efforts[k], atol=1e-9)
