"""The centroidal law as a whole: every engine, every vehicle, limits, its observer, its
maker.
"""

from __future__ import annotations

import dataclasses
from dataclasses import replace

import numpy as np
import pytest
from centroidal_flights import fly, planned

import skyarm
from skyarm.algebra import Quaternion, Vec3
from skyarm.compile import trace
from skyarm.control.catalogue import ControllerError, preset
from skyarm.control.laws.centroidal import make_centroidal, torques
from skyarm.control.laws.centroidal.options import VALUES, periods_of
from skyarm.control.laws.centroidal.torques import TRIM
from skyarm.control.model import Model
from skyarm.control.onboard.export_c import export_c
from skyarm.plant.interface import Truth
from skyarm.records.leaves import leaves, rebuild
from skyarm.reference import hover
from skyarm.reference.signals import Sine
from skyarm.scenario.scenario_record import Scenario, first_state
from skyarm.sensing.measurement import measurement_of
from skyarm.simulate import run
from skyarm.world import ForceWind
from support.engines import jax_doubles
from support.laws import MODEL, G, cases, changed, hovering, stacked

CASES = cases(4, seed=77, pitch=np.radians(60.0))
INPUTS = [(case.measurement(), case.reference()) for case in CASES]
LAWS = {
    "joint": make_centroidal(MODEL),
    "tip": make_centroidal(MODEL, mode="tip"),
    "late": make_centroidal(MODEL, mode="tip", delay=0.010),
    "unmoved": make_centroidal(
        MODEL,
        mode="tip",
        adaptation=1.0,
        preview=0.0,
        lag=(0.0, 0.0),
        accelerometer=(0.0, 0.0),
    ),
}


def step(flown, memory, measurement, reference):
    return flown.law(memory, measurement, reference, 0.005, par=flown.par)


def second(flown, measurement, reference):
    """Command and memory of the second step, when the observer runs."""
    memory, _ = step(flown, flown.memory, *INPUTS[0])
    return step(flown, memory, measurement, reference)


def floats(flown):
    return np.array([leaves(second(flown, *pair)) for pair in INPUTS], dtype=float)


def close(found, expected):
    """Engines differ by last digits of sin and cos; speeds near the clip are roots of
    small differences.
    """
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-5)


@pytest.mark.parametrize("name", LAWS)
def test_numpy_lanes_equal_a_loop(name):
    flown = LAWS[name]
    batch = second(
        flown, stacked([m for m, _ in INPUTS]), stacked([r for _, r in INPUTS])
    )
    found = np.stack(
        [np.broadcast_to(leaf, (len(INPUTS),)) for leaf in leaves(batch)], axis=1
    )
    close(found, floats(flown))


def test_jax_agrees_with_floats():
    jax = pytest.importorskip("jax")
    flown = LAWS["unmoved"]
    with jax_doubles():
        measured, reference = (
            stacked(records) for records in zip(*INPUTS, strict=True)
        )
        values = [
            jax.numpy.asarray(leaf) for leaf in (*leaves(measured), *leaves(reference))
        ]
        split = len(leaves(measured))
        result = second(
            flown,
            rebuild(measured, iter(values[:split])),
            rebuild(reference, iter(values[split:])),
        )
        found = np.stack(
            [
                np.broadcast_to(np.asarray(leaf), (len(INPUTS),))
                for leaf in leaves(result)
            ],
            axis=1,
        )
    close(found, floats(flown))


def test_casadi_agrees_with_floats():
    import casadi

    flown = LAWS["tip"]
    measured, reference = INPUTS[0]
    symbols = [
        casadi.SX.sym(f"x{i}")
        for i in range(len(leaves(measured)) + len(leaves(reference)))
    ]
    split = len(leaves(measured))
    result = second(
        flown,
        rebuild(measured, iter(symbols[:split])),
        rebuild(reference, iter(symbols[split:])),
    )
    compiled = casadi.Function(
        "law", [casadi.vertcat(*symbols)], [casadi.vertcat(*leaves(result))]
    )
    close(
        np.array(
            [np.array(compiled([*leaves(m), *leaves(r)])).ravel() for m, r in INPUTS]
        ),
        floats(flown),
    )


