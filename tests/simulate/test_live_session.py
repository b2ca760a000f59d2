"""Numbers that a live session reads in every period: the flight of constants, and nothing compiled."""

import dataclasses

import numpy as np
import pytest

import skyarm
from skyarm.compile.machine_code import NoMachineCodeError
from skyarm.simulate import live_session
from skyarm.simulate.live_session import LiveSession

PATHS = (
    "controller.gains.position.x",
    "environment.wind.force.y",
    "plant.payload.mass",
    "reference.base.position.z",
    "reference.joints.0.amplitude",
    "sensors.position",
)
CHANGES = (
    (120, {"environment.wind.force.y": 1.5, "sensors.position": 0.004}),
    (200, {"plant.payload.mass": 0.03}),
    (260, {"reference.base.position.z": 1.3, "controller.gains.position.x": 6.0}),
    (300, {"plant.payload.mass": 0.05, "environment.wind.force.y": 0.0}),
    (330, {"reference.joints.0.amplitude": 0.5}),
)


@pytest.fixture(scope="module")
def scenario() -> skyarm.Scenario:
    hover = skyarm.load_scenario("case2", duration=2.0, seed=5)
    wind = skyarm.ForceWind(force_W=(0, 0, 0))
    joints = tuple(
        dataclasses.replace(joint, start=0.5, signal=dataclasses.replace(joint.signal, delay=0.5))
        for joint in hover.reference.joints
    )
    motion = skyarm.hover((0.0, 0.0, 1.0), joints=joints)
    return dataclasses.replace(hover, wind=wind, reference=motion)


def flown(session: skyarm.Session | LiveSession) -> np.ndarray:
    """Every state of a flight under the changes."""
    rows, coming = [], dict(CHANGES)
    while session.running:
        if session.tick in coming:
            session.change(coming[session.tick])
        session.step()
        state = session.state
        rows.append([*state.position, *state.quaternion, *state.velocity, *state.rate, *state.joints])
    return np.array(rows)


@pytest.fixture(scope="module")
def constants(scenario: skyarm.Scenario) -> np.ndarray:
    return flown(skyarm.Session(scenario))


def test_numbers_that_are_read_fly_the_bits_of_constants(scenario, constants, monkeypatch) -> None:
    session = LiveSession(scenario, PATHS)

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("a change compiles machine code")

    monkeypatch.setattr(live_session, "EpisodeCode", refuse)
    assert (flown(session) == constants).all()


def test_a_changed_number_changes_the_flight(scenario, constants) -> None:
    still = LiveSession(scenario, PATHS)
    while still.step():
        pass
    assert not np.allclose(still.log.position[-1], constants[-1, :3], atol=1e-3)


def test_a_way_back_restores_numbers_and_flight(scenario) -> None:
    session = LiveSession(scenario, PATHS)
    for _ in range(100):
        session.step()
    before = session.snapshot()
    session.change({"environment.wind.force.y": 2.0})
    for _ in range(100):
        session.step()
    pushed = session.state.position
    later = session.snapshot()
    session.restore(before)
    assert session.scenario.wind.force_W.y == 0.0
    for _ in range(100):
        session.step()
    assert abs(session.state.position.y - pushed.y) > 1e-3
    calm = session.log.position
    session.restore(later)
    assert session.state.position == pushed
    assert session.scenario.wind.force_W.y == 2.0
    # what was flown since does not stand in the log of the snapshot
    assert (session.log.position[:100] == calm[:100]).all()
    assert not (session.log.position[150:] == calm[150:]).all()


def test_another_friction_flies_in_the_steps_it_needs(scenario) -> None:
    path = "plant.joints.damping"
    session, constant = LiveSession(scenario, [path]), skyarm.Session(scenario)
    for each in (session, constant):
        for _ in range(20):
            each.step()
        each.change({path: 0.4})
        for _ in range(100):
            each.step()
    assert session.state == constant.state


@pytest.mark.parametrize("path", ["plant.nothing", "rates.control", "controller.gains"])
def test_a_path_that_leads_to_no_number_is_refused(scenario, path: str) -> None:
    with pytest.raises(skyarm.ScenarioError, match="path"):
        LiveSession(scenario, [path])


def test_a_number_that_cannot_be_leaves_the_session_as_it_was(scenario) -> None:
    session = LiveSession(scenario, PATHS)
    with pytest.raises(ValueError, match="at least 0"):
        session.change({"sensors.position": -1.0})
    session.step()
    assert session.scenario.noise.position == 0.0


def with_changes(scenario: skyarm.Scenario, *changes: tuple[float, str, float], **fields: object) -> skyarm.Scenario:
    made = tuple(skyarm.Change(at=at, path=path, value=value) for at, path, value in changes)
    return dataclasses.replace(scenario, duration=0.3, changes=made, **fields)


def flown_alone(session: LiveSession) -> LiveSession:
    while session.step():
        pass
    return session


@pytest.mark.parametrize(
    ("path", "other", "value"),
    [
        ("reference.z", "reference.base.z", 1.3),
        ("reference.base.position.2", "reference.base.position.z", 1.3),
        ("environment.faults.0.effectiveness", "environment.faults.front.effectiveness", 0.9),
    ],
)
def test_a_scheduled_change_may_name_a_number_of_the_session_in_other_words(
    scenario, path: str, other: str, value: float
) -> None:
    faults = (skyarm.Fault(rotor="front", effectiveness=1.0, start=0.0),)
    changed = with_changes(scenario, (0.1, path, value), faults=faults)
    log = flown_alone(LiveSession(changed, [other])).log
    assert log.position.tobytes() == skyarm.run(changed).position.tobytes()
    still = dataclasses.replace(changed, changes=())
    assert log.position.tobytes() != skyarm.run(still).position.tobytes()


def test_a_scheduled_change_of_several_numbers_of_which_one_is_a_path_is_flown_by_a_session(scenario) -> None:
    joint = scenario.plant.vehicle.links[0].name
    changed = with_changes(scenario, (0.1, "plant.joints.damping", 0.02))
    with pytest.raises(NoMachineCodeError, match="is the same number as"):
        LiveSession(changed, [f"plant.vehicle.links.{joint}.joint.damping"])


def test_the_scenario_of_a_log_flies_it_again_with_schedule_and_hand(scenario) -> None:
    """The moves of a hand are changes of it, at their instants; those that were taken back are none."""
    changed = with_changes(scenario, (0.1, "plant.gravity", 10.0))
    session = LiveSession(changed, PATHS)
    alone = flown_alone(session).log
    assert alone.position.tobytes() == skyarm.run(changed).position.tobytes()
    assert alone.scenario == changed
    session = LiveSession(changed, PATHS)
    for _ in range(50):
        session.step()
    before = session.snapshot()
    session.step()
    session.change({"environment.wind.force.y": 3.0})
    session.step()
    session.restore(before)
    session.change({"environment.wind.force.y": 2.0})
    session.change({"environment.wind.force.y": 1.0})
    log = flown_alone(session).log
    assert [(each.at, each.path, each.value) for each in log.scenario.changes] == [
        (0.1, "plant.gravity", 10.0),
        (50 / scenario.rates.control, "environment.wind.force.y", 1.0),
    ]
    assert log.position.tobytes() == skyarm.run(log.scenario).position.tobytes() != alone.position.tobytes()
