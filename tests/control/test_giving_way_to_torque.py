"""The tip gives way to a torque as inertia, damper and spring: what is heard, flights, options, a sensor, C."""

from __future__ import annotations

import copy
import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import skyarm
from c_compiler import needs_cc
from exported_law import Loaded
from law_parts import with_parts
from skyarm.algebra import E_Z, Quaternion, Vec3, axis_rotation
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks.prediction import Disturbance
from skyarm.control.controller import senses_torque
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.admittance import shift_reference
from skyarm.control.laws.centroidal.tip_force import ForceErrors, levers, tip_wrench
from skyarm.control.model import Model
from skyarm.control.onboard.export_c import export_c
from skyarm.dynamics.kinematics import frame_pose, jacobian_columns
from skyarm.records.plain import plain
from skyarm.records.restore import restore
from skyarm.reference import Reference
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_checks import sensor_offset
from skyarm.scenario.scenario_file import scenario_from
from skyarm.sensing.measurement import blank_measurement
from skyarm.vehicle.vehicle_records import Frame

HEXAROTOR = skyarm.load_vehicle("hexarotor_arm6")
J, D, K, START, RISE = 0.05, 0.3, 0.45, 2.25, 0.5
TURNS = {"inertia": [J] * 3, "damping": [D] * 3, "stiffness": [K] * 3}
HELD = {"mass": [0.0] * 3, "damping": [0.0] * 3, "stiffness": [0.0] * 3}
SOFT = {"mass": [1.0] * 3, "damping": [6.0] * 3, "stiffness": [9.0] * 3}
BENT = (0.0, -0.6, -0.97, 0.0, -0.8, 0.0)


def law_of(admittance=None, **options):
    table = {**HELD, "rotation": TURNS} if admittance is None else admittance
    return make_centroidal(Model(vehicle=HEXAROTOR), mode="tip", admittance=table, **options)


def array(matrix):
    return np.array([[float(c) for c in row] for row in matrix.rows])


def pulls(at, turns, force, torque):
    """What a force and a torque at the tip do to base and joints, by the principle of virtual work."""
    own, twist = at.R.apply_T(Vec3(*force)), at.R.apply_T(Vec3(*torque))
    efforts = tuple(c.dot(own) + w.dot(twist) for c, w in zip(at.columns, turns, strict=True))
    return Disturbance(force=Vec3(*force), torque=at.tip.cross(own) + twist, efforts=efforts)


def at_tilt(joints=BENT):
    quaternion = Quaternion(math.cos(0.2), 0.0, 0.6 * math.sin(0.2), 0.8 * math.sin(0.2))
    at = levers(HEXAROTOR, quaternion.rotation(), joints)
    return quaternion, at, [c.angular for c in jacobian_columns(HEXAROTOR, HEXAROTOR.frame(), joints)]


def test_force_and_torque_are_told_apart_beside_a_bias():
    _, at, turns = at_tilt()
    force, torque = (0.5, -0.3, 0.8), (0.1, -0.2, 0.05)
    found = tip_wrench(HEXAROTOR, ForceErrors(), at, turns, pulls(at, turns, force, torque))
    assert [*found[0]] == pytest.approx(force, abs=1e-9)
    assert [*found[1]] == pytest.approx(torque, abs=1e-9)


def test_force_and_torque_are_the_least_squares_of_numpy():
    rng, errors = np.random.default_rng(5), ForceErrors(turning=0.01, sliding=0.02, base=0.1)
    _, at, turns = at_tilt()
    efforts, force, torque = rng.normal(size=6) * 0.1, rng.normal(size=3), rng.normal(size=3) * 0.1
    d = Disturbance(force=Vec3(*force), torque=Vec3(*torque), efforts=tuple(efforts))
    x, y, z = at.tip
    joints = np.array([[*c, *w] for c, w in zip(at.columns, turns, strict=True)]) / errors.turning
    turning = np.hstack([np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]), np.eye(3)]) / errors.base
    rows = np.vstack([joints, turning, np.hstack([np.eye(3), np.zeros((3, 3))])])
    R = array(at.R)
    wanted = np.linalg.lstsq(rows, [*efforts / errors.turning, *torque / errors.base, *(R.T @ force)], rcond=None)[0]
    found = tip_wrench(HEXAROTOR, errors, at, turns, d)
    assert np.allclose([[*each] for each in found], [R @ wanted[:3], R @ wanted[3:]], rtol=1e-9, atol=1e-9)