@pytest.mark.parametrize("name", LAWS)
def test_a_traced_law_equals_floats_bit_for_bit(name):
    flown = LAWS[name]
    program = trace(
        lambda memory, m, r: step(flown, memory, m, r), flown.memory, *INPUTS[0]
    )
    memory = flown.memory
    for pair in INPUTS:
        traced, plain = program(memory, *pair), step(flown, memory, *pair)
        assert leaves(traced) == leaves(plain)
        memory = plain[0]


def test_gains_masses_and_gravity_may_be_inputs_of_a_traced_program():
    flown = LAWS["late"]
    program = trace(
        lambda par, memory, m, r: flown.law(memory, m, r, 0.005, par=par),
        flown.par,
        flown.memory,
        *INPUTS[0],
    )
    model = Model(vehicle=MODEL.vehicle.with_payload(0.05), gravity=9.7)
    other = dataclasses.replace(
        make_centroidal(MODEL, mode="tip", delay=0.010, adaptation=0.3).par, model=model
    )
    for par in (flown.par, other):
        plain = flown.law(flown.memory, *INPUTS[1], 0.005, par=par)
        close(leaves(program(par, flown.memory, *INPUTS[1])), leaves(plain))


def test_a_hovering_vehicle_is_told_to_hover():
    """Thrust is the weight, the joints hold the arm, after the motors' model has
    settled.
    """
    case = hovering(joints=(0.3, -0.5))
    pair = (case.measurement(), case.reference())
    flown = make_centroidal(MODEL)
    program = trace(lambda memory, m, r: step(flown, memory, m, r), flown.memory, *pair)
    memory = flown.memory
    for _ in range(600):
        memory, command = program(memory, *pair)
    # a measurement that stays at rest whatever is commanded leaves what the trim's
    # transient has put into the observer and the adaptation; with the command both hold
    # the vehicle
    held, fed = memory.observed, memory.parts.adaptation.feedforward
    assert np.abs(leaves(held.force)).max() < 0.02
    assert np.abs(held.efforts).max() < 1e-3
    weight = MODEL.vehicle.mass * G
    thrust = sum(
        r.thrust_coefficient * w * w
        for r, w in zip(MODEL.vehicle.rotors, command.rotor_speeds, strict=True)
    )
    assert thrust + held.force.z + fed.force.z == pytest.approx(weight, rel=1e-4)
    th1, th2 = 0.3, -0.5
    # link 1: 40 g at 75 mm and all of link 2 at 150 mm; link 2: 40 g at 75 mm, 10 g at
    # 150 mm
    lower = G * (0.04 * 0.075 + 0.01 * 0.15) * np.sin(th1 + th2)
    upper = lower + G * (0.04 * 0.075 + 0.05 * 0.15) * np.sin(th1)
    efforts = np.add(np.add(command.efforts, held.efforts), fed.efforts)
    assert efforts == pytest.approx((upper, lower), abs=1e-4)


@pytest.mark.parametrize("name", LAWS)
def test_no_command_is_ever_nan(name):
    """Free fall wanted, upside down, spinning, far away, and rotors that the model
    thinks stopped.
    """
    flown = LAWS[name]
    odd = [
        changed(hovering(), a_d=(0.0, 0.0, -G)),
        changed(hovering(), euler=(np.pi, 0.0, 0.0)),
        changed(hovering(), euler=(0.0, np.pi / 2, 0.0), w=(30.0, -20.0, 10.0)),
        changed(hovering(), p=(500.0, -300.0, 90.0), v=(40.0, 10.0, -30.0)),
        changed(hovering(joints=(0.0, 0.0)), q_d=(40.0, -30.0), qd=(50.0, -80.0)),
        changed(hovering(), p_d=(1e4, 0.0, 0.0), a_d=(1e3, 0.0, -1e3)),
    ]
    for case in odd:
        memory = flown.memory
        for _ in range(5):
            memory, command = step(flown, memory, case.measurement(), case.reference())
            assert np.all(np.isfinite(leaves(memory)))
            speeds, efforts = np.array(command.rotor_speeds), np.array(command.efforts)
            assert np.all((speeds >= 0.0) & (speeds <= 838.0))
            assert np.all(np.abs(efforts) <= 0.5)


