"""The studio's loop without a page: time, the way back, laws beside each other, pushes,
and what is saved.
"""

import dataclasses
import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.records.files import read_toml
from skyarm.records.path_names import agent_of
from skyarm.reference.planned_motion import PlannedBody
from skyarm.reference.signals import Constant
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.payload_tables import scheduled_changes
from skyarm.scenario.scenario_file import LIBRARY, list_scenarios
from skyarm.simulate.first_state import first_loop_state
from skyarm.view.picture.frames import scenes_at
from skyarm.view.studio.clock import Clock
from skyarm.view.studio.fleet import (
    LONGEST,
    Fleet,
    Flight,
    FlownAgent,
    pushes_of,
)
from skyarm.view.studio.knobs import knobs_of
from skyarm.view.studio.sights import sights
from skyarm.world import TimedPayload
from skyarm.world.scene.scene import Scene
from support.cases import sampled, toml_text
from support.teams import TEAMS

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"


@pytest.fixture(scope="module")
def made() -> Fleet:
    fleet = Fleet("case2_gust")
    for law in ("paper_ct", "paper_pd"):
        fleet.join(fleet.make_flight(law))
    return fleet


@pytest.fixture
def fleet(made: Fleet) -> Fleet:
    made.speed = 1.0
    made.reset()
    return made


def states(flight: Flight) -> np.ndarray:
    """Base, attitude and joints as they were flown so far."""
    return states_of(flight.session.log)


def states_of(log: skyarm.Log) -> np.ndarray:
    """Base, attitude and joints of all vehicles of a log."""
    names = "position", "quaternion", "velocity", "joints", "rotor_commands"
    return np.hstack([own[name] for own in log.agents.values() for name in names])


def test_an_untouched_flight_is_the_scenarios_own(fleet: Fleet) -> None:
    fleet.go(1700)  # into the gust of the file
    for flight in fleet.flights:
        plain = skyarm.run(
            skyarm.load_scenario("case2_gust", controller=flight.law, duration=8.5)
        )
        assert (states(flight)[:, :3] == plain.position).all()
        assert (flight.session.log.rotor_commands == plain.rotor_commands).all()


@pytest.mark.parametrize(
    ("speed", "ticks"), [(0.25, 5), (0.5, 10), (1.0, 20), (2.0, 40), (4.0, 80)]
)
def test_speed_is_periods_per_second_of_the_wall(
    fleet: Fleet, speed: float, ticks: int
) -> None:
    fleet.speed = speed
    fleet.advance(0.1)
    assert fleet.tick == ticks
    assert all(flight.tick == ticks for flight in fleet.flights)


def test_parts_of_a_period_are_kept_for_the_next_picture(fleet: Fleet) -> None:
    for _ in range(60):
        fleet.advance(1.0 / 60.0)
    assert 199 <= fleet.tick <= 200


def test_a_pause_stops_the_clock_and_a_step_is_one_period(fleet: Fleet) -> None:
    fleet.advance(0.1)
    fleet.playing = False
    fleet.advance(5.0)
    assert fleet.tick == 20
    fleet.playing = True
    fleet.step()
    assert (fleet.tick, fleet.playing) == (21, False)


def test_a_machine_that_stood_still_does_not_race_afterwards(fleet: Fleet) -> None:
    fleet.advance(60.0)
    assert fleet.tick == 50


def test_the_way_back_is_the_flight_before(fleet: Fleet) -> None:
    fleet.go(100)
    fleet.move({"environment.wind.force.x": 1.0})
    fleet.go(260)
    fleet.move({"plant.payload.mass": 0.03, "reference.base.z": 1.2})
    fleet.go(500)
    before = [states(flight) for flight in fleet.flights]
    for tick in (430, 0, 99, 100, 101, 260, 333):
        fleet.go(tick)
        for flight, flown in zip(fleet.flights, before, strict=True):
            assert (states(flight) == flown[:tick]).all()
    fleet.go(500)
    for flight, flown in zip(fleet.flights, before, strict=True):
        assert (states(flight) == flown).all()
        assert {tick: list(values) for tick, values in flight.moved.items()} == {
            100: ["environment.wind.force.x"],
            260: ["plant.payload.mass", "reference.base.z"],
        }


