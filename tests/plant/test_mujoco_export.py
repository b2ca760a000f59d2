"""Exported models: they load by themselves, step as the plant does to the six digits of
their numbers.
"""

from __future__ import annotations

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import skyarm
from skyarm.algebra import Vec3
from skyarm.dynamics.actuators.hover import HoverTrim, hover_trim
from skyarm.plant.interface import Truth, flat
from skyarm.plant.mujoco import MujocoPlant
from skyarm.plant.mujoco_export import START, mjcf_text
from skyarm.plant.mujoco_model import joint_addresses
from skyarm.records.leaves import leaves
from skyarm.vehicle import VehicleError
from skyarm.vehicle.linkage import Follower
from skyarm.vehicle.vehicle_files import load_vehicle, load_with_bodies
from skyarm.vehicle.vehicle_records import BodyDrag, Collision
from skyarm.world.contact.surface import rotation_of
from support.commands import skyarm as typed
from support.vehicles import (
    HOVER,
    hovering,
    hummingbird_arm,
    random_flyer,
    steady_wind,
    tumbling,
)

STILL = steady_wind(Vec3(0.0, 0.0, 0.0), Vec3(0.0, 0.0, 0.0), Vec3(0.0, 0.0, 0.0))
VEHICLES = {
    "hummingbird_arm": hummingbird_arm(armature=1e-4),
    "random": random_flyer(2, 5),
}


def in_still_air(vehicle):
    """Without what the model leaves out: drag, Coulomb friction, stops."""
    links = tuple(
        replace(
            k,
            joint=replace(
                k.joint,
                coulomb=0,
                lower=-math.inf,
                upper=math.inf,
                effort_limit=math.inf,
            ),
        )
        for k in vehicle.links
    )
    rotors = tuple(
        replace(each, drag_coefficient=0, rolling_moment_coefficient=0)
        for each in vehicle.rotors
    )
    return replace(vehicle, links=links, rotors=rotors, drag=BodyDrag())


def loaded(vehicle, gravity=9.8, start=None):
    model = mujoco.MjModel.from_xml_string(mjcf_text(vehicle, gravity, start))
    return model, mujoco.MjData(model)


@pytest.mark.parametrize("name", VEHICLES)
def test_the_model_steps_as_the_plant_does(name):
    """0.3 s of tumbling under thrusts and efforts; MuJoCo writes six digits."""
    vehicle = in_still_air(VEHICLES[name])
    start = replace(
        tumbling(vehicle), rotor_speeds=(HOVER + 10.0, HOVER, HOVER - 20.0, HOVER + 5.0)
    )
    efforts = tuple(0.1 - 0.15 * (i % 2) for i in range(vehicle.n))
    x = flat(start)
    plant = MujocoPlant(Truth(vehicle=vehicle, gravity=9.8), STILL, "rk4_staged")
    end = plant.advance(x, (*start.rotor_speeds, *efforts), leaves(STILL), 0.3)
    model, data = loaded(vehicle, start=start)
    mujoco.mj_resetDataKeyframe(model, data, model.key(START).id)
    thrusts = [
        r.thrust_coefficient * w**2
        for r, w in zip(vehicle.rotors, start.rotor_speeds, strict=True)
    ]
    np.testing.assert_allclose(data.ctrl[:4], thrusts, rtol=1e-5)
    data.ctrl[4:] = efforts
    for _ in range(300):
        mujoco.mj_step(model, data)
    q, v = joint_addresses(vehicle, model)
    found = (*data.qpos[:7], *data.qvel[:6], *data.qpos[q], *data.qvel[v])
    np.testing.assert_allclose(found, end[: len(found)], rtol=0.0, atol=1e-3)
    assert np.abs(np.subtract(found, x[: len(found)])).max() > 0.3


def test_every_number_reads_back_to_six_digits():
    vehicle = VEHICLES["random"]
    model, _ = loaded(vehicle)
    plant = MujocoPlant(Truth(vehicle=vehicle, gravity=9.8), STILL).model
    for name in (
        "body_mass",
        "body_inertia",
        "body_ipos",
        "body_iquat",
        "body_pos",
        "body_quat",
        "jnt_axis",
    ):
        np.testing.assert_allclose(
            getattr(model, name), getattr(plant, name), rtol=1e-5, atol=1e-6
        )
    assert tuple(model.opt.gravity) == (0.0, 0.0, -9.8)


