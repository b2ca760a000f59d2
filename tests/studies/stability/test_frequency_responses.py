"""Frequency responses, the gains read from them, and where a loop is cut."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hand_made import coupled
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.algebra import ZERO3, Quaternion
from skyarm.dynamics.actuators.rotor import rotor_force
from skyarm.studies.stability import margins
from skyarm.studies.stability.closed_loop import close_loop, spectral_radius
from skyarm.studies.stability.disk_margins import Response, frequency_grid
from skyarm.studies.stability.loop_channels import vehicle_channels


def test_a_response_is_that_of_its_modes():
    rng = np.random.default_rng(7)
    modes, vectors = rng.uniform(-0.9, 0.9, 9), rng.normal(size=(9, 9))
    A, B, C = (
        vectors @ np.diag(modes) @ np.linalg.inv(vectors),
        rng.normal(size=(9, 3)),
        rng.normal(size=(2, 9)),
    )
    w = np.linspace(0.1, 600.0, 200)
    residues = np.einsum("om,mi->moi", C @ vectors, np.linalg.solve(vectors, B))
    wanted = np.einsum(
        "moi,fm->foi", residues, 1.0 / (np.exp(1j * w * 0.005)[:, None] - modes)
    )
    np.testing.assert_allclose(
        Response(A, B, C, 0.005).at(w), wanted, rtol=1e-9, atol=1e-9
    )


def test_the_grid_sees_a_faint_resonance():
    """Of a damping of 1e-4, between two frequencies that are 7 per cent apart."""
    rate = complex(-0.005, 50.0)
    grid = frequency_grid(np.exp(np.array([rate, rate.conjugate()]) * 0.005), 0.005)
    assert np.sum(np.abs(grid - 50.0) <= 0.0051) >= 5
    assert grid[-1] == pytest.approx(math.pi / 0.005)


@pytest.mark.parametrize("seed", [3, 4, 9])
def test_gains_at_the_edge_are_where_eigenvalues_leave_the_circle(seed):
    loop = coupled(seed)
    found, as_it_is = margins(loop, measured=False), close_loop(loop)
    if found.radius > 1.0:
        assert found.rotor_gain == found.joint_gain == (1.0, 1.0)
        return

    def radius_at(places, k):
        factors = np.ones(3)
        factors[places] = k
        return spectral_radius(as_it_is.matrix(factors))

    for places, edges in (([0, 1], found.rotor_gain), ([2], found.joint_gain)):
        for edge in edges:
            if 0.0 < edge < math.inf:
                assert radius_at(places, edge) == pytest.approx(1.0, abs=1e-5)
        inside = np.geomspace(max(edges[0], 0.01), min(edges[1], 100.0), 40)[1:-1]
        assert all(radius_at(places, k) <= 1.0 for k in inside)


@pytest.fixture(scope="module")
def cut():
    """Channels of a hexarotor with an arm, tilted, its rotors at speeds of their
    own.
    """
    vehicle = skyarm.load_vehicle("hexarotor_arm6")
    speeds = np.linspace(400.0, 500.0, 6)
    x, y, z, w = Rotation.from_rotvec([0.3, -0.2, 0.9]).as_quat()
    return (
        vehicle,
        speeds,
        Quaternion(w, x, y, z),
        vehicle_channels(vehicle, speeds, Quaternion(w, x, y, z)),
    )


def test_channels_read_what_they_enter_and_pushes_nothing_of_one_another(cut):
    *_, channels = cut
    assert len(channels) == 6 + 4 + 6 + 5 * 3 + 6 + 6 + 6
    for each in channels:
        assert each.reads @ each.enters == pytest.approx(1.0, abs=1e-12)
    pushes = [each for each in channels if each.group == "pushes"]
    assert [each.name for each in pushes] == [
        "roll torque",
        "pitch torque",
        "yaw torque",
        "thrust",
    ]
    both = np.array([[a.reads @ b.enters for b in pushes] for a in pushes])
    np.testing.assert_allclose(both, np.eye(4), atol=1e-12)


def test_a_push_is_what_the_rotors_of_the_plant_make_of_its_commands(cut):
    vehicle, speeds, _, channels = cut

    def wrench(at):
        parts = [
            rotor_force(rotor, w, ZERO3)
            for rotor, w in zip(vehicle.rotors, at, strict=True)
        ]
        return np.array([[*part.torque, part.force.z] for part in parts]).sum(axis=0)

    for place, each in enumerate(c for c in channels if c.group == "pushes"):
        step = 1e-4 * each.enters[:6] / np.abs(each.enters[:6]).max()
        slope = wrench(speeds + step) - wrench(speeds - step)
        assert abs(slope[place]) > 0.0
        assert np.abs(np.delete(slope, place)).max() < 1e-7 * abs(slope[place])


def test_an_attitude_is_cut_in_rotations_about_the_base_s_axes(cut):
    _, _, q, channels = cut
    turns = [each for each in channels if each.group == "attitude"]
    base = Rotation.from_quat([q.x, q.y, q.z, q.w])
    for axis, each in enumerate(turns):
        (x, y, z, w), v = (
            (base * Rotation.from_rotvec(1e-6 * np.eye(3)[axis])).as_quat(),
            each.enters[4:8],
        )
        moved = (np.array([w, x, y, z]) - np.array([*q])) / 1e-6
        np.testing.assert_allclose(v, moved, atol=1e-5)
        assert not np.delete(each.enters, range(4, 8)).any()


def test_a_tilted_hexarotor_pushes_sideways_too():
    vehicle = skyarm.load_vehicle("tilted_hexarotor")

    def pushes(speed):
        channels = vehicle_channels(
            vehicle, [speed] * 6, Quaternion(1.0, 0.0, 0.0, 0.0)
        )
        return [channel.name for channel in channels if channel.group == "pushes"]

    assert pushes(500.0)[-2:] == ["forward force", "sideways force"]
    # rotors that stand still make no force of a small change
    assert pushes(0.0) == []