def gave_way(law, force=(0.0,) * 3, torque=(0.0,) * 3, told=(), twisted=(), felt=None, **hearing):
    """One period of giving way after the first seconds: memory and signals."""
    quaternion, at, turns = at_tilt()
    d = pulls(at, turns, force, torque)
    observed = dataclasses.replace(
        law.memory.observed, quaternion=quaternion, joints=BENT, force=d.force, torque=d.torque, efforts=d.efforts
    )
    first = law.memory.parts.admittance
    twist = dataclasses.replace(first.channels[1], **(hearing.pop("turned", {})))
    push = dataclasses.replace(first.channels[0], quiet=hearing.pop("quiet", 0.0))
    first = dataclasses.replace(first, channels=(push, twist), **{"age": 2.0, **hearing})
    rest = [Taylor((float(q), 0.0, 0.0, 0.0, 0.0)) for q in (0.0, 0.0, 1.5, 0.0, *BENT)]
    return shift_reference(law.par.parts.admittance, first, HEXAROTOR, observed, rest, (told, twisted), 0.005)


def test_a_torque_above_its_threshold_turns_the_reference_in_its_direction():
    law = law_of()
    for axis in range(3):
        torque = [0.0] * 3
        torque[axis] = 0.2
        memory, signals = gave_way(law, torque=torque)
        assert [*memory.channels[1].value] == pytest.approx(torque, abs=1e-9)
        assert memory.channels[1].detected == 1.0
        rate = 0.2 * 0.005 / J * (1.0 - D * law.par.parts.admittance.rotation.body.lead / J)
        assert [*memory.channels[1].body.rate] == pytest.approx([rate * (i == axis) for i in range(3)], rel=0.02)
        rates = np.array([q.derivative(1) for q in signals[4:]])
        columns = [[*c.angular] for c in jacobian_columns(HEXAROTOR, HEXAROTOR.frame(), BENT)]
        assert (np.array(columns).T @ rates)[axis] > 0.0
    quiet, signals = gave_way(law, torque=(0.0, 0.04, 0.0))
    assert quiet.channels[1].detected == 0.0
    assert [q.derivative(0) for q in signals[4:]] == pytest.approx(BENT, abs=1e-15)
    before, _ = gave_way(law, torque=(0.0, 0.2, 0.0), age=1.0)
    assert before.channels[1].detected == 0.0


def test_a_force_moves_the_tip_and_a_torque_turns_it_each_by_its_own_threshold():
    law = law_of({**SOFT, "rotation": {**TURNS, "threshold": 0.3}})
    both, signals = gave_way(law, force=(0.5, 0.0, 0.0), torque=(0.0, 0.2, 0.0))
    assert (both.channels[0].detected, both.channels[1].detected) == (1.0, 0.0)
    assert [*both.force] == pytest.approx([0.5, 0.0, 0.0], abs=1e-9)
    assert signals[0].derivative(1) > 0.0
    assert [q.derivative(1) for q in signals[4:]] == pytest.approx([0.0] * 6, abs=1e-12)


