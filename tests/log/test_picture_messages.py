"""Pictures as messages: a reader that shares no code with us finds those of the log,
and a visual-inertial estimator could use them.
"""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from functools import cache
from itertools import pairwise, product
from pathlib import Path

import numpy as np
import pytest
from messages_by_rosbags import Rotation, by_rosbags, composed
from scipy.interpolate import CubicSpline

import skyarm
from skyarm.links.ros import RosLink
from skyarm.log.ros.pictures import FLAT, ROUND, cameras_of
from skyarm.simulate.session import Session
from support.peers import MemoryNode

EXAMPLES = Path(__file__).parents[2] / "examples"

SIZE, PLACE, YAW = [0.3, 0.24, 0.2], [0.7, 0.05, 0.95], 0.75
"""Crate before the camera: edges (m), middle (m) and yaw (rad)."""

EYE, AROUND = "/sensors/eye_1/", "/sensors/around/"


@cache
def scenario():
    tables = tomllib.loads((EXAMPLES / "see_with_the_wrist.toml").read_text("utf-8"))
    tables |= {"duration": 0.43, "rates": {"control": 1000.0}}
    tables["world"]["surfaces"].append(
        {
            "name": "crate",
            "shape": "box",
            "size": SIZE,
            "position": PLACE,
            "angles": [0.0, 0.0, YAW],
        }
    )
    tables["reference"]["base"] |= {
        "x": [{"kind": "sine", "amplitude": 0.03, "frequency_hz": 1.0}],
        "y": [{"kind": "sine", "amplitude": 0.02, "frequency_hz": 0.8}],
    }
    tables["initial"] = {"position": [0.0, 0.0, 1.35]}
    tables["sensors"] = {
        "Eye_1": {
            "kind": "depth_camera",
            "position": [0.08, 0.01, -0.02],
            "rpy": [0.1, 0.5, -0.05],
            "width": 48,
            "height": 40,
            "latency": 0.05,
        },
        "around": {"kind": "lidar", "rows": 3, "columns": 20, "frequency": 5.0},
        "imu": {
            "kind": "imu",
            "frequency": 1000.0,
            "gyro": {},
            "accelerometer": {},
        },
    }
    return skyarm.scenario_from(tables, EXAMPLES)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    log = skyarm.run(scenario())
    return skyarm.save_log(log, tmp_path_factory.mktemp("seen") / "flight.mcap")


@pytest.fixture(scope="module")
def read(path):
    return skyarm.load_log(path), *by_rosbags(path)


def seconds(message):
    stamp = message.header.stamp
    return stamp.sec + 1e-9 * stamp.nanosec


def vector(xyz):
    return np.array([xyz.x, xyz.y, xyz.z])


def turn(xyzw):
    return Rotation.from_quat([xyzw.x, xyzw.y, xyzw.z, xyzw.w])


def image(message):
    kind = {"32FC1": "<f4", "8UC1": "u1", "16UC1": "<u2"}[message.encoding]
    rows = message.data.reshape(message.height, message.step)
    return rows.view(kind)


