"""Friction given back by the paper's laws, and what the desired rate of a joint
counts.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.control.catalogue import ControllerError, make_controller
from skyarm.control.model import Model
from skyarm.reference import Reference
from skyarm.scenario.scenario_checks import check_scenario
from skyarm.scenario.scenario_file import load_scenario, scenario_from
from skyarm.sensing.measurement import Measurement
from skyarm.simulate.batch import Batch

VEHICLE = skyarm.load_vehicle("hummingbird_arm2")
LAWS = ("decoupled_pd", "hybrid_computed_torque")
RATES, WANTED = (0.7, -1.1), (0.4, -0.2)


def model(damping: float = 0.06, coulomb: float = 0.02) -> Model:
    return Model(
        vehicle=VEHICLE.with_joints(damping=damping, coulomb=coulomb, coulomb_rate=0.1)
    )


def measured() -> Measurement:
    return Measurement(
        time=0.0,
        position=Vec3(0.01, 0.02, 1.0),
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        velocity=Vec3(0.0, 0.0, 0.0),
        rate=Vec3(0.0, 0.0, 0.0),
        specific_force=Vec3(0.0, 0.0, 9.81),
        joints=(0.05, -0.02),
        joint_rates=RATES,
        rotor_speeds=(450.0,) * 4,
    )


def command(
    law: str, belief: Model, wanted: tuple[float, float] = WANTED, **options: Any
) -> Any:
    controller = make_controller(law, belief, **options)
    goal = Reference(
        position=Vec3(0.0, 0.0, 1.0),
        joints=(0.05, -0.02),
        joint_rates=wanted,
        joint_accelerations=(0.0, 0.0),
    )
    return controller.law(
        controller.memory, measured(), goal.dense(), 0.005, par=controller.par
    )[1]


@pytest.mark.parametrize("law", LAWS)
def test_the_share_of_the_believed_friction_is_added_behind_the_inertia(
    law: str,
) -> None:
    plain, back = (
        command(law, model()),
        command(law, model(), friction_compensation=(1.0, 0.5)),
    )
    gained = np.subtract(back.efforts, plain.efforts)
    friction = [
        0.06 * rate + 0.02 * np.tanh(wanted / 0.1)
        for rate, wanted in zip(RATES, WANTED, strict=True)
    ]
    assert gained == pytest.approx([friction[0], 0.5 * friction[1]], rel=1e-12)
    assert back.rotor_speeds == plain.rotor_speeds, "a joint's friction moves no rotor"


@pytest.mark.parametrize("law", LAWS)
def test_a_law_without_it_gives_nothing_back_whatever_it_believes(law: str) -> None:
    assert command(law, model()).efforts == command(law, model(0.0, 0.0)).efforts
    none = command(law, model(), friction_compensation=[])
    assert none.efforts == command(law, model()).efforts


def test_the_weight_of_a_desired_rate_scales_what_damping_makes_of_it() -> None:
    full, none = (
        command("decoupled_pd", model()),
        command("decoupled_pd", model(), rate_weights=(1.0, 0.0)),
    )
    damping = make_controller("decoupled_pd", model()).par.joint_gains.damping
    assert none.efforts[0] == full.efforts[0]
    assert full.efforts[1] - none.efforts[1] == pytest.approx(
        damping[1] * WANTED[1], rel=1e-12
    )
    still = command("hybrid_computed_torque", model(), wanted=(0.0, 0.0))
    assert command(
        "hybrid_computed_torque", model(), rate_weights=(0.0, 0.0)
    ).efforts == pytest.approx(still.efforts)


@pytest.mark.parametrize("option", ["friction_compensation", "rate_weights"])
@pytest.mark.parametrize(
    ("value", "words"),
    [
        ((-0.1, 1.0), r"\[0\] = -0\.1: must be at least 0$"),
        ((1.0, float("nan")), r"\[1\] = nan: must be a finite number"),
        ((1.0,), r" = \(1\.0,\): must be 2 numbers, one for each joint$"),
        (1.0, r" = 1\.0: must be a sequence$"),
    ],
)
def test_wrong_shares_are_refused_in_one_line(
    option: str, value: Any, words: str
) -> None:
    with pytest.raises(ControllerError, match=rf"^controller\.{option}{words}"):
        make_controller("hybrid_computed_torque", model(), **{option: value})


def test_a_law_without_joint_torques_refuses_them() -> None:
    with pytest.raises(
        ControllerError, match="law 'rotors_sim_position' has no such option"
    ):
        make_controller(
            "rotors_sim_position", model(), friction_compensation=(1.0, 1.0)
        )


def document(**controller: Any) -> dict[str, Any]:
    return {
        "name": "x",
        "duration": 1.0,
        "plant": {
            "vehicle": "hummingbird_arm2_rotors",
            "joints": {"damping": [0.06, 0.0003]},
        },
        "model": {
            "vehicle": "hummingbird_arm2",
            "joints": {"damping": [0.05, 0.0], "coulomb": 0.01},
        },
        "reference": {
            "base": {"kind": "hover", "position": [0.0, 0.0, 1.0]},
            "joints": [{"kind": "sine", "amplitude": 0.3, "frequency_hz": 0.5}, 0.0],
        },
        "controller": {"law": "hybrid_computed_torque", **controller},
    }


def test_a_file_gives_each_joint_its_friction_in_plant_and_model() -> None:
    read = scenario_from(
        document(friction_compensation=[1.0, 0.9], rate_weights=[1.0, 0.0])
    )
    joints = [link.joint for link in read.plant.vehicle.links]
    believed = [link.joint for link in read.controller.par.model.vehicle.links]
    assert [j.damping for j in joints] == [0.06, 0.0003]
    assert [(j.damping, j.coulomb) for j in believed] == [(0.05, 0.01), (0.0, 0.01)]
    assert read.controller.par.friction_compensation == (1.0, 0.9)
    assert read.controller.par.rate_weights == (1.0, 0.0)


@pytest.mark.parametrize("table", ["plant", "model"])
def test_friction_for_another_number_of_joints_is_refused_in_one_line(
    table: str,
) -> None:
    wrong = document()
    wrong[table]["joints"] = {"damping": [0.1, 0.1, 0.1]}
    with pytest.raises(
        ValueError,
        match=rf"^{table}\.joints\.damping = .*: must be a number, or 2 numbers",
    ):
        scenario_from(wrong)
    wrong[table]["joints"] = {"damping": [0.1, -0.1]}
    with pytest.raises(
        ValueError, match=rf"^{table}\.joints\.damping\[1\] = -0\.1: must be at least 0"
    ):
        scenario_from(wrong)


@pytest.mark.thorough
def test_shares_vary_by_path_with_the_bits_of_single_flights() -> None:
    paths = (
        "controller.friction_compensation.0",
        "controller.rate_weights.1",
        "model.vehicle.links.0.joint.damping",
    )
    base = scenario_from(
        document(friction_compensation=[1.0, 1.0], rate_weights=[1.0, 1.0])
    )
    values = [np.array([0.5, 1.0]), np.array([0.0, 1.0]), np.array([0.05, 0.02])]
    flown = (
        Batch(base, paths, bit_exact=True)
        .fly(dict(zip(paths, values, strict=True)))
        .state
    )
    for lane in range(2):
        share, weight, damping = (float(column[lane]) for column in values)
        own = document(friction_compensation=[share, 1.0], rate_weights=[1.0, weight])
        own["model"]["joints"]["damping"] = [damping, 0.0]
        alone = Batch(scenario_from(own), bit_exact=True).fly({}).state
        assert [x[lane] for x in (*flown.position, *flown.joints)] == [
            x[0] for x in (*alone.position, *alone.joints)
        ]
    assert flown.joints[0][0] != flown.joints[0][1]


def test_friction_that_is_given_back_is_as_if_there_were_none() -> None:
    rough, smooth = document(friction_compensation=[1.0, 1.0]), document()
    rough["model"]["joints"] = {"damping": [0.06, 0.0003]}
    smooth["plant"]["joints"] = {"damping": 0.0}
    logs = [skyarm.run(scenario_from(each)) for each in (rough, smooth)]
    plain = skyarm.run(scenario_from(document()))
    gaps = [
        np.abs(log.joints - logs[1].joints)[100:, 0].max() for log in (logs[0], plain)
    ]
    assert gaps[0] < 0.1 * gaps[1], "what is left is that it is held for a period"


@pytest.mark.parametrize("law", ["paper_ct", "paper_pd"])
def test_a_law_that_gives_nothing_back_is_traced_without_it(law: str) -> None:
    planned = load_scenario("case2", controller=law, duration=0.5)
    assert (
        planned.controller.par.friction_compensation
        == planned.controller.par.rate_weights
        == ()
    )
    zero = dataclasses.replace(
        planned.controller,
        par=dataclasses.replace(
            planned.controller.par, friction_compensation=(0.0, 0.0)
        ),
    )
    logs = [
        skyarm.run(each)
        for each in (planned, dataclasses.replace(planned, controller=zero))
    ]
    assert np.array_equal(logs[0].joints, logs[1].joints)


@pytest.mark.parametrize("field", ["friction_compensation", "rate_weights"])
@pytest.mark.parametrize(
    ("value", "words"), [((1.0,), "1 values, must be 2"), ("ab", "must be a sequence")]
)
def test_shares_that_replace_others_are_checked_too(
    field: str, value: Any, words: str
) -> None:
    planned = load_scenario("case2", duration=7.0)

    def changed() -> Any:
        par = dataclasses.replace(planned.controller.par, **{field: value})
        return dataclasses.replace(
            planned, controller=dataclasses.replace(planned.controller, par=par)
        )

    with pytest.raises(ValueError, match=rf"^controller\.{field}.*{words}$"):
        check_scenario(changed())