def test_a_change_in_the_past_takes_the_place_of_later_ones(fleet: Fleet) -> None:
    fleet.go(300)
    fleet.move({"environment.wind.force.x": 2.0})
    fleet.go(400)
    fleet.go(200)
    assert fleet.furthest == 400
    fleet.move({"environment.wind.force.y": 1.0})
    fleet.go(400)
    for flight in fleet.flights:
        assert flight.moved == {200: {"environment.wind.force.y": 1.0}}
        assert flight.session.scenario.wind.force_W.x == 0.0


def test_sliders_show_what_held_then(fleet: Fleet) -> None:
    fleet.go(50)
    fleet.move({"environment.wind.force.x": 1.0})
    fleet.go(80)
    fleet.move({"environment.wind.force.x": 2.0})
    assert fleet.flights[0].values == {"environment.wind.force.x": 2.0}
    fleet.go(60)
    assert fleet.flights[0].values == {"environment.wind.force.x": 1.0}
    fleet.go(10)
    assert fleet.flights[0].values == {}


def test_laws_meet_the_same_noise(fleet: Fleet) -> None:
    fleet.move({"sensors.position": 0.01})
    fleet.go(40)
    noise = [
        flight.session.log.measured_position - flight.session.log.position
        for flight in fleet.flights
    ]
    assert np.abs(noise[0]).max() > 0.01
    assert np.allclose(noise[0], noise[1], atol=1e-12)
    paths = [flight.session.log.position for flight in fleet.flights]
    assert not np.allclose(paths[0], paths[1], atol=1e-6)


def only(flight: Flight) -> FlownAgent:
    """The only vehicle of a flight."""
    (agent,) = flight.agents.values()
    return agent


def errors(flight: Flight, start: float, stop: float) -> np.ndarray:
    return np.array(
        [seen.error for seen in only(flight).sights if start <= seen.time <= stop]
    )


def test_a_gust_raises_the_tip_error_which_recovers(fleet: Fleet) -> None:
    fleet.go(200)
    fleet.push((0.0, 1.0, 0.0), 2.0, 1.0, "main")
    fleet.go(1180)  # before the arm moves
    for flight in fleet.flights:
        calm = errors(flight, 0.5, 1.0).max()
        assert errors(flight, 1.0, 2.5).max() > 4.0 * calm
        assert errors(flight, 5.5, 5.9).max() < 1.3 * calm


def test_computed_torque_stays_below_pd_in_the_papers_gust(fleet: Fleet) -> None:
    fleet.go(2600)
    ct, pd = (
        np.sqrt(np.mean(errors(flight, 7.5, 13.0) ** 2)) for flight in fleet.flights
    )
    assert ct < 0.95 * pd


def test_a_gain_is_of_one_law_alone(fleet: Fleet) -> None:
    fleet.move({"controller.gains.position.x": 8.0}, 0)
    ct, pd = fleet.flights
    assert ct.session.scenario.controller.par.gains.position.x == 8.0
    assert pd.session.scenario.controller.par.gains.position.x == 4.0


def test_a_law_that_joins_has_met_what_the_others_met(
    fleet: Fleet, made: Fleet
) -> None:
    fleet.go(150)
    fleet.move({"environment.wind.force.x": 1.0})
    fleet.go(300)
    fleet.move({"environment.wind.force.y": 1.0})
    fleet.move({"controller.gains.position.x": 5.0}, 0)
    fleet.go(250)
    late = made.make_flight("paper_pd")
    fleet.join(late)
    fleet.go(400)
    assert (states(late) == states(fleet.flights[1])).all()
    assert late.session.scenario.wind.force_W.y == 1.0
    # gains are a law's own
    other = made.make_flight("paper_ct")
    fleet.join(other, 2)
    assert other.session.scenario.controller.par.gains.position.x == 4.0
    fleet.leave(2)
    assert len(fleet.flights) == 2
    fleet.join(late)
    with pytest.raises(skyarm.ScenarioError, match="at most 3"):
        fleet.join(other)
    fleet.leave(2)


def test_a_flight_that_cannot_join_is_closed(
    fleet: Fleet, monkeypatch: pytest.MonkeyPatch
) -> None:
    late, closed = fleet.make_flight("paper_pd"), []

    def fail(_: int) -> None:
        raise skyarm.ScenarioError("no")

    monkeypatch.setattr(late, "to", fail)
    monkeypatch.setattr(late.session, "close", lambda: closed.append(True))
    with pytest.raises(skyarm.ScenarioError, match="no"):
        fleet.join(late)
    assert closed == [True]
    assert late not in fleet.flights


