"""The learned compensator: the network is what NumPy says, its training repeats and
learns, and it flies.
"""

import dataclasses
import json
import math
import re
import runpy
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skyarm.algebra import Vec3
from skyarm.compile import trace
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.compile.tracing.program import trace_loop
from skyarm.control.catalogue import ACCELERATION, HUMMINGBIRD, make_controller
from skyarm.control.controller import ControllerError
from skyarm.control.laws.learned.law import (
    HISTORY,
    compensate,
    feature_names,
    features,
    no_history,
    read_network,
    shipped_network,
    with_command,
    with_motion,
)
from skyarm.control.laws.paper import hybrid_computed_torque
from skyarm.control.model import Model
from skyarm.control.onboard.export_c import export_c
from skyarm.dynamics import array_front as arrays
from skyarm.dynamics.actuators import Command
from skyarm.records.leaves import leaves
from skyarm.scenario.scenario_file import load_scenario
from skyarm.simulate.loop import run
from skyarm.vehicle.vehicle_files import load_vehicle
from support.engines import Loaded, needs_cc
from support.laws import ARM2, MODEL, cases, hovering, pushes
from support.logs import Errors, synthetic_log

TRAINING = runpy.run_path(
    str(Path(__file__).parents[2] / "examples/learned_compensator/train.py")
)
NAMES = (
    "Budget",
    "Trainer",
    "random_scenario",
    "residuals",
    "samples",
    "learn",
    "training_record",
    "write_network",
)
(
    Budget,
    Trainer,
    random_scenario,
    residuals,
    samples,
    learn,
    training_record,
    write_network,
) = map(TRAINING.get, NAMES)
TINY = Budget(flights=3, rounds=1, duration=0.6, hidden=8, epochs=20, batch=16, seed=5)


def learned(**options):
    return make_controller(
        "learned_compensator",
        MODEL,
        gains=HUMMINGBIRD,
        joint_gains=ACCELERATION,
        **options,
    )


def numpy_forward(network, x):
    """The network by matrices."""
    z = (x - np.array(network.means)) * np.array(network.factors)
    *hidden, last = [
        (np.array(layer.weights), np.array(layer.offsets)) for layer in network.layers
    ]
    for W, b in hidden:
        z = np.tanh(W @ z + b)
    limits = np.array(network.limits)
    return np.clip((last[0] @ z + last[1]) * np.array(network.scales), -limits, limits)


def inputs(count, seed=0):
    network, _ = shipped_network()
    rng = np.random.default_rng(seed)
    return np.array(network.means) + rng.normal(
        size=(count, len(network.means))
    ) / np.array(network.factors)


def test_the_shipped_network_is_what_its_matrices_say():
    network, _ = shipped_network()
    for x in inputs(20):
        # 1e-13: sums of a hundred products in another order
        np.testing.assert_allclose(
            network(x.tolist()), numpy_forward(network, x), rtol=1e-11, atol=1e-13
        )


def test_answers_beyond_what_training_saw_are_limited():
    network, _ = shipped_network()
    wild = network((inputs(1)[0] * 1000.0).tolist())
    assert np.all(np.abs(wild) <= np.array(network.limits))


def test_the_file_says_how_it_was_made_and_reads_back_as_written():
    network, training = shipped_network()
    assert training["command"] == "python examples/learned_compensator/train.py FILE"
    assert training["inputs"] == list(feature_names(2))
    assert len(training["outputs"]) == len(training["held_out_rms_error"]) == 8
    text = write_network(network, training)
    assert read_network(text) == (network, training)
    assert len(text) < 200_000
    assert all(
        e < r
        for e, r in zip(
            training["held_out_rms_error"][:3],
            training["held_out_rms"][:3],
            strict=True,
        )
    )


@pytest.mark.parametrize("text", ["[]", '{"schema": 1}', '{"schema": 2}', "nothing"])
def test_another_file_is_refused(text):
    with pytest.raises(
        ValueError,
        match=r"schema|must be a file that the training wrote|Expecting value",
    ):
        read_network(text)


