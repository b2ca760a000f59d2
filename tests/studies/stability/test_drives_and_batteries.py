"""Margins of loops with servos and batteries, against flights of the same."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from swinging_flights import hover, size

import skyarm
from skyarm.dynamics.actuators.servo import PositionServo
from skyarm.records.leaves import leaves
from skyarm.scenario.scenario_record import first_state
from skyarm.simulate import run
from skyarm.simulate.first_state import first_loop_state
from skyarm.simulate.inputs import episode_inputs
from skyarm.studies.stability import closed_loop as linear_loop
from skyarm.studies.stability.closed_loop import closed_loop, radius
from skyarm.studies.stability.flight_margins import frozen_instants, hovering
from skyarm.studies.stability.frozen_scenario import nominal, with_lag
from skyarm.studies.stability.open_loop import Differentiator
from skyarm.vehicle.battery import Battery, CellCurve


@pytest.fixture(scope="module")
def servos():
    """A quadrotor whose arm is moved by servos, on its battery; the paper's law knows
    of neither and swings.
    """
    return hover("quadrotor_roll_arm2", "paper_ct", (0.2, 0.3))


@pytest.mark.thorough
def test_a_flight_with_servos_grows_at_the_rate_of_its_largest_eigenvalue(servos):
    flight = dataclasses.replace(
        hovering(servos), duration=19.0, initial=first_state(servos)
    )
    tilted = [f"initial.quaternion.{axis}" for axis in "xy"]
    batch = skyarm.Batch(flight, tilted, metrics=(), log_every=1, effort=0)
    outcome = batch.fly(dict.fromkeys(tilted, np.array([0.0, 1e-4])))
    (frozen,) = frozen_instants(hovering(nominal(servos)), 1)
    found = radius(frozen.open_loop("between"))
    assert found > 1.0
    # two slow swings beat: windows of 7 s hold both
    grown = math.log(size(outcome.log, 12.0, 19.0)[1] / size(outcome.log, 5.0, 12.0)[1])
    assert grown / 7.0 == pytest.approx(200.0 * math.log(found), rel=0.1)


def test_some_periods_with_servos_are_those_of_a_flight(servos, monkeypatch):
    """As many as a setpoint takes through the servos; filters take the first
    measurement whole, later ones in part.
    """
    # of all periods the same states
    monkeypatch.setattr(
        linear_loop, "_in_loop", lambda A, *_: np.ones(len(A), dtype=bool)
    )
    flight = with_lag(nominal(dataclasses.replace(servos, duration=0.05)), 0.0)
    state, step, columns, count = first_state(flight), 1e-4, [], 6
    for joint in range(2):
        ends = []
        for side in (1.0, -1.0):
            moved = tuple(side * step * (i == joint) for i in range(2))
            log = run(
                dataclasses.replace(
                    flight, initial=dataclasses.replace(state, joint_rates=moved)
                )
            )
            ends.append(
                np.concatenate(
                    [log.rate[count], log.joints[count], log.joint_rates[count]]
                )
            )
        columns.append((ends[0] - ends[1]) / (2.0 * step))
    loop = Differentiator(flight).at(
        first_loop_state(flight), [0.0, *episode_inputs(flight).held_leaves[0]], "up"
    )
    assert loop.x_x.shape[1] > loop.states == 12 + 4 + 4
    passed = closed_loop(loop)
    for _, frozen in zip(
        range(count - 1), frozen_instants(flight, flight.steps), strict=False
    ):
        passed = closed_loop(frozen.open_loop("up")) @ passed
    ours = passed[np.ix_([9, 10, 11, 12, 13, 14, 15], [14, 15])]
    # the vehicle is not quite at rest at its start
    np.testing.assert_allclose(ours, np.array(columns).T, rtol=0.01, atol=2e-4)


def test_the_rounding_of_an_encoder_is_left_out_of_a_linearisation(servos):
    assert all(
        each.drive.resolution == 0 for each in nominal(servos).agent.joint_drives
    )
    rounded = tuple(
        dataclasses.replace(
            each, drive=dataclasses.replace(each.drive, resolution=1e-3)
        )
        for each in servos.agent.joint_drives
    )
    assert all(isinstance(each.drive, PositionServo) for each in rounded)
    loops = []
    for scenario in (servos, dataclasses.replace(servos, drives=rounded)):
        calm = hovering(nominal(scenario))
        row = [0.0, *episode_inputs(calm).held_leaves[0]]
        loops.append(Differentiator(calm).at(first_loop_state(calm), row, "up").x_x)
    np.testing.assert_array_equal(*loops)


def test_a_sagging_battery_is_part_of_the_loop_and_its_charge_is_not():
    vehicle = skyarm.load_vehicle("hummingbird")
    cell = CellCurve(charge=(0.0, 1.0), voltage=(3.0, 4.2))
    battery = Battery(
        cells=3,
        capacity=0.5,
        resistance=0.12,
        open_circuit=cell,
        reference_voltage=11.0,
        esc="open",
    )
    base = skyarm.load_scenario("case1", duration=0.01)
    model = skyarm.Model(vehicle=vehicle)
    scenario = with_lag(
        dataclasses.replace(
            base,
            plant=skyarm.Truth(
                vehicle=dataclasses.replace(vehicle, battery=battery), gravity=9.81
            ),
            controller=skyarm.make_controller("rotors_sim_position", model),
            reference=skyarm.hover(skyarm.Vec3(0.0, 0.0, 2.0)),
            ground=False,
        ),
        0.0,
    )
    state, step, columns = first_state(scenario), 1e-3, []
    for rotor in range(4):
        speeds = np.eye(4)[rotor] * step
        ends = []
        for side in (1.0, -1.0):
            moved = tuple(
                float(w) + side * d
                for w, d in zip(state.rotor_speeds, speeds, strict=True)
            )
            log = run(
                dataclasses.replace(
                    scenario, initial=dataclasses.replace(state, rotor_speeds=moved)
                )
            )
            ends.append(np.concatenate([log.velocity[1], log.rotor_speeds[1]]))
        columns.append((ends[0] - ends[1]) / (2.0 * step))
    row = [0.0, *episode_inputs(scenario).held_leaves[0]]
    loop = Differentiator(scenario).at(first_loop_state(scenario), row, "up")
    rows = [6, 7, 8, 12, 13, 14, 15]
    # a flight begins with commands that are the first speeds, and the voltage follows
    # these
    ours = closed_loop(loop)[np.ix_(rows, [12, 13, 14, 15])] + loop.x_old[0][rows, :4]
    flown = np.array(columns).T
    np.testing.assert_allclose(ours, flown, atol=1e-6)
    # a rotor that draws more slows the others down
    assert ours[4, 0] < -1e-5
    assert loop.states == len(leaves(state)) - 1 == loop.x_x.shape[1]
