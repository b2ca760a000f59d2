"""The hybrid computed torque: body form, Euler form, Pinocchio, 8x8 blocks, and every
ablation.
"""

import dataclasses

import numpy as np
import pytest
from euler_form import hybrid_computed_torque_euler
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
    rate_matrix,
)

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.control.catalogue import ControllerError, make_controller
from skyarm.control.laws.paper import geometric_accelerations, joint_accelerations
from skyarm.control.model import Model, Terms
from skyarm.dynamics.actuators import mix
from support import euler_lagrange as el
from support.laws import (
    MODEL,
    G,
    cases,
    changed,
    controller,
    hovering,
    pushes,
    raw_squares,
    step,
    unclipped,
    unlimited,
)

CASES = cases(40, seed=11)
FREE = Model(vehicle=unlimited(), gravity=G)
FORMS = ("body", "euler", "8x8")


def of_form(form, model=MODEL, **options):
    """The law in body coordinates, in Euler coordinates, or by the oracle's 8x8 blocks
    in Euler coordinates.
    """
    made = controller("hybrid_computed_torque", model, euler=form == "euler", **options)
    return (
        dataclasses.replace(made, law=hybrid_computed_torque_euler)
        if form == "8x8"
        else made
    )


def assert_command(found, expected_squares, expected_torques, tolerance):
    """Squared speeds relative to the largest asked for, joint torques relative to the
    largest of the two.
    """
    scale = np.abs(expected_squares).max()
    assert np.abs(raw_squares(found) - expected_squares).max() < tolerance * scale
    torque_scale = np.abs(expected_torques).max()
    assert (
        np.abs(np.array(found.efforts) - expected_torques).max()
        < tolerance * torque_scale
    )


@pytest.fixture(scope="module")
def pinocchio():
    return Pinocchio(pytest.importorskip("pinocchio"))


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("rate_error", ["rotors_sim", "corrected"])
def test_each_form_is_pinocchios_inverse_dynamics_of_the_papers_accelerations(
    pinocchio, form, rate_error
):
    flown = unclipped(of_form(form, FREE, rate_error=rate_error))
    for case in CASES:
        linear, alpha = accelerations(case, corrected=rate_error == "corrected")
        qdd = joint_pd(case, ACCELERATION) + case.qdd_d
        force, torque, efforts = pinocchio.inverse_dynamics(case, linear, alpha, qdd)
        # |pitch| < 80 deg: Euler rates are at most six times body rates, so rounding
        # stays near 1e-14
        assert_command(
            step(flown, case.measurement(), case.reference()),
            mixed(torque, force[2]),
            efforts,
            1e-11,
        )


@pytest.mark.parametrize("form", FORMS[1:])
def test_euler_form_and_body_form_agree(form):
    body, euler = (unclipped(of_form(each, FREE)) for each in ("body", form))
    for case in CASES:
        a, b = (
            step(flown, case.measurement(), case.reference()) for flown in (body, euler)
        )
        assert (
            np.abs(raw_squares(a) - raw_squares(b)).max()
            < 1e-9 * np.abs(raw_squares(a)).max()
        )
        assert (
            np.abs(np.subtract(a.efforts, b.efforts)).max()
            < 1e-9 * np.abs(a.efforts).max()
        )


@pytest.mark.parametrize(
    "terms", choices("coriolis", "coupling", "full_gravity", "feedforward")
)
def test_each_ablation_of_the_body_form_is_the_8x8_form_with_its_blocks_zeroed(terms):
    flown = unclipped(controller("hybrid_computed_torque", FREE, terms=Terms(**terms)))
    for case in CASES[:5]:
        found = step(flown, case.measurement(), case.reference())
        # the oracle inverts Q: condition up to 12 at 80 degrees of pitch
        assert_command(found, *ablated(case, **terms), 1e-10)


@pytest.mark.parametrize("form", FORMS[1:])
@pytest.mark.parametrize("terms", choices("coriolis", "feedforward"))
def test_each_ablation_of_the_euler_form_is_the_8x8_form_less_its_term(terms, form):
    flown = unclipped(of_form(form, FREE, terms=Terms(**terms)))
    for case in CASES[:5]:
        found = step(flown, case.measurement(), case.reference())
        assert_command(found, *ablated_euler(case, **terms), 1e-10)


@pytest.mark.parametrize("terms", choices("coupling", "full_gravity"))
def test_the_other_ablations_of_the_euler_form_are_those_of_the_body_form(terms):
    flown = unclipped(of_form("euler", FREE, terms=Terms(**terms)))
    for case in CASES[:3]:
        found = step(flown, case.measurement(), case.reference())
        assert_command(
            found, *ablated(case, coriolis=True, feedforward=True, **terms), 1e-10
        )