def test_with_a_silent_network_it_is_the_paper_s_law():
    silent = dataclasses.replace(shipped_network()[0], limits=(0.0,) * 8)
    ours = learned(network=silent)
    paper = make_controller(
        "hybrid_computed_torque", MODEL, gains=HUMMINGBIRD, joint_gains=ACCELERATION
    )
    for case in cases(10, seed=2):
        _, command = ours.law(
            ours.memory, case.measurement(), case.reference(), 0.005, par=ours.par
        )
        _, expected = hybrid_computed_torque(
            (), case.measurement(), case.reference(), 0.005, par=paper.par
        )
        np.testing.assert_allclose(
            leaves(command), leaves(expected), rtol=1e-9, atol=1e-12
        )


def test_what_pushes_already_is_taken_off_torque_thrust_and_efforts():
    ours = learned()
    for case in (hovering(joints=(0.2, -0.1)), hovering(joints=(-0.3, 0.4))):
        told = (0.0, 0.0, 0.7, 0.02, -0.03, 0.004, 0.05, -0.02)
        alone = compensate(case.measurement(), case.reference(), (0.0,) * 8, ours.par)
        helped = compensate(case.measurement(), case.reference(), told, ours.par)
        (torque, thrust), (torque_0, thrust_0) = (
            pushes(ARM2, helped),
            pushes(ARM2, alone),
        )
        np.testing.assert_allclose(torque - torque_0, [-0.02, 0.03, -0.004], atol=1e-9)
        assert thrust - thrust_0 == pytest.approx(-0.7)
        np.testing.assert_allclose(
            np.subtract(helped.efforts, alone.efforts), [-0.05, 0.02], atol=1e-12
        )


def test_the_answer_is_followed_by_a_first_order_filter():
    always = shipped_network()[0]
    top = dataclasses.replace(always.layers[-1], offsets=(1e6,) * 8)
    ours = learned(
        network=dataclasses.replace(always, layers=(*always.layers[:-1], top)),
        answer=7.0,
    )
    case, memory = cases(1, seed=4)[0], ours.memory
    for _ in range(10):
        memory, _ = ours.law(
            memory, case.measurement(), case.reference(), 0.005, par=ours.par
        )
    np.testing.assert_allclose(
        memory.answer,
        np.array(always.limits) * (1.0 - math.exp(-7.0 * 0.05)),
        rtol=1e-9,
    )


def test_the_history_is_the_filtered_motion_and_its_rise_the_acceleration():
    case, history = cases(1, seed=6)[0], no_history(2)
    command = Command(rotor_speeds=(480.0, 500.0, 470.0, 490.0), efforts=(0.1, -0.2))
    names = feature_names(2)
    acceleration, place = np.array([1.0, -2.0, 0.5]), names.index("acceleration_B x")
    for k in range(400):
        now = dataclasses.replace(case, v=acceleration * k * 0.005)
        seen = features(now.measurement(), now.reference(), history)
        history = with_command(
            ARM2, with_motion(history, now.measurement(), 0.005), command, 0.005
        )
    # a ramp runs ahead of its filter by acceleration over HISTORY, up to half a period
    # of sampling
    expected = (
        case.R.T @ acceleration * (HISTORY * 0.005 / (1.0 - math.exp(-HISTORY * 0.005)))
    )
    np.testing.assert_allclose(seen[place : place + 3], expected, rtol=1e-6)
    thrust = sum(
        r.thrust_coefficient * w**2
        for r, w in zip(ARM2.rotors, command.rotor_speeds, strict=True)
    )
    assert seen[names.index("force_B z")] == pytest.approx(thrust)
    np.testing.assert_allclose(seen[-2:], command.efforts)
    np.testing.assert_allclose(seen[3:6], case.R.T @ [0.0, 0.0, 1.0], atol=1e-12)