def test_nothing_is_learned_while_a_torque_is_heard():
    law = law_of()
    loud, _ = gave_way(law, torque=(0.0, 0.2, 0.0), quiet=9.0)
    calm, _ = gave_way(law, torque=(0.0, 0.02, 0.0), quiet=9.0, turned={"quiet": 9.0})
    late, _ = gave_way(law, torque=(0.0, 0.02, 0.0), quiet=9.0, turned={"quiet": 0.4})
    assert [law.par.parts.admittance.force_cleared(m) for m in (loud, late, calm)] == [0.0, 0.0, 1.0]
    assert [*loud.bias.torque, *loud.bias.efforts] == [0.0] * 9
    assert calm.bias.torque.y > 0.0
    # patience: it stays heard for 0.3 s
    after, _ = gave_way(law, torque=(0.0, 0.02, 0.0), turned={"detected": 1.0, "quiet": 0.2})
    over, _ = gave_way(law, torque=(0.0, 0.02, 0.0), turned={"detected": 1.0, "quiet": 0.3})
    assert (after.channels[1].detected, over.channels[1].detected) == (1.0, 0.0)


def test_a_sensor_tells_the_torque_in_the_axes_of_the_tip_without_its_bias():
    law, bias, told = law_of(force_sensor=True), (0.1, -0.05, 0.02), np.array([-2.0, 0.5, 1.0])
    assert senses_torque(law.par)
    assert not senses_torque(law_of().par)
    assert not senses_torque(law_of(SOFT, force_sensor=True).par)
    memory, _ = gave_way(law, told=(0.0,) * 3, twisted=tuple(told), turned={"offset": Vec3(*bias)})
    _, at, _ = at_tilt()
    turned = array(at.R @ frame_pose(HEXAROTOR, HEXAROTOR.frame(), BENT).R)
    share = 1.0 - math.exp(-60.0 * 0.005)
    assert [*memory.channels[1].value] == pytest.approx(turned @ (share * told - bias))
    assert [*memory.channels[1].sensed] == pytest.approx(share * told)
    assert [*memory.channels[1].offset] == [*bias]
    assert law.par.parts.admittance.rotation.body.lead == pytest.approx(1.0 / 60.0)


def document(torque, seed=0, noisy=True, **changes) -> dict[str, Any]:
    """A hexarotor with its hand bent up; a torque about its tip that rises within half a second."""
    signals = [
        {"kind": "ramp", "start": START, "duration": RISE, "height": each, "shape": "linear"} if each else 0.0
        for each in torque
    ]
    found = {
        "schema": 1,
        "name": "hexarotor_turns",
        "duration": 5.5,
        "seed": seed,
        "plant": {"vehicle": "hexarotor_arm6"},
        "controller": {
            "law": "centroidal", "mode": "tip", "preset": "robust", "reach": 0.24, "damping": 0.06, "shift_limit": 0.4,
            "observer": [27.0, 31.0, 60.0, 60.0], "admittance": {**HELD, "rotation": TURNS},
        },
        "reference": {"base": {"kind": "signals", "z": 1.5}, "joints": list(BENT)},
        "environment": {"forces": [{"kind": "disturbance", "frame": "tip", "torque": signals}]},
    }  # fmt: skip
    if noisy:
        found["sensors"] = {
            "position": 1e-3, "velocity": 1e-2, "attitude": 2e-3, "rate": 1e-2, "joints": 1e-3, "joint_rates": 1e-2
        }  # fmt: skip
        found["delays"] = {"measurement": 0.005}
    return copy.deepcopy(found) | changes


def exact(t, torque):
    """The textbook's J a'' + D a' + K a = tau of the ramp, by SciPy."""
    solved = solve_ivp(
        lambda s, y: [y[1], (torque * min(max(s / RISE, 0.0), 1.0) - D * y[1] - K * y[0]) / J],
        (0.0, t[-1]), [0.0, 0.0], dense_output=True, max_step=0.02, rtol=1e-8, atol=1e-10,
    )  # fmt: skip
    return np.array([solved.sol(max(each, 0.0))[0] for each in t])


def turning(log):
    """Time since the torque, rotation vector of the tip from where it was (world axes), its way (m)."""
    t, tip = log.time - START, HEXAROTOR.frame()
    poses = [array(frame_pose(HEXAROTOR, tip, [float(q) for q in joints]).R) for joints in log.joints]
    R = Rotation.from_quat(np.roll(log.quaternion, -1, axis=1)) * Rotation.from_matrix(np.array(poses))
    then = (t > -0.3) & (t < 0.0)
    return t, (R * R[then].mean().inv()).as_rotvec(), log.tip - log.tip[then].mean(axis=0)


