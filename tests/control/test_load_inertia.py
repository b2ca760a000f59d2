"""Moments of inertia of a load: the torques that tell of them, least squares, what a body can have, flights."""

from __future__ import annotations

import copy
import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import skyarm
from skyarm import dynamics
from skyarm.algebra import Mat3, Motion, Quaternion, Sym3, Vec3
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.load import InertiaGains, LoadGains, first_inertia, first_load, stout, with_learned
from skyarm.control.laws.centroidal.load_inertia import consistent, learn_inertia, unit_torques
from skyarm.control.model import Model
from skyarm.dynamics.kinematics import frame_pose, jacobian_columns
from skyarm.records.plain import plain
from skyarm.records.restore import restore
from skyarm.scenario.scenario_file import scenario_from
from skyarm.vehicle.linkage import Body

ARM = skyarm.load_vehicle("hexarotor_arm6")
JOINTS = np.array([0.1, -0.6, -0.97, 0.2, -0.8, 0.3])
TILTED = Quaternion(0.9, 0.1, -0.2, 0.3).normalized().rotation()
GAINS = InertiaGains(stout=(0.1, 0.1, 0.1))
DT, LATE, MASS, SIZE = 0.005, 0.03, 0.3, 0.01


def signals_at(t, amplitudes=(0.3, 0.2, 0.25, 0.4, 0.35, 0.5), paces=(1.0, 2.2, 3.1, 2.6, 4.0, 5.2), yaw=0.6):
    """x, y, z, yaw and joints, with four derivatives each."""

    def wave(size, pace, phase, offset):
        shapes = [np.sin, np.cos, lambda a: -np.sin(a), lambda a: -np.cos(a), np.sin]
        parts = [float(size * pace**k * f(pace * t + phase)) for k, f in enumerate(shapes)]
        return Taylor.of_derivatives([parts[0] + float(offset), *parts[1:]])

    still = [Taylor.constant(0.0, 4)] * 3
    heading = wave(yaw, 0.9, 0.4, 0.2)
    rows = zip(amplitudes, paces, JOINTS, strict=True)
    return [*still, heading, *(wave(a, w, i, q) for i, (a, w, q) in enumerate(rows))]


def tip_rotation(t, **waves):
    signals = signals_at(t, **waves)
    pose = frame_pose(ARM, ARM.frame(), [float(q.derivative(0)) for q in signals[4:]])
    R = np.array([[float(c) for c in row] for row in pose.R.rows])
    return Rotation.from_euler("z", float(signals[3].derivative(0))) * Rotation.from_matrix(R)


@pytest.mark.parametrize("axis", range(3))
def test_a_torque_is_how_the_angular_momentum_of_a_load_changes(axis):
    """Differences of R I R^T w, w by differences of SciPy's rotations."""
    moments, h = np.zeros(3), 1e-4
    moments[axis] = 1.0

    def momentum(t):
        w = (tip_rotation(t + h) * tip_rotation(t - h).inv()).as_rotvec() / (2.0 * h)
        R = tip_rotation(t).as_matrix()
        return R @ (moments * (R.T @ w))

    for t in (0.3, 1.1):
        expected = (momentum(t + h) - momentum(t - h)) / (2.0 * h)
        assert [*unit_torques(ARM, signals_at(t))[axis]] == pytest.approx(
            expected, abs=2e-5 * np.abs(expected).max() + 1e-6
        )


def fly(true, seconds=6.0, gains=GAINS, memory=None, noise=0.0, bias=0.0, learns=1.0, holds=True, seed=0, **waves):
    """The memory after some time in which joints feel what the model lacks of the load's moments."""
    memory = first_inertia(6) if memory is None else memory
    rng, once, twice, share = np.random.default_rng(seed), np.zeros((3, 3)), np.zeros((3, 3)), 1.0 - np.exp(-DT / LATE)
    columns = np.array([[float(c) for c in each.angular] for each in jacobian_columns(ARM, ARM.frame(), JOINTS)])
    R = np.array([[float(c) for c in row] for row in TILTED.rows])
    for i in range(round(seconds / DT)):
        unit = tuple(Vec3(*(float(c) for c in each)) for each in unit_torques(ARM, signals_at(i * DT, **waves)))
        once += (np.array([[*each] for each in unit]) - once) * share
        twice += (once - twice) * share
        lacks = np.array(true) - [float(c) for c in memory.moments]
        efforts = -columns @ (R.T @ (lacks @ twice)) + noise * rng.normal(size=6) + bias
        memory = learn_inertia(
            gains,
            memory,
            MASS,
            SIZE,
            ARM,
            TILTED,
            tuple(JOINTS.tolist()),
            unit,
            tuple(efforts.tolist()),
            holds,
            learns,
            LATE,
            DT,
        )
    return memory