def test_machine_code_and_python_of_the_law_are_one():
    ours, case = learned(), cases(1, seed=8)[0]

    def step(memory, _par, row, _uniforms):
        return ours.law(memory, *row, 0.005, par=ours.par)

    row = (case.measurement(), case.reference())
    loop = trace_loop(step, ours.memory, (), row)
    kernel = Kernel(loop, Lanes(1, contract=False), logging=True)
    start, numbers = np.array(leaves(ours.memory))[:, None], np.array([leaves(row)] * 3)
    carry, log = kernel.run(start, np.zeros((0, 1)), numbers)
    program = trace(
        lambda memory, m, r: ours.law(memory, m, r, 0.005, par=ours.par),
        ours.memory,
        *row,
    )
    memory = tuple(leaves(ours.memory))
    for _ in range(3):
        result = program.flat((*memory, *leaves(row)))
        memory = result[: len(memory)]
    # libm's tanh and ours differ in the last places
    np.testing.assert_allclose(carry[:, 0], memory, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(log[-1, :, 0], result[len(memory) :], rtol=1e-9)


@pytest.mark.thorough
@needs_cc
def test_in_c_it_has_the_bits_of_the_law_in_python_over_several_steps(tmp_path):
    ours, some = learned(), cases(5, seed=3)
    text = export_c(ours, name="law", period=0.005).text
    assert not re.search(
        r"^    double \w+(\[\d+\])*;$",
        text.split("struct law_parameters")[1].split("};")[0],
        re.M,
    )
    in_c, memory = (
        Loaded(text, tmp_path, ("-O1", "-std=c99", "-ffp-contract=off")),
        ours.memory,
    )
    for case in some:
        found = in_c(case.measurement(), case.reference())
        memory, command = ours.law(
            memory, case.measurement(), case.reference(), 0.005, par=ours.par
        )
        # tanh and exp are libm's in both
        np.testing.assert_allclose(
            found, [float(x) for x in leaves(command)], rtol=1e-12
        )


def test_another_arm_is_refused():
    with pytest.raises(
        ControllerError,
        match=r"takes 39 inputs, a vehicle of 6 joints gives 63; train one",
    ):
        make_controller(
            "learned_compensator", Model(vehicle=load_vehicle("hexarotor_arm6"))
        )


def test_the_shipped_network_is_refused_for_an_untrained_vehicle_unless_it_is_given():
    heavy = dataclasses.replace(
        ARM2, base=dataclasses.replace(ARM2.base, mass=3.0 * ARM2.base.mass)
    )
    first, second = ARM2.links
    joint = dataclasses.replace(second.joint, position=Vec3(0.0, 0.0, -0.4))
    long = dataclasses.replace(
        ARM2, links=(first, dataclasses.replace(second, joint=joint))
    )
    for vehicle, words in (
        (heavy, r"masses \[2.148, .*trained with \[0.716"),
        (long, r"places .*trained with \[0.0"),
    ):
        with pytest.raises(ControllerError, match=words):
            make_controller("learned_compensator", Model(vehicle=vehicle))
        make_controller(
            "learned_compensator", Model(vehicle=vehicle), network=shipped_network()[0]
        )
    for name in ("hummingbird_arm2", "hummingbird_arm2_rotors"):
        make_controller("learned_compensator", Model(vehicle=load_vehicle(name)))


def test_wind_moves_it_a_tenth_of_what_it_moves_the_paper_s_law():
    scenario = load_scenario("case3_wind")
    scenario = dataclasses.replace(scenario, duration=5.0)
    errors = {}
    for name, controller in (("paper", scenario.controller), ("learned", learned())):
        log = run(dataclasses.replace(scenario, controller=controller))
        assert log.status == "completed"
        errors[name] = Errors.continuous(log).position[log.time >= 4.0].mean()
    assert errors["learned"] < 0.1 * errors["paper"]


def test_what_the_model_leaves_out_of_a_flight_is_the_push_that_was_given():
    controller = load_scenario("case3").controller
    scenario = random_scenario(np.random.default_rng(1), controller, 1.0, 0)
    belief = scenario.plant.vehicle
    wind = dataclasses.replace(
        scenario.wind, air_velocity_W=scenario.wind.force_W * 0.0, gust=None
    )
    still = tuple(
        dataclasses.replace(r, drag_coefficient=0.0, rolling_moment_coefficient=0.0)
        for r in belief.rotors
    )
    truth = dataclasses.replace(belief, rotors=still).with_joints(damping=0.0)
    flown = dataclasses.replace(
        scenario, wind=wind, plant=dataclasses.replace(scenario.plant, vehicle=truth)
    )
    log = run(flown)
    found = residuals(Model(vehicle=truth, gravity=9.8), log)
    turned = Rotation.from_quat(log.quaternion[:-1][:, [1, 2, 3, 0]]).inv()
    pushed = turned.apply([float(c) for c in wind.force_W])
    # differences over a period of 5 ms against the force at its beginning
    np.testing.assert_allclose(found[20:, :3], pushed[20:], atol=0.05)
    assert np.abs(found[40:, 3:]).max() < 5e-3


@pytest.mark.thorough
def test_a_noisy_flight_is_seen_through_every_channel_of_the_bench_s_noise():
    log = run(
        random_scenario(
            np.random.default_rng(2), load_scenario("case3").controller, 8.0, 0
        )
    )
    clean, noisy = samples(MODEL, [log, log], [False, True], np.random.default_rng(3))[
        0
    ]
    # NumPy's view of the true flight
    turned = Rotation.from_quat(log.quaternion[:-1][:, [1, 2, 3, 0]]).inv()
    names = list(feature_names(2))
    truths = {
        "up_B x": turned.apply([0.0, 0.0, 1.0])[:, 0],
        "velocity_B x": turned.apply(log.velocity[:-1])[:, 0],
        "rate_B y": log.rate[:-1, 1],
        "joint 2": log.joints[:-1, 1],
        "joint_rate 1": log.joint_rates[:-1, 0],
        "position_error_B z": turned.apply(log.position[:-1] - log.position_held[:-1])[
            :, 2
        ],
    }
    for name, truth in truths.items():
        np.testing.assert_allclose(clean[:, names.index(name)], truth, atol=1e-12)
    # 1600 draws: a deviation is known to 1.8 %
    for name, sigma in (
        ("up_B x", 0.002),
        ("rate_B y", 0.01),
        ("joint 2", 0.001),
        ("joint_rate 1", 0.01),
    ):
        off = (noisy - clean)[:, names.index(name)]
        assert off.std() == pytest.approx(sigma, rel=0.08), name
        assert abs(off.mean()) < 5.0 * off.std() / math.sqrt(len(off))
    # a wrong attitude turns a vector; its length shows the vector's own noise
    for group, sigma in (("position_error_B", 0.001), ("velocity_B", 0.01)):
        at = names.index(f"{group} x")
        off = np.linalg.norm(noisy[:, at : at + 3], axis=1) - np.linalg.norm(
            clean[:, at : at + 3], axis=1
        )
        assert off.std() == pytest.approx(sigma, rel=0.08), group


BETA = (0.9, 0.999)


def loss(parts, x, y):
    """Mean squared error of a perceptron with tanh between its layers; complex numbers
    may pass.
    """
    value = x.astype(complex)
    for i in range(0, len(parts), 2):
        value = value @ parts[i] + parts[i + 1]
        if i + 2 < len(parts):
            value = np.tanh(value)
    return ((value - y) ** 2).sum() / y.size


def gradient(parts, x, y):
    """By complex steps, exact to rounding."""
    found = []
    for i, part in enumerate(parts):
        slope = np.empty(part.shape)
        for place in np.ndindex(part.shape):
            moved = [each.astype(complex) for each in parts]
            moved[i][place] += 1e-30j
            slope[place] = loss(moved, x, y).imag / 1e-30
        found.append(slope)
    return found


@pytest.mark.parametrize("sizes", [(3, 4, 5, 2)])
def test_steps_are_those_of_adam_as_published(sizes):
    """Kingma, Ba 2015, algorithm 1, with the gradient by complex steps: five steps on
    changing batches.
    """
    rng = np.random.default_rng(3)
    trainer = Trainer(sizes, np.random.default_rng(4))
    parts = [part.copy() for part in trainer.parts]
    m, v = ([np.zeros_like(part) for part in parts] for _ in range(2))
    for t in range(1, 6):
        x, y, rate = (
            rng.normal(size=(7, sizes[0])),
            rng.normal(size=(7, sizes[-1])),
            0.1 / t,
        )
        g = gradient(parts, x, y)
        told = loss(parts, x, y).real
        for i, slope in enumerate(g):
            m[i] = BETA[0] * m[i] + (1.0 - BETA[0]) * slope
            v[i] = BETA[1] * v[i] + (1.0 - BETA[1]) * slope**2
            parts[i] = parts[i] - rate * (m[i] / (1.0 - BETA[0] ** t)) / (
                np.sqrt(v[i] / (1.0 - BETA[1] ** t)) + 1e-8
            )
        assert trainer.step(x, y, rate) == pytest.approx(told, rel=1e-12)
        for ours, theirs in zip(trainer.parts, parts, strict=True):
            np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-9)


