"""The tip gives way to a force as mass, damper and spring: flights against the exact
response, options, C.
"""

from __future__ import annotations

import copy
import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from law_parts import with_parts
from scipy.linalg import expm

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks.tip_force import levers
from skyarm.control.law_estimates import observed_push
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.contact.admittance import (
    VirtualBody,
    move,
    shift_reference,
)
from skyarm.control.model import Model
from skyarm.control.onboard.export_c import export_c
from skyarm.dynamics.kinematics import frame_pose
from skyarm.records.plain import plain
from skyarm.records.restore import restore
from skyarm.reference import Reference
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_file import scenario_from
from skyarm.sensing.measurement import blank_measurement
from support.engines import Loaded, needs_cc

M, D, K, PUSH, START = 1.0, 6.0, 9.0, 1.0, 2.25
SOFT = {"mass": [M] * 3, "damping": [D] * 3, "stiffness": [K] * 3}

DOCUMENT: dict[str, Any] = {
    "schema": 1,
    "name": "gives_way",
    "duration": 4.75,
    "plant": {"vehicle": "hummingbird_arm2_rotors"},
    "model": {"vehicle": "hummingbird_arm2"},
    "controller": {"law": "centroidal", "mode": "tip", "admittance": SOFT},
    "reference": {"base": {"kind": "signals", "z": 1.5}, "joints": [-0.45, -0.9]},
    "environment": {
        "forces": [
            {
                "kind": "disturbance",
                "frame": "tip",
                "force": [
                    {"kind": "windowed", "signal": PUSH, "start": START, "stop": 99.0},
                    0.0,
                    0.0,
                ],
            }
        ]
    },
}
JOINTS = (-0.45, -0.9)
STIFFNESS = "controller.parts.admittance.tip.stiffness.0"


def exact(t, K=K, f=PUSH):
    A = np.array([[0.0, 1.0, 0.0], [-K / M, -D / M, 1.0 / M], [0.0, 0.0, 0.0]])
    return np.array([(expm(A * max(each, 0.0)) @ [0.0, 0.0, f])[0] for each in t])


def moved(log):
    """Time since the push begins and the tip's way from where it was then."""
    t = log.time - START
    return t, log.tip - log.tip[(t > -0.2) & (t < 0.0)].mean(axis=0)


@pytest.fixture(scope="module")
def scenario():
    return scenario_from(DOCUMENT)


@pytest.fixture(scope="module")
def log(scenario):
    return skyarm.run(scenario)


def test_the_tip_answers_a_step_of_force_as_the_body_that_was_chosen(log):
    t, way = moved(log)
    wanted = exact(t)
    assert log.status == "completed"
    assert np.abs(way[t > 0.3, 0] - wanted[t > 0.3]).max() < 0.025 * PUSH / K
    # the observer's first 60 ms
    assert np.abs(way[t > 0.0, 0] - wanted[t > 0.0]).max() < 0.12 * PUSH / K
    assert np.abs(way[:, 1:]).max() < 0.006
    assert way[-1, 0] == pytest.approx(wanted[-1], rel=0.01)


def test_without_stiffness_it_drifts_at_the_speed_that_damping_allows(scenario):
    log = skyarm.run(
        with_numbers(
            scenario, {STIFFNESS: 0.0, "environment.forces.0.force.x.stop": START + 1.5}
        )
    )
    t, way = moved(log)
    drift = (way[(t > 1.4) & (t < 1.5), 0] - way[(t > 1.3) & (t < 1.4), 0]).mean() / 0.1
    assert drift == pytest.approx(PUSH / D, rel=0.03)
    rests = PUSH * 1.5 / D  # all of the impulse is the damper's
    assert way[-1, 0] == pytest.approx(rests, rel=0.03)
    # a hand that pushes and lets go has given what the damper took, and got nothing
    # back
    speed = np.gradient(log.tip[:, 0], log.time)
    work = np.trapezoid(np.where((t > 0.0) & (t < 1.5), PUSH * speed, 0.0), log.time)
    lost = np.trapezoid(D * np.where(t > 0.3, speed, 0.0) ** 2, log.time)
    assert 0.0 < lost < work


def hexarotor(**entries):
    """The hexarotor with its hand bent up, under noise and a known delay of 5 ms."""
    found = {
        "schema": 1,
        "name": "hexarotor_gives_way",
        "duration": 7.0,
        "plant": {"vehicle": "hexarotor_arm6"},
        "controller": {
            "law": "centroidal",
            "mode": "tip",
            "reach": 0.24,
            "damping": 0.06,
            "observer": [27.0, 31.0, 60.0, 60.0],
            **entries.pop("controller"),
        },
        "sensors": {
            "position": 1e-3,
            "velocity": 1e-2,
            "attitude": 2e-3,
            "rate": 1e-2,
            "joints": 1e-3,
            "joint_rates": 1e-2,
        },
        "delays": {"measurement": 0.005},
        "reference": {
            "base": {"kind": "signals", "z": 1.5, **entries.pop("base", {})},
            "joints": [0.0, -0.6, -0.97, 0.0, -0.8, 0.0],
        },
    }
    return scenario_from(found | entries)