def test_the_file_is_a_vehicle_that_reads_back_as_the_same(tmp_path):
    vehicle = VEHICLES["random"]
    (tmp_path / "x.xml").write_text(mjcf_text(vehicle, 9.8), encoding="utf-8")
    again = load_vehicle(tmp_path / "x.xml")
    for ours, theirs in zip(vehicle.bodies, again.bodies, strict=True):
        np.testing.assert_allclose(
            theirs.inertia.entries, ours.inertia.entries, rtol=1e-4, atol=1e-7
        )
        np.testing.assert_allclose(
            tuple(theirs.com), tuple(ours.com), rtol=1e-4, atol=1e-6
        )
    for ours, theirs in zip(vehicle.links, again.links, strict=True):
        assert (theirs.name, theirs.parent, theirs.joint.kind) == (
            ours.name,
            ours.parent,
            ours.joint.kind,
        )
        for name in (
            "lower",
            "upper",
            "effort_limit",
            "damping",
            "coulomb",
            "armature",
        ):
            assert getattr(theirs.joint, name) == pytest.approx(
                getattr(ours.joint, name), rel=1e-4
            ), name
    assert {each.name for each in vehicle.frames} <= {
        each.name for each in again.frames
    }


def test_limits_and_followers_hold_in_the_model():
    vehicle = hummingbird_arm(lower=-0.5, upper=0.5)
    tied = Follower(
        link=replace(
            vehicle.links[1], joint=replace(vehicle.links[1].joint, damping=0)
        ),
        leader=0,
        ratio=-2.0,
    )
    vehicle = replace(vehicle, links=vehicle.links[:1], followers=(tied,))
    model, data = loaded(
        vehicle, start=replace(hovering(vehicle), joints=(0.2,), joint_rates=(0.3,))
    )
    mujoco.mj_resetDataKeyframe(model, data, 0)
    shoulder, elbow = (model.joint(name).qposadr[0] for name in ("shoulder", "elbow"))
    assert data.qpos[elbow] == -0.4
    rates = [data.qvel[model.joint(name).dofadr[0]] for name in ("shoulder", "elbow")]
    assert rates == [0.3, -0.6]
    data.qvel[:] = 0.0
    data.ctrl[4] = 0.15
    for _ in range(500):
        mujoco.mj_step(model, data)
    assert 0.4 < data.qpos[shoulder] < 0.55
    assert data.qpos[elbow] == pytest.approx(-2.0 * data.qpos[shoulder], abs=0.02)
    assert [model.actuator(k).name for k in range(model.nu)] == [
        "front",
        "left",
        "back",
        "right",
        "shoulder",
    ]


def test_passive_joints_have_no_motor_and_a_bare_arm_loads():
    vehicle = hummingbird_arm(effort_limit=0.0)
    assert loaded(vehicle)[0].nu == 4
    assert loaded(replace(vehicle, rotors=()))[0].nu == 0
    # rotors in one place cannot be mixed: they stand still in the keyframe
    together = tuple(
        replace(each, position=vehicle.rotors[0].position) for each in vehicle.rotors
    )
    assert tuple(loaded(replace(vehicle, rotors=together))[0].key(0).ctrl) == (0.0,) * 4


def test_a_pair_of_rotors_that_idles_in_hover_leaves_the_others_turning():
    """Squared speeds of a sideways pair are rounded zeros of both signs."""
    vehicle = load_vehicle("hummingbird")
    pair = [
        replace(
            vehicle.rotors[0],
            name=name,
            position=Vec3(0.1, 0.0, 0.013),
            axis=Vec3(0.0, axis, 0.0),
        )
        for name, axis in (("port", 1.0), ("starboard", -1.0))
    ]
    vehicle = replace(vehicle, rotors=(*vehicle.rotors, *pair))
    assert min(hover_trim(vehicle, (), 9.8).squared) < 0.0
    levels = {each.question: each.level for each in skyarm.check(vehicle).findings}
    assert levels["balance of the rotors"] == "note"
    thrusts = loaded(vehicle)[0].key(0).ctrl[:]
    np.testing.assert_allclose(thrusts[:4], 0.25 * 9.8 * float(vehicle.mass), rtol=1e-5)
    np.testing.assert_allclose(thrusts[4:], 0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("least", "still"), [(0.0, False), (100.0, False), (-1.0, True)]
)
def test_a_rotor_that_idles_in_hover_leaves_the_others_their_thrust(
    least, still, monkeypatch
):
    """One that would have to push backwards does not: then all of the keyframe's rotors
    stand still.
    """
    vehicle, squared = hummingbird_arm(), (least, 4e4, 9e4, 1.6e5)
    trim = HoverTrim(
        tuple(max(each, 0.0) ** 0.5 for each in squared), squared, 1.0, (0.0, 0.0)
    )
    monkeypatch.setattr("skyarm.plant.mujoco_export.hover_trim", lambda *_: trim)
    shares = [each / 1.6e5 for each in (max(least, 0.0), 4e4, 9e4, 1.6e5)]
    thrusts = loaded(vehicle)[0].key(0).ctrl[:4]
    np.testing.assert_allclose(
        thrusts, [0.0 if still else each * thrusts[3] for each in shares], rtol=1e-5
    )
    assert (thrusts[3] == 0.0) == still


