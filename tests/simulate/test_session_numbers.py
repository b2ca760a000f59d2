"""Numbers that a session reads in every period: the flight of constants, and nothing
compiled.
"""

import dataclasses

import numpy as np
import pytest

import skyarm
from skyarm.simulate import flight_programs
from support.flights import document

PATHS = (
    "controller.gains.position.x",
    "environment.wind.force.y",
    "plant.payload.mass",
    "reference.base.position.z",
    "reference.joints.0.amplitude",
)
CHANGES = (
    (120, {"environment.wind.force.y": 1.5}),
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
        dataclasses.replace(
            joint, start=0.5, signal=dataclasses.replace(joint.signal, delay=0.5)
        )
        for joint in hover.reference.joints
    )
    motion = skyarm.hover((0.0, 0.0, 1.0), joints=joints)
    return dataclasses.replace(hover, wind=wind, reference=motion)


def flown(session: skyarm.Session) -> np.ndarray:
    """Every state of a flight under the changes."""
    rows, coming = [], dict(CHANGES)
    while session.running:
        if session.tick in coming:
            session.change(coming[session.tick])
        session.step()
        state = session.state
        rows.append(
            [
                *state.position,
                *state.quaternion,
                *state.velocity,
                *state.rate,
                *state.joints,
            ]
        )
    return np.array(rows)


@pytest.fixture(scope="module")
def constants(scenario: skyarm.Scenario) -> np.ndarray:
    return flown(skyarm.Session(scenario))


def test_numbers_that_are_read_fly_the_bits_of_constants(
    scenario, constants, monkeypatch
) -> None:
    session = skyarm.Session(scenario, PATHS)

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("a change compiles machine code")

    monkeypatch.setattr(flight_programs, "EpisodeCode", refuse)
    assert (flown(session) == constants).all()


def test_a_changed_number_changes_the_flight(scenario, constants) -> None:
    still = skyarm.Session(scenario, PATHS)
    while still.step():
        pass
    assert not np.allclose(still.log.position[-1], constants[-1, :3], atol=1e-3)


def test_a_way_back_restores_numbers_and_flight(scenario) -> None:
    session = skyarm.Session(scenario, PATHS)
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
    session, constant = skyarm.Session(scenario, [path]), skyarm.Session(scenario)
    for each in (session, constant):
        for _ in range(20):
            each.step()
        each.change({path: 0.4})
        for _ in range(100):
            each.step()
    assert session.state == constant.state


def test_a_number_that_cannot_be_leaves_the_session_as_it_was(scenario) -> None:
    session = skyarm.Session(scenario, PATHS)
    with pytest.raises(ValueError, match="at least 0"):
        session.change({"plant.payload.mass": -1.0})
    session.step()
    assert session.plan == scenario


@pytest.mark.parametrize(
    "path",
    ["environment.faults.0.effectiveness", "environment.faults.front.effectiveness"],
)
@pytest.mark.parametrize(
    "other",
    ["environment.faults.0.effectiveness", "environment.faults.front.effectiveness"],
)
def test_a_change_and_an_adjustable_number_may_name_one_place_in_two_ways(
    path: str, other: str
) -> None:
    """The studio names faults by actuator, a file's change by place: the change once
    was lost.
    """
    tables = document("case1", duration=0.1)
    tables["environment"] = {
        "faults": [{"rotor": "front", "effectiveness": 1.0, "start": 0.0}]
    }
    weaker = skyarm.scenario_from(
        {**tables, "changes": [{"at": 0.05, "path": path, "value": 0.9}]}
    )
    wanted = skyarm.run(weaker).position
    assert np.array_equal(skyarm.Session(weaker, [other]).run().position, wanted)
    assert wanted[-1, 2] < skyarm.run(skyarm.scenario_from(tables)).position[-1, 2]


@pytest.mark.parametrize("other", ["plant.payload.tip.mass", "plant.payload.mass"])
def test_a_load_that_is_changed_may_have_two_names(other: str) -> None:
    """A load scheduled by one name was lost beside an adjustable one by the other."""
    tables = document("case1", duration=0.1)
    path = "plant.payload.tip.mass"
    heavier = skyarm.scenario_from(
        {**tables, "changes": [{"at": 0.05, "path": path, "value": 0.1}]}
    )
    wanted = skyarm.run(heavier).position
    assert np.array_equal(skyarm.Session(heavier, [other]).run().position, wanted)
    assert wanted[-1, 2] < skyarm.run(skyarm.scenario_from(tables)).position[-1, 2]
