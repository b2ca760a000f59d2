"""The hybrid computed torque: body form, Euler form, Pinocchio, 8x8 blocks, and every ablation."""

import dataclasses

import numpy as np
import pytest
from paper_oracle import (
    ACCELERATION,
    MASS,
    TORQUE,
    Pinocchio,
    ablated,
    ablated_euler,
    accelerations,
    choices,
    joint_pd,
    mixed,
)

import euler_lagrange as el
from euler_form import hybrid_computed_torque_euler
from flown import MODEL, G, cases, changed, controller, hovering, pushes, raw_squares, step, unclipped, unlimited
from skyarm.control.catalogue import ControllerError, make_controller
from skyarm.control.laws.paper import hybrid_computed_torque
from skyarm.control.model import Model, Terms

CASES = cases(40, seed=11)
FREE = Model(vehicle=unlimited(), gravity=G)
FORMS = (hybrid_computed_torque, hybrid_computed_torque_euler)


def of_form(form, model=MODEL, **options):
    """The law in body coordinates, or the paper's own Euler form of it."""
    return dataclasses.replace(controller("hybrid_computed_torque", model, **options), law=form)


def assert_command(found, expected_squares, expected_torques, tolerance):
    """Squared speeds relative to the largest asked for, joint torques relative to the largest of the two."""
    scale = np.abs(expected_squares).max()
    assert np.abs(raw_squares(found) - expected_squares).max() < tolerance * scale
    torque_scale = np.abs(expected_torques).max()
    assert np.abs(np.array(found.efforts) - expected_torques).max() < tolerance * torque_scale


@pytest.fixture(scope="module")
def pinocchio():
    return Pinocchio(pytest.importorskip("pinocchio"))


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("rate_error", ["rotors_sim", "corrected"])
def test_each_form_is_pinocchios_inverse_dynamics_of_the_papers_accelerations(pinocchio, form, rate_error):
    flown = unclipped(of_form(form, FREE, rate_error=rate_error))
    for case in CASES:
        linear, alpha = accelerations(case, corrected=rate_error == "corrected")
        qdd = joint_pd(case, ACCELERATION) + case.qdd_d
        force, torque, efforts = pinocchio.inverse_dynamics(case, linear, alpha, qdd)
        # |pitch| < 80 deg: Euler rates are at most six times body rates, so rounding stays near 1e-14
        assert_command(step(flown, case.measurement(), case.reference()), mixed(torque, force[2]), efforts, 1e-11)


def test_euler_form_and_body_form_agree():
    body, euler = (unclipped(of_form(form, FREE)) for form in FORMS)
    for case in CASES:
        a, b = (step(flown, case.measurement(), case.reference()) for flown in (body, euler))
        assert np.abs(raw_squares(a) - raw_squares(b)).max() < 1e-9 * np.abs(raw_squares(a)).max()
        assert np.abs(np.subtract(a.efforts, b.efforts)).max() < 1e-9 * np.abs(a.efforts).max()


@pytest.mark.parametrize("terms", choices("coriolis", "coupling", "full_gravity", "feedforward"))
def test_each_ablation_of_the_body_form_is_the_8x8_form_with_its_blocks_zeroed(terms):
    flown = unclipped(controller("hybrid_computed_torque", FREE, terms=Terms(**terms)))
    for case in CASES[:5]:
        found = step(flown, case.measurement(), case.reference())
        # the oracle inverts Q: condition up to 12 at 80 degrees of pitch
        assert_command(found, *ablated(case, **terms), 1e-10)


@pytest.mark.parametrize("terms", choices("coriolis", "feedforward"))
def test_each_ablation_of_the_euler_form_is_the_8x8_form_less_its_term(terms):
    flown = unclipped(of_form(hybrid_computed_torque_euler, FREE, terms=Terms(**terms)))
    for case in CASES[:5]:
        found = step(flown, case.measurement(), case.reference())
        assert_command(found, *ablated_euler(case, **terms), 1e-10)


@pytest.mark.parametrize("name", ["coriolis", "coupling", "full_gravity", "feedforward"])
def test_every_term_changes_the_command_when_it_is_left_out(name):
    whole = controller("hybrid_computed_torque", FREE)
    less = controller("hybrid_computed_torque", FREE, terms=Terms(**{name: False}))
    for case in CASES[:5]:
        a, b = (step(flown, case.measurement(), case.reference()) for flown in (whole, less))
        assert np.abs(np.subtract(a.efforts, b.efforts)).max() > 1e-4


