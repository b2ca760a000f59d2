"""The scale of the joints' torques is learned from the arm's weight, and the force's
standard error is said.
"""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from measure_pressing_scenes import scene_document

import skyarm
from skyarm.algebra import Mat3, Vec3
from skyarm.control.blocks.force_control import first_interaction, wanted_of
from skyarm.control.blocks.prediction import Disturbance
from skyarm.control.blocks.tip_force import (
    ForceErrors,
    effort_shares,
    levers,
    tip_force,
)
from skyarm.control.blocks.torque_scale import Tolerances, first_scale
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal import make_centroidal
from skyarm.control.model import Model
from skyarm.scenario.scenario_file import scenario_from

DT, ERRORS, N = 0.005, ForceErrors(), Vec3(-0.8, 0.0, 0.6)
ARM = skyarm.load_vehicle("hummingbird_arm2_rotors")
AT = levers(ARM, Mat3.identity(), (-0.45, -0.9))
TORQUES, SCALES, WEIGHTS = (0.15, -0.05), (-0.1, 0.08), (0.02, -0.03)
MEMORY, CORRELATED = 0.5, 0.1
"""1/s and s, of the page."""


def hovered(by, seconds=2.0, scales=SCALES, weights=(0.0, 0.0)):
    """Sums after a hover in which each joint holds its torque with a wrong scale and a
    wrong weight.
    """
    seen = tuple(
        (s + w) * tau for s, w, tau in zip(scales, weights, TORQUES, strict=True)
    )
    d, scale = (
        Disturbance(force=Vec3(0, 0, 0), torque=Vec3(0, 0, 0), efforts=seen),
        first_scale(2),
    )
    for _ in range(round(seconds / DT)):
        scale = scale.learn(by, ERRORS, AT, d, TORQUES, N, 1.0, 0.5, DT)
    return scale, scale.correct(by, ERRORS, AT, d, TORQUES).efforts


def test_the_share_of_an_effort_is_its_effect_on_the_force():
    still = Disturbance(
        force=Vec3(0.3, 0.1, -0.2), torque=Vec3(0.01, 0.02, 0.0), efforts=(0.1, -0.05)
    )
    for j, share in enumerate(effort_shares(ERRORS, AT, N)):
        efforts = [effort + (i == j) for i, effort in enumerate(still.efforts)]
        more = tip_force(ERRORS, AT, dataclasses.replace(still, efforts=tuple(efforts)))
        assert N.dot(more - tip_force(ERRORS, AT, still)) == pytest.approx(
            share, rel=1e-9
        )


def test_a_known_weight_tells_the_scale_and_an_unknown_one_its_share():
    """Of the disturbance that a wrong scale leaves, what stays is the part that the
    prior gives to the weight.
    """
    left = {
        masses: hovered(Tolerances(torques=0.1, masses=masses))[1]
        for masses in (0.0, 0.1)
    }
    for i, (s, tau) in enumerate(zip(SCALES, TORQUES, strict=True)):
        assert abs(left[0.0][i]) < 0.12 * abs(s * tau)
        assert left[0.1][i] == pytest.approx(0.5 * s * tau, rel=0.1)
    none = hovered(Tolerances(torques=0.0, masses=0.1))[1]
    assert none == pytest.approx(np.multiply(SCALES, TORQUES))


def test_the_estimate_and_its_deviation_are_those_of_the_draws():
    """Monte Carlo over scales and weights drawn with the tolerances: no bias, and the
    spread that is said.
    """
    by, seconds = Tolerances(torques=0.1, masses=0.05), 0.5
    draws = np.random.default_rng(1)
    A = np.square(TORQUES) * (1.0 - np.exp(-MEMORY * seconds)) / MEMORY
    scale, _ = hovered(by, seconds)
    assert scale.squares == pytest.approx(A, rel=5e-3)
    assert scale.unlearned == pytest.approx(np.exp(-0.5 * seconds), rel=5e-3)
    s, w = (
        0.1 * draws.standard_normal((20_000, 2)),
        0.05 * draws.standard_normal((20_000, 2)),
    )
    noise = ERRORS.turning * np.sqrt(CORRELATED / A)
    seen = s + w + noise * draws.standard_normal((20_000, 2))
    factors = np.array(scale.factors(by, ERRORS, AT), dtype=float) * np.array(
        scale.squares
    )
    # the prior's share where nothing is learned yet
    least = CORRELATED * ERRORS.turning**2
    assert first_scale(2).factors(by, ERRORS, AT) == pytest.approx([0.01 / least] * 2)
    left = np.std(s - factors * seen, axis=0)
    calm = Disturbance(force=Vec3(0, 0, 0), torque=Vec3(0, 0, 0), efforts=(0.0, 0.0))
    settled = dataclasses.replace(scale, unlearned=0.0).learn(
        by, ERRORS, AT, calm, TORQUES, N, 0.0, 0.5, DT
    )
    shares = np.array(effort_shares(ERRORS, AT, N), dtype=float)
    assert settled.deviation == pytest.approx(
        np.linalg.norm(shares * TORQUES * left), rel=0.03
    )
    # what the bias has not learned of the weights counts beside it
    unsettled = scale.learn(by, ERRORS, AT, calm, TORQUES, N, 0.0, 0.5, DT).deviation
    weight = 0.05 * float(scale.unlearned) * np.linalg.norm(shares * TORQUES)
    assert unsettled == pytest.approx(np.hypot(settled.deviation, weight), rel=1e-9)


