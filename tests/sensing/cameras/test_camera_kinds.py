"""Records of cameras and lidars: rays, axes, noise, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skyarm.algebra import Vec3
from skyarm.records.coerce import RecordError
from skyarm.sensing.cameras.camera_kinds import DepthCamera, DepthNoise, Lidar
from support.vehicles import hummingbird_arm


def test_pixels_reproject_by_the_intrinsics_to_their_columns_and_rows():
    camera = DepthCamera(width=7, height=4, field_of_view=1.1)
    fx, fy, cx, cy = camera.intrinsics()
    x, y, z = np.moveaxis(3.0 * camera.directions(), -1, 0)
    columns, rows = np.meshgrid(np.arange(7), np.arange(4))
    np.testing.assert_allclose(fx * x / z + cx, columns, atol=1e-12)
    np.testing.assert_allclose(fy * y / z + cy, rows, atol=1e-12)


def test_a_field_of_view_reaches_from_edge_to_edge():
    camera = DepthCamera(width=100, height=2, field_of_view=1.1)
    first, second = camera.directions()[0, :2, 0]
    edge = first - 0.5 * (second - first)
    assert np.arctan(-edge) == pytest.approx(0.55, abs=1e-12)


def test_optical_axes_lie_in_the_mount_as_ros_has_them():
    """z is ahead (x), x is right (-y), y is down (-z): REP 103."""
    R_LO = np.array([[*map(float, row)] for row in DepthCamera().rotation.rows])
    np.testing.assert_array_equal(R_LO.T, [[0, -1, 0], [0, 0, -1], [1, 0, 0]])
    turned = DepthCamera(rpy=Vec3(0.3, -0.4, 1.2))
    R = np.array([[*map(float, row)] for row in turned.rotation.rows])
    mount = Rotation.from_euler("ZYX", [1.2, -0.4, 0.3]).as_matrix()
    np.testing.assert_allclose(R, mount @ R_LO, atol=1e-15)


def test_rays_of_a_lidar_have_its_elevations_and_azimuths():
    lidar = Lidar(rows=3, columns=4, elevation=(-0.2, 0.4), azimuth=(-0.4, 0.4))
    R_MO = np.array([[*map(float, row)] for row in lidar.rotation.rows])
    x, y, z = np.moveaxis(lidar.directions() @ R_MO.T, -1, 0)
    np.testing.assert_allclose(x * x + y * y + z * z, 1.0, atol=1e-15)
    # first row at the top, first column at the left
    up = np.broadcast_to(np.array([[0.3], [0.1], [-0.1]]), (3, 4))
    np.testing.assert_allclose(np.arcsin(z), up, atol=1e-12)
    left = np.broadcast_to([0.3, 0.1, -0.1, -0.3], (3, 4))
    np.testing.assert_allclose(np.arctan2(y, x), left, atol=1e-12)


def test_a_full_turn_has_no_ray_twice_and_one_row_is_in_the_middle():
    lidar = Lidar(rows=1, columns=8, elevation=(-0.1, 0.3))
    ways = lidar.directions()[0]
    np.testing.assert_allclose(ways[:, 1], -np.sin(0.1), atol=1e-15)
    about = np.sort(np.arctan2(ways[:, 0], ways[:, 2]))
    np.testing.assert_allclose(np.diff(about), np.pi / 4, atol=1e-12)


def test_noise_grows_with_the_square_as_published_of_a_kinect():
    """Nguyen et al. 2012, eq. (5): 1.7 mm at 0.9 m, 14 mm at 3 m."""
    noise = DepthNoise(constant=0.0012, quadratic=0.0019, offset=0.4)
    deviations = noise.deviation(np.array([0.4, 0.9, 3.0]))
    np.testing.assert_allclose(deviations, [0.0012, 0.001675, 0.014044], atol=1e-9)


@pytest.mark.parametrize(
    ("kind", "fields", "words"),
    [
        (DepthCamera, {"link": "wrist"}, "link = 'wrist': must be one of base"),
        (DepthCamera, {"position": Vec3(0.0, 30.0, 0.0)}, "within 10 m of the link"),
    ],
)
def test_a_mount_that_the_vehicle_lacks_is_refused(kind, fields, words):
    with pytest.raises(RecordError, match=words):
        kind(**fields).require_vehicle(hummingbird_arm())