@pytest.mark.thorough
def test_the_moments_of_a_load_that_is_turned_about_every_axis_are_found():
    true = (2.2e-3, 1.5e-3, 0.9e-3)
    assert [*fly(true).moments] == pytest.approx(true, rel=0.03)
    assert [*fly(true, noise=5e-3, bias=0.02).moments] == pytest.approx(true, rel=0.08)


@pytest.mark.thorough
def test_an_axis_about_which_nothing_turns_stays_small_and_moments_stay_those_of_a_body():
    only = {"amplitudes": (0.0, 0.0, 0.0, 0.0, 0.5, 0.0), "yaw": 0.0}
    memory = fly((2.0e-3, 2.0e-3, 3e-5), gains=dataclasses.replace(GAINS, stout=(0.1, 0.1, 1e-5)), **only)
    x, y, z = memory.moments
    assert y == pytest.approx(2.0e-3, rel=0.04)
    assert z == pytest.approx(MASS * SIZE**2, rel=0.05)
    assert x >= y - z
    still = fly((2.0e-3, 2.0e-3, 3e-5), amplitudes=(0.0,) * 6, yaw=0.0, seconds=2.0)
    assert [*still.moments] == pytest.approx([MASS * SIZE**2] * 3, rel=1e-3)


@pytest.mark.thorough
def test_what_was_found_stays_while_the_hand_rests_and_goes_with_the_load():
    true = (2.2e-3, 1.5e-3, 0.9e-3)
    known = fly(true, seconds=4.0)
    rests = fly(true, seconds=4.0, memory=known, amplitudes=(0.0,) * 6, yaw=0.0)
    assert [*rests.moments] == pytest.approx([*known.moments], rel=0.05)
    held = fly((5e-3,) * 3, seconds=1.0, memory=known, learns=0.0)
    assert [*held.A, *held.b] == [*known.A, *known.b]
    gone = fly(true, seconds=DT, memory=known, holds=False)
    assert [*gone.moments, *gone.A, *gone.b] == [0.0] * 12
    assert [each.effort for each in gone.means] == [0.0] * 6


@pytest.mark.thorough
def test_a_load_that_is_changed_is_learned_anew():
    known = fly((2.2e-3, 1.5e-3, 0.9e-3), seconds=4.0)
    assert [*fly((1.0e-3, 1.2e-3, 1.4e-3), seconds=8.0, memory=known).moments] == pytest.approx(
        (1.0e-3, 1.2e-3, 1.4e-3), rel=0.08
    )


def bodies(n=30):
    """Moments of clouds of points that lie evenly to both sides of the axes: sums of m (y^2 + z^2) and so on."""
    points = np.random.default_rng(6).normal(size=(n, 40, 3)) * np.random.default_rng(7).uniform(0.01, 0.1, (n, 1, 3))
    second = MASS * (points**2).mean(axis=1)
    return second.sum(axis=1, keepdims=True) - second


def test_moments_of_bodies_are_left_as_they_are():
    for moments in bodies():
        if moments.min() > 2.0 * MASS * SIZE**2 and (moments.sum() / 2.0 - moments).min() > MASS * SIZE**2:
            assert [*consistent(GAINS, MASS, SIZE, Vec3(*moments))] == pytest.approx(moments, rel=1e-12)


def test_any_moments_become_those_of_a_body_and_the_stouter_axis_takes_what_lacks():
    for moments in np.random.default_rng(8).normal(size=(200, 3)) * 2e-3:
        found = np.array([*consistent(GAINS, MASS, SIZE, Vec3(*moments))])
        assert found.min() >= MASS * SIZE**2 * (1.0 - 1e-12)
        assert (found.sum() - 2.0 * found).min() >= MASS * SIZE**2 * (1.0 - 1e-9)
        assert found.max() <= 2.0 * MASS * GAINS.furthest**2 + 1e-12
    gains = dataclasses.replace(GAINS, stout=(3.0, 1.0, 1.0))
    least = MASS * SIZE**2
    found = consistent(gains, MASS, SIZE, Vec3(least, 2e-3, least))
    assert [*found] == pytest.approx([least + 0.75 * (2e-3 - least), 2e-3, least + 0.25 * (2e-3 - least)])
    known = consistent(gains, MASS, SIZE, Vec3(least, 2e-3, least), (1e6, 1.0, 1.0))  # x is known to be small
    assert known.x == pytest.approx(least, rel=1e-3)
    assert consistent(gains, MASS, SIZE, Vec3(1.0, 0.0, 0.0)).x == pytest.approx(2.0 * MASS * GAINS.furthest**2)