def pushes(*force):
    """A push at the tip from ``START`` on."""
    signals = [
        (
            {"kind": "windowed", "signal": each, "start": START, "stop": 99.0}
            if each
            else 0.0
        )
        for each in force
    ]
    return {
        "environment": {
            "forces": [{"kind": "disturbance", "frame": "tip", "force": signals}]
        }
    }


@pytest.mark.thorough
@pytest.mark.parametrize(("axis", "force"), [(0, 3.0), (1, 1.0), (2, 3.0)])
@pytest.mark.parametrize("seed", range(3))
def test_a_hexarotor_gives_way_along_every_axis(axis, force, seed):
    push = [0.0] * 3
    push[axis] = force
    log = skyarm.run(
        hexarotor(controller={"admittance": SOFT}, seed=seed, **pushes(*push))
    )
    t, way = moved(log)
    wanted = exact(t, f=force)
    assert log.status == "completed"
    assert np.abs(way[t > 0.3, axis] - wanted[t > 0.3]).max() < 0.03 * force / K + 0.004
    assert way[t > 4.0, axis].mean() == pytest.approx(wanted[-1], rel=0.01)


@pytest.mark.thorough
@pytest.mark.parametrize("hard", [5000.0, 1e5])
def test_a_tip_that_meets_a_wall_stays_on_it_and_pushes_with_its_spring(hard):
    stiff = {"mass": [2.0] * 3, "damping": [40.0] * 3, "stiffness": [100.0] * 3}
    ramp = {
        "x": {
            "kind": "ramp",
            "start": 2.5,
            "duration": 0.55,
            "height": 0.11,
            "shape": "linear",
        }
    }
    wall = {
        "name": "wall",
        "shape": "box",
        "size": [0.4, 4.0, 1.4],
        "position": [0.75, 0.0, 0.7],
        "material": {"stiffness": hard},
    }
    log = skyarm.run(
        hexarotor(
            controller={"admittance": stiff}, base=ramp, world={"surfaces": [wall]}
        )
    )
    force = log.contact_force[:, 0]
    met = np.argmax(force > 0.0)
    late = log.time > log.time[met] + 0.3
    assert log.status == "completed"
    assert np.all(force[late] > 0.0)
    assert log.tip[late, 0].min() > log.tip[met, 0] - 2e-3
    assert force[log.time > 6.0].mean() == pytest.approx(100.0 * 0.06, rel=0.1)


def document(**changes):
    found = copy.deepcopy(DOCUMENT)
    found["controller"]["admittance"] = {**SOFT, **changes}
    return found


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"mass": [1.0, 1.0]},
            r"admittance\.mass = \[1\.0, 1\.0\]: must be three numbers",
        ),
        (
            {"mass": [0.0] * 3, "damping": [0.0] * 3, "stiffness": [0.0] * 3},
            r"mass = .*: must be above 0 along an axis",
        ),
        (
            {"mass": [0.0, 1.0, 1.0]},
            r"damping\[0\] = 6\.0: must be 0 along an axis of mass 0",
        ),
        (
            {"mass": [1e-3, 1.0, 1.0]},
            r"mass\[0\] = 0\.001: must be 0 or from 0\.01 to 1000",
        ),
        (
            {"mass": [0.1, 1.0, 1.0]},
            r"damping\[0\] = 6\.0: must be at most 50 1/s times the mass",
        ),
        (
            {"stiffness": [1.0, 1.0, 2501.0]},
            r"stiffness\[2\] = 2501\.0: must be at most \(50 rad/s\)\^2 times the mass",
        ),
        (
            {"stiffness": [1.0, -1.0, 1.0]},
            r"stiffness\[1\] = -1\.0: must be at least 0",
        ),
        (
            {"damping": [1.0, math.nan, 1.0]},
            r"damping\[1\] = nan: must be a finite number",
        ),
        (
            {"normal": [0.0, 0.0, 0.0]},
            r"normal = \[0\.0, 0\.0, 0\.0\]: must have a direction",
        ),
        ({"threshold": -1.0}, r"threshold = -1\.0: must be at least 0"),
        ({"inertia": 1.0}, r"admittance\.inertia"),
    ],
)
def test_tables_that_are_none_are_refused_by_field_and_value(changes, words):
    with pytest.raises(ValueError, match=words) as caught:
        scenario_from(document(**changes))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"mode": "joint"}, "must be left out but in mode 'tip'"),
        ({"interaction": [0.3, 0.1]}, "must be left out beside interaction"),
        ({"load": 0.3}, "must be left out beside load"),
        ({"admittance": 3.0}, r"admittance"),
        ({"admittance": {}}, r"admittance.*mass"),
        (
            {"admittance": None, "force_sensor": True},
            "force_sensor = true: must be false without",
        ),
    ],
)
def test_options_that_cannot_be_beside_it_are_refused(options, words):
    options = {"mode": "tip", "admittance": SOFT, **options}
    with pytest.raises(ValueError, match=words) as caught:
        make_centroidal(
            Model(vehicle=skyarm.load_vehicle("hummingbird_arm2")), **options
        )
    assert "\n" not in str(caught.value)


