"""A flight that comes to its end and is no success says so: saturated actuators,
references that were not reached.
"""

from __future__ import annotations

import copy
import dataclasses
import io
import json
import math

import numpy as np
import pytest

import skyarm
from skyarm.log.flight_log import rows_of
from skyarm.log.flight_summary import facts, summary
from skyarm.log.metrics.score import score
from skyarm.log.metrics.shortfall import LARGEST_ERROR, LARGEST_TURN
from skyarm.simulate.batch import Batch
from skyarm.vehicle.battery import Battery, CellCurve
from support.commands import skyarm as command
from support.logs import with_components

UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def hover():
    return skyarm.run(skyarm.load_scenario("case3", duration=1.5))


@pytest.fixture(scope="module")
def press():
    return skyarm.run(
        skyarm.load_scenario("press_and_hold", duration=4.0, controller="paper_ct")
    )


def text(log):
    """What ``skyarm run`` prints of it."""
    from rich.console import Console

    console = Console(width=200, file=io.StringIO(), record=True)
    console.print(*summary(log, facts(log)), sep="\n")
    return console.export_text()


def test_of_rotors_on_a_battery_no_limit_is_said_to_be_kept(hover):
    assert "of a rotor's highest; no command at a limit" in text(hover)
    scenario = skyarm.load_scenario("case3", duration=0.2)
    curve = CellCurve(charge=(0.0, 1.0), voltage=(3.3, 4.2))
    pack = Battery(
        cells=3,
        capacity=1.0,
        resistance=0.05,
        open_circuit=curve,
        reference_voltage=12.6,
    )
    vehicle = dataclasses.replace(scenario.plant.vehicle, battery=pack)
    on_battery = dataclasses.replace(
        scenario, plant=dataclasses.replace(scenario.plant, vehicle=vehicle)
    )
    found = text(skyarm.run(on_battery))
    assert "of a rotor's highest\n" in found
    assert "no command at a limit" not in found


@pytest.mark.parametrize("first", [0, 250])
def test_a_rotor_at_rest_is_at_a_limit_wherever_the_summary_speaks_of_one(hover, first):
    """In the settling third, which the share leaves out, and after it."""
    sent = hover.rotor_commands.copy()
    sent[first : first + 10, 2] = 0.0
    found = text(changed(hover, rotor_commands=sent))
    assert ("a rotor at its limit in 5 % of the periods" in found) == (first > 0)
    assert "of a rotor's highest\n" in found


@pytest.mark.parametrize(("esc", "share"), [("governed", 1.0), ("open", None)])
def test_speeds_that_the_battery_cuts_are_at_a_limit(hover, esc, share, monkeypatch):
    """At 6.3 of 12.6 V no rotor turns faster than half its highest speed, and hover
    asks for more.
    """
    curve = CellCurve(charge=(0.0, 1.0), voltage=(3.3, 4.2))
    pack = Battery(
        cells=3,
        capacity=1.0,
        resistance=0.05,
        open_circuit=curve,
        reference_voltage=12.6,
        esc=esc,
    )
    vehicle = dataclasses.replace(
        skyarm.load_scenario("case3").plant.vehicle, battery=pack
    )
    monkeypatch.setattr("skyarm.log.metrics.shortfall.restored_at", lambda *_: vehicle)
    log = with_components(hover, battery_voltage=np.full((hover.time.size, 1), 6.3))
    found = log.shortfall.saturation
    assert (None if found is None else found.share) == share
    assert found is None or found.limit == 419.0