def test_images_and_clouds_are_the_pictures_of_the_log(read):
    log, found, same = read
    assert same == sum(len(messages) for _, _, messages in found.values())
    frames = [each for each in log.frames("Eye_1") if each.time + 0.05 <= log.time[-1]]
    for kind, name in (("Image", "depth"), ("Image", "segmentation")):
        assert found[EYE + name][0] == f"sensor_msgs/msg/{kind}"
    _, arrived, depths = found[EYE + "depth"]
    # each stamp is the instant of the picture, which arrives its latency later
    assert [seconds(each) for each in depths] == pytest.approx(
        [each.time for each in frames]
    )
    assert arrived == [round(1e9 * (each.time + 0.05)) for each in frames]
    (labels,) = found[EYE + "labels"][2]
    names = {each.class_id: each.class_name for each in labels.class_map}
    for frame, depth, segments, pose in zip(
        frames,
        depths,
        found[EYE + "segmentation"][2],
        found[EYE + "pose"][2],
        strict=True,
    ):
        assert np.array_equal(image(depth), frame.depth.astype("f4"))
        seen = [[names[each] for each in row] for row in image(segments).tolist()]
        assert seen == [[frame.names[i] for i in row] for row in frame.segment]
        assert np.array_equal(vector(pose.pose.position), frame.position)
    assert {"crate", "wall"} <= set(np.ravel(seen))
    clouds = found[AROUND + "points"][2]
    for cloud, frame in zip(clouds, log.frames("around"), strict=True):
        kinds = {7: "<f4", 6: "<u4"}
        at = [(each.name, kinds[each.datatype], each.offset) for each in cloud.fields]
        names, formats, offsets = zip(*at, strict=True)
        point = np.dtype(
            {
                "names": names,
                "formats": formats,
                "offsets": offsets,
                "itemsize": cloud.point_step,
            }
        )
        assert cloud.row_step == cloud.width * cloud.point_step
        points = cloud.data.view(point).reshape(cloud.height, cloud.width)
        for axis, values in zip("xyz", np.moveaxis(frame.points(), -1, 0), strict=True):
            assert np.array_equal(points[axis], values.astype("f4"), equal_nan=True)
        assert np.array_equal(points["segment"], frame.segment)
        assert cloud.is_dense == np.isfinite(points["x"]).all()


def test_transforms_lead_to_the_optical_frames(read):
    _, found, _ = read
    still = found["/tf_static"][2][0].transforms
    poses = {seconds(each): each for each in found[EYE + "pose"][2]}
    for message in found["/tf"][2]:
        tree = {each.child_frame_id: each for each in [*message.transforms, *still]}
        pose = poses.get(seconds(message.transforms[0]))
        if pose is not None:
            R, p = composed(tree, "eye_1_optical_frame")
            assert abs(p - vector(pose.pose.position)).max() < 1e-12
            assert abs(R - turn(pose.pose.orientation).as_matrix()).max() < 1e-12
    assert {each.header.frame_id for each in poses.values()} == {"world"}
    frames = [found[EYE + name][2][0] for name in ("depth", "camera_info")]
    assert {each.header.frame_id for each in frames} == {"eye_1_optical_frame"}


def test_the_integrated_gyro_is_the_rotation_between_pictures(read):
    _, found, _ = read
    units, poses = found["/sensors/imu"][2], found[EYE + "pose"][2]
    rate = CubicSpline(
        [seconds(each) for each in units],
        [vector(each.angular_velocity) for each in units],
    )
    still = {each.child_frame_id: each for each in found["/tf_static"][2][0].transforms}
    R_BC = turn(still["eye_1_optical_frame"].transform.rotation)
    apart = np.sqrt(3.0) / 6.0
    for before, after in pairwise(poses):
        start, stop = seconds(before), seconds(after)
        step = (stop - start) / 100
        begin = start + step * np.arange(100)
        # Magnus expansion of fourth order, Gauss points
        first, second = (rate(begin + step * (0.5 + each)) for each in (-apart, apart))
        turns = 0.5 * step * (first + second)
        turns += 0.5 * apart * step**2 * np.cross(first, second)
        R = Rotation.identity()
        for each in Rotation.from_rotvec(turns):
            R = R * each
        R_0, R_1 = (
            turn(each.pose.orientation) * R_BC.inv() for each in (before, after)
        )
        assert (R_0.inv() * R_1).magnitude() > 0.01
        assert (R_0 * R * R_1.inv()).magnitude() < 1e-6


