"""Drag of the hull and the wind that the centroidal law believes: NumPy's formula, and plans that differentiate."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import skyarm
from law_parts import step_of
from skyarm.algebra import ZERO3, Mat3, Quaternion, Vec3
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks.disturbance_observer import ObserverGains, first_observed, observe
from skyarm.control.blocks.prediction import BelievedAir, Disturbance, hull_drag_along
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.laws.centroidal.demands import demands
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.log.metrics.windows import Window, Windows
from skyarm.reference import Reference
from skyarm.sensing.measurement import blank_measurement
from skyarm.simulate.batch import Batch
from skyarm.studies.compare import envelope_axes as motions
from skyarm.studies.compare.envelope_setting import setting_of
from skyarm.vehicle.vehicle_records import BodyDrag
from skyarm.world import MovingAir

AREA, RHO = np.array([0.05, 0.08, 0.12]), 1.225
PLAIN = skyarm.load_vehicle("hummingbird_arm2")
HULL = dataclasses.replace(PLAIN, drag=BodyDrag(area=Vec3(*AREA.tolist()), air_density=RHO))
WIND = np.array([2.0, -1.0, 0.3])
R = Rotation.from_euler("ZYX", [0.9, -0.2, 0.3])
SPEEDS, DT = (480.0, 500.0, 470.0, 490.0), 0.005
VELOCITY = np.array([1.5, -0.8, 0.4])


def vec(a):
    return Vec3(*(float(x) for x in a))


def matrix(turn):
    return Mat3(*(vec(row) for row in turn.as_matrix()))


def quaternion(turn):
    x, y, z, w = turn.as_quat().tolist()
    return Quaternion(w, x, y, z)


def unrolled(vehicle, **changes):
    """The vehicle with rotors that have no rolling moment."""
    rotors = tuple(dataclasses.replace(r, rolling_moment_coefficient=0, **changes) for r in vehicle.rotors)
    return dataclasses.replace(vehicle, rotors=rotors)


def hull(velocity, wind=WIND):
    """N, world axes, of the hull at the attitude R."""
    u = R.inv().apply(velocity - wind)
    return R.apply(-0.5 * RHO * AREA * np.linalg.norm(u) * u)


def hubs(velocity):
    """N, world axes, of the rotors' hubs: -c W of the velocity in their plane."""
    u = R.inv().apply(velocity) * [1.0, 1.0, 0.0]
    return R.apply(-float(PLAIN.rotors[0].drag_coefficient) * sum(SPEEDS) * u)


