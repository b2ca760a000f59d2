"""Episodes in machine code against the loop in Python floats: the same bits, however
long and noisy.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skyarm.algebra import Vec3
from skyarm.algebra.scalars.philox import normal
from skyarm.compile.llvm.kernel import Kernel
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.control.catalogue import LAWS
from skyarm.records.leaves import leaves
from skyarm.scenario.scenario_file import load_scenario, scenario_from
from skyarm.simulate import Scenario, run
from skyarm.simulate.engine import EpisodeCode
from skyarm.simulate.first_state import first_loop_state
from skyarm.simulate.inputs import episode_inputs
from skyarm.world import dryden
from support.cases import sampled
from support.flights import document, fly, shared_programs


@pytest.fixture(autouse=True, scope="module")
def _optimised():
    """Code as users fly it; other tests hurry the compiler."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SKYARM_EFFORT", "2")
        yield


NOISE = {
    "position": 0.003,
    "velocity": 0.02,
    "attitude": 0.004,
    "rate": 0.03,
    "specific_force": 0.1,
    "joints": 0.002,
    "joint_rates": 0.02,
    "rotor_speeds": 1.0,
}
TURBULENT = {
    "mode": "moving_air",
    "velocity": [1.0, 0.5, 0.0],
    "gust": {
        "velocity": [0.0, 1.0, 0.0],
        "start": 0.3,
        "duration": 0.5,
        "shape": "one_minus_cosine",
    },
    "turbulence": {"altitude": 6.0, "wind_20ft": 7.7},
}


@pytest.fixture(autouse=True, scope="module")
def _shared():
    with shared_programs():
        yield


def planned(name="case2_gust", **changes):
    return scenario_from(document(name, **changes), "test")


def rows_of(log):
    """What a log and machine code both keep: state and command at each instant."""
    state = (
        log.position,
        log.quaternion,
        log.velocity,
        log.rate,
        log.joints,
        log.joint_rates,
        log.rotor_speeds,
    )
    measured = (log.measured_position, log.measured_joints)
    return np.column_stack([*state, log.rotor_commands, log.efforts, *measured])


def columns(scenario: Scenario, rows):
    """The same columns of machine code's log: alive, state, command, measurement,
    wind.
    """
    n, rotors = scenario.plant.vehicle.n, len(scenario.plant.vehicle.rotors)
    reading = 1 + 13 + 2 * n + rotors + rotors + n
    joints = reading + 17
    kept = [
        *range(1, reading),
        *range(reading + 1, reading + 4),
        *range(joints, joints + n),
    ]
    return rows[:, kept]


def assert_equal_to_the_bit(scenario: Scenario):
    log = run(scenario)
    flown, floats = fly(scenario), fly(scenario, python=True)
    assert flown.rows.tobytes() == floats.rows.tobytes()
    assert repr(leaves(flown.carry)) == repr(leaves(floats.carry))
    ours, python = columns(scenario, flown.rows), rows_of(log)
    assert ours.shape == python.shape
    differ = np.argwhere(ours.view(np.uint64) != python.view(np.uint64))
    assert differ.size == 0, f"first at instant {differ[0][0]}, column {differ[0][1]}"
    return log, flown


@pytest.mark.parametrize("controller", sampled(["paper_ct", "paper_pd"], 2))
def test_noisy_turbulent_seconds_are_those_of_python_floats(controller):
    scenario = planned(
        "case3_wind",
        duration=0.5,
        controller={"preset": controller},
        sensors=NOISE,
        environment__wind=TURBULENT,
        delays={"measurement": 0.005, "command": 0.003},
        seed=11,
        episode=7,
    )
    log, flown = assert_equal_to_the_bit(scenario)
    assert log.status == "completed"
    assert float(flown.carry.ticks) == scenario.steps == 100


@pytest.mark.thorough
@pytest.mark.parametrize(
    "name", ["case1", "case2", "case2_gust", "case3", "case3_wind"]
)
def test_every_shipped_scenario_flies_alike(name):
    assert_equal_to_the_bit(load_scenario(name, duration=1.0))


