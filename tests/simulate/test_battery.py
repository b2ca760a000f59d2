"""Batteries: voltage under a load in closed form, charge against SciPy, sag and an
empty one in flight, time aloft.
"""

from __future__ import annotations

import dataclasses
import math
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

from skyarm.dynamics.actuators import speeds_after
from skyarm.dynamics.state import example_state
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_file import scenario_from
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate import run
from skyarm.simulate.batch import Batch
from skyarm.simulate.loop import run_in_python
from skyarm.simulate.session import Session
from skyarm.studies.assess.endurance import hover_time
from skyarm.vehicle.battery import Battery, CellCurve
from skyarm.vehicle.check import VehicleError
from skyarm.vehicle.thrust_table import ThrustTable
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.world.battery_drain import BatteryDrain

DATA = Path(__file__).parents[1] / "data"
QUAD = Path(__file__).parents[2] / "examples" / "servo_quad.toml"
CHARGE, CELL = (0.0, 0.1, 0.5, 0.9, 1.0), (3.3, 3.6, 3.8, 4.05, 4.2)
BATTERY = Battery(
    cells=4,
    capacity=2.0,
    resistance=0.05,
    open_circuit=CellCurve(charge=CHARGE, voltage=CELL),
    reference_voltage=14.8,
    standing_power=5.0,
)


def hovering(
    battery: Battery = BATTERY, duration: float = 0.5, **fields: Any
) -> Scenario:
    """The servo arm in hover on a battery."""
    document = tomllib.loads((DATA / "servo_flight.toml").read_text())
    document["reference"] = {"base": {"kind": "hover", "position": [0.0, 0.0, 2.0]}}
    document["controller"] = {"preset": "paper_pd"}
    found = scenario_from(document, DATA, {"duration": duration})
    vehicle = dataclasses.replace(found.plant.vehicle, battery=battery)
    return dataclasses.replace(
        found, plant=dataclasses.replace(found.plant, vehicle=vehicle), **fields
    )


def test_voltage_under_a_load_is_ohms_law():
    idle = 4 * float(PchipInterpolator(CHARGE, CELL)(0.7))
    assert BATTERY.open_circuit_voltage(0.7) == pytest.approx(idle, rel=1e-12)
    voltage = BATTERY.voltage(0.7, 300.0)
    assert voltage == pytest.approx(idle - 0.05 * 300.0 / voltage, rel=1e-12)
    assert voltage > 0.5 * idle, (
        "of the two solutions the one that is near the voltage without a load"
    )
    assert BATTERY.voltage(0.7, 1e6) == 0.5 * idle, "more than it can give"
    assert BATTERY.voltage(0.0, 10.0) == 0.0


def test_charge_falls_as_scipy_says():
    curve = PchipInterpolator(CHARGE, CELL)

    def falls(_t: float, q: Any) -> Any:
        idle = 4 * curve(q)
        return (
            -300.0 / (0.5 * (idle + np.sqrt(idle**2 - 4 * 0.05 * 300.0))) / 3600.0 / 2.0
        )

    exact = solve_ivp(falls, (0.0, 200.0), [1.0], rtol=1e-10, atol=1e-12).y[0, -1]
    charge = 1.0
    for _ in range(4000):
        charge = BATTERY.discharge(charge, 300.0, 0.05)
    assert exact < 0.5
    assert charge == pytest.approx(float(exact), abs=2e-5)
    assert BATTERY.discharge(1e-9, 300.0, 0.05) == 0.0
    assert BATTERY.discharge(0.0, 300.0, 0.05) == 0.0


def test_power_is_the_tables_current_or_the_drag_torques():
    rotor = load_vehicle(DATA / "servo_arm.toml").rotors[0]
    mechanical = 8e-6 * 0.016 * 600.0**3
    assert BATTERY.power((rotor, rotor), (600.0, 0.0)) == pytest.approx(
        5.0 + mechanical / 0.7
    )
    speeds = (300.0, 600.0, 900.0)
    table = ThrustTable(speed=speeds, thrust=(0.7, 2.9, 6.5), current=(1.0, 4.5, 12.0))
    measured = dataclasses.replace(rotor, table=table)
    assert BATTERY.power((measured,), (600.0,)) == pytest.approx(5.0 + 4.5 * 14.8)