def test_the_quaternion_and_its_opposite_are_one_attitude():
    flown = LAWS["tip"]
    memory, _ = step(flown, flown.memory, *INPUTS[0])
    measured, reference = INPUTS[1]
    opposite = dataclasses.replace(
        measured, quaternion=Quaternion(*(-c for c in measured.quaternion))
    )
    one, other = (step(flown, memory, m, reference) for m in (measured, opposite))
    assert leaves(one[1]) == pytest.approx(leaves(other[1]), rel=1e-12)


def test_the_disturbance_is_frozen_while_the_rotors_are_at_their_limit():
    case = changed(hovering(), p_d=(0.0, 0.0, 30.0), a_d=(0.0, 0.0, 40.0))
    flown = LAWS["joint"]
    memory, _ = step(flown, flown.memory, hovering().measurement(), case.reference())
    for _ in range(50):
        memory, command = step(
            flown, memory, hovering().measurement(), case.reference()
        )
    assert memory.free[0] == 0.0
    assert min(command.rotor_speeds) > 830.0
    # the vehicle stays where it is although all rotors roar; without the freeze the
    # force would be minus the thrust
    assert abs(memory.observed.force.z) < 2.0


@pytest.fixture(scope="module")
def windy():
    """Hover for eight seconds in a force of known size at a known point, with a model
    that is the truth.
    """
    loaded = planned("case2")
    truth = loaded.plant.vehicle.with_joints(damping=0.0)
    force = ForceWind(force_W=Vec3(0.6, -0.4, 0.3), point_B=Vec3(0.03, -0.02, 0.0))
    law = make_centroidal(Model(vehicle=truth, gravity=9.8))
    return fly(
        dataclasses.replace(
            loaded,
            duration=8.0,
            plant=Truth(vehicle=truth, gravity=9.8),
            wind=force,
            controller=law,
            reference=hover((0.0, 0.0, 1.0), joints=(0.2, -0.1)),
        )
    )


def test_the_observer_finds_a_constant_force_and_its_torque(windy):
    observed, learned = windy.memory.observed, windy.memory.parts.adaptation
    # a trace of the start is still taken for a load
    assert abs(learned.tip_mass) < 1e-4
    assert leaves(observed.force + learned.feedforward.force) == pytest.approx(
        (0.6, -0.4, 0.3), abs=1e-4
    )
    # the force turned into the tilted body, at its point
    from scipy.spatial.transform import Rotation

    w, x, y, z = windy.quaternion[0, -1]
    push = Rotation.from_quat([x, y, z, w]).inv().apply([0.6, -0.4, 0.3])
    assert leaves(observed.torque + learned.feedforward.torque) == pytest.approx(
        np.cross([0.03, -0.02, 0.0], push), abs=1e-5
    )
    efforts = [
        a + b
        for a, b in zip(observed.efforts, learned.feedforward.efforts, strict=True)
    ]
    assert efforts == pytest.approx((0.0, 0.0), abs=1e-5)
    assert windy.base[0, -1] < 0.01


VEHICLES = [
    ("hummingbird", "joint"),
    ("tilted_hexarotor", "joint"),
    ("hexarotor_arm6", "tip"),
    ("octo_coaxial_two_arms", "joint"),
]