def test_the_axes_of_a_surface_are_its_normal_a_level_tangent_and_the_one_across(
    scenario,
):
    own = make_centroidal(
        scenario.controller.par.model,
        mode="tip",
        admittance={**SOFT, "normal": [-3.0, 0.0, 4.0]},
    )
    axes = np.array([[*axis] for axis in own.par.parts.admittance.tip.axes])
    assert axes == pytest.approx(
        np.array([[-0.6, 0.0, 0.8], [0.0, -1.0, 0.0], [0.8, 0.0, 0.6]])
    )
    level = make_centroidal(
        scenario.controller.par.model,
        mode="tip",
        admittance={**SOFT, "normal": [0.0, 0.0, 2.0]},
    )
    assert [[*axis] for axis in level.par.parts.admittance.tip.axes] == [
        [0, 0, 1],
        [1, 0, 0],
        [0, 1, 0],
    ]


def test_a_law_that_gives_way_is_kept_and_told_of(scenario):
    par = scenario.controller.par
    assert restore(plain(par)) == par
    assert par.parts.admittance.tip.lead == pytest.approx(2.0 / 34.0)
    late = make_centroidal(par.model, mode="tip", admittance=SOFT, delay=0.01)
    assert late.par.parts.admittance.tip.lead == pytest.approx(2.0 / 34.0 + 0.01)
    assert observed_push(scenario.controller.memory) == Vec3(0.0, 0.0, 0.0)


def test_what_does_not_give_way_has_nothing_of_it(scenario):
    plain_law = make_centroidal(scenario.controller.par.model, mode="tip")
    assert (plain_law.par.parts.admittance, plain_law.memory.parts.admittance) == (
        None,
        (),
    )


def observed_at(law, force):
    """What the observer holds of a force at the tip, N, world axes, at the posture of
    the flights.
    """
    quaternion = Quaternion(math.cos(0.2), 0.0, 0.0, math.sin(0.2))
    at = levers(law.par.model.vehicle, quaternion.rotation(), JOINTS)
    d = at.disturbance(Vec3(*force))
    return at, dataclasses.replace(
        law.memory.observed,
        quaternion=quaternion,
        joints=JOINTS,
        force=d.force,
        torque=d.torque,
        efforts=tuple(float(each) for each in d.efforts),
    )


def gave_way(law, force, told=(), **hearing):
    """One period of giving way after the first seconds: memory, and the reference's
    three signals.
    """
    first = dataclasses.replace(law.memory.parts.admittance, age=2.0, **hearing)
    at, observed = observed_at(law, force)
    rest = [Taylor((1.0, 2.0, 3.0, 0.0, 0.0))] * 6
    memory, signals = shift_reference(
        law.par.parts.admittance,
        first,
        law.par.model.vehicle,
        observed,
        rest,
        told,
        0.005,
    )
    assert signals[3:] == rest[3:]
    return at, memory, signals[:3]


def test_the_force_is_that_of_the_tip_and_moves_the_reference_with_two_derivatives(
    scenario,
):
    law = make_centroidal(scenario.controller.par.model, mode="tip", admittance=SOFT)
    _, memory, signals = gave_way(law, (0.5, -0.3, 0.2))
    assert [*memory.force] == pytest.approx([0.5, -0.3, 0.2])
    tip, (place, velocity, acceleration) = move(
        law.par.parts.admittance.tip, VirtualBody(), Vec3(0.5, -0.3, 0.2), 0.005
    )
    assert [*memory.body.rate] == pytest.approx([*tip.rate])
    for signal, p, v, a in zip(signals, place, velocity, acceleration, strict=True):
        assert [signal.derivative(k) for k in range(3)] == pytest.approx(
            [1.0 + p, 2.0 + v, 6.0 + a]
        )
    # what is bias pushes nothing
    at, _ = observed_at(law, (0.0, 0.0, 0.0))
    bias = at.disturbance(Vec3(0.4, -0.3, 0.2))
    assert [*gave_way(law, (0.5, -0.3, 0.2), bias=bias)[1].force] == pytest.approx(
        [0.1, 0.0, 0.0], abs=1e-9
    )