def test_names_that_collide_still_load():
    vehicle = hummingbird_arm()
    frames = (
        *vehicle.frames,
        *(replace(vehicle.frames[0], name=name) for name in ("front", "base")),
    )
    renamed = replace(
        vehicle,
        frames=frames,
        rotors=(replace(vehicle.rotors[0], name="elbow"), *vehicle.rotors[1:]),
    )
    assert loaded(renamed)[0].nu == 6


def test_a_planar_model_is_refused():
    vehicle = load_vehicle("hummingbird_arm2")
    if not vehicle.planar:
        body = replace(vehicle.links[0].body, planar=True)
        vehicle = replace(
            vehicle, links=(replace(vehicle.links[0], body=body), *vehicle.links[1:])
        )
    with pytest.raises(VehicleError, match="planar = True"):
        mjcf_text(vehicle, 9.8)


@pytest.mark.filterwarnings("ignore:.*only the log has its readings")
def test_an_inertial_unit_of_a_scenario_is_a_site_with_its_sensors(tmp_path):
    """Where its table says, with its axes, by SciPy."""
    mount = {"kind": "imu", "position": [0.1, -0.05, 0.02], "rpy": [0.3, -0.2, 2.5]}
    (tmp_path / "mounted.toml").write_text(
        'schema = 1\nname = "mounted"\nduration = 1.0\nplant.vehicle ='
        ' "hummingbird_arm2_rotors"\ncontroller.preset = "paper_ct"\n[sensors.imu]\n'
        + "".join(f"{key} = {value!r}\n" for key, value in mount.items())
    )
    assert (
        typed(
            "export",
            f"{tmp_path}/mounted.toml",
            "--to",
            "mjcf",
            "-o",
            f"{tmp_path}/x.xml",
        ).code
        == 0
    )
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "x.xml"))
    data = mujoco.MjData(model)

    data.qpos[:7] = [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0]
    data.qvel[3:6] = [0.0, 0.0, 2.0]
    mujoco.mj_forward(model, data)
    R = Rotation.from_euler("ZYX", mount["rpy"][::-1])
    np.testing.assert_allclose(
        data.sensor("imu_gyro").data, R.inv().apply([0.0, 0.0, 2.0]), atol=1e-5
    )
    np.testing.assert_allclose(model.site("imu").pos, mount["position"], atol=1e-6)
    np.testing.assert_allclose(
        data.site("imu").xmat.reshape(3, 3), R.as_matrix(), atol=1e-5
    )
    assert model.sensor("imu_acc").type[0] == mujoco.mjtSensor.mjSENS_ACCELEROMETER


def test_stated_shapes_are_exported_and_read_back_where_they_are(tmp_path):
    tilt = Vec3(0.1, 0.2, 0.3)
    corners = tuple(
        Vec3(x, y, z) for x in (-0.1, 0.1) for y in (-0.2, 0.2) for z in (0.0, 0.3)
    )
    sizes = {
        "sphere": (0.1,),
        "capsule": (0.1, 0.3),
        "box": (0.1, 0.2, 0.3),
        "cylinder": (0.1, 0.2),
        "hull": (),
    }
    shapes = tuple(
        Collision(
            name=shape,
            link=i % 2 - 1,
            position=tilt * float(i),
            rotation=rotation_of(tilt),
            shape=shape,
            size=size,
            vertices=() if size else corners,
        )
        for i, (shape, size) in enumerate(sizes.items())
    )
    vehicle = replace(hummingbird_arm(), collisions=shapes)
    text = mjcf_text(vehicle, collisions=True)
    model = mujoco.MjModel.from_xml_string(text)
    # the drawn shapes touch nothing
    assert model.geom_contype.sum() == len(shapes)
    (tmp_path / "v.xml").write_text(text)
    read = load_with_bodies(str(tmp_path / "v.xml"), "file")[0].collisions
    for each in read:
        own = next(k for k in shapes if k.shape == each.shape)
        assert each.link == own.link
        assert each.size == pytest.approx(own.size, rel=1e-6)

        def places(k):
            points = np.array([tuple(v) for v in k.vertices or (Vec3(0.0, 0.0, 0.1),)])
            return np.sort(points @ np.array(k.rotation).T + np.array(k.position), 0)

        assert places(each) == pytest.approx(places(own), abs=1e-6)
    assert len(read) == len(shapes)
    none = mujoco.MjModel.from_xml_string(mjcf_text(vehicle))
    assert none.ngeom == model.ngeom - len(shapes)