def in_flight(wanted=0.0, holds=(), acted=(0.1, 0.2), **memory):
    """Squares and flag of contact after a period of a flight in which no contact was
    for a second.
    """
    law = make_centroidal(
        Model(vehicle=ARM), mode="tip", interaction=(0.3, 0.1), tolerances=[0.1, 0.05]
    ).par
    part, zero = law.parts.interaction, Vec3(0.0, 0.0, 0.0)
    observed = SimpleNamespace(force=zero, torque=zero, efforts=(0.0, 0.0))
    timing, seen = (
        SimpleNamespace(acted=SimpleNamespace(efforts=acted)),
        SimpleNamespace(observed=observed),
    )
    step = SimpleNamespace(seen=seen, timing=timing, holds=holds, dt=DT)
    before = dataclasses.replace(
        first_interaction(2), free=1.0, scale=first_scale(2), **memory
    )
    after = part._at_scale(before, step, AT, wanted_of((wanted, 0.0, *N)))[1].scale
    return after.squares, after.met


def test_the_scale_is_learned_from_the_command_that_acted_at_a_free_and_empty_tip():
    """Of the period before the measurement; the touch of the period before is
    remembered.
    """
    assert in_flight()[0] == pytest.approx([DT * 0.01, DT * 0.04])
    assert in_flight(wanted=1.0)[0] == in_flight(holds=(1.0,))[0] == (0.0, 0.0)
    assert [in_flight(touching=each)[1] for each in (0.0, 1.0)] == [0.0, 1.0]


def test_tolerances_without_force_control_are_refused():
    with pytest.raises(
        ControllerError,
        match=r"tolerances = \(0\.1, 0\.0\): must be twice 0 without interaction",
    ):
        make_centroidal(Model(vehicle=ARM), mode="tip", tolerances=[0.1, 0.0])


def weak(tolerances, joints=("joint1", "joint2")):
    """Error of 1 N on a wall with joints 10 % weak, and the log."""
    document = scene_document("arm2", noisy=False, duration=5.0)
    document["controller"]["tolerances"] = tolerances
    document["environment"] = {
        "faults": [{"joint": name, "effectiveness": 0.9} for name in joints]
    }
    log = skyarm.run(scenario_from(document))
    return float(log.contact_force[log.time > 4.0, 0].mean()) - 1.0, log


def test_weak_joints_press_with_the_force_once_their_scale_is_learned():
    error, log = weak([0.1, 0.0])
    assert abs(error) < 0.01  # -0.12 N without tolerances
    assert log.push_found[-1, 0] == pytest.approx(-1.0, abs=0.01)
    assert 0.02 < log.push_deviation[-1] < 0.15


@pytest.mark.thorough
def test_the_standard_error_is_that_of_single_joints_in_flight():
    """Tolerances too small to learn anything: the errors of the joints one by one,
    added as squares.
    """
    single = [weak([1e-3, 0.0], joints=(name,))[0] for name in ("joint1", "joint2")]
    _, log = weak([1e-3, 0.0], joints=())
    assert 100.0 * log.push_deviation[-1] == pytest.approx(
        np.linalg.norm(single), rel=0.15
    )
    plain, log = weak([0.0, 0.0])
    assert plain == pytest.approx(-0.12, abs=0.005)
    assert not log.push_found.size
    assert not log.push_deviation.size