@pytest.mark.parametrize("noisy", [pytest.param(True, marks=pytest.mark.thorough), False])
@pytest.mark.parametrize("torque", [0.15, pytest.param(-0.15, marks=pytest.mark.thorough)])
def test_the_tip_answers_a_torque_as_the_body_that_was_chosen(torque, noisy):
    log = skyarm.run(scenario_from(document((0.0, torque, 0.0), noisy=noisy)))
    t, turned, way = turning(log)
    wanted = exact(t, torque)
    assert log.status == "completed"
    settled = turned[t > 2.8].mean(axis=0)
    assert settled[1] == pytest.approx(torque / K, rel=0.03)
    assert np.abs(settled[[0, 2]]).max() < 0.01
    assert np.abs(turned[t > 1.0, 1] - wanted[t > 1.0]).max() < 0.03 + 0.01 * noisy
    assert np.abs(way[t > 0.0]).max() < 0.008


def changed(**changes):
    found = document((0.0, 0.1, 0.0))
    found["controller"]["admittance"] = {**HELD, "rotation": {**TURNS, **changes}}
    return found


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"inertia": [1.0, 1.0]}, r"rotation\.inertia = \[1\.0, 1\.0\]: must be three numbers"),
        (
            {"inertia": [0.0] * 3, "damping": [0.0] * 3, "stiffness": [0.0] * 3},
            r"rotation\.inertia = .*: must be above 0 along an axis",
        ),
        ({"inertia": [0.0, 1.0, 1.0]}, r"rotation\.damping\[0\] = 0\.3: must be 0 along an axis of inertia 0"),
        ({"inertia": [1e-4, 1.0, 1.0]}, r"rotation\.inertia\[0\] = 0\.0001: must be 0 or from 0\.001 to 100"),
        ({"damping": [2.6, 0.1, 0.1]}, r"rotation\.damping\[0\] = 2\.6: must be at most 50 1/s times the inertia"),
        ({"stiffness": [0.1, -1.0, 1.0]}, r"rotation\.stiffness\[1\] = -1\.0: must be at least 0"),
        ({"threshold": -1.0}, r"rotation\.threshold = -1\.0: must be at least 0"),
        ({"mass": [1.0] * 3}, r"rotation\.mass"),
    ],
)
def test_tables_that_are_none_are_refused_by_field_and_value(changes, words):
    with pytest.raises(ValueError, match=words) as caught:
        scenario_from(changed(**changes))
    assert "\n" not in str(caught.value)


def test_an_arm_that_does_not_turn_its_tip_about_three_axes_is_refused():
    for name in ("hummingbird_arm2", "octo_coaxial_two_arms"):
        with pytest.raises(ValueError, match=f"admittance.rotation = .*'{name}' do not turn its tip about three axes"):
            make_centroidal(
                Model(vehicle=skyarm.load_vehicle(name)), mode="tip", admittance={**HELD, "rotation": TURNS}
            )
    five = {"mode": "tip", "admittance": {**HELD, "rotation": TURNS}}
    other = Model(vehicle=skyarm.load_vehicle("hexarotor12_arm5"))
    with pytest.raises(ValueError, match="without force_sensor: the joints of 'hexarotor12_arm5' do not move its tip"):
        make_centroidal(other, **five)
    assert make_centroidal(other, **five, force_sensor=True).par.parts.admittance.senses_torque
    with pytest.raises(ValueError, match=r"admittance\.mass = .*above 0 along an axis"):
        law_of(HELD)
    with pytest.raises(ValueError, match=r"admittance\.rotation = 3\.0: must be a table"):
        law_of({**HELD, "rotation": 3.0})


