"""A scenario that changes in flight flies alike in a run, in a session led by hand, in
Python floats and in a batch.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np
import pytest

from skyarm import Delays, Scenario, ScenarioError, Session, run, scenario_from
from skyarm.log.flight_log import Log
from skyarm.plant.surroundings import Memories
from skyarm.scenario.in_flight import is_traceable, require_changes
from skyarm.scenario.numbers import number_at, with_numbers
from skyarm.scenario.scenario_record import Change
from skyarm.sensing.measurement import SensorNoise
from skyarm.simulate.batch import Batch
from skyarm.simulate.first_state import first_loop_state
from skyarm.simulate.loop import run_in_python
from skyarm.simulate.loop_state import LoopState, carry_over
from skyarm.vehicle.battery import Battery, CellCurve
from support.components import same_logs
from support.flights import document, estimated, shared_programs

GAIN = "controller.gains.position.x"
PAYLOAD = "plant.payload.mass"
BASE = scenario_from(
    document(
        "case3_wind",
        duration=0.3,
        sensors={"position": 0.001},
        delays={"measurement": 0.005, "command": 0.002},
    )
)
WIND = {
    "mode": "moving_air",
    "velocity": [3.0, 0.0, 0.0],
    "turbulence": {"altitude": 6.0, "wind_20ft": 7.7},
}
CHANGES = (
    Change(at=0.05, path=GAIN, value=3.0),
    Change(at=0.101, path="controller.law", value="centroidal_tip"),
    Change(at=0.15, path=PAYLOAD, value=0.05),
    Change(at=0.2, path=PAYLOAD, value=0.02),
    Change(
        at=0.15,
        path="reference.base",
        value={"kind": "hover", "position": [0.0, 0.0, 1.2]},
    ),
    Change(at=0.2, path="environment.wind", value=WIND),
)


@pytest.fixture(autouse=True, scope="module")
def _shared() -> Iterator[None]:
    with shared_programs():
        yield


def changing(*changes: Change, base: Scenario = BASE) -> Scenario:
    return dataclasses.replace(base, changes=changes)


def by_hand(scenario: Scenario) -> Session:
    """A session of the scenario without its changes, which a hand makes at their
    instants.
    """
    session = Session(dataclasses.replace(scenario, changes=()))
    coming = sorted(scenario.changes, key=lambda change: change.at)
    while True:
        while coming and coming[0].at <= session.time:
            session.change({coming[0].path: coming[0].value})
            coming = coming[1:]
        if not session.step():
            return session


def equal(a: Log, b: Log, rows: slice) -> bool:
    ours, theirs = a.arrays(), b.arrays()
    return all(
        ours[name][rows].tobytes() == theirs[name][rows].tobytes() for name in ours
    )


@pytest.fixture(scope="module")
def flown() -> Log:
    return run(changing(*CHANGES))


@pytest.fixture(scope="module")
def still() -> Log:
    return run(BASE)


def test_a_run_is_a_session_led_by_hand_and_the_session_says_how_to_fly_it_again(
    flown: Log,
) -> None:
    session = by_hand(changing(*CHANGES))
    assert same_logs(session.log, flown)
    plan = session.plan
    assert [(c.path, c.value) for c in plan.changes] == [
        (c.path, c.value) for c in sorted(CHANGES, key=lambda change: change.at)
    ]
    assert [c.at for c in plan.changes] == [0.05, 0.105, 0.15, 0.15, 0.2, 0.2]
    # what a log keeps is flown again from the log alone
    again = session.log.scenario
    assert again == plan
    assert same_logs(run(again), flown)


@pytest.mark.thorough
def test_a_run_in_python_floats_has_the_same_bits(flown: Log) -> None:
    assert same_logs(run_in_python(changing(*CHANGES)), flown)


@pytest.mark.thorough
def test_mujocos_plant_flies_changes_as_a_session_of_it_does() -> None:
    pytest.importorskip("mujoco")
    scenario = dataclasses.replace(changing(*CHANGES), kind="mujoco")
    log = run(scenario)
    assert same_logs(by_hand(scenario).log, log)
    assert log.status == "completed"
    assert not np.array_equal(
        log.position, run(dataclasses.replace(scenario, changes=())).position
    )


def test_a_log_has_the_references_and_the_wind_that_held_in_each_period(
    flown: Log, still: Log
) -> None:
    assert flown.position_held[[29, 30], 2].tolist() == [1.0, 1.2]
    assert flown.position_reference[[29, 30], 2].tolist() == [1.0, 1.2]
    assert flown.tool_held[30, 2] - flown.tool_held[29, 2] == pytest.approx(0.2)
    assert flown.wind_force[0].tolist() == still.wind_force[0].tolist()
    # 2 N and the drag of 2 m/s at the rotors; then the drag of moving air alone
    assert flown.wind_force[[38, 39], 0] == pytest.approx(2.33, abs=0.05)
    assert flown.wind_force[40, 0] == pytest.approx(
        0.17 * flown.air_velocity[40, 0], rel=0.2
    )
    assert flown.air_velocity[39].tolist() == still.air_velocity[39].tolist()
    assert flown.air_velocity[40, 0] > 1.5


def test_a_motion_that_a_change_brings_is_logged_at_its_own_instants() -> None:
    """Times count from the beginning of the flight; the held reference is that of the
    last 20 ms.
    """
    circle = {
        "kind": "circle",
        "radius": 0.5,
        "frequency_hz": 1.0,
        "center": [0.0, 0.0, 1.0],
    }
    log = run(changing(Change(at=0.1, path="reference.base", value=circle)))
    for k in (20, 33, 59):
        turned, held = 2.0 * np.pi * k / 200, 2.0 * np.pi * (k - k % 4) / 200
        assert log.position_reference[k, :2] == pytest.approx(
            0.5 * np.array([np.cos(turned), np.sin(turned)])
        )
        assert log.position_held[k, :2] == pytest.approx(
            0.5 * np.array([np.cos(held), np.sin(held)])
        )
        assert log.velocity_held[k, :2] == pytest.approx(
            np.pi * np.array([-np.sin(held), np.cos(held)])
        )
    assert log.time.tolist() == [k / 200 for k in range(60)]


@pytest.mark.parametrize("k", [0, 1, 7, 59])
def test_until_a_change_takes_hold_nothing_is_other(k: int, still: Log) -> None:
    """The state at the beginning of its period still is the old one; the command of
    that period is the new law's.
    """
    log = run(changing(Change(at=k / 200, path=GAIN, value=30.0)))
    assert equal(log, still, slice(k))
    assert log.position[k].tobytes() == still.position[k].tobytes()
    assert not np.array_equal(log.rotor_commands[k], still.rotor_commands[k])


def test_a_change_at_the_beginning_is_a_scenario_with_that_number() -> None:
    """But for the start, which is that of the scenario as it began: hover trim does not
    depend on a gain.
    """
    assert same_logs(
        run(changing(Change(at=0.0, path=GAIN, value=3.0))),
        run(with_numbers(BASE, {GAIN: 3.0})),
    )
    heavy = run(changing(Change(at=0.0, path=PAYLOAD, value=0.1)))
    assert heavy.rotor_speeds[0].tobytes() == run(BASE).rotor_speeds[0].tobytes()


def test_lanes_that_change_at_the_beginning_start_as_the_scenario_began() -> None:
    """Rotors turn at the hover of the vehicle without the payload, as in a run."""
    scenario = changing(
        Change(at=0.0, path=PAYLOAD, value=0.1), Change(at=0.0, path=GAIN, value=5.0)
    )
    log = run(scenario)
    assert log.rotor_speeds[0].tobytes() == run(BASE).rotor_speeds[0].tobytes()
    flown = Batch(scenario, metrics=("standard",), bit_exact=True, effort=0).fly(
        {}, episodes=np.array([0]), seed=BASE.seed
    )
    session = Session(scenario)
    session.run()
    assert [float(each[0]) for each in flown.state.position] == list(
        session.state.position
    )
    assert [float(each[0]) for each in flown.state.rotor_speeds] == list(
        session.state.rotor_speeds
    )


def test_a_change_to_what_it_was_changes_nothing(still: Log) -> None:
    own = float(BASE.controller.par.gains.position.x)
    changes = (
        Change(at=0.1, path=GAIN, value=own),
        Change(at=0.2, path=PAYLOAD, value=0.0),
    )
    assert same_logs(run(changing(*changes)), still)


def test_a_fault_that_a_change_brings_is_a_fault_with_that_start() -> None:
    """Another mechanism for the same flight: what a fault leaves is counted from its
    own start.
    """
    fault = {"rotor": "front", "effectiveness": 0.8}
    wanted = scenario_from(
        document(
            "case3_wind", duration=0.3, environment__faults=[{**fault, "start": 0.1}]
        )
    )
    bare = dataclasses.replace(wanted, faults=())
    found = run(
        changing(Change(at=0.1, path="environment.faults", value=[fault]), base=bare)
    )
    assert found.position == pytest.approx(run(wanted).position, abs=1e-12)
    assert not np.allclose(found.position[40:], run(bare).position[40:], atol=1e-6)


def test_a_force_that_a_change_sets_is_a_gust_with_that_start() -> None:
    wind = {"mode": "force_wind", "force": [2.0, 0.0, 0.0]}
    gust = {"force": [1.0, 0.0, 0.0], "start": 0.1, "duration": 5.0}
    wanted = run(
        scenario_from(
            document(
                "case3_wind", duration=0.3, environment__wind={**wind, "gust": gust}
            )
        )
    )
    bare = scenario_from(document("case3_wind", duration=0.3, environment__wind=wind))
    found = run(
        changing(Change(at=0.1, path="environment.wind.force.0", value=3.0), base=bare)
    )
    assert found.position == pytest.approx(wanted.position, abs=1e-12)
    assert found.wind_force.tolist() == wanted.wind_force.tolist()


def test_a_payload_that_is_dropped_leaves_the_vehicle_as_it_was() -> None:
    session = Session(
        changing(
            Change(at=0.05, path=PAYLOAD, value=0.1),
            Change(at=0.1, path=PAYLOAD, value=0.0),
        )
    )
    masses = []
    while session.step():
        masses.append(session.scenario.plant.vehicle.links[-1].body.mass)
    own = BASE.plant.vehicle.links[-1].body.mass
    assert set(masses[:9]) == {own} == set(masses[19:])
    assert masses[9:19] == pytest.approx([own + 0.1] * 10)
    # by hand too: a slider sets the payload, and does not pile it up
    session = Session(BASE)
    for mass in (0.1, 0.2, 0.05):
        session.change({PAYLOAD: mass})
    assert session.scenario.plant.vehicle.links[-1].body.mass == pytest.approx(
        own + 0.05
    )


def test_changes_by_hand_join_scheduled_ones_and_a_snapshot_goes_behind_both() -> None:
    session = Session(changing(Change(at=0.2, path=GAIN, value=9.0)))
    for _ in range(10):
        session.step()
    held = session.snapshot()
    session.change({GAIN: 5.0, "controller.law": "paper_pd"})
    assert [each.at for each in session.plan.changes] == [
        0.05,
        0.05,
        0.2,
    ], "as they take hold"
    with pytest.raises(
        ScenarioError, match=r"^path = 'controller.gain': no 'gain' here"
    ):
        session.change({"plant.gravity": 9.0, "controller.gain": 1.0})
    log = session.run()
    assert [(c.at, c.path) for c in session.plan.changes] == [
        (0.05, GAIN),
        (0.05, "controller.law"),
        (0.2, GAIN),
    ]
    assert same_logs(run(session.plan), log)
    session.restore(held)
    assert session.scenario.changes == (Change(at=0.2, path=GAIN, value=9.0),)
    assert same_logs(session.run(), run(changing(Change(at=0.2, path=GAIN, value=9.0))))


@pytest.mark.parametrize(
    ("coming", "by_hand", "words"),
    [
        (
            GAIN,
            {"controller.law": "centroidal_tip"},
            rf"path = '{GAIN}': no 'gains' here",
        ),
        (
            "environment.wind.force.x",
            {"environment.wind": WIND},
            r"path = 'environment.wind.force.x': no 'force' here",
        ),
    ],
)
def test_a_hand_that_makes_a_change_to_come_impossible_is_refused(
    coming: str, by_hand: object, words: str
) -> None:
    scenario = changing(Change(at=0.1, path=coming, value=3.0))
    session = Session(scenario, machine_code=False)
    for _ in range(10):
        session.step()
    with pytest.raises(
        ScenarioError, match=rf"^after this the change at 0.1 s cannot be made: {words}"
    ):
        session.change(by_hand)  # type: ignore[arg-type]
    assert session.plan is scenario
    # once it has been made nothing stands against it
    while session.tick < 21:
        session.step()
    session.change(by_hand)  # type: ignore[arg-type]
    assert [change.path for change in session.plan.changes] == [coming, *by_hand]  # type: ignore[has-type]


def test_a_session_that_has_ended_cannot_be_changed() -> None:
    session = Session(
        changing(Change(at=0.05, path="plant.gravity", value=400.0)), machine_code=False
    )
    log = session.run()
    assert log.status == "ground"
    # a change at this instant would come before the ending in a flight of the plan
    with pytest.raises(
        ScenarioError, match=r"^session: has ended; there is no next period"
    ):
        session.change({"environment.ground": False})
    assert same_logs(run(session.plan), log)


def test_a_number_that_is_changed_again_compiles_nothing() -> None:
    session = Session(BASE)
    for value in (3.0, 4.0, 3.0, 5.0):
        session.change({GAIN: value})
        session.step()
        session.change({PAYLOAD: 0.01 * value})
        session.step()
    # as it began, with the gain, with the gain and the payload
    assert len(session._programs.codes) == 3
    named = Session(BASE, (GAIN, PAYLOAD, "reference.yaw.value"))
    for path, value in ((PAYLOAD, 0.03), (GAIN, 3.0), (PAYLOAD, 0.01), (GAIN, 5.0)):
        named.change({path: value})
        named.step()
    assert len(named._programs.codes) == 1, (
        "paths that are named from the start are parameters from the start"
    )


@pytest.mark.parametrize("machine_code", [True, False])
def test_a_snapshot_keeps_the_numbers_that_held(machine_code: bool) -> None:
    """A number that is changed after it, by the same code, is what it was once a
    session has gone back.
    """
    session = Session(BASE, (GAIN,), machine_code=machine_code)
    for _ in range(5):
        session.step()
    held, wanted = session.snapshot(), None
    for value in (9.0, 2.0):
        session.change({GAIN: value})
        session.step()
        session.step()
        session.restore(held)
        session.step()
        session.step()
        wanted = wanted or run(BASE).position[6].tolist()
        assert session.log.position[6].tolist() == wanted
        session.restore(held)


def test_memories_of_components_go_on_by_their_place() -> None:
    first = first_loop_state(BASE)

    def loop(*memories: float) -> LoopState:
        return first.with_agent(dataclasses.replace(first.agent, components=memories))

    def carried(fresh: LoopState, *places: str) -> Memories:
        old = (("wind", "air[0]", "force"),), ()
        found = carry_over(fresh, loop(5.0, 6.0, 7.0), (((places,), ()), old), [()])
        assert found.components == ()
        return found.agent.components

    # a second air is new, and the force behind it is the one of before
    assert carried(loop(0.0, 0.1, 0.2, 0.3), "wind", "air[0]", "air[1]", "force") == (
        5.0,
        6.0,
        0.2,
        7.0,
    )
    # an air that is gone leaves the force its own
    assert carried(loop(0.0, 0.3), "wind", "force") == (5.0, 7.0)
    # those that all vehicles share go on as well
    fresh, before = (
        dataclasses.replace(loop(), components=each) for each in ((0.1, 0.2), (5.0,))
    )
    places = (((),), ("air[0]", "world")), (((),), ("world",))
    assert carry_over(fresh, before, places, [()]).components == (0.1, 5.0)


def test_a_law_that_cannot_be_traced_flies_alone_and_in_no_batch() -> None:
    scenario = changing(Change(at=0.1, path="controller.law", value="nmpc"))
    assert is_traceable(BASE)
    assert not is_traceable(scenario)
    with pytest.raises(
        ValueError,
        match=(
            r"^controller 'nmpc': its law cannot be traced, a batch needs a traceable"
        ),
    ):
        Batch(scenario)


def test_progress_is_told_of_a_flight_that_changes() -> None:
    reports: list[tuple[int, int]] = []
    run(changing(CHANGES[0]), lambda done, total: reports.append((done, total)))
    assert reports[0] == (0, 60)
    assert reports[-1] == (60, 60)
    assert sorted(reports) == reports


def test_an_ending_after_a_change_says_when_and_under_which_number() -> None:
    log = run(
        changing(Change(at=0.1, path="plant.vehicle.links.0.joint.upper", value=-0.5))
    )
    assert (log.status, log.info["end_time"], log.time.size) == ("joint_limit", 0.1, 20)
    assert "0.5" in log.info["cause"]


# batches


PATHS = (GAIN, "plant.vehicle.base.mass", "changes.3.value", "environment.wind.force.0")


@pytest.fixture(scope="module")
def batch() -> Batch:
    return Batch(
        changing(*CHANGES),
        PATHS,
        metrics=("standard",),
        bit_exact=True,
        log_every=7,
        effort=0,
    )


VALUES = {
    GAIN: np.array([4.0, 5.0, 6.0]),
    "plant.vehicle.base.mass": np.array([0.55, 0.6, 0.65]),
    "changes.3.value": np.array([0.02, 0.06, 0.01]),
    "environment.wind.force.0": np.array([2.0, 1.0, 3e4]),
}


def test_a_batch_is_a_loop_of_runs(batch: Batch) -> None:
    """Lane 2 is blown away, and ends by itself while the others fly on under other
    laws.
    """
    outcome = batch.fly(VALUES, seed=3)
    assert outcome.log is not None
    for k in (0, 2):
        numbers = {path: float(column[k]) for path, column in VALUES.items()}
        log = run(
            dataclasses.replace(
                with_numbers(changing(*CHANGES), numbers), seed=3, episode=k
            )
        )
        assert (outcome.status[k], outcome.end_time[k]) == (
            log.status,
            log.info["end_time"],
        )
        rows = slice(0, log.time.size, 7)
        for ours, theirs in (
            (outcome.log.state.position.z, log.position[rows, 2]),
            (outcome.log.state.joints[1], log.joints[rows, 1]),
            (outcome.log.command.rotor_speeds[0], log.rotor_commands[rows, 0]),
            (outcome.log.reference.position.z, log.position_held[rows, 2]),
        ):
            assert (
                np.array(ours)[k, : theirs.size].tobytes()
                == np.ascontiguousarray(theirs).tobytes()
            )
        if log.status == "completed":
            # after the first third
            error = np.linalg.norm(log.position - log.position_held, axis=1)[20:]
            assert outcome.metrics["position_error_mean"][k] == pytest.approx(
                error.mean(), rel=1e-12
            )
    assert list(outcome.status[:2]) == ["completed"] * 2
    assert outcome.status[2] != "completed"


def test_what_a_change_sets_wins_over_the_lanes_own_number_and_may_vary_itself(
    batch: Batch,
) -> None:
    same = {path: np.full(2, column[0]) for path, column in VALUES.items()}
    wanted = np.array(batch.fly(same, episodes=np.zeros(2, int)).state.position.x)
    # another gain of the start: the flight is another; from the new law on it is not
    # asked any more
    assert wanted[0] == wanted[1]
    for path, value in ((GAIN, 9.0), ("changes.3.value", 0.2)):
        column = same[path].copy()
        column[1] = value
        found = np.array(
            batch.fly(same | {path: column}, episodes=np.zeros(2, int)).state.position.x
        )
        assert found[0] == wanted[0]
        assert found[1] != wanted[1]


def test_changes_that_differ_in_numbers_alone_share_their_code() -> None:
    many = [Change(at=0.01 * k, path=GAIN, value=4.0 + 0.1 * k) for k in range(1, 25)]
    found = Batch(changing(*many), metrics=("standard",), bit_exact=True, effort=0)
    assert len({id(leg.code) for leg in found._legs}) == 2
    outcome = found.fly({}, episodes=np.array([0]), seed=BASE.seed)
    assert np.array(outcome.state.position.x)[0] != run(BASE).position[-1, 0]


@pytest.mark.parametrize(
    ("path", "change", "words"),
    [
        (
            PAYLOAD,
            Change(at=0.1, path=PAYLOAD, value=0.1),
            r"adds to changes\[0\].path = 'plant.payload.mass'; vary",
        ),
        (
            "plant.payload.tip.mass",
            Change(at=0.1, path=PAYLOAD, value=0.1),
            r"adds to changes\[0\].path = 'plant.payl",
        ),
        (
            "model.vehicle.base.mass",
            CHANGES[1],
            r"must not vary, since the law of changes\[0\].path = 'controller.law'",
        ),
    ],
)
def test_what_code_for_all_lanes_cannot_do_is_refused(
    path: str, change: Change, words: str
) -> None:
    with pytest.raises(ScenarioError, match=rf"^path = '{path}': {words}"):
        Batch(changing(change), (path,))


def test_lanes_whose_change_cannot_be_are_refused(batch: Batch) -> None:
    wrong = VALUES | {"changes.3.value": np.array([0.02, -9.0, 0.01])}
    with pytest.raises(
        ScenarioError, match=r"^values\['changes.3.value'\] = -9 \(lane 1\): "
    ):
        batch.fly(wrong)


def test_noise_that_a_change_turns_up_is_drawn_from_then_on() -> None:
    quiet = dataclasses.replace(BASE, noise=SensorNoise(), delays=Delays())
    log = run(changing(Change(at=0.1, path="sensors.position", value=0.01), base=quiet))
    noise = np.abs(log.measured_position - log.position).max(axis=1)
    assert not noise[:20].any()
    assert noise[20:].min() > 0.0


def test_friction_that_asks_for_shorter_steps_gets_them_by_a_number_alone() -> None:
    """The same paths, other values: code is shared only where it is integrated in the
    same steps.
    """
    path = "plant.joints.damping"
    changes = [
        Change(at=0.02 * k, path=path, value=value)
        for k, value in ((1, 0.002), (2, 0.2), (3, 0.004))
    ]
    scenario = changing(*changes, base=dataclasses.replace(BASE, duration=0.1))
    session = Session(scenario)
    while session.step():
        pass
    assert len(session._programs.codes) == 3, (
        "as it began, in usual steps, in short ones"
    )
    assert same_logs(session.log, run_in_python(scenario))


def test_numbers_that_are_named_before_compile_nothing_when_they_change() -> None:
    named, plain = Session(BASE, [GAIN, PAYLOAD, "sensors.position"]), Session(BASE)
    for tick, values in (
        (10, {GAIN: 5.0}),
        (20, {PAYLOAD: 0.1, "sensors.position": 0.01}),
        (25, {GAIN: 4.5}),
    ):
        for session in (named, plain):
            while session.tick < tick:
                session.step()
            session.change(values)
    assert same_logs(named.run(), plain.run())
    assert (len(named._programs.codes), len(plain._programs.codes)) == (1, 3)
    with pytest.raises(ScenarioError, match=r"is the same number as"):
        Session(BASE, [GAIN, "controller.gains.position.0"])


def test_a_batch_begins_as_its_scenario_did_before_a_change_in_the_first_period() -> (
    None
):
    scenario = changing(
        Change(at=0.0, path=PAYLOAD, value=0.1),
        base=dataclasses.replace(BASE, duration=0.1),
    )
    outcome = Batch(scenario, bit_exact=True, log_every=1, effort=0).fly(
        {}, episodes=np.array([0])
    )
    log = run(scenario)
    assert outcome.log is not None
    assert (
        np.array(outcome.log.state.position.z)[0].tobytes()
        == np.ascontiguousarray(log.position[:, 2]).tobytes()
    )
    assert log.rotor_speeds[0, 0] == run(BASE).rotor_speeds[0, 0]


def test_a_batch_that_changes_between_two_samples_keeps_every_sample() -> None:
    hover = {"base": {"kind": "hover", "position": [0.0, 0.0, 1.0]}}
    made = {
        "schema": 1,
        "name": "bare",
        "duration": 0.08,
        "plant": {"vehicle": "hummingbird"},
        "reference": hover,
    }
    bare = scenario_from(made | {"controller": {"preset": "centroidal_joint"}})
    scenario = changing(Change(at=0.025, path="plant.gravity", value=9.0), base=bare)
    outcome = Batch(scenario, log_every=2, effort=0).fly({}, episodes=np.array([0]))
    assert outcome.log is not None
    assert outcome.log.time == pytest.approx(0.01 * np.arange(8))
    assert np.array(outcome.log.state.position.z).shape == (1, 8)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("sensors.imu.gyro.turn_on", 0.1),
        ("plant.vehicle.battery.charge", 0.2),
        ("estimator.first_velocity", 0.5),
        ("world.objects.ball.position.z", 1.0),
    ],
)
def test_a_number_that_is_read_as_a_flight_begins_does_not_change_in_flight(
    path, value
):
    ball = {
        "name": "ball",
        "shape": "box",
        "size": [0.1, 0.1, 0.1],
        "mass": 0.1,
        "position": [0.0, 3.0, 0.1],
    }
    begun = estimated(world={"objects": [ball]})
    curve = CellCurve(charge=(0.0, 1.0), voltage=(3.3, 4.2))
    pack = Battery(
        cells=3,
        capacity=1.0,
        resistance=0.05,
        open_circuit=curve,
        reference_voltage=12.6,
    )
    vehicle = dataclasses.replace(begun.plant.vehicle, battery=pack)
    begun = dataclasses.replace(
        begun, plant=dataclasses.replace(begun.plant, vehicle=vehicle)
    )
    assert number_at(with_numbers(begun, {path: value}), path) == value
    with pytest.raises(
        ScenarioError, match="must be as the flight began, where alone it is read"
    ):
        require_changes(
            dataclasses.replace(
                begun, changes=(Change(at=0.05, path=path, value=value),)
            )
        )
