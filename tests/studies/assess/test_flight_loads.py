"""A check of a scenario counts every load of its flight: payloads, grips, changes,
wind, forces, faults, pressing.
"""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.dynamics.kinematics import frame_pose
from skyarm.reference.path_time import PathTime
from skyarm.reference.signals import Constant, Ramp, Windowed
from skyarm.scenario.scenario_file import list_scenarios
from skyarm.scenario.scenario_record import Change
from skyarm.studies.assess.along_reference import along_reference, follow
from skyarm.studies.assess.finding import FAULT, OK, WARNING, worst_level
from skyarm.studies.assess.flight_loads import flight_parts
from skyarm.studies.assess.push_limits import push_limits
from skyarm.world import HangingPayload, Reach, TimedPayload
from support.cases import sampled

EXAMPLES = tuple(
    str(file)
    for file in sorted(Path("examples").glob("*.toml"))
    if "\n[plant]\n" in file.read_text("utf-8")
)


@pytest.fixture(scope="module")
def hover():
    """The paper's vehicle on its reference's first 6 s, a hover with the arm hanging,
    in calm air.
    """
    return skyarm.load_scenario("case3", duration=4.0)


def found(scenario):
    return {each.question: each for each in along_reference(scenario)}


def demand(scenario):
    return follow(flight_parts(scenario)).demand


def thrust(scenario):
    """Of all rotors, (K,), N."""
    factors = np.array(
        [float(rotor.thrust_coefficient) for rotor in scenario.plant.vehicle.rotors]
    )
    return factors @ demand(scenario).squared


def weight(scenario):
    return float(scenario.plant.vehicle.mass) * float(scenario.plant.gravity)


@pytest.mark.parametrize("kind", [TimedPayload, HangingPayload])
def test_a_payload_that_is_too_heavy_is_a_fault_of_thrust_and_along_the_reference(
    hover, kind
):
    heavy = dataclasses.replace(hover, payloads=(kind(mass=8.0, name="anvil"),))
    said = found(heavy)
    assert said["thrust margin with 8 kg (anvil)"].level == FAULT
    assert said["rotors along the reference"].level == FAULT
    assert thrust(heavy) == pytest.approx(
        weight(hover) + 8.0 * float(hover.plant.gravity)
    )
    assert worst_level(along_reference(hover)) != FAULT


def test_a_payload_counts_while_it_is_held(hover):
    held = dataclasses.replace(
        hover, payloads=(TimedPayload(mass=0.2, pick=1.0, drop=3.0),)
    )
    parts = flight_parts(held)
    assert [(part.start, part.stop, part.words) for part in parts] == [
        (0.0, 1.0, ""),
        (1.0, 3.0, " with 0.2 kg (payloads[0])"),
        (3.0, 4.0, ""),
    ]
    assert "thrust margin with 0.2 kg (payloads[0])" in found(held)
    time, wanted = demand(held).time, weight(hover)
    more = thrust(held) - wanted
    assert more[(time > 1.0) & (time < 3.0)] == pytest.approx(
        0.2 * float(hover.plant.gravity)
    )
    assert more[(time < 1.0) | (time > 3.0)] == pytest.approx(0.0, abs=1e-9)


def test_a_share_of_the_flight_is_a_share_of_its_time(hover):
    """Twenty loads of 20 ms in 40 s are 1 % of it, although each takes as many instants
    as 160 ms of hover.
    """
    long = dataclasses.replace(hover, duration=40.0)
    loads = tuple(
        TimedPayload(mass=8.0, pick=2.0 * k + 1.0, drop=2.0 * k + 1.02)
        for k in range(20)
    )
    said = found(dataclasses.replace(long, payloads=loads))[
        "rotors along the reference"
    ]
    assert said.level == WARNING
    assert ", for 1.0% of the flight; " in said.text
    followed = follow(flight_parts(dataclasses.replace(long, payloads=loads)))
    assert followed.seconds.sum() == pytest.approx(40.0)
    assert followed.share(followed.demand.time < 1.02) == pytest.approx(
        1.02 / 40.0, abs=1e-3
    )


