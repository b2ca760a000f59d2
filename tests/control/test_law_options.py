"""Options of the ladder and the published laws: refused by name and value, tuned gains
by name.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.control.catalogue import (
    HUMMINGBIRD,
    LAWS,
    ControllerError,
    make_controller,
    make_tuned,
    rescale,
    tuned_factors,
)
from skyarm.control.model import JointGains, Model, Terms
from skyarm.records.leaves import leaves
from skyarm.scenario.scenario_file import scenario_from

MODEL = Model(vehicle=skyarm.load_vehicle("hummingbird_arm2"))

WRONG = [
    ("indi", "cutoff", 0.0, "controller.cutoff = 0.0: must be above 0"),
    ("indi", "cutoff", "fast", "controller.cutoff = 'fast': must be a number"),
    (
        "indi",
        "measured_speeds",
        1,
        "controller.measured_speeds = 1: must be True or False",
    ),
    ("indi", "delay_periods", -1, "controller.delay_periods = -1: must be at least 0"),
    (
        "indi",
        "delay_periods",
        True,
        "controller.delay_periods = True: must be a whole number",
    ),
    (
        "l1_adaptive",
        "predictor",
        (1.0, 2.0),
        "controller.predictor = (1.0, 2.0): must have 3 items",
    ),
    (
        "l1_adaptive",
        "thrust_filter",
        float("nan"),
        "controller.thrust_filter = nan: must be a finite number",
    ),
    (
        "kim2013",
        "boundary",
        (0.1, 0.0, 0.1),
        "controller.boundary[1] = 0.0: must be above 0",
    ),
    ("kim2013", "limit", 3.0, "controller.limit = 3.0: must be a sequence"),
    (
        "ct_ladder",
        "observer",
        (1.0, 2.0, -3.0),
        "controller.observer.joints = -3.0: must be above 0",
    ),
    ("ct_ladder", "observer", 3.0, "controller.observer = 3.0: must be 3 numbers"),
    (
        "ct_ladder",
        "reference_period",
        0,
        "controller.reference_period = 0.0: must be above 0",
    ),
    ("ct_ladder", "steps", 7, "controller.steps = 7: must be at most 6"),
    ("nmpc", "weights", 3, "controller.weights = 3: must be a Weights"),
    ("nmpc", "bandwidths", None, "controller.bandwidths = None: must be a Bandwidths"),
    ("nmpc", "horizon", True, "controller.horizon = True: must be a number"),
    ("nmpc", "stages", 10**9, "controller.stages = 1000000000: must be at most 200"),
    (
        "nmpc",
        "delay_periods",
        101,
        "controller.delay_periods = 101: must be at most 100",
    ),
    (
        "learned_compensator",
        "network",
        "x",
        "controller.network = 'x': must be a Network",
    ),
    (
        "learned_compensator",
        "answer",
        1e9,
        "controller.answer = 1000000000.0: must be below 10000",
    ),
    ("hybrid_computed_torque", "terms", 5, "controller.terms = 5: must be a Terms"),
    (
        "hybrid_computed_torque",
        "rate_error",
        [1],
        "controller.rate_error = [1]: must be",
    ),
    ("kim2013", "gains", 5, "controller.gains = 5: must be a GeometricGains"),
    (
        "kim2013",
        "joint_gains",
        (1.0, 2.0),
        "controller.joint_gains = (1.0, 2.0): must be a JointGains",
    ),
    (
        "kim2013",
        "joint_gains",
        JointGains(stiffness=(1.0, 1.0), damping=(1.0,)),
        "controller.joint_gains.damping: 1 values, must be 2",
    ),
    (
        "guo2023",
        "mixer_policy",
        "fair",
        "controller.mixer = 'fair': must be one of clip, priority, thrust_before_yaw",
    ),
    (
        "guo2023",
        "mixer_policy",
        [1],
        "controller.mixer = [1]: must be one of clip, priority, thrust_before_yaw",
    ),
]


def test_wrong_values_are_refused_by_name():
    found = []
    for law, option, value, words in WRONG:
        with pytest.raises(ControllerError) as refusal:
            make_controller(law, MODEL, **{option: value})
        if not str(refusal.value).startswith(words):
            found.append((words, str(refusal.value)))
    assert not found


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (
            lambda: JointGains(stiffness=(1.0, math.nan), damping=(1.0, 1.0)),
            r"joint_gains\.stiffness\[1\] = nan: must be",
        ),
        (
            lambda: JointGains(stiffness=(-1.0,), damping=(1.0,)),
            r"joint_gains\.stiffness\[0\] = -1\.0: must be at least",
        ),
        (
            lambda: JointGains(stiffness=1.0, damping=1.0),
            r"joint_gains\.stiffness = 1\.0: must be a sequence",
        ),
        (
            lambda: JointGains(stiffness="ab", damping="ab"),
            r"joint_gains\.stiffness = 'ab': must be a sequence",
        ),
        (
            lambda: dataclasses.replace(HUMMINGBIRD, position=Vec3(1.0, math.inf, 1.0)),
            r"gains\.position\.y = inf: must",
        ),
        (
            lambda: dataclasses.replace(HUMMINGBIRD, rate=Vec3(0.1, -0.1, 0.1)),
            r"gains\.rate\.y = -0\.1: must be at least",
        ),
        (
            lambda: dataclasses.replace(HUMMINGBIRD, velocity=3.0),
            r"gains\.velocity = 3\.0: must be three numbers",
        ),
        (
            lambda: dataclasses.replace(HUMMINGBIRD, velocity=Vec3("a", 1.0, 1.0)),
            r"gains\.velocity\.x = 'a': must be",
        ),
        (
            lambda: Terms(coriolis="no"),
            r"terms\.coriolis = 'no': must be True or False",
        ),
    ],
)
def test_records_of_gains_hold_finite_numbers_only(make, words):
    with pytest.raises(ControllerError, match=words):
        make()


def test_gains_of_lanes_pass_as_they_are():
    lanes = np.array([1.0, -2.0])
    assert JointGains(stiffness=(lanes,), damping=[2]).stiffness[0] is lanes
    assert JointGains(stiffness=(lanes,), damping=[2]).damping == (2.0,)


@pytest.mark.parametrize("law", ["guo2023", "ct_ladder"])
def test_joint_gains_for_another_number_of_joints_are_refused(law):
    with pytest.raises(
        ControllerError, match=r"joint_gains\.stiffness: 1 values, must be 2"
    ):
        make_controller(
            law, MODEL, joint_gains=JointGains(stiffness=(1.0,), damping=(1.0, 2.0))
        )


def test_l1_compensates_half_of_the_weight_and_its_torque_on_one_side_of_the_rotors():
    par, vehicle = make_controller("l1_adaptive", MODEL).par, MODEL.vehicle
    weight = 9.81 * sum(float(body.mass) for body in vehicle.bodies)
    reach = max(
        np.linalg.norm([float(c) for c in rotor.position]) for rotor in vehicle.rotors
    )
    assert (par.force_limit, par.torque_limit) == pytest.approx(
        (0.5 * weight, 0.25 * weight * reach)
    )


@pytest.mark.parametrize("law", ["ct_ladder", "hybrid_ct"])
def test_bandwidths_of_an_observer_are_of_force_torque_and_joints_in_this_order(law):
    gains = make_controller(law, MODEL, observer=(20.0, 30.0, 50.0)).par.observer
    assert (gains.force, gains.torque, gains.joints) == (20.0, 30.0, 50.0)


def test_a_controller_is_named_as_its_law():
    for law in LAWS:
        # the centroidal law says which of its two modes flies
        assert make_controller(law, MODEL).name == (
            f"{law}_joint" if law == "centroidal" else law
        )


def test_the_files_factors_are_of_laws_and_constants_that_there_are():
    factors = tuned_factors()
    assert set(factors) <= set(LAWS)
    for law, found in factors.items():
        rescale(make_controller(law, MODEL), found)
        assert all(1.0 / 12.0 - 1e-4 <= value <= 12.0 for value in found.values())


def test_tuned_gains_are_the_laws_own_times_the_factors():
    plain, best = make_controller("kim2013", MODEL), make_tuned("kim2013", MODEL)
    factors = tuned_factors()["kim2013"]
    assert float(best.par.gains.rate.y) == pytest.approx(
        float(plain.par.gains.rate.y) * factors["gains.rate"]
    )
    assert best.par.adaptation[1] == pytest.approx(
        plain.par.adaptation[1] * factors["adaptation.1"]
    )
    untouched = dataclasses.replace(
        best.par,
        gains=plain.par.gains,
        joint_gains=plain.par.joint_gains,
        switching=plain.par.switching,
        adaptation=plain.par.adaptation,
    )
    assert untouched == plain.par


def test_a_factor_of_one_changes_nothing():
    for law, paths in tuned_factors().items():
        plain = make_controller(law, MODEL)
        assert leaves(rescale(plain, dict.fromkeys(paths, 1.0)).par) == leaves(
            plain.par
        )


def test_a_factor_on_a_constant_that_is_not_there_is_refused():
    with pytest.raises(
        ControllerError, match=r"controller\.cutoff: the law has no such constant"
    ):
        rescale(make_controller("l1_adaptive", MODEL), {"cutoff": 2.0})
    with pytest.raises(
        ControllerError,
        match=r"controller\.adaptation\.3: the law has no such constant",
    ):
        rescale(make_controller("kim2013", MODEL), {"adaptation.3": 2.0})


def test_a_law_without_tuned_gains_is_refused_with_those_there_are():
    with pytest.raises(
        ControllerError,
        match=r"controller\.law = 'rotors_sim_position': has no tuned gains.*'indi'",
    ):
        make_tuned("rotors_sim_position", MODEL)


def scenario(**controller):
    hover = {
        "base": {"kind": "hover", "position": [0.0, 0.0, 2.0]},
        "joints": [0.0, 0.0],
    }
    vehicle = {"vehicle": "hummingbird_arm2_rotors"}
    return scenario_from(
        {
            "name": "x",
            "duration": 0.1,
            "plant": vehicle,
            "reference": hover,
            "controller": controller,
        }
    )


def test_a_scenario_takes_tuned_gains_and_options_of_any_law():
    found = scenario(law="indi", tuned=True, cutoff=10.0, mixer="priority").controller
    assert found.par.cutoff == pytest.approx(10.0 * tuned_factors()["indi"]["cutoff"])
    assert found.par.mixer.policy == "priority"
    own = scenario(
        law="indi", joint_gains={"stiffness": [100.0, 50.0], "damping": [9.0, 8.0]}
    ).controller
    assert own.par.joint_gains.damping == (9.0, 8.0)
    paper = scenario(law="hybrid_computed_torque", tuned=True).controller
    assert paper.name == "hybrid_computed_torque"


def test_a_scenario_refuses_what_a_law_does_not_know():
    with pytest.raises(
        ValueError, match=r"controller\.tuned = 3: must be true or false"
    ):
        scenario(law="indi", tuned=3)
    with pytest.raises(
        ValueError,
        match=(
            r"controller\.law = 'indi': must be left out: the file of controller\.tuned"
        ),
    ):
        scenario(law="indi", tuned="yes")
    with pytest.raises(
        ValueError, match=r"controller\.cutof = .*: law 'indi' has no such option"
    ):
        scenario(law="indi", cutof=3.0)