@pytest.mark.parametrize(("name", "mode"), VEHICLES)
def test_any_vehicle_flies(name, mode):
    vehicle = skyarm.load_vehicle(name)
    joints = [
        Sine(
            amplitude=0.01 if link.joint.kind == "prismatic" else 0.2, frequency_hz=0.3
        )
        for link in vehicle.links
    ]
    heading = Sine(amplitude=0.3, frequency_hz=0.1)
    scenario = Scenario(
        name="any",
        duration=2.5,
        plant=Truth(vehicle=vehicle),
        controller=make_centroidal(Model(vehicle=vehicle), mode=mode),
        reference=hover((0.0, 0.0, 1.5), yaw=heading, joints=joints),
        wind=ForceWind(force_W=Vec3(0.5, 0.3, 0.0)),
        ground=False,
    )
    log = run(scenario)
    assert log.status == "completed"
    error = (
        log.tool - log.tool_reference
        if mode == "tip"
        else log.position - log.position_reference
    )
    assert np.linalg.norm(error[log.time >= 2.0], axis=1).mean() < 2e-3


def test_an_arm_beside_the_tips_is_no_lever():
    """Ten centimetres off at the start: another arm and the torso's slide must not
    swing to move the tip.
    """
    vehicle = skyarm.load_vehicle("octo_coaxial_two_arms")
    scenario = Scenario(
        name="beside",
        duration=4.0,
        plant=Truth(vehicle=vehicle),
        controller=make_centroidal(Model(vehicle=vehicle), mode="tip"),
        reference=hover((0.0, 0.0, 2.0), joints=(0.0,) * vehicle.n),
        ground=False,
    )
    start = dataclasses.replace(first_state(scenario), position=Vec3(0.1, 0.05, 2.0))
    log = run(dataclasses.replace(scenario, initial=start))
    assert log.status == "completed"
    assert np.abs(log.joints).max() < 1.0
    assert np.linalg.norm(log.tool - log.tool_reference, axis=1)[-1] < 1e-3


@pytest.mark.parametrize("mode", ["joint", "tip"])
def test_a_weak_joint_hangs_low_and_the_base_stays(mode):
    """The arm needs 0.07 N m and has 0.03: the body torque is that of the motion which
    is left.
    """
    vehicle = skyarm.load_vehicle("hummingbird_arm2_rotors").with_joints(
        effort_limit=0.03
    )
    log = run(
        Scenario(
            name="weak",
            duration=4.0,
            plant=Truth(vehicle=vehicle),
            controller=make_centroidal(Model(vehicle=vehicle), mode=mode),
            reference=hover(
                (0.0, 0.0, 2.0), joints=(Sine(amplitude=0.4, frequency_hz=0.3),) * 2
            ),
            ground=False,
        )
    )
    assert log.status == "completed"
    assert np.abs(log.joints - log.joints_reference).max() > 0.05
    assert np.linalg.norm(log.position - log.position_reference, axis=1).max() < 0.05


def test_dry_friction_that_the_model_knows_costs_little():
    """Against a model without it: the observer has to learn each reversal."""
    vehicle = skyarm.load_vehicle("hummingbird_arm2_rotors").with_joints(
        damping=0.005, coulomb=0.003, coulomb_rate=0.3
    )
    found = []
    for model in (vehicle, vehicle.with_joints(damping=0.0, coulomb=0.0)):
        log = run(
            Scenario(
                name="dry",
                duration=4.0,
                plant=Truth(vehicle=vehicle),
                controller=make_centroidal(Model(vehicle=model)),
                reference=hover(
                    (0.0, 0.0, 2.0), joints=(Sine(amplitude=0.3, frequency_hz=0.5),) * 2
                ),
                ground=False,
            )
        )
        found.append(np.abs(log.joints - log.joints_reference)[log.time > 2.0].mean())
    assert found[0] < 0.6 * found[1]