def test_corners_that_three_faces_meet_in_are_reprojected(read):
    _, found, _ = read
    (labels,) = found[EYE + "labels"][2]
    crate = next(
        i for i, each in enumerate(labels.class_map) if each.class_name == "crate"
    )
    half = 0.5 * np.array(SIZE)
    corners = Rotation.from_euler("z", YAW).apply(
        [half * signs for signs in product((-1.0, 1.0), repeat=3)]
    )
    for depth, segments, info, pose in zip(
        *(
            found[EYE + name][2]
            for name in ("depth", "segmentation", "camera_info", "pose")
        ),
        strict=True,
    ):
        K = info.k.reshape(3, 3)
        R_WC = turn(pose.pose.orientation)
        p_C = R_WC.inv().apply(corners + PLACE - vector(pose.pose.position))
        known = (p_C / p_C[:, 2:]) @ K.T
        v, u = np.indices((info.height, info.width))
        rays = np.stack([u, v, np.ones_like(u)], -1) @ np.linalg.inv(K).T
        points = rays * image(depth)[..., None].astype(float)
        planes = []
        # every three neighbours in a face have its plane
        inside = image(segments) == crate
        for i, j in np.argwhere(inside[:-1, :-1] & inside[1:, :-1] & inside[:-1, 1:]):
            at = points[i, j]
            normal = np.cross(points[i + 1, j] - at, points[i, j + 1] - at)
            normal /= np.linalg.norm(normal)
            planes.append([*normal, normal @ at])
        planes = np.array(planes)
        faces = []
        for plane in planes:
            members = planes[np.abs(planes - plane).max(axis=1) < 1e-3]
            if len(members) > 20 and all(
                np.abs(plane - face).max() > 0.1 for face in faces
            ):
                faces.append(np.median(members, axis=0))
        faces = np.array(faces)
        assert len(faces) == 3
        corner = np.linalg.solve(faces[:, :3], faces[:, 3])
        pixel = K @ (corner / corner[2])
        assert np.linalg.norm(known - pixel, axis=1).min() < 0.1


def test_live_messages_are_those_of_the_file_to_the_byte(path):
    reader = pytest.importorskip("mcap.reader", reason="needs the extra 'test'")
    wanted = {}
    with path.open("rb") as file:
        for _, channel, message in reader.make_reader(file).iter_messages():
            wanted.setdefault(channel.topic, []).append(message.data)
    node = MemoryNode()
    link = RosLink(Session(scenario()), node)
    for _ in range(140):
        link.step()
    seen = [each for each in wanted if each.startswith((EYE, AROUND))]
    assert len(seen) == 7
    assert EYE + "labels" in node.latched
    for topic in seen:
        # that of 0.1 s has not arrived yet
        assert node.sent[topic] == wanted[topic][:1], topic


@pytest.mark.parametrize("agent", [[], {"sensors": 3}, {"sensors": ["eye"]}])
def test_a_damaged_scenario_has_no_cameras(read, agent):
    log, *_ = read
    info = log.info | {"scenario_record": {"agents": {"vehicle": agent}}}
    assert cameras_of(replace(log, info=info)) == {}


def test_the_shipped_layout_names_topics_of_its_example():
    layout = json.loads(
        (EXAMPLES / "files" / "foxglove_layout.json").read_text("utf-8")
    )
    seen = skyarm.load_scenario(EXAMPLES / "see_with_the_wrist.toml").agent.cameras
    fields = {name: FLAT if each.intrinsics() else ROUND for name, each in seen.items()}
    topics = {
        f"/sensors/{name}/{last}": kind
        for name, own in fields.items()
        for last, (kind, _) in own.items()
    }
    panels = layout["configById"]
    clouds = panels.pop("3D!flight")["topics"].keys() - {"/vehicle"}
    assert [topics[each] for each in clouds] == ["sensor_msgs/PointCloud2"]
    for panel in panels.values():
        mode = panel["imageMode"]
        assert topics[mode["imageTopic"]] == "sensor_msgs/Image"
        assert topics[mode["calibrationTopic"]] == "sensor_msgs/CameraInfo"
    row = layout["layout"]
    named = {row["first"], row["second"]["first"], row["second"]["second"]}
    assert named == {"3D!flight", *panels}


def test_every_type_is_one_of_dds():
    pytest.importorskip("cyclonedds", reason="needs the extra 'ros'")
    from skyarm.links.ros.ros2_node import DdsTypes
    from skyarm.log.ros.messages import DEFINITIONS

    types = DdsTypes(DEFINITIONS)
    for kind in ("Image", "CameraInfo", "PointCloud2"):
        made = types.of(f"sensor_msgs/{kind}")
        assert made.__idl_typename__ == f"sensor_msgs::msg::dds_::{kind}_"
