"""Rotors and joints that hear of a command at different times, and laws that join a
running reference.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.algebra.scalars import where
from skyarm.dynamics.actuators import Command
from skyarm.records.leaves import leaves
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_file import load_scenario, scenario_from
from skyarm.scenario.scenario_record import first_state
from skyarm.simulate import Delays, ScenarioError, run
from skyarm.simulate.batch import Batch
from skyarm.simulate.command_delay import switches
from skyarm.simulate.first_state import (
    commands_waiting,
    first_loop_state,
    first_surroundings,
)
from skyarm.simulate.loop import run_in_python
from skyarm.simulate.plant_steps import CalledPlant
from skyarm.simulate.stages import Stages, joined_reference
from support.cases import sampled
from support.flights import circling, fly

ROTORS, JOINTS, LATE = "delays.rotors", "delays.joints", "delays.command"


def moving(duration: float = 1.3, **delays: Any) -> Any:
    """0.3 s of hover, then the step on to the circle and the arm's sines."""
    return dataclasses.replace(
        scenario_from(circling(duration=duration)), delays=Delays(**delays)
    )


def ends(outcome: Any, lane: int = 0) -> list[float]:
    state = outcome.state
    return [
        float(x[lane])
        for x in (*state.position, *state.velocity, *state.joints, *state.joint_rates)
    ]


@pytest.mark.parametrize("late", [0.003, 0.005, 0.012])
def test_both_as_late_as_each_other_are_one_delay(late: float) -> None:
    both = run(moving(rotors=late, joints=late))
    one = run(moving(command=late))
    for name in ("position", "joints", "rotor_speeds"):
        assert np.allclose(getattr(both, name), getattr(one, name), rtol=0.0, atol=1e-9)


def test_a_delay_on_top_adds_to_the_one_of_all_commands() -> None:
    assert ends(
        Batch(moving(command=0.002, rotors=0.005), bit_exact=True).fly({})
    ) == ends(Batch(moving(rotors=0.007, joints=0.002), bit_exact=True).fly({}))


STEP = 0.05


def stepping(
    memory: Any, measurement: Any, reference: Any, dt: Any, *, par: Any
) -> tuple[Any, Command]:
    """Rotors and the second joint step at 0.05 s; the vehicle falls level before."""
    del reference, dt, par
    after = measurement.time > STEP - 1e-4
    speed, effort = where(after, 500.0, 400.0), where(after, 0.01, 0.0)
    return memory, Command(rotor_speeds=(speed,) * 4, efforts=(0.0, effort))


@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
@pytest.mark.parametrize(
    ("rotors", "joints"),
    [(0.0, 0.0), (0.012, 0.0), (0.0, 0.003), (0.02, 0.005), (0.003, 0.02)],
)
def test_each_part_arrives_when_its_own_delay_is_over(
    plant: str, rotors: float, joints: float
) -> None:
    base = load_scenario("case1", plant=plant, duration=0.15)
    start = dataclasses.replace(
        first_state(base), position=Vec3(0.0, 0.0, 50.0), rotor_speeds=(400.0,) * 4
    )
    law = dataclasses.replace(base.controller, law=stepping)
    log = run(
        dataclasses.replace(
            base,
            controller=law,
            initial=start,
            delays=Delays(rotors=rotors, joints=joints),
        )
    )
    for column, late, still in (
        (log.rotor_speeds[:, 0], rotors, 1e-6),
        (log.joint_rates[:, 1], joints, 1e-6),
    ):
        moved = float(log.time[int(np.argmax(np.abs(column - column[0]) > still))])
        # it shows at the first control instant after it has acted
        assert moved - 0.005 - 1e-9 <= STEP + late < moved - 1e-9


@pytest.mark.parametrize(
    ("rotors", "joints"),
    sampled([(0.012, 0.003), (0.003, 0.0), (0.0, 0.002), (0.001, 0.009)], 4),
)
def test_engines_agree_on_late_parts(rotors: float, joints: float) -> None:
    scenario = dataclasses.replace(
        moving(rotors=rotors, joints=joints, duration=0.7), tracking_start=0.4
    )
    compiled = run(scenario)
    floats = fly(scenario, python=True)
    staged, other = (
        run_in_python(scenario),
        run_in_python(dataclasses.replace(scenario, kind="mujoco")),
    )
    assert np.array_equal(
        floats.engine.recorder.samples(0, floats.engine.tick)[0].states[:, :3],
        compiled.position,
    )
    assert np.allclose(staged.joints, compiled.joints, rtol=0.0, atol=1e-12)
    # held forces make MuJoCo's steps first order
    assert np.allclose(other.position, compiled.position, atol=1e-3)
    assert np.allclose(other.joints, compiled.joints, atol=5e-3)


