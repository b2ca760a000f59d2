"""Load sharing: statics of bodies in grasps against closed forms, a saddle-point system
of our own, and flights.
"""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.assess import assessment
from skyarm.studies.assess.along_reference import Followed, along_reference, follow
from skyarm.studies.assess.before_flight import warnings_before_flight
from skyarm.studies.assess.finding import FAULT, OK
from skyarm.studies.assess.flight_loads import flight_parts
from skyarm.studies.assess.load_sharing import (
    Balance,
    balance_of_bodies,
    balances,
    carried_loads,
    losses,
    poses_with_share,
)
from skyarm.world.contact.contact_point import ContactPoint
from skyarm.world.contact.surface import Surface
from support.commands import skyarm as command
from support.teams import GRAVITY, TEAMS, team, with_grasps, with_world

BAR, PLATE = 0.104 * GRAVITY, 0.278 * GRAVITY


def with_places(scenario: Scenario, places: Sequence[Any], **fields: Any) -> Scenario:
    """Team whose grasps are at other places of the body, below the frames of the
    vehicles, with fields of each.
    """
    assert scenario.world is not None
    rows = zip(scenario.world.grasps, places, strict=True)
    held = tuple(
        dataclasses.replace(each, place=Vec3(*map(float, place)), **fields)
        for each, place in rows
    )
    return with_world(scenario, grasps=held)


def with_object(scenario: Scenario, **fields: Any) -> Scenario:
    """Team with fields of its only object replaced."""
    assert scenario.world is not None
    return with_world(
        scenario,
        objects=tuple(
            dataclasses.replace(each, **fields) for each in scenario.world.objects
        ),
    )


def only(scenario: Scenario, lost: str = "") -> Balance:
    """Equilibrium of the only body."""
    (balance,) = balances(scenario, lost)
    return balance


def thrusts(scenario: Scenario) -> list[float]:
    """Thrust (N) of each vehicle that hovers with its share."""
    poses = [
        poses_with_share(scenario, name, balances(scenario)) for name in scenario.agents
    ]
    return [float(each.efforts(each.joints)[3, 0]) for each in poses]


def flown_thrusts(log: Any) -> list[float]:
    return [
        3.5936999e-7 * float((each.rotor_speeds[-1] ** 2).sum())
        for each in log.agents.values()
    ]


def test_two_vehicles_lift_half_a_bar_each_as_in_flight() -> None:
    bar = team("bar", duration=5.0)
    assert thrusts(bar) == pytest.approx(
        [(2 * 0.25 + 0.104) * GRAVITY / 2] * 2, abs=1e-9
    )
    assert thrusts(bar) == pytest.approx([2.96262] * 2, abs=1e-6)
    assert only(bar).determined
    assert thrusts(bar) == pytest.approx(flown_thrusts(skyarm.run(bar)), rel=1e-3)


def test_three_vehicles_share_a_plate_by_its_moments() -> None:
    plate = team("triangle")
    places = np.array([[-0.094, -0.267], [0.3683, 0.0], [-0.094, 0.267]])
    shares = np.linalg.solve(np.vstack([np.ones(3), places.T]), [PLATE, 0.0, 0.0])
    assert [only(plate).share(name) for name in plate.agents] == pytest.approx(
        shares, abs=1e-9
    )
    assert only(plate).determined


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["triangle", "cables"])
def test_thrusts_with_a_share_are_those_of_a_flight(name: str) -> None:
    assert thrusts(team(name)) == pytest.approx(
        flown_thrusts(skyarm.run(team(name))), rel=1e-4
    )