def test_a_lost_vehicle_is_shown_as_lost_until_a_reset(fleet: Fleet) -> None:
    fleet.go(100)
    fleet.move({"environment.faults.front.effectiveness": 0.0})
    fleet.go(700)
    assert all(flight.lost for flight in fleet.flights)
    assert all(flight.tick < 700 for flight in fleet.flights)
    fleet.go(90)
    assert not any(flight.lost for flight in fleet.flights)
    fleet.go(700)
    fleet.reset()
    assert not any(flight.lost or flight.moved for flight in fleet.flights)
    fleet.go(700)
    assert all(flight.tick == 700 for flight in fleet.flights)


def test_plots_keep_what_was_seen(fleet: Fleet) -> None:
    fleet.go(400)
    flight = fleet.flights[0]
    agent = only(flight)
    assert [seen.tick for seen in agent.recent(1.0)] == list(range(200, 401, 10))
    fleet.go(300)
    assert agent.recent(0.5)[-1].tick == agent.last.tick == 300
    log = flight.session.log
    seen = agent.recent(1.0)[5]
    wanted = np.linalg.norm(log.tool[seen.tick] - log.tool_reference[seen.tick])
    assert seen.error == pytest.approx(wanted, abs=1e-12)


def test_the_tip_of_a_plan_is_where_its_error_counts_from() -> None:
    one = skyarm.load_scenario("case1")
    place = (1.0, 2.0, 3.0)
    planned = PlannedBody(
        center=tuple(map(Constant, (0.0, 0.0, 0.0))), tip=tuple(map(Constant, place))
    )
    reference = dataclasses.replace(one.agent.reference, planned=planned)
    agent = dataclasses.replace(one.agent, reference=reference)
    moved = dataclasses.replace(one, agents={"vehicle": agent})
    start: Any = SimpleNamespace(
        scenario=moved, now=first_loop_state(moved), time=0.0, tick=0
    )
    (seen,) = sights(start)
    assert seen.error == pytest.approx(np.linalg.norm(seen.tip - place), rel=1e-12)


def test_the_end_of_the_longest_flight_stops_the_clock(fleet: Fleet) -> None:
    ended = Fleet("case2_gust")
    ended.scenario = dataclasses.replace(fleet.scenario, duration=2.0)
    ended.go(10_000)
    assert ended.tick == 399
    assert ended.time < 2.0


def fleet_of(document: dict[str, Any], folder: Path) -> Fleet:
    """The fleet of a scenario given by its tables."""
    file = folder / "written.toml"
    file.write_text(toml_text(document))
    return Fleet(str(file))


def tables(name: str) -> dict[str, Any]:
    """Tables of a shipped scenario."""
    return read_toml((LIBRARY / f"{name}.toml").read_bytes())


def test_mujocos_plant_flies_in_the_studio_too(tmp_path: Path) -> None:
    document = tables("case1")
    document["plant"]["kind"] = "mujoco"
    fleet = fleet_of(document, tmp_path)
    fleet.join(fleet.make_flight("paper_pd"))
    (flight,) = fleet.flights
    fleet.go(30)
    fleet.move({"environment.wind.force.y": 2.0})
    fleet.go(60)
    flown = states(flight)
    assert flown[-1, 1] > 1e-3
    fleet.go(20)
    assert flight.session.scenario.wind.force_W.y == 0.0
    fleet.go(60)
    assert (states(flight) == flown).all()
    plain = skyarm.run(
        skyarm.load_scenario(
            "case1", controller="paper_pd", plant="mujoco", duration=0.15
        )
    )
    assert (flown[:30, :3] == plain.position).all()


OTHERS = {
    **{
        "arm_length": "study",
        "press_in_four_worlds": "study",
        "loads_and_gusts": "suite",
    },
    **{"carrier": "vehicle", "servo_quad": "vehicle"},
}
"""Examples that are no scenarios -> what they are."""

EVERY = [*list_scenarios(), *sorted(str(path) for path in EXAMPLES.glob("*.toml"))]


@pytest.mark.parametrize(
    "source", sampled(EVERY, 8), ids=lambda source: Path(source).stem
)
def test_every_scenario_and_example_opens_with_the_reference_that_it_flies(
    source: str,
) -> None:
    if (stem := Path(source).stem) in OTHERS:
        with pytest.raises(
            skyarm.ScenarioError, match=rf"{stem}.toml: .* is a {OTHERS[stem]} file"
        ):
            Fleet(source)
        return
    fleet, scenario = Fleet(source), skyarm.load_scenario(source)
    flown = fleet.scenario
    assert flown.changes == scenario.changes
    for own, before in zip(
        flown.agents.values(), scenario.agents.values(), strict=True
    ):
        assert (own.reference, own.path_time) == (before.reference, before.path_time)
    assert flown.duration == (scenario.duration if fleet.planned else LONGEST)
    knobs = knobs_of(flown, pushes_of(flown).values())
    # a page has the sliders of the vehicle that is chosen, and those that all share
    for name in flown.agents:
        count = sum(agent_of(knob.path) in ("", name) for knob in knobs)
        assert 30 < count < 200, "a page's sliders, none for a curve's coefficients"