def test_the_trim_stays_within_its_bound_whatever_is_sent(monkeypatch):
    """A vehicle that someone else holds: the modelled rotors never do what is
    wanted.
    """
    monkeypatch.setattr(torques, "TRIM_RATE", 50.0)
    flown = make_centroidal(MODEL)
    case = hovering()
    memory = flown.memory
    program = trace(
        lambda memory, m, r: step(flown, memory, m, r),
        memory,
        case.measurement(),
        case.reference(),
    )
    bound = [TRIM * highest for highest in flown.par.mixer.highest]
    far = changed(case, p_d=(0.0, 0.0, 0.3))
    worst = 0.0
    for _ in range(400):
        memory, command = program(memory, case.measurement(), far.reference())
        stopped = dataclasses.replace(
            command, rotor_speeds=(0.0,) * len(command.rotor_speeds)
        )
        memory = dataclasses.replace(memory, sent=stopped)
        assert all(abs(t) <= top for t, top in zip(memory.trim, bound, strict=True))
        worst = max(
            worst, *(abs(t) / top for t, top in zip(memory.trim, bound, strict=True))
        )
    assert worst == pytest.approx(1.0)


@pytest.mark.thorough
def test_mujocos_plant_sees_the_same_tip():
    pytest.importorskip("mujoco")
    scenario = dataclasses.replace(planned("case3_wind", mode="tip"), duration=12.0)
    log = run(dataclasses.replace(scenario, kind="mujoco"))
    at = log.time >= 10.0
    error = 1e3 * np.linalg.norm(log.tool - log.tool_reference, axis=1)[at].mean()
    assert log.status == "completed"
    assert error < 0.5
    assert error == pytest.approx(fly(scenario).mean("tip", 10.0, 12.0), abs=0.2)


def test_what_is_usual_lies_within_the_ranges_and_may_be_stated():
    stated = make_centroidal(MODEL, mode="tip", **VALUES)
    assert stated.par == make_centroidal(MODEL, mode="tip").par


def test_the_oldest_known_delay_is_a_hundred_periods():
    assert periods_of(0.5, 0.005) == 100
    assert periods_of(0.02, 0.01) == 2
    with pytest.raises(ControllerError, match="at most"):
        periods_of(0.505, 0.005)


def test_tip_mode_needs_an_end_effector():
    with pytest.raises(ControllerError, match="end_effector"):
        make_centroidal(Model(vehicle=skyarm.load_vehicle("hummingbird")), mode="tip")


def test_the_exported_c_file_names_every_gain():
    text = export_c(make_centroidal(MODEL, mode="tip"), name="law", period=0.005).text
    for word in (
        "base_position",
        "tip_damping",
        "observer_force",
        "accelerometer_force",
    ):
        assert word in text


def test_members_in_c_are_named_after_the_memory():
    text = export_c(make_centroidal(MODEL), name="law", period=0.005).text
    for member in (
        "double applied[3];",
        "double parts_adaptation_feedforward_force[3];",
        "double parts_adaptation_joints_0_once_load;",
    ):
        assert member in text


def test_the_law_is_found_by_name():
    for name in ("centroidal_joint", "centroidal_tip"):
        found = preset(name, MODEL)
        assert found.name == name
        assert found.keeps_tip == (name == "centroidal_tip")


def test_a_measurement_of_integers_is_one_of_numbers():
    """An estimator of one's own may give 0 for what it does not know: the observer's
    memory holds numbers.
    """
    scenario = skyarm.load_scenario("slide_up")
    model, n = scenario.controller.par.model, scenario.plant.vehicle.n
    still = measurement_of(first_state(scenario), model.gravity * Vec3(0.0, 0.0, 1.0))

    def flown(zero):
        given = replace(
            still,
            velocity=Vec3(zero, zero, zero),
            rate=Vec3(zero, zero, zero),
            joint_rates=(zero,) * n,
        )
        memory, commands = scenario.controller.memory, []
        for k in range(4):
            wanted = scenario.reference.at(0.005 * k)
            memory, command = scenario.controller.law(
                memory, given, wanted, 0.005, par=scenario.controller.par
            )
            commands.append(command)
        return commands, leaves(memory)

    assert flown(0) == flown(0.0)
