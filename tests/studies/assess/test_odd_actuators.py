"""Numbers of servos, batteries and rotors in other units, and drives and batteries that
a flight asks too much of.
"""

from __future__ import annotations

import dataclasses
import math
import tomllib
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.dynamics.actuators.servo import PositionServo
from skyarm.log.metrics.windows import Windows
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.unlikely_numbers import unlikely_in_vehicle
from skyarm.studies.assess.along_reference import along_reference
from skyarm.studies.assess.data_sheet import sheet, vehicle_facts
from skyarm.studies.assess.endurance import aloft_for, hover_time
from skyarm.studies.assess.endurance import time_aloft as assessed_time
from skyarm.studies.assess.flight_loads import flight_parts
from skyarm.studies.assess.layout import disc_radius, rotor_layout
from skyarm.vehicle.battery import Battery, CellCurve
from skyarm.vehicle.thrust_table import ThrustTable
from skyarm.world import TimedPayload

DATA = Path(__file__).resolve().parents[2] / "data"


@cache
def arm():
    """Two servos on a quadrotor of 2.3 kg, with a battery of four cells."""
    curve = CellCurve(
        charge=(0.0, 0.1, 0.5, 0.9, 1.0), voltage=(3.3, 3.6, 3.8, 4.05, 4.2)
    )
    pack = Battery(
        cells=4,
        capacity=5.0,
        resistance=0.02,
        open_circuit=curve,
        reference_voltage=14.8,
    )
    return dataclasses.replace(
        skyarm.load_vehicle(DATA / "servo_arm.toml"), battery=pack
    )


def with_servo(**fields):
    """The arm whose first servo has other numbers."""
    first = dataclasses.replace(
        arm().drives[0], drive=dataclasses.replace(arm().drives[0].drive, **fields)
    )
    return dataclasses.replace(arm(), drives=(first, *arm().drives[1:]))


def with_battery(**fields):
    return dataclasses.replace(
        arm(), battery=dataclasses.replace(arm().battery, **fields)
    )


def test_the_arm_as_it_is_raises_no_line():
    assert unlikely_in_vehicle(arm()) == ()


SERVOS = [
    ({"voltage": 12000.0}, "voltage = 12000 V: is more than 1000; V, not mV?"),
]


@pytest.mark.parametrize(
    ("fields", "words"), SERVOS, ids=[next(iter(fields)) for fields, _ in SERVOS]
)
def test_a_servo_in_other_units_is_told_of_by_its_field(fields, words):
    (line,) = unlikely_in_vehicle(with_servo(**{"speed_limit": 5.0, **fields}))
    assert line.startswith(f"drives[{arm().drives[0].name}].drive.{words}")


BATTERIES = [
    (lambda b: {"capacity": 1000.0 * b.capacity}, "battery.capacity = "),
    (lambda b: {"resistance": 1000.0 * b.resistance}, "battery.resistance = "),
]


@pytest.mark.parametrize(("fields", "words"), BATTERIES, ids=["mA h", "mohm"])
def test_a_battery_in_other_units_is_told_of_by_its_field(fields, words):
    (line,) = unlikely_in_vehicle(with_battery(**fields(arm().battery)))
    assert line.startswith(words)


def test_a_rotor_s_inertia_is_less_than_the_base_s():
    rotors = [dataclasses.replace(rotor, inertia=600.0) for rotor in arm().rotors]
    (line,) = unlikely_in_vehicle(dataclasses.replace(arm(), rotors=tuple(rotors)))
    assert line.startswith(
        f"rotors[{rotors[0].name}].inertia = 600 kg m^2: is more than 1; kg m^2, not"
    )


def test_one_cause_in_all_rotors_is_one_line_and_a_massless_link_is_named():
    slow = [dataclasses.replace(rotor, time_constant_up=40.0) for rotor in arm().rotors]
    (line,) = unlikely_in_vehicle(dataclasses.replace(arm(), rotors=tuple(slow)))
    assert line.startswith(
        f"rotors[{slow[0].name}].time_constant_up = 40 s: is more than 0.5; s, not ms?"
        " (and"
    )
    links = list(arm().links)
    links[0] = dataclasses.replace(
        links[0], body=dataclasses.replace(links[0].body, mass=0.0)
    )
    (line,) = unlikely_in_vehicle(dataclasses.replace(arm(), links=tuple(links)))
    assert line.startswith(f"links[{links[0].name}].mass = 0 kg: has an inertia of")