def test_the_euler_form_is_m_and_c_of_the_papers_equations():
    """tau = M(q) qdd_des + C(q, qd) qd, (88), by the public matrices; a six-joint arm,
    which the 8x8 form has not.
    """
    vehicle = skyarm.load_vehicle("hexarotor_arm6").with_joints(effort_limit=np.inf)
    flown = unclipped(
        controller(
            "hybrid_computed_torque", Model(vehicle=vehicle, gravity=G), euler=True
        )
    )
    case = cases(1, seed=88, joints=6)[0]
    Q = rate_matrix(case.euler)
    rates = np.linalg.solve(Q, case.w)
    q, qd = (
        np.concatenate(parts)
        for parts in ((case.p, case.euler, case.q), (case.v, rates, case.qd))
    )
    state, reference = case.measurement(), case.reference()
    R, a_d, alpha = geometric_accelerations(
        flown.par, state, reference, feedforward=True
    )
    Q_rate = rate_matrix(case.euler + 1e-30j * rates).imag / 1e-30
    second = np.linalg.solve(Q, np.array(tuple(alpha)) - Q_rate @ rates)  # (95)
    wanted = np.array(
        [*(-a_d), *second, *joint_accelerations(flown.par, state, reference)]
    )
    tau = (
        skyarm.paper.mass_matrix(vehicle, q) @ wanted
        + skyarm.paper.coriolis_matrix(vehicle, q, qd) @ qd
    )
    torque, thrust = (
        np.linalg.solve(Q.T, tau[3:6]),
        tau[:3] @ np.array([float(row.z) for row in R.rows]),
    )
    found = step(flown, state, reference)
    np.testing.assert_allclose(
        found.efforts, tau[6:], atol=1e-9 * np.abs(tau[6:]).max()
    )
    squares = np.array(
        mix(flown.par.mixer, Vec3(*torque.tolist()), float(thrust))[1][:6], dtype=float
    )
    assert np.abs(raw_squares(found) - squares).max() < 1e-9 * np.abs(squares).max()


@pytest.mark.parametrize("degrees", [90.0, 89.9999])
def test_the_euler_form_says_where_it_is_undefined(degrees):
    half = np.radians(degrees) / 2
    pitched = Quaternion(np.cos(half), 0.0, np.sin(half), 0.0)
    euler, body = (
        controller("hybrid_computed_torque", FREE, euler=each) for each in (True, False)
    )
    assert euler.margin(pitched) < 0.0 < euler.margin(Quaternion(1.0, 0.0, 0.0, 0.0))
    assert "pitch near 90 degrees" in euler.limit
    assert body.margin is None


@pytest.mark.parametrize(
    "name", ["coriolis", "coupling", "full_gravity", "feedforward"]
)
def test_every_term_changes_the_command_when_it_is_left_out(name):
    whole = controller("hybrid_computed_torque", FREE)
    less = controller("hybrid_computed_torque", FREE, terms=Terms(**{name: False}))
    for case in CASES[:5]:
        a, b = (
            step(flown, case.measurement(), case.reference()) for flown in (whole, less)
        )
        assert np.abs(np.subtract(a.efforts, b.efforts)).max() > 1e-4


@pytest.mark.parametrize("form", FORMS)
def test_all_terms_are_the_default(form):
    named = Terms(coriolis=True, coupling=True, full_gravity=True, feedforward=True)
    for case in CASES[:3]:
        inputs = case.measurement(), case.reference()
        assert step(of_form(form), *inputs) == step(of_form(form, terms=named), *inputs)


def test_an_ablation_a_law_would_ignore_is_refused_by_name():
    with pytest.raises(
        ControllerError,
        match=r"controller\.terms = .*: law 'decoupled_pd' has no such option",
    ):
        make_controller("decoupled_pd", MODEL, terms=Terms(coriolis=False))


@pytest.mark.parametrize("form", FORMS)
def test_gravity_is_counted_once_for_base_and_joints(form):
    """At rest on the reference the command is the weight and the joints' static torque,
    not twice that (trap 1).
    """
    case = hovering(joints=(0.5, 0.4))
    command = step(of_form(form), case.measurement(), case.reference())
    torque, thrust = pushes(MODEL.vehicle, command)
    static = el.gravity_vector(np.array([0, 0, 1, 0, 0, 0, 0.5, 0.4]), G)
    assert thrust == pytest.approx(MASS * G, rel=1e-13)
    np.testing.assert_allclose(command.efforts, static[6:], rtol=1e-13)
    np.testing.assert_allclose(torque, static[3:6], atol=1e-14)


@pytest.mark.parametrize("form", FORMS)
def test_body_angular_acceleration_is_what_the_torque_makes_of_a_rolled_vehicle(form):
    """Rolled by 40 degrees and pitched, with rates: alpha is in body axes and passes
    (95) (trap 2).
    """
    case = changed(hovering(euler=(0.7, 0.3, 0.2)), w=(0.3, -0.2, 0.5))
    _, alpha = accelerations(case)
    found = step(unclipped(of_form(form, FREE)), case.measurement(), case.reference())
    expected, torques = ablated(
        case, coriolis=True, coupling=True, full_gravity=True, feedforward=True
    )
    assert np.abs(alpha).min() > 1e-2
    assert_command(found, expected, torques, 1e-12)


@pytest.mark.parametrize("flown", [controller("decoupled_pd"), *map(of_form, FORMS)])
def test_position_gain_is_divided_by_the_total_mass(flown):
    """Thrust of a level vehicle 0.1 m too low: m g + Kp 0.1 N for any mass; its tilt
    tells Kp / m (trap 4).
    """
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
        assert_command(
            found, mixed(np.diag([0.007, 0.007, 0.012]) @ alpha, thrust), efforts, 1e-12
        )


def test_the_rotors_controller_feeds_the_acceleration_forward_and_leaves_the_joints():
    flown = unclipped(controller("rotors_sim_position", FREE))
    for case in CASES[:10]:
        linear, alpha = accelerations(case)
        thrust = MASS * np.add(linear, [0.0, 0.0, G]) @ case.R[:, 2]
        expected = mixed(np.diag([0.007, 0.007, 0.012]) @ alpha, thrust)
        found = step(flown, case.measurement(), case.reference())
        assert (
            np.abs(raw_squares(found) - expected).max() < 1e-12 * np.abs(expected).max()
        )
        assert found.efforts == (0.0, 0.0)
