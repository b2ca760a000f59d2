"""Controllers by name: choices are named in errors, defaults scale the published
gains.
"""

import dataclasses

import numpy as np
import pytest

import skyarm
from skyarm.control.catalogue import (
    ACCELERATION,
    HUMMINGBIRD,
    LAWS,
    PRESETS,
    TORQUE,
    ControllerError,
    make_controller,
    preset,
)
from skyarm.control.law_maker import default_gains, default_joint_gains
from skyarm.control.laws import paper
from skyarm.control.model import JointGains, Model
from skyarm.dynamics import array_front as arrays
from support.laws import ARM2, MODEL, G, cases, controller, step


def test_an_unknown_law_is_refused_with_the_nearest_choices():
    with pytest.raises(
        ControllerError,
        match=(
            r"controller\.law = 'pid': must be one of .*; 'skyarm show' shows all \d+$"
        ),
    ):
        make_controller("pid", MODEL)


def test_an_unknown_rate_error_is_refused_with_the_choices():
    with pytest.raises(
        ControllerError,
        match=r"rate_error = 'lee': must be one of rotors_sim, corrected$",
    ):
        make_controller("decoupled_pd", MODEL, rate_error="lee")


def test_an_unknown_mixer_policy_is_refused_with_the_choices():
    with pytest.raises(
        ControllerError,
        match=(
            r"^controller\.mixer = 'cut': must be one of clip, priority,"
            r" thrust_before_yaw$"
        ),
    ):
        make_controller("decoupled_pd", MODEL, mixer_policy="cut")


def test_an_unknown_preset_is_refused_with_the_choices():
    with pytest.raises(
        ControllerError,
        match=r"preset = 'paper': did you mean 'paper_pd'\? must be one of paper_pd, ",
    ):
        preset("paper", MODEL)


@pytest.mark.parametrize("field", ["stiffness", "damping"])
def test_joint_gains_for_another_number_of_joints_are_refused_by_field(field):
    gains = dataclasses.replace(ACCELERATION, **{field: (1.0,)})
    with pytest.raises(
        ControllerError, match=rf"joint_gains\.{field}: 1 values, must be 2"
    ):
        make_controller("hybrid_computed_torque", MODEL, joint_gains=gains)


def test_a_preset_refuses_a_vehicle_with_other_joints():
    with pytest.raises(ControllerError, match=r"2 values, must be 6"):
        preset("paper_ct", Model(vehicle=skyarm.load_vehicle("hexarotor_arm6")))


def test_every_preset_flies_its_law_with_the_published_gains():
    laws = {
        "paper_ct": ("hybrid_computed_torque", ACCELERATION),
        "paper_ct_euler": ("hybrid_computed_torque", ACCELERATION),
        "paper_pd": ("decoupled_pd", TORQUE),
        "rotors_sim_hummingbird": ("rotors_sim_position", None),
    }
    exact = {"centroidal_joint", "centroidal_tip"}
    assert set(laws) | exact == set(PRESETS)
    for name, (law, joint_gains) in laws.items():
        found = preset(name, MODEL)
        assert (found.name, found.law, found.par.gains) == (
            law,
            getattr(paper, law),
            HUMMINGBIRD,
        )
        assert joint_gains is None or found.par.joint_gains == joint_gains
        assert found.par.rate_error == "rotors_sim"
        assert found.par.mixer.policy == "clip"
        assert found.par.euler == name.endswith("_euler")


def test_published_gains_are_those_of_the_papers_tables():
    assert [tuple(v) for v in (HUMMINGBIRD.position, HUMMINGBIRD.velocity)] == [
        (4.0,) * 3,
        (2.2,) * 3,
    ]
    assert [tuple(v) for v in (HUMMINGBIRD.attitude, HUMMINGBIRD.rate)] == [
        (0.7, 0.7, 0.035),
        (0.1, 0.1, 0.025),
    ]
    assert JointGains(stiffness=(350.0, 150.0), damping=(12.0, 10.0)) == ACCELERATION
    assert JointGains(stiffness=(1.0, 0.5), damping=(0.04, 0.02)) == TORQUE


def test_default_gains_are_the_hummingbirds_for_the_papers_vehicle():
    found = default_gains(MODEL)
    for name in ("position", "velocity", "attitude", "rate"):
        np.testing.assert_allclose(
            tuple(getattr(found, name)), tuple(getattr(HUMMINGBIRD, name)), rtol=1e-15
        )


def test_default_gains_give_every_vehicle_the_hummingbirds_accelerations():
    """Per unit of mass and inertia nothing changes: the same poles for 2.4 kg as for
    0.8 kg.
    """
    for name in ("hexarotor_arm6", "octo_coaxial_two_arms", "tilted_hexarotor"):
        vehicle = skyarm.load_vehicle(name)
        gains, J = default_gains(Model(vehicle=vehicle)), vehicle.base.inertia
        moments = np.array([J.xx, J.yy, J.zz])
        np.testing.assert_allclose(
            np.array(tuple(gains.position)) / vehicle.mass, 4.0 / 0.806
        )
        np.testing.assert_allclose(
            np.array(tuple(gains.velocity)) / vehicle.mass, 2.2 / 0.806
        )
        np.testing.assert_allclose(
            np.array(tuple(gains.attitude)) / moments, (100.0, 100.0, 35 / 12)
        )
        np.testing.assert_allclose(
            np.array(tuple(gains.rate)) / moments, (100 / 7, 100 / 7, 25 / 12)
        )


def test_default_torque_gains_are_acceleration_gains_times_each_joints_own_inertia():
    vehicle = skyarm.load_vehicle("octo_coaxial_two_arms")
    M = arrays.mass_matrix(
        vehicle, np.zeros(3), [1.0, 0.0, 0.0, 0.0], np.zeros(vehicle.n)
    )
    own = np.diag(M)[6:]
    torque = default_joint_gains(Model(vehicle=vehicle), torque=True)
    acceleration = default_joint_gains(Model(vehicle=vehicle))
    np.testing.assert_allclose(torque.stiffness, own * acceleration.stiffness)
    np.testing.assert_allclose(torque.damping, own * acceleration.damping)


def test_default_joint_gains_are_damped_by_seven_tenths():
    gains = default_joint_gains(MODEL)
    for kp, kd in zip(gains.stiffness, gains.damping, strict=True):
        assert kd / (2.0 * np.sqrt(kp)) == pytest.approx(0.7, abs=0.01)


def test_options_reach_the_law():
    case = cases(1, seed=41)[0]
    inputs = case.measurement(), case.reference()
    plain = step(controller("decoupled_pd"), *inputs)
    assert step(controller("decoupled_pd", rate_error="corrected"), *inputs) != plain
    assert step(controller("decoupled_pd", mixer_policy="priority"), *inputs) != plain


def test_an_option_that_a_law_does_not_have_is_refused_with_those_it_has():
    with pytest.raises(
        ControllerError,
        match=(
            r"controller\.horizon = .*: law 'decoupled_pd' has no such"
            r" option.*joint_gains"
        ),
    ):
        make_controller("decoupled_pd", MODEL, horizon=3)


def test_every_law_has_a_line_that_says_what_it_is():
    assert all(len(entry.title) > 20 for entry in LAWS.values())


def test_only_laws_in_euler_angles_have_a_place_where_they_are_undefined():
    for name in LAWS:
        found = make_controller(name, Model(vehicle=ARM2, gravity=G))
        assert (found.margin is not None) == (name == "bulut2019")
        assert bool(found.limit) == (found.margin is not None)