@pytest.mark.parametrize(("esc", "share"), [("governed", 1.0), ("open", 0.0)])
def test_the_metric_counts_the_speeds_that_the_battery_cuts_as_the_warning_does(
    esc, share
):
    """A pack of half the reference voltage: in flight, from its log, and in the
    sentence beside both.
    """
    curve = CellCurve(charge=(0.0, 1.0), voltage=(3.3, 4.2))
    pack = Battery(
        cells=3,
        capacity=1.0,
        resistance=0.05,
        open_circuit=curve,
        reference_voltage=25.2,
        esc=esc,
    )
    case = skyarm.load_scenario("case3", duration=0.2)
    vehicle = dataclasses.replace(case.plant.vehicle, battery=pack)
    weak = dataclasses.replace(
        case, plant=dataclasses.replace(case.plant, vehicle=vehicle)
    )
    log = skyarm.run(weak)
    assert score(log, ("rotor_saturation",)) == {"rotor_saturation": share}
    assert (
        log.shortfall.saturation.share if log.shortfall.saturation else 0.0
    ) == share
    flown = Batch(weak, (), metrics=("rotor_saturation",), effort=0).fly(
        {}, episodes=np.array([0])
    )
    assert flown.metrics["rotor_saturation"].tolist() == [share]


@pytest.mark.parametrize("voltage", [12.6, 13.9])
def test_the_highest_speed_is_a_limit_however_full_the_pack(
    hover, voltage, monkeypatch
):
    curve = CellCurve(charge=(0.0, 1.0), voltage=(3.3, 4.2))
    pack = Battery(
        cells=3,
        capacity=1.0,
        resistance=0.05,
        open_circuit=curve,
        reference_voltage=12.6,
    )
    vehicle = dataclasses.replace(
        skyarm.load_scenario("case3").plant.vehicle, battery=pack
    )
    monkeypatch.setattr("skyarm.log.metrics.shortfall.restored_at", lambda *_: vehicle)
    log = with_components(hover, battery_voltage=np.full((hover.time.size, 1), voltage))
    log = changed(
        log,
        rotor_commands=np.full_like(log.rotor_commands, vehicle.rotors[0].max_speed),
    )
    found = log.shortfall.saturation
    assert (found.share, found.limit) == (1.0, vehicle.rotors[0].max_speed)


def test_backwards_a_reversible_rotor_has_the_limit_of_the_voltage_too(
    hover, monkeypatch
):
    curve = CellCurve(charge=(0.0, 1.0), voltage=(3.3, 4.2))
    pack = Battery(
        cells=3,
        capacity=1.0,
        resistance=0.05,
        open_circuit=curve,
        reference_voltage=12.6,
    )
    vehicle = skyarm.load_scenario("case3").plant.vehicle
    rotors = tuple(
        dataclasses.replace(each, reversible=True) for each in vehicle.rotors
    )
    vehicle = dataclasses.replace(vehicle, battery=pack, rotors=rotors)
    monkeypatch.setattr("skyarm.log.metrics.shortfall.restored_at", lambda *_: vehicle)
    log = with_components(hover, battery_voltage=np.full((hover.time.size, 1), 6.3))
    found = changed(
        log, rotor_commands=np.full_like(log.rotor_commands, -500.0)
    ).shortfall.saturation
    assert (found.share, found.limit) == (1.0, -419.0)


def changed(log, **arrays):
    return dataclasses.replace(log, **arrays)


def test_a_flight_that_lacks_nothing_says_nothing(hover):
    assert hover.status == "completed"
    assert hover.shortfall.lines == ()
    found = facts(hover)
    assert found["saturation"] is None
    assert found["unreached"] == ()


