"""A session flies what a run flies, period by period, and may be led, wound back and
changed on the way.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from skyarm import Session
from skyarm.algebra import Vec3
from skyarm.dynamics.actuators import Command
from skyarm.records.leaves import leaves
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_file import load_scenario, scenario_from
from skyarm.scenario.scenario_record import JointDrive, NamedSensor
from skyarm.sensing.measurement import SensorNoise
from skyarm.simulate import Delays, Log, ScenarioError, run
from support.cases import sampled
from support.components import (
    Blend,
    Ceiling,
    Fix,
    Lag,
    RandomPush,
    Turbulence,
    same_logs,
    with_law,
)
from support.flights import document, shared_programs

NOISY = dataclasses.replace(
    load_scenario("case3_wind", duration=0.5),
    noise=SensorNoise(position=0.001, attitude=0.002),
    delays=Delays(measurement=0.005, command=0.002),
    seed=6,
    episode=2,
)
ADDED = dataclasses.replace(
    NOISY,
    air=(Turbulence(),),
    forces=(RandomPush(sigma=0.1),),
    sensors=(NamedSensor(name="fix", sensor=Fix(rate=20.0, delay=0.01, sigma=0.01)),),
    estimator=Blend(),
    drives=(JointDrive(joint="joint1", drive=Lag()),),
)


@pytest.fixture(autouse=True, scope="module")
def _shared() -> Any:
    with shared_programs():
        yield


def called(memory: Any, measurement: Any, reference: Any, dt: Any, *, par: Any) -> Any:
    """A law with a memory that cannot be traced: it asks a number what it is."""
    height = (
        float(measurement.position.z)
        if not hasattr(measurement.position.z, "op")
        else measurement.position.z
    )
    push = 480.0 + (20.0 if memory[0] % 10 < 5 else -20.0)
    return (memory[0] + 1, height), Command(
        rotor_speeds=(push,) * 4, efforts=(0.0, 0.0)
    )


def calling(scenario: Any) -> Any:
    return with_law(scenario, called, memory=(0, 0.0), compiled=False)


SCENARIOS: dict[str, Any] = {
    "noisy": NOISY,
    "added": ADDED,
    "mujoco": dataclasses.replace(ADDED, kind="mujoco", duration=0.2),
    "called": calling(dataclasses.replace(NOISY, duration=0.2)),
    "ends": dataclasses.replace(NOISY, endings=(Ceiling(height=0.999),)),
    "ends_at_once": scenario_from(
        document("case1", duration=0.2, reference__base__position=[0.0, 0.0, 0.1])
    ),
    "adaptive": load_scenario("case2_gust", controller="centroidal_tip", duration=0.2),
}


@pytest.fixture(
    params=sampled(sorted(SCENARIOS), 100, keep=("called", "ends", "mujoco", "noisy"))
)
def scenario(request: Any) -> Any:
    if request.param == "mujoco":
        pytest.importorskip("mujoco")
    return SCENARIOS[request.param]


def same(a: Log, b: Log) -> bool:
    return same_logs(a, b) and a.info == b.info


def test_a_session_to_its_end_is_a_run(scenario: Any) -> None:
    wanted, session = run(scenario), Session(scenario)
    assert (session.tick, session.time) == (0, 0.0)
    count = 0
    while session.step():
        count += 1
        assert session.tick == count
        assert session.time == count / 200
        assert session.running
    assert not session.running
    assert same(session.log, wanted)
    assert (session.ended is None) == (wanted.status == "completed")
    if session.ended:
        assert (session.ended.status, session.ended.cause) == (
            wanted.status,
            wanted.info["cause"],
        )
    # and nothing flies any more
    assert not session.step()
    assert same(session.run(), wanted)


def test_what_flies_is_machine_code_where_it_can_be() -> None:
    engines = {
        name: Session(each)._engine.code.kernel
        for name, each in SCENARIOS.items()
        if name != "mujoco"
    }
    assert engines.pop("called") is None
    assert None not in engines.values()


@pytest.mark.parametrize("engine", ["machine code", "stage by stage"])
def test_a_period_in_which_the_episode_ends_can_be_asked_about(engine: str) -> None:
    scenario = dataclasses.replace(NOISY, endings=(Ceiling(height=0.5),))
    session = Session(scenario if engine == "machine code" else calling(scenario))
    assert session.measurement.time == 0.0
    assert not session.step()
    assert session.ended is not None
    assert session.ended.status == "ceiling"


@pytest.mark.parametrize("name", ["added", "called", "mujoco"])
def test_what_a_session_tells_of_the_next_period_is_what_comes_in_it(name: str) -> None:
    """State and reference against the log; the measurement against what the law is
    told, which tells it.
    """
    heard: list[Any] = []
    base = SCENARIOS[name]

    def listening(
        memory: Any, measurement: Any, reference: Any, dt: Any, *, par: Any
    ) -> Any:
        heard.append((measurement, reference))
        return base.controller.law(memory, measurement, reference, dt, par=par)

    session = Session(
        dataclasses.replace(with_law(base, listening, compiled=False), duration=0.1)
    )
    quick, log = (
        Session(dataclasses.replace(base, duration=0.1)),
        run(dataclasses.replace(base, duration=0.1)),
    )
    for k in range(20):
        told = session.measurement, session.reference
        assert (
            session.measurement,
            session.reference,
        ) == told, "asking changes nothing"
        assert (quick.measurement, quick.reference) == told
        assert (
            list(session.state.position)
            == list(quick.state.position)
            == log.position[k].tolist()
        )
        session.step()
        quick.step()
        assert heard[-1] == told
    with pytest.raises(
        ScenarioError, match=r"^session: has ended; there is no next period$"
    ):
        _ = session.measurement
    with pytest.raises(ScenarioError, match="has ended"):
        _ = session.reference


@pytest.mark.parametrize("name", ["added", "mujoco", "called"])
def test_the_laws_own_commands_from_outside_fly_the_same_flight(name: str) -> None:
    base = dataclasses.replace(SCENARIOS[name], duration=0.1)
    wanted, session = run(base), Session(base)
    for speeds, efforts in zip(
        wanted.rotor_commands.tolist(), wanted.efforts.tolist(), strict=True
    ):
        session.step(Command(rotor_speeds=tuple(speeds), efforts=tuple(efforts)))
    assert same_logs(session.log, wanted)


@pytest.mark.parametrize("name", ["adaptive", "called"])
def test_a_command_from_outside_leaves_the_laws_memory(name: str) -> None:
    base = SCENARIOS[name]
    session = Session(base)
    for _ in range(5):
        session.step()
    before = (
        leaves(session._engine.now.agent.memory)
        if name == "adaptive"
        else session._engine.now.agent.memory
    )
    command = Command(
        rotor_speeds=(470.0, 480.0, 470.0, 480.0), efforts=(0.001, -0.002)
    )
    for k in range(3):
        session.step(command)
        after = (
            leaves(session._engine.now.agent.memory)
            if name == "adaptive"
            else session._engine.now.agent.memory
        )
        assert after == before
        assert session.log.rotor_commands[5 + k].tolist() == list(command.rotor_speeds)
        assert session.log.efforts[5 + k].tolist() == list(command.efforts)
    session.step()
    moved = (
        leaves(session._engine.now.agent.memory)
        if name == "adaptive"
        else session._engine.now.agent.memory
    )
    assert moved != before
    assert session.log.rotor_commands[8].tolist() != list(command.rotor_speeds), (
        "the law is asked again"
    )


def test_a_command_of_another_vehicle_is_refused() -> None:
    session = Session(NOISY)
    for rotors, joints in ((3, 2), (4, 1), (5, 2), (4, 0)):
        words = (
            rf"^command: {rotors} rotor speeds and {joints} efforts: must be 4 and 2$"
        )
        with pytest.raises(ScenarioError, match=words):
            session.step(
                Command(rotor_speeds=(480.0,) * rotors, efforts=(0.0,) * joints)
            )
    with pytest.raises(ScenarioError, match=r"^rotors = 480\.0: must be 4 numbers$"):
        session.step(rotors=480.0)  # type: ignore[arg-type]
    assert session.tick == 0


@pytest.mark.parametrize("name", ["noisy", "mujoco", "called"])
def test_a_command_that_is_no_number_ends_the_episode(name: str) -> None:
    session = Session(SCENARIOS[name])
    session.step()
    assert not session.step(
        Command(rotor_speeds=(480.0, float("nan"), 480.0, 480.0), efforts=(0.0, 0.0))
    )
    assert session.ended is not None
    assert (session.ended.status, session.ended.time) == ("diverged", 0.005)
    assert "is not finite" in session.ended.cause
    assert session.log.time.size == 1


@pytest.mark.parametrize("name", ["added", "mujoco", "called", "adaptive"])
def test_a_session_goes_back_to_a_snapshot_as_often_as_it_likes(name: str) -> None:
    base = SCENARIOS[name]
    wanted, session = run(base), Session(base)
    for _ in range(13):
        session.step()
    held, told = session.snapshot(), session.measurement
    assert held.tick == 13
    for _ in range(11):
        session.step(Command(rotor_speeds=(520.0,) * 4, efforts=(0.01, 0.0)))
    assert not np.array_equal(session.log.position[:24], wanted.position[:24])
    later = session.snapshot()
    for _ in range(2):
        session.restore(held)
        assert (session.tick, session.measurement) == (13, told)
        assert same(session.run(), wanted)
    session.restore(later)
    assert session.tick == 24
    assert session.running


@pytest.mark.parametrize("name", ["noisy", "called"])
@pytest.mark.parametrize(("at", "ahead"), [(14, 6), (3, 33), (16, 1), (15, 16)])
def test_noise_is_that_of_the_period_wherever_a_session_goes_back_from(
    name: str, at: int, ahead: int
) -> None:
    wanted, session = run(SCENARIOS[name]), Session(SCENARIOS[name])
    for _ in range(at):
        session.step()
    held, told = session.snapshot(), session.measurement
    for _ in range(ahead):
        session.step()
    session.restore(held)
    assert session.measurement == told
    assert same(session.run(), wanted)


def test_a_snapshot_of_another_session_is_refused() -> None:
    session, other = Session(NOISY), Session(dataclasses.replace(NOISY, seed=99))
    session.step()
    for foreign in (other.snapshot(), Session(NOISY).snapshot()):
        with pytest.raises(
            ScenarioError,
            match=r"^snapshot: is of another session, must be of this one",
        ):
            session.restore(foreign)
    with pytest.raises(ScenarioError, match=r"^snapshot = 3: must be a Snapshot"):
        session.restore(3)  # type: ignore[arg-type]
    assert (session.tick, session.scenario) == (1, NOISY)


def test_stages_draw_stretch_by_stretch_what_machine_code_draws_one_by_one() -> None:
    own = NOISY.controller.law

    def untraced(
        memory: Any, measurement: Any, reference: Any, dt: Any, *, par: Any
    ) -> Any:
        return own(memory, measurement, reference, dt, par=par)

    assert same_logs(run(with_law(NOISY, untraced, compiled=False)), run(NOISY))


def test_a_snapshot_before_the_end_undoes_the_end() -> None:
    session = Session(SCENARIOS["ends"])
    held = session.snapshot()
    wanted = session.run()
    assert wanted.status == "ceiling"
    ended = session.snapshot()
    session.restore(held)
    assert session.running
    assert session.ended is None
    assert same(session.run(), wanted)
    session.restore(held)
    session.restore(ended)
    assert not session.running
    assert same(session.log, wanted)


@pytest.mark.parametrize("machine_code", [True, False])
def test_a_stretch_never_goes_back(machine_code: bool) -> None:
    session = Session(NOISY, machine_code=machine_code)
    for _ in range(12):
        session.step()
    before = leaves(session.now)
    assert session.fly(5)
    assert session.fly(12)
    assert (session.tick, leaves(session.now)) == (12, before)
    assert same_logs(session.run(), run(NOISY))
    assert not session.fly(5)


def test_a_log_that_is_taken_in_flight_is_its_owners() -> None:
    """Whoever turns it into millimetres changes neither the session nor another log of
    it.
    """
    session = Session(NOISY)
    for _ in range(5):
        session.step()
    first, second = session.log, session.log
    for name in ("time", "position", "rotor_commands", "position_reference"):
        getattr(first, name)[:] = 7.0
    assert not (second.position == 7.0).any()
    assert same_logs(session.run(), run(NOISY))


def test_a_snapshot_brings_the_ranges_of_rotors_back() -> None:
    session = Session(NOISY)
    session.step()
    held, fast = (
        session.snapshot(),
        Command(rotor_speeds=(600.0,) * 4, efforts=(0.0, 0.0)),
    )
    session.change({f"plant.vehicle.rotors.{k}.max_speed": 500.0 for k in range(4)})
    with pytest.raises(ScenarioError, match="must be from 0 to 500"):
        session.step(fast)
    session.restore(held)
    assert session.step(fast)


def test_the_state_at_an_early_end_does_not_depend_on_how_it_was_flown() -> None:
    """In stretches of any length, in steps and in floats: the law's memory is that of
    the instant of the end.
    """
    scenario = dataclasses.replace(
        load_scenario("case1", controller="centroidal_joint"), duration=2.0
    )
    scenario = with_numbers(scenario, {"plant.vehicle.base.mass": 3.0})
    sessions = [Session(scenario, machine_code=k < 4) for k in range(5)]
    for session, stretch in zip(sessions, (1, 7, 50, 400, 400), strict=True):
        while session.running:
            (
                session._engine.fly(session.tick + stretch)
                if stretch > 1
                else session.step()
            )
    first = sessions[0]
    assert first.ended is not None
    assert first.ended.status == "ground"
    for session in sessions[1:]:
        assert (session.tick, leaves(session.now)) == (first.tick, leaves(first.now))


def test_numbers_may_change_between_periods() -> None:
    path = "controller.gains.position.z"
    wanted, session = run(NOISY), Session(NOISY)
    for _ in range(20):
        session.step()
    session.change({path: 12.0})
    assert (session.tick, session.scenario.controller.par.gains.position.z) == (
        20,
        12.0,
    )
    log = session.run()
    assert log.position[:21].tobytes() == wanted.position[:21].tobytes()
    assert not np.array_equal(log.position[22:], wanted.position[22:])
    assert log.status == "completed"
    # from the first period on it is the flight of the changed scenario
    begun = Session(NOISY)
    begun.change({path: 12.0})
    assert same_logs(begun.run(), run(with_numbers(NOISY, {path: 12.0})))
    # and a change to what it was changes nothing
    still = Session(NOISY)
    for _ in range(20):
        still.step()
    still.change({path: NOISY.controller.par.gains.position.z})
    assert same_logs(still.run(), wanted)


@pytest.mark.parametrize("name", ["added", "mujoco", "called"])
def test_every_engine_flies_on_after_a_change(name: str) -> None:
    base = SCENARIOS[name]
    session, wanted = Session(base), run(base)
    for _ in range(13):
        session.step()
    session.change({"plant.gravity": float(base.plant.gravity)})  # as it was
    assert same_logs(session.run(), wanted)
    other = Session(base)
    for _ in range(10):
        other.step()
    other.change({"plant.gravity": 9.0})
    log = other.run()
    assert log.position[:11].tobytes() == wanted.position[:11].tobytes()
    assert not np.array_equal(log.velocity[12], wanted.velocity[12])


def test_a_law_that_writes_to_its_memory_keeps_it_apart_for_every_flight() -> None:
    """The memory is a list that the law changes in place: flights, snapshots and
    changes have one each.
    """

    def counting(
        memory: Any, measurement: Any, reference: Any, dt: Any, *, par: Any
    ) -> Any:
        memory[0] += 1
        return memory, Command(
            rotor_speeds=(470.0 + memory[0],) * 4, efforts=(0.0, 0.0)
        )

    base = with_law(
        dataclasses.replace(NOISY, duration=0.1), counting, memory=[0], compiled=False
    )
    wanted = run(base)
    assert wanted.rotor_commands[:, 0].tolist() == [471.0 + k for k in range(20)]
    session = Session(base)
    for _ in range(7):
        session.step()
    held = session.snapshot()
    for _ in range(2):
        assert same(session.run(), wanted)
        session.restore(held)
    session.change({"plant.gravity": float(base.plant.gravity)})
    assert same_logs(session.run(), wanted)
    session.restore(held)
    assert same(session.run(), wanted)
    assert base.controller.memory == [0]


def test_parts_may_be_replaced_and_what_has_another_structure_begins_anew() -> None:
    session = Session(NOISY)
    for _ in range(30):
        session.step()
    state = session.state
    other = scenario_from(
        {
            **document("case3_wind"),
            "controller": {"preset": "centroidal_tip"},
            "delays": {"measurement": 0.005, "command": 0.002},
        }
    ).controller
    session.change({"controller.law": "centroidal_tip", "sensors.position": 0.005})
    assert session.state == state
    assert leaves(session._engine.now.agent.memory) == leaves(other.memory)
    assert session.step()
    log = session.run()
    assert (log.status, log.time.size) == ("completed", 100)
    assert log.position[:30].tobytes() == run(NOISY).position[:30].tobytes()


def test_a_snapshot_brings_its_scenario_back() -> None:
    session, wanted = Session(NOISY), run(NOISY)
    for _ in range(10):
        session.step()
    held = session.snapshot()
    session.change({"plant.gravity": 3.0})
    session.run()
    session.restore(held)
    assert session.scenario is NOISY
    assert same(session.run(), wanted)


def test_a_component_that_is_replaced_leaves_the_others_memories() -> None:
    session = Session(ADDED)
    for _ in range(7):
        session.step()
    wind, air, push = session._engine.now.memories
    blowing = {"mode": "moving_air", "turbulence": {"altitude": 6.0, "wind_20ft": 7.7}}
    session.change({"environment.wind": blowing})
    started, *others = session._engine.now.memories
    assert wind == ()
    assert len(leaves(started)) == 5
    assert others == [air, push]
    assert session._engine.now.agent.drives != ((), ())


def test_a_number_that_cannot_be_is_refused_and_nothing_has_changed() -> None:
    session = Session(NOISY)
    session.step()
    for path, words in (
        ("plant.gravty", "no 'gravty' here"),
        ("delays.command", "delays.longest_command is missing"),
    ):
        with pytest.raises(ScenarioError, match=words):
            session.change({path: 1.0})
    for values, words, of_numbers in (
        (
            3,
            r"^values = 3: must be a table",
            r"^values = 3: must be a mapping of paths to numbers$",
        ),
        (
            None,
            r"^values = None: must be a table",
            r"^values = None: must be a mapping",
        ),
        (
            [("plant.gravity", 9.0)],
            r"^values = \[.*\]: must be a table",
            r"^values = \[.*\]: must be a mapping",
        ),
        (
            {3: 4},
            r"^path = 3: must be text",
            r"^path = 3: must be text, as 'plant\.gravity'$",
        ),
        (
            {"x": object()},
            r"^value = <object object at .*>: must be a",
            r"^values\['x'\] = <.*>: must be a number$",
        ),
        (
            {"plant.gravity": "9"},
            r"^value = '9': must be a number",
            r"^values\['plant\.gravity'\] = '9': must be a num",
        ),
        (
            {"plant.payload.mass": object()},
            r"^value = <.*>: must be",
            r"^values\['plant\.payload\.mass'\] = .*: must be",
        ),
        (
            {"initial.joints.0": None},
            r"^value = None: must be",
            r"^values\['initial\.joints\.0'\] = None: must be a num",
        ),
    ):
        with pytest.raises(ScenarioError, match=words):
            session.change(values)
        with pytest.raises(ScenarioError, match=of_numbers):
            with_numbers(NOISY, values)
    with pytest.raises(ScenarioError, match=r"= nan: must be a finite number$"):
        session.change({"plant.gravity": float("nan")})
    assert session.scenario is NOISY
    assert session.tick == 1
    with pytest.raises(ScenarioError, match=r"^scenario = 'case1': must be a Scenario"):
        Session("case1")


def test_the_log_of_what_was_flown_so_far() -> None:
    session, wanted = Session(ADDED), run(ADDED)
    assert session.log.time.size == 0
    for _ in range(7):
        session.step()
    log = session.log
    assert log.time.size == 7
    for name, array in log.arrays().items():
        assert array.tobytes() == wanted.arrays()[name][:7].tobytes(), name
    assert Vec3(*log.position[-1].tolist()) != session.state.position


@pytest.mark.parametrize("plant", ["rigid_body", "mujoco"])
def test_the_log_of_a_session_that_goes_on_says_so(plant: str) -> None:
    session = Session(load_scenario("case3", plant=plant, duration=0.1))
    for _ in range(4):
        session.step()
    log = session.log
    assert (log.status, log.info["end_time"], log.time.size) == ("running", 0.02, 4)
    assert session.run().status == "completed"
