"""Files of other programs that a vehicle is exported to: read back as the same, and as
MuJoCo, Pinocchio read them.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skyarm.algebra import ZERO3, Mat3, Motion, Vec3
from skyarm.dynamics.composite_body import mass_matrix
from skyarm.dynamics.newton_euler import inverse_dynamics
from skyarm.plant.mujoco_model import joint_addresses
from skyarm.records.registry import find, names, register
from skyarm.vehicle import Vehicle, VehicleError
from skyarm.vehicle.linkage import Follower
from skyarm.vehicle.vehicle_files import list_vehicles, load_vehicle
from skyarm.vehicle.vehicle_records import Frame
from support.commands import refused
from support.commands import skyarm as typed
from support.components import registry_kept
from support.vehicles import hummingbird_arm, random_flyer

SHIPPED = [name for name in list_vehicles() if not load_vehicle(name).planar]

SUFFIX = {"mjcf": "xml", "urdf": "urdf", "sdf": "sdf", "toml": "toml"}

ROTOR_NUMBERS = [
    "direction",
    "thrust_coefficient",
    "moment_coefficient",
    "time_constant_up",
    "time_constant_down",
    "max_speed",
    "drag_coefficient",
    "rolling_moment_coefficient",
    "inertia",
    "reversible",
]


def written(vehicle: Vehicle, form: str, folder: Path) -> Path:
    path = folder / f"x.{SUFFIX[form]}"
    path.write_text(find("vehicle_format", form)(vehicle), "utf-8")
    return path


def lost_lines(path: Path) -> list[str]:
    head = path.read_text("utf-8").split("-->")[0]
    return [
        line.strip().split(": ", 1)[1]
        for line in head.splitlines()
        if "lost or changed: " in line
    ]


def dynamics(vehicle: Vehicle, seed: int = 3) -> list[np.ndarray]:
    """M(q) and bias at a random state."""
    rng, n = np.random.default_rng(seed), vehicle.n
    q, rates, spin = rng.uniform(-1.0, 1.0, n), rng.normal(size=n), rng.normal(size=3)
    force, efforts = inverse_dynamics(
        vehicle,
        list(q),
        Vec3(*spin),
        list(rates),
        Motion(Vec3(0, 0, 0), Vec3(0, 0, 9.81)),
        [0.0] * n,
    )
    M = np.array(mass_matrix(vehicle, Mat3.identity(), list(q)), float)
    return [M, np.array([*force.torque, *force.force, *efforts], float)]


def allocation(vehicle: Vehicle) -> np.ndarray:
    """Wrench at the base's origin of each rotor's unit of squared speed, at rest of its
    tilt.
    """
    columns = []
    for each in vehicle.rotors:
        axis, hub = (
            np.array(list(each.axis), float),
            np.array(list(each.position), float),
        )
        thrust = float(each.thrust_coefficient) * axis
        columns.append(
            [
                *np.cross(hub, thrust)
                - each.direction * float(each.moment_coefficient) * thrust,
                *thrust,
            ]
        )
    return np.array(columns)


def same(found: np.ndarray, wanted: np.ndarray, within: float = 1e-9) -> None:
    scale = max(np.abs(wanted).max(initial=0.0), 1e-6)
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=within * scale)


@pytest.mark.parametrize("form", SUFFIX)
@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_vehicle_reads_back_as_itself(name, form, tmp_path):
    vehicle = load_vehicle(name)
    path = written(vehicle, form, tmp_path)
    again, lost = load_vehicle(path), lost_lines(path)
    if any(each.startswith("armature") for each in lost):
        vehicle = vehicle.with_joints(armature=0)
    assert again.joint_names == vehicle.joint_names
    for found, wanted in zip(dynamics(again), dynamics(vehicle), strict=True):
        same(found, wanted)
    same(allocation(again), allocation(vehicle))
    assert not again.gaps
    for ours, theirs in zip(vehicle.rotors, again.rotors, strict=True):
        assert theirs.name == ours.name
        for number in ROTOR_NUMBERS:
            assert getattr(theirs, number) == pytest.approx(
                getattr(ours, number), rel=1e-12
            ), number
        if any(each.startswith("tilts") for each in lost):
            continue
        assert (theirs.tilt is None) == (ours.tilt is None)
        for number in (
            ("lower", "upper", "time_constant", "max_rate") if ours.tilt else ()
        ):
            assert getattr(theirs.tilt, number) == getattr(ours.tilt, number), number
        if ours.tilt:
            same(
                np.array(list(theirs.tilt.axis), float),
                np.array(list(ours.tilt.axis), float),
            )
    for ours, theirs in zip(vehicle.joints, again.joints, strict=True):
        for number in (
            "lower",
            "upper",
            "effort_limit",
            "damping",
            "coulomb",
            "armature",
        ):
            assert float(getattr(theirs, number)) == pytest.approx(
                float(getattr(ours, number)), rel=1e-12
            ), number
    frames = {each.name: each for each in again.frames}
    for each in vehicle.frames:
        same(
            np.array(list(frames[each.name].position), float),
            np.array(list(each.position), float),
        )
        same(
            np.array(frames[each.name].rotation, float), np.array(each.rotation, float)
        )


@pytest.mark.parametrize(
    "name", ["hexarotor12_arm5", "voliro_like", "octo_coaxial_two_arms"]
)
def test_mujoco_reads_the_mass_matrix_and_bias_of_the_vehicle(name, tmp_path):
    vehicle = load_vehicle(name)
    model = mujoco.MjModel.from_xml_path(str(written(vehicle, "mjcf", tmp_path)))
    data, rng = mujoco.MjData(model), np.random.default_rng(3)
    at, rates = joint_addresses(vehicle, model)
    data.qpos[at], data.qvel[rates] = (
        rng.uniform(-1.0, 1.0, vehicle.n),
        rng.normal(size=vehicle.n),
    )
    data.qvel[3:6] = rng.normal(size=3)
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    rows, (mass, bias) = [*range(6), *rates], dynamics(vehicle)
    same(M[np.ix_(rows, rows)], mass)
    same(data.qfrc_bias[rows], [*bias[3:6], *bias[:3], *bias[6:]])


def test_pinocchio_reads_the_mass_and_centre_of_a_urdf_file(tmp_path):
    pinocchio = pytest.importorskip("pinocchio")
    vehicle = random_flyer(2, 5)
    model = pinocchio.buildModelFromUrdf(
        str(written(vehicle, "urdf", tmp_path)), pinocchio.JointModelFreeFlyer()
    )
    data = model.createData()
    assert pinocchio.computeTotalMass(model) == pytest.approx(
        float(vehicle.mass), rel=1e-12
    )
    q = pinocchio.neutral(model)
    M = pinocchio.crba(model, data, q)
    M = np.triu(M) + np.triu(M, 1).T
    rows = [
        model.joints[model.getJointId(joint)].idx_v for joint in vehicle.joint_names
    ]
    armature = np.diag([float(each.armature) for each in vehicle.joints])
    same(
        M[np.ix_(rows, rows)] + armature,
        np.array(mass_matrix(vehicle, Mat3.identity(), [0.0] * 5), float)[6:, 6:],
    )


def sdf_pose(element: ET.Element) -> np.ndarray:
    numbers = [
        float(word) for word in (element.findtext("pose") or "0 0 0 0 0 0").split()
    ]
    pose = np.eye(4)
    pose[:3, 3], pose[:3, :3] = (
        numbers[:3],
        Rotation.from_euler("xyz", numbers[3:]).as_matrix(),
    )
    return pose


@pytest.mark.parametrize("name", SHIPPED)
def test_a_strict_reading_of_the_sdf_file_finds_the_vehicle(name, tmp_path):
    """Poses, masses and plugins, by SDFormat's rules and SciPy's rotations."""
    vehicle = load_vehicle(name)
    root = ET.parse(written(vehicle, "sdf", tmp_path)).getroot()
    model = root.find("model")
    links = {each.get("name"): each for each in model.findall("link")}
    frames = {each.get("name"): each for each in model.findall("frame")}
    joints = {each.get("name"): each for each in model.findall("joint")}
    assert len({*links, *frames, *joints}) == len(links) + len(frames) + len(joints)
    assert model.get("canonical_link") in links
    places: dict[str, np.ndarray] = {}

    def place(name: str) -> np.ndarray:
        if name not in places:
            element = links[name] if name in links else frames[name]
            pose = element.find("pose")
            above = None if pose is None else pose.get("relative_to")
            places[name] = (
                sdf_pose(element) if above is None else place(above) @ sdf_pose(element)
            )
        return places[name]

    moment, total = np.zeros(3), 0.0
    turning = np.zeros((3, 3))
    for each, link in links.items():
        inertial, pose = (
            link.find("inertial"),
            place(each) @ sdf_pose(link.find("inertial")),
        )
        mass, com = float(inertial.findtext("mass")), pose[:3, 3]
        xx, yy, zz, xy, xz, yz = (float(each.text) for each in inertial.find("inertia"))
        own = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        turning += pose[:3, :3] @ own @ pose[:3, :3].T + mass * (
            com @ com * np.eye(3) - np.outer(com, com)
        )
        moment, total = moment + mass * com, total + mass
    M = np.array(mass_matrix(vehicle, Mat3.identity(), [0.0] * vehicle.n), float)
    assert total == pytest.approx(float(vehicle.mass), rel=1e-12)
    same(turning, M[3:6, 3:6])
    same(
        np.array(
            [
                [0, -moment[2], moment[1]],
                [moment[2], 0, -moment[0]],
                [-moment[1], moment[0], 0],
            ]
        ),
        M[3:6, :3],
    )
    for link in vehicle.links:
        joint = joints[link.joint.name]
        assert joint.findtext("child") == link.name
        axis, limit = joint.find("axis"), joint.find("axis/limit")
        same(
            np.array(axis.findtext("xyz").split(), float),
            np.array(list(link.joint.axis), float),
        )
        for word, value in (
            ("lower", link.joint.lower),
            ("upper", link.joint.upper),
            ("effort", link.joint.effort_limit),
        ):
            assert (
                float(
                    limit.findtext(word)
                    or math.copysign(math.inf, -1.0 if word == "lower" else 1.0)
                )
                == value
            )
        assert float(axis.findtext("dynamics/damping")) == link.joint.damping
    plugins = model.findall("plugin")
    assert [int(each.findtext("motorNumber")) for each in plugins] == list(
        range(len(vehicle.rotors))
    )
    for each, plugin in zip(vehicle.rotors, plugins, strict=True):
        pose = place(plugin.findtext("linkName"))
        hinge = joints[plugin.findtext("jointName")]
        assert hinge.findtext("child") == plugin.findtext("linkName") == each.name
        # Gazebo's plugin turns it by its speed
        assert float(hinge.findtext("axis/limit/effort")) == math.inf
        same(pose[:3, 3], np.array(list(each.position), float))
        same(pose[:3, 2], np.array(list(each.axis), float))
        assert plugin.findtext("turningDirection") == (
            "ccw" if each.direction > 0 else "cw"
        )
        for word, value in (
            ("motorConstant", each.thrust_coefficient),
            ("momentConstant", each.moment_coefficient),
            ("timeConstantUp", each.time_constant_up),
            ("timeConstantDown", each.time_constant_down),
            ("maxRotVelocity", each.max_speed),
            ("rotorDragCoefficient", each.drag_coefficient),
        ):
            assert float(plugin.findtext(word)) == float(value)


def test_a_thrust_follows_its_control_with_the_mean_of_both_lags(tmp_path):
    vehicle = load_vehicle("hummingbird")
    model = mujoco.MjModel.from_xml_path(str(written(vehicle, "mjcf", tmp_path)))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    gears = [
        [0.0, 0.0, 1.0, 0.0, 0.0, -0.016 * each.direction] for each in vehicle.rotors
    ]
    np.testing.assert_array_equal(model.actuator_gear, gears)
    before = data.act[0]
    data.ctrl[0] = before + 0.5
    for _ in range(30):
        mujoco.mj_step(model, data)
    assert data.act[0] - before == pytest.approx(
        0.5 * -math.expm1(-0.030 / 0.01875), rel=1e-6
    )


def test_a_tilt_turns_the_thrust_with_its_lag_and_its_largest_rate(tmp_path):
    """Beside the two-pole response in closed form; a large step turns at the largest
    rate.
    """
    vehicle = load_vehicle("voliro_like")
    tilt = vehicle.rotors[0].tilt
    model = mujoco.MjModel.from_xml_path(str(written(vehicle, "mjcf", tmp_path)))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    servo, angle = (
        model.actuator("rotor0_tilt").id,
        model.joint("rotor0_tilt").qposadr[0],
    )
    data.ctrl[servo] = 0.1
    for _ in range(60):
        mujoco.mj_step(model, data)
    slow, fast = 1.0 / tilt.time_constant, 20.0 / tilt.time_constant
    wanted = 0.1 * (
        1.0
        - (fast * math.exp(-slow * 0.06) - slow * math.exp(-fast * 0.06))
        / (fast - slow)
    )
    assert data.qpos[angle] == pytest.approx(wanted, rel=1e-3)
    data.ctrl[servo] = 1.5
    for _ in range(100):
        mujoco.mj_step(model, data)
    assert data.qvel[model.joint("rotor0_tilt").dofadr[0]] == pytest.approx(
        tilt.max_rate, rel=1e-3
    )
    along = data.site("rotor0").xmat.reshape(3, 3)[:, 2]
    base = data.body("base").xmat.reshape(3, 3)
    np.testing.assert_allclose(
        base.T @ along,
        [0.0, -math.sin(data.qpos[angle]), math.cos(data.qpos[angle])],
        atol=1e-2,
    )


def test_what_a_file_loses_is_named_in_its_first_lines(tmp_path):
    heads = {
        form: (
            written(load_vehicle("hexarotor12_arm5"), form, tmp_path).read_text()[:3000]
        )
        for form in SUFFIX
    }
    for form in ("mjcf", "urdf", "sdf"):
        head = heads[form].split("-->")[0]
        for word in (
            "battery",
            "drives of joints",
            "thrust tables",
            "drag of the body",
            "Coulomb",
            "stops",
        ):
            assert word in head, (form, word)
    assert "armature" in heads["urdf"].split("-->")[0]
    assert "armature" not in heads["mjcf"].split("-->")[0]
    assert "lost" not in heads["toml"]


def test_followers_endless_and_one_sided_joints_and_equal_names_read_back(tmp_path):
    vehicle = hummingbird_arm(lower=-0.5)
    joint = replace(
        vehicle.links[1].joint, damping=0, effort_limit=0.0, lower=-math.inf
    )
    tied = Follower(
        link=replace(vehicle.links[1], joint=joint), leader=0, ratio=-2.0, offset=0.25
    )
    front = Frame(name="front", link=0, position=Vec3(0.1, 0, 0))
    frames = (*(replace(each, link=1) for each in vehicle.frames), front)
    vehicle = replace(
        vehicle, links=vehicle.links[:1], followers=(tied,), frames=frames
    )
    for form in ("mjcf", "urdf", "sdf"):
        path = written(vehicle, form, tmp_path)
        assert any(each.startswith("joints that follow") for each in lost_lines(path))
        assert any(
            each.startswith("names that two") and each.endswith(": front")
            for each in lost_lines(path)
        )
        assert any(
            each.startswith("limit on one side") for each in lost_lines(path)
        ) == (form != "sdf")
        assert any(
            each.startswith("stops or") and each.endswith(": shoulder")
            for each in lost_lines(path)
        )
        toml = f'schema = 1\nname = "x"\nmimic = "couple"\n{form} = "{path.name}"\n'
        (tmp_path / "x.toml").write_text(toml)
        again = load_vehicle(tmp_path / "x.toml")
        assert (again.followers[0].ratio, again.followers[0].offset) == (-2.0, 0.25)
        for found, wanted in zip(dynamics(again), dynamics(vehicle), strict=True):
            same(found, wanted)


def endless() -> Vehicle:
    """Rotors without a largest speed, a slide without limits, a drive without one,
    links named as their joints.
    """
    vehicle = load_vehicle("octo_coaxial_two_arms")
    rotors = tuple(
        replace(each, name=f"r---{k}", max_speed=math.inf)
        for k, each in enumerate(vehicle.rotors)
    )
    free = {"lower": -math.inf, "upper": math.inf, "effort_limit": math.inf}
    links = [
        replace(each, joint=replace(each.joint, name=each.name))
        for each in vehicle.links
    ]
    slide = next(k for k, each in enumerate(links) if not each.joint.turns)
    links[slide] = replace(links[slide], joint=replace(links[slide].joint, **free))
    return replace(vehicle, rotors=rotors, links=tuple(links))


@pytest.mark.parametrize("form", ["mjcf", "urdf", "sdf"])
def test_what_has_no_limit_reads_back_without_or_is_named(form, tmp_path):
    vehicle = endless()
    path = written(vehicle, form, tmp_path)
    again, lost = (
        load_vehicle(path),
        {line.split(",")[0]: line for line in lost_lines(path)},
    )
    ET.parse(path)  # expat refuses two hyphens in a comment
    same(allocation(again), allocation(vehicle))
    assert [each.max_speed for each in again.rotors] == [math.inf] * 8
    assert [each.name for each in again.rotors] == [
        each.name for each in vehicle.rotors
    ]
    assert lost["unlimited speed of rotors"].endswith("r- - -6, r- - -7")
    slide = next(each for each in again.joints if not each.turns)
    if form == "urdf":
        assert (slide.lower, slide.upper, slide.effort_limit) == (-1000, 1000, 1000)
        assert lost["slides without limits"].endswith(f": {slide.name}")
        assert lost["unlimited effort"].endswith(f": {slide.name}")
        assert lost["rates without limits"].endswith(", ".join(vehicle.joint_names))
    else:
        assert (slide.lower, slide.upper, slide.effort_limit) == (
            -math.inf,
            math.inf,
            math.inf,
        )
    if form == "mjcf":
        most = [1e12 * each.thrust_coefficient for each in vehicle.rotors]
        ranges = mujoco.MjModel.from_xml_path(str(path)).actuator_ctrlrange[:8]
        np.testing.assert_allclose(ranges.T, [[0.0] * 8, most])
    limited = [each.name for each in vehicle.joints if each.upper < math.inf]
    assert not any(each.stop_stiffness for each in vehicle.joints)
    assert limited
    assert lost["stops or the end of a flight at limits"].endswith(
        ": " + ", ".join(limited)
    )


def test_names_that_sdf_keeps_for_itself_are_others_in_the_file(tmp_path):
    """libsdformat refuses "world", and "::" from version 1.8 on."""
    vehicle = hummingbird_arm()
    joint, hand = (
        replace(vehicle.joints[0], name="arm::lift"),
        Frame(name="arm::hand", link=0, position=ZERO3),
    )
    links = (
        replace(vehicle.links[0], name="arm::upper", joint=joint),
        *vehicle.links[1:],
    )
    frames = (*vehicle.frames, hand, Frame(name="world", link=0, position=ZERO3))
    vehicle = replace(vehicle, links=links, frames=frames)
    path = written(vehicle, "sdf", tmp_path)
    parts = [
        e.get("name", "")
        for e in ET.parse(path).getroot().find("model")
        if e.tag != "plugin"
    ]
    assert not [name for name in parts if name == "world" or "::" in name]
    assert {"arm_upper", "arm_lift", "arm_hand", "world_"} < {*parts}
    line = (
        "names that SDF keeps for itself, here with _: arm::upper, arm::hand, world,"
        " arm::lift"
    )
    assert line in lost_lines(path)
    for found, wanted in zip(
        dynamics(load_vehicle(path)), dynamics(vehicle), strict=True
    ):
        same(found, wanted)


def test_a_large_effort_reads_back_from_a_urdf_file(tmp_path):
    vehicle = hummingbird_arm()
    links = (
        replace(
            vehicle.links[0], joint=replace(vehicle.joints[0], effort_limit=1500.0)
        ),
        *vehicle.links[1:],
    )
    path = written(replace(vehicle, links=links), "urdf", tmp_path)
    assert load_vehicle(path).joints[0].effort_limit == 1500.0


def test_no_two_parts_of_an_sdf_file_have_one_name(tmp_path):
    """SDFormat 1.7 and later have one space of names for links, joints and frames of a
    model.
    """
    vehicle = endless()
    model = ET.parse(written(vehicle, "sdf", tmp_path)).getroot().find("model")
    names = [
        each.get("name") for each in model if each.tag in ("link", "joint", "frame")
    ]
    assert len(set(names)) == len(names)
    assert {*vehicle.joint_names} < {*names}
    assert any(
        each.startswith("names that two parts have")
        for each in lost_lines(tmp_path / "x.sdf")
    )


def test_an_order_of_joints_that_branches_change_is_named(tmp_path):
    vehicle = random_flyer(3, 6)
    path = written(vehicle, "mjcf", tmp_path)
    model = mujoco.MjModel.from_xml_path(str(path))
    assert [model.joint(k + 1).name for k in range(6)] != [*vehicle.joint_names]
    assert any(each.startswith("order of joints") for each in lost_lines(path))
    vehicle = load_vehicle("octo_coaxial_two_arms")
    assert not any(
        each.startswith("order of joints")
        for each in lost_lines(written(vehicle, "mjcf", tmp_path))
    )


@pytest.mark.parametrize("lag", [1e-6, 1e-4, 1e-3, 0.02])
def test_rotors_of_any_lag_rise_in_mujoco_as_in_closed_form(lag, tmp_path):
    vehicle = load_vehicle("hummingbird")
    rotors = tuple(
        replace(each, time_constant_up=lag, time_constant_down=lag)
        for each in vehicle.rotors
    )
    model = mujoco.MjModel.from_xml_path(
        str(written(replace(vehicle, rotors=rotors), "mjcf", tmp_path))
    )
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.ctrl *= 1.05
    for _ in range(200):
        mujoco.mj_step(model, data)
    lag, t = max(lag, 0.001), 0.2
    rise = 0.05 * 9.81 * (0.5 * t * t - lag * t + lag * lag * -math.expm1(-t / lag))
    assert data.qpos[2] - 1.0 == pytest.approx(rise, rel=1e-3)


@pytest.mark.parametrize(
    "taken", [["rotor0_tilt"], ["rotor0_tilt_"], ["rotor0_tilt", "rotor0_tilt__"]]
)
@pytest.mark.parametrize("kind", ["joint", "link"])
def test_a_tilt_keeps_apart_from_joints_and_links_of_its_name(taken, kind, tmp_path):
    arm = load_vehicle("pelican_arm2")
    links = list(arm.links)
    for k, name in enumerate(taken):
        joint = (
            replace(links[k].joint, name=name) if kind == "joint" else links[k].joint
        )
        links[k] = replace(
            links[k], joint=joint, **({"name": name} if kind == "link" else {})
        )
    drives = tuple(each for each in arm.drives if each.name not in taken)
    vehicle = replace(
        load_vehicle("voliro_like"),
        links=tuple(links),
        frames=arm.frames,
        drives=drives,
    )
    path = written(vehicle, "mjcf", tmp_path)
    again = load_vehicle(path)
    assert (again.joint_names, again.rotors) == (
        vehicle.joint_names,
        load_vehicle(written(vehicle, "toml", tmp_path)).rotors,
    )
    for found, wanted in zip(dynamics(again), dynamics(vehicle), strict=True):
        same(found, wanted)
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    tilts = model.actuator_trnid[model.nactuator - 6 :, 0]
    assert {int(model.jnt_bodyid[each]) for each in tilts} == {
        int(model.site_bodyid[site]) for site in model.actuator_trnid[:6, 0]
    }
    assert not data.ctrl[-6:].any()


def test_shapes_touch_the_floor_on_request_only(tmp_path):
    for words, touching in (((), 0), (("--collisions",), 1)):
        assert (
            typed(
                "export",
                "pelican_arm2",
                "--to",
                "mjcf",
                "-o",
                str(tmp_path / "x.xml"),
                *words,
            ).code
            == 0
        )
        model = mujoco.MjModel.from_xml_path(str(tmp_path / "x.xml"))
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        data.qpos[2] = 0.0
        mujoco.mj_forward(model, data)
        assert min(data.ncon, 1) == touching == model.geom_contype.any()
        assert {model.geom(each.geom1).name for each in data.contact} <= {"floor"}


@pytest.mark.parametrize("form", ["urdf", "sdf", "toml"])
def test_the_command_writes_every_format(form, tmp_path):
    path = tmp_path / f"x.{form}"
    done = typed("export", "pelican_arm2", "--to", form, "-o", str(path))
    assert (done.code, done.err) == (0, "")
    assert path.read_text() == find("vehicle_format", form)(
        load_vehicle("pelican_arm2")
    )
    refused(
        typed(
            "export",
            "pelican_arm2",
            "--to",
            form,
            "-o",
            str(path),
            "--timestep",
            "0.002",
        ),
        "--timestep",
    )
    refused(
        typed("export", "pelican_arm2", "--to", form, "-o", "x.c"),
        f"must end in .{form}",
    )


def test_a_format_of_ones_own_is_written_by_its_name(tmp_path):
    with registry_kept():
        register.vehicle_format("mine")(lambda vehicle: f"{vehicle.name} {vehicle.n}\n")
        assert names("vehicle_format")[-1] == "mine"
        assert (
            typed(
                "export", "pelican_arm2", "--to", "mine", "-o", str(tmp_path / "x.mine")
            ).code
            == 0
        )
    assert (tmp_path / "x.mine").read_text() == "pelican_arm2 2\n"


@pytest.mark.parametrize("form", ["mjcf", "urdf"])
def test_a_changed_element_of_rotors_is_refused_in_one_line(form, tmp_path):
    path = written(load_vehicle("pelican_arm2"), form, tmp_path)
    for old, new in (
        ("[rotor_defaults]", "[rotor_defaults"),
        ("position = ", "place = "),
        ("max_speed = ", "speed = "),
    ):
        text = path.read_text()
        assert old in text
        path.with_stem("y").write_text(text.replace(old, new))
        with pytest.raises(VehicleError) as caught:
            load_vehicle(path.with_stem("y"))
        assert "skyarm:rotors" in str(caught.value)
        assert "\n" not in str(caught.value)


def test_an_element_of_rotors_beside_fewer_plugins_is_refused(tmp_path):
    path = written(load_vehicle("pelican_arm2"), "urdf", tmp_path)
    begin, _, rest = path.read_text().partition("<plugin")
    path.write_text(begin + rest.partition("</plugin>")[2])
    with pytest.raises(
        VehicleError, match="rotors = 4: must be 3, as many as motor-model plugins"
    ):
        load_vehicle(path)


def test_motor_plugins_of_others_are_read_where_no_element_of_ours_is(tmp_path):
    path = written(load_vehicle("pelican_arm2"), "urdf", tmp_path)
    begin, _, rest = path.read_text().partition("<skyarm:rotors")
    path.write_text(begin + rest.partition("</skyarm:rotors>")[2])
    again = load_vehicle(path)
    same(allocation(again), allocation(load_vehicle("pelican_arm2")))
    assert "turningDirection" in dict(again.sources)["rotors.direction"]


def test_a_planar_model_is_no_robot():
    for form in ("urdf", "sdf"):
        with pytest.raises(VehicleError, match="planar = True"):
            find("vehicle_format", form)(load_vehicle("hummingbird_arm2"))