def test_how_stout_a_vehicle_is_about_its_tip_is_that_of_numpy():
    M = np.array([[float(c) for c in row] for row in dynamics.mass_matrix(ARM, Mat3.identity(), (0.0,) * 6)])
    columns = [[*each.angular] for each in jacobian_columns(ARM, ARM.frame(), (0.0,) * 6)]
    J = np.vstack([np.zeros((3, 3)), np.eye(3), np.array(columns, dtype=float)]).T
    assert stout(ARM) == pytest.approx(1.0 / np.diag(J @ np.linalg.inv(M) @ J.T))  # the tip's axes are the base's here
    assert stout(ARM)[2] == pytest.approx(1.8e-5, rel=0.05)  # the hand's own roll


def test_a_batch_equals_a_loop():
    rng = np.random.default_rng(1)
    first = fly((2.2e-3, 1.5e-3, 0.9e-3), seconds=0.2)
    efforts, masses = rng.normal(size=(6, 5)) * 0.05, rng.uniform(0.1, 0.5, 5)
    unit = tuple(Vec3(*(float(c) for c in each)) for each in unit_torques(ARM, signals_at(0.7)))

    def one(mass, e):
        return learn_inertia(
            GAINS, first, mass, SIZE, ARM, TILTED, tuple(JOINTS.tolist()), unit, tuple(e), True, 1.0, LATE, DT
        )

    many = one(masses, efforts)
    for i in range(5):
        alone = one(float(masses[i]), efforts[:, i].tolist())
        assert [each[i] for each in many.moments] == pytest.approx([*alone.moments], rel=1e-9)
        assert [np.broadcast_to(each, 5)[i] for each in many.b] == pytest.approx([*alone.b], rel=1e-9)


def test_the_model_holds_the_moments_in_the_axes_of_the_tip():
    frame = dataclasses.replace(ARM.frame(), rotation=Quaternion(0.8, 0.6, 0.0, 0.0).rotation())
    vehicle = dataclasses.replace(ARM, frames=(frame, *ARM.frames[1:]))
    moments, place = np.array([2.2e-3, 1.5e-3, 0.9e-3]), np.array([0.01, -0.02, 0.015])
    inertia = dataclasses.replace(first_inertia(6), moments=Vec3(*moments))
    memory = dataclasses.replace(first_load(6, True), mass=MASS, place=Vec3(*place), inertia=inertia)
    loaded = with_learned(Model(vehicle=vehicle), LoadGains(limit=0.5, inertia=GAINS), memory).vehicle
    R = np.array([[float(c) for c in row] for row in frame.rotation.rows])
    turned = Mat3(*(Vec3(*row) for row in (R @ np.diag(moments) @ R.T).tolist()))
    com = Vec3(*(np.array([*frame.position]) + R @ place).tolist())
    expected = ARM.links[frame.link].body.merge(Body(mass=MASS, com=com, inertia=Sym3.of_matrix(turned)))
    found = loaded.links[frame.link].body
    assert [*found.inertia.entries] == pytest.approx([*expected.inertia.entries], abs=1e-12)
    assert [*found.com] == pytest.approx([*expected.com])


