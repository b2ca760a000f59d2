"""Options of the ladder and the published laws: refused by name and value, tuned gains by name."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.compile import leaves
from skyarm.control.catalogue import (
    HUMMINGBIRD,
    KNOBS,
    LAWS,
    ControllerError,
    make_controller,
    make_tuned,
    rescale,
    tuned_factors,
)
from skyarm.control.model import JointGains, Model, Terms
from skyarm.scenario.scenario_file import scenario_from

MODEL = Model(vehicle=skyarm.load_vehicle("hummingbird_arm2"))

WRONG = [
    ("indi", "cutoff", 0.0, r"controller\.cutoff = 0\.0: must be above 0"),
    ("indi", "cutoff", "fast", r"controller\.cutoff = 'fast': must be a finite number"),
    ("indi", "measured_speeds", 1, r"controller\.measured_speeds = 1: must be true or false"),
    ("indi", "delay_periods", -1, r"controller\.delay_periods = -1: must be a whole number from 0 to 100"),
    ("indi", "delay_periods", True, r"controller\.delay_periods = True: must be a whole number"),
    ("l1_adaptive", "predictor", (1.0, 2.0), r"controller\.predictor = \(1\.0, 2\.0\): must be three numbers"),
    ("l1_adaptive", "thrust_filter", float("nan"), r"controller\.thrust_filter = nan: must be a finite number"),
    ("kim2013", "boundary", (0.1, 0.0, 0.1), r"controller\.boundary\[1\] = 0\.0: must be above 0"),
    ("kim2013", "limit", 3.0, r"controller\.limit = 3\.0: must be three numbers"),
    ("ct_ladder", "observer", (1.0, 2.0, -3.0), r"controller\.observer\[2\] = -3\.0: must be above 0"),
    ("ct_ladder", "reference_period", 0, r"controller\.reference_period = 0: must be above 0"),
    ("nmpc", "weights", 3, r"controller\.weights = 3: must be Weights"),
    ("nmpc", "bandwidths", None, r"controller\.bandwidths = None: must be Bandwidths"),
    ("nmpc", "horizon", True, r"controller\.horizon = True: must be a number of s"),
    ("nmpc", "stages", 10**9, r"controller\.stages = 1000000000: must be a whole number from 2 to 200"),
    ("nmpc", "delay_periods", 101, r"controller\.delay_periods = 101: must be a whole number from 0 to 100"),
    ("learned_compensator", "network", "x", r"controller\.network = 'x': must be a Network"),
    (
        "learned_compensator",
        "answer",
        1e9,
        r"controller\.answer = 1000000000\.0: must be a number of rad/s above 0",
    ),
    ("hybrid_computed_torque", "terms", 5, r"controller\.terms = 5: must be Terms"),
    ("hybrid_computed_torque", "rate_error", [1], r"controller\.rate_error = \[1\]: must be one of"),
]

GAINED = ("decoupled_pd", "hybrid_computed_torque", "ct_ladder", "indi", "kim2013")
GAINED += ("l1_adaptive", "learned_compensator")


@pytest.mark.parametrize("law", GAINED)
@pytest.mark.parametrize(
    ("option", "value", "words"),
    [
        ("gains", 5, r"^controller\.gains = 5: must be GeometricGains$"),
        ("gains", "x", r"^controller\.gains = 'x': must be GeometricGains$"),
        (
            "gains",
            dataclasses.replace(HUMMINGBIRD, rate=Vec3(0.1, -0.1, 0.1)),
            r"^controller\.gains\.rate\[1\] = -0\.1: must be at least 0$",
        ),
        ("joint_gains", (1.0, 2.0), r"^controller\.joint_gains = \(1\.0, 2\.0\): must be JointGains$"),
        (
            "joint_gains",
            JointGains(stiffness=(-1.0, 1.0), damping=(1.0, 1.0)),
            r"^controller\.joint_gains\.stiffness\[0\] = -1\.0: must be at least 0$",
        ),
        (
            "joint_gains",
            JointGains(stiffness=(1.0, 1.0), damping=(1.0,)),
            r"^controller\.joint_gains\.damping: 1 values, must be 2",
        ),
        ("mixer_policy", "fair", r"^controller\.mixer = 'fair': must be one of clip, priority, thrust_before_yaw$"),
        ("mixer_policy", [1], r"^controller\.mixer = \[1\]: must be one of clip, priority, thrust_before_yaw$"),
    ],
)
def test_gains_and_mixers_that_no_law_can_fly_are_refused_by_name(law, option, value, words):
    with pytest.raises(ControllerError, match=words):
        make_controller(law, MODEL, **{option: value})


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (
            lambda: JointGains(stiffness=(1.0, math.nan), damping=(1.0, 1.0)),
            r"joint_gains\.stiffness\[1\] = nan: must be",
        ),
        (
            lambda: JointGains(stiffness=1.0, damping=1.0),
            r"joint_gains\.stiffness = 1\.0: must be numbers, one per joint",
        ),
        (lambda: JointGains(stiffness="ab", damping="ab"), r"joint_gains\.stiffness = 'ab': must be numbers"),
        (
            lambda: dataclasses.replace(HUMMINGBIRD, position=Vec3(1.0, math.inf, 1.0)),
            r"gains\.position\.y = inf: must",
        ),
        (lambda: dataclasses.replace(HUMMINGBIRD, velocity=3.0), r"gains\.velocity = 3\.0: must be a Vec3"),
        (lambda: dataclasses.replace(HUMMINGBIRD, velocity=Vec3("a", 1.0, 1.0)), r"gains\.velocity\.x = 'a': must be"),
        (lambda: Terms(coriolis="no"), r"terms\.coriolis = 'no': must be True or False"),
    ],
)
def test_records_of_gains_hold_finite_numbers_only(make, words):
    with pytest.raises(ControllerError, match=words):
        make()


def test_gains_of_lanes_pass_as_they_are():
    lanes = np.array([1.0, -2.0])
    assert JointGains(stiffness=(lanes,), damping=[2]).stiffness[0] is lanes
    assert JointGains(stiffness=(lanes,), damping=[2]).damping == (2.0,)


@pytest.mark.parametrize(("law", "option", "value", "words"), WRONG)
def test_a_wrong_value_is_refused_by_name(law, option, value, words):
    with pytest.raises(ControllerError, match=words):
        make_controller(law, MODEL, **{option: value})


@pytest.mark.parametrize("law", ["guo2023", "ct_ladder"])
def test_joint_gains_for_another_number_of_joints_are_refused(law):
    with pytest.raises(ControllerError, match=r"joint_gains\.stiffness: 1 values, must be 2"):
        make_controller(law, MODEL, joint_gains=JointGains(stiffness=(1.0,), damping=(1.0, 2.0)))


def test_the_compensated_force_and_torque_of_l1_are_half_of_the_weight_and_that_on_one_side_of_the_rotors():
    par, vehicle = make_controller("l1_adaptive", MODEL).par, MODEL.vehicle
    weight = 9.81 * sum(float(body.mass) for body in vehicle.bodies)
    reach = max(np.linalg.norm([float(c) for c in rotor.position]) for rotor in vehicle.rotors)
    assert (par.force_limit, par.torque_limit) == pytest.approx((0.5 * weight, 0.25 * weight * reach))


def test_a_controller_is_named_as_its_law():
    for law in LAWS:
        # the centroidal law says which of its two modes and of its presets flies
        assert make_controller(law, MODEL).name == (f"{law}_joint_robust" if law == "centroidal" else law)


def test_the_files_factors_are_of_laws_and_constants_that_there_are():
    factors = tuned_factors()
    assert set(factors) == set(KNOBS) <= set(LAWS)
    for law, found in factors.items():
        assert tuple(found) == KNOBS[law]
        assert all(1.0 / 12.0 - 1e-4 <= value <= 12.0 for value in found.values())


def test_tuned_gains_are_the_laws_own_times_the_factors():
    plain, best = make_controller("kim2013", MODEL), make_tuned("kim2013", MODEL)
    factors = tuned_factors()["kim2013"]
    assert float(best.par.gains.rate.y) == pytest.approx(float(plain.par.gains.rate.y) * factors["gains.rate"])
    assert best.par.adaptation[1] == pytest.approx(plain.par.adaptation[1] * factors["adaptation.1"])
    untouched = dataclasses.replace(
        best.par,
        gains=plain.par.gains,
        joint_gains=plain.par.joint_gains,
        switching=plain.par.switching,
        adaptation=plain.par.adaptation,
    )
    assert untouched == plain.par


def test_a_factor_of_one_changes_nothing():
    for law, paths in KNOBS.items():
        plain = make_controller(law, MODEL)
        assert leaves(rescale(plain, dict.fromkeys(paths, 1.0)).par) == leaves(plain.par)


def test_a_factor_on_a_constant_that_is_not_there_is_refused():
    with pytest.raises(ControllerError, match=r"controller\.cutoff: the law has no such constant"):
        rescale(make_controller("l1_adaptive", MODEL), {"cutoff": 2.0})
    with pytest.raises(ControllerError, match=r"controller\.adaptation\.3: the law has no such constant"):
        rescale(make_controller("kim2013", MODEL), {"adaptation.3": 2.0})


def test_a_law_without_tuned_gains_is_refused_with_those_there_are():
    with pytest.raises(ControllerError, match=r"controller\.law = 'rotors_sim_position': has no tuned gains.*'indi'"):
        make_tuned("rotors_sim_position", MODEL)


def scenario(**controller):
    hover = {"base": {"kind": "hover", "position": [0.0, 0.0, 2.0]}, "joints": [0.0, 0.0]}
    vehicle = {"vehicle": "hummingbird_arm2_rotors"}
    return scenario_from({"name": "x", "duration": 0.1, "plant": vehicle, "reference": hover, "controller": controller})


def test_a_scenario_takes_tuned_gains_and_options_of_any_law():
    found = scenario(law="indi", tuned=True, cutoff=10.0, mixer="priority").controller
    assert found.par.cutoff == pytest.approx(10.0 * tuned_factors()["indi"]["cutoff"])
    assert found.par.mixer.policy == "priority"
    own = scenario(law="indi", joint_gains={"stiffness": [100.0, 50.0], "damping": [9.0, 8.0]}).controller
    assert own.par.joint_gains.damping == (9.0, 8.0)
    paper = scenario(law="hybrid_computed_torque", tuned=True).controller
    assert paper.name == "hybrid_computed_torque"


def test_a_scenario_refuses_what_a_law_does_not_know():
    with pytest.raises(ValueError, match=r"controller\.tuned = 3: must be true or false"):
        scenario(law="indi", tuned=3)
    with pytest.raises(ValueError, match=r"controller\.law = 'indi': must be left out: the file of controller\.tuned"):
        scenario(law="indi", tuned="yes")
    with pytest.raises(ValueError, match=r"controller\.cutof = .*: law 'indi' has no such option"):
        scenario(law="indi", cutof=3.0)