def test_delays_vary_by_path_with_the_bits_of_single_flights() -> None:
    whole = [(0.0, 0.0), (0.005, 0.0), (0.0, 0.010), (0.010, 0.005)]
    batch = Batch(moving(longest_command=0.015), (ROTORS, JOINTS), bit_exact=True)
    flown = batch.fly(
        {
            ROTORS: np.array([a for a, _ in whole]),
            JOINTS: np.array([b for _, b in whole]),
        }
    )
    for lane, (rotors, joints) in enumerate(whole):
        assert ends(flown, lane) == ends(
            Batch(moving(rotors=rotors, joints=joints), bit_exact=True).fly({})
        )


def test_parts_of_a_period_vary_too_within_rounding() -> None:
    batch = Batch(moving(longest_command=0.02), (LATE, ROTORS, JOINTS), bit_exact=True)
    values = [(0.002, 0.004, 0.0), (0.001, 0.003, 0.011), (0.0, 0.0065, 0.0)]
    flown = batch.fly(
        dict(zip((LATE, ROTORS, JOINTS), np.array(values).T, strict=True))
    )
    for lane, (command, rotors, joints) in enumerate(values[:2]):
        alone = ends(
            Batch(
                moving(command=command, rotors=rotors, joints=joints), bit_exact=True
            ).fly({})
        )
        assert ends(flown, lane) == pytest.approx(alone, rel=0.0, abs=1e-9)
    assert np.isfinite(ends(flown, 2)).all()


def test_only_rotors_vary_where_joints_hear_at_once() -> None:
    batch = Batch(moving(longest_command=0.02), (ROTORS,), bit_exact=True)
    flown = batch.fly({ROTORS: np.array([0.0, 0.007])})
    assert ends(flown, 0) == pytest.approx(
        ends(Batch(moving(), bit_exact=True).fly({})), rel=0.0, abs=1e-9
    )
    assert ends(flown, 1) == pytest.approx(
        ends(Batch(moving(rotors=0.007), bit_exact=True).fly({})), rel=0.0, abs=1e-9
    )


def test_the_loop_remembers_as_many_commands_as_the_later_part_needs() -> None:
    assert commands_waiting(moving(rotors=0.004)) == 1 == commands_waiting(moving())
    assert commands_waiting(moving(command=0.002, rotors=0.004)) == 2
    assert commands_waiting(moving(rotors=0.01, joints=0.02)) == 5


@pytest.mark.parametrize(
    ("delays", "words"),
    [
        ({"rotors": -0.001}, r"delays\.rotors = -0\.001: must be at least 0"),
        (
            {"joints": 0.0005},
            r"delays\.joints = 0\.0005: must be a whole number of physics steps",
        ),
        ({"rotors": float("nan")}, r"delays\.rotors = nan: must be a finite number"),
        ({"rotors": 60.0}, r"delays\.rotors = 60\.0: must not exceed the duration"),
        (
            {"rotors": 0.01, "command": 0.01, "longest_command": 0.015},
            (
                r"delays\.rotors = 0\.02 with delays\.command: must not exceed"
                r" delays\.longest_command = 0\.015"
            ),
        ),
        (
            {"command": 0.02, "longest_command": 0.015},
            (
                r"delays\.command = 0\.02: must not exceed delays\.longest_command ="
                r" 0\.015"
            ),
        ),
    ],
)
def test_wrong_delays_are_refused_in_one_line(
    delays: dict[str, float], words: str
) -> None:
    with pytest.raises(ScenarioError, match=words):
        run(moving(**delays))


def test_lanes_outside_the_queue_are_refused() -> None:
    batch = Batch(moving(longest_command=0.01), (LATE, ROTORS))
    for late, more in ((0.006, 0.006), (0.0, -0.001)):
        with pytest.raises(
            ScenarioError,
            match=r"delays\.rotors.*must be from 0 to delays\.longest_command",
        ):
            batch.fly({LATE: np.array([late]), ROTORS: np.array([more])})
    with pytest.raises(
        ScenarioError, match=r"path = 'delays\.rotors': delays is structure"
    ):
        Batch(moving(), (ROTORS,))
    apart = Batch(moving(rotors=0.005, longest_command=0.01), (LATE,))
    with pytest.raises(
        ScenarioError,
        match=(
            r"values\[.delays\.command.\]: delays\.rotors with delays\.command must be"
            r" from 0 to"
        ),
    ):
        apart.fly({LATE: np.array([0.006])})


