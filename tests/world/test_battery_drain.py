"""Charge and voltage after a control period, by the battery's own law of discharge."""

import dataclasses

import pytest

import skyarm
from skyarm.dynamics.actuators import speeds_after
from skyarm.scenario.scenario_record import first_state
from skyarm.vehicle.battery import Battery, CellCurve
from skyarm.world.battery_drain import BatteryDrain


def test_a_period_takes_charge_and_leaves_the_voltage_of_the_charge_before():
    scenario = skyarm.load_scenario("case1")
    rotors = skyarm.load_vehicle("hummingbird_arm2_rotors").rotors
    cell = CellCurve(charge=(0.0, 0.5, 1.0), voltage=(3.3, 3.8, 4.2))
    battery = Battery(
        cells=3,
        capacity=1.0,
        resistance=0.05,
        open_circuit=cell,
        reference_voltage=12.6,
        charge=0.6,
    )
    drain = BatteryDrain(battery=battery, rotors=rotors)
    state = dataclasses.replace(first_state(scenario), rotor_speeds=(500.0,) * 4)
    power = battery.power(rotors, (500.0,) * 4)
    charge, voltage = drain.supply((0.6, 12.0), 0.01, state, (500.0,) * 4)
    idle = battery.open_circuit_voltage(0.6)
    assert voltage * (idle - voltage) / 0.05 == pytest.approx(power, rel=1e-9)
    assert 0.6 - charge == pytest.approx(power / voltage * 0.01 / 3600.0, rel=1e-9)


@pytest.mark.parametrize("supply", [0.8, 1.135])
def test_in_an_open_loop_a_reversible_rotor_keeps_its_highest_speed_both_ways(supply):
    cell = CellCurve(charge=(0.0, 1.0), voltage=(3.3, 4.2))
    battery = Battery(
        cells=4,
        capacity=1.0,
        resistance=0.05,
        open_circuit=cell,
        reference_voltage=14.8,
        charge=1.0,
        esc="open",
    )
    rotors = skyarm.load_vehicle("hummingbird_arm2_rotors").rotors
    rotors = tuple(dataclasses.replace(each, reversible=True) for each in rotors)
    drain, highest = BatteryDrain(battery=battery, rotors=rotors), rotors[0].max_speed
    sent = drain.rotor_commands(
        (1.0, 14.8 * supply), rotors, (highest, -highest, 300.0, -300.0)
    )
    turned = speeds_after(rotors, (0.0,) * 4, sent, 10.0)
    top = min(highest, highest * supply)
    assert turned == pytest.approx((top, -top, 300.0 * supply, -300.0 * supply))
