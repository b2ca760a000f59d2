"""Inertial units beside the base origin: readings against forward dynamics and MuJoCo's
sensors, and the filter.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import skyarm
from skyarm import dynamics
from skyarm.algebra import Motion, Quaternion, Vec3
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.links.autopilots.autopilot import inertial_unit
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.interface import Truth, flat
from skyarm.plant.loads import applied_force
from skyarm.plant.mujoco import MujocoPlant
from skyarm.plant.mujoco_model import build_spec, joint_addresses
from skyarm.plant.surroundings import Surroundings
from skyarm.records.leaves import leaves
from skyarm.records.plain import plain
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.sensing.channel import Channel
from skyarm.sensing.estimate.filter_models import modelled_force
from skyarm.sensing.sensor import specific_force_at
from skyarm.sensing.sensor_kinds import (
    EncoderReading,
    Imu,
    ImuReading,
    PoseReading,
    mount_rotation,
    reads,
)
from skyarm.simulate.first_state import first_loop_state, first_surroundings
from skyarm.simulate.loop import run_in_python
from skyarm.simulate.plant_steps import CalledPlant
from skyarm.simulate.stages import Stages
from skyarm.vehicle import Vehicle
from support import commands, flights
from support.components import registry_kept
from support.flights import estimated
from support.one_vehicle import acceleration, motion_of
from support.vehicles import HOVER, WIND, random_flyer, tumbling

G, STILL = 9.8, Surroundings()
PERFECT = {"gyro": Channel(), "accelerometer": Channel()}


def drawn_mounts(seed: int, count: int) -> list[tuple[np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(seed)
    return [
        (rng.uniform(-0.3, 0.3, 3), rng.uniform(-3.0, 3.0, 3)) for _ in range(count)
    ]


def imu_at(place: np.ndarray, rpy: np.ndarray) -> Imu:
    return Imu(position=place.tolist(), rpy=rpy.tolist(), **PERFECT)


def reading_of(imu: Imu, state: State, base: Motion) -> tuple[np.ndarray, np.ndarray]:
    force = specific_force_at(imu.mounted_at, base, state.rate)
    _, read = imu.measure(imu.start(random_flyer(0, 3)), 0.0, state, force, (), 0.005)
    return np.array([*read.rate]), np.array([*read.specific_force])


def swinging(seed: int) -> tuple[Vehicle, State, tuple[float, ...]]:
    joints = 2 + seed % 4
    vehicle = random_flyer(seed, joints)
    return (
        vehicle,
        tumbling(vehicle, seed),
        (*(HOVER + 15.0 * i for i in range(4)), *([0.2] * vehicle.n)),
    )


@cache
def base_of(kind: Any, seed: int) -> Motion:
    """Proper acceleration of the base by a plant."""
    vehicle, state, command = swinging(seed)
    plant, now = (
        kind(Truth(vehicle=vehicle, gravity=G), WIND),
        (
            flat(state),
            command,
            leaves(WIND),
        ),
    )
    return Motion(
        angular=Vec3(*plant.angular_acceleration(*now)),
        linear=Vec3(*plant.specific_force(*now)),
    )


@pytest.mark.parametrize("kind", [RigidBodyPlant, MujocoPlant])
def test_fifty_mounts_read_the_motion_of_their_place_under_swinging_arms(kind):
    """Of a rigid body by NumPy and SciPy: to 1e-12 of the forward dynamics whose mass
    matrix each plant solves.
    """
    for k, (place, rpy) in enumerate(drawn_mounts(1, 50)):
        seed = k % 5
        vehicle, state, command = swinging(seed)
        if kind is RigidBodyPlant:
            orders = Command(rotor_speeds=command[:4], efforts=command[4:])
            force, torques = applied_force(
                motion_of(Truth(vehicle=vehicle, gravity=G), state, WIND), orders, WIND
            )
            base, _ = dynamics.forward_dynamics(
                vehicle, state.joints, state.rate, state.joint_rates, force, torques
            )
        else:
            base = base_of(kind, seed)
        f, alpha, rate = (
            np.array([*map(float, each)])
            for each in (base.linear, base.angular, state.rate)
        )
        R = Rotation.from_euler("ZYX", rpy[::-1]).as_matrix()
        felt = R.T @ (
            f + np.cross(alpha, place) + np.cross(rate, np.cross(rate, place))
        )
        turned, read = reading_of(imu_at(place, rpy), state, base_of(kind, seed))
        np.testing.assert_allclose(
            read, felt, rtol=0.0, atol=1e-12 * max(1.0, np.abs(felt).max())
        )
        np.testing.assert_allclose(
            turned, R.T @ rate, rtol=0.0, atol=1e-13 * max(1.0, np.abs(rate).max())
        )


@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
def test_a_logged_row_reads_the_motion_under_the_command_of_the_row_before(plant):
    """Row 0 too: the joints hold their links at rest on a level base, as MuJoCo's bias
    forces say.
    """
    place, rpy, joints = (0.1, -0.2, 0.15), (0.3, -0.4, 2.0), (0.7, -0.9)
    session = skyarm.Session(
        skyarm.scenario_from(
            {
                "name": "rows",
                "duration": 0.05,
                "plant": {"vehicle": "hummingbird_arm2_rotors", "kind": plant},
                "controller": {"law": "decoupled_pd"},
                "environment": {"ground": False},
                "sensors": {
                    "imu": {
                        "kind": "imu",
                        "position": [*place],
                        "rpy": [*rpy],
                        "gyro": {},
                        "accelerometer": {},
                    }
                },
                "initial": {
                    "rate": [1.0, -2.0, 0.5],
                    "joints": [*joints],
                    "joint_rates": [3.0, -4.0],
                },
                "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 2.0]}},
            }
        )
    )
    given = [(0.3, -0.2), (-0.4, 0.1), (0.2, 0.3)]
    for efforts in given:
        session.step(
            Command(rotor_speeds=(420.0, 480.0, 450.0, 430.0), efforts=efforts)
        )
    log, truth = session.log, session.scenario.plant
    model = build_spec(truth.vehicle, truth.gravity).compile()
    data, (q, v) = mujoco.MjData(model), joint_addresses(truth.vehicle, model)
    data.qpos[q] = joints
    mujoco.mj_forward(model, data)
    R = Rotation.from_euler("ZYX", rpy[::-1]).as_matrix()
    for i, before in enumerate([data.qfrc_bias[v], *given[:-1]]):
        state = State(
            position=Vec3(*log.position[i]),
            quaternion=Quaternion(*log.quaternion[i]),
            velocity=Vec3(*log.velocity[i]),
            rate=Vec3(*log.rate[i]),
            joints=tuple(log.joints[i]),
            joint_rates=tuple(log.joint_rates[i]),
            rotor_speeds=tuple(log.rotor_speeds[i]),
        )
        orders = Command(rotor_speeds=tuple(log.rotor_speeds[i]), efforts=tuple(before))
        force, torques = applied_force(motion_of(truth, state, STILL), orders, STILL)
        base, _ = dynamics.forward_dynamics(
            truth.vehicle, state.joints, state.rate, state.joint_rates, force, torques
        )
        f, alpha, rate = (
            np.array([*map(float, each)])
            for each in (base.linear, base.angular, state.rate)
        )
        felt = R.T @ (
            f + np.cross(alpha, place) + np.cross(rate, np.cross(rate, place))
        )
        np.testing.assert_allclose(
            log.readings["imu"]["specific_force"][i],
            felt,
            atol=1e-9,
            err_msg=f"row {i}",
        )


@pytest.mark.parametrize("seed", range(5))
def test_mounts_read_what_mujoco_s_sensors_read_at_their_sites(seed):
    vehicle, state, command = swinging(seed)
    spec = build_spec(vehicle, G)
    mounts = drawn_mounts(2 + seed, 10)
    base = spec.worldbody.first_body()
    for i, (place, rpy) in enumerate(mounts):
        quaternion = Rotation.from_euler("ZYX", rpy[::-1]).as_quat()[[3, 0, 1, 2]]
        base.add_site(name=f"imu{i}", pos=place, quat=quaternion)
        for kind in (
            mujoco.mjtSensor.mjSENS_GYRO,
            mujoco.mjtSensor.mjSENS_ACCELEROMETER,
        ):
            spec.add_sensor(
                name=f"{kind.name}{i}",
                type=kind,
                objtype=mujoco.mjtObj.mjOBJ_SITE,
                objname=f"imu{i}",
            )
    model = spec.compile()
    data, (q, v) = mujoco.MjData(model), joint_addresses(vehicle, model)
    orders = Command(rotor_speeds=command[:4], efforts=command[4:])
    wrench, torques = applied_force(
        motion_of(Truth(vehicle=vehicle, gravity=G), state, WIND), orders, WIND
    )
    R = Rotation.from_quat([*state.quaternion], scalar_first=True).as_matrix()
    data.qpos[:7], data.qpos[q] = [*state.position, *state.quaternion], state.joints
    data.qvel[:6], data.qvel[v] = [*state.velocity, *state.rate], state.joint_rates
    data.qfrc_applied[:3], data.qfrc_applied[3:6] = (
        R @ np.array([*wrench.force]),
        [*wrench.torque],
    )
    data.qfrc_applied[v] = torques
    mujoco.mj_forward(model, data)
    for i, (place, rpy) in enumerate(mounts):
        turned, read = reading_of(
            imu_at(place, rpy), state, base_of(RigidBodyPlant, seed)
        )
        scale = max(1.0, np.abs(read).max())
        np.testing.assert_allclose(
            turned, data.sensor(f"mjSENS_GYRO{i}").data, atol=1e-12 * scale
        )
        np.testing.assert_allclose(
            read, data.sensor(f"mjSENS_ACCELEROMETER{i}").data, atol=1e-10 * scale
        )


MOUNT = {
    "sensors__imu__position": [0.12, -0.05, 0.08],
    "sensors__imu__rpy": [0.4, -0.3, 2.0],
}
EXACT = {
    "sensors__imu__gyro": {},
    "sensors__imu__accelerometer": {},
    "sensors__mocap__position": {},
}
EXACT |= {"sensors__mocap__attitude": {}}


def same(a: skyarm.Log, b: skyarm.Log) -> bool:
    return all(
        np.array_equal(x, y)
        for x, y in zip(a.arrays().values(), b.arrays().values(), strict=True)
    )


def off(log: skyarm.Log, name: str) -> float:
    """Root mean square error of an estimate after the first half second."""
    return float(
        np.sqrt(((log.estimate[name] - log[name])[100:] ** 2).sum(axis=1).mean())
    )


def test_the_filter_knows_where_its_inertial_unit_is():
    """Without errors of the sensors it is off by little at any mount, and by far more
    where it believes another.
    """
    mounted = skyarm.run(estimated(duration=1.0, **EXACT, **MOUNT))
    lost = skyarm.run(
        estimated(
            duration=1.0, **EXACT, **MOUNT, estimator__imu_position=[0.0, 0.0, 0.0]
        )
    )
    assert off(mounted, "position") < 3e-4
    assert off(mounted, "velocity") < 3e-3
    assert off(lost, "velocity") > 20.0 * off(mounted, "velocity")


def test_a_base_that_spins_ever_faster_in_place_feels_gravity_alone_at_its_origin():
    """Closed form: at r on the x axis the inertial unit feels -omega^2 r and alpha r,
    and moves at omega r.
    """
    scenario = estimated(**MOUNT | {"sensors__imu__position": [0.2, 0.0, 0.0]})
    model, period, alpha = scenario.controller.par.model, 0.005, 3.0
    estimator = scenario.agent.placed_estimator.believing(model.vehicle, model.gravity)
    memory, still = (
        estimator.start(model.vehicle),
        Command(rotor_speeds=(0.0,) * 4, efforts=(0.0, 0.0)),
    )
    R = Rotation.from_euler("ZYX", MOUNT["sensors__imu__rpy"][::-1])
    for k in range(200):
        t = k * period
        rate, turned = alpha * t, Rotation.from_rotvec([0.0, 0.0, 0.5 * alpha * t * t])
        felt = R.inv().apply([-0.2 * rate * rate, 0.2 * alpha, model.gravity])
        readings = {
            "imu": ImuReading(
                time=t,
                rate=Vec3(*R.inv().apply([0.0, 0.0, rate])),
                specific_force=Vec3(*felt),
            ),
            "mocap": PoseReading(
                time=t,
                position=Vec3(1.0, 2.0, 3.0),
                quaternion=Quaternion(*turned.as_quat(scalar_first=True)),
            ),
            "encoders": EncoderReading(
                time=t, joints=(0.0, 0.0), joint_rates=(0.0, 0.0)
            ),
        }
        memory, told = estimator.step(memory, readings, still, period)
    np.testing.assert_allclose(
        [*told.position, *told.velocity], [1.0, 2.0, 3.0, 0.0, 0.0, 0.0], atol=1e-3
    )
    np.testing.assert_allclose(
        [*told.specific_force], [0.0, 0.0, model.gravity], atol=1e-2
    )
    # which lags behind the present
    turned = Rotation.from_rotvec([0.0, 0.0, 0.5 * alpha * memory.time**2])
    np.testing.assert_allclose(
        [*memory.belief.position],
        np.add(turned.apply([0.2, 0.0, 0.0]), (1.0, 2.0, 3.0)),
        atol=1e-3,
    )


def test_engines_and_plants_agree():
    given = {
        "duration": 0.05,
        "estimator__force": "modelled",
        "plant__integrator": "euler",
    }
    scenario = estimated(**given, **MOUNT)
    log = skyarm.run(scenario)
    assert same(log, run_in_python(scenario))
    theirs = skyarm.run(estimated(**given, **MOUNT, plant__kind="mujoco"))
    for name in ("rate", "specific_force"):
        ours = log.readings["imu"][name]
        np.testing.assert_allclose(
            theirs.readings["imu"][name], ours, atol=1e-5 * np.abs(ours).max()
        )


def test_a_mount_of_zeros_reads_the_bits_of_none_and_is_not_written():
    zero = Vec3(0.0, 0.0, 0.0)
    none, written = Imu(**PERFECT), Imu(position=zero, rpy=zero, **PERFECT)
    assert plain(none) == plain(written)
    assert plain(none).keys() & {"position", "rpy"} == set()
    for seed in range(5):
        state, base = swinging(seed)[1], base_of(RigidBodyPlant, seed)
        np.testing.assert_array_equal(
            reading_of(written, state, base), reading_of(none, state, base)
        )
    scenario = estimated()
    assert scenario.agent.placed_estimator is scenario.agent.estimator


def test_a_mount_is_a_path_of_studies():
    scenario = estimated(duration=0.1, **MOUNT)
    moved = skyarm.with_numbers(
        scenario, {"sensors.imu.position.y": 0.2, "sensors.imu.rpy.x": -1.0}
    )
    (imu,) = (each.sensor for each in moved.agent.sensors if each.name == "imu")
    assert tuple(imu.position) == (0.12, 0.2, 0.08)
    again = {
        "sensors__imu__position": [0.12, 0.2, 0.08],
        "sensors__imu__rpy": [-1.0, -0.3, 2.0],
    }
    assert same(skyarm.run(moved), skyarm.run(estimated(duration=0.1, **again)))


def test_the_modelled_force_is_that_of_the_place():
    vehicle, state, _ = swinging(1)
    world, place = Truth(vehicle=vehicle, gravity=G), Vec3(0.1, -0.2, 0.05)
    efforts = (0.1,) * vehicle.n
    base, _ = acceleration(
        world, state, Command(rotor_speeds=state.rotor_speeds, efforts=efforts)
    )
    wanted = specific_force_at(place, base, state.rate)
    velocity, speeds = (
        state.quaternion.rotation().apply_T(state.velocity),
        (state.rotor_speeds,) * 2,
    )
    found = modelled_force(
        vehicle,
        velocity,
        state.rate,
        state.joints,
        state.joint_rates,
        speeds,
        efforts,
        place,
    )
    np.testing.assert_allclose([*found], [*wanted], rtol=1e-9, atol=1e-9)


def test_the_filter_predicts_the_force_at_its_place_from_the_velocity_of_the_base():
    scenario = estimated(**MOUNT, estimator__force="modelled")
    model, rate, speeds = (
        scenario.controller.par.model,
        Vec3(0.7, -0.4, 3.0),
        (480.0, 500.0, 470.0, 510.0),
    )
    estimator = scenario.agent.placed_estimator.believing(model.vehicle, model.gravity)
    start, place, velocity = (
        estimator.start(model.vehicle),
        Vec3(*MOUNT["sensors__imu__position"]),
        Vec3(1.0, -2.0, 0.5),
    )
    attitude = Quaternion.of_rotation_vector(Vec3(0.3, -0.2, 1.0))
    moving = attitude.rotation().apply(velocity + rate.cross(place))
    belief = replace(start.belief, velocity=moving, quaternion=attitude)
    memory = replace(start, started=1.0, belief=belief, rotor_speeds=speeds)
    R = Rotation.from_euler("ZYX", MOUNT["sensors__imu__rpy"][::-1])
    readings = {
        "imu": ImuReading(
            time=0.005,
            rate=Vec3(*R.inv().apply([*rate])),
            specific_force=Vec3(0.0, 0.0, 9.8),
        ),
        "mocap": PoseReading(
            time=0.0, position=Vec3(0.0, 0.0, 0.0), quaternion=attitude
        ),
        "encoders": EncoderReading(time=0.0, joints=(0.0, 0.0), joint_rates=(0.0, 0.0)),
    }
    orders = Command(rotor_speeds=speeds, efforts=(0.05, -0.02))
    after, _ = estimator.step(memory, readings, orders, 0.005)
    arm = after.joints.joints, after.joints.rates
    wanted = modelled_force(
        model.vehicle, velocity, rate, *arm, (speeds, speeds), orders.efforts, place
    )
    np.testing.assert_allclose([*after.modelled[-1]], [*wanted], rtol=0.0, atol=1e-12)


@dataclass(frozen=True, kw_only=True)
class Mine(skyarm.Sensor):
    """A user's own inertial unit, of no shipped kind: one that reads Imu's
    ``ImuReading``.
    """

    record = ImuReading

    @property
    def mounted_at(self) -> Vec3:
        return Vec3(*MOUNT["sensors__imu__position"])

    @property
    def turned_by(self) -> Vec3:
        return Vec3(*MOUNT["sensors__imu__rpy"])

    def measure(
        self,
        memory: Any,
        t: Any,
        state: State,
        specific_force: Vec3,
        draws: Any,
        dt: float,
    ) -> Any:
        R = mount_rotation(self.turned_by)
        force = R.apply_T(specific_force)
        return memory, ImuReading(
            time=t, rate=R.apply_T(state.rate), specific_force=force
        )


class Bare(Mine):
    def measure(self, memory: Any, t: Any, *rest: Any) -> Any:
        return memory, (t, 0.0)


class Counting(Bare):
    """A sensor whose ``record`` is a number: it declares no readings."""

    record = 3.0


def test_a_record_that_is_no_type_declares_no_readings():
    with registry_kept():
        skyarm.register.sensor("counting")(Counting)
        assert not reads(Counting(), ImuReading)
        assert (
            skyarm.run(
                estimated(duration=0.1, **EXACT, sensors__own={"kind": "counting"})
            ).status
            == "completed"
        )
        with pytest.raises(ValueError, match=r"needs one sensor of kind 'imu'"):
            estimated(sensors__imu={"kind": "counting"})


def test_an_inertial_unit_of_one_s_own_is_one_to_filter_export_and_autopilots(tmp_path):
    with registry_kept():
        skyarm.register.sensor("mine")(Mine)
        skyarm.register.sensor("bare")(Bare)
        text = flights.TEXT.replace('kind = "imu"', 'kind = "mine"')
        rows = [
            line
            for line in text.splitlines()
            if not line.startswith(("gyro", "accelerometer"))
        ]
        (tmp_path / "mine.toml").write_text("\n".join(rows), "utf-8")
        given = {name: each for name, each in EXACT.items() if "mocap" in name}
        scenario = estimated(duration=0.1, **given, sensors__imu={"kind": "mine"})
        assert same(
            skyarm.run(scenario), skyarm.run(estimated(duration=0.1, **EXACT, **MOUNT))
        )
        assert inertial_unit(scenario).mounted_at == Mine().mounted_at
        done = commands.skyarm(
            "export",
            str(tmp_path / "mine.toml"),
            "--to",
            "mjcf",
            "-o",
            str(tmp_path / "mine.xml"),
        )
        assert done.code == 0, done.err
        with pytest.raises(
            ValueError, match=r"gives a reading that is .*: must be of type ImuReading"
        ):
            skyarm.run(estimated(duration=0.1, sensors__imu={"kind": "bare"}))
        with pytest.raises(
            ValueError, match=r"needs one sensor of kind 'imu'.*there are 2"
        ):
            estimated(sensors__more={"kind": "mine"})
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "mine.xml"))
    np.testing.assert_allclose(model.site("imu").pos, MOUNT["sensors__imu__position"])
    assert {model.sensor(i).name for i in range(model.nsensor)} >= {
        "imu_gyro",
        "imu_acc",
    }


def test_a_plant_that_knows_no_turning_is_refused_in_one_line():
    class Forgetful:
        several = True

        def __init__(self, *given: Any) -> None:
            self.vehicle = estimated().plant.vehicle

        advance = specific_force = None

    scenario = estimated(**MOUNT)
    around = first_surroundings(scenario, first_loop_state(scenario))
    with pytest.raises(
        ScenarioError,
        match="must define angular_acceleration for a sensor beside the base origin",
    ):
        CalledPlant(Forgetful(), Stages(scenario), around)