# --- a law that joins a reference which is already running


def running(joined: Any, plant: str = "rigid_body") -> Any:
    """A circle and sines from 0.01 s on, which the law joins at 1 s."""
    table = {
        "base": {
            "kind": "circle",
            "radius": 0.3,
            "frequency_hz": 0.08,
            "center": [0.0, 0.0, 1.0],
            "start": 0.01,
        },
        "joints": [
            {"kind": "sine", "amplitude": 0.2, "frequency_hz": 0.5, "start": 0.01},
            0.1,
        ],
    } | ({} if joined is None else {"tracking_start": joined})
    return scenario_from(
        {
            "name": "running",
            "duration": 2.0,
            "plant": {"vehicle": "hummingbird_arm2_rotors", "kind": plant},
            "model": {"vehicle": "hummingbird_arm2"},
            "reference": table,
            "controller": {"preset": "paper_ct"},
        }
    )


@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
def test_until_it_joins_the_law_rests_at_the_reference_of_the_start(plant: str) -> None:
    late = run(running(1.0, plant))
    start = {
        "base": {"kind": "hover", "position": [0.0, 0.0, 1.0]},
        "joints": [0.0, 0.1],
    }
    hover = run(
        dataclasses.replace(
            running(None, plant),
            reference=scenario_from({**BARE, "reference": start}).reference,
        )
    )
    before = late.time < 1.0
    assert np.array_equal(late.rotor_commands[before], hover.rotor_commands[before])
    assert np.array_equal(late.joints[before], hover.joints[before])
    assert not np.array_equal(late.rotor_commands[200:], hover.rotor_commands[200:])


BARE = {
    "name": "bare",
    "duration": 2.0,
    "plant": {"vehicle": "hummingbird_arm2_rotors"},
    "model": {"vehicle": "hummingbird_arm2"},
    "controller": {"preset": "paper_ct"},
}


def test_errors_are_taken_against_the_running_reference_all_the_time() -> None:
    late, followed = run(running(1.0)), run(running(None))
    assert np.array_equal(late.position_held, followed.position_held)
    assert np.array_equal(late.joints_reference, followed.joints_reference)
    assert np.linalg.norm(late.position - late.position_held, axis=1)[100] > 0.25


def test_a_law_that_joins_at_the_start_follows_from_the_first_instant() -> None:
    assert running(None).tracking_start == 0
    assert type(running(None).tracking_start) is int
    assert np.array_equal(run(running(0.0)).position, run(running(None)).position)


def test_the_instant_varies_by_path_with_the_bits_of_single_flights() -> None:
    assert number_at(running(None), "reference.tracking_start") == 0.0
    assert (
        with_numbers(running(None), {"reference.tracking_start": 1.0}).tracking_start
        == 1.0
    )
    batch = Batch(
        running(None),
        ("reference.tracking_start", "reference.joints.0.amplitude"),
        bit_exact=True,
    )
    flown = batch.fly(
        {
            "reference.tracking_start": np.array([0.0, 0.5, 1.0]),
            "reference.joints.0.amplitude": np.full(3, 0.2),
        }
    )
    alone_only = Batch(running(None), ("reference.tracking_start",), bit_exact=True)
    table = alone_only.fly({"reference.tracking_start": np.array([0.0, 0.5, 1.0])})
    for lane, joined in enumerate((0.0, 0.5, 1.0)):
        alone = ends(Batch(running(joined), bit_exact=True).fly({}))
        assert ends(flown, lane) == alone == ends(table, lane)


def test_a_session_hears_of_it_too() -> None:
    session = skyarm.Session(running(1.0))
    while session.running:
        session.step()
    assert np.array_equal(session.log.position, run(running(1.0)).position)


def test_the_start_of_tracking_is_a_number_of_the_reference() -> None:
    assert number_at(running(1.0), "reference.tracking_start") == 1.0


@pytest.mark.parametrize(
    ("joined", "words"),
    [
        (-1.0, r"reference\.tracking_start = -1\.0: must be at least 0"),
        ("now", r"reference\.tracking_start = 'now': must be a finite number"),
        (5.0, r"reference\.tracking_start = 5\.0: must not exceed the duration of 2 s"),
    ],
)
def test_a_wrong_instant_is_refused_in_one_line(joined: Any, words: str) -> None:
    with pytest.raises(ScenarioError, match=words):
        running(joined)