def test_a_sensor_is_heard_in_the_axes_of_the_tip_without_its_bias(scenario):
    law = make_centroidal(
        scenario.controller.par.model, mode="tip", admittance=SOFT, force_sensor=True
    )
    vehicle, told, bias = (
        law.par.model.vehicle,
        np.array([-2.0, 0.5, 4.0]),
        np.array([0.1, -0.2, 0.0]),
    )
    at, memory, _ = gave_way(law, (0.0, 0.0, 0.0), tuple(told), sensor_bias=Vec3(*bias))
    turned = np.array(
        [[*row] for row in (at.R @ frame_pose(vehicle, vehicle.frame(), JOINTS).R).rows]
    )
    share = 1.0 - math.exp(-60.0 * 0.005)
    assert [*memory.force] == pytest.approx(turned @ (share * told - bias))
    assert law.par.parts.admittance.tip.lead == pytest.approx(1.0 / 60.0)
    assert memory.detected == 1.0


def test_nothing_is_learned_and_nothing_foretold_while_a_force_is_heard(scenario):
    law = make_centroidal(scenario.controller.par.model, mode="tip", admittance=SOFT)
    heard, quiet = (
        gave_way(law, (0.5, 0.0, 0.0))[1],
        gave_way(law, (0.0, 0.0, 0.0), quiet=0.6)[1],
    )
    late = gave_way(law, (0.0, 0.0, 0.0), quiet=0.4)[1]
    assert [
        law.par.parts.admittance.force_cleared(m) for m in (heard, late, quiet)
    ] == [0.0, 0.0, 1.0]


@pytest.mark.parametrize("heard", [0.0, 1.0])
def test_a_trend_of_a_force_that_is_heard_moves_nothing(scenario, heard):
    law = make_centroidal(scenario.controller.par.model, mode="tip", admittance=SOFT)
    first = dataclasses.replace(law.memory.parts.admittance, age=2.0, detected=heard)
    seen = dataclasses.replace(blank_measurement(2, 4), joints=JOINTS)
    still = dict.fromkeys(("joint_rates", "joint_accelerations"), (0.0, 0.0))
    reference, commands = Reference(joints=JOINTS, **still).dense(), []
    for slope in (0.0, 2.0):
        trend = dataclasses.replace(
            law.memory.parts.trend,
            rate=Vec3(slope, 0.0, 0.0),
            agreement=50.0,
            size=50.0,
        )
        memory = with_parts(
            dataclasses.replace(law.memory, started=1.0), trend=trend, admittance=first
        )
        commands.append(law.law(memory, seen, reference, 0.005, par=law.par)[1])
    assert (commands[0] == commands[1]) is (heard > 0.5)


@needs_cc
@pytest.mark.thorough
@pytest.mark.parametrize("sensor", [True, False])
def test_exported_c_gives_way_by_the_same_numbers(scenario, sensor, tmp_path):
    model = scenario.controller.par.model
    soft = {**SOFT, "normal": [-1.0, 0.0, 1.0]}
    law = make_centroidal(
        model, mode="tip", admittance=soft, force_sensor=sensor, preview=0.0
    )
    found = export_c(law, name="law", period=0.005)
    assert "parts_admittance_tip_stiffness" in found.parameters
    in_c = Loaded(found.text, tmp_path, ("-O0", "-ffp-contract=off"))
    arm = {
        "joints": (-0.45, -0.9),
        **dict.fromkeys(("joint_rates", "joint_accelerations"), (0.0, 0.0)),
    }
    reference = Reference(**arm).dense()
    still = blank_measurement(2, 4, tip_force=3 if sensor else 0)
    memory = with_parts(
        law.memory, admittance=dataclasses.replace(law.memory.parts.admittance, age=2.0)
    )
    in_c.memory.parts_admittance_age = 2.0
    for i in range(8):
        told = (-0.6, 0.0, 0.8) if sensor else ()
        # zeros known before compilation are no accelerometer, and the C has one
        given = {
            "specific_force": Vec3(-20.0, 0.0, 9.81),
            "velocity": Vec3(-0.05 * i, 0.0, 0.0),
            "tip_force": told,
        }
        seen = dataclasses.replace(still, joints=(-0.45, -0.9), **given)
        memory, command = law.law(memory, seen, reference, 0.005, par=law.par)
        assert in_c(seen, reference) == [*command.rotor_speeds, *command.efforts]
    assert abs(memory.parts.admittance.body.offset[0]) > 1e-6
