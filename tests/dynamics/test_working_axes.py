"""The axes in which recursions hold links, on arms with parallel, branched and turned
hinges and slides.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skyarm import dynamics
from skyarm.algebra import Mat3, Quaternion, Vec3, axis_rotation
from skyarm.dynamics import State
from skyarm.dynamics.kinematics import jacobian_columns, link_poses
from skyarm.dynamics.link_axes import members
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.vehicle.vehicle_records import Frame

ARM = load_vehicle("hexarotor_arm6")
X, Y, Z = Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)
SKEW = Vec3(0.6, 0.0, 0.8)
STRAIGHT = Mat3.identity()


def arm(axes, parents, slides=(), turned=()):
    """A tree with the links of the six-joint arm."""
    links = []
    for i, (axis, parent) in enumerate(zip(axes, parents, strict=True)):
        kind = "prismatic" if i in slides else "revolute"
        rotation = axis_rotation(Z, 0.3) if i in turned else Mat3.identity()
        joint = dataclasses.replace(
            ARM.links[i].joint, axis=axis, kind=kind, rotation=rotation
        )
        links.append(dataclasses.replace(ARM.links[i], joint=joint, parent=parent))
    return dataclasses.replace(ARM, links=tuple(links), frames=(), end_effector="")


TREES = {
    "parallel": arm([Y, Y, Y, Y], [-1, 0, 1, 2]),
    "mixed": arm([Z, Y, Y, Z, Y, Z], [-1, 0, 1, 2, 3, 4]),
    "branched": arm([Y, Y, X, Y, Y], [-1, 0, 0, 1, 2]),
    "skew": arm([SKEW, SKEW, SKEW], [-1, 0, 1]),
    "slide between": arm([Y, Y, Y, Y], [-1, 0, 1, 2], slides=(1,)),
    "turned between": arm([Y, Y, Y], [-1, 0, 1], turned=(1,)),
    "opposite": arm([Y, Vec3(0, -1, 0), Y], [-1, 0, 1]),
}


@pytest.mark.parametrize("name", TREES)
def test_the_mass_matrix_gives_the_kinetic_energy_of_every_tree(name):
    """Energy comes from positions in the world, differentiated link by link; only
    rounding is left.
    """
    vehicle = TREES[name]
    rng = np.random.default_rng(5)
    for _ in range(3):
        q, v = rng.normal(size=vehicle.n), rng.normal(size=6 + vehicle.n)
        attitude = Quaternion(*rng.normal(size=4).tolist()).normalized()
        state = State(
            position=Vec3(0.0, 0.0, 0.0),
            quaternion=attitude,
            velocity=Vec3(*v[:3].tolist()),
            rate=Vec3(*v[3:6].tolist()),
            joints=tuple(q.tolist()),
            joint_rates=tuple(v[6:].tolist()),
        )
        M = np.array(
            dynamics.mass_matrix(vehicle, attitude.rotation(), q.tolist()), dtype=float
        )
        assert 0.5 * v @ M @ v == pytest.approx(
            dynamics.kinetic_energy(vehicle, state), rel=1e-13
        )


def test_parallel_hinges_share_their_axes():
    places = [
        member.place for member in members(TREES["parallel"], (0.1, 0.2, 0.3, 0.4))
    ]
    assert all(place.R == STRAIGHT for place in places)
    turned = members(TREES["turned between"], (0.1, 0.2, 0.3))
    assert turned[1].place.R != STRAIGHT


@pytest.mark.parametrize("name", TREES)
def test_a_jacobian_has_the_bits_of_the_poses_of_its_links_unless_told_otherwise(name):
    """Its angular part is the joint's axis in the pose; hinges summed have other
    roundings.
    """
    vehicle = TREES[name]
    frame = Frame(name="end", link=vehicle.n - 1, position=Vec3(0.1, -0.2, 0.3))
    for q in np.random.default_rng(5).normal(size=(4, vehicle.n)).tolist():
        for summed in (None, False, True):
            given = {} if summed is None else {"summed": summed}
            poses, columns = (
                link_poses(vehicle, q, **given),
                jacobian_columns(vehicle, frame, q, **given),
            )
            for pose, link, column in zip(poses, vehicle.links, columns, strict=True):
                if link.joint.turns and any(column.angular):
                    assert [*column.angular] == [*pose.R.apply(link.joint.axis)]


@pytest.mark.parametrize("name", TREES)
def test_parallel_hinges_may_be_turned_by_the_sums_of_their_angles(name):
    vehicle = TREES[name]
    frame = Frame(name="end", link=vehicle.n - 1, position=Vec3(0.1, -0.2, 0.3))
    for q in np.random.default_rng(3).normal(size=(3, vehicle.n)).tolist():
        for one, other in zip(
            link_poses(vehicle, q), link_poses(vehicle, q, summed=True), strict=True
        ):
            np.testing.assert_allclose(
                np.array(other.R, dtype=float), np.array(one.R, dtype=float), atol=1e-15
            )
            np.testing.assert_allclose(np.array(other.p), np.array(one.p), atol=1e-15)
        columns = zip(
            *(jacobian_columns(vehicle, frame, q, summed=s) for s in (False, True)),
            strict=True,
        )
        for one, other in columns:
            np.testing.assert_allclose(
                np.array(other.linear), np.array(one.linear), atol=2e-15
            )