def test_what_acts_within_a_period_until_both_have_heard() -> None:
    old, new = (
        Command(rotor_speeds=(value,), efforts=(10.0 * value,)) for value in (1.0, 2.0)
    )
    late_joints, late_rotors = (
        Command(rotor_speeds=(2.0,), efforts=(10.0,)),
        Command(rotor_speeds=(1.0,), efforts=(20.0,)),
    )
    assert switches(old, new, 0.001, 0.004) == [
        (0.001, old),
        (pytest.approx(0.003), late_joints),
    ]
    assert switches(old, new, 0.004, 0.001) == [
        (0.001, old),
        (pytest.approx(0.003), late_rotors),
    ]
    varied = np.array([0.001, 0.004])
    # what varies with joints that hear at once needs one piece only
    assert switches(old, new, varied, 0.0) == [(pytest.approx(varied), late_rotors)]
    assert switches(old, new, 0.0, varied) == [(pytest.approx(varied), late_joints)]
    (first, before), (second, mixed) = switches(
        old, new, varied, np.array([0.003, 0.002])
    )
    assert before == old
    assert (*first, *second) == pytest.approx((0.001, 0.002, 0.002, 0.002))
    assert [list(mixed.rotor_speeds[0]), list(mixed.efforts[0])] == [
        [2.0, 1.0],
        [10.0, 20.0],
    ]


def test_a_law_that_waits_is_told_a_pose_and_no_rates() -> None:
    moving = dataclasses.replace(
        running(1.0),
        reference=skyarm.hover(
            [0, 0, 1],
            joints=[skyarm.Sine(amplitude=0.2, frequency_hz=0.5, phase=0.3), 0.1],
        ),
    )
    going = moving.reference.at(0.7).dense()
    rests, follows = (joined_reference(moving, going, time) for time in (0.7, 1.0))
    assert rests.joints == pytest.approx((0.2 * np.sin(0.3), 0.1))
    assert rests.joint_rates == rests.joint_accelerations == (0.0, 0.0)
    assert follows == going
    assert going.joint_rates[0] != 0.0


def test_joints_of_mujocos_plant_do_not_wait_for_rotors_within_a_period() -> None:
    """Until the rotors have heard it is all one to the joints whether that comes 5 or 7
    ms after the command.
    """
    base = load_scenario("case1", plant="mujoco", duration=0.06)
    start = dataclasses.replace(
        first_state(base), position=Vec3(0.0, 0.0, 50.0), rotor_speeds=(400.0,) * 4
    )
    law = dataclasses.replace(base.controller, law=stepping)
    planned = dataclasses.replace(base, controller=law, initial=start)
    first, second = (
        run(dataclasses.replace(planned, delays=Delays(rotors=late)))
        for late in (0.005, 0.007)
    )
    assert np.array_equal(first.joint_rates, second.joint_rates)
    assert not np.array_equal(first.joint_rates[11], first.joint_rates[10])


@pytest.mark.parametrize(
    ("late", "heard"),
    [
        ({}, [(0.005, (2.0,) * 4, (20.0,) * 2)]),
        (
            {"command": 0.002},
            [(0.002, (1.0,) * 4, (10.0,) * 2), (0.003, (2.0,) * 4, (20.0,) * 2)],
        ),
        (
            {"rotors": 0.003, "joints": 0.001},
            [
                (0.001, (1.0,) * 4, (10.0,) * 2),
                (0.002, (1.0,) * 4, (20.0,) * 2),
                (0.002, (2.0,) * 4, (20.0,) * 2),
            ],
        ),
    ],
)
def test_a_called_plant_holds_what_acts_until_each_part_has_heard(
    late: Any, heard: Any
) -> None:
    scenario = dataclasses.replace(
        load_scenario("case1", plant="mujoco"), delays=Delays(**late)
    )
    first, held = first_loop_state(scenario), []

    class Plant:
        def advance(self, state: Any, command: Any, around: Any, seconds: float) -> Any:
            held.append(
                (pytest.approx(seconds), tuple(command[:4]), tuple(command[4:]))
            )
            return (*state[1:], float(len(held)))

    around = first_surroundings(scenario, first)
    called = CalledPlant(Plant(), Stages(scenario), around)  # type: ignore[arg-type]
    state, numbers = tuple(leaves(first.agent.state)), tuple(leaves(around))
    after = called._advance(
        state, (1.0,) * 4 + (10.0,) * 2, (2.0,) * 4 + (20.0,) * 2, numbers
    )
    assert held == heard
    assert after[-len(heard) :] == tuple(float(k + 1) for k in range(len(heard))), (
        "each interval begins where one ended"
    )