def saddle_point(
    places: np.ndarray,
    k: Sequence[float],
    radius: float,
    weight: float,
    arm: np.ndarray,
) -> np.ndarray:
    """Wrenches (m, 6) of least elastic energy in fixed grasps: Lagrange's conditions of
    min sum h^2 / k, G h = -w.
    """
    m = len(places)
    compliance = np.concatenate(
        [[1 / each] * 3 + [1 / (each * radius**2)] * 3 for each in k]
    )
    G = np.zeros((6, 6 * m))
    for i, (x, y, z) in enumerate(places - arm):
        G[:, 6 * i : 6 * i + 6] = np.eye(6)
        G[3:, 6 * i : 6 * i + 3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
    system = np.block([[np.diag(compliance), G.T], [G, np.zeros((6, 6))]])
    right = np.concatenate([np.zeros(6 * m), [0, 0, weight, 0, 0, 0]])
    return np.linalg.solve(system, right)[: 6 * m].reshape(m, 6)


def test_fixed_grasps_share_by_their_stiffness() -> None:
    plate = with_grasps(team("triangle"), kind="fixed", radius=0.05)
    assert plate.world is not None
    k = (3000.0, 9000.0, 5000.0)
    held = tuple(
        dataclasses.replace(g, stiffness=s)
        for g, s in zip(plate.world.grasps, k, strict=True)
    )
    com = Vec3(0.02, -0.03, 0.004)
    plate = with_object(with_world(plate, grasps=held), com=com)
    places = np.array([[*each.place] for each in held])
    ours = only(plate)
    np.testing.assert_allclose(
        ours.wrenches, saddle_point(places, k, 0.05, PLATE, np.array([*com])), atol=1e-9
    )
    assert (ours.determined, ours.departure, ours.remarks) == (False, "", ())


def test_a_squeezed_bar_is_pressed_by_two_springs_in_series() -> None:
    squeezed = with_places(team("bar"), [(0.0, 0.191, 0.0097), (0.0, -0.191, 0.0097)])
    assert only(squeezed).wrenches[:, 1] == pytest.approx([-5.0, 5.0], abs=1e-9)
    assert thrusts(squeezed) == pytest.approx(
        [float(np.hypot(0.25 * GRAVITY + BAR / 2, 5.0))] * 2, abs=1e-9
    )


def test_cables_pull_along_their_lines() -> None:
    inward = with_places(team("cables"), [(0.0, 0.04, 0.01), (0.0, -0.04, 0.01)])
    slope = np.array([0.15, 0.5])  # of each cable: across and up
    assert only(inward).wrenches[0, 1:3] == pytest.approx(
        slope * BAR / 2 / 0.5, abs=1e-9
    )
    assert only(inward).departure == ""
    aslant = with_object(inward, position=Vec3(0.0, 0.1, 0.49))
    assert only(aslant).departure.startswith(
        "swings: grasp left_bar, right_bar cannot pull straight up"
    )


def test_the_shorter_of_two_cables_at_one_place_bears_more() -> None:
    cables = team("cables")
    assert cables.world is not None
    left, right = cables.world.grasps
    double = with_world(
        cables,
        grasps=(left, dataclasses.replace(left, name="shorter", length=0.4999), right),
    )
    ours = only(double)
    tension = 0.5 * (BAR / 2 - 2000.0 * 0.0001)
    assert ours.wrenches[:, 2] == pytest.approx(
        [tension, BAR / 2 - tension, BAR / 2], abs=1e-9
    )
    assert (ours.determined, ours.share("left")) == (
        False,
        pytest.approx(BAR / 2, abs=1e-9),
    )


def test_a_cable_that_would_have_to_push_hangs_slack() -> None:
    one_side = with_object(team("cables"), com=Vec3(0.0, 0.25, 0.0))
    ours = only(one_side)
    assert ours.remarks == ("cable right_bar would have to push: it hangs slack",)
    # 0.06 beside, 0.0097 below
    assert ours.departure.startswith("tips about grasp left_bar by 81 degrees")
    assert [ours.share("left"), ours.share("right")] == pytest.approx(
        [BAR, 0.0], abs=1e-9
    )


@pytest.mark.parametrize(
    ("height", "degrees"), [(0.0097, "87"), (0.19, "45"), (0.0, "90")]
)
def test_a_body_on_one_ball_grasp_turns_until_it_hangs_below(
    height: float, degrees: str
) -> None:
    places = [(0.0, y, height) for y in (0.19, -0.19)]
    bar = with_object(
        with_places(team("bar"), places), position=Vec3(0.0, 0.0, 1.0 - height)
    )
    ours = only(bar, lost="left")
    assert ours.departure == f"tips about grasp right_bar by {degrees} degrees"
    assert ours.share("right") == pytest.approx(BAR, abs=1e-9)


def test_a_body_above_its_ball_grasps_tips_over() -> None:
    below = with_object(
        with_places(team("bar"), [(0.0, y, -0.0097) for y in (0.19, -0.19)]),
        position=Vec3(0, 0, 1.0097),
    )
    (found,) = balance_of_bodies(balances(below))
    assert (found.level, found.text) == (
        "warning",
        "tips about grasp left_bar, right_bar by 180 degrees",
    )
    assert only(with_grasps(below, kind="fixed")).departure == ""


def test_two_of_three_grasps_let_a_plate_hang_from_their_line() -> None:
    plate, right, front = (
        team("triangle"),
        np.array([-0.094, -0.267]),
        np.array([0.3683, 0.0]),
    )
    ours = only(plate, lost="front")
    assert ours.departure == "tips about grasp right_plate, left_plate by 84 degrees"
    assert [ours.share("right"), ours.share("left")] == pytest.approx(
        [PLATE / 2] * 2, abs=1e-9
    )
    ours = only(plate, lost="left")
    along = float((-right) @ (front - right) / ((front - right) @ (front - right)))
    assert ours.share("front") == pytest.approx(PLATE * along, abs=1e-9)
    assert ours.share("left") == 0.0


def test_a_patch_that_cannot_hold_the_moment_lets_the_body_turn() -> None:
    bar = with_grasps(team("bar"), kind="fixed", radius=0.006)  # 0.18 N m each
    ours = only(bar, lost="left")
    assert (
        ours.departure
        == "turns in grasp right_bar: its patch holds 0.18 N m of 0.194 N m"
    )
    assert np.linalg.norm(ours.wrenches[0, 3:]) == pytest.approx(0.18, abs=1e-12)
    assert only(with_grasps(bar, radius=0.01), lost="left").departure == ""


def test_opened_grasps_and_a_body_without_any_are_said() -> None:
    bar = team("bar")
    assert bar.world is not None
    first, second = bar.world.grasps
    opened = with_world(bar, grasps=(first, dataclasses.replace(second, release=0.0)))
    assert only(opened).departure.startswith("tips about grasp left_bar")
    (loss,) = losses(opened, balances(opened))
    assert loss.text == "bar is no longer in balance: it falls: nothing holds it"
    assert loss.level == "note"


def test_a_body_that_touches_a_surface_is_said_and_shared_as_if_lifted() -> None:
    table = Surface(
        name="table", shape="plane", position=Vec3(0.0, 0.0, 0.9903 - 0.0138)
    )
    (found,) = balance_of_bodies(balances(with_world(team("bar"), surfaces=(table,))))
    assert (found.level, found.text) == (
        "note",
        "touches table at the start: its shares are those once it is lifted",
    )
    # in the bar, which it holds
    foot = ContactPoint(name="foot", frame="grip", agent="left")
    assert only(with_world(team("bar"), points=(foot,))).remarks == ()
    assert only(with_world(team("bar"), surfaces=(table,))).share(
        "left"
    ) == pytest.approx(BAR / 2, abs=1e-9)


ARMS = """
schema = 1
name = "two_arms"
title = "Two arms hold a bar"
duration = 16.0

[plant]
vehicle = "hexarotor_arm6"

[controller]
preset = "centroidal_joint"

[agents.left.reference]
yaw = 0.0
joints = [0.3, 0.6, -0.9, 0.2, 0.4, 0.1]
base = { kind = "hover", position = [0.0, 0.0, 1.5] }

[agents.right.reference]
yaw = 3.141592653589793
joints = [0.3, 0.6, -0.9, 0.2, 0.4, 0.1]
base = { kind = "hover", position = [AWAY, 0.0, 1.5] }

[environment]
ground = false

[[world.objects]]
name = "bar"
shape = "box"
size = [1.2, 0.04, 0.04]
mass = 1.6
position = [MIDDLE]

[[world.grasps]]
agent = "left"
body = "bar"
place = [LEFT]
stiffness = 2e4
damping = 40.0

[[world.grasps]]
agent = "right"
body = "bar"
place = [RIGHT]
stiffness = 2e4
damping = 40.0
"""

TIP = np.array([-0.010506056, -0.028839525, 0.834833309])
"""Tip of the arm in this pose, m: with a base at (0, 0, 1.5) that looks along x."""


@pytest.fixture
def arms(tmp_path: Path) -> Scenario:
    """Two hexarotors with arms, whose tips hold a bar 1.1 m apart."""
    other = np.array([TIP[0] + 1.1, -TIP[1], TIP[2]])
    middle = 0.5 * (TIP + other)
    numbers = {
        "MIDDLE": middle,
        "LEFT": TIP - middle,
        "RIGHT": other - middle,
        "AWAY": [other[0] + TIP[0]],
    }
    text = ARMS
    for word, values in numbers.items():
        text = text.replace(word, ", ".join(f"{each:.9f}" for each in values))
    path = tmp_path / "arms.toml"
    path.write_text(text, "utf-8")
    return skyarm.load_scenario(path)


@pytest.mark.thorough
def test_joint_efforts_under_a_share_are_those_of_a_flight(arms: Scenario) -> None:
    log = skyarm.run(arms)
    for name, each in log.agents.items():
        poses = poses_with_share(arms, name, balances(arms))
        np.testing.assert_allclose(
            poses.efforts(poses.joints)[4:, 0], each.efforts[-1], rtol=0, atol=1e-3
        )


def test_joint_efforts_under_a_share_are_those_of_its_moment(arms: Scenario) -> None:
    poses = poses_with_share(arms, "left", balances(arms))
    bare = dataclasses.replace(poses, load=0.0)
    added = (poses.efforts(poses.joints) - bare.efforts(bare.joints))[:, 0]
    share = 0.8 * GRAVITY
    assert added[:4] == pytest.approx(
        [TIP[1] * share, -TIP[0] * share, 0.0, share], abs=1e-5
    )
    laden = poses_with_share(arms, "left", balances(arms), 0.1)
    assert laden.efforts(laden.joints)[3, 0] == pytest.approx(4.9 * GRAVITY, abs=1e-9)
    # a payload at the tip is the same load
    heavier = poses.vehicle.with_payload(0.8)
    weighted = dataclasses.replace(bare, vehicle=heavier).efforts(bare.joints)[:, 0]
    np.testing.assert_allclose(
        poses.efforts(poses.joints)[:, 0], weighted, rtol=0, atol=1e-5
    )


def test_findings_of_each_vehicle_are_under_its_name(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # which takes a second each
    monkeypatch.setattr(assessment, "delay_margin", lambda _: [])
    found = assessment.assess_scenario(team("triangle"), poses=4)
    assert list(found.agents) == ["right", "front", "left"]
    share = {
        name: next(f for f in each.findings if f.question == "load share")
        for name, each in found.agents.items()
    }
    assert (
        share["front"].text
        == "0.5545 N of the 2.727 N of plate (20%, by geometry); hover takes 3.007 N of"
        " thrust, with +41% of thrust margin"
    )
    assert [each.question for each in found.agents["left"].alarms()] == [
        "thrust margin with its share"
    ]
    of_losses = [f"loss of {name}" for name in found.agents]
    assert [each.question for each in found.findings] == [
        "balance of plate",
        *of_losses,
        "flight in calm air",
    ]
    assert {each.level for each in found.findings[1:-1]} == {"warning"}
    for each in found.findings[1:-1]:
        margins = [
            float(m) for m in re.findall(r"with ([+-]\d+)% of thrust margin", each.text)
        ]
        assert round(100.0 * (each.value - 1.0)) == min(margins)
    assert "warning in thrust margin with its share" in found.findings[1].text
    assert found.flies
    document = found.plain()
    assert set(document["agents"]) == set(found.agents)
    assert "agents" not in document["agents"]["left"]
    page = found._repr_html_()
    assert "loss of left" in page
    assert "can fly: no fault, 5 warnings" in page
    assert document["agents"]["left"]["findings"] == [
        each.plain() for each in found.agents["left"].findings
    ]


def test_one_vehicle_that_holds_a_body_is_checked_with_it(tmp_path: Path) -> None:
    text = (TEAMS / "bar.toml").read_text("utf-8")
    text = re.sub(r"\[agents.right[^[]*\[[^[]*", "", text)
    text = (
        text.replace("agents.left.", "")
        .replace('agent = "left"\n', "")
        .replace("[0.0, 0.19, ", "[0.0, 0.0, ")
    )
    (tmp_path / "alone.toml").write_text(
        text[: text.rindex("[[world.grasps]]")], "utf-8"
    )
    findings = {
        each.question: each
        for each in skyarm.check(tmp_path / "alone.toml", poses=4).findings
    }
    assert findings["load share"].value == pytest.approx(BAR, abs=1e-9)
    assert findings["balance of bar"].level == "ok"
    assert findings["delay margin"].level == "ok"
    assert not any(question.startswith("loss") for question in findings)


def test_a_body_that_is_too_heavy_is_a_fault_of_the_command(tmp_path: Path) -> None:
    text = (TEAMS / "bar.toml").read_text("utf-8").replace("mass = 0.104", "mass = 0.6")
    (tmp_path / "heavy.toml").write_text(text, "utf-8")
    done = command(
        "check", str(tmp_path / "heavy.toml"), "--arm-poses", "4", columns=200
    )
    assert done.code == 1
    assert re.search(r"^right \(dragonfly\)$", done.out, re.MULTILINE)
    assert (
        len(re.findall(r"cannot lift itself: .* \(5\.4 N of weight\)", done.out)) == 2
    )
    assert "loss of" not in done.out
    found = json.loads(
        command("check", str(tmp_path / "heavy.toml"), "--json", "--arm-poses", "4").out
    )
    assert (found["can_fly"], found["agents"]["left"]["vehicle"]) == (
        False,
        "dragonfly",
    )
    assert "vehicle" not in found
    levels = [
        each["level"]
        for each in found["agents"]["left"]["findings"]
        if each["question"].startswith("thrust")
    ]
    assert "fault" in levels


def test_losses_are_notes_or_warnings_and_the_report_shows_them() -> None:
    done = command("check", str(TEAMS / "bar.toml"), "--arm-poses", "4", columns=300)
    assert done.code == 0
    said = (
        "bar is no longer in balance: it tips about grasp right_bar by 87 degrees;"
        " right carries 1.02 N, with +22%"
    )
    assert re.search(
        rf"^note  loss of left +{re.escape(said)} of thrust margin",
        done.out,
        re.MULTILINE,
    )
    assert done.out.rstrip().endswith("can fly: no fault, 0 warnings")


def along(scenario: Scenario, name: str) -> Followed:
    """Exact tracking of a vehicle's reference with its share of the carried body."""
    carried = carried_loads(scenario, name, balances(scenario))
    return follow(flight_parts(scenario.of(name), carried))


def test_a_carried_share_counts_from_lift_to_place_as_in_flight() -> None:
    scenario = skyarm.load_scenario("two_carry_a_bar")
    log = skyarm.run(scenario)
    for name in scenario.agents:
        demand, flown = along(scenario, name).demand, log.agents[name]
        # at rest: empty, then with the bar, then empty
        for t in (1.0, 6.0, 10.0, 14.0, 21.5):
            planned, given = (
                demand.efforts[:, np.argmin(np.abs(demand.time - t))],
                np.searchsorted(log.time, t),
            )
            assert planned == pytest.approx(flown.efforts[given], abs=0.05), (
                f"{name} at {t} s"
            )
        empty, loaded = (
            abs(demand.efforts[1, np.argmin(np.abs(demand.time - t))])
            for t in (1.0, 10.0)
        )
        assert abs(loaded - empty) > 0.3


def test_joints_that_a_share_overloads_along_the_path_are_said_before_a_flight(
    tmp_path: Path,
) -> None:
    ball, file = (
        skyarm.load_scenario(TEAMS / "heavy_beam.toml"),
        tmp_path / "fixed.toml",
    )
    assert warnings_before_flight(ball) == []
    # hands turn with the beam, and the levers of the shoulders grow
    text = (TEAMS / "heavy_beam.toml").read_text("utf-8")
    file.write_text(
        text.replace('body = "bar"\n', 'body = "bar"\nkind = "fixed"\n'), "utf-8"
    )
    fixed = skyarm.load_scenario(file)
    loads = carried_loads(fixed, "left", balances(fixed))
    (found,) = (
        e
        for e in along_reference(fixed.of("left"), carried=loads)
        if e.question.startswith("joints along")
    )
    assert found.level == FAULT
    assert "joints[shoulder]" in found.text
    assert along_reference(fixed.of("left"))[-1].level == OK
    lines = warnings_before_flight(fixed)
    assert [line.partition(":")[0] for line in lines] == ["left", "right"]
    assert all(
        "joints[shoulder].effort_limit: saturates first at 1" in line for line in lines
    )
    assert (
        carried_loads(dataclasses.replace(ball, team=None), "left", balances(ball))
        == []
    )
    opened = with_grasps(ball, release=8.0)
    (load,) = carried_loads(opened, "left", balances(opened))
    assert (load.start, load.stop) == (3.0, 8.0)