def document(li=True, seed=0, noisy=True):
    """The paper's vehicle takes a bar of 0.3 m whose long axis lies across its tip's z, and swings its hand."""
    swing = {"kind": "sine", "amplitude": 0.3, "frequency_hz": 1.0}
    eased = {
        "kind": "product",
        "signal": swing,
        "factor": {"kind": "ramp", "start": 1.3, "duration": 0.7, "height": 1.0},
    }
    found = {
        "schema": 1, "name": "bar", "duration": 4.5, "seed": seed,
        "plant": {"vehicle": "hummingbird_arm2_rotors"}, "model": {"vehicle": "hummingbird_arm2"},
        "controller": {"law": "centroidal", "mode": "tip", "preset": "robust", "load": 0.3, "load_inertia": li},
        "reference": {
            "base": {"kind": "signals", "z": 1.0}, "joints": [0.5, [-1.0, eased]],
            "load": {"kind": "windowed", "signal": 1.0, "start": 1.0, "stop": 4.25},
        },
        "payloads": [{"name": "bar", "mass": 0.1, "pick": 1.0, "drop": 4.25, "inertia": [5e-6, 7.5e-4, 7.5e-4]}],
    }  # fmt: skip
    if noisy:
        noise = {
            "position": 1e-3,
            "velocity": 1e-2,
            "attitude": 2e-3,
            "rate": 1e-2,
            "joints": 1e-3,
            "joint_rates": 1e-2,
        }
        found |= {"sensors": noise, "delays": {"measurement": 0.005}}
    return copy.deepcopy(found)


def wrist_torque(moments, amplitude=0.2, pace=9.0):
    """Torques of the last joint in another motion of a loaded arm whose base rests, N m."""
    arm = skyarm.load_vehicle("hummingbird_arm2")
    tip = arm.frame()
    load = Body(mass=0.1, com=tip.position, inertia=Sym3(*(float(c) for c in moments)).rotate(tip.rotation))
    vehicle, found = arm.with_body(tip.link, load), []
    for t in np.linspace(0.0, 2.0 * np.pi / pace, 30, endpoint=False):
        q, qd = (0.5, -1.0 + amplitude * np.sin(pace * t)), (0.0, amplitude * pace * np.cos(pace * t))
        qdd = (0.0, -amplitude * pace**2 * np.sin(pace * t))
        at_rest = Motion(Vec3(0.0, 0.0, 0.0), Vec3(0.0, 0.0, 9.81))
        found.append(float(dynamics.inverse_dynamics(vehicle, q, Vec3(0.0, 0.0, 0.0), qd, at_rest, qdd)[1][1]))
    return np.array(found)


def test_a_bar_is_learned_in_flight_and_foretells_the_torque_of_another_motion():
    log = skyarm.run(scenario_from(document()))
    assert log.status == "completed"
    before = log.load_inertia_found[np.searchsorted(log.time, 4.2)]
    assert before[1] == pytest.approx(7.5e-4, rel=0.2)
    assert not log.load_inertia_found[log.time < 1.0].any()
    assert not log.load_inertia_found[log.time > 4.26].any()
    true, point, learned = (wrist_torque(each) for each in ([5e-6, 7.5e-4, 7.5e-4], [1e-5] * 3, before))
    assert np.std(learned - true) < 0.25 * np.std(point - true)


@pytest.mark.thorough
def test_the_tip_is_nearer_to_its_reference_with_the_moments_of_a_bar():
    logs = [skyarm.run(scenario_from(document(li=li, noisy=False))) for li in (True, False)]
    errors = [
        np.linalg.norm((log.tip - log.tip_reference)[(log.time > 3.2) & (log.time < 4.2)], axis=1) for log in logs
    ]
    assert np.sqrt((errors[0] ** 2).mean()) < 0.5 * np.sqrt((errors[1] ** 2).mean())


def test_the_moments_are_an_option_that_stands_in_files_and_logs(tmp_path):
    scenario = scenario_from(document(noisy=False))
    par = scenario.controller.par
    assert restore(plain(par)) == par
    assert "parts.load.inertia" in par.choices()
    assert scenario_from(document(li=False)).controller.memory.parts.load.inertia == ()
    short = skyarm.run(dataclasses.replace(scenario, duration=1.2))
    kept = skyarm.load_log(skyarm.save_log(short, tmp_path / "x.npz"))
    assert np.array_equal(kept.load_inertia_found, short.load_inertia_found)
    head = skyarm.save_log(short, tmp_path / "x.csv").read_text().split("\n", 1)[0]
    assert "load_inertia_found_x [kg m^2]" in head


@pytest.mark.parametrize("options", [{"mode": "tip"}, {"mode": "joint", "load": 0.3}])
def test_moments_without_a_mass_or_without_a_tip_that_is_kept_are_refused(options):
    with pytest.raises(ControllerError, match=r"controller\.load_inertia = true: must be false") as error:
        make_centroidal(Model(vehicle=ARM), load_inertia=True, **options)
    assert "\n" not in str(error.value)