@pytest.mark.thorough
@pytest.mark.parametrize(
    "source", [each for each in EVERY if Path(each).stem not in OTHERS]
)
def test_every_scenario_and_example_flies_in_the_studio_as_in_run(source: str) -> None:
    fleet = Fleet(source)
    fleet.join(fleet.make_flight(None))
    ticks = round(
        min(9.0, skyarm.load_scenario(source).duration) * fleet.rate
    )  # a payload of an example is held by then
    fleet.go(ticks - 1)
    plain = skyarm.Session(skyarm.load_scenario(source))
    while plain.tick < ticks - 1 and plain.step():
        pass
    found, flown = states(fleet.flights[0]), states(SimpleNamespace(session=plain))  # type: ignore[arg-type]
    # numbers that a slider may change are fused otherwise into products and sums: a peg
    # in its hole lets that grow
    assert np.abs(found - flown).max() < (
        1e-4 if Path(source).stem == "insert_a_peg" else 1e-6
    )


def believed() -> dict[str, Any]:
    """A document with a planned reference and a payload of which the law is told in
    flight.
    """
    document = tables("case1")
    document["payloads"] = [{"mass": 0.05, "pick": 0.3, "drop": 0.6, "believed": True}]
    document["reference"] = {
        "tip": {
            "path": {
                "kind": "circle",
                "radius": 0.05,
                "frequency_hz": 0.5,
                "center": [0.0, 0.0, 0.8],
            },
            "posture": [0.4, -0.8],
            "base_share": 0.5,
        }
    }
    document["changes"] = [
        {"at": 0.2, "path": "environment.wind.force.y", "value": 1.0}
    ]
    document["environment"] = {"wind": {"mode": "force_wind", "force": [0.0, 0.0, 0.0]}}
    return {**document, "duration": 1.0, "windows": {}}


def test_sliders_show_what_changes_of_the_file_have_set(tmp_path: Path) -> None:
    document = believed()
    # as the file may name what the slider names y
    document["changes"][0]["path"] = "environment.wind.force.1"
    joints = [{"kind": "constant", "value": 0.25}, {"kind": "constant", "value": -0.8}]
    document["reference"] = {
        "base": {"kind": "hover", "position": [0.0, 0.0, 1.0]},
        "joints": joints,
    }
    later = [{"kind": "constant", "value": 0.3}, joints[1]]
    document["changes"].append({"at": 0.4, "path": "reference.joints", "value": later})
    fleet = fleet_of(document, tmp_path)
    fleet.join(fleet.make_flight(None))
    (flight,) = fleet.flights
    fleet.go(30)
    assert (flight.values, flight.due) == ({}, 0)
    fleet.go(50)
    assert flight.values["environment.wind.force.y"] == 1.0
    fleet.go(90)
    assert flight.values["model.payload.mass"] == 0.05
    assert {
        path: value for path, value in flight.values.items() if "joints" in path
    } == {"reference.joints.0.value": 0.3}
    assert flight.due == 3
    fleet.go(45)
    assert flight.due == 1
    assert set(flight.values) == {
        "environment.wind.force.1",
        "environment.wind.force.y",
    }


def test_the_slider_of_the_delay_holds_that_of_the_file(tmp_path: Path) -> None:
    for delays, high in (
        ({"command": 0.05}, 0.05),
        ({"command": 0.005, "rotors": 0.01}, 0.02),
        ({}, 0.03),
    ):
        fleet = fleet_of(tables("case1") | {"delays": delays}, tmp_path)
        (knob,) = (
            each
            for each in fleet.make_flight(None).knobs
            if each.path == "delays.command"
        )
        assert (knob.low, knob.value) == (0.0, delays.get("command", 0.0))
        assert knob.high == pytest.approx(high)


