"""The traced loop against a slow one written here: records of Python floats, no tracer,
no tables of rows.
"""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.algebra.scalars.philox import normal
from skyarm.dynamics import State
from skyarm.dynamics.actuators import Command
from skyarm.plant.rigid_body import coupled_rk4
from skyarm.plant.surroundings import Surroundings
from skyarm.records.leaves import leaves, rebuild
from skyarm.scenario.scenario_file import load_scenario, scenario_from
from skyarm.scenario.scenario_record import first_state
from skyarm.sensing.measurement import measure
from skyarm.simulate import Log, Scenario, run
from support.flights import document
from support.one_vehicle import acceleration, after_step
from support.worlds import wind as blown

NOISY = document(
    "case3_wind",
    reference__base__start=0.2,
    sensors={
        "position": 0.003,
        "velocity": 0.02,
        "attitude": 0.004,
        "rate": 0.03,
        "joints": 0.002,
        "rotor_speeds": 1.0,
    },
    delays={"measurement": 0.015, "command": 0.008},
    seed=17,
    episode=4,
)


def _at(record: Any, k: int) -> Any:
    """Row k of a record of arrays; what is structure stays structure."""
    return rebuild(
        record,
        iter(
            [
                float(np.ravel(leaf)[k] if np.ndim(leaf) else leaf)
                for leaf in leaves(record)
            ]
        ),
    )


def slow_loop(scenario: Scenario) -> tuple[list[State], list[Command]]:
    """Fly with plain floats: 200 Hz control, 50 Hz reference, RK4 over each stretch of
    one command.
    """
    ticks = np.arange(scenario.steps)
    held = [scenario.reference.at((k - k % 4) / 200) for k in range(scenario.steps)]
    blowing = blown(scenario.wind, ticks / 200)
    world, controller = scenario.plant, scenario.controller
    n, rotors = world.vehicle.n, len(world.vehicle.rotors)
    noisy = bool(leaves(scenario.noise))
    draws = (
        normal(scenario.seed, scenario.episode, 0, ticks, 15 + 2 * n + rotors)
        if noisy
        else None
    )
    late_readings = round(scenario.delays.measurement * 200)
    late_steps = round(scenario.delays.command * 1000)
    x, memory = first_state(scenario), controller.memory
    standing = Command(rotor_speeds=x.rotor_speeds, efforts=(0.0,) * n)
    states, commands, readings = [], [], []
    # which command acts in each millisecond; the arm hangs, so nothing has to hold it
    # before the first one
    acting = [standing] * late_steps
    for k in range(scenario.steps):
        wind = Surroundings(components=(_at(blowing, k),), memories=((),))
        before = acting[5 * k - 1] if k and 5 * k - 1 < len(acting) else standing
        base, _ = acceleration(world, x, Command(efforts=before.efforts), wind)
        noise = (
            tuple(float(d) for d in draws[k])
            if draws is not None
            else (0,) * (15 + 2 * n + rotors)
        )
        readings.append(measure(scenario.noise, k / 200, x, Vec3(*base.linear), noise))
        reading = readings[max(0, k - late_readings)]
        memory, command = controller.law(
            memory, reading, held[k], 0.005, par=controller.par
        )
        states.append(x)
        commands.append(command)
        acting += [command] * 5
        window = acting[5 * k : 5 * k + 5]
        change = late_steps % 5
        if change:
            x, _ = after_step(coupled_rk4, world, x, window[0], wind, change / 1000)
            x, _ = after_step(
                coupled_rk4, world, x, window[-1], wind, 0.005 - change / 1000
            )
        else:
            x, _ = after_step(coupled_rk4, world, x, window[0], wind, 0.005)
    return states, commands


def _logged(log: Log, k: int) -> tuple[float, ...]:
    parts = (
        log.position,
        log.quaternion,
        log.velocity,
        log.rate,
        log.joints,
        log.joint_rates,
        log.rotor_speeds,
    )
    return tuple(float(v) for part in parts for v in part[k])


@pytest.mark.parametrize("preset", ["paper_ct", "paper_pd"])
def test_the_loop_equals_a_slow_loop_of_floats_bit_for_bit(preset: str) -> None:
    quick = document("case3_wind", reference__base__start=0.2, duration=0.5)
    quick["reference"]["joints"][0]["start"] = 0.1
    scenario = scenario_from(quick, replaced={"controller": preset})
    log = run(scenario)
    states, commands = slow_loop(scenario)
    assert log.time.size == len(states) == 100
    for k, (state, command) in enumerate(zip(states, commands, strict=True)):
        assert _logged(log, k) == tuple(float(v) for v in leaves(state)), k
        assert tuple(log.rotor_commands[k]) == tuple(
            float(v) for v in command.rotor_speeds
        )
        assert tuple(log.efforts[k]) == tuple(float(v) for v in command.efforts)


def test_noise_and_delays_act_in_the_slow_loop_the_same_bit_for_bit() -> None:
    scenario = scenario_from(NOISY, replaced={"duration": 0.5})
    log = run(scenario)
    states, _ = slow_loop(scenario)
    assert all(
        _logged(log, k) == tuple(float(v) for v in leaves(state))
        for k, state in enumerate(states)
    )
    assert (
        np.abs(
            log.position - run(load_scenario("case3_wind", duration=0.5)).position
        ).max()
        > 1e-3
    ), "noise was flown"