def test_a_payload_is_picked_where_the_reference_comes_to_its_place():
    scenario = skyarm.load_scenario("case3", duration=20.0)
    beside = Reach(within=0.1, of=Vec3(-0.3, 0.0, 0.7))
    placed = dataclasses.replace(
        scenario, payloads=(TimedPayload(mass=0.1, pick_place=beside),)
    )
    _, held = flight_parts(placed)
    # of the circle of 0.3 m, and half a turn to the other side
    angle = 2.0 * math.pi * 0.08 * (held.start - 6.0)
    assert 0.75 * math.pi < angle < math.pi
    never = dataclasses.replace(
        placed,
        payloads=(
            TimedPayload(mass=0.1, pick_place=Reach(within=0.1, of=Vec3(9, 9, 9))),
        ),
    )
    assert [part.words for part in flight_parts(never)] == [""]


@pytest.mark.parametrize("duration", [20.0, 600.0])
def test_a_place_that_is_passed_fast_is_found_in_a_flight_of_any_length(duration):
    """At 2.5 m/s a sphere of 0.1 m takes 80 ms, 16 control periods of which a long
    flight may skip none.
    """
    scenario = skyarm.load_scenario("case3", duration=duration)
    vehicle = scenario.plant.vehicle
    across = Ramp(start=duration - 10.0, duration=3.0, height=7.5)
    passing = dataclasses.replace(
        scenario.reference,
        x=across,
        y=Constant(0.0),
        joints=(Constant(0.0),) * vehicle.n,
    )
    tip = (
        passing.at(duration - 8.45).position
        + frame_pose(vehicle, vehicle.frame(), (0.0,) * vehicle.n).p
    )
    payload = TimedPayload(mass=8.0, pick_place=Reach(within=0.1, of=tip))
    placed = dataclasses.replace(scenario, reference=passing, payloads=(payload,))
    assert [part.words for part in flight_parts(placed)] == [
        "",
        " with 8 kg (payloads[0])",
    ]


def test_a_scheduled_payload_counts_from_its_instant(hover):
    later = dataclasses.replace(
        hover, changes=(Change(at=2.0, path="plant.payload.mass", value=8.0),)
    )
    said = found(later)["rotors along the reference"]
    assert said.level == FAULT
    assert "saturates first at 2" in said.text
    believed = dataclasses.replace(
        hover, changes=(Change(at=2.0, path="model.payload.mass", value=8.0),)
    )
    assert worst_level(along_reference(believed)) != FAULT


@pytest.mark.parametrize(
    "name",
    sampled((*list_scenarios(), *EXAMPLES), 29, keep=["pick_and_carry", "slide_up"]),
)
def test_no_shipped_scenario_has_a_fault(name):
    scenario = skyarm.load_scenario(name)
    for agent in scenario.agents:
        own = scenario.of(agent)
        found = along_reference(own)
        assert [
            each for each in (*found, *push_limits(own)) if each.level == FAULT
        ] == []
        assert [
            each for each in found if each.level != OK and each.question != "reference"
        ] == []


def test_a_reference_in_slower_time_jumps_when_its_own_time_comes_to_the_jump(hover):
    """Half as fast: the heading steps at 2 s of flight. Nobody turns through a step, so
    that no rotor is asked to.
    """
    step = 0.5
    slow = PathTime(points=tuple(0.5 * step * (i - 2) for i in range(16)), step=step)
    stepped = dataclasses.replace(
        hover.reference, yaw=Windowed(Constant(1.0), start=1.0)
    )
    found = demand(dataclasses.replace(hover, reference=stepped, path_time=slow))
    still = demand(hover).squared[:, 0]
    assert found.time.min() < 1.0
    assert found.squared == pytest.approx(
        np.repeat(still[:, None], len(found.time), axis=1), rel=1e-6
    )
