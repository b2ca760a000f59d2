"""What `show` computes: reach and static torques, against the two-link arm by hand."""

from __future__ import annotations

import dataclasses
import math

import pytest

import skyarm
from skyarm.actuation.hover import highest_thrust, hover_trim
from skyarm.algebra import Vec3
from skyarm.dynamics.workspace import reach, static_torques


def test_the_reach_of_two_links_is_their_sum() -> None:
    # the search shrinks to 1e-9; the maximum is flat, so its value is better still
    assert reach(skyarm.load_vehicle("hummingbird_arm2")) == pytest.approx(0.3, abs=1e-9)


def test_the_reach_counts_from_the_first_joint_wherever_that_is() -> None:
    arm = skyarm.load_vehicle("hummingbird_arm2")
    links = list(arm.links)
    links[0] = dataclasses.replace(links[0], joint=dataclasses.replace(links[0].joint, position=Vec3(0.1, 0.2, -0.1)))
    assert reach(dataclasses.replace(arm, links=tuple(links))) == pytest.approx(0.3, abs=1e-9)


def test_joint_limits_bound_the_reach() -> None:
    arm = skyarm.load_vehicle("hummingbird_arm2")
    links = list(arm.links)
    links[1] = dataclasses.replace(links[1], joint=dataclasses.replace(links[1].joint, lower=1.0, upper=2.0))
    bent = dataclasses.replace(arm, links=tuple(links))
    # the elbow bent by 1 rad at least: law of cosines
    expected = math.sqrt(2 * 0.15**2 * (1.0 + math.cos(1.0)))
    assert reach(bent) == pytest.approx(expected, abs=1e-9)


def test_static_torques_are_those_of_horizontal_links() -> None:
    # Table 1: links of 0.04 kg with their mass at 0.075 m, 0.01 kg at the tip; checked against the record's numbers
    arm = skyarm.load_vehicle("hummingbird_arm2")
    first, second = (link.body for link in arm.links)
    lever1, lever2 = -float(first.com.z), -float(second.com.z)
    expected2 = 9.81 * float(second.mass) * lever2
    expected1 = 9.81 * (float(first.mass) * lever1 + float(second.mass) * (0.15 + lever2))
    assert static_torques(arm, 9.81) == pytest.approx([expected1, expected2], rel=1e-9)
    assert expected1 == pytest.approx(0.147, abs=5e-4), "the paper's own 0.11 N m leaves out link 2's lever"


def test_a_vehicle_without_an_arm_reaches_nowhere() -> None:
    plain = skyarm.load_vehicle("hummingbird")
    assert reach(plain) == 0.0
    assert static_torques(plain, 9.81) == []


def test_hover_trim_carries_weight_and_the_arm_s_moment() -> None:
    vehicle = skyarm.load_vehicle("hummingbird_arm2_rotors")
    trim = hover_trim(vehicle, (0.5, 0.3), 9.8)
    assert trim.thrust == pytest.approx(0.82103 * 9.8, rel=1e-12)
    thrusts = {r.name: r.thrust_coefficient * w * w for r, w in zip(vehicle.rotors, trim.speeds, strict=True)}
    assert sum(thrusts.values()) == pytest.approx(trim.thrust, rel=1e-12)
    # the arm swings towards -x: its weight there needs more thrust behind; moment about y by hand
    tip = [0.15 * math.sin(0.5), 0.15 * (math.sin(0.5) + math.sin(0.8))]
    moment = 9.8 * sum(
        float(link.body.mass) * (start + -float(link.body.com.z) / 0.15 * (end - start))
        for link, start, end in zip(vehicle.links, [0.0, tip[0]], tip, strict=True)
    )
    assert (thrusts["back"] - thrusts["front"]) * 0.17 == pytest.approx(moment, rel=1e-9)
    assert thrusts["left"] == pytest.approx(thrusts["right"], rel=1e-12)
    assert highest_thrust(vehicle) == pytest.approx(4 * 8.54858e-6 * 838.0**2, rel=1e-12)