VARIED = {
    "everything": {"duration": 0.5},
    "euler": {"duration": 1.0, "plant__integrator": "euler"},
    "noise": {"duration": 1.0, "sensors": NOISE, "seed": 2**32 - 1, "episode": 3},
    "some_noise": {"duration": 0.5, "sensors": {"rate": 0.1}},
    "turbulence": {"duration": 1.5, "environment__wind": TURBULENT},
    "late_command": {"duration": 1.0, "delays": {"command": 0.008}},
    "late_command_of_whole_periods": {"duration": 1.0, "delays": {"command": 0.010}},
    "late_measurement": {"duration": 1.0, "delays": {"measurement": 0.015}},
    "all_late_euler": {
        "duration": 0.5,
        "delays": {"measurement": 0.01, "command": 0.007},
        "plant__integrator": "euler",
    },
    "stiff_friction": {
        "duration": 0.5,
        "plant__joints": {"damping": 0.002, "coulomb": 0.001, "coulomb_rate": 0.02},
    },
    "slow_control": {
        "duration": 1.0,
        "rates": {"physics": 500, "control": 100, "reference": 25},
    },
    "tilted_start": {
        "duration": 0.5,
        "initial": {"quaternion_wxyz": [0.96, 0.28, 0.0, 0.0], "joints": [0.3, -0.2]},
    },
}


@pytest.mark.parametrize(
    "what",
    sampled(
        sorted(VARIED), 100, keep=("everything", "stiff_friction", "all_late_euler")
    ),
)
def test_every_feature_of_a_scenario_flies_alike(what):
    assert_equal_to_the_bit(
        planned("everything" if what == "everything" else "case2_gust", **VARIED[what])
    )


@pytest.mark.thorough
@pytest.mark.parametrize("law", sampled(sorted(set(LAWS) - {"nmpc"}), 6))
def test_every_law_flies_alike(law):
    belief = {"vehicle": "hummingbird_arm2", "gravity": 9.81}
    assert_equal_to_the_bit(
        planned(
            "case3", duration=0.1, model=belief, controller={"law": law}, sensors=NOISE
        )
    )


VEHICLES = (
    "octo_coaxial_two_arms",
    "hummingbird",
    "hexarotor_arm6",
    "tilted_hexarotor",
)


@pytest.mark.parametrize("vehicle", sampled(VEHICLES, 4))
def test_every_vehicle_flies_alike(vehicle):
    from skyarm.vehicle.vehicle_files import load_vehicle

    joints = [0.1] * load_vehicle(vehicle).n
    scenario = planned(
        "case3",
        duration=0.2,
        plant={"vehicle": vehicle},
        model={"vehicle": vehicle},
        controller={"law": "hybrid_computed_torque", "mixer": "priority"},
        reference={
            "base": {"kind": "hover", "position": [0.0, 0.0, 2.0]},
            "joints": joints,
        },
        environment={"ground": False},
    )
    assert_equal_to_the_bit(scenario)


ENDINGS = {
    "diverged": {"initial": {"velocity": [1e5, 0.0, 0.0]}},
    "ground": {"initial": {"position": [0.0, 0.0, 0.35], "velocity": [0.0, 0.0, -8.0]}},
}


@pytest.mark.parametrize("status", sorted(ENDINGS))
def test_an_episode_that_ends_early_ends_at_the_same_instant(status):
    log, flown = assert_equal_to_the_bit(
        planned("case2", duration=1.0, **ENDINGS[status])
    )
    assert log.status == status
    assert float(flown.carry.alive) == 0.0
    assert float(flown.carry.ticks) / 200 == log.info["end_time"] < 1.0