def test_what_a_model_leaves_out_is_found_sample_by_sample():
    """At each instant alone, rotated by SciPy: force and torque that the rotors' thrust
    and drag do not give.
    """
    vehicle = load_vehicle("hummingbird_arm2")
    rng = np.random.default_rng(8)
    log, count = synthetic_log("case1", "rigid_body", "CT", seconds=0.03), 6
    xyzw = Rotation.random(count, random_state=1).as_quat()
    log = dataclasses.replace(
        log,
        position=rng.normal(size=(count, 3)),
        quaternion=xyzw[:, [3, 0, 1, 2]],
        velocity=rng.normal(size=(count, 3)),
        rate=rng.normal(size=(count, 3)),
        joints=rng.normal(size=(count, 2)),
        joint_rates=rng.normal(size=(count, 2)),
        efforts=rng.normal(size=(count, 2)),
        rotor_speeds=rng.uniform(300.0, 700.0, size=(count, 4)),
    )
    found = residuals(Model(vehicle=vehicle, gravity=9.81), log)
    assert found.shape == (count - 1, 8)
    velocity = np.hstack([log.velocity, log.rate, log.joint_rates])
    for k in range(count - 1):
        slope = (velocity[k + 1] - velocity[k]) / 0.005
        needed = arrays.inverse_dynamics(
            vehicle,
            log.position[k],
            log.quaternion[k],
            log.joints[k],
            velocity[k],
            slope,
            gravity=9.81,
        )
        push, turn = np.zeros(3), np.zeros(3)
        for rotor, speed in zip(
            vehicle.rotors,
            0.5 * (log.rotor_speeds[k] + log.rotor_speeds[k + 1]),
            strict=True,
        ):
            thrust = (
                np.array([*rotor.axis], dtype=float)
                * float(rotor.thrust_coefficient)
                * speed**2
            )
            push += thrust
            spin = float(rotor.moment_coefficient * rotor.thrust_coefficient) * speed**2
            turn += np.cross(np.array([*rotor.position], dtype=float), thrust)
            turn -= float(rotor.direction) * spin * np.array([*rotor.axis], dtype=float)
        R = Rotation.from_quat(xyzw[k]).as_matrix()
        np.testing.assert_allclose(found[k, :3], R.T @ needed[:3] - push, atol=1e-9)
        np.testing.assert_allclose(found[k, 3:6], needed[3:6] - turn, atol=1e-9)
        np.testing.assert_allclose(found[k, 6:], needed[6:] - log.efforts[k], atol=1e-9)


def test_training_learns_and_repeats_bit_for_bit():
    first, second = learn(TINY), learn(TINY)
    assert first.losses[-1] < 0.8 * first.losses[0]
    assert write_network(first.network, training_record(TINY, first)) == write_network(
        second.network, training_record(TINY, second)
    )
    assert (
        json.loads(write_network(first.network, training_record(TINY, first)))[
            "training"
        ]["samples"]
        == first.samples
    )
    assert learn(dataclasses.replace(TINY, seed=6)).network != first.network