def test_a_current_in_milliamperes_is_told_of():
    speeds = (200.0, 400.0, 600.0)
    rotor = arm().rotors[0]
    kf, km = float(rotor.thrust_coefficient), float(rotor.moment_coefficient)
    thrust = tuple(kf * w * w for w in speeds)
    # motors of 70 %
    current = tuple(
        km * f * w / 0.7 / 14.8 for f, w in zip(thrust, speeds, strict=True)
    )

    def lines(factor):
        table = ThrustTable(
            speed=speeds,
            thrust=thrust,
            current=tuple(factor * each for each in current),
        )
        rotors = tuple(dataclasses.replace(each, table=table) for each in arm().rotors)
        return unlikely_in_vehicle(dataclasses.replace(arm(), rotors=rotors))

    assert lines(1.0) == ()
    (line,) = lines(1e4)
    assert line.startswith(f"rotors[{rotor.name}].table.current = ")


def test_a_rotor_that_points_down_is_named():
    rotors = list(arm().rotors)
    down = dataclasses.replace(rotors[0], axis=Vec3(0.0, 0.0, -1.0))
    found = rotor_layout(dataclasses.replace(arm(), rotors=(down, *rotors[1:])), 9.81)
    assert (
        next(each for each in found if each.level == "fault").field
        == f"rotors[{down.name}].axis"
    )


def test_discs_of_staggered_rotors_may_overlap():
    vehicle = skyarm.load_vehicle("hummingbird")
    places = [
        Vec3(0.1, 0.06, 0.06),
        Vec3(-0.1, 0.06, 0.02),
        Vec3(-0.1, -0.06, 0.06),
        Vec3(0.1, -0.06, 0.02),
    ]
    rotors = [
        dataclasses.replace(r, position=p)
        for r, p in zip(vehicle.rotors, places, strict=True)
    ]
    assert disc_radius(
        dataclasses.replace(vehicle, rotors=tuple(rotors))
    ) == pytest.approx(math.hypot(0.1, 0.06))


def test_a_battery_that_holds_no_hover_is_told_what_it_lacks():
    for fields in ({"charge": 0.0}, {"resistance": 20.0}, {"reference_voltage": 60.0}):
        (found,) = assessed_time(with_battery(**fields), 9.81)
        assert found.level == "fault", fields
        assert next(iter(fields)).replace("reference_voltage", "cells") in found.field


def test_the_battery_over_a_flight_is_held_against_its_duration():
    seconds = hover_time(arm()).seconds
    flights = (flown_for(share * seconds) for share in (0.99, 1.01))
    (short,), (long,) = (aloft_for(flight_parts(each)) for each in flights)
    assert (short.level, long.level, long.field) == ("ok", "fault", "battery.capacity")
    assert short.value == pytest.approx(seconds)
    assert "holds a hover for" in short.text


def flown_for(duration, *payloads, **battery):
    """The servo arm in flight for so long, with payloads, on the battery of the file or
    one that is changed.
    """
    scenario = load_scenario(DATA / "servo_flight.toml")
    vehicle = with_battery(**battery) if battery else arm()
    plant = dataclasses.replace(scenario.plant, vehicle=vehicle)
    return dataclasses.replace(
        scenario, duration=duration, plant=plant, payloads=payloads, windows=Windows()
    )


def test_the_battery_over_a_flight_counts_each_load_for_as_long_as_it_is_held():
    """At a constant voltage without resistance the energy is a sum: power of each load
    times its time.
    """
    flat = {
        "open_circuit": CellCurve(charge=(0.0, 1.0), voltage=(3.7, 3.7 + 1e-9)),
        "resistance": 0.0,
    }
    bare, load = with_battery(**flat), 0.3
    loaded = bare.with_payload(load)
    energy = 3600.0 * 5.0 * 14.8  # J of 5 A h at four cells
    light, heavy = (hover_time(each).power for each in (bare, loaded))
    assert heavy > 1.05 * light
    box = TimedPayload(mass=load, pick=100.0, drop=200.0)
    (found,) = aloft_for(flight_parts(flown_for(300.0, box, **flat)))
    assert found.value == pytest.approx(
        100.0 + 100.0 + (energy - 100.0 * (light + heavy)) / light, rel=1e-6
    )
    assert "with its loads" in found.text
    for parts, payload in (
        (flown_for(300.0, TimedPayload(mass=load), **flat), 0.0),
        (flown_for(300.0, **flat), load),
    ):
        (held,) = aloft_for(flight_parts(parts), payload)
        assert held.value == pytest.approx(energy / heavy, rel=1e-6)