def test_changes_of_a_file_and_of_a_hand_hold_together_and_are_saved_together(
    tmp_path: Path,
) -> None:
    document = believed()
    fleet = fleet_of(document, tmp_path)
    fleet.join(fleet.make_flight(None))
    (flight,) = fleet.flights
    assert fleet.planned
    fleet.go(150)
    assert (
        states(flight) == states_of(skyarm.run(skyarm.scenario_from(document)))[:150]
    ).all()
    fleet.go(80)
    fleet.move({"environment.wind.force.x": 1.0})
    fleet.go(60)
    fleet.go(150)
    fleet.save(tmp_path)
    file = next(tmp_path.glob("*.npz"))
    saved = skyarm.load_scenario(file)
    again = skyarm.run(skyarm.load_scenario(file.with_suffix(".toml")))
    wind, told = "environment.wind.force", "model.payload.mass"
    assert [(each.at, each.path, each.value) for each in scheduled_changes(saved)] == [
        (0.2, f"{wind}.y", 1.0),
        (0.4, f"{wind}.x", 1.0),
        (0.3, told, 0.05),
        (0.6, told, 0.0),
    ]
    log = skyarm.run(saved)
    assert (states(flight) == states_of(log)[:150]).all()
    assert (states_of(again) == states_of(log)).all()
    assert log.info["duration"] == 1.0, "the reference is planned for so long"
    fleet.go(1000)
    assert fleet.time == pytest.approx(1.0 - 1.0 / fleet.rate)


def test_another_law_flies_without_the_changes_of_the_files_own(tmp_path: Path) -> None:
    document = tables("case2")
    document["changes"] = [
        {"at": 0.2, "path": "controller.gains.position.x", "value": 3.0}
    ]
    fleet = fleet_of(document, tmp_path)
    assert len(fleet.scenario.changes) == 1
    assert not fleet.under("centroidal_tip").changes


def scene_of(session: skyarm.Session) -> Scene:
    """What is drawn around the only vehicle now."""
    (scene,) = scenes_at(session.scenario, session.now, session.time, np.zeros(3))
    return scene


def test_a_payload_is_drawn_while_it_is_held() -> None:
    load = TimedPayload(mass=0.02, pick=0.01, drop=0.03)
    scenario = dataclasses.replace(skyarm.load_scenario("case2"), payloads=(load,))
    session = skyarm.Session(scenario, machine_code=False)
    held = []
    for _ in range(8):
        session.step()
        held.append(len(scene_of(session).solids))
    assert held == [0, 0, 1, 1, 1, 1, 0, 0]
    assert "payloads.0.mass" in [knob.path for knob in knobs_of(scenario)]


@pytest.mark.parametrize(("seconds", "tick"), [(0.25, 50), (9.0, 120)])
def test_the_slider_of_time_goes_back_and_no_further_than_was_flown(
    seconds: float, tick: int
) -> None:
    gone: list[int] = []
    fleet = SimpleNamespace(rate=200, furthest=120, playing=True, go=gone.append)
    Clock.go_to_time(fleet, seconds)  # type: ignore[arg-type]
    assert (gone, fleet.playing) == ([tick], False)


def test_a_grasp_that_has_opened_pulls_with_no_arrow() -> None:
    tables = tomllib.loads((TEAMS / "bar.toml").read_text("utf-8")) | {"duration": 0.3}
    (grasp, _), _ = tables["world"]["grasps"], tables.pop("agents")
    del grasp["agent"]
    grasp |= {"place": [0.0, 0.0, 0.0097], "release": 0.05}
    tables["world"]["grasps"] = [grasp]
    tables["reference"] = {"base": {"kind": "hover", "position": [0.0, 0.0, 1.0]}}
    scenario = skyarm.scenario_from(tables, TEAMS)
    session = skyarm.Session(scenario, machine_code=False)
    arrows = {}
    for k in range(1, 41):
        session.step()
        arrows[k] = sum(
            float(np.abs(each.force).max()) for each in scene_of(session).arrows
        )
    assert 0.1 < arrows[8] < 2.0
    assert arrows[40] == 0.0


@pytest.mark.parametrize("pitch", [0.4, -1.2, 2.5])
def test_the_tilt_is_the_angle_of_the_base_against_the_vertical(pitch: float) -> None:
    one = with_numbers(
        skyarm.load_scenario("case1"), {"initial.yaw": 1.0, "initial.pitch": pitch}
    )
    start: Any = SimpleNamespace(
        scenario=one, now=first_loop_state(one), time=0.0, tick=0
    )
    (seen,) = sights(start)
    assert seen.tilt == pytest.approx(abs(pitch), abs=1e-12)