def implicit(pack, charge, rotors, speeds, commands, seconds=0.005):
    """Voltage by SciPy at which the pack feeds the speeds that rotors reach with it,
    and their power there.
    """
    idle = float(4 * PchipInterpolator(CHARGE, CELL)(charge))

    def power(voltage):
        supply, total = voltage / pack.reference_voltage, 5.0
        for rotor, w, command in zip(rotors, speeds, commands, strict=True):
            asked = (
                min(command, rotor.max_speed) * supply
                if pack.esc == "open"
                else min(command, 1100.0 * supply)
            )
            target = min(asked, rotor.max_speed)
            lag = rotor.time_constant_up if target > w else rotor.time_constant_down
            total += (
                8e-6
                * 0.016
                * (target + (w - target) * math.exp(-seconds / lag)) ** 3
                / 0.7
            )
        return total

    surplus = lambda v: v * (idle - v) - pack.resistance * power(v)  # noqa: E731
    found = (
        brentq(surplus, 0.5 * idle, idle, xtol=1e-13)
        if surplus(0.5 * idle) > 0.0
        else 0.5 * idle
    )
    return found, power(found)


@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
def test_the_loops_charge_is_that_of_its_log(plant):
    scenario = hovering(kind=plant, duration=0.2)
    flight = Session(scenario, machine_code=False)
    while flight.step():
        pass
    log, vehicle = flight.log, scenario.plant.vehicle
    charge, voltage = flight.now.memories[-1]
    before = 1.0
    for k, speeds in enumerate(log.rotor_speeds):
        # commands that were in force before the period's own
        commands = log.rotor_commands[max(k - 1, 0)] if k else log.rotor_speeds[0]
        reached, power = implicit(BATTERY, before, vehicle.rotors, speeds, commands)
        assert log.battery_voltage[k, 0] == pytest.approx(reached, rel=1e-10)
        before -= power / reached * 0.005 / 3600.0 / 2.0
        assert log.battery_charge[k, 0] == pytest.approx(before, rel=1e-12)
    assert (charge, voltage) == (log.battery_charge[-1, 0], log.battery_voltage[-1, 0])
    assert 0.999 < charge < 1.0


@pytest.mark.parametrize(
    ("esc", "supply", "reached"),
    [
        ("governed", 0.9, (0.5, 0.9, 0.9)),
        ("open", 0.9, (0.45, 0.81, 0.9)),
        # above the reference voltage: faster at the same throttle, never faster than
        # the rotor's data goes
        ("governed", 1.2, (0.5, 0.9, 1.0)),
        ("open", 1.2, (0.6, 1.0, 1.0)),
    ],
)
def test_the_supply_moves_speeds_up_to_the_highest_of_the_data(esc, supply, reached):
    bare = load_vehicle("hummingbird")
    vehicle, top = (
        dataclasses.replace(bare, battery=dataclasses.replace(BATTERY, esc=esc)),
        bare.rotors[0].max_speed,
    )
    for share, wanted in zip((0.5, 0.9, 1.3), reached, strict=True):
        drain = BatteryDrain(battery=vehicle.battery, rotors=vehicle.rotors)
        memory = 1.0, supply * vehicle.battery.reference_voltage
        commands = drain.rotor_commands(memory, vehicle.rotors, (share * top,) * 4)
        speeds = speeds_after(vehicle.rotors, (0.0,) * 4, commands, 10.0)
        assert speeds == pytest.approx((wanted * top,) * 4, rel=1e-12)


def test_the_supply_bounds_a_rotor_that_turns_backwards():
    drain = BatteryDrain(battery=BATTERY, rotors=())
    rotors = [
        dataclasses.replace(
            load_vehicle("hummingbird").rotors[0], reversible=True, max_speed=1000.0
        )
    ] * 3
    speeds = drain.rotor_commands((1.0, 0.6 * 14.8), rotors, (-1000.0, -500.0, 700.0))
    assert speeds == pytest.approx([-600.0, -500.0, 600.0], rel=1e-12)