def test_the_drag_along_a_motion_has_the_derivatives_of_its_formula():
    coefficients = np.random.default_rng(3).normal(size=(4, 3))

    def velocity(t):
        return sum(c * t**k for k, c in enumerate(coefficients))

    motion = [coefficients[0], coefficients[1], 2.0 * coefficients[2]]
    air = BelievedAir(wind=vec(WIND), hull=True)
    model = Model(vehicle=HULL, gravity=9.8)
    found = np.array([list(each) for each in hull_drag_along(model, air, matrix(R), [vec(m) for m in motion])])
    h = 1e-4
    before, now, after = (hull(velocity(t)) for t in (-h, 0.0, h))
    np.testing.assert_allclose(found[0], now, rtol=1e-8)
    np.testing.assert_allclose(found[1], (after - before) / (2.0 * h), rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(found[2], (after - 2.0 * now + before) / h**2, rtol=1e-4, atol=1e-5)


def test_a_law_that_knows_the_drag_does_what_one_that_found_it_does():
    """The same force in what the observer believes: hull against the wind, and hubs by how far the wind moves them."""
    measured = dataclasses.replace(
        blank_measurement(2, 4),
        position=Vec3(0.0, 0.0, 1.0),
        quaternion=quaternion(R),
        velocity=vec(VELOCITY),
        joints=(0.3, -0.5),
        rotor_speeds=SPEEDS,
    )
    still = dict.fromkeys(("joint_rates", "joint_accelerations", "joint_jerks", "joint_snaps"), (0.0, 0.0))
    goal = Reference(
        position=Vec3(0.0, 0.0, 1.0), velocity=vec(VELOCITY), acceleration=ZERO3, yaw=0.9, joints=(0.3, -0.5), **still
    ).dense()
    # rolling moments go with the velocity against the air, too: left out
    vehicles = [unrolled(each) for each in (HULL, PLAIN)]
    push = hull(VELOCITY) + hubs(VELOCITY - WIND) - hubs(VELOCITY)
    arms = sum(
        np.cross(
            np.array(list(map(float, r.position))),
            -float(r.drag_coefficient) * s * R.inv().apply(-WIND) * [1.0, 1.0, 0.0],
        )
        for r, s in zip(PLAIN.rotors, SPEEDS, strict=True)
    )
    commands, velocities = [], []
    options = {"hull_drag": True, "wind": tuple(WIND.tolist())}
    for vehicle, given, force, torque in (
        (vehicles[0], options, np.zeros(3), np.zeros(3)),
        (vehicles[1], {}, push, arms),
    ):
        controller = make_centroidal(Model(vehicle=vehicle, gravity=9.8), **given)
        seen = dataclasses.replace(
            controller.memory.observed, force=vec(force), torque=vec(torque), rotor_speeds=SPEEDS
        )
        memory = dataclasses.replace(controller.memory, observed=seen)
        memory, command = controller.law(memory, measured, goal, DT, par=controller.par)
        commands.append(command)
        memory, _ = controller.law(memory, measured, goal, DT, par=controller.par)
        velocities.append(list(memory.observed.velocity))
    for part in ("rotor_speeds", "efforts"):
        known, learned = (np.array(getattr(command, part)) for command in commands)
        np.testing.assert_allclose(known, learned, rtol=1e-9)
    # the observer goes on by what the law believes: without the drag it would miss by 2 mm/s
    np.testing.assert_allclose(*velocities, atol=1e-4)
    assert np.abs(push).max() > 0.1


def test_the_observer_goes_on_with_the_drag():
    air = BelievedAir(wind=vec(WIND), hull=True)
    gains = ObserverGains(force=27.0, torque=31.0, joints=34.0, pose=60.0)
    memory = dataclasses.replace(first_observed(2, SPEEDS), quaternion=quaternion(R), velocity=vec(VELOCITY))
    measured = dataclasses.replace(blank_measurement(2, 4), quaternion=quaternion(R), velocity=vec(VELOCITY))
    acted = Command(rotor_speeds=SPEEDS, efforts=(0.0, 0.0))

    def velocity(vehicle, force, believed):
        unknown = Disturbance(force=vec(force), torque=ZERO3, efforts=(0.0, 0.0))
        model = Model(vehicle=vehicle, gravity=9.8)
        observed, _ = observe(model, gains, memory, measured, acted, unknown, 1.0, (1.0,) * 3, DT, None, believed)
        return np.array(list(observed.velocity))

    smooth = [unrolled(each, drag_coefficient=0) for each in (HULL, PLAIN)]
    known, learned = velocity(smooth[0], np.zeros(3), air), velocity(smooth[1], hull(VELOCITY), None)
    np.testing.assert_allclose(known, learned, atol=1e-12)
    assert np.abs(known - velocity(smooth[1], np.zeros(3), None)).max() > 1e-5


def test_the_plan_in_drag_is_differentiated_in_full():
    """The planned attitude turns by the planned rate, and that by the planned acceleration, along a fast motion."""
    par = make_centroidal(
        Model(vehicle=HULL, gravity=9.8), mode="tip", preset="adaptive", hull_drag=True, wind=tuple(WIND.tolist())
    ).par
    x = np.random.default_rng(5).normal(size=(5, 3)) * np.array([[1.0], [3.0], [1.0], [1.0], [1.0]])
    state = State(
        position=ZERO3, quaternion=quaternion(R), velocity=ZERO3, rate=ZERO3, joints=(0.0, 0.0),
        joint_rates=(0.0, 0.0), rotor_speeds=SPEEDS,
    )  # fmt: skip
    none = Disturbance(force=ZERO3, torque=ZERO3, efforts=(0.0, 0.0))
    blank = make_centroidal(Model(vehicle=HULL, gravity=9.8), mode="tip", preset="adaptive").memory.following

    def plan(t):
        path = [Taylor(c).c for c in x.T.tolist()]
        shifted = [np.polynomial.Polynomial(c)(np.polynomial.Polynomial([t, 1.0])).coef for c in path]
        signals = [Taylor(c.tolist()) for c in shifted] + [Taylor((v, 0.0, 0.0, 0.0, 0.0)) for v in (0.4, 0.2, -0.3)]
        found = demands(step_of(par, state, signals, DT, unknown=none, following=blank)).planned
        return np.array([list(row) for row in found.R.rows]), np.array(list(found.rate)), np.array(list(found.alpha))

    h = 1e-4
    (R0, w0, _), (_, w, alpha), (R1, w1, _) = (plan(t) for t in (-h, 0.0, h))
    turned = Rotation.from_matrix(R0.T @ R1).as_rotvec() / (2.0 * h)
    np.testing.assert_allclose(w, turned, atol=1e-5)
    np.testing.assert_allclose(alpha, (w1 - w0) / (2.0 * h), atol=1e-4)


def test_what_is_left_out_leaves_the_law_as_it_was_and_wrong_options_are_refused():
    model = Model(vehicle=HULL, gravity=9.8)
    assert make_centroidal(model, hull_drag=False, wind=(0.0,) * 3).par.observation.air is None
    only = make_centroidal(model, wind=(1.0, 0.0, 0.0)).par
    assert (only.observation.air.hull, "observation.air.hull" in only.choices()) == (False, False)
    calm = make_centroidal(model, hull_drag=True).par
    assert (calm.observation.air.wind, "observation.air.hull" in calm.choices()) == (ZERO3, True)
    for options, field in (
        ({"hull_drag": 1}, "hull_drag"),
        ({"wind": (1.0, 2.0)}, "wind"),
        ({"wind": (0, 0, 1e3)}, "wind"),
    ):
        with pytest.raises(ControllerError, match=rf"controller\.{field}"):
            make_centroidal(model, **options)
    with pytest.raises(ControllerError, match=r"controller\.hull_drag = true: model\.vehicle = .* drag\.area"):
        make_centroidal(Model(vehicle=PLAIN), hull_drag=True)


@pytest.mark.thorough
def test_drag_that_is_known_is_led_on_a_circle_in_wind():
    """3 m/s on 3 m in 3 m/s of wind: tip errors of 3.6 mm, of 2.8 with the hull alone and of 1.4 with the wind."""
    setting = setting_of()
    built = motions.circle(setting, 3.0, 3.0)
    drag = BodyDrag(area=Vec3(*(2.0 * 0.02 / RHO,) * 3), air_density=RHO)
    world = dataclasses.replace(built.plant, vehicle=dataclasses.replace(built.plant.vehicle, drag=drag))
    believed = built.controller.par.model
    model = dataclasses.replace(believed, vehicle=dataclasses.replace(believed.vehicle, drag=drag))
    errors = []
    for options in ({}, {"hull_drag": True}, {"hull_drag": True, "wind": (3.0, 0.0, 0.0)}):
        law = make_centroidal(model, mode="tip", preset="adaptive", **options)
        air = MovingAir(velocity_W=Vec3(3.0, 0.0, 0.0))
        flown = dataclasses.replace(built, plant=world, controller=law, wind=air)
        metric = "ee_error_mean_continuous"
        batch = Batch(flown, (), metrics=(metric,), windows=Windows(steady=Window(7.0, 20.0)), effort=0)
        errors.append(float(batch.fly({}, episodes=np.arange(1)).metrics[metric][0]))
    assert errors[2] < 0.6 * errors[0]
    assert errors[2] < errors[1] < errors[0]