def test_a_law_that_turns_is_kept_told_of_and_varied_by_its_numbers():
    scenario = scenario_from(document((0.0, 0.1, 0.0)))
    par = scenario.controller.par
    assert restore(plain(par)) == par
    assert par.parts.admittance.rotation.body.lead == pytest.approx(2.0 / 60.0 + 0.005)
    varied = with_numbers(scenario, {"controller.parts.admittance.rotation.body.stiffness.1": 0.2})
    assert varied.controller.par.parts.admittance.rotation.body.stiffness == (K, 0.2, K)
    assert law_of(SOFT).par.parts.admittance.rotation is None
    assert law_of(SOFT).memory.parts.admittance.arm == ()
    tilted = law_of({**SOFT, "normal": [0.0, 0.0, 2.0], "rotation": TURNS}).par.parts.admittance
    assert tilted.rotation.body.axes == tilted.tip.axes


def test_the_sensor_of_a_flight_tells_the_torque_about_the_tip_wherever_on_the_hand_it_is():
    found = document((0.0, 0.0, 0.0), noisy=False, duration=2.5)
    found["controller"]["force_sensor"] = True
    force, torque = (
        [{"kind": "windowed", "signal": each, "start": 2.1, "stop": 9.0} for each in three]
        for three in ((0.5, -0.2, 0.3), (0.005, 0.1, -0.005))
    )
    found["environment"]["forces"] = [{"kind": "disturbance", "frame": "tip", "force": force, "torque": torque}]
    found["sensors"] = {"wrist": {"kind": "force_torque", "frame": "tip"}}
    scenario = scenario_from(found)
    tip = HEXAROTOR.frame()
    place = Frame(name="inside", link=tip.link, position=Vec3(0.01, 0.02, -0.02), rotation=axis_rotation(E_Z, 0.7))
    vehicle = dataclasses.replace(HEXAROTOR, frames=(*HEXAROTOR.frames, place))
    (wrist,) = scenario.sensors
    inside = dataclasses.replace(wrist, sensor=dataclasses.replace(wrist.sensor, frame="inside"))
    world = dataclasses.replace(scenario.plant, vehicle=vehicle)
    other = dataclasses.replace(scenario, plant=world, sensors=(inside,))
    at_tip, elsewhere = skyarm.run(scenario), skyarm.run(other)
    turned = turning(at_tip)[1]
    assert np.abs(turned[-1]).max() > 0.02
    assert np.abs(elsewhere.joints - at_tip.joints).max() < 1e-6
    assert [*sensor_offset([("wrist", inside.sensor)], vehicle)] == pytest.approx(
        array(tip.rotation).T @ (np.array([0.01, 0.02, -0.02]) - [*tip.position])
    )


@needs_cc
@pytest.mark.thorough
@pytest.mark.parametrize("sensor", [True, False])
def test_exported_c_turns_by_the_same_numbers(sensor, tmp_path):
    law = law_of({**SOFT, "rotation": TURNS}, force_sensor=sensor)
    found = export_c(law, name="law", period=0.005)
    assert "parts_admittance_rotation_stiffness" in found.parameters
    in_c = Loaded(found.text, tmp_path, ("-O0", "-ffp-contract=off"))
    reference = Reference(joints=BENT, **dict.fromkeys(("joint_rates", "joint_accelerations"), (0.0,) * 6)).dense()
    still = blank_measurement(6, 6, tip_force=3 * sensor, tip_torque=3 * sensor)
    memory = with_parts(law.memory, admittance=dataclasses.replace(law.memory.parts.admittance, age=2.0))
    in_c.memory.parts_admittance_age = 2.0
    for i in range(8):
        told = {"tip_force": (-0.6, 0.0, 0.8), "tip_torque": (0.1, 0.2, 0.0)} if sensor else {}
        # fast enough that an observer alone finds more than the 0.05 N m above which a torque is heard
        seen = dataclasses.replace(still, joints=BENT, joint_rates=(0.0,) * 4 + (-2.0 * i, 0.0), **told)
        memory, command = law.law(memory, seen, reference, 0.005, par=law.par)
        assert in_c(seen, reference) == [*command.rotor_speeds, *command.efforts]
    assert max(abs(each) for each in memory.parts.admittance.arm.joints) > 1e-6