def test_a_joint_past_its_limit_ends_the_episode_at_the_same_instant():
    base = planned(
        "case2",
        duration=1.0,
        initial={"joints": [0.15, 0.0], "joint_rates": [4.0, 0.0]},
    )
    vehicle = base.plant.vehicle
    links = [
        dataclasses.replace(
            k, joint=dataclasses.replace(k.joint, lower=-0.2, upper=0.2)
        )
        for k in vehicle.links
    ]
    world = dataclasses.replace(
        base.plant, vehicle=dataclasses.replace(vehicle, links=tuple(links))
    )
    log, flown = assert_equal_to_the_bit(dataclasses.replace(base, plant=world))
    assert log.status == "joint_limit"
    assert float(flown.carry.ticks) / 200 == log.info["end_time"] < 0.1


def test_an_episode_that_has_ended_keeps_the_state_it_ended_in():
    shorter, longer = (
        planned("case2", duration=seconds, **ENDINGS["ground"])
        for seconds in (0.5, 1.0)
    )
    ends = [fly(one).carry for one in (shorter, longer)]
    assert float(ends[0].alive) == 0.0
    assert float(ends[0].agent.state.position.z) > -0.5
    assert leaves(ends[0]) == leaves(ends[1])


def test_turbulence_starts_from_the_two_steps_before_the_first():
    scenario = planned("case3_wind", environment__wind=TURBULENT, seed=17, episode=4)
    first, second = (
        Vec3(*normal(17, 4, 1, 2**32 - back, 3).tolist()) for back in (1, 2)
    )
    wanted = dryden.start(first, second, 0.005, par=scenario.wind.turbulence)
    assert first_loop_state(scenario).memories == (wanted,)


def test_the_reference_in_python_is_machine_code_to_the_bit():
    scenario = planned("everything", duration=0.5)
    machine, python = fly(scenario), fly(scenario, python=True)
    assert machine.rows.tobytes() == python.rows.tobytes()
    assert leaves(machine.carry) == leaves(python.carry)


def lanes_of(scenario, lanes):
    """Carry after the flight of ten lanes with initial heights of their own."""
    inputs = episode_inputs(scenario)
    traced = EpisodeCode(scenario, commands=False, effort=0)
    carry = np.repeat(
        np.array(leaves(first_loop_state(scenario)), dtype=float)[:, None], 10, axis=1
    )
    carry[4] += 0.05 * np.arange(10)
    rows = np.column_stack(
        [inputs.times, np.array(inputs.held_leaves).reshape(scenario.steps, -1)]
    )
    return Kernel(traced.loop, lanes).run(carry, np.zeros((0, 10)), rows, seed=5)[0]


def test_every_width_gives_the_same_bits():
    scenario = planned(
        "case3_wind", duration=0.3, sensors=NOISE, environment__wind=TURBULENT
    )
    flights = [lanes_of(scenario, Lanes(width)) for width in (1, 8)]
    assert np.isfinite(flights[0]).all()
    assert all(flight.tobytes() == flights[0].tobytes() for flight in flights[1:])


def test_every_width_of_single_precision_gives_the_same_bits():
    scenario = planned("case2_gust", duration=0.3, sensors=NOISE)
    flights = [lanes_of(scenario, Lanes(width, single=True)) for width in (4, 16)]
    assert np.isfinite(flights[0]).all()
    assert flights[1].tobytes() == flights[0].tobytes()


def test_single_precision_stays_near_double():
    """Without noise a stabilised flight forgets rounding: 2 s end within 1e-4 of the
    flight in double.
    """
    scenario = planned("case2_gust", duration=2.0)
    double, single = (
        lanes_of(scenario, Lanes(8)),
        lanes_of(scenario, Lanes(16, single=True)),
    )
    assert np.max(np.abs(double[2:9] - single[2:9])) < 1e-4


def test_the_seed_and_the_episode_both_change_the_noise():
    scenario = planned("case2", duration=0.1, sensors=NOISE, seed=1)
    flights = [
        fly(one).rows
        for one in (
            scenario,
            dataclasses.replace(scenario, seed=2),
            dataclasses.replace(scenario, episode=1),
        )
    ]
    assert not np.array_equal(flights[0], flights[1])
    assert not np.array_equal(flights[0], flights[2])