def test_commands_beyond_the_limit_are_a_share_with_the_largest_and_its_actuator(hover):
    sent = hover.rotor_commands.copy()
    sent[: len(sent) // 4, 1] = 1000.0
    sent[7, 1] = 231221.0  # among the same periods
    log = changed(hover, rotor_commands=sent)
    found = log.shortfall.saturation
    assert found.share == pytest.approx(0.25, abs=1e-9)
    assert (found.actuator, found.command, found.limit, found.unit) == (
        "rotor left",
        231221.0,
        838.0,
        "rad/s",
    )
    line = (
        "saturation: commands at or beyond limits in 25 % of the periods, most of all"
        " rotor left: 231221 rad/s"
    )
    line = f"{line}, limit 838"
    assert log.shortfall.lines == (line,)
    assert line in text(log)
    assert facts(log)["saturation"]["command"] == 231221.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_joint_is_at_its_limit_on_either_side(hover, sign):
    efforts = hover.efforts.copy()
    efforts[: len(efforts) // 2, 1] = 0.5 * sign
    found = changed(hover, efforts=efforts).shortfall.saturation
    assert (found.actuator, found.command, found.limit) == (
        "joint joint2",
        0.5 * sign,
        0.5 * sign,
    )
    assert found.share == 0.5


def test_a_law_that_cuts_its_own_commands_for_a_moment_says_nothing(hover):
    sent = hover.rotor_commands.copy()
    sent[0, 0] = 838.0
    log = changed(hover, rotor_commands=sent)
    assert log.shortfall.saturation.share == pytest.approx(1 / len(sent))
    assert log.shortfall.lines == ()
    sent[0, 0] = 839.0
    assert len(changed(hover, rotor_commands=sent).shortfall.lines) == 1


@pytest.mark.parametrize(("beyond", "counts"), [(0.0, False), (1e-6, True)])
def test_a_setpoint_at_the_end_of_its_range_is_carried_out(
    hover, monkeypatch, beyond, counts
):
    sent = np.full(hover.time.size, -beyond)
    monkeypatch.setattr(
        "skyarm.log.metrics.shortfall._actuator_limits",
        lambda _: [("joint elbow", "rad", sent, 0.0, 1.0)],
    )
    assert (hover.shortfall.saturation is not None) is counts


def test_a_command_that_is_no_number_counts(hover):
    sent = hover.rotor_commands.copy()
    sent[-1, 0] = np.nan
    assert (
        "rotor front: nan rad/s"
        in changed(hover, rotor_commands=sent).shortfall.lines[0]
    )


def test_what_has_no_limit_is_never_at_it(hover):
    info = copy.deepcopy(hover.info)
    for link in info["scenario_record"]["agent"]["plant"]["vehicle"]["links"]:
        link["joint"]["effort_limit"] = "inf"
    assert (
        changed(hover, info=info, efforts=1e9 + hover.efforts).shortfall.saturation
        is None
    )


def test_a_vehicle_that_is_far_away_at_the_end_says_of_what(hover):
    away = hover.position_reference + np.array([211.0, 0.0, 0.0])
    base = changed(hover, position=away)
    assert [each.reference for each in base.shortfall.unreached] == ["position"]
    start = base.shortfall.unreached[0].start
    assert start == pytest.approx(0.5)  # what follows the first third
    assert base.shortfall.lines == (
        (
            f"not reached: reference of the base, 211 m off in the mean from {start:g}"
            " s on"
        ),
    )
    tip = changed(hover, tool=hover.tip_reference + 1.01 * LARGEST_ERROR * UP)
    assert [each.reference for each in tip.shortfall.unreached] == ["tip"]
    assert (
        changed(
            hover, tool=hover.tip_reference + 0.99 * LARGEST_ERROR * UP
        ).shortfall.unreached
        == ()
    )


def test_a_heading_that_is_far_off_at_the_end_is_told_the_shorter_way_round(hover):
    late = hover.time >= 0.5 - 1e-9  # what follows the first third
    half = np.full(hover.time.size, 0.5 * 0.7)
    hover = changed(
        hover,
        quaternion=np.stack(
            [np.cos(half), 0.0 * half, 0.0 * half, np.sin(half)], axis=1
        ),
    )
    for turn, off in (
        (math.pi, 180.0),
        (1.01 * LARGEST_TURN, 11.6),
        (-0.5 - math.tau, 28.6),
        (0.99 * LARGEST_TURN, 0),
    ):
        log = changed(hover, yaw_held=hover.euler[:, 2] + np.where(late, turn, 0.0))
        words = (
            f"not reached: heading of the base, {off:.3g} degrees off in the mean from"
            " 0.5 s on"
        )
        assert log.shortfall.lines == ((words,) if off else ())
    (found,) = changed(
        hover, yaw_held=hover.euler[:, 2] + math.pi * late
    ).shortfall.unreached
    assert (found.reference, found.start, found.stop) == (
        "heading",
        0.5,
        hover.time[-1],
    )
    before = changed(hover, yaw_held=hover.euler[:, 2] + math.pi * ~late)
    assert before.shortfall.lines == ()
    assert LARGEST_TURN == 0.2
    nowhere = changed(hover, yaw_held=np.full(hover.time.size, np.nan))
    assert [each.reference for each in nowhere.shortfall.unreached] == ["heading"]


def test_a_flight_that_ended_early_is_judged_where_it_ended(hover):
    far = hover.position.copy()
    far[:20] += 10.0
    cut = rows_of(changed(hover, position=far), slice(0, 60))
    assert cut.shortfall.unreached == ()
    (found,) = rows_of(cut, slice(0, 20)).shortfall.unreached
    assert (found.reference, found.start, found.stop) == (
        "position",
        cut.time[19],
        cut.time[19],
    )


def test_a_push_whose_force_is_never_there_and_phases_without_end(press):
    assert press.status == "completed"
    force, phases = press.shortfall.unreached
    assert (force.reference, phases.reference) == ("force", "phase")
    assert (force.start, force.stop) == pytest.approx((1.005, 3.995))
    assert "at most 0 N of 1 N" in force.words
    assert phases.words == "end of phase 2 (press), 3 (retreat)"
    assert all(line in text(press) for line in press.shortfall.lines)
    pressed = np.zeros_like(press.contact_force)
    pressed[press.time > 3.0, 0] = 0.71
    assert [
        each.reference
        for each in with_components(press, contact_force=pressed).shortfall.unreached
    ] == ["phase"]
    pressed *= 0.69 / 0.71
    assert (
        "at most 0.69 N of 1 N"
        in with_components(press, contact_force=pressed).shortfall.unreached[0].words
    )


def test_a_push_is_not_reached_by_the_contact_of_a_skid(press, monkeypatch):
    monkeypatch.setattr(
        "skyarm.log.metrics.shortfall.contact_pairs",
        lambda _: (("wall", "tip"), ("wall", "skid")),
    )
    force = np.zeros((press.time.size, 2))
    force[:, 1] = 8.0
    assert (
        "at most 0 N of 1 N"
        in with_components(press, contact_force=force).shortfall.unreached[0].words
    )
    pressed = with_components(press, contact_force=force[:, ::-1].copy())
    assert "force" not in [each.reference for each in pressed.shortfall.unreached]


def test_while_the_tip_presses_its_place_along_the_normal_is_open(press):
    pushed = press.time > 1.1
    away = press.position_reference + np.outer(pushed, [9.0, 0.0, 0.0])
    assert "position" not in [
        each.reference for each in changed(press, position=away).shortfall.unreached
    ]


def test_what_is_gripped_is_not_pressed(press, monkeypatch):
    count = press.time.size
    gripped = (np.ones(count), *np.zeros((4, count)), (press.time > 1.0).astype(float))
    monkeypatch.setattr("skyarm.log.metrics.shortfall.wanted_push", lambda _: gripped)
    away = press.position_reference + np.outer(press.time > 1.0, [9.0, 0.0, 0.0])
    force, phases = changed(press, position=away).shortfall.unreached
    assert (force.start, force.stop) == (0.0, 1.0)
    assert phases.reference == "phase"


def test_a_flight_with_a_governor_is_judged_by_its_distance_to_the_path():
    scenario = skyarm.load_scenario("examples/fast_circle.toml", duration=7.0)
    log = skyarm.run(scenario)
    late = log.time > 5.0
    assert (
        np.linalg.norm(log.position - log.position_reference, axis=1)[late].mean()
        > LARGEST_ERROR
    )
    assert log.shortfall.unreached == ()


def test_the_command_line_says_it_in_words_and_in_json(tmp_path):
    arguments = [
        "run",
        "press_and_hold",
        "--laws",
        "paper_ct",
        "--duration",
        "4",
        "--out",
        str(tmp_path),
    ]
    assert "not reached: force of the push" in command(*arguments).out
    found = json.loads(command(*arguments, "--json").out)
    assert [each["reference"] for each in found["unreached"]] == ["force", "phase"]
    assert found["saturation"] is None