def _same(a: Log, b: Log) -> bool:
    return all(
        np.array_equal(a.arrays()[name], b.arrays()[name]) for name in a.arrays()
    )


def test_two_runs_are_equal_to_the_bit() -> None:
    scenario = scenario_from(NOISY, replaced={"duration": 1.0})
    first, second = run(scenario), run(scenario)
    assert _same(first, second)
    assert first.info == second.info


def test_a_run_in_another_process_is_equal_to_the_bit(tmp_path: Any) -> None:
    here = run(load_scenario("case3_wind", duration=1.0, seed=9))
    program = (
        "import sys; from skyarm import load_scenario, run; "
        "run(load_scenario('case3_wind', duration=1.0, seed=9)).save_npz(sys.argv[1])"
    )
    subprocess.run(
        [sys.executable, "-c", program, str(tmp_path / "log.npz")],
        check=True,
        timeout=120,
    )
    assert _same(here, Log.load_npz(tmp_path / "log.npz"))


@pytest.mark.parametrize("changed", [{"seed": 18}, {"episode": 5}])
def test_another_seed_or_episode_draws_other_noise(changed: dict[str, int]) -> None:
    scenario = scenario_from(NOISY, replaced={"duration": 0.25})
    first, second = run(scenario), run(dataclasses.replace(scenario, **changed))
    assert not np.array_equal(first.measured_position, second.measured_position)
    assert not np.array_equal(first.position, second.position)


def test_sensor_noise_has_the_stated_deviation_and_no_bias() -> None:
    scenario = scenario_from(
        document("case1", sensors={"position": 0.003, "joints": 0.002}),
        replaced={"duration": 5.0},
    )
    log = run(scenario)
    noise, joints = (
        log.measured_position - log.position,
        log.measured_joints - log.joints,
    )
    # 1000 draws an axis: the deviation is known to 2.2 %, the mean to 0.032 sigma; four
    # of these are allowed
    assert noise.std(axis=0) == pytest.approx(0.003, rel=0.09)
    assert joints.std(axis=0) == pytest.approx(0.002, rel=0.09)
    assert np.abs(noise.mean(axis=0)).max() < 4 * 0.032 * 0.003
    # white: neighbours and axes do not correlate
    assert abs(np.corrcoef(noise[1:, 0], noise[:-1, 0])[0, 1]) < 0.13
    assert abs(np.corrcoef(noise[:, 0], noise[:, 1])[0, 1]) < 0.13


def test_perfect_sensors_measure_the_state() -> None:
    log = run(load_scenario("case2", duration=0.5))
    assert np.array_equal(log.measured_position, log.position)
    assert np.array_equal(log.measured_joints, log.joints)


def test_the_reference_is_held_at_its_own_rate() -> None:
    quick = document("case3", reference__base__start=0.1, duration=0.5)
    quick["reference"]["joints"][0]["start"] = 0.1
    log = run(scenario_from(quick))
    ticks = np.arange(log.time.size)
    for held, free in (
        (log.position_held, log.position_reference),
        (log.joints_held, log.joints_reference),
    ):
        assert np.array_equal(held, free[ticks - ticks % 4])
    assert not np.array_equal(log.position_held, log.position_reference)


@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
def test_a_gust_starts_and_stops_on_its_tick(plant: str) -> None:
    wind = {
        "mode": "force_wind",
        "gust": {"force": [2.0, 0.0, 0.0], "start": 0.15, "duration": 0.1},
    }
    gusty = run(
        scenario_from(
            document("case1", duration=0.4, environment={"wind": wind}),
            replaced={"plant": plant},
        )
    )
    calm = run(
        scenario_from(document("case1", duration=0.4), replaced={"plant": plant})
    )
    blowing = np.flatnonzero(gusty.wind_force[:, 0])
    assert (gusty.time[blowing[0]], gusty.time[blowing[-1]]) == (0.15, 0.245)
    assert blowing.size == 20
    # the state at 0.15 s is the last that the gust has not touched
    assert np.abs(gusty.velocity[:31] - calm.velocity[:31]).max() < 1e-12
    # 5 ms of 2 N at the base origin; rotor drag and the tilt it causes stay below 1 %
    # of that
    push = np.array([2.0, *[0.0] * 7])
    vehicle = skyarm.load_vehicle("hummingbird_arm2_rotors")
    level = ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0], np.zeros(8))
    pushed = skyarm.forward_dynamics(vehicle, *level, push) - skyarm.forward_dynamics(
        vehicle, *level, np.zeros(8)
    )
    assert gusty.velocity[31, 0] - calm.velocity[31, 0] == pytest.approx(
        0.005 * pushed[0], rel=0.01
    )


def test_control_instants_are_the_nearest_doubles_to_their_decimals() -> None:
    times = run(load_scenario("case1", duration=5.0)).time
    # 23 * 0.005 is 0.11499999999999999 in binary: a gust at 0.115 s would come a tick
    # late
    assert times.tolist() == [float(f"{5 * k}e-3") for k in range(1000)]


def test_progress_is_told_about_a_hundred_times_and_ends_complete() -> None:
    told: list[tuple[int, int]] = []
    run(
        load_scenario("case1", duration=2.0),
        lambda done, total: told.append((done, total)),
    )
    assert told[0] == (0, 400)
    assert told[-1] == (400, 400)
    assert 90 <= len(told) <= 110