def test_sag_bounds_a_governed_rotor_and_slows_an_open_one():
    """Hover takes most of the highest speed: at 11 V of 14.8 V a rotor cannot turn that
    fast.
    """
    thirsty = dataclasses.replace(BATTERY, reference_voltage=40.0)
    scenario = hovering(thirsty)
    top = 1100.0 * BATTERY.voltage(1.0, 250.0) / 40.0
    log = run(scenario)
    assert log.rotor_commands[-1].max() > log.rotor_speeds[-1].max()
    assert log.rotor_speeds[-1].max() < 1.05 * top
    assert log.position[-1, 2] < 1.9, "it sinks"
    open_loop = run(
        hovering(
            dataclasses.replace(BATTERY, esc="open", reference_voltage=18.0),
            duration=0.1,
        )
    )
    ratio = BATTERY.voltage(1.0, 180.0) / 18.0
    assert (
        open_loop.rotor_speeds[-1].mean() < 0.97 * open_loop.rotor_commands[:-1].mean()
    )
    assert (
        open_loop.rotor_speeds[-1].mean()
        > 0.97 * ratio * open_loop.rotor_commands[:-1].mean()
    )
    assert run(hovering(duration=0.1)).position[-1, 2] == pytest.approx(
        2.0, abs=0.01
    ), "and a good one carries it"