def test_a_flight_that_its_battery_ends_under_a_load_is_a_fault_at_that_time():
    flat = {
        "open_circuit": CellCurve(charge=(0.0, 1.0), voltage=(3.7, 3.7 + 1e-9)),
        "resistance": 0.0,
        "charge": 0.2,
    }
    empty = 3600.0 * 5.0 * 14.8 * 0.2
    light, heavy = (
        hover_time(each).power
        for each in (with_battery(**flat), with_battery(**flat).with_payload(0.3))
    )
    pick = 0.5 * empty / light
    ends = pick + 0.5 * empty / heavy
    scenario = flown_for(
        round(0.5 * (ends + empty / light)), TimedPayload(mass=0.3, pick=pick), **flat
    )
    assert ends < scenario.duration < empty / light, "without the load it would last"
    found = {each.question: each for each in skyarm.check(scenario, poses=2).findings}[
        "battery over the flight"
    ]
    assert (found.level, found.field) == ("fault", "battery.charge")
    assert found.value == pytest.approx(ends, abs=0.01), (
        "a load is taken at the next control instant"
    )


def test_a_reference_faster_than_a_servo_is_a_fault_with_both_speeds():
    scenario = load_scenario(DATA / "servo_flight.toml")
    slow = dataclasses.replace(scenario.plant, vehicle=with_servo(speed_limit=0.1))
    found = {
        e.question: e
        for e in along_reference(dataclasses.replace(scenario, plant=slow))
        if "speed" in e.question
    }
    first, second = (
        found[f"joints[{each.name}] servo's speed"] for each in arm().drives
    )
    assert (first.level, first.limit, second.level) == ("fault", 0.1, "ok")
    sine = tomllib.loads((DATA / "servo_flight.toml").read_text("utf-8"))["reference"][
        "joints"
    ][0]
    fastest = sine["amplitude"] * 2.0 * math.pi * sine["frequency_hz"]
    assert first.value == pytest.approx(fastest, rel=1e-3)
    assert first.field == f"drives.{arm().drives[0].name}.speed_limit"


def test_the_speed_without_load_is_where_the_torque_ends():
    servo = PositionServo(
        stiffness=1.0,
        inertia=0.01,
        gear=200.0,
        torque_constant=0.01,
        resistance=5.0,
        voltage=12.0,
    )
    assert servo.no_load_speed == pytest.approx(6.0, rel=1e-15)
    assert servo.bounds(servo.no_load_speed)[1] == pytest.approx(0.0, abs=1e-12)
    assert np.isinf(dataclasses.replace(servo, voltage=math.inf).no_load_speed)


def test_show_has_drives_and_battery():
    facts = vehicle_facts(arm(), 9.81)
    assert [each["joint"] for each in facts["drives"]] == [
        each.name for each in arm().drives
    ]
    assert facts["drives"][0]["stiffness"] == arm().drives[0].drive.stiffness
    assert facts["battery"]["capacity"] == arm().battery.capacity
    assert facts["battery"]["open_circuit"]["voltage"] == list(
        arm().battery.open_circuit.voltage
    )
    bare = dataclasses.replace(arm(), drives=(), battery=None)
    assert vehicle_facts(bare, 9.81)["battery"] is None
    shown, without = (
        {part.caption.split(":")[0] for part in parts}
        for parts in (sheet(arm(), facts), sheet(bare, vehicle_facts(bare, 9.81)))
    )
    assert shown - without == {"drives", "battery"}


def test_a_hover_at_a_constant_voltage_lasts_the_energy_of_the_pack_over_its_power():
    """Half of 5 A h at 14.8 V."""
    flat = CellCurve(charge=(0.0, 1.0), voltage=(3.7, 3.7 + 1e-9))
    found = hover_time(with_battery(open_circuit=flat, resistance=0.0, charge=0.5))
    assert found.seconds == pytest.approx(3600.0 * 2.5 * 14.8 / found.power, rel=1e-6)
    assert found.charge == pytest.approx(0.0, abs=1e-9)