@pytest.mark.parametrize("form", FORMS)
def test_all_terms_are_the_default(form):
    named = Terms(coriolis=True, coupling=True, full_gravity=True, feedforward=True)
    for case in CASES[:3]:
        inputs = case.measurement(), case.reference()
        assert step(of_form(form), *inputs) == step(of_form(form, terms=named), *inputs)


def test_an_ablation_a_law_would_ignore_is_refused_by_name():
    with pytest.raises(ControllerError, match=r"controller\.terms = .*: law 'decoupled_pd' has no such option"):
        make_controller("decoupled_pd", MODEL, terms=Terms(coriolis=False))


@pytest.mark.parametrize("form", FORMS)
def test_gravity_is_counted_once_for_base_and_joints(form):
    """At rest on the reference the command is the weight and the joints' static torque, not twice that (trap 1)."""
    case = hovering(joints=(0.5, 0.4))
    command = step(of_form(form), case.measurement(), case.reference())
    torque, thrust = pushes(MODEL.vehicle, command)
    static = el.gravity_vector(np.array([0, 0, 1, 0, 0, 0, 0.5, 0.4]), G)
    assert thrust == pytest.approx(MASS * G, rel=1e-13)
    np.testing.assert_allclose(command.efforts, static[6:], rtol=1e-13)
    np.testing.assert_allclose(torque, static[3:6], atol=1e-14)


@pytest.mark.parametrize("form", FORMS)
def test_body_angular_acceleration_is_what_the_torque_makes_of_a_rolled_vehicle(form):
    """Rolled by 40 degrees and pitched, with rates: alpha is in body axes and passes (95) (trap 2)."""
    case = changed(hovering(euler=(0.7, 0.3, 0.2)), w=(0.3, -0.2, 0.5))
    _, alpha = accelerations(case)
    found = step(unclipped(of_form(form, FREE)), case.measurement(), case.reference())
    expected, torques = ablated(case, coriolis=True, coupling=True, full_gravity=True, feedforward=True)
    assert np.abs(alpha).min() > 1e-2
    assert_command(found, expected, torques, 1e-12)


@pytest.mark.parametrize("flown", [controller("decoupled_pd"), *map(of_form, FORMS)])
def test_position_gain_is_divided_by_the_total_mass(flown):
    """Thrust of a level vehicle 0.1 m too low: m g + Kp 0.1 N for any mass; its tilt tells Kp / m (trap 4)."""
    low = changed(hovering(), p=(0.0, 0.0, 0.9))
    _, thrust = pushes(MODEL.vehicle, step(flown, low.measurement(), low.reference()))
    assert thrust == pytest.approx(MASS * G + 4.0 * 0.1, rel=1e-12)


def test_pd_baseline_is_rotors_controller_and_a_pd_with_reduced_gravity():
    flown = unclipped(controller("decoupled_pd", FREE))
    for case in CASES[:10]:
        linear, alpha = accelerations(case, feedforward=False)
        thrust = MASS * np.add(linear, [0.0, 0.0, G]) @ case.R[:, 2]
        q = np.concatenate([case.p, case.euler, case.q])
        efforts = joint_pd(case, TORQUE) + el.gravity_vector(q, G, reduced=True)[6:]
        found = step(flown, case.measurement(), case.reference())
        assert_command(found, mixed(np.diag([0.007, 0.007, 0.012]) @ alpha, thrust), efforts, 1e-12)


def test_rotors_controller_alone_feeds_the_acceleration_forward_and_leaves_the_joints():
    flown = unclipped(controller("rotors_sim_position", FREE))
    for case in CASES[:10]:
        linear, alpha = accelerations(case)
        thrust = MASS * np.add(linear, [0.0, 0.0, G]) @ case.R[:, 2]
        expected = mixed(np.diag([0.007, 0.007, 0.012]) @ alpha, thrust)
        found = step(flown, case.measurement(), case.reference())
        assert np.abs(raw_squares(found) - expected).max() < 1e-12 * np.abs(expected).max()
        assert found.efforts == (0.0, 0.0)