@pytest.mark.parametrize("seed", range(6))
def test_an_overloaded_pack_settles_where_its_current_times_its_voltage_is_the_load(
    seed,
):
    """Largest root of V (V_0 - V) / R = P(V) by SciPy, with rotors that turn as fast as
    V allows, or as commanded.
    """
    rng = np.random.default_rng(seed)
    esc = ("governed", "open")[seed % 2]
    numbers = {
        "resistance": rng.uniform(0.3, 1.5),
        "reference_voltage": rng.uniform(11.0, 16.0),
        "esc": esc,
    }
    pack = dataclasses.replace(BATTERY, **numbers)
    rotors = load_vehicle(DATA / "servo_arm.toml").rotors
    commands = tuple((rng.uniform(0.3, 1.2, len(rotors)) * 1100.0).tolist())
    drain, memory, speeds = (
        BatteryDrain(battery=pack, rotors=rotors),
        (0.8, 14.0),
        (0.0,) * len(rotors),
    )
    still = example_state(0, len(rotors))
    for _ in range(120):
        before = memory[0]
        memory = drain.supply(
            memory, 0.005, dataclasses.replace(still, rotor_speeds=speeds), commands
        )
        speeds = speeds_after(
            rotors, speeds, drain.rotor_commands(memory, rotors, commands), 0.005
        )
    idle = float(pack.open_circuit_voltage(before))

    def surplus(voltage):
        supply = voltage / pack.reference_voltage
        turning = [
            (
                min(each, 1100.0) * supply
                if seed % 2
                else np.minimum(each, 1100.0 * supply)
            )
            for each in commands
        ]
        load = 5.0 + sum(8e-6 * 0.016 * w**3 / 0.7 for w in turning)
        return voltage * (idle - voltage) / pack.resistance - load

    grid = np.linspace(0.05 * idle, idle, 4001)
    signs = np.sign(surplus(grid))
    last = int(np.flatnonzero(signs[:-1] != signs[1:])[-1])
    right = brentq(surplus, grid[last], grid[last + 1])
    assert memory[1] == pytest.approx(right, rel=2e-3)
    current = (before - memory[0]) * pack.capacity * 3600.0 / 0.005
    assert current == pytest.approx((idle - right) / pack.resistance, rel=1e-2)
    assert current * memory[1] <= idle**2 / 4.0 / pack.resistance * (1.0 + 1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_a_pack_near_its_peak_comes_to_rest_as_its_rotors_would(seed):
    """Against SciPy's dw/dt = (V w_max / V_ref - w) / tau at V (V_0 - V) = R P(w),
    which rests at a drawn V / V_0.
    """
    rng = np.random.default_rng(seed)
    share, resistance = rng.uniform(0.515, 0.6), rng.uniform(0.05, 0.5)
    rotors = load_vehicle(DATA / "servo_arm.toml").rotors
    rotor, count = rotors[0], len(rotors)
    drag = count * 8e-6 * 0.016 / 0.7
    idle = float(BATTERY.open_circuit_voltage(0.8))
    rest = ((idle**2 * share * (1.0 - share) / resistance - 5.0) / drag) ** (1.0 / 3.0)
    reference = 1100.0 * share * idle / rest
    pack = dataclasses.replace(
        BATTERY,
        resistance=resistance,
        esc=("governed", "open")[seed % 2],
        reference_voltage=reference,
    )
    drain, still, commands = (
        BatteryDrain(battery=pack, rotors=rotors),
        example_state(0, count),
        (1100.0,) * count,
    )

    def voltage(w):
        return 0.5 * (
            idle + math.sqrt(max(idle**2 - 4.0 * resistance * (5.0 + drag * w**3), 0.0))
        )

    def faster(_t, w):
        target = min(1100.0 * voltage(w[0]) / reference, 1100.0)
        return [
            (target - w[0])
            / (rotor.time_constant_up if target > w[0] else rotor.time_constant_down)
        ]

    start, times = 0.6 * rest, 0.005 * np.arange(1, 81)
    exact = solve_ivp(
        faster, (0.0, 0.4), [start], rtol=1e-9, atol=1e-9, t_eval=times, max_step=1e-3
    ).y[0]
    speeds, volts, found, before = (start,) * count, 14.0, [], []
    for _ in times:
        _, volts = drain.supply(
            (0.8, volts),
            0.005,
            dataclasses.replace(still, rotor_speeds=speeds),
            commands,
        )
        speeds = speeds_after(
            rotors, speeds, drain.rotor_commands((0.8, volts), rotors, commands), 0.005
        )
        found.append(speeds[0])
        before.append(volts)
    assert found == pytest.approx(exact, rel=0.04)
    assert before[-1] == pytest.approx(share * idle, rel=1e-6)
    assert np.abs(np.diff(before[-20:])).max() < 1e-4, "it does not alternate"


@pytest.mark.parametrize(
    ("resistance", "speed"),
    [(0.5, 0.0), (0.6, 0.0), (0.7, 0.0), (0.6, 450.0), (1.5, 200.0), (0.8, 300.0)],
)
def test_a_step_of_the_throttle_is_no_overload_before_the_rotors_follow(
    resistance, speed
):
    """One period of full throttle against SciPy's root of V (V_0 - V) = R P(V), at the
    speeds at the period's end.
    """
    bare, dt = load_vehicle(QUAD), 0.004
    pack = dataclasses.replace(bare.battery, resistance=resistance)
    rotor, count = bare.rotors[0], len(bare.rotors)
    idle = 4.0 * 4.2

    def surplus(voltage):
        target = rotor.max_speed * min(voltage / 14.8, 1.0)
        lag = rotor.time_constant_up if target > speed else rotor.time_constant_down
        turning = target + (speed - target) * math.exp(-dt / lag)
        power = 6.0 + count * float(rotor.table.current_at(turning)) * 14.8
        return voltage * (idle - voltage) - resistance * power

    right = brentq(surplus, 0.5 * idle, idle, xtol=1e-13)
    drain, still = (
        BatteryDrain(battery=pack, rotors=bare.rotors),
        example_state(0, count),
    )
    state = dataclasses.replace(still, rotor_speeds=(speed,) * count)
    charge, voltage = drain.supply((1.0, idle), dt, state, (rotor.max_speed,) * count)
    assert voltage == pytest.approx(right, rel=1e-9)
    drawn = (1.0 - charge) * pack.capacity * 3600.0 / dt
    assert drawn == pytest.approx((idle - right) / resistance, rel=1e-6)


def test_an_overload_stays_until_the_throttle_ends_it():
    """Full throttle for 0.2 s: the voltage falls once, below half; at rest again it is
    back in one period.
    """
    bare, dt = load_vehicle(QUAD), 0.001
    pack, top = (
        dataclasses.replace(bare.battery, resistance=1.2),
        float(bare.rotors[0].max_speed),
    )
    drain, still = BatteryDrain(battery=pack, rotors=bare.rotors), example_state(0, 4)
    memory, speeds, volts = (1.0, 16.8), (0.0,) * 4, []
    for command in [top] * 200 + [0.0]:
        state, commands = (
            dataclasses.replace(still, rotor_speeds=speeds),
            (command,) * 4,
        )
        memory = drain.supply(memory, dt, state, commands)
        speeds = speeds_after(
            bare.rotors, speeds, drain.rotor_commands(memory, bare.rotors, commands), dt
        )
        volts.append(memory[1])
    assert volts[10] > 8.4 > volts[50]
    assert np.all(np.diff(volts[:200]) < 1e-9), "it does not alternate"
    assert volts[-1] > 8.4


def test_a_load_beyond_the_peak_draws_the_limit():
    idle = float(BATTERY.open_circuit_voltage(0.7))
    after = BATTERY.discharge(0.7, 1e6, 1.0)
    assert (0.7 - after) * 2.0 * 3600.0 == pytest.approx(idle / (2.0 * 0.05), rel=1e-9)


def test_an_empty_battery_lets_it_fall_on_every_engine():
    nearly = dataclasses.replace(BATTERY, charge=1e-3, capacity=0.5)
    scenario = hovering(nearly, duration=2.0)
    log = run(scenario)
    assert log.status == "ground"
    empty = int(np.argmax(log.battery_charge[:, 0] == 0.0)) + 1
    assert 0 < empty < len(log.time) - 1
    assert log.position[empty, 2] > 1.9
    assert np.all(np.diff(log.rotor_speeds[empty + 2 :, 0]) < 0.0)
    assert np.array_equal(log.rotor_speeds, run_in_python(scenario).rotor_speeds)
    theirs = run(dataclasses.replace(scenario, kind="mujoco"))
    assert theirs.status == "ground"
    assert theirs.time[-1] == pytest.approx(log.time[-1], abs=0.011)


def test_its_numbers_vary_in_a_batch():
    path = "plant.vehicle.battery.charge"
    scenario = hovering(dataclasses.replace(BATTERY, capacity=0.5), duration=1.0)
    found = Batch(scenario, (path,)).fly({path: np.array([1.0, 1e-3])})
    assert found.status.tolist() == ["completed", "ground"]
    single = run(with_numbers(scenario, {path: 1e-3}))
    assert found.end_time[1] == pytest.approx(single.time[-1], abs=0.006)


def test_time_aloft_is_the_integral_and_ends_where_the_voltage_does():
    vehicle = hovering().plant.vehicle
    flat = CellCurve(charge=(0.0, 1.0), voltage=(3.7, 3.7 + 1e-9))
    simple = dataclasses.replace(BATTERY, open_circuit=flat, resistance=0.0)
    found = hover_time(dataclasses.replace(vehicle, battery=simple))
    assert found.seconds == pytest.approx(3600.0 * 2.0 * 14.8 / found.power, rel=1e-6)
    assert found.charge == pytest.approx(0.0, abs=1e-9)
    share = math.sqrt(vehicle.mass * 9.81 / 6.0 / 8e-6) / 1100.0
    early = hover_time(
        dataclasses.replace(
            vehicle,
            battery=dataclasses.replace(BATTERY, reference_voltage=14.6 / share),
        )
    )
    assert early.charge > 0.1
    assert early.voltage == pytest.approx(14.6, abs=0.05)
    assert early.seconds < hover_time(vehicle).seconds
    heavy = dataclasses.replace(BATTERY, reference_voltage=60.0)
    with pytest.raises(
        VehicleError, match=r"battery\.charge = 1: must be enough for a level hover"
    ):
        hover_time(dataclasses.replace(vehicle, battery=heavy))
    with pytest.raises(VehicleError, match=r"battery = \(missing\)"):
        hover_time(load_vehicle(DATA / "servo_arm.toml"))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("cells = 0", r"battery\.cells = 0: must be at least 1"),
        ("capacity = -1.0", r"battery\.capacity = -1\.0: must be above 0"),
        ("charge = 1.5", r"battery\.charge = 1\.5: must be at most 1"),
        ("efficiency = 2.0", r"battery\.efficiency = 2\.0: must be at most 1"),
        ('esc = "fast"', r"battery\.esc = 'fast': must be one of governed, open"),
        (
            "open_circuit = { charge = [0, 1.0], voltage = [4.0, 3.0] }",
            r"voltage\[1\] = 3\.0: must be above the one",
        ),
        (
            "volts = 3.0",
            r"battery\.volts = 3\.0: unknown field; allowed: cells, capacity",
        ),
    ],
)
def test_a_battery_that_is_none_is_refused_in_one_line(tmp_path, change, words):
    rows = {
        "cells": "cells = 4",
        "capacity": "capacity = 2.0",
        "resistance": "resistance = 0.05",
        "reference_voltage": "reference_voltage = 14.8",
        "open_circuit": "open_circuit = { charge = [0.0, 1.0], voltage = [3.3, 4.2] }",
    }
    rows[change.split(" ", maxsplit=1)[0]] = change
    text = (
        (DATA / "servo_arm.toml")
        .read_text()
        .replace(
            "[rotor_defaults]",
            "\n".join(["[battery]", *rows.values(), "", "[rotor_defaults]"]),
        )
    )
    (tmp_path / "v.toml").write_text(text)
    with pytest.raises(VehicleError, match=words) as found:
        load_vehicle(tmp_path / "v.toml")
    assert "\n" not in str(found.value)
