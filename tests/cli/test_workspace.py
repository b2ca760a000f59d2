"""What `show` computes: reach and static torques, against the two-link arm by hand."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.cli.output import Terminal
from skyarm.dynamics import workspace
from skyarm.dynamics.actuators.hover import highest_thrust, hover_trim
from skyarm.dynamics.workspace import (
    AROUND,
    FEW,
    MANY,
    ROUNDS,
    SAMPLES,
    reach,
    samples_of,
    static_torques,
)
from skyarm.scenario.scenario_checks import MOST_JOINTS
from skyarm.studies.assess.data_sheet import sheet, vehicle_facts
from skyarm.vehicle import Vehicle


def test_the_reach_of_two_links_is_their_sum() -> None:
    # the search shrinks to 1e-9; the maximum is flat, so its value is better still
    assert reach(skyarm.load_vehicle("hummingbird_arm2")) == pytest.approx(
        0.3, abs=1e-9
    )


def test_the_reach_counts_from_the_first_joint_wherever_that_is() -> None:
    arm = skyarm.load_vehicle("hummingbird_arm2")
    links = list(arm.links)
    links[0] = dataclasses.replace(
        links[0],
        joint=dataclasses.replace(links[0].joint, position=Vec3(0.1, 0.2, -0.1)),
    )
    assert reach(dataclasses.replace(arm, links=tuple(links))) == pytest.approx(
        0.3, abs=1e-9
    )


def test_joint_limits_bound_the_reach() -> None:
    arm = skyarm.load_vehicle("hummingbird_arm2")
    links = list(arm.links)
    links[1] = dataclasses.replace(
        links[1], joint=dataclasses.replace(links[1].joint, lower=1.0, upper=2.0)
    )
    bent = dataclasses.replace(arm, links=tuple(links))
    # the elbow bent by 1 rad at least: law of cosines
    expected = math.sqrt(2 * 0.15**2 * (1.0 + math.cos(1.0)))
    assert reach(bent) == pytest.approx(expected, abs=1e-9)


def test_static_torques_are_those_of_horizontal_links() -> None:
    # Table 1: links of 0.04 kg with their mass at 0.075 m, 0.01 kg at the tip; checked
    # against the record's numbers
    arm = skyarm.load_vehicle("hummingbird_arm2")
    first, second = (link.body for link in arm.links)
    lever1, lever2 = -float(first.com.z), -float(second.com.z)
    expected2 = 9.81 * float(second.mass) * lever2
    expected1 = 9.81 * (
        float(first.mass) * lever1 + float(second.mass) * (0.15 + lever2)
    )
    assert static_torques(arm, 9.81) == pytest.approx([expected1, expected2], rel=1e-9)
    assert expected1 == pytest.approx(0.147, abs=5e-4), (
        "the paper's own 0.11 N m leaves out link 2's lever"
    )


def test_a_vehicle_without_an_arm_reaches_nowhere() -> None:
    plain = skyarm.load_vehicle("hummingbird")
    assert reach(plain) == 0.0
    assert static_torques(plain, 9.81) == []


def test_hover_trim_carries_weight_and_the_arm_s_moment() -> None:
    vehicle = skyarm.load_vehicle("hummingbird_arm2_rotors")
    trim = hover_trim(vehicle, (0.5, 0.3), 9.8)
    assert trim.thrust == pytest.approx(0.82103 * 9.8, rel=1e-12)
    thrusts = {
        r.name: r.thrust_coefficient * w * w
        for r, w in zip(vehicle.rotors, trim.speeds, strict=True)
    }
    assert sum(thrusts.values()) == pytest.approx(trim.thrust, rel=1e-12)
    # the arm swings towards -x: its weight there needs more thrust behind; moment about
    # y by hand
    tip = [0.15 * math.sin(0.5), 0.15 * (math.sin(0.5) + math.sin(0.8))]
    moment = 9.8 * sum(
        float(link.body.mass) * (start + -float(link.body.com.z) / 0.15 * (end - start))
        for link, start, end in zip(vehicle.links, [0.0, tip[0]], tip, strict=True)
    )
    assert (thrusts["back"] - thrusts["front"]) * 0.17 == pytest.approx(
        moment, rel=1e-9
    )
    assert thrusts["left"] == pytest.approx(thrusts["right"], rel=1e-12)
    assert highest_thrust(vehicle) == pytest.approx(
        4 * 8.54858e-6 * 838.0**2, rel=1e-12
    )


def long_arm(joints: int) -> Vehicle:
    """The two-joint arm's links, over and over, in one chain."""
    arm = skyarm.load_vehicle("hummingbird_arm2")
    links = []
    for i in range(joints):
        link = arm.links[i % 2]
        links.append(
            dataclasses.replace(
                link,
                name=f"link{i}",
                parent=i - 1,
                joint=dataclasses.replace(link.joint, name=f"joint{i}"),
            )
        )
    frames = tuple(
        dataclasses.replace(frame, link=joints - 1)
        for frame in arm.frames
        if frame.name == "tip"
    )
    return dataclasses.replace(
        arm, links=tuple(links), frames=frames, end_effector="tip"
    )


@pytest.mark.parametrize("joints", [1, 6, MANY, MANY + 1, 1200, 500_000])
def test_a_search_begins_with_fewer_values_where_there_are_many_joints(
    joints: int,
) -> None:
    assert (
        samples_of(joints) == SAMPLES
        if joints <= MANY
        else 8 <= samples_of(joints) <= max(FEW / joints, 8)
    )


@pytest.mark.parametrize("joints", [2, 40, 300])
def test_an_arm_of_many_joints_is_tried_as_often_as_was_said(
    joints: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    arm, tried = long_arm(joints), []
    real = workspace.inverse_dynamics

    def counting(vehicle: Vehicle, q: tuple[np.ndarray, ...], *rest: object) -> object:
        tried.append(q[0].size)
        return real(vehicle, q, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(workspace, "inverse_dynamics", counting)
    efforts = static_torques(arm, 9.81)
    assert tried == [samples_of(joints)] + [joints * (AROUND + 1)] * (
        ROUNDS if joints <= MANY else 0
    )
    assert len(efforts) == joints
    # no joint can hold more than all links beyond it, stretched out level, weigh there
    masses = [float(link.body.mass) for link in arm.links]
    for i, effort in enumerate(efforts):
        level = sum(mass * 0.15 * (k + 1) for k, mass in enumerate(masses[i:]))
        assert 0.0 < effort <= 9.81 * level


def test_what_was_tried_less_is_told() -> None:
    def printed(vehicle: Vehicle) -> str:
        console = Terminal(width=200, markup=False)
        with console.capture() as told:
            console.print(*sheet(vehicle, vehicle_facts(vehicle, 9.81)), sep="\n")
        return told.get()

    assert "for a level base, over all joint values" in printed(long_arm(2))
    told = printed(long_arm(120))
    assert told.count("random joint values") == 2, "reach and efforts"


def test_a_vehicle_of_more_joints_than_llvm_bears_is_not_flown() -> None:
    """1200 joints ended the process in a segmentation fault, after minutes without a
    word.
    """
    scenario = skyarm.load_scenario("case1")
    arm = long_arm(MOST_JOINTS + 1)
    with pytest.raises(
        ValueError,
        match=r"plant\.vehicle = '\w+': has 257 joints, must have at most 256 to fly$",
    ):
        skyarm.run(
            dataclasses.replace(
                scenario, plant=dataclasses.replace(scenario.plant, vehicle=arm)
            )
        )
